/* P1 Plastic: a diffuse base under a smooth coat of a dielectric, which mirrors, and lets light in and out again, on
   the side of the normal. What the coat sends back inside comes to the base again and again. */
#pragma once

#include "materials/dielectric.h"

typedef struct plastic {
    double int_ior, ext_ior;
    Reflectance diffuse_reflectance, specular_reflectance;
    bool nonlinear;     /* colours shift with the light between base and coat */
    Reflectance albedo; /* once it is checked, the more of both, and the less */
    double p_specular;  /* how large specular_reflectance is beside both: 0 … 1 */
} Plastic;

/* Of all plugins whose struct has a Plastic, at `at`. */
#define PLASTIC_FIELDS(at)                                                                                   \
    {"int_ior", AS_IOR, (at) + offsetof(Plastic, int_ior), "(0,1000]", "1.49"}, /* polypropylene */          \
    {"ext_ior", AS_IOR, (at) + offsetof(Plastic, ext_ior), "(0,1000]", "1.000277"}, /* air */                \
    {"diffuse_reflectance", AS_REFLECTANCE, (at) + offsetof(Plastic, diffuse_reflectance), "[0,1]", ".5"},   \
    {"specular_reflectance", AS_REFLECTANCE, (at) + offsetof(Plastic, specular_reflectance), "[0,1]", "1"},  \
    {"nonlinear", AS_BOOLEAN, (at) + offsetof(Plastic, nonlinear), NULL, "false"}

static inline double plastic_ior(const Plastic *m) { return m->int_ior / m->ext_ior; }

/* The mean over channels and, of a checkerboard, over its colours. */
static inline double mean_of_reflectance(const Reflectance *r)
{
    double sum = 0;
    for (int c = 0; c < 3; c++)
        sum += r->most[c] + r->least[c];
    return sum / 6;
}

/* Reflectance of a boundary for diffuse light from the side whose index over that beyond is `ratio`, by fits as in
   Mitsuba: of Egan and Hilgeman, 1973, to .6 % where ratio is 1 … 2, and of d'Eon and Irving, SIGGRAPH 2011. */
static inline double diffuse_fresnel(double ratio)
{
    double x = 1 / ratio;
    if (ratio > 1)
        return 0.0636 * ratio + 0.6681 + x * (0.7099 - 1.4399 * x);
    return 0.919317
           + ratio * (-3.4793 + ratio * (6.75335 + ratio * (-7.80989 + ratio * (4.98554 - 1.36881 * ratio))));
}

static inline void plastic_weigh(Plastic *m)
{
    for (int c = 0; c < 3; c++) {
        m->albedo.most[c] = fmax(m->diffuse_reflectance.most[c], m->specular_reflectance.most[c]);
        m->albedo.least[c] = fmin(m->diffuse_reflectance.least[c], m->specular_reflectance.least[c]);
    }
    double diffuse = mean_of_reflectance(&m->diffuse_reflectance), specular = mean_of_reflectance(&m->specular_reflectance);
    m->p_specular = diffuse + specular > 0 ? specular / (diffuse + specular) : 1;
}

static inline void plastic_check(void *plugin, Said *said)
{
    Plastic *m = plugin;
    if (!(diffuse_fresnel(plastic_ior(m)) < 1))
        fail(said, "<bsdf type=\"%s\">: int_ior is %.3g times ext_ior, and from 3.85 times on its coat would make light",
            said->type, plastic_ior(m));
    plastic_weigh(m);
}
static const Plugin plastic_plugin = {"plastic", plastic_check, {PLASTIC_FIELDS(0)}};

static inline MaterialTraits plastic_traits(const Plastic *m)
{
    const char *odd = fabs(plastic_ior(m) - 1) < 1e-3 ? "an index of refraction within 0.001 of 1" : NULL;
    return (MaterialTraits){&m->albedo, NULL, .odd = odd};
}

#ifdef LANES

enum { plastic_transmits = 0 };

typedef struct plastic_row {
    ReflectanceRow diffuse, specular;
    Num ratio;     /* the index of refraction outside over that inside */
    Num internal;  /* of the diffuse light from inside, what the coat sends back … */
    Num nonlinear; /* … all of it to the base: 1; as if that were white: 0 */
    Num p_specular;
} PlasticRow;
static inline void plastic_row(const Plastic *m, int side, PlasticRow *row)
{
    (void)side;
    store_reflectance(&row->diffuse, &m->diffuse_reflectance);
    store_reflectance(&row->specular, &m->specular_reflectance);
    row->ratio = (Num)(1 / plastic_ior(m));
    row->internal = (Num)diffuse_fresnel(plastic_ior(m));
    row->nonlinear = m->nonlinear;
    row->p_specular = (Num)m->p_specular;
}

