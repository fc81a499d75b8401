/* What one leaves with: pictures, paths, videos, statistics, the place as a command line. */
#include "demos/view/view.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define KEYFRAME_EVERY_S 0.2
#define VIDEO_FPS 30.0

/* ---- pictures ---- */

/* The last frame's pixels, malloc'ed, at the size that it was drawn with. */
static uint8_t *read_picture(viewer *v, karst_error *error)
{
    size_t size_bytes = (size_t)v->stats.num_pixels * 4;
    uint8_t *rgba = malloc(size_bytes);
    if (!rgba)
        karst_fail(error, KARST_FAILED, "out of memory for a picture");
    else if (karst_engine_read_pixels(v->engine, rgba, size_bytes, error))
        return rgba;
    free(rgba);
    return NULL;
}

bool view_capture_pictures(viewer *v, karst_error *error)
{
    view_capture *c = &v->capture;
    if ((!c->want_png && !c->want_exr) || v->stats.num_pixels != (uint64_t)v->width_px * (uint64_t)v->height_px)
        return true;
    uint8_t *rgba = read_picture(v, error);
    if (!rgba)
        return false;
    const command_exr plain = {0};
    for (int exr = 0; exr < 2; exr++) {
        bool *want = exr ? &c->want_exr : &c->want_png;
        karst_error reason = {0};
        char path[PATH_MAX];
        if (!*want)
            continue;
        *want = false;
        if (view_number_file(v, exr ? "exr" : "png", path, &reason) &&
            command_write_picture(path, v->engine, rgba, v->width_px, v->height_px, &plain, &reason)) {
            c->num_pictures++;
            snprintf(c->last_file, sizeof c->last_file, "%s", path);
            view_toast(v, "picture: %s%s", path, v->settled ? "" : " (not settled yet)");
        } else {
            view_complain(v, "%s", reason.message);
        }
    }
    free(rgba);
    return true;
}

/* Adds a text to a command line, quoted if a shell would take it apart. Cut where the line ends. */
static void add_word(char *line, size_t size_bytes, const char *text)
{
    size_t length = strlen(line);
    bool is_plain = *text && strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/@%") ==
                                 strlen(text);
    if (is_plain) {
        snprintf(line + length, size_bytes - length, " %s", text);
        return;
    }
    snprintf(line + length, size_bytes - length, " '");
    for (; *text; text++) {
        length = strlen(line);
        snprintf(line + length, size_bytes - length, *text == '\'' ? "'\\''" : "%c", *text);
    }
    length = strlen(line);
    snprintf(line + length, size_bytes - length, "'");
}

/* The place, and what of the world is not as its file says. */
void view_copy_command(viewer *v)
{
    char camera[512], word[640], *line = v->capture.copied;
    const size_t size_bytes = sizeof v->capture.copied;
    const view_settings *o = &v->settings;
    karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), camera, sizeof camera);
    snprintf(line, size_bytes, "karst render");
    add_word(line, size_bytes, v->world);
    snprintf(word, sizeof word, " --camera %s", camera);
    strncat(line, word, size_bytes - strlen(line) - 1);
    if (o->has_seed) {
        snprintf(word, sizeof word, " --seed %llu", (unsigned long long)o->seed);
        strncat(line, word, size_bytes - strlen(line) - 1);
    }
    const karst_sun sun = karst_engine_get_sun(v->engine);
    if (karst_engine_has_own_sun(v->engine)) {
        snprintf(word, sizeof word, " --sun %.15g,%.15g", sun.azimuth_deg, sun.elevation_deg);
        strncat(line, word, size_bytes - strlen(line) - 1);
    }
    double stops;
    if (karst_engine_get_exposure(v->engine, &stops) == KARST_EXPOSURE_GIVEN) {
        snprintf(word, sizeof word, " --exposure %.15g", stops);
        strncat(line, word, size_bytes - strlen(line) - 1);
    }
    if (karst_engine_time(v->engine) != 0) {
        snprintf(word, sizeof word, " --time %.15g", karst_engine_time(v->engine));
        strncat(line, word, size_bytes - strlen(line) - 1);
    }
    for (int i = 0; i < v->sliders.num_sliders; i++) {
        const view_slider *s = &v->sliders.sliders[i];
        if (s->value == s->original)
            continue;
        snprintf(word, sizeof word, " --param %s=%.17g", s->name, s->value);
        for (int digits = 1; digits < 17; digits++) { /* as short as says the same */
            char shorter[64];
            snprintf(shorter, sizeof shorter, "%.*g", digits, s->value);
            if (strtod(shorter, NULL) == s->value) {
                snprintf(word, sizeof word, " --param %s=%s", s->name, shorter);
                break;
            }
        }
        strncat(line, word, size_bytes - strlen(line) - 1);
    }
    glfwSetClipboardString(v->window, v->capture.copied);
    view_toast(v, "copied: %s", v->capture.copied);
}

