/* Lights: their tables, and what all kinds of them share. A light here is what one ray can be sent to: an area light on
   a cube counts as its six faces, on a mesh as its triangles.

   emitters/NAME.h defines, for a kind of the list EMITTERS in kinds.h,
     Name, name_plugin   what a scene file says of it
     name_traits         what is asked of that (traits.h); it looks at nothing that a pointer leads to
     name_towards        one ray to it for (u, v) in [0,1)²: what reaches the point over emission and p_i, 1/pdf_w
     name_emit           one ray from it (light paths): where it starts by `place`, its direction by `way`
     name_emit_pdf       the densities of that, for a point o of the light and a direction d
   and for a kind of SKIES, which a ray meets where it leaves the scene,
     name_radiance       what it meets there, with the emission; also asked of lanes without a direction, d = 0
     name_pdf_w          the density of name_towards.
   towards.h chooses between them, choice.h between lights. */
#pragma once

#include "traits.h"
#include "lanes/light.h"
#include "shapes/meet.h"

#include <math.h>

/* The lights as a tree, for choosing one by what it may contribute (choice.h). Node 0 is the root; the
   children of a node are next to each other. */
typedef struct {
    Num center[3], radius; /* a ball around the node's lights */
    Num axis[3], cos, sin; /* a cone around the normals of what shines */
    Num power;             /* Φ/π of lights at a place, W·sr⁻¹ */
    Num count;             /* lights below */
    Num child; /* the bits of an Int: its first child, or -1 - light */
    Num far; /* irradiance of lights without a place, W·m⁻² */
    Num unused[3];         /* a row is read in fours */
} LightNode;
enum { LIGHT_NODE_ROW = sizeof(LightNode) / sizeof(Num) };
enum { LEARNED_NODES = 127 }; /* those nodes, the uppermost, have a learned visibility */

typedef struct {
    LightNode *nodes;
    Int *trail;        /* by light: the way down to it, bit k set where level k goes to the second child */
    Num p_by_count; /* how often the choice goes by count instead of by contribution */
    Num *visible;      /* [region][LEARNED_NODES]: how often the way to the node's lights is free; NULL while
                          nothing is learned */
    Num low[3], scale[3]; /* regions: cells of a grid, region i of axis a from low + i/scale */
    Int size[3];
} LightTree;

INLINE Int child_of(const LightTree *tree, Int node)
{
    Int child;
    memcpy(&child, &tree->nodes[node].child, sizeof child);
    return child;
}

/* A rectangle in units of its longer half side M. */
typedef struct {
    Num x, y, inverse_x, inverse_y; /* its half sides */
    Num along_x, along_y;           /* from what a vector has along edge_x, edge_y (m²) */
    Num scale, unused;              /* 1/M, m⁻¹ */
} Panel;

/* The environment as a picture, over the emission: pixel (i, j) is at longitude (i + 1/2)/width of a turn and latitude j
   of `rows`, and linear between four, which are a cell. */
typedef struct {
    Int width, rows;
    Num *pixels;        /* three numbers each */
    Num axis[3][3];     /* x, y and z of its frame, unit vectors */
    Num inverse_total;  /* the density of the choice of a cell, over its mean: per longitude and latitude, sr⁻¹ where sinθ = 1 */
    Num *fill;          /* by row: the mean of sinθ */
    Num *row_p_stay, *column_p_stay; /* alias tables: of rows, and in each of columns */
    Int *row_alias, *column_alias;
} SkyMap;

typedef struct {
    int count;
    Int *kind;          /* EmitterKind, by light, as all below */
    Int *shape;         /* ShapeKind that an area light shines from, a rectangle for a cube's face; else -1 */
    Num (*emission)[3]; /* radiance, intensity or irradiance (LightFrom in traits.h) */
    Num (*position)[3]; /* center of a flat light or sphere; point, spot */
    Num (*edge_x)[3],
        (*edge_y)[3];        /* flat: half the sides, of a triangle two sides from one corner; cylinder: two radii; edge_x of a spot or directional light: its direction */
    Num (*normal)[3];        /* flat: unit normal of the side that shines; cylinder: half its axis */
    Panel *panel;            /* of a rectangle with right angles, else 0 */
    Num *radius;             /* sphere, cylinder: negative where it shines inwards */
    Num *extent;             /* spot: 1 - cos of the cutoff angle */
    Num *cutoff, *beam;      /* spot: angles, radians */
    Num *area;               /* m²; 1 where there is none */
    Num *inverse_choice;     /* 1/p_i of the choice by uniform or power */
    Int *slot;               /* the surface it is, -1 for none */
    Num *alias_p_stay;        /* alias table: stay with the light drawn if below this, … */
    Int *alias;              /* … else take this one */
    LightTree tree;
    Num (*slot_emission)[3]; /* by slot: radiance along the slot's normal, 0 for what is no light */
    Int *slot_light;         /* by slot: which light it is, 0 for what is none; of a mesh, what to add to
                                the triangle's slot */
    const StackTables *stacks; /* HAS_STACKS: the shapes' */
    Int sky;                 /* which light the environment is */
    SkyMap map;              /* HAS_ENVMAP */
    Num world_center[3], world_radius; /* a ball around the scene, which far lights shine on */
} Emitters;

