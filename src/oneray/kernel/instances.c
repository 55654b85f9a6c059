/* The specialised instances: which features each is compiled for. The first that serves a scene and technique
   renders it, the generic kernel what none serves; one with more than a scene has serves it too. A new one is a line of the list. */
#include "kernel/trace.h"

#if !defined(INSTANCES) || !defined(SPECIALISED)
#error "INSTANCES: the name of the table that this compilation defines; SPECIALISED: all of it inline"
#endif

#define ROOM (HAS_ALIGNED | HAS_RECTANGLE | HAS_CUBE | HAS_DIFFUSE | HAS_AREA | HAS_FLAT_LIGHT | USE_ROULETTE)
#define ROUND (HAS_SPHERE | HAS_DISK)
#define CHOICE (HAS_MANY_LIGHTS | USE_CONTRIBUTION)
#define MIS (USE_NEE | USE_MIS | USE_COSINE)

/* clang-format off */
#ifndef LIST
#define LIST(X)                                                                                              \
    X(room,   ROOM | MIS | USE_SOLID_ANGLE)                                                                  \
    X(ball,   ROOM | MIS | USE_CONE | HAS_SPHERE | HAS_SPHERE_LIGHT)                                         \
    X(glass,  ROOM | MIS | USE_SOLID_ANGLE | ROUND | HAS_CONDUCTOR | HAS_DIELECTRIC)                         \
    X(many,   ROOM | MIS | USE_SOLID_ANGLE | CHOICE | HAS_TREE)                                              \
    X(mesh,   ROOM | MIS | USE_SOLID_ANGLE | HAS_TRIANGLE | HAS_SMOOTH)                                      \
    X(walk,   ROOM | USE_COSINE | ROUND)                                                                     \
    X(room_sobol, ROOM | MIS | USE_SOLID_ANGLE | USE_SOBOL)
#endif
/* clang-format on */

#define X(name, set)                                                                                         \
    static void render_##name(const Scene *scene, const Job *job, Counters *counters)                        \
    {                                                                                                        \
        render_instance(scene, job, counters, set);                                                          \
    }
LIST(X)
#undef X

#define X(name, set) {#name, set, render_##name},
const Instance INSTANCES[] = {LIST(X){NULL, 0, NULL}};
#undef X
