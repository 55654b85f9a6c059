/* A mesh of few triangles, the room of quads that many scene files have, without a tree: all lanes look at all triangles at
   once. Corners and edges that triangles share are computed once: seen from the other side an edge function is the
   same number with the other sign, so that what is met is the same, by the same numbers, as leaf_meets has it. */
#pragma once

#include "shapes/mesh.h"

#define FEW_WORTHWHILE (LANES >= 4) /* fewer lanes are faster in the tree */
enum { FEW_TRIANGLES = 48, FEW_CORNERS = 64, FEW_EDGES = 112 };

typedef struct {
    uint8_t corner[3], edge[3]; /* edge k is the one across from corner k, … */
    Word turned[3];             /* … with this added to its sign */
    Int slot;
} FewTriangle;

struct few_triangles {
    int corner_count, edge_count, count;
    Num corner[FEW_CORNERS][3];
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
} FewSeen;

INLINE void see_few(const struct few_triangles *few, const Beams *beams, FewSeen *seen)
{
    Index longest;
    Real o[3], shear[3];
    memcpy(&longest, beams->axis[2], sizeof longest);
    memcpy(o, beams->o, sizeof o);
    memcpy(shear, beams->shear, sizeof shear);
    Mask is_x = longest == index_of(0), is_y = longest == index_of(1);
    for (int i = 0; i < few->corner_count; i++) {
        Vec at = vec_of(few->corner[i]);
        Real z = along_axis(is_x, is_y, at.x, at.y, at.z) - o[2];
        seen->x[i] = (along_axis(is_x, is_y, at.y, at.z, at.x) - o[0]) - shear[0] * z;
        seen->y[i] = (along_axis(is_x, is_y, at.z, at.x, at.y) - o[1]) - shear[1] * z;
        seen->z[i] = z;
    }
    for (int i = 0; i < few->edge_count; i++) {
        int from = few->edge[i][0], to = few->edge[i][1];
        seen->across[i] = seen->x[from] * seen->y[to] - seen->y[from] * seen->x[to];
    }
    seen->stretch = shear[2];
}

INLINE Real few_edge(const FewTriangle *triangle, const FewSeen *seen, int k)
{
    return bits_real(real_bits(seen->across[triangle->edge[k]]) ^ (Bits)EACH(triangle->turned[k]));
}

/* Which lanes' rays meet the triangle at 0 < *t <= most. */
INLINE Mask few_meets(const FewTriangle *triangle, const FewSeen *seen, Mask lanes, Real most, Real *t)
{
    Real u = few_edge(triangle, seen, 0), v = few_edge(triangle, seen, 1), w = few_edge(triangle, seen, 2);
    Real least = real_min(real_min(u, v), w), greatest = real_max(real_max(u, v), w);
    Mask inside = lanes & ((least >= real(0)) | (greatest <= real(0)));
    if (!any(inside))
        return inside;
    Real sum = u + v + w, z[3];
    for (int k = 0; k < 3; k++)
        z[k] = seen->z[triangle->corner[k]];
    Real way = (u * z[0] + v * z[1] + w * z[2]) * seen->stretch, ahead = flip_sign(way, sum);
    inside &= (ahead > real(0)) & (ahead <= most * real_abs(sum) * real(1 + 8 * NUM_ROUNDING)); /* spares divisions */
    if (!any(inside))
        return inside;
    *t = way / sum;
    return inside & (sum != real(0)) & (*t > real(0)) & (*t <= most);
}

/* What triangles_walk finds from the root, by slots or by places. */
INLINE void few_walk(const Triangles *triangles, unsigned some, int nearest, Wanted *w)
{
    const struct few_triangles *few = triangles->few;
    FewSeen seen;
    Mask lanes = lanes_mask(some), hidden = lanes_mask(w->hidden);
    unsigned blocked = 0;
    Real t = w->t, at;
    Index slot = w->slot;
    see_few(few, w->beams, &seen);
    for (int i = 0; i < few->count; i++) {
        const FewTriangle *triangle = &few->triangle[i];
        Mask met = few_meets(triangle, &seen, lanes, t, &at);
        if (!any(met))
            continue;
        const Index here = index_of(triangle->slot), place = index_of(place_of(w, triangle->slot));
        met = and_not(met, w->from == place);
        if (!nearest) {
            met = and_not(met & (at < t), w->target == place);
            lanes = and_not(lanes, met);
            blocked |= mask_bits(met);
            if (blocked == some)
                break;
            continue;
        }
        met &= (at < t) | (here < slot);
        if (w->hidden && w->shines[triangles->row[triangle->slot - triangles->first_slot]])
            met = and_not(met, hidden);
        t = select(met, at, t);
        slot = index_select(met, here, slot);
    }
    w->t = t;
    w->slot = slot;
    w->blocked |= blocked;
}

APART void few_nearest(const Triangles *triangles, unsigned lanes, Wanted *w)
{
    few_walk(triangles, lanes, 1, w);
}
APART void few_block(const Triangles *triangles, unsigned lanes, Wanted *w)
{
    few_walk(triangles, lanes, 0, w);
}
