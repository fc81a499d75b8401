/* A picture drawn in bands by one engine, and one whose samples are taken in two goes, are those drawn at once: light,
 * all that is known of pixels, and bytes by an exposure that follows the whole. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/ok.h"

enum { WIDTH = 75, HEIGHT = 53, NUM = WIDTH * HEIGHT, MARGIN = KARST_ENGINE_WINDOW_MARGIN_PX };

/* Mirrors look at pixels beside them; fog is laid before land, and its depths are sums whose lanes wait for others. */
typedef struct {
    const char *name, *world;
    double mirror, detail_px;
    uint32_t samples;
    bool occlusion;
} way;
static const way ways[] = {{"mirrors", "hills", 0.5, 2, 2, true}, {"fog", "fog", 0, 1, 16, false}};

typedef struct {
    uint8_t rgba[NUM * 4];
    float aovs[KARST_NUM_AOVS][NUM * 3];
} picture;
static picture whole, bands;
static bool has_occlusion; /* of the engine made last */

static karst_engine *create(const way *w)
{
    karst_error error = {0};
    const karst_engine_config config = {.world = w->world,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)96 << 20,
                                        .detail_px = w->detail_px,
                                        .view_distance_m = w->detail_px > 1 ? 2000 : 0,
                                        .samples = w->samples,
                                        .occlusion = w->occlusion ? KARST_OCCLUSION_ON : KARST_OCCLUSION_OFF,
                                        .mirror = w->mirror,
                                        .tone = KARST_TONE_OF_FILM,
                                        .exposure = KARST_EXPOSURE_OF_PICTURE};
    has_occlusion = w->occlusion;
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static void settle(karst_engine *engine)
{
    karst_stats stats;
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &stats);
    assert_true(settled && stats.detail_given_px == stats.detail_asked_px);
}

static void read_aovs(karst_engine *engine, size_t num, float aovs[KARST_NUM_AOVS][NUM * 3])
{
    for (int i = 0; i < KARST_NUM_AOVS; i++)
        if (i != KARST_AOV_OPENNESS && (i != KARST_AOV_OCCLUSION || has_occlusion)) /* that: test_occlusion.c */
            assert_ok(karst_engine_read_aov(engine, (karst_aov)i, aovs[i], num * (size_t)karst_aov_width((karst_aov)i),
                                            &error));
}

static void draw_whole(karst_engine *engine)
{
    settle(engine);
    assert_ok(karst_engine_read_pixels(engine, whole.rgba, sizeof whole.rgba, &error));
    read_aovs(engine, NUM, whole.aovs);
}

/* Rows of the whole, from windows of `rows` rows and a margin. */
static void draw_bands(karst_engine *engine, int rows)
{
    static float part[KARST_NUM_AOVS][NUM * 3];
    for (int y = 0; y < HEIGHT; y += rows) {
        const int high = HEIGHT - y < rows ? HEIGHT - y : rows;
        const int from = y < MARGIN ? 0 : y - MARGIN, end = y + high + MARGIN < HEIGHT ? y + high + MARGIN : HEIGHT;
        const karst_engine_window window = {WIDTH, HEIGHT, 0, from};
        assert_ok(karst_engine_set_window(engine, &window, WIDTH, end - from, &error));
        settle(engine);
        read_aovs(engine, (size_t)(end - from) * WIDTH, part);
        for (int i = 0; i < KARST_NUM_AOVS; i++) {
            const size_t width = (size_t)karst_aov_width((karst_aov)i) * WIDTH;
            memcpy(bands.aovs[i] + (size_t)y * width, part[i] + (size_t)(y - from) * width,
                   (size_t)high * width * sizeof(float));
        }
    }
    /* By other parts than it was drawn in, which find room in the last of those. */
    const float *light = bands.aovs[KARST_AOV_RADIANCE];
    const int least = 5;
    for (int y = 0; y < HEIGHT; y += least) {
        const int high = HEIGHT - y < least ? HEIGHT - y : least;
        assert_ok(karst_engine_meter(engine, light + (size_t)y * WIDTH * 3, WIDTH, high, &error));
    }
    for (int y = 0; y < HEIGHT; y += least) {
        const int high = HEIGHT - y < least ? HEIGHT - y : least;
        assert_ok(karst_engine_tone(engine, light + (size_t)y * WIDTH * 3, 0, y, WIDTH, high,
                                    bands.rgba + (size_t)y * WIDTH * 4, &error));
    }
}

static void compare(const char *name, int rows)
{
    for (int i = 0; i < KARST_NUM_AOVS; i++)
        if (i != KARST_AOV_OPENNESS && (i != KARST_AOV_OCCLUSION || has_occlusion) &&
            memcmp(whole.aovs[i], bands.aovs[i], NUM * (size_t)karst_aov_width((karst_aov)i) * sizeof(float)) != 0)
            fail_msg("%s, by %d rows: %s differs", name, rows, karst_aov_channel((karst_aov)i, 0));
    if (memcmp(whole.rgba, bands.rgba, sizeof whole.rgba) != 0)
        fail_msg("%s, by %d rows: bytes differ", name, rows);
}

