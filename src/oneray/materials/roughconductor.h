/* P1 Rough conductor: mirrors of metal too small to be seen, turned this way and that, on the side of the normal.
   Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007, with their GGX distribution. */
#pragma once

#include "fields.h"
#include "materials/conductor.h"
#include "traits.h"

typedef struct roughconductor {
    Conductor metal;
    double alpha;            /* roughness: half of the mirrors are steeper than this slope */
    double alpha_u, alpha_v; /* once it is checked, the same along the surface's dp/du, and across that */
} RoughConductor;

static inline void roughconductor_check(void *plugin, Said *said)
{
    RoughConductor *m = plugin;
    const Place *u = given(said, "alpha_u"), *v = given(said, "alpha_v");
    if (!given(said, "distribution")) /* Mitsuba's default is beckmann */
        fail(said, "<bsdf type=\"roughconductor\">: write <string name=\"distribution\" value=\"ggx\"/>");
    if (!u != !v || (u && given(said, "alpha")))
        fail(said, "<bsdf type=\"roughconductor\">: write alpha, or both alpha_u and alpha_v");
    m->alpha_u = fmax(u ? m->alpha_u : m->alpha, 1e-4); /* as Mitsuba */
    m->alpha_v = fmax(u ? m->alpha_v : m->alpha, 1e-4);
    conductor_check(&m->metal, said);
}
static const Plugin roughconductor_plugin = {"roughconductor", roughconductor_check, {
    {"distribution", AS_WORD, NOWHERE, "ggx", "ggx"},
    {"alpha", AS_FLOAT, offsetof(RoughConductor, alpha), "[0,1000]", "0.1"},
    {"alpha_u", AS_FLOAT, offsetof(RoughConductor, alpha_u), "[0,1000]", ""},
    {"alpha_v", AS_FLOAT, offsetof(RoughConductor, alpha_v), "[0,1000]", ""},
    {"sample_visible", AS_BOOLEAN, NOWHERE, NULL, "true"}, /* how it is sampled, not what it is */
    {"material", AS_STRING, offsetof(RoughConductor, metal.material), NULL, ""},
    {"specular_reflectance", AS_REFLECTANCE, offsetof(RoughConductor, metal.specular_reflectance), "[0,1]", "1"},
    {"eta", AS_COLOUR, offsetof(RoughConductor, metal.eta), "(0,1000]", ""},
    {"k", AS_COLOUR, offsetof(RoughConductor, metal.k), "[0,1000]", "1"}}};

static inline MaterialTraits roughconductor_traits(const RoughConductor *m)
{
    const char *odd = fmin(m->alpha_u, m->alpha_v) < 0.01 ? "a roughness below 0.01" : NULL;
    return (MaterialTraits){&m->metal.specular_reflectance, NULL, true, odd, m->alpha_u != m->alpha_v};
}

#ifdef LANES

#include "materials/material.h"

enum { roughconductor_transmits = 0 };

typedef struct roughconductor_row {
    ReflectanceRow reflectance;
    Num eta[3], k[3]; /* by default, η = 0 and k = 1, Fresnel's reflectance is 1 */
    Num alpha_u, alpha_v;
} RoughConductorRow;
static inline void roughconductor_row(const RoughConductor *m, int side, RoughConductorRow *row)
{
    (void)side;
    store_reflectance(&row->reflectance, &m->metal.specular_reflectance);
    store(row->eta, m->metal.eta);
    store(row->k, m->metal.k);
    row->alpha_u = (Num)m->alpha_u;
    row->alpha_v = (Num)m->alpha_v;
}

/* The roughness of a part; where some are anisotropic, along two unit vectors of the surface. */
typedef struct {
    Real u, v;
    Vec along_u, along_v;
} Roughness;

/* The tangents are dp/du less what lies along the shading normal, and across that, as Mitsuba's; any where it is 0. */
INLINE Roughness roughness_of(const Materials *materials, const Part *part, const Surface *s, Features f)
{
    Roughness a;
    a.u = ROW_REAL(materials, part->row, RoughConductor, alpha_u);
    if (!(f.has & HAS_ANISOTROPIC))
        return a;
    a.v = ROW_REAL(materials, part->row, RoughConductor, alpha_v);
    vec_frame(s->n, &a.along_u, &a.along_v);
    Vec tangent = vec_sub(s->dp_du, vec_scale(s->n, vec_dot(s->n, s->dp_du)));
    a.along_u = vec_select(vec_dot(tangent, tangent) > real(0), vec_normalize(tangent), a.along_u);
    a.along_v = vec_cross(s->n, a.along_u);
    return a;
}

/* How long a unit vector w, which has the cosine c with the normal, is once all that is across that is shrunk by α:
   α² sin²θ = α_u² x² + α_v² y². And, Smith's, 2 cosθ/G1(θ) = cosθ + √(cos²θ + α² sin²θ). */
INLINE Real ggx_stretch(const Roughness *a, Vec w, Real c, Features f)
{
    Real across = a->u * a->u * ((real(1) - c) * (real(1) + c));
    if (f.has & HAS_ANISOTROPIC) {
        Real x = a->u * vec_dot(w, a->along_u), y = a->v * vec_dot(w, a->along_v);
        across = x * x + y * y;
    }
    return real_sqrt(c * c + across);
}

