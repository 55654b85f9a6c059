/* The disk x² + y² ≤ 1 at z = 0, with normal +z. */
#ifndef ONERAY_SHAPES_DISK_H
#define ONERAY_SHAPES_DISK_H

#include "shapes/placed.h"

typedef struct disk {
    Placed placed;
} Disk;

static const Plugin disk_plugin = {"disk", placed_fields, NULL};

enum { disk_planar = 1, disk_sides = 1 };
static inline Side disk_side(const Disk *s, int k)
{
    (void)k;
    Side side = placed_side(&s->placed, 2, 0);
    side.area = PI * side.across;
    return side;
}
static inline Extent disk_extent(const Disk *s) { return placed_extent(&s->placed, true); }

#endif
