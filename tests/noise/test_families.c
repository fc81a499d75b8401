/* Value noise, simplex noise and Worley's: what noise/bounds.clh and noise/worley.clh say of them is so. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "noise/bounds.clh"
#include "noise/simplex.clh"
#include "noise/value.clh"
#include "noise/worley.clh"
#include "tests/noise/random.h"

enum { GRADIENT, VALUE, SIMPLEX, F1, F2, NUM_FAMILIES, NUM_SMOOTH = 3 };
static const char *const names[] = {"gradient", "value", "simplex", "F1", "F2"};

static float noise_of(int family, const noise_position *p, uint seed)
{
    return family == GRADIENT  ? noise_octave(p, seed, 1.0f, 0.0f)
           : family == VALUE   ? noise_value_part(p, seed, -1)
           : family == SIMPLEX ? noise_simplex(p, seed)
                               : noise_worley_distance(p, seed, family == F2);
}

static float slope_of(int family, const noise_position *p, uint seed, int along)
{
    return family == GRADIENT  ? noise_slope(p, seed, along, 0)
           : family == VALUE   ? noise_value_part(p, seed, along)
           : family == SIMPLEX ? noise_simplex_slope(p, seed, along)
                               : noise_worley_slope(p, seed, family == F2, along);
}

static noise_limits limits_of(int family)
{
    return family == GRADIENT ? noise_gradient_limits()
           : family == VALUE  ? noise_value_limits()
                              : noise_simplex_limits();
}

static noise_jet jet_of(int family, const noise_position *p, uint seed)
{
    noise_jet jet;
    if (family == GRADIENT)
        noise_jet_at(p, seed, &jet);
    else if (family == VALUE)
        noise_value_jet_at(p, seed, &jet);
    else
        noise_simplex_jet_at(p, seed, &jet);
    return jet;
}

/* Often on or beside a cell's face, or half-way, where simplices have theirs. */
static noise_position random_position(void)
{
    noise_position p;
    for (int i = 0; i < 3; i++) {
        p.axis[i].cell = (uint)random_bits();
        p.axis[i].fraction = (uint)random_bits() & 0xffffff00u;
        if (random_below(4) == 0)
            p.axis[i].fraction = (uint)random_below(4) << 30;
        if (random_below(8) == 0)
            p.axis[i].fraction -= 0x100u;
    }
    return p;
}

static noise_position moved(noise_position p, const double by[3])
{
    for (int i = 0; i < 3; i++)
        p.axis[i] = noise_coordinate_move(p.axis[i], (float)by[i]);
    return p;
}

/* ---- suprema: at a point a derivative is linear in what stands at the nodes ---- */

/* What is looked for: the value, dn/dx, a sum of three slopes with signs u, D^3 n [u, u, u], d/dx D^2 n [u, u]. */
enum { SUP_VALUE, SUP_SLOPE, SUP_SLOPES, SUP_THIRD, SUP_THIRD_ROW, NUM_SUPS };

/* The largest g . v for one of the 12 edge gradients. */
static double best_gradient(const double v[3])
{
    double a = fabs(v[0]), b = fabs(v[1]), c = fabs(v[2]);
    return a + b + c - fmin(a, fmin(b, c));
}

/* What a gradient is multiplied with at a node that lies at p - d: phi(r^2) (g . d) derived, phi = (1/2 - r^2)^4. */
static double simplex_node(int what, const double d[3], const double u[3])
{
    double h = 0.5 - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), v[3];
    double phi = h * h * h * h, phi1 = -4 * h * h * h, phi2 = 12 * h * h, phi3 = -24 * h;
    double du = d[0] * u[0] + d[1] * u[1] + d[2] * u[2], uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    double first = 2 * phi1 * du, second = 4 * phi2 * du * du + 2 * phi1 * uu,
           third = 8 * phi3 * du * du * du + 12 * phi2 * du * uu;
    double row_second = 8 * phi3 * d[0] * du * du + 8 * phi2 * du * u[0] + 4 * uu * phi2 * d[0],
           row_first = 4 * phi2 * d[0] * du + 2 * phi1 * u[0];
    if (h <= 0)
        return 0;
    for (int i = 0; i < 3; i++)
        v[i] = what == SUP_VALUE    ? phi * d[i]
               : what <= SUP_SLOPES ? phi * u[i] + first * d[i]
               : what == SUP_THIRD  ? third * d[i] + 3 * second * u[i]
                                    : row_second * d[i] + second * (i == 0) + 2 * row_first * u[i];
    return best_gradient(v);
}

