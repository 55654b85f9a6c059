/* What a surface does with light, whatever its material: the choice between the kinds, and L16 mixed materials. */
#pragma once

#include "materials/bump.h"
#include "kinds/materials.h"

/* Bits of the materials that light goes through. */
#define IF_TRANSMITS(NAME, name, words) | (name##_transmits ? HAS_##NAME : 0)
#define TRANSMITTING (0 MATERIALS(IF_TRANSMITS))
#define FINITE_TRANSMITTING (0 FINITE_MATERIALS(IF_TRANSMITS))
/* And of those that send light on even where their reflectance is black. */
#define BRIGHT_WHERE_BLACK (TRANSMITTING | HAS_ANY(COATS) | HAS_BLEND)

/* Where there is one kind of material and its reflectance is all that goes on, no kind is looked up: a path ends at
   what is black, before it is asked of its kind. */
INLINE int one_material(Features f) { return IS_ONE(f.has & HAS_ANY(MATERIALS)) && !(f.has & (BRIGHT_WHERE_BLACK | HAS_BUMP)); }

INLINE Index kind_of_row(const Materials *materials, Index row, Features f)
{
    uint64_t has = f.has & HAS_ANY(MATERIALS); /* 0 where all is black, of which ctz would be undefined: HAS_SMOOTH */
    return one_material(f) ? index_of(__builtin_ctzll(has | HAS_SMOOTH) - BIT_HAS_DIFFUSE)
                           : gather_index(materials->kind, row);
}

