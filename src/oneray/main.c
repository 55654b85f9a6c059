/* oneray: a path tracer that has every technique of the lecture "Probability Theory", each selectable. */
#include "exr.h"
#include "film.h"
#include "message.h"
#include "options.h"
#include "precision.h"
#include "output.h"
#include "render.h"
#include "version.h"

#include <float.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

static const char *const feature_words[] = {
#define X(name, words) words,
    FEATURES(X)
#undef X
};

typedef struct {
    double load, build, render, write;
} Seconds;

/* A text as a JSON string. */
static void json_text(FILE *stream, const char *text)
{
    fputc('"', stream);
    for (; *text; text++)
        if (*text == '"' || *text == '\\')
            fprintf(stream, "\\%c", *text);
        else if ((unsigned char)*text < 0x20)
            fprintf(stream, "\\u%04x", (unsigned)*text);
        else
            fputc(*text, stream);
    fputc('"', stream);
}

static void json_features(FILE *stream, const char *name, Features features)
{
    const char *comma = "";
    fprintf(stream, "  \"%s\": [", name);
    for (int i = 0; i < FEATURE_COUNT; i++)
        if (features >> i & 1) {
            fprintf(stream, "%s\"%s\"", comma, feature_words[i]);
            comma = ", ";
        }
    fprintf(stream, "],\n");
}

static void print_stats(FILE *stream, const Options *options, const Film *film, const Kernel *kernel,
    const void *prepared, const Counters *counters, const Seconds *seconds)
{
    char technique[512];
    struct rusage usage;
    options_technique(&options->technique, technique, sizeof technique);
    getrusage(RUSAGE_SELF, &usage);
    fprintf(stream, "{\n  \"version\": \"%s\",\n  \"scene\": ", ONERAY_VERSION);
    json_text(stream, options->scene);
    fprintf(stream, ",\n  \"kernel\": \"%s\",\n  \"precision\": \"%s\",\n  \"lanes\": %d,\n",
        options->generic ? "generic" : kernel->instance(prepared), kernel->precision, kernel->lanes);
    if (*options->precision_reason)
        fprintf(stream, "  \"precision_chosen_for\": \"%s\",\n", options->precision_reason);
    json_features(stream, "features", kernel->features(prepared));
    json_features(stream, "left_out", EVERY_FEATURE & ~kernel->features(prepared));
    fprintf(stream, "  \"technique\": \"%s\",\n  \"width\": %d,\n  \"height\": %d,\n", technique, film->width,
        film->height);
    uint64_t spp = film_samples(film), paths = spp * (uint64_t)film->width * (uint64_t)film->height;
    fprintf(stream, "  \"spp\": %" PRIu64 ",\n  \"seed\": %" PRIu64 ",\n  \"paths\": %" PRIu64 ",\n", spp,
        options->seed, paths);
    fprintf(stream, "  \"rays\": %" PRIu64 ",\n  \"shadow_rays\": %" PRIu64 ",\n", counters->rays,
        counters->shadow_rays);
    fprintf(stream, "  \"seconds\": {\"load\": %.6f, \"build\": %.6f, \"render\": %.6f, \"write\": %.6f},\n",
        seconds->load, seconds->build, seconds->render, seconds->write);
    fprintf(stream, "  \"peak_memory_bytes\": %lld\n}\n", (long long)usage.ru_maxrss * 1024);
}

static void write_stats(const Options *options, const Film *film, const Kernel *kernel, const void *prepared,
    const Counters *counters, const Seconds *seconds)
{
    if (!strcmp(options->stats, "-")) {
        print_stats(stdout, options, film, kernel, prepared, counters, seconds);
        if (fflush(stdout) || ferror(stdout))
            output_failed("standard output");
        return;
    }
    char temporary[OUTPUT_NAME];
    output_name(options->stats, temporary);
    FILE *stream = fopen(temporary, "w");
    if (!stream)
        output_failed(options->stats);
    print_stats(stream, options, film, kernel, prepared, counters, seconds);
    int bad = ferror(stream);
    if (fclose(stream) || bad)
        output_failed(options->stats);
    output_done(options->stats, temporary);
}

/* The spread of a pixel's samples says how far their mean may be off only where they are independent; Sobol'
   points balance each other, so that it takes other seeds to know. The identity names the sampler. */
static int has_error(const Film *film) { return !strstr(film->identity, " --sampler sobol "); }

