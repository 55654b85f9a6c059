/* Surfaces in one place: a lamp flush with the ceiling, glass on a table, a mesh whose faces are there twice.

   Rays cannot tell planes apart that are nearer to each other than the rounding of what is computed with them. Such
   surfaces, where they overlap, are a stack, and lie in it in layers, each by a number. Rays meet them in that order
   (shapes/stack.h): the scene is one in which they are a hair apart, and so the same scene for every estimator.

   Layers go by the distance of the planes where the file's numbers say one. Else every solid is a hair smaller than
   it is, so that a ray leaves one before it enters the next; between solids are surfaces that have no inside, each a hair
   in front of where it is; of those that face alike, what transmits is in front, then what shines, then what
   stands first in the file. Where these differ, that order is a guess, and a warning says so. */
#include "scene/stacks.h"

#include "scene/facets.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_WARNINGS = 8, PAIRS_TO_A_SIDE = 8 };

#define COMPARE(a, b) (((a) > (b)) - ((a) < (b)))

/* A shape as a whole. */
typedef struct {
    bool known, transmits;
    bool closed; /* and opaque: what is inside, where the camera is not, does not matter */
    double outward; /* of a closed shape: 1 if its normals point to where the camera is, else -1 */
} Body;

/* A side that is no triangle, and what may be in its place is in the box. */
typedef struct {
    TreeBox box;
    int shape, side;
} Item;

typedef struct {
    double normal[3];
    int shape;
} Triangle;

typedef struct {
    Description *d;
    const char *file;
    double rounding, eye[3];
    Body *bodies;
    Triangle *triangles;
    double slack; /* no two triangles in one place are farther apart */
    int64_t patience;
    int *first; /* by shape: its first side among all */
    int32_t *parent; /* by side: another of its stack, or itself */
    int side_count;
    int warned[MOST_WARNINGS][2], warnings; /* lines */
    int32_t (*pairs)[2]; /* of sides in one place */
    int pair_count;
    bool all_pairs; /* are those all? */
} Finder;

/* Bodies: which shapes have an inside, and whether the camera is in it. */

static bool transmits(const Description *d, int index)
{
    if (index == MATERIAL_NONE)
        return false;
    const Material *m = &d->materials[index];
    if (m->kind == MATERIAL_BLEND)
        return transmits(d, m->as.blend.first) || transmits(d, m->as.blend.second);
    return material_traits(m).transmitted != NULL;
}

/* A number for a corner at this place, and one for an edge that goes there from another. */
static uint64_t mixed(uint64_t a, uint64_t b)
{
    a = (a ^ (b + 0x9e3779b97f4a7c15u + (a << 6) + (a >> 2))) * 0xbf58476d1ce4e5b9u;
    return a ^ (a >> 29);
}
static uint64_t mark_of(const double p[3])
{
    uint64_t mark = 1, bits;
    for (int i = 0; i < 3; i++) {
        double x = p[i] + 0; /* one zero only */
        memcpy(&bits, &x, sizeof bits);
        mark = mixed(mark, bits);
    }
    return mark;
}

/* The solid angle that a triangle fills as seen from p, signed: van Oosterom, Strackee, The Solid Angle of a Plane
   Triangle, 1983. */
static double solid_angle(const double *const corner[3], const double p[3])
{
    double to[3][3], across[3], size[3];
    for (int c = 0; c < 3; c++) {
        difference(corner[c], p, to[c]);
        size[c] = length(to[c]);
    }
    cross(to[1], to[2], across);
    return 2
           * cr_atan2(dot(to[0], across), size[0] * size[1] * size[2] + dot(to[0], to[1]) * size[2]
                                           + dot(to[1], to[2]) * size[0] + dot(to[2], to[0]) * size[1]);
}

