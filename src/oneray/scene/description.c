#include "scene/description.h"

#include <stdlib.h>

double material_most(const Material *material, int channel)
{
#define X(NAME, name, words) if (material->kind == MATERIAL_##NAME) return name##_most(&material->as.name, channel);
    MATERIALS(X)
#undef X
    return 0;
}

double material_kept(const Material *material, int channel)
{
#define X(NAME, name, words) if (material->kind == MATERIAL_##NAME) return name##_kept(&material->as.name, channel);
    MATERIALS(X)
#undef X
    return 0;
}

const char *material_odd(const Material *material)
{
#define X(NAME, name, words) if (material->kind == MATERIAL_##NAME) return name##_odd(&material->as.name);
    MATERIALS(X)
#undef X
    return NULL;
}

int shape_sides(const Shape *shape)
{
#define X(NAME, name, words) if (shape->kind == SHAPE_##NAME) return name##_sides(&shape->as.name);
    FILE_SHAPES(X)
#undef X
    return 0;
}

Side shape_side(const Shape *shape, int k)
{
#define X(NAME, name, words) if (shape->kind == SHAPE_##NAME) return name##_side(&shape->as.name, k);
    FILE_SHAPES(X)
#undef X
    return (Side){.area = 0};
}

int shape_planes(ShapeKind kind)
{
#define X(NAME, name, words) [SHAPE_##NAME] = name##_planes,
    static const int planes[SHAPE_KINDS] = {FILE_SHAPES(X)};
#undef X
    return planes[kind];
}

Size shape_size(const Shape *shape)
{
#define X(NAME, name, words) if (shape->kind == SHAPE_##NAME) return name##_size(&shape->as.name);
    FILE_SHAPES(X)
#undef X
    return (Size){0, 0};
}

void shape_bounds(const Shape *shape, double low[3], double high[3])
{
#define X(NAME, name, words) if (shape->kind == SHAPE_##NAME) name##_bounds(&shape->as.name, low, high);
    FILE_SHAPES(X)
#undef X
}

void scene_bounds(const Description *d, double low[3], double high[3])
{
    double from[3], to[3];
    for (int axis = 0; axis < 3; axis++)
        low[axis] = high[axis] = 0;
    for (int i = 0; i < d->shape_count; i++) {
        shape_bounds(&d->shapes[i], from, to);
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = i ? fmin(low[axis], from[axis]) : from[axis];
            high[axis] = i ? fmax(high[axis], to[axis]) : to[axis];
        }
    }
}

LightFrom emitter_from(EmitterKind kind)
{
#define X(NAME, name, words) [EMITTER_##NAME] = (LightFrom)name##_from,
    static const LightFrom from[EMITTER_KINDS] = {EMITTERS(X)};
#undef X
    return from[kind];
}

const double *emitter_emission(const Emitter *light)
{
#define X(NAME, name, words) if (light->kind == EMITTER_##NAME) return name##_emission(&light->as.name);
    EMITTERS(X)
#undef X
    return NULL;
}

bool emitter_has_power(const Emitter *light)
{
    const double *emission = emitter_emission(light);
    return emission[0] > 0 || emission[1] > 0 || emission[2] > 0;
}

const double *emitter_position(const Emitter *light)
{
#define X(NAME, name, words) if (light->kind == EMITTER_##NAME) return name##_position(&light->as.name);
    EMITTERS(X)
#undef X
    return NULL;
}

double emitter_flux(const Emitter *light, double area, double radius)
{
#define X(NAME, name, words) if (light->kind == EMITTER_##NAME) return name##_flux(&light->as.name, area, radius);
    EMITTERS(X)
#undef X
    return 0;
}

const char *emitter_odd(const Emitter *light)
{
#define X(NAME, name, words) if (light->kind == EMITTER_##NAME) return name##_odd(&light->as.name);
    EMITTERS(X)
#undef X
    return NULL;
}

void sensor_origin(const Sensor *sensor, double origin[3])
{
#define X(NAME, name, words) if (sensor->kind == SENSOR_##NAME) name##_origin(&sensor->as.name, origin);
    SENSORS(X)
#undef X
}

double sensor_farthest(const Sensor *sensor)
{
#define X(NAME, name, words) if (sensor->kind == SENSOR_##NAME) return name##_farthest(&sensor->as.name);
    SENSORS(X)
#undef X
    return 0;
}

double sensor_pixel(const Sensor *sensor)
{
#define X(NAME, name, words) if (sensor->kind == SENSOR_##NAME) return name##_pixel(&sensor->as.name, sensor->width, sensor->height);
    SENSORS(X)
#undef X
    return 0;
}

void description_free(Description *description)
{
    if (!description)
        return;
    free(description->materials);
    free(description->shapes);
    free(description->emitters);
    mesh_free(&description->mesh);
    for (int i = 0; i < description->mesh_file_count; i++)
        free(description->mesh_files[i]);
    free(description->mesh_files);
    free(description);
}
