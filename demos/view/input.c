/* Keys and mouse: what each does. */
#include "demos/view/view.h"

#include <math.h>
#include <string.h>

#define ANY (-1)
#define SHIFT GLFW_MOD_SHIFT
#define CTRL GLFW_MOD_CONTROL
#define LOOK_DEG_PER_S 60.0
#define LEAVE_WITHIN_S 3.0
#define SPEED_STEPS_PER_DECADE 8.0

/* ---- what keys do ---- */

/* A view that is compiled now takes a second: until it is there, the old one's name stands, and a word of it. */
static void change_view(viewer *v, int by)
{
    karst_view view = v->view;
    karst_error error;
    bool shown;
    do { /* past what a picture has none of, such as occlusion */
        view = (karst_view)(((int)view + by + KARST_NUM_VIEWS) % KARST_NUM_VIEWS);
        error = (karst_error){0};
        if (view != KARST_VIEW_PICTURE && !v->has_shown_view[view])
            view_show_message(v, "view: %s is being compiled\u2026", karst_view_name(view));
        shown = karst_engine_set_view(v->engine, view, &error);
    } while (!shown && error.status == KARST_USAGE);
    if (shown) {
        v->view = view;
        v->has_shown_view[view] = true;
        view_toast(v, view == KARST_VIEW_DEPTH ? "view: %s; bright near, dark far, by the scale above the status"
                                               : "view: %s", karst_view_name(view));
    } else {
        karst_engine_set_view(v->engine, v->view, NULL);
        view_complain(v, "%s", error.message);
    }
    v->settled = false;
}

static void change_speed(viewer *v, double steps)
{
    double speed = v->motion.speed_m_s * pow(10, steps / SPEED_STEPS_PER_DECADE);
    v->motion.speed_m_s = fmin(VIEW_MAX_SPEED_M_S, fmax(VIEW_MIN_SPEED_M_S, speed));
    v->hud_dirty = true;
}

static void change_fov(viewer *v, double factor)
{
    karst_camera camera = v->motion.camera;
    camera.fov_deg = fmin(170, fmax(0.001, camera.fov_deg * factor));
    view_set_camera(v, &camera);
}

#define TIME_STEP_S 0.1
#define SUN_STEP_DEG 1.0
#define SUN_ROUND_STEP_DEG 3.0

/* Both 0: as the world says. */
static void move_sun(viewer *v, double round_deg, double up_deg)
{
    karst_sun sun = karst_engine_get_sun(v->engine);
    sun.azimuth_deg = fmod(sun.azimuth_deg + round_deg + 360, 360);
    sun.elevation_deg = fmin(90, fmax(-90, sun.elevation_deg + up_deg));
    karst_engine_set_sun(v->engine, round_deg == 0 && up_deg == 0 ? NULL : &sun, NULL);
    sun = karst_engine_get_sun(v->engine);
    v->settled = false;
    view_toast(v, "sun: azimuth %g, elevation %g degrees", sun.azimuth_deg, sun.elevation_deg);
}

#define EXPOSURE_STEPS_PER_STOP 3

/* by: a third of a stop up or down from what was given, or from 0 stops; 0: as the world says. */
static void change_exposure(viewer *v, int by)
{
    double stops;
    karst_error error = {0};
    const bool is_given = karst_engine_get_exposure(v->engine, &stops) == KARST_EXPOSURE_GIVEN;
    stops = (round((is_given ? stops : 0) * EXPOSURE_STEPS_PER_STOP) + by) / EXPOSURE_STEPS_PER_STOP;
    stops = fmin(KARST_ENGINE_MAX_EXPOSURE, fmax(-KARST_ENGINE_MAX_EXPOSURE, stops));
    if (!karst_engine_set_exposure(v->engine, by ? KARST_EXPOSURE_GIVEN : KARST_EXPOSURE_OF_WORLD, by ? stops : 0,
                                   &error)) {
        view_complain(v, "%s", error.message);
        return;
    }
    v->settled = false;
    if (by)
        view_toast(v, "exposure: %+.2f stops", stops);
    else
        view_toast(v, "exposure: as the world says");
}

/* By a way of the mouse: as far as the same way would turn the camera. */
static void drag_sun(viewer *v, double x_px, double y_px)
{
    const double deg_per_px = v->motion.camera.fov_deg / v->height_px;
    if (x_px != 0 || y_px != 0)
        move_sun(v, x_px * deg_per_px, -y_px * deg_per_px);
}

