/* Public functions that no part's own tests call, with the errors that their headers name. */
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
#include <jansson.h>

#include "karst/karst.h"

static char folder[] = "/tmp/karst-public-XXXXXX";
static char path[128];

static const char *in_folder(const char *name)
{
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void assert_fails(bool done, const karst_error *error, karst_status status, const char *word)
{
    assert_false(done);
    assert_int_equal(error->status, status);
    if (!strstr(error->message, word))
        fail_msg("'%s' does not say '%s'", error->message, word);
}
#define assert_refused(call, status, word)             \
    do {                                               \
        karst_error error = {0};                       \
        const bool done_ = (call);                     \
        assert_fails(done_, &error, (status), (word)); \
    } while (0)

static int set_up(void **state)
{
    (void)state;
    return mkdtemp(folder) ? 0 : 1;
}

static int tear_down(void **state)
{
    char command[64];
    (void)state;
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}

static void test_maps_of_heights(void **state)
{
    (void)state;
    const double height_m[6] = {0, 1, 2, 3, 4, (double)NAN};
    const char *const names[] = {"a.exr", "a.png", "a.tif"};
    for (int i = 0; i < 3; i++) {
        karst_error why = {0};
        if (!karst_heights_write(in_folder(names[i]), height_m, 3, 2, 0, 4, &why))
            fail_msg("%s", why.message);
        assert_int_equal(access(path, R_OK), 0);
    }
    assert_refused(karst_heights_write(in_folder("a.jpg"), height_m, 3, 2, 0, 4, &error), KARST_USAGE, "a.jpg");
    assert_refused(karst_heights_write(in_folder("b.png"), height_m, 0, 2, 0, 4, &error), KARST_USAGE, "16384");
    assert_refused(karst_heights_write(in_folder("b.png"), height_m, 3, 16385, 0, 4, &error), KARST_USAGE, "16384");
    assert_refused(karst_heights_write(in_folder("b.png"), height_m, 3, 2, 4, 4, &error), KARST_USAGE, "4");
    assert_refused(karst_heights_write(in_folder("b.png"), height_m, 3, 2, (double)NAN, 4, &error), KARST_USAGE, "");
    assert_int_equal(access(in_folder("b.png"), F_OK), -1);
    assert_refused(karst_heights_write(in_folder("none/a.png"), height_m, 3, 2, 0, 4, &error), KARST_FAILED,
                   "none/a.png");
}

static void test_channels(void **state)
{
    (void)state;
    static const float values[12] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
    const karst_image_channel channels[2] = {{"Z", values, 2}, {"level", values + 1, 2}};
    karst_image_channel many[KARST_IMAGE_MAX_CHANNELS + 1];
    karst_error why = {0};
    if (!karst_image_write_channels(in_folder("c.exr"), channels, 2, 3, 2, &why))
        fail_msg("%s", why.message);
    for (int i = 0; i <= KARST_IMAGE_MAX_CHANNELS; i++)
        many[i] = channels[0];
    const char *name = in_folder("d.exr");
    assert_refused(karst_image_write_channels(name, channels, 2, 0, 2, &error), KARST_USAGE, "d.exr");
    assert_refused(karst_image_write_channels(name, channels, 2, 3, 16385, &error), KARST_USAGE, "d.exr");
    assert_refused(karst_image_write_channels(name, channels, 0, 3, 2, &error), KARST_USAGE, "d.exr");
    assert_refused(karst_image_write_channels(name, many, KARST_IMAGE_MAX_CHANNELS + 1, 3, 2, &error), KARST_USAGE,
                   "d.exr");
    assert_refused(karst_image_write_channels(name, many, 2, 3, 2, &error), KARST_USAGE, "d.exr");
    assert_int_equal(access(name, F_OK), -1);
    assert_refused(karst_image_write_channels(in_folder("none/d.exr"), channels, 2, 3, 2, &error), KARST_FAILED,
                   "none/d.exr");
}

static void test_info_json(void **state)
{
    (void)state;
    char *text = karst_info_json();
    json_error_t error;
    assert_non_null(text);
    json_t *root = json_loads(text, 0, &error);
    assert_true(json_is_object(root));
    assert_string_equal(json_string_value(json_object_get(root, "version")), karst_version());
    assert_true(json_is_array(json_object_get(root, "devices")));
    json_decref(root);
    free(text);
}

static void test_names(void **state)
{
    (void)state;
    karst_mesh_format format = KARST_MESH_OF_SUFFIX;
    assert_true(karst_mesh_format_of("a/b.glb", &format, NULL) && format == KARST_MESH_GLB);
    assert_true(karst_mesh_format_of("B.PLY", &format, NULL) && format == KARST_MESH_PLY);
    assert_true(karst_mesh_format_of("c.obj", &format, NULL) && format == KARST_MESH_OBJ);
    assert_refused(karst_mesh_format_of("c.stl", &format, &error), KARST_USAGE, "glb");
    assert_refused(karst_mesh_format_of("obj", &format, &error), KARST_USAGE, "ply");
    karst_media_mode mode = KARST_MEDIA_MODE_FULL;
    assert_true(karst_media_mode_parse("basic", &mode, NULL) && mode == KARST_MEDIA_MODE_BASIC);
    assert_true(karst_media_mode_parse("full", &mode, NULL) && mode == KARST_MEDIA_MODE_FULL);
    assert_refused(karst_media_mode_parse("none", &mode, &error), KARST_USAGE, "full, shadow, basic");
    karst_scattering scattering = KARST_SCATTERING_OCTAVES;
    assert_true(karst_scattering_parse("paths", &scattering, NULL) && scattering == KARST_SCATTERING_PATHS);
    assert_true(karst_scattering_parse("once", &scattering, NULL) && scattering == KARST_SCATTERING_ONCE);
    assert_true(karst_scattering_parse("fluence", &scattering, NULL) && scattering == KARST_SCATTERING_FLUENCE);
    assert_refused(karst_scattering_parse("twice", &scattering, &error), KARST_USAGE, "octaves, once, paths");
    assert_true(karst_points_is_name("a/b.karstpoints"));
    assert_false(karst_points_is_name("b.ply") || karst_points_is_name("a.karstpoints/b") || karst_points_is_name(""));
    assert_true(karst_saved_is_name("a/b.karstdb"));
    assert_false(karst_saved_is_name("a.karstdb/b") || karst_saved_is_name("a.karst") || karst_saved_is_name(""));
}

static void test_what_a_path_says(void **state)
{
    (void)state;
    char file[4096];
    assert_true(karst_data_find("paths", "low-flight", ".json", file, sizeof file, NULL));
    karst_path *flight = karst_path_load(file, -4, NULL);
    assert_non_null(flight);
    assert_string_equal(karst_path_world(flight), "hills");
    assert_non_null(karst_path_description(flight));
    karst_path_destroy(flight);
    FILE *plain = fopen(in_folder("plain.json"), "w");
    assert_true(plain &&
                fputs("{\"keyframes\": [{\"time\": 0, \"position\": [\"0\",\"0\",\"0\"], \"yaw\": 0, "
                      "\"pitch\": 0}]}",
                      plain) >= 0 &&
                fclose(plain) == 0);
    karst_path *still = karst_path_load(path, 0, NULL);
    assert_non_null(still);
    assert_null(karst_path_world(still));
    assert_null(karst_path_description(still));
    karst_path_destroy(still);
}

static void test_code(void **state)
{
    (void)state;
    karst_error why = {0};
    const karst_world_config config = {.world = "asteroid"};
    karst_world *world = karst_world_open(&config, &why);
    assert_non_null(world);
    if (!karst_world_try_code(world, NULL, &why))
        fail_msg("%s", why.message);
    assert_refused(karst_world_try_code(world, "no such device", &error), KARST_NO_DEVICE, "no such device");
    karst_world_close(world);
}

static bool stop(void *user, double share)
{
    (void)user;
    (void)share;
    return false;
}

/* A ball that fills the middle of the picture, in front of the sky. */
static void test_reference_picture(void **state)
{
    (void)state;
    enum { SIDE = 9 };
    static uint8_t rgba[SIDE * SIDE * 4];
    FILE *file = fopen(in_folder("ball.karst"), "w");
    assert_true(file &&
                fputs("/*{ \"voxel\": 0.25, \"view\": 100 }*/\nfloat density(vec3 p) { return 5.0 - length(p); }\n",
                      file) >= 0 &&
                fclose(file) == 0);
    karst_camera camera = {.fov_deg = 60};
    assert_true(karst_camera_parse("0,0,-12,0,0", -2, &camera, NULL));
    karst_reference_config config = {.world = path, .camera = &camera, .width_px = SIDE, .height_px = SIDE};
    karst_reference_stats stats;
    karst_error why = {0};
    if (!karst_reference_picture(&config, 2, rgba, NULL, NULL, &stats, &why))
        fail_msg("%s", why.message);
    assert_memory_not_equal(rgba, rgba + (SIDE * SIDE / 2) * 4, 3);
    assert_memory_equal(rgba + 3 * 4, rgba + 5 * 4, 3);
    assert_int_equal(stats.num_unresolved, 0);
    assert_refused(karst_reference_picture(&config, 0, rgba, NULL, NULL, NULL, &error), KARST_USAGE, "");
    assert_refused(karst_reference_picture(&config, 9, rgba, NULL, NULL, NULL, &error), KARST_USAGE, "");
    static uint8_t large[200 * 200 * 4];
    config.width_px = config.height_px = 200;
    assert_refused(karst_reference_picture(&config, 1, large, stop, NULL, NULL, &error), KARST_FAILED, "");
    config.height_px = SIDE;
    config.width_px = 0;
    assert_refused(karst_reference_picture(&config, 1, rgba, NULL, NULL, NULL, &error), KARST_USAGE, "");
    config.width_px = SIDE;
    config.world = "/nowhere/none.karst";
    assert_refused(karst_reference_picture(&config, 1, rgba, NULL, NULL, NULL, &error), KARST_BAD_WORLD, "none.karst");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_maps_of_heights),  cmocka_unit_test(test_channels),
                                       cmocka_unit_test(test_info_json),        cmocka_unit_test(test_names),
                                       cmocka_unit_test(test_what_a_path_says), cmocka_unit_test(test_code),
                                       cmocka_unit_test(test_reference_picture)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
