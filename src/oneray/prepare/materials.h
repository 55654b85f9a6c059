/* From a Description to a kernel's Scene, the materials: a row for each side of each slot, and for each further
   part of a blend. */
#ifndef ONERAY_PREPARE_MATERIALS_H
#define ONERAY_PREPARE_MATERIALS_H

#include "prepare/shapes.h"

/* A part of a blend: a material that is no blend, or MATERIAL_NONE, and its share of the whole. */
typedef struct {
    int material;
    double share;
} Part;

/* L16 The parts of a material on one side of a surface: nested blends multiply their weights. Fills parts, if
   not NULL; returns how many there are. */
static int parts_of(const Description *d, int material, double share, Part *parts)
{
    if (share == 0)
        return 0;
    if (material == MATERIAL_NONE || d->materials[material].kind != MATERIAL_BLEND) {
        if (parts)
            *parts = (Part){material, share};
        return 1;
    }
    const Blend *blend = &d->materials[material].as.blend;
    int first = parts_of(d, blend->first, share * (1 - blend->weight), parts);
    return first + parts_of(d, blend->second, share * blend->weight, parts ? parts + first : NULL);
}

static int is_specular(const Description *d, Part part)
{
    return part.material != MATERIAL_NONE && d->materials[part.material].kind != MATERIAL_DIFFUSE;
}

/* The mirror or glass of a row; side 1 is the inside. */
static void set_specular(Materials *m, int row, const Material *material, int side)
{
    bool glass = material->kind == MATERIAL_DIELECTRIC;
    const Conductor *metal = &material->as.conductor;
    store(m->albedo[row], glass ? material->as.dielectric.specular_reflectance : metal->specular_reflectance);
    m->kind[row] = (Int)material->kind;
    if (!m->eta)
        return;
    if (glass) {
        double ior = dielectric_ior(&material->as.dielectric);
        m->eta[row][0] = (Num)(side ? ior : 1 / ior);
        store(m->k[row], material->as.dielectric.specular_transmittance);
        return;
    }
    for (int c = 0; c < 3; c++) {
        m->eta[row][c] = (Num)metal->eta[c];
        m->k[row][c] = metal->fresnel ? (Num)metal->k[c] : -1;
    }
}

/* Puts the diffuse parts together into one, f_r adding up; the others stay as they are, in order. Returns how
   many others there are; the share of the diffuse one is 0 if there is none. */
static int sort_parts(const Description *d, Part *parts, int count, double *diffuse, double albedo[3])
{
    int specular = 0;
    for (int i = 0; i < count; i++) {
        if (is_specular(d, parts[i])) {
            parts[specular++] = parts[i];
            continue;
        }
        *diffuse += parts[i].share;
        for (int c = 0; c < 3 && parts[i].material != MATERIAL_NONE; c++)
            albedo[c] += parts[i].share * d->materials[parts[i].material].as.diffuse.reflectance[c];
    }
    return specular;
}

/* Row `row` and, from `more` on, the rows that a blend goes on with; returns the first row that is still free.
   The diffuse part comes first, so that light sampling finds it. */
static int set_rows(Materials *m, const Description *d, int row, int more, int material, int side)
{
    int count = parts_of(d, material, 1, NULL);
    Part *parts = allocate((size_t)count, sizeof *parts);
    double diffuse = 0, albedo[3] = {0}, left = 1;
    parts_of(d, material, 1, parts);
    int specular = sort_parts(d, parts, count, &diffuse, albedo), layers = specular + (diffuse > 0);
    for (int k = 0; k < layers; k++) {
        int part = k - (diffuse > 0), last = k + 1 == layers;
        double share = part < 0 ? diffuse : parts[part].share;
        if (part < 0)
            store(m->albedo[row], albedo);
        else
            set_specular(m, row, &d->materials[parts[part].material], side);
        if (m->share) {
            m->share[row] = last ? (k ? 2 : 1) : (Num)(share / left); /* 2: above every random number */
            m->next[row] = more;
        }
        left -= share;
        row = more;
        more += !last;
    }
    m->layers = layers > m->layers ? layers : m->layers;
    free(parts);
    return more;
}

static void prepare_materials(Scene *scene, const Description *d, const int *first_slot)
{
    Materials *m = &scene->materials;
    int more = 2 * scene->shapes.slot_count + 2; /* a ray that meets nothing looks at slot 0 */
    size_t rows = (size_t)more;
    for (int i = 0; i < d->shape_count; i++)
        for (int side = 0; side < 2; side++)
            rows += (size_t)slots_of(&d->shapes[i])
                    * (size_t)parts_of(d, side ? d->shapes[i].back : d->shapes[i].front, 1, NULL);
    m->albedo = keep(scene, rows, sizeof *m->albedo);
    m->kind = keep(scene, rows, sizeof *m->kind);
    if (scene->features.has & (HAS_FRESNEL | HAS_DIELECTRIC)) {
        m->eta = keep(scene, rows, sizeof *m->eta);
        m->k = keep(scene, rows, sizeof *m->k);
    }
    if (scene->features.has & HAS_BLEND) {
        m->share = keep(scene, rows, sizeof *m->share);
        m->next = keep(scene, rows, sizeof *m->next);
    }
    for (int i = 0; i < d->shape_count; i++)
        for (int row = 0; row < 2 * slots_of(&d->shapes[i]); row++)
            more = set_rows(m, d, 2 * first_slot[i] + row, more,
                row % 2 ? d->shapes[i].back : d->shapes[i].front, row % 2);
}

#endif
