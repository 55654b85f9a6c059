#include "render.h"

#include "film/output.h"
#include "message.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum {
    JOB_SAMPLES = 8192, /* handed to a kernel at once: enough that emptying its lanes costs little */
    FIRST_PATHS = 1 << 18, /* of the first block of an unhurried render: a tenth of a second or so */
    FIRST_LOOK = 16,       /* samples per pixel from which on an error is believed */
    BLACK_SAMPLES = 1024   /* and an image is black */
};
#define RADIUS_OF_SCENE 0.01 /* T2 over half of its diagonal */
#define FAR_KNOWN_AFTER 2.0 /* seconds, after which it is said that an error is further away than … */
#define FAR_HOURS 0.25

double seconds_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Samples per pixel of this run. */
static uint64_t done_here(const Render *r) { return film_samples(&r->film) - r->resumed; }

/* How much of the render is done, `samples` more per pixel than the film has: by the budget that is nearest.
   The error falls with the root of the samples. */
static double fraction_done(const Render *r, double samples)
{
    double all = (double)film_samples(&r->film) + samples, fraction = all / (double)r->wanted;
    if (r->options->seconds > 0)
        fraction = fmax(fraction, (seconds_now() - r->started) / r->options->seconds);
    if (r->options->error > 0 && r->progress.error > 0)
        fraction = fmax(fraction, pow(r->options->error / r->progress.error, 2));
    return fmin(fraction, 1);
}

static void show_progress(Render *r, double samples, bool last)
{
    Progress *p = &r->progress;
    double now = seconds_now(), elapsed = now - r->started, fraction = fraction_done(r, samples);
    if (!p->shown || (now - p->last < 0.25 && !last))
        return;
    p->last = now;
    if (now - p->last_error > 1 && film_has_error(&r->film)) {
        p->error = film_relative_error(&r->film);
        p->last_error = seconds_now();
    }
    double here = (double)done_here(r) + samples, before = (double)r->resumed / (double)r->wanted;
    fprintf(stderr, "\r%3.0f %%  %.3g samples/s", 100 * fraction,
        here * (double)film_pixels(&r->film) / (elapsed + 1e-9));
    if (p->error > 0 && p->error < HUGE_VAL)
        fprintf(stderr, "  error %.3g %%", 100 * p->error);
    if (fraction > before && !last)
        fprintf(stderr, "  %.0f s left", elapsed / (fraction - before) * (1 - fraction));
    fputs(last ? "              \n" : "   ", stderr);
}

static void check_endless(const Render *r)
{
    int width = r->film.window.image_width;
    if (r->counters.unreachable >= 0)
        die("%s: pixel (%lld, %lld) shows a mirror or glass: no light path can be joined to the eye there; "
            "--estimator light wants such surfaces out of view",
            r->options->scene, (long long)(r->counters.unreachable % width),
            (long long)(r->counters.unreachable / width));
    if (r->counters.endless >= PHOTON_PATHS)
        die("%s: light path %lld did not end within %d vertices: the scene is closed and absorbs nothing; give it a "
            "max_depth",
            r->options->scene, (long long)(r->counters.endless - PHOTON_PATHS), PATH_LIMIT);
    if (r->counters.endless >= 0)
        die("%s: pixel (%lld, %lld): a path did not end within %d vertices: the scene is closed and absorbs "
            "nothing; give it a max_depth",
            r->options->scene, (long long)(r->counters.endless % width),
            (long long)(r->counters.endless / width), PATH_LIMIT);
}

/* The vertex, the first surface being 1 and a light's point the last, with which the sample stops being a radiance:
   the same path again, cut at 1, 2, 4, … vertices and then between. 0 if it never does. */
static int bad_vertex(const Render *r, size_t pixel, uint64_t sample)
{
    int good = 0, bad = 0;
    for (int next = 1; bad != good + 1 && next <= PATH_LIMIT; next = bad ? (good + bad) / 2 : 2 * next) {
        Description cut = *r->scene;
        double radiance[3], node[1][6];
        Counters counters = {0, 0, -1, -1};
        cut.max_depth = next;
        void *prepared = r->kernel->prepare(&cut, &r->options->technique);
        Job job = {r->options->seed, sample, pixel, 1, 1, radiance, NULL, NULL, NULL};
        r->kernel->render(prepared, &job, &counters, 1);
        r->kernel->release(prepared);
        *(film_reduce(radiance, 0, node) < 0 ? &good : &bad) = next;
        if (good >= r->scene->max_depth && r->scene->max_depth > 0 && !bad)
            return 0;
    }
    return bad;
}

