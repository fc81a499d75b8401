/* The bounds of the world 'asteroid'. */
#define WORLD_SOURCE "producers/worlds/asteroid.clh"
#include "tests/noise/world_bounds.h"

static void asteroid_surface(int64_t voxel[3])
{
    /* along the ray from the origin */
    double p[3], length = 0, low = 0, high = 12000;
    for (int a = 0; a < 3; a++) {
        p[a] = (double)voxel[a];
        length += p[a] * p[a];
    }
    length = sqrt(length);
    while (high - low > 0.5) {
        double at = (low + high) / 2;
        for (int a = 0; a < 3; a++)
            voxel[a] = (int64_t)(p[a] * at / length);
        if (density_at(voxel, NULL, -1) > 0)
            low = at;
        else
            high = at;
    }
}

static void test_each_rule_is_needed(void **state)
{
    (void)state;
    static const enum mutant mutants[] = {MUTANT_BULGE, MUTANT_PARTS};
    assert_mutants_escape(mutants, sizeof mutants / sizeof *mutants);
}

static void test_tightness(void **state)
{
    (void)state;
    test_bounds_are_tight(0.9);
}

static void test_space_and_core_are_decided_at_once(void **state)
{
    (void)state;
    for (int level = 0; level < 40; level++) {
        int64_t side = INT64_C(16) << level, far = (12000 + side - 1) & -side;
        assert_decided(far, 0, 0, level, false);
        assert_decided(7, -far - side, far, level, false);
        assert_decided(1000000000000000, 1000000000000000, -1000000000000000, level < 36 ? level : 36, false);
    }
    for (int level = 0; level < 6; level++)
        assert_decided(-1, -1, -1, level, true);
}

int main(void)
{
    world_surface = asteroid_surface;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bounds_hold_the_density),
        cmocka_unit_test(test_each_rule_is_needed),
        cmocka_unit_test(test_slack_holds_what_fades),
        cmocka_unit_test(test_tightness),
        cmocka_unit_test(test_space_and_core_are_decided_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
