#include "output.h"

#include "message.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

void output_failed(const char *file)
{
    die("%s: cannot be written: %s", file, strerror(errno ? errno : EIO));
}

void output_name(const char *file, char temporary[OUTPUT_NAME])
{
    int length = snprintf(temporary, OUTPUT_NAME, "%s.%ld.part", file, (long)getpid());
    if (length < 0 || length >= OUTPUT_NAME)
        die("%s: the file name is too long", file);
    unfinished_file(temporary);
    errno = 0;
}

void output_check(const char *file)
{
    struct stat status;
    char temporary[OUTPUT_NAME];
    if (stat(file, &status) == 0 && !S_ISREG(status.st_mode))
        die("%s: cannot be written: it is %s, not a file", file,
            S_ISDIR(status.st_mode) ? "a folder" : "a device");
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
    int descriptor = open(temporary, O_WRONLY);
    if (descriptor < 0 || fsync(descriptor) || close(descriptor) || rename(temporary, file))
        output_failed(file);
    unfinished_file(NULL);
}
