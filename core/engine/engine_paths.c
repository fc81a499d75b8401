/* Pictures of paths (karst_engine_config.integrator). */
#include <math.h>
#include <string.h>

#include "core/engine/engine_parts.h"

static const char *const integrator_names[KARST_NUM_INTEGRATORS] = {"direct", "full"};

bool karst_integrator_parse(const char *name, karst_integrator *integrator, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_INTEGRATORS; i++)
        if (strcmp(name, integrator_names[i]) == 0) {
            *integrator = (karst_integrator)i;
            return true;
        }
    return karst_fail(error, KARST_USAGE, "no light is called '%.40s'; there are: direct, full", name);
}

bool karst_engine_check_paths(const karst_engine_config *config, karst_error *error)
{
    if ((unsigned)config->integrator >= KARST_NUM_INTEGRATORS)
        return karst_fail(error, KARST_USAGE, "there is no integrator number %d", (int)config->integrator);
    if (config->bounces > KARST_ENGINE_MAX_BOUNCES)
        return karst_fail(error, KARST_USAGE, "%u bounces: it may be 1 to %d", config->bounces,
                          KARST_ENGINE_MAX_BOUNCES);
    if (config->irradiance && config->integrator != KARST_INTEGRATOR_FULL)
        return karst_fail(error, KARST_USAGE, "irradiance is found by full light: set KARST_INTEGRATOR_FULL");
    return config->integrator != KARST_INTEGRATOR_FULL || !config->no_shadows ||
           karst_fail(error, KARST_USAGE, "full light without shadows is none: leave one of them out");
}

karst_path_picture karst_engine_path_picture(const karst_engine *engine, const karst_cast_view *view,
                                             const karst_pinhole *pinhole, const karst_light *light, bool again)
{
    const karst_world_info *world = engine->world;
    const bool hides = karst_engine_has_caustics(engine) && engine->clear &&
                       karst_engine_has_content(engine, KARST_CONTENT_CLEAR);
    karst_path_picture picture = {.caster = engine->caster,
                                  .over = hides ? engine->stores[KARST_CONTENT_CLEAR].caster : NULL,
                                  .shader = engine->shader,
                                  .view = view,
                                  .pinhole = pinhole,
                                  .light = light,
                                  .hits = engine->hits,
                                  .parts = karst_radiance_parts(engine->radiance),
                                  .counters = engine->counters,
                                  .again = again,
                                  .mirrors = karst_engine_mirror_share(engine->mirror, world) > 0 ||
                                             (world->has_own_mirror && engine->mirror >= 0)};
    karst_engine_pass_picture(engine, view, pinhole, light, &picture.pass);
    return picture;
}

/* What paths go through; NULL: there is none. `clear` holds it. */
static const karst_path_clear *clear_of(karst_engine *engine, karst_path_clear *clear)
{
    if (!karst_engine_has_content(engine, KARST_CONTENT_CLEAR))
        return NULL;
    const karst_position *eye = &engine->camera.position;
    *clear = (karst_path_clear){.caster = engine->stores[KARST_CONTENT_CLEAR].caster,
                                .shader = engine->shown.clear_shader,
                                .refiner = engine->shown.content[KARST_CONTENT_CLEAR].refining.refiner,
                                .bender = engine->shown.bending.bender,
                                .voxel_m = exp2(engine->world->voxel_log2_m)};
    memcpy(clear->anchor.voxel, eye->voxel, sizeof clear->anchor.voxel);
    memcpy(clear->anchor.fraction, eye->fraction, sizeof clear->anchor.fraction);
    clear->is_inside = karst_engine_is_in_clear(engine, eye, clear->absorption_per_m);
    karst_clear_shader_set_anchor(clear->shader, eye);
    return clear;
}

