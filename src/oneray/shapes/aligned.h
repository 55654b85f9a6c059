/* Rectangles whose sides lie along the axes: those across one axis share a division. */
#pragma once

#ifdef LANES

#include "shapes/rectangle.h"

/* Sides along u = axis+1 and v = axis+2 (mod 3), in the plane p[axis] = plane. The axis is a constant in what follows. */
typedef struct aligned_row {
    Num plane, center_u, center_v, half_u, half_v, unused[3];
} AlignedRow;

INLINE Real along(Vec a, int axis) { return axis == 0 ? a.x : axis == 1 ? a.y : a.z; }

/* One of them and the ray, [0] across it, [1] along u, [2] along v: the same rectangle for all lanes, or one a lane. */
typedef struct {
    Real plane, center_u, center_v, half_u, half_v, o[3], d[3];
} AlignedView;

INLINE AlignedView aligned_view(const AlignedRow *a, const Ray *ray, int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    return (AlignedView){real(a->plane), real(a->center_u), real(a->center_v), real(a->half_u),
        real(a->half_v), {along(ray->o, axis), along(ray->o, u), along(ray->o, v)},
        {along(ray->d, axis), along(ray->d, u), along(ray->d, v)}};
}

INLINE AlignedView aligned_views(const Shapes *shapes, const Ray *ray, Index slot)
{
    Real row[8];
    gather_row(shapes->rows[SHAPE_ALIGNED], slot, 8, row);
    Mask x = slot < index_of(shapes->along[1]), y = slot < index_of(shapes->along[2]);
    Vec o = ray->o, d = ray->d;
    return (AlignedView){row[0], row[1], row[2], row[3], row[4],
        {along_axis(x, y, o.x, o.y, o.z), along_axis(x, y, o.y, o.z, o.x), along_axis(x, y, o.z, o.x, o.y)},
        {along_axis(x, y, d.x, d.y, d.z), along_axis(x, y, d.y, d.z, d.x), along_axis(x, y, d.z, d.x, d.y)}};
}

INLINE Crossing aligned_crossing(const AlignedView *a)
{
    Crossing c = {flip_sign(a->plane - a->o[0], a->d[0]), real_abs(a->d[0]), real(0), real(0)};
    c.x = (a->o[1] - a->center_u) * c.den + a->d[1] * c.num;
    c.y = (a->o[2] - a->center_v) * c.den + a->d[2] * c.num;
    return c;
}
INLINE Mask within_aligned(const AlignedView *a, Crossing c)
{
    return (real_abs(c.x) <= a->half_u * c.den) & (real_abs(c.y) <= a->half_v * c.den);
}
/* Where the ray meets a rectangle along the axes; inverse: 1/d[0], which those of one axis share. */
INLINE Mask aligned_meets(const AlignedView *a, Real inverse, Real *t)
{
    *t = (a->plane - a->o[0]) * inverse;
    Real x = a->o[1] + *t * a->d[1] - a->center_u;
    Real y = a->o[2] + *t * a->d[2] - a->center_v;
    return (real_abs(x) <= a->half_u) & (real_abs(y) <= a->half_v) & (*t > real(0));
}

INLINE SurfaceFrame aligned_uv(Vec at, Index nth) { return rectangle_uv(at, nth); }

#endif
