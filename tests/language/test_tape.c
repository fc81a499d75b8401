/* Tapes: the values are the oracle's in every bit, pairs of floats included; values and bounds are the same on a
 * device, in 1 and 16 lanes, as on the host. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/device/context.h"
#include "cache/layout_shared.h"
#include "producers/language/tape/bounds_shared.h"
#include "producers/language/oracle/oracle_internal.h"
#include "producers/language/tape/tape.clh"
#include "tests/language/random_graph.h"

enum { NUM_POINTS = 32, MAX_SLOTS = 96, DEVICE_GRAPHS = 40, OWN_DEVICE_GRAPHS = 8, WORLD_SEED = 7 };

typedef struct {
    random_place place;
    random_graph graph;
    karst_resolved_world world;
    karst_world_layout layout;
    karst_tape tape;
    uint64_t *data;
    int level;
} subject;

static void subject_make(subject *s, uint64_t seed, bool with_pairs)
{
    *s = (subject){.level = 0};
    random_state = seed * 0x9e3779b97f4a7c15ULL + 777;
    random_bits();
    s->place = random_place_make();
    random_graph_make(&s->graph, &s->place, 20 + random_below(120), random_chance(2), 1);
    if (with_pairs)
        random_graph_widen(&s->graph);
    const karst_expr *root = s->graph.root;
    s->world = (karst_resolved_world){.graph = &s->graph.graph, .root = {root[0]}};
    assert_true(karst_world_layout_init(&s->layout, &s->world));
    s->data = calloc(s->layout.num_words, sizeof *s->data);
    assert_true(karst_world_data_fill(&s->layout, s->graph.parameters, WORLD_SEED, s->place.voxel_log2_m, s->data));
    karst_error error;
    assert_true(karst_tape_build(&s->layout, root, 1, &s->tape, &error));
    s->level = (int)random_below(8) - 1;
}

static void subject_finish(subject *s)
{
    free(s->data);
    karst_tape_finish(&s->tape);
    random_graph_finish(&s->graph);
}

static karst_position random_point(const random_place *place)
{
    karst_position p;
    for (int axis = 0; axis < 3; axis++) {
        int64_t most = (int64_t)((double)place->radius[axis] * 0x1p32),
                offset = (int64_t)((random_unit() * 2 - 1) * (double)most);
        uint64_t sum = (uint64_t)place->fraction[axis] + (uint32_t)offset;
        p.voxel[axis] = place->voxel[axis] + (offset >> 32) + (int64_t)(sum >> 32);
        p.fraction[axis] = (uint32_t)sum;
    }
    return p;
}

static tape_program program_of(const subject *s, int *slots)
{
    return (tape_program){.code = s->tape.code,
                          .num_instructions = s->tape.num_instructions,
                          .constants = s->tape.constants,
                          .data = s->data,
                          .values = (const uint *)(s->data + s->layout.values_word),
                          .num_values = s->layout.num_values,
                          .slots = slots};
}

static float host_value(const subject *s, const karst_position *p)
{
    int *slots = calloc((size_t)s->tape.num_slots * TAPE_VALUE_ELEMENTS, sizeof *slots);
    tape_program program = program_of(s, slots);
    affine_position at;
    for (int axis = 0; axis < 3; axis++) {
        at.voxel[axis] = p->voxel[axis];
        at.fraction[axis] = p->fraction[axis];
    }
    tape_values(&program, &at, NULL, s->level);
    float value = k_as_float((uint)tape_load(&program, s->tape.output[0]));
    free(slots);
    return value;
}

static bool same_float(float a, float b) { return k_as_uint(a) == k_as_uint(b) || (isnan(a) && isnan(b)); }

static void compare_with_oracle(uint64_t first, int count, bool with_pairs)
{
    int num_finite = 0;
    for (int i = 0; i < count; i++) {
        subject s;
        karst_error error;
        subject_make(&s, first + (uint64_t)i, with_pairs);
        karst_oracle *oracle =
            karst_oracle_create(&s.world, s.graph.parameters, WORLD_SEED, s.place.voxel_log2_m, &error);
        assert_non_null(oracle);
        for (int k = 0; k < NUM_POINTS; k++) {
            karst_position p = random_point(&s.place);
            float expected = karst_oracle_density(oracle, &p, s.level).device, got = host_value(&s, &p);
            num_finite += isfinite(got) != 0;
            if (!same_float(expected, got))
                fail_msg("graph %lu, point %d: the tape gives %a, the oracle %a", (unsigned long)(first + (uint64_t)i),
                         k, (double)got, (double)expected);
        }
        karst_oracle_destroy(oracle);
        subject_finish(&s);
    }
    assert_true(num_finite > count * NUM_POINTS / 2);
}

static void test_values_are_the_oracles(void **state)
{
    (void)state;
    compare_with_oracle(1, 1000, false);
}

static void test_values_in_pairs_are_the_oracles(void **state)
{
    (void)state;
    compare_with_oracle(5001, 1000, true);
}

/* What the oracle knows in doubles, noise included, lies in the bounds of the box around it. The world's numbers are
 * floats to bounds, so they are here (pairs have both halves). */
