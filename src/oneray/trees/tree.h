/* Trees of boxes in a kernel: a ray looks at eight boxes at once, and the rays of all lanes take a step each in turn.

   A tree only leaves out what the ray certainly does not meet, and of equally near hits the lower slot is
   taken, so that what is met depends on neither the tree nor the order. */
#pragma once

#include "trees/bvh.h"
#include "lanes/vec.h"

#if LANES == 1 && defined(__SSE2__)
#include <immintrin.h>
#endif

/* Eight numbers for one ray, at every LANES, in as few pieces as the processor's registers allow: Nums of eight
   triangles, floats of eight boxes. Pieces stay out of function signatures, where another processor may have
   another calling convention for them. */
#if defined(__AVX512DQ__) && !defined(SINGLE)
#define PIECE_BYTES 64
#elif defined(__AVX2__)
#define PIECE_BYTES 32
#else
#define PIECE_BYTES 16
#endif
#define PIECE (PIECE_BYTES / NUM_BYTES)
typedef Num Piece __attribute__((vector_size(PIECE_BYTES)));
typedef Int PieceMask __attribute__((vector_size(PIECE_BYTES)));

#ifdef __AVX2__
#define BOXES 8
#else
#define BOXES 4
#endif
typedef float BoxPiece __attribute__((vector_size(4 * BOXES)));
typedef int32_t BoxMask __attribute__((vector_size(4 * BOXES)));

/* The same number in all of it. */
#define PIECE_OF_2(a) {a, a}
#define PIECE_OF_4(a) {a, a, a, a}
#define PIECE_OF_8(a) {a, a, a, a, a, a, a, a}
#if PIECE_BYTES == 16 && !defined(SINGLE)
#define PIECE_OF(a) ((Piece)PIECE_OF_2(a))
#elif PIECE_BYTES == 16 || (PIECE_BYTES == 32 && !defined(SINGLE))
#define PIECE_OF(a) ((Piece)PIECE_OF_4(a))
#else
#define PIECE_OF(a) ((Piece)PIECE_OF_8(a))
#endif
#if BOXES == 8
#define BOX_OF(a) ((BoxPiece)PIECE_OF_8(a))
#else
#define BOX_OF(a) ((BoxPiece)PIECE_OF_4(a))
#endif

/* The larger or smaller of two; b where a is nan. */
#define MASK_SELECT(m, a, b) (((m) & (a)) | (~(m) & (b)))
#define PIECE_SELECT(m, a, b) ((Piece)MASK_SELECT(m, (PieceMask)(a), (PieceMask)(b)))
#define BOX_SELECT(m, a, b) ((BoxPiece)MASK_SELECT(m, (BoxMask)(a), (BoxMask)(b)))
#if PIECE_BYTES == 64
#define PIECE_MAX(a, b) ((Piece)INTRINSIC(_mm512, max)(a, b))
#define PIECE_MIN(a, b) ((Piece)INTRINSIC(_mm512, min)(a, b))
#elif PIECE_BYTES == 32
#define PIECE_MAX(a, b) ((Piece)INTRINSIC(_mm256, max)(a, b))
#define PIECE_MIN(a, b) ((Piece)INTRINSIC(_mm256, min)(a, b))
#else
#define PIECE_MAX(a, b) PIECE_SELECT((a) > (b), a, b)
#define PIECE_MIN(a, b) PIECE_SELECT((a) < (b), a, b)
#endif
#if BOXES == 8
#define BOX_MAX(a, b) ((BoxPiece)_mm256_max_ps(a, b))
#define BOX_MIN(a, b) ((BoxPiece)_mm256_min_ps(a, b))
#else
#define BOX_MAX(a, b) BOX_SELECT((a) > (b), a, b)
#define BOX_MIN(a, b) BOX_SELECT((a) < (b), a, b)
#endif

/* A bit for each of the piece's numbers. */
INLINE unsigned piece_bits(const PieceMask *m)
{
#if PIECE_BYTES == 64
    return MASK_BITS_512((__m512i)*m);
#elif PIECE_BYTES == 32
    return (unsigned)INTRINSIC(_mm256, movemask)((Piece)*m);
#elif defined(__SSE2__)
    return (unsigned)INTRINSIC(_mm, movemask)((Piece)*m);
#else
    unsigned bits = 0;
    for (int k = 0; k < PIECE; k++)
        bits |= (unsigned)((*m)[k] & 1) << k;
    return bits;
#endif
}

