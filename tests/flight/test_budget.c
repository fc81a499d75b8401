/* A budget in milliseconds: on a device with prices of its own the cost model keeps to it, an engine makes what the
 * model says, and it changes how soon a picture is there, not what it is. Nothing here looks at a clock: how well
 * production keeps to a budget on this very device is for `karst bench` to tell. */
#include "tests/flight/flight.h"

#include <math.h>
#include <stdio.h>

#include "core/engine/cost.h"
#include "core/engine/engine_internal.h"
#include "karst/view.h"

#define BUDGET_NS 3e6
#define NUM_FRAMES 80

/* What a flight wants in each frame, as an engine without a budget makes it. */
static void record_demand(uint32_t bricks[NUM_FRAMES], uint32_t tiles[NUM_FRAMES])
{
    karst_engine_config config = flight_config("hills");
    config.detail_px = 0.5;
    karst_engine *engine = flight_engine(&config);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-35");
    for (int frame = 0; frame < NUM_FRAMES; frame++) {
        karst_stats stats;
        camera.position =
            karst_position_add_m(camera.position, (double[3]){60, 0, 45}, karst_engine_voxel_log2_m(engine));
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        bricks[frame] = (uint32_t)stats.num_bricks_produced;
        tiles[frame] = (uint32_t)stats.num_tiles_produced;
    }
    karst_engine_destroy(engine);
}

/* The flight's own bursts of demand on a made-up device, with a price for each launch, noise, and every seventh frame
 * disturbed: what is not made waits for the next frame. */
static void test_the_model_keeps_to_the_budget_of_a_flight(void **state)
{
    (void)state;
    static const struct {
        double brick_ns, tile_ns, launch_ns;
    } devices[] = {{130e3, 60e3, 30e3}, {60e3, 25e3, 10e3}, {500e3, 200e3, 50e3}};
    static uint32_t wanted_bricks[NUM_FRAMES], wanted_tiles[NUM_FRAMES];
    record_demand(wanted_bricks, wanted_tiles);
    for (size_t i = 0; i < sizeof devices / sizeof *devices; i++) {
        karst_cost cost;
        karst_cost_init(&cost);
        uint64_t random = 1, bricks = 0, tiles = 0;
        int num_over = 0, num_full = 0;
        double full_ns = 0;
        for (int frame = 0; frame < NUM_FRAMES * 4; frame++) {
            bricks += wanted_bricks[frame % NUM_FRAMES];
            tiles += wanted_tiles[frame % NUM_FRAMES];
            karst_cost_limits limits = karst_cost_plan(&cost, BUDGET_NS, 4096);
            uint32_t num_bricks = bricks < limits.max_bricks ? (uint32_t)bricks : limits.max_bricks;
            uint32_t num_tiles = tiles < limits.max_tiles ? (uint32_t)tiles : limits.max_tiles;
            random = random * 6364136223846793005u + 1442695040888963407u;
            double factor = 0.9 + 0.2 * (double)(random >> 40) * 0x1p-24;
            bool disturbed = frame % 7 == 6;
            factor *= disturbed ? 3 : 1;
            double brick_ns = num_bricks ? factor * (devices[i].launch_ns + num_bricks * devices[i].brick_ns) : 0;
            double tile_ns = num_tiles ? factor * (devices[i].launch_ns + num_tiles * devices[i].tile_ns) : 0;
            karst_cost_round round = {num_bricks, num_tiles, (uint64_t)brick_ns, (uint64_t)tile_ns, 0, 0};
            karst_cost_learn(&cost, &round);
            bricks -= num_bricks;
            tiles -= num_tiles;
            if (frame < 20 || disturbed)
                continue;
            num_over += brick_ns + tile_ns > 1.25 * BUDGET_NS;
            if (bricks > 0) { /* there was more to do */
                full_ns += brick_ns + tile_ns;
                num_full++;
            }
        }
        if (num_over > 3 || num_full < 50 || full_ns / num_full < 0.5 * BUDGET_NS)
            fail_msg("device %zu: %d frames over the budget, %g of it used in %d frames that had more to do", i,
                     num_over, full_ns / num_full / BUDGET_NS, num_full);
    }
}

/* A flight that wants more than the budget gives, on a device with made-up prices: the plan comes out in each frame,
 * with all its rounds together. */