/* Ends the program over a sample that is no radiance. */
NORETURN static void die_of(const Render *r, size_t pixel, uint64_t sample, const double radiance[3])
{
    size_t width = (size_t)r->film.window.image_width;
    char place[96] = "";
    int vertex = r->options->technique.estimator >= ESTIMATOR_LIGHT ? 0 : bad_vertex(r, pixel, sample);
    if (vertex)
        snprintf(place, sizeof place, ", vertex %d", vertex);
    for (int c = 0; c < 3; c++)
        if (radiance[c] > DBL_MAX)
            die("%s: pixel (%zu, %zu), sample %llu%s: radiance overflows %s precision", r->options->scene,
                pixel % width, pixel / width, (unsigned long long)sample, place, r->options->precision);
    bug("%s: pixel (%zu, %zu), sample %llu of %llu, seed %llu%s: radiance (%g, %g, %g) is no radiance",
        r->options->scene, pixel % width, pixel / width, (unsigned long long)sample,
        (unsigned long long)r->wanted, (unsigned long long)r->options->seed, place, radiance[0], radiance[1],
        radiance[2]);
}

/* Where the window's pixel is in the image, in reading order; *count, of pixels from it on, is cut to as many
   as follow it there. */
static size_t place_in_image(const Window *w, size_t pixel, size_t *count)
{
    size_t width = (size_t)w->width, x = pixel % width, y = pixel / width;
    if (w->width != w->image_width && *count > width - x)
        *count = width - x;
    return ((size_t)w->y + y) * (size_t)w->image_width + (size_t)w->x + x;
}

static bool generic(const Render *r) { return !strcmp(r->options->kernel, "generic"); }

static void run(Render *r, Job job)
{
    job.seed = r->options->seed;
    r->kernel->render(r->prepared, &job, &r->counters, generic(r));
    check_endless(r);
}

/* The next 2^level samples of every pixel; nothing if interrupted. */
static void render_block(Render *r, uint64_t first, int level)
{
    size_t samples = (size_t)1 << level, at_once = samples < JOB_SAMPLES ? JOB_SAMPLES / samples : 1;
    size_t pixels = film_pixels(&r->film);
    Layer layer = {level, first >> level, allocate(pixels, 6 * sizeof(double))};
    double *radiance = allocate((at_once < pixels ? at_once : pixels) * samples, 3 * sizeof(double));
    double (*nodes)[6] = allocate(samples, sizeof *nodes);
    for (size_t pixel = 0, count; pixel < pixels && !interrupted(); pixel += count) {
        count = pixels - pixel < at_once ? pixels - pixel : at_once;
        size_t place = place_in_image(&r->film.window, pixel, &count);
        run(r, (Job){0, first, place, samples, count, radiance, NULL, NULL, NULL});
        for (size_t i = 0; i < count; i++) {
            int64_t bad = film_reduce(radiance + 3 * i * samples, level, nodes);
            memcpy(layer.pixels + 6 * (pixel + i), nodes[0], sizeof nodes[0]);
            if (bad < 0)
                continue;
            die_of(r, place + i, first + (uint64_t)bad, radiance + 3 * (i * samples + (size_t)bad));
        }
        show_progress(r, (double)(pixel + count) / (double)pixels * (double)samples, false);
    }
    free(nodes);
    free(radiance);
    if (interrupted())
        free(layer.pixels);
    else
        film_add(&r->film, layer);
}

