/* The same bits from 16 lanes, from 1 lane and from host C: noise at any point, and the tensor form. (Worlds, their
 * bricks and bounds: tests/worlds.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "core/device/context.h"

#include "noise/fbm.clh"
#include "noise/simplex.clh"
#include "noise/tensor.clh"
#include "noise/slope.clh"
#include "noise/value.clh"
#include "noise/worley.clh"
#include "tests/noise/random.h"

#define NUM_POINTS (1 << 20)

/* What the kernels do, for LANES items from `first`, on arrays that both sides have: places as x, y, z of all items. */
static const char probes[] =
    "#include \"noise/fbm.clh\"\n"
    "#include \"noise/simplex.clh\"\n"
    "#include \"noise/table_rows.clh\"\n"
    "#include \"noise/tensor.clh\"\n"
    "#include \"noise/slope.clh\"\n"
    "#include \"noise/value.clh\"\n"
    "#include \"noise/worley.clh\"\n"
    "#include \"probes.clh\"\n"
    "#if LANES == 16\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void probe_tensor(K_GLOBAL const long *brick, K_GLOBAL const uint *word, uint count, K_GLOBAL float *out)\n"
    "{\n"
    "    uint i = (uint)get_global_id(0);\n"
    "    noise_axis axis[3];\n"
    "    noise_tensor tensor;\n"
    "    if (i >= count)\n"
    "        return;\n"
    "    brick += 6 * i;\n"
    "    word += 3 * i;\n"
    "    for (int a = 0; a < 3; a++)\n"
    "        axis[a] = noise_axis_at(brick[a], brick[3 + a], (int)word[0]);\n"
    "    noise_tensor_prepare(&tensor, axis, (int)word[1], word[2], 0.75f);\n"
    "    vfloat rows[NOISE_TENSOR_SAMPLES], face[NOISE_TENSOR_FACE];\n"
    "    for (int part = 0; part < NOISE_TENSOR_FACE; part++)\n"
    "        face[part] = (vfloat)(0.0f);\n"
    "    noise_tensor_face(&tensor, face);\n"
    "    out += i * 17 * 17 * 17;\n"
    "    for (int z = 0; z < 17; z++) {\n"
    "        noise_tensor_plane(&tensor, z);\n"
    "        for (int y = 0; y < 17; y++)\n"
    "            rows[y] = (vfloat)(0.0f);\n"
    "        noise_tensor_rows(&tensor, rows);\n"
    "        for (int y = 0; y < 17; y++, out += 17) {\n"
    "            v_store_float(z & 1 ? noise_tensor_row(&tensor, y, (vfloat)(0.0f)) : rows[y], out);\n"
    "            out[16] = ((const float *)face)[z * NOISE_TENSOR_SIDE + y];\n"
    "        }\n"
    "    }\n"
    "}\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void probe_table(K_GLOBAL const long *brick, K_GLOBAL const uint *word, uint count, K_GLOBAL float *out)\n"
    "{\n"
    "    uint i = (uint)get_global_id(0), num[3] = {0u, 0u, 0u};\n"
    "    if (i >= count)\n"
    "        return;\n"
    "    out += i * (17 * 17 * 16 + 3);\n"
    "#ifdef NOISE_HAS_TABLE\n"
    "    noise_table table;\n"
    "    table.is_made = 0;\n"
    "    for (int z = 0; z < 17; z++)\n"
    "        for (int y = 0; y < 17; y++, out += 16) {\n"
    "            noise_position p = bent_place(brick + 6 * i, (int)word[2 * i], i, V_LANE, y, z);\n"
    "            int was = table.is_made, x0 = table.cell[0], y0 = table.cell[1], z0 = table.cell[2];\n"
    "            v_store_float(i & 1 ? noise_table_level(&table, &p, word[2 * i + 1], 0.75f, (vfloat)(0.0f))\n"
    "                                : noise_table_octave(&table, &p, word[2 * i + 1], 0.75f, (vfloat)(0.0f)), out);\n"
    "            int same = was && x0 == table.cell[0] && y0 == table.cell[1] && z0 == table.cell[2];\n"
    "            num[!table.is_made ? 2 : same ? 0 : 1]++;\n"
    "        }\n"
    "#endif\n"
    "    for (int k = 0; k < 3; k++)\n"
    "        out[k] = (float)num[k];\n"
    "}\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void probe_rows(K_GLOBAL const long *brick, K_GLOBAL const uint *word, uint count, K_GLOBAL float *out)\n"
    "{\n"
    "    uint i = (uint)get_global_id(0);\n"
    "    if (i >= count)\n"
    "        return;\n"
    "    out += i * (17 * 17 * 16 + 3);\n"
    "    int num[3] = {0, 0, 0};\n"
    "#ifdef NOISE_HAS_TABLE\n"
    "    noise_axis axis[3];\n"
    "    for (int a = 0; a < 3; a++)\n"
    "        axis[a] = noise_axis_at(brick[6 * i + a], brick[6 * i + 3 + a], (int)word[2 * i]);\n"
    "    noise_table table;\n"
    "    noise_table_rows rows;\n"
    "    table.is_made = 0;\n"
    "    noise_table_rows_prepare(&rows, axis, word[2 * i + 1], 0.75f, row_scale(i));\n"
    "    for (int z = 0; z < 17; z++) {\n"
    "        noise_table_bend bend;\n"
    "        vfloat sum[17];\n"
    "        bend.far = (vint)(0);\n"
    "        for (int y = 0; y < 17; y++) {\n"
    "            noise_table_bend_row(&bend, y, row_bend(i, 0, V_LANE, y, z), row_bend(i, 2, V_LANE, y, z));\n"
    "            sum[y] = (vfloat)(0.0f);\n"
    "        }\n"
    "        num[noise_table_plane(&table, &rows, z, &bend, sum)]++;\n"
    "        for (int y = 0; y < 17; y++, out += 16)\n"
    "            v_store_float(sum[y], out);\n"
    "    }\n"
    "#endif\n"
    "    for (int k = 0; k < 3; k++)\n"
    "        out[k] = (float)num[k];\n"
    "}\n"
    "#endif\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void probe_noise(K_GLOBAL const long *voxel, K_GLOBAL const uint *fraction, uint count, K_GLOBAL float *out)\n"
    "{\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    if (first < count)\n"
    "        noise_probe(voxel, fraction, count, first, out);\n"
    "}\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void probe_families(K_GLOBAL const long *voxel, K_GLOBAL const uint *fraction, uint count, K_GLOBAL float *out)\n"
    "{\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    if (first < count)\n"
    "        families_probe(voxel, fraction, count, first, out);\n"
    "}\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void probe_moves(K_GLOBAL const long *unused, K_GLOBAL const uint *word, uint count, K_GLOBAL float *out)\n"
    "{\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    if (first < count)\n"
    "        moves_probe(unused, word, count, first, out);\n"
    "}\n";

