/* Diffuse transmitter: what light a thin sheet does not absorb goes on alike in all directions, f_r = reflectance/π on
   the side that it came from, transmittance/π on the other (sr⁻¹). */
#pragma once

#include "fields.h"
#include "traits.h"

typedef struct transmitter {
    Reflectance reflectance, transmittance;
    Reflectance albedo; /* their sum, once it is checked */
} Transmitter;

static inline void transmitter_check(void *plugin, Said *said)
{
    Transmitter *m = plugin;
    for (int c = 0; c < 3; c++) {
        m->albedo.most[c] = m->albedo.least[c] = m->reflectance.most[c] + m->transmittance.most[c];
        if (m->albedo.most[c] > 1 + 1e-9)
            fail(said, "reflectance and transmittance add up to %g", m->albedo.most[c]);
    }
}
static const Plugin transmitter_plugin = {"transmitter", transmitter_check, {
    {"reflectance", AS_REFLECTANCE, offsetof(Transmitter, reflectance), "[0,1]", ".5"},
    {"transmittance", AS_REFLECTANCE, offsetof(Transmitter, transmittance), "[0,1]", ".5"}}};

static inline MaterialTraits transmitter_traits(const Transmitter *m)
{
    return (MaterialTraits){&m->albedo, &m->transmittance, .odd = NULL};
}

#ifdef LANES

#include "materials/material.h"

enum { transmitter_transmits = 1 };

typedef struct transmitter_row {
    ReflectanceRow reflectance, transmittance; /* the latter of all of it, whatever the part's share */
} TransmitterRow;
static inline void transmitter_row(const Transmitter *m, int side, TransmitterRow *row)
{
    (void)side;
    store_reflectance(&row->reflectance, &m->reflectance);
    store_reflectance(&row->transmittance, &m->transmittance);
}

/* What goes to either side, both times the part's share, and how often the sampled direction is on the ray's. */
typedef struct {
    Light reflected, transmitted;
    Real p_reflect;
} TransmitterSides;

INLINE TransmitterSides transmitter_sides(const Materials *materials, const Part *part, const Surface *s, Features f)
{
    Light t = reflectance_at(materials, part->row, ROW_AT(Transmitter, transmittance), s, f);
    t = light_scale(t, part->share);
    Real most = light_max(part->reflectance), all = most + light_max(t);
    return (TransmitterSides){part->reflectance, t, select(all > real(0), most / all, real(0.5))};
}

INLINE Light transmitter_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)wi;
    TransmitterSides sides = transmitter_sides(materials, part, s, f);
    return light_scale(light_select(cosine > real(0), sides.reflected, sides.transmitted), REAL_INV_PI);
}

/* L8, L9 on the side that is chosen. */
INLINE Real transmitter_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)wi;
    Real p = transmitter_sides(materials, part, s, f).p_reflect, c = real_abs(cosine);
    Real hemisphere = f.use & USE_COSINE ? pdf_w_hemisphere_cosine(c) : pdf_w_hemisphere_uniform();
    return hemisphere * select(cosine > real(0), p, real(1) - p);
}

/* Of the side that is never chosen, 0: nothing goes there. */
INLINE Light transmitter_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)wi;
    TransmitterSides sides = transmitter_sides(materials, part, s, f);
    Mask reflects = cosine > real(0);
    Real p = select(reflects, sides.p_reflect, real(1) - sides.p_reflect) * part->share;
    Real over_p = only(p > real(0), real(1) / p);
    return light_scale(light_select(reflects, sides.reflected, sides.transmitted),
        f.use & USE_COSINE ? over_p : real(2) * real_abs(cosine) * over_p);
}

/* L8, L9 One ray over the hemisphere on one of the sides; what is left of u[0] is uniform again. */
INLINE Scatter transmitter_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Real p = transmitter_sides(materials, part, s, f).p_reflect;
    Mask reflects = u[0] < p;
    Real again = select(reflects, u[0] / p, (u[0] - p) / (real(1) - p));
    Vec local = f.use & USE_COSINE ? sample_hemisphere_cosine(again, u[1]) : sample_hemisphere_uniform(again, u[1]);
    local.z = select(reflects, local.z, -local.z);
    Vec wi = vec_from_frame(s->n, local);
    return (Scatter){wi, transmitter_factor(materials, part, s, wi, local.z, f),
        transmitter_pdf_w(materials, part, s, wi, local.z, f), mask_none(), real(1)};
}

#endif
