/* P2 Principled: a diffuse base, metal or glass under microfacets, with sheen and a clear coat, by few numbers of 0 … 1.
   Burley, Physically Based Shading at Disney, SIGGRAPH 2012, and its extension to a BSDF, 2015, by the formulas that
   Mitsuba 3.9.1 has (src/bsdfs/principled.cpp, principledhelpers.h). It may give back more light than it gets. */
#pragma once

#include "materials/dielectric.h"
#include "materials/microfacets.h"

typedef struct principled {
    Reflectance base_color;
    Reflectance roughness, anisotropic, metallic, spec_trans, spec_tint, sheen, sheen_tint, flatness, clearcoat;
    double clearcoat_gloss;
    double eta, specular;  /* the first once it is checked, also where the file says the second: inside over outside */
    double specular_rate, coat_rate, diffuse_rate; /* how often directions are sampled by each */
    Reflectance albedo;    /* once it is checked, about the more of what goes on, and the less */
} Principled;

static inline bool may_be_more_than_0(const Reflectance *share) { return share->texture || share->most[0] > 0; }

static inline void principled_check(void *plugin, Said *said)
{
    Principled *m = plugin;
    bool transmits = may_be_more_than_0(&m->spec_trans);
    const Place *eta = given(said, "eta");
    if (eta && given(said, "specular"))
        fail(eta, "<bsdf type=\"principled\">: write eta or specular");
    if (eta && transmits && m->eta == 1)
        m->eta = 1.001;
    if (!eta) /* R0 = .08 specular */
        m->eta = 2 / (1 - sqrt(.08 * (transmits && m->specular == 0 ? 1e-3 : m->specular))) - 1;
    for (int c = 0; c < 3; c++) {
        double most = fmin(1, m->base_color.most[c] + .05 + .3 * m->sheen.most[0] + .1 * m->clearcoat.most[0]);
        m->albedo.most[c] = transmits ? 1 : most;
        m->albedo.least[c] = transmits ? 1 : m->base_color.least[c];
    }
}

#define SHARE(name, otherwise) {#name, AS_SHARE, offsetof(Principled, name), "[0,1]", otherwise}
static const Plugin principled_plugin = {"principled", principled_check, {
    {"base_color", AS_REFLECTANCE, offsetof(Principled, base_color), "[0,1]", ".5"},
    SHARE(roughness, "0.5"), SHARE(anisotropic, "0"), SHARE(metallic, "0"), SHARE(spec_trans, "0"),
    SHARE(spec_tint, "0"), SHARE(sheen, "0"), SHARE(sheen_tint, "0"), SHARE(flatness, "0"), SHARE(clearcoat, "0"),
    {"clearcoat_gloss", AS_FLOAT, offsetof(Principled, clearcoat_gloss), "[0,1]", "0"},
    {"eta", AS_FLOAT, offsetof(Principled, eta), "(0,1000]", ""},
    {"specular", AS_FLOAT, offsetof(Principled, specular), "[0,1]", "0.5"},
    {"main_specular_sampling_rate", AS_FLOAT, offsetof(Principled, specular_rate), "(0,1000]", "1"},
    {"clearcoat_sampling_rate", AS_FLOAT, offsetof(Principled, coat_rate), "[0,1000]", "1"},
    {"diffuse_reflectance_sampling_rate", AS_FLOAT, offsetof(Principled, diffuse_rate), "[0,1000]", "1"}}};
#undef SHARE

static inline MaterialTraits principled_traits(const Principled *m)
{
    bool transmits = may_be_more_than_0(&m->spec_trans), coated = may_be_more_than_0(&m->clearcoat);
    const char *odd = m->roughness.least[0] < 0.1 ? "a roughness below 0.1"
                      : coated && m->clearcoat_gloss > 0.9 ? "a clearcoat_gloss above 0.9"
                      : transmits && fabs(m->eta - 1) < 1e-3 ? "an index of refraction within 0.001 of 1" : NULL;
    return (MaterialTraits){&m->albedo, transmits ? &m->albedo : NULL, .absorbs = true, .odd = odd,
        .anisotropic = may_be_more_than_0(&m->anisotropic)};
}

#ifdef LANES

enum { principled_transmits = 1 };

