/* What the command line selects: the lecture's techniques, L1 to L19. */
#pragma once

#include "kinds.h"

/* A list for each choice, a line for each value: its name in code, its word on the command line, and what --help
   says of it, the lecture's technique first. */
#define ESTIMATORS(X)                                                                                        \
    X(ESTIMATOR_WALK, "walk", "L7 the random walk alone: light counts where a random ray hits it")           \
    X(ESTIMATOR_NEE, "nee", "L10 next event estimation: a ray to a light at every vertex (L1 to L3, L11, L12)") \
    X(ESTIMATOR_MIS, "mis", "L13 both, weighed by multiple importance sampling")                             \
    X(ESTIMATOR_LIGHT, "light", "L17 light tracing: paths from the lights, each vertex joined to the eye")     \
    X(ESTIMATOR_BIDIRECTIONAL, "bidirectional",                                                              \
        "T1 both ways at once: each vertex of a path from a light joined to each from the eye")              \
    X(ESTIMATOR_PHOTONS, "photons",                                                                          \
        "T2 photon map: light gathered where paths from lights came; consistent, not unbiased")

#define HEMISPHERES(X)                                                                                       \
    X(HEMISPHERE_UNIFORM, "uniform", "L8 uniform, scaled by 2 pi")                                           \
    X(HEMISPHERE_COSINE, "cosine", "L9 in proportion to the cosine")

#define NORMALS(X)                                                                                           \
    X(NORMALS_ALL, "all", "P1 in proportion to their area across the surface's normal, seen or not")            \
    X(NORMALS_VISIBLE, "visible", "P1 of those that the viewer sees, as large as he sees them")

#define LIGHT_CHOICES(X)                                                                                     \
    X(LIGHT_CHOICE_UNIFORM, "uniform", "L4 each with 1/N; L6 situation 1, nothing known of occlusion")       \
    X(LIGHT_CHOICE_POWER, "power", "L4 in proportion to the flux (the default with --estimator light)")      \
    X(LIGHT_CHOICE_CONTRIBUTION, "contribution",                                                             \
        "L6 by flux, distance and cosines; 0 where a light cannot contribute")                               \
    X(LIGHT_CHOICE_LEARNED, "learned", "L18 that, and what a pre-pass saw of occlusion, L6 situation 2")      \
    X(LIGHT_CHOICE_RESAMPLED, "resampled", "T4 of several points so chosen one, by the light that it would bring")

#define POINTS_ON_LIGHTS(X)                                                                                      \
    X(LIGHT_POINTS_AREA, "area", "L2, L3 uniform on its area")                                               \
    X(LIGHT_POINTS_FACING, "facing", "L5 the half of a sphere that faces the point, twice the density")      \
    X(LIGHT_POINTS_CONE, "cone", "L5 the cone that a sphere fills; the solid angle of a rectangle")

#define MIS_HEURISTICS(X)                                                                                    \
    X(MIS_BALANCE, "balance", "L13 balance heuristic")                                                       \
    X(MIS_POWER, "power", "L13 power heuristic, exponent 2")

#define MIS_PDFS(X)                                                                                          \
    X(MIS_PDF_BSDF, "bsdf", "L13 of the direction")                                                          \
    X(MIS_PDF_SURVIVAL, "survival", "L13 of the direction and of surviving roulette, brdfPdf * Psurvive")

#define ROULETTES(X)                                                                                         \
    X(ROULETTE_NONE, "none", "L19 at max_depth only")                                                        \
    X(ROULETTE_SURVIVAL, "survival", "L14 from rr_depth on it survives with min(1, throughput)")

#define FRESNELS(X)                                                                                          \
    X(FRESNEL_EXACT, "exact", "L15 Fresnel's")                                                               \
    X(FRESNEL_SCHLICK, "schlick", "L15 Schlick's approximation: another picture, a little wrong")

/* No technique of the lecture: lanes/sampler.h. */
#define SAMPLERS(X)                                                                                          \
    X(SAMPLER_INDEPENDENT, "independent",                                                                    \
        "by chance, what the lecture's variances and the standard errors are about")                         \
    X(SAMPLER_SOBOL, "sobol", "evenly (Owen-scrambled Sobol' points): less noise, no standard errors")

#define NAME(name, word, help) name,
enum { ESTIMATORS(NAME) };
enum { HEMISPHERES(NAME) };
enum { NORMALS(NAME) };
enum { LIGHT_CHOICES(NAME) };
enum { POINTS_ON_LIGHTS(NAME) };
enum { MIS_HEURISTICS(NAME) };
enum { MIS_PDFS(NAME) };
enum { ROULETTES(NAME) };
enum { FRESNELS(NAME) };
enum { SAMPLERS(NAME) };
#undef NAME

/* A value of each list. */
typedef struct {
    int estimator, hemisphere, normals, light_choice, light_points, mis, mis_pdf, roulette, fresnel, sampler;
    double radius;        /* of photons in the first pass, m; 0: of the scene's size */
    uint64_t photons;     /* light paths of a pass; 0: one for each pixel of the image */
    uint64_t strategy[2]; /* of bidirectional paths the one that is rendered, unweighted: vertices from the light and from the
                             eye; {0, 0}: all */
    uint64_t candidates; /* of LIGHT_CHOICE_RESAMPLED */
} Technique;

enum { FEW_CANDIDATES = 4, MOST_CANDIDATES = 64 }; /* without --candidates, and with it */

/* A path that has come this far never ends: the scene is closed and absorbs nothing. An error, not a cut: where 1e-5
   is absorbed, one path in e^100 is that long. */
#define PATH_LIMIT 10000000
