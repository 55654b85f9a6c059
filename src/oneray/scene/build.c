/* From the elements of a scene file to a Description: each plugin by its own table (kinds.h), and here what holds
   others. */
#include "scene/hints.h"
#include "scene/xml.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const SceneFile *file;
    Description *description;
    int default_material;                         /* of shapes without a bsdf, once one needs it */
    const Node *environment;                      /* the one that Mitsuba allows */
    const uint64_t *size;                         /* that the image shall have, or NULL */
} Builder;

/* Which of the plugins the element's type means, or -1. */
static int plugin_of(const Node *node, const Plugin *const *plugins, int count)
{
    for (int i = 0; i < count; i++)
        if (plugins[i] && find_word(plugins[i]->types, attribute(node, "type")) >= 0)
            return i;
    return -1;
}

/* The same, or an error. */
static int find_plugin(const Node *node, const Plugin *const *plugins, int count)
{
    Text list = {0};
    int found = plugin_of(node, plugins, count);
    if (found >= 0)
        return found;
    for (int i = 0; i < count; i++)
        append_word(&list, plugins[i] ? plugins[i]->types : "");
    fail(node, "%s is not supported (%s)", describe(node), list.text);
}

/* Reads the files that an element names. */
static void load_files(Description *d, void *to, const Said *said)
{
    enum { MOST_MIB = 1 << 14 };
    for (int i = 0; said->fields[i].name; i++) {
        if (said->fields[i].kind != AS_FILE)
            continue;
        File *file = (File *)((char *)to + said->fields[i].offset);
        file->bytes = read_file(file->name, MOST_MIB, &said->place[i], &file->size);
        d->hash = hash_bytes(d->hash, file->bytes, file->size);
        PUSH(d->mesh_files, d->mesh_file_count, file->name);
    }
}

/* What a <ref> means, which must be of this tag; what is none means itself. */
static Node *meant_by(const Builder *builder, Node *node, const char *tag)
{
    if (strcmp(node->tag, "ref") != 0)
        return node;
    const char *id = attribute(node, "id");
    if (node->first)
        fail(node->first, "<%s> cannot stand in <ref>", node->first->tag);
    Node *found = find_id(builder->file, id);
    if (!found)
        fail(node, "<ref id=\"%.80s\"/>: nothing has this id", id);
    if (strcmp(found->tag, tag) != 0)
        fail(node, "<ref id=\"%.80s\"/>: that is a <%s>, and only a <%s> can be referred to", id, found->tag, tag);
    return found;
}

static int read_texture(Builder *builder, Node *node);

/* Reads the textures that stand for reflectances. */
static void load_textures(Builder *builder, void *to, const Said *said)
{
    for (const Field *field = said->fields; field->name; field++) {
        if (field->kind != AS_REFLECTANCE)
            continue;
        Reflectance *reflectance = (Reflectance *)(void *)((char *)to + field->offset);
        if (!reflectance->element)
            continue;
        reflectance->texture = read_texture(builder, meant_by(builder, reflectance->element, "texture"));
        TextureTraits traits = texture_traits(&builder->description->textures[reflectance->texture - 1]);
        memcpy(reflectance->most, traits.most, sizeof traits.most);
        memcpy(reflectance->least, traits.least, sizeof traits.least);
        reflectance->element = NULL;
    }
}

/* Fills `to`, the plugin's struct, with what the element says. */
static Said read_plugin(Builder *builder, const Node *node, const Plugin *plugin, const char *objects, void *to)
{
    Said said;
    read_fields(node, plugin->fields, objects, to, &said);
    said.triangles = &builder->description->mesh;
    load_files(builder->description, to, &said);
    load_textures(builder, to, &said);
    if (plugin->check)
        plugin->check(to, &said);
    return said;
}

/* The same for an element that can be of one type only. */
static void read_only(Builder *builder, const Node *node, const Plugin *plugin, const char *objects, void *to)
{
    find_plugin(node, &plugin, 1);
    read_plugin(builder, node, plugin, objects, to);
}

/* The only child with this tag, or NULL. */
static Node *only_child(const Node *node, const char *tag)
{
    Node *found = NULL;
    for (Node *child = node->first; child; child = child->next) {
        bool is = strcmp(child->tag, tag) == 0;
        if (is && found)
            fail(child, "a second <%s> in <%s>, the first is in line %d", tag, node->tag, found->line);
        found = is ? child : found;
    }
    return found;
}

#define PLUGIN(NAME, name, words) &name##_plugin,

static const Plugin *const textures[] = {[TEXTURE_NONE] = NULL, TEXTURES(PLUGIN)};

