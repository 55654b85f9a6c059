/* L18 Learning which lights are seen from where, in a short pre-pass with samples of its own. What was learned
   is then frozen: the picture stays unbiased and the same in every split. Counts are whole numbers, so the
   order of the paths does not matter. */
#pragma once

#include "emitters/choice.h"

#include <stdlib.h>

typedef struct {
    int bounds_only;           /* only find out where the paths go, in low and high */
    Num low[3], high[3];
    uint32_t *tested, *seen;   /* [region][LEARNED_NODES]: rays to the node's lights, and those that arrived */
} Lesson;

/* One lane's ray to a light: counts for the light's leaf and for every node above it. */
static void learn_ray(Lesson *lesson, const LightTree *tree, const Num p[3], size_t region, Int light, int seen)
{
    for (int axis = 0; axis < 3; axis++) {
        lesson->low[axis] = p[axis] < lesson->low[axis] ? p[axis] : lesson->low[axis];
        lesson->high[axis] = p[axis] > lesson->high[axis] ? p[axis] : lesson->high[axis];
    }
    if (lesson->bounds_only)
        return;
    Int node = 0, trail = tree->trail[light];
    while (node < LEARNED_NODES) {
        lesson->tested[region * LEARNED_NODES + (size_t)node]++;
        lesson->seen[region * LEARNED_NODES + (size_t)node] += (uint32_t)seen;
        if (child_of(tree, node) < 0)
            break;
        node = child_of(tree, node) + (trail & 1);
        trail >>= 1;
    }
}

INLINE void learn_visibility(
    Lesson *lesson, const LightTree *tree, Vec p, Index light, Mask tested, Mask arrives)
{
    Index region = lesson->bounds_only ? index_of(0) : region_of(tree, p);
    unsigned seen = mask_bits(arrives);
    for (unsigned left = mask_bits(tested); left; left &= left - 1) {
        int lane = lowest_lane(left);
        const Num position[3] = {LANE(p.x, lane), LANE(p.y, lane), LANE(p.z, lane)};
        learn_ray(lesson, tree, position, (size_t)LANE(region, lane), LANE(light, lane), (int)(seen >> lane & 1));
    }
}

/* Regions over the bounds that the paths kept to, near cubes, `cells` along the longest side; returns how many
   numbers are to be learned. */
static inline size_t lay_regions(LightTree *tree, const Lesson *lesson, int cells)
{
    Num longest = 0;
    size_t regions = 1;
    for (int axis = 0; axis < 3; axis++)
        longest = lesson->high[axis] - lesson->low[axis] > longest ? lesson->high[axis] - lesson->low[axis] : longest;
    for (int axis = 0; axis < 3; axis++) {
        Num extent = lesson->high[axis] - lesson->low[axis];
        tree->size[axis] = longest > 0 ? (Int)ceil((double)(extent / longest * (Num)cells)) : 1;
        tree->size[axis] = tree->size[axis] < 1 ? 1 : tree->size[axis];
        tree->low[axis] = lesson->low[axis];
        tree->scale[axis] = extent > 0 ? (Num)tree->size[axis] / extent : 0;
        regions *= (size_t)tree->size[axis];
    }
    return regions * LEARNED_NODES;
}

/* The share of rays seen to arrive, with half a ray more on either side: never 0 or 1 for certain. */
static inline double learned_share(uint32_t seen, uint32_t tested)
{
    return tested ? (seen + 0.5) / (tested + 1.0) : 1;
}
#define LEARNED_P_BY_COUNT 0.001 /* what stays for lights that never were seen */
