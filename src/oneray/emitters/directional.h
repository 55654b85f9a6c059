/* The sun: light of one direction, E across it. */
#ifndef ONERAY_EMITTERS_DIRECTIONAL_H
#define ONERAY_EMITTERS_DIRECTIONAL_H

#include "emitters/emitter.h"

INLINE LightSample directional_towards(
    const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    (void)at, (void)u, (void)v;
    Vec wi = vec_neg(vec_of_light(emitters->edge_x, i, f));
    return (LightSample){wi, real(NUM_MAX), light_all(real(1)), real(0), index_of(-1), i};
}

/* L17 Flux E π R². */
INLINE FirstRay directional_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    Real radius = real(emitters->world_radius);
    (void)way;
    return from_far_away(emitters, vec_of_light(emitters->edge_x, i, f), place, REAL_PI * radius * radius);
}

#endif
