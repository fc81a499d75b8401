/* Generated code: graphs at random and world files, as point and as brick code, with 1 and with 16 lanes, give the same
 * bits wherever they lie, and those of the host's oracle. */
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cache/layout_shared.h"
#include "core/device/context.h"
#include "producers/language/emit/emit.h"
#include "producers/language/language.h"
#include "producers/language/oracle/oracle.h"
#include "producers/language/ops/octave.clh"
#include "tests/language/built_ins.h"
#include "tests/language/wild_graph.h"

#define NUM_SAMPLES KARST_BRICK_SAMPLES
#define VOXEL_LOG2_M (-4)

static const char probe[] =
    "#include \"core/device/lanes.clh\"\n"
    "#include \"cache/layout_shared.h\"\n"
    "#include \"producers/steps/density.clh\"\n"
    "#include \"world.clh\"\n"
    "#if LANES == 16\n"
    "#define LOAD_LONG(p) vload16(0, p)\n"
    "#else\n"
    "#define LOAD_LONG(p) (*(p))\n"
    "#endif\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void points(K_GLOBAL const ulong *data, K_GLOBAL const long *voxels, uint count, int level, K_GLOBAL float *out)\n"
    "{\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    world_point_at at;\n"
    "    if (first >= count) return;\n"
    "    for (int axis = 0; axis < 3; axis++) {\n"
    "        at.voxel[axis] = LOAD_LONG(voxels + axis * count + first);\n"
    "        at.fraction[axis] = (vuint)(0u);\n"
    "    }\n"
    "    v_store_float(world_point(data, &at, level), out + first);\n"
    "}\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void brick(K_GLOBAL const ulong *data, long x, long y, long z, int level, K_GLOBAL float *out)\n"
    "{\n"
    "    world_axes axes;\n"
    "    if (get_global_id(0) != 0) return;\n"
    "    world_prepare(data, &axes, x, y, z, level);\n"
    "    for (int iz = 0; iz < KARST_BRICK_SIDE; iz++)\n"
    "        for (int iy = 0; iy < KARST_BRICK_SIDE; iy++) {\n"
    "            K_GLOBAL float *row = out + (iz * KARST_BRICK_SIDE + iy) * KARST_BRICK_SIDE;\n"
    "            for (int ix = 0; ix < KARST_BRICK_CELLS; ix += LANES)\n"
    "                v_store_float(world_row(&axes, ix, iy, iz), row + ix);\n"
    "            float last[LANES];\n"
    "            v_store_float(world_sample(&axes, (vint)(KARST_BRICK_CELLS), (vint)(iy), (vint)(iz)), last);\n"
    "            row[KARST_BRICK_CELLS] = last[0];\n"
    "        }\n"
    "}\n";

/* Fractions of places in packets around an anchor with fractions of its own: such that all are steps of 2^-20 voxels,
 * or all but those of some lanes along y, or whole voxels. */
#define WAY(index) ((index) >> 6 & 3)
#define ANCHOR_FRACTION(axis) (0x9abcdef1u * ((uint32_t)(axis) + 1u))
static uint32_t colour_fraction(uint32_t index, int axis)
{
    uint32_t step = (index * 0x9e3779b9u + (uint32_t)axis * 0x85ebca6bu) << 12;
    bool is_whole = WAY(index) == 2;
    return ANCHOR_FRACTION(axis) + (is_whole ? 0 : step) + (WAY(index) == 1 && axis == 1 && (index & 7) == 5);
}

