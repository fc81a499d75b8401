/* Tests that every shipped world must pass. A test program includes the world's source, which makes it host C of one
 * lane, and hands its functions and golden hashes to run_world_suite. */
#ifndef KARST_TESTS_PRODUCERS_WORLD_SUITE_H
#define KARST_TESTS_PRODUCERS_WORLD_SUITE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "producers/density.clh"
#include "producers/density_producer.h"
#include "producers/evaluate.h"
#include "tests/support/pool.h"

/* Level, node and footprints are spread by this, so that a failure can be repeated. */
static uint64_t suite_random_state = 0x9e3779b97f4a7c15u;
static uint32_t suite_random(void)
{
    suite_random_state = suite_random_state * 6364136223846793005u + 1442695040888963407u;
    uint64_t mixed = suite_random_state ^ suite_random_state >> 29;
    return (uint32_t)(mixed * 0xbf58476d1ce4e5b9u >> 32);
}

/* A world as host C. */
typedef struct {
    const char *name;
    uint32_t seed;                                                            /* as compiled */
    int voxel_log2_m;                                                         /* as compiled */
    void (*rows)(const karst_load *load, float samples[KARST_BRICK_SAMPLES]); /* world_prepare, _row and _sample */
    float (*point)(const world_point_at *at, int level);                      /* world_point */
    uint64_t golden_samples, golden_bricks;
} host_world;
static const host_world *suite;

static const karst_world_info *suite_world(void)
{
    const karst_world_info *world = karst_world_find(suite->name);
    assert_non_null(world);
    /* What the host compiled is what the device is asked for. */
    assert_int_equal(world->voxel_log2_m, suite->voxel_log2_m);
    return world;
}

static karst_context *suite_context(int lanes)
{
    karst_error error = {0};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error);
    pool_expect(context, "context", &error);
    return context;
}

static karst_producer *suite_producer(karst_context *context, karst_shape shape, const char *finalise_options,
                                      uint32_t max_loads)
{
    const karst_world_info *world = suite_world();
    karst_error error = {0};
    char source[256], options[128];
    snprintf(source, sizeof source, "#include \"%s\"\n", world->source_path);
    karst_world_options(world, suite->seed, options, sizeof options);
    karst_density_program program = {.name = world->name,
                                     .source = source,
                                     .options = options,
                                     .shape = shape,
                                     .finalise_options = finalise_options,
                                     .max_loads = max_loads};
    karst_producer *producer = karst_density_producer_create_program(context, &program, &error);
    pool_expect(producer, "producer", &error);
    return producer;
}

/* ---- the same world: every shape, and host C, agree in every bit ---- */

#define NUM_SHAPES 4
static const struct {
    int lanes;
    karst_shape shape;
    const char *name;
} suite_shapes[NUM_SHAPES] = {{16, KARST_SHAPE_ROWS, "16 lanes, rows"},
                              {1, KARST_SHAPE_ROWS, "1 lane, rows"},
                              {1, KARST_SHAPE_GROUPS, "1 lane, groups"},
                              {16, KARST_SHAPE_GROUPS, "16 lanes, groups"}};

static karst_evaluator *suite_evaluator(karst_context *context, karst_shape shape, const karst_channel_layout *layout)
{
    const karst_world_info *world = suite_world();
    karst_error error = {0};
    char source[256], options[128];
    snprintf(source, sizeof source, "#include \"%s\"\n", world->source_path);
    karst_world_options(world, suite->seed, options, sizeof options);
    const karst_virtual_file file = {"world.clh", source};
    karst_evaluator *evaluator = karst_evaluator_create(context, shape, layout, &file, options, &error);
    pool_expect(evaluator, "evaluator", &error);
    return evaluator;
}

/* The samples of one brick as host C gives them: by rows, and a part of them again by point. */
static void host_samples(const karst_load *load, float samples[KARST_BRICK_SAMPLES])
{
    suite->rows(load, samples);
    for (int i = 0; i < KARST_BRICK_SAMPLES; i += 29) {
        const int steps[3] = {i % KARST_BRICK_SIDE, i / KARST_BRICK_SIDE % KARST_BRICK_SIDE,
                              i / KARST_BRICK_SIDE / KARST_BRICK_SIDE};
        world_point_at at;
        for (int axis = 0; axis < 3; axis++) {
            at.voxel[axis] = load->origin[axis] + ((int64_t)steps[axis] << load->level);
            at.fraction[axis] = 0;
        }
        float point = suite->point(&at, load->level);
        if (memcmp(&point, &samples[i], sizeof point) != 0)
            fail_msg("level %d, sample %d at (%ld, %ld, %ld): row %a, point %a", load->level, i, at.voxel[0],
                     at.voxel[1], at.voxel[2], samples[i], point);
    }
}

