/* The suprema that noise/bounds.clh relies on, found again.
 *
 * At a point p of a cell, a derivative of the noise (or a sum of some) is linear in the eight gradients: sum v_c . g_c.
 * Its supremum over all choices of the 12 edge gradients is sum m(v_c), with m the sum of the two largest |components|:
 * a function of p alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "noise/bounds.clh"
#include "tests/noise/random.h"

/* Derivatives of the fade. */
static double fade(int order, double t)
{
    switch (order) {
    case 0:
        return t * t * t * (t * (6 * t - 15) + 10);
    case 1:
        return 30 * t * t * (t - 1) * (t - 1);
    case 2:
        return 60 * t * (2 * t * t - 3 * t + 1);
    default:
        return 60 * (6 * t * t - 6 * t + 1);
    }
}

static void weights_at(const double p[3], double weight[3][2][4])
{
    for (int a = 0; a < 3; a++)
        for (int order = 0; order < 4; order++) {
            double f = fade(order, p[a]);
            weight[a][1][order] = f;
            weight[a][0][order] = order == 0 ? 1 - f : -f;
        }
}

/* Sum of the two largest magnitudes. */
static double best_gradient(const double v[3])
{
    double a = fabs(v[0]), b = fabs(v[1]), c = fabs(v[2]), least = a < b ? a : b;
    return a + b + c - (c < least ? c : least);
}

/* sup of |n| */
static double value_sup(const double p[3])
{
    double weight[3][2][4], sum = 0;
    weights_at(p, weight);
    for (int c = 0; c < 8; c++) {
        double w = weight[0][c & 1][0] * weight[1][c >> 1 & 1][0] * weight[2][c >> 2][0];
        const double v[3] = {w * (p[0] - (c & 1)), w * (p[1] - (c >> 1 & 1)), w * (p[2] - (c >> 2))};
        sum += best_gradient(v);
    }
    return sum;
}

/* sup of d.grad n, all terms of the sum at one point */
static double slope_sup_along(const double p[3], const double d[3])
{
    double weight[3][2][4], sum = 0;
    weights_at(p, weight);
    for (int c = 0; c < 8; c++) {
        const int on[3] = {c & 1, c >> 1 & 1, c >> 2};
        double w[3], w1 = 0, v[3];
        for (int a = 0; a < 3; a++)
            w[a] = weight[a][on[a]][0];
        for (int a = 0; a < 3; a++)
            w1 += d[a] * weight[a][on[a]][1] * w[(a + 1) % 3] * w[(a + 2) % 3];
        for (int a = 0; a < 3; a++)
            v[a] = w1 * (p[a] - on[a]) + w[0] * w[1] * w[2] * d[a];
        sum += best_gradient(v);
    }
    return sum;
}

static double slope_sup(const double p[3])
{
    static const double along[3] = {1, 0, 0};
    return slope_sup_along(p, along);
}

static double slopes_sup(const double p[3])
{
    double most = 0;
    for (int signs = 0; signs < 4; signs++) {
        const double d[3] = {1, signs & 1 ? 1 : -1, signs & 2 ? 1 : -1};
        most = fmax(most, slope_sup_along(p, d));
    }
    return most;
}

/* Branch and bound: whether sup <= limit over a cube of half side h around p, given a Lipschitz constant for the
 * largest coordinate's change. Only the part with x <= y <= z (if `sorted`), all others being images of it. */
typedef double (*sup_function)(const double p[3]);
static long num_boxes;
static bool is_below(sup_function sup, const double p[3], double h, double limit, double lipschitz, bool sorted)
{
    num_boxes++;
    if (sorted && (p[0] - h > p[1] + h || p[1] - h > p[2] + h))
        return true;
    double here = sup(p);
    if (here + lipschitz * h <= limit)
        return true;
    if (here > limit || h < 1e-7)
        return false;
    for (int c = 0; c < 8; c++) {
        const double part[3] = {p[0] + (c & 1 ? h : -h) / 2, p[1] + (c & 2 ? h : -h) / 2, p[2] + (c & 4 ? h : -h) / 2};
        if (!is_below(sup, part, h / 2, limit, lipschitz, sorted))
            return false;
    }
    return true;
}

