/* The engine: ties world, device, display and pools together. One frame's life stands in karst_engine_frame. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "core/device/helper.h"

#define DEFAULT_MAX_FRAMES 1000u

const karst_display *karst_engine_display(const karst_engine *engine) { return engine->display; }
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
        if (camera->position.voxel[axis] > KARST_ENGINE_MAX_VOXEL ||
            camera->position.voxel[axis] < -KARST_ENGINE_MAX_VOXEL)
            return karst_fail(error, KARST_USAGE, "camera: %c lies beyond 2^61 voxels of %g m", "xyz"[axis],
                              exp2(engine->world->voxel_log2_m));
    if (memcmp(&engine->camera, camera, sizeof *camera) != 0)
        engine->view_changed = true;
    engine->camera = *camera;
    return true;
}

void karst_engine_start_counting_at(karst_engine *engine, uint32_t serial, uint32_t frame)
{
    engine->serial = serial;
    engine->frame = frame;
}

void karst_engine_stats(const karst_engine *engine, karst_stats *stats) { *stats = engine->stats; }

bool karst_engine_check(karst_engine *engine, karst_error *error) { return karst_cache_check(engine->cache, error); }

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

/* The next rung of detail, from what this round could and could not do. */
static bool step_ladder(karst_engine *engine, const karst_work *work)
{
    const karst_stats *stats = &engine->stats;
    uint32_t num_tiles, num_bricks;
    karst_engine_usable_slots(engine, &num_tiles, &num_bricks);
    bool tiles_fuller = stats->tiles.num_used * num_bricks > stats->bricks.num_used * num_tiles;
    uint64_t num_used = tiles_fuller ? stats->tiles.num_used : stats->bricks.num_used,
             num_total = tiles_fuller ? num_tiles : num_bricks;
    karst_engine_fullest_store(engine, &num_used, &num_total);
    karst_ladder_round round = {
        .num_used = num_used,
        .num_total = num_total,
        .num_starved = work->num_starved_bricks + work->num_starved_tiles,
        /* While less is asked for than the rung stands for, having it all says nothing. */
        .num_requests = work->num_requests + !karst_pace_at_rest(&engine->pace),
        .num_produced = stats->num_produced,
        .verdict = engine->verdict,
    };
    return karst_ladder_step(&engine->ladder, &round);
}

static karst_pace_frame pace_frame(const karst_engine *engine, bool moved)
{
    return (karst_pace_frame){.num_hits = engine->stats.num_hits,
                              .num_provisional = engine->stats.num_provisional,
                              .moved = moved,
                              .steady = engine->motion.steady};
}

