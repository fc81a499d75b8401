/* The world 'asteroid' on every shape of device and on the host. */
#define WORLD_SEED 1u
#define WORLD_VOXEL_LOG2_M (-4)
#include "producers/worlds/asteroid.clh"

#include "tests/producers/world_suite.h"

static void rows(const karst_load *load, float samples[KARST_BRICK_SAMPLES])
{
    world_axes axes;
    world_prepare(&axes, load->origin[0], load->origin[1], load->origin[2], load->level);
    for (int z = 0, i = 0; z < KARST_BRICK_SIDE; z++)
        for (int y = 0; y < KARST_BRICK_SIDE; y++)
            for (int x = 0; x < KARST_BRICK_SIDE; x++, i++)
                samples[i] = x < KARST_BRICK_CELLS ? world_row(&axes, x, y, z) : world_sample(&axes, x, y, z);
}

int main(void)
{
    const host_world world = {
        .name = "asteroid",
        .seed = WORLD_SEED,
        .voxel_log2_m = WORLD_VOXEL_LOG2_M,
        .rows = rows,
        .point = world_point,
        .golden_samples = 0x41bc0f374d550a25u,
        .golden_bricks = 0xe24395be2d0c8f25u,
    };
    return run_world_suite(&world);
}