static void write_picture(const Film *film, double render_seconds, const char *kernel, const char *file)
{
    size_t numbers = 3 * (size_t)film->width * (size_t)film->height;
    float *mean = allocate(numbers, sizeof *mean), *error = allocate(numbers, sizeof *error);
    int known = film_estimate(film, mean, error) && has_error(film);
    for (size_t i = 0; i < numbers; i++)
        if (!(mean[i] <= FLT_MAX) || (known && !(error[i] <= FLT_MAX)))
            die("%s: pixel (%zu, %zu): the radiance is beyond %g, the largest float of a picture", file,
                i / 3 % (size_t)film->width, i / 3 / (size_t)film->width, (double)FLT_MAX);
    Picture picture = {film->width, film->height, mean, known ? error : NULL, film_samples(film),
        render_seconds, film->identity, kernel};
    exr_write_picture(&picture, file);
    free(mean);
    free(error);
}

/* oneray merge PART.film … -o OUT.exr */
static int merge(int count, char **words)
{
    const char *output = NULL;
    Film film = {0};
    char **inputs = allocate((size_t)count, sizeof *inputs);
    int parts = 0;
    for (int i = 2; i < count; i++)
        if (!strcmp(words[i], "-o") && i + 1 < count && !output)
            output = words[++i];
        else if (!strcmp(words[i], "-o"))
            die("merge: one -o OUT.exr is wanted");
        else if (words[i][0] == '-')
            die("merge: %s is no option (oneray merge PART.film ... -o OUT.exr)", words[i]);
        else
            inputs[parts++] = words[i];
    if (!output)
        die("merge: -o OUT.exr is wanted");
    if (!parts)
        die("merge: no film is given (oneray merge PART.film ... -o OUT.exr)");
    output_check(output, inputs, parts);
    for (int i = 0; i < parts; i++) {
        Film part = film_read(inputs[i]);
        film_collect(&film, &part, inputs[i]);
    }
    free(inputs);
    film_close(&film);
    write_picture(&film, -1, "merged", output);
    film_free(&film);
    return 0;
}

/* What makes two films parts of one picture: everything that the bits depend on. */
static void identify(Film *film, const Options *options, const Description *scene)
{
    char technique[512];
    options_technique(&options->technique, technique, sizeof technique);
    snprintf(film->identity, sizeof film->identity, "scene %016" PRIx64 " %s --precision %s --seed %" PRIu64,
        scene->hash, technique, options->precision, options->seed);
}

static int render_scene(Options *options)
{
    Seconds seconds = {0};
    double start = seconds_now();
    Description *scene =
        description_read(options->scene, options->parameters, options->parameter_count);
    options_check(options, scene);
    char **inputs = allocate((size_t)scene->mesh_file_count + 1, sizeof *inputs);
    inputs[0] = (char *)options->scene;
    for (int i = 0; i < scene->mesh_file_count; i++)
        inputs[i + 1] = scene->mesh_files[i];
    const char *const outputs[] = {options->output, options->film,
        options->stats && strcmp(options->stats, "-") ? options->stats : NULL};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < i; k++)
            if (outputs[i] && outputs[k] && !strcmp(outputs[i], outputs[k]))
                die("%s: is given for two outputs", outputs[i]);
        if (outputs[i])
            output_check(outputs[i], inputs, scene->mesh_file_count + 1);
    }
    free(inputs);
    seconds.load = seconds_now() - start;

    start = seconds_now();
    if (!strcmp(options->precision, "auto"))
        options->precision =
            precision_for(scene, options->precision_reason, (int)sizeof options->precision_reason);
    else if (!strcmp(options->precision, "single"))
        refuse_beyond_single(scene, options->scene);
    const Kernel *kernel = options_kernel(options);
    void *prepared = kernel->prepare(scene, &options->technique);
    seconds.build = seconds_now() - start;

    Film film = {.width = scene->sensor.width, .height = scene->sensor.height};
    Counters counters = {0};
    identify(&film, options, scene);
    start = seconds_now();
    render(options, scene, kernel, prepared, &film, &counters);
    seconds.render = seconds_now() - start;

    start = seconds_now();
    if (options->output)
        write_picture(&film, seconds.render, options->generic ? "generic" : kernel->instance(prepared),
            options->output);
    if (options->film)
        film_write(&film, options->film);
    seconds.write = seconds_now() - start;
    if (options->stats)
        write_stats(options, &film, kernel, prepared, &counters, &seconds);
    film_free(&film);
    kernel->release(prepared);
    description_free(scene);
    return 0;
}

int main(int count, char **words)
{
    if (count > 1 && !strcmp(words[1], "merge"))
        return merge(count, words);
    Options options = options_read(count, words);
    int status = render_scene(&options);
    for (int i = 0; i < options.parameter_count; i++)
        free((char *)options.parameters[i].name);
    return status;
}
