/* Positions against an independent route: ratios of big integers, divided bit by bit. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/position.h"

__extension__ typedef __int128 int128;

static uint64_t random_state = 12345;
static uint64_t random_bits(void)
{
    random_state += 0x9E3779B97F4A7C15u;
    uint64_t z = random_state;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}
static int random_below(int n) { return (int)(random_bits() % (uint64_t)n); }

/* ---- unsigned big integers of 1536 bits ---- */
enum { BIG_WORDS = 48 };
typedef struct {
    uint32_t word[BIG_WORDS];
} big;

static big big_from(uint64_t value)
{
    big b = {{(uint32_t)value, (uint32_t)(value >> 32)}};
    return b;
}
static void big_multiply_add(big *b, uint32_t factor, uint32_t term)
{
    uint64_t carry = term;
    for (int i = 0; i < BIG_WORDS; i++) {
        carry += (uint64_t)b->word[i] * factor;
        b->word[i] = (uint32_t)carry;
        carry >>= 32;
    }
    assert_int_equal(carry, 0);
}
static void big_power(big *b, uint32_t base, int exponent)
{
    for (int i = 0; i < exponent; i++)
        big_multiply_add(b, base, 0);
}
static int big_compare(const big *a, const big *b)
{
    for (int i = BIG_WORDS - 1; i >= 0; i--)
        if (a->word[i] != b->word[i])
            return a->word[i] < b->word[i] ? -1 : 1;
    return 0;
}
static void big_subtract(big *a, const big *b)
{
    int64_t borrow = 0;
    for (int i = 0; i < BIG_WORDS; i++) {
        borrow += (int64_t)a->word[i] - b->word[i];
        a->word[i] = (uint32_t)borrow;
        borrow >>= 32;
    }
    assert_int_equal(borrow, 0);
}
static bool big_is_zero(const big *a)
{
    const big zero = {{0}};
    return big_compare(a, &zero) == 0;
}
/* quotient = floor(a / b), a = remainder. */
static big big_divide(big *a, const big *b)
{
    big quotient = {{0}}, remainder = {{0}};
    for (int bit = BIG_WORDS * 32 - 1; bit >= 0; bit--) {
        big_multiply_add(&remainder, 2, (a->word[bit / 32] >> (bit % 32)) & 1);
        big_multiply_add(&quotient, 2, 0);
        if (big_compare(&remainder, b) >= 0) {
            big_subtract(&remainder, b);
            quotient.word[0] |= 1;
        }
    }
    *a = remainder;
    return quotient;
}

/* Units of 2^-32 voxel of digits * 10^exponent metres, to nearest, ties to even; false beyond the edge. */
static bool reference_parse(const char *digits, int exponent, bool negative, int voxel_log2_m, int128 *units)
{
    big above = {{0}}, below = big_from(1);
    for (; *digits; digits++)
        big_multiply_add(&above, 10, (uint32_t)(*digits - '0'));
    big_power(exponent > 0 ? &above : &below, 10, abs(exponent));
    int shift = 32 - voxel_log2_m;
    big_power(shift > 0 ? &above : &below, 2, abs(shift));
    big quotient = big_divide(&above, &below);
    big_multiply_add(&above, 2, 0);
    int against_half = big_compare(&above, &below);
    if (against_half > 0 || (against_half == 0 && (quotient.word[0] & 1)))
        big_multiply_add(&quotient, 1, 1);
    for (int i = 4; i < BIG_WORDS; i++)
        if (quotient.word[i])
            return false;
    if (quotient.word[3])
        return false;
    int128 value = 0;
    for (int i = 2; i >= 0; i--)
        value = value * ((int128)1 << 32) + quotient.word[i];
    *units = negative ? -value : value;
    return value <= (int128)1 << 94;
}

static int128 units_of(int64_t voxel, uint32_t fraction) { return (int128)voxel * ((int128)1 << 32) + fraction; }

static void assert_parses(const char *text, int voxel_log2_m, int64_t voxel, uint32_t fraction)
{
    int64_t v = 0;
    uint32_t f = 0;
    karst_error error = {0};
    if (!karst_coordinate_parse(text, voxel_log2_m, &v, &f, &error))
        fail_msg("%.60s: %s", text, error.message);
    if (v != voxel || f != fraction)
        fail_msg("%.60s with 2^%d m: got %lld + %u, want %lld + %u", text, voxel_log2_m, (long long)v, f,
                 (long long)voxel, fraction);
}

