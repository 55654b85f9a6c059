/* L11 The smooth metal, and the perfect mirror: all of the light from the one direction that reflects into wo. */
#ifndef ONERAY_MATERIALS_CONDUCTOR_H
#define ONERAY_MATERIALS_CONDUCTOR_H

#include "materials/material.h"

enum { conductor_transmits = 0 };

typedef struct {
    Num reflectance[3];
    Num eta[3], k[3]; /* the complex index of refraction eta + i k; k < 0 stands for a perfect mirror */
} ConductorRow;

/* Reflectance of a conductor for unpolarised light, one channel, at cosine c to the normal: Born & Wolf,
   Principles of Optics, 14.2, with a² + b² = |(η + i k)² - sin²θ|. */
INLINE Real fresnel_conductor(Real c, Real eta, Real k)
{
    Real cc = c * c, ss = real(1) - cc;
    Real difference = eta * eta - k * k - ss;
    Real ab = real_sqrt(difference * difference + real(4) * eta * eta * k * k);
    Real a = real_sqrt(real_max(real(0.5) * (ab + difference), real(0)));
    Real s = (ab + cc - real(2) * a * c) / (ab + cc + real(2) * a * c);
    Real p = (ab * cc + ss * ss - real(2) * a * c * ss) / (ab * cc + ss * ss + real(2) * a * c * ss);
    return real_max(real(0.5) * s * (real(1) + p), real(0)); /* rounding can pass 0 where η is near 1 */
}

INLINE Scatter conductor_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Scatter scatter = {mirrored(s), part->reflectance, real(0), mask_all(), real(1)};
    (void)u;
    if (!(f.has & HAS_FRESNEL))
        return scatter;
    Light eta = ROW_LIGHT(materials, part->row, Conductor, eta), k = ROW_LIGHT(materials, part->row, Conductor, k);
    Light fresnel = light(fresnel_conductor(s->cos_o, eta.r, k.r), fresnel_conductor(s->cos_o, eta.g, k.g),
        fresnel_conductor(s->cos_o, eta.b, k.b));
    scatter.factor = light_mul(part->reflectance, light_select(k.r < real(0), light_all(real(1)), fresnel));
    return scatter;
}

#endif
