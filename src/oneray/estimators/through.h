/* M1 Paths where `volpath` is asked for: through participating media, and through boundaries that are no vertices. A path
   comes through null materials, the holes of a mask and panes as if they were not there, but for the medium behind
   them, and so do rays to lights.

   A stretch of a ray is flown through by the extinction σ of one channel, chosen once for the path: its next vertex is
   at t with density σ e^(-σ t), and with the chance e^(-σ t) there is none before the surface at t. By the balance
   heuristic over the three channels that might have been chosen, what is divided by is the mean of their densities,
   so that no weight exceeds 3. */
#pragma once

#include "estimators/walk.h"

/* The path begins: where the eye is, by a channel. */
INLINE void path_enters(Path *path, const Scene *scene, Mask fresh, Features f)
{
    path->events = index_select(fresh, index_of(0), path->events);
    path->vertex = vec_select(fresh, path->ray.o, path->vertex);
    path->vertex_slot = index_select(fresh, path->ray.from, path->vertex_slot);
    path->travelled = only(mask_not(fresh), path->travelled);
    if (!(f.has & HAS_ANY(MEDIA)))
        return;
    path->medium = index_select(fresh, index_of(scene->media.eye), path->medium);
    path->densities = light_select(fresh, light_all(real(1)), path->densities);
    if (scene->media.coloured) {
        Uniforms film = random_block(&path->rng, index_of(0), DIMENSION_CAMERA, f);
        path->channel = index_select(fresh, real_floor(real(3) * film.u[3]), path->channel);
    }
}

INLINE Real of_channel(Light a, Index channel)
{
    return select(channel == index_of(0), a.r, select(channel == index_of(1), a.g, a.b));
}

/* M1 Free flight: up to the surface that the ray meets, or to a vertex before it. Those lanes are returned; *t is how far
   they came. What the path carries is divided by the density of a vertex there, or else by the chance to get to the
   surface, which is part of pdf_w, too. */
STAGE Mask fly(Path *path, const Matter *matter, Real to_surface, Real *t, Features f)
{
    Light sigma = matter->sigma_t;
    Uniforms random = random_block(&path->rng, -path->events, DIMENSION_FLIGHT, f);
    *t = -real_log(random.u[0]) / of_channel(sigma, path->channel); /* infinite where there is no medium */
    Mask scattered = path->alive & (*t < to_surface);
    *t = select(scattered, *t, to_surface);
    Light p = transmittance(matter, *t);
    p = light_select(scattered, light_mul(p, sigma), p);
    Real mean = mean_density(path, p);
    Light factor = light_scale(p, only(mean > real(0), real(1) / mean));
    path->densities = light_mul(path->densities, factor);
    path->throughput = light_mul(path->throughput, factor);
    path->throughput = light_select(scattered, light_mul(path->throughput, matter->albedo), path->throughput);
    path->pdf_w = select(scattered, path->pdf_w, path->pdf_w * mean);
    return scattered;
}

/* L10 Next event estimation as in nee.h; where a medium scatters the phase function takes the place of f_r cosθ. */
STAGE void next_event_through(Path *path, const Scene *scene, const Surface *s, const Matter *matter,
    Mask scattered, Mask active, const Real choice[2], const Real point[2], Features f)
{
    Receiver at = {s->p, s->n, s->slot, s->both_sides};
    LightSample sample = sample_light(&scene->emitters, &at, choice, point, f);
    Real cosine = vec_dot(s->n, sample.wi);
    Evaluation there = evaluate_material(&scene->materials, s, sample.wi, cosine, f);
    Light weight = light_scale(there.f_r, received(cosine, f));
    active &= scattered | can_receive(s, cosine, f);
    active &= light_max(sample.weight) > real(0);
    if (!any(active))
        return;
    if (f.has & HAS_ANY(MEDIA)) {
        Real phase = phase_pdf_w(matter->g, path->ray.d, sample.wi);
        weight = light_select(scattered, light_all(phase), weight);
        there.pdf_w = select(scattered, phase, there.pdf_w);
        there.factor = light_select(scattered, light_all(real(1)), there.factor);
        Index beyond = medium_towards(&scene->media, s, sample.wi, path->medium);
        path->shadow_medium = index_select(scattered, path->medium, beyond);
    }
    Light light = light_mul(weight, sample.weight);
    Ray shadow = {s->p, sample.wi, sample.distance, s->slot};
    Mask arrives = comes_through(path, scene, &shadow, active, sample.slot, &light, f);
    if (f.use & USE_MIS) {
        Real pdf_w = pdf_w_bounce(path, scene, &there, f) * path->reach;
        light = light_scale(light, mis_weight_light(pdf_w * sample.inverse_pdf_w, f));
    }
    path->radiance = light_add(path->radiance, light_only(arrives, light_mul(path_weight(path, f), light)));
}

/* The walk goes on: by the phase function, by the material, or straight through the boundary; the latter is no vertex, so
   that no roulette is played there. */
