/* L10 Next event estimation. */
#pragma once

#include "estimators/passage.h"
#include "estimators/resampled.h"

/* L3 V: does light come through from the ray's end, at most tmax away, and of `light`, how much? */
INLINE Mask comes_through(
    Path *path, const Scene *scene, const Ray *ray, Mask active, Index target, Light *light, Features f)
{
    if (f.has & HAS_PASSING)
        return comes_through_boundaries(path, scene, *ray, active, target, light, f);
    path->shadow_rays += active;
    Mask arrives = and_not(active, shapes_occluded(&scene->shapes, ray, active, target, f));
    return arrives;
}

/* L10 Next event estimation: one ray to one light, L_o ≈ (1/p_i) f_r L V A cosθi cosθo / d². L13: weighed
   where the random walk could have hit that light as well. */
STAGE void next_event(Path *path, const Scene *scene, const Surface *s, Mask active, const Real choice[2],
    const Real point[2], Features f)
{
    Receiver at = {s->p, s->n, s->slot, s->both_sides};
    LightSample sample = sample_light(&scene->emitters, &at, choice, point, f);
    if ((f.use & USE_RESAMPLED) && any(active))
        sample = resampled_light(path, scene, s, &at, sample, choice, point, f);
    Real cosine = vec_dot(s->n, sample.wi);
    Evaluation surface = evaluate_material(&scene->materials, s, sample.wi, cosine, f);
    Light light = light_scale(light_mul(surface.f_r, sample.weight), received(cosine, f));
    if (f.use & USE_MIS) {
        Real pdf_w = pdf_w_bounce(path, scene, &surface, f);
        light = light_scale(light, mis_weight_light(pdf_w * sample.inverse_pdf_w, f));
    }
    active &= can_receive(s, cosine, f) & (light_max(sample.weight) > real(0));
    if (!any(active))
        return;
    Ray shadow = {s->p, sample.wi, sample.distance, s->slot};
    Mask arrives = comes_through(path, scene, &shadow, active, sample.slot, &light, f);
    path->radiance = light_add(path->radiance, light_only(arrives, light_mul(path_weight(path, f), light)));
    if ((f.use & USE_LEARNED) && scene->lesson)
        learn_visibility(scene->lesson, &scene->emitters.tree, s->p, sample.emitter, active, arrives);
}
