/* Surfaces in one place, and which of them is in front. */
#pragma once

#include "scene/description.h"

/* Fills the description's stacks for kernels whose numbers are known to `rounding` of themselves, and warns where the
   picture depends on an order that the file does not say. */
void find_stacks(Description *d, const char *file, double rounding);
