/* L11 Conductor: a smooth mirror, perfect or of metal, on the side of the normal. */
#ifndef ONERAY_MATERIALS_CONDUCTOR_H
#define ONERAY_MATERIALS_CONDUCTOR_H

#include "fields.h"
#include "traits.h"

typedef struct conductor {
    double specular_reflectance[3];
    double eta[3], k[3]; /* complex index of refraction eta + i k, by channel, … */
    bool fresnel;        /* … of a metal; else Mitsuba's material "none", a perfect mirror */
    const char *material;
} Conductor;

static const Field conductor_fields[] = {
    {"material", AS_STRING, offsetof(Conductor, material), NULL, ""},
    {"specular_reflectance", AS_COLOUR, offsetof(Conductor, specular_reflectance), "[0,1]", "1"},
    {"eta", AS_COLOUR, offsetof(Conductor, eta), "(0,1000]", ""},
    {"k", AS_COLOUR, offsetof(Conductor, k), "[0,1000]", ""},
    {0},
};

static inline void conductor_check(void *plugin, Said *said)
{
    Conductor *m = plugin;
    const char *name = m->material;
    m->material = NULL;
    m->fresnel = given(said, "eta") || given(said, "k");
    if (name && strcmp(name, "none") != 0)
        fail(given(said, "material"), "the metal \"%.80s\" is not supported by name (write \"none\" for a "
            "perfect mirror, or eta and k as <rgb>)", name);
    if (name && m->fresnel)
        fail(said, "<bsdf type=\"conductor\"> has \"material\" and \"eta\" or \"k\": write one or the other");
    if (!name && !(given(said, "eta") && given(said, "k")))
        fail(said, "<bsdf type=\"conductor\"> needs both eta and k as <rgb>, or "
            "<string name=\"material\" value=\"none\"/> for a perfect mirror (Mitsuba's default is copper)");
}
static const Plugin conductor_plugin = {"conductor", conductor_fields, conductor_check};

static inline MaterialTraits conductor_traits(const Conductor *m)
{
    return (MaterialTraits){m->specular_reflectance, NULL, m->fresnel, NULL};
}

#endif
