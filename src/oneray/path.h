/* The random walk and what the lecture adds to it, one path a lane. path_step takes every lane
   along by one ray. */
#ifndef ONERAY_PATH_H
#define ONERAY_PATH_H

#include "scene.h"

typedef struct {
    Ray ray;
    Vec throughput; /* product of f_r cosθ / pdf along the path */
    Vec radiance;   /* L, W·sr⁻¹·m⁻²: what the path has gathered */
    Real pdf_w;     /* of the ray's direction, where it was not a specular vertex that sent it */
    Mask specular;  /* the ray left the eye or a mirror */
    Mask alive;
    Index depth; /* vertices before the one that the ray goes to */
    Rng rng;
    Index rays, shadow_rays; /* how many, by lane, counted downwards where a mask is -1 */
} Path;

/* A sample on its way to a path: its random numbers and its camera ray. */
typedef struct {
    Rng rng;
    Ray ray;
} Start;

INLINE void start_at(Start *start, const Scene *scene, Real pixel_x, Real pixel_y)
{
    Uniforms film = rng_block(&start->rng, index_of(0), DIMENSION_CAMERA);
    start->ray = camera_ray(&scene->camera, pixel_x + film.u[0], pixel_y + film.u[1]);
}

/* L12 The eye is a specular vertex: it sends no ray to the lights, so its ray must return the light that it
   meets. */
INLINE void path_start(Path *path, Mask fresh)
{
    path->throughput = vec_select(fresh, vec_all(real(1)), path->throughput);
    path->radiance = vec_only(mask_not(fresh), path->radiance);
    path->specular |= fresh;
    path->alive |= fresh;
    path->depth = index_select(fresh, index_of(0), path->depth);
}

/* How much of the light that the ray has hit counts. L7 walk: all of it. L10 next event estimation has
   sampled it already at the last vertex: nothing, so that direct and indirect light do not overlap. L11, L12
   after a specular vertex, which could not sample it: all of it. L13 MIS: its share of the two ways to get
   here. */
INLINE Real weight_of_hit(const Path *path, Real inverse_pdf_w, Features f)
{
    if (!(f & USE_NEE))
        return real(1);
    if (!(f & USE_MIS))
        return select(path->specular, real(1), real(0));
    return select(path->specular, real(1), real(1) - mis_weight_light(path->pdf_w * inverse_pdf_w, f));
}

/* Light that the ray meets: on a surface, or where it leaves the scene. */
INLINE Vec light_met(const Path *path, const Scene *scene, Hit hit, const Surface *s, Mask front, Features f)
{
    Vec light = vec_all(real(0));
    Mask missed = hit.slot < 0;
    if (f & HAS_AREA) {
        Vec emission = vec_gather((const Num(*)[3])scene->lights.slot_emission, s->slot);
        Real choice = f & USE_MIS ? gather(scene->lights.slot_area_choice, s->slot) : real(0);
        Real weight = weight_of_hit(path, inverse_pdf_w_area(choice, hit.t * hit.t, s->cos_o), f);
        light = vec_only(front, vec_scale(emission, weight));
    }
    if (f & HAS_CONSTANT) {
        Real weight = weight_of_hit(path, inverse_pdf_w_environment(&scene->lights), f);
        light = vec_select(missed, vec_scale(vec_of(scene->lights.environment), weight), light);
    }
    if (f & HAS_HIDDEN) /* the environment; a camera ray meets no other light */
        light = vec_only(path->depth > index_of(0), light);
    return light;
}

/* L10 Next event estimation: one ray to one light, L_o ≈ (1/p_i) f_r L V A cosθi cosθo / d². L13: weighed
   where the random walk could have hit that light as well. */
INLINE void next_event(Path *path, const Scene *scene, const Surface *s, Mask active, Features f)
{
    Uniforms random = rng_block(&path->rng, path->depth, DIMENSION_LIGHT);
    LightSample sample = sample_light(&scene->lights, s->p, random.u, f);
    Real cosine = vec_dot(s->n, sample.wi);
    Vec light = vec_scale(vec_mul(eval_diffuse(s), sample.weight), cosine);
    if (f & USE_MIS)
        light = vec_scale(light, mis_weight_light(pdf_w_diffuse(cosine, f) * sample.inverse_pdf_w, f));
    active &= (cosine > real(0)) & (vec_max(sample.weight) > real(0));
    if (!any(active))
        return;
    path->shadow_rays += active;
    Ray shadow = {s->p, sample.wi, sample.distance, s->slot};
    Mask arrives = and_not(active, shapes_occluded(&scene->shapes, &shadow, sample.slot, f));
    path->radiance = vec_add(path->radiance, vec_only(arrives, vec_mul(path->throughput, light)));
}

/* L14 Russian roulette. The path goes on with probability q and is divided by it: E[1(u<q) X/q] = E[X].
   q has no upper cap below 1: a cap makes the second moment grow as (albedo²/cap)^k. */
INLINE void survive(Path *path, Real u, Mask active)
{
    Real q = real_min(real(1), vec_max(path->throughput));
    path->alive = and_not(path->alive, active & (u >= q));
    path->throughput = vec_select(active, vec_scale(path->throughput, real(1) / q), path->throughput);
}

/* The random walk goes on: one ray over the hemisphere (L8, L9), or the mirror's one direction (L11). */
INLINE void bounce(Path *path, const Scene *scene, const Surface *s, Features f)
{
    Uniforms random = rng_block(&path->rng, path->depth, DIMENSION_BOUNCE);
    Vec wi = s->n, factor = s->albedo;
    if (f & HAS_DIFFUSE)
        factor = sample_diffuse(s, random.u[0], random.u[1], &wi, &path->pdf_w, f);
    if (f & HAS_CONDUCTOR) {
        Vec mirrored, mirror = sample_conductor(&scene->materials, s, &mirrored, f);
        wi = vec_select(s->specular, mirrored, wi);
        factor = vec_select(s->specular, mirror, factor);
    }
    path->throughput = vec_mul(path->throughput, factor);
    path->specular = s->specular;
    path->ray = (Ray){s->p, wi, real(NUM_MAX), s->slot};
    path->depth += 1;
    path->alive &= vec_max(path->throughput) > real(0);
    if (f & USE_ROULETTE)
        survive(path, random.u[2], path->depth >= index_of(scene->rr_depth));
}

/* L7 The random walk, by one vertex: L = what the point emits + what it reflects, and the ray recurses. A ray
   that leaves the scene returns no energy. L19: max_depth counts as Mitsuba's, 1 is emission only, 2 direct
   light. */
INLINE void path_step(Path *path, const Scene *scene, Features f)
{
    path->rays += path->alive;
    Mask hiding = f & HAS_HIDDEN ? path->depth == index_of(0) : mask_none();
    Hit hit = shapes_hit(&scene->shapes, &path->ray, hiding, f);
    Mask front;
    Surface surface = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    if (f & (HAS_AREA | HAS_CONSTANT)) {
        Vec light = vec_mul(path->throughput, light_met(path, scene, hit, &surface, front, f));
        Mask counts = path->alive;
        if (!(f & HAS_CONSTANT))
            counts &= hit.slot >= 0;
        path->radiance = vec_add(path->radiance, vec_only(counts, light));
    }
    path->alive &= (hit.slot >= index_of(0)) & (path->depth + 1 < index_of(scene->max_depth))
                   & (vec_max(surface.albedo) > real(0));
    if (!any(path->alive))
        return;
    if (f & USE_NEE)
        next_event(path, scene, &surface, and_not(path->alive, surface.specular), f);
    bounce(path, scene, &surface, f);
}

#endif
