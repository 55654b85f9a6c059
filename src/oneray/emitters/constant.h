/* Light from all around, alike in all directions. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct constant {
    double radiance[3]; /* W·sr⁻¹·m⁻² */
} Constant;

static const Plugin constant_plugin = {"constant", NULL, {
    {"sampling_weight", AS_FLOAT, LEFT_OUT, "(0,inf)", "1"},
    {"radiance", AS_EMISSION, offsetof(Constant, radiance), "[0,inf)", "1"}}};

static inline EmitterTraits constant_traits(const Constant *e)
{
    return (EmitterTraits){.from = FROM_AROUND, .emission = e->radiance, .flux = 4 * PI * PI};
}

#ifdef LANES

#include "emitters/emitter.h"

INLINE Light constant_radiance(const Emitters *emitters, Vec wi)
{
    (void)wi;
    return light_of(emitters->emission[emitters->sky]);
}

INLINE Real constant_pdf_w(const Emitters *emitters, Vec wi)
{
    (void)emitters, (void)wi;
    return pdf_w_sphere();
}

INLINE LightSample constant_towards(
    const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    (void)at, (void)f;
    Vec wi = sample_sphere(u, v);
    Real inverse = real(1) / constant_pdf_w(emitters, wi);
    return (LightSample){wi, real(NUM_MAX), light_all(inverse), inverse, index_of(-1), i};
}

/* L17 From a uniform direction, flux 4π L π R². */
INLINE FirstRay constant_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    Real radius = real(emitters->world_radius), flux = REAL_PI * radius * radius;
    (void)i, (void)f;
    return from_far_away(emitters, sample_sphere(way[0], way[1]), place, flux / pdf_w_sphere());
}

INLINE EmitPdf constant_emit_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    (void)i, (void)o, (void)f;
    return (EmitPdf){constant_pdf_w(emitters, vec_neg(d)), pdf_a_across(emitters), real(1), mask_all(), mask_all()};
}

#endif
