/* Evaluate: KARST_BRICK_SIDE^3 samples of each load into staging memory, x fastest. Two shapes, the same bits. */
#include "core/lanes.clh"
#include "producers/density.clh"
#include "world.clh"
#include "producers/load_shared.h"

#if LANES > 1
#define EVALUATE_CALL static __attribute__((noinline)) K_WIDE
#else
#define EVALUATE_CALL K_INLINE K_WIDE
#endif
#define FACE_SAMPLES (KARST_BRICK_SIDE * KARST_BRICK_SIDE)

#if KARST_GROUP == 1

/* The face of a brick at its seventeenth samples along x, in parts of LANES: squares, whose samples lie close together,
 * then its last row and column and their corner. */
#if LANES == 16
#define FACE_SQUARES (KARST_BRICK_CELLS / 4)
#define FACE_PARTS (FACE_SQUARES * FACE_SQUARES + 3)
K_INLINE K_WIDE void face_samples(int part, vint *y, vint *z)
{
    const vint last = (vint)(KARST_BRICK_CELLS);
    int rest = part - FACE_SQUARES * FACE_SQUARES;
    *y = rest < 0 ? (vint)(part % FACE_SQUARES * 4) + (V_LANE & 3) : rest == 0 ? V_LANE : last;
    *z = rest < 0 ? (vint)(part / FACE_SQUARES * 4) + (V_LANE >> 2) : rest == 1 ? V_LANE : last;
}
#else
#define FACE_PARTS FACE_SAMPLES
K_INLINE void face_samples(int part, vint *y, vint *z)
{
    *y = part % KARST_BRICK_SIDE;
    *z = part / KARST_BRICK_SIDE;
}
#endif

/* CPU: work-item i fills brick i. Rows of KARST_BRICK_CELLS samples in the order that world_row likes best; then the
 * seventeenth samples. Not in the entry itself, which drivers compile several times over. */
EVALUATE_CALL void evaluate_brick(WORLD_TAKES(K_GLOBAL const karst_load *load, K_GLOBAL float *samples))
{
    world_axes axes;
    world_prepare(WORLD_DATA(data, &axes, load->origin[0], load->origin[1], load->origin[2], load->level));
    for (int z = 0; z < KARST_BRICK_SIDE; z++)
        for (int y = 0; y < KARST_BRICK_SIDE; y++)
            for (int x = 0; x < KARST_BRICK_CELLS; x += LANES)
                v_store_float(world_row(&axes, x, y, z), samples + (z * KARST_BRICK_SIDE + y) * KARST_BRICK_SIDE + x);
    for (int part = 0; part < FACE_PARTS; part++) {
        vint y, z;
        face_samples(part, &y, &z);
        float values[LANES];
        int at[LANES];
        v_store_float(world_sample(&axes, (vint)(KARST_BRICK_CELLS), y, z), values);
        v_store_int((z * KARST_BRICK_SIDE + y) * KARST_BRICK_SIDE + KARST_BRICK_CELLS, at);
        for (int lane = 0; lane < LANES; lane++)
            samples[at[lane]] = values[lane];
    }
}

K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
karst_evaluate_bricks(K_GLOBAL const karst_load *restrict loads, uint count, K_GLOBAL float *restrict staging,
                      world_data data)
{
    uint brick = (uint)get_global_id(0);
    K_GLOBAL float *samples = staging + (ulong)brick * STAGING_STRIDE + CHANNEL_DENSITY_STAGING;
    if (brick < count && loads[brick].state == KARST_STATE_UNKNOWN)
        evaluate_brick(WORLD_DATA(data, loads + brick, samples));
}

#else

/* GPU: work-group i fills brick i; its work-items take samples (LANES of them) in turn, each from its own coordinates.
 */
K_WIDE __kernel __attribute__((reqd_work_group_size(KARST_GROUP, 1, 1))) void
karst_evaluate_bricks(K_GLOBAL const karst_load *restrict loads, uint count, K_GLOBAL float *restrict staging,
                      world_data data)
{
    uint brick = (uint)get_group_id(0);

    if (brick >= count || loads[brick].state != KARST_STATE_UNKNOWN)
        return;
    K_GLOBAL float *samples = staging + (ulong)brick * STAGING_STRIDE + CHANNEL_DENSITY_STAGING;
    int level = loads[brick].level;
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
        v_store_float(world_point(WORLD_DATA(data, &at, level)), values);
        for (int lane = 0; lane < LANES && first + lane < KARST_BRICK_SAMPLES; lane++)
            samples[first + lane] = values[lane];
    }
}

#endif
