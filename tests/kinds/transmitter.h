/* Diffuse transmitter: what light a thin sheet does not absorb goes on alike in all directions, f_r = reflectance/π on
   the side that it came from, transmittance/π on the other (sr⁻¹). */
#pragma once

#include "fields.h"
#include "traits.h"

typedef struct transmitter {
    double reflectance[3], transmittance[3];
    double albedo[3]; /* their sum, once it is checked */
} Transmitter;

static inline void transmitter_check(void *plugin, Said *said)
{
    Transmitter *m = plugin;
    for (int c = 0; c < 3; c++) {
        m->albedo[c] = m->reflectance[c] + m->transmittance[c];
        if (m->albedo[c] > 1 + 1e-9)
            fail(said, "reflectance and transmittance add up to %g", m->albedo[c]);
    }
}
static const Plugin transmitter_plugin = {"transmitter", transmitter_check, {
    {"reflectance", AS_COLOUR, offsetof(Transmitter, reflectance), "[0,1]", ".5"},
    {"transmittance", AS_COLOUR, offsetof(Transmitter, transmittance), "[0,1]", ".5"}}};

static inline MaterialTraits transmitter_traits(const Transmitter *m)
{
    return (MaterialTraits){m->albedo, m->transmittance, false, NULL};
}

#ifdef LANES

#include "materials/material.h"

enum { transmitter_transmits = 1 };

typedef struct transmitter_row {
    Num reflectance[3];
    Num transmittance[3]; /* of all of it, whatever the part's share */
} TransmitterRow;
static inline void transmitter_row(const Transmitter *m, int side, TransmitterRow *row)
{
    (void)side;
    store(row->reflectance, m->reflectance);
    store(row->transmittance, m->transmittance);
}

/* What goes to either side, both times the part's share, and how often the sampled direction is on the ray's. */
typedef struct {
    Light reflected, transmitted;
    Real p_reflect;
} TransmitterSides;

INLINE TransmitterSides transmitter_sides(const Materials *materials, const Part *part)
{
    Light t = light_scale(ROW_LIGHT(materials, part->row, Transmitter, transmittance), part->share);
    Real most = light_max(part->reflectance), all = most + light_max(t);
    return (TransmitterSides){part->reflectance, t, select(all > real(0), most / all, real(0.5))};
}

INLINE Light transmitter_eval(const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine)
{
    (void)s, (void)wi;
    TransmitterSides sides = transmitter_sides(materials, part);
    return light_scale(light_select(cosine > real(0), sides.reflected, sides.transmitted), REAL_INV_PI);
}

/* L8, L9 on the side that is chosen. */
INLINE Real transmitter_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)s, (void)wi;
    Real p = transmitter_sides(materials, part).p_reflect, c = real_abs(cosine);
    Real hemisphere = f.use & USE_COSINE ? pdf_w_hemisphere_cosine(c) : pdf_w_hemisphere_uniform();
    return hemisphere * select(cosine > real(0), p, real(1) - p);
}

/* Of the side that is never chosen, 0: nothing goes there. */
INLINE Light transmitter_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)s, (void)wi;
    TransmitterSides sides = transmitter_sides(materials, part);
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
    Real p = transmitter_sides(materials, part).p_reflect;
    Mask reflects = u[0] < p;
    Real again = select(reflects, u[0] / p, (u[0] - p) / (real(1) - p));
    Vec local = f.use & USE_COSINE ? sample_hemisphere_cosine(again, u[1]) : sample_hemisphere_uniform(again, u[1]);
    local.z = select(reflects, local.z, -local.z);
    Vec wi = vec_from_frame(s->n, local);
    return (Scatter){wi, transmitter_factor(materials, part, s, wi, local.z, f),
        transmitter_pdf_w(materials, part, s, wi, local.z, f), mask_none(), real(1)};
}

#endif
