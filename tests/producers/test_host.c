/* Production on the host (producers/density/host_steps.h) until kernels are compiled: tiles, states, bricks and what
 * was scrubbed are the kernels' in every byte; kernels take over while work goes on; bounds of long tapes wait for
 * them; and what goes wrong while they are compiled is said. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "karst/camera.h"
#include "producers/density/world_file.h"
#include "tests/support/pool.h"

enum { NUM_NODES = 24 };

static karst_context *context;

/* What a round of work came to. */
typedef struct {
    uint32_t states[NUM_NODES];
    int16_t q[NUM_NODES][KARST_BRICK_SAMPLES];
    karst_brick_info info[NUM_NODES];
    karst_node nodes[NUM_NODES * KARST_TILE_NODES];
    karst_tile_info tiles[NUM_NODES];
    uint64_t num_non_finite;
    int64_t first_voxel[3];
    int first_level;
} outcome;

static karst_world_file *open_world(const char *name, const char *text)
{
    karst_error error = {0};
    char path[256];
    snprintf(path, sizeof path, "demos/worlds/%s.karst", name);
    karst_world_file *file = text ? karst_world_file_compile(name, text, strlen(text), NULL, 0, NULL, &error)
                                  : karst_world_file_open(path, NULL, 0, NULL, &error);
    pool_expect(file, name, &error);
    return file;
}

static karst_producer *make(const karst_world_file *file, bool start_on_host)
{
    karst_error error = {0};
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO, .start_on_host = start_on_host};
    karst_producer *producer =
        karst_world_file_producer_built(context, file, file->info.seed, NUM_NODES, &build, &error);
    pool_expect(producer, "producer", &error);
    return producer;
}

/* Nodes of many levels around the world's camera, and far out. */
static void choose_nodes(const karst_world_file *file, pool_node nodes[NUM_NODES])
{
    karst_camera camera;
    karst_error error = {0};
    pool_expect(karst_camera_parse(file->info.camera, file->info.voxel_log2_m, &camera, &error), "camera", &error);
    for (int i = 0; i < NUM_NODES; i++) {
        int level = 1 + i % 12; /* those of level 0 are not subdivided */
        nodes[i].level = level;
        for (int axis = 0; axis < 3; axis++) {
            int64_t at = camera.position.voxel[axis] + (i >= 12 && axis == 0 ? (int64_t)1000000007 : 0);
            nodes[i].at[axis] = (at >> (level + KARST_BRICK_CELLS_LOG2)) + (axis == 1 ? -(i & 1) : 0);
        }
    }
}

static void answer(karst_producer *producer, const pool_node *nodes, outcome *o)
{
    karst_error error = {0};
    pool p;
    memset(o, 0, sizeof *o);
    pool_open(&p, context, NUM_NODES, 2);
    pool_ask(&p, nodes, NUM_NODES);
    pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "answer", &error);
    pool_read_results(&p, o->states);
    for (uint32_t i = 0; i < NUM_NODES; i++)
        if (o->states[i] == KARST_STATE_BRICK)
            pool_read_brick(&p, i, o->q[i], &o->info[i]);
    pool_read_tiles(&p, o->nodes, o->tiles);
    o->num_non_finite = karst_density_producer_non_finite(producer);
    karst_density_producer_first_non_finite(producer, o->first_voxel, &o->first_level);
    pool_close(&p);
}

static int count_bricks(const outcome *o)
{
    int count = 0;
    for (int i = 0; i < NUM_NODES; i++)
        count += o->states[i] == KARST_STATE_BRICK;
    return count;
}

/* Kernels, the host, and a producer that is on the host first and then changes over, all give the same. */
static void check_world(const char *name, const char *text, int least_bricks)
{
    static outcome expected, found;
    karst_error error = {0};
    pool_node nodes[NUM_NODES];
    karst_world_file *file = open_world(name, text);
    karst_producer *device = make(file, false), *host = make(file, true);
    assert_false(karst_density_producer_is_on_host(device));
    assert_true(karst_density_producer_is_on_host(host));
    choose_nodes(file, nodes);
    answer(device, nodes, &expected);
    if (count_bricks(&expected) < least_bricks)
        fail_msg("%s: only %d bricks", name, count_bricks(&expected));
    answer(host, nodes, &found);
    assert_memory_equal(&found, &expected, sizeof found);
    assert_true(karst_density_producer_compile(host, KARST_UNTIL_COMPILED, &error));
    assert_false(karst_density_producer_is_on_host(host));
    uint64_t num_before = found.num_non_finite;
    answer(host, nodes, &found);
    found.num_non_finite -= num_before;
    assert_memory_equal(&found, &expected, sizeof found);
    karst_producer_destroy(host);
    karst_producer_destroy(device);
    karst_world_file_destroy(file);
}

