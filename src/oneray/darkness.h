/* Why a picture came out black. */
#pragma once

#include "render.h"

/* One warning, if the film is black and nothing was said that explains it: the reason is found by rendering a few
   samples of the scene with one thing changed, until it is black no longer. */
void say_why_black(const Render *r);
