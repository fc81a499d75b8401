/* Another world in this window: one that is dropped on it, or named after O. It is compiled beside the picture, as the
 * world on show is when its file changes, and takes that one's place when it is there. */
#include "demos/view/view.h"

#include <math.h>
#include <string.h>

void view_open_wish(viewer *v, const char *name)
{
    view_opening *o = &v->opening;
    if (strlen(name) >= sizeof o->name) {
        view_complain(v, "this name is too long to be a file's");
        return;
    }
    snprintf(o->name, sizeof o->name, "%s", name);
    o->is_wished = true;
}

/* Which file the name means. False: it was said why none. */
static bool find_file(viewer *v, const char *name, char *world_file, size_t size_bytes)
{
    karst_error error = {0};
    /* Edits are of one world, and what is kept in a saved world goes with its edits. */
    if (karst_saved_is_name(name) || karst_saved_is_name(v->world) || v->settings.edits ||
        karst_engine_num_edits(v->engine, NULL) || v->edits.num_edits) {
        view_complain(v, "edits belong to their world: karst view %s opens this one in a window of its own", name);
        return false;
    }
    if (!*name || strcmp(name, "-") == 0)
        view_complain(v, "a world has a name, such as hills, or is a file");
    else if (!command_find_world(name, world_file, size_bytes, &error))
        view_complain(v, "%s", error.message);
    else
        return true;
    return false;
}

bool view_open_take_wish(viewer *v, char *world_file, size_t size_bytes)
{
    if (!v->opening.is_wished)
        return false;
    v->opening.is_wished = false;
    if (!find_file(v, v->opening.name, world_file, size_bytes))
        return false;
    view_toast(v, "opening %s", v->opening.name);
    return true;
}

/* What belongs to the old world ends with it, while positions are still in its voxels. */
void view_open_leave(viewer *v)
{
    if (v->capture.recording)
        view_record_toggle(v);
    if (v->capture.path)
        view_replay_stop(v);
    view_memory_write(v);
}

void view_open_enter(viewer *v, const char *world_file, karst_world *compiled)
{
    view_opening *o = &v->opening;
    char title[PATH_MAX + 16];
    memcpy(o->shown, o->compiling, sizeof o->shown);
    v->world = o->shown;
    memcpy(v->world_file, world_file, sizeof v->world_file);
    v->is_file = view_is_file(v->world_file);
    v->settings.has_seed = false; /* what was asked of the world that is gone */
    v->settings.parameters.num_values = 0;
    view_world_take(v, compiled);
    view_sliders_read(v, false);
    view_memory_read_bookmarks(v);
    karst_engine_set_sun(v->engine, NULL, NULL);
    v->motion.mode = VIEW_FLY;
    if (v->settings.speed_m_s <= 0 && v->metadata)
        v->motion.speed_m_s = view_usual_speed_m_s(v->metadata);
    const karst_camera home = karst_engine_default_camera(v->engine);
    view_set_camera(v, &home);
    snprintf(title, sizeof title, "%s - karst", v->world);
    glfwSetWindowTitle(v->window, title);
}

double view_usual_speed_m_s(const karst_world_metadata *metadata)
{
    return fmin(1e6, fmax(0.1, metadata->view_distance_m / 100));
}

bool view_is_file(const char *world_file)
{
    return (strchr(world_file, '/') || strstr(world_file, ".karst")) && !command_is_from_inside(world_file);
}
