/* Lights: choosing one, choosing a point on it, and the density of both. A light here is what one ray can be
   sent to: an area light on a cube counts as its six faces. */
#ifndef ONERAY_LIGHT_H
#define ONERAY_LIGHT_H

#include "sample.h"
#include "shape.h"

typedef enum {
    SITE_RECTANGLE,
    SITE_DISK,
    SITE_SPHERE,
    SITE_POINT,
    SITE_SPOT,
    SITE_DIRECTIONAL,
    SITE_CONSTANT
} Site;

typedef struct {
    int count;
    Int *site;          /* Site, by light, as all below */
    Num (*emission)[3]; /* radiance, intensity or irradiance (description.h) */
    Num (*position)[3]; /* center of a flat light or sphere; point, spot */
    Num (*edge_x)[3],
        (*edge_y)[3];        /* flat: half the sides; edge_x of a spot or directional light: its direction */
    Num (*normal)[3];        /* flat: unit normal of the side that shines */
    Num *radius;             /* sphere, negative where it shines inwards */
    Num *cutoff, *beam;      /* spot: angles, radians */
    Num *area_choice;        /* A/p_i, m²: what one sample stands for; 1/p_i where there is no area */
    Int *slot;               /* the surface it is, -1 for none */
    Num *alias_share;        /* alias table: stay with the light drawn if below this, … */
    Int *alias;              /* … else take this one */
    Num (*slot_emission)[3]; /* by slot: radiance along the slot's normal, 0 for what is no light */
    Num *slot_area_choice;   /* by slot: A/p_i */
    Num environment[3];      /* radiance of the constant light, and its 1/p_i */
    Num environment_choice;
} Lights;

typedef struct {
    Vec wi; /* unit vector to the light */
    Real distance;
    Vec weight;         /* emission / (p_i pdf_w): what reaches the point if nothing is in between */
    Real inverse_pdf_w; /* 1/(p_i pdf_w), sr; 0 where no random ray could hit the light */
    Index slot;
} LightSample;

/* The one place where a density per area on a light becomes one per solid angle, pdf_w = p_i/A ·
   d²/cosθ_light, here its inverse. Sampling a light and weighing a light that was hit both call it. */
INLINE Real inverse_pdf_w_area(Real area_choice, Real distance_squared, Real cosine)
{
    return area_choice * cosine / distance_squared;
}
INLINE Real inverse_pdf_w_environment(const Lights *lights)
{
    return real(lights->environment_choice) / pdf_w_sphere();
}

/* L13 Multiple importance sampling: the weight of a direction that was sampled by way of the light, given the
   ratio of the two densities, w_light = p_light^β / (p_light^β + p_bounce^β), β = 1 balance, β = 2 power. The
   same direction sampled by the bounce gets 1 - w_light: the two always sum to 1. Veach, Robust Monte Carlo
   Methods, 1997, 9.2. */
INLINE Real mis_weight_light(Real bounce_over_light, Features f)
{
    Real x = f & USE_BALANCE ? bounce_over_light : bounce_over_light * bounce_over_light;
    return real(1) / (real(1) + x);
}

/* L4 N lights with one ray: light i with probability p_i, here by an alias table (Vose 1991), whatever
   N is. */
INLINE Index choose_light(const Lights *lights, Real u, Real v, Features f)
{
    if (!(f & HAS_MANY_LIGHTS))
        return index_of(0);
    Index i = real_floor(u * real(lights->count));
    return index_select(v < gather(lights->alias_share, i), i, gather_index(lights->alias, i));
}

/* A light's number or vector; without a choice there is only light 0 and nothing to look up. */
INLINE Real of_light(const Num *table, Index i, Features f)
{
    return f & HAS_MANY_LIGHTS ? gather(table, i) : real(table[0]);
}
INLINE Vec vec_of_light(Num (*table)[3], Index i, Features f)
{
    return f & HAS_MANY_LIGHTS ? vec_gather((const Num(*)[3])table, i) : vec_of(table[0]);
}
INLINE Mask light_is(const Lights *lights, Site site, Index i, Features f)
{
    return (f & HAS_MANY_LIGHTS ? gather_index(lights->site, i) : index_of(lights->site[0]))
           == index_of(site);
}

/* The spot's share of its intensity at this angle to its axis (radians): 1 within the beam, 0 beyond the
   cutoff, linear between. */
INLINE Real spot_falloff(Real angle, Real beam, Real cutoff)
{
    Real ramp = real_max((cutoff - angle) / (cutoff - beam), real(0));
    return select(angle <= beam, real(1), ramp);
}

