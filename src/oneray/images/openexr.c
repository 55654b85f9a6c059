/* OpenEXR files in memory, by its C library. */
#include "images/image.h"

#include <openexr.h>
#include <stdlib.h>

enum { MOST_CHANNELS = 3 };

static void silent(exr_const_context_t context, exr_result_t code, const char *text)
{
    (void)context, (void)code, (void)text;
}

static int64_t read_bytes(exr_const_context_t context, void *stream, void *to, uint64_t size, uint64_t offset,
    exr_stream_error_func_ptr_t failed)
{
    const File *file = stream;
    (void)context, (void)failed;
    if (offset > file->size)
        return -1;
    if (size > file->size - offset) /* the library asks for more than it needs */
        size = file->size - offset;
    memcpy(to, file->bytes + offset, size);
    return (int64_t)size;
}

static int64_t size_of(exr_const_context_t context, void *stream)
{
    (void)context;
    return (int64_t)((const File *)stream)->size;
}

bool is_openexr(const File *file) { return file->size >= 4 && memcmp(file->bytes, "\x76\x2f\x31\x01", 4) == 0; }

typedef struct {
    const File *file;
    exr_context_t context;
    Image *image;
    exr_attr_box2i_t window;
    const char *channel[MOST_CHANNELS]; /* whose values go to red, green and blue */
} Reader;

static void check(Reader *reader, exr_result_t result)
{
    if (result == EXR_ERR_SUCCESS)
        return;
    exr_finish(&reader->context);
    fail(&reader->file->named, "%s: an OpenEXR file that cannot be read: %s", reader->file->name,
        exr_get_error_code_as_string(result));
}

static const char *find_channel(const exr_attr_chlist_t *list, const char *name)
{
    for (int i = 0; i < list->num_channels; i++)
        if (strcmp(list->entries[i].name.str, name) == 0)
            return list->entries[i].name.str;
    return NULL;
}

static void find_channels(Reader *reader)
{
    static const char *const names[MOST_CHANNELS] = {"R", "G", "B"};
    const exr_attr_chlist_t *list;
    bool all = true;
    check(reader, exr_get_channels(reader->context, 0, &list));
    for (int c = 0; c < MOST_CHANNELS; c++)
        all = (reader->channel[c] = find_channel(list, names[c])) && all;
    const char *grey = find_channel(list, "Y");
    for (int c = 0; c < MOST_CHANNELS && !all; c++)
        reader->channel[c] = list->num_channels == 1 ? list->entries[0].name.str : grey;
    for (int i = 0; i < list->num_channels; i++)
        all = all && list->entries[i].x_sampling == 1 && list->entries[i].y_sampling == 1;
    if (all || (reader->channel[0] && list->num_channels <= 2))
        return;
    exr_finish(&reader->context);
    fail(&reader->file->named, "%s: an OpenEXR file without channels R, G and B, or one alone, at each pixel",
        reader->file->name);
}

/* Decodes a chunk, of scan lines or a tile, to where its pixels are; of a grey picture to red alone. */
static void read_chunk(Reader *reader, exr_decode_pipeline_t *pipe, const exr_chunk_info_t *chunk, int x, int y)
{
    bool first = !pipe->channels;
    Image *image = reader->image;
    check(reader, first ? exr_decoding_initialize(reader->context, 0, chunk, pipe)
                        : exr_decoding_update(reader->context, 0, chunk, pipe));
    for (int i = 0; i < pipe->channel_count; i++) {
        exr_coding_channel_info_t *one = &pipe->channels[i];
        one->decode_to_ptr = NULL;
        for (int c = MOST_CHANNELS - 1; c >= 0; c--)
            if (reader->channel[c] && strcmp(one->channel_name, reader->channel[c]) == 0)
                one->decode_to_ptr = (uint8_t *)&image->value[(size_t)y * (size_t)image->width + (size_t)x][c];
        one->user_bytes_per_element = sizeof(float);
        one->user_data_type = EXR_PIXEL_FLOAT;
        one->user_pixel_stride = sizeof *image->value;
        one->user_line_stride = image->width * (int)sizeof *image->value;
    }
    if (first)
        check(reader, exr_decoding_choose_default_routines(reader->context, 0, pipe));
    check(reader, exr_decoding_run(reader->context, 0, pipe));
}

static void read_lines(Reader *reader, exr_decode_pipeline_t *pipe)
{
    int lines;
    exr_chunk_info_t chunk;
    check(reader, exr_get_scanlines_per_chunk(reader->context, 0, &lines));
    for (int y = 0; y < reader->image->height; y += lines) {
        check(reader, exr_read_scanline_chunk_info(reader->context, 0, y + reader->window.min.y, &chunk));
        read_chunk(reader, pipe, &chunk, 0, chunk.start_y - reader->window.min.y);
    }
}

static void read_tiles(Reader *reader, exr_decode_pipeline_t *pipe)
{
    int width, height;
    exr_chunk_info_t chunk;
    check(reader, exr_get_tile_sizes(reader->context, 0, 0, 0, &width, &height));
    for (int y = 0; y * height < reader->image->height; y++)
        for (int x = 0; x * width < reader->image->width; x++) {
            check(reader, exr_read_tile_chunk_info(reader->context, 0, x, y, 0, 0, &chunk));
            read_chunk(reader, pipe, &chunk, x * width, y * height);
        }
}

void openexr_read(const File *file, Image *image)
{
    Reader reader = {.file = file, .image = image};
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_decode_pipeline_t pipe = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_storage_t storage;
    setup.error_handler_fn = silent;
    setup.user_data = (void *)(uintptr_t)file;
    setup.read_fn = read_bytes;
    setup.size_fn = size_of;
    check(&reader, exr_start_read(&reader.context, file->name, &setup));
    check(&reader, exr_get_storage(reader.context, 0, &storage));
    check(&reader, exr_get_data_window(reader.context, 0, &reader.window));
    if (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED)
        check(&reader, EXR_ERR_FEATURE_NOT_IMPLEMENTED);
    find_channels(&reader);
    image_begin(image, file, (int64_t)reader.window.max.x - reader.window.min.x + 1,
        (int64_t)reader.window.max.y - reader.window.min.y + 1);
    (storage == EXR_STORAGE_TILED ? read_tiles : read_lines)(&reader, &pipe);
    exr_decoding_destroy(reader.context, &pipe);
    exr_finish(&reader.context);
    for (size_t i = 0; i < (size_t)image->width * (size_t)image->height && reader.channel[1] == reader.channel[0]; i++)
        image->value[i][1] = image->value[i][2] = image->value[i][0];
}
