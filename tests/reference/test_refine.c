/* Engines against the reference: how far hits are off with and without refining, and how errors fall with the voxel. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "karst/karst.h"
#include "karst/view.h"

enum { WIDTH = 96, HEIGHT = 72, NUM_PIXELS = WIDTH * HEIGHT };

static karst_reference_hit expected[NUM_PIXELS];
static float depth_m[NUM_PIXELS], normals[NUM_PIXELS * 3];
static double depth_errors[NUM_PIXELS], normal_errors_deg[NUM_PIXELS];
static size_t num_errors;

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

static void trace(const char *world, double detail_px)
{
    karst_error error = {0};
    const karst_reference_config config = {
        .world = world,
        .width_px = WIDTH,
        .height_px = HEIGHT,
        .detail_px = detail_px,
        .footprint = KARST_FOOTPRINT_BLENDED};
    if (!karst_reference_trace(&config, expected, NULL, NULL, NULL, &error))
        fail_msg("%s", error.message);
}

/* Returns the bytes of a brick in the pool. */
static double draw(const char *world, double detail_px, bool refine, int lanes, int brick_bits)
{
    karst_error error = {0};
    bool settled = false;
    const karst_engine_config config = {.world = world,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)128 << 20,
                                        .detail_px = detail_px,
                                        .no_shadows = true,
                                        .brick_bits = brick_bits,
                                        .refine = refine,
                                        .lanes = lanes};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_settle(engine, 400, NULL, NULL, &settled, &error) || !settled ||
        !karst_engine_read_depth(engine, depth_m, NUM_PIXELS, &error) ||
        !karst_engine_read_normals(engine, normals, NUM_PIXELS * 3, &error))
        fail_msg("%s: %s", world, error.message);
    karst_stats stats;
    karst_engine_stats(engine, &stats);
    karst_engine_destroy(engine);
    return (double)stats.bricks.size_bytes / (double)stats.bricks.num_total;
}

/* Sorted errors of the pixels that both hit. */
static void compare(void)
{
    num_errors = 0;
    for (int i = 0; i < NUM_PIXELS; i++) {
        if (expected[i].kind != KARST_REFERENCE_SURFACE || isinf(depth_m[i]))
            continue;
        double cosine = 0;
        for (int k = 0; k < 3; k++)
            cosine += expected[i].normal[k] * (double)normals[3 * i + k];
        depth_errors[num_errors] = fabs((double)depth_m[i] - expected[i].t_m) / expected[i].footprint_m;
        normal_errors_deg[num_errors++] = acos(fmin(1, fmax(-1, cosine))) * 57.29577951;
    }
    qsort(depth_errors, num_errors, sizeof *depth_errors, by_value);
    qsort(normal_errors_deg, num_errors, sizeof *normal_errors_deg, by_value);
    assert_true(num_errors > NUM_PIXELS / 4);
}

static double share(const double *values, double part) { return values[(size_t)(part * (double)(num_errors - 1))]; }

static void test_refined_hits(void **state)
{
    (void)state;
    static const char world[] = "demos/worlds/hills.karst";
    static float first_m[NUM_PIXELS];
    trace(world, 1);
    draw(world, 1, false, 0, 0);
    compare();
    double plain = share(depth_errors, 0.5), plain_deg = share(normal_errors_deg, 0.5);
    /* The picture is small, so that footprints are wide and silhouettes many. */
    assert_true(plain <= 0.1);
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        draw(world, 1, true, lanes, 0);
        compare();
        print_message(
            "hills, %d lanes: depth %.4f and %.2g footprints (refined), p90 %.2g; normals %.2f and %.2f degrees\n",
            lanes, plain, share(depth_errors, 0.5), share(depth_errors, 0.9), plain_deg, share(normal_errors_deg, 0.5));
        assert_true(share(depth_errors, 0.5) <= 0.001);
        assert_true(share(depth_errors, 0.9) <= 0.05);
        assert_true(share(normal_errors_deg, 0.5) <= 0.7 && share(normal_errors_deg, 0.5) < plain_deg / 4);
        if (lanes == 1)
            memcpy(first_m, depth_m, sizeof first_m);
        else
            assert_memory_equal(first_m, depth_m, sizeof first_m);
    }
}

static char world_path[64];

