#include "film/output.h"

#include "message.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

const char *output_reason(const char *otherwise)
{
    return errno || !otherwise ? strerror(errno ? errno : EIO) : otherwise;
}

void output_failed(const char *file, const char *otherwise)
{
    die("%s: cannot be written: %s", file, output_reason(otherwise));
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
            output_failed(file, "too many links");
        }
        link[length = (size_t)got] = '\0';
        name = link;
        /* What does not begin at the root begins in the link's folder. */
        const char *slash = link[0] == '/' ? NULL : strrchr(target, '/');
        folder = slash ? (size_t)(slash - target) + 1 : 0;
    }
}

/* What killed runs left of the file: TARGET.PID.part that nobody has locked. */
static void sweep(const char *target)
{
    char left[OUTPUT_NAME];
    const char *slash = strrchr(target, '/'), *name = slash ? slash + 1 : target;
    size_t length = strlen(name), folder = (size_t)(name - target);
    snprintf(left, sizeof left, "%.*s.", (int)folder, target);
    DIR *listed = opendir(left);
    for (struct dirent *entry; listed && (entry = readdir(listed));) {
        const char *rest = entry->d_name + length;
        if (strncmp(entry->d_name, name, length) || *rest != '.' || !isdigit((unsigned char)rest[1])
            || strcmp(rest + 1 + strspn(rest + 1, "0123456789"), ".part")
            || snprintf(left, sizeof left, "%.*s%s", (int)folder, target, entry->d_name) >= OUTPUT_NAME)
            continue;
        int descriptor = open(left, O_WRONLY | O_NONBLOCK);
        if (descriptor >= 0 && lockf(descriptor, F_TLOCK, 0) == 0)
            unlink(left);
        if (descriptor >= 0)
            close(descriptor);
    }
    if (listed)
        closedir(listed);
}

/* The temporary file, locked; -1 if there can be none. */
static int open_locked(const char *temporary)
{
    for (;;) {
        struct stat status;
        int descriptor = open(temporary, O_WRONLY | O_CREAT | O_EXCL, 0666);
        if (descriptor < 0 || (lockf(descriptor, F_TLOCK, 0), fstat(descriptor, &status)) || status.st_nlink)
            return descriptor;
        close(descriptor); /* another run swept it away before it was locked */
    }
}

FILE *output_open(const char *file, char temporary[OUTPUT_NAME])
{
    char target[OUTPUT_NAME];
    target_of(file, target);
    int length = snprintf(temporary, OUTPUT_NAME, "%s.%ld.part", target, (long)getpid());
    if (length < 0 || length >= OUTPUT_NAME)
        die("%s: the file name is too long", file);
    sweep(target);
    int descriptor = open_locked(temporary);
    if (descriptor < 0)
        return NULL;
    unfinished_file(temporary);
    errno = 0;
    return fdopen(descriptor, "wb");
}

bool output_close(FILE *stream, const char *file, const char *temporary)
{
    char target[OUTPUT_NAME];
    int reason = errno;
    target_of(file, target);
    errno = reason;
    bool done = !ferror(stream) && !fflush(stream) && !fsync(fileno(stream)) && !rename(temporary, target);
    reason = errno;
    if (!done)
        unlink(temporary);
    fclose(stream);
    unfinished_file(NULL);
    errno = reason;
    return done;
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
    FILE *stream = output_open(file, temporary);
    if (!stream)
        output_failed(file, NULL);
    fclose(stream);
    unlink(temporary);
    unfinished_file(NULL);
}
