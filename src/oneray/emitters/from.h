/* Where a light's light comes from. */
#ifndef ONERAY_EMITTERS_FROM_H
#define ONERAY_EMITTERS_FROM_H

#include "fields.h"
#include "vectors.h"

typedef enum {
    FROM_SHAPE, /* in which the emitter stands: random rays meet it */
    FROM_POINT,
    FROM_AFAR,  /* one direction */
    FROM_AROUND /* the environment, which random rays meet that meet nothing else */
} LightFrom;

#endif
