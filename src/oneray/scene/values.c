/* Typed values of properties: numbers, strings, transforms, and their ranges. */
#include "scene/xml.h"

#include <ctype.h>
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const double PI = 3.14159265358979323846;
#define LARGEST 1e300
static const char SEPARATORS[] = " ,\t\r\n";      /* between numbers */

/* The elements that may give a kind of property. */
static const char *const elements_of_kind[] = {
    [AS_FLOAT] = "<float> or <integer>", [AS_COLOUR] = "<rgb>, <float> or <integer>",
    [AS_VECTOR] = "<point> or <vector>", [AS_INTEGER] = "<integer>", [AS_BOOLEAN] = "<boolean>",
    [AS_IOR] = "<float>, <integer> or <string>", [AS_STRING] = "<string>", [AS_TRANSFORM] = "<transform>",
};

static bool gives(const Node *node, PropertyKind kind)
{
    char element[16];
    int length = snprintf(element, sizeof element, "<%s>", node->tag);
    return length < COUNT(element) && strstr(elements_of_kind[kind], element);
}

/* A number and nothing else: neither nan, inf nor hexadecimal. */
static double parse_number(const Node *node, const char *text, size_t length)
{
    char digits[64], *end = digits;
    while (length && isspace((unsigned char)*text))
        text++, length--;
    while (length && isspace((unsigned char)text[length - 1]))
        length--;
    if (length && length < sizeof digits && strspn(text, "+-.0123456789eE") >= length) {
        memcpy(digits, text, length);
        digits[length] = '\0';
        double value = strtod(digits, &end);
        if (*end == '\0' && !(fabs(value) <= LARGEST))
            fail(node, "%s is too large: %g is the largest number", digits, LARGEST);
        if (*end == '\0')
            return value;
    }
    fail(node, "\"%.*s\" is not a number", (int)(length < 80 ? length : 80), text);
}

static int count_numbers(const char *text)
{
    int count = 0;
    for (text += strspn(text, SEPARATORS); *text; text += strspn(text, SEPARATORS), count++)
        text += strcspn(text, SEPARATORS);
    return count;
}

/* Reads as many numbers as the text has, at most 16, and returns how many. */
static int parse_numbers(const Node *node, const char *text, double *numbers)
{
    int count = 0;
    for (text += strspn(text, SEPARATORS); *text && count < 16; text += strspn(text, SEPARATORS)) {
        size_t length = strcspn(text, SEPARATORS);
        numbers[count++] = parse_number(node, text, length);
        text += length;
    }
    return count;
}

/* An attribute of one or three numbers; one stands for three equal ones. */
static void parse_triple(const Node *node, const char *name, bool one_will_do, double triple[3])
{
    const char *text = attribute(node, name);
    int count = count_numbers(text);
    if (count != 3 && !(count == 1 && one_will_do))
        fail(node, "<%s %s=\"%.80s\">: %s numbers are wanted, not %d", node->tag, name, text,
             one_will_do ? "one or three" : "three", count);
    double numbers[16];
    parse_numbers(node, text, numbers);
    for (int i = 0; i < 3; i++)
        triple[i] = numbers[count == 3 ? i : 0];
}

/* value="x y z" or x, y and z apart. Without all_needed, those left out keep what triple holds. */
static void parse_xyz(const Node *node, bool all_needed, double triple[3])
{
    static const char *const names[] = {"x", "y", "z"};
    if (attribute(node, "value")) {
        parse_triple(node, "value", true, triple);
        return;
    }
    for (int i = 0; i < 3; i++) {
        const char *text = attribute(node, names[i]);
        if (text)
            triple[i] = parse_number(node, text, strlen(text));
        else if (all_needed)
            fail(node, "<%s> lacks the attribute \"%s\" (or write value=\"x y z\")", node->tag, names[i]);
    }
}

static int parse_integer(const Node *node, const char *text)
{
    char *end;
    const char *start = text + strspn(text, " ");
    errno = 0;
    long value = strtol(start, &end, 10);
    if (end == start || *start == '+' || end[strspn(end, " ")])
        fail(node, "\"%.80s\" is not an integer", text);
    if (errno || value > INT32_MAX || value < -INT32_MAX)
        fail(node, "\"%.80s\" is beyond the range of integers (32 bits)", text);
    return (int)value;
}

