/* Lights: their tables, and the points on them. Which light is chosen is light_choice.h's. A light here is
   what one ray can be sent to: an area light on a cube counts as its six faces. */
#ifndef ONERAY_EMITTERS_EMITTER_H
#define ONERAY_EMITTERS_EMITTER_H

#include "lanes/sample.h"
#include "shapes/shape.h"

typedef enum {
    SITE_RECTANGLE,
    SITE_DISK,
    SITE_TRIANGLE,
    SITE_SPHERE,
    SITE_POINT,
    SITE_SPOT,
    SITE_DIRECTIONAL,
    SITE_CONSTANT
} Site;

/* The lights as a tree, for choosing one by what it may contribute (light_choice.h). Node 0 is the root; the
   children of a node are next to each other. */
enum {
    NODE_CENTER = 0,
    NODE_RADIUS = 3, /* a ball around the node's lights */
    NODE_AXIS = 4,
    NODE_COS = 7,
    NODE_SIN = 8,    /* a cone around the normals of what shines */
    NODE_SLACK = 9,  /* how much nearer than the center's the cosine at the light can come, m */
    NODE_POWER = 10, /* Φ/π of lights at a place, W·sr⁻¹ */
    NODE_FAR = 11,   /* irradiance of lights without a place, W·m⁻² */
    NODE_COUNT = 12, /* lights below */
    NODE_NUMBERS = 16 /* in fours */
};
enum { LEARNED_NODES = 127 }; /* those nodes, the uppermost, have a learned visibility */

typedef struct {
    Num *nodes;        /* [node][NODE_NUMBERS] */
    Int *child;        /* by node: its first child, or -1 - light */
    Int *trail;        /* by light: the way down to it, bit k set where level k goes to the second child */
    Num uniform_share; /* how often the choice goes by count instead of by contribution */
    Num *visible;      /* [region][LEARNED_NODES]: how often the way to the node's lights is free; NULL while
                          nothing is learned */
    Num low[3], scale[3]; /* regions: cells of a grid, region i of axis a from low + i/scale */
    Int size[3];
} LightTree;

/* A rectangle in units of its longer half side M. */
enum {
    PANEL_X = 0,
    PANEL_Y = 1, /* its half sides */
    PANEL_INVERSE_X = 2,
    PANEL_INVERSE_Y = 3,
    PANEL_ALONG_X = 4,
    PANEL_ALONG_Y = 5, /* from what a vector has along edge_x, edge_y (m²) */
    PANEL_SCALE = 6,   /* 1/M, m⁻¹ */
    PANEL_NUMBERS = 8
};

typedef struct {
    int count;
    Int *site;          /* Site, by light, as all below */
    Num (*emission)[3]; /* radiance, intensity or irradiance (description.h) */
    Num (*position)[3]; /* center of a flat light or sphere; point, spot */
    Num (*edge_x)[3],
        (*edge_y)[3];        /* flat: half the sides, of a triangle two sides from one corner; edge_x of a spot or directional light: its direction */
    Num (*normal)[3];        /* flat: unit normal of the side that shines */
    Num (*panel)[8];         /* PANEL_*: of a rectangle with right angles, else 0 */
    Num *radius;             /* sphere, negative where it shines inwards */
    Num *cutoff, *beam;      /* spot: angles, radians */
    Num *area;               /* m²; 1 where there is none */
    Num *inverse_choice;     /* 1/p_i of the choice by uniform or power */
    Int *slot;               /* the surface it is, -1 for none */
    Num *alias_share;        /* alias table: stay with the light drawn if below this, … */
    Int *alias;              /* … else take this one */
    LightTree tree;
    Num (*slot_emission)[3]; /* by slot: radiance along the slot's normal, 0 for what is no light */
    Int *slot_light;         /* by slot: which light it is, 0 for what is none; of a mesh, what to add to
                                the triangle's slot */
    Num environment[3];      /* radiance of the constant light, and which light it is */
    Int environment_light;
    Num world_center[3], world_radius; /* a ball around the scene, which far lights shine on */
} Emitters;

/* The point that light is wanted at: n is the normal on the side that matters, slot what it lies on. */
typedef struct {
    Vec p, n;
    Index slot;
} Receiver;

typedef struct {
    Vec wi; /* unit vector to the light */
    Real distance;
    Vec weight;         /* emission / (p_i pdf_w): what reaches the point if nothing is in between */
    Real inverse_pdf_w; /* 1/(p_i pdf_w), sr; 0 where no random ray could hit the light */
    Index slot, emitter;
} LightSample;

