/* Dull mirrors on the host: what they give back, where to, and whether both ways are alike. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#define LANES 1
#include "raycast/light/gloss.clh"

enum { NUM = 1 << 16 };
static const float alphas[] = {0.09f, 0.3f, 0.7f, 1.0f};
#define NUM_ALPHAS (sizeof alphas / sizeof *alphas)

static vector3 at_angle(double polar_deg, double around_deg)
{
    const double polar = polar_deg * (M_PI / 180), around = around_deg * (M_PI / 180);
    const vector3 v = {(float)(sin(polar) * cos(around)), (float)(sin(polar) * sin(around)), (float)cos(polar)};
    return v;
}

/* Even over the upper half of directions: each is as likely as 1 / (2 pi). */
static vector3 anywhere(uint32_t i)
{
    const jitter at = jitter_of(7, 11, i + 1, 0x1234567u);
    const double z = (double)at.u, r = sqrt(1 - z * z);
    const vector3 v = {(float)(r * cos(2 * M_PI * (double)at.v)), (float)(r * sin(2 * M_PI * (double)at.v)), (float)z};
    return v;
}

/* What lamps all over the sky would bring adds up to all that there is; and paths go where lamps say that they do. */
static void all_light_comes_back(void **state)
{
    (void)state;
    for (size_t a = 0; a < NUM_ALPHAS; a++)
        for (int polar = 5; polar < 90; polar += 20) {
            const vector3 eye = at_angle(polar, 30);
            double sum = 0, height = 0, ahead = 0, of_paths[2] = {0};
            for (uint32_t i = 0; i < NUM; i++) {
                const vector3 lamp = anywhere(i);
                const gloss_way way = gloss_walk(&eye, alphas[a], &lamp, 3, 5, i + 1, 99);
                const double weight = (double)way.of_lamp * 2 * M_PI / NUM;
                assert_true(way.of_lamp >= 0 && way.direction.z >= 0);
                assert_true(fabs((double)dot_of(&way.direction, &way.direction) - 1) < 1e-5);
                sum += weight;
                height += weight * (double)lamp.z;
                ahead += weight * (double)(lamp.x * 0.866f + lamp.y * 0.5f);
                of_paths[0] += (double)way.direction.z / NUM;
                of_paths[1] += (double)(way.direction.x * 0.866f + way.direction.y * 0.5f) / NUM;
            }
            print_message("alpha %.2f, %2d degrees: %.4f; height %.4f of %.4f, ahead %.4f of %.4f\n", (double)alphas[a],
                          polar, sum, height, of_paths[0], ahead, of_paths[1]);
            const double room = alphas[a] < 0.2f ? 0.05 : 0.012; /* narrow lobes are found by few lamps */
            assert_true(fabs(sum - 1) < room);
            assert_true(fabs(height - of_paths[0]) < room && fabs(ahead - of_paths[1]) < room);
        }
}

static double reflected(const vector3 *eye, const vector3 *lamp, float alpha)
{
    double sum = 0;
    for (uint32_t i = 0; i < NUM; i++)
        sum += (double)gloss_walk(eye, alpha, lamp, 3, 5, i + 1, 77).of_lamp / NUM;
    return sum / (double)lamp->z;
}

/* Eye and lamp may change places. */
static void both_ways_are_alike(void **state)
{
    (void)state;
    static const double angles[][4] = {{20, 0, 60, 180}, {10, 0, 80, 90}, {70, 0, 75, 170}, {45, 0, 45, 20}};
    for (size_t a = 1; a < NUM_ALPHAS; a++)
        for (size_t i = 0; i < sizeof angles / sizeof *angles; i++) {
            const vector3 one = at_angle(angles[i][0], angles[i][1]), two = at_angle(angles[i][2], angles[i][3]);
            const double there = reflected(&one, &two, alphas[a]), back = reflected(&two, &one, alphas[a]);
            print_message("alpha %.2f: %.5f, %.5f\n", (double)alphas[a], there, back);
            assert_true(fabs(there - back) < 0.02 * fmax(there, 0.005));
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_light_comes_back),
        cmocka_unit_test(both_ways_are_alike),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
