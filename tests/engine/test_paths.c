/* Full light and lights: what closed forms say of them, and what pictures of them depend on. */
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

#include "karst/edit.h"
#include "karst/karst.h"
#include "tests/support/scene.h"

enum { WIDTH = 48, HEIGHT = 36, NUM = WIDTH * HEIGHT };

static char path[64];

static karst_engine_config config_of(const char *text, uint32_t samples)
{
    snprintf(path, sizeof path, "/tmp/karst-paths-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    return (karst_engine_config){.world = path,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .exposure = KARST_EXPOSURE_GIVEN,
                                 .integrator = KARST_INTEGRATOR_FULL,
                                 .samples = samples,
                                 .pool_bytes = (uint64_t)48 << 20};
}

static karst_stats stats;
static void settle(karst_engine *engine, float light[3 * NUM])
{
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 2000, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &stats);
    assert_true(settled && stats.settled);
    assert_ok(karst_engine_read_radiance(engine, light, 3 * NUM, &error));
}

static void take(const karst_engine_config *config, float light[3 * NUM])
{
    karst_engine *engine = scene_open(config);
    settle(engine, light);
    karst_engine_destroy(engine);
}

static float light[3 * NUM], other[3 * NUM];

#define NIGHT "\"voxel\": 0.015625, \"view\": 60, \"sun\": { \"colour\": [0, 0, 0] }"
#define WHITE_SKY "\"sky\": { \"zenith\": [1, 1, 1], \"horizon\": [1, 1, 1] }"
#define BLACK_SKY "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0] }"
#define CAMERA "\"camera\": { \"position\": [\"0\", \"1.5\", \"-7\"], \"pitch\": -8, \"fov\": 60 }"

/* A ball, a bowl, a wall on a disc. */
#define SHAPES                                                                                         \
    "float density(vec3 p) {\n"                                                                        \
    "  float ball = 1.0 - length(p - vec3(-1.7, 1.0, 0.0));\n"                                         \
    "  float bowl = min(1.3 - length(p - vec3(1.4, 1.0, 0.0)), length(p - vec3(1.4, 1.3, -0.3)) - 1.1);\n" \
    "  float wall = min(0.15 - abs(p.z - 2.0), 3.0 - length(p));\n"                                    \
    "  return max(max(ball, bowl), max(min(-p.y, 12.0 - length(p)), wall)); }\n"

/* What does not absorb is as bright as its sky, wherever it is: and so it cannot be seen. Half of it mirrors, duller
 * higher up. */
static void white_is_not_seen_in_a_furnace(void **state)
{
    (void)state;
    karst_engine_config config = config_of("/*{ " NIGHT ", " WHITE_SKY ", " CAMERA " }*/\n" SHAPES
                                           "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(1.0); "
                                           "m.mirror = p.x > 0.0 ? 0.5 : 0.0; m.gloss = 0.3 * max(p.y, 0.0); "
                                           "return m; }\n",
                                           1);
    config.bounces = 400;
    config.detail_px = 0.5; /* else voxels are as wide as the gap between bowl and wall, and light is caught there */
    for (int centres = 0; centres < 2; centres++) {
        take(&config, light);
        float least = INFINITY, most = 0;
        for (int i = 0; i < 3 * NUM; i++) {
            least = fminf(least, light[i]);
            most = fmaxf(most, light[i]);
        }
        print_message("from %.6f to %.6f; %d of %d pixels hit, %d rays went on\n", (double)least, (double)most,
                      (int)stats.num_hits, NUM, (int)stats.num_rays[KARST_STREAM_MIRROR]);
        assert_true(stats.num_hits > NUM / 2);
        assert_true(centres || (double)stats.num_rays[KARST_STREAM_MIRROR] > 1.2 * (double)stats.num_hits);
        config.samples = 3;
        assert_true(least > 1 - 1.0f / 255 && most < 1 + 1.0f / 255);
    }
    unlink(path);
}

static double mean_of(const float *values)
{
    double sum = 0;
    for (int i = 0; i < 3 * NUM; i++)
        sum += (double)values[i];
    return sum / (3 * NUM);
}

