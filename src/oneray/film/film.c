#include "film/film.h"

#include "film/output.h"
#include "message.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

size_t film_pixels(const Film *film) { return (size_t)film->window.width * (size_t)film->window.height; }
static uint64_t layer_first(Layer layer) { return layer.index << layer.level; }
static uint64_t layer_end(Layer layer) { return (layer.index + 1) << layer.level; }

uint64_t film_first(const Film *film) { return film->layer_count ? layer_first(film->layers[0]) : 0; }
uint64_t film_samples(const Film *film)
{
    return film->layer_count ? layer_end(film->layers[film->layer_count - 1]) - film_first(film) : 0;
}

int film_block_level(uint64_t first, uint64_t count)
{
    int level = 0;
    while (level < FILM_BLOCK_LEVEL && first % ((uint64_t)2 << level) == 0 && count >= (uint64_t)2 << level)
        level++;
    return level;
}

/* to = a + b, where both hold n samples: the sums add; Σ(x-m)² = Σa + Σb + (Sb - Sa)²/2n. Chan, Golub,
   LeVeque, Updating Formulae and a Pairwise Algorithm for Computing Sample Variances, 1979. Equal samples
   leave exactly zero. */
static inline void join_equal(double to[6], const double a[6], const double b[6], double half_over_n)
{
    for (int c = 0; c < 3; c++) {
        double difference = b[c] - a[c];
        to[3 + c] = a[3 + c] + b[3 + c] + difference * difference * half_over_n;
        to[c] = a[c] + b[c];
    }
}

/* A mean and squared deviations of n samples take in a layer's sums of `more` samples. By the mean, not the
   sum: equal samples leave the mean exactly theirs and the deviations exactly zero, whatever the counts. */
static void take_in(double mean[3], double deviation[3], double n, const double layer[6], double more)
{
    for (int c = 0; c < 3; c++) {
        double difference = layer[c] / more - mean[c];
        mean[c] += difference * (more / (n + more));
        deviation[c] += layer[3 + c] + difference * difference * (n * more / (n + more));
    }
}

int64_t film_reduce(const double *radiance, int level, double (*nodes)[6])
{
    size_t count = (size_t)1 << level;
    for (size_t i = 0; i < 3 * count; i++)
        if (!(radiance[i] >= 0 && radiance[i] <= DBL_MAX))
            return (int64_t)(i / 3);
    count -= count / 2;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 3; c++) {
            const double *a = radiance + 6 * i + c;
            double difference = level ? a[3] - a[0] : 0;
            nodes[i][c] = level ? a[0] + a[3] : a[0];
            nodes[i][3 + c] = difference * difference * 0.5;
        }
    for (double half_over_n = 0.25; count > 1; half_over_n /= 2) {
        count /= 2;
        for (size_t i = 0; i < count; i++)
            join_equal(nodes[i], nodes[2 * i], nodes[2 * i + 1], half_over_n);
    }
    return -1;
}

void film_add(Film *film, Layer layer)
{
    while (film->layer_count) {
        Layer last = film->layers[film->layer_count - 1];
        if (last.level != layer.level || last.index + 1 != layer.index || last.index % 2)
            break;
        for (size_t i = 0; i < film_pixels(film); i++)
            join_equal(
                last.pixels + 6 * i, last.pixels + 6 * i, layer.pixels + 6 * i, ldexp(0.5, -layer.level));
        free(layer.pixels);
        layer = (Layer){last.level + 1, last.index / 2, last.pixels};
        film->layer_count--;
    }
    film->layers = reallocate(film->layers, (size_t)film->layer_count + 1, sizeof *film->layers);
    film->layers[film->layer_count++] = layer;
}

/* Mean and squared deviations of a pixel's samples. */
static void estimate_pixel(const Film *film, size_t pixel, double mean[3], double deviation[3])
{
    double count = 0;
    for (int c = 0; c < 3; c++)
        mean[c] = deviation[c] = 0;
    for (int k = 0; k < film->layer_count; k++) {
        double more = ldexp(1, film->layers[k].level);
        take_in(mean, deviation, count, film->layers[k].pixels + 6 * pixel, more);
        count += more;
    }
}

