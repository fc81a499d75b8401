/* A display of 192 dots to the inch: panels are twice as large as on one of 96, and hands find what they see. */
#include "tests/window/session.h"

#include <math.h>

#define SIZED " --size 640x480"

static int panel(const char *name, int index)
{
    const json_t *numbers = json_object_get(viewer_value("panels"), name);
    assert_non_null(numbers);
    return (int)json_integer_value(json_array_get(numbers, (size_t)index));
}

static int open_world(void **state)
{
    int opened = open_session(state);
    /* Where toolkits look for a display's density. */
    if (system("xprop -root -f RESOURCE_MANAGER 8s -set RESOURCE_MANAGER 'Xft.dpi: 192\n'") != 0)
        fail_msg("xprop does not answer: is it installed (x11-utils)?");
    write_file("plain.karst",
               "/*{ \"voxel\": 0.25, \"params\": { \"height\": { \"value\": 4, \"min\": 0, \"max\": 20 } },\n"
               "    \"camera\": { \"position\": [\"0\", \"60\", \"0\"], \"yaw\": 0, \"pitch\": -30, \"fov\": 60 } }*/\n"
               "float density(vec3 p) { return height * sin(p.x * 0.05) - p.y; }\n");
    return opened;
}

static void test_panels_follow_the_display(void **state)
{
    (void)state;
    open_viewer("plain.karst" SIZED " --view-distance 600 --scale 1");
    assert_true(json_integer_value(json_array_get(viewer_value("window"), 0)) == 640);
    int plain_height = panel("status", 3);
    key("p");
    UNTIL(yes("sliders") && json_object_get(viewer_value("panels"), "sliders"));
    int plain_sliders = panel("sliders", 2);
    close_viewer();

    open_viewer("plain.karst" SIZED " --view-distance 600");
    assert_true(json_integer_value(json_array_get(viewer_value("window"), 0)) == 640);
    assert_in_range(panel("status", 3), 2 * plain_height - 1, 2 * plain_height + 1);
    key("p");
    UNTIL(yes("sliders") && json_object_get(viewer_value("panels"), "sliders"));
    assert_in_range(panel("sliders", 2), 2 * plain_sliders - 1, 2 * plain_sliders + 1);
}

/* A track lies where the panel's own measures, twice as large, say. */
static void test_the_mouse_hits_what_it_points_at(void **state)
{
    (void)state;
    int left = panel("sliders", 0) + 2 * 10, width = panel("sliders", 2) - 2 * 20,
        row = panel("sliders", 1) + 2 * (30 + 25);
    assert_true(act("mousemove %d %d mousedown 1", left + width / 5, row));
    nap(0.1);
    assert_true(act("mousemove %d %d mouseup 1", left + width * 3 / 4, row));
    UNTIL(fabs(parameter("height") - 15) < 0.3);
    key("p");
    UNTIL(!yes("sliders"));
    /* Looking by dragging turns by the picture's own angle, whatever the density. */
    place before = where();
    assert_true(act("mousemove 300 240 mousedown 1 mousemove 310 240 mousemove 358 240 mouseup 1"));
    UNTIL(fabs(where().yaw - before.yaw - 6) < 0.01); /* 60 degrees for 480 pixels */
    close_viewer();
}

int main(void)
{
    if (is_left_out())
        return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_panels_follow_the_display),
        cmocka_unit_test(test_the_mouse_hits_what_it_points_at),
    };
    return cmocka_run_group_tests(tests, open_world, close_session);
}
