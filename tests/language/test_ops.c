/* The device vocabulary against doubles: every float with KARST_FULL=1 (some minutes), each 257th otherwise; ops on
 * ints and awkward floats against what graph.h says. Errors are those that bounds rely on (interval_ops.clh). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "producers/language/ops/ops.clh"

#define PI 3.14159265358979323846

static uint64_t stride(void)
{
    const char *full = getenv("KARST_FULL");
    return full && *full == '1' ? 1 : 257;
}

static double max_double(double a, double b) { return a > b ? a : b; }

static double ulps(double got, double exact)
{
    int exponent;
    if (exact == 0)
        return got == 0 ? 0 : 1e9;
    frexp(exact, &exponent);
    return fabs(got - exact) / ldexp(1, exponent - 24);
}

static double clamp_double(double a, double lo, double hi) { return a < lo ? lo : a > hi ? hi : a; }

static void test_functions_of_one_float(void **state)
{
    (void)state;
    double sin_error = 0, cos_error = 0, exp_ulps = 0, log_ulps = 0, largest = 0;
    for (uint64_t i = 0; i <= 0xffffffffu; i += stride()) {
        float a = k_as_float((uint)i), s = op_sin(a), c = op_cos(a);
        double d = (double)a;
        largest = max_double(largest, max_double(fabs((double)s), fabs((double)c)));
        assert_true(s == s && c == c); /* total */
        if (isnan(a))
            continue;
        if (fabs(d) <= 0x1p22) {
            sin_error = max_double(sin_error, fabs((double)s - sin(d)));
            cos_error = max_double(cos_error, fabs((double)c - cos(d)));
        }
        exp_ulps = max_double(exp_ulps, ulps((double)op_exp2(a), exp2(clamp_double(d, -126, 126))));
        log_ulps = max_double(log_ulps, ulps((double)op_log(a), log(clamp_double(d, 0x1p-126, 0x1.fffffep127))));
    }
    print_message("sin 2^%.2f, cos 2^%.2f, exp2 %.3f ulp, log %.3f ulp\n", log2(sin_error), log2(cos_error), exp_ulps,
                  log_ulps);
    assert_true(sin_error < 0x1p-23 && cos_error < 0x1p-23 && largest <= 1);
    assert_true(exp_ulps < 1 && log_ulps < 1);
    assert_true(op_sin(-1.25f) == -op_sin(1.25f) && op_cos(-1.25f) == op_cos(1.25f));
    for (int k = -126; k <= 126; k++)
        assert_true(op_exp2((float)k) == ldexpf(1, k));
    assert_true(op_log(1) == 0 && op_log(0) == op_log(0x1p-126f) && op_log(-3) == op_log(0));
    assert_true(op_exp2(1e9f) == 0x1p126f && op_exp2(-INFINITY) == 0x1p-126f);
}

static void test_turns(void **state)
{
    (void)state;
    double worst = 0;
    for (uint64_t i = 0; i <= 0xffffffffu; i += stride()) {
        double angle = (double)i * (2 * PI * 0x1p-32);
        worst = max_double(worst, fabs((double)op_sin_turns((uint)i) - sin(angle)));
        worst = max_double(worst, fabs((double)op_cos_turns((uint)i) - cos(angle)));
    }
    print_message("turns 2^%.2f\n", log2(worst));
    assert_true(worst < 0x1.2p-23);
    assert_true(op_sin_turns(0) == 0 && op_sin_turns(0x40000000u) == 1 && op_cos_turns(0x80000000u) == -1);
}

static uint state_;
static uint next(void)
{
    state_ = state_ * 1664525u + 1013904223u;
    return state_ ^ (state_ >> 15);
}

static void test_angles(void **state)
{
    (void)state;
    double worst = 0;
    state_ = 1;
    for (long i = 0; i < (stride() == 1 ? 200000000 : 3000000); i++) {
        float y = k_as_float(next()), x = k_as_float(next());
        if (i & 1)
            y = (float)(int)next() * 1e-9f, x = (float)(int)next() * 1e-9f;
        if (!isfinite(x) || !isfinite(y))
            continue;
        double exact = x == 0 && y == 0 ? 0 : atan2((double)y, x == 0 ? 0.0 : (double)x),
               error = fabs((double)op_atan(y, x) - exact);
        worst = max_double(worst, y == 0 && x < 0 ? fabs((double)op_atan(y, x) - PI) : error);
    }
    print_message("atan 2^%.2f\n", log2(worst));
    assert_true(worst < 0x1p-21);
    assert_true(op_atan(0, 0) == 0 && op_atan(-0.0f, -0.0f) == 0 && op_atan(0, 1) == 0);
    assert_true(op_atan(0, -1) == op_atan(-0.0f, -1) && fabs((double)op_atan(0, -1) - PI) < 1e-6);
}

