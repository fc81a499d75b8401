/* The helper process: claims are shared, each thing is compiled once, and a helper that dies, hangs or loses its parent
 * harms nothing. This program is its own helper; KARST_TEST_HELPER says how that one behaves. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "core/device/helper.h"

#define PARAMETER "relief"
enum { FIRST_KEY = 1000, NUM_KEYS = 40 };

static void pause_ms(long ms)
{
    const struct timespec pause = {ms / 1000, ms % 1000 * 1000000};
    nanosleep(&pause, NULL);
}

/* ---- the helper's side ---- */

/* Claims the last key and never does it; another tells that it has. */
static void claim_last(karst_helper *helper)
{
    if (karst_helper_begin_build(helper, FIRST_KEY + NUM_KEYS - 1) != KARST_CLAIM_MINE)
        _exit(3);
    karst_helper_end_build(helper, 2, karst_helper_begin_build(helper, 2));
}

static int run_as_helper(void)
{
    const char *how = getenv("KARST_TEST_HELPER");
    karst_engine_config config;
    karst_helper *helper = karst_helper_attach(&config);
    if (!helper || karst_helper_is_this_process() || strcmp(config.world, "a world") != 0 || config.device ||
        config.num_parameters != 1 || strcmp(config.parameters[0].name, PARAMETER) != 0 ||
        config.parameters[0].value != 2.5 || config.seed != 7)
        return 2;
    if (strcmp(how, "die") == 0) {
        claim_last(helper);
        kill(getpid(), SIGKILL);
    }
    if (strcmp(how, "hang") == 0) {
        claim_last(helper);
        kill(getpid(), SIGSTOP);
    }
    if (strcmp(how, "wait") == 0) {
        claim_last(helper);
        pause_ms(60000);
    }
    /* "share": from the last key to the first */
    for (uint64_t key = FIRST_KEY + NUM_KEYS; key-- > FIRST_KEY;) {
        karst_claim claim = karst_helper_begin_build(helper, key);
        if (claim == KARST_CLAIM_MINE)
            pause_ms(2);
        karst_helper_end_build(helper, key, claim);
    }
    return 0;
}

/* ---- this side ---- */

static karst_helper *open_helper(const char *how)
{
    const karst_parameter parameter = {PARAMETER, 2.5};
    karst_error error = {0};
    setenv("KARST_TEST_HELPER", how, 1);
    karst_helper *helper = karst_helper_create(&error);
    assert_non_null(helper);
    karst_helper_set_task(
        helper,
        &(karst_engine_config){.world = "a world", .parameters = &parameter, .num_parameters = 1, .seed = 7});
    return helper;
}

static uint64_t now_ms(void) { return karst_clock_ns() / 1000000u; }

/* A build that takes long: the helper starts. */
static void build_slowly(karst_helper *helper)
{
    karst_claim claim = karst_helper_begin_build(helper, 1);
    assert_int_equal(claim, KARST_CLAIM_MINE);
    for (int i = 0; i < 2000 && !karst_helper_was_started(helper); i++)
        pause_ms(5);
    assert_true(karst_helper_was_started(helper));
    karst_helper_end_build(helper, 1, claim);
}

/* What is built in a moment starts nothing. */
static void test_no_need(void **state)
{
    (void)state;
    karst_helper *helper = open_helper("die");
    for (uint64_t key = FIRST_KEY; key < FIRST_KEY + NUM_KEYS; key++)
        karst_helper_end_build(helper, key, karst_helper_begin_build(helper, key));
    pause_ms(300);
    assert_false(karst_helper_was_started(helper));
    assert_false(karst_helper_is_active(helper));
    karst_helper_destroy(helper);
    karst_helper_destroy(NULL);
    assert_int_equal(karst_helper_begin_build(NULL, 1), KARST_CLAIM_NOBODY);
    assert_false(karst_helper_is_active(NULL));
}

/* What cannot be told to another process is done alone. */
static void test_no_task(void **state)
{
    (void)state;
    karst_error error = {0};
    char *world = calloc(1, 5001);
    memset(world, 'w', 5000);
    karst_helper *helper = karst_helper_create(&error);
    karst_helper_set_task(helper, &(karst_engine_config){.world = world});
    assert_int_equal(karst_helper_begin_build(helper, 1), KARST_CLAIM_NOBODY);
    pause_ms(300);
    assert_false(karst_helper_was_started(helper));
    karst_helper_end_build(helper, 1, KARST_CLAIM_NOBODY);
    karst_helper_destroy(helper);
    free(world);
}

