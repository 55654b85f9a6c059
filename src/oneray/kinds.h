/* Everything that there is several kinds of. A new kind is a file in the folder of its list and a line here: from
   these lines come the enums, the bits of the feature mask, the reader's tables of plugins, the features of a scene
   and the places where a kernel chooses between kinds. The Makefile makes kinds/FOLDER.h, which includes the files
   of a folder. What a kind's file defines is said where its list is used: materials/material.h, shapes/shape.h,
   textures/texture.h, emitters/emitter.h, media/medium.h, sensors/eye.h, filters/filter.h.

   A line: the kind in capitals, its name in code, its words in --stats. The kind's file, FOLDER/NAME.h, begins with
   what a scene file says of it: a struct NAME, the table NAME_plugin that it is read by (fields.h), and what others
   ask of it (traits.h). What follows #ifdef LANES is the kernels'. */
#pragma once

#include <stdint.h>

/* Of the first the BSDF is a finite number; of the others a delta: light comes from single directions, which can be
   sampled but not evaluated. A row of zeros is the first kind's, and black. A coat reflects light besides what the
   row's reflectance says; that of a smooth coat is a delta, which is sampled with the rest. */
#define SMOOTH_COATS(X) X(PLASTIC, plastic, "plastic")
#define ROUGH_COATS(X) X(ROUGHPLASTIC, roughplastic, "rough plastic")
#define COATS(X) SMOOTH_COATS(X) ROUGH_COATS(X) X(PRINCIPLED, principled, "principled")
#define ROUGH_BOUNDARIES(X)                                                                                  \
    X(ROUGHCONDUCTOR, roughconductor, "rough conductor")                                                     \
    X(ROUGHDIELECTRIC, roughdielectric, "rough dielectric")
#define ROUGH_MATERIALS(X) ROUGH_BOUNDARIES(X) ROUGH_COATS(X) /* of microfacets */
#define FINITE_MATERIALS(X) X(DIFFUSE, diffuse, "diffuse") ROUGH_BOUNDARIES(X) COATS(X)
#define DELTA_MATERIALS(X)                                                                                   \
    X(CONDUCTOR, conductor, "conductor")                                                                     \
    X(DIELECTRIC, dielectric, "dielectric")                                                                  \
    X(THINDIELECTRIC, thindielectric, "thin dielectric")                                                     \
    X(NULL, null, "null")
#define MATERIALS(X) FINITE_MATERIALS(X) DELTA_MATERIALS(X)

/* What a ray meets, flat shapes before the others, by one division for all of them. Two are special: rectangles along
   the axes share divisions by axis, and triangles have a tree of their own. */
#define FLAT_SHAPES(X)                                                                                       \
    X(RECTANGLE, rectangle, "rectangle")                                                                     \
    X(DISK, disk, "disk")
#define POLYHEDRA(X) X(CUBE, cube, "cube")
#define ROUND_SHAPES(X) X(SPHERE, sphere, "sphere") X(CYLINDER, cylinder, "cylinder")
#define SOLID_SHAPES(X) POLYHEDRA(X) ROUND_SHAPES(X)
#define ALIGNED_SHAPES(X) X(ALIGNED, aligned, "rectangle along the axes")
#define MESH_SHAPES(X) X(MESH, mesh, "mesh")
#define SHAPES(X)                                                                                            \
    ALIGNED_SHAPES(X) FLAT_SHAPES(X) SOLID_SHAPES(X) MESH_SHAPES(X)
/* What a scene file may have; a rectangle becomes an ALIGNED where it can. */
#define FILE_SHAPES(X) FLAT_SHAPES(X) SOLID_SHAPES(X) MESH_SHAPES(X)

/* Lights: on shapes; those that no ray hits by chance; and what a ray meets where it leaves the scene. */
#define DELTA_EMITTERS(X)                                                                                    \
    X(POINT, point, "point light")                                                                           \
    X(SPOT, spot, "spot light")                                                                              \
    X(DIRECTIONAL, directional, "directional light")
#define SKIES(X)                                                                                             \
    X(CONSTANT, constant, "environment")                                                                     \
    X(ENVMAP, envmap, "environment map")
#define EMITTERS(X) X(AREA, area, "area light") DELTA_EMITTERS(X) SKIES(X)

/* What a reflectance can be instead of a colour. */
#define TEXTURES(X)                                                                                          \
    X(CHECKERBOARD, checkerboard, "checkerboard")                                                            \
    X(BITMAP, bitmap, "bitmap")
/* What is between surfaces. */
#define MEDIA(X) X(HOMOGENEOUS, homogeneous, "homogeneous medium")
#define SENSORS(X)                                                                                           \
    X(PERSPECTIVE, perspective, "perspective")                                                               \
    X(THINLENS, thinlens, "thin lens")                                                                       \
    X(ORTHOGRAPHIC, orthographic, "orthographic")
/* What weighs the film around a pixel's middle. */
#define FILTERS(X)                                                                                           \
    X(BOX, box, "box")                                                                                       \
    X(TENT, tent, "tent")                                                                                    \
    X(GAUSSIAN, gaussian, "gaussian")

