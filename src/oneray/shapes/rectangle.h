/* The rectangle [-1,1]² at z = 0, with normal +z. */
#pragma once

#include "shapes/placed.h"

typedef struct rectangle {
    Placed placed;
} Rectangle;

static const Plugin rectangle_plugin = {"rectangle", NULL, {PLACED_FIELDS}};

enum { rectangle_planes = 1 };
static inline Side rectangle_side(const Rectangle *s, int k) { return (void)k, placed_side(&s->placed, 2, 0); }
static inline Extent rectangle_extent(const Rectangle *s) { return placed_extent(&s->placed, true); }

#ifdef LANES

#include "shapes/shape.h"

typedef struct rectangle_row {
    Local to_unit;
} RectangleRow;
static inline void rectangle_row(const Rectangle *s, RectangleRow *row) { row->to_unit = local_of(&s->placed.to_world); }

INLINE Crossing rectangle_cross(const Shapes *shapes, int i, const Ray *ray, Mask *within)
{
    Crossing c = flat_crossing(&ROWS(shapes, RECTANGLE, Rectangle)[i].to_unit, ray);
    *within = (real_abs(c.x) <= c.den) & (real_abs(c.y) <= c.den);
    return c;
}

/* A point of the square [-1,1]², uniform by area. */
INLINE void rectangle_sample(Real u, Real v, Real *x, Real *y) { sample_square(u, v, x, y); }

/* u = (x + 1)/2, v = (y + 1)/2. */
INLINE SurfaceFrame rectangle_uv(Vec at, Index nth)
{
    (void)nth;
    return frame_of_square(vec(real(1), real(0), real(0)), vec(real(0), real(1), real(0)), at);
}

#endif