/* A light's number or vector; without a choice there is only light 0 and nothing to look up. */
INLINE Real of_light(const Num *table, Index i, Features f)
{
    return f.has & HAS_MANY_LIGHTS ? gather(table, i) : real(table[0]);
}
INLINE Vec vec_of_light(Num (*table)[3], Index i, Features f)
{
    return f.has & HAS_MANY_LIGHTS ? vec_gather((const Num(*)[3])table, i) : vec_of(table[0]);
}
INLINE Index index_of_light(const Int *table, Index i, Features f)
{
    return f.has & HAS_MANY_LIGHTS ? gather_index(table, i) : index_of(table[0]);
}
INLINE Mask light_is(const Emitters *emitters, Site site, Index i, Features f)
{
    return index_of_light(emitters->site, i, f) == index_of(site);
}

/* L5 How a sphere light looks from a point: the one decision of inside or outside, which sampling it and its
   density share. A point of the sphere itself is not outside. */
typedef struct {
    Mask outside;
    Vec axis; /* unit vector to the center */
    Real distance;
    Real extent; /* 1 - cosθmax of the cone that it fills, sinθmax = R/d = s: s²/(1 + √((1-s)(1+s))) */
    Mask sets;   /* its center is below the receiver's horizon, part of it above */
    Real below;  /* then: sine of the center's depth below the horizon, … */
    Real rise, turn; /* … of the height of what is above, and half its width in azimuth (radians) */
} SphereView;

/* What is above the horizon of a cone that sets, sinθmax = s, its axis below by the angle β, sinβ = b: heights z
   from 0 to sin(θmax - β) = (s² - b²)/(s cosβ + b cosθmax), azimuths to either side up to φ at the horizon, cosφ =
   cosθmax/cosβ, tanφ = √(s² - b²)/cosθmax. It fills two thirds or more of that block, whose solid angle is 2φ z. */
INLINE void view_setting(SphereView *view, Real s)
{
    Real b = view->below, above = (s - b) * (s + b), cos_max = real_sqrt((real(1) - s) * (real(1) + s));
    view->rise = above / (s * real_sqrt((real(1) - b) * (real(1) + b)) + b * cos_max);
    view->turn = angle_of(real_sqrt(real_max(above, real(0))), cos_max);
}
#define DEEPEST_SETTING 0.999 /* sine; a sphere still deeper is all but underfoot: its azimuth says little */

INLINE SphereView view_sphere(const Emitters *emitters, Index i, const Receiver *at, Features f)
{
    SphereView view;
    Vec to_center = vec_sub(vec_of_light(emitters->position, i, f), at->p);
    Real radius = real_abs(of_light(emitters->radius, i, f));
    view.distance = vec_length(to_center);
    view.axis = vec_scale(to_center, real(1) / view.distance);
    view.outside = light_is(emitters, SITE_SPHERE, i, f) & (view.distance > radius)
                   & (at->slot != index_of_light(emitters->slot, i, f));
    Real s = radius / view.distance;
    view.extent = s * s / (real(1) + real_sqrt((real(1) - s) * (real(1) + s)));
    view.sets = mask_none();
    if (f.use & USE_CONE) {
        view.below = -vec_dot(at->n, view.axis);
        view.sets = view.outside & (view.below > real(0)) & (view.below < real_min(s, real(DEEPEST_SETTING)));
        if (any(view.sets))
            view_setting(&view, s);
    }
    return view;
}

/* L5 A rectangle as the point sees it, for sampling it uniformly by solid angle: Ureña, Fajardo, King, An
   Area-Preserving Parametrization for Spherical Rectangles, EGSR 2013. In its own axes around the point, in units
   of its longer half side, it spans x0 … x1, y0 … y1 at height -z. Where it looks small, or nearly edge-on, its
   area serves as well and loses no digits: that is decided here, once, for sampling and density. */
typedef struct {
    Mask serves;
    Real x0, x1, y0, y1, z;
    Real re, im;      /* of a complex number whose argument is the sum of the angles at the corners with x0 */
    Real solid_angle; /* sr */
    Real center_x, center_y, inverse_x, inverse_y; /* of the rectangle; over its half sides */
} RectangleView;

#define RECTANGLE_NEAR 4.0 /* (distance / half diagonal)² beyond which it looks small */
#ifdef SINGLE
#define LEAST_SOLID_ANGLE 0.05
#else
#define LEAST_SOLID_ANGLE 1e-4
#endif

