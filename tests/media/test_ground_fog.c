/* Fog that goes on below the ground: what lies in land is not there for light that is scattered, so a picture is as
 * bright wherever the ground lies between samples, and as full light has it. The sun shines alone, on black ground. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/scene.h"

enum { WIDTH = 48, HEIGHT = 36, NUM = 3 * WIDTH * HEIGHT };

/* A metre of it is above the ground, denser the deeper. */
static const char fog[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"azimuth\": 120, \"elevation\": 35 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"ground\": { \"value\": 0, \"min\": -1, \"max\": 1 } },\n"
    "\"camera\": { \"position\": [\"3\", \"4\", \"-5\"], \"yaw\": -30, \"pitch\": -30, \"fov\": 60 } }*/\n"
    "float density(vec3 p) { return ground - 1.0 - p.y; }\n"
    "vec3 colour(vec3 p, vec3 n) { return vec3(0.0); }\n"
    "medium air(vec3 p) { medium m; m.extinction = clamp(ground - p.y, 0.0, 1.0); return m; }\n";

/* With the ground on samples, and between them. */
static const double grounds[] = {0, 0.0217};

static void draw(const karst_engine_config *config, double means[2])
{
    static float light[NUM];
    karst_engine *engine = scene_create(fog, config, WIDTH, HEIGHT, NULL);
    for (int i = 0; i < 2; i++) {
        const karst_parameter at = {"ground", grounds[i]};
        assert_ok(karst_engine_set_parameters(engine, &at, 1, &error));
        scene_settle(engine, 4000, light, NUM, NULL);
        means[i] = scene_mean(light, NUM);
    }
    karst_engine_destroy(engine);
}

static void it_is_as_bright_wherever_the_ground_lies(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        karst_scattering scattering;
        double most_apart;
        bool is_slow;
    } ways[] = {{"octaves", KARST_SCATTERING_OCTAVES, 0.01, false},
                {"fluence", KARST_SCATTERING_FLUENCE, 0.02, false},
                {"once", KARST_SCATTERING_ONCE, 0.01, true},
                {"paths", KARST_SCATTERING_PATHS, 0.02, true}};
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        const karst_engine_config config = {.tone = KARST_TONE_OF_FILM,
                                            .scattering = ways[i].scattering,
                                            .pool_bytes = (uint64_t)512 << 20,
                                            .samples = ways[i].is_slow ? 16 : 1};
        double means[2];
        if (ways[i].is_slow && !getenv("KARST_TEST_FULL"))
            continue;
        draw(&config, means);
        print_message("# %s: %.4f, and between samples %.4f\n", ways[i].name, means[0], means[1]);
        assert_true(means[0] > 0.05);
        assert_true(fabs(means[1] / means[0] - 1) < ways[i].most_apart);
    }
}

/* What is looked for beside the picture's own rays gets coarser with it, and no verdict is believed that knows nothing
 * of it. */
static void it_settles_in_small_pools(void **state)
{
    (void)state;
    static const struct {
        karst_scattering scattering;
        uint32_t pool_mib;
    } pools[] = {{KARST_SCATTERING_FLUENCE, 24}, {KARST_SCATTERING_FLUENCE, 12}, {KARST_SCATTERING_PATHS, 6}};
    for (size_t i = 0; i < sizeof pools / sizeof *pools; i++) {
        const karst_engine_config config = {.tone = KARST_TONE_OF_FILM,
                                            .scattering = pools[i].scattering,
                                            .pool_bytes = (uint64_t)pools[i].pool_mib << 20,
                                            .samples = 1};
        static float light[NUM];
        karst_stats stats;
        karst_engine *engine = scene_create(fog, &config, WIDTH, HEIGHT, NULL);
        scene_settle(engine, 200, light, NUM, &stats);
        print_message("# in %u MiB: %.4f, voxels of %.2f pixels\n", pools[i].pool_mib, scene_mean(light, NUM),
                      stats.detail_given_px);
        assert_true(stats.detail_given_px < 8);
        karst_engine_destroy(engine);
    }
}

/* The glow around the sun is in full light what a medium scatters, too: 2 %. */
static void it_is_what_full_light_says(void **state)
{
    (void)state;
    const karst_engine_config full = {.tone = KARST_TONE_OF_FILM, .integrator = KARST_INTEGRATOR_FULL, .samples = 256},
                              quick = {.tone = KARST_TONE_OF_FILM, .scattering = KARST_SCATTERING_FLUENCE};
    double truth[2], means[2];
    if (!getenv("KARST_TEST_FULL"))
        skip();
    draw(&full, truth);
    draw(&quick, means);
    for (int i = 0; i < 2; i++) {
        print_message("# ground at %.4f: fluence %.4f of %.4f\n", grounds[i], means[i], truth[i]);
        assert_true(fabs(means[i] / truth[i] - 1) < 0.05);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_is_as_bright_wherever_the_ground_lies),
                                       cmocka_unit_test(it_settles_in_small_pools),
                                       cmocka_unit_test(it_is_what_full_light_says)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
