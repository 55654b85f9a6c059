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
    const Kernel *kernel;
    const void *prepared;
    Counters *counters;
    Film *film;
    uint64_t wanted; /* samples per pixel; 0: as many as the time allows */
    Progress progress;
} Render;

static void check_endless(const Render *r)
{
    if (r->counters->endless >= 0)
        die("%s: pixel (%lld, %lld): a path did not end within 1000000 vertices: the scene is closed and "
            "absorbs "
            "nothing; give it a max_depth",
            r->options->scene, (long long)(r->counters->endless % r->film->width),
            (long long)(r->counters->endless / r->film->width));
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
        Job job = {r->options->seed, first, pixel, samples, count, radiance};
        r->kernel->render(r->prepared, &job, r->counters, r->options->generic);
        check_endless(r);
        for (size_t i = 0; i < count; i++) {
            int64_t bad = film_reduce(radiance + 3 * i * samples, level, nodes);
            memcpy(layer.pixels + 6 * (pixel + i), nodes[0], sizeof nodes[0]);
            if (bad < 0)
                continue;
            const double *sample = radiance + 3 * (i * samples + (size_t)bad);
            if (sample[0] > DBL_MAX || sample[1] > DBL_MAX || sample[2] > DBL_MAX)
                die("%s: pixel (%zu, %zu): radiance overflows %s precision", r->options->scene,
                    (pixel + i) % (size_t)r->film->width, (pixel + i) / (size_t)r->film->width,
                    r->options->precision);
            die("%s: pixel (%zu, %zu), sample %llu, seed %llu: radiance (%g, %g, %g) is no radiance: a bug, "
                "please "
                "report it",
                r->options->scene, (pixel + i) % (size_t)r->film->width, (pixel + i) / (size_t)r->film->width,
                (unsigned long long)first + (unsigned long long)bad, (unsigned long long)r->options->seed,
                sample[0], sample[1], sample[2]);
        }
        double done = (double)(pixel + count) / (double)pixels;
        progress_show(&r->progress, ((double)film_samples(r->film) + done * (double)samples) * (double)pixels,
            fraction_done(r, film_samples(r->film), done, (double)samples));
    }
    free(nodes);
    free(radiance);
    film_add(r->film, layer);
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
    Render r = {options, kernel, prepared, counters, film, 0, {0}};
    if (options->seconds <= 0)
        r.wanted = options->sample_count ? options->sample_count
                   : options->spp        ? options->spp
                                         : (uint64_t)scene->sample_count;
    r.progress.shown = !options->quiet && isatty(STDERR_FILENO);
    r.progress.started = seconds_now();
    counters->endless = -1;
    for (uint64_t done = 0;; done = film_samples(film)) {
        uint64_t left = r.wanted ? r.wanted - done : samples_in_time(&r, done);
        if (left == 0)
            break;
        uint64_t first = options->first_sample + done;
        render_block(&r, first, film_block_level(first, left));
    }
    if (!r.wanted)
        progress_show(&r.progress, (double)film_samples(film) * film->width * film->height, 1);
}
