/* The world file changes: it is compiled by a thread of its own while the picture moves on, then changed over between
 * two frames. A file with a mistake changes nothing; what is wrong stands over the picture and on the terminal. */
#include "demos/view/view.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define LOOK_EVERY_S 0.05
#define GONE_FOR_S 1.0
#define EMPTY_FOR_S 2.0 /* many programs empty a file first and then write it */

/* What the thread reads and writes; nobody else does meanwhile. */
struct view_compilation {
    karst_engine *engine;
    char world_file[PATH_MAX];
    bool is_other; /* another world than the one on show */
    bool has_seed;
    uint32_t seed;
    /* Parameters that somebody moved: they stay, as long as the file has them and says the same of them. */
    struct {
        char name[64];
        double value, original;
    } moved[VIEW_MAX_SLIDERS];
    size_t num_moved;
    _Atomic bool *done;

    karst_prepared_world *prepared;
    karst_world *compiled;
    karst_error error;
    char lines[4096]; /* what the compiler says */
};

static void keep_line(void *user, karst_log_level level, const char *line)
{
    struct view_compilation *c = user;
    size_t length = strlen(c->lines);
    (void)level;
    snprintf(c->lines + length, sizeof c->lines - length, "%s%s", length ? "\n" : "", line);
}

/* The parameters to set: those moved that the file, as it is now, still has as they were. */
static size_t choose_parameters(const struct view_compilation *c, karst_parameter *parameters)
{
    const karst_world_config plain = {.world = c->world_file, .has_seed = c->has_seed, .seed = c->seed};
    size_t num = 0;
    karst_world *world = c->num_moved ? karst_world_open(&plain, NULL) : NULL;
    if (!world)
        return 0;
    const karst_world_metadata *data = karst_world_get_metadata(world);
    for (size_t i = 0; i < c->num_moved; i++)
        for (size_t k = 0; k < data->num_parameters; k++)
            if (strcmp(c->moved[i].name, data->parameters[k].name) == 0 &&
                c->moved[i].original == data->parameters[k].value)
                parameters[num++] = (karst_parameter){c->moved[i].name, c->moved[i].value};
    karst_world_close(world);
    return num;
}

static void *compile(void *user)
{
    struct view_compilation *c = user;
    karst_parameter parameters[VIEW_MAX_SLIDERS];
    const karst_log log = {.write = keep_line, .user = c, .max_level = KARST_LOG_WARNING};
    karst_world_config config = {
        .world = c->world_file, .parameters = parameters, .has_seed = c->has_seed, .seed = c->seed, .log = &log};
    config.num_parameters = choose_parameters(c, parameters);
    c->compiled = karst_world_open(&config, &c->error);
    config.log = NULL; /* said once is enough */
    if (c->compiled)
        c->prepared = karst_engine_prepare_world(c->engine, &config, &c->error);
    *c->done = true;
    return NULL;
}

static bool look(const viewer *v, long long *mtime_ns, long long *size_bytes, long long *inode)
{
    struct stat info;
    if (stat(v->world_file, &info) != 0 || !S_ISREG(info.st_mode))
        return false; /* between two names, while an editor saves */
    *mtime_ns = (long long)info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec;
    *size_bytes = info.st_size;
    *inode = (long long)info.st_ino;
    return true;
}

void view_reload_begin(viewer *v)
{
    view_reload *r = &v->reload;
    r->watching = v->is_file && look(v, &r->mtime_ns, &r->size_bytes, &r->inode);
    r->seen_mtime_ns = r->mtime_ns;
    r->seen_size_bytes = r->size_bytes;
    r->seen_inode = r->inode;
    r->seen_at_s = v->now_s;
}

/* Whether the file is another than the one compiled last, and was left alone for a look: who writes slowly is waited
 * for, and longer while there is nothing in the file. */
