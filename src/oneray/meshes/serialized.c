/* Mitsuba's serialized meshes, versions 3 and 4: after four bytes a zlib stream each, several in a file, whose places
   stand at its end. Jakob, Mitsuba Documentation, 2014, 8.2.10. All numbers are little-endian. */
#include "meshes/mesh.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum { MAGIC = 0x041C, HEADER = 4, DEFLATE_MOST = 1032 /* bytes that one byte of deflate may stand for */ };
enum { HAS_NORMALS = 0x1, HAS_UV = 0x2, HAS_COLOURS = 0x8, FACE_NORMALS = 0x10, IS_DOUBLE = 0x2000 };

/* What is unpacked of a mesh, a piece at a time. */
typedef struct {
    Source *source;
    z_stream zlib;
    bool ended;
    const char *part; /* what is being read */
    unsigned char piece[1 << 14];
    size_t at, count; /* of the piece */
} Unpacked;

static void *zlib_allocate(void *none, unsigned count, unsigned size)
{
    (void)none;
    return allocate(count, size);
}
static void zlib_free(void *none, void *block)
{
    (void)none;
    free(block);
}

static void next_piece(Unpacked *from)
{
    z_stream *zlib = &from->zlib;
    size_t rest = (size_t)(from->source->end - (const char *)zlib->next_in);
    zlib->next_out = from->piece;
    zlib->avail_out = sizeof from->piece;
    zlib->avail_in = rest < INT_MAX ? (unsigned)rest : INT_MAX;
    int result = from->ended ? Z_STREAM_END : inflate(zlib, Z_NO_FLUSH);
    from->at = 0;
    from->count = sizeof from->piece - zlib->avail_out;
    from->ended = result == Z_STREAM_END;
    if (result != Z_OK && result != Z_BUF_ERROR && result != Z_STREAM_END)
        fail(from->source, "the mesh is no zlib stream from its %s on: %s", from->part, zlib->msg ? zlib->msg : "");
    if (!from->count)
        fail(from->source, "the %s ends before the mesh's %s do", from->ended ? "zlib stream" : "file", from->part);
}

static uint64_t next_bits(Unpacked *from, int bytes)
{
    char taken[8];
    for (int i = 0; i < bytes; i++) {
        if (from->at == from->count)
            next_piece(from);
        taken[i] = (char)from->piece[from->at++];
    }
    return binary_bits(taken, (size_t)bytes, false);
}

static double next_float(Unpacked *from, int bytes) { return binary_float(next_bits(from, bytes), (size_t)bytes); }

static int next_count(Unpacked *from)
{
    uint64_t count = next_bits(from, 8);
    if (count > MESH_MOST)
        fail(from->source, "%llu %s are said to follow: at most %d are supported", (unsigned long long)count, from->part,
            MESH_MOST);
    return (int)count;
}

/* Bytes at a place of the file, as a number. */
static uint64_t number_at(const Source *source, size_t place, size_t bytes)
{
    return binary_bits(source->at + place, bytes, false);
}

/* The version of the mesh that begins at a place. */
static int version_at(const Source *source, size_t place, int index)
{
    size_t size = (size_t)(source->end - source->at);
    if (size < HEADER || place > size - HEADER || number_at(source, place, 2) != MAGIC)
        fail(source, "mesh %d should begin at byte %zu, but no serialized mesh of Mitsuba does", index, place);
    int version = (int)number_at(source, place + 2, 2);
    if (version != 3 && version != 4)
        fail(source, "version %d of serialized meshes is not supported (3, 4): a PLY of the mesh is", version);
    return version;
}

/* Goes to the mesh of this index: its place is one of those at the file's end, which their number follows. */
static int find_mesh(Source *source, int index)
{
    size_t size = (size_t)(source->end - source->at), place = 0;
    int version = version_at(source, 0, 0);
    if (index) {
        uint64_t count = number_at(source, size - 4, 4), each = version > 3 ? 8 : 4;
        if (count > (size - 4) / each)
            fail(source, "the file ends in the places of %llu meshes, which it is too short for", (unsigned long long)count);
        if ((uint64_t)index >= count)
            fail(source, "\"shape_index\" is %d, but the file has %llu meshes, from 0 on", index, (unsigned long long)count);
        place = (size_t)number_at(source, size - 4 - (size_t)(each * (count - (uint64_t)index)), (size_t)each);
        version = version_at(source, place, index);
    }
    source->at += place + HEADER;
    return version;
}

