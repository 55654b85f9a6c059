/* P6 Reconstruction filters: a pixel is ∫ w L / ∫ w over the film, w the product of one function of x and of y around
   the pixel's middle, each cut at the film's edges. Points of the film are chosen by w, so that each sample counts alike
   and a pixel's samples are its own; Mitsuba's ratio Σ w L / Σ w has the same limit.

   filters/NAME.h defines, for a kind of the list FILTERS in kinds.h,
     Name, name_plugin  what a scene file says of it
     name_radius        pixels, beyond which w is 0
     name_weight        w, even, at 0 ≤ x ≤ radius; not normalised. */
#pragma once

#include "kinds.h"
#include "kinds/filters.h"

#include <math.h>

/* The function w, tabled by shares of its integral: t²/2 of it is nearer to an end of it than from_end(t), which is smooth,
   also where w grows from 0 on. */
enum { FILTER_NODES = 1024 };
typedef struct {
    FilterKind kind;
    union {
#define X(NAME, name, words) struct name name;
        FILTERS(X)
#undef X
    } as;
    double radius, integral;
    double from_end[FILTER_NODES + 1]; /* at t = 0, 1/NODES, …, 1: pixels */
} Filter;

/* Mitsuba takes any filter of this radius for the box filter. */
static inline bool filter_is_pixel(const Filter *filter) { return filter->radius == .5; }

static inline double filter_weight(const Filter *filter, double x)
{
    double weight = 0, at = fabs(x);
#define X(NAME, name, words)                                                                                 \
    if (filter->kind == FILTER_##NAME && at <= filter->radius)                                               \
        weight = name##_weight(&filter->as.name, at);
    FILTERS(X)
#undef X
    return fmax(weight, 0);
}

/* The table, by trapezoids; within one, ∫ w = rest at w_a s + (w_b - w_a) s²/2h. */
static inline void filter_table(Filter *filter)
{
    enum { STEPS = 1 << 15 };
    double r = filter->radius, h = r / (double)STEPS, done = 0, half = 0, a = 0;
    for (int i = 0; i < STEPS; i++)
        half += (filter_weight(filter, r - i * h) + filter_weight(filter, r - (i + 1) * h)) * h / 2;
    int node = 0;
    for (int i = 0; i < STEPS; i++, done += a) {
        double w_a = filter_weight(filter, r - i * h), w_b = filter_weight(filter, r - (i + 1) * h);
        a = (w_a + w_b) * h / 2;
        for (; node < FILTER_NODES; node++) {
            double t = node / (double)FILTER_NODES, rest = t * t * half - done;
            if (rest >= a)
                break;
            double root = sqrt(fmax(w_a * w_a + 2 * (w_b - w_a) * rest / h, 0));
            filter->from_end[node] = i * h + (rest > 0 ? 2 * rest / (w_a + root) : 0);
        }
    }
    while (node <= FILTER_NODES)
        filter->from_end[node++] = r;
    filter->integral = 2 * half;
}

/* What share of the integral is left of x, by the table. */
static inline double filter_share(const Filter *filter, double x)
{
    const double *nodes = filter->from_end;
    double d = fmin(fmax(filter->radius - fabs(x), 0), filter->radius);
    int low = 0, high = FILTER_NODES;
    while (high - low > 1)
        *(nodes[(low + high) / 2] <= d ? &low : &high) = (low + high) / 2;
    double width = nodes[high] - nodes[low], t = (low + (width > 0 ? (d - nodes[low]) / width : 0)) / (double)FILTER_NODES;
    double share = fmin(t * t / 2, .5);
    return x < 0 ? share : 1 - share;
}

/* Of the pixel at `at` of a side of `size` pixels, around which `border` more are film: the shares of w that lie left of
   what is on the film, and on it. */
static inline void filter_cut(const Filter *filter, int at, int size, int border, double cut[2])
{
    double middle = at + .5;
    cut[0] = filter_share(filter, -border - middle);
    cut[1] = filter_share(filter, size + border - middle) - cut[0];
}

#ifdef LANES

#include "lanes/lane.h"

typedef struct {
    Num radius, *from_end;
    Num (*cut[2])[2]; /* by column and by row of the picture: filter_cut */
} FilterRow;

/* How far from the pixel's middle the sample is, along x (0) or y (1); the pixel's corner is at `pixel`. */
INLINE Real filter_sample(const FilterRow *filter, int axis, Real pixel, Real u)
{
    const Num *cut = &filter->cut[axis][0][0];
    Index row = real_floor(pixel) * 2;
    Real v = gather(cut, row) + u * gather(cut + 1, row);
    Mask left = v < real(.5);
    Real t = real_sqrt(real(2) * real_max(real_min(v, real(1) - v), real(0))) * real(FILTER_NODES);
    Real whole = real_min(t, real(FILTER_NODES - 1));
    Index node = real_floor(whole);
    Real low = gather(filter->from_end, node), high = gather(filter->from_end + 1, node);
    Real within = t - whole + real_fraction(whole);
    Real from_end = low + (high - low) * within, offset = real(filter->radius) - from_end;
    return select(left, real(0) - offset, offset);
}

#endif
