/* The engine: ties world, device, display and pools together. One frame's life stands in karst_engine_frame. */
#include "karst/engine.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/context.h"
#include "core/cost.h"
#include "core/display_platform.h"
#include "core/engine_internal.h"
#include "core/ladder.h"
#include "core/surface.h"
#include "cache/cache.h"
#include "producers/language/world_file.h"
#include "producers/producer.h"
#include "raycast/cast.h"
#include "raycast/shade.h"

#define DEFAULT_WIDTH_PX 1280
#define DEFAULT_HEIGHT_PX 720
#define MAX_SIDE_PX 16384
#define DEFAULT_POOL_BYTES ((uint64_t)512 << 20)
#define DEFAULT_BUDGET_BRICKS 4096u
#define MAX_BUDGET_BRICKS 8192u
#define MAX_BUDGET_MS 60000.0
#define DEFAULT_MAX_FRAMES 1000u
/* Fewer slots than these cannot hold even the coarsest picture: the eight root bricks, their stand-ins and the way to
 * them. */
#define MIN_TILES 32u
#define MIN_BRICKS 32u
/* A leaf tile's eight nodes hold three or four bricks, of which rays touch some; with the tiles of the way down, that
 * is one or two to a brick. */
#define TILES_PER_BRICK 3u
#define MAX_VOXEL ((int64_t)1 << 61)
#define NUM_COUNTERS 4

struct karst_engine {
    const karst_log *log;
    const karst_world_info *world;
    karst_world_file *world_file; /* NULL: a shipped world */
    karst_context *context;
    karst_display *display;
    bool owns_display;
    karst_surface *surface;
    karst_cache *cache;
    karst_producer *producer;
    karst_caster *caster;
    karst_shader *shader;
    karst_buffer *hits, *shadow_rays, *shadow_hits, *depth, *counters;

    int width_px, height_px;
    bool shadows, count_changed_pixels, reported_non_finite;
    double detail_px, view_distance_voxels;
    uint32_t budget_bricks;
    double budget_ns; /* 0: bricks only */
    karst_cost cost;

    karst_camera camera;
    bool view_changed;
    int64_t root_corner[3];
    int top_level;
    bool root_placed;

    karst_ladder ladder;
    uint32_t serial, frame;
    uint8_t *previous_pixels, *pixels; /* only with count_changed_pixels */
    bool have_previous;
    karst_stats stats;
};

/* ---- making and unmaking ---- */

static bool check_size(int width_px, int height_px, karst_error *error)
{
    if (width_px < 1 || height_px < 1 || width_px > MAX_SIDE_PX || height_px > MAX_SIDE_PX)
        return karst_fail(error, KARST_USAGE, "picture size %dx%d: each side must be 1 to %d pixels", width_px,
                          height_px, MAX_SIDE_PX);
    return true;
}

