/* Questions to a device: rays of a program's own meet what the picture's rays meet, in every bit, and what they lack is
 * made; points have the sampler's bits. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <math.h>

#include "karst/karst.h"

enum { WIDTH = 100, HEIGHT = 70, NUM = WIDTH * HEIGHT, NUM_POINTS = 3000 };

static const char land[] =
    "/*{ \"voxel\": 0.25, \"view\": 400, \"camera\": { \"position\": [3, 30, -12], \"pitch\": -12 } }*/\n"
    "float density(vec3 p) { return 9.0 * noise(p * 0.05) + 2.0 * noise(p * 0.21 + 3.0) - p.y; }\n";

static char *write_world(const char *text)
{
    static char path[64];
    strcpy(path, "/tmp/karst_rays_XXXXXX.karst");
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text) && close(fd) == 0);
    return path;
}

static karst_engine *open_engine(int width_px, int height_px)
{
    karst_error error = {0};
    const char *path = write_world(land);
    const karst_engine_config config = {.world = path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = width_px,
                                        .height_px = height_px,
                                        .pool_bytes = (uint64_t)256 << 20,
                                        .no_shadows = true};
    karst_engine *engine = karst_engine_create(&config, &error);
    unlink(path);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static void settle(karst_engine *engine)
{
    karst_error error = {0};
    bool settled = false;
    if (!karst_engine_settle(engine, 0, NULL, NULL, &settled, &error) || !settled)
        fail_msg("not settled: %s", error.message);
}

static karst_engine_rays_report cast(karst_engine *engine, const karst_engine_ray *rays, size_t num,
                                     karst_engine_hit *hits)
{
    karst_error error = {0};
    karst_engine_rays_report report;
    if (!karst_engine_cast_rays(engine, rays, num, 0, hits, &report, &error))
        fail_msg("%s", error.message);
    return report;
}

static void test_picture(void **state)
{
    (void)state;
    static karst_engine_ray rays[NUM];
    static karst_engine_hit hits[NUM];
    static uint32_t pixels[NUM];
    static float depth_m[NUM], normals[3 * NUM];
    static uint8_t before[4 * NUM], after[4 * NUM];
    static bool is_met[NUM];
    karst_engine *engine = open_engine(WIDTH, HEIGHT);
    settle(engine);
    assert_true(karst_engine_read_depth(engine, depth_m, NUM, NULL));
    assert_true(karst_engine_read_normals(engine, normals, 3 * NUM, NULL));
    assert_true(karst_engine_read_pixels(engine, before, sizeof before, NULL));
    assert_true(karst_engine_picture_rays(engine, rays, pixels, NUM, NULL));
    const karst_engine_rays_report report = cast(engine, rays, NUM, hits);
    assert_true(report.complete && report.num_rounds == 1 && report.num_produced == 0);
    size_t num_hits = 0;
    for (size_t i = 0; i < NUM; i++) {
        assert_true(pixels[i] < NUM && !is_met[pixels[i]]);
        is_met[pixels[i]] = true;
        assert_memory_equal(&hits[i].t_m, &depth_m[pixels[i]], sizeof(float));
        assert_int_equal(hits[i].kind == KARST_ENGINE_MISS, isinf(depth_m[pixels[i]]) != 0);
        num_hits += hits[i].kind != KARST_ENGINE_MISS;
        for (int axis = 0; axis < 3 && hits[i].kind == KARST_ENGINE_SURFACE; axis++)
            assert_memory_equal(&hits[i].normal[axis], &normals[3 * pixels[i] + (size_t)axis], sizeof(float));
    }
    assert_true(num_hits > NUM / 2 && num_hits < NUM);
    assert_true(karst_engine_frame(engine, NULL));
    assert_true(karst_engine_read_pixels(engine, after, sizeof after, NULL));
    assert_memory_equal(before, after, sizeof before);
    karst_engine_destroy(engine);
}

/* Straight down and up, all around and behind the camera, where the picture has seen nothing: what is there is made,
 * and is where the host's proof finds it. */
static void test_elsewhere(void **state)
{
    (void)state;
    enum { SIDE = 24 };
    static karst_engine_ray rays[SIDE * SIDE];
    static karst_engine_hit hits[SIDE * SIDE], alone[SIDE * SIDE];
    static karst_query_ray asked[SIDE * SIDE];
    static karst_query_hit expected[SIDE * SIDE];
    karst_engine *engine = open_engine(WIDTH, HEIGHT);
    settle(engine);
    const char *path = write_world(land);
    const karst_world_config of_land = {.world = path};
    karst_world *world = karst_world_open(&of_land, NULL);
    unlink(path);
    assert_non_null(world);
    const karst_camera camera = karst_engine_camera(engine);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double from_m[3] = {(i % SIDE - 12) * 7.3, 40, (i / SIDE - 12) * 7.1};
        rays[i] = (karst_engine_ray){.from_m = {(float)from_m[0], (float)from_m[1], (float)from_m[2]},
                                     .direction = {0, i % 7 ? -1 : 1, 0},
                                     .length_m = 90,
                                     .width_m = 0.25f};
        asked[i] = (karst_query_ray){
            .from = karst_position_add_m(
                camera.position,
                (const double[3]){(double)rays[i].from_m[0], (double)rays[i].from_m[1], (double)rays[i].from_m[2]}, -2),
            .direction = {0, i % 7 ? -1 : 1, 0},
            .length_m = 90};
    }
    const karst_engine_rays_report report = cast(engine, rays, SIDE * SIDE, hits);
    assert_true(report.complete && report.num_produced > 0);
    const karst_query_config config = {.footprint_m = 0.25};
    assert_true(karst_query_rays(world, &config, asked, SIDE * SIDE, expected, NULL));
    double farthest = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        assert_int_equal(hits[i].kind == KARST_ENGINE_MISS, expected[i].kind == KARST_QUERY_MISS);
        if (expected[i].kind != KARST_QUERY_SURFACE)
            continue;
        assert_int_equal(hits[i].level, 0);
        farthest = fmax(farthest, fabs((double)hits[i].t_m - expected[i].t_m));
        double cosine = 0;
        for (int axis = 0; axis < 3; axis++)
            cosine += (double)hits[i].normal[axis] * expected[i].normal[axis];
        assert_true(cosine > 0.97);
    }
    print_message("rays elsewhere: %u rounds, %llu made, hits within %.4f m of the density's\n", report.num_rounds,
                  (unsigned long long)report.num_produced, farthest);
    assert_true(farthest < 0.05);
    /* One by one they meet the same. */
    for (int i = 0; i < SIDE * SIDE; i += 17) {
        cast(engine, &rays[i], 1, &alone[i]);
        assert_memory_equal(&alone[i].t_m, &hits[i].t_m, sizeof(float));
    }
    karst_world_close(world);
    karst_engine_destroy(engine);
}

