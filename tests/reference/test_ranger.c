/* The reference tracer's bounds against points, and its slopes against differences. */
#include "tests/reference/worlds.h"

static void test_pieces_hold_points(void **state)
{
    (void)state;
    const char *const bodies[] = {
        "return 50.0 * fbm(p / 64.0, 7) - p.y;",
        "vec3 q = p + 20.0 * vec3(noise(p / 40.0, 1), noise(p / 50.0, 2), 0.0);"
        "return ridged(q / 50.0, 5) * p.x - p.y;",
        "return floor(length(p) / 3.0) - p.y + (noise(p / 9.0) > 0.2 ? 1.0 : float(int(p.x * p.y) % 5));",
        "return mod(p.x + 3.0 * sin(p.z), 5.0) * fract(p.y / 7.0) - abs(p.z) / (1.0 + p.x * p.x);",
        "return min(length(p) - 30.0, max(p.x, 3.0 - p.y)) * smoothstep(-50.0, 50.0, p.z) + exp2(p.x / 50.0);",
        "return 9.0 * valuenoise(p / 8.0) + worley(p / 5.0).y * p.x - simplex(p / 11.0 + vec3(sin(p.z), 0.0, 0.0)) - "
        "p.y;",
        "float a = turbulence(p / 20.0, 3, 0.5, 2.0, 3); return a * a > 0.1 ? a : floor(p.x / 3.0) - a * p.y;",
        "return sqrt(abs(p.x)) - log(abs(p.y) + 0.1) * atan(p.z, p.x) + cos(length(p) / 3.0);",
    };
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        world w;
        int num_slopes = 0;
        open_body(&w, bodies[i]);
        for (int n = 0; n < 2000; n++) {
            double d[3], from = 100 * random_unit(), width = pow(10, 3 - 9 * random_unit());
            random_direction(d);
            karst_position at = {{0, 0, 0}, {0, 0, 0}};
            for (int k = 0; k < 3; k++)
                at.voxel[k] = (int64_t)(400 * random_unit()) - 200;
            int level = n % 4 - 1;
            karst_piece piece = karst_ranger_piece(w.ranger, &at, d, from, from + width, level);
            double slack = 1e-9 * (1 + fabs(piece.value.lo) + fabs(piece.value.hi)), last_t = 0, last = 0;
            for (int k = 0; k <= 8; k++) {
                double t = from + width * (k < 2 ? k : random_unit());
                karst_position there = karst_reference_place(&at, d, t);
                /* The oracle's places are coarser than the reference's. */
                double precise = karst_oracle_density(w.oracle, &there, level).precise;
                double own = karst_ranger_density(w.ranger, &at, d, t, level);
                if (isfinite(precise) && isfinite(piece.slope.lo) && fabs(precise - own) > 1e-5 * (1 + fabs(own)))
                    fail_msg("world %zu: %.12g at %.12g, the oracle has %.12g", i, own, t, precise);
                if (own < piece.value.lo - slack || own > piece.value.hi + slack)
                    fail_msg("world %zu, level %d: %.12g at %.12g is not in [%.12g, %.12g] over %g", i, level, own, t,
                             piece.value.lo, piece.value.hi, width);
                if (k > 0 && isfinite(piece.slope.lo) && fabs(t - last_t) > 1e-3 * width && width > 1e-4) {
                    double slope = (own - last) / (t - last_t), room = 1e-9 * (1 + fabs(own)) / fabs(t - last_t);
                    num_slopes++;
                    if (slope < piece.slope.lo - room || slope > piece.slope.hi + room)
                        fail_msg("world %zu, level %d: the slope %.12g near %.12g is not in [%.12g, %.12g] over %g", i,
                                 level, slope, t, piece.slope.lo, piece.slope.hi, width);
                }
                last_t = t;
                last = own;
            }
        }
        assert_true(num_slopes > 100);
        close_world(&w);
    }
}

static void test_gradients(void **state)
{
    (void)state;
    world w;
    open_body(&w, "return 50.0 * fbm(p / 64.0, 4) - p.y + 0.1 * p.x * sin(p.z / 9.0);");
    for (int n = 0; n < 300; n++) {
        double d[3], gradient[3];
        random_direction(d);
        const karst_position at = {{n * 7, -n, n * 3}, {5, 6, 7}};
        assert_true(karst_ranger_gradient(w.ranger, &at, d, 3.5, -1, gradient));
        for (int i = 0; i < 3; i++) {
            karst_position low = karst_reference_place(&at, d, 3.5), high = low;
            const double axis[3] = {i == 0, i == 1, i == 2}, h = 1e-3;
            low = karst_reference_place(&low, axis, -h);
            high = karst_reference_place(&high, axis, h);
            double central =
                (karst_oracle_density(w.oracle, &high, -1).precise - karst_oracle_density(w.oracle, &low, -1).precise) /
                (2 * h);
            if (fabs(central - gradient[i]) > 1e-5 * (1 + fabs(central)))
                fail_msg("axis %d: gradient %.12g, differences give %.12g", i, gradient[i], central);
        }
    }
    close_world(&w);
}

