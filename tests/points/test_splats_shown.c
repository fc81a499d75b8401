/* Models shown as discs in pictures: land and discs hide, shade and mirror one another, as they do where the model is a
 * surface; colours are the points'; pictures depend on the view alone, and are the same far out. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

#define WIDTH 120
#define HEIGHT 90
#define NUM (WIDTH * HEIGHT)
#define SCALE 10.0 /* of the torus, whose rings have radii of 1 and 0.4 */
#define NUM_POINTS 20000

static char folder[] = "/tmp/karst-splats-XXXXXX";
static char model_path[64], world_path[64];

/* A torus whose centre is 1 m above ground that mirrors a third of its light; all of it so far along x. */
static void write_world(const char *x)
{
    FILE *file = fopen(world_path, "w");
    assert_non_null(file);
    fprintf(file,
            "/*{ \"voxel\": 0.0625, \"view\": 300, \"mirror\": 0.3, \"sun\": { \"azimuth\": 200, \"elevation\": 35 },\n"
            "\"camera\": { \"position\": [\"%s\", \"14\", \"-34\"], \"pitch\": -20, \"fov\": 60 },\n"
            "\"models\": [{ \"points\": \"torus.karstpoints\", \"at\": [\"%s\", \"1\", \"0\"], \"turn\": [60, 0, 0],\n"
            "\"scale\": 10, \"as\": \"splats\" }] }*/\n"
            "float density(vec3 p) { return -p.y; }\n",
            x, x);
    assert_int_equal(fclose(file), 0);
}

typedef struct {
    uint8_t rgba[4 * NUM];
    float position[3 * NUM], normal[3 * NUM], albedo[3 * NUM], depth[NUM];
    karst_stats stats;
} picture;

static void draw(picture *p, karst_models_as as, bool no_shadows, double mirror, int lanes, uint64_t pool_mib)
{
    const karst_engine_config config = {.world = world_path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = pool_mib << 20,
                                        .no_shadows = no_shadows,
                                        .mirror = mirror,
                                        .models = as,
                                        .lanes = lanes};
    karst_engine *engine;
    bool settled;
    assert_ok(engine = karst_engine_create(&config, &error));
    assert_ok(karst_engine_settle(engine, 200, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_pixels(engine, p->rgba, sizeof p->rgba, &error));
    karst_engine_stats(engine, &p->stats);
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_POSITION, p->position, 3 * NUM, &error));
    assert_ok(karst_engine_read_aov(engine, KARST_AOV_NORMAL, p->normal, 3 * NUM, &error));
    if (karst_engine_keeps_radiance(engine))
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_ALBEDO, p->albedo, 3 * NUM, &error));
    assert_ok(karst_engine_read_depth(engine, p->depth, NUM, &error));
    karst_engine_destroy(engine);
}

/* Whether a pixel shows the model: its own colour has 40 of 255 in blue, and the land none so little. */
static bool shows_model(const picture *p, int i) { return p->depth[i] < 1e6f && p->position[3 * i + 1] > 0.2f; }

static int brightness(const picture *p, int i) { return p->rgba[4 * i] + p->rgba[4 * i + 1] + p->rgba[4 * i + 2]; }

static picture splats, surface, other;

static void discs_and_land_hide_one_another(void **state)
{
    (void)state;
    const double spacing_m = SCALE * spacing_of(&known_surfaces[1], NUM_POINTS);
    int both = 0, one = 0, near = 0, upright = 0, low = 0;
    for (int i = 0; i < NUM; i++) {
        const bool is_splat = shows_model(&splats, i), is_surface = shows_model(&surface, i);
        low += splats.depth[i] < 1e6f && splats.position[3 * i + 1] < -0.1f;
        one += is_splat != is_surface;
        if (!is_splat || !is_surface)
            continue;
        float along = 0;
        for (int a = 0; a < 3; a++)
            along += splats.normal[3 * i + a] * surface.normal[3 * i + a];
        both++;
        near += fabs((double)(splats.depth[i] - surface.depth[i])) < 2 * spacing_m;
        upright += along > 0.97f;
    }
    print_message("# %d pixels show the model both ways, %d one way; %d within two spacings, %d upright\n", both, one,
                  near, upright);
    assert_true(both > 1500 && one < both / 8 && near > 0.97 * both && upright > 0.93 * both);
    assert_int_equal(low, 0); /* what is in the ground is not seen */
    assert_true(splats.stats.splats.num_points == NUM_POINTS && splats.stats.splats.num_discs > NUM_POINTS);
    assert_int_equal(surface.stats.splats.num_discs, 0);
    bool is_named = false;
    for (size_t i = 0; i < splats.stats.num_memory; i++)
        is_named = is_named || (strcmp(splats.stats.memory[i].name, "discs") == 0 &&
                                splats.stats.memory[i].size_bytes == splats.stats.splats.size_bytes);
    assert_true(is_named);
}

