/* From a Description to a kernel's Scene, the lights: their tables, and the tree of them. */
#pragma once

#include "prepare/emitter_tree.h"

/* The ball around the axis-aligned box of all shapes: what a directional or constant light shines on. */
static double bounding_ball(const Description *d, double center[3])
{
    double low[3], high[3], half[3];
    scene_bounds(d, low, high);
    for (int axis = 0; axis < 3; axis++) {
        center[axis] = (high[axis] + low[axis]) / 2;
        half[axis] = (high[axis] - low[axis]) / 2;
    }
    return length(half);
}

/* How many lights of the kernel's kind a light of the scene is: a cube shines as six rectangles, a mesh as
   its triangles; one of no power as none. */
static int lights_of(const Description *d, const Emitter *light)
{
    if (!emitter_has_power(light))
        return 0;
    return light->shape < 0 ? 1 : shape_sides(&d->shapes[light->shape]);
}

/* The mean of the channels. */
static double mean_emission(const Emitter *light)
{
    const double *emission = emitter_traits(light).emission;
    return (emission[0] + emission[1] + emission[2]) / 3;
}

/* Flux (W) over the largest mean emission in the scene, with which it might overflow, in a scene of radius r: what
   the choice by power goes by. */
static double power_of(const Description *d, const Emitter *light, int side, double r, double largest_mean)
{
    EmitterTraits traits = emitter_traits(light);
    double mean = mean_emission(light) / largest_mean;
    switch (traits.from) {
    case FROM_SHAPE: return traits.flux * shape_side(&d->shapes[light->shape], side).area * mean;
    case FROM_POINT: return traits.flux * mean;
    default: return traits.flux * r * r * mean;
    }
}

/* Vose's alias table for probabilities p[0 … n-1] that sum to 1: column i is i up to p_stay[i], else alias[i]. Vose, A
   Linear Algorithm for Generating Random Numbers with a Given Distribution, 1991. */
static void prepare_alias(const double *p, int n, Num *p_stay, Int *alias)
{
    int small = 0, large = n;
    int *order = allocate((size_t)n, sizeof *order); /* small columns from the front, large from the back */
    double *share = allocate((size_t)n, sizeof *share);
    for (int i = 0; i < n; i++) {
        share[i] = p[i] * n;
        order[share[i] < 1 ? small++ : --large] = i;
        p_stay[i] = 1;
        alias[i] = i;
    }
    while (small > 0 && large < n) {
        int less = order[--small], more = order[large];
        p_stay[less] = (Num)share[less];
        alias[less] = more;
        share[more] -= 1 - share[less];
        if (share[more] < 1) {
            large++;
            order[small++] = more;
        }
    }
    free(share);
    free(order);
}

static Panel panel_of(double half_x, double half_y)
{
    double longer = fmax(half_x, half_y);
    return (Panel){.x = (Num)(half_x / longer),
        .y = (Num)(half_y / longer),
        .inverse_x = (Num)(longer / half_x),
        .inverse_y = (Num)(longer / half_y),
        .along_x = (Num)(1 / half_x / longer),
        .along_y = (Num)(1 / half_y / longer),
        .scale = (Num)(1 / longer)};
}

/* Side k of a shape that shines, whose first slot, or a mesh's row, is `row`: where it is, its half sides, its normal. */
static void prepare_side(Scene *scene, const Description *d, const Emitter *light, int i, int k, int row)
{
    Emitters *emitters = &scene->emitters;
    const Shape *shape = &d->shapes[light->shape];
    Side side = shape_side(shape, k);
    bool mesh = shape->kind == SHAPE_MESH, panel = shape->kind == SHAPE_RECTANGLE || shape->kind == SHAPE_CUBE;
    int slot = mesh ? scene->shapes.triangles.first_slot + shape->as.mesh.first_triangle + k : row + k;
    emitters->shape[i] = (Int)(panel ? SHAPE_RECTANGLE : shape->kind);
    emitters->area[i] = (Num)side.area;
    emitters->slot[i] = slot;
    store(emitters->position[i], side.middle);
    store(emitters->edge_x[i], side.x);
    store(emitters->edge_y[i], side.y);
    if (mesh)
        store(emitters->normal[i], side.normal);
    else if (!shape_planes(shape->kind))
        emitters->radius[i] = scene->shapes.anchor[slot][3], store(emitters->normal[i], side.axis);
    else
        memcpy(emitters->normal[i], scene->shapes.anchor[slot], sizeof emitters->normal[i]);
    if (panel && fabs(dot(side.x, side.y)) <= 1e-12 * length(side.x) * length(side.y))
        emitters->panel[i] = panel_of(length(side.x), length(side.y));
    store(emitters->slot_emission[mesh ? row : slot], emitter_traits(light).emission);
    emitters->slot_light[mesh ? row : slot] = mesh ? i - slot : i;
}

