/* From a Description to a kernel's Scene, the media: a row for each, and for each row of the tables by slot what is on
   either side. */
#pragma once

#include "prepare/shapes.h"

/* Of any kind. */
static const Homogeneous *extinction_of(const Medium *medium) { return &medium->as.homogeneous; }

static void prepare_media(Scene *scene, const Description *d, const int *first_slot)
{
    Media *m = &scene->media;
    m->rows = keep(scene, (size_t)d->medium_count + 1, sizeof *m->rows);
    m->beyond = keep(scene, 2 * (size_t)scene->shapes.slot_count + 2, sizeof *m->beyond);
    m->eye = (Int)d->eye;
    for (int i = 0; i < d->medium_count; i++) {
        const Homogeneous *from = extinction_of(&d->media[i]);
        store(m->rows[i + 1].sigma_t, from->sigma_t);
        store(m->rows[i + 1].albedo, from->albedo);
        m->rows[i + 1].g = (Num)d->media[i].phase.g;
        m->coloured |= from->sigma_t[0] != from->sigma_t[1] || from->sigma_t[1] != from->sigma_t[2];
    }
    for (int row = 0; row < 2 * scene->shapes.slot_count + 2; row++)
        m->beyond[row] = UNCHANGED;
    for (int i = 0; i < d->shape_count; i++) {
        const Shape *shape = &d->shapes[i];
        for (int slot = first_slot[i];
            slot < first_slot[i] + slots_of(shape->kind) && shape->exterior != MEDIUM_GOES_ON; slot++) {
            m->beyond[2 * slot] = (Int)shape->exterior;
            m->beyond[2 * slot + 1] = (Int)shape->interior;
        }
    }
}
