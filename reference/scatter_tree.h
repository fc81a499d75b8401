/* Proved bounds of an extinction in the nodes of an octree: the majorants of delta tracking.
 *
 * A node's bounds hold for every point of it, at every footprint. The node is split next whose bounds are farthest
 * apart times its volume: as many places are looked up in vain there, by rays from anywhere. */
#ifndef KARST_REFERENCE_SCATTER_TREE_H
#define KARST_REFERENCE_SCATTER_TREE_H

#include "karst/error.h"
#include "karst/position.h"
#include "karst/world.h"

typedef struct {
    double lo, hi;  /* of the extinction, per metre */
    uint32_t child; /* the first of eight, numbered by x, then y, then z; 0: it has none */
} karst_scatter_node;

/* Lengths in level-0 voxels, from the cube's corner. */
typedef struct {
    karst_position corner;
    double side;
    karst_scatter_node *nodes; /* the first is the cube */
    uint32_t num_nodes;
    double least[3], most[3]; /* of the box around all leaves that may hold something; empty: least > most */
    double majorant;          /* the largest bound of a leaf */
} karst_scatter_tree;

/* Around a place, as far as `reach` voxels at least, of the density that `sampler` gives. Errors: KARST_USAGE (a leaf
 * has no finite bound, a reach of more than 2^40), KARST_FAILED (memory). Finish it in any case. */
bool karst_scatter_tree_init(karst_scatter_tree *tree, karst_sampler *sampler, int voxel_log2_m,
                             const karst_position *around, double reach, uint32_t max_nodes, karst_error *error);
void karst_scatter_tree_finish(karst_scatter_tree *tree);

/* The leaf at a place of the cube, and where a ray that is there leaves it: how far along `direction` from `from`.
 * Thread-safe. */
const karst_scatter_node *karst_scatter_tree_leaf(const karst_scatter_tree *tree, const double from[3],
                                                  const double direction[3], double t, double *exit);

#endif
