/* The density producer as the engine uses it: localisation, states, chunks, scrubbing, errors;
 * channels. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "karst/camera.h"
#include "producers/channels.h"
#include "producers/density/density_producer.h"
#include "tests/support/pool.h"

/* d = -(y of level-0 voxels) - 0.5: solid below, exact for what is tried here. SPOIL(x) may spoil it. */
static const char half_space[] =
    "#include \"producers/steps/density.clh\"\n"
    "#ifndef SPOIL\n"
    "#define SPOIL(d, x) (d)\n"
    "#endif\n"
    "typedef struct { long x, y; int level; } world_axes;\n"
    "K_INLINE vfloat half_space(vlong x, vlong y) { return SPOIL((vfloat)(-0.5f) - v_to_float(y), x); }\n"
    "K_INLINE void world_prepare(world_axes *axes, long x, long y, long z, int level)\n"
    "{ axes->x = x; axes->y = y; axes->level = level; }\n"
    "K_INLINE vfloat world_sample(const world_axes *axes, vint ix, vint iy, vint iz)\n"
    "{ return half_space((vlong)(axes->x) + (v_int_to_long(ix) << axes->level), (vlong)(axes->y) + (v_int_to_long(iy) "
    "<< axes->level)); }\n"
    "K_INLINE vfloat world_row(world_axes *axes, int ix, int iy, int iz)\n"
    "{ return world_sample(axes, (vint)(ix) + V_LANE, (vint)(iy), (vint)(iz)); }\n"
    "K_INLINE vfloat world_point(const world_point_at *at, int level) { return half_space(at->voxel[0], at->voxel[1]); "
    "}\n"
    "K_INLINE void world_bounds(vlong x, vlong y, vlong z, vint level, world_bound *bound)\n"
    "{\n"
    "    vfloat side = v_as_float((level + (vint)(127 + 4)) << 23);\n"
    "    bound->hi = SPOIL((vfloat)(-0.5f) - v_to_float(y), x);\n"
    "    bound->lo = bound->hi - side;\n"
    "    bound->slope[0] = bound->slope[2] = (vfloat)(0.0f);\n"
    "    bound->slope[1] = (vfloat)(1.0f);\n"
    "    bound->slack = (vfloat)(0.0f);\n"
    "}\n"
    "K_INLINE void world_slopes(vlong x, vlong y, vlong z, vint level, world_bound *bound)\n"
    "{ world_bounds(x, y, z, level, bound); }\n"
    "K_INLINE float world_slack(int level) { return 0.0f; }\n";

static karst_context *make_context(int lanes)
{
    karst_error error = {0};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error);
    pool_expect(context, "context", &error);
    return context;
}

typedef struct {
    int lanes;
    karst_shape shape;
    bool in_two_steps;
} way; /* to produce */

static karst_producer *make_producer(karst_context *context, const way *how, const char *options, uint32_t max_loads)
{
    karst_error error = {0};
    karst_density_program program = {.name = "half space",
                                     .source = half_space,
                                     .options = options,
                                     .shape = how->shape,
                                     .in_two_steps = how->in_two_steps,
                                     .max_loads = max_loads};
    karst_producer *producer = karst_density_producer_create_program(context, &program, &error);
    pool_expect(producer, "producer", &error);
    return producer;
}

static const way shapes[] = {{16, KARST_SHAPE_ROWS, false},   {1, KARST_SHAPE_ROWS, false},
                             {16, KARST_SHAPE_ROWS, true},    {1, KARST_SHAPE_ROWS, true},
                             {1, KARST_SHAPE_GROUPS, false}, {16, KARST_SHAPE_GROUPS, false}};
#define NUM_SHAPES (sizeof shapes / sizeof *shapes)

/* What a node of the half space is by its bounds. */
static uint32_t by_bounds(int64_t y, int level)
{
    int64_t side = (int64_t)KARST_BRICK_CELLS << level;
    return y * side >= 0 ? KARST_STATE_AIR : (y + 1) * side < 0 ? KARST_STATE_SOLID : KARST_STATE_UNKNOWN;
}

