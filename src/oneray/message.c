#define _DEFAULT_SOURCE /* madvise */
#include "message.h"

#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __linux__
#include <sys/mman.h>
#endif
#include <unistd.h>

/* What a signal handler must know, so the only globals that change. */
static char unfinished[4096];
static volatile sig_atomic_t is_unfinished, heeded, stop; /* stop: the signal that asked for it, or 0 */
/* And what a bug's message ends with. */
static char **called;
/* Where reading goes on behind an error, how many there were, and how many warnings. */
static jmp_buf *behind_error;
static int errors, warnings;

enum { MOST_ERRORS = 50 };

enum { EXIT_WRONG = 2, EXIT_BUG = 70 }; /* EX_SOFTWARE of sysexits.h */

static void on_signal(int number)
{
    if ((number == SIGINT || number == SIGTERM) && heeded && !stop) {
        stop = number;
        return;
    }
    if (is_unfinished)
        unlink(unfinished);
    signal(number, SIG_DFL);
    raise(number);
}

/* What is ignored, as under nohup, stays ignored. */
static void handle(int number)
{
    struct sigaction now, ours = {0};
    ours.sa_handler = on_signal;
    ours.sa_flags = SA_RESTART;
    sigemptyset(&ours.sa_mask);
    if (sigaction(number, NULL, &now) == 0 && now.sa_handler != SIG_IGN)
        sigaction(number, &ours, NULL);
}

void unfinished_file(const char *temporary_name)
{
    is_unfinished = 0;
    if (!temporary_name)
        return;
    if (strlen(temporary_name) >= sizeof unfinished)
        die("%s: the file name is too long", temporary_name);
    strcpy(unfinished, temporary_name);
    is_unfinished = 1;
    handle(SIGINT);
    handle(SIGTERM);
    handle(SIGHUP);
    handle(SIGPIPE);
    signal(SIGXFSZ, SIG_IGN); /* a file that may not grow is an error of the write */
}

void heed_interrupt(void)
{
    heeded = 1;
    handle(SIGINT);
    handle(SIGTERM);
}

bool interrupted(void) { return stop != 0; }

void die_interrupted(void)
{
    int number = stop;
    signal(number, SIG_DFL);
    raise(number);
    exit(EXIT_WRONG);
}

NORETURN static void leave(int status)
{
    behind_error = NULL;
    errors = warnings = 0;
    if (is_unfinished)
        unlink(unfinished);
    exit(status);
}

static void say(const char *file, int line, const char *format, va_list arguments)
{
    fflush(stdout);
    if (file)
        fprintf(stderr, "%s:%d: ", file, line);
    else
        fputs("oneray: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
}

void end_at(const char *file, int line, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(file, line, format, arguments);
    va_end(arguments);
    leave(EXIT_WRONG);
}

void die_at(const char *file, int line, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(file, line, format, arguments);
    va_end(arguments);
    if (!file || !behind_error || ++errors == MOST_ERRORS)
        leave(EXIT_WRONG);
    give_up();
}

void give_up(void) { longjmp(*behind_error, 1); }

bool attempt(void (*step)(void *), void *what)
{
    jmp_buf here, *outer = behind_error;
    behind_error = &here;
    bool done = setjmp(here) == 0;
    if (done)
        step(what);
    behind_error = outer;
    return done;
}

void end_if_wrong(void)
{
    if (errors)
        leave(EXIT_WRONG);
}

int warnings_given(void) { return warnings; }

void called_with(char **words) { called = words; }

void bug(const char *format, ...)
{
    va_list arguments;
    fflush(stdout);
    fputs("oneray: ", stderr);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputs(": a bug, please report it; again:", stderr);
    for (char **word = called; word && *word; word++)
        fprintf(stderr, strpbrk(*word, " \t\n\"$&()*;<>?[]`{|}~") || !**word ? " '%s'" : " %s", *word);
    fputc('\n', stderr);
    leave(EXIT_BUG);
}

static void give_warning(const char *format, va_list arguments)
{
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    warnings++;
}

void warn(const char *format, ...)
{
    va_list arguments;
    fflush(stdout);
    fputs("oneray: warning: ", stderr);
    va_start(arguments, format);
    give_warning(format, arguments);
    va_end(arguments);
}

void warn_at(const char *file, int line, const char *format, ...)
{
    va_list arguments;
    fflush(stdout);
    fprintf(stderr, "oneray: warning: %s:%d: ", file, line);
    va_start(arguments, format);
    give_warning(format, arguments);
    va_end(arguments);
}

/* Asks for the large pages of the processor, where the system has some, for a block that is worth it: in a tree beyond
   its caches most rays miss its table of small ones. */
static void *in_large_pages(void *block, size_t bytes)
{
#ifdef MADV_HUGEPAGE
    const size_t page = (size_t)sysconf(_SC_PAGESIZE), before = (page - (uintptr_t)block % page) % page;
    if (bytes >= (size_t)1 << 22)
        madvise((char *)block + before, (bytes - before) / page * page, MADV_HUGEPAGE);
#else
    (void)bytes;
#endif
    return block;
}

void *allocate(size_t count, size_t size)
{
    void *block = calloc(count ? count : 1, size);
    if (!block)
        die("out of memory (%zu x %zu bytes asked for)", count, size);
    return in_large_pages(block, count * size);
}

void *reallocate(void *block, size_t count, size_t size)
{
    block = size && count > SIZE_MAX / size ? NULL : realloc(block, count * size);
    if (!block)
        die("out of memory (%zu x %zu bytes asked for)", count, size);
    return in_large_pages(block, count * size);
}

void *room_for(void *rows, int count, size_t size)
{
    return (count & (count - 1)) == 0 ? reallocate(rows, 2 * (size_t)count + 1, size) : rows;
}
