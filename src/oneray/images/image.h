/* Pictures that a scene file names: textures and environments. */
#pragma once

#include "fields.h"

#include <stdint.h>

/* Rows from the top, linear sRGB; a grey picture has three equal channels. */
typedef struct Image {
    const char *file;
    bool raw;
    int width, height;
    float (*value)[3]; /* [height * width] */
} Image;

/* Those of a scene: each file is there once. */
typedef struct Images {
    Image **all;
    int count;
} Images;

/* The picture in the file: PNG, JPEG, TGA, BMP or PNM, of 8 or 16 bits and by sRGB's curve unless they are `raw`, or HDR
   (RGBE) or OpenEXR. It takes the file's bytes. What is no picture is an error where the scene file names it. */
const Image *image_of(Images *images, File *file, bool raw);
void images_free(Images *images);

/* What has the first bytes of an OpenEXR file. Channels R, G and B, or one alone. */
bool is_openexr(const File *file);
void openexr_read(const File *file, Image *image);

/* Room for so many, none of which is too many. */
void image_begin(Image *image, const File *file, int64_t width, int64_t height);
