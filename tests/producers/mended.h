/* A cube of bricks of a text, and what they are together: for tests of samples that are mended. */
#ifndef KARST_TESTS_PRODUCERS_MENDED_H
#define KARST_TESTS_PRODUCERS_MENDED_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "producers/density/world_file.h"
#include "producers/steps/evaluate.h"
#include "tests/support/pool.h"

/* A cube of bricks around the origin. */
enum { ALONG = 4, NUM_LOADS = ALONG * ALONG * ALONG, SIDE = ALONG * KARST_BRICK_CELLS + 1 };
enum { NUM_CELLS = SIDE * SIDE * SIDE };

typedef struct {
    int lanes;
    karst_shape shape;
    bool tape;
} device_shape;
static const device_shape rows = {16, KARST_SHAPE_ROWS, false};

static karst_world_file *open_plain(const char *density)
{
    char text[2048];
    karst_error error = {0};
    snprintf(text, sizeof text,
             "/*{ \"voxel\": 1, \"view\": 4000, \"camera\": { \"position\": [\"0\", \"0\", \"-900\"] } }*/\n"
             "float density(vec3 p) { %s }\n",
             density);
    karst_world_file *file = karst_world_file_compile("thin", text, strlen(text), NULL, 0, NULL, &error);
    pool_expect(file, density, &error);
    return file;
}

static void lay_out(karst_channel *channel, karst_channel_layout *layout)
{
    karst_error error = {0};
    *channel = (karst_channel){.name = "density", .format = KARST_FORMAT_SCALED_I16, .components = 1};
    pool_expect(karst_channels_lay_out(channel, 1, layout, &error), "channels", &error);
}

/* Samples of all bricks, each KARST_BRICK_PADDED floats; malloc'ed. */
static float *evaluate(const karst_world_file *file, device_shape shape, int level, const char *more,
                       karst_scrub *sum)
{
    karst_error error = {0};
    karst_channel channel;
    karst_channel_layout layout;
    char own[KARST_WORLD_FILE_OPTIONS_BYTES], options[KARST_WORLD_FILE_OPTIONS_BYTES + 64];
    karst_density_program program;
    karst_load loads[NUM_LOADS] = {0};
    karst_scrub scrub[NUM_LOADS];
    lay_out(&channel, &layout);
    for (int n = 0; n < NUM_LOADS; n++) {
        int at[3] = {n % ALONG, n / ALONG % ALONG, n / ALONG / ALONG};
        loads[n] = (karst_load){.level = level, .state = KARST_STATE_UNKNOWN};
        for (int axis = 0; axis < 3; axis++)
            loads[n].origin[axis] = karst_node_origin(at[axis] - ALONG / 2, level);
    }
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), shape.lanes, NULL, &error);
    pool_expect(context, "context", &error);
    void *words = karst_world_file_data(file, 1, &error);
    pool_expect(words, "data", &error);
    karst_world_file_program(file, words, own, &program);
    snprintf(options, sizeof options, "%s %s", own, more);
    const char *tape = "#include \"producers/language/tape/tape_world.clh\"\n";
    const karst_virtual_file world = {"world.clh", shape.tape ? tape : program.source};
    size_t size_bytes = (size_t)NUM_LOADS * layout.staging_stride * sizeof(float);
    float *samples = malloc(size_bytes);
    karst_evaluator *evaluator = karst_evaluator_create(context, shape.shape, &layout, &world, options, &error);
    karst_buffer *data = karst_buffer_create(context, "test", program.data_bytes, words, &error);
    karst_buffer *load_buffer = karst_buffer_create(context, "test", sizeof loads, loads, &error);
    karst_buffer *staging = karst_buffer_create(context, "test", size_bytes, NULL, &error);
    karst_buffer *scrubs = karst_buffer_create(context, "test", sizeof scrub, NULL, &error);
    pool_expect(samples && evaluator && data && load_buffer && staging && scrubs, "buffers", &error);
    karst_evaluator_set_data(evaluator, data);
    pool_expect(karst_evaluate_bricks(evaluator, load_buffer, NUM_LOADS, staging, scrubs, &error) &&
                    karst_buffer_read(staging, 0, samples, size_bytes, &error) &&
                    karst_buffer_read(scrubs, 0, scrub, sizeof scrub, &error),
                "evaluate", &error);
    *sum = (karst_scrub){0};
    for (int n = 0; n < NUM_LOADS; n++) {
        sum->raised += scrub[n].raised;
        sum->given_up += scrub[n].given_up;
    }
    free(words);
    karst_buffer_destroy(scrubs);
    karst_buffer_destroy(staging);
    karst_buffer_destroy(load_buffer);
    karst_buffer_destroy(data);
    karst_evaluator_destroy(evaluator);
    karst_context_destroy(context);
    return samples;
}

