/* L13 Multiple importance sampling, and with it L10 to L12: how much of the light that a ray has hit counts. */
#pragma once

#include "estimators/roulette.h"

/* L13 Multiple importance sampling: the weight of a direction that was sampled by way of the light, given the
   ratio of the two densities, w_light = p_light^β / (p_light^β + p_bounce^β), β = 1 balance, β = 2 power. The
   same direction sampled by the bounce gets 1 - w_light: the two always sum to 1. Veach, Robust Monte Carlo
   Methods, 1997, 9.2. */
INLINE Real mis_weight_light(Real bounce_over_light, Features f)
{
    Real x = f.use & USE_BALANCE ? bounce_over_light : bounce_over_light * bounce_over_light;
    return real(1) / (real(1) + x);
}

/* How much of the light that the ray has hit counts. L7 walk: all of it. L10 next event estimation has
   sampled it already at the last vertex: nothing, so that direct and indirect light do not overlap. L11, L12
   after a specular vertex, which could not sample it: all of it. L13 MIS: its share of the two ways to get
   here. */
INLINE Real weight_of_hit(const Path *path, Real inverse_pdf_w, Features f)
{
    if (!(f.use & USE_NEE))
        return real(1);
    if (!(f.use & USE_MIS))
        return select(path->delta, real(1), real(0));
    return select(path->delta, real(1), real(1) - mis_weight_light(path->pdf_w * inverse_pdf_w, f));
}

/* The last vertex, as next event estimation saw it. */
INLINE Receiver last_receiver(const Path *path)
{
    return (Receiver){path->ray.o, path->n, path->ray.from, path->both_sides};
}

/* 1/(p_i pdf_w) of the rays that hit light i, those of the lanes `hit`, had it been sampled by way of the light. */
INLINE Real inverse_pdf_w_light(
    const Path *path, const Scene *scene, Mask hit, Index i, Real distance, Real cosine, Features f)
{
    if (!(f.use & USE_MIS))
        return real(0);
    Receiver at = last_receiver(path);
    return inverse_pdf_w_hit(&scene->emitters, i, &at, distance, cosine, f)
           * inverse_choice_of(&scene->emitters, &at, and_not(hit, path->delta), i, f);
}

/* T4 The same for one of M candidates, which are M times as dense. */
INLINE Real of_candidates(const Scene *scene, Real inverse_pdf_w, Features f)
{
    return f.use & USE_RESAMPLED ? inverse_pdf_w / real(scene->candidates) : inverse_pdf_w;
}

/* L13 The density of the walk's going on in a direction that the material evaluates so. That it survives may count
   as part of it, as in the lecture (`brdfPdf = EvaluateDiffuse(L,N) * Psurvive`), or not: the weights sum to 1 either
   way, as long as both sides use the same. */
INLINE Real pdf_w_bounce(const Path *path, const Scene *scene, const Evaluation *surface, Features f)
{
    if (!(f.use & USE_SURVIVAL_PDF))
        return surface->pdf_w;
    return surface->pdf_w * survival(scene, light_mul(path->throughput, surface->factor), path->depth + 1, f);
}
