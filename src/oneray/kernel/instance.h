/* Instances of the tracer: the same sources compiled for a set of features, what is not in the set folds away. */
#ifndef ONERAY_KERNEL_INSTANCE_H
#define ONERAY_KERNEL_INSTANCE_H

#include "kernel/kernel.h"
#include "prepare/scene.h"

typedef struct {
    const char *name; /* NULL at the end of a table */
    Features set;
    void (*render)(const Scene *scene, const Job *job, Counters *counters);
} Instance;

#ifdef INSTANCES
extern const Instance INSTANCES[]; /* those of these lanes and this precision, the leanest first */
#endif

#endif