/* Slopes of every built-in that bends, each against differences of five values, taken in long double. Where two steps
 * do not agree there is a kink, and nothing to compare with. */
static void test_slopes_of_built_ins(void **state)
{
    (void)state;
    const char *const values[] = {
        "noise(q)",
        "noise(q.xy)",
        "fbm(q, 4)",
        "fbm(q.xz, 3, 0.6, 2.1)",
        "ridged(q, 3)",
        "billow(q, 3)",
        "turbulence(q, 3)",
        "valuenoise(q)",
        "valuenoise(q.xz)",
        "simplex(q)",
        "simplex(q.xy)",
        "worley(q).x",
        "worley(q).y",
        "worley(q.xz, 3).y - worley(q.xz, 3).x",
        "noise(q + 0.3 * simplex(q * 2.0))",
        "valuenoise(q * sin(q.x))",
        "worley(q + valuenoise(q)).x",
        "q.x * q.y + q.z",
        "q.x / (2.0 + q.y * q.y)",
        "min(q.x, q.y * q.z)",
        "max(q.x, q.y * q.z)",
        "abs(q.x * q.y)",
        "clamp(q.x * q.z, -0.5, 0.5)",
        "fract(q.x)",
        "mod(q.x + q.y * q.y, 1.5)",
        "mix(q.x, q.y, q.z)",
        "sqrt(abs(q.x) + 0.1)",
        "length(q)",
        "length(q.xz)",
        "sin(q.x * 3.0)",
        "cos(q.y * q.x)",
        "tan(q.x * 0.2)",
        "exp(q.x * 0.3)",
        "exp2(q.y * 0.3)",
        "log(abs(q.x) + 0.2)",
        "log2(abs(q.y) + 0.2)",
        "pow(abs(q.x) + 0.1, 1.7)",
        "pow(q.x, 3.0)",
        "atan(q.x)",
        "atan(q.y, q.x)",
        "atan(0.0, q.x) + q.y",
        "asin(clamp(q.x * 0.2, -0.9, 0.9))",
        "acos(clamp(q.y * 0.2, -0.9, 0.9))",
        "sinh(q.x * 0.2)",
        "cosh(q.x * 0.2)",
        "tanh(q.x)",
        "smoothstep(-2.0, 2.0, q.x + q.y)",
        "dot(q, q.zxy)",
        "normalize(q).x",
        "cross(q, q.zxy).y",
        "distance(q, vec3(1.0))",
        "smin(q.x, q.y, 1.0)",
        "smax(q.x, q.z, 1.0)",
        "sphere(q, 1.0)",
        "box(q, vec3(1.0))",
        "torus(q, 2.0, 0.5)",
        "inversesqrt(abs(q.x) + 0.5)",
        "repeat(q.x, 1.7)",
        "mirror(q.y, 1.7)",
        "q.x > 0.3 ? q.y : q.z * 2.0",
        "floor(q.x) + q.y",
        "fma(q.x, q.y, q.z)",
    };
    int num_all = 0;
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        world w;
        char body[256];
        int num_compared = 0;
        snprintf(body, sizeof body, "vec3 q = p / 8.0; return 5.0 * (%s);", values[i]);
        open_body(&w, body);
        for (int n = 0; n < 60; n++) {
            const double d[3] = {1, 0, 0};
            double gradient[3];
            karst_position at = {{0, 0, 0}, {0, 0, 0}};
            for (int k = 0; k < 3; k++) {
                at.voxel[k] = (int64_t)(40 * random_unit()) - 20;
                at.fraction[k] = (uint32_t)(0x1p32 * random_unit());
            }
            if (!karst_ranger_gradient(w.ranger, &at, d, 0, -1, gradient))
                continue;
            for (int axis = 0; axis < 3; axis++) {
                const double along[3] = {axis == 0, axis == 1, axis == 2};
                long double slopes[2];
                for (int fine = 0; fine < 2; fine++) {
                    double h = fine ? 0x1p-9 : 0x1p-7;
                    long double v[5];
                    for (int k = -2; k <= 2; k++)
                        v[k + 2] = (long double)karst_ranger_density(w.ranger, &at, along, k * h, -1);
                    slopes[fine] = (v[0] - 8 * v[1] + 8 * v[3] - v[4]) / (12 * (long double)h);
                }
                if (fabsl(slopes[0] - slopes[1]) > 1e-5L * (1 + fabsl(slopes[1])))
                    continue;
                num_compared++;
                if (fabsl((long double)gradient[axis] - slopes[1]) > 2e-5L * (1 + fabsl(slopes[1])))
                    fail_msg("%s, axis %d: the slope is %.12g, differences give %.12Lg", values[i], axis,
                             gradient[axis], slopes[1]);
            }
        }
        if (num_compared < 90)
            fail_msg("%s: %d of 180 compared", values[i], num_compared);
        num_all += num_compared;
        close_world(&w);
    }
    print_message("%d slopes of %zu values\n", num_all, sizeof values / sizeof *values);
}