static void test_production_keeps_to_the_budget(void **state)
{
    (void)state;
    const double brick_ns = 40e3, tile_ns = 9e3;
    karst_engine_config config = flight_config("hills");
    config.detail_px = 0.5;
    config.budget_ms = BUDGET_NS / 1e6;
    karst_engine *engine = flight_engine(&config);
    karst_engine_pretend_cost(engine, brick_ns, tile_ns);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-35");
    uint64_t num_deferred = 0;
    double least_ns = INFINITY, most_ns = 0;
    for (int frame = 0; frame < 60; frame++) {
        karst_stats stats;
        camera.position =
            karst_position_add_m(camera.position, (double[3]){100, 0, 75}, karst_engine_voxel_log2_m(engine));
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        num_deferred += stats.num_deferred;
        double ns = (double)stats.num_bricks_produced * brick_ns + (double)stats.num_tiles_produced * tile_ns;
        most_ns = fmax(most_ns, ns);
        if (stats.num_deferred && frame >= 10)
            least_ns = fmin(least_ns, ns);
        /* What is not there yet stands in coarser: never a hole. */
        assert_int_equal(stats.num_incomplete, 0);
    }
    print_message("of a budget of %.2f ms frames used %.2f to %.2f ms; %llu put off\n", BUDGET_NS / 1e6, least_ns / 1e6,
                  most_ns / 1e6, (unsigned long long)num_deferred);
    assert_true(num_deferred > 1000);
    assert_true(most_ns <= BUDGET_NS);
    /* Tiles get room for more than last time: what they do not take is not used. */
    assert_true(least_ns > 0.8 * BUDGET_NS);
    karst_engine_destroy(engine);
}

/* A frame, 10 m further. */
static void fly_on(karst_engine *engine, karst_camera *camera)
{
    camera->position = karst_position_add_m(camera->position, (double[3]){8, 0, 6}, karst_engine_voxel_log2_m(engine));
    assert_ok(karst_engine_set_camera(engine, camera, &error));
    assert_ok(karst_engine_frame(engine, &error));
}

/* Where the budget does not follow, less is asked for, and that is there: in steady flight at most twice as wide
 * voxels, after a jump coarse at first; standing, all of it comes in the end. What is shown short of the setting is
 * counted. */
static void test_what_is_asked_for_is_there(void **state)
{
    (void)state;
    karst_engine_config config = flight_config("hills");
    config.detail_px = 0.5;
    karst_engine *engine = flight_engine(&config);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-35");
    static flight_picture picture, settled;
    flight_settle(engine, &camera, &picture);
    assert_int_equal(picture.stats.num_coarser, 0);
    assert_ok(karst_engine_set_budget_ms(engine, 2, &error));
    karst_engine_pretend_cost(engine, 400e3, 120e3);
    karst_stats stats;
    double sum = 0, least = 1, most_px = 0, sum_own = 0;
    enum { FRAMES = 100 };
    for (int frame = 0; frame < FRAMES; frame++) {
        fly_on(engine, &camera);
        karst_engine_stats(engine, &stats);
        double hits = (double)stats.num_hits, share = 1 - (double)stats.num_provisional / hits;
        assert_true(stats.num_coarser >= stats.num_provisional);
        sum += share / FRAMES;
        sum_own += 1 - (double)stats.num_coarser / hits;
        least = fmin(least, share);
        most_px = fmax(most_px, stats.detail_given_px);
    }
    print_message("flying: %.1f %% at the level asked for, at least %.1f %%, at most %.2f px; %.1f %% at their own\n",
                  100 * sum, 100 * least, most_px, 100 * sum_own / FRAMES);
    assert_true(sum > 0.9 && least > 0.75);
    assert_true(most_px > 1.1 * config.detail_px && most_px <= 2 * config.detail_px);

    karst_engine_pretend_cost(engine, 100e3, 30e3);
    camera.position =
        karst_position_add_m(camera.position, (double[3]){60000, 0, 0}, karst_engine_voxel_log2_m(engine));
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    int whole_at = 0;
    for (int frame = 1; frame <= 15 && !whole_at; frame++) {
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        assert_int_equal(stats.num_incomplete, 0);
        if (stats.num_provisional * 10 <= stats.num_hits && stats.num_hits > 0)
            whole_at = frame;
    }
    print_message("after a jump: nine tenths at the level asked for in frame %d, at %.2f px\n", whole_at,
                  stats.detail_given_px);
    assert_true(whole_at > 0);
    assert_true(stats.detail_given_px > config.detail_px && stats.detail_given_px <= 2 * config.detail_px);
    karst_engine_pretend_cost(engine, 40e3, 12e3);
    flight_settle(engine, NULL, &settled);
    assert_true(settled.stats.detail_given_px == config.detail_px);
    assert_int_equal(settled.stats.num_coarser, 0);
    flight_fresh(&config, &camera, &picture);
    assert_same_picture(&settled, &picture);
    karst_engine_destroy(engine);
}

