/* Worlds with an atmosphere: pictures of the sky against the host's, and what pictures do not depend on. */
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
#include "raycast/cast/pinhole.h"
#include "raycast/cast/rays.clh"
#include "raycast/light/atmosphere.clh"
#include "raycast/light/light.h"
#include "raycast/light/skies.h"
#include "tests/support/scene.h"

enum { WIDTH = 48, HEIGHT = 32, NUM = WIDTH * HEIGHT };

static const char plain[] = "/*{ \"voxel\": 1, \"view\": 5000, \"sun\": { \"azimuth\": 30, \"elevation\": 12 },\n"
                            "\"camera\": { \"position\": [\"0\", \"900\", \"0\"], \"yaw\": 20, \"pitch\": 20 },\n"
                            "\"sky\": { \"model\": \"atmosphere\" } }*/\n"
                            "float density(vec3 p) { return 20.0 * noise(p.xz / 90.0) - p.y; }\n";

static char path[64];

static int set_up(void **state)
{
    (void)state;
    snprintf(path, sizeof path, "/tmp/karst-skies-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    bool done = fd >= 0 && write(fd, plain, sizeof plain - 1) == (ssize_t)sizeof plain - 1;
    close(fd);
    return done ? 0 : 1;
}

static int tear_down(void **state)
{
    (void)state;
    return unlink(path);
}

static karst_engine_config base_config(void)
{
    return (karst_engine_config){.world = path,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .exposure = KARST_EXPOSURE_GIVEN,
                                 .pool_bytes = (uint64_t)48 << 20};
}

static void look(karst_engine *engine, const karst_camera *camera, float light[3 * NUM])
{
    bool settled = false;
    assert_ok(karst_engine_set_camera(engine, camera, &error));
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_radiance(engine, light, 3 * NUM, &error));
}

static float first[3 * NUM], second[3 * NUM];

static void the_sky_is_the_tables(void **state)
{
    (void)state;
    const karst_engine_config config = base_config();
    karst_engine *engine = scene_open(&config);
    const karst_camera camera = karst_engine_default_camera(engine);
    karst_light light = karst_light_of_sun(30, 12);
    karst_sky_view view = {.eye_m = {0, 900, 0}, .voxel_m = 1};
    karst_pinhole pinhole;
    look(engine, &camera, first);
    karst_engine_destroy(engine);
    memcpy(view.sun_direction, light.sun_direction, sizeof view.sun_direction);
    karst_error error = {0};
    karst_skies *skies = karst_skies_create(NULL, 0, 1, &error);
    assert_non_null(skies);
    assert_true(karst_skies_aim(skies, &view, &error));
    karst_skies_light(skies, &light);
    karst_pinhole_init(&pinhole, &camera, WIDTH, HEIGHT, 5000);
    int num_off = 0;
    for (int y = 0; y < HEIGHT / 2; y++)
        for (int x = 0; x < WIDTH; x++) {
            const vector3 direction = pinhole_direction(&pinhole, x, y);
            const colour c = air_sky_with_sun(karst_skies_sky(skies), karst_skies_table(skies), &light, &direction,
                                              dot3(&direction, light.sun_direction));
            const float want[3] = {c.r, c.g, c.b};
            assert_true(c.r > 0.01f && c.b > c.r * 0.5f);
            num_off += memcmp(want, first + 3 * (y * WIDTH + x), sizeof want) != 0;
        }
    assert_int_equal(num_off, 0);
    karst_skies_destroy(skies);
}

static void lanes_and_history_leave_no_trace(void **state)
{
    (void)state;
    karst_engine_config config = base_config();
    karst_engine *engine = scene_open(&config);
    karst_camera camera = karst_engine_default_camera(engine), away = camera;
    camera.pitch_deg = -5;
    away.position.voxel[1] += 3000;
    look(engine, &away, second);
    look(engine, &camera, first);
    assert_memory_not_equal(first, second, sizeof first);
    karst_engine_destroy(engine);
    for (int lanes = 0; lanes < 2; lanes++) {
        config.lanes = lanes;
        engine = scene_open(&config);
        look(engine, &camera, second);
        karst_engine_destroy(engine);
        assert_memory_equal(first, second, sizeof first);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_sky_is_the_tables),
                                       cmocka_unit_test(lanes_and_history_leave_no_trace)};
    return cmocka_run_group_tests_name("skies", tests, set_up, tear_down);
}