static void test_the_oracles_doubles_lie_within_bounds(void **state)
{
    (void)state;
    int num_known = 0;
    for (uint64_t seed = 1; seed <= 2000; seed++) {
        subject s;
        karst_error error;
        subject_make(&s, 20000 + seed, seed % 3 == 0);
        karst_oracle *oracle =
            karst_oracle_create(&s.world, s.graph.parameters, WORLD_SEED, s.place.voxel_log2_m, &error);
        assert_non_null(oracle);
        for (karst_expr e = 1; seed % 3 != 0 && e < s.graph.graph.num_nodes; e++)
            if (oracle->known[e] && s.graph.graph.nodes[e].type == KARST_TYPE_FLOAT)
                oracle->slots[e].d = (double)oracle->slots[e].f;
        int *slots = calloc((size_t)s.tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *slots);
        tape_program program = program_of(&s, slots);
        op_box box = {.level = s.level};
        for (int axis = 0; axis < 3; axis++) {
            box.centre.voxel[axis] = s.place.voxel[axis];
            box.centre.fraction[axis] = s.place.fraction[axis];
            box.radius[axis] = s.place.radius[axis];
        }
        if (!tape_bounds(&program, &box, NULL)) {
            num_known++;
            op_bound b = tape_load_bound(&program, s.tape.output[0]);
            for (int k = 0; k < NUM_POINTS; k++) {
                karst_position p = random_point(&s.place);
                double precise = karst_oracle_density(oracle, &p, s.level).precise;
                double rounding = fabs(precise) * 0x1p-24;
                if (!(precise + rounding >= (double)b.v.lo && precise - rounding <= (double)b.v.hi))
                    fail_msg("graph %lu, point %d: %.12g is not in [%.12g, %.12g]", (unsigned long)(20000 + seed), k,
                             precise, (double)b.v.lo, (double)b.v.hi);
            }
        }
        free(slots);
        karst_oracle_destroy(oracle);
        subject_finish(&s);
    }
    assert_true(num_known > 400);
}

