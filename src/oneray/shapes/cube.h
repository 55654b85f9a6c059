/* The cube [-1,1]³, with normals outwards. Its side k is at +1 or, for an odd k, -1 of axis k/2. */
#ifndef ONERAY_SHAPES_CUBE_H
#define ONERAY_SHAPES_CUBE_H

#include "shapes/placed.h"

typedef struct cube {
    Placed placed;
} Cube;

static const Plugin cube_plugin = {"cube", placed_fields, NULL};

enum { cube_planar = 1, cube_sides = 6 };
static inline Side cube_side(const Cube *s, int k) { return placed_side(&s->placed, k / 2, 1 - 2 * (k % 2)); }
static inline Extent cube_extent(const Cube *s) { return placed_extent(&s->placed, false); }

#endif
