/* One ray to a light, or from it, whatever its kind. */
#pragma once

#include "kinds/emitters.h"

INLINE LightSample sample_select(Mask m, LightSample a, LightSample b)
{
    return (LightSample){vec_select(m, a.wi, b.wi), select(m, a.distance, b.distance),
        light_select(m, a.weight, b.weight), select(m, a.inverse_pdf_w, b.inverse_pdf_w),
        index_select(m, a.slot, b.slot), b.emitter};
}

/* One ray to light i: (u, v) is the point on it. */
STAGE LightSample sample_light_point(
    const Emitters *emitters, Index i, Real inverse_choice, const Receiver *at, Real u, Real v, Features f)
{
    int one_kind = IS_ONE(f.has & HAS_ANY(EMITTERS));
    LightSample s = {vec_all(real(0)), real(NUM_MAX), light_all(real(0)), real(0), index_of(-1), i};
    Index kind = one_kind ? index_of(0) : index_of_light(emitters->kind, i, f);
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        LightSample one = name##_towards(emitters, i, at, u, v, f);                                          \
        s = one_kind ? one : sample_select(kind == index_of(EMITTER_##NAME), one, s);                        \
    }
    EMITTERS(X)
#undef X
    s.inverse_pdf_w = s.inverse_pdf_w * inverse_choice;
    s.weight = light_scale(light_mul(s.weight, emission_of(emitters, i, f)), inverse_choice);
    return s;
}

INLINE FirstRay first_ray_select(Mask m, FirstRay a, FirstRay b)
{
    return (FirstRay){vec_select(m, a.o, b.o), vec_select(m, a.d, b.d), index_select(m, a.from, b.from),
        light_select(m, a.flux, b.flux)};
}

/* L17 One ray from light i: `place` is where on it, `way` the direction. */
INLINE FirstRay sample_first_ray(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    int one_kind = IS_ONE(f.has & HAS_ANY(EMITTERS));
    FirstRay ray = {vec_all(real(0)), vec_all(real(1)), index_of(-1), light_all(real(0))};
    Index kind = one_kind ? index_of(0) : index_of_light(emitters->kind, i, f);
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        FirstRay one = name##_emit(emitters, i, place, way, f);                                              \
        ray = one_kind ? one : first_ray_select(kind == index_of(EMITTER_##NAME), one, ray);                 \
    }
    EMITTERS(X)
#undef X
    return ray;
}

/* T1 The densities of a ray from light i, chosen already, from its point o along d. */
INLINE EmitPdf pdf_of_first_ray(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    int one_kind = IS_ONE(f.has & HAS_ANY(EMITTERS));
    EmitPdf pdf = {real(1), real(1), real(1), mask_none(), mask_none()};
    Index kind = one_kind ? index_of(0) : index_of_light(emitters->kind, i, f);
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        Mask is = one_kind ? mask_all() : kind == index_of(EMITTER_##NAME);                                  \
        EmitPdf one = name##_emit_pdf(emitters, i, o, d, f);                                                 \
        pdf = (EmitPdf){select(is, one.p_0, pdf.p_0), select(is, one.p_1, pdf.p_1), select(is, one.cosine, pdf.cosine), \
            index_select(is, one.far, pdf.far), index_select(is, one.met, pdf.met)};                         \
    }
    EMITTERS(X)
#undef X
    return pdf;
}