static bool follow(karst_engine *engine, karst_path_picture *picture, karst_error *error)
{
    karst_path_clear clear;
    karst_pinhole of_paths = *picture->pinhole;
    if (engine->starts) { /* rays to where they start have no sample */
        of_paths.sample = engine->sample;
        picture->pinhole = &of_paths;
        picture->starts = engine->starts;
    }
    karst_engine_path_air air;
    picture->clear = clear_of(engine, &clear);
    if (!karst_engine_media_of_paths(engine, picture, &air, error))
        return false;
    picture->media = air.is_there ? &air.media : NULL;
    const uint32_t bounces =
        air.is_there && !engine->has_own_bounces ? KARST_ENGINE_MAX_BOUNCES : engine->bounces;
    /* With all samples a frame is for the pixels' centres, and adds no light. */
    if (engine->samples > 1 && engine->num_summed == engine->samples)
        return karst_paths_set_lamps(engine->paths, NULL, 0, error) &&
               karst_paths_follow(engine->paths, picture, 0, error);
    karst_lamp lamps[KARST_MOST_LAMPS];
    const uint32_t num = karst_engine_lamps(engine, picture->light, lamps);
    return karst_paths_set_lamps(engine->paths, lamps, num, error) &&
           karst_paths_follow(engine->paths, picture, bounces, error);
}

bool karst_engine_draw_lights_of(karst_engine *engine, const karst_path_picture *picture, const karst_buffer *rays,
                                 const karst_buffer *count, const karst_buffer *hits, karst_error *error)
{
    karst_lamp lamps[KARST_MOST_LAMPS];
    karst_engine_path_air air = {0};
    karst_path_picture own = *picture;
    const uint32_t num = karst_engine_own_lamps(engine, lamps, 0);
    if (num && !karst_engine_media_of_lamps(engine, picture, &air, error))
        return false;
    own.media = air.is_there ? &air.media : NULL;
    /* As the sun does, they shine through matter where pictures are without shadows. */
    for (uint32_t i = 0; i < num; i++)
        lamps[i].shadow = lamps[i].shadow && engine->shadows;
    if (num && (!karst_paths_set_lamps(engine->paths, lamps, num, error) ||
                !(rays ? karst_paths_add_lamps_of(engine->paths, &own, rays, count, hits, error)
                       : karst_paths_add_lamps(engine->paths, &own, error))))
        return false;
    return karst_engine_gather_photons(engine, picture, rays, count, rays ? hits : picture->hits, error) &&
           karst_engine_gather_light_map(engine, picture, rays, count, rays ? hits : picture->hits, error);
}

/* To the picture's surfaces, or those that they mirror. */
static bool add_lights(karst_engine *engine, karst_path_picture *picture, bool mirrored, karst_error *error)
{
    if (!mirrored)
        return karst_engine_draw_lights_of(engine, picture, NULL, NULL, NULL, error);
    const karst_bounce_stream stream = karst_bounce_get_stream(engine->bounce);
    picture->mirrors = false; /* nothing is seen in two of them */
    return karst_engine_draw_lights_of(engine, picture, stream.rays, stream.total, stream.hits, error);
}

bool karst_engine_draw_paths(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                             const karst_light *light, karst_error *error)
{
    karst_path_picture picture = karst_engine_path_picture(engine, view, pinhole, light, false);
    picture.only_lacking = engine->draws_lacking;
    return follow(engine, &picture, error);
}

bool karst_engine_draw_lights(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              const karst_light *light, bool mirrored, karst_error *error)
{
    if (!engine->paths)
        return true;
    karst_path_picture picture = karst_engine_path_picture(engine, view, pinhole, light, false);
    return add_lights(engine, &picture, mirrored, error);
}

bool karst_engine_look_at_mirrored_lights(karst_engine *engine, const karst_cast_view *view,
                                          const karst_pinhole *pinhole, karst_error *error)
{
    if (!engine->paths)
        return true;
    const karst_light light = karst_engine_light(engine);
    karst_path_picture picture = karst_engine_path_picture(engine, view, pinhole, &light, true);
    return add_lights(engine, &picture, true, error);
}

bool karst_engine_look_at_paths(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                bool only_lacking, karst_error *error)
{
    if (!engine->paths)
        return true;
    const karst_light light = karst_engine_light(engine);
    karst_path_picture picture = karst_engine_path_picture(engine, view, pinhole, &light, true);
    picture.only_lacking = only_lacking;
    return engine->integrator == KARST_INTEGRATOR_FULL ? follow(engine, &picture, error)
                                                       : add_lights(engine, &picture, false, error);
}
