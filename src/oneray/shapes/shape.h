/* Shapes, and what a ray meets of each: W rays at once. meet.h looks at all of them.

   No epsilon keeps a ray off the surface that it starts from: the ray knows which primitive that is. A flat
   one is left out; from a sphere or cube only the far side can be met, and only by a ray that goes inwards. Other
   surfaces in the same place are met in the order of their layers (stack.h).

   A slot is what a ray can hit: a rectangle (those along the axes first), a disk, one of a cube's six faces,
   a sphere, a triangle, numbered in the order of SHAPES in kinds.h. Tables by slot have a row for each, except that
   the triangles of a mesh share one, after all others.

   shapes/NAME.h defines, for a kind of that list,
     Name, name_plugin    what a scene file says of it, and what is asked of that: bounds, sides, size
     name_planes          how many slots it has, if they are flat; else 0
     NameRow, name_row    its numbers as a kernel has them, and how they come about
     name_sample          a uniform point of it, by area (a cube shines as six rectangles)
     name_uv              the frame at a point of it, all in its own space: of which slot, counted from the kind's first
   and for FLAT_SHAPES
     name_cross           where a ray crosses its plane, and whether within it
   for SOLID_SHAPES
     name_meets           where a ray meets it first
     name_blocks          whether it is in a ray's way
     name_through         where a ray from one of its slots, or from elsewhere, is in it, and by which it comes and goes
   for ROUND_SHAPES
     name_anchor          four numbers that stand for its surface, and
     name_surface         by them, or by its numbers, the point of it and its normal. */
#pragma once

#include "lanes/sample.h"
#include "shapes/frame.h"
#include "shapes/mesh.h"
#include "shapes/placed.h"
#include "shapes/stack.h"

#ifdef SINGLE
#define NEARLY_PARALLEL 1e-30
#else
#define NEARLY_PARALLEL 1e-240
#endif

/* World to the unit shape: local coordinate i of p is row[i][0..2]·p + row[i][3]. */
typedef struct {
    Num row[3][4];
} Local;

typedef struct {
    int first[SHAPE_KINDS + 1]; /* slots by kind: those of kind k from first[k] to first[k + 1]; a mesh has one row */
    int count[SHAPE_KINDS];
    int blocking[SHAPE_KINDS]; /* of the flat ones those that can be between two points of the scene come first, so
                                  many; of the others' planes, all of the scene lies on one side */
    void *rows[SHAPE_KINDS];   /* by kind, [count] of its NameRow */
    int along[4], along_blocking[3]; /* rectangles along the axes: x, y, z from along[0], [1], [2], and the end of those
                                        that can block */
    int slot_count;                  /* rows of the tables by slot */
    Triangles triangles;
    Tree tree; /* of all shapes but meshes, where they are too many for a loop; -2 - leaf is the shape's first slot */
    Num (*anchor)[4]; /* by slot: the unit normal n of a flat primitive and n·p of its plane; the center of a
                         sphere or cylinder and its radius, negative if flip_normals */
    Int *shines;      /* by slot: is there an area light, even one of no power? */
    StackTables stacks; /* HAS_STACKS */
    Num (*place)[6][4]; /* HAS_UV, by slot: the rows from the world to its own space, and back */
} Shapes;

/* The rows that take the world to the unit shape: with columns a, b, c of the matrix, row 0 is b×c / (a·b×c). */
static inline Local local_of(const Affine *to_world)
{
    Local local;
    double columns[3][3], origin[3];
    for (int j = 0; j < 3; j++)
        column(to_world, j, columns[j]);
    column(to_world, 3, origin);
    for (int i = 0; i < 3; i++) {
        double row[3];
        cross(columns[(i + 1) % 3], columns[(i + 2) % 3], row);
        double determinant = dot(columns[i], row);
        for (int j = 0; j < 3; j++) {
            row[j] /= determinant;
            local.row[i][j] = (Num)row[j];
        }
        local.row[i][3] = (Num)-dot(row, origin);
    }
    return local;
}

#define ROWS(shapes, NAME, Name) ((const Name##Row *)(shapes)->rows[SHAPE_##NAME])

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

/* The stretch near < t < far of the ray inside a convex solid: does it come in there, and out? Of a cylinder, which has
   no ends, it may do one of both. */
typedef struct {
    Real near, far;
    Mask entered, left;
} Stretch;

/* What the ray meets of a solid: the near side, or from inside the far one. */
INLINE Real stretch_hit(Stretch s, Mask on) { return select(and_not(s.near > real(0), on), s.near, s.far); }

/* Is the solid in the way of the ray's end at tmax, a point of it where `is_target`? That point is seen from
   outside if it is on the near side, and from inside always. */
INLINE Mask stretch_blocks(Stretch s, const Ray *ray, Mask on, Mask is_target)
{
    Real t = stretch_hit(s, on);
    Mask other = (t > real(0)) & (t < ray->tmax);
    Mask itself = and_not((s.near > real(0)) & (s.near + s.far < ray->tmax + ray->tmax), on);
    return s.entered & ((is_target & itself) | and_not(other, is_target));
}

/* hide_emitters: the lanes that `hiding` names, those of camera rays, pass the shapes that shine. */
INLINE Mask can_meet(const Shapes *shapes, int slot, Mask hiding, Features f)
{
    return f.has & HAS_HIDDEN && shapes->shines[slot] ? mask_not(hiding) : mask_all();
}