/* Nodes at 0, 10^9 and 10^15 voxels from the origin, at several levels, near the height of the surface (and, in the
 * last set, not). */
#define BRICKS_A_CASE 56
#define NUM_LEVELS 5
#define NUM_OFFSETS 4
#define NUM_SAME (BRICKS_A_CASE * NUM_LEVELS * NUM_OFFSETS)
static void same_world_loads(karst_load *loads)
{
    static const int levels[NUM_LEVELS] = {0, 2, 4, 7, 11};
    static const int64_t offsets[NUM_OFFSETS][3] = {{0, 0, 0},
                                                    {1000000000, 0, -700000001},
                                                    {-1000000000000000, 0, 999999999999989},
                                                    {999999999999999, 1000000000, -1000000000000000}};
    size_t n = 0;
    for (int o = 0; o < NUM_OFFSETS; o++)
        for (int l = 0; l < NUM_LEVELS; l++)
            for (int b = 0; b < BRICKS_A_CASE; b++, n++) {
                int level = levels[l];
                loads[n] = (karst_load){.level = level, .state = KARST_STATE_UNKNOWN};
                for (int axis = 0; axis < 3; axis++) {
                    int64_t voxel =
                        offsets[o][axis] + (int64_t)(suite_random() % 16384) - 8192; /* within 512 m of it */
                    loads[n].origin[axis] = karst_node_origin(voxel >> (level + KARST_BRICK_CELLS_LOG2), level);
                }
            }
}

static void test_same_world(void **state)
{
    (void)state;
    karst_channel channels[] = {{.name = "density", .components = 1}};
    karst_channel_layout layout;
    karst_error error = {0};
    karst_load *loads = calloc(NUM_SAME, sizeof *loads);
    assert_non_null(loads);
    assert_true(karst_channels_lay_out(channels, 1, &layout, &error));
    size_t stride = layout.staging_stride, size_bytes = NUM_SAME * stride * sizeof(float);
    float *samples[NUM_SHAPES], host[KARST_BRICK_SAMPLES];

    same_world_loads(loads);
    for (int s = 0; s < NUM_SHAPES; s++) {
        karst_context *context = suite_context(suite_shapes[s].lanes);
        karst_evaluator *evaluator = suite_evaluator(context, suite_shapes[s].shape, &layout);
        karst_buffer *load_buffer = karst_buffer_create(context, "test", NUM_SAME * sizeof *loads, loads, &error);
        karst_buffer *staging = karst_buffer_create(context, "test", size_bytes, NULL, &error);
        samples[s] = malloc(size_bytes);
        assert_non_null(samples[s]);
        pool_expect(load_buffer && staging &&
                        karst_evaluate_bricks(evaluator, load_buffer, NUM_SAME, staging, &error) &&
                        karst_buffer_read(staging, 0, samples[s], size_bytes, &error),
                    suite_shapes[s].name, &error);
        karst_buffer_destroy(load_buffer);
        karst_buffer_destroy(staging);
        karst_evaluator_destroy(evaluator);
        karst_context_destroy(context);
    }
    size_t num_distinct = 0;
    for (size_t n = 0; n < NUM_SAME; n++) {
        host_samples(loads + n, host);
        for (int s = 0; s < NUM_SHAPES; s++)
            for (int i = 0; i < KARST_BRICK_SAMPLES; i++)
                if (memcmp(&samples[s][n * stride + (size_t)i], &host[i], sizeof(float)) != 0)
                    fail_msg("%s: level %d, origin (%ld, %ld, %ld), sample %d: %a on the device, %a on the host",
                             suite_shapes[s].name, loads[n].level, loads[n].origin[0], loads[n].origin[1],
                             loads[n].origin[2], i, samples[s][n * stride + (size_t)i], host[i]);
        num_distinct += memcmp(&host[0], &host[KARST_BRICK_SAMPLES - 1], sizeof(float)) != 0;
    }
    print_message("%s: %d bricks, %.1f million voxels, agree in 4 shapes and on the host\n", suite->name, NUM_SAME,
                  NUM_SAME * (double)KARST_BRICK_SAMPLES * 1e-6);
    assert_true(num_distinct > NUM_SAME / 5); /* or it would have compared constants */
    for (int s = 0; s < NUM_SHAPES; s++)
        free(samples[s]);
    free(loads);
}

