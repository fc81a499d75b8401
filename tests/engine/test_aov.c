/* What is known of pixels, in a world where it follows from geometry; with one sample and with several. */
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

enum { WIDTH = 64, HEIGHT = 48, NUM = WIDTH * HEIGHT };

#define HEAD_UNDER(sky) \
    "/*{ \"voxel\": 0.0625, \"view\": 60,\n" \
    "\"sky\": { " sky " },\n" \
    "\"camera\": { \"position\": [\"3\", \"4\", \"-5\"],\n" \
    "\"yaw\": 10, \"pitch\": -20 } }*/\n" \
    "float density(vec3 p) { return max(-p.y, 2.0 - length(p - vec3(5.0, 1.0, 5.0))); }\n" \
    "vec3 colour(vec3 p, vec3 n) { return vec3(0.6, 0.15, n.y > 0.99 ? 0.1 : 0.4); }\n"

#define HEAD HEAD_UNDER("\"zenith\": [0.1, 0.2, 0.5], \"horizon\": [0.5, 0.6, 0.7], \"haze\": 1e6")
/* The second: the same, but the ball gives off so much blue light, and all is a half mirror. The third: the first under
 * an atmosphere. */
#define GLOW 2.0
static const char *const texts[3] = {HEAD, HEAD "material surface(vec3 p, vec3 n) {\n"
                                                "    material m;\n"
                                                "    m.colour = colour(p, n);\n"
                                                "    m.emission.z = p.y > 0.2 ? 2.0 : -1.0;\n"
                                                "    m.mirror = 0.5;\n"
                                                "    return m;\n"
                                                "}\n",
                                      HEAD_UNDER("\"model\": \"atmosphere\"")};

static float *read_aov(karst_engine *engine, karst_aov aov)
{
    karst_error error = {0};
    const size_t num = (size_t)(NUM * karst_aov_width(aov));
    float *values = malloc(num * sizeof *values);
    assert_non_null(values);
    if (!karst_engine_read_aov(engine, aov, values, num, &error))
        fail_msg("%s", error.message);
    assert_false(karst_engine_read_aov(engine, aov, values, num - 1, &error));
    return values;
}

static void check(karst_engine *engine, unsigned samples)
{
    float *albedo = read_aov(engine, KARST_AOV_ALBEDO), *depth = read_aov(engine, KARST_AOV_DEPTH),
          *normal = read_aov(engine, KARST_AOV_NORMAL), *position = read_aov(engine, KARST_AOV_POSITION),
          *level = read_aov(engine, KARST_AOV_LEVEL), *number = read_aov(engine, KARST_AOV_SAMPLES),
          *radiance = read_aov(engine, KARST_AOV_RADIANCE);
    int num_hits = 0, num_ball = 0;
    for (int i = 0; i < NUM; i++) {
        const float *p = position + 3 * i, *n = normal + 3 * i, *a = albedo + 3 * i;
        assert_true(number[i] == (float)samples && radiance[3 * i + 2] > 0);
        if (isinf(depth[i])) {
            assert_true(level[i] == -1 && a[0] == 0 && n[0] == 0 && n[1] == 0 && p[2] == 0);
            continue;
        }
        num_hits++;
        const double way[3] = {(double)p[0] - 3, (double)p[1] - 4, (double)p[2] + 5};
        const double length = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
        assert_true(fabs(length - (double)depth[i]) < 1e-4 * length);
        assert_true(level[i] >= 0 && fabs((double)a[0] - 0.6) < 1e-5 && fabs((double)a[1] - 0.15) < 1e-5);
        assert_true(a[2] < 0.4f + 1e-5f);
        const double ball = fabs(hypot(hypot((double)p[0] - 5, (double)p[1] - 1), (double)p[2] - 5) - 2);
        /* On the ground or on the ball, to less than a voxel, with its normal. */
        assert_true(fmin(fabs((double)p[1]), ball) < 0.1);
        if (ball > 0.5) {
            assert_true(n[1] > 0.99f);
        } else if (p[1] > 0.5f) {
            num_ball++;
            const double along =
                (((double)p[0] - 5) * (double)n[0] + ((double)p[1] - 1) * (double)n[1] +
                 ((double)p[2] - 5) * (double)n[2]) / 2;
            assert_true(along > 0.98);
        }
    }
    assert_true(num_hits > NUM / 3 && num_hits < NUM && num_ball > 100);
    float *const all[] = {albedo, depth, normal, position, level, number, radiance};
    for (int i = 0; i < 7; i++)
        free(all[i]);
}

/* Settles a picture of a text and checks it; its radiance, which is the caller's. */
static float *check_text(const char *text, unsigned samples, double mirror)
{
    char path[] = "/tmp/karst-aov-XXXXXX.karst";
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    karst_error error = {0};
    bool settled = false;
    const karst_engine_config config = {.world = path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)64 << 20,
                                        .samples = samples,
                                        .mirror = mirror,
                                        .tone = KARST_TONE_OF_FILM};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_settle(engine, 400, NULL, NULL, &settled, &error))
        fail_msg("%s", error.message);
    assert_true(settled);
    check(engine, samples);
    check(engine, samples); /* reading changes nothing */
    float *radiance = read_aov(engine, KARST_AOV_RADIANCE);
    karst_engine_destroy(engine);
    unlink(path);
    return radiance;
}

static void values_follow_from_geometry(void **state)
{
    (void)state;
    for (unsigned samples = 1; samples <= 4; samples += 3)
        free(check_text(texts[0], samples, 0));
}

/* What a surface gives off is added to its light, also in the shade, and is no part of its albedo. Light that is less
 * than none is none. */
static void surfaces_glow(void **state)
{
    (void)state;
    float *dark = check_text(texts[0], 1, -1), *bright = check_text(texts[1], 1, -1);
    int num_bright = 0, num_between = 0; /* comparisons of places have edges as wide as a voxel */
    for (int i = 0; i < 3 * NUM; i++) {
        const double more = (double)bright[i] - (double)dark[i];
        assert_true(more > -1e-5 && more < (i % 3 == 2 ? GLOW + 1e-5 : 1e-5));
        num_bright += more > 0.9 * GLOW;
        num_between += more > 1e-5 && more <= 0.9 * GLOW;
    }
    print_message("%d pixels give off light, %d some of it\n", num_bright, num_between);
    assert_true(num_bright > 100 && num_bright < NUM / 4 && num_between < num_bright / 4);
    free(dark);
    free(bright);
}

/* Nor is what they mirror, or the air before them. */
static void albedos_are_the_surfaces_own(void **state)
{
    (void)state;
    free(check_text(texts[1], 1, 0));
    free(check_text(texts[2], 1, 0));
    free(check_text(texts[2], 1, 0.5));
}

static void names_are_known(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_aov aov = KARST_AOV_RADIANCE;
    assert_true(karst_aov_parse("level", &aov, &error) && aov == KARST_AOV_LEVEL);
    assert_string_equal(karst_aov_channel(KARST_AOV_NORMAL, 2), "N.Z");
    assert_false(karst_aov_parse("shadow", &aov, &error));
    assert_non_null(strstr(error.message, "albedo"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(values_follow_from_geometry), cmocka_unit_test(surfaces_glow),
                                       cmocka_unit_test(albedos_are_the_surfaces_own),
                                       cmocka_unit_test(names_are_known)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