/* In a hollow ball that glows, light adds up: emission / (1 - albedo). Where nothing glows it is black, whatever is
 * outside. */
static void light_adds_up_in_a_hollow(void **state)
{
    (void)state;
    static const double albedos[] = {0, 0.5, 0.8, 0.8};
    karst_engine_config config = config_of(
        "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"elevation\": 60 }, " WHITE_SKY
        ", \"params\": { \"grey\": 0.5, \"glow\": 0.25 },\n"
        "\"camera\": { \"position\": [\"0.3\", \"0.2\", \"-0.4\"], \"fov\": 80 } }*/\n"
        "float density(vec3 p) { return length(p) - 1.5; }\n"
        "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(grey); m.emission = vec3(glow); return m; }\n",
        32);
    for (int i = 0; i < 4; i++) {
        const bool dark = i == 3;
        const double albedo = albedos[i];
        const karst_parameter values[] = {{"grey", albedo}, {"glow", dark ? 0 : 0.25}};
        config.parameters = values;
        config.num_parameters = 2;
        take(&config, light);
        const double truth = dark ? 0 : 0.25 / (1 - albedo);
        print_message("albedo %g: mean %.5f of %.5f\n", albedo, mean_of(light), truth);
        assert_int_equal(stats.num_hits, NUM);
        /* Haze, of which there is next to none, is as bright as the sky. */
        assert_true(fabs(mean_of(light) - truth) <= 0.01 * truth + 1e-5);
    }
    unlink(path);
}

/* Before an endless black wall of a height, the ground sees that much less of the sky; and the sun shines on it or
 * not. A third of it mirrors what is above. */
static void a_wall_takes_its_share(void **state)
{
    (void)state;
    const double height_m = 1.5, albedo = 0.6, mirror = 0.3, eye_m = 6;
    karst_engine_config config = config_of(
        "/*{ " NIGHT ", \"lights\": [{ \"kind\": \"sun\", \"colour\": [0.5, 0.5, 0.5], \"azimuth\": 90, "
        "\"elevation\": 45 }], " WHITE_SKY
        ", \"camera\": { \"position\": [\"-2\", \"6\", \"0\"], \"pitch\": -90, \"fov\": 30 } }*/\n"
        "float density(vec3 p) { return max(-p.y, min(1.5 - p.y, 0.5 - abs(p.x - 0.5))); }\n"
        "material surface(vec3 p, vec3 n) { material m; float ground = n.y < 0.5 || p.y > 0.4 ? 0.0 : 1.0;\n"
        "m.colour = vec3(0.6 * ground); m.mirror = 0.3 * ground; return m; }\n",
        128);
    config.detail_px = 0.25; /* the wall's edge is as sharp as its voxels */
    take(&config, light);
    unlink(path);
    double sum = 0, sum_truth = 0, worst = 0;
    int num = 0;
    for (int x = 0; x < WIDTH; x++) {
        /* Looking down, right is towards x. */
        const double away_m = 2 - ((x + 0.5) / WIDTH - 0.5) * 2 * tan(15 * M_PI / 180) * eye_m * WIDTH / HEIGHT;
        /* Nearer the mirror shows the wall; at a wall's height from it the sun comes over its edge. */
        if (away_m < 0.5 || fabs(away_m - height_m) < 0.1)
            continue;
        const double seen = 1 - 0.5 * (1 - away_m / hypot(away_m, height_m));
        const double sun = away_m > height_m ? 0.5 * sqrt(0.5) : 0;
        const double truth = (1 - mirror) * albedo * (seen + sun) + mirror;
        double column = 0;
        for (int y = 0; y < HEIGHT; y++)
            column += (double)light[3 * (y * WIDTH + x)] / HEIGHT;
        worst = fmax(worst, fabs(column - truth) / truth);
        sum += column;
        sum_truth += truth;
        num++;
    }
    print_message("%d columns before a wall: mean %.5f of %.5f, worst column %.4f off\n", num, sum / num,
                  sum_truth / num, worst);
    assert_true(num > WIDTH / 2);
    assert_true(fabs(sum / sum_truth - 1) < 0.006 && worst < 0.03);
}

