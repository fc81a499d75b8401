#include "producers/language/base/number.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef unsigned __int128 wide;

/* 2^e for -1022 <= e <= 1023. */
static double power_of_two(int e)
{
    uint64_t bits = (uint64_t)(e + 1023) << 52;
    double d;
    memcpy(&d, &bits, 8);
    return d;
}

/* m * 2^e, rounded by the last multiplication at most (m has 53 bits or fewer). */
static double scale(double m, int e)
{
    if (e < -2200)
        return 0;
    if (e > 2200)
        e = 2200;
    for (; e > 1000; e -= 1000)
        m *= power_of_two(1000);
    for (; e < -1000; e += 1000)
        m *= power_of_two(-1000);
    return m * power_of_two(e);
}

static int bit_length(wide v)
{
    uint64_t high = (uint64_t)(v >> 64), low = (uint64_t)v;
    return high ? 128 - __builtin_clzll(high) : low ? 64 - __builtin_clzll(low) : 0;
}

/* v * 2^e, and a little more if `sticky`, to the nearest number (ties to even) of `bits` bits whose last bit is not
 * below 2^lowest. */
static double round_bits(wide v, bool sticky, int e, int bits, int lowest)
{
    int drop = bit_length(v) - bits;
    if (e + drop < lowest)
        drop = lowest - e;
    if (drop <= 0)
        return scale((double)(uint64_t)v, e); /* few bits: exact */
    if (drop > 127)
        return 0;
    wide kept = v >> drop, rest = v & (((wide)1 << drop) - 1), half = (wide)1 << (drop - 1);
    if (rest > half || (rest == half && (sticky || (kept & 1))))
        kept++;
    return scale((double)(uint64_t)kept, e + drop);
}

static double round_ratio(int64_t numerator, int64_t denominator, int bits, int lowest)
{
    uint64_t n = numerator < 0 ? 0 - (uint64_t)numerator : (uint64_t)numerator;
    if (!n)
        return 0;
    int shift = 127 - bit_length(n);
    wide v = (wide)n << shift, q = v / (uint64_t)denominator;
    double d = round_bits(q, v % (uint64_t)denominator != 0, -shift, bits, lowest);
    return numerator < 0 ? -d : d;
}

static karst_number inexact(double value)
{
    return (karst_number){.value = isnan(value) ? (double)NAN : value == 0 ? 0.0 : value};
}

static wide greatest_common_divisor(wide a, wide b)
{
    while (b) {
        wide r = a % b;
        a = b;
        b = r;
    }
    return a;
}

/* numerator / denominator if that fits, else the double `value`. */
static karst_number reduced(__int128 numerator, wide denominator, double value)
{
    wide n = numerator < 0 ? 0 - (wide)numerator : (wide)numerator;
    wide g = greatest_common_divisor(n, denominator);
    n /= g;
    denominator /= g;
    if (n > INT64_MAX || denominator > INT64_MAX)
        return inexact(value);
    karst_number r = {.numerator = numerator < 0 ? -(int64_t)n : (int64_t)n, .denominator = (int64_t)denominator};
    r.value = round_ratio(r.numerator, r.denominator, 53, -1074);
    return r;
}

karst_number karst_number_int(int64_t value) { return reduced(value, 1, (double)value); }
karst_number karst_number_ratio(int64_t numerator, int64_t denominator)
{
    if (denominator < 0)
        return reduced(-(__int128)numerator, (wide) - (__int128)denominator, 0);
    return reduced(numerator, (wide)denominator, 0);
}

/* |value| = mantissa * 2^exponent, mantissa odd. value is finite and not 0. */
static uint64_t split(double value, int *exponent)
{
    uint64_t bits;
    memcpy(&bits, &value, 8);
    int e = (int)(bits >> 52 & 2047);
    uint64_t m = bits & (((uint64_t)1 << 52) - 1);
    *exponent = e ? e - 1075 : -1074;
    if (e)
        m |= (uint64_t)1 << 52;
    int zeros = __builtin_ctzll(m);
    *exponent += zeros;
    return m >> zeros;
}