/* A density of which nothing is known over a stretch is given up soon, and one on the cut of atan is known. */
static void test_cut_of_atan(void **state)
{
    (void)state;
    world w;
    const karst_position from = {{-50, 20, 0}, {0, 0, 0}};
    const double direction[3] = {0.8, -0.6, 0};
    open_body(&w, "return 3.0 - p.y - atan(0.0, p.x);");
    karst_reference_root root = shoot(&w, &from, direction, 1e3);
    assert_int_equal(root.kind, KARST_REFERENCE_SURFACE);
    if (!(fabs(root.t - (17 + 3.14159265358979) / 0.6) < 1e-6) || root.num_intervals > 1000)
        fail_msg("%.12g after %u intervals", root.t, (unsigned)root.num_intervals);
    close_world(&w);
    open_body(&w, "return 3.0 - p.y - atan(p.z - p.z * 1.0000001 + 0.0000001 * p.z, p.x);");
    root = shoot(&w, &from, direction, 1e3);
    if (root.num_intervals > 20000)
        fail_msg("%u intervals", (unsigned)root.num_intervals);
    close_world(&w);
}

/* Where two terms jump against one another the sum does not, however near the tie: floats decide for both where. */
static void test_ties(void **state)
{
    (void)state;
    static const struct {
        const char *r, *step, *sum; /* sum goes through where step jumps */
    } ties[] = {
        {"13.0 - max(abs(mod(p.x + 3.0, 26.0) - 13.0), abs(mod(p.z + 3.0, 26.0) - 13.0))", "floor(r / 3.0)",
         "floor(r / 3.0) * 2.0 + clamp(mod(r, 3.0) * 4.0 - 10.0, 0.0, 2.0) - p.y"},
        {"max(p.x, p.z) * 0.7", "floor(r)", "floor(r) + fract(r) - p.y"},
        {"length(p.xz) / 5.0", "floor(r)", "2.0 * floor(r) + 2.0 * smoothstep(0.8, 1.0, fract(r)) - p.y"},
        {"p.x + 9.0 * noise(p.xz / 7.0)", "floor(r)", "floor(r) + clamp(fract(r) * 5.0 - 4.0, 0.0, 1.0) - p.y"},
        {"p.x + 9.0 * noise(p.xz / 7.0)", "floor(r / 3.0)", "floor(r / 3.0) + max(mod(r, 3.0) - 2.0, 0.0) - p.y"},
        {"30.0 * atan(p.z, p.x) + 100.0", "floor(r / 0.7)",
         "floor(r / 0.7) + max(mod(r, 0.7) / 0.07 - 9.0, 0.0) - p.y"},
    };
    for (size_t i = 0; i < sizeof ties / sizeof *ties; i++) {
        world steps, sums;
        char body[512];
        int num_ties = 0;
        snprintf(body, sizeof body, "float r = %s; return %s;", ties[i].r, ties[i].step);
        open_body(&steps, body);
        snprintf(body, sizeof body, "float r = %s; return %s;", ties[i].r, ties[i].sum);
        open_body(&sums, body);
        for (int n = 0; n < 400; n++) {
            double d[3], low = 40 * random_unit(), high = low + 2;
            random_direction(d);
            const karst_position at = {{50 + n, 0, 37 - n}, {0, 0, 0}};
            const double first = karst_ranger_density(steps.ranger, &at, d, low, -1);
            num_ties += karst_ranger_density(steps.ranger, &at, d, high, -1) != first;
            while (high - low > 0x1p-31) {
                double middle = 0.5 * (low + high);
                *(karst_ranger_density(steps.ranger, &at, d, middle, -1) == first ? &low : &high) = middle;
            }
            for (int k = -40; k <= 40; k++) {
                const double t = low + ldexp(k, -28);
                const karst_position there = karst_reference_place(&at, d, t);
                const karst_oracle_value v = karst_oracle_density(sums.oracle, &there, -1);
                const double own = karst_ranger_density(sums.ranger, &at, d, t, -1);
                if (fabs(v.precise - (double)v.device) > 0.02 || fabs(own - v.precise) > 0.02)
                    fail_msg("world %zu: the oracle has %.9g, floats %.9g, the reference %.9g", i, v.precise,
                             (double)v.device, own);
            }
        }
        assert_true(num_ties > 40);
        close_world(&steps);
        close_world(&sums);
    }
}

