/* Pictures on disk. */
#ifndef KARST_IMAGE_H
#define KARST_IMAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes 8-bit RGBA rows (top row first, width * 4 bytes a row) as a PNG without alpha. The same pixels give the same bytes. The file appears
 * whole or not at all (written beside, then renamed). Errors: KARST_FAILED naming the path and the reason. */
bool karst_image_write_png(const char *path, const uint8_t *rgba, int width_px, int height_px, karst_error *error);
/* Reads an 8-bit RGB or RGBA PNG into malloc'ed RGBA (the caller frees). Errors: KARST_BAD_DATA. */
uint8_t *karst_image_read_png(const char *path, int *width_px, int *height_px, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
