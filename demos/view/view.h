/* The viewer: what its parts share. Names begin with view_; `viewer` is the whole.
 *
 *   view.c        karst view: options, opening and closing, the loop
 *   show.c        a picture into the window, and messages that are seen at once
 *   window.c      the window and what happens to it; what keys and mouse do goes on to input.c
 *   input.c       what each key does
 *   keys.c        the table of keys
 *   screen.c      the whole screen or a part of it; whose the mouse is
 *   world.c       the world on show
 *   motion.c      fly, walk, orbit: the camera, frame by frame
 *   walk.c        the ground under one's feet
 *   overlay.c     panels over the picture: cairo images as textures
 *   draw.c        type, panels, graphs and bars in cairo
 *   hud.c         what stands in the panels
 *   parameters.c  what sliders say goes to the engine and into the world's file
 *   sliders.c     the world's parameters
 *   reload.c      the world file changes: compiling beside the picture, and the change-over
 *   resolution.c  fewer pixels while things move
 *   capture.c     what one leaves with: pictures, paths, videos, statistics
 *   brush.c       tools that change the land under the cross-hair: choosing, the button, undo
 *   stroke.c      what tools lay, and how densely (no window, no engine: stroke.h)
 *   spot.c        the land under the cross-hair
 *   outline.c     where the chosen tool would touch
 *   edits.c       where edits go: into the saved world on show, or a new one
 *   journal.c     a thread that writes them into the file (no window, no engine: journal.h)
 *   number.c      names of files that are not there yet
 *   keep.c        what a saved world keeps of a visit
 *   messages.c    short messages
 *   settings.c    flags, environment, configuration; what is remembered
 */
#ifndef KARST_DEMOS_VIEW_H
#define KARST_DEMOS_VIEW_H

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <cairo/cairo.h>
#include <limits.h>
#include <pthread.h>

#include "demos/command/command.h"
#include "demos/view/journal.h"
#include "demos/view/stroke.h"

typedef struct viewer viewer;

/* ---- settings.c ---- */

typedef struct {
    const char *camera, *device, *replay, *stats, *folder, *view, *mode, *keys;
    command_parameters parameters;
    int size_px[2];
    bool has_size;
    uint64_t seed, budget_bricks, brick_bits, lanes;
    bool has_seed, no_shadows, fullscreen, fixed_resolution, hidden_hud, help;
    const char *edits;
    command_look look;
    double pool_mib, detail_px, view_distance_m, fps, speed_m_s, eye_m, scale, time_s;
} view_settings;

/* From flags over environment over the configuration file over defaults. Texts of the latter two live as long as the
 * program. Errors: KARST_USAGE, naming where it stands. */
bool view_settings_read(view_settings *settings, int argc, char **argv, command_talk *talk, const char **world,
                        karst_error *error);
void view_settings_print_help(void);

#define VIEW_NUM_BOOKMARKS 9
/* What is remembered from one run to the next, in $XDG_STATE_HOME/karst/view.json. Nothing fails if it cannot be read
 * or written: there is a remark. */
typedef struct {
    int size_px[2], position_px[2];
    bool has_window, fullscreen;
    int page;
    char bookmarks[VIEW_NUM_BOOKMARKS][320]; /* of this world; "": none */
} view_memory;
void view_memory_read(viewer *v);            /* but for bookmarks */
void view_memory_read_bookmarks(viewer *v);  /* of the world's text, whatever its file is called */
void view_memory_write(viewer *v);

/* ---- keep.c ---- */

/* Of a saved world: its bookmarks, instead of those remembered; and into it, bookmarks and camera, when one leaves. */
void view_saved_read(viewer *v);
void view_saved_write(viewer *v);

/* ---- overlay.c ---- */