INLINE unsigned box_bits(const BoxMask *m)
{
#if BOXES == 8
    return (unsigned)_mm256_movemask_ps((__m256)*m);
#elif defined(__SSE2__)
    return (unsigned)_mm_movemask_ps((__m128)*m);
#else
    unsigned bits = 0;
    for (int k = 0; k < BOXES; k++)
        bits |= (unsigned)((*m)[k] & 1) << k;
    return bits;
#endif
}

/* Boxes are in single precision in every kernel, and made larger to suit. order[i] are the children, the farthest first,
   as rays meet them that go forwards along z, backwards along x where i is odd, and along y where it is 2 or more; the
   opposite rays take the same order from its other end. */
enum { ORDERS = 4 };
typedef struct {
    float plane[6][BVH_WIDTH]; /* low x, y, z, high x, y, z */
    BvhNode where;
    uint8_t order[ORDERS][BVH_WIDTH];
} TreeNode;

typedef struct {
    TreeNode *nodes;          /* NULL: nothing in it; about the center of all */
    Num center[3], extent[3]; /* extent: half of the box of all */
    float low[3], high[3]; /* that box as node 0 has it */
} Tree;

/* The rays of all lanes, as trees take them: [axis][lane]. Of a box's planes the ray meets the first at
   plane·inverse - near or, with a margin for rounding, the last at plane·wider - far. */
typedef struct {
    float near_o[3][LANES], far_o[3][LANES]; /* o, moved so that near planes are nearer and far planes farther */
    float inverse[3][LANES], near[3][LANES]; /* 1/d, and near_o/d */
    float wider[3][LANES], far[3][LANES];
    Int first[3][LANES], last[3][LANES]; /* where in a node's planes those are */
    Int octant[LANES]; /* a bit an axis: 1/d is negative */
    Int axis[3][LANES]; /* for triangles: x, y and z, the one that d is longest along */
    Num o[3][LANES], shear[3][LANES]; /* in those o, and d.x/d.z, d.y/d.z, 1/d.z */
} Beams;

#define ROUNDING 1.2e-7F
#define MARGIN (1 + 8 * ROUNDING)
#define LIMIT(t) ((float)(t) * MARGIN) /* how far away boxes may be of what is nearer than t */
#define INVERSE_MOST 1e18
#ifdef SINGLE
#define NUM_ROUNDING ROUNDING
#else
#define NUM_ROUNDING 2.3e-16
#endif

/* Of three, that along axis z, as a mask for each of the first two says. */
INLINE Real along_axis(Mask is_x, Mask is_y, Real x, Real y, Real z)
{
    return select(is_x, x, select(is_y, y, z));
}

INLINE void floats_of(float to[LANES], Real a)
{
#ifdef SINGLE
    memcpy(to, &a, sizeof a);
#else
    for (int lane = 0; lane < LANES; lane++)
        to[lane] = (float)LANE(a, lane);
#endif
}

/* Boxes are missed for certain only beyond the rounding of themselves, of the box test and of what is
   inside: errors of a few units in the last place of the largest distance, and of the coordinates
   (Ize, Robust BVH Ray Traversal, JCGT 2(2), 2013; Woop et al. 2013, 3.3). Of plane·(1/d) - o·(1/d) each product is
   rounded, or one of them: as if the plane or o were at most half a unit in the last place of `reach` elsewhere, twice;
   what else is rounded are factors of the distance, which MARGIN has room for. 1/d is bounded, so that along an axis
   across the ray the products are numbers, and o in between the planes is: on its way to t <= 4 reach a ray that this
   turns is 1e-17 reach aside. Where floats may have no such last place, nan lets every box be met.

   Gives the lanes that may meet the box of all before tmax: as for any box, but with (plane - o)·(1/d), whose difference
   is rounded by half a unit in the last place of `reach` at most. */
