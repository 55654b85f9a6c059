/* From a Description to a kernel's Scene, the shapes: tables in the kernel's precision, computed in double. */
#ifndef ONERAY_PREPARE_SHAPES_H
#define ONERAY_PREPARE_SHAPES_H

#include "prepare/triangles.h"

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

/* The plane of side k: unit normal, outwards unless flip_normals turns it over, and n·p. */
static void plane_of(const Shape *shape, int k, double normal[3], double *offset)
{
    Side side = shape_side(shape, k);
    for (int i = 0; i < 3; i++)
        normal[i] = shape->as.placed.flip_normals ? -side.normal[i] : side.normal[i];
    *offset = dot(normal, side.middle);
}

/* The axis that a rectangle's normal lies along if its sides lie along the other two, else -1. */
static int aligned_axis(const Shape *shape)
{
    for (int axis = 0; axis < 3 && shape->kind == SHAPE_RECTANGLE; axis++) {
        int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const double(*m)[4] = shape->as.placed.to_world.m;
        int straight = m[u][1] == 0 && m[v][0] == 0, turned = m[u][0] == 0 && m[v][1] == 0;
        if (m[axis][0] == 0 && m[axis][1] == 0 && (straight || turned))
            return axis;
    }
    return -1;
}

static Aligned aligned_of(const Shape *shape, int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double(*m)[4] = shape->as.placed.to_world.m;
    return (Aligned){(Num)m[axis][3], (Num)m[u][3], (Num)m[v][3], (Num)(fabs(m[u][0]) + fabs(m[u][1])),
        (Num)(fabs(m[v][0]) + fabs(m[v][1]))};
}

static int slots_of(const Shape *shape) { return shape_planes(shape) ? shape_planes(shape) : 1; }