static void assert_refused(const char *text, int voxel_log2_m, const char *why)
{
    int64_t v = 77;
    uint32_t f = 77;
    karst_error error = {0};
    assert_false(karst_coordinate_parse(text, voxel_log2_m, &v, &f, &error));
    assert_int_equal(error.status, KARST_USAGE);
    if (!strstr(error.message, why))
        fail_msg("\"%s\" does not say \"%s\"", error.message, why);
    assert_null(strpbrk(error.message, "\n\r\t"));
    assert_int_equal(v, 77);
    assert_int_equal(f, 77);
}

static void test_plain_values(void **state)
{
    (void)state;
    assert_parses("12", 0, 12, 0);
    assert_parses("+12.", 0, 12, 0);
    assert_parses(" .5\t", 0, 0, 0x80000000u);
    assert_parses("-0.5", 0, -1, 0x80000000u);
    assert_parses("-0", 0, 0, 0);
    assert_parses("-0.0625", -4, -1, 0);
    assert_parses("1e15", 0, 1000000000000000, 0);
    assert_parses("1E+3", -4, 16000, 0);
    assert_parses("-2.5E-3", 0, -1, 4284229878u); /* 2^32 - 10737418 */
    assert_parses("000000000000000000000000000000000000000000001", 0, 1, 0);
    assert_parses("4611686018427387904", 0, (int64_t)1 << 62, 0);
    assert_parses("-4611686018427387904", 0, -((int64_t)1 << 62), 0);
    assert_parses("5070602400912917605986812821504", 40, (int64_t)1 << 62, 0); /* 2^102 */
    assert_parses("4194304", -40, (int64_t)1 << 62, 0);
    assert_parses("0e999999999999999999999999", 0, 0, 0);
    assert_parses("1e-999999999999999999999999", 0, 0, 0);
}

static void test_ties(void **state)
{
    (void)state;
    /* 2^-33 is half a unit: to even, which is 0; 3 * 2^-33 goes to 2. */
    assert_parses("0.000000000116415321826934814453125", 0, 0, 0);
    assert_parses("0.00000000011641532182693481445312500000000000000000000000000000000000000000000000000000000001", 0,
                  0, 1);
    assert_parses("0.000000000349245965480804443359375", 0, 0, 2);
    assert_parses("0.000000000349245965480804443359374999999999999999999999999999999999999999999999999999999999999999",
                  0, 0, 1);
    assert_parses("-0.000000000349245965480804443359375", 0, -1, 0xFFFFFFFEu);
    /* With voxels of 2^40 m a unit is 256 m. */
    assert_parses("128", 40, 0, 0);
    assert_parses("128.000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000001",
                  40, 0, 1);
    assert_parses("384", 40, 0, 2);
    assert_parses("383.9", 40, 0, 1);
    /* The finest: 2^-73 m is a tie with voxels of 2^-40 m; 73 digits after the point. */
    assert_parses("0.0000000000000000000001058791184067875423835403125849552452564239501953125", -40, 0, 0);
    assert_parses("0.0000000000000000000001058791184067875423835403125849552452564239501953126", -40, 0, 1);
    assert_parses("1.058791184067875423835403125849552452564239501953125e-22", -40, 0, 0);
    assert_parses("1.0587911840678754238354031258495524525642395019531250000000000000000000000000000000001e-22", -40, 0,
                  1);
}

