/* Making and unmaking an engine. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/display/display_platform.h"
#include "core/engine/engine_parts.h"
#include "core/device/helper.h"
#include "core/display/opening.h"

#define DEFAULT_WIDTH_PX 1280
#define DEFAULT_HEIGHT_PX 720
#define DEFAULT_POOL_BYTES ((uint64_t)512 << 20)
#define DEFAULT_BUDGET_BRICKS 4096u
#define MAX_BUDGET_BRICKS 8192u
#define MAX_BUDGET_MS 60000.0
#define DEFAULT_CLEAR_BOUNCES 6u
/* Fewer slots than these cannot hold even the coarsest picture: the eight root bricks, their stand-ins and the way to
 * them. */
#define MIN_TILES 32u
#define MIN_BRICKS 32u
/* A leaf tile's eight nodes hold three or four bricks, of which rays touch some; with the tiles of the way down, that
 * is one or two to a brick. */
#define TILES_PER_BRICK 3u
/* What fills a store beside the land is seen in a part of most pictures. */
#define BRICKS_PER_STORE_BRICK 2u

/* Of a store beside the land. */
static uint32_t store_bricks(uint32_t num_bricks)
{
    const uint32_t share = num_bricks / BRICKS_PER_STORE_BRICK;
    return share > MIN_BRICKS ? share : MIN_BRICKS;
}

bool karst_engine_size_pools(const karst_engine_config *config, uint32_t num_stores, uint32_t *num_tiles,
                             uint32_t *num_bricks, karst_error *error)
{
    const uint64_t brick_bytes = KARST_CACHE_BRICK_BYTES_OF(config->brick_bits ? (uint32_t)config->brick_bits : 16u);
    uint64_t set_bytes = brick_bytes + (uint64_t)TILES_PER_BRICK * KARST_CACHE_TILE_BYTES;
    uint64_t pool_bytes = config->pool_bytes ? config->pool_bytes : DEFAULT_POOL_BYTES;
    set_bytes += num_stores * (brick_bytes / BRICKS_PER_STORE_BRICK + TILES_PER_BRICK * KARST_STORE_TILE_BYTES);
    uint64_t bricks = config->num_bricks ? config->num_bricks : pool_bytes / set_bytes;
    uint64_t tiles = config->num_tiles ? config->num_tiles : bricks * TILES_PER_BRICK;
    if (bricks < MIN_BRICKS || tiles < MIN_TILES) {
        uint64_t least_mib = (MIN_BRICKS * set_bytes + ((uint64_t)1 << 20) - 1) >> 20;
        return karst_fail(
            error, KARST_USAGE,
            "the pools are too small for any picture: %llu bricks and %llu tiles; %llu MiB would do (--pool %llu)",
            (unsigned long long)bricks, (unsigned long long)tiles, (unsigned long long)least_mib,
            (unsigned long long)least_mib);
    }
    if (tiles > KARST_MAX_TILES || bricks > UINT32_MAX / 2)
        return karst_fail(error, KARST_USAGE,
                          "the pools are too large: %llu bricks and %llu tiles; %u tiles are the limit",
                          (unsigned long long)bricks, (unsigned long long)tiles, KARST_MAX_TILES);
    *num_tiles = (uint32_t)tiles;
    *num_bricks = (uint32_t)bricks;
    return true;
}

void karst_engine_cast_options(const karst_engine_config *config, const karst_world_info *world, char *text,
                               size_t size_bytes)
{
    const unsigned of_streams = KARST_SHADE_MIRROR | KARST_SHADE_PATHS | KARST_SHADE_OCCLUSION;
    const bool has_streams = karst_engine_shade_ways(config, world) & of_streams;
    int length =
        snprintf(text, size_bytes, "%s%s%s%s", has_streams ? "" : KARST_CAST_NO_STREAMS,
                 config->no_shadows ? " " KARST_CAST_NO_SHADOWS : "", config->no_beam ? " " KARST_CAST_NO_BEAM : "",
                 karst_engine_has_wide_sun(config) ? " " KARST_CAST_SUN_DISC : "");
    if (config->safe_steps != 0 && config->safe_steps != 1)
        snprintf(text + length, size_bytes - (size_t)length, " " KARST_CAST_SAFE_STEPS,
                 config->safe_steps > 0 ? config->safe_steps : 0);
}

void karst_engine_picture_size(const karst_engine_config *config, int *width_px, int *height_px)
{
    bool is_given = config->width_px || config->height_px;
    *width_px = is_given ? config->width_px : DEFAULT_WIDTH_PX;
    *height_px = is_given ? config->height_px : DEFAULT_HEIGHT_PX;
}

bool karst_engine_has_wide_sun(const karst_engine_config *config)
{
    /* In motion what is known of bricks towards the sun's centre is worth more. */
    return config->samples > 1 && !config->no_shadows && config->budget_ms <= 0;
}

