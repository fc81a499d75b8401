/* Usage lists: passes over them. A work-item goes through one chunk of a list; KARST_CHUNK is a multiple of 32, so that
 * every item owns the words of marks that it writes. Count, scan, scatter: no atomics, and order is kept. */
#include "cache/lru_shared.h"
#include "core/lanes.clh"

#if LANES == 16
#define AS_VINT(v) as_int16(v)
#else
#define AS_VINT(v) ((int)(v))
#endif

/* A bit for each lane. */
static uint bits_of(vint mask)
{
#if LANES == 16
    int16 bits = mask & ((int16)(1) << V_LANE);
    int8 a = bits.lo | bits.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (uint)(c.x | c.y);
#else
    return (uint)mask & 1u;
#endif
}

static vint is_used(vint slots, __global const uint *stamps, uint sorted_serial)
{
    vuint stamp = v_gather_uint(stamps, slots);
    return v_ne(stamp, (vuint)(0u)) & v_gt(AS_VINT(stamp - (vuint)(sorted_serial)), (vint)(0));
}

/* Which of the slots in order[begin...], 32 at most, were used since the list was sorted; all at once as far as whole
 * vectors go, and no word of those behind them. */
static uint used_slots(__global const uint *order, uint begin, uint end, __global const uint *stamps,
                       __global const uint *fallback, uint sorted_serial)
{
    uint word = 0;
    for (uint i = 0; i < 32 && begin + i + LANES <= end; i += LANES) {
        vint slots = v_load_int((__global const int *)order + begin + i);
        word |= bits_of(is_used(slots, stamps, sorted_serial) | is_used(slots, fallback, sorted_serial)) << i;
    }
    return word;
}

/* What a window's entry is. */
#define ENTRY_KEEP 0u /* has children: not now, but perhaps later, at the same place in the order */
#define ENTRY_TAKE 1u /* may be recycled */
#define ENTRY_PASS 2u /* free, or used since the list was sorted */

static uint tile_entry(uint tile, karst_lru_window window, __global const uint *stamps,
                       __global const karst_node *nodes, __global const karst_tile_info *tile_info)
{
    uint stamp = stamps[tile];
    if (tile == KARST_ROOT_TILE || stamp == window.serial || karst_stamp_is_after(stamp, window.sorted_serial) ||
        !tile_info[tile].in_use)
        return ENTRY_PASS;
    uint children = 0;
    for (uint i = 0; i < KARST_TILE_NODES; i++)
        children |= KARST_NODE_CHILDREN(nodes[tile * KARST_TILE_NODES + i].link);
    return children ? ENTRY_KEEP : ENTRY_TAKE;
}

static uint brick_entry(uint brick, karst_lru_window window, __global const uint *stamps, __global const uint *fallback,
                        __global const karst_brick_owner *brick_owner)
{
    uint stamp = stamps[brick], stand_in = fallback[brick];
    if (stamp == window.serial || brick_owner[brick].owner == KARST_NO_NODE)
        return ENTRY_PASS;
    if (stand_in == window.serial)
        return window.drop_fallback ? ENTRY_TAKE : ENTRY_PASS;
    bool used =
        karst_stamp_is_after(stamp, window.sorted_serial) || karst_stamp_is_after(stand_in, window.sorted_serial);
    return used ? ENTRY_PASS : ENTRY_TAKE;
}

