/* A shape that shines, all its surface alike, on the side of the normal. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct area {
    double radiance[3]; /* W·sr⁻¹·m⁻² */
} Area;

static const Plugin area_plugin = {"area", NULL, {
    {"sampling_weight", AS_FLOAT, LEFT_OUT, "(0,inf)", "1"},
    {"radiance", AS_EMISSION, offsetof(Area, radiance), "[0,inf)", "1"}}};

static inline EmitterTraits area_traits(const Area *e)
{
    return (EmitterTraits){.from = FROM_SHAPE, .emission = e->radiance, .flux = PI};
}

#ifdef LANES

#include "emitters/rectangle_light.h"
#include "emitters/sphere_light.h"

/* 1/pdf_w (sr) of the direction to a point of light i, given that light i was chosen; 1/d² and cosine are those
   of the point on the light. The one place where densities on lights become densities of directions:
   sampling a light and weighing a light that was hit both call it.
   By area, pdf_w = 1/A · d²/cosθ_light; the facing half of a sphere has half the area; a cone 2π(1 -
   cosθmax), one that sets its block above the horizon; a rectangle its solid angle. */
INLINE Real inverse_pdf_w_point(const Emitters *emitters, Index i, Real inverse_dd, Real cosine,
    const SphereView *sphere, const RectangleView *rectangle, Features f)
{
    Real inverse = of_light(emitters->area, i, f) * cosine * inverse_dd;
    if (f.use & USE_FACING)
        inverse = select(sphere->outside, real(0.5) * inverse, inverse);
    if (f.use & USE_CONE) {
        inverse = select(sphere->outside, real(1) / pdf_w_cone(sphere->extent), inverse);
        if (any(sphere->sets))
            inverse = select(sphere->sets, real(2) * sphere->turn * sphere->rise, inverse);
    }
    if (f.use & USE_SOLID_ANGLE)
        inverse = select(rectangle->serves, rectangle->solid_angle, inverse);
    return inverse;
}

/* The same for a light that the ray from `at` has hit. */
STAGE Real inverse_pdf_w_hit(
    const Emitters *emitters, Index i, const Receiver *at, Real distance, Real cosine, Features f)
{
    SphereView sphere = {0};
    RectangleView rectangle = {0};
    if (f.use & (USE_FACING | USE_CONE))
        sphere = view_sphere(emitters, i, at, f);
    if (f.use & USE_SOLID_ANGLE)
        rectangle = view_rectangle(emitters, i, at, f);
    return inverse_pdf_w_point(emitters, i, real(1) / (distance * distance), cosine, &sphere, &rectangle, f);
}

/* A place on a flat light in units of its edges, uniform by area. */
INLINE void sample_flat(const Emitters *emitters, Index i, Real u, Real v, Real *x, Real *y, Features f)
{
    rectangle_sample(u, v, x, y);
    if (f.has & HAS_DISK) {
        Mask disk = shines_from(emitters, SHAPE_DISK, i, f);
        Real disk_x, disk_y;
        disk_sample(u, v, &disk_x, &disk_y);
        *x = select(disk, disk_x, *x);
        *y = select(disk, disk_y, *y);
    }
    if (f.has & HAS_MESH_LIGHT) {
        Mask triangle = shines_from(emitters, SHAPE_MESH, i, f);
        Real second, third;
        sample_triangle(u, v, &second, &third);
        *x = select(triangle, second, *x);
        *y = select(triangle, third, *y);
    }
}

/* L2, L3, L5 A uniform point of a light's shape, and the normal there. */
INLINE void sample_area(const Emitters *emitters, Index i, Real u, Real v, Vec *point, Vec *normal, Features f)
{
    Vec center = vec_of_light(emitters->position, i, f);
    *point = center;
    *normal = vec_all(real(0));
    if (f.has & (HAS_FLAT_LIGHT | HAS_MESH_LIGHT)) {
        Real x, y;
        sample_flat(emitters, i, u, v, &x, &y, f);
        *point = vec_add(center, vec_add(vec_scale(vec_of_light(emitters->edge_x, i, f), x),
                                     vec_scale(vec_of_light(emitters->edge_y, i, f), y)));
        *normal = vec_of_light(emitters->normal, i, f);
    }
    if (f.has & HAS_SPHERE_LIGHT) {
        Mask ball = shines_from(emitters, SHAPE_SPHERE, i, f);
        Vec on, outward;
        sphere_sample(center, of_light(emitters->radius, i, f), u, v, &on, &outward);
        *point = vec_select(ball, on, *point);
        *normal = vec_select(ball, outward, *normal);
    }
    if (f.has & HAS_CYLINDER_LIGHT) {
        Mask wall = shines_from(emitters, SHAPE_CYLINDER, i, f);
        Vec on, outward;
        cylinder_sample(center, vec_of_light(emitters->edge_x, i, f), vec_of_light(emitters->edge_y, i, f),
            vec_of_light(emitters->normal, i, f), of_light(emitters->radius, i, f), u, v, &on, &outward);
        *point = vec_select(wall, on, *point);
        *normal = vec_select(wall, outward, *normal);
    }
}

