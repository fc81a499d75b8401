/* The window, and what happens to it. */
#include "demos/view/devices.h"
#include "demos/view/view.h"

#include <string.h>

static char glfw_says[256];

static void on_glfw_error(int code, const char *text)
{
    (void)code;
    snprintf(glfw_says, sizeof glfw_says, "%s", text);
}

static viewer *viewer_of(GLFWwindow *window) { return glfwGetWindowUserPointer(window); }

/* From the window's coordinates to framebuffer pixels: they differ on some displays of high density. */
static void to_pixels(viewer *v, double *x, double *y)
{
    int width, height;
    glfwGetWindowSize(v->window, &width, &height);
    *x = view_cursor_px(*x, width, v->width_px);
    *y = view_cursor_px(*y, height, v->height_px);
}

/* What comes while the engine is at work waits: it might ask something of the engine. */
static void take(viewer *v, view_event event)
{
    switch (event.kind) {
    case VIEW_EVENT_KEY:
        view_key_event(v, event.key, event.action != GLFW_RELEASE, event.action == GLFW_REPEAT, event.mods);
        break;
    case VIEW_EVENT_CHAR:
        view_char_event(v, (unsigned)event.key);
        break;
    /* Where the cursor was when the button changed is what was last heard of it, not where it is by now. */
    case VIEW_EVENT_BUTTON:
        view_button_event(v, event.key, event.action == GLFW_PRESS, event.mods);
        break;
    case VIEW_EVENT_CURSOR:
        to_pixels(v, &event.x, &event.y);
        view_cursor_event(v, event.x, event.y);
        break;
    case VIEW_EVENT_SCROLL:
        view_scroll_event(v, event.y);
        break;
    }
}

static void hear(GLFWwindow *window, view_event event)
{
    viewer *v = viewer_of(window);
    if (!v->listening)
        take(v, event);
    else if (v->num_events < VIEW_MAX_EVENTS) /* more than hands can do in one frame */
        v->events[v->num_events++] = event;
}

bool view_window_is_quiet(viewer *v)
{
    v->listening = true;
    glfwPollEvents();
    v->listening = false;
    return v->num_events == 0 && !v->leaving && !v->opening.is_wished;
}

bool view_window_deliver(viewer *v)
{
    int num = v->num_events;
    v->num_events = 0;
    for (int i = 0; i < num; i++)
        take(v, v->events[i]);
    return num > 0;
}

static void on_key(GLFWwindow *window, int key, int scancode, int action, int mods)
{
    (void)scancode;
    hear(window, (view_event){.kind = VIEW_EVENT_KEY, .key = key, .action = action, .mods = mods});
}

static void on_char(GLFWwindow *window, unsigned codepoint)
{
    hear(window, (view_event){.kind = VIEW_EVENT_CHAR, .key = (int)codepoint});
}

static void on_button(GLFWwindow *window, int button, int action, int mods)
{
    hear(window, (view_event){.kind = VIEW_EVENT_BUTTON, .key = button, .action = action, .mods = mods});
}

static void on_cursor(GLFWwindow *window, double x, double y)
{
    hear(window, (view_event){.kind = VIEW_EVENT_CURSOR, .x = x, .y = y});
}

static void on_scroll(GLFWwindow *window, double x, double y)
{
    hear(window, (view_event){.kind = VIEW_EVENT_SCROLL, .x = x, .y = y});
}

static void on_framebuffer(GLFWwindow *window, int width, int height)
{
    viewer *v = viewer_of(window);
    v->width_px = width;
    v->height_px = height;
    v->resized = v->damaged = v->hud_dirty = true;
}

static void on_scale(GLFWwindow *window, float x, float y)
{
    viewer *v = viewer_of(window);
    (void)y;
    v->scale = view_scale_of(v->settings.scale, (double)x);
    v->hud_dirty = true;
}