/* What floats lack of the oracle's doubles is no more than what the bounds of the very point compute as their error. */
static void test_floats_are_as_good_as_their_error_says(void **state)
{
    (void)state;
    int num_known = 0, num_inexact = 0;
    double log_sum = 0, nearest = 0;
    for (uint64_t seed = 1; seed <= 1000; seed++) {
        subject s;
        karst_error error;
        subject_make(&s, 40000 + seed, seed % 3 == 0);
        s.level = seed % 4 ? -1 : s.level; /* else the error is also that of another footprint, and much larger */
        karst_oracle *oracle =
            karst_oracle_create(&s.world, s.graph.parameters, WORLD_SEED, s.place.voxel_log2_m, &error);
        assert_non_null(oracle);
        for (karst_expr e = 1; seed % 3 != 0 && e < s.graph.graph.num_nodes; e++)
            if (oracle->known[e] && s.graph.graph.nodes[e].type == KARST_TYPE_FLOAT)
                oracle->slots[e].d = (double)oracle->slots[e].f;
        int *slots = calloc((size_t)s.tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *slots);
        tape_program program = program_of(&s, slots);
        for (int k = 0; k < NUM_POINTS; k++) {
            karst_position p = random_point(&s.place);
            op_box box = {.level = s.level};
            for (int axis = 0; axis < 3; axis++) {
                box.centre.voxel[axis] = p.voxel[axis];
                box.centre.fraction[axis] = p.fraction[axis];
            }
            if (tape_bounds(&program, &box, NULL))
                continue;
            double allowed = (double)tape_load_bound(&program, s.tape.output[0]).d;
            karst_oracle_value value = karst_oracle_density(oracle, &p, s.level);
            double off = fabs((double)value.device - value.precise);
            num_known++;
            if (!(off <= allowed))
                fail_msg("graph %lu, point %d: %.12g as float, %.12g as double, are more than %g apart",
                         (unsigned long)(40000 + seed), k, (double)value.device, value.precise, allowed);
            if (off > 0 && isfinite(allowed) && s.level < 0) {
                num_inexact++;
                log_sum += log2(allowed / off);
                nearest = fmax(nearest, off / allowed);
            }
        }
        free(slots);
        karst_oracle_destroy(oracle);
        subject_finish(&s);
    }
    print_message("%d points; of %d that are inexact the error is 2^-%.1f of what is allowed (geometric mean), %.2f of "
                  "it at most\n",
                  num_known, num_inexact, log_sum / num_inexact, nearest);
    assert_true(num_known > 10000 && num_inexact > 3000);
}

/* A result may lie where a dying argument did; a slot that is still wanted stays. */
static void test_slots_are_few_and_safe(void **state)
{
    (void)state;
    uint64_t num_instructions = 0, num_slots = 0;
    for (uint64_t seed = 1; seed <= 200; seed++) {
        subject s;
        subject_make(&s, seed, seed & 1);
        num_instructions += s.tape.num_instructions;
        num_slots += s.tape.num_slots;
        for (uint32_t i = 0; i < s.tape.num_instructions; i++) {
            const karst_instruction *n = &s.tape.code[i];
            assert_true(n->slot < s.tape.num_slots);
            for (int k = 0; k < 4; k++) {
                if (n->arg[k] == TAPE_NOTHING || tape_is_known(n->arg[k]))
                    continue;
                bool written = false;
                for (uint32_t j = 0; j < i; j++)
                    written = written || s.tape.code[j].slot == (n->arg[k] & TAPE_INDEX);
                /* in a curve also what its head writes, which comes last */
                for (uint32_t j = i; !written && (n->flags & TAPE_IN_CURVE) && j < s.tape.num_instructions; j++) {
                    written = s.tape.code[j].slot == (n->arg[k] & TAPE_INDEX);
                    if (s.tape.code[j].op == TAPE_CURVE)
                        break;
                }
                assert_true(written);
            }
        }
        subject_finish(&s);
    }
    assert_true(3 * num_slots < 2 * num_instructions);
}

/* ---- device ---- */

