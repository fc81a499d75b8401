/* Exact decimal positions.
 *
 * In units of 2^-32 voxel a coordinate is an integer of at most 95 bits, so everything but the decimal fraction fits in
 * 128 bits. The fraction is kept as decimal digits and doubled bit by bit; digits beyond the finest tie only count as
 * "not zero". */
#include "karst/position.h"

#include "core/base/text.h"

#include <math.h>
#include <string.h>

__extension__ typedef __int128 int128;
__extension__ typedef unsigned __int128 uint128;

enum {
    FRACTION_BITS = 32,
    LIMIT_BITS = 62 + FRACTION_BITS,
    WHOLE_DIGITS = 31, /* 2^62 voxels of 2^40 m are less than 10^31 m */
    /* A tie between two values lies on a multiple of 2^-73 m, so 73 digits tell it from what is not one. */
    FRACTION_DIGITS = 80,
    FORMAT_DIGITS = 32 + 1 + 72 + 2
};
static const uint128 LIMIT = (uint128)1 << LIMIT_BITS;

static int128 join(int64_t voxel, uint32_t fraction) { return (int128)voxel * ((int128)1 << FRACTION_BITS) + fraction; }

static void split(int128 units, int64_t *voxel, uint32_t *fraction)
{
    *fraction = (uint32_t)units;
    *voxel = (int64_t)((units - *fraction) / ((int128)1 << FRACTION_BITS));
}

/* Doubles a number 0.d1 d2 d3... in place and returns what it carries over the point: its next binary digit. */
static unsigned double_fraction(unsigned char digits[FRACTION_DIGITS])
{
    unsigned carry = 0;
    for (int i = FRACTION_DIGITS - 1; i >= 0; i--) {
        unsigned twice = 2u * digits[i] + carry;
        carry = twice >= 10;
        digits[i] = (unsigned char)(twice - 10 * carry);
    }
    return carry;
}

static bool any_nonzero(const unsigned char *digits, int count)
{
    for (int i = 0; i < count; i++)
        if (digits[i])
            return true;
    return false;
}

/* A decimal laid out by weight. */
typedef struct {
    uint128 whole;
    unsigned char fraction[FRACTION_DIGITS];
    bool sticky; /* there is more below the last digit of `fraction` */
} fixed_decimal;

/* false if the number is 10^31 or more. Walks every digit once. */
static bool lay_out(const karst_decimal *parts, fixed_decimal *fixed)
{
    unsigned char whole[WHOLE_DIGITS] = {0};
    memset(fixed, 0, sizeof *fixed);
    size_t count = parts->num_whole + parts->num_fraction;
    for (size_t i = 0; i < count; i++) {
        char c = i < parts->num_whole ? parts->whole[i] : parts->fraction[i - parts->num_whole];
        unsigned char digit = (unsigned char)(c - '0');
        if (!digit)
            continue;
        long weight = (long)parts->num_whole - 1 - (long)i + parts->exponent;
        if (weight >= WHOLE_DIGITS)
            return false;
        if (weight >= 0)
            whole[weight] = digit;
        else if (weight >= -FRACTION_DIGITS)
            fixed->fraction[-weight - 1] = digit;
        else
            fixed->sticky = true;
    }
    for (int i = WHOLE_DIGITS - 1; i >= 0; i--)
        fixed->whole = fixed->whole * 10 + whole[i];
    return true;
}

/* fixed * 2^shift, rounded to nearest, ties to even; false if it exceeds the limit. */
static bool scale(fixed_decimal *fixed, int shift, uint128 *units)
{
    uint128 value = fixed->whole;
    int against_half; /* sign of (what is cut off) - 1/2 */
    if (shift >= 0) {
        for (int i = 0; i < shift; i++) {
            if (value > LIMIT)
                return false;
            value = 2 * value + double_fraction(fixed->fraction);
        }
        bool rest = any_nonzero(fixed->fraction + 1, FRACTION_DIGITS - 1) || fixed->sticky;
        against_half = fixed->fraction[0] != 5 ? (int)fixed->fraction[0] - 5 : rest;
    } else {
        uint128 half = (uint128)1 << (-shift - 1);
        uint128 cut = value & (2 * half - 1);
        value >>= -shift;
        bool rest = any_nonzero(fixed->fraction, FRACTION_DIGITS) || fixed->sticky;
        against_half = cut != half ? (cut > half ? 1 : -1) : rest;
    }
    if (against_half > 0 || (against_half == 0 && (value & 1)))
        value++;
    *units = value;
    return value <= LIMIT;
}

bool karst_coordinate_parse(const char *text, int voxel_log2_m, int64_t *voxel, uint32_t *fraction, karst_error *error)
{
    char quoted[KARST_TEXT_QUOTE_BYTES];
    if (voxel_log2_m < KARST_VOXEL_LOG2_MIN || voxel_log2_m > KARST_VOXEL_LOG2_MAX)
        return karst_fail(error, KARST_USAGE, "a voxel of 2^%d m is outside 2^%d to 2^%d m", voxel_log2_m,
                          KARST_VOXEL_LOG2_MIN, KARST_VOXEL_LOG2_MAX);
    karst_decimal parts;
    if (!karst_decimal_split(text, &parts))
        return karst_fail(error, KARST_USAGE, "\"%s\" is not a decimal number of metres, such as 12, -0.5 or 1e15",
                          karst_text_quote(text, quoted));
    fixed_decimal fixed;
    uint128 units = 0;
    if (!lay_out(&parts, &fixed) || !scale(&fixed, FRACTION_BITS - voxel_log2_m, &units))
        return karst_fail(error, KARST_USAGE,
                          "\"%s\" lies beyond the world's edge: with voxels of 2^%d m it reaches %.4g m",
                          karst_text_quote(text, quoted), voxel_log2_m, ldexp(1.0, 62 + voxel_log2_m));
    split(parts.negative ? -(int128)units : (int128)units, voxel, fraction);
    return true;
}

