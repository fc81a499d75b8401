/* The window and the screen: all of it or a part, and whose the mouse is. */
#include "demos/view/view.h"

/* The monitor that shows most of the window. */
static GLFWmonitor *nearest_monitor(GLFWwindow *window)
{
    int x, y, width, height, num_monitors;
    glfwGetWindowPos(window, &x, &y);
    glfwGetWindowSize(window, &width, &height);
    GLFWmonitor **monitors = glfwGetMonitors(&num_monitors), *best = num_monitors ? monitors[0] : NULL;
    long best_area = -1;
    for (int i = 0; i < num_monitors; i++) {
        const GLFWvidmode *mode = glfwGetVideoMode(monitors[i]);
        int left, top;
        glfwGetMonitorPos(monitors[i], &left, &top);
        if (!mode)
            continue;
        int right = left + mode->width, bottom = top + mode->height;
        long across = (x + width < right ? x + width : right) - (x > left ? x : left);
        long down = (y + height < bottom ? y + height : bottom) - (y > top ? y : top);
        if (across > 0 && down > 0 && across * down > best_area) {
            best_area = across * down;
            best = monitors[i];
        }
    }
    return best;
}

void view_window_fullscreen(viewer *v, bool fullscreen)
{
    if (fullscreen == v->fullscreen)
        return;
    GLFWmonitor *monitor = fullscreen ? nearest_monitor(v->window) : NULL;
    const GLFWvidmode *mode = monitor ? glfwGetVideoMode(monitor) : NULL;
    if (fullscreen && !mode) {
        view_complain(v, "there is no monitor to fill");
        return;
    }
    if (fullscreen) {
        glfwGetWindowPos(v->window, &v->windowed[0], &v->windowed[1]);
        glfwGetWindowSize(v->window, &v->windowed[2], &v->windowed[3]);
        glfwSetWindowMonitor(v->window, monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
    } else {
        glfwSetWindowMonitor(v->window, NULL, v->windowed[0], v->windowed[1], v->windowed[2], v->windowed[3],
                             GLFW_DONT_CARE);
    }
    v->fullscreen = fullscreen;
    v->damaged = true;
}

void view_window_capture(viewer *v, bool captured)
{
    v->captured = captured;
    v->has_cursor = false;
    glfwSetInputMode(v->window, GLFW_CURSOR, captured ? GLFW_CURSOR_DISABLED : GLFW_CURSOR_NORMAL);
    if (glfwRawMouseMotionSupported())
        glfwSetInputMode(v->window, GLFW_RAW_MOUSE_MOTION, captured);
}
