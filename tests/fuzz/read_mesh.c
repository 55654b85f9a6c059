/* Mesh files, PLY, OBJ or serialized as READ says: read and brought to the world, as they are and turned over. Of a
   serialized one the first byte says which mesh of the file is wanted, or that the rest is packed first. */
#include "meshes/mesh.h"

#include "message.h"

#include <string.h>
#include <zlib.h>

enum { PACK = 0x80 };

static void serialized_fuzz(Source *source, Mesh *mesh) __attribute__((unused));
static void serialized_fuzz(Source *source, Mesh *mesh)
{
    int first = source->at < source->end ? (unsigned char)*source->at++ : 0;
    size_t size = (size_t)(source->end - source->at);
    if (!(first & PACK) || size < 4) {
        serialized_read(source, first, mesh);
        return;
    }
    uLongf packed = compressBound(size - 4);
    char *text = allocate(packed + 5, 1);
    memcpy(text, source->at, 4);
    compress2((Bytef *)text + 4, &packed, (const Bytef *)source->at + 4, size - 4, 1);
    serialized_read(&(Source){"mesh", text, text + 4 + packed, 1}, first & ~PACK, mesh);
    free(text);
}

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
