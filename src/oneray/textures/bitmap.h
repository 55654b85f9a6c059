/* P4 Bitmap: a picture, its first row at v = 0, the middle of its first pixel at half a pixel. */
#pragma once

#include "images/image.h"
#include "traits.h"
#include "vectors.h"

typedef struct bitmap {
    File filename;
    bool raw;
    int filter_type, wrap_mode; /* words of the table */
    Affine to_uv;
    const Image *image;
    double most[3], least[3];
} Bitmap;

static inline void bitmap_check(void *plugin, Said *said)
{
    Bitmap *t = plugin;
    if (t->filter_type > 1)
        note(said, "filter_type \"trilinear\" is read as bilinear, as by Mitsuba 0: Mitsuba 3 refuses it");
    t->image = image_of(said->images, &t->filename, t->raw);
    for (size_t i = 0; i < (size_t)t->image->width * (size_t)t->image->height; i++)
        for (int c = 0; c < 3; c++) {
            double value = t->image->value[i][c];
            t->most[c] = i ? fmax(t->most[c], value) : value;
            t->least[c] = i ? fmin(t->least[c], value) : value;
        }
}

static const Plugin bitmap_plugin = {"bitmap", bitmap_check, {
    {"filename", AS_FILE, offsetof(Bitmap, filename), NULL, NULL},
    {"raw", AS_BOOLEAN, offsetof(Bitmap, raw), NULL, "false"},
    {"filter_type", AS_WORD, offsetof(Bitmap, filter_type), "bilinear, nearest, trilinear", "bilinear"},
    {"wrap_mode", AS_WORD, offsetof(Bitmap, wrap_mode), "repeat, mirror, clamp", "repeat"},
    {"format", AS_STRING, LEFT_OUT, NULL, ""},
    {"accel", AS_BOOLEAN, LEFT_OUT, NULL, "true"},
    {"to_uv", AS_TRANSFORM, offsetof(Bitmap, to_uv), NULL, ""}}};

static inline TextureTraits bitmap_traits(const Bitmap *t)
{
    TextureTraits traits = {.to_uv = &t->to_uv, .image = t->image};
    memcpy(traits.most, t->most, sizeof t->most);
    memcpy(traits.least, t->least, sizeof t->least);
    return traits;
}

#ifdef LANES

#include "textures/texture.h"

typedef struct bitmap_row {
    ToUv to_uv;
    Num width, height, wrap, nearest; /* wrap: 0 repeat, 1 mirror, 2 clamp */
} BitmapRow;
static inline void bitmap_row(const Bitmap *t, BitmapRow *row)
{
    store_to_uv(&row->to_uv, &t->to_uv);
    row->width = (Num)t->image->width;
    row->height = (Num)t->image->height;
    row->wrap = (Num)t->wrap_mode;
    row->nearest = t->filter_type == 1;
}

/* Along an axis of n pixels: the two on either side of u, and the second's share. */
INLINE void bitmap_pixels(Real u, Real n, Real wrap, Real nearest, Index pixel[2], Real *share)
{
    Real once = real_fraction(u), back = real(2) * real_fraction(real(0.5) * u);
    Mask repeat = wrap == real(0), mirror = wrap == real(1);
    back = select(back > real(1), real(2) - back, back);
    Real at = select(repeat, once, select(mirror, back, real_min(real_max(u, real(0)), real(1)))) * n;
    /* counted from one pixel before the first */
    at = real_min(at, n - real(BY_PRECISION(1e-3, 1e-9))) + select(nearest > real(0), real(1), real(0.5));
    Index before = real_floor(at), last = real_floor(real_max(n, real(1))) - 1; /* n is 0 where there is no texture */
    *share = only(mask_not(nearest > real(0)), real_fraction(at));
    pixel[0] = index_select(before == 0, index_select(repeat, last, index_of(0)), before - 1);
    pixel[1] = index_select(before > last, index_select(repeat, index_of(0), last), before);
}

/* The four pixels around (u, v), the shares of the second column and line, and the size. */
INLINE void bitmap_around(
    const Textures *textures, Index row, Real u, Real v, Light value[4], Real share[2], Real size[4])
{
    Index column[2], line[2], first = gather_index(textures->first, row);
    gather_four(textures->numbers + offsetof(BitmapRow, width) / sizeof(Num), row << textures->shift, size);
    bitmap_pixels(u, size[0], size[2], size[3], column, &share[0]);
    bitmap_pixels(v, size[1], size[2], size[3], line, &share[1]);
    for (int i = 0; i < 4; i++)
        value[i] = light_gather(textures->pixels, (first + line[i / 2] * real_floor(size[0]) + column[i % 2]) * 3);
}

INLINE Light bitmap_at(const Textures *textures, Index row, Real u, Real v)
{
    Light value[4];
    Real share[2], size[4];
    bitmap_around(textures, row, u, v, value, share, size);
    return light_mix(light_mix(value[0], value[1], share[0]), light_mix(value[2], value[3], share[0]), share[1]);
}

/* By how much its luminance grows with (u, v), by pixels; to_uv is not undone, and `size` says how many they are. */
INLINE void bitmap_slope(const Textures *textures, Index row, Real u, Real v, Real slope[2], Real size[4])
{
    Light value[4];
    Real share[2], at[4];
    bitmap_around(textures, row, u, v, value, share, size);
    for (int i = 0; i < 4; i++)
        at[i] = luminance(value[i]);
    Mask smooth = mask_not(size[3] > real(0));
    slope[0] = only(smooth, (real(1) - share[1]) * (at[1] - at[0]) + share[1] * (at[3] - at[2]));
    slope[1] = only(smooth, (real(1) - share[0]) * (at[2] - at[0]) + share[0] * (at[3] - at[1]));
}

#endif
