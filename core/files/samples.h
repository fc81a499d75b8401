/* Samples of a file as floats: pictures and maps of heights. PNG, TIFF and OpenEXR are told by their first bytes; what
 * begins like none of them is raw numbers, if the caller says which. */
#ifndef KARST_CORE_SAMPLES_H
#define KARST_CORE_SAMPLES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"

#define KARST_SAMPLES_MOST_SIDE 32768u
#define KARST_SAMPLES_MOST ((size_t)1 << 28) /* width x height; of three channels together */
/* Of more than so many numbers, values lie in a file that has no name, mapped, in $TMPDIR or /tmp. */
#define KARST_SAMPLES_MOST_IN_MEMORY ((size_t)1 << 27)

/* What the caller knows of a file. */
typedef struct {
    bool has_range; /* unsigned whole numbers become low to high, instead of what they are */
    double low, high;
    const char *format; /* of raw numbers: "uint8", "uint16", "int16", "float32", little-endian; NULL: it is none */
    uint32_t shape[2];  /* of raw numbers: how many in a row, and how many rows */
} karst_samples_form;

/* Row by row, the channels of a sample together: 1, or 3 (linear red, green, blue). */
typedef struct {
    uint32_t width, height, num_channels;
    float *values;       /* finite; malloc'ed, or mapped */
    size_t mapped_bytes; /* 0: they are malloc'ed */
    uint32_t num_bits;   /* of whole numbers in the file; 0: it has others */
    const char *kind;    /* "PNG, 16 bits" and so on, for people */
    char kind_text[40];
} karst_samples;

/* Reads a whole file. Without a range whole numbers of a PNG become 0 to 1 (colours of 8 bits by the transfer function
 * of sRGB), those of other files stay as they are. Alpha is left out. Errors, each with the path: KARST_BAD_DATA
 * (missing, no regular file, damaged, of a kind that is not read, too large, a value that is not finite: with its row
 * and column), KARST_FAILED (memory). Nothing is allocated before the file's sizes are checked. Thread-safe. */
bool karst_samples_read(const char *path, const karst_samples_form *form, karst_samples *samples, karst_error *error);
void karst_samples_finish(karst_samples *samples); /* a zeroed one is fine */

/* Pages of mapped values that are in memory are let go: they come again when they are touched. Others stay. */
void karst_samples_let_go(const karst_samples *samples);

#endif
