/* Where pictures appear: an OpenGL pixel buffer behind EGL or OSMesa (or a window's context), or none. */
#ifndef KARST_DISPLAY_H
#define KARST_DISPLAY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"
#include "karst/log.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    KARST_DISPLAY_AUTO,   /* EGL, else OSMesa, else none */
    KARST_DISPLAY_EGL,    /* surfaceless EGL, desktop OpenGL */
    KARST_DISPLAY_OSMESA, /* software OpenGL in memory */
    KARST_DISPLAY_NONE,   /* no OpenGL: the image is read from the device */
    KARST_DISPLAY_WINDOW  /* a context that the caller made current: see karst_display_create_in_context */
} karst_display_kind;

typedef struct karst_display karst_display;

/* "auto", "egl", "osmesa", "none". Errors: KARST_USAGE listing the names. */
bool karst_display_kind_parse(const char *name, karst_display_kind *kind, karst_error *error);
const char *karst_display_kind_name(karst_display_kind kind);

/* Opens a headless display. Errors: KARST_USAGE (KARST_DISPLAY_WINDOW: see below), KARST_NO_DEVICE, saying which
 * package is missing or what to use instead. AUTO logs what it fell back to and never fails for want of OpenGL. Use
 * from one thread, whose OpenGL context it becomes whenever it is drawn to. Destroy with karst_display_destroy (NULL is
 * fine). */
karst_display *karst_display_create(karst_display_kind kind, const karst_log *log, karst_error *error);
/* For a window: `get_proc` (glfwGetProcAddress) must work now, and the context (OpenGL 3.3 or later) be current in
 * every later call. Pictures are drawn over its current viewport, then it is for the caller to swap. The caller keeps
 * the context. Errors: KARST_NO_DEVICE (an older OpenGL). */
karst_display *karst_display_create_in_context(void *(*get_proc)(const char *name), const karst_log *log,
                                               karst_error *error);
void karst_display_destroy(karst_display *display);
karst_display_kind karst_display_get_kind(const karst_display *display);
/* "EGL 1.5 surfaceless, OpenGL 4.5 (Core Profile) Mesa 22.3.6, llvmpipe", or "none". Owned by the display. */
const char *karst_display_description(const karst_display *display);

#ifdef __cplusplus
}
#endif
#endif
