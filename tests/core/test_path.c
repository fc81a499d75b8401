/* Camera paths: exact at keyframes and anywhere in the world, smooth, never overshooting; and what a bad file is told.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/path.h"

#define VOXEL_LOG2_M (-4)

static char file_name[64];

static void write_file(const char *text)
{
    FILE *file = fopen(file_name, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static karst_path *load(const char *text)
{
    write_file(text);
    karst_error error = {0};
    assert_true(karst_path_check(file_name, &error));
    karst_path *path = karst_path_load(file_name, VOXEL_LOG2_M, &error);
    if (!path)
        fail_msg("%s", error.message);
    return path;
}

static void assert_at(const karst_path *path, double time_s, const char *x, const char *y, const char *z)
{
    karst_position wanted, got = karst_path_sample(path, time_s).position;
    assert_true(karst_position_parse(x, y, z, VOXEL_LOG2_M, &wanted, NULL));
    for (int axis = 0; axis < 3; axis++)
        if (wanted.voxel[axis] != got.voxel[axis] || wanted.fraction[axis] != got.fraction[axis])
            fail_msg("at %g s %c is %lld + %u/2^32 voxels, not %lld + %u/2^32", time_s, "xyz"[axis],
                     (long long)got.voxel[axis], got.fraction[axis], (long long)wanted.voxel[axis],
                     wanted.fraction[axis]);
}

static void difference_m(const karst_path *path, double from_s, double to_s, double d[3])
{
    karst_position_difference_m(karst_path_sample(path, from_s).position, karst_path_sample(path, to_s).position,
                                VOXEL_LOG2_M, d);
}

/* A path that winds, at an offset of its own along x and z. */
static karst_path *load_winding(const char *kind, const char *x0, const char *x1, const char *x2, const char *x3)
{
    char text[2048];
    snprintf(text, sizeof text,
             "{\"interpolation\": \"%s\", \"keyframes\": ["
             "{\"time\": 1, \"position\": [\"%s\", \"10.0625\", \"-7\"], \"yaw\": 350, \"pitch\": -10},"
             "{\"time\": 2, \"position\": [\"%s\", \"40\", \"5.5\"], \"yaw\": 10, \"pitch\": 20, \"fov\": 30},"
             "{\"time\": 4.5, \"position\": [\"%s\", \"40\", \"90\"], \"yaw\": 170, \"pitch\": 20},"
             "{\"time\": 5, \"position\": [\"%s\", \"-3\", \"60\"], \"yaw\": 0, \"pitch\": -90, \"fov\": 90}]}",
             kind, x0, x1, x2, x3);
    return load(text);
}

static void test_keyframes_are_exact_anywhere(void **state)
{
    (void)state;
    const char *kinds[] = {"linear", "smooth"};
    for (int i = 0; i < 2; i++) {
        karst_path *path = load_winding(kinds[i], "999999999999999.0625", "1000000000000001.5", "1000000000000100",
                                        "1000000000000031");
        assert_at(path, 1, "999999999999999.0625", "10.0625", "-7");
        assert_at(path, 2, "1000000000000001.5", "40", "5.5");
        assert_at(path, 4.5, "1000000000000100", "40", "90");
        assert_at(path, 5, "1000000000000031", "-3", "60");
        assert_at(path, -1e300, "999999999999999.0625", "10.0625", "-7");
        assert_at(path, NAN, "999999999999999.0625", "10.0625", "-7");
        assert_at(path, INFINITY, "1000000000000031", "-3", "60");
        assert_true(karst_path_start_s(path) == 1 && karst_path_end_s(path) == 5);
        karst_path_destroy(path);
    }
}

