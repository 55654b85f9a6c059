/* L1 The spot light: an intensity that falls off between two angles to its axis. */
#ifndef ONERAY_EMITTERS_SPOT_H
#define ONERAY_EMITTERS_SPOT_H

#include "emitters/emitter.h"

/* The spot's share of its intensity at this angle to its axis (radians): 1 within the beam, 0 beyond the
   cutoff, linear between. */
INLINE Real spot_falloff(Real angle, Real beam, Real cutoff)
{
    Real ramp = real_max((cutoff - angle) / (cutoff - beam), real(0));
    return select(angle <= beam, real(1), ramp);
}

/* The same towards -wi. */
INLINE Real falloff_of(const Emitters *emitters, Index i, Vec wi, Features f)
{
    Vec axis = vec_of_light(emitters->edge_x, i, f);
    Real angle = angle_of(vec_length(vec_cross(axis, wi)), -vec_dot(axis, wi));
    return spot_falloff(angle, of_light(emitters->beam, i, f), of_light(emitters->cutoff, i, f));
}

INLINE LightSample spot_towards(const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    (void)u, (void)v;
    LightSample s = towards_place(emitters, i, at, f);
    s.weight = light_scale(s.weight, falloff_of(emitters, i, s.wi, f));
    return s;
}

/* L17 Uniform in its cone, flux 2π (1 - cos cutoff) I falloff. */
INLINE FirstRay spot_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    (void)place;
    Real extent = of_light(emitters->extent, i, f);
    Vec d = vec_from_frame(vec_of_light(emitters->edge_x, i, f), sample_cone(way[0], way[1], extent));
    Real falloff = falloff_of(emitters, i, vec_neg(d), f);
    return (FirstRay){vec_of_light(emitters->position, i, f), d, index_of(-1), falloff / pdf_w_cone(extent)};
}

#endif
