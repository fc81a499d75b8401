/* Stores beside one another: their nodes follow the tree, whichever store's round changes it. */
#include "cache/evict_shared.h"
#include "cache/lru_shared.h"

/* After karst_publish_subdivides of the store that asked. used: 1 where the tile was linked there. */
__kernel void karst_beside_link(__global const uint *subdivide_nodes, __global const uint *subdivide_tiles,
                                __global const uint *used, uint num, __global karst_node *nodes)
{
    uint item = (uint)get_global_id(0);
    if (item >= num || !used[item])
        return;
    uint node = subdivide_nodes[item];
    nodes[node].link = KARST_NODE_LINK(KARST_NODE_STATE(nodes[node].link), subdivide_tiles[item]);
}

/* Before karst_evict_tiles, on the same victims. No two touch the same node: a victim's parent is no victim itself. */
__kernel void karst_beside_unlink(__global const uint *victims, __global const karst_lru_result *result,
                                  __global karst_node *nodes, __global const karst_tile_info *tile_info,
                                  __global karst_brick_owner *brick_owner, __global karst_evicted_tile *evicted)
{
    uint item = (uint)get_global_id(0);
    if (item >= result->num_taken)
        return;
    karst_evict_tile_beside(victims[item], nodes, tile_info, brick_owner, &evicted[item]);
}
