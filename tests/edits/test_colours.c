/* Colours of edits in pictures: seen at every distance, the same whatever draws them, and nothing where there are
 * none. */
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

#define WIDTH 160
#define HEIGHT 120
#define NUM_PIXELS (WIDTH * HEIGHT)
#define NUM_BYTES (NUM_PIXELS * 4)
#define MAX_FRAMES 200
#define VOXEL_M 0.125

static char world_path[] = "/tmp/karst-colours-XXXXXX.karst";

/* A plane, seen from 12 m above it to where it ends. */
static int write_world(void **state)
{
    (void)state;
    int fd = mkstemps(world_path, 6);
    FILE *file = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (!file)
        return -1;
    fputs("/*{ \"voxel\": 0.125, \"view_distance\": 60000,\n"
          "    \"camera\": { \"position\": [\"0\", \"12\", \"0\"], \"yaw\": 0, \"pitch\": -20 } }*/\n"
          "float density(vec3 p) { return 0.04 - p.y; }\n",
          file);
    return fclose(file);
}

static int remove_world(void **state)
{
    (void)state;
    return remove(world_path);
}

static karst_engine_config base_config(void)
{
    return (karst_engine_config){.world = world_path,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .samples = 2,
                                 .pool_bytes = (uint64_t)1 << 27};
}

