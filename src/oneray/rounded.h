/* Elementary functions whose result is the same on every host. libm's differ in the last bit from one processor and
   one version to the next, and pictures would with them. These are the numbers next to the true values (but for one
   argument in about 1e15): libm's value, or none, corrected in sums of two doubles, 106 bits, which need nothing but
   the +, -, ×, ÷ and √ that IEEE 754 rounds. Dekker, "A floating-point technique for extending the available
   precision", 1971; hypot: Borges, "An improved algorithm for hypot(a, b)", 2019. For setting up: they take a
   microsecond. "cr" is correctly rounded, as in C23. */
#pragma once

#include <math.h>
#include <stdbool.h>

double cr_sin(double x);                    /* |x| <= 1e9 */
double cr_cos(double x);
double cr_tan(double x);
double cr_atan2(double y, double x);
double cr_exp(double x);
double cr_expm1(double x);                  /* x >= 1e-9 */
double cr_log(double x);                    /* 0 < x, normal */
double cr_pow(double x, double y);          /* 0 < x, normal, or 0 with 0 < y */
double cr_cbrt(double x);                   /* 0 <= x */

/* √(x² + y²), no square of which underflows or overflows. Within half a unit of the last place and a little. */
static inline double cr_hypot(double x, double y)
{
    double a = fmax(fabs(x), fabs(y)), b = fmin(fabs(x), fabs(y));
    if (!(b > a * 0x1p-54))
        return a + b;
    double unit = a > 0x1p500 ? 0x1p600 : b < 0x1p-450 ? 0x1p-600 : 1;
    a /= unit, b /= unit;
    double h = sqrt(a * a + b * b), rest = h - (h <= 2 * b ? b : a);
    double excess = h <= 2 * b ? a * (2 * rest - a) + (rest - 2 * (a - b)) * rest
                               : 2 * rest * (a - 2 * b) + ((4 * rest - b) * b + rest * rest);
    return (h - excess / (2 * h)) * unit;
}
