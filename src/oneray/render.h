/* The render loop: samples in blocks, from the kernel to the film. */
#ifndef ONERAY_RENDER_H
#define ONERAY_RENDER_H

#include "film.h"
#include "kernel.h"
#include "options.h"

double seconds_now(void); /* a clock that only goes forward */

/* Renders options' samples of the prepared scene into the film. A sample that is no radiance, or a path
   without end, ends the program with its place. */
void render(const Options *options, const Description *scene, const Kernel *kernel, const void *prepared,
    Film *film, Counters *counters);

#endif
