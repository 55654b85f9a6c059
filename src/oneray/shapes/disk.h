/* The disk x² + y² ≤ 1 at z = 0, with normal +z. */
#pragma once

#include "shapes/placed.h"

typedef struct disk {
    Placed placed;
} Disk;

static const Plugin disk_plugin = {"disk", NULL, {PLACED_FIELDS}};

enum { disk_planes = 1 };
static inline Side disk_side(const Disk *s, int k)
{
    (void)k;
    Side side = placed_side(&s->placed, 2, 0);
    side.area = PI * side.across;
    return side;
}
static inline Extent disk_extent(const Disk *s) { return placed_extent(&s->placed, true); }

#ifdef LANES

#include "shapes/shape.h"

typedef struct disk_row {
    Local to_unit;
} DiskRow;
static inline void disk_row(const Disk *s, DiskRow *row) { row->to_unit = local_of(&s->placed.to_world); }

INLINE Crossing disk_cross(const Shapes *shapes, int i, const Ray *ray, Mask *within)
{
    Crossing c = flat_crossing(&ROWS(shapes, DISK, Disk)[i].to_unit, ray);
    *within = c.x * c.x + c.y * c.y <= c.den * c.den;
    return c;
}

/* A point of the unit disk, uniform by area. */
INLINE void disk_sample(Real u, Real v, Real *x, Real *y) { sample_disk(u, v, x, y); }

/* Polar: u is the radius, v the angle in turns. In the middle p does not move with either. */
INLINE SurfaceFrame disk_uv(Vec at, Index nth)
{
    (void)nth;
    Real radius = real_sqrt(at.x * at.x + at.y * at.y), two_pi = real(2) * REAL_PI;
    Real inverse = real(1) / select(radius == real(0), real(1), radius);
    return (SurfaceFrame){radius, turn_of(at.x, at.y), vec(at.x * inverse, at.y * inverse, real(0)),
        vec(-two_pi * at.y, two_pi * at.x, real(0))};
}

#endif
