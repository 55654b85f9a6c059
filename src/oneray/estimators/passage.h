/* M1 Rays to lights where boundaries are no vertices (through.h): what of the light comes through them, and through the
   media between them. */
#pragma once

#include "estimators/path.h"
#include "media/medium.h"

/* The chance, or density, of what the path has met along its ray, relative to the path's own: over the channels that may
   have been chosen. */
INLINE Real mean_density(const Path *path, Light p)
{
    Light all = light_mul(path->densities, p);
    return (all.r + all.g + all.b) * real(1 / 3.0);
}

/* L3 V, through all that light goes straight through: *light becomes what arrives of it, and path->reach the chance that
   the walk would have come as far. */
STAGE Mask comes_through_boundaries(
    Path *path, const Scene *scene, Ray ray, Mask open, Index target, Light *light, Features f)
{
    Mask arrives = mask_none(), front;
    Light transmitted = light_all(real(1));
    Index medium = path->shadow_medium;
    path->shadow_rays += open;
    while (any(open)) {
        Mask blocked = open & shapes_occluded(&scene->shapes, &ray, open, target, f);
        Hit hit = {ray.tmax, index_of(-1)};
        arrives |= and_not(open, blocked);
        if (any(blocked)) {
            Mask traced = blocked;
            Hit nearest = shapes_hit_or_light(&scene->shapes, &ray, &traced, mask_none(), mask_none(), 0, f);
            take(&hit, blocked, nearest);
        }
        if (f.has & HAS_ANY(MEDIA)) {
            Matter matter = matter_of(&scene->media, medium);
            transmitted =
                light_select(open, light_mul(transmitted, transmittance(&matter, hit.t)), transmitted);
        }
        open = blocked & (hit.slot >= 0);
        if (!any(open))
            break;
        Surface s = surface_at(&scene->shapes, &scene->materials, &ray, hit, &front, f);
        *light = light_select(open, light_mul(*light, straight_through(&scene->materials, &s, f)), *light);
        open &= light_max(light_mul(*light, transmitted)) > real(0);
        if (f.has & HAS_ANY(MEDIA))
            medium = index_select(open, medium_towards(&scene->media, &s, ray.d, medium), medium);
        ray.o = vec_select(open, s.p, ray.o);
        ray.from = index_select(open, s.slot, ray.from);
        ray.tmax = ray.tmax - only(open, hit.t);
    }
    *light = light_mul(*light, transmitted);
    path->reach = f.has & HAS_ANY(MEDIA) ? mean_density(path, transmitted) : real(1);
    return arrives;
}