/* ---- nothing lost: what is called constant has no surface in it ---- */

typedef struct {
    pool_node node;
    uint32_t state;
    bool by_samples; /* proven by finalise rather than by bounds */
} constant_node;

typedef struct {
    constant_node *nodes;
    size_t count;
} constant_list;

static void add_constant(constant_list *list, pool_node node, uint32_t state, bool by_samples)
{
    if ((list->count & (list->count - 1)) == 0)
        assert_non_null(list->nodes = realloc(list->nodes, (list->count ? 2 * list->count : 1) * sizeof *list->nodes));
    list->nodes[list->count++] = (constant_node){node, state, by_samples};
}

#define TOP_LEVEL 10
/* Points on a side of the grids that look for surface, at full density and at each footprint. */
#ifdef __SANITIZE_ADDRESS__ /* several times slower */
#define GRID_FULL 8
#define GRID_FOOTPRINTS 4
#else
#define GRID_FULL 14
#define GRID_FOOTPRINTS 5
#endif
/* Nodes that go on to the next level: a spread over all of them, more where a voxel is as wide as the smallest
 * features. */
#define MAX_KEPT 512
#define KEPT_AT(level) ((level) >= 6 ? MAX_KEPT : 64)

/* Builds the octree of the 2x2x2 nodes around the origin from TOP_LEVEL down to level 0 with the real kernels. */
static void build_tree(const char *finalise_options, constant_list *constants)
{
    enum { CAPACITY = MAX_KEPT * KARST_TILE_NODES };
    static pool_node open[CAPACITY];
    static karst_node nodes[CAPACITY * KARST_TILE_NODES];
    static karst_tile_info infos[CAPACITY];
    static uint32_t states[CAPACITY];
    uint32_t num_open = 0;
    karst_context *context = suite_context(16);
    karst_producer *producer = suite_producer(context, KARST_SHAPE_AUTO, finalise_options, CAPACITY);
    karst_error error = {0};
    pool p;

    pool_open(&p, context, CAPACITY, 1);
    for (int i = 0; i < 8; i++)
        open[num_open++] = (pool_node){{(i & 1) - 1, (i >> 1 & 1) - 1, (i >> 2) - 1}, TOP_LEVEL};
    while (num_open) {
        /* Which of the open nodes stay open, then the children of a spread of those. */
        uint32_t num_left = 0, num_kept;
        pool_ask(&p, open, num_open);
        p.work.num_subdivides = 0;
        pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "load", &error);
        pool_read_results(&p, states);
        for (uint32_t i = 0; i < num_open; i++)
            if (states[i] == KARST_STATE_AIR || states[i] == KARST_STATE_SOLID)
                add_constant(constants, open[i], states[i], true);
            else
                open[num_left++] = open[i];
        if (num_left == 0 || open[0].level == 0)
            break;
        num_kept = num_left < KEPT_AT(open[0].level) ? num_left : KEPT_AT(open[0].level);
        for (uint32_t i = 0; i < num_kept; i++)
            open[i] = open[(uint64_t)i * num_left / num_kept];
        pool_ask(&p, open, num_kept);
        p.work.num_loads = 0;
        pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "subdivide", &error);
        pool_read_tiles(&p, nodes, infos);
        pool_node parents[MAX_KEPT];
        memcpy(parents, open, num_kept * sizeof *parents);
        num_open = 0;
        for (uint32_t i = 0; i < num_kept * KARST_TILE_NODES; i++) {
            pool_node child = pool_child(parents[i / KARST_TILE_NODES], (int)(i % KARST_TILE_NODES));
            uint32_t node_state = KARST_NODE_STATE(nodes[i].link);
            if (node_state == KARST_STATE_LOST)
                open[num_open++] = child;
            else
                add_constant(constants, child, node_state, false);
        }
    }
    pool_close(&p);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
}

