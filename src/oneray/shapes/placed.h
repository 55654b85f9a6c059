/* Shapes of unit size, placed in the world by a matrix, and the sides that shapes have. */
#pragma once

#include "fields.h"
#include "vectors.h"

#include <stdbool.h>

/* What the struct of such a shape begins with. */
typedef struct {
    Affine to_world;
    bool flip_normals;
} Placed;

#define PLACED_FIELDS                                                                                        \
    {"to_world", AS_TRANSFORM, offsetof(Placed, to_world), NULL, ""},                                        \
    {"flip_normals", AS_BOOLEAN, offsetof(Placed, flip_normals), NULL, "false"}

/* How many slots, what a ray can hit, a shape with that many planes of its own has; a round one has one. */
static inline int slots_of_planes(int planes) { return planes ? planes : 1; }

/* A side, each of which shines as a light of its own. */
typedef struct {
    double middle[3];
    double x[3], y[3];  /* half the sides of a parallelogram, radii; of a triangle, two sides */
    double normal[3];   /* of a flat side: unit, outwards, whatever flip_normals says; 0 where it has no area */
    double axis[3];      /* of a cylinder: from the middle to an end */
    double across, area; /* |x × y| and the area, m² */
} Side;

/* Where the local coordinate `axis` of the unit shape is `at`. */
static inline Side placed_side(const Placed *shape, int axis, double at)
{
    Side side;
    double z[3];
    column(&shape->to_world, (axis + 1) % 3, side.x);
    column(&shape->to_world, (axis + 2) % 3, side.y);
    column(&shape->to_world, axis, z);
    column(&shape->to_world, 3, side.middle);
    cross(side.x, side.y, side.normal);
    side.across = length(side.normal);
    double sign = (at < 0 ? -1 : 1) * (dot(side.normal, z) < 0 ? -1 : 1) / side.across;
    for (int i = 0; i < 3; i++) {
        side.normal[i] *= sign;
        side.middle[i] += at * z[i];
    }
    side.area = 4 * side.across;
    return side;
}

/* The box around a shape, and what of its size matters to single precision. */
typedef struct {
    double low[3], high[3];
    double least;  /* half its shortest side */
    double height; /* of its triangles, in the mean; infinite if it has none */
} Extent;

/* Local coordinates are in [-1,1]; of a flat shape two. */
static inline Extent placed_extent(const Placed *shape, bool flat)
{
    Extent e = {.least = HUGE_VAL, .height = HUGE_VAL};
    for (int i = 0; i < 3; i++) {
        const double *row = shape->to_world.m[i];
        double reach = fabs(row[0]) + fabs(row[1]) + (flat ? 0 : fabs(row[2])), axis[3];
        column(&shape->to_world, i, axis);
        e.low[i] = row[3] - reach;
        e.high[i] = row[3] + reach;
        if (i < 2 || !flat)
            e.least = fmin(e.least, length(axis));
    }
    return e;
}

static inline Extent ball_extent(const double center[3], double radius)
{
    Extent e = {.least = radius, .height = HUGE_VAL};
    for (int i = 0; i < 3; i++) {
        e.low[i] = center[i] - radius;
        e.high[i] = center[i] + radius;
    }
    return e;
}
