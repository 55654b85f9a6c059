/* L7, L12 Light that a path meets by itself. */
#pragma once

#include "estimators/mis.h"

/* An area light that the ray meets. */
typedef struct {
    Mask shines;
    Light emission;
    Index i;
} LightMet;

INLINE LightMet light_met(const Path *path, const Scene *scene, Hit hit, const Surface *s, Mask front, Features f)
{
    const Emitters *emitters = &scene->emitters;
    Light emission = light_of(emitters->emission[0]);
    Mask shines = hit.slot == index_of(emitters->slot[0]);
    if (f.has & HAS_MANY_LIGHTS) {
        emission = light_gather(emitters->slot_emission[0], s->of * 3);
        shines = (hit.slot >= 0) & (light_max(emission) > real(0));
    }
    shines &= front & path->alive;
    Index i = index_of(0);
    if (!any(shines))
        return (LightMet){shines, emission, i};
    if (f.has & HAS_MANY_LIGHTS)
        i = gather_index(emitters->slot_light, s->of);
    if ((f.has & HAS_MANY_LIGHTS) && (f.has & HAS_MESH_LIGHT)) {
        i = i + index_select(s->slot == s->of, index_of(0), s->slot);
        i = index_select(shines, i, index_of(0));
    }
    return (LightMet){shines, emission, i};
}

/* Light that the ray meets on a surface. */
INLINE Light surface_emission_met(
    const Path *path, const Scene *scene, Hit hit, const Surface *s, Mask front, Features f)
{
    const Emitters *emitters = &scene->emitters;
    LightMet met = light_met(path, scene, hit, s, front, f);
    Light emission = met.emission;
    Mask shines = met.shines;
    if (!any(shines))
        return light_all(real(0));
    Index i = met.i;
    Real inverse_pdf_w = inverse_pdf_w_light(path, scene, met.shines, i, hit.t, s->cos_face, f);
    Real weight = weight_of_hit(path, of_candidates(scene, inverse_pdf_w, f), f);
    if (f.has & HAS_STACKS) { /* in the place that the ray starts from it is met only so (is_itself) */
        Receiver at = last_receiver(path);
        weight = select(is_itself(emitters, i, &at, f), real(1), weight);
    }
    return light_only(shines, light_scale(emission, weight));
}

/* Light that the ray meets where it leaves the scene. */
INLINE Light sky_met(const Path *path, const Scene *scene, Hit hit, Features f)
{
    const Emitters *emitters = &scene->emitters;
    Light radiance = light_all(real(0));
    Real pdf_w = real(1), inverse_pdf_w = real(0);
    Mask missed = (hit.slot < 0) & path->alive;
    if (!any(missed))
        return radiance;
#define X(NAME, name, words)                                                                                 \
    if ((f.has & HAS_##NAME) && emitters->kind[emitters->sky] == EMITTER_##NAME) {                           \
        radiance = name##_radiance(emitters, path->ray.d);                                                   \
        pdf_w = name##_pdf_w(emitters, path->ray.d);                                                         \
    }
    SKIES(X)
#undef X
    if (f.use & USE_MIS) {
        Receiver at = last_receiver(path);
        inverse_pdf_w =
            inverse_choice_of(emitters, &at, and_not(missed, path->delta), index_of(emitters->sky), f) / pdf_w;
        inverse_pdf_w = of_candidates(scene, inverse_pdf_w, f);
    }
    return light_only(missed, light_scale(radiance, weight_of_hit(path, inverse_pdf_w, f)));
}

INLINE Light emission_met(const Path *path, const Scene *scene, Hit hit, const Surface *s, Mask front, Features f)
{
    Light light = light_all(real(0));
    if (f.has & HAS_AREA)
        light = surface_emission_met(path, scene, hit, s, front, f);
    if (f.has & HAS_ANY(SKIES))
        light = light_add(light, sky_met(path, scene, hit, f));
    if (f.has & HAS_HIDDEN) /* the environment; a camera ray meets no other light */
        light = light_only(path->depth > index_of(0), light);
    return light;
}
