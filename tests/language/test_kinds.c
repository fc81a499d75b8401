/* Kinds: what is exact however far, what is wide, what is not. */
#include "world_text.h"

static uint32_t count_ops(const text_world *w, karst_op op)
{
    uint32_t count = 0;
    for (uint32_t e = 1; e < w->program->resolved.num_nodes; e++)
        count += w->program->resolved.nodes[e].op == op;
    return count;
}

static uint32_t count_kind(const text_world *w, karst_kind kind)
{
    uint32_t count = 0;
    for (uint32_t e = 1; e < w->program->resolved.num_nodes; e++)
        count += w->program->resolved.nodes[e].kind == kind;
    return count;
}

/* A body, and how many nodes of an op and of a kind its resolved graph has. */
static const struct {
    const char *body;
    karst_op op;
    uint32_t num_op;
    karst_kind kind;
    uint32_t num_kind;
} shapes[] = {
    {"return noise(p / 256.0 + 17.0);", KARST_OP_AFFINE, 3, KARST_KIND_FLOAT, 1},
    {"return noise((p + p.yzx * 0.5) / 256.0);", KARST_OP_AFFINE, 3, KARST_KIND_FLOAT, 1},
    {"mat2 r = mat2(0.8, 0.6, -0.6, 0.8); return noise(r * p.xz);", KARST_OP_AFFINE, 2, KARST_KIND_FLOAT, 1},
    {"return noise(p + noise(p));", KARST_OP_SHIFTED, 3, KARST_KIND_SHIFTED, 3},
    {"return noise(p * p.x);", KARST_OP_SHIFTED, 0, KARST_KIND_WIDE, 3},
    {"return sin(p.x * 2.0);", KARST_OP_SIN_TURNS, 1, KARST_KIND_FLOAT, 1},
    {"return cos(p.x + sin(p.y));", KARST_OP_COS_TURNS, 1, KARST_KIND_SHIFTED, 1},
    {"return sin(length(p.xz));", KARST_OP_SIN, 1, KARST_KIND_WIDE, 1},
    {"return floor(p.x) + ceil(p.y) + round(p.z);", KARST_OP_FLOOR, 3, KARST_KIND_STEPS, 6},
    {"return fract(sin(dot(floor(p.xz), vec2(12.9898, 78.233))) * 43758.5453);", KARST_OP_FRACT, 1, KARST_KIND_STEPS,
     7},
    {"return p.x < 3.0 ? 1.0 : 2.0;", KARST_OP_LESS, 1, KARST_KIND_STEPS, 2},
    {"return mod(p.x + 0.1, 0.3);", KARST_OP_MOD, 1, KARST_KIND_AFFINE, 1},
    {"return (p.x + 1.0) - p.x;", KARST_OP_AFFINE, 0, KARST_KIND_UNIFORM, 1},
    {"return length(p) - 6371000.0;", KARST_OP_LENGTH, 1, KARST_KIND_WIDE, 2},
    {"return length(p) - 1.0;", KARST_OP_LENGTH, 1, KARST_KIND_WIDE, 0},
    {"return length(p.xz) - p.y;", KARST_OP_LENGTH, 1, KARST_KIND_WIDE, 0},
    {"return length(p) + 6371000.0;", KARST_OP_LENGTH, 1, KARST_KIND_WIDE, 0},
    {"return p.x * noise(vec3(1.0));", KARST_OP_MULTIPLY, 1, KARST_KIND_AFFINE, 1},
    {"return p.x / 0.0;", KARST_OP_DIVIDE, 1, KARST_KIND_AFFINE, 1},
};

static void test_shapes(void **s)
{
    (void)s;
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        text_world w = world_from_body(shapes[i].body);
        assert_int_equal(count_ops(&w, KARST_OP_POSITION), 0);
        uint32_t ops = count_ops(&w, shapes[i].op), kinds = count_kind(&w, shapes[i].kind);
        if (shapes[i].kind == KARST_KIND_UNIFORM)
            kinds = shapes[i].num_kind; /* constants come and go */
        if (ops != shapes[i].num_op || kinds != shapes[i].num_kind)
            fail_msg("%s: %u of the op, %u of the kind", shapes[i].body, ops, kinds);
        world_finish(&w);
    }
}

