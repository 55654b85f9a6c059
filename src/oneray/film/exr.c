/* The picture as an OpenEXR file: float32 channels R G B (mean) and stderr.R/G/B (standard error of the
   mean). */
#include "film/picture.h"

#include "film/output.h"
#include "version.h"

#include <limits.h>
#include <openexr.h>
#include <string.h>

enum { CHANNELS = 6 };
static const char *const channel_names[CHANNELS] = {"R", "G", "B", "stderr.R", "stderr.G", "stderr.B"};

/* The library would print its own lines; what went wrong is said once, by check(). */
static void silent(exr_const_context_t context, exr_result_t code, const char *text)
{
    (void)context, (void)code, (void)text;
}

/* Bytes of the file, which the library writes nearly in their order. */
static int64_t write_bytes(exr_const_context_t context, void *stream, const void *bytes, uint64_t size,
    uint64_t offset, exr_stream_error_func_ptr_t failed)
{
    (void)context;
    (void)failed;
    bool there = (uint64_t)ftello(stream) == offset || !fseeko(stream, (off_t)offset, SEEK_SET);
    return there && fwrite(bytes, 1, size, stream) == size ? (int64_t)size : -1;
}

static void check(exr_result_t result, const char *file)
{
    if (result != EXR_ERR_SUCCESS)
        output_failed(file, exr_get_error_code_as_string(result));
}

static void write_header(exr_context_t context, const Picture *picture, const char *file)
{
    int part, channels = picture->standard_error ? CHANNELS : 3;
    check(exr_add_part(context, "", EXR_STORAGE_SCANLINE, &part), file);
    /* Uncompressed: OpenEXRCore 3.1 stores a block that zip cannot make smaller, as noise often is, in a form
       that does not read back. */
    const Window *w = &picture->window;
    exr_attr_box2i_t image = {.max = {.x = w->image_width - 1, .y = w->image_height - 1}};
    exr_attr_box2i_t data = {
        .min = {.x = w->x, .y = w->y}, .max = {.x = w->x + w->width - 1, .y = w->y + w->height - 1}};
    exr_attr_v2f_t center = {.x = 0, .y = 0};
    check(exr_initialize_required_attr(
              context, part, &image, &data, 1, &center, 1, EXR_LINEORDER_INCREASING_Y, EXR_COMPRESSION_NONE),
        file);
    for (int i = 0; i < channels; i++)
        check(exr_add_channel(
                  context, part, channel_names[i], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1),
            file);
    int samples = picture->samples_per_pixel > INT_MAX ? INT_MAX : (int)picture->samples_per_pixel;
    check(exr_attr_set_int(context, part, "samplesPerPixel", samples), file);
    if (picture->render_seconds >= 0)
        check(exr_attr_set_float(context, part, "renderTimeSeconds", (float)picture->render_seconds), file);
    check(exr_attr_set_string(context, part, "oneray", picture->identity), file);
    check(exr_attr_set_string(context, part, "onerayKernel", picture->kernel), file);
    check(exr_attr_set_string(context, part, "onerayVersion", ONERAY_VERSION), file);
    check(exr_write_header(context), file);
}

/* Points the encoder's channels at the rows of this chunk, the first of them counted from the window's. */
static void aim(exr_encode_pipeline_t *encoder, const Picture *picture, int first_row)
{
    for (int i = 0; i < encoder->channel_count; i++) {
        exr_coding_channel_info_t *channel = &encoder->channels[i];
        int which = 0;
        while (strcmp(channel->channel_name, channel_names[which]))
            which++;
        const float *from = which < 3 ? picture->mean + which : picture->standard_error + which - 3;
        channel->encode_from_ptr =
            (const uint8_t *)(from + (size_t)first_row * (size_t)picture->window.width * 3);
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_pixel_stride = 3 * (int)sizeof(float);
        channel->user_line_stride = picture->window.width * 3 * (int)sizeof(float);
    }
}

static void write_rows(exr_context_t context, const Picture *picture, const char *file)
{
    int32_t rows;
    exr_encode_pipeline_t encoder = EXR_ENCODE_PIPELINE_INITIALIZER;
    check(exr_get_scanlines_per_chunk(context, 0, &rows), file);
    for (int y = 0; y < picture->window.height; y += rows) {
        exr_chunk_info_t chunk;
        check(exr_write_scanline_chunk_info(context, 0, picture->window.y + y, &chunk), file);
        check(y ? exr_encoding_update(context, 0, &chunk, &encoder)
                : exr_encoding_initialize(context, 0, &chunk, &encoder),
            file);
        aim(&encoder, picture, y);
        if (y == 0)
            check(exr_encoding_choose_default_routines(context, 0, &encoder), file);
        check(exr_encoding_run(context, 0, &encoder), file);
    }
    check(exr_encoding_destroy(context, &encoder), file);
}

void exr_write(const Picture *picture, const char *file, FILE *stream)
{
    exr_context_t context;
    exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
    settings.error_handler_fn = silent;
    settings.user_data = stream;
    settings.write_fn = write_bytes;
    check(exr_start_write(&context, file, EXR_WRITE_FILE_DIRECTLY, &settings), file);
    write_header(context, picture, file);
    write_rows(context, picture, file);
    check(exr_finish(&context), file);
}