STAGE unsigned beams_start(Beams *beams, const Tree *tree, const Vec *o, const Vec *d, Real tmax)
{
    const Real from[3] = {o->x, o->y, o->z}, along[3] = {d->x, d->y, d->z};
    Real reach = real(0), size = real(0), near = real(0), far = tmax * real(MARGIN), inverse[3], to_ray[3];
    Index octant = index_of(0);
    UNROLLED for (int i = 0; i < 3; i++)
    {
        to_ray[i] = from[i] - real(tree->center[i]);
        reach = real_max(real_abs(to_ray[i]) + real(tree->extent[i]), reach);
        size = real_max(real_abs(from[i]), size);
    }
    Real slack = real(18 * ROUNDING) * reach + real(16 * NUM_ROUNDING) * (reach + size);
    slack = select((reach > real(1e-30)) & (reach < real(1e30)), slack, real(NAN));
    UNROLLED for (int i = 0; i < 3; i++)
    {
        inverse[i] = real(1) / along[i];
        Real aside = flip_sign(slack, inverse[i]), nearer = to_ray[i] + aside, farther = to_ray[i] - aside;
        Real bounded = real_max(real_min(inverse[i], real(INVERSE_MOST)), real(-INVERSE_MOST));
        floats_of(beams->inverse[i], bounded);
        floats_of(beams->near_o[i], nearer);
        floats_of(beams->far_o[i], farther);
        for (int lane = 0; lane < LANES; lane++) {
            beams->near[i][lane] = beams->near_o[i][lane] * beams->inverse[i][lane];
            beams->wider[i][lane] = beams->inverse[i][lane] * MARGIN;
            beams->far[i][lane] = beams->far_o[i][lane] * beams->wider[i][lane];
        }
        Mask backwards = inverse[i] < real(0);
        Index first = index_select(backwards, index_of((3 + i) * BVH_WIDTH), index_of(i * BVH_WIDTH));
        Index last = index_of((3 + 2 * i) * BVH_WIDTH) - first;
        Real low = real(tree->low[i]), high = real(tree->high[i]);
        near = real_max((select(backwards, high, low) - nearer) * bounded, near);
        far = real_min((select(backwards, low, high) - farther) * bounded * real(MARGIN), far);
        memcpy(beams->first[i], &first, sizeof first);
        memcpy(beams->last[i], &last, sizeof last);
        octant |= index_select(backwards, index_of(1 << i), index_of(0));
    }
    memcpy(beams->octant, &octant, sizeof octant);
    Real xx = d->x * d->x, yy = d->y * d->y, zz = d->z * d->z;
    Mask is_x = (xx >= yy) & (xx >= zz), is_y = yy >= zz; /* z of the triangles, unless x */
    Index z = index_select(is_x, index_of(0), index_select(is_y, index_of(1), index_of(2)));
    Index x = index_select(z == 2, index_of(0), z + 1);
    const Index axis[3] = {x, 3 - x - z, z};
    Real over_z = along_axis(is_x, is_y, inverse[0], inverse[1], inverse[2]);
    const Real origin[3] = {along_axis(is_x, is_y, o->y, o->z, o->x), along_axis(is_x, is_y, o->z, o->x, o->y),
        along_axis(is_x, is_y, o->x, o->y, o->z)};
    const Real shear[3] = {along_axis(is_x, is_y, d->y, d->z, d->x) * over_z,
        along_axis(is_x, is_y, d->z, d->x, d->y) * over_z, over_z};
    memcpy(beams->axis, axis, sizeof axis);
    memcpy(beams->o, origin, sizeof origin);
    memcpy(beams->shear, shear, sizeof shear);
#ifdef EVERY_BOX /* for the test that boxes leave out nothing that is met */
    near = far;
#endif
    return mask_bits(near <= far);
}

/* a·b - c, in one rounding where that is one instruction: boxes are wide enough for either. */
#if BOXES == 8 && defined(__FMA__)
#define BOX_FMSUB(a, b, c) ((BoxPiece)_mm256_fmsub_ps(a, b, c))
#else
#define BOX_FMSUB(a, b, c) ((a) * (b) - (c))
#endif

