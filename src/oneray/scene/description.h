/* A scene as its file says it: plain doubles, no lanes. scene_xml.c fills a Description, prepare.h
   prepares it for the lanes of a kernel. Every default is Mitsuba 3's. Lengths are in the scene's own unit. */
#ifndef ONERAY_SCENE_DESCRIPTION_H
#define ONERAY_SCENE_DESCRIPTION_H

#include <stdbool.h>
#include <stdint.h>

/* The first three rows of an affine matrix: a point p goes to m[i][0..2]·p + m[i][3]. */
typedef struct {
    double m[3][4];
} Affine;

enum { MATERIAL_NONE = -1 }; /* black: what a one-sided material is from behind */

typedef enum {
    MATERIAL_DIFFUSE,
    MATERIAL_CONDUCTOR,
    MATERIAL_DIELECTRIC,
    MATERIAL_BLEND
} MaterialKind;

typedef struct {
    MaterialKind kind;
    double reflectance[3]; /* albedo of a diffuse, else specular_reflectance */
    bool fresnel;          /* conductor: false for Mitsuba's material "none", a perfect mirror */
    double eta[3], k[3];   /* conductor: complex index of refraction eta + i k, by channel */
    double transmittance[3]; /* dielectric: specular_transmittance */
    double ior;              /* dielectric: index inside over index outside; the normal points outside */
    double weight;           /* blend: of the second material */
    int first, second;       /* blend: index into materials, or MATERIAL_NONE */
    int line;
} Material;

typedef enum { SHAPE_SPHERE, SHAPE_RECTANGLE, SHAPE_DISK, SHAPE_CUBE, SHAPE_MESH, SHAPE_KINDS } ShapeKind;

/* Triangles; for a smooth one, unit normals by vertex, else zeros, or NULL if no mesh of the scene has any. */
typedef struct {
    double (*vertex)[3], (*normal)[3];
    int32_t (*triangle)[3]; /* counter-clockwise as seen from the side of the normal */
    int vertex_count, triangle_count;
} Mesh;

typedef struct {
    ShapeKind kind;
    Affine to_world; /* of the unit shape: sphere x²+y²+z² = 1; rectangle [-1,1]² and
                        disk x²+y² ≤ 1 at z = 0 with normal +z; cube [-1,1]³. A sphere's
                        center and radius are folded in: it is a uniform scale. */
    bool flip_normals;
    int first_triangle, triangle_count; /* mesh: which of the description's; to_world and flip_normals
                                           are done with */
    bool smooth;                        /* mesh: it has vertex normals */
    int front, back; /* index into materials, or MATERIAL_NONE, by side of the normal */
    int emitter;     /* index into emitters, or -1 */
    int line;
} Shape;

typedef enum {
    EMITTER_AREA,
    EMITTER_POINT,
    EMITTER_SPOT,
    EMITTER_DIRECTIONAL,
    EMITTER_CONSTANT,
    EMITTER_KINDS
} EmitterKind;

typedef struct {
    EmitterKind kind;
    double emission[3];              /* area, constant: radiance, W·sr⁻¹·m⁻²; point, spot: intensity,
                                        W·sr⁻¹; directional: irradiance on a plane across it, W·m⁻² */
    int shape;                       /* area: index into shapes */
    double position[3];              /* point, spot */
    double direction[3];             /* directional, spot: unit vector along which the light travels */
    double cutoff_angle, beam_width; /* spot: radians; full intensity within beam_width, none beyond */
    int line;
} Emitter;

static inline bool emitter_has_power(const Emitter *light)
{
    return light->emission[0] > 0 || light->emission[1] > 0 || light->emission[2] > 0;
}

typedef struct {
    Affine to_world;               /* camera space to world: looks along +z, +x is to the LEFT, +y up */
    double tan_half_x, tan_half_y; /* half extents of the image at distance 1 */
    double near_clip, far_clip;
    int width, height;
} Sensor;

typedef struct {
    Sensor sensor;
    int sample_count;        /* samples per pixel that the file asks for */
    int max_depth, rr_depth; /* as Mitsuba's path: -1 no limit, 1 emission only, 2 direct light */
    bool hide_emitters;
    Material *materials;
    int material_count;
    Shape *shapes;
    int shape_count;
    Mesh mesh;         /* the triangles of all meshes, one after the other */
    char **mesh_files; /* that were read */
    int mesh_file_count;
    Emitter *emitters;
    int emitter_count;
    uint64_t hash; /* FNV-1a of the bytes of the file and of its mesh files, and the sorted -D parameters */
} Description;

/* One -Dname=value of the command line. */
typedef struct {
    const char *name, *value;
    bool used;
} Parameter;

/* Reads FILE or ends the program with one line "FILE:LINE: …" on standard error and exit status 2. `size` is
   what the image's width and height shall be instead of the file's; 0 or NULL: the file's, or as the other one
   demands. */
Description *description_read(
    const char *file, Parameter *parameters, int parameter_count, const uint64_t size[2]);
void description_free(Description *description);

#endif
