/* Light maps: that what is baked and what full light shows is one thing; that energy is kept; that lamps are in neither
 * twice; that lanes leave no trace; that files of maps are data, not a risk. */
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

enum { SIDE = 32, BAKED = 48, MOST = 64 * 64 };

static char folder[64];
static float light[3 * MOST], other[3 * MOST], half[3 * MOST];

/* Ground before a red wall, in a sun, under a grey sky: what the wall throws at the ground and hides of the sky. The
 * camera of pictures; maps are baked from beside it. */
#define COURT(map)                                                                                      \
    "/*{ \"voxel\": 0.03125, \"view\": 200, " map "\n"                                                 \
    "\"sun\": { \"azimuth\": 230, \"elevation\": 50, \"colour\": [1, 1, 1] },\n"                        \
    "\"sky\": { \"zenith\": [0.3, 0.3, 0.3], \"horizon\": [0.3, 0.3, 0.3], \"haze\": 1e12 },\n"        \
    "\"camera\": { \"position\": [\"-1\", \"2.5\", \"-4\"], \"yaw\": 35, \"pitch\": -25, \"fov\": 50 } }*/\n" \
    "float wall(vec3 p) { return min(min(p.x - 2.0, 3.0 - p.x), 3.0 - p.y); }\n"                        \
    "float density(vec3 p) { return max(-p.y, wall(p)); }\n"                                            \
    "material surface(vec3 p, vec3 n) { material m; m.colour = p.y > 0.02 ? vec3(0.8, 0.1, 0.1)\n"      \
    "    : vec3(0.7); return m; }\n"
#define MAP "\"light_map\": \"map.ply\","

/* A hollow ball that glows: of albedo 1/2 and glow 1/4 every place of it sees 1/2. */
#define BALL(map)                                                                                       \
    "/*{ \"voxel\": 0.03125, \"view\": 100, " map "\n"                                                 \
    "\"sun\": { \"colour\": [0, 0, 0] },\n"                                                             \
    "\"sky\": { \"zenith\": [1, 1, 1], \"horizon\": [1, 1, 1], \"haze\": 1e12 },\n"                    \
    "\"camera\": { \"position\": [\"0.5\", \"0.25\", \"0\"], \"fov\": 90 } }*/\n"                       \
    "float density(vec3 p) { return length(p) - 2.0; }\n"                                               \
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.5); m.emission = vec3(0.25); return m; }\n"

/* Black ground below a ball of glass, in a large sun and no other light. */
static const char *const focus =
    "/*{ \"voxel\": 0.03125, \"view\": 100, \"sun\": { \"colour\": [0, 0, 0] },\n"
    "\"lights\": [{ \"kind\": \"sun\", \"azimuth\": 0, \"elevation\": 80, \"size\": 20, \"colour\": [1, 1, 1] }],\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"0\", \"3\", \"-4\"], \"pitch\": -35, \"fov\": 50 } }*/\n"
    "float density(vec3 p) { return -p.y; }\n"
    "float clear(vec3 p) { return 0.5 - length(p - vec3(0.0, 0.9, 0.0)); }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); return m; }\n";

static void path_of(const char *name, char path[128]) { snprintf(path, 128, "%s/%s", folder, name); }

static void write_file(const char *name, const void *data, size_t num)
{
    char path[128];
    path_of(name, path);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, num, file), num);
    assert_int_equal(fclose(file), 0);
}

static karst_engine *open_engine(const char *text, const karst_engine_config *like, karst_error *error)
{
    karst_engine_config config = *like;
    char path[128];
    path_of("world.karst", path);
    write_file("world.karst", text, strlen(text));
    config.world = path;
    config.display = KARST_DISPLAY_NONE;
    config.tone = KARST_TONE_OF_FILM;
    config.exposure = KARST_EXPOSURE_GIVEN;
    if (!config.width_px)
        config.width_px = config.height_px = SIDE;
    config.pool_bytes = (uint64_t)96 << 20;
    return karst_engine_create(&config, error);
}

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    karst_error error = {0};
    karst_engine *engine = open_engine(text, like, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static void settle(karst_engine *engine, float *into, int side)
{
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 2000, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_radiance(engine, into, 3 * (size_t)side * (size_t)side, &error));
}

/* ---- baking, as the command does, but that it is one view ---- */