/* The pixels of an environment, over its emission, and the alias tables of its rows and columns: a cell between four
   pixels is chosen by their mean and by what its row fills of the sphere. */
static void prepare_map(Scene *scene, const EmitterTraits *traits)
{
    SkyMap *map = &scene->emitters.map;
    const Image *image = traits->image;
    size_t width = (size_t)image->width, rows = (size_t)image->height - 1;
    double *row = allocate(rows, sizeof *row), *cell = allocate(width, sizeof *cell), total = 0;
    double unit = traits->scale / traits->emission[0];
    map->width = image->width;
    map->rows = image->height - 1;
    map->pixels = keep(scene, width * (rows + 1), 3 * sizeof *map->pixels);
    map->fill = keep(scene, rows, sizeof *map->fill);
    map->row_p_stay = keep(scene, rows, sizeof *map->row_p_stay);
    map->row_alias = keep(scene, rows, sizeof *map->row_alias);
    map->column_p_stay = keep(scene, width * rows, sizeof *map->column_p_stay);
    map->column_alias = keep(scene, width * rows, sizeof *map->column_alias);
    for (size_t k = 0; k < 3 * width * (rows + 1); k++)
        map->pixels[k] = (Num)(image->value[k / 3][k % 3] * unit);
    for (size_t j = 0; j < rows; j++) {
        double fill = cr_cos(PI * (double)j / (double)rows) - cr_cos(PI * (double)(j + 1) / (double)rows), sum = 0;
        for (size_t i = 0; i < width; i++) {
            cell[i] = 0;
            for (size_t k = 0; k < 4; k++)
                cell[i] += image_mean(image, (i + k % 2) % width, j + k / 2) * unit / 4;
            sum += cell[i];
        }
        for (size_t i = 0; i < width; i++)
            cell[i] = sum > 0 ? cell[i] / sum : 1 / (double)width;
        prepare_alias(cell, image->width, map->column_p_stay + width * j, map->column_alias + width * j);
        map->fill[j] = (Num)(fill * (double)rows / PI);
        row[j] = fill * sum;
        total += row[j];
    }
    for (size_t j = 0; j < rows; j++)
        row[j] /= total;
    prepare_alias(row, image->height - 1, map->row_p_stay, map->row_alias);
    map->inverse_total = (Num)((double)width / (2 * PI * total));
    for (int i = 0; i < 3; i++) {
        double axis[3];
        column(traits->to_world, i, axis);
        store(map->axis[i], axis);
    }
    free(row);
    free(cell);
}

/* A light that is no shape. */
static void prepare_free(Scene *scene, const EmitterTraits *traits, int i)
{
    Emitters *emitters = &scene->emitters;
    emitters->area[i] = 1;
    emitters->slot[i] = emitters->shape[i] = -1;
    if (traits->position)
        store(emitters->position[i], traits->position);
    if (traits->direction)
        store(emitters->edge_x[i], traits->direction);
    emitters->radius[i] = (Num)traits->radius;
    emitters->cutoff[i] = (Num)traits->spread;
    emitters->beam[i] = (Num)traits->beam;
    emitters->extent[i] = (Num)(2 * cr_pow(cr_sin(traits->spread / 2), 2));
    if (traits->from == FROM_AROUND)
        emitters->sky = i;
    if (traits->image)
        prepare_map(scene, traits);
}

