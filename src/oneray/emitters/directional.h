/* Light from afar, all of it along one direction: +z of its own space. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct directional {
    double direction[3];  /* along which the light travels; unit, once it is checked */
    Affine to_world;      /* whose z axis it is, where the file says it so */
    double irradiance[3]; /* of a plane across it, W·m⁻² */
} Directional;

static inline void directional_check(void *plugin, Said *said)
{
    Directional *e = plugin;
    const Place *direction = given(said, "direction"), *to_world = given(said, "to_world");
    if (direction && to_world)
        fail(said, "<emitter type=\"directional\"> has \"direction\" and \"to_world\": write one or the other");
    if (to_world)
        column(&e->to_world, 2, e->direction);
    double size = unit(e->direction, e->direction);
    if (!(size > 0 && size < HUGE_VAL) && direction)
        fail(direction, "\"direction\" must not be of zero or overflowing length");
    if (!(fabs(size - 1) <= 1e-5) && to_world)
        fail(to_world, "\"to_world\" of a directional emitter must not scale (Mitsuba multiplies the irradiance by "
            "it)");
}
static const Plugin directional_plugin = {"directional", directional_check, {
    {"direction", AS_VECTOR, offsetof(Directional, direction), NULL, "0 0 1"},
    {"to_world", AS_TRANSFORM, offsetof(Directional, to_world), NULL, ""},
    {"sampling_weight", AS_FLOAT, LEFT_OUT, "(0,inf)", "1"},
    {"irradiance", AS_EMISSION, offsetof(Directional, irradiance), "[0,inf)", "1"}}};

static inline EmitterTraits directional_traits(const Directional *e)
{
    return (EmitterTraits){
        .from = FROM_AFAR, .emission = e->irradiance, .direction = e->direction, .flux = PI};
}

#ifdef LANES

#include "emitters/emitter.h"

INLINE LightSample directional_towards(
    const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    (void)at, (void)u, (void)v;
    Vec wi = vec_neg(vec_of_light(emitters->edge_x, i, f));
    return (LightSample){wi, real(NUM_MAX), light_all(real(1)), real(0), index_of(-1), i};
}

/* L17 Flux E π R². */
INLINE FirstRay directional_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    Real radius = real(emitters->world_radius);
    (void)way;
    return from_far_away(emitters, vec_of_light(emitters->edge_x, i, f), place, REAL_PI * radius * radius);
}

INLINE EmitPdf directional_emit_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    (void)i, (void)o, (void)d, (void)f;
    return (EmitPdf){real(1), pdf_a_across(emitters), real(1), mask_all(), mask_none()};
}

#endif
