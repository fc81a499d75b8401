/* Lamps in media: light that is scattered once, against double quadrature; land hides lamps from media, unless they
 * shine through; the same pictures on all lanes. */
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

enum { WIDTH = 32, HEIGHT = 16, NUM_VALUES = WIDTH * HEIGHT * 3, SAMPLES = 16 };

/* Night; a ball of fog around the origin, and lamps above what is seen of it: a point and a spot. */
#define HEAD(x, wall_m, lights) \
    "/*{ \"voxel\": 0.125, \"view\": 100, \"sun\": { \"azimuth\": 70, \"elevation\": 35, \"colour\": [0, 0, 0] },\n" \
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"                              \
    "\"lights\": [" lights "], \"params\": { \"wall_m\": { \"value\": " wall_m ", \"min\": 0, \"max\": 100 } },\n" \
    "\"camera\": { \"position\": [\"" x "\", \"0\", \"-20\"], \"yaw\": 0, \"pitch\": 0, \"fov\": 20 } }*/\n"
/* A wall in the middle, seen from its edge; it may be out of sight. */
#define LAND "float density(vec3 p) { return min(0.25 - abs(p.x - 0.5), min(p.z + 7.0, wall_m - 50.0)); }\n"
#define FOG                                                                                          \
    "medium air(vec3 p) { medium m; m.extinction = 0.1 * clamp((7.0 - length(p)) / 4.0, 0.0, 1.0);\n"        \
    "m.albedo = vec3(0.9, 0.8, 0.5); m.g = 0.4; return m; }\n"
#define POINT "{ \"position\": [\"2\", \"5\", \"-1\"], \"radius\": 0.25, \"colour\": [20, 10, 5] }"
#define SPOT \
    "{ \"kind\": \"spot\", \"position\": [\"-3\", \"5.5\", \"1\"], \"radius\": 0.1, \"elevation\": -90,\n" \
    "\"angle\": 60, \"soft\": 0.5, \"colour\": [4, 8, 16] }"
static const char fog[] = HEAD("0", "0", POINT ", " SPOT) LAND FOG;

static void picture_of(const char *text, int lanes, uint32_t samples, float *light)
{
    char path[64] = "/tmp/karst-lamps-XXXXXX.karst";
    bool settled;
    karst_error why = {0};
    karst_engine_config config = {.width_px = WIDTH,
                                  .height_px = HEIGHT,
                                  .pool_bytes = (uint64_t)96 << 20,
                                  .display = KARST_DISPLAY_NONE,
                                  .lanes = lanes,
                                  .detail_px = 0.25,
                                  .samples = samples};
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    config.world = path;
    karst_engine *engine = karst_engine_create(&config, &why);
    unlink(path);
    if (!engine)
        fail_msg("%s", why.message);
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_check(engine, &error));
    assert_ok(karst_engine_read_radiance(engine, light, NUM_VALUES, &error));
    karst_engine_destroy(engine);
}

/* ---- quadrature ---- */

static double extinction(const double p[3])
{
    const double r = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    return 0.1 * fmin(fmax((7 - r) / 4, 0), 1);
}

static double depth_between(const double a[3], const double b[3])
{
    enum { STEPS = 40 };
    double sum = 0, way = 0, d[3];
    for (int axis = 0; axis < 3; axis++) {
        d[axis] = b[axis] - a[axis];
        way += d[axis] * d[axis];
    }
    for (int i = 0; i < STEPS; i++) {
        const double s = (i + 0.5) / STEPS, p[3] = {a[0] + s * d[0], a[1] + s * d[1], a[2] + s * d[2]};
        sum += extinction(p);
    }
    return sum * sqrt(way) / STEPS;
}

/* What a lamp sends to a place, where a white surface that faces it would be 1, and scatters towards -d. */
static double scattered(const double p[3], const double d[3], const double lamp[3], double cone_deg, double radius)
{
    double to[3], square = 0, cosine = 0;
    for (int axis = 0; axis < 3; axis++) {
        to[axis] = lamp[axis] - p[axis];
        square += to[axis] * to[axis];
    }
    const double far = sqrt(square);
    for (int axis = 0; axis < 3; axis++)
        cosine += to[axis] / far * d[axis];
    double strength = 1 / fmax(square, radius * radius);
    if (cone_deg > 0) { /* straight down, soft over half of it */
        const double dark = cos(cone_deg / 2 * M_PI / 180), bright = cos(cone_deg / 4 * M_PI / 180);
        const double s = fmin(fmax((to[1] / far - dark) / (bright - dark), 0), 1);
        strength *= s * s * (3 - 2 * s);
    }
    const double g = 0.4, q = 1 + g * g - 2 * g * cosine;
    return strength * 0.25 * (1 - g * g) / (q * sqrt(q)) * exp(-depth_between(p, lamp));
}

