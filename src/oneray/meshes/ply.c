/* PLY files: Turk, The PLY Polygon File Format, 1994. Vertices and triangles; everything else is skipped by
   its declared type. */
#include "meshes/mesh.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

typedef enum { ASCII, LITTLE, BIG } Format;
typedef enum { INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64, TYPES } Type;
typedef enum { SKIPPED = -1, X, Y, Z, NX, NY, NZ, U, V, U_2, V_2, U_3, V_3, CORNERS } Role;

static const char FORMATS[] = "ascii, binary_little_endian, binary_big_endian", COORDINATES[] = "x, y, z, nx, ny, nz, u, v, texture_u, texture_v, s, t";
static const struct {
    const char *name, *other;
    size_t bytes;
} types[TYPES] = {{"char", "int8", 1}, {"uchar", "uint8", 1}, {"short", "int16", 2}, {"ushort", "uint16", 2},
    {"int", "int32", 4}, {"uint", "uint32", 4}, {"float", "float32", 4}, {"double", "float64", 8}};

enum { WORD = 40 };

typedef struct {
    bool is_list;
    Type type, length_type;
    Role role;
} PlyProperty;

typedef struct {
    char name[WORD];
    int count, line; /* the line that declares it */
    PlyProperty *properties;
    int property_count;
    unsigned has; /* the roles of its properties, a bit each */
} Element;

typedef struct {
    Format format;
    Element *elements;
    int element_count;
} Header;

static void skip_blanks(Source *source, const char *blanks)
{
    for (; *source->at && strchr(blanks, *source->at); source->at++)
        source->line += *source->at == '\n';
}

/* The next word of the header's line; empty at its end. Of a longer one the start: none that means anything is so
   long. */
static void next_word(Source *source, char word[WORD])
{
    skip_blanks(source, " \t\r");
    size_t length = strcspn(source->at, " \t\r\n"), kept = length < WORD ? length : WORD - 1;
    memcpy(word, source->at, kept);
    word[kept] = '\0';
    source->at += length;
}

static void end_line(Source *source)
{
    char word[WORD];
    next_word(source, word);
    if (*word || *source->at != '\n')
        fail(source, "the header's line should end before \"%s\"", *word ? word : "the end of the file");
    source->at++;
    source->line++;
}

static Type type_named(const Source *source, const char *word)
{
    for (int type = 0; type < TYPES; type++)
        if (!strcmp(word, types[type].name) || !strcmp(word, types[type].other))
            return (Type)type;
    fail(source, "\"%s\" is no type of PLY (char, uchar, short, ushort, int, uint, float, double)", word);
}

static Type next_type(Source *source)
{
    char word[WORD];
    next_word(source, word);
    return type_named(source, word);
}

static void read_format(Source *source, Header *header)
{
    char word[WORD], version[WORD];
    next_word(source, word);
    next_word(source, version);
    int format = find_word(FORMATS, word);
    if (format < 0 || strcmp(version, "1.0") != 0)
        fail(source, "the format \"%s %s\" is not supported (ascii 1.0, binary_little_endian 1.0, "
            "binary_big_endian 1.0)", word, version);
    header->format = (Format)format;
}

static void read_header_element(Source *source, Header *header)
{
    char count[WORD], *end;
    Element element = {.line = source->line};
    next_word(source, element.name);
    next_word(source, count);
    long value = strtol(count, &end, 10);
    if (end == count || *end || value < 0 || value > MESH_MOST || strlen(count) == WORD - 1)
        fail(source, "\"%s\" is no number of elements (0 to %d)", count, MESH_MOST);
    element.count = (int)value;
    PUSH(header->elements, header->element_count, element);
}