/* A mesh is closed if its edges come in pairs that run to and fro, and it has a volume. */
static void see_mesh(const Finder *finder, const MeshShape *mesh, Body *body)
{
    const Mesh *all = &finder->d->mesh;
    uint64_t unpaired = 0;
    double volume = 0, volumes = 0, angle = 0;
    for (int k = mesh->first_triangle; k < mesh->first_triangle + mesh->triangle_count; k++) {
        const double *corner[3];
        double a[3], b[3], across[3], from_first[3];
        for (int c = 0; c < 3; c++)
            corner[c] = all->vertex[all->triangle[k][c]];
        triangle_edges(all, k, 0, a, b, across);
        difference(corner[0], all->vertex[all->triangle[mesh->first_triangle][0]], from_first);
        volume += dot(from_first, across);
        volumes += length(from_first) * length(across);
        angle += solid_angle(corner, finder->eye);
        for (int c = 0; c < 3; c++) {
            uint64_t from = mark_of(corner[c]), to = mark_of(corner[(c + 1) % 3]);
            unpaired += mixed(from, to) - mixed(to, from);
        }
    }
    body->closed = unpaired == 0 && fabs(volume) > 1e-9 * volumes;
    body->outward = (volume < 0) == (fabs(angle) > 2 * PI) ? 1 : -1;
}

static const Body *body_of(const Finder *finder, int i)
{
    const Shape *shape = &finder->d->shapes[i];
    Body *body = &finder->bodies[i];
    bool inside = true;
    if (body->known)
        return body;
    *body = (Body){true, transmits(finder->d, shape->front) || transmits(finder->d, shape->back), false, 1};
    if (body->transmits)
        return body;
    if (shape->kind == SHAPE_MESH) {
        see_mesh(finder, &shape->as.mesh, body);
    } else if (shape->kind == SHAPE_SPHERE || shape_planes(shape->kind) > 1) {
        for (int k = 0; k < shape_sides(shape); k++) {
            Facet f = facet_of(finder->d, i, k);
            double away[3];
            difference(finder->eye, f.corner[0], away);
            inside = inside && (f.corners ? dot(f.normal, away) < 0 : length(away) < f.radius);
        }
        body->closed = true;
        body->outward = inside ? -1 : 1;
    }
    return body;
}

/* What transmits is a boundary by its normal; what is closed lies behind its side towards the camera; anything else has
   no inside. */
static bool is_solid(const Finder *finder, const Facet *f)
{
    return body_of(finder, f->shape)->transmits || body_of(finder, f->shape)->closed;
}

/* 1 or -1: from outwards to the side that counts as in front. */
static double front_of(const Finder *finder, const Facet *f)
{
    const Body *body = body_of(finder, f->shape);
    return body->closed ? body->outward : f->front;
}

static bool face_alike(const Finder *finder, const Facet *a, const Facet *b)
{
    double along = a->corners ? dot(a->normal, b->normal) : 1;
    return along * front_of(finder, a) * front_of(finder, b) > 0;
}

/* Is all of the scene, and the camera, behind the side of a solid? */
static bool all_behind(const Finder *finder, const Facet *f)
{
    double front = front_of(finder, f), close = tolerance(f, f, NULL, finder->rounding);
    for (int i = -1; i < finder->d->shape_count; i++) {
        Extent box = i < 0 ? (Extent){.least = 0} : shape_extent(&finder->d->shapes[i]);
        double far[3];
        for (int k = 0; k < 3; k++)
            far[k] = i < 0 ? finder->eye[k] : front * f->normal[k] > 0 ? box.high[k] : box.low[k];
        if (front * height_over(f, far) > close)
            return false;
    }
    return true;
}

/* Can no ray that matters get between them? Two solids have only each other in front; and what a closed one stands on
   is seen from nowhere if nothing is on its other side. */
static bool is_hidden(const Finder *finder, const Facet *a, const Facet *b)
{
    const Body *one = body_of(finder, a->shape), *other = body_of(finder, b->shape);
    if (one->transmits || other->transmits || !(one->closed || other->closed))
        return false;
    if (one->closed && other->closed)
        return !face_alike(finder, a, b);
    return all_behind(finder, one->closed ? a : b);
}

static bool emits(const Description *d, int shape)
{
    int emitter = d->shapes[shape].emitter;
    return emitter >= 0 && emitter_has_power(&d->emitters[emitter]);
}

static bool same_material(const Description *d, int a, int b)
{
    if (a == b || a == MATERIAL_NONE || b == MATERIAL_NONE)
        return a == b;
    const Material *one = &d->materials[a], *other = &d->materials[b];
    return one->kind == other->kind && !memcmp(&one->as, &other->as, sizeof one->as);
}

