/* What the files of sensors define in a kernel: NameRow and name_row, its numbers and how they come about; name_ray,
   where a path starts; name_eye, where one from a light ends. Both get two uniform numbers for a point of the lens, if
   there is one. sensor.h chooses between them. */
#pragma once

#include "shapes/shape.h"

/* L17 The eye, seen from a point. */
typedef struct {
    Mask seen; /* the point is within the image and between the planes */
    Vec wi;    /* unit vector to the eye */
    Real distance;
    Real to_near; /* of it, up to the near plane */
    Real x, y;    /* where on the film, in pixels */
    Real weight;  /* mean radiance of the image per flux arriving, over the receiver's cosine: a pixel sees
                     dΩ = cos³θ dA_film at distance 1, a surface dΩ cos/d² of it: 1/(d² cos³θ A_film), m⁻²·sr⁻¹;
                     without perspective 1/A_film, m⁻², of the film across the rays */
} Eye;
