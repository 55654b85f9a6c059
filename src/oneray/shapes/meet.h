/* What rays meet among all shapes: by a loop over the few, by trees for triangles and for the many. */
#pragma once

#include "kinds/shapes.h"

/* How many slots a shape of this kind has. */
#define SLOTS(name) slots_of_planes(name##_planes)

#define HAS_PLANES (HAS_ALIGNED | HAS_ANY(FLAT_SHAPES) | HAS_ANY(POLYHEDRA))

/* The nearest so far, t = num/den. */
typedef struct {
    Real num, den;
    Index slot;
} Nearest;

INLINE void take_nearer(Nearest *nearest, Crossing c, Mask within, const Ray *ray, int slot)
{
    Mask nearer = within & (c.num > real(0)) & (c.num * nearest->den < nearest->num * c.den);
    nearer = and_not(nearer, ray->from == index_of(slot));
    nearest->num = select(nearer, c.num, nearest->num);
    nearest->den = select(nearer, c.den, nearest->den);
    nearest->slot = index_select(nearer, index_of(slot), nearest->slot);
}

INLINE void aligned_nearest(
    const Shapes *shapes, const Ray *ray, Mask hiding, int axis, Nearest *nearest, Features f)
{
    Real t, inverse = real(1) / along(ray->d, axis);
    for (int slot = shapes->along[axis]; slot < shapes->along[axis + 1]; slot++) {
        Mask nearer = aligned_meets(&ROWS(shapes, ALIGNED, Aligned)[slot], ray, axis, inverse, &t) & (t < nearest->num)
                      & can_meet(shapes, slot, hiding, f);
        nearer = and_not(nearer, ray->from == index_of(slot));
        nearest->num = select(nearer, t, nearest->num);
        nearest->slot = index_select(nearer, index_of(slot), nearest->slot);
    }
}

