/* Light maps of media: each side lights its own side, land and sky are not in them, how much is hidden follows from the
 * depth, own light stands by itself; and the engine shows its world again. */
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
#include "karst/maps.h"
#include "tests/support/ok.h"

enum { SIDE = 32, NUM_PIXELS = SIDE * SIDE, NUM_VALUES = NUM_PIXELS * 4 };
enum { RIGHT, ABOVE, FRONT, HIDDEN, LEFT, BELOW, BEHIND, GLOW, NUM_MAPS };

/* A ball around the origin, 2 m in radius, its outermost eighth fading; the camera 10 m before it, on its axis. */
#define HEAD                                                                                                \
    "/*{ \"voxel\": 0.0625, \"view\": 100, \"sun\": { \"azimuth\": 70, \"elevation\": 35 },\n"              \
    "\"sky\": { \"model\": \"atmosphere\" }, \"camera\": { \"position\": [\"0\", \"0\", \"-10\"], " \
    "\"fov\": 40 },\n\"params\": { \"glow\": { \"value\": 0, \"min\": 0, \"max\": 9 },\n"                             \
    "\"sunk_m\": { \"value\": 0, \"min\": 0, \"max\": 1000 } } }*/\n"
#define AIR                                                                                              \
    "medium air(vec3 p) { medium m; m.extinction = 1.2 * clamp(8.0 * (2.0 - length(p)), 0.0, 1.0);\n"    \
    "m.albedo = vec3(0.9); m.g = 0.0; m.emission = vec3(glow * m.extinction); return m; }\n"
static const char world[] = HEAD "float density(vec3 p) { return -2.5 - sunk_m - p.y; }\n" AIR;