/* While fewer pixels are drawn, a budget with room makes what all of them need: who stops finds it there. */
static void test_a_stop_finds_its_detail(void **state)
{
    (void)state;
    karst_engine_config config = flight_config("hills");
    config.detail_px = 0.5;
    karst_engine *engine = flight_engine(&config);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-35");
    static flight_picture picture, settled;
    flight_settle(engine, &camera, &picture);
    assert_ok(karst_engine_set_drawn_size(engine, FLIGHT_WIDTH / 2, FLIGHT_HEIGHT / 2, &error));
    assert_ok(karst_engine_set_budget_ms(engine, 8, &error));
    karst_engine_pretend_cost(engine, 40e3, 40e3);
    for (int frame = 0; frame < 100; frame++)
        fly_on(engine, &camera);
    assert_ok(karst_engine_set_drawn_size(engine, FLIGHT_WIDTH, FLIGHT_HEIGHT, &error));
    karst_stats stats;
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    double share = (double)stats.num_coarser / (double)stats.num_hits;
    print_message("a second of flight before a stop: %.1f %% of it is coarser than set\n", 100 * share);
    assert_true(share < 0.3); /* 70 % without */
    flight_settle(engine, NULL, &settled);
    flight_fresh(&config, &camera, &picture);
    assert_same_picture(&settled, &picture);
    karst_engine_destroy(engine);
}

/* Where a path rises beside a cliff, what opens is there sooner if the path is known; and the pictures settle to the
 * same. */
static void test_a_known_path_is_prepared(void **state)
{
    (void)state;
    static flight_picture pictures[2];
    double share[2];
    for (int follows = 0; follows < 2; follows++) {
        karst_engine_config config = flight_config("hills");
        karst_engine *engine = flight_engine(&config);
        karst_path *path = flight_path(engine, "tests/flight/crest.json");
        karst_camera camera = karst_path_sample(path, 26);
        flight_settle(engine, &camera, &pictures[follows]);
        assert_ok(karst_engine_set_budget_ms(engine, 2, &error));
        karst_engine_pretend_cost(engine, 120e3, 40e3);
        double hits = 0, coarser = 0;
        for (double time_s = 26; time_s < 28.5; time_s += 1.0 / 30) {
            karst_stats stats;
            camera = karst_path_sample(path, time_s);
            assert_ok(karst_engine_set_camera(engine, &camera, &error));
            if (follows)
                karst_engine_follow(engine, path, time_s, 1.0 / 30);
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            assert_int_equal(stats.num_incomplete, 0);
            if (time_s > 27.2)
                hits += (double)stats.num_hits, coarser += (double)stats.num_coarser;
        }
        share[follows] = 1 - coarser / hits;
        flight_settle(engine, &camera, &pictures[follows]);
        karst_path_destroy(path);
        karst_engine_destroy(engine);
    }
    print_message("behind a crest %.1f %% at their own level, %.1f %% where the path is known\n", 100 * share[0],
                  100 * share[1]);
    assert_true(share[1] > share[0] + 0.03);
    assert_same_picture(&pictures[0], &pictures[1]);
}

/* Nothing fits into a microsecond: a frame makes next to nothing, once it is known what things cost; but never is
 * there a hole where there was a picture. */
