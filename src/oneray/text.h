/* Words and numbers as files write them, and messages that list them. */
#pragma once

#include "message.h"

/* A text that grows. */
typedef struct { char *text; size_t length; } Text;

void append(Text *text, const char *format, ...) PRINTF_LIKE(2, 3);
void append_word(Text *list, const char *word);         /* behind a comma, if it is not empty */

/* Which word of a list it is, "some, words", or -1. */
int find_word(const char *list, const char *word);

/* A number and nothing else: neither nan, inf nor hexadecimal. */
bool is_number(const char *text, size_t length, double *value);
