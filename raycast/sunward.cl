/* Entry point: what bricks are to rays towards the sun. See raycast/sunward.h. */
#include "raycast/packing.clh"
#include "raycast/samples.clh"
#include "raycast/segments.clh"
#include "raycast/sunward_shared.h"

/* Samples of neighbours in x, as lanes. */
#if LANES == 1
#define LOAD_SAMPLES(p) ((float)*(p))
#elif KARST_BRICK_BITS == 32
#define LOAD_SAMPLES(p) vload16(0, p)
#else
#define LOAD_SAMPLES(p) convert_float16(vload16(0, p))
#endif

/* The four samples of a row of cells at one height. */
typedef struct {
    vfloat v00, v10, v01, v11; /* x, z */
} cell_corners;

RAY_INLINE cell_corners corners_at_height(K_GLOBAL const karst_brick_sample *q)
{
    const cell_corners c = {LOAD_SAMPLES(q), LOAD_SAMPLES(q + 1), LOAD_SAMPLES(q + ROW_Z), LOAD_SAMPLES(q + ROW_Z + 1)};
    return c;
}

RAY_INLINE vfloat most_of_two(vfloat a, vfloat b, float share) { return lane_max(a * share, b * share); }

/* Bits of 16 cells to those of their pairs, and of 8 pairs to those of their pairs. */
RAY_INLINE uint bits_of_pairs(uint bits)
{
    bits = (bits | bits >> 1) & 0x5555u;
    bits = (bits | bits >> 1) & 0x3333u;
    bits = (bits | bits >> 2) & 0x0f0fu;
    return (bits | bits >> 4) & 0xffu;
}

#if LANES == 16
#define SURVEY_CALL static K_WIDE __attribute__((noinline))
#else
#define SURVEY_CALL RAY_INLINE
#endif

SURVEY_CALL void survey_brick(K_GLOBAL const karst_brick_sample *samples, float any_way, const float sun[4],
                              K_GLOBAL karst_sunward_brick *brick)
{
    const vfloat none = (vfloat)(0.0f);
    vfloat steepest = none;
    uint fine[KARST_FINE_WORDS], blocks[2] = {0u, 0u};
    for (int word = 0; word < KARST_FINE_WORDS; word++)
        fine[word] = 0u;
    for (int z = 0; z < KARST_BRICK_CELLS; z++)
        for (int y = 0; y < KARST_BRICK_CELLS; y++) {
            uint row = 0;
            for (int x = 0; x < KARST_BRICK_CELLS; x += LANES) {
                K_GLOBAL const karst_brick_sample *q = samples + z * ROW_Z + y * ROW_Y + x;
                const cell_corners a = corners_at_height(q), b = corners_at_height(q + ROW_Y);
                vfloat rise = lane_max(most_of_two(a.v10 - a.v00, a.v11 - a.v01, sun[0]),
                                       most_of_two(b.v10 - b.v00, b.v11 - b.v01, sun[0]));
                rise += lane_max(most_of_two(b.v00 - a.v00, b.v10 - a.v10, sun[1]),
                                 most_of_two(b.v01 - a.v01, b.v11 - a.v11, sun[1]));
                rise += lane_max(most_of_two(a.v01 - a.v00, a.v11 - a.v10, sun[2]),
                                 most_of_two(b.v01 - b.v00, b.v11 - b.v10, sun[2]));
                steepest = lane_max(steepest, rise);
                const vfloat high = lane_max(lane_max(lane_max(a.v00, a.v10), lane_max(a.v01, a.v11)),
                                             lane_max(lane_max(b.v00, b.v10), lane_max(b.v01, b.v11)));
                const vfloat low = lane_min(lane_min(lane_min(a.v00, a.v10), lane_min(a.v01, a.v11)),
                                            lane_min(lane_min(b.v00, b.v10), lane_min(b.v01, b.v11)));
                row |= mask_bits(v_gt(high, none) & v_le(low, none) & v_gt(rise, (vfloat)(-KARST_SUNWARD_FALL))) << x;
            }
            if (!row)
                continue;
            const uint pairs = bits_of_pairs(row);
            fine[(y >> 3) + (z >> 1) * 2] |= pairs << (y >> 1 & 3) * 8;
            blocks[z >> 3] |= (bits_of_pairs(pairs) & 15u) << ((y >> 2) * 4 + (z >> 2 & 1) * 16);
        }
    for (int word = 0; word < KARST_FINE_WORDS; word++)
        brick->fine[word] = fine[word];
    brick->blocks[0] = blocks[0];
    brick->blocks[1] = blocks[1];
    const float safe = 1.0f / (v_max_across(steepest) + KARST_SUNWARD_ROUNDING);
    brick->safe_cells = safe > any_way ? safe : any_way;
}

/* A work-item for each load, or slot. */
__kernel K_WIDE void survey_sunward(karst_sunward_task task, K_GLOBAL const uint *load_slots,
                                    K_GLOBAL const uint *load_results, K_GLOBAL const karst_brick_owner *owners,
                                    K_GLOBAL const karst_brick_info *brick_info, BRICK_PARAMETERS,
                                    K_GLOBAL karst_sunward_brick *sunward)
{
    const brick_pool bricks = BRICK_FIELDS;
    const uint i = (uint)get_global_id(0);
    if (i >= task.num)
        return;
    uint slot = i;
    if (task.from_loads) {
        const uint result = load_results[i];
        if (result != KARST_STATE_BRICK && !(result & KARST_LOAD_KEPT))
            return;
        slot = load_slots[i];
    } else if (slot == KARST_NONE || owners[slot].owner == KARST_NO_NODE) {
        return;
    }
    survey_brick(brick_samples(&bricks, slot), brick_info[slot].safe_cells, task.direction, sunward + slot);
}
