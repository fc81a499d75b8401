/* karst bench: one run. Each has an engine of its own, so that every run begins with empty pools. */
#include "command_bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define WARM_UP_ROUNDS 2
#define MAX_FRAME_SPANS 4096
#define MAX_SPANS ((size_t)4 << 20)

typedef struct {
    bench *b;
    command_talk *talk;
    karst_engine *engine, *beside; /* beside: NULL for none */
    karst_error *error;
    bench_phase phase;
    size_t index;
    double time_s;
    uint64_t phase_start_ns;
    const char *doing;
    bool counted;
} run_state;

static bool add_spans(run_state *state, karst_error *error)
{
    bench *b = state->b;
    if (!b->tracing || state->phase == BENCH_BESIDE || b->num_spans >= MAX_SPANS)
        return true;
    if (b->max_spans < b->num_spans + MAX_FRAME_SPANS) {
        size_t max_spans = 2 * b->max_spans + MAX_FRAME_SPANS;
        karst_span *spans = realloc(b->spans, max_spans * sizeof *spans);
        if (!spans)
            return karst_fail(error, KARST_FAILED, "out of memory for a trace");
        b->spans = spans;
        b->max_spans = max_spans;
    }
    size_t num = karst_engine_spans(state->engine, b->spans + b->num_spans, MAX_FRAME_SPANS);
    b->num_spans += num < MAX_FRAME_SPANS ? num : MAX_FRAME_SPANS;
    return true;
}

static bool add_frame(run_state *state, const karst_stats *stats, karst_error *error)
{
    bench *b = state->b;
    if (b->num_frames == b->max_frames_kept) {
        size_t max_frames = b->max_frames_kept ? 2 * b->max_frames_kept : 256;
        bench_frame *frames = realloc(b->frames, max_frames * sizeof *frames);
        if (!frames)
            return karst_fail(error, KARST_FAILED, "out of memory for %zu frames", max_frames);
        b->frames = frames;
        b->max_frames_kept = max_frames;
    }
    bench_frame *frame = &b->frames[b->num_frames++];
    *frame = (bench_frame){.phase = state->phase, .run = b->runs_done, .index = state->index++};
    frame->ended_ns = karst_clock();
    frame->time_s =
        state->phase == BENCH_FLIGHT ? state->time_s : (double)(frame->ended_ns - state->phase_start_ns) * 1e-9;
    frame->frame_ns = stats->time_ns_frame;
    frame->production_ns = stats->time_ns_production;
    frame->cpu_ns = stats->time_ns_cpu;
    memcpy(frame->stage_ns, stats->time_ns, sizeof frame->stage_ns);
    memcpy(frame->num_rays, stats->num_rays, sizeof frame->num_rays);
    memcpy(frame->stream_ns, stats->stream_ns, sizeof frame->stream_ns);
    frame->num_requests = stats->num_requests;
    frame->num_produced = stats->num_produced;
    frame->num_evicted = stats->num_evicted;
    frame->num_reproduced = stats->num_reproduced;
    frame->num_deferred = stats->num_deferred;
    frame->num_tiles = stats->num_tiles_produced;
    frame->num_bricks = stats->num_bricks_produced;
    frame->num_constant = stats->num_bricks_constant;
    frame->num_pixels = stats->num_pixels;
    frame->num_hits = stats->num_hits;
    frame->num_provisional = stats->num_provisional;
    frame->num_incomplete = stats->num_incomplete;
    frame->used_tiles = stats->tiles.num_used;
    frame->used_bricks = stats->bricks.num_used;
    frame->resident_tiles = stats->num_resident_tiles;
    frame->resident_bricks = stats->num_resident_bricks;
    frame->given_px = stats->detail_given_px;
    frame->num_coarser = stats->num_coarser;
    return add_spans(state, error);
}

/* After each frame, whether settling or not. */
static bool note_frame(void *user, const karst_stats *stats)
{
    run_state *state = user;
    command_progress(state->talk, "run %u of %u: %s, frame %zu   %llu bricks   %llu requests", state->b->runs_done + 1,
                     (unsigned)state->b->num_runs, state->doing, state->index,
                     (unsigned long long)stats->num_resident_bricks, (unsigned long long)stats->num_requests);
    return (!state->counted || add_frame(state, stats, state->error)) && !command_interrupted();
}

bool bench_interrupted(karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "interrupted; nothing was written");
}

static bool settle(run_state *state, karst_engine *engine, karst_error *error)
{
    bool settled = false;
    karst_error noted = {0};
    state->error = &noted;
    if (!karst_engine_settle(engine, (uint32_t)state->b->max_frames, note_frame, state, &settled, error))
        return false;
    if (noted.status != KARST_OK)
        return karst_fail(error, noted.status, "%s", noted.message);
    if (command_interrupted())
        return bench_interrupted(error);
    return settled || karst_fail(error, KARST_FAILED, "the view did not settle within %u frames; raise --frames-max",
                                 (unsigned)state->b->max_frames);
}