static void go_to_bookmark(viewer *v, int number)
{
    karst_camera camera = v->motion.camera;
    karst_error error = {0};
    const char *text = v->memory.bookmarks[number];
    if (!*text)
        view_complain(v, "there is no bookmark %d; Ctrl+%d keeps this place as one", number + 1, number + 1);
    else if (!karst_camera_parse(text, karst_engine_voxel_log2_m(v->engine), &camera, &error))
        view_complain(v, "%s", error.message);
    else
        view_set_camera(v, &camera);
}

static void keep_bookmark(viewer *v, int number)
{
    karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), v->memory.bookmarks[number],
                        sizeof v->memory.bookmarks[number]);
    view_memory_write(v);
    view_toast(v, "bookmark %d is here", number + 1);
}

static void escape(viewer *v)
{
    if (v->captured) {
        view_window_capture(v, false);
    } else if (v->help_shown) {
        v->help_shown = false;
    } else if (v->sliders.shown) {
        v->sliders.shown = false;
    } else if (v->edits.brush.tool != VIEW_NO_TOOL) {
        view_brush_put_away(v);
    } else if (v->now_s < v->asked_to_leave_s + LEAVE_WITHIN_S) {
        v->leaving = true;
    } else {
        v->asked_to_leave_s = v->now_s;
        if (!view_edits_warn(v))
            view_toast(v, "Esc once more leaves");
    }
}

static void write_statistics(viewer *v)
{
    char file[PATH_MAX];
    karst_error error = {0};
    if (v->settings.stats)
        snprintf(file, sizeof file, "%s", v->settings.stats);
    else if (!view_statistics_number(v, file, &error))
        file[0] = 0;
    if (!*file || !view_statistics_write(v, file, &error))
        view_complain(v, "%s", error.message);
    else if (!v->settings.stats) /* who named the file knows it */
        view_toast(v, "statistics: %s", file);
}

static void toggle_replay(viewer *v)
{
    karst_error error = {0};
    if (v->capture.path)
        view_replay_stop(v);
    else if (!*v->capture.path_file)
        view_complain(v, "no path was recorded yet; F6 records one");
    else if (!view_replay_start(v, v->capture.path_file, &error))
        view_complain(v, "%s", error.message);
}

static void open_prompt(viewer *v, bool is_world, int mods)
{
    v->prompt_shown = true;
    v->prompt_is_world = is_world;
    v->prompt_skips = is_world && !(mods & (CTRL | GLFW_MOD_ALT | GLFW_MOD_SUPER));
    v->prompt[0] = v->prompt_error[0] = 0;
    view_release_all(v);
}

static void do_sliders(viewer *v, view_action action, int number)
{
    switch (action) {
    case VIEW_DO_SLIDER_UP:
    case VIEW_DO_SLIDER_DOWN:
        if (v->sliders.shown && v->sliders.num_sliders) {
            int by = action == VIEW_DO_SLIDER_UP ? v->sliders.num_sliders - 1 : 1;
            v->sliders.chosen = (v->sliders.chosen + by) % v->sliders.num_sliders;
        }
        break;
    case VIEW_DO_SLIDER_LESS:
    case VIEW_DO_SLIDER_MORE:
        if (v->sliders.shown)
            view_sliders_step(v, action == VIEW_DO_SLIDER_MORE ? 1 : -1, number);
        break;
    case VIEW_DO_SLIDER_RESET:
        if (v->sliders.shown && v->sliders.num_sliders)
            view_sliders_set(v, v->sliders.chosen, v->sliders.sliders[v->sliders.chosen].original);
        break;
    case VIEW_DO_SLIDER_RESET_ALL:
        for (int i = 0; v->sliders.shown && i < v->sliders.num_sliders; i++)
            view_sliders_set(v, i, v->sliders.sliders[i].original);
        break;
    default:
        break;
    }
}

static void do_edits(viewer *v, view_action action)
{
    switch (action) {
    case VIEW_DO_NEXT_TOOL:
    case VIEW_DO_PREVIOUS_TOOL:
        view_brush_choose(v, action == VIEW_DO_NEXT_TOOL ? 1 : -1);
        break;
    case VIEW_DO_NEXT_KIND:
    case VIEW_DO_PREVIOUS_KIND:
        view_brush_vary(v, action == VIEW_DO_NEXT_KIND ? 1 : -1);
        break;
    case VIEW_DO_UNDO:
    case VIEW_DO_REDO:
        view_edits_undo(v, action == VIEW_DO_UNDO);
        break;
    case VIEW_DO_KEEP_EDITS:
        view_brush_lift(v);
        view_edits_keep(v);
        break;
    default:
        break;
    }
}