static bool has_changed(viewer *v)
{
    view_reload *r = &v->reload;
    long long mtime_ns, size_bytes, inode;
    if (!r->watching || v->now_s - r->looked_at_s < LOOK_EVERY_S)
        return false;
    r->looked_at_s = v->now_s;
    if (!look(v, &mtime_ns, &size_bytes, &inode)) {
        /* Editors take a file away for a moment when they save it. */
        if (!r->is_gone && v->now_s - r->seen_at_s > GONE_FOR_S) {
            r->is_gone = true;
            view_complain(v, "%s is no longer there; its last state stays, and the window waits for the file",
                          v->world);
        }
        return false;
    }
    r->seen_at_s = v->now_s;
    if (r->is_gone)
        view_toast(v, "%s is there again", v->world);
    r->is_gone = false;
    bool at_rest = mtime_ns == r->seen_mtime_ns && size_bytes == r->seen_size_bytes && inode == r->seen_inode;
    r->seen_mtime_ns = mtime_ns;
    r->seen_size_bytes = size_bytes;
    r->seen_inode = inode;
    if (!at_rest)
        r->at_rest_since_s = v->now_s;
    return at_rest && (mtime_ns != r->mtime_ns || size_bytes != r->size_bytes || inode != r->inode) &&
           (size_bytes > 0 || v->now_s - r->at_rest_since_s >= EMPTY_FOR_S);
}

/* If the text differs in colours alone, they are shown at once, and compiled meanwhile. */
static bool show_colours(viewer *v, const struct view_compilation *c, bool *changed, karst_error *error)
{
    karst_parameter parameters[VIEW_MAX_SLIDERS];
    karst_world_config config = {
        .world = c->world_file, .parameters = parameters, .has_seed = c->has_seed, .seed = c->seed};
    karst_error reason = {0};
    bool shown = false;
    config.num_parameters = choose_parameters(c, parameters);
    /* What is wrong with a text is said when it is compiled. */
    if (!karst_engine_show_colours(v->engine, &config, &shown, &reason) && reason.status == KARST_FAILED)
        return karst_fail(error, reason.status, "%s", reason.message);
    v->reload.num_at_once += shown;
    *changed = *changed || shown;
    return true;
}

/* What the text that is on show now asks for: its own seed, and the parameters that somebody moved. */
static void ask_for_shown(viewer *v, struct view_compilation *c)
{
    memcpy(c->world_file, v->world_file, sizeof c->world_file);
    c->has_seed = v->settings.has_seed;
    c->seed = (uint32_t)v->settings.seed;
    for (int i = 0; i < v->sliders.num_sliders; i++) {
        const view_slider *s = &v->sliders.sliders[i];
        if (s->value == s->original)
            continue;
        memcpy(c->moved[c->num_moved].name, s->name, sizeof s->name);
        c->moved[c->num_moved].value = s->value;
        c->moved[c->num_moved++].original = s->original;
    }
}

/* `other`: a world's file; NULL: the one on show is compiled anew. */
static bool start(viewer *v, const char *other, bool *changed, karst_error *error)
{
    view_reload *r = &v->reload;
    struct view_compilation *c = calloc(1, sizeof *c);
    if (!c) {
        view_complain(v, "out of memory");
        return true;
    }
    c->engine = v->engine;
    if (other) {
        c->is_other = true;
        snprintf(c->world_file, sizeof c->world_file, "%s", other);
        memcpy(v->opening.compiling, v->opening.name, sizeof v->opening.compiling);
    } else {
        look(v, &r->mtime_ns, &r->size_bytes, &r->inode);
        ask_for_shown(v, c);
    }
    if (!other && !show_colours(v, c, changed, error)) {
        free(c);
        return false;
    }
    r->done = false;
    c->done = &r->done;
    if (pthread_create(&r->thread, NULL, compile, c) != 0) {
        free(c);
        view_complain(v, "cannot start a thread to compile the world");
        return true;
    }
    r->compilation = c;
    r->running = true;
    r->num_frames = 0;
    r->longest_ms = 0;
    r->started_s = v->now_s;
    v->hud_dirty = true;
    return true;
}

static void say_lines(viewer *v, const char *lines)
{
    char text[sizeof v->reload.error];
    snprintf(text, sizeof text, "%s", lines);
    for (char *rest = text, *end; rest && *rest; rest = end) {
        end = strchr(rest, '\n');
        if (end)
            *end++ = 0;
        v->log.write(v->log.user, KARST_LOG_WARNING, rest);
    }
}

/* Another world's voxels may have another width: what is kept in voxels is kept no longer. */
static void follow_camera(viewer *v, int old_voxel_log2_m)
{
    v->motion.camera = karst_engine_camera(v->engine);
    if (karst_engine_voxel_log2_m(v->engine) == old_voxel_log2_m)
        return;
    if (v->motion.mode == VIEW_ORBIT)
        v->motion.mode = VIEW_FLY;
    if (v->capture.path)
        view_replay_stop(v);
}

