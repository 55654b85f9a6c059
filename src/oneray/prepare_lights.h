/* From a Description to a kernel's Scene, the lights: their tables, and the tree of them. */
#ifndef ONERAY_PREPARE_LIGHTS_H
#define ONERAY_PREPARE_LIGHTS_H

#include "prepare_tree.h"

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
static int sites_of(const Description *d, const Light *light)
{
    if (!light_has_power(light))
        return 0;
    if (light->kind != LIGHT_AREA)
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
static double mean_emission(const Light *light)
{
    return (light->emission[0] + light->emission[1] + light->emission[2]) / 3;
}

/* Flux (W) over the largest mean emission in the scene, with which it might overflow, in a scene of radius r: what
   the choice by power goes by. A spot's cone is taken to its middle. */
static double power_of(const Description *d, const Light *light, int side, double r, double largest_mean)
{
    double mean = mean_emission(light) / largest_mean;
    switch (light->kind) {
    case LIGHT_AREA: return PI * side_area(d, &d->shapes[light->shape], side) * mean;
    case LIGHT_POINT: return 4 * PI * mean;
    case LIGHT_SPOT: return 2 * PI * (1 - cos((light->cutoff_angle + light->beam_width) / 2)) * mean;
    case LIGHT_DIRECTIONAL: return PI * r * r * mean;
    default: return 4 * PI * PI * r * r * mean;
    }
}

/* Vose's alias table for probabilities p[0 … n-1] that sum to 1: column i is light i up to alias_share[i],
   else alias[i]. Vose, A Linear Algorithm for Generating Random Numbers with a Given Distribution, 1991. */
static void prepare_alias(Scene *scene, const double *p)
{
    Lights *lights = &scene->lights;
    lights->alias_share = keep(scene, (size_t)lights->count, sizeof *lights->alias_share);
    lights->alias = keep(scene, (size_t)lights->count, sizeof *lights->alias);
    int n = lights->count, small = 0, large = n;
    int *order = allocate((size_t)n, sizeof *order); /* small columns from the front, large from the back */
    double *share = allocate((size_t)n, sizeof *share);
    for (int i = 0; i < n; i++) {
        share[i] = p[i] * n;
        order[share[i] < 1 ? small++ : --large] = i;
        lights->alias_share[i] = 1;
        lights->alias[i] = i;
    }
    while (small > 0 && large < n) {
        int less = order[--small], more = order[large];
        lights->alias_share[less] = (Num)share[less];
        lights->alias[less] = more;
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
    Scene *scene, const Description *d, const Light *light, int i, int k, int row)
{
    Lights *lights = &scene->lights;
    const Shape *shape = &d->shapes[light->shape];
    int triangle = shape->first_triangle + k, slot = scene->shapes.triangles.first_slot + triangle;
    double center[3], a[3], b[3], normal[3];
    triangle_of(d, triangle, center, a, b, normal);
    double size = length(normal);
    for (int j = 0; j < 3; j++)
        normal[j] = size > 0 ? normal[j] / size : 0;
    lights->site[i] = SITE_TRIANGLE;
    lights->area[i] = (Num)(size / 2);
    lights->slot[i] = slot;
    store(lights->position[i], center);
    store(lights->edge_x[i], a);
    store(lights->edge_y[i], b);
    store(lights->normal[i], normal);
    if (k > 0)
        return;
    store(lights->slot_emission[row], light->emission);
    lights->slot_light[row] = i - slot;
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
static void prepare_site(Scene *scene, const Description *d, const Light *light, int i, int k, int slot)
{
    Lights *lights = &scene->lights;
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
    lights->site[i] = (Int)sites[shape->kind];
    lights->area[i] = (Num)side_area(d, shape, k);
    lights->slot[i] = slot;
    store(lights->position[i], p);
    store(lights->edge_x[i], a);
    store(lights->edge_y[i], b);
    if (shape->kind == SHAPE_SPHERE)
        lights->radius[i] = scene->shapes.anchor[slot][3];
    else
        memcpy(lights->normal[i], scene->shapes.anchor[slot], sizeof lights->normal[i]);
    if (sites[shape->kind] == SITE_RECTANGLE && fabs(dot(a, b)) <= 1e-12 * length(a) * length(b))
        prepare_panel(lights->panel[i], length(a), length(b));
    store(lights->slot_emission[slot], light->emission);
    lights->slot_light[slot] = i;
}

static void prepare_delta(Lights *lights, const Light *light, int i)
{
    const Site sites[LIGHT_KINDS] = {SITE_RECTANGLE, SITE_POINT, SITE_SPOT, SITE_DIRECTIONAL, SITE_CONSTANT};
    lights->site[i] = (Int)sites[light->kind];
    lights->area[i] = 1;
    lights->slot[i] = -1;
    store(lights->position[i], light->position);
    store(lights->edge_x[i], light->direction);
    lights->cutoff[i] = (Num)light->cutoff_angle;
    lights->beam[i] = (Num)light->beam_width;
    lights->radius[i] = (Num)(2 * pow(sin(light->cutoff_angle / 2), 2));
    if (light->kind != LIGHT_CONSTANT)
        return;
    store(lights->environment, light->emission);
    lights->environment_light = i;
}

static void keep_lights(Scene *scene)
{
    Lights *lights = &scene->lights;
    size_t n = (size_t)lights->count, slots = (size_t)scene->shapes.slot_count;
    lights->site = keep(scene, n, sizeof *lights->site);
    lights->emission = keep(scene, n, sizeof *lights->emission);
    lights->position = keep(scene, n, sizeof *lights->position);
    lights->edge_x = keep(scene, n, sizeof *lights->edge_x);
    lights->edge_y = keep(scene, n, sizeof *lights->edge_y);
    lights->normal = keep(scene, n, sizeof *lights->normal);
    lights->panel = keep(scene, n, sizeof *lights->panel);
    lights->radius = keep(scene, n, sizeof *lights->radius);
    lights->cutoff = keep(scene, n, sizeof *lights->cutoff);
    lights->beam = keep(scene, n, sizeof *lights->beam);
    lights->area = keep(scene, n, sizeof *lights->area);
    lights->inverse_choice = keep(scene, n, sizeof *lights->inverse_choice);
    lights->slot = keep(scene, n, sizeof *lights->slot);
    lights->slot_emission = keep(scene, slots, sizeof *lights->slot_emission);
    lights->slot_light = keep(scene, slots, sizeof *lights->slot_light);
}

/* L4 The probability p_i of each light: 1/N, or in proportion to its power. Any p_i is valid as long as they
   sum to 1 and none is 0 whose light is not. */
static void prepare_choice(Scene *scene, double *power, LightChoice choice)
{
    Lights *lights = &scene->lights;
    double total = 0;
    for (int i = 0; i < lights->count; i++)
        total += power[i];
    for (int i = 0; i < lights->count; i++) {
        power[i] = choice == LIGHT_CHOICE_UNIFORM || total <= 0 ? 1.0 / lights->count : power[i] / total;
        lights->inverse_choice[i] = power[i] > 0 ? (Num)(1 / power[i]) : 0;
    }
    prepare_alias(scene, power);
}

static void prepare_lights(
    Scene *scene, const Description *d, const Technique *technique, const int *first_slot)
{
    Lights *lights = &scene->lights;
    double center[3], radius = bounding_ball(d, center), largest_mean = 0;
    store(lights->world_center, center);
    lights->world_radius = (Num)radius;
    for (int i = 0; i < d->light_count; i++) {
        lights->count += sites_of(d, &d->lights[i]);
        largest_mean = fmax(largest_mean, mean_emission(&d->lights[i]));
    }
    keep_lights(scene);
    for (int i = 0; i < d->shape_count; i++)
        for (int k = 0; d->shapes[i].light >= 0 && k < slots_of(d->shapes[i].kind); k++)
            scene->shapes.shines[first_slot[i] + k] = 1;
    double *power = allocate((size_t)lights->count, sizeof *power);
    for (int i = 0, site = 0; i < d->light_count; i++)
        for (int k = 0; k < sites_of(d, &d->lights[i]); k++, site++) {
            const Light *light = &d->lights[i];
            store(lights->emission[site], light->emission);
            power[site] = power_of(d, light, k, radius, largest_mean);
            if (light->kind == LIGHT_AREA && d->shapes[light->shape].kind == SHAPE_MESH)
                prepare_triangle_site(scene, d, light, site, k, first_slot[light->shape]);
            else if (light->kind == LIGHT_AREA)
                prepare_site(scene, d, light, site, k, first_slot[light->shape] + k);
            else
                prepare_delta(lights, light, site);
        }
    if (scene->features & USE_CONTRIBUTION)
        prepare_tree(scene);
    else if (lights->count)
        prepare_choice(scene, power, technique->light_choice);
    free(power);
}

#endif
