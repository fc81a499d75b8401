/* A load on its way through evaluate and finalise. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_PRODUCERS_LOAD_SHARED_H
#define KARST_PRODUCERS_LOAD_SHARED_H

#include "cache/layout_shared.h"

/* One node whose brick is wanted: where it lies, and what is proven of it before any sample is taken. */
typedef struct {
    long origin[3]; /* level-0 voxel of sample (0, 0, 0) */
    int level;
    uint state;  /* KARST_STATE_AIR or _SOLID: its bounds prove it, no samples are needed; KARST_STATE_UNKNOWN otherwise
                  */
    float doubt; /* by how much the density may differ between a point of the node, at any footprint from 0 to its
                    parent's voxel, and the sample nearest to it. Not finite: not known */
    uint keep;   /* 1: the node is known to be clear, and its brick is wanted all the same */
} karst_load;
K_ASSERT_SIZE(karst_load, 40);

/* What was scrubbed from one load's samples, and what became of thin matter (raise.clh). */
typedef struct {
    uint count;    /* samples that were not finite */
    uint first;    /* index of the first of them; KARST_NO_SAMPLE if count is 0 */
    uint raised;   /* samples */
    uint given_up; /* samples beside which thin matter may be and was not found */
} karst_scrub;
K_ASSERT_SIZE(karst_scrub, 16);
#define KARST_NO_SAMPLE 0xffffffffu

/* The sum of that since the producer was created. */
typedef struct {
    ulong count;
    long voxel[3]; /* of the first: its level-0 voxel */
    int level;     /* and its brick's level */
    uint pad;
    ulong raised, given_up;
} karst_scrub_total;
K_ASSERT_SIZE(karst_scrub_total, 56);

/* Node coordinates of node index `node`, from its tile; returns its level. */
K_INLINE int karst_node_corner(K_GLOBAL const karst_tile_info *tile_info, uint node, long corner[3])
{
    K_GLOBAL const karst_tile_info *info = tile_info + node / KARST_TILE_NODES;
    corner[0] = info->corner[0] + (node & 1u);
    corner[1] = info->corner[1] + (node >> 1 & 1u);
    corner[2] = info->corner[2] + (node >> 2 & 1u);
    return info->level;
}

/* Whether the brick of a node is wanted that is known to be clear: karst_load.keep. */
K_INLINE uint karst_node_is_clear(karst_node node)
{
    uint state = KARST_NODE_STATE(node.link);
    return state == KARST_STATE_CLEAR_AIR || state == KARST_STATE_CLEAR_SOLID;
}

/* The sample (0, 0, 0) of node `n` (one axis) of a level, in level-0 voxels. */
K_INLINE long karst_node_origin(long n, int level) { return (long)((ulong)n << (level + KARST_BRICK_CELLS_LOG2)); }

#endif