/* With corner sums S0 = 1, S1 = 2 * 1.875, S2 = 2 * 5.774 of the |weights'| derivatives, |g.(p - c)| <= 2 and |g_i| <=
 * 1: |n_x| <= 2 S1 + 1, |n_xx| <= 2 S2 + 2 S1, |n_xy| <= 2 S1^2 + 2 S1. */
#define SLOPE_CRUDE (2 * 3.75 + 1)
#define CURVE_CRUDE (2 * 11.548 + 2 * 3.75 + 2 * (2 * 3.75 * 3.75 + 2 * 3.75))

static void test_first_suprema_are_proved(void **state)
{
    (void)state;
    const double centre[3] = {0.25, 0.25, 0.25}; /* by reflection, an eighth of the cell is enough */
    static const struct {
        sup_function sup;
        float limit;
        double lipschitz;
        bool sorted;
    } claims[] = {{value_sup, NOISE_SUP, 3 * SLOPE_CRUDE, true},
                  {slope_sup, NOISE_SUP_SLOPE, CURVE_CRUDE, false},
                  {slopes_sup, NOISE_SUP_SLOPES, 3 * CURVE_CRUDE, true}};
    for (size_t i = 0; i < sizeof claims / sizeof *claims; i++) {
        num_boxes = 0;
        assert_true(is_below(claims[i].sup, centre, 0.25, (double)claims[i].limit - 1e-6, claims[i].lipschitz,
                             claims[i].sorted));
        print_message("[          ] below %g: proved with %ld boxes\n", (double)claims[i].limit, num_boxes);
    }
}

static void test_first_suprema_are_not_far_off(void **state)
{
    (void)state;
    const sup_function sups[] = {value_sup, slope_sup, slopes_sup};
    const float limits[] = {NOISE_SUP, NOISE_SUP_SLOPE, NOISE_SUP_SLOPES};
    for (size_t i = 0; i < sizeof sups / sizeof *sups; i++) {
        double most = 0;
        for (int cell = 0; cell < 33 * 33 * 33; cell++) {
            const double p[3] = {cell % 33 / 64.0, cell / 33 % 33 / 64.0, cell / (33 * 33) / 64.0};
            most = fmax(most, sups[i](p));
        }
        print_message("[          ] seen %.4f, limit %.4f\n", most, (double)limits[i]);
        assert_true(most > 0.95 * (double)limits[i]);
    }
}

/* ---- third order ---- */

/* sup of D^3 n [d, d, d], or of d/dx D^2 n [d, d] */
static double third_sup(const double p[3], const double d[3], bool row)
{
    double weight[3][2][4], sum = 0;
    weights_at(p, weight);
    for (int c = 0; c < 8; c++) {
        const int on[3] = {c & 1, c >> 1 & 1, c >> 2};
        /* The weight along p + s d (and, for a row, + r e_x) as a polynomial: coefficients of s^i per axis, and of r.
         */
        double plain[4] = {1, 0, 0, 0}, along_x[4] = {0, 0, 0, 0}, v[3];
        for (int a = 0; a < 3; a++) {
            const double *w = weight[a][on[a]];
            const double by_s[4] = {w[0], w[1] * d[a], w[2] * d[a] * d[a] / 2, w[3] * d[a] * d[a] * d[a] / 6};
            const double by_r[4] = {w[1], w[2] * d[a], w[3] * d[a] * d[a] / 2, 0};
            double next[4] = {0}, next_x[4] = {0};
            for (int i = 0; i < 4; i++)
                for (int j = 0; i + j < 4; j++) {
                    next[i + j] += plain[i] * by_s[j];
                    next_x[i + j] += along_x[i] * by_s[j] + (a == 0 ? plain[i] * by_r[j] : 0);
                }
            for (int i = 0; i < 4; i++) {
                plain[i] = next[i];
                along_x[i] = next_x[i];
            }
        }
        for (int a = 0; a < 3; a++) {
            if (row) /* d/dr d^2/ds^2 of weight * (p - c + s d + r e_x)_a */
                v[a] = 2 * along_x[2] * (p[a] - on[a]) + 2 * along_x[1] * d[a] + (a == 0 ? 2 * plain[2] : 0);
            else
                v[a] = 6 * plain[3] * (p[a] - on[a]) + 6 * plain[2] * d[a];
        }
        sum += best_gradient(v);
    }
    return sum;
}

