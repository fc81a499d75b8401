/* The cost model: it keeps to the budget on made-up devices, steady or noisy, and never starves production. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/engine/cost.h"

#define MOST 8192u
#define BUDGET_NS 8e6

static uint64_t random_state = 1;
static double random_share(void) /* 0 to 1 */
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (double)(random_state >> 40) * 0x1p-24;
}

/* A device with a price for each thing and for each launch, and with noise. */
typedef struct {
    double brick_ns, tile_ns, launch_ns, noise;
} device;

/* One round on it, of which the world wants so much; returns the time it took. */
static double run(const device *d, karst_cost *cost, double budget_ns, uint32_t wanted_bricks, uint32_t wanted_tiles,
                  karst_cost_limits *made)
{
    karst_cost_limits limits = karst_cost_plan(cost, budget_ns, MOST);
    assert_true(limits.max_bricks >= 1 && limits.max_bricks <= MOST);
    assert_true(limits.max_tiles >= 1 && limits.max_tiles <= MOST);
    made->max_bricks = wanted_bricks < limits.max_bricks ? wanted_bricks : limits.max_bricks;
    made->max_tiles = wanted_tiles < limits.max_tiles ? wanted_tiles : limits.max_tiles;
    double factor = 1 + d->noise * (2 * random_share() - 1);
    double brick_ns = made->max_bricks ? factor * (d->launch_ns + made->max_bricks * d->brick_ns) : 0;
    double tile_ns = made->max_tiles ? factor * (d->launch_ns + made->max_tiles * d->tile_ns) : 0;
    karst_cost_round round = {made->max_bricks, made->max_tiles, (uint64_t)brick_ns, (uint64_t)tile_ns, 0, 0};
    karst_cost_learn(cost, &round);
    return brick_ns + tile_ns;
}

static void test_the_budget_is_met_and_used(void **state)
{
    (void)state;
    const device devices[] = {{50e3, 20e3, 0, 0},
                              {50e3, 20e3, 30e3, 0},
                              {400e3, 150e3, 20e3, 0},
                              {2e3, 1e3, 10e3, 0},
                              {50e3, 20e3, 30e3, 0.1}};
    for (size_t i = 0; i < sizeof devices / sizeof *devices; i++) {
        karst_cost cost;
        karst_cost_limits made;
        karst_cost_init(&cost);
        int num_over = 0, num_rounds = 1000;
        double sum_ns = 0;
        for (int round = 0; round < num_rounds; round++) {
            double ns = run(&devices[i], &cost, BUDGET_NS, MOST, MOST, &made);
            if (round < 50)
                continue;
            num_over += ns > 1.25 * BUDGET_NS;
            sum_ns += ns;
        }
        double mean_ns = sum_ns / (num_rounds - 50);
        if (num_over > num_rounds / 100 || mean_ns < 0.8 * BUDGET_NS || mean_ns > 1.05 * BUDGET_NS)
            fail_msg("device %zu: %d rounds over, mean %g ns", i, num_over, mean_ns);
    }
}

/* Without tiles to make, bricks get nearly all of the time. */
static void test_bricks_get_what_tiles_leave(void **state)
{
    (void)state;
    const device d = {50e3, 100e3, 0, 0};
    karst_cost cost;
    karst_cost_limits made;
    karst_cost_init(&cost);
    for (int round = 0; round < 60; round++)
        run(&d, &cost, BUDGET_NS, MOST, 100, &made);
    assert_true(made.max_tiles * d.tile_ns > 0.25 * BUDGET_NS);
    double last_ns = 0;
    for (int round = 0; round < 60; round++)
        last_ns = run(&d, &cost, BUDGET_NS, MOST, 0, &made);
    assert_int_equal(made.max_tiles, 0);
    assert_true(last_ns > 0.85 * BUDGET_NS);
    /* And tiles come back within few rounds. */
    for (int round = 0; round < 5; round++)
        run(&d, &cost, BUDGET_NS, MOST, 100, &made);
    assert_true(made.max_tiles >= 20);
}

/* A world that becomes four times as dear is noticed after three rounds, one that becomes cheap after six. */
static void test_estimates_follow(void **state)
{
    (void)state;
    device d = {50e3, 20e3, 0, 0};
    karst_cost cost;
    karst_cost_limits made;
    karst_cost_init(&cost);
    for (int round = 0; round < 50; round++)
        run(&d, &cost, BUDGET_NS, MOST, MOST, &made);
    assert_true(fabs(cost.bricks.expected_ns - 50e3) < 500);
    d.brick_ns = 200e3;
    for (int round = 0; round < 3; round++)
        assert_true(run(&d, &cost, BUDGET_NS, MOST, MOST, &made) > 1.5 * BUDGET_NS);
    assert_true(fabs(cost.bricks.expected_ns - 200e3) < 2e3);
    assert_true(run(&d, &cost, BUDGET_NS, MOST, MOST, &made) < 1.02 * BUDGET_NS);
    for (int round = 0; round < 10; round++)
        run(&d, &cost, BUDGET_NS, MOST, MOST, &made);
    d.brick_ns = 50e3;
    for (int round = 0; round < 6; round++) {
        assert_true(cost.bricks.expected_ns > 190e3);
        run(&d, &cost, BUDGET_NS, MOST, MOST, &made);
    }
    assert_true(cost.bricks.expected_ns < 51e3);
}

