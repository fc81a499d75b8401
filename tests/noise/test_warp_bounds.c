/* The world 'hills' with a warp several times as strong, so that the rules for warped boxes carry weight. */
#define HILLS_WARP_M 600.0f

#define WORLD_SOURCE "producers/worlds/hills.clh"
#include "tests/noise/world_bounds.h"

static void warp_surface(int64_t voxel[3]) { voxel[1] = random_between(-4000, 4000); }

static void test_each_rule_is_needed(void **state)
{
    (void)state;
    static const enum mutant mutants[] = {MUTANT_WARP_WIDTH, MUTANT_CHAIN_RULE};
    assert_mutants_escape(mutants, sizeof mutants / sizeof *mutants);
}

int main(void)
{
    world_surface = warp_surface;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bounds_hold_the_density),
        cmocka_unit_test(test_each_rule_is_needed),
        cmocka_unit_test(test_slack_holds_what_fades),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