karst_number karst_number_double(double value)
{
    if (!isfinite(value))
        return inexact(value);
    if (value == 0)
        return karst_number_int(0);
    int e;
    int64_t m = (int64_t)split(value, &e);
    if (value < 0)
        m = -m;
    if (e >= 0 && e + bit_length(split(value, &e)) <= 63)
        return karst_number_int(m * ((int64_t)1 << e));
    if (e < 0 && e >= -62)
        return karst_number_ratio(m, (int64_t)1 << -e);
    return inexact(value);
}

karst_number karst_number_shortest(double value)
{
    if (!isfinite(value))
        return inexact(value);
    double magnitude = fabs(value);
    for (int digits = 15; digits <= 17; digits++) {
        char text[40];
        int n = snprintf(text, sizeof text, "%.*e", digits - 1, magnitude);
        for (int i = 0; i < n; i++)
            if (!(text[i] >= '0' && text[i] <= '9') && !strchr("e+-", text[i]))
                text[i] = '.'; /* whatever the locale puts there */
        karst_number r = karst_number_decimal(text, (size_t)n);
        if (r.value == magnitude)
            return value < 0 ? karst_number_negate(r) : r;
    }
    return karst_number_double(value);
}

/* ---- decimals ---- */

/* A natural number of up to 96 * 64 bits, lowest word first: 800 digits times 10^800 fit. */
enum { BIG_WORDS = 96, MAX_DIGITS = 800 };
typedef struct {
    uint64_t word[BIG_WORDS];
    int count;
} big;

static void big_multiply_add(big *b, uint64_t factor, uint64_t add)
{
    wide carry = add;
    for (int i = 0; i < b->count; i++) {
        carry += (wide)b->word[i] * factor;
        b->word[i] = (uint64_t)carry;
        carry >>= 64;
    }
    if (carry && b->count < BIG_WORDS)
        b->word[b->count++] = (uint64_t)carry;
}

static int big_bits(const big *b) { return b->count ? 64 * b->count - __builtin_clzll(b->word[b->count - 1]) : 0; }

static void big_shift_left(big *b, int shift)
{
    int words = shift / 64, bits = shift % 64;
    if (!b->count || words + b->count >= BIG_WORDS)
        return;
    for (int i = b->count; i >= 0; i--) {
        uint64_t high = i < b->count ? b->word[i] << bits : 0;
        uint64_t low = bits && i ? b->word[i - 1] >> (64 - bits) : 0;
        b->word[i + words] = high | low;
    }
    memset(b->word, 0, (size_t)words * 8);
    b->count += words + 1;
    while (b->count && !b->word[b->count - 1])
        b->count--;
}

static bool big_subtract_if_not_less(big *a, const big *b)
{
    int ba = big_bits(a), bb = big_bits(b);
    if (ba < bb)
        return false;
    for (int i = a->count - 1; ba == bb && i >= 0; i--) {
        uint64_t w = i < b->count ? b->word[i] : 0;
        if (a->word[i] != w) {
            if (a->word[i] < w)
                return false;
            break;
        }
    }
    uint64_t borrow = 0;
    for (int i = 0; i < a->count; i++) {
        uint64_t w = i < b->count ? b->word[i] : 0;
        wide d = (wide)a->word[i] - w - borrow;
        a->word[i] = (uint64_t)d;
        borrow = (uint64_t)(d >> 64) & 1;
    }
    while (a->count && !a->word[a->count - 1])
        a->count--;
    return true;
}

