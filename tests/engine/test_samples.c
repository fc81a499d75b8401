/* Pictures of many samples: what they depend on, what they do not, and the sun's width. */
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

enum { WIDTH = 64, HEIGHT = 48, NUM = WIDTH * HEIGHT, SAMPLES = 8 };

static karst_engine_config base_config(const char *world)
{
    return (karst_engine_config){.world = world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .pool_bytes = (uint64_t)64 << 20};
}

static void settle(karst_engine *engine, uint32_t samples)
{
    bool settled = false;
    karst_stats stats;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &stats);
    assert_true(settled && stats.settled);
    assert_int_equal(stats.num_samples, samples);
}

typedef struct {
    uint8_t bytes[4 * NUM];
    float light[3 * NUM];
} picture;

static void read_picture(karst_engine *engine, picture *p)
{
    assert_ok(karst_engine_read_pixels(engine, p->bytes, sizeof p->bytes, &error));
    assert_ok(karst_engine_read_radiance(engine, p->light, 3 * NUM, &error));
}

static void take(const karst_engine_config *config, picture *p)
{
    karst_engine *engine = scene_open(config);
    settle(engine, config->samples ? config->samples : 1);
    read_picture(engine, p);
    karst_engine_destroy(engine);
}

static picture whole, other;

/* A world's text in a file that goes again. */
static void write_world(const char *text, char path[64])
{
    snprintf(path, 64, "/tmp/karst-samples-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
}

static void one_sample_gives_the_bytes_of_the_short_way(void **state)
{
    (void)state;
    static const char *const worlds[] = {"hills",   "asteroid", "alps",    "canyons", "dunes", "islands",
                                         "lattice", "karst",    "regions", "planet",  "ruins", "thesis"};
    const int num_worlds = getenv("KARST_TEST_FULL") ? 12 : 2;
    static uint8_t bytes[4 * NUM];
    for (int i = 0; i < num_worlds; i++)
        for (int no_shadows = 1; no_shadows >= 0; no_shadows--) {
            karst_engine_config config = base_config(worlds[i]);
            config.no_shadows = no_shadows;
            karst_engine *engine = scene_open(&config);
            settle(engine, 1);
            assert_ok(karst_engine_read_pixels(engine, bytes, sizeof bytes, &error));
            karst_error error = {0};
            assert_false(karst_engine_read_radiance(engine, whole.light, 3 * NUM, &error));
            assert_int_equal(error.status, KARST_USAGE);
            karst_engine_destroy(engine);
            config.exposure = KARST_EXPOSURE_GIVEN; /* of 0 stops: the long way */
            take(&config, &whole);
            if (no_shadows)
                assert_memory_equal(whole.bytes, bytes, sizeof bytes);
            int num_other = 0; /* by rounding: what the sun adds is a difference */
            for (int j = 0; j < 4 * NUM; j++) {
                assert_true(abs(whole.bytes[j] - bytes[j]) <= 1);
                num_other += whole.bytes[j] != bytes[j];
            }
            assert_true(num_other <= 4 * NUM / 1000);
        }
}

static void lanes_history_and_goes_leave_no_trace(void **state)
{
    (void)state;
    karst_engine_config config = base_config("hills");
    config.samples = SAMPLES;
    config.tone = KARST_TONE_OF_FILM;
    config.view_distance_m = 1000;
    take(&config, &whole);
    config.lanes = 1;
    take(&config, &other);
    assert_memory_equal(whole.light, other.light, sizeof whole.light);
    assert_memory_equal(whole.bytes, other.bytes, sizeof whole.bytes);
    config.lanes = 0;

    /* Elsewhere first, and in two goes. */
    config.pool_bytes = (uint64_t)48 << 20;
    karst_engine *engine = scene_open(&config);
    const karst_camera there = karst_engine_default_camera(engine);
    karst_camera away = there;
    away.yaw_deg += 40;
    away.pitch_deg -= 20;
    bool settled;
    karst_stats stats;
    assert_ok(karst_engine_set_camera(engine, &away, &error));
    settle(engine, SAMPLES);
    read_picture(engine, &other);
    assert_memory_not_equal(whole.light, other.light, sizeof whole.light);
    assert_ok(karst_engine_set_camera(engine, &there, &error));
    do {
        assert_ok(karst_engine_settle(engine, 1, NULL, NULL, &settled, &error));
        karst_engine_stats(engine, &stats);
    } while (stats.num_samples < SAMPLES / 2);
    assert_false(settled);
    settle(engine, SAMPLES);
    read_picture(engine, &other);
    assert_memory_equal(whole.light, other.light, sizeof whole.light);
    assert_memory_equal(whole.bytes, other.bytes, sizeof whole.bytes);
    /* At rest nothing changes. */
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    assert_true(stats.settled && stats.num_samples == SAMPLES);
    read_picture(engine, &other);
    assert_memory_equal(whole.bytes, other.bytes, sizeof whole.bytes);
    karst_engine_destroy(engine);
    /* A sample more or less is another picture. */
    config.samples = SAMPLES - 1;
    take(&config, &other);
    assert_memory_not_equal(whole.light, other.light, sizeof whole.light);
}

/* Views in which beams once took what was left in their queues for rays that start on a surface. */
static void beams_leave_no_trace(void **state)
{
    (void)state;
    static const double shares[] = {13 / 23.0, 17 / 23.0, 20 / 23.0, 1};
    karst_engine_config config = base_config("hills");
    config.samples = 2;
    config.detail_px = 2;
    config.view_distance_m = 2000;
    config.no_blend = true;
    karst_engine *engine = scene_open(&config);
    config.no_beam = true;
    karst_engine *alone = scene_open(&config);
    for (int i = 0; i < 4; i++) {
        char text[64];
        karst_camera camera = {.fov_deg = 60};
        snprintf(text, sizeof text, "%.3f,320,0,%.3f,-10", 30 * shares[i], 20 * shares[i]);
        assert_ok(karst_camera_parse(text, karst_engine_voxel_log2_m(engine), &camera, &error));
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_set_camera(alone, &camera, &error));
        settle(engine, 2);
        read_picture(engine, &whole);
        settle(alone, 2);
        read_picture(alone, &other);
        assert_memory_equal(whole.light, other.light, sizeof whole.light);
    }
    karst_engine_destroy(engine);
    karst_engine_destroy(alone);
}

