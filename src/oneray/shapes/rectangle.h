#ifndef ONERAY_SHAPES_RECTANGLE_H
#define ONERAY_SHAPES_RECTANGLE_H

#include "shapes/shape.h"

typedef Local RectangleRow;

INLINE Crossing rectangle_cross(const Shapes *shapes, int i, const Ray *ray, Mask *within)
{
    Crossing c = flat_crossing(&ROWS(shapes, RECTANGLE, Rectangle)[i], ray);
    *within = (real_abs(c.x) <= c.den) & (real_abs(c.y) <= c.den);
    return c;
}

/* A point of the square [-1,1]², uniform by area. */
INLINE void rectangle_sample(Real u, Real v, Real *x, Real *y) { sample_square(u, v, x, y); }

#endif