/* Device and host compile the same text. */
#define PROBES(...)                                 \
    static const char probes_text[] = #__VA_ARGS__; \
    __VA_ARGS__

/* clang-format off */
#define LOAD_LONG(p) LOAD_LONG_(p)
#define LOAD_LONG_(p) (*(p))
#define LOAD_UINT(p) (*(p))
PROBES(
K_INLINE void noise_probe(K_GLOBAL const long *voxel, K_GLOBAL const uint *fraction, uint count, uint first,
                          K_GLOBAL float *out)
{
    noise_position p;
    for (uint a = 0; a < 3; a++)
        p.axis[a] = noise_coordinate_at(LOAD_LONG(voxel + a * count + first), LOAD_UINT(fraction + a * count + first),
                                        3L << (44 + a));
    vfloat warp = noise_octave(&p, 77u, 1.5f, (vfloat)(0.0f));
    p.axis[0] = noise_coordinate_move(p.axis[0], warp * (vfloat)(1e-3f));
    p.axis[2] = noise_coordinate_move(p.axis[2], warp * (vfloat)(-50.0f));
    noise_octaves octaves = noise_octaves_at(3L << 44, 9, 1.0f, 0.625f, (int)(first >> 4) % 12);
    v_store_float(noise_fbm(&p, 99u, &octaves, 9, (vfloat)(0.0f)), out + first);
}
K_INLINE void moves_probe(K_GLOBAL const long *unused, K_GLOBAL const uint *word, uint count, uint first,
                          K_GLOBAL float *out)
{
    (void)unused;
    const noise_coordinate from = {LOAD_UINT(word + first), LOAD_UINT(word + count + first)};
    const vfloat offset = v_as_float(LOAD_UINT(word + 2u * count + first));
    const noise_coordinate moved = noise_coordinate_move(from, offset);
    const noise_coordinate by = noise_coordinate_split(noise_coordinate_steps(offset));
    v_store_float(v_as_float(moved.cell), out + first);
    v_store_float(v_as_float(moved.fraction), out + count + first);
    v_store_float(v_as_float(by.cell), out + 2u * count + first);
    v_store_float(v_as_float(by.fraction), out + 3u * count + first);
}
K_INLINE noise_position bent_place(K_GLOBAL const long *brick, int level, uint number, vint x, int y, int z)
{
    noise_position p;
    for (int a = 0; a < 3; a++) {
        noise_axis axis = noise_axis_at(brick[a], brick[3 + a], level);
        vfloat bend = v_to_float(x + (vint)(a * y - z)) * (vfloat)((float)((a + 1) * (int)(number % 8u)) * 0x1.8p-8f);
        p.axis[a] = noise_coordinate_move(noise_axis_sample(&axis, a == 0 ? x : (vint)(a == 1 ? y : z)), bend);
    }
    return p;
}
K_INLINE float row_scale(uint number) { return number % 5u == 4u ? 0x1.8p17f : (float)(1 << (int)(number % 5u * 2u)); }
K_INLINE vfloat row_bend(uint number, int axis, vint x, int y, int z)
{
    const float sizes[8] = {0.0f, 1e-9f, 1e-3f, 0.01f, 0.1f, 3.0f, 0x1p15f, 1e30f};
    const uint size = number / 5u % 8u;
    vfloat bend = v_to_float(size < 6u ? x + (vint)((axis + 1) * y - z) : (vint)(1)) *
                  (vfloat)(sizes[size] * (1.0f - (float)axis));
    vint odd = v_eq(x + (vint)(17 * y), (vint)((int)(number % 289u))) & (vint)(number % 7u == 6u && z == 8 ? -1 : 0);
    return v_select(odd, bend + (vfloat)(number % 2u ? NAN : INFINITY), bend);
}
K_INLINE void families_probe(K_GLOBAL const long *voxel, K_GLOBAL const uint *fraction, uint count, uint first,
                             K_GLOBAL float *out)
{
    noise_position p;
    for (uint a = 0; a < 3; a++)
        p.axis[a] = noise_coordinate_at(LOAD_LONG(voxel + a * count + first), LOAD_UINT(fraction + a * count + first),
                                        3L << (44 + a));
    int along = (int)(first >> 4) % 3;
    vfloat result;
    switch ((first >> 4) % 12) {
    case 0:
        result = noise_value_part(&p, 5u, -1);
        break;
    case 1:
        result = noise_value_part(&p, 6u, along);
        break;
    case 2:
        result = noise_simplex(&p, 7u);
        break;
    case 3:
        result = noise_simplex_slope(&p, 8u, along);
        break;
    case 4:
        result = noise_worley_distance(&p, 9u, along & 1);
        break;
    case 5:
        result = noise_worley_slope(&p, 10u, along & 1, along);
        break;
    case 6:
        result = noise_slope(&p, 11u, along, 0);
        break;
    case 7:
        result = noise_octave_level(&p, 12u, 0.75f, (vfloat)(0.0f));
        break;
    case 8:
        result = noise_slope(&p, 13u, along, 1);
        break;
    case 9:
    case 10: {
        vfloat slope[3];
        result = noise_octave_slopes(&p, 14u, 0.75f, (int)(first >> 4) % 12 - 9, (vfloat)(0.0f), slope);
        result = along == 0 ? result : slope[along];
        break;
    }
    default: {
        vfloat distance[2];
        noise_worley_distances(&p, 9u, distance);
        result = distance[1] - distance[0];
    }
    }
    v_store_float(result, out + first);
})
/* clang-format on */

