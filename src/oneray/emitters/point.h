/* A light in a point, alike in all directions. */
#ifndef ONERAY_EMITTERS_POINT_H
#define ONERAY_EMITTERS_POINT_H

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct point {
    double position[3];
    double intensity[3]; /* W·sr⁻¹ */
    Affine to_world;     /* whose origin is the position, where the file says it so */
} Point;

static const Field point_fields[] = {
    {"position", AS_VECTOR, offsetof(Point, position), NULL, "0"},
    {"to_world", AS_TRANSFORM, offsetof(Point, to_world), NULL, ""},
    {"intensity", AS_COLOUR, offsetof(Point, intensity), "[0,inf)", "1"},
    {0},
};

static inline void point_check(void *plugin, Said *said)
{
    Point *e = plugin;
    if (given(said, "position") && given(said, "to_world"))
        fail(said, "<emitter type=\"point\"> has \"position\" and \"to_world\": write one or the other");
    if (given(said, "to_world"))
        column(&e->to_world, 3, e->position);
}
static const Plugin point_plugin = {"point", point_fields, point_check};

static inline EmitterTraits point_traits(const Point *e)
{
    return (EmitterTraits){FROM_POINT, e->intensity, e->position, 4 * PI, NULL};
}

#endif
