/* The reference tracer: against closed forms; against a root finder of another kind on worlds of noise; its bounds
 * against points; levels, threads, and what it says of bad settings. */
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

#include "karst/reference.h"
#include "producers/language/oracle/oracle.h"
#include "producers/density/world_file.h"
#include "reference/trace.h"

/* ---- worlds from text ---- */

typedef struct {
    karst_world_file *file;
    karst_ranger *ranger;
    karst_oracle *oracle;
    karst_number values[64];
} world;

static void open_text(world *w, const char *text)
{
    karst_error error = {0};
    char *diagnostics = NULL;
    w->file = karst_world_file_compile("test.karst", text, strlen(text), NULL, 0, &diagnostics, &error);
    if (!w->file)
        fail_msg("%s\n%s", error.message, diagnostics ? diagnostics : "");
    free(diagnostics);
    const karst_program_graph *program = w->file->program;
    for (uint32_t i = 0; i < program->num_parameters; i++)
        w->values[i] = program->parameters[i].value;
    w->ranger = karst_ranger_create(program, w->values, program->header.seed, &error);
    w->oracle =
        karst_oracle_create(&program->world, w->values, program->header.seed, program->header.voxel_log2_m, &error);
    assert_non_null(w->ranger);
    assert_non_null(w->oracle);
}

static void close_world(world *w)
{
    karst_oracle_destroy(w->oracle);
    karst_ranger_destroy(w->ranger);
    karst_world_file_destroy(w->file);
}

/* float density(vec3 p) with voxels of a metre. */
static void open_body(world *w, const char *body)
{
    char text[4096];
    snprintf(text, sizeof text, "/*{ \"voxel\": 1 }*/\nfloat density(vec3 p) { %s }\n", body);
    open_text(w, text);
}

static uint32_t random_state = 1;
static double random_unit(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) * 0x1p-24;
}

static void random_direction(double d[3])
{
    double square;
    do {
        square = 0;
        for (int i = 0; i < 3; i++) {
            d[i] = 2 * random_unit() - 1;
            square += d[i] * d[i];
        }
    } while (square > 1 || square < 0.01);
    for (int i = 0; i < 3; i++)
        d[i] /= sqrt(square);
}

static karst_reference_root shoot(world *w, const karst_position *from, const double d[3], double t_max)
{
    karst_reference_ray ray = {.direction = {d[0], d[1], d[2]}, .t_max = t_max, .max_intervals = 1u << 20};
    return karst_reference_first(w->ranger, from, &ray);
}

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

/* ---- bounds ---- */

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
        cmocka_unit_test(test_pieces_hold_points),
        cmocka_unit_test(test_gradients),
        cmocka_unit_test(test_levels),
        cmocka_unit_test(test_slopes_of_built_ins),
        cmocka_unit_test(test_cut_of_atan),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_gives_up),
    };
    return cmocka_run_group_tests_name("reference", tests, NULL, NULL);
}
