/* Lattice coordinates, gradient noise and fBm as host C: exactness, accuracy, statistics. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "noise/bounds.clh"
#include "tests/noise/random.h"

__extension__ typedef __int128 wide;

/* ---- coordinates ---- */

/* The definition: floor((voxel + fraction / 2^32) * F / 2^24), as cell and 2^-32 of it, by long multiplication in 192
 * bits. */
static noise_coordinate exact_coordinate(int64_t voxel, uint32_t fraction, int64_t frequency)
{
    /* (voxel * 2^32 + fraction) * F = a * 2^32 + b with b from 0 to 2^32 - 1 */
    wide b = (wide)fraction * frequency;
    wide a = (wide)voxel * frequency + (b >> 32);
    noise_coordinate c = {(uint32_t)(uint64_t)(a >> 56), (uint32_t)(uint64_t)(a >> 24)};
    return c;
}

static int64_t random_voxel(void)
{
    static const int64_t offsets[] = {0, 1000000000, 1000000000000000, INT64_C(1) << 61};
    int64_t offset = offsets[random_below(4)];
    return (random_bits() & 1 ? offset : -offset) + random_between(-100000, 100000);
}

/* Up to 4 cycles per voxel, either sign. */
static int64_t random_frequency(void)
{
    int64_t magnitude = (int64_t)(random_bits() >> random_between(6, 40));
    return random_bits() & 1 ? magnitude : -magnitude;
}

static void assert_same_coordinate(noise_coordinate got, noise_coordinate wanted, const char *what)
{
    if (got.cell != wanted.cell || got.fraction != wanted.fraction)
        fail_msg("%s: cell %u fraction %u, should be %u, %u", what, got.cell, got.fraction, wanted.cell,
                 wanted.fraction);
}

static void test_coordinates_are_exact(void **state)
{
    (void)state;
    for (int i = 0; i < 1000000; i++) {
        int64_t voxel = random_voxel(), frequency = random_frequency();
        uint32_t fraction = (uint32_t)random_bits();
        assert_same_coordinate(noise_coordinate_at(voxel, fraction, frequency),
                               exact_coordinate(voxel, fraction, frequency), "point");
    }
}

static void test_all_ways_to_a_sample_give_the_same_bits(void **state)
{
    (void)state;
    for (int i = 0; i < 200000; i++) {
        int level = (int)random_below(20);
        int64_t voxel = random_voxel(), frequency = random_frequency() >> level;
        noise_axis axis = noise_axis_at(voxel, frequency, level);
        for (int sample = 0; sample < 32; sample += 1 + (int)random_below(6)) {
            int64_t at = voxel + ((int64_t)sample << level);
            noise_coordinate by_step = noise_axis_sample(&axis, sample);
            assert_same_coordinate(by_step, exact_coordinate(at, 0, frequency), "step along a brick");
            /* another brick, and another level, through the same voxel */
            noise_axis other = noise_axis_at(at - (INT64_C(3) << level), frequency, level);
            assert_same_coordinate(noise_axis_sample(&other, 3), by_step, "another brick");
            other = noise_axis_at(at - 7, frequency, 0);
            assert_same_coordinate(noise_axis_sample(&other, 7), by_step, "another level");
        }
    }
}

static void test_octaves_double_exactly(void **state)
{
    (void)state;
    for (int i = 0; i < 200000; i++) {
        int64_t voxel = random_voxel(), frequency = random_frequency() >> 8;
        uint32_t fraction = (uint32_t)random_bits();
        noise_coordinate base = noise_coordinate_at(voxel, fraction, frequency);
        for (int k = 0; k <= NOISE_MAX_DOUBLINGS; k++) {
            noise_coordinate octave = noise_coordinate_octave(base, k);
            noise_coordinate exact = exact_coordinate(voxel, fraction, (int64_t)((uint64_t)frequency << k));
            uint64_t wanted = ((uint64_t)exact.cell << 32 | exact.fraction) + NOISE_OCTAVE_OFFSET(k);
            /* the 24 bits that noise reads */
            assert_int_equal(octave.cell, wanted >> 32);
            assert_int_equal(octave.fraction >> 8, (uint32_t)wanted >> 8);
        }
    }
}