/* digits * 10^exponent, correctly rounded, by long division of big numbers. */
static double big_decimal(const char *digits, int num_digits, int exponent)
{
    big n = {.count = 0}, d = {.word = {1}, .count = 1};
    for (int i = 0; i < num_digits; i++) {
        if (!n.count && digits[i] != '0')
            n = (big){.word = {(uint64_t)(digits[i] - '0')}, .count = 1};
        else
            big_multiply_add(&n, 10, (uint64_t)(digits[i] - '0'));
    }
    for (int i = 0; i < exponent; i++)
        big_multiply_add(&n, 10, 0);
    for (int i = 0; i > exponent; i--)
        big_multiply_add(&d, 10, 0);
    int shift = big_bits(&n) - big_bits(&d); /* n / d is in (2^(shift - 1), 2^(shift + 1)) */
    if (shift > 0)
        big_shift_left(&d, shift);
    else
        big_shift_left(&n, -shift);
    uint64_t q = 0;
    for (int i = 0; i < 62; i++) {
        q = q << 1 | (uint64_t)big_subtract_if_not_less(&n, &d);
        big_shift_left(&n, 1);
    }
    return round_bits(q, n.count != 0, shift - 61, 53, -1074);
}

karst_number karst_number_decimal(const char *text, size_t length)
{
    char digits[MAX_DIGITS + 1];
    int num = 0, exponent = 0;
    bool point = false, lost = false;
    size_t i = 0;
    for (; i < length && text[i] != 'e' && text[i] != 'E'; i++) {
        if (text[i] == '.') {
            point = true;
            continue;
        }
        if (!num && text[i] == '0') { /* leading zeros */
            exponent -= point;
            continue;
        }
        if (num < MAX_DIGITS) {
            digits[num++] = text[i];
            exponent -= point;
        } else {
            lost |= text[i] != '0';
            exponent += !point;
        }
    }
    if (i < length) {
        bool negative = text[++i] == '-';
        int e = 0;
        for (i += text[i] == '-' || text[i] == '+'; i < length; i++)
            e = e < 100000000 ? e * 10 + (text[i] - '0') : e;
        exponent += negative ? -e : e;
    }
    if (lost)
        digits[num++] = '1', exponent--; /* what was cut off only breaks ties */
    while (num && digits[num - 1] == '0')
        num--, exponent++;
    if (!num || exponent + num < -330)
        return karst_number_int(0);
    if (exponent + num > 310)
        return inexact(INFINITY);
    if (num <= 18 && exponent >= -18 && exponent + num <= 18) {
        int64_t n = 0, d = 1;
        for (int k = 0; k < num; k++)
            n = n * 10 + (digits[k] - '0');
        for (int k = 0; k < exponent; k++)
            n *= 10;
        for (int k = 0; k > exponent; k--)
            d *= 10;
        return karst_number_ratio(n, d);
    }
    return inexact(big_decimal(digits, num, exponent));
}

/* ---- arithmetic ---- */

static bool both_exact(karst_number a, karst_number b) { return a.denominator && b.denominator; }

karst_number karst_number_add(karst_number a, karst_number b)
{
    if (!both_exact(a, b))
        return inexact(a.value + b.value);
    return reduced((__int128)a.numerator * b.denominator + (__int128)b.numerator * a.denominator,
                   (wide)a.denominator * (wide)b.denominator, a.value + b.value);
}

karst_number karst_number_negate(karst_number a)
{
    if (!a.denominator)
        return inexact(-a.value);
    return (karst_number){.value = a.numerator ? -a.value : 0, .numerator = -a.numerator, .denominator = a.denominator};
}

karst_number karst_number_subtract(karst_number a, karst_number b)
{
    return karst_number_add(a, karst_number_negate(b));
}

karst_number karst_number_multiply(karst_number a, karst_number b)
{
    if (!both_exact(a, b))
        return inexact(a.value * b.value);
    return reduced((__int128)a.numerator * b.numerator, (wide)a.denominator * (wide)b.denominator, a.value * b.value);
}