unsigned karst_engine_shade_ways(const karst_engine_config *config, const karst_world_info *world)
{
    if (config->integrator == KARST_INTEGRATOR_FULL)
        return KARST_SHADE_RADIANCE | KARST_SHADE_PATHS | (world->has_clear ? KARST_SHADE_THROUGH_CLEAR : 0u) |
               (karst_engine_wants_pass(config, world) ? KARST_SHADE_PASS : 0u);
    const bool passes = karst_engine_wants_pass(config, world);
    const bool mirror = karst_engine_mirror_share(config->mirror, world) > 0 ||
                        (world->has_own_mirror && config->mirror >= 0) || world->has_clear || passes;
    const bool lights = world->num_lights > 0 || karst_engine_wants_light_map(config, world);
    const bool occlusion = karst_engine_wants_occlusion(config, world);
    const bool radiance = mirror || lights || occlusion || world->has_air || config->samples > 1 ||
                          config->tone != KARST_TONE_OF_PLAIN || config->exposure;
    return (config->no_shadows ? 0u : KARST_SHADE_SHADOWS) | (radiance ? KARST_SHADE_RADIANCE : 0u) |
           (mirror ? KARST_SHADE_MIRROR : 0u) | (passes ? KARST_SHADE_PASS : 0u) |
           (occlusion ? KARST_SHADE_OCCLUSION : 0u) |
           (lights || karst_engine_wants_caustics(config, world) ? KARST_SHADE_PATHS : 0u);
}

bool karst_engine_check_budget_ms(double budget_ms, karst_error *error)
{
    return (budget_ms >= 0 && budget_ms <= MAX_BUDGET_MS) ||
           karst_fail(error, KARST_USAGE, "a budget of %g ms a frame: it may be 0 (count bricks only) to %g", budget_ms,
                      MAX_BUDGET_MS);
}

static bool check_look(const karst_engine_config *config, karst_error *error)
{
    if (config->samples > KARST_ENGINE_MAX_SAMPLES)
        return karst_fail(error, KARST_USAGE, "%u samples of a pixel: it may be 1 to %d", config->samples,
                          KARST_ENGINE_MAX_SAMPLES);
    if ((unsigned)config->tone >= KARST_NUM_TONES)
        return karst_fail(error, KARST_USAGE, "there is no tone number %d", (int)config->tone);
    if (!(config->mirror <= 1))
        return karst_fail(error, KARST_USAGE, "land that mirrors %g of its light: it may be 0 to 1", config->mirror);
    if ((unsigned)config->occlusion >= KARST_NUM_OCCLUSIONS)
        return karst_fail(error, KARST_USAGE, "there is no mode of occlusion number %d", (int)config->occlusion);
    if ((unsigned)config->models >= KARST_NUM_MODELS_AS)
        return karst_fail(error, KARST_USAGE, "there is no way number %d to show models", (int)config->models);
    if (config->has_sun && !karst_engine_check_sun(&config->sun, error))
        return false;
    return karst_engine_check_exposure(config->exposure, config->exposure_stops, error);
}

static bool take_display(karst_engine *engine, karst_opening *opening, karst_error *error)
{
    if (!engine->display)
        engine->display = karst_opening_display(opening, error);
    return engine->display != NULL;
}

/* Before the display, which goes on opening beside what follows; but a device that can share memory with its OpenGL
 * must be opened for that. */
static bool open_context(karst_engine *engine, const karst_engine_config *config, karst_opening *opening,
                         karst_error *error)
{
    cl_context_properties sharing[KARST_SHARING_PROPERTIES];
    size_t num_devices = 0;
    const karst_device_info *devices = karst_opening_devices(opening, &num_devices, error);
    const karst_device_info *chosen =
        devices ? karst_context_choose(devices, num_devices, config->device, error) : NULL;
    engine->owns_display = !config->in_display;
    engine->display = config->in_display;
    if (!chosen || (chosen->has_gl_sharing && !take_display(engine, opening, error)))
        return false;
    bool may_share = engine->display && karst_display_sharing(engine->display, sharing);
    engine->context = karst_context_open(chosen, config->lanes, may_share ? sharing : NULL, config->log, error);
    karst_opening_go_on(opening);
    return engine->context != NULL;
}

/* What follows from how light is found. */
static void settle_integrator(karst_engine_config *config)
{
    /* Paths look for the sun by rays of their own. */
    config->no_shadows |= config->integrator == KARST_INTEGRATOR_FULL;
    if (config->irradiance) { /* there is nothing to meter */
        config->exposure = KARST_EXPOSURE_GIVEN;
        config->exposure_stops = 0;
    }
}

/* Planes of shares that parts have. */
static unsigned num_shares(unsigned shade)
{
    return shade & KARST_SHADE_MIRROR ? (shade & KARST_SHADE_PASS ? 2 : 1) : 0;
}

