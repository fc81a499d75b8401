/* Full light through media, beside surfaces and clear matter: nothing is lost or added, what media take and give off is
 * what closed forms say, and light that is scattered often is that of paths in double. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "karst/reference.h"
#include "tests/support/scene.h"

enum { WIDTH = 24, HEIGHT = 16, NUM = WIDTH * HEIGHT };

static float one[3 * NUM], other[3 * NUM];

static bool is_full(void) { return getenv("KARST_TEST_FULL") != NULL; }

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    karst_engine_config config = *like;
    config.tone = KARST_TONE_OF_FILM;
    return scene_create(text, &config, WIDTH, HEIGHT, NULL);
}

static void settle(karst_engine *engine, float light[3 * NUM])
{
    scene_settle(engine, 4000, light, 3 * NUM, NULL);
}

static double mean_of(const float light[3 * NUM]) { return scene_mean(light, 3 * NUM); }

/* ---- energy ---- */

/* In a shell that gives off as much light everywhere a cloud that loses none: alone, around white land, around and in a
 * ball of glass; and one that gives off light itself. */
static const char furnace[] =
    "/*{ \"voxel\": 0.03125, \"view\": 60, \"sun\": { \"colour\": [0, 0, 0] },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"scene\": { \"value\": 0, \"min\": 0, \"max\": 3 },\n"
    "\"thick\": { \"value\": 2, \"min\": 0, \"max\": 9 },\n"
    "\"forward\": { \"value\": 0.5, \"min\": -1, \"max\": 1 }, \"white\": { \"value\": 1, \"min\": 0, \"max\": 1 } },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 50 } }*/\n"
    "float density(vec3 p) { return max(length(p) - 20.0, scene > 0.5 && scene < 1.5 ? 0.8 - length(p) : -1.0); }\n"
    "material surface(vec3 p, vec3 n) { material m; float far = scene > 1.5 || length(p) > 10.0 ? 1.0 : 0.0;\n"
    "    m.colour = vec3(1.0 - far); m.emission = vec3(0.5 * far); return m; }\n"
    "float clear(vec3 p) { return scene > 1.5 && scene < 2.5 ? 0.8 - length(p) : -1.0; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n"
    "medium air(vec3 p) { medium m; m.extinction = thick * clamp(4.0 * (1.5 - length(p)), 0.0, 1.0);\n"
    "    m.albedo = vec3(white); m.g = forward; m.emission = vec3(scene > 2.5 && length(p) < 1.375 ? 0.25 : 0.0);\n"
    "    return m; }\n";

static void show(karst_engine *engine, double scene, double thick, double white, float light[3 * NUM])
{
    const karst_parameter parameters[] = {{"scene", scene}, {"thick", thick}, {"white", white}};
    assert_ok(karst_engine_set_parameters(engine, parameters, 3, &error));
    settle(engine, light);
}

static void what_absorbs_nothing_is_not_seen(void **state)
{
    (void)state;
    const karst_engine_config config = {.integrator = KARST_INTEGRATOR_FULL};
    karst_engine *engine = create(furnace, &config);
    karst_stats stats;
    for (int scene = 0; scene < 3; scene++) {
        double worst = 0;
        show(engine, scene, 2, 1, one);
        karst_engine_stats(engine, &stats);
        for (int i = 0; i < 3 * NUM; i++)
            worst = fmax(worst, fabs((double)one[i] / 0.5 - 1));
        print_message("# furnace %d: at worst off by %.2g, %d rays went on, %d cut off\n", scene, worst,
                      (int)stats.num_rays[KARST_STREAM_MIRROR], (int)stats.num_rays_cut);
        assert_true(stats.num_rays[KARST_STREAM_MIRROR] > 300);
        assert_true(worst < 0.005);
    }
    karst_engine_destroy(engine);
}

