/* From the elements of a scene file to a Description: each plugin by its own table (kinds.h), and here what holds
   others. */
#include "scene/hints.h"
#include "scene/xml.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const SceneFile *file;
    Description *description;
    int default_material;                         /* of shapes without a bsdf, once one needs it */
    const Node *environment;                      /* the one that Mitsuba allows */
    const char *sensor;                           /* that is asked for, by id or number, or NULL */
    const uint64_t *size;                         /* that the image shall have, or NULL */
    Shape *shape;                                 /* that is being read, with what its element says */
    Said *said;
} Builder;

/* An element, and what reads it. */
typedef struct {
    Builder *builder;
    Node *node;
    void (*read)(Builder *builder, Node *node);
} Step;

static void take_step(void *step)
{
    const Step *s = step;
    s->read(s->builder, s->node);
}

/* Is the element right? What is wrong with it is said, and reading goes on. An element that is not there is right. */
static bool reads(Builder *builder, void (*read)(Builder *, Node *), Node *node)
{
    Step step = {builder, node, read};
    return !node || (!node->wrong && attempt(take_step, &step));
}

/* The same of one that many may refer to: what is wrong with it is said once. */
static void read_once(Builder *builder, void (*read)(Builder *, Node *), Node *node)
{
    if (node->state == UNREAD) {
        node->state = BEING_READ;
        node->state = reads(builder, read, node) ? READ : WRONG;
    }
    if (node->state == WRONG)
        give_up();
}

/* Which of the plugins the element's type means, or -1. */
static int plugin_of(const Node *node, const Plugin *const *plugins, int count)
{
    if (node->wrong)
        give_up();
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
        file->named = said->place[i];
        file->bytes = read_file(file->name, MOST_MIB, &file->named, &file->size);
        d->hash = hash_bytes(d->hash, file->bytes, file->size);
        PUSH(d->files, d->file_count, file->name);
    }
}

/* What a <ref> means, which must be one of these elements, "<bsdf>, <emitter>"; what is none means itself. */
static Node *meant_by(const Builder *builder, Node *node, const char *elements)
{
    if (node->wrong)
        give_up();
    if (strcmp(node->tag, "ref") != 0)
        return node;
    const char *id = attribute(node, "id");
    if (node->first)
        fail(node->first, "<%s> cannot stand in <ref>", node->first->tag);
    Node *found = find_id(builder->file, id);
    if (!found)
        fail(node, "<ref id=\"%.80s\"/>: nothing has this id", id);
    if (!is_among(found, elements))
        fail(node, "<ref id=\"%.80s\"/>: that is a <%s>, and here only %s can be referred to", id, found->tag, elements);
    return found;
}

/* The first of these elements that is of this tag, or a <ref> to what is; NULL: there is none. */
static Node *first_part(const Builder *builder, Node *elements, const char *tag)
{
    for (Node *one = elements; one; one = one->next) {
        const Node *meant = strcmp(one->tag, "ref") ? one : one->wrong ? NULL : find_id(builder->file, attribute(one, "id"));
        if (meant && strcmp(meant->tag, tag) == 0)
            return one;
    }
    return NULL;
}

/* The only child of that kind. */
static Node *only_part(const Builder *builder, const Node *node, const char *tag)
{
    Node *part = first_part(builder, node->first, tag);
    const Node *second = part ? first_part(builder, part->next, tag) : NULL;
    if (second)
        fail(second, "a second <%s> in <%s>, the first is in line %d", tag, node->tag, part->line);
    return part;
}

/* Do all its <ref>s mean such elements? */
static void check_refs(const Builder *builder, Node *node, const char *elements)
{
    for (Node *child = node->first; child; child = child->next)
        if (strcmp(child->tag, "ref") == 0)
            meant_by(builder, child, elements);
}

static int read_texture(Builder *builder, Node *node);

/* The texture as a share has it. Mitsuba 3.9.1's checkerboard has the mean of a colour's channels there, and its colours
   the other way round than as a reflectance. */
