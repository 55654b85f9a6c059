#include "film/picture.h"

#include "message.h"
#include "film/output.h"

#include <float.h>
#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static bool ends_with(const char *file, const char *extension)
{
    const char *dot = strrchr(file, '.');
    return dot && !strcasecmp(dot, extension);
}

void picture_check_name(const char *file, double exposure)
{
    if (!ends_with(file, ".exr") && !ends_with(file, ".pfm") && !ends_with(file, ".png"))
        die("%s: the name of a picture ends with .exr, .pfm or .png", file);
    if (exposure != 0 && !ends_with(file, ".png"))
        die("--exposure is of a .png: %s holds the radiance as it is", file);
}

void picture_check_png(const char *file)
{
    if (!ends_with(file, ".png"))
        die("--png %s: its name ends with .png", file);
}

/* "PF", size, the sign of the scale for the order of bytes, then rows from the bottom up. Debevec, PFM. */
static void write_pfm(const Picture *picture, FILE *stream)
{
    const uint16_t one = 1;
    size_t row = 3 * (size_t)picture->window.width;
    fprintf(stream, "PF\n%d %d\n%s\n", picture->window.width, picture->window.height,
        *(const unsigned char *)&one ? "-1.0" : "1.0");
    for (int y = picture->window.height - 1; y >= 0; y--)
        fwrite(picture->mean + (size_t)y * row, sizeof(float), row, stream);
}

/* IEC 61966-2-1, as a byte. */
static png_byte srgb(double linear)
{
    double value = linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
    return (png_byte)(255 * fmin(value, 1) + 0.5);
}

static void write_png(const Picture *picture, double exposure, const char *file, FILE *stream)
{
    size_t numbers = 3 * (size_t)picture->window.width * (size_t)picture->window.height;
    png_bytep bytes = allocate(numbers, sizeof *bytes);
    png_image image = {.version = PNG_IMAGE_VERSION,
        .format = PNG_FORMAT_RGB,
        .width = (png_uint_32)picture->window.width,
        .height = (png_uint_32)picture->window.height};
    for (size_t i = 0; i < numbers; i++)
        bytes[i] = srgb((double)picture->mean[i] * exp2(exposure));
    if (!png_image_write_to_stdio(&image, stream, 0, bytes, 0, NULL))
        output_failed(file, image.message);
    free(bytes);
}

static void check_range(const Window *window, const float *mean, const float *error, const char *file)
{
    size_t width = (size_t)window->width, numbers = 3 * width * (size_t)window->height;
    for (size_t i = 0; i < numbers; i++)
        if (!(mean[i] <= FLT_MAX && error[i] <= FLT_MAX))
            die("%s: pixel (%zu, %zu): the radiance is beyond %g, the largest float of a picture", file,
                i / 3 % width + (size_t)window->x, i / 3 / width + (size_t)window->y, (double)FLT_MAX);
}

/* The mean of pixels [x0, x1) × [y0, y1), at least one, times the factor, as bytes of sRGB. */
static void box(
    const Window *window, const float *mean, int x0, int x1, int y0, int y1, double factor, png_byte rgb[3])
{
    double sum[3] = {0};
    int count = 0;
    for (int y = y0; y < y1 || y == y0; y++)
        for (int x = x0; x < x1 || x == x0; x++, count++)
            for (int c = 0; c < 3; c++)
                sum[c] += (double)mean[3 * ((size_t)y * (size_t)window->width + (size_t)x) + (size_t)c];
    for (int c = 0; c < 3; c++)
        rgb[c] = srgb(factor * sum[c] / count);
}

void picture_show(const Film *film, double exposure)
{
    const char *terminal = getenv("TERM"), *asked = getenv("COLUMNS"), *plain = getenv("NO_COLOR");
    bool coloured = !(plain && *plain) && !(terminal && !strcmp(terminal, "dumb"));
    const Window *window = &film->window;
    int most = asked && atoi(asked) > 0 ? atoi(asked) : 80,
        columns = window->width < most ? window->width : most;
    int rows = (int)((double)columns * window->height / window->width / 2 + 0.5);
    rows = rows < 1 ? 1 : rows;
    size_t numbers = 3 * film_pixels(film);
    float *mean = allocate(numbers, sizeof *mean), *error = allocate(numbers, sizeof *error);
    film_estimate(film, mean, error);
    for (int row = 0; row < rows; row++) {
        for (int column = 0; column < columns; column++) {
            png_byte half[2][3];
            for (int i = 0; i < 2; i++) {
                int64_t k = 2 * row + i;
                box(window, mean, (int)((int64_t)column * window->width / columns),
                    (int)((int64_t)(column + 1) * window->width / columns),
                    (int)(k * window->height / (2 * rows)), (int)((k + 1) * window->height / (2 * rows)),
                    exp2(exposure), half[i]);
            }
            int sum = half[0][0] + half[0][1] + half[0][2] + half[1][0] + half[1][1] + half[1][2];
            if (coloured)
                printf("\033[38;2;%d;%d;%dm\033[48;2;%d;%d;%dm\xe2\x96\x80", half[0][0], half[0][1],
                    half[0][2], half[1][0], half[1][1], half[1][2]);
            else
                putchar(" .:-=+*#%@"[sum * 10 / (6 * 255 + 1)]);
        }
        puts(coloured ? "\033[0m" : "");
    }
    free(mean);
    free(error);
}

void picture_write(
    const Film *film, double render_seconds, const char *kernel, double exposure, const char *file)
{
    size_t numbers = 3 * film_pixels(film);
    float *mean = allocate(numbers, sizeof *mean), *error = allocate(numbers, sizeof *error);
    film_estimate(film, mean, error);
    check_range(&film->window, mean, film_has_error(film) ? error : mean, file);
    Picture picture = {film->window, mean, film_has_error(film) ? error : NULL, film_samples(film),
        render_seconds, film->identity, kernel};
    char temporary[OUTPUT_NAME];
    FILE *stream = output_open(file, temporary);
    if (!stream)
        output_failed(file, NULL);
    if (ends_with(file, ".exr"))
        exr_write(&picture, file, stream);
    else if (ends_with(file, ".pfm"))
        write_pfm(&picture, stream);
    else
        write_png(&picture, exposure, file, stream);
    if (!output_close(stream, file, temporary))
        output_failed(file, NULL);
    free(mean);
    free(error);
}
