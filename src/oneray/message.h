/* Errors and warnings: one line on standard error; an error ends the program with exit status 2, at once or after the
   others of a file, a bug with 70. */
#pragma once

#if defined(__GNUC__)
#define PRINTF_LIKE(text, first) __attribute__((format(printf, text, first)))
#define NORETURN __attribute__((noreturn))
#else
#define PRINTF_LIKE(text, first)
#define NORETURN
#endif

#include <stdbool.h>
#include <stddef.h>

/* Say "FILE:LINE: …", "oneray: …" and "oneray: warning: …". */
NORETURN void die_at(const char *file, int line, const char *format, ...) PRINTF_LIKE(3, 4);
#define die(...) die_at(NULL, 0, __VA_ARGS__)
/* Of what has no end: the others of the file are not waited for. */
NORETURN void end_at(const char *file, int line, const char *format, ...) PRINTF_LIKE(3, 4);
/* What must not be, and the command that was called with these words, so that it can be repeated. */
void called_with(char **words);
NORETURN void bug(const char *format, ...) PRINTF_LIKE(1, 2);
void warn(const char *format, ...) PRINTF_LIKE(1, 2);
void warn_at(const char *file, int line, const char *format, ...) PRINTF_LIKE(3, 4); /* … FILE:LINE: … */
typedef struct {
    const char *file;
    int line;
} Place;
/* What stands at a place, or at whatever has a file and a line, is wrong. */
#define fail(at, ...) die_at((at)->file, (at)->line, __VA_ARGS__)
#define note(at, ...) warn_at((at)->file, (at)->line, __VA_ARGS__)

/* Takes a step of reading a file. What is found wrong in it is said, and then ends the step alone: false. give_up() ends
   it without another word, where one was said before. Steps may be within steps. */
bool attempt(void (*step)(void *), void *what);
NORETURN void give_up(void);
/* Ends the program if anything was found wrong. */
void end_if_wrong(void);
int warnings_given(void);

/* A file that is being written under a temporary name: removed by die(), and by a signal. NULL when there is
   none. */
void unfinished_file(const char *temporary_name);

/* From now on the first SIGINT or SIGTERM only makes interrupted() true; the second ends the program. One that is
   ignored stays so. die_interrupted() ends the program as the signal would have. */
void heed_interrupt(void);
bool interrupted(void);
NORETURN void die_interrupted(void);

/* malloc and realloc that never return NULL: out of memory is an error like any other. */
void *allocate(size_t count, size_t size);
void *reallocate(void *block, size_t count, size_t size);

/* Rows with room for one more behind the first `count`; the room doubles. PUSH puts it there. */
void *room_for(void *rows, int count, size_t size);
#define PUSH(rows, count, row) ((rows) = room_for((rows), (count), sizeof *(rows)), (rows)[(count)++] = (row))
