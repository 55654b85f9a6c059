/* Shapes, and what a ray meets of each: W rays at once. meet.h looks at all of them.

   No epsilon keeps a ray off the surface that it starts from: the ray knows which primitive that is. A flat
   one is left out; from a sphere or cube only the far side can be met, and only by a ray that goes inwards.

   A slot is what a ray can hit: a rectangle (those along the axes first), a disk, one of a cube's six faces,
   a sphere, a triangle, numbered in this order. Tables by slot have a row for each, except that the triangles
   of a mesh share one, after the spheres. */
#ifndef ONERAY_SHAPES_SHAPE_H
#define ONERAY_SHAPES_SHAPE_H

#include "kinds.h"
#include "technique.h"
#include "shapes/mesh.h"

#ifdef SINGLE
#define NEARLY_PARALLEL 1e-30
#else
#define NEARLY_PARALLEL 1e-240
#endif

/* World to the unit shape: local coordinate i of p is row[i][0..2]·p + row[i][3]. */
typedef struct {
    Num row[3][4];
} Local;

#define HAS_FLAT (HAS_ALIGNED | HAS_RECTANGLE | HAS_DISK)

/* A rectangle whose sides lie along axes u = axis+1 and v = axis+2 (mod 3), in the plane p[axis] = plane. */
typedef struct {
    Num plane, center_u, center_v, half_u, half_v;
} Aligned;

typedef struct {
    Num center[3], radius;
} Ball;

typedef struct {
    int rectangle_count, disk_count, cube_count, sphere_count;
    Aligned *aligned; /* by slot: those along x, y, z from aligned_slot[0], [1], [2] */
    Local *rectangles, *disks, *cubes;
    Ball *balls;
    int aligned_slot[4], disk_slot, cube_slot, sphere_slot,
        mesh_row;     /* first slots; rectangles': aligned_slot[3] */
    int slot_count;   /* rows of the tables by slot */
    int aligned_blocking[3], rectangle_blocking,
        disk_blocking; /* by axis, and of the tables: end of those that can be between two points of the scene;
                          of the others' planes, all of it lies on one side */
    Triangles triangles;
    Tree tree;              /* of the others, where they are too many for a loop */
    int32_t *slot_of_leaf;
    Num (*anchor)[4]; /* by slot: the unit normal n of a flat primitive and n·p of its plane; the center of a
                         sphere and its radius, negative if flip_normals */
    Int *shines;      /* by slot: is there an area light, even one of no power? */
} Shapes;

typedef struct {
    Vec o, d; /* d of unit length */
    Real tmax;
    Index from; /* the slot that o lies on, -1 for none */
} Ray;

typedef struct {
    Real t;
    Index slot; /* -1: nothing met */
} Hit;

INLINE Real row_point(const Num row[4], Vec p)
{
    return real(row[0]) * p.x + real(row[1]) * p.y + real(row[2]) * p.z + real(row[3]);
}
INLINE Real row_direction(const Num row[4], Vec d)
{
    return real(row[0]) * d.x + real(row[1]) * d.y + real(row[2]) * d.z;
}

/* Where the ray crosses the plane z = 0 of a flat shape's own space, as a fraction t = num/den with den >= 0,
   and its x and y there times den: no division until the nearest of all is known. */
typedef struct {
    Real num, den, x, y;
} Crossing;

INLINE Crossing flat_crossing(const Local *flat, const Ray *ray)
{
    Real z = row_point(flat->row[2], ray->o), dz = row_direction(flat->row[2], ray->d);
    Crossing c = {-flip_sign(z, dz), real_abs(dz), real(0), real(0)};
    c.x = row_point(flat->row[0], ray->o) * c.den + row_direction(flat->row[0], ray->d) * c.num;
    c.y = row_point(flat->row[1], ray->o) * c.den + row_direction(flat->row[1], ray->d) * c.num;
    return c;
}

/* The same for a rectangle along the axes: |x| <= half_u den, |y| <= half_v den is within. `axis` is a
   constant. */
