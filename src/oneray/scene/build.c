/* From the elements of a scene file to a Description: for each plugin a function, and a row in a table. */
#include "scene/xml.h"

#include "scene/bounds.h"
#include "meshes/mesh.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double PI = 3.14159265358979323846;

typedef struct {
    const SceneFile *file;
    Description *description;
    int default_material;                         /* of shapes without a bsdf, once one needs it */
    const Node *constant;                         /* the one environment that Mitsuba allows */
    const uint64_t *size;                         /* that the image shall have, or NULL */
} Builder;

typedef struct {
    const char *type;
    void (*read)(Builder *builder, Node *node);
} Plugin;

static void read_plugin(Builder *builder, Node *node, const Plugin *plugins, int count)
{
    const char *type = attribute(node, "type");
    char list[512] = "";
    for (int i = 0; i < count; i++) {
        if (strcmp(plugins[i].type, type) == 0) {
            plugins[i].read(builder, node);
            return;
        }
        snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", i ? ", " : "", plugins[i].type);
    }
    fail(node, "%s is not supported (%s)", describe(node), list);
}

/* The only child with this tag, or NULL. */
static Node *only_child(const Node *node, const char *tag)
{
    Node *found = NULL;
    for (Node *child = node->first; child; child = child->next) {
        if (strcmp(child->tag, tag) != 0)
            continue;
        if (found)
            fail(child, "a second <%s> in <%s>, the first is in line %d", tag, node->tag, found->line);
        found = child;
    }
    return found;
}

/* Appends to one of the description's arrays. */
static void *append_to(void *array, int *count, size_t size) { return room_for(array, (*count)++, size); }

/* Materials. A bsdf that several shapes refer to becomes one material. */

static int add_material(Description *d, Material material)
{
    d->materials = append_to(d->materials, &d->material_count, sizeof *d->materials);
    d->materials[d->material_count - 1] = material;
    return d->material_count - 1;
}

static void read_diffuse(Builder *builder, Node *node)
{
    Material material = {.kind = MATERIAL_DIFFUSE, .reflectance = {.5, .5, .5}, .line = node->line};
    Property properties[] = {{"reflectance", AS_COLOUR, material.reflectance, "[0,1]", NULL}};
    read_properties(node, properties, COUNT(properties), "");
    node->front = add_material(builder->description, material);
}

static void read_conductor(Builder *builder, Node *node)
{
    Material material = {.kind = MATERIAL_CONDUCTOR, .reflectance = {1, 1, 1}, .line = node->line};
    const char *name = NULL;
    enum { NAME, SPECULAR, ETA, K };
    Property properties[] = {
        [NAME] = {"material", AS_STRING, &name, NULL, NULL},
        [SPECULAR] = {"specular_reflectance", AS_COLOUR, material.reflectance, "[0,1]", NULL},
        [ETA] = {"eta", AS_COLOUR, material.eta, "(0,1000]", NULL},
        [K] = {"k", AS_COLOUR, material.k, "[0,1000]", NULL},
    };
    read_properties(node, properties, COUNT(properties), "");
    material.fresnel = properties[ETA].node || properties[K].node;
    if (name && strcmp(name, "none") != 0)
        fail(properties[NAME].node, "the metal \"%.80s\" is not supported by name (write \"none\" for a "
             "perfect mirror, or eta and k as <rgb>)", name);
    if (name && material.fresnel)
        fail(node, "<bsdf type=\"conductor\"> has \"material\" and \"eta\" or \"k\": write one or the other");
    if (!name && !(properties[ETA].node && properties[K].node))
        fail(node, "<bsdf type=\"conductor\"> needs both eta and k as <rgb>, or "
             "<string name=\"material\" value=\"none\"/> for a perfect mirror (Mitsuba's default is copper)");
    node->front = add_material(builder->description, material);
}

