/* L11 Conductor: a smooth mirror, perfect or of metal, on the side of the normal. */
#pragma once

#include "fields.h"
#include "materials/metals.h"
#include "traits.h"

typedef struct conductor {
    Reflectance specular_reflectance;
    double eta[3], k[3]; /* complex index of refraction eta + i k, by channel, … */
    double ext_eta;      /* over which the file's are, once it is checked */
    bool fresnel;        /* … of a metal; else Mitsuba's material "none", a perfect mirror */
    const char *material;
} Conductor;

/* By name, with Mitsuba's numbers; false if there is none of that name. */
static inline bool conductor_of_metal(Conductor *m, const char *name)
{
    for (size_t i = 0; i < sizeof metals / sizeof *metals; i++)
        if (strcmp(metals[i].name, name) == 0) {
            memcpy(m->eta, metals[i].eta, sizeof m->eta);
            memcpy(m->k, metals[i].k, sizeof m->k);
            return true;
        }
    return false;
}

static inline void conductor_check(void *plugin, Said *said)
{
    Conductor *m = plugin;
    const char *name = m->material;
    m->material = NULL;
    if (name && (given(said, "eta") || given(said, "k")))
        fail(said, "<bsdf type=\"%s\"> has \"material\" and \"eta\" or \"k\": write one or the other", said->type);
    if (!given(said, "eta") != !given(said, "k"))
        fail(said, "<bsdf type=\"%s\"> needs both eta and k as <rgb>, or a metal by name, as in "
            "<string name=\"material\" value=\"Cu\"/>", said->type);
    if (given(said, "ext_eta"))
        note(said, "ext_eta divides eta and k, as in Mitsuba 0: Mitsuba 3 refuses it");
    m->fresnel = given(said, "eta") || (name && strcmp(name, "none") != 0);
    if (name && m->fresnel && !conductor_of_metal(m, name))
        fail(given(said, "material"), "no metal is called \"%.80s\" (\"Ag\", \"Al\", \"Au\", \"Cu\" …, or \"none\" for "
            "a perfect mirror; or write eta and k as <rgb>)", name);
    for (int c = 0; c < 3; c++) {
        m->eta[c] /= m->ext_eta;
        m->k[c] /= m->ext_eta;
    }
}

/* Of all plugins whose struct has a Conductor, at `at`. */
#define CONDUCTOR_FIELDS(at)                                                                                 \
    {"material", AS_STRING, (at) + offsetof(Conductor, material), NULL, ""},                                 \
    {"specular_reflectance", AS_REFLECTANCE, (at) + offsetof(Conductor, specular_reflectance), "[0,1]", "1"}, \
    {"eta", AS_COLOUR, (at) + offsetof(Conductor, eta), "(0,1000]", ""},                                     \
    {"k", AS_COLOUR, (at) + offsetof(Conductor, k), "[0,1000]", "1"},                                        \
    {"ext_eta", AS_IOR, (at) + offsetof(Conductor, ext_eta), "(0,1000]", "1"}

static const Plugin conductor_plugin = {"conductor", conductor_check, {CONDUCTOR_FIELDS(0)}};

static inline MaterialTraits conductor_traits(const Conductor *m)
{
    return (MaterialTraits){&m->specular_reflectance, NULL, m->fresnel, .odd = NULL};
}

#ifdef LANES

#include "materials/material.h"

enum { conductor_transmits = 0 };

typedef struct conductor_row {
    ReflectanceRow reflectance;
    Num eta[3], k[3]; /* the complex index of refraction eta + i k; k < 0 stands for a perfect mirror */
} ConductorRow;
static inline void conductor_row(const Conductor *m, int side, ConductorRow *row)
{
    const double perfect[3] = {-1, -1, -1};
    (void)side;
    store_reflectance(&row->reflectance, &m->specular_reflectance);
    store(row->eta, m->eta);
    store(row->k, m->fresnel ? m->k : perfect);
}

/* Reflectance of a conductor for unpolarised light, one channel, at cosine c to the normal: Born & Wolf,
   Principles of Optics, 14.2, with a² + b² = |(η + i k)² - sin²θ|. */
INLINE Real fresnel_conductor(Real c, Real eta, Real k)
{
    Real cc = c * c, ss = real(1) - cc;
    Real difference = eta * eta - k * k - ss;
    Real ab = real_sqrt(difference * difference + real(4) * eta * eta * k * k);
    Real a = real_sqrt(real_max(real(0.5) * (ab + difference), real(0)));
    Real s = (ab + cc - real(2) * a * c) / (ab + cc + real(2) * a * c);
    Real p = (ab * cc + ss * ss - real(2) * a * c * ss) / (ab * cc + ss * ss + real(2) * a * c * ss);
    return real_max(real(0.5) * s * (real(1) + p), real(0)); /* rounding can pass 0 where η is near 1 */
}

INLINE Light fresnel_of_metal(Real c, Light eta, Light k)
{
    return light(fresnel_conductor(c, eta.r, k.r), fresnel_conductor(c, eta.g, k.g), fresnel_conductor(c, eta.b, k.b));
}

INLINE Scatter conductor_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Scatter scatter = {mirrored(s), part->reflectance, real(0), mask_all(), real(1)};
    (void)u;
    if (!(f.has & HAS_FRESNEL))
        return scatter;
    Light eta = ROW_LIGHT(materials, part->row, Conductor, eta), k = ROW_LIGHT(materials, part->row, Conductor, k);
    Light fresnel = fresnel_of_metal(s->cos_o, eta, k);
    scatter.factor = light_mul(part->reflectance, light_select(k.r < real(0), light_all(real(1)), fresnel));
    return scatter;
}

#endif
