#include "producers/language/graph/affine.h"

#include <math.h>

#include "noise/gradient.clh"

__extension__ typedef __int128 int128;
__extension__ typedef unsigned __int128 uint128;

static bool is_zero(karst_number a) { return a.value == 0; }

karst_affine_value karst_affine_divide(karst_affine_value form, karst_number by)
{
    for (int i = 0; i < 3; i++)
        form.coefficient[i] =
            is_zero(form.coefficient[i]) ? form.coefficient[i] : karst_number_divide(form.coefficient[i], by);
    form.offset = is_zero(form.offset) ? form.offset : karst_number_divide(form.offset, by);
    return form;
}

karst_affine_value karst_affine_multiply(karst_affine_value form, karst_number by)
{
    for (int i = 0; i < 3; i++)
        form.coefficient[i] = karst_number_multiply(form.coefficient[i], by);
    form.offset = karst_number_multiply(form.offset, by);
    return form;
}

/* e with |a| < 2^e; a very small number for 0. */
static int exponent_of(karst_number a)
{
    int e = -100000;
    if (a.value != 0)
        frexp(a.value, &e);
    return e;
}

static int128 fixed_or_zero(karst_number a, int shift)
{
    int128 fixed = 0;
    return karst_number_to_fixed(a, shift, &fixed) ? fixed : 0;
}

/* ---- float ---- */

enum { MOST_SHIFT = 200, LEAST_EXPONENT = -250, MOST_EXPONENT = 250 };

karst_linear karst_linear_of(karst_affine_value form, int voxel_log2_m)
{
    karst_linear linear = {.scale = {NAN, NAN}};
    int largest = -MOST_SHIFT;
    for (int i = 0; i < 3; i++) {
        int e = exponent_of(form.coefficient[i]);
        largest = e > largest ? e : largest;
        if (!isfinite(form.coefficient[i].value))
            return linear;
    }
    int shift = 62 - largest;
    shift = shift < MOST_SHIFT ? shift : MOST_SHIFT;
    /* the offset has to fit 125 bits in units of 2^(voxel_log2_m - shift) */
    int room = 125 - exponent_of(form.offset) + voxel_log2_m;
    shift = shift < room ? shift : room;
    int exponent = voxel_log2_m - shift;
    if (!isfinite(form.offset.value) || exponent > MOST_EXPONENT || exponent < LEAST_EXPONENT)
        return linear;
    for (int i = 0; i < 3; i++)
        linear.factor[i] = (long)fixed_or_zero(form.coefficient[i], shift);
    int128 offset = fixed_or_zero(form.offset, -exponent);
    linear.offset_high = (long)(offset >> 64);
    linear.offset_low = (ulong)offset;
    linear.scale[0] = ldexpf(1, exponent / 2);
    linear.scale[1] = ldexpf(1, exponent - exponent / 2);
    return linear;
}

/* ---- lattice ---- */

karst_lattice karst_lattice_of(karst_affine_value form, int voxel_log2_m)
{
    karst_lattice lattice;
    for (int i = 0; i < 3; i++)
        lattice.frequency[i] = (long)fixed_or_zero(form.coefficient[i], 56 + voxel_log2_m);
    int128 offset = fixed_or_zero(form.offset, 56);
    lattice.cell = (long)(offset >> 56);
    lattice.fraction = (long)((ulong)offset & 0xffffffffffffffUL);
    return lattice;
}

/* ---- period ---- */

/* |a| * 2^shift as a ratio of integers below 2^126; false if it has none. */
static bool ratio_of(karst_number a, int shift, uint128 *numerator, uint128 *denominator)
{
    if (a.denominator) {
        *numerator = a.numerator < 0 ? (uint128) - (int128)a.numerator : (uint128)a.numerator;
        *denominator = (uint128)a.denominator;
    } else {
        int e;
        double m = frexp(fabs(a.value), &e);
        if (!isfinite(a.value) || a.value == 0)
            return false;
        *numerator = (uint128)(uint64_t)ldexp(m, 53);
        *denominator = 1;
        shift += e - 53;
    }
    for (; shift > 0 && !(*denominator & 1); shift--)
        *denominator >>= 1;
    for (; shift < 0 && !(*numerator & 1); shift++)
        *numerator >>= 1;
    if (shift > 60 || shift < -60)
        return false;
    *numerator <<= shift > 0 ? shift : 0;
    *denominator <<= shift < 0 ? -shift : 0;
    return true;
}

