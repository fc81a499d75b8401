/* The worlds that Karst ships. */
#include <stdio.h>
#include <string.h>

#include "producers/density_producer.h"

static const karst_world_info worlds[] = {
    {
        .name = "hills",
        .description = "rolling land with terraced cliffs, overhangs and caves",
        .source_path = "producers/worlds/hills.clh",
        .voxel_log2_m = -4,
        .seed = 1,
        .view_distance_m = 8192,
        .camera = "0,300,0,30,-9,55",
        .sun_azimuth_deg = 115,
        .sun_elevation_deg = 27,
        .sky_zenith = {0.05f, 0.13f, 0.36f},
        .sky_horizon = {0.36f, 0.46f, 0.58f},
        .ground_flat = {0.085f, 0.115f, 0.03f},
        .ground_steep = {0.23f, 0.19f, 0.15f},
        .haze_distance_m = 7500,
    },
    {
        .name = "asteroid",
        .description = "a lumpy body some 800 m across, pitted, in black space",
        .source_path = "producers/worlds/asteroid.clh",
        .voxel_log2_m = -4,
        .seed = 1,
        .view_distance_m = 4096,
        .camera = "0,220,-1150,0,-11,50",
        .sun_azimuth_deg = 230,
        .sun_elevation_deg = 28,
        .sky_zenith = {0.001f, 0.001f, 0.002f},
        .sky_horizon = {0.004f, 0.004f, 0.006f},
        .ground_flat = {0.24f, 0.21f, 0.18f},
        .ground_steep = {0.13f, 0.12f, 0.11f},
        .haze_distance_m = 1e9,
    },
};
#define NUM_WORLDS (sizeof worlds / sizeof *worlds)

const karst_world_info *karst_world_at(size_t index) { return index < NUM_WORLDS ? worlds + index : NULL; }

const karst_world_info *karst_world_find(const char *name)
{
    for (size_t i = 0; name && i < NUM_WORLDS; i++)
        if (!strcmp(worlds[i].name, name))
            return worlds + i;
    return NULL;
}

int karst_world_options(const karst_world_info *world, uint32_t seed, char *text, size_t size_bytes)
{
    return snprintf(text, size_bytes, "-DWORLD_SEED=%uu -DWORLD_VOXEL_LOG2_M=(%d)", seed, world->voxel_log2_m);
}
