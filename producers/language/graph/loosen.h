/* Densities that are cut off, as by clamp(d, -1, 1): only where a density is positive counts, but what is cut off near
 * its surface says no more than on which side it is, and samples wide apart cannot tell where between them the surface
 * lies. So what is cut off is executed, without the cuts. */
#ifndef KARST_LANGUAGE_LOOSEN_H
#define KARST_LANGUAGE_LOOSEN_H

#include "producers/language/graph/kinds.h"

/* Of a canonical graph, to which it adds nodes: what has the density's sign everywhere, and no cuts by numbers;
 * `density` itself where there are none, or where what is cut off may be no number (as 0 / 0 is none). Memory comes
 * from the graph's arena; where the graph is full, its `full` is called. */
karst_expr karst_loosen(karst_graph *graph, const karst_kinds_settings *settings, karst_expr density);

#endif