/* The nearest of the flat shapes; all that do not lie along the axes take one division. */
STAGE Hit flat_hit(const Shapes *shapes, const Ray *ray, Mask hiding, Features f)
{
    Nearest nearest = {ray->tmax, real(1), index_of(-1)};
    if (f.has & HAS_ALIGNED) {
        aligned_nearest(shapes, ray, hiding, 0, &nearest, f);
        aligned_nearest(shapes, ray, hiding, 1, &nearest, f);
        aligned_nearest(shapes, ray, hiding, 2, &nearest, f);
    }
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        for (int i = 0, slot = shapes->first[SHAPE_##NAME]; i < shapes->count[SHAPE_##NAME]; i++, slot++) {  \
            Mask within;                                                                                     \
            Crossing c = name##_cross(shapes, i, ray, &within);                                              \
            take_nearer(&nearest, c, within & can_meet(shapes, slot, hiding, f), ray, slot);                 \
        }
    FLAT_SHAPES(X)
#undef X
    return (Hit){f.has & HAS_ANY(FLAT_SHAPES) ? nearest.num / nearest.den : nearest.num, nearest.slot};
}

INLINE void take(Hit *hit, Mask met, Hit at)
{
    *hit = (Hit){select(met, at.t, hit->t), index_select(met, at.slot, hit->slot)};
}

/* The nearest of the solid ones. */
INLINE void solid_hit(const Shapes *shapes, const Ray *ray, Mask hiding, Hit *hit, Features f)
{
    Hit at;
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        for (int i = 0, slot = shapes->first[SHAPE_##NAME]; i < shapes->count[SHAPE_##NAME];                 \
             i++, slot += SLOTS(name)) {                                                                    \
            Mask met = name##_meets(shapes, i, slot, ray, &at);                                              \
            take(hit, met & (at.t < hit->t) & can_meet(shapes, slot, hiding, f), at);                        \
        }
    SOLID_SHAPES(X)
#undef X
}

/* Is a flat shape in the way, one that is neither where the ray starts nor where it ends? */
INLINE Mask flat_blocks(Crossing c, Mask within, const Ray *ray, Index target, int slot)
{
    Mask before = within & (c.num > real(0)) & (c.num < ray->tmax * c.den);
    return and_not(before, (ray->from == index_of(slot)) | (target == index_of(slot)));
}

INLINE Mask aligned_blocks(const Shapes *shapes, const Ray *ray, Index target, int axis)
{
    Mask blocked = mask_none();
    for (int slot = shapes->along[axis]; slot < shapes->along_blocking[axis]; slot++) {
        Crossing c = aligned_crossing(&ROWS(shapes, ALIGNED, Aligned)[slot], ray, axis);
        blocked |= flat_blocks(c, within_aligned(&ROWS(shapes, ALIGNED, Aligned)[slot], c), ray, target, slot);
    }
    return blocked;
}

/* Is any in the way, one after the other? */
STAGE Mask each_blocks(const Shapes *shapes, const Ray *ray, Index target, Features f)
{
    Mask blocked = mask_none();
    if (f.has & HAS_ALIGNED)
        blocked = aligned_blocks(shapes, ray, target, 0) | aligned_blocks(shapes, ray, target, 1)
                  | aligned_blocks(shapes, ray, target, 2);
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        for (int i = 0, slot = shapes->first[SHAPE_##NAME]; i < shapes->blocking[SHAPE_##NAME]; i++, slot++) { \
            Mask within;                                                                                     \
            Crossing c = name##_cross(shapes, i, ray, &within);                                              \
            blocked |= flat_blocks(c, within, ray, target, slot);                                            \
        }
    FLAT_SHAPES(X)
#undef X
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        for (int i = 0, slot = shapes->first[SHAPE_##NAME]; i < shapes->count[SHAPE_##NAME];                 \
             i++, slot += SLOTS(name))                                                                      \
            blocked |= name##_blocks(shapes, i, slot, ray, target);
    SOLID_SHAPES(X)
#undef X
    return blocked;
}

INLINE int axis_of_slot(const Shapes *shapes, int slot)
{
    return slot < shapes->along[1] ? 0 : slot < shapes->along[2] ? 1 : 2;
}

/* One shape, by its slot: the loops above for trees. */
#define IF_SLOT(NAME) if (slot < shapes->first[SHAPE_##NAME + 1])

STAGE Mask slot_meets(const Shapes *shapes, int slot, const Ray *ray, Hit *at)
{
    Mask within = mask_none(), itself = ray->from == index_of(slot);
    *at = (Hit){real(0), index_of(slot)};
    IF_SLOT(ALIGNED)
    {
        int axis = axis_of_slot(shapes, slot);
        Real inverse = real(1) / along(ray->d, axis);
        return and_not(aligned_meets(&ROWS(shapes, ALIGNED, Aligned)[slot], ray, axis, inverse, &at->t), itself);
    }
#define X(NAME, name, words)                                                                                 \
    IF_SLOT(NAME)                                                                                            \
    {                                                                                                        \
        Crossing c = name##_cross(shapes, slot - shapes->first[SHAPE_##NAME], ray, &within);                 \
        at->t = c.num / c.den;                                                                               \
        return and_not(within & (c.num > real(0)), itself);                                                  \
    }
    FLAT_SHAPES(X)
#undef X
#define X(NAME, name, words)                                                                                 \
    IF_SLOT(NAME)                                                                                            \
    return name##_meets(shapes, (slot - shapes->first[SHAPE_##NAME]) / SLOTS(name), slot, ray, at);
    SOLID_SHAPES(X)
#undef X
    return within;
}

STAGE Mask slot_blocks(const Shapes *shapes, int slot, const Ray *ray, Index target)
{
    Mask within = mask_none();
    IF_SLOT(ALIGNED)
    {
        const AlignedRow *row = &ROWS(shapes, ALIGNED, Aligned)[slot];
        Crossing c = aligned_crossing(row, ray, axis_of_slot(shapes, slot));
        return flat_blocks(c, within_aligned(row, c), ray, target, slot);
    }
#define X(NAME, name, words)                                                                                 \
    IF_SLOT(NAME)                                                                                            \
    {                                                                                                        \
        Crossing c = name##_cross(shapes, slot - shapes->first[SHAPE_##NAME], ray, &within);                 \
        return flat_blocks(c, within, ray, target, slot);                                                    \
    }
    FLAT_SHAPES(X)
#undef X
#define X(NAME, name, words)                                                                                 \
    IF_SLOT(NAME)                                                                                            \
    return name##_blocks(shapes, (slot - shapes->first[SHAPE_##NAME]) / SLOTS(name), slot, ray, target);
    SOLID_SHAPES(X)
#undef X
    return within;
}

INLINE Mask one_lane(int lane)
{
    Mask one = mask_none();
    LANE(one, lane) = LANE(mask_all(), lane);
    (void)lane;
    return one;
}

/* The nearest by the tree of all but triangles: each lane's ray by itself. At a leaf all lanes look at the
   shape, and only that one counts. */
STAGE Hit tree_hit(const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, Features f)
{
    Hit hit = {ray->tmax, index_of(-1)}, at;
    Beams beams;
    beams_start(&beams, &shapes->tree, &ray->o, &ray->d);
    for (unsigned lanes = mask_bits(active); lanes; lanes &= lanes - 1) {
        int lane = lowest_lane(lanes);
        Mask one = one_lane(lane);
        Beam beam = beam_of(&beams, lane, -1, -1);
        Pending pending[PENDING_MOST];
        pending[0] = (Pending){0, 0};
        for (int count = 1; count > 0;) {
            Pending next = pending[--count];
            if (next.near > LANE(hit.t, lane) * (1 + 8 * ROUNDING))
                continue;
            if (next.child >= 0) {
                add_children(&shapes->tree.nodes[next.child], &beam, (float)LANE(hit.t, lane), pending, &count);
                continue;
            }
            int slot = shapes->slot_of_leaf[-2 - next.child];
            Mask met = one & slot_meets(shapes, slot, ray, &at) & can_meet(shapes, slot, hiding, f);
            take(&hit, met & ((at.t < hit.t) | ((at.t == hit.t) & (at.slot < hit.slot))), at);
        }
    }
    return hit;
}

STAGE Mask tree_blocks(const Shapes *shapes, const Ray *ray, Mask active, Index target)
{
    Mask blocked = mask_none();
    Beams beams;
    beams_start(&beams, &shapes->tree, &ray->o, &ray->d);
    for (unsigned lanes = mask_bits(active); lanes; lanes &= lanes - 1) {
        int lane = lowest_lane(lanes);
        Mask one = one_lane(lane), met = mask_none();
        Beam beam = beam_of(&beams, lane, -1, -1);
        Pending pending[PENDING_MOST];
        pending[0] = (Pending){0, 0};
        for (int count = 1; count > 0 && !any(met);) {
            int child = pending[--count].child;
            if (child >= 0)
                add_children(&shapes->tree.nodes[child], &beam, (float)LANE(ray->tmax, lane), pending, &count);
            else
                met = one & slot_blocks(shapes, shapes->slot_of_leaf[-2 - child], ray, target);
        }
        blocked |= met;
    }
    return blocked;
}

STAGE void triangles_hit(
    const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, Hit *hit, Features f)
{
    unsigned hidden = f.has & HAS_HIDDEN ? mask_bits(hiding) : 0;
    Beams beams;
    beams_start(&beams, &shapes->triangles.tree, &ray->o, &ray->d);
    for (unsigned lanes = mask_bits(active); lanes; lanes &= lanes - 1) {
        int lane = lowest_lane(lanes);
        Num t = LANE(hit->t, lane);
        Int slot = LANE(hit->slot, lane);
        Beam beam = beam_of(&beams, lane, LANE(ray->from, lane), -1);
        triangles_nearest(&shapes->triangles, &beam, hidden >> lane & 1 ? shapes->shines : NULL, &t, &slot);
        LANE(hit->t, lane) = t;
        LANE(hit->slot, lane) = slot;
    }
}

STAGE Mask triangles_blocked(const Shapes *shapes, const Ray *ray, Mask active, Index target)
{
    Mask blocked = mask_none();
    Beams beams;
    beams_start(&beams, &shapes->triangles.tree, &ray->o, &ray->d);
    for (unsigned lanes = mask_bits(active); lanes; lanes &= lanes - 1) {
        int lane = lowest_lane(lanes);
        Beam beam = beam_of(&beams, lane, LANE(ray->from, lane), LANE(target, lane));
        if (triangles_block(&shapes->triangles, &beam, LANE(ray->tmax, lane)))
            blocked |= one_lane(lane);
    }
    return blocked;
}

/* What the rays of the active lanes meet first. */
STAGE Hit shapes_hit(const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, Features f)
{
    Hit hit;
    if (f.has & HAS_TREE) {
        hit = tree_hit(shapes, ray, active, hiding, f);
    } else {
        hit = flat_hit(shapes, ray, hiding, f);
        solid_hit(shapes, ray, hiding, &hit, f);
    }
    if (f.has & HAS_MESH)
        triangles_hit(shapes, ray, active, hiding, &hit, f);
    return hit;
}

/* L3 The visibility V: is there anything before tmax? `target` is the slot that the ray's end lies on, -1 for
   none. */
STAGE Mask shapes_occluded(const Shapes *shapes, const Ray *ray, Mask active, Index target, Features f)
{
    Mask blocked =
        f.has & HAS_TREE ? tree_blocks(shapes, ray, active, target) : each_blocks(shapes, ray, target, f);
    if (f.has & HAS_MESH)
        blocked |= triangles_blocked(shapes, ray, and_not(active, blocked), target);
    return blocked;
}

/* The row of a slot in the tables by slot. */
INLINE Index row_of_slot(const Shapes *shapes, Index slot, Features f)
{
    if (!(f.has & HAS_MESH))
        return slot;
    Index i = slot - shapes->triangles.first_slot;
    Index row = gather_int32(shapes->triangles.row, index_select(i < 0, index_of(0), i));
    return index_select(i < 0, slot, row);
}

/* The point of the surface and its unit normal (turned over by flip_normals); `face` is the normal of the
   surface itself where n is interpolated. The point is put onto the surface by the surface's own equation, so
   that it keeps full precision however long the ray was. */
STAGE void shapes_surface(const Shapes *shapes, const Ray *ray, Index slot, Index row, Real t, Vec *p,
    Vec *n, Vec *face, Features f)
{
    Real own[4];
    gather_four(&shapes->anchor[0][0], row * 4, own);
    Vec met = vec_add(ray->o, vec_scale(ray->d, t));
    *p = met;
    *n = vec(own[0], own[1], own[2]);
    if (f.has & HAS_PLANES)
        *p = vec_sub(met, vec_scale(*n, vec_dot(*n, met) - own[3]));
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                            \
        Mask is = (row >= index_of(shapes->first[SHAPE_##NAME]))                                             \
                  & (row < index_of(shapes->first[SHAPE_##NAME + 1]));                                       \
        Vec point, normal;                                                                                   \
        name##_surface(own, met, &point, &normal);                                                           \
        *p = vec_select(is, point, *p);                                                                      \
        *n = vec_select(is, normal, *n);                                                                     \
    }
    ROUND_SHAPES(X)
#undef X
    *face = *n;
    if (f.has & HAS_MESH) {
        Index i = slot - shapes->triangles.first_slot;
        Mask flat = i >= 0;
        Vec normal, plane;
        triangle_surface(&shapes->triangles, index_select(flat, i, index_of(0)), (f.has & HAS_SMOOTH) && shapes->triangles.normal, &met,
            &normal, &plane);
        *p = vec_select(flat, met, *p);
        *n = vec_select(flat, normal, *n);
        *face = vec_select(flat, plane, *face);
    }
}

INLINE Real row_dot(const Real row[4], Vec a) { return row[0] * a.x + row[1] * a.y + row[2] * a.z; }
INLINE Vec rows_dot(Real rows[3][4], Vec a)
{
    return vec(row_dot(rows[0], a), row_dot(rows[1], a), row_dot(rows[2], a));
}

/* HAS_UV: the frame at a point p of a slot's surface. */
SELDOM SurfaceFrame surface_frame(const Shapes *shapes, Index slot, Index row, Vec p, Features f)
{
    SurfaceFrame frame = {p.x, p.y, p, p};
    Real place[6][4];
    for (int k = 0; k < 6; k++)
        gather_four(shapes->place[0][k], row * 24, place[k]);
    Vec at = vec_add(rows_dot(place, p), vec(place[0][3], place[1][3], place[2][3]));
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME) {                                                                                \
        Index nth = row - shapes->first[SHAPE_##NAME];                                                       \
        Mask is = (nth >= 0) & (row < index_of(shapes->first[SHAPE_##NAME + 1]));                            \
        frame = frame_select(is, name##_uv(at, index_select(is, nth, index_of(0))), frame);                  \
    }
    ALIGNED_SHAPES(X) FLAT_SHAPES(X) SOLID_SHAPES(X)
#undef X
    frame.dp_du = rows_dot(place + 3, frame.dp_du);
    frame.dp_dv = rows_dot(place + 3, frame.dp_dv);
    if (f.has & HAS_MESH) {
        Index i = slot - shapes->triangles.first_slot;
        Mask flat = i >= 0;
        frame = frame_select(flat, triangle_uv(&shapes->triangles, index_select(flat, i, index_of(0)), p), frame);
    }
    return frame;
}
