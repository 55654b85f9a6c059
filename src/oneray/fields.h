/* What a scene file may say of a plugin: a table of fields, by which one reader (scene/values.c) fills the plugin's
   struct, and a function that checks what the fields demand of each other. */
#pragma once

#include "message.h"

#include <stddef.h>
#include <string.h>

typedef enum {
    AS_FLOAT,     /* double */
    AS_IOR,       /* double: an index of refraction, or a medium's name */
    AS_COLOUR,    /* double[3] */
    AS_EMISSION,  /* double[3] */
    AS_REFLECTANCE, /* Reflectance */
    AS_SHARE,     /* Reflectance: a number that a colour or a texture may stand for, three times */
    AS_VECTOR,    /* double[3] */
    AS_INTEGER,   /* int */
    AS_BOOLEAN,   /* bool */
    AS_STRING,    /* const char *, which the scene file has as long as it is being read */
    AS_WORD,      /* int: which word of the range */
    AS_TRANSFORM, /* Affine; without, the identity */
    AS_FILE,      /* File */
    AS_ANYTHING   /* nowhere: of the field "*", which is any other property */
} FieldKind;

typedef struct {
    const char *name;
    FieldKind kind;
    size_t offset;         /* in the plugin's struct, or NOWHERE */
    const char *range;     /* of a number, "(0,180)" or "[0,inf)"; "the, words"; or NULL */
    const char *otherwise; /* what holds where the file says nothing: a value as in a file; "" is 0; NULL: it must say */
} Field; /* a table ends with a row of zeros */

/* Values that need no place. Instead of a word NOWHERE what holds without it is done; of what is LEFT_OUT no value
   makes another picture. A warning says so. */
#define NOWHERE ((size_t)-1)
#define LEFT_OUT ((size_t)-2)

/* A file that the scene file names, in memory until the check: whose name is relative to the scene's folder. */
typedef struct {
    char *name, *bytes;
    size_t size;
    Place named; /* where in the scene file */
} File;

/* What share of light goes on: a colour, or a texture of them. */
typedef struct {
    double most[3], least[3]; /* of the texture, by channel; of a colour, that */
    int texture;              /* the description's n-th, from 1 on; 0: a colour */
    struct Node *element;     /* <texture> or <ref>, until that is read */
} Reflectance;

/* An element, as far as its plugin's struct does not say it. */
enum { MOST_FIELDS = 24 };
typedef struct {
    const char *file; /* with line, where it stands: fail(said, …) */
    int line;
    const char *type;
    const Field *fields;
    Place place[MOST_FIELDS]; /* of each field; line 0: the file does not say it */
    struct Mesh *triangles;   /* of the scene: a mesh is put behind them */
    struct Images *images;    /* of the scene */
    const char *left_out;     /* set by a check: why the scene does without */
} Said;

typedef struct {
    const char *types; /* its name in scene files, or several, "ply, obj" */
    void (*check)(void *plugin, Said *said); /* or NULL */
    Field fields[MOST_FIELDS + 1];
} Plugin;

/* Where the file says the field, or NULL. */
static inline const Place *given(const Said *said, const char *field)
{
    for (int i = 0; said->fields[i].name; i++)
        if (strcmp(said->fields[i].name, field) == 0 && said->place[i].line)
            return &said->place[i];
    return NULL;
}
