/* OBJ files (Wavefront): v, vt, vn and f; every other statement is ignored. */
#include "meshes/mesh.h"

#include <stdlib.h>
#include <string.h>

/* A corner of a face: its position, texture coordinate and normal, counted from 1, 0 for none. Equal corners
   are one vertex, as in Mitsuba: a seam of the texture divides computed normals. */
typedef struct {
    int key[3];
    int next; /* another vertex at the same position, or -1 */
} Corner;

typedef struct {
    double (*points)[3], (*normals)[3];
    float (*textures)[2];
    bool is_textured; /* a corner has a texture coordinate */
    int point_count, normal_count, texture_count;
    Corner *corners; /* by vertex */
    int *first;      /* by point: a vertex there, or -1 */
    int corner_count;
} Obj;

static void skip_spaces(Source *source)
{
    source->at += strspn(source->at, " \t\r");
}

static void read_triple(Source *source, const char *of, double triple[3])
{
    for (int i = 0; i < 3; i++) {
        skip_spaces(source);
        triple[i] = read_text_number(source, of);
    }
}

/* Two numbers, or nan where there is none: an error to who wants them, and only then. */
static void read_texture(Source *source, float uv[2])
{
    for (int i = 0; i < 2; i++) {
        double value;
        skip_spaces(source);
        uv[i] = find_text_number(source, &value) ? (float)value : NAN;
    }
}

/* One of a corner's three numbers; negative ones count back from the last. */
static int read_index(Source *source, const char *of, int count)
{
    char *end;
    long value = strtol(source->at, &end, 10);
    if (end == source->at || *source->at == '+' || *source->at == ' ')
        fail(source, "a corner of the face is no v, v/vt, v//vn or v/vt/vn");
    source->at = end;
    long index = value < 0 ? count + 1 + value : value;
    if (index < 1 || index > count)
        fail(source, "the face refers to %s %ld, but there are %d so far", of, value, count);
    return (int)index;
}

static void read_corner(Source *source, const Obj *obj, int key[3])
{
    key[0] = read_index(source, "vertex", obj->point_count);
    key[1] = key[2] = 0;
    if (*source->at == '/' && *++source->at != '/')
        key[1] = read_index(source, "texture coordinate", obj->texture_count);
    if (*source->at == '/') {
        source->at++;
        key[2] = read_index(source, "normal", obj->normal_count);
    }
}

/* The vertex of a corner, a new one if there is none like it. */
static int vertex_of(Obj *obj, const int key[3])
{
    int *link = &obj->first[key[0] - 1];
    for (; *link >= 0; link = &obj->corners[*link].next)
        if (!memcmp(obj->corners[*link].key, key, sizeof obj->corners->key))
            return *link;
    int vertex = *link = obj->corner_count;
    PUSH(obj->corners, obj->corner_count, ((Corner){{key[0], key[1], key[2]}, -1}));
    obj->is_textured |= key[1] > 0;
    return vertex;
}

/* A polygon is a fan of triangles around its first corner. */
static void read_face(Source *source, Obj *obj, Mesh *mesh)
{
    int32_t fan[3] = {0};
    int corners = 0;
    for (skip_spaces(source); *source->at && *source->at != '\n' && *source->at != '#'; skip_spaces(source)) {
        int key[3];
        read_corner(source, obj, key);
        if (*source->at && !strchr(" \t\r\n", *source->at))
            fail(source, "a corner of the face is no v, v/vt, v//vn or v/vt/vn");
        if (corners >= 3)
            fan[1] = fan[2];
        fan[corners < 3 ? corners : 2] = vertex_of(obj, key);
        if (++corners < 3)
            continue;
        mesh->triangle = room_for(mesh->triangle, mesh->triangle_count, sizeof *mesh->triangle);
        memcpy(mesh->triangle[mesh->triangle_count++], fan, sizeof fan);
    }
    if (corners < 3)
        fail(source, "the face has %d corners: three or more are wanted", corners);
}

static void read_statement(Source *source, Obj *obj, Mesh *mesh)
{
    size_t length = strcspn(source->at, " \t\r\n");
    const char *word = source->at;
    source->at += length;
    if (length == 1 && *word == 'v') {
        obj->first = room_for(obj->first, obj->point_count, sizeof *obj->first);
        obj->points = room_for(obj->points, obj->point_count, sizeof *obj->points);
        obj->first[obj->point_count] = -1;
        read_triple(source, "coordinate", obj->points[obj->point_count++]);
    } else if (length == 2 && !strncmp(word, "vn", 2)) {
        obj->normals = room_for(obj->normals, obj->normal_count, sizeof *obj->normals);
        double *normal = obj->normals[obj->normal_count++];
        read_triple(source, "normal's coordinate", normal);
        normalise(normal);
        if (normal[0] == 0 && normal[1] == 0 && normal[2] == 0)
            fail(source, "a normal must not be 0");
    } else if (length == 2 && !strncmp(word, "vt", 2)) {
        obj->textures = room_for(obj->textures, obj->texture_count, sizeof *obj->textures);
        read_texture(source, obj->textures[obj->texture_count++]);
    } else if (length == 1 && *word == 'f') {
        read_face(source, obj, mesh);
    }
    if (obj->point_count > MESH_MOST || mesh->triangle_count > MESH_MOST)
        fail(source, "more than %d vertices or triangles", MESH_MOST);
}

void obj_read(Source *source, Mesh *mesh)
{
    Obj obj = {0};
    int with_normal = 0;
    for (; source->at < source->end; source->line++) {
        skip_spaces(source);
        read_statement(source, &obj, mesh);
        source->at += strcspn(source->at, "\n");
        source->at += source->at < source->end;
    }
    for (int v = 0; v < obj.corner_count; v++)
        with_normal += obj.corners[v].key[2] > 0;
    if (with_normal && with_normal < obj.corner_count)
        fail(source, "%d of %d vertices have no normal: all or none must have one",
            obj.corner_count - with_normal, obj.corner_count);
    mesh->vertex_count = obj.corner_count;
    mesh->vertex = allocate((size_t)obj.corner_count, sizeof *mesh->vertex);
    if (with_normal)
        mesh->normal = allocate((size_t)obj.corner_count, sizeof *mesh->normal);
    if (obj.is_textured)
        mesh->uv = allocate((size_t)obj.corner_count, sizeof *mesh->uv);
    for (int v = 0; v < obj.corner_count; v++) {
        const int *key = obj.corners[v].key;
        memcpy(mesh->vertex[v], obj.points[key[0] - 1], sizeof *mesh->vertex);
        if (with_normal)
            memcpy(mesh->normal[v], obj.normals[key[2] - 1], sizeof *mesh->normal);
        for (int i = 0; mesh->uv && i < 2; i++)
            mesh->uv[v][i] = key[1] ? obj.textures[key[1] - 1][i] : NAN;
    }
    free(obj.points);
    free(obj.textures);
    free(obj.normals);
    free(obj.corners);
    free(obj.first);
}
