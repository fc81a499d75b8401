/* What a helper process does: it runs the kernels that an engine will need once each, on next to nothing, so that the
 * driver compiles them into its store. In another order than the engine itself: that one begins with its pools, the
 * cast and bounds, and ends with what follows the first cast, of which this does the last first. */
#include <stdlib.h>
#include <unistd.h>

#include "core/engine/engine_parts.h"
#include "core/device/helper.h"
#include "raycast/light/light.h"
#include "raycast/cast/pinhole.h"

/* A root tile, and what a load may write to; and a cache, as small as any. */
enum { AHEAD_TILES = 4, AHEAD_BRICKS = 4, AHEAD_SLOTS = 16 };

typedef struct {
    const karst_engine_config *config;
    karst_engine_world world;
    karst_context *context;
    karst_cache_buffers cache;
    karst_work work;
    karst_buffer *hits, *shadow_rays, *depth, *counters, *pixels;
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_light light;
} ahead;

static bool make(ahead *a, karst_buffer **buffer, size_t size_bytes, karst_error *error)
{
    *buffer = karst_buffer_create(a->context, "ahead", size_bytes, NULL, error);
    return *buffer != NULL;
}

/* Pools of a few slots, in as many segments as the engine's: kernels are compiled for that number. */
static bool make_pools(ahead *a, karst_error *error)
{
    karst_cache_buffers *b = &a->cache;
    uint32_t num_tiles, num_bricks;
    if (!karst_engine_size_pools(a->config, karst_engine_num_contents(karst_engine_contents_of(a->world.file)),
                                 &num_tiles, &num_bricks, error))
        return false;
    b->brick_bits = a->config->brick_bits ? a->config->brick_bits : 16;
    b->num_segments = (uint32_t)karst_cache_num_segments(a->context, num_bricks, a->config->max_segment_bytes,
                                                         b->brick_bits);
    b->num_tiles = AHEAD_TILES;
    b->num_bricks = b->bricks_per_segment = AHEAD_BRICKS;
    size_t num_nodes = AHEAD_TILES * KARST_TILE_NODES;
    if (!make(a, &b->bricks[0], (size_t)AHEAD_BRICKS * KARST_BRICK_STRIDE * sizeof(float), error) ||
        !make(a, &b->nodes, num_nodes * sizeof(karst_node), error) ||
        !make(a, &b->tile_info, AHEAD_TILES * sizeof(karst_tile_info), error) ||
        !make(a, &b->brick_info, AHEAD_BRICKS * sizeof(karst_brick_info), error) ||
        !make(a, &b->brick_owner, AHEAD_BRICKS * sizeof(karst_brick_owner), error) ||
        !make(a, &b->tile_stamp, AHEAD_TILES * sizeof(uint32_t), error) ||
        !make(a, &b->brick_stamp, AHEAD_BRICKS * sizeof(uint32_t), error) ||
        !make(a, &b->brick_fallback, AHEAD_BRICKS * sizeof(uint32_t), error) ||
        !make(a, &b->want_brick, num_nodes * sizeof(uint32_t), error) ||
        !make(a, &b->want_children, num_nodes * sizeof(uint32_t), error) ||
        !make(a, &b->want_chunk, sizeof(uint32_t), error) ||
        !make(a, &b->want_rays, num_nodes * sizeof(uint32_t), error) ||
        !make(a, &a->work.load_nodes, sizeof(uint32_t), error) ||
        !make(a, &a->work.load_slots, sizeof(uint32_t), error) ||
        !make(a, &a->work.load_results, sizeof(uint32_t), error))
        return false;
    for (int i = 1; i < KARST_MAX_BRICK_SEGMENTS; i++)
        b->bricks[i] = b->bricks[0];
    const uint32_t slot = 1;
    karst_node air[AHEAD_TILES * KARST_TILE_NODES];
    for (size_t i = 0; i < num_nodes; i++)
        air[i] = (karst_node){.link = KARST_NODE_LINK(KARST_STATE_AIR, KARST_NONE), .brick = KARST_NONE};
    return karst_buffer_write(b->nodes, 0, air, sizeof air, error) &&
           karst_buffer_write(a->work.load_slots, 0, &slot, sizeof slot, error);
}

/* A picture of the engine's size, of which nothing is hit: PoCL compiles a kernel apart for large grids. */
static bool make_picture(ahead *a, karst_error *error)
{
    const karst_position origin = {{0}, {0}};
    const int64_t corner[3] = {-1, -1, -1};
    karst_camera camera = {.fov_deg = 60};
    int width_px, height_px;
    karst_engine_picture_size(a->config, &width_px, &height_px);
    size_t num_px = (size_t)width_px * (size_t)height_px;
    const bool radiance = karst_engine_shade_ways(a->config, &a->world.file->info) & KARST_SHADE_RADIANCE;
    const size_t depth_floats = radiance ? KARST_RADIANCE_PASS_PLANE + 1 : 1;
    karst_cast_view_init(&a->view, &origin, corner, 8);
    a->view.serial = 1;
    karst_pinhole_init(&a->pinhole, &camera, width_px, height_px, 16);
    a->light = (karst_light){.sun_direction = {0, 1, 0, 0}, .haze_distance = 1, .shadow_distance = 1};
    return make(a, &a->hits, num_px * sizeof(karst_hit), error) &&
           make(a, &a->shadow_rays, karst_cast_shadow_bytes(width_px, height_px), error) &&
           make(a, &a->depth, depth_floats * num_px * sizeof(float), error) &&
           make(a, &a->pixels, num_px * 4, error) &&
           make(a, &a->counters, KARST_ENGINE_NUM_COUNTERS * sizeof(uint32_t), error);
}

