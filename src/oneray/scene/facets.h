/* The sides of shapes as polygons and spheres: which of them are in one place. */
#pragma once

#include "scene/description.h"

#include <string.h>

enum { MOST_CORNERS = 8 };
#define OVERLAP 1e-6 /* of a surface's width: what overlaps by less only touches */

/* A side of a shape. A disk is a polygon around it; a sphere or cylinder has no corners. Corners go around the normal. */
typedef struct {
    int shape, side, corners;
    double front; /* 1, or -1 where the normal points away from the front */
    double normal[3]; /* unit, outwards whatever flip_normals says; 0 where rounding leaves none */
    double size[3]; /* the coordinates that what is computed with it goes through wherever on it that is, … */
    double reach[3]; /* … and those of its corners, at most */
    double radius; /* of a sphere or cylinder about corner[0] … */
    double axis[3]; /* … and half its axis */
    double corner[MOST_CORNERS][3];
} Facet;

/* Without what `tolerance` asks for, or its shape. */
static inline Facet flat_triangle(const Mesh *mesh, int triangle)
{
    double a[3], b[3];
    Facet f;
    f.corners = 3;
    f.front = 1;
    f.radius = 0;
    triangle_edges(mesh, triangle, 0, a, b, f.normal);
    double size = sqrt(dot(f.normal, f.normal));
    for (int c = 0; c < 3; c++) {
        memcpy(f.corner[c], mesh->vertex[mesh->triangle[triangle][c]], sizeof f.corner[c]);
        f.normal[c] = size > 0 ? f.normal[c] / size : 0;
    }
    return f;
}

static inline Facet facet_of(const Description *d, int shape, int k)
{
    const Shape *s = &d->shapes[shape];
    Facet f;
    if (s->kind == SHAPE_MESH) {
        f = flat_triangle(&d->mesh, s->as.mesh.first_triangle + k);
        for (int i = 0; i < 3; i++)
            f.size[i] = f.reach[i] =
                fmax(fabs(f.corner[0][i]), fmax(fabs(f.corner[1][i]), fabs(f.corner[2][i])));
    }
    f.shape = shape;
    f.side = k;
    if (s->kind == SHAPE_MESH)
        return f;
    f.front = s->as.placed.flip_normals ? -1 : 1;
    f.radius = 0;
    f.corners = s->kind == SHAPE_DISK ? MOST_CORNERS : 4;
    Side side = shape_side(s, k);
    for (int i = 0; i < 3; i++) {
        f.size[i] =
            fmax(fabs(side.middle[i]), fabs(s->kind == SHAPE_SPHERE ? 0 : s->as.placed.to_world.m[i][3]));
        f.normal[i] = side.normal[i];
        f.reach[i] = f.size[i];
    }
    if (!shape_planes(s->kind)) {
        f.corners = 0;
        f.radius = length(side.x);
        memcpy(f.axis, side.axis, sizeof side.axis);
        memcpy(f.corner[0], side.middle, sizeof side.middle);
        return f;
    }
    double around[3];
    cross(side.x, side.y, around);
    double turn = dot(around, side.normal) < 0 ? -1 : 1;
    for (int c = 0; c < f.corners; c++) {
        double x = c == 1 || c == 2 ? -1 : 1, y = c < 2 ? turn : -turn;
        if (f.corners > 4) {
            x = cr_cos((c + 0.5) * 2 * PI / f.corners) / cr_cos(PI / f.corners);
            y = turn * cr_sin((c + 0.5) * 2 * PI / f.corners) / cr_cos(PI / f.corners);
        }
        for (int i = 0; i < 3; i++) {
            f.corner[c][i] = side.middle[i] + x * side.x[i] + y * side.y[i];
            f.reach[i] = fmax(f.reach[i], fabs(f.corner[c][i]));
        }
    }
    return f;
}

