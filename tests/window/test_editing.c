/* What changes while one looks: the world file, its parameters, the window; and what one leaves with. */
#include "tests/window/session.h"

#include <math.h>

#include <karst/saved.h>

/* A plain in one colour, with a parameter that its density uses. */
static const char world[] =
    "/*{ \"voxel\": 0.25,\n"
    "    \"params\": { \"height\": { \"value\": 4, \"min\": 0, \"max\": 20, \"unit\": \"m\", \"label\": \"Height\" } "
    "},\n"
    "    \"camera\": { \"position\": [\"0\", \"60\", \"0\"], \"yaw\": 0, \"pitch\": -30, \"fov\": 60 } }*/\n"
    "float density(vec3 p) { return height * sin(p.x * 0.05) - p.y; }\n"
    "vec3 colour(vec3 p, vec3 n) { return vec3(%s); }\n";

static void write_world_by(void write(const char *, const char *), const char *colour)
{
    char all[2048];
    snprintf(all, sizeof all, world, colour);
    write("plain.karst", all);
}

static void write_world(const char *colour) { write_world_by(write_file, colour); }

#define OPTIONS "plain.karst --size 320x240 --view-distance 600 --speed 20"

static int open_world(void **state)
{
    open_session(state);
    write_world("0.8, 0.05, 0.05");
    open_viewer(OPTIONS);
    return 0;
}

static int close_world(void **state)
{
    if (s.viewer > 0)
        close_viewer();
    return close_session(state);
}

static void test_a_colour_edit_makes_no_brick(void **state)
{
    (void)state;
    shot red = take_shot();
    json_int_t before = produced();
    assert_true(mean_below(&red, 0) > 2 * mean_below(&red, 2));
    write_world("0.05, 0.05, 0.8");
    UNTIL(number("reloads") == 1 && yes("settled"));
    shot blue = take_shot();
    assert_true(mean_below(&blue, 2) > 1.5 * mean_below(&blue, 0));
    assert_int_equal(produced(), before);
    free(red.rgba);
    free(blue.rgba);
}

static void test_the_picture_moves_while_a_world_is_compiled(void **state)
{
    (void)state;
    assert_true(act("keydown d"));
    write_world("0.05, 0.8, 0.07");
    UNTIL(number("reloads") == 2);
    assert_true(act("keyup d"));
    UNTIL(yes("settled"));
    assert_true(number("frames_while_compiling") > 1);
    assert_true(where().x > 0.1); /* and the camera stayed with whoever moved it */
    key("Home");
}

static void test_a_mistake_keeps_the_picture(void **state)
{
    (void)state;
    UNTIL(yes("settled") && where().x == 0 && !*text("message"));
    shot before = take_shot();
    double reloads = number("reloads"), errors = number("reload_errors");
    write_world("0.05, 0.8, 0.07) + wrong(1.0");
    UNTIL(number("reload_errors") == errors + 1);
    assert_non_null(strstr(text("error"), "plain.karst:5:"));
    assert_non_null(strstr(text("error"), "error: "));
    assert_non_null(strstr(text("error"), "wrong(1.0"));
    assert_non_null(strstr(text("error"), "^"));
    assert_true(number("reloads") == reloads);
    assert_non_null(json_object_get(viewer_value("panels"), "error"));
    assert_non_null(strstr(read_file("said"), "plain.karst:5:"));
    nap(0.3);
    shot after = take_shot();
    assert_true(fabs(mean_below(&before, 1) - mean_below(&after, 1)) < 3);
    write_world("0.05, 0.8, 0.07");
    UNTIL(number("reloads") == reloads + 1 && !*text("error"));
    assert_null(json_object_get(viewer_value("panels"), "error"));
    free(before.rgba);
    free(after.rgba);
}

/* Most programs empty a file before they write it: what is there meanwhile is no mistake. */
static void test_a_file_that_is_being_written_is_waited_for(void **state)
{
    (void)state;
    double errors = number("reload_errors"), reloads = number("reloads"), took_s;
    do { /* on a busy machine the pause may come to last as long as that of a file that is meant to be empty */
        double from_s = now_s();
        write_in_place("plain.karst", "");
        nap(0.3); /* six looks at it */
        write_world_by(write_in_place, "0.05, 0.8, 0.07");
        took_s = now_s() - from_s;
        UNTIL(number("reloads") > reloads && !*text("error"));
        if (took_s <= 1.5)
            assert_true(number("reload_errors") == errors);
        errors = number("reload_errors");
        reloads = number("reloads");
    } while (took_s > 1.5);
    /* One that stays empty is. */
    write_in_place("plain.karst", "");
    UNTIL(number("reload_errors") == errors + 1);
    assert_non_null(strstr(text("error"), "plain.karst"));
    write_world("0.05, 0.8, 0.07");
    UNTIL(number("reloads") == reloads + 1 && !*text("error"));
}

