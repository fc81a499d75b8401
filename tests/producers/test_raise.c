/* Matter thinner than a voxel (producers/steps/raise.clh): 95 of 100 rays meet it however thin it is, bricks that share
 * samples agree, the bits are the same in all shapes of device and on the host, sheets are as smooth as they are, and
 * ordinary surfaces do not move. Rules broken one by one are noticed. */
#include "tests/producers/mended.h"

static karst_world_file *open_text(const char *density, bool raise)
{
    karst_world_file *file = open_plain(density);
    karst_world_file_raise_thin(file, raise ? KARST_THIN_ALWAYS : KARST_THIN_NEVER);
    return file;
}

static double mixed(double a, double b, double share) { return a + (b - a) * share; }

static double interpolant(const float *grid, const double at[3])
{
    double share[3], plane[2];
    int cell[3];
    for (int axis = 0; axis < 3; axis++) {
        cell[axis] = (int)at[axis];
        share[axis] = at[axis] - cell[axis];
    }
    for (int z = 0; z < 2; z++) {
        const float *p = grid + ((cell[2] + z) * SIDE + cell[1]) * SIDE + cell[0];
        plane[z] = mixed(mixed(p[0], p[1], share[0]), mixed(p[SIDE], p[SIDE + 1], share[0]), share[1]);
    }
    return mixed(plane[0], plane[1], share[2]);
}

/* Of rays in all directions from the middle of the grid, those that meet nothing. */
enum { NUM_RAYS = 4000 };
static int count_lost(const float *grid)
{
    const double step = 1.0 / 32, golden = 2.399963229728653;
    int num_lost = 0;
    for (int i = 0; i < NUM_RAYS; i++) {
        double up = 1 - (2 * i + 1.0) / NUM_RAYS, out = sqrt(1 - up * up);
        const double way[3] = {out * cos(golden * i), up, out * sin(golden * i)};
        bool hit = false;
        for (double t = 0; t < SIDE / 2 - 1 && !hit; t += step) {
            double at[3];
            for (int axis = 0; axis < 3; axis++)
                at[axis] = SIDE / 2 + t * way[axis];
            hit = interpolant(grid, at) > 0;
        }
        num_lost += !hit;
    }
    return num_lost;
}

/* Closed surfaces some 20 voxels of 8 m from the origin, `t` metres thick. */
static const char *const closed[] = {
    "return %.6f - abs(length(p - vec3(1.3, -2.1, 0.7)) - 161.0);",
    "return 7.0 * (%.6f - abs(length(p) - 157.0));", /* another scale */
    "vec3 q = vec3(0.8 * p.x - 0.6 * p.y, 0.6 * p.x + 0.8 * p.y, p.z); q = vec3(q.x, 0.8 * q.y - 0.6 * q.z, 0.6 * "
    "q.y + 0.8 * q.z); return %.6f - abs(max(abs(q.x), max(abs(q.y), abs(q.z))) - 115.0);"};
static const double share[] = {0.5, 0.125, 0.03125};
#define NUM_CLOSED (sizeof closed / sizeof *closed)
#define NUM_SHARES (sizeof share / sizeof *share)

static karst_world_file *open_closed(size_t which, double of_voxel, bool raise)
{
    char density[1024];
    snprintf(density, sizeof density, closed[which], of_voxel * 8 / 2);
    return open_text(density, raise);
}

static void test_closed(void **state)
{
    static float grid[NUM_CELLS];
    karst_scrub sum;
    (void)state;
    for (size_t which = 0; which < NUM_CLOSED; which++) {
        for (size_t i = 0; i < NUM_SHARES; i++) {
            /* Each thickness of one surface, and each surface at one thickness; all of all in full. */
            if (which && i != which && !getenv("KARST_TEST_FULL"))
                continue;
            karst_world_file *file = open_closed(which, share[i], true), *plain = open_closed(which, share[i], false);
            float *samples = evaluate(file, rows, 3, "", &sum);
            int num_torn = join(samples, grid);
            int num_lost = count_lost(grid);
            if (num_torn || num_lost > NUM_RAYS / 20 || sum.given_up > sum.raised / 20)
                fail_msg("%s, %g voxels: %d torn, %d of %d rays lost, %u raised, %u given up", closed[which], share[i],
                         num_torn, num_lost, NUM_RAYS, sum.raised, sum.given_up);
            free(samples);
            if (share[i] < 0.4) { /* without, most rays are lost, and so the test means something */
                samples = evaluate(plain, rows, 3, "", &sum);
                join(samples, grid);
                assert_true(count_lost(grid) > NUM_RAYS / 3);
                free(samples);
            }
            karst_world_file_destroy(file);
            karst_world_file_destroy(plain);
        }
    }
}