/* P6 Of each pixel around a splat the share of its filter there, m⁻² of the film's pixels. */
static void add_filtered(const Splat *splat, const Sensor *sensor, double *radiance)
{
    const Filter *filter = &sensor->filter;
    const int size[2] = {sensor->frame.width, sensor->frame.height};
    int low[2], high[2];
    for (int axis = 0; axis < 2; axis++) {
        low[axis] = (int)fmax(0, ceil(splat->at[axis] - filter->radius - .5));
        high[axis] = (int)fmin(size[axis] - 1, floor(splat->at[axis] + filter->radius - .5));
    }
    for (int y = low[1]; y <= high[1]; y++)
        for (int x = low[0]; x <= high[0]; x++) {
            const int pixel[2] = {x, y};
            double share = 1, cut[2];
            for (int axis = 0; axis < 2; axis++) {
                filter_cut(filter, pixel[axis], size[axis], sensor->frame.border, cut);
                share *= filter_weight(filter, splat->at[axis] - pixel[axis] - .5) / (filter->integral * cut[1]);
            }
            for (int c = 0; c < 3; c++)
                radiance[3 * ((size_t)y * (size_t)size[0] + (size_t)x) + (size_t)c] += share * splat->radiance[c];
        }
}

/* Adds what the job's light paths gave to the pixels, path after path, in whatever order the lanes came. */
static void gather_splats(const Splats *splats, size_t paths, const Sensor *sensor, double *radiance)
{
    bool filtered = !filter_is_pixel(&sensor->filter);
    size_t *next = allocate(paths + 1, sizeof *next);
    const Splat **sorted = allocate(splats->count, sizeof *sorted);
    for (size_t i = 0; i < splats->count; i++)
        next[splats->list[i].path + 1]++;
    for (size_t path = 0; path < paths; path++)
        next[path + 1] += next[path];
    for (size_t i = 0; i < splats->count; i++)
        sorted[next[splats->list[i].path]++] = &splats->list[i];
    for (size_t i = 0; i < splats->count && filtered; i++)
        add_filtered(sorted[i], sensor, radiance);
    for (size_t i = 0; i < splats->count && !filtered; i++)
        for (int c = 0; c < 3; c++)
            radiance[3 * sorted[i]->pixel + (size_t)c] += sorted[i]->radiance[c];
    free(sorted);
    free(next);
}

/* T2 m. */
static double first_radius(const Render *r)
{
    double low[3], high[3], square = 0;
    if (r->options->technique.radius > 0)
        return r->options->technique.radius;
    scene_bounds(r->scene, low, high);
    for (int axis = 0; axis < 3; axis++)
        square += (high[axis] - low[axis]) * (high[axis] - low[axis]) / 4;
    return RADIUS_OF_SCENE * sqrt(square);
}

/* T2 The photons of a pass. Its light paths are those of the whole image, whatever the window. */
static PhotonMap trace_photons(Render *r, uint64_t sample)
{
    const Window *w = &r->film.window;
    uint64_t paths = r->options->technique.photons;
    Photons photons = {NULL, 0, 0};
    if (!paths)
        paths = (uint64_t)w->image_width * (uint64_t)w->image_height;
    for (uint64_t path = 0; path < paths && !interrupted(); path += JOB_SAMPLES) {
        size_t count = paths - path < JOB_SAMPLES ? (size_t)(paths - path) : JOB_SAMPLES,
               before = photons.count;
        run(r, (Job){0, sample, PHOTON_PATHS + path, 1, count, NULL, NULL, &photons, NULL});
        photons_in_order(&photons, before, count);
    }
    PhotonMap map = photon_map(&photons, paths, photon_radius(first_radius(r), sample + 1));
    free(photons.list);
    return map;
}

/* L17 One more pass of light tracing: a light path and a camera ray for each pixel, the ray for the light that
   the eye sees itself (L12). What falls on a pixel in one pass is one sample of it. Light paths are those of the
   whole image, whatever the window. T1 of bidirectional paths too, which are both at once. */
