/* The cylinder's wall, without end caps, with normals outwards: x² + y² = 1, 0 ≤ z ≤ 1 of its own space. */
#pragma once

#include "shapes/placed.h"

/* Once it is checked, to_world takes the unit cylinder there. */
typedef struct cylinder {
    Placed placed;
    double p0[3], p1[3], radius;
} Cylinder;

/* Columns along the direction from p0 to p1 and across it, as Mitsuba chooses them: Duff et al., Building an Orthonormal
   Basis, Revisited, JCGT 6(1), 2017. */
static inline Affine cylinder_stand(const Cylinder *s, double height)
{
    double n[3];
    difference(s->p1, s->p0, n);
    normalise(n);
    double sign = n[2] >= 0 ? 1 : -1, a = -1 / (sign + n[2]), b = n[0] * n[1] * a, r = s->radius;
    const double across[2][3] = {{1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]}, {b, sign + n[1] * n[1] * a, -n[1]}};
    Affine stand;
    for (int i = 0; i < 3; i++) {
        const double row[4] = {r * across[0][i], r * across[1][i], height * n[i], s->p0[i]};
        memcpy(stand.m[i], row, sizeof row);
    }
    return stand;
}

/* Is the wall round, and at right angles to its ends? */
static inline bool cylinder_is_round(const Affine *to_world)
{
    double x[3], y[3], z[3];
    column(to_world, 0, x);
    column(to_world, 1, y);
    column(to_world, 2, z);
    double a = length(x), b = length(y), c = length(z);
    return fabs(a / b - 1) <= 1e-4 && fabs(dot(x, y)) <= 1e-4 * a * b && fabs(dot(x, z)) <= 1e-4 * a * c
           && fabs(dot(y, z)) <= 1e-4 * b * c;
}

/* A mirroring leaves normals outwards, as Mitsuba's rays find them; its sampling of a mirrored lamp takes the others. */
static inline void cylinder_check(void *plugin, Said *said)
{
    Cylinder *s = plugin;
    double along[3];
    difference(s->p1, s->p0, along);
    double height = length(along);
    if (!(s->radius > 0) || !(height > 0)) {
        said->left_out = "this cylinder has no size and is left out";
        return;
    }
    s->placed.to_world = affine_multiply(s->placed.to_world, cylinder_stand(s, height));
    if (!cylinder_is_round(&s->placed.to_world))
        fail(given(said, "to_world"), "\"to_world\" of a cylinder must not shear it or scale it unevenly across its axis");
}
static const Plugin cylinder_plugin = {"cylinder", cylinder_check, {
    PLACED_FIELDS,
    {"p0", AS_VECTOR, offsetof(Cylinder, p0), NULL, "0"},
    {"p1", AS_VECTOR, offsetof(Cylinder, p1), NULL, "0 0 1"},
    {"radius", AS_FLOAT, offsetof(Cylinder, radius), "[0,inf)", "1"}}};

enum { cylinder_planes = 0 };
static inline Side cylinder_side(const Cylinder *s, int k)
{
    Side side = {.across = 0};
    (void)k;
    column(&s->placed.to_world, 0, side.x);
    column(&s->placed.to_world, 1, side.y);
    column(&s->placed.to_world, 2, side.axis);
    column(&s->placed.to_world, 3, side.middle);
    side.across = length(side.x) * length(side.x);
    side.area = 2 * PI * length(side.x) * length(side.axis);
    for (int i = 0; i < 3; i++) {
        side.axis[i] /= 2;
        side.middle[i] += side.axis[i];
    }
    return side;
}

static inline Extent cylinder_extent(const Cylinder *s)
{
    Side side = cylinder_side(s, 0);
    Extent e = {.least = fmin(length(side.x), length(side.axis)), .height = HUGE_VAL};
    for (int i = 0; i < 3; i++) {
        double reach = cr_hypot(side.x[i], side.y[i]) + fabs(side.axis[i]);
        e.low[i] = side.middle[i] - reach;
        e.high[i] = side.middle[i] + reach;
    }
    return e;
}

#ifdef LANES

#include "shapes/shape.h"

typedef struct cylinder_row {
    Num axis[3], height; /* unit vector from p0 on */
    Num p0[3], radius;   /* negative if it is turned inside out */
} CylinderRow;
static inline void cylinder_row(const Cylinder *s, CylinderRow *row)
{
    double x[3], axis[3], p0[3];
    column(&s->placed.to_world, 0, x);
    column(&s->placed.to_world, 2, axis);
    column(&s->placed.to_world, 3, p0);
    row->height = (Num)length(axis);
    row->radius = (Num)(s->placed.flip_normals ? -length(x) : length(x));
    normalise(axis);
    store(row->axis, axis);
    store(row->p0, p0);
}