static const char colour_probe[] =
    "#include \"core/device/lanes.clh\"\n"
    "#include \"producers/steps/density.clh\"\n"
    "#include \"world.clh\"\n"
    "#if LANES == 16\n"
    "#define LOAD_LONG(p) vload16(0, p)\n"
    "#else\n"
    "#define LOAD_LONG(p) (*(p))\n"
    "#endif\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void points(K_GLOBAL const ulong *data, K_GLOBAL const long *voxels, uint count, int level, K_GLOBAL float *out)\n"
    "{\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    world_point_at at;\n"
    "    __local near_octave known[WORLD_NEAR_OCTAVES + 1];\n"
    "    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0);\n"
    "    vfloat red, green, blue;\n"
    "    if (first >= count) return;\n"
    "    uint way = first >> 6 & 3u;\n"
    "    vint index = (vint)((int)first) + V_LANE, kind = index >> 5 & 3;\n"
    "    uint fraction[3];\n"
    "    for (int axis = 0; axis < 3; axis++) {\n"
    "        at.voxel[axis] = LOAD_LONG(voxels + axis * count + first);\n"
    "        fraction[axis] = 0x9abcdef1u * ((uint)axis + 1u);\n"
    "        vuint step = (v_int_to_uint(index) * 0x9e3779b9u + (uint)axis * 0x85ebca6bu) << 12;\n"
    "        vint odd = way == 1u && axis == 1 ? v_eq(index & 7, (vint)(5)) : (vint)(0);\n"
    "        at.fraction[axis] = (vuint)(fraction[axis]) - v_int_to_uint(odd) + (way == 2u ? (vuint)(0u) : step);\n"
    "    }\n"
    "    vint steep = v_eq(kind, (vint)(1)) | (v_eq(kind, (vint)(2)) & v_ne(index & 1, (vint)(0)));\n"
    "    vint level_ground = v_eq(kind, (vint)(3));\n"
    "    vfloat facing[6];\n"
    "    facing[0] = v_select(steep, (vfloat)(0.8f), v_select(level_ground, (vfloat)(0.0f), (vfloat)(0.48f)));\n"
    "    facing[1] = v_select(steep, (vfloat)(0.0f), v_select(level_ground, (vfloat)(1.0f), (vfloat)(0.6f)));\n"
    "    facing[2] = v_select(steep, (vfloat)(-0.6f), v_select(level_ground, (vfloat)(0.0f), (vfloat)(-0.64f)));\n"
    "    facing[3] = v_select(steep, (vfloat)(0.0f), (vfloat)(1.5f));\n"
    "    facing[4] = v_select(steep, (vfloat)(-5.0f), (vfloat)(0.0f));\n"
    "    facing[5] = v_select(level_ground, (vfloat)(2.25f), (vfloat)(0.0f));\n"
    /* Anchors near and far, and so far that some lanes are beyond what steps from them reach. */
    "    long anchor[3];\n"
    "    for (int axis = 0; axis < 3; axis++)\n"
    "        anchor[axis] = way == 3u ? 5 : voxels[axis * count] - 1000 * axis;\n"
    "    if (way == 2u)\n"
    "        anchor[2] = voxels[2u * count + first] - 0xf0000000l;\n"
    /* As exact_steps (raycast/cast/exact.clh) has them of floats. */
    "    world_near_at near;\n"
    "    near.voxel = anchor, near.fraction = fraction;\n"
    "    near.reach = 1.0f;\n"
    "    for (int axis = 0; axis < 3; axis++)\n"
    "        for (uint i = first; i < first + LANES; i++)\n"
    "            near.reach = max(near.reach, fabs((float)(voxels[axis * count + i] - anchor[axis])) * 1.001f + "
    "1.0f);\n"
    "    near.shift = 37 + 127 - (int)(as_uint(near.reach) >> 23);\n"
    "    near.is_far = near.shift < 0 ? 7 : 0;\n"
    "    near.shift = clamp(near.shift, 0, WORLD_NEAR_SHIFT);\n"
    "    for (int axis = 0; axis < 3; axis++) {\n"
    "        vlong part = v_ulong_to_long(v_uint_to_ulong(at.fraction[axis])) - (vlong)((long)fraction[axis]);\n"
    "        vlong below = part & (vlong)((1l << (32 - near.shift)) - 1);\n"
    "        near.step[axis] = ((at.voxel[axis] - (vlong)(anchor[axis])) << (vlong)((long)near.shift)) +\n"
    "                          (part >> (vlong)((long)(32 - near.shift)));\n"
    "        if (v_any(v_ne(v_ulong_to_uint(v_long_to_ulong(below)), (vuint)(0u))))\n"
    "            near.is_far |= 1 << axis;\n"
    "    }\n"
    "    world_colour_prepare(data, anchor, fraction, octaves, 0u, 1u);\n"
    "#ifdef WORLD_NUM_OUTPUTS\n"
    "    vfloat values[WORLD_NUM_OUTPUTS];\n"
    "    world_outputs(data, &near, octaves, &at, level, facing, values);\n"
    "#else\n"
    "    vfloat values[3];\n"
    "    world_colour(data, &near, octaves, &at, level, facing, values);\n"
    "#endif\n"
    "    vfloat sum = values[0] + (vfloat)(2.0f) * values[1] - (vfloat)(4.0f) * values[2];\n"
    "#ifdef WORLD_NUM_OUTPUTS\n"
    "    for (int i = 3; i < WORLD_NUM_OUTPUTS; i++)\n"
    "        sum += (vfloat)((float)(1 << i)) * values[i];\n"
    "#endif\n"
    "    v_store_float(sum, out + first);\n"
    "}\n"
    "__kernel void brick(void) {}\n";

