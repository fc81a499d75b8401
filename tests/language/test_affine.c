/* Affine forms: fixed point against integers of 256 bits' worth of care, at every distance. */
#include "producers/language/ops/affine.clh"
#include "producers/language/graph/affine.h"
#include "producers/language/ops/octave.clh"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include <stdio.h>

__extension__ typedef __int128 int128;

static uint32_t state_;
static uint32_t next(void)
{
    state_ = state_ * 1664525u + 1013904223u;
    uint32_t x = state_ ^ (state_ >> 16);
    x *= 0x7feb352du;
    return x ^ (x >> 15);
}

static karst_number ratio(int64_t n, int64_t d) { return karst_number_ratio(n, d); }

static affine_position at(long x, uint fx, long y, long z)
{
    return (affine_position){.voxel = {x, y, z}, .fraction = {fx, 0, 0}};
}

static long random_voxel(void)
{
    static const int bits[] = {1, 6, 20, 31, 40, 51, 60};
    int b = bits[next() % 7];
    long v = (long)(((uint64_t)next() << 32 | next()) >> (64 - b));
    return next() & 1 ? v : -v;
}

/* floor and rest of (voxel + fraction / 2^32) * n / d, exactly. */
static void exact_cells(long voxel, uint fraction, int64_t n, int64_t d, int128 *cell, double *rest)
{
    int128 units = ((int128)voxel * ((int128)1 << 32) + fraction) * n, whole = (int128)d << 32;
    int128 q = units / whole, r = units % whole;
    if (r < 0)
        r += whole, q--;
    *cell = q;
    *rest = (double)r / (double)whole;
}

static void test_periods_are_exact(void **state)
{
    (void)state;
    state_ = 1;
    for (int i = 0; i < 200000; i++) {
        int64_t n = 1 + next() % 3000, d = 1 + next() % 3000;
        if (next() & 1)
            n = -n;
        long voxel = random_voxel() >> 12; /* so that the reference fits */
        uint fraction = next() & 1 ? 0 : next();
        long shift = random_voxel() >> 20;
        /* n / d * (p - shift voxels), in voxels of 1/16 m */
        karst_affine_value form = {{ratio(n, d), ratio(0, 1), ratio(0, 1)},
                                   karst_number_multiply(ratio(-n, d), ratio(shift, 16))};
        karst_period period = karst_period_of(form, -4);
        assert_true(period.period > 0);
        affine_position p = at(voxel, fraction, 77, 99);
        affine_place place = affine_period(&p, &period);
        int128 cell;
        double rest;
        exact_cells(voxel - shift, fraction, n, 16 * d, &cell, &rest);
        if (place.cell != (long)cell || fabs((double)place.fraction * 0x1p-32 - rest) > 0x1p-31)
            fail_msg("%ld/%ld of voxel %ld + %u / 2^32 from %ld: cell %ld, %.12g, not %ld, %.12g", (long)n, (long)d,
                     voxel, fraction, shift, place.cell, (double)place.fraction * 0x1p-32, (long)cell, rest);
    }
}

static void test_a_lattice_is_a_noise_coordinate(void **state)
{
    (void)state;
    state_ = 2;
    for (int i = 0; i < 200000; i++) {
        karst_number c = karst_number_divide(karst_number_int((int32_t)next()),
                                             karst_number_int(1 + (int64_t)(next() >> (next() % 30))));
        karst_affine_value form = {{c, ratio(0, 1), ratio(0, 1)}, ratio(0, 1)};
        karst_lattice lattice = karst_lattice_of(form, -4);
        affine_position p = at(random_voxel(), next(), 5, 6);
        noise_coordinate a = affine_coordinate(&p, &lattice),
                         b = noise_coordinate_at(p.voxel[0], p.fraction[0], lattice.frequency[0]);
        assert_int_equal(a.cell, b.cell);
        assert_int_equal(a.fraction, b.fraction);
    }
}

