/* The properties of an element, by a table of fields: numbers, words, transforms, and their ranges. */
#include "scene/cie.h"
#include "scene/xml.h"

#include <ctype.h>
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define LARGEST 1e300
static const char SEPARATORS[] = " ,";            /* between numbers */
#define INSTEAD_OF_COLOUR "<texture>, <ref>"      /* of a reflectance */

/* The elements that may give a kind of property; and of how many numbers it is, each in the range. */
static const struct {
    const char *elements;
    int numbers;
} kinds[] = {
    [AS_FLOAT] = {"<float> or <integer>", 1}, [AS_IOR] = {"<float>, <integer> or <string>", 1},
    [AS_COLOUR] = {"<rgb>, <spectrum>, <float> or <integer>", 3},
    [AS_EMISSION] = {"<rgb>, <spectrum>, <blackbody>, <float> or <integer>", 3},
    [AS_REFLECTANCE] = {"<rgb>, <spectrum>, <float>, <integer>, <texture> or <ref>", 3}, [AS_VECTOR] = {"<point> or <vector>", 3},
    [AS_SHARE] = {"<float>, <integer>, <rgb>, <spectrum>, <texture> or <ref>", 3},
    [AS_INTEGER] = {"<integer>", 0}, [AS_BOOLEAN] = {"<boolean>", 0}, [AS_STRING] = {"<string>", 0},
    [AS_WORD] = {"<string>", 0}, [AS_TRANSFORM] = {"<transform>", 0}, [AS_FILE] = {"<string>", 0},
    [AS_ANYTHING] = {"<float>, <integer>, <boolean> or <string>", 0}};

static bool gives(const Node *node, FieldKind kind) { return is_among(node, kinds[kind].elements); }

/* Spaces may stand around it. */
static double parse_number(const Node *node, const char *text, size_t length)
{
    double value;
    while (length && *text == ' ')
        text++, length--;
    while (length && text[length - 1] == ' ')
        length--;
    if (length >= 64 || !is_number(text, length, &value))
        fail(node, "\"%.*s\" is not a number", (int)(length < 80 ? length : 80), text);
    if (!(fabs(value) <= LARGEST))
        fail(node, "%.*s is too large: %g is the largest number", (int)length, text, LARGEST);
    return value;
}

static int count_numbers(const char *text)
{
    int count = 0;
    for (text += strspn(text, SEPARATORS); *text; text += strspn(text, SEPARATORS), count++)
        text += strcspn(text, SEPARATORS);
    return count;
}

/* All of them. */
static void parse_numbers(const Node *node, const char *text, double *numbers)
{
    for (text += strspn(text, SEPARATORS); *text; text += strspn(text, SEPARATORS)) {
        size_t length = strcspn(text, SEPARATORS);
        *numbers++ = parse_number(node, text, length);
        text += length;
    }
}

/* The text of an attribute with one or three numbers; one stands for three equal ones. */
static void parse_triple(const Node *node, const char *name, const char *text, bool one_will_do, double triple[3])
{
    int count = count_numbers(text);
    if (count != 3 && !(count == 1 && one_will_do))
        fail(node, "<%s %s=\"%.80s\">: %s numbers are wanted, not %d", node->tag, name, text,
             one_will_do ? "one or three" : "three", count);
    parse_numbers(node, text, triple);
    if (count == 1)
        triple[1] = triple[2] = triple[0];
}