static float sample_of(const float *samples, int n, int x, int y, int z)
{
    return samples[(size_t)n * KARST_BRICK_PADDED + (size_t)((z * KARST_BRICK_SIDE + y) * KARST_BRICK_SIDE + x)];
}

/* The bricks as one grid; returns how many samples bricks that share them disagree on. */
static int join(const float *samples, float *grid)
{
    static unsigned char is_set[NUM_CELLS];
    int num_torn = 0;
    memset(is_set, 0, sizeof is_set);
    for (int n = 0; n < NUM_LOADS; n++)
        for (int z = 0; z < KARST_BRICK_SIDE; z++)
            for (int y = 0; y < KARST_BRICK_SIDE; y++)
                for (int x = 0; x < KARST_BRICK_SIDE; x++) {
                    int at = n / ALONG / ALONG * KARST_BRICK_CELLS + z;
                    at = at * SIDE + n / ALONG % ALONG * KARST_BRICK_CELLS + y;
                    at = at * SIDE + n % ALONG * KARST_BRICK_CELLS + x;
                    float d = sample_of(samples, n, x, y, z);
                    num_torn += is_set[at] && memcmp(&grid[at], &d, sizeof d);
                    grid[at] = d;
                    is_set[at] = 1;
                }
    return num_torn;
}

/* The bricks of a producer that works on the host, or of its kernels. */
static void load_all(karst_context *context, const karst_world_file *file, bool on_host,
                     int16_t q[NUM_LOADS][KARST_BRICK_SAMPLES], uint32_t states[NUM_LOADS], uint64_t *num_raised)
{
    karst_error error = {0};
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO, .start_on_host = on_host};
    karst_producer *producer = karst_world_file_producer_built(context, file, 1, NUM_LOADS, &build, &error);
    karst_brick_info info;
    uint64_t num_given_up;
    pool p;
    pool_node nodes[NUM_LOADS];
    for (int n = 0; n < NUM_LOADS; n++)
        nodes[n] = (pool_node){{n % ALONG - 2, n / ALONG % ALONG - 2, n / ALONG / ALONG - 2}, 3};
    pool_expect(producer, "producer", &error);
    pool_open(&p, context, NUM_LOADS, 1);
    pool_ask(&p, nodes, NUM_LOADS);
    p.work.num_subdivides = 0;
    pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "answer", &error);
    pool_read_results(&p, states);
    memset(q, 0, sizeof *q * NUM_LOADS);
    for (uint32_t n = 0; n < NUM_LOADS; n++)
        if (states[n] == KARST_STATE_BRICK)
            pool_read_brick(&p, n, q[n], &info);
    karst_density_producer_thin(producer, num_raised, &num_given_up);
    pool_close(&p);
    karst_producer_destroy(producer);
}

/* Fails unless an evaluator in another shape, `other`, has the same samples, bit by bit. */
static void expect_same_samples(const float *samples, const float *other)
{
    for (int n = 0; n < NUM_LOADS; n++)
        assert_memory_equal(other + (size_t)n * KARST_BRICK_PADDED, samples + (size_t)n * KARST_BRICK_PADDED,
                            KARST_BRICK_SAMPLES * sizeof *samples);
}

/* Fails unless a producer on the host makes the bricks that its kernels make, and raises as many samples. Returns how
 * many. */
static uint64_t expect_host_has_same(karst_context *context, const karst_world_file *file)
{
    static int16_t q[2][NUM_LOADS][KARST_BRICK_SAMPLES];
    uint32_t states[2][NUM_LOADS];
    uint64_t num_raised[2];
    for (int on_host = 0; on_host < 2; on_host++)
        load_all(context, file, on_host, q[on_host], states[on_host], &num_raised[on_host]);
    assert_memory_equal(states[1], states[0], sizeof states[0]);
    assert_memory_equal(q[1], q[0], sizeof q[0]);
    assert_int_equal(num_raised[1], num_raised[0]);
    return num_raised[0];
}

#endif