/* A number from the environment, or the default. */
static uint32_t setting(const char *name, uint32_t otherwise)
{
    const char *text = getenv(name);
    return text ? (uint32_t)strtoul(text, NULL, 10) : otherwise;
}

static void expect(bool good, const karst_error *error)
{
    if (!good)
        fail_msg("%s", error->message);
}

static _Noreturn void full(void *user, uint32_t where)
{
    (void)user;
    (void)where;
    abort();
}

/* ---- a device with a world's kernels on it ---- */

typedef struct {
    karst_context *context;
    karst_program *program;
    cl_kernel points, brick;
    karst_buffer *data, *voxels, *out;
} device;

static void device_build(device *d, const char *kernels, const char *source, size_t data_bytes)
{
    karst_error error = {0};
    const karst_virtual_file files[] = {{"probe.cl", kernels}, {"world.clh", source}};
    d->program = karst_program_build(d->context, "probe.cl", "", files, 2, &error);
    if (!d->program)
        print_error("%s\n", source);
    expect(d->program, &error);
    expect((d->points = karst_program_kernel(d->program, "points", &error)), &error);
    expect((d->brick = karst_program_kernel(d->program, "brick", &error)), &error);
    expect((d->data = karst_buffer_create(d->context, "data", data_bytes, NULL, &error)), &error);
    expect(
        (d->voxels = karst_buffer_create(d->context, "voxels", 3 * (NUM_SAMPLES + 16) * sizeof(int64_t), NULL, &error)),
        &error);
    expect((d->out = karst_buffer_create(d->context, "out", (NUM_SAMPLES + 16) * sizeof(float), NULL, &error)), &error);
}

static void device_drop(device *d)
{
    karst_buffer_destroy(d->data);
    karst_buffer_destroy(d->voxels);
    karst_buffer_destroy(d->out);
    clReleaseKernel(d->points);
    clReleaseKernel(d->brick);
    karst_program_destroy(d->program);
}

static void run_points(device *d, const int64_t origin[3], int level, float *samples)
{
    static int64_t voxels[3][NUM_SAMPLES + 15];
    karst_error error = {0};
    cl_uint count = (NUM_SAMPLES + 15) / 16 * 16;
    int64_t *flat = &voxels[0][0];
    for (cl_uint i = 0; i < count; i++) {
        int at[3] = {(int)i % KARST_BRICK_SIDE, (int)i / KARST_BRICK_SIDE % KARST_BRICK_SIDE,
                     (int)i / (KARST_BRICK_SIDE * KARST_BRICK_SIDE)};
        for (cl_uint axis = 0; axis < 3; axis++)
            flat[axis * count + i] = origin[axis] + ((int64_t)at[axis] << level);
    }
    expect(karst_buffer_write(d->voxels, 0, flat, 3 * count * sizeof *flat, &error) &&
               KARST_ARGUMENTS(d->points, &error, KARST_BUFFER_ARG(d->data), KARST_BUFFER_ARG(d->voxels),
                               KARST_VALUE_ARG(count), KARST_VALUE_ARG(level), KARST_BUFFER_ARG(d->out)) &&
               karst_launch(d->context, d->points, KARST_STAGE_EVALUATE, count, 1, &error) &&
               karst_buffer_read(d->out, 0, samples, NUM_SAMPLES * sizeof *samples, &error),
           &error);
}