static const char *const many[] = {
    "return min(0.1 - abs(length(p) - 157.0), 1.0);",
    "vec3 q = p - 40.0 * floor(p / 40.0 + 0.5); return 0.2 - min(length(q.xy), min(length(q.yz), length(q.zx)));",
    "vec3 q = p - 32.0 * floor(p / 32.0); return "
    "max(-100.0 - p.y, -box(q - vec3(16.0, 9.0, 13.0), vec3(0.1, 6.0, 2.0)));",
    "vec3 q = vec3(mod(p.x, 37.0) - 18.0, p.y, mod(p.z - 1.0, 90.0) - 40.0); return -box(q, vec3(14.0, 70.0, 3.5));",
    "vec3 q = vec3(mod(p.x, 8.1) - 4.05, p.y, p.z - 0.1); return -box(q, vec3(3.7, 190.0, 0.3));",
    "return min(60.0 * fbm(p / 90.0, 4, 0.5, 2.0, 3) - p.y, 0.3 - abs(noise(p / 77.0, 2)));",
    /* much smaller than a voxel: bounds say "air" of most nodes that show it */
    "return 0.5 - length(p - vec3(4.0, 2.75, 3.0));"};

/* Each broken rule: what it does to a sphere, or to boards. */
static void test_mutants(void **state)
{
    static float grid[NUM_CELLS];
    karst_scrub sum;
    (void)state;
    karst_world_file *file = open_closed(0, 0.125, true);
    float *samples = evaluate(file, rows, 3, "-DRAISE_BY=0.25f", &sum);
    assert_int_equal(join(samples, grid), 0);
    assert_true(count_lost(grid) > NUM_RAYS / 20);
    free(samples);
    karst_world_file_destroy(file);
    int num_torn = 0;
    for (int which = 1; which <= 5 && !num_torn; which += 4) { /* wires, or sheets that run anyhow */
        file = open_text(many[which], true);
        samples = evaluate(file, rows, 3, "-DBESIDE_MUTANT_BRICK_ALONE", &sum);
        num_torn += join(samples, grid);
        free(samples);
        karst_world_file_destroy(file);
    }
    assert_true(num_torn > 0);
}

/* Of lines across upright boards at z = `at_m`, half_m wide to both sides of places `spacing_m` apart, those that meet
 * nothing, in a thousand. `from`: the share of half_m at which they begin; then they come as near as 1 % to an edge. */
static int count_lost_of_boards(const float *grid, double spacing_m, double middle_m, double half_m, double at_m,
                                double from)
{
    int num_lost = 0, num_all = 0;
    for (double middle = middle_m - 20 * spacing_m; middle < 220; middle += spacing_m)
        for (int n = 0; n < 64; n++) {
            const double part = from + (0.99 - from) * (n / 2 + 0.5) / 32;
            const double y = -55 + 37.7 * (n * 0.618 - floor(n * 0.618));
            const double x = middle + (n & 1 ? -part : part) * half_m;
            bool hit = false;
            if (fabs(x) > 240)
                continue;
            for (double z = at_m - 8; z <= at_m + 8 && !hit; z += 0.25) {
                const double at[3] = {SIDE / 2 + x / 8, SIDE / 2 + y / 8, SIDE / 2 + z / 8};
                hit = interpolant(grid, at) > 0;
            }
            num_lost += !hit;
            num_all++;
        }
    return 1000 * num_lost / num_all;
}

/* Boards nearly a voxel thick show where they end, and thin ones with gaps narrower than a voxel are all there. */
static void test_boards(void **state)
{
    static float grid[NUM_CELLS];
    karst_scrub sum;
    int lost[2][2];
    (void)state;
    for (int which = 0; which < 2; which++)
        for (int raise = 0; raise < 2; raise++) {
            karst_world_file *file = open_text(many[3 + which], raise);
            float *samples = evaluate(file, rows, 3, "", &sum);
            assert_int_equal(join(samples, grid), 0);
            lost[which][raise] = which ? count_lost_of_boards(grid, 8.1, 4.05, 3.7, 0.1, 0)
                                       : count_lost_of_boards(grid, 37, 18, 14, 41, 0.7);
            free(samples);
            karst_world_file_destroy(file);
        }
    print_message("lost, in a thousand: %d beside edges, %d of boards close together; not raised %d, %d\n", lost[0][1],
                  lost[1][1], lost[0][0], lost[1][0]);
    assert_true(lost[0][1] <= 10 && lost[1][1] <= 10);
    assert_true(lost[0][0] > 50 && lost[1][0] > 50);
}