static const char probe[] =
    "#include \"producers/language/tape/tape.clh\"\n"
    "#if LANES == 16\n"
    "#define LOAD(T, p) vload16(0, p)\n"
    "#else\n"
    "#define LOAD(T, p) (*(p))\n"
    "#endif\n"
    "K_INLINE tape_program program(K_GLOBAL const ulong *words, uint num_instructions, uint num_constants_words, uint "
    "values, uint num_values,\n"
    "                              K_PRIVATE int *slots)\n"
    "{\n"
    "    tape_program t;\n"
    "    t.code = (K_GLOBAL const karst_instruction *)words;\n"
    "    t.num_instructions = num_instructions;\n"
    "    t.constants = (K_GLOBAL const uint *)(words + 4 * num_instructions);\n"
    "    t.data = words + 4 * num_instructions + num_constants_words;\n"
    "    t.values = (K_GLOBAL const uint *)(t.data + values);\n"
    "    t.num_values = num_values;\n"
    "    t.slots = slots;\n"
    "    return t;\n"
    "}\n"
    "K_INLINE K_WIDE affine_position position(K_GLOBAL const long *voxels, K_GLOBAL const uint *fractions, uint "
    "first)\n"
    "{\n"
    "    affine_position at;\n"
    "    for (int axis = 0; axis < 3; axis++) {\n"
    "        at.voxel[axis] = LOAD(vlong, voxels + axis * NUM_POINTS + first);\n"
    "        at.fraction[axis] = LOAD(vuint, fractions + axis * NUM_POINTS + first);\n"
    "    }\n"
    "    return at;\n"
    "}\n"
    "#define ARGUMENTS K_GLOBAL const ulong *words, uint num_instructions, uint num_constants_words, uint values, uint "
    "num_values, uint output, \\\n"
    "    K_GLOBAL const long *voxels, K_GLOBAL const uint *fractions, int level, K_GLOBAL float *out\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void run_values(ARGUMENTS)\n"
    "{\n"
    "    int slots[MAX_SLOTS * TAPE_VALUE_ELEMENTS * LANES];\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    tape_program t = program(words, num_instructions, num_constants_words, values, num_values, slots);\n"
    "    affine_position at = position(voxels, fractions, first);\n"
    "    tape_values(&t, &at, 0, level);\n"
    "    v_store_float(v_as_float(tape_load(&t, output)), out + first);\n"
    "}\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void run_bounds(ARGUMENTS, K_GLOBAL const float *radii)\n"
    "{\n"
    "    vint slots[MAX_SLOTS * TAPE_BOUND_ELEMENTS];\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    tape_program t =\n"
    "        program(words, num_instructions, num_constants_words, values, num_values, (K_PRIVATE int *)slots);\n"
    "    op_box box;\n"
    "    box.centre = position(voxels, fractions, first);\n"
    "    for (int axis = 0; axis < 3; axis++)\n"
    "        box.radius[axis] = v_load_float(radii + axis * NUM_POINTS + first);\n"
    "    box.level = (vint)(level);\n"
    "    vint unknown = tape_bounds(&t, &box, 0);\n"
    "    op_bound b = tape_load_bound(&t, output);\n"
    "    v_store_float(v_to_float(unknown), out + first);\n"
    "    v_store_float(b.v.lo, out + NUM_POINTS + first);\n"
    "    v_store_float(b.v.hi, out + 2 * NUM_POINTS + first);\n"
    "    v_store_float(b.g[1].lo, out + 3 * NUM_POINTS + first);\n"
    "    v_store_float(b.r.hi, out + 4 * NUM_POINTS + first);\n"
    "}\n";

enum { NUM_OUTPUTS = 5 };

typedef struct {
    karst_context *context;
    karst_program *program;
    cl_kernel values, bounds;
} device;

static void expect(bool good, const karst_error *error)
{
    if (!good)
        fail_msg("%s", error->message);
}

static void device_open(device *d, int lanes, const char *more)
{
    karst_error error = {0};
    char options[512];
    snprintf(options, sizeof options, "-DNUM_POINTS=%d -DMAX_SLOTS=%d %s", NUM_POINTS, MAX_SLOTS, more);
    expect((d->context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error)), &error);
    const karst_virtual_file files[] = {{"probe.cl", probe}};
    expect((d->program = karst_program_build(d->context, "probe.cl", options, files, 1, &error)), &error);
    expect((d->values = karst_program_kernel(d->program, "run_values", &error)), &error);
    expect((d->bounds = karst_program_kernel(d->program, "run_bounds", &error)), &error);
}

static void device_close(device *d)
{
    clReleaseKernel(d->values);
    clReleaseKernel(d->bounds);
    karst_program_destroy(d->program);
    karst_context_destroy(d->context);
}

typedef struct {
    int64_t voxel[3][NUM_POINTS];
    uint32_t fraction[3][NUM_POINTS];
    float radius[3][NUM_POINTS];
} boxes;

