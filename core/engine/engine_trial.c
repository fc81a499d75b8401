/* A trial run of a world that is not shown yet, so that showing it takes no time. */
#include "core/engine/engine_parts.h"
#include "karst/change.h"

/* What a trial run works on: a tile, a brick and a picture of a few pixels. */
enum { TRIAL_TILES = 4, TRIAL_BRICKS = 16, TRIAL_SIDE_PX = 16, TRIAL_PX = TRIAL_SIDE_PX * TRIAL_SIDE_PX };

typedef struct {
    karst_context *context;
    karst_cache_buffers cache;
    karst_work work;
    karst_buffer *hits, *shadow_rays, *depth, *counters, *pixels;
} trial;

static bool trial_buffer(trial *t, karst_buffer **buffer, size_t size_bytes, karst_error *error)
{
    *buffer = karst_buffer_create(t->context, "trial", size_bytes, NULL, error);
    return *buffer != NULL;
}

static bool trial_open(trial *t, karst_context *of, int brick_bits, karst_error *error)
{
    karst_cache_buffers *cache = &t->cache;
    *t = (trial){.context = karst_context_fork(of, error)};
    *cache = (karst_cache_buffers){.num_tiles = TRIAL_TILES,
                                   .num_bricks = TRIAL_BRICKS,
                                   .num_segments = 1,
                                   .bricks_per_segment = TRIAL_BRICKS,
                                   .brick_bits = brick_bits};
    if (!t->context || !trial_buffer(t, &cache->nodes, TRIAL_TILES * KARST_TILE_NODES * sizeof(karst_node), error) ||
        !trial_buffer(t, &cache->tile_info, TRIAL_TILES * sizeof(karst_tile_info), error) ||
        !trial_buffer(t, &cache->bricks[0], (size_t)TRIAL_BRICKS * KARST_BRICK_STRIDE * sizeof(float), error) ||
        !trial_buffer(t, &cache->brick_info, TRIAL_BRICKS * sizeof(karst_brick_info), error) ||
        !trial_buffer(t, &cache->brick_owner, TRIAL_BRICKS * sizeof(karst_brick_owner), error) ||
        !trial_buffer(t, &t->work.load_nodes, sizeof(uint32_t), error) ||
        !trial_buffer(t, &t->work.load_slots, sizeof(uint32_t), error) ||
        !trial_buffer(t, &t->work.load_results, sizeof(uint32_t), error) ||
        !trial_buffer(t, &t->work.subdivide_nodes, sizeof(uint32_t), error) ||
        !trial_buffer(t, &t->work.subdivide_tiles, sizeof(uint32_t), error) ||
        !trial_buffer(t, &t->hits, TRIAL_PX * sizeof(karst_hit), error) ||
        !trial_buffer(t, &t->shadow_rays, karst_cast_shadow_bytes(TRIAL_SIDE_PX, TRIAL_SIDE_PX), error) ||
        !trial_buffer(t, &t->depth, (KARST_RADIANCE_PASS_PLANE + 1) * TRIAL_PX * sizeof(float), error) ||
        !trial_buffer(t, &t->counters, KARST_ENGINE_NUM_COUNTERS * sizeof(uint32_t), error) ||
        !trial_buffer(t, &t->pixels, TRIAL_PX * 4, error))
        return false;
    for (int i = 1; i < KARST_MAX_BRICK_SEGMENTS; i++)
        cache->bricks[i] = cache->bricks[0];
    return true;
}

static void trial_close(trial *t)
{
    karst_buffer *buffers[] = {t->cache.nodes,
                               t->cache.tile_info,
                               t->cache.bricks[0],
                               t->cache.brick_info,
                               t->cache.brick_owner,
                               t->work.load_nodes,
                               t->work.load_slots,
                               t->work.load_results,
                               t->work.subdivide_nodes,
                               t->work.subdivide_tiles,
                               t->hits,
                               t->shadow_rays,
                               t->depth,
                               t->counters,
                               t->pixels};
    if (t->context)
        karst_finish(t->context, NULL);
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    karst_context_destroy(t->context);
}