static void test_moves_are_exact_and_total(void **state)
{
    (void)state;
    for (int i = 0; i < 500000; i++) {
        noise_coordinate c = {(uint32_t)random_bits(), (uint32_t)random_bits()};
        float offset = (float)random_magnitude(0x1p-60, 0x1p29) * (random_bits() & 1 ? 1.0f : -1.0f);
        noise_coordinate moved = noise_coordinate_move(c, offset);
        uint64_t by = (uint64_t)(int64_t)trunc(ldexp((double)offset, 32));
        uint64_t wanted = ((uint64_t)c.cell << 32 | c.fraction) + by;
        uint64_t got = (uint64_t)moved.cell << 32 | moved.fraction;
        if (got != wanted)
            fail_msg("move by %a: %lx, should be %lx", (double)offset, got, wanted);
    }
    const noise_coordinate c = {5, 7};
    const float odd[] = {NAN, INFINITY, -INFINITY, 0.0f, -0.0f, 1e30f, -1e30f};
    const int64_t cells[] = {1 << 30, 1 << 30, -(1 << 30), 0, 0, 1 << 30, -(1 << 30)};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        noise_coordinate moved = noise_coordinate_move(c, odd[i]);
        assert_int_equal(moved.cell, (uint32_t)(5 + cells[i]));
        assert_int_equal(moved.fraction, 7);
    }
}

/* ---- noise ---- */

static noise_position random_position(void)
{
    noise_position p;
    for (int a = 0; a < 3; a++) {
        p.axis[a].cell = (uint32_t)random_bits();
        p.axis[a].fraction = (uint32_t)random_bits();
        /* often near a face of the cell, where weights are least exact */
        switch (random_below(6)) {
        case 0:
            p.axis[a].fraction >>= random_below(24);
            break;
        case 1:
            p.axis[a].fraction = ~(p.axis[a].fraction >> random_below(24));
            break;
        default:
            break;
        }
    }
    return p;
}

static long double exact_fade(long double t) { return t * t * t * (t * (6 * t - 15) + 10); }

/* The noise of real numbers at the 24-bit fractions, straight from the sum over corners. */
static long double exact_noise(const noise_position *p, uint seed)
{
    long double sum = 0, t[3];
    for (int a = 0; a < 3; a++)
        t[a] = (long double)(p->axis[a].fraction >> 8) * 0x1p-24L;
    for (int corner = 0; corner < 8; corner++) {
        uint on[3] = {corner & 1, corner >> 1 & 1, corner >> 2};
        uint line = NOISE_LINE_YZ(NOISE_LINE_Y((p->axis[1].cell + on[1]) * NOISE_PRIME_Y),
                                  (p->axis[2].cell + on[2]) * NOISE_PRIME_Z, seed);
        uint hash = noise_corner_hash(line, (p->axis[0].cell + on[0]) * NOISE_PRIME_X);
        float g[3] = {noise_times_x(hash, 1.0f), noise_times_y(hash, 1.0f), noise_times_z(hash, 1.0f)};
        assert_true(g[0] * g[0] + g[1] * g[1] + g[2] * g[2] == 2.0f);
        long double weight = 1, dot = 0;
        for (int a = 0; a < 3; a++) {
            weight *= on[a] ? exact_fade(t[a]) : 1 - exact_fade(t[a]);
            dot += g[a] * (t[a] - on[a]);
        }
        sum += weight * dot;
    }
    return sum;
}

static void test_noise_is_accurate(void **state)
{
    (void)state;
    double worst = 0;
    for (int i = 0; i < 2000000; i++) {
        noise_position p = random_position();
        uint seed = (uint)random_bits();
        noise_jet jet;
        noise_jet_at(&p, seed, &jet);
        long double exact = exact_noise(&p, seed);
        for (int is_level = 0; is_level < 2; is_level++) {
            float value = (is_level ? noise_octave_level : noise_octave)(&p, seed, 1.0f, 0.0f);
            double error = fabs((double)(value - exact));
            worst = error > worst ? error : worst;
            assert_true(error <= 0x1p-18);
        }
        assert_true(fabs((double)(jet.value - exact)) <= 0x1p-18);
    }
    print_message("[          ] largest error of the noise: 2^%.2f (bounds allow for 2^-18)\n", log2(worst));
}

