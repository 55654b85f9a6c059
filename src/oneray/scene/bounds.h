/* How far shapes extend. */
#ifndef ONERAY_SCENE_BOUNDS_H
#define ONERAY_SCENE_BOUNDS_H

#include "scene/description.h"

/* The axis-aligned box around a shape. */
void bounds_of_shape(const Description *d, const Shape *shape, double low[3], double high[3]);

/* The same around all shapes; 0 without any. */
void bounds_of_scene(const Description *d, double low[3], double high[3]);

#endif
