/* Media in pictures: they depend on the view alone, land shadows them, and they shadow land; worlds without them know
 * nothing of them. */
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
#include "tests/language/field_file.h"
#include "tests/support/ok.h"

enum { WIDTH = 48, HEIGHT = 32, NUM_VALUES = WIDTH * HEIGHT * 3 };

/* A plain, a wall across it on the left, and a sun that comes low from the left. */
#define HEAD                                                                                            \
    "/*{ \"voxel\": 0.25, \"view\": 600, \"sun\": { \"azimuth\": 270, \"elevation\": 30 },\n"           \
    "\"sky\": { \"haze\": 1e12 }, \"camera\": { \"position\": [\"0\", \"20\", \"-70\"], \"fov\": 60 },\n" \
    "\"params\": { \"wall_m\": { \"value\": 30, \"min\": 0, \"max\": 60 },\n"                           \
    "\"thick\": { \"value\": 0.05, \"min\": 0, \"max\": 1 } } }*/\n"                                    \
    "float density(vec3 p) { return max(-p.y, min(wall_m - p.y, 4.0 - abs(p.x + 40.0))); }\n"
/* A ball of it above the plain. */
#define BALL                                                                                               \
    "medium air(vec3 p) { medium m; m.g = 0.3; m.albedo = vec3(0.9, 0.8, 0.7);\n"                          \
    "m.extinction = thick * (1.2 - length(p - vec3(0.0, 25.0, 0.0)) / 20.0 + 0.3 * fbm(p / 8.0, 3)); return m; }\n"
/* All of the plain, three metres high. */
#define LAYER "medium air(vec3 p) { medium m; m.extinction = thick * clamp(3.0 - p.y, 0.0, 1.0); return m; }\n"
static const char plain[] = HEAD, ball[] = HEAD BALL, layer[] = HEAD LAYER;

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    char path[64] = "/tmp/karst-media-XXXXXX.karst";
    karst_error error = {0};
    karst_engine_config config = like ? *like : (karst_engine_config){0};
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    config.world = path;
    config.pool_bytes = config.pool_bytes ? config.pool_bytes : (uint64_t)96 << 20;
    config.display = KARST_DISPLAY_NONE;
    config.width_px = WIDTH;
    config.height_px = HEIGHT;
    config.tone = KARST_TONE_OF_FILM;
    karst_engine *engine = karst_engine_create(&config, &error);
    unlink(path);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static void settle(karst_engine *engine, float *light)
{
    bool settled;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_check(engine, &error));
    assert_ok(karst_engine_read_radiance(engine, light, NUM_VALUES, &error));
}

static void picture_of(const char *text, const karst_engine_config *like, float *light)
{
    karst_engine *engine = create(text, like);
    settle(engine, light);
    karst_engine_destroy(engine);
}

static double mean_green(const float *light, int x0, int x1, int y0, int y1)
{
    double sum = 0;
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            sum += (double)light[3 * (y * WIDTH + x) + 1];
    return sum / ((x1 - x0) * (y1 - y0));
}

static karst_camera moved(const karst_engine *engine, double x_m, double yaw_deg)
{
    karst_camera camera = karst_engine_default_camera(engine);
    camera.position = karst_position_add_m(camera.position, (double[]){x_m, 0, 0}, karst_engine_voxel_log2_m(engine));
    camera.yaw_deg += yaw_deg;
    return camera;
}

/* Whatever was seen before, with 16 lanes or one, the light is the same in every bit. */
static void pictures_depend_on_the_view_alone(void **state)
{
    (void)state;
    static float first[NUM_VALUES], other[NUM_VALUES];
    const karst_engine_config one_lane = {.lanes = 1}, other_pool = {.pool_bytes = (uint64_t)48 << 20};
    karst_engine *engine = create(ball, NULL);
    settle(engine, first);
    const karst_camera away = moved(engine, 25, -30), back = karst_engine_default_camera(engine);
    assert_ok(karst_engine_set_camera(engine, &away, &error));
    settle(engine, other);
    assert_memory_not_equal(other, first, sizeof first);
    assert_ok(karst_engine_set_camera(engine, &back, &error));
    settle(engine, other);
    assert_memory_equal(other, first, sizeof first);
    karst_engine_destroy(engine);
    picture_of(ball, &one_lane, other);
    assert_memory_equal(other, first, sizeof first);
    picture_of(ball, &other_pool, other);
    assert_memory_equal(other, first, sizeof first);
}

/* A puff so small that coarse voxels miss it: what is empty from afar is looked into from near, whatever was seen
 * before. */