/* The same path 10^15 m further on goes the same way, to the last bit. */
static void test_distance_from_the_origin_changes_nothing(void **state)
{
    (void)state;
    const char *kinds[] = {"linear", "smooth"};
    for (int i = 0; i < 2; i++) {
        karst_path *here = load_winding(kinds[i], "0", "3.25", "-100", "31.5");
        karst_path *there =
            load_winding(kinds[i], "1000000000000000", "1000000000000003.25", "999999999999900", "1000000000000031.5");
        for (int step = 0; step <= 1000; step++) {
            double time_s = 0.9 + step * 0.0042;
            karst_camera a = karst_path_sample(here, time_s), b = karst_path_sample(there, time_s);
            b.position.voxel[0] -= (int64_t)16000000000000000;
            for (int axis = 0; axis < 3; axis++) {
                assert_true(a.position.voxel[axis] == b.position.voxel[axis]);
                assert_true(a.position.fraction[axis] == b.position.fraction[axis]);
            }
            assert_true(a.yaw_deg == b.yaw_deg && a.pitch_deg == b.pitch_deg && a.fov_deg == b.fov_deg);
        }
        karst_path_destroy(here);
        karst_path_destroy(there);
    }
}

static void test_linear_is_straight(void **state)
{
    (void)state;
    karst_path *path = load_winding("linear", "0", "3.25", "-100", "31.5");
    assert_at(path, 1.5, "1.625", "25.03125", "-0.75");
    assert_at(path, 1.25, "0.8125", "17.546875", "-3.875");
    assert_at(path, 4.75, "-34.25", "18.5", "75");
    assert_true(karst_path_sample(path, 1.5).fov_deg == 45);
    assert_true(karst_path_sample(path, 1.5).pitch_deg == 5);
    karst_path_destroy(path);
}

static void test_smooth_never_overshoots(void **state)
{
    (void)state;
    karst_path *path = load_winding("smooth", "0", "3.25", "-100", "31.5");
    const double times_s[] = {1, 2, 4.5, 5};
    for (int span = 0; span < 3; span++) {
        double whole[3], part[3];
        difference_m(path, times_s[span], times_s[span + 1], whole);
        for (int step = 1; step < 500; step++) {
            double time_s = times_s[span] + (times_s[span + 1] - times_s[span]) * step / 500;
            difference_m(path, times_s[span], time_s, part);
            for (int axis = 0; axis < 3; axis++)
                assert_true(part[axis] >= fmin(0, whole[axis]) && part[axis] <= fmax(0, whole[axis]));
            karst_camera camera = karst_path_sample(path, time_s);
            assert_true(fabs(camera.pitch_deg) <= 90 && camera.fov_deg >= 30 && camera.fov_deg <= 90);
        }
    }
    /* Level between two keyframes of one height. */
    difference_m(path, 2, 3.3, (double[3]){0});
    assert_true(karst_path_sample(path, 3.3).position.voxel[1] == 640);
    karst_path_destroy(path);
}

/* Velocities from both sides of `time_s` agree to a thousandth of the path's usual speed. */
static void assert_smooth_at(const karst_path *path, double time_s, double step_s, double speed_m_s)
{
    double before[3], after[3];
    difference_m(path, time_s - step_s, time_s, before);
    difference_m(path, time_s, time_s + step_s, after);
    for (int axis = 0; axis < 3; axis++)
        if (fabs(before[axis] - after[axis]) > 1e-3 * speed_m_s * step_s)
            fail_msg("at %g s the speed along %c jumps from %g to %g m/s", time_s, "xyz"[axis], before[axis] / step_s,
                     after[axis] / step_s);
    karst_camera a = karst_path_sample(path, time_s - step_s), b = karst_path_sample(path, time_s),
                 c = karst_path_sample(path, time_s + step_s);
    assert_true(fabs((b.yaw_deg - a.yaw_deg) - (c.yaw_deg - b.yaw_deg)) <= step_s);
    assert_true(fabs((b.fov_deg - a.fov_deg) - (c.fov_deg - b.fov_deg)) <= step_s);
}

static void test_smooth_has_no_corners(void **state)
{
    (void)state;
    karst_path *path = load_winding("smooth", "0", "3.25", "-100", "31.5");
    assert_smooth_at(path, 2, 1e-5, 100);
    assert_smooth_at(path, 4.5, 1e-5, 100);
    /* Also where one half of a span hands over to the other. */
    assert_smooth_at(path, 1.5, 1e-5, 100);
    assert_smooth_at(path, 3.25, 1e-5, 100);
    karst_path_destroy(path);
    /* The test notices a corner. */
    path = load_winding("linear", "0", "3.25", "-100", "31.5");
    double before[3], after[3];
    difference_m(path, 2 - 1e-5, 2, before);
    difference_m(path, 2, 2 + 1e-5, after);
    assert_true(fabs(before[0] - after[0]) > 1e-4);
    karst_path_destroy(path);
}

