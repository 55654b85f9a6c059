/* The figures of a render, as JSON. */
#ifndef ONERAY_FILM_STATS_H
#define ONERAY_FILM_STATS_H

#include "render.h"

typedef struct {
    double load, build, render, write;
} Seconds;

/* Into the file that options->stats names; "-" is standard output. Errors end the program. */
void stats_write(const Options *options, const Render *render, const Seconds *seconds);

#endif