/* The place of a share of the first slider's track. */
static int slider_x(double share)
{
    const json_t *panel = json_object_get(viewer_value("panels"), "sliders");
    int left = (int)json_integer_value(json_array_get(panel, 0)),
        width = (int)json_integer_value(json_array_get(panel, 2));
    return left + 10 + (int)((width - 20) * share);
}

static int slider_y(void)
{
    const json_t *panel = json_object_get(viewer_value("panels"), "sliders");
    return (int)json_integer_value(json_array_get(panel, 1)) + 30 + 25;
}

static void test_sliders(void **state)
{
    (void)state;
    key("p");
    UNTIL(yes("sliders") && json_object_get(viewer_value("panels"), "sliders"));
    assert_true(parameter("height") == 4);
    json_int_t before = produced();
    assert_true(act("mousemove %d %d mousedown 1", slider_x(0.2), slider_y()));
    nap(0.1);
    assert_true(act("mousemove %d %d", slider_x(0.6), slider_y()));
    nap(0.1);
    assert_true(act("mousemove %d %d mouseup 1", slider_x(0.75), slider_y()));
    UNTIL(fabs(parameter("height") - 15) < 0.5 && yes("settled"));
    assert_true(produced() > before); /* the density uses it */
    double dragged = parameter("height");
    key("Right");
    UNTIL(fabs(parameter("height") - dragged - 0.2) < 1e-9);
    key("shift+Left");
    UNTIL(fabs(parameter("height") - dragged + 1.8) < 1e-9);
    key("BackSpace");
    UNTIL(parameter("height") == 4);
    /* Out to the left of its track: its least. */
    assert_true(act("mousemove %d %d mousedown 1 mousemove 1 %d mouseup 1", slider_x(0.1), slider_y(), slider_y()));
    UNTIL(parameter("height") == 0);
    key("Right");
    key("F2");
    UNTIL(strstr(text("message"), "saved"));
    assert_non_null(strstr(read_file("plain.karst"), "\"height\": { \"value\": 0.2, \"min\": 0, \"max\": 20,"));
    assert_non_null(strstr(read_file("plain.karst"), "colour(vec3 p, vec3 n) { return vec3(0.05, 0.8, 0.07); }"));
    /* What was saved is read, and is what one returns to. */
    key("Right");
    key("BackSpace");
    UNTIL(fabs(parameter("height") - 0.2) < 1e-12 && yes("settled"));
    assert_true(act("mousemove 160 120"));
    key("p");
    UNTIL(!yes("sliders"));
}

static void resize(int width, int height)
{
    /* Without a window manager, the window takes any size. */
    assert_true(act("search --onlyvisible --class karst windowsize %d %d", width, height));
    s.width = width < 1280 ? width : 1280;
    s.height = height < 1024 ? height : 1024;
    UNTIL(json_integer_value(json_array_get(viewer_value("window"), 0)) == width &&
          json_integer_value(json_array_get(viewer_value("window"), 1)) == height && number("share_of_side") == 1);
}