/* ---- recording a path ---- */

static bool add_keyframe(viewer *v, double time_s)
{
    view_capture *c = &v->capture;
    if (c->num_keyframes == c->max_keyframes) {
        size_t max = c->max_keyframes ? 2 * c->max_keyframes : 256;
        void *more = realloc(c->keyframes, max * sizeof *c->keyframes);
        if (!more)
            return false;
        c->keyframes = more;
        c->max_keyframes = max;
    }
    c->keyframes[c->num_keyframes].time_s = time_s;
    c->keyframes[c->num_keyframes++].camera = v->motion.camera;
    c->recorded_at_s = v->now_s;
    return true;
}

void view_record_step(viewer *v)
{
    view_capture *c = &v->capture;
    if (!c->recording || v->now_s - c->recorded_at_s < KEYFRAME_EVERY_S)
        return;
    if (!add_keyframe(v, v->now_s - c->record_start_s)) {
        c->recording = false;
        view_complain(v, "out of memory for the path; it ends here");
        view_record_save(v);
    }
}

static json_t *describe_keyframe(const viewer *v, double time_s, const karst_camera *camera)
{
    char text[3][192];
    for (int axis = 0; axis < 3; axis++)
        karst_coordinate_format(camera->position.voxel[axis], camera->position.fraction[axis],
                                karst_engine_voxel_log2_m(v->engine), text[axis], sizeof text[axis]);
    return json_pack("{s:f, s:[s,s,s], s:f, s:f, s:f}", "time", time_s, "position", text[0], text[1], text[2], "yaw",
                     camera->yaw_deg, "pitch", camera->pitch_deg, "fov", camera->fov_deg);
}

bool view_record_save(viewer *v)
{
    view_capture *c = &v->capture;
    karst_error error = {0};
    char path[PATH_MAX];
    if (!c->num_keyframes)
        return false;
    json_t *frames = json_array();
    for (size_t i = 0; i < c->num_keyframes; i++)
        json_array_append_new(frames, describe_keyframe(v, c->keyframes[i].time_s, &c->keyframes[i].camera));
    json_t *root = json_pack("{s:s, s:s, s:s, s:o}", "description", "recorded in the viewer", "world", v->world,
                             "interpolation", "smooth", "keyframes", frames);
    char *text = root ? json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(12)) : NULL;
    bool saved = text ? view_number_file(v, "json", path, &error) && command_write_text(path, text, &error)
                      : karst_fail(&error, KARST_FAILED, "out of memory for the path");
    if (saved)
        snprintf(c->path_file, sizeof c->path_file, "%s", path);
    if (v->window && saved)
        view_toast(v, "path: %s", path);
    else if (saved)
        command_say(v->talk, "path: %s", path);
    else
        view_complain(v, "%s", error.message);
    free(text);
    json_decref(root);
    c->num_keyframes = 0;
    return saved;
}

void view_record_toggle(viewer *v)
{
    view_capture *c = &v->capture;
    if (c->recording) {
        c->recording = false;
        if (v->now_s - c->recorded_at_s > 1e-3)
            add_keyframe(v, v->now_s - c->record_start_s);
        view_record_save(v);
        return;
    }
    view_replay_stop(v);
    c->num_keyframes = 0;
    c->record_start_s = v->now_s;
    c->recording = add_keyframe(v, 0);
    view_toast(v, "recording a path; F6 ends it");
}

/* ---- replaying one ---- */

bool view_replay_start(viewer *v, const char *file, karst_error *error)
{
    view_capture *c = &v->capture;
    karst_path *path = karst_path_load(file, karst_engine_voxel_log2_m(v->engine), error);
    if (!path)
        return false;
    view_replay_stop(v);
    c->path = path;
    c->replay_start_s = -1; /* with the next frame */
    view_toast(v, "flying along %s, %.0f s; F7 stops", file, karst_path_end_s(path) - karst_path_start_s(path));
    return true;
}

void view_replay_stop(viewer *v)
{
    karst_path_destroy(v->capture.path);
    v->capture.path = NULL;
}

bool view_replay_step(viewer *v)
{
    view_capture *c = &v->capture;
    if (!c->path)
        return false;
    if (c->replay_start_s < 0)
        c->replay_start_s = v->now_s;
    double time_s = karst_path_start_s(c->path) + v->now_s - c->replay_start_s;
    karst_camera camera = karst_path_sample(c->path, time_s);
    view_set_camera(v, &camera);
    c->replay_s = time_s;
    if (time_s >= karst_path_end_s(c->path)) {
        view_replay_stop(v);
        v->leaving = v->leaving || c->replay_only;
    }
    return true;
}

