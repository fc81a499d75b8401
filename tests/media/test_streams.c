/* Media where rays go on: before what land mirrors, inside clear matter and behind it, against closed forms. */
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
#include "tests/support/ok.h"

enum { WIDTH = 32, HEIGHT = 16, NUM_VALUES = WIDTH * HEIGHT * 3, MIDDLE = HEIGHT / 2 * WIDTH + WIDTH / 2 };

/* Night. The camera looks down, 20 m above the origin, by so little of a picture that its rays are all but one. */
#define HEAD                                                                                                     \
    "/*{ \"voxel\": 0.0625, \"view\": 200, \"sun\": { \"azimuth\": 70, \"elevation\": 35, \"colour\": [0, 0, 0] },\n" \
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"                              \
    "\"params\": { \"dry_m\": { \"value\": 0, \"min\": 0, \"max\": 100 },\n" \
    "\"red\": { \"value\": 0, \"min\": 0, \"max\": 1 } },\n" \
    "\"camera\": { \"position\": [\"0.03\", \"20\", \"0.03\"], \"pitch\": -90, \"fov\": 1 } }*/\n"
/* From y = -20 to -17, fading over a metre, and from 3 to 6. */
#define LAYERS                                                                                                  \
    "medium air(vec3 p) { medium m;\n"                                                                          \
    "m.extinction = 0.3 * (clamp(6.5 - p.y, 0.0, 1.0) * clamp(p.y - 2.5, 0.0, 1.0) + clamp(-6.5 - p.y, 0.0, 1.0));\n" \
    "m.albedo = vec3(0.0); m.emission = vec3(0.8, 0.4, 0.2) * m.extinction; return m; }\n"
#define GLOWING_BED                                                                          \
    "float density(vec3 p) { return -10.0 - p.y; }\n"                                        \
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); m.emission = vec3(1.0); return m; }\n"

static karst_engine *create(const char *text)
{
    char path[64] = "/tmp/karst-streams-XXXXXX.karst";
    karst_error why = {0};
    karst_engine_config config = {.width_px = WIDTH,
                                  .height_px = HEIGHT,
                                  .pool_bytes = (uint64_t)96 << 20,
                                  .display = KARST_DISPLAY_NONE};
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    config.world = path;
    karst_engine *engine = karst_engine_create(&config, &why);
    unlink(path);
    if (!engine)
        fail_msg("%s", why.message);
    return engine;
}

static void draw(karst_engine *engine, float *light)
{
    bool settled;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_check(engine, &error));
    assert_ok(karst_engine_read_radiance(engine, light, NUM_VALUES, &error));
}

static void assert_light(const float *light, const double expected[3], double tolerance)
{
    for (int c = 0; c < 3; c++)
        if (!(fabs((double)light[3 * MIDDLE + c] - expected[c]) <= tolerance * expected[c]))
            fail_msg("channel %d: %g in place of %g", c, (double)light[3 * MIDDLE + c], expected[c]);
}

static const double glow[3] = {0.8, 0.4, 0.2};

/* Layers between 3 and 6 are seen, and once more in the ground at 0. */
static void mirrors_show_them(void **state)
{
    (void)state;
    static float light[NUM_VALUES];
    karst_engine *engine = create(
        HEAD "float density(vec3 p) { return -p.y; }\n"
             "material surface(vec3 p, vec3 n) {\n"
             "material m; m.colour = vec3(0.0); m.mirror = 0.5; return m; }\n" LAYERS);
    draw(engine, light);
    karst_engine_destroy(engine);
    const double kept = exp(-0.3 * 3);
    double expected[3];
    for (int c = 0; c < 3; c++)
        expected[c] = glow[c] * (1 - kept) * (1 + 0.5 * kept);
    assert_light(light, expected, 0.003);
}

/* A pool of index 1 is not seen itself; what is in it lies before its bed, what is above it before both. If it absorbs,
 * light that is scattered in it loses what lies on its way. */
static void clear_matter_shows_them(void **state)
{
    (void)state;
    static float light[NUM_VALUES], plain[NUM_VALUES];
    const double kept = exp(-0.3 * 3);
    double expected[3], own = 0, depth = 0;
    karst_engine *engine = create(
        HEAD GLOWING_BED "float clear(vec3 p) { return -dry_m - p.y; }\n"
                         "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.0;\n"
                         "m.absorption = vec3(red, 0.0, 0.0); return m; }\n" LAYERS);
    draw(engine, light);
    for (int c = 0; c < 3; c++)
        expected[c] = glow[c] * (1 - kept) + kept * (glow[c] * (1 - kept) + kept);
    assert_light(light, expected, 0.003);
    const karst_parameter dry = {"dry_m", 100}, red[] = {{"dry_m", 0}, {"red", 0.1}};
    assert_ok(karst_engine_set_parameters(engine, &dry, 1, &error));
    draw(engine, plain);
    for (int i = 0; i < NUM_VALUES; i++)
        assert_true(fabsf(light[i] - plain[i]) < 0.003f);
    assert_ok(karst_engine_set_parameters(engine, red, 2, &error));
    draw(engine, light);
    for (int i = 0; i < 10000; i++) {
        const double s = (i + 0.5) / 1000, extinction = 0.3 * fmin(fmax(s - 6.5, 0), 1);
        own += extinction * exp(-depth - 0.1 * s) / 1000;
        depth += extinction / 1000;
    }
    expected[0] = glow[0] * (1 - kept) + kept * (glow[0] * own + kept * exp(-0.1 * 10));
    assert_light(light, expected, 0.01);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(mirrors_show_them), cmocka_unit_test(clear_matter_shows_them)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