/* The solid angle is the excess of the four angles over 2π. Each has its cosine from the two edges that meet,
   as -n·n' of their planes' normals, and is the argument of ∓xy + i z r at a corner (x, y) at distance r: Ureña's
   four arccosines in one argument of a product, whose imaginary part keeps its digits as z goes to 0. */
INLINE void see_rectangle(RectangleView *view)
{
    Real x0 = view->x0, x1 = view->x1, y0 = view->y0, y1 = view->y1, z = view->z, zz = z * z;
    Real near_y0 = y0 * y0 + zz, near_y1 = y1 * y1 + zz, yy = y0 * y1;
    Real r00 = real_sqrt(x0 * x0 + near_y0), r01 = real_sqrt(x0 * x0 + near_y1);
    Real r10 = real_sqrt(x1 * x1 + near_y0), r11 = real_sqrt(x1 * x1 + near_y1);
    view->re = -(x0 * x0 * yy + zz * r01 * r00), view->im = z * (x0 * (y1 * r00 - y0 * r01));
    Real re_1 = -(x1 * x1 * yy + zz * r10 * r11), im_1 = z * (x1 * (y0 * r11 - y1 * r10));
    Real re = view->re * re_1 - view->im * im_1, im = view->re * im_1 + view->im * re_1;
    Real angle = angle_of(real_abs(im), re);
    Mask below = (x0 <= real(0)) & (x1 >= real(0)) & (y0 <= real(0)) & (y1 >= real(0)); /* beyond π only there */
    Real beyond = only(below | (re < real(0)), select(below, real(2) * REAL_PI - angle, angle));
    view->solid_angle = select((im > real(0)) | (and_not(im == real(0), below)), angle, beyond);
}

STAGE RectangleView view_rectangle(const Emitters *emitters, Index i, const Receiver *at, Features f)
{
    RectangleView view;
    Real panel[PANEL_NUMBERS];
    if (f.has & HAS_MANY_LIGHTS) {
        gather_four(emitters->panel[0], i * PANEL_NUMBERS, panel);
        gather_four(emitters->panel[0] + 4, i * PANEL_NUMBERS, panel + 4);
    }
#define PANEL(k) (f.has & HAS_MANY_LIGHTS ? panel[k] : real(emitters->panel[0][k]))
    Real half_x = PANEL(PANEL_X), half_y = PANEL(PANEL_Y), scale = PANEL(PANEL_SCALE);
    Vec to_center = vec_sub(vec_of_light(emitters->position, i, f), at->p), d = vec_scale(to_center, scale);
    view.serves =
        (half_x > real(0)) & (vec_dot(d, d) < real(RECTANGLE_NEAR) * (half_x * half_x + half_y * half_y));
    if (!any(view.serves))
        return view;
    view.center_x = vec_dot(to_center, vec_of_light(emitters->edge_x, i, f)) * PANEL(PANEL_ALONG_X);
    view.center_y = vec_dot(to_center, vec_of_light(emitters->edge_y, i, f)) * PANEL(PANEL_ALONG_Y);
    view.inverse_x = PANEL(PANEL_INVERSE_X), view.inverse_y = PANEL(PANEL_INVERSE_Y);
#undef PANEL
    view.x0 = view.center_x - half_x, view.x1 = view.center_x + half_x;
    view.y0 = view.center_y - half_y, view.y1 = view.center_y + half_y;
    view.z = real_abs(vec_dot(d, vec_of_light(emitters->normal, i, f)));
    see_rectangle(&view);
    view.serves &= view.solid_angle > real(LEAST_SOLID_ANGLE);
    return view;
}

/* The point of the rectangle for (u, v): its x from the spherical excess u Ω, its y along the arc there. Ureña's
   f_u, with the root of its denominator taken out: F = f_u √(y0² + z²), x = z √((y0² + z²)/(F² - z²)). */
