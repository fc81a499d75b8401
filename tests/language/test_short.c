/* Tapes that are shortened for a box give the bits of whole ones, and worlds too large for generated code run on them:
 * their bricks are the oracle's in every bit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* The rule of taking a side, to be broken. */
static bool is_broken;
#define TAPE_BREAKS_SIDE is_broken
#define TAPE_SLOTS 256

#include "producers/density_producer.h"
#include "producers/language/oracle.h"
#include "producers/language/tape_short.clh"
#include "producers/language/world_file.h"
#include "tests/language/random_graph.h"
#include "tests/support/pool.h"

enum { NUM_GRAPHS = 3000, NUM_POINTS = 20 };

/* ---- random graphs ---- */

typedef struct {
    long num_steps, num_short, num_wrong;
} tally;

/* Shortens a random graph for a random box and compares at points of the box. */
static void compare_graph(uint64_t seed, tally *t)
{
    static tape_short brief;
    random_state = seed * 0x9e3779b97f4a7c15ULL + 99;
    random_bits();
    random_place place = random_place_make();
    random_graph graph;
    random_graph_make(&graph, &place, 20 + random_below(120), random_chance(2), 1);
    if (random_chance(3))
        random_graph_widen(&graph);
    karst_resolved_world world = {.graph = &graph.graph, .density = graph.root[0]};
    karst_world_layout layout;
    karst_tape tape;
    karst_error error;
    assert_true(karst_world_layout_init(&layout, &world));
    uint64_t *data = calloc(layout.num_words, sizeof *data);
    assert_true(karst_world_data_fill(&layout, graph.parameters, 7, place.voxel_log2_m, data));
    assert_true(karst_tape_build(&layout, &world.density, 1, &tape, &error));
    assert_true(tape.num_slots <= TAPE_SLOTS);
    int *slots = calloc((size_t)tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *slots);
    tape_program program = {.code = tape.code,
                            .num_instructions = tape.num_instructions,
                            .constants = tape.constants,
                            .data = data,
                            .values = (const uint *)(data + layout.values_word),
                            .num_values = layout.num_values,
                            .slots = slots};
    op_box box = {.level = (int)random_below(8)};
    for (int axis = 0; axis < 3; axis++) {
        box.centre.voxel[axis] = place.voxel[axis];
        box.centre.fraction[axis] = place.fraction[axis];
        box.radius[axis] = place.radius[axis];
    }
    tape_shorten(&program, &box, tape.output[0], &brief);
    t->num_steps += tape.num_instructions;
    t->num_short += TAPE_SHORT_MOST - brief.first;
    for (int k = 0; k < NUM_POINTS; k++) {
        affine_position at;
        for (int axis = 0; axis < 3; axis++) {
            int64_t most = (int64_t)((double)place.radius[axis] * 0x1p32);
            int64_t offset = k < 8 ? (k >> axis & 1 ? most : -most) : (int64_t)((random_unit() * 2 - 1) * (double)most);
            uint64_t sum = (uint64_t)place.fraction[axis] + (uint32_t)offset;
            at.voxel[axis] = place.voxel[axis] + (offset >> 32) + (int64_t)(sum >> 32);
            at.fraction[axis] = (uint32_t)sum;
        }
        tape_values(&program, &at, NULL, box.level);
        uint whole = (uint)tape_load(&program, tape.output[0]);
        tape_short_values(&program, brief.steps + brief.first, TAPE_SHORT_MOST - brief.first, &at, box.level);
        t->num_wrong += whole != (uint)tape_load(&program, tape.output[0]);
    }
    free(slots);
    free(data);
    karst_tape_finish(&tape);
    random_graph_finish(&graph);
}

static void test_the_same_bits(void **state)
{
    (void)state;
    tally whole = {0}, broken = {0};
    for (uint64_t seed = 1; seed <= NUM_GRAPHS; seed++)
        compare_graph(seed, &whole);
    print_message("%ld steps of %ld are left\n", whole.num_short, whole.num_steps);
    assert_int_equal(whole.num_wrong, 0);
    assert_true(whole.num_short < whole.num_steps);
    is_broken = true;
    for (uint64_t seed = 1; seed <= NUM_GRAPHS; seed++)
        compare_graph(seed, &broken);
    is_broken = false;
    assert_true(broken.num_wrong > 0);
}