/* From both ends: each key is done by one of the two, and what this side finds done was done by the other. */
static void test_share(void **state)
{
    (void)state;
    karst_helper *helper = open_helper("share");
    build_slowly(helper);
    uint32_t num_mine = 0, num_theirs = 0;
    for (uint64_t key = FIRST_KEY; key < FIRST_KEY + NUM_KEYS; key++) {
        karst_claim claim = karst_helper_begin_build(helper, key);
        if (claim == KARST_CLAIM_MINE)
            pause_ms(5);
        num_mine += claim == KARST_CLAIM_MINE;
        num_theirs += claim == KARST_CLAIM_DONE;
        karst_helper_end_build(helper, key, claim);
    }
    print_message("%u claims here, %u there\n", num_mine, num_theirs);
    assert_int_equal(num_mine + num_theirs, NUM_KEYS);
    assert_true(num_theirs > 0);
    assert_int_equal(karst_helper_count_done(helper), num_theirs);
    karst_helper_destroy(helper);
}

/* A variable that somebody has set makes no process a helper, and the helper still finds its own. */
static void test_variable_of_others(void **state)
{
    (void)state;
    const char *const values[] = {"", "1", "0:1", "3:1", "-1:1", "999999:1"};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        setenv("KARST_HELPER", values[i], 1);
        assert_false(karst_helper_is_this_process());
    }
    test_share(state);
    unsetenv("KARST_HELPER");
}

/* What it did before it ended is not done again, however late this side comes to it. */
static void test_late(void **state)
{
    (void)state;
    karst_helper *helper = open_helper("share");
    build_slowly(helper);
    for (int i = 0; i < 4000 && karst_helper_is_active(helper); i++)
        pause_ms(5);
    assert_false(karst_helper_is_active(helper));
    for (uint64_t key = FIRST_KEY; key < FIRST_KEY + NUM_KEYS; key++) {
        karst_claim claim = karst_helper_begin_build(helper, key);
        assert_int_equal(claim, KARST_CLAIM_DONE);
        karst_helper_end_build(helper, key, claim);
    }
    assert_int_equal(karst_helper_begin_build(helper, 2), KARST_CLAIM_MINE);
    karst_helper_destroy(helper);
}

/* What a helper claimed and left undone is given back, sooner or later. */
static void leave_undone(const char *how, uint64_t least_ms, uint64_t most_ms)
{
    karst_helper *helper = open_helper(how);
    build_slowly(helper);
    for (int i = 0; i < 4000 && !karst_helper_count_done(helper); i++)
        pause_ms(5);
    uint64_t start_ms = now_ms();
    karst_claim claim = karst_helper_begin_build(helper, FIRST_KEY + NUM_KEYS - 1);
    uint64_t waited_ms = now_ms() - start_ms;
    karst_helper_end_build(helper, FIRST_KEY + NUM_KEYS - 1, claim);
    print_message("%s: gave up after %llu ms\n", how, (unsigned long long)waited_ms);
    assert_int_equal(claim, KARST_CLAIM_NOBODY);
    assert_true(waited_ms >= least_ms && waited_ms <= most_ms);
    for (int i = 0; i < 2000 && karst_helper_is_active(helper); i++)
        pause_ms(5);
    assert_false(karst_helper_is_active(helper)); /* nobody waits for it again */
    assert_int_equal(karst_helper_count_done(helper), 1);
    karst_helper_destroy(helper);
}

static void test_die(void **state)
{
    (void)state;
    leave_undone("die", 0, 3000);
}

static void test_hang(void **state)
{
    (void)state;
    leave_undone("hang", 2000, 30000);
}

/* Destroying ends it at once. */
static void test_end(void **state)
{
    (void)state;
    karst_helper *helper = open_helper("wait");
    build_slowly(helper);
    uint64_t start_ms = now_ms();
    karst_helper_destroy(helper);
    assert_true(now_ms() - start_ms < 10000);
    assert_true(waitpid(-1, NULL, WNOHANG) < 0 && errno == ECHILD);
}

/* It ends with the process that started it, even if that is killed. */
static void test_parent_killed(void **state)
{
    (void)state;
    int fds[2];
    assert_int_equal(pipe(fds), 0);
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        setsid(); /* so that both are found by their group */
        karst_helper *helper = open_helper("wait");
        build_slowly(helper);
        (void)!write(fds[1], "x", 1);
        pause_ms(60000);
        _exit(0);
    }
    char byte;
    assert_int_equal(read(fds[0], &byte, 1), 1);
    assert_int_equal(kill(-child, 0), 0);
    kill(child, SIGKILL);
    assert_int_equal(waitpid(child, NULL, 0), child);
    bool gone = false;
    for (int i = 0; i < 2000 && !gone; i++, pause_ms(5))
        gone = kill(-child, 0) != 0 && errno == ESRCH;
    assert_true(gone);
    close(fds[0]);
    close(fds[1]);
}

int main(void)
{
    if (karst_helper_is_this_process())
        return run_as_helper();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_need), cmocka_unit_test(test_no_task), cmocka_unit_test(test_share),
        cmocka_unit_test(test_late),    cmocka_unit_test(test_die),     cmocka_unit_test(test_hang),
        cmocka_unit_test(test_end),     cmocka_unit_test(test_parent_killed),
        cmocka_unit_test(test_variable_of_others),
    };
    return cmocka_run_group_tests_name("helper process", tests, NULL, NULL);
}
