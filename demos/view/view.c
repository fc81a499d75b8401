/* karst view: opening, the loop, closing. */
#include "demos/view/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define IDLE_S 0.05      /* between looks at the world file while nothing happens */
#define COMPILING_S 0.01 /* between looks at a compilation */
#define GAMEPAD_S 0.033  /* between looks at a gamepad's sticks while nothing happens */
#define LONGEST_STEP_S 0.25
#define MOST_BRICKS 8192                        /* in a frame: what one waits for, standing, is made in few */
#define FOUND_AHEAD_BYTES ((uint64_t)512 << 20) /* what a default pool holds */

/* ---- opening ---- */

static bool open_engine(viewer *v, karst_error *error)
{
    const view_settings *s = &v->settings;
    karst_engine_config config = {
        .world = v->world_file, .device = s->device, .in_display = v->display, .log = &v->log};
    config.parameters = s->parameters.values;
    config.num_parameters = s->parameters.num_values;
    config.width_px = v->width_px > 0 ? v->width_px : 1;
    config.height_px = v->height_px > 0 ? v->height_px : 1;
    config.pool_bytes = s->pool_mib > 0 ? (uint64_t)(s->pool_mib * 1048576) : 1;
    config.detail_px = s->detail_px;
    config.view_distance_m = s->view_distance_m;
    config.budget_ms = 1000 / s->fps;
    config.budget_bricks = MOST_BRICKS;
    config.has_seed = s->has_seed;
    config.seed = (uint32_t)s->seed;
    config.no_shadows = s->no_shadows;
    config.brick_bits = (int)s->brick_bits;
    config.edits = s->edits;
    config.lanes = (int)s->lanes;
    command_set_look(&s->look, &config);
    if (!v->helper)
        v->helper = karst_helper_create(NULL); /* without one it only takes longer */
    config.helper = v->helper;
    v->engine = karst_engine_create(&config, error);
    if (!v->engine)
        return false;
    v->resized = false;
    v->motion.camera = karst_engine_default_camera(v->engine);
    if (s->camera && !karst_camera_parse(s->camera, karst_engine_voxel_log2_m(v->engine), &v->motion.camera, error))
        return false;
    v->motion.dirty = true;
    return karst_engine_set_time(v->engine, s->time_s, error);
}

static bool choose_start(viewer *v, karst_error *error)
{
    const view_settings *s = &v->settings;
    v->page = s->hidden_hud ? VIEW_PAGE_NONE : (view_page)v->memory.page;
    v->motion.speed_m_s = s->speed_m_s;
    if (s->view && !karst_view_parse(s->view, &v->view, error))
        return false;
    for (int i = 0; s->mode && i < VIEW_NUM_MODES; i++)
        if (strcmp(s->mode, view_mode_names[i]) == 0) {
            v->motion.wished_mode = (view_mode)i;
            return true;
        }
    return !s->mode || karst_fail(error, KARST_USAGE, "--mode %s: must be fly, walk or orbit", s->mode);
}

static bool open_viewer(viewer *v, karst_error *error)
{
    view_memory_read(v);
    if (!choose_start(v, error) || !view_window_open(v, error) || !view_overlay_create(v, error))
        return false;
    /* Something is there at once, and says what takes long the first time. */
    view_toast(v, "opening %s: the first time, compiling takes some seconds", v->world);
    view_hud_update(v, true);
    view_overlay_clear(v);
    view_overlay_draw(v);
    glfwSwapBuffers(v->window);
    glfwPollEvents();
    v->display = karst_display_create_in_context((void *(*)(const char *))glfwGetProcAddress, &v->log, error);
    if (!v->display || !open_engine(v, error))
        return false;
    v->toast[0] = 0;
    view_world_open(v);
    if (v->motion.speed_m_s <= 0)
        v->motion.speed_m_s = v->metadata ? view_usual_speed_m_s(v->metadata) : 10;
    if (v->view != KARST_VIEW_PICTURE && !karst_engine_set_view(v->engine, v->view, error))
        return false;
    view_sliders_read(v, false);
    view_reload_begin(v);
    view_memory_read_bookmarks(v);
    view_saved_read(v);
    if (v->settings.replay) {
        v->capture.replay_only = true;
        return view_replay_start(v, v->capture.path_file, error);
    }
    return true;
}