static void run_brick(device *d, const int64_t origin[3], int level, float *samples)
{
    karst_error error = {0};
    cl_long x = origin[0], y = origin[1], z = origin[2];
    expect(KARST_ARGUMENTS(d->brick, &error, KARST_BUFFER_ARG(d->data), KARST_VALUE_ARG(x), KARST_VALUE_ARG(y),
                           KARST_VALUE_ARG(z), KARST_VALUE_ARG(level), KARST_BUFFER_ARG(d->out)) &&
               karst_launch(d->context, d->brick, KARST_STAGE_EVALUATE, 1, 1, &error) &&
               karst_buffer_read(d->out, 0, samples, NUM_SAMPLES * sizeof *samples, &error),
           &error);
}

/* ---- the comparison ---- */

static uint32_t bits_of(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, 4);
    return f == f ? bits : 0x7fc00000u; /* one NaN is as good as another */
}

static void compare(const float *a, const float *b, const char *what, const int64_t origin[3], int level,
                    uint32_t graph)
{
    for (int i = 0; i < NUM_SAMPLES; i++)
        if (bits_of(a[i]) != bits_of(b[i]))
            fail_msg("graph %u, %s: sample %d of the brick at %lld %lld %lld, level %d: %a against %a", graph, what, i,
                     (long long)origin[0], (long long)origin[1], (long long)origin[2], level, (double)a[i],
                     (double)b[i]);
}

static const struct {
    int64_t origin[3];
    int level;
} places[] = {{{0, 0, 0}, 0},
              {{-48, 16, -16}, 0},
              {{1000000000, -1000000016, 16000}, 0},
              {{1000000000000000, 999999999999984, -1000000000000000}, 0},
              {{-4096, 8192, 0}, 5},
              {{1LL << 40, -(1LL << 41), 0}, 36}};
#define NUM_PLACES (sizeof places / sizeof *places)

/* What the graphs' parameters are at first, and after a change. */
static const double parameters[2][WILD_PARAMETERS] = {{0.75, -3, 40}, {1.5, 7, 0.01}};

static device devices[2];

static int open_devices(void **state)
{
    karst_error error = {0};
    (void)state;
    for (int i = 0; i < 2; i++)
        expect((devices[i].context = karst_context_create(getenv("KARST_DEVICE"), i ? 16 : 1, NULL, &error)), &error);
    return 0;
}

static int close_devices(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++)
        karst_context_destroy(devices[i].context);
    return 0;
}