static karst_stats take(karst_engine *engine, uint8_t *rgba)
{
    karst_stats stats;
    bool settled;
    assert_ok(karst_engine_settle(engine, MAX_FRAMES, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_check(engine, &error));
    assert_ok(karst_engine_read_pixels(engine, rgba, NUM_BYTES, &error));
    karst_engine_stats(engine, &stats);
    return stats;
}

static void read_aov(karst_engine *engine, karst_aov aov, float *values)
{
    assert_ok(karst_engine_read_aov(engine, aov, values, (size_t)NUM_PIXELS * (size_t)karst_aov_width(aov), &error));
}

static uint64_t memory_of_colours(const karst_stats *stats)
{
    for (size_t i = 0; i < stats->num_memory; i++)
        if (strcmp(stats->memory[i].name, "colours") == 0)
            return stats->memory[i].size_bytes;
    return 0;
}

static karst_position place(double x_m, double y_m, double z_m)
{
    const double at_m[3] = {x_m, y_m, z_m};
    return karst_position_add_m((karst_position){{0}, {0}}, at_m, -3);
}

#define EDGE_M 3.3 /* no node ends there */
static const double paint[3] = {0.7, 0.05, 0.2};

/* All that lies on one side of x = EDGE_M. */
static karst_edit half_painted(void)
{
    return (karst_edit){.shape = KARST_EDIT_PLANE,
                        .mode = KARST_EDIT_PAINT,
                        .at = place(EDGE_M, 0, 0),
                        .normal = {1, 0, 0},
                        .has_colour = true,
                        .colour = {paint[0], paint[1], paint[2]},
                        .strength = 1};
}

/* Every pixel has the paint's colour or the world's, at whatever level it lies and also where levels blend; but near
 * the edge. */
static void paint_is_seen_at_every_level(void **state)
{
    (void)state;
    static uint8_t rgba[NUM_BYTES];
    static float before[NUM_PIXELS * 3], albedo[NUM_PIXELS * 3], at[NUM_PIXELS * 3], level[NUM_PIXELS];
    karst_engine_config config = base_config();
    karst_engine *engine = scene_open(&config);
    take(engine, rgba);
    read_aov(engine, KARST_AOV_ALBEDO, before);
    const karst_edit edit = half_painted();
    assert_ok(karst_engine_edit(engine, &edit, 1, &error));
    take(engine, rgba);
    read_aov(engine, KARST_AOV_ALBEDO, albedo);
    read_aov(engine, KARST_AOV_POSITION, at);
    read_aov(engine, KARST_AOV_LEVEL, level);
    int num_painted[32] = {0}, num_levels = 0;
    for (int i = 0; i < NUM_PIXELS; i++) {
        if (level[i] < 0)
            continue;
        const double beyond_m = (double)at[3 * i] - EDGE_M, voxel_m = VOXEL_M * exp2((double)level[i]);
        if (fabs(beyond_m) < 3 * voxel_m)
            continue;
        for (int c = 0; c < 3; c++) {
            const double expected = beyond_m < 0 ? paint[c] : (double)before[3 * i + c];
            if (fabs((double)albedo[3 * i + c] - expected) > 0.005)
                fail_msg("pixel %d, level %g, %g m from the edge: colour %d is %g, not %g", i, (double)level[i],
                         beyond_m, c, (double)albedo[3 * i + c], expected);
        }
        num_painted[(int)level[i]] += beyond_m < 0;
    }
    for (int l = 0; l < 32; l++)
        num_levels += num_painted[l] > 20;
    print_message("# %d levels with paint\n", num_levels);
    assert_true(num_levels >= 6);
    karst_engine_destroy(engine);
}

static void scatter(karst_engine *engine)
{
    karst_edit edits[40];
    for (int i = 0; i < 40; i++)
        edits[i] = (karst_edit){.shape = i % 3 ? KARST_EDIT_SPHERE : KARST_EDIT_BOX,
                                .mode = i % 4 ? KARST_EDIT_PAINT : KARST_EDIT_ADD,
                                .at = place((i * 37 % 41 - 20) * 0.9, 0, 14 + i * 1.7),
                                .half_m = {1, 1, 1 + i % 5},
                                .radius_m = 0.3 + i % 7 * 0.5,
                                .blend_m = i % 5 ? 0 : 1,
                                .has_colour = true,
                                .colour = {i % 2, i % 3 * 0.5, i % 11 * 0.1},
                                .strength = i % 6 ? 1 : 0.4};
    assert_ok(karst_engine_edit(engine, edits, 40, &error));
}

/* Lanes, segments of pools, and bounces of a mirroring land: the same bytes. */
static void pictures_are_the_same_whatever_draws_them(void **state)
{
    (void)state;
    static uint8_t first[NUM_BYTES], other[NUM_BYTES], plain[NUM_BYTES];
    karst_engine_config config = base_config();
    config.mirror = 0.3;
    config.lanes = 16;
    karst_engine *engine = scene_open(&config);
    take(engine, plain);
    scatter(engine);
    take(engine, first);
    assert_memory_not_equal(first, plain, NUM_BYTES);
    karst_engine_destroy(engine);
    for (int way = 0; way < 2; way++) {
        config.lanes = way ? 16 : 1;
        config.max_segment_bytes = way ? config.pool_bytes / 5 : 0;
        engine = scene_open(&config);
        scatter(engine);
        take(engine, other);
        assert_memory_equal(other, first, NUM_BYTES);
        karst_engine_destroy(engine);
    }
}

/* Before the first colour there is nothing of it, also with edits; after the last was undone the picture is as it was,
 * in every byte. A mark of paint forgets what its box meets. */
static void who_does_not_paint_does_not_pay(void **state)
{
    (void)state;
    static uint8_t plain[NUM_BYTES], painted[NUM_BYTES], undone[NUM_BYTES];
    karst_engine_config config = base_config();
    karst_engine *engine = scene_open(&config);
    const karst_edit hole = {.at = place(0, 0, 20), .mode = KARST_EDIT_REMOVE, .radius_m = 2};
    assert_ok(karst_engine_edit(engine, &hole, 1, &error));
    karst_stats stats = take(engine, plain);
    assert_int_equal(memory_of_colours(&stats), 0);
    const karst_edit edit = half_painted();
    assert_ok(karst_engine_edit(engine, &edit, 1, &error));
    stats = take(engine, painted);
    assert_true(memory_of_colours(&stats) > 0);
    assert_memory_not_equal(painted, plain, NUM_BYTES);
    karst_edit mark = edit;
    mark.shape = KARST_EDIT_SPHERE;
    mark.radius_m = 3;
    mark.at = place(0, -3000, 0);
    assert_ok(karst_engine_edit(engine, &mark, 1, &error));
    karst_edit_report report = karst_engine_edit_report(engine);
    assert_true(report.num_nodes > 0 && report.num_nodes < 60);
    size_t num = 2;
    assert_ok(karst_engine_undo(engine, &num, &error));
    take(engine, undone);
    assert_memory_equal(undone, plain, NUM_BYTES);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paint_is_seen_at_every_level),
        cmocka_unit_test(pictures_are_the_same_whatever_draws_them),
        cmocka_unit_test(who_does_not_paint_does_not_pay),
    };
    return cmocka_run_group_tests(tests, write_world, remove_world);
}
