/* What one asks of the viewer at its start and takes away from it: modes, commands, bookmarks, panels. */
#include "tests/window/session.h"

#include <math.h>

#define SIZED " --size 640x480"
#define WORLD_TEXT                                                                                                  \
    "/*{ \"voxel\": 0.25, \"params\": { \"height\": { \"value\": 4, \"min\": 0, \"max\": 20 } },\n"                   \
    "    \"camera\": { \"position\": [\"0\", \"20\", \"0\"], \"yaw\": 0, \"pitch\": -30, \"fov\": 60 } }*/\n"         \
    "float density(vec3 p) { return height * sin(p.x * 0.05) - p.y; }\n"

static int open_world(void **state)
{
    int opened = open_session(state);
    write_file("plain.karst", WORLD_TEXT);
    return opened;
}

static void test_walking_from_the_start(void **state)
{
    (void)state;
    open_viewer("plain.karst" SIZED " --view-distance 600 --mode walk");
    UNTIL(strcmp(text("mode"), "walk") == 0 && yes("on_ground"));
    assert_true(where().y < 8); /* it came down to the ground */
    close_viewer();
}

static void test_orbiting_from_the_start(void **state)
{
    (void)state;
    open_viewer("plain.karst" SIZED " --view-distance 600 --mode orbit");
    UNTIL(strcmp(text("mode"), "orbit") == 0);
    place before = where();
    assert_true(fabs(before.x) < 1e-6 && fabs(before.y - 20) < 1e-6 && fabs(before.z) < 1e-6);
    key("d");
    UNTIL(fabs(where().x) > 1e-3);
    /* Around what the cross-hair was on: 40 m away. */
    assert_in_range((int)(10 * hypot(hypot(where().x, where().y), where().z - 20 / tan(M_PI / 6))), 380, 420);
    close_viewer();
}

static void test_the_command_has_all_that_the_picture_has(void **state)
{
    (void)state;
    open_viewer("plain.karst" SIZED " --view-distance 600 --seed 7");
    assert_non_null(json_object_get(viewer_value("panels"), "compass"));
    key("p");
    UNTIL(yes("sliders"));
    key("Right");
    UNTIL(parameter("height") > 4);
    key("c");
    UNTIL(*text("copied"));
    assert_non_null(
        strstr(text("copied"), "karst render plain.karst --camera 0,20,0,0,-30,60 --seed 7 --param height="));
    /* What was copied is a command that draws. */
    char command[16384];
    snprintf(command, sizeof command, "cd '%s' && '%s'%s --display none --size 32x24 --pool 64 -q -o copied.png",
             s.folder, s.karst, text("copied") + strlen("karst"));
    assert_int_equal(system(command), 0);
    close_viewer();
}

static void test_bookmarks_are_the_worlds(void **state)
{
    (void)state;
    open_viewer("plain.karst" SIZED " --view-distance 600 --camera 30,25,7,10,-20");
    key("ctrl+4");
    UNTIL(strstr(text("message"), "bookmark 4"));
    close_viewer();
    write_file("another name.karst", WORLD_TEXT);
    write_file("other.karst", WORLD_TEXT "// another text\n");
    assert_int_equal(rename(in_folder("another name.karst"), in_folder("second.karst")), 0);
    open_viewer("./second.karst" SIZED " --view-distance 600");
    key("4");
    UNTIL(fabs(where().x - 30) < 1e-6 && fabs(where().y - 25) < 1e-6);
    close_viewer();
    open_viewer("other.karst" SIZED " --view-distance 600");
    key("4");
    UNTIL(strstr(text("message"), "there is no bookmark 4"));
    close_viewer();
}

static int run_karst(const char *arguments)
{
    char command[2 * PATH_MAX + 300];
    snprintf(command, sizeof command, "cd '%s' && '%s' %s", s.folder, s.karst, arguments);
    return system(command);
}

static void test_a_saved_world_keeps_where_one_was(void **state)
{
    (void)state;
    assert_int_equal(run_karst("new -q kept.karstdb --from plain.karst --param height=2 --embed"), 0);
    assert_int_equal(run_karst("edit -q kept.karstdb --add box,30,10,30,5,20,5"), 0);
    open_viewer("kept.karstdb" SIZED " --view-distance 600 --camera 30,25,7,10,-20");
    assert_true(parameter("height") == 2);
    key("ctrl+4");
    UNTIL(strstr(text("message"), "bookmark 4"));
    close_viewer();
    assert_null(strstr(read_file("said"), "not kept"));
    open_viewer("kept.karstdb" SIZED " --view-distance 600"); /* where it ended */
    assert_true(fabs(where().x - 30) < 1e-6 && fabs(where().y - 25) < 1e-6 && fabs(where().pitch + 20) < 1e-6);
    key("Home");
    UNTIL(fabs(where().y - 20) < 1e-6);
    key("4");
    UNTIL(fabs(where().x - 30) < 1e-6 && fabs(where().y - 25) < 1e-6);
    key("Home");
    UNTIL(fabs(where().y - 20) < 1e-6);
    close_viewer();
    open_viewer("plain.karst" SIZED " --view-distance 600"); /* and its world's own memory has nothing of it */
    key("5");
    UNTIL(strstr(text("message"), "there is no bookmark 5"));
    close_viewer();
    assert_int_equal(run_karst("edit -q kept.karstdb --check > /dev/null"), 0);
    assert_int_equal(run_karst("info kept.karstdb > info"), 0);
    assert_non_null(strstr(read_file("info"), "camera 0,20,0,0,-30,60\n  bookmark 4 30,25,7,10,-20,60\n  1 edits"));
}

static void test_a_file_that_goes(void **state)
{
    (void)state;
    open_viewer("plain.karst" SIZED " --view-distance 600");
    assert_int_equal(unlink(in_folder("plain.karst")), 0);
    UNTIL(strstr(text("message"), "no longer there"));
    write_file("plain.karst", WORLD_TEXT);
    UNTIL(strstr(text("message"), "there again") || yes("compiling") || number("reloads") > 0);
    close_viewer();
}

static void test_the_depth_view_has_a_scale(void **state)
{
    (void)state;
    open_viewer("plain.karst --size 960x480 --view-distance 600 --view depth");
    UNTIL(json_object_get(viewer_value("panels"), "depth"));
    key("v");
    UNTIL(strcmp(text("view"), "normal") == 0);
    UNTIL(!json_object_get(viewer_value("panels"), "depth"));
    close_viewer();
}

int main(void)
{
    if (is_left_out())
        return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_walking_from_the_start),
        cmocka_unit_test(test_orbiting_from_the_start),
        cmocka_unit_test(test_the_command_has_all_that_the_picture_has),
        cmocka_unit_test(test_bookmarks_are_the_worlds),
        cmocka_unit_test(test_a_saved_world_keeps_where_one_was),
        cmocka_unit_test(test_a_file_that_goes),
        cmocka_unit_test(test_the_depth_view_has_a_scale),
    };
    return cmocka_run_group_tests(tests, open_world, close_session);
}