static void empty_from_afar_is_not_empty_near(void **state)
{
    (void)state;
    static const char text[] =
        "/*{ \"voxel\": 0.03125, \"view\": 600, \"sky\": { \"haze\": 1e12 },\n"
        "\"camera\": { \"position\": [\"0\", \"20\", \"-200\"], \"fov\": 60 } }*/\n"
        "float density(vec3 p) { return -p.y; }\n"
        "medium air(vec3 p) { medium m; m.extinction = max(1.0 - length(p - vec3(0.3, 20.3, 0.3)) / 0.25,\n"
        "2.0 - length(p - vec3(0.0, 10.0, 0.0)) / 4.0); return m; }\n";
    static float afar[NUM_VALUES], near[NUM_VALUES], other[NUM_VALUES];
    karst_engine *engine = create(text, NULL);
    const karst_camera back = karst_engine_default_camera(engine);
    karst_camera forth = back;
    forth.position = karst_position_add_m(forth.position, (double[]){0, 0.3, 198}, karst_engine_voxel_log2_m(engine));
    settle(engine, afar);
    assert_ok(karst_engine_set_camera(engine, &forth, &error));
    settle(engine, other);
    karst_engine_destroy(engine);
    engine = create(text, NULL);
    assert_ok(karst_engine_set_camera(engine, &forth, &error));
    settle(engine, near);
    karst_engine_destroy(engine);
    assert_memory_equal(other, near, sizeof near);
    /* In the middle the puff is seen against what is beside it. */
    const double middle = mean_green(near, WIDTH / 2, WIDTH / 2 + 2, HEIGHT / 2 - 1, HEIGHT / 2 + 1),
                 aside = mean_green(near, 2, 4, HEIGHT / 2 - 1, HEIGHT / 2 + 1);
    print_message("# in the puff %.4f, beside it %.4f\n", middle, aside);
    assert_true(fabs(middle - aside) > 0.05 * aside);
}

/* A picture that rests stays at rest, and a sun or a parameter that comes back brings its picture back. */
static void changes_leave_no_trace(void **state)
{
    (void)state;
    static float first[NUM_VALUES], other[NUM_VALUES];
    karst_engine *engine = create(ball, NULL);
    karst_stats stats;
    settle(engine, first);
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    assert_true(stats.settled && stats.num_produced == 0);
    const karst_sun low = {300, 10};
    assert_ok(karst_engine_set_sun(engine, &low, &error));
    settle(engine, other);
    assert_memory_not_equal(other, first, sizeof first);
    assert_ok(karst_engine_set_sun(engine, NULL, &error));
    settle(engine, other);
    assert_memory_equal(other, first, sizeof first);
    for (int i = 0; i < 2; i++) {
        const karst_parameter thick = {"thick", i ? 0.05 : 0.2};
        assert_ok(karst_engine_set_parameters(engine, &thick, 1, &error));
        settle(engine, other);
        assert_int_equal(memcmp(other, first, sizeof first) == 0, i);
    }
    /* A wall between the sun and the ball, out of sight: its shadow in the air comes and goes. */
    karst_edit wall = {.shape = KARST_EDIT_BOX, .mode = KARST_EDIT_ADD, .half_m = {4, 60, 60}};
    wall.at = karst_position_add_m(wall.at, (double[]){-130, 40, 0}, karst_engine_voxel_log2_m(engine));
    static float walled[NUM_VALUES];
    assert_ok(karst_engine_edit(engine, &wall, 1, &error));
    settle(engine, walled);
    assert_memory_not_equal(walled, first, sizeof first);
    size_t num = 1;
    assert_ok(karst_engine_undo(engine, &num, &error));
    settle(engine, other);
    assert_memory_equal(other, first, sizeof first);
    karst_engine_destroy(engine);
    engine = create(ball, NULL);
    assert_ok(karst_engine_edit(engine, &wall, 1, &error));
    settle(engine, other);
    assert_memory_equal(other, walled, sizeof walled);
    karst_engine_destroy(engine);
}

static void light_in_three_modes(void **state)
{
    (void)state;
    static float seen[KARST_NUM_MEDIA_MODES][NUM_VALUES];
    for (int mode = 0; mode < KARST_NUM_MEDIA_MODES; mode++) {
        const karst_engine_config config = {.media = (karst_media_mode)mode};
        picture_of(ball, &config, seen[mode]);
    }
    /* The sun comes from the left, 30 degrees high: the ball's shadow lies on the plain 43 m to the right of it, in
     * `full` alone. */
    const double shadowed = mean_green(seen[KARST_MEDIA_MODE_FULL], 39, 43, 23, 25),
                 lit = mean_green(seen[KARST_MEDIA_MODE_SHADOW], 39, 43, 23, 25);
    print_message("plain: %.4f in the ball's shadow, %.4f without\n", shadowed, lit);
    assert_true(shadowed < 0.8 * lit);
    /* Within the ball, on the side that looks away from the sun, light is lost in both that know of its depth. */
    const double basic = mean_green(seen[KARST_MEDIA_MODE_BASIC], 25, 29, 12, 15),
                 deep = mean_green(seen[KARST_MEDIA_MODE_SHADOW], 25, 29, 12, 15);
    print_message("ball: %.4f with its depth to the sun, %.4f without\n", deep, basic);
    assert_true(deep < 0.9 * basic);
}

