/* Points, directions and affine matrices in plain doubles, as scene files and meshes have them. */
#pragma once

#include <math.h>

#include "rounded.h"

#define PI 3.14159265358979323846

/* The first three rows of an affine matrix: a point p goes to m[i][0..2]·p + m[i][3]. */
typedef struct {
    double m[3][4];
} Affine;

static inline double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static inline void difference(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] - b[i];
}

/* Whatever the numbers' size: no square underflows or overflows. */
static inline double length(const double a[3]) { return cr_hypot(cr_hypot(a[0], a[1]), a[2]); }

/* The same to within a rounding or two, in a quarter of the time. */
static inline double norm(const double a[3])
{
    double square = dot(a, a);
    return square > 1e-250 && square < 1e250 ? sqrt(square) : length(a);
}

/* Makes a of length 1, but one of length 0 stays. */
static inline void normalise(double a[3])
{
    double size = length(a);
    for (int i = 0; i < 3 && size > 0; i++)
        a[i] /= size;
}

/* a over the root of its square, which is returned: where that is 0 or overflows, the caller refuses it. */
static inline double unit(const double a[3], double out[3])
{
    double size = sqrt(dot(a, a));
    for (int i = 0; i < 3; i++)
        out[i] = a[i] / size;
    return size;
}

/* The largest of the coordinates' sizes. */
static inline double extent_of(const double a[3]) { return fmax(fabs(a[0]), fmax(fabs(a[1]), fabs(a[2]))); }

/* Where the axis j goes; 3: the origin. */
static inline void column(const Affine *a, int j, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a->m[i][j];
}

static inline Affine affine_scale(double x, double y, double z)
{
    return (Affine){{{x, 0, 0, 0}, {0, y, 0, 0}, {0, 0, z, 0}}};
}

static inline Affine affine_identity(void) { return affine_scale(1, 1, 1); }

static inline Affine affine_translate(double x, double y, double z)
{
    return (Affine){{{1, 0, 0, x}, {0, 1, 0, y}, {0, 0, 1, z}}};
}

/* b first. */
static inline Affine affine_multiply(Affine a, Affine b)
{
    Affine result;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            result.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j]
                             + (j == 3 ? a.m[i][3] : 0);
    return result;
}

static inline double affine_determinant(const Affine *a)
{
    return a->m[0][0] * (a->m[1][1] * a->m[2][2] - a->m[1][2] * a->m[2][1])
           - a->m[0][1] * (a->m[1][0] * a->m[2][2] - a->m[1][2] * a->m[2][0])
           + a->m[0][2] * (a->m[1][0] * a->m[2][1] - a->m[1][1] * a->m[2][0]);
}

/* The scale of a matrix that only scales uniformly, rotates and perhaps mirrors: its columns are of one length and at
   right angles. Else 0. */
static inline double affine_uniform_scale(const Affine *a, double tolerance)
{
    double scale = cr_cbrt(fabs(affine_determinant(a)));
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double one[3], other[3];
            column(a, i, one);
            column(a, j, other);
            if (!(fabs(dot(one, other) / (scale * scale) - (i == j)) <= tolerance))
                return 0;
        }
    return scale;
}