/* What eval, pdf and factor have in common, at the half vector h ∥ wo + wi. */
typedef struct {
    Light fresnel; /* times the specular reflectance and the part's share */
    Real d;        /* D, sr⁻¹: area of the mirrors whose normal is h, by projected area and solid angle */
    Real o, i;     /* 2 cosθ/G1(θ) */
} Ggx;

/* D = 1/(π α_u α_v (x²/α_u² + y²/α_v² + z²)²) of h/|h| = (x, y, z), by h's parts along the normal and across, which
   keep their digits: (α_u α_v)³ |h|⁴/(π size²), where size is α_u² α_v² times those parts shrunk by 1/α. */
STAGE Ggx ggx(const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Roughness a = roughness_of(materials, part, s, f);
    Light eta = ROW_LIGHT(materials, part->row, RoughConductor, eta);
    Light k = ROW_LIGHT(materials, part->row, RoughConductor, k);
    Vec h = vec_add(s->wo, wi);
    Real hh = vec_dot(h, h), along = s->cos_o + cosine, c = real_min(real(0.5) * real_sqrt(hh), real(1));
    Vec across = vec_sub(h, vec_scale(s->n, along));
    Real size, d;
    if (f.has & HAS_ANISOTROPIC) {
        Real x = a.v * vec_dot(across, a.along_u), y = a.u * vec_dot(across, a.along_v), both = a.u * a.v;
        size = x * x + y * y + both * both * (along * along);
        Real q = both * only(size > real(0), hh / size);
        d = q * q * both * REAL_INV_PI;
    } else {
        size = vec_dot(across, across) + a.u * a.u * (along * along);
        Real q = a.u * only(size > real(0), hh / size);
        d = q * q * REAL_INV_PI;
    }
    return (Ggx){light_mul(part->reflectance, fresnel_of_metal(c, eta, k)), d,
        s->cos_o + ggx_stretch(&a, s->wo, s->cos_o, f), cosine + ggx_stretch(&a, wi, cosine, f)};
}

/* F D G/(4 cosθo cosθi), G = G1(θo) G1(θi): Smith's, separable, as Mitsuba has it. */
INLINE Light roughconductor_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Ggx m = ggx(materials, part, s, wi, cosine, f);
    return light_scale(m.fresnel, m.d / (m.o * m.i));
}

/* L9 The density of visible normals, D G1(θo) (wo·h)/cosθo, over the half vector's Jacobian, 4 wo·h; L8 1/2π. */
INLINE Real roughconductor_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Ggx m = ggx(materials, part, s, wi, cosine, f);
    return f.use & USE_COSINE ? m.d / (real(2) * m.o) : pdf_w_hemisphere_uniform();
}

/* L9 F G1(θi); L8 2π f_r cosθi. */
INLINE Light roughconductor_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Ggx m = ggx(materials, part, s, wi, cosine, f);
    Real visible = real(2) * cosine / m.i, uniform = real(2) * REAL_PI * cosine * (m.d / (m.o * m.i));
    Real share = f.has & HAS_BLEND ? part->share : real(1);
    return light_scale(m.fresnel, (f.use & USE_COSINE ? visible : uniform) / share);
}

/* A mirror as wo sees them: of a hemisphere, stretched from the mirrors by 1/α along the normal's plane. Uniform on
   the cap of the sphere around it and the viewer's direction: Dupuy & Benyoub, Sampling Visible GGX Normals with
   Spherical Caps, HPG 2023. Some reflect to below the surface; what they send is lost. */
INLINE Vec sample_visible_mirror(const Surface *s, const Roughness *a, const Real u[2], Features f)
{
    Real stretch = ggx_stretch(a, s->wo, s->cos_o, f), z_o = s->cos_o / stretch;
    Real up = (real(1) - u[0]) * (real(1) + z_o);
    Real z = up - z_o, sine, cosine, ring = real_sqrt(real_max((real(1) - z) * (real(1) + z), real(0)));
    sincos_turn(u[1], &sine, &cosine);
    if (f.has & HAS_ANISOTROPIC) {
        Real x = ring * cosine + a->u / stretch * vec_dot(s->wo, a->along_u);
        Real y = ring * sine + a->v / stretch * vec_dot(s->wo, a->along_v);
        Vec across = vec_add(vec_scale(a->along_u, a->u * x), vec_scale(a->along_v, a->v * y));
        return vec_add(across, vec_scale(s->n, up));
    }
    Vec cap = vec_from_frame(s->n, vec(ring * cosine, ring * sine, real(0)));
    Vec o_across = vec_scale(vec_sub(s->wo, vec_scale(s->n, s->cos_o)), a->u / stretch);
    return vec_add(vec_scale(vec_add(cap, o_across), a->u), vec_scale(s->n, up));
}

STAGE Scatter roughconductor_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Vec wi;
    if (f.use & USE_COSINE) {
        Roughness a = roughness_of(materials, part, s, f);
        Vec m = sample_visible_mirror(s, &a, u, f);
        wi = vec_sub(vec_scale(m, real(2) * vec_dot(s->wo, m) / vec_dot(m, m)), s->wo);
    } else
        wi = vec_from_frame(s->n, sample_hemisphere_uniform(u[0], u[1]));
    Real cosine = vec_dot(s->n, wi);
    Light factor = roughconductor_factor(materials, part, s, wi, cosine, f);
    return (Scatter){wi, light_only(cosine > real(0), factor),
        roughconductor_pdf_w(materials, part, s, wi, cosine, f), mask_none(), real(1)};
}

#endif