/* By how much, in voxels, the surface that a ray from the middle meets lies elsewhere than one voxel of the samples'
 * before a sheet without thickness: as far along its normal as its normal's parts are together. The most of all rays
 * that lead to where the sheet is and not to the grid's rim. */
static double most_off(const float *grid, const double sheet[4])
{
    const double golden = 2.399963229728653, before = fabs(sheet[0]) + fabs(sheet[1]) + fabs(sheet[2]);
    double most = 0;
    int num = 0;
    for (int i = 0; i < NUM_RAYS; i++) {
        const double up = 1 - (2 * i + 1.0) / NUM_RAYS, out = sqrt(1 - up * up);
        const double way[3] = {out * cos(golden * i), up, out * sin(golden * i)};
        const double along = way[0] * sheet[0] + way[1] * sheet[1] + way[2] * sheet[2];
        double at[3], nearest = 0, farthest = sheet[3] / along;
        if (along < 0.2 || farthest > SIDE / 2 - 4)
            continue;
        for (int round = 0; round < 40; round++) {
            const double t = (nearest + farthest) / 2;
            for (int axis = 0; axis < 3; axis++)
                at[axis] = SIDE / 2 + t * way[axis];
            *(interpolant(grid, at) > 0 ? &farthest : &nearest) = t;
        }
        most = fmax(most, fabs(sheet[3] - before - nearest * along));
        num++;
    }
    assert_true(num > 50);
    return most;
}

/* Sheets show neither steps nor waves, however they lie between the samples and however thin they are. */
static void test_smooth(void **state)
{
    static float grid[NUM_CELLS];
    static const double sheets[][4] = {
        {0.06, 0.08, 0.995, 17.37}, {0.6, -0.08, 0.796, 14.2}, {-0.577, 0.577, 0.578, 11.6}};
    (void)state;
    for (size_t i = 0; i < sizeof sheets / sizeof *sheets; i++) {
        char density[256];
        const double *n = sheets[i], length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        const double unit[4] = {n[0] / length, n[1] / length, n[2] / length, n[3]};
        double off[2];
        snprintf(density, sizeof density, "return %.3f - abs(dot(p, vec3(%.9f, %.9f, %.9f)) - %.9f);",
                 i == 0 ? 0.02 : 2.0, unit[0], unit[1], unit[2], 8 * unit[3]);
        karst_world_file *file = open_text(density, true);
        for (int broken = 0; broken < 2; broken++) {
            karst_scrub sum;
            float *samples = evaluate(file, rows, 3, broken ? "-DRAISE_FAR=1.0f" : "", &sum);
            assert_int_equal(join(samples, grid), 0);
            off[broken] = most_off(grid, unit);
            free(samples);
        }
        print_message("%s: off by %.4f voxels at most; where samples farther off stay as they are by %.4f\n", density,
                      off[0], off[1]);
        assert_true(off[0] < 0.02 && off[1] > 0.2);
        karst_world_file_destroy(file);
    }
}

static void test_same_bits(void **state)
{
    /* No device takes 16 lanes in groups, and PoCL's compiler dies of this code in that shape. */
    static const device_shape others[] = {
        {1, KARST_SHAPE_ROWS, false}, {1, KARST_SHAPE_GROUPS, false}, {16, KARST_SHAPE_ROWS, true}};
    enum { NUM_OTHERS = sizeof others / sizeof *others };
    static float grid[NUM_CELLS];
    karst_scrub sum, theirs;
    (void)state;
    for (size_t w = 0; w < sizeof many / sizeof *many; w++) {
        karst_world_file *file = open_text(many[w], true), *plain = open_text(many[w], false);
        float *samples = evaluate(file, rows, 3, "", &sum), *without = evaluate(plain, rows, 3, "", &theirs);
        int num_raised = 0;
        for (size_t i = 0; i < (size_t)NUM_LOADS * KARST_BRICK_PADDED; i++)
            num_raised += i % KARST_BRICK_PADDED < KARST_BRICK_SAMPLES && samples[i] != without[i];
        assert_true(num_raised > 100);
        assert_int_equal(num_raised, sum.raised);
        assert_int_equal(join(samples, grid), 0);
        for (size_t s = 0; s < NUM_OTHERS; s++) {
            /* Drivers compile for seconds: each world in one of the shapes; all of all in full. */
            if (s != w % NUM_OTHERS && !getenv("KARST_TEST_FULL"))
                continue;
            float *other = evaluate(file, others[s], 3, "", &theirs);
            assert_memory_equal(&theirs, &sum, sizeof sum);
            expect_same_samples(samples, other);
            free(other);
        }
        free(without);
        free(samples);
        karst_world_file_destroy(file);
        karst_world_file_destroy(plain);
    }
}

