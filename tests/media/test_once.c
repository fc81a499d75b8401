/* Light that a slab scatters once against closed forms: of the sun, which stands low above it, and of what comes from
 * all around. A slab's depth to the sun and to the eye are in proportion whatever its profile is, so what pictures are
 * off by is how a ray's light is summed, and depths to the sun. */
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

#define WIDTH_PX 32
#define HEIGHT_PX 24
#define FOV_DEG 4
#define ALBEDO 0.9
#define G 0.3
/* Of the sun's direction, across the slab. */
#define SUN_ACROSS 0.2

static const char slab_text[] =
    "/*{ \"voxel\": 0.015625, \"view\": 100, \"params\": { \"depth\": { \"value\": 1, \"min\": 0, \"max\": 1000 },\n"
    "\"forward\": { \"value\": 0, \"min\": -0.95, \"max\": 0.95 } },\n"
    "\"sun\": { \"azimuth\": %.9f, \"elevation\": %d, \"colour\": [%s] },\n"
    "\"sky\": { \"zenith\": [%s], \"horizon\": [%s], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-20\"], \"pitch\": 0, \"fov\": 4 } }*/\n"
    "float density(vec3 p) { return -1.0; }\n"
    "medium air(vec3 p) { medium m; m.albedo = vec3(0.9); m.g = forward;\n"
    "m.extinction = 0.5 * depth * clamp(16.0 * (1.0 - abs(p.z)) + 0.5, 0.0, 1.0); return m; }\n";

/* Red, of each pixel. */
static void draw(const char *text, double depth, double g, uint32_t samples, float red[WIDTH_PX * HEIGHT_PX])
{
    char path[] = "/tmp/karst-once-XXXXXX.karst";
    const int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    const karst_parameter parameters[] = {{"depth", depth}, {"forward", g}};
    const karst_engine_config config = {.world = path,
                                        .parameters = parameters,
                                        .num_parameters = 2,
                                        .pool_bytes = (uint64_t)128 << 20,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH_PX,
                                        .height_px = HEIGHT_PX,
                                        .detail_px = 0.5,
                                        .samples = samples,
                                        .tone = KARST_TONE_OF_FILM,
                                        .scattering = KARST_SCATTERING_ONCE};
    static float light[WIDTH_PX * HEIGHT_PX * 3];
    karst_error error = {0};
    bool settled = false;
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_settle(engine, 2000, NULL, NULL, &settled, &error) ||
        !karst_engine_read_radiance(engine, light, WIDTH_PX * HEIGHT_PX * 3, &error))
        fail_msg("%s", error.message);
    assert_true(settled);
    karst_engine_destroy(engine);
    unlink(path);
    for (int i = 0; i < WIDTH_PX * HEIGHT_PX; i++)
        red[i] = light[3 * i];
}

/* Through the middle of a pixel. */
static void direction_of(int x, int y, double d[3])
{
    const double half = tan(FOV_DEG / 2.0 * (M_PI / 180));
    d[0] = (2 * (x + 0.5) / WIDTH_PX - 1) * half * WIDTH_PX / HEIGHT_PX;
    d[1] = (1 - 2 * (y + 0.5) / HEIGHT_PX) * half;
    d[2] = 1;
    const double length = sqrt(d[0] * d[0] + d[1] * d[1] + 1);
    for (int i = 0; i < 3; i++)
        d[i] /= length;
}

/* From each pixel, what is lost on the ray is as dense as exp(-t / c), and of the sun exp(-t / SUN_ACROSS) is left. */
static void sun_is_scattered_once(void **state)
{
    (void)state;
    static const double depths[] = {1, 10, 100};
    static float red[WIDTH_PX * HEIGHT_PX];
    char text[1024];
    const double azimuth_deg = 90 + asin(SUN_ACROSS) * (180 / M_PI);
    snprintf(text, sizeof text, slab_text, azimuth_deg, 0, "1, 1, 1", "0, 0, 0", "0, 0, 0");
    for (size_t i = 0; i < 3; i++) {
        double squares = 0, mean = 0, most = 0, seen = 0;
        draw(text, depths[i], G, 1, red);
        for (int p = 0; p < WIDTH_PX * HEIGHT_PX; p++) {
            double d[3];
            direction_of(p % WIDTH_PX, p / WIDTH_PX, d);
            const double cosine = d[0] * sqrt(1 - SUN_ACROSS * SUN_ACROSS) - d[2] * SUN_ACROSS,
                         q = 1 + G * G - 2 * G * cosine, phase = 0.25 * (1 - G * G) / (q * sqrt(q)),
                         truth = ALBEDO * phase / (1 + d[2] / SUN_ACROSS) *
                                 (1 - exp(-depths[i] * (1 / d[2] + 1 / SUN_ACROSS))),
                         off = (double)red[p] - truth;
            mean += truth / (WIDTH_PX * HEIGHT_PX);
            seen += (double)red[p] / (WIDTH_PX * HEIGHT_PX);
            squares += off * off / (WIDTH_PX * HEIGHT_PX);
            most = fmax(most, fabs(off) / truth);
        }
        print_message("# a slab of depth %g: bias %+.3f %%, rms %.3f %%, a pixel is off by %.3f %% at most\n",
                      depths[i], 100 * (seen / mean - 1), 100 * sqrt(squares) / mean, 100 * most);
        assert_true(sqrt(squares) / mean < 0.01 && most < 0.03);
    }
}

/* The exponential integral E2: the mean of exp(-depth / mu) over mu from 0 to 1. */
static double mean_left(double depth)
{
    double sum = 0;
    for (int i = 0; i < 4000; i++)
        sum += exp(-depth / ((i + 0.5) / 4000)) / 4000;
    return sum;
}

/* The ground throws back what the sun sends it; a sky may shine, too. Light that grows with height evenly is, in a slab
 * that stands upright and scatters evenly, as good as its mean. */
static void what_comes_from_around_is_scattered_once(void **state)
{
    (void)state;
    static const double depth = 4;
    static const char *const skies[] = {"0, 0, 0", "0.5, 0.5, 0.5"};
    static float red[WIDTH_PX * HEIGHT_PX];
    double share = 0;
    for (int i = 0; i < 1000; i++) {
        const double t = (i + 0.5) / 1000 * depth;
        share += exp(-t) * 0.5 * (mean_left(t) + mean_left(depth - t)) * depth / 1000;
    }
    for (int i = 0; i < 2; i++) {
        /* The sun stands behind the slab's edge: what comes from it straight is as good as nothing. */
        const double sun = 200, sine = sin(1 * (M_PI / 180)), sky = i ? 0.5 : 0,
                     ground = 0.13 * (sky + 0.5 * sun * sine), truth = ALBEDO * share * 0.5 * (sky + ground);
        char text[1024];
        double mean = 0;
        snprintf(text, sizeof text, slab_text, 90.0, 1, "200, 200, 200", skies[i], skies[i]);
        draw(text, depth, 0, 16, red);
        for (int p = 0; p < WIDTH_PX * HEIGHT_PX; p++)
            mean += (double)red[p] / (WIDTH_PX * HEIGHT_PX);
        /* The sky itself is seen through the slab. */
        print_message("# light from around, sky %g: %.5f of %.5f (%+.2f %%)\n", sky, mean - sky * exp(-depth), truth,
                      100 * ((mean - sky * exp(-depth)) / truth - 1));
        assert_true(fabs((mean - sky * exp(-depth)) / truth - 1) < 0.02);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(sun_is_scattered_once),
                                       cmocka_unit_test(what_comes_from_around_is_scattered_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