/* Slots of both pools from the configuration. */
static bool size_pools(const karst_engine_config *config, uint32_t *num_tiles, uint32_t *num_bricks, karst_error *error)
{
    uint64_t set_bytes = KARST_CACHE_BRICK_BYTES + (uint64_t)TILES_PER_BRICK * KARST_CACHE_TILE_BYTES;
    uint64_t pool_bytes = config->pool_bytes ? config->pool_bytes : DEFAULT_POOL_BYTES;
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

/* What follows the picture's size. */
static bool allocate_picture(karst_engine *engine, karst_error *error)
{
    size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    engine->surface =
        karst_surface_create(engine->context, engine->display, engine->width_px, engine->height_px, error);
    engine->hits = karst_buffer_create_blank(engine->context, "hits", num_pixels * sizeof(karst_hit), error);
    engine->depth = karst_buffer_create(engine->context, "depth", num_pixels * sizeof(float), NULL, error);
    if (!engine->surface || !engine->hits || !engine->depth)
        return false;
    if (engine->shadows) {
        engine->shadow_rays =
            karst_buffer_create_blank(engine->context, "shadow_rays", num_pixels * sizeof(karst_ray), error);
        engine->shadow_hits =
            karst_buffer_create_blank(engine->context, "shadow_hits", num_pixels * sizeof(karst_hit), error);
        if (!engine->shadow_rays || !engine->shadow_hits)
            return false;
    }
    if (engine->count_changed_pixels) {
        engine->pixels = malloc(num_pixels * 4);
        engine->previous_pixels = malloc(num_pixels * 4);
        engine->have_previous = false;
        if (!engine->pixels || !engine->previous_pixels)
            return karst_fail(error, KARST_FAILED, "out of memory for comparing pictures of %dx%d", engine->width_px,
                              engine->height_px);
    }
    return true;
}

static void free_picture(karst_engine *engine)
{
    karst_surface_destroy(engine->surface);
    karst_buffer_destroy(engine->hits);
    karst_buffer_destroy(engine->depth);
    karst_buffer_destroy(engine->shadow_rays);
    karst_buffer_destroy(engine->shadow_hits);
    free(engine->pixels);
    free(engine->previous_pixels);
    engine->surface = NULL;
    engine->hits = engine->depth = engine->shadow_rays = engine->shadow_hits = NULL;
    engine->pixels = engine->previous_pixels = NULL;
}

static const karst_world_info *find_world(const char *name, karst_error *error)
{
    const karst_world_info *world = name ? karst_world_find(name) : NULL;
    if (world)
        return world;
    char names[512] = "";
    for (size_t i = 0; karst_world_at(i); i++) {
        size_t length = strlen(names);
        snprintf(names + length, sizeof names - length, "%s%s", i ? ", " : "", karst_world_at(i)->name);
    }
    karst_fail(error, KARST_BAD_WORLD, "no world is called '%s'; there are: %s", name ? name : "", names);
    return NULL;
}

/* Hands the compiler's lines, if any, to the log. */
static void log_lines(const karst_log *log, karst_log_level level, char *lines)
{
    for (char *line = lines, *end; line && *line; line = end) {
        end = line + strcspn(line, "\n");
        if (*end)
            *end++ = 0;
        karst_log_print(log, level, "%s", line);
    }
}

static bool is_path(const char *name)
{
    size_t length = name ? strlen(name) : 0;
    return length && (strchr(name, '/') || (length > 6 && !strcmp(name + length - 6, ".karst")));
}

/* The world and, if it is a file, what it compiles to. */
static bool open_world(karst_engine *engine, const karst_engine_config *config, karst_error *error)
{
    if (!is_path(config->world)) {
        engine->world = find_world(config->world, error);
        if (engine->world && config->num_parameters)
            return karst_fail(error, KARST_USAGE, "the world %s has no parameters", config->world);
        return engine->world != NULL;
    }
    karst_parameter_value *given = calloc(config->num_parameters + 1, sizeof(*given));
    if (!given)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; i < config->num_parameters; i++)
        given[i] = (karst_parameter_value){config->parameters[i].name, config->parameters[i].value};
    char *diagnostics = NULL;
    engine->world_file = karst_world_file_open(config->world, given, config->num_parameters, &diagnostics, error);
    log_lines(engine->log, KARST_LOG_WARNING, diagnostics);
    free(diagnostics);
    free(given);
    engine->world = engine->world_file ? &engine->world_file->info : NULL;
    return engine->world != NULL;
}

/* After the producer, whose data a world's colours read. */
static karst_shader *create_shader(karst_engine *engine, karst_error *error)
{
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    if (!engine->world_file || !engine->world_file->code.colour_source)
        return karst_shader_create(engine->context, buffers, engine->shadows, error);
    karst_shade_colour colour = {.source = engine->world_file->code.colour_source,
                                 .options = "-DWORLD_HAS_DATA",
                                 .data = engine->producer->data[0]};
    return karst_shader_create_coloured(engine->context, buffers, engine->shadows, &colour, error);
}

static karst_producer *create_producer(karst_engine *engine, uint32_t seed, karst_error *error)
{
    if (engine->world_file)
        return karst_world_file_producer(engine->context, engine->world_file, seed, engine->budget_bricks, error);
    return karst_density_producer_create(engine->context, engine->world, seed, engine->budget_bricks, error);
}

