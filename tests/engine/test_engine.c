/* The whole loop through the public interface: calm at any pool size, pictures that depend on the view alone, nothing
 * shown as a hole. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/scene.h"

#define WIDTH 320
#define HEIGHT 240
#define NUM_PIXELS (WIDTH * HEIGHT)
#define MAX_FRAMES 120 /* to settle, whatever the pools' size */
#define CALM_FRAMES 8  /* observed afterwards */
/* A load needs a slot before it is known whether its brick stays: where none is left, the last may never be tried. */
#define SPARE_BRICKS 8

typedef struct {
    uint8_t *rgba;
    float *depth_m;
    karst_stats stats;
    uint32_t num_frames;
} picture;

static void print_line(void *user, karst_log_level level, const char *line)
{
    (void)user;
    (void)level;
    print_message("%s\n", line);
}
static const karst_log log_to_test = {.write = print_line, .max_level = KARST_LOG_WARNING};

static karst_engine_config base_config(const char *world)
{
    return (karst_engine_config){.world = world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .pool_bytes = (uint64_t)1 << 29,
                                 .count_changed_pixels = true,
                                 .log = &log_to_test};
}

static picture take(karst_engine *engine)
{
    picture p = {.rgba = malloc(NUM_PIXELS * 4), .depth_m = malloc(NUM_PIXELS * sizeof(float))};
    bool settled = false;
    assert_ok(karst_engine_settle(engine, MAX_FRAMES, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &p.stats);
    p.num_frames = p.stats.frame;
    if (!settled)
        fail_msg("not settled in %d frames: %llu requests, %llu produced, %llu deferred, given %.3g px", MAX_FRAMES,
                 (unsigned long long)p.stats.num_requests, (unsigned long long)p.stats.num_produced,
                 (unsigned long long)p.stats.num_deferred, p.stats.detail_given_px);
    assert_ok(karst_engine_read_pixels(engine, p.rgba, NUM_PIXELS * 4, &error));
    assert_ok(karst_engine_read_depth(engine, p.depth_m, NUM_PIXELS, &error));
    assert_ok(karst_engine_check(engine, &error));
    /* What is counted is this picture's, and all of it. */
    uint64_t num_hits = 0;
    for (int i = 0; i < NUM_PIXELS; i++)
        num_hits += isfinite(p.depth_m[i]) != 0;
    assert_int_equal(p.stats.num_hits, num_hits);
    return p;
}

static void release(picture *p)
{
    free(p->rgba);
    free(p->depth_m);
}

/* Still camera, settled: nothing is produced, evicted or changed, and every hit is at the level asked for. */
static void assert_calm(karst_engine *engine)
{
    karst_stats stats;
    for (int i = 0; i < CALM_FRAMES; i++) {
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        assert_true(stats.settled);
        assert_int_equal(stats.num_requests, 0);
        assert_int_equal(stats.num_produced, 0);
        assert_int_equal(stats.num_evicted, 0);
        assert_int_equal(stats.num_changed_pixels, 0);
        assert_int_equal(stats.num_provisional, 0);
        assert_int_equal(stats.num_incomplete, 0);
    }
}

/* Pixels well inside what the reference sees as surface that the other picture sees as sky. */
static int count_holes(const float *reference_m, const float *depth_m, int margin_px)
{
    int holes = 0;
    for (int y = margin_px; y < HEIGHT - margin_px; y++)
        for (int x = margin_px; x < WIDTH - margin_px; x++) {
            if (isfinite(depth_m[y * WIDTH + x]))
                continue;
            bool inside = true;
            for (int dy = -margin_px; dy <= margin_px && inside; dy++)
                for (int dx = -margin_px; dx <= margin_px && inside; dx++)
                    inside = isfinite(reference_m[(y + dy) * WIDTH + x + dx]);
            holes += inside;
        }
    return holes;
}

static void check_calm_at_pool_sizes(const char *world)
{
    karst_engine_config config = base_config(world);
    karst_engine *engine = scene_open(&config);
    picture wanted = take(engine);
    assert_true(wanted.stats.detail_given_px == wanted.stats.detail_asked_px);
    assert_true(wanted.stats.num_hits > NUM_PIXELS / 10);
    assert_calm(engine);
    karst_engine_destroy(engine);
    assert_true(wanted.stats.bricks.num_used * 10 <=
                wanted.stats.bricks.num_total); /* the reference pool is ten times as large */

    double previous_given_px = 0;
    const int percents[] = {100, 50, 25, 10};
    for (size_t i = 0; i < sizeof percents / sizeof *percents; i++) {
        config.num_bricks =
            (uint32_t)(wanted.stats.bricks.num_used * (uint64_t)percents[i] / 100) + SPARE_BRICKS + 1; /* and slot 0 */
        config.num_tiles = (uint32_t)(wanted.stats.tiles.num_used * (uint64_t)percents[i] / 100) + 1;
        engine = scene_open(&config);
        picture p = take(engine);
        print_message("%s, pools at %3d %%: %u frames, given %.3f of %.3f px, %llu bricks and %llu tiles used\n", world,
                      percents[i], p.num_frames, p.stats.detail_given_px, p.stats.detail_asked_px,
                      (unsigned long long)p.stats.bricks.num_used, (unsigned long long)p.stats.tiles.num_used);
        assert_calm(engine);
        assert_true(p.stats.detail_given_px >= previous_given_px);
        previous_given_px = p.stats.detail_given_px;
        if (percents[i] == 100) {
            assert_true(p.stats.detail_given_px == p.stats.detail_asked_px);
            assert_memory_equal(p.rgba, wanted.rgba, NUM_PIXELS * 4);
            assert_memory_equal(p.depth_m, wanted.depth_m, NUM_PIXELS * sizeof(float));
        } else {
            assert_true(p.stats.detail_given_px > p.stats.detail_asked_px);
        }
        assert_int_equal(count_holes(wanted.depth_m, p.depth_m, 8), 0);
        release(&p);
        karst_engine_destroy(engine);
    }
    release(&wanted);
}

static void test_calm_at_any_pool_size_hills(void **state)
{
    (void)state;
    check_calm_at_pool_sizes("hills");
}

static void test_calm_at_any_pool_size_asteroid(void **state)
{
    (void)state;
    check_calm_at_pool_sizes("asteroid");
}

/* A settled picture depends on the view, not on how it was reached, also when the pools are too small for it. */
static void test_history_leaves_no_trace(void **state)
{
    (void)state;
    karst_engine_config config = base_config("hills");
    karst_engine *engine = scene_open(&config);
    picture direct = take(engine);
    karst_camera home = karst_engine_camera(engine);
    int voxel_log2_m = karst_engine_voxel_log2_m(engine);

    for (int tight = 0; tight < 2; tight++) {
        if (tight) {
            karst_engine_destroy(engine);
            release(&direct);
            config.num_bricks = (uint32_t)direct.stats.bricks.num_used / 3;
            config.num_tiles = (uint32_t)direct.stats.tiles.num_used;
            engine = scene_open(&config);
            direct = take(engine);
            assert_true(direct.stats.detail_given_px > direct.stats.detail_asked_px);
        }
        const double steps_m[][3] = {{40, 10, 25}, {3000, 200, -1000}, {-30000, 500, 100000}};
        for (size_t i = 0; i < 3; i++) {
            karst_camera away = home;
            away.position = karst_position_add_m(home.position, steps_m[i], voxel_log2_m);
            away.yaw_deg += 70 * (double)(i + 1);
            assert_ok(karst_engine_set_camera(engine, &away, &error));
            for (int frame = 0; frame < 6; frame++) /* leave it half done */
                assert_ok(karst_engine_frame(engine, &error));
            assert_ok(karst_engine_check(engine, &error));
            assert_ok(karst_engine_set_camera(engine, &home, &error));
            picture again = take(engine);
            assert_true(again.stats.detail_given_px == direct.stats.detail_given_px);
            assert_memory_equal(again.rgba, direct.rgba, NUM_PIXELS * 4);
            release(&again);
        }
    }
    release(&direct);
    karst_engine_destroy(engine);
}

/* The pools may be cut into many allocations: the picture is the same in every byte. */
static void test_segments_change_nothing(void **state)
{
    (void)state;
    karst_engine_config config = base_config("asteroid");
    config.pool_bytes = 0;
    config.num_bricks = 6000;
    config.num_tiles = 12000;
    karst_engine *engine = scene_open(&config);
    picture whole = take(engine);
    karst_engine_destroy(engine);
    config.max_segment_bytes = (size_t)1000 * 4928 * 2; /* 1000 bricks to a segment */
    engine = scene_open(&config);
    picture cut = take(engine);
    assert_memory_equal(cut.rgba, whole.rgba, NUM_PIXELS * 4);
    release(&cut);
    release(&whole);
    karst_engine_destroy(engine);
}

/* Sixteen lanes or one, the CPU's shapes of the kernels or those of GPUs: one world, one picture. */
static void test_lanes_change_nothing(void **state)
{
    (void)state;
    karst_engine_config config = base_config("hills");
    config.detail_px = 3;
    config.lanes = 16;
    karst_engine *engine = scene_open(&config);
    picture wide = take(engine);
    karst_engine_destroy(engine);
    config.lanes = 1;
    engine = scene_open(&config);
    picture narrow = take(engine);
    karst_engine_destroy(engine);
    assert_memory_equal(narrow.depth_m, wide.depth_m, NUM_PIXELS * sizeof(float));
    assert_memory_equal(narrow.rgba, wide.rgba, NUM_PIXELS * 4);
    assert_int_equal(narrow.stats.bricks.num_used, wide.stats.bricks.num_used);
    assert_int_equal(narrow.stats.tiles.num_used, wide.stats.tiles.num_used);
    release(&narrow);
    release(&wide);
}

/* An engine draws in a display of its own or in the caller's, which stays the caller's, to the same bytes. */
static void test_displays_own_and_borrowed(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_engine_config config = base_config("hills");
    config.detail_px = 3;
    karst_engine *engine = scene_open(&config);
    picture own = take(engine);
    assert_int_equal(karst_display_get_kind(karst_engine_display(engine)), KARST_DISPLAY_NONE);
    karst_engine_destroy(engine);
    karst_display *display = karst_display_create(KARST_DISPLAY_AUTO, &log_to_test, &error);
    if (!display)
        fail_msg("%s", error.message);
    const karst_display_kind kind = karst_display_get_kind(display);
    config.in_display = display;
    for (int i = 0; i < 2; i++) { /* the second finds it as the first left it */
        engine = scene_open(&config);
        assert_ptr_equal(karst_engine_display(engine), display);
        picture borrowed = take(engine);
        karst_engine_destroy(engine);
        assert_memory_equal(borrowed.rgba, own.rgba, NUM_PIXELS * 4);
        release(&borrowed);
    }
    assert_int_equal(karst_display_get_kind(display), kind);
    karst_display_destroy(display);
    release(&own);
}

/* A view that settles looks again only where something was asked for: so its last picture lacks nothing. The picture
 * is that of whole frames, one by one. */
static void check_looking_again(bool no_shadows, uint32_t num_frames)
{
    karst_engine_config config = base_config("hills");
    config.no_shadows = no_shadows;
    karst_engine *engine = scene_open(&config);
    picture looked_again = take(engine);
    karst_engine_destroy(engine);
    assert_int_equal(looked_again.num_frames, num_frames);

    engine = scene_open(&config);
    karst_stats stats = {0};
    while (!stats.settled && stats.frame < MAX_FRAMES) {
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
    }
    picture whole = take(engine);
    assert_true(stats.settled && stats.frame > looked_again.num_frames);
    assert_memory_equal(looked_again.rgba, whole.rgba, NUM_PIXELS * 4);
    assert_memory_equal(looked_again.depth_m, whole.depth_m, NUM_PIXELS * sizeof(float));
    release(&looked_again);
    release(&whole);
    karst_engine_destroy(engine);
}

/* What kernels do on a CPU with fewer instructions, in place of what they do here: the same picture of the same bricks.
 */
static void check_vectors(const char *vectors)
{
    karst_engine_config config = base_config("hills");
    config.detail_px = 3;
    config.lanes = 16;
    karst_engine *engine = scene_open(&config);
    picture fast = take(engine);
    karst_engine_destroy(engine);
    assert_int_equal(setenv("KARST_VECTORS", vectors, 1), 0);
    engine = scene_open(&config);
    picture plain = take(engine);
    karst_engine_destroy(engine);
    unsetenv("KARST_VECTORS");
    assert_memory_equal(plain.depth_m, fast.depth_m, NUM_PIXELS * sizeof(float));
    assert_memory_equal(plain.rgba, fast.rgba, NUM_PIXELS * 4);
    assert_int_equal(plain.stats.bricks.num_used, fast.stats.bricks.num_used);
    assert_int_equal(plain.stats.tiles.num_used, fast.stats.tiles.num_used);
    release(&fast);
    release(&plain);
}

static void test_fewer_instructions_change_nothing(void **state)
{
    (void)state;
    check_vectors("avx2");
    check_vectors("plain");
}

static void test_looking_again_misses_nothing(void **state)
{
    (void)state;
    check_looking_again(true, 3); /* the first, the one that is looked at again, the settled one */
    check_looking_again(false, 4); /* and before that the one whose shadows are */
}

static void expect_failure(karst_engine_config config, karst_status status, const char *words)
{
    karst_error error = {0};
    karst_engine *engine = karst_engine_create(&config, &error);
    assert_null(engine);
    assert_int_equal(error.status, status);
    if (!strstr(error.message, words))
        fail_msg("'%s' does not say '%s'", error.message, words);
}

static void test_bad_configurations_say_what_to_do(void **state)
{
    (void)state;
    karst_engine_config config = base_config("hillz");
    expect_failure(config, KARST_BAD_WORLD, "hills");
    config = base_config(NULL);
    expect_failure(config, KARST_USAGE, "no world is named");
    config = base_config("hills");
    config.width_px = 100000;
    expect_failure(config, KARST_USAGE, "16384");
    config = base_config("hills");
    config.width_px = 0;
    expect_failure(config, KARST_USAGE, "16384");
    config = base_config("hills");
    config.pool_bytes = 1000;
    expect_failure(config, KARST_USAGE, "--pool");
    config = base_config("hills");
    config.detail_px = NAN;
    expect_failure(config, KARST_USAGE, "pixels");
    config = base_config("hills");
    config.view_distance_m = -1;
    expect_failure(config, KARST_USAGE, "view distance");
    config = base_config("hills");
    config.device = "no such device";
    expect_failure(config, KARST_NO_DEVICE, "no such device");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bad_configurations_say_what_to_do),
        cmocka_unit_test(test_calm_at_any_pool_size_hills),
        cmocka_unit_test(test_calm_at_any_pool_size_asteroid),
        cmocka_unit_test(test_history_leaves_no_trace),
        cmocka_unit_test(test_looking_again_misses_nothing),
        cmocka_unit_test(test_segments_change_nothing),
        cmocka_unit_test(test_lanes_change_nothing),
        cmocka_unit_test(test_displays_own_and_borrowed),
        cmocka_unit_test(test_fewer_instructions_change_nothing),
    };
    return cmocka_run_group_tests_name("engine", tests, NULL, NULL);
}
