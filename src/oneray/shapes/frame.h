/* Texture coordinates of surfaces, and their tangents. */
#pragma once

#include "lanes/vec.h"

/* (u, v) of a point p, and by how much p moves as one of them grows: along the surface, neither at right angles nor of
   unit length. Mitsuba's meaning, shape by shape; flip_normals changes nothing. */
typedef struct {
    Real u, v;
    Vec dp_du, dp_dv;
} SurfaceFrame;

INLINE SurfaceFrame frame_select(Mask m, SurfaceFrame a, SurfaceFrame b)
{
    return (SurfaceFrame){select(m, a.u, b.u), select(m, a.v, b.v), vec_select(m, a.dp_du, b.dp_du),
        vec_select(m, a.dp_dv, b.dp_dv)};
}

/* A unit square, where u and v grow along these unit vectors and are 0.5 in its middle, which `at` is seen from. */
INLINE SurfaceFrame frame_of_square(Vec along_u, Vec along_v, Vec at)
{
    const Real half = real(0.5), two = real(2);
    return (SurfaceFrame){half * vec_dot(along_u, at) + half, half * vec_dot(along_v, at) + half,
        vec_scale(along_u, two), vec_scale(along_v, two)};
}

/* The angle of (x, y) in turns, [0, 1]; 0 at (0, 0). */
INLINE Real turn_of(Real x, Real y)
{
    Real none = real(0), beyond = select((x == none) & (y == none), real(1), x);
    Real turn = real(0.5) * REAL_INV_PI * angle_of(real_abs(y), beyond);
    return select(y < none, real(1) - turn, turn);
}
