/* Affine forms of the position, and octaves of noise over them, as the host prepares them and devices read them.
 *
 * A position along an axis is voxel + fraction / 2^32 level-0 voxels: int64 and uint32, exact. An AFFINE leaf has up to
 * three views, all in fixed point, each rounded once from the exact coefficients by affine.c: what they make of a
 * position is exact, on every device.
 */
#ifndef KARST_LANGUAGE_AFFINE_SHARED_H
#define KARST_LANGUAGE_AFFINE_SHARED_H

#include "core/device/dialect.h"

/* Its float: (sum of factor[i] * position[i] + offset) * scale[0] * scale[1], the sum in 128 bits, each product rounded
 * down to a whole unit. The larger factors have 62 bits, so the sum is as good at 10^15 voxels as at 0. */
typedef struct {
    long factor[3];
    long offset_high; /* offset = offset_high * 2^64 + offset_low */
    ulong offset_low;
    float scale[2]; /* powers of two; NaN where a coefficient is not finite */
} karst_linear;
K_ASSERT_SIZE(karst_linear, 48);

/* Its lattice coordinate: the sum of frequency[i] * position[i] (in 2^-56 cells, rounded down each) + offset, modulo
 * 2^64 cells. The same as noise_coordinate_at for one axis and no offset. Frequencies wrap beyond +-128 cells a voxel.
 */
typedef struct {
    long frequency[3]; /* cells per level-0 voxel, Q8.56 */
    long cell;         /* offset: whole cells, */
    long fraction;     /* and 2^-56 cells: 0 to 2^56 - 1 */
} karst_lattice;
K_ASSERT_SIZE(karst_lattice, 40);

/* Of one axis, as a ratio: +-(position - offset) * repeats / period cells, exact where the text is (a period of 0.3 m
 * is three tenths) */
typedef struct {
    uint period;  /* 1 to 2^31 - 1 voxels; 0: there is no such view */
    uint repeats; /* 0 to 2^31 - 1 cells in that many voxels */
    int axis;
    int negative; /* 1: falls with the position */
    long offset_voxel;
    uint offset_fraction; /* 2^-32 voxel */
    uint unused;
} karst_period;
K_ASSERT_SIZE(karst_period, 32);

/* What FLOOR, FRACT and MOD of an AFFINE (MOD: of a / b) work on: the period where there is one, else the lattice. */
typedef struct {
    karst_lattice lattice;
    karst_period period;
} karst_cells;
K_ASSERT_SIZE(karst_cells, 72);

/* The frequency of an octave with 127 cells a voxel or more (or whose argument is not finite): no footprint shows more
 * of it than its mean, not even full detail. */
#define KARST_OCTAVE_FADED 0x7fffffffffffffffL

/* One octave of a noise. Argument i lies at lattice[i], moved by scale * (its float part) cells: the offset of a
 * SHIFTED argument, or all of an argument that is neither AFFINE nor SHIFTED (whose lattice has frequencies 0). Octave
 * k's lattice moves by k golden sections besides, so that the lattices of different octaves share no nodes. */
typedef struct {
    karst_lattice lattice[3];
    float scale;     /* lacunarity^k */
    float amplitude; /* gain^k */
    uint seed;
    uint image; /* of an image (image_shared.h): words from this record to its header; 0: a noise */
    long frequency; /* Q8.56: largest sum of |frequency[i]| over the arguments: what the band limit goes by; or
                       KARST_OCTAVE_FADED */
} karst_octave;
K_ASSERT_SIZE(karst_octave, 144);

#endif
