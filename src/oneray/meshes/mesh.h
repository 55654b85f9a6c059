/* Triangle meshes as a scene has them: the readers of PLY, OBJ and serialized files, and what becomes of a mesh before it
   is rendered. */
#pragma once

#include "text.h"
#include "vectors.h"

#include <stdint.h>

/* Triangles; for a smooth one, unit normals by vertex, else zeros, or NULL if no mesh of the scene has any. */
typedef struct Mesh {
    double (*vertex)[3], (*normal)[3];
    float (*uv)[2];         /* texture coordinates by vertex, nan where there are none, or NULL as for the normals */
    int32_t (*triangle)[3]; /* counter-clockwise as seen from the side of the normal */
    int32_t *turned;        /* by triangle: its last two corners have changed places since the file; NULL: none has */
    int vertex_count, triangle_count;
} Mesh;

/* A file in memory, with a 0 after its last byte, and how far it is read. */
typedef struct {
    const char *file, *at, *end;
    int line;
} Source;

enum { MESH_MOST = 1 << 28 }; /* vertices, or triangles, of a scene: thrice that is still an int32 */

/* Fill an empty mesh with what the file says, or end the program with "FILE:LINE: …". Normals are of unit
   length; a file without any leaves mesh->normal NULL. */
void ply_read(Source *source, Mesh *mesh);
void obj_read(Source *source, Mesh *mesh);
void serialized_read(Source *source, int index, Mesh *mesh); /* the mesh of this index among the file's */

/* Over the byte order mark that editors put in front of UTF-8; UTF-16 is an error. */
void skip_mark(Source *source);

/* Of a word of plain text, up to a blank, or to a backslash at the end of its line; and how much of it a message shows. */
size_t word_length(const Source *source);
int printable(const char *word, size_t length);

/* A number of plain text, which ends at a blank: neither nan, inf nor hexadecimal. Else false, and nothing is read. */
bool find_text_number(Source *source, double *value);

/* The same, or the end: what is it of? */
double read_text_number(Source *source, const char *of);

/* Bytes, the most significant first or last, as bits, whatever the order of this machine; and 4 or 8 bytes of those as
   the floating-point number that they are. */
uint64_t binary_bits(const char *at, size_t bytes, bool big);
double binary_float(uint64_t bits, size_t bytes);

/* What a file says of a vertex and of a face's corner, if a mesh may have it. */
double checked_coordinate(const Source *source, int vertex, double value);
int32_t checked_corner(const Source *source, int face, double vertex, int vertex_count);

/* The edges from corner k of a triangle to the next two, and their cross product; from corner 0, along the normal. */
static inline void triangle_edges(const Mesh *mesh, int triangle, int k, double a[3], double b[3], double across[3])
{
    const int32_t *corner = mesh->triangle[triangle];
    difference(mesh->vertex[corner[(k + 1) % 3]], mesh->vertex[corner[k]], a);
    difference(mesh->vertex[corner[(k + 2) % 3]], mesh->vertex[corner[k]], b);
    cross(a, b, across);
}

/* To the world, turned over by flip_normals, with Mitsuba's vertex normals unless face_normals; triangles
   without area are left out with a warning. Are there none with one? Then there is nothing left of the mesh. */
bool mesh_finish(Mesh *mesh, const char *file, const Affine *to_world, bool flip_normals, bool face_normals);

/* Puts the mesh behind those that are there, and empties it. */
void mesh_append(Mesh *all, Mesh *mesh);
void mesh_free(Mesh *mesh);