/* An extent makes the difference of two unbounded numbers wide. */
static void test_extent(void **s)
{
    (void)s;
    text_world w = world_from_text("/*{ \"extent\": 1e7 }*/ float density(vec3 p) { return length(p.xz) - p.y; }");
    assert_int_equal(count_kind(&w, KARST_KIND_WIDE), 2);
    world_finish(&w);
    w = world_from_text("/*{ \"params\": { \"h\": { \"value\": 1, \"min\": 0, \"max\": 9e6 } } }*/ float density(vec3 "
                        "p) { return h * sin(p.x) - p.y; }");
    assert_true(count_kind(&w, KARST_KIND_WIDE) > 0); /* for what the parameter may become */
    world_finish(&w);
}

/* Far from the origin, exact positions give what a shift by whole periods gives at the origin. */
static void test_far(void **s)
{
    (void)s;
    static const struct {
        const char *body;
        int64_t period_voxels; /* a voxel is 1/16 m */
        double within;
    } worlds[] = {{"return fract(p.x / 64.0);", 1024, 0},          {"return mod(p.x, 0.3);", 24, 1e-7},
                  {"return mod(p.x + 0.7, 12.8) - p.z;", 1024, 0}, {"return floor(fract(p.x / 10.0) * 8.0);", 160, 0},
                  {"return fract((p.x + p.z) / 32.0);", 512, 0},   {"return step(0.5, fract(p.x / 3.0));", 48, 0}};
    for (size_t i = 0; i < sizeof worlds / sizeof *worlds; i++) {
        text_world w = world_from_body(worlds[i].body);
        for (int k = 0; k < 300; k++) {
            karst_position near = {{k * 7 - 900, 3, k - 20}, {(uint32_t)k * 0x9e3779b1u, 0, 0}}, far = near;
            far.voxel[0] += worlds[i].period_voxels * (INT64_C(10000000000000) + k);
            karst_oracle_value a = karst_oracle_density(w.oracle, &near, -1),
                               b = karst_oracle_density(w.oracle, &far, -1);
            assert_near((double)a.device, (double)b.device, worlds[i].within, worlds[i].body);
            assert_near(a.precise, b.precise, worlds[i].within, worlds[i].body);
        }
        world_finish(&w);
    }
}

/* A planet: right to a hundredth of a voxel at its surface, against extended precision. */
static void test_wide(void **s)
{
    (void)s;
    text_world w = world_from_text(
        "/*{ \"voxel\": 0.015625 }*/ float density(vec3 p) { return 6371000.0 - length(p - vec3(0.5, 0.25, 0.0)); }");
    const double voxel = 0x1p-6;
    for (int k = 0; k < 2000; k++) {
        double angle = k * 0.7, lift = sin(k * 1.3), side = sqrt(1 - lift * lift);
        karst_position at =
            position_at(&w, side * cos(angle) * 6371000.0, lift * 6371000.0, side * sin(angle) * 6371000.0);
        long double v[3], sum = 0;
        static const long double centre[3] = {0.5L, 0.25L, 0};
        for (int i = 0; i < 3; i++) {
            v[i] = ((long double)at.voxel[i] + (long double)at.fraction[i] * 0x1p-32L) * (long double)voxel - centre[i];
            sum += v[i] * v[i];
        }
        long double exact = 6371000.0L - sqrtl(sum);
        karst_oracle_value d = karst_oracle_density(w.oracle, &at, -1);
        assert_near((double)d.device, (double)exact, voxel / 100, "the planet in pairs of floats");
        assert_near(d.precise, (double)exact, voxel / 100, "the planet in double");
    }
    world_finish(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_shapes), cmocka_unit_test(test_extent),
                                       cmocka_unit_test(test_far), cmocka_unit_test(test_wide)};
    return cmocka_run_group_tests_name("kinds", tests, NULL, NULL);
}