/* Depth is that of the pixels' centres, which no sample looks at: what a picture of one sample has. */
static void depth_is_settled_too(void **state)
{
    (void)state;
    enum { WIDE = 240, HIGH = 135, NUM_VIEWS = 6 };
    static float depth_m[2][NUM_VIEWS][WIDE * HIGH];
    karst_engine_config config = base_config("hills");
    config.width_px = WIDE;
    config.height_px = HIGH;
    config.pool_bytes = (uint64_t)512 << 20;
    for (int many = 0; many < 2; many++) {
        config.samples = many ? 8 : 1;
        karst_engine *engine = scene_open(&config);
        for (int i = 0; i < NUM_VIEWS; i++) {
            char text[64];
            karst_camera camera = {.fov_deg = 60};
            snprintf(text, sizeof text, "%d,320,0,%d,-10", 6 * i, 4 * i);
            assert_ok(karst_camera_parse(text, karst_engine_voxel_log2_m(engine), &camera, &error));
            assert_ok(karst_engine_set_camera(engine, &camera, &error));
            settle(engine, config.samples);
            assert_ok(karst_engine_read_depth(engine, depth_m[many][i], WIDE * HIGH, &error));
        }
        karst_engine_destroy(engine);
    }
    int num_off = 0;
    for (int i = 0; i < NUM_VIEWS; i++)
        for (int pixel = 0; pixel < WIDE * HIGH; pixel++)
            num_off += depth_m[0][i][pixel] != depth_m[1][i][pixel];
    print_message("%d depths of %d are others\n", num_off, NUM_VIEWS * WIDE * HIGH);
    assert_int_equal(num_off, 0);
}