#define LIT(lights)                                                                                      \
    "/*{ " NIGHT ", " BLACK_SKY ", \"lights\": [" lights "],\n"                                          \
    "\"camera\": { \"position\": [\"0\", \"6\", \"0\"], \"pitch\": -90, \"fov\": 60 } }*/\n"              \
    "float density(vec3 p) { return -p.y; }\nvec3 colour(vec3 p, vec3 n) { return vec3(0.5); }\n"

/* What a point throws on the ground is its colour times the cosine over the distance squared; a spot no more than that,
 * and nothing out of its cone. The same in both kinds of light, within what half floats of albedo may do. */
static void lights_are_as_bright_as_they_say(void **state)
{
    (void)state;
    static const char *const texts[] = {
        LIT("{ \"kind\": \"point\", \"position\": [0.5, 2, 0], \"colour\": [4, 2, 1], \"radius\": 0 }"),
        LIT("{ \"kind\": \"spot\", \"position\": [0.5, 2, 0], \"colour\": [4, 2, 1], \"radius\": 0, \"angle\": 60, "
            "\"soft\": 0 }"),
        LIT("{ \"kind\": \"sun\", \"elevation\": 30, \"colour\": [4, 2, 1] }"),
        LIT("{ \"position\": [0.5, 2, 0], \"colour\": [4, 2, 1], \"radius\": 0, \"shadow\": false }"),
    };
    for (int i = 0; i < 8; i++) {
        karst_engine_config config = config_of(texts[i / 2], i % 2 ? 1 : 4);
        config.integrator = i % 2 ? KARST_INTEGRATOR_DIRECT : KARST_INTEGRATOR_FULL;
        take(&config, light);
        unlink(path);
        int num_lit = 0;
        double sum = 0, sum_truth = 0, worst = 0;
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                const double tangent = tan(M_PI / 6), size = 2.0 / HEIGHT;
                /* Looking down, right is towards x. */
                const double px = ((x + 0.5) * size - (double)WIDTH / HEIGHT) * tangent * 6,
                             pz = (1 - (y + 0.5) * size) * tangent * 6;
                const double square = (px - 0.5) * (px - 0.5) + 4 + pz * pz, cosine = 2 / sqrt(square);
                double truth = 0.5 * 4 * cosine / square;
                if (i / 2 == 2)
                    truth = 0.5 * 4 * 0.5;
                const double edge = cosine - cos(M_PI / 6);
                if (i / 2 == 1 && fabs(edge) < 0.03)
                    continue;
                if (i / 2 == 1 && edge < 0)
                    truth = 0;
                const float *rgb = &light[3 * (y * WIDTH + x)];
                assert_true(fabs((double)rgb[1] * 2 - (double)rgb[0]) < 1e-5);
                sum += (double)rgb[0];
                sum_truth += truth;
                num_lit += truth > 0;
                worst = fmax(worst, fabs((double)rgb[0] - truth));
            }
        print_message("kind %d, %s: %d lit, mean %.5f of %.5f, worst %.5f\n", i / 2, i % 2 ? "direct" : "full", num_lit,
                      sum / NUM, sum_truth / NUM, worst);
        assert_true(num_lit > (i / 2 == 1 ? 50 : NUM / 2));
        assert_true(fabs(sum / sum_truth - 1) < 0.005 && worst < 0.02);
    }
}

#define FIRST_LAMP "{ \"position\": [0.5, 2, 0], \"colour\": [4, 2, 1], \"radius\": 0 }"

