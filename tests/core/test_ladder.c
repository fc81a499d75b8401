/* The detail ladder against a model of a view: rung r needs first_need * 2^(-r/2) slots, reached over some frames of
 * production. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "core/engine/ladder.h"

typedef struct {
    double first_need; /* slots of rung 0 */
    uint64_t num_total;
    uint64_t num_held; /* of what the current rung needs */
} model;

static uint64_t need_of(const model *m, int rung) { return (uint64_t)ceil(m->first_need * exp2(-rung / 2.0)); }

/* One frame: produce up to 200 of what is missing; starved where the pool is full. */
static bool frame(model *m, karst_ladder *ladder)
{
    uint64_t need = need_of(m, ladder->rung);
    if (m->num_held > need)
        m->num_held = need;
    uint64_t missing = need - m->num_held;
    uint64_t wants = missing < 200 ? missing : 200;
    uint64_t room = m->num_total - m->num_held;
    uint64_t produced = wants < room ? wants : room;
    m->num_held += produced;
    karst_ladder_round round = {.num_used = m->num_held,
                                .num_total = m->num_total,
                                .num_starved = wants - produced,
                                .num_requests = wants,
                                .num_produced = produced};
    bool moved = karst_ladder_step(ladder, &round);
    return wants == 0 && !moved && karst_ladder_at_rest(ladder);
}

static int finest_that_fits(const model *m)
{
    int rung = 0;
    while (need_of(m, rung) > m->num_total)
        rung++;
    return rung;
}

static void test_ends_on_the_finest_rung_that_fits(void **state)
{
    (void)state;
    for (int start = 0; start < 40; start += 3)
        for (double share = 0.03; share < 3; share *= 1.3) {
            model m = {.first_need = 1000, .num_total = (uint64_t)(1000 * share)};
            karst_ladder ladder;
            karst_ladder_init(&ladder);
            ladder.rung = start;
            int frames = 0;
            while (!frame(&m, &ladder) && frames < 200)
                frames++;
            assert_true(frames < 200);
            assert_int_equal(ladder.rung, finest_that_fits(&m));
            /* At rest it stays at rest. */
            for (int i = 0; i < 50; i++)
                assert_true(frame(&m, &ladder));
        }
}

static void test_a_failed_rung_is_tried_again_only_after_a_change(void **state)
{
    (void)state;
    model m = {.first_need = 1000, .num_total = 400};
    karst_ladder ladder;
    karst_ladder_init(&ladder);
    for (int i = 0; i < 100; i++)
        frame(&m, &ladder);
    int rung = ladder.rung;
    assert_true(rung > 0);
    m.first_need = 10; /* would fit now, but nobody said so */
    for (int i = 0; i < 50; i++)
        frame(&m, &ladder);
    assert_int_equal(ladder.rung, rung);
    karst_ladder_view_changed(&ladder);
    for (int i = 0; i < 50; i++)
        frame(&m, &ladder);
    assert_int_equal(ladder.rung, 0);
}

static void test_the_coarsest_rung_is_the_end(void **state)
{
    (void)state;
    karst_ladder ladder;
    karst_ladder_init(&ladder);
    karst_ladder_round hopeless = {.num_used = 10, .num_total = 10, .num_starved = 5, .num_requests = 5};
    for (int i = 0; i < 1000; i++)
        karst_ladder_step(&ladder, &hopeless);
    assert_int_equal(ladder.rung, KARST_LADDER_RUNGS - 1);
    assert_true(karst_ladder_at_rest(&ladder));
}

static void test_motion_refines_only_with_room_to_spare(void **state)
{
    (void)state;
    karst_ladder ladder;
    karst_ladder_init(&ladder);
    ladder.rung = 8;
    karst_ladder_round tight = {.num_used = 80, .num_total = 100, .num_requests = 3, .num_produced = 3};
    for (int i = 0; i < 100; i++) {
        karst_ladder_view_changed(&ladder);
        karst_ladder_step(&ladder, &tight);
    }
    assert_int_equal(ladder.rung, 8);
    karst_ladder_round roomy = {.num_used = 20, .num_total = 100, .num_requests = 3, .num_produced = 3};
    for (int i = 0; i < 100; i++) {
        karst_ladder_view_changed(&ladder);
        karst_ladder_step(&ladder, &roomy);
    }
    assert_true(ladder.rung < 8);
}