static void test_subdivide(void **state)
{
    (void)state;
    static const pool_node parents[] = {
        {{0, 0, 0}, 1},   {{0, -1, 0}, 1},   {{-1, -1, -1}, 5},          {{7, -2, -3}, 9},
        {{-8, 3, 1}, 20}, {{3, -1, -4}, 40}, {{1000000007, -1, -99}, 2}, {{-562949953421312, 0, 562949953421311}, 3},
        {{1, 1, 1}, 1},   {{-1, -1, 0}, 2},  {{4, -1, 5}, 30},
    };
    enum { COUNT = sizeof parents / sizeof *parents }; /* odd: the last tile has a work-item of its own */
    for (size_t s = 0; s < NUM_SHAPES; s++) {
        karst_node nodes[COUNT * KARST_TILE_NODES];
        karst_tile_info infos[COUNT];
        karst_error error = {0};
        karst_context *context = make_context(shapes[s].lanes);
        karst_producer *producer = make_producer(context, &shapes[s], "", COUNT);
        pool p;
        pool_open(&p, context, COUNT, 1);
        pool_ask(&p, parents, COUNT);
        pool_expect(producer->ops->subdivide(producer, &p.cache, &p.work, &error), "subdivide", &error);
        pool_read_tiles(&p, nodes, infos);
        for (int i = 0; i < COUNT; i++) {
            assert_int_equal(infos[i].level, parents[i].level - 1);
            for (int axis = 0; axis < 3; axis++)
                assert_int_equal(infos[i].corner[axis], 2 * parents[i].at[axis]);
            assert_int_equal(infos[i].in_use, 0); /* the cache's business */
            assert_int_equal(infos[i].generation, 0);
            for (int c = 0; c < KARST_TILE_NODES; c++) {
                pool_node child = pool_child(parents[i], c);
                uint32_t bounds = by_bounds(child.at[1], child.level),
                         expected = bounds == KARST_STATE_UNKNOWN ? KARST_STATE_LOST : bounds;
                karst_node node = nodes[i * KARST_TILE_NODES + c];
                assert_int_equal(node.link, KARST_NODE_LINK(expected, KARST_NONE));
                assert_int_equal(node.brick, KARST_NONE);
            }
        }
        pool_close(&p);
        karst_producer_destroy(producer);
        karst_context_destroy(context);
    }
}

/* Loads of unknown nodes run the bounds too; more loads than a chunk; several segments of bricks. */
static void test_loads(void **state)
{
    (void)state;
    enum { COUNT = 1200 };
    for (size_t s = 0; s < NUM_SHAPES; s++) {
        pool_node nodes[COUNT];
        uint32_t states[COUNT];
        karst_error error = {0};
        karst_context *context = make_context(shapes[s].lanes);
        karst_producer *producer = make_producer(context, &shapes[s], "", COUNT);
        uint32_t stride, num_bricks = 0;
        karst_buffer *staging = karst_density_producer_staging(producer, &stride);
        assert_true(producer->max_chunk < COUNT);
        assert_true((staging == NULL) == (shapes[s].shape == KARST_SHAPE_ROWS && !shapes[s].in_two_steps));
        assert_true(!staging || staging->size_bytes == (size_t)producer->max_chunk * stride * sizeof(float));
        for (int i = 0; i < COUNT; i++)
            nodes[i] = (pool_node){{i - 100, i % 3 - 2, -i}, i % 7};
        pool p;
        pool_open(&p, context, COUNT, 3);
        pool_ask(&p, nodes, COUNT);
        p.work.num_subdivides = 0;
        pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "answer", &error);
        pool_read_results(&p, states);
        for (uint32_t i = 0; i < COUNT; i++) {
            uint32_t bounds = by_bounds(nodes[i].at[1], nodes[i].level);
            assert_int_equal(states[i], bounds == KARST_STATE_UNKNOWN ? KARST_STATE_BRICK : bounds);
            if (states[i] != KARST_STATE_BRICK)
                continue;
            int16_t q[KARST_BRICK_SAMPLES];
            karst_brick_info info;
            pool_read_brick(&p, i, q, &info);
            num_bricks++;
            for (int n = 0; n < KARST_BRICK_SAMPLES; n++) {
                int64_t y = (nodes[i].at[1] * KARST_BRICK_CELLS + n / KARST_BRICK_SIDE % KARST_BRICK_SIDE) *
                            ((int64_t)1 << nodes[i].level);
                assert_true(fabs(info.scale * q[n] - (-0.5 - (double)y)) <= info.scale);
            }
        }
        assert_int_equal(num_bricks, COUNT / 3); /* those just below y = 0 */
        assert_int_equal(karst_density_producer_non_finite(producer), 0);
        pool_close(&p);
        karst_producer_destroy(producer);
        karst_context_destroy(context);
    }
}