void film_estimate(const Film *film, float *mean, float *standard_error)
{
    double n = (double)film_samples(film), estimate[3], deviation[3];
    for (size_t i = 0; i < film_pixels(film); i++) {
        estimate_pixel(film, i, estimate, deviation);
        for (size_t c = 0; c < 3; c++) {
            mean[3 * i + c] = (float)estimate[c];
            if (n > 1)
                standard_error[3 * i + c] = (float)sqrt(deviation[c] / (n - 1) / n);
        }
    }
}

double film_relative_error(const Film *film)
{
    double n = (double)film_samples(film), mean[3], deviation[3], sum = 0, squares = 0;
    for (size_t i = 0; i < film_pixels(film); i++) {
        estimate_pixel(film, i, mean, deviation);
        for (int c = 0; c < 3; c++) {
            sum += mean[c];
            squares += deviation[c];
        }
    }
    double numbers = 3 * (double)film_pixels(film);
    return n > 1 && sum > 0 ? sqrt(squares / numbers / (n - 1) / n) / (sum / numbers) : HUGE_VAL;
}

bool film_is_black(const Film *film)
{
    for (int k = 0; k < film->layer_count; k++)
        for (size_t i = 0; i < film_pixels(film); i++)
            for (int c = 0; c < 3; c++)
                if (film->layers[k].pixels[6 * i + (size_t)c] > 0)
                    return false;
    return true;
}

/* The spread of a pixel's samples says how far their mean may be off only where they are independent; Sobol'
   points balance each other, so that it takes other seeds to know. The identity names the sampler. */
bool film_has_error(const Film *film)
{
    return film_samples(film) > 1 && !strstr(film->identity, " --sampler sobol ");
}

/* The bits of a double of IEEE 754 so that in memory their lowest byte is the first, or back, whatever the machine's own
   order is. */
static uint64_t little_endian(uint64_t bits)
{
    unsigned char bytes[8];
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(bits >> 8 * i);
    memcpy(&bits, bytes, sizeof bits);
    return bits;
}

static void write_pixels(const double *numbers, size_t pixels, FILE *stream)
{
    uint64_t bits[6];
    for (size_t i = 0; i < 6 * pixels; i += 6) {
        memcpy(bits, numbers + i, sizeof bits);
        for (int k = 0; k < 6; k++)
            bits[k] = little_endian(bits[k]);
        fwrite(bits, sizeof bits, 1, stream);
    }
}

/* Whether they were all there. */
static bool read_pixels(double *numbers, size_t pixels, FILE *stream)
{
    uint64_t bits[6];
    for (size_t i = 0; i < 6 * pixels; i += 6) {
        if (!fread(bits, sizeof bits, 1, stream))
            return false;
        for (int k = 0; k < 6; k++)
            bits[k] = little_endian(bits[k]);
        memcpy(numbers + i, bits, sizeof bits);
    }
    return true;
}

bool film_write(const Film *film, const char *file)
{
    char temporary[OUTPUT_NAME];
    const Window *w = &film->window;
    FILE *stream = output_open(file, temporary);
    if (!stream)
        return false;
    fprintf(stream, "oneray film 2\n%s\n%d %d %d %d %d %d %d\n", film->identity, w->image_width,
        w->image_height, w->x, w->y, w->width, w->height, film->layer_count);
    for (int k = 0; k < film->layer_count; k++) {
        fprintf(stream, "%d %llu\n", film->layers[k].level, (unsigned long long)film->layers[k].index);
        write_pixels(film->layers[k].pixels, film_pixels(film), stream);
    }
    return output_close(stream, file, temporary);
}