static double simplex_sup(int what, const double p[3], const double u[3])
{
    double sum = 0;
    for (int n = 0; n < 2 * 27; n++) {
        double half = n < 27 ? 0 : 0.5;
        const double d[3] = {p[0] + half - n % 3, p[1] + half - n / 3 % 3, p[2] + half - n / 9 % 3};
        sum += simplex_node(what, d, u);
    }
    return (double)NOISE_SIMPLEX_SCALE * sum;
}

static double fade_order(int order, double t)
{
    return order == 0   ? t * t * t * (t * (6 * t - 15) + 10)
           : order == 1 ? 30 * t * t * (t - 1) * (t - 1)
           : order == 2 ? 60 * t * (2 * t * t - 3 * t + 1)
                        : 60 * (6 * t * t - 6 * t + 1);
}

/* Corner values from -1 to 1. */
static double value_sup(int what, const double p[3], const double u[3])
{
    static const int orders[NUM_SUPS] = {0, 1, 1, 3, 2};
    static const double factorial[] = {1, 1, 2, 6};
    int order = orders[what], along_x = what == SUP_THIRD_ROW;
    double sum = 0;
    for (int corner = 0; corner < 8; corner++) {
        double here = 0;
        for (int a = 0; a <= order; a++)
            for (int b = 0; a + b <= order; b++) {
                const int k[3] = {a, b, order - a - b};
                double term = factorial[order];
                for (int i = 0; i < 3; i++) {
                    int o = k[i] + (i == 0 ? along_x : 0);
                    double w = fade_order(o, p[i]);
                    term *= pow(u[i], k[i]) / factorial[k[i]] * (corner >> i & 1 ? w : o ? -w : 1 - w);
                }
                here += term;
            }
        sum += fabs(here);
    }
    return sum;
}

/* Climbs from many places. */
static double search(int family, int what)
{
    double best = 0;
    for (int start = 0; start < 60; start++) {
        double p[3], u[3], here = -1, step = 1;
        for (int round = 0; round < 1200; round++) {
            double q[3], v[3];
            bool jump = round < 200 || step < 1e-6;
            for (int i = 0; i < 3; i++) {
                double turn = random_unit() * 2 - 1;
                q[i] = jump && round < 200 ? random_unit() : fmin(fmax(p[i] + step * (random_unit() * 2 - 1), 0), 1);
                v[i] = what <= SUP_SLOPE     ? (i == 0)
                       : what == SUP_SLOPES  ? (random_below(2) ? 1 : -1)
                       : random_below(3) > 0 ? (random_below(2) ? 1 : -1)
                       : here < 0            ? turn
                                             : fmin(fmax(u[i] + step * turn, -1), 1);
            }
            double found = family == VALUE ? value_sup(what, q, v) : simplex_sup(what, q, v);
            if (found > here) {
                here = found;
                memcpy(p, q, sizeof p);
                memcpy(u, v, sizeof u);
            } else if (round > 200) {
                step = fmax(step * 0.99, 1e-5);
            }
        }
        best = fmax(best, here);
    }
    return best;
}

static void test_suprema(void **state)
{
    (void)state;
    static const double true_sup[2][NUM_SUPS] = {{1, 3.75, 5.625, 360, 142.27},
                                                 {0.98853, 4.75, 11.8922, 2223.93, 837.64}};
    for (int family = VALUE; family <= SIMPLEX; family++) {
        noise_limits l = limits_of(family);
        const float limit[NUM_SUPS] = {l.sup, l.slope, l.slopes, l.third, l.third_row};
        for (int what = 0; what < NUM_SUPS; what++) {
            double found = search(family, what), known = true_sup[family - VALUE][what];
            print_message("[          ] %s %d: %.4f of %.4f, limit %.4f\n", names[family], what, found, known,
                          (double)limit[what]);
            assert_true(found <= known * 1.0001 && found > 0.97 * known);
            assert_true((double)limit[what] >= known && (double)limit[what] < 1.12 * known);
        }
    }
}

