/* Sampling routines: each sample_x turns uniform numbers into a point or direction, each pdf_x beside it is
   its density, per solid angle (pdf_w, sr⁻¹) or per area (pdf_a, m⁻²). */
#pragma once

#include "lanes/sampler.h"

/* v of a turn around the z axis, at the distance r from it and the height z. */
INLINE Vec turned(Real r, Real v, Real z)
{
    Real sine, cosine;
    sincos_turn(v, &sine, &cosine);
    return vec(r * cosine, r * sine, z);
}

/* L8 One ray over the hemisphere: uniform by solid angle, z = u, in the frame of the normal. */
INLINE Vec sample_hemisphere_uniform(Real u, Real v)
{
    return turned(real_sqrt((real(1) - u) * (real(1) + u)), v, u);
}
INLINE Real pdf_w_hemisphere_uniform(void) { return real(0.5) * REAL_INV_PI; }

/* L9 Importance sampling the hemisphere: density in proportion to the cosine, pdf cosθ/π. A uniform point of
   the disk below, lifted to the sphere (Malley): r² = u, z² = 1 - u. */
INLINE Vec sample_hemisphere_cosine(Real u, Real v) { return turned(real_sqrt(u), v, real_sqrt(real(1) - u)); }
INLINE Real pdf_w_hemisphere_cosine(Real cosine) { return cosine * REAL_INV_PI; }

/* The whole sphere, uniform by solid angle. */
INLINE Vec sample_sphere(Real u, Real v)
{
    return turned(real(2) * real_sqrt(u * (real(1) - u)), v, real(1) - real(2) * u);
}
INLINE Real pdf_w_sphere(void) { return real(0.25) * REAL_INV_PI; }

/* L5 The cone 1 - cosθ <= extent about +z, uniform by solid angle, pdf 1/(2π extent). In 1 - cosθ, which keeps
   its digits in cones however narrow: x = u extent, cosθ = 1 - x, sinθ = √(x (2 - x)). */
INLINE Vec sample_cone(Real u, Real v, Real extent)
{
    Real x = u * extent;
    return turned(real_sqrt(x * (real(2) - x)), v, real(1) - x);
}
INLINE Real pdf_w_cone(Real extent) { return real(0.5) * REAL_INV_PI / extent; }

/* The square [-1,1]² and the unit disk, uniform by area. */
INLINE void sample_square(Real u, Real v, Real *x, Real *y)
{
    *x = real(2) * u - real(1);
    *y = real(2) * v - real(1);
}
INLINE void sample_disk(Real u, Real v, Real *x, Real *y)
{
    Vec on = turned(real_sqrt(u), v, real(0));
    *x = on.x;
    *y = on.y;
}

/* A triangle, uniform by area: the shares of its second and third corner, less the thirds of its center. */
INLINE void sample_triangle(Real u, Real v, Real *x, Real *y)
{
    Real root = real_sqrt(u);
    *x = real(2 / 3.0) - root;
    *y = v * root - real(1 / 3.0);
}