static void test_refusals(void **state)
{
    (void)state;
    const char *const malformed[] = {"",   " ",  "abc", "1x",    "0x10", "nan", "inf", "-",   ".",
                                     "e5", "1e", "1e+", "1.2.3", "--1",  "1 2", "1,5", "1\n", "\x1b[31m"};
    for (size_t i = 0; i < sizeof malformed / sizeof *malformed; i++)
        assert_refused(malformed[i], 0, "is not a decimal number");
    const char *const far_away[] = {"4611686018427387905",
                                    "-4611686018427387905",
                                    "4611686018427387904.5",
                                    "1e19",
                                    "1e999999999",
                                    "1e99999999999999999999999999",
                                    "-1e31",
                                    "99999999999999999999999999999999999999"};
    for (size_t i = 0; i < sizeof far_away / sizeof *far_away; i++)
        assert_refused(far_away[i], 0, "beyond the world's edge");
    assert_refused("5070602400912917605986812821505", 39, "beyond the world's edge");
    assert_refused("1", 41, "outside");
    assert_refused("1", -41, "outside");
    /* Rounds onto the edge, so it is inside; half a unit more is not. */
    assert_parses("4611686018427387904.0000000001", 0, (int64_t)1 << 62, 0);
    assert_refused("4611686018427387904.0000000002", 0, "beyond the world's edge");
}

