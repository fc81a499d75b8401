/* The gradient of a density as a graph: three more outputs of the same kind, so that every back end has it.
 *
 * Forward differentiation, node by node, of the resolved graph. Where a density has a kink (a tie of min or max, a zero
 * of abs, a choice whose sides agree) each component is one of the two one-sided slopes of the density along its axis,
 * whatever kinks its terms have there: of the side that `select` takes, where that is one of them. Jumps contribute 0,
 * and so does what is piecewise constant, and a root or a length at 0. Ties are not looked at, and the slope is that of
 * the terms that `select` takes, where two terms jump, one to each side, and the density does not; and in densities
 * whose gradient would be too large for generated code with both sides in it. Where a density is not finite, its
 * gradient need not be. */
#ifndef KARST_LANGUAGE_DERIVE_H
#define KARST_LANGUAGE_DERIVE_H

#include "karst/error.h"
#include "producers/language/graph/data.h"

/* Immutable once made: any number of threads may read it; karst_oracle_create and karst_world_layout_init write to its
 * arena. */
typedef struct {
    karst_arena arena;
    karst_graph graph;
    karst_resolved_world world; /* the same density, without colour, and its gradient */
} karst_gradient_world;

/* Of a resolved world without derivatives of noise, which need not outlive it. Destroy with
 * karst_gradient_world_destroy. Errors: KARST_BAD_WORLD (the gradient is too large), KARST_FAILED (memory). */
karst_gradient_world *karst_derive(const karst_resolved_world *world, karst_error *error);
/* The same for bounds: everywhere the slopes of the terms that `select` takes, and never what is no number. So bounds
 * over a box are those of all smooth sides that meet there, whatever jumps between them. `beside` is a float of the
 * same graph, or KARST_NO_EXPR, that the world keeps as `text`. */
karst_gradient_world *karst_derive_sides(const karst_resolved_world *world, karst_expr beside, karst_error *error);
void karst_gradient_world_destroy(karst_gradient_world *world); /* NULL is fine */

#endif
