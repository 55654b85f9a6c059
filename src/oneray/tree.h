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

/* Eight numbers for one ray, at every LANES. They stay out of function signatures, where a processor without
   registers of this width would have another calling convention. */
#define EIGHT_BYTES (8 * NUM_BYTES)
typedef Num Eight __attribute__((vector_size(EIGHT_BYTES)));
typedef Int EightMask __attribute__((vector_size(EIGHT_BYTES)));

#define EIGHT_SELECT(m, a, b) ((Eight)(((m) & (EightMask)(a)) | (~(m) & (EightMask)(b))))

/* A bit for each of the eight. */
INLINE unsigned eight_bits(const EightMask *m)
{
    unsigned bits = 0;
#if defined(__AVX512DQ__) && !defined(SINGLE)
    bits = _mm512_movepi64_mask((__m512i)*m);
#elif defined(__AVX2__)
    for (int part = 0; part < EIGHT_BYTES / 32; part++) {
#ifdef SINGLE
        bits |= (unsigned)_mm256_movemask_ps(_mm256_loadu_ps((const Num *)m)) << (8 * part);
#else
        bits |= (unsigned)_mm256_movemask_pd(_mm256_loadu_pd((const Num *)m + 4 * part)) << (4 * part);
#endif
    }
#else
    for (int k = 0; k < 8; k++)
        bits |= (unsigned)((*m)[k] & 1) << k;
#endif
    return bits;
}

typedef struct {
    Num low[3][BVH_WIDTH], high[3][BVH_WIDTH];
    BvhNode where;
} TreeNode;

typedef struct {
    TreeNode *nodes; /* NULL: nothing in it */
    Num low[3], high[3];
} Tree;

/* One ray, as a tree takes it. */
typedef struct {
    Num o[3], d[3], inverse[3];
    Num near_o[3], far_o[3]; /* o, moved so that near planes are nearer and far planes farther */
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
    for (int i = 0; i < 3; i++) {
        beam->o[i] = from[i];
        beam->d[i] = along[i];
        beam->inverse[i] = 1 / along[i];
        beam->near_o[i] = beam->inverse[i] < 0 ? from[i] - slack : from[i] + slack;
        beam->far_o[i] = beam->inverse[i] < 0 ? from[i] + slack : from[i] - slack;
        beam->axis[i] = (z + 1 + i) % 3;
    }
    beam->shear[0] = along[beam->axis[0]] / along[z];
    beam->shear[1] = along[beam->axis[1]] / along[z];
    beam->shear[2] = 1 / along[z];
}

/* What is still to be looked at, the last first. */
typedef struct {
    Num near;
    int32_t child;
} Pending;

enum { PENDING_MOST = BVH_DEPTH * (BVH_WIDTH - 1) + BVH_WIDTH };

/* Puts down the children whose boxes the ray meets before tmax, the nearest last. Comparisons that a nan (0
   times infinity) fails keep what there was. */
INLINE void add_children(const TreeNode *node, const Beam *beam, Num tmax, Pending *pending, int *count)
{
    Eight near = {0}, far = (Eight){0} + tmax;
    for (int i = 0; i < 3; i++) {
        Eight enter, leave;
        memcpy(&enter, beam->inverse[i] < 0 ? node->high[i] : node->low[i], sizeof enter);
        memcpy(&leave, beam->inverse[i] < 0 ? node->low[i] : node->high[i], sizeof leave);
        enter = (enter - beam->near_o[i]) * beam->inverse[i];
        leave = (leave - beam->far_o[i]) * beam->inverse[i];
        EightMask later = enter > near, sooner = leave < far;
        near = EIGHT_SELECT(later, enter, near);
        far = EIGHT_SELECT(sooner, leave, far);
    }
    EightMask met = near <= far * (1 + 8 * ROUNDING);
#ifdef EVERY_BOX /* for the test that boxes leave out nothing that is met */
    met = ~(EightMask){0};
    near = (Eight){0};
#endif
    Num distance[8];
    memcpy(distance, &near, sizeof distance);
    int first = *count;
    for (unsigned bits = eight_bits(&met); bits; bits &= bits - 1) {
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
