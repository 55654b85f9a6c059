/* P5 Light from all around, by a picture. */
#pragma once

#include "fields.h"
#include "images/image.h"
#include "traits.h"
#include "vectors.h"

typedef struct envmap {
    File filename;
    double scale;
    Affine to_world;
    const Image *image;
    double mean[3]; /* over the sphere and the channels, three times: W·sr⁻¹·m⁻² */
} Envmap;

static inline double image_mean(const Image *image, size_t i, size_t j)
{
    const float *value = image->value[j * (size_t)image->width + i];
    return ((double)value[0] + (double)value[1] + (double)value[2]) / 3;
}

static inline void envmap_check(void *plugin, Said *said)
{
    Envmap *e = plugin;
    const Image *image = e->image = image_of(said->images, &e->filename, false);
    double sum = 0, least = 0, axis[3], size = affine_uniform_scale(&e->to_world, 1e-3);
    if (image->width < 2 || image->height < 2)
        fail(said, "%s: an environment is a picture of 2 x 2 pixels or more", image->file);
    for (size_t k = 0; k < 3 * (size_t)image->width * (size_t)image->height; k++)
        least = fmin(least, (double)image->value[k / 3][k % 3]);
    if (least < 0)
        fail(said, "%s: an environment's light cannot be negative, and this picture has %g", image->file, least);
    if (!(fabs(size - 1) <= 1e-3))
        fail(said, "\"to_world\" of an environment may only turn or mirror it");
    for (int i = 0; i < 3; i++) {
        column(&e->to_world, i, axis);
        for (int k = 0; k < 3; k++)
            e->to_world.m[k][i] = axis[k] / norm(axis);
    }
    /* ∫ sinθ of the function that is 1 at a row and falls to 0 at its neighbours */
    for (int j = 0; j < image->height; j++) {
        double step = PI / (image->height - 1), weight = 2 * cr_sin(j * step) * (1 - cr_cos(step)) / step;
        if (j == 0 || j == image->height - 1)
            weight = 1 - cr_sin(step) / step;
        for (int i = 0; i < image->width; i++)
            sum += weight / 2 / image->width * image_mean(image, (size_t)i, (size_t)j);
    }
    for (int c = 0; c < 3; c++)
        e->mean[c] = sum * e->scale;
}

static const Plugin envmap_plugin = {"envmap", envmap_check, {
    {"filename", AS_FILE, offsetof(Envmap, filename), NULL, NULL},
    {"scale", AS_FLOAT, offsetof(Envmap, scale), "[0,inf)", "1"},
    {"to_world", AS_TRANSFORM, offsetof(Envmap, to_world), NULL, ""},
    {"mis_compensation", AS_BOOLEAN, LEFT_OUT, NULL, "false"},
    {"sampling_weight", AS_FLOAT, LEFT_OUT, "(0,inf)", "1"}}};

static inline EmitterTraits envmap_traits(const Envmap *e)
{
    return (EmitterTraits){.from = FROM_AROUND, .emission = e->mean, .flux = 4 * PI * PI, .image = e->image, .scale = e->scale,
        .to_world = &e->to_world};
}

#ifdef LANES

#include "emitters/emitter.h"

/* A place in the map: the cell, and where in it. */
typedef struct {
    Index column, row;
    Real x, y;
} MapPlace;

/* The mean of the channels at the corners of a cell, row by row, and its light at a place in it. */
INLINE Light map_light(const SkyMap *map, MapPlace at, Real corner[4])
{
    Index next = index_select(at.column + 1 == map->width, index_of(0), at.column + 1);
    Light light[4];
    for (int k = 0; k < 4; k++) {
        light[k] = light_gather(map->pixels, ((at.row + k / 2) * map->width + (k % 2 ? next : at.column)) * 3);
        corner[k] = (light[k].r + light[k].g + light[k].b) * real(1 / 3.0);
    }
    return light_mix(light_mix(light[0], light[1], at.x), light_mix(light[2], light[3], at.x), at.y);
}

/* Where a direction is, its sinθ, and the light from there. */
INLINE Light map_met(const SkyMap *map, Vec wi, MapPlace *at, Real *sine)
{
    Real corner[4], x = vec_dot(vec_of(map->axis[0]), wi), y = vec_dot(vec_of(map->axis[1]), wi);
    Real z = -vec_dot(vec_of(map->axis[2]), wi);
    *sine = real_sqrt(x * x + z * z);
    Mask pole = *sine <= real(0);
    Real turn = angle_of(real_abs(x), select(pole, real(1), z)) * (real(0.5) * REAL_INV_PI);
    turn = select(x < real(0), real(1) - turn, turn);
    Real polar = angle_of(*sine, select(pole & (y == real(0)), real(1), y)) * REAL_INV_PI;
    Real width = real((double)map->width), rows = real((double)map->rows);
    Real along = turn * width + real(0.5), down = real_min(polar * rows, rows * real(BY_PRECISION(1 - 6e-8, 1 - 1.2e-16)));
    Index before = real_floor(along); /* counted from one column before the first */
    at->x = real_fraction(along);
    at->y = real_fraction(down);
    at->row = real_floor(down);
    at->column = index_select(before == 0, index_of(map->width - 1), before - 1);
    at->column = index_select(at->column >= map->width, index_of(0), at->column);
    return map_light(map, *at, corner);
}

