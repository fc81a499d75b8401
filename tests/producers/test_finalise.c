/* Finalise on samples of the test's own: the encoding in 8, 16 and 32 bits, its bounds, and what is called constant, in
 * every shape. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <math.h>

#include "producers/steps/finalise.h"
#include "producers/steps/finalise_shared.h"
#include "producers/steps/subdivide_shared.h"
#include "tests/support/pool.h"

#define SIDE KARST_BRICK_SIDE
#define SAMPLES KARST_BRICK_SAMPLES
#define AT(x, y, z) (((z)*SIDE + (y)) * SIDE + (x))

static uint64_t random_state = 88172645463325252u;
static uint32_t random_bits(void)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((random_state ^ random_state >> 29) * 0xbf58476d1ce4e5b9u >> 32);
}
/* in [-1, 1] */
static double random_signed(void) { return (double)random_bits() * 0x1p-31 - 1; }

/* ---- fields: 8 of each kind ---- */

typedef enum {
    FIELD_PLANE, /* oblique, through the brick */
    FIELD_BALL,
    FIELD_WAVES,
    FIELD_WHITE,    /* a sign of its own for every sample */
    FIELD_TINY,     /* a plane times 1e-20 */
    FIELD_HUGE,     /* a plane times 1e20 */
    FIELD_LARGEST,  /* up to FLT_MAX */
    FIELD_DENORMAL, /* down to 1e-45 */
    FIELD_WILD,     /* a plane, but 1e30 away from the surface */
    FIELD_ZERO,
    FIELD_STEPS, /* -1, 0 and 1 */
    FIELD_SOLID, /* one side, without a proof */
    FIELD_LONE,  /* one solid sample in the air */
    NUM_FIELDS
} field_kind;
static const char *const field_names[NUM_FIELDS] = {"plane",    "ball", "waves", "white", "tiny",  "huge", "largest",
                                                    "denormal", "wild", "zero",  "steps", "solid", "lone"};
#define EACH 8
#define NUM_BRICKS (NUM_FIELDS * EACH)

static void fill_field(field_kind kind, float *d)
{
    double n[3] = {random_signed(), random_signed(), random_signed()}, c[3], r = 2 + 5 * fabs(random_signed()),
           w = 0.2 + fabs(random_signed());
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int axis = 0; axis < 3; axis++) {
        n[axis] /= length;
        c[axis] = 8 + 4 * random_signed();
    }
    int lone = (int)(random_bits() % SAMPLES);
    for (int z = 0; z < SIDE; z++)
        for (int y = 0; y < SIDE; y++)
            for (int x = 0; x < SIDE; x++) {
                double p[3] = {x - c[0], y - c[1], z - c[2]};
                double plane = n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
                double v = 0;
                switch (kind) {
                case FIELD_PLANE:
                    v = plane;
                    break;
                case FIELD_BALL:
                    v = r - sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
                    break;
                case FIELD_WAVES:
                    v = 3 * sin(w * p[0]) + 2 * cos(w * p[1] * n[0]) * sin(p[2]);
                    break;
                case FIELD_WHITE:
                    v = random_signed();
                    break;
                case FIELD_TINY:
                    v = plane * 1e-20;
                    break;
                case FIELD_HUGE:
                    v = plane * 1e20;
                    break;
                case FIELD_LARGEST:
                    v = plane >= 0 ? 3.4e38 : -3.4e38 * fabs(random_signed());
                    break;
                case FIELD_DENORMAL:
                    v = plane * 1e-44;
                    break;
                case FIELD_WILD:
                    v = fabs(plane) < 3 ? plane : plane * 1e30;
                    break;
                case FIELD_ZERO:
                    v = 0;
                    break;
                case FIELD_STEPS:
                    v = (int)(random_bits() % 3) - 1;
                    break;
                case FIELD_SOLID:
                    v = 0.5 + 0.4 * random_signed();
                    break;
                case FIELD_LONE:
                    v = AT(x, y, z) == lone ? 0.01 : -5 - plane * 0.1;
                    break;
                default:
                    break;
                }
                d[AT(x, y, z)] = (float)v;
            }
}

