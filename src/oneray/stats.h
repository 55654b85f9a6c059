/* The figures of a render, as JSON. */
#pragma once

#include "render.h"

typedef struct {
    double load, build, render, write;
} Seconds;

/* Into the file that options->stats names; "-" is standard output. Errors end the program. */
void stats_write(const Options *options, const Render *render, const Seconds *seconds);
