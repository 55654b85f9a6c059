/* Output files appear whole or not at all: written under a temporary name in the same folder, then
   renamed. */
#pragma once

#include "message.h"

#include <stdio.h>

enum { OUTPUT_NAME = 4096 };

/* Ends the program unless `file` can be written, and if it is one of the files that are read: nothing is
   rendered that could not be saved, and nothing is lost. */
void output_check(const char *file, char *const inputs[], int input_count);

/* A stream into a temporary file for `file`, noted so that an error or a signal removes it, and locked: what runs
   that were killed left of the same file, and so nobody has locked any more, is removed. NULL if there can be none;
   errno says why. */
FILE *output_open(const char *file, char temporary[OUTPUT_NAME]);
/* Writes what is left, and gives the file its name; or removes it, if that or anything before failed: errno says
   why. */
bool output_close(FILE *stream, const char *file, const char *temporary);
/* "FILE: cannot be written: REASON": by errno, else what is known otherwise (NULL: nothing). */
const char *output_reason(const char *otherwise);
NORETURN void output_failed(const char *file, const char *otherwise);