static void test_axis_is_named(void **state)
{
    (void)state;
    karst_position position = {{1, 2, 3}, {4, 5, 6}}, before = position;
    karst_error error = {0};
    assert_false(karst_position_parse("1", "2", "3 m", 0, &position, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_non_null(strstr(error.message, "z: \"3 m\""));
    for (int axis = 0; axis < 3; axis++)
        assert_true(position.voxel[axis] == before.voxel[axis] && position.fraction[axis] == before.fraction[axis]);
    assert_true(karst_position_parse("1", "-2.25", "1e3", 0, &position, NULL));
    assert_int_equal(position.voxel[0], 1);
    assert_int_equal(position.voxel[1], -3);
    assert_int_equal(position.fraction[1], 0xC0000000u);
    assert_int_equal(position.voxel[2], 1000);
}

/* Each takes time in proportion to its length, or this test does not end. */
static void test_long_texts(void **state)
{
    (void)state;
    enum { LENGTH = 1000000 };
    char *text = malloc(LENGTH + 64);
    assert_non_null(text);
    memset(text, '7', LENGTH);
    text[LENGTH] = '\0';
    assert_refused(text, 0, "beyond the world's edge");
    text[1] = '.';
    assert_parses(text, 0, 7, 3340530119u); /* 7.777...: 7/9 * 2^32 = 3340530119.1 */
    memset(text, '0', LENGTH);
    text[1] = '.';
    strcpy(text + LENGTH, "15e1000003"); /* 0.000...15 with 999998 zeros */
    assert_parses(text, 0, 15000, 0);
    memset(text, '0', LENGTH);
    text[0] = '3';
    strcpy(text + LENGTH, "e-999999");
    assert_parses(text, 0, 3, 0);
    free(text);
}

static void test_random_texts_against_long_division(void **state)
{
    (void)state;
    int num_refused = 0;
    for (int round = 0; round < 4000; round++) {
        int voxel_log2_m = KARST_VOXEL_LOG2_MIN + random_below(KARST_VOXEL_LOG2_MAX - KARST_VOXEL_LOG2_MIN + 1);
        int num_digits = 1 + random_below(round % 4 ? 40 : 120);
        char digits[128];
        for (int i = 0; i < num_digits; i++)
            digits[i] = (char)('0' + (random_below(4) ? random_below(10) : (random_below(2) ? 0 : 9)));
        digits[num_digits] = '\0';
        int point = random_below(num_digits + 1), exponent = random_below(61) - 40;
        bool negative = random_below(2);
        char text[256];
        snprintf(text, sizeof text, "%s%.*s.%s%c%d", negative ? "-" : "", point, digits, digits + point,
                 "eE"[random_below(2)], exponent);
        int128 want = 0;
        bool inside = reference_parse(digits, exponent - (num_digits - point), negative, voxel_log2_m, &want);
        int64_t voxel;
        uint32_t fraction;
        bool parsed = karst_coordinate_parse(text, voxel_log2_m, &voxel, &fraction, NULL);
        if (parsed != inside || (parsed && units_of(voxel, fraction) != want))
            fail_msg("%s with voxels of 2^%d m", text, voxel_log2_m);
        num_refused += !parsed;
    }
    assert_in_range(num_refused, 100, 3000); /* both sides of the edge were met */
}

/* Decimals of exact ties, and their nearest neighbours of 100 digits more. */
static void test_random_ties(void **state)
{
    (void)state;
    for (int round = 0; round < 400; round++) {
        int voxel_log2_m = KARST_VOXEL_LOG2_MIN + random_below(72); /* up to 31: a tie has a fraction */
        int bits = 33 - voxel_log2_m;                               /* a tie is odd * 2^-bits m */
        uint64_t odd = (random_bits() >> random_below(64)) | 1;
        big value = big_from(odd);
        big_power(&value, 5, bits); /* odd * 5^bits / 10^bits */
        char digits[256];
        int length = 0;
        const big ten = big_from(10);
        do {
            big remainder = value;
            value = big_divide(&remainder, &ten);
            digits[length++] = (char)('0' + remainder.word[0]);
        } while (!big_is_zero(&value));
        for (int i = 0; i < length / 2; i++) {
            char c = digits[i];
            digits[i] = digits[length - 1 - i];
            digits[length - 1 - i] = c;
        }
        digits[length] = '\0';
        uint64_t floor_units = odd >> 1, even = floor_units + (floor_units & 1);
        char text[512];
        snprintf(text, sizeof text, "%se-%d", digits, bits);
        assert_parses(text, voxel_log2_m, (int64_t)(even >> 32), (uint32_t)even);
        snprintf(text, sizeof text, "%s%0100d1e-%d", digits, 0, bits + 101);
        assert_parses(text, voxel_log2_m, (int64_t)((floor_units + 1) >> 32), (uint32_t)(floor_units + 1));
        assert_int_equal(digits[length - 1], '5'); /* as 5^n ends */
        snprintf(text, sizeof text, "%.*s4%099d9e-%d", length - 1, digits, 0, bits + 100);
        assert_parses(text, voxel_log2_m, (int64_t)(floor_units >> 32), (uint32_t)floor_units);
    }
}

/* |text| as digits without the point, and how many stood after it. */
static big big_from_text(const char *text, int *num_decimals)
{
    big value = {{0}};
    *num_decimals = 0;
    bool after = false;
    for (text += *text == '-'; *text; text++) {
        if (*text == '.') {
            after = true;
            continue;
        }
        big_multiply_add(&value, 10, (uint32_t)(*text - '0'));
        *num_decimals += after;
    }
    return value;
}

static void check_format(int64_t voxel, uint32_t fraction, int voxel_log2_m)
{
    char text[160], cut[160];
    int length = karst_coordinate_format(voxel, fraction, voxel_log2_m, text, sizeof text);
    assert_int_equal(length, strlen(text));
    assert_int_equal(karst_coordinate_format(voxel, fraction, voxel_log2_m, NULL, 0), length);
    memset(cut, 'x', sizeof cut);
    assert_int_equal(karst_coordinate_format(voxel, fraction, voxel_log2_m, cut, (size_t)length), length);
    assert_int_equal(strlen(cut), length - 1);
    assert_int_equal(cut[length], 'x');
    assert_memory_equal(cut, text, (size_t)length - 1);

    /* value(text) == units * 2^(voxel_log2_m - 32), cross-multiplied */
    int128 units = units_of(voxel, fraction);
    bool negative = units < 0;
    assert_int_equal(text[0] == '-', negative);
    int num_decimals;
    big left = big_from_text(text, &num_decimals), right = {{0}};
    if (num_decimals) /* as short as can be */
        assert_int_not_equal(text[length - 1], '0');
    int128 magnitude = negative ? -units : units;
    for (int word = 3; word >= 0; word--)
        right.word[word] = (uint32_t)(magnitude >> (32 * word));
    int exponent = voxel_log2_m - 32;
    big_power(exponent < 0 ? &left : &right, 2, abs(exponent));
    big_power(&right, 10, num_decimals);
    if (big_compare(&left, &right) != 0)
        fail_msg("%lld + %u with 2^%d m gives %s", (long long)voxel, fraction, voxel_log2_m, text);

    assert_parses(text, voxel_log2_m, voxel, fraction);
}

static void test_round_trip(void **state)
{
    (void)state;
    const int64_t edge = (int64_t)1 << 62;
    for (int voxel_log2_m = KARST_VOXEL_LOG2_MIN; voxel_log2_m <= KARST_VOXEL_LOG2_MAX; voxel_log2_m++) {
        const struct {
            int64_t voxel;
            uint32_t fraction;
        } edges[] = {{0, 0},     {0, 1},     {-1, 0xFFFFFFFFu},       {-1, 0},         {1, 0}, {edge, 0},
                     {-edge, 0}, {-edge, 1}, {edge - 1, 0xFFFFFFFFu}, {0, 0x80000000u}};
        for (size_t i = 0; i < sizeof edges / sizeof *edges; i++)
            check_format(edges[i].voxel, edges[i].fraction, voxel_log2_m);
        for (int i = 0; i < 300; i++) {
            int64_t voxel = (int64_t)random_bits() >> (1 + random_below(62));
            check_format(voxel, random_below(4) ? (uint32_t)random_bits() : (uint32_t)random_bits() << random_below(32),
                         voxel_log2_m);
        }
    }
    char text[160] = "x";
    assert_int_equal(karst_coordinate_format(0, 0, 0, text, sizeof text), 1);
    assert_string_equal(text, "0");
    karst_coordinate_format(-1, 0x80000000u, 0, text, sizeof text);
    assert_string_equal(text, "-0.5");
    karst_coordinate_format(-3, 0x40000000u, 2, text, sizeof text);
    assert_string_equal(text, "-11");
    assert_int_equal(karst_coordinate_format(1, 0, 41, text, sizeof text), -1);
    assert_string_equal(text, "");
}

static void test_add_and_difference(void **state)
{
    (void)state;
    for (int round = 0; round < 20000; round++) {
        int voxel_log2_m = KARST_VOXEL_LOG2_MIN + random_below(81);
        karst_position a;
        for (int axis = 0; axis < 3; axis++) {
            a.voxel[axis] = (int64_t)random_bits() >> (2 + random_below(60));
            a.fraction[axis] = (uint32_t)random_bits();
        }
        /* An offset of whole units below 2^53 is exact there and back, however far from the origin. */
        double offset[3], back[3];
        for (int axis = 0; axis < 3; axis++)
            offset[axis] = ldexp((double)((int64_t)random_bits() >> (11 + random_below(40))), voxel_log2_m - 32);
        karst_position b = karst_position_add_m(a, offset, voxel_log2_m);
        karst_position_difference_m(a, b, voxel_log2_m, back);
        for (int axis = 0; axis < 3; axis++)
            assert_true(back[axis] == offset[axis]);
    }
    const karst_position origin = {{0, 0, 0}, {0, 0, 0}};
    karst_position far_out = karst_position_add_m(origin, (double[]){INFINITY, -1e300, NAN}, 0);
    const int64_t edge = (int64_t)1 << 62;
    assert_true(far_out.voxel[0] == edge && far_out.voxel[1] == -edge && far_out.voxel[2] == 0);
    assert_true(far_out.fraction[0] == 0 && far_out.fraction[1] == 0 && far_out.fraction[2] == 0);
    far_out = karst_position_add_m(far_out, (double[]){1, -1, -0.25}, 0);
    assert_true(far_out.voxel[0] == edge && far_out.voxel[1] == -edge && far_out.voxel[2] == -1 &&
                far_out.fraction[2] == 0xC0000000u);
    far_out = karst_position_add_m(far_out, (double[]){-0x1p63, 0x1p63, 0}, 0); /* edge to edge */
    assert_true(far_out.voxel[0] == -edge && far_out.voxel[1] == edge);
    /* Ties to even. */
    karst_position tie = karst_position_add_m(origin, (double[]){0x1p-33, 0x3p-33, -0x1p-33}, 0);
    assert_true(tie.fraction[0] == 0 && tie.fraction[1] == 2 && tie.fraction[2] == 0 && tie.voxel[2] == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plain_values),       cmocka_unit_test(test_ties),
        cmocka_unit_test(test_refusals),           cmocka_unit_test(test_axis_is_named),
        cmocka_unit_test(test_long_texts),         cmocka_unit_test(test_random_texts_against_long_division),
        cmocka_unit_test(test_random_ties),        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_add_and_difference),
    };
    return cmocka_run_group_tests_name("position", tests, NULL, NULL);
}
