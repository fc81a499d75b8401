/* PNGs on their way in, row by row. */
#ifndef KARST_CORE_FILES_IMAGE_DECODER_H
#define KARST_CORE_FILES_IMAGE_DECODER_H

#include <png.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

/* Zero-initialise. */
typedef struct {
    FILE *file;
    char message[128]; /* why it failed: libpng's own complaint, or errno's words */
    png_structp png;
    png_infop info;
    int width_px, height_px;
    int num_passes; /* above 1: interlaced, so it can only be read as a whole */
    int num_rows;   /* that were read */
} karst_png_decoder;

/* image.c. false: `message` says why, and only karst_png_close may follow. */
bool karst_png_open(karst_png_decoder *decoder, const char *path);
/* The next rows: RGBA, width_px * 4 bytes a row, alpha 255 where there is none. With the last one the file's end is
 * checked, too. */
bool karst_png_read(karst_png_decoder *decoder, uint8_t *rgba, int num_rows);
void karst_png_close(karst_png_decoder *decoder); /* twice is fine */

#endif
