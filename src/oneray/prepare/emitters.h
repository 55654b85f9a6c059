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
static int sites_of(const Description *d, const Emitter *light)
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

/* Vose's alias table for probabilities p[0 … n-1] that sum to 1: column i is light i up to alias_share[i],
   else alias[i]. Vose, A Linear Algorithm for Generating Random Numbers with a Given Distribution, 1991. */
static void prepare_alias(Scene *scene, const double *p)
{
    Emitters *emitters = &scene->emitters;
    emitters->alias_share = keep(scene, (size_t)emitters->count, sizeof *emitters->alias_share);
    emitters->alias = keep(scene, (size_t)emitters->count, sizeof *emitters->alias);
    int n = emitters->count, small = 0, large = n;
    int *order = allocate((size_t)n, sizeof *order); /* small columns from the front, large from the back */
    double *share = allocate((size_t)n, sizeof *share);
    for (int i = 0; i < n; i++) {
        share[i] = p[i] * n;
        order[share[i] < 1 ? small++ : --large] = i;
        emitters->alias_share[i] = 1;
        emitters->alias[i] = i;
    }
    while (small > 0 && large < n) {
        int less = order[--small], more = order[large];
        emitters->alias_share[less] = (Num)share[less];
        emitters->alias[less] = more;
        share[more] -= 1 - share[less];
        if (share[more] < 1) {
            large++;
            order[small++] = more;
        }
    }
    free(share);
    free(order);
}

/* A triangle that shines. */
static void prepare_triangle_site(
    Scene *scene, const Description *d, const Emitter *light, int i, int k, int row)
{
    Emitters *emitters = &scene->emitters;
    const Shape *shape = &d->shapes[light->shape];
    int slot = scene->shapes.triangles.first_slot + shape->as.mesh.first_triangle + k;
    Side side = shape_side(shape, k);
    emitters->site[i] = SITE_MESH;
    emitters->area[i] = (Num)side.area;
    emitters->slot[i] = slot;
    store(emitters->position[i], side.middle);
    store(emitters->edge_x[i], side.x);
    store(emitters->edge_y[i], side.y);
    store(emitters->normal[i], side.normal);
    if (k > 0)
        return;
    store(emitters->slot_emission[row], emitter_traits(light).emission);
    emitters->slot_light[row] = i - slot;
}

static void prepare_panel(Num panel[PANEL_NUMBERS], double half_x, double half_y)
{
    double longer = fmax(half_x, half_y);
    panel[PANEL_X] = (Num)(half_x / longer);
    panel[PANEL_Y] = (Num)(half_y / longer);
    panel[PANEL_INVERSE_X] = (Num)(longer / half_x);
    panel[PANEL_INVERSE_Y] = (Num)(longer / half_y);
    panel[PANEL_ALONG_X] = (Num)(1 / half_x / longer);
    panel[PANEL_ALONG_Y] = (Num)(1 / half_y / longer);
    panel[PANEL_SCALE] = (Num)(1 / longer);
}

/* The side of a shape that shines: where it is, its half sides, its normal, by side k. */
static void prepare_site(Scene *scene, const Description *d, const Emitter *light, int i, int k, int slot)
{
    Emitters *emitters = &scene->emitters;
    const Shape *shape = &d->shapes[light->shape];
    Side side = shape_side(shape, k);
    bool panel = shape->kind == SHAPE_RECTANGLE || shape->kind == SHAPE_CUBE;
    emitters->site[i] = panel ? SITE_RECTANGLE : (Int)shape->kind; /* shapes are the first sites */
    emitters->area[i] = (Num)side.area;
    emitters->slot[i] = slot;
    store(emitters->position[i], side.middle);
    store(emitters->edge_x[i], side.x);
    store(emitters->edge_y[i], side.y);
    if (!shape_planes(shape->kind))
        emitters->radius[i] = scene->shapes.anchor[slot][3];
    else
        memcpy(emitters->normal[i], scene->shapes.anchor[slot], sizeof emitters->normal[i]);
    if (panel && fabs(dot(side.x, side.y)) <= 1e-12 * length(side.x) * length(side.y))
        prepare_panel(emitters->panel[i], length(side.x), length(side.y));
    store(emitters->slot_emission[slot], emitter_traits(light).emission);
    emitters->slot_light[slot] = i;
}

/* A light that is no shape. */
static void prepare_free(Emitters *emitters, const Emitter *light, int i)
{
    emitters->area[i] = 1;
    emitters->slot[i] = -1;
    switch (light->kind) {
#define X(NAME, name, words)                                                                                 \
    case EMITTER_##NAME:                                                                                     \
        emitters->site[i] = SITE_##NAME;                                                                     \
        name##_put(&light->as.name, emitters, i);                                                            \
        break;
        EMITTERS(X)
#undef X
    default: break;
    }
    if (emitter_traits(light).from == FROM_AROUND)
        emitters->sky = i;
}

static void keep_emitters(Scene *scene)
{
    Emitters *emitters = &scene->emitters;
    size_t n = (size_t)emitters->count, slots = (size_t)scene->shapes.slot_count;
    emitters->site = keep(scene, n, sizeof *emitters->site);
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
    prepare_alias(scene, power);
}

static void prepare_emitters(
    Scene *scene, const Description *d, const Technique *technique, const int *first_slot)
{
    Emitters *emitters = &scene->emitters;
    double center[3], radius = bounding_ball(d, center), largest_mean = 0;
    emitters->stacks = &scene->shapes.stacks;
    store(emitters->world_center, center);
    emitters->world_radius = (Num)radius;
    for (int i = 0; i < d->emitter_count; i++) {
        emitters->count += sites_of(d, &d->emitters[i]);
        largest_mean = fmax(largest_mean, mean_emission(&d->emitters[i]));
    }
    keep_emitters(scene);
    for (int i = 0; i < d->shape_count; i++)
        for (int k = 0; d->shapes[i].emitter >= 0 && k < slots_of(d->shapes[i].kind); k++)
            scene->shapes.shines[first_slot[i] + k] = 1;
    double *power = allocate((size_t)emitters->count, sizeof *power);
    for (int i = 0, site = 0; i < d->emitter_count; i++)
        for (int k = 0; k < sites_of(d, &d->emitters[i]); k++, site++) {
            const Emitter *light = &d->emitters[i];
            store(emitters->emission[site], emitter_traits(light).emission);
            power[site] = power_of(d, light, k, radius, largest_mean);
            if (light->kind == EMITTER_AREA && d->shapes[light->shape].kind == SHAPE_MESH)
                prepare_triangle_site(scene, d, light, site, k, first_slot[light->shape]);
            else if (light->kind == EMITTER_AREA)
                prepare_site(scene, d, light, site, k, first_slot[light->shape] + k);
            else
                prepare_free(emitters, light, site);
        }
    if (scene->features.use & USE_CONTRIBUTION)
        prepare_tree(scene);
    else if (emitters->count)
        prepare_choice(scene, power, technique->light_choice);
    free(power);
}
