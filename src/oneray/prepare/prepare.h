/* From a Description to a kernel's Scene: tables in the kernel's precision, computed in double. */
#pragma once

#include "prepare/emitters.h"
#include "prepare/materials.h"
#include "prepare/media.h"

static void prepare_camera(Camera *camera, const Sensor *sensor)
{
    camera->kind = sensor->kind;
#define X(NAME, name, words)                                                                                 \
    if (sensor->kind == SENSOR_##NAME)                                                                       \
        name##_row(&sensor->as.name, &sensor->frame, &camera->as.name);
    SENSORS(X)
#undef X
}

/* By column and by row of the picture what of the filter is on the film. */
static void prepare_filter(Scene *scene, const Sensor *sensor)
{
    const Filter *filter = &sensor->filter;
    const int size[2] = {sensor->frame.width, sensor->frame.height};
    scene->filter.radius = (Num)filter->radius;
    scene->filter.from_end = keep(scene, FILTER_NODES + 1, sizeof(Num));
    for (int i = 0; i <= FILTER_NODES; i++)
        scene->filter.from_end[i] = (Num)filter->from_end[i];
    for (int axis = 0; axis < 2; axis++) {
        scene->filter.cut[axis] = keep(scene, (size_t)size[axis], sizeof *scene->filter.cut[axis]);
        for (int i = 0; i < size[axis]; i++) {
            double cut[2];
            filter_cut(filter, i, size[axis], sensor->frame.border, cut);
            scene->filter.cut[axis][i][0] = (Num)cut[0];
            scene->filter.cut[axis][i][1] = (Num)cut[1];
        }
    }
}

static uint64_t bit(int kind, int first) { return (uint64_t)1 << (first + kind); }
#define HAS_OF(FIRST, kind) bit((int)(kind), BIT_HAS_##FIRST)

static uint64_t features_of_emitter(const Description *d, const Emitter *light)
{
    uint64_t has = HAS_OF(AREA, light->kind);
    if (light->shape < 0)
        return has;
    ShapeKind shape = d->shapes[light->shape].kind;
    if (shape_planes(shape))
        return has | HAS_FLAT_LIGHT;
    return has | (shape == SHAPE_MESH ? HAS_MESH_LIGHT : shape == SHAPE_SPHERE ? HAS_SPHERE_LIGHT : HAS_CYLINDER_LIGHT);
}

static uint64_t feature_of_texture(const Description *d, int texture)
{
    return texture ? HAS_OF(CHECKERBOARD, d->textures[texture - 1].kind - TEXTURE_CHECKERBOARD) : 0;
}

static uint64_t features_of_material(const Description *d, int index)
{
    if (index == MATERIAL_NONE)
        return 0;
    const Material *material = &d->materials[index];
    uint64_t has = material_wants_uv(d, index) ? HAS_UV : 0;
    if (material->kind == MATERIAL_BLEND) {
        int texture = material->as.blend.weight.texture;
        return has | HAS_BLEND | (texture ? HAS_WEIGHTS : 0) | feature_of_texture(d, texture)
               | features_of_material(d, material->as.blend.first) | features_of_material(d, material->as.blend.second);
    }
    has |= material_traits(material).anisotropic ? HAS_ANISOTROPIC : 0;
    has |= material_traits(material).beckmann ? HAS_BECKMANN : 0;
    has |= (material->bump.texture ? HAS_BUMP : 0) | feature_of_texture(d, material->bump.texture);
    const Reflectance *one;
    for (int i = 0; (one = material_reflectance(material, i)); i++)
        has |= feature_of_texture(d, one->texture);
    bool metal = material->kind == MATERIAL_CONDUCTOR && material->as.conductor.fresnel;
    return has | HAS_OF(DIFFUSE, material->kind) | (metal ? HAS_FRESNEL : 0);
}

/* What the technique does with lights of these kinds. */
static uint64_t uses_of_lights(const Technique *technique, Features features)
{
    uint64_t f = USE_NEE, has = features.has;
    bool weighs = technique->estimator == ESTIMATOR_MIS || technique->estimator == ESTIMATOR_BIDIRECTIONAL;
    if (technique->estimator == ESTIMATOR_BIDIRECTIONAL && technique->mis == MIS_BALANCE)
        f |= USE_BALANCE;
    if (weighs && (has & (HAS_AREA | HAS_ANY(SKIES)))) {
        f |= USE_MIS | (technique->mis == MIS_BALANCE ? USE_BALANCE : 0);
        if (technique->mis_pdf == MIS_PDF_SURVIVAL && (features.use & USE_ROULETTE))
            f |= USE_SURVIVAL_PDF;
    }
    if ((has & HAS_MANY_LIGHTS) && technique->light_choice >= LIGHT_CHOICE_CONTRIBUTION)
        f |= USE_CONTRIBUTION | (technique->light_choice == LIGHT_CHOICE_LEARNED ? USE_LEARNED : 0);
    if (technique->light_choice == LIGHT_CHOICE_RESAMPLED
        && (has & (HAS_MANY_LIGHTS | HAS_AREA | HAS_ANY(SKIES))))
        f |= USE_RESAMPLED; /* a point light alone is one candidate */
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
    Features f = {HAS_OF(PERSPECTIVE, d->sensor.kind), 0};
    int emitters = 0;
    for (int i = 0; i < d->shape_count; i++) {
        f.has |= HAS_OF(ALIGNED, kind_in_kernel(&d->shapes[i]));
        f.has |= d->shapes[i].kind == SHAPE_MESH && d->shapes[i].as.mesh.smooth ? HAS_SMOOTH : 0;
        f.has |= features_of_material(d, d->shapes[i].front) | features_of_material(d, d->shapes[i].back);
    }
    if (has_finite_parts(d))
        f.has |= HAS_PARTS;
    for (int i = 0; d->passing && i < d->medium_count; i++)
        f.has |= HAS_OF(HOMOGENEOUS, d->media[i].kind);
    if (d->passing && (f.has & (HAS_ANY(MEDIA) | HAS_NULL | HAS_THINDIELECTRIC)))
        f.has |= HAS_PASSING;
    if (count_primitives(d) > LOOP_MOST)
        f.has |= HAS_TREE;
    for (int i = 0; i < d->emitter_count; i++) {
        f.has |= emitter_has_power(&d->emitters[i]) ? features_of_emitter(d, &d->emitters[i]) : 0;
        emitters += lights_of(d, &d->emitters[i]);
    }
    if (emitters > 1)
        f.has |= HAS_MANY_LIGHTS;
    if (d->hide_emitters)
        f.has |= HAS_HIDDEN;
    if (d->stacks.count)
        f.has |= HAS_STACKS;
    if (!filter_is_pixel(&d->sensor.filter))
        f.has |= HAS_FILTER;
    if (technique->hemisphere == HEMISPHERE_COSINE)
        f.use |= USE_COSINE;
    if ((f.has & HAS_ANY(ROUGH_MATERIALS)) && technique->normals == NORMALS_ALL)
        f.use |= USE_ALL_NORMALS;
    if ((f.has & HAS_DIELECTRIC) && technique->fresnel == FRESNEL_SCHLICK)
        f.use |= USE_SCHLICK;
    if (technique->roulette == ROULETTE_SURVIVAL && (d->max_depth < 0 || d->max_depth > d->rr_depth))
        f.use |= USE_ROULETTE;
    if (technique->sampler == SAMPLER_SOBOL)
        f.use |= USE_SOBOL;
    if (technique->estimator == ESTIMATOR_BIDIRECTIONAL)
        f.use |= USE_BIDIRECTIONAL;
    if (technique->estimator == ESTIMATOR_LIGHT)
        f.use |= USE_LIGHT_PATHS;
    else if (technique->estimator == ESTIMATOR_PHOTONS)
        f.use |= USE_PHOTONS;
    else if (technique->estimator != ESTIMATOR_WALK && emitters > 0
             && (f.has & (HAS_ANY(FINITE_MATERIALS) | HAS_ANY(MEDIA))))
        f.use |= uses_of_lights(technique, f);
    return f;
}

static void *prepare(const Description *d, const Technique *technique, Features features)
{
    Scene *scene = allocate(1, sizeof *scene);
    int *first_slot = allocate((size_t)d->shape_count, sizeof *first_slot);
    scene->features = features;
    prepare_shapes(scene, d, first_slot);
    prepare_materials(scene, d, first_slot);
    if (features.has & HAS_ANY(TEXTURES))
        prepare_textures(scene, d);
    if (features.has & HAS_ANY(MEDIA))
        prepare_media(scene, d, first_slot);
    prepare_emitters(scene, d, technique, first_slot);
    prepare_camera(&scene->camera, &d->sensor);
    scene->max_depth = d->max_depth < 0 || d->max_depth > PATH_LIMIT ? PATH_LIMIT : (Int)d->max_depth;
    scene->rr_depth = scene->features.use & USE_ROULETTE ? d->rr_depth : PATH_LIMIT;
    scene->width = d->sensor.frame.width;
    scene->height = d->sensor.frame.height;
    for (int i = 0; i < 2; i++)
        scene->strategy[i] = technique->strategy[i] > PATH_LIMIT ? PATH_LIMIT : (int)technique->strategy[i];
    scene->candidates = (int)technique->candidates;
    if (features.has & HAS_FILTER)
        prepare_filter(scene, &d->sensor);
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
