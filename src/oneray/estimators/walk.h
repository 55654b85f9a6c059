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

/* What the ray meets; `hiding` are lanes that pass what shines. */
INLINE Hit next_hit(Path *path, const Scene *scene, Mask hiding, Features f)
{
    path->rays += path->alive;
    return shapes_hit(&scene->shapes, &path->ray, path->alive, hiding, f);
}

INLINE void note_vertex(const Path *path, Hit hit, const Surface *s, Features f)
{
    if ((f.use & USE_VERTICES) && path->vertices)
        keep_vertex(path->vertices, s, path->throughput, path->pdf_w, path->delta, path->depth,
            path->alive & (hit.slot >= index_of(0)));
}

/* L19 Which paths may go on from what they have met: max_depth counts as Mitsuba's, 1 is emission only, 2 direct
   light. A ray that leaves the scene returns no energy. */
INLINE Mask goes_on(const Path *path, const Scene *scene, Hit hit)
{
    return path->alive & (hit.slot >= index_of(0)) & (path->depth + 1 < index_of(scene->max_depth));
}

/* L7 The random walk, by one vertex: L = what the point emits + what it reflects, and the ray recurses. */
STAGE void path_step(Path *path, const Scene *scene, Features f)
{
    Mask front, hiding = f.has & HAS_HIDDEN ? path->depth == index_of(0) : mask_none();
    Hit hit = next_hit(path, scene, hiding, f);
    Surface surface = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    note_vertex(path, hit, &surface, f);
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