typedef enum {
    VIEW_PANEL_OUTLINE,
    VIEW_PANEL_STATUS,
    VIEW_PANEL_PAGE,
    VIEW_PANEL_SLIDERS,
    VIEW_PANEL_ERROR,
    VIEW_PANEL_PROMPT,
    VIEW_PANEL_TOAST,
    VIEW_PANEL_CROSS,
    VIEW_PANEL_HELP,
    VIEW_PANEL_COMPASS,
    VIEW_PANEL_DEPTH,
    VIEW_NUM_PANELS
} view_panel_kind;

typedef struct {
    int x, y, width, height; /* framebuffer pixels, from the top left */
    bool shown;
    cairo_surface_t *image;
    unsigned texture;
    int texture_width, texture_height;
} view_panel;

typedef struct {
    struct view_gl *gl;
    unsigned program, vertices;
    int rectangle_place;
    view_panel panels[VIEW_NUM_PANELS];
} view_overlay;

/* Errors: KARST_NO_DEVICE (an OpenGL that lacks something). */
bool view_overlay_create(viewer *v, karst_error *error);
void view_overlay_destroy(viewer *v);
/* Draws into a panel anew: begin gives a clear image of width x height, end takes it. NULL: out of memory. */
cairo_t *view_panel_begin(viewer *v, view_panel_kind kind, int width, int height);
void view_panel_end(viewer *v, view_panel_kind kind, cairo_t *cairo, int x, int y);
void view_panel_hide(viewer *v, view_panel_kind kind);
/* Where panels begin that stand at the top: below the message about a mistake, if there is one. */
int view_hud_top(const viewer *v);
/* Clears the window (before any picture is there), and draws all panels that are shown. */
void view_overlay_clear(viewer *v);
void view_overlay_draw(viewer *v);
/* Whether OpenGL says that the context was lost. */
bool view_context_lost(viewer *v);

/* ---- draw.c ---- */

typedef enum { VIEW_TEXT, VIEW_TEXT_DIM, VIEW_TEXT_STRONG, VIEW_TEXT_BAD, VIEW_TEXT_MONO } view_style;
/* A rounded dark panel over the whole image. */
void view_draw_panel(cairo_t *cairo, double width, double height, double scale);
/* Text with its baseline at y; returns its width. align 0 left, 1 right, 0.5 centred at x. */
double view_draw_text(cairo_t *cairo, double x, double y, double size, double align, view_style style,
                      const char *text);
double view_text_width(cairo_t *cairo, double size, view_style style, const char *text);
/* A line of values (oldest first) in a box, from 0 to `top`; a guide at `mark` (below 0: none). */
void view_draw_graph(cairo_t *cairo, double x, double y, double width, double height, const double *values,
                     size_t num_values, double top, double mark, int hue);
/* A bar filled to `share`. */
void view_draw_bar(cairo_t *cairo, double x, double y, double width, double height, double share, int hue);
/* One of a few colours that go together. */
void view_set_hue(cairo_t *cairo, int hue, double alpha);
/* With a unit that keeps the figure short: "3.2 mm", "14 m", "5.2e+04 km". */
const char *view_format_length(double metres, const char *suffix, char text[48]);

/* ---- keys.c ---- */