static void test_same_bytes(void **state)
{
    (void)state;
    check_world("hills", NULL, 4);
    check_world("ruins", NULL, 4);
    check_world("lattice", NULL, 4);
    check_world("planet", NULL, 2);
}

static void test_non_finite(void **state)
{
    (void)state;
    check_world("holes", "float density(vec3 p) { return p.y < 0.0 ? 1.0 : p.x > 1.0 ? 0.0 / (p.x - p.x) : -1.0; }", 1);
}

/* Too long for the host to bound their children; they have no generated code either. */
static void test_long_tape(void **state)
{
    (void)state;
    check_world("sum", "float density(vec3 p) { float a = p.x; for (int i = 0; i < 2200; i++) "
                       "a = p.z / (a + float(i) + 0.5);"
                       " return 0.01 * clamp(a, -1.0, 1.0) - p.y; }", 1);
    check_world("union", "float density(vec3 p) { float d = -1e9; for (int i = 0; i < 900; i++) "
                         "d = max(d, 2.0 - length(p - vec3(float(i) * 5.0, sin(float(i)), 0.0))); return d; }", 1);
}

/* Parameters change the data, whoever reads them, also while kernels are compiled. */
static void test_parameters(void **state)
{
    (void)state;
    static outcome expected, found;
    karst_error error = {0};
    pool_node nodes[NUM_NODES];
    karst_world_file *file = open_world("hills", NULL);
    karst_producer *device = make(file, false), *host = make(file, true);
    karst_number *values = calloc(file->program->num_parameters + 1, sizeof *values);
    assert_non_null(values);
    for (uint32_t i = 0; i < file->program->num_parameters; i++)
        values[i] = file->program->parameters[i].value;
    choose_nodes(file, nodes);
    for (uint32_t seed = 1; seed <= 3; seed++) {
        assert_true(karst_world_file_set_parameters(device, file, values, seed, &error));
        assert_true(karst_world_file_set_parameters(host, file, values, seed, &error));
        answer(device, nodes, &expected);
        answer(host, nodes, &found);
        assert_memory_equal(&found, &expected, sizeof found);
        assert_true(karst_density_producer_compile(host, seed == 2 ? KARST_UNTIL_COMPILED : 0, &error));
    }
    assert_false(karst_density_producer_is_on_host(host));
    free(values);
    karst_producer_destroy(host);
    karst_producer_destroy(device);
    karst_world_file_destroy(file);
}

/* The host answers for a program that does not compile, until that is known. */
static void test_failure(void **state)
{
    (void)state;
    static outcome found;
    karst_error error = {0};
    pool_node nodes[NUM_NODES];
    karst_world_file *file = open_world("hills", NULL);
    const karst_world_build build = {.options = "-DLANES_OF_NO_USE=", .start_on_host = true};
    const karst_world_build broken = {.options = "-Dworld_prepare=no(such,thing)", .start_on_host = true};
    karst_producer *host = karst_world_file_producer_built(context, file, 1, NUM_NODES, &broken, &error);
    pool_expect(host, "producer", &error);
    choose_nodes(file, nodes);
    answer(host, nodes, &found);
    assert_false(karst_density_producer_compile(host, KARST_UNTIL_COMPILED, &error));
    assert_non_null(strstr(error.message, "producers/steps/load.cl"));
    karst_producer_destroy(host);

    /* One that is left while it is compiled, and one that was never begun. */
    host = karst_world_file_producer_built(context, file, 1, NUM_NODES, &build, &error);
    pool_expect(host, "producer", &error);
    assert_true(karst_density_producer_compile(host, 0, &error));
    karst_producer_destroy(host);
    karst_producer_destroy(make(file, true));
    karst_world_file_destroy(file);
}

static int set_up(void **state)
{
    (void)state;
    karst_error error = {0};
    setenv("KARST_CACHE_DIR", "off", 1); /* kept programs would leave nothing to the host */
    context = karst_context_create(getenv("KARST_DEVICE"), 0, NULL, &error);
    pool_expect(context, "context", &error);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    karst_context_destroy(context);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bytes), cmocka_unit_test(test_non_finite), cmocka_unit_test(test_long_tape),
        cmocka_unit_test(test_parameters), cmocka_unit_test(test_failure),
    };
    return cmocka_run_group_tests_name("production on the host", tests, set_up, tear_down);
}
