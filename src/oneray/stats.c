#include "stats.h"

#include "film/output.h"
#include "version.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>

static const char *const has_words[] = {
#define X(NAME, name, words) words,
    KINDS(X)};
static const char *const use_words[] = {USES(X)};
#undef X

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

/* Words of the bits of a mask; returns what stands before the next one. */
static const char *json_words(
    FILE *stream, const char *comma, uint64_t bits, const char *const words[], int count)
{
    for (int i = 0; i < count; i++)
        if (bits >> i & 1) {
            fprintf(stream, "%s\"%s\"", comma, words[i]);
            comma = ", ";
        }
    return comma;
}

static void json_features(FILE *stream, const char *name, Features f)
{
    fprintf(stream, "  \"%s\": [", name);
    json_words(stream, json_words(stream, "", f.has, has_words, HAS_COUNT), f.use, use_words, USE_COUNT);
    fprintf(stream, "],\n");
}

static void print_budget(FILE *stream, const Render *r)
{
    double error = film_relative_error(&r->film);
    fprintf(stream, "  \"ended_by\": \"%s\",\n  \"resumed_spp\": %" PRIu64 ",\n", r->ended_by, r->resumed);
    if (film_has_error(&r->film) && error < HUGE_VAL)
        fprintf(stream, "  \"relative_error\": %.6g,\n", error);
}

static void print_stats(FILE *stream, const Options *options, const Render *r, const Seconds *seconds)
{
    const Kernel *kernel = r->kernel;
    const Window *w = &r->film.window;
    char technique[512];
    struct rusage usage;
    options_technique(&options->technique, technique, sizeof technique);
    getrusage(RUSAGE_SELF, &usage);
    fprintf(stream, "{\n  \"version\": \"%s\",\n  \"scene\": ", ONERAY_VERSION);
    json_text(stream, options->scene);
    fprintf(stream, ",\n  \"kernel\": \"%s\",\n  \"precision\": \"%s\",\n  \"lanes\": %d,\n",
        instance_name(r), kernel->precision, kernel->lanes);
    if (*options->precision_reason)
        fprintf(stream, "  \"precision_chosen_for\": \"%s\",\n", options->precision_reason);
    Features f = kernel->features(r->prepared);
    json_features(stream, "features", f);
    json_features(stream, "left_out", (Features){~f.has, ~f.use});
    fprintf(stream, "  \"technique\": \"%s\",\n  \"width\": %d,\n  \"height\": %d,\n", technique,
        w->image_width, w->image_height);
    fprintf(stream, "  \"crop\": [%d, %d, %d, %d],\n", w->x, w->y, w->width, w->height);
    uint64_t spp = film_samples(&r->film);
    fprintf(stream, "  \"spp\": %" PRIu64 ",\n  \"seed\": %" PRIu64 ",\n", spp, options->seed);
    print_budget(stream, r);
    fprintf(stream, "  \"paths\": %" PRIu64 ",\n  \"rays\": %" PRIu64 ",\n  \"shadow_rays\": %" PRIu64 ",\n",
        (spp - r->resumed) * film_pixels(&r->film), r->counters.rays, r->counters.shadow_rays);
    fprintf(stream, "  \"seconds\": {\"load\": %.6f, \"build\": %.6f, \"render\": %.6f, \"write\": %.6f},\n",
        seconds->load, seconds->build, seconds->render, seconds->write);
    fprintf(stream, "  \"peak_memory_bytes\": %lld\n}\n", (long long)usage.ru_maxrss * 1024);
}

void stats_write(const Options *options, const Render *render, const Seconds *seconds)
{
    if (!strcmp(options->stats, "-")) {
        print_stats(stdout, options, render, seconds);
        if (fflush(stdout) || ferror(stdout))
            output_failed("standard output", NULL);
        return;
    }
    char temporary[OUTPUT_NAME];
    FILE *stream = output_open(options->stats, temporary);
    if (!stream)
        output_failed(options->stats, NULL);
    print_stats(stream, options, render, seconds);
    if (!output_close(stream, options->stats, temporary))
        output_failed(options->stats, NULL);
}
