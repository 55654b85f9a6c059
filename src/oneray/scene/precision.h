/* Which precision a scene needs. */
#pragma once

#include "scene/description.h"

/* "single" where its errors stay below 1e-5 of a pixel's value by the rules of precision.c, else "double".
   `reason` gets the rule that decided, at most size characters. */
const char *precision_for(const Description *scene, char *reason, int size);

/* Ends the program if the scene has numbers that single precision cannot hold, or whose squares it cannot. */
void refuse_beyond_single(const Description *scene, const char *file);
