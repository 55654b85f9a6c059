#include "message.h"

#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The one thing a signal handler must know, so the one global that changes. */
static char unfinished[4096];
static volatile sig_atomic_t is_unfinished;

static void on_signal(int number)
{
    if (is_unfinished)
        unlink(unfinished);
    signal(number, SIG_DFL);
    raise(number);
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
    const int signals[] = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++)
        if (signal(signals[i], on_signal) == SIG_IGN)
            signal(signals[i], SIG_IGN);        /* as under nohup */
    signal(SIGXFSZ, SIG_IGN);                   /* a file that may not grow is an error of the write */
}

static void say(const char *prefix, const char *format, va_list arguments)
{
    fflush(stdout);
    fputs(prefix, stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
}

NORETURN static void give_up(void)
{
    if (is_unfinished)
        unlink(unfinished);
    exit(2);
}

void die(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say("oneray: ", format, arguments);
    va_end(arguments);
    give_up();
}

void die_at(const char *file, int line, const char *format, ...)
{
    va_list arguments;
    fprintf(stderr, "%s:%d: ", file, line);
    va_start(arguments, format);
    say("", format, arguments);
    va_end(arguments);
    give_up();
}

void warn(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say("oneray: warning: ", format, arguments);
    va_end(arguments);
}

void *allocate(size_t count, size_t size)
{
    void *block = calloc(count ? count : 1, size);
    if (!block)
        die("out of memory (%zu x %zu bytes asked for)", count, size);
    return block;
}

void *reallocate(void *block, size_t count, size_t size)
{
    block = size && count > SIZE_MAX / size ? NULL : realloc(block, count * size);
    if (!block)
        die("out of memory (%zu x %zu bytes asked for)", count, size);
    return block;
}

void *room_for(void *rows, int count, size_t size)
{
    return (count & (count - 1)) == 0 ? reallocate(rows, 2 * (size_t)count + 1, size) : rows;
}
