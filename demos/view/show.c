/* A picture of the engine into the window, with its panels. */
#include "demos/view/view.h"

#include <stdarg.h>

bool view_show(viewer *v, karst_error *error)
{
    view_hud_update(v, v->damaged);
    v->damaged = false;
    view_outline_update(v);
    view_overlay_draw(v);
    glfwSwapBuffers(v->window);
    v->is_shown = true;
    v->shown_at_s = glfwGetTime();
    if (v->first_frame_s <= 0)
        v->first_frame_s = (double)(command_clock_ns() - v->started_ns) / 1e9;
    if (view_context_lost(v)) {
        v->lost = true;
        return karst_fail(error, KARST_FAILED,
                          "the graphics driver lost this window's context (it was reset); start karst view again");
    }
    return true;
}

void view_show_message(viewer *v, const char *format, ...)
{
    va_list arguments;
    char text[sizeof v->toast];
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    view_toast(v, "%s", text);
    if (v->num_frames && karst_engine_show(v->engine, NULL))
        view_show(v, NULL);
}