static boxes random_boxes(const subject *s)
{
    boxes b;
    for (int k = 0; k < NUM_POINTS; k++) {
        karst_position p = random_point(&s->place);
        for (int axis = 0; axis < 3; axis++) {
            b.voxel[axis][k] = p.voxel[axis];
            b.fraction[axis][k] = p.fraction[axis];
            b.radius[axis][k] = s->place.radius[axis] * (float)random_magnitude(1e-4, 1);
        }
    }
    return b;
}

static void run_on_device(device *d, const subject *s, const boxes *b, float values[NUM_POINTS],
                          float bounds[NUM_OUTPUTS][NUM_POINTS])
{
    karst_error error = {0};
    cl_uint num_constants_words = s->tape.num_constants / 2 + 1, num_instructions = s->tape.num_instructions;
    cl_uint values_word = s->layout.values_word, num_values = s->layout.num_values, output = s->tape.output[0];
    size_t num_words = 4 * (size_t)num_instructions + num_constants_words + s->layout.num_words;
    uint64_t *words = calloc(num_words, sizeof *words);
    memcpy(words, s->tape.code, num_instructions * sizeof *s->tape.code);
    memcpy(words + 4 * (size_t)num_instructions, s->tape.constants, s->tape.num_constants * sizeof *s->tape.constants);
    memcpy(words + 4 * (size_t)num_instructions + num_constants_words, s->data, s->layout.num_words * sizeof *words);
    karst_buffer *tape = karst_buffer_create(d->context, "tape", num_words * sizeof *words, words, &error);
    karst_buffer *voxels = karst_buffer_create(d->context, "voxels", sizeof b->voxel, b->voxel, &error);
    karst_buffer *fractions = karst_buffer_create(d->context, "fractions", sizeof b->fraction, b->fraction, &error);
    karst_buffer *radii = karst_buffer_create(d->context, "radii", sizeof b->radius, b->radius, &error);
    karst_buffer *out = karst_buffer_create(d->context, "out", sizeof(float[NUM_OUTPUTS][NUM_POINTS]), NULL, &error);
    expect(tape && voxels && fractions && radii && out, &error);
    size_t num_items = NUM_POINTS / (size_t)d->context->lanes;
    cl_int level = s->level;
#define TAPE_ARGUMENTS                                                                                                \
    KARST_BUFFER_ARG(tape), KARST_VALUE_ARG(num_instructions), KARST_VALUE_ARG(num_constants_words),                  \
        KARST_VALUE_ARG(values_word), KARST_VALUE_ARG(num_values), KARST_VALUE_ARG(output), KARST_BUFFER_ARG(voxels), \
        KARST_BUFFER_ARG(fractions), KARST_VALUE_ARG(level), KARST_BUFFER_ARG(out)
    expect(KARST_ARGUMENTS(d->values, &error, TAPE_ARGUMENTS) &&
               karst_launch(d->context, d->values, KARST_STAGE_EVALUATE, num_items, 1, &error) &&
               karst_buffer_read(out, 0, values, NUM_POINTS * sizeof *values, &error) &&
               KARST_ARGUMENTS(d->bounds, &error, TAPE_ARGUMENTS, KARST_BUFFER_ARG(radii)) &&
               karst_launch(d->context, d->bounds, KARST_STAGE_SUBDIVIDE, num_items, 1, &error) &&
               karst_buffer_read(out, 0, bounds, sizeof(float[NUM_OUTPUTS][NUM_POINTS]), &error),
           &error);
    karst_buffer_destroy(tape);
    karst_buffer_destroy(voxels);
    karst_buffer_destroy(fractions);
    karst_buffer_destroy(radii);
    karst_buffer_destroy(out);
    free(words);
}

