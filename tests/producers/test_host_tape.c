/* Samples of bricks by the host's loops over instructions (producers/density/host_tape.h) are those of the interpreter,
 * bit for bit, for random graphs over every op, at every width that this processor has, near the origin and far from
 * it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "producers/density/host_tape.h"
#include "tests/language/random_graph.h"

enum { NUM_GRAPHS = 600, WORLD_SEED = 7, STRIDE = 11 }; /* every so many samples are compared */

typedef struct {
    uint32_t ops[2], wide_ops[2];
    int num_finite, num_compared, num_in_space;
} coverage;

typedef struct {
    random_place place;
    random_graph graph;
    karst_resolved_world world;
    karst_world_layout layout;
    karst_tape tape;
    uint64_t *data;
} subject;

static void open_subject(subject *s, uint64_t seed, bool with_pairs)
{
    karst_error error;
    *s = (subject){0};
    random_state = seed * 0x9e3779b97f4a7c15ULL + 4711;
    random_bits();
    s->place = random_place_make();
    random_graph_make(&s->graph, &s->place, 20 + random_below(120), true, 1);
    if (with_pairs)
        random_graph_widen(&s->graph);
    s->world = (karst_resolved_world){.graph = &s->graph.graph, .root = {s->graph.root[0]}};
    assert_true(karst_world_layout_init(&s->layout, &s->world));
    s->data = calloc(s->layout.num_words, sizeof *s->data);
    assert_non_null(s->data);
    assert_true(karst_world_data_fill(&s->layout, s->graph.parameters, WORLD_SEED, s->place.voxel_log2_m, s->data));
    assert_true(karst_tape_build(&s->layout, s->graph.root, 1, &s->tape, &error));
}

static void close_subject(subject *s)
{
    free(s->data);
    karst_tape_finish(&s->tape);
    random_graph_finish(&s->graph);
}

static bool same_float(float a, float b) { return k_as_uint(a) == k_as_uint(b) || (isnan(a) && isnan(b)); }

static void compare_sample(const tape_program *tape, uint output, const long origin[3], int level, int sample,
                           float found, uint64_t seed, int width)
{
    affine_position at = {.fraction = {0, 0, 0}};
    int index[3] = {sample % KARST_BRICK_SIDE, sample / KARST_BRICK_SIDE % KARST_BRICK_SIDE,
                    sample / (KARST_BRICK_SIDE * KARST_BRICK_SIDE)};
    for (int axis = 0; axis < 3; axis++)
        at.voxel[axis] = origin[axis] + ((long)index[axis] << level);
    tape_values(tape, &at, NULL, level);
    float expected = k_as_float((uint)tape_load(tape, output));
    if (!same_float(expected, found))
        fail_msg("graph %lu, width %d, sample %d of level %d: %a, the interpreter has %a", (unsigned long)seed, width,
                 sample, level, (double)found, (double)expected);
}

static void compare_graph(uint64_t seed, bool with_pairs, coverage *c)
{
    static float samples[KARST_BRICK_SAMPLES];
    subject s;
    open_subject(&s, seed, with_pairs);
    int *slots = calloc((size_t)s.tape.num_slots * TAPE_VALUE_ELEMENTS, sizeof *slots);
    assert_non_null(slots);
    tape_program tape = {.code = s.tape.code,
                         .num_instructions = s.tape.num_instructions,
                         .constants = s.tape.constants,
                         .data = s.data,
                         .values = (const uint *)(s.data + s.layout.values_word),
                         .num_values = s.layout.num_values,
                         .slots = slots};
    int level = (int)random_below(12);
    long origin[3];
    for (int axis = 0; axis < 3; axis++) /* of nodes, as the cache has them */
        origin[axis] = s.place.voxel[axis] & -(1l << (level + KARST_BRICK_CELLS_LOG2));
    for (int width = 0; width < KARST_NUM_HOST_WIDTHS; width++) {
        if (!karst_host_width_is_there((karst_host_width)width))
            continue;
        memset(samples, 0xff, sizeof samples);
        karst_host_tape_samples((karst_host_width)width, &tape, NULL, tape.num_instructions, s.tape.output[0], origin,
                                level, samples);
        for (int i = (int)random_below(STRIDE); i < KARST_BRICK_SAMPLES; i += STRIDE) {
            compare_sample(&tape, s.tape.output[0], origin, level, i, samples[i], seed, width);
            c->num_finite += isfinite(samples[i]) != 0;
            c->num_compared++;
        }
        compare_sample(&tape, s.tape.output[0], origin, level, KARST_BRICK_SAMPLES - 1,
                       samples[KARST_BRICK_SAMPLES - 1], seed, width);
    }
    c->num_in_space += samples[0] != samples[KARST_BRICK_SAMPLES - 1];
    for (int i = 0; i < 2; i++) {
        c->ops[i] |= s.tape.ops[i];
        c->wide_ops[i] |= s.tape.wide_ops[i];
    }
    free(slots);
    close_subject(&s);
}

static coverage all; /* of all tests */

static void compare(bool with_pairs)
{
    coverage c = {.ops = {0}};
    for (uint64_t seed = 1; seed <= NUM_GRAPHS; seed++)
        compare_graph(seed + (with_pairs ? 5000 : 0), with_pairs, &c);
    print_message("%d samples, %d of them finite; of %d graphs %d are not the same everywhere\n", c.num_compared,
                  c.num_finite, NUM_GRAPHS, c.num_in_space);
    assert_true(c.num_finite > c.num_compared / 2 && c.num_in_space > NUM_GRAPHS / 2);
    for (int i = 0; i < 2; i++) {
        all.ops[i] |= c.ops[i];
        all.wide_ops[i] |= c.wide_ops[i];
    }
    assert_int_equal((c.wide_ops[0] | c.wide_ops[1]) != 0, with_pairs);
}

static void test_floats(void **state)
{
    (void)state;
    compare(false);
}

static void test_pairs(void **state)
{
    (void)state;
    compare(true);
}

/* Those two left nothing out. */
static void test_all_ops(void **state)
{
    (void)state;
    for (uint32_t op = 0; op < TAPE_NUM_OPS; op++) {
        bool is_of_others = op == TAPE_NORMAL || op == TAPE_FOOTPRINT || op == TAPE_CURVE; /* colours', and bounds' */
        if (!is_of_others && !TAPE_IS_IN(all.ops[0], all.ops[1], op))
            fail_msg("op %u is in none of the graphs", op);
        if ((op == TAPE_AFFINE || (op >= TAPE_ADD && op <= TAPE_ABS) || op == TAPE_MIX || op == TAPE_LENGTH) &&
            !TAPE_IS_IN(all.wide_ops[0], all.wide_ops[1], op))
            fail_msg("op %u is in none of the graphs in pairs", op);
    }
}

/* What was made is what this processor can best run. */
static void test_widths(void **state)
{
    (void)state;
    karst_host_width best = karst_host_width_best();
    assert_true(karst_host_width_is_there(KARST_HOST_PLAIN) && karst_host_width_is_there(best));
    for (int width = (int)best + 1; width < KARST_NUM_HOST_WIDTHS; width++)
        assert_false(karst_host_width_is_there((karst_host_width)width));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_floats), cmocka_unit_test(test_pairs),
                                       cmocka_unit_test(test_all_ops), cmocka_unit_test(test_widths)};
    return cmocka_run_group_tests_name("tapes on the host", tests, NULL, NULL);
}
