/* The tracer's body, compiled for LANES lanes of one precision, in one instance for each row of INSTANCES. */
#include "kernel.h"

#include "light_trace.h"
#include "prepare.h"

#ifndef KERNEL
#error "KERNEL: the name of the table that this compilation defines"
#endif

/* The samples of a job, in order, W at a time: their camera rays are made together, then given out lane by
   lane as paths end. */
typedef struct {
    Start start;
    int used;                     /* of start's lanes */
    size_t next, count;           /* the sample that its lane 0 is, of how many */
    uint64_t pixel, x, y, sample; /* the next one to be made */
    size_t item[LANES];           /* what each lane of the path works on */
} Queue;

INLINE void make_starts(Queue *queue, const Scene *scene, const Job *job, Features f)
{
    Real x = real(0), y = real(0);
    for (int lane = 0; lane < LANES; lane++) {
        LANE(queue->start.rng.pixel, lane) = (Word)(uint32_t)queue->pixel;
        LANE(queue->start.rng.sample_low, lane) = (Word)(uint32_t)queue->sample;
        LANE(queue->start.rng.sample_high, lane) = (Word)(uint32_t)(queue->sample >> 32);
        LANE(x, lane) = (Num)queue->x;
        LANE(y, lane) = (Num)queue->y;
        if (++queue->sample < job->first_sample + job->sample_count)
            continue;
        queue->sample = job->first_sample;
        queue->pixel++;
        if (++queue->x == (uint64_t)scene->width) {
            queue->x = 0;
            queue->y++;
        }
    }
    if ((f & USE_LIGHT_PATHS) && job->splats)
        start_at_light(&queue->start, scene, f);
    else
        start_at(&queue->start, scene, x, y);
    queue->used = 0;
}

#define COPY_LANE(field) LANE(path->field, lane) = LANE(start->field, used)

/* Gives each lane whose path has ended the next sample, and starts its path. */
INLINE void refill(Path *path, Queue *queue, const Scene *scene, const Job *job, Mask *busy, Features f)
{
    const Start *start = &queue->start;
    Mask fresh = mask_none();
    for (unsigned idle = mask_bits(mask_not(*busy)); idle && queue->next < queue->count; idle &= idle - 1) {
        int lane = lowest_lane(idle);
        if (queue->used == LANES)
            make_starts(queue, scene, job, f);
        int used = queue->used++;
        queue->item[lane] = queue->next++;
        LANE(fresh, lane) = LANE(mask_all(), lane);
        COPY_LANE(rng.pixel), COPY_LANE(rng.sample_low), COPY_LANE(rng.sample_high);
        COPY_LANE(ray.o.x), COPY_LANE(ray.o.y), COPY_LANE(ray.o.z);
        COPY_LANE(ray.d.x), COPY_LANE(ray.d.y), COPY_LANE(ray.d.z);
        COPY_LANE(ray.tmax), COPY_LANE(ray.from);
        if (f & USE_LIGHT_PATHS)
            COPY_LANE(flux.x), COPY_LANE(flux.y), COPY_LANE(flux.z);
        (void)used;
    }
    *busy |= fresh;
    path_start(path, fresh);
}

/* Puts away the radiance of each lane whose path has ended; light paths have none. */
INLINE void collect(const Path *path, const Queue *queue, const Job *job, Mask *busy)
{
    unsigned ended = job->splats ? 0 : mask_bits(and_not(*busy, path->alive));
    for (; ended; ended &= ended - 1) {
        int lane = lowest_lane(ended);
        double *to = job->radiance + 3 * queue->item[lane];
        to[0] = (double)LANE(path->radiance.x, lane);
        to[1] = (double)LANE(path->radiance.y, lane);
        to[2] = (double)LANE(path->radiance.z, lane);
    }
    *busy = path->alive;
}

INLINE void note_pixel(const Path *path, Mask lanes, int64_t *pixel)
{
    unsigned bits = mask_bits(lanes);
    if (bits)
        *pixel = (int64_t)LANE(path->rng.pixel, lowest_lane(bits));
}

