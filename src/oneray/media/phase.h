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

/* The inverse of its distribution, cosθ = (1 + g² - ((1 - g²)/(1 + g (1 - 2u)))²)/2g, as 1 - cosθ and 1 + cosθ, so that
   there is no division by g and both ends keep their digits. */
INLINE Vec sample_phase(Real g, Vec d, Real u, Real v)
{
    Real rest = real(1) - u, minus = real(1) - g, plus = real(1) + g, size = real_abs(g);
    Real scale = (real(1) - size) + (size + size) * select(g > real(0), rest, u);
    Real twice = real(2) / (scale * scale);
    Real below = minus * minus * u * (real(1) + g * rest) * twice;
    Real above = plus * plus * rest * (real(1) - g * u) * twice;
    return vec_from_frame(d, turned(real_sqrt(below * above), v, real(1) - below));
}

#endif
