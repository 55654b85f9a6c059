#include "scene/bounds.h"

#include <math.h>

void bounds_of_shape(const Description *d, const Shape *shape, double low[3], double high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        const double *row = shape->to_world.m[axis];
        double reach = fabs(row[0]) + fabs(row[1]) + (shape->kind == SHAPE_CUBE ? fabs(row[2]) : 0);
        if (shape->kind == SHAPE_SPHERE)
            reach = fabs(row[axis]);
        low[axis] = row[3] - reach;
        high[axis] = row[3] + reach;
        for (int i = 0; i < 3 * shape->triangle_count; i++) {
            double x = d->mesh.vertex[d->mesh.triangle[shape->first_triangle + i / 3][i % 3]][axis];
            low[axis] = i ? fmin(low[axis], x) : x;
            high[axis] = i ? fmax(high[axis], x) : x;
        }
    }
}

void bounds_of_scene(const Description *d, double low[3], double high[3])
{
    double from[3], to[3];
    for (int axis = 0; axis < 3; axis++)
        low[axis] = high[axis] = 0;
    for (int i = 0; i < d->shape_count; i++) {
        bounds_of_shape(d, &d->shapes[i], from, to);
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = i ? fmin(low[axis], from[axis]) : from[axis];
            high[axis] = i ? fmax(high[axis], to[axis]) : to[axis];
        }
    }
}