static bool look_alike(const Description *d, int a, int b)
{
    static const double dark[3] = {0};
    const Shape *one = &d->shapes[a], *other = &d->shapes[b];
    const double *light = emits(d, a) ? emitter_traits(&d->emitters[one->emitter]).emission : dark;
    const double *more = emits(d, b) ? emitter_traits(&d->emitters[other->emitter]).emission : dark;
    return !memcmp(light, more, sizeof dark) && same_material(d, one->front, other->front)
           && same_material(d, one->back, other->back) && one->exterior == other->exterior
           && one->interior == other->interior;
}

/* Of those that face alike in one place the least is in front; of equals that which stands first in the file. */
static int rank_of(const Finder *finder, int shape)
{
    return body_of(finder, shape)->transmits ? 0 : emits(finder->d, shape) ? 1 : 2;
}

/* Is a in front of b, of two that face alike in one place? What has no inside is in front of a solid that does not
   shine. */
static bool comes_first(const Finder *finder, const Facet *a, const Facet *b)
{
    int solid = is_solid(finder, a) - is_solid(finder, b);
    if (solid && !emits(finder->d, solid > 0 ? a->shape : b->shape))
        return solid < 0;
    int order = rank_of(finder, a->shape) - rank_of(finder, b->shape);
    return order ? order < 0 : a->shape < b->shape;
}

/* Do the file's numbers say how far apart they are? */
static bool apart_in_file(const Facet *a, const Facet *b)
{
    const Facet *wide = width_of(a) > width_of(b) ? a : b, *other = wide == a ? b : a;
    double apart = a->corners ? height_over(wide, other->corner[0]) : a->radius - b->radius;
    return fabs(apart) > tolerance(a, b, NULL, DBL_EPSILON / 2);
}

/* Where two that face alike differ, and are at one height, the file does not say which is in front. */
static void warn_of_order(Finder *finder, const Facet *a, const Facet *b)
{
    const Description *d = finder->d;
    bool shines = emits(d, a->shape) || emits(d, b->shape);
    if (look_alike(d, a->shape, b->shape) || (is_solid(finder, a) != is_solid(finder, b) && !shines)
        || !face_alike(finder, a, b) || apart_in_file(a, b))
        return;
    bool first = comes_first(finder, a, b);
    const Shape *one = &d->shapes[first ? a->shape : b->shape];
    int front = one->line, behind = d->shapes[first ? b->shape : a->shape].line;
    for (int i = 0; i < finder->warnings; i++)
        if (finder->warned[i][0] == front && finder->warned[i][1] == behind)
            return;
    if (finder->warnings == MOST_WARNINGS)
        return;
    finder->warned[finder->warnings][0] = front;
    finder->warned[finder->warnings++][1] = behind;
    note(one, "this surface and that of line %d are in one place, face the same way and differ: this one is taken to be in front",
         behind);
}

static int32_t root_of(int32_t *parent, int32_t i)
{
    for (; parent[i] != i; i = parent[i])
        parent[i] = parent[parent[i]];
    return i;
}

static void test_pair(Finder *finder, const Facet *a, const Facet *b)
{
    if (!coincide(a, b, finder->eye, finder->rounding))
        return;
    int32_t one = finder->first[a->shape] + a->side, other = finder->first[b->shape] + b->side;
    finder->all_pairs = finder->all_pairs && finder->pair_count < PAIRS_TO_A_SIDE * finder->side_count;
    if (finder->all_pairs) {
        finder->pairs = room_for(finder->pairs, finder->pair_count, sizeof *finder->pairs);
        finder->pairs[finder->pair_count][0] = one;
        finder->pairs[finder->pair_count++][1] = other;
    }
    if (is_hidden(finder, a, b))
        return;
    one = root_of(finder->parent, one);
    other = root_of(finder->parent, other);
    finder->parent[one > other ? one : other] = one > other ? other : one;
    warn_of_order(finder, a, b);
}

static Facet facet_of_triangle(const Finder *finder, int t)
{
    int shape = finder->triangles[t].shape;
    return facet_of(finder->d, shape, t - finder->d->shapes[shape].as.mesh.first_triangle);
}

