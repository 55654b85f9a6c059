/* From a Description to a kernel's Scene: tables in the kernel's precision, computed in double. */
#ifndef ONERAY_PREPARE_H
#define ONERAY_PREPARE_H

#include "message.h"
#include "scene.h"

#include <stdlib.h>

#define PI 3.14159265358979323846

static void store(Num to[3], const double from[3])
{
    for (int i = 0; i < 3; i++)
        to[i] = (Num)from[i];
}
static void column(const Affine *a, int j, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a->m[i][j];
}
static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}
static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static double length(const double a[3]) { return sqrt(dot(a, a)); }

/* The rows that take the world to the unit shape: with columns a, b, c of the matrix, row 0 is b×c /
   (a·b×c). */
static Local local_of(const Affine *to_world)
{
    Local local;
    double columns[3][3], origin[3];
    for (int j = 0; j < 3; j++)
        column(to_world, j, columns[j]);
    column(to_world, 3, origin);
    for (int i = 0; i < 3; i++) {
        double row[3];
        cross(columns[(i + 1) % 3], columns[(i + 2) % 3], row);
        double determinant = dot(columns[i], row);
        for (int j = 0; j < 3; j++) {
            row[j] /= determinant;
            local.row[i][j] = (Num)row[j];
        }
        local.row[i][3] = (Num)-dot(row, origin);
    }
    return local;
}

/* The plane of the unit shape's side where local coordinate `axis` is `at` (0 for a flat shape): outward unit
   normal, turned over by flip_normals, and n·p. */
static void plane_of(const Shape *shape, int axis, double at, double normal[3], double *offset)
{
    double a[3], b[3], c[3], p[3];
    column(&shape->to_world, (axis + 1) % 3, a);
    column(&shape->to_world, (axis + 2) % 3, b);
    column(&shape->to_world, axis, c);
    column(&shape->to_world, 3, p);
    cross(a, b, normal);
    double sign =
        (at < 0 ? -1 : 1) * (dot(normal, c) < 0 ? -1 : 1) * (shape->flip_normals ? -1 : 1) / length(normal);
    for (int i = 0; i < 3; i++) {
        normal[i] *= sign;
        p[i] += at * c[i];
    }
    *offset = dot(normal, p);
}

/* The axis that a rectangle's normal lies along if its sides lie along the other two, else -1. */
static int aligned_axis(const Shape *shape)
{
    for (int axis = 0; axis < 3 && shape->kind == SHAPE_RECTANGLE; axis++) {
        int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const double(*m)[4] = shape->to_world.m;
        int straight = m[u][1] == 0 && m[v][0] == 0, turned = m[u][0] == 0 && m[v][1] == 0;
        if (m[axis][0] == 0 && m[axis][1] == 0 && (straight || turned))
            return axis;
    }
    return -1;
}

static Aligned aligned_of(const Shape *shape, int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double(*m)[4] = shape->to_world.m;
    return (Aligned){(Num)m[axis][3], (Num)m[u][3], (Num)m[v][3], (Num)(fabs(m[u][0]) + fabs(m[u][1])),
        (Num)(fabs(m[v][0]) + fabs(m[v][1]))};
}

static int slots_of(ShapeKind kind) { return kind == SHAPE_CUBE ? 6 : 1; }

static void prepare_ball(Shapes *s, const Shape *shape, int slot)
{
    Ball *ball = &s->balls[slot - s->sphere_slot];
    double axis[3];
    column(&shape->to_world, 0, axis);
    ball->radius = (Num)length(axis);
    column(&shape->to_world, 3, axis);
    store(ball->center, axis);
    store(s->anchor[slot], axis);
    s->offset[slot] = shape->flip_normals ? -ball->radius : ball->radius;
}

