/* Surfaces of clear matter against the formulas in long double: what they reflect, where rays go, where all is
 * reflected. */
#include "raycast/light/dielectric.clh"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

static const long double degree = 3.14159265358979323846264338327950288L / 180;

/* In the plane of x and y, towards a surface whose normal is y. */
static dielectric at_angle(long double angle, float ratio, vector3 *direction, vector3 *normal)
{
    *direction = (vector3){(float)sinl(angle), (float)-cosl(angle), 0};
    *normal = (vector3){0, 1, 0};
    return dielectric_of(direction, normal, ratio);
}

/* Of light across and along the plane that it is reflected in. */
static long double fresnel(long double angle, long double ratio, long double *across, long double *along)
{
    const long double sine = ratio * sinl(angle), ci = cosl(angle);
    *across = *along = 1;
    if (sine >= 1)
        return 1;
    const long double ct = sqrtl(1 - sine * sine);
    *across = powl((ratio * ci - ct) / (ratio * ci + ct), 2);
    *along = powl((ratio * ct - ci) / (ratio * ct + ci), 2);
    return (*across + *along) / 2;
}

static void reflectance_is_fresnels(void **state)
{
    (void)state;
    static const float indices[] = {1.0003f, 1.33f, 1.5f, 2.417f};
    long double worst = 0, across, along;
    for (int i = 0; i < 4; i++)
        for (int into = 0; into < 2; into++)
            for (int a = 0; a < 90; a++) {
                vector3 d, n;
                const float ratio = into ? 1 / indices[i] : indices[i];
                const long double angle = a * degree;
                /* the angle that the float directions stand for */
                const dielectric f = at_angle(angle, ratio, &d, &n);
                const long double is = acosl((long double)f.cosine > 1 ? 1 : (long double)f.cosine);
                const long double expected = fresnel(is, (long double)ratio, &across, &along);
                const long double off = fabsl((long double)f.reflected - expected);
                worst = off > worst ? off : worst;
                assert_true(f.reflected >= 0 && f.reflected <= 1);
                /* Snell's law, and unit length, of the refracted ray; the reflected one leaves as steeply. */
                const vector3 r = dielectric_reflected(&f, &d, &n), t = dielectric_refracted(&f, &d, &n);
                assert_true(fabsf(r.x - d.x) < 2e-7f && fabsf(r.y + d.y) < 2e-7f);
                if (f.far_cosine > 0)
                    assert_true(fabsl((long double)t.x - (long double)ratio * (long double)d.x) < 1e-6L && t.y < 0);
                else
                    assert_true((long double)ratio * sinl(is) > 0.99999L && f.reflected == 1);
            }
    print_message("off by %.2Lg at most\n", worst);
    assert_true(worst < 2e-5L);
}

static void brewsters_angle_reflects_only_across(void **state)
{
    (void)state;
    static const float indices[] = {1.33f, 1.5f, 2.417f};
    for (int i = 0; i < 3; i++) {
        long double across, along;
        vector3 d, n;
        const long double angle = atanl((long double)indices[i]);
        const dielectric f = at_angle(angle, 1 / indices[i], &d, &n);
        fresnel(angle, 1 / (long double)indices[i], &across, &along);
        assert_true(along < 1e-12L);
        assert_true(fabsl((long double)f.reflected - across / 2) < 1e-6L);
        /* The reflected and the refracted ray are at right angles. */
        const vector3 r = dielectric_reflected(&f, &d, &n), t = dielectric_refracted(&f, &d, &n);
        assert_true(fabsf(r.x * t.x + r.y * t.y) < 1e-6f);
    }
}

static void total_reflection_begins_at_its_angle(void **state)
{
    (void)state;
    static const float indices[] = {1.33f, 1.5f, 2.417f};
    for (int i = 0; i < 3; i++) {
        vector3 d, n;
        const long double angle = asinl(1 / (long double)indices[i]);
        const dielectric before = at_angle(angle - 1e-5L, indices[i], &d, &n),
                         after = at_angle(angle + 1e-5L, indices[i], &d, &n);
        assert_true(before.reflected < 1 && before.far_cosine > 0);
        assert_true(after.reflected == 1 && after.far_cosine == 0);
    }
}

/* From either side as much is let through; nothing parts where the indices are the same. */
static void both_sides_agree(void **state)
{
    (void)state;
    vector3 d, n, back_n;
    for (int a = 0; a < 90; a++) {
        const dielectric f = at_angle(a * degree, 1 / 1.5f, &d, &n);
        const vector3 t = dielectric_refracted(&f, &d, &n), back = {-t.x, -t.y, -t.z};
        back_n = (vector3){0, -1, 0};
        const dielectric g = dielectric_of(&back, &back_n, 1.5f);
        assert_true(fabsf(f.reflected - g.reflected) < 3e-5f);
        const dielectric none = at_angle(a * degree, 1, &d, &n);
        assert_true(none.reflected < 1e-6f);
    }
}

static void strange_numbers_are_bounded(void **state)
{
    (void)state;
    static const float strange[] = {0, -3, NAN, -INFINITY, 0.999f};
    for (int i = 0; i < 5; i++)
        assert_true(dielectric_ior(strange[i]) == 1);
    assert_true(dielectric_ior(INFINITY) == DIELECTRIC_MOST_IOR);
    vector3 d = {0, 1, 0}, n = {0, 1, 0}; /* a normal that looks away */
    const dielectric f = dielectric_of(&d, &n, 1.5f);
    const vector3 on = dielectric_reflected(&f, &d, &n);
    assert_true(f.reflected == 1 && on.x == 0 && on.y == 1 && on.z == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reflectance_is_fresnels),
        cmocka_unit_test(brewsters_angle_reflects_only_across),
        cmocka_unit_test(total_reflection_begins_at_its_angle),
        cmocka_unit_test(both_sides_agree),
        cmocka_unit_test(strange_numbers_are_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
