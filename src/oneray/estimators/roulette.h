/* L14 Russian roulette. */
#pragma once

#include "estimators/path.h"

/* L14 The chance q that a path goes on: min(1, throughput) from rr_depth on, no upper cap below 1, which would
   make the second moment grow as (albedo²/cap)^k. */
INLINE Real survival(const Scene *scene, Light throughput, Index depth, Features f)
{
    if (!(f.use & USE_ROULETTE))
        return real(1);
    Real q = real_min(real(1), light_max(throughput));
    return select(depth >= index_of(scene->rr_depth), q, real(1));
}

/* The path goes on with probability q and is divided by it, E[1(u<q) X/q] = E[X]. A u that was below q is uniform again
   once divided by q: one number does for the whole path. */
INLINE void play_roulette(Path *path, const Scene *scene, Features f)
{
    Real q = survival(scene, path->throughput, path->depth, f);
    Real inverse_q = real(1) / q;
    path->alive &= path->roulette < q;
    path->roulette = path->roulette * inverse_q;
    path->throughput = light_scale(path->throughput, inverse_q);
    if (f.use & USE_SURVIVAL_PDF)
        path->pdf_w = path->pdf_w * q;
}
