/* Packets: rays of several lanes that go much the same way through the tree of triangles together. Eight boxes at once are
   tested against what any of the rays may be, then each that is left against all rays; a triangle against all rays. Where
   few rays are left, each goes on by itself, in turn. What is met is the same, by the same numbers. */
#pragma once

#include "shapes/few.h"
#include "shapes/shape.h"

#if BOXES == 8 && LANES >= 8 /* of fewer it takes more instructions than of single rays */
#define PACKETS 1
#else
#define PACKETS 0
#endif

#if PACKETS

/* Of how many rays a packet is made, and from how few on each goes on by itself. */
enum { PACKET_FORMS = LANES / 2, PACKET_LEAST = 4 };
#define PACKET_ORIGINS 0.0625   /* how far apart they may start along an axis, of the tree's extent */
#define PACKET_DIRECTIONS 0.125 /* how different their directions may be along an axis */

/* A float a lane. */
typedef float Floats __attribute__((vector_size(4 * LANES)));
typedef int32_t FloatsMask __attribute__((vector_size(4 * LANES)));
#if LANES == 16
#define FLOATS(name, ...) ((Floats)_mm512_##name##_ps(__VA_ARGS__))
#else
#define FLOATS(name, ...) ((Floats)_mm256_##name##_ps(__VA_ARGS__))
#endif
#define FLOATS_OF(a) ((Floats)EACH((float)(a)))

INLINE Floats floats_at(const float a[LANES])
{
    Floats b;
    memcpy(&b, a, sizeof b);
    return b;
}
INLINE unsigned at_most(Floats a, Floats b)
{
#if LANES == 16
    return _mm512_cmp_ps_mask(a, b, _CMP_LE_OQ);
#else
    return (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ));
#endif
}

/* The smallest and largest of these lanes' numbers. */
typedef struct {
    float low, high;
} Range;
INLINE float lowest_of(Floats a)
{
#if LANES == 16
    return _mm512_reduce_min_ps(a);
#else
    __m128 four = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    __m128 two = _mm_min_ps(four, _mm_movehl_ps(four, four));
    return _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps(two, two, 1)));
#endif
}
INLINE Range range_of(Floats a, unsigned lanes)
{
    Floats b = FLOATS_OF(a[lowest_lane(lanes)]);
    for (int lane = 0; lane < LANES; lane++)
        b[lane] = lanes >> lane & 1 ? a[lane] : b[lane];
    return (Range){lowest_of(b), -lowest_of(-b)};
}

/* For all rays of a packet along one axis: the least and the greatest 1/d, and the product of each with that o of any ray
   from which a plane is met first, or for far planes last. The distance to a plane is linear in 1/d, so that no ray's is
   below the smaller, or above the larger, of the two that are computed. Their rounding is that of a single ray
   (beams_start): an o that is farther from 0 than the ray's own is so to the safe side, by more than its rounding. */
typedef struct {
    BoxPiece low[2], high[2]; /* the number and the product */
} Spread;

INLINE Spread spread_of(float low, float high, float o)
{
    return (Spread){{BOX_OF(low), BOX_OF(low * o)}, {BOX_OF(high), BOX_OF(high * o)}};
}

typedef struct {
    const Beams *beams;
    int lane; /* one of them, whose planes and axes are those of all */
    Spread first[3], last[3];
} Packet;

/* Of `lanes` those whose rays start near this lane's, which is one of them, and go in much the same direction. */
INLINE unsigned lanes_alike(const Tree *tree, const Beams *beams, const Ray *ray, unsigned lanes, int lane)
{
    const Real o[3] = {ray->o.x, ray->o.y, ray->o.z}, d[3] = {ray->d.x, ray->d.y, ray->d.z};
    Index z, octant;
    memcpy(&z, beams->axis[2], sizeof z);
    memcpy(&octant, beams->octant, sizeof octant);
    Mask alike = (z == index_of(beams->axis[2][lane])) & (octant == index_of(beams->octant[lane]));
    Real extent = real(0);
    UNROLLED for (int i = 0; i < 3; i++)
    {
        extent = real_max(real(tree->extent[i]), extent);
    }
    UNROLLED for (int i = 0; i < 3; i++)
    {
        alike &= real_abs(o[i] - real(LANE(o[i], lane))) <= extent * real(PACKET_ORIGINS);
        alike &= real_abs(d[i] - real(LANE(d[i], lane))) <= real(PACKET_DIRECTIONS);
    }
    return lanes & mask_bits(alike);
}

/* Makes a packet of this lane's ray and those of `lanes` that are like it, and gives their lanes: none where they are few,
   or nan lets one of them meet every box (beams_start). */
