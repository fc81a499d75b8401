/* Whether a world can hold matter that is thinner than the detail which is asked for. */
#ifndef KARST_LANGUAGE_THIN_H
#define KARST_LANGUAGE_THIN_H

#include <stdbool.h>

#include "producers/language/graph/graph.h"

/* False if the density is a sum of noise and linear forms: what is narrower than a voxel has faded out of such. */
bool karst_graph_may_be_thin(const karst_graph *resolved, karst_expr density);

#endif
