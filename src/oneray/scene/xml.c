#include "scene/xml.h"

#include <ctype.h>
#include <errno.h>
#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A <default> may use those before it, so that values could double with every line: there are bounds. */
enum { MAX_NESTING = 32, MAX_MIB = 64, MAX_DEFAULTS = 1024, MAX_VALUE = 1 << 16 };
static const char NAME_CHARACTERS[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";

/* The attributes that elements may have; so many of the first they must have. */
static const struct {
    const char *elements, *attributes;
    int needed;
} tags[] = {
    {"<scene>", "version", 1},
    {"<default>, <float>, <integer>, <boolean>, <string>, <rgb>", "name, value", 2},
    {"<ref>", "id, name", 1},
    {"<integrator>, <sensor>, <film>, <rfilter>, <sampler>, <bsdf>, <shape>, <emitter>", "type, id, name", 1},
    {"<point>, <vector>", "name, value, x, y, z", 1},
    {"<transform>", "name", 1},
    {"<translate>, <scale>", "value, x, y, z", 0},
    {"<rotate>", "angle, value, x, y, z", 1},
    {"<lookat>", "origin, target, up", 2},
    {"<matrix>", "value", 1}};

/* A longer tag is cut off, and then there is none like it. */
bool is_among(const Node *node, const char *elements)
{
    size_t length = strlen(node->tag);
    while ((elements = strchr(elements, '<')))
        if (strncmp(++elements, node->tag, length) == 0 && elements[length] == '>')
            return true;
    return false;
}

const char *attribute(const Node *node, const char *name)
{
    for (char **at = node->attributes; *at; at += 2)
        if (strcmp(at[0], name) == 0)
            return at[1];
    return NULL;
}

const char *describe(const Node *node)
{
    Text text = {0};
    append(&text, "<%s", node->tag);
    if (attribute(node, "type"))
        append(&text, " type=\"%s\"", attribute(node, "type"));
    append(&text, ">");
    return text.text;
}

static char *copy(const char *text)
{
    char *result = allocate(strlen(text) + 1, 1);
    return strcpy(result, text);
}

/* Reading: expat calls these with the elements in their order, so a <default> holds from where it stands. */

typedef struct {
    const char *file;
    XML_Parser parser;
    SceneFile *scene;
    Node *open;                                   /* the innermost element that is not closed yet */
    int depth;
    Parameter parameters[MAX_DEFAULTS];           /* first those of the command line, by name */
    int parameter_count;
    size_t expanded;                              /* bytes of all values, $parameters replaced */
} Reader;

static int line_of(const Reader *reader) { return (int)XML_GetCurrentLineNumber(reader->parser); }

static const char *defaults_list(const Reader *reader)
{
    Text list = {0};
    for (int i = 0; i < reader->parameter_count; i++)
        if (reader->parameters[i].declared)
            append_word(&list, reader->parameters[i].name);
    return list.length ? list.text : "none";
}

/* The parameter with the longest name that text begins with, or NULL. */
static Parameter *parameter_at(Reader *reader, const char *text)
{
    Parameter *found = NULL;
    size_t longest = 0;
    for (Parameter *p = reader->parameters; p < reader->parameters + reader->parameter_count; p++)
        if (strlen(p->name) > longest && strncmp(text, p->name, strlen(p->name)) == 0) {
            longest = strlen(p->name);
            found = p;
        }
    return found;
}

/* A copy of text with each $name replaced; \$ is a plain $. Control characters become spaces, so that
   messages are one line. */
static char *substitute(Reader *reader, const Node *node, const char *text)
{
    Text result = {0};
    do {
        size_t plain = strcspn(text, "$\\");
        append(&result, "%.*s", (int)plain, text);
        text += plain;
        if (*text == '\\') {
            text += text[1] == '$';
            append(&result, "%c", *text++);
        } else if (*text == '$') {
            Parameter *parameter = parameter_at(reader, ++text);
            if (!parameter)
                fail(node, "undefined parameter $%.*s (defaults before it: %s)", (int)strspn(text, NAME_CHARACTERS), text,
                     defaults_list(reader));
            append(&result, "%s", parameter->value);
            text += strlen(parameter->name);
            parameter->used = true;
        }
        if (result.length > MAX_VALUE)
            fail(node, "a value of more than %d bytes", MAX_VALUE);
    } while (*text);
    reader->expanded += result.length;
    if (reader->expanded >> 20 >= MAX_MIB)
        fail(node, "with the $parameters replaced, larger than %d MiB", MAX_MIB);
    for (char *c = result.text; *c; c++)
        if (iscntrl((unsigned char)*c))
            *c = ' ';
    return result.text;
}

static void check_attributes(const Node *node, const char *allowed, int needed)
{
    unsigned has = 0;
    for (char **at = node->attributes; *at; at += 2) {
        int number = find_word(allowed, *at);
        if (number < 0)
            fail(node, "<%s> has no attribute \"%s\" (%s)", node->tag, *at, allowed);
        has |= 1u << number;
    }
    for (int i = 0; i < needed; i++) {
        size_t length = strcspn(allowed, ",");
        if (!(has >> i & 1))
            fail(node, "<%s> lacks the attribute \"%.*s\"", node->tag, (int)length, allowed);
        allowed += length + strspn(allowed + length, ", ");
    }
    if (attribute(node, "value") && (attribute(node, "x") || attribute(node, "y") || attribute(node, "z")))
        fail(node, "<%s> has both \"value\" and \"x\", \"y\", \"z\": write one or the other", node->tag);
}

/* What -D gives is there already, and stays. */
static void add_default(Reader *reader, const Node *node)
{
    const char *name = attribute(node, "name");
    if (!node->parent || node->parent->parent)
        fail(node, "<default> must stand directly in <scene>");
    if (!*name || name[strspn(name, NAME_CHARACTERS)])
        fail(node, "<default name=\"%.80s\">: a name has letters, digits and _ only", name);
    Parameter *parameter = parameter_at(reader, name);
    if (!parameter || strcmp(parameter->name, name) != 0) {
        if (reader->parameter_count == MAX_DEFAULTS)
            fail(node, "more than %d parameters", MAX_DEFAULTS);
        parameter = &reader->parameters[reader->parameter_count++];
        *parameter = (Parameter){.name = name, .value = attribute(node, "value")};
    }
    if (parameter->declared)
        fail(node, "the default \"%.80s\" is given twice", name);
    parameter->declared = true;
}

static void add_id(SceneFile *scene, Node *node)
{
    if (!attribute(node, "id") || strcmp(node->tag, "ref") == 0)
        return;
    if (!*attribute(node, "id"))
        fail(node, "the id of <%s> is empty", node->tag);
    PUSH(scene->by_id, scene->id_count, node);
}

static void XMLCALL on_start(void *data, const char *tag, const char **attributes)
{
    Reader *reader = data;
    Node *node = allocate(1, sizeof *node);
    *node = (Node){.file = reader->file, .line = line_of(reader), .tag = copy(tag), .parent = reader->open};
    if (++reader->depth > MAX_NESTING)
        fail(node, "elements are nested more than %d deep", MAX_NESTING);
    size_t count = 0;
    while (attributes[count])
        count++;
    node->attributes = allocate(count + 1, sizeof *node->attributes);
    for (size_t i = 0; i < count; i++)
        node->attributes[i] = i % 2 ? substitute(reader, node, attributes[i]) : copy(attributes[i]);
    for (int i = 0; i < COUNT(tags); i++)         /* of an unknown element its parent says what it takes */
        if (is_among(node, tags[i].elements))
            check_attributes(node, tags[i].attributes, tags[i].needed);
    add_id(reader->scene, node);
    if (!node->parent)
        reader->scene->root = node;
    else if (node->parent->last)
        node->parent->last = node->parent->last->next = node;
    else
        node->parent->last = node->parent->first = node;
    reader->open = node;
    if (strcmp(tag, "default") == 0)
        add_default(reader, node);
}

static void XMLCALL on_end(void *data, const char *tag)
{
    Reader *reader = data;
    (void)tag;
    reader->open = reader->open->parent;
    reader->depth--;
}

static void XMLCALL on_text(void *data, const char *text, int length)
{
    Reader *reader = data;
    for (int i = 0; i < length; i++)
        if (!strchr(" \t\r\n", text[i]))
            die_at(reader->file, line_of(reader), "text between the elements: values stand in attributes");
}

static void XMLCALL on_doctype(void *data, const char *name, const char *system, const char *public,
                               int has_subset)
{
    Reader *reader = data;
    (void)name, (void)system, (void)public, (void)has_subset;
    die_at(reader->file, line_of(reader),
           "a DOCTYPE is not supported (for values that vary: <default> and $name)");
}

char *read_file(const char *file, size_t most_mib, const Place *named_by, size_t *size)
{
    FILE *stream = named_by || strcmp(file, "-") ? fopen(file, "rb") : stdin;
    char *bytes = NULL;
    *size = 0;
    for (size_t got = 1, room = 0; stream && got > 0; *size += got) {
        if (*size == room)
            bytes = reallocate(bytes, (room = 2 * room + (1 << 16)) + 1, 1);
        got = fread(bytes + *size, 1, room - *size, stream);
        if ((*size + got + (1 << 20) - 1) >> 20 > most_mib)
            die("%s: larger than %zu MiB, which is the limit for a %s file", file, most_mib,
                named_by ? "mesh" : "scene");
    }
    if ((!stream || ferror(stream)) && named_by)
        fail(named_by, "%s: %s", file, strerror(errno));
    if (!stream || ferror(stream))
        die("%s: %s", file, strerror(errno));
    fclose(stream);
    if (!*size)
        die_at(file, 1, "the file is empty");
    bytes[*size] = '\0';
    return bytes;
}

/* FNV-1a, 64 bits: http://www.isthe.com/chongo/tech/comp/fnv */
uint64_t hash_bytes(uint64_t hash, const char *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ (unsigned char)bytes[i]) * 0x100000001b3u;
    return hash;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(((const Parameter *)a)->name, ((const Parameter *)b)->name);
}

