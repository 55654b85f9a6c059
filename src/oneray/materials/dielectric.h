/* L15 Dielectric: the smooth boundary between two media, which reflects and refracts. */
#ifndef ONERAY_MATERIALS_DIELECTRIC_H
#define ONERAY_MATERIALS_DIELECTRIC_H

#include "fields.h"
#include "traits.h"

#include <math.h>

typedef struct dielectric {
    double int_ior, ext_ior; /* indices of refraction; the normal points outside */
    double specular_reflectance[3], specular_transmittance[3];
} Dielectric;

static const Field dielectric_fields[] = {
    {"int_ior", AS_IOR, offsetof(Dielectric, int_ior), "(0,1000]", ""},
    {"ext_ior", AS_IOR, offsetof(Dielectric, ext_ior), "(0,1000]", ""},
    {"specular_reflectance", AS_COLOUR, offsetof(Dielectric, specular_reflectance), "[0,1]", "1"},
    {"specular_transmittance", AS_COLOUR, offsetof(Dielectric, specular_transmittance), "[0,1]", "1"},
    {0},
};

static inline void dielectric_check(void *plugin, Said *said)
{
    (void)plugin;
    if (!given(said, "int_ior") || !given(said, "ext_ior"))
        fail(said, "<bsdf type=\"dielectric\"> needs both int_ior and ext_ior (as <float>, or by name)");
}
static const Plugin dielectric_plugin = {"dielectric", dielectric_fields, dielectric_check};

/* Inside over outside. */
static inline double dielectric_ior(const Dielectric *m) { return m->int_ior / m->ext_ior; }

static inline MaterialTraits dielectric_traits(const Dielectric *m)
{
    const char *odd = fabs(dielectric_ior(m) - 1) < 1e-3 ? "an index of refraction within 0.001 of 1" : NULL;
    return (MaterialTraits){m->specular_reflectance, m->specular_transmittance, false, odd};
}

#endif
