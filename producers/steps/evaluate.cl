/* Evaluate: KARST_BRICK_SIDE^3 samples of each load into staging memory, x fastest. Two shapes, the same bits. */
#include "core/device/lanes.clh"
#include "producers/steps/density.clh"
#include "world.clh"
#include "producers/steps/load_shared.h"

#if KARST_GROUP == 1 && !defined(KARST_MEDIUM)

#include "producers/steps/evaluate.clh"
#include "producers/steps/mend.clh"

/* CPU: work-item i fills brick i. */
K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
karst_evaluate_bricks(K_GLOBAL const karst_load *restrict loads, uint count, K_GLOBAL float *restrict staging,
                      K_GLOBAL karst_scrub *restrict scrubs, world_data data)
{
    uint brick = (uint)get_global_id(0);
    K_GLOBAL float *samples = staging + (ulong)brick * STAGING_STRIDE + CHANNEL_DENSITY_STAGING;
    if (brick >= count)
        return;
    scrubs[brick].raised = scrubs[brick].given_up = 0u;
    if (loads[brick].state != KARST_STATE_UNKNOWN)
        return;
    long origin[3] = {loads[brick].origin[0], loads[brick].origin[1], loads[brick].origin[2]};
    evaluate_brick(WORLD_GIVES(data) origin, loads[brick].level, samples);
    MEND_BRICK(data, origin, loads[brick].level, samples, scrubs + brick);
}

#else

#include "producers/steps/mend.clh"
#ifdef KARST_MEDIUM
#include "producers/steps/medium.clh"
#endif

/* GPU: work-group i fills brick i; its work-items take samples (LANES of them) in turn, each from its own coordinates.
 */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_evaluate_bricks(K_GLOBAL const karst_load *restrict loads, uint count, K_GLOBAL float *restrict staging,
                      K_GLOBAL karst_scrub *restrict scrubs, world_data data)
{
    uint brick = (uint)get_group_id(0);

    if (brick >= count)
        return;
    if (get_local_id(0) == 0)
        scrubs[brick].raised = scrubs[brick].given_up = 0u;
    if (loads[brick].state != KARST_STATE_UNKNOWN)
        return;
    K_GLOBAL float *samples = staging + (ulong)brick * STAGING_STRIDE + CHANNEL_DENSITY_STAGING;
    int level = loads[brick].level;
#ifdef KARST_MEDIUM
    uint num_negative = 0;
    barrier(CLK_GLOBAL_MEM_FENCE); /* the count has begun */
#endif
    for (int first = (int)get_local_id(0) * LANES; first < KARST_BRICK_SAMPLES; first += KARST_GROUP * LANES) {
        vint sample = v_min((vint)(first) + V_LANE, (vint)(KARST_BRICK_SAMPLES - 1));
        vint row = (sample * 7711) >> 17; /* sample / 17, exact for these */
        vint z = (row * 241) >> 12;
        vint steps[3] = {sample - row * KARST_BRICK_SIDE, row - z * KARST_BRICK_SIDE, z};
        world_point_at at;
        float values[LANES];
        for (int axis = 0; axis < 3; axis++) {
            at.voxel[axis] = (vlong)(loads[brick].origin[axis]) + v_int_to_long(steps[axis]) * (vlong)(1L << level);
            at.fraction[axis] = (vuint)(0);
        }
#ifdef KARST_MEDIUM
        const vint valid = v_lt((vint)(first) + V_LANE, (vint)(KARST_BRICK_SAMPLES));
        v_store_float(medium_point(WORLD_GIVES(data) &at, level, valid, &num_negative), values);
#else
        v_store_float(world_point(WORLD_GIVES(data) &at, level), values);
#endif
        for (int lane = 0; lane < LANES && first + lane < KARST_BRICK_SAMPLES; lane++)
            samples[first + lane] = values[lane];
    }
#ifdef KARST_MEDIUM
    if (num_negative)
        atomic_add(&scrubs[brick].raised, num_negative);
#endif
#if defined(MEND_SAMPLES) && !defined(KARST_MEDIUM)
    __local beside_list list;
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    long origin[3] = {loads[brick].origin[0], loads[brick].origin[1], loads[brick].origin[2]};
    mend_samples(data, origin, level, samples, &list);
    if (get_local_id(0) == 0) {
        scrubs[brick].raised = list.num_raised;
        scrubs[brick].given_up = list.num_given_up;
    }
#endif
}

#endif