karst_engine *karst_engine_create(const karst_engine_config *config, karst_error *error)
{
    karst_engine *engine = calloc(1, sizeof *engine);
    if (!engine) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    uint32_t num_tiles = 0, num_bricks = 0;
    engine->log = config->log;
    engine->width_px = config->width_px || config->height_px ? config->width_px : DEFAULT_WIDTH_PX;
    engine->height_px = config->width_px || config->height_px ? config->height_px : DEFAULT_HEIGHT_PX;
    engine->detail_px = config->detail_px != 0 ? config->detail_px : 1.0;
    engine->budget_bricks = config->budget_bricks ? config->budget_bricks : DEFAULT_BUDGET_BRICKS;
    engine->shadows = !config->no_shadows;
    engine->count_changed_pixels = config->count_changed_pixels;
    engine->budget_ns = config->budget_ms * 1e6;
    karst_ladder_init(&engine->ladder);
    karst_cost_init(&engine->cost);

    if (!open_world(engine, config, error) || !check_size(engine->width_px, engine->height_px, error) ||
        !size_pools(config, &num_tiles, &num_bricks, error))
        goto failed;
    if (!(engine->detail_px >= 0.25 && engine->detail_px <= 64)) {
        karst_fail(error, KARST_USAGE, "detail %g: a voxel may be 0.25 to 64 pixels wide", engine->detail_px);
        goto failed;
    }
    if (engine->budget_bricks > MAX_BUDGET_BRICKS) {
        karst_fail(error, KARST_USAGE, "a budget of %u bricks a frame: the limit is %u", engine->budget_bricks,
                   MAX_BUDGET_BRICKS);
        goto failed;
    }
    if (!(config->budget_ms >= 0 && config->budget_ms <= MAX_BUDGET_MS)) {
        karst_fail(error, KARST_USAGE, "a budget of %g ms a frame: it may be 0 (count bricks only) to %g",
                   config->budget_ms, MAX_BUDGET_MS);
        goto failed;
    }
    double view_distance_m = config->view_distance_m != 0 ? config->view_distance_m : engine->world->view_distance_m;
    engine->view_distance_voxels = view_distance_m / exp2(engine->world->voxel_log2_m);
    if (!(engine->view_distance_voxels >= 16 && engine->view_distance_voxels <= 0x1p56)) {
        karst_fail(error, KARST_USAGE, "a view distance of %g m: this world's goes from %g to %g", view_distance_m,
                   16 * exp2(engine->world->voxel_log2_m), exp2(56 + engine->world->voxel_log2_m));
        goto failed;
    }
    engine->camera.fov_deg = 60;
    if (!karst_camera_parse(engine->world->camera, engine->world->voxel_log2_m, &engine->camera, error))
        goto failed;
    engine->view_changed = true;

    /* The display first: a device that can share memory with its OpenGL must be opened for that. */
    engine->owns_display = !config->in_display;
    engine->display =
        config->in_display ? config->in_display : karst_display_create(config->display, config->log, error);
    if (!engine->display)
        goto failed;
    cl_context_properties sharing[KARST_SHARING_PROPERTIES];
    bool may_share = karst_display_sharing(engine->display, sharing);
    engine->context =
        karst_context_create_sharing(config->device, config->lanes, may_share ? sharing : NULL, config->log, error);
    if (!engine->context)
        goto failed;
    engine->cache = karst_cache_create(engine->context, num_tiles, num_bricks, config->max_segment_bytes, error);
    if (!engine->cache || !allocate_picture(engine, error))
        goto failed;
    engine->counters = karst_buffer_create(engine->context, "counters", NUM_COUNTERS * sizeof(uint32_t), NULL, error);
    engine->producer = create_producer(engine, config->has_seed ? config->seed : engine->world->seed, error);
    engine->caster = karst_caster_create(engine->context, karst_cache_get_buffers(engine->cache), error);
    if (engine->producer)
        engine->shader = create_shader(engine, error);
    if (!engine->counters || !engine->producer || !engine->caster || !engine->shader)
        goto failed;
    return engine;

failed:
    karst_engine_destroy(engine);
    return NULL;
}

