/* Triangle meshes as a scene has them: the readers of PLY and OBJ files, and what becomes of a mesh before it
   is rendered. */
#ifndef ONERAY_MESHES_MESH_H
#define ONERAY_MESHES_MESH_H

#include "scene/description.h"

#include <stddef.h>

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

/* Where the reader is, for a message. */
#define fail_in(source, ...) die_at((source)->file, (source)->line, __VA_ARGS__)

/* A number of plain text, which ends at a blank; what is it of? Neither nan, inf nor hexadecimal. */
double read_text_number(Source *source, const char *of);

/* Vectors of length 0 stay. */
void normalise(double a[3]);

/* To the world, turned over by flip_normals, with Mitsuba's vertex normals unless face_normals; triangles
   without area are left out with a warning. */
void mesh_finish(Mesh *mesh, const char *file, const Affine *to_world, bool flip_normals, bool face_normals);

/* Puts the mesh behind those that are there, and empties it. */
void mesh_append(Mesh *all, Mesh *mesh);
void mesh_free(Mesh *mesh);

#endif