static void expect(bool good, const char *what, const karst_error *error)
{
    if (!good)
        fail_msg("%s: %s", what, error->message);
}

/* Runs a kernel of the probes over `count` items and returns what it wrote; free it. */
static float *device_results(int lanes, const char *kernel_name, const int64_t *voxel, size_t num_voxels,
                             const uint32_t *word, size_t num_words, uint32_t count, size_t num_results)
{
    karst_error error = {0};
    char text[sizeof probes_text + 256];
    snprintf(text, sizeof text,
             "#if LANES == 16\n#define LOAD_LONG(p) vload16(0, p)\n#define LOAD_UINT(p) vload16(0, p)\n#else\n"
             "#define LOAD_LONG(p) (*(p))\n#define LOAD_UINT(p) (*(p))\n#endif\n%s\n",
             probes_text);
    const karst_virtual_file files[] = {{"probe.cl", probes}, {"probes.clh", text}};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error);
    expect(context, "context", &error);
    karst_program *program = karst_program_build(context, "probe.cl", "", files, 2, &error);
    expect(program, "program", &error);
    cl_kernel kernel = karst_program_kernel(program, kernel_name, &error);
    expect(kernel, kernel_name, &error);
    karst_buffer *voxels = karst_buffer_create(context, "test", num_voxels * sizeof *voxel, voxel, &error);
    karst_buffer *words = karst_buffer_create(context, "test", num_words * sizeof *word, word, &error);
    float *results = calloc(num_results, sizeof *results); /* 0: what a probe leaves out on a device without its path */
    assert_non_null(results);
    karst_buffer *out = karst_buffer_create(context, "test", num_results * sizeof *results, results, &error);
    expect(voxels && words && out, "buffers", &error);
    expect(KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(voxels), KARST_BUFFER_ARG(words), KARST_VALUE_ARG(count),
                           KARST_BUFFER_ARG(out)) &&
               karst_launch(context, kernel, KARST_STAGE_EVALUATE, count, 1, &error) &&
               karst_buffer_read(out, 0, results, num_results * sizeof *results, &error),
           kernel_name, &error);
    karst_buffer_destroy(out);
    karst_buffer_destroy(words);
    karst_buffer_destroy(voxels);
    clReleaseKernel(kernel);
    karst_program_destroy(program);
    karst_context_destroy(context);
    return results;
}

