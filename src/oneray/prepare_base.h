/* What all of prepare_*.h use: room that lives as long as the scene, and vectors of doubles. */
#ifndef ONERAY_PREPARE_BASE_H
#define ONERAY_PREPARE_BASE_H

#include "message.h"
#include "scene.h"

#include <stdlib.h>

#define PI 3.14159265358979323846

/* Room that lives as long as the scene, zeroed. */
static void *keep(Scene *scene, size_t count, size_t size)
{
    scene->kept = reallocate(scene->kept, (size_t)scene->kept_count + 1, sizeof *scene->kept);
    return scene->kept[scene->kept_count++] = allocate(count, size);
}

static void store(Num to[3], const double from[3])
{
    for (int i = 0; i < 3; i++)
        to[i] = (Num)from[i];
}
static void column(const Affine *a, int j, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a->m[i][j];
}
static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}
static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static double length(const double a[3]) { return sqrt(dot(a, a)); }

/* The axis-aligned box around a shape; around a flat one's own box, for one that is turned. */
static void box_of(const Description *d, const Shape *shape, double low[3], double high[3])
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

#endif
