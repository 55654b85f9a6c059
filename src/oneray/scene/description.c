#include "scene/description.h"

#include <stdlib.h>

MaterialTraits material_traits(const Material *material)
{
#define X(NAME, name, words) if (material->kind == MATERIAL_##NAME) return name##_traits(&material->as.name);
    MATERIALS(X)
#undef X
    return (MaterialTraits){.odd = NULL};
}

TextureTraits texture_traits(const Texture *texture)
{
#define X(NAME, name, words) if (texture->kind == TEXTURE_##NAME) return name##_traits(&texture->as.name);
    TEXTURES(X)
#undef X
    return (TextureTraits){.to_uv = NULL};
}

const Reflectance *material_reflectance(const Material *material, int i)
{
#define X(NAME, name, words) &name##_plugin,
    static const Plugin *const plugins[] = {MATERIALS(X)};
#undef X
    for (const Field *field = plugins[material->kind]->fields; field->name; field++)
        if ((field->kind == AS_REFLECTANCE || field->kind == AS_SHARE) && i-- == 0)
            return (const Reflectance *)(const void *)((const char *)&material->as + field->offset);
    return NULL;
}

bool material_wants_uv(const Description *d, int index)
{
    if (index == MATERIAL_NONE)
        return false;
    const Material *material = &d->materials[index];
    if (material->kind == MATERIAL_BLEND)
        return material->as.blend.weight.texture || material_wants_uv(d, material->as.blend.first)
               || material_wants_uv(d, material->as.blend.second);
    bool textured = material->bump.texture != 0;
    const Reflectance *one;
    for (int i = 0; (one = material_reflectance(material, i)); i++)
        textured = textured || one->texture;
    return textured || material_traits(material).anisotropic;
}

EmitterTraits emitter_traits(const Emitter *emitter)
{
#define X(NAME, name, words) if (emitter->kind == EMITTER_##NAME) return name##_traits(&emitter->as.name);
    EMITTERS(X)
#undef X
    return (EmitterTraits){.odd = NULL};
}

SensorTraits sensor_traits(const Sensor *s)
{
#define X(NAME, name, words) if (s->kind == SENSOR_##NAME) return name##_traits(&s->as.name, &s->frame);
    SENSORS(X)
#undef X
    return (SensorTraits){.farthest = 0};
}

Extent shape_extent(const Shape *shape)
{
#define X(NAME, name, words) if (shape->kind == SHAPE_##NAME) return name##_extent(&shape->as.name);
    FILE_SHAPES(X)
#undef X
    return (Extent){.least = 0};
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
#define X(NAME, name, words) if (kind == SHAPE_##NAME) return name##_planes;
    FILE_SHAPES(X)
#undef X
    return 0;
}

int shape_sides(const Shape *shape)
{
    if (shape->kind == SHAPE_MESH)
        return shape->as.mesh.triangle_count;
    return slots_of_planes(shape_planes(shape->kind));
}

bool emitter_has_power(const Emitter *emitter)
{
    const double *emission = emitter_traits(emitter).emission;
    return emission[0] > 0 || emission[1] > 0 || emission[2] > 0;
}

void scene_bounds(const Description *d, double low[3], double high[3])
{
    for (int axis = 0; axis < 3; axis++)
        low[axis] = high[axis] = 0;
    for (int i = 0; i < d->shape_count; i++) {
        Extent extent = shape_extent(&d->shapes[i]);
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = i ? fmin(low[axis], extent.low[axis]) : extent.low[axis];
            high[axis] = i ? fmax(high[axis], extent.high[axis]) : extent.high[axis];
        }
    }
}

void description_free(Description *description)
{
    if (!description)
        return;
    free(description->materials);
    free(description->textures);
    free(description->media);
    free(description->shapes);
    free(description->emitters);
    mesh_free(&description->mesh);
    mesh_tree_free(&description->mesh_tree);
    images_free(&description->images);
    for (int i = 0; i < description->file_count; i++)
        free(description->files[i]);
    free(description->files);
    free(description->stacks.of);
    free(description->stacks.layer);
    free(description->stacks.beside);
    free(description->stacks.up);
    free(description);
}