/* As a sphere's. */
static inline void cylinder_anchor(const Cylinder *s, double anchor[4])
{
    Side side = cylinder_side(s, 0);
    memcpy(anchor, side.middle, sizeof side.middle);
    anchor[3] = s->placed.flip_normals ? -length(side.x) : length(side.x);
}

/* |w + t e| = r for what o - p0 and d have across the axis, by the distance to the axis as with a sphere
   (sphere_stretch); the wall is met where that is between its ends. */
APART Stretch cylinder_stretch(const CylinderRow *wall, const Ray *ray, Mask on)
{
    Vec axis = vec_of(wall->axis), out = vec_sub(ray->o, vec_of(wall->p0));
    Real z = vec_dot(out, axis), dz = vec_dot(ray->d, axis), radius = real(wall->radius), height = real(wall->height);
    Vec w = vec_sub(out, vec_scale(axis, z)), e = vec_sub(ray->d, vec_scale(axis, dz));
    Real inverse = real(1) / real_max(vec_dot(e, e), real(NEARLY_PARALLEL)), b = vec_dot(w, e) * inverse;
    Vec foot = vec_sub(w, vec_scale(e, b));
    Real discriminant = radius * radius - vec_dot(foot, foot);
    Real root = select(on, real_abs(b), real_sqrt(real_max(discriminant, real(0)) * inverse));
    Mask met = (discriminant >= real(0)) | on;
    Stretch s = {-b - root, root - b, met, met};
    Real enters = z + s.near * dz, leaves = z + s.far * dz;
    s.entered &= (enters >= real(0)) & (enters <= height);
    s.left &= (leaves >= real(0)) & (leaves <= height);
    return s;
}

INLINE Stretch cylinder_through(const Shapes *shapes, int i, int slot, const Ray *ray, Index on, Index through[2])
{
    through[0] = through[1] = index_of(slot);
    return cylinder_stretch(&ROWS(shapes, CYLINDER, Cylinder)[i], ray, on == index_of(slot));
}

/* From the wall itself one of the two is exactly 0. */
INLINE Mask cylinder_meets(const Shapes *shapes, int i, int slot, const Ray *ray, Hit *at)
{
    Stretch s = cylinder_stretch(&ROWS(shapes, CYLINDER, Cylinder)[i], ray, ray->from == index_of(slot));
    Mask near = s.entered & (s.near > real(0));
    *at = (Hit){select(near, s.near, s.far), index_of(slot)};
    return near | (s.left & (s.far > real(0)));
}

/* A point of it is seen if it is on the near side, or through an open end. */
INLINE Mask cylinder_blocks(const Shapes *shapes, int i, int slot, const Ray *ray, Index target)
{
    Stretch s = cylinder_stretch(&ROWS(shapes, CYLINDER, Cylinder)[i], ray, ray->from == index_of(slot));
    Mask aim = target == index_of(slot), near = s.entered & (s.near > real(0));
    Mask other = (near & (s.near < ray->tmax)) | (s.left & (s.far > real(0)) & (s.far < ray->tmax));
    return (aim & near & (s.near + s.far < ray->tmax + ray->tmax)) | and_not(other, aim);
}

INLINE void cylinder_surface(const Shapes *shapes, Index nth, const Real anchor[4], Vec met, Vec *p, Vec *n)
{
    Real row[8];
    (void)anchor;
    gather_row(shapes->rows[SHAPE_CYLINDER], nth, 8, row);
    Vec axis = vec(row[0], row[1], row[2]), p0 = vec(row[4], row[5], row[6]), out = vec_sub(met, p0);
    Vec along = vec_scale(axis, vec_dot(out, axis)), outward = vec_normalize(vec_sub(out, along));
    *n = vec_scale(outward, flip_sign(real(1), row[7]));
    *p = vec_add(vec_add(p0, along), vec_scale(*n, row[7]));
}

/* A point, uniform by area, and the normal there: of the wall about the middle, by two radii at right angles and half
   the axis; of this radius, negative if it is turned inside out. */
INLINE void cylinder_sample(Vec middle, Vec x, Vec y, Vec axis, Real radius, Real u, Real v, Vec *point, Vec *normal)
{
    Vec on = turned(real(1), v, real(2) * u - real(1));
    Vec out = vec_add(vec_scale(x, on.x), vec_scale(y, on.y));
    *point = vec_add(vec_add(middle, vec_scale(axis, on.z)), out);
    *normal = vec_scale(out, real(1) / radius);
}

/* u is the angle around z in turns, v is z. */
INLINE SurfaceFrame cylinder_uv(Vec at, Index nth)
{
    Real two_pi = real(2) * REAL_PI;
    (void)nth;
    return (SurfaceFrame){turn_of(at.x, at.y), at.z, vec(-two_pi * at.y, two_pi * at.x, real(0)),
        vec(real(0), real(0), real(1))};
}

#endif
