/* Questions: densities are the sampler's, surfaces are where closed forms have them and thin ones are not missed, maps
 * and rays agree with one another, and threads make no difference. */
#include "tests/export/found_mesh.h"

#include "karst/query.h"

static karst_position place(const karst_world *world, const char *x, const char *y, const char *z)
{
    return box_of(world, x, y, z, 1, 1, 1, 1).corner;
}

static uint32_t random_state = 1;
static double random_between(double low, double high)
{
    random_state = random_state * 1664525u + 1013904223u;
    return low + (high - low) * (random_state >> 8) / 16777216;
}

static void test_densities(void **state)
{
    (void)state;
    enum { NUM = 20000, STRIDE = 7 };
    static karst_position at[NUM];
    static float density[NUM];
    karst_world *world = shipped_world("hills");
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    for (int i = 0; i < NUM; i++)
        at[i] = karst_position_add_m(
            place(world, "1e12", "0", "-3"),
            (double[3]){random_between(-500, 500), random_between(-99, 99), random_between(-500, 500)}, voxel_log2_m);
    const karst_query_config config = {.num_threads = 3};
    assert_true(karst_query_densities(world, &config, at, NUM, density, NULL));
    for (int i = 0; i < NUM; i += STRIDE) {
        const karst_sample sample = karst_sampler_density(sampler, &at[i], 0);
        assert_memory_equal(&density[i], &sample.device, sizeof(float));
    }
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

/* A sheet a hundredth of a metre thick over a ball: a stack of surfaces that are known. */
static const char sheet_text[] = "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) {\n"
                                 "  return max(5.0 - length(p), 0.005 - abs(p.y - 8.0 - 0.1 * p.x)); }\n";

static void test_heights(void **state)
{
    (void)state;
    enum { NUM = 200, MOST = 6 };
    karst_world *world = world_of(sheet_text);
    karst_position at[NUM];
    double x[NUM], z[NUM], down_m[NUM * MOST];
    uint32_t counts[NUM];
    bool inside[NUM];
    for (int i = 0; i < NUM; i++) {
        x[i] = random_between(-9, 9);
        z[i] = random_between(-9, 9);
        at[i] = karst_position_add_m(place(world, "0", "50", "0"), (double[3]){x[i], 0, z[i]}, -2);
    }
    const karst_query_config config = {.within_m = 1e-3};
    assert_true(karst_query_heights(world, &config, at, NUM, 100, MOST, down_m, counts, inside, NULL));
    int num_balls = 0;
    for (int i = 0; i < NUM; i++) {
        const double square = 25 - x[i] * x[i] - z[i] * z[i], sheet = 50 - 8 - 0.1 * x[i];
        assert_false(inside[i]);
        if (fabs(square) < 0.01)
            continue;
        assert_int_equal(counts[i], square > 0 ? 4 : 2);
        assert_true(fabs(down_m[i * MOST] - sheet + 0.005) < 1.1e-3);
        assert_true(fabs(down_m[i * MOST + 1] - sheet - 0.005) < 1.1e-3);
        if (square <= 0)
            continue;
        num_balls++;
        assert_true(fabs(down_m[i * MOST + 2] - 50 + sqrt(square)) < 1.1e-3);
        assert_true(fabs(down_m[i * MOST + 3] - 50 - sqrt(square)) < 1.1e-3);
    }
    assert_true(num_balls > 30);
    karst_world_close(world);
}

static void test_rays(void **state)
{
    (void)state;
    enum { NUM = 300 };
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 5.0 - length(p); }\n");
    static karst_query_ray rays[NUM];
    static karst_query_hit hits[NUM], again[NUM];
    for (int i = 0; i < NUM; i++) {
        rays[i].from = karst_position_add_m(place(world, "0", "0", "0"), (double[3]){-20, 0, 0}, -2);
        rays[i].direction[0] = 3;
        rays[i].direction[1] = random_between(-1.2, 1.2);
        rays[i].direction[2] = random_between(-1.2, 1.2);
        rays[i].length_m = i % 5 ? 100 : 10;
    }
    rays[0].from = place(world, "1", "2", "3");
    karst_query_config config = {.num_threads = 1};
    assert_true(karst_query_rays(world, &config, rays, NUM, hits, NULL));
    config.num_threads = 3;
    assert_true(karst_query_rays(world, &config, rays, NUM, again, NULL));
    assert_memory_equal(hits, again, sizeof hits);
    assert_int_equal(hits[0].kind, KARST_QUERY_INSIDE);
    int num_hits = 0;
    for (int i = 1; i < NUM; i++) {
        const double *d = rays[i].direction, square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        const double near = 20 * d[0] / sqrt(square), inner = near * near - 375;
        if (inner <= 0 || rays[i].length_m < 11) {
            if (fabs(inner) > 0.1)
                assert_int_equal(hits[i].kind, KARST_QUERY_MISS);
            continue;
        }
        num_hits++;
        assert_int_equal(hits[i].kind, KARST_QUERY_SURFACE);
        assert_true(fabs(hits[i].t_m - near + sqrt(inner)) < 0.25 / 64);
        assert_true(hits[i].normal[0] < 0);
    }
    assert_true(num_hits > 50);
    karst_world_close(world);
}

