/* Air that is exactly 0, made deep: occupancy (1 in solid, 0 in air), max(0, x), clamp(x, 0, 1) and what is made of
 * such. What counts of a density is where it is positive; but a field that is flat says neither where between two
 * samples the surface lies nor which way it faces. So another field is executed, which is positive in the same places:
 *
 * - of what takes few values, decided by comparisons alone, the differences that are compared: b - a of a < b;
 * - else the same with what was flat made negative: the x of max(0, x), -1 for the 0 beside a 1; and x for what has x's
 *   sign and is flatter (deepen_forms.h). */
#ifndef KARST_LANGUAGE_DEEPEN_H
#define KARST_LANGUAGE_DEEPEN_H

#include "producers/language/graph/kinds.h"

/* Of a canonical graph, to which it adds nodes; returns `density` itself where no air is flat. Memory comes from the
 * graph's arena; where the graph is full, its `full` is called. */
karst_expr karst_deepen(karst_graph *graph, const karst_kinds_settings *settings, karst_expr density);

#endif
