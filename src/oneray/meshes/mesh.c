#include "meshes/mesh.h"

#include <ctype.h>
#include <float.h>
#include <stdlib.h>
#include <string.h>

double read_text_number(Source *source, const char *of)
{
    double value;
    size_t length = strcspn(source->at, " \t\r\n"), printable = 0;
    if (!length)
        fail(source, "the %s is missing: a number is wanted", of);
    if (!is_number(source->at, length, &value) || !(fabs(value) <= (double)FLT_MAX)) {
        while (printable < length && printable < 40 && isprint((unsigned char)source->at[printable]))
            printable++;
        fail(source, "\"%.*s\" is no %s: a number up to %g is wanted", (int)printable, source->at, of, (double)FLT_MAX);
    }
    source->at += length;
    return value;
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

/* A vertex's normal is the mean of its triangles', each by its angle there. Thürmer & Wüthrich, Computing
   Vertex Normals from Polygonal Facets, JGT 3(1), 1998. */
static void compute_normals(Mesh *mesh)
{
    mesh->normal = allocate((size_t)mesh->vertex_count, sizeof *mesh->normal);
    for (int t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            double a[3], b[3], across[3];
            triangle_edges(mesh, t, k, a, b, across);
            double angle = atan2(length(across), dot(a, b));
            normalise(across);
            for (int i = 0; i < 3; i++)
                mesh->normal[mesh->triangle[t][k]][i] += angle * across[i];
        }
    for (int v = 0; v < mesh->vertex_count; v++)
        normalise(mesh->normal[v]);
}

static void leave_out_flat(Mesh *mesh, const char *file)
{
    int kept = 0, count = mesh->triangle_count;
    for (int t = 0; t < count; t++) {
        double a[3], b[3], across[3];
        triangle_edges(mesh, t, 0, a, b, across);
        if (across[0] != 0 || across[1] != 0 || across[2] != 0)
            memmove(mesh->triangle[kept++], mesh->triangle[t], sizeof *mesh->triangle);
    }
    if (!kept)
        die_at(file, 1, "none of the %d triangles has an area", count);
    if (kept < count)
        warn("%s: %d of %d triangles have no area and are left out", file, count - kept, count);
    mesh->triangle_count = kept;
}

static void reverse(int32_t corner[3])
{
    int32_t second = corner[1];
    corner[1] = corner[2];
    corner[2] = second;
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
            reverse(mesh->triangle[t]);
    }
}

void mesh_finish(Mesh *mesh, const char *file, const Affine *to_world, bool flip_normals, bool face_normals)
{
    if (face_normals) {
        free(mesh->normal);
        mesh->normal = NULL;
    }
    to_the_world(mesh, to_world);
    leave_out_flat(mesh, file);
    if (!face_normals && !mesh->normal)
        compute_normals(mesh);
    for (int t = 0; flip_normals && t < mesh->triangle_count; t++)
        reverse(mesh->triangle[t]);
    for (int v = 0; flip_normals && mesh->normal && v < mesh->vertex_count; v++)
        for (int i = 0; i < 3; i++)
            mesh->normal[v][i] = -mesh->normal[v][i];
    if (mesh->normal)
        turn_to_normals(mesh);
}

/* Room for `more` rows behind the first `count`, zeroed, and for one beyond, which kernels read along with the
   last. */
static void *grow(void *rows, int count, int more, size_t size)
{
    char *grown = reallocate(rows, (size_t)count + (size_t)more + 1, size);
    memset(grown + (size_t)count * size, 0, ((size_t)more + 1) * size);
    return grown;
}

void mesh_append(Mesh *all, Mesh *mesh)
{
    int v = all->vertex_count, t = all->triangle_count;
    if (mesh->normal && !all->normal)
        all->normal = allocate((size_t)v, sizeof *all->normal);
    all->vertex = grow(all->vertex, v, mesh->vertex_count, sizeof *all->vertex);
    all->triangle = grow(all->triangle, t, mesh->triangle_count, sizeof *all->triangle);
    memcpy(all->vertex[v], mesh->vertex, (size_t)mesh->vertex_count * sizeof *all->vertex);
    if (all->normal)
        all->normal = grow(all->normal, v, mesh->vertex_count, sizeof *all->normal);
    if (mesh->normal)
        memcpy(all->normal[v], mesh->normal, (size_t)mesh->vertex_count * sizeof *all->normal);
    for (int i = 0; i < mesh->triangle_count; i++)
        for (int k = 0; k < 3; k++)
            all->triangle[t + i][k] = v + mesh->triangle[i][k];
    all->vertex_count += mesh->vertex_count;
    all->triangle_count += mesh->triangle_count;
    mesh_free(mesh);
}

void mesh_free(Mesh *mesh)
{
    free(mesh->vertex);
    free(mesh->normal);
    free(mesh->triangle);
    *mesh = (Mesh){0};
}