/* What a picture's light goes by: samples, and the streams after the camera's rays. */
static bool create_streams(karst_engine *engine, const karst_engine_config *config, karst_error *error)
{
    karst_context *context = engine->context;
    const unsigned shade = engine->shade;
    const bool passes = shade & KARST_SHADE_PASS,
               has_clear = (engine->stores[KARST_CONTENT_CLEAR].store || passes) &&
                           config->integrator != KARST_INTEGRATOR_FULL,
               has_bounce = shade & KARST_SHADE_MIRROR && !has_clear;
    return (!(shade & KARST_SHADE_RADIANCE) ||
            (engine->radiance = karst_radiance_create(context, engine->shadows, num_shares(shade), error))) &&
           (!passes || (engine->pass = karst_pass_create(context, error))) &&
           (!has_clear || (engine->clear = karst_clear_create(context, engine->shadows, error))) &&
           (!has_bounce || (engine->bounce = karst_bounce_create(context, engine->shadows, error))) &&
           (!(shade & KARST_SHADE_OCCLUSION) || (engine->occlusion = karst_occlusion_create(context, error))) &&
           (!(shade & KARST_SHADE_PATHS) ||
            (engine->paths = karst_paths_create(context, shade & KARST_SHADE_THROUGH_CLEAR,
                                                karst_engine_has_path_media(engine), error))) &&
           (!config->irradiance || (engine->starts = karst_path_starts_create(context, error))) &&
           karst_engine_create_photons(engine, config, error);
}

