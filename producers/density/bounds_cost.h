/* What bounds of a world cost, told beforehand. */
#ifndef KARST_DENSITY_BOUNDS_COST_H
#define KARST_DENSITY_BOUNDS_COST_H

#include "producers/density/world_file.h"

/* Nanoseconds of a core for a node, roughly: by the operations that bounds look at, and octaves of noise. Thread-safe.
 */
double karst_bounds_cost_ns(const karst_tape *tape);

/* Hands a line about it to `print`. Thread-safe. */
void karst_bounds_cost_say(const karst_tape *tape, void (*print)(void *user, const char *line), void *user);

#endif