/* Rays go to lamps that reach what is seen, and to those places alone. */
static void only_lamps_that_reach_are_cast(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text;
        int num_rays; /* -1: fewer than pixels, and some */
    } cases[] = {
        {"one", LIT(FIRST_LAMP), NUM},
        {"and one below the ground", LIT(FIRST_LAMP ", { \"position\": [0, -2, 0] }"), NUM},
        {"and one that is black", LIT(FIRST_LAMP ", { \"position\": [0, 3, 0], \"colour\": [0, 0, 0] }"), NUM},
        {"and one far away", LIT(FIRST_LAMP ", { \"position\": [0, 3000, 0] }"), NUM},
        {"and a sun that has set", LIT(FIRST_LAMP ", { \"kind\": \"sun\", \"elevation\": -5 }"), NUM},
        {"and one without shadows", LIT(FIRST_LAMP ", { \"position\": [0, 2, 0], \"shadow\": false }"), NUM},
        {"and two more", LIT(FIRST_LAMP ", { \"position\": [0, 3, 0] }, { \"position\": [1, 3, 0] }"), 3 * NUM},
        {"a spot on a part", LIT("{ \"kind\": \"spot\", \"position\": [0.5, 2, 0], \"angle\": 60, \"soft\": 0 }"), -1},
        {"none", LIT(""), 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        karst_engine_config config = config_of(cases[i].text, 1);
        config.integrator = KARST_INTEGRATOR_DIRECT;
        take(&config, light);
        unlink(path);
        const int num = (int)stats.num_rays[KARST_STREAM_SHADOW];
        print_message("%s: %d rays to lamps of %d pixels\n", cases[i].name, num, NUM);
        if (cases[i].num_rays < 0)
            assert_true(num > NUM / 20 && num < NUM / 2);
        else
            assert_int_equal(num, cases[i].num_rays);
    }
}

#define LAMPS 9
/* The text of SHAPES with the lamps whose bits are set, every third of which casts no shadow. */
static void lamps_text(char *text, size_t size_bytes, unsigned which)
{
    int at = snprintf(text, size_bytes, "/*{ " NIGHT ", " BLACK_SKY ", " CAMERA ", \"lights\": [");
    for (int i = 0, num = 0; i < LAMPS; i++)
        if (which >> i & 1u)
            at += snprintf(text + at, size_bytes - (size_t)at,
                           "%s{ \"position\": [%g, %g, %g], \"colour\": [%d, 2, %d], \"radius\": 0, \"shadow\": %s }",
                           num++ ? ", " : "", -3 + 0.75 * i, 0.5 + 0.4 * (i % 5), -3.5 + 1.1 * (i % 4), 1 + i % 3,
                           3 - i % 3, i % 3 ? "true" : "false");
    snprintf(text + at, size_bytes - (size_t)at,
             "] }*/\n" SHAPES "vec3 colour(vec3 p, vec3 n) { return vec3(0.5); }\n");
}

/* Many lamps are the sum of each, wherever packets, blocks of rays and their strips end. */
static void lamps_add_up(void **state)
{
    (void)state;
    /* 48 x 36: whole strips; 45 x 35: none. */
    for (int odd = 0; odd < 2; odd++) {
        static double sum[3 * NUM];
        const int width_px = odd ? 45 : WIDTH, height_px = odd ? 35 : HEIGHT;
        const size_t num = 3 * (size_t)width_px * (size_t)height_px;
        memset(sum, 0, sizeof sum);
        int num_dark = 0;
        double worst = 0;
        for (int which = 0; which <= LAMPS; which++) {
            char text[4096];
            lamps_text(text, sizeof text, which < LAMPS ? 1u << which : (1u << LAMPS) - 1);
            karst_engine_config config = config_of(text, 1);
            config.integrator = KARST_INTEGRATOR_DIRECT;
            config.width_px = width_px;
            config.height_px = height_px;
            bool settled = false;
            karst_engine *engine = scene_open(&config);
            assert_ok(karst_engine_settle(engine, 2000, NULL, NULL, &settled, &error));
            assert_ok(karst_engine_read_radiance(engine, light, num, &error));
            karst_engine_destroy(engine);
            unlink(path);
            assert_true(settled);
            for (size_t i = 0; i < num; i++)
                if (which < LAMPS) {
                    sum[i] += (double)light[i];
                    num_dark += which == 1 && light[i] == 0;
                } else {
                    worst = fmax(worst, fabs((double)light[i] - sum[i]) / (1e-3 + sum[i]));
                }
        }
        print_message("%d x %d: worst %.2g off, %d values without one lamp\n", width_px, height_px, worst, num_dark);
        assert_true(worst < 1e-5 && num_dark > (int)num / 20);
    }
}

