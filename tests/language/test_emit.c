/* Generated code: graphs at random, and some by hand, as point and as brick code, with 1 and with 16 lanes, give the
 * same bits wherever they lie. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cache/layout_shared.h"
#include "core/context.h"
#include "producers/language/emit.h"
#include "tests/language/wild_graph.h"

#define NUM_SAMPLES KARST_BRICK_SAMPLES
#define VOXEL_LOG2_M (-4)

static const char probe[] =
    "#include \"core/lanes.clh\"\n"
    "#include \"cache/layout_shared.h\"\n"
    "#include \"producers/density.clh\"\n"
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

static void device_build(device *d, const char *source, size_t data_bytes)
{
    karst_error error = {0};
    const karst_virtual_file files[] = {{"probe.cl", probe}, {"world.clh", source}};
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

static void check_world(const karst_resolved_world *world, uint32_t number)
{
    static float samples[4][NUM_SAMPLES];
    karst_error error = {0};
    karst_world_layout layout;
    karst_emitted emitted;
    const char *fault;
    if (!karst_graph_check(world->graph, &fault))
        fail_msg("graph %u: %s", number, fault);
    karst_world_layout_init(&layout, world);
    expect(karst_emit_world(&layout, &emitted, &error), &error);
    size_t data_bytes = layout.num_words * sizeof(uint64_t);
    uint64_t *words = malloc(data_bytes);
    for (int i = 0; i < 2; i++)
        device_build(&devices[i], emitted.source, data_bytes);
    for (int change = 0; change < 2; change++) {
        karst_number values[WILD_PARAMETERS];
        for (int i = 0; i < WILD_PARAMETERS; i++)
            values[i] = karst_number_double(parameters[change][i]);
        assert_true(karst_world_data_fill(&layout, values, 7, VOXEL_LOG2_M, words));
        for (size_t p = 0; p < NUM_PLACES; p++) {
            const int64_t *origin = places[p].origin;
            int level = places[p].level;
            for (int i = 0; i < 2; i++) {
                expect(karst_buffer_write(devices[i].data, 0, words, data_bytes, &error), &error);
                run_points(&devices[i], origin, level, samples[i]);
                run_brick(&devices[i], origin, level, samples[2 + i]);
            }
            compare(samples[0], samples[1], "points with 1 and 16 lanes", origin, level, number);
            compare(samples[0], samples[2], "points and bricks, 1 lane", origin, level, number);
            compare(samples[0], samples[3], "points and bricks, 16 lanes", origin, level, number);
        }
    }
    for (int i = 0; i < 2; i++)
        device_drop(&devices[i]);
    free(words);
    karst_emitted_finish(&emitted);
}

/* EMIT_GRAPHS of them, from number EMIT_FIRST. */
static void test_random_graphs(void **state)
{
    uint32_t first = setting("EMIT_FIRST", 0), count = setting("EMIT_GRAPHS", 6);
    (void)state;
    for (uint32_t i = first; i < first + count; i++) {
        karst_arena arena;
        karst_graph graph;
        wild_source random = {0x9e3779b97f4a7c15u * (i + 1)};
        karst_arena_init(&arena, (size_t)64 << 20, NULL, NULL);
        karst_graph_init(&graph, &arena, 1u << 16, full, NULL);
        karst_resolved_world world = {.graph = &graph};
        world.density = wild_graph(&graph, &random, 20 + wild_below(&random, 150));
        check_world(&world, i);
        karst_arena_finish(&arena);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_random_graphs),
    };
    return cmocka_run_group_tests(tests, open_devices, close_devices);
}
