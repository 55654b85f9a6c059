/* Output files appear whole or not at all: written under a temporary name in the same folder, then
   renamed. */
#pragma once

#include <stdio.h>

enum { OUTPUT_NAME = 4096 };

/* Ends the program unless `file` can be written, and if it is one of the files that are read: nothing is
   rendered that could not be saved, and nothing is lost. */
void output_check(const char *file, char *const inputs[], int input_count);

/* The temporary name for `file`, noted so that an error or a signal removes it. */
void output_name(const char *file, char temporary[OUTPUT_NAME]);
/* A stream into that, and its end. */
FILE *output_open(const char *file, char temporary[OUTPUT_NAME]);
void output_close(FILE *stream, const char *file, const char *temporary);
void output_done(const char *file, const char *temporary); /* syncs it and gives it its name */
void output_failed(const char *file)
    __attribute__((noreturn)); /* "FILE: cannot be written: reason" from errno */
