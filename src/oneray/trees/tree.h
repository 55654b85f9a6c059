/* Trees of boxes in a kernel: one ray goes through, against eight boxes at once.

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

/* Boxes are in single precision in every kernel, and made larger to suit. */
typedef struct {
    float plane[6][BVH_WIDTH]; /* low x, y, z, high x, y, z */
    BvhNode where;
} TreeNode;

typedef struct {
    TreeNode *nodes;          /* NULL: nothing in it; about the center of all */
    Num center[3], extent[3]; /* extent: half of the box of all */
} Tree;

/* The rays of all lanes, as a tree takes them: [axis][lane]. */
typedef struct {
    float near_o[3][LANES], far_o[3][LANES]; /* o, moved so that near planes are nearer and far planes farther */
    float inverse[3][LANES];                 /* 1/d */
    Num o[3][LANES], shear[3][LANES];      /* for triangles, in axes whose z is the one that d is longest along: o,
                                              and d.x/d.z, d.y/d.z, 1/d.z */
    Int z[LANES];
    unsigned backwards[3]; /* a bit a lane: 1/d is negative */
} Beams;

/* One of them. */
typedef struct {
    const Beams *all;
    int lane;
    int near[3], far[3]; /* which planes of a node are met first and last */
    int axis[3];         /* the triangles' */
    Int from, target;    /* slots, or -1 */
} Beam;

#define BEAM(beam, what) ((beam)->all->what[(beam)->lane])

#define ROUNDING 1.2e-7F
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
    for (int lane = 0; lane < LANES; lane++)
        to[lane] = (float)LANE(a, lane);
}

/* Boxes are missed for certain only beyond the rounding of themselves, of the box test and of what is
   inside: errors of a few units in the last place of the largest distance, and of the coordinates
   (Ize, Robust BVH Ray Traversal, JCGT 2(2), 2013; Woop et al. 2013, 3.3). Where floats may have no such last
   place, nan lets every box be met. */
STAGE void beams_start(Beams *beams, const Tree *tree, const Vec *o, const Vec *d)
{
    const Real from[3] = {o->x, o->y, o->z}, along[3] = {d->x, d->y, d->z};
    Real reach = real(0), size = real(0), inverse[3], to_ray[3];
    UNROLLED for (int i = 0; i < 3; i++)
    {
        to_ray[i] = from[i] - real(tree->center[i]);
        reach = real_max(real_abs(to_ray[i]) + real(tree->extent[i]), reach);
        size = real_max(real_abs(from[i]), size);
    }
    Real slack = real(16 * ROUNDING) * reach + real(16 * NUM_ROUNDING) * (reach + size);
    slack = select((reach > real(1e-30)) & (reach < real(1e30)), slack, real(NAN));
    UNROLLED for (int i = 0; i < 3; i++)
    {
        inverse[i] = real(1) / along[i];
        Real aside = flip_sign(slack, inverse[i]), nearer = to_ray[i] + aside, farther = to_ray[i] - aside;
        floats_of(beams->inverse[i], inverse[i]);
        floats_of(beams->near_o[i], nearer);
        floats_of(beams->far_o[i], farther);
        beams->backwards[i] = mask_bits(inverse[i] < real(0));
    }
    Real xx = d->x * d->x, yy = d->y * d->y, zz = d->z * d->z;
    Mask is_x = (xx >= yy) & (xx >= zz), is_y = yy >= zz; /* z of the triangles, unless x */
    Index z = index_select(is_x, index_of(0), index_select(is_y, index_of(1), index_of(2)));
    Real over_z = along_axis(is_x, is_y, inverse[0], inverse[1], inverse[2]);
    const Real origin[3] = {along_axis(is_x, is_y, o->y, o->z, o->x), along_axis(is_x, is_y, o->z, o->x, o->y),
        along_axis(is_x, is_y, o->x, o->y, o->z)};
    const Real shear[3] = {along_axis(is_x, is_y, d->y, d->z, d->x) * over_z,
        along_axis(is_x, is_y, d->z, d->x, d->y) * over_z, over_z};
    memcpy(beams->z, &z, sizeof z);
    memcpy(beams->o, origin, sizeof origin);
    memcpy(beams->shear, shear, sizeof shear);
}

INLINE Beam beam_of(const Beams *beams, int lane, Int from, Int target)
{
    Beam beam = {.all = beams, .lane = lane, .from = from, .target = target};
    UNROLLED for (int i = 0; i < 3; i++)
    {
        int backwards = (int)(beams->backwards[i] >> lane & 1);
        beam.near[i] = backwards ? 3 + i : i;
        beam.far[i] = backwards ? i : 3 + i;
    }
    int z = (int)beams->z[lane];
    beam.axis[0] = z == 2 ? 0 : z + 1;
    beam.axis[1] = z == 0 ? 2 : z - 1;
    beam.axis[2] = z;
    return beam;
}

/* What is still to be looked at, the last first. */
typedef struct {
    float near;
    int32_t child;
} Pending;

enum { PENDING_MOST = BVH_DEPTH * (BVH_WIDTH - 1) + BVH_WIDTH };

/* Which of the node's boxes the ray meets before tmax, and where it enters them. Comparisons that a nan (0
   times infinity) fails keep what there was. */
STAGE unsigned boxes_met(const TreeNode *node, const Beam *beam, float tmax, float distance[8])
{
    unsigned bits = 0;
    for (int part = 0; part < 8; part += BOXES) {
        BoxPiece near = {0}, far = BOX_OF(tmax);
        UNROLLED for (int i = 0; i < 3; i++)
        {
            BoxPiece enter, leave, inverse = BOX_OF(BEAM(beam, inverse[i]));
            memcpy(&enter, node->plane[beam->near[i]] + part, sizeof enter);
            memcpy(&leave, node->plane[beam->far[i]] + part, sizeof leave);
            enter = (enter - BOX_OF(BEAM(beam, near_o[i]))) * inverse;
            leave = (leave - BOX_OF(BEAM(beam, far_o[i]))) * inverse;
            near = BOX_MAX(enter, near);
            far = BOX_MIN(leave, far);
        }
        BoxMask met = near <= far * (1 + 8 * ROUNDING);
#ifdef EVERY_BOX /* for the test that boxes leave out nothing that is met */
        met = ~(BoxMask){0};
        near = (BoxPiece){0};
#endif
        memcpy(distance + part, &near, sizeof near);
        bits |= box_bits(&met) << part;
    }
    return bits;
}

/* Puts down the children that the ray meets before tmax, the nearest last. */
INLINE void add_children(const TreeNode *node, const Beam *beam, float tmax, Pending *pending, int *count)
{
    float distance[8];
    int first = *count;
    for (unsigned bits = boxes_met(node, beam, tmax, distance); bits; bits &= bits - 1) {
        int k = lowest_lane(bits), at = *count;
        if (node->where.child[k] == -1)
            continue;
        for (; at > first && pending[at - 1].near < distance[k]; at--)
            pending[at] = pending[at - 1];
        pending[at] = (Pending){distance[k], node->where.child[k]};
        ++*count;
    }
}