static karst_engine *create(const char *text, int lanes)
{
    char path[64] = "/tmp/karst-maps-XXXXXX.karst";
    karst_error error = {0};
    karst_engine_config config = {.width_px = SIDE,
                                  .height_px = SIDE,
                                  .pool_bytes = (uint64_t)96 << 20,
                                  .display = KARST_DISPLAY_NONE,
                                  .lanes = lanes};
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    config.world = path;
    karst_engine *engine = karst_engine_create(&config, &error);
    unlink(path);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

typedef struct {
    float values[2][NUM_VALUES];
} map_pair;

static void draw(karst_engine *engine, map_pair *maps)
{
    bool settled;
    assert_ok(karst_engine_six_way(engine, 400, NULL, NULL, maps->values[0], maps->values[1], NUM_VALUES, &settled,
                                   &error));
    assert_true(settled);
}

static double at(const map_pair *maps, int map, int x, int y)
{
    return (double)maps->values[map / 4][4 * (y * SIDE + x) + map % 4];
}

static double sum_of(const map_pair *maps, int map, int x0, int x1, int y0, int y1)
{
    double sum = 0;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            sum += at(maps, map, x, y);
    return sum;
}

/* How much brighter one half of a map is than the other. */
static double across(const map_pair *maps, int map)
{
    return sum_of(maps, map, SIDE / 2, SIDE, 0, SIDE) / sum_of(maps, map, 0, SIDE / 2, 0, SIDE);
}
static double along(const map_pair *maps, int map)
{
    return sum_of(maps, map, 0, SIDE, 0, SIDE / 2) / sum_of(maps, map, 0, SIDE, SIDE / 2, SIDE);
}

static void each_side_lights_its_own(void **state)
{
    (void)state;
    static map_pair maps, without, glowing, again;
    karst_engine *engine = create(world, 0);
    draw(engine, &maps);
    assert_true(across(&maps, RIGHT) > 1.5 && across(&maps, LEFT) < 1 / 1.5);
    assert_true(along(&maps, ABOVE) > 1.5 && along(&maps, BELOW) < 1 / 1.5);
    for (int map = 0; map < NUM_MAPS; map++)
        if (map != RIGHT && map != LEFT && map != GLOW)
            assert_true(fabs(across(&maps, map) - 1) < 0.01);
    assert_true(sum_of(&maps, FRONT, 0, SIDE, 0, SIDE) > 1.5 * sum_of(&maps, BEHIND, 0, SIDE, 0, SIDE));
    /* What is on the left is lit from the left as what is on the right is from the right. */
    double worst = 0, most = 0;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            worst = fmax(worst, fabs(at(&maps, RIGHT, x, y) - at(&maps, LEFT, SIDE - 1 - x, y)));
            worst = fmax(worst, fabs(at(&maps, ABOVE, x, y) - at(&maps, BELOW, x, SIDE - 1 - y)));
            most = fmax(most, at(&maps, RIGHT, x, y));
        }
    assert_true(most > 0.1 && worst < 0.02 * most);
    /* Through the middle, in the fading part as a mean: 2 * 1.2 * (1.875 + 0.0625). */
    const double hidden = 1 - exp(-2 * 1.2 * 1.9375);
    assert_true(fabs(at(&maps, HIDDEN, SIDE / 2, SIDE / 2) - hidden) < 0.003);
    /* Land and sky are not there. */
    for (int map = 0; map < NUM_MAPS; map++)
        assert_true(at(&maps, map, 0, 0) == 0 && at(&maps, map, SIDE - 1, SIDE - 1) == 0);
    /* Own light is in its own map alone: 1 - T of what glows as much as it hides. */
    const karst_parameter glow = {"glow", 0.5};
    assert_ok(karst_engine_set_parameters(engine, &glow, 1, &error));
    draw(engine, &glowing);
    print_message("own light %g of %g\n", at(&glowing, GLOW, SIDE / 2, SIDE / 2), 0.5 * hidden);
    assert_true(fabs(at(&glowing, GLOW, SIDE / 2, SIDE / 2) - 0.5 * hidden) < 0.1);
    for (int map = 0; map < GLOW; map++)
        for (int x = 0; x < SIDE; x++)
            assert_true(fabs(at(&glowing, map, x, SIDE / 2) - at(&maps, map, x, SIDE / 2)) < 1e-5);
    /* Without land, and once more with it. */
    const karst_parameter without_land[] = {{"glow", 0}, {"sunk_m", 1000}}, with_land = {"sunk_m", 0};
    assert_ok(karst_engine_set_parameters(engine, without_land, 2, &error));
    draw(engine, &without);
    assert_memory_equal(&without, &maps, sizeof maps);
    assert_ok(karst_engine_set_parameters(engine, &with_land, 1, &error));
    draw(engine, &again);
    assert_memory_equal(&again, &maps, sizeof maps);
    karst_engine_destroy(engine);
    if (!getenv("KARST_TEST_FULL"))
        return;
    engine = create(world, 1);
    draw(engine, &again);
    assert_memory_equal(&again, &maps, sizeof maps);
    karst_engine_destroy(engine);
}

static void the_world_comes_back(void **state)
{
    (void)state;
    static float before[NUM_PIXELS * 3], after[NUM_PIXELS * 3];
    static map_pair maps;
    bool settled;
    karst_error why = {0};
    karst_engine *engine = create(world, 0);
    const karst_sun sun = karst_engine_get_sun(engine);
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_ok(karst_engine_read_radiance(engine, before, NUM_PIXELS * 3, &error));
    draw(engine, &maps);
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_radiance(engine, after, NUM_PIXELS * 3, &error));
    assert_memory_equal(before, after, sizeof before);
    assert_true(karst_engine_get_sun(engine).azimuth_deg == sun.azimuth_deg);
    assert_false(karst_engine_six_way(engine, 0, NULL, NULL, maps.values[0], maps.values[1], 7, &settled, &why));
    assert_int_equal(why.status, KARST_USAGE);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_side_lights_its_own),
                                       cmocka_unit_test(the_world_comes_back)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