void karst_engine_destroy(karst_engine *engine)
{
    if (!engine)
        return;
    if (engine->context)
        karst_finish(engine->context, NULL);
    free_picture(engine);
    karst_shader_destroy(engine->shader);
    karst_caster_destroy(engine->caster);
    karst_producer_destroy(engine->producer);
    karst_world_file_destroy(engine->world_file);
    karst_cache_destroy(engine->cache);
    karst_buffer_destroy(engine->counters);
    karst_context_destroy(engine->context);
    if (engine->owns_display)
        karst_display_destroy(engine->display);
    free(engine);
}

/* ---- what the caller sets and asks ---- */

int karst_engine_voxel_log2_m(const karst_engine *engine) { return engine->world->voxel_log2_m; }
karst_camera karst_engine_camera(const karst_engine *engine) { return engine->camera; }

karst_camera karst_engine_default_camera(const karst_engine *engine)
{
    karst_camera camera = {.fov_deg = 60};
    karst_camera_parse(engine->world->camera, engine->world->voxel_log2_m, &camera, NULL);
    return camera;
}

bool karst_engine_set_camera(karst_engine *engine, const karst_camera *camera, karst_error *error)
{
    if (!isfinite(camera->yaw_deg) || !isfinite(camera->pitch_deg) ||
        !(camera->fov_deg >= 0.0001 && camera->fov_deg <= 179))
        return karst_fail(error, KARST_USAGE,
                          "camera: angles must be finite and the field of view 0.0001 to 179 degrees");
    for (int axis = 0; axis < 3; axis++)
        if (camera->position.voxel[axis] > MAX_VOXEL || camera->position.voxel[axis] < -MAX_VOXEL)
            return karst_fail(error, KARST_USAGE, "camera: %c lies beyond 2^61 voxels of %g m", "xyz"[axis],
                              exp2(engine->world->voxel_log2_m));
    if (memcmp(&engine->camera, camera, sizeof *camera) != 0)
        engine->view_changed = true;
    engine->camera = *camera;
    return true;
}

bool karst_engine_set_size(karst_engine *engine, int width_px, int height_px, karst_error *error)
{
    if (!check_size(width_px, height_px, error))
        return false;
    if (width_px == engine->width_px && height_px == engine->height_px)
        return true;
    free_picture(engine);
    engine->width_px = width_px;
    engine->height_px = height_px;
    engine->view_changed = true;
    return allocate_picture(engine, error);
}

void karst_engine_start_counting_at(karst_engine *engine, uint32_t serial, uint32_t frame)
{
    engine->serial = serial;
    engine->frame = frame;
}

void karst_engine_stats(const karst_engine *engine, karst_stats *stats) { *stats = engine->stats; }
bool karst_engine_check(karst_engine *engine, karst_error *error) { return karst_cache_check(engine->cache, error); }

const char *karst_world_name(size_t index)
{
    const karst_world_info *world = karst_world_at(index);
    return world ? world->name : NULL;
}

const char *karst_world_description(const char *name)
{
    const karst_world_info *world = karst_world_find(name);
    return world ? world->description : NULL;
}

/* ---- a frame ---- */

static int64_t floor_shift(int64_t value, int shift) { return shift > 62 ? (value < 0 ? -1 : 0) : value >> shift; }

/* Keeps the camera at least a quarter of a root node away from the root window's faces, so that every ray ends at its
 * own t_max: a root node is at least four view distances wide. The window moves only when it must, not at each step
 * across a middle line. */
static bool place_root(karst_engine *engine, karst_error *error)
{
    int top_level = 0;
    while (ldexp(KARST_BRICK_CELLS, top_level) < 4 * engine->view_distance_voxels)
        top_level++;
    int quarter_log2 = top_level + KARST_BRICK_CELLS_LOG2 - 2;
    bool inside = engine->root_placed && top_level == engine->top_level;
    int64_t corner[3];
    for (int axis = 0; axis < 3; axis++) {
        int64_t quarter = floor_shift(engine->camera.position.voxel[axis], quarter_log2);
        int64_t offset = quarter - 4 * engine->root_corner[axis];
        inside = inside && offset >= 1 && offset <= 6;
        corner[axis] = (quarter - 2) >> 2;
    }
    if (inside)
        return true;
    memcpy(engine->root_corner, corner, sizeof corner);
    engine->top_level = top_level;
    engine->root_placed = true;
    return karst_cache_place_root(engine->cache, corner, top_level, error);
}