/* Is a corner of triangle b off the plane of a? */
static bool leaves_plane(const Finder *finder, int a, int b)
{
    const Mesh *mesh = &finder->d->mesh;
    const double *n = finder->triangles[a].normal, *p = mesh->vertex[mesh->triangle[a][0]];
    for (int c = 0; c < 3; c++) {
        const double *q = mesh->vertex[mesh->triangle[b][c]];
        if (fabs(n[0] * (q[0] - p[0]) + n[1] * (q[1] - p[1]) + n[2] * (q[2] - p[2])) > finder->slack)
            return true;
    }
    return false;
}

static bool test_triangles(void *to, int one, int other)
{
    Finder *finder = to;
    if (leaves_plane(finder, one, other) && leaves_plane(finder, other, one))
        return false;
    Facet a = facet_of_triangle(finder, one < other ? one : other);
    Facet b = facet_of_triangle(finder, one < other ? other : one);
    test_pair(finder, &a, &b);
    return false;
}

/* Triangles near a side of another shape. */
typedef struct {
    Finder *finder;
    const Item *item;
    Facet facet;
} Query;

static bool may_touch(const void *query, const TreeBox *box)
{
    const Query *q = query;
    return !boxes_apart(box, &q->item->box, q->finder->slack);
}

static bool test_triangle(void *query, int t)
{
    Query *q = query;
    Facet f = facet_of_triangle(q->finder, t);
    test_pair(q->finder, &q->facet, &f);
    return false;
}

static int by_low(const void *a, const void *b)
{
    const Item *p = a, *q = b;
    int order = COMPARE(p->box.low[0], q->box.low[0]);
    order = order ? order : COMPARE(p->shape, q->shape);
    return order ? order : COMPARE(p->side, q->side);
}

/* Sides that are no triangles: with each other by a sweep along x, with triangles by their tree. */
static void test_items(Finder *finder, Item *items, int count)
{
    qsort(items, (size_t)count, sizeof *items, by_low);
    for (int i = 0; i < count; i++) {
        Query q = {finder, &items[i], facet_of(finder->d, items[i].shape, items[i].side)};
        for (int k = i + 1; k < count && items[k].box.low[0] <= items[i].box.high[0]; k++)
            if (!boxes_apart(&items[i].box, &items[k].box, 0)) {
                Facet f = facet_of(finder->d, items[k].shape, items[k].side);
                test_pair(finder, &q.facet, &f);
            }
        mesh_tree_visit(&finder->d->mesh_tree, &finder->patience, &q, may_touch, &q, test_triangle);
    }
}

static void set_triangles(Finder *finder, int shape)
{
    const MeshShape *mesh = &finder->d->shapes[shape].as.mesh;
    for (int t = mesh->first_triangle; t < mesh->first_triangle + mesh->triangle_count; t++) {
        double a[3], b[3];
        triangle_edges(&finder->d->mesh, t, 0, a, b, finder->triangles[t].normal);
        unit(finder->triangles[t].normal, finder->triangles[t].normal);
        finder->triangles[t].shape = shape;
    }
}

/* A triangle, and a number for its corners in any order. */
typedef struct {
    uint64_t mark;
    int triangle;
} Mark;

static int by_mark(const void *a, const void *b)
{
    const Mark *p = a, *q = b;
    int order = COMPARE(p->mark, q->mark);
    return order ? order : COMPARE(p->triangle, q->triangle);
}

/* Where there are too many pairs: at least the triangles that are the same. */
static void test_equal_triangles(Finder *finder)
{
    const Mesh *mesh = &finder->d->mesh;
    Mark *marks = allocate((size_t)mesh->triangle_count, sizeof *marks);
    for (int t = 0; t < mesh->triangle_count; t++) {
        marks[t].triangle = t;
        for (int c = 0; c < 3; c++)
            marks[t].mark += mark_of(mesh->vertex[mesh->triangle[t][c]]);
    }
    qsort(marks, (size_t)mesh->triangle_count, sizeof *marks, by_mark);
    for (int i = 1; i < mesh->triangle_count; i++)
        if (marks[i].mark == marks[i - 1].mark)
            test_triangles(finder, marks[i - 1].triangle, marks[i].triangle);
    free(marks);
    warn("%s: triangles lie close to thousands of others each: of those that overlap in one place, some that are not "
         "equal may not have been noticed",
        finder->file);
}