static void read_dielectric(Builder *builder, Node *node)
{
    Material material = {.kind = MATERIAL_DIELECTRIC, .reflectance = {1, 1, 1}, .transmittance = {1, 1, 1},
        .line = node->line};
    double inside = 0, outside = 0;
    enum { INSIDE, OUTSIDE, REFLECTANCE, TRANSMITTANCE };
    Property properties[] = {
        [INSIDE] = {"int_ior", AS_IOR, &inside, "(0,1000]", NULL},
        [OUTSIDE] = {"ext_ior", AS_IOR, &outside, "(0,1000]", NULL},
        [REFLECTANCE] = {"specular_reflectance", AS_COLOUR, material.reflectance, "[0,1]", NULL},
        [TRANSMITTANCE] = {"specular_transmittance", AS_COLOUR, material.transmittance, "[0,1]", NULL},
    };
    read_properties(node, properties, COUNT(properties), "");
    if (!properties[INSIDE].node || !properties[OUTSIDE].node)
        fail(node, "<bsdf type=\"dielectric\"> needs both int_ior and ext_ior (as <float>, or by name)");
    material.ior = inside / outside;
    node->front = node->back = add_material(builder->description, material);
}

static void read_bsdf(Builder *builder, Node *node, int *front, int *back);

/* L16 weight is the share of the second bsdf; each side of the surface has its own blend. */
static void read_blend(Builder *builder, Node *node)
{
    Material blend = {.kind = MATERIAL_BLEND, .weight = 0.5, .line = node->line};
    int count = 0, front[2], back[2];
    Property properties[] = {{"weight", AS_FLOAT, &blend.weight, "[0,1]", NULL}};
    read_properties(node, properties, COUNT(properties), "bsdf ref");
    for (Node *child = node->first; child; child = child->next) {
        if (strcmp(child->tag, "bsdf") != 0 && strcmp(child->tag, "ref") != 0)
            continue;
        if (count == 2)
            fail(child, "<bsdf type=\"blendbsdf\"> has a third bsdf: nest another blendbsdf for three");
        read_bsdf(builder, child, &front[count], &back[count]);
        count++;
    }
    if (count < 2)
        fail(node, "<bsdf type=\"blendbsdf\"> needs two bsdfs inside");
    if (!properties[0].node)
        fail(node, "<bsdf type=\"blendbsdf\"> needs <float name=\"weight\" value=\"0.5\"/>, the second's share");
    blend.first = front[0], blend.second = front[1];
    node->front = add_material(builder->description, blend);
    if (back[0] == MATERIAL_NONE && back[1] == MATERIAL_NONE)
        return;
    blend.first = back[0], blend.second = back[1];
    node->back = add_material(builder->description, blend);
}

/* One nested bsdf is on both sides; of two, the first is on the side of the normal. */
static void read_twosided(Builder *builder, Node *node)
{
    int count = 0, nested[2], behind;
    read_properties(node, NULL, 0, "bsdf ref");
    for (Node *child = node->first; child; child = child->next) {
        if (count == 2)
            fail(child, "<bsdf type=\"twosided\"> has a third bsdf (one for both sides, or two)");
        read_bsdf(builder, child, &nested[count++], &behind);
        if (behind != MATERIAL_NONE)
            fail(child, "<bsdf type=\"twosided\"> cannot hold a bsdf that has a back side (twosided, dielectric)");
    }
    if (!count)
        fail(node, "<bsdf type=\"twosided\"> needs a bsdf inside (one for both sides, or two)");
    node->front = nested[0];
    node->back = nested[count - 1];
}

static const Plugin bsdfs[] = {
    {"diffuse", read_diffuse}, {"conductor", read_conductor}, {"dielectric", read_dielectric},
    {"blendbsdf", read_blend}, {"twosided", read_twosided},
};

