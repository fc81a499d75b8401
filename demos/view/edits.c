/* Where edits of a session go: into the saved world that is on show, or, when one asks for it, into a new one. */
#include "demos/view/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- all edits on show ---- */

/* Those that were in force when the session began, as far as they still are: their file has them. */
static karst_edit *load_before(const viewer *v, size_t num_before, size_t num_more, size_t *num, karst_error *error)
{
    const int voxel_log2_m = karst_engine_voxel_log2_m(v->engine);
    const char *file = v->edits.journal || karst_saved_is_name(v->world) ? v->world : v->settings.edits;
    karst_edit *edits = num_before && file ? command_load_edits(file, voxel_log2_m, num, NULL, error)
                                           : calloc(1, sizeof *edits);
    if (!num_before || !file)
        *num = 0;
    if (!edits) {
        if (!num_before || !file)
            karst_fail(error, KARST_FAILED, "out of memory for %zu edits", num_more);
        return NULL;
    }
    if (*num < num_before) {
        karst_fail(error, KARST_FAILED, "%s has changed since it was opened: %zu of %zu edits are there", file, *num,
                   num_before);
        free(edits);
        return NULL;
    }
    *num = num_before;
    karst_edit *larger = realloc(edits, (num_before + num_more + 1) * sizeof *edits);
    if (!larger) {
        free(edits);
        karst_fail(error, KARST_FAILED, "out of memory for %zu edits", num_before + num_more);
    }
    return larger;
}

karst_edit *view_edits_all(const viewer *v, size_t *num, size_t *num_undone, karst_error *error)
{
    const view_edits *e = &v->edits;
    const size_t num_in_force = karst_engine_num_edits(v->engine, NULL);
    const size_t wanted = num_undone && e->is_ready ? e->num_before + e->num_edits : num_in_force;
    const size_t num_before = !e->is_ready || wanted < e->num_before ? wanted : e->num_before;
    karst_edit *all = load_before(v, num_before, wanted - num_before, num, error);
    if (all && wanted > num_before)
        memcpy(all + num_before, e->edits, (wanted - num_before) * sizeof *all);
    *num = all ? wanted : 0;
    if (num_undone)
        *num_undone = wanted - num_in_force;
    return all;
}

size_t view_edits_num_unsaved(viewer *v)
{
    const view_edits *e = &v->edits;
    const size_t num_in_force = karst_engine_num_edits(v->engine, NULL);
    if (e->journal)
        return view_journal_look(e->journal).num_waiting;
    if (!e->is_ready)
        return 0;
    /* Those of this session, and those from before it that were undone. */
    const size_t num_same = num_in_force < e->num_before ? num_in_force : e->num_before;
    return num_in_force - num_same + e->num_begun - num_same;
}

/* ---- the file on show ---- */

static void open_journal(viewer *v)
{
    view_edits *e = &v->edits;
    karst_error error = {0};
    e->journal = view_journal_open(v->world, karst_engine_num_edits(v->engine, NULL),
                                   karst_engine_voxel_log2_m(v->engine), &error);
    if (!e->journal || !view_journal_start(e->journal, &error)) {
        view_journal_close(e->journal);
        e->journal = NULL;
        view_complain(v, "edits stay in memory, and F4 keeps them in a new file: %s", error.message);
        return;
    }
    /* What was undone when the file was closed can be done again. */
    size_t redoable, num, num_in_force = karst_engine_num_edits(v->engine, &redoable);
    const karst_edit *edits = view_journal_redoable(e->journal, &num);
    if (redoable == 0 && num && karst_engine_edit(v->engine, edits, num, NULL)) {
        size_t back = num;
        karst_engine_undo(v->engine, &back, NULL);
        if (v->sampler && karst_sampler_append_edits(v->sampler, edits, num, NULL))
            karst_sampler_keep_edits(v->sampler, num_in_force);
        e->num_before = num_in_force + num; /* the file has them: none of this session's */
    }
}