static void colours_are_those_of_points(void **state)
{
    (void)state;
    int num = 0, good = 0;
    for (int i = 0; i < NUM; i++) {
        if (!shows_model(&splats, i) || splats.position[3 * i + 1] < 0.5f)
            continue;
        /* Red from left to right: about x it is not turned. */
        const double byte = 128 + 60 * (double)splats.position[3 * i] / SCALE, c = byte / 255;
        const double red = c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
        num++;
        good += fabs((double)splats.albedo[3 * i] - red) < 0.03;
    }
    print_message("# %d of %d pixels are as red as they should be\n", good, num);
    assert_true(num > 1000 && good > 0.98 * num);
}

/* Sun and mirrors: in most pixels of the ground the same as with the model's surface, and not as without the model. */
static void discs_shade_and_are_mirrored(void **state)
{
    (void)state;
    int same = 0, num = 0, touched = 0;
    draw(&other, KARST_MODELS_SPLATS, true, -1, 0, 128);
    for (int i = 0; i < NUM; i++) {
        if (shows_model(&splats, i) || shows_model(&surface, i) || !(splats.depth[i] < 80))
            continue;
        num++;
        same += abs(brightness(&splats, i) - brightness(&surface, i)) < 24;
        touched += abs(brightness(&splats, i) - brightness(&other, i)) > 60;
    }
    print_message("# ground: %d of %d pixels are as with the surface, %d have its shadow or image\n", same, num,
                  touched);
    assert_true(num > 2000 && same > 0.96 * num && touched > 100);
}

static void pictures_depend_on_the_view_alone(void **state)
{
    (void)state;
    /* Pools that are too small for all detail settle, too. */
    draw(&other, KARST_MODELS_OF_WORLD, false, 0, 0, 4);
    write_world("1000000000000");
    draw(&other, KARST_MODELS_OF_WORLD, false, 0, 0, 128);
    assert_memory_equal(splats.rgba, other.rgba, sizeof other.rgba);
    write_world("0");
    if (!getenv("KARST_TEST_FULL"))
        return;
    draw(&other, KARST_MODELS_OF_WORLD, false, 0, 1, 128);
    assert_memory_equal(splats.rgba, other.rgba, sizeof other.rgba);
}

/* Another world's models are other discs, or none. */
static void worlds_change(void **state)
{
    (void)state;
    const karst_engine_config config = {.world = world_path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)128 << 20};
    karst_engine *engine;
    karst_prepared_world *prepared;
    bool settled, kept;
    write_world("3");
    assert_ok(engine = karst_engine_create(&config, &error));
    assert_ok(karst_engine_settle(engine, 200, NULL, NULL, &settled, &error));
    write_world("0");
    assert_ok(prepared =
                  karst_engine_prepare_world(engine, &(karst_world_config){.world = world_path}, &error));
    assert_ok(karst_engine_change_world(engine, prepared, &kept, &error));
    const karst_camera camera = karst_engine_default_camera(engine);
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    assert_ok(karst_engine_settle(engine, 200, NULL, NULL, &settled, &error));
    assert_ok(karst_engine_read_pixels(engine, other.rgba, sizeof other.rgba, &error));
    karst_engine_destroy(engine);
    assert_true(kept); /* the land is the same */
    assert_memory_equal(splats.rgba, other.rgba, sizeof other.rgba);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    char input[64];
    snprintf(input, sizeof input, "%s/torus.ply", folder);
    snprintf(model_path, sizeof model_path, "%s/torus.karstpoints", folder);
    snprintf(world_path, sizeof world_path, "%s/world.karst", folder);
    random_state = 3;
    write_cloud(input, &known_surfaces[1], NUM_POINTS, 0);
    const karst_points_import_config config = {.input = input, .output = model_path, .axes = KARST_POINTS_AS_THEY_ARE};
    const bool done = karst_points_import(&config, NULL, NULL);
    unlink(input);
    if (!done)
        return -1;
    write_world("0");
    draw(&splats, KARST_MODELS_OF_WORLD, false, 0, 0, 128);
    draw(&surface, KARST_MODELS_SURFACE, false, 0, 0, 128);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(model_path);
    unlink(world_path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(discs_and_land_hide_one_another), cmocka_unit_test(colours_are_those_of_points),
        cmocka_unit_test(discs_shade_and_are_mirrored),    cmocka_unit_test(pictures_depend_on_the_view_alone),
        cmocka_unit_test(worlds_change),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
