/* The random walk and what the lecture adds to it, one path a lane. path_step takes every lane
   along by one ray. */
#ifndef ONERAY_ESTIMATORS_PATH_H
#define ONERAY_ESTIMATORS_PATH_H

#include "prepare/scene.h"

typedef struct {
    Ray ray;
    Vec throughput; /* product of f_r cosθ / pdf along the path */
    Vec radiance;   /* L, W·sr⁻¹·m⁻²: what the path has gathered */
    Vec flux;       /* of a light path: what it carries, W, apart from the throughput */
    Vec n;          /* normal at the last vertex, on the ray's side */
    Real pdf_w;     /* of the ray's direction, where it was not a specular vertex that sent it */
    Real compression; /* product of (η_o/η_i)² at the boundaries crossed; not in the throughput, so that
                         roulette does not act on it */
    Mask specular;  /* the ray left the eye or a mirror */
    Mask alive;
    Index depth; /* vertices before the one that the ray goes to */
    Rng rng;
    Real roulette; /* uniform in (0, 1), whatever the path has survived */
    Index rays, shadow_rays; /* how many, by lane, counted downwards where a mask is -1 */
    Mask unreachable; /* light tracing: the eye saw a surface that no light path can be joined to it at */
} Path;

/* A sample on its way to a path: its random numbers and its first ray. */
typedef struct {
    Rng rng;
    Ray ray;
    Real roulette;
    Vec flux; /* of a light path */
} Start;

STAGE void start_at(Start *start, const Scene *scene, Real pixel_x, Real pixel_y, Features f)
{
    Uniforms film = random_block(&start->rng, index_of(0), DIMENSION_CAMERA, f);
    start->ray = camera_ray(&scene->camera, pixel_x + film.u[0], pixel_y + film.u[1]);
    start->roulette = film.u[2];
}

/* L12 The eye is a specular vertex: it sends no ray to the lights, so its ray must return the light that it
   meets. */
INLINE void path_start(Path *path, Mask fresh)
{
    path->throughput = vec_select(fresh, vec_all(real(1)), path->throughput);
    path->compression = select(fresh, real(1), path->compression);
    path->radiance = vec_only(mask_not(fresh), path->radiance);
    path->specular |= fresh;
    path->alive |= fresh;
    path->depth = index_select(fresh, index_of(0), path->depth);
}

/* The numbers to choose by, where the scene gives something to choose. */
INLINE Uniforms choices(const Path *path, Features f)
{
    Uniforms none = {{real(0)}};
    return f.has & (HAS_MANY_LIGHTS | HAS_BLEND) ? random_block(&path->rng, path->depth, DIMENSION_CHOICE, f) : none;
}

/* What light that meets the path here counts for in its pixel. */
INLINE Vec path_weight(const Path *path, Features f)
{
    return f.has & HAS_DIELECTRIC ? vec_scale(path->throughput, path->compression) : path->throughput;
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
        return select(path->specular, real(1), real(0));
    return select(path->specular, real(1), real(1) - mis_weight_light(path->pdf_w * inverse_pdf_w, f));
}

/* 1/(p_i pdf_w) of the ray that hit light i, had it been sampled by way of the light. */
INLINE Real inverse_pdf_w_light(
    const Path *path, const Scene *scene, Index i, Real distance, Real cosine, Features f)
{
    if (!(f.use & USE_MIS))
        return real(0);
    Receiver at = {path->ray.o, path->n, path->ray.from};
    return inverse_pdf_w_hit(&scene->emitters, i, &at, distance, cosine, f)
           * inverse_choice_of(&scene->emitters, &at, i, f);
}

