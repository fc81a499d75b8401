/* Jumps over 0 (producers/steps/jump.clh): surfaces lie where the density jumps, and are as smooth, bricks that share
 * samples agree where it matters, and the bits are the same in all shapes. Rules broken one by one are noticed. */
#include "tests/producers/mended.h"

static karst_world_file *open_text(const char *density, bool smooth)
{
    karst_world_file *file = open_plain(density);
    if (smooth)
        karst_world_file_smooth_jumps(file);
    return file;
}

/* The bricks as one grid, of the samples of cells that the surface goes through alone: others tell nobody where it is.
 * Returns how many of these bricks that share them disagree on. */
static int join_surface(const float *samples, float *grid)
{
    static unsigned char is_set[NUM_CELLS];
    int num_torn = 0;
    memset(is_set, 0, sizeof is_set);
    join(samples, grid);
    for (int n = 0; n < NUM_LOADS; n++)
        for (int cell = 0; cell < KARST_BRICK_CELLS * KARST_BRICK_CELLS * KARST_BRICK_CELLS; cell++) {
            const int at[3] = {cell % KARST_BRICK_CELLS, cell / KARST_BRICK_CELLS % KARST_BRICK_CELLS,
                               cell / KARST_BRICK_CELLS / KARST_BRICK_CELLS};
            int num_solid = 0;
            for (int c = 0; c < 8; c++)
                num_solid += sample_of(samples, n, at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2)) > 0;
            for (int c = 0; c < 8 && num_solid % 8; c++) {
                int x = at[0] + (c & 1), y = at[1] + (c >> 1 & 1), z = at[2] + (c >> 2);
                float d = sample_of(samples, n, x, y, z);
                int i = n / ALONG / ALONG * KARST_BRICK_CELLS + z;
                i = i * SIDE + n / ALONG % ALONG * KARST_BRICK_CELLS + y;
                i = i * SIDE + n % ALONG * KARST_BRICK_CELLS + x;
                num_torn += is_set[i] && memcmp(&grid[i], &d, sizeof d);
                grid[i] = d;
                is_set[i] = 1;
            }
        }
    return num_torn;
}

/* Of cells that the surface goes through, the largest distance of its crossings of their edges from where `side` says
 * that it is, and how far a cell's slope is turned from `slope` (in mean and at most, degrees). */
typedef struct {
    int num_edges, num_cells;
    double most_off, mean_turned, most_turned;
} smoothness;

typedef double distance(const double p[3]); /* in voxels, from the middle of the grid; positive in solid */

static smoothness look(const float *grid, distance *side, double most)
{
    static const int stride[3] = {1, SIDE, SIDE * SIDE};
    smoothness s = {0};
    for (int z = 1; z < SIDE - 2; z++)
        for (int y = 1; y < SIDE - 2; y++)
            for (int x = 1; x < SIDE - 2; x++) {
                const int at[3] = {x, y, z};
                const float *p = grid + (z * SIDE + y) * SIDE + x;
                double slope[3] = {0}, real[3], middle[3], dot = 0, square = 0, real_square = 0;
                int num_solid = 0;
                for (int c = 0; c < 8; c++)
                    num_solid += p[(c & 1) + (c >> 1 & 1) * SIDE + (c >> 2) * SIDE * SIDE] > 0;
                if (num_solid == 0 || num_solid == 8)
                    continue;
                for (int axis = 0; axis < 3; axis++)
                    middle[axis] = at[axis] + 0.5 - SIDE / 2;
                if (fabs(side(middle)) > most) /* near an edge of the body */
                    continue;
                for (int axis = 0; axis < 3; axis++) {
                    if ((p[0] > 0) != (p[stride[axis]] > 0)) {
                        double t = p[0] / ((double)p[0] - p[stride[axis]]), place[3];
                        for (int k = 0; k < 3; k++)
                            place[k] = at[k] - SIDE / 2 + (k == axis ? t : 0);
                        s.num_edges++;
                        s.most_off = fmax(s.most_off, fabs(side(place)));
                    }
                    double high[3] = {middle[0], middle[1], middle[2]}, low[3] = {middle[0], middle[1], middle[2]};
                    high[axis] += 1e-3;
                    low[axis] -= 1e-3;
                    real[axis] = side(high) - side(low);
                    for (int c = 0; c < 8; c++)
                        slope[axis] += ((c >> axis & 1) ? 1.0 : -1.0) *
                                       p[(c & 1) + (c >> 1 & 1) * SIDE + (c >> 2) * SIDE * SIDE];
                    dot += slope[axis] * real[axis];
                    square += slope[axis] * slope[axis];
                    real_square += real[axis] * real[axis];
                }
                double turned = acos(fmin(1, dot / sqrt(square * real_square))) * 57.29577951308232;
                s.num_cells++;
                s.mean_turned += turned;
                s.most_turned = fmax(s.most_turned, turned);
            }
    s.mean_turned /= s.num_cells ? s.num_cells : 1;
    return s;
}

