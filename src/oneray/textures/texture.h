/* What all textures share: their rows, and how a point of a surface finds its place in one.

   textures/NAME.h defines, for a kind of the list TEXTURES in kinds.h,
     Name, name_plugin   what a scene file says of it
     name_traits         what is asked of that (traits.h)
     NameRow, name_row   its numbers as a kernel has them, to_uv first, and how they come about
     name_at             its value at (u, v), to_uv done.
   lookup.h chooses between them. */
#pragma once

#include "lanes/light.h"
#include "vectors.h"

#include <stddef.h>

/* By row; row 0 is no texture, so that what a surface names is right whether it has one or not. */
typedef struct {
    Num *numbers; /* by row 2^shift of them: the NameRow of its kind */
    int shift;
    Int last;  /* row */
    Int *kind; /* TextureKind */
    Num *pixels; /* of all that look at a picture, one after the other, three numbers each */
    Int *first;  /* of them, by row */
} Textures;

/* to_uv, which acts on (u, v) before a texture looks: rows of the matrix, u, v, 1. */
typedef struct {
    Num u[4], v[4];
} ToUv;
static inline void store_to_uv(ToUv *row, const Affine *to_uv)
{
    *row = (ToUv){{(Num)to_uv->m[0][0], (Num)to_uv->m[0][1], (Num)to_uv->m[0][3], 0},
        {(Num)to_uv->m[1][0], (Num)to_uv->m[1][1], (Num)to_uv->m[1][3], 0}};
}

/* A row's numbers: TEXTURE_LIGHT(textures, row, Checkerboard, color0). */
#define TEXTURE_LIGHT(textures, row, Name, member)                                                           \
    light_gather((textures)->numbers + offsetof(Name##Row, member) / sizeof(Num), (row) << (textures)->shift)