static void test_lattices_add(void **state)
{
    (void)state;
    state_ = 3;
    for (int i = 0; i < 100000; i++) {
        /* sixteenths of cells a voxel, whole voxels: every product is exact */
        long f[3] = {(long)(next() % 1000) - 500, (long)(next() % 1000) - 500, (long)(next() % 1000) - 500},
             o = (long)(next() % 100000) - 50000;
        karst_affine_value form = {{ratio(f[0], 16), ratio(f[1], 16), ratio(f[2], 16)}, ratio(o, 16)};
        karst_lattice lattice = karst_lattice_of(form, 0);
        affine_position p = at(random_voxel() >> 4, 0, random_voxel() >> 4, random_voxel() >> 4);
        int128 sum = (int128)f[0] * p.voxel[0] + (int128)f[1] * p.voxel[1] + (int128)f[2] * p.voxel[2] + o;
        affine_place place = affine_lattice(&p, &lattice);
        assert_int_equal(place.cell, (long)(sum >> 4));
        assert_int_equal(place.fraction, (uint)(sum & 15) << 28);
    }
}

/* In extended precision: 64 bits of the sum suffice to see 2^-22. */
static void test_floats_are_good_everywhere(void **state)
{
    (void)state;
    state_ = 4;
    double worst = 0;
    for (int i = 0; i < 400000; i++) {
        long c[3] = {(long)next() - 0x7fffffff, 0, 0}, scale = 1L << (next() % 40);
        if (next() & 1)
            c[1] = (long)next() - 0x7fffffff, c[2] = (long)next() - 0x7fffffff;
        affine_position p = at(random_voxel(), next(), random_voxel(), random_voxel());
        /* an offset that takes nearly everything off, half of the time */
        int128 near = (int128)c[0] * p.voxel[0] + (int128)c[1] * p.voxel[1] + (int128)c[2] * p.voxel[2];
        if (near > INT64_MAX || near < -INT64_MAX)
            continue;
        long offset = next() & 1 ? 0 : -(long)near + (int32_t)next();
        karst_affine_value form = {{ratio(c[0], scale), ratio(c[1], scale), ratio(c[2], scale)}, ratio(offset, scale)};
        karst_linear linear = karst_linear_of(form, 0);
        int128 sum = near + offset;
        long double exact =
            ((long double)sum + (long double)c[0] * (long double)p.fraction[0] * 0x1p-32L) / (long double)scale;
        double got = (double)affine_float(&p, &linear);
        double error = exact == 0 ? fabs(got) : (double)fabsl(((long double)got - exact) / exact);
        worst = error > worst ? error : worst;
        if (error > 0x1p-22)
            fail_msg("%ld %ld %ld + %ld over %ld: %.9g, not %.9Lg", c[0], c[1], c[2], offset, scale, got, exact);
    }
    assert_true(worst > 0x1p-26); /* or nothing was measured */
}

static void test_extremes(void **state)
{
    (void)state;
    karst_number zero = ratio(0, 1), third = ratio(1, 3);
    karst_affine_value form = {{third, zero, zero}, karst_number_double(1e30)};
    affine_position p = at(1L << 61, 0, 0, 0);
    karst_linear linear = karst_linear_of(form, 40);
    assert_true(fabs((double)affine_float(&p, &linear) / (1e30 + 0x1p61 / 3 * 0x1p40) - 1) < 0x1p-22);
    form.offset = karst_number_double(INFINITY);
    linear = karst_linear_of(form, 0);
    assert_true(isnan(affine_float(&p, &linear)));
    form = (karst_affine_value){{karst_number_double(1e-30), zero, zero}, zero};
    linear = karst_linear_of(form, -40);
    assert_true(fabs((double)affine_float(&p, &linear) / (1e-30 * 0x1p61 * 0x1p-40) - 1) < 0x1p-22);
    assert_int_equal(karst_period_of(form, -40).period, 0);
    p = at(-5, 0, 0, 0);
    form.coefficient[0] = ratio(1, 1);
    linear = karst_linear_of(form, -4);
    assert_true(affine_float(&p, &linear) == -0.3125f);
    p = at(0, 0, 0, 0);
    assert_true(affine_float(&p, &linear) == 0.0f);
}

