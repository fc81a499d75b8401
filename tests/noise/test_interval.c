/* Intervals: they hold what they claim to hold, and would not without rounding outward. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

/* The rule of rounding outward, to be broken. */
static bool is_exact;
#define NOISE_MUTANT(rule) is_exact

#include "noise/interval.clh"
#include "tests/noise/random.h"

/* ---- intervals ---- */

static float random_float(void)
{
    float f = (float)random_magnitude(1e-6, 1e6);
    switch (random_below(8)) {
    case 0:
        f = (float)random_between(-8, 8);
        break;
    case 1:
        f = 0.0f;
        break;
    default:
        break;
    }
    return random_bits() & 1 ? f : -f;
}

static iv random_interval(void)
{
    float a = random_float(), b = random_below(4) ? a + (float)random_magnitude(1e-7, 1e3) : random_float();
    return a < b ? iv_of(a, b) : iv_of(b, a);
}

/* A number in an interval, often an end. */
static float random_in(iv a)
{
    switch (random_below(4)) {
    case 0:
        return a.lo;
    case 1:
        return a.hi;
    default: {
        float x = (float)((double)a.lo + random_unit() * ((double)a.hi - (double)a.lo));
        return k_min(k_max(x, a.lo), a.hi);
    }
    }
}

/* Counts results that escape: the exact one, and every float that one rounding may give. */
static long escapes(iv bound, long double exact)
{
    return !(exact * (1 - 0x1p-24L) >= (long double)bound.lo && exact * (1 - 0x1p-24L) <= (long double)bound.hi) +
           !(exact * (1 + 0x1p-24L) >= (long double)bound.lo && exact * (1 + 0x1p-24L) <= (long double)bound.hi);
}

static long interval_escapes(int count)
{
    long num = 0;
    for (int i = 0; i < count; i++) {
        iv a = random_interval(), b = random_interval();
        float x = random_in(a), y = random_in(b), k = random_float(), r = fabsf(random_float());
        long double lx = (long double)x, ly = (long double)y;
        num += escapes(iv_add(a, b), lx + ly);
        num += escapes(iv_sub(a, b), lx - ly);
        num += escapes(iv_mul(a, b), lx * ly);
        num += escapes(iv_scale(a, k), lx * (long double)k);
        num += escapes(iv_square(a), lx * lx);
        num += escapes(iv_widen(a, r), lx + (long double)(random_bits() & 1 ? r : -r));
        num += escapes(iv_sqrt(a), sqrtl(x > 0 ? lx : 0));
        num += escapes(iv_fade(a, 0.25f), lx * 0.25L) + escapes(iv_fade(a, 0.25f), lx * 0.75L);
        assert_true(-x >= iv_neg(a).lo && -x <= iv_neg(a).hi);
        assert_true(k_min(x, y) >= iv_min(a, b).lo && k_min(x, y) <= iv_min(a, b).hi);
        assert_true(k_max(x, y) >= iv_max(a, b).lo && k_max(x, y) <= iv_max(a, b).hi);
        assert_true(x >= iv_hull(a, b).lo && y >= iv_hull(a, b).lo && x <= iv_hull(a, b).hi && y <= iv_hull(a, b).hi);
        assert_true(fabsf(x) <= iv_magnitude(a));
    }
    return num;
}

static void test_intervals_hold_their_results(void **state)
{
    (void)state;
    assert_int_equal(interval_escapes(1000000), 0);
    is_exact = true;
    assert_true(interval_escapes(10000) > 100);
    is_exact = false;
    assert_true(iv_finite(iv_of(-1.0f, 3e38f)) && !iv_finite(iv_of(-INFINITY, 0.0f)) && !iv_finite(iv_of(0.0f, NAN)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_intervals_hold_their_results),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
