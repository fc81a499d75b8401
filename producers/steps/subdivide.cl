/* Subdivide, and the bounds of loads: everything that asks world_bounds. LANES boxes a work-item, in one shape for all
 * devices. */
#define V_WHOLE_MASKS
#include "core/device/lanes.clh"
#include "producers/steps/density.clh"
#include "world.clh"
#include "producers/steps/finalise_shared.h"
#include "producers/steps/subdivide_shared.h"

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

/* What boxes are: the children of list[0 ...], eight a tile; list[0 ...] themselves, to be loaded or loaded already. */
#define BOXES_OF_TILES 0u
#define BOXES_OF_LOADS 1u
#define BOXES_OF_LOADED 2u

/* Where box number `box` lies; returns its level. */
K_INLINE int box_place(K_GLOBAL const uint *list, uint box, uint kind, K_GLOBAL const karst_tile_info *tile_info,
                       long corner[3])
{
    int level;
    if (kind != BOXES_OF_TILES) {
        level = karst_node_corner(tile_info, list[box], corner);
    } else {
        level = karst_node_corner(tile_info, list[box / KARST_TILE_NODES], corner) - 1;
        for (int axis = 0; axis < 3; axis++)
            corner[axis] = 2 * corner[axis] + (box >> axis & 1u);
    }
    for (int axis = 0; axis < 3; axis++)
        corner[axis] = karst_node_origin(corner[axis], level);
    return level;
}

/* What follows from the bounds (lo, hi, slopes, slack) of a box. */
K_INLINE float doubt_of(WORLD_TAKES const float bounds[6], int level)
{
    return karst_load_doubt(bounds[2], bounds[3], bounds[4], world_slack(WORLD_GIVES(data) level) + bounds[5], level);
}

/* Of a node of air whether thin matter beside it, which is shown wider than it is (raise.clh), may reach into it. It is
 * no constant then: its samples say whether any does. */
K_INLINE int thin_may_reach(WORLD_TAKES const float bounds[6], int level)
{
#ifdef WORLD_MAY_BE_THIN
    /* by a voxel of the parent's, which the node may blend with */
    const float half_a_voxel = karst_load_doubt(bounds[2], bounds[3], bounds[4], 0.0f, level);
    return WORLD_RAISES_THIN(data) && half_a_voxel < WORLD_SLOPE_UNKNOWN &&
           k_fma(half_a_voxel, 4.0f, bounds[1]) > 0.0f;
#else
    return 0;
#endif
}

K_INLINE uint state_of(WORLD_TAKES const float bounds[6], int level)
{
    const uint state = karst_state_from_bounds(bounds[0], bounds[1]);
    return state == KARST_STATE_AIR && thin_may_reach(WORLD_GIVES(data) bounds, level) ? KARST_STATE_UNKNOWN : state;
}

/* `known`: the node as it is. */
K_INLINE void write_load(WORLD_TAKES const float bounds[6], const long corner[3], int level, karst_node known,
                                     K_GLOBAL karst_load *load)
{
    karst_load l = {{corner[0], corner[1], corner[2]},
                    level,
                    state_of(WORLD_GIVES(data) bounds, level),
                    doubt_of(WORLD_GIVES(data) bounds, level),
                    karst_node_is_clear(known)};
    *load = l;
}

/* A load that came out clear, all its samples `least` from zero or farther, is constant where bounds prove it. */
K_INLINE void write_loaded(WORLD_TAKES const float bounds[6], int level, float least, K_GLOBAL uint *result)
{
    int is_solid = (*result & ~KARST_LOAD_KEPT) == KARST_STATE_CLEAR_SOLID;
    uint state = state_of(WORLD_GIVES(data) bounds, level);
    if (state == KARST_STATE_UNKNOWN)
        state = karst_state_from_samples(least, is_solid, !is_solid, 0u, doubt_of(WORLD_GIVES(data) bounds, level));
    if (state == KARST_STATE_AIR || state == KARST_STATE_SOLID)
        *result = state;
}

K_INLINE void write_child(WORLD_TAKES const float bounds[6], int level, K_GLOBAL const uint *list,
                          K_GLOBAL const uint *slots, uint box,
                          K_GLOBAL karst_node *nodes, K_GLOBAL karst_tile_info *tile_info)
{
    const uint state = state_of(WORLD_GIVES(data) bounds, level);
    uint parent = list[box / KARST_TILE_NODES], tile = slots[box / KARST_TILE_NODES];
    karst_node node = {KARST_NODE_LINK(state == KARST_STATE_UNKNOWN ? KARST_STATE_LOST : state, KARST_NONE),
                       KARST_NONE};
    nodes[tile * KARST_TILE_NODES + box % KARST_TILE_NODES] = node;
    if (box % KARST_TILE_NODES == 0) {
        long corner[3];
        tile_info[tile].level = karst_node_corner(tile_info, parent, corner) - 1;
        for (int axis = 0; axis < 3; axis++)
            tile_info[tile].corner[axis] = 2 * corner[axis];
    }
}

