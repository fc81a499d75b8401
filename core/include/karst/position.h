/* World positions: exact, as far as int64 voxels reach. */
#ifndef KARST_POSITION_H
#define KARST_POSITION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A point: per axis (x, y up, z) a level-0 voxel and a fraction of it in units of 2^-32.
 * The position in metres is (voxel + fraction / 2^32) * 2^voxel_log2_m. The world ends where |voxel + fraction / 2^32|
 * is 2^62. All functions are thread-safe. */
typedef struct {
    int64_t voxel[3];
    uint32_t fraction[3];
} karst_position;

#define KARST_VOXEL_LOG2_MIN (-40)
#define KARST_VOXEL_LOG2_MAX 40

/* Reads three decimals in metres ("12", "-0.5", ".5", "1e15"; digits and exponents of any length; blanks around them),
 * exactly, rounded once to 2^-32 voxel (nearest, ties to even). Takes time in proportion to the text, whatever the
 * exponent. *position changes only on success. Errors: KARST_USAGE naming the text and the axis, also when a coordinate
 * lies beyond the world's edge or voxel_log2_m is out of range. */
bool karst_position_parse(const char *x, const char *y, const char *z, int voxel_log2_m, karst_position *position,
                          karst_error *error);
/* One axis of the above. */
bool karst_coordinate_parse(const char *text, int voxel_log2_m, int64_t *voxel, uint32_t *fraction, karst_error *error);
/* The exact decimal text in metres of one axis (every binary fraction has one), without an exponent;
 * karst_coordinate_parse gives the same coordinate back. `size_bytes` of 160 always suffices; returns the length, as
 * snprintf does; -1 (and "") if voxel_log2_m is out of range. */
int karst_coordinate_format(int64_t voxel, uint32_t fraction, int voxel_log2_m, char *text, size_t size_bytes);
/* position + (x, y, z) metres, rounded once to 2^-32 voxel, saturating at the world's edge; a NaN moves nothing. */
karst_position karst_position_add_m(karst_position position, const double offset_m[3], int voxel_log2_m);
/* b - a in metres, as doubles; exact to 2^-52 of the result even far from the origin. */
void karst_position_difference_m(karst_position a, karst_position b, int voxel_log2_m, double difference_m[3]);

#ifdef __cplusplus
}
#endif
#endif
