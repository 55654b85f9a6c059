/* A light in a point that shines into a cone along +z of its own space: with all its intensity up to an angle of
   beam_width from the axis, from there less and less, and not at all beyond cutoff_angle. */
#ifndef ONERAY_EMITTERS_SPOT_H
#define ONERAY_EMITTERS_SPOT_H

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct spot {
    Affine to_world;
    double intensity[3];             /* on the axis, W·sr⁻¹ */
    double cutoff_angle, beam_width; /* degrees in the file, radians once it is checked */
    double position[3], direction[3];
} Spot;

static const Field spot_fields[] = {
    {"to_world", AS_TRANSFORM, offsetof(Spot, to_world), NULL, ""},
    {"intensity", AS_COLOUR, offsetof(Spot, intensity), "[0,inf)", "1"},
    {"cutoff_angle", AS_FLOAT, offsetof(Spot, cutoff_angle), "(0,180]", "20"},
    {"beam_width", AS_FLOAT, offsetof(Spot, beam_width), "[0,180]", ""},
    {0},
};

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
static const Plugin spot_plugin = {"spot", spot_fields, spot_check};

/* The flux is that of the cone up to the middle of its rim. */
static inline EmitterTraits spot_traits(const Spot *e)
{
    double flux = 2 * PI * (1 - cos((e->cutoff_angle + e->beam_width) / 2));
    bool sharp = e->cutoff_angle < 1e-3 || e->cutoff_angle - e->beam_width < 1e-3 * e->cutoff_angle;
    return (EmitterTraits){FROM_POINT, e->intensity, e->position, flux,
        sharp ? "a spot with a cone or rim of less than 0.001" : NULL};
}

#endif
