/* A texture that oneray does not have: from one colour to another as u grows, and again in the next unit. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct ramp {
    double color0[3], color1[3];
    Affine to_uv;
} Ramp;

static const Plugin ramp_plugin = {"ramp", NULL, {
    {"color0", AS_COLOUR, offsetof(Ramp, color0), "[0,1]", "0"},
    {"color1", AS_COLOUR, offsetof(Ramp, color1), "[0,1]", "1"},
    {"to_uv", AS_TRANSFORM, offsetof(Ramp, to_uv), NULL, ""}}};

static inline TextureTraits ramp_traits(const Ramp *t)
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

typedef struct ramp_row {
    ToUv to_uv;
    Num color0[3], color1[3];
} RampRow;
static inline void ramp_row(const Ramp *t, RampRow *row)
{
    store_to_uv(&row->to_uv, &t->to_uv);
    store(row->color0, t->color0);
    store(row->color1, t->color1);
}

INLINE Light ramp_at(const Textures *textures, Index row, Real u, Real v)
{
    (void)v;
    Real along = real_fraction(u);
    return light_add(light_scale(TEXTURE_LIGHT(textures, row, Ramp, color0), real(1) - along),
        light_scale(TEXTURE_LIGHT(textures, row, Ramp, color1), along));
}

#endif
