/* Fixed-point views of affine forms, from exact coefficients: see affine_shared.h. All functions are thread-safe. */
#ifndef KARST_LANGUAGE_AFFINE_H
#define KARST_LANGUAGE_AFFINE_H

#include "producers/language/ops/affine_shared.h"
#include "producers/language/base/number.h"

/* offset + sum of coefficient[i] * p[i], p in metres. */
typedef struct {
    karst_number coefficient[3], offset;
} karst_affine_value;

/* Its parts, each divided by (or times) a number: cells of MOD by b, octaves of a noise. */
karst_affine_value karst_affine_divide(karst_affine_value form, karst_number by);
karst_affine_value karst_affine_multiply(karst_affine_value form, karst_number by);

/* Level-0 voxels are 2^voxel_log2_m metres. */
karst_linear karst_linear_of(karst_affine_value form, int voxel_log2_m);
karst_lattice karst_lattice_of(karst_affine_value form, int voxel_log2_m);
/* period 0 if the form has several axes or none, or is no ratio that the view can hold as well as a lattice does. */
karst_period karst_period_of(karst_affine_value form, int voxel_log2_m);
karst_cells karst_cells_of(karst_affine_value form, int voxel_log2_m);
/* Octave `k` of a noise over three arguments (all zeros for one that is not affine). `seed` is that of the call,
 * noise_call_seed(world's seed, the noise's seed offset). */
karst_octave karst_octave_of(const karst_affine_value argument[3], karst_number lacunarity, karst_number gain,
                             uint32_t seed, int k, int voxel_log2_m);

#endif
