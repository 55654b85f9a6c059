/* What all materials share: their rows, a surface point as a material sees it, and how a path goes on from one.

   materials/NAME.h defines, for a kind of the list MATERIALS in kinds.h,
     Name, name_plugin   what a scene file says of it
     name_traits         what is asked of that (traits.h): reflected is all that goes on, on either side
     NameRow, name_row   its numbers as a kernel has them, a ReflectanceRow first, and how they come about
     name_transmits      trait: light goes through
     name_sample         one direction that the path goes on by
   and if it is one of FINITE_MATERIALS
     name_eval           f_r, the BSDF (sr⁻¹)
     name_pdf_w          the density per solid angle of name_sample (sr⁻¹)
     name_factor         f_r cosθ / pdf_w, in the form that is simplest.
   These have the part's share in its reflectance alone, which the rows of a blend's finite parts are multiplied by;
   they are not asked of light from behind (cosine < 0) unless they transmit. scatter.h chooses between them. */
#pragma once

#include "fields.h"
#include "lanes/sample.h"
#include "textures/lookup.h"

#include <stddef.h>

/* A row for each side of each slot, so that twosided, flip_normals and a one-sided material's black back are a matter
   of tables: row 2 slot is the front (along the normal), 2 slot + 1 the back. A blend goes on in rows beyond those. */
typedef struct {
    Num *numbers; /* by row 2^shift of them: the NameRow of its kind */
    int shift;
    Int *kind;   /* MaterialKind; a row of zeros is black, and diffuse */
    Num *p_stay; /* blend: that it is this row's material, none of those before it being it, … */
    Int *next;   /* … else the row to go on with */
    Num *share;  /* of the whole blend, … */
    Num *share_by; /* … HAS_WEIGHTS: times these textures, or times what they leave of 1: row, 1 if that, twice */
    Num *bump;   /* HAS_BUMP, four numbers a row (bump.h) */
    Int *has;    /* by first row, of all parts: PARTS_TRANSMIT, a finite one does; PARTS_DELTA, there is one */
    int layers;  /* rows of the longest blend */
    Textures textures;
} Materials;
enum { PARTS_TRANSMIT = 1, PARTS_DELTA = 2 };

/* A row's numbers: ROW_LIGHT(materials, row, Conductor, eta), ROW_REAL(…). */
#define ROW_AT(Name, member) (offsetof(Name##Row, member) / sizeof(Num))
#define ROW_LIGHT(materials, row, Name, member)                                                              \
    light_gather((materials)->numbers + ROW_AT(Name, member), (row) << (materials)->shift)
#define ROW_REAL(materials, row, Name, member)                                                               \
    gather((materials)->numbers + ROW_AT(Name, member), (row) << (materials)->shift)

/* A Reflectance: its colour (of a texture white, times the share) and its row of the textures. */
typedef struct {
    Num colour[3], texture;
} ReflectanceRow;
static inline void store_reflectance(ReflectanceRow *row, const Reflectance *from)
{
    static const double white[3] = {1, 1, 1};
    store(row->colour, from->texture ? white : from->most);
    row->texture = (Num)from->texture;
}

/* A share that a texture may stand for, likewise. */
typedef struct {
    Num number, texture;
} ShareRow;
static inline void store_share(ShareRow *row, const Reflectance *from)
{
    row->number = (Num)(from->texture ? 1 : from->most[0]);
    row->texture = (Num)from->texture;
}

/* A surface point as its material sees it. */
typedef struct {
    Vec p, n; /* n on the side that the ray came from */
    Vec face; /* the normal of the surface itself; light shines along it, and is reflected by n */
    Real cos_face;
    Vec wo; /* to the viewer */
    Real cos_o;
    Index slot, of; /* of: its row in the tables by slot */
    Real u, v; /* HAS_UV: texture coordinates, … */
    Vec dp_du, dp_dv; /* … and where they grow */
    Index row, kind;
    Light reflectance; /* the row's */
    Real share;        /* and its share of a blend */
    Mask delta;        /* its material, or all parts of a blend: no ray to a light can be sent from it */
    Mask both_sides;   /* it takes light from behind, too, that is no delta's */
} Surface;

/* The row of the textures whose number stands there; any for a row of another kind, which has something else there. */
INLINE Index texture_row(const Materials *materials, const Num *number, Index row)
{
    Real texture = gather(number, row << materials->shift);
    return real_floor(real_min(real_max(texture, real(0)), real((double)materials->textures.last)));
}

/* The reflectance that stands at this place of a row: its colour, times its texture if there are any. */
INLINE Light reflectance_at(const Materials *materials, Index row, size_t place, const Surface *s, Features f)
{
    const Num *numbers = materials->numbers + place;
    Light colour = light_gather(numbers, row << materials->shift);
    if (f.has & HAS_ANY(TEXTURES)) {
        Index texture = texture_row(materials, numbers + ROW_AT(Reflectance, texture), row);
        colour = light_mul(colour, texture_at(&materials->textures, texture, s->u, s->v, f));
    }
    return colour;
}

/* The share that stands there: its number, or its texture's luminance. */
INLINE Real share_at(const Materials *materials, Index row, size_t place, const Surface *s, Features f)
{
    const Num *numbers = materials->numbers + place;
    Real share = gather(numbers + ROW_AT(Share, number), row << materials->shift);
    if (f.has & HAS_ANY(TEXTURES)) {
        Index texture = texture_row(materials, numbers + ROW_AT(Share, texture), row);
        if (any(texture > 0))
            share = share * luminance(texture_at(&materials->textures, texture, s->u, s->v, f));
    }
    return share;
}

/* A row of the surface's material: all of it, or a part of a blend. */
typedef struct {
    Index row;
    Light reflectance; /* of a part that is no delta, times its share */
    Real share;        /* 1 if it is all */
} Part;

/* f_r cosθ / pdf_w of a part, which has its share in f_r alone; 0 where no direction is taken so. */
INLINE Light factor_of(Light f_r, Real pdf_w, Real cosine, const Part *part, Features f)
{
    Real whole = f.has & HAS_BLEND ? pdf_w * part->share : pdf_w;
    return light_scale(f_r, only(pdf_w > real(0), cosine / whole));
}

/* A direction that the path goes on by. */
typedef struct {
    Vec wi;
    Light factor;     /* f_r cosθ / pdf_w */
    Real pdf_w;       /* where no delta chose it */
    Mask delta;       /* a delta chose it */
    Real compression; /* (η_o/η_i)², what radiance gains by crossing a boundary; 1 if it does not */
} Scatter;

INLINE Vec mirrored(const Surface *s) { return vec_sub(vec_scale(s->n, real(2) * s->cos_o), s->wo); }