/* Its number: one that several materials refer to becomes one texture. */
static int read_texture(Builder *builder, Node *node)
{
    Description *d = builder->description;
    int kind = find_plugin(node, textures, COUNT(textures));
    Texture texture = {.kind = (TextureKind)kind, .line = node->line};
    if (node->state == READ)
        return node->front;
    read_plugin(builder, node, textures[kind], "", &texture.as);
    PUSH(d->textures, d->texture_count, texture);
    node->state = READ;
    return node->front = d->texture_count;
}

/* Materials. A bsdf that several shapes refer to becomes one material. */

static const Plugin twosided_plugin = {.types = "twosided"};
static const Plugin blend_plugin = {"blendbsdf", NULL, {
    {"weight", AS_FLOAT, offsetof(Blend, weight), "[0,1]", ""}}};

enum { TWOSIDED = MATERIAL_BLEND + 1 };
static const Plugin *const bsdfs[] = {
    MATERIALS(PLUGIN) [MATERIAL_BLEND] = &blend_plugin, [TWOSIDED] = &twosided_plugin};

static int add_material(Description *d, Material material)
{
    PUSH(d->materials, d->material_count, material);
    return d->material_count - 1;
}

static const Node *read_bsdf(Builder *builder, Node *node);

/* L16 weight is the share of the second bsdf; each side of the surface has its own blend. */
static void read_blend(Builder *builder, Node *node)
{
    Material blend = {.kind = MATERIAL_BLEND, .line = node->line};
    const Node *parts[2];
    int count = 0;
    Said said = read_plugin(builder, node, &blend_plugin, "<bsdf>, <ref>", &blend.as.blend);
    for (Node *child = node->first; child; child = child->next) {
        if (!is_among(child, "<bsdf>, <ref>"))
            continue;
        if (count == 2)
            fail(child, "<bsdf type=\"blendbsdf\"> has a third bsdf: nest another blendbsdf for three");
        parts[count++] = read_bsdf(builder, child);
    }
    if (count < 2)
        fail(node, "<bsdf type=\"blendbsdf\"> needs two bsdfs inside");
    if (!given(&said, "weight"))
        fail(node, "<bsdf type=\"blendbsdf\"> needs <float name=\"weight\" value=\"0.5\"/>, the second's share");
    blend.as.blend.first = parts[0]->front, blend.as.blend.second = parts[1]->front;
    node->front = add_material(builder->description, blend);
    blend.as.blend.first = parts[0]->back, blend.as.blend.second = parts[1]->back;
    if (parts[0]->back != MATERIAL_NONE || parts[1]->back != MATERIAL_NONE)
        node->back = add_material(builder->description, blend);
}

/* One nested bsdf is on both sides; of two, the first is on the side of the normal. */
static void read_twosided(Builder *builder, Node *node)
{
    const Node *sides[2];
    int count = 0;
    read_plugin(builder, node, &twosided_plugin, "<bsdf>, <ref>", NULL);
    for (Node *child = node->first; child; child = child->next) {
        if (count == 2)
            fail(child, "<bsdf type=\"twosided\"> has a third bsdf (one for both sides, or two)");
        sides[count++] = read_bsdf(builder, child);
        if (sides[count - 1]->back != MATERIAL_NONE)
            fail(child, "<bsdf type=\"twosided\"> cannot hold a bsdf that has a back side (twosided, dielectric)");
    }
    if (!count)
        fail(node, "<bsdf type=\"twosided\"> needs a bsdf inside (one for both sides, or two)");
    node->front = sides[0]->front;
    node->back = sides[count - 1]->front;
}

static void read_material(Builder *builder, Node *node)
{
    int kind = find_plugin(node, bsdfs, COUNT(bsdfs));
    Material material = {.kind = (MaterialKind)kind, .line = node->line};
    if (kind == MATERIAL_BLEND) {
        read_blend(builder, node);
    } else if (kind == TWOSIDED) {
        read_twosided(builder, node);
    } else {
        read_plugin(builder, node, bsdfs[kind], "", &material.as);
        node->front = add_material(builder->description, material);
        node->back = material_traits(&material).transmitted ? node->front : MATERIAL_NONE;
    }
}

/* This <bsdf>, or the one that a <ref> means, once its materials are read. */
static const Node *read_bsdf(Builder *builder, Node *node)
{
    Node *bsdf = meant_by(builder, node, "bsdf");
    if (bsdf->state == BEING_READ)
        fail(node, "the bsdf contains itself");
    if (bsdf->state == UNREAD) {
        bsdf->state = BEING_READ;
        bsdf->front = bsdf->back = MATERIAL_NONE;
        read_material(builder, bsdf);
        bsdf->state = READ;
    }
    return bsdf;
}

/* Lights and shapes. */

static const Plugin *const emitters[] = {EMITTERS(PLUGIN)};

