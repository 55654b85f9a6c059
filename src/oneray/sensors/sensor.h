/* The sensor, whatever its kind. A scene has one, so that the choice is one for all lanes. */
#pragma once

#include "kinds/sensors.h"

typedef struct {
    SensorKind kind;
    union {
#define X(NAME, name, words) struct name##_row name;
        SENSORS(X)
#undef X
    } as;
} Camera;

/* Has the sensor a lens, for a point of which numbers are wanted? */
#define HAS_LENS HAS_THINLENS

/* The ray through the point (x, y) of the film, in pixels from its upper left corner. */
STAGE Ray camera_ray(const Camera *camera, Real x, Real y, const Real lens[2], Features f)
{
    Ray ray = {vec_all(real(0)), vec_all(real(0)), real(0), index_of(-1)};
#define X(NAME, name, words)                                                                                 \
    if ((f.has & HAS_##NAME) && camera->kind == SENSOR_##NAME)                                               \
        ray = name##_ray(&camera->as.name, x, y, lens);
    SENSORS(X)
#undef X
    return ray;
}

/* L17 The eye as a point of the scene sees it. */
INLINE Eye eye_from(const Camera *camera, Vec p, const Real lens[2], Features f)
{
    Eye eye = {mask_none(), p, real(0), real(0), real(0), real(0), real(0)};
#define X(NAME, name, words)                                                                                 \
    if ((f.has & HAS_##NAME) && camera->kind == SENSOR_##NAME)                                               \
        eye = name##_eye(&camera->as.name, p, lens);
    SENSORS(X)
#undef X
    return eye;
}
