/* P1 Rough dielectric: the boundary between two media as microfacets, each of which reflects and refracts, on either
   side. Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007. */
#pragma once

#include "materials/dielectric.h"
#include "materials/microfacets.h"

typedef struct roughdielectric {
    Microfacets facets;
    Dielectric glass;
} RoughDielectric;

static inline void roughdielectric_check(void *plugin, Said *said)
{
    RoughDielectric *m = plugin;
    microfacets_check(&m->facets, said);
    if (m->glass.int_ior == m->glass.ext_ior)
        fail(said, "<bsdf type=\"roughdielectric\">: int_ior and ext_ior must differ");
}
static const Plugin roughdielectric_plugin = {
    "roughdielectric", roughdielectric_check, {MICROFACET_FIELDS, DIELECTRIC_FIELDS(offsetof(RoughDielectric, glass))}};

static inline MaterialTraits roughdielectric_traits(const RoughDielectric *m)
{
    MaterialTraits traits = dielectric_traits(&m->glass);
    traits.absorbs = true; /* what leaves a facet for another is lost */
    traits.odd = traits.odd ? traits.odd : microfacets_odd(&m->facets);
    traits.anisotropic = is_anisotropic(&m->facets);
    traits.beckmann = m->facets.distribution == BECKMANN;
    return traits;
}

#ifdef LANES

enum { roughdielectric_transmits = 1 };

typedef struct roughdielectric_row {
    DielectricRow glass; /* its transmittance of all of it, whatever the part's share */
    RoughnessRow roughness;
} RoughDielectricRow;
static inline void roughdielectric_row(const RoughDielectric *m, int side, RoughDielectricRow *row)
{
    dielectric_row(&m->glass, side, &row->glass);
    store_roughness(&row->roughness, &m->facets);
}

/* What eval, pdf and factor have in common, at the half vector h ∥ wo + wi, or beyond the boundary
   h ∥ η_o wo + η_i wi, which no mirror has where it is on the wrong side of it. */
typedef struct {
    Mask reflects, meets; /* meets: there is such a mirror */
    Real chance; /* of its sending light this way: Fresnel's reflectance or transmittance */
    Real spread; /* GGX's D over the half vector's Jacobian, its cosine with wo apart, sr⁻¹: D/4, D |wo·h| |wi·h|/|h|⁴ */
    Real ratio;  /* η_o/η_i */
    Real o, i;   /* 2 cosθ/G1(θ), the former GGX's */
    Real over;   /* what D G1(θo) is over that of GGX */
    Real all;    /* USE_ALL_NORMALS: what the density of all mirrors is over that of those seen */
} RoughBoundary;

APART RoughBoundary rough_boundary(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Roughness a = roughness_of(materials, part->row, ROW_AT(RoughDielectric, roughness), s, f);
    RoughBoundary b = {.reflects = cosine > real(0)};
    b.ratio = ROW_REAL(materials, part->row, RoughDielectric, glass.ratio);
    Real by = select(b.reflects, real(1), b.ratio), c_i = real_abs(cosine);
    Vec h = vec_add(vec_scale(s->wo, by), wi);
    Real hh = vec_dot(h, h), along = by * s->cos_o + cosine;
    Real o = flip_sign(vec_dot(s->wo, h), along), i = flip_sign(vec_dot(wi, h), along);
    b.meets = (hh > real(0)) & (o > real(0)) & (b.reflects | (i < real(0)));
    Real c = real_min(only(b.meets, o / real_sqrt(hh)), real(1));
    Real transmittance = fresnel_transmittance(c, refracted_cosine(c, b.ratio), b.ratio);
    b.chance = only(b.meets, select(b.reflects, real(1) - transmittance, transmittance));
    Real bent = select(b.reflects, real(0.25), only(b.meets, real_abs(o / hh * (i / hh))));
    b.spread = ggx_density(&a, s->n, h, hh, along, f) * bent;
    b.o = ggx_masking(&a, s->wo, s->cos_o, f);
    b.i = masking(&a, wi, c_i, f);
    b.over = over_ggx(&a, s, h, along, f);
    b.all = f.use & USE_ALL_NORMALS ? all_over_visible(s, h, along, b.o) : real(1);
    return b;
}

