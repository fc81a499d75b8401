/* karst render --path, --time-step: a flight along a path, or a view that stands while time goes. */
#include "command_farm.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEFAULT_FPS 30
#define MAX_PICTURES 10000000.0

/* When the pictures are taken. */
typedef struct {
    size_t num;
    double start_s, step_s, fps;
} schedule;

/* --fps alone: to the end, which belongs to the next picture. --frames alone: as many, from the start to the end, both
 * included. */
static bool make_schedule(const command_flight *flight, const karst_path *path, schedule *plan, karst_error *error)
{
    if (!path) {
        const double fps = flight->fps > 0 ? flight->fps : DEFAULT_FPS;
        *plan = (schedule){.num = flight->num_pictures, .fps = fps};
        return true;
    }
    double first_s = karst_path_start_s(path), last_s = karst_path_end_s(path);
    double start_s = flight->has_start ? flight->start_s : first_s, end_s = flight->has_end ? flight->end_s : last_s;
    if (start_s < first_s || end_s > last_s || start_s > end_s)
        return karst_fail(error, KARST_USAGE, "from %g to %g s: %s runs from %g to %g s", start_s, end_s, flight->file,
                          first_s, last_s);
    double fps = flight->fps > 0 ? flight->fps : DEFAULT_FPS, length_s = end_s - start_s;
    *plan = (schedule){.num = flight->num_pictures, .start_s = start_s, .step_s = 1 / fps, .fps = fps};
    if (plan->num == 0) {
        double num = rint(length_s * fps);
        if (num > MAX_PICTURES)
            return karst_fail(error, KARST_USAGE, "%g s at %g pictures a second are %.0f pictures; %.0f are the limit",
                              length_s, fps, num, MAX_PICTURES);
        plan->num = num < 1 ? 1 : (size_t)num;
    } else if (!(flight->fps > 0)) {
        plan->step_s = plan->num > 1 ? length_s / (double)(plan->num - 1) : 0;
    }
    return true;
}

bool command_flight_count(const command_flight *flight, size_t *num, karst_error *error)
{
    schedule plan = {0};
    /* Its times alone count here, but keyframes must not fall on one another: fine voxels, if they reach so far. */
    karst_path *path = flight->file ? karst_path_load(flight->file, 0, NULL) : NULL;
    if (!path && flight->file)
        path = karst_path_load(flight->file, KARST_VOXEL_LOG2_MAX, error);
    const bool made = (path || !flight->file) && make_schedule(flight, path, &plan, error);
    karst_path_destroy(path);
    *num = plan.num;
    return made;
}

typedef struct {
    karst_engine *engine;
    const command_flight *flight;
    command_talk *talk;
    command_record *record;
    const schedule *plan;
    karst_error *error;
    size_t index; /* of the picture at hand */
    size_t first, end, num_drawn;
    bool is_settled; /* the picture at hand */
    uint64_t start_ns;
} flight_state;

static void format_left(double left_s, char *text, size_t size_bytes)
{
    if (left_s < 60)
        snprintf(text, size_bytes, "%.0f s", left_s);
    else if (left_s < 3600)
        snprintf(text, size_bytes, "%d min %02d s", (int)left_s / 60, (int)left_s % 60);
    else
        snprintf(text, size_bytes, "%.0f h %02d min", floor(left_s / 3600), (int)fmod(left_s / 60, 60));
}

static void show_progress(const flight_state *state, const karst_stats *stats)
{
    double passed_s = (double)(command_clock_ns() - state->start_ns) / 1e9;
    char left[32] = "some time";
    if (state->num_drawn > 0)
        format_left(passed_s / (double)state->num_drawn * (double)(state->end - state->index), left, sizeof left);
    command_progress(state->talk, "picture %zu of %zu   %llu bricks   %llu requests   %.1f s   %s left",
                     state->index - state->first + 1, state->end - state->first,
                     (unsigned long long)stats->num_resident_bricks, (unsigned long long)stats->num_requests, passed_s,
                     left);
}

static bool note_frame(void *user, const karst_stats *stats)
{
    flight_state *state = user;
    show_progress(state, stats);
    return command_record_add(state->record, stats, state->error) && !command_interrupted();
}

static bool note_start(void *user, const karst_stats *stats)
{
    show_progress(user, stats);
    return !command_interrupted();
}

