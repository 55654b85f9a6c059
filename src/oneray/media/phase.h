/* M1 Phase functions: where a medium scatters light to, the density per solid angle (sr⁻¹) of a path's going on from the
   direction d in the direction w. A phase function is its own density: f/pdf is 1. */
#pragma once

#include "fields.h"

/* g, the mean cosine between the two. */
typedef struct {
    double g;
} Phase;

static const Plugin isotropic_plugin = {.types = "isotropic"};
static const Plugin hg_plugin = {"hg", NULL, {{"g", AS_FLOAT, offsetof(Phase, g), "(-1,1)", "0.8"}}};

#ifdef LANES

#include "lanes/sample.h"

/* Henyey, Greenstein, Diffuse Radiation in the Galaxy, ApJ 93, 1941: (1 - g²)/(4π (1 + g² - 2g cosθ)^3/2); isotropic is
   g = 0. With |d ∓ w|² = 2 (1 ∓ cosθ) the bracket is (1 - |g|)² + |g| |d ∓ w|², which keeps its digits where both are
   small. */
INLINE Real phase_pdf_w(Real g, Vec d, Vec w)
{
    Vec out = vec_sub(d, vec_scale(w, flip_sign(real(1), g)));
    Real size = real_abs(g), left = real(1) - size;
    Real bracket = left * left + size * vec_dot(out, out);
    return real(0.25) * REAL_INV_PI * (left * (real(1) + size)) / (bracket * real_sqrt(bracket));
}

/* The inverse of its distribution, cosθ = (1 + g² - ((1 - g²)/(1 + g (1 - 2u)))²)/2g, as 1 - cosθ and 1 + cosθ (of -g where g
   is negative), so that there is no division by g and both ends keep their digits. */
INLINE Vec sample_phase(Real g, Vec d, Real u, Real v)
{
    Mask back = g < real(0);
    Real x = select(back, u, real(1) - u), rest = select(back, real(1) - u, u);
    Real size = real_abs(g), minus = real(1) - size, plus = real(1) + size, scale = minus + (size + size) * x;
    Real twice = real(2) / (scale * scale);
    Real below = minus * minus * rest * (real(1) + size * x) * twice;
    Real above = plus * plus * x * (minus + size * x) * twice;
    return vec_from_frame(d, turned(real_sqrt(below * above), v, flip_sign(real(1) - below, g)));
}

#endif
