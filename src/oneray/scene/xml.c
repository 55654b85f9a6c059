#include "scene/xml.h"

#include <ctype.h>
#include <errno.h>
#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* A <default> may use those before it, so that values could double with every line: there are bounds. */
enum { MAX_NESTING = 32, MAX_MIB = 64, MAX_DEFAULTS = 1024, MAX_VALUE = 1 << 16, MAX_INCLUDED = 64, MAX_ALIASES = 32 };
static const char NAME_CHARACTERS[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";

/* The attributes that elements may have; so many of the first they must have. */
static const struct {
    const char *elements, *attributes;
    int needed;
} tags[] = {
    {"<scene>", "version", 1},
    {"<default>, <float>, <integer>, <boolean>, <string>, <rgb>", "name, value", 2},
    {"<ref>", "id, name", 1},
    {"<alias>", "id, as", 2},
    {"<include>", "filename, name", 1},
    {"<path>", "value", 1},
    {"<spectrum>", "name, value, type, id", 1},
    {"<blackbody>", "name, temperature, scale", 2},
    {"<integrator>, <sensor>, <film>, <rfilter>, <sampler>, <bsdf>, <texture>, <shape>, <emitter>, <medium>, "
     "<phase>",
     "type, id, name", 1},
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
    int major;                                    /* of its version */
    int depth;                                    /* elements that are open around it */
    const char *name;                             /* that its root gets from the <include>, or NULL */
} Input;

typedef struct {
    Input in;
    SceneFile *scene;
    Node *open;                                   /* the innermost element that is not closed yet */
    int depth;
    Parameter parameters[MAX_DEFAULTS];           /* first those of the command line, by name */
    int parameter_count;
    size_t expanded;                              /* bytes of all values, $parameters replaced */
    bool in_text;                                 /* which comes in pieces, and has been warned of */
} Reader;

static int line_of(const Reader *reader) { return (int)XML_GetCurrentLineNumber(reader->in.parser); }

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
            end_at(node->file, node->line, "a value of more than %d bytes", MAX_VALUE);
    } while (*text);
    reader->expanded += result.length;
    if (reader->expanded >> 20 >= MAX_MIB)
        end_at(node->file, node->line, "with the $parameters replaced, larger than %d MiB", MAX_MIB);
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
    if (!node->parent || (node->parent->parent && !attribute(node->parent, "type")))
        fail(node, "<default> must stand in <scene>, or in what has a type");
    if (!*name || name[strspn(name, NAME_CHARACTERS)])
        fail(node, "<default name=\"%.80s\">: a name has letters, digits and _ only", name);
    Parameter *parameter = parameter_at(reader, name);
    if (!parameter || strcmp(parameter->name, name) != 0) {
        if (reader->parameter_count == MAX_DEFAULTS)
            end_at(node->file, node->line, "more than %d parameters", MAX_DEFAULTS);
        parameter = &reader->parameters[reader->parameter_count++];
        *parameter = (Parameter){.name = name, .value = attribute(node, "value")};
    }
    if (parameter->declared)
        note(node, "the default \"%.80s\" is given twice: the first holds, as in Mitsuba", name);
    parameter->declared = true;
}

static void add_id(SceneFile *scene, Node *node)
{
    const char *id = attribute(node, strcmp(node->tag, "alias") == 0 ? "as" : "id");
    if (!id || strcmp(node->tag, "ref") == 0)
        return;
    if (!*id)
        fail(node, "the id of <%s> is empty", node->tag);
    Id one = {id, node};
    PUSH(scene->ids, scene->id_count, one);
}

