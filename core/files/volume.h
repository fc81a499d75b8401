/* Samples of a box in space, read from a grid of floats in a NanoVDB file (nano_layout.h). */
#ifndef KARST_CORE_VOLUME_H
#define KARST_CORE_VOLUME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"

#define KARST_VOLUME_MOST_SIDE 4096u
#define KARST_VOLUME_MOST ((size_t)1 << 25)         /* samples */
#define KARST_VOLUME_MOST_BYTES ((uint64_t)1 << 28) /* of a grid in memory, before it is laid out */

/* The box of the grid's active values, with what is inactive in it: rows along x, then y, then z. */
typedef struct {
    uint32_t size[3];
    float *values;      /* finite; malloc'ed */
    double voxel_m;     /* how far samples lie apart */
    double first_m[3];  /* where the first one lies, in the file's own coordinates */
    char kind_text[40]; /* "NanoVDB, level set", for people */
} karst_volume;

/* Reads the grid of that name; NULL: the first. Not compressed or by zlib, of NanoVDB 32, with axes that are neither
 * turned nor stretched. Errors, each with the path: KARST_BAD_DATA (missing, no regular file, damaged, of a kind that
 * is not read, too large, a value that is not finite), KARST_FAILED (memory). Sizes are checked before anything is
 * allocated, and every place in the file before it is looked at. Thread-safe. */
bool karst_volume_read(const char *path, const char *grid, karst_volume *volume, karst_error *error);
void karst_volume_finish(karst_volume *volume); /* a zeroed one is fine */

#endif
