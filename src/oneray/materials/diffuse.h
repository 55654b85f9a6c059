/* L7 Diffuse: light goes on alike in all directions, f_r = reflectance/π (sr⁻¹), on the side of the normal. */
#ifndef ONERAY_MATERIALS_DIFFUSE_H
#define ONERAY_MATERIALS_DIFFUSE_H

#include "fields.h"
#include "traits.h"

typedef struct diffuse {
    double reflectance[3];
} Diffuse;

static const Field diffuse_fields[] = {
    {"reflectance", AS_COLOUR, offsetof(Diffuse, reflectance), "[0,1]", ".5"},
    {0},
};
static const Plugin diffuse_plugin = {"diffuse", diffuse_fields, NULL};

static inline MaterialTraits diffuse_traits(const Diffuse *m)
{
    return (MaterialTraits){m->reflectance, NULL, false, NULL};
}

#endif