/* Densities that are not finite become air, are counted over all rounds, and the first is remembered. */
static void test_not_finite(void **state)
{
    (void)state;
    static const pool_node nodes[] = {{{5, -1, 0}, 0}, {{6, -1, 0}, 0}, {{7, -1, 0}, 0}};
    enum { COUNT = 3 };
    for (size_t s = 0; s < NUM_SHAPES; s++) {
        uint32_t states[COUNT];
        karst_error error = {0};
        int64_t voxel[3];
        int level;
        karst_context *context = make_context(shapes[s].lanes);
        /* 0 / 0 at x = 100 */
        karst_producer *producer = make_producer(context, &shapes[s],
                                                 "-DSPOIL(d,x)=((d)*v_to_float((x)-100)/v_to_float((x)-100))", COUNT);
        pool p;
        assert_false(karst_density_producer_first_non_finite(producer, voxel, &level));
        pool_open(&p, context, COUNT, 1);
        for (int round = 1; round <= 2; round++) {
            pool_ask(&p, nodes, COUNT);
            p.work.num_subdivides = 0;
            pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "answer", &error);
            pool_read_results(&p, states);
            for (int i = 0; i < COUNT; i++)
                assert_int_equal(states[i], KARST_STATE_BRICK);
            assert_int_equal(karst_density_producer_non_finite(producer), round * KARST_BRICK_SIDE * KARST_BRICK_SIDE);
            assert_true(karst_density_producer_first_non_finite(producer, voxel, &level));
            assert_int_equal(voxel[0], 100);
            assert_int_equal(voxel[1], -16);
            assert_int_equal(voxel[2], 0);
            assert_int_equal(level, 0);
        }
        pool_close(&p);
        karst_producer_destroy(producer);
        karst_context_destroy(context);
    }
}

static void test_bad_program(void **state)
{
    (void)state;
    karst_error error = {0};
    karst_context *context = make_context(0);
    karst_density_program program = {
        .name = "bad", .source = "vfloat world_row(\n  nonsense;\n", .options = "", .max_loads = 8};
    assert_null(karst_density_producer_create_program(context, &program, &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_non_null(strstr(error.message, "world.clh"));
    karst_producer_destroy(NULL);
    karst_context_destroy(context);
}

static void test_channels(void **state)
{
    (void)state;
    karst_channel channels[] = {{.name = "density", .format = KARST_FORMAT_SCALED_I16, .components = 1},
                                {.name = "colour", .format = KARST_FORMAT_UNIT_U16, .components = 3}};
    karst_channel_layout layout;
    karst_error error = {0};
    char text[512], few[20];

    /* Density alone fills the pool's slots; nothing is kept for what is not used. */
    assert_true(karst_channels_lay_out(channels, 1, &layout, &error));
    assert_int_equal(layout.slot_stride, KARST_BRICK_PADDED);
    int length = karst_channels_options(&layout, text, sizeof text);
    assert_int_equal(length, strlen(text));
    assert_string_equal(text, "-DCHANNEL_DENSITY_STAGING=0 -DCHANNEL_DENSITY_SLOT=0 -DCHANNEL_DENSITY_STRIDE=1 "
                              "-DSTAGING_STRIDE=4928 -DSLOT_STRIDE=4928");
    assert_int_equal(karst_channels_options(&layout, few, sizeof few), length);
    assert_string_equal(few, "-DCHANNEL_DENSITY_S");

    assert_true(karst_channels_lay_out(channels, 2, &layout, &error));
    assert_int_equal(channels[1].slot_offset, 4928);
    assert_int_equal(channels[1].slot_stride, 3);
    assert_true(layout.slot_stride >= 4928 + 3 * KARST_BRICK_SAMPLES && layout.slot_stride % 32 == 0);
    assert_true(layout.staging_stride >= 4928 + 3 * KARST_BRICK_SAMPLES && layout.staging_stride % 16 == 0);
    karst_channels_options(&layout, text, sizeof text);
    assert_non_null(strstr(text, "-DCHANNEL_COLOUR_STRIDE=3 "));

    channels[1].components = 5;
    assert_false(karst_channels_lay_out(channels, 2, &layout, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_non_null(strstr(error.message, "colour"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_subdivide),   cmocka_unit_test(test_loads),  cmocka_unit_test(test_not_finite),
        cmocka_unit_test(test_bad_program), cmocka_unit_test(test_channels),
    };
    return cmocka_run_group_tests_name("producer", tests, NULL, NULL);
}