INLINE unsigned packet_from(
    Packet *p, const Tree *tree, const Beams *beams, const Ray *ray, unsigned lanes, int lane)
{
    lanes = lanes_alike(tree, beams, ray, lanes, lane);
    Floats o_x = floats_at(beams->near_o[0]);
    if (__builtin_popcount(lanes) < PACKET_FORMS || (lanes & ~at_most(o_x, o_x)))
        return 0;
    p->beams = beams;
    p->lane = lane;
    UNROLLED for (int i = 0; i < 3; i++)
    {
        int backwards = beams->octant[lane] >> i & 1;
        Floats near_o = floats_at(beams->near_o[i]), far_o = floats_at(beams->far_o[i]);
        Range inverse = range_of(floats_at(beams->inverse[i]), lanes), near = range_of(near_o, lanes),
              far = range_of(far_o, lanes);
        p->first[i] = spread_of(inverse.low, inverse.high, backwards ? near.low : near.high);
        p->last[i] = spread_of(inverse.low * MARGIN, inverse.high * MARGIN, backwards ? far.high : far.low);
    }
    return lanes;
}

/* Which of eight boxes, by their near and far planes, any of the rays may meet before `limit`. */
INLINE unsigned packet_range(const Packet *p, const BoxPiece first[3], const BoxPiece last[3], float limit)
{
    BoxPiece near = {0}, far = BOX_OF(limit);
    UNROLLED for (int i = 0; i < 3; i++)
    {
        const Spread *in = &p->first[i], *out = &p->last[i];
        near = BOX_MAX(BOX_MIN(BOX_FMSUB(first[i], in->low[0], in->low[1]),
                           BOX_FMSUB(first[i], in->high[0], in->high[1])),
            near);
        far = BOX_MIN(BOX_MAX(BOX_FMSUB(last[i], out->low[0], out->low[1]),
                          BOX_FMSUB(last[i], out->high[0], out->high[1])),
            far);
    }
    BoxMask met = near <= far;
#ifdef EVERY_BOX
    met = ~(BoxMask){0};
#endif
    return box_bits(&met);
}

/* Which rays meet box k of the node before their limits. */
INLINE unsigned packet_box(const Packet *p, const TreeNode *node, int k, Floats limit)
{
    const Beams *b = p->beams;
    const float *planes = node->plane[0];
    Floats near = {0}, far = limit;
    UNROLLED for (int i = 0; i < 3; i++)
    {
        Floats first = FLOATS_OF(planes[b->first[i][p->lane] + k]),
               last = FLOATS_OF(planes[b->last[i][p->lane] + k]);
        near = FLOATS(max, FLOATS(fmsub, first, floats_at(b->inverse[i]), floats_at(b->near[i])), near);
        far = FLOATS(min, FLOATS(fmsub, last, floats_at(b->wider[i]), floats_at(b->far[i])), far);
    }
#ifdef EVERY_BOX
    near = far;
#endif
    return at_most(near, far);
}

/* The leaf's triangles whose boxes any of the rays may meet. */
INLINE unsigned packet_leaf(const Packet *p, const TriangleLeaf *leaf, const Tree *tree, float limit)
{
    BoxPiece first[3], last[3];
    BoxMask slots; /* negative where there is none */
    memcpy(&slots, leaf->slot, sizeof slots);
    UNROLLED for (int i = 0; i < 3; i++)
    {
        float range[2][8];
        int backwards = p->beams->octant[p->lane] >> i & 1;
        corner_range(leaf, i, tree->center[i], range[0], range[1]);
        memcpy(&first[i], range[backwards], sizeof first[i]);
        memcpy(&last[i], range[!backwards], sizeof last[i]);
    }
    return packet_range(p, first, last, limit) & ~box_bits(&slots);
}

/* leaf_meets the other way round: one triangle, all rays. */
INLINE Mask triangle_meets(const Packet *p, const TriangleLeaf *leaf, int k, Real *t)
{
    const Beams *b = p->beams;
    const Int x_axis = b->axis[0][p->lane], y_axis = b->axis[1][p->lane], z_axis = b->axis[2][p->lane];
    Real x[3], y[3], z[3], o[3], shear[3];
    memcpy(o, b->o, sizeof o);
    memcpy(shear, b->shear, sizeof shear);
    UNROLLED for (int c = 0; c < 3; c++)
    {
        z[c] = real(leaf->corner[c][z_axis][k]) - o[2];
        x[c] = (real(leaf->corner[c][x_axis][k]) - o[0]) - shear[0] * z[c];
        y[c] = (real(leaf->corner[c][y_axis][k]) - o[1]) - shear[1] * z[c];
    }
    Real u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    Real least = real_min(real_min(u, v), w), most = real_max(real_max(u, v), w);
    Mask inside = (least >= real(0)) | (most <= real(0));
    *t = real(0);
    if (!any(inside))
        return inside;
    Real sum = u + v + w;
    *t = (u * z[0] + v * z[1] + w * z[2]) * shear[2] / sum;
    return inside & (sum != real(0)) & (*t > real(0));
}

