/* Blocks in turns: each is taken, worked on and put exactly once, and put in order, however many threads there are and
 * however long each takes; whatever fails ends the loop with its message, and nobody waits for ever. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/points/import_internal.h"
#include "tests/support/ok.h"

#define NUM_BLOCKS 300u
#define BLOCK 7u
#define NUM (NUM_BLOCKS * BLOCK - 3)
#define NOWHERE UINT32_MAX

typedef struct {
    bool takes; /* blocks come from `take` */
    uint32_t fails_at_take, fails_at_work, fails_at_put;
    uint32_t num_taken, num_put;
    atomic_uint num_wrong, num_worked, num_cleared, is_putting, is_taking;
    int calls_left; /* of progress; then it says no */
} course;

typedef struct {
    uint64_t begin; /* what was worked on */
    course *of;
} course_slot;

static void wait_some(uint64_t of)
{
    const struct timespec some = {0, (long)(of * 2654435761u >> 7 & 0xffff)};
    nanosleep(&some, NULL);
}

static bool take(void *user, points_block *block, double *share, bool *any, karst_error *error)
{
    course *c = user;
    c->num_wrong += atomic_fetch_add(&c->is_taking, 1) != 0;
    block->begin = c->num_taken * BLOCK;
    block->end = block->begin + BLOCK < NUM ? block->begin + BLOCK : NUM;
    *any = c->num_taken < NUM_BLOCKS;
    *share = 0;
    const bool fails = c->num_taken == c->fails_at_take;
    c->num_taken += *any;
    atomic_fetch_sub(&c->is_taking, 1);
    return !fails || karst_fail(error, KARST_BAD_DATA, "nothing to take");
}

static bool work(void *user, points_block *block, karst_error *error)
{
    course *c = user;
    course_slot *slot = block->slot;
    slot->begin = block->begin;
    slot->of = c;
    atomic_fetch_add(&c->num_worked, 1);
    wait_some(block->begin);
    return block->begin / BLOCK != c->fails_at_work || karst_fail(error, KARST_FAILED, "no work");
}

/* Only one may be here, and that in its turn. */
static bool put(void *user, points_block *block, karst_error *error)
{
    course *c = user;
    const course_slot *slot = block->slot;
    c->num_wrong += atomic_fetch_add(&c->is_putting, 1) != 0;
    c->num_wrong += slot->begin != c->num_put * BLOCK || block->begin != slot->begin;
    c->num_wrong += block->end != (slot->begin + BLOCK < NUM ? slot->begin + BLOCK : NUM);
    wait_some(block->begin + 1);
    const bool fails = c->num_put == c->fails_at_put;
    c->num_put++;
    atomic_fetch_sub(&c->is_putting, 1);
    return !fails || karst_fail(error, KARST_USAGE, "nowhere to put it");
}

static void clear(void *user)
{
    course_slot *slot = user;
    if (slot->of)
        atomic_fetch_add(&slot->of->num_cleared, 1);
}

static bool go_on(void *user, const char *what, double share)
{
    course *c = user;
    assert_string_equal(what, "testing");
    assert_true(share >= 0 && share <= 1);
    return c->calls_left-- > 0;
}

static course anew(void)
{
    return (course){.fails_at_take = NOWHERE, .fails_at_work = NOWHERE, .fails_at_put = NOWHERE, .calls_left = 1 << 20};
}

static bool run(course *c, uint32_t num_threads, uint32_t most_threads, karst_error *error)
{
    const karst_points_import_config config = {
        .output = "out", .num_threads = num_threads, .progress = go_on, .user = c};
    points_import import = {.config = &config};
    const points_turns turns = {.loop = {"testing", 0, NUM, NUM, BLOCK, false},
                                .most_threads = most_threads,
                                .slot_bytes = sizeof(course_slot),
                                .clear = clear,
                                .take = c->takes ? take : NULL,
                                .work = work,
                                .put = put};
    return karst_points_in_turns(&import, &turns, c, error);
}

static void all_are_put_in_order(void **state)
{
    (void)state;
    for (uint32_t num_threads = 1; num_threads <= 8; num_threads++)
        for (int takes = 0; takes < 2; takes++) {
            course c = anew();
            c.takes = takes;
            assert_ok(run(&c, num_threads, 0, &error));
            assert_int_equal(c.num_wrong, 0);
            assert_int_equal(c.num_put, NUM_BLOCKS);
            assert_int_equal(c.num_worked, NUM_BLOCKS);
            assert_in_range(c.num_cleared, 1, num_threads);
        }
}

static void threads_have_no_more_slots_than_allowed(void **state)
{
    (void)state;
    course c = anew();
    assert_ok(run(&c, 8, 3, &error));
    assert_int_equal(c.num_put, NUM_BLOCKS);
    assert_in_range(c.num_cleared, 1, 3);
}

static void what_fails_ends_it(void **state)
{
    (void)state;
    const uint32_t blocks[] = {0, 1, 150, NUM_BLOCKS - 1};
    for (uint32_t num_threads = 1; num_threads <= 4; num_threads++)
        for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
            course at_take = anew(), at_work = anew(), at_put = anew();
            karst_error no_take = {0}, no_work = {0}, no_put = {0};
            at_take.takes = true;
            at_take.fails_at_take = at_work.fails_at_work = at_put.fails_at_put = blocks[i];
            assert_false(run(&at_take, num_threads, 0, &no_take));
            assert_false(run(&at_work, num_threads, 0, &no_work));
            assert_false(run(&at_put, num_threads, 0, &no_put));
            assert_int_equal(no_take.status, KARST_BAD_DATA);
            assert_string_equal(no_take.message, "nothing to take");
            assert_int_equal(no_work.status, KARST_FAILED);
            assert_string_equal(no_work.message, "no work");
            assert_int_equal(no_put.status, KARST_USAGE);
            assert_string_equal(no_put.message, "nowhere to put it");
            /* What comes later is not put. */
            assert_true(at_take.num_put <= blocks[i] && at_work.num_put <= blocks[i]);
            assert_int_equal(at_put.num_put, blocks[i] + 1);
            assert_int_equal(at_take.num_wrong + at_work.num_wrong + at_put.num_wrong, 0);
        }
}

static void progress_may_end_it(void **state)
{
    (void)state;
    for (uint32_t num_threads = 1; num_threads <= 4; num_threads++) {
        course c = anew();
        karst_error why = {0};
        c.calls_left = 3;
        assert_false(run(&c, num_threads, 0, &why));
        assert_int_equal(why.status, KARST_FAILED);
        assert_non_null(strstr(why.message, "stopped"));
        assert_int_equal(c.num_wrong, 0);
        assert_true(num_threads > 1 || c.num_put == 3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_are_put_in_order),
        cmocka_unit_test(threads_have_no_more_slots_than_allowed),
        cmocka_unit_test(what_fails_ends_it),
        cmocka_unit_test(progress_may_end_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