/* L2, L3, L5 A uniform point of a flat light or a sphere, and the normal there. */
INLINE void sample_area(const Lights *lights, Index i, Real u, Real v, Vec *point, Vec *normal, Features f)
{
    Vec center = vec_of_light(lights->position, i, f);
    if (f & HAS_FLAT_LIGHT) {
        Real x, y, disk_x, disk_y;
        sample_square(u, v, &x, &y);
        if (f & HAS_DISK) {
            Mask disk = light_is(lights, SITE_DISK, i, f);
            sample_disk(u, v, &disk_x, &disk_y);
            x = select(disk, disk_x, x);
            y = select(disk, disk_y, y);
        }
        *point = vec_add(center, vec_add(vec_scale(vec_of_light(lights->edge_x, i, f), x),
                                     vec_scale(vec_of_light(lights->edge_y, i, f), y)));
        *normal = vec_of_light(lights->normal, i, f);
    }
    if (f & HAS_SPHERE_LIGHT) {
        Mask ball = light_is(lights, SITE_SPHERE, i, f);
        Real radius = of_light(lights->radius, i, f);
        Vec direction = vec_scale(sample_sphere(u, v), flip_sign(real(1), radius));
        *point = vec_select(ball, vec_add(center, vec_scale(direction, radius)), *point);
        *normal = vec_select(ball, direction, *normal);
    }
}

/* L1, L2 Towards a point at a distance: E = I cosθ/d² from a point light (I in W·sr⁻¹: Mitsuba's intensity,
   the lecture's flux / 4π), from an area light L A cosθ_light cosθ/d². The receiver's cosine is left to the
   caller. */
INLINE void sample_near_light(
    const Lights *lights, Index i, Vec p, Real u, Real v, LightSample *s, Features f)
{
    Vec point = vec_of_light(lights->position, i, f), normal = vec_all(real(0));
    Mask area = mask_none();
    if (f & HAS_AREA) {
        area = mask_all();
        if (f & (HAS_POINT | HAS_SPOT | HAS_DIRECTIONAL | HAS_CONSTANT))
            area = (f & HAS_MANY_LIGHTS ? gather_index(lights->slot, i) : index_of(lights->slot[0])) >= 0;
        Vec area_point = point;
        sample_area(lights, i, u, v, &area_point, &normal, f);
        point = vec_select(area, area_point, point);
    }
    Vec delta = vec_sub(point, p);
    Real distance_squared = vec_dot(delta, delta), choice = of_light(lights->area_choice, i, f);
    s->distance = real_sqrt(distance_squared);
    s->wi = vec_scale(delta, real(1) / s->distance);
    Real cosine = -vec_dot(normal, s->wi);
    s->inverse_pdf_w = only(area & (cosine > real(0)), inverse_pdf_w_area(choice, distance_squared, cosine));
    Real share = select(area, s->inverse_pdf_w, choice / distance_squared);
    if (f & HAS_SPOT) {
        Mask spot = light_is(lights, SITE_SPOT, i, f);
        Vec axis = vec_of_light(lights->edge_x, i, f);
        Real angle = angle_of(vec_length(vec_cross(axis, s->wi)), -vec_dot(axis, s->wi));
        Real falloff = spot_falloff(angle, of_light(lights->beam, i, f), of_light(lights->cutoff, i, f));
        share = select(spot, share * falloff, share);
    }
    s->weight = vec_all(share);
}

/* One ray to one light: u[0], u[3] choose the light, u[1], u[2] the point on it. */
INLINE LightSample sample_light(const Lights *lights, Vec p, const Real u[4], Features f)
{
    Index i = choose_light(lights, u[0], u[3], f);
    LightSample s = {vec_all(real(0)), real(NUM_MAX), vec_all(real(0)), real(0), index_of(-1)};
    if (f & (HAS_AREA | HAS_POINT | HAS_SPOT))
        sample_near_light(lights, i, p, u[1], u[2], &s, f);
    if (f & HAS_AREA)
        s.slot = f & HAS_MANY_LIGHTS ? gather_index(lights->slot, i) : index_of(lights->slot[0]);
    if (f & HAS_DIRECTIONAL) {
        Mask far = light_is(lights, SITE_DIRECTIONAL, i, f);
        s.wi = vec_select(far, vec_neg(vec_of_light(lights->edge_x, i, f)), s.wi);
        s.distance = select(far, real(NUM_MAX), s.distance);
        s.weight = vec_select(far, vec_all(of_light(lights->area_choice, i, f)), s.weight);
        s.inverse_pdf_w = only(mask_not(far), s.inverse_pdf_w);
    }
    if (f & HAS_CONSTANT) {
        Mask sky = light_is(lights, SITE_CONSTANT, i, f);
        s.wi = vec_select(sky, sample_sphere(u[1], u[2]), s.wi);
        s.distance = select(sky, real(NUM_MAX), s.distance);
        s.inverse_pdf_w = select(sky, inverse_pdf_w_environment(lights), s.inverse_pdf_w);
        s.weight = vec_select(sky, vec_all(s.inverse_pdf_w), s.weight);
    }
    s.weight = vec_mul(s.weight, vec_of_light(lights->emission, i, f));
    return s;
}

#endif