/* The materials on the two sides of a surface with this <bsdf>, or with the one that a <ref> means. */
static void read_bsdf(Builder *builder, Node *node, int *front, int *back)
{
    Node *bsdf = node;
    if (strcmp(node->tag, "ref") == 0) {
        const char *id = attribute(node, "id");
        if (node->first)
            fail(node->first, "<%s> cannot stand in <ref>", node->first->tag);
        bsdf = find_id(builder->file, id);
        if (!bsdf)
            fail(node, "<ref id=\"%.80s\"/>: nothing has this id", id);
        if (strcmp(bsdf->tag, "bsdf") != 0)
            fail(node, "<ref id=\"%.80s\"/>: that is a <%s>, and only a <bsdf> can be referred to", id,
                 bsdf->tag);
    }
    if (bsdf->state == BEING_READ)
        fail(node, "the bsdf contains itself");
    if (bsdf->state == UNREAD) {
        bsdf->state = BEING_READ;
        bsdf->front = bsdf->back = MATERIAL_NONE;
        read_plugin(builder, bsdf, bsdfs, COUNT(bsdfs));
        bsdf->state = READ;
    }
    *front = bsdf->front;
    *back = bsdf->back;
}

/* Lights. */

static Emitter *add_emitter(Description *d, EmitterKind kind, const Node *node)
{
    d->emitters = append_to(d->emitters, &d->emitter_count, sizeof *d->emitters);
    Emitter *light = &d->emitters[d->emitter_count - 1];
    *light = (Emitter){.kind = kind, .emission = {1, 1, 1}, .shape = -1, .line = node->line};
    return light;
}

/* The shape it shines from is the one that was added last. */
static void read_area(Builder *builder, Node *node)
{
    Description *d = builder->description;
    Emitter *light = add_emitter(d, EMITTER_AREA, node);
    Property properties[] = {{"radiance", AS_COLOUR, light->emission, "[0,inf)", NULL}};
    read_properties(node, properties, COUNT(properties), "");
    light->shape = d->shape_count - 1;
    d->shapes[light->shape].emitter = d->emitter_count - 1;
}

static void read_constant(Builder *builder, Node *node)
{
    Emitter *light = add_emitter(builder->description, EMITTER_CONSTANT, node);
    Property properties[] = {{"radiance", AS_COLOUR, light->emission, "[0,inf)", NULL}};
    read_properties(node, properties, COUNT(properties), "");
    if (builder->constant)
        fail(node, "a second <emitter type=\"constant\">, the first is in line %d", builder->constant->line);
    builder->constant = node;
}

static void set_position(Emitter *light, const Affine *to_world)
{
    for (int i = 0; i < 3; i++)
        light->position[i] = to_world->m[i][3];
}

/* The light travels along +z of its own space. */
static double set_direction(Emitter *light, const Affine *to_world)
{
    double length = 0;
    for (int i = 0; i < 3; i++)
        length += to_world->m[i][2] * to_world->m[i][2];
    length = sqrt(length);
    for (int i = 0; i < 3; i++)
        light->direction[i] = to_world->m[i][2] / length;
    return length;
}

static void read_point(Builder *builder, Node *node)
{
    Emitter *light = add_emitter(builder->description, EMITTER_POINT, node);
    Affine to_world = affine_identity();
    enum { POSITION, TO_WORLD, INTENSITY };
    Property properties[] = {
        [POSITION] = {"position", AS_VECTOR, light->position, NULL, NULL},
        [TO_WORLD] = {"to_world", AS_TRANSFORM, &to_world, NULL, NULL},
        [INTENSITY] = {"intensity", AS_COLOUR, light->emission, "[0,inf)", NULL},
    };
    read_properties(node, properties, COUNT(properties), "");
    if (properties[POSITION].node && properties[TO_WORLD].node)
        fail(node, "<emitter type=\"point\"> has \"position\" and \"to_world\": write one or the other");
    if (properties[TO_WORLD].node)
        set_position(light, &to_world);
}

/* The scale of a matrix that only scales uniformly, rotates and perhaps mirrors: its columns are of one
   length and at right angles. Else 0. */
static double uniform_scale(const Affine *a, double tolerance)
{
    double scale = cbrt(fabs(affine_determinant(*a)));
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double dot = a->m[0][i] * a->m[0][j] + a->m[1][i] * a->m[1][j] + a->m[2][i] * a->m[2][j];
            if (!(fabs(dot / (scale * scale) - (i == j)) <= tolerance))
                return 0;
        }
    return scale;
}