static void read_header_property(Source *source, Header *header)
{
    PlyProperty property = {.role = SKIPPED};
    char name[WORD];
    if (!header->element_count)
        fail(source, "a property before the first element");
    Element *element = &header->elements[header->element_count - 1];
    next_word(source, name);
    property.is_list = !strcmp(name, "list");
    if (property.is_list)
        property.length_type = next_type(source);
    property.type = property.is_list ? next_type(source) : type_named(source, name);
    next_word(source, name);
    if (!strcmp(element->name, "vertex") && !property.is_list)
        property.role = (Role)find_word(COORDINATES, name);
    if (!strcmp(element->name, "face") && property.is_list && find_word("vertex_indices, vertex_index", name) >= 0)
        property.role = CORNERS;
    if (property.role == CORNERS && (property.type >= FLOAT32 || property.length_type >= FLOAT32))
        fail(source, "\"%s\" must be a list of integers, its length too", name);
    unsigned bit = property.role == SKIPPED ? 0 : 1u << property.role;
    if (element->has & bit && (property.role < U || property.role == CORNERS))
        fail(source, "the property \"%s\" is given twice", name);
    element->has |= bit;
    PUSH(element->properties, element->property_count, property);
}

static void read_header(Source *source, Header *header)
{
    char word[WORD];
    bool has_format = false;
    skip_mark(source);
    if (strncmp(source->at, "ply", 3) != 0 || !strchr(" \t\r\n", source->at[3]))
        fail(source, "this is no PLY file: its first line must be \"ply\"");
    source->at += 3;
    for (end_line(source);; end_line(source)) {
        next_word(source, word);
        if (find_word("comment, obj_info", word) >= 0) {
            source->at += strcspn(source->at, "\n");
        } else if (!strcmp(word, "format") && !has_format) {
            read_format(source, header);
            has_format = true;
        } else if (!strcmp(word, "element")) {
            read_header_element(source, header);
        } else if (!strcmp(word, "property")) {
            read_header_property(source, header);
        } else if (!strcmp(word, "end_header") && has_format) {
            break;
        } else {
            fail(source, "the header has \"%s\" (format once, comment, element, property, end_header)",
                word);
        }
    }
    end_line(source);
}

static double binary_number(const char *at, Type type, bool big)
{
    uint64_t bits = binary_bits(at, types[type].bytes, big);
    switch (type) {
    case INT8: return (int8_t)bits;
    case INT16: return (int16_t)bits;
    case INT32: return (int32_t)bits;
    case FLOAT32:
    case FLOAT64: return binary_float(bits, types[type].bytes);
    default: return (uint32_t)bits;
    }
}

/* A number. In plain text it is nan where there is none, and only who wants it says so, but for coordinates and corners,
   without which there is no mesh. */
static double next_number(Source *source, Format format, Type type, const Element *element, Role role)
{
    if (format == ASCII) {
        skip_blanks(source, " \t\r\n");
        if (source->at == source->end)
            fail(source, "the file ends before the %d elements \"%s\" of line %d do", element->count,
                element->name, element->line);
        double value = (double)NAN;
        size_t length = word_length(source);
        if ((role == SKIPPED || (role > Z && role < CORNERS)) && length) {
            source->at += find_text_number(source, &value) ? 0 : length;
            return value;
        }
        value = read_text_number(source, "value of PLY");
        if (type < FLOAT32 && value != rint(value))
            fail(source, "%g is no integer, and a value of type %s is wanted", value, types[type].name);
        return value;
    }
    if ((size_t)(source->end - source->at) < types[type].bytes)
        fail(source, "the file ends before the %d elements \"%s\" of this line do", element->count,
            element->name);
    source->at += types[type].bytes;
    return binary_number(source->at - types[type].bytes, type, format == BIG);
}

/* A face: three corners, all of them vertices. */
static void read_corners(Source *source, double length, const double corners[3], Mesh *mesh)
{
    int number = mesh->triangle_count;
    if (length != 3)
        fail(source, "face %d has %.9g corners: only triangles are supported, as in Mitsuba", number,
            length);
    for (int k = 0; k < 3; k++)
        mesh->triangle[number][k] = checked_corner(source, number, corners[k], mesh->vertex_count);
    mesh->triangle_count++;
}

static void keep_number(Source *source, Role role, double value, int vertex, Mesh *mesh)
{
    if (!(fabs(value) <= (double)FLT_MAX) && role > Z)
        value = (double)NAN;
    if (role <= Z)
        mesh->vertex[vertex][role] = checked_coordinate(source, vertex, value);
    else if (role >= U)
        mesh->uv[vertex][role - U] = (float)value;
    else
        mesh->normal[vertex][role - NX] = value;
}