INLINE Real along(Vec a, int axis) { return axis == 0 ? a.x : axis == 1 ? a.y : a.z; }
INLINE Crossing aligned_crossing(const Aligned *a, const Ray *ray, int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Real d = along(ray->d, axis);
    Crossing c = {flip_sign(real(a->plane) - along(ray->o, axis), d), real_abs(d), real(0), real(0)};
    c.x = (along(ray->o, u) - real(a->center_u)) * c.den + along(ray->d, u) * c.num;
    c.y = (along(ray->o, v) - real(a->center_v)) * c.den + along(ray->d, v) * c.num;
    return c;
}
INLINE Mask within_aligned(const Aligned *a, Crossing c)
{
    return (real_abs(c.x) <= real(a->half_u) * c.den) & (real_abs(c.y) <= real(a->half_v) * c.den);
}
INLINE Mask within_rectangle(Crossing c) { return (real_abs(c.x) <= c.den) & (real_abs(c.y) <= c.den); }
INLINE Mask within_disk(Crossing c) { return c.x * c.x + c.y * c.y <= c.den * c.den; }

/* The stretch near < t < far of the ray inside a convex solid; no_stretch: it passes by. */
typedef struct {
    Real near, far;
    Mask met;
} Stretch;

/* |o + t d - c| = r. The discriminant from the ray's distance to the center, r² - |oc - (oc·d) d|², keeps its
   digits where b² - |oc|² + r² has lost them: Haines, Günther, Akenine-Möller, Precision Improvements for
   Ray/Sphere Intersection, Ray Tracing Gems 2019. From a point of the sphere itself, t is exactly 0 and -2
   oc·d. */
STAGE Stretch ball_stretch(const Ball *ball, const Ray *ray, Mask on)
{
    Vec oc = vec_sub(ray->o, vec_of(ball->center));
    Real b = vec_dot(oc, ray->d);
    Vec foot = vec_sub(oc, vec_scale(ray->d, b));
    Real radius = real(ball->radius), discriminant = radius * radius - vec_dot(foot, foot);
    Real root = real_sqrt(real_max(discriminant, real(0)));
    root = select(on, real_abs(b), root);
    return (Stretch){-b - root, root - b, (discriminant >= real(0)) | on};
}

/* The slabs |x|, |y|, |z| <= 1 of the cube's own space, entered at -(x/dx + 1/|dx|), left at 1/|dx| - x/dx. `faces`
   gets the face entered and left by: 0 … 5 for the normals +x -x +y -y +z -z. A ray that starts on face `on` starts
   exactly there, so that one that goes out of it has its far end at 0: it meets nothing. */
typedef struct {
    Index enter, leave;
} Faces;

STAGE Stretch cube_stretch(const Local *cube, const Ray *ray, Index on, Faces *faces)
{
    Real before = real(NUM_MAX), after = real(NUM_MAX);
    Real side = bits_real(real_bits(real(1)) | (Bits)on << (8 * NUM_BYTES - 1));
    UNROLLED for (int axis = 0; axis < 3; axis++) {
        Real x = row_point(cube->row[axis], ray->o), dx = row_direction(cube->row[axis], ray->d);
        x = select(on >> 1 == index_of(axis), side, x);
        dx = select(dx == real(0), real(NEARLY_PARALLEL), dx);
        Real inverse = real(1) / dx, middle = x * inverse, half = real_abs(inverse);
        Real enter = middle + half, leave = half - middle;
        if (faces) {
            Index face = (Index)(real_bits(dx) >> (8 * NUM_BYTES - 1)) + 2 * axis;
            faces->enter = index_select(enter < before, face, faces->enter);
            faces->leave = index_select(leave < after, face, faces->leave);
        }
        before = real_min(enter, before);
        after = real_min(leave, after);
    }
    if (faces)
        faces->enter ^= 1;
    return (Stretch){-before, after, -before <= after};
}

/* What the ray meets of a solid: the near side, or from inside the far one. */
INLINE Real stretch_hit(Stretch s, Mask on) { return select(and_not(s.near > real(0), on), s.near, s.far); }

/* hide_emitters: the lanes that `hiding` names, those of camera rays, pass the shapes that shine. */
INLINE Mask can_meet(const Shapes *shapes, int slot, Mask hiding, Features f)
{
    return f.has & HAS_HIDDEN && shapes->shines[slot] ? mask_not(hiding) : mask_all();
}

/* The nearest so far, t = num/den. */
typedef struct {
    Real num, den;
    Index slot;
} Nearest;

INLINE void take_nearer(Nearest *nearest, Crossing c, Mask within, const Ray *ray, int slot)
{
    Mask nearer = within & (c.num > real(0)) & (c.num * nearest->den < nearest->num * c.den);
    nearer = and_not(nearer, ray->from == index_of(slot));
    nearest->num = select(nearer, c.num, nearest->num);
    nearest->den = select(nearer, c.den, nearest->den);
    nearest->slot = index_select(nearer, index_of(slot), nearest->slot);
}