/* ---- the bench: staging memory in, bricks out ---- */

typedef struct {
    karst_context *context;
    karst_finaliser *finaliser;
    pool p;
    karst_buffer *loads, *staging, *scrubs, *total;
    karst_channel channel;
    karst_channel_layout layout;
} bench;

static const struct {
    int lanes;
    karst_shape shape;
} shapes[] = {{16, KARST_SHAPE_ROWS}, {1, KARST_SHAPE_ROWS}, {1, KARST_SHAPE_GROUPS}, {16, KARST_SHAPE_GROUPS}};
#define NUM_SHAPES (sizeof shapes / sizeof *shapes)

static void open_bench(bench *b, size_t shape, const char *options, uint32_t num_bricks, uint32_t num_segments)
{
    karst_error error = {0};
    *b = (bench){.channel = {.name = "density", .components = 1}};
    b->context = karst_context_create(getenv("KARST_DEVICE"), shapes[shape].lanes, NULL, &error);
    pool_expect(b->context && karst_channels_lay_out(&b->channel, 1, &b->layout, &error), "context", &error);
    b->finaliser = karst_finaliser_create(b->context, shapes[shape].shape, &b->layout, options, &error);
    pool_expect(b->finaliser, "finaliser", &error);
    pool_open(&b->p, b->context, num_bricks, num_segments);
    b->loads = karst_buffer_create(b->context, "test", num_bricks * sizeof(karst_load), NULL, &error);
    b->staging = karst_buffer_create(b->context, "test", (size_t)num_bricks * b->layout.staging_stride * sizeof(float),
                                     NULL, &error);
    b->scrubs = karst_buffer_create(b->context, "test", num_bricks * sizeof(karst_scrub), NULL, &error);
    b->total = karst_buffer_create(b->context, "test", sizeof(karst_scrub_total), NULL, &error);
    pool_expect(b->loads && b->staging && b->scrubs && b->total, "buffers", &error);
}

static void close_bench(bench *b)
{
    karst_buffer *buffers[] = {b->loads, b->staging, b->scrubs, b->total};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    pool_close(&b->p);
    karst_finaliser_destroy(b->finaliser);
    karst_context_destroy(b->context);
}

/* Finalises `count` bricks of SAMPLES floats each. */
static void finalise(bench *b, const karst_load *loads, const float *samples, uint32_t count, uint32_t *states)
{
    karst_error error = {0};
    pool_node *nodes = calloc(count, sizeof *nodes);
    assert_non_null(nodes);
    pool_ask(&b->p, nodes, count);
    free(nodes);
    pool_expect(karst_buffer_write(b->loads, 0, loads, count * sizeof *loads, &error), "loads", &error);
    for (uint32_t i = 0; i < count; i++)
        pool_expect(karst_buffer_write(b->staging, (size_t)i * b->layout.staging_stride * sizeof(float),
                                       samples + (size_t)i * SAMPLES, SAMPLES * sizeof(float), &error),
                    "samples", &error);
    pool_expect(karst_finalise_bricks(b->finaliser, &b->p.cache, &b->p.work, 0, count, b->loads, b->staging, b->scrubs,
                                      b->total, &error),
                "finalise", &error);
    pool_read_results(&b->p, states);
}

/* ---- checks of one brick against its samples ---- */

static int sign_of(double d) { return d > 0 ? 1 : d < 0 ? -1 : 0; }

