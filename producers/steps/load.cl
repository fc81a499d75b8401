/* Evaluate and finalise in one, where one work-item has all of a brick: its samples never leave the core's own cache.
 */
#include "core/device/lanes.clh"
#include "producers/steps/density.clh"
#include "world.clh"
#include "producers/steps/load_shared.h"

#define KARST_GROUP 1
#define SAMPLES_SPACE K_PRIVATE
#define SAMPLES_ARE_SPENT
#include "producers/steps/evaluate.clh"
#include "producers/steps/mend.clh"
#include "producers/steps/finalise.clh"
#ifdef KARST_MEDIUM
#include "producers/steps/medium.clh"
#endif

FINALISE_CALL void load_brick(WORLD_TAKES const long origin[3], int level, brick_places *at)
{
    float samples[STAGING_STRIDE] __attribute__((aligned(64)));
    float *density = samples + CHANNEL_DENSITY_STAGING;
    for (int i = KARST_BRICK_SAMPLES; i < KARST_BRICK_PADDED; i++)
        density[i] = 0.0f; /* the slot's padding is the same whatever was there before */
    fetch_slot(at->q); /* from afar; once more when it is about to be written */
#ifdef KARST_MEDIUM
    at->scrub->raised = evaluate_medium(WORLD_GIVES(data) origin, level, density);
    at->scrub->given_up = 0u;
#else
    evaluate_brick(WORLD_GIVES(data) origin, level, density);
    at->scrub->raised = at->scrub->given_up = 0u;
    MEND_BRICK(data, origin, level, density, at->scrub);
#endif
    at->samples = density;
    finalise_brick(at);
}

/* Work-item i answers load first + i of the work. What proves a load without a surface constant comes later
 * (karst_bound_nodes), so nothing is in doubt here. A second launch, with a `total` that is not NULL, adds up what the
 * first scrubbed. */
K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
karst_load_bricks(K_GLOBAL const uint *restrict load_nodes, K_GLOBAL const uint *restrict load_slots, uint first,
                  uint count, K_GLOBAL const karst_node *restrict nodes,
                  K_GLOBAL const karst_tile_info *restrict tile_info, K_GLOBAL uint *restrict load_results,
                  K_GLOBAL float *restrict least, K_GLOBAL karst_brick_info *restrict brick_info,
                  K_GLOBAL karst_load *loads, K_GLOBAL karst_scrub *scrubs, K_GLOBAL karst_scrub_total *total,
                  uint bricks_per_segment, K_GLOBAL karst_brick_sample *b0, K_GLOBAL karst_brick_sample *b1,
                  K_GLOBAL karst_brick_sample *b2, K_GLOBAL karst_brick_sample *b3, K_GLOBAL karst_brick_sample *b4,
                  K_GLOBAL karst_brick_sample *b5, K_GLOBAL karst_brick_sample *b6, K_GLOBAL karst_brick_sample *b7,
                  world_data data)
{
    uint brick = (uint)get_global_id(0);
    if (total) {
        if (brick == 0u)
            tally(loads, scrubs, count, total);
        return;
    }
    if (brick >= count)
        return;
    uint node = load_nodes[first + brick], slot = load_slots[first + brick];
    long origin[3];
    int level = karst_node_corner(tile_info, node, origin);
    for (int axis = 0; axis < 3; axis++)
        origin[axis] = karst_node_origin(origin[axis], level);
    karst_load load = {{origin[0], origin[1], origin[2]}, level, KARST_STATE_UNKNOWN, INFINITY,
                       karst_node_is_clear(nodes[node])};
    loads[brick] = load;
    brick_places at;
    at.doubt = load.doubt;
    at.keep = load.keep;
    at.least = least + brick;
    at.result = load_results + first + brick;
    at.scrub = scrubs + brick;
    at.info = brick_info + slot;
    K_GLOBAL karst_brick_sample *in_slot = slot_at(slot, bricks_per_segment, b0, b1, b2, b3, b4, b5, b6, b7);
    at.q = in_slot + CHANNEL_DENSITY_SLOT;
    at.fine = (K_GLOBAL uint *)(in_slot + SLOT_STRIDE);
    load_brick(WORLD_GIVES(data) origin, level, &at);
}
