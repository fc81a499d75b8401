/* How much densities in a box differ: never more than is said, for any two places and footprint. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/edit.h"
#include "producers/density/sampler_slopes.h"

static uint32_t random_state = 11;

static double random_between(double low, double high)
{
    random_state = random_state * 1664525u + 1013904223u;
    return low + (high - low) * (random_state >> 8) / 16777216;
}

static karst_world *world_of(const char *text)
{
    char path[] = "/tmp/karst_slopes_XXXXXX.karst";
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text) && close(fd) == 0);
    karst_error error = {0};
    const karst_world_config config = {.world = path};
    karst_world *world = karst_world_open(&config, &error);
    unlink(path);
    if (!world)
        fail_msg("%s", error.message);
    return world;
}

static const char *const texts[] = {
    "/*{ \"voxel\": 0.125 }*/\nfloat density(vec3 p) { return 80.0 - length(p) + 3.0 * sin(0.3 * p.x) * sin(0.3 * "
    "p.y); }\n",
    "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 9.0 * noise(p * 0.05) + 2.0 * fbm(p * 0.21, 5) - p.y; }\n",
    "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return min(4.0 - length(mod(p, 11.0) - 5.5), 0.3 * p.y); "
    "}\n",
};

static void test_slopes(void **state)
{
    (void)state;
    enum { NUM_BOXES = 400, NUM_PAIRS = 40 };
    for (size_t t = 0; t < sizeof texts / sizeof *texts; t++) {
        karst_world *world = world_of(texts[t]);
        karst_sampler *sampler = karst_sampler_create(world, NULL);
        assert_non_null(sampler);
        const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
        int num_known = 0;
        double tightest = 0;
        for (int i = 0; i < NUM_BOXES; i++) {
            const double footprint_m = i % 2 ? 3 : 0, size_m = exp2(random_between(-3, 4));
            const double half_m[3] = {size_m * random_between(0.5, 1), size_m, size_m * random_between(0.5, 1)};
            const double middle_m[3] = {random_between(-99, 99), random_between(-99, 99), random_between(-99, 99)};
            const karst_position zero = {{0, 0, 0}, {0, 0, 0}};
            const karst_position centre = karst_position_add_m(zero, middle_m, voxel_log2_m);
            karst_sampler_slopes slopes;
            double range[2], same[2];
            const bool known = karst_sampler_prove(sampler, &centre, half_m, footprint_m, range, &slopes);
            assert_int_equal(karst_sampler_bounds(sampler, &centre, half_m, footprint_m, same), known);
            assert_memory_equal(range, same, sizeof range);
            num_known += slopes.is_known;
            for (int k = 0; k < NUM_PAIRS && slopes.is_known; k++) {
                karst_position at[2];
                double offset_m[2][3], most = slopes.slack;
                float density[2];
                for (int end = 0; end < 2; end++) {
                    for (int axis = 0; axis < 3; axis++)
                        offset_m[end][axis] = k < 8 ? (k >> axis & 1 ? 1 : -1) * (end ? -1 : 1) * half_m[axis]
                                                    : random_between(-half_m[axis], half_m[axis]);
                    at[end] = karst_position_add_m(centre, offset_m[end], voxel_log2_m);
                }
                for (int axis = 0; axis < 3; axis++) /* places are rounded to 2^-32 voxel */
                    most +=
                        slopes.in_m[axis] * (fabs(offset_m[1][axis] - offset_m[0][axis]) + ldexp(1, voxel_log2_m - 31));
                karst_sampler_densities(sampler, at, 2, footprint_m, density);
                const double differ = fabs((double)density[1] - (double)density[0]);
                if (differ > most)
                    fail_msg("world %zu, box %d: densities %.9g and %.9g differ by more than %.9g", t, i,
                             (double)density[0], (double)density[1], most);
                tightest = fmax(tightest, differ / most);
            }
        }
        print_message("world %zu: slopes of %d of %d boxes are known, used to %.3f\n", t, num_known, NUM_BOXES,
                      tightest);
        assert_true(num_known > NUM_BOXES * 3 / 4 && tightest > 0.5);
        karst_sampler_destroy(sampler);
        karst_world_close(world);
    }
}

/* Nothing is said where edits or a flat text may be other than the tape tells. */
static void test_not_known(void **state)
{
    (void)state;
    karst_world *flat =
        world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return max(sin(p.x) - p.y, 0.0); }\n");
    karst_world *plain = world_of(texts[0]);
    const karst_edit edit = {.shape = KARST_EDIT_SPHERE, .mode = KARST_EDIT_ADD, .radius_m = 30};
    const karst_position centre = {{0, 0, 0}, {0, 0, 0}};
    const double half_m[3] = {2, 2, 2};
    for (int i = 0; i < 3; i++) {
        karst_sampler *sampler = karst_sampler_create(i == 0 ? flat : plain, NULL);
        karst_sampler_slopes slopes;
        double range[2];
        assert_non_null(sampler);
        assert_true(i != 1 || karst_sampler_set_edits(sampler, &edit, 1, NULL));
        karst_sampler_prove(sampler, &centre, half_m, 0, range, &slopes);
        assert_int_equal(slopes.is_known, i == 2);
        karst_sampler_destroy(sampler);
    }
    karst_world_close(flat);
    karst_world_close(plain);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_slopes), cmocka_unit_test(test_not_known)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
