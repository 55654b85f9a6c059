#include "text.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void append(Text *text, const char *format, ...)
{
    va_list words, again;
    va_start(words, format);
    va_copy(again, words);
    size_t more = (size_t)vsnprintf(NULL, 0, format, words);
    text->text = reallocate(text->text, text->length + more + 1, 1);
    vsnprintf(text->text + text->length, more + 1, format, again);
    text->length += more;
    va_end(words);
    va_end(again);
}

void append_word(Text *list, const char *word)
{
    if (*word)
        append(list, "%s%s", list->length ? ", " : "", word);
}

int find_word(const char *list, const char *word)
{
    for (int number = 0;; number++) {
        size_t length = strcspn(list, ",");
        if (strlen(word) == length && strncmp(list, word, length) == 0)
            return number;
        if (!list[length])
            return -1;
        list += length + strlen(", ");
    }
}

bool is_number(const char *text, size_t length, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return length && strspn(text, "+-.0123456789eE") >= length && end == text + length;
}
