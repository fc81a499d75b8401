/* The reference tracer: against closed forms; against a root finder of another kind on worlds of noise; levels,
 * threads, and what it says of bad settings. */
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

#include "tests/reference/worlds.h"

/* ---- closed forms ---- */

#define AT_X 37.25
#define AT_Y 11.5
#define AT_Z -20.75
static const karst_position start = {{37, 11, -21}, {0x40000000u, 0x80000000u, 0x40000000u}};

/* The first t where a ray from the start enters; INFINITY if never. */
static double sphere_form(const double d[3])
{
    double b = AT_X * d[0] + AT_Y * d[1] + AT_Z * d[2], c = AT_X * AT_X + AT_Y * AT_Y + AT_Z * AT_Z - 15.0 * 15.0;
    double under = b * b - c;
    return under > 0 && b < 0 ? c / (-b + sqrt(under)) : INFINITY;
}

static double plane_form(const double d[3])
{
    /* 0.6 x + 0.8 y = 3 */
    double height = 0.6 * AT_X + 0.8 * AT_Y - 3, fall = 0.6 * d[0] + 0.8 * d[1];
    return fall < 0 ? height / -fall : INFINITY;
}

static double box_form(const double d[3])
{
    const double at[3] = {AT_X, AT_Y, AT_Z}, half[3] = {9, 4, 12};
    double enter = 0, leave = INFINITY;
    for (int i = 0; i < 3; i++) {
        double a = (-half[i] - at[i]) / d[i], b = (half[i] - at[i]) / d[i];
        enter = fmax(enter, fmin(a, b));
        leave = fmin(leave, fmax(a, b));
    }
    return enter < leave ? enter : INFINITY;
}

/* Axis y, radii 14 and 4: the least positive root of its quartic, found on its own derivative's pieces. */
static double torus_value(const double d[3], double t)
{
    double x = AT_X + t * d[0], y = AT_Y + t * d[1], z = AT_Z + t * d[2];
    double sum = x * x + y * y + z * z + 14.0 * 14.0 - 4.0 * 4.0;
    return 4 * 14.0 * 14.0 * (x * x + z * z) - sum * sum; /* positive inside */
}
static double torus_form(const double d[3])
{
    double previous = 0;
    for (int i = 1; i <= 200000; i++) {
        double t = i * 0.0005;
        if (torus_value(d, t) <= 0) {
            previous = t;
            continue;
        }
        double lo = previous, hi = t;
        for (int k = 0; k < 60; k++) {
            double middle = 0.5 * (lo + hi);
            if (torus_value(d, middle) > 0)
                hi = middle;
            else
                lo = middle;
        }
        return hi;
    }
    return INFINITY;
}

static void check_form(const char *name, const char *body, double (*form)(const double d[3]), int num_rays,
                       double near_graze)
{
    world w;
    int hits = 0, misses = 0;
    open_body(&w, body);
    for (int n = 0; n < num_rays; n++) {
        /* aimed at the object's surroundings */
        const double at[3] = {AT_X, AT_Y, AT_Z};
        double aim[3], d[3], length = 0;
        random_direction(aim);
        for (int i = 0; i < 3; i++) {
            d[i] = 22 * aim[i] - at[i];
            length += d[i] * d[i];
        }
        for (int i = 0; i < 3; i++)
            d[i] /= sqrt(length);
        double expected = form(d);
        karst_reference_root root = shoot(&w, &start, d, 100);
        if (expected > 100) {
            misses++;
            if (root.kind != KARST_REFERENCE_MISS)
                fail_msg("%s, ray %d: a hit at %.12g, where there is nothing", name, n, root.t);
            continue;
        }
        hits++;
        if (root.kind != KARST_REFERENCE_SURFACE || fabs(root.t - expected) > 1e-9 * expected + near_graze)
            fail_msg("%s, ray %d: kind %d at %.12g, not %.12g", name, n, root.kind, root.t, expected);
    }
    print_message("%s: %d hits and %d misses\n", name, hits, misses);
    assert_true(hits > num_rays / 8);
    close_world(&w);
}

static void test_closed_forms(void **state)
{
    (void)state;
    check_form("sphere", "return 15.0 - length(p);", sphere_form, 400, 1e-8);
    check_form("sphere, squared", "return 225.0 - dot(p, p);", sphere_form, 400, 1e-8);
    check_form("plane", "return 3.0 - 0.6 * p.x - 0.8 * p.y;", plane_form, 400, 2e-6); /* 0.6 and 0.8 are floats */
    check_form("box", "vec3 q = abs(p) - vec3(9.0, 4.0, 12.0); return -max(q.x, max(q.y, q.z));", box_form, 400, 1e-8);
    check_form("box, as a distance",
               "vec3 q = abs(p) - vec3(9.0, 4.0, 12.0);"
               "return -(length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0));",
               box_form, 400, 1e-8);
    check_form("torus", "return 4.0 - length(vec2(length(p.xz) - 14.0, p.y));", torus_form, 100, 1e-8);
}

