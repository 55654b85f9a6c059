/* Mesh files, PLY or OBJ as READ says: read and brought to the world, as they are and turned over. */
#include "meshes/mesh.h"

#include "message.h"

#include <string.h>

static void read_mesh(const uint8_t *bytes, size_t size)
{
    static const Affine to_world = {{{0, 2, 0, 1}, {0, 0, -3, 0}, {1, 0, 0, 0}}};
    for (int turned = 0; turned < 2; turned++) {
        char *text = allocate(size + 1, 1);
        Mesh mesh = {0}, all = {0};
        memcpy(text, bytes, size);
        READ(&(Source){"mesh", text, text + size, 1}, &mesh);
        if (!mesh.triangle_count)
            die_at("mesh", 1, "the mesh has no faces");
        mesh_finish(&mesh, "mesh", &to_world, turned, turned && size % 2);
        mesh_append(&all, &mesh);
        mesh_free(&all);
        free(text);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    fuzz_run(read_mesh, bytes, size);
    return 0;
}