static void read_spot(Builder *builder, Node *node)
{
    Emitter *light = add_emitter(builder->description, EMITTER_SPOT, node);
    Affine to_world = affine_identity();
    double cutoff = 20, beam = -1;
    enum { TO_WORLD, INTENSITY, CUTOFF, BEAM };
    Property properties[] = {
        [TO_WORLD] = {"to_world", AS_TRANSFORM, &to_world, NULL, NULL},
        [INTENSITY] = {"intensity", AS_COLOUR, light->emission, "[0,inf)", NULL},
        [CUTOFF] = {"cutoff_angle", AS_FLOAT, &cutoff, "(0,180]", NULL},
        [BEAM] = {"beam_width", AS_FLOAT, &beam, "[0,180]", NULL},
    };
    read_properties(node, properties, COUNT(properties), "");
    if (!properties[BEAM].node)
        beam = cutoff * .75;
    if (beam > cutoff)
        fail(node, "\"beam_width\" is %g, more than \"cutoff_angle\", %g", beam, cutoff);
    if (uniform_scale(&to_world, 1e-3) == 0)
        fail(properties[TO_WORLD].node,
             "\"to_world\" of a spot must not shear or scale by axis: its cone is round");
    set_position(light, &to_world);
    set_direction(light, &to_world);
    light->cutoff_angle = cutoff * PI / 180;
    light->beam_width = beam * PI / 180;
}

static void read_directional(Builder *builder, Node *node)
{
    Emitter *light = add_emitter(builder->description, EMITTER_DIRECTIONAL, node);
    Affine to_world = affine_identity();
    double direction[3] = {0, 0, 1};
    enum { DIRECTION, TO_WORLD, IRRADIANCE };
    Property properties[] = {
        [DIRECTION] = {"direction", AS_VECTOR, direction, NULL, NULL},
        [TO_WORLD] = {"to_world", AS_TRANSFORM, &to_world, NULL, NULL},
        [IRRADIANCE] = {"irradiance", AS_COLOUR, light->emission, "[0,inf)", NULL},
    };
    read_properties(node, properties, COUNT(properties), "");
    if (properties[DIRECTION].node && properties[TO_WORLD].node)
        fail(node, "<emitter type=\"directional\"> has \"direction\" and \"to_world\": write one or the "
             "other");
    if (properties[DIRECTION].node)
        for (int i = 0; i < 3; i++)
            to_world.m[i][2] = direction[i];
    double length = set_direction(light, &to_world);
    if (!(length > 0 && length < INFINITY))
        fail(properties[DIRECTION].node ? properties[DIRECTION].node : node,
             "\"direction\" must not be of zero or overflowing length");
    if (properties[TO_WORLD].node && fabs(length - 1) > 1e-5)
        fail(properties[TO_WORLD].node, "\"to_world\" of a directional emitter must not scale (Mitsuba "
             "multiplies the irradiance by it)");
}

static void refuse_area(Builder *builder, Node *node)
{
    (void)builder;
    fail(node, "<emitter type=\"area\"> must stand in a <shape>, which is what shines");
}

static const Plugin scene_emitters[] = {
    {"point", read_point}, {"spot", read_spot}, {"directional", read_directional},
    {"constant", read_constant}, {"area", refuse_area},
};

/* Shapes. */

/* Mitsuba's surfaces without a bsdf are a diffuse of reflectance 0.5, and lights without a bsdf black. */
static void set_sides(Builder *builder, Node *node, Shape *shape)
{
    Node *bsdf = only_child(node, "bsdf"), *ref = only_child(node, "ref");
    if (bsdf && ref)
        fail(ref, "a second bsdf in <shape>, the first is in line %d", bsdf->line);
    shape->front = shape->back = MATERIAL_NONE;
    if (bsdf || ref) {
        read_bsdf(builder, bsdf ? bsdf : ref, &shape->front, &shape->back);
    } else if (!only_child(node, "emitter")) {
        if (builder->default_material == MATERIAL_NONE)
            builder->default_material = add_material(builder->description,
                (Material){.kind = MATERIAL_DIFFUSE, .reflectance = {.5, .5, .5}, .line = node->line});
        shape->front = builder->default_material;
    }
}