#ifdef WORLD_HAS_LISTS
#define BATCH WORLD_LIST_NODES
#else
#define BATCH LANES
#endif

/* Bounds `count` boxes of a list, BATCH at most; the first argument of write_* says of what. Of loads only the slopes
 * are wanted: that they are no constants has been seen when their tile was made. */
BOUNDS_ENTRY void bound_nodes(WORLD_TAKES K_GLOBAL const uint *list, K_GLOBAL const uint *slots, const uint *boxes,
                                          uint count, uint kind, K_GLOBAL karst_node *nodes,
                                          K_GLOBAL karst_tile_info *tile_info, K_GLOBAL karst_load *loads,
                                          K_GLOBAL const float *least, K_GLOBAL uint *results)
{
    long corner[3][BATCH];
    int levels[BATCH];
    float values[6][BATCH];

    for (uint i = 0; i < BATCH; i++) { /* lanes past the end repeat the last box */
        long at[3];
        levels[i] = box_place(list, boxes[min(i, count - 1)], kind, tile_info, at);
        for (int axis = 0; axis < 3; axis++)
            corner[axis][i] = at[axis];
    }
#ifdef WORLD_HAS_LISTS
    world_bounds_list(WORLD_GIVES(data) corner, levels, count, kind == BOXES_OF_TILES ? WORLD_REFINE_DEPTH : 0, values);
#else
    vlong x = LOAD_LONG(corner[0]), y = LOAD_LONG(corner[1]), z = LOAD_LONG(corner[2]);
    world_bound bound;
    if (kind == BOXES_OF_TILES)
        world_bounds(WORLD_GIVES(data) x, y, z, v_load_int(levels), &bound);
    else
        world_slopes(WORLD_GIVES(data) x, y, z, v_load_int(levels), &bound);
    v_store_float(bound.lo, values[0]);
    v_store_float(bound.hi, values[1]);
    for (int axis = 0; axis < 3; axis++)
        v_store_float(bound.slope[axis], values[2 + axis]);
    v_store_float(bound.slack, values[5]);
#endif
    for (uint i = 0; i < count; i++) {
        float of_box[6];
        uint box = boxes[i];
        long at[3] = {corner[0][i], corner[1][i], corner[2][i]};
        for (int k = 0; k < 6; k++)
            of_box[k] = values[k][i];
        if (kind == BOXES_OF_TILES)
            write_child(WORLD_GIVES(data) of_box, levels[i], list, slots, box, nodes, tile_info);
        else if (kind == BOXES_OF_LOADS)
            write_load(WORLD_GIVES(data) of_box, at, levels[i], nodes[list[box]], loads + box);
        else
            write_loaded(WORLD_GIVES(data) of_box, levels[i], least[box], results + box);
    }
}

/* The next boxes from *begin on that are to be bounded: all, but for loads that are loaded already only those that may
 * be constant. Returns how many there are. */
K_INLINE uint next_boxes(uint *begin, uint end, uint kind, K_GLOBAL const float *least, uint *boxes)
{
    uint count = 0;
    for (; *begin < end && count < BATCH; (*begin)++)
        if (kind != BOXES_OF_LOADED || least[*begin] >= 0.0f)
            boxes[count++] = *begin;
    return count;
}

BOUNDS_ENTRY void bound_batch(WORLD_TAKES K_GLOBAL const uint *list, K_GLOBAL const uint *slots, uint begin, uint end,
                                          uint kind, K_GLOBAL karst_node *nodes, K_GLOBAL karst_tile_info *tile_info,
                                          K_GLOBAL karst_load *loads, K_GLOBAL const float *least,
                                          K_GLOBAL uint *results)
{
    uint boxes[BATCH], count;
    while ((count = next_boxes(&begin, end, kind, least, boxes)) > 0)
        bound_nodes(WORLD_GIVES(data) list, slots, boxes, count, kind, nodes, tile_info, loads, least, results);
}

/* Work-item i bounds boxes i * batch ... of `count`: list[first ...] for loads, `results` as the list. One kernel does
 * tiles and loads, and its entry is thin, as drivers compile a world's bounds once for each kernel, and what stands in
 * an entry two or three times. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_BOUNDS_GROUP, 1, 1))) void
karst_bound_nodes(K_GLOBAL const uint *list, K_GLOBAL const uint *slots, uint first, uint count, uint batch, uint kind,
                  K_GLOBAL karst_node *nodes, K_GLOBAL karst_tile_info *tile_info, K_GLOBAL karst_load *loads,
                  K_GLOBAL const float *least, K_GLOBAL uint *results, world_data data)
{
    uint begin = (uint)get_global_id(0) * batch, end = min(begin + batch, count);
    bound_batch(
        WORLD_GIVES(data) list + first, slots, begin, end, kind, nodes, tile_info, loads, least, results + first);
}
