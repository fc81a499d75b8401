/* Wants: from stamps to a list of valid wants in the order of nodes. How many request chunks there are to look at
 * stands in the survey's result, so that nobody has to wait for it: work-items share them. */
#include "cache/identity_shared.h"
#include "cache/survey_shared.h"
#include "cache/wants_shared.h"
#include "core/device/lanes.clh"

/* A work-item's share of the active request chunks. */
static uint2 own_share(__global const karst_survey_result *result)
{
    uint num = result->num_active, item = (uint)get_global_id(0), num_items = (uint)get_global_size(0);
    uint share = (num + num_items - 1) / num_items;
    return (uint2)(min(num, item * share), min(num, (item + 1) * share));
}

/* Has memory fetch what the look at a chunk reads, some chunks ahead: where wants lie all over, each would wait for its
 * own. OpenCL's prefetch does nothing in PoCL. */
#define MARK_AHEAD 3u
static void expect_chunk(uint first, __global const uint *want_brick, __global const uint *want_children)
{
#if defined(__x86_64__) && KARST_DEVICE_CPU
    for (uint i = 0; i < KARST_REQUEST_CHUNK; i += 16) {
        __builtin_prefetch((const void *)(size_t)&want_brick[first + i]);
        __builtin_prefetch((const void *)(size_t)&want_children[first + i]);
    }
#endif
}

/* For each active request chunk two bits for each of its nodes (x: brick, y: children); for each work-item how many
 * nodes have either. */
__kernel void karst_wants_mark(__global const uint *active, __global const karst_survey_result *result,
                               __global const uint *want_brick, __global const uint *want_children,
                               __global const karst_node *nodes, __global const karst_tile_info *tile_info,
                               karst_wants_view view, __global uint2 *marks, __global uint *counts)
{
    uint2 share = own_share(result);
    uint sum = 0;
    for (uint item = share.x; item < share.y; item++) {
        uint first = active[item] * KARST_REQUEST_CHUNK;
        if (item + MARK_AHEAD < share.y)
            expect_chunk(active[item + MARK_AHEAD] * KARST_REQUEST_CHUNK, want_brick, want_children);
        for (uint i = 0; i < KARST_REQUEST_CHUNK; i += 32) {
            uint2 word = (uint2)(0, 0);
            for (uint j = 0; j < 32; j += LANES) {
                vint serial = (vint)((int)view.serial);
                vint asked = v_eq(v_load_int((__global const int *)want_brick + first + i + j), serial) |
                             v_eq(v_load_int((__global const int *)want_children + first + i + j), serial);
                if (!v_any(asked))
                    continue;
                for (uint left = bits_of(asked); left; left &= left - 1) {
                    uint bit = j + 31 - clz(left & -left);
                    uint node = first + i + bit;
                    uint wants = (want_brick[node] == view.serial ? KARST_WANT_BRICK : 0u) |
                                 (want_children[node] == view.serial ? KARST_WANT_CHILDREN : 0u);
                    wants = karst_wants_of(node, wants, view.num_nodes, nodes, tile_info);
                    word.x |= (uint)((wants & KARST_WANT_BRICK) != 0) << bit;
                    word.y |= (uint)((wants & KARST_WANT_CHILDREN) != 0) << bit;
                }
            }
            marks[item * (KARST_REQUEST_CHUNK / 32) + i / 32] = word;
            sum += popcount(word.x | word.y);
        }
    }
    counts[get_global_id(0)] = sum;
}

/* The KARST_WANTS_LIST wants from the `first` on; a work-item's begin behind those of all before it. */
__kernel void karst_wants_list(__global const uint *active, __global karst_survey_result *result, uint first,
                               __global const uint2 *marks, __global const uint *counts,
                               __global const karst_tile_info *tile_info, __global const uint *want_rays,
                               karst_wants_view view, __global karst_want *wants)
{
    uint2 share = own_share(result);
    uint at = 0, own = (uint)get_global_id(0);
    for (uint i = 0; i < own && share.x < share.y; i++)
        at += counts[i];
    if (share.x < share.y && share.y == result->num_active)
        result->num_wants = at + counts[own];
    for (uint item = share.x; item < share.y; item++) {
        for (uint i = 0; i < KARST_REQUEST_CHUNK / 32; i++) {
            uint2 word = marks[item * (KARST_REQUEST_CHUNK / 32) + i];
            for (uint left = word.x | word.y; left; left &= left - 1, at++) {
                if (at < first || at - first >= KARST_WANTS_LIST)
                    continue;
                uint bit = 31 - clz(left & -left);
                uint node = active[item] * KARST_REQUEST_CHUNK + i * 32 + bit;
                karst_want want = {node, karst_want_place(node, &view, want_rays[node], tile_info)};
                want.what |=
                    (word.x >> bit & 1 ? KARST_WANT_BRICK : 0u) | (word.y >> bit & 1 ? KARST_WANT_CHILDREN : 0u);
                wants[at - first] = want;
            }
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
    identities[item] = karst_node_identity(!load, node, &tile_info[tile]);
}
