/* L15 Dielectric: the smooth boundary between two media, which reflects and refracts. */
#pragma once

#include "fields.h"
#include "traits.h"

#include <math.h>

typedef struct dielectric {
    double int_ior, ext_ior; /* indices of refraction; the normal points outside */
    Reflectance specular_reflectance, specular_transmittance;
} Dielectric;

/* Of all plugins whose struct has a Dielectric there. */
#define DIELECTRIC_FIELDS(at)                                                                                \
    {"int_ior", AS_IOR, (at) + offsetof(Dielectric, int_ior), "(0,1000]", "1.5046"}, /* bk7 */               \
    {"ext_ior", AS_IOR, (at) + offsetof(Dielectric, ext_ior), "(0,1000]", "1.000277"}, /* air */             \
    {"specular_reflectance", AS_REFLECTANCE, (at) + offsetof(Dielectric, specular_reflectance), "[0,1]", "1"}, \
    {"specular_transmittance", AS_REFLECTANCE, (at) + offsetof(Dielectric, specular_transmittance), "[0,1]", "1"}
static const Plugin dielectric_plugin = {"dielectric", NULL, {DIELECTRIC_FIELDS(0)}};

/* Inside over outside. */
static inline double dielectric_ior(const Dielectric *m) { return m->int_ior / m->ext_ior; }

static inline MaterialTraits dielectric_traits(const Dielectric *m)
{
    const char *odd = fabs(dielectric_ior(m) - 1) < 1e-3 ? "an index of refraction within 0.001 of 1" : NULL;
    return (MaterialTraits){&m->specular_reflectance, &m->specular_transmittance, .odd = odd};
}

#ifdef LANES

#include "materials/material.h"

enum { dielectric_transmits = 1 };

typedef struct dielectric_row {
    ReflectanceRow reflectance, transmittance;
    Num ratio; /* the index of refraction on this side over that beyond */
} DielectricRow;
static inline void dielectric_row(const Dielectric *m, int side, DielectricRow *row)
{
    double ior = dielectric_ior(m);
    store_reflectance(&row->reflectance, &m->specular_reflectance);
    store_reflectance(&row->transmittance, &m->specular_transmittance);
    row->ratio = (Num)(side ? ior : 1 / ior);
}

/* L15 The cosine beyond a boundary, from the cosine c here and the ratio of the indices, here/beyond: Snell.
   0 in total internal reflection. 1 - ratio² (1 - c²), in a form that keeps its digits at grazing angles
   where the indices are nearly the same. */
INLINE Real refracted_cosine(Real c, Real ratio)
{
    Real rc = ratio * c;
    return real_sqrt(real_max((real(1) - ratio) * (real(1) + ratio) + rc * rc, real(0)));
}

/* L15 Transmittance of a boundary between dielectrics for unpolarised light, exact: the mean of
   4 η_o c η_t c_t/(η_o c + η_t c_t)² and the same with η_o and η_t exchanged in the sum; 0 in total reflection. As a
   product, not as 1 - reflectance, it keeps its digits at grazing angles and next to total reflection. */
INLINE Real fresnel_transmittance(Real c, Real c_t, Real ratio)
{
    Real rc = ratio * c, rc_t = ratio * c_t, s = rc + c_t, p = rc_t + c;
    return only(c_t > real(0), real(2) * ((rc / s) * (c_t / s) + (c / p) * (rc_t / p)));
}

/* L15 1 minus Schlick's approximation as in the lecture, R0 + (1 - R0)(1 - c)⁵, with the cosine on the side of the
   smaller index. Total reflection is exact. */
INLINE Real schlick_transmittance(Real c, Real c_t, Real ratio)
{
    Real r = (ratio - real(1)) / (ratio + real(1)), x = real(1) - select(ratio > real(1), c_t, c);
    Real xx = x * x;
    return only(c_t > real(0), (real(1) - r * r) * (real(1) - xx * xx * x));
}

INLINE Scatter dielectric_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Real ratio = ROW_REAL(materials, part->row, Dielectric, ratio), c = s->cos_o, c_t = refracted_cosine(c, ratio);
    Real transmittance = f.use & USE_SCHLICK ? schlick_transmittance(c, c_t, ratio) : fresnel_transmittance(c, c_t, ratio);
    Mask reflects = real(1) - u[0] >= transmittance;
    Vec refracted = vec_sub(vec_scale(s->n, ratio * c - c_t), vec_scale(s->wo, ratio));
    Light tint = reflectance_at(materials, part->row, ROW_AT(Dielectric, transmittance), s, f);
    return (Scatter){vec_select(reflects, mirrored(s), refracted),
        light_select(reflects, part->reflectance, tint), real(0), mask_all(),
        select(reflects, real(1), ratio * ratio)};
}

#endif