#define PLATE_M 8.0
static const char plate[] = "/*{ \"voxel\": 0.001953125, \"view\": 20, \"sun\": { \"elevation\": 90 },\n"
                            "\"camera\": { \"position\": [\"0\", \"1\", \"0\"], \"pitch\": -90, \"fov\": 10 } }*/\n"
                            "float density(vec3 p) { return max(-p.y, min(p.x, 0.25 - abs(p.y - 8.0))); }\n"
                            "vec3 colour(vec3 p, vec3 n) { return vec3(0.5); }\n";

/* How much of the sun a place on the ground sees, x metres under the plate: the part of its disc on one side. */
static double seen(double x_m)
{
    const double c = fmax(-1, fmin(1, x_m / (PLATE_M * 0.5 * 0.0093)));
    return (acos(c) - c * sqrt(1 - c * c)) / M_PI;
}

static void shadows_are_as_soft_as_the_sun_is_wide(void **state)
{
    (void)state;
    char path[64];
    write_world(plate, path);
    double worst[2];
    for (int wide = 0; wide < 2; wide++) {
        karst_engine_config config = base_config(path);
        config.samples = wide ? 64 : 1;
        config.exposure = KARST_EXPOSURE_GIVEN;
        take(&config, &whole);
        double column[WIDTH], most = 0, least = 1e9;
        for (int x = 0; x < WIDTH; x++) {
            column[x] = 0;
            for (int y = 0; y < HEIGHT; y++)
                column[x] += (double)whole.light[3 * (y * WIDTH + x)] / HEIGHT;
            most = fmax(most, column[x]);
            least = fmin(least, column[x]);
        }
        assert_true(most > 1.5 * least);
        worst[wide] = 0;
        const double across_m = 2 * tan(5 * M_PI / 180) / HEIGHT;
        const bool mirrored = column[0] < column[WIDTH - 1];
        for (int x = 0; x < WIDTH; x++) {
            const double x_m = (x + 0.5 - WIDTH / 2.0) * across_m * (mirrored ? -1 : 1);
            worst[wide] = fmax(worst[wide], fabs((column[x] - least) / (most - least) - seen(x_m)));
        }
    }
    unlink(path);
    print_message("penumbra: off by %.3f with 64 samples, %.3f with one\n", worst[1], worst[0]);
    assert_true(worst[1] < 0.08 && worst[0] > 0.3);
}

static void what_is_out_of_range_is_said(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_engine_config config = base_config("hills");
    config.samples = KARST_ENGINE_MAX_SAMPLES + 1;
    assert_null(karst_engine_create(&config, &error));
    assert_int_equal(error.status, KARST_USAGE);
    config.samples = 1;
    config.exposure = KARST_EXPOSURE_GIVEN;
    config.exposure_stops = NAN;
    assert_null(karst_engine_create(&config, &error));
    assert_int_equal(error.status, KARST_USAGE);
    karst_tone tone = KARST_TONE_OF_PLAIN;
    error = (karst_error){0};
    assert_true(karst_tone_parse("filmic", &tone, &error) && tone == KARST_TONE_OF_FILM);
    assert_false(karst_tone_parse("vivid", &tone, &error));
    assert_non_null(strstr(error.message, "plain, filmic"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_sample_gives_the_bytes_of_the_short_way),
        cmocka_unit_test(lanes_history_and_goes_leave_no_trace),
        cmocka_unit_test(beams_leave_no_trace),
        cmocka_unit_test(depth_is_settled_too),
        cmocka_unit_test(shadows_are_as_soft_as_the_sun_is_wide),
        cmocka_unit_test(what_is_out_of_range_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
