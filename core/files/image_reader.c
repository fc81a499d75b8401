/* Reading pictures by rows: PNGs, and OpenEXR files that were written here. Files are data from strangers: nothing of
 * them is believed before it is compared. */
#include <OpenEXR/openexr.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/image_decoder.h"
#include "karst/image.h"

struct karst_image_reader {
    char *path;
    bool is_png;
    karst_png_decoder png;
    exr_context_t file;
    bool begun; /* there is a decoder */
    exr_decode_pipeline_t decoder;
    int width_px, height_px;
    float *rows; /* of a chunk, three floats a pixel at most */
};

static void keep_quiet(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

static bool fail_reading(const karst_image_reader *reader, const char *reason, karst_error *error)
{
    return karst_fail(error, KARST_BAD_DATA, "cannot read %s: %s", reader->path, reason);
}

static bool look_at_header(karst_image_reader *reader, karst_error *error)
{
    exr_storage_t storage;
    exr_attr_box2i_t window;
    const exr_attr_chlist_t *channels;
    int32_t rows = 0;
    if (exr_get_storage(reader->file, 0, &storage) != EXR_ERR_SUCCESS ||
        exr_get_data_window(reader->file, 0, &window) != EXR_ERR_SUCCESS ||
        exr_get_channels(reader->file, 0, &channels) != EXR_ERR_SUCCESS)
        return fail_reading(reader, "this OpenEXR file is damaged in its header", error);
    const int64_t width = (int64_t)window.max.x - window.min.x + 1, height = (int64_t)window.max.y - window.min.y + 1;
    if (storage != EXR_STORAGE_SCANLINE || window.min.x != 0 || window.min.y != 0 || width < 1 || height < 1 ||
        width > KARST_IMAGE_MAX_PX || height > KARST_IMAGE_MAX_PX ||
        exr_get_scanlines_per_chunk(reader->file, 0, &rows) != EXR_ERR_SUCCESS || rows != KARST_IMAGE_EXR_ROWS)
        return fail_reading(reader, "it was not written by Karst", error);
    for (int i = 0; i < channels->num_channels; i++)
        if (channels->entries[i].pixel_type != EXR_PIXEL_FLOAT || channels->entries[i].x_sampling != 1 ||
            channels->entries[i].y_sampling != 1)
            return fail_reading(reader, "it was not written by Karst", error);
    reader->width_px = (int)width;
    reader->height_px = (int)height;
    reader->rows = malloc(3 * sizeof(float) * (size_t)width * KARST_IMAGE_EXR_ROWS);
    return reader->rows || karst_fail(error, KARST_FAILED, "out of memory for rows of %s", reader->path);
}

static karst_image_reader *make_reader(const char *path, karst_error *error)
{
    karst_image_reader *reader = calloc(1, sizeof *reader);
    if (reader && (reader->path = strdup(path)))
        return reader;
    free(reader);
    karst_fail(error, KARST_FAILED, "out of memory for reading %s", path);
    return NULL;
}

karst_image_reader *karst_image_open_exr(const char *path, int *width_px, int *height_px, karst_error *error)
{
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    const exr_decode_pipeline_t none = EXR_DECODE_PIPELINE_INITIALIZER;
    karst_image_reader *reader = make_reader(path, error);
    start.error_handler_fn = keep_quiet;
    start.max_image_width = start.max_image_height = KARST_IMAGE_MAX_PX;
    if (!reader)
        return NULL;
    reader->decoder = none;
    errno = 0;
    if (exr_start_read(&reader->file, path, &start) != EXR_ERR_SUCCESS)
        fail_reading(reader, errno ? strerror(errno) : "it is no OpenEXR file, or a damaged one", error);
    else if (look_at_header(reader, error)) {
        *width_px = reader->width_px;
        *height_px = reader->height_px;
        return reader;
    }
    karst_image_close(reader);
    return NULL;
}

karst_image_reader *karst_image_open_png(const char *path, int *width_px, int *height_px, karst_error *error)
{
    karst_image_reader *reader = make_reader(path, error);
    if (!reader)
        return NULL;
    reader->is_png = true;
    if (!karst_png_open(&reader->png, path))
        fail_reading(reader, reader->png.message, error);
    else if (reader->png.num_passes > 1)
        fail_reading(reader, "it is interlaced, and cannot be read row by row", error);
    else {
        *width_px = reader->width_px = reader->png.width_px;
        *height_px = reader->height_px = reader->png.height_px;
        return reader;
    }
    karst_image_close(reader);
    return NULL;
}

bool karst_image_read_bytes(karst_image_reader *reader, uint8_t *rgba, int num_rows, karst_error *error)
{
    if (!reader->is_png)
        return karst_fail(error, KARST_USAGE, "%s: bytes are read of a PNG only", reader->path);
    if (reader->png.message[0])
        return fail_reading(reader, reader->png.message, error);
    if (num_rows < 1 || num_rows > reader->height_px - reader->png.num_rows)
        return karst_fail(error, KARST_USAGE, "%d more rows of %s, of which %d of %d were read", num_rows, reader->path,
                          reader->png.num_rows, reader->height_px);
    return karst_png_read(&reader->png, rgba, num_rows) || fail_reading(reader, reader->png.message, error);
}

const char *karst_image_note(const karst_image_reader *reader)
{
    int32_t length = 0;
    const char *note = NULL;
    if (reader->is_png)
        return NULL;
    return exr_attr_get_string(reader->file, 0, KARST_IMAGE_NOTE, &length, &note) == EXR_ERR_SUCCESS ? note : NULL;
}

static int place_of(const char *const *names, int num_channels, const char *name)
{
    for (int i = 0; i < num_channels; i++)
        if (strcmp(names[i], name) == 0)
            return i;
    return -1;
}

/* The chunk that begins with row `y`, into `rows`. */
static bool read_chunk(karst_image_reader *reader, const char *const *names, int num_channels, int y,
                       karst_error *error)
{
    exr_chunk_info_t chunk;
    exr_decode_pipeline_t *decoder = &reader->decoder;
    const int left = reader->height_px - y, high = left < KARST_IMAGE_EXR_ROWS ? left : KARST_IMAGE_EXR_ROWS;
    int num_found = 0;
    exr_result_t code = exr_read_scanline_chunk_info(reader->file, 0, y, &chunk);
    /* one that says it lies elsewhere would be written there */
    if (code == EXR_ERR_SUCCESS && (chunk.start_y != y || chunk.height != high || chunk.width != reader->width_px))
        code = EXR_ERR_BAD_CHUNK_LEADER;
    if (code == EXR_ERR_SUCCESS)
        code = reader->begun ? exr_decoding_update(reader->file, 0, &chunk, decoder)
                             : exr_decoding_initialize(reader->file, 0, &chunk, decoder);
    reader->begun = reader->begun || code == EXR_ERR_SUCCESS;
    for (int i = 0; code == EXR_ERR_SUCCESS && i < decoder->channel_count; i++) {
        const int place = place_of(names, num_channels, decoder->channels[i].channel_name);
        decoder->channels[i].decode_to_ptr = NULL;
        if (place < 0)
            continue;
        num_found++;
        decoder->channels[i].user_bytes_per_element = sizeof(float);
        decoder->channels[i].user_data_type = EXR_PIXEL_FLOAT;
        decoder->channels[i].user_pixel_stride = (int32_t)sizeof(float) * num_channels;
        decoder->channels[i].user_line_stride = (int32_t)sizeof(float) * num_channels * reader->width_px;
        decoder->channels[i].decode_to_ptr = (uint8_t *)(reader->rows + place);
    }
    if (code == EXR_ERR_SUCCESS && num_found != num_channels)
        return fail_reading(reader, "it has not the channels that are looked for", error);
    if (code == EXR_ERR_SUCCESS)
        code = exr_decoding_choose_default_routines(reader->file, 0, decoder);
    if (code == EXR_ERR_SUCCESS)
        code = exr_decoding_run(reader->file, 0, decoder);
    return code == EXR_ERR_SUCCESS ||
           karst_fail(error, KARST_BAD_DATA, "cannot read %s: it is damaged from row %d on: %s", reader->path, y + 1,
                      exr_get_default_error_message(code));
}

bool karst_image_read_rows(karst_image_reader *reader, const char *const *names, int num_channels, int y_px,
                           int num_rows, float *values, karst_error *error)
{
    if (reader->is_png)
        return karst_fail(error, KARST_USAGE, "%s: a PNG has bytes, not channels", reader->path);
    if (num_channels < 1 || num_channels > 3)
        return karst_fail(error, KARST_USAGE, "%d channels of %s: 1 to 3 are read at once", num_channels, reader->path);
    if (y_px < 0 || num_rows < 1 || num_rows > reader->height_px - y_px)
        return karst_fail(error, KARST_USAGE, "rows %d to %d of %s, which has %d", y_px, y_px + num_rows - 1,
                          reader->path, reader->height_px);
    const size_t row = (size_t)reader->width_px * (size_t)num_channels;
    const int end = y_px + num_rows;
    for (int first = y_px - y_px % KARST_IMAGE_EXR_ROWS; first < end; first += KARST_IMAGE_EXR_ROWS) {
        const int from = first < y_px ? y_px : first;
        const int to = first + KARST_IMAGE_EXR_ROWS < end ? first + KARST_IMAGE_EXR_ROWS : end;
        if (!read_chunk(reader, names, num_channels, first, error))
            return false;
        memcpy(values + (size_t)(from - y_px) * row, reader->rows + (size_t)(from - first) * row,
               (size_t)(to - from) * row * sizeof *values);
    }
    return true;
}

void karst_image_close(karst_image_reader *reader)
{
    if (!reader)
        return;
    if (reader->begun)
        exr_decoding_destroy(reader->file, &reader->decoder);
    if (reader->file)
        exr_finish(&reader->file);
    karst_png_close(&reader->png);
    free(reader->rows);
    free(reader->path);
    free(reader);
}
