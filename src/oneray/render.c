#include "render.h"

#include "message.h"

#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    JOB_SAMPLES = 8192
}; /* samples handed to a kernel at once: enough that emptying its lanes costs little */

double seconds_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* A line on a terminal's standard error, none in a pipe. */
typedef struct {
    int shown;
    double started, last;
    uint64_t pixels;
} Progress;

static void progress_show(Progress *progress, double samples, double fraction)
{
    double now = seconds_now(), elapsed = now - progress->started;
    if (!progress->shown || (now - progress->last < 0.25 && fraction < 1))
        return;
    progress->last = now;
    fprintf(stderr, "\r%3.0f %%  %.3g samples/s  %.0f s left   ", 100 * fraction, samples / (elapsed + 1e-9),
        fraction > 0 ? elapsed / fraction - elapsed : 0);
    if (fraction >= 1)
        fputc('\n', stderr);
}

/* What a render has to do, and how far it is. */
typedef struct {
    const Options *options;
    const Description *scene;
    const Kernel *kernel;
    const void *prepared;
    Counters *counters;
    Film *film;
    uint64_t wanted; /* samples per pixel; 0: as many as the time allows */
    Progress progress;
} Render;

static void check_endless(const Render *r)
{
    if (r->counters->unreachable >= 0)
        die("%s: pixel (%lld, %lld) shows a mirror or glass: no light path can be joined to the eye there; "
            "--estimator light wants such surfaces out of view",
            r->options->scene, (long long)(r->counters->unreachable % r->film->width),
            (long long)(r->counters->unreachable / r->film->width));
    if (r->counters->endless >= 0)
        die("%s: pixel (%lld, %lld): a path did not end within %d vertices: the scene is closed and absorbs "
            "nothing; give it a max_depth",
            r->options->scene, (long long)(r->counters->endless % r->film->width),
            (long long)(r->counters->endless / r->film->width), PATH_LIMIT);
}

static bool is_radiance(const double radiance[3])
{
    for (int c = 0; c < 3; c++)
        if (!(radiance[c] >= 0 && radiance[c] <= DBL_MAX))
            return false;
    return true;
}

/* The vertex, the first surface being 1 and a light's point the last, with which the sample stops being a radiance:
   the same path again, cut at 1, 2, 4, … vertices and then between. 0 if it never does. */
static int bad_vertex(const Render *r, size_t pixel, uint64_t sample)
{
    int good = 0, bad = 0;
    for (int next = 1; bad != good + 1 && next <= PATH_LIMIT; next = bad ? (good + bad) / 2 : 2 * next) {
        Description cut = *r->scene;
        double radiance[3];
        Counters counters = {0, 0, -1, -1};
        cut.max_depth = next;
        void *prepared = r->kernel->prepare(&cut, &r->options->technique);
        Job job = {r->options->seed, sample, pixel, 1, 1, radiance, NULL};
        r->kernel->render(prepared, &job, &counters, 1);
        r->kernel->release(prepared);
        *(is_radiance(radiance) ? &good : &bad) = next;
        if (good >= r->scene->max_depth && r->scene->max_depth > 0 && !bad)
            return 0;
    }
    return bad;
}

/* Ends the program over a sample that is no radiance. */
NORETURN static void die_of(const Render *r, size_t pixel, uint64_t sample, const double radiance[3])
{
    size_t width = (size_t)r->film->width;
    char place[96] = "";
    int vertex = r->options->technique.estimator == ESTIMATOR_LIGHT ? 0 : bad_vertex(r, pixel, sample);
    if (vertex)
        snprintf(place, sizeof place, ", vertex %d", vertex);
    for (int c = 0; c < 3; c++)
        if (radiance[c] > DBL_MAX)
            die("%s: pixel (%zu, %zu), sample %llu%s: radiance overflows %s precision", r->options->scene,
                pixel % width, pixel / width, (unsigned long long)sample, place, r->options->precision);
    die("%s: pixel (%zu, %zu), sample %llu, seed %llu%s: radiance (%g, %g, %g) is no radiance: a bug, please "
        "report it",
        r->options->scene, pixel % width, pixel / width, (unsigned long long)sample,
        (unsigned long long)r->options->seed, place, radiance[0], radiance[1], radiance[2]);
}

static double fraction_done(const Render *r, uint64_t samples, double of_next, double next)
{
    if (r->wanted)
        return ((double)samples + of_next * next) / (double)r->wanted;
    double passed = (seconds_now() - r->progress.started) / r->options->seconds;
    return passed < 0.99 ? passed : 0.99;
}