static void write_world(const char *text)
{
    snprintf(world_path, sizeof world_path, "/tmp/karst-refine-%d.karst", (int)getpid());
    FILE *file = fopen(world_path, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

/* Flat pieces have no curvature to err by, folds no derivative: both must come out as bricks have them, or better. */
static void test_folds(void **state)
{
    (void)state;
    write_world("/*{ \"voxel\": 0.0625, \"view\": 400,\n"
                "  \"camera\": { \"position\": [\"0\", \"14\", \"0\"], \"yaw\": 20, \"pitch\": -25 } }*/\n"
                "float density(vec3 p) { vec3 q = abs(mod(p, 16.0) - 8.0) - vec3(5.0, 3.0, 5.0);\n"
                "  return max(-max(q.x, max(q.y, q.z)) - 2.0 * step(60.0, p.y), -0.2 - p.y); }\n");
    trace(world_path, 1);
    draw(world_path, 1, false, 0, 0);
    compare();
    double plain = share(depth_errors, 0.9);
    draw(world_path, 1, true, 0, 0);
    compare();
    print_message("boxes: p90 %.4f and %.4f footprints (refined)\n", plain, share(depth_errors, 0.9));
    assert_true(share(depth_errors, 0.5) <= 0.001 && share(depth_errors, 0.9) <= plain);
    unlink(world_path);
}

/* A smooth world whose octaves no footprint here fades: what is left is sampling, whose error falls with the square of
 * the voxel. */
static void test_convergence(void **state)
{
    (void)state;
    write_world("/*{ \"voxel\": 0.0625, \"view\": 800,\n"
                "  \"camera\": { \"position\": [\"0\", \"60\", \"0\"], \"yaw\": 20, \"pitch\": -40 } }*/\n"
                "float density(vec3 p) { return 20.0 * sin(p.x / 60.0) * cos(p.z / 70.0) + 9.0 * sin(p.z / 41.0 + 1.0)"
                " - p.y + 0.3 * p.y * sin(p.x / 90.0); }\n");
    const double details_px[] = {8, 4, 2, 1};
    double sum_x = 0, sum_y = 0, sum_xx = 0, sum_xy = 0;
    const int num = sizeof details_px / sizeof *details_px;
    trace(world_path, 1);
    for (int i = 0; i < num; i++) {
        draw(world_path, details_px[i], false, 0, 32);
        compare();
        double x = log2(details_px[i]), y = log2(share(depth_errors, 0.5));
        print_message("%g pixels a voxel: median %.3g footprints\n", details_px[i], exp2(y));
        sum_x += x;
        sum_y += y;
        sum_xx += x * x;
        sum_xy += x * y;
    }
    double order = (num * sum_xy - sum_x * sum_y) / (num * sum_xx - sum_x * sum_x);
    print_message("order of convergence, floats: %.3f\n", order);
    assert_true(order >= 1.8 && order <= 2.2);
    unlink(world_path);
}

/* Fewer bits take less memory and err more; every width gives the same picture with 1 and with 16 lanes. */
static void test_brick_bits(void **state)
{
    (void)state;
    static const char world[] = "demos/worlds/asteroid.karst";
    static const int bits[] = {8, 16, 32};
    static float first_m[NUM_PIXELS];
    double bytes[3], median[3], normal_deg[3];
    trace(world, 1);
    for (int i = 0; i < 3; i++) {
        /* A sanitizer looks at the host, which is the same with 1 and with 16. */
        const int first_lanes = getenv("KARST_TEST_QUICK") ? 16 : 1;
        for (int lanes = first_lanes; lanes <= 16; lanes += 15) {
            bytes[i] = draw(world, 1, false, lanes, bits[i]);
            if (lanes == first_lanes)
                memcpy(first_m, depth_m, sizeof first_m);
            else
                assert_memory_equal(first_m, depth_m, sizeof first_m);
        }
        compare();
        median[i] = share(depth_errors, 0.5);
        normal_deg[i] = share(normal_errors_deg, 0.5);
        print_message("asteroid, %d bits: %.0f bytes a brick, depth %.5f footprints, normals %.3f degrees\n", bits[i],
                      bytes[i], median[i], normal_deg[i]);
        assert_true(median[i] <= 0.1);
    }
    assert_true(bytes[0] < 0.55 * bytes[1] && bytes[2] > 1.9 * bytes[1]);
    assert_true(median[0] > median[1] && fabs(median[2] - median[1]) < 0.1 * median[1]);
    assert_true(normal_deg[0] > normal_deg[1] && fabs(normal_deg[2] - normal_deg[1]) < 0.1 * normal_deg[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_refined_hits),
        cmocka_unit_test(test_folds),
        cmocka_unit_test(test_convergence),
        cmocka_unit_test(test_brick_bits),
    };
    return cmocka_run_group_tests_name("refined hits", tests, NULL, NULL);
}
