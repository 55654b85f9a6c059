/* The specialised instances: which features each is compiled for. The first that serves a scene and technique
   renders it, the generic kernel what none serves; one with more than a scene has serves it too. A new one is a line of the list. */
#include "kernel/trace.h"

#if !defined(INSTANCES) || !defined(SPECIALISED)
#error "INSTANCES: the name of the table that this compilation defines; SPECIALISED: all of it inline"
#endif

#define ROOM (HAS_PERSPECTIVE | HAS_ALIGNED | HAS_RECTANGLE | HAS_CUBE | HAS_DIFFUSE | HAS_AREA | HAS_FLAT_LIGHT)
#define ROUND (HAS_SPHERE | HAS_DISK)
#define MIS (USE_NEE | USE_MIS | USE_COSINE | USE_ROULETTE)
#define PANELS (MIS | USE_SOLID_ANGLE)

/* Name, which loop, what the scene may have, what the technique uses. */
/* clang-format off */
#ifndef LIST
#define LIST(X)                                                                                              \
    X(room,  trace_paths, ROOM,                                            PANELS)                           \
    X(ball,  trace_paths, ROOM | HAS_SPHERE | HAS_SPHERE_LIGHT,            MIS | USE_CONE)                   \
    X(glass, trace_paths, ROOM | ROUND | HAS_CONDUCTOR | HAS_DIELECTRIC,   PANELS)                           \
    X(many,  trace_paths, ROOM | HAS_MANY_LIGHTS | HAS_TREE,               PANELS | USE_CONTRIBUTION)        \
    X(resampled, trace_paths, ROOM | HAS_MANY_LIGHTS | HAS_TREE,           PANELS | USE_CONTRIBUTION | USE_RESAMPLED) \
    X(mesh,  trace_paths, ROOM | HAS_MESH | HAS_SMOOTH,                    PANELS)                           \
    X(walk,  trace_paths, ROOM | ROUND,                                    USE_COSINE | USE_ROULETTE)        \
    X(pairs, trace_pairs, ROOM,                                            PANELS | USE_BIDIRECTIONAL)       \
    X(room_sobol, trace_paths, ROOM,                                       PANELS | USE_SOBOL)
#endif
/* clang-format on */

#define X(name, trace, has, use)                                                                                    \
    static void render_##name(const Scene *scene, const Job *job, Counters *counters)                        \
    {                                                                                                        \
        trace(scene, job, counters, (Features){has, use});                                                   \
    }
LIST(X)
#undef X

#define X(name, trace, has, use) {#name, {has, use}, render_##name},
const Instance INSTANCES[] = {LIST(X){NULL, {0, 0}, NULL}};
#undef X
