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

/* Work-item i bounds boxes i * LANES ... of `count`; lanes past the end repeat the last box.
 *
 * For tiles (is_loads 0), boxes are the children of list[0 ...], eight a tile, and slots[] are the tiles that they
 * fill. For loads (1) they are list[first ...] themselves, of which only the slopes are wanted: that they are no
 * constants has been seen when their tile was made. One kernel does both, and its entry is thin, as drivers compile the
 * worlds' bounds once for each kernel, and what stands in an entry two or three times. */
BOUNDS_ENTRY void bound_nodes(WORLD_TAKES(K_GLOBAL const uint *list, K_GLOBAL const uint *slots, uint first, uint count,
                                          uint is_loads, K_GLOBAL karst_node *nodes,
                                          K_GLOBAL karst_tile_info *tile_info, K_GLOBAL karst_load *loads, uint begin))
{
    long x[LANES], y[LANES], z[LANES];
    int levels[LANES];
    float values[6][LANES];
    world_bound bound;

    for (uint lane = 0; lane < LANES; lane++) {
        uint box = min(begin + lane, count - 1);
        long corner[3];
        int level;
        if (is_loads) {
            level = node_corner(tile_info, list[first + box], corner);
        } else {
            level = node_corner(tile_info, list[box / KARST_TILE_NODES], corner) - 1;
            for (int axis = 0; axis < 3; axis++)
                corner[axis] = 2 * corner[axis] + (box >> axis & 1u);
        }
        x[lane] = karst_node_origin(corner[0], level);
        y[lane] = karst_node_origin(corner[1], level);
        z[lane] = karst_node_origin(corner[2], level);
        levels[lane] = level;
    }
    if (is_loads)
        world_slopes(WORLD_DATA(data, LOAD_LONG(x), LOAD_LONG(y), LOAD_LONG(z), v_load_int(levels), &bound));
    else
        world_bounds(WORLD_DATA(data, LOAD_LONG(x), LOAD_LONG(y), LOAD_LONG(z), v_load_int(levels), &bound));
    v_store_float(bound.lo, values[0]);
    v_store_float(bound.hi, values[1]);
    for (int axis = 0; axis < 3; axis++)
        v_store_float(bound.slope[axis], values[2 + axis]);
    v_store_float(bound.slack, values[5]);
    for (uint lane = 0; lane < LANES && begin + lane < count; lane++) {
        uint box = begin + lane, state = karst_state_from_bounds(values[0][lane], values[1][lane]);
        int level = levels[lane];
        if (is_loads) {
            float slack = world_slack(WORLD_DATA(data, level)) + values[5][lane];
            karst_load load = {{x[lane], y[lane], z[lane]},
                               level,
                               state,
                               karst_load_doubt(values[2][lane], values[3][lane], values[4][lane], slack, level),
                               0};
            loads[box] = load;
            continue;
        }
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
}

K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_BOUNDS_GROUP, 1, 1))) void
karst_bound_nodes(K_GLOBAL const uint *list, K_GLOBAL const uint *slots, uint first, uint count, uint is_loads,
                  K_GLOBAL karst_node *nodes, K_GLOBAL karst_tile_info *tile_info, K_GLOBAL karst_load *loads,
                  world_data data)
{
    uint begin = (uint)get_global_id(0) * LANES;
    if (begin < count)
        bound_nodes(WORLD_DATA(data, list, slots, first, count, is_loads, nodes, tile_info, loads, begin));
}
