/* What stands behind a karst_display. Private to core/display/display*.c and core/display/surface.c. */
#ifndef KARST_CORE_DISPLAY_PLATFORM_H
#define KARST_CORE_DISPLAY_PLATFORM_H

#include "core/device/context.h"
#include "core/display/gl.h"
#include "core/display/surface.h"
#include "karst/display.h"

/* How a kind of display is made current and closed. `native` is what the kind's `open` stored. */
typedef struct {
    bool (*bind)(void *native, karst_error *error);
    bool (*is_bound)(void *native); /* as far as the kind's own library knows */
    void (*unbind)(void *native);
    void (*close)(void *native); /* after unbind */
} karst_display_platform;

struct karst_display {
    karst_display_kind kind;
    const karst_log *log;
    const karst_display_platform *platform; /* NULL: NONE, or a WINDOW, which is the caller's */
    void *native;
    karst_gl gl; /* zeros for NONE */
    int max_texture_px;
    char description[320];
};

/* Fill native, platform and gl, leave the context current, and begin the description ("EGL 1.5"); on failure nothing is
 * left open. Errors: KARST_NO_DEVICE. */
bool karst_display_open_egl(karst_display *display, karst_error *error);
bool karst_display_open_osmesa(karst_display *display, karst_error *error);

/* Makes the display's OpenGL current on this thread; nothing to do for NONE and WINDOW. */
bool karst_display_bind(karst_display *display, karst_error *error);

/* Makes the display current on no thread; it must not be on any but this one. */
void karst_display_leave(karst_display *display);

/* The part of karst_display_sharing (core/display/surface.h) for whatever EGL or GLX context is current on this thread.
 * */
bool karst_display_sharing_current(cl_context_properties properties[KARST_SHARING_PROPERTIES]);

#endif
