/* Recycling: which of the slots that a survey found old may go, and the first of them. Count, scan, scatter: no
 * atomics, and order is kept. */
#include "cache/lru_shared.h"

__kernel void karst_lru_look_at_tiles(__global uint *slots, karst_lru_ask ask, __global const uint *stamps,
                                      __global const karst_node *nodes, __global const karst_tile_info *tile_info)
{
    uint item = (uint)get_global_id(0);
    if (item >= ask.num)
        return;
    uint tile = slots[item];
    slots[item] = tile | karst_lru_look_at_tile(tile, stamps[tile], ask.serial, nodes, tile_info);
}

__kernel void karst_lru_look_at_bricks(__global uint *slots, karst_lru_ask ask, __global const uint *stamps,
                                       __global const uint *fallback, __global const karst_brick_owner *brick_owner)
{
    uint item = (uint)get_global_id(0);
    if (item >= ask.num)
        return;
    uint brick = slots[item];
    bool used = stamps[brick] == ask.serial || (fallback[brick] == ask.serial && !ask.stand_ins);
    if (brick != KARST_NONE && !used && brick_owner[brick].owner != KARST_NO_NODE)
        slots[item] = brick | KARST_LRU_FITS;
}

/* The first of those that fit; one work-group. */
__kernel __attribute__((reqd_work_group_size(KARST_SCAN_WIDTH, 1, 1))) void
karst_lru_take(__global const uint *slots, karst_lru_ask ask, __global const karst_lru_result *before,
               __global const uint *freed, __global uint *victims, __global karst_lru_result *result)
{
    __local uint fit[KARST_SCAN_WIDTH], kept[KARST_SCAN_WIDTH], gone[KARST_SCAN_WIDTH], need;
    uint lane = (uint)get_local_id(0), share = (ask.num + KARST_SCAN_WIDTH - 1) / KARST_SCAN_WIDTH;
    uint begin = min(ask.num, lane * share), end = min(ask.num, begin + share);
    uint num_fit = 0, num_kept = 0, num_freed = 0;
    for (uint i = begin; i < end; i++) {
        num_fit += slots[i] >> 31;
        num_kept += slots[i] >> 30 & 1u;
    }
    for (uint i = lane; i < ask.need_before; i += KARST_SCAN_WIDTH)
        num_freed += freed[i];
    fit[lane] = num_fit;
    kept[lane] = num_kept;
    gone[lane] = num_freed;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0) {
        num_fit = num_kept = num_freed = 0;
        for (uint i = 0; i < KARST_SCAN_WIDTH; i++) {
            uint own = fit[i];
            fit[i] = num_fit;
            num_fit += own;
            num_kept += kept[i];
            num_freed += gone[i];
        }
        need = ask.need - min(ask.need, num_freed);
        if ((ask.need_before && before->num_taken != ask.need_before) || (ask.all_or_none && num_fit < need))
            need = 0;
        result->num_fit = num_fit;
        result->num_taken = min(num_fit, need);
        result->num_kept = num_kept;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    uint at = fit[lane];
    for (uint i = begin; i < end && at < need; i++)
        if (slots[i] & KARST_LRU_FITS) {
            victims[at++] = slots[i] & KARST_LRU_SLOT;
            if (at == need)
                result->num_seen = i + 1;
        }
}