static void test_refusals(void **state)
{
    (void)state;
    karst_engine *engine = open_engine(16, 12);
    const karst_engine_ray good = {.direction = {0, -1, 0}, .length_m = 50, .width_m = 0.25f};
    karst_engine_hit hit;
    karst_error error = {0};
    assert_false(karst_engine_cast_rays(engine, &good, 1, 0, &hit, NULL, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_true(karst_engine_frame(engine, NULL));
    karst_engine_ray bad[6] = {good, good, good, good, good, good};
    bad[0].direction[1] = -2;
    bad[1].direction[1] = NAN;
    bad[2].from_m[2] = INFINITY;
    bad[3].length_m = 0;
    bad[4].width_m = -1;
    bad[5].cone = NAN;
    for (size_t i = 0; i < 6; i++) {
        error = (karst_error){0};
        assert_false(karst_engine_cast_rays(engine, &bad[i], 1, 0, &hit, NULL, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    /* One round finds what is there, and says that it is not all. */
    karst_engine_rays_report report;
    assert_true(karst_engine_cast_rays(engine, &good, 1, 1, &hit, &report, NULL));
    assert_int_equal(report.complete, hit.is_final);
    assert_true(karst_engine_cast_rays(engine, &good, 1, 0, &hit, &report, NULL));
    assert_true(hit.kind == KARST_ENGINE_SURFACE && hit.is_final && report.complete);
    assert_true(karst_engine_cast_rays(engine, &good, 0, 0, &hit, &report, NULL));
    assert_true(report.complete && report.num_rounds == 0);
    karst_engine_destroy(engine);
}

/* ---- points ---- */

static void compare_points(const karst_world *world, const char *what)
{
    static karst_position at[NUM_POINTS];
    static float density[NUM_POINTS], gradient[NUM_POINTS][3], expected[NUM_POINTS], slopes[NUM_POINTS][3];
    static float alone[NUM_POINTS];
    karst_error error = {0};
    uint32_t random = 9;
    karst_device_points *points = karst_device_points_create(world, NULL, NULL, &error);
    if (!points)
        fail_msg("%s: %s", what, error.message);
    for (int i = 0; i < NUM_POINTS; i++) {
        double offset_m[3];
        for (int axis = 0; axis < 3; axis++) {
            random = random * 1664525u + 1013904223u;
            offset_m[axis] = (random >> 8) / 16777216.0 * 300 - 150;
        }
        at[i] = karst_position_add_m((karst_position){{i % 3 ? 11 : (int64_t)1 << 52, 0, -3}, {0, 0, 0}}, offset_m,
                                     karst_world_get_metadata(world)->voxel_log2_m);
    }
    for (int i = 0; i < 3; i++) {
        const double footprint_m = i == 0 ? 0 : i == 1 ? 1.5 : 20;
        const karst_query_config config = {.footprint_m = footprint_m};
        if (!karst_device_points_find(points, at, NUM_POINTS, footprint_m, density, gradient, &error) ||
            !karst_device_points_find(points, at, NUM_POINTS, footprint_m, alone, NULL, &error) ||
            !karst_query_gradients(world, &config, at, NUM_POINTS, slopes, expected, &error))
            fail_msg("%s: %s", what, error.message);
        assert_memory_equal(density, expected, sizeof density);
        assert_memory_equal(alone, expected, sizeof density);
        assert_memory_equal(gradient, slopes, sizeof gradient);
    }
    karst_device_points_destroy(points);
}

static void test_points(void **state)
{
    (void)state;
    static const char *const texts[] = {
        land,
        "/*{ \"voxel\": 0.125, \"params\": { \"r\": { \"value\": 40 } } }*/\nfloat density(vec3 p) { return min(r - "
        "length(p), abs(p.x) - fract(p.y * 0.1)); }\n"};
    for (size_t i = 0; i < 2; i++) {
        const char *path = write_world(texts[i]);
        const karst_world_config config = {.world = path};
        karst_world *world = karst_world_open(&config, NULL);
        unlink(path);
        assert_non_null(world);
        compare_points(world, texts[i]);
        karst_world_close(world);
    }
    if (!getenv("KARST_TEST_FULL"))
        return;
    static const char *const names[] = {"hills", "alps", "asteroid", "lattice", "karst"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char path[4096];
        assert_true(karst_data_find("worlds", names[i], ".karst", path, sizeof path, NULL));
        const karst_world_config config = {.world = path};
        karst_world *world = karst_world_open(&config, NULL);
        assert_non_null(world);
        compare_points(world, names[i]);
        karst_world_close(world);
    }
}

/* ---- speed ---- */

/* 10^6 rays against the picture of as many, by turns; only told, as machines are busy, unless KARST_TEST_FULL is set.
 */
static void test_speed(void **state)
{
    (void)state;
    if (!getenv("KARST_TEST_FULL"))
        skip();
    enum { SIDE = 1000, TURNS = 20 };
    karst_engine *engine = open_engine(SIDE, SIDE);
    karst_engine_ray *rays = malloc((size_t)SIDE * SIDE * sizeof *rays);
    karst_engine_hit *hits = malloc((size_t)SIDE * SIDE * sizeof *hits);
    uint32_t *pixels = malloc((size_t)SIDE * SIDE * sizeof *pixels);
    assert_true(rays && hits && pixels);
    settle(engine);
    assert_true(karst_engine_picture_rays(engine, rays, pixels, (size_t)SIDE * SIDE, NULL));
    double picture_ms = INFINITY, asked_ms = INFINITY, whole_ms = INFINITY;
    for (int i = 0; i < TURNS; i++) {
        karst_stats stats;
        assert_true(karst_engine_frame(engine, NULL));
        karst_engine_stats(engine, &stats);
        picture_ms = fmin(picture_ms, (double)stats.time_ns[KARST_STAGE_CAST] / 1e6);
        const uint64_t start_ns = karst_clock();
        const karst_engine_rays_report report = cast(engine, rays, (size_t)SIDE * SIDE, hits);
        whole_ms = fmin(whole_ms, (double)(karst_clock() - start_ns) / 1e6);
        asked_ms = fmin(asked_ms, (double)report.cast_ns / 1e6);
        assert_true(report.complete);
    }
    print_message("10^6 rays: cast in %.1f ms, the picture's in %.1f (%.2f of it); with sending and reading %.1f ms\n",
                  asked_ms, picture_ms, asked_ms / picture_ms, whole_ms);
    assert_true(asked_ms <= 1.05 * picture_ms);
    free(rays);
    free(hits);
    free(pixels);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_picture), cmocka_unit_test(test_elsewhere), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_points),  cmocka_unit_test(test_speed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
