/* Eviction: slots that are recycled let go of what they held. One work-item for each victim; no two touch the same
 * thing, since a victim has one parent or owner, which is no victim itself. */
#include "cache/evict_shared.h"
#include "cache/identity_shared.h"
#include "cache/lru_shared.h"

/* Detaches a tile from its parent, if both say that they belong together. */
static void detach_tile(uint tile, __global karst_node *nodes, __global karst_tile_info *tile_info)
{
    uint parent = tile_info[tile].parent;
    if (parent == KARST_NO_NODE)
        return;
    uint link = nodes[parent].link;
    if (tile_info[parent / KARST_TILE_NODES].in_use &&
        tile_info[parent / KARST_TILE_NODES].generation == tile_info[tile].parent_generation &&
        KARST_NODE_CHILDREN(link) == tile)
        nodes[parent].link = KARST_NODE_LINK(KARST_NODE_STATE(link), KARST_NONE);
    tile_info[tile].parent = KARST_NO_NODE;
}

/* Detaches a brick from its node, which has lost it (or stays clear), if both say that they belong together. */
static void detach_brick(uint brick, __global karst_node *nodes, __global const karst_tile_info *tile_info,
                         __global karst_brick_owner *brick_owner)
{
    uint node = brick_owner[brick].owner;
    if (node == KARST_NO_NODE)
        return;
    if (tile_info[node / KARST_TILE_NODES].in_use &&
        tile_info[node / KARST_TILE_NODES].generation == brick_owner[brick].owner_generation &&
        nodes[node].brick == brick) {
        if (KARST_NODE_STATE(nodes[node].link) == KARST_STATE_BRICK)
            nodes[node].link = KARST_NODE_LINK(KARST_STATE_LOST, KARST_NODE_CHILDREN(nodes[node].link));
        nodes[node].brick = KARST_NONE;
    }
    brick_owner[brick].owner = KARST_NO_NODE;
}

__kernel void karst_evict_tiles(__global const uint *victims, __global const karst_lru_result *result,
                                __global karst_node *nodes, __global karst_tile_info *tile_info,
                                __global karst_brick_owner *brick_owner, __global karst_evicted_tile *evicted,
                                __global uint *freed)
{
    uint item = (uint)get_global_id(0);
    if (item >= result->num_taken)
        return;
    uint tile = victims[item];
    int level = tile_info[tile].level;
    long x = tile_info[tile].corner[0], y = tile_info[tile].corner[1], z = tile_info[tile].corner[2];
    evicted[item].slot = tile;
    evicted[item].name = karst_identity(KARST_IDENTITY_TILE, level, x, y, z);
    uint num_freed = 0;
    for (uint i = 0; i < KARST_TILE_NODES; i++) {
        uint node = tile * KARST_TILE_NODES + i, brick = nodes[node].brick;
        if (brick != KARST_NONE && brick_owner[brick].owner == node) {
            num_freed++;
            detach_brick(brick, nodes, tile_info, brick_owner);
            evicted[item].brick_names[i] =
                karst_identity(KARST_IDENTITY_BRICK, level, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2 & 1));
        } else {
            brick = KARST_NONE;
        }
        evicted[item].bricks[i] = brick;
        nodes[node].link = KARST_NODE_LINK(KARST_STATE_UNKNOWN, KARST_NONE);
        nodes[node].brick = KARST_NONE;
    }
    freed[item] = num_freed;
    detach_tile(tile, nodes, tile_info);
    tile_info[tile].in_use = 0;
}

__kernel void karst_evict_bricks(__global const uint *victims, __global const karst_lru_result *result,
                                 __global karst_node *nodes, __global const karst_tile_info *tile_info,
                                 __global karst_brick_owner *brick_owner, __global karst_evicted_brick *evicted)
{
    uint item = (uint)get_global_id(0);
    if (item >= result->num_taken)
        return;
    uint brick = victims[item], node = brick_owner[brick].owner, i = node % KARST_TILE_NODES,
         tile = node / KARST_TILE_NODES;
    evicted[item].slot = brick;
    evicted[item].name =
        karst_identity(KARST_IDENTITY_BRICK, tile_info[tile].level, tile_info[tile].corner[0] + (i & 1),
                       tile_info[tile].corner[1] + (i >> 1 & 1), tile_info[tile].corner[2] + (i >> 2 & 1));
    detach_brick(brick, nodes, tile_info, brick_owner);
}