/* marks: word pairs (take, pass) of 32 entries; counts: how many of either in the chunk. */
__kernel void karst_lru_mark(__global const uint *order, __global const uint *stamps, __global const uint *fallback,
                             __global const karst_node *nodes, __global const karst_tile_info *tile_info,
                             __global const karst_brick_owner *brick_owner, karst_lru_window window,
                             __global uint2 *marks, __global uint2 *counts)
{
    uint chunk = (uint)get_global_id(0), begin = chunk * KARST_CHUNK;
    if (begin >= window.num)
        return;
    uint end = min(window.num, begin + KARST_CHUNK);
    uint2 sum = (uint2)(0, 0);
    for (uint i = begin; i < end; i += 32) {
        /* Most of a list is often in use; stand-ins that may go are, too, and need a closer look. */
        uint used = window.drop_fallback ? 0u
                                         : used_slots(order, window.first + i, window.first + end, stamps, fallback,
                                                      window.sorted_serial);
        uint2 word = (uint2)(0, used);
        for (uint bit = 0; bit < 32 && i + bit < end; bit++) {
            if (used >> bit & 1u)
                continue;
            uint slot = order[window.first + i + bit];
            uint entry = window.kind == KARST_LRU_TILES ? tile_entry(slot, window, stamps, nodes, tile_info)
                                                        : brick_entry(slot, window, stamps, fallback, brick_owner);
            word.x |= (uint)(entry == ENTRY_TAKE) << bit;
            word.y |= (uint)(entry == ENTRY_PASS) << bit;
        }
        marks[i / 32] = word;
        sum += popcount(word);
    }
    counts[chunk] = sum;
}

/* Exclusive prefix sums in place, and the total; one work-group. */
__kernel __attribute__((reqd_work_group_size(KARST_SCAN_WIDTH, 1, 1))) void
karst_lru_scan(__global uint2 *counts, uint num, __global uint2 *total)
{
    __local uint2 sums[KARST_SCAN_WIDTH];
    uint lane = (uint)get_local_id(0), share = (num + KARST_SCAN_WIDTH - 1) / KARST_SCAN_WIDTH;
    uint begin = min(num, lane * share), end = min(num, begin + share);
    uint2 sum = (uint2)(0, 0);
    for (uint i = begin; i < end; i++)
        sum += counts[i];
    sums[lane] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0) {
        uint2 before = (uint2)(0, 0);
        for (uint i = 0; i < KARST_SCAN_WIDTH; i++) {
            uint2 own = sums[i];
            sums[i] = before;
            before += own;
        }
        total[0] = before;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    sum = sums[lane];
    for (uint i = begin; i < end; i++) {
        uint2 own = counts[i];
        counts[i] = sum;
        sum += own;
    }
}

/* Stable partition of a window: what is taken now or passed over | what stays. What is taken is stamped: the next to
 * get the slot uses it. */
__kernel void karst_lru_part(__global const uint *order, __global const uint2 *marks, __global const uint2 *counts,
                             __global const uint2 *total, karst_lru_window window, __global uint *stamps,
                             __global uint *spare, __global uint *victims)
{
    uint chunk = (uint)get_global_id(0), begin = chunk * KARST_CHUNK;
    if (begin >= window.num)
        return;
    uint end = min(window.num, begin + KARST_CHUNK);
    uint num_gone = min(total[0].x, window.need) + total[0].y;
    uint takable = counts[chunk].x; /* before this entry */
    uint gone = min(takable, window.need) + counts[chunk].y;
    for (uint i = begin; i < end; i++) {
        uint2 word = marks[i / 32] >> (i % 32) & 1u;
        uint slot = order[window.first + i];
        bool taken = word.x && takable < window.need;
        if (taken) {
            victims[window.victims_first + takable] = slot;
            stamps[slot] = window.serial;
        }
        takable += word.x;
        if (taken || word.y)
            spare[window.first + gone++] = slot;
        else
            spare[window.first + num_gone + i - gone] = slot;
    }
}

static uint last_use(uint slot, __global const uint *stamps, __global const uint *fallback)
{
    return karst_stamp_later(stamps[slot], fallback[slot]);
}