/* Walls of terraces: round ones, straight ones that are turned, and such that lean. */
static double of_cylinder(const double p[3]) { return 20.3 - hypot(p[0] - 0.4, p[2] + 1.7); }
static double of_wall(const double p[3]) { return (0.31 * p[0] + 0.95 * p[2] - 2.2) / 0.99929976; }
static double of_steep(const double p[3]) { return (0.1 * p[0] + p[1] + 0.37 * p[2] + 1.3) / 1.07093417; }

static const struct {
    const char *density;
    distance *side;
} bodies[] = {
    {"return 5e5 - 1e6 * floor(length(p.xz - 8.0 * vec2(0.4, -1.7)) / (8.0 * 20.3));", of_cylinder},
    {"return 100.0 - 200.0 * floor(length(p.xz - 8.0 * vec2(0.4, -1.7)) / (8.0 * 20.3)) - 0.01 * p.y;", of_cylinder},
    {"return 1e6 * floor((0.31 * p.x + 0.95 * p.z - 17.6) / 4096.0) + 5e5;", of_wall},
    {"return 90.0 * floor((0.1 * p.x + p.y + 0.37 * p.z + 10.4) / 4096.0) + 45.0 + 0.1 * sin(p.x);", of_steep},
};
#define NUM_BODIES (sizeof bodies / sizeof *bodies)

static smoothness look_at(const karst_world_file *file, size_t body, const char *more, int *num_torn)
{
    static float grid[NUM_CELLS];
    karst_scrub sum;
    float *samples = evaluate(file, rows, 3, more, &sum);
    *num_torn = join_surface(samples, grid);
    free(samples);
    smoothness s = look(grid, bodies[body].side, 1.5);
    print_message("# %s %s: %d torn, %d edges off by %.4f voxels, slopes of %d cells by %.2f degrees, at most %.2f\n",
                  bodies[body].density, more, *num_torn, s.num_edges, s.most_off, s.num_cells, s.mean_turned,
                  s.most_turned);
    return s;
}

static void test_smooth(void **state)
{
    int num_torn;
    (void)state;
    for (size_t b = 0; b < NUM_BODIES; b++) {
        karst_world_file *file = open_text(bodies[b].density, true), *plain = open_text(bodies[b].density, false);
        assert_true(file->smooths_jumps);
        smoothness s = look_at(file, b, "", &num_torn);
        assert_int_equal(num_torn, 0);
        assert_true(s.num_edges > 3000);
        assert_true(s.most_off < 0.03 && s.mean_turned < 2 && s.most_turned < 15);
        s = look_at(plain, b, "", &num_torn); /* a staircase, and so the test means something */
        assert_true(s.most_off > 0.4 && s.mean_turned > 5);
        karst_world_file_destroy(file);
        karst_world_file_destroy(plain);
    }
}

/* Where a plane of samples lies in the jump they may have a value of its own, which is none of either side. */
static double of_level(const double p[3]) { return p[1]; }
static double of_pit(const double p[3]) { return -p[1]; }

static void test_between(void **state)
{
    static const struct {
        const char *density;
        distance *side;
    } levels[] = {{"return 4.0 + 9.0 * sign(p.y);", of_level},
                  {"return 9.0 * sign(p.y) - 4.0;", of_level},
                  {"return 1.0 - 2.0 * atan(p.y, 0.0);", of_pit}};
    static float grid[NUM_CELLS];
    (void)state;
    for (size_t w = 0; w < sizeof levels / sizeof *levels; w++) {
        karst_world_file *file = open_text(levels[w].density, true);
        karst_scrub sum;
        float *samples = evaluate(file, rows, 3, "", &sum);
        assert_int_equal(join_surface(samples, grid), 0);
        const smoothness s = look(grid, levels[w].side, 1.5);
        free(samples);
        samples = evaluate(file, rows, 3, "-DJUMP_MUTANT_NO_MIDDLE", &sum);
        join_surface(samples, grid);
        const smoothness broken = look(grid, levels[w].side, 1.5);
        free(samples);
        karst_world_file_destroy(file);
        print_message("# %s: %d edges off by %.4f voxels; %.4f without a rule for what lies between\n",
                      levels[w].density, s.num_edges, s.most_off, broken.most_off);
        assert_true(s.num_edges > 3000 && s.most_off < 0.03 && s.mean_turned < 1e-3 && broken.most_off > 0.2);
    }
}