INLINE Real map_pdf_w(const SkyMap *map, Index row, Light light, Real sine)
{
    Real mean = (light.r + light.g + light.b) * real(1 / 3.0);
    return mean * gather(map->fill, row) * real(map->inverse_total) / real_max(sine, real(BY_PRECISION(1e-30, 1e-240)));
}

APART Light envmap_radiance(const Emitters *emitters, Vec wi)
{
    MapPlace at;
    Real sine;
    return light_mul(light_of(emitters->emission[emitters->sky]), map_met(&emitters->map, wi, &at, &sine));
}

APART Real envmap_pdf_w(const Emitters *emitters, Vec wi)
{
    MapPlace at;
    Real sine;
    Light light = map_met(&emitters->map, wi, &at, &sine);
    return map_pdf_w(&emitters->map, at.row, light, sine);
}

/* One of n by an alias table from `first` on; u goes on as what is left of it. */
INLINE Index map_choose(const Num *p_stay, const Int *alias, Index first, Int n, Real *u)
{
    Real at = real_min(*u * real((double)n), real((double)n) * real(BY_PRECISION(1 - 6e-8, 1 - 1.2e-16)));
    Index i = real_floor(at);
    Real rest = real_fraction(at), stay = gather(p_stay, first + i);
    Mask stays = rest < stay;
    *u = select(stays, rest / stay, (rest - stay) / (real(1) - stay));
    return index_select(stays, i, gather_index(alias, first + i));
}

/* Between 0 and 1 by a density in proportion to a there and to b here, linear. */
INLINE Real sample_linear(Real u, Real a, Real b)
{
    Real sum = a + b;
    Real x = u * sum / (a + real_sqrt(real_max((real(1) - u) * a * a + u * b * b, real(0))));
    return select(sum > real(0), real_min(x, real(1)), u);
}

/* A direction by the density that is linear between pixels, in longitude and latitude. */
APART LightSample envmap_towards(
    const Emitters *emitters, Index i, const Receiver *receiver, Real u, Real v, Features f)
{
    (void)receiver, (void)f;
    const SkyMap *map = &emitters->map;
    MapPlace at = {.x = real(0), .y = real(0)};
    Real corner[4], sine, cosine, sine_turn, cosine_turn, half;
    at.row = map_choose(map->row_p_stay, map->row_alias, index_of(0), map->rows, &v);
    at.column = map_choose(map->column_p_stay, map->column_alias, at.row * map->width, map->width, &u);
    map_light(map, at, corner);
    at.y = sample_linear(v, corner[0] + corner[1], corner[2] + corner[3]);
    at.x = sample_linear(u, corner[0] + at.y * (corner[2] - corner[0]), corner[1] + at.y * (corner[3] - corner[1]));
    Light light = map_light(map, at, corner);
    Real turn = (real_of(at.column) + at.x + real(0.5)) / real((double)map->width);
    sincos_turn(real_fraction(turn), &sine_turn, &cosine_turn);
    half = (real_of(at.row) + at.y) / real((double)map->rows);
    sincos_turn(real(0.5) * half, &sine, &cosine);
    sine = real_abs(sine);
    Vec wi = vec_scale(vec_of(map->axis[0]), sine * sine_turn);
    wi = vec_add(wi, vec_scale(vec_of(map->axis[1]), cosine));
    wi = vec_sub(wi, vec_scale(vec_of(map->axis[2]), sine * cosine_turn));
    Real pdf_w = map_pdf_w(map, at.row, light, sine);
    Real inverse = select(pdf_w > real(0), real(1) / pdf_w, real(0));
    return (LightSample){wi, real(NUM_MAX), light_scale(light, inverse), inverse, index_of(-1), i};
}

/* L17 From such a direction. */
APART FirstRay envmap_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    Real radius = real(emitters->world_radius);
    LightSample s = envmap_towards(emitters, i, NULL, way[0], way[1], f);
    FirstRay ray = from_far_away(emitters, vec_neg(s.wi), place, REAL_PI * radius * radius);
    ray.flux = light_mul(ray.flux, s.weight);
    return ray;
}

INLINE EmitPdf envmap_emit_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    (void)i, (void)o, (void)f;
    return (EmitPdf){envmap_pdf_w(emitters, vec_neg(d)), pdf_a_across(emitters), real(1), mask_all(), mask_all()};
}

#endif
