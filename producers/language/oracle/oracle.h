/* The host's oracle: what a resolved world is worth at a point, evaluated node by node.
 *
 * Each evaluation gives two values:
 *   - the float, with the device's own operations (ops.clh and its like, compiled as C with one lane): what every
 * device must give, bit for bit;
 *   - the double: affine forms from fixed point, everything between in double, with noise in double; what is piecewise
 * constant is the device's float, else every hash of a sine would differ; and fract and mod of what such things see
 * jump where its floats do. How far the two are apart is the float's error. Slow, and meant to be: no code is shared
 * with what generates kernels, except the operations themselves.
 */
#ifndef KARST_LANGUAGE_ORACLE_H
#define KARST_LANGUAGE_ORACLE_H

#include "karst/error.h"
#include "karst/position.h"
#include "producers/language/graph/data.h"
#include "core/base/facing_shared.h"

typedef struct karst_oracle karst_oracle;

typedef struct {
    float device; /* bit for bit; bools are 0 or 1, ints rounded */
    double precise;
} karst_oracle_value;

/* For a world whose resolved graph outlives the oracle. `parameters`: a value for each PARAMETER. Errors: KARST_FAILED
 * (memory). The layout it makes lies in the graph's arena: make oracles of one graph from one thread. */
karst_oracle *karst_oracle_create(const karst_resolved_world *world, const karst_number *parameters, uint32_t seed,
                                  int voxel_log2_m, karst_error *error);
/* Another oracle of the same, for another thread. `oracle` must outlive it, and may be in use meanwhile. Thread-safe.
 * Errors: KARST_FAILED (memory). */
karst_oracle *karst_oracle_clone(const karst_oracle *oracle, karst_error *error);
void karst_oracle_destroy(karst_oracle *oracle); /* NULL is fine */

/* What it evaluates: the layout of its world, and the data that goes with it, as devices read it. Borrowed; live as
 * long as the oracle. Thread-safe. */
const karst_world_layout *karst_oracle_layout(const karst_oracle *oracle);
const uint64_t *karst_oracle_words(const karst_oracle *oracle);

/* One thread at a time per oracle, for all that follow. */

/* Density at a position, band-limited to the voxel of `level`; -1: full density. */
karst_oracle_value karst_oracle_density(karst_oracle *oracle, const karst_position *at, int level);
/* The density that the text states, which is the same but where that is exactly 0 in air (deepen.h). */
karst_oracle_value karst_oracle_text_density(karst_oracle *oracle, const karst_position *at, int level);
/* The density as a double alone, in less time. */
double karst_oracle_precise_density(karst_oracle *oracle, const karst_position *at, int level);
/* What shading runs, by number of the root; what the world does not give, and its densities, as they usually are. The
 * world must have a colour. `facing`: core/base/facing_shared.h. */
void karst_oracle_shading(karst_oracle *oracle, const karst_position *at, const float facing[KARST_FACING_FLOATS],
                          int level, karst_oracle_value values[KARST_NUM_ROOTS]);
/* The colour alone of that: linear RGB. */
void karst_oracle_colour(karst_oracle *oracle, const karst_position *at, const float facing[KARST_FACING_FLOATS],
                         int level, karst_oracle_value rgb[3]);
/* The density, and its gradient per metre; the world must have one (derive.h). */
karst_oracle_value karst_oracle_gradient(karst_oracle *oracle, const karst_position *at, int level,
                                         karst_oracle_value gradient[3]);
/* Any node of the graph that the last call needed. */
karst_oracle_value karst_oracle_node(const karst_oracle *oracle, karst_expr e);

#endif
