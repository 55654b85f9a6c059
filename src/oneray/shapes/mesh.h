/* Triangles, and what a ray meets among them. */
#ifndef ONERAY_SHAPES_MESH_H
#define ONERAY_SHAPES_MESH_H

#include "trees/tree.h"

/* Up to eight triangles side by side. Of the places left empty all corners are one point, which no ray
   meets. */
typedef struct {
    Num corner[3][3][8]; /* [corner][axis] */
    int32_t slot[8];
} TriangleLeaf;

typedef struct {
    Tree tree;
    TriangleLeaf *leaves;
    const int32_t (*corner)[3]; /* by triangle: its vertices, counter-clockwise around the normal */
    const int32_t *row;         /* by triangle: its mesh's row in the tables by slot */
    const Num (*vertex)[3], (*normal)[3];
    int first_slot;             /* triangle i has the slot first_slot + i */
} Triangles;

/* Which of the leaf's triangles the ray's line meets at t > 0, and where: the edge functions of the triangle
   sheared along the ray, which are products of the same rounded numbers on both sides of an edge, so that a
   line can slip through neither edge nor corner. 0 counts as inside. Woop, Benthin, Wald, Watertight
   Ray/Triangle Intersection, JCGT 2(1), 2013. */
INLINE unsigned leaf_meets(const TriangleLeaf *leaf, const Beam *beam, Num t[8])
{
    unsigned bits = 0;
    for (int part = 0; part < 8; part += PIECE) {
        Piece x[3], y[3], z[3], zero = {0};
        UNROLLED for (int c = 0; c < 3; c++) {
            memcpy(&x[c], leaf->corner[c][beam->axis[0]] + part, sizeof x[c]);
            memcpy(&y[c], leaf->corner[c][beam->axis[1]] + part, sizeof y[c]);
            memcpy(&z[c], leaf->corner[c][beam->axis[2]] + part, sizeof z[c]);
            z[c] = z[c] - PIECE_OF(BEAM(beam, o[2]));
            x[c] = (x[c] - PIECE_OF(BEAM(beam, o[0]))) - PIECE_OF(BEAM(beam, shear[0])) * z[c];
            y[c] = (y[c] - PIECE_OF(BEAM(beam, o[1]))) - PIECE_OF(BEAM(beam, shear[1])) * z[c];
        }
        Piece u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
        Piece least = PIECE_MIN(PIECE_MIN(u, v), w), most = PIECE_MAX(PIECE_MAX(u, v), w);
        PieceMask inside = (least >= zero) | (most <= zero);
        if (!piece_bits(&inside))
            continue;
        Piece sum = u + v + w, at = (u * z[0] + v * z[1] + w * z[2]) * PIECE_OF(BEAM(beam, shear[2])) / sum;
        inside &= (sum != zero) & (at > zero);
        memcpy(t + part, &at, sizeof at);
        bits |= piece_bits(&inside) << part;
    }
    return bits;
}

/* The nearest before *t, or as near and of a lower slot. `shines`, where not NULL, says by row what the ray
   passes by. */
static inline void triangles_nearest(
    const Triangles *triangles, const Beam *beam, const Int *shines, Num *t, Int *slot)
{
    Pending pending[PENDING_MOST];
    pending[0] = (Pending){0, 0};
    for (int count = 1; count > 0;) {
        Pending next = pending[--count];
        if (next.near > *t * (1 + 8 * ROUNDING))
            continue;
        if (next.child >= 0) {
            add_children(&triangles->tree.nodes[next.child], beam, (float)*t, pending, &count);
            continue;
        }
        const TriangleLeaf *leaf = &triangles->leaves[-2 - next.child];
        Num at[8];
        for (unsigned bits = leaf_meets(leaf, beam, at); bits; bits &= bits - 1) {
            int k = lowest_lane(bits), here = leaf->slot[k];
            if (here == beam->from || !(at[k] < *t || (at[k] == *t && here < *slot)))
                continue;
            if (shines && shines[triangles->row[here - triangles->first_slot]])
                continue;
            *t = at[k];
            *slot = here;
        }
    }
}

/* L3 Is any in the way before t, one that is neither where the ray starts nor where it ends? */
static inline int triangles_block(const Triangles *triangles, const Beam *beam, Num t)
{
    Pending pending[PENDING_MOST];
    pending[0] = (Pending){0, 0};
    for (int count = 1; count > 0;) {
        int child = pending[--count].child;
        if (child >= 0) {
            add_children(&triangles->tree.nodes[child], beam, (float)t, pending, &count);
            continue;
        }
        const TriangleLeaf *leaf = &triangles->leaves[-2 - child];
        Num at[8];
        for (unsigned bits = leaf_meets(leaf, beam, at); bits; bits &= bits - 1) {
            int k = lowest_lane(bits);
            if (at[k] < t && leaf->slot[k] != beam->from && leaf->slot[k] != beam->target)
                return 1;
        }
    }
    return 0;
}

INLINE Real largest(Vec a) { return real_max(real_max(real_abs(a.x), real_abs(a.y)), real_abs(a.z)); }

/* The unit normal of the edges a, b from one corner, whatever their lengths: no square underflows. */
INLINE Vec normal_of_edges(Vec a, Vec b)
{
    Vec across = vec_cross(vec_scale(a, real(1) / largest(a)), vec_scale(b, real(1) / largest(b)));
    return vec_normalize(vec_scale(across, real(1) / largest(across)));
}

INLINE Index gather_int32(const int32_t *table, Index i)
{
    Index a = index_of(0);
    for (int lane = 0; lane < LANES; lane++)
        LANE(a, lane) = table[LANE(i, lane)];
    return a;
}

/* Puts p onto the triangle's plane. Gives the normal of the plane, and the interpolated one that light is
   reflected by: Mitsuba's, the mean of the vertices' by barycentric coordinates. */
STAGE void triangle_surface(const Triangles *triangles, Index i, int smooth, Vec *p, Vec *n, Vec *face)
{
    Index corner[3];
    Vec vertex[3];
    for (int c = 0; c < 3; c++) {
        corner[c] = gather_int32(&triangles->corner[0][c], i * 3);
        vertex[c] = vec_gather(triangles->vertex, corner[c]);
    }
    Vec a = vec_sub(vertex[1], vertex[0]), b = vec_sub(vertex[2], vertex[0]);
    *n = *face = normal_of_edges(a, b);
    Vec at = vec_sub(*p, vertex[0]);
    Vec off_plane = vec_scale(*face, vec_dot(*face, at));
    *p = vec_sub(*p, off_plane);
    if (!smooth)
        return;
    Real scale = real(1) / real_max(largest(a), largest(b));
    a = vec_scale(a, scale), b = vec_scale(b, scale);
    at = vec_scale(vec_sub(at, off_plane), scale);
    Real whole = real(1) / vec_dot(*face, vec_cross(a, b));
    Real second = vec_dot(*face, vec_cross(at, b)) * whole, third = vec_dot(*face, vec_cross(a, at)) * whole;
    const Real share[3] = {real(1) - second - third, second, third};
    Vec mean = vec_all(real(0));
    for (int c = 0; c < 3; c++)
        mean = vec_add(mean, vec_scale(vec_gather(triangles->normal, corner[c]), share[c]));
    *n = vec_select(vec_dot(mean, mean) > real(0), vec_normalize(mean), *face);
}

#endif
