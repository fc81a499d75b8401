/* What is to be said of worlds before they are drawn. */
#include "command.h"

#include <math.h>

#define MAX_WORLDS 64

void command_say_if_inside(command_talk *talk, const karst_world_config *world, const karst_camera *camera,
                           int voxel_log2_m)
{
    const double footprint_m = ldexp(1, voxel_log2_m);
    karst_world *opened = karst_world_open(world, NULL);
    karst_sampler *sampler = opened ? karst_sampler_create(opened, NULL) : NULL;
    if (sampler && karst_sampler_density(sampler, &camera->position, footprint_m).device > 0) {
        double up_m = 1;
        karst_camera above = *camera;
        char text[512];
        for (; up_m < 1e6; up_m = ceil(up_m * 1.25)) {
            above.position = karst_position_add_m(camera->position, (double[3]){0, up_m, 0}, voxel_log2_m);
            if (karst_sampler_density(sampler, &above.position, footprint_m).device < 0)
                break;
        }
        karst_camera_format(&above, voxel_log2_m, text, sizeof text);
        if (up_m < 1e6)
            command_say(talk, "the camera is inside solid ground; there is air %.0f m above it: --camera %s", up_m,
                        text);
        else
            command_say(talk, "the camera is inside solid ground, with no air in 1000 km above it: --camera "
                              "X,Y,Z,YAW,PITCH moves it, and "
                              "karst check says whether the density is ever below 0");
    }
    karst_sampler_destroy(sampler);
    karst_world_close(opened);
}

void command_print_worlds(FILE *file)
{
    char names[MAX_WORLDS][KARST_DATA_NAME_BYTES];
    size_t num_worlds = karst_data_list("worlds", ".karst", names, MAX_WORLDS);
    for (size_t i = 0; i < num_worlds; i++) {
        const karst_world_config config = {.world = names[i]};
        karst_world *world = karst_world_open(&config, NULL);
        fprintf(file, "  %-14s %s\n", names[i], world ? karst_world_get_metadata(world)->description : "");
        karst_world_close(world);
    }
}