static bool draw(run_state *state, karst_engine *engine, karst_error *error)
{
    karst_stats stats;
    karst_error noted = {0};
    state->error = &noted;
    if (!karst_engine_frame(engine, error))
        return false;
    karst_engine_stats(engine, &stats);
    if (!note_frame(state, &stats))
        return noted.status != KARST_OK ? karst_fail(error, noted.status, "%s", noted.message)
                                        : bench_interrupted(error);
    return true;
}

static void begin(run_state *state, bench_phase phase, bool counted, const char *doing)
{
    state->phase = phase;
    state->counted = counted;
    state->doing = doing;
    state->index = 0;
    state->phase_start_ns = karst_clock();
}

karst_engine *bench_open_engine(bench *b, bool is_beside, const karst_log *log, karst_error *error)
{
    karst_engine_config config = {.world = b->world_file, .device = b->device, .display = b->display_kind, .log = log};
    if (is_beside)
        config.display = KARST_DISPLAY_NONE;
    config.parameters = b->parameters.values;
    config.num_parameters = b->parameters.num_values;
    config.width_px = b->size_px[0];
    config.height_px = b->size_px[1];
    config.pool_bytes = b->pool_mib > 0 ? (uint64_t)(b->pool_mib * 1048576) : 1;
    config.detail_px = b->detail_px;
    config.view_distance_m = b->view_distance_m;
    config.has_seed = b->has_seed;
    config.seed = (uint32_t)b->seed;
    config.no_shadows = b->no_shadows || (is_beside && b->beside == BENCH_BESIDE_NO_SHADOWS);
    config.occlusion = command_occlusion(b->occlusion, b->no_occlusion);
    config.mirror = is_beside && b->beside == BENCH_BESIDE_NO_MIRROR ? -1 : command_mirror(b->mirror, b->has_mirror);
    config.scattering = b->scattering;
    config.no_blend = b->no_blend;
    config.refine = b->refine;
    config.edits = b->edits;
    config.brick_bits = (int)b->brick_bits;
    config.no_beam = b->no_beam;
    config.lanes = (int)b->lanes;
    config.helper = is_beside ? NULL : b->helper;
    return karst_engine_create(&config, error);
}

bool bench_set_first_camera(bench *b, karst_engine *engine, const karst_path *path, karst_error *error)
{
    karst_camera camera = karst_engine_default_camera(engine);
    if (b->camera && !karst_camera_parse(b->camera, karst_engine_voxel_log2_m(engine), &camera, error))
        return false;
    if (path)
        camera = karst_path_sample(path, karst_path_start_s(path));
    karst_camera_format(&camera, karst_engine_voxel_log2_m(engine), b->camera_text, sizeof b->camera_text);
    return karst_engine_set_camera(engine, &camera, error);
}

/* Finds the two moments of the start that one waits for. */
static void time_start(const bench *b, size_t first_frame, uint64_t start_ns, bench_run *run)
{
    run->settling_frames = b->num_frames - first_frame;
    run->hole_free_ms = run->complete_ms = (double)(b->frames[b->num_frames - 1].ended_ns - start_ns) * 1e-6;
    for (size_t i = b->num_frames; i-- > first_frame;) {
        if (b->frames[i].num_incomplete > 0)
            break;
        run->hole_free_ms = (double)(b->frames[i].ended_ns - start_ns) * 1e-6;
    }
}

/* Opens the engine beside the first, with its camera, and lets it settle. */
static bool open_beside(run_state *state, const karst_log *log, karst_error *error)
{
    bench *b = state->b;
    const karst_camera camera = karst_engine_camera(state->engine);
    begin(state, BENCH_BESIDE, false, "settling the view beside it");
    state->beside = bench_open_engine(b, true, log, error);
    return state->beside && karst_engine_set_camera(state->beside, &camera, error) &&
           settle(state, state->beside, error);
}

/* A frame of the second engine, after another one, as settled frames are. `index`: its frame's; `counted`: whether it
 * is kept. Leaves the phase as it was. */
static bool draw_beside(run_state *state, size_t index, bool counted, karst_error *error)
{
    const run_state before = *state;
    state->phase = BENCH_BESIDE;
    state->counted = false;
    bool drawn = draw(state, state->beside, error);
    state->counted = counted;
    state->index = index;
    drawn = drawn && draw(state, state->beside, error);
    state->phase = before.phase;
    state->counted = before.counted;
    state->index = before.index;
    return drawn;
}

/* Settled frames, and in turns with them what to judge them by. What measures the device leaves nothing of a picture in
 * caches: the frame after it is one of its own kind (cold); the one that counts comes after another, as those of a view
 * that stands do, and the floor after that. */
