/* Shapes of unit size, placed in the world by a matrix, and the sides that shapes have. */
#ifndef ONERAY_SHAPES_PLACED_H
#define ONERAY_SHAPES_PLACED_H

#include "fields.h"
#include "vectors.h"

#include <stdbool.h>

/* What the struct of such a shape begins with. */
typedef struct {
    Affine to_world;
    bool flip_normals;
} Placed;

static const Field placed_fields[] = {
    {"to_world", AS_TRANSFORM, offsetof(Placed, to_world), NULL, ""},
    {"flip_normals", AS_BOOLEAN, offsetof(Placed, flip_normals), NULL, "false"},
    {0},
};

/* A side, each of which shines as a light of its own. */
typedef struct {
    double middle[3];
    double x[3], y[3];  /* half the sides of a parallelogram, radii; of a triangle, two sides */
    double normal[3];   /* of a flat side: unit, outwards, whatever flip_normals says; 0 where it has no area */
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

/* The box around the shape, whose local coordinates are in [-1,1]; flat, in two of them only. */
static inline void placed_bounds(const Placed *shape, bool flat, double low[3], double high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        const double *row = shape->to_world.m[axis];
        double reach = fabs(row[0]) + fabs(row[1]) + (flat ? 0 : fabs(row[2]));
        low[axis] = row[3] - reach;
        high[axis] = row[3] + reach;
    }
}

/* What of a shape's size matters to single precision. */
typedef struct {
    double least;  /* half its shortest side */
    double height; /* of its triangles, in the mean; infinite if it has none */
} Size;

static inline Size placed_size(const Placed *shape, bool flat)
{
    Size size = {HUGE_VAL, HUGE_VAL};
    for (int j = 0; j < (flat ? 2 : 3); j++) {
        double axis[3];
        column(&shape->to_world, j, axis);
        size.least = fmin(size.least, length(axis));
    }
    return size;
}

#endif
