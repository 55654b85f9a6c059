/* Packets: rays of several lanes that go much the same way through the tree of triangles together. Eight boxes at once are
   tested against what any of the rays may be, then each that is left against all rays; a triangle against all rays. Where
   few rays are left, each goes on by itself. What is met is the same, by the same numbers. */
#pragma once

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

#if LANES == 16
#define LANE_BITS {1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768}
#else
#define LANE_BITS {1, 2, 4, 8, 16, 32, 64, 128}
#endif
INLINE Mask lanes_mask(unsigned bits) { return (index_of(bits) & (Index)LANE_BITS) != 0; }

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
    const FloatsMask in = ((FloatsMask)EACH((int32_t)lanes) & (FloatsMask)LANE_BITS) != 0;
    Floats b = (Floats)MASK_SELECT(in, (FloatsMask)a, (FloatsMask)FLOATS_OF(a[lowest_lane(lanes)]));
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
    Floats inverse[3], near[3], wider[3], far[3]; /* as Slabs has them, by lane */
    Spread first[3], last[3];
    int near_plane[3], far_plane[3], axis[3], order, turned;
    Real o[3], shear[3];
} Packet;

/* Of `lanes` those whose rays start near this lane's, which is one of them, and go in much the same direction. */
INLINE unsigned lanes_alike(const Tree *tree, const Beams *beams, const Ray *ray, unsigned lanes, int lane)
{
    const Real o[3] = {ray->o.x, ray->o.y, ray->o.z}, d[3] = {ray->d.x, ray->d.y, ray->d.z};
    Index z;
    memcpy(&z, beams->z, sizeof z);
    Mask alike = z == index_of(beams->z[lane]);
    Real extent = real(0);
    UNROLLED for (int i = 0; i < 3; i++)
    {
        lanes &= beams->backwards[i] >> lane & 1 ? beams->backwards[i] : ~beams->backwards[i];
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
    Beam beam = beam_of(beams, lowest_lane(lanes), -1, -1);
    Slabs slabs = slabs_of(&beam);
    p->beams = beams;
    p->order = slabs.order;
    p->turned = slabs.turned;
    UNROLLED for (int i = 0; i < 3; i++)
    {
        Floats near_o = floats_at(beams->near_o[i]), far_o = floats_at(beams->far_o[i]);
        p->near_plane[i] = slabs.near_plane[i];
        p->far_plane[i] = slabs.far_plane[i];
        p->axis[i] = beam.axis[i];
        p->inverse[i] = floats_at(beams->inverse[i]);
        p->wider[i] = p->inverse[i] * FLOATS_OF(MARGIN);
        p->near[i] = near_o * p->inverse[i];
        p->far[i] = far_o * p->wider[i];
        memcpy(&p->o[i], beams->o[i], sizeof p->o[i]);
        memcpy(&p->shear[i], beams->shear[i], sizeof p->shear[i]);
        int backwards = slabs.near_plane[i] >= 3;
        Range inverse = range_of(p->inverse[i], lanes), near = range_of(near_o, lanes),
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
    Floats near = {0}, far = limit;
    UNROLLED for (int i = 0; i < 3; i++)
    {
        Floats first = FLOATS_OF(node->plane[p->near_plane[i]][k]),
               last = FLOATS_OF(node->plane[p->far_plane[i]][k]);
        near = FLOATS(max, FLOATS(fmsub, first, p->inverse[i], p->near[i]), near);
        far = FLOATS(min, FLOATS(fmsub, last, p->wider[i], p->far[i]), far);
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
        int backwards = p->near_plane[i] >= 3;
        corner_range(leaf, i, tree->center[i], range[0], range[1]);
        memcpy(&first[i], range[backwards], sizeof first[i]);
        memcpy(&last[i], range[!backwards], sizeof last[i]);
    }
    return packet_range(p, first, last, limit) & ~box_bits(&slots);
}

/* leaf_meets the other way round: one triangle, all rays. */
INLINE Mask triangle_meets(const Packet *p, const TriangleLeaf *leaf, int k, Real *t)
{
    Real x[3], y[3], z[3];
    UNROLLED for (int c = 0; c < 3; c++)
    {
        z[c] = real(leaf->corner[c][p->axis[2]][k]) - p->o[2];
        x[c] = (real(leaf->corner[c][p->axis[0]][k]) - p->o[0]) - p->shear[0] * z[c];
        y[c] = (real(leaf->corner[c][p->axis[1]][k]) - p->o[1]) - p->shear[1] * z[c];
    }
    Real u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    Real least = real_min(real_min(u, v), w), most = real_max(real_max(u, v), w);
    Mask inside = (least >= real(0)) | (most <= real(0));
    *t = real(0);
    if (!any(inside))
        return inside;
    Real sum = u + v + w;
    *t = (u * z[0] + v * z[1] + w * z[2]) * p->shear[2] / sum;
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
    BoxPiece first[3], last[3];
    UNROLLED for (int i = 0; i < 3; i++)
    {
        memcpy(&first[i], node->plane[p->near_plane[i]], sizeof first[i]);
        memcpy(&last[i], node->plane[p->far_plane[i]], sizeof last[i]);
    }
    unsigned some = packet_range(p, first, last, most);
    for (int i = 0; some && i < BVH_WIDTH; i++) {
        int k = node->order[p->order][p->turned ? BVH_WIDTH - 1 - i : i];
        unsigned here =
            some >> k & 1 && node->where.child[k] != -1 ? lanes & packet_box(p, node, k, limit) : 0;
        pending->child[pending->count] = node->where.child[k];
        pending->lanes[pending->count] = here;
        pending->count += here != 0;
    }
}

/* What rays want to know: the nearest before *t, as triangles_nearest finds it, or whether any is before *t. */
typedef struct {
    Index from, target; /* slots */
    const Int *shines; /* by row, what the rays of `hidden` pass by */
    unsigned hidden;
    Real *t;
    Index *slot;
} Wanted;

INLINE Floats limits_of(const Wanted *wanted)
{
    float t[LANES];
    floats_of(t, *wanted->t);
    return floats_at(t) * FLOATS_OF(MARGIN);
}

/* The way of a packet through the tree: gives the lanes that are not blocked. */
INLINE unsigned packet_walk(
    const Triangles *triangles, const Packet *p, unsigned lanes, const Wanted *wanted, int nearest)
{
    const TreeNode *nodes = triangles->tree.nodes;
    PacketPending pending;
    Mask in = lanes_mask(lanes);
    Floats limit = limits_of(wanted);
    float most = range_of(limit, lanes).high;
    pending.count = 0;
    put_packet(p, &nodes[0], lanes, most, limit, &pending);
    while (pending.count > 0 && lanes) {
        int child = pending.child[--pending.count];
        unsigned some = pending.lanes[pending.count] & lanes;
        if (__builtin_popcount(some) < PACKET_LEAST) {
            for (; some; some &= some - 1) {
                int lane = lowest_lane(some);
                Beam beam = beam_of(p->beams, lane, LANE(wanted->from, lane), LANE(wanted->target, lane));
                Num t = LANE(*wanted->t, lane);
                if (nearest) {
                    Int slot = LANE(*wanted->slot, lane);
                    const Int *shines = wanted->hidden >> lane & 1 ? wanted->shines : NULL;
                    triangles_nearest(triangles, &beam, child, shines, NULL, &t, &slot);
                    LANE(*wanted->t, lane) = t;
                    LANE(*wanted->slot, lane) = slot;
                } else if (triangles_block(triangles, &beam, child, NULL, t)) {
                    lanes &= ~(1u << lane);
                }
            }
            if (nearest)
                limit = limits_of(wanted);
        } else if (child >= 0) {
            put_packet(p, &nodes[child], some, most, limit, &pending);
        } else {
            const TriangleLeaf *leaf = &triangles->leaves[-2 - child];
            Mask taken = mask_none();
            for (unsigned left = packet_leaf(p, leaf, &triangles->tree, most); left; left &= left - 1) {
                int k = lowest_lane(left), here = leaf->slot[k];
                Real t;
                Mask met = and_not(in & triangle_meets(p, leaf, k, &t), wanted->from == index_of(here));
                if (nearest) {
                    met &= (t < *wanted->t) | ((t == *wanted->t) & (index_of(here) < *wanted->slot));
                    if (wanted->hidden && wanted->shines[triangles->row[here - triangles->first_slot]])
                        met = and_not(met, lanes_mask(wanted->hidden));
                    taken |= met;
                    *wanted->t = select(met, t, *wanted->t);
                    *wanted->slot = index_select(met, index_of(here), *wanted->slot);
                } else {
                    lanes &= ~mask_bits(and_not(met & (t < *wanted->t), wanted->target == index_of(here)));
                }
            }
            if (nearest && any(taken)) {
                limit = limits_of(wanted);
                most = range_of(limit, lanes).high;
            }
        }
    }
    return lanes;
}

APART void packet_nearest(const Triangles *triangles, const Packet *p, unsigned lanes, const Wanted *wanted)
{
    packet_walk(triangles, p, lanes, wanted, 1);
}
APART unsigned packet_passes(const Triangles *triangles, const Packet *p, unsigned lanes, const Wanted *wanted)
{
    return packet_walk(triangles, p, lanes, wanted, 0);
}

#endif
