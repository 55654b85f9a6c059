/* What media between surfaces do to light. There is no kind of medium yet: the list MEDIA of kinds.h is empty, and with it
   all that asks for one. media/NAME.h defines name_transmittance. */
#pragma once

#include "kinds/media.h"
#include "lanes/light.h"
#include "shapes/shape.h"

/* The share of light that comes through along the stretch of the ray up to tmax. */
INLINE Light transmittance(const Ray *ray, Features f)
{
    Light share = light_all(real(1));
    (void)ray, (void)f;
#define X(NAME, name, words)                                                                                 \
    if (f.has & HAS_##NAME)                                                                                  \
        share = light_mul(share, name##_transmittance(ray));
    MEDIA(X)
#undef X
    return share;
}
