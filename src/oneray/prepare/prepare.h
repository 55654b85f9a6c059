/* From a Description to a kernel's Scene: tables in the kernel's precision, computed in double. */
#ifndef ONERAY_PREPARE_PREPARE_H
#define ONERAY_PREPARE_PREPARE_H

#include "kernel/kernel.h"
#include "prepare/emitters.h"
#include "prepare/materials.h"

static void prepare_camera(Camera *camera, const Sensor *sensor)
{
    double axis[3], extent[2];
    const Perspective *perspective = &sensor->as.perspective;
    perspective_extent(perspective, (double)sensor->width / sensor->height, extent);
    column(&perspective->to_world, 3, axis);
    store(camera->origin, axis);
    for (int j = 0; j < 3; j++) {
        const double scale[3] = {extent[0], extent[1], 1};
        Num *const to[3] = {camera->left, camera->up, camera->forward};
        column(&perspective->to_world, j, axis);
        double one = length(axis);
        for (int i = 0; i < 3; i++)
            axis[i] *= scale[j] / one;
        store(to[j], axis);
    }
    camera->near_clip = (Num)perspective->near_clip;
    camera->far_clip = (Num)perspective->far_clip;
    camera->pixel_width = (Num)(2.0 / sensor->width);
    camera->pixel_height = (Num)(2.0 / sensor->height);
    double area = 4;
    for (int j = 0; j < 2; j++) {
        double half = extent[j];
        column(&perspective->to_world, j, axis);
        double one = length(axis);
        for (int i = 0; i < 3; i++)
            axis[i] /= one * half;
        store(j ? camera->to_up : camera->to_left, axis);
        area *= half;
    }
    camera->film_area = (Num)area;
}

static uint64_t features_of_emitter(const Description *d, const Emitter *light)
{
    switch (light->kind) {
    case EMITTER_AREA:
        switch (d->shapes[light->shape].kind) {
        case SHAPE_SPHERE: return HAS_AREA | HAS_SPHERE_LIGHT;
        case SHAPE_MESH: return HAS_AREA | HAS_MESH_LIGHT;
        default: return HAS_AREA | HAS_FLAT_LIGHT;
        }
    case EMITTER_POINT: return HAS_POINT;
    case EMITTER_SPOT: return HAS_SPOT;
    case EMITTER_DIRECTIONAL: return HAS_DIRECTIONAL;
    default: return HAS_CONSTANT;
    }
}

static uint64_t features_of_material(const Description *d, int index)
{
    if (index == MATERIAL_NONE)
        return 0;
    const Material *material = &d->materials[index];
    switch (material->kind) {
    case MATERIAL_CONDUCTOR: return HAS_CONDUCTOR | (material->as.conductor.fresnel ? HAS_FRESNEL : 0);
    case MATERIAL_DIELECTRIC: return HAS_DIELECTRIC;
    case MATERIAL_BLEND:
        return HAS_BLEND | features_of_material(d, material->as.blend.first)
               | features_of_material(d, material->as.blend.second);
    default: return HAS_DIFFUSE;
    }
}

/* What the technique does with lights of these kinds. */
static uint64_t uses_of_lights(const Technique *technique, Features features)
{
    uint64_t f = USE_NEE, has = features.has;
    if (technique->estimator == ESTIMATOR_MIS && (has & (HAS_AREA | HAS_CONSTANT))) {
        f |= USE_MIS | (technique->mis == MIS_BALANCE ? USE_BALANCE : 0);
        if (technique->mis_pdf == MIS_PDF_SURVIVAL && (features.use & USE_ROULETTE))
            f |= USE_SURVIVAL_PDF;
    }
    if ((has & HAS_MANY_LIGHTS) && technique->light_choice >= LIGHT_CHOICE_CONTRIBUTION)
        f |= USE_CONTRIBUTION | (technique->light_choice == LIGHT_CHOICE_LEARNED ? USE_LEARNED : 0);
    if ((has & HAS_SPHERE_LIGHT) && technique->light_points == LIGHT_POINTS_FACING)
        f |= USE_FACING;
    if ((has & HAS_SPHERE_LIGHT) && technique->light_points == LIGHT_POINTS_CONE)
        f |= USE_CONE;
    if ((has & HAS_FLAT_LIGHT) && technique->light_points == LIGHT_POINTS_CONE)
        f |= USE_SOLID_ANGLE;
    return f;
}

/* The feature mask: what the scene has, and what the technique does with it. */
static Features features_of(const Description *d, const Technique *technique)
{
    const uint64_t of_kind[SHAPE_KINDS] = {HAS_ALIGNED, HAS_RECTANGLE, HAS_DISK, HAS_CUBE, HAS_SPHERE, HAS_MESH};
    Features f = {0, 0};
    int emitters = 0;
    for (int i = 0; i < d->shape_count; i++) {
        f.has |= aligned_axis(&d->shapes[i]) < 0 ? of_kind[d->shapes[i].kind] : HAS_ALIGNED;
        f.has |= d->shapes[i].kind == SHAPE_MESH && d->shapes[i].as.mesh.smooth ? HAS_SMOOTH : 0;
        f.has |= features_of_material(d, d->shapes[i].front) | features_of_material(d, d->shapes[i].back);
    }
    if (count_primitives(d) > LOOP_MOST)
        f.has |= HAS_TREE;
    for (int i = 0; i < d->emitter_count; i++) {
        f.has |= emitter_has_power(&d->emitters[i]) ? features_of_emitter(d, &d->emitters[i]) : 0;
        emitters += sites_of(d, &d->emitters[i]);
    }
    if (emitters > 1)
        f.has |= HAS_MANY_LIGHTS;
    if (d->hide_emitters)
        f.has |= HAS_HIDDEN;
    if (technique->hemisphere == HEMISPHERE_COSINE)
        f.use |= USE_COSINE;
    if ((f.has & HAS_DIELECTRIC) && technique->fresnel == FRESNEL_SCHLICK)
        f.use |= USE_SCHLICK;
    if (technique->roulette == ROULETTE_SURVIVAL && (d->max_depth < 0 || d->max_depth > d->rr_depth))
        f.use |= USE_ROULETTE;
    if (technique->sampler == SAMPLER_SOBOL)
        f.use |= USE_SOBOL;
    if (technique->estimator == ESTIMATOR_LIGHT)
        f.use |= USE_LIGHT_PATHS;
    else if (technique->estimator != ESTIMATOR_WALK && emitters > 0 && (f.has & HAS_DIFFUSE))
        f.use |= uses_of_lights(technique, f);
    return f;
}

static void *prepare(const Description *d, const Technique *technique)
{
    Scene *scene = allocate(1, sizeof *scene);
    int *first_slot = allocate((size_t)d->shape_count, sizeof *first_slot);
    scene->features = features_of(d, technique);
    prepare_shapes(scene, d, first_slot);
    prepare_materials(scene, d, first_slot);
    prepare_emitters(scene, d, technique, first_slot);
    prepare_camera(&scene->camera, &d->sensor);
    scene->max_depth = d->max_depth < 0 || d->max_depth > PATH_LIMIT ? PATH_LIMIT : (Int)d->max_depth;
    scene->rr_depth = scene->features.use & USE_ROULETTE ? d->rr_depth : PATH_LIMIT;
    scene->width = d->sensor.width;
    scene->height = d->sensor.height;
    free(first_slot);
    return scene;
}

static void release(void *prepared)
{
    Scene *scene = prepared;
    for (int i = 0; i < scene->kept_count; i++)
        free(scene->kept[i]);
    free(scene->kept);
    free(scene);
}

#endif
