/* Entry points of colours.h. */
#include "cache/colour.clh"
#include "core/device/lanes.clh"

__kernel void karst_begin_colours(K_GLOBAL uint *coloured, uint count)
{
    const uint item = (uint)get_global_id(0);
    if (item < count)
        coloured[item] = 0u;
}

/* Work-group i packs the colours of load first + i of the work. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_end_colours(K_GLOBAL const float *planes, K_GLOBAL const uint *restrict coloured, uint first, uint count,
                  K_GLOBAL const uint *restrict load_slots, K_GLOBAL const uint *restrict load_results,
                  K_GLOBAL uint *restrict slot_coloured, uint bricks_per_segment, K_GLOBAL uint *c0, K_GLOBAL uint *c1,
                  K_GLOBAL uint *c2, K_GLOBAL uint *c3, K_GLOBAL uint *c4, K_GLOBAL uint *c5, K_GLOBAL uint *c6,
                  K_GLOBAL uint *c7)
{
    const uint brick = (uint)get_group_id(0), item = (uint)get_local_id(0);
    if (brick >= count)
        return;
    const uint slot = load_slots[first + brick], result = load_results[first + brick];
    const int is_brick = result == KARST_STATE_BRICK || (result & KARST_LOAD_KEPT);
    const int has_colours = is_brick && coloured[brick];
    if (item == 0 && is_brick)
        slot_coloured[slot] = has_colours ? 1u : 0u;
    if (!has_colours)
        return;
    const uint segment = slot / bricks_per_segment;
    K_GLOBAL uint *const segments[KARST_MAX_BRICK_SEGMENTS] = {c0, c1, c2, c3, c4, c5, c6, c7};
    K_GLOBAL int *to =
        (K_GLOBAL int *)(segments[segment] + (ulong)(slot - segment * bricks_per_segment) * KARST_BRICK_PADDED);
    K_GLOBAL const float *from = planes + (ulong)brick * (4 * KARST_BRICK_PADDED);
    for (uint i = item * LANES; i < KARST_BRICK_PADDED; i += KARST_GROUP * LANES)
        v_store_int(colour_pack(v_load_float(from + i), v_load_float(from + KARST_BRICK_PADDED + i),
                                v_load_float(from + 2 * KARST_BRICK_PADDED + i),
                                v_load_float(from + 3 * KARST_BRICK_PADDED + i)),
                    to + i);
}
