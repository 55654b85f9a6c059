/* Materials, by surface side: each (slot, side) has its own row, so that twosided, flip_normals and a
   one-sided material's black back are a matter of tables. Row 2 slot is the front (along the normal), 2 slot
   + 1 the back. */
#ifndef ONERAY_MATERIAL_H
#define ONERAY_MATERIAL_H

#include "sample.h"
#include "shape.h"

typedef struct {
    Num (*albedo)[3];       /* reflectance of a diffuse, specular_reflectance of a conductor; 0 is black */
    Int *kind;              /* MaterialKind */
    Num (*eta)[3], (*k)[3]; /* conductor: complex index of refraction; k < 0 stands for a perfect mirror */
} Materials;

/* A surface point as its material sees it. */
typedef struct {
    Vec p, n; /* n on the side that the ray came from */
    Vec wo;   /* to the viewer */
    Real cos_o;
    Index slot;
    Vec albedo;
    Mask specular; /* its BRDF is a delta: no light can be sampled towards it */
    Index row;
} Surface;

INLINE Surface surface_at(
    const Shapes *shapes, const Materials *materials, const Ray *ray, Hit hit, Mask *front, Features f)
{
    Surface s;
    Vec n;
    shapes_surface(shapes, ray, hit, f, &s.p, &n);
    s.wo = vec_neg(ray->d);
    Real cosine = vec_dot(n, s.wo);
    *front = cosine > real(0);
    s.n = vec_scale(n, flip_sign(real(1), cosine));
    s.cos_o = real_abs(cosine);
    s.slot = index_select(hit.slot < 0, index_of(0), hit.slot);
    s.row = s.slot * 2 + index_select(*front, index_of(0), index_of(1));
    s.albedo = vec_gather((const Num(*)[3])materials->albedo, s.row);
    s.specular = f & HAS_CONDUCTOR ? mask_all() : mask_none();
    if ((f & HAS_CONDUCTOR) && (f & HAS_DIFFUSE))
        s.specular = gather_index(materials->kind, s.row) == index_of(MATERIAL_CONDUCTOR);
    return s;
}

/* The diffuse BRDF, f_r = albedo/π (sr⁻¹), and the pdf per solid angle of sampling a direction with this
   cosine. */
INLINE Vec eval_diffuse(const Surface *s) { return vec_scale(s->albedo, REAL_INV_PI); }
INLINE Real pdf_w_diffuse(Real cosine, Features f)
{
    return f & USE_COSINE ? pdf_w_hemisphere_cosine(cosine) : pdf_w_hemisphere_uniform();
}

/* L8, L9 One ray over the hemisphere. Returns f_r cosθ / pdf: 2 albedo cosθ for the uniform one (f_r =
   albedo/π, scaled by 2π), albedo for the cosine-weighted. */
INLINE Vec sample_diffuse(const Surface *s, Real u, Real v, Vec *wi, Real *pdf_w, Features f)
{
    Vec tangent, bitangent;
    vec_frame(s->n, &tangent, &bitangent);
    Vec local = f & USE_COSINE ? sample_hemisphere_cosine(u, v) : sample_hemisphere_uniform(u, v);
    *wi = vec_add(
        vec_add(vec_scale(tangent, local.x), vec_scale(bitangent, local.y)), vec_scale(s->n, local.z));
    *pdf_w = pdf_w_diffuse(local.z, f);
    return f & USE_COSINE ? s->albedo : vec_scale(s->albedo, real(2) * local.z);
}

/* Reflectance of a conductor for unpolarised light, one channel, at cosine c to the normal: Born & Wolf,
   Principles of Optics, 14.2, with a² + b² = |(η + i k)² - sin²θ|. */
INLINE Real fresnel_conductor(Real c, Real eta, Real k)
{
    Real cc = c * c, ss = real(1) - cc;
    Real difference = eta * eta - k * k - ss;
    Real ab = real_sqrt(difference * difference + real(4) * eta * eta * k * k);
    Real a = real_sqrt(real_max(real(0.5) * (ab + difference), real(0)));
    Real s = (ab + cc - real(2) * a * c) / (ab + cc + real(2) * a * c);
    Real p = (ab * cc + ss * ss - real(2) * a * c * ss) / (ab * cc + ss * ss + real(2) * a * c * ss);
    return real_max(real(0.5) * s * (real(1) + p), real(0)); /* rounding can pass 0 where η is near 1 */
}

/* L11 The mirror: all of the light from the one direction that reflects into wo. */
INLINE Vec sample_conductor(const Materials *materials, const Surface *s, Vec *wi, Features f)
{
    *wi = vec_sub(vec_scale(s->n, real(2) * s->cos_o), s->wo);
    if (!(f & HAS_FRESNEL))
        return s->albedo;
    Vec eta = vec_gather((const Num(*)[3])materials->eta, s->row);
    Vec k = vec_gather((const Num(*)[3])materials->k, s->row);
    Vec fresnel = vec(fresnel_conductor(s->cos_o, eta.x, k.x), fresnel_conductor(s->cos_o, eta.y, k.y),
        fresnel_conductor(s->cos_o, eta.z, k.z));
    return vec_mul(s->albedo, vec_select(k.x < real(0), vec_all(real(1)), fresnel));
}

#endif
