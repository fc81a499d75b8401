/* The bounds of the world 'hills'. */
#define WORLD_SOURCE "producers/worlds/hills.clh"
#include "tests/noise/world_bounds.h"

static void hills_surface(int64_t voxel[3])
{
    int64_t low = -16384, high = 16384; /* 1 km below and above sea level */
    while (high - low > 1) {
        voxel[1] = (low + high) / 2;
        if (density_at(voxel, NULL, -1) > 0)
            low = voxel[1];
        else
            high = voxel[1];
    }
}

static void test_each_rule_is_needed(void **state)
{
    (void)state;
    static const enum mutant mutants[] = {MUTANT_STRATA, MUTANT_PARTS};
    assert_mutants_escape(mutants, sizeof mutants / sizeof *mutants);
}

static void test_tightness(void **state)
{
    (void)state;
    test_bounds_are_tight(0.9);
}

static void test_sky_and_depths_are_decided_at_once(void **state)
{
    (void)state;
    /* above 1200 m and below -1200 m nothing is left to chance; the highest nodes that fit there, too */
    for (int level = 0; level < 40; level++) {
        int64_t side = INT64_C(16) << level, far = (19200 + side - 1) & -side;
        assert_decided(1000000000, far, -77, level, false);
        assert_decided(5, -far - side, 1000000000000000, level, true);
    }
}

int main(void)
{
    world_surface = hills_surface;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bounds_hold_the_density),
        cmocka_unit_test(test_each_rule_is_needed),
        cmocka_unit_test(test_slack_holds_what_fades),
        cmocka_unit_test(test_tightness),
        cmocka_unit_test(test_sky_and_depths_are_decided_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