static void assert_same_bits(const float *got, const float *wanted, size_t num, const char *what)
{
    size_t num_wrong = 0, first = 0;
    for (size_t i = num; i-- > 0;)
        if (k_as_uint(got[i]) != k_as_uint(wanted[i])) {
            num_wrong++;
            first = i;
        }
    if (num_wrong)
        fail_msg("%s: %zu of %zu differ; %zu is %a, on the host %a", what, num_wrong, num, first, (double)got[first],
                 (double)wanted[first]);
}

/* Near 0, 10^9 and 10^15 voxels. */
static int64_t *random_voxels(size_t count, uint32_t *fractions)
{
    static const int64_t offsets[] = {0, 1000000000, 1000000000000000};
    int64_t *voxels = malloc(3 * count * sizeof *voxels);
    assert_non_null(voxels);
    for (size_t i = 0; i < count; i++) {
        int64_t offset = offsets[random_below(3)];
        for (size_t a = 0; a < 3; a++) {
            voxels[a * count + i] = random_between(-100000, 100000) + (random_bits() & 1 ? offset : -offset);
            if (a == 1 && random_below(4)) /* where the land is */
                voxels[a * count + i] = random_between(-8000, 8000);
            fractions[a * count + i] = random_bits() & 1 ? (uint32_t)random_bits() : 0;
        }
    }
    return voxels;
}

