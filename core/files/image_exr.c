/* OpenEXR files, through the C interface of its core library. */
#include "core/files/image_writer.h"

#include <string.h>

static void keep_quiet(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

static const karst_image_channel *find_channel(const karst_image_channel *channels, int num_channels, const char *name)
{
    for (int i = 0; i < num_channels; i++)
        if (strcmp(channels[i].name, name) == 0)
            return &channels[i];
    return NULL;
}

/* A chunk of rows from y on; values begin with row `first_y`. */
static exr_result_t write_chunk(karst_exr_encoder *e, const karst_image_channel *channels, int num_channels,
                                int width_px, int first_y, int y)
{
    exr_chunk_info_t chunk;
    exr_encode_pipeline_t *encoder = &e->encoder;
    exr_result_t code = exr_write_scanline_chunk_info(e->file, e->part, y, &chunk);
    if (code == EXR_ERR_SUCCESS)
        code = !e->begun ? exr_encoding_initialize(e->file, e->part, &chunk, encoder)
                         : exr_encoding_update(e->file, e->part, &chunk, encoder);
    for (int i = 0; code == EXR_ERR_SUCCESS && i < encoder->channel_count; i++) {
        const karst_image_channel *source = find_channel(channels, num_channels, encoder->channels[i].channel_name);
        if (!source)
            return EXR_ERR_MISSING_REQ_ATTR;
        encoder->channels[i].user_bytes_per_element = sizeof(float);
        encoder->channels[i].user_data_type = EXR_PIXEL_FLOAT;
        encoder->channels[i].user_pixel_stride = (int32_t)sizeof(float) * source->stride;
        encoder->channels[i].user_line_stride = (int32_t)sizeof(float) * source->stride * width_px;
        encoder->channels[i].encode_from_ptr =
            (const uint8_t *)(source->values + (size_t)(y - first_y) * (size_t)width_px * (size_t)source->stride);
    }
    if (code == EXR_ERR_SUCCESS && !e->begun)
        code = exr_encoding_choose_default_routines(e->file, e->part, encoder);
    e->begun = true;
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(e->file, e->part, encoder) : code;
}

exr_result_t karst_exr_begin(karst_exr_encoder *e, const char *path, const char *const *names, int num_channels,
                             const char *note, int width_px, int height_px)
{
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    const exr_encode_pipeline_t none = EXR_ENCODE_PIPELINE_INITIALIZER;
    int32_t rows = 0;
    start.error_handler_fn = keep_quiet;
    e->encoder = none;
    exr_result_t code = exr_start_write(&e->file, path, EXR_WRITE_FILE_DIRECTLY, &start);
    if (code == EXR_ERR_SUCCESS)
        code = exr_add_part(e->file, NULL, EXR_STORAGE_SCANLINE, &e->part);
    if (code == EXR_ERR_SUCCESS)
        code = exr_initialize_required_attr_simple(e->file, e->part, width_px, height_px, EXR_COMPRESSION_ZIP);
    for (int i = 0; code == EXR_ERR_SUCCESS && i < num_channels; i++)
        code = exr_add_channel(e->file, e->part, names[i], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    if (code == EXR_ERR_SUCCESS && note)
        code = exr_attr_set_string(e->file, e->part, KARST_IMAGE_NOTE, note);
    if (code == EXR_ERR_SUCCESS)
        code = exr_write_header(e->file);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_scanlines_per_chunk(e->file, e->part, &rows);
    return code == EXR_ERR_SUCCESS && rows != KARST_IMAGE_EXR_ROWS ? EXR_ERR_INVALID_ATTR : code;
}

exr_result_t karst_exr_rows(karst_exr_encoder *e, const karst_image_channel *channels, int num_channels, int width_px,
                            int y, int num_rows)
{
    exr_result_t code = EXR_ERR_SUCCESS;
    for (int row = y; code == EXR_ERR_SUCCESS && row < y + num_rows; row += KARST_IMAGE_EXR_ROWS)
        code = write_chunk(e, channels, num_channels, width_px, y, row);
    return code;
}

exr_result_t karst_exr_end(karst_exr_encoder *e)
{
    if (!e->file)
        return EXR_ERR_SUCCESS;
    exr_encoding_destroy(e->file, &e->encoder);
    const exr_result_t code = exr_finish(&e->file);
    e->file = NULL;
    return code;
}
