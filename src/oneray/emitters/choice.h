/* L4, L6, L18 One of N lights: light i with probability p_i, its contribution divided by p_i. Any p_i is valid
   as long as they sum to 1 and none is 0 whose light contributes. */
#pragma once

#include "emitters/towards.h"

#define NEAREST BY_PRECISION(1e-30, 1e-240) /* (m²) a light at the very point */
#define SPREAD (1 / 6.0)  /* of its ball's r²: how far a node's lights are from its center, squared */
#define DOUBTFUL 0.3      /* share of the best conceivable cosine, where the center's is smaller */

/* What the lights below a node contribute, roughly: E ≈ Φ/π cosθi cosθo / d², from the node's center, or where
   that is less a share of the best that the node's ball and cone allow. It is 0 only where both facts are
   certain: below the receiver's horizon, or behind every normal. After Conty Estévez & Kulla, Importance
   Sampling of Many Lights with Adaptive Tree Splitting, HPG 2018, who take the best itself: near a node the
   true contributions are far below it. */
typedef struct {
    Real importance, count; /* of how many lights */
    Index child;
} Below;

STAGE Below node_importance(const LightTree *tree, Index node, const Receiver *at, Features f)
{
    const int from_afar = (f.has & (HAS_DIRECTIONAL | HAS_ANY(SKIES))) != 0;
    Real row[LIGHT_NODE_ROW];
    for (int k = 0; k < LIGHT_NODE_ROW - (from_afar ? 0 : 4); k += 4)
        gather_four(tree->nodes->center + k, node * LIGHT_NODE_ROW, row + k);
#define NODE(number) row[IN_ROW(LightNode, number)]
    Vec to_center = vec_sub(vec(NODE(center[0]), NODE(center[1]), NODE(center[2])), at->p);
    Vec axis = vec(NODE(axis[0]), NODE(axis[1]), NODE(axis[2]));
    Real radius = NODE(radius), cone = NODE(cos), sine = NODE(sin);
    Real dd = vec_dot(to_center, to_center), along = -vec_dot(axis, to_center); /* d cosθ: to the cone's axis */
    Real across = real_sqrt(real_max(dd - along * along, real(0)));
    Mask within = along * sine > across * cone;
    Real d_cos_i = vec_dot(at->n, to_center);
    d_cos_i = select(at->both_sides, real_abs(d_cos_i), d_cos_i);
    if (f.has & HAS_ANY(MEDIA)) /* without a normal */
        d_cos_i = select(vec_dot(at->n, at->n) > real(0), d_cos_i, real_sqrt(dd));
    Real d_cos_o = select(within, real_sqrt(dd), along * cone + across * sine);
    d_cos_i = real_max(d_cos_i, real(DOUBTFUL) * real_max(d_cos_i + radius, real(0)));
    Real slack = only(NODE(count) > real(1),
        radius); /* how much nearer the cosine at the light can come than the center's, m */
    d_cos_o = real_max(d_cos_o, real(DOUBTFUL) * real_max(d_cos_o + slack, real(0)));
    Real nearness = real(1) / real_max(dd + real(SPREAD) * radius * radius, real(NEAREST));
    Real near = NODE(power) * (d_cos_i * nearness) * (d_cos_o * nearness);
    return (Below){from_afar ? NODE(far) + near : near, NODE(count), (Index)real_bits(NODE(child))};
#undef NODE
}

/* L18 The region of space that a point lies in. */
INLINE Index region_of(const LightTree *tree, Vec p)
{
    const Real position[3] = {p.x, p.y, p.z};
    Index region = index_of(0);
    for (int axis = 0; axis < 3; axis++) {
        Real cell = (position[axis] - real(tree->low[axis])) * real(tree->scale[axis]);
        cell = real_max(real_min(cell, real((double)tree->size[axis] - 0.5)), real(0));
        region = region * tree->size[axis] + real_floor(cell);
    }
    return region;
}

/* L18 What was learned of a node: how often a light below it was seen from this region. */
INLINE Real learned_visibility(const LightTree *tree, Index region, Index node)
{
    Mask known = node < index_of(LEARNED_NODES);
    Index row = region * LEARNED_NODES + index_select(known, node, index_of(0));
    return select(known, gather(tree->visible, row), real(1));
}

/* L6 Of two children the share of the first, by importance and by count, either way 0 for a child of importance 0; and
   what theirs are. */
typedef struct {
    Real by_contribution, by_count;
    Index child[2];
} FirstShare;

INLINE FirstShare share_of_first(
    const LightTree *tree, const Receiver *at, Index region, Index first, Features f)
{
    Below a = node_importance(tree, first, at, f), b = node_importance(tree, first + 1, at, f);
    if ((f.use & USE_LEARNED) && tree->visible) {
        a.importance = a.importance * learned_visibility(tree, region, first);
        b.importance = b.importance * learned_visibility(tree, region, first + 1);
    }
    Real sum = a.importance + b.importance;
    Mask none = sum <= real(0); /* nothing to gain below: any choice is valid */
    a.count = only((a.importance > real(0)) | none, a.count);
    b.count = only((b.importance > real(0)) | none, b.count);
    return (FirstShare){
        select(none, real(0.5), a.importance / sum), a.count / (a.count + b.count), {a.child, b.child}};
}

/* L6 Down the tree to one light, by the children's importance or, with p_by_count, by their counts:
   p_i = (1 - p_by_count) p_contribution + p_by_count p_count. Gives 1/p_i. */