static bool do_rounds(run_state *state, karst_measure *measure, karst_error *error)
{
    bench *b = state->b;
    karst_ceilings *ceilings = b->ceilings + (size_t)b->runs_done * b->num_rounds, unused;
    begin(state, BENCH_SETTLED, false, "settled");
    for (int round = -WARM_UP_ROUNDS; round < (int)b->num_rounds; round++) {
        const size_t index = round >= 0 ? (size_t)round : 0;
        karst_ceilings *now = round >= 0 ? &ceilings[index] : &unused;
        state->counted = round >= 0;
        state->index = index;
        state->phase = BENCH_COLD;
        if (!karst_measure_ceilings(measure, now, error) || !draw(state, state->engine, error))
            return false;
        state->index = index;
        state->phase = BENCH_SETTLED;
        if (!draw(state, state->engine, error) || !karst_measure_floor(measure, now, error))
            return false;
        if ((b->beside == BENCH_BESIDE_NO_SHADOWS || b->beside == BENCH_BESIDE_NO_MIRROR) &&
            !draw_beside(state, index, round >= 0, error))
            return false;
    }
    return true;
}

static bool fly(run_state *state, const karst_path *path, karst_error *error)
{
    const bench *b = state->b;
    double start_s = karst_path_start_s(path), end_s = karst_path_end_s(path), step_s = 1 / b->fps;
    size_t num = (size_t)fmax(1, rint((end_s - start_s) * b->fps));
    if (b->num_pictures && b->num_pictures < num)
        num = (size_t)b->num_pictures;
    if (!karst_engine_set_budget_ms(state->engine, b->budget_ms, error))
        return false;
    begin(state, BENCH_FLIGHT, true, "flying");
    for (size_t i = 0; i < num; i++) {
        state->time_s = start_s + (double)i * step_s;
        karst_camera camera = karst_path_sample(path, state->time_s);
        if (!karst_engine_set_camera(state->engine, &camera, error))
            return false;
        karst_engine_follow(state->engine, path, state->time_s, step_s);
        if (b->beside == BENCH_BESIDE_STANDING && i % BENCH_STANDING_EVERY == 0 && !draw_beside(state, i, true, error))
            return false;
        if (!draw(state, state->engine, error))
            return false;
    }
    return true;
}

bool bench_do_run(bench *b, command_talk *talk, const karst_log *log, karst_error *error)
{
    bool done = false;
    uint64_t start_ns = b->runs_done == 0 ? b->process_start_ns : karst_clock();
    run_state state = {.b = b, .talk = talk};
    bench_run *run = &b->runs[b->runs_done];
    karst_path *path = NULL;
    karst_measure *measure = NULL;
    size_t first_frame = b->num_frames;
    b->num_spans = 0;
    state.engine = bench_open_engine(b, false, log, error);
    if (!state.engine)
        goto out;
    snprintf(b->display, sizeof b->display, "%s",
             karst_display_kind_name(karst_display_get_kind(karst_engine_display(state.engine))));
    if (b->path && !(path = karst_path_load(b->path_file, karst_engine_voxel_log2_m(state.engine), error)))
        goto out;
    if (!bench_set_first_camera(b, state.engine, path, error) ||
        (b->tracing && !karst_engine_set_tracing(state.engine, true, error)))
        goto out;
    run->opened_ms = (double)(karst_clock() - start_ns) * 1e-6;
    begin(&state, BENCH_SETTLING, true, "settling");
    if (!settle(&state, state.engine, error))
        goto out;
    time_start(b, first_frame, start_ns, run);
    karst_engine_stats(state.engine, &b->settled);
    if (!karst_engine_count_hit_bricks(state.engine, &run->hit_bricks, error))
        goto out;
    command_progress(talk, "run %u of %u: building the kernels to compare with", b->runs_done + 1,
                     (unsigned)b->num_runs);
    measure = karst_measure_create(state.engine, error);
    if (!measure)
        goto out;
    b->num_cores = karst_measure_num_cores(measure);
    if ((b->beside != BENCH_BESIDE_NOTHING && !open_beside(&state, log, error)) || !do_rounds(&state, measure, error))
        goto out;
    karst_measure_destroy(measure);
    measure = NULL;
    done = !path || fly(&state, path, error);
    b->runs_done += done;
out:
    command_end_progress(talk);
    karst_measure_destroy(measure);
    karst_path_destroy(path);
    karst_engine_destroy(state.beside);
    karst_engine_destroy(state.engine);
    return done;
}

/* ---- of tables ---- */

bool bench_time_frame(karst_engine *engine, karst_stats *stats, double *ms, karst_error *error)
{
    if (!karst_engine_frame(engine, error))
        return false;
    karst_engine_stats(engine, stats);
    *ms = (double)(stats->time_ns_cpu ? stats->time_ns_cpu : stats->time_ns_frame) * 1e-6;
    return !command_interrupted() || bench_interrupted(error);
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double bench_median(double *values, size_t num)
{
    qsort(values, num, sizeof *values, compare_doubles);
    return num % 2 ? values[num / 2] : 0.5 * (values[num / 2 - 1] + values[num / 2]);
}