static bool compile_production(ahead *a, karst_error *error)
{
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO,
                                     .finalise_options = karst_cache_brick_option(&a->cache)};
    return karst_world_file_rehearse(a->context, a->world.file, a->world.seed, &build, &a->cache, &a->work, error);
}

static bool compile_shading(ahead *a, karst_error *error)
{
    const bool shadows = !a->config->no_shadows;
    const unsigned ways = karst_engine_shade_ways(a->config, &a->world.file->info);
    const karst_position origin = {{0}, {0}};
    if (a->world.file->layout.has_mapped) /* it would take a copy of files */
        return true;
    void *data = karst_world_file_data(a->world.file, a->world.seed, error);
    size_t data_bytes = a->world.file->data_bytes;
    karst_buffer *buffer = data ? karst_buffer_create(a->context, "ahead", data_bytes, data, error) : NULL;
    karst_world_file_free_data(a->world.file, data);
    karst_shader *shader =
        buffer ? karst_engine_world_shader(&a->world, a->context, ways, buffer, error) : NULL;
    if (shader)
        karst_shader_set_anchor(shader, &origin);
    bool done = shader && karst_shade_pixels(shader, &a->view, &a->pinhole, &a->light, a->hits,
                                             shadows ? a->shadow_rays : NULL, a->pixels->mem, a->depth, a->counters,
                                             error);
    done = karst_finish(a->context, error) && done;
    karst_shader_destroy(shader);
    karst_buffer_destroy(buffer);
    return done;
}

static bool compile_cast(ahead *a, karst_error *error)
{
    char options[160];
    const bool one_sun = !a->config->no_shadows && !karst_engine_has_wide_sun(a->config);
    karst_engine_cast_options(a->config, &a->world.file->info, options, sizeof options);
    karst_caster *caster = karst_caster_create_with(a->context, &a->cache, options, error);
    karst_sunward *sunward = caster && one_sun ? karst_sunward_create(a->context, &a->cache, error) : NULL;
    bool done = caster && (!one_sun || sunward) &&
                (!sunward || karst_sunward_aim(sunward, a->light.sun_direction, error)) &&
                (a->config->no_shadows || karst_cast_shadows(caster, &a->view, &a->pinhole, &a->light, a->shadow_rays,
                                                             a->pixels->mem, error)) &&
                karst_cast_pinhole(caster, &a->view, &a->pinhole, a->hits, error) && karst_finish(a->context, error);
    karst_sunward_destroy(sunward);
    karst_caster_destroy(caster);
    return done;
}

static bool compile_radiance(ahead *a, karst_error *error)
{
    const size_t num_px = (size_t)a->pinhole.width_px * (size_t)a->pinhole.height_px;
    const karst_radiance_look look = {.tone = KARST_TONE_FILMIC};
    if (!(karst_engine_shade_ways(a->config, &a->world.file->info) & KARST_SHADE_RADIANCE))
        return true;
    karst_radiance *radiance = karst_radiance_create(a->context, !a->config->no_shadows, false, error);
    bool done = radiance && karst_radiance_set_room(radiance, num_px, error) &&
                karst_radiance_show(radiance, a->pinhole.width_px, a->pinhole.height_px, 0, true, &look,
                                    a->pixels->mem, error) &&
                karst_radiance_add(radiance, a->pinhole.width_px, a->pinhole.height_px, 0, error) &&
                karst_finish(a->context, error);
    karst_radiance_destroy(radiance);
    return done;
}

/* The little ones: whoever waits for the cast finds them done afterwards. */
static bool compile_cache(ahead *a, karst_error *error)
{
    karst_cache *cache = karst_cache_create_of(a->context, AHEAD_SLOTS, AHEAD_SLOTS, 0, a->config->brick_bits, error);
    bool done = cache && karst_cache_rehearse(cache, error);
    karst_cache_destroy(cache);
    return done;
}

bool karst_engine_compile_ahead(const karst_engine_config *config, karst_error *error)
{
    const karst_world_config world = {.world = config->world,
                                      .parameters = config->parameters,
                                      .num_parameters = config->num_parameters,
                                      .has_seed = config->has_seed,
                                      .seed = config->seed};
    ahead a = {.config = config};
    bool done = karst_engine_world_open(&a.world, &world, a.config->thin, a.config->models, error) &&
                (a.context = karst_context_create(config->device, config->lanes, NULL, error));
    if (done)
        karst_context_set_helper(a.context, config->helper);
    return done && make_pools(&a, error) && compile_production(&a, error) && make_picture(&a, error) &&
           compile_shading(&a, error) && compile_cast(&a, error) &&
           compile_radiance(&a, error) && compile_cache(&a, error);
}

int karst_helper_run(void)
{
    karst_engine_config config;
    karst_error error = {0};
    bool done = karst_helper_attach(&config) && karst_engine_compile_ahead(&config, &error);
    /* Nothing is worth being tidied up. */
    _exit(done ? KARST_OK : KARST_FAILED);
}
