/* Instances of the tracer: the same sources compiled for a set of features, what is not in the set folds away. */
#pragma once

#include "kernel/kernel.h"
#include "prepare/scene.h"

/* The bits that an instance must have as asked, no more and no less: those that choose between two ways, and those
   that go with tables which other scenes do not have. */
#define EXACTLY_HAS (HAS_TREE | HAS_MESH | HAS_FRESNEL | HAS_BLEND | HAS_HIDDEN)
#define EXACTLY_USE (~USE_ROULETTE)

typedef struct {
    const char *name; /* NULL at the end of a table */
    Features set;
    void (*render)(const Scene *scene, const Job *job, Counters *counters);
} Instance;

#ifdef INSTANCES
extern const Instance INSTANCES[]; /* those of these lanes and this precision, the leanest first */
#endif
