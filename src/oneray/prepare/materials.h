/* From a Description to a kernel's Scene, the materials: a row for each side of each slot, and for each further
   part of a blend. */
#pragma once

#include "prepare/shapes.h"

/* The kinds' rows that are in the mask: room for the largest, as a power of two of numbers. */
#define X(NAME, name, words)                                                                                 \
    while ((f.has & HAS_##NAME) && (sizeof(Num) << shift) < sizeof(struct name##_row))                       \
        shift++;
static int material_shift(Features f)
{
    int shift = 2;
    MATERIALS(X)
    return shift;
}
static int texture_shift(Features f)
{
    int shift = 2;
    TEXTURES(X)
    return shift;
}
#undef X

/* A part of a blend: a material that is no blend, or MATERIAL_NONE, and its share of the whole, times those of textures,
   or of what they leave (rest). */
typedef struct {
    int material;
    double share;
    int textures;
    struct {
        int texture;
        bool rest;
    } by[MOST_WEIGHTS];
} Share;

/* L16 The parts of a material on one side of a surface: nested blends multiply their weights. Fills parts, if
   not NULL; returns how many there are. */
static int add_parts(const Description *d, Share whole, Share *parts)
{
    int material = whole.material;
    if (whole.share == 0)
        return 0;
    if (material == MATERIAL_NONE || d->materials[material].kind != MATERIAL_BLEND) {
        if (parts)
            *parts = whole;
        return 1;
    }
    const Blend *blend = &d->materials[material].as.blend;
    Share first = whole, second = whole;
    first.material = blend->first, second.material = blend->second;
    if (blend->weight.texture) {
        int n = whole.textures;
        first.textures = second.textures = n + 1;
        first.by[n].texture = second.by[n].texture = blend->weight.texture;
        first.by[n].rest = true, second.by[n].rest = false;
    } else
        first.share *= 1 - blend->weight.most[0], second.share *= blend->weight.most[0];
    int count = add_parts(d, first, parts);
    return count + add_parts(d, second, parts ? parts + count : NULL);
}
static int parts_of(const Description *d, int material, Share *parts)
{
    return add_parts(d, (Share){.material = material, .share = 1}, parts);
}

static bool is_kind(const Description *d, Share part, MaterialKind kind)
{
    return part.material == MATERIAL_NONE ? kind == MATERIAL_DIFFUSE : d->materials[part.material].kind == kind;
}

static bool part_is_finite(const Description *d, Share part)
{
    bool finite = false;
#define X(NAME, name, words) finite |= is_kind(d, part, MATERIAL_##NAME);
    FINITE_MATERIALS(X)
#undef X
    return finite;
}

/* What light can do at a part: PARTS_…. */
static Int abilities_of(const Description *d, Share part)
{
    Int has = 0;
    if (part_is_finite(d, part) && part.material != MATERIAL_NONE && material_traits(&d->materials[part.material]).transmitted)
        has |= PARTS_TRANSMIT;
#define X(NAME, name, words) has |= is_kind(d, part, MATERIAL_##NAME) ? PARTS_DELTA : 0;
    DELTA_MATERIALS(X) SMOOTH_COATS(X)
#undef X
    return has;
}

/* Diffuse of one colour, or black, of the same share everywhere. */
static bool is_plain(const Description *d, Share part)
{
    if (part.textures || (part.material != MATERIAL_NONE && d->materials[part.material].bump.texture))
        return false;
    return part.material == MATERIAL_NONE
           || (is_kind(d, part, MATERIAL_DIFFUSE) && !d->materials[part.material].as.diffuse.reflectance.texture);
}

/* Puts the parts that are no delta in front, in their order, and the plain diffuse ones together into one, f_r adding up:
   `albedo` gets that one's reflectance times its share. Returns how many parts are left, and how many of them are
   finite. */
static int sort_parts(const Description *d, Share *parts, int count, double albedo[3], int *finite)
{
    Share *others = allocate((size_t)count, sizeof *others);
    Share diffuse = {.material = MATERIAL_NONE};
    int left = 0;
    for (int i = 0; i < count; i++) {
        if (!is_plain(d, parts[i])) {
            others[left++] = parts[i];
            continue;
        }
        diffuse.share += parts[i].share;
        for (int c = 0; c < 3 && parts[i].material != MATERIAL_NONE; c++)
            albedo[c] += parts[i].share * d->materials[parts[i].material].as.diffuse.reflectance.most[c];
    }
    int used = 0;
    if (diffuse.share > 0)
        parts[used++] = diffuse;
    *finite = used;
    for (int delta = 0; delta < 2; delta++)
        for (int i = 0; i < left; i++)
            if (part_is_finite(d, others[i]) == !delta) {
                parts[used++] = others[i];
                *finite += !delta;
            }
    free(others);
    return used;
}

/* The numbers of one material; side 1 is the inside. One that is no delta has its share in the reflectance. */
static void set_row(Materials *m, const Description *d, int row, Share part, const double albedo[3], int side)
{
    Num *numbers = m->numbers + ((size_t)row << m->shift);
    const Material *material = part.material == MATERIAL_NONE ? NULL : &d->materials[part.material];
    if (!material) {
        if (!part.textures)
            store(numbers, albedo);
        return;
    }
    m->kind[row] = (Int)material->kind;
    if (m->bump && material->bump.texture)
        bump_row(&material->bump, side, m->bump + 4 * (size_t)row);
    switch (material->kind) {
#define X(NAME, name, words)                                                                                 \
    case MATERIAL_##NAME: name##_row(&material->as.name, side, (struct name##_row *)(void *)numbers); break;
        MATERIALS(X)
#undef X
    default: break;
    }
    for (int c = 0; c < 3 && part_is_finite(d, part); c++)
        numbers[c] *= (Num)part.share;
}

/* Row `row` and, from `more` on, the rows that a blend goes on with; returns the first row that is still free. */
static int set_rows(Materials *m, const Description *d, int row, int more, int material, int side)
{
    int count = parts_of(d, material, NULL), finite;
    Share *parts = allocate((size_t)count, sizeof *parts);
    double albedo[3] = {0}, left = 1;
    parts_of(d, material, parts);
    int layers = sort_parts(d, parts, count, albedo, &finite);
    for (int k = 0; k < layers; k++)
        m->has[row] |= abilities_of(d, parts[k]);
    for (int k = 0; k < layers; k++) {
        int last = k + 1 == layers;
        set_row(m, d, row, parts[k], albedo, side);
        if (m->p_stay) {
            double stays = m->share_by ? 0 : parts[k].share / left; /* where textures do not change it */
            m->p_stay[row] = last ? (k ? 2 : 1) : (Num)stays; /* 2: above every random number */
            m->share[row] = (Num)parts[k].share;
            m->next[row] = more;
        }
        for (int i = 0; m->share_by && i < parts[k].textures; i++) {
            m->share_by[4 * row + 2 * i] = (Num)parts[k].by[i].texture;
            m->share_by[4 * row + 2 * i + 1] = parts[k].by[i].rest;
        }
        left -= parts[k].share;
        row = more;
        more += !last;
    }
    m->layers = layers > m->layers ? layers : m->layers;
    free(parts);
    return more;
}

/* Has some blend several parts that are no delta, which are evaluated together? */
static bool has_finite_parts(const Description *d)
{
    bool has = false;
    for (int i = 0; i < d->material_count && !has; i++) {
        int count = parts_of(d, i, NULL), finite;
        Share *parts = allocate((size_t)count, sizeof *parts);
        parts_of(d, i, parts);
        sort_parts(d, parts, count, (double[3]){0}, &finite);
        has = finite > 1;
        free(parts);
    }
    return has;
}

static size_t pixels_of(const Image *image) { return image ? (size_t)image->width * (size_t)image->height : 0; }

static void prepare_pixels(Scene *scene, const Description *d)
{
    Textures *t = &scene->materials.textures;
    size_t count = 0;
    t->first = keep(scene, (size_t)d->texture_count + 1, sizeof *t->first);
    for (int i = 0; i < d->images.count; i++)
        count += pixels_of(d->images.all[i]);
    t->pixels = keep(scene, count, 3 * sizeof *t->pixels);
    for (size_t i = 0, at = 0; i < (size_t)d->images.count; at += pixels_of(d->images.all[i++])) {
        const Image *image = d->images.all[i];
        for (size_t k = 0; k < 3 * pixels_of(image); k++)
            t->pixels[3 * at + k] = (Num)image->value[k / 3][k % 3];
        for (int row = 0; row < d->texture_count; row++)
            if (texture_traits(&d->textures[row]).image == image)
                t->first[row + 1] = (Int)at;
    }
}

static void prepare_textures(Scene *scene, const Description *d)
{
    Textures *t = &scene->materials.textures;
    size_t rows = (size_t)d->texture_count + 1;
    t->shift = texture_shift(scene->features);
    t->last = (Int)d->texture_count;
    t->numbers = keep(scene, rows, sizeof *t->numbers << t->shift);
    t->kind = keep(scene, rows, sizeof *t->kind);
    for (int i = 0; i < d->texture_count; i++) {
        Num *numbers = t->numbers + ((size_t)(i + 1) << t->shift);
        t->kind[i + 1] = (Int)d->textures[i].kind;
#define X(NAME, name, words)                                                                                 \
    if (d->textures[i].kind == TEXTURE_##NAME)                                                               \
        name##_row(&d->textures[i].as.name, (struct name##_row *)(void *)numbers);
        TEXTURES(X)
#undef X
    }
    prepare_pixels(scene, d);
}

static void prepare_materials(Scene *scene, const Description *d, const int *first_slot)
{
    Materials *m = &scene->materials;
    int more = 2 * scene->shapes.slot_count + 2; /* a ray that meets nothing looks at slot 0 */
    size_t rows = (size_t)more;
    for (int i = 0; i < d->shape_count; i++)
        for (int side = 0; side < 2; side++)
            rows += (size_t)slots_of(d->shapes[i].kind)
                    * (size_t)parts_of(d, side ? d->shapes[i].back : d->shapes[i].front, NULL);
    m->shift = material_shift(scene->features);
    m->numbers = keep(scene, rows, ((size_t)1 << m->shift) * sizeof *m->numbers);
    m->kind = keep(scene, rows, sizeof *m->kind);
    m->has = keep(scene, rows, sizeof *m->has);
    if (scene->features.has & HAS_BUMP)
        m->bump = keep(scene, rows, 4 * sizeof *m->bump);
    if (scene->features.has & HAS_BLEND) {
        m->p_stay = keep(scene, rows, sizeof *m->p_stay);
        m->share = keep(scene, rows, sizeof *m->share);
        m->next = keep(scene, rows, sizeof *m->next);
        if (scene->features.has & HAS_WEIGHTS)
            m->share_by = keep(scene, rows, 4 * sizeof *m->share_by);
    }
    for (int i = 0; i < d->shape_count; i++)
        for (int row = 0; row < 2 * slots_of(d->shapes[i].kind); row++)
            more = set_rows(m, d, 2 * first_slot[i] + row, more,
                row % 2 ? d->shapes[i].back : d->shapes[i].front, row % 2);
}