static void count_shapes(Shapes *s, const Description *d, int counts[SHAPE_KINDS])
{
    int aligned = 0;
    for (int i = 0; i < d->shape_count; i++)
        counts[d->shapes[i].kind]++;
    for (int axis = 0; axis < 3; axis++) {
        s->aligned_slot[axis] = aligned;
        for (int i = 0; i < d->shape_count; i++)
            aligned += aligned_axis(&d->shapes[i]) == axis;
    }
    s->aligned_slot[3] = aligned;
    s->disk_slot = counts[SHAPE_RECTANGLE];
    s->cube_slot = s->disk_slot + counts[SHAPE_DISK];
    s->sphere_slot = s->cube_slot + 6 * counts[SHAPE_CUBE];
    s->slot_count = s->sphere_slot + counts[SHAPE_SPHERE];
}

/* Puts the shape into its table; returns its first slot. filled[axis] counts the aligned rectangles so
   far. */
static int place_shape(Shapes *s, const Shape *shape, int filled[3])
{
    int axis = aligned_axis(shape), slot;
    if (axis >= 0) {
        slot = s->aligned_slot[axis] + filled[axis]++;
        s->aligned[slot] = aligned_of(shape, axis);
        return slot;
    }
    switch (shape->kind) {
    case SHAPE_RECTANGLE:
        s->rectangles[s->rectangle_count] = local_of(&shape->to_world);
        return s->aligned_slot[3] + s->rectangle_count++;
    case SHAPE_DISK:
        s->disks[s->disk_count] = local_of(&shape->to_world);
        return s->disk_slot + s->disk_count++;
    case SHAPE_CUBE:
        s->cubes[s->cube_count] = local_of(&shape->to_world);
        return s->cube_slot + 6 * s->cube_count++;
    default:
        slot = s->sphere_slot + s->sphere_count++;
        prepare_ball(s, shape, slot);
        return slot;
    }
}

/* Fills the shape tables; first_slot[i] gets the first slot of shape i. */
static void prepare_shapes(Scene *scene, const Description *d, int *first_slot)
{
    Shapes *s = &scene->shapes;
    int counts[SHAPE_KINDS] = {0}, filled[3] = {0};
    count_shapes(s, d, counts);
    s->aligned = allocate((size_t)s->aligned_slot[3], sizeof(Aligned));
    s->rectangles = allocate((size_t)(counts[SHAPE_RECTANGLE] - s->aligned_slot[3]), sizeof(Local));
    s->disks = allocate((size_t)counts[SHAPE_DISK], sizeof(Local));
    s->cubes = allocate((size_t)counts[SHAPE_CUBE], sizeof(Local));
    s->balls = allocate((size_t)counts[SHAPE_SPHERE], sizeof(Ball));
    s->anchor = allocate((size_t)s->slot_count, sizeof *s->anchor);
    s->offset = allocate((size_t)s->slot_count, sizeof *s->offset);
    s->shines = allocate((size_t)s->slot_count, sizeof *s->shines);
    for (int i = 0; i < d->shape_count; i++) {
        const Shape *shape = &d->shapes[i];
        int slot = first_slot[i] = place_shape(s, shape, filled);
        for (int k = 0; k < slots_of(shape->kind) && shape->kind != SHAPE_SPHERE; k++) {
            int axis = shape->kind == SHAPE_CUBE ? k / 2 : 2;
            double at = shape->kind == SHAPE_CUBE ? 1 - 2 * (k % 2) : 0;
            double normal[3], offset;
            plane_of(shape, axis, at, normal, &offset);
            store(s->anchor[slot + k], normal);
            s->offset[slot + k] = (Num)offset;
        }
    }
}

static void prepare_materials(Scene *scene, const Description *d, const int *first_slot)
{
    Materials *m = &scene->materials;
    size_t rows = 2 * (size_t)scene->shapes.slot_count + 2; /* a ray that meets nothing looks at slot 0 */
    m->albedo = allocate(rows, sizeof *m->albedo);
    m->kind = allocate(rows, sizeof *m->kind);
    if (scene->features & HAS_FRESNEL) {
        m->eta = allocate(rows, sizeof *m->eta);
        m->k = allocate(rows, sizeof *m->k);
    }
    for (int i = 0; i < d->shape_count; i++)
        for (int row = 0; row < 2 * slots_of(d->shapes[i].kind); row++) {
            int index = row % 2 ? d->shapes[i].back : d->shapes[i].front, at = 2 * first_slot[i] + row;
            if (index == MATERIAL_NONE)
                continue;
            const Material *material = &d->materials[index];
            store(m->albedo[at], material->reflectance);
            m->kind[at] = (Int)material->kind;
            if (scene->features & HAS_FRESNEL)
                for (int c = 0; c < 3; c++) {
                    m->eta[at][c] = (Num)material->eta[c];
                    m->k[at][c] = material->fresnel ? (Num)material->k[c] : -1;
                }
        }
}

