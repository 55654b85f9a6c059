/* The picture as an OpenEXR file: float32 channels R G B (mean) and stderr.R/G/B (standard error of the
   mean). */
#ifndef ONERAY_EXR_H
#define ONERAY_EXR_H

#include <stdint.h>

typedef struct {
    int width, height;
    const float *mean;           /* [pixel][3], rows from the top */
    const float *standard_error; /* the same, or NULL: leaves the channels out */
    uint64_t samples_per_pixel;
    double render_seconds; /* negative: not known, left out */
    const char *identity;  /* scene, technique, precision and seed in a line */
    const char *kernel;
} Picture;

/* Errors end the program and leave no file. */
void exr_write_picture(const Picture *picture, const char *file);

#endif
