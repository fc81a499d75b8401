/* Long flights and wild ones: memory stays as it was, the pools stay sound, and where a flight ends looks as if one had
 * come straight there.
 *
 * KARST_TEST_FULL=1 flies as many frames as the project promises; without it, enough to recycle the pools many times
 * over. */
#include "tests/flight/flight.h"

#include <math.h>
#include <stdio.h>

#include "core/engine/engine_internal.h"

#define FRAMES_BETWEEN_CHECKS 50

static uint64_t random_state;
static double random_share(void) /* [0, 1) */
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (double)(random_state >> 11) * 0x1p-53;
}

static bool is_full(void)
{
    const char *full = getenv("KARST_TEST_FULL");
    return full && *full && *full != '0';
}

static uint64_t memory_bytes(const karst_stats *stats)
{
    uint64_t sum_bytes = 0;
    for (size_t i = 0; i < stats->num_memory; i++)
        sum_bytes += stats->memory[i].size_bytes;
    return sum_bytes;
}

/* Pools that one view nearly fills: everything is recycled again and again. */
static karst_engine_config tight_config(const char *world)
{
    karst_engine_config config = flight_config(world);
    config.pool_bytes = 0;
    config.num_bricks = 700;
    config.num_tiles = 1200;
    return config;
}

typedef struct {
    uint64_t memory_bytes, num_produced, num_evicted, num_reproduced, num_non_finite;
    int num_frames, num_settled;
} log_book;

static void fly_frame(karst_engine *engine, const karst_camera *camera, log_book *book)
{
    karst_stats stats;
    assert_ok(karst_engine_set_camera(engine, camera, &error));
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    if (book->num_frames == 0)
        book->memory_bytes = memory_bytes(&stats);
    assert_true(book->memory_bytes > 0 && memory_bytes(&stats) == book->memory_bytes);
    assert_true(stats.num_resident_bricks <= stats.bricks.num_total &&
                stats.num_resident_tiles <= stats.tiles.num_total);
    /* However fast, however tight the pools: something is shown everywhere. */
    assert_int_equal(stats.num_incomplete, 0);
    book->num_produced += stats.num_produced;
    book->num_evicted += stats.num_evicted;
    book->num_reproduced += stats.num_reproduced;
    book->num_non_finite = stats.num_non_finite;
    book->num_settled += stats.settled;
    if (++book->num_frames % FRAMES_BETWEEN_CHECKS == 0)
        assert_ok(karst_engine_check(engine, &error));
}

/* The end of a flight: settled, sound, and the same as from an engine of its own. */
static void land(karst_engine *engine, const karst_engine_config *config, const log_book *book, const char *name)
{
    static flight_picture flown, fresh;
    karst_camera camera = karst_engine_camera(engine);
    flight_settle(engine, NULL, &flown);
    flight_fresh(config, &camera, &fresh);
    print_message(
        "%s: %d frames, %llu produced, %llu evicted, %llu soon again; landed at %.3g px, %llu bricks of %llu in use\n",
        name, book->num_frames, (unsigned long long)book->num_produced, (unsigned long long)book->num_evicted,
        (unsigned long long)book->num_reproduced, flown.stats.detail_given_px,
        (unsigned long long)flown.stats.bricks.num_used, (unsigned long long)flown.stats.bricks.num_total);
    assert_same_picture(&flown, &fresh);
    assert_true(flown.stats.num_hits > FLIGHT_PIXELS / 3);
    assert_int_equal(flown.stats.num_provisional, 0);
    assert_int_equal(flown.stats.num_incomplete, 0);
    assert_true(memory_bytes(&flown.stats) == book->memory_bytes);
    assert_int_equal(book->num_non_finite, 0);
    /* All that the pools hold was replaced, and more than once. */
    assert_true(book->num_evicted > 2 * flown.stats.bricks.num_total);
}

static void test_straight_on_for_a_million_kilometres(void **state)
{
    (void)state;
    const int num_steps = is_full() ? 2000 : 80;
    karst_engine_config config = tight_config("hills");
    karst_engine *engine = flight_engine(&config);
    karst_camera start = flight_camera(engine, "-3,520,7,70,-25"), camera = start;
    log_book book = {0};
    for (int step = 0; step <= num_steps; step++) {
        double way_m = 1e9 * step / num_steps;
        camera.position = karst_position_add_m(start.position, (double[3]){way_m * 0.8, 0, way_m * 0.6},
                                               karst_engine_voxel_log2_m(engine));
        /* So fast, a frame only sees the coarsest of where it is: sometimes one stops to look. */
        for (int more = step % 4 == 0 ? 6 : 1; more > 0; more--)
            fly_frame(engine, &camera, &book);
    }
    land(engine, &config, &book, "straight on");
    karst_engine_destroy(engine);
}