/* One round in five that takes five times as long, since the machine did something else, neither starves the rounds
 * after it nor stops the budget from being used. */
static void test_disturbances_are_borne(void **state)
{
    (void)state;
    device d = {50e3, 20e3, 10e3, 0};
    karst_cost cost;
    karst_cost_limits made;
    karst_cost_init(&cost);
    double sum_ns = 0;
    int num_over = 0, num = 0;
    for (int round = 0; round < 500; round++) {
        bool disturbed = round % 5 == 4;
        d.brick_ns = disturbed ? 250e3 : 50e3;
        double ns = run(&d, &cost, BUDGET_NS, MOST, MOST, &made);
        if (round < 20 || disturbed)
            continue;
        sum_ns += ns;
        num_over += ns > 1.05 * BUDGET_NS;
        num++;
    }
    assert_true(num_over < num / 100);
    assert_true(sum_ns / num > 0.9 * BUDGET_NS);
}

/* However small the budget and dear the world, something is made; whatever is measured, limits are sane. */
static void test_production_never_stops(void **state)
{
    (void)state;
    const device d = {1e9, 1e9, 0, 0};
    karst_cost cost;
    karst_cost_limits made;
    karst_cost_init(&cost);
    for (int round = 0; round < 20; round++) {
        run(&d, &cost, 1, MOST, MOST, &made);
        assert_true(made.max_bricks >= 1 && made.max_tiles >= 1);
    }
    karst_cost_init(&cost);
    assert_int_equal(karst_cost_plan(&cost, BUDGET_NS, MOST).max_bricks, KARST_COST_FIRST);
    assert_int_equal(karst_cost_plan(&cost, BUDGET_NS, 3).max_bricks, 3);
    const karst_cost_round odd[] = {
        {0, 0, 0, 0, 0, 0},       {5, 5, 0, 0, 5, 0},
        {0, 0, 1000, 1000, 0, 9}, {UINT32_MAX, UINT32_MAX, 1, UINT64_MAX, UINT32_MAX, UINT64_MAX},
        {1, 1, UINT64_MAX, 1, 1, 1}};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        karst_cost_learn(&cost, &odd[i]);
        karst_cost_limits limits = karst_cost_plan(&cost, BUDGET_NS, MOST);
        assert_true(limits.max_bricks >= 1 && limits.max_bricks <= MOST && limits.max_tiles >= 1 &&
                    limits.max_tiles <= MOST);
    }
}

/* Scouts' rays are paid for too, and a frame without any tells nothing of them. */
static void test_scouts_are_paid_for(void **state)
{
    (void)state;
    karst_cost cost;
    karst_cost_init(&cost);
    for (int i = 0; i < 20; i++) {
        karst_cost_round round = {.num_bricks = 100, .num_tiles = 30, .brick_ns = 5000000, .tile_ns = 600000};
        if (i % 2) {
            round.num_scout_rays = 2000;
            round.scout_ns = 1000000 + 100000 * (uint64_t)(i % 4);
        }
        karst_cost_learn(&cost, &round);
        assert_true((cost.scout_rays.expected_ns > 0) == (i > 0));
    }
    assert_true(cost.scout_rays.expected_ns >= 500 && cost.scout_rays.expected_ns <= 650);
    assert_true(cost.bricks.expected_ns == 50000 && cost.tiles.expected_ns == 20000);
    cost.fixed = true;
    karst_cost_round dear = {.num_scout_rays = 2000, .scout_ns = 100000000};
    for (int i = 0; i < 20; i++)
        karst_cost_learn(&cost, &dear);
    assert_true(cost.scout_rays.expected_ns <= 650);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_budget_is_met_and_used), cmocka_unit_test(test_bricks_get_what_tiles_leave),
        cmocka_unit_test(test_estimates_follow),           cmocka_unit_test(test_disturbances_are_borne),
        cmocka_unit_test(test_production_never_stops),     cmocka_unit_test(test_scouts_are_paid_for),
    };
    return cmocka_run_group_tests_name("cost", tests, NULL, NULL);
}