typedef struct principled_row {
    ReflectanceRow base_color;
    ShareRow roughness, anisotropic, metallic, spec_trans, spec_tint, sheen, sheen_tint, flatness, clearcoat;
    Num front;        /* 1 on the side of the normal, 0 beyond it, where there is but the boundary of glass */
    Num ratio;        /* the index of refraction on this side over that beyond */
    Num ln_coat;      /* ln α² of the coat */
    Num specular_rate, coat_rate, diffuse_rate;
} PrincipledRow;
static inline void principled_row(const Principled *m, int side, PrincipledRow *row)
{
    store_reflectance(&row->base_color, &m->base_color);
    store_share(&row->roughness, &m->roughness);
    store_share(&row->anisotropic, &m->anisotropic);
    store_share(&row->metallic, &m->metallic);
    store_share(&row->spec_trans, &m->spec_trans);
    store_share(&row->spec_tint, &m->spec_tint);
    store_share(&row->sheen, &m->sheen);
    store_share(&row->sheen_tint, &m->sheen_tint);
    store_share(&row->flatness, &m->flatness);
    store_share(&row->clearcoat, &m->clearcoat);
    row->front = !side;
    row->ratio = (Num)(side ? m->eta : 1 / m->eta);
    row->ln_coat = (Num)(2 * cr_log(.1 + (.001 - .1) * m->clearcoat_gloss));
    row->specular_rate = (Num)m->specular_rate;
    row->coat_rate = (Num)(.25 * m->coat_rate);
    row->diffuse_rate = (Num)m->diffuse_rate;
}
#define PRINCIPLED_SHARE(name) share_at(materials, part->row, ROW_AT(Principled, name), s, f)
#define PRINCIPLED_REAL(name) ROW_REAL(materials, part->row, Principled, name)

/* What the material is at a point. */
typedef struct {
    Light base, tint; /* tint: the base's colour with luminance 1 */
    Real ratio, metallic, glass, diffuse; /* glass, diffuse: the weights of what transmits, and of what does not */
    Real coat, coat_alpha2, ln_coat;
    Mask front;
    Roughness a;
    Real p_specular, p_diffuse, p_coat; /* the chance of each lobe; of the first both what it reflects and transmits */
} PrincipledView;

INLINE PrincipledView principled_view(const Materials *materials, const Part *part, const Surface *s, Features f)
{
    PrincipledView v = {.base = part->reflectance, .front = PRINCIPLED_REAL(front) > real(0)};
    if (f.has & HAS_BLEND)
        v.base = light_scale(v.base, real(1) / part->share);
    Real whole = luminance(v.base), trans = PRINCIPLED_SHARE(spec_trans), rough = PRINCIPLED_SHARE(roughness);
    v.tint = light_select(whole > real(0), light_scale(v.base, real(1) / whole), light_all(real(1)));
    v.ratio = PRINCIPLED_REAL(ratio);
    v.metallic = PRINCIPLED_SHARE(metallic);
    v.glass = (real(1) - v.metallic) * trans;
    v.diffuse = only(v.front, (real(1) - v.metallic) * (real(1) - trans));
    v.coat = only(v.front, PRINCIPLED_SHARE(clearcoat));
    v.ln_coat = PRINCIPLED_REAL(ln_coat);
    v.coat_alpha2 = real_exp(v.ln_coat);
    v.a.u = v.a.v = real_max(rough * rough, real(1e-3));
    if (f.has & HAS_ANISOTROPIC) {
        Real aspect = real_sqrt(real(1) - real(0.9) * PRINCIPLED_SHARE(anisotropic));
        v.a.u = real_max(rough * rough / aspect, real(1e-3));
        v.a.v = real_max(rough * rough * aspect, real(1e-3));
        set_tangents(&v.a, s);
    }
    v.p_specular = select(v.front, PRINCIPLED_REAL(specular_rate), real(1));
    v.p_diffuse = v.diffuse * PRINCIPLED_REAL(diffuse_rate);
    v.p_coat = v.coat * PRINCIPLED_REAL(coat_rate);
    Real sum = v.p_specular + v.p_diffuse + v.p_coat;
    v.p_specular = v.p_specular / sum;
    v.p_diffuse = v.p_diffuse / sum;
    v.p_coat = v.p_coat / sum;
    return v;
}

/* Of light that meets a microfacet, what takes the transmitted lobe: inside all that is not reflected, outside as far
   as the material is glass. */
INLINE Real principled_p_transmit(const PrincipledView *v, Real transmittance)
{
    return transmittance * select(v->front, v->glass, real(1));
}

/* Schlick's (1 - c)⁵. */
INLINE Real schlick_weight(Real c)
{
    Real x = real_max(real(1) - c, real(0)), xx = x * x;
    return xx * xx * x;
}
INLINE Light schlick(Light r0, Real weight) { return light_mix(r0, light_all(real(1)), weight); }

/* What the microfacets reflect in front: of (1 - metallic)(1 - spec_tint) a dielectric's F, of the rest Schlick's. */
INLINE Light principled_fresnel(const PrincipledView *v, Real reflectance, Real weight, Real spec_tint)
{
    Real root = (real(1) - v->ratio) / (real(1) + v->ratio), plain = real(1) - v->metallic;
    Light metal = light_scale(schlick(v->base, weight), v->metallic);
    Light tinted = light_scale(schlick(light_scale(v->tint, root * root), weight), plain * spec_tint);
    return light_add(light_all(plain * (real(1) - spec_tint) * reflectance), light_add(metal, tinted));
}

