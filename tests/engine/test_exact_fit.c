/* A settled picture depends on view and pools alone, also where the pools hold a rung's working set exactly, or but for
 * one: whatever an engine saw before, it ends on the bytes of one that saw nothing. KARST_TEST_FULL=1 walks all sizes
 * from 60 to 600 bricks of two worlds. */
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
#include "tests/support/ok.h"

#define NUM_FLIGHTS 5
#define MAX_FRAMES 120
#define CALM_FRAMES 3

typedef struct {
    int width_px, height_px;
    uint8_t *rgba, *fresh;
    karst_stats stats;
    uint32_t num_frames, most_frames;
    uint64_t num_views; /* over all */
    uint64_t sum_frames;
} run;

static uint64_t random_state;

/* 0 to 1, the same on every machine. */
static double random_share(void)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (double)(random_state >> 40) / (1 << 24);
}

static void settle(run *r, karst_engine *engine, uint8_t *rgba)
{
    karst_stats before;
    bool settled = false;
    karst_engine_stats(engine, &before);
    assert_ok(karst_engine_settle(engine, MAX_FRAMES, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &r->stats);
    if (!settled)
        fail_msg("not settled in %d frames: given %.3f px", MAX_FRAMES, r->stats.detail_given_px);
    r->num_frames = r->stats.frame - before.frame;
    r->most_frames = r->num_frames > r->most_frames ? r->num_frames : r->most_frames;
    r->sum_frames += r->num_frames;
    r->num_views++;
    assert_int_equal(r->stats.num_provisional, 0);
    assert_ok(karst_engine_read_pixels(engine, rgba, (size_t)r->width_px * (size_t)r->height_px * 4, &error));
    assert_ok(karst_engine_check(engine, &error));
}

/* Up to ten views as far as some kilometres away, turned at random, each left half done. */
static void fly_wildly(karst_engine *engine, const karst_camera *home)
{
    const double scale_m = pow(10, 3.5 * random_share());
    const int num_views = 3 + (int)(8 * random_share());
    for (int i = 0; i < num_views; i++) {
        const double step_m[3] = {(random_share() - 0.5) * scale_m, (random_share() - 0.3) * 0.3 * scale_m,
                                  (random_share() - 0.5) * scale_m};
        karst_camera away = *home;
        away.position = karst_position_add_m(home->position, step_m, karst_engine_voxel_log2_m(engine));
        away.yaw_deg += 360 * random_share();
        away.pitch_deg = 70 * random_share() - 60;
        assert_ok(karst_engine_set_camera(engine, &away, &error));
        for (int frame = 1 + (int)(6 * random_share()); frame > 0; frame--)
            assert_ok(karst_engine_frame(engine, &error));
    }
    assert_ok(karst_engine_set_camera(engine, home, &error));
}

static void stay_calm(karst_engine *engine)
{
    for (int i = 0; i < CALM_FRAMES; i++) {
        karst_stats stats;
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        assert_true(stats.settled && stats.num_requests == 0 && stats.num_produced == 0 && stats.num_evicted == 0);
    }
}

static void check_pool(run *r, const char *world, uint32_t num_bricks, uint32_t num_tiles, int num_flights)
{
    karst_error error = {0};
    karst_engine_config config = {.world = world,
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = r->width_px,
                                  .height_px = r->height_px,
                                  .num_bricks = num_bricks,
                                  .num_tiles = num_tiles};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    settle(r, engine, r->fresh);
    stay_calm(engine);
    const karst_stats fresh = r->stats;
    const karst_camera home = karst_engine_camera(engine);
    for (int i = 0; i < num_flights; i++) {
        random_state = num_bricks * 31u + (uint64_t)i * 7919u + num_tiles;
        fly_wildly(engine, &home);
        settle(r, engine, r->rgba);
        if (r->stats.detail_given_px != fresh.detail_given_px ||
            memcmp(r->rgba, r->fresh, (size_t)r->width_px * (size_t)r->height_px * 4) != 0)
            fail_msg("%s, %u bricks, %u tiles, flight %d: settled at %.3f px, a fresh engine at %.3f px", world,
                     num_bricks, num_tiles, i, r->stats.detail_given_px, fresh.detail_given_px);
        assert_int_equal(r->stats.bricks.num_used, fresh.bricks.num_used);
        stay_calm(engine);
    }
    karst_engine_destroy(engine);
}

static run begin(int width_px, int height_px)
{
    const size_t size_bytes = (size_t)width_px * (size_t)height_px * 4;
    return (run){.width_px = width_px, .height_px = height_px, .rgba = malloc(size_bytes), .fresh = malloc(size_bytes)};
}

static void end(run *r, const char *what)
{
    print_message("%s: %llu settled views, %.2f frames each, %u at most\n", what, (unsigned long long)r->num_views,
                  (double)r->sum_frames / (double)r->num_views, r->most_frames);
    free(r->rgba);
    free(r->fresh);
}

static bool is_set(const char *name)
{
    const char *text = getenv(name);
    return text && strcmp(text, "1") == 0;
}

/* Where a fresh engine and one after a flight once disagreed. */
static void test_working_sets_that_fit_exactly(void **state)
{
    (void)state;
    static const struct {
        const char *world;
        uint32_t num_bricks;
    } sizes[] = {{"karst", 127}, {"hills", 187}, {"karst", 128}, {"hills", 159}, {"hills", 300}, {"hills", 457}};
    const size_t num = is_set("KARST_TEST_QUICK") ? 2 : sizeof sizes / sizeof *sizes;
    run r = begin(200, 150);
    for (size_t i = 0; i < num; i++)
        check_pool(&r, sizes[i].world, sizes[i].num_bricks, 3 * sizes[i].num_bricks,
                   is_set("KARST_TEST_FULL") ? NUM_FLIGHTS : 2);
    end(&r, "sets that fit exactly");
}

static uint32_t piece(const char *name, uint32_t usual)
{
    const char *text = getenv(name);
    return is_set("KARST_TEST_FULL") && text ? (uint32_t)atoi(text) : usual;
}

/* KARST_TEST_FIRST, KARST_TEST_LAST and KARST_TEST_STEP cut the whole walk in pieces. */
static void walk_sizes(const char *world)
{
    const bool full = is_set("KARST_TEST_FULL");
    const uint32_t from = piece("KARST_TEST_FIRST", 60), to = piece("KARST_TEST_LAST", 600);
    const uint32_t step = full ? piece("KARST_TEST_STEP", 1) : is_set("KARST_TEST_QUICK") ? 530 : 135;
    run r = begin(96, 72);
    for (uint32_t num_bricks = from; num_bricks <= to; num_bricks += step)
        check_pool(&r, world, num_bricks, 3 * num_bricks, full ? NUM_FLIGHTS : 3);
    end(&r, world);
}

static void test_sizes_karst(void **state)
{
    (void)state;
    walk_sizes("karst");
}

static void test_sizes_hills(void **state)
{
    (void)state;
    walk_sizes("hills");
}

/* Where tiles are what is scarce. */
static void test_tiles_that_fit(void **state)
{
    (void)state;
    run r = begin(96, 72);
    static const uint32_t num_tiles[] = {97, 150, 211};
    const size_t num = is_set("KARST_TEST_QUICK") ? 1 : 3;
    for (size_t i = 0; i < num; i++)
        check_pool(&r, i == 1 ? "hills" : "karst", 2000, num_tiles[i], 3);
    end(&r, "tiles");
}

int main(void)
{
    const struct CMUnitTest walk[] = {cmocka_unit_test(test_sizes_karst), cmocka_unit_test(test_sizes_hills)};
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_working_sets_that_fit_exactly),
        cmocka_unit_test(test_sizes_karst),
        cmocka_unit_test(test_sizes_hills),
        cmocka_unit_test(test_tiles_that_fit),
    };
    if (getenv("KARST_TEST_FIRST"))
        return cmocka_run_group_tests_name("exact_fit, a piece", walk, NULL, NULL);
    return cmocka_run_group_tests_name("exact_fit", tests, NULL, NULL);
}
