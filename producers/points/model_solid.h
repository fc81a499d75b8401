/* What is inside a closed model: cells of its own places, a bit each, made when it is opened.
 *
 * The surface of points is a crust, some three spacings thick on either side (points.clh). A body of clear matter must
 * be whole. Cells whose middle lies in the crust's inner half are a wall. What cannot be reached from outside without
 * passing it is inside, unless more of its own border is the outer side of crusts than not: then it is a hollow. So a
 * model whose points leave holes wider than their crust has nothing inside, and stays one.
 *
 * There are two planes of bits for cells: `inside` (the wall's, too, whose places may lie beyond its points' reach) and
 * `deep` (not the wall's: there the crust says nothing, whatever its far end says). Cells eight times as large follow,
 * level by level up to one of all, with two planes each: whether any of their cells is inside, and whether all are
 * deep. */
#ifndef KARST_PRODUCERS_POINTS_MODEL_SOLID_H
#define KARST_PRODUCERS_POINTS_MODEL_SOLID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"
#include "producers/points/points_shared.h"

/* Cells around a box of points whose supports reach so far, for a level of that spacing. false: there would be more
 * than KARST_SOLID_MOST_CELLS. Lengths in units. */
#define KARST_SOLID_MOST_CELLS ((uint64_t)1 << 24)
bool karst_solid_plan(karst_model_solid *solid, const double half[3], double reach, double spacing);
/* All planes, in 64-bit words. */
size_t karst_solid_words(const karst_model_solid *solid);
/* Makes them, from the points of a level in `data` (points_shared.h), at solid->words of it. *num_inside: deep cells.
 * Errors: KARST_FAILED. */
bool karst_solid_fill(uint64_t *data, const karst_model_level *level, const karst_model_solid *solid,
                      uint64_t *num_inside, karst_error *error);

#endif
