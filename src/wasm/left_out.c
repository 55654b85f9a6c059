/* What oneray in WebAssembly does without: pictures that are read or written, figures of a run
   (--stats) and packed meshes. It takes scenes
   without them and writes films, into a file system that is the memory of whoever runs it. */
#include "film/output.h"
#include "film/picture.h"
#include "images/image.h"
#include "meshes/mesh.h"
#include "stats.h"

#include <errno.h>
#include <string.h>

#define HERE "oneray in WebAssembly %s"

/* Nobody else sees a file here before it is whole: it needs no temporary name. */
const char *output_reason(const char *otherwise) { return otherwise ? otherwise : strerror(errno); }
void output_failed(const char *file, const char *otherwise)
{
    die("%s: cannot be written: %s", file, output_reason(otherwise));
}
void output_check(const char *file, char *const inputs[], int input_count)
{
    for (int i = 0; i < input_count; i++)
        if (strcmp(file, inputs[i]) == 0)
            die("%s: cannot be written: it is read", file);
}
FILE *output_open(const char *file, char temporary[OUTPUT_NAME])
{
    temporary[0] = '\0';
    return fopen(file, "wb");
}
bool output_close(FILE *stream, const char *file, const char *temporary)
{
    (void)file, (void)temporary;
    bool failed = ferror(stream);
    return !fclose(stream) && !failed;
}

void picture_check_name(const char *file, double exposure)
{
    (void)exposure;
    die("%s: " HERE, file, "writes a --film, no picture");
}
void picture_check_png(const char *file) { picture_check_name(file, 0); }
void picture_write(const Film *film, double seconds, const char *kernel, double exposure, const char *file)
{
    (void)film, (void)seconds, (void)kernel;
    picture_check_name(file, exposure);
}
void picture_show(const Film *film, double exposure)
{
    (void)film;
    picture_check_name("--show", exposure);
}

const Image *image_of(Images *images, File *file, bool raw)
{
    (void)images, (void)raw;
    die("%s: " HERE, file->name, "reads no pictures");
}
void images_free(Images *images) { (void)images; }

void serialized_read(Source *source, int index, Mesh *mesh)
{
    (void)index, (void)mesh;
    die("%s: " HERE, source->file, "reads PLY and OBJ, no serialized meshes");
}

void stats_write(const Options *options, const Render *render, const Seconds *seconds)
{
    (void)render, (void)seconds;
    die("--stats %s: " HERE, options->stats, "writes a --film, no figures");
}