INLINE void sample_spherical_rectangle(const RectangleView *view, Real u, Real v, Real *x, Real *y)
{
    Real sine, cosine, zz = view->z * view->z, y0 = view->y0, y1 = view->y1;
    sincos_turn(u * view->solid_angle * (real(0.5) * REAL_INV_PI), &sine, &cosine);
    Real near_x0 = view->x0 * view->x0 + zz, near_y0 = y0 * y0 + zz;
    Real across = sine * view->re - cosine * view->im, along = cosine * view->re + sine * view->im;
    Real excess = -(y0 * along + y1 * near_x0 * near_y0) / across, size = real_abs(excess);
    Real flatness = real_max((size - view->z) * (size + view->z), real(0));
    Real xu = flip_sign(view->z * real_sqrt(near_y0 / flatness), excess);
    *x = real_max(real_min(xu, view->x1), view->x0);
    Real dd = *x * *x + zz, r0 = real_sqrt(dd + y0 * y0), r1 = real_sqrt(dd + y1 * y1);
    Real h = y0 * r1 + v * (y1 * r0 - y0 * r1), r = r0 * r1;
    Real yv = h * real_sqrt(dd / ((r - h) * (r + h)));
    *y = real_max(real_min(yv, y1), y0);
}

INLINE Vec point_of_rectangle(
    const Emitters *emitters, Index i, const RectangleView *view, Real u, Real v, Features f)
{
    Real x, y;
    sample_spherical_rectangle(view, u, v, &x, &y);
    x = (x - view->center_x) * view->inverse_x;
    y = (y - view->center_y) * view->inverse_y;
    return vec_add(vec_of_light(emitters->position, i, f),
        vec_add(vec_scale(vec_of_light(emitters->edge_x, i, f), x),
            vec_scale(vec_of_light(emitters->edge_y, i, f), y)));
}

/* 1/pdf_w (sr) of the direction to a point of light i, given that light i was chosen; 1/d² and cosine are those
   of the point on the light. The one place where densities on lights become densities of directions:
   sampling a light and weighing a light that was hit both call it.
   By area, pdf_w = 1/A · d²/cosθ_light; the facing half of a sphere has half the area; a cone 2π(1 -
   cosθmax), one that sets its block above the horizon; a rectangle its solid angle. */
INLINE Real inverse_pdf_w_point(const Emitters *emitters, Index i, Real inverse_dd, Real cosine,
    const SphereView *sphere, const RectangleView *rectangle, Features f)
{
    Real inverse = of_light(emitters->area, i, f) * cosine * inverse_dd;
    if (f.use & USE_FACING)
        inverse = select(sphere->outside, real(0.5) * inverse, inverse);
    if (f.use & USE_CONE) {
        inverse = select(sphere->outside, real(1) / pdf_w_cone(sphere->extent), inverse);
        if (any(sphere->sets))
            inverse = select(sphere->sets, real(2) * sphere->turn * sphere->rise, inverse);
    }
    if (f.use & USE_SOLID_ANGLE)
        inverse = select(rectangle->serves, rectangle->solid_angle, inverse);
    return inverse;
}

/* The same for a light that the ray from `at` has hit. */
STAGE Real inverse_pdf_w_hit(
    const Emitters *emitters, Index i, const Receiver *at, Real distance, Real cosine, Features f)
{
    SphereView sphere = {0};
    RectangleView rectangle = {0};
    if (f.use & (USE_FACING | USE_CONE))
        sphere = view_sphere(emitters, i, at, f);
    if (f.use & USE_SOLID_ANGLE)
        rectangle = view_rectangle(emitters, i, at, f);
    return inverse_pdf_w_point(emitters, i, real(1) / (distance * distance), cosine, &sphere, &rectangle, f);
}

/* L2, L3, L5 A uniform point of a flat light or a sphere, and the normal there. */
INLINE void sample_area(const Emitters *emitters, Index i, Real u, Real v, Vec *point, Vec *normal, Features f)
{
    Vec center = vec_of_light(emitters->position, i, f);
    if (f.has & (HAS_FLAT_LIGHT | HAS_MESH_LIGHT)) {
        Real x, y, disk_x, disk_y;
        sample_square(u, v, &x, &y);
        if (f.has & HAS_DISK) {
            Mask disk = light_is(emitters, SITE_DISK, i, f);
            sample_disk(u, v, &disk_x, &disk_y);
            x = select(disk, disk_x, x);
            y = select(disk, disk_y, y);
        }
        if (f.has & HAS_MESH_LIGHT) {
            Mask triangle = light_is(emitters, SITE_TRIANGLE, i, f);
            Real second, third;
            sample_triangle(u, v, &second, &third);
            x = select(triangle, second, x);
            y = select(triangle, third, y);
        }
        *point = vec_add(center, vec_add(vec_scale(vec_of_light(emitters->edge_x, i, f), x),
                                     vec_scale(vec_of_light(emitters->edge_y, i, f), y)));
        *normal = vec_of_light(emitters->normal, i, f);
    }
    if (f.has & HAS_SPHERE_LIGHT) {
        Mask ball = light_is(emitters, SITE_SPHERE, i, f);
        Real radius = of_light(emitters->radius, i, f);
        Vec direction = vec_scale(sample_sphere(u, v), flip_sign(real(1), radius));
        *point = vec_select(ball, vec_add(center, vec_scale(direction, radius)), *point);
        *normal = vec_select(ball, direction, *normal);
    }
}

