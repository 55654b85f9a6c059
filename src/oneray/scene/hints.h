/* What a scene file can be told before anything is rendered: one warning each, what is amiss and what to do. */
#pragma once

#include "scene/description.h"

/* Was there one? */
bool scene_hints(const Description *d, const char *file);
