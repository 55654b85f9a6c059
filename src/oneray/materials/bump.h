/* P4 Bumps: a surface whose normal a picture turns, by the slope of heights (bumpmap) or as it stands there (normalmap).
   Blinn, Simulation of Wrinkled Surfaces, SIGGRAPH 1978, by the formulas that Mitsuba 3.9.1 has (src/bsdfs/bumpmap.cpp,
   normalmap.cpp, src/textures/bitmap.cpp). */
#pragma once

#include "fields.h"
#include "traits.h"

typedef struct bump {
    double scale;
    bool flips, shadowed;
    bool is_normal_map;
    bool turned; /* it is seen from behind as if from the front: a twosided is around it */
    int texture; /* the description's n-th, from 1 on; 0: no bump */
} Bump;

static inline void bump_check(void *plugin, Said *said)
{
    Bump *bump = plugin;
    if (!bump->flips)
        fail(given(said, "flip_invalid_normals"), "\"flip_invalid_normals\" = \"false\" is not supported (true)");
    bump->is_normal_map = strcmp(said->type, "normalmap") == 0;
}

static const Plugin bumpmap_plugin = {"bumpmap", bump_check, {
    {"scale", AS_FLOAT, offsetof(Bump, scale), "[-1e6,1e6]", "1"},
    {"flip_invalid_normals", AS_BOOLEAN, offsetof(Bump, flips), NULL, "true"},
    {"use_shadowing_function", AS_BOOLEAN, offsetof(Bump, shadowed), NULL, "true"}}};
static const Plugin normalmap_plugin = {"normalmap", bump_check, {
    {"flip_invalid_normals", AS_BOOLEAN, offsetof(Bump, flips), NULL, "true"},
    {"use_shadowing_function", AS_BOOLEAN, offsetof(Bump, shadowed), NULL, "true"}}};

#ifdef LANES

#include "materials/material.h"

/* A row of Materials.bump; of zeros where there is none. */
static inline void bump_row(const Bump *bump, int side, Num row[4])
{
    row[0] = (Num)bump->texture;
    row[1] = (Num)(bump->is_normal_map ? 0 : bump->scale);
    row[2] = bump->is_normal_map ? 1 : 2;
    if (side && !bump->turned) /* from behind, what is along the surface is the other way */
        row[2] = -row[2];
    row[3] = bump->shadowed;
}

/* A surface as a part sees it whose normal is turned. */
typedef struct {
    Surface at;
    Mask bumped;
    Real alpha2; /* of the shadows of bumps, a microfacets' roughness */
} BumpedSurface;

/* The normal is z times the old one and `along`, a vector across it, if the viewer sees it so; else -along. */
APART BumpedSurface bumped_surface(const Materials *materials, Index row, const Surface *s, Features f)
{
    BumpedSurface b = {*s, mask_none(), real(0)};
    Real said[4];
    gather_four(materials->bump, row * 4, said);
    Index texture = real_floor(said[0]);
    b.bumped = texture > 0;
    if (!any(b.bumped))
        return b;
    Mask by_height = real_abs(said[2]) > real(1);
    Vec n = vec_select((s->row & 1) != 0, vec_neg(s->n), s->n); /* that of the shape, or interpolated */
    Vec tangent = vec_normalize(vec_sub(s->dp_du, vec_scale(n, vec_dot(n, s->dp_du))));
    Light value = texture_at(&materials->textures, texture, s->u, s->v, f);
    Vec local = vec(real(2) * value.r - real(1), real(2) * value.g - real(1), real(2) * value.b - real(1));
    Vec along = vec_add(vec_scale(tangent, local.x), vec_scale(vec_cross(n, tangent), local.y));
    Real z = local.z;
    if (any(by_height)) { /* dp/du and dp/dv as the heights turn them */
        Real slope[2];
        texture_slope(&materials->textures, texture, s->u, s->v, slope, f);
        Vec u = vec_add(s->dp_du, vec_scale(n, said[1] * slope[0] - vec_dot(n, s->dp_du)));
        Vec v = vec_add(s->dp_dv, vec_scale(n, said[1] * slope[1] - vec_dot(n, s->dp_dv)));
        Vec turned = vec_normalize(vec_cross(u, v));
        turned = vec_scale(turned, flip_sign(real(1), vec_dot(s->face, turned)));
        Real up = vec_dot(turned, n);
        along = vec_select(by_height, vec_sub(turned, vec_scale(n, up)), along);
        z = select(by_height, up, z);
    }
    along = vec_scale(along, flip_sign(real(1), said[2]));
    Vec as_seen = vec_scale(s->n, z);
    along = vec_select(vec_dot(s->wo, vec_add(as_seen, along)) > real(0), along, vec_neg(along));
    Vec turned = vec_normalize(vec_add(as_seen, along));
    b.at.n = vec_select(b.bumped, turned, s->n);
    b.at.cos_o = select(b.bumped, vec_dot(turned, s->wo), s->cos_o);
    b.at.dp_du = vec_select(b.bumped, tangent, s->dp_du);
    Real c = vec_dot(turned, s->n), cc = c * c;
    b.alpha2 = only(b.bumped & (said[3] > real(0)), real_min(real(0.125) * real_max(real(1) - cc, real(0)) / cc, real(1)));
    return b;
}

/* What of the light from wi its part is to get: none where wi is not on the same side of both normals, nor where
   the viewer is not; else by Estevez et al., A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem,
   Ray Tracing Gems, 2019. `cosine` is of the surface's own normal, `turned` of that which the bump makes. */
INLINE Real bump_shadow(const BumpedSurface *b, Real cosine, Real turned)
{
    Mask same = ((cosine > real(0)) & (turned > real(0))) | ((cosine < real(0)) & (turned < real(0)));
    Real cc = cosine * cosine, tan2 = real_max(real(1) - cc, real(0)) / cc;
    Real shadow = real(2) / (real(1) + real_sqrt(real(1) + b->alpha2 * tan2));
    return select(b->bumped, only(same & (b->at.cos_o > real(0)), shadow), real(1));
}

#endif