/* L5 A uniform point of the half of the sphere that faces the point: none is wasted on the back. */
INLINE void sample_facing(
    const Emitters *emitters, Index i, const SphereView *view, Real u, Real v, Vec *point, Vec *normal, Features f)
{
    Real radius = of_light(emitters->radius, i, f);
    Vec direction = vec_from_frame(vec_neg(view->axis), sample_hemisphere_uniform(u, v));
    Vec on = vec_add(vec_of_light(emitters->position, i, f), vec_scale(direction, real_abs(radius)));
    *point = vec_select(view->outside, on, *point);
    *normal = vec_select(view->outside, vec_scale(direction, flip_sign(real(1), radius)), *normal);
}

/* A direction in the block above the horizon that holds what is seen of a sphere that sets. */
INLINE Vec sample_setting(const SphereView *view, Vec n, Real u, Real v)
{
    Real sine, cosine, z = u * view->rise, side = real(2) * v - real(1);
    Real across = real_sqrt((real(1) - z) * (real(1) + z)), b = view->below;
    sincos_turn(real_abs(side) * view->turn * (real(0.5) * REAL_INV_PI), &sine, &cosine);
    Vec ahead = vec_scale(
        vec_add(view->axis, vec_scale(n, b)), real(1) / real_sqrt((real(1) - b) * (real(1) + b)));
    Vec wi = vec_add(vec_scale(n, z), vec_scale(ahead, across * cosine));
    return vec_add(wi, vec_scale(vec_cross(n, ahead), across * flip_sign(sine, side)));
}

/* L5 A direction in the cone that the sphere fills, and the distance to the sphere along it, (d-r)(d+r) /
   (d cosθ + √(r² - d² sin²θ)), which keeps its digits however near the sphere is. Returns whether it meets the
   sphere: not all of the block of one that sets does. */
INLINE Mask sample_sphere_cone(const Emitters *emitters, Index i, const Receiver *at, const SphereView *view, Real u,
    Real v, LightSample *s, Features f)
{
    Real radius = real_abs(of_light(emitters->radius, i, f)), d = view->distance;
    Vec local = sample_cone(u, v, view->extent), wi = vec_from_frame(view->axis, local);
    Real cosine = local.z, sine_squared = local.x * local.x + local.y * local.y;
    Mask meets = mask_all();
    if (any(view->sets)) {
        Vec above = sample_setting(view, at->n, u, v), across = vec_cross(view->axis, above);
        wi = vec_select(view->sets, above, wi);
        cosine = select(view->sets, vec_dot(view->axis, above), cosine);
        sine_squared = select(view->sets, vec_dot(across, across), sine_squared);
        meets = and_not(meets, view->sets & (d * d * sine_squared > radius * radius));
    }
    Real root = real_sqrt(real_max(radius * radius - d * d * sine_squared, real(0)));
    s->wi = vec_select(view->outside, wi, s->wi);
    s->distance = select(view->outside, (d - radius) * (d + radius) / (d * cosine + root), s->distance);
    return meets;
}

/* The spot's share of its intensity at this angle to its axis (radians): 1 within the beam, 0 beyond the
   cutoff, linear between. */
INLINE Real spot_falloff(Real angle, Real beam, Real cutoff)
{
    Real ramp = real_max((cutoff - angle) / (cutoff - beam), real(0));
    return select(angle <= beam, real(1), ramp);
}

/* The spot's share of its intensity towards -wi. */
INLINE Real falloff_of(const Emitters *emitters, Index i, Vec wi, Features f)
{
    Vec axis = vec_of_light(emitters->edge_x, i, f);
    Real angle = angle_of(vec_length(vec_cross(axis, wi)), -vec_dot(axis, wi));
    Real falloff = spot_falloff(angle, of_light(emitters->beam, i, f), of_light(emitters->cutoff, i, f));
    return select(light_is(emitters, SITE_SPOT, i, f), falloff, real(1));
}

/* L1, L2 Towards a light at a place: E = I cosθ/d² from a point light (I in W·sr⁻¹: Mitsuba's intensity, the
   lecture's flux / 4π), from an area light L A cosθ_light cosθ/d². The receiver's cosine is left to the
   caller. */