/* The bricks of a producer that is on the host, and of its kernels. */
static void test_host(void **state)
{
    karst_error error = {0};
    (void)state;
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 0, NULL, &error);
    pool_expect(context, "context", &error);
    for (size_t w = 0; w < sizeof many / sizeof *many; w++) {
        karst_world_file *file = open_text(many[w], true);
        assert_true(expect_host_has_same(context, file) > 100);
        karst_world_file_destroy(file);
    }
    karst_context_destroy(context);
}

/* Matter a voxel thick and more: nothing is raised, wherever it lies and however it is turned. */
static void test_ordinary(void **state)
{
    static const char *const worlds[] = {"return 150.0 - length(p - vec3(1.7, 0.3, -2.2));",
                                         "return max(-p.y - 3.3, 0.01 * p.x - p.y - 40.0);",
                                         "return 0.3 * p.x - 0.7 * p.y + 0.2 * p.z + 1.0;",
                                         "return min(100.0 - max(abs(p.x), abs(p.z)), 60.0 - abs(p.y));"};
    (void)state;
    for (size_t w = 0; w < sizeof worlds / sizeof *worlds; w++) {
        karst_world_file *file = open_text(worlds[w], true), *plain = open_text(worlds[w], false);
        karst_scrub sum;
        float *samples = evaluate(file, rows, 3, "", &sum), *without = evaluate(plain, rows, 3, "", &sum);
        for (int n = 0; n < NUM_LOADS; n++)
            assert_memory_equal(samples + (size_t)n * KARST_BRICK_PADDED, without + (size_t)n * KARST_BRICK_PADDED,
                                KARST_BRICK_SAMPLES * sizeof *samples);
        free(samples);
        free(without);
        karst_world_file_destroy(file);
        karst_world_file_destroy(plain);
    }
}

/* The edge of a cylinder on a plane of samples, where the density of the top is 0: samples beside it have matter within
 * half a voxel, which others show already. Where they are raised all the same, its shadow has teeth. */
static void test_edges(void **state)
{
    (void)state;
    karst_world_file *file = open_text("return min(100.0 - length(p.xz - vec2(1.3, 0.7)), 64.0 - p.y);", true);
    karst_scrub sum;
    free(evaluate(file, rows, 3, "", &sum));
    karst_world_file_destroy(file);
    if (sum.raised > 2)
        fail_msg("%u raised", sum.raised);
}

/* Nor is what both faces of a thick body meet at, if they do so at 64 degrees, though it is thin there. */
static void test_sharp_edges(void **state)
{
    (void)state;
    karst_world_file *file = open_text("vec3 q = vec3(0.8 * p.x - 0.6 * p.y, 0.6 * p.x + 0.8 * p.y, p.z); return "
                                       "min(20.0 - length(q) * 0.05, min(0.53 * q.x + 0.85 * q.z, 0.53 * q.x - 0.85 * "
                                       "q.z) + 3.0);",
                                       true);
    karst_scrub sum;
    free(evaluate(file, rows, 3, "", &sum));
    assert_int_equal(sum.raised, 0);
    free(evaluate(file, rows, 3, "-DRAISE_EDGE=-1.0f", &sum));
    print_message("edges that count as thin: %u raised\n", sum.raised);
    assert_true(sum.raised > 100);
    karst_world_file_destroy(file);
}

static float largest(float *grid)
{
    float most = 0;
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        most = fmaxf(most, fabsf(grid[i]));
    free(grid);
    return most;
}

/* Teeth whose steep sides are jumps, at 45 degrees to the others: what is raised beside a jump would end in steps. */
static void test_teeth(void **state)
{
    (void)state;
    karst_world_file *file = open_text("return mod(0.8 * p.x + 0.6 * p.z, 160.0) - 80.3 - p.y;", true);
    karst_scrub sum;
    free(evaluate(file, rows, 3, "", &sum));
    const uint32_t raised = sum.raised;
    free(evaluate(file, rows, 3, "-DRAISE_JUMP=1e30f", &sum));
    print_message("teeth: %u raised; %u where jumps are none\n", raised, sum.raised);
    assert_true(raised == 0 && sum.raised > 100);
    karst_world_file_destroy(file);
    /* Right beside samples slopes are no jumps. */
    file = open_text("return mod(0.8 * p.x + 0.6 * p.z, 24.0) - 12.0 - p.y;", true);
    const float most = largest(evaluate(file, rows, 3, "", &sum));
    const float most_of_jumps = largest(evaluate(file, rows, 3, "-DRAISE_JUMP=1e30f", &sum));
    print_message("largest sample: %g; %g where jumps are none\n", (double)most, (double)most_of_jumps);
    assert_true(most < 400 && most_of_jumps > 2000);
    karst_world_file_destroy(file);
}