static void test_any_size(void **state)
{
    (void)state;
    static const int sizes[][2] = {{1, 1}, {16, 10}, {1280, 1024}, {37, 301}, {320, 240}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        resize(sizes[i][0], sizes[i][1]);
    UNTIL(yes("settled"));
}

static void test_minimised_and_back(void **state)
{
    (void)state;
    assert_true(act("search --class karst windowunmap"));
    nap(0.5);
    assert_true(act("search --class karst windowmap"));
    assert_true(act("mousemove 161 121"));
    UNTIL(yes("settled"));
}

static void test_full_screen(void **state)
{
    (void)state;
    key("F11");
    UNTIL(yes("fullscreen"));
    key("F11");
    UNTIL(!yes("fullscreen"));
    resize(320, 240);
    UNTIL(yes("settled"));
}

static long file_size(const char *name)
{
    struct stat info;
    return stat(in_folder(name), &info) == 0 ? (long)info.st_size : -1;
}

static void test_pictures(void **state)
{
    (void)state;
    int width, height;
    key("F12");
    UNTIL(number("pictures") == 1);
    assert_string_equal(text("last_picture"), "./karst-plain-001.png");
    uint8_t *rgba = karst_image_read_png(in_folder("karst-plain-001.png"), &width, &height, NULL);
    assert_non_null(rgba);
    assert_int_equal(width, 320);
    assert_int_equal(height, 240);
    free(rgba);
    key("shift+F12");
    UNTIL(number("pictures") == 2);
    assert_string_equal(text("last_picture"), "./karst-plain-001.exr");
    assert_true(file_size("karst-plain-001.exr") > 1000);
}

static void test_a_path_is_recorded_and_flown(void **state)
{
    (void)state;
    key("Home");
    UNTIL(where().x == 0);
    key("F6");
    UNTIL(yes("recording"));
    assert_true(act("keydown d"));
    nap(0.6);
    assert_true(act("keyup d"));
    until_at_rest();
    double end = where().x;
    assert_true(end > 0.05);
    key("F6");
    UNTIL(!yes("recording"));
    assert_true(file_size("karst-plain-001.json") > 100);
    key("Home");
    UNTIL(where().x == 0);
    key("F7");
    UNTIL(yes("replaying") || fabs(where().x - end) < 1e-6);
    UNTIL(!yes("replaying") && fabs(where().x - end) < 1e-6);
}

static void test_a_video(void **state)
{
    (void)state;
    if (system("command -v ffmpeg > /dev/null 2>&1") != 0) {
        print_message("no ffmpeg here\n");
        skip();
    }
    key("F8");
    UNTIL(yes("video"));
    nap(0.5);
    key("F8");
    UNTIL(!yes("video"));
    assert_true(file_size("karst-plain-001.mp4") > 500);
}

/* ---- tools ---- */

static size_t edits_in_file(const char *name)
{
    karst_error error = {0};
    karst_saved *saved = karst_saved_open(in_folder(name), false, NULL, &error);
    if (!saved)
        fail_msg("%s", error.message);
    const size_t num = karst_saved_num_edits(saved, NULL);
    karst_saved_close(saved);
    return num;
}

/* Leaves the viewer with a tool for digging in hand. */
static void test_a_tool_digs_and_undo_fills_up(void **state)
{
    (void)state;
    key("Home");
    until_at_rest();
    const double depth_m = number("hit_depth_m");
    shot bare = take_shot();
    assert_string_equal(text("tool"), "none");
    key("b");
    UNTIL(strcmp(text("tool"), "add") == 0 && json_object_get(viewer_value("panels"), "outline"));
    shot outlined = take_shot();
    assert_true(count_changes(&bare, &outlined) > 40);
    free(bare.rgba);
    free(outlined.rgba);
    key("b");
    UNTIL(strcmp(text("tool"), "dig") == 0);
    const double size_m = number("brush_size_m"), strength = number("brush_strength"), speed = number("speed_m_s");
    assert_true(act("click 4"));
    UNTIL(number("brush_size_m") > 1.1 * size_m);
    assert_true(act("keydown shift click 4 click 4 keyup shift"));
    UNTIL(number("brush_strength") > strength + 0.09);
    assert_true(number("speed_m_s") == speed);
    assert_true(act("mousemove 160 120 click 1"));
    UNTIL(number("edits") == 1 && yes("settled") && number("hit_depth_m") > depth_m + 0.3 * size_m);
    assert_true(number("unsaved_edits") == 1 && !yes("edits_saved"));
    key("ctrl+z");
    UNTIL(number("edits") == 0 && number("redoable_edits") == 1 && yes("settled"));
    assert_true(fabs(number("hit_depth_m") - depth_m) < 1e-6 * depth_m);
    key("ctrl+y");
    UNTIL(number("edits") == 1 && yes("settled"));
}

static void test_edits_are_kept_in_a_file(void **state)
{
    (void)state;
    key("F4");
    UNTIL(strcmp(text("world"), "./karst-plain-001.karstdb") == 0 && yes("edits_saved"));
    assert_int_equal(edits_in_file("karst-plain-001.karstdb"), 1);
    /* A stroke: the mouse turns the view meanwhile. */
    assert_true(act("mousemove 160 120 mousedown 1"));
    for (int x = 164; number("edits") < 4; x += x < 240 ? 4 : 0) { /* each picture lays one at most */
        assert_true(act("mousemove %d 120", x));
        assert_true(ask_holding()); /* the button */
    }
    assert_true(act("mouseup 1"));
    UNTIL(number("edits") > 2 && yes("settled"));
    const double num = number("edits");
    UNTIL(yes("edits_saved"));
    assert_int_equal(edits_in_file("karst-plain-001.karstdb"), (size_t)num);
    assert_true(act("mousemove 160 120"));
    key("ctrl+z"); /* all of it */
    UNTIL(number("edits") == 1);
    UNTIL(yes("edits_saved"));
    assert_int_equal(edits_in_file("karst-plain-001.karstdb"), 1);
    /* The viewer is the one that writes. */
    karst_error error = {0};
    const char *why;
    karst_saved *second = karst_saved_open(in_folder("karst-plain-001.karstdb"), true, NULL, &error);
    assert_non_null(second);
    assert_false(karst_saved_is_writable(second, &why));
    assert_non_null(strstr(why, "another process writes it"));
    karst_saved_close(second);
}

/* Into the hole that one digs under one's feet, and no deeper. */
static void test_one_falls_into_what_one_digs(void **state)
{
    (void)state;
    assert_true(act("key g type --delay 1 0,8,200,0,-89.9")); /* a prompt hears no F3 */
    key("Return");
    UNTIL(where().z == 200);
    key("m");
    UNTIL(strcmp(text("mode"), "walk") == 0 && yes("on_ground") && yes("settled"));
    const double eye_m = where().y, edits = number("edits");
    /* Wider than one's body. */
    while (number("brush_size_m") > 4) {
        assert_true(act("click 5"));
        assert_true(ask());
    }
    assert_true(act("mousemove 160 120 click 1"));
    UNTIL(number("edits") == edits + 1 && where().y < eye_m - 1 && yes("on_ground"));
    assert_true(where().y > eye_m - 4);
    key("ctrl+z"); /* out of the rock again */
    UNTIL(number("edits") == edits && yes("on_ground") && fabs(where().y - eye_m) < 0.2);
    key("m");
    key("m");
    UNTIL(strcmp(text("mode"), "fly") == 0);
    key("Escape");
    UNTIL(strcmp(text("tool"), "none") == 0);
}

/* The same numbers each time. */
static unsigned next_random(void)
{
    static unsigned seed = 12345;
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

static void test_two_hundred_random_events(void **state)
{
    (void)state;
    static const char *const keys[] = {
        "w",      "a",           "s",     "d",       "q",     "e",         "m",
        "h",      "p",           "v",     "shift+v", "Tab",   "Home",      "c",
        "l",      "bracketleft", "1",     "ctrl+2",  "g",     "5",         "comma",
        "Return", "Up",          "Down",  "Left",    "Right", "BackSpace", "shift+BackSpace",
        "F1",     "F5",          "F6",    "F7",      "F9",    "F12",       "question",
        "plus",   "minus",       "shift", "ctrl",
    };
    for (int i = 0; i < 200; i++) {
        unsigned what = next_random() % 10, x = next_random() % 320, y = next_random() % 240;
        if (what < 6)
            act("key %s", keys[next_random() % (sizeof keys / sizeof *keys)]);
        else if (what < 8)
            act("mousemove %u %u click %u", x, y, next_random() % 5 + 1);
        else if (what == 8)
            act("mousemove %u %u mousedown 1 mousemove %u %u mouseup 1", x, y, next_random() % 320,
                next_random() % 240);
        else /* keys go to what is under the pointer */
            act("search --onlyvisible --class karst windowsize %u %u mousemove 1 1", next_random() % 400 + 4,
                next_random() % 300 + 4);
    }
    act("search --onlyvisible --class karst windowsize 320 240 mousemove 160 120");
    /* A prompt swallows F3, and Escape, which closes it, may come while the window is not yet where the pointer is. */
    bool answers = false;
    int status = -1;
    unlink(in_folder("stats.json"));
    for (int tries = 0; tries < 40 && !answers && !has_ended(&status); tries++) {
        act("key Escape key F3");
        for (double end_s = now_s() + 5; now_s() < end_s && !answers; nap(0.02))
            answers = access(in_folder("stats.json"), R_OK) == 0;
    }
    if (!answers) /* which two Escapes may do: in order, if so */
        assert_true(s.viewer == 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

int main(void)
{
    if (is_left_out())
        return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_colour_edit_makes_no_brick),
        cmocka_unit_test(test_the_picture_moves_while_a_world_is_compiled),
        cmocka_unit_test(test_a_mistake_keeps_the_picture),
        cmocka_unit_test(test_a_file_that_is_being_written_is_waited_for),
        cmocka_unit_test(test_sliders),
        cmocka_unit_test(test_any_size),
        cmocka_unit_test(test_minimised_and_back),
        cmocka_unit_test(test_full_screen),
        cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_a_path_is_recorded_and_flown),
        cmocka_unit_test(test_a_video),
        cmocka_unit_test(test_a_tool_digs_and_undo_fills_up),
        cmocka_unit_test(test_edits_are_kept_in_a_file),
        cmocka_unit_test(test_one_falls_into_what_one_digs),
        cmocka_unit_test(test_two_hundred_random_events),
    };
    return cmocka_run_group_tests(tests, open_world, close_world);
}
