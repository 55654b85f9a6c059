/* P4 Null: a surface that light passes as if it were not there. To path it is a vertex like any other, as in Mitsuba: it
   counts as a bounce, and no ray to a light passes it. To volpath it is none (estimators/through.h). */
#pragma once

#include "fields.h"
#include "traits.h"

typedef struct null {
    Reflectance passed; /* 1 */
} Null;

static inline void null_check(void *plugin, Said *said)
{
    (void)said;
    for (int c = 0; c < 3; c++)
        ((Null *)plugin)->passed.most[c] = ((Null *)plugin)->passed.least[c] = 1;
}

static const Plugin null_plugin = {"null", null_check, {{0}}};

static inline MaterialTraits null_traits(const Null *m)
{
    return (MaterialTraits){&m->passed, &m->passed, .absorbs = true}; /* it keeps no path from leaving */
}

#ifdef LANES

#include "materials/material.h"

enum { null_transmits = 1 };

typedef struct null_row {
    ReflectanceRow passed;
} NullRow;
static inline void null_row(const Null *m, int side, NullRow *row)
{
    (void)side;
    store_reflectance(&row->passed, &m->passed);
}

INLINE Scatter null_sample(const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    (void)materials, (void)u, (void)f;
    return (Scatter){vec_neg(s->wo), part->reflectance, real(0), mask_all(), real(1)};
}

#endif
