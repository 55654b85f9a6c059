/* What media between surfaces do to light: their table, and which of them is where.

   media/NAME.h defines, for a kind of the list MEDIA in kinds.h,
     Name, name_plugin    what a scene file says of it.
   One that a shape has on either side is met by rays that come through the shape there, and stays with a path until it
   comes through another shape that has one, as in Mitsuba. */
#pragma once

#include "kinds/media.h"
#include "materials/scatter.h"
#include "media/phase.h"

typedef struct {
    Num sigma_t[3], g; /* extinction, m⁻¹, and the mean cosine of its phase function */
    Num albedo[3], unused;
} MediumRow;

typedef struct {
    MediumRow *rows; /* 0 is the vacuum */
    Int *beyond; /* by row of the tables by slot, its front and its back: the medium there, or UNCHANGED */
    Int eye; /* the sensor's */
    int coloured; /* extinction differs by channel */
} Media;
enum { UNCHANGED = -1 };

/* A medium as its rays see it. */
typedef struct {
    Light sigma_t, albedo;
    Real g;
} Matter;

INLINE Matter matter_of(const Media *media, Index medium)
{
    Real row[8];
    gather_row(media->rows, medium, 8, row);
    return (Matter){light(row[0], row[1], row[2]), light(row[4], row[5], row[6]), row[3]};
}

/* The medium that a ray along d is in once it has left the surface. */
INLINE Index medium_towards(const Media *media, const Surface *s, Vec d, Index before)
{
    Index side = index_select(vec_dot(s->face, d) > real(0), index_of(0), index_of(1));
    Index beyond = gather_index(media->beyond, s->of * 2 + side);
    return index_select(beyond == index_of(UNCHANGED), before, beyond);
}

/* e^(-σ t), 0 below e^-80. */
INLINE Real attenuation(Real sigma, Real t)
{
    Real depth = -(sigma * t);
    return only(depth > real(-80), real_exp(real_max(depth, real(-80))));
}

/* M1 Beer's law: the share of light that comes through a stretch of it. */
INLINE Light transmittance(const Matter *matter, Real t)
{
    Light sigma = matter->sigma_t;
    return light(attenuation(sigma.r, t), attenuation(sigma.g, t), attenuation(sigma.b, t));
}