/* In the middle of the picture: what comes through a cloud that scatters nothing, and what a thin one gives off. */
static void media_take_and_give_what_they_should(void **state)
{
    (void)state;
    const karst_engine_config config = {.integrator = KARST_INTEGRATOR_FULL, .samples = is_full() ? 1024 : 128};
    karst_engine *engine = create(furnace, &config);
    const int middle[] = {HEIGHT / 2 * WIDTH + WIDTH / 2, (HEIGHT / 2 - 1) * WIDTH + WIDTH / 2 - 1};
    double mean = 0;
    show(engine, 0, 1, 0, one);
    for (int i = 0; i < 2; i++)
        mean += (double)one[3 * middle[i]] / 2;
    const double truth = 0.5 * exp(-(2 * 1.25 + 0.25)), noise = sqrt(0.5 * truth / (2 * config.samples));
    print_message("# through depth 2.75: %.4f of %.4f, +- %.4f\n", mean, truth, noise);
    assert_true(fabs(mean - truth) < 4 * noise);
    show(engine, 3, 0.01, 0, one);
    mean = 0;
    for (int i = 0; i < 2; i++)
        mean += (double)one[3 * middle[i]] / 2;
    const double all = 0.5 * exp(-0.0275) + 0.25 * 2.75 * (1 - 0.0275 / 2);
    print_message("# given off on 2.75 m, and behind: %.4f of %.4f\n", mean, all);
    assert_true(fabs(mean / all - 1) < 0.03);
    karst_engine_destroy(engine);
}

static void lanes_and_other_views_leave_no_trace(void **state)
{
    (void)state;
    karst_engine_config config = {.integrator = KARST_INTEGRATOR_FULL, .samples = 3};
    karst_engine *engine = create(furnace, &config);
    show(engine, 2, 2, 0.8, one);
    const karst_camera there = karst_engine_default_camera(engine);
    karst_camera away = there;
    away.yaw_deg += 20;
    assert_ok(karst_engine_set_camera(engine, &away, &error));
    settle(engine, other);
    assert_memory_not_equal(one, other, sizeof one);
    assert_ok(karst_engine_set_camera(engine, &there, &error));
    settle(engine, other);
    assert_memory_equal(one, other, sizeof one);
    karst_engine_destroy(engine);
    if (!is_full()) /* all kernels once more */
        return;
    config.lanes = 1;
    engine = create(furnace, &config);
    show(engine, 2, 2, 0.8, other);
    karst_engine_destroy(engine);
    assert_memory_equal(one, other, sizeof one);
}

/* ---- lamps ---- */

/* A lamp in a ball of smoke that only absorbs, above the ground. */
static const char lamp[] =
    "/*{ \"voxel\": 0.03125, \"view\": 60, \"sun\": { \"colour\": [0, 0, 0] },\n"
    "\"lights\": [{ \"position\": [0, 3, 0], \"colour\": [9, 9, 9], \"radius\": 0.05 }],\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"thick\": { \"value\": 0, \"min\": 0, \"max\": 9 } },\n"
    "\"camera\": { \"position\": [\"0\", \"1.5\", \"0\"], \"pitch\": -90, \"fov\": 50 } }*/\n"
    "float density(vec3 p) { return -p.y; }\nvec3 colour(vec3 p, vec3 n) { return vec3(0.5); }\n"
    "medium air(vec3 p) { medium m; m.extinction = length(p - vec3(0.0, 3.0, 0.0)) < 1.0 ? thick : 0.0;\n"
    "    m.albedo = vec3(0.0); return m; }\n";