enum { PERIOD_BITS = 31, GOOD_PERIOD_BITS = 25 };

/* The last convergent of n / d with both parts below 2^31 (Euclid's continued fraction). false if it is poorer than
 * 2^-56. */
static bool convergent(uint128 n, uint128 d, uint32_t *numerator, uint32_t *denominator)
{
    uint128 p0 = 0, q0 = 1, p1 = 1, q1 = 0;
    bool exact = false;
    while (!exact) {
        uint128 part = n / d, rest = n % d, limit = (uint128)1 << PERIOD_BITS;
        if (part >= limit || part * p1 + p0 >= limit || part * q1 + q0 >= limit)
            break;
        uint128 p2 = part * p1 + p0, q2 = part * q1 + q0;
        p0 = p1, q0 = q1, p1 = p2, q1 = q2;
        n = d, d = rest;
        exact = rest == 0;
    }
    *numerator = (uint32_t)p1;
    *denominator = (uint32_t)q1;
    return p1 && q1 && (exact || q1 >> GOOD_PERIOD_BITS);
}

karst_period karst_period_of(karst_affine_value form, int voxel_log2_m)
{
    karst_period none = {0}, period = {0};
    int num_axes = 0;
    for (int i = 0; i < 3; i++) {
        if (!is_zero(form.coefficient[i])) {
            num_axes++;
            period.axis = i;
        }
    }
    karst_number coefficient = form.coefficient[period.axis];
    uint128 n, d;
    if (num_axes != 1 || !ratio_of(coefficient, voxel_log2_m, &n, &d) ||
        !convergent(n, d, &period.repeats, &period.period))
        return none;
    int128 offset;
    if (!karst_number_to_fixed(karst_number_negate(karst_number_divide(form.offset, coefficient)), 32 - voxel_log2_m,
                               &offset))
        return none;
    if (offset >= (int128)1 << 94 || offset <= -((int128)1 << 94))
        return none;
    period.negative = coefficient.value < 0;
    period.offset_voxel = (long)(offset >> 32);
    period.offset_fraction = (uint)offset;
    return period;
}

karst_cells karst_cells_of(karst_affine_value form, int voxel_log2_m)
{
    return (karst_cells){.lattice = karst_lattice_of(form, voxel_log2_m),
                         .period = karst_period_of(form, voxel_log2_m)};
}

/* ---- octaves ---- */

static karst_number power(karst_number base, int exponent)
{
    karst_number result = karst_number_int(1);
    for (; exponent > 0; exponent--)
        result = karst_number_multiply(result, base);
    return result;
}

/* Cells a voxel that a Q8.56 frequency cannot hold. */
static bool is_too_fine(const karst_affine_value *argument, int voxel_log2_m)
{
    double sum = 0;
    for (int axis = 0; axis < 3; axis++)
        sum += fabs(argument->coefficient[axis].value) * ldexp(1, voxel_log2_m);
    return !(sum < 127);
}

karst_octave karst_octave_of(const karst_affine_value argument[3], karst_number lacunarity, karst_number gain,
                             uint32_t seed, int k, int voxel_log2_m)
{
    karst_number scale = power(lacunarity, k);
    karst_octave octave = {.scale = karst_number_to_float(scale),
                           .amplitude = karst_number_to_float(power(gain, k)),
                           .seed = NOISE_OCTAVE_SEED(seed, k)};
    for (int i = 0; i < 3; i++) {
        karst_affine_value form = karst_affine_multiply(argument[i], scale);
        if (is_too_fine(&form, voxel_log2_m)) {
            octave.frequency = KARST_OCTAVE_FADED;
            continue;
        }
        karst_lattice lattice = karst_lattice_of(form, voxel_log2_m);
        lattice.fraction += (long)NOISE_OCTAVE_OFFSET(k) << 24;
        lattice.cell += lattice.fraction >> 56;
        lattice.fraction &= 0xffffffffffffffL;
        octave.lattice[i] = lattice;
        long frequency = 0;
        for (int axis = 0; axis < 3; axis++)
            frequency += lattice.frequency[axis] < 0 ? -lattice.frequency[axis] : lattice.frequency[axis];
        octave.frequency = frequency > octave.frequency ? frequency : octave.frequency;
    }
    return octave;
}
