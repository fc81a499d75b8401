/* Cubes of a world as an octree, with what bounds and samples say of each: what many searches ask again and again. All
 * that it says depends on the cube alone, so it makes no difference who asked before. */
#ifndef KARST_EXPORT_NEAR_TREE_H
#define KARST_EXPORT_NEAR_TREE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/position.h"
#include "karst/world.h"

/* Samples of a cube: 3 along each axis, x fastest. */
enum { KARST_NEAR_SAMPLES = 27 };

/* A cube of 2^level voxels along a side, aligned to its size. */
typedef struct {
    karst_position low;
    uint32_t node; /* of the tree */
    int level;
} karst_near_cube;

typedef struct karst_near_tree karst_near_tree;

/* Of cubes of 2^root_level (0 to 61) voxels. Borrows the sampler. NULL: out of memory. */
karst_near_tree *karst_near_tree_create(karst_sampler *sampler, double footprint_m, int voxel_log2_m, int root_level);
void karst_near_tree_destroy(karst_near_tree *tree); /* NULL is fine */

/* Before a search around this cube of the tree's own size, by its place among them. Forgets all cubes if there are
 * many, or if they are far from here: those that were given are no longer any. */
void karst_near_tree_begin(karst_near_tree *tree, const int64_t root[3]);

/* A cube of the tree's own size, not beyond the neighbours of the one that the search began at. false: out of memory.
 */
bool karst_near_tree_root(karst_near_tree *tree, const int64_t root[3], karst_near_cube *cube);
/* An eighth of a cube, child number x + 2 y + 4 z. false: out of memory. */
bool karst_near_tree_child(karst_near_tree *tree, const karst_near_cube *cube, int child, karst_near_cube *part);
/* 1: proved to be solid, -1: air, 0: neither. Also of what lies 2^-31 voxel beside it. A glance is a sample in its
 * middle, with slopes of what it is a part of; a side asks for bounds now and then, too, and is known before it is cut
 * into parts; a proof is by its samples, or bounds, of what is not cut. */
int karst_near_tree_glance(karst_near_tree *tree, const karst_near_cube *cube);
int karst_near_tree_side(karst_near_tree *tree, const karst_near_cube *cube);
int karst_near_tree_prove(karst_near_tree *tree, const karst_near_cube *cube);
/* A bit for each sample: it is solid. */
uint32_t karst_near_tree_solid(karst_near_tree *tree, const karst_near_cube *cube);

#endif
