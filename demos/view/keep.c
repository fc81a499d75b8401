/* What a saved world (.karstdb) keeps of a visit: bookmarks, and where one was. */
#include "demos/view/view.h"

#include <stdlib.h>
#include <string.h>

void view_saved_read(viewer *v)
{
    karst_saved *saved = karst_saved_is_name(v->world) ? karst_saved_open(v->world, false, NULL, NULL) : NULL;
    if (!saved)
        return;
    const karst_saved_about *about = karst_saved_get_about(saved);
    for (int i = 0; i < VIEW_NUM_BOOKMARKS && i < KARST_SAVED_NUM_BOOKMARKS; i++)
        snprintf(v->memory.bookmarks[i], sizeof v->memory.bookmarks[i], "%s",
                 about->bookmarks[i] ? about->bookmarks[i] : "");
    karst_saved_close(saved);
}

static bool is_same(const char *kept, const char *now) { return strcmp(kept ? kept : "", now) == 0; }

static bool write_changes(viewer *v, karst_saved *saved, karst_error *error)
{
    const karst_saved_about *about = karst_saved_get_about(saved);
    char camera[512];
    karst_camera_format(&v->motion.camera, karst_engine_voxel_log2_m(v->engine), camera, sizeof camera);
    /* Whoever only watched a flight, has not moved. */
    if (!v->settings.replay && !is_same(about->camera, camera) && !karst_saved_set_camera(saved, camera, error))
        return false;
    for (int i = 0; i < VIEW_NUM_BOOKMARKS && i < KARST_SAVED_NUM_BOOKMARKS; i++) {
        const char *now = v->memory.bookmarks[i];
        if (!is_same(about->bookmarks[i], now) && !karst_saved_set_bookmark(saved, i, *now ? now : NULL, error))
            return false;
    }
    return karst_saved_commit(saved, error);
}

void view_saved_write(viewer *v)
{
    karst_error error = {0};
    if (!karst_saved_is_name(v->world))
        return;
    /* A file that is written as one goes is open already. */
    view_journal *journal = v->edits.journal;
    karst_saved *saved = journal ? view_journal_finish(journal) : karst_saved_open(v->world, true, NULL, &error);
    if (!saved || !write_changes(v, saved, &error))
        command_say(v->talk, "note: camera and bookmarks are not kept: %s", error.message);
    if (!journal)
        karst_saved_close(saved);
}
