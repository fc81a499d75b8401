/* Samples of OpenEXR files, through the C interface of its core library. */
#include <OpenEXR/openexr.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/samples_internal.h"

static void keep_quiet(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

/* Which channel of the samples one of the file's is: R, G, B of three; Y, Z or the only one of one. -1: none. */
static int place_of(const exr_attr_chlist_t *channels, int i, uint32_t num_channels)
{
    static const char *const colours[] = {"R", "G", "B"};
    const char *name = channels->entries[i].name.str;
    for (int c = 0; num_channels == 3 && c < 3; c++)
        if (!strcmp(name, colours[c]))
            return c;
    if (num_channels == 3)
        return -1;
    return channels->num_channels == 1 || !strcmp(name, "Y") || !strcmp(name, "Z") ? 0 : -1;
}

static uint32_t count_channels(const exr_attr_chlist_t *channels)
{
    uint32_t colours = 0, single = 0;
    for (int i = 0; i < channels->num_channels; i++) {
        colours += place_of(channels, i, 3) >= 0;
        single += place_of(channels, i, 1) >= 0;
    }
    return colours == 3 ? 3 : single == 1 ? 1 : 0;
}

static exr_result_t read_chunk(const karst_samples_reader *r, exr_context_t file, const exr_attr_chlist_t *channels,
                               int top, int y, bool first, int32_t *rows, exr_decode_pipeline_t *decoder)
{
    exr_chunk_info_t chunk;
    karst_samples *to = r->samples;
    exr_result_t code = exr_read_scanline_chunk_info(file, 0, y, &chunk);
    if (code == EXR_ERR_SUCCESS)
        code =
            first ? exr_decoding_initialize(file, 0, &chunk, decoder) : exr_decoding_update(file, 0, &chunk, decoder);
    /* a chunk that says it lies elsewhere would be written there */
    if (code == EXR_ERR_SUCCESS && (chunk.start_y != y || chunk.height < 1 || chunk.width != (int)to->width ||
                                    y - top + chunk.height > (int)to->height))
        return EXR_ERR_BAD_CHUNK_LEADER;
    for (int i = 0; code == EXR_ERR_SUCCESS && i < decoder->channel_count; i++) {
        int place = -1;
        for (int k = 0; k < channels->num_channels; k++)
            if (!strcmp(channels->entries[k].name.str, decoder->channels[i].channel_name))
                place = place_of(channels, k, to->num_channels);
        decoder->channels[i].decode_to_ptr = NULL;
        if (place < 0)
            continue;
        decoder->channels[i].user_bytes_per_element = sizeof(float);
        decoder->channels[i].user_data_type = EXR_PIXEL_FLOAT;
        decoder->channels[i].user_pixel_stride = (int32_t)(sizeof(float) * to->num_channels);
        decoder->channels[i].user_line_stride = (int32_t)(sizeof(float) * to->num_channels * to->width);
        decoder->channels[i].decode_to_ptr =
            (uint8_t *)(to->values + (size_t)(y - top) * to->width * to->num_channels + place);
    }
    if (code == EXR_ERR_SUCCESS && first)
        code = exr_decoding_choose_default_routines(file, 0, decoder);
    if (code == EXR_ERR_SUCCESS)
        *rows = chunk.height;
    return code == EXR_ERR_SUCCESS ? exr_decoding_run(file, 0, decoder) : code;
}

static bool decode(const karst_samples_reader *r, exr_context_t file)
{
    exr_storage_t storage;
    exr_attr_box2i_t window;
    const exr_attr_chlist_t *channels;
    exr_decode_pipeline_t decoder = EXR_DECODE_PIPELINE_INITIALIZER;
    if (exr_get_storage(file, 0, &storage) != EXR_ERR_SUCCESS || exr_get_data_window(file, 0, &window) ||
        exr_get_channels(file, 0, &channels) != EXR_ERR_SUCCESS)
        return karst_samples_fail(r, "this OpenEXR file is damaged in its header");
    if (storage != EXR_STORAGE_SCANLINE)
        return karst_samples_fail(r, "OpenEXR files with tiles or depths are not read: save it as scan lines");
    const int64_t width = (int64_t)window.max.x - window.min.x + 1, height = (int64_t)window.max.y - window.min.y + 1;
    const uint32_t num_channels = count_channels(channels);
    for (int i = 0; i < channels->num_channels; i++)
        if (channels->entries[i].x_sampling != 1 || channels->entries[i].y_sampling != 1)
            return karst_samples_fail(r, "channels with fewer samples than others are not read");
    if (!num_channels)
        return karst_samples_fail(r, "it has neither R, G and B, nor Y, Z or a single channel");
    if (!karst_samples_begin(r, width < 0 ? 0 : (uint64_t)width, height < 0 ? 0 : (uint64_t)height, num_channels))
        return false;
    exr_result_t code = EXR_ERR_SUCCESS;
    int32_t rows = 1;
    int64_t y = window.min.y;
    for (; code == EXR_ERR_SUCCESS && y <= window.max.y; y += code == EXR_ERR_SUCCESS ? rows : 0)
        code = read_chunk(r, file, channels, window.min.y, (int)y, y == window.min.y, &rows, &decoder);
    exr_decoding_destroy(file, &decoder);
    snprintf(r->samples->kind_text, sizeof r->samples->kind_text, "OpenEXR");
    return code == EXR_ERR_SUCCESS ||
           karst_samples_fail(r, "this OpenEXR file is damaged at row %lld: %s", (long long)(y - window.min.y + 1),
                              exr_get_default_error_message(code));
}

bool karst_samples_read_exr(const karst_samples_reader *r)
{
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t file = NULL;
    start.error_handler_fn = keep_quiet;
    start.max_image_width = start.max_image_height = (int)KARST_SAMPLES_MOST_SIDE;
    exr_result_t code = exr_start_read(&file, r->path, &start);
    if (code != EXR_ERR_SUCCESS)
        return karst_samples_fail(r, "this OpenEXR file is damaged, or too large: %s",
                                  exr_get_default_error_message(code));
    bool done = decode(r, file);
    exr_finish(&file);
    return done;
}
