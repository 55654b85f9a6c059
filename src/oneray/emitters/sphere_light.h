/* L5 Spherical lights: the half that faces a point, and the cone that they fill. */
#pragma once

#include "emitters/emitter.h"

/* L5 How a sphere light looks from a point: the one decision of inside or outside, which sampling it and its
   density share. A point of the sphere itself is not outside. */
typedef struct {
    Mask outside;
    Vec axis; /* unit vector to the center */
    Real distance;
    Real extent; /* 1 - cosθmax of the cone that it fills, sinθmax = R/d = s: s²/(1 + √((1-s)(1+s))) */
    Mask sets;   /* its center is below the receiver's horizon, part of it above */
    Real below;  /* then: sine of the center's depth below the horizon, … */
    Real rise, turn; /* … of the height of what is above, and half its width in azimuth (radians) */
} SphereView;

/* What is above the horizon of a cone that sets, sinθmax = s, its axis below by the angle β, sinβ = b: heights z
   from 0 to sin(θmax - β) = (s² - b²)/(s cosβ + b cosθmax), azimuths to either side up to φ at the horizon, cosφ =
   cosθmax/cosβ, tanφ = √(s² - b²)/cosθmax. It fills two thirds or more of that block, whose solid angle is 2φ z. */
INLINE void view_setting(SphereView *view, Real s)
{
    Real b = view->below, above = (s - b) * (s + b), cos_max = real_sqrt((real(1) - s) * (real(1) + s));
    view->rise = above / (s * real_sqrt((real(1) - b) * (real(1) + b)) + b * cos_max);
    view->turn = angle_of(real_sqrt(real_max(above, real(0))), cos_max);
}
#define DEEPEST_SETTING 0.999 /* sine; a sphere still deeper is all but underfoot: its azimuth says little */

INLINE SphereView view_sphere(const Emitters *emitters, Index i, const Receiver *at, Features f)
{
    SphereView view;
    Vec to_center = vec_sub(vec_of_light(emitters->position, i, f), at->p);
    Real radius = real_abs(of_light(emitters->radius, i, f));
    view.distance = vec_length(to_center);
    view.axis = vec_scale(to_center, real(1) / view.distance);
    view.outside = shines_from(emitters, SHAPE_SPHERE, i, f) & (view.distance > radius)
                   & (at->slot != index_of_light(emitters->slot, i, f));
    Real s = radius / view.distance;
    view.extent = s * s / (real(1) + real_sqrt((real(1) - s) * (real(1) + s)));
    view.sets = mask_none();
    if (f.use & USE_CONE) {
        view.below = -vec_dot(at->n, view.axis);
        view.sets = view.outside & (view.below > real(0)) & (view.below < real_min(s, real(DEEPEST_SETTING)));
        view.sets = and_not(view.sets, at->both_sides);
        if (any(view.sets))
            view_setting(&view, s);
    }
    return view;
}

/* L5 A uniform point of the half of the sphere that faces the point: none is wasted on the back. */
INLINE void sample_facing(
    const Emitters *emitters, Index i, const SphereView *view, Real u, Real v, Vec *point, Vec *normal, Features f)
{
    Real radius = of_light(emitters->radius, i, f);
    Vec direction = vec_from_frame(vec_neg(view->axis), sample_hemisphere_uniform(u, v));
    Vec on = vec_add(vec_of_light(emitters->position, i, f), vec_scale(direction, real_abs(radius)));
    *point = vec_select(view->outside, on, *point);
    *normal = vec_select(view->outside, vec_scale(direction, flip_sign(real(1), radius)), *normal);
}

/* A direction in the block above the horizon that holds what is seen of a sphere that sets. */
INLINE Vec sample_setting(const SphereView *view, Vec n, Real u, Real v)
{
    Real sine, cosine, z = u * view->rise, side = real(2) * v - real(1);
    Real across = real_sqrt((real(1) - z) * (real(1) + z)), b = view->below;
    sincos_turn(real_abs(side) * view->turn * (real(0.5) * REAL_INV_PI), &sine, &cosine);
    Vec ahead = vec_scale(
        vec_add(view->axis, vec_scale(n, b)), real(1) / real_sqrt((real(1) - b) * (real(1) + b)));
    Vec wi = vec_add(vec_scale(n, z), vec_scale(ahead, across * cosine));
    return vec_add(wi, vec_scale(vec_cross(n, ahead), across * flip_sign(sine, side)));
}

/* L5 A direction in the cone that the sphere fills, and the distance to the sphere along it, (d-r)(d+r) /
   (d cosθ + √(r² - d² sin²θ)), which keeps its digits however near the sphere is. Returns whether it meets the
   sphere: not all of the block of one that sets does. */
INLINE Mask sample_sphere_cone(const Emitters *emitters, Index i, const Receiver *at, const SphereView *view, Real u,
    Real v, LightSample *s, Features f)
{
    Real radius = real_abs(of_light(emitters->radius, i, f)), d = view->distance;
    Vec local = sample_cone(u, v, view->extent), wi = vec_from_frame(view->axis, local);
    Real cosine = local.z, sine_squared = local.x * local.x + local.y * local.y;
    Mask meets = mask_all();
    if (any(view->sets)) {
        Vec above = sample_setting(view, at->n, u, v), across = vec_cross(view->axis, above);
        wi = vec_select(view->sets, above, wi);
        cosine = select(view->sets, vec_dot(view->axis, above), cosine);
        sine_squared = select(view->sets, vec_dot(across, across), sine_squared);
        meets = and_not(meets, view->sets & (d * d * sine_squared > radius * radius));
    }
    Real root = real_sqrt(real_max(radius * radius - d * d * sine_squared, real(0)));
    s->wi = vec_select(view->outside, wi, s->wi);
    s->distance = select(view->outside, (d - radius) * (d + radius) / (d * cosine + root), s->distance);
    return meets;
}
