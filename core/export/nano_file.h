/* A grid of floats as a part of a NanoVDB file, written while it is found. Of what is in it, upper nodes are kept in
 * memory (264 KiB for each 4096^3 values), lower nodes and leaves go to files without names. */
#ifndef KARST_EXPORT_NANO_FILE_H
#define KARST_EXPORT_NANO_FILE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "karst/error.h"

typedef struct {
    const char *name;
    uint32_t grid_class; /* of nano_layout.h */
    double voxel_m, origin_m[3];
    float background;
} karst_nano_about;

typedef struct karst_nano_writer karst_nano_writer;

#define KARST_NANO_PARTS 3

/* `path`: where the whole file will be. `about` is borrowed until the end. NULL with an error. */
karst_nano_writer *karst_nano_begin(const char *path, const karst_nano_about *about, karst_error *error);
void karst_nano_end(karst_nano_writer *writer); /* NULL is fine */

/* An inactive value for a cube of 2^size_log2 values a side, 3 to 12, at a multiple of that; below 7 in the lower node
 * that is open. What is not said is the background. */
bool karst_nano_tile(karst_nano_writer *writer, const int32_t at[3], int size_log2, float value, karst_error *error);
/* Leaves and tiles of a lower node follow its beginning. */
void karst_nano_begin_lower(karst_nano_writer *writer, const int32_t at[3]);
/* Bit i of `active` stands for values[i]. */
bool karst_nano_add_leaf(karst_nano_writer *writer, const int32_t at[3], const float values[512],
                         const uint64_t active[8], karst_error *error);
bool karst_nano_end_lower(karst_nano_writer *writer, karst_error *error);

/* Makes the grid's bytes, in three parts that follow one another, which the writer goes on owning. */
bool karst_nano_finish(karst_nano_writer *writer, FILE *parts[KARST_NANO_PARTS], karst_error *error);
/* Of a finished one. */
uint64_t karst_nano_num_active(const karst_nano_writer *writer);
uint64_t karst_nano_num_leaves(const karst_nano_writer *writer);

#endif
