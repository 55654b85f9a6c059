/* P6 Gaussian filter, cut off at 4 σ, where it is made to end at 0: w(x) = exp(-x²/2σ²) - exp(-8). */
#pragma once

#include "fields.h"

typedef struct gaussian {
    double stddev; /* σ, pixels */
} Gaussian;

static const Plugin gaussian_plugin = {"gaussian", NULL, {
    {"stddev", AS_FLOAT, offsetof(Gaussian, stddev), "(0,25]", ".5"}}};

static inline double gaussian_radius(const Gaussian *f) { return 4 * f->stddev; }

/* Mitsuba's polynomial in x²/σ², which is within 8e-4 of exp(-x²/2σ²). */
static inline double gaussian_weight(const Gaussian *f, double x)
{
    static const double coefficients[] = {9.992604880e-1, -4.977025247e-1, 1.222248550e-1, -1.932406282e-2, 2.136713061e-3,
        -1.679873860e-4, 9.202145248e-6, -3.329417433e-7, 7.128382794e-9, -6.821193280e-11};
    double at[2] = {x / f->stddev * (x / f->stddev), 16}, value[2] = {0, 0};
    for (int i = 0; i < 2; i++)
        for (int k = 9; k >= 0; k--)
            value[i] = value[i] * at[i] + coefficients[k];
    return value[0] - value[1];
}
