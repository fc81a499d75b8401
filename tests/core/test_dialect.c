/* The dialect and the lanes: one piece of code, compiled here as C and by the device with 1 and with 16 lanes, gives
 * the same bits. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/device/context.h"
#include "core/device/lanes.clh"

/* The same text for this compiler and, as a string, for the device's. */
#define BOTH(name, ...) \
    __VA_ARGS__         \
    static const char name[] = #__VA_ARGS__;

#define N 256     /* cases: every pair of 16 values */
#define FLOATS 12 /* the first rows of the result hold floats */
#define ROWS 46   /* of 32-bit values, in all */

#define V_PUT(row, v) v_store_int((v), out + (row)*N + i)
#define V_PUT_FLOAT(row, v) V_PUT(row, v_as_int(v))
static const char macros[] = "#include \"core/device/lanes.clh\"\n"
                             "#define N 256\n"
                             "#define V_PUT(row, v) v_store_int((v), out + (row) * N + i)\n"
                             "#define V_PUT_FLOAT(row, v) V_PUT(row, v_as_int(v))\n";

/* clang-format off */
BOTH(lane_code,
K_INLINE void put_long(K_GLOBAL int *out, int i, int row, vulong v)
{
    V_PUT(row, v_uint_to_int(v_ulong_to_uint(v)));
    V_PUT(row + 1, v_uint_to_int(v_ulong_to_uint(v >> 32)));
}
K_INLINE void probe(K_GLOBAL const float *as, K_GLOBAL const float *bs, K_GLOBAL const int *table,
                    K_GLOBAL int *out, int i)
{
    vfloat a = v_load_float(as + i);
    vfloat b = v_load_float(bs + i);
    vint m = v_lt(a, b);
    vint at = v_load_int(table + i);
    V_PUT_FLOAT(0, a * b + (vfloat)(0.1f));
    V_PUT_FLOAT(1, k_fma(a, b, (vfloat)(0.1f)));
    V_PUT_FLOAT(2, a / b);
    V_PUT_FLOAT(3, k_sqrt(k_fabs(a)));
    V_PUT_FLOAT(4, k_floor(a));
    V_PUT_FLOAT(5, k_rint(a));
    V_PUT_FLOAT(6, k_min(a, b));
    V_PUT_FLOAT(7, k_max(a, b));
    V_PUT_FLOAT(8, v_min(a, b));
    V_PUT_FLOAT(9, v_max(a, b));
    V_PUT_FLOAT(10, v_select(m, a, b));
    V_PUT_FLOAT(11, v_gather_float(as, at));
    V_PUT(12, m);
    V_PUT(13, v_le(a, b));
    V_PUT(14, v_gt(a, b));
    V_PUT(15, v_ge(a, b));
    V_PUT(16, v_eq(a, b));
    V_PUT(17, v_ne(a, b));
    vfloat bounded = v_select(v_lt(k_fabs(a), (vfloat)(2.0e9f)), a, (vfloat)(0.0f));
    V_PUT(18, v_to_int(bounded));
    V_PUT_FLOAT(19, v_to_float(at * 8388617));
    V_PUT(20, v_gather_int(table, at));
    V_PUT(21, v_uint_to_int(v_as_uint(a) >> 3));
    V_PUT(22, v_as_int(a) >> 3);
    V_PUT_FLOAT(23, v_as_float(v_as_int(a) ^ (vint)(1)));
    V_PUT(24, v_uint_to_int(v_int_to_uint((vint)(-5) - at) / 7u));
    V_PUT(25, (m & at) | (~m & (vint)(3)));
    V_PUT(26, V_LANE + (vint)(i));
    V_PUT(27, v_eq(at, V_LANE));
    vlong wide = v_int_to_long(v_as_int(a)) * 1000003 - v_int_to_long(at);
    put_long(out, i, 28, v_long_to_ulong(wide));
    put_long(out, i, 30, v_uint_to_ulong(v_as_uint(a)) * v_uint_to_ulong(v_as_uint(b)));
    put_long(out, i, 32, v_long_to_ulong(v_select_long(m, wide, wide >> 7)));
    put_long(out, i, 34, v_long_to_ulong(v_ulong_to_long(v_long_to_ulong(wide)) >> 40));
    vint any_left = (vint)(v_any(v_ne(at, at)) - v_all(v_eq(at, at)));
    V_PUT(36, any_left);
    put_long(out, i, 44, v_long_to_ulong(v_whole_to_long(k_floor(bounded) * (vfloat)(0x1p19f))));
}
)