static void add_shape(Builder *builder, Node *node, Shape shape)
{
    Description *d = builder->description;
    Node *emitter = only_child(node, "emitter");
    shape.emitter = -1;
    shape.line = node->line;
    set_sides(builder, node, &shape);
    d->shapes = append_to(d->shapes, &d->shape_count, sizeof *d->shapes);
    d->shapes[d->shape_count - 1] = shape;
    if (emitter && strcmp(attribute(emitter, "type"), "area") != 0)
        fail(emitter, "%s cannot stand in a <shape>: only area does", describe(emitter));
    if (emitter)
        read_area(builder, emitter);
}

/* to_world · translate(center) · scale(radius). A mirrored sphere is turned inside out, as in Mitsuba; apart
   from that neither a mirroring nor a rotation shows, so that what is kept is a scale and a shift. */
static void read_sphere(Builder *builder, Node *node)
{
    Shape shape = {.kind = SHAPE_SPHERE, .to_world = affine_identity()};
    double center[3] = {0, 0, 0}, radius = 1;
    enum { TO_WORLD, CENTER, RADIUS, FLIP_NORMALS };
    Property properties[] = {
        [TO_WORLD] = {"to_world", AS_TRANSFORM, &shape.to_world, NULL, NULL},
        [CENTER] = {"center", AS_VECTOR, center, NULL, NULL},
        [RADIUS] = {"radius", AS_FLOAT, &radius, "[0,inf)", NULL},
        [FLIP_NORMALS] = {"flip_normals", AS_BOOLEAN, &shape.flip_normals, NULL, NULL},
    };
    read_properties(node, properties, COUNT(properties), "bsdf ref emitter");
    double scale = uniform_scale(&shape.to_world, 1e-4);
    if (scale == 0)
        fail(properties[TO_WORLD].node, "\"to_world\" of a sphere must not shear or scale by axis");
    if (affine_determinant(shape.to_world) < 0)
        shape.flip_normals = !shape.flip_normals;
    Affine at = affine_multiply(shape.to_world, affine_translate(center[0], center[1], center[2]));
    radius *= scale;
    shape.to_world = affine_multiply(affine_translate(at.m[0][3], at.m[1][3], at.m[2][3]),
                                     affine_scale(radius, radius, radius));
    add_shape(builder, node, shape);
    if (radius > 0)
        return;
    Description *d = builder->description;
    warn("%s:%d: this sphere has no size and is left out", node->file, node->line);
    d->emitter_count -= d->shapes[--d->shape_count].emitter >= 0;
}

static void read_plain_shape(Builder *builder, Node *node, ShapeKind kind)
{
    Shape shape = {.kind = kind, .to_world = affine_identity()};
    Property properties[] = {
        {"to_world", AS_TRANSFORM, &shape.to_world, NULL, NULL},
        {"flip_normals", AS_BOOLEAN, &shape.flip_normals, NULL, NULL},
    };
    read_properties(node, properties, COUNT(properties), "bsdf ref emitter");
    add_shape(builder, node, shape);
}

static void read_rectangle(Builder *builder, Node *node)
{
    read_plain_shape(builder, node, SHAPE_RECTANGLE);
}

static void read_disk(Builder *builder, Node *node)
{
    read_plain_shape(builder, node, SHAPE_DISK);
}

static void read_cube(Builder *builder, Node *node)
{
    read_plain_shape(builder, node, SHAPE_CUBE);
}

/* The name of a file that the scene names: relative to the scene's folder. */
static char *path_of(const Node *node, const char *name)
{
    Text path = {0};
    const char *slash = strrchr(node->file, '/');
    if (*name != '/' && slash)
        append(&path, node->file, (size_t)(slash - node->file) + 1);
    append(&path, name, strlen(name));
    return path.text;
}