static size_t bake(const char *text, const karst_engine_config *like, double aside_m, double fov_deg, float *baked)
{
    static float depth[MOST], normal[3 * MOST];
    const karst_position origin = {{0}, {0}};
    karst_engine_config config = *like;
    const int side = config.width_px = config.height_px = config.width_px ? config.width_px : BAKED;
    config.integrator = KARST_INTEGRATOR_FULL;
    config.irradiance = true;
    karst_engine *engine = create(text, &config);
    karst_camera camera = karst_engine_default_camera(engine);
    const int voxel = karst_engine_voxel_log2_m(engine);
    const double aside[3] = {aside_m, 0, 0}, wide = tan(fov_deg * M_PI / 360);
    camera.position = karst_position_add_m(camera.position, aside, voxel);
    camera.fov_deg = fov_deg;
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    settle(engine, baked, side);
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_DEPTH, depth, (size_t)(side * side), &error));
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_NORMAL, normal, 3 * (size_t)(side * side), &error));
    karst_engine_destroy(engine);
    static char file[MOST * 160 + 512];
    double right[3], up[3], forward[3];
    size_t num = 0, length = 0;
    for (int i = 0; i < side * side; i++)
        num += baked[3 * i] >= 0;
    length += (size_t)sprintf(file, "ply\nformat ascii 1.0\nelement vertex %zu\nproperty double x\nproperty double y\n"
                                    "property double z\nproperty float nx\nproperty float ny\nproperty float nz\n"
                                    "property float red\nproperty float green\nproperty float blue\n"
                                    "property float radius\nend_header\n", num);
    karst_camera_axes(&camera, right, up, forward);
    for (int i = 0; i < side * side; i++) {
        if (!(baked[3 * i] >= 0))
            continue;
        const double x = wide * ((2 * (i % side) + 1.0) / side - 1), y = wide * (1 - (2 * (i / side) + 1.0) / side);
        double way[3], place[3], toward = 0, per = 1 / sqrt(1 + x * x + y * y);
        for (int k = 0; k < 3; k++) {
            const double d = (forward[k] + x * right[k] + y * up[k]) * per;
            way[k] = d * depth[i];
            toward -= d * normal[3 * i + k];
        }
        karst_position_difference_m(origin, karst_position_add_m(camera.position, way, voxel), voxel, place);
        length += (size_t)sprintf(file + length, "%.9g %.9g %.9g %.5g %.5g %.5g %.7g %.7g %.7g %.5g\n", place[0],
                                  place[1], place[2], normal[3 * i], normal[3 * i + 1], normal[3 * i + 2],
                                  baked[3 * i], baked[3 * i + 1], baked[3 * i + 2],
                                  3 * wide / side * depth[i] * per / fmax(toward, 0.1));
    }
    write_file("map.ply", file, length);
    return num;
}

/* ---- tests ---- */

static bool until_half(void *user, const karst_stats *stats)
{
    return stats->num_samples < *(const uint32_t *)user / 2;
}

/* Rms of what two pictures differ by. */
static double rms_of(const float *a, const float *b, int num)
{
    double sum = 0;
    for (int i = 0; i < num; i++)
        sum += ((double)a[i] - (double)b[i]) * ((double)a[i] - (double)b[i]);
    return sqrt(sum / num);
}

static void test_that_a_baked_map_is_full_light(void **state)
{
    (void)state;
    const uint32_t num_samples = 128;
    const karst_engine_config full = {.integrator = KARST_INTEGRATOR_FULL, .samples = num_samples},
                              baking = {.samples = 64}, direct = {.samples = 32};
    bool settled = false;
    karst_engine *engine = create(COURT(""), &full);
    uint32_t samples = num_samples;
    assert_ok(karst_engine_settle(engine, 2000, until_half, &samples, &settled, &error));
    assert_ok(karst_engine_read_radiance(engine, half, 3 * SIDE * SIDE, &error));
    settle(engine, light, SIDE);
    karst_engine_destroy(engine);
    assert_true(bake(COURT(""), &baking, -0.5, 75, other) > BAKED * BAKED / 2);
    engine = create(COURT(MAP), &direct);
    settle(engine, other, SIDE);
    karst_engine_destroy(engine);
    double is[3] = {0, 0, 0}, should[3] = {0, 0, 0};
    for (int i = 0; i < SIDE * SIDE; i++)
        for (int c = 0; c < 3; c++)
            is[c] += other[3 * i + c], should[c] += light[3 * i + c];
    const double noise = rms_of(half, light, 3 * SIDE * SIDE), off = rms_of(other, light, 3 * SIDE * SIDE);
    print_message("rms %.5f of a mean of %.4f, noise of full light %.5f; sums %.4f %.4f %.4f of it\n", off,
                  should[0] / (SIDE * SIDE), noise, is[0] / should[0], is[1] / should[1], is[2] / should[2]);
    assert_true(noise > 0 && off <= 1.25 * noise);
    for (int c = 0; c < 3; c++)
        assert_true(fabs(is[c] / should[c] - 1) <= 0.01);
}

