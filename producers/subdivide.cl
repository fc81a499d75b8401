/* Subdivide, and the bounds of loads: everything that asks world_bounds. LANES boxes a work-item, in one shape for all
 * devices. */
#include "core/lanes.clh"
#include "producers/density.clh"
#include "world.clh"
#include "producers/subdivide_shared.h"

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

/* Work-item i handles children i * LANES ... of the list of new tiles, eight a tile: at 16 lanes, two tiles.
 * Lanes past the end repeat the last child. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_BOUNDS_GROUP, 1, 1))) void
karst_subdivide_tiles(K_GLOBAL const uint *restrict subdivide_nodes, K_GLOBAL const uint *restrict subdivide_tiles,
                      uint num_subdivides, K_GLOBAL karst_node *restrict nodes, K_GLOBAL karst_tile_info *tile_info,
                      world_data data)
{
    uint num_children = num_subdivides * KARST_TILE_NODES, first = (uint)get_global_id(0) * LANES;
    long x[LANES], y[LANES], z[LANES];
    int levels[LANES];
    float lo[LANES], hi[LANES];
    world_bound bound;

    if (first >= num_children)
        return;
    for (uint lane = 0; lane < LANES; lane++) {
        uint child = min(first + lane, num_children - 1), bits = child % KARST_TILE_NODES;
        long corner[3];
        int level = node_corner(tile_info, subdivide_nodes[child / KARST_TILE_NODES], corner) - 1;
        x[lane] = karst_node_origin(2 * corner[0] + (bits & 1u), level);
        y[lane] = karst_node_origin(2 * corner[1] + (bits >> 1 & 1u), level);
        z[lane] = karst_node_origin(2 * corner[2] + (bits >> 2 & 1u), level);
        levels[lane] = level;
    }
    world_bounds(WORLD_DATA(data, LOAD_LONG(x), LOAD_LONG(y), LOAD_LONG(z), v_load_int(levels), &bound));
    v_store_float(bound.lo, lo);
    v_store_float(bound.hi, hi);
    for (uint lane = 0; lane < LANES && first + lane < num_children; lane++) {
        uint child = first + lane, bits = child % KARST_TILE_NODES;
        uint parent = subdivide_nodes[child / KARST_TILE_NODES], tile = subdivide_tiles[child / KARST_TILE_NODES];
        uint state = karst_state_from_bounds(lo[lane], hi[lane]);
        karst_node node = {KARST_NODE_LINK(state == KARST_STATE_UNKNOWN ? KARST_STATE_LOST : state, KARST_NONE),
                           KARST_NONE};
        nodes[tile * KARST_TILE_NODES + bits] = node;
        if (bits == 0) {
            long corner[3];
            tile_info[tile].level = node_corner(tile_info, parent, corner) - 1;
            for (int axis = 0; axis < 3; axis++)
                tile_info[tile].corner[axis] = 2 * corner[axis];
        }
    }
}

/* Work-item i prepares loads i * LANES ... of `count`, which are load_nodes[first ...]: where they lie and what their
 * bounds prove. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_BOUNDS_GROUP, 1, 1))) void
karst_bound_loads(K_GLOBAL const uint *restrict load_nodes, uint first, uint count,
                  K_GLOBAL const karst_tile_info *restrict tile_info, K_GLOBAL karst_load *restrict loads,
                  world_data data)
{
    uint begin = (uint)get_global_id(0) * LANES;
    long x[LANES], y[LANES], z[LANES];
    int levels[LANES];
    float values[5][LANES];
    world_bound bound;

    if (begin >= count)
        return;
    for (uint lane = 0; lane < LANES; lane++) {
        long corner[3];
        int level = node_corner(tile_info, load_nodes[first + min(begin + lane, count - 1)], corner);
        x[lane] = karst_node_origin(corner[0], level);
        y[lane] = karst_node_origin(corner[1], level);
        z[lane] = karst_node_origin(corner[2], level);
        levels[lane] = level;
    }
    world_bounds(WORLD_DATA(data, LOAD_LONG(x), LOAD_LONG(y), LOAD_LONG(z), v_load_int(levels), &bound));
    v_store_float(bound.lo, values[0]);
    v_store_float(bound.hi, values[1]);
    for (int axis = 0; axis < 3; axis++)
        v_store_float(bound.slope[axis], values[2 + axis]);
    for (uint lane = 0; lane < LANES && begin + lane < count; lane++) {
        int level = levels[lane];
        karst_load load = {{x[lane], y[lane], z[lane]},
                           level,
                           karst_state_from_bounds(values[0][lane], values[1][lane]),
                           karst_load_doubt(values[2][lane], values[3][lane], values[4][lane],
                                            world_slack(WORLD_DATA(data, level)), level),
                           0};
        loads[begin + lane] = load;
    }
}