/* Painted ground in a white sky is as bright as its paint. */
static void paint_is_lit(void **state)
{
    (void)state;
    karst_engine_config config = config_of("/*{ " NIGHT ", " WHITE_SKY ",\n"
                                           "\"camera\": { \"position\": [0, 6, 0], \"pitch\": -90 } }*/\n"
                                           "float density(vec3 p) { return -p.y; }\n"
                                           "vec3 colour(vec3 p, vec3 n) { return vec3(0.5); }\n",
                                           2);
    const karst_edit edit = {.shape = KARST_EDIT_PLANE, /* all before x = 0 */
                             .mode = KARST_EDIT_PAINT,
                             .normal = {1, 0, 0},
                             .has_colour = true,
                             .colour = {0.7, 0.05, 0.2},
                             .strength = 1};
    karst_engine *engine = scene_open(&config);
    assert_ok(karst_engine_edit(engine, &edit, 1, &error));
    settle(engine, light);
    karst_engine_destroy(engine);
    unlink(path);
    for (int i = 0; i < NUM; i++)
        for (int c = 0; c < 3 && abs(2 * (i % WIDTH) + 1 - WIDTH) > 4; c++) {
            const double truth = 2 * (i % WIDTH) < WIDTH ? edit.colour[c] : 0.5;
            assert_true(fabs((double)light[3 * i + c] - truth) < 0.005);
        }
}

static const char scene[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, " CAMERA ",\n"
    "\"lights\": [{ \"position\": [0, 2, -1], \"colour\": [9, 4, 1], \"radius\": 0.2 },\n"
    "{ \"kind\": \"spot\", \"position\": [2, 4, -3], \"colour\": [1, 9, 9], \"azimuth\": -45, \"elevation\": -60, "
    "\"shadow\": false }] }*/\n" SHAPES
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.7, 0.6, 0.5); m.mirror = p.x > 0.0 ? 0.5 : 0.0;\n"
    "m.gloss = 0.4; m.emission = p.x < -2.5 ? vec3(1.0, 0.2, 0.1) : vec3(0.0); return m; }\n";

static void lanes_history_and_goes_leave_no_trace(void **state)
{
    (void)state;
    enum { SAMPLES = 4 };
    karst_engine_config config = config_of(scene, SAMPLES);
    for (int direct = 1; direct >= 0; direct--) {
        config.pool_bytes = (uint64_t)48 << 20;
        config.integrator = direct ? KARST_INTEGRATOR_DIRECT : KARST_INTEGRATOR_FULL;
        take(&config, light);
        config.lanes = 1;
        take(&config, other);
        assert_memory_equal(light, other, sizeof light);
        config.lanes = 0;
        /* Elsewhere first, in less memory, and in two goes. */
        config.pool_bytes = (uint64_t)32 << 20;
        karst_engine *engine = scene_open(&config);
        const karst_camera there = karst_engine_default_camera(engine);
        karst_camera away = there;
        away.yaw_deg += 30;
        bool settled;
        assert_ok(karst_engine_set_camera(engine, &away, &error));
        settle(engine, other);
        assert_memory_not_equal(light, other, sizeof light);
        assert_ok(karst_engine_set_camera(engine, &there, &error));
        do {
            assert_ok(karst_engine_settle(engine, 1, NULL, NULL, &settled, &error));
            karst_engine_stats(engine, &stats);
        } while (stats.num_samples < SAMPLES / 2);
        assert_false(settled);
        settle(engine, other);
        assert_memory_equal(light, other, sizeof light);
        assert_ok(karst_engine_check(engine, &error));
        karst_engine_destroy(engine);
        if (direct)
            continue;
        /* A part of the picture is that part of the whole. */
        config.window = (karst_engine_window){WIDTH, HEIGHT, 16, 8};
        config.width_px = 21;
        config.height_px = 17;
        float part[3 * 21 * 17];
        engine = scene_open(&config);
        assert_ok(karst_engine_settle(engine, 2000, NULL, NULL, &settled, &error));
        assert_ok(karst_engine_read_radiance(engine, part, 3 * 21 * 17, &error));
        karst_engine_destroy(engine);
        for (int y = 0; y < 17; y++)
            assert_memory_equal(part + 3 * 21 * y, light + 3 * ((y + 8) * WIDTH + 16), 3 * 21 * sizeof *part);
    }
    unlink(path);
}

