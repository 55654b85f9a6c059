/* What all of prepare/ uses: room that lives as long as the scene. */
#pragma once

#include "message.h"
#include "prepare/scene.h"
#include "scene/description.h"

#include <stdlib.h>

/* Room that lives as long as the scene, zeroed; what gather_four reads beyond the end is there. */
static void *keep(Scene *scene, size_t count, size_t size)
{
    scene->kept = reallocate(scene->kept, (size_t)scene->kept_count + 1, sizeof *scene->kept);
    return scene->kept[scene->kept_count++] = allocate(count + (3 * sizeof(Num) + size - 1) / size, size);
}

/* The same from the beginning of a line of the processor's cache on. */
enum { CACHE_LINE = 64 };
static void *keep_lines(Scene *scene, size_t count, size_t size)
{
    char *room = keep(scene, count + CACHE_LINE / size + 1, size);
    return room + (CACHE_LINE - (uintptr_t)room % CACHE_LINE) % CACHE_LINE;
}
