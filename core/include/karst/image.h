/* Pictures on disk. */
#ifndef KARST_IMAGE_H
#define KARST_IMAGE_H

#include <stdbool.h>
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
 * *height_px change only on success. NULL and KARST_BAD_DATA naming the path and the reason for any other file.
 * Thread-safe. */
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

#ifdef __cplusplus
}
#endif
#endif