static void test_bands_are_the_whole(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof ways / sizeof *ways; k++) {
        karst_engine *engine = create(&ways[k]);
        draw_whole(engine);
        const int rows[] = {16, 37};
        for (size_t i = 0; i < (getenv("KARST_TEST_QUICK") ? 1 : sizeof rows / sizeof *rows); i++) {
            draw_bands(engine, rows[i]);
            compare(ways[k].name, rows[i]);
        }
        /* And the whole again, by the same engine. */
        const karst_engine_window none = {0};
        const uint32_t again = 3 * NUM;
        static float light[NUM * 3];
        assert_ok(karst_engine_set_window(engine, &none, WIDTH, HEIGHT, &error));
        settle(engine);
        assert_ok(karst_engine_read_radiance(engine, light, again, &error));
        assert_memory_equal(light, whole.aovs[KARST_AOV_RADIANCE], sizeof light);
        karst_engine_destroy(engine);
    }
}

/* Seven samples, or the sums of three and then four more: 1/7 is no float, so means would not do. */
static void test_samples_in_two_goes_are_those_of_one(void **state)
{
    (void)state;
    way w = {"two goes", "hills", 0, 2, 7, false};
    static float sums[NUM * 3];
    karst_engine *one = create(&w);
    draw_whole(one);
    w.samples = 3;
    karst_engine *first = create(&w);
    settle(first);
    assert_ok(karst_engine_read_aov(first, KARST_AOV_SUMS, sums, 3 * NUM, &error));
    karst_engine_destroy(first);
    w.samples = 7;
    karst_engine *second = create(&w);
    assert_ok(karst_engine_set_sums(second, sums, 3 * NUM, 3, &error));
    settle(second);
    assert_ok(karst_engine_read_pixels(second, bands.rgba, sizeof bands.rgba, &error));
    read_aovs(second, NUM, bands.aovs);
    compare("two goes", HEIGHT);
    /* Of another view they are nothing. */
    const karst_sun sun = {40, 30};
    assert_ok(karst_engine_set_sums(second, sums, 3 * NUM, 3, &error));
    settle(second);
    assert_ok(karst_engine_set_sun(second, &sun, &error));
    settle(second);
    assert_ok(karst_engine_set_sun(one, &sun, &error));
    settle(one);
    assert_ok(karst_engine_read_aov(one, KARST_AOV_SUMS, whole.aovs[0], 3 * NUM, &error));
    assert_ok(karst_engine_read_aov(second, KARST_AOV_SUMS, bands.aovs[0], 3 * NUM, &error));
    assert_memory_equal(whole.aovs[0], bands.aovs[0], sizeof sums);
    karst_engine_destroy(second);
    karst_engine_destroy(one);
}

static void test_what_is_wrong_is_refused(void **state)
{
    (void)state;
    static float light[NUM * 3 + 3];
    static uint8_t rgba[NUM * 4];
    karst_engine *engine = create(&ways[1]);
    struct {
        bool done;
        karst_error error;
    } tries[8] = {0};
    const karst_engine_window beyond = {WIDTH, HEIGHT, 0, 40};
    int num = 0;
#define TRY(call) tries[num].done = call, num++
    TRY(karst_engine_set_window(engine, &beyond, WIDTH, 20, &tries[num].error));
    TRY(karst_engine_set_window(engine, &beyond, 0, 2, &tries[num].error));
    TRY(karst_engine_set_sums(engine, light, 3 * NUM + 3, 1, &tries[num].error));
    TRY(karst_engine_set_sums(engine, light, 3 * NUM, 0, &tries[num].error));
    TRY(karst_engine_set_sums(engine, light, 3 * NUM, 16, &tries[num].error));
    TRY(karst_engine_meter(engine, light, WIDTH, HEIGHT + 1, &tries[num].error));
    TRY(karst_engine_tone(engine, light, 0, 0, WIDTH, HEIGHT + 1, rgba, &tries[num].error));
    TRY(karst_engine_tone(engine, light, 0, 0, WIDTH, HEIGHT, rgba, &tries[num].error)); /* nothing was metered */
    for (int i = 0; i < num; i++)
        if (tries[i].done || tries[i].error.status != KARST_USAGE)
            fail_msg("try %d: %s", i, tries[i].done ? "was not refused" : tries[i].error.message);
    settle(engine); /* nothing of it did any harm */
    karst_engine_destroy(engine);
    const karst_engine_config plain = {
        .world = "hills", .display = KARST_DISPLAY_NONE, .width_px = 16, .height_px = 16, .view_distance_m = 500};
    karst_error error = {0};
    engine = karst_engine_create(&plain, &error);
    assert_non_null(engine);
    assert_false(karst_engine_meter(engine, light, 16, 16, &error));
    assert_int_equal(error.status, KARST_USAGE);
    error = (karst_error){0};
    assert_false(karst_engine_set_sums(engine, light, 768, 1, &error));
    assert_int_equal(error.status, KARST_USAGE);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bands_are_the_whole),
                                       cmocka_unit_test(test_samples_in_two_goes_are_those_of_one),
                                       cmocka_unit_test(test_what_is_wrong_is_refused)};
    return cmocka_run_group_tests_name("pictures in bands", tests, NULL, NULL);
}