static void host_bounds(const subject *s, const boxes *b, int k, float out[NUM_OUTPUTS])
{
    int *slots = calloc((size_t)s->tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *slots);
    tape_program program = program_of(s, slots);
    op_box box = {.level = s->level};
    for (int axis = 0; axis < 3; axis++) {
        box.centre.voxel[axis] = b->voxel[axis][k];
        box.centre.fraction[axis] = b->fraction[axis][k];
        box.radius[axis] = b->radius[axis][k];
    }
    out[0] = (float)tape_bounds(&program, &box, NULL);
    op_bound bound = tape_load_bound(&program, s->tape.output[0]);
    out[1] = bound.v.lo;
    out[2] = bound.v.hi;
    out[3] = bound.g[1].lo;
    out[4] = bound.r.hi;
    free(slots);
}

/* Values and bounds of random boxes; returns of how many something is known. */
static int agree(device *d, const subject *s, uint64_t seed)
{
    int num_known = 0, lanes = d->context->lanes;
    assert_true(s->tape.num_slots <= MAX_SLOTS);
    boxes b = random_boxes(s);
    float values[NUM_POINTS], bounds[NUM_OUTPUTS][NUM_POINTS];
    run_on_device(d, s, &b, values, bounds);
    for (int k = 0; k < NUM_POINTS; k++) {
        karst_position p;
        for (int axis = 0; axis < 3; axis++) {
            p.voxel[axis] = b.voxel[axis][k];
            p.fraction[axis] = b.fraction[axis][k];
        }
        float expected = host_value(s, &p), limits[NUM_OUTPUTS];
        if (!same_float(expected, values[k]))
            fail_msg("graph %lu, point %d, %d lanes: %a, on the host %a", (unsigned long)seed, k, lanes,
                     (double)values[k], (double)expected);
        host_bounds(s, &b, k, limits);
        num_known += limits[0] == 0;
        for (int i = 0; i < NUM_OUTPUTS; i++)
            if (!same_float(limits[i], bounds[i][k]) && (i == 0 || limits[0] == 0))
                fail_msg("graph %lu, box %d, %d lanes, bound %d: %a, on the host %a", (unsigned long)seed, k, lanes, i,
                         (double)bounds[i][k], (double)limits[i]);
    }
    return num_known;
}

/* Interpreters that are compiled for one tape give what whole ones do. */
static void test_a_device_needs_no_more_than_a_tape_runs(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= OWN_DEVICE_GRAPHS; seed++) {
        subject s;
        device d;
        char options[KARST_TAPE_OPTIONS_BYTES];
        subject_make(&s, 91000 + seed, seed & 1);
        karst_tape_options(&s.tape, options, sizeof options);
        device_open(&d, seed == 1 ? 16 : 1, options);
        agree(&d, &s, seed);
        device_close(&d);
        subject_finish(&s);
    }
}

static void test_devices_agree_with_the_host(void **state)
{
    (void)state;
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        device d;
        device_open(&d, lanes, "");
        int num_known = 0;
        for (uint64_t seed = 1; seed <= DEVICE_GRAPHS; seed++) {
            subject s;
            subject_make(&s, 90000 + seed, seed & 1);
            num_known += agree(&d, &s, seed);
            subject_finish(&s);
        }
        assert_true(num_known > DEVICE_GRAPHS * NUM_POINTS / 8);
        device_close(&d);
    }
}

/* ---- the tape as a density program ---- */

static const char world_probe[] =
    "#include \"producers/language/tape/tape_world.clh\"\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void row(K_GLOBAL const ulong *data, long x, long y, long z, int level, K_GLOBAL float *out)\n"
    "{\n"
    "    world_axes axes;\n"
    "    world_point_at at;\n"
    "    world_prepare(data, &axes, x, y, z, level);\n"
    "    for (int ix = 0; ix < KARST_BRICK_CELLS; ix += LANES)\n"
    "        v_store_float(world_row(&axes, ix, 3, 5), out + ix);\n"
    "    at.voxel[0] = (vlong)(x) + v_int_to_long(V_LANE) * (vlong)(1L << level);\n"
    "    at.voxel[1] = (vlong)(y + (3L << level));\n"
    "    at.voxel[2] = (vlong)(z + (5L << level));\n"
    "    at.fraction[0] = at.fraction[1] = at.fraction[2] = (vuint)(0u);\n"
    "    v_store_float(world_point(data, &at, level), out + KARST_BRICK_CELLS);\n"
    "}\n";

