/* Materials, by surface side: each (slot, side) has its own row, so that twosided, flip_normals and a
   one-sided material's black back are a matter of tables. Row 2 slot is the front (along the normal), 2 slot
   + 1 the back; a blend goes on in rows beyond those. */
#ifndef ONERAY_MATERIALS_MATERIAL_H
#define ONERAY_MATERIALS_MATERIAL_H

#include "lanes/sample.h"
#include "shapes/meet.h"

typedef struct {
    Num (*albedo)[3];       /* reflectance of a diffuse (times its share of a blend), else
                               specular_reflectance; 0 is black */
    Int *kind;              /* MaterialKind */
    Num (*eta)[3], (*k)[3]; /* conductor: complex index of refraction; k < 0 stands for a perfect mirror.
                               Dielectric: eta[0] is the index on this side over that beyond, k is
                               specular_transmittance */
    Num *share;             /* blend: the chance of this row's material, … */
    Int *next;              /* … else the row to go on with */
    int layers;             /* rows of the longest blend */
} Materials;

/* A surface point as its material sees it. */
typedef struct {
    Vec p, n;    /* n on the side that the ray came from */
    Vec face;    /* the normal of the surface itself; light shines along it, and is reflected by n */
    Real cos_face;
    Vec wo;   /* to the viewer */
    Real cos_o;
    Index slot, of; /* of: its row in the tables by slot */
    Vec albedo;
    Real share;
    Mask specular; /* its BRDF is a delta: no light can be sampled towards it */
    Index row;
} Surface;

#define HAS_SPECULAR (HAS_CONDUCTOR | HAS_DIELECTRIC)

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
    s.row = s.of * 2 + index_select(cosine > real(0), index_of(0), index_of(1));
    s.albedo = vec_gather((const Num(*)[3])materials->albedo, s.row);
    s.share = f.has & HAS_BLEND ? gather(materials->share, s.row) : real(1);
    s.specular = f.has & HAS_SPECULAR ? mask_all() : mask_none();
    if ((f.has & HAS_SPECULAR) && (f.has & HAS_DIFFUSE))
        s.specular = gather_index(materials->kind, s.row) != index_of(MATERIAL_DIFFUSE);
    return s;
}

/* The diffuse BRDF, f_r = albedo/π (sr⁻¹), the pdf per solid angle of sampling a direction with this cosine,
   and f_r cosθ / pdf. L8: 2 albedo cosθ for the uniform hemisphere (albedo/π scaled by 2π), L9: albedo for
   the cosine-weighted. */
INLINE Vec eval_diffuse(const Surface *s) { return vec_scale(s->albedo, REAL_INV_PI); }
INLINE Real pdf_w_diffuse(const Surface *s, Real cosine, Features f)
{
    Real pdf_w = f.use & USE_COSINE ? pdf_w_hemisphere_cosine(cosine) : pdf_w_hemisphere_uniform();
    return f.has & HAS_BLEND ? pdf_w * s->share : pdf_w;
}
INLINE Vec factor_diffuse(const Surface *s, Real cosine, Features f)
{
    Vec albedo = f.has & HAS_BLEND ? vec_scale(s->albedo, real(1) / s->share) : s->albedo;
    return f.use & USE_COSINE ? albedo : vec_scale(albedo, real(2) * cosine);
}

/* A direction that the walk goes on by. */
typedef struct {
    Vec wi;
    Vec factor;       /* f_r cosθ / pdf */
    Real pdf_w;       /* where not specular */
    Mask specular;    /* a delta chose it */
    Real compression; /* (η_o/η_i)², what radiance gains by crossing a boundary; 1 if it does not */
} Scatter;

