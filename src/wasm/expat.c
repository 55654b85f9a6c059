/* A parser of what scene files are made of, behind expat's interface: elements, attributes, comments, processing
   instructions, CDATA, the five entities and numbered characters, in UTF-8. No DOCTYPE, no namespaces. The file is
   whole in memory; attributes are handed over as C strings that live until the handler returns. */
#include "expat.h"

#include "message.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_OPEN = 256, MOST_ATTRIBUTES = 64 };

struct XmlParser {
    void *data;
    XML_StartElementHandler start;
    XML_EndElementHandler end;
    XML_CharacterDataHandler text;
    XML_StartDoctypeDeclHandler doctype;
    char *at, *stop;              /* a copy of the file, which names and values are cut out of */
    const char *counted;          /* lines up to here are counted */
    unsigned long line;
    enum XML_Error error;
    const char *open[MOST_OPEN];  /* names of the elements around */
    int depth;
};

static const char BLANKS[] = " \t\r\n";

XML_Parser XML_ParserCreate(const char *encoding)
{
    (void)encoding;
    return allocate(1, sizeof(struct XmlParser));
}

void XML_ParserFree(XML_Parser parser) { free(parser); }
void XML_SetUserData(XML_Parser parser, void *data) { parser->data = data; }
void XML_SetElementHandler(XML_Parser parser, XML_StartElementHandler start, XML_EndElementHandler end)
{
    parser->start = start;
    parser->end = end;
}
void XML_SetCharacterDataHandler(XML_Parser parser, XML_CharacterDataHandler text) { parser->text = text; }
void XML_SetStartDoctypeDeclHandler(XML_Parser parser, XML_StartDoctypeDeclHandler doctype)
{
    parser->doctype = doctype;
}
unsigned long XML_GetCurrentLineNumber(XML_Parser parser) { return parser->line; }
enum XML_Error XML_GetErrorCode(XML_Parser parser) { return parser->error; }

const char *XML_ErrorString(enum XML_Error code)
{
    static const char *const words[] = {"none", "syntax error", "no element found", "not well-formed (invalid token)",
        "mismatched tag", "duplicate attribute", "junk after document element", "undefined entity"};
    return words[code];
}

static int wrong(XML_Parser p, enum XML_Error error)
{
    p->error = error;
    return 0;
}

/* The place that a handler, or an error, is about. */
static void count_lines(XML_Parser p, const char *to)
{
    for (; p->counted < to; p->counted++)
        p->line += *p->counted == '\n';
}

static int starts(XML_Parser p, const char *with)
{
    return (size_t)(p->stop - p->at) >= strlen(with) && memcmp(p->at, with, strlen(with)) == 0;
}

/* Goes behind the next such words, from those at the start on. */
static int skip_past(XML_Parser p, const char *start, const char *words)
{
    char *found = strstr(p->at + strlen(start), words);
    if (!found)
        return wrong(p, XML_ERROR_INVALID_TOKEN);
    p->at = found + strlen(words);
    return 1;
}

static void skip_blanks(XML_Parser p) { p->at += strspn(p->at, BLANKS); }

static char *put_character(char *to, unsigned long code)
{
    if (code < 0x80) {
        *to++ = (char)code;
        return to;
    }
    int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    *to++ = (char)((0xF00 >> more & 0xFF) | (int)(code >> 6 * more));
    while (more--)
        *to++ = (char)(0x80 | (code >> 6 * more & 0x3F));
    return to;
}

/* Replaces entities and blanks in a value, which never grows. */
static int decode(XML_Parser p, char *value)
{
    static const struct {
        const char *name;
        char is;
    } entities[] = {{"lt;", '<'}, {"gt;", '>'}, {"amp;", '&'}, {"apos;", '\''}, {"quot;", '"'}};
    char *to = value;
    for (const char *from = value; *from;) {
        if (*from == '<')
            return wrong(p, XML_ERROR_INVALID_TOKEN);
        if (*from != '&') {
            from += from[0] == '\r' && from[1] == '\n';
            *to++ = *from && strchr(BLANKS, *from) ? ' ' : *from;
            from++;
            continue;
        }
        char *end = NULL;
        unsigned long code = 0;
        for (size_t i = 0; i < sizeof entities / sizeof *entities; i++)
            if (strncmp(from + 1, entities[i].name, strlen(entities[i].name)) == 0) {
                code = (unsigned char)entities[i].is;
                end = (char *)(uintptr_t)from + strlen(entities[i].name);
            }
        if (from[1] == '#')
            code = from[2] == 'x' ? strtoul(from + 3, &end, 16) : strtoul(from + 2, &end, 10);
        if (!end || *end != ';' || !code || code > 0x10FFFF)
            return wrong(p, from[1] == '#' ? XML_ERROR_INVALID_TOKEN : XML_ERROR_UNDEFINED_ENTITY);
        to = put_character(to, code);
        from = end + 1;
    }
    *to = '\0';
    return 1;
}