/* The box around it, and so far beyond. */
static inline TreeBox box_around(const Facet *f, double slack)
{
    TreeBox box;
    for (int i = 0; i < 3; i++) {
        box.low[i] = f->corner[0][i] - f->radius;
        box.high[i] = f->corner[0][i] + f->radius;
        for (int c = 1; c < f->corners; c++) {
            box.low[i] = fmin(box.low[i], f->corner[c][i]);
            box.high[i] = fmax(box.high[i], f->corner[c][i]);
        }
        box.low[i] -= slack;
        box.high[i] += slack;
    }
    return box;
}

/* How far apart planes a and b, or spheres, may be where both are and yet be taken for one: eight roundings of the
   coordinates that have a part in it, with those of the camera in `eye` if that is not NULL. */
static inline double tolerance(const Facet *a, const Facet *b, const double *eye, double rounding)
{
    double size = 0;
    bool straight = a->corners > 3 && b->corners > 3;
    for (int i = 0; i < 3; i++)
        if (!straight || a->normal[i] != 0 || b->normal[i] != 0) {
            double both = a->reach[i] < b->reach[i] ? a->reach[i] : b->reach[i];
            size = both > size ? both : size;
            size = a->size[i] > size ? a->size[i] : size;
            size = b->size[i] > size ? b->size[i] : size;
            size = eye && fabs(eye[i]) > size ? fabs(eye[i]) : size;
        }
    return 8 * rounding * (size + a->radius + b->radius);
}

static inline double width_of(const Facet *f)
{
    double across[3];
    difference(f->corner[f->corners / 2], f->corner[0], across);
    return f->corners ? length(across) : 0;
}

static inline double height_over(const Facet *plane, const double q[3])
{
    double up[3];
    difference(q, plane->corner[0], up);
    return dot(plane->normal, up);
}

/* Are all of b's corners as close to a's plane? */
static inline bool lies_in(const Facet *a, const Facet *b, double close)
{
    for (int c = 0; c < b->corners; c++)
        if (!(fabs(height_over(a, b->corner[c])) <= close))
            return false;
    return dot(a->normal, a->normal) > 0.5;
}

/* Is b beyond the edge of a from its corner c, or as near to that as touching is? */
static inline bool beyond_edge(const Facet *a, int c, const Facet *b, double touching)
{
    double edge[3], out[3], to[3], low = 0, high = 0, nearest = HUGE_VAL;
    difference(a->corner[(c + 1) % a->corners], a->corner[c], edge);
    cross(edge, a->normal, out);
    normalise(out);
    for (int k = 0; k < a->corners; k++) {
        difference(a->corner[k], a->corner[c], to);
        low = fmin(low, dot(out, to));
        high = fmax(high, dot(out, to));
    }
    double sign = high > -low ? -1 : 1; /* corners may go round either way */
    for (int k = 0; k < b->corners; k++) {
        difference(b->corner[k], a->corner[c], to);
        nearest = fmin(nearest, sign * dot(out, to));
    }
    return nearest >= -fmax(OVERLAP * fmax(high, -low), touching);
}

static inline bool overlap(const Facet *a, const Facet *b, double rounding)
{
    double touching = tolerance(a, b, NULL, rounding);
    for (int c = 0; c < a->corners; c++)
        if (beyond_edge(a, c, b, touching))
            return false;
    for (int c = 0; c < b->corners; c++)
        if (beyond_edge(b, c, a, touching))
            return false;
    return true;
}

/* Are they in one place, as far as rays can tell? The sides of one cube are not, however thin it is. */
static inline bool coincide(const Facet *a, const Facet *b, const double eye[3], double rounding)
{
    double apart[3], close = tolerance(a, b, eye, rounding);
    if (!a->corners != !b->corners || (a->shape == b->shape && a->corners != 3))
        return false;
    if (a->corners)
        return (lies_in(a, b, close) || lies_in(b, a, close)) && overlap(a, b, rounding);
    double turned[3];
    for (int i = 0; i < 3; i++)
        turned[i] = (dot(a->axis, b->axis) < 0 ? -1 : 1) * b->axis[i];
    difference(a->axis, turned, turned);
    difference(a->corner[0], b->corner[0], apart);
    return length(apart) + length(turned) + fabs(a->radius - b->radius) <= close;
}