static void media_take_what_lamps_send(void **state)
{
    (void)state;
    for (int i = 0; i < (is_full() ? 2 : 1); i++) {
        const karst_engine_config config = {.integrator = i ? KARST_INTEGRATOR_FULL : KARST_INTEGRATOR_DIRECT,
                                            .samples = i ? 16 : 1,
                                            .detail_px = 0.25};
        karst_parameter thick = {"thick", 0};
        karst_engine *engine = create(lamp, &config);
        settle(engine, one);
        thick.value = 0.7;
        assert_ok(karst_engine_set_parameters(engine, &thick, 1, &error));
        settle(engine, other);
        karst_engine_destroy(engine);
        const double left = mean_of(other) / mean_of(one), truth = exp(-0.7 * 0.95);
        print_message("# %s: %.4f of a lamp's light are left, of %.4f\n", i ? "full" : "direct", left, truth);
        assert_true(mean_of(one) > 0.1 && fabs(left / truth - 1) < 0.02);
    }
}

/* ---- often ---- */

/* Of the sun's light, what the sky's glow around it adds (sun_glow in raycast/light/light.clh), which truths leave out:
 * 2 pi of 0.06 / 9, 0.08 / 33 and 0.25 / 257 beside pi. */
#define GLOW 0.0201

static void light_scattered_often_is_right(void **state)
{
    (void)state;
    static const char world[] = "docs/accuracy/cloud.karst"; /* tests run from the repository's root */
    static double truth[3 * NUM], deviation[3 * NUM];
    const bool full = is_full();
    static const double depths[] = {10, 1, 100}, forward[] = {0, 0.85, 0};
    for (int i = 0; i < (full ? 3 : 1); i++) {
        const karst_parameter parameters[] = {{"depth", depths[i]}, {"forward", forward[i]}};
        const karst_reference_config reference = {.world = world,
                                                  .parameters = parameters,
                                                  .num_parameters = 2,
                                                  .width_px = WIDTH,
                                                  .height_px = HEIGHT};
        const karst_reference_light light = {.paths_px = full ? 1000 : 60, .spread_px = true, .max_nodes = 8192};
        const karst_engine_config config = {.world = world,
                                            .parameters = parameters,
                                            .num_parameters = 2,
                                            .display = KARST_DISPLAY_NONE,
                                            .width_px = WIDTH,
                                            .height_px = HEIGHT,
                                            .detail_px = 0.5,
                                            .pool_bytes = (uint64_t)128 << 20,
                                            .integrator = KARST_INTEGRATOR_FULL,
                                            .tone = KARST_TONE_OF_FILM,
                                            .exposure = KARST_EXPOSURE_GIVEN,
                                            .samples = full ? 256 : 16};
        karst_error error = {0};
        karst_engine *engine = karst_engine_create(&config, &error);
        if (!engine)
            fail_msg("%s", error.message);
        settle(engine, one);
        karst_engine_destroy(engine);
        if (!karst_reference_scatter(&reference, &light, truth, deviation, NULL, NULL, NULL, &error))
            fail_msg("%s", error.message);
        double mean = 0, off = 0, squares = 0, noise = 0;
        for (int k = 0; k < 3 * NUM; k++) {
            const double right = (1 + GLOW) * truth[k], d = (double)one[k] - right;
            mean += right / (3 * NUM);
            off += d / (3 * NUM);
            squares += d * d / (3 * NUM);
            noise += deviation[k] * deviation[k] / (3 * NUM);
        }
        const double rms = sqrt(fmax(squares - noise, 0)) / mean; /* nearly all of it the engine's own noise */
        print_message("# depth %g, g %g: mean %.4f, bias %+.2f %%, rms %.1f %%\n", depths[i], forward[i], mean,
                      100 * off / mean, 100 * rms);
        assert_true(fabs(off / mean) < (full ? 0.02 + 3 * rms / sqrt(NUM) : 0.05));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_absorbs_nothing_is_not_seen), cmocka_unit_test(media_take_and_give_what_they_should),
        cmocka_unit_test(lanes_and_other_views_leave_no_trace), cmocka_unit_test(media_take_what_lamps_send),
        cmocka_unit_test(light_scattered_often_is_right)};
    return cmocka_run_group_tests_name("full light through media", tests, NULL, NULL);
}
