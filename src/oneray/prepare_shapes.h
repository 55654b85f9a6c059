/* From a Description to a kernel's Scene, the shapes: tables in the kernel's precision, computed in double. */
#ifndef ONERAY_PREPARE_SHAPES_H
#define ONERAY_PREPARE_SHAPES_H

#include "prepare_triangles.h"

/* The rows that take the world to the unit shape: with columns a, b, c of the matrix, row 0 is b×c /
   (a·b×c). */
static Local local_of(const Affine *to_world)
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

/* The plane of the unit shape's side where local coordinate `axis` is `at` (0 for a flat shape): outward unit
   normal, turned over by flip_normals, and n·p. */
static void plane_of(const Shape *shape, int axis, double at, double normal[3], double *offset)
{
    double a[3], b[3], c[3], p[3];
    column(&shape->to_world, (axis + 1) % 3, a);
    column(&shape->to_world, (axis + 2) % 3, b);
    column(&shape->to_world, axis, c);
    column(&shape->to_world, 3, p);
    cross(a, b, normal);
    double sign =
        (at < 0 ? -1 : 1) * (dot(normal, c) < 0 ? -1 : 1) * (shape->flip_normals ? -1 : 1) / length(normal);
    for (int i = 0; i < 3; i++) {
        normal[i] *= sign;
        p[i] += at * c[i];
    }
    *offset = dot(normal, p);
}

/* The axis that a rectangle's normal lies along if its sides lie along the other two, else -1. */
static int aligned_axis(const Shape *shape)
{
    for (int axis = 0; axis < 3 && shape->kind == SHAPE_RECTANGLE; axis++) {
        int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const double(*m)[4] = shape->to_world.m;
        int straight = m[u][1] == 0 && m[v][0] == 0, turned = m[u][0] == 0 && m[v][1] == 0;
        if (m[axis][0] == 0 && m[axis][1] == 0 && (straight || turned))
            return axis;
    }
    return -1;
}

static Aligned aligned_of(const Shape *shape, int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double(*m)[4] = shape->to_world.m;
    return (Aligned){(Num)m[axis][3], (Num)m[u][3], (Num)m[v][3], (Num)(fabs(m[u][0]) + fabs(m[u][1])),
        (Num)(fabs(m[v][0]) + fabs(m[v][1]))};
}

static int slots_of(ShapeKind kind) { return kind == SHAPE_CUBE ? 6 : 1; }

static void prepare_ball(Shapes *s, const Shape *shape, int slot)
{
    Ball *ball = &s->balls[slot - s->sphere_slot];
    double axis[3];
    column(&shape->to_world, 0, axis);
    ball->radius = (Num)length(axis);
    column(&shape->to_world, 3, axis);
    store(ball->center, axis);
    store(s->anchor[slot], axis);
    s->offset[slot] = shape->flip_normals ? -ball->radius : ball->radius;
}

static void count_shapes(Shapes *s, const Description *d, int counts[SHAPE_KINDS])
{
    int aligned = 0;
    for (int i = 0; i < d->shape_count; i++)
        counts[d->shapes[i].kind]++;
    for (int axis = 0; axis < 3; axis++) {
        s->aligned_slot[axis] = aligned;
        for (int i = 0; i < d->shape_count; i++)
            aligned += aligned_axis(&d->shapes[i]) == axis;
    }
    s->aligned_slot[3] = aligned;
    s->disk_slot = counts[SHAPE_RECTANGLE];
    s->cube_slot = s->disk_slot + counts[SHAPE_DISK];
    s->sphere_slot = s->cube_slot + 6 * counts[SHAPE_CUBE];
    s->mesh_row = s->sphere_slot + counts[SHAPE_SPHERE];
    s->slot_count = s->mesh_row + counts[SHAPE_MESH];
}

/* Puts the shape into its table; returns its first slot, or a mesh's row. filled[axis] counts the aligned
   rectangles so far. */
static int place_shape(Shapes *s, const Shape *shape, int filled[3], int *meshes)
{
    int axis = aligned_axis(shape), slot;
    if (axis >= 0) {
        slot = s->aligned_slot[axis] + filled[axis]++;
        s->aligned[slot] = aligned_of(shape, axis);
        return slot;
    }
    switch (shape->kind) {
    case SHAPE_RECTANGLE:
        s->rectangles[s->rectangle_count] = local_of(&shape->to_world);
        return s->aligned_slot[3] + s->rectangle_count++;
    case SHAPE_DISK:
        s->disks[s->disk_count] = local_of(&shape->to_world);
        return s->disk_slot + s->disk_count++;
    case SHAPE_CUBE:
        s->cubes[s->cube_count] = local_of(&shape->to_world);
        return s->cube_slot + 6 * s->cube_count++;
    case SHAPE_MESH: return s->mesh_row + (*meshes)++;
    default:
        slot = s->sphere_slot + s->sphere_count++;
        prepare_ball(s, shape, slot);
        return slot;
    }
}

/* Fills the shape tables; first_slot[i] gets the first slot of shape i. */
static void prepare_shapes(Scene *scene, const Description *d, int *first_slot)
{
    Shapes *s = &scene->shapes;
    int counts[SHAPE_KINDS] = {0}, filled[3] = {0}, meshes = 0;
    count_shapes(s, d, counts);
    s->aligned = keep(scene, (size_t)s->aligned_slot[3], sizeof(Aligned));
    s->rectangles = keep(scene, (size_t)(counts[SHAPE_RECTANGLE] - s->aligned_slot[3]), sizeof(Local));
    s->disks = keep(scene, (size_t)counts[SHAPE_DISK], sizeof(Local));
    s->cubes = keep(scene, (size_t)counts[SHAPE_CUBE], sizeof(Local));
    s->balls = keep(scene, (size_t)counts[SHAPE_SPHERE], sizeof(Ball));
    s->anchor = keep(scene, (size_t)s->slot_count, sizeof *s->anchor);
    s->offset = keep(scene, (size_t)s->slot_count, sizeof *s->offset);
    s->shines = keep(scene, (size_t)s->slot_count, sizeof *s->shines);
    for (int i = 0; i < d->shape_count; i++) {
        const Shape *shape = &d->shapes[i];
        int slot = first_slot[i] = place_shape(s, shape, filled, &meshes);
        bool has_planes = shape->kind != SHAPE_SPHERE && shape->kind != SHAPE_MESH;
        for (int k = 0; has_planes && k < slots_of(shape->kind); k++) {
            int axis = shape->kind == SHAPE_CUBE ? k / 2 : 2;
            double at = shape->kind == SHAPE_CUBE ? 1 - 2 * (k % 2) : 0;
            double normal[3], offset;
            plane_of(shape, axis, at, normal, &offset);
            store(s->anchor[slot + k], normal);
            s->offset[slot + k] = (Num)offset;
        }
    }
    prepare_triangles(scene, d, first_slot);
    if (scene->features & HAS_TREE)
        prepare_shape_tree(scene, d, first_slot);
}

#endif