/* A rim, where the top of a terrace ends in a jump, and a foot, where a cliff begins: how far from the surface, in
 * voxels, cells are of which samples say the wrong side, at most and in the mean of all places that they go through. */
typedef struct {
    double most, mean;
} bluntness;

static double of_rim(const double p[3]) { return fmin(p[1] * -1 + 2.37, of_wall(p)); }
static double of_foot(const double p[3]) { return fmax(p[1] * -1 + 2.37, of_wall(p)); }

static bluntness how_blunt(const float *grid, distance *body, distance *bend)
{
    bluntness b = {0, 0};
    int count = 0;
    for (int cell = 0; cell < NUM_CELLS; cell++) {
        const int at[3] = {cell % SIDE, cell / SIDE % SIDE, cell / SIDE / SIDE};
        double middle[3];
        int num_solid = 0;
        for (int axis = 0; axis < 3; axis++)
            middle[axis] = at[axis] + 0.5 - SIDE / 2;
        if (at[0] > SIDE - 2 || at[1] > SIDE - 2 || at[2] > SIDE - 2 || bend(middle) > 3 || fabs(body(middle)) > 1.5)
            continue;
        for (int c = 0; c < 8; c++)
            num_solid += grid[cell + (c & 1) + (c >> 1 & 1) * SIDE + (c >> 2) * SIDE * SIDE] > 0;
        for (int n = 0; n < 512 && num_solid % 8; n++) {
            const double part[3] = {(n % 8 + 0.5) / 8, (n / 8 % 8 + 0.5) / 8, (n / 64 + 0.5) / 8};
            double d = 0, place[3];
            for (int c = 0; c < 8; c++)
                d += grid[cell + (c & 1) + (c >> 1 & 1) * SIDE + (c >> 2) * SIDE * SIDE] *
                     (c & 1 ? part[0] : 1 - part[0]) * (c >> 1 & 1 ? part[1] : 1 - part[1]) *
                     (c >> 2 ? part[2] : 1 - part[2]);
            for (int axis = 0; axis < 3; axis++)
                place[axis] = at[axis] - SIDE / 2 + part[axis];
            const double real = body(place), off = (d > 0) != (real > 0) ? fabs(real) : 0;
            b.most = fmax(b.most, off);
            b.mean += off;
            count++;
        }
    }
    b.mean /= count ? count : 1;
    return b;
}

static double of_both(const double p[3]) { return fmax(fabs(p[1] - 2.37), fabs(of_wall(p))); }

static void test_edges(void **state)
{
    static const struct {
        const char *density;
        distance *body;
        double most, mean;
    } edges[] = {
        {"return 18.96 - p.y + 300.0 * floor((0.31 * p.x + 0.95 * p.z - 17.6) / 4096.0);", of_rim, 0.25, 0.002},
        {"return 318.96 - p.y + 300.0 * floor((0.31 * p.x + 0.95 * p.z - 17.6) / 4096.0);", of_foot, 0.35, 0.004}};
    static float grid[NUM_CELLS];
    (void)state;
    for (size_t w = 0; w < sizeof edges / sizeof *edges; w++) {
        karst_world_file *file = open_text(edges[w].density, true);
        karst_scrub sum;
        float *samples = evaluate(file, rows, 3, "", &sum);
        const int num_torn = join_surface(samples, grid);
        free(samples);
        const bluntness b = how_blunt(grid, edges[w].body, of_both);
        samples = evaluate(file, rows, 3, "-DJUMP_MUTANT_NOT_PAST", &sum);
        const int torn_before = join_surface(samples, grid);
        free(samples);
        karst_world_file_destroy(file);
        const bluntness broken = how_blunt(grid, edges[w].body, of_both);
        print_message("# %s: off by %.3f voxels, %.4f in the mean, %d torn; %.3f, %.4f, %d by jumps over 0 alone\n",
                      edges[w].density, b.most, b.mean, num_torn, broken.most, broken.mean, torn_before);
        assert_true(b.most < edges[w].most && b.mean < edges[w].mean);
        /* a brick that ends at a foot does not ask for the cliff behind its face: on these few samples bricks differ */
        assert_true(num_torn <= 1 && torn_before <= 1);
        assert_true(broken.most > edges[w].most && broken.mean > edges[w].mean);
    }
}

