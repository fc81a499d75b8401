/* Pictures of a wall at which the density jumps, round and upright, with hits refined and not: it stands where the
 * density jumps, and its normals are the wall's, not those of the ground that ends there. */
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

#include "karst/karst.h"

enum { WIDTH = 96, HEIGHT = 64, NUM = WIDTH * HEIGHT };
static const double RADIUS_M = 20;

/* A tower of 30 m. The density is metres above or below its floors, so it jumps by 30 at the wall. */
static const char text[] = "/*{ \"voxel\": 0.0625, \"view\": 300,\n"
                           "\"camera\": { \"position\": [\"0\", \"12\", \"-55\"], \"pitch\": -8, \"fov\": 60 } }*/\n"
                           "float density(vec3 p) {\n"
                           "    return 30.0 * (1.0 - min(floor(length(p.xz) / 20.0), 1.0)) - p.y;\n"
                           "}\n";

static float *read_aov(karst_engine *engine, karst_aov aov)
{
    karst_error error = {0};
    const size_t num = (size_t)(NUM * karst_aov_width(aov));
    float *values = malloc(num * sizeof *values);
    assert_non_null(values);
    if (!karst_engine_read_aov(engine, aov, values, num, &error))
        fail_msg("%s", error.message);
    return values;
}

static void look(bool refine)
{
    char path[] = "/tmp/karst-jumps-XXXXXX.karst";
    karst_error error = {0};
    int file = mkstemps(path, 6);
    assert_true(file >= 0 && write(file, text, sizeof text - 1) == (ssize_t)(sizeof text - 1));
    close(file);
    const karst_engine_config config = {.world = path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)64 << 20,
                                        .no_shadows = true,
                                        .refine = refine};
    karst_engine *engine = karst_engine_create(&config, &error);
    unlink(path);
    if (!engine)
        fail_msg("%s", error.message);
    bool settled;
    assert_true(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error) && settled);
    float *normal = read_aov(engine, KARST_AOV_NORMAL), *position = read_aov(engine, KARST_AOV_POSITION),
          *level = read_aov(engine, KARST_AOV_LEVEL);
    int num_wall = 0, num_turned = 0;
    double most_off = 0, sum_deg = 0;
    for (int i = 0; i < NUM; i++) {
        const float *p = position + 3 * i, *n = normal + 3 * i;
        const double voxel_m = 0.0625 * exp2((double)level[i]), out_m = hypot((double)p[0], (double)p[2]);
        /* on the wall, away from where it ends */
        if (level[i] < 0 || fabs(out_m - RADIUS_M) > voxel_m || p[1] < 3 || p[1] > 27)
            continue;
        const double along = ((double)p[0] * (double)n[0] + (double)p[2] * (double)n[2]) / out_m;
        const double turned_deg = acos(fmin(along, 1)) * 57.29577951308232;
        num_wall++;
        num_turned += turned_deg > 5;
        sum_deg += turned_deg;
        most_off = fmax(most_off, fabs(out_m - RADIUS_M) / voxel_m);
    }
    print_message("# refined %d: %d pixels of the wall, %.3f voxels off, normals by %.2f degrees, %d by over 5\n",
                  refine,
                  num_wall, most_off, sum_deg / num_wall, num_turned);
    assert_true(num_wall > 1000);
    assert_true(most_off < 0.1 && sum_deg / num_wall < 1.5 && num_turned * 200 < num_wall);
    free(normal);
    free(position);
    free(level);
    karst_engine_destroy(engine);
}

static void test_wall(void **state)
{
    (void)state;
    look(false);
}
static void test_refined_wall(void **state)
{
    (void)state;
    look(true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_wall), cmocka_unit_test(test_refined_wall)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