static void test_far_out(void **state)
{
    (void)state;
    /* The same ball at 10^15 m: positions are exact, so the answer is the same. */
    world w;
    open_body(&w, "return 15.0 - length(p - vec3(1e15, 0.0, -1e15));");
    karst_position from = start;
    from.voxel[0] += 1000000000000000;
    from.voxel[2] -= 1000000000000000;
    int hits = 0;
    for (int n = 0; n < 200; n++) {
        double d[3];
        random_direction(d);
        double expected = sphere_form(d);
        karst_reference_root root = shoot(&w, &from, d, 100);
        assert_int_equal(root.kind, expected < 100 ? KARST_REFERENCE_SURFACE : KARST_REFERENCE_MISS);
        hits += expected < 100;
        if (expected < 100 && fabs(root.t - expected) > 1e-7)
            fail_msg("at 1e15 m, ray %d: %.12g, not %.12g", n, root.t, expected);
    }
    assert_true(hits > 3);
    close_world(&w);
}

static void test_thin_things(void **state)
{
    (void)state;
    /* Much thinner than any step that a marcher would take. */
    world w;
    open_body(&w, "return 1e-6 - length(p - vec3(50.0, 0.0, 0.0));");
    const karst_position from = {{0, 0, 0}, {0, 0, 0}};
    const double along[3] = {1, 0, 0};
    karst_reference_root root = shoot(&w, &from, along, 1e4);
    assert_int_equal(root.kind, KARST_REFERENCE_SURFACE);
    assert_true(fabs(root.t - (50 - 1e-6)) < 1e-7);
    close_world(&w);
    open_body(&w, "return 1e-7 - abs(p.y + 123.0);");
    const double down[3] = {0.6, -0.8, 0};
    root = shoot(&w, &from, down, 1e4);
    assert_int_equal(root.kind, KARST_REFERENCE_SURFACE);
    assert_true(fabs(root.t - 123 / 0.8) < 1e-6);
    close_world(&w);
    /* Touched, but not entered. */
    open_body(&w, "return 5.0 - length(p - vec3(50.0, 5.0, 0.0));");
    root = shoot(&w, &from, along, 1e4);
    assert_int_equal(root.kind, KARST_REFERENCE_MISS);
    close_world(&w);
    open_body(&w, "return 5.0 - length(p);");
    root = shoot(&w, &from, along, 1e4);
    assert_int_equal(root.kind, KARST_REFERENCE_INSIDE);
    assert_true(root.t == 0);
    close_world(&w);
}

/* ---- jumps and steps ---- */

static void test_jumps(void **state)
{
    (void)state;
    world w;
    const karst_position from = {{0, 100, 0}, {0, 0, 0}};
    const double down[3] = {0.6, -0.8, 0};
    /* A staircase; the ray goes down it on the treads. */
    open_body(&w, "return -10.0 * floor(p.x / 10.0) + 40.5 - p.y;");
    karst_reference_root root = shoot(&w, &from, down, 1e4);
    assert_int_equal(root.kind, KARST_REFERENCE_SURFACE);
    /* x = 0.6 t, y = 100 - 0.8 t; the tread of x in [10 k, 10 k + 10) is at 40.5 - 10 k. */
    double expected = INFINITY;
    for (int k = 0; k < 100 && expected > 1e9; k++) {
        double t = (59.5 + 10 * k) / 0.8, enter = 10 * k / 0.6, leave = (10 * k + 10) / 0.6;
        if (t < leave)
            expected = fmax(t, enter);
    }
    if (!(fabs(root.t - expected) < 1e-5))
        fail_msg("staircase: %.12g, not %.12g", root.t, expected);
    close_world(&w);
    /* A wall that exists only by a comparison. */
    open_body(&w, "return p.x > 33.3 ? 1.0 : -1.0;");
    root = shoot(&w, &from, down, 1e4);
    assert_int_equal(root.kind, KARST_REFERENCE_SURFACE);
    if (!(fabs(root.t - 33.3 / 0.6) < 1e-4))
        fail_msg("wall: %.12g", root.t);
    close_world(&w);
    /* fract jumps, the sum does not: nothing is to be seen of it. */
    open_body(&w, "float k = p.x / 7.0; return 20.0 + 7.0 * (k - fract(k) + fract(k)) - p.y;");
    root = shoot(&w, &from, down, 1e4);
    assert_int_equal(root.kind, KARST_REFERENCE_SURFACE);
    if (!(fabs(root.t - 80 / 1.4) < 1e-5))
        fail_msg("slope by parts: %.12g", root.t);
    close_world(&w);
}

