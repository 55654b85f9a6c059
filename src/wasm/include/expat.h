/* As much of expat's interface as the reader of scenes uses, over a small parser of its own (expat.c). */
#pragma once

#define XMLCALL

typedef struct XmlParser *XML_Parser;
typedef char XML_Char;
enum XML_Status { XML_STATUS_ERROR, XML_STATUS_OK };
enum XML_Error {
    XML_ERROR_NONE,
    XML_ERROR_SYNTAX,
    XML_ERROR_NO_ELEMENTS,
    XML_ERROR_INVALID_TOKEN,
    XML_ERROR_TAG_MISMATCH,
    XML_ERROR_DUPLICATE_ATTRIBUTE,
    XML_ERROR_JUNK_AFTER_DOC_ELEMENT,
    XML_ERROR_UNDEFINED_ENTITY
};

typedef void (*XML_StartElementHandler)(void *data, const char *tag, const char **attributes);
typedef void (*XML_EndElementHandler)(void *data, const char *tag);
typedef void (*XML_CharacterDataHandler)(void *data, const char *text, int length);
typedef void (*XML_StartDoctypeDeclHandler)(
    void *data, const char *name, const char *system, const char *public, int has_subset);

XML_Parser XML_ParserCreate(const char *encoding);
void XML_ParserFree(XML_Parser parser);
void XML_SetUserData(XML_Parser parser, void *data);
void XML_SetElementHandler(XML_Parser parser, XML_StartElementHandler start, XML_EndElementHandler end);
void XML_SetCharacterDataHandler(XML_Parser parser, XML_CharacterDataHandler text);
void XML_SetStartDoctypeDeclHandler(XML_Parser parser, XML_StartDoctypeDeclHandler doctype);
enum XML_Status XML_Parse(XML_Parser parser, const char *bytes, int size, int is_final);
unsigned long XML_GetCurrentLineNumber(XML_Parser parser);
enum XML_Error XML_GetErrorCode(XML_Parser parser);
const char *XML_ErrorString(enum XML_Error code);
