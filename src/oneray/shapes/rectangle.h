/* The rectangle [-1,1]² at z = 0, with normal +z. */
#ifndef ONERAY_SHAPES_RECTANGLE_H
#define ONERAY_SHAPES_RECTANGLE_H

#include "shapes/placed.h"

typedef struct rectangle {
    Placed placed;
} Rectangle;

static const Plugin rectangle_plugin = {"rectangle", placed_fields, NULL};

enum { rectangle_planar = 1, rectangle_sides = 1 };
static inline Side rectangle_side(const Rectangle *s, int k) { return (void)k, placed_side(&s->placed, 2, 0); }
static inline Extent rectangle_extent(const Rectangle *s) { return placed_extent(&s->placed, true); }

#endif