static void test_octaves_are_apart(void **state)
{
    (void)state;
    karst_number zero = ratio(0, 1);
    karst_affine_value argument[3] = {
        {{ratio(1, 256), zero, zero}, zero}, {{zero, ratio(1, 256), zero}, zero}, {{zero, zero, ratio(1, 256)}, zero}};
    karst_octave first = karst_octave_of(argument, ratio(2, 1), ratio(1, 2), 7, 0, -4),
                 third = karst_octave_of(argument, ratio(2, 1), ratio(1, 2), 7, 2, -4);
    assert_int_equal(first.lattice[0].fraction, 0);
    assert_int_equal(third.lattice[0].frequency[0], 4 * first.lattice[0].frequency[0]);
    assert_int_equal(third.lattice[1].fraction >> 24, (uint)NOISE_OCTAVE_OFFSET(2));
    assert_int_equal(third.frequency, third.lattice[0].frequency[0]);
    assert_true(third.amplitude == 0.25f && third.scale == 4.0f);
    /* doubling octaves lie where noise_coordinate_octave puts them */
    affine_position p = at(123456789, 0, 0, 0);
    noise_coordinate a = noise_coordinate_octave(affine_coordinate(&p, &first.lattice[0]), 2),
                     b = affine_coordinate(&p, &third.lattice[0]);
    assert_int_equal(a.cell, b.cell);
    assert_int_equal(a.fraction, b.fraction);
}

/* What fixed point cannot hold is never seen: not a wrapped frequency, its mean. */
static void test_octaves_too_fine_are_faded(void **state)
{
    (void)state;
    karst_number zero = ratio(0, 1), none = karst_number_divide(zero, zero);
    karst_affine_value still = {{zero, zero, zero}, zero},
                       argument[3] = {{{ratio(40, 1), zero, zero}, zero}, still, still};
    for (int axes = 0; axes < 2; axes++) {
        if (axes)
            argument[0].coefficient[1] = argument[0].coefficient[2] = ratio(-40, 1);
        for (int voxel = 0; voxel < 3; voxel++)
            for (int k = 0; k < 8; k++) {
                static karst_octave octaves[4]; /* of an image others would follow: a compiler may think so */
                octaves[0] = karst_octave_of(argument, ratio(2, 1), ratio(1, 2), 7, k, -2 * voxel);
                const karst_octave octave = octaves[0];
                bool is_faded = ldexp(axes ? 120 : 40, k - 2 * voxel) >= 127;
                assert_int_equal(octave.frequency == KARST_OCTAVE_FADED, is_faded);
                for (int level = -1; level < 3; level++)
                    if (is_faded)
                        assert_true(octave_weight_at(octaves, level).weight == 0);
                assert_true(is_faded || octave_weight_at(octaves, -1).weight == 1);
                assert_true(is_faded || octave.lattice[0].frequency[0] == (long)ldexp(40, 56 + k - 2 * voxel));
            }
    }
    argument[0].coefficient[0] = none;
    assert_true(karst_octave_of(argument, ratio(2, 1), ratio(1, 2), 7, 0, 0).frequency == KARST_OCTAVE_FADED);
    argument[0].coefficient[0] = karst_number_double(1e300);
    assert_true(karst_octave_of(argument, ratio(2, 1), ratio(1, 2), 7, 0, 0).frequency == KARST_OCTAVE_FADED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_periods_are_exact),
        cmocka_unit_test(test_a_lattice_is_a_noise_coordinate),
        cmocka_unit_test(test_lattices_add),
        cmocka_unit_test(test_floats_are_good_everywhere),
        cmocka_unit_test(test_extremes),
        cmocka_unit_test(test_octaves_are_apart),
        cmocka_unit_test(test_octaves_too_fine_are_faded),
    };
    return cmocka_run_group_tests_name("affine", tests, NULL, NULL);
}
