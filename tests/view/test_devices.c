/* Gamepads and dense displays without either: what they say, and what the viewer makes of it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "demos/view/devices.h"

static GLFWgamepadstate idle_pad(void)
{
    GLFWgamepadstate pad = {{0}, {0}};
    pad.axes[GLFW_GAMEPAD_AXIS_LEFT_TRIGGER] = pad.axes[GLFW_GAMEPAD_AXIS_RIGHT_TRIGGER] = -1;
    return pad;
}

static view_wishes wishes_of(const GLFWgamepadstate *pad)
{
    view_wishes w = {.faster = 1};
    view_pad_add(&w, pad, 0.1);
    return w;
}

static void assert_wishes(view_wishes w, double right, double up, double forward, double turn, double tilt)
{
    assert_true(fabs(w.right - right) < 1e-6 && fabs(w.up - up) < 1e-6 && fabs(w.forward - forward) < 1e-6);
    assert_true(fabs(w.turn_deg - turn) < 1e-5 && fabs(w.tilt_deg - tilt) < 1e-5);
}

static void test_a_pad_at_rest_asks_for_nothing(void **state)
{
    (void)state;
    GLFWgamepadstate pad = idle_pad();
    assert_wishes(wishes_of(&pad), 0, 0, 0, 0, 0);
    for (int axis = GLFW_GAMEPAD_AXIS_LEFT_X; axis <= GLFW_GAMEPAD_AXIS_RIGHT_Y; axis++)
        pad.axes[axis] = axis % 2 ? 0.14f : -0.14f;
    assert_wishes(wishes_of(&pad), 0, 0, 0, 0, 0);
    assert_true(wishes_of(&pad).faster == 1);
}

static void test_sticks_go_and_look(void **state)
{
    (void)state;
    GLFWgamepadstate pad = idle_pad();
    pad.axes[GLFW_GAMEPAD_AXIS_LEFT_X] = 1;
    assert_wishes(wishes_of(&pad), 1, 0, 0, 0, 0);
    pad = idle_pad();
    pad.axes[GLFW_GAMEPAD_AXIS_LEFT_Y] = -1; /* pushed away from oneself */
    assert_wishes(wishes_of(&pad), 0, 0, 1, 0, 0);
    pad = idle_pad();
    pad.axes[GLFW_GAMEPAD_AXIS_RIGHT_X] = -1;
    assert_wishes(wishes_of(&pad), 0, 0, 0, -12, 0);
    pad = idle_pad();
    pad.axes[GLFW_GAMEPAD_AXIS_RIGHT_Y] = -1;
    assert_wishes(wishes_of(&pad), 0, 0, 0, 0, 12);
    pad = idle_pad();
    pad.axes[GLFW_GAMEPAD_AXIS_RIGHT_TRIGGER] = 1;
    assert_wishes(wishes_of(&pad), 0, 1, 0, 0, 0);
    pad.axes[GLFW_GAMEPAD_AXIS_LEFT_TRIGGER] = 1;
    assert_wishes(wishes_of(&pad), 0, 0, 0, 0, 0);
    pad.axes[GLFW_GAMEPAD_AXIS_RIGHT_TRIGGER] = -1;
    assert_wishes(wishes_of(&pad), 0, -1, 0, 0, 0);
}

/* From the end of its rest on a stick asks for more and more, without a leap, and for all at its end. */
static void test_sticks_start_gently(void **state)
{
    (void)state;
    double before = 0;
    for (int i = 0; i <= 1000; i++) {
        double asked = view_pad_stick(i / 1000.0);
        assert_true(asked >= before && asked - before < 0.002);
        assert_true(view_pad_stick(-i / 1000.0) == -asked);
        before = asked;
    }
    assert_true(before == 1);
    assert_true(view_pad_stick(1.02) == 1); /* some drivers say a little more */
}

static void test_bumpers_change_the_speed(void **state)
{
    (void)state;
    GLFWgamepadstate pad = idle_pad();
    pad.buttons[GLFW_GAMEPAD_BUTTON_RIGHT_BUMPER] = GLFW_PRESS;
    assert_true(wishes_of(&pad).faster == 10);
    pad.buttons[GLFW_GAMEPAD_BUTTON_LEFT_BUMPER] = GLFW_PRESS;
    assert_true(wishes_of(&pad).faster == 1);
    pad.buttons[GLFW_GAMEPAD_BUTTON_RIGHT_BUMPER] = GLFW_RELEASE;
    assert_true(fabs(wishes_of(&pad).faster - 0.1) < 1e-12);
    /* On top of what keys ask for. */
    view_wishes w = {.faster = 10, .forward = 1};
    pad.axes[GLFW_GAMEPAD_AXIS_LEFT_Y] = -1;
    view_pad_add(&w, &pad, 0.1);
    assert_true(fabs(w.faster - 1) < 1e-12 && w.forward == 2);
}

static void test_dense_displays(void **state)
{
    (void)state;
    assert_true(view_scale_of(0, 2) == 2 && view_scale_of(0, 1.25) == 1.25);
    assert_true(view_scale_of(1.5, 2) == 1.5);
    /* What cannot be: no panel as large as the window, or too small to read. */
    assert_true(view_scale_of(0, 0) == 1 && view_scale_of(0, 96) == 1 && view_scale_of(0, (double)NAN) == 1);
    /* A window of 800 that is shown with 1600 pixels. */
    assert_true(view_cursor_px(400, 800, 1600) == 800 && view_cursor_px(799.5, 800, 800) == 799.5);
    assert_true(view_cursor_px(10, 0, 0) == 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_pad_at_rest_asks_for_nothing), cmocka_unit_test(test_sticks_go_and_look),
        cmocka_unit_test(test_sticks_start_gently),            cmocka_unit_test(test_bumpers_change_the_speed),
        cmocka_unit_test(test_dense_displays),
    };
    return cmocka_run_group_tests_name("devices", tests, NULL, NULL);
}