BOTH(scalar_code,
K_INLINE void probe_scalar(K_GLOBAL const float *as, K_GLOBAL const float *bs, K_GLOBAL int *out, int i)
{
    uint x = k_as_uint(as[i]);
    uint y = k_as_uint(bs[i]);
    ulong high = k_mul_hi_ulong((ulong)x << 32 | y, (ulong)y * 0x9e3779b97f4a7c15ul);
    out[37 * N + i] = (int)(uint)high;
    out[38 * N + i] = (int)(uint)(high >> 32);
    out[39 * N + i] = k_clz(x) * 64 + k_popcount(x);
    out[40 * N + i] = k_clz(x >> (y & 31u));
    out[41 * N + i] = (int)k_as_uint(k_as_float(x ^ 0x80000000u));
    out[42 * N + i] = (int)x >> (int)(y & 31u);
    out[43 * N + i] = (int)(uchar)x + (int)(ushort)y;
}
)
/* clang-format on */

static const char kernels[] = "__kernel void run(__global const float *as, __global const float *bs, __global const "
                              "int *table, __global int *out)\n"
                              "{\n"
                              "    int first = (int)get_global_id(0) * LANES;\n"
                              "    if (first >= N)\n"
                              "        return;\n"
                              "    probe(as, bs, table, out, first);\n"
                              "    for (int i = first; i < first + LANES; i++)\n"
                              "        probe_scalar(as, bs, out, i);\n"
                              "}\n";

static const char across[] =
    "#include \"core/device/lanes.clh\"\n"
    "__kernel void run(__global const float *values, __global const int *masks, __global float *extremes,\n"
    "                  __global int *tests)\n"
    "{\n"
    "    int n = (int)get_global_id(0);\n"
    "    vfloat v = v_load_float(values + n * LANES);\n"
    "    vint m = v_load_int(masks + n * LANES);\n"
    "    extremes[2 * n] = v_min_across(v);\n"
    "    extremes[2 * n + 1] = v_max_across(v);\n"
    "    tests[n] = v_any(m) * 2 + v_all(m);\n"
    "}\n";

/* Rows that hold floats: there NaN is NaN, whatever its sign and payload. */
static bool is_float_row(int row) { return row < FLOATS || row == 19 || row == 23; }

static bool is_nan(int bits) { return ((uint)bits & 0x7fffffffu) > 0x7f800000u; }

typedef struct {
    karst_context *context;
    float as[N], bs[N];
    int table[N];
} fixture;

static int set_up(void **state)
{
    static fixture f;
    static const uint bits[16] = {
        0x00000000, 0x80000000, 0x3f800000, 0xbfc00000, 0x40200000, /* 0, -0, 1, -1.5, 2.5 */
        0x00000001, 0x807fffff, 0x00800000,                         /* denormals and the smallest normal */
        0x7f800000, 0xff800000, 0x7fc00000,                         /* infinities, NaN */
        0x4b7fffff, 0xcb000001, 0x7f7fffff, 0x3eaaaaab, 0x4e6e6b28  /* 2^24 - 1, -2^23 - 1, the largest, 1/3, 1e9 */
    };
    for (int i = 0; i < N; i++) {
        f.as[i] = k_as_float(bits[i / 16]);
        f.bs[i] = k_as_float(bits[i % 16]);
        f.table[i] = (int)((uint)i * 167u % N);
    }
    karst_error error = {0};
    f.context = karst_context_create(NULL, 0, NULL, &error);
    *state = &f;
    if (!f.context)
        fprintf(stderr, "%s\n", error.message);
    return f.context ? 0 : -1;
}