/* value="x y z" or x, y and z apart. Without all_needed, those left out keep what triple holds. */
static void parse_xyz(const Node *node, const char *value, bool all_needed, double triple[3])
{
    static const char *const names[] = {"x", "y", "z"};
    if (value) {
        parse_triple(node, "value", value, true, triple);
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

/* Rodrigues: R = cosθ I + sinθ [a]× + (1 − cosθ) a aᵀ. Mitsuba does not normalise the axis a, and of any other than a
   unit vector that is no rotation. */
static Affine parse_rotate(const Node *node)
{
    double a[3] = {0, 0, 0};
    const char *text = attribute(node, "angle");
    parse_xyz(node, attribute(node, "value"), false, a);
    double degrees = parse_number(node, text, strlen(text)), angle = degrees * PI / 180;
    double size = sqrt(dot(a, a));
    if (size == 0)
        fail(node, "<rotate> needs an axis: x, y and z, or value=\"x y z\"");
    if (fabs(size - 1) > 1e-3)
        note(node, "<rotate>: the axis has length %g: as in Mitsuba, which does not normalise it, that is no rotation; "
             "length 1 is", size);
    double c = cr_cos(angle), s = cr_sin(angle);
    if (fmod(degrees, 90) == 0) {               /* quarter turns are exact: the axes stay axes */
        c = nearbyint(c);
        s = nearbyint(s);
    }
    const double across[3][3] = {{0, -a[2], a[1]}, {a[2], 0, -a[0]}, {-a[1], a[0], 0}};
    Affine result = affine_scale(c, c, c);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            result.m[i][j] += s * across[i][j] + (1 - c) * a[i] * a[j];
    return result;
}

/* Columns left, up, forward and origin: z looks at the target. */
static Affine parse_lookat(const Node *node)
{
    double origin[3], target[3], up[3] = {0, 0, 0}, z[3], x[3], y[3];
    parse_triple(node, "origin", attribute(node, "origin"), false, origin);
    parse_triple(node, "target", attribute(node, "target"), false, target);
    if (attribute(node, "up"))
        parse_triple(node, "up", attribute(node, "up"), false, up);
    difference(target, origin, z);
    unit(z, z);
    if (up[0] == 0 && up[1] == 0 && up[2] == 0) { /* as Mitsuba: the first axis of Duff et al. 2017 */
        double sign = z[2] >= 0 ? 1 : -1, a = -1 / (sign + z[2]);
        up[0] = 1 + sign * z[0] * z[0] * a;
        up[1] = sign * z[0] * z[1] * a;
        up[2] = -sign * z[0];
    }
    cross(up, z, x);
    unit(x, x);
    cross(z, x, y);
    unit(y, y);
    if (!isfinite(x[0] + x[1] + x[2] + y[0] + y[1] + y[2]))
        fail(node, "<lookat>: the target is the origin, or \"up\" points along the view");
    return (Affine){{{x[0], y[0], z[0], origin[0]}, {x[1], y[1], z[1], origin[1]}, {x[2], y[2], z[2], origin[2]}}};
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
    const char *value = attribute(node, "value");
    if (strcmp(node->tag, "translate") == 0) {
        parse_xyz(node, value, false, v);
        return affine_translate(v[0], v[1], v[2]);
    }
    if (strcmp(node->tag, "scale") == 0) {
        parse_xyz(node, value, false, s);
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
        if (step->wrong)
            give_up();
        if (step->first)
            fail(step->first, "<%s> cannot stand in <%s>", step->first->tag, step->tag);
        result = affine_multiply(parse_step(step), result);
    }
    for (int j = 0; j < 3; j++) {
        double axis[3];
        column(&result, j, axis);
        size *= sqrt(dot(axis, axis));
    }
    if (!(fabs(affine_determinant(&result)) > 1e-10 * size) || !(size >= DBL_MIN && size <= DBL_MAX))
        fail(node, "the transform is singular: it makes things flat, or has no inverse in floating point");
    return result;
}

/* Fields. */

/* A range is written as one reads it, "(0,180)" or "[0,inf)". */
static void check_range(const Node *node, const Field *field, double value)
{
    char *end;
    double low = strtod(field->range + 1, &end), high = strtod(end + 1, &end);
    bool above = *field->range == '(' ? value > low : value >= low, below = *end == ')' ? value < high : value <= high;
    if (!above || !below)
        fail(node, "\"%s\" must be in %s, not %.9g", field->name, field->range, value);
}

/* Which word of the range it is. */
static int parse_word(const Node *node, const Field *field, const char *text)
{
    int found = find_word(field->range, text);
    if (found < 0)
        fail(node, "\"%s\" = \"%.80s\" is not supported (%s)", field->name, text, field->range);
    return found;
}

/* Spectra, as Mitsuba's rgb variants take them: their sRGB, of light, or of a surface or medium in the light of D65. */

static const double srgb_of_xyz[3][3] = {
    {3.240479, -1.537150, -.498535}, {-.969256, 1.875991, .041556}, {.055648, -.204043, 1.057311}};

static void xyz_to_rgb(const double xyz[3], double rgb[3])
{
    for (int i = 0; i < 3; i++)
        rgb[i] = dot(srgb_of_xyz[i], xyz);
}

/* The i-th sample of a table at the wavelength, linear between them. */
static double at_wavelength(const double *table, double wavelength)
{
    double t = (wavelength - CIE_FIRST) * ((CIE_COUNT - 1) / (CIE_LAST - CIE_FIRST));
    int i = t < CIE_COUNT - 2 ? (int)t : CIE_COUNT - 2;
    return table[i] * (1 - (t - i)) + table[i + 1] * (t - i);
}

/* ∫ x̄ S (D65) dλ and so on over the interval from one wavelength to the next, by Mitsuba's thousand steps. */
static void add_interval(const double from[2], const double to[2], bool lit, double xyz[3])
{
    const int steps = 1000;
    const double step = (CIE_LAST - CIE_FIRST) / (steps - 1);
    for (int i = (int)fmax(0, ceil((from[0] - CIE_FIRST) / step - 1)); i < steps; i++) {
        double w = CIE_FIRST + i * step, light = lit ? at_wavelength(cie_d65, w) : 1;
        if (w >= to[0] && !(w == to[0] && to[0] >= CIE_LAST))
            break;
        if (w >= from[0])
            for (int c = 0; c < 3; c++)
                xyz[c] += at_wavelength(cie_xyz[c], w) * light
                          * ((w - to[0]) * from[1] + (from[0] - w) * to[1]) / (from[0] - to[0]);
    }
}

/* The sums of add_interval and the like as sRGB, as far as that can show them. */
static void set_rgb(const Node *node, FieldKind kind, double xyz[3], double rgb[3])
{
    bool inside = true;
    for (int c = 0; c < 3; c++)
        xyz[c] *= (CIE_LAST - CIE_FIRST) * CIE_Y_NORMALIZATION / 1000;
    xyz_to_rgb(xyz, rgb);
    for (int c = 0; c < 3; c++) {
        double in = fmax(0, kind == AS_REFLECTANCE ? fmin(1, rgb[c]) : rgb[c]);
        inside = inside && in == rgb[c];
        rgb[c] = in;
    }
    if (!inside)
        note(node, "this spectrum is beyond what red, green and blue can be, and cut off there, as by Mitsuba");
}

/* Planck's law, W·m⁻²·sr⁻¹·nm⁻¹. */
static void blackbody(const Node *node, double kelvin, double scale, double rgb[3])
{
    const double c = 2.99792458e8, h = 6.62607015e-34, k = 1.380649e-23, step = (CIE_LAST - CIE_FIRST) / 1000;
    double xyz[3] = {0, 0, 0};
    for (int i = 0; i < 1000; i++) {
        double w = CIE_FIRST + (i + .5) * step, m = w * 1e-9;
        double light = scale * 2e-9 * h * c * c / (cr_pow(m, 5) * cr_expm1(h * c / (m * k * kelvin)));
        for (int one = 0; one < 3; one++)
            xyz[one] += at_wavelength(cie_xyz[one], w) * light;
    }
    set_rgb(node, AS_EMISSION, xyz, rgb);
}

/* <spectrum type="…">: of each what one number says. */
static const Plugin spectra[] = {
    {"d65", NULL, {{"scale", AS_FLOAT, 0, "[0,inf)", "1"}}},
    {"uniform", NULL, {{"value", AS_FLOAT, 0, "(-inf,inf)", "1"}}},
    {"blackbody", NULL, {{"temperature", AS_FLOAT, 0, "[1,1e6]", NULL}}}};

static void parse_typed_spectrum(const Node *node, FieldKind kind, double rgb[3])
{
    Said said;
    Text list = {0};
    if (attribute(node, "value"))
        fail(node, "%s has \"type\" and \"value\": write one or the other", describe(node));
    for (int i = 0; i < COUNT(spectra); i++) {
        append_word(&list, spectra[i].types);
        if (strcmp(spectra[i].types, attribute(node, "type")) != 0)
            continue;
        read_fields(node, spectra[i].fields, "", rgb, &said);
        rgb[1] = rgb[2] = rgb[0];
        if (strcmp(said.type, "blackbody") == 0 && kind != AS_EMISSION)
            fail(node, "%s is light, and no reflectance", describe(node));
        if (strcmp(said.type, "blackbody") == 0)
            blackbody(node, rgb[0], 1, rgb);
        return;
    }
    fail(node, "%s is not supported (%s)", describe(node), list.text);
}

/* <blackbody temperature="5000K"/> of Mitsuba 0. */
static void parse_blackbody(const Node *node, double rgb[3])
{
    const char *text = attribute(node, "temperature"), *scale = attribute(node, "scale");
    size_t length = strlen(text);
    double kelvin = parse_number(node, text, length - (length && tolower((unsigned char)text[length - 1]) == 'k'));
    if (!(kelvin >= 1 && kelvin <= 1e6))
        fail(node, "\"temperature\" must be in [1,1e6], not %g", kelvin);
    note(node, "<blackbody> is read as <spectrum type=\"blackbody\">, which Mitsuba 3 wants");
    blackbody(node, kelvin, scale ? parse_number(node, scale, strlen(scale)) : 1, rgb);
}

/* value="400:0.1, 700:0.2", wavelengths in nm and values that are linear between, or one for all. */
static void parse_spectrum(const Node *node, const char *text, FieldKind kind, double rgb[3])
{
    double last[2] = {0, 0}, xyz[3] = {1, 1, 1};
    if (!strchr(text, ':') && count_numbers(text) == 3) {
        note(node, "three numbers in <spectrum> are read as <rgb>, as by Mitsuba 0: Mitsuba 3 refuses them");
        parse_numbers(node, text, rgb);
        return;
    }
    if (!strchr(text, ':')) {
        double all = parse_number(node, text, strlen(text));
        xyz_to_rgb(xyz, rgb);
        for (int c = 0; c < 3; c++)
            rgb[c] = kind == AS_EMISSION ? all * rgb[c] : all;
        return;
    }
    memset(xyz, 0, sizeof xyz);
    int count = 0;
    for (text += strspn(text, SEPARATORS); *text; text += strspn(text, SEPARATORS), count++) {
        size_t length = strcspn(text, SEPARATORS), name = strcspn(text, ":");
        if (name >= length)
            fail(node, "\"%.*s\" is not wavelength:value", (int)(length < 80 ? length : 80), text);
        double pair[2] = {parse_number(node, text, name), parse_number(node, text + name + 1, length - name - 1)};
        if (count && pair[0] <= last[0])
            fail(node, "<spectrum>: wavelengths must increase, and %g is not more than %g", pair[0], last[0]);
        if (count)
            add_interval(last, pair, kind != AS_EMISSION, xyz);
        memcpy(last, pair, sizeof last);
        text += length;
    }
    if (count < 2)
        fail(node, "<spectrum> needs two pairs wavelength:value, or one number");
    set_rgb(node, kind, xyz, rgb);
}

/* Indices of refraction by Mitsuba's names, at 589.3 nm. */
static const struct {
    const char *name;
    double ior;
} mediums[] = {
    {"vacuum", 1}, {"helium", 1.000036}, {"hydrogen", 1.000132}, {"air", 1.000277},
    {"carbon dioxide", 1.00045}, {"water", 1.3330}, {"acetone", 1.36}, {"ethanol", 1.361},
    {"carbon tetrachloride", 1.461}, {"glycerol", 1.4729}, {"benzene", 1.501}, {"silicone oil", 1.52045},
    {"bromine", 1.661}, {"water ice", 1.31}, {"fused quartz", 1.458}, {"pyrex", 1.470},
    {"acrylic glass", 1.49}, {"polypropylene", 1.49}, {"bk7", 1.5046}, {"sodium chloride", 1.544},
    {"amber", 1.55}, {"pet", 1.5750}, {"diamond", 2.419}};

/* An index of refraction: a number, or as <string> the name of a medium. */
static double parse_ior(const Node *node, const char *text)
{
    Text list = {0};
    if (strcmp(node->tag, "string") != 0)
        return parse_real(node, text);
    for (int i = 0; i < COUNT(mediums); i++)
        if (strcmp(mediums[i].name, text) == 0)
            return mediums[i].ior;
    for (int i = 0; i < COUNT(mediums); i++)
        append_word(&list, mediums[i].name);
    fail(node, "no medium is called \"%.80s\" (%s)", text, list.text);
}

/* One number, <rgb> with one or three, or a <spectrum>. */
static void parse_colour(const Node *node, const char *text, FieldKind kind, double colour[3])
{
    if (strcmp(node->tag, "blackbody") == 0)
        parse_blackbody(node, colour);
    else if (strcmp(node->tag, "spectrum") == 0 && attribute(node, "type"))
        parse_typed_spectrum(node, kind, colour);
    else if (!text)
        fail(node, "<spectrum> lacks the attribute \"value\"");
    else if (strcmp(node->tag, "spectrum") == 0)
        parse_spectrum(node, text, kind, colour);
    else if (gives(node, AS_FLOAT))
        colour[0] = colour[1] = colour[2] = parse_real(node, text);
    else
        parse_triple(node, "value", text, true, colour);
}

/* Puts the value into its place. `node` is the property, or for a default the element without it. */
static void read_value(const Node *node, const Field *field, const char *text, void *plugin)
{
    Affine nowhere;
    void *to = field->offset >= LEFT_OUT ? (void *)&nowhere : (char *)plugin + field->offset;
    switch (field->kind) {
    case AS_FLOAT: *(double *)to = parse_real(node, text); break;
    case AS_IOR: *(double *)to = parse_ior(node, text); break;
    case AS_COLOUR:
    case AS_EMISSION: parse_colour(node, text, field->kind, to); break;
    case AS_REFLECTANCE:
    case AS_SHARE: {
        double *share = ((Reflectance *)to)->most;
        parse_colour(node, text, field->kind, share);
        if (field->kind == AS_SHARE && !gives(node, AS_FLOAT)) /* a colour for a number: the mean, as in Mitsuba */
            share[0] = share[1] = share[2] = (share[0] + share[1] + share[2]) / 3;
        memcpy(((Reflectance *)to)->least, share, sizeof((Reflectance *)to)->least);
        break;
    }
    case AS_VECTOR: parse_xyz(node, text, true, to); break;
    case AS_INTEGER: *(int *)to = parse_integer(node, text); break;
    case AS_BOOLEAN: *(bool *)to = parse_boolean(node, text); break;
    case AS_STRING: *(const char **)to = text; break;
    case AS_WORD: *(int *)to = parse_word(node, field, text); break;
    case AS_TRANSFORM: *(Affine *)to = parse_transform(node); break;
    case AS_ANYTHING: break;
    case AS_FILE: ((File *)to)->name = find_file(node->scene, text); break;
    }
    if (field->range && field->kind == AS_INTEGER)
        check_range(node, field, *(int *)to);
    for (int i = 0; field->range && i < kinds[field->kind].numbers; i++)
        check_range(node, field, ((double *)to)[i]);
    if (field->offset == LEFT_OUT && attribute(node, "name"))
        note(node, "\"%s\" = \"%.80s\" is left out: it changes no mean of a pixel", attribute(node, "name"), text);
    if (field->offset == NOWHERE && *(int *)to != 0)
        note(node, "\"%s\" = \"%.80s\" is left out: pictures are written as %s", attribute(node, "name"), text,
             field->otherwise);
}

static void read_default(const Node *node, const Field *field, void *plugin)
{
    const char *elements = kinds[field->kind].elements;
    if (!field->otherwise)
        fail(node, "%s needs %.*s name=\"%s\" value=\"...\"/>", describe(node), (int)strcspn(elements, ">"), elements,
             field->name);
    if (field->kind == AS_TRANSFORM)
        *(Affine *)((char *)plugin + field->offset) = affine_identity();
    else if (*field->otherwise && field->offset < LEFT_OUT)
        read_value(node, field, field->otherwise, plugin);
}

/* What an element takes, for a message. */
static const char *taken(const Field *fields, const char *objects)
{
    Text list = {0};
    for (; fields->name; fields++)
        append_word(&list, fields->offset == LEFT_OUT ? "" : fields->name);
    append_word(&list, objects);
    return list.length ? list.text : "none";
}

bool is_share(const Node *child, const Field *fields)
{
    const char *name = attribute(child, "name");
    for (; name && is_among(child, INSTEAD_OF_COLOUR) && fields->name; fields++)
        if (fields->kind == AS_SHARE && strcmp(fields->name, name) == 0)
            return true;
    return false;
}

/* The field that a child gives; NULL if it is one of the objects. */
static const Field *find_field(const Node *child, const Field *fields, const char *objects)
{
    bool is_property = false;
    if (is_among(child, objects) && !is_share(child, fields))
        return NULL;
    for (int i = 0; i < COUNT(kinds); i++)
        is_property = is_property || (gives(child, (FieldKind)i) && !is_among(child, INSTEAD_OF_COLOUR));
    for (const Field *field = fields; field->name; field++)
        is_property = is_property || gives(child, field->kind);
    if (!is_property)
        fail(child, "<%s> is not supported in %s (%s)", child->tag, describe(child->parent), taken(fields, objects));
    const char *name = attribute(child, "name");
    if (!name)
        fail(child, "%s in %s lacks the attribute \"name\": which property it is (%s)", describe(child),
            describe(child->parent), taken(fields, objects));
    for (const Field *field = fields; field->name; field++)
        if (strcmp(field->name, name) == 0 || field->kind == AS_ANYTHING)
            return field;
    fail(child, "%s has no property \"%.80s\" (%s)", describe(child->parent), name, taken(fields, objects));
}

/* What is read of an element: a child, or what holds without a child for the field. */
typedef struct {
    Node *child;
    const Node *node;
    const Field *fields, *field;
    const char *objects;
    void *to;
    Said *said;
} Reading;

static void read_child(void *reading)
{
    const Reading *r = reading;
    Node *child = r->child;
    const Field *field = find_field(child, r->fields, r->objects);
    if (!field)
        return;
    Place *place = &r->said->place[field - r->fields];
    if (place->line && field->kind != AS_ANYTHING)
        fail(child, "\"%s\" is given twice, first in line %d", field->name, place->line);
    *place = (Place){child->file, child->line};
    if (!gives(child, field->kind))
        fail(child, "\"%s\" must be given as %s, not as <%s>", field->name, kinds[field->kind].elements, child->tag);
    bool instead = is_among(child, INSTEAD_OF_COLOUR);
    if (child->first && field->kind != AS_TRANSFORM && !instead && !attribute(child, "type"))
        fail(child->first, "<%s> cannot stand in <%s>", child->first->tag, child->tag);
    if (instead)
        ((Reflectance *)(void *)((char *)r->to + field->offset))->element = child;
    else
        read_value(child, field, attribute(child, "value"), r->to);
}

static void read_missing(void *reading)
{
    const Reading *r = reading;
    read_default(r->node, r->field, r->to);
}

void read_fields(const Node *node, const Field *fields, const char *objects, void *to, Said *said)
{
    Reading reading = {NULL, node, fields, NULL, objects, to, said};
    bool right = true;
    *said = (Said){.file = node->file, .line = node->line, .type = attribute(node, "type"), .fields = fields};
    for (reading.child = node->first; reading.child; reading.child = reading.child->next)
        right &= !reading.child->wrong && attempt(read_child, &reading);
    for (reading.field = fields; right && reading.field->name; reading.field++)
        if (!said->place[reading.field - fields].line)
            right &= attempt(read_missing, &reading);
    if (!right)
        give_up();
}
