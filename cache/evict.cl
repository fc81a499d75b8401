/* Eviction: slots that are recycled let go of what they held. One work-item for each victim; no two touch the same
 * thing, since a victim has one parent or owner, which is no victim itself. */
#include "cache/evict_shared.h"
#include "cache/lru_shared.h"

__kernel void karst_evict_tiles(__global const uint *victims, __global const karst_lru_result *result,
                                __global karst_node *nodes, __global karst_tile_info *tile_info,
                                __global karst_brick_owner *brick_owner, __global karst_evicted_tile *evicted,
                                __global uint *freed)
{
    uint item = (uint)get_global_id(0);
    if (item >= result->num_taken)
        return;
    freed[item] = karst_evict_tile(victims[item], nodes, tile_info, brick_owner, &evicted[item]);
}

__kernel void karst_evict_bricks(__global const uint *victims, __global const karst_lru_result *result,
                                 __global karst_node *nodes, __global const karst_tile_info *tile_info,
                                 __global karst_brick_owner *brick_owner, __global karst_evicted_brick *evicted)
{
    uint item = (uint)get_global_id(0);
    if (item >= result->num_taken)
        return;
    karst_evict_brick(victims[item], nodes, tile_info, brick_owner, &evicted[item]);
}