/* What of it the material lets go on, times the part's share. */
INLINE Light rough_boundary_tint(
    const Materials *materials, const Part *part, const Surface *s, const RoughBoundary *b, Features f)
{
    Light t = reflectance_at(materials, part->row, ROW_AT(RoughDielectric, glass.transmittance), s, f);
    t = light_select(b->reflects, part->reflectance, f.has & HAS_BLEND ? light_scale(t, part->share) : t);
    return f.has & HAS_BECKMANN ? light_scale(t, b->over) : t;
}

/* F D G/(4 cosθo cosθi), (1 - F) D G |wo·h| |wi·h|/(cosθo cosθi |h|⁴), the latter times (η_o/η_i)² of radiance, which
   flux is without; G = G1(θo) G1(θi). */
INLINE Light roughdielectric_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    RoughBoundary b = rough_boundary(materials, part, s, wi, cosine, f);
    Real compression = f.use & USE_LIGHT_PATHS ? real(1) : select(b.reflects, real(1), b.ratio * b.ratio);
    return light_scale(rough_boundary_tint(materials, part, s, &b, f),
        real(4) * compression * (b.chance * b.spread / (b.o * b.i)));
}

/* L9 The density of visible normals over the half vector's Jacobian, times the chance; L8 1/4π. */
INLINE Real roughdielectric_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    RoughBoundary b = rough_boundary(materials, part, s, wi, cosine, f);
    Real visible = real(2) * b.chance * b.spread / b.o;
    if (f.use & USE_COSINE)
        return f.use & USE_ALL_NORMALS ? visible * b.all : visible;
    return pdf_w_sphere();
}

/* L9 G1(θi), which (η_o/η_i)² of radiance is apart from (Scatter); L8 4π f_r cosθi. */
INLINE Light roughdielectric_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    RoughBoundary b = rough_boundary(materials, part, s, wi, cosine, f);
    Real c_i = real_abs(cosine), share = f.has & HAS_BLEND ? part->share : real(1);
    Real visible = only(b.meets, real(2) * c_i / b.i);
    if (f.use & USE_ALL_NORMALS)
        visible = only(b.all > real(0), visible / b.all);
    Real uniform = real(16) * REAL_PI * c_i * (b.chance * b.spread / (b.o * b.i));
    return light_scale(rough_boundary_tint(materials, part, s, &b, f),
        (f.use & USE_COSINE ? visible : uniform) / share);
}

/* u[2] chooses between reflection and refraction. What goes to the wrong side of the surface is lost. */
APART Scatter roughdielectric_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[3], Features f)
{
    Real ratio = ROW_REAL(materials, part->row, RoughDielectric, glass.ratio);
    Mask reflects = u[2] < real(0.5);
    Vec wi = sample_hemisphere_uniform(u[0], u[1]);
    if (f.use & USE_COSINE) {
        Roughness a = roughness_of(materials, part->row, ROW_AT(RoughDielectric, roughness), s, f);
        Vec m = vec_normalize(sample_mirror(s, &a, u, f));
        Real c = real_min(vec_dot(s->wo, m), real(1)), c_t = refracted_cosine(c, ratio);
        reflects = real(1) - u[2] >= fresnel_transmittance(c, c_t, ratio);
        wi = vec_sub(vec_scale(m, select(reflects, real(2) * c, ratio * c - c_t)),
            vec_scale(s->wo, select(reflects, real(1), ratio)));
    } else
        wi = vec_from_frame(s->n, vec(wi.x, wi.y, select(reflects, wi.z, -wi.z)));
    Real cosine = vec_dot(s->n, wi);
    Mask kept = (reflects & (cosine > real(0))) | and_not(cosine < real(0), reflects);
    return (Scatter){wi, light_only(kept, roughdielectric_factor(materials, part, s, wi, cosine, f)),
        only(kept, roughdielectric_pdf_w(materials, part, s, wi, cosine, f)), mask_none(),
        select(reflects, real(1), ratio * ratio)};
}

#endif