/* ---- video ---- */

void view_video_stop(viewer *v)
{
    view_capture *c = &v->capture;
    karst_error error = {0};
    if (!c->video)
        return;
    bool finished = command_pictures_finish(c->video, &error);
    c->video = NULL;
    if (!finished)
        view_complain(v, "%s", error.message);
    else if (v->window)
        view_toast(v, "video: %s, %zu pictures", c->video_file, c->num_video_pictures);
}

void view_video_toggle(viewer *v)
{
    view_capture *c = &v->capture;
    karst_error error = {0};
    if (c->video) {
        view_video_stop(v);
        return;
    }
    if (view_number_file(v, "mp4", c->video_file, &error) &&
        command_pictures_check(c->video_file, false, v->width_px, v->height_px, &error))
        c->video = command_pictures_open(c->video_file, v->width_px, v->height_px, VIDEO_FPS, &error);
    if (!c->video) {
        view_complain(v, "%s", error.message);
        return;
    }
    c->video_size_px[0] = v->width_px;
    c->video_size_px[1] = v->height_px;
    c->video_start_s = v->now_s;
    c->num_video_pictures = 0;
    view_toast(v, "recording a video of %dx%d, all pixels; F8 ends it", v->width_px, v->height_px);
}

/* As many pictures as the clock says, so that the video runs as fast as the flight did. */
bool view_video_step(viewer *v, karst_error *error)
{
    view_capture *c = &v->capture;
    if (!c->video)
        return true;
    if (v->width_px != c->video_size_px[0] || v->height_px != c->video_size_px[1]) {
        view_video_stop(v);
        view_toast(v, "the window has another size: the video ends here");
        return true;
    }
    size_t due = (size_t)((v->now_s - c->video_start_s) * VIDEO_FPS) + 1;
    if (due <= c->num_video_pictures || v->stats.num_pixels != (uint64_t)v->width_px * (uint64_t)v->height_px)
        return true;
    uint8_t *rgba = read_picture(v, error);
    karst_error reason = {0};
    bool added = rgba != NULL;
    while (added && c->num_video_pictures < due)
        added = command_pictures_add(c->video, c->num_video_pictures++, v->engine, rgba, &reason);
    free(rgba);
    if (!rgba)
        return false;
    if (!added) {
        command_pictures_discard(c->video);
        c->video = NULL;
        view_complain(v, "%s", reason.message);
    }
    return true;
}

/* ---- statistics ---- */

/* Where they are, in pixels of the window: left, top, width, height. */
static json_t *describe_panels(const viewer *v)
{
    static const char *const names[VIEW_NUM_PANELS] = {"outline", "status", "page", "sliders", "error",  "prompt",
                                                       "toast",   "cross",  "help", "compass", "depth"};
    json_t *panels = json_object();
    for (int i = 0; i < VIEW_NUM_PANELS; i++) {
        const view_panel *p = &v->overlay.panels[i];
        if (p->shown)
            json_object_set_new(panels, names[i], json_pack("[i,i,i,i]", p->x, p->y, p->width, p->height));
    }
    return panels;
}

static void describe_edits(viewer *v, json_t *o)
{
    const view_edits *e = &v->edits;
    size_t redoable, num = karst_engine_num_edits(v->engine, &redoable), unsaved = view_edits_num_unsaved(v);
    json_object_set_new(o, "tool", json_string(view_tool_names[e->brush.tool]));
    json_object_set_new(o, "brush_size_m", json_real(e->brush.size_m));
    json_object_set_new(o, "brush_strength", json_real(e->brush.strength));
    json_object_set_new(o, "edits", json_integer((json_int_t)num));
    json_object_set_new(o, "redoable_edits", json_integer((json_int_t)redoable));
    json_object_set_new(o, "unsaved_edits", json_integer((json_int_t)unsaved));
    json_object_set_new(o, "edits_saved", json_boolean(e->journal && view_journal_look(e->journal).is_saved));
    json_object_set_new(o, "world", json_string(v->world));
}

