/* P1 Rough plastic: a diffuse base under a coat of microfacets, on the side of the normal. What the coat lets through at
   an angle is a table, linear between its entries, as in Mitsuba. */
#pragma once

#include "materials/microfacets.h"
#include "materials/plastic.h"

#define ROUGHPLASTIC_NODES 64 /* at cosines of 0 … 1, with Mitsuba's number and sums below */

typedef struct roughplastic {
    Microfacets facets;
    Plastic plastic;
    double transmittance[ROUGHPLASTIC_NODES], internal; /* once it is checked */
} RoughPlastic;

/* Smith's G1 at the cosine c, as in `masking`. */
static inline double masked(const Microfacets *m, double c)
{
    double across = m->alpha_u.most[0] * sqrt(1 - fmin(c * c, 1));
    if (m->distribution == GGX)
        return 2 * c / (c + sqrt(c * c + across * across));
    return c < 1.6 * across ? c * (3.535 * across + 2.181 * c) / (across * (across + 2.276 * c) + 2.577 * c * c) : 1;
}

/* Half a turn in steps, at their middles: the same for all entries of a table. */
enum { TURN = 16 };
typedef struct {
    double sine[TURN], cosine[TURN];
} HalfTurn;

/* Of light at the cosine c, what microfacets of a boundary, whose index beyond is that of this side times `ratio`, send
   back to this side, or beyond: the mean of F G1(θi) or (1 - F) G1(θi) over the visible normals. By the midpoint rule for
   the numbers that give those of GGX (sample_visible_mirror), of which u[0] is 1 - v², as steep facets make the
   difference, and half a turn is enough; each counts as it is more frequent in the distribution. Within 1e-3 of
   Mitsuba's quadrature. */
static inline double sent_by_facets(
    const Microfacets *m, const HalfTurn *turn, double c, double ratio, bool beyond)
{
    enum { CAP = 32 };
    double a = m->alpha_u.most[0], sine = sqrt(1 - c * c), stretch = sqrt(c * c + a * a * sine * sine), sum = 0, all = 0;
    for (int i = 0; i < CAP * TURN; i++) {
        double v = (i / TURN + 0.5) / (double)CAP, up = v * v * (1 + c / stretch), z = up - c / stretch;
        double ring = sqrt(fmax((1 - z) * (1 + z), 0));
        double x = a * (ring * turn->cosine[i % TURN] + a * sine / stretch), y = a * ring * turn->sine[i % TURN];
        double length = sqrt(x * x + y * y + up * up), o = fmin((sine * x + c * up) / length, 1);
        double o_t = sqrt(fmax(1 - (1 - o * o) / (ratio * ratio), 0));
        double s = (o - ratio * o_t) / (o + ratio * o_t), p = (ratio * o - o_t) / (ratio * o + o_t);
        double fresnel = (s * s + p * p) / 2, slope = (x * x + y * y) / (a * a * up * up);
        double c_i = beyond ? c / ratio - up / length * (o / ratio - o_t) : 2 * o * up / length - c;
        double weight = m->distribution == GGX ? v : v * (1 + slope) * (1 + slope) * cr_exp(-slope);
        all += weight;
        if (o > 0 && c_i > 0)
            sum += weight * masked(m, c_i) * (beyond ? 1 - fresnel : fresnel);
    }
    return sum / all;
}

static inline void roughplastic_check(void *plugin, Said *said)
{
    RoughPlastic *m = plugin;
    const Place *u = given(said, "alpha_u"), *v = given(said, "alpha_v");
    if (u || v)
        fail(said, "<bsdf type=\"roughplastic\"> is rough alike in all directions: write alpha");
    microfacets_check(&m->facets, said);
    if (m->facets.alpha.texture)
        fail(given(said, "alpha"), "\"alpha\" of a roughplastic is a number, as in Mitsuba: what its coat lets through is one table");
    plastic_weigh(&m->plastic);
    double ratio = plastic_ior(&m->plastic);
    if (ratio == 1)
        fail(said, "<bsdf type=\"roughplastic\">: int_ior and ext_ior must differ");
    HalfTurn turn;
    for (int i = 0; i < TURN; i++) {
        double angle = PI * (i + 0.5) / (double)TURN;
        turn.cosine[i] = cr_cos(angle), turn.sine[i] = cr_sin(angle);
    }
    m->internal = 0;
    for (int i = 0; i < ROUGHPLASTIC_NODES; i++) {
        double c = fmax(i / (ROUGHPLASTIC_NODES - 1.0), 1e-6);
        m->transmittance[i] = sent_by_facets(&m->facets, &turn, c, ratio, true);
        m->internal += 2 * c * sent_by_facets(&m->facets, &turn, c, 1 / ratio, false) / ROUGHPLASTIC_NODES;
    }
}
static const Plugin roughplastic_plugin = {"roughplastic", roughplastic_check, {
    MICROFACET_FIELDS, PLASTIC_FIELDS(offsetof(RoughPlastic, plastic))}};

static inline MaterialTraits roughplastic_traits(const RoughPlastic *m)
{
    return (MaterialTraits){&m->plastic.albedo, NULL, .odd = microfacets_odd(&m->facets),
        .beckmann = m->facets.distribution == BECKMANN};
}

#ifdef LANES

enum { roughplastic_transmits = 0 };

