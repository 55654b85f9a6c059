/* The disk x² + y² ≤ 1 at z = 0, with normal +z. */
#ifndef ONERAY_SHAPES_DISK_H
#define ONERAY_SHAPES_DISK_H

#include "shapes/placed.h"

typedef struct disk {
    Placed placed;
} Disk;

static const Plugin disk_plugin = {"disk", placed_fields, NULL};

enum { disk_planes = 1 };
static inline int disk_sides(const Disk *s) { return (void)s, 1; }
static inline Side disk_side(const Disk *s, int k)
{
    (void)k;
    Side side = placed_side(&s->placed, 2, 0);
    side.area = PI * side.across;
    return side;
}
static inline Size disk_size(const Disk *s) { return placed_size(&s->placed, true); }
static inline void disk_bounds(const Disk *s, double low[3], double high[3])
{
    placed_bounds(&s->placed, true, low, high);
}

#endif
