/* Publish: links what the producers wrote, so that rays can reach it from the next cast on. One work-item for each
 * piece of work; no node is in a list twice. KARST_STORES: there are stores beside the land, and a constant node's
 * children stay, since another store may hold something in them. */
#include "cache/layout_shared.h"

__kernel void karst_publish_loads(__global const uint *load_nodes, __global const uint *load_slots,
                                  __global const uint *load_results, uint num, uint serial, __global karst_node *nodes,
                                  __global karst_tile_info *tile_info, __global karst_brick_owner *brick_owner,
                                  __global uint *brick_stamp, __global uint *want_brick)
{
    uint item = (uint)get_global_id(0);
    if (item >= num)
        return;
    uint node = load_nodes[item], slot = load_slots[item], result = load_results[item];
    uint children = KARST_NODE_CHILDREN(nodes[node].link);
    if (result == KARST_STATE_BRICK || (result & KARST_LOAD_KEPT)) {
        nodes[node].link = KARST_NODE_LINK(result & ~KARST_LOAD_KEPT, children);
        nodes[node].brick = slot;
        brick_owner[slot].owner = node;
        brick_owner[slot].owner_generation = tile_info[node / KARST_TILE_NODES].generation;
        brick_stamp[slot] = serial; /* used by the cast that wanted it, or it would be the next to go */
    } else if (result == KARST_STATE_AIR || result == KARST_STATE_SOLID) {
#ifdef KARST_STORES
        nodes[node].link = KARST_NODE_LINK(result, children);
#else
        if (children != KARST_NONE && tile_info[children].parent == node)
            tile_info[children].parent = KARST_NO_NODE; /* an orphan: no ray reaches it, so it ages */
        nodes[node].link = KARST_NODE_LINK(result, KARST_NONE);
#endif
    } else if (result == KARST_STATE_CLEAR_AIR || result == KARST_STATE_CLEAR_SOLID) {
        nodes[node].link = KARST_NODE_LINK(result, children);
        want_brick[node] = 0; /* answered: who wants a brick of it all the same has to say so once more */
    }
}

/* After the loads: a node that one of them proved constant has no use for its tile. used: 1 where the tile was linked.
 */
__kernel void karst_publish_subdivides(__global const uint *subdivide_nodes, __global const uint *subdivide_tiles,
                                       uint num, uint serial, __global karst_node *nodes,
                                       __global karst_tile_info *tile_info, __global uint *tile_stamp,
                                       __global uint *used)
{
    uint item = (uint)get_global_id(0);
    if (item >= num)
        return;
    uint node = subdivide_nodes[item], tile = subdivide_tiles[item], state = KARST_NODE_STATE(nodes[node].link);
    used[item] = state != KARST_STATE_AIR && state != KARST_STATE_SOLID;
    if (!used[item])
        return;
    tile_info[tile].parent = node;
    tile_info[tile].parent_generation = tile_info[node / KARST_TILE_NODES].generation;
    tile_info[tile].generation++;
    tile_info[tile].in_use = 1;
    tile_stamp[tile] = serial;
    nodes[node].link = KARST_NODE_LINK(state, tile);
}
