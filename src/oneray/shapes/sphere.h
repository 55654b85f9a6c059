/* The sphere, with normals outwards. */
#pragma once

#include "shapes/placed.h"

/* Once it is checked, center and radius are the world's, and to_world takes the unit sphere there. */
typedef struct sphere {
    Placed placed;
    double center[3], radius;
} Sphere;

/* A mirrored sphere is turned inside out, as in Mitsuba; a mirroring or a rotation shows by (u, v) besides. */
static inline void sphere_check(void *plugin, Said *said)
{
    Sphere *s = plugin;
    const Affine *to_world = &s->placed.to_world;
    double scale = affine_uniform_scale(to_world, 1e-4);
    if (scale == 0)
        fail(given(said, "to_world"), "\"to_world\" of a sphere must not shear or scale by axis");
    if (affine_determinant(to_world) < 0)
        s->placed.flip_normals = !s->placed.flip_normals;
    Affine at = affine_multiply(*to_world, affine_translate(s->center[0], s->center[1], s->center[2]));
    column(&at, 3, s->center);
    s->placed.to_world = affine_multiply(at, affine_scale(s->radius, s->radius, s->radius));
    s->radius *= scale;
    if (!(s->radius > 0))
        said->left_out = "this sphere has no size and is left out";
}
static const Plugin sphere_plugin = {"sphere", sphere_check, {
    {"to_world", AS_TRANSFORM, offsetof(Sphere, placed.to_world), NULL, ""},
    {"center", AS_VECTOR, offsetof(Sphere, center), NULL, "0"},
    {"radius", AS_FLOAT, offsetof(Sphere, radius), "[0,inf)", "1"},
    {"flip_normals", AS_BOOLEAN, offsetof(Sphere, placed.flip_normals), NULL, "false"}}};

enum { sphere_planes = 0 };
static inline Side sphere_side(const Sphere *s, int k)
{
    double r = s->radius;
    (void)k;
    return (Side){{s->center[0], s->center[1], s->center[2]}, {r, 0, 0}, {0, r, 0}, {0}, {0}, r * r, 4 * PI * (r * r)};
}
static inline Extent sphere_extent(const Sphere *s) { return ball_extent(s->center, s->radius); }

#ifdef LANES

#include "shapes/shape.h"

typedef struct sphere_row {
    Num center[3], radius;
} SphereRow;
static inline void sphere_row(const Sphere *s, SphereRow *row)
{
    *row = (SphereRow){{(Num)s->center[0], (Num)s->center[1], (Num)s->center[2]}, (Num)s->radius};
}

/* Center and radius, negative if it is turned inside out. */
static inline void sphere_anchor(const Sphere *s, double anchor[4])
{
    memcpy(anchor, s->center, sizeof s->center);
    anchor[3] = s->placed.flip_normals ? -s->radius : s->radius;
}

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
    Mask met = (discriminant >= real(0)) | on;
    return (Stretch){-b - root, root - b, met, met};
}

/* Where the ray is in the sphere, which it starts on if `on` is its slot. */
INLINE Stretch sphere_through(const Shapes *shapes, int i, int slot, const Ray *ray, Index on, Index through[2])
{
    through[0] = through[1] = index_of(slot);
    return sphere_stretch(&ROWS(shapes, SPHERE, Sphere)[i], ray, on == index_of(slot));
}

INLINE Mask sphere_meets(const Shapes *shapes, int i, int slot, const Ray *ray, Hit *at)
{
    Mask on = ray->from == index_of(slot);
    Stretch s = sphere_stretch(&ROWS(shapes, SPHERE, Sphere)[i], ray, on);
    *at = (Hit){stretch_hit(s, on), index_of(slot)};
    return s.entered & (at->t > real(0));
}

/* A sphere that shines outwards is never in its own way: however small, its near side is the target. */
INLINE Mask sphere_blocks(const Shapes *shapes, int i, int slot, const Ray *ray, Index target)
{
    Mask on = ray->from == index_of(slot), aim = target == index_of(slot);
    Mask blocked = stretch_blocks(sphere_stretch(&ROWS(shapes, SPHERE, Sphere)[i], ray, on), ray, on, aim);
    return shapes->anchor[slot][3] < 0 ? blocked : and_not(blocked, aim);
}

/* The point nearest to `met`, and the normal there. */
INLINE void sphere_surface(const Shapes *shapes, Index nth, const Real anchor[4], Vec met, Vec *p, Vec *n)
{
    (void)shapes, (void)nth;
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

/* Spherical coordinates of its own space: u is the angle around z in turns, v the one from +z in half turns. At the
   poles p does not move with u; where it moves with v is a convention, Mitsuba's. */
INLINE SurfaceFrame sphere_uv(Vec at, Index nth)
{
    (void)nth;
    Real rho = real_sqrt(at.x * at.x + at.y * at.y), two_pi = real(2) * REAL_PI;
    Mask pole = rho == real(0);
    Real slope = at.z / select(pole, real(1), rho);
    Vec down = vec_select(pole, vec(real(1), real(0), real(0)), vec(slope * at.x, slope * at.y, -rho));
    return (SurfaceFrame){turn_of(at.x, at.y), REAL_INV_PI * angle_of(rho, at.z),
        vec(-two_pi * at.y, two_pi * at.x, real(0)), vec_scale(down, REAL_PI)};
}

#endif
