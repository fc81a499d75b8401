/* Beginnings and ends of the viewer: settings, what is remembered, flights without hands, and ends that nobody wished.
 */
#include "tests/window/session.h"

#include <math.h>

#define WORLD_TEXT                                                                                                \
    "/*{ \"voxel\": 0.25, \"camera\": { \"position\": [\"0\", \"60\", \"0\"], \"yaw\": 0, \"pitch\": -30 } }*/\n" \
    "float density(vec3 p) { return 4.0 * sin(p.x * 0.05) - p.y; }\n"
#define OPTIONS "plain.karst --view-distance 600"
#define SIZED OPTIONS " --size 320x240"

static int open_world(void **state)
{
    open_session(state);
    write_file("plain.karst", WORLD_TEXT);
    return 0;
}

static void test_flags_over_environment_over_file_over_defaults(void **state)
{
    (void)state;
    assert_int_equal(mkdir(in_folder("karst"), 0755), 0);
    open_viewer(SIZED);
    assert_true(number("fps") == 30);
    close_viewer();
    write_file("karst/config", "# of a test\n\nfps = 41\n  fixed-resolution = yes\n");
    open_viewer(SIZED);
    assert_true(number("fps") == 41);
    assert_true(yes("fixed_resolution"));
    close_viewer();
    setenv("KARST_VIEW_FPS", "42", 1);
    setenv("KARST_VIEW_FIXED_RESOLUTION", "no", 1);
    open_viewer(SIZED);
    assert_true(number("fps") == 42);
    assert_false(yes("fixed_resolution"));
    close_viewer();
    open_viewer(SIZED " --fps 43");
    assert_true(number("fps") == 43);
    close_viewer();
    unsetenv("KARST_VIEW_FPS");
    unsetenv("KARST_VIEW_FIXED_RESOLUTION");
    /* A mistake is told with its place, before there is a window. */
    write_file("karst/config", "fps = 30\nfsp = 41\n");
    launch(SIZED);
    assert_int_equal(wait_for_end(), 2);
    assert_non_null(strstr(read_file("said"), "config:2: there is no option 'fsp'"));
    unlink(in_folder("karst/config"));
}

static void test_the_window_is_remembered(void **state)
{
    (void)state;
    open_viewer(SIZED);
    assert_true(act("search --onlyvisible --class karst windowsize 400 300"));
    UNTIL(json_integer_value(json_array_get(viewer_value("window"), 0)) == 400);
    assert_true(act("search --onlyvisible --class karst windowmove 30 20"));
    key("Tab");
    UNTIL(strcmp(text("page"), "frame") == 0);
    close_viewer();
    open_viewer(OPTIONS);
    assert_true(json_integer_value(json_array_get(viewer_value("window"), 0)) == 400);
    assert_true(json_integer_value(json_array_get(viewer_value("window"), 1)) == 300);
    assert_string_equal(text("page"), "frame");
    close_viewer();
}

static void test_a_flight_without_hands(void **state)
{
    (void)state;
    write_file("way.json",
               "{\"keyframes\": [{\"time\": 0, \"position\": [\"0\", \"60\", \"0\"], \"yaw\": 0, \"pitch\": -30},"
               " {\"time\": 1.5, \"position\": [\"25\", \"50\", \"3\"], \"yaw\": 40, \"pitch\": -20}]}");
    launch(SIZED " --detail 2 --pool 64 --no-shadows --replay way.json --stats stats.json");
    assert_int_equal(wait_for_end(), 0);
    json_decref(s.stats);
    s.stats = json_load_file(in_folder("stats.json"), 0, NULL);
    assert_non_null(s.stats);
    place end = where();
    assert_true(end.x == 25 && end.y == 50 && end.z == 3 && fabs(end.yaw - 40) < 1e-9);
    assert_true(json_integer_value(json_object_get(s.stats, "frames")) > 1);
    launch(SIZED " --replay no-such-path");
    assert_int_equal(wait_for_end(), 5);
}

static void test_closing_in_the_middle_of_a_compilation(void **state)
{
    (void)state;
    open_viewer(SIZED);
    write_file("plain.karst",
               "float density(vec3 p) { return 300.0 * fbm(p / 1024.0, 9) + ridged(p / 77.0, 7) - p.y; }\n");
    for (double end_s = now_s() + 1; now_s() < end_s; nap(0.05)) {
        assert_true(ask());
        if (yes("compiling"))
            break;
    }
    kill(s.viewer, SIGTERM);
    assert_int_equal(wait_for_end(), 0);
    write_file("plain.karst", WORLD_TEXT);
}

/* Records a path and moves a little. */
static void record(void)
{
    open_viewer(SIZED " --speed 20");
    key("F6");
    UNTIL(yes("recording"));
    key("d");
    UNTIL(where().x > 0 && yes("settled"));
}

static void expect_path(const char *name, const char *words)
{
    assert_non_null(strstr(read_file("said"), words));
    assert_non_null(strstr(read_file("said"), "you were at: karst view plain.karst --camera "));
    assert_true(access(in_folder(name), R_OK) == 0);
    assert_non_null(strstr(read_file(name), "\"keyframes\""));
}

static void test_a_lost_context_saves_the_path(void **state)
{
    (void)state;
    char command[2 * PATH_MAX + 100], source[PATH_MAX];
    assert_non_null(realpath("tests/window/lose_context.c", source));
    const char *cc = getenv("CC");
    snprintf(command, sizeof command, "%s -shared -fPIC -o '%s' '%s' -ldl", cc && *cc ? cc : "cc", in_folder("lose.so"),
             source);
    assert_int_equal(system(command), 0);
    setenv("KARST_TEST_LOSE", in_folder("lost"), 1);
    setenv("LD_PRELOAD", in_folder("lose.so"), 1);
    record();
    unsetenv("LD_PRELOAD");
    write_file("lost", "now");
    act("mousemove 100 100 mousedown 1 mousemove 120 100 mouseup 1"); /* something to draw */
    assert_int_equal(wait_for_end(), 1);
    expect_path("karst-plain-001.json", "lost this window's context");
}

static void test_a_server_that_goes_away(void **state)
{
    (void)state;
    record();
    stop(&s.server, SIGKILL);
    assert_int_equal(wait_for_end(), 1);
    expect_path("karst-plain-002.json", "the display is gone");
    launch(SIZED);
    assert_int_equal(wait_for_end(), 3);
    assert_non_null(strstr(read_file("said"), "no window can be opened here"));
}

int main(void)
{
    if (is_left_out())
        return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_flags_over_environment_over_file_over_defaults),
        cmocka_unit_test(test_the_window_is_remembered),
        cmocka_unit_test(test_a_flight_without_hands),
        cmocka_unit_test(test_closing_in_the_middle_of_a_compilation),
        cmocka_unit_test(test_a_lost_context_saves_the_path),
        cmocka_unit_test(test_a_server_that_goes_away),
    };
    return cmocka_run_group_tests(tests, open_world, close_session);
}
