/* Surfaces in one place lie in layers, a stack (scene/stacks.c): how rays meet them. What a ray meets first, what at
   once where it starts, and what is in its way where it ends are decided by the order of the layers along it, whatever
   rounding makes of the distances; so the way from p to q is free where that from q to p is. */
#pragma once

#include "lanes/vec.h"

/* By slot, those of triangles included. */
typedef struct {
    Int count; /* of stacks; a slot that shares its place with none is one by itself, numbered beyond */
    Int *of; /* its stack */
    Int *layer; /* the larger, the farther along … */
    Num (*facing)[4]; /* its stack's normal; and 1 if something of its stack overlaps it of a smaller layer, 2 of a larger,
                         3 both */
    const Num (*up)[3]; /* by stack: its normal; 0 of spheres, whose up is outwards */
} StackTables;

/* A slot's place in its stack. Slot -1, which is no surface, has one for itself. */
typedef struct {
    Index stack, layer;
} Seat;

INLINE Seat seat_of(const StackTables *stacks, Index slot)
{
    Mask none = slot < 0;
    Index at = index_select(none, index_of(0), slot);
    return (Seat){
        index_select(none, index_of(-1), gather_index(stacks->of, at)), gather_index(stacks->layer, at)};
}

/* Does a ray that goes upwards, or does not, come through layer a before layer b of a stack? */
INLINE Mask comes_before(Mask up, Seat a, Seat b)
{
    return (up & (a.layer < b.layer)) | and_not(a.layer > b.layer, up);
}

/* Does a ray that meets the slot in this direction come through something that overlaps it in its stack, before it, or
   else behind it? For -d, behind is what before is for d. */
enum { BEHIND, BEFORE };
INLINE Mask is_overlapped(const StackTables *stacks, Index slot, Vec d, int before)
{
    Mask none = slot < 0;
    Real row[4];
    gather_four(&stacks->facing[0][0], index_select(none, index_of(0), slot) * 4, row);
    Mask up = vec_dot(vec(row[0], row[1], row[2]), d) > real(0), larger = before ? mask_not(up) : up;
    Mask overlapped = (larger & (row[3] >= real(2))) | and_not((row[3] == real(1)) | (row[3] == real(3)), larger);
    return and_not(overlapped, none);
}

/* A surface that a ray meets, t = 0 exactly in the stack that it starts in. */
typedef struct {
    Real t;
    Index slot;
    Seat seat;
    Mask met, up; /* up: the ray goes upwards there */
} Meeting;

INLINE Meeting meeting_at(const StackTables *stacks, Real t, Index slot, Mask met, Vec d)
{
    Seat seat = seat_of(stacks, slot);
    Index row = index_select(seat.stack < index_of(stacks->count), seat.stack, index_of(0));
    return (Meeting){t, slot, seat, met, vec_dot(vec_gather(stacks->up, row), d) > real(0)};
}

/* Does a ray that starts in this seat meet it at all? */
INLINE Mask lies_ahead(const Meeting *m, Seat start)
{
    Mask at_once = (m->seat.stack == start.stack) & (m->t == real(0));
    return m->met & ((at_once & comes_before(m->up, start, m->seat)) | and_not(m->t > real(0), at_once));
}

/* Is it met before the nearest so far? */
INLINE Mask is_nearer(const Meeting *m, const Meeting *nearest)
{
    Mask tie = (m->seat.stack == nearest->seat.stack) & (m->up == nearest->up);
    Mask less = (m->t < nearest->t) | ((m->t == nearest->t) & (m->slot < nearest->slot));
    return (tie & comes_before(m->up, m->seat, nearest->seat)) | and_not(less, tie);
}

INLINE void take_meeting(Meeting *nearest, const Meeting *m, Mask taken)
{
    nearest->t = select(taken, m->t, nearest->t);
    nearest->slot = index_select(taken, m->slot, nearest->slot);
    nearest->seat.stack = index_select(taken, m->seat.stack, nearest->seat.stack);
    nearest->seat.layer = index_select(taken, m->seat.layer, nearest->seat.layer);
    nearest->up = index_select(taken, m->up, nearest->up);
}

/* One ray among triangles: the same for a single slot. */
typedef struct {
    const StackTables *stacks;
    Num d[3];
    Int start, end; /* the slots that it starts and ends on, or -1 */
} StackedRay;

/* Does it come through slot a before slot b of one stack? */
static inline int slot_before(const StackedRay *ray, Int a, Int b)
{
    const StackTables *stacks = ray->stacks;
    const Num *up = stacks->up[stacks->of[a]];
    Int one = stacks->layer[a], other = stacks->layer[b];
    return up[0] * ray->d[0] + up[1] * ray->d[1] + up[2] * ray->d[2] > 0 ? one < other : one > other;
}
static inline int in_one_stack(const StackTables *stacks, Int a, Int b)
{
    return a >= 0 && b >= 0 && stacks->of[a] == stacks->of[b];
}