static int share_of_texture(Description *d, int number)
{
    Texture texture = d->textures[number - 1];
    Checkerboard *board = &texture.as.checkerboard;
    if (texture.kind != TEXTURE_CHECKERBOARD)
        return number;
    const double third[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
    double mean[2] = {dot(board->color0, third), dot(board->color1, third)};
    for (int c = 0; c < 3; c++)
        board->color0[c] = mean[1], board->color1[c] = mean[0];
    PUSH(d->textures, d->texture_count, texture);
    return d->texture_count;
}

/* Reads the textures that stand for reflectances and shares. */
static void load_textures(Builder *builder, void *to, const Said *said)
{
    Description *d = builder->description;
    for (const Field *field = said->fields; field->name; field++) {
        if (field->kind != AS_REFLECTANCE && field->kind != AS_SHARE)
            continue;
        Reflectance *r = (Reflectance *)(void *)((char *)to + field->offset);
        if (!r->element)
            continue;
        r->texture = read_texture(builder, meant_by(builder, r->element, "<texture>"));
        if (field->kind == AS_SHARE)
            r->texture = share_of_texture(d, r->texture);
        TextureTraits traits = texture_traits(&d->textures[r->texture - 1]);
        memcpy(r->most, traits.most, sizeof traits.most);
        memcpy(r->least, traits.least, sizeof traits.least);
        for (int c = 0; c < 3; c++)
            if (r->least[c] < 0 || r->most[c] > 1)
                fail(r->element, "%s: %s must be in [0,1], and this picture has %g", traits.image->file,
                     field->kind == AS_SHARE ? field->name : "a reflectance", r->least[c] < 0 ? r->least[c] : r->most[c]);
        r->element = NULL;
    }
}

/* Fills `to`, the plugin's struct, with what the element says. */
static Said read_plugin(Builder *builder, const Node *node, const Plugin *plugin, const char *objects, void *to)
{
    Said said;
    read_fields(node, plugin->fields, objects, to, &said);
    said.triangles = &builder->description->mesh;
    said.images = &builder->description->images;
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

/* The first of these elements with this tag, or NULL. */
static Node *first_of(Node *elements, const char *tag)
{
    while (elements && strcmp(elements->tag, tag) != 0)
        elements = elements->next;
    return elements;
}

/* The only child with this tag, or NULL. */
static Node *only_child(const Node *node, const char *tag)
{
    Node *found = first_of(node->first, tag), *second = found ? first_of(found->next, tag) : NULL;
    if (second)
        fail(second, "a second <%s> in <%s>, the first is in line %d", tag, node->tag, found->line);
    return found;
}

#define PLUGIN(NAME, name, words) &name##_plugin,

static const Plugin *const textures[] = {[TEXTURE_NONE] = NULL, TEXTURES(PLUGIN)};

/* Its number: one that several materials refer to becomes one texture. */
static void add_texture(Builder *builder, Node *node)
{
    Description *d = builder->description;
    int kind = find_plugin(node, textures, COUNT(textures));
    Texture texture = {.kind = (TextureKind)kind, .line = node->line};
    read_plugin(builder, node, textures[kind], "", &texture.as);
    PUSH(d->textures, d->texture_count, texture);
    node->front = d->texture_count;
}

static int read_texture(Builder *builder, Node *node)
{
    read_once(builder, add_texture, node);
    return node->front;
}

/* Materials. A bsdf that several shapes refer to becomes one material. */

static const Plugin twosided_plugin = {.types = "twosided"};
static const Plugin blend_plugin = {"blendbsdf", NULL, {
    {"weight", AS_SHARE, offsetof(Blend, weight), "[0,1]", ""}}};

/* What is not opaque lets light pass. */
static const Plugin mask_plugin = {"mask", NULL, {
    {"opacity", AS_SHARE, offsetof(Blend, weight), "[0,1]", "0.5"}}};

enum { TWOSIDED = MATERIAL_BLEND + 1, MASK, BUMPMAP, NORMALMAP };
static const Plugin *const bsdfs[] = {
    MATERIALS(PLUGIN) [MATERIAL_BLEND] = &blend_plugin, [TWOSIDED] = &twosided_plugin, [MASK] = &mask_plugin,
    [BUMPMAP] = &bumpmap_plugin, [NORMALMAP] = &normalmap_plugin};

static int add_material(Description *d, Material material)
{
    PUSH(d->materials, d->material_count, material);
    return d->material_count - 1;
}

static const Node *read_bsdf(Builder *builder, Node *node);

static int textured_weights(const Description *d, int index)
{
    if (index == MATERIAL_NONE || d->materials[index].kind != MATERIAL_BLEND)
        return 0;
    const Blend *blend = &d->materials[index].as.blend;
    int first = textured_weights(d, blend->first), second = textured_weights(d, blend->second);
    return (blend->weight.texture != 0) + (first > second ? first : second);
}

static int add_blend(Description *d, Material blend, int first, int second)
{
    blend.as.blend.first = first, blend.as.blend.second = second;
    int index = add_material(d, blend);
    if (textured_weights(d, index) > MOST_WEIGHTS)
        fail(&blend, "textures give the weights of more than %d blends, one in another", MOST_WEIGHTS);
    return index;
}

/* L16 weight is the share of the second bsdf; each side of the surface has its own blend. */
static void read_blend(Builder *builder, Node *node)
{
    Material blend = {.kind = MATERIAL_BLEND, .file = node->file, .line = node->line};
    const Node *parts[2];
    int count = 0;
    Said said = read_plugin(builder, node, &blend_plugin, "<bsdf>, <ref>", &blend.as.blend);
    for (Node *child = node->first; child; child = child->next) {
        if (!is_among(child, "<bsdf>, <ref>") || is_share(child, blend_plugin.fields))
            continue;
        if (count == 2)
            fail(child, "<bsdf type=\"blendbsdf\"> has a third bsdf: nest another blendbsdf for three");
        parts[count++] = read_bsdf(builder, child);
    }
    if (count < 2)
        fail(node, "<bsdf type=\"blendbsdf\"> needs two bsdfs inside");
    if (!given(&said, "weight"))
        fail(node, "<bsdf type=\"blendbsdf\"> needs <float name=\"weight\" value=\"0.5\"/>, the second's share");
    node->front = add_blend(builder->description, blend, parts[0]->front, parts[1]->front);
    if (parts[0]->back != MATERIAL_NONE || parts[1]->back != MATERIAL_NONE)
        node->back = add_blend(builder->description, blend, parts[0]->back, parts[1]->back);
}

static void read_mask(Builder *builder, Node *node)
{
    Material mask = {.kind = MATERIAL_BLEND, .file = node->file, .line = node->line};
    Material hole = {.kind = MATERIAL_NULL, .file = node->file, .line = node->line};
    Node *inner = NULL;
    int count = 0;
    read_plugin(builder, node, &mask_plugin, "<bsdf>, <ref>", &mask.as.blend);
    for (Node *child = node->first; child; child = child->next)
        if (is_among(child, "<bsdf>, <ref>") && !is_share(child, mask_plugin.fields))
            inner = child, count++;
    if (count != 1)
        fail(node, "<bsdf type=\"mask\"> needs one bsdf inside");
    null_check(&hole.as.null, NULL);
    const Node *opaque = read_bsdf(builder, inner);
    int passed = add_material(builder->description, hole);
    node->front = add_blend(builder->description, mask, passed, opaque->front);
    node->back = add_blend(builder->description, mask, passed, opaque->back);
}

/* The material, or each part of a blend, with this bump; or, without one, with its own as it is behind a twosided. */
static int bumped(Builder *builder, const Node *node, int index, const Bump *bump)
{
    Description *d = builder->description;
    if (index == MATERIAL_NONE)
        return MATERIAL_NONE;
    Material material = d->materials[index];
    if (material.kind == MATERIAL_BLEND) {
        material.as.blend.first = bumped(builder, node, material.as.blend.first, bump);
        material.as.blend.second = bumped(builder, node, material.as.blend.second, bump);
    } else if (!bump) {
        material.bump.turned = true;
    } else {
        if (material.bump.texture)
            fail(node, "a bumpmap or normalmap cannot stand in another");
        if (!bump->is_normal_map && material_traits(&material).anisotropic)
            fail(node, "an anisotropic bsdf in a bumpmap is not supported: Mitsuba mixes up its directions");
        material.bump = *bump;
    }
    return add_material(d, material);
}

static bool has_bumps(const Description *d, int index)
{
    if (index == MATERIAL_NONE)
        return false;
    const Material *m = &d->materials[index];
    return m->kind == MATERIAL_BLEND ? has_bumps(d, m->as.blend.first) || has_bumps(d, m->as.blend.second) : m->bump.texture;
}

/* The picture of a bump: bilinear, or it has no slope. */
static int bump_texture(Builder *builder, Node *node, const Bump *bump)
{
    int number = read_texture(builder, meant_by(builder, node, "<texture>"));
    const Texture *texture = &builder->description->textures[number - 1];
    if (texture->kind != TEXTURE_BITMAP)
        fail(node, "the texture of a bumpmap or normalmap must be a bitmap");
    if (!bump->is_normal_map && texture->as.bitmap.wrap_mode == find_word("repeat, mirror, clamp", "mirror"))
        fail(node, "\"wrap_mode\" = \"mirror\" is not supported for a bumpmap (repeat, clamp)");
    return number;
}

static void read_bump(Builder *builder, Node *node)
{
    bool by_normals = strcmp(attribute(node, "type"), "normalmap") == 0;
    Bump bump = {.texture = 0};
    Node *inner = NULL, *picture = NULL;
    read_plugin(builder, node, by_normals ? &normalmap_plugin : &bumpmap_plugin, "<bsdf>, <ref>, <texture>", &bump);
    for (Node *child = node->first; child; child = child->next) {
        if (!is_among(child, "<bsdf>, <ref>, <texture>"))
            continue;
        const Node *meant = strcmp(child->tag, "ref") ? child : find_id(builder->file, attribute(child, "id"));
        Node **part = meant && strcmp(meant->tag, "texture") == 0 ? &picture : &inner;
        if (*part)
            fail(child, "%s has a second <%s>", describe(node), part == &inner ? "bsdf" : "texture");
        *part = child;
    }
    if (!inner || !picture)
        fail(node, "%s needs a texture and a bsdf inside", describe(node));
    const char *name = attribute(picture, "name");
    if (by_normals && (!name || strcmp(name, "normalmap") != 0))
        fail(picture, "the texture of a normalmap must have name=\"normalmap\"");
    bump.texture = bump_texture(builder, picture, &bump);
    const Node *bsdf = read_bsdf(builder, inner);
    node->front = bumped(builder, node, bsdf->front, &bump);
    node->back = bumped(builder, node, bsdf->back, &bump);
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
    if (has_bumps(builder->description, node->back))
        node->back = bumped(builder, node, node->back, NULL);
}

static void read_material(Builder *builder, Node *node)
{
    int kind = find_plugin(node, bsdfs, COUNT(bsdfs));
    Material material = {.kind = (MaterialKind)kind, .file = node->file, .line = node->line};
    node->front = node->back = MATERIAL_NONE;
    if (kind == MATERIAL_BLEND) {
        read_blend(builder, node);
    } else if (kind == TWOSIDED) {
        read_twosided(builder, node);
    } else if (kind == MASK) {
        read_mask(builder, node);
    } else if (kind == BUMPMAP || kind == NORMALMAP) {
        read_bump(builder, node);
    } else {
        read_plugin(builder, node, bsdfs[kind], "", &material.as);
        node->front = add_material(builder->description, material);
        node->back = material_traits(&material).transmitted ? node->front : MATERIAL_NONE;
    }
}

/* This <bsdf>, or the one that a <ref> means, once its materials are read. */
static const Node *read_bsdf(Builder *builder, Node *node)
{
    Node *bsdf = meant_by(builder, node, "<bsdf>");
    if (bsdf->state == BEING_READ)
        fail(node, "the bsdf contains itself");
    read_once(builder, read_material, bsdf);
    return bsdf;
}

/* Media. */

static const Plugin *const media[] = {MEDIA(PLUGIN)};
static const Plugin *const phases[] = {&isotropic_plugin, &hg_plugin};

static void read_phase(Builder *builder, Node *node)
{
    Medium *medium = &builder->description->media[builder->description->medium_count - 1];
    const Plugin *plugin = phases[find_plugin(node, phases, COUNT(phases))];
    read_plugin(builder, node, plugin, "", &medium->phase);
}

static void add_medium(Builder *builder, Node *node)
{
    Description *d = builder->description;
    int kind = find_plugin(node, media, COUNT(media));
    Medium medium = {.kind = (MediumKind)kind, .file = node->file, .line = node->line};
    Node *phase = only_part(builder, node, "phase");
    read_plugin(builder, node, media[kind], "<phase>, <ref>", &medium.as);
    check_refs(builder, node, "<phase>");
    PUSH(d->media, d->medium_count, medium);
    node->front = d->medium_count;
    if (phase)
        read_phase(builder, meant_by(builder, phase, "<phase>"));
}

/* The number of this <medium>, or of the one that a <ref> means. */
static int read_medium(Builder *builder, Node *node)
{
    Node *medium = meant_by(builder, node, "<medium>");
    read_once(builder, add_medium, medium);
    return medium->front;
}

/* Lights and shapes. */

static const Plugin *const emitters[] = {EMITTERS(PLUGIN)};

/* Of a shape, or of the scene itself: -1. */
static int read_emitter(Builder *builder, Node *node, int shape)
{
    Description *d = builder->description;
    int kind = shape < 0 ? find_plugin(node, emitters, COUNT(emitters)) : plugin_of(node, emitters, COUNT(emitters));
    Emitter light = {.kind = (EmitterKind)kind, .file = node->file, .line = node->line, .shape = shape};
    LightFrom from = kind < 0 ? FROM_POINT : emitter_traits(&light).from;
    if (shape >= 0 && from != FROM_SHAPE)
        fail(node, "%s cannot stand in a <shape>: only area does", describe(node));
    if (shape < 0 && from == FROM_SHAPE)
        fail(node, "%s must stand in a <shape>, which is what shines", describe(node));
    read_plugin(builder, node, emitters[kind], "<medium>, <ref>", &light.as);
    check_refs(builder, node, "<medium>");
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
static void read_sides(Builder *builder, Node *node)
{
    Shape *shape = builder->shape;
    Node *bsdf = only_part(builder, node, "bsdf");
    shape->front = shape->back = MATERIAL_NONE;
    check_refs(builder, node, "<bsdf>, <emitter>, <medium>");
    if (bsdf) {
        const Node *material = read_bsdf(builder, bsdf);
        shape->front = material->front;
        shape->back = material->back;
    } else if (!first_part(builder, node->first, "emitter")) {
        if (builder->default_material == MATERIAL_NONE) {
            Material grey = {.kind = MATERIAL_DIFFUSE, .file = node->file, .line = node->line, .as.diffuse = {{{.5, .5, .5}, {.5, .5, .5}, 0, NULL}}};
            builder->default_material = add_material(builder->description, grey);
        }
        shape->front = builder->default_material;
    }
}

static void read_form(Builder *builder, Node *node)
{
    int kind = find_plugin(node, shapes, COUNT(shapes));
    builder->shape->kind = (ShapeKind)kind;
    *builder->said = read_plugin(builder, node, shapes[kind], "<bsdf>, <ref>, <emitter>, <medium>", &builder->shape->as);
}

/* Of a shape that names one of the two the other is none. */
static void read_media(Builder *builder, Node *node)
{
    int side[2] = {MEDIUM_GOES_ON, MEDIUM_GOES_ON};
    for (Node *part = first_part(builder, node->first, "medium"); part; part = first_part(builder, part->next, "medium")) {
        const char *name = attribute(part, "name");
        int which = find_word("exterior, interior", name ? name : "");
        if (which < 0)
            fail(part, "a <%s> to a medium in <shape> needs name=\"interior\" or name=\"exterior\", the side of the shape", part->tag);
        if (side[which] != MEDIUM_GOES_ON)
            fail(part, "a second medium of the %s of <shape>", name);
        side[which] = read_medium(builder, part);
    }
    bool boundary = side[0] != side[1];
    builder->shape->exterior = boundary && side[0] < 0 ? 0 : side[0];
    builder->shape->interior = boundary && side[1] < 0 ? 0 : side[1];
}

static void read_shine(Builder *builder, Node *node)
{
    Node *part = only_part(builder, node, "emitter");
    Node *emitter = part ? meant_by(builder, part, "<emitter>") : NULL;
    if (emitter && emitter->state == READ)
        fail(part, "<ref id=\"%.80s\"/>: this emitter is that of another shape, and each needs its own", attribute(part, "id"));
    if (!emitter)
        return;
    emitter->state = READ;
    builder->shape->emitter = read_emitter(builder, emitter, builder->description->shape_count);
}

static void read_shape(Builder *builder, Node *node)
{
    Description *d = builder->description;
    Shape shape = {.file = node->file, .line = node->line, .emitter = -1};
    Said said;
    builder->shape = &shape;
    builder->said = &said;
    bool right = reads(builder, read_form, node);
    right &= reads(builder, read_sides, node);
    right &= reads(builder, read_media, node);
    right &= reads(builder, read_shine, node);
    if (!right)
        give_up();
    if (said.left_out) {
        note(node, "%s", said.left_out);
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
    Description *d = plugin;
    d->passing = find_word("volpath, volpathmis, prbvolpath, volpath_simple", said->type) >= 0;
    if (d->max_depth == 0)
        fail(given(said, "max_depth"), "\"max_depth\" 0 is a black image: -1 is without limit, 1 emission only");
    if (find_word("photonmap, ppm, sppm", said->type) >= 0)
        note(said, "<integrator type=\"%s\"> is rendered as path, whose mean its pictures approach", said->type);
    else if (strcmp(said->type, "ptracer") == 0)
        note(said, "<integrator type=\"ptracer\"> is rendered as path, which has the same mean, and what mirrors and "
             "glass show besides");
    else if (find_word("path, volpath", said->type) < 0)
        note(said, "<integrator type=\"%s\"> is rendered as %s, which has the same mean", said->type,
            d->passing ? "volpath" : "path");
}

static void direct_check(void *plugin, Said *said)
{
    Description *d = plugin;
    const Place *samples = given(said, "shading_samples");
    if (samples && (given(said, "emitter_samples") || given(said, "bsdf_samples")))
        fail(samples, "\"shading_samples\" is \"emitter_samples\" and \"bsdf_samples\": write it or these");
    d->max_depth = 2;
    d->rr_depth = 5;
    if (strcmp(said->type, "direct") != 0)
        note(said, "<integrator type=\"%s\"> is rendered as direct, which has the same mean", said->type);
}

#define SAMPLING_FIELDS                                                                                      \
    {"hide_emitters", AS_BOOLEAN, offsetof(Description, hide_emitters), NULL, "false"},                      \
    {"block_size", AS_INTEGER, LEFT_OUT, "[0,2147483647]", "0"},                                             \
    {"samples_per_pass", AS_INTEGER, LEFT_OUT, "[-1,2147483647]", "-1"},                                     \
    {"timeout", AS_FLOAT, LEFT_OUT, "(-inf,inf)", "-1"}

static const Plugin path = {"path, volpath, volpathmis, prb, prbvolpath", path_check, {
    {"max_depth", AS_INTEGER, offsetof(Description, max_depth), "[-1,999999]", "-1"},
    {"rr_depth", AS_INTEGER, offsetof(Description, rr_depth), "[1,2147483647]", "5"},
    {"use_spectral_mis", AS_BOOLEAN, LEFT_OUT, NULL, "true"},
    {"strict_normals", AS_BOOLEAN, offsetof(Description, strict_normals), NULL, "false"},
    SAMPLING_FIELDS}};
/* Their own properties say how the same integral is estimated. */
static const Plugin other_paths = {
    "bdpt, erpt, mlt, pssmlt, photonmap, ppm, sppm, ptracer, volpath_simple, prb_basic, prb_projective, prb_reparam",
    path_check, {
    {"max_depth", AS_INTEGER, offsetof(Description, max_depth), "[-1,999999]", "-1"},
    {"rr_depth", AS_INTEGER, offsetof(Description, rr_depth), "[1,2147483647]", "5"},
    {"strict_normals", AS_BOOLEAN, offsetof(Description, strict_normals), NULL, "false"},
    {"hide_emitters", AS_BOOLEAN, offsetof(Description, hide_emitters), NULL, "false"},
    {"*", AS_ANYTHING, LEFT_OUT, NULL, ""}}};
static const Plugin other_direct = {"direct_projective, direct_reparam", direct_check, {
    {"hide_emitters", AS_BOOLEAN, offsetof(Description, hide_emitters), NULL, "false"},
    {"*", AS_ANYTHING, LEFT_OUT, NULL, ""}}};
static const Plugin direct = {"direct", direct_check, {
    {"shading_samples", AS_INTEGER, LEFT_OUT, "[1,2147483647]", "1"},
    {"emitter_samples", AS_INTEGER, LEFT_OUT, "[1,2147483647]", "1"},
    {"bsdf_samples", AS_INTEGER, LEFT_OUT, "[1,2147483647]", "1"},
    {"strict_normals", AS_BOOLEAN, offsetof(Description, strict_normals), NULL, "false"},
    SAMPLING_FIELDS}};
static const Plugin around = {"aov, moment, adaptive", NULL, { /* an integrator, whose picture is the mean */
    {"aovs", AS_STRING, LEFT_OUT, NULL, ""},
    {"block_size", AS_INTEGER, LEFT_OUT, "[0,2147483647]", "0"},
    {"samples_per_pass", AS_INTEGER, LEFT_OUT, "[-1,2147483647]", "-1"},
    {"timeout", AS_FLOAT, LEFT_OUT, "(-inf,inf)", "-1"}}};
static const Plugin *const integrators[] = {&path, &direct, &other_paths, &other_direct, &around};
static const Plugin hdrfilm = {"hdrfilm, ldrfilm", NULL, {
    {"width", AS_INTEGER, offsetof(Frame, film_width), "[1,65536]", "768"},
    {"height", AS_INTEGER, offsetof(Frame, film_height), "[1,65536]", "576"},
    {"crop_offset_x", AS_INTEGER, offsetof(Frame, x), "[0,65535]", "0"},
    {"crop_offset_y", AS_INTEGER, offsetof(Frame, y), "[0,65535]", "0"},
    {"crop_width", AS_INTEGER, offsetof(Frame, width), "[1,65536]", ""},
    {"crop_height", AS_INTEGER, offsetof(Frame, height), "[1,65536]", ""},
    {"pixel_format", AS_WORD, NOWHERE, "rgb, rgba, luminance, luminance_alpha, xyz, xyza", "rgb"},
    {"component_format", AS_WORD, NOWHERE, "float32, float16, uint32", "float32"},
    {"file_format", AS_STRING, LEFT_OUT, NULL, ""},
    {"banner", AS_BOOLEAN, LEFT_OUT, NULL, "false"},
    {"compensate", AS_BOOLEAN, LEFT_OUT, NULL, "false"},
    {"sample_border", AS_BOOLEAN, offsetof(Frame, sample_border), NULL, "false"},
    {"attach_log", AS_BOOLEAN, LEFT_OUT, NULL, "false"},
    {"filename", AS_STRING, LEFT_OUT, NULL, ""},
    {"tonemap_method", AS_STRING, LEFT_OUT, NULL, ""},
    {"key", AS_FLOAT, LEFT_OUT, "(-inf,inf)", ""},
    {"burn", AS_FLOAT, LEFT_OUT, "(-inf,inf)", ""},
    {"gamma", AS_FLOAT, LEFT_OUT, "(-inf,inf)", ""},
    {"exposure", AS_FLOAT, LEFT_OUT, "(-inf,inf)", ""}}};
static const Plugin independent = {
    "independent, stratified, multijitter, orthogonal, ldsampler, halton, hammersley, sobol", NULL, {
    {"sample_count", AS_INTEGER, offsetof(Description, sample_count), "[1,2147483647]", "4"},
    {"seed", AS_INTEGER, LEFT_OUT, "[0,2147483647]", "0"},
    {"jitter", AS_BOOLEAN, LEFT_OUT, NULL, "true"},
    {"strength", AS_INTEGER, LEFT_OUT, "[0,2147483647]", "2"},
    {"dimension", AS_INTEGER, LEFT_OUT, "[0,2147483647]", "4"},
    {"scramble", AS_INTEGER, LEFT_OUT, "[-1,2147483647]", "-1"}}};
static const Plugin *const sensors[] = {SENSORS(PLUGIN)};
static const Plugin *const filters[] = {FILTERS(PLUGIN)};

static void read_integrator(Builder *builder, Node *node)
{
    const Plugin *plugin = integrators[find_plugin(node, integrators, COUNT(integrators))];
    Node *inner = plugin == &around ? only_child(node, "integrator") : NULL;
    bool right = reads(builder, read_integrator, inner);
    read_plugin(builder, node, plugin, plugin == &around ? "<integrator>" : "", builder->description);
    if (plugin == &around && !inner)
        fail(node, "%s needs an <integrator type=\"path\"> inside, whose picture it renders", describe(node));
    if (!right)
        give_up();
    if (plugin == &around)
        note(node, "<integrator type=\"%s\"> is rendered as what is inside: the picture has its mean alone",
            attribute(node, "type"));
}

static double derived(double side) { return fmin(fmax(rint(side), 1), 1 << 28); }

/* Another size; with one of the two the image keeps its shape. */
static void set_size(int *wide, int *high, const uint64_t size[2])
{
    double width = (double)size[0], height = (double)size[1], shape = (double)*wide / *high;
    if (width > 0 || height > 0) {
        *wide = (int)(width > 0 ? width : derived(height * shape));
        *high = (int)(height > 0 ? height : derived(width / shape));
    }
}

/* Another size of a part of the film, and with it of all of the film, where all stay whole numbers of pixels. */
static void set_crop_size(const Node *node, Frame *frame, const uint64_t size[2])
{
    int *const along[2][3] = {{&frame->film_width, &frame->x, &frame->width}, {&frame->film_height, &frame->y, &frame->height}};
    int64_t before[2] = {frame->width, frame->height};
    set_size(&frame->width, &frame->height, size);
    int64_t after[2] = {frame->width, frame->height};
    for (int axis = 0; axis < 2; axis++)
        for (int i = 0; i < 2; i++) {
            int64_t scaled = *along[axis][i] * after[axis];
            if (scaled % before[axis] || scaled / before[axis] > INT_MAX)
                fail(node, "--width and --height do not go with this crop window of the film, whose edges would be within pixels");
            *along[axis][i] = (int)(scaled / before[axis]);
        }
}

/* The part of the film that is rendered: all of it, if the file does not say. */
static void set_crop(const Node *node, Frame *frame)
{
    frame->width = frame->width ? frame->width : frame->film_width;
    frame->height = frame->height ? frame->height : frame->film_height;
    if (frame->x > frame->film_width - frame->width || frame->y > frame->film_height - frame->height)
        fail(node, "the crop window, %d x %d pixels from (%d, %d) on, is not within the film, %d x %d pixels",
             frame->width, frame->height, frame->x, frame->y, frame->film_width, frame->film_height);
}

static void read_film(Builder *builder, Node *node)
{
    read_only(builder, node, &hdrfilm, "<rfilter>, <ref>", &builder->description->sensor.frame);
    check_refs(builder, node, "<rfilter>");
    if (strcmp(attribute(node, "type"), "ldrfilm") == 0)
        note(node, "<film type=\"ldrfilm\"> is read as hdrfilm: the picture has radiances (as a .png, sRGB)");
}

static void set_frame(const Builder *builder, const Node *node)
{
    Frame *frame = &builder->description->sensor.frame;
    const uint64_t *size = builder->size;
    bool crop = frame->x || frame->y || frame->width || frame->height;
    if (size && !crop)
        set_size(&frame->film_width, &frame->film_height, size);
    set_crop(node, frame);
    if (size && crop)
        set_crop_size(node, frame, size);
    if ((int64_t)frame->width * frame->height > 1 << 28)
        fail(node, "%d x %d pixels are more than 2^28", frame->width, frame->height);
}

/* The filter's table, and what of the film its reach adds to the picture. */
static void set_filter(Sensor *sensor)
{
    Filter *filter = &sensor->filter;
#define X(NAME, name, words)                                                                                 \
    if (filter->kind == FILTER_##NAME)                                                                       \
        filter->radius = name##_radius(&filter->as.name);
    FILTERS(X)
#undef X
    if (!filter_is_pixel(filter))
        filter_table(filter);
    sensor->frame.border = sensor->frame.sample_border ? (int)fmax(0, ceil(filter->radius - .5)) : 0;
}

static void read_filter(Builder *builder, Node *node)
{
    Filter *filter = &builder->description->sensor.filter;
    const char *type = attribute(node, "type");
    if (find_word("mitchell, catmullrom, lanczos", type ? type : "") >= 0)
        fail(node, "%s weighs some of the film below 0, so that no choice of samples can stand for it (box, tent, gaussian)",
             describe(node));
    filter->kind = (FilterKind)find_plugin(node, filters, COUNT(filters));
    read_plugin(builder, node, filters[filter->kind], "", &filter->as);
}

static void read_sampler(Builder *builder, Node *node)
{
    read_only(builder, node, &independent, "", builder->description);
    if (strcmp(attribute(node, "type"), "independent") != 0)
        note(node, "<sampler type=\"%s\"> is left out: samples are independent, or those of --sampler",
            attribute(node, "type"));
}

static void read_view(Builder *builder, Node *node)
{
    Sensor *sensor = &builder->description->sensor;
    int kind = find_plugin(node, sensors, COUNT(sensors));
    sensor->kind = (SensorKind)kind;
    sensor->file = node->file;
    sensor->line = node->line;
    read_plugin(builder, node, sensors[kind], "<film>, <sampler>, <ref>, <medium>", &sensor->as);
}

static void read_surroundings(Builder *builder, Node *node) { builder->description->eye = read_medium(builder, node); }

/* Without a film, or a filter, with Mitsuba's. */
static void read_sensor(Builder *builder, Node *node)
{
    Sensor *sensor = &builder->description->sensor;
    Node *film = only_part(builder, node, "film"), *sampler = only_part(builder, node, "sampler");
    film = film ? meant_by(builder, film, "<film>") : NULL;
    sampler = sampler ? meant_by(builder, sampler, "<sampler>") : NULL;
    check_refs(builder, node, "<film>, <sampler>, <medium>");
    Node *medium = only_part(builder, node, "medium");
    Node *filter = film ? only_part(builder, film, "rfilter") : NULL;
    sensor->frame = (Frame){.film_width = 768, .film_height = 576};
    sensor->filter = (Filter){.kind = FILTER_GAUSSIAN, .as.gaussian = {.5}};
    bool right = reads(builder, read_view, node);
    right &= reads(builder, read_film, film);
    right &= reads(builder, read_filter, filter ? meant_by(builder, filter, "<rfilter>") : NULL);
    right &= reads(builder, read_sampler, sampler);
    right &= reads(builder, read_surroundings, medium);
    if (!right)
        give_up();
    set_frame(builder, film ? film : node);
    set_filter(sensor);
}

/* A child of the scene that is a sensor, or refers to one. */
static Node *sensor_of(Builder *builder, Node *child)
{
    Node *meant = strcmp(child->tag, "ref") == 0 && !child->wrong ? find_id(builder->file, attribute(child, "id")) : child;
    return meant && strcmp(meant->tag, "sensor") == 0 ? meant : NULL;
}

/* The sensor that is asked for: by its id, or else its place among the scene's, as in Mitsuba. */
static void choose_sensor(Builder *builder, Node *root)
{
    const char *wanted = builder->sensor ? builder->sensor : "0";
    Node *chosen = builder->sensor ? find_id(builder->file, wanted) : NULL;
    int count = 0;
    Text names = {0};
    chosen = chosen && strcmp(chosen->tag, "sensor") == 0 ? chosen : NULL;
    for (Node *child = root->first; child; child = child->next) {
        Node *sensor = sensor_of(builder, child);
        char number[16];
        if (!sensor)
            continue;
        snprintf(number, sizeof number, "%d", count++);
        if (!chosen && strcmp(number, wanted) == 0)
            chosen = sensor;
        append_word(&names, attribute(sensor, "id") ? attribute(sensor, "id") : number);
    }
    if (!count)
        fail(root, "<scene> needs a <sensor type=\"perspective\">");
    if (!chosen)
        die("--sensor %s: the scene has no such sensor (%s)", wanted, names.text);
    if (count > 1 && !builder->sensor)
        note(chosen, "of %d sensors this one is rendered: --sensor ID|N takes another (%s)", count, names.text);
    free(names.text);
    if (builder->sensor)
        builder->description->hash = hash_bytes(builder->description->hash, wanted, strlen(wanted));
    if (!reads(builder, read_sensor, chosen))
        give_up();
}

/* The scene. */

/* Is it there for a <ref> in a shape to mean? */
static bool is_lamp(const Node *node)
{
    return attribute(node, "id") && plugin_of(node, emitters, COUNT(emitters)) == EMITTER_AREA;
}

static void read_light(Builder *builder, Node *node)
{
    if (!is_lamp(node))
        read_emitter(builder, node, -1);
}

/* One that no shape has is right or wrong all the same. */
static void check_light(Builder *builder, Node *node)
{
    Emitter unused;
    if (is_lamp(node) && node->state == UNREAD)
        read_plugin(builder, node, emitters[EMITTER_AREA], "", &unused.as);
}

static void check_bsdf(Builder *builder, Node *node) { read_bsdf(builder, node); }
static void check_texture(Builder *builder, Node *node) { read_texture(builder, node); }
static void check_medium(Builder *builder, Node *node) { read_medium(builder, node); }

/* Mitsuba's path does not see them; of other integrators, some of Mitsuba 0.6, that is not known. */
static void check_media(Builder *builder, Node *root)
{
    const Description *d = builder->description;
    const Node *integrator = first_of(root->first, "integrator");
    const char *type = integrator ? attribute(integrator, "type") : "path";
    if (!d->medium_count || d->passing)
        return;
    if (find_word("path, direct, prb, prb_basic, aov, moment, adaptive", type) < 0)
        fail(&d->media[0], "<medium> is not supported with <integrator type=\"%s\">: write volpath", type);
    note(&d->media[0], "<medium> is left out: <integrator type=\"%s\"> sees none, as in Mitsuba; volpath does", type);
}

static void check_ref(Builder *builder, Node *node)
{
    const Node *found = find_id(builder->file, attribute(node, "id"));
    if (!found)
        fail(node, "<ref id=\"%.80s\"/>: nothing has this id", attribute(node, "id"));
    if (!is_among(found, "<sensor>, <bsdf>, <texture>, <medium>"))
        fail(node, "<ref id=\"%.80s\"/>: that is a <%s>, and in <scene> only a <sensor>, <bsdf>, <texture> or <medium> can be referred to",
             attribute(node, "id"), found->tag);
}

static void check_root(Builder *builder, Node *root)
{
    Said said;
    (void)builder;
    read_fields(root, &(Field){0}, "<default>, <path>, <alias>, <integrator>, <sensor>, <film>, <rfilter>, <sampler>, <bsdf>, <texture>, <shape>, <emitter>, "
        "<ref>, <medium>, <phase>", NULL, &said);
    for (const Node *child = root->first; child; child = child->next)
        if (is_among(child, "<film>, <rfilter>, <sampler>") && !attribute(child, "id"))
            note(child, "<%s> in <scene> is left out: give it an id, and a <ref> where it shall be", child->tag);
}

/* Mitsuba 3 has strict normals no more: where normals are not interpolated they change nothing. */
static void check_strict_normals(Builder *builder, Node *integrator)
{
    const Description *d = builder->description;
    for (int i = 0; i < d->shape_count; i++)
        if (d->shapes[i].kind == SHAPE_MESH && d->shapes[i].as.mesh.smooth)
            fail(integrator, "\"strict_normals\" is not supported with interpolated normals, which the shape in line %d has "
                 "(\"face_normals\", or leave it out)", d->shapes[i].line);
    note(integrator, "\"strict_normals\" is left out: no shape has interpolated normals");
}

/* Mitsuba has no integrator then, and renders nothing. */
static void check_integrator(Builder *builder, Node *root)
{
    Description *d = builder->description;
    if (only_child(root, "integrator"))
        return;
    note(root, "<scene> has no <integrator>: it is rendered by <integrator type=\"path\"/>, without a max_depth");
    d->max_depth = -1;
    d->rr_depth = 5;
}

typedef struct {
    const char *tag;
    void (*read)(Builder *builder, Node *node);
} ScenePart;

/* The children of the scene, in their order, as far as they are one of the parts. */
static void read_parts(Builder *builder, Node *root, const ScenePart *parts)
{
    for (Node *child = root->first; child; child = child->next)
        for (const ScenePart *part = parts; part->tag; part++)
            if (strcmp(child->tag, part->tag) == 0)
                reads(builder, part->read, child);
}

static void read_scene(Builder *builder, Node *root)
{
    static const ScenePart seen[] = {{"integrator", read_integrator}, {"shape", read_shape}, {"emitter", read_light},
        {"ref", check_ref}, {NULL, NULL}};
    static const ScenePart named[] = {{"bsdf", check_bsdf}, {"texture", check_texture}, {"emitter", check_light},
        {"medium", check_medium}, {NULL, NULL}};
    Description *d = builder->description;
    if (strcmp(root->tag, "scene") != 0)
        fail(root, "the outermost element must be <scene version=\"3.0.0\">, not <%s>", root->tag);
    root->wrong = false; /* what is, was said */
    reads(builder, check_root, root);
    reads(builder, check_integrator, root);
    reads(builder, choose_sensor, root);
    read_parts(builder, root, seen);
    if (d->strict_normals)
        reads(builder, check_strict_normals, first_of(root->first, "integrator"));
    reads(builder, check_media, root);
    int used_materials = d->material_count, used_media = d->medium_count; /* what no shape uses is checked and left out */
    read_parts(builder, root, named);
    d->material_count = used_materials;
    d->medium_count = used_media;
    end_if_wrong();
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

static void check_lengths(const Description *d)
{
    SensorTraits sensor = sensor_traits(&d->sensor);
    Extent eye = ball_extent(sensor.origin, sensor.reach);
    check_box(d->sensor.file, d->sensor.line, eye.low, eye.high);
    check_length(d->sensor.file, d->sensor.line, sensor.farthest);
    for (int i = 0; i < d->shape_count; i++) {
        Extent extent = shape_extent(&d->shapes[i]);
        check_box(d->shapes[i].file, d->shapes[i].line, extent.low, extent.high);
    }
    for (int i = 0; i < d->emitter_count; i++) {
        const double *position = emitter_traits(&d->emitters[i]).position;
        if (position)
            check_box(d->emitters[i].file, d->emitters[i].line, position, position);
    }
}

/* Of a light straight behind a pane Mitsuba shows no more then than the pane mirrors, except at some depths. */
static void check_hidden(const Description *d)
{
    for (int i = 0; d->hide_emitters && i < d->material_count; i++)
        if (material_traits(&d->materials[i]).unbent)
            die_at(d->materials[i].file, d->materials[i].line,
                "a bsdf that light goes straight through is not supported with \"hide_emitters\" true: write dielectric, or false");
}

Description *description_read(const char *file, const Parameter *given, int count, const char *sensor,
    const uint64_t size[2])
{
    SceneFile *scene = scene_file_open(file, given, count);
    Description *d = allocate(1, sizeof *d);
    *d = (Description){.sample_count = 4, .hash = scene->hash};
    Builder builder = {.file = scene, .description = d, .default_material = MATERIAL_NONE, .sensor = sensor,
        .size = size};
    for (int i = 0; i < scene->included_count; i++)
        PUSH(d->files, d->file_count, scene->included[i]);
    scene->included_count = 0; /* the description has them now */
    read_scene(&builder, scene->root);
    check_lengths(d);
    check_hidden(d);
    scene_file_close(scene);
    d->mesh_tree = mesh_tree_build(&d->mesh);
    d->hinted = scene_hints(d, file);
    return d;
}
