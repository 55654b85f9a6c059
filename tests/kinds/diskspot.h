/* A spot with a disk for its place, which no ray meets: from each of its points alike, across +z of its own space, light
   goes into the cone that a spot has. */
#pragma once

#include "emitters/spot.h"

typedef struct diskspot {
    Spot spot;
    double radius; /* in the file of the disk in its own space, in the scene once it is checked */
} Diskspot;

static inline void diskspot_check(void *plugin, Said *said)
{
    Diskspot *e = plugin;
    spot_check(&e->spot, said);
    e->radius *= affine_uniform_scale(&e->spot.to_world, 1e-3);
}
static const Plugin diskspot_plugin = {"diskspot", diskspot_check, {
    {"to_world", AS_TRANSFORM, offsetof(Diskspot, spot.to_world), NULL, ""},
    {"intensity", AS_COLOUR, offsetof(Diskspot, spot.intensity), "[0,inf)", "1"},
    {"cutoff_angle", AS_FLOAT, offsetof(Diskspot, spot.cutoff_angle), "(0,180]", "20"},
    {"beam_width", AS_FLOAT, offsetof(Diskspot, spot.beam_width), "[0,180]", ""},
    {"radius", AS_FLOAT, offsetof(Diskspot, radius), "[0,inf)", "1"}}};

static inline EmitterTraits diskspot_traits(const Diskspot *e)
{
    EmitterTraits traits = spot_traits(&e->spot);
    traits.radius = e->radius;
    return traits;
}

#ifdef LANES

INLINE Vec sample_diskspot(const Emitters *emitters, Index i, Real u, Real v, Features f)
{
    Real x, y, radius = of_light(emitters->radius, i, f);
    sample_disk(u, v, &x, &y);
    Vec across = vec_from_frame(vec_of_light(emitters->edge_x, i, f), vec(x * radius, y * radius, real(0)));
    return vec_add(vec_of_light(emitters->position, i, f), across);
}

/* From a uniform point of the disk I/A, over its density 1/A. */
INLINE LightSample diskspot_towards(const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    Vec delta = vec_sub(sample_diskspot(emitters, i, u, v, f), at->p);
    Real distance = vec_length(delta), inverse_d = real(1) / distance;
    Vec wi = vec_scale(delta, inverse_d);
    Real weight = inverse_d * inverse_d * falloff_of(emitters, i, wi, f);
    return (LightSample){wi, distance, light_all(weight), real(0), index_of(-1), i};
}

INLINE FirstRay diskspot_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    FirstRay ray = spot_emit(emitters, i, place, way, f);
    ray.o = sample_diskspot(emitters, i, place[0], place[1], f);
    return ray;
}

/* The point of the disk is chosen alike from anywhere: like one that is certain, it is in no weight. */
INLINE EmitPdf diskspot_emit_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    return spot_emit_pdf(emitters, i, o, d, f);
}

#endif
