/* From a Description to a kernel's Scene, the shapes: tables in the kernel's precision, computed in double. */
#pragma once

#include "prepare/triangles.h"

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

static AlignedRow aligned_row_of(const Shape *shape, int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double(*m)[4] = shape->as.placed.to_world.m;
    return (AlignedRow){(Num)m[axis][3], (Num)m[u][3], (Num)m[v][3], (Num)(fabs(m[u][0]) + fabs(m[u][1])),
        (Num)(fabs(m[v][0]) + fabs(m[v][1])), {0}};
}

static int slots_of(ShapeKind kind) { return slots_of_planes(shape_planes(kind)); }

/* What a kernel takes it for. */
static ShapeKind kind_in_kernel(const Shape *shape) { return aligned_axis(shape) < 0 ? shape->kind : SHAPE_ALIGNED; }

static size_t row_size(ShapeKind kind)
{
    switch (kind) {
#define X(NAME, name, words)                                                                                 \
    case SHAPE_##NAME: return sizeof(struct name##_row);
        ALIGNED_SHAPES(X) FLAT_SHAPES(X) SOLID_SHAPES(X)
#undef X
    default: return 1;
    }
}

static void set_shape_row(void *rows, int place, const Shape *shape)
{
    ShapeKind kind = kind_in_kernel(shape);
    void *row = (char *)rows + (size_t)place * row_size(kind);
    switch (kind) {
#define X(NAME, name, words)                                                                                 \
    case SHAPE_##NAME: name##_row(&shape->as.name, row); break;
        FLAT_SHAPES(X) SOLID_SHAPES(X)
#undef X
    case SHAPE_ALIGNED: *(AlignedRow *)row = aligned_row_of(shape, aligned_axis(shape)); break;
    default: break;
    }
}

/* The numbers by slot that stand for its surface. */
static void set_anchors(Shapes *s, const Shape *shape, int slot)
{
    double anchor[4] = {0};
    for (int k = 0; k < shape_planes(shape->kind); k++) {
        plane_of(shape, k, anchor, &anchor[3]);
        store(s->anchor[slot + k], anchor);
        s->anchor[slot + k][3] = (Num)anchor[3];
    }
#define X(NAME, name, words)                                                                                 \
    if (shape->kind == SHAPE_##NAME) {                                                                       \
        name##_anchor(&shape->as.name, anchor);                                                              \
        store(s->anchor[slot], anchor);                                                                      \
        s->anchor[slot][3] = (Num)anchor[3];                                                                 \
    }
    ROUND_SHAPES(X)
#undef X
}

/* What (u, v) takes: between the world and the shape's own space. */
static void set_places(Shapes *s, const Shape *shape, int slot)
{
    const Affine *to_world = &shape->as.placed.to_world;
    Local own = local_of(to_world);
    for (int k = slot; k < slot + slots_of(shape->kind); k++) {
        memcpy(s->place[k], own.row, sizeof own.row);
        for (int i = 0; i < 12; i++)
            s->place[k][3 + i / 4][i % 4] = (Num)to_world->m[i / 4][i % 4];
    }
}

static void count_shapes(Shapes *s, const Description *d)
{
    for (int i = 0; i < d->shape_count; i++)
        s->count[kind_in_kernel(&d->shapes[i])]++;
    for (int kind = 0; kind < SHAPE_KINDS; kind++)
        s->first[kind + 1] = s->first[kind] + slots_of((ShapeKind)kind) * s->count[kind];
    s->slot_count = s->first[SHAPE_KINDS];
    for (int axis = 0; axis < 3; axis++) {
        s->along[axis + 1] = s->along[axis];
        for (int i = 0; i < d->shape_count; i++)
            s->along[axis + 1] += aligned_axis(&d->shapes[i]) == axis;
    }
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
        if (traits.position) {
            Extent ball = ball_extent(traits.position, traits.radius);
            see_side(&sides, normal, offset, ball.low, ball.high);
        }
    }
    Extent eye = ball_extent(sensor.origin, sensor.reach);
    see_side(&sides, normal, offset, eye.low, eye.high);
    return !(sides.below && sides.above);
}

/* A table of shapes that is being filled: from the front those that can block, from the back the others. */
typedef struct {
    int front, back;
} Filling;

static int next_place(Filling *filling, bool blocks) { return blocks ? filling->front++ : --filling->back; }