/* ---- large worlds ---- */

/* A cloud of boxes over hills, ten ops each: all different, so that nothing is shared. */
static karst_world_file *large_world(int num_boxes)
{
    char text[1024];
    karst_error error = {0};
    snprintf(text, sizeof text,
             "/*{ \"voxel\": 0.25 }*/\n"
             "float density(vec3 p) {\n"
             "    float d = p.y + 3.0 - 4.0 * noise(p / 30.0);\n"
             "    for (int i = 0; i < %d; i++) {\n"
             "        float k = float(i);\n"
             "        vec3 c = vec3(40.0 * sin(k * 1.7), 20.0 * sin(k * 0.37), 40.0 * cos(k * 2.3));\n"
             "        vec3 q = abs(p - c);\n"
             "        d = min(d, max(q.x, max(q.y, q.z)) - 0.75);\n"
             "    }\n"
             "    return -d;\n"
             "}\n",
             num_boxes);
    karst_world_file *file = karst_world_file_compile("large", text, strlen(text), NULL, 0, NULL, &error);
    if (!file)
        fail_msg("%s", error.message);
    return file;
}

static void check_large(int num_boxes, uint32_t least_ops)
{
    karst_error error = {0};
    karst_world_file *file = large_world(num_boxes);
    print_message("%u steps\n", file->tape.num_instructions);
    assert_true(file->code.is_tape && file->tape.num_instructions >= least_ops);
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 0, NULL, &error);
    pool_expect(context, "context", &error);
    karst_producer *producer = karst_world_file_producer(context, file, file->info.seed, 8, &error);
    pool_expect(producer, "producer", &error);
    karst_number none = {0};
    karst_oracle *oracle =
        karst_oracle_create(&file->program->world, &none, file->info.seed, file->info.voxel_log2_m, &error);
    pool_expect(oracle, "oracle", &error);
    pool p;
    pool_open(&p, context, 8, 1);
    const pool_node nodes[] = {{{0, -1, 0}, 0}, {{-3, 0, 5}, 0}, {{0, -1, -1}, 2}};
    const uint32_t count = sizeof nodes / sizeof *nodes;
    pool_ask(&p, nodes, count);
    p.work.num_subdivides = 0;
    pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), "answer", &error);
    uint32_t states[3], stride;
    pool_read_results(&p, states);
    karst_buffer *staging = karst_density_producer_staging(producer, &stride);
    float *samples = calloc(stride, sizeof *samples);
    int num_bricks = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (states[i] != KARST_STATE_BRICK)
            continue;
        num_bricks++;
        pool_expect(karst_buffer_read(staging, i * stride * sizeof(float), samples, stride * sizeof(float), &error),
                    "staging", &error);
        for (int n = 0; n < KARST_BRICK_SAMPLES; n += 61) {
            int at[3] = {n % KARST_BRICK_SIDE, n / KARST_BRICK_SIDE % KARST_BRICK_SIDE,
                         n / (KARST_BRICK_SIDE * KARST_BRICK_SIDE)};
            karst_position position = {.fraction = {0}};
            for (int axis = 0; axis < 3; axis++)
                position.voxel[axis] =
                    (nodes[i].at[axis] * KARST_BRICK_CELLS + at[axis]) * ((int64_t)1 << nodes[i].level);
            float expected = karst_oracle_density(oracle, &position, nodes[i].level).device;
            if (k_as_uint(expected) != k_as_uint(samples[n]))
                fail_msg("%d boxes, brick %u, sample %d: %a instead of %a", num_boxes, i, n, (double)samples[n],
                         (double)expected);
        }
    }
    assert_true(num_bricks >= 2);
    free(samples);
    pool_close(&p);
    karst_oracle_destroy(oracle);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
    karst_world_file_destroy(file);
}

static void test_ten_thousand_ops(void **state)
{
    (void)state;
    check_large(1000, 10000);
}

static void test_fifty_thousand_ops(void **state)
{
    (void)state;
    check_large(5000, 50000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_same_bits),
        cmocka_unit_test(test_ten_thousand_ops),
        cmocka_unit_test(test_fifty_thousand_ops),
    };
    return cmocka_run_group_tests_name("short tapes", tests, NULL, NULL);
}
