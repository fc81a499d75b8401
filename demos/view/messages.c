/* Short messages, in the window and on the terminal. */
#include "demos/view/view.h"

#include <stdarg.h>

static void set_toast(viewer *v, bool bad, const char *format, va_list arguments)
{
    vsnprintf(v->toast, sizeof v->toast, format, arguments);
    v->toast_bad = bad;
    v->toast_until_s = glfwGetTime() + (bad ? 6 : 3);
    v->hud_dirty = true;
}

void view_toast(viewer *v, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    set_toast(v, false, format, arguments);
    va_end(arguments);
    command_say(v->talk, "%s", v->toast);
}

void view_complain(viewer *v, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    set_toast(v, true, format, arguments);
    va_end(arguments);
    command_say_error(v->talk, v->toast);
}
