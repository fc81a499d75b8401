/* What `karst check` says about a world that compiles. */
#ifndef KARST_LANGUAGE_CHECK_H
#define KARST_LANGUAGE_CHECK_H

#include "producers/language/language.h"

/* Hands lines for people, without newline, to `print`: warnings, parameters, noises and whether they are separable,
 * what has no bounds, the Lipschitz constant or what has none, numbers that need pairs of floats, how far a hundredth
 * of a voxel holds, the estimated cost. A line is valid during the call only. `program` must have compiled. Errors:
 * KARST_FAILED (memory). */
bool karst_language_check(const karst_program_graph *program, void (*print)(void *user, const char *line), void *user,
                          karst_error *error);

#endif