/* Next to a rung that fits, starving wants decide nothing: the verdict does. */
static void test_a_verdict_counts_more_than_starving(void **state)
{
    (void)state;
    const karst_ladder_round starved = {.num_used = 100, .num_total = 100, .num_starved = 5, .num_requests = 5,
                                        .verdict = KARST_LADDER_UNDECIDED};
    const karst_ladder_round settled = {.num_used = 40, .num_total = 100, .verdict = KARST_LADDER_UNDECIDED};
    for (int fits = 0; fits < 2; fits++) {
        karst_ladder ladder;
        karst_ladder_init(&ladder);
        ladder.rung = 3;
        assert_true(karst_ladder_step(&ladder, &settled));
        assert_int_equal(ladder.rung, 2);
        for (int i = 0; i < 40; i++) /* as long as it takes */
            assert_false(karst_ladder_step(&ladder, &starved));
        assert_true(karst_ladder_is_deciding(&ladder));
        assert_false(karst_ladder_at_rest(&ladder));
        karst_ladder_round decided = starved;
        decided.verdict = fits ? KARST_LADDER_FITS : KARST_LADDER_TOO_LARGE;
        assert_true(karst_ladder_step(&ladder, &decided) == !fits);
        assert_false(karst_ladder_is_deciding(&ladder));
        assert_int_equal(ladder.rung, fits ? 2 : 3);
        assert_int_equal(ladder.failed, fits ? -1 : 2);
        assert_true(karst_ladder_step(&ladder, &settled) == fits);
        assert_int_equal(ladder.rung, fits ? 1 : 3);
    }
}

/* A verdict is of rays that do not scatter: where others are stuck all the same it was wrong; it is not asked again. */
static void test_a_rung_that_is_stuck_after_a_verdict_fails(void **state)
{
    (void)state;
    const karst_ladder_round starved = {.num_used = 90, .num_total = 100, .num_starved = 50, .num_requests = 50,
                                        .verdict = KARST_LADDER_FITS};
    const karst_ladder_round settled = {.num_used = 40, .num_total = 100};
    karst_ladder ladder;
    karst_ladder_init(&ladder);
    ladder.rung = 3;
    ladder.fitted = 4;
    int steps = 0;
    while (ladder.rung == 3 && steps < 100)
        karst_ladder_step(&ladder, &starved), steps++;
    assert_int_equal(steps, 3); /* stuck, the verdict, stuck */
    assert_int_equal(ladder.rung, 4);
    assert_int_equal(ladder.failed, 3);
    assert_false(karst_ladder_step(&ladder, &settled));
    assert_true(karst_ladder_at_rest(&ladder));
    /* Another view knows nothing of it. */
    karst_ladder_view_changed(&ladder);
    karst_ladder_step(&ladder, &settled);
    assert_int_equal(ladder.rung, 3);
}

/* A guess in motion, or far from what fits, proves nothing; a picture that takes more than it may does. */
static void test_what_proves_that_a_rung_fails(void **state)
{
    (void)state;
    const karst_ladder_round hopeless = {.num_used = 100, .num_total = 100, .num_starved = 500, .num_requests = 500};
    karst_ladder ladder;
    karst_ladder_init(&ladder);
    assert_true(karst_ladder_step(&ladder, &hopeless));
    assert_true(ladder.rung > 1 && ladder.failed == -1);
    karst_ladder_init(&ladder);
    karst_ladder_view_changed(&ladder);
    const karst_ladder_round close = {.num_used = 100, .num_total = 100, .num_starved = 1, .num_requests = 1};
    assert_true(karst_ladder_step(&ladder, &close));
    assert_int_equal(ladder.failed, -1);
    karst_ladder_init(&ladder);
    const karst_ladder_round too_much = {.num_used = 100, .num_total = 99};
    assert_true(karst_ladder_step(&ladder, &too_much));
    assert_int_equal(ladder.rung, 1);
    assert_int_equal(ladder.failed, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ends_on_the_finest_rung_that_fits),
        cmocka_unit_test(test_a_failed_rung_is_tried_again_only_after_a_change),
        cmocka_unit_test(test_the_coarsest_rung_is_the_end),
        cmocka_unit_test(test_a_verdict_counts_more_than_starving),
        cmocka_unit_test(test_a_rung_that_is_stuck_after_a_verdict_fails),
        cmocka_unit_test(test_what_proves_that_a_rung_fails),
        cmocka_unit_test(test_motion_refines_only_with_room_to_spare),
    };
    return cmocka_run_group_tests_name("ladder", tests, NULL, NULL);
}