karst_engine *karst_engine_create(const karst_engine_config *given, karst_error *error)
{
    karst_engine_config own = *given;
    const karst_engine_config *config = &own;
    if (!karst_engine_check_paths(given, error) || !karst_engine_check_caustics(given, error))
        return NULL;
    settle_integrator(&own);
    karst_engine *engine = calloc(1, sizeof *engine);
    if (!engine) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    uint32_t num_tiles = 0, num_bricks = 0;
    karst_opening *opening = karst_opening_begin(!config->in_display, config->display, config->log, error);
    if (!opening) {
        free(engine);
        return NULL;
    }
    engine->log = config->log;
    karst_engine_picture_size(config, &engine->width_px, &engine->height_px);
    engine->window = config->window;
    engine->detail_px = config->detail_px != 0 ? config->detail_px : 1.0;
    engine->budget_bricks = config->budget_bricks ? config->budget_bricks : DEFAULT_BUDGET_BRICKS;
    engine->shadows = !config->no_shadows;
    engine->mirror = config->mirror;
    engine->integrator = config->integrator;
    karst_engine_configure_media(engine, config);
    engine->samples = config->samples ? config->samples : 1;
    engine->bounces = config->bounces                              ? config->bounces
                      : config->integrator == KARST_INTEGRATOR_FULL ? KARST_ENGINE_DEFAULT_BOUNCES
                                                                    : DEFAULT_CLEAR_BOUNCES;
    engine->tone = config->tone;
    engine->exposure = config->exposure;
    engine->has_sun = config->has_sun;
    engine->sun = config->sun;
    engine->exposure_stops = config->exposure_stops;
    engine->blend = !config->no_blend;
    engine->count_changed_pixels = config->count_changed_pixels;
    engine->budget_ns = config->budget_ms * 1e6;
    karst_ladder_init(&engine->ladder);
    karst_pace_init(&engine->pace);
    karst_cost_init(&engine->cost);
    const karst_world_config world = {.world = config->world,
                                      .parameters = config->parameters,
                                      .num_parameters = config->num_parameters,
                                      .has_seed = config->has_seed,
                                      .seed = config->seed,
                                      .log = config->log};
    engine->view_distance_m = config->view_distance_m;
    engine->refine = config->refine;
    if (!karst_engine_world_open(&engine->shown, &world, config->thin, config->models, error) ||
        !karst_engine_check_size(engine->width_px, engine->height_px, error) ||
        !karst_engine_check_window(&config->window, engine->width_px, engine->height_px, error) ||
        !karst_engine_size_pools(config, karst_engine_num_contents(karst_engine_contents_of(engine->shown.file)),
                                 &num_tiles, &num_bricks, error))
        goto failed;
    if (config->brick_bits != 0 && config->brick_bits != 8 && config->brick_bits != 16 && config->brick_bits != 32) {
        karst_fail(error, KARST_USAGE, "bricks of %d bits a sample: it may be 8, 16 or 32", config->brick_bits);
        goto failed;
    }
    if (!(config->safe_steps <= 16)) {
        karst_fail(error, KARST_USAGE, "safe steps times %g: 16 is the limit", config->safe_steps);
        goto failed;
    }
    if (!(engine->detail_px >= 0.25 && engine->detail_px <= 64)) {
        karst_fail(error, KARST_USAGE, "detail %g: a voxel may be 0.25 to 64 pixels wide", engine->detail_px);
        goto failed;
    }
    if (engine->budget_bricks > MAX_BUDGET_BRICKS) {
        karst_fail(error, KARST_USAGE, "a budget of %u bricks a frame: the limit is %u", engine->budget_bricks,
                   MAX_BUDGET_BRICKS);
        goto failed;
    }
    if (!karst_engine_check_budget_ms(config->budget_ms, error) || !check_look(config, error))
        goto failed;
    engine->world = &engine->shown.file->info;
    if (!karst_engine_begin_time(engine, error))
        goto failed;
    engine->shade = karst_engine_shade_ways(config, engine->world);
    if (!karst_engine_set_view_distance(engine, engine->world, error))
        goto failed;
    engine->camera.fov_deg = 60;
    if (!karst_camera_parse(engine->world->camera, engine->world->voxel_log2_m, &engine->camera, error))
        goto failed;
    engine->view_changed = true;
    if (!open_context(engine, config, opening, error))
        goto failed;
    karst_helper_set_task(config->helper, config);
    karst_context_set_helper(engine->context, config->helper);
    engine->cache = karst_cache_create_of(engine->context, num_tiles, num_bricks, config->max_segment_bytes,
                                          config->brick_bits, error);
    if (!engine->cache)
        goto failed;
    const bool has_light_map = karst_engine_wants_light_map(config, engine->world);
    const karst_engine_wishes wishes = {engine->shade, engine->refine, engine->budget_bricks,
                                         engine->budget_ns > 0, config->edits != NULL,
                                         karst_engine_contents_of(engine->shown.file),
                                         karst_engine_wants_caustics(config, engine->world), has_light_map};
    engine->counters =
        karst_buffer_create(engine->context, "counters", KARST_ENGINE_NUM_COUNTERS * sizeof(uint32_t), NULL, error);
    char cast_options[160];
    karst_engine_cast_options(config, engine->world, cast_options, sizeof cast_options);
    engine->caster =
        karst_caster_create_with(engine->context, karst_cache_get_buffers(engine->cache), cast_options, error);
    if (!engine->caster ||
        !karst_engine_create_stores(engine, config, store_bricks(num_bricks), cast_options, error))
        goto failed;
    if (engine->shadows && !karst_engine_has_wide_sun(config) &&
        !(engine->sunward =
              karst_sunward_create(engine->context, karst_cache_get_buffers(engine->cache), error)))
        goto failed;
    if (!create_streams(engine, config, error))
        goto failed;
    if (!engine->counters || !engine->caster ||
        !karst_engine_world_build(&engine->shown, engine->context, karst_cache_get_buffers(engine->cache), &wishes,
                                  error) ||
        !take_display(engine, opening, error) || !karst_engine_allocate_picture(engine, error))
        goto failed;
    karst_opening_end(opening);
    karst_caster_set_sunward(engine->caster, engine->sunward);
    karst_engine_adopt_world(engine, &engine->shown);
    if (!karst_engine_world_set_layers(engine, &engine->shown, error) || !karst_engine_colour_layers(engine, error)) {
        karst_engine_destroy(engine);
        return NULL;
    }
    if (!config->edits || karst_engine_load_edits(engine, config->edits, error))
        return engine;
    karst_engine_destroy(engine);
    return NULL;

failed:
    karst_opening_end(opening);
    karst_engine_destroy(engine);
    return NULL;
}

void karst_engine_destroy(karst_engine *engine)
{
    if (!engine)
        return;
    if (engine->context)
        karst_finish(engine->context, NULL);
    karst_engine_free_picture(engine);
    karst_engine_world_close(&engine->shown);
    if (engine->edits)
        engine->edits->ops->destroy(engine->edits);
    karst_colours_destroy(engine->colours);
    karst_caster_destroy(engine->caster);
    karst_caster_destroy(engine->counting);
    karst_engine_destroy_streams(engine);
    karst_engine_destroy_stores(engine);
    karst_media_destroy(engine->media);
    karst_sunward_destroy(engine->sunward);
    karst_views_destroy(engine->views);
    karst_radiance_destroy(engine->radiance);
    karst_bounce_destroy(engine->bounce);
    karst_paths_destroy(engine->paths);
    karst_path_starts_destroy(engine->starts);
    karst_photons_destroy(engine->photons.photons);
    karst_clear_destroy(engine->clear);
    karst_pass_destroy(engine->pass);
    karst_occlusion_destroy(engine->occlusion);
    karst_cache_destroy(engine->cache);
    karst_buffer_destroy(engine->counters);
    free(engine->given_sums);
    karst_context_destroy(engine->context);
    if (engine->owns_display)
        karst_display_destroy(engine->display);
    free(engine);
}