void view_edits_begin(viewer *v)
{
    view_edits *e = &v->edits;
    if (e->is_ready)
        return;
    e->num_before = e->num_begun = karst_engine_num_edits(v->engine, NULL);
    e->is_ready = true;
    if (karst_saved_is_name(v->world))
        open_journal(v);
}

void view_edits_notice(viewer *v)
{
    view_edits *e = &v->edits;
    if (!e->journal)
        return;
    const view_journal_state now = view_journal_look(e->journal);
    const int told = *now.why ? -1 : now.is_saved;
    v->hud_dirty = v->hud_dirty || told != e->told;
    e->told = told;
}

/* ---- a new file ---- */

/* Sliders count more than the command line does. */
static size_t choose_parameters(const viewer *v, karst_parameter parameters[KARST_SAVED_MAX_PARAMETERS])
{
    size_t num = 0;
    for (int i = 0; i < v->sliders.num_sliders && num < KARST_SAVED_MAX_PARAMETERS; i++)
        if (v->sliders.sliders[i].value != v->sliders.sliders[i].original)
            parameters[num++] = (karst_parameter){v->sliders.sliders[i].name, v->sliders.sliders[i].value};
    for (size_t i = 0; i < v->settings.parameters.num_values && num < KARST_SAVED_MAX_PARAMETERS; i++) {
        bool is_there = false;
        for (size_t k = 0; k < num; k++)
            is_there = is_there || strcmp(parameters[k].name, v->settings.parameters.values[i].name) == 0;
        if (!is_there)
            parameters[num++] = v->settings.parameters.values[i];
    }
    return num;
}

static bool create(viewer *v, const char *path, karst_error *error)
{
    char camera[512];
    karst_parameter parameters[KARST_SAVED_MAX_PARAMETERS];
    karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), camera, sizeof camera);
    karst_saved_config config = {.parameters = parameters,
                                 .num_parameters = choose_parameters(v, parameters),
                                 .has_seed = v->settings.has_seed,
                                 .seed = (uint32_t)v->settings.seed,
                                 .camera = camera};
    /* A saved world knows what it is of; a text that has no file of its own goes inside. */
    karst_saved *old = karst_saved_is_name(v->world) ? karst_saved_open(v->world, false, NULL, error) : NULL;
    if (karst_saved_is_name(v->world) && !old)
        return false;
    const bool has_name = !old && !strchr(v->world, '/') && strcmp(v->world, "-") != 0;
    config.embed = strcmp(v->world, "-") == 0 || command_is_from_inside(v->world_file);
    config.world = old ? karst_saved_get_about(old)->world : has_name ? v->world : v->world_file;
    if (config.embed)
        config.world = v->world_file;
    const bool done = karst_saved_create(path, &config, error);
    karst_saved_close(old);
    return done;
}

static bool fill(const char *path, const karst_edit *edits, size_t num, size_t num_undone, int voxel_log2_m,
                 karst_error *error)
{
    karst_saved *saved = karst_saved_open(path, true, NULL, error);
    const bool done = saved && karst_saved_append(saved, edits, num, voxel_log2_m, error) &&
                      karst_saved_undo(saved, &num_undone, error) && karst_saved_commit(saved, error);
    karst_saved_close(saved);
    if (!done)
        remove(path);
    return done;
}

/* A new file of all that is on show; its name goes to `path`. */
static bool write_new(viewer *v, char path[PATH_MAX], karst_error *error)
{
    size_t num, num_undone;
    karst_edit *all = view_edits_all(v, &num, &num_undone, error);
    const bool done = all && view_number_file(v, "karstdb", path, error) && create(v, path, error) &&
                      fill(path, all, num, num_undone, karst_engine_voxel_log2_m(v->engine), error);
    free(all);
    return done;
}

