/* Haze that thins with height, against the same integral in small steps. On the host: the device runs the same text. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "raycast/light/light.clh"
#include "raycast/light/light.h"

#define VOXEL_M 0.0625
#define GLOBE_M 6371000.0

/* The mean of exp(-height / thins) along a ray, heights below 0 counting as 0. */
static double mean_thickness(const karst_haze *haze, const double eye_m[3], const double direction[3], double way_m)
{
    enum { STEPS = 20000 };
    double sum = 0;
    for (int i = 0; i < STEPS; i++) {
        double t = way_m * (i + 0.5) / STEPS, p[3], squares = 0;
        for (int a = 0; a < 3; a++) {
            p[a] = eye_m[a] + t * direction[a];
            squares += p[a] * p[a];
        }
        double height_m = haze->globe_m > 0 ? sqrt(squares) - haze->globe_m : p[1];
        sum += exp(-fmax(0, height_m) / haze->height_m);
    }
    return sum / STEPS;
}

static double thickness(const karst_haze *haze, const double eye_m[3], const double direction[3], double way_m)
{
    karst_light light = karst_light_of_sun(120, 30);
    karst_light_set_haze(&light, haze, eye_m, VOXEL_M);
    const vector3 d = {(float)direction[0], (float)direction[1], (float)direction[2]};
    return (double)haze_thickness(&light, &d, (float)(way_m / VOXEL_M));
}

static void test_is_the_integral(void **state)
{
    (void)state;
    const double ways_m[] = {0.5, 30, 900, 20000, 60000}, elevations_deg[] = {-70, -20, -3, -0.4, 0, 0.4, 3, 40};
    const double heights_m[] = {2, 150, 4000};
    double worst[2] = {0};
    for (int globe = 0; globe < 2; globe++)
        for (int h = 0; h < 3; h++)
            for (int e = 0; e < 8; e++)
                for (int w = 0; w < 5; w++) {
                    const karst_haze haze = {20000, 1200, globe ? GLOBE_M : 0};
                    /* Somewhere on the globe, not at its top. */
                    const double up[3] = {globe ? 0.6 : 0, globe ? 0.8 : 1, 0}, along[3] = {-up[1], up[0], 0};
                    double eye_m[3], direction[3], elevation = elevations_deg[e] * (M_PI / 180);
                    for (int a = 0; a < 3; a++) {
                        eye_m[a] = up[a] * (globe ? GLOBE_M + heights_m[h] : heights_m[h]);
                        direction[a] = up[a] * sin(elevation) + along[a] * cos(elevation);
                    }
                    /* Rays end at the ground. */
                    double way_m = ways_m[w];
                    if (elevation < 0)
                        way_m = fmin(way_m, heights_m[h] / -sin(elevation));
                    double difference = fabs(thickness(&haze, eye_m, direction, way_m) -
                                             mean_thickness(&haze, eye_m, direction, way_m));
                    worst[globe] = fmax(worst[globe], difference);
                }
    print_message("off by %.5f at most on flat ground, by %.5f on a globe\n", worst[0], worst[1]);
    assert_true(worst[0] < 0.001);
    /* On 60 km the ground bends by 280 m, and lies 70 m above the middle of the chord: of 1200 in which haze thins. */
    assert_true(worst[1] < 0.04);
}

/* What is far below is clear from high up, and hidden from within; without a height haze is as it was. */
static void test_high_up_it_is_clear(void **state)
{
    (void)state;
    const karst_haze thin = {20000, 1200, GLOBE_M}, even = {20000, 0, GLOBE_M};
    const double far_up[3] = {0, GLOBE_M + 2e6, 0}, ground[3] = {0, GLOBE_M + 2, 0}, down[3] = {0, -1, 0},
                 level[3] = {1, 0, 0};
    assert_true(thickness(&thin, far_up, down, 2e6) * 2e6 < 1.01 * 1200);
    assert_true(thickness(&thin, far_up, down, 2e6) * 2e6 > 0.99 * 1200);
    assert_true(thickness(&thin, ground, level, 5000) > 0.99);
    karst_light light = karst_light_of_sun(120, 30);
    karst_light_set_haze(&light, &even, far_up, VOXEL_M);
    assert_true(light.haze_thinning == 0);
    assert_true(light.haze_distance == (float)(20000 / VOXEL_M));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_is_the_integral),
        cmocka_unit_test(test_high_up_it_is_clear),
    };
    return cmocka_run_group_tests_name("haze", tests, NULL, NULL);
}
