/* The render loop: samples in blocks, from the kernel to the film. */
#pragma once

#include "film/film.h"
#include "kernel/kernel.h"
#include "options.h"

double seconds_now(void); /* a clock that only goes forward */

/* A line on a terminal's standard error. */
typedef struct {
    bool shown, told;        /* on it; that the error is far away, wherever */
    double last, last_error; /* seconds_now() when it was shown, and when the error was estimated */
    double error;            /* as film_relative_error(); 0: not known yet */
} Progress;

/* What a render has to do, and how far it is. */
typedef struct {
    const Options *options;
    const Description *scene;
    const Kernel *kernel;
    void *prepared;
    Film film;
    Counters counters;
    uint64_t wanted;  /* samples per pixel, at most */
    uint64_t resumed; /* of them those that a checkpoint had */
    const char *ended_by; /* "samples", "time", "error" or "interrupt" */
    double started, saved; /* seconds_now() of the start and of the last checkpoint's film */
    Progress progress;
} Render;

/* The name of the kernel's instance that renders. */
const char *instance_name(const Render *r);

/* Renders options' samples of the prepared scene into the film, which has its window and identity. A sample that
   is no radiance, or a path without end, ends the program with its place; a checkpoint that cannot be written is a
   warning. */
void render_image(Render *r);
