/* Land that mirrors: where its rays go, what their light depends on, and what it costs those who do without. */
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
#include "tests/support/scene.h"

enum { WIDTH = 64, HEIGHT = 48, NUM = WIDTH * HEIGHT, SAMPLES = 4 };

static karst_engine_config base_config(const char *world)
{
    return (karst_engine_config){.world = world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .exposure = KARST_EXPOSURE_GIVEN,
                                 .pool_bytes = (uint64_t)64 << 20};
}

typedef struct {
    uint8_t bytes[4 * NUM];
    float light[3 * NUM];
    karst_stats stats;
} picture;

static void settle(karst_engine *engine, picture *p)
{
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &p->stats);
    assert_true(settled && p->stats.settled);
    assert_int_equal(p->stats.num_provisional, 0);
    assert_ok(karst_engine_read_pixels(engine, p->bytes, sizeof p->bytes, &error));
    assert_ok(karst_engine_read_radiance(engine, p->light, 3 * NUM, &error));
}

static void take_from(const karst_engine_config *config, const char *position, picture *p)
{
    karst_engine *engine = scene_open(config);
    if (position) {
        karst_camera camera = karst_engine_default_camera(engine);
        assert_ok(karst_camera_parse(position, karst_engine_voxel_log2_m(engine), &camera, &error));
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
    }
    settle(engine, p);
    karst_engine_destroy(engine);
}

static picture whole, other, third;