STAGE void go_on_through(Path *path, const Scene *scene, const Surface *s, const Matter *matter,
    Mask scattered, Real travelled, const Real which[2], const Real direction[2], Features f)
{
    Scatter scatter = sample_material(&scene->materials, s, which, direction, f);
    Mask passes = and_not(is_passed(&scene->materials, s, which, scatter.wi, f), scattered);
    Mask last = and_not(is_last(path, scene), passes), turns = mask_not(passes);
    if (f.has & HAS_ANY(MEDIA)) {
        Vec wi = sample_phase(matter->g, path->ray.d, direction[0], direction[1]);
        Scatter phase = {
            wi, light_all(real(1)), phase_pdf_w(matter->g, path->ray.d, wi), mask_none(), real(1)};
        scatter = scatter_select(scattered, phase, scatter, f);
        Index medium = medium_towards(&scene->media, s, scatter.wi, path->medium);
        path->medium = index_select(scattered, path->medium, medium);
    }
    path->throughput = light_mul(path->throughput, scatter.factor);
    path->pdf_w = select(turns, scatter.pdf_w, path->pdf_w);
    path->delta = index_select(turns, scatter.delta, path->delta);
    path->n = vec_select(turns, s->n, path->n);
    path->both_sides = index_select(turns, s->both_sides, path->both_sides);
    if (f.has & TRANSMITTING)
        path->compression = path->compression * scatter.compression;
    path->vertex = vec_select(turns, s->p, path->vertex);
    path->vertex_slot = index_select(turns, s->slot, path->vertex_slot);
    path->travelled = only(passes, path->travelled + travelled);
    path->ray = (Ray){s->p, scatter.wi, real(NUM_MAX), s->slot};
    path->depth += index_select(turns, index_of(1), index_of(0));
    path->alive = and_not(path->alive & (light_max(path->throughput) > real(0)), last);
    if (f.use & USE_ROULETTE) {
        Path played = *path;
        play_roulette(&played, scene, f);
        path->alive = index_select(turns, played.alive, path->alive);
        path->roulette = select(turns, played.roulette, path->roulette);
        path->throughput = light_select(turns, played.throughput, path->throughput);
        path->pdf_w = select(turns, played.pdf_w, path->pdf_w);
    }
}

/* What the path meets along its ray, with and without surfaces before it that it has come through. */
INLINE Hit hit_through(Path *path, const Scene *scene, Mask hiding, Features f)
{
    Mask known = AHEAD(f) ? path->events == index_of(0) : mask_none(), rest = and_not(path->alive, known);
    Hit hit = {path->ray.tmax, index_of(-1)};
    path->rays += path->alive;
    if (any(rest))
        hit = shapes_hit_or_light(&scene->shapes, &path->ray, &rest, mask_none(), hiding, 0, f);
    if (AHEAD(f))
        take(&hit, known, path->first_hit);
    return hit;
}

/* L7 The walk, by one event: a vertex on a surface or in a medium, or a boundary that is none. */
STAGE void path_step_through(Path *path, const Scene *scene, Features f)
{
    Mask front, scattered = mask_none(),
                hiding = f.has & HAS_HIDDEN ? path->depth == index_of(0) : mask_none();
    Hit hit = hit_through(path, scene, hiding, f);
    Surface s = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    Matter matter = {light_all(real(0)), light_all(real(0)), real(0)};
    Real t = hit.t;
    if (f.has & HAS_ANY(MEDIA)) {
        matter = matter_of(&scene->media, path->medium);
        scattered = fly(path, &matter, hit.t, &t, f);
        s.p = vec_select(scattered, vec_add(path->ray.o, vec_scale(path->ray.d, t)), s.p);
        s.n = vec_select(scattered, vec_all(real(0)), s.n); /* none: it receives from everywhere */
        s.slot = index_select(scattered, index_of(-1), s.slot);
        s.delta = and_not(s.delta, scattered);
        s.both_sides |= scattered;
    }
    if (f.has & (HAS_AREA | HAS_ANY(SKIES))) { /* as its last vertex sees it */
        Path seen = *path;
        seen.alive = and_not(path->alive, scattered);
        seen.ray.o = path->vertex;
        seen.ray.from = path->vertex_slot;
        Hit far = {path->travelled + hit.t, hit.slot};
        Light light = emission_met(&seen, scene, far, &s, front, f);
        path->radiance = light_add(path->radiance, light_mul(path_weight(path, f), light));
    }
    path->alive &= scattered | (hit.slot >= 0);
    if (!any(path->alive))
        return;
    Uniforms random = random_block(&path->rng, path->events, DIMENSION_VERTEX, f);
    Uniforms choice = random_block(&path->rng, path->events, DIMENSION_CHOICE, f);
    Mask receives = and_not(path->alive, s.delta | is_last(path, scene));
    if ((f.use & USE_NEE) && any(receives))
        next_event_through(path, scene, &s, &matter, scattered, receives, choice.u, random.u, f);
    go_on_through(path, scene, &s, &matter, scattered, t, choice.u + 2, random.u + 2, f);
    path->events += 1;
}
