#include "darkness.h"

#include "message.h"

#include <stdlib.h>
#include <string.h>

enum { PROBES = 4096, PROBE_SAMPLES = 64, DEEP = 32 };

/* The scene with its shapes and lights as copies, which may be changed. */
static Description copy_of(const Description *scene)
{
    Description copy = *scene;
    copy.shapes = allocate((size_t)copy.shape_count, sizeof *copy.shapes);
    copy.emitters = allocate((size_t)copy.emitter_count + 1, sizeof *copy.emitters);
    for (int i = 0; i < copy.shape_count; i++)
        copy.shapes[i] = scene->shapes[i];
    for (int i = 0; i < copy.emitter_count; i++)
        copy.emitters[i] = scene->emitters[i];
    return copy;
}

/* A sky alone: what is black before it is in view. */
static void sky_alone(Description *d)
{
    for (int i = 0; i < d->shape_count; i++)
        d->shapes[i].front = d->shapes[i].back = d->shapes[i].emitter = -1;
    d->passing = false;
    d->emitters[0] = (Emitter){.kind = EMITTER_CONSTANT, .shape = -1, .as.constant = {{1, 1, 1}}};
    d->emitter_count = d->max_depth = 1;
    d->hide_emitters = false;
}

static void change_nothing(Description *d) { (void)d; }

static void show_emitters(Description *d) { d->hide_emitters = false; }

static void make_two_sided(Description *d)
{
    for (int i = 0; i < d->shape_count; i++) {
        Shape *shape = &d->shapes[i];
        if (shape->front == MATERIAL_NONE)
            shape->front = shape->back;
        if (shape->back == MATERIAL_NONE)
            shape->back = shape->front;
    }
}

/* Those of triangles shine to the side of their corners' order, which stays. */
static void turn_lamps(Description *d)
{
    for (int i = 0; i < d->shape_count; i++)
        if (d->shapes[i].emitter >= 0)
            d->shapes[i].as.placed.flip_normals = !d->shapes[i].as.placed.flip_normals;
}

static void make_deep(Description *d) { d->max_depth = DEEP; }

/* How many of the samples, spread over the window, are not black. */
static size_t count_lit(const Render *r, Description *changed, size_t *count)
{
    Technique technique = r->options->technique;
    size_t pixels = film_pixels(&r->film), probes = pixels < PROBES ? pixels : PROBES, lit = 0;
    double radiance[3 * PROBE_SAMPLES];
    Counters counters = {0, 0, -1, -1};
    if (technique.estimator >= ESTIMATOR_LIGHT)
        technique.estimator = ESTIMATOR_MIS;
    void *prepared = r->kernel->prepare(changed, &technique);
    const Window *w = &r->film.window;
    for (size_t i = 0; i < probes; i++) {
        size_t pixel = i * pixels / probes, width = (size_t)w->width;
        size_t place = ((size_t)w->y + pixel / width) * (size_t)w->image_width + (size_t)w->x + pixel % width;
        Job job = {r->options->seed, 0, place, PROBE_SAMPLES, 1, radiance, NULL, NULL, NULL};
        r->kernel->render(prepared, &job, &counters, 1);
        for (size_t k = 0; k < PROBE_SAMPLES; k++)
            lit += radiance[3 * k] > 0 || radiance[3 * k + 1] > 0 || radiance[3 * k + 2] > 0;
    }
    r->kernel->release(prepared);
    *count = probes * PROBE_SAMPLES;
    return lit;
}

/* Does a change bring light? To all samples, or to any. */
static bool brings_light(const Render *r, void (*change)(Description *), bool all)
{
    Description changed = copy_of(r->scene);
    size_t count;
    change(&changed);
    size_t lit = count_lit(r, &changed, &count);
    free(changed.shapes);
    free(changed.emitters);
    return all ? lit == count : lit > 0;
}

static const char *why_black(const Render *r)
{
    static const struct {
        void (*change)(Description *);
        const char *why;
    } guesses[] = {
        {change_nothing, "light comes to it too rarely: take more samples, or another --estimator"},
        {show_emitters, "the lights alone would be seen, and hide_emitters hides them"},
        {make_two_sided, "what is seen, or lit, shows its back, which is black: put its bsdf into "
                         "<bsdf type=\"twosided\">, or set flip_normals"},
        {turn_lamps, "the lamps shine to their other side: set their flip_normals"},
        {make_deep, "no path is long enough for light: give it a larger max_depth"},
    };
    if (brings_light(r, sky_alone, true))
        return "nothing is in view: see the sensor's to_world, near_clip and far_clip";
    for (size_t i = 0; i < sizeof guesses / sizeof *guesses; i++)
        if (brings_light(r, guesses[i].change, false))
            return guesses[i].why;
    return "no light comes to what is seen: is something in its way? If not, take more samples";
}

void say_why_black(const Render *r)
{
    bool power = false;
    for (int i = 0; i < r->scene->emitter_count; i++)
        power = power || emitter_has_power(&r->scene->emitters[i]);
    if (r->scene->hinted || !power || !film_is_black(&r->film))
        return;
    warn("%s: the picture is black after %llu samples per pixel: %s", r->options->scene,
        (unsigned long long)film_samples(&r->film), why_black(r));
}
