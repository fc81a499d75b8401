/* Finalise: samples in staging memory become a constant or clear node or a brick. */
#include "core/device/lanes.clh"
#include "producers/steps/finalise.clh"

/* Work-group i finalises load first + i of the work, whose samples are the i-th of the staging memory. A second launch,
 * with a `total` that is not NULL, adds up what the first scrubbed: a kernel of its own would cost a start of the
 * program another compilation. */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_finalise_bricks(K_GLOBAL const karst_load *restrict loads, K_GLOBAL float *staging, uint first, uint count,
                      K_GLOBAL const uint *restrict load_slots, K_GLOBAL uint *restrict load_results,
                      K_GLOBAL karst_brick_info *restrict brick_info, K_GLOBAL karst_scrub *restrict scrubs,
                      K_GLOBAL karst_scrub_total *restrict total, uint bricks_per_segment,
                      K_GLOBAL karst_brick_sample *b0, K_GLOBAL karst_brick_sample *b1, K_GLOBAL karst_brick_sample *b2,
                      K_GLOBAL karst_brick_sample *b3, K_GLOBAL karst_brick_sample *b4, K_GLOBAL karst_brick_sample *b5,
                      K_GLOBAL karst_brick_sample *b6, K_GLOBAL karst_brick_sample *b7)
{
    uint brick = (uint)get_group_id(0);
#if KARST_GROUP > 1
    __local uint cells[NUM_GROUP_CELLS + KARST_FINE_WORDS];
#endif

    if (total) {
        if ((brick | (uint)LOCAL_ID) == 0u)
            tally(loads, scrubs, count, total);
        return;
    }
    if (brick >= count)
        return;
    if (loads[brick].state != KARST_STATE_UNKNOWN) {
        if (LOCAL_ID == 0) {
            load_results[first + brick] = loads[brick].state;
            scrubs[brick].count = 0u;
            scrubs[brick].first = KARST_NO_SAMPLE;
        }
        return;
    }
#if KARST_GROUP > 1
    if (LOCAL_ID < NUM_GROUP_CELLS + KARST_FINE_WORDS)
        cells[LOCAL_ID] = 0u;
    GROUP_BARRIER();
#endif
    uint slot = load_slots[first + brick];
    brick_places at;
    at.doubt = loads[brick].doubt;
    at.keep = loads[brick].keep;
    at.least = 0;
    at.samples = staging + (ulong)brick * STAGING_STRIDE + CHANNEL_DENSITY_STAGING;
    at.result = load_results + first + brick;
    at.scrub = scrubs + brick;
    at.info = brick_info + slot;
    K_GLOBAL karst_brick_sample *in_slot = slot_at(slot, bricks_per_segment, b0, b1, b2, b3, b4, b5, b6, b7);
    at.q = in_slot + CHANNEL_DENSITY_SLOT;
    at.fine = (K_GLOBAL uint *)(in_slot + SLOT_STRIDE);
    finalise_brick(&at CELLS);
}
