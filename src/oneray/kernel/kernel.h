/* A kernel: the tracer compiled for one precision and one number of lanes. What main knows of it. */
#pragma once

#include "estimators/splats.h"
#include "scene/description.h"
#include "technique.h"
#include "trees/photon_map.h"

#include <stddef.h>

/* A run of samples: pixels first_pixel … in reading order, for each the samples first_sample …, and where
   they go: radiance[(pixel * sample_count + sample) * 3 + channel]. */
typedef struct {
    uint64_t seed, first_sample, first_pixel;
    size_t sample_count, pixel_count;
    double *radiance;
    Splats *splats; /* not NULL: light paths instead, one for each pixel's sample; they go here, radiance stays
                       as it is. Of bidirectional paths both: what falls on any pixel goes here, on its own to radiance */
    Photons *photons; /* not NULL: light paths of a photon map's pass instead, which leave theirs here */
    const PhotonMap *map; /* that the eye's paths gather from */
} Job;

typedef struct {
    uint64_t rays; /* the last of a path among them, of which perhaps only is known that it meets no light */
    uint64_t shadow_rays;
    int64_t endless; /* a pixel whose path did not end within PATH_LIMIT vertices, or -1 */
    int64_t unreachable; /* light tracing: a pixel that shows a mirror or glass, or -1 */
} Counters;

typedef struct {
    const char *precision;
    double rounding; /* of a number, at most, relative to it */
    int lanes;
    void *(*prepare)(const Description *description, const Technique *technique);
    Features (*features)(const void *scene);
    const char *(*instance)(const void *scene); /* the name of the instance that will run */
    void (*render)(const void *scene, const Job *job, Counters *counters, int generic);
    void (*release)(void *scene);
} Kernel;

/* The widest kernel of this precision that the processor runs, or the one with this many lanes; NULL: there
   is none. */
const Kernel *kernel_find(const char *precision, int lanes);
/* All that were built, NULL at the end; and whether number i runs here. */
const Kernel *kernel_built(int i);
int kernel_runs(int i);
