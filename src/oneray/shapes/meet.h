/* What rays meet among all shapes: by a loop over the few, by trees for triangles and for the many. */
#pragma once

#include "kinds/shapes.h"
#include "shapes/packet.h"

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
        AlignedView view = aligned_view(&ROWS(shapes, ALIGNED, Aligned)[slot], ray, axis);
        Mask nearer =
            aligned_meets(&view, inverse, &t) & (t < nearest->num) & can_meet(shapes, slot, hiding, f);
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
INLINE Mask flat_blocks(Crossing c, Mask within, const Ray *ray, Index target, Index slot)
{
    Mask before = within & (c.num > real(0)) & (c.num < ray->tmax * c.den);
    return and_not(before, (ray->from == slot) | (target == slot));
}

INLINE Mask aligned_blocks(const Shapes *shapes, const Ray *ray, Index target, int axis)
{
    Mask blocked = mask_none();
    for (int slot = shapes->along[axis]; slot < shapes->along_blocking[axis]; slot++) {
        AlignedView view = aligned_view(&ROWS(shapes, ALIGNED, Aligned)[slot], ray, axis);
        Crossing c = aligned_crossing(&view);
        blocked |= flat_blocks(c, within_aligned(&view, c), ray, target, index_of(slot));
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
            blocked |= flat_blocks(c, within, ray, target, index_of(slot));                                            \
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

/* One shape, by its slot: the loops above for trees. Of rectangles along the axes each lane may look at its own. */
INLINE AlignedView aligned_view_of_slot(const Shapes *shapes, int slot, const Ray *ray)
{
    int axis = slot < shapes->along[1] ? 0 : slot < shapes->along[2] ? 1 : 2;
    return aligned_view(&ROWS(shapes, ALIGNED, Aligned)[slot], ray, axis);
}

INLINE Mask aligned_view_meets(const AlignedView *view, Index slot, const Ray *ray, Hit *at)
{
    at->slot = slot;
    return and_not(aligned_meets(view, real(1) / view->d[0], &at->t), ray->from == slot);
}

#define IF_SLOT(NAME) if ((f.has & HAS_##NAME) && slot < shapes->first[SHAPE_##NAME + 1])

STAGE Mask slot_meets(const Shapes *shapes, int slot, const Ray *ray, Hit *at, Features f)
{
    Mask within = mask_none(), itself = ray->from == index_of(slot);
    *at = (Hit){real(0), index_of(slot)};
    IF_SLOT(ALIGNED)
    {
        AlignedView view = aligned_view_of_slot(shapes, slot, ray);
        return aligned_view_meets(&view, index_of(slot), ray, at);
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

STAGE Mask slot_blocks(const Shapes *shapes, int slot, const Ray *ray, Index target, Features f)
{
    Mask within = mask_none();
#define X(NAME, name, words)                                                                                 \
    IF_SLOT(NAME)                                                                                            \
    {                                                                                                        \
        Crossing c = name##_cross(shapes, slot - shapes->first[SHAPE_##NAME], ray, &within);                 \
        return flat_blocks(c, within, ray, target, index_of(slot));                                                    \
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

/* HAS_STACKS: where the ray, which starts in this seat on slot `from`, meets a shape's surface, by its first slot: a
   solid's twice. Gives how often. */
STAGE int slot_meetings(const Shapes *shapes, int slot, const Ray *ray, Seat start, Meeting m[2])
{
    const StackTables *stacks = &shapes->stacks;
    Mask within = mask_none();
    Crossing c = {real(0), real(1), real(0), real(0)};
    Index on = index_of(-1), through[2];
#define X(NAME, name, words)                                                                                 \
    if (slot >= shapes->first[SHAPE_##NAME] && slot < shapes->first[SHAPE_##NAME + 1]) {                     \
        for (int k = 0; k < SLOTS(name); k++)                                                                \
            on = index_select(index_of(stacks->of[slot + k]) == start.stack, index_of(slot + k), on);        \
        Mask own = (ray->from >= index_of(slot)) & (ray->from < index_of(slot + SLOTS(name)));               \
        on = index_select(own, ray->from, on);                                                               \
        Stretch s = name##_through(                                                                          \
            shapes, (slot - shapes->first[SHAPE_##NAME]) / SLOTS(name), slot, ray, on, through);             \
        m[0] = meeting_at(stacks, s.near, through[0], and_not(s.entered, own & (s.near > real(0))), ray->d);     \
        m[1] = meeting_at(stacks, s.far, through[1], s.left, ray->d);                                         \
        if (!name##_planes) {                                                                                \
            m[0].up = mask_none();                                                                           \
            m[1].up = mask_all();                                                                            \
        }                                                                                                    \
        return 2;                                                                                            \
    }
    SOLID_SHAPES(X)
#undef X
    if (slot < shapes->first[SHAPE_ALIGNED + 1]) {
        AlignedView view = aligned_view_of_slot(shapes, slot, ray);
        c = aligned_crossing(&view);
        within = within_aligned(&view, c);
    }
#define X(NAME, name, words)                                                                                 \
    else if (slot < shapes->first[SHAPE_##NAME + 1])                                                         \
        c = name##_cross(shapes, slot - shapes->first[SHAPE_##NAME], ray, &within);
    FLAT_SHAPES(X)
#undef X
    Mask starts = index_of(stacks->of[slot]) == start.stack;
    m[0] = meeting_at(stacks, select(starts, real(0), c.num / c.den), index_of(slot), within, ray->d);
    return 1;
}

INLINE Meeting no_meeting(const Ray *ray)
{
    return (Meeting){ray->tmax, index_of(-1), {index_of(-1), index_of(0)}, mask_none(), mask_none()};
}

/* HAS_STACKS: takes what the ray meets of the shape, if nothing so far is nearer. */
INLINE void meet_stacked(const Shapes *shapes, int slot, const Ray *ray, Seat start, Mask active, Mask hiding,
    Meeting *nearest, Features f)
{
    Meeting m[2];
    int count = slot_meetings(shapes, slot, ray, start, m);
    for (int k = 0; k < count; k++) {
        Mask met = active & can_meet(shapes, slot, hiding, f) & lies_ahead(&m[k], start);
        take_meeting(nearest, &m[k], met & is_nearer(&m[k], nearest));
    }
}

typedef struct {
    Seat start, end;
} Ends;

INLINE Ends ends_of(const Shapes *shapes, const Ray *ray, Index target)
{
    return (Ends){seat_of(&shapes->stacks, ray->from), seat_of(&shapes->stacks, target)};
}

/* HAS_STACKS: is the shape in the way of the ray's end, on slot `target`? That end may lie on the side of a solid that
   the ray enters it by, or on the one that it leaves it by. */
STAGE Mask stacked_blocks(const Shapes *shapes, int slot, const Ray *ray, const Ends *ends, Index target)
{
    Meeting m[2];
    Mask blocked = mask_none(), ended = mask_none();
    int count = slot_meetings(shapes, slot, ray, ends->start, m);
    Mask far_end = count > 1 ? m[0].t + m[1].t < ray->tmax + ray->tmax : mask_none();
    for (int k = 0; k < count; k++) {
        Mask is_end = (m[k].seat.stack == ends->end.stack) & (k ? far_end : mask_not(far_end));
        Mask by_layer = comes_before(m[k].up, m[k].seat, ends->end);
        Mask before = (is_end & by_layer) | and_not(m[k].t < ray->tmax, is_end);
        blocked |= and_not(lies_ahead(&m[k], ends->start) & before, ended);
        ended |= is_end;
    }
    int ball = slot >= shapes->first[SHAPE_SPHERE] && slot < shapes->first[SHAPE_SPHERE + 1];
    Mask itself = and_not(target == index_of(slot), ends->start.stack == ends->end.stack);
    return ball && shapes->anchor[slot][3] >= 0 ? and_not(blocked, itself) : blocked; /* as in sphere_blocks */
}

/* The slots of the shapes whose leaves these lanes are at, and those of rectangles along the axes; else 0. */
INLINE Mask aligned_at(const Shapes *shapes, const Ways *ways, unsigned leaves, Index *slot, Features f)
{
    Mask in = lanes_mask(leaves);
    for (int lane = 0; lane < LANES; lane++)
        LANE(*slot, lane) = -2 - ways->at[lane];
    in &= f.has & HAS_ALIGNED ? *slot < index_of(shapes->first[SHAPE_ALIGNED + 1]) : mask_none();
    *slot = index_select(in, *slot, index_of(0));
    return in;
}

/* The nearest by the tree of all but triangles. At a leaf all lanes look at the shape, and those count that are at it. */
INLINE Hit nearest_in_tree(
    const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, int stacked, Features f)
{
    Hit hit = {ray->tmax, index_of(-1)}, at;
    Meeting nearest = no_meeting(ray);
    Seat start = stacked ? seat_of(&shapes->stacks, ray->from) : nearest.seat;
    Beams beams;
    unsigned lanes = mask_bits(active) & beams_start(&beams, &shapes->tree, &ray->o, &ray->d, ray->tmax);
    Ways ways;
    start_below(&ways, lanes, 0);
    while (ways.inner | ways.leaves) {
        unsigned leaves = step(shapes->tree.nodes, &beams, &hit.t, 1, &ways);
        Index own = index_of(0);
        Mask aligned = stacked || !leaves ? mask_none() : aligned_at(shapes, &ways, leaves, &own, f);
        if (any(aligned)) {
            AlignedView view = aligned_views(shapes, ray, own);
            Mask met = aligned & aligned_view_meets(&view, own, ray, &at);
            if (f.has & HAS_HIDDEN)
                met = and_not(met, hiding & (gather_index(shapes->shines, own) != 0));
            take(&hit, met & ((at.t < hit.t) | ((at.t == hit.t) & (at.slot < hit.slot))), at);
        }
        for (unsigned left = leaves & ~mask_bits(aligned); left; left &= left - 1) {
            int lane = lowest_lane(left), slot = -2 - ways.at[lane];
            Mask one = lanes_mask(1u << lane);
            if (stacked) {
                meet_stacked(shapes, slot, ray, start, one, hiding, &nearest, f);
                hit = (Hit){nearest.t, nearest.slot};
                continue;
            }
            Mask met = one & slot_meets(shapes, slot, ray, &at, f) & can_meet(shapes, slot, hiding, f);
            take(&hit, met & ((at.t < hit.t) | ((at.t == hit.t) & (at.slot < hit.slot))), at);
        }
        for (; leaves; leaves &= leaves - 1)
            to_next(&ways, lowest_lane(leaves), LIMIT(LANE(hit.t, lowest_lane(leaves))), 1);
    }
    return hit;
}

STAGE Hit tree_hit(const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, Features f)
{
    return nearest_in_tree(shapes, ray, active, hiding, 0, f);
}
STAGE Hit tree_stacked_hit(const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, Features f)
{
    return nearest_in_tree(shapes, ray, active, hiding, 1, f);
}

/* `ends`, where not NULL, are those of the ray in stacks. */
INLINE Mask blocked_in_tree(
    const Shapes *shapes, const Ray *ray, Mask active, Index target, const Ends *ends, Features f)
{
    Mask blocked = mask_none();
    Beams beams;
    unsigned lanes = mask_bits(active) & beams_start(&beams, &shapes->tree, &ray->o, &ray->d, ray->tmax);
    Ways ways;
    start_below(&ways, lanes, 0);
    while (ways.inner | ways.leaves) {
        unsigned leaves = step(shapes->tree.nodes, &beams, &ray->tmax, 0, &ways);
        Index own = index_of(0);
        Mask aligned = ends || !leaves ? mask_none() : aligned_at(shapes, &ways, leaves, &own, f);
        if (any(aligned)) {
            AlignedView view = aligned_views(shapes, ray, own);
            Crossing c = aligned_crossing(&view);
            blocked |= aligned & flat_blocks(c, within_aligned(&view, c), ray, target, own);
        }
        for (unsigned left = leaves & ~mask_bits(aligned); left; left &= left - 1) {
            int lane = lowest_lane(left), slot = -2 - ways.at[lane];
            blocked |= lanes_mask(1u << lane)
                       & (ends ? stacked_blocks(shapes, slot, ray, ends, target)
                               : slot_blocks(shapes, slot, ray, target, f));
        }
        for (leaves &= ~mask_bits(blocked); leaves; leaves &= leaves - 1)
            to_next(&ways, lowest_lane(leaves), 0, 0);
    }
    return blocked;
}

STAGE Mask tree_blocks(const Shapes *shapes, const Ray *ray, Mask active, Index target, Features f)
{
    return blocked_in_tree(shapes, ray, active, target, NULL, f);
}
STAGE Mask tree_stacked_blocks(const Shapes *shapes, const Ray *ray, Mask active, Index target, Features f)
{
    Ends ends = ends_of(shapes, ray, target);
    return blocked_in_tree(shapes, ray, active, target, &ends, f);
}

/* How many slots the shape has whose first this is. */
INLINE int slots_from(const Shapes *shapes, int slot)
{
#define X(NAME, name, words)                                                                                 \
    if (slot >= shapes->first[SHAPE_##NAME] && slot < shapes->first[SHAPE_##NAME + 1])                       \
        return SLOTS(name);
    SOLID_SHAPES(X)
#undef X
    return 1;
}

/* HAS_STACKS: the loops over all. */
STAGE Hit each_stacked_hit(const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, Features f)
{
    Meeting nearest = no_meeting(ray);
    Seat start = seat_of(&shapes->stacks, ray->from);
    for (int slot = 0; slot < shapes->first[SHAPE_MESH]; slot += slots_from(shapes, slot))
        meet_stacked(shapes, slot, ray, start, active, hiding, &nearest, f);
    return (Hit){nearest.t, nearest.slot};
}

STAGE Mask each_stacked_blocks(const Shapes *shapes, const Ray *ray, Index target)
{
    Mask blocked = mask_none();
    Ends ends = ends_of(shapes, ray, target);
    for (int slot = 0; slot < shapes->first[SHAPE_MESH]; slot += slots_from(shapes, slot))
        blocked |= stacked_blocks(shapes, slot, ray, &ends, target);
    return blocked;
}

/* `together`: the rays may be alike, so that packets are worth a try. */
STAGE void triangles_hit(
    const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, int together, Hit *hit, Features f)
{
    const Triangles *triangles = &shapes->triangles;
    const StackTables *stacks = f.has & HAS_STACKS ? &shapes->stacks : NULL;
    const Index nowhere = index_of(-1);
    Beams beams;
    unsigned lanes = mask_bits(active) & beams_start(&beams, &triangles->tree, &ray->o, &ray->d, hit->t), ordered = 0;
    Wanted w = {&beams, &ray->d, ray->from, nowhere, &ray->from, &nowhere, shapes->shines,
        f.has & HAS_HIDDEN ? mask_bits(hiding) : 0, stacks, hit->t, hit->slot, 0};
    if (stacks) {
        w.from = seat_of(stacks, ray->from).stack;
        ordered = lanes & mask_bits(is_overlapped(stacks, ray->from, ray->d, BEHIND));
    }
    unsigned others = lanes & ~ordered;
    if (few_serve(triangles, others))
        few_nearest(triangles, others, &w);
    else
        triangles_nearest(triangles, together ? packets(triangles, ray, others, 1, &w) : others, 0, &w);
    if (stacks) {
        ordered |= lanes & mask_bits(is_overlapped(stacks, w.slot, ray->d, BEFORE));
        w.t = select(lanes_mask(ordered), hit->t, w.t);
        w.slot = index_select(lanes_mask(ordered), hit->slot, w.slot);
        triangles_in_order(triangles, ordered, 1, &w);
    }
    *hit = (Hit){w.t, w.slot};
}

STAGE Mask triangles_blocked(const Shapes *shapes, const Ray *ray, Mask active, Index target, Features f)
{
    const Triangles *triangles = &shapes->triangles;
    const StackTables *stacks = f.has & HAS_STACKS ? &shapes->stacks : NULL;
    Beams beams;
    unsigned lanes = mask_bits(active) & beams_start(&beams, &triangles->tree, &ray->o, &ray->d, ray->tmax), ordered = 0;
    Wanted w = {&beams, &ray->d, ray->from, target, &ray->from, &target, NULL, 0, stacks, ray->tmax, index_of(-1), 0};
    if (stacks) {
        w.from = seat_of(stacks, ray->from).stack;
        w.target = seat_of(stacks, target).stack;
        Mask at_end = is_overlapped(stacks, ray->from, ray->d, BEHIND) | is_overlapped(stacks, target, ray->d, BEFORE);
        ordered = lanes & mask_bits(at_end | ((w.from == w.target) & (w.from >= 0)));
        triangles_in_order(triangles, ordered, 0, &w);
    }
    unsigned others = lanes & ~ordered;
    if (few_serve(triangles, others))
        few_block(triangles, others, &w);
    else
        triangles_block(triangles, packets(triangles, ray, others, 0, &w), 0, &w);
    return lanes_mask(w.blocked);
}

/* Which of these rays meet what shines: `hit` is what they meet of all but triangles, of which none shines. */
STAGE Mask light_is_met(const Shapes *shapes, const Ray *ray, Mask active, Hit hit, Features f)
{
    Mask missed = hit.slot < 0,
         lit = gather_index(shapes->shines, index_select(missed, index_of(0), hit.slot)) != 0;
    lit = and_not(lit, missed) | (f.has & HAS_ANY(SKIES) ? missed : mask_none());
    Ray before = {ray->o, ray->d, hit.t, ray->from};
    active &= lit;
    return and_not(active, triangles_blocked(shapes, &before, active, index_of(-1), f));
}

/* What the rays of the active lanes meet first. Of those in `last` only light matters: one that meets none may be no
   longer active. */
STAGE Hit shapes_hit_or_light(
    const Shapes *shapes, const Ray *ray, Mask *active, Mask last, Mask hiding, int together, Features f)
{
    Hit hit;
    if (f.has & HAS_STACKS) {
        hit = f.has & HAS_TREE ? tree_stacked_hit(shapes, ray, *active, hiding, f)
                               : each_stacked_hit(shapes, ray, *active, hiding, f);
    } else if (f.has & HAS_TREE) {
        hit = tree_hit(shapes, ray, *active, hiding, f);
    } else {
        hit = flat_hit(shapes, ray, hiding, f);
        solid_hit(shapes, ray, hiding, &hit, f);
    }
    if (f.has & HAS_MESH) {
        last &= f.has & (HAS_STACKS | HAS_MESH_LIGHT) ? mask_none() : *active;
        Mask others = and_not(*active, last);
        if (any(last))
            *active = others | light_is_met(shapes, ray, last, hit, f);
        triangles_hit(shapes, ray, others, hiding, together, &hit, f);
    }
    return hit;
}

/* What the rays of the active lanes meet first, of rays that may be alike. */
STAGE Hit shapes_hit(const Shapes *shapes, const Ray *ray, Mask active, Mask hiding, Features f)
{
    return shapes_hit_or_light(shapes, ray, &active, mask_none(), hiding, 1, f);
}

/* L3 The visibility V: is there anything before tmax? `target` is the slot that the ray's end lies on, -1 for
   none. */
STAGE Mask shapes_occluded(const Shapes *shapes, const Ray *ray, Mask active, Index target, Features f)
{
    Mask blocked;
    if (f.has & HAS_STACKS)
        blocked = f.has & HAS_TREE ? tree_stacked_blocks(shapes, ray, active, target, f)
                                   : each_stacked_blocks(shapes, ray, target);
    else
        blocked = f.has & HAS_TREE ? tree_blocks(shapes, ray, active, target, f)
                                   : each_blocks(shapes, ray, target, f);
    if (f.has & HAS_MESH)
        blocked |= triangles_blocked(shapes, ray, and_not(active, blocked), target, f);
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
        name##_surface(shapes, index_select(is, row - shapes->first[SHAPE_##NAME], index_of(0)), own, met, &point, &normal);                                                           \
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