static int by_id_then_line(const void *a, const void *b)
{
    const Node *p = *(Node *const *)a, *q = *(Node *const *)b;
    int order = strcmp(attribute(p, "id"), attribute(q, "id"));
    return order ? order : (p->line > q->line) - (p->line < q->line);
}

static void sort_ids(SceneFile *scene)
{
    if (scene->id_count)
        qsort(scene->by_id, (size_t)scene->id_count, sizeof *scene->by_id, by_id_then_line);
    for (int i = 1; i < scene->id_count; i++)
        if (strcmp(attribute(scene->by_id[i - 1], "id"), attribute(scene->by_id[i], "id")) == 0)
            fail(scene->by_id[i], "the id \"%.80s\" is already that of <%s> in line %d",
                 attribute(scene->by_id[i], "id"), scene->by_id[i - 1]->tag, scene->by_id[i - 1]->line);
}

static int by_this_id(const void *id, const void *node)
{
    return strcmp(id, attribute(*(Node *const *)node, "id"));
}

Node *find_id(const SceneFile *scene, const char *id)
{
    Node **found = NULL;
    if (scene->id_count)
        found = bsearch(id, scene->by_id, (size_t)scene->id_count, sizeof *found, by_this_id);
    return found ? *found : NULL;
}

/* The parameters given are part of the hash in the order of their names: that of the command line does not count. */
static void take_given(Reader *reader, const Parameter *given, int count)
{
    uint64_t *hash = &reader->scene->hash;
    for (int i = 0; i < count; i++)
        reader->parameters[i] = given[i];
    reader->parameter_count = count;
    qsort(reader->parameters, (size_t)count, sizeof *given, by_name);
    for (int i = 0; i < count; i++) {
        Text line = {0};
        append(&line, "%s=%s\n", reader->parameters[i].name, reader->parameters[i].value);
        *hash = hash_bytes(*hash, line.text, line.length);
        free(line.text);
    }
}