/* Places all shapes; first_slot[i] gets the first slot of shape i, or a mesh's row. */
static void place_shapes(Scene *scene, const Description *d, int *first_slot)
{
    Shapes *s = &scene->shapes;
    Filling of_kind[SHAPE_KINDS], of_axis[3];
    for (int kind = 0; kind < SHAPE_KINDS; kind++)
        of_kind[kind] = (Filling){0, s->count[kind]};
    for (int axis = 0; axis < 3; axis++)
        of_axis[axis] = (Filling){s->along[axis], s->along[axis + 1]};
    Extent *bounds = allocate((size_t)d->shape_count, sizeof *bounds);
    for (int i = 0; i < d->shape_count; i++)
        bounds[i] = shape_extent(&d->shapes[i]);
    for (int i = 0; i < d->shape_count; i++) {
        const Shape *shape = &d->shapes[i];
        ShapeKind kind = kind_in_kernel(shape);
        bool edge = shape_planes(shape->kind) == 1 && !(scene->features.has & (HAS_TREE | HAS_ANY(MEDIA)))
                    && at_the_edge(d, shape, bounds);
        Filling *filling = kind == SHAPE_ALIGNED ? &of_axis[aligned_axis(shape)] : &of_kind[kind];
        int place = next_place(filling, !edge);
        set_shape_row(s->rows[kind], place, shape);
        first_slot[i] = s->first[kind] + place * slots_of(kind);
        set_anchors(s, shape, first_slot[i]);
        if (scene->features.has & HAS_UV)
            set_places(s, shape, first_slot[i]);
    }
    free(bounds);
    for (int axis = 0; axis < 3; axis++)
        s->along_blocking[axis] = of_axis[axis].front;
    for (int kind = 0; kind < SHAPE_KINDS; kind++)
        s->blocking[kind] = of_kind[kind].front;
}

/* The stacks by slot. */
static void prepare_stacks(Scene *scene, const Description *d, const int *first_slot)
{
    StackTables *to = &scene->shapes.stacks;
    const Stacks *from = &d->stacks;
    int slots = scene->shapes.slot_count + d->mesh.triangle_count;
    Num(*up)[3] = keep(scene, (size_t)from->count, sizeof *up);
    to->count = from->count;
    to->of = keep(scene, (size_t)slots, sizeof *to->of);
    to->layer = keep(scene, (size_t)slots, sizeof *to->layer);
    to->facing = keep(scene, (size_t)slots, sizeof *to->facing);
    for (int i = 0; i < from->count; i++)
        store(up[i], from->up[i]);
    to->up = (const Num(*)[3])up;
    for (int slot = 0; slot < slots; slot++)
        to->of[slot] = from->count + slot;
    for (int i = 0, side = 0; i < d->shape_count; i++) {
        const Shape *shape = &d->shapes[i];
        int first = shape->kind == SHAPE_MESH ? scene->shapes.triangles.first_slot + shape->as.mesh.first_triangle
                                              : first_slot[i];
        for (int k = 0; k < shape_sides(shape); k++, side++) {
            if (from->of[side] >= 0)
                to->of[first + k] = from->of[side];
            to->layer[first + k] = from->layer[side];
            if (from->of[side] >= 0)
                store(to->facing[first + k], from->up[from->of[side]]);
            to->facing[first + k][3] = (Num)(from->beside[side][0] + 2 * from->beside[side][1]);
        }
    }
}

/* Fills the shape tables. */
static void prepare_shapes(Scene *scene, const Description *d, int *first_slot)
{
    Shapes *s = &scene->shapes;
    count_shapes(s, d);
    for (int kind = 0; kind < SHAPE_KINDS; kind++)
        s->rows[kind] = keep(scene, (size_t)s->count[kind], row_size((ShapeKind)kind));
    s->anchor = keep(scene, (size_t)s->slot_count, sizeof *s->anchor);
    s->shines = keep(scene, (size_t)s->slot_count, sizeof *s->shines);
    if (scene->features.has & HAS_UV)
        s->place = keep(scene, (size_t)s->slot_count, sizeof *s->place);
    place_shapes(scene, d, first_slot);
    prepare_triangles(scene, d, first_slot);
    if (scene->features.has & HAS_STACKS)
        prepare_stacks(scene, d, first_slot);
    if (scene->features.has & HAS_TREE)
        prepare_shape_tree(scene, d, first_slot);
}
