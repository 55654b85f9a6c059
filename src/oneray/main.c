/* oneray: a path tracer that has every technique of the lecture "Probability Theory", each selectable. */
#include "darkness.h"
#include "film/film.h"
#include "film/output.h"
#include "film/picture.h"
#include "stats.h"
#include "message.h"
#include "options.h"
#include "render.h"
#include "scene/precision.h"
#include "scene/stacks.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void merge(const Options *options)
{
    Film film = {0};
    output_check(options->output, options->parts, options->part_count);
    for (int i = 0; i < options->part_count; i++) {
        Film part = film_read(options->parts[i]);
        film_collect(&film, &part, options->parts[i]);
    }
    film_close(&film);
    if (film_is_black(&film))
        warn("%s: the picture is black: rendering its scene in one run says why", options->output);
    picture_write(&film, -1, "merged", options->exposure, options->output);
    film_free(&film);
}

/* What makes two films parts of one picture: everything that the bits depend on. */
static void identify(Film *film, const Options *options, const Description *scene)
{
    char technique[512];
    options_technique(&options->technique, technique, sizeof technique);
    snprintf(film->identity, sizeof film->identity, "scene %016" PRIx64 " %s --precision %s --seed %" PRIu64,
        scene->hash, technique, options->precision, options->seed);
}

/* Every output can be written, and is nothing that is read or written already. */
static void check_outputs(const Options *options, const Description *scene)
{
    char **inputs = allocate((size_t)scene->file_count + 1, sizeof *inputs);
    inputs[0] = (char *)options->scene;
    for (int i = 0; i < scene->file_count; i++)
        inputs[i + 1] = scene->files[i];
    const char *const outputs[] = {options->output, options->png, options->film, options->checkpoint,
        options->stats && strcmp(options->stats, "-") ? options->stats : NULL};
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < i; k++)
            if (outputs[i] && outputs[k] && !strcmp(outputs[i], outputs[k]))
                die("%s: is given for two outputs", outputs[i]);
        if (outputs[i])
            output_check(outputs[i], inputs, scene->file_count + 1);
    }
    free(inputs);
}

static Window window_of(const Options *options, const Frame *frame)
{
    const uint64_t whole[4] = {0, 0, (uint64_t)frame->width, (uint64_t)frame->height};
    const uint64_t *crop = options->crop[2] ? options->crop : whole;
    return (Window){frame->width, frame->height, (int)crop[0], (int)crop[1], (int)crop[2], (int)crop[3]};
}

/* Writes what there is, and says if that is not what was asked for. */
static void write_outputs(const Render *r)
{
    const Options *o = r->options;
    uint64_t samples = film_samples(&r->film);
    const char *to = o->output ? o->output : o->png ? o->png : o->film ? o->film : "the figures";
    char wanted[32] = ""; /* of a render that time or error ends nobody knows it */
    if (r->wanted != MOST_SAMPLES)
        snprintf(wanted, sizeof wanted, " of %" PRIu64, r->wanted);
    if (interrupted())
        warn("interrupted: %s: %" PRIu64 "%s samples per pixel%s", to, samples, wanted,
            samples ? "" : ", nothing is written");
    if (samples && !o->film)
        say_why_black(r);
    const char *pictures[] = {o->output, o->png};
    for (int i = 0; i < 2; i++)
        if (samples && pictures[i])
            picture_write(&r->film, seconds_now() - r->started, instance_name(r), o->exposure, pictures[i]);
    if (samples && o->show)
        picture_show(&r->film, o->exposure);
    if (samples && o->film && !film_write(&r->film, o->film))
        output_failed(o->film, NULL);
}

static void render_scene(Options *options)
{
    Seconds seconds = {0};
    double start = seconds_now();
    Description *scene = description_read(
        options->scene, options->parameters, options->parameter_count, options->sensor, options->size);
    options_check(options, scene);
    if (options->check) {
        int warnings = warnings_given();
        printf("%s: no errors, %d warning%s\n", options->scene, warnings, warnings == 1 ? "" : "s");
        description_free(scene);
        return;
    }
    check_outputs(options, scene);
    seconds.load = seconds_now() - start;

    start = seconds_now();
    if (!strcmp(options->precision, "auto"))
        options->precision =
            precision_for(scene, options->precision_reason, (int)sizeof options->precision_reason);
    else if (!strcmp(options->precision, "single"))
        refuse_beyond_single(scene, options->scene);
    Render r = {.options = options, .scene = scene, .kernel = options_kernel(options)};
    find_stacks(scene, options->scene, r.kernel->rounding);
    r.prepared = r.kernel->prepare(scene, &options->technique);
    seconds.build = seconds_now() - start;

    r.film.window = window_of(options, &scene->sensor.frame);
    identify(&r.film, options, scene);
    start = seconds_now();
    render_image(&r);
    seconds.render = seconds_now() - start;

    start = seconds_now();
    write_outputs(&r);
    seconds.write = seconds_now() - start;
    if (options->stats)
        stats_write(options, &r, &seconds);
    film_free(&r.film);
    r.kernel->release(r.prepared);
    description_free(scene);
}

int main(int count, char **words)
{
    called_with(words);
    Options options = options_read(count, words);
    if (options.part_count)
        merge(&options);
    else
        render_scene(&options);
    options_free(&options);
    if (interrupted())
        die_interrupted();
    return 0;
}