static void test_random_walk_with_jumps(void **state)
{
    (void)state;
    const int num_frames = is_full() ? 10000 : 400;
    karst_engine_config config = tight_config("hills");
    karst_engine *engine = flight_engine(&config);
    int voxel_log2_m = karst_engine_voxel_log2_m(engine);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-25");
    log_book book = {0};
    random_state = 2013;
    for (int frame = 0; frame < num_frames; frame++) {
        /* Mostly a few metres; now and then far, to where it may have been before or never comes again. */
        double reach_m = random_share() < 0.04 ? pow(10, 2 + 10 * random_share()) : 6;
        karst_position place = camera.position;
        place = karst_position_add_m(
            place, (double[3]){reach_m * (2 * random_share() - 1), 0, reach_m * (2 * random_share() - 1)},
            voxel_log2_m);
        if (reach_m > 1e9 && random_share() < 0.5)
            place = flight_camera(engine, "0,520,0,0,0").position;
        camera.position = place;
        camera.yaw_deg += 12 * (2 * random_share() - 1);
        camera.pitch_deg = fmin(10, fmax(-80, camera.pitch_deg + 6 * (2 * random_share() - 1)));
        fly_frame(engine, &camera, &book);
        /* Sometimes it stands still for a while. */
        if (random_share() < 0.02)
            for (int i = 0; i < 5; i++)
                fly_frame(engine, &camera, &book);
    }
    camera.pitch_deg = -25;
    fly_frame(engine, &camera, &book);
    land(engine, &config, &book, "random walk");
    karst_engine_destroy(engine);
}

/* Down from far above into a valley, with pools of 1.2 times what the end needs: it gets there in full, and to the same
 * picture as with pools without end. A cache that keeps what it saw on the way stays stuck far above. */
static void test_far_to_near_with_little_more_than_needed(void **state)
{
    (void)state;
    static flight_picture wanted, flown;
    karst_engine_config config = flight_config("hills");
    config.pool_bytes = (uint64_t)512 << 20;
    karst_engine *engine = flight_engine(&config);
    karst_path *path = flight_path(engine, "demos/paths/dive.json");
    const double start_s = 11, end_s = 21.5; /* 17,800 m to 42 m */
    karst_camera last = karst_path_sample(path, end_s);
    last.pitch_deg = -20; /* up from the ground below to the far side of the valley: all levels at once */
    flight_settle(engine, &last, &wanted);
    assert_true(wanted.stats.detail_given_px == wanted.stats.detail_asked_px);
    karst_engine_destroy(engine);

    config.pool_bytes = 0;
    config.num_bricks = (uint32_t)(wanted.stats.bricks.num_used * 6 / 5) + 1;
    config.num_tiles = (uint32_t)(wanted.stats.tiles.num_used * 6 / 5) + 1;
    for (int frames_a_step = 1; frames_a_step <= 4; frames_a_step += 3) {
        engine = flight_engine(&config);
        log_book book = {0};
        const int num_steps = 60;
        for (int step = 0; step <= num_steps; step++) {
            karst_camera camera =
                step < num_steps ? karst_path_sample(path, start_s + (end_s - start_s) * step / num_steps) : last;
            for (int frame = 0; frame < frames_a_step; frame++)
                fly_frame(engine, &camera, &book);
        }
        flight_settle(engine, NULL, &flown);
        print_message(
            "far to near, %d frames a step: %llu of %llu bricks, %llu of %llu tiles in use, %llu evicted on the way\n",
            frames_a_step, (unsigned long long)flown.stats.bricks.num_used,
            (unsigned long long)flown.stats.bricks.num_total, (unsigned long long)flown.stats.tiles.num_used,
            (unsigned long long)flown.stats.tiles.num_total, (unsigned long long)book.num_evicted);
        assert_true(book.num_evicted > 0);
        assert_same_picture(&flown, &wanted);
        assert_int_equal(flown.stats.num_provisional, 0);
        karst_engine_destroy(engine);
    }
    karst_path_destroy(path);
}

/* After a teleport the picture is there at once, coarse, and most of it in full within 15 frames: counted in bricks, so
 * that no clock has a say. The whole screen comes first: no pixel waits as a hole while others are refined. */
static void test_settling_after_a_jump(void **state)
{
    (void)state;
    karst_engine_config config = flight_config("hills");
    config.budget_bricks = 64;
    karst_engine *engine = flight_engine(&config);
    karst_path *path = flight_path(engine, "demos/paths/jump.json");
    for (int place = 0; place < 5; place++) {
        int whole_at = 0, full_at = 0;
        karst_camera camera = karst_path_sample(path, 3 * place);
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        for (int frame = 1; frame <= 40; frame++) {
            karst_stats stats;
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            bool full = stats.num_hits > 0 && stats.num_provisional * 10 <= stats.num_hits;
            if (!whole_at && stats.num_incomplete == 0)
                whole_at = frame;
            /* Once whole, it stays so. */
            assert_true(!whole_at || stats.num_incomplete == 0);
            if (!full_at && full && whole_at)
                full_at = frame;
        }
        print_message("place %d: no holes from frame %d on, nine tenths at their level from frame %d on\n", place,
                      whole_at, full_at);
        assert_true(whole_at > 0 && whole_at <= 4);
        assert_true(full_at > 0 && full_at <= 15);
    }
    karst_path_destroy(path);
    karst_engine_destroy(engine);
}