/* The base under the coat, less what goes in and comes out: d (η_o/η_i)²/(1 - d r), or over 1 - r, times the share. */
INLINE Light plastic_base(const Part *part, Real ratio, Real internal, Real nonlinear, Features f)
{
    Light d = part->reflectance, rest;
    Real share = f.has & HAS_BLEND ? part->share : real(1), white = real(1) - nonlinear, inside = ratio * ratio;
    Real once = nonlinear * (real(1) / share);
    rest.r = inside / (real(1) - internal * (white + once * d.r));
    rest.g = inside / (real(1) - internal * (white + once * d.g));
    rest.b = inside / (real(1) - internal * (white + once * d.b));
    return light_mul(d, rest);
}

/* Lobes are chosen by w F and (1 - w)(1 - F): the chance of a lobe is its own over their sum. */
typedef struct {
    Real specular, diffuse, sum;
} Lobes;
INLINE Lobes lobes(Real p_specular, Real transmittance)
{
    Lobes l = {p_specular * (real(1) - transmittance), (real(1) - p_specular) * transmittance, real(0)};
    l.sum = l.specular + l.diffuse;
    return l;
}
INLINE Real over(Real a, Real b) { return only(b > real(0), a / b); }

/* What all of plastic's functions want to know. */
typedef struct {
    Real ratio, out, p_specular; /* out: what the coat lets through to the viewer */
    Light base;
    Lobes lobes;
} PlasticView;
APART PlasticView plastic_view(const Materials *materials, const Part *part, const Surface *s, Features f)
{
    PlasticView v;
    v.ratio = ROW_REAL(materials, part->row, Plastic, ratio);
    v.p_specular = ROW_REAL(materials, part->row, Plastic, p_specular);
    v.out = fresnel_transmittance(s->cos_o, refracted_cosine(s->cos_o, v.ratio), v.ratio);
    v.base = plastic_base(part, v.ratio, ROW_REAL(materials, part->row, Plastic, internal),
        ROW_REAL(materials, part->row, Plastic, nonlinear), f);
    v.lobes = lobes(v.p_specular, v.out);
    return v;
}

/* Of the base: (1 - F(θo)) (1 - F(θi)) base/π. */
INLINE Light plastic_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    PlasticView v = plastic_view(materials, part, s, f);
    Real in = fresnel_transmittance(cosine, refracted_cosine(cosine, v.ratio), v.ratio);
    (void)wi;
    return light_scale(v.base, v.out * in * REAL_INV_PI);
}

INLINE Real plastic_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    PlasticView v = plastic_view(materials, part, s, f);
    (void)wi;
    return over(v.lobes.diffuse, v.lobes.sum)
           * (f.use & USE_COSINE ? pdf_w_hemisphere_cosine(cosine) : pdf_w_hemisphere_uniform());
}

/* (1 - F(θo))/p_diffuse = (w F + (1 - w)(1 - F))/(1 - w), and so on, which keep their digits. */
INLINE Light plastic_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    PlasticView v = plastic_view(materials, part, s, f);
    Real in = fresnel_transmittance(cosine, refracted_cosine(cosine, v.ratio), v.ratio);
    Real share = f.has & HAS_BLEND ? part->share : real(1);
    (void)wi;
    Real weight = in * over(v.lobes.sum, (real(1) - v.p_specular) * share);
    return light_scale(v.base, f.use & USE_COSINE ? weight : real(2) * cosine * weight);
}

APART Scatter plastic_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    PlasticView v = plastic_view(materials, part, s, f);
    Real p = over(v.lobes.specular, v.lobes.sum);
    Mask mirrors = u[0] < p;
    Real again = only(mask_not(mirrors), (u[0] - p) / (real(1) - p));
    Vec local = f.use & USE_COSINE ? sample_hemisphere_cosine(again, u[1]) : sample_hemisphere_uniform(again, u[1]);
    Vec wi = vec_from_frame(s->n, local);
    Light tint = reflectance_at(materials, part->row, ROW_AT(Plastic, specular), s, f);
    return (Scatter){vec_select(mirrors, mirrored(s), wi),
        light_select(mirrors, light_scale(tint, over(v.lobes.sum, v.p_specular)),
            plastic_factor(materials, part, s, wi, local.z, f)),
        plastic_pdf_w(materials, part, s, wi, local.z, f), mirrors, real(1)};
}

#endif
