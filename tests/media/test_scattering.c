/* Scattering in pictures against paths of light in double (karst_reference_scatter): once, and as often as it is. */
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
#include "karst/reference.h"

/* From the repository's root, as tests are run. */
static const char world[] = "docs/accuracy/cloud.karst";

static bool is_full(void) { return getenv("KARST_TEST_FULL") != NULL; }

typedef struct {
    int width_px, height_px;
    double detail_px;
    uint32_t samples;
    karst_scattering scattering;
    int lanes;
    double depth, g;
    const char *world; /* NULL: the cloud of that depth and g */
    const char *dark;  /* may be NULL: the same world with a medium that scatters nothing, for what is seen behind it */
} setting;

static const char *world_of(const setting *s) { return s->world ? s->world : world; }

static void draw(const setting *s, const char *drawn, float *light)
{
    const karst_parameter parameters[] = {{"depth", s->depth}, {"forward", s->g}};
    const karst_engine_config config = {.world = drawn,
                                        .parameters = parameters,
                                        .num_parameters = s->world ? 0 : 2,
                                        .pool_bytes = (uint64_t)128 << 20,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = s->width_px,
                                        .height_px = s->height_px,
                                        .detail_px = s->detail_px,
                                        .samples = s->samples,
                                        .tone = KARST_TONE_OF_FILM,
                                        .scattering = s->scattering,
                                        .lanes = s->lanes};
    karst_error error = {0};
    bool settled = false;
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_settle(engine, 2000 + 4 * s->samples, NULL, NULL, &settled, &error) ||
        !karst_engine_read_radiance(engine, light, (size_t)s->width_px * (size_t)s->height_px * 3, &error))
        fail_msg("%s", error.message);
    assert_true(settled);
    karst_engine_destroy(engine);
}

/* What the pictures differ by, as shares of the truth's mean: their means, and rms without the truth's own noise. */
static void compare(const setting *s, uint32_t paths_px, uint32_t max_bounces, double *bias, double *rms, double *noise)
{
    const size_t num = (size_t)s->width_px * (size_t)s->height_px * 3;
    const karst_parameter parameters[] = {{"depth", s->depth}, {"forward", s->g}};
    const karst_reference_config config = {.world = world_of(s),
                                           .parameters = parameters,
                                           .num_parameters = s->world ? 0 : 2,
                                           .width_px = s->width_px,
                                           .height_px = s->height_px};
    const karst_reference_light light = {.paths_px = paths_px,
                                         .max_bounces = max_bounces,
                                         .spread_px = s->samples > 1,
                                         .max_nodes = 16384,
                                         .around_of_world = true};
    float *seen = calloc(2 * num, sizeof *seen), *behind = seen + num;
    double *truth = calloc(2 * num, sizeof *truth), *deviation = truth + num;
    double mean = 0, off = 0, squares = 0, noises = 0;
    karst_error error = {0};
    assert_true(seen && truth);
    if (!karst_reference_scatter(&config, &light, truth, deviation, NULL, NULL, NULL, &error))
        fail_msg("%s", error.message);
    draw(s, world_of(s), seen);
    if (s->dark)
        draw(s, s->dark, behind);
    for (size_t i = 0; i < num; i++) {
        const double d = (double)seen[i] - (double)behind[i] - truth[i];
        mean += truth[i] / (double)num;
        off += d / (double)num;
        squares += d * d / (double)num;
        noises += deviation[i] * deviation[i] / (double)num;
    }
    *bias = off / mean;
    *rms = sqrt(fmax(squares - noises, 0)) / mean;
    *noise = sqrt(noises) / mean;
    print_message("# depth %g, g %g, %dx%d: mean %.4f, bias %+.2f %%, rms %.2f %%, the truth's own noise %.2f %%\n",
                  s->depth, s->g, s->width_px, s->height_px, mean, 100 * *bias, 100 * *rms, 100 * *noise);
    free(seen);
    free(truth);
}

static void light_scattered_once_is_right(void **state)
{
    (void)state;
    const bool full = is_full();
    setting s = {.width_px = full ? 64 : 24,
                 .height_px = full ? 48 : 18,
                 .detail_px = 0.25,
                 .samples = 1,
                 .scattering = KARST_SCATTERING_ONCE,
                 .depth = 3,
                 .g = 0.5};
    double bias, rms, noise;
    compare(&s, full ? 4000 : 200, 1, &bias, &rms, &noise);
    assert_true(fabs(bias) < (full ? 0.01 : 0.03) && rms < (full ? 0.01 : 0.15));
}

