/* Pictures: what a film says of each pixel, as a file of the kind that its name ends with. */
#pragma once

#include "film/film.h"

#include <stdio.h>

typedef struct {
    Window window;               /* the pixels that there are, of the whole image */
    const float *mean;           /* [pixel][3], rows from the top */
    const float *standard_error; /* the same, or NULL: leaves the channels out */
    uint64_t samples_per_pixel;
    double render_seconds; /* negative: not known, left out */
    const char *identity;  /* scene, technique, precision and seed in a line */
    const char *kernel;
} Picture;

/* Ends the program unless the name ends with .exr, .pfm or .png, and over an exposure that it has no use for. */
void picture_check_name(const char *file, double exposure);

/* Likewise unless it ends with .png. */
void picture_check_png(const char *file);

/* .exr (exr.c): float32 channels R G B and stderr.R/G/B. .pfm: float32, the mean. .png: the mean times
   2^exposure in sRGB, 8 bits. Errors end the program and leave no file. */
void picture_write(
    const Film *film, double render_seconds, const char *kernel, double exposure, const char *file);

/* To standard output, times 2^exposure in sRGB: two pixels above each other are a character, each the mean of
   those that it stands for; where TERM=dumb or NO_COLOR is set, a letter of their mean. */
void picture_show(const Film *film, double exposure);

void exr_write(const Picture *picture, const char *file, FILE *stream);