/* All pairs of sides that may be in one place. */
static void search(Finder *finder)
{
    const Description *d = finder->d;
    const MeshTree *tree = &d->mesh_tree;
    int count = 0;
    Item *items = allocate((size_t)(finder->side_count - d->mesh.triangle_count), sizeof *items);
    finder->triangles = allocate((size_t)d->mesh.triangle_count, sizeof *finder->triangles);
    for (int i = 0; i < d->shape_count; i++)
        if (d->shapes[i].kind == SHAPE_MESH)
            set_triangles(finder, i);
        else
            for (int k = 0; k < shape_sides(&d->shapes[i]); k++) {
                Facet f = facet_of(d, i, k);
                double slack = tolerance(&f, &f, finder->eye, finder->rounding);
                items[count++] = (Item){box_around(&f, slack), i, k};
            }
    double reach = fmax(extent_of(finder->eye), fmax(extent_of(tree->all.low), extent_of(tree->all.high)));
    finder->slack = 8 * finder->rounding * reach;
    finder->patience = mesh_tree_patience(tree);
    test_items(finder, items, count);
    if (d->mesh.triangle_count)
        mesh_tree_pairs(tree, &finder->patience, &d->mesh, finder->slack, finder, test_triangles);
    if (finder->patience < 0) {
        finder->all_pairs = false;
        test_equal_triangles(finder);
    }
    free(items);
    free(finder->triangles);
}

/* Layers. */

/* A surface in its stack, and by what its layer goes, most important first. */
typedef struct {
    int32_t stack;
    int group; /* of those that are at one height, along the stack's normal */
    int class; /* of that: 0 solids that are below, 1 what faces down, 2 what faces up, 3 solids above */
    int rank, shape, side;
    bool up; /* it faces along the normal */
    double height, doubt;
} Member;

static int by_height(const void *a, const void *b)
{
    const Member *p = a, *q = b;
    int order = COMPARE(p->stack, q->stack);
    order = order ? order : COMPARE(p->height, q->height);
    order = order ? order : COMPARE(p->shape, q->shape);
    return order ? order : COMPARE(p->side, q->side);
}

static int by_layer(const void *a, const void *b)
{
    const Member *p = a, *q = b;
    int order = COMPARE(p->group, q->group), sign = p->up ? -1 : 1;
    order = order ? order : COMPARE(p->class, q->class);
    order = order ? order : sign * COMPARE(p->rank, q->rank);
    order = order ? order : sign * COMPARE(p->shape, q->shape);
    return order ? order : sign * COMPARE(p->side, q->side);
}

static Facet widest_of(const Finder *finder, const Member *members, int count)
{
    Facet widest = facet_of(finder->d, members[0].shape, members[0].side);
    for (int i = 1; i < count; i++) {
        Facet f = facet_of(finder->d, members[i].shape, members[i].side);
        if (width_of(&f) > width_of(&widest))
            widest = f;
    }
    return widest;
}

/* Heights are measured from the widest member, whose normal is known best. */
static void measure_members(const Finder *finder, Member *members, int count, const Facet *widest)
{
    for (int i = 0; i < count; i++) {
        Member *m = &members[i];
        Facet f = facet_of(finder->d, m->shape, m->side);
        double along = f.corners ? dot(f.normal, widest->normal) : 1;
        m->up = along * front_of(finder, &f) > 0;
        m->class = is_solid(finder, &f) ? (m->up ? 0 : 3) : m->up ? 2 : 1;
        m->rank = rank_of(finder, m->shape);
        m->height = f.corners ? height_over(widest, f.corner[0]) : f.radius;
        m->doubt = tolerance(widest, &f, NULL, DBL_EPSILON / 2);
    }
    qsort(members, (size_t)count, sizeof *members, by_height);
    for (int i = 1; i < count; i++) {
        double apart = members[i].height - members[i - 1].height;
        members[i].group = members[i - 1].group + (apart > fmax(members[i].doubt, members[i - 1].doubt));
    }
}

/* A solid that shines is in front of what has no inside and faces alike: among that, if there is any at its height. */
static void raise_lamps(Member *members, int count)
{
    for (int i = 0, first = 0; i < count; i++) {
        Member *m = &members[i];
        int open = m->up ? 2 : 1;
        first = m->group == members[first].group ? first : i;
        for (int k = first; m->rank == 1 && k < count && members[k].group == m->group; k++)
            if (members[k].class == open)
                m->class = open;
    }
}