static void test_mutants(void **state)
{
    int num_torn;
    (void)state;
    karst_world_file *file = open_text(bodies[2].density, true);
    smoothness s = look_at(file, 2, "-DJUMP_ROUNDS=2", &num_torn);
    assert_true(s.most_off > 0.1);
    look_at(file, 2, "-DBESIDE_MUTANT_BRICK_ALONE", &num_torn);
    assert_true(num_torn > 0);
    s = look_at(file, 2, "-DJUMP_MUTANT_EDGES_ALONE", &num_torn);
    assert_true(s.most_turned > 15);
    karst_world_file_destroy(file);
}

/* Terraces and cells, and what folds space: there no sample changes. */
static const struct {
    const char *density;
    bool changes;
} many[] = {
    {"float h = 90.0 * fbm(p.xz / 400.0, 6); return floor(h / 24.0) * 24.0 - p.y;", true},
    {"vec3 c = floor(p / 64.0); return 30.0 * fract(sin(dot(c.xz, vec2(12.9, 78.2))) * 437.5) - p.y;", true},
    {"vec3 q = mod(p, 64.0) - 32.0; return 14.0 - length(q);", false},
    {"vec3 q = abs(mod(p, 80.0) - 40.0); return 20.0 - max(q.x, max(q.y, q.z));", false},
};

static void test_same_bits(void **state)
{
    static const device_shape others[] = {{1, KARST_SHAPE_ROWS, false}, {1, KARST_SHAPE_GROUPS, false}};
    karst_scrub sum;
    (void)state;
    for (size_t w = 0; w < sizeof many / sizeof *many; w++) {
        karst_world_file *file = open_text(many[w].density, true), *plain = open_text(many[w].density, false);
        float *samples = evaluate(file, rows, 3, "", &sum), *without = evaluate(plain, rows, 3, "", &sum);
        int num_changed = 0, num_turned = 0;
        for (size_t i = 0; i < (size_t)NUM_LOADS * KARST_BRICK_PADDED; i++) {
            bool is_sample = i % KARST_BRICK_PADDED < KARST_BRICK_SAMPLES;
            num_changed += is_sample && samples[i] != without[i];
            num_turned += is_sample && (samples[i] > 0) != (without[i] > 0);
        }
        assert_int_equal(num_turned, 0);
        if ((num_changed > 100) != many[w].changes)
            fail_msg("%s: %d samples changed", many[w].density, num_changed);
        for (size_t s = 0; s < sizeof others / sizeof *others && many[w].changes; s++) {
            float *other = evaluate(file, others[s], 3, "", &sum);
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
    karst_world_file *file = open_text(many[0].density, true);
    expect_host_has_same(context, file);
    karst_world_file_destroy(file);
    karst_context_destroy(context);
}

/* Worlds that neither ask for whole numbers nor decide anything have no code for it. */
static void test_which(void **state)
{
    static const struct {
        const char *density;
        bool jumps;
    } worlds[] = {{"return 60.0 * fbm(p / 90.0, 4) - p.y;", false},
                  {"return min(60.0 - length(p), -p.y);", false},
                  {"return 8.0 * floor(noise(p / 70.0) * 5.0) - p.y;", true},
                  {"return p.x > 3.0 ? -1.0 - p.y : 7.0 - p.y;", true}};
    (void)state;
    for (size_t w = 0; w < sizeof worlds / sizeof *worlds; w++) {
        karst_world_file *file = open_text(worlds[w].density, true);
        assert_int_equal(file->smooths_jumps, worlds[w].jumps);
        karst_world_file_destroy(file);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_which), cmocka_unit_test(test_smooth),
                                       cmocka_unit_test(test_mutants), cmocka_unit_test(test_same_bits),
                                       cmocka_unit_test(test_between), cmocka_unit_test(test_edges),
                                       cmocka_unit_test(test_host)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
