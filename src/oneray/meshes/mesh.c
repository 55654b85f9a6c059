#include "meshes/mesh.h"

#include <ctype.h>
#include <float.h>
#include <stdlib.h>
#include <string.h>

void skip_mark(Source *source)
{
    if (!strncmp(source->at, "\xef\xbb\xbf", 3))
        source->at += 3;
    else if (!strncmp(source->at, "\xff\xfe", 2) || !strncmp(source->at, "\xfe\xff", 2))
        fail(source, "the file is UTF-16: UTF-8 is wanted");
}

size_t word_length(const Source *source)
{
    size_t length = strcspn(source->at, " \t\r\n");
    return length - (length && source->at[length - 1] == '\\' && strchr("\r\n", source->at[length]));
}

int printable(const char *word, size_t length)
{
    int count = 0;
    while ((size_t)count < length && count < 40 && isprint((unsigned char)word[count]))
        count++;
    return count;
}

bool find_text_number(Source *source, double *value)
{
    size_t length = word_length(source);
    if (!length || !is_number(source->at, length, value) || !(fabs(*value) <= (double)FLT_MAX))
        return false;
    source->at += length;
    return true;
}

double read_text_number(Source *source, const char *of)
{
    double value;
    if (find_text_number(source, &value))
        return value;
    size_t length = word_length(source);
    if (!length)
        fail(source, "the %s is missing: a number is wanted", of);
    fail(source, "\"%.*s\" is no %s: a number up to %g is wanted", printable(source->at, length), source->at,
        of, (double)FLT_MAX);
}

uint64_t binary_bits(const char *at, size_t bytes, bool big)
{
    uint64_t bits = 0;
    for (size_t i = 0; i < bytes; i++)
        bits = bits << 8 | (unsigned char)at[big ? i : bytes - 1 - i];
    return bits;
}

double binary_float(uint64_t bits, size_t bytes)
{
    union { uint32_t bits; float number; } single = {(uint32_t)bits};
    union { uint64_t bits; double number; } real = {bits};
    return bytes == 4 ? (double)single.number : real.number;
}

double checked_coordinate(const Source *source, int vertex, double value)
{
    if (!(fabs(value) <= (double)FLT_MAX))
        fail(source, "vertex %d has the coordinate %g: a number up to %g is wanted", vertex, value, (double)FLT_MAX);
    return value;
}

int32_t checked_corner(const Source *source, int face, double vertex, int vertex_count)
{
    if (!(vertex >= 0 && vertex < vertex_count))
        fail(source, "face %d has the vertex %.9g, but there are only 0 to %d", face, vertex, vertex_count - 1);
    return (int32_t)vertex;
}

/* Normals go by the inverse transpose, whose columns are the cross products of the matrix's. */
static void to_the_world(Mesh *mesh, const Affine *to_world)
{
    double columns[3][3], cofactors[3][3];
    for (int j = 0; j < 3; j++)
        column(to_world, j, columns[j]);
    for (int j = 0; j < 3; j++)
        cross(columns[(j + 1) % 3], columns[(j + 2) % 3], cofactors[j]);
    double sign = dot(columns[0], cofactors[0]) < 0 ? -1 : 1;
    for (int v = 0; v < mesh->vertex_count; v++) {
        double p[3], n[3] = {0};
        memcpy(p, mesh->vertex[v], sizeof p);
        for (int i = 0; i < 3; i++)
            mesh->vertex[v][i] = dot(to_world->m[i], p) + to_world->m[i][3];
        if (!mesh->normal)
            continue;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                n[i] += sign * cofactors[j][i] * mesh->normal[v][j];
        normalise(n);
        memcpy(mesh->normal[v], n, sizeof n);
    }
}

/* What is left of a sum of unit normals that cancel is rounding. */
#define CANCELLED 1e-9

/* A vertex's normal is the mean of its triangles', each by its angle there. Thürmer & Wüthrich, Computing
   Vertex Normals from Polygonal Facets, JGT 3(1), 1998. Where they cancel there is none, and a triangle's own holds.
   The angle is rounded to a float, in which libm's are the same on every host. */
static void compute_normals(Mesh *mesh, const char *file)
{
    int cancelled = 0;
    mesh->normal = allocate((size_t)mesh->vertex_count, sizeof *mesh->normal);
    bool *used = allocate((size_t)mesh->vertex_count, sizeof *used);
    for (int t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            double a[3], b[3], across[3];
            triangle_edges(mesh, t, k, a, b, across);
            double size = length(across), angle = (float)atan2(size, dot(a, b));
            for (int i = 0; i < 3; i++)
                mesh->normal[mesh->triangle[t][k]][i] += angle * (across[i] / size);
            used[mesh->triangle[t][k]] = true;
        }
    for (int v = 0; v < mesh->vertex_count; v++) {
        bool none = used[v] && length(mesh->normal[v]) < CANCELLED;
        cancelled += none;
        if (none)
            memset(mesh->normal[v], 0, sizeof mesh->normal[v]);
        normalise(mesh->normal[v]);
    }
    free(used);
    if (cancelled)
        warn("%s: at %d of %d vertices the faces look both ways, so that their normals cancel: set face_normals, or "
             "give each side vertices of its own",
            file, cancelled, mesh->vertex_count);
}