static void render_pass(Render *r, uint64_t sample)
{
    const Window *w = &r->film.window;
    size_t pixels = film_pixels(&r->film), all = (size_t)w->image_width * (size_t)w->image_height;
    Layer layer = {0, sample, allocate(pixels, 6 * sizeof(double))};
    bool pairs = r->options->technique.estimator == ESTIMATOR_BIDIRECTIONAL;
    bool gathers = r->options->technique.estimator == ESTIMATOR_PHOTONS;
    PhotonMap map = {0};
    if (gathers)
        map = trace_photons(r, sample);
    double *radiance = allocate(all, 3 * sizeof *radiance), *own = allocate(pairs ? all : 0, 3 * sizeof *own);
    for (size_t pixel = 0, count; pixel < pixels && !pairs && !interrupted(); pixel += count) {
        count = pixels - pixel < JOB_SAMPLES ? pixels - pixel : JOB_SAMPLES;
        size_t place = place_in_image(w, pixel, &count);
        run(r, (Job){0, sample, place, 1, count, radiance + 3 * place, NULL, NULL, &map});
    }
    photon_map_free(&map);
    Splats splats = {NULL, 0, 0};
    for (size_t pixel = 0; pixel < all && !gathers && !interrupted(); pixel += JOB_SAMPLES) {
        size_t count = all - pixel < JOB_SAMPLES ? all - pixel : JOB_SAMPLES;
        splats.count = 0;
        run(r, (Job){0, sample, pixel, 1, count, pairs ? own + 3 * pixel : NULL, &splats, NULL, NULL});
        gather_splats(&splats, count, &r->scene->sensor, radiance);
    }
    free(splats.list);
    for (size_t i = 0; i < 3 * all && pairs; i++)
        radiance[i] += own[i];
    free(own);
    for (size_t pixel = 0, count = 1; pixel < pixels; pixel++) {
        size_t place = place_in_image(w, pixel, &count);
        if (film_reduce(radiance + 3 * place, 0, (double (*)[6])(layer.pixels + 6 * pixel)) >= 0)
            die_of(r, place, sample, radiance + 3 * place);
    }
    free(radiance);
    if (interrupted())
        free(layer.pixels);
    else
        film_add(&r->film, layer);
    show_progress(r, 0, false);
}

/* How many more samples that takes, by the pace of this run. */
static double samples_in(const Render *r, double seconds)
{
    return seconds * (double)done_here(r) / (seconds_now() - r->started + 1e-9);
}

/* The numbers of samples at which the error is looked at, whatever the run began with: 16, 18, … by eighths of
   a power of two. The one that follows `done`. */
static uint64_t next_look(uint64_t done)
{
    uint64_t step = 2;
    if (done < FIRST_LOOK)
        return FIRST_LOOK;
    while (done / step >= 16)
        step *= 2;
    return (done / step + 1) * step;
}

/* Says once that an error is far away which nothing else bounds: its square falls with the samples. */
static void say_how_far(Render *r, uint64_t done)
{
    const Options *o = r->options;
    double elapsed = seconds_now() - r->started, times = pow(r->progress.error / o->error, 2);
    double hours = elapsed / (double)done_here(r) * (double)done * (times - 1) / 3600;
    if (r->progress.told || elapsed < FAR_KNOWN_AFTER || !(hours > FAR_HOURS) || !isfinite(hours) || o->spp
        || o->seconds > 0)
        return;
    r->progress.told = true;
    if (r->progress.shown)
        fputc('\n', stderr);
    warn("--error %g takes about %.2g hours more (the error is %.2g now); --time SECONDS ends it earlier, and so does "
         "Ctrl-C",
        o->error, hours, r->progress.error);
}

static bool error_reached(Render *r, uint64_t done)
{
    if (done < FIRST_LOOK || next_look(done - 1) != done)
        return false;
    r->progress.error = film_relative_error(&r->film);
    say_how_far(r, done);
    return r->progress.error <= r->options->error || (r->progress.error == HUGE_VAL && done >= BLACK_SAMPLES);
}

/* Says how much more it takes where another budget ended the render before the error was reached. */
static void say_what_is_missing(const Render *r)
{
    const Options *o = r->options;
    double error = film_has_error(&r->film) ? film_relative_error(&r->film) : HUGE_VAL;
    double times = o->error > 0 ? pow(error / o->error, 2) : 0;
    if (!(times > 1) || interrupted() || (error == HUGE_VAL && film_has_error(&r->film)))
        return;
    const char *budget = strcmp(r->ended_by, "time") ? "--spp" : "--time";
    double samples = (double)film_samples(&r->film);
    if (error == HUGE_VAL)
        warn("%s ended with one sample per pixel, whose error is not known: --error %g wants more", budget, o->error);
    else
        warn("%s ended with %.0f samples per pixel and an error of %.2g: --error %g takes about %.3g", budget, samples,
            error, o->error, samples * times);
}

