/* A light in a point that shines into a cone along +z of its own space: with all its intensity up to an angle of
   beam_width from the axis, from there less and less, and not at all beyond cutoff_angle. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct spot {
    Affine to_world;
    double intensity[3];             /* on the axis, W·sr⁻¹ */
    double cutoff_angle, beam_width; /* degrees in the file, radians once it is checked */
    double position[3], direction[3];
} Spot;

static inline void spot_check(void *plugin, Said *said)
{
    Spot *e = plugin;
    if (!given(said, "beam_width"))
        e->beam_width = e->cutoff_angle * .75;
    if (e->beam_width > e->cutoff_angle)
        fail(said, "\"beam_width\" is %g, more than \"cutoff_angle\", %g", e->beam_width, e->cutoff_angle);
    if (affine_uniform_scale(&e->to_world, 1e-3) == 0)
        fail(given(said, "to_world"), "\"to_world\" of a spot must not shear or scale by axis: its cone is round");
    column(&e->to_world, 3, e->position);
    column(&e->to_world, 2, e->direction);
    unit(e->direction, e->direction);
    e->cutoff_angle = e->cutoff_angle * PI / 180;
    e->beam_width = e->beam_width * PI / 180;
}
static const Plugin spot_plugin = {"spot", spot_check, {
    {"to_world", AS_TRANSFORM, offsetof(Spot, to_world), NULL, ""},
    {"sampling_weight", AS_FLOAT, LEFT_OUT, "(0,inf)", "1"},
    {"intensity", AS_EMISSION, offsetof(Spot, intensity), "[0,inf)", "1"},
    {"cutoff_angle", AS_FLOAT, offsetof(Spot, cutoff_angle), "(0,180]", "20"},
    {"beam_width", AS_FLOAT, offsetof(Spot, beam_width), "[0,180]", ""}}};

/* The flux is that of the cone up to the middle of its rim. */
static inline EmitterTraits spot_traits(const Spot *e)
{
    double flux = 2 * PI * (1 - cr_cos((e->cutoff_angle + e->beam_width) / 2));
    bool sharp = e->cutoff_angle < 1e-3 || e->cutoff_angle - e->beam_width < 1e-3 * e->cutoff_angle;
    return (EmitterTraits){.from = FROM_POINT,
        .emission = e->intensity,
        .position = e->position,
        .direction = e->direction,
        .spread = e->cutoff_angle,
        .beam = e->beam_width,
        .flux = flux,
        .odd = sharp ? "a spot with a cone or rim of less than 0.001" : NULL};
}

#ifdef LANES

#include "emitters/emitter.h"

/* The spot's share of its intensity towards -wi, by the angle to its axis: 1 within the beam, 0 beyond the cutoff, linear
   between. */
INLINE Real falloff_of(const Emitters *emitters, Index i, Vec wi, Features f)
{
    Vec axis = vec_of_light(emitters->edge_x, i, f);
    Real angle = angle_of(vec_length(vec_cross(axis, wi)), -vec_dot(axis, wi));
    Real beam = of_light(emitters->beam, i, f), cutoff = of_light(emitters->cutoff, i, f);
    Real ramp = real_max((cutoff - angle) / (cutoff - beam), real(0));
    return select(angle <= beam, real(1), ramp);
}

INLINE LightSample spot_towards(const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, Features f)
{
    (void)u, (void)v;
    LightSample s = towards_place(emitters, i, at, f);
    s.weight = light_scale(s.weight, falloff_of(emitters, i, s.wi, f));
    return s;
}

/* L17 Uniform in its cone, flux 2π (1 - cos cutoff) I falloff. */
INLINE FirstRay spot_emit(const Emitters *emitters, Index i, const Real place[2], const Real way[2], Features f)
{
    (void)place;
    Real extent = of_light(emitters->extent, i, f);
    Vec d = vec_from_frame(vec_of_light(emitters->edge_x, i, f), sample_cone(way[0], way[1], extent));
    Real falloff = falloff_of(emitters, i, vec_neg(d), f);
    return (FirstRay){vec_of_light(emitters->position, i, f), d, index_of(-1), light_all(falloff / pdf_w_cone(extent))};
}

INLINE EmitPdf spot_emit_pdf(const Emitters *emitters, Index i, Vec o, Vec d, Features f)
{
    (void)o, (void)d;
    return (EmitPdf){real(1), pdf_w_cone(of_light(emitters->extent, i, f)), real(1), mask_none(), mask_none()};
}

#endif