/* Makes room for vertices and triangles, once it is certain that the file can hold them. */
static void make_room(Unpacked *from, Mesh *mesh, int flags, int bytes)
{
    const Source *source = from->source;
    size_t rest = (size_t)(source->end - source->at);
    int numbers = 3 + (flags & HAS_NORMALS ? 3 : 0) + (flags & HAS_UV ? 2 : 0) + (flags & HAS_COLOURS ? 3 : 0);
    size_t wanted = (size_t)mesh->vertex_count * (size_t)(numbers * bytes) + (size_t)mesh->triangle_count * 12;
    if (wanted / DEFLATE_MOST > rest)
        fail(source, "%d vertices and %d triangles are said to follow, but only %zu bytes do", mesh->vertex_count,
            mesh->triangle_count, rest);
    mesh->vertex = allocate((size_t)mesh->vertex_count, sizeof *mesh->vertex);
    mesh->triangle = allocate((size_t)mesh->triangle_count, sizeof *mesh->triangle);
    if (flags & HAS_NORMALS)
        mesh->normal = allocate((size_t)mesh->vertex_count, sizeof *mesh->normal);
    if (flags & HAS_UV)
        mesh->uv = allocate((size_t)mesh->vertex_count, sizeof *mesh->uv);
}

/* One array of the file after the other, colours among them, which nobody looks at. */
static void read_arrays(Unpacked *from, Mesh *mesh, int flags, int bytes)
{
    from->part = "vertices";
    for (int v = 0; v < mesh->vertex_count; v++)
        for (int i = 0; i < 3; i++)
            mesh->vertex[v][i] = checked_coordinate(from->source, v, next_float(from, bytes));
    from->part = "normals";
    for (int v = 0; mesh->normal && v < mesh->vertex_count; v++) {
        for (int i = 0; i < 3; i++)
            mesh->normal[v][i] = next_float(from, bytes);
        normalise(mesh->normal[v]);
    }
    from->part = "texture coordinates";
    for (int v = 0; mesh->uv && v < mesh->vertex_count; v++)
        for (int i = 0; i < 2; i++)
            mesh->uv[v][i] = (float)next_float(from, bytes);
    from->part = "colours";
    for (int v = 0; (flags & HAS_COLOURS) && v < mesh->vertex_count; v++)
        for (int i = 0; i < 3; i++)
            next_bits(from, bytes);
    from->part = "triangles";
    for (int t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            mesh->triangle[t][k] = checked_corner(from->source, t, (double)next_bits(from, 4), mesh->vertex_count);
}

void serialized_read(Source *source, int index, Mesh *mesh)
{
    int version = find_mesh(source, index);
    Unpacked *from = allocate(1, sizeof *from);
    *from = (Unpacked){.source = source, .part = "first numbers"};
    from->zlib = (z_stream){.next_in = (unsigned char *)(uintptr_t)source->at, .zalloc = zlib_allocate, .zfree = zlib_free};
    if (inflateInit(&from->zlib) != Z_OK)
        die("zlib does not start: %s", from->zlib.msg ? from->zlib.msg : "");
    int flags = (int)next_bits(from, 4), bytes = flags & IS_DOUBLE ? 8 : 4;
    while (version > 3 && next_bits(from, 1)) /* its name */
        ;
    from->part = "vertices";
    mesh->vertex_count = next_count(from);
    from->part = "triangles";
    mesh->triangle_count = next_count(from);
    make_room(from, mesh, flags, bytes);
    read_arrays(from, mesh, flags, bytes);
    if (flags & FACE_NORMALS)
        warn("%s: the mesh says that it has face normals, which Mitsuba 3 does not heed: set face_normals", source->file);
    inflateEnd(&from->zlib);
    free(from);
}