static void test_yaw_takes_the_shorter_way(void **state)
{
    (void)state;
    karst_path *path =
        load("{\"interpolation\": \"linear\", \"keyframes\": ["
             "{\"time\": 0, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 350, \"pitch\": 0},"
             "{\"time\": 2, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 10, \"pitch\": 0},"
             "{\"time\": 4, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": -90, \"pitch\": 0},"
             "{\"time\": 6, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 90, \"pitch\": 0},"
             "{\"time\": 8, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 80, \"pitch\": 0, \"turns\": 1},"
             "{\"time\": 9, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 80, \"pitch\": 0, \"turns\": -2}]}");
    assert_true(karst_path_sample(path, 1).yaw_deg == 360);
    assert_true(karst_path_sample(path, 3).yaw_deg == 320); /* from 370 left to 270 */
    assert_true(karst_path_sample(path, 6).yaw_deg == 450); /* as far both ways: to the right */
    assert_true(karst_path_sample(path, 8).yaw_deg == 800); /* 10 to the left and 360 to the right */
    assert_true(karst_path_sample(path, 9).yaw_deg == 80);
    karst_path_destroy(path);
}

static void test_jumps(void **state)
{
    (void)state;
    karst_path *path =
        load("{\"keyframes\": ["
             "{\"time\": 0, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 0, \"pitch\": 0, \"fov\": 50},"
             "{\"time\": 1, \"position\": [\"16\", \"0\", \"0\"], \"yaw\": 0, \"pitch\": 0},"
             "{\"time\": 1, \"position\": [\"1e12\", \"0\", \"0\"], \"yaw\": 200, \"pitch\": 0},"
             "{\"time\": 2, \"position\": [\"1000000000016\", \"0\", \"0\"], \"yaw\": 200, \"pitch\": 0},"
             "{\"time\": 2, \"position\": [\"5\", \"0\", \"0\"], \"yaw\": 10, \"pitch\": 0}]}");
    assert_at(path, 0.5, "8", "0", "0");
    assert_at(path, 0.96875, "15.5", "0", "0"); /* no slope reaches over a jump */
    assert_at(path, 1, "1e12", "0", "0");
    assert_at(path, 1.5, "1000000000008", "0", "0");
    assert_at(path, 2, "5", "0", "0");
    assert_at(path, 3, "5", "0", "0");
    assert_true(karst_path_sample(path, 1).yaw_deg == 200 && karst_path_sample(path, 1).fov_deg == 50);
    karst_path_destroy(path);
}

/* From 10^7 m to a centimetre: as many seconds for each order of magnitude, and the target stays in the middle. */
static void test_zoom_is_even_in_the_logarithm(void **state)
{
    (void)state;
    karst_path *path = load("{\"interpolation\": \"zoom\", \"target\": [\"1e15\", \"100.5\", \"-3\"], \"keyframes\": ["
                            "{\"time\": 0, \"position\": [\"1e15\", \"10000100.5\", \"-3\"], \"fov\": 90},"
                            "{\"time\": 9, \"position\": [\"1e15\", \"100.51\", \"-3\"], \"fov\": 0.9}]}");
    for (int second = 0; second <= 9; second++) {
        karst_camera camera = karst_path_sample(path, second);
        double height_m = ldexp((double)(camera.position.voxel[1] - 1608) + camera.position.fraction[1] * 0x1p-32, -4);
        double wanted_m = pow(10, 7 - second);
        /* A keyframe is rounded to 2^-36 m. */
        if (fabs(height_m - wanted_m) > 1e-8 * wanted_m + 0x1p-36)
            fail_msg("after %d s at %.17g m", second, height_m);
        assert_true(camera.position.voxel[0] == (int64_t)16000000000000000 && camera.position.voxel[2] == -48);
        assert_true(fabs(camera.pitch_deg + 90) < 1e-9);
        assert_true(fabs(camera.fov_deg - 90 * pow(10, -2.0 * second / 9)) < 1e-9);
    }
    assert_at(path, 9, "1e15", "100.51", "-3");
    karst_path_destroy(path);
}

