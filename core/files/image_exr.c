/* OpenEXR files, through the C interface of its core library. */
#include "karst/image.h"

#include <OpenEXR/openexr.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void keep_quiet(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

/* The transfer function of sRGB, backwards, for all bytes. */
static void make_linear(const uint8_t *rgba, size_t num_pixels, float *rgb)
{
    float table[256];
    for (int i = 0; i < 256; i++) {
        double s = i / 255.0;
        table[i] = (float)(s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4));
    }
    for (size_t i = 0; i < num_pixels; i++)
        for (int c = 0; c < 3; c++)
            rgb[3 * i + (size_t)c] = table[rgba[4 * i + (size_t)c]];
}

static const karst_image_channel *find_channel(const karst_image_channel *channels, int num_channels, const char *name)
{
    for (int i = 0; i < num_channels; i++)
        if (strcmp(channels[i].name, name) == 0)
            return &channels[i];
    return NULL;
}

/* Rows from y on, as many as make a chunk. */
static exr_result_t write_chunk(exr_context_t file, int part, const karst_image_channel *channels, int num_channels,
                                int width_px, int y, bool first, exr_encode_pipeline_t *encoder)
{
    exr_chunk_info_t chunk;
    exr_result_t code = exr_write_scanline_chunk_info(file, part, y, &chunk);
    if (code == EXR_ERR_SUCCESS)
        code = first ? exr_encoding_initialize(file, part, &chunk, encoder)
                     : exr_encoding_update(file, part, &chunk, encoder);
    for (int i = 0; code == EXR_ERR_SUCCESS && i < encoder->channel_count; i++) {
        const karst_image_channel *source = find_channel(channels, num_channels, encoder->channels[i].channel_name);
        encoder->channels[i].user_bytes_per_element = sizeof(float);
        encoder->channels[i].user_data_type = EXR_PIXEL_FLOAT;
        encoder->channels[i].user_pixel_stride = (int32_t)sizeof(float) * source->stride;
        encoder->channels[i].user_line_stride = (int32_t)sizeof(float) * source->stride * width_px;
        encoder->channels[i].encode_from_ptr =
            (const uint8_t *)(source->values + (size_t)y * (size_t)width_px * (size_t)source->stride);
    }
    if (code == EXR_ERR_SUCCESS && first)
        code = exr_encoding_choose_default_routines(file, part, encoder);
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(file, part, encoder) : code;
}

static exr_result_t write_file(const char *path, const karst_image_channel *channels, int num_channels, int width_px,
                               int height_px)
{
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    start.error_handler_fn = keep_quiet;
    exr_context_t file = NULL;
    exr_encode_pipeline_t encoder = EXR_ENCODE_PIPELINE_INITIALIZER;
    int part = 0;
    int32_t rows = 1;
    exr_result_t code = exr_start_write(&file, path, EXR_WRITE_FILE_DIRECTLY, &start);
    if (code == EXR_ERR_SUCCESS)
        code = exr_add_part(file, NULL, EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS)
        code = exr_initialize_required_attr_simple(file, part, width_px, height_px, EXR_COMPRESSION_ZIP);
    for (int i = 0; code == EXR_ERR_SUCCESS && i < num_channels; i++)
        code = exr_add_channel(file, part, channels[i].name, EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    if (code == EXR_ERR_SUCCESS)
        code = exr_write_header(file);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_scanlines_per_chunk(file, part, &rows);
    for (int y = 0; code == EXR_ERR_SUCCESS && y < height_px; y += rows)
        code = write_chunk(file, part, channels, num_channels, width_px, y, y == 0, &encoder);
    if (file) {
        exr_encoding_destroy(file, &encoder);
        exr_result_t finished = exr_finish(&file);
        code = code == EXR_ERR_SUCCESS ? finished : code;
    }
    return code;
}

/* Through a new file beside it. */
bool karst_image_write_channels(const char *path, const karst_image_channel *channels, int num_channels, int width_px,
                                int height_px, karst_error *error)
{
    static atomic_uint counter;
    if (width_px < 1 || height_px < 1 || width_px > KARST_IMAGE_MAX_PX || height_px > KARST_IMAGE_MAX_PX)
        return karst_fail(error, KARST_USAGE, "%s: a picture of %d x %d pixels; each side must be 1 to %d", path,
                          width_px, height_px, KARST_IMAGE_MAX_PX);
    if (num_channels < 1 || num_channels > KARST_IMAGE_MAX_CHANNELS)
        return karst_fail(error, KARST_USAGE, "%s: %d channels; there may be 1 to %d", path, num_channels,
                          KARST_IMAGE_MAX_CHANNELS);
    for (int i = 0; i < num_channels; i++)
        for (int j = 0; j < i; j++)
            if (strcmp(channels[i].name, channels[j].name) == 0)
                return karst_fail(error, KARST_USAGE, "%s: two channels called %s", path, channels[i].name);
    char temporary[PATH_MAX];
    /* In the same folder, by a name of its own, which no PNG has: the picture's may be as long as the system allows. */
    const char *slash = strrchr(path, '/');
    int length = snprintf(temporary, sizeof temporary, "%.*s.karst-%ld-%u.exr.tmp", slash ? (int)(slash - path + 1) : 0,
                          path, (long)getpid(), atomic_fetch_add(&counter, 1));
    if (length < 0 || (size_t)length >= sizeof temporary)
        return karst_fail(error, KARST_FAILED, "cannot write %.80s...: the name is too long", path);
    errno = 0;
    exr_result_t code = write_file(temporary, channels, num_channels, width_px, height_px);
    if (code == EXR_ERR_SUCCESS && rename(temporary, path) == 0)
        return true;
    const char *reason = code != EXR_ERR_SUCCESS && !errno ? exr_get_default_error_message(code) : strerror(errno);
    karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, reason);
    unlink(temporary);
    return false;
}

bool karst_image_write_exr(const char *path, const uint8_t *rgba, const float *depth_m, const float *normals,
                           int width_px, int height_px, karst_error *error)
{
    if (width_px < 1 || height_px < 1 || width_px > KARST_IMAGE_MAX_PX || height_px > KARST_IMAGE_MAX_PX)
        return karst_fail(error, KARST_USAGE, "%s: a picture of %d x %d pixels; each side must be 1 to %d", path,
                          width_px, height_px, KARST_IMAGE_MAX_PX);
    size_t num_pixels = (size_t)width_px * (size_t)height_px;
    float *rgb = malloc(3 * num_pixels * sizeof *rgb);
    if (!rgb)
        return karst_fail(error, KARST_FAILED, "cannot write %s: out of memory", path);
    make_linear(rgba, num_pixels, rgb);
    karst_image_channel channels[7] = {{"R", rgb, 3}, {"G", rgb + 1, 3}, {"B", rgb + 2, 3}};
    int num_channels = 3;
    if (depth_m)
        channels[num_channels++] = (karst_image_channel){"Z", depth_m, 1};
    for (int axis = 0; normals && axis < 3; axis++) {
        static const char *const names[] = {"N.X", "N.Y", "N.Z"};
        channels[num_channels++] = (karst_image_channel){names[axis], normals + axis, 3};
    }
    bool done = karst_image_write_channels(path, channels, num_channels, width_px, height_px, error);
    free(rgb);
    return done;
}