/* The point that light is wanted at: n is the normal on the side that matters (0 in a medium), slot what it lies on. */
typedef struct {
    Vec p, n;
    Index slot;
    Mask both_sides; /* both matter */
} Receiver;

/* In each lane that of the one named. */
INLINE Receiver receiver_of_lanes(const Receiver *at, Index lane)
{
    return (Receiver){vec(real_of_lanes(at->p.x, lane), real_of_lanes(at->p.y, lane), real_of_lanes(at->p.z, lane)),
        vec(real_of_lanes(at->n.x, lane), real_of_lanes(at->n.y, lane), real_of_lanes(at->n.z, lane)),
        index_of_lanes(at->slot, lane), index_of_lanes(at->both_sides, lane)};
}

typedef struct {
    Vec wi; /* unit vector to the light */
    Real distance;
    Light weight;       /* emission / (p_i pdf_w): what reaches the point if nothing is in between; … */
    Real inverse_pdf_w; /* 1/(p_i pdf_w), sr, 0 where no random ray could hit the light; from name_towards both
                           without emission and p_i, which sample_light_point puts in */
    Index slot, emitter;
} LightSample;

/* A light's number or vector; without a choice there is only light 0 and nothing to look up. */
INLINE Real of_light(const Num *table, Index i, Features f)
{
    return f.has & HAS_MANY_LIGHTS ? gather(table, i) : real(table[0]);
}
INLINE Vec vec_of_light(Num (*table)[3], Index i, Features f)
{
    return f.has & HAS_MANY_LIGHTS ? vec_gather((const Num(*)[3])table, i) : vec_of(table[0]);
}
INLINE Index index_of_light(const Int *table, Index i, Features f)
{
    return f.has & HAS_MANY_LIGHTS ? gather_index(table, i) : index_of(table[0]);
}
INLINE Light emission_of(const Emitters *emitters, Index i, Features f)
{
    return f.has & HAS_MANY_LIGHTS ? light_gather(emitters->emission[0], i * 3) : light_of(emitters->emission[0]);
}
INLINE Mask shines_from(const Emitters *emitters, ShapeKind shape, Index i, Features f)
{
    return index_of_light(emitters->shape, i, f) == index_of(shape);
}

/* The first ray of a light path. */
typedef struct {
    Vec o, d;
    Index from; /* slot */
    Light flux; /* that it carries, over the emission of the light */
} FirstRay;

/* T1 The densities of a light path's first ray. Of a light at a place: of its point, m⁻² (of a delta light 1), and of its
   direction, sr⁻¹. Of one from far away: of its direction, sr⁻¹ (or 1), and of where across it the ray is, m⁻². */
typedef struct {
    Real p_0, p_1;
    Real cosine; /* of the direction at the light's surface, on the side that shines; 1 where it has none */
    Mask far, met; /* met: random rays meet it, for it is no delta */
} EmitPdf;

INLINE Real pdf_a_across(const Emitters *emitters)
{
    return REAL_INV_PI / (real(emitters->world_radius) * real(emitters->world_radius));
}

/* L1 Towards the light's place: E = I cosθ/d², I in W·sr⁻¹ (Mitsuba's intensity, the lecture's flux / 4π). The
   receiver's cosine is left to the caller. */
INLINE LightSample towards_place(const Emitters *emitters, Index i, const Receiver *at, Features f)
{
    Vec delta = vec_sub(vec_of_light(emitters->position, i, f), at->p);
    Real distance = vec_length(delta), inverse_d = real(1) / distance;
    return (LightSample){
        vec_scale(delta, inverse_d), distance, light_all(inverse_d * inverse_d), real(0), index_of(-1), i};
}

/* From far away along d: through a uniform point of the disk across it that the scene's ball casts. */
INLINE FirstRay from_far_away(const Emitters *emitters, Vec d, const Real place[2], Real flux)
{
    Real x, y, radius = real(emitters->world_radius);
    sample_disk(place[0], place[1], &x, &y);
    Vec across = vec_from_frame(d, vec(x * radius, y * radius, -radius));
    return (FirstRay){vec_add(vec_of(emitters->world_center), across), d, index_of(-1), light_all(flux)};
}