/* A world's text in a file that goes again. */
static void write_world(const char *text, char path[64])
{
    snprintf(path, 64, "/tmp/karst-mirror-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
}

#define HEAD                                                                                               \
    "/*{ \"voxel\": 0.015625, \"view\": 400, \"sun\": { \"azimuth\": 60, \"elevation\": 40 },\n"           \
    "\"sky\": { \"haze\": 1e12 }, \"camera\": { \"position\": [\"0\", \"1\", \"-6\"], \"fov\": 70 } }*/\n" \
    "vec3 colour(vec3 p, vec3 n) { return vec3(0.6, 0.15, 0.1); }\n"
static const char over_plane[] =
    HEAD "float density(vec3 p) { return max(-p.y, 1.2 - length(p - vec3(0.0, 2.5, 0.0))); }\n";
static const char alone[] = HEAD "float density(vec3 p) { return 1.2 - length(p - vec3(0.0, 2.5, 0.0)); }\n";

/* What a plane mirrors is what is seen from below it without it, upside down. */
static void a_plane_mirrors_what_is_over_it(void **state)
{
    (void)state;
    for (int lanes = 16; lanes; lanes = lanes == 16 ? 1 : 0) {
        char path[64];
        write_world(over_plane, path);
        karst_engine_config config = base_config(path);
        config.lanes = lanes;
        config.mirror = 1;
        take_from(&config, NULL, &whole);
        unlink(path);
        write_world(alone, path);
        config.mirror = 0;
        take_from(&config, "0,-1,-6,0,0,70", &other);
        unlink(path);
        int num_off = 0, num_ball = 0;
        for (int y = HEIGHT / 2; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                int most = 0;
                for (int c = 0; c < 3; c++)
                    most = (int)fmax(most, abs(whole.bytes[4 * (y * WIDTH + x) + c] -
                                               other.bytes[4 * ((HEIGHT - 1 - y) * WIDTH + x) + c]));
                num_off += most > 2;
                num_ball += other.bytes[4 * ((HEIGHT - 1 - y) * WIDTH + x)] >
                            other.bytes[4 * ((HEIGHT - 1 - y) * WIDTH + x) + 2];
            }
        print_message("%d lanes: %d of %d pixels are not as from below, %d show the ball\n", lanes, num_off, NUM / 2,
                      num_ball);
        assert_true(num_ball > 40);
        assert_true(num_off <= NUM / 2 / 1000);
    }
}

/* Half a mirror is the mean of none and a whole one: what is not mirrored stays, and nothing is added. */
static void light_is_shared_out(void **state)
{
    (void)state;
    for (int no_shadows = 0; no_shadows < 2; no_shadows++) {
        karst_engine_config config = base_config("hills");
        config.view_distance_m = 1000;
        config.no_shadows = no_shadows;
        take_from(&config, NULL, &whole);
        assert_int_equal(whole.stats.num_rays[KARST_STREAM_MIRROR], 0);
        config.mirror = 1;
        take_from(&config, NULL, &other);
        assert_int_equal(other.stats.num_rays[KARST_STREAM_MIRROR], other.stats.num_hits);
        config.mirror = 0.5;
        take_from(&config, NULL, &third);
        int num_other = 0;
        for (int i = 0; i < 3 * NUM; i++) {
            const double mean = 0.5 * ((double)whole.light[i] + (double)other.light[i]);
            assert_true(fabs((double)third.light[i] - mean) < 1e-5 * (1 + mean));
            num_other += whole.light[i] != other.light[i];
        }
        print_message("%d of %d values are others, of %d hits\n", num_other, 3 * NUM, (int)whole.stats.num_hits);
        assert_true(num_other > (int)whole.stats.num_hits);
    }
}

static void lanes_history_and_goes_leave_no_trace(void **state)
{
    (void)state;
    karst_engine_config config = base_config("hills");
    config.samples = SAMPLES;
    config.mirror = 0.6;
    config.view_distance_m = 1000;
    take_from(&config, NULL, &whole);
    config.lanes = 1;
    take_from(&config, NULL, &other);
    assert_memory_equal(whole.light, other.light, sizeof whole.light);
    assert_memory_equal(whole.bytes, other.bytes, sizeof whole.bytes);
    config.lanes = 0;
    config.no_beam = true;
    take_from(&config, NULL, &other);
    assert_memory_equal(whole.light, other.light, sizeof whole.light);
    config.no_beam = false;

    /* Elsewhere first, in less memory, and in two goes. */
    config.pool_bytes = (uint64_t)48 << 20;
    karst_engine *engine = scene_open(&config);
    const karst_camera there = karst_engine_default_camera(engine);
    karst_camera away = there;
    away.yaw_deg += 40;
    away.pitch_deg -= 20;
    bool settled;
    assert_ok(karst_engine_set_camera(engine, &away, &error));
    settle(engine, &other);
    assert_memory_not_equal(whole.light, other.light, sizeof whole.light);
    assert_ok(karst_engine_set_camera(engine, &there, &error));
    do {
        assert_ok(karst_engine_settle(engine, 1, NULL, NULL, &settled, &error));
        karst_engine_stats(engine, &other.stats);
    } while (other.stats.num_samples < SAMPLES / 2);
    assert_false(settled);
    settle(engine, &other);
    assert_memory_equal(whole.light, other.light, sizeof whole.light);
    assert_memory_equal(whole.bytes, other.bytes, sizeof whole.bytes);
    karst_engine_destroy(engine);
}

#define GROUND                                                                                                     \
    "float density(vec3 p) { return max(-p.y, 1.2 - length(p - vec3(0.0, 2.5, 0.0))); }\n"                          \
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.6, 0.15, 0.1); m.mirror = "

/* What surfaces say of themselves is what the world says of all, and each has its own. */
static void surfaces_mirror_each_for_itself(void **state)
{
    (void)state;
    static const char *const mirrors[] = {"0.5", "p.y > 0.5 ? 0.5 : 0.0"};
    char path[64], text[1024];
    write_world(over_plane, path);
    karst_engine_config config = base_config(path);
    config.mirror = 0.5;
    take_from(&config, NULL, &whole);
    config.mirror = 0;
    take_from(&config, NULL, &third);
    unlink(path);
    for (int own = 0; own < 2; own++) {
        snprintf(text, sizeof text, HEAD GROUND "%s; return m; }\n", mirrors[own]);
        write_world(text, path);
        take_from(&config, NULL, &other);
        unlink(path);
        int num_alike = 0, num_plain = 0, num_neither = 0;
        for (int i = 0; i < NUM; i++) {
            double off = 0, off_plain = 0;
            for (int c = 0; c < 3; c++) {
                off = fmax(off, fabs((double)(other.light[3 * i + c] - whole.light[3 * i + c])));
                off_plain = fmax(off_plain, fabs((double)(other.light[3 * i + c] - third.light[3 * i + c])));
            }
            num_alike += off < 1e-5;
            num_plain += off_plain < 1e-5;
            num_neither += off >= 1e-5 && off_plain >= 1e-5;
        }
        print_message("mirror %s: %d as all, %d as none, %d neither\n", mirrors[own], num_alike, num_plain,
                      num_neither);
        /* Far out on the ground the choice is softened. */
        assert_true(own ? num_plain > NUM * 9 / 10 && num_plain < NUM - 100 && num_neither < NUM / 30
                        : num_alike == NUM);
    }
    /* Where nobody wants mirrors there are none. */
    write_world(text, path);
    config = base_config(path);
    config.mirror = -1;
    take_from(&config, NULL, &other);
    assert_int_equal(other.stats.num_rays[KARST_STREAM_MIRROR], 0);
    unlink(path);
}

