/* P1 Rough conductor: mirrors of metal too small to be seen, turned this way and that, on the side of the normal.
   Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007, with their GGX distribution. */
#pragma once

#include "fields.h"
#include "materials/conductor.h"
#include "traits.h"

typedef struct roughconductor {
    Conductor metal;
    double alpha, alpha_u, alpha_v; /* roughness: half of the mirrors are steeper than this slope */
} RoughConductor;

static inline void roughconductor_check(void *plugin, Said *said)
{
    RoughConductor *m = plugin;
    const Place *u = given(said, "alpha_u"), *v = given(said, "alpha_v");
    if (!given(said, "distribution")) /* Mitsuba's default is beckmann */
        fail(said, "<bsdf type=\"roughconductor\">: write <string name=\"distribution\" value=\"ggx\"/>");
    if (!u != !v || (u && given(said, "alpha")))
        fail(said, "<bsdf type=\"roughconductor\">: write alpha, or both alpha_u and alpha_v");
    if (u && m->alpha_u != m->alpha_v)
        fail(u, "a roughness that depends on the direction (alpha_u is not alpha_v) is not supported");
    m->alpha = u ? m->alpha_u : m->alpha;
    m->alpha = m->alpha > 1e-4 ? m->alpha : 1e-4; /* as Mitsuba */
    conductor_check(&m->metal, said);
}
static const Plugin roughconductor_plugin = {"roughconductor", roughconductor_check, {
    {"distribution", AS_WORD, NOWHERE, "ggx", "ggx"},
    {"alpha", AS_FLOAT, offsetof(RoughConductor, alpha), "[0,1000]", "0.1"},
    {"alpha_u", AS_FLOAT, offsetof(RoughConductor, alpha_u), "[0,1000]", ""},
    {"alpha_v", AS_FLOAT, offsetof(RoughConductor, alpha_v), "[0,1000]", ""},
    {"sample_visible", AS_BOOLEAN, NOWHERE, NULL, "true"}, /* how it is sampled, not what it is */
    {"material", AS_STRING, offsetof(RoughConductor, metal.material), NULL, ""},
    {"specular_reflectance", AS_COLOUR, offsetof(RoughConductor, metal.specular_reflectance), "[0,1]", "1"},
    {"eta", AS_COLOUR, offsetof(RoughConductor, metal.eta), "(0,1000]", ""},
    {"k", AS_COLOUR, offsetof(RoughConductor, metal.k), "[0,1000]", "1"}}};

static inline MaterialTraits roughconductor_traits(const RoughConductor *m)
{
    const char *odd = m->alpha < 0.01 ? "a roughness below 0.01" : NULL;
    return (MaterialTraits){m->metal.specular_reflectance, NULL, true, odd};
}

#ifdef LANES

#include "materials/material.h"

enum { roughconductor_transmits = 0 };

typedef struct roughconductor_row {
    Num reflectance[3];
    Num eta[3], k[3]; /* by default, η = 0 and k = 1, Fresnel's reflectance is 1 */
    Num alpha;
} RoughConductorRow;
static inline void roughconductor_row(const RoughConductor *m, int side, RoughConductorRow *row)
{
    (void)side;
    store(row->reflectance, m->metal.specular_reflectance);
    store(row->eta, m->metal.eta);
    store(row->k, m->metal.k);
    row->alpha = (Num)m->alpha;
}

/* 2 cosθ/G1(θ), Smith's: cosθ + √(cos²θ + α² sin²θ). The latter is also how long a unit vector is once all that
   is across the normal is shrunk by α. */
INLINE Real ggx_stretch(Real c, Real alpha)
{
    return real_sqrt(c * c + alpha * alpha * ((real(1) - c) * (real(1) + c)));
}

/* What eval, pdf and factor have in common, at the half vector h ∥ wo + wi. */
typedef struct {
    Light fresnel; /* times the specular reflectance and the part's share */
    Real d;        /* D, sr⁻¹: area of the mirrors whose normal is h, by projected area and solid angle */
    Real o, i;     /* 2 cosθ/G1(θ) */
} Ggx;

