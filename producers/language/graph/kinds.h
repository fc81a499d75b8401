/* From the canonical graph to the resolved one: how each value is computed (LANGUAGE, "kinds").
 *
 * What is affine in the position becomes an AFFINE leaf, exact however far; affine plus a float offset, where noise,
 * floor, fract, mod or a sine work on it, a SHIFTED. Numbers that a float cannot hold to a hundredth of a voxel become
 * pairs of floats. */
#ifndef KARST_LANGUAGE_KINDS_H
#define KARST_LANGUAGE_KINDS_H

#include "producers/language/graph/graph.h"

/* What the kinds depend on besides the graph. */
typedef struct {
    int voxel_log2_m;
    int exact_above_log2; /* a hundredth of which voxel numbers must tell: one 2^this times as wide as the finest */
    double extent_m;                             /* how far out the world means something; 0: not said */
    const double *parameter_min, *parameter_max; /* ranges of the parameters: kinds hold for all their values */
    size_t num_sharp_roots;                      /* those that come first and are not softened; 0 means 1 */
} karst_kinds_settings;

/* Interval of a float node's values over all space; lo > hi never; infinite where unbounded or unknown. */
typedef struct {
    double lo, hi;
} karst_range;

/* Fills the empty graph `resolved`, which may share the arena, and updates the roots. Where memory is out or the graph
 * is full, its `full` is called. */
void karst_kinds_resolve(const karst_graph *graph, const karst_kinds_settings *settings, karst_graph *resolved,
                         karst_expr *roots, size_t num_roots);

/* Sets the kinds of a graph's nodes from `first` on, without WIDE; those before have theirs. Arguments of uniform nodes
 * are uniform, and no position is left. */
void karst_kinds_set(karst_graph *graph, uint32_t first);
/* ranges.c: the range of each node of a graph, resolved or not; bools and ints included. `ranges` has num_nodes items.
 */
void karst_graph_ranges(const karst_graph *graph, const karst_kinds_settings *settings, karst_range *ranges);
/* The same of one node, by those of its arguments. */
karst_range karst_graph_range_of(const karst_graph *graph, karst_expr e, const karst_kinds_settings *settings,
                                 const karst_range *ranges);
/* widen.c: sets kind WIDE where floats do not do for the density, given the ranges. */
void karst_kinds_widen(karst_graph *resolved, const karst_kinds_settings *settings, const karst_range *ranges,
                       karst_expr density);

#endif