/* Of a shape, or of the scene itself: -1. */
static int read_emitter(Builder *builder, const Node *node, int shape)
{
    Description *d = builder->description;
    int kind = shape < 0 ? find_plugin(node, emitters, COUNT(emitters)) : plugin_of(node, emitters, COUNT(emitters));
    Emitter light = {.kind = (EmitterKind)kind, .line = node->line, .shape = shape};
    LightFrom from = kind < 0 ? FROM_POINT : emitter_traits(&light).from;
    if (shape >= 0 && from != FROM_SHAPE)
        fail(node, "%s cannot stand in a <shape>: only area does", describe(node));
    if (shape < 0 && from == FROM_SHAPE)
        fail(node, "%s must stand in a <shape>, which is what shines", describe(node));
    read_plugin(builder, node, emitters[kind], "", &light.as);
    if (from == FROM_AROUND) {
        const Node *first = builder->environment;
        if (first)
            fail(node, "a second %s, the first is in line %d", describe(first), first->line);
        builder->environment = node;
    }
    PUSH(d->emitters, d->emitter_count, light);
    return d->emitter_count - 1;
}

#define SHAPE_PLUGIN(NAME, name, words) [SHAPE_##NAME] = &name##_plugin,
static const Plugin *const shapes[SHAPE_KINDS] = {FILE_SHAPES(SHAPE_PLUGIN)};

/* Mitsuba's surfaces without a bsdf are a diffuse of reflectance 0.5, and lights without a bsdf black. */
static void set_sides(Builder *builder, Node *node, Shape *shape)
{
    Node *bsdf = only_child(node, "bsdf"), *ref = only_child(node, "ref");
    if (bsdf && ref)
        fail(ref, "a second bsdf in <shape>, the first is in line %d", bsdf->line);
    shape->front = shape->back = MATERIAL_NONE;
    if (bsdf || ref) {
        const Node *material = read_bsdf(builder, bsdf ? bsdf : ref);
        shape->front = material->front;
        shape->back = material->back;
    } else if (!only_child(node, "emitter")) {
        if (builder->default_material == MATERIAL_NONE) {
            Material grey = {.kind = MATERIAL_DIFFUSE, .line = node->line, .as.diffuse = {{{.5, .5, .5}, {.5, .5, .5}, 0, NULL}}};
            builder->default_material = add_material(builder->description, grey);
        }
        shape->front = builder->default_material;
    }
}

static void read_shape(Builder *builder, Node *node)
{
    Description *d = builder->description;
    int kind = find_plugin(node, shapes, COUNT(shapes));
    Shape shape = {.kind = (ShapeKind)kind, .line = node->line, .emitter = -1};
    Said said = read_plugin(builder, node, shapes[kind], "<bsdf>, <ref>, <emitter>", &shape.as);
    Node *emitter = only_child(node, "emitter");
    set_sides(builder, node, &shape);
    if (emitter)
        shape.emitter = read_emitter(builder, emitter, d->shape_count);
    if (said.left_out) {
        warn("%s:%d: %s", node->file, node->line, said.left_out);
        d->emitter_count -= shape.emitter >= 0;
        return;
    }
    int bare = shape.kind == SHAPE_MESH ? shape.as.mesh.without_uv : 0;
    if (bare && (material_wants_uv(d, shape.front) || material_wants_uv(d, shape.back)))
        fail(node, "%d vertices of this mesh have no texture coordinates, which others have and its bsdf needs", bare);
    PUSH(d->shapes, d->shape_count, shape);
}

/* Sensor and integrator. */

static void path_check(void *plugin, Said *said)
{
    const Description *d = plugin;
    if (d->max_depth == 0)
        fail(given(said, "max_depth"), "\"max_depth\" 0 is a black image: -1 is without limit, 1 emission only");
}

static const Plugin path = {"path", path_check, {
    {"max_depth", AS_INTEGER, offsetof(Description, max_depth), "[-1,999999]", "-1"},
    {"rr_depth", AS_INTEGER, offsetof(Description, rr_depth), "[1,2147483647]", "5"},
    {"hide_emitters", AS_BOOLEAN, offsetof(Description, hide_emitters), NULL, "false"}}};
static const Plugin hdrfilm = {"hdrfilm", NULL, {
    {"width", AS_INTEGER, offsetof(Sensor, width), "[1,65536]", "768"},
    {"height", AS_INTEGER, offsetof(Sensor, height), "[1,65536]", "576"},
    {"pixel_format", AS_WORD, NOWHERE, "rgb", "rgb"},
    {"component_format", AS_WORD, NOWHERE, "float32", "float32"}}};
static const Plugin box = {.types = "box"};
static const Plugin independent = {"independent", NULL, {
    {"sample_count", AS_INTEGER, offsetof(Description, sample_count), "[1,2147483647]", "4"}}};