static void keep_emitters(Scene *scene)
{
    Emitters *emitters = &scene->emitters;
    size_t n = (size_t)emitters->count, slots = (size_t)scene->shapes.slot_count;
    emitters->kind = keep(scene, n, sizeof *emitters->kind);
    emitters->shape = keep(scene, n, sizeof *emitters->shape);
    emitters->emission = keep(scene, n, sizeof *emitters->emission);
    emitters->position = keep(scene, n, sizeof *emitters->position);
    emitters->edge_x = keep(scene, n, sizeof *emitters->edge_x);
    emitters->edge_y = keep(scene, n, sizeof *emitters->edge_y);
    emitters->normal = keep(scene, n, sizeof *emitters->normal);
    emitters->panel = keep(scene, n, sizeof *emitters->panel);
    emitters->radius = keep(scene, n, sizeof *emitters->radius);
    emitters->extent = keep(scene, n, sizeof *emitters->extent);
    emitters->cutoff = keep(scene, n, sizeof *emitters->cutoff);
    emitters->beam = keep(scene, n, sizeof *emitters->beam);
    emitters->area = keep(scene, n, sizeof *emitters->area);
    emitters->inverse_choice = keep(scene, n, sizeof *emitters->inverse_choice);
    emitters->slot = keep(scene, n, sizeof *emitters->slot);
    emitters->slot_emission = keep(scene, slots, sizeof *emitters->slot_emission);
    emitters->slot_light = keep(scene, slots, sizeof *emitters->slot_light);
}

/* L4 The probability p_i of each light: 1/N, or in proportion to its power. Any p_i is valid as long as they
   sum to 1 and none is 0 whose light is not. */
static void prepare_choice(Scene *scene, double *power, int choice)
{
    Emitters *emitters = &scene->emitters;
    double total = 0;
    for (int i = 0; i < emitters->count; i++)
        total += power[i];
    for (int i = 0; i < emitters->count; i++) {
        power[i] = choice == LIGHT_CHOICE_UNIFORM || total <= 0 ? 1.0 / emitters->count : power[i] / total;
        emitters->inverse_choice[i] = power[i] > 0 ? (Num)(1 / power[i]) : 0;
    }
    emitters->alias_p_stay = keep(scene, (size_t)emitters->count, sizeof *emitters->alias_p_stay);
    emitters->alias = keep(scene, (size_t)emitters->count, sizeof *emitters->alias);
    prepare_alias(power, emitters->count, emitters->alias_p_stay, emitters->alias);
}

static void prepare_emitters(
    Scene *scene, const Description *d, const Technique *technique, const int *first_slot)
{
    Emitters *emitters = &scene->emitters;
    double center[3], radius = bounding_ball(d, center), largest_mean = 0, largest = 0;
    emitters->stacks = &scene->shapes.stacks;
    store(emitters->world_center, center);
    emitters->world_radius = (Num)radius;
    for (int i = 0; i < d->emitter_count; i++) {
        emitters->count += lights_of(d, &d->emitters[i]);
        largest_mean = fmax(largest_mean, mean_emission(&d->emitters[i]));
        for (int c = 0; c < 3; c++)
            largest = fmax(largest, (double)(Num)emitter_traits(&d->emitters[i]).emission[c]);
    }
    keep_emitters(scene);
    for (int i = 0; i < d->shape_count; i++)
        for (int k = 0; d->shapes[i].emitter >= 0 && k < slots_of(d->shapes[i].kind); k++)
            scene->shapes.shines[first_slot[i] + k] = 1;
    bool by_tree = scene->features.use & USE_CONTRIBUTION;
    double *power = allocate((size_t)emitters->count, sizeof *power);
    Leaf *leaves = allocate(by_tree ? (size_t)emitters->count : 0, sizeof *leaves);
    for (int e = 0, i = 0; e < d->emitter_count; e++)
        for (int k = 0; k < lights_of(d, &d->emitters[e]); k++, i++) {
            const Emitter *light = &d->emitters[e];
            EmitterTraits traits = emitter_traits(light);
            emitters->kind[i] = (Int)light->kind;
            store(emitters->emission[i], traits.emission);
            power[i] = power_of(d, light, k, radius, largest_mean);
            if (light->kind == EMITTER_AREA)
                prepare_side(scene, d, light, i, k, first_slot[light->shape]);
            else
                prepare_free(scene, &traits, i);
            if (by_tree)
                leaves[i] = leaf_of(emitters, i, &traits, largest);
        }
    bool paths = scene->features.use & USE_BIDIRECTIONAL; /* those from the lights are always begun by a table */
    if (by_tree)
        prepare_tree(scene, leaves);
    if (emitters->count && (paths || !by_tree))
        prepare_choice(scene, power, technique->light_choice);
    free(power);
    free(leaves);
}