/* How much the next frame asks for, with a budget in ms. Returns true if it asks for other detail. */
static bool step_pace(karst_engine *engine, const karst_work *work, bool moved)
{
    double before = engine->pace.factor;
    if (engine->budget_ns > 0 && !karst_ladder_is_deciding(&engine->ladder)) {
        karst_pace_frame frame = pace_frame(engine, moved);
        frame.num_deferred = work->num_deferred_budget;
        karst_pace_step(&engine->pace, &frame);
    } else {
        karst_pace_init(&engine->pace);
    }
    return engine->pace.factor != before;
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

/* Before a first picture a helper is mostly still at the cast: this compiles what follows it instead of waiting. */
static bool use_the_wait(karst_engine *engine, karst_error *error)
{
    return engine->has_content || !karst_helper_is_active(engine->context->helper) ||
           karst_cache_rehearse_look(engine->cache, engine->serial, error);
}

/* Who waits for the picture, or plans by it, has it before what it asks for is answered. Else both are one chain of
 * commands. */
static bool draw_and_answer(karst_engine *engine, bool moved, karst_work *work, karst_error *error)
{
    bool ok = karst_engine_draw(engine, error);
    if (ok && (engine->budget_ns > 0 || engine->goes_on))
        ok = karst_engine_end_picture(engine, error);
    /* Who is patient is given all at once. */
    if (ok && engine->budget_ns > 0 && !engine->goes_on && !karst_ladder_is_deciding(&engine->ladder)) {
        const karst_pace_frame frame = pace_frame(engine, moved);
        karst_pace_look(&engine->pace, &frame);
    }
    ok = ok && karst_engine_answer(engine, work, error);
    return karst_engine_end_picture(engine, ok ? error : NULL) && ok;
}

bool karst_engine_frame(karst_engine *engine, karst_error *error)
{
    uint64_t start_ns = karst_clock_ns(), start_cpu_ns = karst_engine_cpu_ns(engine);
    karst_stats *stats = &engine->stats;
    karst_work work;

    if (!engine->surface)
        return karst_fail(error, KARST_FAILED, "this engine lost its picture memory; set a size that fits");
    /* Who looks at the same for long gains by what pays off late. */
    const bool stands = engine->complete && !engine->view_changed;
    *stats = (karst_stats){.splats = engine->shown.splat_stats};
    karst_engine_begin_store_stats(engine);
    snprintf(stats->device, sizeof stats->device, "%s", engine->context->name);
    engine->verdict = KARST_LADDER_UNDECIDED;
    /* 0 means none: it wraps around to 1. */
    if (++engine->frame == 0)
        engine->frame = 1;
    karst_engine_next_serial(engine);
    stats->frame = engine->frame;
    /* More pixels of the same are no new view. */
    bool moved = engine->view_changed && !engine->size_changed;
    if (engine->view_changed) {
        karst_ladder_view_changed(&engine->ladder);
        karst_engine_forget_photons(engine);
        if (!karst_engine_restart_samples(engine, true, error))
            return false;
    }
    engine->complete = false;
    engine->sample = karst_engine_choose_sample(engine, moved);
    engine->kept = false;
    engine->view_changed = engine->size_changed = false;
    stats->detail_asked_px = engine->detail_px;
    stats->detail_given_px = karst_engine_detail_px(engine);

    karst_engine_note_motion(engine);

    if (!place_root(engine, error) || !karst_engine_load_root(engine, error) ||
        !use_the_wait(engine, error) || (stands && !karst_engine_survey_slopes(engine, error)) ||
        !karst_engine_look_first(engine, error) || !draw_and_answer(engine, moved, &work, error) ||
        !fill_pool_stats(engine, error))
        return false;
    engine->path = NULL;

    if (!karst_engine_end_media(engine, error))
        return false;
    bool rung_moved = step_ladder(engine, &work), pace_changed = step_pace(engine, &work, moved);
    const bool lacks_nothing = work.num_requests == 0 && !engine->media_lacks && stats->num_produced == 0 &&
                       stats->num_evicted == 0 && !rung_moved && !pace_changed &&
                       karst_ladder_at_rest(&engine->ladder) && karst_pace_at_rest(&engine->pace);
    engine->complete = karst_engine_end_photons(engine, lacks_nothing);
    if (rung_moved)
        karst_engine_forget_photons(engine);
    else if (pace_changed)
        karst_engine_change_detail_of_photons(engine);
    if (!karst_engine_end_sample(engine, engine->complete, rung_moved || pace_changed, error))
        return false;
    stats->settled = engine->complete && engine->num_summed == engine->samples &&
                     (engine->samples == 1 || engine->sample == 0);
    stats->num_samples = engine->num_summed;
    stats->num_non_finite = karst_density_producer_non_finite(engine->producer);
    karst_density_producer_thin(engine->producer, &stats->num_thin_raised, &stats->num_thin_given_up);
    karst_engine_report_non_finite(engine, engine->producer, "density", &engine->reported_non_finite);
    karst_engine_end_store_stats(engine);
    if (!karst_engine_report_index(engine, error))
        return false;

    if (!karst_profile_collect(engine->context, stats->time_ns, error))
        return false;
    karst_profile_take_streams(engine->context, stats->stream_ns);
    karst_engine_learn_cost(engine);
    stats->time_ns_frame = karst_clock_ns() - start_ns;
    stats->time_ns_cpu = karst_engine_cpu_ns(engine) - start_cpu_ns;
    karst_context_memory(engine->context, stats);
    return !engine->count_changed_pixels || karst_engine_count_changed_pixels(engine, error);
}

bool karst_engine_settle(karst_engine *engine, uint32_t max_frames,
                         bool (*progress)(void *user, const karst_stats *stats), void *user, bool *settled,
                         karst_error *error)
{
    if (max_frames == 0)
        max_frames = DEFAULT_MAX_FRAMES;
    *settled = false;
    for (uint32_t frame = 0; frame < max_frames && !*settled; frame++) {
        engine->settles = true;
        bool drawn = karst_engine_frame(engine, error);
        engine->settles = false;
        if (!drawn)
            return false;
        *settled = engine->stats.settled;
        if (progress && !progress(user, &engine->stats))
            break;
    }
    return true;
}
