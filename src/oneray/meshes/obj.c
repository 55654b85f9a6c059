/* OBJ files (Wavefront, Advanced Visualizer, appendix B1): v, vt, vn and f; every other statement is left out, with a
   warning if it might show something. */
#include "meshes/mesh.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

/* A corner of a face: its position, texture coordinate and normal, counted from 1, 0 for none. Equal corners
   are one vertex, as in Mitsuba: a seam of the texture divides computed normals. */
typedef struct {
    int key[3];
} Corner;

typedef struct {
    double (*points)[3], (*normals)[3];
    float (*textures)[2];
    bool is_textured; /* a corner has a texture coordinate */
    int point_count, normal_count, texture_count;
    Corner *corners; /* by vertex */
    int corner_count;
    int *vertices; /* a hash table of them, by their corners, with as many places free at least: 1 more, 0 for free */
    size_t places; /* a power of two */
    bool has_warned;
} Obj;

/* Lines end as on any system: \n, \r\n or \r. */
static void next_line(Source *source)
{
    source->at += source->at[0] == '\r' && source->at[1] == '\n';
    source->at += source->at < source->end;
    source->line++;
}

/* Also over the end of a line behind a backslash, which goes on in the next. */
static void skip_spaces(Source *source)
{
    for (;; next_line(source)) {
        source->at += strspn(source->at, " \t");
        if (*source->at != '\\' || !strchr("\r\n", source->at[1])) /* or of the file, a 0 */
            return;
        source->at++;
    }
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

/* Does one of a corner's numbers stand here? */
static bool is_index(const char *at) { return isdigit((unsigned char)at[*at == '-']); }

/* It; negative ones count back from the last. */
static int read_index(Source *source, const char *of, int count)
{
    if (!is_index(source->at))
        fail(source, "a corner of the face is no v, v/vt, v//vn or v/vt/vn");
    char *end;
    long value = strtol(source->at, &end, 10);
    source->at = end;
    long index = value < 0 ? count + 1 + value : value;
    if (index < 1 || index > count)
        fail(source, "the face refers to %s %ld, but there are %d so far", of, value, count);
    return (int)index;
}

/* What a slash announces may be left out: 1, 1/, 1// are the same. */
static Corner read_corner(Source *source, const Obj *obj)
{
    static const char *const of[3] = {"vertex", "texture coordinate", "normal"};
    const int counts[3] = {obj->point_count, obj->texture_count, obj->normal_count};
    Corner corner = {{read_index(source, of[0], counts[0]), 0, 0}};
    for (int k = 1; k < 3 && *source->at == '/'; k++) {
        source->at++;
        if (is_index(source->at))
            corner.key[k] = read_index(source, of[k], counts[k]);
    }
    if (*source->at && !strchr(" \t\r\n\\", *source->at))
        fail(source, "a corner of the face is no v, v/vt, v//vn or v/vt/vn");
    return corner;
}

/* The place of a corner among the vertices: where it is, or a free one. */
static int *place_of(const Obj *obj, const Corner *corner)
{
    uint64_t hash = 0;
    for (int k = 0; k < 3; k++)
        hash = (hash ^ (uint64_t)corner->key[k]) * 0x9e3779b97f4a7c15u;
    for (size_t place = (size_t)(hash >> 32);; place++) {
        int *at = &obj->vertices[place & (obj->places - 1)];
        if (!*at || !memcmp(&obj->corners[*at - 1], corner, sizeof *corner))
            return at;
    }
}

/* The vertex of a corner, a new one if there is none like it. */
static int vertex_of(Obj *obj, Corner corner)
{
    if (2 * (size_t)obj->corner_count >= obj->places) {
        free(obj->vertices);
        obj->places = obj->places ? 2 * obj->places : 64;
        obj->vertices = allocate(obj->places, sizeof *obj->vertices);
        for (int v = 0; v < obj->corner_count; v++)
            *place_of(obj, &obj->corners[v]) = v + 1;
    }
    int *at = place_of(obj, &corner);
    if (!*at) {
        PUSH(obj->corners, obj->corner_count, corner);
        *at = obj->corner_count;
        obj->is_textured |= corner.key[1] > 0;
    }
    return *at - 1;
}

/* A polygon is a fan of triangles around its first corner. */
static void read_face(Source *source, Obj *obj, Mesh *mesh)
{
    int32_t fan[3] = {0};
    int corners = 0;
    for (skip_spaces(source); *source->at && !strchr("\r\n#", *source->at); skip_spaces(source)) {
        if (corners >= 3)
            fan[1] = fan[2];
        fan[corners < 3 ? corners : 2] = vertex_of(obj, read_corner(source, obj));
        if (++corners < 3)
            continue;
        mesh->triangle = room_for(mesh->triangle, mesh->triangle_count, sizeof *mesh->triangle);
        memcpy(mesh->triangle[mesh->triangle_count++], fan, sizeof fan);
    }
    if (corners < 3)
        fail(source, "the face has %d corners: three or more are wanted", corners);
}

/* Says once that a statement which might show something is left out: a misspelt one, a surface, whatever it is. */
static void warn_unread(const Source *source, Obj *obj, const char *word, size_t length)
{
    static const char shows_nothing[] =
        "usemtl, g, s, o, mtllib, l, p, vp, mg, usemap, maplib, bevel, lod, c_interp, "
        "d_interp, shadow_obj, trace_obj";
    char name[sizeof "shadow_obj"] = "";
    memcpy(name, word, length < sizeof name ? length : sizeof name - 1);
    obj->has_warned = find_word(shows_nothing, name) < 0;
    if (obj->has_warned)
        warn("%s:%d: \"%.*s\" is not read (v, vt, vn and f are): such lines are left out", source->file,
            source->line, printable(word, length), word);
}

static void read_statement(Source *source, Obj *obj, Mesh *mesh)
{
    size_t length = word_length(source);
    const char *word = source->at;
    source->at += length;
    if (length == 1 && *word == 'v') {
        obj->points = room_for(obj->points, obj->point_count, sizeof *obj->points);
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
    } else if (length && *word != '#' && !obj->has_warned) {
        warn_unread(source, obj, word, length);
    }
    if (obj->point_count > MESH_MOST || mesh->triangle_count > MESH_MOST)
        fail(source, "more than %d vertices or triangles", MESH_MOST);
}

void obj_read(Source *source, Mesh *mesh)
{
    Obj obj = {0};
    int with_normal = 0;
    for (skip_mark(source); source->at < source->end; next_line(source)) {
        skip_spaces(source);
        read_statement(source, &obj, mesh);
        source->at += strcspn(source->at, "\r\n");
    }
    for (int v = 0; v < obj.corner_count; v++)
        with_normal += obj.corners[v].key[2] > 0;
    if (with_normal && with_normal < obj.corner_count)
        fail(source, "%d of %d vertices have no normal: all or none must have one",
            obj.corner_count - with_normal, obj.corner_count);
    free(obj.vertices); /* before the mesh takes its room */
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
}
