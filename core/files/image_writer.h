/* Pictures that are written row by row: encoders of a kind each, and the file that appears whole or not at all. */
#ifndef KARST_CORE_FILES_IMAGE_WRITER_H
#define KARST_CORE_FILES_IMAGE_WRITER_H

#include <OpenEXR/openexr.h>
#include <png.h>
#include <stdio.h>

#include "karst/image.h"

/* Rows of a PNG into an open file. Zero-initialise. */
typedef struct {
    FILE *file;
    int write_errno;   /* first failure of a write */
    char message[128]; /* libpng's own complaint */
    png_structp png;
    png_infop info;
} karst_png_encoder;

/* image_png.c. false: karst_png_reason says why, and only karst_png_drop may follow. */
bool karst_png_begin(karst_png_encoder *encoder, int width_px, int height_px);
bool karst_png_rows(karst_png_encoder *encoder, const uint8_t *rgba, int width_px, int num_rows);
bool karst_png_end(karst_png_encoder *encoder);
void karst_png_drop(karst_png_encoder *encoder); /* leaves the file open; twice is fine */
const char *karst_png_reason(const karst_png_encoder *encoder);

/* Rows of an OpenEXR file, which it makes itself. Zero-initialise. */
typedef struct {
    exr_context_t file;
    int part;
    bool begun; /* a chunk was written */
    exr_encode_pipeline_t encoder;
} karst_exr_encoder;

/* image_exr.c. Others than EXR_ERR_SUCCESS: only karst_exr_end may follow. */
exr_result_t karst_exr_begin(karst_exr_encoder *encoder, const char *path, const char *const *names, int num_channels,
                             const char *note, int width_px, int height_px);
/* Rows from y on; a multiple of KARST_IMAGE_EXR_ROWS, or the last. */
exr_result_t karst_exr_rows(karst_exr_encoder *encoder, const karst_image_channel *channels, int num_channels,
                            int width_px, int y, int num_rows);
exr_result_t karst_exr_end(karst_exr_encoder *encoder); /* twice is fine */

#endif
