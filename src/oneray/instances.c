/* The specialised instances: which features each is compiled for. The first that serves a scene and technique
   renders it, the generic kernel what none serves. A new one is a line of the list. */
#include "trace.h"

#if !defined(INSTANCES) || !defined(SPECIALISED)
#error "INSTANCES: the name of the table that this compilation defines; SPECIALISED: all of it inline"
#endif

#define ROOM (HAS_ALIGNED | HAS_RECTANGLE | HAS_CUBE | HAS_DIFFUSE | HAS_AREA | HAS_FLAT_LIGHT)
#define LIGHT (USE_NEE | USE_MIS | USE_COSINE)

/* clang-format off */
#define LIST(X)                                                                                              \
    X(direct,         ROOM | LIGHT | USE_SOLID_ANGLE)                                                        \
    X(room,           ROOM | LIGHT | USE_SOLID_ANGLE | USE_ROULETTE)                                         \
    X(room_sobol,     ROOM | LIGHT | USE_SOLID_ANGLE | USE_ROULETTE | USE_SOBOL)
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