/* What nothing jumps with jumps where doubles do: floats that are off beside it leave nothing undecided. */
static void test_ties_of_one(void **state)
{
    (void)state;
    static const struct {
        const char *body;
        bool is_decided;
    } worlds[] = {
        {"return fract(p.x + 9.0 * noise(p.xz / 7.0) + 1000.0) - p.y;", true},
        {"return mod(length(p.xz), 3.0) + floor(p.z / 5.0) - p.y;", true},
        {"float r = p.x + 9.0 * noise(p.xz / 7.0) + 1000.0; return fract(r) - floor(r) - p.y;", false},
        {"float r = length(p.xz); return mod(r, 3.0) < 1.0 ? -p.y : mod(r, 3.0);", false},
    };
    for (size_t i = 0; i < sizeof worlds / sizeof *worlds; i++) {
        world w;
        int num_undecided = 0;
        open_body(&w, worlds[i].body);
        const karst_position at = {{1000, 0, 41}, {0, 0, 0}};
        const double d[3] = {1, 0, 0};
        for (int k = 0; k < 400; k++) {
            double low = 0.1 * k, high = low + 0.1;
            const double least = karst_ranger_density(w.ranger, &at, d, low, -1) - 0.5;
            if (karst_ranger_density(w.ranger, &at, d, high, -1) > least)
                continue;
            while (high - low > 0x1p-31) {
                const double middle = 0.5 * (low + high);
                *(karst_ranger_density(w.ranger, &at, d, middle, -1) < least ? &high : &low) = middle;
            }
            num_undecided += !isfinite(karst_ranger_piece(w.ranger, &at, d, low - 0x1p-18, low - 0x1p-19, -1).slope.hi);
        }
        if ((num_undecided == 0) != worlds[i].is_decided)
            fail_msg("world %zu: %d undecided", i, num_undecided);
        close_world(&w);
    }
}

/* What fract and mod leave is within their cell, also where a float has jumped before or after the double would. */
static void test_rests_within_cells(void **state)
{
    (void)state;
    static const char *const bodies[] = {
        "float r = p.x + 9.0 * noise(p.xz / 7.0); return floor(r) > 1e6 ? 5.0 : fract(r);",
        "float r = 90.0 * sin(p.x / 50.0) + p.z; return floor(r) > 1e6 ? 5.0 : fract(r);",
        "float r = 90.0 * exp(p.x / 500.0); return floor(r) > 1e6 ? 5.0 : mod(r, 3.0) / 3.0;",
        "float r = 90.0 * exp(p.x / 500.0); return floor(r) > 1e6 ? 5.0 : mod(-r, -3.0) / -3.0;",
    };
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        world w;
        int num_ties = 0;
        open_body(&w, bodies[i]);
        const karst_position at = {{1000, 0, 41}, {0, 0, 0}};
        const double d[3] = {0.8, 0, 0.6};
        for (int k = 0; k < 300; k++) {
            double low = 0.1 * k, high = low + 0.1;
            const double first = karst_ranger_density(w.ranger, &at, d, low, -1);
            if (fabs(karst_ranger_density(w.ranger, &at, d, high, -1) - first) < 0.5)
                continue;
            num_ties++;
            while (high - low > 0x1p-31) {
                const double middle = 0.5 * (low + high);
                *(fabs(karst_ranger_density(w.ranger, &at, d, middle, -1) - first) < 0.5 ? &low : &high) = middle;
            }
            for (int n = -100; n <= 100; n++) {
                const double t = low + ldexp(n, -23);
                const karst_position there = karst_reference_place(&at, d, t);
                const double precise = karst_oracle_density(w.oracle, &there, -1).precise;
                const double own = karst_ranger_density(w.ranger, &at, d, t, -1);
                if (!(precise >= 0 && precise <= 1 && own >= -1e-12 && own <= 1 + 1e-12))
                    fail_msg("world %zu: the oracle has %.9g, the reference %.9g", i, precise, own);
            }
        }
        assert_true(num_ties > 5);
        close_world(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pieces_hold_points),
        cmocka_unit_test(test_gradients),
        cmocka_unit_test(test_slopes_of_built_ins),
        cmocka_unit_test(test_cut_of_atan),
        cmocka_unit_test(test_ties),
        cmocka_unit_test(test_ties_of_one),
        cmocka_unit_test(test_rests_within_cells),
    };
    return cmocka_run_group_tests_name("ranger", tests, NULL, NULL);
}
