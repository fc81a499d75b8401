/* What is measured of an engine, where its sun stands, and what a program says to its driver. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/ok.h"

enum { WIDTH = 64, HEIGHT = 48 };

static karst_engine *engine;

static int set_up(void **state)
{
    (void)state;
    karst_error error = {0};
    const karst_engine_config config = {.world = "hills",
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)64 << 20};
    engine = karst_engine_create(&config, &error);
    if (!engine)
        fprintf(stderr, "%s\n", error.message);
    return engine ? 0 : 1;
}

static int tear_down(void **state)
{
    (void)state;
    karst_engine_destroy(engine);
    return 0;
}

static void settle(void)
{
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
}

static void read_pixels(uint8_t *rgba)
{
    assert_ok(karst_engine_read_pixels(engine, rgba, 4 * WIDTH * HEIGHT, &error));
}

static void test_bricks_that_rays_end_in(void **state)
{
    (void)state;
    karst_stats stats;
    uint64_t num = 0;
    settle();
    karst_engine_stats(engine, &stats);
    assert_ok(karst_engine_count_hit_bricks(engine, &num, &error));
    assert_true(num > 10 && num <= stats.bricks.num_used);
    assert_int_equal(karst_brick_num_samples(), 17 * 17 * 17);
}

static void test_spans(void **state)
{
    (void)state;
    static karst_span spans[4096];
    assert_ok(karst_engine_set_tracing(engine, true, &error));
    const uint64_t before = karst_clock();
    assert_ok(karst_engine_frame(engine, &error));
    const uint64_t after = karst_clock();
    const size_t num = karst_engine_spans(engine, spans, sizeof spans / sizeof *spans);
    assert_true(num > 2 && num < sizeof spans / sizeof *spans && after > before);
    bool is_cast = false;
    for (size_t i = 0; i < num; i++) {
        assert_true(spans[i].start_ns <= spans[i].end_ns && spans[i].track < KARST_NUM_TRACKS);
        assert_true(spans[i].end_ns <= after + 1000000 && spans[i].name[0]);
        is_cast = is_cast || spans[i].stage == KARST_STAGE_CAST;
    }
    assert_true(is_cast);
    assert_int_equal(karst_engine_spans(engine, spans, 1), num);
    assert_ok(karst_engine_set_tracing(engine, false, &error));
    assert_ok(karst_engine_frame(engine, &error));
    assert_int_equal(karst_engine_spans(engine, spans, sizeof spans / sizeof *spans), 0);
}

static void test_ceilings(void **state)
{
    (void)state;
    karst_error why = {0};
    karst_ceilings ceilings = {0};
    karst_measure_destroy(NULL);
    karst_measure *measure = karst_measure_create(engine, &why);
    if (!measure)
        fail_msg("%s", why.message);
    assert_ok(karst_measure_floor(measure, &ceilings, &error));
    assert_true(ceilings.floor_ns > 0);
    assert_true(karst_measure_num_cores(measure) > 0);
    if (!getenv("KARST_TEST_QUICK")) {
        assert_ok(karst_measure_ceilings(measure, &ceilings, &error));
        assert_true(ceilings.fma_per_s > 1e6 && ceilings.bytes_per_s > 1e6 && ceilings.noise_per_s > 1e3);
    }
    karst_measure_destroy(measure);
}

static void test_sun(void **state)
{
    (void)state;
    static uint8_t usual[4 * WIDTH * HEIGHT], low[4 * WIDTH * HEIGHT], again[4 * WIDTH * HEIGHT];
    const karst_sun own = karst_engine_get_sun(engine), other = {300, 8};
    assert_false(karst_engine_has_own_sun(engine));
    settle();
    read_pixels(usual);
    assert_ok(karst_engine_set_sun(engine, &other, &error));
    assert_true(karst_engine_has_own_sun(engine));
    assert_true(karst_engine_get_sun(engine).elevation_deg == 8);
    settle();
    read_pixels(low);
    assert_memory_not_equal(usual, low, sizeof usual);
    const karst_sun bad[] = {{36001, 0},       {-36001, 0},          {0, 90.5}, {0, -91}, {(double)NAN, 0},
                             {0, (double)NAN}, {(double)INFINITY, 0}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        karst_error error = {0};
        assert_false(karst_engine_set_sun(engine, &bad[i], &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    assert_true(karst_engine_get_sun(engine).elevation_deg == 8);
    assert_ok(karst_engine_set_sun(engine, NULL, &error));
    assert_false(karst_engine_has_own_sun(engine));
    assert_true(karst_engine_get_sun(engine).azimuth_deg == own.azimuth_deg);
    settle();
    read_pixels(again);
    assert_memory_equal(usual, again, sizeof usual);
}

/* A world that is made ready and not taken leaves nothing. */
static void test_prepared_worlds(void **state)
{
    (void)state;
    static uint8_t before[4 * WIDTH * HEIGHT], after[4 * WIDTH * HEIGHT];
    karst_error error = {0};
    settle();
    read_pixels(before);
    karst_engine_load_compiler(engine);
    const karst_world_config good = {.world = "asteroid"}, bad = {.world = "nowhere"};
    karst_prepared_world_destroy(karst_engine_prepare_world(engine, &good, &error));
    assert_int_equal(error.status, KARST_OK);
    karst_prepared_world_destroy(NULL);
    assert_null(karst_engine_prepare_world(engine, &bad, &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    settle();
    read_pixels(after);
    assert_memory_equal(before, after, sizeof before);
}

/* In processes of their own, as each may have but one store: a run that ends well leaves its folder to the next, one
 * that dies does not. */
static void begin_in(const char *folder, bool ends, char *store, size_t size_bytes)
{
    int ends_of_pipe[2];
    assert_int_equal(pipe(ends_of_pipe), 0);
    const pid_t child = fork();
    if (child == 0) {
        unsetenv("POCL_CACHE_DIR");
        setenv("KARST_CACHE_DIR", folder, 1);
        karst_driver_begin(NULL);
        karst_driver_begin(NULL);
        if (ends)
            karst_driver_end();
        const char *chosen = getenv("POCL_CACHE_DIR");
        const bool written = chosen && write(ends_of_pipe[1], chosen, strlen(chosen)) == (ssize_t)strlen(chosen);
        _exit(written && !karst_driver_is_suspect() ? 0 : 1);
    }
    close(ends_of_pipe[1]);
    ssize_t length = read(ends_of_pipe[0], store, size_bytes - 1);
    close(ends_of_pipe[0]);
    store[length > 0 ? length : 0] = '\0';
    int status = -1;
    waitpid(child, &status, 0);
    assert_int_equal(status, 0);
}

static void test_driver(void **state)
{
    (void)state;
    char folder[] = "/tmp/karst-driver-XXXXXX", first[4096], second[4096], third[4096], command[64];
    assert_non_null(mkdtemp(folder));
    begin_in(folder, true, first, sizeof first);
    assert_memory_equal(first, folder, strlen(folder));
    begin_in(folder, false, second, sizeof second);
    assert_string_equal(first, second);
    begin_in(folder, true, third, sizeof third);
    assert_string_not_equal(first, third);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    assert_int_equal(system(command), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_driver), cmocka_unit_test(test_bricks_that_rays_end_in),
                                       cmocka_unit_test(test_spans),  cmocka_unit_test(test_ceilings),
                                       cmocka_unit_test(test_sun),    cmocka_unit_test(test_prepared_worlds)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