INLINE Mask is_delta(Index kind, Features f)
{
    Mask delta = mask_none();
    if (one_material(f))
        return f.has & HAS_ANY(DELTA_MATERIALS) ? mask_all() : delta;
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        delta |= kind == index_of(MATERIAL_##NAME);
    DELTA_MATERIALS(X)
#undef X
    return delta;
}

/* HAS_WEIGHTS: what textures make of a row's share of a blend. */
INLINE Real textured_share(const Materials *materials, Index row, const Surface *s, Features f)
{
    Real by[4], share = real(1);
    gather_four(materials->share_by, row * 4, by);
    for (int i = 0; i < 4; i += 2) {
        Index texture = real_floor(by[i]);
        if (!any(texture > 0))
            continue;
        Real weight = luminance(texture_at(&materials->textures, texture, s->u, s->v, f));
        share = share * select(by[i + 1] > real(0), real(1) - weight, weight);
    }
    return share;
}

/* Of the random numbers that come to a row of a blend, how many stay: at most 2, of the last. *left is what the rows before
   have left of the whole. */
INLINE Real stays(const Materials *materials, Index row, Real share, Real *left, Features f)
{
    Real p_stay = gather(materials->p_stay, row);
    if (f.has & HAS_WEIGHTS) {
        p_stay = select(p_stay < real(1), only(*left > real(0), share / *left), p_stay);
        *left = *left - share;
    }
    return p_stay;
}

/* The numbers of the surface's first row, s->row. */
INLINE void find_material(const Materials *materials, Surface *s, Features f)
{
    s->kind = kind_of_row(materials, s->row, f);
    s->reflectance = reflectance_at(materials, s->row, 0, s, f);
    s->share = f.has & HAS_BLEND ? gather(materials->p_stay, s->row) : real(1);
    s->delta = is_delta(s->kind, f);
    if (f.has & HAS_WEIGHTS) {
        Real by = textured_share(materials, s->row, s, f);
        s->share = select(s->share < real(1), gather(materials->share, s->row) * by, s->share);
        s->reflectance = light_scale(s->reflectance, select(s->delta, real(1), by));
    }
    s->both_sides =
        f.has & FINITE_TRANSMITTING ? (gather_index(materials->has, s->row) & PARTS_TRANSMIT) != 0 : mask_none();
}

/* Is any of it a delta, of a blend any part? */
INLINE Mask has_delta(const Materials *materials, const Surface *s, Features f)
{
    return f.has & (HAS_BLEND | HAS_ANY(SMOOTH_COATS)) ? (gather_index(materials->has, s->row) & PARTS_DELTA) != 0 : s->delta;
}

/* What a material that is no delta makes of light from one direction. */
typedef struct {
    Light f_r;    /* the BSDF, sr⁻¹ */
    Real pdf_w;   /* of sample_material's taking this direction, sr⁻¹ */
    Light factor; /* f_r cosθ / pdf_w, if the technique or a blend asks for it */
} Evaluation;

/* The first kind is taken for all, and the others are laid over it. */
INLINE Evaluation evaluate_part(
    const Materials *materials, const Part *part, Index kind, const Surface *s, Vec wi, Real cosine, Features f)
{
    int some_transmit = (f.has & FINITE_TRANSMITTING) != 0;
    int one_kind = IS_ONE(f.has & HAS_ANY(FINITE_MATERIALS)) && !some_transmit && !(f.has & HAS_ANY(COATS));
    Evaluation out = {light_all(real(0)), real(0), light_all(real(0))};
    Part whole = *part;
    Real share = part->share;
    (void)kind;
    if (f.has & HAS_WEIGHTS) { /* kinds divide by it */
        whole.share = select(share > real(0), share, real(1));
        part = &whole;
    }
    BumpedSurface bumped;
    Real own = cosine, shadow = real(1);
    if (f.has & HAS_BUMP) {
        bumped = bumped_surface(materials, part->row, s, f);
        s = &bumped.at;
        cosine = select(bumped.bumped, vec_dot(s->n, wi), own);
        shadow = bump_shadow(&bumped, own, cosine);
    }
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        Mask is = one_kind || !MATERIAL_##NAME ? mask_all() : kind == index_of(MATERIAL_##NAME);             \
        if (some_transmit && !name##_transmits) /* to it, what is behind is dark */                          \
            is &= cosine > real(0);                                                                          \
        out.f_r = light_select(is, name##_eval(materials, part, s, wi, cosine, f), out.f_r);                    \
        out.pdf_w = select(is, name##_pdf_w(materials, part, s, wi, cosine, f), out.pdf_w);                  \
        if (f.use & USE_SURVIVAL_PDF)                                                                        \
            out.factor = light_select(is, name##_factor(materials, part, s, wi, cosine, f), out.factor);     \
    }
    FINITE_MATERIALS(X)
#undef X
    if (f.has & HAS_BUMP) { /* f_r, like the rest of it, is of the light by the surface's own cosine */
        out.f_r = light_only(shadow > real(0), light_scale(out.f_r, shadow * real_abs(cosine / own)));
        out.pdf_w = only(shadow > real(0), out.pdf_w);
        out.factor = light_only(shadow > real(0), light_scale(out.factor, shadow));
    }
    if (f.has & HAS_BLEND)
        out.pdf_w = out.pdf_w * share;
    return out;
}

/* A row beyond the first. */
INLINE Part part_of_row(const Materials *materials, const Surface *s, Index row, Features f)
{
    Part part = {row, reflectance_at(materials, row, 0, s, f), f.has & HAS_PARTS ? gather(materials->share, row) : s->share};
    if (f.has & HAS_WEIGHTS) {
        Real by = textured_share(materials, row, s, f);
        part.share = gather(materials->share, row) * by;
        part.reflectance = light_scale(part.reflectance, select(is_delta(kind_of_row(materials, row, f), f), real(1), by));
    }
    return part;
}

/* L16 Takes the parts of mixed materials that are no delta together: Σ f_r, Σ share pdf_w. */
INLINE void evaluate_other_parts(
    const Materials *materials, const Surface *s, Vec wi, Real cosine, Evaluation *sum, Features f)
{
    Index row = s->row;
    Real p_stay = f.has & HAS_WEIGHTS ? gather(materials->p_stay, row) : s->share;
    for (int layer = 1; layer < materials->layers; layer++) {
        Mask more = p_stay < real(1);
        if (!any(more))
            break;
        row = index_select(more, gather_index(materials->next, row), row);
        p_stay = select(more, gather(materials->p_stay, row), real(2));
        Index kind = kind_of_row(materials, row, f);
        Part part = part_of_row(materials, s, row, f);
        Evaluation one = evaluate_part(materials, &part, kind, s, wi, cosine, f);
        more = and_not(more, is_delta(kind, f));
        sum->f_r = light_add(sum->f_r, light_only(more, one.f_r));
        sum->pdf_w = sum->pdf_w + only(more, one.pdf_w);
    }
    sum->factor = light_scale(sum->f_r, only(sum->pdf_w > real(0), real_abs(cosine) / sum->pdf_w));
}

/* The surface's material and light from wi, whose cosine to s->n this is. For surfaces that are no delta. */
INLINE Evaluation evaluate_material(const Materials *materials, const Surface *s, Vec wi, Real cosine, Features f)
{
    Part first = {s->row, s->reflectance, s->share};
    Evaluation all = evaluate_part(materials, &first, s->kind, s, wi, cosine, f);
    if (f.has & HAS_PARTS)
        evaluate_other_parts(materials, s, wi, cosine, &all, f);
    return all;
}

/* L16 A mixed material: one of its parts, each with its share, "diffuse = 1 - (refl + refr)". Parts that are no
   delta come first, so that light sampling finds them. */
INLINE Index choose_part(const Materials *materials, const Surface *s, Real u, Features f)
{
    Index row = s->row;
    Real p_stay = s->share, left = real(1) - p_stay;
    for (int layer = 1; layer < materials->layers; layer++) {
        Mask on = u >= p_stay;
        if (!any(on))
            break;
        u = select(on, (u - p_stay) / (real(1) - p_stay), u);
        row = index_select(on, gather_index(materials->next, row), row);
        Real share = f.has & HAS_WEIGHTS ? part_of_row(materials, s, row, f).share : real(0);
        p_stay = select(on, stays(materials, row, share, &left, f), real(2));
    }
    return row;
}

INLINE Scatter scatter_select(Mask m, Scatter a, Scatter b, Features f)
{
    Real compression = f.has & TRANSMITTING ? select(m, a.compression, b.compression) : b.compression;
    return (Scatter){vec_select(m, a.wi, b.wi), light_select(m, a.factor, b.factor),
        select(m, a.pdf_w, b.pdf_w), index_select(m, a.delta, b.delta), compression};
}

/* One direction by the material; which[0] chooses the part of a mixed one, and which[1] what u cannot: u[2] of
   materials that are finite and transmit. */
STAGE Scatter sample_material(
    const Materials *materials, const Surface *s, const Real which[2], const Real direction[2], Features f)
{
    const Real u[3] = {direction[0], direction[1], which[1]};
    Part part = {s->row, s->reflectance, s->share};
    Index kind = s->kind;
    if (f.has & HAS_BLEND) {
        part = part_of_row(materials, s, choose_part(materials, s, which[0], f), f);
        kind = kind_of_row(materials, part.row, f);
    }
    if (one_material(f)) {
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        return name##_sample(materials, &part, s, u, f);
        MATERIALS(X)
#undef X
    }
    Scatter out = {s->n, light_all(real(0)), real(0), s->delta, real(1)};
    BumpedSurface bumped;
    const Surface *seen = s;
    if (f.has & HAS_BUMP) {
        bumped = bumped_surface(materials, part.row, s, f);
        seen = &bumped.at;
    }
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        Mask is = kind == index_of(MATERIAL_##NAME);                                                         \
        if (any(is))                                                                                         \
            out = scatter_select(is, name##_sample(materials, &part, seen, u, f), out, f);                      \
    }
    MATERIALS(X)
#undef X
    if (f.has & HAS_BUMP) {
        Real shadow = bump_shadow(&bumped, vec_dot(s->n, out.wi), vec_dot(seen->n, out.wi));
        out.factor = light_only(shadow > real(0), light_scale(out.factor, shadow));
        out.pdf_w = only(shadow > real(0), out.pdf_w);
    }
    if (f.has & HAS_BLEND)
        out.pdf_w = out.pdf_w * part.share;
    if (f.has & HAS_WEIGHTS) /* by rounding, u may have come to a part that has none */
        out.factor = light_only(part.share > real(0), out.factor);
    if (f.has & HAS_PARTS) {
        Real cosine = vec_dot(s->n, out.wi);
        Evaluation all = evaluate_material(materials, s, out.wi, cosine, f);
        Mask kept = cosine > real(0);
        if (f.has & FINITE_TRANSMITTING) { /* what the part that was taken sends elsewhere is lost, whatever others do */
            kept &= out.pdf_w > real(0);
#define X(NAME, name, words)                                                                                 \
    if ((f.has & HAS_##NAME) && name##_transmits)                                                            \
        kept |= (kind == index_of(MATERIAL_##NAME)) & (out.pdf_w > real(0));
            FINITE_MATERIALS(X)
#undef X
            out.compression = select(out.delta, out.compression, real(1)); /* the factor has it */
        }
        all.factor = light_only(kept, all.factor);
        out.factor = light_select(out.delta, out.factor, all.factor);
        out.pdf_w = select(out.delta, out.pdf_w, all.pdf_w);
    }
    return out;
}

/* ---- What goes straight through a surface, as if it were not there: HAS_PASSING. */

/* Of a row's light, what share of all. */
INLINE Light straight_part(const Materials *materials, Index row, const Surface *s, Features f)
{
    Index kind = kind_of_row(materials, row, f);
    Light through = light_all(real(0));
    if (f.has & HAS_NULL)
        through = light_only(kind == index_of(MATERIAL_NULL), light_all(real(1)));
    if (f.has & HAS_THINDIELECTRIC) {
        size_t tint = ROW_AT(ThinDielectric, glass.transmittance);
        Light pane =
            light_scale(reflectance_at(materials, row, tint, s, f), thindielectric_share(materials, row, s));
        through = light_select(kind == index_of(MATERIAL_THINDIELECTRIC), pane, through);
    }
    Real share = f.has & HAS_BLEND ? gather(materials->share, row) : real(1);
    return light_scale(through, f.has & HAS_WEIGHTS ? share * textured_share(materials, row, s, f) : share);
}

INLINE Light straight_through(const Materials *materials, const Surface *s, Features f)
{
    Index row = s->row;
    Light sum = straight_part(materials, row, s, f);
    if (!(f.has & HAS_BLEND))
        return sum;
    for (int layer = 1; layer < materials->layers; layer++) {
        Mask more = gather(materials->p_stay, row) < real(1);
        if (!any(more))
            break;
        row = index_select(more, gather_index(materials->next, row), row);
        sum = light_add(sum, light_only(more, straight_part(materials, row, s, f)));
    }
    return sum;
}

/* Is that what sample_material chose by these numbers, and the direction wi? */
INLINE Mask is_passed(const Materials *materials, const Surface *s, const Real which[2], Vec wi, Features f)
{
    Index kind =
        f.has & HAS_BLEND ? kind_of_row(materials, choose_part(materials, s, which[0], f), f) : s->kind;
    Mask passed = mask_none();
    if (f.has & HAS_NULL)
        passed |= kind == index_of(MATERIAL_NULL);
    if (f.has & HAS_THINDIELECTRIC)
        passed |= (kind == index_of(MATERIAL_THINDIELECTRIC)) & (vec_dot(s->n, wi) < real(0));
    return passed;
}
