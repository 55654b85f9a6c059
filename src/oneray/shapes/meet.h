/* What rays meet among all shapes: by a loop over the few, by trees for triangles and for the many. */
#ifndef ONERAY_SHAPES_MEET_H
#define ONERAY_SHAPES_MEET_H

#include "shapes/shape.h"

INLINE int axis_of_slot(const Shapes *shapes, int slot)
{
    return slot < shapes->aligned_slot[1] ? 0 : slot < shapes->aligned_slot[2] ? 1 : 2;
}

/* The lane's crossing of the flat shape of this slot. */
INLINE Crossing crossing_of_slot(const Shapes *shapes, int slot, const Ray *ray, Mask *within)
{
    Crossing c;
    if (slot < shapes->aligned_slot[3]) {
        const Aligned *a = &shapes->aligned[slot];
        c = aligned_crossing(a, ray, axis_of_slot(shapes, slot));
        *within = within_aligned(a, c);
    } else if (slot < shapes->disk_slot) {
        c = flat_crossing(&shapes->rectangles[slot - shapes->aligned_slot[3]], ray);
        *within = within_rectangle(c);
    } else {
        c = flat_crossing(&shapes->disks[slot - shapes->disk_slot], ray);
        *within = within_disk(c);
    }
    return c;
}

STAGE Mask slot_meets(const Shapes *shapes, int slot, const Ray *ray, Hit *at)
{
    if (slot >= shapes->sphere_slot)
        return ball_meets(shapes, slot - shapes->sphere_slot, slot, ray, at);
    if (slot >= shapes->cube_slot)
        return cube_meets(shapes, (slot - shapes->cube_slot) / 6, slot, ray, at);
    at->slot = index_of(slot);
    Mask within, itself = ray->from == index_of(slot);
    if (slot < shapes->aligned_slot[3]) {
        int axis = axis_of_slot(shapes, slot);
        Real inverse = real(1) / along(ray->d, axis);
        return and_not(aligned_meets(&shapes->aligned[slot], ray, axis, inverse, &at->t), itself);
    }
    Crossing c = crossing_of_slot(shapes, slot, ray, &within);
    at->t = c.num / c.den;
    return and_not(within & (c.num > real(0)), itself);
}

STAGE Mask slot_blocks(const Shapes *shapes, int slot, const Ray *ray, Index target)
{
    if (slot >= shapes->sphere_slot)
        return ball_blocks(shapes, slot - shapes->sphere_slot, slot, ray, target);
    if (slot >= shapes->cube_slot)
        return cube_blocks(shapes, (slot - shapes->cube_slot) / 6, slot, ray, target);
    Mask within;
    Crossing c = crossing_of_slot(shapes, slot, ray, &within);
    return flat_blocks(c, within, ray, target, slot);
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
    Vec anchor = vec(own[0], own[1], own[2]), met = vec_add(ray->o, vec_scale(ray->d, t));
    Real offset = own[3];
    *p = met;
    *n = anchor;
    if (f.has & (HAS_FLAT | HAS_CUBE))
        *p = vec_sub(*p, vec_scale(*n, vec_dot(*n, *p) - offset));
    if (f.has & HAS_SPHERE) {
        Mask round = (row >= index_of(shapes->sphere_slot)) & (row < index_of(shapes->mesh_row));
        Vec from_center = vec_sub(met, anchor);
        Vec outward = vec_normalize(from_center);
        Vec normal = vec_scale(outward, flip_sign(real(1), offset));
        *n = vec_select(round, normal, *n);
        *p = vec_select(round, vec_add(anchor, vec_scale(normal, offset)), *p);
    }
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

#endif