/* Every STEP-th sample, and the last one of each row, against the host. */
#define STEP 97
static void compare_with_oracle(karst_oracle *oracle, const karst_expr *shading, const float *samples,
                                const int64_t origin[3], int level, uint32_t number)
{
    /* As colour_probe has them: packets of one kind of ground, and such as hold two. */
    static const float slope[KARST_FACING_FLOATS] = {0.48f, 0.6f, -0.64f, 1.5f, 0, 0},
                       steep[KARST_FACING_FLOATS] = {0.8f, 0, -0.6f, 0, -5, 0},
                       flat[KARST_FACING_FLOATS] = {0, 1, 0, 1.5f, 0, 2.25f};
    static const float *const facings[8] = {slope, slope, steep, steep, slope, steep, flat, flat};
    for (int i = 0; i < NUM_SAMPLES; i += STEP) {
        karst_position at = {{0}, {0}};
        int index[3] = {i % KARST_BRICK_SIDE, i / KARST_BRICK_SIDE % KARST_BRICK_SIDE,
                        i / (KARST_BRICK_SIDE * KARST_BRICK_SIDE)};
        for (int axis = 0; axis < 3; axis++)
            at.voxel[axis] = origin[axis] + ((int64_t)index[axis] << level);
        for (int axis = 0; axis < 3 && shading; axis++)
            at.fraction[axis] = colour_fraction((uint32_t)i, axis);
        float expected;
        if (shading) {
            karst_oracle_value v[KARST_NUM_ROOTS], *rgb = v + KARST_ROOT_COLOUR;
            uint32_t list[KARST_NUM_ROOTS];
            const size_t count = karst_list_roots(shading, KARST_PROGRAM_SHADING, list);
            karst_oracle_shading(oracle, &at, facings[(i >> 5 & 3) * 2 + (i & 1)], level, v);
            expected = rgb[0].device + 2.0f * rgb[1].device - 4.0f * rgb[2].device;
            for (size_t k = 3; k < count; k++)
                expected += (float)(1 << k) * v[list[k]].device;
        } else {
            expected = karst_oracle_density(oracle, &at, level).device;
        }
        if (bits_of(expected) != bits_of(samples[i]))
            fail_msg("graph %u, host and device: sample %d of the brick at %lld %lld %lld, level %d: %a against %a",
                     number, i, (long long)origin[0], (long long)origin[1], (long long)origin[2], level,
                     (double)expected, (double)samples[i]);
    }
}

typedef struct {
    karst_world_layout layout;
    karst_emitted emitted;
    uint64_t *words;
    size_t bytes;
    int voxel_log2_m;
    uint32_t number; /* for messages */
} subject;

static void check_densities(const subject *s, const karst_number *values)
{
    static float samples[4][NUM_SAMPLES];
    karst_error error = {0};
    karst_oracle *oracle = karst_oracle_create(&s->layout.world, values, 7, s->voxel_log2_m, &error);
    expect(oracle, &error);
    for (size_t p = 0; p < NUM_PLACES; p++) {
        const int64_t *origin = places[p].origin;
        int level = places[p].level;
        for (int i = 0; i < 2; i++) {
            expect(karst_buffer_write(devices[i].data, 0, s->words, s->bytes, &error), &error);
            run_points(&devices[i], origin, level, samples[i]);
            run_brick(&devices[i], origin, level, samples[2 + i]);
        }
        compare(samples[0], samples[1], "points with 1 and 16 lanes", origin, level, s->number);
        compare(samples[0], samples[2], "points and bricks, 1 lane", origin, level, s->number);
        compare(samples[0], samples[3], "points and bricks, 16 lanes", origin, level, s->number);
        compare_with_oracle(oracle, NULL, samples[0], origin, level, s->number);
    }
    karst_oracle_destroy(oracle);
}

static int num_choosing; /* worlds whose colours leave out what a packet does not need */

static void check_colours(const subject *s, const karst_number *values)
{
    static float samples[2][NUM_SAMPLES];
    karst_error error = {0};
    karst_oracle *oracle = karst_oracle_create(&s->layout.world, values, 7, s->voxel_log2_m, &error);
    expect(oracle, &error);
    for (int i = 0; i < 2; i++)
        device_build(&devices[i], colour_probe, s->emitted.colour_source, s->bytes);
    for (size_t p = 0; p < NUM_PLACES; p++) {
        for (int i = 0; i < 2; i++) {
            expect(karst_buffer_write(devices[i].data, 0, s->words, s->bytes, &error), &error);
            run_points(&devices[i], places[p].origin, places[p].level, samples[i]);
        }
        compare(samples[0], samples[1], "colours with 1 and 16 lanes", places[p].origin, places[p].level, s->number);
        compare_with_oracle(oracle, s->layout.world.root, samples[0], places[p].origin, places[p].level, s->number);
    }
    for (int i = 0; i < 2; i++)
        device_drop(&devices[i]);
    karst_oracle_destroy(oracle);
}