static void check_encoding(const float *d, const double *q, int bits, const karst_brick_info *info,
                           const uint32_t fine[KARST_FINE_WORDS], const char *what)
{
    double surface = 0, largest = 0;
    uint64_t blocks = 0, solid = 0;
    uint32_t fine_blocks[KARST_FINE_WORDS] = {0};
    for (int i = 0; i < SAMPLES; i++)
        largest = fabs((double)d[i]) > largest ? fabs((double)d[i]) : largest;
    for (int z = 0; z < KARST_BRICK_CELLS; z++)
        for (int y = 0; y < KARST_BRICK_CELLS; y++)
            for (int x = 0; x < KARST_BRICK_CELLS; x++) {
                int num_solid = 0;
                double reach = 0;
                for (int i = 0; i < 8; i++) {
                    float corner = d[AT(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2))];
                    num_solid += corner > 0;
                    reach = fabs((double)corner) > reach ? fabs((double)corner) : reach;
                }
                if (num_solid == 0 || num_solid == 8)
                    continue;
                blocks |= (uint64_t)1 << (x / 4 + 4 * (y / 4) + 16 * (z / 4));
                int fine_block = x / 2 + 8 * (y / 2) + 64 * (z / 2);
                fine_blocks[fine_block / 32] |= 1u << fine_block % 32;
                surface = reach > surface ? reach : surface;
            }
    if ((info->blocks[0] | (uint64_t)info->blocks[1] << 32) != blocks)
        fail_msg("%s: block mask %08x%08x, should be %016lx", what, info->blocks[1], info->blocks[0], blocks);
    for (int i = 0; i < 64; i++)
        solid |= (uint64_t)(d[AT(4 * (i & 3), 4 * (i >> 2 & 3), 4 * (i >> 4))] > 0) << i;
    if ((info->solid[0] | (uint64_t)info->solid[1] << 32) != solid)
        fail_msg("%s: first samples of blocks %08x%08x, should be %016lx", what, info->solid[1], info->solid[0], solid);
    for (int i = 0; i < KARST_FINE_WORDS; i++)
        if (fine[i] != fine_blocks[i])
            fail_msg("%s: word %d of the fine mask is %08x, should be %08x", what, i, fine[i], fine_blocks[i]);

    double scale = info->scale, clamp = bits == 8 ? 2 : 32;
    assert_true(scale > 0 && isfinite(info->scale));
    /* The bits are used for the full range, but for what is far above all values at the surface. */
    double range = fmax(fmin(largest, (double)(float)(clamp * surface)), 0x1p-100);
    if (bits == 32)
        assert_true(frexp(scale, &(int){0}) == 0.5 && range / scale >= 16384 && range / scale < 32768);
    else
        assert_true(fabs(scale * (bits == 8 ? 127 : 32767) - range) <= 1e-6 * range);
    for (int i = 0; i < SAMPLES; i++) {
        double value = d[i], kept = fabs(value) > range ? copysign(range, value) : value;
        if (sign_of(d[i]) != sign_of(q[i]))
            fail_msg("%s: sample %d is %a, q is %g", what, i, value, q[i]);
        /* Floats keep every bit of what is not beyond the range, or next to nothing beside it. */
        double error = fabs(scale * q[i] - kept), allowed = fabs(q[i]) == 1 ? scale : 0.5 * scale;
        if (bits == 32 ? error > scale * 0x1p-100 : error > allowed * 1.001 + range * 0x1p-22)
            fail_msg("%s: sample %d is %a, decoded %a, scale %a", what, i, value, scale * q[i], scale);
    }
}

/* The trilinear interpolant of q in a cell, and its gradient, at p in [0, 1]^3. */
static double interpolate(const double *q, const int cell[3], const double p[3], double gradient[3])
{
    double value = 0;
    gradient[0] = gradient[1] = gradient[2] = 0;
    for (int i = 0; i < 8; i++) {
        double w[3], s[3], corner = q[AT(cell[0] + (i & 1), cell[1] + (i >> 1 & 1), cell[2] + (i >> 2))];
        for (int axis = 0; axis < 3; axis++) {
            int upper = i >> axis & 1;
            w[axis] = upper ? p[axis] : 1 - p[axis];
            s[axis] = upper ? 1 : -1;
        }
        value += corner * w[0] * w[1] * w[2];
        gradient[0] += corner * s[0] * w[1] * w[2];
        gradient[1] += corner * w[0] * s[1] * w[2];
        gradient[2] += corner * w[0] * w[1] * s[2];
    }
    return value;
}

