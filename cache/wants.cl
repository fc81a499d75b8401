/* Wants: from stamps to a list of valid wants in the order of nodes; and what is in use. */
#include "cache/identity_shared.h"
#include "cache/wants_shared.h"
#include "core/lanes.clh"

static uint sum_across(vint v)
{
#if LANES == 16
    int8 a = v.lo + v.hi;
    int4 b = a.lo + a.hi;
    int2 c = b.lo + b.hi;
    return (uint)(c.x + c.y);
#else
    return (uint)v;
#endif
}

/* How many of stamps[begin, end) equal the serial in either array. */
static uint count_stamps(__global const int *a, __global const int *b, uint begin, uint end, uint serial)
{
    vint sum = (vint)(0);
    uint i = begin, num = 0;
    for (; i + LANES <= end; i += LANES)
        sum -= v_eq(v_load_int(a + i), (vint)((int)serial)) | v_eq(v_load_int(b + i), (vint)((int)serial));
    for (; i < end; i++)
        num += a[i] == (int)serial || b[i] == (int)serial;
    return num + sum_across(sum);
}

/* One count for each chunk of tiles, then of bricks, then of request chunks. */
__kernel void karst_wants_survey(__global const int *tile_stamp, __global const int *brick_stamp,
                                 __global const int *brick_fallback, __global const int *want_chunk, uint num_tiles,
                                 uint num_bricks, uint num_chunks, uint serial, __global uint *counts)
{
    uint tiles = (num_tiles + KARST_CHUNK - 1) / KARST_CHUNK, bricks = (num_bricks + KARST_CHUNK - 1) / KARST_CHUNK;
    uint chunks = (num_chunks + KARST_CHUNK - 1) / KARST_CHUNK, item = (uint)get_global_id(0), begin;
    if (item < tiles) {
        begin = item * KARST_CHUNK;
        counts[item] = count_stamps(tile_stamp, tile_stamp, begin, min(num_tiles, begin + KARST_CHUNK), serial);
    } else if (item < tiles + bricks) {
        begin = (item - tiles) * KARST_CHUNK;
        counts[item] = count_stamps(brick_stamp, brick_fallback, begin, min(num_bricks, begin + KARST_CHUNK), serial);
    } else if (item < tiles + bricks + chunks) {
        begin = (item - tiles - bricks) * KARST_CHUNK;
        counts[item] = count_stamps(want_chunk, want_chunk, begin, min(num_chunks, begin + KARST_CHUNK), serial);
    }
}

/* The valid wants of one node. */
static uint wants_of(uint node, karst_wants_view view, __global const uint *want_brick,
                     __global const uint *want_children, __global const karst_node *nodes,
                     __global const karst_tile_info *tile_info)
{
    uint wants = (want_brick[node] == view.serial ? KARST_WANT_BRICK : 0u) |
                 (want_children[node] == view.serial ? KARST_WANT_CHILDREN : 0u);
    if (!wants || node >= view.num_nodes || !tile_info[node / KARST_TILE_NODES].in_use)
        return 0u;
    return karst_want_valid(wants, nodes[node], tile_info[node / KARST_TILE_NODES].level);
}

/* For each active request chunk: two bits for each of its nodes (x: brick, y: children), and how many nodes have
 * either. */
