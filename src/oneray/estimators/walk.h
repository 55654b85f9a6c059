/* L7 The random walk, and what the lecture adds to it: path_step takes every lane along by one ray. */
#pragma once

#include "estimators/emission.h"
#include "estimators/nee.h"

/* The random walk goes on: one ray over the hemisphere (L8, L9), or by the mirror or the glass (L11, L15), if it
   survives (L14). */
STAGE void bounce(
    Path *path, const Scene *scene, const Surface *s, const Real which[2], const Real direction[2], Features f)
{
    Scatter scatter = sample_material(&scene->materials, s, which, direction, f);
    path->throughput = light_mul(path->throughput, scatter.factor);
    path->pdf_w = scatter.pdf_w;
    path->delta = scatter.delta;
    path->n = s->n;
    path->both_sides = s->both_sides;
    if (f.has & TRANSMITTING)
        path->compression = path->compression * scatter.compression;
    path->ray = (Ray){s->p, scatter.wi, real(NUM_MAX), s->slot};
    path->depth += 1;
    path->alive &= light_max(path->throughput) > real(0);
    if (f.use & USE_ROULETTE)
        play_roulette(path, scene, f);
}

/* The lanes whose ray is the last of its path: L19, max_depth counts as Mitsuba's, 1 is emission only, 2 direct light. */
INLINE Mask is_last(const Path *path, const Scene *scene)
{
    return path->depth + 1 >= index_of(scene->max_depth);
}

/* Which rays can meet a light, if all lights are shapes and few. */
enum { FEW_LIGHTS = 4 };
INLINE Mask towards_light(const Scene *scene, const Ray *ray, Features f)
{
    Hit at;
    Mask met = mask_none();
    for (int i = 0; i < scene->emitters.count; i++)
        if (scene->emitters.slot[i] >= 0)
            met |= slot_meets(&scene->shapes, (int)scene->emitters.slot[i], ray, &at, f);
    return met;
}

/* What the ray meets; `hiding` are lanes that pass what shines. From a path's last ray only light is wanted: where it
   meets none the path may end before it is known what it does meet. It counts as a ray all the same. */
INLINE Hit next_hit(Path *path, const Scene *scene, Mask hiding, Features f)
{
    path->rays += path->alive;
    Mask last = is_last(path, scene);
    if (!(f.has & (HAS_STACKS | HAS_MESH_LIGHT | HAS_ANY(SKIES))) && scene->emitters.count <= FEW_LIGHTS
        && !any(and_not(path->alive, last))) {
        path->alive &= towards_light(scene, &path->ray, f);
        if (!any(path->alive))
            return (Hit){path->ray.tmax, index_of(-1)};
    }
    if (!AHEAD(f))
        return shapes_hit_or_light(&scene->shapes, &path->ray, &path->alive, last, hiding, 0, f);
    Mask known = path->depth == index_of(0), rest = and_not(path->alive, known);
    Hit hit = {path->ray.tmax, index_of(-1)};
    if (any(rest))
        hit = shapes_hit_or_light(&scene->shapes, &path->ray, &rest, last, hiding, 0, f);
    path->alive &= rest | known;
    take(&hit, known, path->first_hit);
    return hit;
}

/* Which paths may go on from what they have met. A ray that leaves the scene returns no energy. */
INLINE Mask goes_on(const Path *path, const Scene *scene, Hit hit)
{
    return and_not(path->alive & (hit.slot >= index_of(0)), is_last(path, scene));
}

/* L7 The random walk, by one vertex: L = what the point emits + what it reflects, and the ray recurses. */
STAGE void path_step(Path *path, const Scene *scene, Features f)
{
    Mask front, hiding = f.has & HAS_HIDDEN ? path->depth == index_of(0) : mask_none();
    Hit hit = next_hit(path, scene, hiding, f);
    if (!any(path->alive))
        return;
    Surface surface = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    if (f.has & (HAS_AREA | HAS_ANY(SKIES))) {
        Light light = emission_met(path, scene, hit, &surface, front, f);
        path->radiance = light_add(path->radiance, light_mul(path_weight(path, f), light));
    }
    path->alive = goes_on(path, scene, hit);
    if (f.use & USE_LIGHT_PATHS) { /* the rest is theirs, unless it is in a mirror or a blend with one */
        path->unreachable = path->alive & has_delta(&scene->materials, &surface, f);
        path->alive = mask_none();
    }
    if (!(f.has & BRIGHT_WHERE_BLACK))
        path->alive &= light_max(surface.reflectance) > real(0);
    if (!any(path->alive))
        return;
    Uniforms random = random_block(&path->rng, path->depth, DIMENSION_VERTEX, f), choice = choices(path, f);
    if (f.use & USE_NEE)
        next_event(path, scene, &surface, and_not(path->alive, surface.delta), choice.u, random.u, f);
    bounce(path, scene, &surface, choice.u + 2, random.u + 2, f);
}