/* In each cell, at its corners, edges, faces and inside: no slope times safe_cells is above 1. Returns the largest of
 * those products. */
static double check_safe_cells(const double *q, const karst_brick_info *info, const char *what)
{
    static const double steps[5] = {0, 0.21, 0.5, 0.83, 1};
    double largest = 0;
    int cell[3];
    for (cell[2] = 0; cell[2] < KARST_BRICK_CELLS; cell[2]++)
        for (cell[1] = 0; cell[1] < KARST_BRICK_CELLS; cell[1]++)
            for (cell[0] = 0; cell[0] < KARST_BRICK_CELLS; cell[0]++)
                for (int i = 0; i < 125; i++) {
                    const double p[3] = {steps[i % 5], steps[i / 5 % 5], steps[i / 25]};
                    double gradient[3];
                    interpolate(q, cell, p, gradient);
                    double slope =
                        sqrt(gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2]);
                    largest = slope > largest ? slope : largest;
                }
    assert_true(info->safe_cells > 0 && info->safe_cells <= KARST_MAX_SAFE_CELLS);
    if (largest * info->safe_cells > 1)
        fail_msg("%s: the interpolant has a slope of %g q per cell, safe_cells is %g", what, largest, info->safe_cells);
    return largest * info->safe_cells;
}

/* The use of safe_cells: from random points, no straight way of |q| * safe_cells cells meets the other sign. */
static void check_safe_ways(const double *q, const karst_brick_info *info, const char *what)
{
    for (int n = 0; n < 300; n++) {
        double p[3], v[3], gradient[3], at[3], length = 0;
        int cell[3];
        for (int axis = 0; axis < 3; axis++) {
            p[axis] = 8 + 8 * random_signed();
            v[axis] = random_signed();
            length += v[axis] * v[axis];
        }
        length = sqrt(length);
        double here = 0, free_way = 0;
        for (int step = 0; step <= 40; step++) {
            bool inside = true;
            for (int axis = 0; axis < 3; axis++) {
                at[axis] = p[axis] + v[axis] / length * free_way * step / 40;
                inside = inside && at[axis] >= 0 && at[axis] <= 16;
                cell[axis] = at[axis] >= 16 ? 15 : (int)at[axis];
                at[axis] -= cell[axis];
            }
            if (!inside)
                break;
            double value = interpolate(q, cell, at, gradient);
            if (step == 0) {
                here = value;
                free_way = fabs(value) * info->safe_cells;
            } else if (here * value < 0 && fabs(value) > 1e-6)
                fail_msg("%s: %g at the start, %g after %d/40 of a safe way of %g cells", what, here, value, step,
                         free_way);
        }
    }
}

