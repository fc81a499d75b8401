/* Values without position: what an operation gives for numbers that the host knows. */
#ifndef KARST_LANGUAGE_UNIFORM_H
#define KARST_LANGUAGE_UNIFORM_H

#include "producers/language/graph/graph.h"

/* Applies `op` (result `type`, arguments of type `argument_type`) to numbers; ints are exact integers in their type's
 * range, bools 0 or 1. Exact where the operation is rational, else in double. false: the op has no value of its own
 * here (leaves, noise). */
bool karst_uniform_apply(karst_op op, karst_scalar_type type, karst_scalar_type argument_type,
                         const karst_number arg[4], karst_number *result);

/* Evaluates every uniform node, given the parameters' values; values[i] is set where node i is uniform and known[i]
 * becomes 1. Both have num_nodes items. Noise is unknown here, and so is what hangs on it. Thread-safe. */
void karst_uniform_evaluate(const karst_graph *graph, const karst_number *parameters, karst_number *values,
                            uint8_t *known);

/* The value of one uniform expression, recursively; false if it holds noise or is very large. Marks the parameters that
 * it reads. */
bool karst_uniform_value(const karst_graph *graph, karst_expr e, const karst_number *parameters, bool *reads,
                         karst_number *value);

#endif