/* An <integer> will do where a <float> is wanted. */
static double parse_real(const Node *node, const char *text)
{
    bool integer = strcmp(node->tag, "integer") == 0;
    return integer ? parse_integer(node, text) : parse_number(node, text, strlen(text));
}

static bool parse_boolean(const Node *node, const char *text)
{
    if (strcasecmp(text, "true") != 0 && strcasecmp(text, "false") != 0)
        fail(node, "\"%.80s\" is not a boolean (true or false)", text);
    return tolower((unsigned char)*text) == 't';
}

/* Transforms: each element acts on what those before it made, Mitsuba's order. */

Affine affine_identity(void)
{
    return (Affine){{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
}

Affine affine_translate(double x, double y, double z)
{
    return (Affine){{{1, 0, 0, x}, {0, 1, 0, y}, {0, 0, 1, z}}};
}

Affine affine_scale(double x, double y, double z)
{
    return (Affine){{{x, 0, 0, 0}, {0, y, 0, 0}, {0, 0, z, 0}}};
}

Affine affine_multiply(Affine a, Affine b)
{
    Affine result;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            result.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j]
                           + (j == 3 ? a.m[i][3] : 0);
    return result;
}

double affine_determinant(Affine a)
{
    return a.m[0][0] * (a.m[1][1] * a.m[2][2] - a.m[1][2] * a.m[2][1])
         - a.m[0][1] * (a.m[1][0] * a.m[2][2] - a.m[1][2] * a.m[2][0])
         + a.m[0][2] * (a.m[1][0] * a.m[2][1] - a.m[1][1] * a.m[2][0]);
}

/* Rodrigues: R = cosθ I + sinθ [a]× + (1 − cosθ) a aᵀ. Mitsuba does not normalise the axis a, and what it
   makes of any other than a unit vector is no rotation: that is refused. */
static Affine parse_rotate(const Node *node)
{
    double a[3] = {0, 0, 0};
    const char *text = attribute(node, "angle");
    parse_xyz(node, false, a);
    double degrees = parse_number(node, text, strlen(text)), angle = degrees * PI / 180;
    double length = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    if (fabs(length - 1) > 1e-3)
        fail(node, "<rotate>: the axis must have length 1, not %g (Mitsuba does not normalise it)", length);
    double c = cos(angle), s = sin(angle);
    if (fmod(degrees, 90) == 0) {               /* quarter turns are exact: the axes stay axes */
        c = nearbyint(c);
        s = nearbyint(s);
    }
    const double cross[3][3] = {{0, -a[2], a[1]}, {a[2], 0, -a[0]}, {-a[1], a[0], 0}};
    Affine result = affine_scale(c, c, c);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            result.m[i][j] += s * cross[i][j] + (1 - c) * a[i] * a[j];
    return result;
}

static void cross_normalised(const double a[3], const double b[3], double result[3])
{
    double length = 0;
    for (int i = 0; i < 3; i++) {
        result[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
        length += result[i] * result[i];
    }
    for (int i = 0; i < 3; i++)
        result[i] /= sqrt(length);
}

/* Columns left, up, forward and origin: z looks at the target. */
static Affine parse_lookat(const Node *node)
{
    double origin[3], target[3], up[3] = {0, 0, 0}, z[3], x[3], y[3], length = 0;
    parse_triple(node, "origin", false, origin);
    parse_triple(node, "target", false, target);
    if (attribute(node, "up"))
        parse_triple(node, "up", false, up);
    for (int i = 0; i < 3; i++)
        length += (target[i] - origin[i]) * (target[i] - origin[i]);
    for (int i = 0; i < 3; i++)
        z[i] = (target[i] - origin[i]) / sqrt(length);
    if (up[0] == 0 && up[1] == 0 && up[2] == 0) { /* as Mitsuba: the first axis of Duff et al. 2017 */
        double sign = z[2] >= 0 ? 1 : -1, a = -1 / (sign + z[2]);
        up[0] = 1 + sign * z[0] * z[0] * a;
        up[1] = sign * z[0] * z[1] * a;
        up[2] = -sign * z[0];
    }
    cross_normalised(up, z, x);
    cross_normalised(z, x, y);
    if (!isfinite(x[0] + x[1] + x[2] + y[0] + y[1] + y[2]))
        fail(node, "<lookat>: the target is the origin, or \"up\" points along the view");
    Affine result;
    for (int i = 0; i < 3; i++) {
        const double row[4] = {x[i], y[i], z[i], origin[i]};
        memcpy(result.m[i], row, sizeof row);
    }
    return result;
}

static Affine parse_matrix(const Node *node)
{
    double numbers[16];
    Affine result = affine_identity();
    const char *text = attribute(node, "value");
    int count = count_numbers(text), side = count == 9 ? 3 : 4;
    if (count != 9 && count != 16)
        fail(node, "<matrix>: 16 numbers are wanted, or 9, not %d", count);
    parse_numbers(node, text, numbers);
    if (count == 16 && (numbers[12] != 0 || numbers[13] != 0 || numbers[14] != 0 || numbers[15] != 1))
        fail(node, "<matrix>: the last row must be 0 0 0 1");
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < side; j++)
            result.m[i][j] = numbers[side * i + j];
    return result;
}

static Affine parse_step(const Node *node)
{
    double v[3] = {0, 0, 0}, s[3] = {1, 1, 1};
    if (strcmp(node->tag, "translate") == 0) {
        parse_xyz(node, false, v);
        return affine_translate(v[0], v[1], v[2]);
    }
    if (strcmp(node->tag, "scale") == 0) {
        parse_xyz(node, false, s);
        return affine_scale(s[0], s[1], s[2]);
    }
    if (strcmp(node->tag, "rotate") == 0)
        return parse_rotate(node);
    if (strcmp(node->tag, "lookat") == 0)
        return parse_lookat(node);
    if (strcmp(node->tag, "matrix") == 0)
        return parse_matrix(node);
    fail(node, "<%s> is not supported in <transform> (translate, rotate, scale, lookat, matrix)", node->tag);
}

static Affine parse_transform(const Node *node)
{
    Affine result = affine_identity();
    double size = 1;
    for (const Node *step = node->first; step; step = step->next) {
        if (step->first)
            fail(step->first, "<%s> cannot stand in <%s>", step->first->tag, step->tag);
        result = affine_multiply(parse_step(step), result);
    }
    for (int j = 0; j < 3; j++)
        size *= sqrt(result.m[0][j] * result.m[0][j] + result.m[1][j] * result.m[1][j]
                     + result.m[2][j] * result.m[2][j]);
    if (!(fabs(affine_determinant(result)) > 1e-10 * size) || !(size >= DBL_MIN && size <= DBL_MAX))
        fail(node, "the transform is singular: it makes things flat, or has no inverse in floating point");
    return result;
}

/* Properties. */

/* A range is written as one reads it, "(0,180)" or "[0,inf)". */
static void check_range(const Property *property, double value)
{
    char *end;
    const char *range = property->range;
    double low = strtod(range + 1, &end), high = strtod(end + 1, &end);
    if (value < low || value > high || (*range == '(' && value <= low) || (*end == ')' && value >= high))
        fail(property->node, "\"%s\" must be in %s, not %.9g", property->name, range, value);
}

static void check_choice(const Property *property, const char *value)
{
    Text list = {0};
    if (find_word(property->range, value))
        return;
    append_words(&list, "", property->range, "");
    fail(property->node, "\"%s\" = \"%.80s\" is not supported (%s)", property->name, value, list.text);
}

/* Indices of refraction by Mitsuba's names, at 589.3 nm. */
static const struct {
    const char *name;
    double ior;
} media[] = {
    {"vacuum", 1}, {"helium", 1.000036}, {"hydrogen", 1.000132}, {"air", 1.000277},
    {"carbon dioxide", 1.00045}, {"water", 1.3330}, {"acetone", 1.36}, {"ethanol", 1.361},
    {"carbon tetrachloride", 1.461}, {"glycerol", 1.4729}, {"benzene", 1.501}, {"silicone oil", 1.52045},
    {"bromine", 1.661}, {"water ice", 1.31}, {"fused quartz", 1.458}, {"pyrex", 1.470},
    {"acrylic glass", 1.49}, {"polypropylene", 1.49}, {"bk7", 1.5046}, {"sodium chloride", 1.544},
    {"amber", 1.55}, {"pet", 1.5750}, {"diamond", 2.419},
};

/* An index of refraction: a number, or as <string> the name of a medium. */
static double parse_ior(const Node *node, const char *text)
{
    Text list = {0};
    if (strcmp(node->tag, "string") != 0)
        return parse_real(node, text);
    for (int i = 0; i < COUNT(media); i++)
        if (strcmp(media[i].name, text) == 0)
            return media[i].ior;
    for (int i = 0; i < COUNT(media); i++) {
        append(&list, i ? ", " : "", i ? 2 : 0);
        append(&list, media[i].name, strlen(media[i].name));
    }
    fail(node, "no medium is called \"%.80s\" (%s)", text, list.text);
}

static void read_property(const Property *property)
{
    const Node *node = property->node;
    const char *text = attribute(node, "value");
    double *numbers = property->to;
    int numbers_read = 0;
    switch (property->kind) {
    case AS_FLOAT:
        numbers[0] = parse_real(node, text);
        numbers_read = 1;
        break;
    case AS_IOR:
        numbers[0] = parse_ior(node, text);
        numbers_read = 1;
        break;
    case AS_COLOUR:
        if (strcmp(node->tag, "rgb") == 0)
            parse_triple(node, "value", true, numbers);
        else
            numbers[0] = numbers[1] = numbers[2] = parse_real(node, text);
        numbers_read = 3;
        break;
    case AS_VECTOR:
        parse_xyz(node, true, numbers);
        numbers_read = 3;
        break;
    case AS_INTEGER:
        *(int *)property->to = parse_integer(node, text);
        if (property->range)
            check_range(property, *(int *)property->to);
        break;
    case AS_BOOLEAN:
        *(bool *)property->to = parse_boolean(node, text);
        break;
    case AS_STRING:
        *(const char **)property->to = text;
        if (property->range)
            check_choice(property, text);
        break;
    case AS_TRANSFORM:
        *(Affine *)property->to = parse_transform(node);
        break;
    }
    for (int i = 0; property->range && i < numbers_read; i++)
        check_range(property, numbers[i]);
}

/* What an element takes, for a message. */
static const char *taken(const Property *properties, int count, const char *objects)
{
    Text list = {0};
    for (int i = 0; i < count; i++)
        append_words(&list, "", properties[i].name, "");
    append_words(&list, "<", objects, ">");
    return list.length ? list.text : "none";
}

static Property *find_property(const Node *node, Property *properties, int count, const char *objects)
{
    const char *name = attribute(node, "name");
    for (int i = 0; i < count; i++)
        if (strcmp(properties[i].name, name) == 0)
            return &properties[i];
    fail(node, "%s has no property \"%.80s\" (%s)", describe(node->parent), name,
         taken(properties, count, objects));
}

void read_properties(const Node *node, Property *properties, int count, const char *objects)
{
    for (const Node *child = node->first; child; child = child->next) {
        bool is_property = false;
        for (int i = 0; i < COUNT(elements_of_kind); i++)
            is_property = is_property || gives(child, (PropertyKind)i);
        if (!is_property && find_word(objects, child->tag))
            continue;
        if (!is_property)
            fail(child, "<%s> is not supported in %s (%s)", child->tag, describe(node),
                 taken(properties, count, objects));
        Property *property = find_property(child, properties, count, objects);
        if (property->node)
            fail(child, "\"%s\" is given twice, first in line %d", property->name, property->node->line);
        if (!gives(child, property->kind))
            fail(child, "\"%s\" must be given as %s, not as <%s>", property->name,
                 elements_of_kind[property->kind], child->tag);
        if (child->first && property->kind != AS_TRANSFORM)
            fail(child->first, "<%s> cannot stand in <%s>", child->first->tag, child->tag);
        property->node = child;
        read_property(property);
    }
}
