/* L1 The point light: the same intensity in all directions. */
#ifndef ONERAY_EMITTERS_POINT_H
#define ONERAY_EMITTERS_POINT_H

#include "emitters/emitter.h"

INLINE LightSample point_towards(const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    (void)u, (void)v;
    return towards_place(emitters, i, at, f);
}

/* L17 Flux 4π I. */
INLINE FirstRay point_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    (void)place;
    return (FirstRay){vec_of_light(emitters->position, i, f), sample_sphere(way[0], way[1]), index_of(-1),
        real(1) / pdf_w_sphere()};
}

#endif
