/* Each error that the public headers document of functions that need a device: tests/api/run.sh sees to it that none is
 * left out. What the functions do otherwise is for the tests of their parts. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/provoke.h"

enum { WIDTH = 16, HEIGHT = 12, NUM = WIDTH * HEIGHT };

static char folder[] = "/tmp/karst-errors-XXXXXX";
static char ball[64], other[64], wrong[64], misty[64];
static uint8_t rgba[NUM * 4];
static float values[NUM * 3];

static void write_text(char path[64], const char *name, const char *text)
{
    snprintf(path, 64, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_true(file && fputs(text, file) >= 0 && fclose(file) == 0);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return 1;
    write_text(ball, "ball.karst",
               "/*{ \"voxel\": 0.25, \"view\": 100, \"camera\": { \"position\": [0, 0, -12] },\n"
               "\"params\": { \"radius\": { \"value\": 5 }, \"lumps\": { \"value\": 1 } } }*/\n"
               "float density(vec3 p) { float d = radius - length(p);\n"
               "for (int i = 0; i < int(lumps); i++) d = max(d, 1.0 - length(p - vec3(float(i), 4.0, 0.0)));\n"
               "return d; }\nvec3 colour(vec3 p, vec3 n) { return vec3(0.5, 0.25, 0.125); }\n");
    write_text(other, "other.karst",
               "/*{ \"voxel\": 0.25, \"view\": 100 }*/\nfloat density(vec3 p) { return 4.0 - length(p); }\n");
    write_text(misty, "misty.karst",
               "/*{ \"voxel\": 0.25, \"view\": 100 }*/\nfloat density(vec3 p) { return -p.y; }\n"
               "medium air(vec3 p) { medium m; m.extinction = 0.01; return m; }\n");
    write_text(wrong, "wrong.karst", "float density(vec3 p) { return; }\n");
    return 0;
}

static int tear_down(void **state)
{
    char command[64];
    (void)state;
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}

static karst_engine_config config_of(const char *world)
{
    return (karst_engine_config){.world = world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .pool_bytes = (uint64_t)32 << 20,
                                 .view_distance_m = 100,
                                 .samples = 2,
                                 .tone = KARST_TONE_OF_FILM,
                                 .no_shadows = true};
}