/* For a sort: x of the marks: the list's i-th entry was not used since the last one; y: slot i + 1 was. */
__kernel void karst_lru_sort_mark(__global const uint *order, __global const uint *stamps,
                                  __global const uint *fallback, uint num, uint sorted_serial, __global uint2 *marks,
                                  __global uint2 *counts)
{
    uint chunk = (uint)get_global_id(0), begin = chunk * KARST_CHUNK;
    if (begin >= num)
        return;
    uint end = min(num, begin + KARST_CHUNK);
    uint2 sum = (uint2)(0, 0);
    for (uint i = begin; i < end; i += 32) {
        uint2 word = (uint2)(0, 0);
        uint bit = 0;
        for (; bit < 32 && i + bit + LANES <= end; bit += LANES) {
            vint listed = v_load_int((__global const int *)order + i + bit),
                 slots = (vint)((int)(i + bit + 1)) + V_LANE;
            word.x |= bits_of(~(is_used(listed, stamps, sorted_serial) | is_used(listed, fallback, sorted_serial)))
                      << bit;
            word.y |= bits_of(is_used(slots, stamps, sorted_serial) | is_used(slots, fallback, sorted_serial)) << bit;
        }
        for (; bit < 32 && i + bit < end; bit++) {
            word.x |= (uint)!karst_stamp_is_after(last_use(order[i + bit], stamps, fallback), sorted_serial) << bit;
            word.y |= (uint)(karst_stamp_is_after(last_use(i + bit + 1, stamps, fallback), sorted_serial) != 0) << bit;
        }
        marks[i / 32] = word;
        sum += popcount(word);
    }
    counts[chunk] = sum;
}

/* Unused since the last sort, in the list's order | used since then, by slot. */
__kernel void karst_lru_sort_part(__global const uint *order, __global const uint2 *marks, __global const uint2 *counts,
                                  __global const uint2 *total, uint num, __global uint *spare)
{
    uint chunk = (uint)get_global_id(0), begin = chunk * KARST_CHUNK;
    if (begin >= num)
        return;
    uint end = min(num, begin + KARST_CHUNK);
    uint unused = counts[chunk].x, used = total[0].x + counts[chunk].y;
    for (uint i = begin; i < end; i += 32) {
        uint2 word = marks[i / 32];
        for (uint left = word.x; left; left &= left - 1)
            spare[unused++] = order[i + 31 - clz(left & -left)];
        for (uint left = word.y; left; left &= left - 1)
            spare[used++] = i + 32 - clz(left & -left);
    }
}

static uint digit_of(uint slot, __global const uint *stamps, __global const uint *fallback, uint sorted_serial,
                     uint shift)
{
    return (last_use(slot, stamps, fallback) - sorted_serial) >> shift & (KARST_LRU_RADIX_SIZE - 1);
}

/* One digit of the casts since the last sort: a stable partition into KARST_LRU_RADIX_SIZE parts. */
__kernel void karst_lru_digit_count(__global const uint *order, __global const uint *stamps,
                                    __global const uint *fallback, uint first, uint num, uint sorted_serial, uint shift,
                                    __global uint2 *counts)
{
    uint chunk = (uint)get_global_id(0), begin = chunk * KARST_CHUNK;
    if (begin >= num)
        return;
    uint end = min(num, begin + KARST_CHUNK), num_chunks = (num + KARST_CHUNK - 1) / KARST_CHUNK;
    uint sums[KARST_LRU_RADIX_SIZE];
    for (uint digit = 0; digit < KARST_LRU_RADIX_SIZE; digit++)
        sums[digit] = 0;
    for (uint i = begin; i < end; i++)
        sums[digit_of(order[first + i], stamps, fallback, sorted_serial, shift)]++;
    for (uint digit = 0; digit < KARST_LRU_RADIX_SIZE; digit++)
        counts[digit * num_chunks + chunk] = (uint2)(sums[digit], 0);
}

__kernel void karst_lru_digit_part(__global const uint *order, __global const uint *stamps,
                                   __global const uint *fallback, __global const uint2 *counts, uint first, uint num,
                                   uint sorted_serial, uint shift, __global uint *spare)
{
    uint chunk = (uint)get_global_id(0), begin = chunk * KARST_CHUNK;
    if (begin >= num)
        return;
    uint end = min(num, begin + KARST_CHUNK), num_chunks = (num + KARST_CHUNK - 1) / KARST_CHUNK;
    uint at[KARST_LRU_RADIX_SIZE];
    for (uint digit = 0; digit < KARST_LRU_RADIX_SIZE; digit++)
        at[digit] = counts[digit * num_chunks + chunk].x;
    for (uint i = begin; i < end; i++) {
        uint slot = order[first + i];
        spare[first + at[digit_of(slot, stamps, fallback, sorted_serial, shift)]++] = slot;
    }
}
