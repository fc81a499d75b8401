/* Eviction: slots that are recycled let go of what they held. One work-item for each victim; no two touch the same
 * thing, since a victim has one parent or owner, which is no victim itself. */
#include "cache/identity_shared.h"
#include "cache/layout_shared.h"

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

/* bricks: eight for each tile, those that its nodes had (0: none); identities: nine, the tile's and then the bricks'.
 */
__kernel void karst_evict_tiles(__global const uint *victims, uint num, __global karst_node *nodes,
                                __global karst_tile_info *tile_info, __global karst_brick_owner *brick_owner,
                                __global uint *bricks, __global ulong *identities)
{
    uint item = (uint)get_global_id(0);
    if (item >= num)
        return;
    uint tile = victims[item];
    int level = tile_info[tile].level;
    long x = tile_info[tile].corner[0], y = tile_info[tile].corner[1], z = tile_info[tile].corner[2];
    identities[item * 9] = karst_identity(KARST_IDENTITY_TILE, level, x, y, z);
    for (uint i = 0; i < KARST_TILE_NODES; i++) {
        uint node = tile * KARST_TILE_NODES + i, brick = nodes[node].brick;
        if (brick != KARST_NONE && brick_owner[brick].owner == node)
            detach_brick(brick, nodes, tile_info, brick_owner);
        else
            brick = KARST_NONE;
        bricks[item * KARST_TILE_NODES + i] = brick;
        identities[item * 9 + 1 + i] =
            karst_identity(KARST_IDENTITY_BRICK, level, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2 & 1));
        nodes[node].link = KARST_NODE_LINK(KARST_STATE_UNKNOWN, KARST_NONE);
        nodes[node].brick = KARST_NONE;
    }
    detach_tile(tile, nodes, tile_info);
    tile_info[tile].in_use = 0;
}

__kernel void karst_evict_bricks(__global const uint *victims, uint num, __global karst_node *nodes,
                                 __global const karst_tile_info *tile_info, __global karst_brick_owner *brick_owner,
                                 __global ulong *identities)
{
    uint item = (uint)get_global_id(0);
    if (item >= num)
        return;
    uint brick = victims[item], node = brick_owner[brick].owner, i = node % KARST_TILE_NODES,
         tile = node / KARST_TILE_NODES;
    identities[item] =
        karst_identity(KARST_IDENTITY_BRICK, tile_info[tile].level, tile_info[tile].corner[0] + (i & 1),
                       tile_info[tile].corner[1] + (i >> 1 & 1), tile_info[tile].corner[2] + (i >> 2 & 1));
    detach_brick(brick, nodes, tile_info, brick_owner);
}
