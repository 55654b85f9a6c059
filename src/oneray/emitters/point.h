/* A light in a point, alike in all directions. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct point {
    double position[3];
    double intensity[3]; /* W·sr⁻¹ */
    Affine to_world;     /* whose origin is the position, where the file says it so */
} Point;

static inline void point_check(void *plugin, Said *said)
{
    Point *e = plugin;
    if (given(said, "position") && given(said, "to_world"))
        fail(said, "<emitter type=\"point\"> has \"position\" and \"to_world\": write one or the other");
    if (given(said, "to_world"))
        column(&e->to_world, 3, e->position);
}
static const Plugin point_plugin = {"point", point_check, {
    {"position", AS_VECTOR, offsetof(Point, position), NULL, "0"},
    {"to_world", AS_TRANSFORM, offsetof(Point, to_world), NULL, ""},
    {"sampling_weight", AS_FLOAT, LEFT_OUT, "(0,inf)", "1"},
    {"intensity", AS_EMISSION, offsetof(Point, intensity), "[0,inf)", "1"}}};

static inline EmitterTraits point_traits(const Point *e)
{
    return (EmitterTraits){
        .from = FROM_POINT, .emission = e->intensity, .position = e->position, .flux = 4 * PI};
}

#ifdef LANES

#include "emitters/emitter.h"

INLINE LightSample point_towards(const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    (void)u, (void)v;
    return towards_place(emitters, i, at, f);
}

/* L17 Flux 4π I. */
INLINE FirstRay point_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    (void)place;
    return (FirstRay){vec_of_light(emitters->position, i, f), sample_sphere(way[0], way[1]), index_of(-1),
        light_all(real(1) / pdf_w_sphere())};
}

INLINE EmitPdf point_emit_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    (void)emitters, (void)i, (void)o, (void)d, (void)f;
    return (EmitPdf){real(1), pdf_w_sphere(), real(1), mask_none(), mask_none()};
}

#endif
