/* Light: what is radiance, flux, throughput or reflectance, by channel. No direction and no point is one, and what
   is done with channels is done here alone. */
#pragma once

#include "lanes/lane.h"

typedef struct {
    Real r, g, b;
} Light;

INLINE Light light(Real r, Real g, Real b) { return (Light){r, g, b}; }
INLINE Light light_of(const Num a[3]) { return (Light){real(a[0]), real(a[1]), real(a[2])}; }
INLINE Light light_all(Real a) { return (Light){a, a, a}; }
INLINE Light light_add(Light a, Light b) { return (Light){a.r + b.r, a.g + b.g, a.b + b.b}; }
INLINE Light light_mul(Light a, Light b) { return (Light){a.r * b.r, a.g * b.g, a.b * b.b}; }
INLINE Light light_scale(Light a, Real s) { return (Light){a.r * s, a.g * s, a.b * s}; }
/* From a at t = 0 to b at 1; exactly a where they are equal. */
INLINE Light light_mix(Light a, Light b, Real t)
{
    return (Light){a.r + (b.r - a.r) * t, a.g + (b.g - a.g) * t, a.b + (b.b - a.b) * t};
}
INLINE Real light_max(Light a) { return real_max(real_max(a.r, a.g), a.b); }
/* Of linear sRGB, by Mitsuba's weights, .212671, .715160 and .072169; exactly that of the channels where they are equal. */
INLINE Real luminance(Light a) { return a.g + real(0.212671) * (a.r - a.g) + real(0.072169) * (a.b - a.g); }
INLINE Light light_select(Mask m, Light a, Light b)
{
    return (Light){select(m, a.r, b.r), select(m, a.g, b.g), select(m, a.b, b.b)};
}
INLINE Light light_only(Mask m, Light a) { return (Light){only(m, a.r), only(m, a.g), only(m, a.b)}; }

/* A row of three or more numbers, from table[at] on, for each lane. */
INLINE Light light_gather(const Num *table, Index at)
{
    Real row[4];
    gather_four(table, at, row);
    return (Light){row[0], row[1], row[2]};
}

/* One lane's channels. */
INLINE void light_lane(const Light *a, int lane, double to[3])
{
    to[0] = (double)LANE(a->r, lane);
    to[1] = (double)LANE(a->g, lane);
    to[2] = (double)LANE(a->b, lane);
    (void)lane;
}