/* Where a lane's ray comes into the node's boxes from number `part` on and leaves them, between 0 and `limit`: it meets
   those where near <= far. Numbers that are nan count for nothing. */
INLINE void box_range(
    const TreeNode *node, const Beams *beams, int lane, float limit, int part, BoxPiece *near, BoxPiece *far)
{
    const float *planes = node->plane[0];
    *near = (BoxPiece){0};
    *far = BOX_OF(limit);
    UNROLLED for (int i = 0; i < 3; i++)
    {
        BoxPiece first, last;
        memcpy(&first, planes + beams->first[i][lane] + part, sizeof first);
        memcpy(&last, planes + beams->last[i][lane] + part, sizeof last);
        *near =
            BOX_MAX(BOX_FMSUB(first, BOX_OF(beams->inverse[i][lane]), BOX_OF(beams->near[i][lane])), *near);
        *far = BOX_MIN(BOX_FMSUB(last, BOX_OF(beams->wider[i][lane]), BOX_OF(beams->far[i][lane])), *far);
    }
#ifdef EVERY_BOX
    *far = *near = (BoxPiece){0};
#endif
}

/* What a ray has still to look at, the last first, and how far away it begins. The first, -1, is the end. */
enum { PENDING_MOST = BVH_DEPTH * (BVH_WIDTH - 1) + 2 * BVH_WIDTH };
typedef struct {
    int count;
    float near[PENDING_MOST];
    int32_t child[PENDING_MOST];
} Pending;

#if BOXES == 8 && !defined(__AVX512VL__)
/* By a mask of eight, the numbers of those in it, a byte each. */
#define BELOW(m, k) __builtin_popcount((m) & ((1 << (k)) - 1))
#define PLACED(m, k) ((uint64_t)((m) >> (k) & 1) * (k) << 8 * (BELOW(m, k) & 7))
#define SQUEEZE(m) PLACED(m, 1) | PLACED(m, 2) | PLACED(m, 3) | PLACED(m, 4) | PLACED(m, 5) | PLACED(m, 6) | PLACED(m, 7)
#define SQUEEZE_4(m) SQUEEZE(m), SQUEEZE((m) + 1), SQUEEZE((m) + 2), SQUEEZE((m) + 3)
#define SQUEEZE_16(m) SQUEEZE_4(m), SQUEEZE_4((m) + 4), SQUEEZE_4((m) + 8), SQUEEZE_4((m) + 12)
#define SQUEEZE_64(m) SQUEEZE_16(m), SQUEEZE_16((m) + 16), SQUEEZE_16((m) + 32), SQUEEZE_16((m) + 48)
static const uint64_t squeezed[256] = {SQUEEZE_64(0), SQUEEZE_64(64), SQUEEZE_64(128), SQUEEZE_64(192)};
#endif

/* What turns an octant into the number of an order, and a place into that from the order's other end; or 0. */
INLINE int turned_order(Int octant) { return -((int)octant / ORDERS) & (2 * ORDERS - 1); }

/* Puts down the children that a lane's ray meets before `limit`, if ordered the nearest last. */
INLINE void put_children(
    const TreeNode *node, const Beams *beams, int lane, float limit, int ordered, Pending *pending)
{
    int count = pending->count;
#if BOXES == 8
    BoxPiece near, far;
    box_range(node, beams, lane, limit, 0, &near, &far);
    __m256i child = _mm256_loadu_si256((const __m256i *)node->where.child);
    if (ordered) {
        const __m256i ahead = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        int turned = turned_order(beams->octant[lane]);
        __m256i order = _mm256_cvtepu8_epi32(
            _mm_loadl_epi64((const __m128i *)node->order[(int)beams->octant[lane] ^ turned]));
        order = _mm256_permutevar8x32_epi32(order, _mm256_xor_si256(ahead, _mm256_set1_epi32(turned)));
        child = _mm256_permutevar8x32_epi32(child, order);
        near = (BoxPiece)_mm256_permutevar8x32_ps(near, order);
        far = (BoxPiece)_mm256_permutevar8x32_ps(far, order);
    }
#ifdef __AVX512VL__
    __mmask8 some = _mm256_cmpneq_epi32_mask(child, _mm256_set1_epi32(-1));
    __mmask8 met = _mm256_mask_cmp_ps_mask(some, near, far, _CMP_LE_OQ);
    child = _mm256_maskz_compress_epi32(met, child);
    near = (BoxPiece)_mm256_maskz_compress_ps(met, near);
#else
    __m256i none = _mm256_cmpeq_epi32(child, _mm256_set1_epi32(-1));
    unsigned met = (unsigned)_mm256_movemask_ps(
        _mm256_andnot_ps(_mm256_castsi256_ps(none), _mm256_cmp_ps(near, far, _CMP_LE_OQ)));
    __m256i squeeze = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)&squeezed[met]));
    child = _mm256_permutevar8x32_epi32(child, squeeze);
    near = (BoxPiece)_mm256_permutevar8x32_ps(near, squeeze);
