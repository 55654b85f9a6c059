/* P1 Microfacets: mirrors too small to be seen, turned this way and that, on a surface with the roughness alpha.
   Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007, with their GGX distribution and
   Beckmann's. */
#pragma once

#include "fields.h"
#include "traits.h"

#include <math.h>

typedef struct {
    Reflectance alpha;            /* roughness: half of the mirrors are steeper than this slope */
    Reflectance alpha_u, alpha_v; /* once it is checked, the same along the surface's dp/du, and across that */
    int distribution;             /* BECKMANN or GGX */
} Microfacets;
enum { BECKMANN, GGX };

/* Of all plugins whose struct begins with Microfacets. */
#define MICROFACET_FIELDS                                                                                    \
    {"distribution", AS_WORD, offsetof(Microfacets, distribution), "beckmann, ggx", "beckmann"},             \
    {"alpha", AS_SHARE, offsetof(Microfacets, alpha), "[0,1000]", "0.1"},                                    \
    {"alpha_u", AS_SHARE, offsetof(Microfacets, alpha_u), "[0,1000]", ""},                                   \
    {"alpha_v", AS_SHARE, offsetof(Microfacets, alpha_v), "[0,1000]", ""},                                   \
    {"sample_visible", AS_BOOLEAN, NOWHERE, NULL, "true"} /* how it is sampled, not what it is */

#define LEAST_ROUGHNESS 1e-4 /* as Mitsuba */

static inline void microfacets_check(Microfacets *m, Said *said)
{
    const Place *u = given(said, "alpha_u"), *v = given(said, "alpha_v");
    if (!u != !v || (u && given(said, "alpha")))
        fail(said, "<bsdf type=\"%s\">: write alpha, or both alpha_u and alpha_v", said->type);
    if (!u)
        m->alpha_u = m->alpha_v = m->alpha;
    m->alpha_u.most[0] = fmax(m->alpha_u.most[0], LEAST_ROUGHNESS);
    m->alpha_v.most[0] = fmax(m->alpha_v.most[0], LEAST_ROUGHNESS);
}

static inline bool is_anisotropic(const Microfacets *m)
{
    return m->alpha_u.texture != m->alpha_v.texture || m->alpha_u.most[0] != m->alpha_v.most[0];
}

static inline const char *microfacets_odd(const Microfacets *m)
{
    return fmin(m->alpha_u.least[0], m->alpha_v.least[0]) < 0.01 ? "a roughness below 0.01" : NULL;
}

#ifdef LANES

#include "materials/material.h"

typedef struct {
    ShareRow u, v;
    Num beckmann;
} RoughnessRow;
static inline void store_roughness(RoughnessRow *row, const Microfacets *m)
{
    store_share(&row->u, &m->alpha_u);
    store_share(&row->v, &m->alpha_v);
    row->beckmann = m->distribution == BECKMANN;
}

/* The roughness of a part; where some are anisotropic, along two unit vectors of the surface. */
typedef struct {
    Real u, v;
    Vec along_u, along_v;
    Mask beckmann;
} Roughness;

/* The tangents are dp/du less what lies along the shading normal, and across that, as Mitsuba's; any where it is 0. */
INLINE void set_tangents(Roughness *a, const Surface *s)
{
    vec_frame(s->n, &a->along_u, &a->along_v);
    Vec tangent = vec_sub(s->dp_du, vec_scale(s->n, vec_dot(s->n, s->dp_du)));
    a->along_u = vec_select(vec_dot(tangent, tangent) > real(0), vec_normalize(tangent), a->along_u);
    a->along_v = vec_cross(s->n, a->along_u);
}

INLINE Real roughness_at(const Materials *materials, Index row, size_t place, const Surface *s, Features f)
{
    Real alpha = share_at(materials, row, place, s, f);
    if (!(f.has & HAS_ANY(TEXTURES)))
        return alpha;
    Real whole = gather(materials->numbers + place + ROW_AT(Share, number), row << materials->shift); /* 1 of a texture */
    return real_max(alpha, real(LEAST_ROUGHNESS) * whole);
}

INLINE Roughness roughness_of(const Materials *materials, Index row, size_t place, const Surface *s, Features f)
{
    const Num *numbers = materials->numbers + place;
    Roughness a;
    a.u = roughness_at(materials, row, place + ROW_AT(Roughness, u), s, f);
    if (f.has & HAS_BECKMANN)
        a.beckmann = gather(numbers + ROW_AT(Roughness, beckmann), row << materials->shift) > real(0);
    if (!(f.has & HAS_ANISOTROPIC))
        return a;
    a.v = roughness_at(materials, row, place + ROW_AT(Roughness, v), s, f);
    set_tangents(&a, s);
    return a;
}

/* α² sin²θ of a unit vector w, which has the cosine c with the normal: α_u² x² + α_v² y². */
INLINE Real roughness_across(const Roughness *a, Vec w, Real c, Features f)
{
    if (!(f.has & HAS_ANISOTROPIC))
        return a->u * a->u * ((real(1) - c) * (real(1) + c));
    Real x = a->u * vec_dot(w, a->along_u), y = a->v * vec_dot(w, a->along_v);
    return x * x + y * y;
}