/* What a scene has besides. */
#define TRAITS(X)                                                                                            \
    X(SMOOTH, smooth, "interpolated normals")                                                                \
    X(TREE, tree, "tree of many shapes")                                                                     \
    X(FRESNEL, fresnel, "Fresnel of metals")                                                                 \
    X(BLEND, blend, "blend of materials")                                                                    \
    X(PARTS, parts, "blend of several finite materials")                                                     \
    X(WEIGHTS, weights, "textured weights")                                                                  \
    X(BUMP, bump, "bumps")                                                                                   \
    X(FLAT_LIGHT, flat_light, "flat light")                                                                  \
    X(SPHERE_LIGHT, sphere_light, "sphere light")                                                            \
    X(CYLINDER_LIGHT, cylinder_light, "cylinder light")                                                      \
    X(MESH_LIGHT, mesh_light, "mesh light")                                                                  \
    X(MANY_LIGHTS, many_lights, "light choice")                                                              \
    X(HIDDEN, hidden, "hidden emitters")                                                                      \
    X(STACKS, stacks, "surfaces in one place")                                                                \
    X(UV, uv, "texture coordinates")                                                                         \
    X(ANISOTROPIC, anisotropic, "anisotropic roughness")                                                     \
    X(BECKMANN, beckmann, "Beckmann's distribution")                                                         \
    X(FILTER, filter, "filter that is no pixel")                                                             \
    X(PASSING, passing, "boundaries that are no vertices")

/* What a technique does with it (technique.h). */
#define USES(X)                                                                                              \
    X(NEE, nee, "next event estimation")                                                                     \
    X(MIS, mis, "multiple importance sampling")                                                              \
    X(BALANCE, balance, "balance heuristic")                                                                 \
    X(SURVIVAL_PDF, survival_pdf, "survival in the pdf of MIS")                                              \
    X(CONTRIBUTION, contribution, "light choice by contribution")                                            \
    X(LEARNED, learned, "learned light choice")                                                              \
    X(RESAMPLED, resampled, "resampled light samples")                                                       \
    X(FACING, facing, "facing half of sphere lights")                                                        \
    X(CONE, cone, "cone of sphere lights")                                                                   \
    X(SOLID_ANGLE, solid_angle, "solid angle of rectangle lights")                                           \
    X(COSINE, cosine, "cosine hemisphere")                                                                   \
    X(ALL_NORMALS, all_normals, "all microfacets")                                                           \
    X(ROULETTE, roulette, "roulette")                                                                        \
    X(SCHLICK, schlick, "Schlick's Fresnel")                                                                 \
    X(LIGHT_PATHS, light_paths, "light tracing")                                                             \
    X(BIDIRECTIONAL, bidirectional, "bidirectional paths")                                                   \
    X(PHOTONS, photons, "photons")                                                                           \
    X(SOBOL, sobol, "Sobol' points")

#define X(NAME, name, words) MATERIAL_##NAME,
typedef enum { MATERIALS(X) MATERIAL_BLEND } MaterialKind;
#undef X
#define X(NAME, name, words) TEXTURE_##NAME,
typedef enum { TEXTURE_NONE, TEXTURES(X) TEXTURE_KINDS } TextureKind;
#undef X
#define X(NAME, name, words) SHAPE_##NAME,
typedef enum { SHAPES(X) SHAPE_KINDS } ShapeKind;
#undef X
#define X(NAME, name, words) EMITTER_##NAME,
typedef enum { EMITTERS(X) EMITTER_KINDS } EmitterKind;
#undef X
#define X(NAME, name, words) MEDIUM_##NAME,
typedef enum { MEDIA(X) MEDIUM_KINDS } MediumKind;
#undef X
#define X(NAME, name, words) SENSOR_##NAME,
typedef enum { SENSORS(X) SENSOR_KINDS } SensorKind;
#undef X
#define X(NAME, name, words) FILTER_##NAME,
typedef enum { FILTERS(X) FILTER_KINDS } FilterKind;
#undef X

#define KINDS(X) SHAPES(X) MATERIALS(X) EMITTERS(X) TEXTURES(X) MEDIA(X) SENSORS(X) TRAITS(X)

/* The feature mask: what a scene has and what a technique uses, a bit each. A kernel instance is compiled for a
   constant mask; what is not in it is not in its machine code. */
typedef struct {
    uint64_t has, use;
} Features;

enum {
#define X(NAME, name, words) BIT_HAS_##NAME,
    KINDS(X) HAS_COUNT,
#undef X
#define X(NAME, name, words) BIT_USE_##NAME,
    BIT_BEFORE_USES = -1,
    USES(X) USE_COUNT
#undef X
};
typedef char features_fit_their_words[HAS_COUNT <= 64 && USE_COUNT <= 64 ? 1 : -1];

#define X(NAME, name, words) static const uint64_t HAS_##NAME __attribute__((unused)) = (uint64_t)1 << BIT_HAS_##NAME;
KINDS(X)
#undef X
#define X(NAME, name, words) static const uint64_t USE_##NAME __attribute__((unused)) = (uint64_t)1 << BIT_USE_##NAME;
USES(X)
#undef X

/* A bit for each kind of a list: HAS_ANY(MATERIALS). */
#define OR_HAS(NAME, name, words) | HAS_##NAME
#define HAS_ANY(LIST) (0 LIST(OR_HAS))

/* Is only one kind of a list in the mask? Then there is nothing to choose. */
#define IS_ONE(bits) (((bits) & ((bits) - 1)) == 0)
