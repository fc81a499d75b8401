/* The nearest surface: where it is known exactly, and by proof where it is not. */
#include "tests/export/found_mesh.h"

#include <sys/resource.h>
#include <time.h>

#include "karst/query.h"

enum { NUM = 16 };

static karst_position at[NUM];
static double at_m[NUM][3];
static karst_query_near found[NUM], again[NUM];

static void scatter(const karst_world *world, double spread_m)
{
    uint32_t random = 5;
    for (int i = 0; i < NUM; i++) {
        for (int axis = 0; axis < 3; axis++) {
            random = random * 1664525u + 1013904223u;
            at_m[i][axis] = ((random >> 8) / 16777216.0 - 0.5) * spread_m;
        }
        at[i] = karst_position_add_m((karst_position){{0, 0, 0}, {0, 0, 0}}, at_m[i],
                                     karst_world_get_metadata(world)->voxel_log2_m);
    }
}

static void find(const karst_world *world, double reach_m)
{
    karst_error error = {0};
    const karst_query_config config = {.num_threads = 3}, one = {.num_threads = 1};
    if (!karst_query_nearest(world, &config, at, NUM, reach_m, found, &error) ||
        !karst_query_nearest(world, &one, at, NUM, reach_m, again, &error))
        fail_msg("%s", error.message);
    for (int i = 0; i < NUM; i++) {
        assert_memory_equal(&found[i].distance_m, &again[i].distance_m, sizeof(double));
        assert_memory_equal(&found[i].at_least_m, &again[i].at_least_m, sizeof(double));
    }
}

/* From inside and outside, of balls side by side: to the least of the distances to their centres. */
static void test_balls(void **state)
{
    (void)state;
    karst_world *world =
        world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 20.0 - length(mod(p, 64.0) - "
                 "32.0); }\n");
    scatter(world, 130);
    find(world, 100);
    int num_exact = 0, num_proved = 0;
    for (int i = 0; i < NUM; i++) {
        double nearest = 1e30;
        for (int k = 0; k < 125; k++) {
            double square = 0;
            for (int axis = 0; axis < 3; axis++) {
                const int cell = axis == 0 ? k % 5 : axis == 1 ? k / 5 % 5 : k / 25;
                const double way = at_m[i][axis] - (64.0 * (cell - 2) + 32);
                square += way * way;
            }
            nearest = fmin(nearest, sqrt(square));
        }
        assert_int_equal(found[i].is_inside, nearest < 20);
        const double truth = fabs(nearest - 20);
        if (found[i].distance_m > truth * (1 + 1.0 / 16) + 0.002)
            print_message("%g %g %g: %g found, %g true, %g at least\n", at_m[i][0], at_m[i][1], at_m[i][2],
                          found[i].distance_m, truth, found[i].at_least_m);
        assert_true(found[i].distance_m > truth - 1e-4 && found[i].distance_m < truth * (1 + 1.0 / 16) + 0.002);
        num_exact += found[i].distance_m < truth + 0.002;
        assert_true(found[i].at_least_m < truth + 1e-4);
        num_proved += found[i].at_least_m > truth * (1 - 1.0 / 16) - 0.002;
        double way_m[3], along = 0;
        karst_position_difference_m(at[i], found[i].at, -2, way_m);
        for (int axis = 0; axis < 3; axis++)
            along += way_m[axis] * found[i].normal[axis] / found[i].distance_m;
        assert_true(truth < 0.5 || fabs(along - (found[i].is_inside ? 1 : -1)) < 0.01);
    }
    /* Else another ball is as near; and where space folds, little can be proved of small cubes. */
    print_message("balls: %d of %d distances are within 2 mm, %d proved to a 16th\n", num_exact, NUM, num_proved);
    assert_true(num_exact > NUM * 4 / 5 && num_proved > NUM / 4);
    karst_world_close(world);
}

