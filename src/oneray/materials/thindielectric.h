/* P1 Thin dielectric: a pane whose two faces are one surface. Light goes straight through, or is mirrored, by either
   face and as often as it goes to and fro between them. */
#pragma once

#include "materials/dielectric.h"

typedef struct thindielectric {
    Dielectric glass;
} ThinDielectric;

static const Plugin thindielectric_plugin = {"thindielectric", NULL, {DIELECTRIC_FIELDS(0)}};

static inline MaterialTraits thindielectric_traits(const ThinDielectric *m)
{
    MaterialTraits traits = dielectric_traits(&m->glass);
    traits.unbent = true;
    return traits;
}

#ifdef LANES

enum { thindielectric_transmits = 1 };

typedef struct thindielectric_row {
    DielectricRow glass;
} ThinDielectricRow;
static inline void thindielectric_row(const ThinDielectric *m, int side, ThinDielectricRow *row)
{
    (void)side; /* the pane is between its faces, the outside on either side */
    dielectric_row(&m->glass, 0, &row->glass);
}

/* With t the transmittance of a face and r = 1 - t: t (1 + r² + r⁴ + …) t = t/(2 - t) goes through. */
INLINE Real thindielectric_share(const Materials *materials, Index row, const Surface *s)
{
    Real ratio = ROW_REAL(materials, row, ThinDielectric, glass.ratio);
    Real t = fresnel_transmittance(s->cos_o, refracted_cosine(s->cos_o, ratio), ratio);
    return t / (real(2) - t);
}

INLINE Scatter thindielectric_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Mask reflects = real(1) - u[0] >= thindielectric_share(materials, part->row, s);
    Light tint = reflectance_at(materials, part->row, ROW_AT(ThinDielectric, glass.transmittance), s, f);
    return (Scatter){vec_select(reflects, mirrored(s), vec_neg(s->wo)),
        light_select(reflects, part->reflectance, tint), real(0), mask_all(), real(1)};
}

#endif
