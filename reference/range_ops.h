/* The ops of the graph over a piece of a ray: ranges of values, and of slopes. Private to reference/. */
#ifndef KARST_REFERENCE_RANGE_OPS_H
#define KARST_REFERENCE_RANGE_OPS_H

#include "producers/language/graph/graph.h"
#include "reference/interval.h"

/* Of one node: the value at the middle, over the piece, and the slope over the piece. Bools are 0, 1 or between; ints
 * one number, or the whole line. */
typedef struct {
    interval middle, value, slope;
} karst_node_range;

/* The range of a float op for arguments in a, b, c, d (those it has not are [0, 0]). */
interval karst_range_of_op(karst_op op, interval a, interval b, interval c, interval d);
/* Of its slope; the whole line where it may jump. `value`: what karst_range_of_op gave for the piece. */
interval karst_slope_of_op(karst_op op, const karst_node_range *a, const karst_node_range *b, const karst_node_range *c,
                           const karst_node_range *d, interval value);
/* Comparisons and logic: [0, 0], [1, 1] or [0, 1]. */
/* Of an op that gives an int, or a uint; the whole line where it may wrap, or is not known. */
interval karst_range_of_whole(karst_op op, bool is_unsigned, interval a, interval b, interval c);
interval karst_truth_of_op(karst_op op, interval a, interval b);

/* sin (or cos) of radians. */
interval karst_range_of_sine(interval a, bool is_cosine);

#endif