/* A view that the pools cannot hold settles all the same, whatever was seen before. */
static void little_memory_settles(void **state)
{
    (void)state;
    karst_engine_config config = base_config("hills");
    config.mirror = 1;
    config.view_distance_m = 1000;
    config.num_bricks = 48;
    config.num_tiles = 144;
    take_from(&config, NULL, &whole);
    assert_true(whole.stats.detail_given_px > 1);
    karst_engine *engine = scene_open(&config);
    const karst_camera there = karst_engine_default_camera(engine);
    karst_camera away = there;
    away.yaw_deg += 90;
    assert_ok(karst_engine_set_camera(engine, &away, &error));
    settle(engine, &other);
    assert_ok(karst_engine_set_camera(engine, &there, &error));
    settle(engine, &other);
    assert_memory_equal(whole.bytes, other.bytes, sizeof whole.bytes);
    karst_engine_destroy(engine);
}

/* What a larger picture left in the stream's memory is none of a smaller one's. */
static void other_sizes_leave_no_trace(void **state)
{
    (void)state;
    const int sizes[][2] = {{40, 30}, {33, 33}};
    karst_engine_config config = base_config("hills");
    config.mirror = 0.7;
    config.view_distance_m = 1000;
    karst_engine *engine = scene_open(&config);
    settle(engine, &whole);
    for (int i = 0; i < 2; i++) {
        bool settled = false;
        const size_t size_bytes = (size_t)sizes[i][0] * (size_t)sizes[i][1] * 4;
        assert_ok(karst_engine_set_drawn_size(engine, sizes[i][0], sizes[i][1], &error));
        assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
        assert_true(settled);
        assert_ok(karst_engine_read_pixels(engine, whole.bytes, size_bytes, &error));
        config.width_px = sizes[i][0];
        config.height_px = sizes[i][1];
        karst_engine *fresh = scene_open(&config);
        assert_ok(karst_engine_settle(fresh, 400, NULL, NULL, &settled, &error));
        assert_true(settled);
        assert_ok(karst_engine_read_pixels(fresh, other.bytes, size_bytes, &error));
        assert_memory_equal(whole.bytes, other.bytes, size_bytes);
        karst_engine_destroy(fresh);
    }
    karst_engine_destroy(engine);
}

static const char repeats[] =
    "/*{ \"voxel\": 0.015625, \"view\": 40, \"mirror\": 0.8,\n"
    "\"camera\": { \"position\": [\"1\", \"2.5\", \"-3\"], \"pitch\": -25, \"fov\": 60 } }*/\n"
    "float density(vec3 p) { vec3 q = vec3(mod(p.x, 8.0) - 4.0, p.y - 1.2, mod(p.z, 8.0) - 4.0);\n"
    "return max(-p.y, 1.5 - length(q)); }\n"
    "vec3 colour(vec3 p, vec3 n) { return vec3(0.2) + 0.4 * step(0.5, fract(p)); }\n";

static void far_out_light_is_the_same(void **state)
{
    (void)state;
    char path[64];
    write_world(repeats, path);
    karst_engine_config config = base_config(path);
    take_from(&config, NULL, &whole);
    assert_true(whole.stats.num_rays[KARST_STREAM_MIRROR] > NUM / 2);
    take_from(&config, "1000000000001,2.5,-3,0,-25,60", &other);
    assert_memory_equal(whole.light, other.light, sizeof whole.light);
    /* What a world says may be overruled. */
    config.mirror = -1;
    take_from(&config, NULL, &other);
    assert_int_equal(other.stats.num_rays[KARST_STREAM_MIRROR], 0);
    assert_memory_not_equal(whole.light, other.light, sizeof whole.light);
    config.exposure = KARST_EXPOSURE_OF_WORLD;
    karst_engine *engine = scene_open(&config); /* without mirrors a picture is bytes from the start */
    assert_false(karst_engine_keeps_radiance(engine));
    karst_engine_destroy(engine);
    unlink(path);
}