/* L8, L9 One ray over the hemisphere. */
INLINE Scatter sample_diffuse(const Surface *s, Real u, Real v, Features f)
{
    Vec local = f.use & USE_COSINE ? sample_hemisphere_cosine(u, v) : sample_hemisphere_uniform(u, v);
    return (Scatter){vec_from_frame(s->n, local), factor_diffuse(s, local.z, f),
        pdf_w_diffuse(s, local.z, f), mask_none(), real(1)};
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

INLINE Vec mirrored(const Surface *s) { return vec_sub(vec_scale(s->n, real(2) * s->cos_o), s->wo); }

/* L11 The mirror: all of the light from the one direction that reflects into wo. */
INLINE void sample_conductor(const Materials *materials, const Surface *s, Index row, Vec albedo,
    Scatter *scatter, Features f)
{
    scatter->wi = mirrored(s);
    scatter->factor = albedo;
    if (!(f.has & HAS_FRESNEL))
        return;
    Vec eta = vec_gather((const Num(*)[3])materials->eta, row);
    Vec k = vec_gather((const Num(*)[3])materials->k, row);
    Vec fresnel = vec(fresnel_conductor(s->cos_o, eta.x, k.x), fresnel_conductor(s->cos_o, eta.y, k.y),
        fresnel_conductor(s->cos_o, eta.z, k.z));
    scatter->factor = vec_mul(albedo, vec_select(k.x < real(0), vec_all(real(1)), fresnel));
}

/* L15 The cosine beyond a boundary, from the cosine c here and the ratio of the indices, here/beyond: Snell.
   0 in total internal reflection. 1 - ratio² (1 - c²), in a form that keeps its digits at grazing angles
   where the indices are nearly the same. */
INLINE Real refracted_cosine(Real c, Real ratio)
{
    Real rc = ratio * c;
    return real_sqrt(real_max((real(1) - ratio) * (real(1) + ratio) + rc * rc, real(0)));
}

/* L15 Transmittance of a boundary between dielectrics for unpolarised light, exact: the mean of
   4 η_o c η_t c_t/(η_o c + η_t c_t)² and the same with η_o and η_t exchanged in the sum; 0 in total reflection. As a
   product, not as 1 - reflectance, it keeps its digits at grazing angles and next to total reflection. */
INLINE Real fresnel_dielectric(Real c, Real c_t, Real ratio)
{
    Real rc = ratio * c, rc_t = ratio * c_t, s = rc + c_t, p = rc_t + c;
    return only(c_t > real(0), real(2) * ((rc / s) * (c_t / s) + (c / p) * (rc_t / p)));
}

/* L15 1 minus Schlick's approximation as in the lecture, R0 + (1 - R0)(1 - c)⁵, with the cosine on the side of the
   smaller index. Total reflection is exact. */
INLINE Real fresnel_schlick(Real c, Real c_t, Real ratio)
{
    Real r = (ratio - real(1)) / (ratio + real(1)), x = real(1) - select(ratio > real(1), c_t, c);
    Real xx = x * x;
    return only(c_t > real(0), (real(1) - r * r) * (real(1) - xx * xx * x));
}

/* L15 The smooth boundary between two media: reflection with the chance of its reflectance, else
   refraction. */
INLINE void sample_dielectric(const Materials *materials, const Surface *s, Index row, Vec albedo, Real u,
    Scatter *scatter, Features f)
{
    Real ratio = gather(&materials->eta[0][0], row * 3), c = s->cos_o, c_t = refracted_cosine(c, ratio);
    Real transmittance = f.use & USE_SCHLICK ? fresnel_schlick(c, c_t, ratio) : fresnel_dielectric(c, c_t, ratio);
    Mask reflects = real(1) - u >= transmittance;
    Vec refracted = vec_sub(vec_scale(s->n, ratio * c - c_t), vec_scale(s->wo, ratio));
    Vec tint = vec_gather((const Num(*)[3])materials->k, row);
    scatter->wi = vec_select(reflects, mirrored(s), refracted);
    scatter->factor = vec_select(reflects, albedo, tint);
    scatter->compression = select(reflects, real(1), ratio * ratio);
}

/* L16 A mixed material: one of its parts, each with its share, "diffuse = 1 - (refl + refr)". The diffuse
   part is the first row, so that light sampling finds it. */
INLINE Index choose_layer(const Materials *materials, const Surface *s, Real u)
{
    Index row = s->row;
    Real share = s->share;
    for (int layer = 1; layer < materials->layers; layer++) {
        Mask on = u >= share;
        if (!any(on))
            break;
        u = select(on, (u - share) / (real(1) - share), u);
        row = index_select(on, gather_index(materials->next, row), row);
        share = select(on, gather(materials->share, row), real(2));
    }
    return row;
}

/* One direction by the material; `part` chooses that of a mixed one. */
STAGE Scatter sample_material(
    const Materials *materials, const Surface *s, Real part, const Real u[2], Features f)
{
    Scatter scatter = {s->n, s->albedo, real(0), s->specular, real(1)};
    if (f.has & HAS_DIFFUSE)
        scatter = sample_diffuse(s, u[0], u[1], f);
    if (!(f.has & HAS_SPECULAR))
        return scatter;
    Index row = s->row;
    Vec albedo = s->albedo;
    Mask specular = s->specular;
    if (f.has & HAS_BLEND) {
        row = choose_layer(materials, s, part);
        albedo = vec_gather((const Num(*)[3])materials->albedo, row);
        specular = gather_index(materials->kind, row) != index_of(MATERIAL_DIFFUSE);
    }
    Scatter delta = scatter;
    if (f.has & HAS_CONDUCTOR)
        sample_conductor(materials, s, row, albedo, &delta, f);
    if (f.has & HAS_DIELECTRIC) {
        Scatter boundary = delta;
        Mask glass = f.has & HAS_CONDUCTOR ? gather_index(materials->kind, row) == index_of(MATERIAL_DIELECTRIC)
                                       : mask_all();
        if (any(glass))
            sample_dielectric(materials, s, row, albedo, u[0], &boundary, f);
        delta.wi = vec_select(glass, boundary.wi, delta.wi);
        delta.factor = vec_select(glass, boundary.factor, delta.factor);
        delta.compression = select(glass & specular, boundary.compression, delta.compression);
    }
    scatter.wi = vec_select(specular, delta.wi, scatter.wi);
    scatter.factor = vec_select(specular, delta.factor, scatter.factor);
    scatter.compression = select(specular, delta.compression, scatter.compression);
    scatter.specular = specular;
    return scatter;
}

#endif