/* Where the ray meets a rectangle along the axes, those of one axis sharing a division. */
INLINE Mask aligned_meets(const Aligned *a, const Ray *ray, int axis, Real inverse, Real *t)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    *t = (real(a->plane) - along(ray->o, axis)) * inverse;
    Real x = along(ray->o, u) + *t * along(ray->d, u) - real(a->center_u);
    Real y = along(ray->o, v) + *t * along(ray->d, v) - real(a->center_v);
    return (real_abs(x) <= real(a->half_u)) & (real_abs(y) <= real(a->half_v)) & (*t > real(0));
}

INLINE void aligned_nearest(
    const Shapes *shapes, const Ray *ray, Mask hiding, int axis, Nearest *nearest, Features f)
{
    Real t, inverse = real(1) / along(ray->d, axis);
    for (int slot = shapes->aligned_slot[axis]; slot < shapes->aligned_slot[axis + 1]; slot++) {
        Mask nearer = aligned_meets(&shapes->aligned[slot], ray, axis, inverse, &t) & (t < nearest->num)
                      & can_meet(shapes, slot, hiding, f);
        nearer = and_not(nearer, ray->from == index_of(slot));
        nearest->num = select(nearer, t, nearest->num);
        nearest->slot = index_select(nearer, index_of(slot), nearest->slot);
    }
}

/* The nearest of the flat shapes; all that do not lie along the axes take one division. */
STAGE Hit flat_hit(const Shapes *shapes, const Ray *ray, Mask hiding, Features f)
{
    Nearest nearest = {ray->tmax, real(1), index_of(-1)};
    if (f.has & HAS_ALIGNED) {
        aligned_nearest(shapes, ray, hiding, 0, &nearest, f);
        aligned_nearest(shapes, ray, hiding, 1, &nearest, f);
        aligned_nearest(shapes, ray, hiding, 2, &nearest, f);
    }
    if (f.has & HAS_RECTANGLE)
        for (int i = 0, slot = shapes->aligned_slot[3]; i < shapes->rectangle_count; i++, slot++) {
            Crossing c = flat_crossing(&shapes->rectangles[i], ray);
            take_nearer(&nearest, c, within_rectangle(c) & can_meet(shapes, slot, hiding, f), ray, slot);
        }
    if (f.has & HAS_DISK)
        for (int i = 0, slot = shapes->disk_slot; i < shapes->disk_count; i++, slot++) {
            Crossing c = flat_crossing(&shapes->disks[i], ray);
            take_nearer(&nearest, c, within_disk(c) & can_meet(shapes, slot, hiding, f), ray, slot);
        }
    return (Hit){f.has & (HAS_RECTANGLE | HAS_DISK) ? nearest.num / nearest.den : nearest.num, nearest.slot};
}

/* Does the ray meet the cube or sphere, where, and which of its slots? */
INLINE Mask cube_meets(const Shapes *shapes, int i, int slot, const Ray *ray, Hit *at)
{
    Faces faces = {index_of(0), index_of(0)};
    Index face = ray->from - slot;
    Mask on = (face >= 0) & (face < 6);
    Stretch s = cube_stretch(&shapes->cubes[i], ray, face, &faces);
    at->t = stretch_hit(s, on);
    Mask entering = at->t == s.near;
    at->slot = slot + index_select(entering, faces.enter, faces.leave);
    return s.met & (at->t > real(0));
}
INLINE Mask ball_meets(const Shapes *shapes, int i, int slot, const Ray *ray, Hit *at)
{
    Mask on = ray->from == index_of(slot);
    Stretch s = ball_stretch(&shapes->balls[i], ray, on);
    *at = (Hit){stretch_hit(s, on), index_of(slot)};
    return s.met & (at->t > real(0));
}

INLINE void take(Hit *hit, Mask met, Hit at)
{
    *hit = (Hit){select(met, at.t, hit->t), index_select(met, at.slot, hit->slot)};
}