/* ---- a second root finder ---- */

/* Samples much denser than the finest octave, and bisection; by the oracle. */
static double dense_root(world *w, const karst_position *from, const double d[3], double t_max, double step, int level)
{
    double previous = 0;
    for (double t = step; t < t_max; t += step) {
        karst_position at = karst_reference_place(from, d, t);
        if (karst_oracle_density(w->oracle, &at, level).precise <= 0) {
            previous = t;
            continue;
        }
        double lo = previous, hi = t;
        while (hi - lo > 1e-9 * hi) {
            double middle = 0.5 * (lo + hi);
            at = karst_reference_place(from, d, middle);
            if (karst_oracle_density(w->oracle, &at, level).precise > 0)
                hi = middle;
            else
                lo = middle;
        }
        return hi;
    }
    return INFINITY;
}

static void check_dense(const char *name, const char *body, double step, double within, int num_rays)
{
    world w;
    int hits = 0, nearer = 0;
    open_body(&w, body);
    for (int n = 0; n < num_rays; n++) {
        double d[3];
        random_direction(d);
        karst_position from = {{(int64_t)(2000 * random_unit()), 60, (int64_t)(2000 * random_unit())}, {0, 0, 0}};
        if (karst_oracle_density(w.oracle, &from, -1).precise > 0)
            continue;
        karst_reference_root root = shoot(&w, &from, d, 150);
        double dense = dense_root(&w, &from, d, 150, step, -1);
        hits += dense < 150;
        if (root.kind == KARST_REFERENCE_UNRESOLVED)
            fail_msg("%s, ray %d: given up at %.12g after %lu intervals", name, n, root.t,
                     (unsigned long)root.num_intervals);
        double t = root.kind == KARST_REFERENCE_MISS ? INFINITY : root.t;
        /* Samples may step over what intervals find; never the other way round. */
        if (t > dense + within)
            fail_msg("%s, ray %d: %.12g, but samples find %.12g", name, n, t, dense);
        if (t < dense - within) {
            nearer++;
            karst_position past = karst_reference_place(&from, d, t * (1 + 2e-9) + 0x1p-28);
            karst_position before = karst_reference_place(&from, d, t * (1 - 2e-9) - 0x1p-28);
            double after = karst_oracle_density(w.oracle, &past, -1).precise;
            double ahead = karst_oracle_density(w.oracle, &before, -1).precise;
            if (!(after > -1e-6 && ahead < 1e-6 && dense - t > step * 1e-3))
                fail_msg("%s, ray %d: %.12g is no root (%g, %g); samples find %.12g", name, n, t, ahead, after, dense);
        }
    }
    print_message("%s: %d hits, %d of them between samples\n", name, hits, nearer);
    assert_true(hits > num_rays / 8);
    assert_true(nearer < num_rays / 20 + 1);
    close_world(&w);
}

static void test_noise_worlds(void **state)
{
    (void)state;
    check_dense("fbm", "return 50.0 * fbm(p / 64.0, 5) - p.y * 0.3;", 0.02, 1e-6, 80);
    check_dense("warped",
                "vec3 q = p + 20.0 * vec3(noise(p / 40.0, 1), noise(p / 50.0, 2), noise(p / 60.0, 3));"
                "return 30.0 * fbm(q / 50.0, 4) - p.y * 0.2;",
                0.02, 1e-6, 60);
    check_dense("ridged and sines", "return 30.0 * ridged(p / 80.0, 4, 0.5, 2.0, 1) - p.y + 8.0 * sin(p.x / 3.0);",
                0.02, 1e-6, 60);
    check_dense("caves",
                "float a = noise(p / 30.0, 1), b = noise(p / 30.0, 2);"
                "return min(40.0 - abs(p.y), 20.0 * (a * a + b * b) - 1.0) + 0.3 * noise(p / 2.0, 4);",
                0.02, 1e-6, 60);
    check_dense("other noises",
                "return 20.0 * worley(p / 40.0).x - 6.0 * simplex(p / 30.0) + 9.0 * valuenoise(p / 25.0) - 0.3 * p.y;",
                0.02, 1e-6, 60);
    check_dense("functions",
                "return 10.0 * exp(-p.y / 30.0) * (0.4 + cos(p.x / 9.0) * cos(p.z / 7.0))"
                " - sqrt(abs(p.y)) + atan(p.x, 30.0) - log(1.0 + p.z * p.z / 100.0);",
                0.02, 1e-6, 60);
}

