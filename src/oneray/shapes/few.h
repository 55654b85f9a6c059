/* A mesh of few triangles, the room of quads that many scene files have, without a tree: all lanes look at all triangles at
   once. Corners and edges that triangles share are computed once: seen from the other side an edge function is the
   same number with the other sign, so that what is met is the same, by the same numbers, as leaf_meets has it. */
#pragma once

#include "shapes/mesh.h"

#define FEW_WORTHWHILE (LANES >= 4) /* fewer lanes are faster in the tree */
enum { FEW_TRIANGLES = 48, FEW_CORNERS = 64, FEW_EDGES = 112 };
#ifndef FEW_MOST
#define FEW_MOST FEW_TRIANGLES
#endif

typedef struct {
    uint8_t corner[3], edge[3]; /* edge k is the one across from corner k, … */
    Word turned[3];             /* … with this added to its sign */
    uint8_t left[3], right[3];  /* of those edges: where in `side` the rays are that pass it so */
    Int slot;
} FewTriangle;

struct few_triangles {
    int corner_count, edge_count, count;
    Num corner[FEW_CORNERS][4];
    uint8_t edge[FEW_EDGES][2]; /* from the corner of the lower number */
    FewTriangle triangle[FEW_TRIANGLES];
};

/* Are they looked at so, for so many lanes? */
INLINE int few_serve(const Triangles *triangles, unsigned lanes)
{
    return FEW_WORTHWHILE && triangles->few && 4 * __builtin_popcount(lanes) >= LANES;
}

/* Corners sheared along the rays, and edge functions. */
typedef struct {
    Real x[FEW_CORNERS], y[FEW_CORNERS], z[FEW_CORNERS], across[FEW_EDGES], stretch;
    unsigned side[2 * FEW_EDGES]; /* by edge, a bit a lane: >= 0, and <= 0 */
} FewSeen;

/* The coordinate along each lane's axis. */
INLINE Real coordinate(const Num p[4], Index axis)
{
#if defined(SINGLE) && LANES == 16 && defined(__AVX512DQ__)
    return (Real)_mm512_permutevar_ps(_mm512_broadcast_f32x4(_mm_loadu_ps(p)), (__m512i)axis);
#elif defined(SINGLE) && LANES == 8 && defined(__AVX2__)
    return (Real)_mm256_permutevar_ps(_mm256_broadcast_ps((const __m128 *)p), (__m256i)axis);
#elif !defined(SINGLE) && LANES == 8 && defined(__AVX512DQ__)
    return (Real)_mm512_permutexvar_pd((__m512i)axis, _mm512_broadcast_f64x4(_mm256_loadu_pd(p)));
#else
    return along_axis(axis == index_of(0), axis == index_of(1), real(p[0]), real(p[1]), real(p[2]));
#endif
}

INLINE void see_few(const struct few_triangles *few, const Beams *beams, FewSeen *seen)
{
    Index axis[3];
    Real o[3], shear[3];
    memcpy(axis, beams->axis, sizeof axis);
    memcpy(o, beams->o, sizeof o);
    memcpy(shear, beams->shear, sizeof shear);
    for (int i = 0; i < few->corner_count; i++) {
        const Num *p = few->corner[i];
        Real z = coordinate(p, axis[2]) - o[2];
        seen->x[i] = (coordinate(p, axis[0]) - o[0]) - shear[0] * z;
        seen->y[i] = (coordinate(p, axis[1]) - o[1]) - shear[1] * z;
        seen->z[i] = z;
    }
    for (int i = 0; i < few->edge_count; i++) {
        int from = few->edge[i][0], to = few->edge[i][1];
        seen->across[i] = seen->x[from] * seen->y[to] - seen->y[from] * seen->x[to];
        seen->side[2 * i] = mask_bits(seen->across[i] >= real(0));
        seen->side[2 * i + 1] = mask_bits(seen->across[i] <= real(0));
    }
    seen->stretch = shear[2];
}

/* A triangle that lines of rays meet, at t = way / sum. */
typedef struct {
    const FewTriangle *triangle;
    Mask met;
    Real way, sum;
} FewMet;

INLINE Real few_edge(const FewTriangle *triangle, const FewSeen *seen, int k)
{
    return bits_real(real_bits(seen->across[triangle->edge[k]]) ^ (Bits)EACH(triangle->turned[k]));
}

/* All that the lanes' rays may meet at 0 < t <= most. No processor foresees which those are: no step hangs on it. */
INLINE int find_few(
    const struct few_triangles *few, const FewSeen *seen, unsigned lanes, Real most, FewMet found[FEW_TRIANGLES])
{
    int count = 0, crossed = 0;
    struct {
        const FewTriangle *triangle;
        unsigned in;
    } inside[FEW_TRIANGLES + 1];
    for (int i = 0; i < few->count; i++) {
        const FewTriangle *triangle = &few->triangle[i];
        const unsigned *side = seen->side;
        const uint8_t *left = triangle->left, *right = triangle->right;
        inside[crossed].triangle = triangle;
        inside[crossed].in = lanes & ((side[left[0]] & side[left[1]] & side[left[2]])
                                         | (side[right[0]] & side[right[1]] & side[right[2]]));
        crossed += inside[crossed].in != 0;
    }
    for (int i = 0; i < crossed; i++) {
        const FewTriangle *triangle = inside[i].triangle;
        Real u = few_edge(triangle, seen, 0), v = few_edge(triangle, seen, 1), w = few_edge(triangle, seen, 2);
        Real sum = u + v + w, z[3];
        for (int k = 0; k < 3; k++)
            z[k] = seen->z[triangle->corner[k]];
        Real way = (u * z[0] + v * z[1] + w * z[2]) * seen->stretch, ahead = flip_sign(way, sum);
        Mask met = lanes_mask(inside[i].in) & (ahead > real(0));
        met &= ahead <= most * real_abs(sum) * real(1 + 8 * NUM_ROUNDING); /* spares divisions */
        found[count] = (FewMet){triangle, met, way, sum};
        count += any(met);
    }
    return count;
}

/* What triangles_walk finds from the root, by slots or by places. */
INLINE void few_walk(const Triangles *triangles, unsigned lanes, int nearest, Wanted *w)
{
    const struct few_triangles *few = triangles->few;
    FewSeen seen;
    FewMet found[FEW_TRIANGLES + 1];
    Mask hidden = lanes_mask(w->hidden), blocked = mask_none();
    see_few(few, w->beams, &seen);
    int count = find_few(few, &seen, lanes, w->t, found);
    for (int i = 0; i < count; i++) {
        const Int slot = found[i].triangle->slot;
        const Index here = index_of(slot), place = index_of(place_of(w, slot));
        Real t = found[i].way / found[i].sum;
        Mask met = found[i].met & (found[i].sum != real(0)) & (t > real(0));
        met = and_not(met, w->from == place);
        if (!nearest) {
            blocked |= and_not(met & (t < w->t), w->target == place);
            continue;
        }
        met &= (t < w->t) | ((t == w->t) & (here < w->slot));
        if (w->hidden && w->shines[triangles->row[slot - triangles->first_slot]])
            met = and_not(met, hidden);
        w->t = select(met, t, w->t);
        w->slot = index_select(met, here, w->slot);
    }
    w->blocked |= mask_bits(blocked);
}

APART void few_nearest(const Triangles *triangles, unsigned lanes, Wanted *w)
{
    few_walk(triangles, lanes, 1, w);
}
APART void few_block(const Triangles *triangles, unsigned lanes, Wanted *w)
{
    few_walk(triangles, lanes, 0, w);
}