static void test_points(void **state)
{
    (void)state;
    typedef void (*probe)(const long *, const uint *, uint, uint, float *);
    static const struct {
        const char *kernel;
        probe host;
    } cases[] = {{"probe_noise", noise_probe}, {"probe_families", families_probe}};
    uint32_t *fractions = malloc(3 * NUM_POINTS * sizeof *fractions);
    float *wanted = malloc(NUM_POINTS * sizeof *wanted);
    assert_true(fractions && wanted);
    int64_t *voxels = random_voxels(NUM_POINTS, fractions);
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        for (uint i = 0; i < NUM_POINTS; i++)
            cases[c].host(voxels, fractions, NUM_POINTS, i, wanted);
        for (int lanes = 1; lanes <= 16; lanes += 15) {
            float *got = device_results(lanes, cases[c].kernel, voxels, 3 * NUM_POINTS, fractions, 3 * NUM_POINTS,
                                        NUM_POINTS, NUM_POINTS);
            char what[64];
            snprintf(what, sizeof what, "%s, %d lanes", cases[c].kernel, lanes);
            assert_same_bits(got, wanted, NUM_POINTS, what);
            free(got);
        }
    }
    free(voxels);
    free(wanted);
    free(fractions);
}

/* A brick by tensor, its face too, against single points, for all octaves and frequencies that a tensor may see. */
/* Offsets of all kinds: halves of cells, from which the nearest whole one is two; what clamps; what is no number. */
static void test_moves(void **state)
{
    (void)state;
    static const float hard[] = {
        0.0f,       -0.0f,       0.5f,      -0.5f,    1.5f,    -2.5f,    0x1.fffffep-2f, -0x1.fffffep-2f, 0x1p-32f,
        -0x1p-32f,  0x1p-33f,    -0x1p-33f, 0x1p-34f, 1e-40f,  -1e-40f,  1.0f,           0x1p23f,         -0x1p23f,
        8388607.5f, -8388607.5f, 0x1p29f,   -0x1p29f, 0x1p30f, -0x1p30f, 0x1.8p30f,      -0x1p31f,        0x1p62f,
        -0x1p100f,  INFINITY,    -INFINITY, NAN,      -NAN};
    enum { NUM_HARD = sizeof hard / sizeof *hard, COUNT = 1 << 16 };
    uint32_t *words = malloc(3 * COUNT * sizeof *words);
    float *wanted = malloc(4 * COUNT * sizeof *wanted);
    assert_true(words && wanted);
    for (size_t i = 0; i < COUNT; i++) {
        words[i] = (uint32_t)random_bits();
        words[COUNT + i] = random_below(4) ? (uint32_t)random_bits() : random_bits() & 1 ? 0 : UINT32_MAX;
        words[2 * COUNT + i] = i / 4 < NUM_HARD  ? k_as_uint(hard[i / 4])
                               : random_below(2) ? (uint32_t)random_bits() /* any float */
                                                 : k_as_uint((float)random_between(-4000, 4000) * 0x1p-8f);
    }
    const int64_t unused = 0;
    for (uint i = 0; i < COUNT; i++)
        moves_probe((const long *)&unused, words, COUNT, i, wanted);
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        float *got = device_results(lanes, "probe_moves", &unused, 1, words, 3 * COUNT, COUNT, 4 * COUNT);
        assert_same_bits(got, wanted, 4 * COUNT, lanes == 1 ? "moves, 1 lane" : "moves, 16 lanes");
        free(got);
    }
    free(wanted);
    free(words);
}

