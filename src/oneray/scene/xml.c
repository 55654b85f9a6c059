#include "scene/xml.h"

#include <ctype.h>
#include <errno.h>
#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* A <default> may use those before it, so that values could double with every line: there are bounds. */
enum { MAX_NESTING = 32, MAX_MIB = 64, MAX_DEFAULTS = 1024, MAX_VALUE = 1 << 16 };
static const char NAME_CHARACTERS[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";

/* The attributes an element takes; those with a ! it must have. */
static const struct { const char *tag, *attributes; } tags[] = {
    {"scene", "version!"}, {"default", "name! value!"}, {"ref", "id! name"},
    {"integrator", "type! id name"}, {"sensor", "type! id name"}, {"film", "type! id name"},
    {"rfilter", "type! id name"}, {"sampler", "type! id name"}, {"bsdf", "type! id name"},
    {"shape", "type! id name"}, {"emitter", "type! id name"},
    {"float", "name! value!"}, {"integer", "name! value!"}, {"boolean", "name! value!"},
    {"string", "name! value!"}, {"rgb", "name! value!"}, {"point", "name! value x y z"},
    {"vector", "name! value x y z"}, {"transform", "name!"},
    {"translate", "value x y z"}, {"scale", "value x y z"}, {"rotate", "angle! value x y z"},
    {"lookat", "origin! target! up"}, {"matrix", "value!"},
};

/* Where word stands in a list of words by spaces, or NULL; a ! may follow it there. */
const char *find_word(const char *list, const char *word)
{
    size_t length = strcspn(word, " !");
    if (word[length])
        return NULL;
    for (const char *at = list; length && *at; at += strcspn(at, " "), at += strspn(at, " "))
        if (strncmp(at, word, length) == 0 && (at[length] == '\0' || strchr(" !", at[length])))
            return at;
    return NULL;
}

void append(Text *text, const char *piece, size_t length)
{
    text->text = reallocate(text->text, text->length + length + 1, 1);
    memcpy(text->text + text->length, piece, length);
    text->length += length;
    text->text[text->length] = '\0';
}

void append_words(Text *text, const char *before, const char *words, const char *after)
{
    for (words += strspn(words, " !"); *words; words += strspn(words, " !")) {
        size_t length = strcspn(words, " !");
        if (text->length)
            append(text, ", ", 2);
        append(text, before, strlen(before));
        append(text, words, length);
        append(text, after, strlen(after));
        words += length;
    }
}

const char *describe(const Node *node)
{
    Text text = {0};
    const char *type = attribute(node, "type");
    append(&text, "<", 1);
    append(&text, node->tag, strlen(node->tag));
    if (type) {
        append(&text, " type=\"", 7);
        append(&text, type, strlen(type));
        append(&text, "\"", 1);
    }
    append(&text, ">", 1);
    return text.text;
}

static char *copy(const char *text)
{
    char *result = allocate(strlen(text) + 1, 1);
    return strcpy(result, text);
}

/* Reading: expat calls these with the elements in their order, so a <default> holds from where it stands. */

typedef struct {
    char *name, *value;
    Parameter *given;                             /* by -Dname=value, or NULL */
    bool declared;                                /* by a <default> */
} Declared;

typedef struct {
    const char *file;
    XML_Parser parser;
    SceneFile *scene;
    Node *open;                                   /* the innermost element that is not closed yet */
    int depth;
    Declared *parameters;
    int parameter_count;
    size_t expanded;                              /* bytes of all values, $parameters replaced */
} Reader;

static int line_of(const Reader *reader)
{
    return (int)XML_GetCurrentLineNumber(reader->parser);
}

const char *attribute(const Node *node, const char *name)
{
    for (int i = 0; i < node->attribute_count; i++)
        if (strcmp(node->attributes[i].name, name) == 0)
            return node->attributes[i].value;
    return NULL;
}

static const char *defaults_list(const Reader *reader)
{
    Text list = {0};
    for (int i = 0; i < reader->parameter_count; i++)
        if (reader->parameters[i].declared)
            append_words(&list, "", reader->parameters[i].name, "");
    return list.length ? list.text : "none";
}

/* The value of the parameter with the longest name that text begins with, or NULL; and that length. */
static const char *use_parameter(Reader *reader, const char *text, size_t *length)
{
    const Declared *found = NULL;
    *length = 0;
    for (int i = 0; i < reader->parameter_count; i++) {
        size_t n = strlen(reader->parameters[i].name);
        if (n > *length && strncmp(text, reader->parameters[i].name, n) == 0) {
            *length = n;
            found = &reader->parameters[i];
        }
    }
    if (found && found->given)
        found->given->used = true;
    return found ? found->value : NULL;
}

static Declared *add_parameter(Reader *reader, const char *name, const char *value)
{
    if (reader->parameter_count == MAX_DEFAULTS)
        die_at(reader->file, line_of(reader), "more than %d parameters", MAX_DEFAULTS);
    reader->parameters = room_for(reader->parameters, reader->parameter_count, sizeof *reader->parameters);
    Declared *added = &reader->parameters[reader->parameter_count++];
    *added = (Declared){.name = copy(name), .value = copy(value)};
    return added;
}

/* A copy of text with each $name replaced; \$ is a plain $. Control characters become spaces, so that
   messages are one line. */
static char *substitute(Reader *reader, const char *text)
{
    Text result = {0};
    append(&result, "", 0);
    while (*text) {
        size_t plain = strcspn(text, "$\\");
        append(&result, text, plain);
        text += plain;
        if (*text == '\\') {
            text += text[1] == '$';
            append(&result, text++, 1);
        } else if (*text == '$') {
            size_t length;
            const char *value = use_parameter(reader, ++text, &length);
            if (!value)
                die_at(reader->file, line_of(reader), "undefined parameter $%.*s (defaults before it: %s)",
                       (int)strspn(text, NAME_CHARACTERS), text, defaults_list(reader));
            append(&result, value, strlen(value));
            text += length;
        }
        if (result.length > MAX_VALUE)
            die_at(reader->file, line_of(reader), "a value of more than %d bytes", MAX_VALUE);
    }
    reader->expanded += result.length;
    if (reader->expanded >> 20 >= MAX_MIB)
        die_at(reader->file, line_of(reader), "with the $parameters replaced, larger than %d MiB", MAX_MIB);
    for (char *c = result.text; *c; c++)
        if (iscntrl((unsigned char)*c))
            *c = ' ';
    return result.text;
}

static void check_attributes(const Node *node)
{
    const char *allowed = NULL;
    for (int i = 0; i < COUNT(tags); i++)
        if (strcmp(tags[i].tag, node->tag) == 0)
            allowed = tags[i].attributes;
    if (!allowed)
        return;                                   /* an unknown element: its parent says what it takes */
    Text list = {0};
    for (int i = 0; i < node->attribute_count; i++)
        if (!find_word(allowed, node->attributes[i].name)) {
            append_words(&list, "", allowed, "");
            fail(node, "<%s> has no attribute \"%s\" (%s)", node->tag, node->attributes[i].name, list.text);
        }
    for (const char *at = allowed; (at = strchr(at, '!')); at++) {
        const char *start = at;
        while (start > allowed && start[-1] != ' ')
            start--;
        char name[16];
        snprintf(name, sizeof name, "%.*s", (int)(at - start), start);
        if (!attribute(node, name))
            fail(node, "<%s> lacks the attribute \"%s\"", node->tag, name);
    }
    if (strstr(allowed, "x y z") && attribute(node, "value")
        && (attribute(node, "x") || attribute(node, "y") || attribute(node, "z")))
        fail(node, "<%s> has both \"value\" and \"x\", \"y\", \"z\": write one or the other", node->tag);
}

/* What -D gives is there already, and stays. */
static void add_default(Reader *reader, const Node *node)
{
    const char *name = attribute(node, "name");
    Declared *parameter = NULL;
    if (!node->parent || node->parent->parent)
        fail(node, "<default> must stand directly in <scene>");
    if (!*name || name[strspn(name, NAME_CHARACTERS)])
        fail(node, "<default name=\"%.80s\">: a name has letters, digits and _ only", name);
    for (int i = 0; i < reader->parameter_count; i++)
        if (strcmp(reader->parameters[i].name, name) == 0)
            parameter = &reader->parameters[i];
    if (parameter && parameter->declared)
        fail(node, "the default \"%.80s\" is given twice", name);
    if (!parameter)
        parameter = add_parameter(reader, name, attribute(node, "value"));
    parameter->declared = true;
}

static void add_id(SceneFile *scene, Node *node)
{
    if (!attribute(node, "id") || strcmp(node->tag, "ref") == 0)
        return;
    if (!*attribute(node, "id"))
        fail(node, "the id of <%s> is empty", node->tag);
    scene->by_id = room_for(scene->by_id, scene->id_count, sizeof *scene->by_id);
    scene->by_id[scene->id_count++] = node;
}

static void XMLCALL on_start(void *data, const char *tag, const char **attributes)
{
    Reader *reader = data;
    Node *node = allocate(1, sizeof *node);
    *node = (Node){.file = reader->file, .line = line_of(reader), .tag = copy(tag), .parent = reader->open};
    if (++reader->depth > MAX_NESTING)
        fail(node, "elements are nested more than %d deep", MAX_NESTING);
    while (attributes[2 * node->attribute_count])
        node->attribute_count++;
    node->attributes = allocate((size_t)node->attribute_count, sizeof *node->attributes);
    for (int i = 0; i < node->attribute_count; i++)
        node->attributes[i] = (Attribute){copy(attributes[2 * i]), substitute(reader, attributes[2 * i + 1])};
    check_attributes(node);
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

NORETURN static void fail_reading(const char *file, const Place *named_by, const char *what)
{
    if (named_by)
        fail(named_by, "%s: %s", file, what);
    die("%s: %s", file, what);
}

char *read_file(const char *file, size_t most_mib, const Place *named_by, size_t *size)
{
    struct stat status;
    FILE *stream = fopen(file, "rb");
    if (!stream)
        fail_reading(file, named_by, strerror(errno));
    if (fstat(fileno(stream), &status) == 0 && S_ISDIR(status.st_mode))
        fail_reading(file, named_by, strerror(EISDIR));
    Text bytes = {0};
    char block[65536];
    for (size_t got; (got = fread(block, 1, sizeof block, stream)) > 0;) {
        append(&bytes, block, got);
        if (bytes.length >> 20 >= most_mib && bytes.length > most_mib << 20)
            die("%s: larger than %zu MiB, which is the limit for a %s file", file, most_mib,
                named_by ? "mesh" : "scene");
    }
    if (ferror(stream))
        fail_reading(file, named_by, strerror(errno));
    fclose(stream);
    if (!bytes.length)
        die_at(file, 1, "the file is empty");
    *size = bytes.length;
    return bytes.text;
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

/* The hash of the file and of the parameters given, sorted by name: their order does not change the scene. */
static uint64_t hash_scene(const char *bytes, size_t size, const Parameter *given, int count)
{
    uint64_t hash = hash_bytes(0xcbf29ce484222325u, bytes, size);
    Parameter *sorted = allocate((size_t)count, sizeof *sorted);
    if (count)
        memcpy(sorted, given, (size_t)count * sizeof *sorted);
    qsort(sorted, (size_t)count, sizeof *sorted, by_name);
    for (int i = 0; i < count; i++) {
        if (i && strcmp(sorted[i].name, sorted[i - 1].name) == 0)
            die("-D%s is given twice", sorted[i].name);
        hash = hash_bytes(hash, sorted[i].name, strlen(sorted[i].name));
        hash = hash_bytes(hash, "=", 1);
        hash = hash_bytes(hash, sorted[i].value, strlen(sorted[i].value));
        hash = hash_bytes(hash, "\n", 1);
    }
    free(sorted);
    return hash;
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

Node *find_id(const SceneFile *scene, const char *id)
{
    int low = 0, high = scene->id_count;
    while (low < high) {
        int middle = (low + high) / 2, order = strcmp(attribute(scene->by_id[middle], "id"), id);
        if (order == 0)
            return scene->by_id[middle];
        if (order < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return NULL;
}

SceneFile *scene_file_open(const char *file, Parameter *parameters, int parameter_count)
{
    size_t size;
    char *bytes = read_file(file, MAX_MIB, NULL, &size);
    SceneFile *scene = allocate(1, sizeof *scene);
    scene->hash = hash_scene(bytes, size, parameters, parameter_count);
    Reader reader = {.file = file, .scene = scene};
    for (int i = 0; i < parameter_count; i++)
        add_parameter(&reader, parameters[i].name, parameters[i].value)->given = &parameters[i];
    reader.parser = XML_ParserCreate(NULL);
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
    for (int i = 0; i < parameter_count; i++)
        if (!parameters[i].used)
            die("-D%s=%s: the scene uses no parameter \"%s\" (it has: %s)", parameters[i].name,
                parameters[i].value, parameters[i].name, defaults_list(&reader));
    for (int i = 0; i < reader.parameter_count; i++) {
        free(reader.parameters[i].name);
        free(reader.parameters[i].value);
    }
    free(reader.parameters);
    sort_ids(scene);
    return scene;
}

static void free_node(Node *node)
{
    while (node) {
        Node *next = node->next;
        free_node(node->first);
        for (int i = 0; i < node->attribute_count; i++) {
            free(node->attributes[i].name);
            free(node->attributes[i].value);
        }
        free(node->attributes);
        free(node->tag);
        free(node);
        node = next;
    }
}

void scene_file_close(SceneFile *scene)
{
    free_node(scene->root);
    free(scene->by_id);
    free(scene);
}