/* How long it is once all that is across the normal is shrunk by α. */
INLINE Real ggx_stretch(const Roughness *a, Vec w, Real c, Features f)
{
    return real_sqrt(c * c + roughness_across(a, w, c, f));
}

/* 2 cosθ/G1(θ). Smith's: cosθ + √(cos²θ + α² sin²θ) of GGX; of Beckmann the fit that Mitsuba has, to .35 %. */
INLINE Real ggx_masking(const Roughness *a, Vec w, Real c, Features f) { return c + ggx_stretch(a, w, c, f); }
INLINE Real masking(const Roughness *a, Vec w, Real c, Features f)
{
    Real ggx = ggx_masking(a, w, c, f);
    if (!(f.has & HAS_BECKMANN))
        return ggx;
    Real q = real_sqrt(real_max(roughness_across(a, w, c, f), real(0))); /* c may be a rounding above 1 */
    Real fit = (q * q + c * (real(2.276) * q + real(2.577) * c)) / (real(3.535) * q + real(2.181) * c);
    return select(a->beckmann, real(2) * select(c >= real(1.6) * q, c, fit), ggx);
}

/* (α_u α_v)² times the parts of h along the normal and across, shrunk by 1/α: of GGX h²/α² and z². */
typedef struct {
    Real across, along;
} Slope;
INLINE Slope slope_of(const Roughness *a, Vec n, Vec h, Real along, Features f)
{
    Vec across = vec_sub(h, vec_scale(n, along));
    if (!(f.has & HAS_ANISOTROPIC))
        return (Slope){vec_dot(across, across), a->u * a->u * (along * along)};
    Real x = a->v * vec_dot(across, a->along_u), y = a->u * vec_dot(across, a->along_v), both = a->u * a->v;
    return (Slope){x * x + y * y, both * both * (along * along)};
}

/* GGX's D, sr⁻¹: area of the mirrors whose normal is h, by projected area and solid angle, of a vector h either way up,
   the square hh of its length, and its part along n. D = 1/(π α_u α_v (x²/α_u² + y²/α_v² + z²)²) of h/|h| = (x, y, z),
   by h's parts along the normal and across, which keep their digits. */
INLINE Real ggx_density(const Roughness *a, Vec n, Vec h, Real hh, Real along, Features f)
{
    Slope slope = slope_of(a, n, h, along, f);
    Real size = slope.across + slope.along, both = f.has & HAS_ANISOTROPIC ? a->u * a->v : a->u;
    Real q = both * only(size > real(0), hh / size);
    return f.has & HAS_ANISOTROPIC ? q * q * both * REAL_INV_PI : q * q * REAL_INV_PI;
}

/* Mirrors of either distribution are sampled as GGX's are. How much more of them there is, seen by wo: D G1(θo) over
   GGX's. D of Beckmann is that of GGX times (1 + x)² exp(-x), which is below 1.5, x being tan²θ/α². */
INLINE Real over_ggx(const Roughness *a, const Surface *s, Vec h, Real along, Features f)
{
    if (!(f.has & HAS_BECKMANN))
        return real(1);
    Slope slope = slope_of(a, s->n, h, along, f);
    Mask near = slope.across < real(64) * slope.along;
    Real x = only(near, slope.across / slope.along), more = (real(1) + x) * (real(1) + x) * real_exp(-x);
    Real d = select(near, more, real(0));
    return select(a->beckmann, d * (ggx_masking(a, s->wo, s->cos_o, f) / masking(a, s->wo, s->cos_o, f)), real(1));
}

/* What the density of all mirrors, D cosθ, is over that of those that wo sees, D G1(θo) (wo·h)/cosθo, for a vector h of
   any length, its part along n, and o, GGX's 2 cosθo/G1(θo). */
INLINE Real all_over_visible(const Surface *s, Vec h, Real along, Real o)
{
    Real seen = vec_dot(s->wo, h);
    return only(seen * along > real(0), along * o / (real(2) * seen));
}

/* One of all mirrors: tan²θ = α² u/(1 - u), at any angle around. */
INLINE Vec sample_any_mirror(const Surface *s, const Roughness *a, const Real u[2], Features f)
{
    Vec local = turned(real_sqrt(u[0]), u[1], real_sqrt(real(1) - u[0]));
    local.x = local.x * a->u;
    if (!(f.has & HAS_ANISOTROPIC)) {
        local.y = local.y * a->u;
        return vec_from_frame(s->n, local);
    }
    Vec across = vec_add(vec_scale(a->along_u, local.x), vec_scale(a->along_v, a->v * local.y));
    return vec_add(across, vec_scale(s->n, local.z));
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

INLINE Vec sample_mirror(const Surface *s, const Roughness *a, const Real u[2], Features f)
{
    return f.use & USE_ALL_NORMALS ? sample_any_mirror(s, a, u, f) : sample_visible_mirror(s, a, u, f);
}

#endif