INLINE void render_instance(const Scene *scene, const Job *job, Counters *counters, Features f)
{
    Path path;
    memset(&path, 0, sizeof path);
    Queue queue;
    memset(&queue, 0, sizeof queue);
    path.rng.key[0] = queue.start.rng.key[0] = (uint32_t)job->seed;
    path.rng.key[1] = queue.start.rng.key[1] = (uint32_t)(job->seed >> 32);
    queue.count = job->pixel_count * job->sample_count;
    queue.used = LANES;
    queue.sample = job->first_sample;
    queue.pixel = job->first_pixel;
    queue.x = job->first_pixel % (uint64_t)scene->width;
    queue.y = job->first_pixel / (uint64_t)scene->width;
    Mask busy = mask_none();
    for (;;) {
        if (queue.next < queue.count && any(mask_not(busy)))
            refill(&path, &queue, scene, job, &busy, f);
        if (!any(busy))
            break;
        if ((f & USE_LIGHT_PATHS) && job->splats)
            light_step(&path, scene, queue.item, job->splats, f);
        else
            path_step(&path, scene, f);
        Mask endless = path.alive & (path.depth + 1 >= index_of(PATH_LIMIT));
        note_pixel(&path, endless, &counters->endless);
        if (f & USE_LIGHT_PATHS)
            note_pixel(&path, path.unreachable, &counters->unreachable);
        path.alive = and_not(path.alive, endless);
        collect(&path, &queue, job, &busy);
    }
    for (int lane = 0; lane < LANES; lane++) {
        counters->rays += (uint64_t)llabs((long long)LANE(path.rays, lane));
        counters->shadow_rays += (uint64_t)llabs((long long)LANE(path.shadow_rays, lane));
    }
}

/* The instances: for each a set of features, the first that serves a scene is taken. What is not in the set
   folds away. */
#define INDOOR                                                                                               \
    (HAS_ALIGNED | HAS_RECTANGLE | HAS_CUBE | HAS_DIFFUSE | HAS_AREA | HAS_FLAT_LIGHT | USE_NEE | USE_MIS    \
        | USE_COSINE | USE_SOLID_ANGLE)
#ifdef ONLY_GENERIC
#define INSTANCES(X)
#else
#define INSTANCES(X)                                                                                         \
    X(indoor, INDOOR | USE_ROULETTE)                                                                         \
    X(indoor_direct, INDOOR)
#endif

#define X(name, set)                                                                                         \
    static void render_##name(const Scene *scene, const Job *job, Counters *counters)                        \
    {                                                                                                        \
        render_instance(scene, job, counters, set);                                                          \
    }
INSTANCES(X)
#undef X

static void render_generic(const Scene *scene, const Job *job, Counters *counters)
{
    render_instance(scene, job, counters, scene->features);
}

typedef struct {
    const char *name;
    Features set;
    void (*render)(const Scene *scene, const Job *job, Counters *counters);
} Instance;

static Instance instance_for(Features wanted)
{
#define X(name, set) {#name, set, render_##name},
    const Instance instances[] = {INSTANCES(X){"generic", 0, render_generic}};
#undef X
    size_t last = sizeof instances / sizeof *instances - 1;
    for (size_t i = 0; i < last; i++)
        if (!(wanted & ~instances[i].set) && (wanted & EITHER_WAY) == (instances[i].set & EITHER_WAY))
            return instances[i];
    return instances[last];
}

/* L18 The pre-pass: where paths go, a grid of regions over that, then rays to lights, chosen half by
   contribution and half by count, to see which arrive. */
enum { LESSON_PATHS = 1 << 17, LESSON_CELLS = 12 };
#define LESSON_SEED 0x6c6573736f6eu

static void take_lesson(Scene *scene, uint64_t samples)
{
    size_t pixels = (size_t)scene->width * (size_t)scene->height, row = (size_t)scene->width;
    double *radiance = allocate(row * samples, 3 * sizeof *radiance);
    Counters counters = {0, 0, -1, -1};
    for (size_t pixel = 0; pixel < pixels; pixel += row) {
        Job job = {LESSON_SEED, 0, pixel, samples, row, radiance, NULL};
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
        uint64_t pixels = (uint64_t)scene->width * (uint64_t)scene->height;
        size_t numbers = lay_regions(&scene->lights.tree, &lesson, LESSON_CELLS);
        lesson.bounds_only = 0;
        lesson.tested = allocate(numbers, sizeof *lesson.tested);
        lesson.seen = allocate(numbers, sizeof *lesson.seen);
        take_lesson(scene, pixels < LESSON_PATHS ? LESSON_PATHS / pixels : 1);
        scene->lights.tree.visible = keep(scene, numbers, sizeof(Num));
        for (size_t k = 0; k < numbers; k++)
            scene->lights.tree.visible[k] = (Num)learned_share(lesson.seen[k], lesson.tested[k]);
        free(lesson.tested);
        free(lesson.seen);
    }
    scene->lights.tree.uniform_share = (Num)LEARNED_UNIFORM_SHARE;
    scene->lesson = NULL;
}

static void *prepare_and_learn(const Description *description, const Technique *technique)
{
    Scene *scene = prepare(description, technique);
    if (scene->features & USE_LEARNED)
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

#ifdef SINGLE
#define PRECISION_NAME "single"
#else
#define PRECISION_NAME "double"
#endif

extern const Kernel KERNEL;
const Kernel KERNEL = {PRECISION_NAME, LANES, prepare_and_learn, features, instance, render, release};