static void test_that_energy_is_kept(void **state)
{
    (void)state;
    const karst_engine_config baking = {.samples = 64}, direct = {.samples = 2};
    const size_t num = bake(BALL(""), &baking, 0, 110, other);
    double sum = 0;
    assert_int_equal(num, BAKED * BAKED);
    for (int i = 0; i < 3 * BAKED * BAKED; i++)
        sum += other[i];
    sum /= 3 * BAKED * BAKED;
    karst_engine *engine = create(BALL(MAP), &direct);
    settle(engine, light, SIDE);
    karst_engine_destroy(engine);
    double mean = 0, least = 1, most = 0;
    for (int i = 0; i < 3 * SIDE * SIDE; i++) {
        mean += light[i] / (3.0 * SIDE * SIDE);
        least = fmin(least, light[i]), most = fmax(most, light[i]);
    }
    print_message("light that falls: %.5f; pictures: %.5f, %.4f to %.4f\n", sum, mean, least, most);
    assert_true(fabs(sum - 0.5) < 0.003 && fabs(mean - 0.5) < 0.003 && least > 0.47 && most < 0.53);
}

/* What lamps send by way of glass is photons' work, or nobody's: not that of maps. */
static void test_that_lamps_are_left_out(void **state)
{
    (void)state;
    const karst_engine_config baking = {.samples = 16};
    const size_t num = bake(focus, &baking, 0, 50, other);
    size_t num_none = 0;
    for (int i = 0; i < BAKED * BAKED; i++) {
        assert_true(other[3 * i] == 0 || other[3 * i] == -1);
        num_none += other[3 * i] == -1;
    }
    /* Where the ball is before the ground, nothing is known of it. */
    assert_true(num_none > 50 && num + num_none == BAKED * BAKED);
}

static void test_that_lanes_leave_no_trace(void **state)
{
    (void)state;
    static float first[3 * MOST], second[3 * MOST];
    if (!getenv("KARST_TEST_FULL"))
        skip(); /* kernels of one lane take ten seconds to compile */
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        const karst_engine_config baking = {.samples = 3, .width_px = 24, .lanes = lanes},
                                  direct = {.samples = 2, .lanes = lanes};
        bake(COURT(""), &baking, 0, 75, lanes == 1 ? first : other);
        karst_engine *engine = create(COURT(MAP), &direct);
        settle(engine, lanes == 1 ? second : light, SIDE);
        karst_engine_destroy(engine);
    }
    assert_memory_equal(first, other, 3 * 24 * 24 * sizeof *first);
    assert_memory_equal(second, light, 3 * SIDE * SIDE * sizeof *second);
}

static void refuses(const char *map, const char *header, karst_status status, const char *says)
{
    static const karst_engine_config direct = {.width_px = 8, .height_px = 8};
    static char world[1024];
    karst_error error = {0};
    if (map)
        write_file("map.ply", map, strlen(map));
    snprintf(world, sizeof world, "/*{ \"voxel\": 0.125, \"light_map\": %s }*/\n"
             "float density(vec3 p) { return -p.y; }\n", header);
    karst_engine *engine = open_engine(world, &direct, &error);
    if (engine || error.status != status || !strstr(error.message, says))
        fail_msg("%s: %d: %s", header, (int)error.status, error.message);
}

#define HEAD(num, more)                                                                                        \
    "ply\nformat ascii 1.0\nelement vertex " num "\nproperty double x\nproperty double y\nproperty double z\n" \
    "property float nx\nproperty float ny\nproperty float nz\nproperty float red\nproperty float green\n"      \
    "property float blue\n" more "end_header\n"
#define RADIUS "property float radius\n"