void view_do(viewer *v, view_action action, int number)
{
    v->hud_dirty = true;
    switch (action) {
    case VIEW_DO_NOTHING:
        break;
    case VIEW_DO_HELP:
        v->help_shown = !v->help_shown;
        break;
    case VIEW_DO_ESCAPE:
        escape(v);
        break;
    case VIEW_DO_PAGE:
        v->page = (view_page)((v->page + 1) % VIEW_NUM_PAGES);
        break;
    case VIEW_DO_SLIDERS:
        if (v->sliders.num_sliders)
            v->sliders.shown = !v->sliders.shown;
        else
            view_complain(v, "the world %s has no parameters", v->world);
        break;
    case VIEW_DO_NEXT_VIEW:
        change_view(v, 1);
        break;
    case VIEW_DO_PREVIOUS_VIEW:
        change_view(v, -1);
        break;
    case VIEW_DO_MODE:
        view_set_mode(v, (view_mode)((v->motion.mode + 1) % VIEW_NUM_MODES));
        break;
    case VIEW_DO_MOUSE:
        view_window_capture(v, !v->captured);
        break;
    case VIEW_DO_FASTER:
        change_speed(v, 1);
        break;
    case VIEW_DO_SLOWER:
        change_speed(v, -1);
        break;
    case VIEW_DO_WIDER:
        change_fov(v, 1.1);
        break;
    case VIEW_DO_NARROWER:
        change_fov(v, 1 / 1.1);
        break;
    case VIEW_DO_SUN_HIGHER:
    case VIEW_DO_SUN_LOWER:
        move_sun(v, 0, action == VIEW_DO_SUN_HIGHER ? SUN_STEP_DEG : -SUN_STEP_DEG);
        break;
    case VIEW_DO_SUN_EAST:
    case VIEW_DO_SUN_WEST:
        move_sun(v, action == VIEW_DO_SUN_EAST ? SUN_ROUND_STEP_DEG : -SUN_ROUND_STEP_DEG, 0);
        break;
    case VIEW_DO_SUN_RESET:
        move_sun(v, 0, 0);
        break;
    case VIEW_DO_BRIGHTER:
    case VIEW_DO_DARKER:
        change_exposure(v, action == VIEW_DO_BRIGHTER ? 1 : -1);
        break;
    case VIEW_DO_EXPOSURE_RESET:
        change_exposure(v, 0);
        break;
    case VIEW_DO_TIME:
        view_time_toggle(v);
        break;
    case VIEW_DO_TIME_EARLIER:
    case VIEW_DO_TIME_LATER:
        view_time_step(v, action == VIEW_DO_TIME_EARLIER ? -TIME_STEP_S : TIME_STEP_S);
        break;
    case VIEW_DO_TIME_RESET:
        view_time_step(v, 0);
        break;
    case VIEW_DO_HOME: {
        karst_camera home = karst_engine_default_camera(v->engine);
        view_set_camera(v, &home);
        break;
    }
    case VIEW_DO_GO_TO:
        open_prompt(v, false, number);
        break;
    case VIEW_DO_OPEN:
        open_prompt(v, true, number);
        break;
    case VIEW_DO_COPY:
        view_copy_command(v);
        break;
    case VIEW_DO_BOOKMARK:
        go_to_bookmark(v, number);
        break;
    case VIEW_DO_KEEP_BOOKMARK:
        keep_bookmark(v, number);
        break;
    case VIEW_DO_RESOLUTION:
        v->settings.fixed_resolution = !v->settings.fixed_resolution;
        view_toast(v, v->settings.fixed_resolution ? "always all pixels" : "fewer pixels while moving, for %.0f fps",
                   v->settings.fps);
        break;
    case VIEW_DO_FULLSCREEN:
        view_window_fullscreen(v, !v->fullscreen);
        break;
    case VIEW_DO_SAVE_WORLD:
        view_sliders_save(v);
        break;
    case VIEW_DO_STATISTICS:
        write_statistics(v);
        break;
    case VIEW_DO_RELOAD: {
        bool changed;
        karst_error error = {0};
        if (!v->is_file)
            view_complain(v, "the world %s is part of Karst: there is no file to read again", v->world);
        else if (!view_reload_step(v, true, &changed, &error))
            view_complain(v, "%s", error.message);
        break;
    }
    case VIEW_DO_RECORD:
        view_record_toggle(v);
        break;
    case VIEW_DO_REPLAY:
        toggle_replay(v);
        break;
    case VIEW_DO_VIDEO:
        view_video_toggle(v);
        break;
    case VIEW_DO_PICTURE:
        v->capture.want_png = true;
        break;
    case VIEW_DO_PICTURE_EXR:
        v->capture.want_exr = true;
        break;
    case VIEW_DO_SLIDER_UP:
    case VIEW_DO_SLIDER_DOWN:
    case VIEW_DO_SLIDER_LESS:
    case VIEW_DO_SLIDER_MORE:
    case VIEW_DO_SLIDER_RESET:
    case VIEW_DO_SLIDER_RESET_ALL:
        do_sliders(v, action, number);
        break;
    case VIEW_DO_NEXT_TOOL:
    case VIEW_DO_PREVIOUS_TOOL:
    case VIEW_DO_NEXT_KIND:
    case VIEW_DO_PREVIOUS_KIND:
    case VIEW_DO_UNDO:
    case VIEW_DO_REDO:
    case VIEW_DO_KEEP_EDITS:
        do_edits(v, action);
        break;
    }
}