static const Plugin *const sensors[] = {SENSORS(PLUGIN)};

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

static void read_film(Builder *builder, const Node *node, Sensor *sensor)
{
    read_only(builder, node, &hdrfilm, "<rfilter>", sensor);
    if (builder->size)
        set_size(sensor, builder->size);
    if ((int64_t)sensor->width * sensor->height > 1 << 28)
        fail(node, "%d x %d pixels are more than 2^28", sensor->width, sensor->height);
    const Node *rfilter = only_child(node, "rfilter");
    if (!rfilter)
        fail(node, "<film> needs <rfilter type=\"box\"/> (Mitsuba's default, gaussian, is not supported)");
    read_only(builder, rfilter, &box, "", NULL);
}

static void read_sensor(Builder *builder, const Node *node)
{
    Sensor *sensor = &builder->description->sensor;
    const Node *film = only_child(node, "film"), *sampler = only_child(node, "sampler");
    int kind = find_plugin(node, sensors, COUNT(sensors));
    sensor->kind = (SensorKind)kind;
    sensor->line = node->line;
    read_plugin(builder, node, sensors[kind], "<film>, <sampler>", &sensor->as);
    if (!film)
        fail(node, "<sensor> needs a <film type=\"hdrfilm\"> with <rfilter type=\"box\"/>");
    read_film(builder, film, sensor);
    if (sampler)
        read_only(builder, sampler, &independent, "", builder->description);
}

/* The scene. */

static void check_root(const Node *root)
{
    int major, minor, patch;
    char more;
    Said said;
    const char *version = attribute(root, "version");
    if (strcmp(root->tag, "scene") != 0)
        fail(root, "the outermost element must be <scene version=\"3.0.0\">, not <%s>", root->tag);
    if (strspn(version, "0123456789.") != strlen(version)
        || sscanf(version, "%2d.%4d.%4d%c", &major, &minor, &patch, &more) != 3 || major != 3)
        fail(root, "scene version \"%.80s\" is not supported (3.0.0, or another 3.x.y)", version);
    read_fields(root, &(Field){0}, "<default>, <integrator>, <sensor>, <bsdf>, <texture>, <shape>, <emitter>", NULL, &said);
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
            read_only(builder, child, &path, "", d);
        else if (strcmp(child->tag, "sensor") == 0)
            read_sensor(builder, child);
        else if (strcmp(child->tag, "shape") == 0)
            read_shape(builder, child);
        else if (strcmp(child->tag, "emitter") == 0)
            read_emitter(builder, child, -1);
    }
    int used_materials = d->material_count;       /* what no shape uses is checked and left out */
    for (Node *child = root->first; child; child = child->next)
        if (strcmp(child->tag, "bsdf") == 0)
            read_bsdf(builder, child);
        else if (strcmp(child->tag, "texture") == 0)
            read_texture(builder, child);
    d->material_count = used_materials;
}

/* Squares of lengths are wanted, so that half the exponents of a double are for lengths. */
#define LONGEST 1e150

static void check_length(const char *file, int line, double length)
{
    if (!(fabs(length) <= LONGEST))
        die_at(file, line, "this reaches out to %.1g: %g is the longest length", fabs(length), LONGEST);
}

static void check_box(const char *file, int line, const double low[3], const double high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        check_length(file, line, low[axis]);
        check_length(file, line, high[axis]);
    }
}

static void check_lengths(const Description *d, const char *file)
{
    SensorTraits sensor = sensor_traits(&d->sensor);
    check_box(file, d->sensor.line, sensor.origin, sensor.origin);
    check_length(file, d->sensor.line, sensor.farthest);
    for (int i = 0; i < d->shape_count; i++) {
        Extent extent = shape_extent(&d->shapes[i]);
        check_box(file, d->shapes[i].line, extent.low, extent.high);
    }
    for (int i = 0; i < d->emitter_count; i++) {
        const double *position = emitter_traits(&d->emitters[i]).position;
        if (position)
            check_box(file, d->emitters[i].line, position, position);
    }
}

Description *description_read(const char *file, const Parameter *given, int count, const uint64_t size[2])
{
    SceneFile *scene = scene_file_open(file, given, count);
    Description *d = allocate(1, sizeof *d);
    *d = (Description){.sample_count = 4, .hash = scene->hash};
    Builder builder = {.file = scene, .description = d, .default_material = MATERIAL_NONE, .size = size};
    read_scene(&builder, scene->root);
    check_lengths(d, file);
    scene_file_close(scene);
    d->mesh_tree = mesh_tree_build(&d->mesh);
    d->hinted = scene_hints(d, file);
    return d;
}
