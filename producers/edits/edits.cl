/* Entry points of edits: see producers/edits/edits.h. */
#include "core/device/lanes.clh"
#include "producers/edits/edits.clh"
#include "producers/steps/load_shared.h"

/* Work-item i: child i % 8 of the i / 8-th new tile. */
__kernel void karst_edit_tiles(K_GLOBAL const uint *restrict tiles, uint num, K_GLOBAL karst_node *restrict nodes,
                               K_GLOBAL const karst_tile_info *restrict tile_info, edits_data data)
{
    uint item = (uint)get_global_id(0);
    if (item >= num * KARST_TILE_NODES)
        return;
    uint node = tiles[item / KARST_TILE_NODES] * KARST_TILE_NODES + item % KARST_TILE_NODES;
    uint before = KARST_NODE_STATE(nodes[node].link);
    long origin[3];
    int level = karst_node_corner(tile_info, node, origin);
    for (int a = 0; a < 3; a++)
        origin[a] = karst_node_origin(origin[a], level);
    uint state = edits_node_state(data, before == KARST_STATE_LOST ? KARST_STATE_UNKNOWN : before, origin, level);
    nodes[node].link = KARST_NODE_LINK(state == KARST_STATE_UNKNOWN ? KARST_STATE_LOST : state,
                                       KARST_NODE_CHILDREN(nodes[node].link));
}

__kernel void karst_edit_loads(K_GLOBAL karst_load *restrict loads, uint count, edits_data data)
{
    uint item = (uint)get_global_id(0);
    if (item >= count)
        return;
    long origin[3] = {loads[item].origin[0], loads[item].origin[1], loads[item].origin[2]};
    int level = loads[item].level;
    loads[item].state = edits_node_state(data, loads[item].state, origin, level);
    if (edits_touch(data, origin, level))
        loads[item].doubt = INFINITY;
}

/* Work-group i edits brick i; its work-items take rows in turn. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_edit_bricks(K_GLOBAL const karst_load *restrict loads, uint count, K_GLOBAL float *staging, uint stride,
                  edits_data data)
{
    uint brick = (uint)get_group_id(0);
    if (brick >= count || loads[brick].state != KARST_STATE_UNKNOWN)
        return;
    long origin[3] = {loads[brick].origin[0], loads[brick].origin[1], loads[brick].origin[2]};
    edits_edit_samples(data, origin, loads[brick].level, staging + (ulong)brick * stride, (int)get_local_id(0),
                       KARST_GROUP);
}