static void test_that_files_are_data(void **state)
{
    (void)state;
    static const char *const map = "\"map.ply\"";
    refuses(NULL, "\"none.ply\"", KARST_BAD_DATA, "none.ply");
    refuses(NULL, "\".\"", KARST_BAD_DATA, "regular");
    refuses(NULL, "5", KARST_BAD_WORLD, "light_map");
    refuses(NULL, "{ \"reach\": 1 }", KARST_BAD_WORLD, "light_map");
    refuses("", map, KARST_BAD_DATA, "map.ply");
    refuses("garbage\n", map, KARST_BAD_DATA, "ply");
    refuses("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
            "end_header\n0 0 0\n", map, KARST_BAD_DATA, "normals");
    refuses(HEAD("1", "") "0 0 0 0 1 0 1 1 1\n", map, KARST_BAD_DATA, "radius");
    refuses(HEAD("0", RADIUS), map, KARST_BAD_DATA, "without points");
    refuses(HEAD("2", RADIUS) "0 0 0 0 1 0 1 1 1 1\n", map, KARST_BAD_DATA, "whole");
    refuses(HEAD("99999999999999", RADIUS) "0 0 0 0 1 0 1 1 1 1\n", map, KARST_BAD_DATA, "whole");
    refuses(HEAD("1", RADIUS) "nan 0 0 0 1 0 1 1 1 1\n", map, KARST_BAD_DATA, "point 1");
    refuses(HEAD("1", RADIUS) "0 0 1e300 0 1 0 1 1 1 1\n", map, KARST_BAD_DATA, "place");
    refuses(HEAD("1", RADIUS) "0 0 0 0 0 0 1 1 1 1\n", map, KARST_BAD_DATA, "normal");
    refuses(HEAD("1", RADIUS) "0 0 0 0 1 0 1 -1 1 1\n", map, KARST_BAD_DATA, "light");
    refuses(HEAD("1", RADIUS) "0 0 0 0 1 0 1 1 inf 1\n", map, KARST_BAD_DATA, "light");
    refuses(HEAD("2", RADIUS) "0 0 0 0 1 0 1 1 1 1\n0 0 0 0 1 0 1 1 1 0\n", map, KARST_BAD_DATA, "point 2");
    karst_error error = {0};
    const karst_engine_config direct = {.irradiance = true};
    assert_null(open_engine(COURT(""), &direct, &error));
    assert_int_equal(error.status, KARST_USAGE);
}

/* Points without a radius, very large and very small ones together, very far out: all are shown. */
static void test_that_points_of_others_are_shown(void **state)
{
    (void)state;
    const char *map = HEAD("3", "") "0 0 5 0 1 0 0.5 0.25 0.125\n1e18 0 0 0 1 0 1 1 1\n0 0 5 0 1 0 0.5 0.25 0.125\n";
    const char *world = "/*{ \"voxel\": 0.0625, \"view\": 100,\n"
                        "\"light_map\": { \"file\": \"map.ply\", \"reach\": 40 },\n"
                        "\"sun\": { \"colour\": [0, 0, 0] }, \"sky\": { \"zenith\": [0, 0, 0],\n"
                        "\"horizon\": [0, 0, 0],\n"
                        "\"haze\": 1e12 }, \"camera\": { \"position\": [\"0\", \"2\", \"0\"], \"pitch\": -60 } }*/\n"
                        "float density(vec3 p) { return -p.y; }\n"
                        "vec3 colour(vec3 p, vec3 n) { return vec3(1.0); }\n";
    const karst_engine_config direct = {.samples = 2};
    write_file("map.ply", map, strlen(map));
    karst_engine *engine = create(world, &direct);
    settle(engine, light, SIDE);
    karst_engine_destroy(engine);
    const float *middle = light + 3 * (SIDE * SIDE / 2 + SIDE / 2);
    for (int c = 0; c < 3; c++)
        assert_true(fabs((double)middle[c] * (2 << c) - 1) < 1e-3);
}

static int make_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/karst-light-XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
    char path[128];
    (void)state;
    path_of("map.ply", path);
    unlink(path);
    path_of("world.karst", path);
    unlink(path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_that_a_baked_map_is_full_light), cmocka_unit_test(test_that_energy_is_kept),
        cmocka_unit_test(test_that_lamps_are_left_out),        cmocka_unit_test(test_that_lanes_leave_no_trace),
        cmocka_unit_test(test_that_files_are_data),            cmocka_unit_test(test_that_points_of_others_are_shown),
    };
    return cmocka_run_group_tests_name("light maps", tests, make_folder, remove_folder);
}