/* ---- a turn of the loop ---- */

static bool apply_size(viewer *v, karst_error *error)
{
    if (!v->resized || v->width_px < 1 || v->height_px < 1)
        return true;
    v->resized = false;
    v->settled = false;
    v->resolution.moving_share = 0;
    return karst_engine_set_size(v->engine, v->width_px, v->height_px, error);
}

static void keep_history(viewer *v, double frame_ms)
{
    view_history *h = &v->history;
    size_t i = h->next;
    h->frame_ms[i] = frame_ms;
    h->produced[i] = (double)v->stats.num_produced;
    h->evicted[i] = (double)v->stats.num_evicted;
    h->reproduced[i] = (double)v->stats.num_reproduced;
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++)
        h->stages_ms[i][stage] = (double)v->stats.time_ns[stage] / 1e6;
    h->next = (i + 1) % VIEW_HISTORY;
    h->num += h->num < VIEW_HISTORY;
}

/* The engine asks while it makes content. For a view that stands that may take long: its picture need not wait, and
 * keys and mouse end it. In motion a frame has its budget. */
static bool goes_on(void *user)
{
    viewer *v = user;
    if (!v->resolution.at_rest)
        return true;
    if (!v->is_shown) /* a lost context shows after the frame again */
        view_show(v, NULL);
    return view_window_is_quiet(v);
}

/* One frame of the engine into the window, its panels over it. */
static bool draw_frame(viewer *v, bool moving, karst_error *error)
{
    if (!view_resolution_choose(v, moving, error) || !karst_engine_set_camera(v->engine, &v->motion.camera, error))
        return false;
    view_overlay_clear(v);
    v->is_shown = false;
    if (v->capture.path)
        karst_engine_follow(v->engine, v->capture.path, v->capture.replay_s, 1.0 / v->settings.fps);
    if (!karst_engine_frame(v->engine, error))
        return false;
    karst_engine_stats(v->engine, &v->stats);
    v->settled = v->stats.settled && v->resolution.share == VIEW_FULL_SHARE;
    int width = v->width_px, height = v->height_px;
    if (v->resolution.share < VIEW_FULL_SHARE) {
        width = (int)((double)width * v->resolution.share / VIEW_FULL_SHARE);
        height = (int)((double)height * v->resolution.share / VIEW_FULL_SHARE);
    }
    if (v->page != VIEW_PAGE_NONE || v->motion.mode == VIEW_FLY || v->edits.brush.tool != VIEW_NO_TOOL) {
        v->edits.is_seen = karst_engine_probe(v->engine, width / 2, height / 2, &v->probe, NULL);
        v->edits.seen = v->motion.camera;
    }
    v->num_frames++;
    return command_record_add(&v->capture.record, &v->stats, error) && view_capture_pictures(v, error) &&
           view_video_step(v, error) && (v->is_shown || view_show(v, error));
}

static void wait_for_events(viewer *v, bool busy)
{
    bool heard = view_window_deliver(v);
    if (heard || (busy && !v->iconified))
        glfwPollEvents();
    else
        glfwWaitEventsTimeout(v->reload.running ? COMPILING_S : view_gamepad_present() ? GAMEPAD_S : IDLE_S);
}

/* The mode that was asked for on the command line: walking as soon as there is ground, orbiting as soon as it is known
 * what is under the cross-hair. */
