/* P4 Checkerboard: fields of two colours by turns, half a unit of (u, v) wide. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct checkerboard {
    double color0[3], color1[3];
    Affine to_uv;
} Checkerboard;

static const Plugin checkerboard_plugin = {"checkerboard", NULL, {
    {"color0", AS_COLOUR, offsetof(Checkerboard, color0), "[0,1]", ".4"},
    {"color1", AS_COLOUR, offsetof(Checkerboard, color1), "[0,1]", ".2"},
    {"to_uv", AS_TRANSFORM, offsetof(Checkerboard, to_uv), NULL, ""}}};

static inline TextureTraits checkerboard_traits(const Checkerboard *t)
{
    TextureTraits traits = {.to_uv = &t->to_uv};
    for (int c = 0; c < 3; c++) {
        traits.most[c] = fmax(t->color0[c], t->color1[c]);
        traits.least[c] = fmin(t->color0[c], t->color1[c]);
    }
    return traits;
}

#ifdef LANES

#include "textures/texture.h"

typedef struct checkerboard_row {
    ToUv to_uv;
    Num color0[3], color1[3];
} CheckerboardRow;
static inline void checkerboard_row(const Checkerboard *t, CheckerboardRow *row)
{
    store_to_uv(&row->to_uv, &t->to_uv);
    store(row->color0, t->color0);
    store(row->color1, t->color1);
}

/* color0 where u and v are both in the first half of their unit, or both in the second. */
INLINE Light checkerboard_at(const Textures *textures, Index row, Real u, Real v)
{
    Mask differ = (real_fraction(u) > real(0.5)) ^ (real_fraction(v) > real(0.5));
    return light_select(differ, TEXTURE_LIGHT(textures, row, Checkerboard, color1),
        TEXTURE_LIGHT(textures, row, Checkerboard, color0));
}

#endif