#endif
    _mm256_storeu_si256((__m256i *)(pending->child + count), child);
    if (ordered)
        memcpy(pending->near + count, &near, sizeof near);
    count += __builtin_popcount(met);
#else
    unsigned met = 0;
    float distance[BVH_WIDTH];
    for (int part = 0; part < BVH_WIDTH; part += BOXES) {
        BoxPiece near, far;
        box_range(node, beams, lane, limit, part, &near, &far);
        BoxMask in = near <= far;
        met |= box_bits(&in) << part;
        memcpy(distance + part, &near, sizeof near);
    }
    for (; met; met &= met - 1) {
        int k = lowest_lane(met), at = count;
        if (node->where.child[k] == -1)
            continue;
        for (; ordered && at > pending->count && pending->near[at - 1] < distance[k]; at--) {
            pending->near[at] = pending->near[at - 1];
            pending->child[at] = pending->child[at - 1];
        }
        pending->near[at] = distance[k];
        pending->child[at] = node->where.child[k];
        count++;
    }
#endif
    pending->count = count;
}

/* The rays of several lanes on their ways through a tree, a step each in turn: while one waits for what it has asked the
   memory for, or for its own numbers, the others go on. */
typedef struct {
    unsigned inner, leaves; /* the lanes at nodes, and at leaves */
    int32_t at[LANES]; /* which, as nodes have it */
    Pending pending[LANES];
} Ways;

INLINE void to_child(Ways *ways, int lane, int32_t child)
{
    ways->at[lane] = child;
    ways->inner |= (unsigned)(child >= 0) << lane;
    ways->leaves |= (unsigned)(child < -1) << lane;
}

/* To node 0, the root, or below. */
INLINE void start_below(Ways *ways, unsigned lanes, int32_t child)
{
    ways->inner = ways->leaves = 0;
    for (; lanes; lanes &= lanes - 1) {
        int lane = lowest_lane(lanes);
        Pending *pending = &ways->pending[lane];
        pending->count = 1;
        pending->near[0] = -FLT_MAX;
        pending->child[0] = -1;
        to_child(ways, lane, child);
    }
}

/* A lane's ray goes on to what it has still to look at before `limit`, if ordered; at the end to nothing. */
INLINE void to_next(Ways *ways, int lane, float limit, int ordered)
{
    Pending *pending = &ways->pending[lane];
    int count = pending->count - 1;
    while (ordered && pending->near[count] > limit)
        count--;
    pending->count = count;
    to_child(ways, lane, pending->child[count]);
}

/* The one way through a tree: a step of each that is at a node, if ordered about to the nearest first. Gives the lanes that
   were at leaves, -2 - ways->at[lane]: whoever looks at these lets them go on, or not. */
INLINE unsigned step(const TreeNode *nodes, const Beams *beams, const Real *t, int ordered, Ways *ways)
{
    unsigned inner = ways->inner, leaves = ways->leaves;
    ways->inner = ways->leaves = 0;
    for (; inner; inner &= inner - 1) {
        int lane = lowest_lane(inner);
        const float limit = LIMIT(LANE(*t, lane));
        put_children(&nodes[ways->at[lane]], beams, lane, limit, ordered, &ways->pending[lane]);
        to_next(ways, lane, limit, ordered);
    }
    return leaves;
}