/* How many are left. */
static int leave_out_flat(Mesh *mesh, const char *file)
{
    int kept = 0, count = mesh->triangle_count;
    for (int t = 0; t < count; t++) {
        double a[3], b[3], across[3];
        triangle_edges(mesh, t, 0, a, b, across);
        if (across[0] != 0 || across[1] != 0 || across[2] != 0)
            memmove(mesh->triangle[kept++], mesh->triangle[t], sizeof *mesh->triangle);
    }
    if (kept && kept < count)
        warn("%s: %d of %d triangles have no area and are left out", file, count - kept, count);
    return mesh->triangle_count = kept;
}

static void check_normals(const Mesh *mesh, const char *file)
{
    for (int t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            int v = mesh->triangle[t][k];
            if (!(length(mesh->normal[v]) <= DBL_MAX))
                die_at(file, 1,
                    "vertex %d has a normal that is no number: mend it, or let the shape have face_normals",
                    v);
        }
}

static void reverse(Mesh *mesh, int t)
{
    int32_t *corner = mesh->triangle[t], second = corner[1];
    corner[1] = corner[2];
    corner[2] = second;
    if (!mesh->turned)
        mesh->turned = allocate((size_t)mesh->triangle_count, sizeof *mesh->turned);
    mesh->turned[t] ^= 1;
}

/* Where a triangle's vertex normals point to its other side, as after a mirroring, they decide. Mitsuba's
   area lights shine to the side of the interpolated normal and are sampled by its cosine, which is not the area
   seen; here they shine along the triangle's own normal, to the same side: what is seen, sampled and weighed
   is one light. */
static void turn_to_normals(Mesh *mesh)
{
    for (int t = 0; t < mesh->triangle_count; t++) {
        double a[3], b[3], across[3], along = 0;
        triangle_edges(mesh, t, 0, a, b, across);
        for (int k = 0; k < 3; k++)
            along += dot(across, mesh->normal[mesh->triangle[t][k]]);
        if (along < 0)
            reverse(mesh, t);
    }
}

bool mesh_finish(Mesh *mesh, const char *file, const Affine *to_world, bool flip_normals, bool face_normals)
{
    if (face_normals) {
        free(mesh->normal);
        mesh->normal = NULL;
    }
    to_the_world(mesh, to_world);
    if (!leave_out_flat(mesh, file))
        return false;
    if (mesh->normal)
        check_normals(mesh, file);
    else if (!face_normals)
        compute_normals(mesh, file);
    for (int t = 0; flip_normals && t < mesh->triangle_count; t++)
        reverse(mesh, t);
    for (int v = 0; flip_normals && mesh->normal && v < mesh->vertex_count; v++)
        for (int i = 0; i < 3; i++)
            mesh->normal[v][i] = -mesh->normal[v][i];
    if (mesh->normal)
        turn_to_normals(mesh);
    return true;
}

/* Puts `more` rows behind the first `count`, and one beyond, which kernels read along with the last. Rows that either
   lacks are of this byte. */
static void *join(void *rows, int count, const void *behind, int more, size_t size, int byte)
{
    if (!rows && !behind)
        return NULL;
    char *joined = reallocate(rows, (size_t)count + (size_t)more + 1, size), *end = joined + (size_t)count * size;
    memset(rows ? end : joined, byte, ((size_t)(rows ? 0 : count) + (size_t)more + 1) * size);
    if (behind)
        memcpy(end, behind, (size_t)more * size);
    return joined;
}

void mesh_append(Mesh *all, Mesh *mesh)
{
    int v = all->vertex_count, t = all->triangle_count, vertices = mesh->vertex_count, triangles = mesh->triangle_count;
    all->vertex = join(all->vertex, v, mesh->vertex, vertices, sizeof *all->vertex, 0);
    all->normal = join(all->normal, v, mesh->normal, vertices, sizeof *all->normal, 0);
    all->uv = join(all->uv, v, mesh->uv, vertices, sizeof *all->uv, 0xff); /* nan */
    all->triangle = join(all->triangle, t, mesh->triangle, triangles, sizeof *all->triangle, 0);
    all->turned = join(all->turned, t, mesh->turned, triangles, sizeof *all->turned, 0);
    for (int i = 0; i < mesh->triangle_count; i++)
        for (int k = 0; k < 3; k++)
            all->triangle[t + i][k] += v;
    all->vertex_count += mesh->vertex_count;
    all->triangle_count += mesh->triangle_count;
    mesh_free(mesh);
}

void mesh_free(Mesh *mesh)
{
    free(mesh->vertex);
    free(mesh->normal);
    free(mesh->uv);
    free(mesh->triangle);
    free(mesh->turned);
    *mesh = (Mesh){0};
}
