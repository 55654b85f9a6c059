/* Scene files: read, asked for their precision, and searched for surfaces in one place. */
#include "scene/description.h"
#include "scene/precision.h"
#include "scene/stacks.h"

static void read_scene(const uint8_t *bytes, size_t size)
{
    char reason[128];
    (void)bytes, (void)size; /* as the file scene.xml */
    const Parameter given[] = {{.name = "depth", .value = "3"}};
    const uint64_t image[2] = {size % 3 * 7, 0};
    Description *description = description_read("scene.xml", given, size % 4 == 0, size % 5 ? NULL : "1", image);
    precision_for(description, reason, (int)sizeof reason);
    find_stacks(description, "scene.xml", size % 2 ? 1e-7 : 1e-16);
    description_free(description);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    if (size)
        fuzz_run(read_scene, bytes, size);
    return 0;
}
