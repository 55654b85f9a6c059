/* Vectors: directions and points of three Reals, by value. */
#pragma once

#include "lanes/lane.h"

typedef struct {
    Real x, y, z;
} Vec;

/* Doubles as a kernel's numbers. */
static inline void store(Num to[3], const double from[3])
{
    for (int i = 0; i < 3; i++)
        to[i] = (Num)from[i];
}

INLINE Vec vec(Real x, Real y, Real z) { return (Vec){x, y, z}; }
INLINE Vec vec_of(const Num a[3]) { return (Vec){real(a[0]), real(a[1]), real(a[2])}; }
INLINE Vec vec_all(Real a) { return (Vec){a, a, a}; }
INLINE Vec vec_add(Vec a, Vec b) { return (Vec){a.x + b.x, a.y + b.y, a.z + b.z}; }
INLINE Vec vec_sub(Vec a, Vec b) { return (Vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
INLINE Vec vec_scale(Vec a, Real s) { return (Vec){a.x * s, a.y * s, a.z * s}; }
INLINE Vec vec_neg(Vec a) { return (Vec){-a.x, -a.y, -a.z}; }
INLINE Real vec_dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE Vec vec_cross(Vec a, Vec b)
{
    return (Vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
INLINE Real vec_length(Vec a) { return real_sqrt(vec_dot(a, a)); }
INLINE Vec vec_normalize(Vec a) { return vec_scale(a, real(1) / vec_length(a)); }
INLINE Vec vec_select(Mask m, Vec a, Vec b)
{
    return (Vec){select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}

/* Three numbers of a table whose rows hold three, at each lane's row. */
INLINE Vec vec_gather(const Num (*table)[3], Index i)
{
    Real row[4];
    gather_four(&table[0][0], i * 3, row);
    return (Vec){row[0], row[1], row[2]};
}

/* One lane's coordinates. */
INLINE void vec_lane(const Vec *a, int lane, double to[3])
{
    to[0] = (double)LANE(a->x, lane);
    to[1] = (double)LANE(a->y, lane);
    to[2] = (double)LANE(a->z, lane);
    (void)lane;
}

/* Two unit vectors that complete the unit vector n to a right-handed frame (s, t, n), without a case where
   they fail. Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6(1), 2017. */
INLINE void vec_frame(Vec n, Vec *s, Vec *t)
{
    Real sign = flip_sign(real(1), n.z);
    Real a = real(-1) / (sign + n.z);
    Real b = n.x * n.y * a;
    *s = vec(real(1) + sign * n.x * n.x * a, sign * b, -sign * n.x);
    *t = vec(b, sign + n.y * n.y * a, -n.y);
}

/* From the frame whose z is the unit vector n to the world. */
INLINE Vec vec_from_frame(Vec n, Vec local)
{
    Vec s, t;
    vec_frame(n, &s, &t);
    return vec_add(vec_add(vec_scale(s, local.x), vec_scale(t, local.y)), vec_scale(n, local.z));
}
