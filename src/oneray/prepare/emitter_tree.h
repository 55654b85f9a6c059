/* From a Description to a kernel's Scene: the tree of lights, which the choice by contribution walks down. */
#pragma once

#include "prepare/shapes.h"

/* What the tree of lights knows of one. */
typedef struct {
    int emitter;
    double center[3], radius;
    double axis[3], spread; /* the cone around what it shines along, half its angle; π: all around */
    double power, far;      /* W·sr⁻¹, W·m⁻² */
    double key;             /* to sort by */
} Leaf;

/* A side of a shape, which shines to one side if it is flat. */
static void set_side(Leaf *leaf, const Emitters *emitters, int i)
{
    double x[3], y[3];
    if (emitters->shape[i] == SHAPE_SPHERE) {
        leaf->radius = fabs((double)emitters->radius[i]);
        leaf->power *= PI * leaf->radius * leaf->radius;
        return;
    }
    if (emitters->shape[i] == SHAPE_CYLINDER) { /* a convex body shows a quarter of its area, in the mean */
        for (int c = 0; c < 3; c++)
            x[c] = (double)emitters->normal[i][c];
        leaf->radius = cr_hypot((double)emitters->radius[i], length(x));
        leaf->power *= (double)emitters->area[i] / 4;
        return;
    }
    for (int c = 0; c < 3; c++) {
        leaf->axis[c] = (double)emitters->normal[i][c];
        x[c] = (double)emitters->edge_x[i][c];
        y[c] = (double)emitters->edge_y[i][c];
    }
    leaf->radius = length(x) + length(y);
    leaf->spread = 0;
    leaf->power *= (double)emitters->area[i];
}

/* largest: the largest emission, which powers are relative to, so that none overflows. Light from afar is the
   irradiance of a plane across it, or of one under half the sky. */
static Leaf leaf_of(const Emitters *emitters, int i, const EmitterTraits *traits, double largest)
{
    Leaf leaf = {.emitter = i, .axis = {0, 0, 1}, .spread = PI, .radius = (double)emitters->radius[i]};
    bool far = traits->from == FROM_AFAR || traits->from == FROM_AROUND;
    for (int c = 0; c < 3; c++) {
        leaf.center[c] = (double)(far ? emitters->world_center : emitters->position[i])[c];
        leaf.power += (double)emitters->emission[i][c] / largest / 3;
    }
    if (traits->from == FROM_SHAPE)
        set_side(&leaf, emitters, i);
    if (traits->from == FROM_POINT && traits->direction) {
        for (int c = 0; c < 3; c++)
            leaf.axis[c] = (double)emitters->edge_x[i][c];
        leaf.spread = (double)emitters->cutoff[i];
    }
    if (far) {
        leaf.far = leaf.power * (traits->from == FROM_AROUND ? PI : 1);
        leaf.power = 0;
    }
    return leaf;
}

/* The ball around the balls of the leaves, about the middle of their centers. */
static double ball_around(const Leaf *leaves, int count, double center[3], double extent[3])
{
    double radius = 0;
    for (int c = 0; c < 3; c++) {
        double low = leaves[0].center[c], high = low;
        for (int i = 1; i < count; i++) {
            low = fmin(low, leaves[i].center[c]);
            high = fmax(high, leaves[i].center[c]);
        }
        center[c] = (low + high) / 2;
        extent[c] = high - low;
    }
    for (int i = 0; i < count; i++) {
        double away[3] = {leaves[i].center[0] - center[0], leaves[i].center[1] - center[1],
            leaves[i].center[2] - center[2]};
        radius = fmax(radius, length(away) + leaves[i].radius);
    }
    return radius;
}

/* The cone around the cones of the leaves, about the mean of their axes. */
static double cone_around(const Leaf *leaves, int count, double axis[3])
{
    double spread = 0, sum[3] = {0};
    for (int i = 0; i < count; i++)
        for (int c = 0; c < 3; c++)
            sum[c] += leaves[i].axis[c];
    double size = length(sum);
    for (int c = 0; c < 3; c++)
        axis[c] = size > 1e-6 * count ? sum[c] / size : leaves[0].axis[c];
    for (int i = 0; i < count; i++) {
        double across[3];
        cross(axis, leaves[i].axis, across);
        spread = fmax(spread, cr_atan2(length(across), dot(axis, leaves[i].axis)) + leaves[i].spread);
    }
    return fmin(spread, PI);
}

/* The numbers of the node above these leaves; extent gets how far their centers are apart along each axis. A
   ball and cone that rounding could have cut into are made a little larger. */
static void set_node(LightNode *node, const Leaf *leaves, int count, double extent[3])
{
    double center[3], axis[3], radius = ball_around(leaves, count, center, extent) * (1 + 1e-6);
    double spread = cone_around(leaves, count, axis), power = 0, far = 0;
    if (count > 1)
        spread = fmin(spread + 1e-6, PI);
    for (int i = 0; i < count; i++) {
        power += leaves[i].power;
        far += leaves[i].far;
    }
    store(node->center, center);
    store(node->axis, axis);
    node->radius = (Num)radius;
    node->cos = (Num)cr_cos(spread);
    node->sin = (Num)cr_sin(spread);
    node->power = (Num)power;
    node->far = (Num)far;
    node->count = (Num)count;
}

static int by_key(const void *a, const void *b)
{
    const Leaf *p = a, *q = b;
    int order = (p->key > q->key) - (p->key < q->key);
    return order ? order : (p->emitter > q->emitter) - (p->emitter < q->emitter);
}

static void set_child(LightNode *node, Int child) { memcpy(&node->child, &child, sizeof child); }

/* A node that is still to be divided: its leaves, how deep it is, and the way down to it. */
typedef struct {
    int first, count, level;
    Int trail;
} Branch;

/* Halves, along the axis on which the centers are furthest apart, level by level: the uppermost nodes have the
   lowest numbers. */
static void prepare_tree(Scene *scene, Leaf *leaves)
{
    Emitters *emitters = &scene->emitters;
    LightTree *tree = &emitters->tree;
    size_t n = (size_t)emitters->count;
    Branch *branches = allocate(2 * n, sizeof *branches);
    tree->nodes = keep_lines(scene, 2 * n, sizeof *tree->nodes);
    tree->trail = keep(scene, n, sizeof *tree->trail);
    tree->p_by_count = (Num)0.5;
    branches[0] = (Branch){0, emitters->count, 0, 0};
    for (int node = 0, used = 1; node < used; node++) {
        Branch b = branches[node];
        double extent[3];
        set_node(&tree->nodes[node], leaves + b.first, b.count, extent);
        if (b.count == 1) {
            set_child(&tree->nodes[node], -1 - leaves[b.first].emitter);
            tree->trail[leaves[b.first].emitter] = b.trail;
            continue;
        }
        int axis = extent[1] > extent[0] ? 1 : 0, half = b.count / 2;
        axis = extent[2] > extent[axis] ? 2 : axis;
        for (int i = 0; i < b.count; i++)
            leaves[b.first + i].key = leaves[b.first + i].center[axis];
        qsort(leaves + b.first, (size_t)b.count, sizeof *leaves, by_key);
        set_child(&tree->nodes[node], used);
        branches[used++] = (Branch){b.first, half, b.level + 1, b.trail};
        branches[used++] = (Branch){b.first + half, b.count - half, b.level + 1, b.trail | (Int)1 << b.level};
    }
    free(branches);
}