static void on_refresh(GLFWwindow *window) { viewer_of(window)->damaged = true; }
static void on_iconify(GLFWwindow *window, int iconified)
{
    viewer_of(window)->iconified = iconified;
    viewer_of(window)->damaged = true;
}
static void on_focus(GLFWwindow *window, int focused)
{
    viewer *v = viewer_of(window);
    v->focused = focused;
    if (!focused)
        view_release_all(v);
}
static void on_close(GLFWwindow *window) { viewer_of(window)->leaving = true; }
static void on_drop(GLFWwindow *window, int count, const char **paths)
{
    if (count > 0)
        view_open_wish(viewer_of(window), paths[0]);
}

static void set_callbacks(GLFWwindow *window)
{
    glfwSetKeyCallback(window, on_key);
    glfwSetCharCallback(window, on_char);
    glfwSetMouseButtonCallback(window, on_button);
    glfwSetCursorPosCallback(window, on_cursor);
    glfwSetScrollCallback(window, on_scroll);
    glfwSetFramebufferSizeCallback(window, on_framebuffer);
    glfwSetWindowContentScaleCallback(window, on_scale);
    glfwSetWindowRefreshCallback(window, on_refresh);
    glfwSetWindowIconifyCallback(window, on_iconify);
    glfwSetWindowFocusCallback(window, on_focus);
    glfwSetWindowCloseCallback(window, on_close);
    glfwSetDropCallback(window, on_drop);
}

static void choose_size(const viewer *v, int size[2])
{
    memcpy(size, v->settings.size_px, 2 * sizeof *size);
    if (!v->settings.has_size && v->memory.has_window)
        memcpy(size, v->memory.size_px, 2 * sizeof *size);
    const GLFWvidmode *mode = glfwGetPrimaryMonitor() ? glfwGetVideoMode(glfwGetPrimaryMonitor()) : NULL;
    if (mode && !v->settings.has_size) {
        size[0] = size[0] > mode->width ? mode->width : size[0];
        size[1] = size[1] > mode->height ? mode->height : size[1];
    }
}

bool view_window_open(viewer *v, karst_error *error)
{
    glfwSetErrorCallback(on_glfw_error);
    if (!glfwInit())
        return karst_fail(error, KARST_NO_DEVICE, "no window can be opened here (%s); karst render needs none",
                          glfw_says);
    char title[256];
    snprintf(title, sizeof title, "%s - karst", v->world);
    int size[2];
    choose_size(v, size);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    glfwWindowHint(GLFW_DEPTH_BITS, 0);
    glfwWindowHint(GLFW_STENCIL_BITS, 0);
    glfwWindowHint(GLFW_SRGB_CAPABLE, GLFW_FALSE);
    if (!v->settings.has_size && !v->memory.has_window)
        glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    glfwWindowHintString(GLFW_X11_CLASS_NAME, "karst");
    glfwWindowHintString(GLFW_X11_INSTANCE_NAME, "karst");
    /* To be told of a lost context, where the driver can tell. */
    glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);
    v->window = glfwCreateWindow(size[0], size[1], title, NULL, NULL);
    if (!v->window) {
        glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_NO_ROBUSTNESS);
        v->window = glfwCreateWindow(size[0], size[1], title, NULL, NULL);
    }
    if (!v->window)
        return karst_fail(error, KARST_NO_DEVICE,
                          "no window with OpenGL 3.3 can be opened here (%s); karst render needs none", glfw_says);
    glfwSetWindowUserPointer(v->window, v);
    glfwMakeContextCurrent(v->window);
    glfwSwapInterval(1);
    set_callbacks(v->window);
    float scale = 1, ignored;
    glfwGetWindowContentScale(v->window, &scale, &ignored);
    on_scale(v->window, scale, scale);
    glfwGetFramebufferSize(v->window, &v->width_px, &v->height_px);
    v->focused = true;
    v->resized = true;
    if (v->memory.has_window && !v->settings.has_size)
        glfwSetWindowPos(v->window, v->memory.position_px[0], v->memory.position_px[1]);
    if (v->settings.fullscreen || (v->memory.fullscreen && !v->settings.has_size))
        view_window_fullscreen(v, true);
    return true;
}

void view_window_close(viewer *v)
{
    if (v->window)
        glfwDestroyWindow(v->window);
    v->window = NULL;
    glfwTerminate();
}