/* Light that the ray meets on a surface. */
INLINE Vec surface_light_met(
    const Path *path, const Scene *scene, Hit hit, const Surface *s, Mask front, Features f)
{
    const Emitters *emitters = &scene->emitters;
    Vec emission = vec_of(emitters->emission[0]);
    Mask shines = hit.slot == index_of(emitters->slot[0]);
    if (f.has & HAS_MANY_LIGHTS) {
        emission = vec_gather((const Num(*)[3])emitters->slot_emission, s->of);
        shines = (hit.slot >= 0) & (vec_max(emission) > real(0));
    }
    shines &= front & path->alive;
    if (!any(shines))
        return vec_all(real(0));
    Index i = index_of(0);
    if (f.has & HAS_MANY_LIGHTS)
        i = gather_index(emitters->slot_light, s->of);
    if ((f.has & HAS_MANY_LIGHTS) && (f.has & HAS_MESH_LIGHT)) {
        i = i + index_select(s->slot == s->of, index_of(0), s->slot);
        i = index_select(shines, i, index_of(0));
    }
    Real weight = weight_of_hit(path, inverse_pdf_w_light(path, scene, i, hit.t, s->cos_face, f), f);
    return vec_only(shines, vec_scale(emission, weight));
}

/* Light that the ray meets where it leaves the scene. */
INLINE Vec environment_met(const Path *path, const Scene *scene, Hit hit, Features f)
{
    Mask missed = (hit.slot < 0) & path->alive;
    if (!any(missed))
        return vec_all(real(0));
    Real inverse_pdf_w = real(0);
    if (f.use & USE_MIS) {
        Receiver at = {path->ray.o, path->n, path->ray.from};
        Index i = index_of(scene->emitters.environment_light);
        inverse_pdf_w = inverse_choice_of(&scene->emitters, &at, i, f) / pdf_w_sphere();
    }
    Vec light = vec_scale(vec_of(scene->emitters.environment), weight_of_hit(path, inverse_pdf_w, f));
    return vec_only(missed, light);
}

STAGE Vec light_met(const Path *path, const Scene *scene, Hit hit, const Surface *s, Mask front, Features f)
{
    Vec light = vec_all(real(0));
    if (f.has & HAS_AREA)
        light = surface_light_met(path, scene, hit, s, front, f);
    if (f.has & HAS_CONSTANT)
        light = vec_add(light, environment_met(path, scene, hit, f));
    if (f.has & HAS_HIDDEN) /* the environment; a camera ray meets no other light */
        light = vec_only(path->depth > index_of(0), light);
    return light;
}

/* L14 The chance q that a path goes on: min(1, throughput) from rr_depth on, no upper cap below 1, which would
   make the second moment grow as (albedo²/cap)^k. */
INLINE Real survival(const Scene *scene, Vec throughput, Index depth, Features f)
{
    if (!(f.use & USE_ROULETTE))
        return real(1);
    Real q = real_min(real(1), vec_max(throughput));
    return select(depth >= index_of(scene->rr_depth), q, real(1));
}

/* L13 The density of the walk's going on in a direction with this cosine. That it survives may count as part
   of it, as in the lecture (`brdfPdf = EvaluateDiffuse(L,N) * Psurvive`), or not: the weights sum to 1 either
   way, as long as both sides use the same. */
INLINE Real pdf_w_bounce(const Path *path, const Scene *scene, const Surface *s, Real cosine, Features f)
{
    Real pdf_w = pdf_w_diffuse(s, cosine, f);
    if (!(f.use & USE_SURVIVAL_PDF))
        return pdf_w;
    Vec throughput = vec_mul(path->throughput, factor_diffuse(s, cosine, f));
    return pdf_w * survival(scene, throughput, path->depth + 1, f);
}

/* L10 Next event estimation: one ray to one light, L_o ≈ (1/p_i) f_r L V A cosθi cosθo / d². L13: weighed
   where the random walk could have hit that light as well. */