/* Worlds without thin matter of their own have no code for it. */
static void test_which(void **state)
{
    static const struct {
        const char *density;
        bool thin;
    } worlds[] = {{"return 60.0 * fbm(p / 90.0, 4, 0.5, 2.0, 3) - p.y;", false},
                  {"return noise(p / 7.0, 1) * 0.25 + 3.0 - p.y / 8.0;", false},
                  {"return 1.0 - abs(p.y);", true},
                  {"return 0.01 - p.y * p.y;", true},
                  {"return ridged(p / 90.0, 4, 0.5, 2.0, 3);", true},
                  {"return min(p.x, -p.y);", true}};
    /* Of what has noise, by default: where something without it stands beside. */
    static const struct {
        const char *density;
        bool raised;
    } mixed_worlds[] = {
        {"return max(60.0 * fbm(p / 90.0, 4, 0.5, 2.0, 3) - p.y, 0.1 - abs(p.x));", true},
        {"return -smin(p.y - 9.0 * noise(p / 30.0), box(p, vec3(9.0, 2.0, 0.1)), 0.5);", true},
        {"float a = 9.0 * noise(p / 30.0) - p.y, b = 0.1 - length(p.xz); return a > b ? a : b;", true},
        {"return 0.5 * max(ridged(p / 90.0, 4, 0.5, 2.0, 3) - p.y / 50.0, min(0.05 - abs(p.z), -p.x));", true},
        {"return max(ridged(p / 90.0, 4, 0.5, 2.0, 3), noise(p / 30.0) - p.y);", false},
        {"return 60.0 * fbm(p / 90.0, 4, 0.5, 2.0, 3) - max(p.y, 0.0) + 0.1 * abs(p.x);", false},
        {"return max(9.0 * noise(p / 30.0) - p.y, -50.0 - p.y);", false}, /* a plane */
        {"return 40.0 * smoothstep(-0.2, 0.3, noise(p / 90.0, 1)) - p.y;", false},
    };
    (void)state;
    for (size_t w = 0; w < sizeof worlds / sizeof *worlds; w++) {
        karst_world_file *file = open_text(worlds[w].density, true);
        assert_int_equal(file->raises_thin, worlds[w].thin);
        karst_world_file_raise_thin(file, KARST_THIN_NEVER);
        assert_false(file->raises_thin);
        karst_world_file_destroy(file);
    }
    for (size_t w = 0; w < sizeof mixed_worlds / sizeof *mixed_worlds; w++) {
        karst_world_file *file = open_text(mixed_worlds[w].density, true);
        karst_world_file_raise_thin(file, KARST_THIN_AUTO);
        if (file->raises_thin != mixed_worlds[w].raised)
            fail_msg("%s: raised %d", mixed_worlds[w].density, file->raises_thin);
        karst_world_file_destroy(file);
    }
}

/* A body that ends at a plane of samples, where the density has a value of its own, as sign(0.0): that has no slope. */
static void test_between(void **state)
{
    (void)state;
    karst_world_file *file =
        open_text("return 30.0 + 30.0 * atan(p.y, 0.0) - 0.5 * abs(p.z) - 0.002 * dot(p, p);", true);
    karst_scrub sum;
    free(evaluate(file, rows, 3, "", &sum));
    const uint32_t raised = sum.raised;
    free(evaluate(file, rows, 3, "-DRAISE_JUMP=1e30f", &sum));
    print_message("a plane of samples amid a jump: %u raised; %u where jumps are none\n", raised, sum.raised);
    assert_true(raised == 0 && sum.raised > 100);
    karst_world_file_destroy(file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_which),       cmocka_unit_test(test_ordinary), cmocka_unit_test(test_edges),
        cmocka_unit_test(test_sharp_edges), cmocka_unit_test(test_teeth),    cmocka_unit_test(test_closed),
        cmocka_unit_test(test_mutants),     cmocka_unit_test(test_boards),   cmocka_unit_test(test_smooth),
        cmocka_unit_test(test_same_bits),   cmocka_unit_test(test_between),  cmocka_unit_test(test_host)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