static void encode_in(int bits)
{
    static float samples[NUM_BRICKS * SAMPLES];
    static double first_q[NUM_BRICKS][SAMPLES], q[SAMPLES];
    static karst_brick_info first_info[NUM_BRICKS];
    static uint32_t first_fine[NUM_BRICKS][KARST_FINE_WORDS];
    karst_load loads[NUM_BRICKS];
    uint32_t states[NUM_BRICKS];
    double tightest[NUM_FIELDS] = {0};

    for (int i = 0; i < NUM_BRICKS; i++) {
        fill_field((field_kind)(i / EACH), samples + (size_t)i * SAMPLES);
        loads[i] = (karst_load){.state = KARST_STATE_UNKNOWN, .doubt = INFINITY};
    }
    for (size_t s = 0; s < NUM_SHAPES; s++) {
        bench b;
        open_bench(&b, s, karst_cache_brick_option(&(karst_cache_buffers){.brick_bits = bits}), NUM_BRICKS,
                   s % 2 ? 1 : 5);
        finalise(&b, loads, samples, NUM_BRICKS, states);
        for (uint32_t i = 0; i < NUM_BRICKS; i++) {
            karst_brick_info info;
            char what[64];
            snprintf(what, sizeof what, "%d bits, shape %zu, %s %d", bits, s, field_names[i / EACH], (int)(i % EACH));
            uint32_t expected = i / EACH == FIELD_ZERO    ? KARST_STATE_CLEAR_AIR
                                : i / EACH == FIELD_SOLID ? KARST_STATE_CLEAR_SOLID
                                                          : KARST_STATE_BRICK;
            assert_int_equal(states[i], expected);
            if (expected != KARST_STATE_BRICK)
                continue;
            uint32_t fine[KARST_FINE_WORDS];
            pool_read_samples(&b.p, i, bits, q, &info);
            pool_read_fine(&b.p, i, bits, fine);
            if (s > 0) { /* all shapes write the same bits, so one needs the long checks */
                if (memcmp(q, first_q[i], sizeof q) != 0 || memcmp(&info, &first_info[i], sizeof info) != 0 ||
                    memcmp(fine, first_fine[i], sizeof fine) != 0)
                    fail_msg("%s: not the brick of shape 0", what);
                continue;
            }
            memcpy(first_q[i], q, sizeof q);
            first_info[i] = info;
            memcpy(first_fine[i], fine, sizeof fine);
            check_encoding(samples + (size_t)i * SAMPLES, q, bits, &info, fine, what);
            double tight = check_safe_cells(q, &info, what);
            tightest[i / EACH] = tight > tightest[i / EACH] ? tight : tightest[i / EACH];
            check_safe_ways(q, &info, what);
        }
        close_bench(&b);
    }
    /* A plane's slope is the same everywhere, so there the bound may give nothing away but rounding to q. */
    assert_true(tightest[FIELD_PLANE] > (bits == 8 ? 0.9 : 0.99));
    assert_true(tightest[FIELD_BALL] > (bits == 8 ? 0.7 : 0.8));
}

static void test_encoding(void **state)
{
    (void)state;
    encode_in(16);
}

static void test_bytes(void **state)
{
    (void)state;
    encode_in(8);
}

static void test_floats(void **state)
{
    (void)state;
    encode_in(32);
}

static void test_not_finite(void **state)
{
    (void)state;
    enum { COUNT = 6 };
    static float samples[COUNT * SAMPLES];
    for (size_t s = 0; s < NUM_SHAPES; s++) {
        karst_load loads[COUNT];
        uint32_t states[COUNT];
        karst_scrub_total total;
        karst_error error = {0};
        int16_t q[SAMPLES];
        karst_brick_info info;
        bench b;

        for (int i = 0; i < COUNT; i++) {
            for (int n = 0; n < SAMPLES; n++)
                samples[i * SAMPLES + n] = 100.0f;
            loads[i] =
                (karst_load){.origin = {1000 * i, -5, 77}, .level = i, .state = KARST_STATE_UNKNOWN, .doubt = 0.0f};
        }
        samples[2 * SAMPLES + AT(3, 4, 5)] = NAN;
        samples[2 * SAMPLES + AT(4, 4, 5)] = INFINITY;
        samples[2 * SAMPLES + AT(16, 16, 16)] = -INFINITY;
        for (int n = 0; n < SAMPLES; n++)
            samples[4 * SAMPLES + n] = -NAN;
        open_bench(&b, s, "", COUNT, 1);
        finalise(&b, loads, samples, COUNT, states);
        for (uint32_t i = 0; i < COUNT; i++)
            assert_int_equal(states[i], i == 2   ? KARST_STATE_BRICK
                                        : i == 4 ? KARST_STATE_CLEAR_AIR
                                                 : KARST_STATE_SOLID);
        pool_read_brick(&b.p, 2, q, &info);
        for (int n = 0; n < SAMPLES; n++)
            assert_int_equal(q[n], isfinite(samples[2 * SAMPLES + n]) ? 32767 : -1);
        assert_true(info.blocks[0] != 0);
        pool_expect(karst_buffer_read(b.total, 0, &total, sizeof total, &error), "total", &error);
        assert_int_equal(total.count, 3 + SAMPLES);
        assert_int_equal(total.voxel[0], 2000 + 3 * 4);
        assert_int_equal(total.voxel[1], -5 + 4 * 4);
        assert_int_equal(total.voxel[2], 77 + 5 * 4);
        assert_int_equal(total.level, 2);
        close_bench(&b);
    }
}

