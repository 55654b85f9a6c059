#ifndef ONERAY_SHAPES_SPHERE_H
#define ONERAY_SHAPES_SPHERE_H

#include "shapes/shape.h"

enum { sphere_planar = 0, sphere_sides = 1 };

typedef struct {
    Num center[3], radius;
} SphereRow;

/* |o + t d - c| = r. The discriminant from the ray's distance to the center, r² - |oc - (oc·d) d|², keeps its
   digits where b² - |oc|² + r² has lost them: Haines, Günther, Akenine-Möller, Precision Improvements for
   Ray/Sphere Intersection, Ray Tracing Gems 2019. From a point of the sphere itself, t is exactly 0 and -2
   oc·d. */
STAGE Stretch sphere_stretch(const SphereRow *ball, const Ray *ray, Mask on)
{
    Vec oc = vec_sub(ray->o, vec_of(ball->center));
    Real b = vec_dot(oc, ray->d);
    Vec foot = vec_sub(oc, vec_scale(ray->d, b));
    Real radius = real(ball->radius), discriminant = radius * radius - vec_dot(foot, foot);
    Real root = real_sqrt(real_max(discriminant, real(0)));
    root = select(on, real_abs(b), root);
    return (Stretch){-b - root, root - b, (discriminant >= real(0)) | on};
}

INLINE Mask sphere_meets(const Shapes *shapes, int i, int slot, const Ray *ray, Hit *at)
{
    Mask on = ray->from == index_of(slot);
    Stretch s = sphere_stretch(&ROWS(shapes, SPHERE, Sphere)[i], ray, on);
    *at = (Hit){stretch_hit(s, on), index_of(slot)};
    return s.met & (at->t > real(0));
}

/* A sphere that shines outwards is never in its own way: however small, its near side is the target. */
INLINE Mask sphere_blocks(const Shapes *shapes, int i, int slot, const Ray *ray, Index target)
{
    Mask on = ray->from == index_of(slot), aim = target == index_of(slot);
    Mask blocked = stretch_blocks(sphere_stretch(&ROWS(shapes, SPHERE, Sphere)[i], ray, on), ray, on, aim);
    return shapes->anchor[slot][3] < 0 ? blocked : and_not(blocked, aim);
}

/* The point nearest to `met`, and the normal there. */
INLINE void sphere_surface(const Real anchor[4], Vec met, Vec *p, Vec *n)
{
    Vec center = vec(anchor[0], anchor[1], anchor[2]), outward = vec_normalize(vec_sub(met, center));
    *n = vec_scale(outward, flip_sign(real(1), anchor[3]));
    *p = vec_add(center, vec_scale(*n, anchor[3]));
}

/* A point, uniform by area, and the normal there, of a sphere with this center and radius, negative if it is turned
   inside out. */
INLINE void sphere_sample(Vec center, Real radius, Real u, Real v, Vec *point, Vec *normal)
{
    *normal = vec_scale(sample_sphere(u, v), flip_sign(real(1), radius));
    *point = vec_add(center, vec_scale(*normal, radius));
}

#endif