/* values: two sets of parameters; the second takes effect without a build. NULL for the second: none. */
static void check_world(const karst_resolved_world *world, const karst_number *const values[2], int voxel_log2_m,
                        uint32_t number, bool with_densities)
{
    karst_error error = {0};
    const char *fault;
    subject s = {.voxel_log2_m = voxel_log2_m, .number = number};
    if (!karst_graph_check(world->graph, &fault))
        fail_msg("graph %u: %s", number, fault);
    assert_true(karst_world_layout_init(&s.layout, world));
    expect(karst_emit_world(&s.layout, &s.emitted, &error), &error);
    num_choosing += s.emitted.colour_source && strstr(s.emitted.colour_source, "if (v_any(m");
    s.bytes = s.layout.num_words * sizeof(uint64_t);
    s.words = malloc(s.bytes);
    for (int i = 0; i < 2 && with_densities; i++)
        device_build(&devices[i], probe, s.emitted.source, s.bytes);
    for (int change = 0; change < 2 && values[change] && with_densities; change++) {
        assert_true(karst_world_data_fill(&s.layout, values[change], 7, voxel_log2_m, s.words));
        check_densities(&s, values[change]);
    }
    for (int i = 0; i < 2 && with_densities; i++)
        device_drop(&devices[i]);
    if (karst_has_output(world->root, KARST_OUTPUT_COLOUR)) {
        assert_true(karst_world_data_fill(&s.layout, values[0], 7, voxel_log2_m, s.words));
        check_colours(&s, values[0]);
    }
    free(s.words);
    karst_emitted_finish(&s.emitted);
}

/* EMIT_GRAPHS of them, from number EMIT_FIRST. Each is compiled four times. Under a sanitizer a few do: it looks at the
 * host's part alone. */
static void test_random_graphs(void **state)
{
    uint32_t first = setting("EMIT_FIRST", 0), count = setting("EMIT_GRAPHS", getenv("KARST_TEST_FULL")    ? 100
                                                                              : getenv("KARST_TEST_QUICK") ? 3
                                                                                                           : 6);
    (void)state;
    for (uint32_t i = first; i < first + count; i++) {
        karst_arena arena;
        karst_graph graph, live;
        wild_source random = {0x9e3779b97f4a7c15u * (i + 1)};
        karst_arena_init(&arena, (size_t)64 << 20, NULL, NULL);
        karst_graph_init(&graph, &arena, 1u << 16, full, NULL);
        karst_graph_init(&live, &arena, 1u << 16, full, NULL);
        karst_expr root = wild_graph(&graph, &random, 20 + wild_below(&random, 150));
        karst_graph_extract(&graph, &live, &root, 1);
        karst_resolved_world world = {.graph = &live, .root = {root}};
        karst_number values[2][WILD_PARAMETERS];
        for (int k = 0; k < 2 * WILD_PARAMETERS; k++)
            values[k / WILD_PARAMETERS][k % WILD_PARAMETERS] =
                karst_number_double(parameters[k / WILD_PARAMETERS][k % WILD_PARAMETERS]);
        check_world(&world, (const karst_number *const[2]){values[0], values[1]}, VOXEL_LOG2_M, i, true);
        karst_arena_finish(&arena);
    }
}

/* ---- world files ---- */

