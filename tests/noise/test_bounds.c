/* Intervals, and bounds of sums of noises over a box: they hold what they claim to hold, and would not without each
 * rule. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "tests/noise/mutants.h"

#include "noise/bounds.clh"
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
    mutant = MUTANT_NONE;
    assert_int_equal(interval_escapes(1000000), 0);
    mutant = MUTANT_ROUNDING;
    assert_true(interval_escapes(10000) > 100);
    mutant = MUTANT_NONE;
    assert_true(iv_finite(iv_of(-1.0f, 3e38f)) && !iv_finite(iv_of(-INFINITY, 0.0f)) && !iv_finite(iv_of(0.0f, NAN)));
}

/* ---- noise over a box ---- */

#define MAX_NOISES 4

/* A sum of octaves with frequencies of their own along each axis, some of them faded to some weight. */
typedef struct {
    int num;
    uint seed[MAX_NOISES];
    float amplitude[MAX_NOISES];
    int64_t frequency[MAX_NOISES][3];
    int fades[MAX_NOISES];
    int64_t centre[3]; /* level-0 voxel */
    float radius[3];   /* voxels */
} sum_of_noises;

static sum_of_noises random_sum(void)
{
    static const int64_t offsets[] = {0, 1000000000, 1000000000000000};
    sum_of_noises s;
    s.num = (int)random_between(1, MAX_NOISES);
    int64_t offset = offsets[random_below(3)];
    for (int a = 0; a < 3; a++) {
        s.centre[a] = random_between(-100000, 100000) + (random_bits() & 1 ? offset : -offset);
        s.radius[a] = (float)random_magnitude(1, 4096);
    }
    if (random_below(4) == 0) /* a cube, as nodes are */
        s.radius[1] = s.radius[2] = s.radius[0];
    for (int n = 0; n < s.num; n++) {
        s.seed[n] = (uint)random_bits();
        s.amplitude[n] = (float)random_magnitude(0.1, 100);
        s.fades[n] = random_below(6) == 0 ? -1 : 0;
        /* from boxes of a millionth of a cell to boxes of some cells */
        double cells = random_magnitude(1e-6, 4);
        for (int a = 0; a < 3; a++)
            s.frequency[n][a] = (int64_t)ldexp(cells * random_magnitude(0.25, 1) / (double)s.radius[a], 56);
    }
    return s;
}

static float sum_at(const sum_of_noises *s, const int64_t voxel[3], const uint32_t fraction[3],
                    const float weight[MAX_NOISES])
{
    float sum = 0.0f;
    for (int n = 0; n < s->num; n++) {
        noise_position p;
        for (int a = 0; a < 3; a++)
            p.axis[a] = noise_coordinate_at(voxel[a], fraction[a], s->frequency[n][a]);
        if (weight[n] != 0.0f)
            sum = noise_octave(&p, s->seed[n], s->amplitude[n] * weight[n], sum);
    }
    return sum;
}

static noise_form form_of(const sum_of_noises *s)
{
    noise_form form = noise_form_zero();
    for (int n = 0; n < s->num; n++) {
        noise_position p;
        float cells[3];
        for (int a = 0; a < 3; a++) {
            p.axis[a] = noise_coordinate_at(s->centre[a], 0, s->frequency[n][a]);
            cells[a] = (float)s->frequency[n][a] * 0x1p-56f;
        }
        noise_form_add(&form, &p, s->seed[n], s->amplitude[n], cells, s->radius, s->fades[n]);
    }
    return form;
}

/* A point of the box, in voxels and 2^-32 of them; corners and faces often. */
static void random_point(const sum_of_noises *s, int64_t voxel[3], uint32_t fraction[3])
{
    for (int a = 0; a < 3; a++) {
        int64_t radius = (int64_t)ldexp((double)s->radius[a], 32);
        int64_t at = random_below(3) ? random_between(-radius, radius) : random_bits() & 1 ? radius : -radius;
        voxel[a] = s->centre[a] + (at >> 32);
        fraction[a] = (uint32_t)at;
    }
}

/* Counts points whose value, and pairs of points whose difference, is not in the bounds. `tightness` gets the mean of
 * (range seen / range proven). */