/* ---- the prompt ---- */

static void run_prompt(viewer *v)
{
    if (v->prompt_is_world) {
        v->prompt_shown = false;
        view_open_wish(v, v->prompt);
        return;
    }
    /* Three numbers are a place: angles stay. */
    char text[sizeof v->prompt + 64];
    int commas = 0;
    for (const char *p = v->prompt; *p; p++)
        commas += *p == ',';
    if (commas == 2)
        snprintf(text, sizeof text, "%s,%.17g,%.17g", v->prompt, v->motion.camera.yaw_deg, v->motion.camera.pitch_deg);
    else
        snprintf(text, sizeof text, "%s", v->prompt);
    karst_camera camera = v->motion.camera;
    karst_error error = {0};
    if (karst_camera_parse(text, karst_engine_voxel_log2_m(v->engine), &camera, &error)) {
        v->prompt_shown = false;
        view_set_camera(v, &camera);
    } else {
        snprintf(v->prompt_error, sizeof v->prompt_error, "%.250s", error.message);
    }
}

static void append_to_prompt(viewer *v, const char *text)
{
    size_t length = strlen(v->prompt);
    for (; *text && length + 1 < sizeof v->prompt; text++)
        if (v->prompt_is_world ? (unsigned char)*text >= ' ' && *text != 127 : !!strchr("0123456789+-.,eE ", *text))
            v->prompt[length++] = *text;
    v->prompt[length] = 0;
}

/* A character may have several bytes. */
static void erase_from_prompt(viewer *v)
{
    size_t length = strlen(v->prompt);
    while (length && ((unsigned char)v->prompt[--length] & 0xc0) == 0x80)
        continue;
    v->prompt[length] = 0;
}

static void prompt_key(viewer *v, int key, int mods)
{
    v->hud_dirty = true;
    if (key == GLFW_KEY_ESCAPE) {
        v->prompt_shown = false;
    } else if (key == GLFW_KEY_ENTER || key == GLFW_KEY_KP_ENTER) {
        run_prompt(v);
    } else if (key == GLFW_KEY_BACKSPACE) {
        erase_from_prompt(v);
    } else if (key == GLFW_KEY_V && mods & CTRL) {
        const char *text = glfwGetClipboardString(v->window);
        append_to_prompt(v, text ? text : "");
    }
}

void view_char_event(viewer *v, unsigned codepoint)
{
    bool skips = v->prompt_skips;
    v->prompt_skips = false;
    if (!v->prompt_shown || skips)
        return;
    char text[5] = {0};
    if (codepoint < 0x80) {
        text[0] = (char)codepoint;
    } else {
        int num_more = codepoint < 0x800 ? 1 : codepoint < 0x10000 ? 2 : 3;
        text[0] = (char)(0xf00 >> num_more | codepoint >> 6 * num_more);
        for (int i = 1; i <= num_more; i++)
            text[i] = (char)(0x80 | (codepoint >> 6 * (num_more - i) & 0x3f));
    }
    append_to_prompt(v, text);
    v->prompt_error[0] = 0;
    v->hud_dirty = true;
}

/* ---- events ---- */

static bool is_arrow(int key)
{
    return key == GLFW_KEY_LEFT || key == GLFW_KEY_RIGHT || key == GLFW_KEY_UP || key == GLFW_KEY_DOWN;
}

