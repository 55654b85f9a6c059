/* What the command line selects: the lecture's techniques, and what a scene and a technique need of a kernel.
   */
#ifndef ONERAY_TECHNIQUE_H
#define ONERAY_TECHNIQUE_H

#include <stdint.h>

typedef enum { ESTIMATOR_WALK, ESTIMATOR_NEE, ESTIMATOR_MIS, ESTIMATOR_LIGHT } Estimator; /* L7; L10; L13; L17 */
typedef enum { HEMISPHERE_UNIFORM, HEMISPHERE_COSINE } Hemisphere;                       /* L8; L9 */
typedef enum {
    LIGHT_CHOICE_UNIFORM,      /* L4 */
    LIGHT_CHOICE_POWER,        /* L4 */
    LIGHT_CHOICE_CONTRIBUTION, /* L6 */
    LIGHT_CHOICE_LEARNED       /* L18 */
} LightChoice;
typedef enum { LIGHT_POINTS_AREA, LIGHT_POINTS_FACING, LIGHT_POINTS_CONE } LightPoints; /* L3, L5 */
typedef enum { MIS_BALANCE, MIS_POWER } MisHeuristic;                                    /* L13 */
typedef enum { MIS_PDF_BSDF, MIS_PDF_SURVIVAL } MisPdf;                                  /* L13 */
typedef enum { ROULETTE_NONE, ROULETTE_SURVIVAL } Roulette;                              /* L19; L14 */
typedef enum { FRESNEL_EXACT, FRESNEL_SCHLICK } Fresnel;                                 /* L15 */
typedef enum { SAMPLER_INDEPENDENT, SAMPLER_SOBOL } Sampler; /* sampler.h; no technique of the lecture */

typedef struct {
    Estimator estimator;
    Hemisphere hemisphere;
    LightChoice light_choice;
    LightPoints light_points;
    MisHeuristic mis;
    MisPdf mis_pdf;
    Roulette roulette;
    Fresnel fresnel;
    Sampler sampler;
} Technique;

/* The feature mask: bit by bit, what a scene has and a technique uses. A kernel instance is compiled for a
   set of features; what is not in the set is not in its machine code. */
#define FEATURES(X) \
    X(HAS_RECTANGLE,       "rectangle")          X(HAS_DISK,         "disk") \
    X(HAS_ALIGNED,         "rectangle along the axes") \
    X(HAS_SPHERE,          "sphere")             X(HAS_CUBE,         "cube") \
    X(HAS_TRIANGLE,        "mesh")               X(HAS_SMOOTH,       "interpolated normals") \
    X(HAS_TREE,            "tree of many shapes") \
    X(HAS_DIFFUSE,         "diffuse")            X(HAS_CONDUCTOR,    "conductor") \
    X(HAS_FRESNEL,         "Fresnel of metals")  X(HAS_DIELECTRIC,   "dielectric") \
    X(HAS_BLEND,           "blend of materials") X(HAS_AREA,         "area light") \
    X(HAS_FLAT_LIGHT,      "flat light")         X(HAS_SPHERE_LIGHT, "sphere light") \
    X(HAS_TRIANGLE_LIGHT,  "mesh light") \
    X(HAS_POINT,           "point light")        X(HAS_SPOT,         "spot light") \
    X(HAS_DIRECTIONAL,     "directional light")  X(HAS_CONSTANT,     "environment") \
    X(HAS_MANY_LIGHTS,     "light choice")       X(HAS_HIDDEN,       "hidden emitters") \
    X(USE_NEE,             "next event estimation") \
    X(USE_MIS,             "multiple importance sampling") \
    X(USE_BALANCE,         "balance heuristic")  X(USE_SURVIVAL_PDF, "survival in the pdf of MIS") \
    X(USE_CONTRIBUTION,    "light choice by contribution") \
    X(USE_LEARNED,         "learned light choice") \
    X(USE_FACING,          "facing half of sphere lights") \
    X(USE_CONE,            "cone of sphere lights") \
    X(USE_SOLID_ANGLE,     "solid angle of rectangle lights") \
    X(USE_COSINE,          "cosine hemisphere")  X(USE_ROULETTE,     "roulette") \
    X(USE_SCHLICK,         "Schlick's Fresnel")  X(USE_LIGHT_PATHS,  "light tracing") \
    X(USE_SOBOL,           "Sobol' points")

enum {
#define X(name, words) BIT_##name,
    FEATURES(X)
#undef X
    FEATURE_COUNT
};

typedef uint64_t Features;

#define X(name, words) static const Features name __attribute__((unused)) = (Features)1 << BIT_##name;
FEATURES(X)
#undef X

/* The bits that an instance must have as asked, no more and no less: those that choose between two ways, and
   those that go with tables which other scenes do not have. */
#define EXACTLY                                                                                              \
    (USE_NEE | USE_MIS | USE_BALANCE | USE_SURVIVAL_PDF | USE_CONTRIBUTION | USE_LEARNED | USE_FACING        \
        | USE_CONE | USE_SOLID_ANGLE | USE_COSINE | USE_SCHLICK | USE_LIGHT_PATHS | HAS_HIDDEN               \
        | HAS_TREE | HAS_TRIANGLE | HAS_FRESNEL | HAS_BLEND)
#define EVERY_FEATURE (((Features)1 << FEATURE_COUNT) - 1)

#endif