static void take_wished_mode(viewer *v)
{
    view_motion *m = &v->motion;
    if (m->wished_mode == VIEW_FLY || (m->wished_mode == VIEW_ORBIT && !v->stats.settled))
        return;
    view_mode mode = m->wished_mode;
    m->wished_mode = VIEW_FLY;
    if (m->mode == VIEW_FLY)
        view_set_mode(v, mode);
    if (v->settings.speed_m_s > 0)
        m->speed_m_s = v->settings.speed_m_s;
}

/* How long after the last motion the picture is whole again. */
static void note_rest(viewer *v, bool moving)
{
    double since_s = v->shown_at_s - v->moved_at_s;
    bool was_full = v->is_full;
    v->is_full = !moving && v->resolution.share == VIEW_FULL_SHARE;
    if (v->is_full && !was_full)
        v->full_after_s = since_s;
    bool was_sharp = v->is_sharp;
    v->is_sharp = v->is_full && v->stats.num_coarser == 0;
    if (v->is_sharp && !was_sharp)
        v->sharp_after_s = since_s;
    if (v->settled)
        v->settled_after_s = since_s;
}

static bool turn(viewer *v, bool *busy, karst_error *error)
{
    double before_s = v->now_s;
    bool was_busy = *busy, reloaded = false;
    wait_for_events(v, *busy);
    v->now_s = glfwGetTime();
    /* After a pause one does not leap. */
    double dt_s = was_busy ? fmin(v->now_s - before_s, LONGEST_STEP_S) : 1.0 / 60;
    command_have_much_to_lose(v->capture.recording || v->capture.video ||
                              (v->edits.is_ready && view_edits_num_unsaved(v) > 0));
    v->leaving = v->leaving || command_interrupted();
    if (v->leaving)
        return true;
    if (!view_reload_step(v, false, &reloaded, error) || !apply_size(v, error))
        return false;
    if (v->sliders.changed && !view_sliders_apply(v, error))
        return false;
    bool replayed = view_replay_step(v), aged = view_time_turn(v, dt_s);
    bool moving = view_move(v, fmax(dt_s, 1e-4)) || replayed || aged;
    view_record_step(v);
    view_brush_step(v);
    view_edits_notice(v);
    if (moving) {
        v->moved_at_s = v->now_s;
        v->settled = false;
    }
    if (reloaded)
        v->settled = false;
    bool visible = !v->iconified && v->width_px > 0 && v->height_px > 0;
    bool wants_picture = v->capture.want_png || v->capture.want_exr;
    bool draw = visible && (!v->settled || wants_picture || v->capture.video);
    if (draw) {
        uint64_t start_ns = command_clock_ns();
        if (!draw_frame(v, moving, error))
            return false;
        uint64_t frame_ns = command_clock_ns() - start_ns;
        if (v->num_frames == 1)
            karst_engine_find_memory(v->engine, FOUND_AHEAD_BYTES);
        if (moving) {
            v->num_moving++;
            v->num_late += (double)frame_ns > 1e9 / v->settings.fps;
        }
        note_rest(v, moving);
        if (v->reload.running || reloaded) {
            v->reload.num_frames++;
            v->reload.longest_ms = fmax(v->reload.longest_ms, (double)frame_ns / 1e6);
        }
        keep_history(v, (double)frame_ns / 1e6);
        take_wished_mode(v);
        view_resolution_learn(v, moving, frame_ns);
    } else if (visible && (v->damaged || view_hud_update(v, false))) {
        if (v->num_frames && !karst_engine_show(v->engine, error))
            return false;
        if (!view_show(v, error))
            return false;
    }
    if (v->settled)
        view_reload_get_ready(v);
    *busy = visible && (!v->settled || v->time_runs || v->capture.path || v->capture.recording || v->capture.video);
    if (v->capture.path && !visible)
        *busy = true;
    return true;
}

/* ---- closing ---- */

/* The viewer that is open, for an end that comes from below: the X library ends a program whose server is gone. */
static viewer *open_one;