static void read_one(Source *source, Format format, const Element *element, int number, Mesh *mesh)
{
    for (int i = 0; i < element->property_count; i++) {
        const PlyProperty *property = &element->properties[i];
        double length = 1, corners[3] = {-1, -1, -1}, value = 0;
        if (property->is_list)
            length = next_number(source, format, property->length_type, element, CORNERS);
        if (!(length >= 0) || length != rint(length))
            fail(source, "a list of %g numbers in element %d of \"%s\"", length, number, element->name);
        for (double k = 0; k < length; k++) {
            value = next_number(source, format, property->type, element, property->role);
            if (k < 3)
                corners[(int)k] = value;
        }
        if (property->role == CORNERS)
            read_corners(source, length, corners, mesh);
        else if (property->role != SKIPPED)
            keep_number(source, property->role, value, number, mesh);
    }
}

/* Texture coordinates are the first of the pairs that the vertices have, as in Mitsuba; other pairs are skipped, and a
   normal that is not whole. */
static void choose_roles(Element *element, bool has_normal, int pair)
{
    for (int i = 0; i < element->property_count; i++) {
        Role *role = &element->properties[i].role;
        if (*role >= U && *role < CORNERS)
            *role = *role - pair == 0 ? U : *role - pair == 1 ? V : SKIPPED;
        else if (*role >= NX && *role <= NZ && !has_normal)
            *role = SKIPPED;
    }
}

static void make_vertices(Element *element, Mesh *mesh)
{
    bool has_normal = (element->has >> NX & 7) == 7;
    int pair = U;
    while (pair < CORNERS && (element->has >> pair & 3) != 3)
        pair += 2;
    mesh->vertex = allocate((size_t)element->count, sizeof *mesh->vertex);
    if (has_normal)
        mesh->normal = allocate((size_t)element->count, sizeof *mesh->normal);
    if (pair < CORNERS)
        mesh->uv = allocate((size_t)element->count, sizeof *mesh->uv);
    choose_roles(element, has_normal, pair);
}

/* Makes room for an element's numbers, once it is certain that the file can hold them. */
static void make_room(Source *source, Format format, Element *element, Mesh *mesh)
{
    const Place at = {source->file, element->line};
    size_t count = (size_t)element->count, rest = (size_t)(source->end - source->at), least = 0;
    for (int i = 0; i < element->property_count; i++) {
        const PlyProperty *property = &element->properties[i];
        least += format == ASCII ? 2 : types[property->is_list ? property->length_type : property->type].bytes;
    }
    if (count * least > rest + 1)
        fail(&at, "%zu elements \"%s\" are said to follow, but only %zu bytes do", count, element->name, rest);
    if (!strcmp(element->name, "vertex") && !mesh->vertex) {
        if ((element->has & 7) != 7)
            fail(&at, "the vertices need the properties x, y and z");
        make_vertices(element, mesh);
    } else if (!strcmp(element->name, "face") && !mesh->triangle) {
        if (!(element->has >> CORNERS & 1))
            fail(&at, "the faces need a list vertex_indices or vertex_index");
        if (count && !mesh->vertex_count)
            fail(&at, "the faces have no vertices: an element \"vertex\" is wanted");
        mesh->triangle = allocate(count, sizeof *mesh->triangle);
    } else if (element->has) {
        fail(&at, "a second element \"%s\"", element->name);
    }
}

void ply_read(Source *source, Mesh *mesh)
{
    Header header = {0};
    read_header(source, &header);
    for (int e = header.element_count - 1; e >= 0; e--) /* faces may come before the vertices that they name */
        if (!strcmp(header.elements[e].name, "vertex"))
            mesh->vertex_count = header.elements[e].count;
    for (int e = 0; e < header.element_count; e++) {
        Element *element = &header.elements[e];
        make_room(source, header.format, element, mesh);
        if (header.format != ASCII) /* bytes have no lines: a message names the one that declares them */
            source->line = element->line;
        for (int i = 0; i < element->count && element->property_count; i++)
            read_one(source, header.format, element, i, mesh);
        free(element->properties);
    }
    if (header.format == ASCII)
        skip_blanks(source, " \t\r\n");
    if (source->at != source->end)
        fail(source, "%zu bytes are left after all elements", (size_t)(source->end - source->at));
    for (int v = 0; mesh->normal && v < mesh->vertex_count; v++)
        normalise(mesh->normal[v]);
    free(header.elements);
}