/* Header and world's data, constants, code. */
static karst_buffer *world_buffer(karst_context *context, const subject *s, karst_error *error)
{
    const karst_tape *tape = &s->tape;
    size_t constants = s->layout.num_words, code = constants + tape->num_constants / 2 + 1;
    size_t num_words = code + 4 * (size_t)tape->num_instructions;
    uint64_t *words = calloc(num_words, sizeof *words);
    karst_data_header header = {.num_instructions = tape->num_instructions,
                                .code = (uint32_t)code,
                                .constants = (uint32_t)constants,
                                .values = s->layout.values_word,
                                .num_values = s->layout.num_values,
                                .output = tape->output[0]};
    memcpy(words, s->data, s->layout.num_words * sizeof *words);
    memcpy(words, &header, sizeof header);
    memcpy(words + constants, tape->constants, tape->num_constants * sizeof *tape->constants);
    memcpy(words + code, tape->code, tape->num_instructions * sizeof *tape->code);
    karst_buffer *buffer = karst_buffer_create(context, "world", num_words * sizeof *words, words, error);
    free(words);
    return buffer;
}

static void test_a_tape_is_a_density_program(void **state)
{
    (void)state;
    karst_error error = {0};
    char options[64];
    snprintf(options, sizeof options, "-DWORLD_HAS_DATA -DTAPE_SLOTS=%d", MAX_SLOTS);
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 16, NULL, &error);
    expect(context, &error);
    const karst_virtual_file files[] = {{"probe.cl", world_probe}};
    karst_program *program = karst_program_build(context, "probe.cl", options, files, 1, &error);
    expect(program, &error);
    cl_kernel row = karst_program_kernel(program, "row", &error);
    karst_buffer *out = karst_buffer_create(context, "out", 2 * KARST_BRICK_CELLS * sizeof(float), NULL, &error);
    expect(row && out, &error);
    for (uint64_t seed = 1; seed <= 10; seed++) {
        subject s;
        subject_make(&s, 70000 + seed, seed & 1);
        s.level = (int)(seed % 4);
        karst_buffer *world = world_buffer(context, &s, &error);
        expect(world, &error);
        cl_long x = s.place.voxel[0], y = s.place.voxel[1], z = s.place.voxel[2];
        cl_int level = s.level;
        float samples[2 * KARST_BRICK_CELLS];
        expect(KARST_ARGUMENTS(row, &error, KARST_BUFFER_ARG(world), KARST_VALUE_ARG(x), KARST_VALUE_ARG(y),
                               KARST_VALUE_ARG(z), KARST_VALUE_ARG(level), KARST_BUFFER_ARG(out)) &&
                   karst_launch(context, row, KARST_STAGE_EVALUATE, 1, 1, &error) &&
                   karst_buffer_read(out, 0, samples, sizeof samples, &error),
               &error);
        for (int i = 0; i < KARST_BRICK_CELLS; i++) {
            karst_position p = {.voxel = {x + ((int64_t)i << level), y + (3LL << level), z + (5LL << level)}};
            float expected = host_value(&s, &p);
            assert_true(same_float(samples[i], expected) && same_float(samples[KARST_BRICK_CELLS + i], expected));
        }
        karst_buffer_destroy(world);
        subject_finish(&s);
    }
    karst_buffer_destroy(out);
    clReleaseKernel(row);
    karst_program_destroy(program);
    karst_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values_are_the_oracles),
        cmocka_unit_test(test_values_in_pairs_are_the_oracles),
        cmocka_unit_test(test_the_oracles_doubles_lie_within_bounds),
        cmocka_unit_test(test_floats_are_as_good_as_their_error_says),
        cmocka_unit_test(test_slots_are_few_and_safe),
        cmocka_unit_test(test_devices_agree_with_the_host),
        cmocka_unit_test(test_a_device_needs_no_more_than_a_tape_runs),
        cmocka_unit_test(test_a_tape_is_a_density_program),
    };
    return cmocka_run_group_tests_name("tape", tests, NULL, NULL);
}
