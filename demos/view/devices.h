/* What gamepads and dense displays say, in the viewer's own terms. Plain arithmetic: no device is needed to test it. */
#ifndef KARST_DEMOS_VIEW_DEVICES_H
#define KARST_DEMOS_VIEW_DEVICES_H

#include <GLFW/glfw3.h>
#include <math.h>

/* What keys and gamepads ask for in a step. */
typedef struct {
    double right, up, forward; /* -1 to 1 each for keys, and for a gamepad */
    double turn_deg, tilt_deg; /* of this step: to the right, upwards */
    double faster;             /* a factor */
} view_wishes;

#define VIEW_PAD_DEG_PER_S 120.0
#define VIEW_PAD_REST 0.15 /* of a stick's way: sticks that are let go come to lie somewhere in there */

/* A stick's way beyond its rest, -1 to 1. */
static inline double view_pad_stick(double value)
{
    double size = fabs(value);
    return size < VIEW_PAD_REST ? 0 : copysign(fmin(1, (size - VIEW_PAD_REST) / (1 - VIEW_PAD_REST)), value);
}

/* Adds what a gamepad asks for: the left stick goes (GLFW counts down as positive), the right one looks, triggers rise
 * (right) and sink (left), bumpers are ten times as fast (right) and slow (left). */
static inline void view_pad_add(view_wishes *w, const GLFWgamepadstate *pad, double dt_s)
{
    w->right += view_pad_stick((double)pad->axes[GLFW_GAMEPAD_AXIS_LEFT_X]);
    w->forward -= view_pad_stick((double)pad->axes[GLFW_GAMEPAD_AXIS_LEFT_Y]);
    /* From -1 when let go to 1. */
    w->up += (double)(pad->axes[GLFW_GAMEPAD_AXIS_RIGHT_TRIGGER] - pad->axes[GLFW_GAMEPAD_AXIS_LEFT_TRIGGER]) / 2;
    w->turn_deg += view_pad_stick((double)pad->axes[GLFW_GAMEPAD_AXIS_RIGHT_X]) * VIEW_PAD_DEG_PER_S * dt_s;
    w->tilt_deg -= view_pad_stick((double)pad->axes[GLFW_GAMEPAD_AXIS_RIGHT_Y]) * VIEW_PAD_DEG_PER_S * dt_s;
    if (pad->buttons[GLFW_GAMEPAD_BUTTON_RIGHT_BUMPER])
        w->faster *= 10;
    if (pad->buttons[GLFW_GAMEPAD_BUTTON_LEFT_BUMPER])
        w->faster /= 10;
}

/* The size of type and panels: what is set (0: nothing), else what the display says, if that can be. */
static inline double view_scale_of(double set, double display)
{
    return set > 0 ? set : display > 0.5 && display < 8 ? display : 1;
}

/* A cursor's place in the window's coordinates, along one axis, in framebuffer pixels: they differ on some displays of
 * high density. */
static inline double view_cursor_px(double place, int window_size, int framebuffer_px)
{
    return window_size > 0 ? place * framebuffer_px / window_size : place;
}

#endif