static int tear_down(void **state)
{
    karst_context_destroy(((fixture *)*state)->context);
    return 0;
}

/* Builds `text`, runs its kernel `run` on four buffers, and reads back the third and the fourth. */
static void run_on_device(karst_context *context, const char *text, const void *const data[4],
                          const size_t size_bytes[4], size_t num_items, void *third, void *fourth)
{
    const karst_virtual_file file = {"test.cl", text};
    karst_error error = {0};
    karst_buffer *buffers[4];
    karst_program *program = karst_program_build(context, "test.cl", NULL, &file, 1, &error);
    cl_kernel kernel = program ? karst_program_kernel(program, "run", &error) : NULL;
    if (!kernel)
        fail_msg("%s", error.message);
    for (int i = 0; i < 4; i++) {
        buffers[i] = karst_buffer_create(context, "test", size_bytes[i], data[i], &error);
        assert_non_null(buffers[i]);
    }
    assert_true(KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(buffers[0]), KARST_BUFFER_ARG(buffers[1]),
                                KARST_BUFFER_ARG(buffers[2]), KARST_BUFFER_ARG(buffers[3])));
    assert_true(karst_launch(context, kernel, KARST_STAGE_CAST, num_items, 1, &error));
    if (third)
        assert_true(karst_buffer_read(buffers[2], 0, third, size_bytes[2], &error));
    assert_true(karst_buffer_read(buffers[3], 0, fourth, size_bytes[3], &error));
    for (int i = 0; i < 4; i++)
        karst_buffer_destroy(buffers[i]);
    clReleaseKernel(kernel);
    karst_program_destroy(program);
}

static void test_host_and_device_agree_in_every_bit(void **state)
{
    fixture *f = *state;
    static char text[20000];
    static int host[ROWS * N], device[ROWS * N];
    if (!f->context->exact_floats && !strstr(f->context->name, "Oclgrind")) /* which is exact without saying so */
        skip();                                                             /* the device does not promise it */
    snprintf(text, sizeof(text), "%s%s\n%s\n%s", macros, lane_code, scalar_code, kernels);
    memset(host, 0x5a, sizeof(host));
    for (int i = 0; i < N; i++) {
        probe(f->as, f->bs, f->table, host, i);
        probe_scalar(f->as, f->bs, host, i);
    }
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        memset(device, 0xa5, sizeof(device));
        f->context->lanes = lanes;
        const void *const data[4] = {f->as, f->bs, f->table, device};
        const size_t size_bytes[4] = {sizeof(f->as), sizeof(f->bs), sizeof(f->table), sizeof(device)};
        run_on_device(f->context, text, data, size_bytes, (size_t)(N / lanes), NULL, device);
        for (int row = 0; row < ROWS; row++) {
            for (int i = 0; i < N; i++) {
                int expected = host[row * N + i], got = device[row * N + i];
                if (lanes == 16 && row == 27) /* V_LANE is 0 in the host's only lane */
                    expected = f->table[i] == i % 16 ? -1 : 0;
                if (is_float_row(row) && is_nan(expected) && is_nan(got))
                    continue;
                if (got != expected)
                    fail_msg("%d lanes, row %d, a = %a, b = %a: the device gives %08x, the host %08x", lanes, row,
                             (double)f->as[i], (double)f->bs[i], (uint)got, (uint)expected);
            }
        }
    }
}

static void test_ties_and_nan_in_min_and_max(void **state)
{
    (void)state;
    float nan = k_as_float(0x7fc00000);
    assert_int_equal(k_as_uint(k_min(0.0f, -0.0f)), 0);
    assert_int_equal(k_as_uint(k_max(-0.0f, 0.0f)), 0x80000000u);
    assert_true(k_min(1.0f, nan) == 1.0f);
    assert_true(is_nan((int)k_as_uint(k_min(nan, 1.0f))));
    assert_int_equal(k_min(3, 2) + k_max(3, 2) * 10, 32);
    assert_int_equal(k_clz(0), 32);
    assert_int_equal(k_mul_hi_ulong(~0ul, ~0ul), ~0ul - 1);
}

