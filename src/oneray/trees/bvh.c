/* Top down by the surface area heuristic in bins: Wald, On Fast Construction of SAH-based Bounding Volume
   Hierarchies, IEEE RT 2007. The cost of a side is its area times the leaves that it needs. A node's eight
   children come from dividing the largest of its parts until there are eight. */
#include "trees/bvh.h"

#include "message.h"

#include <float.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { BINS = 16, HALVING_LEVEL = 24 }; /* from there on parts are halved: the depth stays in BVH_DEPTH */
enum { FEW_ITEMS = 48 };

typedef struct {
    float low[4], high[4];
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

static const Box nothing = {{FLT_MAX, FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX, -FLT_MAX}};

static inline void enclose(Box *restrict box, const float low[4], const float high[4])
{
    for (int i = 0; i < 4; i++)
        box->low[i] = low[i] < box->low[i] ? low[i] : box->low[i];
    for (int i = 0; i < 4; i++)
        box->high[i] = high[i] > box->high[i] ? high[i] : box->high[i];
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

/* Where the bins of an axis begin, and how many there are to a metre; 0 where all middles are at one place. */
typedef struct {
    float low, scale;
} Bins;

/* The bin of an item; written so that no number, not even nan, falls outside. */
static int bin_of(const BvhItem *item, int axis, Bins bins)
{
    float x = (middle(item, axis) - bins.low) * bins.scale;
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
    float cost;
    Box first, second; /* around the sides */
} Division;

typedef struct {
    Box box;
    int count;
} Bin;

static float side_cost(const Build *build, const Bin *side)
{
    return area(&side->box) * (float)((side->count + build->leaf_most - 1) / build->leaf_most);
}

static void join_bin(Bin *side, const Bin *bin)
{
    enclose(&side->box, bin->box.low, bin->box.high);
    side->count += bin->count;
}

static void try_axis(const Build *build, const Bin bins[BINS], int axis, Division *best)
{
    Bin second[BINS + 1] = {[BINS] = {nothing, 0}}, first = second[BINS];
    for (int b = BINS - 1; b > 0; b--) {
        second[b] = second[b + 1];
        join_bin(&second[b], &bins[b]);
    }
    for (int b = 1; b < BINS && second[b].count; b++) {
        join_bin(&first, &bins[b - 1]);
        float cost = side_cost(build, &first) + side_cost(build, &second[b]);
        if (first.count && cost < best->cost)
            *best = (Division){axis, b, cost, first.box, second[b].box};
    }
}

/* The bins along all axes of the middles of a part. */
static void set_bins(const Build *build, const Part *part, Bins bins[3])
{
    Box middles = nothing;
    for (int i = part->first; i < part->first + part->count; i++) {
        const BvhItem *item = &build->items[i];
        float p[4];
        for (int axis = 0; axis < 4; axis++)
            p[axis] = middle(item, axis);
        enclose(&middles, p, p);
    }
    for (int axis = 0; axis < 3; axis++) {
        float low = middles.low[axis], high = middles.high[axis];
        bins[axis] = (Bins){low, high > low ? (float)BINS / (high - low) : 0};
    }
}

/* Divides a part in two. */
static void divide(const Build *build, const Part *part, int level, Part sides[2])
{
    Division best = {-1, 0, FLT_MAX, nothing, nothing};
    BvhItem *items = build->items;
    Bins bins[3] = {{0, 0}};
    Bin bin[3][BINS];
    int first = part->first, last = first + part->count - 1;
    if (level < HALVING_LEVEL) {
        set_bins(build, part, bins);
        for (int b = 0; b < 3 * BINS; b++)
            bin[b / BINS][b % BINS] = (Bin){nothing, 0};
        for (int i = first; i <= last; i++)
            for (int axis = 0; axis < 3; axis++) {
                Bin *one = &bin[axis][bin_of(&items[i], axis, bins[axis])];
                enclose(&one->box, items[i].low, items[i].high);
                one->count++;
            }
        for (int axis = 0; axis < 3; axis++)
            if (bins[axis].scale > 0)
                try_axis(build, bin[axis], axis, &best);
    }
    if (best.axis < 0) {
        sides[0] = part_of(items, first, part->count / 2);
        sides[1] = part_of(items, first + part->count / 2, part->count - part->count / 2);
        return;
    }
    while (first <= last) {
        BvhItem item = items[first];
        if (bin_of(&item, best.axis, bins[best.axis]) < best.bin) {
            first++;
        } else {
            items[first] = items[last];
            items[last--] = item;
        }
    }
    sides[0] = (Part){part->first, first - part->first, best.first};
    sides[1] = (Part){first, part->first + part->count - first, best.second};
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
        Part sides[2];
        divide(build, &parts[k], level, sides);
        parts[k] = sides[0];
        parts[count] = sides[1];
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

/* How much more area one group of items has than two. */
static float area_more(const Bin *one, const Bin *other)
{
    Bin both = *one;
    join_bin(&both, other);
    return area(&both.box) - area(&one->box) - area(&other->box);
}

/* Few items are joined from below, pair by pair where that is the least area more, to the leaves of one node: the walls of a
   room stay flat. Gives how many those are, more than a node has where they did not fit. */
static int group_items(const Build *build, int count, int group_of[FEW_ITEMS])
{
    Bin groups[FEW_ITEMS];
    int left = count;
    for (int i = 0; i < count; i++) {
        groups[i] = (Bin){part_of(build->items, i, 1).box, 1};
        group_of[i] = i;
    }
    for (;; left--) {
        int one = -1, other = -1;
        float least = left > BVH_WIDTH ? FLT_MAX : 0;
        for (int i = 0; i < left; i++)
            for (int k = 0; k < i; k++)
                if (groups[i].count + groups[k].count <= build->leaf_most && area_more(&groups[i], &groups[k]) <= least) {
                    least = area_more(&groups[i], &groups[k]);
                    one = k;
                    other = i;
                }
        if (one < 0)
            return left;
        join_bin(&groups[one], &groups[other]);
        groups[other] = groups[left - 1];
        for (int i = 0; i < count; i++)
            group_of[i] = group_of[i] == other ? one : group_of[i] == left - 1 ? other : group_of[i];
    }
}

static bool build_of_few(Build *build, int count)
{
    int group_of[FEW_ITEMS], done = 0, groups = count > FEW_ITEMS ? FEW_ITEMS : group_items(build, count, group_of);
    Bvh *bvh = &build->bvh;
    BvhItem sorted[FEW_ITEMS];
    if (groups > BVH_WIDTH)
        return false;
    bvh->nodes = allocate(1, sizeof *bvh->nodes);
    bvh->leaves = allocate((size_t)groups, sizeof *bvh->leaves);
    bvh->node_count = 1;
    bvh->leaf_count = groups;
    for (int k = 0; k < BVH_WIDTH; k++)
        bvh->nodes[0].child[k] = k < groups ? -2 - k : -1;
    for (int k = 0; k < groups; k++) {
        bvh->leaves[k][0] = done;
        for (int i = 0; i < count; i++)
            if (group_of[i] == k)
                sorted[done++] = build->items[i];
        bvh->leaves[k][1] = done - bvh->leaves[k][0];
    }
    memcpy(build->items, sorted, (size_t)count * sizeof *sorted);
    return true;
}

Bvh bvh_build(BvhItem *items, int count, int leaf_most)
{
    Build build = {items, leaf_most, {NULL, NULL, 0, 0}};
    if (count && !build_of_few(&build, count))
        add_node(&build, part_of(items, 0, count), 0);
    return build.bvh;
}

void bvh_free(Bvh *bvh)
{
    free(bvh->nodes);
    free(bvh->leaves);
}