/* A picture of misses is shaded: drivers compile some of a kernel when it runs for the first time. */
static bool trial_shade(trial *t, karst_shader *shader, bool shadows, karst_error *error)
{
    const karst_position origin = {{0}, {0}};
    const int64_t corner[3] = {-1, -1, -1};
    karst_cast_view view;
    karst_pinhole pinhole = {.width_px = TRIAL_SIDE_PX, .height_px = TRIAL_SIDE_PX};
    karst_light light = {.sun_direction = {0, 1, 0, 0}, .haze_distance = 1, .shadow_distance = 1};
    karst_cast_view_init(&view, &origin, corner, 8);
    view.serial = 1;
    view.detail = 1;
    karst_shader_set_anchor(shader, &origin);
    return karst_shade_pixels(shader, &view, &pinhole, &light, t->hits, shadows ? t->shadow_rays : NULL, t->pixels->mem,
                              t->depth, t->counters, error) &&
           karst_finish(t->context, error);
}

static bool trial_contents(trial *t, const karst_engine_world *world, karst_error *error)
{
    bool done = true;
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        done = done && (!world->content[i].producer ||
                        karst_producer_answer(world->content[i].producer, &t->cache, &t->work, error));
    return done;
}

/* The same for all of a world: one node is loaded and subdivided, too. */
static bool trial_run(trial *t, const karst_engine_world *world, bool shadows, karst_error *error)
{
    const karst_tile_info info = {.level = 4, .in_use = 1};
    const uint32_t node = KARST_TILE_NODES, slot = 1, tile = 2;
    t->work.num_loads = t->work.num_subdivides = 1;
    return karst_buffer_write(t->cache.tile_info, sizeof info, &info, sizeof info, error) &&
           karst_buffer_write(t->work.load_nodes, 0, &node, sizeof node, error) &&
           karst_buffer_write(t->work.load_slots, 0, &slot, sizeof slot, error) &&
           karst_buffer_write(t->work.subdivide_nodes, 0, &node, sizeof node, error) &&
           karst_buffer_write(t->work.subdivide_tiles, 0, &tile, sizeof tile, error) &&
           karst_producer_answer(world->producer, &t->cache, &t->work, error) && trial_contents(t, world, error) &&
           trial_shade(t, world->shader, shadows, error);
}

bool karst_engine_try_tape_colours(karst_engine *engine, karst_error *error)
{
    trial t;
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    bool done = trial_open(&t, engine->context, buffers->brick_bits, error);
    t.cache.num_segments = buffers->num_segments;
    karst_shader *shader = done ? karst_engine_tape_shader(t.context, engine->shade, t.counters, error) : NULL;
    done = shader && trial_shade(&t, shader, engine->shadows, error);
    if (t.context)
        karst_finish(t.context, NULL);
    karst_shader_destroy(shader);
    trial_close(&t);
    return done;
}

bool karst_engine_try_world(karst_engine *engine, const karst_engine_world *opened, karst_error *error)
{
    trial t;
    const karst_engine_wishes wishes = {engine->shade, engine->refine, 1, false, engine->edits != NULL,
                                        karst_engine_contents(engine), karst_engine_has_caustics(engine),
                                        false};
    karst_engine_world world = {.file = opened->file, .values = opened->values, .seed = opened->seed};
    bool done = trial_open(&t, engine->context, karst_cache_get_buffers(engine->cache)->brick_bits, error) &&
                karst_engine_world_build(&world, t.context, &t.cache, &wishes, error) &&
                trial_run(&t, &world, engine->shadows, error);
    if (t.context)
        karst_finish(t.context, NULL);
    world.file = NULL; /* still the other's, as the values are */
    world.values = NULL;
    karst_engine_world_close(&world);
    trial_close(&t);
    return done;
}

/* Linking is done anew each time, unlike building what was built before; and always the same text leaves no more behind
 * than once. */
void karst_engine_load_compiler(karst_engine *engine)
{
    static const char text[] = "float twice(float x);\n"
                               "float twice(float x) { return 2 * sin(x); }\n"
                               "kernel void load(global float *values) { values[0] = twice(values[0]); }\n";
    const char *source = text;
    cl_context context = engine->context->cl;
    cl_device_id device = engine->context->device;
    cl_program compiled = clCreateProgramWithSource(context, 1, &source, NULL, NULL), linked = NULL;
    if (compiled && clCompileProgram(compiled, 1, &device, "", 0, NULL, NULL, NULL, NULL) == CL_SUCCESS)
        linked = clLinkProgram(context, 1, &device, "", 1, &compiled, NULL, NULL, NULL);
    if (linked)
        clReleaseProgram(linked);
    if (compiled)
        clReleaseProgram(compiled);
}
