/* What a picture is seen by: its light, its sky, its camera's rays. */
#include <math.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "raycast/cast/pinhole.h"
#include "raycast/light/light.h"

karst_light karst_engine_light(const karst_engine *engine)
{
    const karst_world_info *world = engine->world;
    double voxel_m = exp2(world->voxel_log2_m);
    karst_light light = karst_light_of_sun(world->sun_azimuth_deg, world->sun_elevation_deg);
    karst_haze haze = {world->haze_distance_m, world->haze_height_m, world->haze_globe_m};
    /* Haze that is as thick everywhere would hide what a longer view is wished for. */
    if (haze.height_m == 0)
        haze.distance_m *= fmax(1, engine->view_distance_m / world->view_distance_m);
    double eye_m[3];
    for (int axis = 0; axis < 3; axis++)
        eye_m[axis] = (double)engine->camera.position.voxel[axis] * voxel_m;
    karst_light_set_haze(&light, &haze, eye_m, voxel_m);
    light.shadow_distance = (float)engine->view_distance_voxels;
    light.mirror = engine->bounce ? (float)karst_engine_mirror_share(engine->mirror, world) : 0;
    memcpy(light.sky_zenith, world->sky_zenith, sizeof world->sky_zenith);
    memcpy(light.sky_horizon, world->sky_horizon, sizeof world->sky_horizon);
    memcpy(light.ground_flat, world->ground_flat, sizeof world->ground_flat);
    memcpy(light.ground_steep, world->ground_steep, sizeof world->ground_steep);
    if (engine->shown.skies)
        karst_skies_light(engine->shown.skies, &light);
    return light;
}

bool karst_engine_aim_skies(karst_engine *engine, karst_error *error)
{
    const karst_world_info *world = engine->world;
    karst_sky_view view = {.globe_m = world->haze_globe_m, .voxel_m = exp2(world->voxel_log2_m)};
    const karst_light light = karst_light_of_sun(world->sun_azimuth_deg, world->sun_elevation_deg);
    if (!engine->shown.skies)
        return true;
    for (int axis = 0; axis < 3; axis++)
        view.eye_m[axis] = (double)engine->camera.position.voxel[axis] * view.voxel_m;
    memcpy(view.sun_direction, light.sun_direction, sizeof view.sun_direction);
    return karst_skies_aim(engine->shown.skies, &view, error);
}

void karst_engine_pinhole(const karst_engine *engine, const karst_camera *camera, karst_pinhole *pinhole)
{
    const karst_engine_window *window = &engine->window;
    if (!window->whole_width_px) {
        karst_pinhole_init(pinhole, camera, engine->width_px, engine->height_px, engine->view_distance_voxels);
        return;
    }
    karst_pinhole_init(pinhole, camera, window->whole_width_px, window->whole_height_px, engine->view_distance_voxels);
    karst_pinhole_cut(pinhole, window->x0_px, window->y0_px, engine->width_px, engine->height_px);
}

void karst_engine_picture_view(const karst_engine *engine, karst_cast_view *view, karst_pinhole *pinhole)
{
    karst_cast_view_init(view, &engine->camera.position, engine->root_corner, engine->top_level);
    view->serial = engine->serial;
    view->detail = (float)karst_engine_detail_px(engine);
    view->own_detail = (float)engine->detail_px;
    view->blend = engine->blend ? KARST_BLEND_SHARE : 0;
    karst_engine_pinhole(engine, &engine->camera, pinhole);
    pinhole->sample = engine->sample;
}