void view_edits_keep(viewer *v)
{
    view_edits *e = &v->edits;
    karst_error error = {0};
    if (e->journal) {
        view_toast(v, "%s is saved as one goes; F4 is for worlds that no file keeps yet", v->world);
        return;
    }
    char path[PATH_MAX];
    if (!write_new(v, path, &error)) {
        view_complain(v, "nothing is kept: %s", error.message);
        return;
    }
    /* From here on that file is what is on show. */
    memcpy(e->kept_in, path, sizeof e->kept_in);
    v->world = e->kept_in;
    view_edits_begin(v);
    char title[PATH_MAX + 16];
    snprintf(title, sizeof title, "%s - karst", v->world);
    glfwSetWindowTitle(v->window, title);
    if (!e->journal)
        open_journal(v);
    if (e->journal)
        view_toast(v, "kept in %s, where all that follows is saved, too", path);
}

/* ---- leaving ---- */

bool view_edits_warn(viewer *v)
{
    const size_t num = v->edits.journal ? 0 : view_edits_num_unsaved(v);
    v->edits.is_warned = num > 0;
    if (num)
        view_toast(v, "Esc once more leaves, and %zu edit%s gone: F4 keeps %s", num, num == 1 ? " is" : "s are",
                   num == 1 ? "it" : "them");
    return num > 0;
}

void view_edits_finish(viewer *v)
{
    view_edits *e = &v->edits;
    karst_error error = {0};
    char path[PATH_MAX];
    if (e->journal) {
        view_journal_finish(e->journal);
        const view_journal_state state = view_journal_look(e->journal);
        if (!state.is_saved)
            command_say_error(v->talk, *state.why ? state.why : "the last edits are not saved");
        return;
    }
    const size_t num = v->engine ? view_edits_num_unsaved(v) : 0;
    if (num == 0 || e->is_warned)
        return;
    if (write_new(v, path, &error))
        command_say(v->talk, "note: %zu edits were in memory alone: they are in %s now", num, path);
    else
        command_say_error(v->talk, error.message);
}

void view_edits_close(viewer *v)
{
    view_edits *e = &v->edits;
    view_journal_close(e->journal);
    e->journal = NULL;
    free(e->edits);
    free(e->strokes);
    e->edits = NULL;
    e->strokes = NULL;
}

/* ---- what is to be said ---- */

bool view_edits_describe(viewer *v, char *text, size_t size_bytes)
{
    view_edits *e = &v->edits;
    char size[48], kind[48] = "", state[320] = "";
    size_t num = karst_engine_num_edits(v->engine, NULL), unsaved = view_edits_num_unsaved(v);
    if (!e->is_ready || (e->brush.tool == VIEW_NO_TOOL && !e->journal && !unsaved))
        return false;
    if (e->brush.tool == VIEW_TOOL_PAINT)
        snprintf(kind, sizeof kind, " %s", view_paints[e->brush.paint].name);
    if (e->brush.tool == VIEW_TOOL_STAMP)
        snprintf(kind, sizeof kind, " %s", view_stamp_names[e->brush.stamp]);
    if (e->journal) {
        const view_journal_state now = view_journal_look(e->journal);
        if (*now.why)
            snprintf(state, sizeof state, "NOT saved: %s", now.why);
        else
            snprintf(state, sizeof state, now.is_saved ? "saved" : "saving\u2026");
    } else if (unsaved) {
        snprintf(state, sizeof state, "%zu of them in memory alone: F4 keeps them", unsaved);
    }
    const char *edits = num == 1 ? "edit" : "edits";
    if (e->brush.tool == VIEW_NO_TOOL)
        snprintf(text, size_bytes, "%zu %s    %s", num, edits, state);
    else
        snprintf(text, size_bytes, "%s%s  %s  strength %.0f %%    %zu %s    %s", view_tool_names[e->brush.tool], kind,
                 view_format_length(e->brush.size_m, "", size), 100 * e->brush.strength, num, edits, state);
    return true;
}
