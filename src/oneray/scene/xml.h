/* A scene file as a tree of elements, each with its line (xml.c), the reading of their properties by a table of fields
   (values.c), and from there to a Description (build.c). */
#pragma once

#include "fields.h"
#include "scene/description.h"
#include "text.h"

typedef struct Node Node;
struct Node {
    const char *file;
    int line;
    char *tag, **attributes;                      /* name, value, name, value, …, NULL */
    Node *parent, *first, *last, *next;           /* the first and last child, the next sibling */
    const struct SceneFile *scene;
    bool wrong;                                   /* itself, and it was said */
    bool upgraded;                                /* a transform that properties of version 0 became */
    enum { UNREAD, BEING_READ, READ, WRONG } state; /* of a bsdf or texture, which many may refer to */
    int front, back;                              /* once it is read: its materials by side; the texture's number */
};

/* An element's name, and that of the scene file's <alias>es, which stand for what `id` names. */
typedef struct {
    const char *name;
    Node *node;
} Id;

typedef struct SceneFile {
    Node *root;
    Id *ids;                                      /* sorted by name */
    int id_count;
    char **folders;                               /* where files that it names may be, the last one first; "" or with a / */
    int folder_count;
    char **included;                              /* names of files, which who reads the scene frees */
    int included_count;
    uint64_t hash;                                /* of all that was read */
} SceneFile;

/* Where a file of this name is. */
char *find_file(const SceneFile *scene, const char *name);

/* The whole file as one block with a 0 behind it. Errors concern the place that names the file, or no line. */
char *read_file(const char *file, size_t most_mib, const Place *named_by, size_t *size);
uint64_t hash_bytes(uint64_t hash, const char *bytes, size_t size);

SceneFile *scene_file_open(const char *file, const Parameter *given, int count);
void scene_file_close(SceneFile *scene);
Node *find_id(const SceneFile *scene, const char *id);        /* or NULL; never an <alias> */
const char *attribute(const Node *node, const char *name);    /* or NULL */
const char *describe(const Node *node);                       /* for a message: <bsdf type="diffuse"> */

#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

/* Is it one of the elements of a list, "<bsdf>, <ref>"? */
bool is_among(const Node *node, const char *elements);

/* Does the child, among elements that hold others, stand for a share of the fields: a <texture>, or a <ref> to one? */
bool is_share(const Node *child, const Field *fields);

/* Fills `to` by the table with the element's properties, and `said` with where they are. A child that is neither a
   property of the table nor one of the objects, "<bsdf>, <ref>", is an error. */
void read_fields(const Node *node, const Field *fields, const char *objects, void *to, Said *said);