/* Draws the picture at hand: until it is settled, or once. True as well if it was interrupted. */
static bool draw(flight_state *state, karst_error *error)
{
    karst_stats stats;
    size_t frames_before = state->record->num_frames;
    bool settled = false;
    if (state->flight->live) {
        if (!karst_engine_frame(state->engine, error))
            return command_interrupted();
        karst_engine_stats(state->engine, &stats);
        settled = stats.settled;
        state->error = error;
        if (!note_frame(state, &stats) && !command_interrupted())
            return false;
    } else {
        karst_error noted = {0};
        state->error = &noted;
        if (!karst_engine_settle(state->engine, state->flight->max_frames, note_frame, state, &settled, error))
            return command_interrupted();
        if (noted.status != KARST_OK)
            return karst_fail(error, noted.status, "%s", noted.message);
        karst_engine_stats(state->engine, &stats);
    }
    state->is_settled = settled;
    return command_interrupted() ||
           command_record_picture(state->record, &stats, state->record->num_frames - frames_before, settled, error);
}

static bool note_picture(const flight_state *state, karst_error *error)
{
    if (!state->flight->manifest || !state->is_settled)
        return true;
    char *name = command_picture_name(state->flight->output, state->index);
    const bool noted = name ? command_manifest_add(state->flight->manifest, state->index, name, error)
                            : karst_fail(error, KARST_FAILED, "out of memory");
    free(name);
    return noted;
}

static bool fly(flight_state *state, const karst_path *path, command_pictures *pictures, uint8_t *rgba,
                size_t size_bytes, karst_error *error)
{
    const schedule *plan = state->plan;
    for (; state->index < state->end; state->index++) {
        if (command_manifest_has(state->flight->manifest, state->index))
            continue;
        double time_s = plan->start_s + (double)state->index * plan->step_s;
        karst_camera camera = path ? karst_path_sample(path, time_s) : karst_engine_camera(state->engine);
        if (!karst_engine_set_camera(state->engine, &camera, error) ||
            !karst_engine_set_time(state->engine,
                                   state->flight->world_s + (double)state->index * state->flight->world_step_s, error))
            return false;
        if (state->flight->live && state->index == 0) {
            /* As one who waits at the start: kernels get built and the first view filled, and none of it is counted. */
            bool settled;
            if (!karst_engine_settle(state->engine, state->flight->max_frames, note_start, state, &settled, error) &&
                !command_interrupted())
                return false;
            state->start_ns = command_clock_ns();
        }
        if (state->flight->live && path)
            karst_engine_follow(state->engine, path, time_s, plan->step_s);
        if (!command_interrupted() && !draw(state, error))
            return false;
        if (command_interrupted())
            return command_fail_interrupted(error, "interrupted after %zu of %zu pictures", state->index - state->first,
                                            state->end - state->first);
        if (!karst_engine_read_pixels(state->engine, rgba, size_bytes, error) ||
            !command_pictures_add(pictures, state->index, state->engine, rgba, error) || !note_picture(state, error))
            return false;
        state->num_drawn++;
    }
    return true;
}

bool command_flight_run(karst_engine *engine, const command_flight *flight, int width_px, int height_px,
                        command_talk *talk, command_record *record, karst_error *error)
{
    bool done = false;
    schedule plan;
    size_t size_bytes = (size_t)width_px * (size_t)height_px * 4;
    uint8_t *rgba = malloc(size_bytes);
    command_pictures *pictures = NULL;
    karst_path *path =
        flight->file ? karst_path_load(flight->file, karst_engine_voxel_log2_m(engine), error) : NULL;
    if ((!path && flight->file) || !make_schedule(flight, path, &plan, error))
        goto out;
    if (!rgba) {
        karst_fail(error, KARST_FAILED, "out of memory for a picture of %dx%d", width_px, height_px);
        goto out;
    }
    pictures = command_pictures_open(flight->output, width_px, height_px, plan.fps, error);
    if (!pictures)
        goto out;
    flight_state state = {.engine = engine,
                          .flight = flight,
                          .talk = talk,
                          .record = record,
                          .plan = &plan,
                          .error = error,
                          .index = flight->first,
                          .first = flight->first,
                          .end = flight->end ? flight->end : plan.num,
                          .start_ns = command_clock_ns()};
    if (path && karst_path_world(path) && strcmp(karst_path_world(path), record->world) != 0)
        command_say(talk, "note: %s was made for the world '%s'", flight->file, karst_path_world(path));
    bool flown = fly(&state, path, pictures, rgba, size_bytes, error);
    flown = command_manifest_write(flight->manifest, error) && flown;
    record->elapsed_ns = command_clock_ns() - state.start_ns;
    command_end_progress(talk);
    karst_camera camera = karst_engine_camera(engine);
    karst_camera_format(&camera, karst_engine_voxel_log2_m(engine), record->camera, sizeof record->camera);
    if (flown) {
        done = command_pictures_finish(pictures, error);
        pictures = NULL;
    }
out:
    command_end_progress(talk);
    command_pictures_discard(pictures);
    karst_path_destroy(path);
    free(rgba);
    return done;
}