/* How many samples per pixel may come next; 0 at the end, and ended_by says why. */
static uint64_t samples_left(Render *r)
{
    const Options *o = r->options;
    uint64_t done = film_samples(&r->film), left = r->wanted - done;
    r->ended_by = "samples";
    if (o->error > 0) {
        if (error_reached(r, done)) {
            r->ended_by = "error";
            return 0;
        }
        left = next_look(done) - done < left ? next_look(done) - done : left;
    }
    if (o->seconds > 0 && done > 0 && left > 0) {
        double in_time = done_here(r) ? samples_in(r, o->seconds - (seconds_now() - r->started)) : 1;
        if (in_time < 1) {
            r->ended_by = "time";
            return 0;
        }
        left = in_time < (double)left ? (uint64_t)in_time : left;
    }
    return left;
}

/* The level of the next block. The first is small, each following one at most as large as all before it in
   this run, so that the pace is known; none takes longer than is bearable to lose: 2 s or an eighth of the time
   so far, a quarter of the time between checkpoints. */
static int next_level(const Render *r, uint64_t first, uint64_t left)
{
    double elapsed = seconds_now() - r->started, bearable = fmax(2, elapsed / 8), most = 1;
    if (r->options->checkpoint)
        bearable = fmin(bearable, r->options->checkpoint_seconds / 4);
    if (done_here(r))
        most = fmin((double)done_here(r), samples_in(r, bearable));
    if (!r->options->checkpoint && r->options->seconds <= 0)
        most = fmax(most, (double)FIRST_PATHS / (double)film_pixels(&r->film));
    int level = film_block_level(first, left);
    while (level > 0 && (double)((uint64_t)1 << level) > most)
        level--;
    return level;
}

static void save(Render *r)
{
    if (!r->options->checkpoint || !film_samples(&r->film))
        return;
    r->saved = seconds_now();
    if (!film_write(&r->film, r->options->checkpoint))
        warn("%s: cannot be written: %s; the render goes on", r->options->checkpoint, output_reason(NULL));
}

/* Takes over the checkpoint's samples, if there is one. */
static void resume(Render *r)
{
    const Options *o = r->options;
    if (!o->resume || access(o->checkpoint, F_OK))
        return;
    Film film = film_read(o->checkpoint);
    film_collect(&r->film, &film, o->checkpoint);
    r->resumed = film_samples(&r->film);
    if (film_first(&r->film) != o->first_sample || r->resumed > r->wanted)
        die("%s: has the samples %llu to %llu, and %llu to %llu are wanted", o->checkpoint,
            (unsigned long long)film_first(&r->film),
            (unsigned long long)(film_first(&r->film) + r->resumed - 1), (unsigned long long)o->first_sample,
            (unsigned long long)(o->first_sample + r->wanted - 1));
}

const char *instance_name(const Render *r)
{
    return generic(r) ? "generic" : r->kernel->instance(r->prepared);
}

void render_image(Render *r)
{
    const Options *o = r->options;
    r->wanted = o->seconds > 0 || o->error > 0 ? MOST_SAMPLES : (uint64_t)r->scene->sample_count;
    if (o->spp || o->sample_count)
        r->wanted = o->spp ? o->spp : o->sample_count;
    r->counters.endless = r->counters.unreachable = -1;
    resume(r);
    heed_interrupt();
    r->progress.shown = !o->quiet && isatty(STDERR_FILENO);
    r->started = r->saved = seconds_now();
    for (uint64_t left; !interrupted() && (left = samples_left(r)) > 0;) {
        uint64_t first = o->first_sample + film_samples(&r->film);
        if (o->technique.estimator >= ESTIMATOR_LIGHT)
            render_pass(r, first);
        else
            render_block(r, first, next_level(r, first, left));
        if (o->checkpoint && seconds_now() - r->saved > o->checkpoint_seconds / 2 && !interrupted())
            save(r);
    }
    if (interrupted())
        r->ended_by = "interrupt";
    save(r);
    show_progress(r, 0, true);
    say_what_is_missing(r);
}
