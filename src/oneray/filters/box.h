/* P6 Box filter: a pixel is the mean over a square around its middle. */
#pragma once

#include "fields.h"

typedef struct box {
    double radius; /* pixels */
} Box;

static inline void box_check(void *plugin, Said *said)
{
    const Place *radius = given(said, "radius");
    (void)plugin;
    if (radius)
        note(radius, "\"radius\" of a box: Mitsuba 3 knows no other than 0.5");
}
static const Plugin box_plugin = {"box", box_check, {
    {"radius", AS_FLOAT, offsetof(Box, radius), "(0,100]", ".5"}}};

static inline double box_radius(const Box *f) { return f->radius; }

static inline double box_weight(const Box *f, double x)
{
    (void)f, (void)x;
    return 1;
}
