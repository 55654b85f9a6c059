/* From a Description to a kernel's Scene, the lights: their tables, and the tree of them. */
#ifndef ONERAY_PREPARE_EMITTERS_H
#define ONERAY_PREPARE_EMITTERS_H

#include "prepare/emitter_tree.h"

/* The ball around the axis-aligned box of all shapes: what a directional or constant light shines on. */
static double bounding_ball(const Description *d, double center[3])
{
    double low[3], high[3], half[3];
    bounds_of_scene(d, low, high);
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
    if (light->kind != EMITTER_AREA)
        return 1;
    const Shape *shape = &d->shapes[light->shape];
    return shape->kind == SHAPE_MESH ? shape->triangle_count : slots_of(shape->kind);
}

/* A triangle's center, two sides, and their cross product. */
static void triangle_of(
    const Description *d, int triangle, double center[3], double a[3], double b[3], double across[3])
{
    const int32_t *corner = d->mesh.triangle[triangle];
    const double(*vertex)[3] = (const double(*)[3])d->mesh.vertex;
    for (int i = 0; i < 3; i++) {
        a[i] = vertex[corner[1]][i] - vertex[corner[0]][i];
        b[i] = vertex[corner[2]][i] - vertex[corner[0]][i];
        center[i] = vertex[corner[0]][i] + (a[i] + b[i]) / 3;
    }
    cross(a, b, across);
}

/* Area (m²) of side k of a shape. */
static double side_area(const Description *d, const Shape *shape, int k)
{
    double a[3], b[3], across[3];
    if (shape->kind == SHAPE_MESH) {
        triangle_of(d, shape->first_triangle + k, (double[3]){0}, a, b, across);
        return length(across) / 2;
    }
    int axis = shape->kind == SHAPE_CUBE ? k / 2 : 2;
    column(&shape->to_world, (axis + 1) % 3, a);
    column(&shape->to_world, (axis + 2) % 3, b);
    cross(a, b, across);
    switch (shape->kind) {
    case SHAPE_SPHERE: return 4 * PI * dot(a, a);
    case SHAPE_DISK: return PI * length(across);
    default: return 4 * length(across);
    }
}

/* The mean of the channels. */
static double mean_emission(const Emitter *light)
{
    return (light->emission[0] + light->emission[1] + light->emission[2]) / 3;
}

/* Flux (W) over the largest mean emission in the scene, with which it might overflow, in a scene of radius r: what
   the choice by power goes by. A spot's cone is taken to its middle. */
static double power_of(const Description *d, const Emitter *light, int side, double r, double largest_mean)
{
    double mean = mean_emission(light) / largest_mean;
    switch (light->kind) {
    case EMITTER_AREA: return PI * side_area(d, &d->shapes[light->shape], side) * mean;
    case EMITTER_POINT: return 4 * PI * mean;
    case EMITTER_SPOT: return 2 * PI * (1 - cos((light->cutoff_angle + light->beam_width) / 2)) * mean;
    case EMITTER_DIRECTIONAL: return PI * r * r * mean;
    default: return 4 * PI * PI * r * r * mean;
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
    int triangle = shape->first_triangle + k, slot = scene->shapes.triangles.first_slot + triangle;
    double center[3], a[3], b[3], normal[3];
    triangle_of(d, triangle, center, a, b, normal);
    double size = length(normal);
    for (int j = 0; j < 3; j++)
        normal[j] = size > 0 ? normal[j] / size : 0;
    emitters->site[i] = SITE_TRIANGLE;
    emitters->area[i] = (Num)(size / 2);
    emitters->slot[i] = slot;
    store(emitters->position[i], center);
    store(emitters->edge_x[i], a);
    store(emitters->edge_y[i], b);
    store(emitters->normal[i], normal);
    if (k > 0)
        return;
    store(emitters->slot_emission[row], light->emission);
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
    int axis = shape->kind == SHAPE_CUBE ? k / 2 : 2;
    double a[3], b[3], c[3], p[3];
    column(&shape->to_world, (axis + 1) % 3, a);
    column(&shape->to_world, (axis + 2) % 3, b);
    column(&shape->to_world, axis, c);
    column(&shape->to_world, 3, p);
    for (int j = 0; shape->kind == SHAPE_CUBE && j < 3; j++)
        p[j] += (1 - 2 * (k % 2)) * c[j];
    const Site sites[SHAPE_KINDS] = {SITE_SPHERE, SITE_RECTANGLE, SITE_DISK, SITE_RECTANGLE, SITE_TRIANGLE};
    emitters->site[i] = (Int)sites[shape->kind];
    emitters->area[i] = (Num)side_area(d, shape, k);
    emitters->slot[i] = slot;
    store(emitters->position[i], p);
    store(emitters->edge_x[i], a);
    store(emitters->edge_y[i], b);
    if (shape->kind == SHAPE_SPHERE)
        emitters->radius[i] = scene->shapes.anchor[slot][3];
    else
        memcpy(emitters->normal[i], scene->shapes.anchor[slot], sizeof emitters->normal[i]);
    if (sites[shape->kind] == SITE_RECTANGLE && fabs(dot(a, b)) <= 1e-12 * length(a) * length(b))
        prepare_panel(emitters->panel[i], length(a), length(b));
    store(emitters->slot_emission[slot], light->emission);
    emitters->slot_light[slot] = i;
}

static void prepare_delta(Emitters *emitters, const Emitter *light, int i)
{
    const Site sites[EMITTER_KINDS] = {SITE_RECTANGLE, SITE_POINT, SITE_SPOT, SITE_DIRECTIONAL, SITE_CONSTANT};
    emitters->site[i] = (Int)sites[light->kind];
    emitters->area[i] = 1;
    emitters->slot[i] = -1;
    store(emitters->position[i], light->position);
    store(emitters->edge_x[i], light->direction);
    emitters->cutoff[i] = (Num)light->cutoff_angle;
    emitters->beam[i] = (Num)light->beam_width;
    emitters->radius[i] = (Num)(2 * pow(sin(light->cutoff_angle / 2), 2));
    if (light->kind != EMITTER_CONSTANT)
        return;
    store(emitters->environment, light->emission);
    emitters->environment_light = i;
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
            store(emitters->emission[site], light->emission);
            power[site] = power_of(d, light, k, radius, largest_mean);
            if (light->kind == EMITTER_AREA && d->shapes[light->shape].kind == SHAPE_MESH)
                prepare_triangle_site(scene, d, light, site, k, first_slot[light->shape]);
            else if (light->kind == EMITTER_AREA)
                prepare_site(scene, d, light, site, k, first_slot[light->shape] + k);
            else
                prepare_delta(emitters, light, site);
        }
    if (scene->features.use & USE_CONTRIBUTION)
        prepare_tree(scene);
    else if (emitters->count)
        prepare_choice(scene, power, technique->light_choice);
    free(power);
}

#endif
