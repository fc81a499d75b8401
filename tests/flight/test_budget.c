/* A budget in milliseconds: production keeps to it on this very device, and it changes how soon a picture is there, not
 * what it is. */
#include "tests/flight/flight.h"

#include <math.h>
#include <stdio.h>

#define BUDGET_MS 3.0

static double production_ms(const karst_stats *stats)
{
    return (double)(stats->time_ns[KARST_STAGE_SUBDIVIDE] + stats->time_ns[KARST_STAGE_EVALUATE] +
                    stats->time_ns[KARST_STAGE_FINALISE]) /
           1e6;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* A flight that wants more than the budget gives. The machine may be busy with other things: so the median is held to
 * account, and a quarter of the frames may be anything. */
static void test_production_keeps_to_the_budget(void **state)
{
    (void)state;
    enum { FRAMES = 80, WARM_UP = 20 };
    static double ms[FRAMES];
    karst_engine_config config = flight_config("hills");
    config.detail_px = 0.5;
    config.budget_ms = BUDGET_MS;
    karst_engine *engine = flight_engine(&config);
    karst_camera camera = flight_camera(engine, "0,520,0,30,-35");
    uint64_t num_deferred = 0;
    int num = 0;
    for (int frame = 0; frame < WARM_UP + FRAMES; frame++) {
        karst_stats stats;
        camera.position =
            karst_position_add_m(camera.position, (double[3]){60, 0, 45}, karst_engine_voxel_log2_m(engine));
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        if (frame < WARM_UP)
            continue;
        num_deferred += stats.num_deferred;
        ms[num++] = production_ms(&stats);
        /* What is not there yet stands in coarser, once the first frames are past: never a hole. */
        assert_int_equal(stats.num_incomplete, 0);
    }
    qsort(ms, FRAMES, sizeof *ms, compare);
    print_message(
        "production of %d frames: median %.2f ms, three quarters below %.2f ms, most %.2f ms; the budget is %.2f ms\n",
        FRAMES, ms[FRAMES / 2], ms[FRAMES * 3 / 4], ms[FRAMES - 1], BUDGET_MS);
    assert_true(num_deferred > 1000);
    assert_true(ms[FRAMES / 2] < 1.25 * BUDGET_MS);
    assert_true(ms[FRAMES * 3 / 4] < 1.6 * BUDGET_MS);
    assert_true(ms[FRAMES / 2] > 0.4 * BUDGET_MS);
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
        cmocka_unit_test(test_budgets_out_of_range),
        cmocka_unit_test(test_a_budget_changes_no_settled_picture),
        cmocka_unit_test(test_the_smallest_budgets_settle),
        cmocka_unit_test(test_production_keeps_to_the_budget),
    };
    return cmocka_run_group_tests_name("budget", tests, NULL, NULL);
}
