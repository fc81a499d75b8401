/* Media along single rays (karst/medium.h): of a uniform one and of a layer as long as the way through them, with the
 * land that ends rays; and what is refused. */
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
#include "karst/medium.h"

/* Land below 0, 4 per kilometre above it up to 300 m. */
static const char text[] = "/*{ \"voxel\": 1, \"view\": 4000 }*/\n"
                           "float density(vec3 p) { return -p.y; }\n"
                           "medium air(vec3 p) { medium m;\n"
                           "m.extinction = clamp((300.0 - p.y) * 0.1, 0.0, 1.0) * 0.004;\n"
                           "m.albedo = vec3(1.0); m.g = 0.0; m.emission = vec3(0.0); return m; }\n";
static char path[] = "/tmp/karst-ray-XXXXXX.karst";

static karst_world *open_world(const char *name)
{
    karst_error error = {0};
    const karst_world_config config = {.world = name};
    karst_world *world = karst_world_open(&config, &error);
    if (!world)
        fail_msg("%s", error.message);
    return world;
}

static int set_up(void **state)
{
    int file = mkstemps(path, 6);
    bool written = file >= 0 && write(file, text, sizeof text - 1) == (ssize_t)(sizeof text - 1);
    if (file >= 0)
        close(file);
    *state = written ? open_world(path) : NULL;
    return *state ? 0 : 1;
}

static int tear_down(void **state)
{
    karst_world_close(*state);
    return unlink(path);
}

static karst_medium_ray ray_from(double y, double dx, double dy)
{
    karst_medium_ray ray = {.direction = {dx, dy, 0}, .device = getenv("KARST_DEVICE")};
    ray.from.voxel[1] = (int64_t)y;
    return ray;
}

static void test_depth(void **state)
{
    /* The layer ends by 5 m of it on either side of 295 m. */
    static const struct {
        double y, dx, dy, hit_m, depth;
    } rays[] = {{1000, 0, -2, 1000, 0.004 * 295}, {100, 1, 1, INFINITY, 0.004 * 195 * 1.4142135623730951},
                {100, 0.6, -0.8, 125, 0.5},       {2000, 1, 0, INFINITY, 0}};
    for (size_t i = 0; i < sizeof rays / sizeof *rays; i++) {
        const karst_medium_ray ray = ray_from(rays[i].y, rays[i].dx, rays[i].dy);
        karst_medium_depth depth;
        karst_error error = {0};
        if (!karst_world_medium_depth(*state, &ray, &depth, &error))
            fail_msg("%s", error.message);
        print_message("# from %g m: hit %g m, depth %.6f, the oracle's %.6f, true %.6f\n", rays[i].y, depth.hit_m,
                      depth.optical_depth, depth.oracle_optical_depth, rays[i].depth);
        assert_true(isinf(rays[i].hit_m) ? isinf(depth.hit_m) : fabs(depth.hit_m - rays[i].hit_m) < 0.05);
        assert_true(fabs(depth.optical_depth - rays[i].depth) < 1e-3 * rays[i].depth + 1e-9);
        assert_true(fabs(depth.oracle_optical_depth - rays[i].depth) < 1e-3 * rays[i].depth + 1e-9);
        assert_true(fabs(depth.transmittance - exp(-depth.optical_depth)) < 1e-12);
    }
}

static void refuse(const karst_world *world, const karst_medium_ray *ray, karst_status status, const char *word)
{
    karst_medium_depth depth;
    karst_error error = {0};
    assert_false(karst_world_medium_depth(world, ray, &depth, &error));
    assert_int_equal(error.status, status);
    if (!strstr(error.message, word))
        fail_msg("'%s' does not say '%s'", error.message, word);
}

static void test_bad_input(void **state)
{
    karst_medium_ray ray = ray_from(10, 0, 0);
    refuse(*state, &ray, KARST_USAGE, "direction");
    ray.direction[0] = (double)NAN;
    refuse(*state, &ray, KARST_USAGE, "direction");
    ray = ray_from(10, 1, 0);
    ray.footprint_m = -1;
    refuse(*state, &ray, KARST_USAGE, "footprint");
    ray.footprint_m = (double)NAN;
    refuse(*state, &ray, KARST_USAGE, "footprint");
    ray = ray_from(10, 1, 0);
    ray.from.voxel[0] = INT64_MAX;
    refuse(*state, &ray, KARST_USAGE, "2^61");
    ray = ray_from(10, 1, 0);
    ray.device = "no such device";
    refuse(*state, &ray, KARST_NO_DEVICE, "no such device");
    karst_world *plain = open_world("hills");
    assert_true(karst_world_has_medium(*state));
    assert_false(karst_world_has_medium(plain));
    ray = ray_from(10, 1, 0);
    refuse(plain, &ray, KARST_USAGE, "medium");
    karst_world_close(plain);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_depth), cmocka_unit_test(test_bad_input)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