static void read_mesh(Builder *builder, Node *node, void (*read)(Source *source, Mesh *mesh))
{
    enum { MOST_MIB = 1 << 14 };
    Description *d = builder->description;
    Affine to_world = affine_identity();
    Mesh mesh = {0};
    const char *name = NULL;
    size_t size;
    bool flip_normals = false, face_normals = false;
    Property properties[] = {
        {"filename", AS_STRING, &name, NULL, NULL},
        {"to_world", AS_TRANSFORM, &to_world, NULL, NULL},
        {"flip_normals", AS_BOOLEAN, &flip_normals, NULL, NULL},
        {"face_normals", AS_BOOLEAN, &face_normals, NULL, NULL},
    };
    read_properties(node, properties, COUNT(properties), "bsdf ref emitter");
    if (!name)
        fail(node, "%s needs <string name=\"filename\" value=\"...\"/>", describe(node));
    char *file = path_of(node, name), *bytes = read_file(file, MOST_MIB, properties[0].node, &size);
    d->mesh_files = append_to(d->mesh_files, &d->mesh_file_count, sizeof *d->mesh_files);
    d->mesh_files[d->mesh_file_count - 1] = file;
    d->hash = hash_bytes(d->hash, bytes, size);
    read(&(Source){file, bytes, bytes + size, 1}, &mesh);
    free(bytes);
    if (!mesh.triangle_count)
        die_at(file, 1, "the mesh has no faces");
    mesh_finish(&mesh, file, &to_world, flip_normals, face_normals);
    if (d->mesh.triangle_count > MESH_MOST - mesh.triangle_count
        || d->mesh.vertex_count > MESH_MOST - mesh.vertex_count)
        fail(node, "the scene's meshes have more than %d triangles or vertices", MESH_MOST);
    Shape shape = {.kind = SHAPE_MESH, .to_world = affine_identity(), .smooth = mesh.normal != NULL,
        .first_triangle = d->mesh.triangle_count, .triangle_count = mesh.triangle_count};
    mesh_append(&d->mesh, &mesh);
    add_shape(builder, node, shape);
}

static void read_ply(Builder *builder, Node *node) { read_mesh(builder, node, ply_read); }
static void read_obj(Builder *builder, Node *node) { read_mesh(builder, node, obj_read); }

static const Plugin shapes[] = {
    {"sphere", read_sphere}, {"rectangle", read_rectangle}, {"disk", read_disk}, {"cube", read_cube},
    {"ply", read_ply}, {"obj", read_obj},
};

/* Sensor and integrator. */

static void read_box(Builder *builder, Node *node)
{
    (void)builder;
    read_properties(node, NULL, 0, "");
}

static const Plugin rfilters[] = {{"box", read_box}};

static double derived(double side) { return fmin(fmax(rint(side), 1), 1 << 28); }

/* Another size; with one of the two the image keeps its shape. */
static void set_size(Sensor *sensor, const uint64_t size[2])
{
    double width = (double)size[0], height = (double)size[1], shape = (double)sensor->width / sensor->height;
    if (width > 0 || height > 0) {
        sensor->width = (int)(width > 0 ? width : derived(height * shape));
        sensor->height = (int)(height > 0 ? height : derived(width / shape));
    }
}

static void read_hdrfilm(Builder *builder, Node *node)
{
    Sensor *sensor = &builder->description->sensor;
    const char *pixel_format, *component_format;
    Property properties[] = {
        {"width", AS_INTEGER, &sensor->width, "[1,65536]", NULL},
        {"height", AS_INTEGER, &sensor->height, "[1,65536]", NULL},
        {"pixel_format", AS_STRING, &pixel_format, "rgb", NULL},
        {"component_format", AS_STRING, &component_format, "float32", NULL},
    };
    sensor->width = 768;
    sensor->height = 576;
    read_properties(node, properties, COUNT(properties), "rfilter");
    if (builder->size)
        set_size(sensor, builder->size);
    if ((int64_t)sensor->width * sensor->height > 1 << 28)
        fail(node, "%d x %d pixels are more than 2^28", sensor->width, sensor->height);
    Node *rfilter = only_child(node, "rfilter");
    if (!rfilter)
        fail(node, "<film> needs <rfilter type=\"box\"/> (Mitsuba's default, gaussian, is not supported)");
    read_plugin(builder, rfilter, rfilters, COUNT(rfilters));
}