/* Colours leave out a side of it, so its ends are exact; and bounds rely on how far it rounds. */
static void test_mix(void **state)
{
    (void)state;
    const float values[] = {0, 1, -1, 0.3f, -1e-30f, 1e20f, -1e20f, 3e38f, -3e38f, 0x1p-126f, 12345.678f, -0.001f};
    const int num_values = (int)(sizeof values / sizeof *values);
    double worst = 0;
    for (int i = 0; i < num_values; i++)
        for (int k = 0; k < num_values; k++) {
            const float a = values[i], b = values[k];
            assert_true(op_mix(a, b, 0) == a && op_mix(a, b, 1) == b);
            assert_true(op_mix(a, 0, 0) == a && op_mix(0, b, 1) == b); /* what is left out is 0 */
            for (float t = 0x1p-7f; t < 1; t += 0x1.8p-7f) {
                double share = (double)a * (1 - (double)t), exact = share + (double)b * (double)t;
                double allowed = 0x1p-24 * (fabs(share) * (1 + 0x1p-20) + fabs(exact) * (1 + 0x1p-20)) + 0x1p-149;
                double error = fabs((double)op_mix(a, b, t) - exact);
                assert_true(error <= allowed + 0x1p-52 * (fabs(share) + fabs(exact)));
                worst = max_double(worst, error / allowed);
            }
        }
    print_message("mix: %.2f of what it may round\n", worst);
    assert_true(worst > 0.3);
}

static void test_awkward_floats(void **state)
{
    (void)state;
    assert_true(op_sqrt(-4) == 0 && op_sqrt(-INFINITY) == 0 && op_sqrt(4) == 2 && isnan(op_sqrt(NAN)));
    assert_true(op_fract(-1e-10f) == OP_BELOW_ONE && op_fract(2.75f) == 0.75f && op_fract(-0.25f) == 0.75f);
    assert_true(op_mod(5, 0) == 0 && op_mod(-1, 3) == 2 && op_mod(7, -3) == -2 && op_mod(5.5f, 2) == 1.5f);
    assert_true(op_ceil(1.25f) == 2 && op_ceil(-1.25f) == -1 && op_rint(2.5f) == 2 && op_rint(-3.5f) == -4);
    assert_true(op_mix(2, 4, 0.25f) == 2.5f && op_length3(2, 3, 6) == 7 && op_length2(3, 4) == 5 &&
                op_length4(1, 1, 1, 1) == 2);
    assert_true(op_min(1, NAN) == 1 && isnan(op_min(NAN, 1)) && op_max(2, 3) == 3);
    assert_int_equal(op_float_to_int(NAN), 0);
    assert_int_equal(op_float_to_int(-2.75f), -2);
    assert_int_equal(op_float_to_int(3e9f), 0x7fffffff);
    assert_int_equal(op_float_to_int(-3e9f), -0x7fffffff - 1);
    assert_int_equal(op_float_to_int(-0x1p31f), -0x7fffffff - 1);
    assert_int_equal((uint)op_float_to_uint(3e9f), 3000000000u);
    assert_int_equal((uint)op_float_to_uint(INFINITY), 0xffffffffu);
    assert_int_equal(op_float_to_uint(-1), 0);
    assert_int_equal(op_float_to_uint(NAN), 0);
    assert_int_equal(op_float_to_bits(k_as_float(0xffc01234u)), 0x7fc00000);
    assert_int_equal(op_float_to_bits(-0.0f), -0x7fffffff - 1);
    assert_true(op_bool_to_float(-1) == 1 && op_bool_to_float(0) == 0 && op_uint_to_float(-1) == 0x1p32f);
}

/* Against wider integers. */
static void test_ints(void **state)
{
    (void)state;
    static const int awkward[] = {0, 1, -1, 2, -2, 31, 32, 33, 0x7fffffff, -0x7fffffff - 1, 0x12345678, -0x12345678};
    state_ = 2;
    for (int i = 0; i < 200000; i++) {
        int a = next() & 1 ? awkward[next() % 12] : (int)next(), b = next() & 1 ? awkward[next() % 12] : (int)next();
        int64_t la = a, lb = b;
        uint ua = (uint)a, ub = (uint)b;
        assert_int_equal(op_int_add(a, b), (int)(uint)(la + lb));
        assert_int_equal(op_int_subtract(a, b), (int)(uint)(la - lb));
        assert_int_equal(op_int_multiply(a, b), (int)(uint)(ua * ub));
        assert_int_equal(op_int_divide(a, b), b ? (int)(uint)(la / lb) : 0);
        assert_int_equal(op_int_modulo(a, b), b ? (int)(la % lb) : 0);
        assert_int_equal((uint)op_uint_divide(a, b), ub ? ua / ub : 0);
        assert_int_equal((uint)op_uint_modulo(a, b), ub ? ua % ub : 0);
        assert_int_equal((uint)op_shift_left(a, b), ua << (ub & 31));
        assert_int_equal((uint)op_uint_shift_right(a, b), ua >> (ub & 31));
        assert_int_equal(op_int_shift_right(a, b), (int)(la >> (ub & 31)));
        assert_int_equal(op_less_int(a, b), -(a < b));
        assert_int_equal(op_less_uint(a, b), -(ua < ub));
        assert_int_equal(op_less_equal_uint(a, b), -(ua <= ub));
        assert_int_equal(op_equal_int(a, b), -(a == b));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_functions_of_one_float),
        cmocka_unit_test(test_turns),
        cmocka_unit_test(test_angles),
        cmocka_unit_test(test_mix),
        cmocka_unit_test(test_awkward_floats),
        cmocka_unit_test(test_ints),
    };
    return cmocka_run_group_tests_name("ops", tests, NULL, NULL);
}
