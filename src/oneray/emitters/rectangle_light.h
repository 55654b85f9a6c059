/* L5 Rectangles by solid angle. */
#pragma once

#include "emitters/emitter.h"

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
#define LEAST_SOLID_ANGLE BY_PRECISION(0.05, 1e-4)

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
    Real row[8];
    if (f.has & HAS_MANY_LIGHTS)
        gather_row(emitters->panel, i, 8, row);
#define PANEL(number) (f.has & HAS_MANY_LIGHTS ? row[IN_ROW(Panel, number)] : real(emitters->panel->number))
    Real half_x = PANEL(x), half_y = PANEL(y), scale = PANEL(scale);
    Vec to_center = vec_sub(vec_of_light(emitters->position, i, f), at->p), d = vec_scale(to_center, scale);
    view.serves =
        (half_x > real(0)) & (vec_dot(d, d) < real(RECTANGLE_NEAR) * (half_x * half_x + half_y * half_y));
    if (!any(view.serves))
        return view;
    view.center_x = vec_dot(to_center, vec_of_light(emitters->edge_x, i, f)) * PANEL(along_x);
    view.center_y = vec_dot(to_center, vec_of_light(emitters->edge_y, i, f)) * PANEL(along_y);
    view.inverse_x = PANEL(inverse_x), view.inverse_y = PANEL(inverse_y);
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
