/* A scene as a kernel wants it: tables in the kernel's precision, only of what the scene has. */
#pragma once

#include "filters/filter.h"
#include "sensors/sensor.h"
#include "emitters/lesson.h"
#include "materials/scatter.h"
#include "media/medium.h"

typedef struct {
    Shapes shapes;
    Materials materials;
    Media media;
    Emitters emitters;
    Camera camera;
    FilterRow filter;
    Int max_depth, rr_depth;            /* max_depth of a scene without limit is PATH_LIMIT */
    int width, height;
    int strategy[2], candidates; /* Technique */
    Lesson *lesson; /* while the visibility of lights is being learned, else NULL */
    Features features;
    void **kept; /* every table above, to be freed */
    int kept_count;
} Scene;
