#include "film/output.h"

#include "message.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

void output_failed(const char *file)
{
    die("%s: cannot be written: %s", file, strerror(errno ? errno : EIO));
}

/* The file that a symbolic link leads to, also where there is none yet; else the name as it is. */
static void target_of(const char *file, char target[OUTPUT_NAME])
{
    enum { MOST_LINKS = 40 };
    struct stat status;
    char link[OUTPUT_NAME];
    size_t length = strlen(file), folder = 0;
    const char *name = file;
    for (int links = 0;; links++) {
        if (folder + length >= OUTPUT_NAME)
            die("%s: the file name is too long", file);
        memcpy(target + folder, name, length + 1);
        if (lstat(target, &status) || !S_ISLNK(status.st_mode))
            return;
        ssize_t got = links < MOST_LINKS ? readlink(target, link, sizeof link - 1) : -1;
        if (got < 0) {
            errno = links < MOST_LINKS ? errno : ELOOP;
            output_failed(file);
        }
        link[length = (size_t)got] = '\0';
        name = link;
        /* What does not begin at the root begins in the link's folder. */
        const char *slash = link[0] == '/' ? NULL : strrchr(target, '/');
        folder = slash ? (size_t)(slash - target) + 1 : 0;
    }
}

void output_name(const char *file, char temporary[OUTPUT_NAME])
{
    char target[OUTPUT_NAME];
    target_of(file, target);
    int length = snprintf(temporary, OUTPUT_NAME, "%s.%ld.part", target, (long)getpid());
    if (length < 0 || length >= OUTPUT_NAME)
        die("%s: the file name is too long", file);
    unfinished_file(temporary);
    errno = 0;
}

void output_check(const char *file, char *const inputs[], int input_count)
{
    struct stat status, input;
    char temporary[OUTPUT_NAME];
    if (stat(file, &status) == 0 && !S_ISREG(status.st_mode))
        die("%s: cannot be written: it is %s, not a file", file,
            S_ISDIR(status.st_mode) ? "a folder" : "a device");
    for (int i = 0; i < input_count; i++)
        if (stat(file, &status) == 0 && stat(inputs[i], &input) == 0 && status.st_dev == input.st_dev
            && status.st_ino == input.st_ino)
            die("%s: cannot be written: it is read as %s", file, inputs[i]);
    output_name(file, temporary);
    int descriptor = open(temporary, O_WRONLY | O_CREAT | O_EXCL, 0666);
    if (descriptor < 0)
        output_failed(file);
    close(descriptor);
    unlink(temporary);
    unfinished_file(NULL);
}

void output_done(const char *file, const char *temporary)
{
    char target[OUTPUT_NAME];
    target_of(file, target);
    int descriptor = open(temporary, O_WRONLY);
    if (descriptor < 0 || fsync(descriptor) || close(descriptor) || rename(temporary, target))
        output_failed(file);
    unfinished_file(NULL);
}

FILE *output_open(const char *file, char temporary[OUTPUT_NAME])
{
    output_name(file, temporary);
    FILE *stream = fopen(temporary, "wb");
    if (!stream)
        output_failed(file);
    return stream;
}

void output_close(FILE *stream, const char *file, const char *temporary)
{
    int bad = ferror(stream);
    if (fclose(stream) || bad)
        output_failed(file);
    output_done(file, temporary);
}