static double search_third(bool row)
{
    double most = 0;
    for (int start = 0; start < 100; start++) {
        double at[6], here = 0, step = 0.2;
        for (int i = 0; i < 6; i++)
            at[i] = i < 3 ? random_unit() : random_unit() * 2 - 1;
        for (int i = 0; i < 2000; i++) {
            double other[6];
            for (int j = 0; j < 6; j++) {
                other[j] = at[j] + (random_unit() * 2 - 1) * step;
                other[j] = fmin(fmax(other[j], j < 3 ? 0 : -1), 1);
            }
            double there = third_sup(other, other + 3, row);
            if (there > here) {
                here = there;
                for (int j = 0; j < 6; j++)
                    at[j] = other[j];
            } else {
                step = fmax(step * 0.997, 1e-4);
            }
        }
        most = fmax(most, here);
    }
    return most;
}

/* The same over boxes of p and d, by interval arithmetic in doubles (their rounding, some 1e-12, is in the limit). */
typedef struct {
    double lo, hi;
} range;

static inline range range_add(range a, range b) { return (range){a.lo + b.lo, a.hi + b.hi}; }
static inline range range_scale(range a, double k)
{
    return k < 0 ? (range){a.hi * k, a.lo * k} : (range){a.lo * k, a.hi * k};
}

static inline range range_mul(range a, range b)
{
    double p = a.lo * b.lo, q = a.lo * b.hi, r = a.hi * b.lo, s = a.hi * b.hi;
    double least = p < q ? p : q, most = p < q ? q : p;
    least = r < least ? r : least;
    most = r > most ? r : most;
    return (range){s < least ? s : least, s > most ? s : most};
}

/* d^order */
static inline range range_power(range d, int order)
{
    switch (order) {
    case 1:
        return d;
    case 2: {
        double a = d.lo * d.lo, b = d.hi * d.hi;
        return (range){d.lo < 0 && d.hi > 0 ? 0 : fmin(a, b), fmax(a, b)};
    }
    default:
        return (range){d.lo * d.lo * d.lo, d.hi * d.hi * d.hi};
    }
}

/* Derivatives of the fade for t in [0, 1/2]: there it and the first rise, the third falls, the second rises up to TURN.
 */
#define TURN 0.21132486540518712
static range range_fade(int order, range t)
{
    range f = {fade(order, t.lo), fade(order, t.hi)};
    if (order == 3 || (order == 2 && f.lo > f.hi))
        f = (range){f.hi, f.lo};
    if (order == 2 && t.lo < TURN && t.hi > TURN)
        f.hi = 5.7735026919;
    return f;
}

/* Derivative `order` of a product, from those of its factors. */
static inline range range_product(const range *a, const range *b, int order)
{
    static const double binomial[4][4] = {{1}, {1, 1}, {1, 2, 1}, {1, 3, 3, 1}};
    range sum = range_mul(a[0], b[order]);
    for (int i = 1; i <= order; i++)
        sum = range_add(sum, range_scale(range_mul(a[i], b[order - i]), binomial[order][i]));
    return sum;
}

static double range_third_sup(const range p[3], const range d[3], bool row)
{
    range along[3][2][4], along_x[2][3], offset[3][2]; /* [axis][corner][order]: weights' derivatives along d */
    double sum = 0;
    for (int a = 0; a < 3; a++)
        for (int on = 0; on < 2; on++) {
            range weight[4];
            for (int order = 0; order < 4; order++) {
                range f = range_fade(order, p[a]);
                weight[order] = on ? f : range_scale(f, -1);
                if (order == 0 && !on)
                    weight[0] = range_add(weight[0], (range){1, 1});
                along[a][on][order] = order ? range_mul(weight[order], range_power(d[a], order)) : weight[0];
            }
            for (int order = 0; a == 0 && order < 3; order++) /* for a row, one more derivative along x */
                along_x[on][order] = order ? range_mul(weight[order + 1], range_power(d[0], order)) : weight[1];
            offset[a][on] = (range){p[a].lo - on, p[a].hi - on};
        }
    for (int line = 0; line < 4; line++) {
        const int y = line & 1, z = line >> 1;
        range lines[4];
        for (int order = 0; order < 4; order++)
            lines[order] = range_product(along[1][y], along[2][z], order);
        for (int x = 0; x < 2; x++) {
            const int on[3] = {x, y, z};
            const range *weights = row ? along_x[x] : along[0][x];
            const int order = row ? 2 : 3;
            range highest = range_product(weights, lines, order), next = range_product(weights, lines, order - 1);
            double most[3];
            for (int a = 0; a < 3; a++) {
                range v = range_add(range_mul(highest, offset[a][on[a]]), range_scale(range_mul(next, d[a]), order));
                if (row && a == 0)
                    v = range_add(v, range_product(along[0][x], lines, 2));
                most[a] = -v.lo > v.hi ? -v.lo : v.hi;
            }
            sum += best_gradient(most);
        }
    }
    return sum;
}