karst_number karst_number_divide(karst_number a, karst_number b)
{
    if (!both_exact(a, b) || !b.numerator)
        return inexact(a.value / b.value);
    __int128 n = (__int128)a.numerator * b.denominator, d = (__int128)a.denominator * b.numerator;
    return reduced(d < 0 ? -n : n, (wide)(d < 0 ? -d : d), a.value / b.value);
}

karst_number karst_number_floor(karst_number a)
{
    if (!a.denominator)
        return karst_number_double(floor(a.value));
    int64_t q = a.numerator / a.denominator;
    return karst_number_int(q - (a.numerator % a.denominator < 0));
}

karst_number karst_number_rint(karst_number a)
{
    if (!a.denominator)
        return karst_number_double(rint(a.value));
    int64_t q = karst_number_floor(a).numerator;
    __int128 twice =
        2 * ((__int128)a.numerator - (__int128)q * a.denominator); /* of the part above q, in denominators */
    return karst_number_int(q + (twice > a.denominator || (twice == a.denominator && (q & 1))));
}

int karst_number_compare(karst_number a, karst_number b)
{
    if (isnan(a.value) || isnan(b.value))
        return 2;
    if (both_exact(a, b)) {
        __int128 l = (__int128)a.numerator * b.denominator, r = (__int128)b.numerator * a.denominator;
        return (l > r) - (l < r);
    }
    return (a.value > b.value) - (a.value < b.value);
}

bool karst_number_is(karst_number a, int64_t value) { return a.denominator == 1 && a.numerator == value; }

bool karst_number_same(karst_number a, karst_number b)
{
    return a.numerator == b.numerator && a.denominator == b.denominator && !memcmp(&a.value, &b.value, sizeof a.value);
}

float karst_number_to_float(karst_number a)
{
    if (!a.denominator)
        return (float)a.value;
    return (float)round_ratio(a.numerator, a.denominator, 24, -149);
}

/* v * 2^shift to the nearest integer, ties to even; v >= 0. */
static bool shift_rounded(wide v, bool sticky, int shift, wide *result)
{
    if (shift >= 0) {
        if (v && bit_length(v) + shift > 126)
            return false;
        *result = shift > 127 ? 0 : v << shift;
        return true;
    }
    if (shift < -127) {
        *result = 0;
        return true;
    }
    wide rest = v & (((wide)1 << -shift) - 1), half = (wide)1 << (-shift - 1);
    *result = v >> -shift;
    *result += rest > half || (rest == half && (sticky || (*result & 1)));
    return bit_length(*result) <= 126;
}

/* |a| * 2^shift to the nearest integer, ties to even, by long division: as many bits as the result has. */
static bool ratio_to_fixed(karst_number a, int shift, wide *result)
{
    uint64_t n = a.numerator < 0 ? 0 - (uint64_t)a.numerator : (uint64_t)a.numerator, d = (uint64_t)a.denominator;
    wide quotient = n / d, rest = n % d;
    if (shift < 0)
        return shift_rounded(quotient, rest != 0, shift, result);
    while (shift > 0) {
        int step = shift < 64 ? shift : 64;
        if (quotient && bit_length(quotient) + step > 126)
            return false;
        rest <<= step;
        quotient = quotient << step | rest / d;
        rest %= d;
        shift -= step;
    }
    *result = quotient + (2 * rest > d || (2 * rest == d && (quotient & 1)));
    return bit_length(*result) <= 126;
}

bool karst_number_to_fixed(karst_number a, int shift, __int128 *fixed)
{
    if (!isfinite(a.value))
        return false;
    if (a.value == 0) {
        *fixed = 0;
        return true;
    }
    wide result;
    if (a.denominator) {
        if (!ratio_to_fixed(a, shift, &result))
            return false;
    } else {
        int e;
        wide v = split(a.value, &e);
        if (!shift_rounded(v, false, e + shift, &result))
            return false;
    }
    *fixed = a.value < 0 ? -(__int128)result : (__int128)result;
    return true;
}