static bool add_rays(void *user, const karst_stats *frame)
{
    *(uint64_t *)user += frame->num_rays[KARST_STREAM_MIRROR];
    return true;
}

/* Frame by frame each sample is drawn whole until it lacks nothing. Who waits gets the same from drawing it once, and
 * what lacked something once more. */
static void paths_that_lack_nothing_are_drawn_once(void **state)
{
    (void)state;
    enum { SAMPLES = 6 };
    const karst_engine_config config = config_of(scene, SAMPLES);
    uint64_t whole = 0, once = 0;
    karst_engine *engine = scene_open(&config);
    do {
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        add_rays(&whole, &stats);
    } while (!stats.settled);
    assert_ok(karst_engine_read_radiance(engine, light, 3 * NUM, &error));
    karst_engine_destroy(engine);

    engine = scene_open(&config);
    bool settled;
    assert_ok(karst_engine_settle(engine, 2000, add_rays, &once, &settled, &error));
    assert_ok(karst_engine_read_radiance(engine, other, 3 * NUM, &error));
    print_message("%d rays went on, %d where all are drawn anew\n", (int)once, (int)whole);
    assert_memory_equal(light, other, sizeof light);
    assert_true((double)once < 0.6 * (double)whole);
    karst_engine_destroy(engine);
    unlink(path);
}

/* A view that the pools cannot hold settles all the same, whatever was seen before. */
static void little_memory_settles(void **state)
{
    (void)state;
    karst_engine_config config = config_of(scene, 3);
    config.num_bricks = 40;
    config.num_tiles = 120;
    for (int direct = 0; direct < 2; direct++) {
        config.integrator = direct ? KARST_INTEGRATOR_DIRECT : KARST_INTEGRATOR_FULL;
        take(&config, light);
        print_message("at %g pixels a voxel\n", stats.detail_given_px);
        assert_true(stats.detail_given_px > 1);
        karst_engine *engine = scene_open(&config);
        const karst_camera there = karst_engine_default_camera(engine);
        karst_camera away = there;
        away.yaw_deg += 20;
        assert_ok(karst_engine_set_camera(engine, &away, &error));
        settle(engine, other);
        assert_ok(karst_engine_set_camera(engine, &there, &error));
        settle(engine, other);
        assert_memory_equal(light, other, sizeof light);
        karst_engine_destroy(engine);
    }
    unlink(path);
}

static void what_is_out_of_range_is_said(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_engine_config config = config_of(scene, 1);
    config.no_shadows = true;
    assert_null(karst_engine_create(&config, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_non_null(strstr(error.message, "shadows"));
    config.no_shadows = false;
    error = (karst_error){0};
    config.bounces = KARST_ENGINE_MAX_BOUNCES + 1;
    assert_null(karst_engine_create(&config, &error));
    assert_non_null(strstr(error.message, "bounces"));
    error = (karst_error){0};
    karst_integrator integrator;
    assert_false(karst_integrator_parse("fill", &integrator, &error));
    assert_non_null(strstr(error.message, "direct, full"));
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(white_is_not_seen_in_a_furnace),
        cmocka_unit_test(light_adds_up_in_a_hollow),
        cmocka_unit_test(a_wall_takes_its_share),
        cmocka_unit_test(lights_are_as_bright_as_they_say),
        cmocka_unit_test(only_lamps_that_reach_are_cast),
        cmocka_unit_test(lamps_add_up),
        cmocka_unit_test(paint_is_lit),
        cmocka_unit_test(lanes_history_and_goes_leave_no_trace),
        cmocka_unit_test(paths_that_lack_nothing_are_drawn_once),
        cmocka_unit_test(little_memory_settles),
        cmocka_unit_test(what_is_out_of_range_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
