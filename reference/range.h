/* What a world's density does along a piece of a ray: its range, and the range of its slope, proven.
 *
 * Everything is in double and in one variable, the distance along the ray. Each node of the graph carries its value at
 * the middle of the piece, its range over it, and the range of its derivative; the range is met with the mean value
 * form, middle + slope * [-half, half]. Noise is bounded by its value, gradient and Hessian at the middle and the
 * proved suprema of noise/bounds.clh. What jumps has no slope. This shares no code with the bounds that devices use
 * (producers/language/tape/tape_bounds.clh): only the operations of what is piecewise constant, which are floats by
 * definition. Lattice places keep all of their 56 bits, where devices and the oracle keep 24 and 32.
 */
#ifndef KARST_REFERENCE_RANGE_H
#define KARST_REFERENCE_RANGE_H

#include "karst/error.h"
#include "karst/position.h"
#include "producers/language/language.h"
#include "reference/interval.h"

typedef struct karst_ranger karst_ranger;

/* For a program that outlives it. `parameters`: a value for each. Make rangers of one program from one thread; then
 * each may be used by a thread of its own. Errors: KARST_FAILED (memory). */
karst_ranger *karst_ranger_create(const karst_program_graph *program, const karst_number *parameters, uint32_t seed,
                                  karst_error *error);
void karst_ranger_destroy(karst_ranger *ranger); /* NULL is fine */

/* The density at anchor + t * direction (level-0 voxels), band-limited to voxels of `level`; -1: full detail. Places
 * are rounded to 2^-32 voxel. */
double karst_ranger_density(karst_ranger *ranger, const karst_position *anchor, const double direction[3], double t,
                            int level);

typedef struct {
    interval value;  /* of the density, over the piece */
    interval slope;  /* of its derivative by t, per level-0 voxel; the whole line where it may jump */
    interval middle; /* of the density at the middle of the piece */
} karst_piece;

/* Over [from, to] of the ray, from <= to. */
karst_piece karst_ranger_piece(karst_ranger *ranger, const karst_position *anchor, const double direction[3],
                               double from, double to, int level);

/* The gradient at a place, per level-0 voxel; false where it has none (a jump, or not finite). At a kink it is that of
 * one side, or between the sides'. */
bool karst_ranger_gradient(karst_ranger *ranger, const karst_position *anchor, const double direction[3], double t,
                           int level, double gradient[3]);

/* Of a density that jumps up between two places next to one another on a ray: the gradient of the argument that passes
 * what it jumps at (the x of floor(x), a - b of a < b), turned so that it rises along the ray. false: none is known to
 * jump there, or it touches. */
bool karst_ranger_jump(karst_ranger *ranger, const karst_position *anchor, const double direction[3], double before,
                       double behind, int level, double gradient[3]);

/* anchor + t * direction, rounded to 2^-32 voxel. */
karst_position karst_reference_place(const karst_position *anchor, const double direction[3], double t);

#endif
