/* P6 The camera with a lens: a pinhole camera for each point of a disk about its origin, all of which see one picture in
   the plane of focus. */
#pragma once

#include "sensors/perspective.h"

typedef struct thinlens {
    Perspective camera;
    double aperture_radius, focus_distance; /* of the plane of focus along z, not along a ray */
} Thinlens;

static inline void thinlens_check(void *plugin, Said *said)
{
    Thinlens *s = plugin;
    perspective_check(&s->camera, said);
    if (!given(said, "focus_distance"))
        s->focus_distance = s->camera.view.far_clip;
    if (s->aperture_radius == 0)
        note(given(said, "aperture_radius"), "\"aperture_radius\" is 0: a pinhole, all of whose picture is in focus");
}
static const Plugin thinlens_plugin = {"thinlens", thinlens_check, {
    FOV_FIELDS,
    {"aperture_radius", AS_FLOAT, offsetof(Thinlens, aperture_radius), "[0,inf)", NULL},
    {"focus_distance", AS_FLOAT, offsetof(Thinlens, focus_distance), "(0,inf)", ""},
    VIEW_FIELDS}};

/* Beyond the plane of focus rays part by the radius over its distance. */
static inline SensorTraits thinlens_traits(const Thinlens *s, const Frame *frame)
{
    SensorTraits traits = perspective_traits(&s->camera, frame);
    double slope = sqrt(fmax(1 / (traits.cosine * traits.cosine) - 1, 0)) + s->aperture_radius / s->focus_distance;
    traits.reach = s->aperture_radius;
    traits.cosine = 1 / cr_hypot(1, slope);
    return traits;
}

#ifdef LANES

typedef struct thinlens_row {
    PerspectiveRow camera;
    Num lens_left[3], lens_up[3]; /* of the lens, its radius long */
    Num inverse_focus;            /* m⁻¹ */
    Num shift[2];                 /* at depth 1, in half images: by how much the lens's edge moves what is in focus */
} ThinlensRow;

static inline void thinlens_row(const Thinlens *s, const Frame *frame, ThinlensRow *row)
{
    double half[2], edge[2];
    perspective_row(&s->camera, frame, &row->camera);
    perspective_frame(&s->camera, frame, half, edge);
    row->inverse_focus = (Num)(1 / s->focus_distance);
    for (int j = 0; j < 2; j++) {
        double axis[3];
        column(&s->camera.view.to_world, j, axis);
        normalise(axis);
        for (int i = 0; i < 3; i++)
            axis[i] *= s->aperture_radius;
        store(j ? row->lens_up : row->lens_left, axis);
        row->shift[j] = (Num)(s->aperture_radius / (s->focus_distance * half[j]));
    }
}

/* From the lens's center to the point of it, uniform by area, at x and y of its radius. */
INLINE Vec lens_point(const ThinlensRow *row, const Real lens[2], Real *x, Real *y)
{
    sample_disk(lens[0], lens[1], x, y);
    return vec_add(vec_scale(vec_of(row->lens_left), *x), vec_scale(vec_of(row->lens_up), *y));
}

APART Ray thinlens_ray(const ThinlensRow *row, Real x, Real y, const Real lens[2])
{
    Real lens_x, lens_y;
    Vec aside = lens_point(row, lens, &lens_x, &lens_y);
    Vec d = vec_sub(perspective_way(&row->camera, x, y), vec_scale(aside, real(row->inverse_focus)));
    return ray_between_planes(&row->camera, vec_add(vec_of(row->camera.origin), aside), d);
}

/* L17 From a point of the lens as from a pinhole, with the picture shifted so that the plane of focus stays. */
INLINE Eye thinlens_eye(const ThinlensRow *row, Vec p, const Real lens[2])
{
    Real shift[2];
    Vec aside = lens_point(row, lens, &shift[0], &shift[1]);
    shift[0] = shift[0] * real(row->shift[0]), shift[1] = shift[1] * real(row->shift[1]);
    return eye_at(&row->camera, vec_sub(vec_sub(p, vec_of(row->camera.origin)), aside), shift);
}

#endif