/* The nearest of the solid ones. */
INLINE void solid_hit(const Shapes *shapes, const Ray *ray, Mask hiding, Hit *hit, Features f)
{
    Hit at;
    if (f.has & HAS_CUBE)
        for (int i = 0, slot = shapes->cube_slot; i < shapes->cube_count; i++, slot += 6) {
            Mask met = cube_meets(shapes, i, slot, ray, &at);
            take(hit, met & (at.t < hit->t) & can_meet(shapes, slot, hiding, f), at);
        }
    if (f.has & HAS_SPHERE)
        for (int i = 0, slot = shapes->sphere_slot; i < shapes->sphere_count; i++, slot++) {
            Mask met = ball_meets(shapes, i, slot, ray, &at);
            take(hit, met & (at.t < hit->t) & can_meet(shapes, slot, hiding, f), at);
        }
}

/* Is the solid in the way of the ray's end at tmax, a point of it where `is_target`? That point is seen from
   outside if it is on the near side, and from inside always. */
INLINE Mask stretch_blocks(Stretch s, const Ray *ray, Mask on, Mask is_target)
{
    Real t = stretch_hit(s, on);
    Mask other = (t > real(0)) & (t < ray->tmax);
    Mask itself = and_not((s.near > real(0)) & (s.near + s.far < ray->tmax + ray->tmax), on);
    return s.met & ((is_target & itself) | and_not(other, is_target));
}

/* Is a flat shape in the way, one that is neither where the ray starts nor where it ends? */
INLINE Mask flat_blocks(Crossing c, Mask within, const Ray *ray, Index target, int slot)
{
    Mask before = within & (c.num > real(0)) & (c.num < ray->tmax * c.den);
    return and_not(before, (ray->from == index_of(slot)) | (target == index_of(slot)));
}

INLINE Mask aligned_blocks(const Shapes *shapes, const Ray *ray, Index target, int axis)
{
    Mask blocked = mask_none();
    for (int slot = shapes->aligned_slot[axis]; slot < shapes->aligned_blocking[axis]; slot++) {
        Crossing c = aligned_crossing(&shapes->aligned[slot], ray, axis);
        blocked |= flat_blocks(c, within_aligned(&shapes->aligned[slot], c), ray, target, slot);
    }
    return blocked;
}

INLINE Mask cube_blocks(const Shapes *shapes, int i, int slot, const Ray *ray, Index target)
{
    Index face = ray->from - slot, aim = target - slot;
    Mask on = (face >= 0) & (face < 6);
    Stretch s = cube_stretch(&shapes->cubes[i], ray, face, NULL);
    return stretch_blocks(s, ray, on, (aim >= 0) & (aim < 6));
}
/* A sphere that shines outwards is never in its own way: however small, its near side is the target. */
INLINE Mask ball_blocks(const Shapes *shapes, int i, int slot, const Ray *ray, Index target)
{
    Mask on = ray->from == index_of(slot), aim = target == index_of(slot);
    Mask blocked = stretch_blocks(ball_stretch(&shapes->balls[i], ray, on), ray, on, aim);
    return shapes->anchor[slot][3] < 0 ? blocked : and_not(blocked, aim);
}

/* Is any in the way, one after the other? */
STAGE Mask each_blocks(const Shapes *shapes, const Ray *ray, Index target, Features f)
{
    Mask blocked = mask_none();
    if (f.has & HAS_ALIGNED)
        blocked = aligned_blocks(shapes, ray, target, 0) | aligned_blocks(shapes, ray, target, 1)
                  | aligned_blocks(shapes, ray, target, 2);
    if (f.has & HAS_RECTANGLE)
        for (int i = 0, slot = shapes->aligned_slot[3]; i < shapes->rectangle_blocking; i++, slot++) {
            Crossing c = flat_crossing(&shapes->rectangles[i], ray);
            blocked |= flat_blocks(c, within_rectangle(c), ray, target, slot);
        }
    if (f.has & HAS_DISK)
        for (int i = 0, slot = shapes->disk_slot; i < shapes->disk_blocking; i++, slot++) {
            Crossing c = flat_crossing(&shapes->disks[i], ray);
            blocked |= flat_blocks(c, within_disk(c), ray, target, slot);
        }
    if (f.has & HAS_CUBE)
        for (int i = 0, slot = shapes->cube_slot; i < shapes->cube_count; i++, slot += 6)
            blocked |= cube_blocks(shapes, i, slot, ray, target);
    if (f.has & HAS_SPHERE)
        for (int i = 0, slot = shapes->sphere_slot; i < shapes->sphere_count; i++, slot++)
            blocked |= ball_blocks(shapes, i, slot, ray, target);
    return blocked;
}

#endif