/* Up to the first layer; returns how many there are. */
static int read_start(Film *film, const char *file, FILE *stream)
{
    Window *w = &film->window;
    int layers = 0;
    if (fscanf(stream, "oneray film 2\n%1023[^\n]\n%d %d %d %d %d %d %d", film->identity, &w->image_width,
            &w->image_height, &w->x, &w->y, &w->width, &w->height, &layers)
            != 8
        || fgetc(stream) != '\n' || layers < 1 || layers > 128 || w->width < 1 || w->height < 1 || w->x < 0
        || w->y < 0 || w->image_width > 1 << 28 || w->image_height > 1 << 28
        || w->x > w->image_width - w->width || w->y > w->image_height - w->height
        || film_pixels(film) > 1 << 28)
        die("%s: is not a film of this version of oneray (--film makes them)", file);
    return layers;
}

Film film_read(const char *file)
{
    Film film = {0};
    FILE *stream = fopen(file, "rb");
    if (!stream)
        die("%s: cannot be read: %s", file, strerror(errno));
    int layers = read_start(&film, file, stream);
    for (int k = 0; k < layers; k++) {
        Layer layer;
        unsigned long long index;
        if (fscanf(stream, "%d %llu", &layer.level, &index) != 2 || layer.level < 0 || layer.level > 48
            || index >= (uint64_t)1 << (62 - layer.level) || fgetc(stream) != '\n')
            die("%s: the film is damaged (layer %d of %d)", file, k + 1, layers);
        layer.index = index;
        layer.pixels = allocate(film_pixels(&film), 6 * sizeof(double));
        if (!read_pixels(layer.pixels, film_pixels(&film), stream))
            die("%s: the film ends early (layer %d of %d)", file, k + 1, layers);
        for (size_t i = 0; i < 6 * film_pixels(&film); i++)
            if (!(layer.pixels[i] >= 0 && layer.pixels[i] <= DBL_MAX))
                die("%s: the film is damaged (layer %d of %d: no radiance)", file, k + 1, layers);
        film_add(&film, layer);
    }
    if (fgetc(stream) != EOF)
        die("%s: the film is damaged (more than its %d layers)", file, layers);
    fclose(stream);
    return film;
}

void film_collect(Film *film, Film *from, const char *name)
{
    if (!film->window.width) {
        *film = *from;
        return;
    }
    if (strcmp(film->identity, from->identity) || memcmp(&film->window, &from->window, sizeof film->window))
        die("%s: is a film of something else (%s, %dx%d) than is wanted here (%s, %dx%d)", name,
            from->identity, from->window.width, from->window.height, film->identity, film->window.width,
            film->window.height);
    for (int k = 0; k < from->layer_count; k++)
        film_add(film, from->layers[k]);
    free(from->layers);
}

static int by_first_sample(const void *a, const void *b)
{
    uint64_t first_a = layer_first(*(const Layer *)a), first_b = layer_first(*(const Layer *)b);
    return (first_a > first_b) - (first_a < first_b);
}

void film_close(Film *film)
{
    Film sorted = *film;
    qsort(film->layers, (size_t)film->layer_count, sizeof *film->layers, by_first_sample);
    sorted.layers = NULL;
    sorted.layer_count = 0;
    for (int k = 0; k < film->layer_count; k++) {
        uint64_t first = layer_first(film->layers[k]), end = film_first(&sorted) + film_samples(&sorted);
        uint64_t last = layer_end(film->layers[k]) < end ? layer_end(film->layers[k]) : end;
        if (k && first < end)
            die("merge: samples %llu to %llu are in two films", (unsigned long long)first,
                (unsigned long long)last - 1);
        if (k && first > end)
            die("merge: samples %llu to %llu are in no film", (unsigned long long)end,
                (unsigned long long)first - 1);
        film_add(&sorted, film->layers[k]);
    }
    free(film->layers);
    *film = sorted;
}

void film_free(Film *film)
{
    for (int k = 0; k < film->layer_count; k++)
        free(film->layers[k].pixels);
    free(film->layers);
}
