/* A shape that shines, all its surface alike, on the side of the normal. */
#ifndef ONERAY_EMITTERS_AREA_H
#define ONERAY_EMITTERS_AREA_H

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct area {
    double radiance[3]; /* W·sr⁻¹·m⁻² */
} Area;

static const Field area_fields[] = {
    {"radiance", AS_COLOUR, offsetof(Area, radiance), "[0,inf)", "1"},
    {0},
};
static const Plugin area_plugin = {"area", area_fields, NULL};

static inline EmitterTraits area_traits(const Area *e)
{
    return (EmitterTraits){FROM_SHAPE, e->radiance, NULL, PI, NULL};
}

#endif
