/* Keys and mouse of the viewer, one by one: each has its effect. */
#include "tests/window/session.h"

#include <math.h>

/* Gentle hills under a camera that looks north and a little down. */
static const char world[] = "/*{ \"voxel\": 0.25, \"camera\": { \"position\": [\"0\", \"60\", \"0\"], \"yaw\": 0, "
                            "\"pitch\": -20, \"fov\": 60 } }*/\n"
                            "float density(vec3 p) { return 12.0 * sin(p.x * 0.03) * cos(p.z * 0.03) - p.y; }\n";

static int open_world(void **state)
{
    open_session(state);
    write_file("hills.karst", world);
    open_viewer("hills.karst --size 320x240 --view-distance 1000 --speed 20");
    return 0;
}

static int close_world(void **state)
{
    if (s.viewer > 0)
        close_viewer();
    return close_session(state);
}

/* Holds a key until the viewer says that the condition holds, however long that takes, and lets it come to rest. */
#define HOLD_UNTIL(name, condition)           \
    do {                                      \
        assert_true(act("keydown %s", name)); \
        UNTIL(condition);                     \
        assert_true(act("keyup %s", name));   \
        until_at_rest();                      \
    } while (0)

static double way(place from)
{
    place to = where();
    return sqrt(pow(to.x - from.x, 2) + pow(to.y - from.y, 2) + pow(to.z - from.z, 2));
}

static void go_home(void)
{
    key("Home");
    UNTIL(yes("settled") && fabs(where().y - 60) < 1e-6 && fabs(where().yaw) < 1e-9);
}

static void test_keys_move(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double x, y, z; /* the way it should lead, roughly a unit vector */
    } ways[] = {{"w", 0, -0.34, 0.94}, {"s", 0, 0.34, -0.94}, {"a", -1, 0, 0},
                {"d", 1, 0, 0},        {"e", 0, 1, 0},        {"q", 0, -1, 0}};
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        go_home();
        place home = where();
        HOLD_UNTIL(ways[i].name, way(home) > 0.05);
        place at = where();
        double x = at.x, y = at.y - 60, z = at.z, length = sqrt(x * x + y * y + z * z);
        assert_true((x * ways[i].x + y * ways[i].y + z * ways[i].z) / length > 0.99);
    }
}

static void test_a_tap_is_not_lost(void **state)
{
    (void)state;
    go_home();
    key("d");
    UNTIL(where().x > 1e-3);
    go_home();
}

static void test_shift_and_ctrl_change_speed(void **state)
{
    (void)state;
    static const struct {
        const char *held;
        double factor;
    } speeds[] = {{"ctrl", 0.1}, {NULL, 1}, {"shift", 10}};
    for (int i = 0; i < 3; i++) {
        go_home();
        place home = where();
        if (speeds[i].held)
            assert_true(act("keydown %s", speeds[i].held));
        /* F3 without its own --clearmodifiers, which would let go of the held one. */
        assert_true(act("keydown d"));
        for (double end_s = now_s() + WAIT_S; way(home) == 0 && now_s() < end_s;)
            assert_true(ask_holding());
        assert_true(act("keyup d"));
        if (speeds[i].held)
            assert_true(act("keyup %s", speeds[i].held));
        assert_true(where().x > 0);
        assert_true(fabs(number("asked_speed_m_s") / number("speed_m_s") - speeds[i].factor) < 1e-6);
    }
    go_home();
}