static const Plugin films[] = {{"hdrfilm", read_hdrfilm}};

static void read_independent(Builder *builder, Node *node)
{
    Property properties[] = {
        {"sample_count", AS_INTEGER, &builder->description->sample_count, "[1,2147483647]", NULL},
    };
    read_properties(node, properties, COUNT(properties), "");
}

static const Plugin samplers[] = {{"independent", read_independent}};

/* fov is the angle that the image spans along an axis: x, y, the smaller or larger side, or the diagonal. */
static void set_field_of_view(Sensor *sensor, double fov, const char *axis)
{
    double half = tan(fov * PI / 360), aspect = (double)sensor->width / sensor->height;
    bool along_x = strcmp(axis, "x") == 0 || strcmp(axis, aspect > 1 ? "larger" : "smaller") == 0;
    if (strcmp(axis, "diagonal") == 0)
        half *= aspect / hypot(aspect, 1);
    else if (!along_x && aspect != 1)
        half *= aspect;
    sensor->tan_half_x = half;
    sensor->tan_half_y = half / aspect;
}

static void read_perspective(Builder *builder, Node *node)
{
    Sensor *sensor = &builder->description->sensor;
    Node *film = only_child(node, "film"), *sampler = only_child(node, "sampler");
    const char *axis = "x";
    double fov = 0;
    enum { FOV, AXIS, NEAR_CLIP, FAR_CLIP, TO_WORLD };
    Property properties[] = {
        [FOV] = {"fov", AS_FLOAT, &fov, "(0,180)", NULL},
        [AXIS] = {"fov_axis", AS_STRING, &axis, "x y diagonal smaller larger", NULL},
        [NEAR_CLIP] = {"near_clip", AS_FLOAT, &sensor->near_clip, "(0,inf)", NULL},
        [FAR_CLIP] = {"far_clip", AS_FLOAT, &sensor->far_clip, "(0,inf)", NULL},
        [TO_WORLD] = {"to_world", AS_TRANSFORM, &sensor->to_world, NULL, NULL},
    };
    sensor->near_clip = .01;
    sensor->far_clip = 1e4;
    sensor->to_world = affine_identity();
    read_properties(node, properties, COUNT(properties), "film sampler");
    if (!properties[FOV].node)
        fail(node, "<sensor> needs a field of view: <float name=\"fov\" value=\"40\"/>, in degrees");
    if (sensor->near_clip >= sensor->far_clip)
        fail(node, "\"near_clip\" is %g and must be less than \"far_clip\", %g", sensor->near_clip,
             sensor->far_clip);
    if (fabs(uniform_scale(&sensor->to_world, 1e-3) - 1) > 1e-3)
        fail(properties[TO_WORLD].node, "\"to_world\" of a sensor must not scale or shear");
    if (!film)
        fail(node, "<sensor> needs a <film type=\"hdrfilm\"> with <rfilter type=\"box\"/>");
    read_plugin(builder, film, films, COUNT(films));
    if (sampler)
        read_plugin(builder, sampler, samplers, COUNT(samplers));
    set_field_of_view(sensor, fov, axis);
}

static const Plugin sensors[] = {{"perspective", read_perspective}};

static void read_path(Builder *builder, Node *node)
{
    Description *d = builder->description;
    Property properties[] = {
        {"max_depth", AS_INTEGER, &d->max_depth, "[-1,999999]", NULL},
        {"rr_depth", AS_INTEGER, &d->rr_depth, "[1,2147483647]", NULL},
        {"hide_emitters", AS_BOOLEAN, &d->hide_emitters, NULL, NULL},
    };
    read_properties(node, properties, COUNT(properties), "");
    if (d->max_depth == 0)
        fail(properties[0].node, "\"max_depth\" 0 is a black image: -1 is without limit, 1 emission only");
}

