/* Gradients, colours and bounds at many points: those of samplers one by one, bit for bit, on any number of threads. */
#include "tests/export/found_mesh.h"

#include "karst/query.h"

enum { NUM = 3000, STRIDE = 13 };

static karst_position at[NUM];

static void scatter(const karst_world *world)
{
    uint32_t random_state = 7;
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    for (int i = 0; i < NUM; i++) {
        double offset_m[3];
        for (int axis = 0; axis < 3; axis++) {
            random_state = random_state * 1664525u + 1013904223u;
            offset_m[axis] = (random_state >> 8) / 16777216.0 * 800 - 400;
        }
        at[i] = karst_position_add_m((karst_position){{1000000007, 0, -3}, {0, 0, 0}}, offset_m, voxel_log2_m);
    }
}

static void test_gradients(void **state)
{
    (void)state;
    static float gradient[NUM][3], density[NUM], alone[NUM][3];
    karst_world *world = shipped_world("hills");
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    scatter(world);
    const karst_query_config config = {.num_threads = 3, .footprint_m = 2}, one = {.num_threads = 1, .footprint_m = 2};
    assert_true(karst_query_gradients(world, &config, at, NUM, gradient, density, NULL));
    assert_true(karst_query_gradients(world, &one, at, NUM, alone, NULL, NULL));
    assert_memory_equal(gradient, alone, sizeof gradient);
    for (int i = 0; i < NUM; i += STRIDE) {
        karst_sample expected[3], value;
        assert_true(karst_sampler_gradient(sampler, &at[i], 2, expected, &value));
        assert_memory_equal(&density[i], &value.device, sizeof(float));
        for (int axis = 0; axis < 3; axis++)
            assert_memory_equal(&gradient[i][axis], &expected[axis].device, sizeof(float));
    }
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

static void test_colours(void **state)
{
    (void)state;
    static float rgb[NUM][3], normals[NUM][3], given[NUM][3];
    karst_world *world = shipped_world("hills");
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    scatter(world);
    const karst_query_config config = {.num_threads = 2};
    assert_true(karst_query_colours(world, &config, at, NULL, NUM, rgb, NULL));
    int num_different = 0;
    for (int i = 0; i < NUM; i += STRIDE) {
        karst_sample gradient[3], expected[3];
        assert_true(karst_sampler_gradient(sampler, &at[i], 0, gradient, NULL));
        const double x = (double)gradient[0].device, y = (double)gradient[1].device, z = (double)gradient[2].device;
        const double length = sqrt(x * x + y * y + z * z);
        const float normal[3] = {(float)(-x / length), (float)(-y / length), (float)(-z / length)};
        assert_true(karst_sampler_colour(sampler, &at[i], normal, 0, expected));
        for (int channel = 0; channel < 3; channel++)
            assert_memory_equal(&rgb[i][channel], &expected[channel].device, sizeof(float));
        num_different += memcmp(rgb[i], rgb[0], sizeof rgb[0]) != 0;
    }
    assert_true(num_different > NUM / STRIDE / 2);
    for (int i = 0; i < NUM; i++)
        normals[i][1] = 1;
    assert_true(karst_query_colours(world, &config, at, normals, NUM, given, NULL));
    for (int i = 0; i < NUM; i += STRIDE) {
        karst_sample expected[3];
        karst_sampler_colour(sampler, &at[i], (const float[3]){0, 1, 0}, 0, expected);
        assert_memory_equal(&given[i][0], &expected[0].device, sizeof(float));
    }
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

static void test_bounds(void **state)
{
    (void)state;
    static double half_m[NUM][3], range[NUM][2];
    static float density[NUM];
    karst_world *world = shipped_world("hills");
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    scatter(world);
    for (int i = 0; i < NUM; i++)
        half_m[i][0] = half_m[i][1] = half_m[i][2] = i % 100;
    const karst_query_config config = {.num_threads = 2, .footprint_m = 4}, full = {0};
    assert_true(karst_query_bounds(world, &config, at, half_m, NUM, range, NULL));
    assert_true(karst_query_densities(world, &full, at, NUM, density, NULL));
    for (int i = 0; i < NUM; i++) {
        assert_true(range[i][0] <= (double)density[i] && (double)density[i] <= range[i][1]);
        if (i % STRIDE == 0) {
            double expected[2];
            karst_sampler_bounds(sampler, &at[i], half_m[i], 4, expected);
            assert_memory_equal(range[i], expected, sizeof expected);
        }
    }
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

static bool stop(void *user, double share)
{
    (void)user;
    (void)share;
    return false;
}

static void assert_fails(bool done, const karst_error *error, karst_status status, const char *word)
{
    assert_false(done);
    assert_int_equal(error->status, status);
    assert_non_null(strstr(error->message, word));
}

static void test_refusals(void **state)
{
    (void)state;
    karst_world *world = world_of("float density(vec3 p) { return 5.0 - length(p); }\n");
    float gradient[1][3], rgb[1][3];
    double range[1][2];
    const karst_position origin = {{0, 0, 0}, {0, 0, 0}};
    const double good[1][3] = {{1, 1, 1}}, below[1][3] = {{1, -1, 1}}, unknown[1][3] = {{1, 1, (double)NAN}};
    const karst_query_config bad = {.footprint_m = -1}, stopped = {.progress = stop, .num_threads = 1}, usual = {0};
    karst_error error = {0};
    assert_fails(karst_query_gradients(world, &bad, &origin, 1, gradient, NULL, &error), &error, KARST_USAGE,
                 "footprint");
    error = (karst_error){0};
    assert_fails(karst_query_gradients(world, &stopped, &origin, 1, gradient, NULL, &error), &error, KARST_FAILED,
                 "stopped");
    error = (karst_error){0};
    assert_fails(karst_query_colours(world, &usual, &origin, NULL, 1, rgb, &error), &error, KARST_USAGE, "no colours");
    error = (karst_error){0};
    assert_fails(karst_query_bounds(world, &usual, &origin, below, 1, range, &error), &error, KARST_USAGE, "box 1");
    error = (karst_error){0};
    assert_fails(karst_query_bounds(world, &usual, &origin, unknown, 1, range, &error), &error, KARST_USAGE, "box 1");
    error = (karst_error){0};
    assert_fails(karst_query_bounds(world, &bad, &origin, good, 1, range, &error), &error, KARST_USAGE, "footprint");
    karst_world_close(world);
    world = shipped_world("hills");
    error = (karst_error){0};
    assert_fails(karst_query_colours(world, &bad, &origin, NULL, 1, rgb, &error), &error, KARST_USAGE, "footprint");
    karst_world_close(world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_gradients), cmocka_unit_test(test_colours),
                                       cmocka_unit_test(test_bounds), cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
