/* The sphere, with normals outwards. */
#ifndef ONERAY_SHAPES_SPHERE_H
#define ONERAY_SHAPES_SPHERE_H

#include "shapes/placed.h"

/* Once it is checked, center and radius are the world's, and to_world is done with. */
typedef struct sphere {
    Placed placed;
    double center[3], radius;
} Sphere;

static const Field sphere_fields[] = {
    {"to_world", AS_TRANSFORM, offsetof(Sphere, placed.to_world), NULL, ""},
    {"center", AS_VECTOR, offsetof(Sphere, center), NULL, "0"},
    {"radius", AS_FLOAT, offsetof(Sphere, radius), "[0,inf)", "1"},
    {"flip_normals", AS_BOOLEAN, offsetof(Sphere, placed.flip_normals), NULL, "false"},
    {0},
};

/* A mirrored sphere is turned inside out, as in Mitsuba; apart from that neither a mirroring nor a rotation shows. */
static inline void sphere_check(void *plugin, Said *said)
{
    Sphere *s = plugin;
    const Affine *to_world = &s->placed.to_world;
    double scale = affine_uniform_scale(to_world, 1e-4);
    if (scale == 0)
        fail(given(said, "to_world"), "\"to_world\" of a sphere must not shear or scale by axis");
    if (affine_determinant(to_world) < 0)
        s->placed.flip_normals = !s->placed.flip_normals;
    Affine at = affine_multiply(*to_world, affine_translate(s->center[0], s->center[1], s->center[2]));
    column(&at, 3, s->center);
    s->radius *= scale;
    if (!(s->radius > 0))
        said->left_out = "this sphere has no size and is left out";
}
static const Plugin sphere_plugin = {"sphere", sphere_fields, sphere_check};

enum { sphere_planar = 0, sphere_sides = 1 };
static inline Side sphere_side(const Sphere *s, int k)
{
    double r = s->radius;
    (void)k;
    return (Side){{s->center[0], s->center[1], s->center[2]}, {r, 0, 0}, {0, r, 0}, {0}, r * r, 4 * PI * (r * r)};
}
static inline Extent sphere_extent(const Sphere *s)
{
    Extent e = {.least = s->radius, .height = HUGE_VAL};
    for (int i = 0; i < 3; i++) {
        e.low[i] = s->center[i] - s->radius;
        e.high[i] = s->center[i] + s->radius;
    }
    return e;
}

#endif
