/* oneray for many seeds in one process: the options of oneray, then on standard input lines "spp seed", and on
   standard output an image for each, width · height · 3 floats, row by row from the top. Calibration renders
   hundreds of thousands of small images, and starting a process for each takes longer than most of them. */
#include "film/film.h"
#include "message.h"
#include "options.h"
#include "scene/precision.h"
#include "render.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int count, char **words)
{
    Options options = options_read(count, words);
    Description *scene =
        description_read(options.scene, options.parameters, options.parameter_count, options.sensor, options.size);
    options_check(&options, scene);
    if (!strcmp(options.precision, "auto"))
        options.precision =
            precision_for(scene, options.precision_reason, (int)sizeof options.precision_reason);
    const Kernel *kernel = options_kernel(&options);
    void *prepared = kernel->prepare(scene, &options.technique);
    int width = scene->sensor.frame.width, height = scene->sensor.frame.height;
    size_t numbers = 3 * (size_t)width * (size_t)height;
    float *mean = allocate(numbers, sizeof *mean), *error = allocate(numbers, sizeof *error);
    while (scanf("%" SCNu64 " %" SCNu64, &options.spp, &options.seed) == 2) {
        Render r = {.options = &options, .scene = scene, .kernel = kernel, .prepared = prepared};
        r.film.window = (Window){width, height, 0, 0, width, height};
        render_image(&r);
        film_estimate(&r.film, mean, error);
        if (fwrite(mean, sizeof *mean, numbers, stdout) != numbers)
            die("the images cannot be written");
        film_free(&r.film);
    }
    free(mean);
    free(error);
    kernel->release(prepared);
    description_free(scene);
    return 0;
}