/* Whether the supremum is below the limit for all of these p and d. Only a part of what symmetry maps to one another.
 */
static bool third_is_below(range p[3], range d[3], bool row, double limit, int depth)
{
    num_boxes++;
    if (p[1].lo > p[2].hi || (!row && p[0].lo > p[1].hi))
        return true;
    if (range_third_sup(p, d, row) <= limit)
        return true;
    if (depth > 80)
        return false;
    range *widest = p;
    double width = 0;
    for (int i = 0; i < 6; i++) {
        range *one = i < 3 ? p + i : d + i - 3;
        double here = (one->hi - one->lo) * (i < 3 ? 6 : 1);
        if (here > width) {
            width = here;
            widest = one;
        }
    }
    const range whole = *widest;
    const double middle = (whole.lo + whole.hi) / 2;
    widest->hi = middle;
    bool below = third_is_below(p, d, row, limit, depth + 1);
    *widest = (range){middle, whole.hi};
    below = below && third_is_below(p, d, row, limit, depth + 1);
    *widest = whole;
    return below;
}

static bool third_is_proved_below(bool row, double limit)
{
    num_boxes = 0;
    for (int face = 0; face < 3; face++) { /* of the cube of directions; the opposite faces give the same */
        range p[3], d[3];
        for (int a = 0; a < 3; a++) {
            p[a] = (range){0, 0.5};
            d[a] = (range){a == face ? 1 : -1, 1};
        }
        if (!third_is_below(p, d, row, limit, 0))
            return false;
    }
    return true;
}

static void test_third_order_suprema_are_proved(void **state)
{
    (void)state;
    assert_true(third_is_proved_below(false, (double)NOISE_SUP_THIRD - 1e-6));
    print_message("[          ] below %g: proved with %ld boxes\n", (double)NOISE_SUP_THIRD, num_boxes);
    assert_true(third_is_proved_below(true, (double)NOISE_SUP_THIRD_ROW - 1e-6));
    print_message("[          ] below %g: proved with %ld boxes\n", (double)NOISE_SUP_THIRD_ROW, num_boxes);
    /* the proof is no rubber stamp: it refuses less than there is, and agrees with the search at points */
    assert_false(third_is_proved_below(false, 400));
    assert_false(third_is_proved_below(true, 150));
    for (int i = 0; i < 10000; i++) {
        double p[3], d[3];
        range at[3], along[3];
        for (int a = 0; a < 3; a++) {
            p[a] = random_unit() / 2;
            d[a] = random_unit() * 2 - 1;
            at[a] = (range){p[a], p[a]};
            along[a] = (range){d[a], d[a]};
        }
        for (int row = 0; row < 2; row++)
            assert_true(fabs(third_sup(p, d, row) - range_third_sup(at, along, row)) < 1e-9);
    }
}

static void test_third_order_suprema_are_not_far_off(void **state)
{
    (void)state;
    double third = search_third(false), row = search_third(true);
    print_message("[          ] third order: %.2f, a row of it: %.2f\n", third, row);
    assert_true(third < (double)NOISE_SUP_THIRD && third > 0.85 * (double)NOISE_SUP_THIRD);
    assert_true(row < (double)NOISE_SUP_THIRD_ROW && row > 0.85 * (double)NOISE_SUP_THIRD_ROW);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_first_suprema_are_proved),
        cmocka_unit_test(test_first_suprema_are_not_far_off),
        cmocka_unit_test(test_third_order_suprema_are_proved),
        cmocka_unit_test(test_third_order_suprema_are_not_far_off),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