/* ---- pictures ---- */

static char world_path[] = "/tmp/karst-reference-XXXXXX.karst";

static void write_world(const char *text)
{
    FILE *file = fopen(world_path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void test_levels(void **state)
{
    (void)state;
    /* An octave that is gone where voxels are 2 m or wider: the ground is rough only near the camera. */
    write_world("/*{ \"voxel\": 1, \"view\": 4000,\n"
                "  \"camera\": { \"position\": [\"0\", \"20\", \"0\"], \"pitch\": -10 } }*/\n"
                "float density(vec3 p) { return noise(p / 4.0) - p.y; }");
    enum { WIDTH = 24, HEIGHT = 18 };
    karst_reference_hit hits[WIDTH * HEIGHT], full[WIDTH * HEIGHT], again[WIDTH * HEIGHT];
    karst_error error = {0};
    karst_reference_stats stats;
    karst_reference_config config = {.world = world_path, .width_px = WIDTH, .height_px = HEIGHT, .num_threads = 3};
    assert_true(karst_reference_trace(&config, hits, NULL, NULL, &stats, &error));
    assert_int_equal(stats.num_unresolved, 0);
    config.num_threads = 1;
    assert_true(karst_reference_trace(&config, again, NULL, NULL, NULL, &error));
    config.footprint = KARST_FOOTPRINT_NONE;
    assert_true(karst_reference_trace(&config, full, NULL, NULL, NULL, &error));
    int flat = 0, rough = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        assert_memory_equal(&hits[i].t_m, &again[i].t_m, sizeof hits[i].t_m);
        if (hits[i].kind != KARST_REFERENCE_SURFACE)
            continue;
        int level = (int)floor(log2(hits[i].footprint_m));
        assert_int_equal(hits[i].level, level > 0 ? level : 0);
        flat += hits[i].level >= 1 && hits[i].normal[1] == 1;
        assert_true(hits[i].level < 1 || hits[i].normal[1] == 1);
        rough += full[i].kind == KARST_REFERENCE_SURFACE && full[i].normal[1] < 0.9999;
    }
    assert_true(flat > 50 && rough > 50);
    unlink(world_path);
}

static bool never(void *user, double share)
{
    ++*(int *)user;
    return share > 2;
}

static void test_refusals(void **state)
{
    (void)state;
    write_world("float density(vec3 p) { return -p.y; }");
    karst_reference_hit hit;
    const karst_reference_config bad[] = {
        {.width_px = 1, .height_px = 1},
        {.world = world_path, .width_px = 0, .height_px = 1},
        {.world = world_path, .width_px = 1, .height_px = 1, .detail_px = 0.1},
        {.world = world_path, .width_px = 1, .height_px = 1, .view_distance_m = -1},
        {.world = world_path, .width_px = 1, .height_px = 1, .num_threads = 1000},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        karst_error error = {0};
        assert_false(karst_reference_trace(&bad[i], &hit, NULL, NULL, NULL, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    karst_error error = {0};
    karst_reference_config config = {.world = "nowhere.karst", .width_px = 1, .height_px = 1};
    assert_false(karst_reference_trace(&config, &hit, NULL, NULL, NULL, &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    enum { LARGE = 600 };
    karst_reference_hit *hits = calloc(LARGE * LARGE, sizeof *hits);
    int calls = 0;
    error = (karst_error){0};
    config = (karst_reference_config){.world = world_path, .width_px = LARGE, .height_px = LARGE};
    assert_false(karst_reference_trace(&config, hits, never, &calls, NULL, &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_int_equal(calls, 1);
    free(hits);
    unlink(world_path);
}

/* A ray that would need more intervals than allowed says so. */
static void test_gives_up(void **state)
{
    (void)state;
    world w;
    open_body(&w, "return 50.0 * fbm(p / 64.0, 7) - p.y;");
    const karst_position from = {{0, 100, 0}, {0, 0, 0}};
    karst_reference_ray ray = {.direction = {0.6, -0.8, 0}, .t_max = 1e4, .max_intervals = 5};
    karst_reference_root root = karst_reference_first(w.ranger, &from, &ray);
    assert_int_equal(root.kind, KARST_REFERENCE_UNRESOLVED);
    close_world(&w);
}

int main(void)
{
    int file = mkstemps(world_path, 6);
    if (file >= 0)
        close(file);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_forms),
        cmocka_unit_test(test_far_out),
        cmocka_unit_test(test_thin_things),
        cmocka_unit_test(test_jumps),
        cmocka_unit_test(test_noise_worlds),
        cmocka_unit_test(test_levels),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_gives_up),
    };
    return cmocka_run_group_tests_name("reference", tests, NULL, NULL);
}