/* The base: Burley's diffuse with its bright edge, and where it is flat Hanrahan and Krueger's, sr⁻¹ over the colour. */
INLINE Real principled_base(Real rough, Real flatness, Real c_o, Real c_i, Real c)
{
    Real o = schlick_weight(c_o), i = schlick_weight(c_i), back = real(2) * rough * c * c;
    Real smooth = (real(1) - real(0.5) * i) * (real(1) - real(0.5) * o);
    Real edge = back * (o + i + o * i * (back - real(1)));
    Real to = real(0.5) * back - real(1), under = (real(1) + to * o) * (real(1) + to * i);
    Real flat = real(1.25) * (under * (real(1) / (c_o + c_i) - real(0.5)) + real(0.5));
    return (smooth + edge + (flat - smooth - edge) * flatness) * REAL_INV_PI;
}

/* What eval, pdf and factor have in common. */
typedef struct {
    Light f_r;  /* sr⁻¹; times the share, and less (η_o/η_i)² of what is transmitted */
    Real pdf_w; /* sr⁻¹ */
    Mask reflects;
    Real ratio;
} PrincipledValue;

/* At the half vector h ∥ wo + wi, or beyond the boundary h ∥ η_o wo + η_i wi (roughdielectric.h). */
APART PrincipledValue principled_value(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    PrincipledView v = principled_view(materials, part, s, f);
    Mask reflects = cosine > real(0);
    Real by = select(reflects, real(1), v.ratio), c_i = real_abs(cosine), c_o = s->cos_o;
    Vec h = vec_add(vec_scale(s->wo, by), wi);
    Real hh = vec_dot(h, h), along = by * c_o + cosine;
    Real o = flip_sign(vec_dot(s->wo, h), along), i = flip_sign(vec_dot(wi, h), along);
    Mask meets = (hh > real(0)) & (o > real(0)) & (reflects | (i < real(0)));
    Real c = real_min(only(meets, o / real_sqrt(hh)), real(1)), c_t = refracted_cosine(c, v.ratio);
    Real transmittance = fresnel_transmittance(c, c_t, v.ratio);
    Real weight = schlick_weight(select(v.ratio < real(1), c, c_t));
    Real d = ggx_density(&v.a, s->n, h, hh, along, f);
    Real stretch_o = c_o + ggx_stretch(&v.a, s->wo, c_o, f), stretch_i = c_i + ggx_stretch(&v.a, wi, c_i, f);

    /* reflected: by the microfacets F D G/(4 cosθo cosθi), where the indices differ, … */
    Light fresnel = principled_fresnel(&v, real(1) - transmittance, weight, PRINCIPLED_SHARE(spec_tint));
    fresnel = light_select(v.front, fresnel, light_all(v.glass * (real(1) - transmittance)));
    Light reflected = light_scale(fresnel, only(mask_not(v.ratio == real(1)), d / (stretch_o * stretch_i)));
    /* … by the coat: Schlick's F of 0.04, D ∝ 1/(sin²θh + α² cos²θh), G of α 0.25, … */
    Vec across = vec_sub(h, vec_scale(s->n, along));
    Real slope = vec_dot(across, across) + v.coat_alpha2 * (along * along), a2 = real(0.0625);
    Real d_coat = (v.coat_alpha2 - real(1)) / v.ln_coat * REAL_INV_PI * only(slope > real(0), hh / slope);
    Real g_o = c_o + real_sqrt(c_o * c_o + a2 * ((real(1) - c_o) * (real(1) + c_o)));
    Real g_i = c_i + real_sqrt(c_i * c_i + a2 * ((real(1) - c_i) * (real(1) + c_i)));
    Real coat = v.coat * (real(0.04) + real(0.96) * weight) * d_coat * (c_o / g_o * (c_i / g_i));
    /* … by the base, and by its sheen, (1 - wo·h)⁵ of a colour. */
    Real base = v.diffuse * principled_base(PRINCIPLED_SHARE(roughness), PRINCIPLED_SHARE(flatness), c_o, c_i, c);
    Light sheen = light_mix(light_all(real(1)), v.tint, PRINCIPLED_SHARE(sheen_tint));
    sheen = light_scale(sheen, only(v.front, (real(1) - v.metallic) * PRINCIPLED_SHARE(sheen) * schlick_weight(c)));
    reflected = light_add(light_add(reflected, light_all(coat)), light_add(light_scale(v.base, base), sheen));

    /* transmitted: (1 - F) D G |wo·h| |wi·h|/(cosθo cosθi |h|⁴) of the root of the colour */
    Real bent = d * real_abs(o / hh * (i / hh));
    Light root = light(real_sqrt(v.base.r), real_sqrt(v.base.g), real_sqrt(v.base.b));
    Light through = light_scale(root, v.glass * real(4) * transmittance * (bent / (stretch_o * stretch_i)));

    Real p_transmit = principled_p_transmit(&v, transmittance), share = f.has & HAS_BLEND ? part->share : real(1);
    Real pdf_reflected = v.p_specular * (real(1) - p_transmit) * (d / (real(2) * stretch_o))
                         + v.p_diffuse * pdf_w_hemisphere_cosine(c_i)
                         + v.p_coat * d_coat * only(meets, real(0.25) * real_abs(along) / o);
    Real pdf_through = v.p_specular * p_transmit * (real(2) * bent / stretch_o);
    Real pdf_w = only(meets, select(reflects, pdf_reflected, pdf_through));
    if (!(f.use & USE_COSINE)) /* L8 */
        pdf_w = select(v.glass > real(0), pdf_w_sphere(), only(reflects, pdf_w_hemisphere_uniform()));
    return (PrincipledValue){
        light_scale(light_only(meets, light_select(reflects, reflected, through)), share), pdf_w, reflects, v.ratio};
}

