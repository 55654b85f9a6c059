/* The tracer's body, compiled for LANES lanes of one precision, in one instance for each row of INSTANCES. */
#include "kernel.h"

#include "path.h"
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

INLINE void make_starts(Queue *queue, const Scene *scene, const Job *job)
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
    start_at(&queue->start, scene, x, y);
    queue->used = 0;
}

#define COPY_LANE(field) LANE(path->field, lane) = LANE(start->field, used)

/* Gives each lane whose path has ended the next sample, and starts its path. */
INLINE void refill(Path *path, Queue *queue, const Scene *scene, const Job *job, Mask *busy)
{
    const Start *start = &queue->start;
    Mask fresh = mask_none();
    for (unsigned idle = mask_bits(mask_not(*busy)); idle && queue->next < queue->count; idle &= idle - 1) {
        int lane = lowest_lane(idle);
        if (queue->used == LANES)
            make_starts(queue, scene, job);
        int used = queue->used++;
        queue->item[lane] = queue->next++;
        LANE(fresh, lane) = LANE(mask_all(), lane);
        COPY_LANE(rng.pixel), COPY_LANE(rng.sample_low), COPY_LANE(rng.sample_high);
        COPY_LANE(ray.o.x), COPY_LANE(ray.o.y), COPY_LANE(ray.o.z);
        COPY_LANE(ray.d.x), COPY_LANE(ray.d.y), COPY_LANE(ray.d.z);
        COPY_LANE(ray.tmax), COPY_LANE(ray.from);
        (void)used;
    }
    *busy |= fresh;
    path_start(path, fresh);
}

/* Puts away the radiance of each lane whose path has ended. */
INLINE void collect(const Path *path, const Queue *queue, const Job *job, Mask *busy)
{
    for (unsigned ended = mask_bits(and_not(*busy, path->alive)); ended; ended &= ended - 1) {
        int lane = lowest_lane(ended);
        double *to = job->radiance + 3 * queue->item[lane];
        to[0] = (double)LANE(path->radiance.x, lane);
        to[1] = (double)LANE(path->radiance.y, lane);
        to[2] = (double)LANE(path->radiance.z, lane);
    }
    *busy = path->alive;
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
            refill(&path, &queue, scene, job, &busy);
        if (!any(busy))
            break;
        path_step(&path, scene, f);
        Mask endless = path.alive & (path.depth + 1 >= index_of(PATH_LIMIT));
        if (any(endless))
            for (int lane = 0; lane < LANES; lane++)
                if (LANE(endless, lane))
                    counters->endless = (int64_t)LANE(path.rng.pixel, lane);
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
#define INDOOR (HAS_ALIGNED | HAS_RECTANGLE | HAS_CUBE | HAS_DIFFUSE | HAS_AREA | HAS_FLAT_LIGHT)
#ifdef ONLY_GENERIC
#define INSTANCES(X)
#else
#define INSTANCES(X)                                                                                         \
    X(indoor, INDOOR | USE_NEE | USE_MIS | USE_COSINE | USE_ROULETTE)                                        \
    X(indoor_direct, INDOOR | USE_NEE | USE_MIS | USE_COSINE)
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
const Kernel KERNEL = {PRECISION_NAME, LANES, prepare, features, instance, render, release};
