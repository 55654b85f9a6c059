/* A kernel: the tracer for LANES lanes of one precision, generic, and the choice of a specialised instance. */
#include "kernel/kernel.h"

#include "prepare/prepare.h"
#include "kernel/trace.h"

#ifndef KERNEL
#error "KERNEL: the name of the table that this compilation defines"
#endif

static void render_generic(const Scene *scene, const Job *job, Counters *counters)
{
    if (scene->features.use & USE_BIDIRECTIONAL)
        trace_pairs(scene, job, counters, scene->features);
    else
        trace_paths(scene, job, counters, scene->features);
}

#ifdef INSTANCES
/* The bits that an instance must have as asked, no more and no less: those that choose between two ways, and those
   that go with tables which other scenes do not have. */
#define EXACTLY_HAS (HAS_TREE | HAS_MESH | HAS_FRESNEL | HAS_BLEND | HAS_HIDDEN)
#define EXACTLY_USE (~USE_ROULETTE)

static int serves(Features set, Features wanted)
{
    return !(wanted.has & ~set.has) && !(wanted.use & ~set.use) && !((wanted.has ^ set.has) & EXACTLY_HAS)
           && !((wanted.use ^ set.use) & EXACTLY_USE);
}
#endif

static Instance instance_for(Features wanted)
{
#ifdef INSTANCES
    for (const Instance *i = INSTANCES; i->name; i++)
        if (serves(i->set, wanted))
            return *i;
#endif
    return (Instance){"generic", wanted, render_generic};
}

/* L18 The pre-pass: where paths go, a grid of regions over that, then rays to lights, chosen half by
   contribution and half by count, to see which arrive. */
enum { LESSON_PATHS = 1 << 17, LESSON_CELLS = 12 };
#define LESSON_SEED 0x6c6573736f6eu

static void take_lesson(Scene *scene, size_t samples)
{
    size_t pixels = (size_t)scene->width * (size_t)scene->height, row = (size_t)scene->width;
    double *radiance = allocate(row * samples, 3 * sizeof *radiance);
    Counters counters = {0, 0, -1, -1};
    for (size_t pixel = 0; pixel < pixels; pixel += row) {
        Job job = {LESSON_SEED, 0, pixel, samples, row, radiance, NULL, NULL, NULL};
        render_generic(scene, &job, &counters);
    }
    free(radiance);
}

static void learn(Scene *scene)
{
    Lesson lesson = {1, {NUM_MAX, NUM_MAX, NUM_MAX}, {-NUM_MAX, -NUM_MAX, -NUM_MAX}, NULL, NULL};
    scene->lesson = &lesson;
    take_lesson(scene, 1);
    if (lesson.low[0] <= lesson.high[0]) {
        size_t pixels = (size_t)scene->width * (size_t)scene->height;
        size_t numbers = lay_regions(&scene->emitters.tree, &lesson, LESSON_CELLS);
        lesson.bounds_only = 0;
        lesson.tested = allocate(numbers, sizeof *lesson.tested);
        lesson.seen = allocate(numbers, sizeof *lesson.seen);
        take_lesson(scene, pixels < LESSON_PATHS ? LESSON_PATHS / pixels : 1);
        scene->emitters.tree.visible = keep(scene, numbers, sizeof(Num));
        for (size_t k = 0; k < numbers; k++)
            scene->emitters.tree.visible[k] = (Num)learned_share(lesson.seen[k], lesson.tested[k]);
        free(lesson.tested);
        free(lesson.seen);
    }
    scene->emitters.tree.p_by_count = (Num)LEARNED_P_BY_COUNT;
    scene->lesson = NULL;
}

static void *prepare_and_learn(const Description *description, const Technique *technique)
{
    Scene *scene = prepare(description, technique, features_of(description, technique));
    if (scene->features.use & USE_LEARNED)
        learn(scene);
    return scene;
}

static Features features(const void *scene) { return ((const Scene *)scene)->features; }
static const char *instance(const void *scene) { return instance_for(features(scene)).name; }

static void render(const void *scene, const Job *job, Counters *counters, int generic)
{
    if (generic)
        render_generic(scene, job, counters);
    else
        instance_for(features(scene)).render(scene, job, counters);
}

extern const Kernel KERNEL;
const Kernel KERNEL = {BY_PRECISION("single", "double"), NUM_ROUNDING, LANES, prepare_and_learn, features,
    instance, render, release};
