/* What the command line selects: the lecture's techniques, and what a scene and a technique need of a kernel.
   */
#ifndef ONERAY_TECHNIQUE_H
#define ONERAY_TECHNIQUE_H

#include "kinds.h"

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

#endif