static void check_program(karst_program_graph *program, const char *name, bool with_densities)
{
    karst_number *values = calloc(program->num_parameters + 1, sizeof *values);
    for (uint32_t i = 0; i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    print_message("%s\n", name);
    check_world(&program->world, (const karst_number *const[2]){values, NULL}, program->header.voxel_log2_m, 0,
                with_densities);
    free(values);
    karst_program_graph_destroy(program);
}

static void check_file(const char *path, bool with_densities)
{
    karst_error error = {0};
    bool ok;
    karst_program_graph *program = karst_language_compile_file(path, NULL, 0, &ok, &error);
    expect(ok, &error);
    check_program(program, path, with_densities);
}

/* EMIT_FILES: only those whose name holds this. Under a sanitizer every third. */
static void check_folder(const char *folder, bool with_densities)
{
    const char *only = getenv("EMIT_FILES");
    struct dirent **entries;
    int count = scandir(folder, &entries, NULL, alphasort), checked = 0;
    if (count < 0)
        fail_msg("cannot read %s: run this from the root of the repository", folder);
    for (int i = 0; i < count; i++) {
        char path[512];
        snprintf(path, sizeof path, "%s/%s", folder, entries[i]->d_name);
        const bool left_out = i % (getenv("KARST_TEST_FULL") || only ? 1 : 4);
        if (strstr(path, ".karst") && !left_out && (!only || strstr(path, only))) {
            check_file(path, with_densities);
            checked++;
        }
        free(entries[i]);
    }
    free(entries);
    assert_true(checked > 0 || only);
}

/* Their colours: of their densities tests/worlds/test_same_bits compares points and bricks with the host's. */
static void test_shipped_worlds(void **state)
{
    (void)state;
    num_choosing = 0;
    check_folder("demos/worlds", getenv("KARST_TEST_FULL") != NULL);
    assert_true(num_choosing > 0 || getenv("EMIT_FILES") || getenv("KARST_TEST_QUICK"));
}

static void test_pasted_worlds(void **state)
{
    (void)state;
    check_folder("tests/language/pasted", true);
}

static void test_noises(void **state)
{
    (void)state;
    check_folder("tests/language/noises", true);
}

/* All that a surface gives, with the normal, noise on either side of a mix, a parameter and a number that is known. */
static void test_surfaces(void **state)
{
    static const char *const texts[] = {
        "/*{ \"params\": { \"wet\": 0.3 } }*/\n"
        "float density(vec3 p) { return fbm(p / 16.0, 3) - p.y; }\n"
        "material surface(vec3 p, vec3 n) {\n"
        "    material m;\n"
        "    float rock = smoothstep(0.2, 0.7, n.y);\n"
        "    m.colour = mix(vec3(fbm(p / 3.0, 4)), vec3(0.2, 0.3, noise(p)), rock);\n"
        "    m.mirror = wet * n.y;\n"
        "    m.gloss = step(0.0, sin(p.x / 5.0));\n"
        "    m.emission = vec3(noise(p / 7.0), fract(p.y / 9.0), 0.25);\n"
        "    m.ior = 1.5;\n"
        "    m.absorption = p.zxy / 100.0;\n"
        "    m.transparency = mix(0.0, noise(p / 2.0), rock);\n"
        "    return m;\n"
        "}\n",
        "float density(vec3 p) { return -p.y; }\n"
        "material surface(vec3 p, vec3 n) { material m; m.emission.y = worley(p / 4.0).x * n.z; return m; }\n",
    };
    (void)state;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        karst_error error = {0};
        bool ok;
        karst_program_graph *program =
            karst_language_compile("surface", texts[i], strlen(texts[i]), NULL, 0, &ok, &error);
        expect(program && ok, &error);
        uint32_t list[KARST_NUM_ROOTS];
        assert_int_equal(karst_list_roots(program->world.root, KARST_PROGRAM_SHADING, list), i ? 6 : 13);
        check_program(program, "a surface", true);
    }
}

/* Files of 8 bits in colours: on their own axes and on others, moved, mirrored, finer than voxels and much coarser, one
 * channel alone, and on either side of what a packet may leave out. */
static void test_textures(void **state)
{
    static const char head[] = "/*{ \"data\": { \"rock\": { \"file\": \"data/rock.png\", \"wrap\": \"repeat\" },\n"
                               "    \"turf\": { \"file\": \"data/turf.png\", \"wrap\": \"mirror\" } } }*/\n"
                               "float density(vec3 p) { return -p.y; }\n";
    static const char *const bodies[] = {
        "vec3 colour(vec3 p, vec3 n) {\n"
        "    vec3 q = p + 3.0 * vec3(noise(p / 9.0), 0.0, 0.0);\n"
        "    vec3 a = texture(rock, q, n, 900.0), b = texture(turf, vec3(-p.x, p.y, p.x - p.z), n, 0.6);\n"
        "    return mix(a, b, smoothstep(0.2, 0.7, n.y));\n"
        "}",
        /* one file's channels wait for different sides */
        "vec3 colour(vec3 p, vec3 n) {\n"
        "    vec3 a = texture(rock, p, vec3(0.0, 1.0, 0.0), 9.0);\n"
        "    float s = smoothstep(0.2, 0.7, n.y), t = smoothstep(0.2, 0.7, n.x);\n"
        "    return vec3(mix(0.2, a.x * n.x, s), mix(0.3, a.y * n.y, t), mix(a.z * n.z, noise(p), s)) +\n"
        "        texture(turf, p * length(p) / 50.0, vec3(0.0, 0.0, 1.0), 3.0).yyz;\n"
        "}",
    };
    char text[2048];
    (void)state;
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        karst_error error = {0};
        bool ok;
        snprintf(text, sizeof text, "%s%s\n", head, bodies[i]);
        karst_program_graph *program =
            karst_language_compile("demos/worlds/textures", text, strlen(text), NULL, 0, &ok, &error);
        expect(program && ok, &error);
        check_program(program, "textures", false);
    }
}