SceneFile *scene_file_open(const char *file, const Parameter *given, int count)
{
    size_t size;
    char *bytes = read_file(file, MAX_MIB, NULL, &size);
    SceneFile *scene = allocate(1, sizeof *scene);
    scene->hash = hash_bytes(0xcbf29ce484222325u, bytes, size);
    Reader reader = {.file = file, .scene = scene, .parser = XML_ParserCreate(NULL)};
    take_given(&reader, given, count);
    if (!reader.parser)
        die("out of memory");
    XML_SetUserData(reader.parser, &reader);
    XML_SetElementHandler(reader.parser, on_start, on_end);
    XML_SetCharacterDataHandler(reader.parser, on_text);
    XML_SetStartDoctypeDeclHandler(reader.parser, on_doctype);
    if (XML_Parse(reader.parser, bytes, (int)size, 1) == XML_STATUS_ERROR)
        die_at(file, line_of(&reader), "XML error: %s", XML_ErrorString(XML_GetErrorCode(reader.parser)));
    XML_ParserFree(reader.parser);
    free(bytes);
    for (int i = 0; i < count; i++)
        if (!parameter_at(&reader, given[i].name)->used)
            die("-D%s=%s: the scene uses no parameter \"%s\" (it has: %s)", given[i].name, given[i].value,
                given[i].name, defaults_list(&reader));
    sort_ids(scene);
    return scene;
}

static void free_node(Node *node)
{
    for (Node *next; node; node = next) {
        next = node->next;
        free_node(node->first);
        for (char **at = node->attributes; *at; at++)
            free(*at);
        free(node->attributes);
        free(node->tag);
        free(node);
    }
}

void scene_file_close(SceneFile *scene)
{
    free_node(scene->root);
    free(scene->by_id);
    free(scene);
}
