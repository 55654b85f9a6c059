/* The kernel's loop: the samples of a job as paths, W at a time. */
#pragma once

#include "kernel/kernel.h"
#include "estimators/bidirectional.h"
#include "estimators/photons.h"
#include "estimators/through.h"

/* The samples of a job, in order, W at a time: their camera rays are made together, then given out lane by
   lane as paths end. */
typedef struct {
    Start start;
    int used;                     /* of start's lanes */
    size_t next, count;           /* the sample that its lane 0 is, of how many */
    uint64_t pixel, x, y, sample; /* the next one to be made */
    size_t item[LANES];           /* what each lane of the path works on */
} Queue;

STAGE void make_starts(Queue *queue, const Scene *scene, const Job *job, Features f)
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
    if ((f.use & FROM_LIGHTS) && (job->splats || job->photons))
        start_at_light(&queue->start, scene, f);
    else
        start_at(&queue->start, scene, x, y, f);
    queue->used = 0;
}

/* Paths so short stay side by side in all lanes: all of them start at once, and are at their last ray at once. */
enum { IN_STEP_DEPTH = 2 };

/* What a path takes over from its start. */
#define START_FIELDS(X)                                                                                      \
    X(rng.pixel) X(rng.sample_low) X(rng.sample_high) X(ray.o.x) X(ray.o.y) X(ray.o.z) X(ray.d.x) X(ray.d.y) \
    X(ray.d.z) X(ray.tmax) X(ray.from)

/* Gives each lane whose path has ended the next sample, and starts its path. */
INLINE void refill(Path *path, Queue *queue, const Scene *scene, const Job *job, Mask *busy, Features f)
{
    const Start *start = &queue->start;
    Mask fresh = mask_none();
    if (queue->used == LANES && !any(*busy) && queue->count - queue->next >= LANES) {
        make_starts(queue, scene, job, f);
        for (queue->used = 0; queue->used < LANES; queue->used++)
            queue->item[queue->used] = queue->next++;
#define X(field) path->field = start->field;
        START_FIELDS(X)
#undef X
        path->roulette = start->roulette;
        path->flux = start->flux;
        path->first_hit = start->hit;
        *busy = mask_all();
        path_start(path, *busy);
        if (f.has & HAS_PASSING)
            path_enters(path, scene, *busy, f);
        return;
    }
    for (unsigned idle = mask_bits(mask_not(*busy)); idle && queue->next < queue->count; idle &= idle - 1) {
        int lane = lowest_lane(idle);
        if (queue->used == LANES)
            make_starts(queue, scene, job, f);
        int used = queue->used++;
        queue->item[lane] = queue->next++;
        LANE(fresh, lane) = LANE(mask_all(), lane);
#define X(field) LANE(path->field, lane) = LANE(start->field, used);
        START_FIELDS(X)
        if (f.use & USE_ROULETTE)
            X(roulette)
        if (AHEAD(f)) {
            LANE(path->first_hit.t, lane) = LANE(start->hit.t, used);
            LANE(path->first_hit.slot, lane) = LANE(start->hit.slot, used);
        }
        if (f.use & FROM_LIGHTS) {
            X(flux.r) X(flux.g) X(flux.b)
        }
#undef X
        (void)used;
    }
    *busy |= fresh;
    path_start(path, fresh);
    if (f.has & HAS_PASSING)
        path_enters(path, scene, fresh, f);
}

/* Puts away the radiance of each lane whose path has ended; light paths have none. */
INLINE void collect(const Path *path, const Queue *queue, const Job *job, Mask *busy)
{
    unsigned ended = job->splats || job->photons ? 0 : mask_bits(and_not(*busy, path->alive));
    for (; ended; ended &= ended - 1) {
        int lane = lowest_lane(ended);
        light_lane(&path->radiance, lane, job->radiance + 3 * queue->item[lane]);
    }
    *busy = path->alive;
}

INLINE void note_pixel(const Path *path, Mask lanes, int64_t *pixel)
{
    unsigned bits = mask_bits(lanes);
    if (bits)
        *pixel = (int64_t)LANE(path->rng.pixel, lowest_lane(bits));
}

