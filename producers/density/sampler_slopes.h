/* By how much densities in a box differ, so that one of them may prove the sign of all. */
#ifndef KARST_PRODUCERS_SAMPLER_SLOPES_H
#define KARST_PRODUCERS_SAMPLER_SLOPES_H

#include <stdbool.h>

#include "karst/world.h"

/* Of any two places of a box, for the footprint that was asked for: densities there, as devices compute them, differ by
 * no more than slack + the sum over the axes of in_m times how many metres they are apart. */
typedef struct {
    double in_m[3], slack;
    bool is_known; /* else the rest means nothing */
} karst_sampler_slopes;

/* As karst_sampler_bounds; and `slopes` (may be NULL) of the same box. They are not known where models or edits may
 * change the density, and where it is told by its sign (steps). */
bool karst_sampler_prove(karst_sampler *sampler, const karst_position *centre, const double half_m[3],
                         double footprint_m, double range[2], karst_sampler_slopes *slopes);

#endif