/* A layer on the plain is dark behind the wall, where that hides the sun, and is not where the wall is gone. */
static void land_shadows_media(void **state)
{
    (void)state;
    static float light[NUM_VALUES], unknowing[NUM_VALUES];
    const karst_parameter thick = {"thick", 1}, low = {"wall_m", 0};
    karst_engine_config config = {.parameters = &thick, .num_parameters = 1};
    karst_engine *engine = create(layer, &config);
    settle(engine, light);
    const double in_shadow = mean_green(light, 10, 18, 17, 22);
    assert_ok(karst_engine_set_parameters(engine, &low, 1, &error));
    settle(engine, light);
    const double lit = mean_green(light, 10, 18, 17, 22);
    karst_engine_destroy(engine);
    config.media = KARST_MEDIA_MODE_SHADOW;
    picture_of(layer, &config, unknowing);
    const double in_mode_shadow = mean_green(unknowing, 10, 18, 17, 22);
    print_message("layer: %.4f behind the wall, %.4f without it, %.4f where land shadows nothing\n", in_shadow, lit,
                  in_mode_shadow);
    assert_true(in_shadow < 0.3 * lit && in_mode_shadow > 2 * in_shadow);
}

/* A grid of samples that are all the same, and that value in the text: the same light in every bit. */
static void a_uniform_grid_is_its_value(void **state)
{
    (void)state;
    static const char form[] =
        "/*{ \"voxel\": 0.25, \"view\": 200, \"sun\": { \"azimuth\": 270, \"elevation\": 30 },\n"
        "\"sky\": { \"haze\": 1e12 }, \"camera\": { \"position\": [\"0\", \"20\", \"-70\"], \"fov\": 60 },\n"
        "\"data\": { \"fog\": { \"file\": \"%s\" } } }*/\n"
        "float density(vec3 p) { return max(-p.y, min(30.0 - p.y, 4.0 - abs(p.x + 40.0))); }\n"
        "medium air(vec3 p) { medium m; m.albedo = vec3(0.9); m.extinction = %s; return m; }\n";
    static float of_grid[NUM_VALUES], of_value[NUM_VALUES], of_other[NUM_VALUES];
    const int size[3] = {8, 8, 8};
    char path[] = "/tmp/karst-fog-XXXXXX.nvdb", text[1024];
    float samples[512];
    const karst_engine_config coarse = {.detail_px = 4};
    for (int i = 0; i < 512; i++)
        samples[i] = 0.0043f;
    close(mkstemps(path, 5));
    assert_true(write_field_file(path, samples, size, 3));
    snprintf(text, sizeof text, form, path, "field(fog, p)");
    picture_of(text, &coarse, of_grid);
    snprintf(text, sizeof text, form, path, "0.0043");
    picture_of(text, &coarse, of_value);
    snprintf(text, sizeof text, form, path, "0.00430001");
    picture_of(text, &coarse, of_other);
    unlink(path);
    assert_memory_equal(of_grid, of_value, sizeof of_grid);
    assert_memory_not_equal(of_value, of_other, sizeof of_value);
}

static void worlds_without_media_have_none_of_it(void **state)
{
    (void)state;
    static float light[NUM_VALUES];
    karst_stats stats;
    karst_engine *engine = create(plain, NULL);
    settle(engine, light);
    karst_engine_stats(engine, &stats);
    assert_int_equal(stats.num_stores, 0);
    for (size_t i = 0; i < stats.num_memory; i++)
        assert_true(strncmp(stats.memory[i].name, "air", 3) && strcmp(stats.memory[i].name, "sun depth"));
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_depend_on_the_view_alone), cmocka_unit_test(changes_leave_no_trace),
        cmocka_unit_test(empty_from_afar_is_not_empty_near), cmocka_unit_test(a_uniform_grid_is_its_value),
        cmocka_unit_test(light_in_three_modes), cmocka_unit_test(land_shadows_media),
        cmocka_unit_test(worlds_without_media_have_none_of_it)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