/* A thick cloud with waves as wide as itself, lit from the side. The sun stands high enough that the ground throws
 * back a sixth as much light as comes from it straight. `%s`: of the sky, and the
 * albedo. */
#define SIDE_LIT                                                                                                   \
    "/*{ \"voxel\": 0.015625, \"view\": 200, \"sun\": { \"azimuth\": %d, \"elevation\": 30,\n"                      \
    "\"colour\": [1, 2, 1.5] },\n"                                                                                \
    "\"sky\": { \"zenith\": [%s], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"                                       \
    "\"camera\": { \"position\": [\"0\", \"0\", \"-6\"], \"fov\": 40 } }*/\n"                                        \
    "float density(vec3 p) { return -1.0; }\n"                                                                     \
    "medium air(vec3 p) { medium m; m.albedo = vec3(%s); m.g = 0.3; m.extinction = 8.0 * clamp(1.4 - length(p) +\n" \
    "0.2 * sin(4.0 * p.x) * sin(4.0 * p.y) * sin(4.0 * p.z), 0.0, 1.0); return m; }\n"

static void light_from_around_is_scattered_once(void **state)
{
    (void)state;
    if (!is_full())
        skip();
    for (int sky = 0; sky < 2; sky++) {
        char paths[2][32] = {"/tmp/karst-side-XXXXXX.karst", "/tmp/karst-dark-XXXXXX.karst"}, text[1024];
        for (int dark = 0; dark < 2; dark++) {
            const int length = snprintf(text, sizeof text, SIDE_LIT, sky ? 240 : 120, sky ? "0.4, 0.3, 0.6" : "0, 0, 0",
                                        dark ? "0.0" : "0.9");
            const int fd = mkstemps(paths[dark], 6);
            assert_true(fd >= 0 && write(fd, text, (size_t)length) == length);
            close(fd);
        }
        const setting s = {.width_px = 64,
                           .height_px = 48,
                           .detail_px = 0.25,
                           .samples = 16,
                           .scattering = KARST_SCATTERING_ONCE,
                           .world = paths[0],
                           .dark = paths[1]};
        double bias, rms, noise;
        compare(&s, 2000, 1, &bias, &rms, &noise);
        unlink(paths[0]), unlink(paths[1]);
        assert_true(fabs(bias) < 0.01 && rms < 0.02);
    }
}

static void light_scattered_often_is_right(void **state)
{
    (void)state;
    const bool full = is_full();
    setting s = {.width_px = full ? 64 : 32,
                 .height_px = full ? 48 : 24,
                 .detail_px = 0.25,
                 .samples = full ? 1024 : 8,
                 .scattering = KARST_SCATTERING_PATHS,
                 .depth = 10};
    double bias, rms, noise;
    compare(&s, full ? 1000 : 80, 0, &bias, &rms, &noise);
    assert_true(fabs(bias) < 0.05 && rms < (full ? 0.1 : 0.7));
    static const double depths[] = {1, 100}, g[] = {0, 0.85};
    for (int i = 0; full && i < 4; i++) {
        s.depth = depths[i % 2];
        s.g = g[i / 2];
        compare(&s, 1000, 0, &bias, &rms, &noise);
        assert_true(fabs(bias) < 0.05 && rms < 0.1);
    }
}

/* Paths go the same way whoever follows them. */
static void lanes_leave_no_trace(void **state)
{
    (void)state;
    setting s = {.width_px = 12, .height_px = 9, .samples = 2, .scattering = KARST_SCATTERING_PATHS, .depth = 10,
                 .g = 0.85};
    float sixteen[12 * 9 * 3], one[12 * 9 * 3];
    draw(&s, world, sixteen);
    s.lanes = 1;
    draw(&s, world, one);
    assert_memory_equal(sixteen, one, sizeof one);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(light_scattered_once_is_right),
                                       cmocka_unit_test(light_from_around_is_scattered_once),
                                       cmocka_unit_test(light_scattered_often_is_right),
                                       cmocka_unit_test(lanes_leave_no_trace)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
