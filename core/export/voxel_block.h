/* Values of a block of 64^3 voxels. */
#ifndef KARST_EXPORT_VOXEL_BLOCK_H
#define KARST_EXPORT_VOXEL_BLOCK_H

#include "karst/query.h"
#include "karst/voxels.h"

enum {
    VOXEL_BLOCK = 64,
    VOXEL_MARGIN = KARST_VOXELS_BAND + 1, /* what distances in a block depend on around it */
    VOXEL_LEAVES = VOXEL_BLOCK / 8,       /* of a block, along an axis */
    VOXEL_SIDE = VOXEL_BLOCK + 2 * VOXEL_MARGIN,
    VOXEL_CELLS = VOXEL_SIDE / VOXEL_MARGIN
};
_Static_assert(VOXEL_SIDE % VOXEL_MARGIN == 0 && 8 % VOXEL_MARGIN == 0, "a leaf and its margin are whole cells");

typedef struct {
    const karst_voxels_config *config;
    const karst_voxels_grid *grid;
    karst_query_config query;
    uint64_t num_samples;
    /* Room for one block, index (x * VOXEL_SIDE + y) * VOXEL_SIDE + z from a margin below its corner. */
    karst_position *at;
    uint32_t *index; /* of what is asked for */
    float *found, *density;
    float *nearest; /* squared distance to the nearest crossing, in voxels */
    uint32_t *crossing_of;
    struct voxel_crossing *crossings;
    size_t num_crossings, room_for_crossings;
} karst_voxel_block;

bool karst_voxel_block_begin(karst_voxel_block *block, const karst_voxels_config *config, const karst_voxels_grid *grid,
                             karst_error *error);
void karst_voxel_block_finish(karst_voxel_block *block); /* a zeroed one is fine */

/* The centre of a place in voxels from the box's corner; the same place is the same position, whoever asks. */
karst_position karst_voxel_place(const karst_voxel_block *block, const double at[3]);

/* Samples the leaves that are wanted, of the block that begins at a voxel. */
bool karst_voxel_block_sample(karst_voxel_block *block, const int32_t corner[3],
                              const bool wanted[VOXEL_LEAVES * VOXEL_LEAVES * VOXEL_LEAVES], karst_error *error);
/* The values of a leaf that was wanted, and which are active: bit i of `active`. */
void karst_voxel_block_leaf(const karst_voxel_block *block, const int32_t corner[3], const int leaf[3],
                            float values[512], uint64_t active[8]);
/* What voxels are that lie far from all surfaces. */
float karst_voxel_far(const karst_voxel_block *block, bool is_solid);

#endif