static void test_tensor(void **state)
{
    (void)state;
    enum { BRICKS = 600, SAMPLES = 17 * 17 * 17 };
    int64_t *bricks = malloc(6 * BRICKS * sizeof *bricks);
    uint32_t *words = malloc(3 * BRICKS * sizeof *words);
    float *wanted = malloc(BRICKS * SAMPLES * sizeof *wanted), *out = wanted;
    assert_true(bricks && words && wanted);
    uint32_t *unused = malloc(3 * 2 * BRICKS * sizeof *unused);
    assert_non_null(unused);
    int64_t *places = random_voxels(2 * BRICKS, unused);
    free(unused);
    for (int i = 0; i < BRICKS; i++) {
        int level = (int)random_below(12), octave = (int)random_below(9);
        noise_axis axis[3];
        words[3 * i] = (uint32_t)level;
        words[3 * i + 1] = (uint32_t)octave;
        words[3 * i + 2] = (uint32_t)random_bits();
        for (int a = 0; a < 3; a++) {
            /* up to half a cell from sample to sample, and often just that */
            int64_t most = INT64_C(1) << (55 - level - octave);
            int64_t frequency = random_below(4) ? (int64_t)((double)most * random_magnitude(1e-5, 1)) : most;
            bricks[6 * i + a] = places[3 * i + a];
            bricks[6 * i + 3 + a] = random_below(3) ? frequency : -frequency;
            axis[a] = noise_axis_at(bricks[6 * i + a], bricks[6 * i + 3 + a], level);
        }
        for (int z = 0; z < 17; z++)
            for (int y = 0; y < 17; y++)
                for (int x = 0; x < 17; x++) {
                    const int at[3] = {x, y, z};
                    noise_position p;
                    for (int a = 0; a < 3; a++)
                        p.axis[a] = noise_coordinate_octave(noise_axis_sample(&axis[a], at[a]), octave);
                    *out++ = noise_octave(&p, words[3 * i + 2], 0.75f, 0.0f);
                }
    }
    float *got = device_results(16, "probe_tensor", bricks, 6 * BRICKS, words, 3 * BRICKS, BRICKS, BRICKS * SAMPLES);
    assert_same_bits(got, wanted, BRICKS * SAMPLES, "tensor");
    free(got);
    free(places);
    free(bricks);
    free(words);
    free(wanted);
}

/* Rows whose lattice is bent, with gradients from a table, against single points: straight or bent, far or near. */
static void test_table(void **state)
{
    (void)state;
    enum { BRICKS = 400, SAMPLES = 17 * 17 * 16 };
    int64_t *bricks = malloc(6 * BRICKS * sizeof *bricks);
    uint32_t *words = malloc(2 * BRICKS * sizeof *words), *unused = malloc(3 * 2 * BRICKS * sizeof *unused);
    float *wanted = malloc(SAMPLES * sizeof *wanted);
    assert_true(bricks && words && wanted && unused);
    int64_t *places = random_voxels(2 * BRICKS, unused);
    for (int i = 0; i < BRICKS; i++) {
        int level = (int)random_below(12);
        words[2 * i] = (uint32_t)level;
        words[2 * i + 1] = (uint32_t)random_bits();
        for (int a = 0; a < 3; a++) {
            int64_t frequency = (int64_t)((double)(INT64_C(1) << (55 - level)) * random_magnitude(1e-3, 1));
            bricks[6 * i + a] = places[3 * i + a];
            bricks[6 * i + 3 + a] = random_below(3) ? frequency : -frequency;
        }
    }
    float *got =
        device_results(16, "probe_table", bricks, 6 * BRICKS, words, 2 * BRICKS, BRICKS, BRICKS * (SAMPLES + 3));
    uint32_t kept = 0, made = 0, spread = 0;
    for (int i = 0; i < BRICKS; i++) {
        const float *samples = got + (size_t)i * (SAMPLES + 3);
        float *out = wanted;
        kept += (uint32_t)samples[SAMPLES];
        made += (uint32_t)samples[SAMPLES + 1];
        spread += (uint32_t)samples[SAMPLES + 2];
        if (samples[SAMPLES] + samples[SAMPLES + 1] + samples[SAMPLES + 2] == 0) /* no table on this device */
            continue;
        for (int z = 0; z < 17; z++)
            for (int y = 0; y < 17; y++)
                for (int x = 0; x < 16; x++) {
                    noise_position p = bent_place(bricks + 6 * i, (int)words[2 * i], (uint32_t)i, x, y, z);
                    *out++ = (i & 1 ? noise_octave_level : noise_octave)(&p, words[2 * i + 1], 0.75f, 0.0f);
                }
        assert_same_bits(samples, wanted, SAMPLES, "table");
    }
    if (kept + made + spread) {
        assert_int_equal(kept + made + spread, BRICKS * 17 * 17);
        assert_in_range(kept, BRICKS * 17 * 3, BRICKS * 17 * 17);
        assert_in_range(made, BRICKS, BRICKS * 17 * 17);
        assert_in_range(spread, BRICKS, BRICKS * 17 * 17);
    }
    free(got);
    free(places);
    free(unused);
    free(bricks);
    free(words);
    free(wanted);
}

