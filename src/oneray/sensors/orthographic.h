/* P6 The camera without perspective: rays in parallel, from a film from -1 to 1 of camera space's x and as high as its
   pixels are square; to_world may stretch it. */
#pragma once

#include "sensors/camera.h"

typedef struct orthographic {
    View view;
} Orthographic;

static inline void orthographic_check(void *plugin, Said *said) { view_check(&((Orthographic *)plugin)->view, said); }
static const Plugin orthographic_plugin = {"orthographic", orthographic_check, {VIEW_FIELDS}};

/* The picture on the near plane: columns half its width, half its height and the unit vector of its rays, and the
   middle of the view. */
static inline Affine orthographic_picture(const Orthographic *s, const Frame *f, double edge[2])
{
    Affine picture = s->view.to_world;
    double half[2] = {1, (double)f->film_height / f->film_width}, forward[3];
    picture_frame(f, (double[2]){0}, half, edge);
    column(&s->view.to_world, 2, forward);
    double deep = length(forward);
    for (int i = 0; i < 3; i++) {
        picture.m[i][0] *= half[0];
        picture.m[i][1] *= half[1];
        picture.m[i][2] /= deep;
        picture.m[i][3] += forward[i] * s->view.near_clip;
    }
    return picture;
}

static inline SensorTraits orthographic_traits(const Orthographic *s, const Frame *frame)
{
    SensorTraits traits = {.farthest = s->view.far_clip, .side = HUGE_VAL, .cosine = 1};
    double edge[2], side[3];
    Affine picture = orthographic_picture(s, frame, edge);
    column(&picture, 2, traits.axis);
    column(&picture, 3, traits.origin);
    for (int k = 0; k < 2; k++) {
        column(&picture, k, side);
        for (int i = 0; i < 3; i++)
            traits.origin[i] += (edge[k] - 1) * side[i];
        traits.side = fmin(traits.side, 2 * length(side) / (k ? frame->height : frame->width));
        traits.reach += length(side) * (1 + border_of(frame, k));
    }
    return traits;
}

#ifdef LANES

typedef struct orthographic_row {
    Num origin[3], left[3], up[3], forward[3]; /* of orthographic_picture */
    Local to_film;                             /* from the origin on: left, up, depth */
    Num depth;                                 /* of the far plane behind the near one, whatever to_world stretches */
    Num film_area;                             /* of the image, across the rays */
    PictureRow picture;
} OrthographicRow;

static inline void orthographic_row(const Orthographic *s, const Frame *frame, OrthographicRow *row)
{
    double edge[2], axis[3];
    Affine picture = orthographic_picture(s, frame, edge);
    Num *const to[4] = {row->left, row->up, row->forward, row->origin};
    for (int j = 0; j < 4; j++) {
        column(&picture, j, axis);
        store(to[j], axis);
    }
    row->to_film = local_of(&picture);
    row->depth = (Num)(s->view.far_clip - s->view.near_clip);
    row->film_area = (Num)(4 * fabs(affine_determinant(&picture)));
    row->picture = picture_row(frame, edge);
}

APART Ray orthographic_ray(const OrthographicRow *row, Real x, Real y, const Real lens[2])
{
    Real a, b;
    (void)lens;
    place_of_pixel(&row->picture, x, y, &a, &b);
    Vec aside = vec_add(vec_scale(vec_of(row->left), a), vec_scale(vec_of(row->up), b));
    return (Ray){vec_add(vec_of(row->origin), aside), vec_of(row->forward), real(row->depth), index_of(-1)};
}

/* L17 A surface's dA is seen as cosθ dA of the film. */
INLINE Eye orthographic_eye(const OrthographicRow *row, Vec p, const Real lens[2])
{
    Vec from_film = vec_sub(p, vec_of(row->origin));
    Eye eye;
    (void)lens;
    eye.distance = eye.to_near = row_direction(row->to_film.row[2], from_film);
    eye.wi = vec_neg(vec_of(row->forward));
    eye.weight = real(1) / real(row->film_area);
    eye.seen = (eye.distance > real(0)) & (eye.distance < real(row->depth))
               & pixel_of_place(&row->picture, row_direction(row->to_film.row[0], from_film),
                   row_direction(row->to_film.row[1], from_film), &eye);
    return eye;
}

#endif