static void save_at_exit(void)
{
    viewer *v = open_one;
    open_one = NULL;
    if (!v || !v->engine)
        return;
    v->window = NULL; /* nothing can be shown any more */
    command_say_error(v->talk, "the display is gone; start karst view again");
    if (v->capture.recording || v->capture.num_keyframes)
        view_record_save(v);
    view_edits_finish(v);
    char camera[512];
    karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), camera, sizeof camera);
    command_say(v->talk, "you were at: karst view %s --camera %s", v->world, camera);
}

/* What only this program knows goes to disk first: what follows may have to wait for a compiler. */
static void close_viewer(viewer *v)
{
    command_hold_interrupts(true);
    view_video_stop(v);
    if (v->capture.recording && v->engine) {
        v->capture.recording = false;
        view_record_save(v);
    }
    v->capture.num_keyframes = 0;
    view_edits_finish(v);
    if (v->engine && v->window && !v->lost) {
        view_memory_write(v);
        view_saved_write(v);
    }
    view_edits_close(v);
    command_hold_interrupts(false);
    command_have_all_saved();
    view_reload_end(v);
    view_replay_stop(v);
    karst_sampler_destroy(v->sampler);
    karst_world_close(v->compiled);
    karst_engine_destroy(v->engine);
    karst_helper_destroy(v->helper);
    karst_display_destroy(v->display);
    v->engine = NULL;
    if (v->overlay.gl)
        view_overlay_destroy(v);
    view_window_close(v);
    command_record_free(&v->capture.record);
    free(v->capture.keyframes);
}

static bool run(viewer *v, karst_error *error)
{
    if (!open_viewer(v, error))
        return false;
    static bool registered;
    if (!registered)
        atexit(save_at_exit);
    registered = true;
    open_one = v;
    karst_engine_set_patience(v->engine, goes_on, v);
    bool busy = true, good = true;
    v->now_s = glfwGetTime();
    while (good && !v->leaving)
        good = turn(v, &busy, error);
    open_one = NULL;
    if (good && v->settings.stats)
        good = view_statistics_write(v, v->settings.stats, error);
    if (!good) { /* so that nobody loses the way */
        char camera[512];
        karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), camera, sizeof camera);
        command_say(v->talk, "you were at: karst view %s --camera %s", v->world, camera);
    }
    return good;
}

bool command_view(int argc, char **argv, command_talk *talk, karst_error *error)
{
    viewer *v = calloc(1, sizeof *v);
    if (!v)
        return karst_fail(error, KARST_FAILED, "out of memory");
    v->started_ns = command_clock_ns();
    v->talk = talk;
    v->log = command_log(talk);
    v->scale = 1;
    view_release_all(v);
    bool good = view_settings_read(&v->settings, argc, argv, talk, &v->world, error);
    if (good && v->settings.help) {
        view_settings_print_help();
    } else if (good && v->settings.keys) {
        if (strcmp(v->settings.keys, "manual") == 0)
            view_keys_print_manual(stdout);
        else
            view_keys_print(stdout);
    } else if (good) {
        command_catch_interrupts();
        good = command_check_memory(talk, v->settings.pool_mib, true, error);
        command_open_driver(talk);
        v->log = command_log(talk);
        view_settings *s = &v->settings;
        const command_scene scene = {v->world_file,  sizeof v->world_file, s->replay ? NULL : &s->camera, &s->edits,
                                     &s->parameters, &s->has_seed,         &s->seed};
        good = good && command_find_scene(v->world, &scene, talk, error) &&
               (!v->settings.stats || command_check_output(v->settings.stats, "--stats", false, error)) &&
               (!v->settings.replay ||
                (command_find_path(v->settings.replay, v->capture.path_file, sizeof v->capture.path_file, error) &&
                 karst_path_check(v->capture.path_file, error)));
        v->is_file = view_is_file(v->world_file);
        if (good)
            good = run(v, error);
        close_viewer(v);
    }
    free(v);
    return good;
}