/* D = 1/(π α² (sin²θ_h/α² + cos²θ_h)²), by h's parts along the normal and across, which keep their digits. */
STAGE Ggx ggx(const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine)
{
    Real alpha = ROW_REAL(materials, part->row, RoughConductor, alpha);
    Light eta = ROW_LIGHT(materials, part->row, RoughConductor, eta);
    Light k = ROW_LIGHT(materials, part->row, RoughConductor, k);
    Vec h = vec_add(s->wo, wi);
    Real hh = vec_dot(h, h), along = s->cos_o + cosine, c = real_min(real(0.5) * real_sqrt(hh), real(1));
    Vec across = vec_sub(h, vec_scale(s->n, along));
    Real size = vec_dot(across, across) + alpha * alpha * (along * along);
    Real q = alpha * only(size > real(0), hh / size);
    return (Ggx){light_mul(part->reflectance, fresnel_of_metal(c, eta, k)), q * q * REAL_INV_PI,
        s->cos_o + ggx_stretch(s->cos_o, alpha), cosine + ggx_stretch(cosine, alpha)};
}

/* F D G/(4 cosθo cosθi), G = G1(θo) G1(θi): Smith's, separable, as Mitsuba has it. */
INLINE Light roughconductor_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine)
{
    Ggx m = ggx(materials, part, s, wi, cosine);
    return light_scale(m.fresnel, m.d / (m.o * m.i));
}

/* L9 The density of visible normals, D G1(θo) (wo·h)/cosθo, over the half vector's Jacobian, 4 wo·h; L8 1/2π. */
INLINE Real roughconductor_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Ggx m = ggx(materials, part, s, wi, cosine);
    return f.use & USE_COSINE ? m.d / (real(2) * m.o) : pdf_w_hemisphere_uniform();
}

/* L9 F G1(θi); L8 2π f_r cosθi. */
INLINE Light roughconductor_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Ggx m = ggx(materials, part, s, wi, cosine);
    Real visible = real(2) * cosine / m.i, uniform = real(2) * REAL_PI * cosine * (m.d / (m.o * m.i));
    Real share = f.has & HAS_BLEND ? part->share : real(1);
    return light_scale(m.fresnel, (f.use & USE_COSINE ? visible : uniform) / share);
}

/* A mirror as wo sees them: of a hemisphere, stretched from the mirrors by 1/α along the normal's plane. Uniform on
   the cap of the sphere around it and the viewer's direction: Dupuy & Benyoub, Sampling Visible GGX Normals with
   Spherical Caps, HPG 2023. Some reflect to below the surface; what they send is lost. */
INLINE Vec sample_visible_mirror(const Surface *s, Real alpha, const Real u[2])
{
    Real stretch = ggx_stretch(s->cos_o, alpha), z_o = s->cos_o / stretch, up = (real(1) - u[0]) * (real(1) + z_o);
    Real z = up - z_o, sine, cosine, ring = real_sqrt(real_max((real(1) - z) * (real(1) + z), real(0)));
    sincos_turn(u[1], &sine, &cosine);
    Vec cap = vec_from_frame(s->n, vec(ring * cosine, ring * sine, real(0)));
    Vec o_across = vec_scale(vec_sub(s->wo, vec_scale(s->n, s->cos_o)), alpha / stretch);
    return vec_add(vec_scale(vec_add(cap, o_across), alpha), vec_scale(s->n, up));
}

STAGE Scatter roughconductor_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Vec wi;
    if (f.use & USE_COSINE) {
        Vec m = sample_visible_mirror(s, ROW_REAL(materials, part->row, RoughConductor, alpha), u);
        wi = vec_sub(vec_scale(m, real(2) * vec_dot(s->wo, m) / vec_dot(m, m)), s->wo);
    } else
        wi = vec_from_frame(s->n, sample_hemisphere_uniform(u[0], u[1]));
    Real cosine = vec_dot(s->n, wi);
    Light factor = roughconductor_factor(materials, part, s, wi, cosine, f);
    return (Scatter){wi, light_only(cosine > real(0), factor),
        roughconductor_pdf_w(materials, part, s, wi, cosine, f), mask_none(), real(1)};
}

#endif
