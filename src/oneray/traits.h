/* What is asked of a material, a texture, an emitter or a sensor of any kind: NAME_traits of the kind's file
   answers. */
#pragma once

#include "fields.h"
#include "vectors.h"

#include <stdbool.h>

typedef struct {
    const Reflectance *reflected, *transmitted; /* of the light; NULL: it has no back side of its own */
    bool absorbs;                          /* part of the rest: a metal */
    const char *odd;                       /* why single precision may not do, or NULL */
    bool anisotropic;                      /* it looks different when it is turned about its normal */
    bool beckmann;                         /* of its mirrors, if it has some */
    bool unbent;                           /* some light goes straight through */
} MaterialTraits;

typedef struct {
    double most[3], least[3]; /* by channel */
    const Affine *to_uv;      /* what acts on (u, v) */
    const struct Image *image; /* that it looks at, or NULL */
} TextureTraits;

/* Where light comes from, and so the measure of an emission and what flux (W) is in proportion to. */
typedef enum {
    FROM_SHAPE, /* in which the emitter stands; random rays meet it: radiance, W·sr⁻¹·m⁻², times its area, m² */
    FROM_POINT, /* intensity, W·sr⁻¹ */
    FROM_AFAR,  /* one direction: irradiance of a plane across it, W·m⁻², times the square of the scene's radius */
    FROM_AROUND /* the environment, which random rays meet that meet nothing else: radiance, times that square */
} LightFrom;

typedef struct {
    LightFrom from;
    const double *emission;
    const double *position;  /* FROM_POINT, else NULL */
    double radius;           /* of a ball around it that its light starts in */
    const double *direction; /* in the middle of its light; NULL: all around */
    double spread, beam;     /* FROM_POINT, half the angles of the cones about that, radians, in which all its light is, and
                                in which it is alike */
    double flux;             /* over the emission and what it is in proportion to */
    const struct Image *image; /* what FROM_AROUND is in this frame: longitude from -z towards x, latitude from y down; or NULL */
    double scale;             /* radiance where that is 1 */
    const Affine *to_world;
    const char *odd;
} EmitterTraits;

/* The picture, pixels, and the film that it is a part of: its size, and where in it the picture begins. */
typedef struct {
    int width, height, film_width, film_height, x, y;
    bool sample_border;
    int border; /* pixels around the picture that are film too */
} Frame;

typedef struct {
    double origin[3];
    double reach;    /* of a ball about that which its rays start in, as far as they start not in one point */
    double farthest; /* that it sees */
    double pixel;    /* its least angle, radians, or without perspective … */
    double side;     /* … the least of its sides, m */
    double axis[3];  /* unit: of the narrowest cone that holds all it sees, */
    double cosine;   /* and of the cone's half angle */
} SensorTraits;
