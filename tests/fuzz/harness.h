/* Included before every source file that a fuzz target is made of (-include): an error ends the input, not the
   program, and all that the input left in memory is freed. */
#pragma once

#include <expat.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* Runs `read` on the input; returns when it does, or at its first error. */
void fuzz_run(void (*read)(const uint8_t *bytes, size_t size), const uint8_t *bytes, size_t size);

void *fuzz_calloc(size_t count, size_t size);
void *fuzz_realloc(void *block, size_t size);
void fuzz_free(void *block);
void fuzz_exit(int status) __attribute__((noreturn));
FILE *fuzz_open(const char *name, const char *mode); /* the input for "scene.xml", a triangle for a mesh, a bsdf for another scene */
int fuzz_close(FILE *stream);
XML_Parser fuzz_parser(const XML_Char *encoding);
extern FILE *fuzz_messages; /* goes nowhere */

#define calloc fuzz_calloc
#define realloc fuzz_realloc
#define free fuzz_free
#define exit fuzz_exit
#define fopen fuzz_open
#define fclose fuzz_close
#define XML_ParserCreate fuzz_parser
#undef stderr
#define stderr fuzz_messages
