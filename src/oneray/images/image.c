#include "images/image.h"
#include "rounded.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>

#define STB_IMAGE_IMPLEMENTATION
#define STBI_NO_STDIO
#define STBI_NO_GIF
#define STBI_NO_PSD
#define STBI_NO_PIC
#define STBI_MAX_DIMENSIONS (1 << 27)
#include <stb/stb_image.h>

enum { MOST_PIXELS = STBI_MAX_DIMENSIONS };

/* IEC 61966-2-1. */
static float decode_srgb(double x)
{
    return (float)(x <= 0.04045 ? x / 12.92 : cr_pow((x + 0.055) / 1.055, 2.4));
}

static void check_size(const File *file, int64_t width, int64_t height)
{
    if (width < 1 || height < 1 || width > MOST_PIXELS / height)
        fail(&file->named, "%s: it says %lld x %lld pixels, and a picture has 1 to %d", file->name,
            (long long)width, (long long)height, MOST_PIXELS);
}

void image_begin(Image *image, const File *file, int64_t width, int64_t height)
{
    check_size(file, width, height);
    image->width = (int)width;
    image->height = (int)height;
    image->value = allocate((size_t)(width * height), sizeof *image->value);
}

/* Values of 8 or 16 bits, of which `most` is 1. */
static void decode(Image *image, const void *values, unsigned most)
{
    float *table = allocate(most + 1, sizeof *table), *to = image->value[0];
    for (unsigned i = 0; i <= most; i++)
        table[i] = image->raw ? (float)i / (float)most : decode_srgb((double)i / most);
    for (size_t i = 0; i < 3 * (size_t)image->width * (size_t)image->height; i++)
        to[i] = table[most > UCHAR_MAX ? ((const uint16_t *)values)[i] : ((const unsigned char *)values)[i]];
    free(table);
}

/* Four bytes of a PNG file. */
static int64_t big_endian(const unsigned char *bytes)
{
    return (int64_t)bytes[0] << 24 | (int64_t)bytes[1] << 16 | (int64_t)bytes[2] << 8 | bytes[3];
}

static void read_other(const File *file, Image *image)
{
    const unsigned char *bytes = (const unsigned char *)file->bytes;
    int size = file->size > INT_MAX ? INT_MAX : (int)file->size, width, height, channels;
    if (size >= 24 && memcmp(bytes, "\x89PNG", 4) == 0) /* of what is too large stb_image says that it is no picture */
        check_size(file, big_endian(bytes + 16), big_endian(bytes + 20));
    bool there = stbi_info_from_memory(bytes, size, &width, &height, &channels);
    if (there)
        image_begin(image, file, width, height);
    bool hdr = there && stbi_is_hdr_from_memory(bytes, size), wide = there && stbi_is_16_bit_from_memory(bytes, size);
    void *values = !there ? NULL
                   : hdr  ? (void *)stbi_loadf_from_memory(bytes, size, &width, &height, &channels, 3)
                   : wide ? (void *)stbi_load_16_from_memory(bytes, size, &width, &height, &channels, 3)
                          : (void *)stbi_load_from_memory(bytes, size, &width, &height, &channels, 3);
    if (!values)
        fail(&file->named, "%s: no picture that can be read (PNG, JPEG, TGA, BMP, PNM, HDR or OpenEXR): %s",
            file->name, stbi_failure_reason());
    if (hdr)
        memcpy(image->value, values, 3 * sizeof(float) * (size_t)width * (size_t)height);
    else
        decode(image, values, wide ? USHRT_MAX : UCHAR_MAX);
    stbi_image_free(values);
}

const Image *image_of(Images *images, File *file, bool raw)
{
    Image *image = NULL;
    for (int i = 0; i < images->count && !image; i++)
        if (strcmp(images->all[i]->file, file->name) == 0 && images->all[i]->raw == raw && images->all[i]->height)
            image = images->all[i];
    if (!image) {
        image = allocate(1, sizeof *image);
        PUSH(images->all, images->count, image);
        image->file = file->name;
        image->raw = raw;
        (is_openexr(file) ? openexr_read : read_other)(file, image);
        for (size_t i = 0; i < (size_t)image->width * (size_t)image->height; i++)
            for (int c = 0; c < 3; c++)
                if (!isfinite(image->value[i][c]))
                    fail(&file->named, "%s: pixel (%zu, %zu) is infinite or not a number", file->name,
                        i % (size_t)image->width, i / (size_t)image->width);
    }
    free(file->bytes);
    file->bytes = NULL;
    return image;
}

void images_free(Images *images)
{
    for (int i = 0; i < images->count; i++) {
        free(images->all[i]->value);
        free(images->all[i]);
    }
    free(images->all);
}
