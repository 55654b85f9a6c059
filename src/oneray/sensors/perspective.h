/* The pinhole camera. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

typedef struct perspective {
    double fov;   /* degrees, that the image spans along … */
    int fov_axis; /* … the x or the y axis, the diagonal, the smaller or the larger side */
    double near_clip, far_clip;
    Affine to_world; /* camera space to world: looks along +z, +x is to the LEFT, +y up */
} Perspective;

enum { FOV_X, FOV_Y, FOV_DIAGONAL, FOV_SMALLER, FOV_LARGER };

static inline void perspective_check(void *plugin, Said *said)
{
    const Perspective *s = plugin;
    if (!given(said, "fov"))
        fail(said, "<sensor> needs a field of view: <float name=\"fov\" value=\"40\"/>, in degrees");
    if (s->near_clip >= s->far_clip)
        fail(said, "\"near_clip\" is %g and must be less than \"far_clip\", %g", s->near_clip, s->far_clip);
    if (fabs(affine_uniform_scale(&s->to_world, 1e-3) - 1) > 1e-3)
        fail(given(said, "to_world"), "\"to_world\" of a sensor must not scale or shear");
}
static const Plugin perspective_plugin = {"perspective", perspective_check, {
    {"fov", AS_FLOAT, offsetof(Perspective, fov), "(0,180)", ""},
    {"fov_axis", AS_WORD, offsetof(Perspective, fov_axis), "x, y, diagonal, smaller, larger", "x"},
    {"near_clip", AS_FLOAT, offsetof(Perspective, near_clip), "(0,inf)", ".01"},
    {"far_clip", AS_FLOAT, offsetof(Perspective, far_clip), "(0,inf)", "1e4"},
    {"to_world", AS_TRANSFORM, offsetof(Perspective, to_world), NULL, ""}}};

/* Half extents of an image of this aspect, width over height, at distance 1. */
static inline void perspective_extent(const Perspective *s, double aspect, double half[2])
{
    bool along_x = s->fov_axis == FOV_X || s->fov_axis == (aspect > 1 ? FOV_LARGER : FOV_SMALLER);
    half[0] = tan(s->fov * PI / 360);
    if (s->fov_axis == FOV_DIAGONAL)
        half[0] *= aspect / hypot(aspect, 1);
    else if (!along_x && aspect != 1)
        half[0] *= aspect;
    half[1] = half[0] / aspect;
}

static inline SensorTraits perspective_traits(const Perspective *s, int width, int height)
{
    SensorTraits traits = {.farthest = s->far_clip};
    double half[2];
    perspective_extent(s, (double)width / height, half);
    column(&s->to_world, 3, traits.origin);
    column(&s->to_world, 2, traits.axis);
    normalise(traits.axis);
    traits.pixel = fmin(2 * half[0] / width, 2 * half[1] / height);
    traits.cosine = 1 / hypot(1, hypot(half[0], half[1]));
    return traits;
}

/* Primary rays, one pixel's box filter, and the way back. */
#ifdef LANES

#include "sensors/eye.h"

typedef struct perspective_row {
    Num origin[3], left[3], up[3],
        forward[3]; /* left and up reach the edges of the image at forward's distance 1 */
    Num near_clip, far_clip;
    Num pixel_width, pixel_height; /* in units of the half image: 2/width, 2/height */
    Num to_left[3], to_up[3];      /* left and up over their squared lengths: a point's place in the image */
    Num film_area;                 /* of the image at forward's distance 1 */
} PerspectiveRow;

static inline void perspective_row(const Perspective *perspective, int width, int height, PerspectiveRow *camera)
{
    double extent[3] = {0, 0, 1}, axis[3], out[3], back[3];
    perspective_extent(perspective, (double)width / height, extent);
    column(&perspective->to_world, 3, axis);
    store(camera->origin, axis);
    for (int j = 0; j < 3; j++) {
        Num *const to[3] = {camera->left, camera->up, camera->forward};
        column(&perspective->to_world, j, axis);
        double one = length(axis);
        for (int i = 0; i < 3; i++) {
            out[i] = axis[i] * (extent[j] / one);
            back[i] = axis[i] / (one * extent[j]);
        }
        store(to[j], out);
        if (j < 2)
            store(j ? camera->to_up : camera->to_left, back);
    }
    camera->near_clip = (Num)perspective->near_clip;
    camera->far_clip = (Num)perspective->far_clip;
    camera->pixel_width = (Num)(2.0 / width);
    camera->pixel_height = (Num)(2.0 / height);
    camera->film_area = (Num)(4 * extent[0] * extent[1]);
}

/* The ray through the point (x, y) of the film, in pixels from its upper left corner. It starts on the near
   plane and ends on the far plane, as Mitsuba's does. */
STAGE Ray perspective_ray(const PerspectiveRow *camera, Real x, Real y)
{
    Real a = real(1) - x * real(camera->pixel_width), b = real(1) - y * real(camera->pixel_height);
    Vec d = vec_add(vec_of(camera->forward),
        vec_add(vec_scale(vec_of(camera->left), a), vec_scale(vec_of(camera->up), b)));
    Ray ray = {
        vec_add(vec_of(camera->origin), vec_scale(d, real(camera->near_clip))), d, real(0), index_of(-1)};
    Real length = vec_length(d);
    ray.d = vec_scale(d, real(1) / length);
    ray.tmax = (real(camera->far_clip) - real(camera->near_clip)) * length;
    return ray;
}

/* L17 The other way round. */
INLINE Eye perspective_eye(const PerspectiveRow *camera, Vec p)
{
    Vec from_eye = vec_sub(p, vec_of(camera->origin));
    Real z = vec_dot(from_eye, vec_of(camera->forward)), inverse_z = real(1) / z;
    Eye eye;
    eye.distance = vec_length(from_eye);
    eye.wi = vec_scale(from_eye, real(-1) / eye.distance);
    eye.to_near = eye.distance * (real(1) - real(camera->near_clip) * inverse_z);
    Real a = vec_dot(from_eye, vec_of(camera->to_left)) * inverse_z;
    Real b = vec_dot(from_eye, vec_of(camera->to_up)) * inverse_z;
    eye.x = (real(1) - a) / real(camera->pixel_width);
    eye.y = (real(1) - b) / real(camera->pixel_height);
    eye.weight = eye.distance * inverse_z * inverse_z * inverse_z / real(camera->film_area);
    eye.seen = (z > real(camera->near_clip)) & (z < real(camera->far_clip)) & (a > real(-1)) & (a <= real(1))
               & (b > real(-1)) & (b <= real(1));
    return eye;
}

#endif
