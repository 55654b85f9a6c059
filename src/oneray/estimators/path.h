/* A path, one a lane, and how it starts. */
#pragma once

#include "estimators/surface.h"
#include "prepare/scene.h"

typedef struct {
    Ray ray;
    Light throughput; /* product of f_r cosθ / pdf along the path */
    Light radiance;   /* L, W·sr⁻¹·m⁻²: what the path has gathered */
    Light flux;       /* of a light path: what it carries, W, apart from the throughput */
    Vec n;            /* normal at the last vertex, on the side that the path came to it from */
    Mask both_sides;  /* of the last vertex (Surface) */
    Real pdf_w;       /* of the ray's direction, where no delta chose it */
    Real compression; /* product of (η_o/η_i)² at the boundaries crossed; not in the throughput, so that
                         roulette does not act on it */
    Mask delta;       /* the ray left the eye or a mirror */
    Mask alive;
    Index depth; /* vertices before the one that the ray goes to */
    Rng rng;
    Real roulette; /* uniform in (0, 1), whatever the path has survived */
    Index rays, shadow_rays; /* how many, by lane, counted downwards where a mask is -1 */
    Hit first_hit; /* AHEAD */
    Vec vertex;             /* HAS_PASSING: where the last vertex is, … */
    Index vertex_slot;      /* … the slot that it lies on, … */
    Real travelled;         /* … how far from it the ray starts, … */
    Index events;           /* … and vertices and boundaries before that which the ray goes to */
    Index medium, channel;  /* HAS_ANY(MEDIA): which the ray is in; which flights are by, … */
    Index shadow_medium;    /* in which its ray to a light starts, … */
    Real reach;             /* … and the chance that the walk would have come along that */
    Light densities;        /* … and the path's density had it been by another, over the mean */
    Mask unreachable; /* light tracing: the eye saw a surface that no light path can be joined to it at */
} Path;

/* A sample on its way to a path: its random numbers and its first ray. */
typedef struct {
    Rng rng;
    Ray ray;
    Real roulette;
    Light flux; /* of a light path */
    Hit hit;    /* AHEAD */
} Start;

/* Are camera rays traced before paths take them, all lanes together? */
#define FROM_LIGHTS (USE_LIGHT_PATHS | USE_PHOTONS)
#define AHEAD(f) (PACKETS && ((f).has & HAS_MESH) && !((f).use & FROM_LIGHTS))

/* P6 Where on the film the sample is, from the pixel's corner on: u[0], u[1]. */
STAGE Uniforms film_point(const Rng *rng, const Scene *scene, Real pixel_x, Real pixel_y, Features f)
{
    Uniforms film = random_block(rng, index_of(0), DIMENSION_CAMERA, f);
    if (f.has & HAS_FILTER) {
        film.u[0] = real(.5) + filter_sample(&scene->filter, 0, pixel_x, film.u[0]);
        film.u[1] = real(.5) + filter_sample(&scene->filter, 1, pixel_y, film.u[1]);
    }
    return film;
}

STAGE void start_at(Start *start, const Scene *scene, Real pixel_x, Real pixel_y, Features f)
{
    Uniforms film = film_point(&start->rng, scene, pixel_x, pixel_y, f);
    Uniforms lens = {{real(0)}};
    if (f.has & HAS_LENS)
        lens = random_block(&start->rng, index_of(0), DIMENSION_EMITTER, f);
    start->ray = camera_ray(&scene->camera, pixel_x + film.u[0], pixel_y + film.u[1], lens.u, f);
    start->roulette = film.u[2];
    if (AHEAD(f))
        start->hit = shapes_hit(
            &scene->shapes, &start->ray, mask_all(), f.has & HAS_HIDDEN ? mask_all() : mask_none(), f);
}

/* L12 The eye is a specular vertex: it sends no ray to the lights, so its ray must return the light that it
   meets. */
INLINE void path_start(Path *path, Mask fresh)
{
    path->throughput = light_select(fresh, light_all(real(1)), path->throughput);
    path->compression = select(fresh, real(1), path->compression);
    path->radiance = light_only(mask_not(fresh), path->radiance);
    path->delta |= fresh;
    path->alive |= fresh;
    path->depth = index_select(fresh, index_of(0), path->depth);
}

/* The numbers to choose by, where the scene gives something to choose. */
INLINE Uniforms choices(const Path *path, Features f)
{
    Uniforms none = {{real(0)}};
    return f.has & (HAS_MANY_LIGHTS | HAS_BLEND | FINITE_TRANSMITTING) ? random_block(&path->rng, path->depth, DIMENSION_CHOICE, f) : none;
}

/* What light that meets the path here counts for in its pixel. */
INLINE Light path_weight(const Path *path, Features f)
{
    return f.has & TRANSMITTING ? light_scale(path->throughput, path->compression) : path->throughput;
}
