/* A window has the bits of that part of the whole picture: colours, light, all that is known of pixels; with soft
 * shadows and hard ones, refined, and wherever the window begins. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"

enum { WIDTH = 128, HEIGHT = 96, NUM = WIDTH * HEIGHT };

typedef struct {
    const char *name, *world;
    uint32_t samples;
    karst_tone tone;
    bool refine;
} way;
static const way ways[] = {{"soft shadows", "hills", 2, KARST_TONE_OF_FILM, false},
                           {"bytes alone", "hills", 1, KARST_TONE_OF_PLAIN, false},
                           {"no sky", "asteroid", 3, KARST_TONE_OF_PLAIN, true}};
#define NUM_WAYS (sizeof ways / sizeof *ways)

/* x, y, width, height: in packets and across them, at an edge, a single pixel, the whole. */
static const int windows[][4] = {{32, 48, 64, 32}, {33, 19, 41, 31}, {101, 0, 27, 96}, {77, 58, 1, 1}, {0, 0, 128, 96}};

typedef struct {
    uint8_t rgba[NUM * 4];
    float aovs[KARST_NUM_AOVS][NUM * 3];
    bool keeps_radiance;
} picture;
static picture whole, part;

static karst_engine_config config_of(const way *w)
{
    return (karst_engine_config){.world = w->world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .pool_bytes = (uint64_t)96 << 20,
                                 .detail_px = 2,
                                 .view_distance_m = 2000,
                                 .samples = w->samples,
                                 .tone = w->tone,
                                 .refine = w->refine,
                                 .exposure =
                                     w->tone == KARST_TONE_OF_FILM ? KARST_EXPOSURE_GIVEN : KARST_EXPOSURE_OF_WORLD};
}

static void draw(const karst_engine_config *config, picture *p)
{
    karst_error error = {0};
    karst_stats stats;
    bool settled = false;
    const size_t num = (size_t)config->width_px * (size_t)config->height_px;
    karst_engine *engine = karst_engine_create(config, &error);
    if (!engine || !karst_engine_settle(engine, 400, NULL, NULL, &settled, &error) ||
        !karst_engine_read_pixels(engine, p->rgba, num * 4, &error))
        fail_msg("%s: %s", config->world, error.message);
    karst_engine_stats(engine, &stats);
    assert_true(settled && stats.detail_given_px == stats.detail_asked_px);
    p->keeps_radiance = karst_engine_keeps_radiance(engine);
    for (int i = 0; i < KARST_NUM_AOVS; i++) {
        const karst_aov aov = (karst_aov)i;
        const bool is_light = aov == KARST_AOV_RADIANCE || aov == KARST_AOV_ALBEDO || aov == KARST_AOV_SUMS;
        /* What is not read: test_occlusion.c. */
        if (aov != KARST_AOV_OCCLUSION && aov != KARST_AOV_OPENNESS && (!is_light || p->keeps_radiance) &&
            !karst_engine_read_aov(engine, aov, p->aovs[i], num * (size_t)karst_aov_width(aov), &error))
            fail_msg("%s: %s", config->world, error.message);
    }
    karst_engine_destroy(engine);
}

/* Rows of the window against those of the whole. */
static void compare(const char *name, const int w[4], const void *of_whole, const void *of_part, size_t pixel_bytes,
                    const char *what)
{
    for (int y = 0; y < w[3]; y++)
        for (int x = 0; x < w[2]; x++)
            if (memcmp((const char *)of_whole + (size_t)((w[1] + y) * WIDTH + w[0] + x) * pixel_bytes,
                       (const char *)of_part + (size_t)(y * w[2] + x) * pixel_bytes, pixel_bytes) != 0)
                fail_msg("%s, window %d,%d,%d,%d, %s: pixel (%d, %d) differs", name, w[0], w[1], w[2], w[3], what, x,
                         y);
}

static void test_windows_are_parts(void **state)
{
    (void)state;
    for (size_t k = 0; k < NUM_WAYS; k++) {
        karst_engine_config config = config_of(&ways[k]);
        draw(&config, &whole);
        for (size_t i = 0; i < sizeof windows / sizeof *windows; i++) {
            const int *w = windows[i];
            config.width_px = w[2];
            config.height_px = w[3];
            config.window = (karst_engine_window){WIDTH, HEIGHT, w[0], w[1]};
            draw(&config, &part);
            compare(ways[k].name, w, whole.rgba, part.rgba, 4, "colours");
            for (int a = 0; a < KARST_NUM_AOVS; a++)
                if (a != KARST_AOV_OCCLUSION && a != KARST_AOV_OPENNESS &&
                    ((a != KARST_AOV_RADIANCE && a != KARST_AOV_ALBEDO && a != KARST_AOV_SUMS) || whole.keeps_radiance))
                    compare(ways[k].name, w, whole.aovs[a], part.aovs[a],
                            sizeof(float) * (size_t)karst_aov_width((karst_aov)a), karst_aov_channel((karst_aov)a, 0));
        }
    }
}

/* What is not equal, and is said not to be: an exposure that follows the picture. */
static void test_exposure_of_the_picture_is_the_windows(void **state)
{
    (void)state;
    karst_engine_config config = config_of(&ways[0]);
    config.exposure = KARST_EXPOSURE_OF_PICTURE;
    draw(&config, &whole);
    const int *w = windows[0];
    config.width_px = w[2];
    config.height_px = w[3];
    config.window = (karst_engine_window){WIDTH, HEIGHT, w[0], w[1]};
    draw(&config, &part);
    compare("light", w, whole.aovs[KARST_AOV_RADIANCE], part.aovs[KARST_AOV_RADIANCE], 12, "radiance");
    bool differs = false;
    for (int y = 0; y < w[3]; y++)
        differs = differs ||
                  memcmp(whole.rgba + ((w[1] + y) * WIDTH + w[0]) * 4, part.rgba + y * w[2] * 4, (size_t)w[2] * 4) != 0;
    assert_true(differs);
}

static void test_windows_outside_are_refused(void **state)
{
    (void)state;
    static const karst_engine_window bad[] = {{64, 64, 40, 0},        {64, 64, 0, 33}, {64, 64, -1, 0},
                                              {20000, 64, 0, 0},      {64, 0, 0, 0},   {0, 0, 1, 0},
                                              {64, 64, 2147483647, 0}};
    karst_engine_config config = config_of(&ways[1]);
    config.width_px = config.height_px = 32;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        karst_error error = {0};
        config.window = bad[i];
        assert_null(karst_engine_create(&config, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    karst_error error = {0};
    config.window = (karst_engine_window){64, 64, 32, 32};
    karst_engine *engine = karst_engine_create(&config, &error);
    assert_non_null(engine);
    assert_false(karst_engine_set_size(engine, 16, 16, &error));
    assert_int_equal(error.status, KARST_USAGE);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_windows_are_parts),
                                       cmocka_unit_test(test_exposure_of_the_picture_is_the_windows),
                                       cmocka_unit_test(test_windows_outside_are_refused)};
    return cmocka_run_group_tests_name("windows of pictures", tests, NULL, NULL);
}
