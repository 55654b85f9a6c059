/* What the command line selects: the lecture's techniques, and what a scene and a technique need of a kernel.
   */
#ifndef ONERAY_TECHNIQUE_H
#define ONERAY_TECHNIQUE_H

#include <stdint.h>

typedef enum { ESTIMATOR_WALK, ESTIMATOR_NEE, ESTIMATOR_MIS } Estimator;      /* L7; L10; L13 */
typedef enum { HEMISPHERE_UNIFORM, HEMISPHERE_COSINE } Hemisphere;            /* L8; L9 */
typedef enum { LIGHT_CHOICE_UNIFORM, LIGHT_CHOICE_POWER } LightChoice;        /* L4 */
typedef enum { MIS_BALANCE, MIS_POWER } MisHeuristic;                         /* L13 */
typedef enum { ROULETTE_NONE, ROULETTE_SURVIVAL } Roulette;                   /* L19; L14 */

typedef struct {
    Estimator estimator;
    Hemisphere hemisphere;
    LightChoice light_choice;
    MisHeuristic mis;
    Roulette roulette;
} Technique;

/* The feature mask: bit by bit, what a scene has and a technique uses. A kernel instance is compiled for a
   set of features; what is not in the set is not in its machine code. */
#define FEATURES(X) \
    X(HAS_RECTANGLE,       "rectangle")          X(HAS_DISK,         "disk") \
    X(HAS_ALIGNED,         "rectangle along the axes") \
    X(HAS_SPHERE,          "sphere")             X(HAS_CUBE,         "cube") \
    X(HAS_DIFFUSE,         "diffuse")            X(HAS_CONDUCTOR,    "conductor") \
    X(HAS_FRESNEL,         "Fresnel")            X(HAS_AREA,         "area light") \
    X(HAS_FLAT_LIGHT,      "flat light")         X(HAS_SPHERE_LIGHT, "sphere light") \
    X(HAS_POINT,           "point light")        X(HAS_SPOT,         "spot light") \
    X(HAS_DIRECTIONAL,     "directional light")  X(HAS_CONSTANT,     "environment") \
    X(HAS_MANY_LIGHTS,     "light choice")       X(HAS_HIDDEN,       "hidden emitters") \
    X(USE_NEE,             "next event estimation") \
    X(USE_MIS,             "multiple importance sampling") \
    X(USE_BALANCE,         "balance heuristic")  X(USE_COSINE,       "cosine hemisphere") \
    X(USE_ROULETTE,        "roulette")

enum {
#define X(name, words) BIT_##name,
    FEATURES(X)
#undef X
    FEATURE_COUNT
};

typedef uint32_t Features;

#define X(name, words) static const Features name __attribute__((unused)) = (Features)1 << BIT_##name;
FEATURES(X)
#undef X

/* The bits that choose between two ways, where an instance must have what is asked for and no more; of the
   others an instance may have more than the scene needs. */
#define EITHER_WAY (USE_NEE | USE_MIS | USE_BALANCE | USE_COSINE | USE_ROULETTE | HAS_HIDDEN)
#define EVERY_FEATURE (((Features)1 << FEATURE_COUNT) - 1)

#endif
