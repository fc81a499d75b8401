/* Octrees of discs: the other way to show a model made of points (docs/POINTS.md). What is published about it: splats
 * in an octree, copied into the leaves that they touch and culled by probe rays (Kashyap and others). */
#ifndef KARST_CORE_POINTS_SPLATS_H
#define KARST_CORE_POINTS_SPLATS_H

#include <stdbool.h>

#include "core/points/splat_shared.h"
#include "karst/error.h"

/* A level of a model: its points, and how far apart these are, units. */
typedef struct {
    const karst_point *points;
    uint32_t num;
    double spacing;
} karst_splat_level;

typedef struct {
    karst_splat_node *nodes; /* the root first; malloc'ed */
    karst_point *discs;      /* malloc'ed */
    uint32_t num_nodes, num_discs;
    int root_log2;
    float spacings[KARST_SPLAT_MAX_DEPTH + 1];
    uint32_t num_leaves; /* nodes with discs */
    uint32_t num_copies; /* of the discs; the others are in the node that their centre lies in */
    uint32_t num_culled; /* copies that no probe ray needed */
    uint32_t num_left_out; /* of the finest levels, for want of room */
} karst_splat_tree;

/* The tree of a model's levels, the finest first, spacings rising. culls: copies are kept only where a probe ray that
 * meets none of a leaf's own discs meets them. Levels whose work would take more than max_bytes are left out, from the
 * finest on. The points are taken to be checked (karst_points_load_level). Thread-safe. Errors: KARST_FAILED (memory),
 * KARST_USAGE (not even the coarsest level fits), KARST_BAD_DATA (many points at one place, which no import
 * leaves). */
bool karst_splat_tree_build(const karst_splat_level *levels, uint32_t num_levels, bool culls, uint64_t max_bytes,
                            karst_splat_tree *tree, karst_error *error);
void karst_splat_tree_finish(karst_splat_tree *tree); /* a zeroed one is fine */

#endif
