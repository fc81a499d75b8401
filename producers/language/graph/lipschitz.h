/* How steep a world can be: one number for all space, from the resolved graph. */
#ifndef KARST_LANGUAGE_LIPSCHITZ_H
#define KARST_LANGUAGE_LIPSCHITZ_H

#include "producers/language/graph/kinds.h"

typedef struct {
    double constant;  /* |f(a) - f(b)| <= constant * |a - b|, in real numbers; INFINITY if none is known */
    karst_expr cause; /* then: the first node that has none */
    bool jumps;       /* it is piecewise constant, and not even continuous */
} karst_lipschitz;

/* Of every node, given their ranges; `steepness` has num_nodes items. */
void karst_graph_lipschitz(const karst_graph *resolved, const karst_range *ranges, karst_lipschitz *steepness);

#endif