static void prepare_ball(Shapes *s, const Shape *shape, int slot)
{
    Ball *ball = &s->balls[slot - s->sphere_slot];
    ball->radius = (Num)shape->as.sphere.radius;
    store(ball->center, shape->as.sphere.center);
    store(s->anchor[slot], shape->as.sphere.center);
    s->anchor[slot][3] = shape->as.placed.flip_normals ? -ball->radius : ball->radius;
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

/* Does the box reach to both sides of the plane n·p = offset, by more than the rounding of the numbers? */
typedef struct {
    bool below, above;
} Sides;

static void see_side(Sides *sides, const double normal[3], double offset, const double low[3], const double high[3])
{
    double center = 0, reach = 0, size = fabs(offset);
    for (int i = 0; i < 3; i++) {
        center += normal[i] * (0.5 * low[i] + 0.5 * high[i]);
        reach += fabs(normal[i]) * (0.5 * high[i] - 0.5 * low[i]);
        size = fmax(size, fmax(fabs(low[i]), fabs(high[i])));
    }
    sides->below |= center - reach < offset - 4 * DBL_EPSILON * size;
    sides->above |= center + reach > offset + 4 * DBL_EPSILON * size;
}

/* Is everything that a ray to a light can start or end at on one side of the flat shape's plane? */
static bool at_the_edge(const Description *d, const Shape *flat, const Extent *bounds)
{
    Sides sides = {false, false};
    double normal[3], offset;
    SensorTraits sensor = sensor_traits(&d->sensor);
    plane_of(flat, 0, normal, &offset);
    for (int i = 0; i < d->shape_count; i++)
        if (&d->shapes[i] != flat)
            see_side(&sides, normal, offset, bounds[i].low, bounds[i].high);
    for (int i = 0; i < d->emitter_count; i++) {
        const Emitter *light = &d->emitters[i];
        EmitterTraits traits = emitter_traits(light);
        if (traits.from == FROM_AFAR || traits.from == FROM_AROUND)
            return false;
        if (traits.position)
            see_side(&sides, normal, offset, traits.position, traits.position);
    }
    see_side(&sides, normal, offset, sensor.origin, sensor.origin);
    return !(sides.below && sides.above);
}

/* A table of flat shapes that is being filled: from the front those that can block, from the back the others. */
typedef struct {
    int front, back;
} Filling;

static int next_place(Filling *filling, bool blocks) { return blocks ? filling->front++ : --filling->back; }

typedef struct {
    Filling aligned[3], rectangles, disks;
    int meshes;
} Fillings;

/* Puts the shape into its table; returns its first slot, or a mesh's row. */
static int place_shape(Shapes *s, const Shape *shape, bool blocks, Fillings *f)
{
    int axis = aligned_axis(shape), place;
    if (axis >= 0) {
        place = next_place(&f->aligned[axis], blocks);
        s->aligned[place] = aligned_of(shape, axis);
        return place;
    }
    switch (shape->kind) {
    case SHAPE_RECTANGLE:
        place = next_place(&f->rectangles, blocks);
        s->rectangles[place] = local_of(&shape->as.placed.to_world);
        return s->aligned_slot[3] + place;
    case SHAPE_DISK:
        place = next_place(&f->disks, blocks);
        s->disks[place] = local_of(&shape->as.placed.to_world);
        return s->disk_slot + place;
    case SHAPE_CUBE:
        s->cubes[s->cube_count] = local_of(&shape->as.placed.to_world);
        return s->cube_slot + 6 * s->cube_count++;
    case SHAPE_MESH: return s->mesh_row + f->meshes++;
    default:
        place = s->sphere_slot + s->sphere_count++;
        prepare_ball(s, shape, place);
        return place;
    }
}

/* Places all shapes; first_slot[i] gets the first slot of shape i. */
static void place_shapes(Scene *scene, const Description *d, int *first_slot)
{
    Shapes *s = &scene->shapes;
    Fillings f = {{{0, 0}, {0, 0}, {0, 0}}, {0, s->rectangle_count}, {0, s->disk_count}, 0};
    for (int axis = 0; axis < 3; axis++)
        f.aligned[axis] = (Filling){s->aligned_slot[axis], s->aligned_slot[axis + 1]};
    Extent *bounds = allocate((size_t)d->shape_count, sizeof *bounds);
    for (int i = 0; i < d->shape_count; i++)
        bounds[i] = shape_extent(&d->shapes[i]);
    for (int i = 0; i < d->shape_count; i++) {
        const Shape *shape = &d->shapes[i];
        bool flat = shape->kind == SHAPE_RECTANGLE || shape->kind == SHAPE_DISK;
        bool edge = flat && !(scene->features.has & HAS_TREE) && at_the_edge(d, shape, bounds);
        first_slot[i] = place_shape(s, shape, !edge, &f);
    }
    free(bounds);
    for (int axis = 0; axis < 3; axis++)
        s->aligned_blocking[axis] = f.aligned[axis].front;
    s->rectangle_blocking = f.rectangles.front;
    s->disk_blocking = f.disks.front;
}

/* Fills the shape tables. */
static void prepare_shapes(Scene *scene, const Description *d, int *first_slot)
{
    Shapes *s = &scene->shapes;
    int counts[SHAPE_KINDS] = {0};
    count_shapes(s, d, counts);
    s->aligned = keep(scene, (size_t)s->aligned_slot[3], sizeof(Aligned));
    s->rectangle_count = counts[SHAPE_RECTANGLE] - s->aligned_slot[3];
    s->disk_count = counts[SHAPE_DISK];
    s->rectangles = keep(scene, (size_t)s->rectangle_count, sizeof(Local));
    s->disks = keep(scene, (size_t)s->disk_count, sizeof(Local));
    s->cubes = keep(scene, (size_t)counts[SHAPE_CUBE], sizeof(Local));
    s->balls = keep(scene, (size_t)counts[SHAPE_SPHERE], sizeof(Ball));
    s->anchor = keep(scene, (size_t)s->slot_count, sizeof *s->anchor);
    s->shines = keep(scene, (size_t)s->slot_count, sizeof *s->shines);
    place_shapes(scene, d, first_slot);
    for (int i = 0; i < d->shape_count; i++) {
        const Shape *shape = &d->shapes[i];
        int slot = first_slot[i];
        for (int k = 0; k < shape_planes(shape); k++) {
            double normal[3], offset;
            plane_of(shape, k, normal, &offset);
            store(s->anchor[slot + k], normal);
            s->anchor[slot + k][3] = (Num)offset;
        }
    }
    prepare_triangles(scene, d, first_slot);
    if (scene->features.has & HAS_TREE)
        prepare_shape_tree(scene, d, first_slot);
}

#endif