static bool repeats(view_action action)
{
    return action == VIEW_DO_FASTER || action == VIEW_DO_SLOWER || action == VIEW_DO_WIDER ||
           action == VIEW_DO_NARROWER || action == VIEW_DO_UNDO || action == VIEW_DO_REDO ||
           (action >= VIEW_DO_SUN_HIGHER && action <= VIEW_DO_SUN_WEST) ||
           action == VIEW_DO_BRIGHTER || action == VIEW_DO_DARKER ||
           (action >= VIEW_DO_SLIDER_UP && action <= VIEW_DO_SLIDER_MORE);
}

void view_key_event(viewer *v, int key, bool pressed, bool repeated, int mods)
{
    mods &= SHIFT | CTRL | GLFW_MOD_ALT | GLFW_MOD_SUPER;
    if (key < 0 || key > GLFW_KEY_LAST)
        return;
    double now_s = glfwGetTime();
    if (!pressed) {
        if (v->key_down_s[key] >= 0) /* a tap between two frames counts as a moment too */
            v->key_held_s[key] += fmax(now_s - v->key_down_s[key], 1.0 / 60);
        v->key_down_s[key] = -1;
        return;
    }
    if (!v->engine)
        return;
    if (v->prompt_shown) {
        prompt_key(v, key, mods);
        return;
    }
    bool for_sliders = v->sliders.shown && is_arrow(key);
    if (!repeated && !for_sliders)
        v->key_down_s[key] = now_s;
    if (key >= GLFW_KEY_1 && key <= GLFW_KEY_9 && !repeated)
        view_do(v, mods & CTRL ? VIEW_DO_KEEP_BOOKMARK : VIEW_DO_BOOKMARK, key - GLFW_KEY_1);
    for (size_t i = 0; i < view_num_keys; i++)
        for (size_t k = 0; k < sizeof view_keys[i].keys / sizeof *view_keys[i].keys && view_keys[i].keys[k].key; k++) {
            int wanted = view_keys[i].keys[k].mods;
            view_action action = view_keys[i].keys[k].action;
            if (view_keys[i].keys[k].key == key && (wanted == ANY || wanted == mods) && (!repeated || repeats(action)))
                view_do(v, action, mods);
        }
}

void view_release_all(viewer *v)
{
    for (int key = 0; key <= GLFW_KEY_LAST; key++) {
        v->key_down_s[key] = -1;
        v->key_held_s[key] = 0;
    }
    v->dragging = v->is_dragging_sun = false;
    v->sliders.dragged = -1;
    view_brush_lift(v);
}

void view_button_event(viewer *v, int button, bool pressed, int mods)
{
    (void)mods;
    if (!v->engine)
        return;
    if (button == GLFW_MOUSE_BUTTON_RIGHT && pressed)
        view_window_capture(v, !v->captured);
    if (button == GLFW_MOUSE_BUTTON_MIDDLE) {
        v->is_dragging_sun = pressed;
        v->has_cursor = false;
    }
    if (button != GLFW_MOUSE_BUTTON_LEFT)
        return;
    if (!pressed) {
        v->dragging = false;
        v->sliders.dragged = -1;
        view_brush_release(v);
    } else if (v->help_shown) {
        v->help_shown = false;
        v->hud_dirty = true;
    } else if (!view_sliders_press(v, v->cursor_x_px, v->cursor_y_px)) {
        v->dragging = true;
        v->has_cursor = false;
        if (v->edits.brush.tool != VIEW_NO_TOOL)
            view_brush_press(v);
    }
}

void view_cursor_event(viewer *v, double x_px, double y_px)
{
    if (v->sliders.dragged >= 0)
        view_sliders_drag(v, x_px);
    else if (v->is_dragging_sun && v->has_cursor && v->engine)
        drag_sun(v, x_px - v->cursor_x_px, y_px - v->cursor_y_px);
    else if ((v->dragging || v->captured) && v->has_cursor && v->engine)
        view_look(v, x_px - v->cursor_x_px, y_px - v->cursor_y_px);
    v->cursor_x_px = x_px;
    v->cursor_y_px = y_px;
    v->has_cursor = true;
}

static bool is_held(const viewer *v, int left, int right)
{
    return v->key_down_s[left] >= 0 || v->key_down_s[right] >= 0;
}

void view_scroll_event(viewer *v, double steps)
{
    if (v->edits.brush.tool == VIEW_NO_TOOL || is_held(v, GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL))
        change_speed(v, steps);
    else if (is_held(v, GLFW_KEY_LEFT_SHIFT, GLFW_KEY_RIGHT_SHIFT))
        view_brush_strengthen(v, steps);
    else
        view_brush_resize(v, steps);
}