/* A circle by keyframes 45 degrees apart keeps its distance, runs evenly enough and looks inwards. */
static void test_zoom_orbits(void **state)
{
    (void)state;
    char text[4096] = "{\"interpolation\": \"zoom\", \"target\": [\"1e12\", \"0\", \"0\"], \"keyframes\": [";
    for (int i = 0; i <= 8; i++) {
        size_t length = strlen(text);
        double angle = i * 0.78539816339744831;
        snprintf(text + length, sizeof text - length, "%s{\"time\": %d, \"position\": [\"%.6f\", \"0\", \"%.6f\"]}",
                 i ? ", " : "", i, 1e12 + 500 * sin(angle), 500 * cos(angle));
    }
    strcat(text, "]}");
    karst_path *path = load(text);
    karst_position target;
    assert_true(karst_position_parse("1e12", "0", "0", VOXEL_LOG2_M, &target, NULL));
    for (int step = 0; step <= 800; step++) {
        karst_camera camera = karst_path_sample(path, step / 100.0);
        double d[3];
        karst_position_difference_m(camera.position, target, VOXEL_LOG2_M, d);
        double distance_m = sqrt(d[0] * d[0] + d[2] * d[2]);
        assert_true(fabs(distance_m - 500) < 1e-3);
        assert_true(fabs(sin(camera.yaw_deg / 57.29577951308232) - d[0] / distance_m) < 1e-12);
        double round_deg = remainder(step * 0.45 + 180 - camera.yaw_deg, 360);
        assert_true(fabs(round_deg) < 6);
    }
    for (int second = 1; second < 8; second++)
        assert_smooth_at(path, second, 1e-4, 100);
    karst_path_destroy(path);
}

static void test_sampling_repeats(void **state)
{
    (void)state;
    karst_path *path = load_winding("smooth", "0", "3.25", "-100", "31.5");
    karst_camera forward[200];
    for (int i = 0; i < 200; i++)
        forward[i] = karst_path_sample(path, 1 + i * 0.02);
    karst_path *again = karst_path_load(file_name, VOXEL_LOG2_M, NULL);
    assert_non_null(again);
    for (int i = 199; i >= 0; i--) {
        karst_camera camera = karst_path_sample(again, 1 + i * 0.02);
        assert_memory_equal(&camera, &forward[i], sizeof camera);
    }
    karst_path_destroy(again);
    karst_path_destroy(path);
    karst_path_destroy(NULL);
}

#define KEY_A "{\"time\": 0, \"position\": [\"0\", \"320\", \"0\"], \"yaw\": 0, \"pitch\": 0}"
#define KEY_AT(time) "{\"time\": " time ", \"position\": [\"9\", \"320\", \"0\"], \"yaw\": 0, \"pitch\": 0}"

