/* Entry points of every kind of layer: see producers/steps/layer_kernels.h, which also says what layer.clh is. With
 * LAYER_COLOURED that which lays colours alone. */
#include "core/device/lanes.clh"
#include "producers/steps/load_shared.h"
#include "layer.clh"

#ifndef LAYER_COLOURED
/* Work-item i: child i % 8 of the i / 8-th new tile. */
__kernel void karst_layer_tiles(K_GLOBAL const uint *restrict tiles, uint num, K_GLOBAL karst_node *restrict nodes,
                                K_GLOBAL const karst_tile_info *restrict tile_info, layer_data data)
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
    uint state = layer_node_state(data, before == KARST_STATE_LOST ? KARST_STATE_UNKNOWN : before, origin, level);
    nodes[node].link = KARST_NODE_LINK(state == KARST_STATE_UNKNOWN ? KARST_STATE_LOST : state,
                                       KARST_NODE_CHILDREN(nodes[node].link));
}

__kernel void karst_layer_loads(K_GLOBAL karst_load *restrict loads, uint count, layer_data data)
{
    uint item = (uint)get_global_id(0);
    if (item >= count)
        return;
    long origin[3] = {loads[item].origin[0], loads[item].origin[1], loads[item].origin[2]};
    int level = loads[item].level;
    loads[item].state = layer_node_state(data, loads[item].state, origin, level);
    if (layer_is_doubtful(data, origin, level))
        loads[item].doubt = INFINITY;
}

/* Work-group i changes brick i; its work-items share it. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_layer_bricks(K_GLOBAL const karst_load *restrict loads, uint count, K_GLOBAL float *staging, uint stride,
                   layer_data data)
{
    uint brick = (uint)get_group_id(0);
    if (brick >= count || loads[brick].state != KARST_STATE_UNKNOWN)
        return;
    long origin[3] = {loads[brick].origin[0], loads[brick].origin[1], loads[brick].origin[2]};
    layer_change_samples(data, origin, loads[brick].level, staging + (ulong)brick * stride, (K_GLOBAL float *)0,
                         (int)get_local_id(0), KARST_GROUP);
}
#else
#if KARST_GROUP > 1
#define GROUP_BARRIER() barrier(CLK_GLOBAL_MEM_FENCE)
#else
#define GROUP_BARRIER()
#endif

/* As karst_layer_bricks, and the layer's colours go to the i-th brick of `colours`, in planes; `coloured[i]` says
 * whether a layer has written any there. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_layer_coloured_bricks(K_GLOBAL const karst_load *restrict loads, uint count, K_GLOBAL float *staging, uint stride,
                            K_GLOBAL float *colours, K_GLOBAL uint *coloured, layer_data data)
{
    const uint brick = (uint)get_group_id(0);
    const int item = (int)get_local_id(0);
    if (brick >= count || loads[brick].state != KARST_STATE_UNKNOWN)
        return;
    long origin[3] = {loads[brick].origin[0], loads[brick].origin[1], loads[brick].origin[2]};
    const int level = loads[brick].level;
    K_GLOBAL float *planes = (K_GLOBAL float *)0;
    if (layer_has_colours(data, origin, level)) {
        const uint before = coloured[brick];
        planes = colours + (ulong)brick * (4 * KARST_BRICK_PADDED);
        for (int i = item; i < 4 * KARST_BRICK_PADDED && !before; i += KARST_GROUP)
            planes[i] = 0.0f;
        GROUP_BARRIER();
        if (item == 0)
            coloured[brick] = 1u;
    }
    layer_change_samples(data, origin, level, staging + (ulong)brick * stride, planes, item, KARST_GROUP);
}
#endif