/* Every function of the language, a few dozen a world: the density is a hash of all their bits. */
static void test_every_function(void **state)
{
    enum { A_WORLD = 56 };
    static char text[1 << 16];
    (void)state;
    for (size_t first = 0; first < NUM_BUILT_INS; first += A_WORLD) {
        karst_error error = {0};
        bool ok;
        char name[32];
        size_t length = (size_t)sprintf(text, "/*{ \"seed\": 7 }*/\n"
                                              "int hash(int h, float a) {\n"
                                              "    h = (h ^ (a == a ? floatBitsToInt(a) : 5)) * 16777619;\n"
                                              "    return h ^ h >> 15;\n"
                                              "}\n"
                                              "float density(vec3 at) {\n"
                                              "    vec3 p = at / 16.0;\n"
                                              "    int h = 0;\n");
        for (size_t i = first; i < first + A_WORLD && i < NUM_BUILT_INS; i++)
            length += (size_t)snprintf(text + length, sizeof text - length, "    h = hash(h, %s);\n", built_ins[i]);
        length += (size_t)snprintf(text + length, sizeof text - length, "    return float(h >> 8 & 0xffffff);\n}\n");
        assert_true(length < sizeof text - 1);
        snprintf(name, sizeof name, "functions from %zu", first);
        karst_program_graph *program = karst_language_compile(name, text, length, NULL, 0, &ok, &error);
        expect(program && ok, &error);
        check_program(program, name, true);
    }
}

/* ---- the mean that octaves fade to ---- */

static void test_means_of_noise(void **state)
{
    uint64_t random = 1;
    double sum[KARST_NUM_NOISE_BASES][2] = {{0}};
    int count = 1 << 20;
    (void)state;
    for (int i = 0; i < count; i++) {
        noise_position p;
        for (int axis = 0; axis < 3; axis++) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            p.axis[axis].cell = (uint)(random >> 40);
            p.axis[axis].fraction = (uint)(random >> 32) * 2654435761u;
        }
        for (int base = 0; base < KARST_NUM_NOISE_BASES; base++) {
            double n = (double)octave_noise(base, &p, (uint)i);
            sum[base][0] += n;
            sum[base][1] += fabs(n);
        }
    }
    for (int base = 0; base < KARST_NUM_NOISE_BASES; base++)
        for (int magnitude = 0; magnitude < 2; magnitude++) {
            double mean = sum[base][magnitude] / count;
            if (fabs(mean - (double)octave_mean(base, magnitude ? OCTAVE_TURBULENCE : OCTAVE_SUM)) > 0.001)
                fail_msg("base %d: the mean%s is %g", base, magnitude ? " magnitude" : "", mean);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_means_of_noise), cmocka_unit_test(test_random_graphs),
        cmocka_unit_test(test_shipped_worlds), cmocka_unit_test(test_pasted_worlds),
        cmocka_unit_test(test_noises),         cmocka_unit_test(test_surfaces),
        cmocka_unit_test(test_textures),       cmocka_unit_test(test_every_function),
    };
    return cmocka_run_group_tests(tests, open_devices, close_devices);
}