static void test_across_lanes(void **state)
{
    fixture *f = *state;
    enum { VECTORS = 40 };
    float values[VECTORS * 16], extremes[VECTORS * 2];
    int masks[VECTORS * 16], tests[VECTORS];
    uint x = 12345;
    for (int i = 0; i < VECTORS * 16; i++) {
        x = x * 1664525u + 1013904223u;
        values[i] = (float)(int)x;
        /* One lane of each on, one of each off, then all, none and chance. */
        int vector = i / 16, lane = i % 16;
        masks[i] = vector < 16    ? -(lane == vector)
                   : vector < 32  ? -(lane != vector - 16)
                   : vector == 32 ? -1
                   : vector == 33 ? 0
                                  : -(int)(x >> 31);
    }
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        const void *const data[4] = {values, masks, NULL, NULL};
        const size_t size_bytes[4] = {sizeof(values), sizeof(masks), sizeof(extremes), sizeof(tests)};
        f->context->lanes = lanes;
        run_on_device(f->context, across, data, size_bytes, VECTORS, extremes, tests);
        for (int n = 0; n < VECTORS; n++) {
            float low = values[n * lanes], high = low;
            int any = 0, all = 1;
            for (int i = n * lanes; i < (n + 1) * lanes; i++) {
                low = values[i] < low ? values[i] : low;
                high = values[i] > high ? values[i] : high;
                any |= masks[i] != 0;
                all &= masks[i] != 0;
            }
            assert_true(extremes[2 * n] == low);
            assert_true(extremes[2 * n + 1] == high);
            assert_int_equal(tests[n], any * 2 + all);
        }
    }
}

/* Moving lanes: what instructions there are of (core/device/lanes_avx2.clh, core/device/lanes_avx512.clh), and what
 * stands for them. Work-item i: the lanes whose bits i has set. */
static const char moves[] = "#include \"raycast/cast/packing.clh\"\n"
                            "__kernel void run(__global const float *a, __global const float *b,\n"
                            "                  __global int *packed, __global int *looked_up)\n"
                            "{\n"
                            "    const uint i = (uint)get_global_id(0);\n"
                            "    int to[2 * LANES] = {0};\n"
                            "    pack_int(to + 1, V_LANE + 100, i);\n"
                            "    to[0] = (int)mask_bits(bits_mask(i));\n"
                            "    for (int k = 0; k < LANES; k++)\n"
                            "        packed[i * LANES + k] = to[k];\n"
                            "    const vuint index = v_int_to_uint(V_LANE * 7) + (vuint)(i);\n"
                            "    vfloat one = (vfloat)(-1.0f), two = one;\n"
                            "#ifdef V_HAS_LOOK_UP\n"
                            "    one = v_look_up(v_load_float(a), index);\n"
                            "    two = v_look_up_in_two(v_load_float(a), v_load_float(b), index);\n"
                            "#endif\n"
                            "    v_store_int(v_to_int(one) * 100 + v_to_int(two), looked_up + i * LANES);\n"
                            "}\n";

