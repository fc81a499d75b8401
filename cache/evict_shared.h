/* Eviction: what host and kernels share. Compiled twice, must agree bit for bit: see core/device/dialect.h. */
#ifndef KARST_CACHE_EVICT_SHARED_H
#define KARST_CACHE_EVICT_SHARED_H

#include "cache/identity_shared.h"
#include "cache/layout_shared.h"

/* What was let go of; names as in identity_shared.h. */
typedef struct {
    ulong name;
    ulong brick_names[KARST_TILE_NODES]; /* valid where bricks[i] is not KARST_NONE */
    uint bricks[KARST_TILE_NODES];       /* the bricks that its nodes had */
    uint slot;
    uint pad;
} karst_evicted_tile;
K_ASSERT_SIZE(karst_evicted_tile, 112);

typedef struct {
    ulong name;
    uint slot;
    uint pad;
} karst_evicted_brick;
K_ASSERT_SIZE(karst_evicted_brick, 16);

/* Takes a tile off its parent in a store's nodes, if both say that they belong together. */
K_INLINE void karst_unlink_tile(uint tile, K_GLOBAL karst_node *nodes, K_GLOBAL const karst_tile_info *tile_info)
{
    uint parent = tile_info[tile].parent;
    if (parent == KARST_NO_NODE)
        return;
    uint link = nodes[parent].link;
    if (tile_info[parent / KARST_TILE_NODES].in_use &&
        tile_info[parent / KARST_TILE_NODES].generation == tile_info[tile].parent_generation &&
        KARST_NODE_CHILDREN(link) == tile)
        nodes[parent].link = KARST_NODE_LINK(KARST_NODE_STATE(link), KARST_NONE);
}

/* Detaches a brick from its node, which has lost it (or stays clear), if both say that they belong together. */
K_INLINE void karst_detach_brick(uint brick, K_GLOBAL karst_node *nodes, K_GLOBAL const karst_tile_info *tile_info,
                                 K_GLOBAL karst_brick_owner *brick_owner)
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

/* Empties a tile's nodes in a store. Returns how many bricks went with them. */
K_INLINE uint karst_empty_nodes(uint tile, K_GLOBAL karst_node *nodes, K_GLOBAL const karst_tile_info *tile_info,
                                K_GLOBAL karst_brick_owner *brick_owner, K_GLOBAL karst_evicted_tile *evicted)
{
    int level = tile_info[tile].level;
    long x = tile_info[tile].corner[0], y = tile_info[tile].corner[1], z = tile_info[tile].corner[2];
    evicted->slot = tile;
    evicted->name = karst_identity(KARST_IDENTITY_TILE, level, x, y, z);
    uint num_freed = 0;
    for (uint i = 0; i < KARST_TILE_NODES; i++) {
        uint node = tile * KARST_TILE_NODES + i, brick = nodes[node].brick;
        if (brick != KARST_NONE && brick_owner[brick].owner == node) {
            num_freed++;
            karst_detach_brick(brick, nodes, tile_info, brick_owner);
            evicted->brick_names[i] =
                karst_identity(KARST_IDENTITY_BRICK, level, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2 & 1));
        } else {
            brick = KARST_NONE;
        }
        evicted->bricks[i] = brick;
        nodes[node].link = KARST_NODE_LINK(KARST_STATE_UNKNOWN, KARST_NONE);
        nodes[node].brick = KARST_NONE;
    }
    return num_freed;
}

/* Empties a tile's slot. Returns how many of land's bricks went with it. */
K_INLINE uint karst_evict_tile(uint tile, K_GLOBAL karst_node *nodes, K_GLOBAL karst_tile_info *tile_info,
                               K_GLOBAL karst_brick_owner *brick_owner, K_GLOBAL karst_evicted_tile *evicted)
{
    uint num_freed = karst_empty_nodes(tile, nodes, tile_info, brick_owner, evicted);
    karst_unlink_tile(tile, nodes, tile_info);
    tile_info[tile].parent = KARST_NO_NODE;
    tile_info[tile].in_use = 0;
    return num_freed;
}

/* What that is to another store, before the tile's slot is emptied. */
K_INLINE void karst_evict_tile_beside(uint tile, K_GLOBAL karst_node *nodes, K_GLOBAL const karst_tile_info *tile_info,
                                      K_GLOBAL karst_brick_owner *brick_owner, K_GLOBAL karst_evicted_tile *evicted)
{
    karst_empty_nodes(tile, nodes, tile_info, brick_owner, evicted);
    karst_unlink_tile(tile, nodes, tile_info);
}

/* Empties a brick's slot. */
K_INLINE void karst_evict_brick(uint brick, K_GLOBAL karst_node *nodes, K_GLOBAL const karst_tile_info *tile_info,
                                K_GLOBAL karst_brick_owner *brick_owner, K_GLOBAL karst_evicted_brick *evicted)
{
    uint node = brick_owner[brick].owner;
    evicted->slot = brick;
    evicted->name = karst_node_identity(0, node, &tile_info[node / KARST_TILE_NODES]);
    karst_detach_brick(brick, nodes, tile_info, brick_owner);
}

#endif
