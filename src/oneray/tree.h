/* Trees of boxes in a kernel: one ray goes through, against eight boxes at once.

   A tree only leaves out what the ray certainly does not meet, and of equally near hits the lower slot is
   taken, so that what is met depends on neither the tree nor the order. */
#ifndef ONERAY_TREE_H
#define ONERAY_TREE_H

#include "bvh.h"
#include "vec.h"

#if LANES == 1 && defined(__SSE2__)
#include <immintrin.h>
#endif

/* Eight numbers for one ray, at every LANES, in as few pieces as the processor's registers allow. Pieces stay
   out of function signatures, where another processor may have another calling convention for them. */
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

/* The larger or smaller of two; b where a is nan. */
#if PIECE_BYTES == 32
#define PIECE_MAX(a, b) ((Piece)VECTOR_MAX(_mm256)(a, b))
#define PIECE_MIN(a, b) ((Piece)VECTOR_MIN(_mm256)(a, b))
#else
#define PIECE_SELECT(m, a, b) ((Piece)(((m) & (PieceMask)(a)) | (~(m) & (PieceMask)(b))))
#define PIECE_MAX(a, b) PIECE_SELECT((a) > (b), a, b)
#define PIECE_MIN(a, b) PIECE_SELECT((a) < (b), a, b)
#endif

/* A bit for each of the piece's numbers. */
INLINE unsigned piece_bits(const PieceMask *m)
{
#if PIECE_BYTES == 64
    return MASK_BITS_512((__m512i)*m);
#elif PIECE_BYTES == 32
    return (unsigned)VECTOR_BITS(_mm256)((Piece)*m);
#elif defined(__SSE2__)
    return (unsigned)VECTOR_BITS(_mm)((Piece)*m);
#else
    unsigned bits = 0;
    for (int k = 0; k < PIECE; k++)
        bits |= (unsigned)((*m)[k] & 1) << k;
    return bits;
#endif
}

typedef struct {
    Num plane[6][BVH_WIDTH]; /* low x, y, z, high x, y, z */
    BvhNode where;
} TreeNode;

typedef struct {
    TreeNode *nodes; /* NULL: nothing in it */
    Num low[3], high[3];
} Tree;

/* One ray, as a tree takes it. */
typedef struct {
    Num o[3];
    Piece near_o[3], far_o[3]; /* o, moved so that near planes are nearer and far planes farther */
    Piece inverse[3];          /* 1/d */
    int near[3], far[3];       /* which planes of a node those are */
    int axis[3];             /* the triangles': x, y, and z along which d is longest */
    Num shear[3];            /* d.x/d.z, d.y/d.z, 1/d.z in those axes */
    Int from, target;        /* slots, or -1 */
} Beam;

#ifdef SINGLE
#define ROUNDING 1.2e-7F
#else
#define ROUNDING 2.3e-16
#endif

/* The lane's ray. Boxes are missed for certain only beyond the rounding both of the box test and of what is
   inside: errors of a few units in the last place of the largest distance, and of the coordinates themselves
   (Ize, Robust BVH Ray Traversal, JCGT 2(2), 2013; Woop et al. 2013, 3.3). */
INLINE void beam_start(Beam *beam, const Tree *tree, const Vec *o, const Vec *d, int lane)
{
    (void)lane;
    const Num from[3] = {LANE(o->x, lane), LANE(o->y, lane), LANE(o->z, lane)};
    const Num along[3] = {LANE(d->x, lane), LANE(d->y, lane), LANE(d->z, lane)};
    Num reach = 0;
    int z = 0;
    for (int i = 0; i < 3; i++) {
        Num size = from[i] < 0 ? -from[i] : from[i];
        Num low = from[i] - tree->low[i], high = tree->high[i] - from[i];
        Num far = (low > high ? low : high) + size;
        reach = far > reach ? far : reach;
        z = along[i] * along[i] > along[z] * along[z] ? i : z;
    }
    Num slack = 16 * ROUNDING * reach;
    UNROLLED for (int i = 0; i < 3; i++) {
        Num inverse = 1 / along[i];
        int backwards = inverse < 0;
        beam->o[i] = from[i];
        beam->inverse[i] = (Piece){0} + inverse;
        beam->near_o[i] = (Piece){0} + (backwards ? from[i] - slack : from[i] + slack);
        beam->far_o[i] = (Piece){0} + (backwards ? from[i] + slack : from[i] - slack);
        beam->near[i] = backwards ? 3 + i : i;
        beam->far[i] = backwards ? i : 3 + i;
    }
    beam->axis[0] = z == 2 ? 0 : z + 1;
    beam->axis[1] = z == 0 ? 2 : z - 1;
    beam->axis[2] = z;
    beam->shear[2] = 1 / along[z];
    beam->shear[0] = along[beam->axis[0]] * beam->shear[2];
    beam->shear[1] = along[beam->axis[1]] * beam->shear[2];
}

/* What is still to be looked at, the last first. */
typedef struct {
    Num near;
    int32_t child;
} Pending;

enum { PENDING_MOST = BVH_DEPTH * (BVH_WIDTH - 1) + BVH_WIDTH };

/* Which of the node's boxes the ray meets before tmax, and where it enters them. Comparisons that a nan (0
   times infinity) fails keep what there was. */
STAGE unsigned boxes_met(const TreeNode *node, const Beam *beam, Num tmax, Num distance[8])
{
    unsigned bits = 0;
    for (int part = 0; part < 8; part += PIECE) {
        Piece near = {0}, far = (Piece){0} + tmax;
        UNROLLED for (int i = 0; i < 3; i++) {
            Piece enter, leave;
            memcpy(&enter, node->plane[beam->near[i]] + part, sizeof enter);
            memcpy(&leave, node->plane[beam->far[i]] + part, sizeof leave);
            enter = (enter - beam->near_o[i]) * beam->inverse[i];
            leave = (leave - beam->far_o[i]) * beam->inverse[i];
            near = PIECE_MAX(enter, near);
            far = PIECE_MIN(leave, far);
        }
        PieceMask met = near <= far * (1 + 8 * ROUNDING);
#ifdef EVERY_BOX /* for the test that boxes leave out nothing that is met */
        met = ~(PieceMask){0};
        near = (Piece){0};
#endif
        memcpy(distance + part, &near, sizeof near);
        bits |= piece_bits(&met) << part;
    }
    return bits;
}

/* Puts down the children that the ray meets before tmax, the nearest last. */
INLINE void add_children(const TreeNode *node, const Beam *beam, Num tmax, Pending *pending, int *count)
{
    Num distance[8];
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

#endif