static void set3(float out[4], const double in[3])
{
    for (int axis = 0; axis < 3; axis++)
        out[axis] = (float)in[axis];
    out[3] = 0;
}

static karst_pinhole make_pinhole(const karst_engine *engine)
{
    karst_pinhole pinhole = {.width_px = engine->width_px, .height_px = engine->height_px};
    double right[3], up[3], forward[3];
    karst_camera_axes(&engine->camera, right, up, forward);
    set3(pinhole.right, right);
    set3(pinhole.up, up);
    set3(pinhole.forward, forward);
    double half_height = tan(engine->camera.fov_deg * (M_PI / 360));
    pinhole.half_height = (float)half_height;
    pinhole.half_width = (float)(half_height * engine->width_px / engine->height_px);
    pinhole.t_max = (float)engine->view_distance_voxels;
    pinhole.cone = (float)(2 * half_height / engine->height_px);
    return pinhole;
}

static karst_light make_light(const karst_engine *engine)
{
    const karst_world_info *world = engine->world;
    double azimuth = world->sun_azimuth_deg * (M_PI / 180), elevation = world->sun_elevation_deg * (M_PI / 180);
    double voxel_m = exp2(world->voxel_log2_m);
    karst_light light = {.haze_distance = (float)(world->haze_distance_m / voxel_m),
                         .shadow_distance = (float)engine->view_distance_voxels};
    set3(light.sun_direction,
         (double[3]){sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation)});
    /* Air scatters blue out of low sunlight: from orange at the horizon to a warm white overhead. */
    double height = fmin(1, fmax(0, sin(elevation)) / 0.6);
    set3(light.sun_colour, (double[3]){2.4, 1.5 + 0.7 * height, 0.85 + 1.1 * height});
    memcpy(light.sky_zenith, world->sky_zenith, sizeof world->sky_zenith);
    memcpy(light.sky_horizon, world->sky_horizon, sizeof world->sky_horizon);
    memcpy(light.ground_flat, world->ground_flat, sizeof world->ground_flat);
    memcpy(light.ground_steep, world->ground_steep, sizeof world->ground_steep);
    return light;
}

/* Cast and shade into the display. */
static bool draw(karst_engine *engine, karst_error *error)
{
    karst_cast_view view;
    karst_cast_view_init(&view, &engine->camera.position, engine->root_corner, engine->top_level);
    view.serial = engine->serial;
    view.detail = (float)(engine->detail_px * karst_ladder_factor(&engine->ladder));
    karst_pinhole pinhole = make_pinhole(engine);
    karst_light light = make_light(engine);
    karst_shader_set_anchor(engine->shader, &engine->camera.position);
    uint32_t num_pixels = (uint32_t)engine->width_px * (uint32_t)engine->height_px;

    if (!karst_cast_pinhole(engine->caster, &view, &pinhole, engine->hits, error))
        return false;
    if (engine->shadows &&
        (!karst_shade_make_shadow_rays(engine->shader, &view, &pinhole, &light, engine->hits, engine->shadow_rays,
                                       error) ||
         !karst_cast_rays(engine->caster, &view, engine->shadow_rays, num_pixels, true, engine->shadow_hits, error)))
        return false;
    if (!karst_buffer_fill(engine->counters, 0, 0, NUM_COUNTERS * sizeof(uint32_t), error))
        return false;
    cl_mem pixels = karst_surface_begin(engine->surface, error);
    if (!pixels)
        return false;
    bool shaded = karst_shade_pixels(engine->shader, &view, &pinhole, &light, engine->hits,
                                     engine->shadows ? engine->shadow_hits : NULL, pixels, engine->depth,
                                     engine->counters, error);
    /* The surface is mapped: end it even if shading failed. */
    return karst_surface_end(engine->surface, shaded ? error : NULL) && shaded;
}