typedef enum {
    VIEW_DO_NOTHING, /* keys that are held: motion.c asks for them */
    VIEW_DO_HELP,
    VIEW_DO_ESCAPE,
    VIEW_DO_PAGE,
    VIEW_DO_SLIDERS,
    VIEW_DO_NEXT_VIEW,
    VIEW_DO_PREVIOUS_VIEW,
    VIEW_DO_MODE,
    VIEW_DO_MOUSE,
    VIEW_DO_FASTER,
    VIEW_DO_SLOWER,
    VIEW_DO_WIDER,
    VIEW_DO_NARROWER,
    VIEW_DO_SUN_HIGHER,
    VIEW_DO_SUN_LOWER,
    VIEW_DO_SUN_EAST,
    VIEW_DO_SUN_WEST,
    VIEW_DO_SUN_RESET,
    VIEW_DO_BRIGHTER,
    VIEW_DO_DARKER,
    VIEW_DO_EXPOSURE_RESET,
    VIEW_DO_TIME,
    VIEW_DO_TIME_EARLIER,
    VIEW_DO_TIME_LATER,
    VIEW_DO_TIME_RESET,
    VIEW_DO_HOME,
    VIEW_DO_GO_TO,
    VIEW_DO_OPEN,
    VIEW_DO_COPY,
    VIEW_DO_BOOKMARK,
    VIEW_DO_KEEP_BOOKMARK,
    VIEW_DO_RESOLUTION,
    VIEW_DO_FULLSCREEN,
    VIEW_DO_SAVE_WORLD,
    VIEW_DO_NEXT_TOOL,
    VIEW_DO_PREVIOUS_TOOL,
    VIEW_DO_NEXT_KIND,
    VIEW_DO_PREVIOUS_KIND,
    VIEW_DO_UNDO,
    VIEW_DO_REDO,
    VIEW_DO_KEEP_EDITS,
    VIEW_DO_STATISTICS,
    VIEW_DO_RELOAD,
    VIEW_DO_RECORD,
    VIEW_DO_REPLAY,
    VIEW_DO_VIDEO,
    VIEW_DO_PICTURE,
    VIEW_DO_PICTURE_EXR,
    VIEW_DO_SLIDER_UP,
    VIEW_DO_SLIDER_DOWN,
    VIEW_DO_SLIDER_LESS,
    VIEW_DO_SLIDER_MORE,
    VIEW_DO_SLIDER_RESET,
    VIEW_DO_SLIDER_RESET_ALL
} view_action;

/* A line of the table of keys: the help in the window and in the manual are made of it. */
typedef struct {
    const char *section; /* the first line of a section names it; NULL: as above */
    const char *label;   /* of the keys, for people */
    const char *help;
    struct {
        int key, mods; /* GLFW's; mods -1: any */
        view_action action;
    } keys[10];
} view_key;
extern const view_key view_keys[];
extern const size_t view_num_keys;
void view_keys_print(FILE *file);        /* as text */
void view_keys_print_manual(FILE *file); /* as lines of a manual page */

/* ---- messages.c ---- */

