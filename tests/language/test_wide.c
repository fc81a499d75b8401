/* Pairs of floats: how good they are, and that what is not finite is what IEEE says. */
#include "producers/language/ops/wide.clh"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/noise/random.h"

typedef long double real;

static real real_of(wide a) { return (real)a.hi + (real)a.lo; }

/* A pair as ops leave them, of any size. */
static wide random_pair(void)
{
    double size = random_magnitude(1e-6, 1e9) * (random_below(2) ? 1 : -1);
    float hi = (float)size;
    return wide_of(hi, (float)(size - (double)hi));
}

static void assert_close(wide got, real wanted, real size, int bits, const char *what)
{
    real error = fabsl(real_of(got) - wanted);
    if (!(error <= ldexpl(size, -bits)) || !(fabsf(got.lo) <= 0x1p-24f * fabsf(got.hi)))
        fail_msg("%s: %.20Lg is not %.20Lg", what, real_of(got), wanted);
}

static void test_precision(void **state)
{
    (void)state;
    for (int i = 0; i < 300000; i++) {
        wide a = random_pair(), b = random_pair(), c = random_pair();
        real x = real_of(a), y = real_of(b), z = real_of(c);
        assert_close(wide_multiply(a, b), x * y, fabsl(x * y), 45, "product");
        assert_close(wide_divide(a, b), x / y, fabsl(x / y), 43, "quotient");
        assert_close(wide_sqrt(wide_abs(a)), sqrtl(fabsl(x)), sqrtl(fabsl(x)), 43, "root");
        assert_close(wide_length3(a, b, c), sqrtl(x * x + y * y + z * z), sqrtl(x * x + y * y + z * z), 43, "length");
        real sum = x + y;
        if (fabsl(sum) > 0)
            assert_true(fabsl(real_of(wide_add(a, b)) - sum) <= ldexpl(fabsl(sum), -43));
    }
}

static void assert_same(wide got, wide wanted, const char *what)
{
    bool nan = isnan(got.hi) && isnan(wanted.hi);
    if ((k_as_uint(got.hi) != k_as_uint(wanted.hi) && !nan) || k_as_uint(got.lo) != k_as_uint(wanted.lo))
        fail_msg("%s: %a and %a, not %a and %a", what, (double)got.hi, (double)got.lo, (double)wanted.hi,
                 (double)wanted.lo);
}

/* Sums of a pair and a float are those of two pairs, to the sign of a zero. */
static void test_floats_are_pairs(void **state)
{
    (void)state;
    static const float odd[] = {0.0f,  -0.0f,  1.0f,     -1.0f,     0x1p-149f, -0x1p-149f,
                                3e38f, -3e38f, INFINITY, -INFINITY, NAN};
    enum { NUM_ODD = sizeof odd / sizeof *odd };
    for (uint32_t i = 0; i < 400000; i++) {
        wide a = random_pair(), b = random_pair();
        if (i % 8 == 0)
            b.hi = -a.hi;
        if (i % 8 == 1)
            b.hi = (float)random_magnitude(0x1p-26, 0x1p-22) * a.hi;
        if (i % 8 == 2)
            a.lo = (random_below(2) ? 0x1p-24f : -0x1p-24f) * a.hi; /* about half a unit in the last place */
        if (i % 8 >= 6) {
            a = wide_of(odd[random_below(NUM_ODD)], random_below(2) ? -0.0f : 0.0f);
            b.hi = i % 8 == 6 ? odd[random_below(NUM_ODD)] : b.hi;
        }
        assert_same(wide_add_float(a, b.hi), wide_add(a, wide_from(b.hi)), "pair + float");
        assert_same(wide_float_add(b.hi, a), wide_add(wide_from(b.hi), a), "float + pair");
        assert_same(wide_subtract_float(a, b.hi), wide_subtract(a, wide_from(b.hi)), "pair - float");
        assert_same(wide_float_subtract(b.hi, a), wide_subtract(wide_from(b.hi), a), "float - pair");
    }
}

static void assert_is(wide got, float wanted, const char *what)
{
    if (!(got.hi == wanted || (isnan(got.hi) && isnan(wanted))) || signbit(got.hi) != signbit(wanted) || got.lo != 0)
        fail_msg("%s: %g and %g, not %g", what, (double)got.hi, (double)got.lo, (double)wanted);
}

static void test_what_is_not_finite(void **state)
{
    (void)state;
    const float inf = INFINITY;
    wide zero = wide_from(0.0f), minus_zero = wide_from(-0.0f), third = wide_of(0x1.555556p-2f, -0x1.555556p-27f),
         minus = wide_negate(third), all = wide_from(inf), most = wide_from(3e38f);
    assert_is(wide_divide(third, zero), inf, "1/3 / 0");
    assert_is(wide_divide(minus, zero), -inf, "-1/3 / 0");
    assert_is(wide_divide(third, minus_zero), -inf, "1/3 / -0");
    assert_is(wide_divide(third, all), 0, "1/3 / inf");
    assert_is(wide_divide(minus, all), -0.0f, "-1/3 / inf");
    assert_is(wide_divide(all, third), inf, "inf / 1/3");
    assert_is(wide_divide(most, wide_from(0.1f)), inf, "3e38 / 0.1");
    assert_is(wide_add(all, third), inf, "inf + 1/3");
    assert_is(wide_subtract(third, all), -inf, "1/3 - inf");
    assert_is(wide_add(most, most), inf, "3e38 + 3e38");
    assert_is(wide_multiply(all, minus), -inf, "inf * -1/3");
    assert_is(wide_multiply(most, most), inf, "3e38 * 3e38");
    assert_is(wide_sqrt(all), inf, "root of inf");
    assert_is(wide_sqrt(minus), 0, "root of -1/3");
    assert_is(wide_min(all, third).hi == third.hi ? zero : all, 0, "min(inf, 1/3) is 1/3");
    assert_true(isnan(wide_divide(zero, zero).hi) && isnan(wide_subtract(all, all).hi));
    assert_true(isnan(wide_multiply(all, zero).hi) && isnan(wide_add(wide_from(NAN), third).hi));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_precision), cmocka_unit_test(test_floats_are_pairs),
                                       cmocka_unit_test(test_what_is_not_finite)};
    return cmocka_run_group_tests_name("pairs of floats", tests, NULL, NULL);
}
