/* One ray to a light, or from it, whatever its kind. */
#pragma once

#include "kinds/emitters.h"

/* Which lanes have this kind of light; where a scene has no other, none is looked up. */
#define ONE_KIND_OF_LIGHT(f) IS_ONE((f).has & HAS_ANY(EMITTERS))
#define IS_KIND(NAME) (SITE_##NAME == SITE_AREA ? is_area(emitters, i, f) : is_site(emitters, SITE_##NAME, i, f))

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
    int alone = ONE_KIND_OF_LIGHT(f);
    LightSample s = {vec_all(real(0)), real(NUM_MAX), light_all(real(0)), real(0), index_of(-1), i};
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        LightSample one = name##_towards(emitters, i, at, u, v, f);                                          \
        s = alone ? one : sample_select(IS_KIND(NAME), one, s);                               \
    }
    EMITTERS(X)
#undef X
    s.inverse_pdf_w = s.inverse_pdf_w * inverse_choice;
    s.weight = light_scale(light_mul(s.weight, emission_of(emitters, i, f)), inverse_choice);
    return s;
}

/* L17 One ray from light i: `place` is where on it, `way` the direction. */
INLINE FirstRay sample_first_ray(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    int alone = ONE_KIND_OF_LIGHT(f);
    FirstRay ray = {vec_all(real(0)), vec_all(real(1)), index_of(-1), light_all(real(0))};
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        FirstRay one = name##_emit(emitters, i, place, way, f);                                              \
        Mask is = IS_KIND(NAME);                                                                             \
        ray = alone ? one                                                                                  \
                                   : (FirstRay){vec_select(is, one.o, ray.o), vec_select(is, one.d, ray.d),  \
                                         index_select(is, one.from, ray.from), light_select(is, one.flux, ray.flux)}; \
    }
    EMITTERS(X)
#undef X
    return ray;
}