/* Mitsuba's names of today for those of version 0: "toWorld" is "to_world". */
static void rename_property(const Reader *reader, const Node *node, char **name)
{
    const Node *parent = reader->open;
    Text new = {0};
    for (const char *c = *name; *c; c++) {
        bool word = c > *name && islower((unsigned char)c[-1]) && isupper((unsigned char)*c);
        append(&new, word ? "_%c" : "%c", word ? tolower((unsigned char)*c) : *c);
        while (word && isupper((unsigned char)c[1]))
            append(&new, "%c", tolower((unsigned char)*++c));
    }
    if (!new.length || strcmp(node->tag, "default") == 0)
        return;
    free(*name);
    *name = new.text;
    const char *type = parent ? attribute(parent, "type") : NULL;
    if (type && strcmp(type, "diffuse") == 0 && strcmp(*name, "diffuse_reflectance") == 0)
        memmove(*name, "reflectance", sizeof "reflectance");
}

/* An element that was opened, and the texts of its attributes. */
typedef struct {
    Reader *reader;
    Node *node;
    const char **attributes;
} Opened;

/* Is the element that was opened last the root of its file? */
static bool is_root(const Reader *reader) { return reader->depth == reader->in.depth + 1; }

/* What makes the root of an included file an element like others: no version, and the name that the <include> gives. */
static void set_root(Reader *reader, Node *node)
{
    size_t kept = 0;
    for (char **at = node->attributes; *at; at += 2) {
        bool drop = strcmp(at[0], "version") == 0 || (reader->in.name && strcmp(at[0], "name") == 0);
        if (drop)
            free(at[0]), free(at[1]);
        else
            node->attributes[kept] = at[0], node->attributes[kept + 1] = at[1], kept += 2;
    }
    if (reader->in.name)
        node->attributes[kept] = copy("name"), node->attributes[kept + 1] = copy(reader->in.name), kept += 2;
    node->attributes[kept] = NULL;
}

static void read_version(Reader *reader, const Node *node)
{
    int minor, patch;
    char more;
    const char *version = attribute(node, "version");
    if (!version)
        fail(node, "<%s> lacks the attribute \"version\"", node->tag);
    if (strspn(version, "0123456789.") != strlen(version)
        || sscanf(version, "%2d.%4d.%4d%c", &reader->in.major, &minor, &patch, &more) != 3 || reader->in.major > 3)
        fail(node, "scene version \"%.80s\" is not supported (3.0.0, or another of 0.x.y to 3.x.y)", version);
}

