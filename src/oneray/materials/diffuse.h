/* L7 Diffuse: light goes on alike in all directions, f_r = reflectance/π (sr⁻¹), on the side of the normal. */
#pragma once

#include "fields.h"
#include "traits.h"

typedef struct diffuse {
    Reflectance reflectance;
} Diffuse;

static const Plugin diffuse_plugin = {"diffuse", NULL, {
    {"reflectance", AS_REFLECTANCE, offsetof(Diffuse, reflectance), "[0,1]", ".5"}}};

static inline MaterialTraits diffuse_traits(const Diffuse *m)
{
    return (MaterialTraits){&m->reflectance, NULL, .odd = NULL};
}

#ifdef LANES

#include "materials/material.h"

enum { diffuse_transmits = 0 };

typedef struct diffuse_row {
    ReflectanceRow reflectance;
} DiffuseRow;
static inline void diffuse_row(const Diffuse *m, int side, DiffuseRow *row)
{
    (void)side;
    store_reflectance(&row->reflectance, &m->reflectance);
}

INLINE Light diffuse_eval(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)materials, (void)s, (void)wi, (void)cosine, (void)f;
    return light_scale(part->reflectance, REAL_INV_PI);
}

/* L8 1/2π for the uniform hemisphere, L9 cosθ/π for the cosine-weighted. */
INLINE Real diffuse_pdf_w(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)materials, (void)part, (void)s, (void)wi;
    return f.use & USE_COSINE ? pdf_w_hemisphere_cosine(cosine) : pdf_w_hemisphere_uniform();
}

/* L8 2 reflectance cosθ for the uniform hemisphere (reflectance/π scaled by 2π), L9 reflectance for the
   cosine-weighted. A part of a blend has its share in the reflectance. */
INLINE Light diffuse_factor(
    const Materials *materials, const Part *part, const Surface *s, Vec wi, Real cosine, Features f)
{
    (void)materials, (void)s, (void)wi;
    Light reflectance =
        f.has & HAS_BLEND ? light_scale(part->reflectance, real(1) / part->share) : part->reflectance;
    return f.use & USE_COSINE ? reflectance : light_scale(reflectance, real(2) * cosine);
}

/* L8, L9 One ray over the hemisphere. */
INLINE Scatter diffuse_sample(
    const Materials *materials, const Part *part, const Surface *s, const Real u[2], Features f)
{
    Vec local = f.use & USE_COSINE ? sample_hemisphere_cosine(u[0], u[1]) : sample_hemisphere_uniform(u[0], u[1]);
    Vec wi = vec_from_frame(s->n, local);
    return (Scatter){wi, diffuse_factor(materials, part, s, wi, local.z, f),
        diffuse_pdf_w(materials, part, s, wi, local.z, f), mask_none(), real(1)};
}

#endif