static void test_wheel_and_keys_change_speed(void **state)
{
    (void)state;
    assert_true(ask());
    double before = number("speed_m_s");
    for (int i = 0; i < 8; i++)
        assert_true(act("click 4"));
    UNTIL(fabs(number("speed_m_s") / before - 10) < 1e-6);
    for (int i = 0; i < 8; i++)
        assert_true(act("click 5"));
    UNTIL(fabs(number("speed_m_s") / before - 1) < 1e-6);
    for (int i = 0; i < 8; i++)
        key("minus");
    UNTIL(fabs(number("speed_m_s") / before - 0.1) < 1e-6);
    for (int i = 0; i < 8; i++)
        key("equal");
    UNTIL(fabs(number("speed_m_s") / before - 1) < 1e-6);
    /* It ends at 10^9 and at 10^-3. */
    assert_true(act("click --repeat 90 --delay 4 4"));
    UNTIL(number("speed_m_s") == 1e9);
    assert_true(act("click --repeat 120 --delay 4 5"));
    UNTIL(number("speed_m_s") == 1e-3);
    while (number("speed_m_s") < before * 0.999) {
        assert_true(act("click 4"));
        assert_true(ask());
    }
}

static void test_mouse_and_arrows_look(void **state)
{
    (void)state;
    go_home();
    assert_true(act("mousemove 160 120 mousedown 1 mousemove 170 120 mousemove 200 120 mouseup 1"));
    UNTIL(where().yaw > 1);
    /* As far as the pixels under the cursor go, from the first move on: 60 degrees are 240 pixels. */
    assert_true(fabs(where().yaw - 7.5) < 2.6);
    assert_true(fabs(where().pitch + 20) < 1e-9);
    assert_true(act("mousemove 160 120 mousedown 1 mousemove 160 110 mousemove 160 80 mouseup 1"));
    UNTIL(where().pitch > -19);
    go_home();
    HOLD_UNTIL("Left", where().yaw != 0);
    assert_true(where().yaw > 180);
    HOLD_UNTIL("Up", where().pitch != -20);
    assert_true(where().pitch > -20);
    go_home();
    /* Without a button, nothing turns; captured, it does. */
    assert_true(act("mousemove 100 100 mousemove 140 140"));
    assert_true(ask());
    assert_true(where().yaw == 0);
    key("l");
    UNTIL(yes("mouse_captured"));
    for (int i = 0; i < 5; i++)
        assert_true(act("mousemove_relative 12 0"));
    UNTIL(where().yaw > 0.5);
    key("Escape");
    UNTIL(!yes("mouse_captured"));
    assert_true(act("click 3"));
    UNTIL(yes("mouse_captured"));
    assert_true(act("click 3"));
    UNTIL(!yes("mouse_captured"));
    assert_true(act("mousemove 160 120"));
    go_home();
}

static void test_field_of_view(void **state)
{
    (void)state;
    go_home();
    key("bracketleft");
    UNTIL(where().fov < 59);
    key("bracketright");
    UNTIL(fabs(where().fov - 60) < 1e-6);
}

static double ground(double x, double z) { return 12 * sin(x * 0.03) * cos(z * 0.03); }

static void test_walking_stays_on_the_ground(void **state)
{
    (void)state;
    go_home();
    key("m");
    UNTIL(strcmp(text("mode"), "walk") == 0 && yes("on_ground"));
    place at = where();
    assert_true(fabs(at.y - 1.7 - ground(at.x, at.z)) < 0.3);
    for (int i = 0; i < 3; i++) {
        assert_true(act("keydown shift"));
        HOLD_UNTIL("w", where().z > at.z + 0.5);
        assert_true(act("keyup shift"));
        UNTIL(yes("on_ground"));
        place to = where();
        assert_true(fabs(to.y - 1.7 - ground(to.x, to.z)) < 0.3);
        at = to;
    }
    /* A jump ends where it began. */
    key("e");
    UNTIL(yes("on_ground") && yes("settled"));
    assert_true(fabs(where().y - 1.7 - ground(where().x, where().z)) < 0.3);
}

