/* What a picture is seen by: its light, its sky, its camera's rays. */
#include <math.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "raycast/cast/pinhole.h"
#include "raycast/light/light.h"

double karst_engine_mirror_share(double configured, const karst_world_info *world)
{
    return configured > 0 ? configured : configured < 0 ? 0 : world->mirror;
}

karst_sun karst_engine_get_sun(const karst_engine *engine)
{
    const karst_sun own = {engine->world->sun_azimuth_deg, engine->world->sun_elevation_deg};
    return engine->has_sun ? engine->sun : own;
}

bool karst_engine_has_own_sun(const karst_engine *engine) { return engine->has_sun; }

bool karst_engine_check_sun(const karst_sun *sun, karst_error *error)
{
    return (fabs(sun->azimuth_deg) <= 36000 && fabs(sun->elevation_deg) <= 90) ||
           karst_fail(error, KARST_USAGE,
                      "a sun at azimuth %g, elevation %g: degrees, the azimuth from -36000 to 36000, the elevation "
                      "from -90 to 90",
                      sun->azimuth_deg, sun->elevation_deg);
}

bool karst_engine_set_sun(karst_engine *engine, const karst_sun *sun, karst_error *error)
{
    if (sun && !karst_engine_check_sun(sun, error))
        return false;
    const karst_sun before = karst_engine_get_sun(engine);
    engine->has_sun = sun != NULL;
    if (sun)
        engine->sun = *sun;
    const karst_sun after = karst_engine_get_sun(engine);
    if (before.azimuth_deg != after.azimuth_deg || before.elevation_deg != after.elevation_deg)
        engine->view_changed = true;
    return true;
}

static karst_light sunlight(const karst_engine *engine)
{
    const karst_sun sun = karst_engine_get_sun(engine);
    karst_light light = karst_light_of_sun(sun.azimuth_deg, sun.elevation_deg);
    if (engine->world->has_sun_colour)
        memcpy(light.sun_colour, engine->world->sun_colour, sizeof engine->world->sun_colour);
    if (engine->alone.is_on)
        memcpy(light.sun_direction, engine->alone.sun_direction, sizeof engine->alone.sun_direction);
    return light;
}

karst_light karst_engine_light(const karst_engine *engine)
{
    const karst_world_info *world = engine->world;
    double voxel_m = exp2(world->voxel_log2_m);
    karst_light light = sunlight(engine);
    karst_haze haze = {world->haze_distance_m, world->haze_height_m, world->haze_globe_m};
    /* Haze that is as thick everywhere would hide what a longer view is wished for. */
    if (haze.height_m == 0)
        haze.distance_m *= fmax(1, engine->view_distance_m / world->view_distance_m);
    double eye_m[3];
    for (int axis = 0; axis < 3; axis++)
        eye_m[axis] = (double)engine->camera.position.voxel[axis] * voxel_m;
    karst_light_set_haze(&light, &haze, eye_m, voxel_m);
    light.shadow_distance = (float)engine->view_distance_voxels;
    const bool mirrors = engine->bounce || engine->clear || engine->integrator == KARST_INTEGRATOR_FULL;
    light.mirror = mirrors ? (float)karst_engine_mirror_share(engine->mirror, world) : 0;
    memcpy(light.sky_zenith, world->sky_zenith, sizeof world->sky_zenith);
    memcpy(light.sky_horizon, world->sky_horizon, sizeof world->sky_horizon);
    memcpy(light.ground_flat, world->ground_flat, sizeof world->ground_flat);
    memcpy(light.ground_steep, world->ground_steep, sizeof world->ground_steep);
    if (engine->shown.skies)
        karst_skies_light(engine->shown.skies, &light);
    for (int c = 0; engine->alone.is_on && c < 3; c++) {
        light.sun_colour[c] = engine->alone.sun;
        light.sky_zenith[c] = engine->alone.behind;
    }
    return light;
}

bool karst_engine_aim_skies(karst_engine *engine, karst_error *error)
{
    const karst_world_info *world = engine->world;
    karst_sky_view view = {.globe_m = world->haze_globe_m, .voxel_m = exp2(world->voxel_log2_m)};
    const karst_light light = sunlight(engine);
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
    pinhole->sample = engine->starts ? 0 : engine->sample;
}
