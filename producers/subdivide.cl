/* Subdivide, and the bounds of loads: everything that asks world_bounds. LANES boxes a work-item, in one shape for all
 * devices. */
#include "core/lanes.clh"
#include "producers/density.clh"
#include "world.clh"
#include "producers/subdivide_shared.h"

/* What a kernel calls and the compiler is to see once. */
#if LANES > 1
#define BOUNDS_ENTRY static __attribute__((noinline)) K_WIDE
#else
#define BOUNDS_ENTRY K_INLINE K_WIDE
#endif

#if LANES == 16
#define LOAD_LONG(p) vload16(0, p)
#else
#define LOAD_LONG(p) (*(p))
#endif

/* Node coordinates of node index `node`, from its tile. */
K_INLINE int node_corner(K_GLOBAL const karst_tile_info *tile_info, uint node, long corner[3])
{
    K_GLOBAL const karst_tile_info *info = tile_info + node / KARST_TILE_NODES;
    corner[0] = info->corner[0] + (node & 1u);
    corner[1] = info->corner[1] + (node >> 1 & 1u);
    corner[2] = info->corner[2] + (node >> 2 & 1u);
    return info->level;
}

/* Where box number `box` lies; returns its level. For tiles (is_loads 0), boxes are the children of list[0 ...], eight
 * a tile; for loads (1) they are list[0 ...] themselves. */
K_INLINE int box_place(K_GLOBAL const uint *list, uint box, uint is_loads, K_GLOBAL const karst_tile_info *tile_info,
                       long corner[3])
{
    int level;
    if (is_loads) {
        level = node_corner(tile_info, list[box], corner);
    } else {
        level = node_corner(tile_info, list[box / KARST_TILE_NODES], corner) - 1;
        for (int axis = 0; axis < 3; axis++)
            corner[axis] = 2 * corner[axis] + (box >> axis & 1u);
    }
    for (int axis = 0; axis < 3; axis++)
        corner[axis] = karst_node_origin(corner[axis], level);
    return level;
}

/* Writes what bounds (lo, hi, slopes, slack) say of a box. */
/* `known`: the node as it is. */
K_INLINE void write_load(WORLD_TAKES(const float bounds[6], const long corner[3], int level, karst_node known,
                                     K_GLOBAL karst_load *load))
{
    uint state = KARST_NODE_STATE(known.link);
    float slack = world_slack(WORLD_DATA(data, level)) + bounds[5];
    karst_load l = {{corner[0], corner[1], corner[2]},
                    level,
                    karst_state_from_bounds(bounds[0], bounds[1]),
                    karst_load_doubt(bounds[2], bounds[3], bounds[4], slack, level),
                    state == KARST_STATE_CLEAR_AIR || state == KARST_STATE_CLEAR_SOLID};
    *load = l;
}

K_INLINE void write_child(const float bounds[6], K_GLOBAL const uint *list, K_GLOBAL const uint *slots, uint box,
                          K_GLOBAL karst_node *nodes, K_GLOBAL karst_tile_info *tile_info)
{
    uint state = karst_state_from_bounds(bounds[0], bounds[1]);
    uint parent = list[box / KARST_TILE_NODES], tile = slots[box / KARST_TILE_NODES];
    karst_node node = {KARST_NODE_LINK(state == KARST_STATE_UNKNOWN ? KARST_STATE_LOST : state, KARST_NONE),
                       KARST_NONE};
    nodes[tile * KARST_TILE_NODES + box % KARST_TILE_NODES] = node;
    if (box % KARST_TILE_NODES == 0) {
        long corner[3];
        tile_info[tile].level = node_corner(tile_info, parent, corner) - 1;
        for (int axis = 0; axis < 3; axis++)
            tile_info[tile].corner[axis] = 2 * corner[axis];
    }
}

#ifdef WORLD_HAS_LISTS
#define BATCH WORLD_LIST_NODES
#else
#define BATCH LANES
#endif

/* Bounds boxes begin ... of a list, `count` (BATCH at most) of them; the first argument of write_* says of what. Of
 * loads only the slopes are wanted: that they are no constants has been seen when their tile was made. */
BOUNDS_ENTRY void bound_nodes(WORLD_TAKES(K_GLOBAL const uint *list, K_GLOBAL const uint *slots, uint begin, uint count,
                                          uint is_loads, K_GLOBAL karst_node *nodes,
                                          K_GLOBAL karst_tile_info *tile_info, K_GLOBAL karst_load *loads))
{
    long corner[3][BATCH];
    int levels[BATCH];
    float values[6][BATCH];

    for (uint i = 0; i < BATCH; i++) { /* lanes past the end repeat the last box */
        long at[3];
        levels[i] = box_place(list, begin + min(i, count - 1), is_loads, tile_info, at);
        for (int axis = 0; axis < 3; axis++)
            corner[axis][i] = at[axis];
    }
#ifdef WORLD_HAS_LISTS
    world_bounds_list(WORLD_DATA(data, corner, levels, count, is_loads ? 0 : WORLD_REFINE_DEPTH, values));
#else
    vlong x = LOAD_LONG(corner[0]), y = LOAD_LONG(corner[1]), z = LOAD_LONG(corner[2]);
    world_bound bound;
    if (is_loads)
        world_slopes(WORLD_DATA(data, x, y, z, v_load_int(levels), &bound));
    else
        world_bounds(WORLD_DATA(data, x, y, z, v_load_int(levels), &bound));
    v_store_float(bound.lo, values[0]);
    v_store_float(bound.hi, values[1]);
    for (int axis = 0; axis < 3; axis++)
        v_store_float(bound.slope[axis], values[2 + axis]);
    v_store_float(bound.slack, values[5]);
#endif
    for (uint i = 0; i < count; i++) {
        float of_box[6];
        long at[3] = {corner[0][i], corner[1][i], corner[2][i]};
        for (int k = 0; k < 6; k++)
            of_box[k] = values[k][i];
        if (is_loads)
            write_load(WORLD_DATA(data, of_box, at, levels[i], nodes[list[begin + i]], loads + begin + i));
        else
            write_child(of_box, list, slots, begin + i, nodes, tile_info);
    }
}

/* Work-item i bounds boxes i * batch ... of `count`: list[first ...] for loads. One kernel does tiles and loads, and
 * its entry is thin, as drivers compile a world's bounds once for each kernel, and what stands in an entry two or three
 * times. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_BOUNDS_GROUP, 1, 1))) void
karst_bound_nodes(K_GLOBAL const uint *list, K_GLOBAL const uint *slots, uint first, uint count, uint batch,
                  uint is_loads, K_GLOBAL karst_node *nodes, K_GLOBAL karst_tile_info *tile_info,
                  K_GLOBAL karst_load *loads, world_data data)
{
    uint begin = (uint)get_global_id(0) * batch, end = min(begin + batch, count);
    for (; begin < end; begin += BATCH)
        bound_nodes(WORLD_DATA(data, list + first, slots, begin, min(end - begin, (uint)BATCH), is_loads, nodes,
                               tile_info, loads));
}
