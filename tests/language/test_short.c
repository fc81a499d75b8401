/* Tapes that are shortened for a box give the bits of whole ones, and worlds too large for generated code run on them:
 * their bricks and colours are the oracle's in every bit. */
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

#include "core/device/context.h"
#include "producers/density/density_producer.h"
#include "producers/language/oracle/oracle.h"
#include "producers/language/tape/bounds_shared.h"
#include "producers/language/tape/tape_short.clh"
#include "producers/density/world_file.h"
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
    karst_resolved_world world = {.graph = &graph.graph, .root = {graph.root[0]}};
    karst_world_layout layout;
    karst_tape tape;
    karst_error error;
    assert_true(karst_world_layout_init(&layout, &world));
    uint64_t *data = calloc(layout.num_words, sizeof *data);
    assert_true(karst_world_data_fill(&layout, graph.parameters, 7, place.voxel_log2_m, data));
    assert_true(karst_tape_build(&layout, &world.root[KARST_ROOT_DENSITY], 1, &tape, &error));
    assert_true(tape.num_slots <= TAPE_SLOTS);
    uint32_t stride = tape.num_slots * TAPE_VALUE_ELEMENTS;
    int *slots = calloc(tape.num_slots * (TAPE_BOUND_ELEMENTS + NUM_POINTS * TAPE_VALUE_ELEMENTS), sizeof *slots);
    affine_position all[NUM_POINTS];
    uint values[NUM_POINTS];
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
        values[k] = (uint)tape_load(&program, tape.output[0]);
        all[k] = at;
        tape_values_of_rows(&program, brief.steps + brief.first, TAPE_SHORT_MOST - brief.first, stride, &at, 1,
                            box.level);
        t->num_wrong += values[k] != (uint)tape_load(&program, tape.output[0]);
    }
    for (int is_short = 0; is_short < 2; is_short++) {
        if (is_short)
            tape_values_of_rows(&program, brief.steps + brief.first, TAPE_SHORT_MOST - brief.first, stride, all,
                                NUM_POINTS, box.level);
        else
            tape_values_of_rows(&program, NULL, tape.num_instructions, stride, all, NUM_POINTS, box.level);
        for (int k = 0; k < NUM_POINTS; k++) {
            tape_program row = program;
            row.slots += k * stride;
            t->num_wrong += values[k] != (uint)tape_load(&row, tape.output[0]);
        }
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
    const karst_world_build build = {.in_two_steps = true};
    karst_producer *producer = karst_world_file_producer_built(context, file, file->info.seed, 8, &build, &error);
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

/* ---- smooth minima ---- */

/* Ways in which people write a smooth minimum of d and e, within k of each other. */
static const char *const smooth_forms[] = {
    "float h = clamp(0.5 + 0.5 * (e - d) / k, 0.0, 1.0); return mix(e, d, h) - k * h * (1.0 - h);",
    "float h = clamp(0.5 + (e - d) * 0.5 / k, 0.0, 1.0); return mix(e, d, h) - k * (1.0 - h) * h;",
    "float h = saturate(0.5 - 0.5 * (d - e) / k); return mix(e, d, h) - h * (1.0 - h) * k;",
    "float h = max(k - abs(d - e), 0.0) / k; return min(d, e) - h * h * k * 0.25;",
    "float h = max(k - abs(d - e), 0.0); return min(d, e) - h * h * 0.25 / k;",
    "float h = max(k - abs(d - e), 0.0) / k; return min(d, e) - h * h * h * k * (1.0 / 6.0);",
    "return smin(d, e, k);",
    "return -smax(-d, -e, k);",
    "float h = clamp(0.5 + 0.5 * (e - d) / k, 0.0, 1.0); return -(mix(-e, -d, h) + k * h * (1.0 - h));",
};
/* What looks like one, and is none. */
static const char *const rough_forms[] = {
    "float h = clamp(0.5 + 0.5 * (e - d) / k, 0.0, 1.0); return mix(e, d, h) + k * h * (1.0 - h);",
    "float h = clamp(0.5 + 0.5 * (e - d) / k, 0.0, 1.0); return mix(e, d, h) - 2.0 * k * h * (1.0 - h);",
    "float h = clamp(0.4 + 0.5 * (e - d) / k, 0.0, 1.0); return mix(e, d, h) - k * h * (1.0 - h);",
    "float h = clamp(0.5 + 0.5 * (e + d) / k, 0.0, 1.0); return mix(e, d, h) - k * h * (1.0 - h);",
    "float h = max(k - abs(d - e - 0.1), 0.0) / k; return min(d, e) - h * h * k * 0.25;",
    "float h = max(k - abs(d - e), 0.0) / k; return min(d, e) - h * h * k * 0.5;",
    "float h = max(k - abs(d - e), 0.0) / k; return max(d, e) - h * h * k * 0.25;",
};
#define NUM_SMOOTH_FORMS (sizeof smooth_forms / sizeof *smooth_forms)
#define NUM_ROUGH_FORMS (sizeof rough_forms / sizeof *rough_forms)
enum { NUM_BLOBS = 40 };

/* What lies about, at q from its middle and some r large; and where number k is: the first at 0, 0, 9. */
static const char *const blob_shapes[] = {
    "length(q) - r",
    "length(max(abs(q) - 0.6 * r, 0.0)) - 0.3 * r",
    "length(vec2(length(q.xz) - 0.8 * r, q.y)) - 0.3 * r",
    "length(q - vec3(0.0, clamp(q.y, -r, r), 0.0)) - 0.5 * r",
    "length(q * vec3(1.0, 1.6, 1.2)) / 1.6 - 0.6 * r",
};
static const char *const blob_places[] = {
    "vec3(9.0 * sin(k * 1.7), 5.0 * sin(k * 0.37), 9.0 * cos(k * 2.3))",
    "vec3(9.0 * sin(k * 0.157), 2.0 * sin(k), 9.0 * cos(k * 0.157))",
    "(fract(sin(k * vec3(12.9898, 78.233, 37.719)) * 43758.5453) - 0.5) * 18.0 + (k < 0.5 ? vec3(9.0, 9.0, 18.0) : "
    "vec3(0.0))",
    "vec3(3.0 * mod(k, 7.0), -3.0 * floor(k / 7.0), 9.0)",
    "vec3(0.25 * k * sin(k * 0.7), 0.3 * k, 9.0 - 0.3 * k * cos(k * 0.7))",
};
#define NUM_BLOB_SHAPES (sizeof blob_shapes / sizeof *blob_shapes)
#define NUM_BLOB_PLACES (sizeof blob_places / sizeof *blob_places)

static karst_world_file *blobs(const char *form, const char *shape, const char *places)
{
    char text[1024];
    karst_error error = {0};
    snprintf(text, sizeof text,
             "/*{ \"voxel\": 0.0625 }*/\n"
             "float melt(float d, float e, float k) { %s }\n"
             "float blob(vec3 q, float r) { return %s; }\n"
             "float density(vec3 p) {\n"
             "    float d = 1e5;\n"
             "    for (int i = 0; i < %d; i++) {\n"
             "        float k = float(i);\n"
             "        vec3 c = %s;\n"
             "        d = melt(d, blob(p - c, 1.0 + 0.02 * k), 0.6);\n"
             "    }\n"
             "    return -d;\n"
             "}\n",
             form, shape, NUM_BLOBS, places);
    karst_world_file *file = karst_world_file_compile("blobs", text, strlen(text), NULL, 0, NULL, &error);
    if (!file)
        fail_msg("%s: %s", form, error.message);
    return file;
}

/* Those that have all of `flags`. */
static int count_smooth(const karst_world_file *file, unsigned flags)
{
    int count = 0;
    for (uint32_t n = 0; n < file->tape.num_instructions; n++)
        count += file->tape.code[n].op != TAPE_NOISE && (~file->tape.code[n].flags & (flags | TAPE_IS_SMOOTH)) == 0;
    return count;
}

/* In a box beside a blob: what is far is left out, the bits are the same, and bounds are hardly wider than values. */
static void check_blobs(const char *form, const char *shape, const char *places)
{
    static tape_short brief;
    karst_error error = {0};
    karst_world_file *file = blobs(form, shape, places);
    uint64_t *data = karst_world_file_data(file, file->info.seed, &error);
    const karst_data_header *header = (const karst_data_header *)data;
    if (count_smooth(file, 0) < NUM_BLOBS - 1 || file->tape.num_slots > TAPE_SLOTS)
        fail_msg("%s: %d smooth minima, %u slots", form, count_smooth(file, 0), file->tape.num_slots);
    int *slots = calloc(file->tape.num_slots * (TAPE_BOUND_ELEMENTS + TAPE_VALUE_ELEMENTS), sizeof *slots);
    tape_program tape = {.code = (const karst_instruction *)(data + header->code),
                         .num_instructions = header->num_instructions,
                         .constants = (const uint *)(data + header->constants),
                         .data = data,
                         .values = (const uint *)(data + header->values),
                         .num_values = header->num_values,
                         .slots = slots};
    const op_box box = {.centre = {.voxel = {20, -20, 140}}, .radius = {8, 8, 8}, .level = 0};
    tape_shorten(&tape, &box, header->output, &brief);
    uint num_left = TAPE_SHORT_MOST - brief.first;
    bool is_wide = count_smooth(file, TAPE_IS_WIDE) > 0; /* choices between pairs are never left out */
    if (!is_wide && num_left > header->num_instructions / 4)
        fail_msg("%s: %u steps of %u are left", form, num_left, header->num_instructions);
    assert_true(!tape_bounds(&tape, &box, NULL));
    op_bound bound = tape_load_bound(&tape, header->output);
    float least = INFINITY, most = -INFINITY;
    for (int k = 0; k < 17 * 17 * (getenv("KARST_TEST_FULL") ? 8 : 1); k++) {
        affine_position at = {.voxel = {12 + k % 17, -28 + k / 17 % 17, 132 + (k * 7 + k / 289 * 2) % 17}};
        tape_values(&tape, &at, NULL, 0);
        float value = k_as_float((uint)tape_load(&tape, header->output));
        tape_values_of_rows(&tape, brief.steps + brief.first, num_left, 0, &at, 1, 0);
        if (k_as_uint(value) != (uint)tape_load(&tape, header->output))
            fail_msg("%s: shortened it is another number", form);
        least = fminf(least, value);
        most = fmaxf(most, value);
    }
    if (!(bound.v.lo <= least && bound.v.hi >= most) || bound.v.hi - bound.v.lo > 3 * (most - least))
        fail_msg("%s: from %g to %g, bounds are %g to %g", form, (double)least, (double)most, (double)bound.v.lo,
                 (double)bound.v.hi);
    free(slots);
    free(data);
    karst_world_file_destroy(file);
}

static void test_smooth_minima(void **state)
{
    (void)state;
    const bool full = getenv("KARST_TEST_FULL") != NULL;
    size_t num_worlds = 0;
    for (size_t i = 0; i < NUM_SMOOTH_FORMS; i++)
        for (size_t k = 0; k < NUM_BLOB_SHAPES; k++)
            for (size_t j = 0; j < NUM_BLOB_PLACES; j++)
                if (full || (k == i % NUM_BLOB_SHAPES && j == k) || (i == 0 && j == k)) {
                    check_blobs(smooth_forms[i], blob_shapes[k], blob_places[j]);
                    num_worlds++;
                }
    print_message("%zu worlds of %d blobs\n", num_worlds, NUM_BLOBS);
    for (size_t i = 0; i < NUM_ROUGH_FORMS; i++) {
        karst_world_file *file = blobs(rough_forms[i], blob_shapes[0], blob_places[0]);
        if (count_smooth(file, 0))
            fail_msg("%s: taken for a smooth minimum", rough_forms[i]);
        karst_world_file_destroy(file);
    }
}

/* ---- large colours ---- */

static const char colour_probe[] =
    "#include \"core/device/lanes.clh\"\n"
    "#include \"producers/steps/density.clh\"\n"
    "#include \"world.clh\"\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void colours(K_GLOBAL const ulong *data, int x, int level, K_GLOBAL float *out)\n"
    "{\n"
    "    world_point_at at;\n"
    "    __local near_octave known[WORLD_NEAR_OCTAVES + 1];\n"
    "    const world_near_at near = {.is_far = 7};\n"
    "#ifndef WORLD_NUM_OUTPUTS\n"
    "#define WORLD_NUM_OUTPUTS 3\n"
    "    vfloat values[3];\n"
    "#define world_outputs world_colour\n"
    "#else\n"
    "    vfloat values[WORLD_NUM_OUTPUTS];\n"
    "#endif\n"
    "    int first = (int)get_global_id(0) * LANES;\n"
    "    at.voxel[0] = v_int_to_long((vint)(x + 3 * first) + 3 * V_LANE);\n"
    "    at.voxel[1] = (vlong)(5L);\n"
    "    at.voxel[2] = (vlong)(-70L);\n"
    "    for (int i = 0; i < 3; i++)\n"
    "        at.fraction[i] = (vuint)(0u);\n"
    "    const vfloat facing[] = {(vfloat)(0.48f), (vfloat)(0.6f), (vfloat)(-0.64f), (vfloat)(1.5f), (vfloat)(0.0f), "
    "(vfloat)(2.25f)};\n"
    "    world_outputs(data, &near, known, &at, level, facing, values);\n"
    "    for (int i = 0; i < WORLD_NUM_OUTPUTS; i++)\n"
    "        v_store_float(values[i], out + WORLD_NUM_OUTPUTS * first + i * LANES);\n"
    "}\n";
enum { NUM_COLOURS = 64 };

/* Colours too large for generated code are the oracle's in every bit, too. */
static void check_colours(const karst_world_file *file, int lanes)
{
    static const float facing[KARST_FACING_FLOATS] = {0.48f, 0.6f, -0.64f, 1.5f, 0, 2.25f};
    karst_error error = {0};
    char options[KARST_WORLD_FILE_OPTIONS_BYTES];
    float values[KARST_NUM_ROOTS * NUM_COLOURS];
    uint32_t list[KARST_NUM_ROOTS];
    const int count = (int)karst_list_roots(file->program->world.root, KARST_PROGRAM_SHADING, list);
    karst_number none = {0};
    karst_world_file_colour_options(file, options);
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error);
    pool_expect(context, "context", &error);
    const karst_virtual_file files[] = {{"probe.cl", colour_probe}, {"world.clh", file->code.colour_source}};
    karst_program *program = karst_program_build(context, "probe.cl", options, files, 2, &error);
    pool_expect(program, "program", &error);
    cl_kernel kernel = karst_program_kernel(program, "colours", &error);
    void *bytes = karst_world_file_data(file, file->info.seed, &error);
    karst_buffer *data = karst_buffer_create(context, "data", file->data_bytes, NULL, &error);
    karst_buffer *out = karst_buffer_create(context, "out", sizeof values, NULL, &error);
    pool_expect(kernel && bytes && data && out && karst_buffer_write(data, 0, bytes, file->data_bytes, &error), "data",
                &error);
    karst_oracle *oracle =
        karst_oracle_create(&file->program->world, &none, file->info.seed, file->info.voxel_log2_m, &error);
    pool_expect(oracle, "oracle", &error);
    for (cl_int level = 0; level < 9; level += 4) {
        cl_int x = -100;
        pool_expect(KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(data), KARST_VALUE_ARG(x), KARST_VALUE_ARG(level),
                                    KARST_BUFFER_ARG(out)) &&
                        karst_launch(context, kernel, KARST_STAGE_SHADE, (size_t)(NUM_COLOURS / lanes), 1, &error) &&
                        karst_buffer_read(out, 0, values, sizeof values, &error),
                    "colours", &error);
        for (int i = 0; i < NUM_COLOURS; i++) {
            karst_position at = {.voxel = {x + 3 * i, 5, -70}};
            karst_oracle_value expected[KARST_NUM_ROOTS];
            karst_oracle_shading(oracle, &at, facing, level, expected);
            for (int c = 0; c < count; c++)
                assert_int_equal(k_as_uint(values[count * (i / lanes * lanes) + c * lanes + i % lanes]),
                                 k_as_uint(expected[list[c]].device));
        }
    }
    karst_oracle_destroy(oracle);
    karst_buffer_destroy(out);
    karst_buffer_destroy(data);
    free(bytes);
    clReleaseKernel(kernel);
    karst_program_destroy(program);
    karst_context_destroy(context);
}