/* Constant is a proof: by how far the samples are from zero, against what may lie between them. */
static void test_constant(void **state)
{
    (void)state;
    static const struct {
        float value, odd_one, doubt; /* all samples `value`, but one `odd_one` */
        uint32_t given, expected;
    } cases[] = {
        {2, 2, 1.9999f, KARST_STATE_UNKNOWN, KARST_STATE_SOLID},
        {2, 2, 2, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_SOLID},
        {-2, -2, 1.9999f, KARST_STATE_UNKNOWN, KARST_STATE_AIR},
        {-2, -2, 2, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_AIR},
        {-2, -1, 1, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_AIR},
        {-2, -1, 0.9999f, KARST_STATE_UNKNOWN, KARST_STATE_AIR},
        {2, -2, 1, KARST_STATE_UNKNOWN, KARST_STATE_BRICK},
        {2, -2, 0, KARST_STATE_UNKNOWN, KARST_STATE_BRICK},
        {2, 0, 0, KARST_STATE_UNKNOWN, KARST_STATE_BRICK},
        {0, 0, 0, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_AIR},
        {-2, 0, 0, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_AIR},
        {1e30f, 1e30f, NAN, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_SOLID},
        {1e30f, 1e30f, INFINITY, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_SOLID},
        {-1e30f, NAN, 0, KARST_STATE_UNKNOWN, KARST_STATE_CLEAR_AIR},
        {2, -2, 0, KARST_STATE_AIR, KARST_STATE_AIR}, /* proven beforehand: samples are not looked at */
        {2, -2, 0, KARST_STATE_SOLID, KARST_STATE_SOLID},
    };
    enum { COUNT = sizeof cases / sizeof *cases };
    static float samples[COUNT * SAMPLES];
    karst_load loads[COUNT];
    uint32_t states[COUNT];

    for (int i = 0; i < COUNT; i++) {
        loads[i] = (karst_load){.state = cases[i].given, .doubt = cases[i].doubt};
        for (int n = 0; n < SAMPLES; n++)
            samples[i * SAMPLES + n] = cases[i].value;
        samples[i * SAMPLES + (i % 3 == 0 ? 0 : i % 3 == 1 ? SAMPLES - 1 : AT(7, 8, 9))] = cases[i].odd_one;
    }
    for (size_t s = 0; s < NUM_SHAPES; s++) {
        bench b;
        open_bench(&b, s, "", COUNT, 1);
        finalise(&b, loads, samples, COUNT, states);
        for (int i = 0; i < COUNT; i++)
            if (states[i] != cases[i].expected)
                fail_msg("shape %zu, case %d: state %u, should be %u", s, i, states[i], cases[i].expected);
        close_bench(&b);
    }
}

/* The doubt is at least what it stands for, also where it is not finite. */
static void test_doubt(void **state)
{
    (void)state;
    for (int i = 0; i < 100000; i++) {
        int level = (int)(random_bits() % 40);
        float s[4];
        for (int k = 0; k < 4; k++)
            s[k] = (float)(fabs(random_signed()) * exp2((int)(random_bits() % 40) - 20));
        double exact = ((double)s[0] + s[1] + s[2]) * exp2(level - 1) + s[3];
        float doubt = karst_load_doubt(s[0], s[1], s[2], s[3], level);
        assert_true(doubt >= exact && doubt <= exact * 1.00001);
    }
    assert_false(isfinite(karst_load_doubt(INFINITY, 0, 0, 0, 3)));
    assert_true(isnan(karst_load_doubt(0, NAN, 0, 0, 3)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_encoding),   cmocka_unit_test(test_bytes),    cmocka_unit_test(test_floats),
        cmocka_unit_test(test_not_finite), cmocka_unit_test(test_constant), cmocka_unit_test(test_doubt),
    };
    return cmocka_run_group_tests_name("finalise", tests, NULL, NULL);
}