static karst_engine *create(void)
{
    karst_error error = {0};
    const karst_engine_config config = config_of(ball);
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static void settle(karst_engine *engine)
{
    karst_error error = {0};
    bool settled = false;
    if (!karst_engine_settle(engine, 0, NULL, NULL, &settled, &error) || !settled)
        fail_msg("not settled: %s", error.message);
}

static void test_making_one(void **state)
{
    (void)state;
    karst_engine_config config = config_of(ball);
    config.width_px = 16385;
    PROVOKE(KARST_USAGE, karst_engine_create, (&config, &error));
    config = config_of(wrong);
    PROVOKE(KARST_BAD_WORLD, karst_engine_create, (&config, &error));
    config = config_of(ball);
    config.edits = "/nowhere/edits.json";
    PROVOKE(KARST_BAD_DATA, karst_engine_create, (&config, &error));
    config = config_of(ball);
    config.device = "no such device";
    PROVOKE(KARST_NO_DEVICE, karst_engine_create, (&config, &error));
    config = config_of(ball);
    PROVOKE_DEVICE(karst_engine_create, (&config, &error));
    const karst_world_config of_ball = {.world = ball};
    karst_world *world = karst_world_open(&of_ball, NULL);
    PROVOKE(KARST_NO_DEVICE, karst_world_try_code, (world, "no such device", &error));
    PROVOKE_DEVICE(karst_world_try_code, (world, NULL, &error));
    karst_world_close(world);
}

static void test_points_of_a_program(void **state)
{
    (void)state;
    const karst_world_config of_ball = {.world = ball}, of_wrong = {.world = wrong};
    const karst_position at = {.voxel = {0, 0, 0}};
    float density;
    write_text(wrong, "steps.karst",
               "/*{ \"voxel\": 0.25, \"view\": 100 }*/\n"
               "float density(vec3 p) { return length(p) < 5.0 ? 1.0 : 0.0; }\n");
    karst_world *world = karst_world_open(&of_ball, NULL), *steps = karst_world_open(&of_wrong, NULL);
    assert_true(world && steps);
    PROVOKE(KARST_USAGE, karst_device_points_create, (steps, NULL, NULL, &error));
    PROVOKE(KARST_NO_DEVICE, karst_device_points_create, (world, "no such device", NULL, &error));
    PROVOKE_DEVICE(karst_device_points_create, (world, NULL, NULL, &error));
    karst_device_points *points = karst_device_points_create(world, NULL, NULL, NULL);
    assert_non_null(points);
    PROVOKE(KARST_USAGE, karst_device_points_find, (points, &at, 1, -1, &density, NULL, &error));
    PROVOKE_DEVICE(karst_device_points_find, (points, &at, 1, 0, &density, NULL, &error));
    karst_device_points_destroy(points);
    karst_world_close(world);
    karst_world_close(steps);
    write_text(wrong, "wrong.karst", "float density(vec3 p) { return; }\n");
}

static void test_a_ray_in_fog(void **state)
{
    (void)state;
    const karst_world_config of_misty = {.world = misty};
    karst_error why = {0};
    karst_world *world = karst_world_open(&of_misty, &why);
    if (!world)
        fail_msg("%s", why.message);
    karst_medium_ray ray = {.from = {.voxel = {0, 40, 0}}, .direction = {0, -1, 0}, .footprint_m = 0.5};
    karst_medium_depth depth;
    PROVOKE_DEVICE(karst_world_medium_depth, (world, &ray, &depth, &error));
    ray.device = "no such device";
    PROVOKE(KARST_NO_DEVICE, karst_world_medium_depth, (world, &ray, &depth, &error));
    ray.direction[1] = 0;
    PROVOKE(KARST_USAGE, karst_world_medium_depth, (world, &ray, &depth, &error));
    karst_world_close(world);

    const karst_engine_config config = config_of(misty);
    static float maps[2][NUM * 4];
    bool settled;
    karst_engine *engine = karst_engine_create(&config, &why);
    if (!engine)
        fail_msg("%s", why.message);
    PROVOKE(KARST_USAGE, karst_engine_six_way, (engine, 1, NULL, NULL, maps[0], maps[1], NUM, &settled, &error));
    PROVOKE_DEVICE(karst_engine_six_way, (engine, 1, NULL, NULL, maps[0], maps[1], NUM * 4, &settled, &error));
    karst_engine_destroy(engine);
}

/* Before anything was drawn, and with numbers that are out of range: nothing changes. */
static void test_wrong_usage(void **state)
{
    (void)state;
    karst_engine *engine = create();
    const karst_parameter unknown = {"colour", 1}, endless = {"lumps", 1e6};
    const karst_sun sun = {0, 91};
    karst_camera camera = karst_engine_default_camera(engine);
    const karst_engine_window window = {WIDTH, HEIGHT, 1, 0};
    const karst_edit edit = {.shape = KARST_EDIT_SPHERE};
    const karst_world_config nothing = {0}, bad = {.world = wrong}, good = {.world = other};
    const karst_engine_ray ray = {.direction = {0, 0, 1}, .length_m = 10};
    karst_engine_ray rays[NUM];
    karst_engine_hit hit;
    uint32_t pixels[NUM];
    karst_probe probe;
    double value;
    bool shown;
    camera.yaw_deg = (double)NAN;
    PROVOKE(KARST_USAGE, karst_engine_read_aov, (engine, KARST_AOV_DEPTH, values, NUM, &error));
    PROVOKE(KARST_USAGE, karst_engine_read_pixels, (engine, rgba, sizeof rgba, &error));
    PROVOKE(KARST_USAGE, karst_engine_read_radiance, (engine, values, NUM * 3, &error));
    PROVOKE(KARST_USAGE, karst_engine_read_depth, (engine, values, NUM, &error));
    PROVOKE(KARST_USAGE, karst_engine_read_normals, (engine, values, NUM * 3, &error));
    PROVOKE(KARST_USAGE, karst_engine_show, (engine, &error));
    PROVOKE(KARST_USAGE, karst_engine_probe, (engine, 0, 0, &probe, &error));
    PROVOKE(KARST_USAGE, karst_engine_cast_rays, (engine, &ray, 1, 0, &hit, NULL, &error));
    PROVOKE(KARST_USAGE, karst_engine_picture_rays, (engine, rays, pixels, NUM, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_parameters, (engine, &unknown, 1, &error));
    PROVOKE(KARST_BAD_WORLD, karst_engine_set_parameters, (engine, &endless, 1, &error));
    PROVOKE(KARST_USAGE, karst_engine_parameter, (engine, "colour", &value, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_time, (engine, 2e9, &error));
    PROVOKE_MEMORY(karst_engine_set_time, (engine, 1, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_engine_set_media_groups, (engine, 0, &error));
    PROVOKE(KARST_USAGE, karst_engine_prepare_world, (engine, &nothing, &error));
    PROVOKE(KARST_BAD_WORLD, karst_engine_prepare_world, (engine, &bad, &error));
    PROVOKE_DEVICE(karst_engine_prepare_world, (engine, &good, &error));
    assert_true(karst_engine_prepare_colours(engine, NULL));
    PROVOKE(KARST_BAD_WORLD, karst_engine_show_colours, (engine, &bad, &shown, &error));
    faults_fail_memory(0);
    PROVOKE(KARST_FAILED, karst_engine_show_colours, (engine, &good, &shown, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_depth, (engine, values, NUM + 1, &error));
    PROVOKE(KARST_USAGE, karst_engine_edit, (engine, &edit, 1, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_camera, (engine, &camera, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_sun, (engine, &sun, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_exposure, (engine, KARST_EXPOSURE_GIVEN, 21, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_size, (engine, 0, HEIGHT, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_window, (engine, &window, WIDTH, HEIGHT, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_drawn_size, (engine, WIDTH, HEIGHT + 1, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_budget_ms, (engine, -1, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_view, (engine, KARST_NUM_VIEWS, &error));
    PROVOKE(KARST_USAGE, karst_engine_meter, (engine, values, WIDTH, HEIGHT + 1, &error));
    PROVOKE(KARST_USAGE, karst_engine_tone, (engine, values, 0, 0, WIDTH, HEIGHT + 1, rgba, &error));
    PROVOKE(KARST_USAGE, karst_engine_set_sums, (engine, values, NUM * 3, 2, &error));
    settle(engine);
    PROVOKE(KARST_USAGE, karst_engine_read_pixels, (engine, rgba, sizeof rgba - 1, &error));
    PROVOKE(KARST_USAGE, karst_engine_probe, (engine, WIDTH, 0, &probe, &error));
    PROVOKE_DEVICE(karst_engine_cast_rays, (engine, &ray, 1, 0, &hit, NULL, &error));

    /* The configuration's view distance is less than a few voxels of this one. */
    write_text(wrong, "coarse.karst",
               "/*{ \"voxel\": 64, \"view\": 5000 }*/\nfloat density(vec3 p) { return -p.y; }\n");
    karst_prepared_world *world = karst_engine_prepare_world(engine, &bad, NULL);
    assert_non_null(world);
    PROVOKE(KARST_USAGE, karst_engine_change_world, (engine, world, NULL, &error));
    karst_engine_destroy(engine);
}

/* A device that fails: it is said, and what was drawn is there once it works again. */
static void test_a_device_that_fails(void **state)
{
    (void)state;
    karst_engine *engine = create();
    karst_probe probe;
    karst_ceilings ceilings;
    uint64_t num_bricks;
    static uint8_t before[NUM * 4];
    settle(engine);
    assert_true(karst_engine_read_pixels(engine, before, sizeof before, NULL));
    PROVOKE_DEVICE(karst_engine_read_pixels, (engine, rgba, sizeof rgba, &error));
    PROVOKE_DEVICE(karst_engine_read_aov, (engine, KARST_AOV_POSITION, values, NUM * 3, &error));
    PROVOKE_DEVICE(karst_engine_read_radiance, (engine, values, NUM * 3, &error));
    PROVOKE_DEVICE(karst_engine_read_depth, (engine, values, NUM, &error));
    PROVOKE_DEVICE(karst_engine_read_normals, (engine, values, NUM * 3, &error));
    PROVOKE_DEVICE(karst_engine_probe, (engine, 1, 1, &probe, &error));
    PROVOKE_DEVICE(karst_engine_check, (engine, &error));
    PROVOKE_DEVICE(karst_engine_count_hit_bricks, (engine, &num_bricks, &error));
    PROVOKE_DEVICE(karst_engine_meter, (engine, values, WIDTH, HEIGHT, &error));
    PROVOKE_DEVICE(karst_engine_set_view, (engine, KARST_VIEW_LEVEL, &error));
    PROVOKE_DEVICE(karst_measure_create, (engine, &error));
    PROVOKE_MEMORY(karst_engine_set_tracing, (engine, true, &error), provoke_keep);
    PROVOKE_MEMORY(karst_engine_set_sums, (engine, values, NUM * 3, 1, &error), provoke_keep);
    assert_true(karst_engine_read_pixels(engine, rgba, sizeof rgba, NULL));
    assert_memory_equal(rgba, before, sizeof rgba);
    assert_true(karst_engine_check(engine, NULL));
    assert_true(karst_engine_meter(engine, values, WIDTH, HEIGHT, NULL));
    PROVOKE_DEVICE(karst_engine_tone, (engine, values, 0, 0, WIDTH, HEIGHT, rgba, &error));
    if (getenv("KARST_TEST_FULL")) { /* 260 MiB, and kernels of their own */
        karst_measure *measure = karst_measure_create(engine, NULL);
        assert_non_null(measure);
        PROVOKE_DEVICE(karst_measure_ceilings, (measure, &ceilings, &error));
        PROVOKE_DEVICE(karst_measure_floor, (measure, &ceilings, &error));
        karst_measure_destroy(measure);
    }
    karst_engine_destroy(engine);
}

/* Changes that a device does not take. */
static void test_changes_that_fail(void **state)
{
    (void)state;
    const karst_parameter radius = {"radius", 4};
    const karst_world_config good = {.world = other};
    const karst_engine_window window = {4 * WIDTH, 4 * HEIGHT, 0, 0};
    karst_edit edit;
    size_t num = 1;
    bool settled;
    karst_engine *engine = create();
    settle(engine);
    assert_true(karst_edit_parse("sphere,0,5,0,1", -2, &edit, NULL));
    PROVOKE_DEVICE(karst_engine_set_depth, (engine, values, NUM, &error));
    PROVOKE_DEVICE(karst_engine_set_drawn_size, (engine, WIDTH / 2, HEIGHT / 2, &error));
    PROVOKE_DEVICE(karst_engine_edit, (engine, &edit, 1, &error));
    assert_true(karst_engine_edit(engine, &edit, 1, NULL));
    settle(engine);
    PROVOKE_DEVICE(karst_engine_undo, (engine, &num, &error));
    num = 1;
    assert_true(karst_engine_undo(engine, &num, NULL));
    settle(engine);
    num = 1;
    PROVOKE_DEVICE(karst_engine_redo, (engine, &num, &error));
    PROVOKE_DEVICE(karst_engine_set_parameters, (engine, &radius, 1, &error));
    PROVOKE_DEVICE(karst_engine_prepare_colours, (engine, &error));
    karst_prepared_world *world = karst_engine_prepare_world(engine, &good, NULL);
    assert_non_null(world);
    PROVOKE_DEVICE(karst_engine_change_world, (engine, world, NULL, &error));
    PROVOKE_DEVICE(karst_engine_settle, (engine, 0, NULL, NULL, &settled, &error));
    PROVOKE_DEVICE(karst_engine_frame, (engine, &error));
    PROVOKE_DEVICE(karst_engine_set_size, (engine, 2 * WIDTH, 2 * HEIGHT, &error));
    PROVOKE_DEVICE(karst_engine_set_window, (engine, &window, 2 * WIDTH, 2 * HEIGHT, &error));
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_making_one), cmocka_unit_test(test_points_of_a_program),
                                       cmocka_unit_test(test_a_ray_in_fog), cmocka_unit_test(test_wrong_usage),
                                       cmocka_unit_test(test_a_device_that_fails),
                                       cmocka_unit_test(test_changes_that_fail)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
