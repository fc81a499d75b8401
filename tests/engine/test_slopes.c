/* Slopes of bricks (raycast/cast/slopes_shared.h) as an engine keeps them: known once a view stands, and of what a slot
 * holds now, not of what it held before. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/engine/engine_parts.h"
#include "karst/karst.h"
#include "raycast/cast/slopes_shared.h"
#include "tests/support/ok.h"

enum { WIDTH_PX = 160, HEIGHT_PX = 120 };

static const char world_text[] =
    "/*{ \"voxel\": 0.25, \"view\": 200, \"camera\": { \"position\": [\"0\", \"14\", \"-20\"], \"pitch\": -20 } }*/\n"
    "float density(vec3 p) { return 4.0 * fbm(p / 16.0, 3) - p.y; }\n";
static char world_path[] = "/tmp/karst-slopes-XXXXXX.karst";

static karst_engine *create(double budget_ms, uint32_t num_bricks)
{
    karst_error error = {0};
    const karst_engine_config config = {.world = world_path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH_PX,
                                        .height_px = HEIGHT_PX,
                                        .pool_bytes = (uint64_t)64 << 20,
                                        .num_bricks = num_bricks,
                                        .budget_ms = budget_ms,
                                        .no_shadows = true};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

/* The largest difference to the next sample along an axis, or against it. */
static double largest_rise(const int16_t *q, int axis, int way)
{
    static const int next[3] = {1, KARST_BRICK_SIDE, KARST_BRICK_SIDE * KARST_BRICK_SIDE};
    double most = -1e30;
    for (int i = 0; i < KARST_BRICK_SAMPLES; i++)
        if (i / next[axis] % KARST_BRICK_SIDE < KARST_BRICK_CELLS)
            most = fmax(most, (way ? -1.0 : 1.0) * ((double)q[i + next[axis]] - q[i]));
    return most;
}

/* How many bricks' slopes are not known. Those that are must be of the samples there. */
static uint32_t count_unknown(karst_engine *engine, uint32_t *num_known)
{
    const karst_cache_buffers *b = karst_cache_get_buffers(engine->cache);
    const uint32_t num_slots = b->num_bricks + KARST_CACHE_ROOT_BRICKS;
    karst_brick_owner *owners = malloc(num_slots * sizeof *owners);
    karst_brick_info *infos = malloc(num_slots * sizeof *infos);
    int16_t q[KARST_BRICK_SAMPLES];
    uint32_t num_unknown = 0;
    assert_ok(karst_buffer_read(b->brick_owner, 0, owners, num_slots * sizeof *owners, &error) &&
              karst_buffer_read(b->brick_info, 0, infos, num_slots * sizeof *infos, &error));
    *num_known = 0;
    for (uint32_t slot = 1; slot < num_slots; slot++) {
        if (owners[slot].owner == KARST_NO_NODE)
            continue;
        if (!(infos[slot].slopes[1] & KARST_SLOPES_KNOWN)) {
            assert_true(infos[slot].slopes[0] == 0 && infos[slot].slopes[1] == 0);
            num_unknown++;
            continue;
        }
        ++*num_known;
        assert_ok(karst_buffer_read(b->bricks[slot / b->bricks_per_segment],
                                    (size_t)(slot % b->bricks_per_segment) * KARST_BRICK_BYTES(16), q, sizeof q,
                                    &error));
        for (int way = 0; way < 2; way++)
            for (int axis = 0; axis < 3; axis++) {
                double share = (double)karst_slope_of(infos[slot].slopes[way], axis) / KARST_SLOPE_ONE;
                double rise = largest_rise(q, axis, way) * (double)infos[slot].safe_cells;
                assert_true(share >= rise - 1e-6 && share <= rise + 1.001 / KARST_SLOPE_ONE);
            }
    }
    free(owners);
    free(infos);
    return num_unknown;
}

static karst_stats settle(karst_engine *engine, double yaw_deg)
{
    bool settled = false;
    karst_stats stats;
    karst_camera camera = karst_engine_default_camera(engine);
    camera.yaw_deg = yaw_deg;
    assert_ok(karst_engine_set_camera(engine, &camera, &error) &&
              karst_engine_settle(engine, 0, NULL, NULL, &settled, &error));
    assert_true(settled);
    karst_engine_stats(engine, &stats);
    return stats;
}

/* In a pool in which each view takes slots of the one before. */
static void test_slopes_are_of_what_slots_hold(void **state)
{
    (void)state;
    uint32_t num_known;
    karst_engine *engine = create(0, 0);
    const uint32_t num_used = (uint32_t)settle(engine, 0).bricks.num_used;
    karst_engine_destroy(engine);
    engine = create(0, num_used + num_used / 4);
    for (int turn = 0; turn < 5; turn++) {
        settle(engine, 100 * turn);
        assert_true(count_unknown(engine, &num_known) > num_used / 10);
        assert_true(turn == 0 ? num_known == 0 : num_known > 0); /* of what is left of the last view */
        assert_ok(karst_engine_frame(engine, &error));
        assert_true(count_unknown(engine, &num_known) == 0 && num_known >= num_used / 2);
    }
    karst_engine_destroy(engine);
}

/* With a budget in ms a part of the pool at a time, and in motion none. */
static void test_frames_with_a_budget_survey_parts(void **state)
{
    (void)state;
    uint32_t num_known;
    karst_engine *engine = create(20, 10000);
    karst_camera camera = karst_engine_default_camera(engine);
    for (int frame = 0; frame < 5; frame++) {
        camera.yaw_deg = frame;
        assert_ok(karst_engine_set_camera(engine, &camera, &error) && karst_engine_frame(engine, &error));
    }
    assert_true(count_unknown(engine, &num_known) > 0 && num_known == 0);
    settle(engine, 0);
    assert_true(count_unknown(engine, &num_known) > 0 && num_known == 0);
    assert_ok(karst_engine_frame(engine, &error));
    assert_in_range(engine->num_surveyed, 1, 5000);
    for (int frame = 0; frame < 10; frame++)
        assert_ok(karst_engine_frame(engine, &error));
    assert_int_equal(count_unknown(engine, &num_known), 0);
    karst_engine_destroy(engine);
}

static int write_world(void **state)
{
    (void)state;
    int file = mkstemps(world_path, 6);
    bool done = file >= 0 && write(file, world_text, sizeof world_text - 1) == (ssize_t)sizeof world_text - 1;
    return file >= 0 && close(file) == 0 && done ? 0 : -1;
}

static int remove_world(void **state)
{
    (void)state;
    return unlink(world_path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_slopes_are_of_what_slots_hold),
        cmocka_unit_test(test_frames_with_a_budget_survey_parts),
    };
    return cmocka_run_group_tests(tests, write_world, remove_world);
}