static void test_an_engine_makes_what_the_model_says(void **state)
{
    (void)state;
    karst_engine_config config = flight_config("hills");
    config.detail_px = 0.25;
    karst_engine *engine = flight_engine(&config);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-35");
    static flight_picture picture;
    flight_settle(engine, &camera, &picture);
    assert_ok(karst_engine_set_budget_ms(engine, 0.001, &error));
    uint64_t num_deferred = 0, num_produced = 0;
    enum { FRAMES = 40 };
    for (int frame = 0; frame < FRAMES; frame++) {
        karst_stats stats;
        camera.position =
            karst_position_add_m(camera.position, (double[3]){60, 0, 45}, karst_engine_voxel_log2_m(engine));
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        assert_int_equal(stats.num_incomplete, 0);
        num_deferred += stats.num_deferred;
        num_produced += stats.num_produced;
    }
    print_message("%llu made and %llu put off in %d frames of a budget that holds nothing\n",
                  (unsigned long long)num_produced, (unsigned long long)num_deferred, FRAMES);
    assert_true(num_produced >= FRAMES);
    assert_true(num_produced <= 4 * FRAMES);
    assert_true(num_deferred > 100 * FRAMES);
    karst_engine_destroy(engine);
}

/* A pool that is too small makes the detail a matter of judgement: also then a clock may not have a say in it. */
static void test_a_budget_changes_no_settled_picture(void **state)
{
    (void)state;
    static flight_picture plain, hurried;
    for (int tight = 0; tight < 2; tight++) {
        karst_engine_config config = flight_config("hills");
        karst_engine *engine = flight_engine(&config);
        karst_camera camera = flight_camera(engine, "0,520,0,30,-25");
        karst_engine_destroy(engine);
        if (tight) {
            config.pool_bytes = 0;
            config.num_bricks = 200;
            config.num_tiles = 400;
        }
        flight_fresh(&config, &camera, &plain);
        assert_true((plain.stats.detail_given_px > plain.stats.detail_asked_px) == tight);
        config.budget_ms = 2;
        flight_fresh(&config, &camera, &hurried);
        print_message("%s pools: %u frames without a budget, %u with 2 ms\n", tight ? "tight" : "roomy",
                      plain.stats.frame, hurried.stats.frame);
        assert_true(hurried.stats.frame > plain.stats.frame);
        assert_same_picture(&plain, &hurried);
    }
}

/* Two bricks a frame: what does not fit never starves, since two slots are always found, and must be noticed all the
 * same. */
static void test_the_smallest_budgets_settle(void **state)
{
    (void)state;
    static flight_picture plain, slow;
    karst_engine_config config = flight_config("hills");
    config.pool_bytes = 0;
    config.num_bricks = 100;
    config.num_tiles = 200;
    karst_engine *engine = flight_engine(&config);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-25");
    karst_engine_destroy(engine);
    flight_fresh(&config, &camera, &plain);
    config.budget_bricks = 2;
    engine = flight_engine(&config);
    bool settled = false;
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    assert_ok(karst_engine_settle(engine, 8000, NULL, NULL, &settled, &error));
    flight_read(engine, &slow);
    print_message("two bricks a frame: %s after %u frames at %.3g px; %u frames and %.3g px without\n",
                  settled ? "settled" : "not settled", slow.stats.frame, slow.stats.detail_given_px, plain.stats.frame,
                  plain.stats.detail_given_px);
    assert_true(settled);
    assert_same_picture(&plain, &slow);
    karst_engine_destroy(engine);
}

static void test_budgets_out_of_range(void **state)
{
    (void)state;
    const double bad_ms[] = {-1, NAN, INFINITY, 1e6};
    for (size_t i = 0; i < sizeof bad_ms / sizeof *bad_ms; i++) {
        karst_engine_config config = flight_config("hills");
        config.budget_ms = bad_ms[i];
        karst_error error = {0};
        assert_null(karst_engine_create(&config, &error));
        assert_int_equal(error.status, KARST_USAGE);
        assert_non_null(strstr(error.message, "ms"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_production_keeps_to_the_budget),
        cmocka_unit_test(test_what_is_asked_for_is_there),
        cmocka_unit_test(test_a_stop_finds_its_detail),
        cmocka_unit_test(test_a_known_path_is_prepared),
        cmocka_unit_test(test_budgets_out_of_range),
        cmocka_unit_test(test_a_budget_changes_no_settled_picture),
        cmocka_unit_test(test_the_smallest_budgets_settle),
        cmocka_unit_test(test_the_model_keeps_to_the_budget_of_a_flight),
        cmocka_unit_test(test_an_engine_makes_what_the_model_says),
    };
    return cmocka_run_group_tests_name("budget", tests, NULL, NULL);
}