STAGE void next_event(Path *path, const Scene *scene, const Surface *s, Mask active, const Real choice[2],
    const Real point[2], Features f)
{
    Receiver at = {s->p, s->n, s->slot};
    LightSample sample = sample_light(&scene->emitters, &at, choice, point, f);
    Real cosine = vec_dot(s->n, sample.wi);
    Vec light = vec_scale(vec_mul(eval_diffuse(s), sample.weight), cosine);
    if (f.use & USE_MIS) {
        Real pdf_w = pdf_w_bounce(path, scene, s, cosine, f);
        light = vec_scale(light, mis_weight_light(pdf_w * sample.inverse_pdf_w, f));
    }
    active &= (cosine > real(0)) & (vec_max(sample.weight) > real(0));
    if (!any(active))
        return;
    path->shadow_rays += active;
    Ray shadow = {s->p, sample.wi, sample.distance, s->slot};
    Mask arrives = and_not(active, shapes_occluded(&scene->shapes, &shadow, active, sample.slot, f));
    path->radiance = vec_add(path->radiance, vec_only(arrives, vec_mul(path_weight(path, f), light)));
    if ((f.use & USE_LEARNED) && scene->lesson)
        learn_visibility(scene->lesson, &scene->emitters.tree, s->p, sample.emitter, active, arrives);
}

/* The random walk goes on: one ray over the hemisphere (L8, L9), or by the mirror or the glass (L11, L15). L14
   Russian roulette: it goes on with probability q and is divided by it, E[1(u<q) X/q] = E[X]. A u that was below
   q is uniform again once divided by q: one number does for the whole path. */
STAGE void bounce(
    Path *path, const Scene *scene, const Surface *s, Real part, const Real direction[2], Features f)
{
    Scatter scatter = sample_material(&scene->materials, s, part, direction, f);
    path->throughput = vec_mul(path->throughput, scatter.factor);
    path->pdf_w = scatter.pdf_w;
    path->specular = scatter.specular;
    path->n = s->n;
    if (f.has & HAS_DIELECTRIC)
        path->compression = path->compression * scatter.compression;
    path->ray = (Ray){s->p, scatter.wi, real(NUM_MAX), s->slot};
    path->depth += 1;
    path->alive &= vec_max(path->throughput) > real(0);
    if (f.use & USE_ROULETTE) {
        Real q = survival(scene, path->throughput, path->depth, f);
        Real inverse_q = real(1) / q;
        path->alive &= path->roulette < q;
        path->roulette = path->roulette * inverse_q;
        path->throughput = vec_scale(path->throughput, inverse_q);
        if (f.use & USE_SURVIVAL_PDF)
            path->pdf_w = path->pdf_w * q;
    }
}

/* L7 The random walk, by one vertex: L = what the point emits + what it reflects, and the ray recurses. A ray
   that leaves the scene returns no energy. L19: max_depth counts as Mitsuba's, 1 is emission only, 2 direct
   light. */
STAGE void path_step(Path *path, const Scene *scene, Features f)
{
    path->rays += path->alive;
    Mask hiding = f.has & HAS_HIDDEN ? path->depth == index_of(0) : mask_none();
    Hit hit = shapes_hit(&scene->shapes, &path->ray, path->alive, hiding, f);
    Mask front;
    Surface surface = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    if (f.has & (HAS_AREA | HAS_CONSTANT)) {
        Vec light = light_met(path, scene, hit, &surface, front, f);
        path->radiance = vec_add(path->radiance, vec_mul(path_weight(path, f), light));
    }
    path->alive &= (hit.slot >= index_of(0)) & (path->depth + 1 < index_of(scene->max_depth));
    if (f.use & USE_LIGHT_PATHS) { /* the rest is theirs, unless it is in a mirror */
        path->unreachable = path->alive & (surface.specular | (surface.share < real(1)));
        path->alive = mask_none();
    }
    if (!(f.has & (HAS_DIELECTRIC | HAS_BLEND)))
        path->alive &= vec_max(surface.albedo) > real(0);
    if (!any(path->alive))
        return;
    Uniforms random = random_block(&path->rng, path->depth, DIMENSION_VERTEX, f), choice = choices(path, f);
    if (f.use & USE_NEE)
        next_event(path, scene, &surface, and_not(path->alive, surface.specular), choice.u, random.u, f);
    bounce(path, scene, &surface, choice.u[2], random.u + 2, f);
}

#endif
