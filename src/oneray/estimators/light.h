/* L17 Light tracing: the random walk from the light to the camera. Each path carries flux (W) from a light
   point; each of its vertices is joined to the eye, which is a specular vertex too: nothing that the path does
   by itself would ever hit it. For the same reason a mirror or glass in the picture cannot be served. */
#pragma once

#include "estimators/splats.h"
#include "message.h"
#include "estimators/walk.h"

/* The first ray of a light path, and the flux that it carries. */
STAGE void start_at_light(Start *start, const Scene *scene, Features f)
{
    const Emitters *emitters = &scene->emitters;
    Uniforms random = random_block(&start->rng, index_of(0), DIMENSION_EMITTER, f);
    Uniforms choice = random_block(&start->rng, index_of(0), DIMENSION_CAMERA, f);
    Real inverse_choice;
    Index i = choose_light(emitters, NULL, choice.u[0], choice.u[1], &inverse_choice, f);
    FirstRay first = sample_first_ray(emitters, i, random.u, random.u + 2, f);
    start->roulette = choice.u[2];
    start->ray = (Ray){first.o, first.d, real(NUM_MAX), first.from};
    start->flux = light_scale(light_mul(first.flux, emission_of(emitters, i, f)), inverse_choice);
}

/* A splat for each lane; items says which of the job's paths a lane works on. */
INLINE void give_splats(
    Splats *splats, const size_t items[], const Scene *scene, Real x, Real y, Light radiance, Mask arrives, Features f)
{
    Index pixel = index_of(0);
    if (!(f.has & HAS_FILTER))
        pixel = real_floor(y) * scene->width + real_floor(x);
    if (splats->room < splats->count + LANES) {
        splats->room = 2 * splats->room + 1024;
        splats->list = reallocate(splats->list, splats->room, sizeof *splats->list);
    }
    for (unsigned left = mask_bits(arrives); left; left &= left - 1) {
        int lane = lowest_lane(left);
        Splat *splat = &splats->list[splats->count++];
        splat->path = items[lane];
        splat->pixel = (size_t)LANE(pixel, lane);
        if (f.has & HAS_FILTER)
            splat->at[0] = LANE(x, lane), splat->at[1] = LANE(y, lane);
        light_lane(&radiance, lane, splat->radiance);
    }
}

/* Interpolated normals turn the cosines that radiance is weighed by; a light path, which carries flux, spreads
   and arrives by those of the surface itself. |cosθ_face / cosθ| sets right a direction that leaves, its
   inverse one that arrives. Veach, Robust Monte Carlo Methods, 1997, 5.3. */
INLINE Real face_over_shading(const Surface *s, Vec w)
{
    Real cosine = real_abs(vec_dot(s->n, w));
    return select(cosine > real(0), real_abs(vec_dot(s->face, w)) / cosine, real(0));
}

INLINE Real arriving_flux(const Surface *s)
{
    return select(s->cos_face > real(0), s->cos_o / s->cos_face, real(0));
}

/* For the adjoint: materials do not compress flux. */
INLINE Features as_flux(Features f)
{
    f.use |= USE_LIGHT_PATHS;
    return f;
}

/* The vertex joined to the eye, of a lens to a point of it: Φ f_r cosθ V / (d² cos³θ_eye A_film). */
INLINE void join_eye(Path *path, const Scene *scene, const Surface *s, Mask active, const Real lens[2],
    const size_t items[], Splats *splats, Features f)
{
    Eye eye = eye_from(&scene->camera, s->p, lens, f);
    Real cosine = vec_dot(s->n, eye.wi);
    active &= eye.seen & can_receive(s, cosine, f);
    if (!(f.has & (HAS_PARTS | FINITE_TRANSMITTING | HAS_ANY(COATS))))
        active &= light_max(s->reflectance) > real(0);
    if (!any(active))
        return;
    Evaluation surface = evaluate_material(&scene->materials, s, eye.wi, cosine, f);
    Light flux = light_mul(path->flux, light_mul(path->throughput, surface.f_r));
    Ray shadow = {s->p, eye.wi, eye.to_near, s->slot};
    Mask arrives = comes_through(path, scene, &shadow, active, index_of(-1), &flux, f);
    if (f.has & HAS_SMOOTH)
        flux = light_scale(flux, face_over_shading(s, eye.wi));
    give_splats(splats, items, scene, only(arrives, eye.x), only(arrives, eye.y),
        light_scale(flux, received(cosine, f) * eye.weight), arrives, f);
}

/* The next vertex of a light path; false: no lane has one. Its n-th is the eye's path of n + 1 rays: max_depth counts
   those. */
INLINE bool light_path_arrives(Path *path, const Scene *scene, Surface *surface, Features f)
{
    Mask front;
    Hit hit = next_hit(path, scene, mask_none(), f);
    if (!any(path->alive))
        return false;
    *surface = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    path->alive = goes_on(path, scene, hit);
    if (f.has & HAS_SMOOTH)
        path->flux = light_scale(path->flux, arriving_flux(surface));
    return any(path->alive);
}

INLINE void light_path_goes_on(
    Path *path, const Scene *scene, const Surface *s, const Real direction[2], Features f)
{
    Uniforms choice = choices(path, f);
    bounce(path, scene, s, choice.u + 2, direction, f);
    if (f.has & HAS_SMOOTH)
        path->flux = light_scale(path->flux, face_over_shading(s, path->ray.d));
}

/* One vertex of a light path. */
STAGE void light_path_step(Path *path, const Scene *scene, const size_t items[], Splats *splats, Features f)
{
    Surface surface;
    if (!light_path_arrives(path, scene, &surface, f))
        return;
    Uniforms random = random_block(&path->rng, path->depth, DIMENSION_VERTEX, f);
    join_eye(path, scene, &surface, and_not(path->alive, surface.delta), random.u, items, splats, f);
    light_path_goes_on(path, scene, &surface, random.u + 2, f);
}