/* Collect, produce, publish. */
static bool answer_requests(karst_engine *engine, karst_work *work, karst_error *error)
{
    karst_stats *stats = &engine->stats;
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    karst_collect_params params = {.serial = engine->serial,
                                   .frame = engine->frame,
                                   .camera = engine->camera.position,
                                   .max_tiles = engine->budget_bricks,
                                   .max_bricks = engine->budget_bricks,
                                   .may_drop_fallback = true};
    if (engine->budget_ns > 0) {
        karst_cost_limits limits = karst_cost_plan(&engine->cost, engine->budget_ns, engine->budget_bricks);
        params.max_tiles = limits.max_tiles;
        params.max_bricks = limits.max_bricks;
    }
    if (!karst_cache_collect(engine->cache, &params, work, error))
        return false;
    if (!karst_producer_answer(engine->producer, buffers, work, error))
        return false;
    uint32_t num_linked = 0, num_constant = 0;
    if ((work->num_loads || work->num_subdivides) &&
        !karst_cache_publish(engine->cache, work, &num_linked, &num_constant, error))
        return false;

    stats->num_requests = work->num_requests;
    stats->num_produced = work->num_loads + work->num_subdivides;
    stats->num_evicted = work->num_evicted_tiles + work->num_evicted_bricks;
    stats->num_reproduced = work->num_reproduced;
    stats->num_deferred = work->num_deferred_budget + work->num_starved_bricks + work->num_starved_tiles;
    stats->num_tiles_produced = work->num_subdivides;
    stats->num_bricks_produced = work->num_loads;
    stats->num_bricks_constant = num_constant;
    stats->tiles.num_used = work->num_used_tiles;
    stats->bricks.num_used = work->num_used_bricks;
    return true;
}

static void learn_cost(karst_engine *engine)
{
    const karst_stats *stats = &engine->stats;
    karst_cost_round round = {
        .num_bricks = (uint32_t)stats->num_bricks_produced,
        .num_tiles = (uint32_t)stats->num_tiles_produced,
        .brick_ns = stats->time_ns[KARST_STAGE_EVALUATE] + stats->time_ns[KARST_STAGE_FINALISE],
        .tile_ns = stats->time_ns[KARST_STAGE_SUBDIVIDE],
    };
    karst_cost_learn(&engine->cost, &round);
}

/* The next rung of detail, from what this round could and could not do. */
static bool step_ladder(karst_engine *engine, const karst_work *work)
{
    const karst_stats *stats = &engine->stats;
    bool tiles_fuller =
        stats->tiles.num_used * stats->bricks.num_total > stats->bricks.num_used * stats->tiles.num_total;
    karst_ladder_round round = {
        .num_used = tiles_fuller ? stats->tiles.num_used : stats->bricks.num_used,
        .num_total = tiles_fuller ? stats->tiles.num_total : stats->bricks.num_total,
        .num_starved = work->num_starved_bricks + work->num_starved_tiles,
        .num_requests = work->num_requests,
        .num_produced = stats->num_produced,
    };
    return karst_ladder_step(&engine->ladder, &round);
}

static bool count_changed_pixels(karst_engine *engine, karst_error *error)
{
    size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (!karst_surface_read(engine->surface, engine->pixels, num_pixels * 4, error))
        return false;
    uint64_t num_changed = 0;
    for (size_t i = 0; engine->have_previous && i < num_pixels; i++)
        num_changed += memcmp(engine->pixels + 4 * i, engine->previous_pixels + 4 * i, 4) != 0;
    engine->stats.num_changed_pixels = engine->have_previous ? num_changed : num_pixels;
    engine->have_previous = true;
    uint8_t *swap = engine->pixels;
    engine->pixels = engine->previous_pixels;
    engine->previous_pixels = swap;
    return true;
}

static bool fill_pool_stats(karst_engine *engine, karst_error *error)
{
    karst_stats *stats = &engine->stats;
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    uint32_t num_tiles, num_bricks;
    if (!karst_cache_count_resident(engine->cache, &num_tiles, &num_bricks, error))
        return false;
    stats->num_resident_tiles = num_tiles;
    stats->num_resident_bricks = num_bricks;
    stats->tiles.num_total = buffers->num_tiles - 1;
    stats->bricks.num_total = buffers->num_bricks - 1;
    stats->tiles.size_bytes = buffers->nodes->size_bytes + buffers->tile_info->size_bytes;
    stats->bricks.size_bytes = buffers->brick_info->size_bytes + buffers->brick_owner->size_bytes;
    for (uint32_t segment = 0; segment < buffers->num_segments; segment++)
        stats->bricks.size_bytes += buffers->bricks[segment]->size_bytes;
    return true;
}