/* Corners, where no slope leads: within a 16th. */
static void test_box(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { vec3 q = abs(p) - vec3(9.0, 6.0, "
                                  "12.0); return -max(q.x, max(q.y, q.z)); }\n");
    scatter(world, 60);
    find(world, 60);
    for (int i = 0; i < NUM; i++) {
        static const double half[3] = {9, 6, 12};
        double square = 0, inside = 1e30;
        for (int axis = 0; axis < 3; axis++) {
            const double out = fabs(at_m[i][axis]) - half[axis];
            square += out > 0 ? out * out : 0;
            inside = fmin(inside, -out);
        }
        const double truth = inside > 0 ? inside : sqrt(square);
        if (found[i].distance_m > truth * (1 + 1.0 / 16) + 0.002)
            print_message("%g %g %g: %g found, %g true, %g at least\n", at_m[i][0], at_m[i][1], at_m[i][2],
                          found[i].distance_m, truth, found[i].at_least_m);
        assert_true(found[i].distance_m > truth - 1e-4 && found[i].distance_m < truth * (1 + 1.0 / 16) + 0.003);
        assert_true(found[i].at_least_m < truth + 1e-4 && found[i].at_least_m > truth * (1 - 1.0 / 16) - 0.003);
    }
    karst_world_close(world);
}

/* Nothing of the other side within what is said to be the least. */
static void test_land(void **state)
{
    (void)state;
    enum { NUM_LOOKS = 200 };
    karst_world *world =
        world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 9.0 * noise(p * 0.05) + 2.0 * "
                 "noise(p * 0.21 + 3.0) - p.y; }\n");
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    assert_non_null(sampler);
    scatter(world, 120);
    find(world, 30);
    uint32_t random = 3;
    int num_found = 0;
    for (int i = 0; i < NUM; i++) {
        const bool is_solid = karst_sampler_density(sampler, &at[i], 0).device > 0;
        assert_int_equal(found[i].is_inside, is_solid);
        assert_true(found[i].at_least_m <= found[i].distance_m);
        if (isfinite(found[i].distance_m)) {
            num_found++;
            assert_int_not_equal(karst_sampler_density(sampler, &found[i].at, 0).device > 0, is_solid);
            assert_true(found[i].distance_m <= 30);
        }
        for (int look = 0; look < NUM_LOOKS; look++) {
            double offset_m[3], square = 0;
            for (int axis = 0; axis < 3; axis++) {
                random = random * 1664525u + 1013904223u;
                offset_m[axis] = (random >> 8) / 8388608.0 - 1;
                square += offset_m[axis] * offset_m[axis];
            }
            for (int axis = 0; axis < 3; axis++)
                offset_m[axis] *= 0.999 * fmin(found[i].at_least_m, 30) / fmax(sqrt(square), 1);
            const karst_position near =
                karst_position_add_m(at[i], offset_m, karst_world_get_metadata(world)->voxel_log2_m);
            assert_int_equal(karst_sampler_density(sampler, &near, 0).device > 0, is_solid);
        }
    }
    print_message("land: %d of %d points have a surface within 30 m\n", num_found, NUM);
    assert_true(num_found > NUM / 4 && num_found < NUM);
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

/* What many points ask of cubes makes no difference to any of them. A million with KARST_TEST_FULL=1, and how long it
 * takes. */
static void test_many(void **state)
{
    (void)state;
    enum { NUM_ALONE = 10 };
    const size_t num = getenv("KARST_TEST_FULL") ? 1000000 : 60;
    karst_position *many = malloc(num * sizeof *many);
    karst_query_near *answers = malloc(num * sizeof *answers);
    assert_true(many && answers);
    karst_world *world = shipped_world("hills");
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    const karst_query_config config = {.num_threads = 2};
    uint32_t random = 9;
    for (size_t i = 0; i < num; i++) {
        double place_m[3];
        for (int axis = 0; axis < 3; axis++) {
            random = random * 1664525u + 1013904223u;
            place_m[axis] = ((random >> 8) / 16777216.0 - 0.5) * (axis == 1 ? 120 : num > 1000 ? 1000 : 30);
        }
        many[i] = karst_position_add_m((karst_position){{0, 0, 0}, {0, 0, 0}}, place_m, voxel_log2_m);
    }
    struct timespec start, end;
    struct rusage before, after;
    getrusage(RUSAGE_SELF, &before);
    clock_gettime(CLOCK_MONOTONIC, &start);
    assert_true(karst_query_nearest(world, &config, many, num, 100, answers, NULL));
    clock_gettime(CLOCK_MONOTONIC, &end);
    getrusage(RUSAGE_SELF, &after);
    size_t num_found = 0, num_proved = 0;
    for (size_t i = 0; i < num; i++) {
        num_found += isfinite(answers[i].distance_m);
        num_proved += isfinite(answers[i].distance_m) &&
                      answers[i].at_least_m > answers[i].distance_m * (1 - 1.0 / 16) - ldexp(1, voxel_log2_m - 7);
        assert_true(answers[i].at_least_m <= answers[i].distance_m);
    }
    const double cpu_s = (double)(after.ru_utime.tv_sec - before.ru_utime.tv_sec) +
                         1e-6 * (double)(after.ru_utime.tv_usec - before.ru_utime.tv_usec);
    const double wall_s = (double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec);
    print_message("hills: %zu points in %.1f s, %.0f us of CPU each; %zu have a surface, %zu proved to a 16th\n", num,
                  wall_s, 1e6 * cpu_s / (double)num, num_found, num_proved);
    assert_true(num_found > num * 9 / 10 && num_proved > num_found * 3 / 4);
    for (size_t k = 0; k < NUM_ALONE; k++) {
        const size_t i = k * (num / NUM_ALONE);
        karst_query_near alone;
        assert_true(karst_query_nearest(world, &config, &many[i], 1, 100, &alone, NULL));
        assert_memory_equal(&alone.at, &answers[i].at, sizeof alone.at);
        assert_memory_equal(&alone.distance_m, &answers[i].distance_m, sizeof alone.distance_m);
        assert_memory_equal(&alone.at_least_m, &answers[i].at_least_m, sizeof alone.at_least_m);
        assert_memory_equal(alone.normal, answers[i].normal, sizeof alone.normal);
    }
    free(many);
    free(answers);
    karst_world_close(world);
}

static void test_refusals(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return -p.y; }\n");
    const karst_query_config bad[] = {{.footprint_m = -1}, {.within_m = 1e-12}, {.num_threads = 257}}, good = {0};
    for (size_t i = 0; i < 3; i++) {
        karst_error error = {0};
        assert_false(karst_query_nearest(world, &bad[i], at, 1, 5, found, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    for (int i = 0; i < 2; i++) {
        karst_error error = {0};
        assert_false(karst_query_nearest(world, &good, at, 1, i ? (double)NAN : 0, found, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    karst_world_close(world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_balls), cmocka_unit_test(test_box),
                                       cmocka_unit_test(test_land), cmocka_unit_test(test_many),
                                       cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
