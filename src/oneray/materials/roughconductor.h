/* P1 Rough conductor: mirrors of metal too small to be seen, turned this way and that, on the side of the normal.
   Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007. */
#pragma once

#include "materials/conductor.h"
#include "materials/microfacets.h"

typedef struct roughconductor {
    Microfacets facets;
    Conductor metal;
} RoughConductor;

static inline void roughconductor_check(void *plugin, Said *said)
{
    RoughConductor *m = plugin;
    microfacets_check(&m->facets, said);
    conductor_check(&m->metal, said);
}
static const Plugin roughconductor_plugin = {"roughconductor", roughconductor_check, {
    MICROFACET_FIELDS, CONDUCTOR_FIELDS(offsetof(RoughConductor, metal))}};

static inline MaterialTraits roughconductor_traits(const RoughConductor *m)
{
    return (MaterialTraits){&m->metal.specular_reflectance, NULL, true, microfacets_odd(&m->facets),
        .anisotropic = is_anisotropic(&m->facets), .beckmann = m->facets.distribution == BECKMANN};
}

#ifdef LANES

enum { roughconductor_transmits = 0 };

typedef struct roughconductor_row {
    ReflectanceRow reflectance;
    Num eta[3], k[3]; /* by default, η = 0 and k = 1, Fresnel's reflectance is 1 */
    RoughnessRow roughness;
} RoughConductorRow;
static inline void roughconductor_row(const RoughConductor *m, int side, RoughConductorRow *row)
{
    (void)side;
    store_reflectance(&row->reflectance, &m->metal.specular_reflectance);
    store(row->eta, m->metal.eta);
    store(row->k, m->metal.k);
    store_roughness(&row->roughness, &m->facets);
}

/* What eval, pdf and factor have in common, at the half vector h ∥ wo + wi. */
typedef struct {
    Light fresnel; /* times the specular reflectance and the part's share, and D G1(θo) over that of GGX */
    Real d;        /* GGX's D, sr⁻¹ */
    Real o, i;     /* 2 cosθ/G1(θ), the former GGX's */
    Real all;      /* USE_ALL_NORMALS: what the density of all mirrors is over that of those seen */
} RoughMetal;

APART RoughMetal rough_metal(const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Roughness a = roughness_of(materials, part->row, ROW_AT(RoughConductor, roughness), s, f);
    Light eta = ROW_LIGHT(materials, part->row, RoughConductor, eta);
    Light k = ROW_LIGHT(materials, part->row, RoughConductor, k);
    Vec h = vec_add(s->wo, wi);
    Real hh = vec_dot(h, h), c = real_min(real(0.5) * real_sqrt(hh), real(1));
    RoughMetal m = {light_mul(part->reflectance, fresnel_of_metal(c, eta, k)),
        ggx_density(&a, s->n, h, hh, s->cos_o + cosine, f), ggx_masking(&a, s->wo, s->cos_o, f),
        masking(&a, wi, cosine, f), real(1)};
    if (f.use & USE_ALL_NORMALS)
        m.all = all_over_visible(s, h, s->cos_o + cosine, m.o);
    if (f.has & HAS_BECKMANN)
        m.fresnel = light_scale(m.fresnel, over_ggx(&a, s, h, s->cos_o + cosine, f));
    return m;
}

/* F D G/(4 cosθo cosθi), G = G1(θo) G1(θi): Smith's, separable, as Mitsuba has it. */
INLINE Light roughconductor_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    RoughMetal m = rough_metal(materials, part, s, wi, cosine, f);
    return light_scale(m.fresnel, m.d / (m.o * m.i));
}

/* L9 The density of visible normals, D G1(θo) (wo·h)/cosθo, over the half vector's Jacobian, 4 wo·h; L8 1/2π. */
INLINE Real roughconductor_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    RoughMetal m = rough_metal(materials, part, s, wi, cosine, f);
    Real visible = m.d / (real(2) * m.o);
    if (f.use & USE_COSINE)
        return f.use & USE_ALL_NORMALS ? visible * m.all : visible;
    return pdf_w_hemisphere_uniform();
}

/* L9 F G1(θi); L8 2π f_r cosθi. */
INLINE Light roughconductor_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    RoughMetal m = rough_metal(materials, part, s, wi, cosine, f);
    Real visible = real(2) * cosine / m.i;
    if (f.use & USE_ALL_NORMALS)
        visible = only(m.all > real(0), visible / m.all);
    Real uniform = real(2) * REAL_PI * cosine * (m.d / (m.o * m.i));
    Real share = f.has & HAS_BLEND ? part->share : real(1);
    return light_scale(m.fresnel, (f.use & USE_COSINE ? visible : uniform) / share);
}

APART Scatter roughconductor_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Vec wi;
    if (f.use & USE_COSINE) {
        Roughness a = roughness_of(materials, part->row, ROW_AT(RoughConductor, roughness), s, f);
        Vec m = sample_mirror(s, &a, u, f);
        wi = vec_sub(vec_scale(m, real(2) * vec_dot(s->wo, m) / vec_dot(m, m)), s->wo);
    } else
        wi = vec_from_frame(s->n, sample_hemisphere_uniform(u[0], u[1]));
    Real cosine = vec_dot(s->n, wi);
    Light factor = roughconductor_factor(materials, part, s, wi, cosine, f);
    return (Scatter){wi, light_only(cosine > real(0), factor),
        roughconductor_pdf_w(materials, part, s, wi, cosine, f), mask_none(), real(1)};
}

#endif