static void test_orbit_keeps_its_distance(void **state)
{
    (void)state;
    while (strcmp(text("mode"), "fly") != 0) {
        key("m");
        assert_true(ask());
    }
    go_home();
    double depth = number("hit_depth_m");
    assert_true(depth > 10);
    key("m");
    key("m");
    UNTIL(strcmp(text("mode"), "orbit") == 0);
    /* The pivot: where one looked. */
    double pitch = 20 * M_PI / 180, px = 0, py = 60 - depth * sin(pitch), pz = depth * cos(pitch);
    HOLD_UNTIL("d", hypot(where().x, where().z) > 1);
    place at = where();
    assert_true(fabs(sqrt(pow(at.x - px, 2) + pow(at.y - py, 2) + pow(at.z - pz, 2)) - depth) < 0.01 * depth);
    place pivot = {.x = px, .y = py, .z = pz};
    HOLD_UNTIL("w", way(pivot) < 0.99 * depth);
    key("m");
    UNTIL(strcmp(text("mode"), "fly") == 0);
    go_home();
}

static void test_places(void **state)
{
    (void)state;
    go_home();
    HOLD_UNTIL("d", where().x > 0);
    place kept = where();
    key("ctrl+3");
    UNTIL(strstr(text("message"), "bookmark 3"));
    go_home();
    key("3");
    UNTIL(fabs(where().x - kept.x) < 1e-9 && fabs(where().z - kept.z) < 1e-9);
    key("c");
    UNTIL(*text("copied"));
    char wanted[400];
    snprintf(wanted, sizeof wanted, "karst render hills.karst --camera %s", text("camera"));
    assert_string_equal(text("copied"), wanted);
    /* Typed, with a mistake first; keys move nothing meanwhile. */
    key("g");
    assert_true(act("type --delay 30 '1e6,100,x2.5'"));
    key("Return");
    UNTIL(!yes("prompt") && fabs(where().x - 1e6) < 1e-6 && fabs(where().y - 100) < 1e-6 &&
          fabs(where().z - 2.5) < 1e-6);
    key("g");
    assert_true(act("type --delay 30 '1,2'"));
    key("Return");
    nap(0.2);
    key("Escape");
    UNTIL(!yes("prompt"));
    assert_true(fabs(where().x - 1e6) < 1e-6);
    go_home();
}

static void test_help_and_panels(void **state)
{
    (void)state;
    go_home();
    shot plain = take_shot();
    key("h");
    UNTIL(yes("help"));
    nap(0.3);
    shot help = take_shot();
    assert_true(count_changes(&plain, &help) > plain.width * plain.height / 4);
    key("question");
    UNTIL(!yes("help"));
    static const char *const pages[] = {"frame", "cache", "none", "status"};
    for (int i = 0; i < 4; i++) {
        key("Tab");
        UNTIL(strcmp(text("page"), pages[i]) == 0);
    }
    free(plain.rgba);
    free(help.rgba);
}

static void test_views_show_something_each(void **state)
{
    (void)state;
    /* There is no occlusion here: that is gone past. */
    static const char *const views[] = {"level",       "bricks", "steps",  "age",    "produced",
                                        "provisional", "depth",  "normal", "albedo", "bounces"};
    shot last = {0};
    for (int i = 0; i < 10; i++) {
        key("v");
        UNTIL(strcmp(text("view"), views[i]) == 0 && yes("settled") && !*text("message"));
        shot taken = take_shot();
        if (last.rgba && strcmp(views[i], "provisional") != 0) /* settled, that looks as produced does */
            assert_true(count_changes(&last, &taken) > 200);
        free(last.rgba);
        last = taken;
    }
    free(last.rgba);
    key("shift+v");
    UNTIL(strcmp(text("view"), "albedo") == 0);
    key("v");
    key("v");
    UNTIL(strcmp(text("view"), "picture") == 0);
}