/* The next 2^level samples of every pixel. */
static void render_block(Render *r, uint64_t first, int level)
{
    size_t samples = (size_t)1 << level, at_once = samples < JOB_SAMPLES ? JOB_SAMPLES / samples : 1;
    size_t pixels = (size_t)r->film->width * (size_t)r->film->height;
    Layer layer = {level, first >> level, allocate(pixels, 6 * sizeof(double))};
    double *radiance = allocate((at_once < pixels ? at_once : pixels) * samples, 3 * sizeof(double));
    double(*nodes)[6] = allocate(samples, sizeof *nodes);
    for (size_t pixel = 0; pixel < pixels; pixel += at_once) {
        size_t count = pixels - pixel < at_once ? pixels - pixel : at_once;
        Job job = {r->options->seed, first, pixel, samples, count, radiance, NULL};
        r->kernel->render(r->prepared, &job, r->counters, r->options->generic);
        check_endless(r);
        for (size_t i = 0; i < count; i++) {
            int64_t bad = film_reduce(radiance + 3 * i * samples, level, nodes);
            memcpy(layer.pixels + 6 * (pixel + i), nodes[0], sizeof nodes[0]);
            if (bad < 0)
                continue;
            die_of(r, pixel + i, first + (uint64_t)bad, radiance + 3 * (i * samples + (size_t)bad));
        }
        double done = (double)(pixel + count) / (double)pixels;
        progress_show(&r->progress, ((double)film_samples(r->film) + done * (double)samples) * (double)pixels,
            fraction_done(r, film_samples(r->film), done, (double)samples));
    }
    free(nodes);
    free(radiance);
    film_add(r->film, layer);
}

/* Adds what the job's light paths gave to the pixels, path after path, in whatever order the lanes came. */
static void add_splats(const Splats *splats, size_t paths, double *radiance)
{
    size_t *next = allocate(paths + 1, sizeof *next);
    const Splat **sorted = allocate(splats->count, sizeof *sorted);
    for (size_t i = 0; i < splats->count; i++)
        next[splats->list[i].path + 1]++;
    for (size_t path = 0; path < paths; path++)
        next[path + 1] += next[path];
    for (size_t i = 0; i < splats->count; i++)
        sorted[next[splats->list[i].path]++] = &splats->list[i];
    for (size_t i = 0; i < splats->count; i++)
        for (int c = 0; c < 3; c++)
            radiance[3 * sorted[i]->pixel + (size_t)c] += sorted[i]->radiance[c];
    free(sorted);
    free(next);
}

/* L17 One more pass of light tracing: a light path and a camera ray for each pixel, the ray for the light that
   the eye sees itself (L12). What falls on a pixel in one pass is one sample of it. */
static void render_pass(Render *r, uint64_t sample)
{
    size_t pixels = (size_t)r->film->width * (size_t)r->film->height;
    Layer layer = {0, sample, allocate(pixels, 6 * sizeof(double))};
    double *radiance = allocate(pixels, 3 * sizeof *radiance);
    for (size_t pixel = 0; pixel < pixels; pixel += JOB_SAMPLES) {
        size_t count = pixels - pixel < JOB_SAMPLES ? pixels - pixel : JOB_SAMPLES;
        Job job = {r->options->seed, sample, pixel, 1, count, radiance + 3 * pixel, NULL};
        r->kernel->render(r->prepared, &job, r->counters, r->options->generic);
        check_endless(r);
    }
    Splats splats = {NULL, 0, 0};
    for (size_t pixel = 0; pixel < pixels; pixel += JOB_SAMPLES) {
        size_t count = pixels - pixel < JOB_SAMPLES ? pixels - pixel : JOB_SAMPLES;
        Job job = {r->options->seed, sample, pixel, 1, count, NULL, &splats};
        splats.count = 0;
        r->kernel->render(r->prepared, &job, r->counters, r->options->generic);
        check_endless(r);
        add_splats(&splats, count, radiance);
    }
    free(splats.list);
    for (size_t pixel = 0; pixel < pixels; pixel++)
        if (film_reduce(radiance + 3 * pixel, 0, (double(*)[6])(layer.pixels + 6 * pixel)) >= 0)
            die_of(r, pixel, sample, radiance + 3 * pixel);
    free(radiance);
    film_add(r->film, layer);
    progress_show(&r->progress, (double)film_samples(r->film) * (double)pixels,
        fraction_done(r, film_samples(r->film), 0, 0));
}

/* How many more samples the time allows, by the pace so far; at least one altogether. */
static uint64_t samples_in_time(const Render *r, uint64_t done)
{
    if (done == 0)
        return 1;
    double elapsed = seconds_now() - r->progress.started;
    double more = (r->options->seconds - elapsed) / (elapsed / (double)done);
    if (more < 1)
        return 0;
    return more < (double)done ? (uint64_t)more : done;
}

void render(const Options *options, const Description *scene, const Kernel *kernel, const void *prepared,
    Film *film, Counters *counters)
{
    Render r = {options, scene, kernel, prepared, counters, film, 0, {0}};
    if (options->seconds <= 0)
        r.wanted = options->sample_count ? options->sample_count
                   : options->spp        ? options->spp
                                         : (uint64_t)scene->sample_count;
    r.progress.shown = !options->quiet && isatty(STDERR_FILENO);
    r.progress.started = seconds_now();
    counters->endless = counters->unreachable = -1;
    for (uint64_t done = 0;; done = film_samples(film)) {
        uint64_t left = r.wanted ? r.wanted - done : samples_in_time(&r, done);
        if (left == 0)
            break;
        uint64_t first = options->first_sample + done;
        if (options->technique.estimator == ESTIMATOR_LIGHT)
            render_pass(&r, first);
        else
            render_block(&r, first, film_block_level(first, left));
    }
    if (!r.wanted)
        progress_show(&r.progress, (double)film_samples(film) * film->width * film->height, 1);
}