static void test_derivatives_agree_with_differences(void **state)
{
    (void)state;
    const long double step = 0x1p-8L;
    for (int i = 0; i < 20000; i++) {
        noise_position p = random_position();
        for (int a = 0; a < 3; a++) /* away from faces, so that steps stay in the cell */
            p.axis[a].fraction = (uint)(0x08000000 + random_below(0xf0000000));
        noise_jet jet;
        noise_jet_at(&p, 99, &jet);
        static const int pair[3][3] = {
            {NOISE_XX, NOISE_XY, NOISE_XZ}, {NOISE_XY, NOISE_YY, NOISE_YZ}, {NOISE_XZ, NOISE_YZ, NOISE_ZZ}};
        for (int a = 0; a < 3; a++) {
            noise_position up = p, down = p;
            up.axis[a].fraction += (uint)(step * 0x1p32L);
            down.axis[a].fraction -= (uint)(step * 0x1p32L);
            double first = (double)((exact_noise(&up, 99) - exact_noise(&down, 99)) / (2 * step));
            /* third derivatives are below 155 */
            assert_true(fabs(first - (double)jet.gradient[a]) < 155.0 / 6 * 0x1p-16 + 1e-4);
            noise_jet high, low;
            noise_jet_at(&up, 99, &high);
            noise_jet_at(&down, 99, &low);
            for (int b = 0; b < 3; b++) {
                double second = ((double)high.gradient[b] - (double)low.gradient[b]) / (double)(2 * step);
                if (!(fabs(second - (double)jet.hessian[pair[a][b]]) < 0.3))
                    fail_msg("d%d d%d: %g, by difference %g", a, b, (double)jet.hessian[pair[a][b]], second);
            }
        }
    }
}

static void test_noise_is_continuous_across_cells(void **state)
{
    (void)state;
    for (int i = 0; i < 200000; i++) {
        noise_position below = random_position(), above;
        int a = (int)random_below(3);
        below.axis[a].fraction = 0xffffff00u; /* 2^-24 below the face */
        above = below;
        above.axis[a].cell++;
        above.axis[a].fraction = 0;
        noise_jet low, high;
        noise_jet_at(&below, 5, &low);
        noise_jet_at(&above, 5, &high);
        float values[2] = {noise_octave(&below, 5, 1.0f, 0.0f), noise_octave(&above, 5, 1.0f, 0.0f)};
        assert_true(fabsf(values[0] - values[1]) < 2e-6f);
        for (int j = 0; j < 3; j++)
            assert_true(fabsf(low.gradient[j] - high.gradient[j]) < 2e-5f);
        for (int j = 0; j < 6; j++)
            assert_true(fabsf(low.hessian[j] - high.hessian[j]) < 2e-4f);
    }
}

/* A position from doubles; exact to 2^-32. */
static noise_position position_at(double x, double y, double z)
{
    const double p[3] = {x, y, z};
    noise_position at;
    for (int a = 0; a < 3; a++) {
        at.axis[a].cell = (uint)(int64_t)floor(p[a]);
        at.axis[a].fraction = (uint)((p[a] - floor(p[a])) * 0x1p32);
    }
    return at;
}

static void test_statistics_are_sane(void **state)
{
    (void)state;
    enum { COUNT = 1000000, PAIRS = 9 };
    static const char *const names[PAIRS] = {"-x -y z",     "x -y -z",       "-x -y -z",  "y x z", "two cells on",
                                             "next octave", "seed + golden", "next call", "x z y"};
    double sum = 0, squares = 0, product[PAIRS] = {0};
    float least = 0, most = 0;
    const uint seed = noise_call_seed(1, 0);
    for (int i = 0; i < COUNT; i++) {
        double x = random_unit() * 4000 - 2000, y = random_unit() * 4000 - 2000, z = random_unit() * 4000 - 2000;
        noise_position p = position_at(x, y, z);
        float n = noise_octave(&p, seed, 1.0f, 0.0f);
        sum += (double)n;
        squares += (double)n * (double)n;
        least = n < least ? n : least;
        most = n > most ? n : most;
        const noise_position others[PAIRS] = {position_at(-x, -y, z),
                                              position_at(x, -y, -z),
                                              position_at(-x, -y, -z),
                                              position_at(y, x, z),
                                              position_at(x + 2, y, z),
                                              noise_position_octave(&p, 1),
                                              p,
                                              p,
                                              position_at(x, z, y)};
        for (int j = 0; j < PAIRS; j++) {
            uint other_seed = j == 5 || j == 6 ? NOISE_OCTAVE_SEED(seed, 1) : j == 7 ? noise_call_seed(1, 1) : seed;
            product[j] += (double)n * (double)noise_octave(&others[j], other_seed, 1.0f, 0.0f);
        }
    }
    double variance = squares / COUNT;
    print_message("[          ] mean %.5f, variance %.4f, range %.3f to %.3f\n", sum / COUNT, variance, (double)least,
                  (double)most);
    assert_true(fabs(sum / COUNT) < 5 * sqrt(variance / COUNT));
    assert_true(variance > 0.06 && variance < 0.09);
    assert_true(least > -NOISE_SUP && most < NOISE_SUP && most > 0.85f && least < -0.85f);
    for (int j = 0; j < PAIRS; j++) {
        double correlation = product[j] / COUNT / variance;
        if (fabs(correlation) > 5 / sqrt(COUNT))
            fail_msg("the noise correlates with itself at (%s): %g", names[j], correlation);
    }
}