static void test_keys_and_drags_move_the_sun(void **state)
{
    (void)state;
    assert_true(ask());
    const double azimuth = number("sun_azimuth_deg"), elevation = number("sun_elevation_deg");
    key("Prior");
    UNTIL(fabs(number("sun_elevation_deg") - elevation - 1) < 1e-9);
    key("Next");
    key("Next");
    UNTIL(fabs(number("sun_elevation_deg") - elevation + 1) < 1e-9);
    key("shift+Prior");
    UNTIL(fabs(number("sun_azimuth_deg") - azimuth - 3) < 1e-9);
    key("shift+Next");
    key("shift+Next");
    UNTIL(fabs(number("sun_azimuth_deg") - azimuth + 3) < 1e-9);
    key("c");
    UNTIL(strstr(text("copied"), " --sun "));
    key("ctrl+Prior");
    UNTIL(number("sun_azimuth_deg") == azimuth && number("sun_elevation_deg") == elevation);
    /* 60 degrees are 240 pixels, as for the camera, which stays. */
    const place at = where();
    assert_true(act("mousemove 160 120 mousedown 2 mousemove 170 120 mousemove 200 104 mouseup 2"));
    UNTIL(number("sun_azimuth_deg") != azimuth && number("sun_elevation_deg") != elevation);
    assert_true(fabs(number("sun_azimuth_deg") - azimuth - 7.5) < 2.6);
    assert_true(fabs(number("sun_elevation_deg") - elevation - 4) < 0.1);
    assert_true(where().yaw == at.yaw && where().pitch == at.pitch);
    key("ctrl+Next");
    UNTIL(number("sun_azimuth_deg") == azimuth && number("sun_elevation_deg") == elevation);
}

static void test_keys_change_the_exposure(void **state)
{
    (void)state;
    until_at_rest();
    const shot usual = take_shot();
    assert_true(json_is_null(viewer_value("exposure_stops")));
    for (int i = 0; i < 6; i++)
        key("x");
    UNTIL(fabs(number("exposure_stops") - 2) < 1e-9 && yes("settled"));
    const shot bright = take_shot();
    for (int i = 0; i < 12; i++)
        key("shift+x");
    UNTIL(fabs(number("exposure_stops") + 2) < 1e-9 && yes("settled"));
    const shot dark = take_shot();
    assert_true(mean_below(&bright, 1) > mean_below(&dark, 1) + 30);
    key("c");
    UNTIL(strstr(text("copied"), " --exposure -2"));
    key("ctrl+x");
    UNTIL(json_is_null(viewer_value("exposure_stops")) && yes("settled"));
    free(usual.rgba);
    free(bright.rgba);
    free(dark.rgba);
}

static void test_the_status_line_counts_samples(void **state)
{
    (void)state;
    until_at_rest();
    UNTIL(strstr(text("status"), "2 of 2 samples"));
}

static void test_resolution_key(void **state)
{
    (void)state;
    assert_true(ask());
    assert_false(yes("fixed_resolution"));
    key("F9");
    UNTIL(yes("fixed_resolution"));
    key("F9");
    UNTIL(!yes("fixed_resolution"));
    assert_true(number("share_of_side") == 1);
}

int main(void)
{
    if (is_left_out())
        return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_keys_move),
        cmocka_unit_test(test_a_tap_is_not_lost),
        cmocka_unit_test(test_shift_and_ctrl_change_speed),
        cmocka_unit_test(test_wheel_and_keys_change_speed),
        cmocka_unit_test(test_mouse_and_arrows_look),
        cmocka_unit_test(test_field_of_view),
        cmocka_unit_test(test_walking_stays_on_the_ground),
        cmocka_unit_test(test_orbit_keeps_its_distance),
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_help_and_panels),
        cmocka_unit_test(test_views_show_something_each),
        cmocka_unit_test(test_keys_and_drags_move_the_sun),
        cmocka_unit_test(test_keys_change_the_exposure),
        cmocka_unit_test(test_the_status_line_counts_samples),
        cmocka_unit_test(test_resolution_key),
    };
    return cmocka_run_group_tests(tests, open_world, close_world);
}
