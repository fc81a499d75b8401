/* What viewers may change of a picture that stands: its exposure; and views of what its light is made of. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/scene.h"

enum { WIDTH = 64, HEIGHT = 48, NUM = WIDTH * HEIGHT };

/* Ground that mirrors east of the middle, and a wall of another colour that hides some of the sky from it. */
static const char text[] =
    "/*{ \"voxel\": 0.0625, \"view\": 300, \"sun\": { \"azimuth\": 60, \"elevation\": 40 },\n"
    "\"camera\": { \"position\": [\"0\", \"2\", \"-6\"], \"pitch\": -12, \"fov\": 70 } }*/\n"
    "float density(vec3 p) { return max(-p.y, min(min(p.z - 1.0, 3.0 - p.z), 2.0 - p.y)); }\n"
    "material surface(vec3 p, vec3 n) {\n"
    "    material m;\n"
    "    m.colour = p.z > 0.9 && p.z < 3.1 ? vec3(0.2, 0.3, 0.7) : vec3(0.8, 0.5, 0.1);\n"
    "    m.mirror = p.x > 0.0 && p.y < 0.1 && p.z < 0.5 ? 0.5 : 0.0;\n"
    "    return m;\n"
    "}\n";
static char path[64];

static karst_engine_config base_config(void)
{
    return (karst_engine_config){.world = path,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .occlusion = KARST_OCCLUSION_ON,
                                 .tone = KARST_TONE_OF_FILM,
                                 .exposure = KARST_EXPOSURE_GIVEN,
                                 .pool_bytes = (uint64_t)64 << 20};
}

static void settle(karst_engine *engine, uint8_t *rgba)
{
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 300, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_pixels(engine, rgba, 4 * NUM, &error));
}

static int open_world(void **state)
{
    (void)state;
    snprintf(path, sizeof path, "/tmp/karst-looks-XXXXXX.karst");
    const int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    return close(fd);
}

static int remove_world(void **state)
{
    (void)state;
    return unlink(path);
}

static uint8_t before[4 * NUM], painted[4 * NUM], after[4 * NUM];
static float albedo[3 * NUM], open_share[NUM], place[3 * NUM], depth[NUM];

static void paint(karst_engine *engine, karst_view view)
{
    assert_ok(karst_engine_set_view(engine, view, &error));
    assert_ok(karst_engine_frame(engine, &error));
    assert_ok(karst_engine_read_pixels(engine, painted, sizeof painted, &error));
}

static bool is_near(uint8_t byte, float share) { return fabsf((float)byte - 255 * sqrtf(share)) < 1.01f; }

static void views_show_what_is_known(void **state)
{
    (void)state;
    const bool full = getenv("KARST_TEST_FULL") != NULL;
    for (int lanes = 16; lanes; lanes = lanes == 16 && full ? 1 : 0) {
        karst_engine_config config = base_config();
        config.lanes = lanes;
        karst_engine *engine = scene_open(&config);
        settle(engine, before);
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_ALBEDO, albedo, 3 * NUM, &error));
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_OCCLUSION, open_share, NUM, &error));
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_POSITION, place, 3 * NUM, &error));
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_DEPTH, depth, NUM, &error));
        int num_hits = 0, num_hidden = 0, num_mirrors = 0;
        paint(engine, KARST_VIEW_ALBEDO);
        for (int i = 0; i < NUM; i++)
            for (int c = 0; isfinite(depth[i]) && c < 3; c++)
                assert_true(is_near(painted[4 * i + c], albedo[3 * i + c]));
        paint(engine, KARST_VIEW_OCCLUSION);
        for (int i = 0; i < NUM; i++)
            if (isfinite(depth[i])) {
                assert_true(is_near(painted[4 * i], open_share[i]) && painted[4 * i] == painted[4 * i + 2]);
                num_hits++;
                num_hidden += open_share[i] < 0.8f;
            }
        assert_true(num_hits > NUM / 4 && num_hidden > NUM / 50);
        paint(engine, KARST_VIEW_BOUNCES);
        const uint8_t *never = painted; /* sky */
        assert_false(isfinite(depth[0]));
        for (int i = 0; i < NUM; i++) {
            const float *p = place + 3 * i;
            const bool is_clear = fabsf(p[0]) > 0.1f && p[1] < 0.05f && p[2] < 0.4f; /* of edges */
            const bool follows = isfinite(depth[i]) && p[0] > 0 && p[1] < 0.05f && p[2] < 0.4f;
            if (!isfinite(depth[i]) || is_clear)
                assert_true((memcmp(painted + 4 * i, never, 4) != 0) == follows);
            num_mirrors += is_clear && follows;
        }
        assert_true(num_mirrors > NUM / 50);
        paint(engine, KARST_VIEW_PICTURE);
        settle(engine, after);
        assert_memory_equal(before, after, sizeof before);
        karst_engine_destroy(engine);
    }
}

static void what_there_is_none_of_is_not_shown(void **state)
{
    (void)state;
    karst_error said = {0};
    karst_engine_config config = base_config();
    config.occlusion = KARST_OCCLUSION_OFF;
    karst_engine *engine = scene_open(&config);
    assert_false(karst_engine_set_view(engine, KARST_VIEW_OCCLUSION, &said));
    assert_int_equal(said.status, KARST_USAGE);
    assert_non_null(strstr(said.message, "--occlusion"));
    karst_engine_destroy(engine);
}

static void exposure_changes_at_once(void **state)
{
    (void)state;
    karst_error said = {0};
    karst_engine_config config = base_config();
    karst_stats stats;
    double stops;
    config.samples = 3;
    config.exposure_stops = 1;
    karst_engine *engine = scene_open(&config);
    settle(engine, before);
    karst_engine_destroy(engine);
    config.exposure_stops = 0;
    engine = scene_open(&config);
    settle(engine, after);
    assert_memory_not_equal(before, after, sizeof before);
    karst_engine_stats(engine, &stats);
    const uint32_t num_samples = stats.num_samples;
    assert_true(num_samples >= 3);
    assert_ok(karst_engine_set_exposure(engine, KARST_EXPOSURE_GIVEN, 1, &error));
    assert_int_equal(karst_engine_get_exposure(engine, &stops), KARST_EXPOSURE_GIVEN);
    assert_true(stops == 1);
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    assert_true(stats.num_samples >= num_samples);
    assert_ok(karst_engine_read_pixels(engine, after, sizeof after, &error));
    assert_memory_equal(before, after, sizeof before);
    assert_false(karst_engine_set_exposure(engine, KARST_EXPOSURE_GIVEN, 20.5, &said));
    assert_int_equal(said.status, KARST_USAGE);
    assert_false(karst_engine_set_exposure(engine, KARST_NUM_EXPOSURES, 0, NULL));
    assert_ok(karst_engine_set_exposure(engine, KARST_EXPOSURE_OF_PICTURE, 0, &error));
    assert_int_equal(karst_engine_get_exposure(engine, NULL), KARST_EXPOSURE_OF_PICTURE);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(views_show_what_is_known),
        cmocka_unit_test(what_there_is_none_of_is_not_shown),
        cmocka_unit_test(exposure_changes_at_once),
    };
    return cmocka_run_group_tests(tests, open_world, remove_world);
}