STAGE Real walk_tree(const LightTree *tree, const Receiver *at, Real u, Real v, Index *light, Features f)
{
    Real p_by_count = real(tree->p_by_count), p_count = real(1), p_contribution = real(1);
    Mask by_count = u < p_by_count;
    u = select(by_count, u / p_by_count, (u - p_by_count) / (real(1) - p_by_count));
    Index child = index_of(child_of(tree, 0)), region = index_of(0);
    if (f.use & USE_LEARNED)
        region = region_of(tree, at->p);
    for (Mask inner = child >= 0; any(inner); inner = child >= 0) {
        Index first = index_select(inner, child, index_of(1));
        FirstShare share = share_of_first(tree, at, region, first, f);
        Real p = select(by_count, share.by_count, share.by_contribution);
        Mask second = (u >= p) & (p < real(1));
        u = select(second, u - p, u) / select(second, real(1) - p, p);
        p_contribution = select(inner,
            p_contribution * select(second, real(1) - share.by_contribution, share.by_contribution),
            p_contribution);
        p_count = select(inner, p_count * select(second, real(1) - share.by_count, share.by_count), p_count);
        child = index_select(inner, index_select(second, share.child[1], share.child[0]), child);
        Real other = u;
        u = v;
        v = other;
    }
    *light = -1 - child;
    return real(1) / ((real(1) - p_by_count) * p_contribution + p_by_count * p_count);
}

/* The same p_i of lights that were not chosen. The ways down to them are known, so that as many of their steps as there are
   lanes are taken at once: of which lane's light each is, at which pair of children, and whether to the second. */
typedef struct {
    int count;
    unsigned seconds;
    Index lane, first;
} Steps;

STAGE void take_steps(const LightTree *tree, const Receiver *at, Steps *steps, Num p_contribution[LANES],
    Num p_count[LANES], Features f)
{
    Receiver each = receiver_of_lanes(at, steps->lane);
    Index region = index_of(0);
    if (f.use & USE_LEARNED)
        region = region_of(tree, each.p);
    FirstShare share = share_of_first(tree, &each, region, steps->first, f);
    Mask second = lanes_mask(steps->seconds);
    Real contribution = select(second, real(1) - share.by_contribution, share.by_contribution);
    Real count = select(second, real(1) - share.by_count, share.by_count);
    for (int k = 0; k < steps->count; k++) {
        p_contribution[LANE(steps->lane, k)] *= LANE(contribution, k);
        p_count[LANE(steps->lane, k)] *= LANE(count, k);
    }
    steps->count = 0;
    steps->seconds = 0;
}

/* 1/p_i of the lights i that the rays of these lanes hit; else 1. */
STAGE Real inverse_choice_by_trails(const LightTree *tree, const Receiver *at, Mask hit, Index i, Features f)
{
    Num p_contribution[LANES], p_count[LANES];
    Steps steps = {0, 0, index_of(0), index_of(1)};
    for (int lane = 0; lane < LANES; lane++)
        p_contribution[lane] = p_count[lane] = 1;
    for (unsigned lanes = mask_bits(hit); lanes; lanes &= lanes - 1) {
        int lane = lowest_lane(lanes);
        Int trail = tree->trail[LANE(i, lane)];
        for (Int child = child_of(tree, 0); child >= 0; trail >>= 1) {
            LANE(steps.lane, steps.count) = lane;
            LANE(steps.first, steps.count) = child;
            steps.seconds |= (unsigned)(trail & 1) << steps.count;
            child = child_of(tree, child + (trail & 1));
            if (++steps.count == LANES)
                take_steps(tree, at, &steps, p_contribution, p_count, f);
        }
    }
    if (steps.count)
        take_steps(tree, at, &steps, p_contribution, p_count, f);
    Real by_contribution, by_count, share = real(tree->p_by_count);
    memcpy(&by_contribution, p_contribution, sizeof by_contribution);
    memcpy(&by_count, p_count, sizeof by_count);
    return real(1) / ((real(1) - share) * by_contribution + share * by_count);
}

/* L4 The choice: uniform and by power from an alias table (Vose 1991), whatever N is; by contribution from the
   tree. Sets 1/p_i. */
INLINE Index choose_light(
    const Emitters *emitters, const Receiver *at, Real u, Real v, Real *inverse_choice, Features f)
{
    *inverse_choice = real(1);
    if (!(f.has & HAS_MANY_LIGHTS))
        return index_of(0);
    if (f.use & USE_CONTRIBUTION) {
        Index light;
        *inverse_choice = walk_tree(&emitters->tree, at, u, v, &light, f);
        return light;
    }
    Index i = real_floor(u * real(emitters->count));
    i = index_select(v < gather(emitters->alias_p_stay, i), i, gather_index(emitters->alias, i));
    *inverse_choice = gather(emitters->inverse_choice, i);
    return i;
}

/* 1/p_i of the lights that the rays of these lanes hit: what choose_light would have said. */
STAGE Real inverse_choice_of(const Emitters *emitters, const Receiver *at, Mask hit, Index i, Features f)
{
    if (!(f.has & HAS_MANY_LIGHTS))
        return real(1);
    if (!(f.use & USE_CONTRIBUTION))
        return gather(emitters->inverse_choice, i);
    return inverse_choice_by_trails(&emitters->tree, at, hit, i, f);
}

/* One ray to one light. */
INLINE LightSample sample_light(
    const Emitters *emitters, const Receiver *at, const Real choice[2], const Real point[2], Features f)
{
    Real inverse_choice;
    Index i = choose_light(emitters, at, choice[0], choice[1], &inverse_choice, f);
    return sample_light_point(emitters, i, inverse_choice, at, point[0], point[1], f);
}
