/* Top down by the surface area heuristic in bins: Wald, On Fast Construction of SAH-based Bounding Volume
   Hierarchies, IEEE RT 2007. The cost of a side is its area times the leaves that it needs. A node's eight
   children come from dividing the largest of its parts until there are eight. */
#include "trees/bvh.h"

#include "message.h"

#include <float.h>
#include <stdlib.h>

enum { BINS = 16, HALVING_LEVEL = 24 }; /* from there on parts are halved: the depth stays in BVH_DEPTH */

typedef struct {
    float low[3], high[3];
} Box;

typedef struct {
    int first, count;
    Box box;
} Part;

typedef struct {
    BvhItem *items;
    int leaf_most;
    Bvh bvh;
} Build;

static const Box nothing = {{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};

static void enclose(Box *box, const float low[3], const float high[3])
{
    for (int i = 0; i < 3; i++) {
        box->low[i] = low[i] < box->low[i] ? low[i] : box->low[i];
        box->high[i] = high[i] > box->high[i] ? high[i] : box->high[i];
    }
}

static float area(const Box *box)
{
    float x = box->high[0] - box->low[0], y = box->high[1] - box->low[1], z = box->high[2] - box->low[2];
    return x < 0 ? 0 : x * y + y * z + z * x;
}

static float middle(const BvhItem *item, int axis)
{
    return 0.5f * item->low[axis] + 0.5f * item->high[axis];
}

/* The bin of an item; written so that no number, not even nan, falls outside. */
static int bin_of(const BvhItem *item, int axis, float low, float scale)
{
    float x = (middle(item, axis) - low) * scale;
    return x >= BINS - 1 ? BINS - 1 : x > 0 ? (int)x : 0;
}

static Part part_of(const BvhItem *items, int first, int count)
{
    Part part = {first, count, nothing};
    for (int i = first; i < first + count; i++)
        enclose(&part.box, items[i].low, items[i].high);
    return part;
}

/* A place to divide: the items of bins below `bin` along `axis` go to the first side. */
typedef struct {
    int axis, bin;
    float cost, low, scale;
} Division;

static float side_cost(const Build *build, const Box *box, int count)
{
    return area(box) * (float)((count + build->leaf_most - 1) / build->leaf_most);
}

static void try_axis(const Build *build, const Part *part, int axis, float low, float high, Division *best)
{
    Box boxes[BINS], box = nothing;
    int counts[BINS] = {0}, count = 0;
    float scale = (float)BINS / (high - low), right[BINS] = {0};
    for (int b = 0; b < BINS; b++)
        boxes[b] = nothing;
    for (int i = part->first; i < part->first + part->count; i++) {
        const BvhItem *item = &build->items[i];
        int b = bin_of(item, axis, low, scale);
        counts[b]++;
        enclose(&boxes[b], item->low, item->high);
    }
    for (int b = BINS - 1; b > 0; b--) {
        enclose(&box, boxes[b].low, boxes[b].high);
        count += counts[b];
        right[b] = count ? side_cost(build, &box, count) : -1;
    }
    box = nothing;
    count = 0;
    for (int b = 1; b < BINS; b++) {
        enclose(&box, boxes[b - 1].low, boxes[b - 1].high);
        count += counts[b - 1];
        float cost = side_cost(build, &box, count) + right[b];
        if (count && right[b] >= 0 && cost < best->cost)
            *best = (Division){axis, b, cost, low, scale};
    }
}

/* Divides a part in two; returns how many items are in the first. */
static int divide(const Build *build, const Part *part, int level)
{
    Division best = {-1, 0, FLT_MAX, 0, 0};
    Box middles = nothing;
    for (int i = part->first; i < part->first + part->count; i++) {
        const BvhItem *item = &build->items[i];
        const float p[3] = {middle(item, 0), middle(item, 1), middle(item, 2)};
        enclose(&middles, p, p);
    }
    for (int axis = 0; axis < 3 && level < HALVING_LEVEL; axis++)
        if (middles.high[axis] > middles.low[axis])
            try_axis(build, part, axis, middles.low[axis], middles.high[axis], &best);
    if (best.axis < 0)
        return part->count / 2;
    int first = part->first, last = part->first + part->count - 1;
    while (first <= last) {
        BvhItem item = build->items[first];
        if (bin_of(&item, best.axis, best.low, best.scale) < best.bin) {
            first++;
        } else {
            build->items[first] = build->items[last];
            build->items[last--] = item;
        }
    }
    return first - part->first;
}

/* The part to divide next: the largest, once they are only halved the one with most items; -1 if all are
   leaves. */
static int largest_part(const Build *build, const Part *parts, int count, int level)
{
    int largest = -1;
    float most = -1;
    for (int k = 0; k < count; k++) {
        float size = level < HALVING_LEVEL ? area(&parts[k].box) : (float)parts[k].count;
        if (parts[k].count > build->leaf_most && !(size <= most)) {
            most = size;
            largest = k;
        }
    }
    return largest;
}

static int add_node(Build *build, Part whole, int level)
{
    Bvh *bvh = &build->bvh;
    Part parts[BVH_WIDTH] = {whole};
    int count = 1, node = bvh->node_count++;
    bvh->nodes = room_for(bvh->nodes, node, sizeof *bvh->nodes);
    for (int k; count < BVH_WIDTH && (k = largest_part(build, parts, count, level)) >= 0; count++) {
        Part part = parts[k];
        int first = divide(build, &part, level);
        parts[k] = part_of(build->items, part.first, first);
        parts[count] = part_of(build->items, part.first + first, part.count - first);
    }
    for (int k = 0; k < BVH_WIDTH; k++) {
        int32_t child = -1;
        if (k < count && parts[k].count <= build->leaf_most) {
            bvh->leaves = room_for(bvh->leaves, bvh->leaf_count, sizeof *bvh->leaves);
            bvh->leaves[bvh->leaf_count][0] = parts[k].first;
            bvh->leaves[bvh->leaf_count][1] = parts[k].count;
            child = -2 - bvh->leaf_count++;
        } else if (k < count) {
            child = add_node(build, parts[k], level + 1);
        }
        bvh->nodes[node].child[k] = child;
    }
    return node;
}

Bvh bvh_build(BvhItem *items, int count, int leaf_most)
{
    Build build = {items, leaf_most, {NULL, NULL, 0, 0}};
    if (count)
        add_node(&build, part_of(items, 0, count), 0);
    return build.bvh;
}

void bvh_free(Bvh *bvh)
{
    free(bvh->nodes);
    free(bvh->leaves);
}