bool karst_engine_frame(karst_engine *engine, karst_error *error)
{
    uint64_t start_ns = karst_clock_ns();
    karst_stats *stats = &engine->stats;
    uint32_t counters[NUM_COUNTERS];
    karst_work work;

    if (!engine->surface)
        return karst_fail(error, KARST_FAILED, "this engine lost its picture memory; set a size that fits");
    *stats = (karst_stats){0};
    snprintf(stats->device, sizeof stats->device, "%s", engine->context->name);
    /* 0 means none in both: they wrap around to 1. */
    if (++engine->frame == 0)
        engine->frame = 1;
    if (++engine->serial == 0)
        engine->serial = 1;
    stats->frame = engine->frame;
    if (engine->view_changed)
        karst_ladder_view_changed(&engine->ladder);
    engine->view_changed = false;
    stats->detail_asked_px = engine->detail_px;
    stats->detail_given_px = engine->detail_px * karst_ladder_factor(&engine->ladder);

    if (!place_root(engine, error) || !draw(engine, error) ||
        !karst_buffer_read(engine->counters, 0, counters, sizeof counters, error) ||
        !answer_requests(engine, &work, error) || !fill_pool_stats(engine, error))
        return false;
    stats->num_pixels = (uint64_t)engine->width_px * (uint64_t)engine->height_px;
    stats->num_hits = counters[0];
    stats->num_provisional = counters[1];
    stats->num_incomplete = counters[2];

    bool rung_moved = step_ladder(engine, &work);
    stats->settled = work.num_requests == 0 && stats->num_produced == 0 && stats->num_evicted == 0 && !rung_moved &&
                     karst_ladder_at_rest(&engine->ladder);
    stats->num_non_finite = karst_density_producer_non_finite(engine->producer);
    if (stats->num_non_finite && !engine->reported_non_finite)
        karst_log_print(engine->log, KARST_LOG_WARNING, "%s: densities that are not finite were taken as air",
                        engine->world->name);
    engine->reported_non_finite = stats->num_non_finite != 0;

    if (!karst_profile_collect(engine->context, stats->time_ns, error))
        return false;
    learn_cost(engine);
    stats->time_ns_frame = karst_clock_ns() - start_ns;
    karst_context_memory(engine->context, stats);
    return !engine->count_changed_pixels || count_changed_pixels(engine, error);
}

bool karst_engine_settle(karst_engine *engine, uint32_t max_frames,
                         bool (*progress)(void *user, const karst_stats *stats), void *user, bool *settled,
                         karst_error *error)
{
    if (max_frames == 0)
        max_frames = DEFAULT_MAX_FRAMES;
    *settled = false;
    for (uint32_t frame = 0; frame < max_frames && !*settled; frame++) {
        if (!karst_engine_frame(engine, error))
            return false;
        *settled = engine->stats.settled;
        if (progress && !progress(user, &engine->stats))
            break;
    }
    return true;
}

/* ---- reading the picture ---- */

bool karst_engine_read_pixels(karst_engine *engine, uint8_t *rgba, size_t size_bytes, karst_error *error)
{
    if (!engine->surface || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    return karst_surface_read(engine->surface, rgba, size_bytes, error);
}

bool karst_engine_read_depth(karst_engine *engine, float *depth_m, size_t num_values, karst_error *error)
{
    size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if (num_values < num_pixels)
        return karst_fail(error, KARST_USAGE, "depth of %dx%d needs %zu values, not %zu", engine->width_px,
                          engine->height_px, num_pixels, num_values);
    if (!engine->depth || !karst_buffer_read(engine->depth, 0, depth_m, num_pixels * sizeof(float), error))
        return karst_fail(error, KARST_FAILED, "the depth buffer could not be read");
    float voxel_m = exp2f((float)engine->world->voxel_log2_m);
    for (size_t i = 0; i < num_pixels; i++)
        depth_m[i] *= voxel_m;
    return true;
}
