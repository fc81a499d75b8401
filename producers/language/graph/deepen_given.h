/* Flat air that sums of kernels make: r < R ? k(r) : 0, s += q * q * q where d < 1, and fades of a share.
 *
 * A choice's arm is only what its condition lets in. So what is compared with a number is cut off there in the arm:
 * k(min(r, R)). Then its range tells that it is never negative, and whether it runs from 0 in one
 * direction, so that its argument tells as well where it is positive. */
#ifndef KARST_LANGUAGE_DEEPEN_GIVEN_H
#define KARST_LANGUAGE_DEEPEN_GIVEN_H

#include "producers/language/graph/kinds.h"

/* The density with arms cut off, of the same value everywhere; `density` itself where there is none. What an arm adds
 * to a sum is made an arm of its own first. Of a canonical graph, to which it adds nodes. */
karst_expr karst_given_enter(karst_graph *graph, karst_expr density);
/* The same field without the cuts, which in arms change nothing. */
karst_expr karst_given_leave(karst_graph *graph, karst_expr density);

/* A node that one other decides, which runs from `lo` to `hi`; at one of these ends the node is 0, and it grows from
 * there on, strictly. */
typedef struct {
    karst_expr of; /* KARST_NO_EXPR: it is not so */
    double lo, hi;
    bool rises; /* 0 at lo */
} karst_fade;

/* Ranges of all nodes, as karst_graph_ranges has them, but closer: rounding keeps order, so that sums and products end
 * where floats do; and of what one number with ends decides, strictly growing or falling, by its ends. Whether it grows
 * is looked at in many places, which is no proof: it is for nodes whose sign alone counts, and no more than a surface
 * without thickness hangs on it. `fades`: of each node. Both have num_nodes items. */
void karst_given_ranges(const karst_graph *graph, const karst_kinds_settings *settings, karst_range *ranges,
                        karst_fade *fades);

#endif
