/* Anywhere, at any distance of view: the camera may stand 10^15 m out, and a root window of a planet's size loses no
 * precision nearby. */
#include "tests/flight/flight.h"

#include <math.h>
#include <stdio.h>
#include <unistd.h>

/* A view to a planet's horizon sees nearby what a short view sees: the same surface at the same depth, though the walk
 * begins at nodes thousands of times as wide. Places on both sides of coarse nodes' faces. */
static void test_view_distance_changes_nothing_nearby(void **state)
{
    (void)state;
    static flight_picture near, far;
    karst_engine_config config = flight_config("hills");
    config.no_shadows = true;
    karst_engine *short_view = flight_engine(&config);
    config.view_distance_m = 3e7;
    karst_engine *long_view = flight_engine(&config);
    const char *places[] = {"-20,500,-30,40,-70", "20,500,30,220,-70", "-0.5,520,1000,180,-50",
                            "1000000,520,-1000000,30,-40", "-1e12,520,3,-90,-60"};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        karst_camera camera = flight_camera(short_view, places[i]);
        flight_settle(short_view, &camera, &near);
        flight_settle(long_view, &camera, &far);
        int num_compared = 0, num_different = 0;
        for (int p = 0; p < FLIGHT_PIXELS; p++)
            if (near.depth_m[p] < 7000) {
                num_compared++;
                num_different += near.depth_m[p] != far.depth_m[p];
            }
        assert_true(num_compared > FLIGHT_PIXELS / 2);
        if (num_different)
            fail_msg("from %s: %d of %d depths differ", places[i], num_different, num_compared);
    }
    karst_engine_destroy(long_view);
    karst_engine_destroy(short_view);
}

/* From the origin to 10^15 m, on either side of zero: it settles, it shows ground, and the pools hold what they should.
 */
static void test_cameras_far_from_the_origin(void **state)
{
    (void)state;
    static flight_picture picture, again;
    const char *worlds[] = {"hills", "asteroid"};
    const char *distances[] = {"0", "1000000", "1000000000", "1000000000000", "1000000000000000"};
    for (int w = 0; w < 2; w++) {
        karst_engine_config config = flight_config(worlds[w]);
        karst_engine *engine = flight_engine(&config);
        for (size_t i = 0; i < sizeof distances / sizeof *distances; i++)
            for (int sign = 0; sign < 2; sign++) {
                char text[128];
                snprintf(text, sizeof text, "%s%s.25,600,%s%s.75,30,-35", sign ? "-" : "", distances[i],
                         sign ? "" : "-", distances[i]);
                karst_camera camera = flight_camera(engine, text);
                flight_settle(engine, &camera, &picture);
                assert_int_equal(picture.stats.num_incomplete, 0);
                assert_int_equal(picture.stats.num_non_finite, 0);
                if (w == 0) {
                    /* Hills are everywhere, and never the same. */
                    assert_true(picture.stats.num_hits > FLIGHT_PIXELS / 2);
                    assert_true(picture.stats.num_provisional == 0);
                    assert_true(memcmp(picture.rgba, again.rgba, sizeof picture.rgba) != 0);
                } else if (i > 0) {
                    assert_int_equal(picture.stats.num_hits, 0); /* the one asteroid is at the origin */
                }
                again = picture;
            }
        karst_engine_destroy(engine);
    }
}

/* Everything repeats after 64 m, so 10^6 m away, and any power of ten beyond, it looks the same in every byte. Views
 * are short enough for levels whose bricks repeat too. */
static void test_a_world_that_repeats_looks_the_same_anywhere(void **state)
{
    (void)state;
    static const char text[] = "/*{ \"voxel\": 0.0625 }*/\n"
                               "float density(vec3 p) {\n"
                               "    vec3 a = 6.283185307 * fract(p / 64.0);\n"
                               "    float web = dot(sin(a), cos(a.yzx));\n"
                               "    vec3 bumps = sin(16.0 * a);\n"
                               "    return 10.0 * web - 4.0 + 0.5 * bumps.x * bumps.y * bumps.z;\n"
                               "}\n";
    char file[] = "/tmp/karst-repeats-XXXXXX.karst";
    int fd = mkstemps(file, 6);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, sizeof text - 1), sizeof text - 1);
    close(fd);
    static flight_picture home, away;
    karst_engine_config config = flight_config(file);
    config.view_distance_m = 250;
    karst_engine *engine = flight_engine(&config);
    unlink(file);
    karst_camera camera = flight_camera(engine, "3.25,-20.5,5.125,30,-10");
    flight_settle(engine, &camera, &home);
    assert_true(home.stats.num_hits > FLIGHT_PIXELS / 2);
    const double distances_m[] = {1e6, 1e9, 1e12, 1e15};
    for (size_t i = 0; i < sizeof distances_m / sizeof *distances_m; i++)
        for (int sign = -1; sign <= 1; sign += 2) {
            double way_m[3] = {sign * distances_m[i], -sign * distances_m[i], distances_m[i]};
            karst_camera there = camera;
            there.position = karst_position_add_m(camera.position, way_m, karst_engine_voxel_log2_m(engine));
            flight_settle(engine, &there, &away);
            assert_same_picture(&home, &away);
        }
    /* That this says something: a metre beside, it looks different. */
    camera.position = karst_position_add_m(camera.position, (double[3]){1, 0, 0}, karst_engine_voxel_log2_m(engine));
    flight_settle(engine, &camera, &away);
    assert_true(memcmp(home.rgba, away.rgba, sizeof home.rgba) != 0);
    karst_engine_destroy(engine);
}

