/* A scene as its file says it: plain doubles, no lanes. scene/build.c reads it, prepare/ makes a kernel's tables of it.
   Every default is Mitsuba 3's. Lengths are in the scene's own unit. */
#pragma once

#include "filters/filter.h"
#include "images/image.h"
#include "materials/bump.h"
#include "kinds.h"
#include "kinds/emitters.h"
#include "kinds/materials.h"
#include "kinds/media.h"
#include "kinds/sensors.h"
#include "kinds/shapes.h"
#include "kinds/textures.h"
#include "media/phase.h"
#include "meshes/mesh.h"
#include "trees/mesh_tree.h"

enum { MEDIUM_GOES_ON = -1 }; /* what is before a surface is behind it, too */
enum { MATERIAL_NONE = -1 }; /* black: what a one-sided material is from behind */

#define X(NAME, name, words) struct name name;

/* L16 Of a blend's parts no more than so many textures say the weights, one blend in another. */
enum { MOST_WEIGHTS = 2 };
typedef struct {
    Reflectance weight; /* of the second material */
    int first, second; /* index into materials, or MATERIAL_NONE */
} Blend;

typedef struct {
    MaterialKind kind;
    const char *file; /* with line, where it stands */
    int line;
    Bump bump; /* around it, of no blend */
    union {
        MATERIALS(X)
        Blend blend;
    } as;
} Material;

typedef struct {
    TextureKind kind;
    int line;
    union {
        TEXTURES(X)
    } as;
} Texture;

typedef struct {
    MediumKind kind;
    const char *file; /* with line, where it stands */
    int line;
    Phase phase;
    union {
        MEDIA(X)
    } as;
} Medium;

typedef struct {
    ShapeKind kind; /* never ALIGNED */
    const char *file; /* with line, where it stands */
    int line;
    int front, back; /* index into materials, or MATERIAL_NONE, by side of the normal */
    int emitter;     /* index into emitters, or -1 */
    int exterior, interior; /* a medium's number, from 1 on, by side of the normal; 0 none. Of a shape that is no boundary of
                               media both are MEDIUM_GOES_ON */
    union {
        Placed placed; /* what all begin with */
        FILE_SHAPES(X)
    } as;
} Shape;

typedef struct {
    EmitterKind kind;
    const char *file; /* with line, where it stands */
    int line;
    int shape; /* that shines: index into shapes, or -1 */
    union {
        EMITTERS(X)
    } as;
} Emitter;

typedef struct {
    SensorKind kind;
    const char *file; /* with line, where it stands */
    int line;
    Frame frame;
    Filter filter;
    union {
        SENSORS(X)
    } as;
} Sensor;
#undef X

/* Surfaces in one place, as far as rays can tell, and the order in which a ray meets them (scene/stacks.c). */
typedef struct {
    int count;       /* of stacks; 0: no two surfaces are in one place, and none of what follows is there */
    int32_t *of;     /* by side, shape after shape: its stack, -1 for none */
    int32_t *layer;  /* by side: the larger, the farther along the stack's normal; equal ones never meet a ray twice */
    int32_t (*beside)[2]; /* by side: does something of its stack overlap it, less far along that normal, and farther? */
    double (*up)[3]; /* by stack: a unit normal of it; of spheres 0, it is outwards */
} Stacks;

typedef struct {
    Sensor sensor;
    Medium *media; /* that shapes and the sensor name, from 1 on */
    int medium_count;
    int eye; /* the number of that which the sensor is in, or 0 */
    bool passing; /* light comes through boundaries that are no vertices, and through media: volpath */
    int sample_count;        /* samples per pixel that the file asks for */
    int max_depth, rr_depth; /* as Mitsuba's path: -1 no limit, 1 emission only, 2 direct light */
    bool hide_emitters, strict_normals;
    Material *materials;
    int material_count;
    Texture *textures; /* that materials name, from 1 on */
    int texture_count;
    Shape *shapes;
    int shape_count;
    Mesh mesh;         /* the triangles of all meshes, one after the other */
    MeshTree mesh_tree;
    Images images;
    char **files; /* that were read besides the scene's */
    int file_count;
    Emitter *emitters;
    int emitter_count;
    Stacks stacks;
    bool hinted;   /* it was said why the picture may be black */
    uint64_t hash; /* FNV-1a of the bytes of the file and of its mesh files, and the sorted -D parameters */
} Description;

/* A name and its value, by one -Dname=value of the command line or by a <default>. */
typedef struct {
    const char *name, *value;
    bool used, declared; /* the scene uses it; has a <default> for it */
} Parameter;

/* Reads FILE or ends the program with a line "FILE:LINE: …" on standard error for each error, and exit status 2. `sensor`
   is the id or number of the sensor to see by; NULL: the first. `size` is what the image's width and height shall be
   instead of the file's; 0 or NULL: the file's, or as the other one demands. */
Description *description_read(const char *file, const Parameter *given, int count, const char *sensor,
    const uint64_t size[2]);
void description_free(Description *description);

/* NAME_… of a kind's file answers. */
MaterialTraits material_traits(const Material *material); /* of no blend: of its parts */
TextureTraits texture_traits(const Texture *texture);
EmitterTraits emitter_traits(const Emitter *emitter);
SensorTraits sensor_traits(const Sensor *sensor);
Extent shape_extent(const Shape *shape);
Side shape_side(const Shape *shape, int k);

/* How many sides a shape has; and one of that kind with planes of its own: as many, else 0, as for a mesh. */
int shape_sides(const Shape *shape);
int shape_planes(ShapeKind kind);
/* The i-th reflectance or share that a material, no blend, may have a texture for; NULL: there are no more. */
const Reflectance *material_reflectance(const Material *material, int i);
/* Does it, or a part of it, look at the texture coordinates of its surface? */
bool material_wants_uv(const Description *d, int material);
bool emitter_has_power(const Emitter *emitter);
/* The box around all shapes; 0 without any. */
void scene_bounds(const Description *d, double low[3], double high[3]);
