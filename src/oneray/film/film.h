/* The film: for each pixel and channel the sum of the samples and the sum of their squared deviations from
   the mean, in double.

   Samples are summed in a fixed binary tree over their index: the node (level, index) holds the samples
   index·2^level … (index+1)·2^level - 1. A film holds the fewest nodes ("layers") that make up its range of
   samples, so it does not matter in which pieces the range was rendered or in which order they were merged:
   the bits are the same. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FILM_BLOCK_LEVEL = 12 }; /* at most 2^12 samples per pixel are reduced at once */

typedef struct {
    int level;
    uint64_t index;
    double *pixels; /* [pixel][6]: sums of R G B, then squared deviations of R G B */
} Layer;

/* The pixels that are rendered, of an image. */
typedef struct {
    int image_width, image_height, x, y, width, height;
} Window;

typedef struct {
    Window window;
    char identity[1024]; /* a line of text: scene, technique, precision, seed; merging wants it equal */
    int layer_count;
    Layer *layers; /* by the samples that they hold, first to last, without a gap */
} Film;

/* The largest level of a block that starts at sample `first` and is no longer than count > 0. */
int film_block_level(uint64_t first, uint64_t count);

/* Reduces 2^level samples of one pixel, radiance[sample][3], to nodes[0]; the other nodes, 2^level in all,
   are room to work in. Returns the first sample that is no radiance (NaN, infinite or negative), or -1. */
int64_t film_reduce(const double *radiance, int level, double (*nodes)[6]);

/* Adds a layer, to the last one where the two are halves of one node; takes over its pixels. */
void film_add(Film *film, Layer layer);

size_t film_pixels(const Film *film); /* of the window */
uint64_t film_first(const Film *film);
uint64_t film_samples(const Film *film);

/* Mean and standard error of the mean, in the pixel's units: [pixel][3] each. The error of a single sample is
   unknown: then it is left as it is. */
void film_estimate(const Film *film, float *mean, float *standard_error);
bool film_has_error(const Film *film); /* more than one sample, and independent ones */

bool film_is_black(const Film *film);

/* The root mean square of the standard errors of all pixels and channels over the mean of all; infinite for a
   single sample and a black image. */
double film_relative_error(const Film *film);

/* A film in a file: a line of identity, then the layers, little-endian doubles on every machine. film_write says
   whether the file is written, and errno why not; an error of film_read ends the program. */
bool film_write(const Film *film, const char *file);
Film film_read(const char *file);

/* Puts the layers of `from` into `film`, which is empty or of the same identity and window; `name` is the file
   of `from`, for the error. Layers may come in any order until film_close, which sorts and joins them and wants
   them without gap or overlap. */
void film_collect(Film *film, Film *from, const char *name);
void film_close(Film *film);

void film_free(Film *film);