/* The sphere around the axis-aligned box of all shapes: what a directional or constant light shines on. */
static double bounding_radius(const Description *d)
{
    double low[3] = {0}, high[3] = {0}, half[3];
    for (int i = 0; i < d->shape_count; i++)
        for (int axis = 0; axis < 3; axis++) {
            const double *row = d->shapes[i].to_world.m[axis];
            double reach = fabs(row[0]) + fabs(row[1]) + fabs(row[2]);
            low[axis] = i ? fmin(low[axis], row[3] - reach) : row[3] - reach;
            high[axis] = i ? fmax(high[axis], row[3] + reach) : row[3] + reach;
        }
    for (int axis = 0; axis < 3; axis++)
        half[axis] = (high[axis] - low[axis]) / 2;
    return length(half);
}

/* How many lights of the kernel's kind a light of the scene is: a cube shines as six rectangles. */
static int sites_of(const Description *d, const Light *light)
{
    return light->kind == LIGHT_AREA ? slots_of(d->shapes[light->shape].kind) : 1;
}

/* Area (m²) of side k of a shape. */
static double side_area(const Shape *shape, int k)
{
    double a[3], b[3], across[3];
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

/* Flux (W), the mean of the channels, in a scene of radius r: what the choice by power goes by. A spot's
   cone is taken to its middle. */
static double power_of(const Description *d, const Light *light, int side, double r)
{
    double mean = (light->emission[0] + light->emission[1] + light->emission[2]) / 3;
    switch (light->kind) {
    case LIGHT_AREA: return PI * side_area(&d->shapes[light->shape], side) * mean;
    case LIGHT_POINT: return 4 * PI * mean;
    case LIGHT_SPOT: return 2 * PI * (1 - cos((light->cutoff_angle + light->beam_width) / 2)) * mean;
    case LIGHT_DIRECTIONAL: return PI * r * r * mean;
    default: return 4 * PI * PI * r * r * mean;
    }
}

/* Vose's alias table for probabilities p[0 … n-1] that sum to 1: column i is light i up to alias_share[i],
   else alias[i]. Vose, A Linear Algorithm for Generating Random Numbers with a Given Distribution, 1991. */
static void prepare_alias(Lights *lights, const double *p)
{
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
    const Site sites[SHAPE_KINDS] = {SITE_SPHERE, SITE_RECTANGLE, SITE_DISK, SITE_RECTANGLE};
    lights->site[i] = (Int)sites[shape->kind];
    lights->slot[i] = slot;
    store(lights->position[i], p);
    store(lights->edge_x[i], a);
    store(lights->edge_y[i], b);
    if (shape->kind == SHAPE_SPHERE)
        lights->radius[i] = scene->shapes.offset[slot];
    else
        memcpy(lights->normal[i], scene->shapes.anchor[slot], sizeof lights->normal[i]);
    store(lights->slot_emission[slot], light->emission);
    scene->shapes.shines[slot] = 1;
}

static void prepare_delta(Lights *lights, const Light *light, int i)
{
    const Site sites[LIGHT_KINDS] = {SITE_RECTANGLE, SITE_POINT, SITE_SPOT, SITE_DIRECTIONAL, SITE_CONSTANT};
    lights->site[i] = (Int)sites[light->kind];
    lights->slot[i] = -1;
    store(lights->position[i], light->position);
    store(lights->edge_x[i], light->direction);
    lights->cutoff[i] = (Num)light->cutoff_angle;
    lights->beam[i] = (Num)light->beam_width;
    if (light->kind == LIGHT_CONSTANT)
        store(lights->environment, light->emission);
}

static void allocate_lights(Lights *lights, int slots)
{
    size_t n = (size_t)lights->count;
    lights->site = allocate(n, sizeof *lights->site);
    lights->emission = allocate(n, sizeof *lights->emission);
    lights->position = allocate(n, sizeof *lights->position);
    lights->edge_x = allocate(n, sizeof *lights->edge_x);
    lights->edge_y = allocate(n, sizeof *lights->edge_y);
    lights->normal = allocate(n, sizeof *lights->normal);
    lights->radius = allocate(n, sizeof *lights->radius);
    lights->cutoff = allocate(n, sizeof *lights->cutoff);
    lights->beam = allocate(n, sizeof *lights->beam);
    lights->area_choice = allocate(n, sizeof *lights->area_choice);
    lights->slot = allocate(n, sizeof *lights->slot);
    lights->alias_share = allocate(n, sizeof *lights->alias_share);
    lights->alias = allocate(n, sizeof *lights->alias);
    lights->slot_emission = allocate((size_t)slots, sizeof *lights->slot_emission);
    lights->slot_area_choice = allocate((size_t)slots, sizeof *lights->slot_area_choice);
}

/* L4 The probability p_i of each light: 1/N, or in proportion to its power. Any p_i is valid as long as they
   sum to 1 and none is 0 whose light is not. */
static void choice_probabilities(const Lights *lights, double *p, LightChoice choice)
{
    double total = 0;
    for (int i = 0; i < lights->count; i++)
        total += p[i];
    for (int i = 0; i < lights->count; i++)
        p[i] = choice == LIGHT_CHOICE_UNIFORM || total <= 0 ? 1.0 / lights->count : p[i] / total;
}

static void prepare_lights(
    Scene *scene, const Description *d, const Technique *technique, const int *first_slot)
{
    Lights *lights = &scene->lights;
    for (int i = 0; i < d->light_count; i++)
        lights->count += sites_of(d, &d->lights[i]);
    allocate_lights(lights, scene->shapes.slot_count);
    double *p = allocate((size_t)lights->count, sizeof *p), radius = bounding_radius(d);
    for (int i = 0, site = 0; i < d->light_count; i++)
        for (int k = 0; k < sites_of(d, &d->lights[i]); k++, site++) {
            const Light *light = &d->lights[i];
            store(lights->emission[site], light->emission);
            p[site] = power_of(d, light, k, radius);
            if (light->kind == LIGHT_AREA)
                prepare_site(scene, d, light, site, k, first_slot[light->shape] + k);
            else
                prepare_delta(lights, light, site);
        }
    choice_probabilities(lights, p, technique->light_choice);
    prepare_alias(lights, p);
    for (int i = 0, site = 0; i < d->light_count; i++)
        for (int k = 0; k < sites_of(d, &d->lights[i]); k++, site++) {
            const Light *light = &d->lights[i];
            double area = light->kind == LIGHT_AREA ? side_area(&d->shapes[light->shape], k) : 1;
            lights->area_choice[site] = p[site] > 0 ? (Num)(area / p[site]) : 0;
            if (light->kind == LIGHT_AREA)
                lights->slot_area_choice[lights->slot[site]] = lights->area_choice[site];
            if (light->kind == LIGHT_CONSTANT)
                lights->environment_choice = lights->area_choice[site];
        }
    free(p);
}

static void prepare_camera(Camera *camera, const Sensor *sensor)
{
    double axis[3];
    column(&sensor->to_world, 3, axis);
    store(camera->origin, axis);
    for (int j = 0; j < 3; j++) {
        const double scale[3] = {sensor->tan_half_x, sensor->tan_half_y, 1};
        Num *const to[3] = {camera->left, camera->up, camera->forward};
        column(&sensor->to_world, j, axis);
        double one = length(axis);
        for (int i = 0; i < 3; i++)
            axis[i] *= scale[j] / one;
        store(to[j], axis);
    }
    camera->near_clip = (Num)sensor->near_clip;
    camera->far_clip = (Num)sensor->far_clip;
    camera->pixel_width = (Num)(2.0 / sensor->width);
    camera->pixel_height = (Num)(2.0 / sensor->height);
}

static Features features_of_light(const Description *d, const Light *light)
{
    switch (light->kind) {
    case LIGHT_AREA:
        return HAS_AREA | (d->shapes[light->shape].kind == SHAPE_SPHERE ? HAS_SPHERE_LIGHT : HAS_FLAT_LIGHT);
    case LIGHT_POINT: return HAS_POINT;
    case LIGHT_SPOT: return HAS_SPOT;
    case LIGHT_DIRECTIONAL: return HAS_DIRECTIONAL;
    default: return HAS_CONSTANT;
    }
}

/* The feature mask: what the scene has, and what the technique does with it. */
static Features features_of(const Description *d, const Technique *technique)
{
    const Features of_kind[SHAPE_KINDS] = {HAS_SPHERE, HAS_RECTANGLE, HAS_DISK, HAS_CUBE};
    Features f = 0;
    int lights = 0;
    for (int i = 0; i < d->shape_count; i++) {
        f |= aligned_axis(&d->shapes[i]) < 0 ? of_kind[d->shapes[i].kind] : HAS_ALIGNED;
        const int sides[2] = {d->shapes[i].front, d->shapes[i].back};
        for (int side = 0; side < 2; side++)
            if (sides[side] != MATERIAL_NONE) {
                const Material *material = &d->materials[sides[side]];
                f |= material->kind == MATERIAL_CONDUCTOR ? HAS_CONDUCTOR : HAS_DIFFUSE;
                f |= material->kind == MATERIAL_CONDUCTOR && material->fresnel ? HAS_FRESNEL : 0;
            }
    }
    for (int i = 0; i < d->light_count; i++) {
        f |= features_of_light(d, &d->lights[i]);
        lights += sites_of(d, &d->lights[i]);
    }
    if (lights > 1)
        f |= HAS_MANY_LIGHTS;
    if (d->hide_emitters)
        f |= HAS_HIDDEN;
    if (technique->estimator != ESTIMATOR_WALK && lights > 0 && (f & HAS_DIFFUSE)) {
        f |= USE_NEE;
        if (technique->estimator == ESTIMATOR_MIS && (f & (HAS_AREA | HAS_CONSTANT)))
            f |= USE_MIS | (technique->mis == MIS_BALANCE ? USE_BALANCE : 0);
    }
    if (technique->hemisphere == HEMISPHERE_COSINE)
        f |= USE_COSINE;
    if (technique->roulette == ROULETTE_SURVIVAL && (d->max_depth < 0 || d->max_depth > d->rr_depth))
        f |= USE_ROULETTE;
    return f;
}

static void *prepare(const Description *d, const Technique *technique)
{
    Scene *scene = allocate(1, sizeof *scene);
    int *first_slot = allocate((size_t)d->shape_count, sizeof *first_slot);
    scene->features = features_of(d, technique);
    prepare_shapes(scene, d, first_slot);
    prepare_materials(scene, d, first_slot);
    prepare_lights(scene, d, technique, first_slot);
    prepare_camera(&scene->camera, &d->sensor);
    scene->max_depth = d->max_depth < 0 || d->max_depth > PATH_LIMIT ? PATH_LIMIT : (Int)d->max_depth;
    scene->rr_depth = d->rr_depth;
    scene->width = d->sensor.width;
    free(first_slot);
    return scene;
}

static void release(void *prepared)
{
    Scene *scene = prepared;
    Shapes *s = &scene->shapes;
    Materials *m = &scene->materials;
    Lights *l = &scene->lights;
    void *const blocks[] = {s->aligned, s->rectangles, s->disks, s->cubes, s->balls, s->anchor, s->offset,
        m->albedo, m->kind, m->eta, m->k, l->site, l->emission, l->position, l->edge_x, l->edge_y, l->normal,
        l->radius, l->cutoff, l->beam, l->area_choice, l->slot, l->alias_share, l->alias, l->slot_emission,
        l->slot_area_choice, s->shines, scene};
    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++)
        free(blocks[i]);
}

#endif