/* Two engines fly the same way, one with counters that wrap around on it: they do the same, frame by frame, and both
 * come to rest. */
static void fly_through_the_wrap(uint32_t serial, uint32_t frame_number)
{
    static flight_picture plain, wrapped;
    karst_engine_config config = tight_config("hills");
    karst_engine *engines[2] = {flight_engine(&config), flight_engine(&config)};
    karst_engine_start_counting_at(engines[1], serial, frame_number);
    int voxel_log2_m = karst_engine_voxel_log2_m(engines[0]);
    karst_camera camera = flight_camera(engines[0], "0,520,0,30,-25");
    uint64_t num_evicted = 0;
    for (int frame = 0; frame < 40; frame++) {
        karst_stats stats[2];
        for (int e = 0; e < 2; e++) {
            assert_ok(karst_engine_set_camera(engines[e], &camera, &error));
            assert_ok(karst_engine_frame(engines[e], &error));
            karst_engine_stats(engines[e], &stats[e]);
        }
        assert_true(stats[1].frame != 0);
        assert_true(stats[0].num_requests == stats[1].num_requests && stats[0].num_produced == stats[1].num_produced);
        assert_true(stats[0].num_evicted == stats[1].num_evicted && stats[0].num_reproduced == stats[1].num_reproduced);
        assert_true(stats[0].num_provisional == stats[1].num_provisional &&
                    stats[0].detail_given_px == stats[1].detail_given_px);
        assert_true(stats[0].num_resident_bricks == stats[1].num_resident_bricks);
        num_evicted += stats[1].num_evicted;
        if (frame % 10 == 9) {
            flight_read(engines[0], &plain);
            flight_read(engines[1], &wrapped);
            assert_same_picture(&plain, &wrapped);
            assert_ok(karst_engine_check(engines[1], &error));
        }
        /* On, and back again to what was evicted before the wrap. */
        double step_m = frame < 20 ? 900 : -900;
        if (frame >= 4 && frame < 36)
            camera.position = karst_position_add_m(camera.position, (double[3]){step_m, 0, step_m / 2}, voxel_log2_m);
    }
    assert_true(num_evicted > 500);
    for (int e = 0; e < 2; e++) {
        flight_settle(engines[e], NULL, e ? &wrapped : &plain);
        for (int calm = 0; calm < 4; calm++) {
            karst_stats stats;
            assert_ok(karst_engine_frame(engines[e], &error));
            karst_engine_stats(engines[e], &stats);
            assert_true(stats.settled && stats.num_requests == 0 && stats.num_evicted == 0);
        }
        karst_engine_destroy(engines[e]);
    }
    assert_same_picture(&plain, &wrapped);
}

static void test_counters_may_wrap_around(void **state)
{
    (void)state;
    fly_through_the_wrap(UINT32_MAX - 10, UINT32_MAX - 16);
    fly_through_the_wrap(UINT32_MAX - 1, UINT32_MAX);
    /* Signed comparisons turn over here. */
    fly_through_the_wrap((uint32_t)INT32_MAX - 13, (uint32_t)INT32_MAX - 7);
}

/* The wrap comes while nothing moves: it stays calm. */
static void test_calm_through_the_wrap(void **state)
{
    (void)state;
    static flight_picture before, after;
    karst_engine_config config = tight_config("asteroid");
    karst_engine *engine = flight_engine(&config);
    karst_engine_start_counting_at(engine, UINT32_MAX - 200, UINT32_MAX - 150);
    flight_settle(engine, NULL, &before);
    assert_true(before.stats.frame > UINT32_MAX - 150); /* not there yet */
    for (int frame = 0; frame < 250; frame++) {
        karst_stats stats;
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        assert_true(stats.settled && stats.num_requests == 0 && stats.num_produced == 0 && stats.num_evicted == 0);
        assert_true(stats.bricks.num_used == before.stats.bricks.num_used &&
                    stats.tiles.num_used == before.stats.tiles.num_used);
        flight_read(engine, &after); /* also at frame numbers next to 0 */
    }
    assert_true(after.stats.frame < 1000);
    assert_same_picture(&before, &after);
    assert_ok(karst_engine_check(engine, &error));
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_straight_on_for_a_million_kilometres),
        cmocka_unit_test(test_random_walk_with_jumps),
        cmocka_unit_test(test_far_to_near_with_little_more_than_needed),
        cmocka_unit_test(test_settling_after_a_jump),
        cmocka_unit_test(test_counters_may_wrap_around),
        cmocka_unit_test(test_calm_through_the_wrap),
    };
    return cmocka_run_group_tests_name("flights", tests, NULL, NULL);
}