/* Shows a short message for some seconds, and says it on the terminal. */
void view_toast(viewer *v, const char *format, ...) __attribute__((format(printf, 2, 3)));
void view_complain(viewer *v, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* ---- input.c ---- */

void view_do(viewer *v, view_action action, int number);
/* What the window hears. */
void view_key_event(viewer *v, int key, bool pressed, bool repeated, int mods);
void view_char_event(viewer *v, unsigned codepoint);
void view_button_event(viewer *v, int button, bool pressed, int mods);
void view_cursor_event(viewer *v, double x_px, double y_px);
void view_scroll_event(viewer *v, double steps);
void view_release_all(viewer *v);

/* ---- motion.c ---- */

typedef enum { VIEW_FLY, VIEW_WALK, VIEW_ORBIT, VIEW_NUM_MODES } view_mode;
extern const char *const view_mode_names[];

#define VIEW_MIN_SPEED_M_S 1e-3
#define VIEW_MAX_SPEED_M_S 1e9

typedef struct {
    view_mode mode;
    view_mode wished_mode; /* from the command line, until it can be taken; VIEW_FLY: none */
    karst_camera camera;
    double speed_m_s;
    double velocity_m_s[3];
    double asked_speed_m_s; /* by the keys, when last they asked for a way: what shift and ctrl make of speed_m_s */
    double fall_m_s; /* walking */
    bool on_ground;
    karst_position pivot; /* of the orbit */
    double pivot_distance_m;
    bool dirty;  /* the camera was set by something else than motion */
    bool looked; /* the last motion was the mouse's, of which one never knows whether it is over */
} view_motion;

void view_set_mode(viewer *v, view_mode mode);
void view_set_camera(viewer *v, const karst_camera *camera);

/* ---- clock.c ---- */

void view_time_toggle(viewer *v);              /* it runs from where it stands, or stands */
void view_time_step(viewer *v, double step_s); /* it stands, that much later; 0: where it began */
/* Of a turn of the loop that took dt_s: whether the world is at another time now. */
bool view_time_turn(viewer *v, double dt_s);

/* Turns by so many pixels of the mouse's way. */
void view_look(viewer *v, double x_px, double y_px);
/* Moves for dt seconds; true if the camera is not where it was. */
bool view_move(viewer *v, double dt_s);
bool view_gamepad_present(void);

/* ---- walk.c ---- */

/* A sampler of a world with the edits that it is shown with. Errors: as karst_sampler_create and karst_edits_load. */
karst_sampler *view_sampler_create(const viewer *v, karst_world *compiled, karst_error *error);
/* Gets ready to walk; false (and says why) if the world cannot be sampled. */
bool view_walk_begin(viewer *v);
/* Walks for dt seconds; true if the camera moved. */
bool view_walk(viewer *v, const double wish_m_s[3], bool jump, double dt_s);

/* ---- edits.c ---- */

typedef struct {
    view_brush brush;
    bool is_ready; /* the session has begun: what is below counts */
    /* the button */
    bool is_down, is_ending, is_open; /* is_ending: up again, but a click touches once; is_open: a stroke goes on */
    bool has_painted;
    view_stroke stroke_now;
    size_t num_frozen; /* edits of the land that it is on */
    karst_camera seen; /* where v->probe was looked from */
    bool is_seen;
    /* what was laid in this session, undone edits included; and how many edits each stroke has */
    karst_edit *edits;
    size_t num_edits, max_edits;
    size_t *strokes, stroke, num_strokes, max_strokes; /* `stroke` of them are in force */
    size_t num_before; /* edits in force before those */
    size_t num_begun;  /* and when the session began */
    int told;          /* of the file, last: 1 saved, 0 not yet, -1 not */
    view_journal *journal; /* NULL: edits stay in memory */
    char kept_in[PATH_MAX];
    bool is_warned;
} view_edits;

/* A session of edits begins, unless it has: a saved world on show is opened to be written. */
void view_edits_begin(viewer *v);
/* All edits on show, malloc'ed; and those that were undone, *num_undone of them, unless that is NULL. Errors:
 * KARST_FAILED. */
karst_edit *view_edits_all(const viewer *v, size_t *num, size_t *num_undone, karst_error *error);
/* In each turn of the loop: what is said of saving changes when that is done. */
void view_edits_notice(viewer *v);
size_t view_edits_num_unsaved(viewer *v); /* how many are on no disk */
/* A new saved world of what is on show, which is on show from then on. */
void view_edits_keep(viewer *v);
/* Before one leaves: says that edits would be lost, and true, if they would be. */
bool view_edits_warn(viewer *v);
/* When one leaves: all is written; what no file keeps goes into a new one, unless one was warned. */
void view_edits_finish(viewer *v);
void view_edits_close(viewer *v);
/* A line about the tool and what is saved; false: there is nothing to say. */
bool view_edits_describe(viewer *v, char *text, size_t size_bytes);

/* ---- spot.c ---- */

view_ground view_edits_ground(viewer *v);
/* While a button is down, spots are of the land that stroke began on: the sampler has it between these two. */
void view_edits_freeze(viewer *v);
void view_edits_thaw(viewer *v);
/* What is under the cross-hair of the last picture; false: sky, or nothing is known of the land. */
bool view_edits_find_spot(viewer *v, view_spot *spot);

/* ---- brush.c ---- */

void view_brush_choose(viewer *v, int by); /* the next tool, or the one before */
void view_brush_put_away(viewer *v);
void view_brush_resize(viewer *v, double steps);
void view_brush_strengthen(viewer *v, double steps);
void view_brush_vary(viewer *v, int by); /* another colour, another stamp */
void view_brush_press(viewer *v);
void view_brush_release(viewer *v);
void view_brush_lift(viewer *v); /* at once */
void view_brush_step(viewer *v); /* of a turn of the loop: lays what is due */
void view_edits_undo(viewer *v, bool back);

/* ---- outline.c ---- */

/* Draws where the tool in hand would touch, if there is one, over the picture of this camera. */
void view_outline_update(viewer *v);

/* ---- resolution.c ---- */

#define VIEW_FULL_SHARE 16 /* shares of the picture's sides are counted in sixteenths; never under half */
#define VIEW_LEAST_SHARE 8
typedef struct {
    int share;        /* given now */
    bool at_rest;     /* nothing has moved for a while */
    int moving_share; /* what was right when last moving */
    int calm_frames;  /* in a row with time to spare */
    double still_since_s;
    double cost_ns_px; /* of a pixel, smoothed */
    double other_ns;   /* of the rest of a frame, smoothed */
    double more_use;   /* of a frame's time, than at first */
} view_resolution;
/* What to draw the next frame with. Errors: the engine's. */
bool view_resolution_choose(viewer *v, bool moving, karst_error *error);
void view_resolution_learn(viewer *v, bool moving, uint64_t frame_ns);

/* ---- sliders.c ---- */

typedef struct {
    char name[64], label[64], unit[16];
    double value, original, min, max, step;
    bool is_structural, changed; /* changed: the engine does not know yet */
} view_slider;
#define VIEW_MAX_SLIDERS 64
typedef struct {
    view_slider sliders[VIEW_MAX_SLIDERS];
    int num_sliders, chosen, dragged;                 /* dragged -1: none */
    int first_row;                                    /* of those that find room */
    double track_x, track_width, first_y, row_height; /* of the panel, framebuffer pixels */
    bool shown, changed;                              /* changed: the engine is to be told */
} view_sliders;
void view_sliders_read(viewer *v, bool keep_values); /* from the world */
void view_sliders_set(viewer *v, int index, double value);
void view_sliders_draw(viewer *v);
bool view_sliders_press(viewer *v, double x_px, double y_px); /* true: it was for them */
void view_sliders_drag(viewer *v, double x_px);
void view_sliders_step(viewer *v, int direction, int mods);

/* ---- parameters.c ---- */

bool view_sliders_apply(viewer *v, karst_error *error); /* tells the engine */
void view_sliders_save(viewer *v);                      /* into the world's file */

/* ---- reload.c ---- */

typedef struct {
    bool watching;
    long long mtime_ns, size_bytes, inode; /* of what was compiled last */
    long long seen_mtime_ns, seen_size_bytes, seen_inode;
    double looked_at_s, at_rest_since_s, started_s, seen_at_s;
    bool is_gone; /* the file, for a while; that was said */
    pthread_t thread;
    bool running;
    bool is_loading, has_loaded, is_forced; /* the compiler itself; is_forced: somebody asked for a reload meanwhile */
    _Atomic bool done;
    struct view_compilation *compilation;
    unsigned num_reloads, num_errors;
    unsigned num_at_once; /* of colours, before they were compiled */
    double last_s;       /* what the last one took */
    uint64_t num_frames; /* drawn while compiling, the last time */
    double longest_ms;   /* of those, and of the one that changed over */
    char error[4096];    /* what is wrong with the file now; "": nothing */
} view_reload;
void view_reload_begin(viewer *v);
/* Looks whether the file changed, or a compilation ended; true: the picture changes. Errors: the engine's. */
bool view_reload_step(viewer *v, bool force, bool *changed, karst_error *error);
/* While nothing happens: the first edit should not wait for the compiler to be loaded. */
void view_reload_get_ready(viewer *v);
void view_reload_end(viewer *v); /* waits for a compilation */

/* ---- open.c ---- */

typedef struct {
    char name[PATH_MAX];      /* that was dropped or typed last */
    bool is_wished;           /* it waits until nothing else is compiled */
    char compiling[PATH_MAX]; /* the name of what is compiled now */
    char shown[PATH_MAX];     /* and of what is on show, once another world is than at the start */
} view_opening;
/* Asks nothing of the engine: a turn takes the wish. `name`: of a world of Karst's, or of a file. */
void view_open_wish(viewer *v, const char *name);
/* True: there is a wish, for this file; it is one no longer. What is wrong with it is said. */
bool view_open_take_wish(viewer *v, char *world_file, size_t size_bytes);
void view_open_leave(viewer *v);                                                   /* before the engine changes over */
void view_open_enter(viewer *v, const char *world_file, karst_world *compiled); /* and after; takes `compiled` */
double view_usual_speed_m_s(const karst_world_metadata *metadata);
bool view_is_file(const char *world_file); /* not a world that is inside the library */

/* ---- show.c ---- */

/* The engine's picture, as the window has it, with its panels. Errors: KARST_FAILED (the context is lost). */
bool view_show(viewer *v, karst_error *error);
/* A message that is seen at once, before something that takes long. */
void view_show_message(viewer *v, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* ---- world.c ---- */

/* Opens the world on show, with the parameters in force: for their names and the ground. */
void view_world_open(viewer *v);
/* The world on show is this one now, which the viewer owns from here on (NULL: what is known of it is not). */
void view_world_take(viewer *v, karst_world *compiled);
/* Its parameters are other ones now: what samples it is made anew. */
void view_world_stale(viewer *v);

/* ---- capture.c ---- */

typedef struct {
    bool want_png, want_exr;
    unsigned num_pictures;
    char last_file[PATH_MAX];
    /* recording a path */
    bool recording;
    double record_start_s, recorded_at_s;
    struct {
        double time_s;
        karst_camera camera;
    } * keyframes;
    size_t num_keyframes, max_keyframes;
    char path_file[PATH_MAX]; /* the last one written or given */
    /* replaying one */
    karst_path *path;
    double replay_start_s, replay_s; /* on the viewer's clock; on the path's, of the next frame */
    bool replay_only; /* leave when it ends */
    /* video */
    command_pictures *video;
    char video_file[PATH_MAX];
    int video_size_px[2];
    double video_start_s;
    size_t num_video_pictures;
    command_record record; /* all frames */
    char copied[4096];
} view_capture;
bool view_capture_pictures(viewer *v, karst_error *error); /* those that are wanted, after a frame */
void view_record_toggle(viewer *v);
void view_record_step(viewer *v);
bool view_record_save(viewer *v); /* what was recorded so far */
bool view_replay_start(viewer *v, const char *file, karst_error *error);
void view_replay_stop(viewer *v);
bool view_replay_step(viewer *v); /* true: the camera is the path's */
void view_video_toggle(viewer *v);
bool view_video_step(viewer *v, karst_error *error);
void view_video_stop(viewer *v);
bool view_statistics_write(viewer *v, const char *file, karst_error *error);
void view_copy_command(viewer *v);

/* ---- number.c ---- */

/* The first of FOLDER/karst-WORLD-001.SUFFIX, -002, ... that is not there yet; of statistics, likewise. Errors:
 * KARST_FAILED. */
bool view_number_file(const viewer *v, const char *suffix, char path[PATH_MAX], karst_error *error);
bool view_statistics_number(viewer *v, char path[PATH_MAX], karst_error *error);

/* ---- hud.c ---- */

typedef enum { VIEW_PAGE_NONE, VIEW_PAGE_STATUS, VIEW_PAGE_FRAME, VIEW_PAGE_CACHE, VIEW_NUM_PAGES } view_page;
extern const char *const view_page_names[];
/* Draws panels that changed, at most some times a second unless `all`; true: something did. */
bool view_hud_update(viewer *v, bool all);

#define VIEW_HISTORY 240
typedef struct {
    double frame_ms[VIEW_HISTORY], produced[VIEW_HISTORY], evicted[VIEW_HISTORY], reproduced[VIEW_HISTORY];
    double stages_ms[VIEW_HISTORY][KARST_NUM_STAGES];
    size_t next, num;
} view_history;

/* ---- gauges.c ---- */

void view_draw_compass(viewer *v);     /* and how long things are where the cross-hair points */
void view_draw_depth_scale(viewer *v); /* what the greys of the depth view mean */

/* ---- window.c ---- */

bool view_window_open(viewer *v, karst_error *error);
void view_window_close(viewer *v);
/* Lets keys and mouse be heard while the engine is at work, and kept: true if nothing came. They have their effect with
 * view_window_deliver, which returns whether there were any. */
bool view_window_is_quiet(viewer *v);
bool view_window_deliver(viewer *v);

/* ---- screen.c ---- */

void view_window_fullscreen(viewer *v, bool fullscreen);
void view_window_capture(viewer *v, bool captured);

/* Something that happened to the window while the engine was at work. */
typedef struct {
    enum { VIEW_EVENT_KEY, VIEW_EVENT_CHAR, VIEW_EVENT_BUTTON, VIEW_EVENT_CURSOR, VIEW_EVENT_SCROLL } kind;
    int key, action, mods; /* or button; or codepoint */
    double x, y;
} view_event;
#define VIEW_MAX_EVENTS 256

struct viewer {
    command_talk *talk;
    karst_log log;
    view_settings settings;
    view_memory memory;
    const char *world;         /* as it was asked for */
    char world_file[PATH_MAX]; /* as the engine takes it */
    bool is_file;

    GLFWwindow *window;
    int width_px, height_px; /* of the framebuffer; 0 while minimised */
    double scale;            /* of type and panels */
    bool fullscreen, iconified, damaged, resized, captured, focused;
    int windowed[4]; /* x, y, width, height to come back to */

    karst_display *display;
    karst_engine *engine;
    karst_helper *helper; /* shares the compiling at the start; NULL: none */
    karst_world *compiled;                /* of the world on show, for what pictures do not tell; NULL: none */
    const karst_world_metadata *metadata; /* of that; NULL: none */
    karst_sampler *sampler;               /* of that; made when first needed */
    karst_stats stats;                    /* of the last frame */
    karst_probe probe;                    /* under the cross-hair */
    karst_view view;
    bool has_shown_view[KARST_NUM_VIEWS]; /* its kernel is there */
    uint64_t num_frames, num_shown;
    bool settled, time_runs;
    /* from the last motion to all pixels, to the level that is set in each of them, and to a settled picture */
    double full_after_s, sharp_after_s, settled_after_s;
    bool is_full, is_sharp, is_shown; /* is_shown: the picture of this frame already */
    double shown_at_s;      /* the last picture */
    double now_s, moved_at_s, first_frame_s, flying_speed_m_s;
    uint64_t started_ns, num_moving, num_late; /* frames while moving; those that missed the target */

    /* input */
    view_event events[VIEW_MAX_EVENTS]; /* that wait until the engine is done */
    int num_events;
    bool listening; /* the engine is at work */
    double key_down_s[GLFW_KEY_LAST + 1]; /* when it went down, below 0: it is up */
    double key_held_s[GLFW_KEY_LAST + 1]; /* how long since the last step, for what has come up */
    double cursor_x_px, cursor_y_px;
    char status[640]; /* the second line of the status panel, as it was drawn last */
    bool has_cursor, dragging, is_dragging_sun;
    double asked_to_leave_s;
    bool help_shown, prompt_shown, leaving, lost;
    bool prompt_is_world; /* for the name of a world, not for a place */
    bool prompt_skips;    /* the character of the key that opened it */
    char prompt[640], prompt_error[256];
    char toast[512];
    bool toast_bad;
    double toast_until_s;
    view_page page;
    bool hud_dirty;
    double hud_at_s;

    view_overlay overlay;
    view_motion motion;
    view_resolution resolution;
    view_sliders sliders;
    view_reload reload;
    view_opening opening;
    view_capture capture;
    view_edits edits;
    view_history history;
};

#endif