static void test_moving_lanes(void **state)
{
    fixture *f = *state;
    enum { LANES_HERE = 16, MASKS = 1 << LANES_HERE };
    float a[LANES_HERE], b[LANES_HERE];
    for (int i = 0; i < LANES_HERE; i++) {
        a[i] = (float)i;
        b[i] = (float)(i + LANES_HERE);
    }
    int *packed = calloc((size_t)MASKS * LANES_HERE, sizeof *packed),
        *looked_up = calloc((size_t)MASKS * LANES_HERE, sizeof *looked_up);
    assert_true(packed && looked_up);
    const void *const data[4] = {a, b, NULL, NULL};
    const size_t bytes = (size_t)MASKS * LANES_HERE * sizeof *packed,
                 size_bytes[4] = {sizeof a, sizeof b, bytes, bytes};
    f->context->lanes = LANES_HERE;
    run_on_device(f->context, moves, data, size_bytes, MASKS, packed, looked_up);
    const int has_look_up = looked_up[0] >= 0,
              is_plain = getenv("KARST_VECTORS") && !strcmp(getenv("KARST_VECTORS"), "plain");
    assert_false(has_look_up && is_plain);
    for (int mask = 0; mask < MASKS; mask++) {
        const int *at = packed + mask * LANES_HERE;
        assert_int_equal(at[0], mask);
        for (int lane = 0, n = 1; lane < LANES_HERE && n < LANES_HERE; lane++)
            if (mask >> lane & 1)
                assert_int_equal(at[n++], 100 + lane);
        for (int lane = 0; lane < LANES_HERE && has_look_up; lane++) {
            const int index = lane * 7 + mask;
            assert_int_equal(looked_up[mask * LANES_HERE + lane], index % 16 * 100 + index % 32);
        }
    }
    free(packed);
    free(looked_up);
}

/* As on a CPU without AVX-512, and without AVX2. */
static int set_up_avx2(void **state) { return setenv("KARST_VECTORS", "avx2", 1) || set_up(state); }
static int set_up_plain(void **state) { return setenv("KARST_VECTORS", "plain", 1) || set_up(state); }

static int tear_down_vectors(void **state)
{
    unsetenv("KARST_VECTORS");
    return tear_down(state);
}

/* `refused`: the condition that must not hold after core/device/lanes.clh. */
static void check_left_out(fixture *f, const char *refused)
{
    char text[512];
    snprintf(text, sizeof(text),
             "#include \"core/device/lanes.clh\"\n#if %s\n#error not left out\n#endif\n"
             "__kernel void run(__global int *out) { out[0] = 1; }\n",
             refused);
    const karst_virtual_file file = {"test.cl", text};
    karst_error error = {0};
    karst_program *program = karst_program_build(f->context, "test.cl", NULL, &file, 1, &error);
    if (!program)
        fail_msg("%s", error.message);
    karst_program_destroy(program);
}

static void test_avx2_leaves_avx512_out(void **state)
{
    check_left_out(*state, "defined(V_ANY_BY_MASK) || defined(__AVX512F__) || defined(__AVX512VL__)");
}

static void test_plain_vectors_leave_all_out(void **state)
{
    check_left_out(*state, "defined(V_ANY_BY_MASK) || defined(V_HAS_BITS) || defined(V_HAS_LOOK_UP) || "
                           "defined(__AVX512F__) || defined(__AVX512VL__) || defined(__AVX2__)");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_host_and_device_agree_in_every_bit, set_up, tear_down),
        cmocka_unit_test(test_ties_and_nan_in_min_and_max),
        cmocka_unit_test_setup_teardown(test_across_lanes, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_moving_lanes, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_avx2_leaves_avx512_out, set_up_avx2, tear_down_vectors),
        cmocka_unit_test_setup_teardown(test_host_and_device_agree_in_every_bit, set_up_avx2, tear_down_vectors),
        cmocka_unit_test_setup_teardown(test_across_lanes, set_up_avx2, tear_down_vectors),
        cmocka_unit_test_setup_teardown(test_moving_lanes, set_up_avx2, tear_down_vectors),
        cmocka_unit_test_setup_teardown(test_plain_vectors_leave_all_out, set_up_plain, tear_down_vectors),
        cmocka_unit_test_setup_teardown(test_host_and_device_agree_in_every_bit, set_up_plain, tear_down_vectors),
        cmocka_unit_test_setup_teardown(test_across_lanes, set_up_plain, tear_down_vectors),
        cmocka_unit_test_setup_teardown(test_moving_lanes, set_up_plain, tear_down_vectors),
    };
    return cmocka_run_group_tests_name("dialect", tests, NULL, NULL);
}
