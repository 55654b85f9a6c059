/* P6 Tent filter: w(x) = 1 - |x|/r. */
#pragma once

#include "fields.h"

typedef struct tent {
    double radius; /* pixels */
} Tent;

static const Plugin tent_plugin = {"tent", NULL, {
    {"radius", AS_FLOAT, offsetof(Tent, radius), "(0,100]", "1"}}};

static inline double tent_radius(const Tent *f) { return f->radius; }
static inline double tent_weight(const Tent *f, double x) { return 1 - x / f->radius; }
