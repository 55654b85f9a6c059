/* The command line. */
#pragma once

#include "kernel/kernel.h"
#include "scene/description.h"
#include "technique.h"

#include <stdbool.h>
#include <stdint.h>

enum { MAX_PARAMETERS = 64 };
#define MOST_SAMPLES ((uint64_t)1 << 48) /* per pixel */
#define MOST_PHOTONS ((uint64_t)1 << 28) /* light paths of a sample */

typedef struct {
    const char *scene, *output, *png, *film, *stats, *sensor,
        *checkpoint; /* NULL: not given; stats "-" is standard output */
    char **parts;   /* the films to merge, instead of a scene to render */
    int part_count; /* 0: a scene is rendered */
    Parameter parameters[MAX_PARAMETERS];
    int parameter_count;
    uint64_t spp;                              /* 0: the scene's sample_count, or without limit */
    double seconds, error;                     /* budgets; 0: without limit */
    double checkpoint_seconds;
    uint64_t seed, first_sample, sample_count; /* sample_count 0: not a part */
    uint64_t size[2];                          /* width and height; 0: the scene's */
    uint64_t crop[4];                          /* x, y, width, height; width 0: the whole image */
    double exposure;                           /* stops */
    Technique technique;
    const char *precision;      /* "auto" until the scene is known */
    char precision_reason[128]; /* why, where it was auto */
    const char *kernel;
    uint64_t lanes; /* 0: the widest */
    bool resume, quiet, check, preview, show;
} Options;

/* Reads the command line; --help and --version print and end the program, errors end it with exit
   status 2. */
Options options_read(int count, char **words);
void options_free(Options *options);

/* Ends the program if the scene does not go with the options: says why. */
void options_check(const Options *options, const Description *scene);

/* The kernel of the precision, which is no longer "auto", and of the lanes that were asked for; ends the program
   if there is none. */
const Kernel *options_kernel(const Options *options);

/* The technique in words of the command line, "--estimator mis --hemisphere cosine …", at most size
   characters. */
void options_technique(const Technique *technique, char *text, int size);
