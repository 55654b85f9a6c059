/* Light from all around, alike in all directions. */
#ifndef ONERAY_EMITTERS_CONSTANT_H
#define ONERAY_EMITTERS_CONSTANT_H

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct constant {
    double radiance[3]; /* W·sr⁻¹·m⁻² */
} Constant;

static const Field constant_fields[] = {
    {"radiance", AS_COLOUR, offsetof(Constant, radiance), "[0,inf)", "1"},
    {0},
};
static const Plugin constant_plugin = {"constant", constant_fields, NULL};

static inline EmitterTraits constant_traits(const Constant *e)
{
    return (EmitterTraits){FROM_AROUND, e->radiance, NULL, 4 * PI * PI, NULL};
}

#endif
