/* Pictures on disk. */
#ifndef KARST_IMAGE_H
#define KARST_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

#define KARST_IMAGE_MAX_PX 16384 /* of one side */

/* Writes 8-bit RGBA rows (top row first, width * 4 bytes a row) as a PNG without alpha; bytes are taken as they are,
 * nothing is said about gamma. The same pixels give the same bytes. The file appears whole or not at all (written
 * beside as .karst-*.tmp, then renamed); a device or pipe is written to directly. Errors: KARST_USAGE (a side outside 1
 * to KARST_IMAGE_MAX_PX), KARST_FAILED; both name the path and the reason. Thread-safe. */
bool karst_image_write_png(const char *path, const uint8_t *rgba, int width_px, int height_px, karst_error *error);
/* Reads an 8-bit RGB or RGBA PNG into malloc'ed RGBA (the caller frees), alpha 255 where there is none. *width_px and
 * *height_px change only on success. Errors, naming the path and the reason: KARST_BAD_DATA (any other file),
 * KARST_FAILED (memory). Thread-safe. */
uint8_t *karst_image_read_png(const char *path, int *width_px, int *height_px, karst_error *error);

/* Writes an OpenEXR file of 32-bit floats, whole or not at all: channels R, G, B (the picture's colours, made linear
 * from sRGB: what the eye sees, not the light that there was), and if given Z (`depth_m`: metres along each ray,
 * infinite where nothing is) and N.X, N.Y, N.Z (`normals`: three floats a pixel, world axes, zeros where nothing is).
 * Top row first. Errors: KARST_USAGE (a side outside 1 to KARST_IMAGE_MAX_PX), KARST_FAILED; both name the path.
 * Thread-safe. */
bool karst_image_write_exr(const char *path, const uint8_t *rgba, const float *depth_m, const float *normals,
                           int width_px, int height_px, karst_error *error);

/* One channel of an OpenEXR file: `values` points at the first pixel's value, `stride` floats apart. */
typedef struct {
    const char *name;
    const float *values;
    int stride;
} karst_image_channel;
#define KARST_IMAGE_MAX_CHANNELS 32
/* The same for any channels, 1 to KARST_IMAGE_MAX_CHANNELS of different names; borrowed. Errors: KARST_USAGE also for
 * another number of them, and for two of one name. */
bool karst_image_write_channels(const char *path, const karst_image_channel *channels, int num_channels, int width_px,
                                int height_px, karst_error *error);

/* Colours of a picture made linear, as karst_image_write_exr does: by the transfer function of sRGB, backwards; three
 * floats a pixel. Thread-safe. */
void karst_image_make_linear(const uint8_t *rgba, size_t num_pixels, float *rgb);

/* The same files row by row, so that a picture need never be in memory. Begin, add all rows from the top, then end,
 * which makes the file appear under its name; or discard, after a failure, too, and there is none. One thread at a time
 * for each writer. */
typedef struct karst_image_writer karst_image_writer;
#define KARST_IMAGE_EXR_ROWS 16 /* rows of an OpenEXR file are added by so many, but for the last */
#define KARST_IMAGE_NOTE "karst"

/* `path` is copied. Errors: as karst_image_write_png. */
karst_image_writer *karst_image_begin_png(const char *path, int width_px, int height_px, karst_error *error);
/* With channels of these names; `note` (NULL: none), a text, is kept in the file as an attribute called
 * KARST_IMAGE_NOTE. Errors: as karst_image_write_channels; also KARST_FAILED of a device or pipe. */
karst_image_writer *karst_image_begin_exr(const char *path, const char *const *names, int num_channels,
                                          const char *note, int width_px, int height_px, karst_error *error);
/* The next rows of a PNG: RGBA, width * 4 bytes a row. Or those of an OpenEXR file, with values of all its channels (in
 * any order; others are passed over), which begin with the first of these rows. Errors: KARST_USAGE (more rows than are
 * left, or none; not by KARST_IMAGE_EXR_ROWS; a channel that is not there; the other kind of file), KARST_FAILED. */
bool karst_image_add_bytes(karst_image_writer *writer, const uint8_t *rgba, int num_rows, karst_error *error);
bool karst_image_add_channels(karst_image_writer *writer, const karst_image_channel *channels, int num_channels,
                              int num_rows, karst_error *error);
/* The file that is written until the end, for who must remove it when the process ends in between; "": a device or
 * pipe. Lives as long as the writer. */
const char *karst_image_temporary(const karst_image_writer *writer);
/* Ends the writer also if it fails. Errors: KARST_USAGE (rows are missing), KARST_FAILED. */
bool karst_image_end(karst_image_writer *writer, karst_error *error);
void karst_image_discard(karst_image_writer *writer); /* NULL is fine */

/* Reads pictures by rows: an OpenEXR file that was written here, or any PNG of 8-bit RGB or RGBA that is not
 * interlaced. One thread at a time for each reader. */
typedef struct karst_image_reader karst_image_reader;
/* *width_px and *height_px change only on success. Errors, naming the path and the reason: KARST_BAD_DATA (it is none,
 * damaged, or by another program that lays rows out otherwise), KARST_FAILED (memory). */
karst_image_reader *karst_image_open_exr(const char *path, int *width_px, int *height_px, karst_error *error);
karst_image_reader *karst_image_open_png(const char *path, int *width_px, int *height_px, karst_error *error);
/* The next rows of a PNG, from the top: RGBA, width * 4 bytes a row, alpha 255 where there is none. What lies behind
 * the last row is looked at with it. Errors: KARST_USAGE (more rows than are left, or none; an OpenEXR file),
 * KARST_BAD_DATA (damaged, now or in an earlier row). */
bool karst_image_read_bytes(karst_image_reader *reader, uint8_t *rgba, int num_rows, karst_error *error);
/* Its note (karst_image_begin_exr), which lives as long as the reader; NULL: it has none. */
const char *karst_image_note(const karst_image_reader *reader);
/* Of an OpenEXR file, values of 1 to 3 channels of rows y_px to y_px + num_rows - 1, pixel by pixel, num_channels
 * floats each. Errors: KARST_USAGE (rows that it has not, another number of channels; a PNG), KARST_BAD_DATA (damaged;
 * a channel is not there). */
bool karst_image_read_rows(karst_image_reader *reader, const char *const *names, int num_channels, int y_px,
                           int num_rows, float *values, karst_error *error);
void karst_image_close(karst_image_reader *reader); /* NULL is fine */

#ifdef __cplusplus
}
#endif
#endif