typedef struct roughplastic_row {
    PlasticRow plastic;
    RoughnessRow roughness;
    Num transmittance[ROUGHPLASTIC_NODES];
} RoughPlasticRow;
static inline void roughplastic_row(const RoughPlastic *m, int side, RoughPlasticRow *row)
{
    plastic_row(&m->plastic, side, &row->plastic);
    store_roughness(&row->roughness, &m->facets);
    row->plastic.internal = (Num)m->internal;
    for (int i = 0; i < ROUGHPLASTIC_NODES; i++)
        row->transmittance[i] = (Num)m->transmittance[i];
}

INLINE Real coat_transmittance(const Materials *materials, Index row, Real c)
{
    Real at = real_min(real_max(c, real(0)), real(1)) * real(ROUGHPLASTIC_NODES - 1);
    Index before = real_floor(real_min(at, real(ROUGHPLASTIC_NODES - 2)));
    const Num *table = materials->numbers + ROW_AT(RoughPlastic, transmittance);
    Real low = gather(table, (row << materials->shift) + before), high = gather(table + 1, (row << materials->shift) + before);
    return low + (high - low) * (at - real_of(before));
}

/* What eval, pdf and factor have in common: f_r of coat and base, sr⁻¹, and its density. */
typedef struct {
    Light f_r;
    Real pdf_w;
} RoughPlasticAt;

/* The chance of the coat, from where the viewer is: w (1 - T)/(w (1 - T) + (1 - w) T). */
INLINE Real coat_chance(Real p_specular, Real transmittance)
{
    Lobes l = lobes(p_specular, transmittance);
    return over(l.specular, l.sum);
}

/* Coat: F D G/(4 cosθo cosθi); base: T(θo) T(θi) base/π. The density: of visible normals over the half vector's Jacobian,
   4 wo·h, and of L9 cosθ/π, each with its chance; L8 1/2π. */
APART RoughPlasticAt rough_plastic(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    Roughness a = roughness_of(materials, part->row, ROW_AT(RoughPlastic, roughness), s, f);
    Real ratio = ROW_REAL(materials, part->row, RoughPlastic, plastic.ratio);
    Real out = coat_transmittance(materials, part->row, s->cos_o), in = coat_transmittance(materials, part->row, cosine);
    Light base = plastic_base(part, ratio, ROW_REAL(materials, part->row, RoughPlastic, plastic.internal),
        ROW_REAL(materials, part->row, RoughPlastic, plastic.nonlinear), f);
    Light tint = reflectance_at(materials, part->row, ROW_AT(RoughPlastic, plastic.specular), s, f);
    Vec h = vec_add(s->wo, wi);
    Real hh = vec_dot(h, h), c = real_min(real(0.5) * real_sqrt(hh), real(1)), along = s->cos_o + cosine;
    Real visible = ggx_density(&a, s->n, h, hh, along, f) / ggx_masking(&a, s->wo, s->cos_o, f);
    Real fresnel = real(1) - fresnel_transmittance(c, refracted_cosine(c, ratio), ratio);
    Real coat = fresnel * visible * over_ggx(&a, s, h, along, f) / masking(&a, wi, cosine, f);
    Real p = coat_chance(ROW_REAL(materials, part->row, RoughPlastic, plastic.p_specular), out);
    Real chosen = real(0.5) * visible;
    if (f.use & USE_ALL_NORMALS)
        chosen = chosen * all_over_visible(s, h, along, ggx_masking(&a, s->wo, s->cos_o, f));
    Real pdf_w = p * chosen + (real(1) - p) * pdf_w_hemisphere_cosine(cosine);
    return (RoughPlasticAt){
        light_add(light_scale(tint, f.has & HAS_BLEND ? coat * part->share : coat), light_scale(base, out * in * REAL_INV_PI)),
        f.use & USE_COSINE ? pdf_w : pdf_w_hemisphere_uniform()};
}

INLINE Light roughplastic_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    return rough_plastic(materials, part, s, wi, cosine, f).f_r;
}

INLINE Real roughplastic_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    return rough_plastic(materials, part, s, wi, cosine, f).pdf_w;
}

INLINE Light roughplastic_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    RoughPlasticAt at = rough_plastic(materials, part, s, wi, cosine, f);
    return factor_of(at.f_r, at.pdf_w, cosine, part, f);
}

APART Scatter roughplastic_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Vec wi;
    if (f.use & USE_COSINE) {
        Roughness a = roughness_of(materials, part->row, ROW_AT(RoughPlastic, roughness), s, f);
        Real p = coat_chance(ROW_REAL(materials, part->row, RoughPlastic, plastic.p_specular),
            coat_transmittance(materials, part->row, s->cos_o));
        Mask coated = u[0] < p;
        Real again[2] = {select(coated, over(u[0], p), over(u[0] - p, real(1) - p)), u[1]};
        Vec m = sample_mirror(s, &a, again, f);
        Vec mirror = vec_sub(vec_scale(m, real(2) * vec_dot(s->wo, m) / vec_dot(m, m)), s->wo);
        wi = vec_select(coated, mirror, vec_from_frame(s->n, sample_hemisphere_cosine(again[0], again[1])));
    } else
        wi = vec_from_frame(s->n, sample_hemisphere_uniform(u[0], u[1]));
    Real cosine = vec_dot(s->n, wi);
    Mask up = cosine > real(0);
    RoughPlasticAt at = rough_plastic(materials, part, s, wi, real_max(cosine, real(0)), f);
    Light factor = factor_of(at.f_r, at.pdf_w, cosine, part, f);
    return (Scatter){wi, light_only(up, factor), only(up, at.pdf_w), mask_none(), real(1)};
}

#endif