static long form_escapes(int boxes, int points, double *tightness)
{
    long num = 0;
    double share = 0;
    for (int b = 0; b < boxes; b++) {
        sum_of_noises s = random_sum();
        noise_form form = form_of(&s);
        iv range = noise_form_range(&form, s.radius);
        float slope[3], error = 0, least = INFINITY, most = -INFINITY;
        for (int a = 0; a < 3; a++)
            slope[a] = fabsf(form.jet.gradient[a]) + noise_form_slope_spread(&form, s.radius, a);
        for (int n = 0; n < s.num; n++)
            error += 0x1p-17f * s.amplitude[n];
        for (int i = 0; i < points; i++) {
            int64_t voxel[3];
            uint32_t fraction[3];
            float weight[MAX_NOISES];
            for (int n = 0; n < s.num; n++)
                weight[n] = s.fades[n] ? (float)random_below(5) / 4 : 1.0f;
            random_point(&s, voxel, fraction);
            float value = sum_at(&s, voxel, fraction, weight);
            num += !(value >= range.lo && value <= range.hi);
            least = k_min(least, value);
            most = k_max(most, value);
            /* and on along an axis */
            int a = (int)random_below(3);
            int64_t other_voxel[3];
            uint32_t other_fraction[3];
            random_point(&s, other_voxel, other_fraction);
            for (int j = 0; j < 3; j++)
                if (j != a) {
                    other_voxel[j] = voxel[j];
                    other_fraction[j] = fraction[j];
                }
            double distance =
                fabs((double)(other_voxel[a] - voxel[a]) + ((double)other_fraction[a] - (double)fraction[a]) * 0x1p-32);
            float other = sum_at(&s, other_voxel, other_fraction, weight);
            num += !(fabs((double)other - (double)value) <= (double)slope[a] * distance + 2 * (double)error);
        }
        share += ((double)most - (double)least) / ((double)range.hi - (double)range.lo);
    }
    if (tightness)
        *tightness = share / boxes;
    return num;
}

static void test_forms_hold_the_noise(void **state)
{
    (void)state;
    double tightness;
    mutant = MUTANT_NONE;
    assert_int_equal(form_escapes(40000, 40, &tightness), 0);
    print_message("[          ] range seen in 40 points is %.0f %% of the range proven\n", 100 * tightness);
    assert_true(tightness > 0.3);

    static const enum mutant mutants[] = {MUTANT_ERROR, MUTANT_THIRD, MUTANT_SQUARE, MUTANT_FADES, MUTANT_SLOPE_REST};
    for (size_t i = 0; i < sizeof mutants / sizeof *mutants; i++) {
        mutant = mutants[i];
        long num = form_escapes(20000, 40, NULL);
        print_message("[          ] mutant %d: %ld escapes\n", (int)mutant, num);
        if (num == 0)
            fail_msg("mutant %d is not noticed", (int)mutant);
    }
    mutant = MUTANT_NONE;
}

/* Boxes up to the size of the world: everything stays finite and holds the noise's range. */
static void test_huge_boxes_are_bounded_by_the_range(void **state)
{
    (void)state;
    mutant = MUTANT_NONE;
    for (int log2_size = 4; log2_size < 63; log2_size++) {
        const float cells[3] = {0.01f, 0.02f, 0.01f}, r = ldexpf(1.0f, log2_size - 1), radius[3] = {r, r, r};
        noise_position p = {{{1, 2}, {3, 4}, {5, 6}}};
        noise_form form = noise_form_zero();
        noise_form_add(&form, &p, 1u, 10.0f, cells, radius, 0);
        iv range = noise_form_range(&form, radius);
        assert_true(iv_finite(range));
        assert_true(range.lo > -10.41f && range.hi < 10.41f);
        if (log2_size > 9)
            assert_true(range.lo < -10.364f && range.hi > 10.364f);
        for (int a = 0; a < 3; a++)
            assert_true(fabsf(form.jet.gradient[a]) + noise_form_slope_spread(&form, radius, a) <
                        10 * 0.02f * 4 * 3.78f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_intervals_hold_their_results),
        cmocka_unit_test(test_forms_hold_the_noise),
        cmocka_unit_test(test_huge_boxes_are_bounded_by_the_range),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