/* Against heights one by one; and no pixel is lower than what samples find. */
static void test_map(void **state)
{
    (void)state;
    enum { WIDTH = 40, HEIGHT = 21 };
    const int height = getenv("KARST_TEST_QUICK") ? 2 : HEIGHT;
    static double down_m[WIDTH * HEIGHT], one_m[WIDTH * HEIGHT];
    static karst_position at[WIDTH * HEIGHT];
    static uint32_t counts[WIDTH * HEIGHT];
    static bool inside[WIDTH * HEIGHT];
    karst_world *world = shipped_world("hills");
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    const karst_height_map map = {
        .corner = place(world, "-100", "500", "20"),
        .size_m = {400, 10.0 * height},
        .size_px = {WIDTH, height},
        .depth_m = 2000};
    const karst_query_config config = {0};
    assert_true(karst_query_height_map(world, &config, &map, down_m, NULL));
    for (int i = 0; i < WIDTH * height; i++)
        at[i] = karst_position_add_m(
            map.corner, (double[3]){10 * (i % WIDTH + 0.5), 0, 10 * (height - i / WIDTH - 0.5)}, voxel_log2_m);
    const size_t num = (size_t)(WIDTH * height);
    assert_true(karst_query_heights(world, &config, at, num, 2000, 1, one_m, counts, inside, NULL));
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    for (int i = 0; i < WIDTH * height; i++) {
        assert_int_equal(counts[i], 1);
        /* Floats change their sign more than once where the density is as small as their error. */
        assert_true(fabs(down_m[i] - one_m[i]) <= ldexp(4, voxel_log2_m - 7));
        const karst_position just = karst_position_add_m(at[i], (double[3]){0, -down_m[i], 0}, voxel_log2_m);
        assert_true(karst_sampler_density(sampler, &just, 0).device > 0);
        const karst_position above =
            karst_position_add_m(just, (double[3]){0, ldexp(1, voxel_log2_m - 7), 0}, voxel_log2_m);
        assert_true(karst_sampler_density(sampler, &above, 0).device <= 0);
        for (int k = 1; k < 50; k++) {
            const karst_position higher = karst_position_add_m(just, (double[3]){0, 0.7 * k, 0}, voxel_log2_m);
            assert_true(karst_sampler_density(sampler, &higher, 0).device <= 0);
        }
    }
    karst_sampler_destroy(sampler);
    karst_world_close(world);
    /* Columns without land. */
    world = world_of(sheet_text);
    const karst_height_map none = {
        .corner = place(world, "-9", "4", "7"), .size_m = {18, 2}, .size_px = {9, 1}, .depth_m = 2};
    assert_true(karst_query_height_map(world, &config, &none, down_m, NULL));
    for (int i = 0; i < 9; i++)
        assert_true(isinf(down_m[i]));
    karst_world_close(world);
}

static bool stop(void *user, double share)
{
    (void)user;
    (void)share;
    return false;
}

static void test_refusals(void **state)
{
    (void)state;
    karst_world *world = world_of(sheet_text);
    const karst_position at = {{0, 0, 0}, {0, 0, 0}};
    float density;
    double down_m;
    uint32_t count;
    bool inside;
    const karst_query_config bad[] = {{.footprint_m = -1}, {.within_m = 1e-12}, {.within_m = (double)NAN},
                                      {.num_threads = 257}, {.footprint_m = (double)INFINITY}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        karst_error error = {0};
        assert_false(karst_query_densities(world, &bad[i], &at, 1, &density, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    const karst_query_config good = {0}, stopped = {.progress = stop, .num_threads = 1};
    karst_error error = {0};
    assert_false(karst_query_heights(world, &good, &at, 1, 0, 1, &down_m, &count, &inside, &error));
    assert_int_equal(error.status, KARST_USAGE);
    const karst_query_ray ray = {.from = at, .length_m = 5};
    karst_query_hit hit;
    error = (karst_error){0};
    assert_false(karst_query_rays(world, &good, &ray, 1, &hit, &error));
    assert_int_equal(error.status, KARST_USAGE);
    error = (karst_error){0};
    assert_false(karst_query_densities(world, &stopped, &at, 1, &density, &error));
    assert_int_equal(error.status, KARST_FAILED);
    karst_world_close(world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_densities), cmocka_unit_test(test_heights),
                                       cmocka_unit_test(test_rays), cmocka_unit_test(test_map),
                                       cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
