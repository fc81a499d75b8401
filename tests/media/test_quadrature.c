/* Light that the ragged cloud of docs/accuracy scatters once, against quadrature in double along the same rays: the
 * extinction is the world's own there, without bricks, levels or chance. */
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

/* From the repository's root, as tests are run. */
static const char cloud[] = "docs/accuracy/cloud.karst";
/* Of the cloud. The sun stands at its horizon: the ground throws nothing back, and the sky is black. */
#define SUN_AZIMUTH_DEG 120.0
#define WHOLE_FOV_DEG 40.0
#define EYE_M (-70.0)
#define ALBEDO 0.99
/* Nothing of it lies farther from the middle: 20 m times 1.1 and what 0.35 times three octaves add. */
#define RADIUS_M 36.0

static bool is_full(void) { return getenv("KARST_TEST_FULL") != NULL; }

/* The cloud in a sun of colour 1, in a file of its own. */
static void write_world(char *path, double fov_deg)
{
    static char text[4096], white[4200], seen[4300];
    static const char sun[] = "\"elevation\": 0 }", fov[] = "\"fov\": 40 ";
    FILE *file = fopen(cloud, "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = 0;
    fclose(file);
    const char *at = strstr(text, sun);
    assert_non_null(at);
    snprintf(white, sizeof white, "%.*s\"elevation\": 0, \"colour\": [1, 1, 1] }%s", (int)(at - text), text,
             at + strlen(sun));
    at = strstr(white, fov);
    assert_non_null(at);
    const int length =
        snprintf(seen, sizeof seen, "%.*s\"fov\": %.9f %s", (int)(at - white), white, fov_deg, at + strlen(fov));
    const int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, seen, (size_t)length) == length);
    close(fd);
}

static void draw(const char *world, double depth, double g, int width_px, int height_px, float *light)
{
    const karst_parameter parameters[] = {{"depth", depth}, {"forward", g}, {"white", ALBEDO}};
    const karst_engine_config config = {.world = world,
                                        .parameters = parameters,
                                        .num_parameters = 3,
                                        .pool_bytes = (uint64_t)192 << 20,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = width_px,
                                        .height_px = height_px,
                                        .detail_px = 0.25,
                                        .samples = 1,
                                        .tone = KARST_TONE_OF_FILM,
                                        .scattering = KARST_SCATTERING_ONCE};
    bool settled = false;
    karst_error why = {0};
    karst_engine *engine = karst_engine_create(&config, &why);
    if (!engine || !karst_engine_settle(engine, 2000, NULL, NULL, &settled, &why) ||
        !karst_engine_read_radiance(engine, light, (size_t)width_px * (size_t)height_px * 3, &why))
        fail_msg("%s", why.message);
    assert_true(settled);
    karst_engine_destroy(engine);
}

/* ---- quadrature ---- */

/* Of a cloud of depth 1: others are as deep as many of it. */
static double extinction(karst_sampler *sampler, const double from[3], const double d[3], double t)
{
    const double at_m[3] = {from[0] + d[0] * t, from[1] + d[1] * t, from[2] + d[2] * t};
    const karst_position at = karst_position_add_m((karst_position){{0}, {0}}, at_m, -3);
    return fmax(karst_sampler_precise_density(sampler, &at, 0), 0);
}

/* Where a ray is in the ball that holds the cloud. */
static bool cross(const double from[3], const double d[3], double way[2])
{
    double b = 0, c = -RADIUS_M * RADIUS_M;
    for (int a = 0; a < 3; a++) {
        b += from[a] * d[a];
        c += from[a] * from[a];
    }
    const double half = sqrt(fmax(b * b - c, 0));
    way[0] = fmax(-b - half, 0);
    way[1] = -b + half;
    return b * b > c && way[1] > way[0];
}

/* The unit cloud's depth from a place to the sun: steps are a tenth as long where the way begins as where it ends. */
#define SUN_STEPS 96
static double depth_to_sun(karst_sampler *sampler, const double from[3], const double sun[3])
{
    double way[2], sum = 0;
    if (!cross(from, sun, way))
        return 0;
    for (int i = 0; i < SUN_STEPS; i++) {
        const double share = (i + 0.5) / SUN_STEPS, t = way[1] * share * (0.2 + 0.8 * share);
        sum += way[1] / SUN_STEPS * (0.2 + 1.6 * share) * extinction(sampler, from, sun, t);
    }
    return sum;
}

