/* M1 A homogeneous medium: light that goes t far through it is absorbed or scattered but for e^(-σ_t t). Of what does not
   come through, the share `albedo` is scattered. */
#pragma once

#include "fields.h"
#include "vectors.h"

typedef struct homogeneous {
    double sigma_t[3]; /* m⁻¹, by channel */
    double albedo[3];
    double scale; /* of sigma_t, until the check */
} Homogeneous;

static inline void homogeneous_check(void *plugin, Said *said)
{
    Homogeneous *m = plugin;
    for (int c = 0; c < 3; c++) {
        m->sigma_t[c] *= m->scale;
        if (m->sigma_t[c] != 0 && !(m->sigma_t[c] >= 1e-100 && m->sigma_t[c] <= 1e100))
            fail(said, "sigma_t times scale is %.3g: it must be 0 or in [1e-100,1e100]", m->sigma_t[c]);
    }
}

static const Plugin homogeneous_plugin = {"homogeneous", homogeneous_check, {
    {"sigma_t", AS_COLOUR, offsetof(Homogeneous, sigma_t), "[0,inf)", "1"},
    {"albedo", AS_COLOUR, offsetof(Homogeneous, albedo), "[0,1]", "0.75"},
    {"scale", AS_FLOAT, offsetof(Homogeneous, scale), "[0,inf)", "1"},
    {"sample_emitters", AS_BOOLEAN, LEFT_OUT, NULL, "true"}}};
