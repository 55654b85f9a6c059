/* A scene file as a tree of elements, each with its line (scene_xml.c), the typed reading of their properties
   (scene_values.c), and from there to a Description (scene_build.c). */
#ifndef ONERAY_SCENE_XML_H
#define ONERAY_SCENE_XML_H

#include "scene/description.h"
#include "message.h"

typedef struct { char *name, *value; } Attribute;

typedef struct Node Node;
struct Node {
    const char *file;
    int line;
    char *tag;
    Attribute *attributes;
    int attribute_count;
    Node *parent, *first, *last, *next;           /* the first and last child, the next sibling */
    enum { UNREAD, BEING_READ, READ } state;      /* of a bsdf, which many shapes may refer to */
    int front, back;                              /* its materials by side, once it is read */
};

typedef struct {
    Node *root;
    Node **by_id;                                 /* the elements that have an id, sorted by it */
    int id_count;
    uint64_t hash;
} SceneFile;

/* The whole file as one block with a 0 behind it. Errors concern the element that names the file, or no line. */
char *read_file(const char *file, size_t most_mib, const Node *named_by, size_t *size);
uint64_t hash_bytes(uint64_t hash, const char *bytes, size_t size);

SceneFile *scene_file_open(const char *file, Parameter *parameters, int parameter_count);
void scene_file_close(SceneFile *scene);
Node *find_id(const SceneFile *scene, const char *id);        /* or NULL */
const char *attribute(const Node *node, const char *name);    /* or NULL */

const char *describe(const Node *node);                       /* for a message: <bsdf type="diffuse"> */

#define fail(node, ...) die_at((node)->file, (node)->line, __VA_ARGS__)
#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

/* A growing text, for messages that list what is supported and for attributes with $parameters. */
typedef struct { char *text; size_t length; } Text;

void append(Text *text, const char *piece, size_t length);
void append_words(Text *text, const char *before, const char *words, const char *after);   /* by commas */
const char *find_word(const char *list, const char *word);    /* in "some words needed!", or NULL */

typedef enum {
    AS_FLOAT, AS_IOR, AS_COLOUR, AS_VECTOR, AS_INTEGER, AS_BOOLEAN, AS_STRING, AS_TRANSFORM
} PropertyKind;

/* A property that an element may have. What is there before it is read is the default. */
typedef struct {
    const char *name;
    PropertyKind kind;
    void *to;                                     /* double, two of double[3], int, bool, char *, Affine */
    const char *range;                            /* of numbers, "[0,1)"; of strings, "this that"; or NULL */
    const Node *node;                             /* set to the element that gave the property */
} Property;

/* Reads the properties of an element into their places. A child that is neither a property of the table nor
   one of the objects, a list of tags such as "bsdf ref", is an error. */
void read_properties(const Node *node, Property *properties, int count, const char *objects);

Affine affine_identity(void);
Affine affine_translate(double x, double y, double z);
Affine affine_scale(double x, double y, double z);
Affine affine_multiply(Affine a, Affine b);                   /* b first */
double affine_determinant(Affine a);

#endif
