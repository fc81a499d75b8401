/* Samples of a file as kernels read them: a pyramid of spline coefficients, and bounds of it by tiles. Images have two
 * axes, fields three. Compiled twice: see core/device/dialect.h.
 *
 * A level is the uniform cubic B-spline of its coefficients: coefficient i has its peak at the whole
 * coordinate i. Level m + 1 is level m, smoothed, at every second coordinate: so a coordinate of level m is one of
 * level 0, shifted right by m bits, exactly. Beyond its edges an image repeats, or goes on with what its edges have.
 *
 * A tile of level m is four cells of that level wide. Its record bounds all levels from 0 to m there. Where edges go on
 * there is one more row of tiles on each side, which stands for all that lies farther out. An image has one plane of
 * coefficients and of tiles.
 */
#ifndef KARST_LANGUAGE_IMAGE_SHARED_H
#define KARST_LANGUAGE_IMAGE_SHARED_H

#include "core/device/dialect.h"

#define IMAGE_MOST_LEVELS 16

/* Worlds with fields say 3; others have no code for a third axis. The host has all. */
#ifndef IMAGE_MOST_AXES
#ifdef __OPENCL_C_VERSION__
#define IMAGE_MOST_AXES 2
#else
#define IMAGE_MOST_AXES 3
#endif
#endif

typedef struct {
    int size[3];  /* coefficients along each axis; powers of two where the image repeats */
    int tiles[3]; /* tiles along each axis; powers of two where it repeats */
    uint values;  /* where the coefficients begin: floats from the beginning of the header, row by row */
    uint bounds;  /* where the records of tiles begin */
} karst_image_level;
K_ASSERT_SIZE(karst_image_level, 32);
/* A level as ints: how many, and where its tiles and the place of its records stand. */
#define IMAGE_LEVEL_INTS 8
#define IMAGE_LEVEL_TILES 3
#define IMAGE_LEVEL_BOUNDS 7

/* What a tile's record says, each a float. */
enum {
    IMAGE_TILE_LOW, /* of the values */
    IMAGE_TILE_HIGH,
    IMAGE_TILE_DETAIL, /* at most by how much any two of the levels differ at one place */
    IMAGE_TILE_SLOPE   /* low and high along the first axis, then along the others: per cell of level 0 */
};
/* How long records are. */
#define IMAGE_TILE_FLOATS(num_axes) ((num_axes) == 3 ? 10 : 8)
#define IMAGE_TILE_MOST_FLOATS 10

typedef struct {
    uint num_levels; /* 1 to IMAGE_MOST_LEVELS */
    uint repeats;    /* 1: it does; 0: its edges go on */
    float low, high; /* of all values of all levels */
    float slope[6];  /* as in a tile's record, of all levels */
    uint num_axes;   /* 2 or 3 */
    uint num_packed; /* 0: a spline; or a texture's channels, 1 to 3 (texture.clh) */
    karst_image_level level[IMAGE_MOST_LEVELS];
} karst_image_header;
K_ASSERT_SIZE(karst_image_header, 560);

/* What follows the header of a texture: of each channel what 0 stands for, and what is added times the square of a
 * number. Its levels have no tiles, and `values` are words, twice as many along each axis as the spline's coefficients,
 * and one more in a row, and one more row, which are the first again: what the splines are at every half of a
 * coordinate, each a number of TEXTURE_BITS. Coordinates are those of level 0 of the splines. `low`, `high` and `slope`
 * are of all channels. The octave's amplitude says which one is meant. */
typedef struct {
    float low, step;
} karst_texture_channel;
K_ASSERT_SIZE(karst_texture_channel, 8);
#define TEXTURE_MOST_CHANNELS 3
#define TEXTURE_ROW_WORDS(size) ((size) + 1)
#define TEXTURE_BITS 10
#define TEXTURE_MOST ((1 << TEXTURE_BITS) - 1)

/* karst_octave.seed of an image: this, or 2^-56 times the octave's frequency is at most two to the power of that less
 * 56. */
#define IMAGE_FADED 0x10000u

#endif
