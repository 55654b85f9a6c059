/* What the files of sensors have in common: what a scene file says of each, and where its picture lies. */
#pragma once

#include "fields.h"
#include "traits.h"
#include "vectors.h"

/* What the struct of a sensor begins with. Rays start and end on planes at these depths along camera space's z. */
typedef struct {
    double near_clip, far_clip;
    Affine to_world; /* camera space to world: looks along +z, +x is to the LEFT, +y up */
} View;

#define VIEW_FIELDS                                                                                          \
    {"shutter_open", AS_FLOAT, LEFT_OUT, "(-inf,inf)", ""},                                                  \
    {"shutter_close", AS_FLOAT, LEFT_OUT, "(-inf,inf)", ""},                                                 \
    {"near_clip", AS_FLOAT, offsetof(View, near_clip), "(0,inf)", ".01"},                                    \
    {"far_clip", AS_FLOAT, offsetof(View, far_clip), "(0,inf)", "1e4"},                                      \
    {"to_world", AS_TRANSFORM, offsetof(View, to_world), NULL, ""}

static inline void view_check(const View *view, const Said *said)
{
    if (view->near_clip >= view->far_clip)
        fail(said, "\"near_clip\" is %g and must be less than \"far_clip\", %g", view->near_clip, view->far_clip);
}

/* `half` extents of the film become those of the picture; `edge`: where its left and upper edge is, in these, to the
   left and up. The film is moved by `offset`, in films. */
static inline void picture_frame(const Frame *f, const double offset[2], double half[2], double edge[2])
{
    const double film[2] = {f->film_width, f->film_height}, picture[2] = {f->width, f->height}, begins[2] = {f->x, f->y};
    for (int i = 0; i < 2; i++) {
        double share = picture[i] / film[i];
        half[i] *= share;
        edge[i] = (1 - 2 * (begins[i] / film[i] + offset[i])) / share;
    }
}

/* How far the film reaches beyond the picture, in half pictures. */
static inline double border_of(const Frame *frame, int i)
{
    return 2.0 * frame->border / (i ? frame->height : frame->width);
}

#ifdef LANES

#include "sensors/eye.h"

/* Places on the film, in half pictures to the left and up of the middle of the view. */
typedef struct {
    Num pixel_width, pixel_height; /* in units of the half image: 2/width, 2/height */
    Num a, b;                      /* of the picture's left and upper edge */
    Num from[2], to[2];            /* of the film's right and lower edge, and of its left and upper edge */
} PictureRow;

static inline PictureRow picture_row(const Frame *frame, const double edge[2])
{
    PictureRow row = {(Num)(2.0 / frame->width), (Num)(2.0 / frame->height), (Num)edge[0], (Num)edge[1], {0}, {0}};
    for (int i = 0; i < 2; i++) {
        row.from[i] = (Num)(edge[i] - 2 - border_of(frame, i));
        row.to[i] = (Num)(edge[i] + border_of(frame, i));
    }
    return row;
}

/* Of a point of the film, in pixels from the picture's upper left corner. */
INLINE void place_of_pixel(const PictureRow *row, Real x, Real y, Real *a, Real *b)
{
    *a = real(row->a) - x * real(row->pixel_width);
    *b = real(row->b) - y * real(row->pixel_height);
}

/* L17 The other way round: sets the eye's x and y; is that on the film? */
INLINE Mask pixel_of_place(const PictureRow *row, Real a, Real b, Eye *eye)
{
    eye->x = (real(row->a) - a) / real(row->pixel_width);
    eye->y = (real(row->b) - b) / real(row->pixel_height);
    return (a > real(row->from[0])) & (a <= real(row->to[0])) & (b > real(row->from[1])) & (b <= real(row->to[1]));
}

#endif