/* No flat light sees itself, however its cosine is rounded; nor is one sampled from a surface in its place, where it
   would be in all directions at no distance. */
INLINE Mask is_itself(const Emitters *emitters, Index i, const Receiver *at, Features f)
{
    Index slot = index_of_light(emitters->slot, i, f);
    Mask itself = slot == at->slot;
    if (f.has & HAS_STACKS)
        itself = seat_of(emitters->stacks, slot).stack == seat_of(emitters->stacks, at->slot).stack;
    if (f.has & HAS_CYLINDER_LIGHT)
        itself = and_not(itself, shines_from(emitters, SHAPE_CYLINDER, i, f));
    return f.has & HAS_SPHERE_LIGHT ? and_not(itself, shines_from(emitters, SHAPE_SPHERE, i, f)) : itself;
}

/* L2, L3, L5 E = L A cosθ_light cosθ/d²; the receiver's cosine is left to the caller. */
INLINE LightSample area_towards(const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    Vec point, normal;
    SphereView sphere = {0};
    RectangleView rectangle = {0};
    sample_area(emitters, i, u, v, &point, &normal, f);
    if (f.use & (USE_FACING | USE_CONE))
        sphere = view_sphere(emitters, i, at, f);
    if (f.use & USE_FACING)
        sample_facing(emitters, i, &sphere, u, v, &point, &normal, f);
    if (f.use & USE_SOLID_ANGLE) {
        rectangle = view_rectangle(emitters, i, at, f);
        if (any(rectangle.serves))
            point = vec_select(rectangle.serves, point_of_rectangle(emitters, i, &rectangle, u, v, f), point);
    }
    Vec delta = vec_sub(point, at->p);
    Real distance = vec_length(delta), inverse_d = real(1) / distance;
    LightSample s = {vec_scale(delta, inverse_d), distance, light_all(real(0)), real(0),
        index_of_light(emitters->slot, i, f), i};
    Real cosine = -vec_dot(normal, s.wi);
    Real inverse = inverse_pdf_w_point(emitters, i, inverse_d * inverse_d, cosine, &sphere, &rectangle, f);
    Mask shines = cosine > real(0);
    if (f.has & (HAS_FLAT_LIGHT | HAS_MESH_LIGHT))
        shines = and_not(shines, is_itself(emitters, i, at, f));
    if (f.use & USE_CONE) {
        Mask meets = sample_sphere_cone(emitters, i, at, &sphere, u, v, &s, f);
        shines = index_select(sphere.outside, meets & (of_light(emitters->radius, i, f) > real(0)), shines);
    }
    s.inverse_pdf_w = only(shines, inverse);
    s.weight = light_all(s.inverse_pdf_w);
    return s;
}

/* L17 A uniform point, a direction by the cosine; flux L π A. */
INLINE FirstRay area_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    Vec point, normal;
    sample_area(emitters, i, place[0], place[1], &point, &normal, f);
    Vec d = vec_from_frame(normal, sample_hemisphere_cosine(way[0], way[1]));
    return (FirstRay){
        point, d, index_of_light(emitters->slot, i, f), light_all(REAL_PI * of_light(emitters->area, i, f))};
}

/* T1 Of its normal and the direction d from a point o of it; negative on the side that does not shine. */
INLINE Real area_cosine(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    Real cosine = real(0);
    if (f.has & (HAS_FLAT_LIGHT | HAS_MESH_LIGHT))
        cosine = vec_dot(vec_of_light(emitters->normal, i, f), d);
    if (f.has & (HAS_SPHERE_LIGHT | HAS_CYLINDER_LIGHT)) {
        Vec out = vec_sub(o, vec_of_light(emitters->position, i, f)), axis = vec_of_light(emitters->normal, i, f);
        Mask ball = shines_from(emitters, SHAPE_SPHERE, i, f), wall = shines_from(emitters, SHAPE_CYLINDER, i, f);
        if (f.has & HAS_CYLINDER_LIGHT) {
            Real along = only(wall, vec_dot(out, axis) / vec_dot(axis, axis));
            out = vec_sub(out, vec_scale(axis, along));
        }
        cosine = select(ball | wall, vec_dot(out, d) / of_light(emitters->radius, i, f), cosine);
    }
    return cosine;
}

INLINE EmitPdf area_emit_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    Real cosine = area_cosine(emitters, i, o, d, f);
    return (EmitPdf){real(1) / of_light(emitters->area, i, f), pdf_w_hemisphere_cosine(real_max(cosine, real(0))), cosine,
        mask_none(), mask_all()};
}

#endif