/* Of the ray through a pixel's centre. */
static void quadrature(int x, int y, double light[3])
{
    enum { STEPS = 200 };
    static const double lamps[2][3] = {{2, 5, -1}, {-3, 5.5, 1}}, colours[2][3] = {{20, 10, 5}, {4, 8, 16}},
                        albedo[3] = {0.9, 0.8, 0.5};
    const double tangent = tan(10 * M_PI / 180);
    double d[3] = {((x + 0.5) * 2 / WIDTH - 1) * tangent * WIDTH / HEIGHT, (1 - (y + 0.5) * 2 / HEIGHT) * tangent, 1};
    const double per = 1 / sqrt(d[0] * d[0] + d[1] * d[1] + 1);
    double depth = 0;
    for (int axis = 0; axis < 3; axis++)
        d[axis] *= per;
    light[0] = light[1] = light[2] = 0;
    for (int i = 0; i < STEPS; i++) {
        const double step = 16.0 / STEPS, t = 12 + (i + 0.5) * step, p[3] = {t * d[0], t * d[1], t * d[2] - 20};
        const double here = extinction(p) * step;
        for (int lamp = 0; lamp < 2; lamp++) {
            const double s = here * exp(-depth - here / 2) *
                             scattered(p, d, lamps[lamp], lamp ? 60 : 0, lamp ? 0.1 : 0.25);
            for (int c = 0; c < 3; c++)
                light[c] += s * colours[lamp][c] * albedo[c];
        }
        depth += here;
    }
}

static void lamps_light_media(void **state)
{
    (void)state;
    static float light[NUM_VALUES], other[NUM_VALUES];
    picture_of(fog, 0, SAMPLES, light);
    for (int c = 0; c < 3; c++) {
        double sum = 0, true_sum = 0, squares = 0;
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                double expected[3];
                quadrature(x, y, expected);
                const double found = (double)light[3 * (y * WIDTH + x) + c];
                sum += found;
                true_sum += expected[c];
                squares += (found - expected[c]) * (found - expected[c]);
            }
        const double num = WIDTH * HEIGHT, mean = true_sum / num, rms = sqrt(squares / num);
        print_message("channel %d: mean %g of %g, rms %g of it\n", c, sum / num, mean, rms / mean);
        assert_true(fabs(sum / true_sum - 1) < 0.015);
        assert_true(rms < (c < 2 ? 0.08 : 0.35) * mean); /* the lamps differ most in blue */
    }
    if (!getenv("KARST_TEST_FULL"))
        return;
    picture_of(fog, 1, SAMPLES, other);
    assert_memory_equal(other, light, sizeof light);
}

static double mean_green(const float *light, int x0, int x1)
{
    double sum = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = x0; x < x1; x++)
            sum += (double)light[3 * (y * WIDTH + x) + 1];
    return sum / ((x1 - x0) * HEIGHT);
}

/* On the right of the wall. */
#define BEHIND_WALL(shadow) \
    HEAD("0.5", "100", "{ \"position\": [\"4\", \"0\", \"0\"], \"colour\": [20, 20, 20], \"shadow\": " shadow " }") \
    LAND FOG

static void land_hides_lamps(void **state)
{
    (void)state;
    static const char hidden[] = BEHIND_WALL("true"), through[] = BEHIND_WALL("false");
    static float dark[NUM_VALUES], bright[NUM_VALUES];
    picture_of(hidden, 0, 2, dark);
    picture_of(through, 0, 2, bright);
    assert_true(mean_green(dark, 20, 28) > 0.01);
    assert_true(mean_green(dark, 4, 12) == 0);
    assert_true(mean_green(bright, 4, 12) > 0.003);
    assert_true(fabs(mean_green(bright, 20, 28) / mean_green(dark, 20, 28) - 1) < 0.05);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lamps_light_media), cmocka_unit_test(land_hides_lamps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