static bool change_over(viewer *v, struct view_compilation *c, karst_error *error)
{
    bool kept = false;
    int old_voxel_log2_m = karst_engine_voxel_log2_m(v->engine);
    karst_error reason = {0};
    /* Before positions change their unit. */
    if (c->is_other)
        view_open_leave(v);
    if (v->capture.recording && karst_world_get_metadata(c->compiled)->voxel_log2_m != old_voxel_log2_m)
        view_record_toggle(v);
    if (!karst_engine_set_camera(v->engine, &v->motion.camera, &reason) ||
        !karst_engine_change_world(v->engine, c->prepared, &kept, &reason)) {
        c->prepared = NULL;
        if (reason.status == KARST_FAILED)
            return karst_fail(error, reason.status, "%s", reason.message);
        view_complain(v, "%s", reason.message);
        return true;
    }
    c->prepared = NULL;
    if (c->is_other) {
        view_open_enter(v, c->world_file, c->compiled);
        v->reload.is_gone = false;
        view_reload_begin(v);
    } else {
        follow_camera(v, old_voxel_log2_m);
        view_world_take(v, c->compiled);
        view_sliders_read(v, true);
    }
    c->compiled = NULL;
    v->reload.num_reloads++;
    v->reload.error[0] = 0;
    view_toast(v, "%s, %.1f s%s", v->world, v->now_s - v->reload.started_s, kept ? ", no brick made again" : "");
    say_lines(v, c->lines);
    return true;
}

static bool finish(viewer *v, karst_error *error)
{
    view_reload *r = &v->reload;
    struct view_compilation *c = r->compilation;
    bool good = true;
    pthread_join(r->thread, NULL);
    r->running = false;
    r->last_s = v->now_s - r->started_s;
    r->compilation = NULL;
    v->hud_dirty = true;
    if (c->prepared) {
        good = change_over(v, c, error);
    } else if (c->is_other) { /* nothing is wrong with what is on show */
        r->num_errors++;
        view_complain(v, "%s", *c->lines ? c->lines : c->error.message);
    } else {
        r->num_errors++;
        /* What follows the first line of the message stands under it: the line of the file, and the caret. */
        snprintf(r->error, sizeof r->error, "%s", *c->lines ? c->lines : c->error.message);
        if (*c->lines)
            say_lines(v, c->lines);
        else
            command_say_error(v->talk, c->error.message);
    }
    karst_world_close(c->compiled);
    free(c);
    return good;
}

static void *load_compiler(void *user)
{
    viewer *v = user;
    karst_engine_load_compiler(v->engine);
    karst_engine_prepare_colours(v->engine, NULL); /* without it edited colours only take longer */
    v->reload.done = true;
    return NULL;
}

void view_reload_get_ready(viewer *v)
{
    view_reload *r = &v->reload;
    if (!r->watching || r->running || r->has_loaded)
        return;
    r->has_loaded = true;
    r->done = false;
    r->is_loading = pthread_create(&r->thread, NULL, load_compiler, v) == 0;
}

bool view_reload_step(viewer *v, bool force, bool *changed, karst_error *error)
{
    *changed = false;
    if (v->reload.is_loading) {
        v->reload.is_forced = v->reload.is_forced || force;
        if (!v->reload.done)
            return true;
        pthread_join(v->reload.thread, NULL);
        v->reload.is_loading = false;
        force = v->reload.is_forced;
    }
    if (v->reload.running && v->reload.done) {
        *changed = true;
        if (!finish(v, error))
            return false;
    }
    char other[PATH_MAX];
    if (!v->reload.running && view_open_take_wish(v, other, sizeof other))
        return start(v, other, changed, error);
    bool look_again = force || has_changed(v);
    return !look_again || v->reload.running || start(v, NULL, changed, error);
}

void view_reload_end(viewer *v)
{
    view_reload *r = &v->reload;
    if (!r->running && !r->is_loading)
        return;
    if (v->window)
        glfwHideWindow(v->window); /* gone at once, whatever there is still to wait for */
    pthread_join(r->thread, NULL);
    r->is_loading = false;
    if (!r->running)
        return;
    karst_prepared_world_destroy(r->compilation->prepared);
    karst_world_close(r->compilation->compiled);
    free(r->compilation);
    r->running = false;
}