__kernel void karst_wants_mark(__global const uint *active, uint num_active, __global const uint *want_brick,
                               __global const uint *want_children, __global const karst_node *nodes,
                               __global const karst_tile_info *tile_info, karst_wants_view view, __global uint2 *marks,
                               __global uint *counts)
{
    uint item = (uint)get_global_id(0);
    if (item >= num_active)
        return;
    uint first = active[item] * KARST_REQUEST_CHUNK, sum = 0;
    for (uint i = 0; i < KARST_REQUEST_CHUNK; i += 32) {
        uint2 word = (uint2)(0, 0);
        for (uint j = 0; j < 32; j += LANES) {
            vint serial = (vint)((int)view.serial);
            if (!v_any(v_eq(v_load_int((__global const int *)want_brick + first + i + j), serial) |
                       v_eq(v_load_int((__global const int *)want_children + first + i + j), serial)))
                continue;
            for (uint lane = 0; lane < LANES; lane++) {
                uint wants = wants_of(first + i + j + lane, view, want_brick, want_children, nodes, tile_info);
                word.x |= (uint)((wants & KARST_WANT_BRICK) != 0) << (j + lane);
                word.y |= (uint)((wants & KARST_WANT_CHILDREN) != 0) << (j + lane);
            }
        }
        marks[item * (KARST_REQUEST_CHUNK / 32) + i / 32] = word;
        sum += popcount(word.x | word.y);
    }
    counts[item] = sum;
}

static uint class_of(uint node, karst_wants_view view, __global const karst_tile_info *tile_info)
{
    uint tile = node / KARST_TILE_NODES;
    int level = tile_info[tile].level, shift = level + KARST_BRICK_CELLS_LOG2;
    return karst_want_class(level, karst_want_gap(tile_info[tile].corner[0] + (node & 1), view.camera[0], shift),
                            karst_want_gap(tile_info[tile].corner[1] + (node >> 1 & 1), view.camera[1], shift),
                            karst_want_gap(tile_info[tile].corner[2] + (node >> 2 & 1), view.camera[2], shift));
}

/* The wants of active chunks [first, first + num): those of chunk i go to wants[offsets[i]...]. */
__kernel void karst_wants_list(__global const uint *active, uint first, uint num, __global const uint2 *marks,
                               __global const uint *offsets, __global const karst_tile_info *tile_info,
                               __global const uint *want_rays, karst_wants_view view, __global karst_want *wants)
{
    uint item = first + (uint)get_global_id(0);
    if (item >= first + num)
        return;
    uint at = offsets[item];
    for (uint i = 0; i < KARST_REQUEST_CHUNK / 32; i++) {
        uint2 word = marks[item * (KARST_REQUEST_CHUNK / 32) + i];
        for (uint left = word.x | word.y; left; left &= left - 1) {
            uint bit = 31 - clz(left & -left);
            uint node = active[item] * KARST_REQUEST_CHUNK + i * 32 + bit;
            karst_want want = {node, class_of(node, view, tile_info)};
            want.what += karst_want_delay(node, karst_rays_counted(want_rays[node], view.serial), view.turn);
            want.what |= (word.x >> bit & 1 ? KARST_WANT_BRICK : 0u) | (word.y >> bit & 1 ? KARST_WANT_CHILDREN : 0u);
            wants[at++] = want;
        }
    }
}

/* Work that was chosen: its nodes' tiles count as in use, and what it makes gets its name (see identity_shared.h).
 * Loads first. */
__kernel void karst_wants_accept(__global const uint *load_nodes, uint num_loads, __global const uint *subdivide_nodes,
                                 uint num_subdivides, __global const karst_tile_info *tile_info, uint serial,
                                 __global uint *tile_stamp, __global ulong *identities)
{
    uint item = (uint)get_global_id(0);
    if (item >= num_loads + num_subdivides)
        return;
    bool load = item < num_loads;
    uint node = load ? load_nodes[item] : subdivide_nodes[item - num_loads];
    uint tile = node / KARST_TILE_NODES;
    tile_stamp[tile] = serial; /* several items may write this same value */
    long x = tile_info[tile].corner[0] + (node & 1), y = tile_info[tile].corner[1] + (node >> 1 & 1);
    long z = tile_info[tile].corner[2] + (node >> 2 & 1);
    int level = tile_info[tile].level;
    identities[item] = load ? karst_identity(KARST_IDENTITY_BRICK, level, x, y, z)
                            : karst_identity(KARST_IDENTITY_TILE, level - 1, 2 * x, 2 * y, 2 * z);
}