/* With (η_o/η_i)² of the radiance that is transmitted, which flux is without. */
INLINE Light principled_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    PrincipledValue value = principled_value(materials, part, s, wi, cosine, f);
    Real compression = f.use & USE_LIGHT_PATHS ? real(1) : select(value.reflects, real(1), value.ratio * value.ratio);
    return light_scale(value.f_r, compression);
}

INLINE Real principled_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    return principled_value(materials, part, s, wi, cosine, f).pdf_w;
}

INLINE Light principled_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    PrincipledValue value = principled_value(materials, part, s, wi, cosine, f);
    return factor_of(value.f_r, value.pdf_w, real_abs(cosine), part, f);
}

/* A microfacet of the coat, cos²θ = (1 - α^(2 (1 - u)))/(1 - α²). */
INLINE Vec principled_coat_mirror(const Surface *s, const PrincipledView *v, const Real u[2])
{
    Real power = real_exp(v->ln_coat * (real(1) - u[1])), rest = real(1) - v->coat_alpha2, sine, cosine;
    Real ring = real_sqrt(real_max(power - v->coat_alpha2, real(0)) / rest);
    sincos_turn(u[0], &sine, &cosine);
    return vec_from_frame(s->n, vec(ring * cosine, ring * sine, real_sqrt((real(1) - power) / rest)));
}

/* u[2] chooses the lobe: diffuse, coat, transmitted, reflected. What goes to the wrong side of the surface is lost. */
APART Scatter principled_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[3], Features f)
{
    PrincipledView v = principled_view(materials, part, s, f);
    Mask reflects = mask_not(v.glass > real(0)) | (u[2] < real(0.5)), right = mask_all();
    Vec wi = sample_hemisphere_uniform(u[0], u[1]);
    if (f.use & USE_COSINE) {
        Mask diffuse = u[2] < v.p_diffuse, coat = and_not(u[2] < v.p_diffuse + v.p_coat, diffuse);
        Vec m = vec_normalize(sample_visible_mirror(s, &v.a, u, f));
        m = vec_select(coat, principled_coat_mirror(s, &v, u), m);
        Real c = real_min(vec_dot(s->wo, m), real(1)), c_t = refracted_cosine(c, v.ratio);
        Real p = v.p_specular * principled_p_transmit(&v, fresnel_transmittance(c, c_t, v.ratio));
        reflects = diffuse | coat | (u[2] >= v.p_diffuse + v.p_coat + p);
        right = diffuse | (c > real(0));
        wi = vec_sub(vec_scale(m, select(reflects, real(2) * c, v.ratio * c - c_t)),
            vec_scale(s->wo, select(reflects, real(1), v.ratio)));
        wi = vec_select(diffuse, vec_from_frame(s->n, sample_hemisphere_cosine(u[0], u[1])), wi);
    } else
        wi = vec_from_frame(s->n, vec(wi.x, wi.y, select(reflects, wi.z, -wi.z)));
    Real cosine = vec_dot(s->n, wi);
    Mask kept = right & ((reflects & (cosine > real(0))) | and_not(cosine < real(0), reflects));
    return (Scatter){wi, light_only(kept, principled_factor(materials, part, s, wi, cosine, f)),
        only(kept, principled_pdf_w(materials, part, s, wi, cosine, f)), mask_none(),
        select(reflects, real(1), v.ratio * v.ratio)};
}

#endif
