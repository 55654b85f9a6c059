/* What all of prepare_*.h use: room that lives as long as the scene, and vectors of doubles. */
#ifndef ONERAY_PREPARE_BASE_H
#define ONERAY_PREPARE_BASE_H

#include "scene/bounds.h"
#include "message.h"
#include "prepare/scene.h"

#include <stdlib.h>

#define PI 3.14159265358979323846

/* Room that lives as long as the scene, zeroed; what gather_four reads beyond the end is there. */
static void *keep(Scene *scene, size_t count, size_t size)
{
    scene->kept = reallocate(scene->kept, (size_t)scene->kept_count + 1, sizeof *scene->kept);
    return scene->kept[scene->kept_count++] = allocate(count + (3 * sizeof(Num) + size - 1) / size, size);
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
/* Whatever the numbers' size: no square underflows or overflows. */
static double length(const double a[3]) { return hypot(hypot(a[0], a[1]), a[2]); }

#endif
