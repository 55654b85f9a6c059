/* The surface that a ray meets, whatever its shape and material. */
#pragma once

#include "materials/scatter.h"
#include "shapes/meet.h"

/* front: does the ray come to the side that light shines from? */
STAGE Surface surface_at(
    const Shapes *shapes, const Materials *materials, const Ray *ray, Hit hit, Mask *front, Features f)
{
    Surface s;
    Vec n;
    s.slot = index_select(hit.slot < 0, index_of(0), hit.slot);
    s.of = row_of_slot(shapes, s.slot, f);
    shapes_surface(shapes, ray, s.slot, s.of, hit.t, &s.p, &n, &s.face, f);
    s.wo = vec_neg(ray->d);
    Real cosine = vec_dot(n, s.wo), of_face = f.has & HAS_SMOOTH ? vec_dot(s.face, s.wo) : cosine;
    *front = of_face > real(0);
    s.cos_face = real_abs(of_face);
    s.n = vec_scale(n, flip_sign(real(1), cosine));
    s.cos_o = real_abs(cosine);
    if (f.has & HAS_UV) {
        SurfaceFrame frame = surface_frame(shapes, s.slot, s.of, s.p, f);
        s.u = frame.u, s.v = frame.v, s.dp_du = frame.dp_du, s.dp_dv = frame.dp_dv;
    }
    s.row = s.of * 2 + index_select(cosine > real(0), index_of(0), index_of(1));
    find_material(materials, &s, f);
    return s;
}

/* T1 The same as another ray sees it, whose viewer is towards wo: on the other side, perhaps, of a material that transmits. */
INLINE Surface surface_seen_from(const Materials *materials, const Surface *s, Vec wo, Features f)
{
    Surface seen = *s;
    Real cosine = vec_dot(s->n, wo);
    seen.wo = wo;
    seen.cos_o = real_abs(cosine);
    seen.cos_face = real_abs(vec_dot(s->face, wo));
    if (f.has & FINITE_TRANSMITTING) {
        Mask behind = cosine < real(0);
        seen.n = vec_scale(s->n, flip_sign(real(1), cosine));
        seen.row = index_select(behind, s->row ^ 1, s->row);
        find_material(materials, &seen, f);
    }
    return seen;
}

/* Which lanes can receive light from a direction with this cosine: from the ray's side of the surface, or, of a finite
   material that transmits, from both. */
INLINE Mask can_receive(const Surface *s, Real cosine, Features f)
{
    (void)f;
    return (cosine > real(0)) | s->both_sides;
}
INLINE Real received(Real cosine, Features f)
{
    return f.has & FINITE_TRANSMITTING ? real_abs(cosine) : cosine;
}
