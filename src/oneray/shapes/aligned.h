/* Rectangles whose sides lie along the axes: those across one axis share a division. */
#pragma once

#ifdef LANES

#include "shapes/rectangle.h"

/* Sides along u = axis+1 and v = axis+2 (mod 3), in the plane p[axis] = plane. The axis is a constant in what follows. */
typedef struct aligned_row {
    Num plane, center_u, center_v, half_u, half_v;
} AlignedRow;

INLINE Real along(Vec a, int axis) { return axis == 0 ? a.x : axis == 1 ? a.y : a.z; }

INLINE Crossing aligned_crossing(const AlignedRow *a, const Ray *ray, int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Real d = along(ray->d, axis);
    Crossing c = {flip_sign(real(a->plane) - along(ray->o, axis), d), real_abs(d), real(0), real(0)};
    c.x = (along(ray->o, u) - real(a->center_u)) * c.den + along(ray->d, u) * c.num;
    c.y = (along(ray->o, v) - real(a->center_v)) * c.den + along(ray->d, v) * c.num;
    return c;
}
INLINE Mask within_aligned(const AlignedRow *a, Crossing c)
{
    return (real_abs(c.x) <= real(a->half_u) * c.den) & (real_abs(c.y) <= real(a->half_v) * c.den);
}
/* Where the ray meets a rectangle along the axes, those of one axis sharing a division. */
INLINE Mask aligned_meets(const AlignedRow *a, const Ray *ray, int axis, Real inverse, Real *t)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    *t = (real(a->plane) - along(ray->o, axis)) * inverse;
    Real x = along(ray->o, u) + *t * along(ray->d, u) - real(a->center_u);
    Real y = along(ray->o, v) + *t * along(ray->d, v) - real(a->center_v);
    return (real_abs(x) <= real(a->half_u)) & (real_abs(y) <= real(a->half_v)) & (*t > real(0));
}

INLINE SurfaceFrame aligned_uv(Vec at, Index nth) { return rectangle_uv(at, nth); }

#endif