/* A name, whose end is overwritten once what follows it is read; NULL: there is none. */
static char *take_name(XML_Parser p, size_t *length)
{
    *length = strcspn(p->at, " \t\r\n=<>/'\"&");
    char *name = p->at;
    p->at += *length;
    return *length && !strchr("-.0123456789", *name) ? name : NULL;
}

static int take_attribute(XML_Parser p, const char **attributes, int *count)
{
    size_t length;
    char *name = take_name(p, &length);
    if (!name || *count + 2 > 2 * MOST_ATTRIBUTES)
        return wrong(p, XML_ERROR_INVALID_TOKEN);
    skip_blanks(p);
    if (*p->at != '=')
        return wrong(p, XML_ERROR_INVALID_TOKEN);
    p->at++;
    skip_blanks(p);
    char quote = *p->at, *value = p->at + 1;
    char *end = quote == '"' || quote == '\'' ? strchr(value, quote) : NULL;
    if (!end)
        return wrong(p, XML_ERROR_INVALID_TOKEN);
    count_lines(p, end);
    *end = name[length] = '\0';
    p->at = end + 1;
    for (int i = 0; i < *count; i += 2)
        if (strcmp(attributes[i], name) == 0)
            return wrong(p, XML_ERROR_DUPLICATE_ATTRIBUTE);
    attributes[(*count)++] = name;
    attributes[(*count)++] = value;
    return decode(p, value);
}

/* From "<NAME" to its ">" or "/>". */
static int take_start(XML_Parser p)
{
    const char *attributes[2 * MOST_ATTRIBUTES + 1] = {0};
    unsigned long line = p->line, last;
    int count = 0, closed;
    size_t length, blanks;
    p->at++;
    char *name = take_name(p, &length);
    if (!name || p->depth == MOST_OPEN)
        return wrong(p, XML_ERROR_INVALID_TOKEN);
    while ((blanks = strspn(p->at, BLANKS)), !strchr("/>", p->at[blanks])) {
        p->at += blanks;
        if (!blanks || !take_attribute(p, attributes, &count))
            return p->error ? 0 : wrong(p, XML_ERROR_INVALID_TOKEN);
    }
    p->at += blanks;
    count_lines(p, p->at);
    closed = *p->at == '/';
    if (p->at[closed] != '>')
        return wrong(p, XML_ERROR_INVALID_TOKEN);
    p->at += closed + 1;
    name[length] = '\0';
    p->open[p->depth++] = name;
    last = p->line;
    p->line = line; /* an element's line is that of its "<" */
    p->start(p->data, name, attributes);
    if (closed)
        p->end(p->data, p->open[--p->depth]);
    p->line = last;
    return 1;
}

static int take_end(XML_Parser p)
{
    size_t length;
    p->at += 2;
    char *name = take_name(p, &length);
    if (!name || !p->depth || strlen(p->open[p->depth - 1]) != length
        || memcmp(p->open[p->depth - 1], name, length) != 0)
        return wrong(p, XML_ERROR_TAG_MISMATCH);
    skip_blanks(p);
    if (*p->at++ != '>')
        return wrong(p, XML_ERROR_INVALID_TOKEN);
    p->end(p->data, p->open[--p->depth]);
    return 1;
}

static int take_text(XML_Parser p)
{
    size_t length = strcspn(p->at, "<");
    if (p->depth && p->text)
        p->text(p->data, p->at, (int)length);
    else if (strspn(p->at, BLANKS) < length)
        return wrong(p, XML_ERROR_SYNTAX);
    p->at += length;
    return 1;
}

enum XML_Status XML_Parse(XML_Parser p, const char *bytes, int size, int is_final)
{
    int elements = 0, done = 1;
    (void)is_final;
    char *copy = allocate((size_t)size + 1, 1);
    memcpy(copy, bytes, (size_t)size);
    p->at = copy;
    p->stop = copy + size;
    p->counted = copy;
    p->line = 1;
    if (starts(p, "\xEF\xBB\xBF"))
        p->at += 3;
    while (done && p->at < p->stop) {
        count_lines(p, p->at);
        if (starts(p, "<!--"))
            done = skip_past(p, "<!--", "-->");
        else if (starts(p, "<?"))
            done = skip_past(p, "<?", "?>");
        else if (starts(p, "<!DOCTYPE"))
            p->doctype(p->data, "", NULL, NULL, 0), done = wrong(p, XML_ERROR_SYNTAX);
        else if (p->depth && starts(p, "<![CDATA["))
            done = skip_past(p, "<![CDATA[", "]]>");
        else if (starts(p, "</"))
            done = take_end(p);
        else if (*p->at != '<')
            done = take_text(p);
        else if (!p->depth && elements++)
            done = wrong(p, XML_ERROR_JUNK_AFTER_DOC_ELEMENT);
        else
            done = take_start(p);
    }
    count_lines(p, p->at < p->stop ? p->at : p->stop);
    if (done && (p->depth || !elements))
        done = wrong(p, p->depth ? XML_ERROR_INVALID_TOKEN : XML_ERROR_NO_ELEMENTS);
    free(copy);
    return done ? XML_STATUS_OK : XML_STATUS_ERROR;
}
