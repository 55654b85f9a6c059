/* L17 Light tracing: the random walk from the light to the camera. Each path carries flux (W) from a light
   point; each of its vertices is joined to the eye, which is a specular vertex too: nothing that the path does
   by itself would ever hit it. For the same reason a mirror or glass in the picture cannot be served. */
#ifndef ONERAY_ESTIMATORS_LIGHT_H
#define ONERAY_ESTIMATORS_LIGHT_H

#include "kernel/kernel.h"
#include "message.h"
#include "estimators/path.h"

/* A ray from an area light: a uniform point, a direction by the cosine; flux L π A. */
INLINE void emit_area(
    const Emitters *emitters, Index i, const Real place[2], const Real way[2], Start *start, Features f)
{
    Vec point = start->ray.o, normal = start->ray.d;
    Mask area = index_of_light(emitters->slot, i, f) >= 0;
    sample_area(emitters, i, place[0], place[1], &point, &normal, f);
    Vec d = vec_from_frame(normal, sample_hemisphere_cosine(way[0], way[1]));
    start->ray.o = vec_select(area, point, start->ray.o);
    start->ray.d = vec_select(area, d, start->ray.d);
    start->ray.from = index_select(area, index_of_light(emitters->slot, i, f), start->ray.from);
    Vec flux = vec_all(REAL_PI * of_light(emitters->area, i, f));
    start->flux = vec_select(area, flux, start->flux);
}

/* A ray from a point light, flux 4π I, or from a spot, uniform in its cone, flux 2π (1 - cos cutoff) I
   falloff. */
INLINE void emit_point(const Emitters *emitters, Index i, const Real way[2], Start *start, Features f)
{
    Mask point = light_is(emitters, SITE_POINT, i, f), spot = light_is(emitters, SITE_SPOT, i, f);
    Vec d = sample_sphere(way[0], way[1]);
    Real flux = real(1) / pdf_w_sphere();
    if (f.has & HAS_SPOT) {
        Real extent = of_light(emitters->radius, i, f);
        Vec axis = vec_of_light(emitters->edge_x, i, f);
        Vec in_cone = vec_from_frame(axis, sample_cone(way[0], way[1], extent));
        Real falloff = falloff_of(emitters, i, vec_neg(in_cone), f);
        d = vec_select(spot, in_cone, d);
        flux = select(spot, falloff / pdf_w_cone(extent), flux);
    }
    start->ray.o = vec_select(point | spot, vec_of_light(emitters->position, i, f), start->ray.o);
    start->ray.d = vec_select(point | spot, d, start->ray.d);
    start->flux = vec_select(point | spot, vec_all(flux), start->flux);
}

/* A ray from far away: through a uniform point of the disk across it that the scene's ball casts, flux E π R²,
   for the environment from a uniform direction, flux 4π L π R². */
INLINE void emit_far(
    const Emitters *emitters, Index i, const Real place[2], const Real way[2], Start *start, Features f)
{
    Mask sun = light_is(emitters, SITE_DIRECTIONAL, i, f), sky = light_is(emitters, SITE_CONSTANT, i, f);
    Real x, y, radius = real(emitters->world_radius);
    Vec d = sample_sphere(way[0], way[1]);
    if (f.has & HAS_DIRECTIONAL)
        d = vec_select(sun, vec_of_light(emitters->edge_x, i, f), d);
    sample_disk(place[0], place[1], &x, &y);
    Vec across = vec_from_frame(d, vec(x * radius, y * radius, -radius));
    Real flux = REAL_PI * radius * radius;
    flux = select(sky, flux / pdf_w_sphere(), flux);
    start->ray.o = vec_select(sun | sky, vec_add(vec_of(emitters->world_center), across), start->ray.o);
    start->ray.d = vec_select(sun | sky, d, start->ray.d);
    start->flux = vec_select(sun | sky, vec_all(flux), start->flux);
}

