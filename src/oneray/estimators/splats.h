/* L17 What light paths give to pixels. */
#pragma once

#include <stddef.h>

/* Of a vertex to a pixel. */
typedef struct {
    size_t path;   /* of the job's */
    size_t pixel;
    double at[2];  /* with a filter, where on the film, pixels; the pixel is 0 then */
    double radiance[3];
} Splat;

typedef struct {
    Splat *list; /* those of a path in the path's order; the paths in any */
    size_t count, room;
} Splats;