static const Plugin integrators[] = {{"path", read_path}};

/* The scene. */

static void check_root(const Node *root)
{
    int major, minor, patch;
    char more;
    const char *version = attribute(root, "version");
    if (strcmp(root->tag, "scene") != 0)
        fail(root, "the outermost element must be <scene version=\"3.0.0\">, not <%s>", root->tag);
    if (strspn(version, "0123456789.") != strlen(version)
        || sscanf(version, "%2d.%4d.%4d%c", &major, &minor, &patch, &more) != 3 || major != 3)
        fail(root, "scene version \"%.80s\" is not supported (3.0.0, or another 3.x.y)", version);
    read_properties(root, NULL, 0, "default integrator sensor bsdf shape emitter");
    if (!only_child(root, "integrator"))
        fail(root, "<scene> needs an <integrator type=\"path\"> with its max_depth");
    if (!only_child(root, "sensor"))
        fail(root, "<scene> needs a <sensor type=\"perspective\">");
}

static void read_scene(Builder *builder, Node *root)
{
    Description *d = builder->description;
    check_root(root);
    for (Node *child = root->first; child; child = child->next) {
        if (strcmp(child->tag, "integrator") == 0)
            read_plugin(builder, child, integrators, COUNT(integrators));
        else if (strcmp(child->tag, "sensor") == 0)
            read_plugin(builder, child, sensors, COUNT(sensors));
        else if (strcmp(child->tag, "shape") == 0)
            read_plugin(builder, child, shapes, COUNT(shapes));
        else if (strcmp(child->tag, "emitter") == 0)
            read_plugin(builder, child, scene_emitters, COUNT(scene_emitters));
    }
    int used_materials = d->material_count;       /* the bsdfs that no shape uses are checked and left out */
    for (Node *child = root->first; child; child = child->next)
        if (strcmp(child->tag, "bsdf") == 0)
            read_bsdf(builder, child, &(int){0}, &(int){0});
    d->material_count = used_materials;
}

/* Squares of lengths are wanted, so that half the exponents of a double are for lengths. */
#define LONGEST 1e150

static void check_length(const char *file, int line, double length)
{
    if (!(fabs(length) <= LONGEST))
        die_at(file, line, "this reaches out to %.1g: %g is the longest length", fabs(length), LONGEST);
}

static void check_lengths(const Description *d, const char *file, int sensor_line)
{
    double low[3], high[3];
    for (int axis = 0; axis < 3; axis++)
        check_length(file, sensor_line, d->sensor.to_world.m[axis][3]);
    check_length(file, sensor_line, d->sensor.far_clip);
    for (int i = 0; i < d->shape_count; i++) {
        bounds_of_shape(d, &d->shapes[i], low, high);
        for (int axis = 0; axis < 3; axis++) {
            check_length(file, d->shapes[i].line, low[axis]);
            check_length(file, d->shapes[i].line, high[axis]);
        }
    }
    for (int i = 0; i < d->emitter_count; i++)
        for (int axis = 0; axis < 3; axis++)
            check_length(file, d->emitters[i].line, d->emitters[i].position[axis]);
}

Description *description_read(
    const char *file, Parameter *parameters, int parameter_count, const uint64_t size[2])
{
    SceneFile *scene = scene_file_open(file, parameters, parameter_count);
    Description *d = allocate(1, sizeof *d);
    *d = (Description){.sample_count = 4, .max_depth = -1, .rr_depth = 5, .hash = scene->hash};
    Builder builder = {.file = scene, .description = d, .default_material = MATERIAL_NONE, .size = size};
    read_scene(&builder, scene->root);
    check_lengths(d, file, only_child(scene->root, "sensor")->line);
    scene_file_close(scene);
    return d;
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