/* The members of one stack. */
static void set_layers(Finder *finder, Member *members, int count, int stack)
{
    Stacks *stacks = &finder->d->stacks;
    Facet widest = widest_of(finder, members, count);
    measure_members(finder, members, count, &widest);
    raise_lamps(members, count);
    qsort(members, (size_t)count, sizeof *members, by_layer);
    for (int i = 0, layer = 0; i < count; i++) {
        const Member *m = &members[i], *last = i ? m - 1 : m;
        bool twins = m->group == last->group && m->class == last->class && m->rank == 0 && last->rank == 0;
        int side = finder->first[m->shape] + m->side;
        layer += !twins;
        stacks->of[side] = stack;
        stacks->layer[side] = layer;
    }
    memcpy(stacks->up[stack], widest.normal, sizeof widest.normal);
}

/* On which sides of each are others of its stack. */
static void see_neighbours(const Finder *finder)
{
    const Stacks *stacks = &finder->d->stacks;
    for (int i = 0; i < finder->side_count && !finder->all_pairs; i++)
        stacks->beside[i][0] = stacks->beside[i][1] = stacks->of[i] >= 0;
    for (int i = 0; i < finder->pair_count; i++) {
        int32_t one = finder->pairs[i][0], other = finder->pairs[i][1];
        if (stacks->of[one] < 0 || stacks->of[one] != stacks->of[other])
            continue;
        bool below = stacks->layer[one] <= stacks->layer[other], above = stacks->layer[one] >= stacks->layer[other];
        stacks->beside[one][1] |= below;
        stacks->beside[other][0] |= below;
        stacks->beside[one][0] |= above;
        stacks->beside[other][1] |= above;
    }
}

static void lay_stacks(Finder *finder)
{
    Stacks *stacks = &finder->d->stacks;
    int sides = finder->side_count, count = 0;
    int32_t *size = allocate((size_t)sides, sizeof *size);
    for (int i = 0; i < sides; i++)
        count += size[root_of(finder->parent, i)]++ == 1;
    if (count) {
        int member_count = 0;
        Member *members = allocate((size_t)sides, sizeof *members);
        stacks->of = allocate((size_t)sides, sizeof *stacks->of);
        stacks->layer = allocate((size_t)sides, sizeof *stacks->layer);
        stacks->beside = allocate((size_t)sides, sizeof *stacks->beside);
        stacks->up = allocate((size_t)count, sizeof *stacks->up);
        for (int i = 0, side = 0; i < finder->d->shape_count; i++)
            for (int k = 0; k < shape_sides(&finder->d->shapes[i]); k++, side++) {
                int32_t root = root_of(finder->parent, side);
                stacks->of[side] = -1;
                if (size[root] > 1)
                    members[member_count++] = (Member){.stack = root, .shape = i, .side = k};
            }
        qsort(members, (size_t)member_count, sizeof *members, by_height);
        for (int i = 0; i < member_count; i += size[members[i].stack])
            set_layers(finder, members + i, size[members[i].stack], stacks->count++);
        see_neighbours(finder);
        free(members);
    }
    free(size);
}

void find_stacks(Description *d, const char *file, double rounding)
{
    Finder finder = {.d = d, .file = file, .rounding = rounding, .all_pairs = true};
    int shapes = d->shape_count, side = 0;
    memcpy(finder.eye, sensor_traits(&d->sensor).origin, sizeof finder.eye);
    finder.bodies = allocate((size_t)shapes, sizeof *finder.bodies);
    finder.first = allocate((size_t)shapes, sizeof *finder.first);
    for (int i = 0; i < shapes; i++) {
        finder.first[i] = finder.side_count;
        finder.side_count += shape_sides(&d->shapes[i]);
    }
    finder.parent = allocate((size_t)finder.side_count, sizeof *finder.parent);
    for (; side < finder.side_count; side++)
        finder.parent[side] = side;
    search(&finder);
    lay_stacks(&finder);
    free(finder.parent);
    free(finder.pairs);
    free(finder.bodies);
    free(finder.first);
}