/* A point of a node: `at` in [0, 2^32] per axis is its place from corner to corner. */
static world_point_at point_in(const pool_node *node, const uint64_t at[3])
{
    world_point_at point;
    int shift = node->level + KARST_BRICK_CELLS_LOG2; /* node side = 2^shift level-0 voxels */
    for (int axis = 0; axis < 3; axis++) {
        point.voxel[axis] = karst_node_origin(node->at[axis], node->level) + (int64_t)((at[axis] << shift) >> 32);
        point.fraction[axis] = (uint32_t)(at[axis] << shift);
    }
    return point;
}

/* How far the density at a point is on the wrong side, for a node said to be `state`: above 0 (or 0 in a solid node,
 * since 0 is air) it is. */
static float wrongness(const pool_node *node, uint32_t state, const uint64_t at[3], int footprint)
{
    world_point_at point = point_in(node, at);
    float d = suite->point(&point, footprint);
    return state == KARST_STATE_AIR ? d : d == 0.0f ? 0x1p-126f : -d;
}

/* Looks for surface in a constant node: at one footprint, `grid`^3 jittered points with the corners among them, then
 * from the point nearest to being wrong a search with ever smaller steps for a worse one. */
static bool find_surface(const pool_node *node, uint32_t state, int footprint, int grid, size_t *num_points)
{
    const uint64_t one = (uint64_t)1 << 32;
    uint64_t worst_at[3] = {0}, at[3];
    float worst = -INFINITY;
    for (int i = 0; i < grid * grid * grid; i++) {
        const int cell[3] = {i % grid, i / grid % grid, i / grid / grid};
        for (int axis = 0; axis < 3; axis++) {
            uint64_t low = one * (uint64_t)cell[axis] / (uint64_t)grid, step = one / (uint64_t)grid;
            at[axis] = cell[axis] == 0 ? 0 : cell[axis] == grid - 1 ? one : low + suite_random() % step;
        }
        float wrong = wrongness(node, state, at, footprint);
        if (wrong > worst) {
            worst = wrong;
            memcpy(worst_at, at, sizeof at);
        }
    }
    int tries = 4 * grid;
    uint64_t reach = one / (uint64_t)grid;
    for (int i = 0; i < tries && worst <= 0.0f; i++) {
        for (int axis = 0; axis < 3; axis++) {
            int64_t moved = (int64_t)worst_at[axis] + (int64_t)(suite_random() % (2 * reach + 1)) - (int64_t)reach;
            at[axis] = moved < 0 ? 0 : moved > (int64_t)one ? one : (uint64_t)moved;
        }
        float wrong = wrongness(node, state, at, footprint);
        if (wrong > worst) {
            worst = wrong;
            memcpy(worst_at, at, sizeof at);
        } else if (i % 3 == 2 && reach > 64)
            reach -= reach / 4;
    }
    *num_points += (size_t)(grid * grid * grid + tries);
    return worst > 0.0f;
}

/* Samples constant nodes; returns how many hold surface at full density or any footprint up to their parent's, and
 * tells the first. Stops when it knows of `enough`. */
static size_t count_lost(const constant_list *list, size_t enough, size_t *num_points, char *first, size_t first_bytes)
{
    size_t num_lost = 0;
    *num_points = 0;
    for (size_t i = 0; i < list->count && num_lost < enough; i++) {
        const constant_node *constant = list->nodes + i;
        for (int footprint = -1; footprint <= constant->node.level + 1; footprint++) {
            if (!find_surface(&constant->node, constant->state, footprint, footprint < 0 ? GRID_FULL : GRID_FOOTPRINTS,
                              num_points))
                continue;
            if (num_lost++ == 0)
                snprintf(first, first_bytes, "level %d, node (%ld, %ld, %ld), called %s by its %s, at footprint %d",
                         constant->node.level, constant->node.at[0], constant->node.at[1], constant->node.at[2],
                         constant->state == KARST_STATE_AIR ? "air" : "solid",
                         constant->by_samples ? "samples" : "bounds", footprint);
            break;
        }
    }
    return num_lost;
}

