#ifndef ONERAY_SHAPES_DISK_H
#define ONERAY_SHAPES_DISK_H

#include "shapes/shape.h"

typedef Local DiskRow;

INLINE Crossing disk_cross(const Shapes *shapes, int i, const Ray *ray, Mask *within)
{
    Crossing c = flat_crossing(&ROWS(shapes, DISK, Disk)[i], ray);
    *within = c.x * c.x + c.y * c.y <= c.den * c.den;
    return c;
}

/* A point of the unit disk, uniform by area. */
INLINE void disk_sample(Real u, Real v, Real *x, Real *y) { sample_disk(u, v, x, y); }

#endif