#define WAY_STEPS 1200
#define PLACES 64
/* What pixels show of clouds of some depths. Places are the middles of equal shares of what is lost on the ray. */
static void scattered(karst_sampler *sampler, const double d[3], const double sun[3], double g, const double *depths,
                      int num_depths, double *light)
{
    static double before[WAY_STEPS + 1];
    const double from[3] = {0, 0, EYE_M};
    double way[2], cosine = 0;
    memset(light, 0, (size_t)num_depths * sizeof *light);
    if (!cross(from, d, way))
        return;
    const double step = (way[1] - way[0]) / WAY_STEPS;
    for (int i = 0; i < WAY_STEPS; i++)
        before[i + 1] = before[i] + step * extinction(sampler, from, d, way[0] + (i + 0.5) * step);
    for (int a = 0; a < 3; a++)
        cosine += d[a] * sun[a];
    const double q = 1 + g * g - 2 * g * cosine, phase = 0.25 * (1 - g * g) / (q * sqrt(q)), whole = before[WAY_STEPS];
    for (int k = 0; k < num_depths && whole > 0; k++) {
        const double lost = 1 - exp(-depths[k] * whole);
        int at = 0;
        for (int i = 0; i < PLACES; i++) {
            const double depth = -log(1 - lost * (i + 0.5) / PLACES) / depths[k];
            while (at < WAY_STEPS - 1 && before[at + 1] < depth)
                at++;
            const double t = way[0] + step * (at + (depth - before[at]) / fmax(before[at + 1] - before[at], 1e-12));
            const double here[3] = {from[0] + d[0] * t, from[1] + d[1] * t, from[2] + d[2] * t};
            light[k] += lost / PLACES * exp(-depths[k] * depth_to_sun(sampler, here, sun));
        }
        light[k] *= ALBEDO * phase;
    }
}

/* Through the middle of a pixel. */
static void direction_of(int x, int y, int width_px, int height_px, double fov_deg, double d[3])
{
    const double half = tan(fov_deg / 2 * (M_PI / 180));
    d[0] = (2 * (x + 0.5) / width_px - 1) * half * width_px / height_px;
    d[1] = (1 - 2 * (y + 0.5) / height_px) * half;
    d[2] = 1;
    const double length = sqrt(d[0] * d[0] + d[1] * d[1] + 1);
    for (int a = 0; a < 3; a++)
        d[a] /= length;
}

typedef struct {
    int width_px, height_px, each; /* one pixel of so many on each side is looked at */
    double g;
} view;

/* Pixels are as wide as of all of the cloud in 64x48, whatever the view's size. */
static void compare(const view *v, const double *depths, int num_depths)
{
    const int width_px = v->width_px, height_px = v->height_px, each = v->each;
    const double g = v->g, whole = tan(WHOLE_FOV_DEG / 2 * (M_PI / 180)),
                 fov_deg = 2 * atan(whole * height_px / 48) * (180 / M_PI);
    char world[] = "/tmp/karst-quadrature-XXXXXX.karst";
    write_world(world, fov_deg);
    const karst_parameter parameters[] = {{"depth", 1}};
    const karst_world_config config = {
        .world = world, .parameters = parameters, .num_parameters = 1, .part = KARST_WORLD_AIR};
    const double sun[3] = {sin(SUN_AZIMUTH_DEG * (M_PI / 180)), 0, cos(SUN_AZIMUTH_DEG * (M_PI / 180))};
    const size_t num = (size_t)width_px * (size_t)height_px;
    double *truth = calloc(num * (size_t)num_depths, sizeof *truth);
    float *light = calloc(3 * num, sizeof *light);
    karst_world *air;
    karst_sampler *sampler;
    assert_true(truth && light);
    assert_ok(air = karst_world_open(&config, &error));
    assert_ok(sampler = karst_sampler_create(air, &error));
    for (int y = each / 2; y < height_px; y += each)
        for (int x = each / 2; x < width_px; x += each) {
            double d[3];
            direction_of(x, y, width_px, height_px, fov_deg, d);
            scattered(sampler, d, sun, g, depths, num_depths, &truth[(size_t)(y * width_px + x) * (size_t)num_depths]);
        }
    karst_sampler_destroy(sampler);
    karst_world_close(air);
    for (int k = 0; k < num_depths; k++) {
        double mean = 0, off = 0, squares = 0;
        int count = 0;
        draw(world, depths[k], g, width_px, height_px, light);
        for (int y = each / 2; y < height_px; y += each)
            for (int x = each / 2; x < width_px; x += each, count++) {
                const size_t at = (size_t)(y * width_px + x);
                const double expected = truth[at * (size_t)num_depths + (size_t)k],
                             apart = (double)light[3 * at] - expected;
                mean += expected;
                off += apart;
                squares += apart * apart;
            }
        mean /= count;
        print_message("# depth %g, g %g, %d of %dx%d pixels: mean %.5f, bias %+.3f %%, rms %.3f %%\n", depths[k], g,
                      count, width_px, height_px, mean, 100 * off / count / mean, 100 * sqrt(squares / count) / mean);
        assert_true(mean > 0.001 && fabs(off / count) < 0.01 * mean && sqrt(squares / count) < 0.01 * mean);
    }
    unlink(world);
    free(truth);
    free(light);
}

static void light_scattered_once_is_that_of_quadrature(void **state)
{
    (void)state;
    static const double depths[] = {10, 1, 100};
    if (is_full()) {
        compare(&(view){.width_px = 64, .height_px = 48, .each = 1}, depths, 3);
        compare(&(view){.width_px = 64, .height_px = 48, .each = 2, .g = 0.5}, depths, 3);
    } else {
        compare(&(view){.width_px = 16, .height_px = 12, .each = 2, .g = 0.5}, depths, 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(light_scattered_once_is_that_of_quadrature)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