/* ---- values ---- */

static double real_value(const noise_position *p, uint seed)
{
    double sum = 0;
    for (uint corner = 0; corner < 8; corner++) {
        double weight = 1;
        vuint at[3];
        for (uint i = 0; i < 3; i++) {
            double w = fade_order(0, (double)noise_fraction(p->axis[i]));
            weight *= corner >> i & 1 ? w : 1 - w;
            at[i] = p->axis[i].cell + (corner >> i & 1);
        }
        sum += weight * (double)noise_node_value(noise_simplex_hash(at, seed));
    }
    return sum;
}

/* Every node of both lattices that is near. */
static double real_simplex(const noise_position *p, uint seed)
{
    double sum = 0;
    for (int n = 0; n < 2 * 64; n++) {
        const int step[3] = {n % 4 - 1, n / 4 % 4 - 1, n / 16 % 4 - 1};
        double d[3], square = 0;
        vuint at[3];
        for (int i = 0; i < 3; i++) {
            d[i] = (double)noise_fraction(p->axis[i]) - step[i] - (n < 64 ? 0 : 0.5);
            square += d[i] * d[i];
            at[i] = p->axis[i].cell + (uint)step[i];
        }
        if (square >= 0.5)
            continue;
        uint hash = noise_simplex_hash(at, n < 64 ? seed : seed ^ NOISE_SIMPLEX_OTHER);
        double h = 0.5 - square;
        sum += h * h * h * h *
               ((double)noise_times_x(hash, 1.0f) * d[0] + (double)noise_times_y(hash, 1.0f) * d[1] +
                (double)noise_times_z(hash, 1.0f) * d[2]);
    }
    return (double)NOISE_SIMPLEX_SCALE * sum;
}

/* Of floats against real numbers: within a third of what bounds allow. */
static void test_errors(void **state)
{
    (void)state;
    for (int family = VALUE; family <= SIMPLEX; family++) {
        double most = 0, most_slope = 0;
        for (int n = 0; n < 300000; n++) {
            noise_position p = random_position();
            uint seed = (uint)random_bits();
            double real = family == VALUE ? real_value(&p, seed) : real_simplex(&p, seed);
            most = fmax(most, fabs((double)noise_of(family, &p, seed) - real));
            noise_jet jet = jet_of(family, &p, seed);
            most = fmax(most, fabs((double)jet.value - real));
            for (int i = 0; i < 3; i++)
                most_slope = fmax(most_slope, fabs((double)(jet.gradient[i] - slope_of(family, &p, seed, i))));
        }
        print_message("[          ] %s: 2^%.1f, slopes 2^%.1f\n", names[family], log2(most), log2(most_slope));
        assert_true(most > 0 && 3 * most < (double)limits_of(family).value_error);
        assert_true(2 * most_slope < (double)limits_of(family).derivative_error);
    }
}

/* Taylor's remainder, first for the value and then for slopes, and the suprema, at random places. */
static void test_taylor(void **state)
{
    (void)state;
    const int row[3][3] = {
        {NOISE_XX, NOISE_XY, NOISE_XZ}, {NOISE_XY, NOISE_YY, NOISE_YZ}, {NOISE_XZ, NOISE_YZ, NOISE_ZZ}};
    double used[NUM_SMOOTH] = {0}, used_slope[NUM_SMOOTH] = {0};
    for (int n = 0; n < 600000; n++) {
        int family = n % NUM_SMOOTH;
        noise_limits l = limits_of(family);
        noise_position p = random_position();
        uint seed = (uint)random_bits();
        double radius = random_magnitude(0.01, 0.7), d[3];
        for (int i = 0; i < 3; i++)
            d[i] = radius * (random_below(2) ? random_unit() * 2 - 1 : random_below(2) ? 1 : -1);
        noise_position q = moved(p, d);
        noise_jet jet = jet_of(family, &p, seed);
        double taylor = (double)jet.value;
        for (int i = 0; i < 3; i++) {
            double slope = (double)jet.gradient[i];
            taylor += slope * d[i];
            for (int j = 0; j < 3; j++) {
                taylor += 0.5 * (double)jet.hessian[row[i][j]] * d[i] * d[j];
                slope += (double)jet.hessian[row[i][j]] * d[j];
            }
            double rest = fabs((double)slope_of(family, &q, seed, i) - slope),
                   allowed = 0.5 * (double)l.third_row * radius * radius + (double)l.derivative_error;
            assert_true(rest <= allowed);
            used_slope[family] = fmax(used_slope[family], rest / allowed);
            assert_true(fabs((double)slope_of(family, &q, seed, i)) <= (double)l.slope);
        }
        double value = (double)noise_of(family, &q, seed), rest = fabs(value - taylor),
               allowed = (double)l.third / 6 * radius * radius * radius + (double)l.value_error +
                         (double)l.derivative_error * radius;
        assert_true(rest <= allowed);
        used[family] = fmax(used[family], rest / allowed);
        assert_true(fabs(value) <= (double)l.sup);
    }
    for (int family = 0; family < NUM_SMOOTH; family++) {
        print_message("[          ] %s: up to %.2f and %.2f of what is allowed\n", names[family], used[family],
                      used_slope[family]);
        assert_true(used[family] > 0.15 && used_slope[family] > 0.15);
    }
}

