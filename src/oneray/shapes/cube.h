/* The cube [-1,1]³, with normals outwards. Its side k is at +1 or, for an odd k, -1 of axis k/2. */
#ifndef ONERAY_SHAPES_CUBE_H
#define ONERAY_SHAPES_CUBE_H

#include "shapes/placed.h"

typedef struct cube {
    Placed placed;
} Cube;

static const Plugin cube_plugin = {"cube", placed_fields, NULL};

enum { cube_planes = 6 };
static inline int cube_sides(const Cube *s) { return (void)s, 6; }
static inline Side cube_side(const Cube *s, int k) { return placed_side(&s->placed, k / 2, 1 - 2 * (k % 2)); }
static inline Size cube_size(const Cube *s) { return placed_size(&s->placed, false); }
static inline void cube_bounds(const Cube *s, double low[3], double high[3])
{
    placed_bounds(&s->placed, false, low, high);
}

#endif
