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

#define RAYS_ACROSS 9
#define NEXT_PLACE 1.03 /* as far as the last */
#define MUST_FIND 1e5   /* view distances */

/* How far the nearest solid place is that some of a picture's rays come to behind from_m; INFINITY: none was found. */
static double find_solid(karst_sampler *sampler, const karst_camera *camera, int voxel_log2_m, const int size_px[2],
                         double from_m)
{
    double right[3], up[3], forward[3], nearest_m = INFINITY;
    karst_camera_axes(camera, right, up, forward);
    const double half_up = tan(camera->fov_deg * acos(-1) / 360), half_right = half_up * size_px[0] / size_px[1];
    for (int i = 0; i < RAYS_ACROSS * RAYS_ACROSS; i++) {
        const double x = (2.0 * (i % RAYS_ACROSS) / (RAYS_ACROSS - 1) - 1) * half_right;
        const double y = (2.0 * (i / RAYS_ACROSS) / (RAYS_ACROSS - 1) - 1) * half_up;
        const double length = sqrt(1 + x * x + y * y), pixel = 2 * half_up / size_px[1];
        for (double t_m = from_m; t_m < fmin(nearest_m, from_m * MUST_FIND); t_m *= NEXT_PLACE) {
            double way_m[3];
            for (int axis = 0; axis < 3; axis++)
                way_m[axis] = t_m / length * (forward[axis] + x * right[axis] + y * up[axis]);
            const karst_position at = karst_position_add_m(camera->position, way_m, voxel_log2_m);
            if (karst_sampler_precise_density(sampler, &at, t_m * pixel) > 0)
                nearest_m = t_m;
        }
    }
    return nearest_m;
}

void command_say_no_surface(command_talk *talk, const karst_world_config *world, const karst_camera *camera,
                            int voxel_log2_m, const int size_px[2], double view_m)
{
    karst_world *opened = karst_world_open(world, NULL);
    karst_sampler *sampler = opened ? karst_sampler_create(opened, NULL) : NULL;
    double nearest_m = INFINITY;
    if (sampler) {
        view_m = view_m > 0 ? view_m : karst_world_get_metadata(opened)->view_distance_m;
        nearest_m = find_solid(sampler, camera, voxel_log2_m, size_px, view_m);
    }
    if (isfinite(nearest_m)) {
        char text[256];
        snprintf(text, sizeof text,
                 "all rays end at the view distance of %.6g m, in air; something solid is %.3g m away: "
                 "--view-distance %.3g shows it",
                 view_m, nearest_m, 1.5 * nearest_m);
        command_warn(talk, text);
    } else {
        command_say(talk, "all rays go through air: no surface is in view. --camera X,Y,Z,YAW,PITCH looks elsewhere, "
                          "and karst check says whether the density is ever above 0");
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
