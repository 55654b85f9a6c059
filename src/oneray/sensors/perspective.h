/* The pinhole camera. */
#pragma once

#include "sensors/camera.h"
#include "text.h"

typedef struct perspective {
    View view;
    double fov;   /* degrees, that the image spans along … */
    int fov_axis; /* … the x or the y axis, the diagonal, the smaller or the larger side */
    const char *focal_length; /* mm of a film of 36 x 24 mm, "50mm" */
    double principal_point[2]; /* what the image is moved by, to the left and up, in images */
} Perspective;

#define FOV_FIELDS                                                                                           \
    {"fov", AS_FLOAT, offsetof(Perspective, fov), "(0,180)", ""},                                            \
    {"focal_length", AS_STRING, offsetof(Perspective, focal_length), NULL, "50mm"},                          \
    {"fov_axis", AS_WORD, offsetof(Perspective, fov_axis), "x, y, diagonal, smaller, larger", "x"}

enum { FOV_X, FOV_Y, FOV_DIAGONAL, FOV_SMALLER, FOV_LARGER };

/* Degrees along the diagonal of the film. */
static inline double focal_length_fov(const char *text, const Place *place)
{
    double mm;
    size_t length = strlen(text);
    if (length > 2 && strcmp(text + length - 2, "mm") == 0)
        length -= 2;
    if (length >= 64 || !is_number(text, length, &mm) || !(mm > 1e-6 && mm < 1e6))
        fail(place, "\"focal_length\" = \"%.80s\" is not a number of millimetres, as \"50mm\" is", text);
    return 360 / PI * cr_atan2(cr_hypot(36, 24), 2 * mm);
}

static inline void perspective_check(void *plugin, Said *said)
{
    Perspective *s = plugin;
    const Place *length = given(said, "focal_length"), *axis = given(said, "fov_axis");
    if (!given(said, "fov")) {
        if (axis)
            fail(axis, "\"fov_axis\" goes with \"fov\", in degrees, which is not given");
        s->fov = focal_length_fov(s->focal_length, length);
        s->fov_axis = FOV_DIAGONAL;
    } else if (length) {
        fail(length, "<sensor> has \"fov\" and \"focal_length\": write one or the other");
    }
    s->focal_length = NULL;
    view_check(&s->view, said);
    if (fabs(affine_uniform_scale(&s->view.to_world, 1e-3) - 1) > 1e-3)
        fail(given(said, "to_world"), "\"to_world\" of a sensor must not scale or shear");
}
static const Plugin perspective_plugin = {"perspective", perspective_check, {
    FOV_FIELDS,
    {"principal_point_offset_x", AS_FLOAT, offsetof(Perspective, principal_point[0]), "[-100,100]", ""},
    {"principal_point_offset_y", AS_FLOAT, offsetof(Perspective, principal_point[1]), "[-100,100]", ""},
    {"focus_distance", AS_FLOAT, LEFT_OUT, "(0,inf)", ""},
    VIEW_FIELDS}};

/* Half extents of the picture at distance 1, and where its left and upper edge is, in these, to the left and up. */
static inline void perspective_frame(const Perspective *s, const Frame *f, double half[2], double edge[2])
{
    double aspect = (double)f->film_width / f->film_height;
    bool along_x = s->fov_axis == FOV_X || s->fov_axis == (aspect > 1 ? FOV_LARGER : FOV_SMALLER);
    half[0] = cr_tan(s->fov * PI / 360);
    if (s->fov_axis == FOV_DIAGONAL)
        half[0] *= aspect / cr_hypot(aspect, 1);
    else if (!along_x && aspect != 1)
        half[0] *= aspect;
    half[1] = half[0] / aspect;
    picture_frame(f, s->principal_point, half, edge);
}

static inline SensorTraits perspective_traits(const Perspective *s, const Frame *frame)
{
    SensorTraits traits = {.farthest = s->view.far_clip};
    double half[2], edge[2];
    perspective_frame(s, frame, half, edge);
    column(&s->view.to_world, 3, traits.origin);
    column(&s->view.to_world, 2, traits.axis);
    normalise(traits.axis);
    traits.pixel = fmin(2 * half[0] / frame->width, 2 * half[1] / frame->height);
    for (int i = 0; i < 2; i++)
        half[i] *= fmax(fabs(edge[i]), fabs(edge[i] - 2)) + border_of(frame, i);
    traits.cosine = 1 / cr_hypot(1, cr_hypot(half[0], half[1]));
    return traits;
}