INLINE Queue queue_of(const Scene *scene, const Job *job)
{
    Queue queue = {.used = LANES,
        .count = job->pixel_count * job->sample_count,
        .pixel = job->first_pixel,
        .x = job->first_pixel % (uint64_t)scene->width,
        .y = job->first_pixel / (uint64_t)scene->width,
        .sample = job->first_sample};
    queue.start.rng.key[0] = (uint32_t)job->seed;
    queue.start.rng.key[1] = (uint32_t)(job->seed >> 32);
    return queue;
}

INLINE void trace_paths(const Scene *scene, const Job *job, Counters *counters, Features f)
{
    Path path = {0};
    Queue queue = queue_of(scene, job);
    memcpy(path.rng.key, queue.start.rng.key, sizeof path.rng.key);
    Mask busy = mask_none();
    const int in_step = scene->max_depth <= IN_STEP_DEPTH;
    for (;;) {
        if (queue.next < queue.count && any(mask_not(busy)) && !(in_step && any(busy)))
            refill(&path, &queue, scene, job, &busy, f);
        if (!any(busy))
            break;
        if ((f.use & USE_LIGHT_PATHS) && job->splats)
            light_path_step(&path, scene, queue.item, job->splats, f);
        else if ((f.use & USE_PHOTONS) && job->photons)
            photon_step(&path, scene, queue.item, job->photons, as_flux(f));
        else if (f.use & USE_PHOTONS)
            gather_step(&path, scene, job->map, f);
        else if (f.has & HAS_PASSING)
            path_step_through(&path, scene, f);
        else
            path_step(&path, scene, f);
        Mask endless = path.alive & (path.depth + 1 >= index_of(PATH_LIMIT));
        note_pixel(&path, endless, &counters->endless);
        if (f.use & USE_LIGHT_PATHS)
            note_pixel(&path, path.unreachable, &counters->unreachable);
        path.alive = and_not(path.alive, endless);
        collect(&path, &queue, job, &busy);
    }
    for (int lane = 0; lane < LANES; lane++) {
        counters->rays += (uint64_t)llabs((long long)LANE(path.rays, lane));
        counters->shadow_rays += (uint64_t)llabs((long long)LANE(path.shadow_rays, lane));
    }
}

/* T1 The samples of a job as pairs of subpaths, a sample in each lane from its beginning to its end. */
INLINE void trace_pairs(const Scene *scene, const Job *job, Counters *counters, Features f)
{
    Queue queue = queue_of(scene, job);
    Pair pair = {.scene = scene};
    int most = scene->max_depth < MOST_LIGHT_VERTICES ? (int)scene->max_depth : MOST_LIGHT_VERTICES;
    pair.most_s = most;
    pair.most_edges = (int)scene->max_depth;
    while (queue.next < queue.count) {
        Mask active = mask_none();
        make_starts(&queue, scene, job, f);
        for (int lane = 0; lane < LANES && queue.next < queue.count; lane++) {
            queue.item[lane] = queue.next++;
            LANE(active, lane) = LANE(mask_all(), lane);
        }
        pair.eye.path.radiance = light_all(real(0));
        Mask endless = trace_pair(&pair, &queue.start, active, queue.item, job->splats, f);
        note_pixel(&pair.eye.path, endless, &counters->endless);
        for (unsigned left = mask_bits(active); left; left &= left - 1) {
            int lane = lowest_lane(left);
            light_lane(&pair.eye.path.radiance, lane, job->radiance + 3 * queue.item[lane]);
        }
    }
    const Path *paths[] = {&pair.light.path, &pair.eye.path};
    for (int lane = 0; lane < 2 * LANES; lane++) {
        counters->rays += (uint64_t)llabs((long long)LANE(paths[lane / LANES]->rays, lane % LANES));
        counters->shadow_rays += (uint64_t)llabs((long long)LANE(paths[lane / LANES]->shadow_rays, lane % LANES));
    }
}

/* An instance of the tracer: compiled for a set of features, what is not in the set folds away. */
typedef struct {
    const char *name; /* NULL at the end of a table */
    Features set;
    void (*render)(const Scene *scene, const Job *job, Counters *counters);
} Instance;

#ifdef INSTANCES
extern const Instance INSTANCES[]; /* those of these lanes and this precision, the leanest first */
#endif