static void read_attributes(void *opened)
{
    Reader *reader = ((Opened *)opened)->reader;
    Node *node = ((Opened *)opened)->node;
    const char **given = ((Opened *)opened)->attributes;
    for (size_t i = 0; given[i]; i++)
        node->attributes[i] = i % 2 ? substitute(reader, node, given[i]) : copy(given[i]);
    if (is_root(reader) && (reader->in.depth || strcmp(node->tag, "scene") == 0))
        read_version(reader, node);
    if (is_root(reader) && reader->in.depth && strcmp(node->tag, "scene") != 0)
        set_root(reader, node);
    for (char **at = node->attributes; *at && reader->in.major < 2; at += 2)
        if (strcmp(at[0], "name") == 0)
            rename_property(reader, node, &at[1]);
    if (strcmp(node->tag, "lookAt") == 0) {
        strcpy(node->tag, "lookat");
        note(node, "<lookAt> is read as <lookat>, which Mitsuba 3 wants");
    }
    for (int i = 0; i < COUNT(tags); i++)         /* of an unknown element its parent says what it takes */
        if (is_among(node, tags[i].elements))
            check_attributes(node, tags[i].attributes, tags[i].needed);
    add_id(reader->scene, node);
    if (strcmp(node->tag, "default") == 0)
        add_default(reader, node);
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

static void put_under(Node *parent, Node *node)
{
    if (parent->last)
        parent->last = parent->last->next = node;
    else
        parent->last = parent->first = node;
}

static Node *new_node(const char *file, int line, const char *tag, Node *parent, size_t attributes)
{
    Node *node = allocate(1, sizeof *node);
    *node = (Node){.file = file, .line = line, .tag = copy(tag), .parent = parent,
        .attributes = allocate(attributes + 1, sizeof *node->attributes)};
    return node;
}

static void take_last(Node *parent)
{
    Node **at = &parent->first, *before = NULL;
    for (; *at != parent->last; at = &(*at)->next)
        before = *at;
    *at = NULL;
    parent->last = before;
}

/* In version 0 a texture has "uoffset", "voffset", "uscale" and "vscale", which become steps of "to_uv". */
static void upgrade_to_uv(const Reader *reader, Node *node)
{
    const char *name = attribute(node, "name"), *value = attribute(node, "value");
    int which = name && value ? find_word("uoffset, voffset, uscale, vscale", name) : -1;
    Node *parent = node->parent, *to_uv = parent ? parent->first : NULL;
    if (which < 0 || reader->in.major >= 2 || !parent || !is_among(node, "<float>, <integer>"))
        return;
    while (to_uv && !to_uv->upgraded)
        to_uv = to_uv->next;
    Node *step = new_node(node->file, node->line, which < 2 ? "translate" : "scale", NULL, 2);
    step->attributes[0] = copy(which % 2 ? "y" : "x"), step->attributes[1] = copy(value);
    take_last(parent);
    if (!to_uv) {
        to_uv = new_node(node->file, node->line, "transform", parent, 2);
        to_uv->attributes[0] = copy("name"), to_uv->attributes[1] = copy("to_uv");
        to_uv->upgraded = true;
        put_under(parent, to_uv);
    }
    step->parent = to_uv;
    if (which >= 2 || !to_uv->first) {            /* offsets before scales */
        put_under(to_uv, step);
    } else {
        step->next = to_uv->first;
        to_uv->first = step;
    }
    free_node(node);
}

/* Its children go where the <include> stands. */
static bool is_included_scene(const Reader *reader, const char *tag)
{
    return reader->in.depth && is_root(reader) && strcmp(tag, "scene") == 0;
}

static void include(Reader *reader, const Node *node);
static void add_folder(Reader *reader, const Node *node);

static void XMLCALL on_start(void *data, const char *tag, const char **attributes)
{
    Reader *reader = data;
    size_t count = 0;
    reader->in_text = false;
    while (attributes[count])
        count++;
    Node *node = new_node(reader->in.file, line_of(reader), tag, reader->open, count + 2);
    node->scene = reader->scene;
    if (++reader->depth > MAX_NESTING)
        fail(node, "elements are nested more than %d deep", MAX_NESTING);
    Opened opened = {reader, node, attributes};
    node->wrong = !attempt(read_attributes, &opened);
    if (is_included_scene(reader, tag)) {
        free_node(node);
        return;
    }
    if (!node->parent)
        reader->scene->root = node;
    else if (strcmp(tag, "include") != 0)
        put_under(strcmp(tag, "default") ? node->parent : reader->scene->root, node);
    reader->open = node;
}

static void XMLCALL on_end(void *data, const char *tag)
{
    Reader *reader = data;
    reader->in_text = false;
    if (!is_included_scene(reader, tag)) {
        Node *node = reader->open;
        reader->open = node->parent;
        if (!node->wrong && strcmp(tag, "path") == 0)
            add_folder(reader, node);
        if (!node->wrong && strcmp(tag, "include") == 0)
            include(reader, node);
        if (strcmp(tag, "include") == 0 && node->parent)
            free_node(node);
        else
            upgrade_to_uv(reader, node);
    }
    reader->depth--;
}

static void XMLCALL on_text(void *data, const char *text, int length)
{
    Reader *reader = data;
    for (int i = 0; i < length && !reader->in_text; i++) {
        reader->in_text = !strchr(" \t\r\n", text[i]);
        if (reader->in_text)
            warn_at(reader->in.file, line_of(reader), "text between the elements is left out, as by Mitsuba: values "
                    "stand in attributes");
    }
}

static void XMLCALL on_doctype(void *data, const char *name, const char *system, const char *public,
                               int has_subset)
{
    Reader *reader = data;
    (void)name, (void)system, (void)public, (void)has_subset;
    die_at(reader->in.file, line_of(reader),
           "a DOCTYPE is not supported (for values that vary: <default> and $name)");
}

char *read_file(const char *file, size_t most_mib, const Place *named_by, size_t *size)
{
    const Place at = named_by ? *named_by : (Place){0};
    FILE *stream = named_by || strcmp(file, "-") ? fopen(file, "rb") : stdin;
    char *bytes = NULL;
    *size = 0;
    for (size_t got = 1, room = 0; stream && got > 0; *size += got) {
        if (*size == room)
            bytes = reallocate(bytes, (room = 2 * room + (1 << 16)) + 1, 1);
        got = fread(bytes + *size, 1, room - *size, stream);
        if ((*size + got + (1 << 20) - 1) >> 20 > most_mib)
            fail(&at, "%s: larger than %zu MiB, which is the limit for %s", file, most_mib,
                most_mib == MAX_MIB ? "a scene file" : "a file that it names");
    }
    if (!stream || ferror(stream))
        fail(&at, "%s: %s", file, strerror(errno));
    fclose(stream);
    if (!*size)
        fail(&at, "%s: the file is empty", file);
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
    const Id *p = a, *q = b;
    int order = strcmp(p->name, q->name);
    return order ? order : (p->node->line > q->node->line) - (p->node->line < q->node->line);
}

static void check_id(void *ids)
{
    const Id *first = ids, *second = first + 1;
    if (strcmp(first->name, second->name) == 0)
        fail(second->node, "the id \"%.80s\" is already that of <%s> in line %d", second->name, first->node->tag,
             first->node->line);
    if (strcmp(second->node->tag, "alias") == 0 && !find_id(second->node->scene, second->name))
        fail(second->node, "<alias id=\"%.80s\"/>: nothing has this id", attribute(second->node, "id"));
}

static void sort_ids(SceneFile *scene)
{
    Id none = {"", scene->root};                  /* which no element has */
    PUSH(scene->ids, scene->id_count, none);
    qsort(scene->ids, (size_t)scene->id_count, sizeof *scene->ids, by_id_then_line);
    for (int i = 1; i < scene->id_count; i++)
        attempt(check_id, &scene->ids[i - 1]);
}

static int by_this_id(const void *id, const void *one) { return strcmp(id, ((const Id *)one)->name); }

Node *find_id(const SceneFile *scene, const char *id)
{
    for (int aliases = 0; *id && aliases < MAX_ALIASES; aliases++) {
        const Id *found = bsearch(id, scene->ids, (size_t)scene->id_count, sizeof *found, by_this_id);
        if (!found || strcmp(found->node->tag, "alias") != 0)
            return found ? found->node : NULL;
        id = attribute(found->node, "id");
    }
    return NULL;
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

/* Reads the reader's file, which a place names, or the command line. */
/* What expat says, and which element is open: a missing end is found far behind it. */
NORETURN static void die_of_xml(const Reader *reader)
{
    const Input *in = &reader->in;
    const enum XML_Error error = XML_GetErrorCode(in->parser);
    const Node *open = reader->depth > in->depth ? reader->open : NULL;
    bool unclosed = open && (error == XML_ERROR_TAG_MISMATCH || error == XML_ERROR_NO_ELEMENTS);
    if (unclosed)
        die_at(in->file, line_of(reader), "XML error: %s (<%s> of line %d is open)", XML_ErrorString(error),
            open->tag, open->line);
    die_at(in->file, line_of(reader), "XML error: %s", XML_ErrorString(error));
}

static void parse(Reader *reader, const Place *named_by)
{
    size_t size;
    char *bytes = read_file(reader->in.file, MAX_MIB, named_by, &size);
    reader->scene->hash = hash_bytes(reader->scene->hash, bytes, size);
    reader->expanded += named_by ? size : 0;
    if (reader->expanded >> 20 >= MAX_MIB)
        die("%s: with what it includes, larger than %d MiB", reader->in.file, MAX_MIB);
    reader->in.parser = XML_ParserCreate(NULL);
    if (!reader->in.parser)
        die("out of memory");
    XML_SetUserData(reader->in.parser, reader);
    XML_SetElementHandler(reader->in.parser, on_start, on_end);
    XML_SetCharacterDataHandler(reader->in.parser, on_text);
    XML_SetStartDoctypeDeclHandler(reader->in.parser, on_doctype);
    if (XML_Parse(reader->in.parser, bytes, (int)size, 1) == XML_STATUS_ERROR)
        die_of_xml(reader);
    XML_ParserFree(reader->in.parser);
    free(bytes);
}

/* Of a file, with the / behind it; "" is the working folder. */
static char *folder_of(const char *file)
{
    Text folder = {0};
    const char *slash = strrchr(file, '/');
    append(&folder, "%.*s", slash ? (int)(slash + 1 - file) : 0, file);
    return folder.text;
}

static char *in_folder(const char *folder, const char *name)
{
    Text path = {0};
    append(&path, "%s%s", *name == '/' ? "" : folder, name);
    return path.text;
}

char *find_file(const SceneFile *scene, const char *name)
{
    for (int i = scene->folder_count - 1; i > 0; i--) {
        char *path = in_folder(scene->folders[i], name);
        if (access(path, F_OK) == 0)
            return path;
        free(path);
    }
    return in_folder(scene->folders[0], name);
}

/* <path>: where else files may be; relative to the folder of its own file. */
static void add_folder(Reader *reader, const Node *node)
{
    SceneFile *scene = reader->scene;
    Text folder = {0};
    char *own = folder_of(reader->in.file), *beside = in_folder(own, attribute(node, "value"));
    free(own);
    if (reader->open && reader->open->parent)
        fail(node, "<path> must stand directly in <scene>");
    if (access(beside, F_OK) != 0) {
        free(beside);
        beside = find_file(scene, attribute(node, "value"));
    }
    if (access(beside, F_OK) != 0)
        fail(node, "<path value=\"%.80s\"/>: there is no such folder", attribute(node, "value"));
    append(&folder, "%s/", beside);
    free(beside);
    PUSH(scene->folders, scene->folder_count, folder.text);
}

/* The elements of another file's <scene>, or another root, take the place of the <include>, whose name the latter gets. Its
   $parameters hold from there on, its <path>s and its version in it only. */
static void include(Reader *reader, const Node *node)
{
    SceneFile *scene = reader->scene;
    Input outer = reader->in;
    int folders = scene->folder_count;
    if (node->first)
        fail(node->first, "<%s> cannot stand in <include>", node->first->tag);
    if (scene->included_count == MAX_INCLUDED)
        fail(node, "more than %d files are included, or one includes itself", MAX_INCLUDED);
    char *folder = folder_of(reader->in.file);
    PUSH(scene->folders, scene->folder_count, folder);
    char *file = find_file(scene, attribute(node, "filename"));
    PUSH(scene->included, scene->included_count, file);
    reader->in = (Input){file, NULL, outer.major, reader->depth, attribute(node, "name")};
    parse(reader, &(Place){node->file, node->line});
    while (scene->folder_count > folders)
        free(scene->folders[--scene->folder_count]);
    reader->in = outer;
}

SceneFile *scene_file_open(const char *file, const Parameter *given, int count)
{
    SceneFile *scene = allocate(1, sizeof *scene);
    Reader reader = {.in = {.file = file, .major = 3}, .scene = scene};
    char *folder = folder_of(file);
    PUSH(scene->folders, scene->folder_count, folder);
    scene->hash = 0xcbf29ce484222325u;
    take_given(&reader, given, count);
    parse(&reader, NULL);
    for (int i = 0; i < count; i++)
        if (!parameter_at(&reader, given[i].name)->used)
            die("-D%s=%s: the scene uses no parameter \"%s\" (it has: %s)", given[i].name, given[i].value,
                given[i].name, defaults_list(&reader));
    sort_ids(scene);
    return scene;
}

void scene_file_close(SceneFile *scene)
{
    free_node(scene->root);
    free(scene->ids);
    for (int i = 0; i < scene->folder_count; i++)
        free(scene->folders[i]);
    free(scene->folders);
    free(scene->included);
    free(scene);
}