/* What is still to be looked at: a node or leaf, and by which rays. */
typedef struct {
    int count;
    int32_t child[PENDING_MOST];
    unsigned lanes[PENDING_MOST];
} PacketPending;

INLINE void put_packet(
    const Packet *p, const TreeNode *node, unsigned lanes, float most, Floats limit, PacketPending *pending)
{
    const float *planes = node->plane[0];
    BoxPiece first[3], last[3];
    UNROLLED for (int i = 0; i < 3; i++)
    {
        memcpy(&first[i], planes + p->beams->first[i][p->lane], sizeof first[i]);
        memcpy(&last[i], planes + p->beams->last[i][p->lane], sizeof last[i]);
    }
    unsigned some = packet_range(p, first, last, most);
    int turned = turned_order(p->beams->octant[p->lane]), order = (int)p->beams->octant[p->lane] ^ turned;
    for (int i = 0; some && i < BVH_WIDTH; i++) {
        int k = node->order[order][i ^ turned];
        unsigned here =
            some >> k & 1 && node->where.child[k] != -1 ? lanes & packet_box(p, node, k, limit) : 0;
        pending->child[pending->count] = node->where.child[k];
        pending->lanes[pending->count] = here;
        pending->count += here != 0;
    }
}

INLINE Floats limits_of(const Wanted *wanted)
{
    float t[LANES];
    floats_of(t, wanted->t);
    return floats_at(t) * FLOATS_OF(MARGIN);
}

/* The way of a packet through the tree. */
INLINE void packet_walk(const Triangles *triangles, const Packet *p, unsigned lanes, int nearest, Wanted *w)
{
    const TreeNode *nodes = triangles->tree.nodes;
    PacketPending pending;
    Mask in = lanes_mask(lanes);
    Floats limit = limits_of(w);
    float most = range_of(limit, lanes).high;
    pending.count = 0;
    put_packet(p, &nodes[0], lanes, most, limit, &pending);
    while (pending.count > 0 && (nearest || lanes & ~w->blocked)) {
        int child = pending.child[--pending.count];
        unsigned some = pending.lanes[pending.count] & ~w->blocked;
        if (__builtin_popcount(some) < PACKET_LEAST) {
            if (nearest) {
                triangles_nearest(triangles, some, child, w);
                limit = limits_of(w);
            } else {
                triangles_block(triangles, some, child, w);
            }
        } else if (child >= 0) {
            put_packet(p, &nodes[child], some, most, limit, &pending);
        } else {
            const TriangleLeaf *leaf = &triangles->leaves[-2 - child];
            Mask taken = mask_none();
            for (unsigned left = packet_leaf(p, leaf, &triangles->tree, most); left; left &= left - 1) {
                int k = lowest_lane(left), here = leaf->slot[k];
                Real t;
                const Int place = place_of(w, here);
                Mask met = and_not(in & triangle_meets(p, leaf, k, &t), w->from == index_of(place));
                if (nearest) {
                    met &= (t < w->t) | ((t == w->t) & (index_of(here) < w->slot));
                    if (w->hidden && w->shines[triangles->row[here - triangles->first_slot]])
                        met = and_not(met, lanes_mask(w->hidden));
                    taken |= met;
                    w->t = select(met, t, w->t);
                    w->slot = index_select(met, index_of(here), w->slot);
                } else {
                    w->blocked |= mask_bits(and_not(met & (t < w->t), w->target == index_of(place)));
                }
            }
            if (nearest && any(taken)) {
                limit = limits_of(w);
                most = range_of(limit, lanes).high;
            }
        }
    }
}

APART void packet_nearest(const Triangles *triangles, const Packet *p, unsigned lanes, Wanted *w)
{
    packet_walk(triangles, p, lanes, 1, w);
}
APART void packet_blocks(const Triangles *triangles, const Packet *p, unsigned lanes, Wanted *w)
{
    packet_walk(triangles, p, lanes, 0, w);
}

#endif

/* Lets those of `lanes` that are alike go through the tree in packets; gives the others. */
INLINE unsigned packets(const Triangles *triangles, const Ray *ray, unsigned lanes, int nearest, Wanted *w)
{
    unsigned others = lanes;
#if PACKETS
    for (unsigned left = lanes; __builtin_popcount(left) >= PACKET_FORMS;) {
        Packet packet;
        unsigned alike = packet_from(&packet, &triangles->tree, w->beams, ray, left, lowest_lane(left));
        left &= ~(alike ? alike : left & -left);
        others &= ~alike;
        if (alike && nearest)
            packet_nearest(triangles, &packet, alike, w);
        else if (alike)
            packet_blocks(triangles, &packet, alike, w);
    }
#endif
    (void)triangles, (void)ray, (void)nearest, (void)w;
    return others;
}
