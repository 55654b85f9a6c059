/* Surfaces so close to each other that single precision may take one for the other. */
#pragma once

#include "scene/description.h"

typedef struct {
    double limit; /* a gap below this is narrow, unless it is none: */
    double touch; /* surfaces within this are in one place, where it does not matter which of them a ray meets */
    int one, other; /* gets the lines of two shapes with a narrow gap between them, the lower first; 0: triangles are
                       close to so many others that the search ended early */
} Gap;

/* Is there one? Of meshes with more than GAP_SAMPLES triangles so many are looked at, spread evenly over what the
   camera sees of them and over their area, so that what is missed is less than 1/4096 of either. */
enum { GAP_SAMPLES = 16384 };
bool find_narrow_gap(const Description *d, Gap *gap);

/* Is a triangle near the point, or the point in the plane of one that is as large as their distance? */
bool near_triangles(const Description *d, const double p[3], double limit, double reach, int *line);