/* Primary rays, one pixel's box filter, and the way back. */
#ifdef LANES

typedef struct perspective_row {
    Num origin[3], left[3], up[3],
        forward[3]; /* left and up reach the edges of the image at forward's distance 1 */
    Num near_clip, far_clip;
    PictureRow picture;
    Num to_left[3], to_up[3];      /* left and up over their squared lengths: a point's place in the image */
    Num film_area;                 /* of the image at forward's distance 1 */
} PerspectiveRow;

static inline void perspective_row(const Perspective *perspective, const Frame *frame, PerspectiveRow *camera)
{
    double extent[3] = {0, 0, 1}, edge[2], axis[3], out[3], back[3];
    perspective_frame(perspective, frame, extent, edge);
    column(&perspective->view.to_world, 3, axis);
    store(camera->origin, axis);
    for (int j = 0; j < 3; j++) {
        Num *const to[3] = {camera->left, camera->up, camera->forward};
        column(&perspective->view.to_world, j, axis);
        double one = length(axis);
        for (int i = 0; i < 3; i++) {
            out[i] = axis[i] * (extent[j] / one);
            back[i] = axis[i] / (one * extent[j]);
        }
        store(to[j], out);
        if (j < 2)
            store(j ? camera->to_up : camera->to_left, back);
    }
    camera->near_clip = (Num)perspective->view.near_clip;
    camera->far_clip = (Num)perspective->view.far_clip;
    camera->picture = picture_row(frame, edge);
    camera->film_area = (Num)(4 * extent[0] * extent[1]);
}

/* The ray from o along d, which is as long as it is deep. It starts on the near plane and ends on the far plane, as
   Mitsuba's does. */
INLINE Ray ray_between_planes(const PerspectiveRow *camera, Vec o, Vec d)
{
    Ray ray = {vec_add(o, vec_scale(d, real(camera->near_clip))), d, real(0), index_of(-1)};
    Real length = vec_length(d);
    ray.d = vec_scale(d, real(1) / length);
    ray.tmax = (real(camera->far_clip) - real(camera->near_clip)) * length;
    return ray;
}

/* Towards the point (x, y) of the film, at depth 1. */
INLINE Vec perspective_way(const PerspectiveRow *camera, Real x, Real y)
{
    Real a, b;
    place_of_pixel(&camera->picture, x, y, &a, &b);
    return vec_add(vec_of(camera->forward),
        vec_add(vec_scale(vec_of(camera->left), a), vec_scale(vec_of(camera->up), b)));
}

/* The ray through the point (x, y) of the film, in pixels from its upper left corner. */
STAGE Ray perspective_ray(const PerspectiveRow *camera, Real x, Real y, const Real lens[2])
{
    (void)lens;
    return ray_between_planes(camera, vec_of(camera->origin), perspective_way(camera, x, y));
}

/* L17 The other way round: from a point that is seen at (a, b) at depth 1, plus this shift. */
INLINE Eye eye_at(const PerspectiveRow *camera, Vec from_eye, const Real *shift)
{
    Real z = vec_dot(from_eye, vec_of(camera->forward)), inverse_z = real(1) / z;
    Eye eye;
    eye.distance = vec_length(from_eye);
    eye.wi = vec_scale(from_eye, real(-1) / eye.distance);
    eye.to_near = eye.distance * (real(1) - real(camera->near_clip) * inverse_z);
    Real a = vec_dot(from_eye, vec_of(camera->to_left)) * inverse_z;
    Real b = vec_dot(from_eye, vec_of(camera->to_up)) * inverse_z;
    if (shift)
        a = a + shift[0], b = b + shift[1];
    eye.weight = eye.distance * inverse_z * inverse_z * inverse_z / real(camera->film_area);
    eye.seen = (z > real(camera->near_clip)) & (z < real(camera->far_clip))
               & pixel_of_place(&camera->picture, a, b, &eye);
    return eye;
}

INLINE Eye perspective_eye(const PerspectiveRow *camera, Vec p, const Real lens[2])
{
    (void)lens;
    return eye_at(camera, vec_sub(p, vec_of(camera->origin)), NULL);
}

#endif