/* Rows that are bent along x and z, plane by plane, against single points: by nothing, by cells, by more than a table
 * holds, by more than is counted in cells, by infinity and by what is no number. */
static void test_rows(void **state)
{
    (void)state;
    enum { BRICKS = 560, SAMPLES = 17 * 17 * 16 };
    int64_t *bricks = malloc(6 * BRICKS * sizeof *bricks);
    uint32_t *words = malloc(2 * BRICKS * sizeof *words), *unused = malloc(3 * BRICKS * sizeof *unused);
    float *wanted = malloc(SAMPLES * sizeof *wanted);
    assert_true(bricks && words && wanted && unused);
    int64_t *places = random_voxels(BRICKS, unused);
    for (int i = 0; i < BRICKS; i++) {
        int level = (int)random_below(12);
        words[2 * i] = (uint32_t)level;
        words[2 * i + 1] = (uint32_t)random_bits();
        for (int a = 0; a < 3; a++) {
            int64_t frequency = (int64_t)((double)(INT64_C(1) << (55 - level)) * random_magnitude(1e-3, 1));
            bricks[6 * i + a] = places[3 * i + a];
            bricks[6 * i + 3 + a] = random_below(3) ? frequency : -frequency;
        }
    }
    float *got =
        device_results(16, "probe_rows", bricks, 6 * BRICKS, words, 2 * BRICKS, BRICKS, BRICKS * (SAMPLES + 3));
    float num[3] = {0, 0, 0}; /* planes in one cell, from a table, row by row */
    for (uint32_t i = 0; i < BRICKS; i++) {
        const float *samples = got + (size_t)i * (SAMPLES + 3);
        float *out = wanted;
        noise_axis axis[3];
        if (samples[SAMPLES] + samples[SAMPLES + 1] + samples[SAMPLES + 2] == 0) /* no table on this device */
            continue;
        for (int k = 0; k < 3; k++)
            num[k] += samples[SAMPLES + k];
        for (int a = 0; a < 3; a++)
            axis[a] = noise_axis_at(bricks[6 * i + a], bricks[6 * i + 3 + a], (int)words[2 * i]);
        for (int z = 0; z < 17; z++)
            for (int y = 0; y < 17; y++)
                for (int x = 0; x < 16; x++) {
                    noise_position p;
                    p.axis[0] =
                        noise_coordinate_move(noise_axis_sample(&axis[0], x), row_bend(i, 0, x, y, z) * row_scale(i));
                    p.axis[1] = noise_axis_sample(&axis[1], y);
                    p.axis[2] =
                        noise_coordinate_move(noise_axis_sample(&axis[2], z), row_bend(i, 2, x, y, z) * row_scale(i));
                    *out++ = noise_octave_level(&p, words[2 * i + 1], 0.75f, 0.0f);
                }
        assert_same_bits(samples, wanted, SAMPLES, "rows");
    }
    print_message("planes of rows: %.0f in one cell, %.0f from a table, %.0f row by row\n", num[0], num[1], num[2]);
    if (num[0] + num[1] + num[2] > 0)
        assert_true(num[0] > 500 && num[1] > 500 && num[2] > 500);
    free(got);
    free(places);
    free(unused);
    free(bricks);
    free(words);
    free(wanted);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_points), cmocka_unit_test(test_moves),
                                       cmocka_unit_test(test_tensor), cmocka_unit_test(test_table),
                                       cmocka_unit_test(test_rows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