/* A room of sides of 2 around the origin, which shines and mirrors: its walls lie on samples and between nodes, so that
 * all nodes within are known to be air without a look, and on which side of zero rays start is rounding. */
static const char room[] =
    "/*{ \"voxel\": 0.015625, \"view\": 20, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"-0.6\", \"0.3\", \"-0.8\"], \"yaw\": 30, \"pitch\": -12, \"fov\": 75 } }*/\n"
    "float density(vec3 p) { return max(max(abs(p.x), abs(p.y)), abs(p.z)) - 1.0; }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); m.mirror = 0.7;\n"
    "    m.emission = vec3(0.2) + 0.15 * p.zxy; return m; }\n";

static double shine(const double p[3], int c) { return 0.2 + 0.15 * p[(c + 2) % 3]; }

static void walls_between_nodes_are_met_where_they_are(void **state)
{
    (void)state;
    static float place[3 * NUM];
    const double eye[3] = {-0.6, 0.3, -0.8};
    const karst_engine_config like = {.exposure = KARST_EXPOSURE_GIVEN};
    karst_engine *engine = scene_create(room, &like, WIDTH, HEIGHT, NULL);
    settle(engine, &whole);
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_POSITION, place, 3 * NUM, &error));
    karst_engine_destroy(engine);
    int num = 0, num_off = 0;
    for (int i = 0; i < NUM; i++) {
        const float *p = place + 3 * (size_t)i;
        const double at[3] = {(double)p[0], (double)p[1], (double)p[2]};
        int wall = 0;
        double way[3], to = INFINITY, second = 0;
        for (int a = 1; a < 3; a++)
            wall = fabs(at[a]) > fabs(at[wall]) ? a : wall;
        for (int a = 0; a < 3; a++) {
            way[a] = (a == wall ? -1 : 1) * (at[a] - eye[a]);
            second = a == wall ? second : fmax(second, fabs(at[a]));
            to = fmin(to, ((way[a] > 0 ? 1 : -1) - at[a]) / way[a]);
        }
        if (second > 0.98 || fabs(fabs(at[wall]) - 1) > 1e-3) /* beside a corner starts may be of either wall */
            continue;
        num++;
        double most = 0;
        const double there[3] = {at[0] + to * way[0], at[1] + to * way[1], at[2] + to * way[2]};
        for (int c = 0; c < 3; c++)
            most = fmax(most, fabs((double)whole.light[3 * i + c] - shine(at, c) - 0.7 * shine(there, c)));
        num_off += most > 1e-3;
    }
    print_message("of %d pixels of walls %d mirror what is not there\n", num, num_off);
    assert_true(num > NUM * 9 / 10);
    assert_int_equal(num_off, 0);
}

static void what_is_out_of_range_is_said(void **state)
{
    (void)state;
    const double shares[] = {1.01, NAN, INFINITY};
    for (int i = 0; i < 3; i++) {
        karst_error error = {0};
        karst_engine_config config = base_config("hills");
        config.mirror = shares[i];
        assert_null(karst_engine_create(&config, &error));
        assert_int_equal(error.status, KARST_USAGE);
        assert_non_null(strstr(error.message, "mirror"));
    }
    assert_string_equal(karst_stream_name(KARST_STREAM_SHADOW), "shadow");
    assert_string_equal(karst_stream_name(KARST_NUM_STREAMS), "unknown");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plane_mirrors_what_is_over_it),
        cmocka_unit_test(light_is_shared_out),
        cmocka_unit_test(surfaces_mirror_each_for_itself),
        cmocka_unit_test(lanes_history_and_goes_leave_no_trace),
        cmocka_unit_test(little_memory_settles),
        cmocka_unit_test(other_sizes_leave_no_trace),
        cmocka_unit_test(far_out_light_is_the_same),
        cmocka_unit_test(walls_between_nodes_are_met_where_they_are),
        cmocka_unit_test(what_is_out_of_range_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