/* Pixels that show sky though all of their neighbours show ground nearby. */
static int count_pinholes(const float *depth_m)
{
    int num = 0;
    for (int y = 1; y < FLIGHT_HEIGHT - 1; y++)
        for (int x = 1; x < FLIGHT_WIDTH - 1; x++) {
            int num_ground = 0;
            for (int dy = -1; dy <= 1; dy++)
                for (int dx = -1; dx <= 1; dx++)
                    num_ground += isfinite(depth_m[(y + dy) * FLIGHT_WIDTH + x + dx]) != 0;
            num += num_ground == 8 && !isfinite(depth_m[y * FLIGHT_WIDTH + x]);
        }
    return num;
}

/* Of how many colours a picture is. */
static int count_colours(const flight_picture *picture)
{
    static bool seen[1 << 15];
    memset(seen, 0, sizeof seen);
    int num = 0;
    for (int p = 0; p < FLIGHT_PIXELS; p++) {
        const uint8_t *rgb = picture->rgba + 4 * p;
        bool *one = &seen[rgb[0] >> 3 << 10 | rgb[1] >> 3 << 5 | rgb[2] >> 3];
        num += !*one;
        *one = true;
    }
    return num;
}

/* From 10^7 m to a pebble: every settled picture is whole. Where the camera looks down there is ground in all of it,
 * and near the target it is where the target is. */
static void test_the_dive_has_no_holes(void **state)
{
    (void)state;
    static flight_picture picture;
    karst_engine_config config = flight_config("hills");
    config.view_distance_m = 3e7;
    karst_engine *engine = flight_engine(&config);
    karst_path *path = flight_path(engine, "demos/paths/dive.json");
    karst_position last = karst_path_sample(path, karst_path_end_s(path)).position;
    for (double time_s = 0; time_s <= karst_path_end_s(path); time_s += 0.75) {
        karst_camera camera = karst_path_sample(path, time_s);
        flight_settle(engine, &camera, &picture);
        assert_int_equal(picture.stats.num_provisional, 0);
        assert_int_equal(picture.stats.num_incomplete, 0);
        assert_int_equal(count_pinholes(picture.depth_m), 0);
        if (camera.pitch_deg < -70)
            assert_int_equal(picture.stats.num_hits, FLIGHT_PIXELS);
        /* Haze does not hide the ground: it would all be of one colour, or two. */
        if (time_s > 8.5 && time_s < 13)
            assert_true(count_colours(&picture) > 10);
        /* The middle of the picture is the target, but for what rises around it: hills when it is far, a bump when it
         * is near. */
        double away_m[3];
        karst_position_difference_m(camera.position, last, karst_engine_voxel_log2_m(engine), away_m);
        double distance_m = sqrt(away_m[0] * away_m[0] + away_m[1] * away_m[1] + away_m[2] * away_m[2]);
        double depth_m = picture.depth_m[FLIGHT_HEIGHT / 2 * FLIGHT_WIDTH + FLIGHT_WIDTH / 2];
        if (fabs(depth_m - distance_m) > 0.05 * distance_m + fmin(700, 0.2 * distance_m) + 0.5)
            fail_msg("after %g s, %g m from the target, the middle of the picture is %g m away", time_s, distance_m,
                     depth_m);
    }
    karst_path_destroy(path);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_dive_has_no_holes),
        cmocka_unit_test(test_a_world_that_repeats_looks_the_same_anywhere),
        cmocka_unit_test(test_view_distance_changes_nothing_nearby),
        cmocka_unit_test(test_cameras_far_from_the_origin),
    };
    return cmocka_run_group_tests_name("places", tests, NULL, NULL);
}