INLINE void sample_near_light(
    const Emitters *emitters, Index i, const Receiver *at, Real u, Real v, LightSample *s, Features f)
{
    Vec point = vec_of_light(emitters->position, i, f), normal = vec_all(real(0));
    SphereView sphere = {0};
    RectangleView rectangle = {0};
    Mask area = mask_none();
    if (f.has & HAS_AREA) {
        area = index_of_light(emitters->slot, i, f) >= 0;
        Vec area_point = point;
        sample_area(emitters, i, u, v, &area_point, &normal, f);
        point = vec_select(area, area_point, point);
    }
    if (f.use & (USE_FACING | USE_CONE))
        sphere = view_sphere(emitters, i, at, f);
    if (f.use & USE_FACING)
        sample_facing(emitters, i, &sphere, u, v, &point, &normal, f);
    if (f.use & USE_SOLID_ANGLE) {
        rectangle = view_rectangle(emitters, i, at, f);
        if (any(rectangle.serves))
            point = vec_select(rectangle.serves, point_of_rectangle(emitters, i, &rectangle, u, v, f), point);
    }
    Vec delta = vec_sub(point, at->p);
    s->distance = vec_length(delta);
    Real inverse_d = real(1) / s->distance, inverse_dd = inverse_d * inverse_d;
    s->wi = vec_scale(delta, inverse_d);
    Real cosine = -vec_dot(normal, s->wi);
    Real inverse = inverse_pdf_w_point(emitters, i, inverse_dd, cosine, &sphere, &rectangle, f);
    Mask shines = area & (cosine > real(0));
    if (f.has & (HAS_FLAT_LIGHT | HAS_MESH_LIGHT)) { /* none sees itself, however its cosine is rounded */
        Mask itself = index_of_light(emitters->slot, i, f) == at->slot;
        if (f.has & HAS_SPHERE_LIGHT)
            itself = and_not(itself, light_is(emitters, SITE_SPHERE, i, f));
        shines = and_not(shines, itself);
    }
    if (f.use & USE_CONE) {
        Mask meets = sample_sphere_cone(emitters, i, at, &sphere, u, v, s, f);
        shines = index_select(sphere.outside, meets & (of_light(emitters->radius, i, f) > real(0)), shines);
    }
    s->inverse_pdf_w = only(shines, inverse);
    s->weight = vec_all(select(area, s->inverse_pdf_w, inverse_dd));
    if (f.has & HAS_SPOT)
        s->weight = vec_scale(s->weight, falloff_of(emitters, i, s->wi, f));
}

/* One ray to light i: (u, v) is the point on it. */
STAGE LightSample sample_light_point(
    const Emitters *emitters, Index i, Real inverse_choice, const Receiver *at, Real u, Real v, Features f)
{
    LightSample s = {vec_all(real(0)), real(NUM_MAX), vec_all(real(0)), real(0), index_of(-1), i};
    if (f.has & (HAS_AREA | HAS_POINT | HAS_SPOT))
        sample_near_light(emitters, i, at, u, v, &s, f);
    if (f.has & HAS_AREA)
        s.slot = index_of_light(emitters->slot, i, f);
    if (f.has & HAS_DIRECTIONAL) {
        Mask far = light_is(emitters, SITE_DIRECTIONAL, i, f);
        s.wi = vec_select(far, vec_neg(vec_of_light(emitters->edge_x, i, f)), s.wi);
        s.distance = select(far, real(NUM_MAX), s.distance);
        s.weight = vec_select(far, vec_all(real(1)), s.weight);
        s.inverse_pdf_w = only(mask_not(far), s.inverse_pdf_w);
    }
    if (f.has & HAS_CONSTANT) {
        Mask sky = light_is(emitters, SITE_CONSTANT, i, f);
        s.wi = vec_select(sky, sample_sphere(u, v), s.wi);
        s.distance = select(sky, real(NUM_MAX), s.distance);
        s.inverse_pdf_w = select(sky, real(1) / pdf_w_sphere(), s.inverse_pdf_w);
        s.weight = vec_select(sky, vec_all(s.inverse_pdf_w), s.weight);
    }
    s.inverse_pdf_w = s.inverse_pdf_w * inverse_choice;
    s.weight = vec_scale(vec_mul(s.weight, vec_of_light(emitters->emission, i, f)), inverse_choice);
    return s;
}

#endif