static json_t *describe_viewer(viewer *v)
{
    char camera[512];
    karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), camera, sizeof camera);
    json_t *o = json_object(), *parameters = json_object();
    json_object_set_new(o, "camera", json_string(camera));
    json_object_set_new(o, "mode", json_string(view_mode_names[v->motion.mode]));
    json_object_set_new(o, "speed_m_s", json_real(v->motion.speed_m_s));
    json_object_set_new(o, "asked_speed_m_s", json_real(v->motion.asked_speed_m_s));
    json_object_set_new(o, "on_ground", json_boolean(v->motion.on_ground));
    const karst_sun sun = karst_engine_get_sun(v->engine);
    double stops;
    const bool is_given = karst_engine_get_exposure(v->engine, &stops) == KARST_EXPOSURE_GIVEN;
    json_object_set_new(o, "sun_azimuth_deg", json_real(sun.azimuth_deg));
    json_object_set_new(o, "sun_elevation_deg", json_real(sun.elevation_deg));
    json_object_set_new(o, "exposure_stops", is_given ? json_real(stops) : json_null());
    json_object_set_new(o, "status", json_string(v->status));
    json_object_set_new(o, "view", json_string(karst_view_name(v->view)));
    json_object_set_new(o, "page", json_string(view_page_names[v->page]));
    json_object_set_new(o, "help", json_boolean(v->help_shown));
    json_object_set_new(o, "prompt", json_boolean(v->prompt_shown));
    json_object_set_new(o, "sliders", json_boolean(v->sliders.shown));
    json_object_set_new(o, "mouse_captured", json_boolean(v->captured));
    json_object_set_new(o, "fullscreen", json_boolean(v->fullscreen));
    json_object_set_new(o, "fixed_resolution", json_boolean(v->settings.fixed_resolution));
    json_object_set_new(o, "share_of_side", json_real((double)v->resolution.share / VIEW_FULL_SHARE));
    json_object_set_new(o, "settled", json_boolean(v->settled));
    json_object_set_new(o, "reloads", json_integer(v->reload.num_reloads));
    json_object_set_new(o, "colours_at_once", json_integer(v->reload.num_at_once));
    json_object_set_new(o, "reload_errors", json_integer(v->reload.num_errors));
    json_object_set_new(o, "error", json_string(v->reload.error));
    json_object_set_new(o, "message", json_string(v->toast));
    json_object_set_new(o, "pictures", json_integer(v->capture.num_pictures));
    json_object_set_new(o, "last_picture", json_string(v->capture.last_file));
    json_object_set_new(o, "recording", json_boolean(v->capture.recording));
    json_object_set_new(o, "replaying", json_boolean(v->capture.path != NULL));
    json_object_set_new(o, "video", json_boolean(v->capture.video != NULL));
    json_object_set_new(o, "copied", json_string(v->capture.copied));
    json_object_set_new(o, "fps", json_real(v->settings.fps));
    json_object_set_new(o, "window", json_pack("[i,i]", v->width_px, v->height_px));
    json_object_set_new(o, "panels", describe_panels(v));
    json_object_set_new(o, "full_after_s", json_real(v->full_after_s));
    json_object_set_new(o, "sharp_after_s", json_real(v->sharp_after_s));
    json_object_set_new(o, "settled_after_s", json_real(v->settled_after_s));
    json_object_set_new(o, "compiling", json_boolean(v->reload.running));
    json_object_set_new(o, "reload_s", json_real(v->reload.last_s));
    json_object_set_new(o, "frames_while_compiling", json_integer((json_int_t)v->reload.num_frames));
    json_object_set_new(o, "longest_while_compiling_ms", json_real(v->reload.longest_ms));
    json_object_set_new(o, "frames_late", json_integer((json_int_t)v->num_late));
    json_object_set_new(o, "frames_moving", json_integer((json_int_t)v->num_moving));
    json_object_set_new(o, "first_frame_s", json_real(v->first_frame_s));
    json_object_set_new(o, "hit_level", v->probe.hit ? json_integer(v->probe.level) : json_null());
    json_object_set_new(o, "hit_depth_m", v->probe.hit ? json_real(v->probe.depth_m) : json_null());
    for (int i = 0; i < v->sliders.num_sliders; i++)
        json_object_set_new(parameters, v->sliders.sliders[i].name, json_real(v->sliders.sliders[i].value));
    json_object_set_new(o, "parameters", parameters);
    describe_edits(v, o);
    return o;
}

bool view_statistics_write(viewer *v, const char *file, karst_error *error)
{
    command_record *record = &v->capture.record;
    record->world = v->world;
    karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), record->camera, sizeof record->camera);
    record->display = karst_display_kind_name(karst_display_get_kind(v->display));
    record->display_description = karst_display_description(v->display);
    record->width_px = v->width_px;
    record->height_px = v->height_px;
    record->live = true;
    record->path = v->settings.replay;
    record->settled = v->settled;
    record->elapsed_ns = (uint64_t)(v->now_s * 1e9);
    char *text = command_record_json(record);
    json_t *root = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    text = NULL;
    if (root) {
        json_object_set_new(root, "viewer", describe_viewer(v));
        text = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
        json_decref(root);
    }
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory for the statistics");
    bool written = command_write_text(file, text, error);
    free(text);
    return written;
}