static void test_gradients_are_even(void **state)
{
    (void)state;
    enum { COUNT = 1200000 };
    int seen[27] = {0};
    for (int i = 0; i < COUNT; i++) {
        uint line =
            NOISE_LINE_YZ(NOISE_LINE_Y((uint)(i / 100 % 100) * NOISE_PRIME_Y), (uint)(i / 10000) * NOISE_PRIME_Z, 3u);
        uint hash = noise_corner_hash(line, (uint)(i % 100) * NOISE_PRIME_X);
        seen[(int)noise_times_x(hash, 1.0f) + 1 + 3 * ((int)noise_times_y(hash, 1.0f) + 1) +
             9 * ((int)noise_times_z(hash, 1.0f) + 1)]++;
    }
    int kinds = 0;
    for (int i = 0; i < 27; i++) {
        if (!seen[i])
            continue;
        kinds++;
        assert_true(abs(seen[i] - COUNT / 12) < 5 * sqrt(COUNT / 12.0));
    }
    assert_int_equal(kinds, 12);
}

/* ---- octaves ---- */

static void test_weights_fade_by_footprint(void **state)
{
    (void)state;
    const int64_t quarter = INT64_C(1) << 54; /* cycles per voxel, Q8.56 */
    assert_true(noise_octave_weight(quarter, 0, 0) == 1.0f);
    assert_true(noise_octave_weight(quarter, 0, 1) == 0.0f);
    assert_true(noise_octave_weight(-quarter, 0, 1) == 0.0f);
    assert_true(noise_octave_weight(quarter / 2 * 3, 0, 0) == 0.5f);
    assert_true(noise_octave_weight(INT64_C(1) << 44, 10, 0) == 1.0f);
    assert_true(noise_octave_weight(INT64_C(1) << 44, 0, 11) == 0.0f);
    assert_true(noise_octave_weight(INT64_MAX, 8, 59) == 0.0f);
    assert_true(noise_octave_weight(INT64_MAX, 8, NOISE_FULL_DETAIL) == 1.0f);
    for (int i = 0; i < 100000; i++) {
        int64_t frequency = random_frequency();
        for (int level = -1; level < 59; level++) {
            float here = noise_octave_weight(frequency, 0, level), above = noise_octave_weight(frequency, 0, level + 1);
            assert_true(here >= above && here <= 1.0f && above >= 0.0f);
            /* what bounds take for granted */
            if (above < 1.0f && !noise_may_fade(frequency, 0, level + 1))
                fail_msg("frequency %lx fades at level %d, and noise_may_fade denies it", frequency, level + 1);
        }
    }
}

static void test_fbm_is_its_octaves(void **state)
{
    (void)state;
    for (int i = 0; i < 20000; i++) {
        noise_position p = random_position();
        int level = (int)random_between(-1, 12);
        int64_t frequency = INT64_C(3) << random_between(38, 48);
        noise_octaves octaves = noise_octaves_at(frequency, 7, 2.0f, 0.625f, level);
        float sum = 0.0f, amplitude = 2.0f;
        for (int k = 0; k < 7; k++) {
            noise_position at = noise_position_octave(&p, k);
            float weight = noise_octave_weight(frequency, k, level);
            if (weight > 0.0f)
                sum = noise_octave(&at, 11u + (uint)k * NOISE_GOLDEN, amplitude * weight, sum);
            amplitude *= 0.625f;
        }
        float fbm = noise_fbm(&p, 11u, &octaves, 7, 0.0f);
        assert_memory_equal(&fbm, &sum, sizeof fbm);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_coordinates_are_exact),
        cmocka_unit_test(test_all_ways_to_a_sample_give_the_same_bits),
        cmocka_unit_test(test_octaves_double_exactly),
        cmocka_unit_test(test_moves_are_exact_and_total),
        cmocka_unit_test(test_noise_is_accurate),
        cmocka_unit_test(test_derivatives_agree_with_differences),
        cmocka_unit_test(test_noise_is_continuous_across_cells),
        cmocka_unit_test(test_statistics_are_sane),
        cmocka_unit_test(test_gradients_are_even),
        cmocka_unit_test(test_weights_fade_by_footprint),
        cmocka_unit_test(test_fbm_is_its_octaves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
