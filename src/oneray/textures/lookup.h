/* P4 What a texture is at a point, whatever its kind. */
#pragma once

#include "kinds/textures.h"

/* The value at (u, v) of a row of the textures, 1 of row 0. */
SELDOM Light texture_at(const Textures *textures, Index row, Real u, Real v, Features f)
{
    Light value = light_all(real(1));
    Index kind = gather_index(textures->kind, row);
    Real to_u[4], to_v[4];
    gather_four(textures->numbers, row << textures->shift, to_u);
    gather_four(textures->numbers + 4, row << textures->shift, to_v);
    Real x = to_u[0] * u + to_u[1] * v + to_u[2], y = to_v[0] * u + to_v[1] * v + to_v[2];
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        value = light_select(kind == index_of(TEXTURE_##NAME), name##_at(textures, row, x, y), value);
    TEXTURES(X)
#undef X
    return value;
}

/* By how much the luminance of a bitmap's row grows with u and with v. As in Mitsuba, the picture's width goes with u and its
   height with v, also where to_uv turns it. */
SELDOM void texture_slope(const Textures *textures, Index row, Real u, Real v, Real slope[2], Features f)
{
    Real to_u[4], to_v[4], size[4], pixel[2];
    slope[0] = slope[1] = real(0);
    if (!(f.has & HAS_BITMAP))
        return;
    gather_four(textures->numbers, row << textures->shift, to_u);
    gather_four(textures->numbers + 4, row << textures->shift, to_v);
    Real x = to_u[0] * u + to_u[1] * v + to_u[2], y = to_v[0] * u + to_v[1] * v + to_v[2];
    bitmap_slope(textures, row, x, y, pixel, size);
    slope[0] = size[0] * (to_u[0] * pixel[0] + to_v[0] * pixel[1]);
    slope[1] = size[1] * (to_u[1] * pixel[0] + to_v[1] * pixel[1]);
}
