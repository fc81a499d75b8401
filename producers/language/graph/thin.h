/* Whether a world can hold matter that is thinner than the detail which is asked for, and where it may jump. */
#ifndef KARST_LANGUAGE_THIN_H
#define KARST_LANGUAGE_THIN_H

#include <stdbool.h>

#include "producers/language/graph/graph.h"

typedef struct {
    bool may_be_thin; /* false of sums of noise and linear forms: what is narrower than a voxel has faded out of such */
    bool has_noise;
    bool has_thin_apart; /* of what its minima and maxima join, something has no noise in it and may be thin: a house on
                           * hills */
    bool may_jump; /* it asks on which side of something a place is, or for a whole number; or what fract, mod or an
                    * angle is made into jumps where they do */
} karst_thin_facts;

karst_thin_facts karst_graph_thin_facts(const karst_graph *resolved, karst_expr density);

#endif