static void check_large_colours(const char *text, int num_outputs)
{
    karst_error error = {0};
    uint32_t list[KARST_NUM_ROOTS];
    karst_world_file *file = karst_world_file_compile("large", text, strlen(text), NULL, 0, NULL, &error);
    pool_expect(file, "world", &error);
    print_message("%u steps\n", file->colour_tape.num_instructions);
    assert_true(file->code.is_colour_tape && !file->code.is_tape && file->colour_tape.num_instructions > 4000);
    assert_int_equal(karst_list_roots(file->program->world.root, KARST_PROGRAM_SHADING, list), num_outputs);
    check_colours(file, 16);
    check_colours(file, 1);
    karst_world_file_destroy(file);
}

static void test_large_colours(void **state)
{
    (void)state;
    static const char text[] =
        "/*{ \"voxel\": 0.25 }*/\n"
        "float density(vec3 p) { return 4.0 * noise(p / 20.0) - p.y; }\n"
        "vec3 colour(vec3 p, vec3 n) {\n"
        "    vec3 c = vec3(0.1, 0.2, 0.05);\n"
        "    for (int i = 0; i < 500; i++) {\n"
        "        float k = float(i);\n"
        "        float d = length(p.xz - 30.0 * vec2(sin(k * 1.7), cos(k * 2.3))) - 4.0 * n.y;\n"
        "        c = mix(c, vec3(0.5 + 0.5 * sin(k), 0.5, noise(p * 0.1)), step(d, 0.0) * 0.7);\n"
        "    }\n"
        "    return c;\n"
        "}\n";
    static const char surface[] = "material surface(vec3 p, vec3 n) {\n"
                                  "    material m;\n"
                                  "    m.colour = colour(p, n);\n"
                                  "    m.mirror = m.colour.y * n.y;\n"
                                  "    m.emission = vec3(2.0, noise(p / 9.0), m.colour.z);\n"
                                  "    return m;\n"
                                  "}\n";
    char both[sizeof text + sizeof surface];
    check_large_colours(text, 3);
    snprintf(both, sizeof both, "%s%s", text, surface);
    check_large_colours(both, 7);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_same_bits),    cmocka_unit_test(test_smooth_minima),
        cmocka_unit_test(test_ten_thousand_ops), cmocka_unit_test(test_fifty_thousand_ops),
        cmocka_unit_test(test_large_colours),
    };
    return cmocka_run_group_tests_name("short tapes", tests, NULL, NULL);
}