static void test_nothing_lost(void **state)
{
    (void)state;
    constant_list list = {0};
    size_t num_points, by_samples = 0;
    char first[256] = "";
    build_tree(NULL, &list);
    for (size_t i = 0; i < list.count; i++)
        by_samples += list.nodes[i].by_samples;
    assert_true(list.count > 1000);
    size_t num_lost = count_lost(&list, SIZE_MAX, &num_points, first, sizeof first);
    print_message("%s: %zu constant nodes (%zu by bounds, %zu by samples), %.1f million points: %zu lost\n",
                  suite->name, list.count, list.count - by_samples, by_samples, (double)num_points * 1e-6, num_lost);
    if (num_lost)
        fail_msg("%s", first);
    free(list.nodes);
}

/* The test above must fail where nodes are called constant by samples alone. */
static void test_sampling_only_is_caught(void **state)
{
    (void)state;
    constant_list list = {0};
    size_t num_points;
    char first[256] = "";
    build_tree("-DKARST_MUTANT_SAMPLING", &list);
    size_t num_lost = count_lost(&list, 5, &num_points, first, sizeof first);
    print_message("%s, sampling only: lost %s\n", suite->name, first);
    assert_true(num_lost > 0);
    free(list.nodes);
}

/* ---- golden: a change of any bit is noticed ---- */

static void test_golden(void **state)
{
    (void)state;
    enum { LEVELS = 6, EACH = 12, COUNT = LEVELS * EACH };
    static const int levels[LEVELS] = {0, 1, 3, 5, 8, 10};
    pool_node nodes[COUNT];
    uint32_t states[COUNT];
    uint64_t samples_hash = POOL_HASH_START, bricks_hash = POOL_HASH_START;
    float samples[KARST_BRICK_SAMPLES];
    karst_error error = {0};
    karst_context *context = suite_context(0);
    karst_producer *producer = suite_producer(context, KARST_SHAPE_AUTO, NULL, COUNT);
    pool p;

    /* Nodes under and above one place, where the surface is, whatever the world: a column around y = 0, another around
     * |p| = 400 m. */
    for (int n = 0; n < COUNT; n++) {
        int level = levels[n / EACH], i = n % EACH, shift = level + KARST_BRICK_CELLS_LOG2;
        int64_t y = i < EACH / 2 ? (int64_t)i * 700 - 2000 : 6400 - (int64_t)(i - EACH / 2) * 300;
        nodes[n] = (pool_node){{1000 >> shift, y >> shift, -1000 >> shift}, level};
    }
    pool_open(&p, context, COUNT, 1);
    pool_ask(&p, nodes, COUNT);
    p.work.num_subdivides = 0;
    pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "answer", &error);
    pool_read_results(&p, states);
    for (uint32_t n = 0; n < COUNT; n++) {
        karst_load load = {.level = nodes[n].level};
        for (int axis = 0; axis < 3; axis++)
            load.origin[axis] = karst_node_origin(nodes[n].at[axis], load.level);
        host_samples(&load, samples);
        samples_hash = pool_hash(samples_hash, samples, sizeof samples);
        if (states[n] != KARST_STATE_BRICK)
            continue;
        struct {
            int16_t q[KARST_BRICK_SAMPLES + 1];
            karst_brick_info info;
        } brick = {0};
        pool_read_brick(&p, n, brick.q, &brick.info);
        bricks_hash = pool_hash(bricks_hash, brick.q, KARST_BRICK_SAMPLES * sizeof *brick.q);
        bricks_hash = pool_hash(bricks_hash, &brick.info, sizeof brick.info);
    }
    pool_close(&p);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
    if (samples_hash != suite->golden_samples || bricks_hash != suite->golden_bricks)
        fail_msg("%s changed: samples 0x%016lx, bricks 0x%016lx; if that is meant, these are the new golden hashes",
                 suite->name, samples_hash, bricks_hash);
}

static inline int run_world_suite(const host_world *world)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_world),
        cmocka_unit_test(test_nothing_lost),
        cmocka_unit_test(test_sampling_only_is_caught),
        cmocka_unit_test(test_golden),
    };
    suite = world;
    return cmocka_run_group_tests_name(world->name, tests, NULL, NULL);
}

#endif
