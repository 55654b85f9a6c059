/* The pinhole camera: primary rays, one pixel's box filter. The eye is where the path starts; nothing is
   sampled towards it. */
#ifndef ONERAY_CAMERA_H
#define ONERAY_CAMERA_H

#include "shape.h"

typedef struct {
    Num origin[3], left[3], up[3],
        forward[3]; /* left and up reach the edges of the image at forward's distance 1 */
    Num near_clip, far_clip;
    Num pixel_width, pixel_height; /* in units of the half image: 2/width, 2/height */
} Camera;

/* The ray through the point (x, y) of the film, in pixels from its upper left corner. It starts on the near
   plane and ends on the far plane, as Mitsuba's does. */
INLINE Ray camera_ray(const Camera *camera, Real x, Real y)
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

#endif