static void test_bad_files_are_told_what_is_wrong(void **state)
{
    (void)state;
    const struct {
        const char *text, *words[3];
    } cases[] = {
        {"", {"path", ":1:"}},
        {"{\"keyframes\": [" KEY_A "}", {":1:", "]"}},
        {"[1]", {"object"}},
        {"{}", {"keyframes", "list"}},
        {"{\"keyframes\": []}", {"keyframes", "1 to"}},
        {"{\"keyframes\": [7]}", {"keyframe 1", "object"}},
        {"{\"keyframe\": []}", {"keyframe", "no such field", "keyframes"}},
        {"{\"keyframes\": [" KEY_A ", " KEY_A ", {\"tiem\": 1}]}", {"keyframe 3", "tiem", "time"}},
        {"{\"keyframes\": [{\"time\": 0, \"yaw\": 0, \"pitch\": 0}]}", {"keyframe 1", "position", "missing"}},
        {"{\"keyframes\": [{\"time\": 0, \"position\": [\"0\", \"0\", \"0\"], \"pitch\": 0}]}",
         {"keyframe 1", "yaw", "missing"}},
        {"{\"keyframes\": [{\"time\": 0, \"position\": [0, 320, 0], \"yaw\": 0, \"pitch\": 0}]}",
         {"keyframe 1", "position", "quotes"}},
        {"{\"keyframes\": [{\"time\": 0, \"position\": [\"0\", \"high\", \"0\"], \"yaw\": 0, \"pitch\": 0}]}",
         {"keyframe 1", "position", "y: \"high\""}},
        {"{\"keyframes\": [{\"time\": 0, \"position\": [\"0\", \"0\", \"1e31\"], \"yaw\": 0, \"pitch\": 0}]}",
         {"keyframe 1", "position", "edge"}},
        {"{\"keyframes\": [{\"time\": \"0\", \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 0, \"pitch\": 0}]}",
         {"time", "number"}},
        {"{\"keyframes\": [{\"time\": 0, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 0, \"pitch\": 91}]}",
         {"pitch", "-90 to 90"}},
        {"{\"keyframes\": [{\"time\": 0, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 0, \"pitch\": 0, \"fov\": "
         "180}]}",
         {"fov", "179"}},
        {"{\"keyframes\": [{\"time\": 0, \"position\": [\"0\", \"0\", \"0\"], \"yaw\": 0, \"pitch\": 0, \"turns\": "
         "1}]}",
         {"turns"}},
        {"{\"keyframes\": [" KEY_A ", " KEY_AT("-1") "]}", {"keyframe 2", "time", "before"}},
        {"{\"keyframes\": [" KEY_A ", " KEY_AT("1e-7") "]}", {"keyframe 2", "time", "jump"}},
        {"{\"keyframes\": [" KEY_A ", " KEY_AT("0") ", " KEY_AT("0") "]}", {"keyframe 3", "time", "third"}},
        {"{\"time\": 0, \"time\": 1}", {":1:", "duplicate"}},
        {"{\"interpolation\": \"cubic\", \"keyframes\": [" KEY_A "]}", {"interpolation", "smooth"}},
        {"{\"target\": [\"0\", \"0\", \"0\"], \"keyframes\": [" KEY_A "]}", {"target", "zoom"}},
        {"{\"interpolation\": \"zoom\", \"keyframes\": [" KEY_A "]}", {"target", "missing"}},
        {"{\"interpolation\": \"zoom\", \"target\": [\"0\", \"320\", \"0\"], \"keyframes\": [" KEY_A "]}",
         {"keyframe 1", "target"}},
        {"{\"interpolation\": \"zoom\", \"target\": [\"4\", \"320\", \"0\"], \"keyframes\": [" KEY_A
         ", " KEY_AT("1") "]}",
         {"keyframe 2", "position", "90 degrees"}},
        {"{\"interpolation\": \"zoom\", \"target\": [\"4\", \"0\", \"0\"], \"keyframes\": ["
         "{\"time\": 0, \"position\": [\"0\", \"9\", \"0\"]}, " KEY_AT("1") "]}",
         {"keyframe 2", "yaw", "target"}},
        {"{\"world\": 7, \"keyframes\": [" KEY_A "]}", {"world", "text"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_file(cases[i].text);
        karst_error error = {0};
        assert_null(karst_path_load(file_name, VOXEL_LOG2_M, &error));
        assert_int_equal(error.status, KARST_BAD_DATA);
        assert_non_null(strstr(error.message, file_name));
        for (int word = 0; word < 3 && cases[i].words[word]; word++)
            if (!strstr(error.message, cases[i].words[word]))
                fail_msg("%s\n'%s' does not say '%s'", cases[i].text, error.message, cases[i].words[word]);
    }
    karst_error error = {0};
    assert_null(karst_path_load("no-such-folder/path.json", VOXEL_LOG2_M, &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
    assert_non_null(strstr(error.message, "no-such-folder/path.json"));
    error = (karst_error){0};
    assert_false(karst_path_check("no-such-folder/path.json", &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
    error = (karst_error){0};
    assert_null(karst_path_load(file_name, 41, &error));
    assert_int_equal(error.status, KARST_USAGE);
}

/* Files with bytes changed, dropped and doubled: each is read or refused with a reason, and what is read can be
 * sampled. */
static void test_damaged_files(void **state)
{
    (void)state;
    static const char good[] =
        "{\"interpolation\": \"zoom\", \"target\": [\"1\", \"2\", \"3\"], \"world\": \"w\", \"keyframes\": ["
        "{\"time\": 0, \"position\": [\"0\", \"1e7\", \"0\"], \"yaw\": 0, \"pitch\": -9, \"fov\": 60},"
        "{\"time\": 1.5, \"position\": [\"0\", \"9.01\", \".5\"], \"yaw\": 359, \"pitch\": 9, \"turns\": 1}]}";
    const char spice[] = "0123456789-+.eE,:[]{}\"\\ nul\x01\xff";
    int num_read = 0, num_refused = 0;
    uint32_t random = 7;
    for (int i = 0; i < 3000; i++) {
        char text[2 * sizeof good];
        size_t length = sizeof good - 1;
        memcpy(text, good, sizeof good);
        for (int change = 0; change <= i % 3; change++) {
            random = random * 1664525u + 1013904223u;
            size_t at = (random >> 8) % length;
            if (random >> 30 == 0) {
                memmove(text + at, text + at + 1, length - at);
                length--;
            } else if (random >> 30 == 1) {
                memmove(text + at + 1, text + at, length - at + 1);
                length++;
            } else {
                text[at] = spice[(random >> 2) % (sizeof spice - 1)];
            }
        }
        write_file(text);
        karst_error error = {0};
        karst_path *path = karst_path_load(file_name, VOXEL_LOG2_M, &error);
        if (path) {
            num_read++;
            for (double time_s = -1; time_s < 3; time_s += 0.3) {
                karst_camera camera = karst_path_sample(path, time_s);
                assert_true(isfinite(camera.yaw_deg) && fabs(camera.pitch_deg) <= 90.0000001);
                assert_true(camera.fov_deg > 0.00009 && camera.fov_deg < 179.0001);
            }
        } else {
            num_refused++;
            assert_int_equal(error.status, KARST_BAD_DATA);
            assert_non_null(strstr(error.message, file_name));
        }
        karst_path_destroy(path);
    }
    assert_true(num_read > 100 && num_refused > 1000);
}

/* Whether a position is beyond the edge is for the world to say: with small voxels it may be. */
static void test_checking_needs_no_world(void **state)
{
    (void)state;
    write_file("{\"keyframes\": [{\"time\": 0, \"position\": [\"1e25\", \"0\", \"0\"], \"yaw\": 0, \"pitch\": 0}]}");
    karst_error error = {0};
    assert_true(karst_path_check(file_name, &error));
    assert_null(karst_path_load(file_name, VOXEL_LOG2_M, &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
}

int main(void)
{
    snprintf(file_name, sizeof file_name, "/tmp/karst-path-%ld.json", (long)getpid());
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_keyframes_are_exact_anywhere),
        cmocka_unit_test(test_distance_from_the_origin_changes_nothing),
        cmocka_unit_test(test_linear_is_straight),
        cmocka_unit_test(test_smooth_never_overshoots),
        cmocka_unit_test(test_smooth_has_no_corners),
        cmocka_unit_test(test_yaw_takes_the_shorter_way),
        cmocka_unit_test(test_jumps),
        cmocka_unit_test(test_zoom_is_even_in_the_logarithm),
        cmocka_unit_test(test_zoom_orbits),
        cmocka_unit_test(test_sampling_repeats),
        cmocka_unit_test(test_bad_files_are_told_what_is_wrong),
        cmocka_unit_test(test_checking_needs_no_world),
        cmocka_unit_test(test_damaged_files),
    };
    int failures = cmocka_run_group_tests_name("path", tests, NULL, NULL);
    remove(file_name);
    return failures;
}