/* The first ray of a light path, and the flux that it carries. */
STAGE void start_at_light(Start *start, const Scene *scene, Features f)
{
    const Emitters *emitters = &scene->emitters;
    Uniforms random = random_block(&start->rng, index_of(0), DIMENSION_EMITTER, f);
    Uniforms choice = random_block(&start->rng, index_of(0), DIMENSION_CAMERA, f);
    const Real *place = random.u, *way = random.u + 2;
    Real inverse_choice;
    Index i = choose_light(emitters, NULL, choice.u[0], choice.u[1], &inverse_choice, f);
    start->roulette = choice.u[2];
    start->ray = (Ray){vec_all(real(0)), vec_all(real(1)), real(NUM_MAX), index_of(-1)};
    start->flux = vec_all(real(0));
    if (f.has & HAS_AREA)
        emit_area(emitters, i, place, way, start, f);
    if (f.has & (HAS_POINT | HAS_SPOT))
        emit_point(emitters, i, way, start, f);
    if (f.has & (HAS_DIRECTIONAL | HAS_CONSTANT))
        emit_far(emitters, i, place, way, start, f);
    start->flux = vec_scale(vec_mul(start->flux, vec_of_light(emitters->emission, i, f)), inverse_choice);
}

/* A splat for each lane; items says which of the job's paths a lane works on. */
INLINE void add_splats(Splats *splats, const size_t items[], Index pixel, Vec radiance, Mask arrives)
{
    if (splats->room < splats->count + LANES) {
        splats->room = 2 * splats->room + 1024;
        splats->list = reallocate(splats->list, splats->room, sizeof *splats->list);
    }
    for (unsigned left = mask_bits(arrives); left; left &= left - 1) {
        int lane = lowest_lane(left);
        splats->list[splats->count++] = (Splat){items[lane], (size_t)LANE(pixel, lane),
            {(double)LANE(radiance.x, lane), (double)LANE(radiance.y, lane), (double)LANE(radiance.z, lane)}};
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

/* The vertex joined to the eye: Φ f_r cosθ V / (d² cos³θ_eye A_film). */
INLINE void join_eye(
    Path *path, const Scene *scene, const Surface *s, Mask active, const size_t items[], Splats *splats, Features f)
{
    Eye eye = eye_from(&scene->camera, s->p);
    Real cosine = vec_dot(s->n, eye.wi);
    active &= eye.seen & (cosine > real(0)) & (vec_max(s->albedo) > real(0));
    if (!any(active))
        return;
    path->shadow_rays += active;
    Ray shadow = {s->p, eye.wi, eye.to_near, s->slot};
    Mask arrives = and_not(active, shapes_occluded(&scene->shapes, &shadow, active, index_of(-1), f));
    Vec flux = vec_mul(path->flux, vec_mul(path->throughput, eval_diffuse(s)));
    if (f.has & HAS_SMOOTH)
        flux = vec_scale(flux, face_over_shading(s, eye.wi));
    Index x = real_floor(only(arrives, eye.x)), y = real_floor(only(arrives, eye.y));
    add_splats(splats, items, y * scene->width + x, vec_scale(flux, cosine * eye.weight), arrives);
}

/* One vertex of a light path. Its n-th is the eye's path of n + 1 rays: max_depth counts those. */
STAGE void light_step(Path *path, const Scene *scene, const size_t items[], Splats *splats, Features f)
{
    path->rays += path->alive;
    Hit hit = shapes_hit(&scene->shapes, &path->ray, path->alive, mask_none(), f);
    Mask front;
    Surface surface = surface_at(&scene->shapes, &scene->materials, &path->ray, hit, &front, f);
    path->alive &= (hit.slot >= index_of(0)) & (path->depth + 1 < index_of(scene->max_depth));
    if (!any(path->alive))
        return;
    if (f.has & HAS_SMOOTH) {
        Real arriving = select(surface.cos_face > real(0), surface.cos_o / surface.cos_face, real(0));
        path->flux = vec_scale(path->flux, arriving);
    }
    join_eye(path, scene, &surface, and_not(path->alive, surface.specular), items, splats, f);
    Uniforms random = random_block(&path->rng, path->depth, DIMENSION_VERTEX, f), choice = choices(path, f);
    bounce(path, scene, &surface, choice.u[2], random.u + 2, f);
    if (f.has & HAS_SMOOTH)
        path->flux = vec_scale(path->flux, face_over_shading(&surface, path->ray.d));
}

#endif