/* No seam at cells' faces, nor where cell numbers wrap; F1 and F2 are 1-Lipschitz. */
static void test_continuity(void **state)
{
    (void)state;
    for (int n = 0; n < 300000; n++) {
        int family = n % NUM_FAMILIES;
        noise_position p = random_position(), q;
        uint seed = (uint)random_bits();
        if (random_below(4) == 0)
            p.axis[random_below(3)] = (noise_coordinate){0xffffffffu, 0xffffff00u};
        double size = random_magnitude(1e-6, family < NUM_SMOOTH ? 1e-5 : 1), d[3], length = 0;
        for (int i = 0; i < 3; i++) {
            d[i] = (double)(float)(size * (random_unit() * 2 - 1));
            length += d[i] * d[i];
        }
        q = moved(p, d);
        double change = fabs((double)noise_of(family, &p, seed) - (double)noise_of(family, &q, seed));
        double steepness = family < NUM_SMOOTH ? (double)limits_of(family).slopes : 1;
        if (change > steepness * sqrt(length) + 1e-5)
            fail_msg("%s changes by %g over %g", names[family], change, sqrt(length));
    }
}

/* ---- Worley ---- */

/* The search finds what looking at all cells finds, to the bit; also farther than it looks. */
static void test_worley_is_exact(void **state)
{
    (void)state;
    double most = 0;
    for (int n = 0; n < 100000; n++) {
        noise_position p = random_position();
        uint seed = (uint)random_bits();
        noise_worley_search s = noise_worley_search_at(&p, seed);
        noise_worley all = {.square = {64, 64}}, found;
        for (int c = 0; c < 343; c++) {
            int x = c % 7 - 3, y = c / 7 % 7 - 3, z = c / 49 - 3;
            noise_worley_cell cell = noise_worley_cell_at(&s, noise_worley_line(&s, y, z), x, y, z);
            noise_worley_take(&all, &cell, 1);
        }
        noise_worley_find(&s, 1, 1, &found);
        assert_memory_equal(&all.square, &found.square, sizeof all.square);
        assert_float_equal(noise_worley_distance(&p, seed, 0), sqrtf(all.square[0]), 0);
        assert_float_equal(noise_worley_distance(&p, seed, 1), sqrtf(all.square[1]), 0);
        assert_true(all.square[0] <= all.square[1] && sqrtf(all.square[1]) < NOISE_WORLEY_SUP);
        most = fmax(most, (double)all.square[1]);
        double length = 0;
        for (int i = 0; i < 3; i++) {
            double slope = (double)noise_worley_slope(&p, seed, 1, i);
            length += slope * slope;
        }
        assert_true(fabs(length - 1) < 1e-5);
    }
    assert_true(most > 1.1); /* cells beyond the nearest 27 were needed */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_suprema),    cmocka_unit_test(test_errors),          cmocka_unit_test(test_taylor),
        cmocka_unit_test(test_continuity), cmocka_unit_test(test_worley_is_exact),
    };
    return cmocka_run_group_tests_name("noise families", tests, NULL, NULL);
}
