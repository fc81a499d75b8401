#include "karst/display.h"

#include "core/display/display_platform.h"
#include "core/base/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The headless display whose context this thread has current, as far as Karst bound it. EGL and OSMesa do not know of
 * one another but share Mesa's dispatch table: whoever binds second must have the first released, or calls reach the
 * wrong context. */
static _Thread_local karst_display *bound_display;

static const struct {
    const char *name;
    karst_display_kind kind;
} kinds[] = {
    {"auto", KARST_DISPLAY_AUTO}, {"egl", KARST_DISPLAY_EGL},       {"osmesa", KARST_DISPLAY_OSMESA},
    {"none", KARST_DISPLAY_NONE}, {"window", KARST_DISPLAY_WINDOW}, /* last: not to be chosen by name */
};
enum { NUM_KINDS = sizeof kinds / sizeof kinds[0] };

bool karst_display_kind_parse(const char *name, karst_display_kind *kind, karst_error *error)
{
    char quoted[KARST_TEXT_QUOTE_BYTES];
    for (int i = 0; i < NUM_KINDS - 1; i++)
        if (strcmp(name, kinds[i].name) == 0) {
            *kind = kinds[i].kind;
            return true;
        }
    return karst_fail(error, KARST_USAGE, "no display is called \"%s\": choose auto, egl, osmesa or none",
                      karst_text_quote(name, quoted));
}

const char *karst_display_kind_name(karst_display_kind kind)
{
    for (int i = 0; i < NUM_KINDS; i++)
        if (kinds[i].kind == kind)
            return kinds[i].name;
    return "unknown";
}

bool karst_display_bind(karst_display *display, karst_error *error)
{
    if (display->kind == KARST_DISPLAY_NONE)
        return true;
    if (!display->platform) {
        bound_display = NULL; /* the caller has made another context current */
        return true;
    }
    if (bound_display == display && display->platform->is_bound(display->native))
        return true;
    if (bound_display && bound_display != display)
        bound_display->platform->unbind(bound_display->native);
    bound_display = NULL;
    if (!display->platform->bind(display->native, error))
        return false;
    bound_display = display;
    return true;
}

bool karst_display_sharing(karst_display *display, cl_context_properties properties[KARST_SHARING_PROPERTIES])
{
    if (display->kind != KARST_DISPLAY_EGL && display->kind != KARST_DISPLAY_WINDOW)
        return false;
    return karst_display_bind(display, NULL) && karst_display_sharing_current(properties);
}

/* What all kinds with OpenGL share once their context is current. */
static void describe(karst_display *display)
{
    const karst_gl *gl = &display->gl;
    const char *version = (const char *)gl->GetString(GL_VERSION), *renderer = (const char *)gl->GetString(GL_RENDERER);
    size_t length = strlen(display->description);
    snprintf(display->description + length, sizeof display->description - length, ", OpenGL %s, %s",
             version ? version : "?", renderer ? renderer : "?");
    GLint max_texture_px = 0;
    gl->GetIntegerv(GL_MAX_TEXTURE_SIZE, &max_texture_px);
    display->max_texture_px = max_texture_px;
}

static bool open_kind(karst_display *display, karst_display_kind kind, karst_error *error)
{
    display->kind = kind;
    if (kind == KARST_DISPLAY_NONE) {
        strcpy(display->description, "none");
        return true;
    }
    /* What is bound would stand in the way of the other library's context. */
    if (bound_display)
        bound_display->platform->unbind(bound_display->native);
    bound_display = NULL;
    if (!(kind == KARST_DISPLAY_EGL ? karst_display_open_egl(display, error)
                                    : karst_display_open_osmesa(display, error)))
        return false;
    bound_display = display;
    describe(display);
    return true;
}

static bool open_best(karst_display *display, karst_error *error)
{
    static const karst_display_kind order[] = {KARST_DISPLAY_EGL, KARST_DISPLAY_OSMESA, KARST_DISPLAY_NONE};
    for (size_t i = 0; i < sizeof order / sizeof order[0]; i++) {
        karst_error reason = {0};
        if (open_kind(display, order[i], &reason))
            return true;
        karst_log_print(display->log, KARST_LOG_INFO, "display: %s; going on with %s", reason.message,
                        karst_display_kind_name(order[i + 1]));
    }
    return karst_fail(error, KARST_NO_DEVICE, "no display could be opened"); /* not reached: NONE always can */
}

karst_display *karst_display_create(karst_display_kind kind, const karst_log *log, karst_error *error)
{
    if (kind == KARST_DISPLAY_WINDOW || (unsigned)kind > KARST_DISPLAY_WINDOW) {
        karst_fail(error, KARST_USAGE, "a window's display is made by karst_display_create_in_context");
        return NULL;
    }
    karst_display *display = calloc(1, sizeof *display);
    if (!display) {
        karst_fail(error, KARST_FAILED, "out of memory for a display");
        return NULL;
    }
    display->log = log;
    if (!(kind == KARST_DISPLAY_AUTO ? open_best(display, error) : open_kind(display, kind, error))) {
        free(display);
        return NULL;
    }
    karst_log_print(log, KARST_LOG_INFO, "display: %s", display->description);
    return display;
}

karst_display *karst_display_create_in_context(void *(*get_proc)(const char *name), const karst_log *log,
                                               karst_error *error)
{
    karst_display *display = calloc(1, sizeof *display);
    if (!display) {
        karst_fail(error, KARST_FAILED, "out of memory for a display");
        return NULL;
    }
    bound_display = NULL;
    display->kind = KARST_DISPLAY_WINDOW;
    display->log = log;
    if (!karst_gl_load(&display->gl, get_proc, error)) {
        free(display);
        return NULL;
    }
    strcpy(display->description, "window");
    describe(display);
    karst_log_print(log, KARST_LOG_INFO, "display: %s", display->description);
    return display;
}

void karst_display_leave(karst_display *display)
{
    if (bound_display != display)
        return;
    display->platform->unbind(display->native);
    bound_display = NULL;
}

void karst_display_destroy(karst_display *display)
{
    if (!display)
        return;
    if (display->platform) {
        karst_display_leave(display);
        display->platform->close(display->native);
    }
    free(display);
}

karst_display_kind karst_display_get_kind(const karst_display *display) { return display->kind; }

const char *karst_display_description(const karst_display *display) { return display->description; }