bool karst_position_parse(const char *x, const char *y, const char *z, int voxel_log2_m, karst_position *position,
                          karst_error *error)
{
    const char *const text[3] = {x, y, z};
    karst_position parsed;
    for (int axis = 0; axis < 3; axis++) {
        karst_error reason = {0};
        if (!karst_coordinate_parse(text[axis], voxel_log2_m, &parsed.voxel[axis], &parsed.fraction[axis], &reason))
            return karst_fail(error, reason.status, "%c: %s", "xyz"[axis], reason.message);
    }
    *position = parsed;
    return true;
}

int karst_coordinate_format(int64_t voxel, uint32_t fraction, int voxel_log2_m, char *text, size_t size_bytes)
{
    if (voxel_log2_m < KARST_VOXEL_LOG2_MIN || voxel_log2_m > KARST_VOXEL_LOG2_MAX) {
        if (size_bytes)
            text[0] = '\0';
        return -1;
    }
    int128 units = join(voxel, fraction);
    uint128 magnitude = units < 0 ? -(uint128)units : (uint128)units;
    int num_fraction_bits = FRACTION_BITS - voxel_log2_m;
    uint128 whole = magnitude, rest = 0, one = 1;
    if (num_fraction_bits > 0) {
        one <<= num_fraction_bits;
        whole = magnitude / one;
        rest = magnitude % one;
    } else {
        whole <<= -num_fraction_bits;
    }

    char digits[FORMAT_DIGITS];
    size_t start = 34, end = start; /* room for the sign and the 32 digits of 2^63 voxels of 2^40 m */
    do {
        digits[--start] = (char)('0' + (int)(whole % 10));
        whole /= 10;
    } while (whole);
    if (units < 0)
        digits[--start] = '-';
    if (rest)
        digits[end++] = '.';
    while (rest) { /* ends after num_fraction_bits digits at most: each step makes `rest` divisible by one more 2 */
        rest *= 10;
        digits[end++] = (char)('0' + (int)(rest / one));
        rest %= one;
    }
    size_t length = end - start;
    if (size_bytes) {
        size_t kept = length < size_bytes ? length : size_bytes - 1;
        memcpy(text, digits + start, kept);
        text[kept] = '\0';
    }
    return (int)length;
}

/* What most offsets are: no wider than the plain arithmetic of 64 bits, far from the edge. The same bits as below. */
#define PLAIN_UNITS 0x1p61
static const int64_t PLAIN_VOXEL = (int64_t)1 << 61;

/* To the nearest whole number, ties to even, as rint does. */
static double to_whole(double x)
{
    const double shift = 0x1.8p52;
    return fabs(x) < 0x1p51 ? x + shift - shift : rint(x);
}

karst_position karst_position_add_m(karst_position position, const double offset_m[3], int voxel_log2_m)
{
    const double units_in_m = ldexp(1, FRACTION_BITS - voxel_log2_m);
    for (int axis = 0; axis < 3; axis++) {
        if (isnan(offset_m[axis]))
            continue;
        const double offset = to_whole(offset_m[axis] * units_in_m);
        const int64_t voxel = position.voxel[axis];
        if (fabs(offset) < PLAIN_UNITS && voxel < PLAIN_VOXEL && voxel > -PLAIN_VOXEL) {
            const int64_t units = (int64_t)offset;
            const uint32_t low = (uint32_t)units;
            const uint64_t fraction = (uint64_t)position.fraction[axis] + low;
            position.fraction[axis] = (uint32_t)fraction;
            position.voxel[axis] = voxel + (units - low) / ((int64_t)1 << FRACTION_BITS) + (int64_t)(fraction >> 32);
            continue;
        }
        double reach = ldexp(1.0, LIMIT_BITS + 1); /* from one edge to the other: more saturates wherever it starts */
        int128 sum = join(voxel, position.fraction[axis]) + (int128)fmin(fmax(offset, -reach), reach);
        if (sum > (int128)LIMIT)
            sum = (int128)LIMIT;
        if (sum < -(int128)LIMIT)
            sum = -(int128)LIMIT;
        split(sum, &position.voxel[axis], &position.fraction[axis]);
    }
    return position;
}

void karst_position_difference_m(karst_position a, karst_position b, int voxel_log2_m, double difference_m[3])
{
    for (int axis = 0; axis < 3; axis++) {
        int128 units = join(b.voxel[axis], b.fraction[axis]) - join(a.voxel[axis], a.fraction[axis]);
        difference_m[axis] = ldexp((double)units, voxel_log2_m - FRACTION_BITS);
    }
}
