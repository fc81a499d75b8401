/* Each error that the public headers document of functions that need no device: tests/api/run.sh sees to it that none
 * is left out. What the functions do otherwise is for the tests of their parts. */
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>
#include <sqlite3.h>

#include "karst/karst.h"
#include "tests/support/provoke.h"

static char folder[] = "/tmp/karst-errors-XXXXXX";
static karst_world *world; /* of one ball, with colours */
static char ball[64];

/* A few names at a time. */
static const char *in_folder(const char *name)
{
    static char paths[8][96];
    static int next;
    next = (next + 1) % 8;
    snprintf(paths[next], sizeof paths[next], "%s/%s", folder, name);
    return paths[next];
}

static const char *write_text(const char *name, const char *text)
{
    const char *path = in_folder(name);
    FILE *file = fopen(path, "w");
    assert_true(file && fputs(text, file) >= 0 && fclose(file) == 0);
    return path;
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return 1;
    snprintf(ball, sizeof ball, "%s",
             write_text("ball.karst", "/*{ \"voxel\": 0.25, \"view\": 100 }*/\n"
                                      "float density(vec3 p) { return 5.0 - length(p); }\n"
                                      "vec3 colour(vec3 p, vec3 n) { return vec3(0.5, 0.25, 0.125); }\n"));
    const karst_world_config config = {.world = ball};
    world = karst_world_open(&config, NULL);
    return world ? 0 : 1;
}

static int tear_down(void **state)
{
    char command[64];
    (void)state;
    karst_world_close(world);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}

static void test_names_and_numbers(void **state)
{
    (void)state;
    karst_aov aov;
    karst_view view;
    karst_tone tone;
    karst_media_mode mode;
    karst_scattering scattering;
    karst_integrator integrator;
    karst_display_kind kind;
    karst_mesh_format format;
    karst_camera camera = {.fov_deg = 60};
    karst_position position;
    int64_t voxel;
    uint32_t fraction;
    char path[8];
    float depth[4] = {0};
    float matrix[16];
    const karst_depth_range range = {.near_m = 1, .far_m = 100}, none = {.near_m = 2, .far_m = 1};
    PROVOKE(KARST_USAGE, karst_aov_parse, ("x", &aov, &error));
    PROVOKE(KARST_USAGE, karst_view_parse, ("x", &view, &error));
    PROVOKE(KARST_USAGE, karst_tone_parse, ("x", &tone, &error));
    PROVOKE(KARST_USAGE, karst_media_mode_parse, ("x", &mode, &error));
    PROVOKE(KARST_USAGE, karst_scattering_parse, ("x", &scattering, &error));
    PROVOKE(KARST_USAGE, karst_integrator_parse, ("x", &integrator, &error));
    PROVOKE(KARST_USAGE, karst_display_kind_parse, ("x", &kind, &error));
    PROVOKE(KARST_USAGE, karst_mesh_format_of, ("a.x", &format, &error));
    PROVOKE(KARST_USAGE, karst_camera_parse, ("1,2,3", 0, &camera, &error));
    PROVOKE(KARST_USAGE, karst_camera_parse, ("1,2,3,0,91", 0, &camera, &error));
    PROVOKE(KARST_USAGE, karst_position_parse, ("1", "2", "x", 0, &position, &error));
    PROVOKE(KARST_USAGE, karst_position_parse, ("1", "1e40", "3", 0, &position, &error));
    PROVOKE(KARST_USAGE, karst_coordinate_parse, ("1", KARST_VOXEL_LOG2_MAX + 1, &voxel, &fraction, &error));
    PROVOKE(KARST_BAD_DATA, karst_data_find, ("worlds", "no-such", ".karst", path, sizeof path, &error));
    PROVOKE(KARST_USAGE, karst_data_find, ("worlds", "hills", ".karst", path, sizeof path, &error));
    PROVOKE(KARST_USAGE, karst_depth_to_window, (&camera, 0, 2, &range, depth, depth, &error));
    PROVOKE(KARST_USAGE, karst_depth_to_window, (&camera, 2, 2, &none, depth, depth, &error));
    PROVOKE(KARST_USAGE, karst_depth_from_window, (&camera, 2, 16385, &range, depth, depth, &error));
    PROVOKE(KARST_USAGE, karst_depth_from_window, (&camera, 2, 2, &none, depth, depth, &error));
    PROVOKE(KARST_USAGE, karst_depth_matrix, (&camera, 0, 2, &range, matrix, &error));
    PROVOKE(KARST_USAGE, karst_depth_matrix, (&camera, 2, 2, &none, matrix, &error));
}

static void test_paths_and_edits(void **state)
{
    (void)state;
    const char *good = write_text("good.json", "{\"keyframes\": [{\"time\": 0, \"position\": [\"0\",\"0\",\"0\"], "
                                               "\"yaw\": 0, \"pitch\": 0}]}");
    const char *bad = write_text("bad.json", "{\"keyframes\": [{\"time\": 0}]}");
    const char *edits =
        write_text("edits.json", "{\"edits\": [{\"shape\": \"sphere\", \"mode\": \"add\", \"at\": [0, 0, 0], "
                                 "\"radius\": 2}]}");
    size_t num;
    karst_edit edit;
    PROVOKE(KARST_BAD_DATA, karst_path_load, (bad, 0, &error));
    PROVOKE(KARST_BAD_DATA, karst_path_load, (in_folder("none"), 0, &error));
    PROVOKE(KARST_USAGE, karst_path_load, (good, KARST_VOXEL_LOG2_MIN - 1, &error));
    PROVOKE(KARST_BAD_DATA, karst_path_check, (bad, &error));
    PROVOKE_MEMORY(karst_path_load, (good, 0, &error), karst_path_destroy);
    PROVOKE(KARST_BAD_DATA, karst_edits_load, (good, 0, &num, &error));
    PROVOKE(KARST_BAD_DATA, karst_edits_load, (in_folder("none"), 0, &num, &error));
    PROVOKE_MEMORY(karst_edits_load, (edits, 0, &num, &error), free);
    PROVOKE(KARST_USAGE, karst_edit_parse, ("sphere,1,2,3,-4", 0, &edit, &error));
    PROVOKE_MEMORY(karst_edit_parse, ("sphere,1,2,3,4", 0, &edit, &error), provoke_keep);
    assert_true(karst_edit_parse("sphere,0,0,0,1", -2, &edit, NULL));
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    assert_non_null(sampler);
    PROVOKE_MEMORY(karst_sampler_append_edits, (sampler, &edit, 1, &error), provoke_keep);
    PROVOKE_MEMORY(karst_sampler_set_edits, (sampler, &edit, 1, &error), provoke_keep);
    edit.radius_m = 0;
    PROVOKE(KARST_USAGE, karst_sampler_set_edits, (sampler, &edit, 1, &error));
    PROVOKE(KARST_USAGE, karst_sampler_append_edits, (sampler, &edit, 1, &error));
    karst_sampler_destroy(sampler);
}

static void ignore_line(void *user, const char *line)
{
    (void)user;
    (void)line;
}

static void print_line(void *user, const char *line)
{
    (void)user;
    print_message("# %s\n", line);
}

static void *no_function(const char *name)
{
    (void)name;
    return NULL;
}

static void test_worlds(void **state)
{
    (void)state;
    const karst_world_config nothing = {0}, good = {.world = ball}, unknown = {.world = "no-such-world"},
                             wrong = {.world = write_text("wrong.karst", "float density(vec3 p) { return; }")};
    PROVOKE(KARST_USAGE, karst_world_open, (&nothing, &error));
    PROVOKE(KARST_BAD_WORLD, karst_world_open, (&unknown, &error));
    PROVOKE(KARST_BAD_WORLD, karst_world_open, (&wrong, &error));
    PROVOKE_MEMORY(karst_world_open, (&good, &error), karst_world_close);
    PROVOKE_MEMORY(karst_world_check, (world, ignore_line, NULL, &error), provoke_keep);
    PROVOKE_MEMORY(karst_sampler_create, (world, &error), karst_sampler_destroy);
    PROVOKE_MEMORY(karst_helper_create, (&error), karst_helper_destroy);
    PROVOKE(KARST_USAGE, karst_display_create, (KARST_DISPLAY_WINDOW, NULL, &error));
    faults_fail_device(true);
    PROVOKE(KARST_NO_DEVICE, karst_display_create, (KARST_DISPLAY_OSMESA, NULL, &error));
    PROVOKE(KARST_NO_DEVICE, karst_display_create_in_context, (no_function, NULL, &error));
}

/* ---- pictures ---- */

enum { WIDTH = 120, HEIGHT = 65, NUM = WIDTH * HEIGHT };
static uint8_t rgba[NUM * 4];
static float values[NUM];

/* That cannot be packed. */
static uint8_t noise(int i)
{
    uint32_t x = (uint32_t)(i + 1) * 2654435761u;
    x = (x ^ x >> 15) * 2246822519u;
    return (uint8_t)(x >> 24 ^ x >> 11);
}

/* Files may not grow beyond so many bytes, as on a disk that is full. */
static void limit_files(rlim_t size_bytes)
{
    struct rlimit limit;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
    limit.rlim_cur = size_bytes;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

static void test_writing_pictures(void **state)
{
    (void)state;
    const karst_image_channel channels[] = {{"Z", values, 1}, {"Z", values, 1}};
    const char *const names[] = {"Z", "Z"};
    const double heights[4] = {1, 2, 3, 4};
    const char *png = in_folder("a.png"), *exr = in_folder("a.exr"), *nowhere = in_folder("none/a");
    for (int i = 0; i < NUM * 4; i++)
        rgba[i] = noise(i);
    for (int i = 0; i < NUM; i++)
        values[i] = (float)noise(i) * (float)noise(i + NUM);
    PROVOKE(KARST_USAGE, karst_image_write_png, (png, rgba, 0, 1, &error));
    PROVOKE(KARST_FAILED, karst_image_write_png, (nowhere, rgba, WIDTH, HEIGHT, &error));
    PROVOKE_MEMORY(karst_image_write_png, (png, rgba, WIDTH, HEIGHT, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_image_write_exr, (exr, rgba, NULL, NULL, 1, 16385, &error));
    PROVOKE(KARST_FAILED, karst_image_write_exr, (nowhere, rgba, NULL, NULL, WIDTH, HEIGHT, &error));
    PROVOKE(KARST_USAGE, karst_image_write_channels, (exr, channels, 2, WIDTH, HEIGHT, &error));
    PROVOKE(KARST_FAILED, karst_image_write_channels, (nowhere, channels, 1, WIDTH, HEIGHT, &error));
    PROVOKE(KARST_USAGE, karst_heights_write, (png, heights, 2, 2, 4, 4, &error));
    PROVOKE(KARST_FAILED, karst_heights_write, (in_folder("none/a.png"), heights, 2, 2, 0, 4, &error));
    PROVOKE(KARST_USAGE, karst_image_begin_png, (png, 0, 1, &error));
    PROVOKE(KARST_FAILED, karst_image_begin_png, (nowhere, WIDTH, HEIGHT, &error));
    PROVOKE(KARST_USAGE, karst_image_begin_exr, (exr, names, 2, NULL, WIDTH, HEIGHT, &error));
    PROVOKE(KARST_FAILED, karst_image_begin_exr, (nowhere, names, 1, NULL, WIDTH, HEIGHT, &error));
    PROVOKE_MEMORY(karst_image_begin_png, (png, WIDTH, HEIGHT, &error), karst_image_discard);
    PROVOKE_MEMORY(karst_image_begin_exr, (exr, names, 1, NULL, WIDTH, HEIGHT, &error), karst_image_discard);

    karst_image_writer *writer = karst_image_begin_png(png, WIDTH, HEIGHT, NULL);
    PROVOKE(KARST_USAGE, karst_image_add_bytes, (writer, rgba, HEIGHT + 1, &error));
    PROVOKE(KARST_USAGE, karst_image_add_channels, (writer, channels, 1, 16, &error));
    PROVOKE(KARST_USAGE, karst_image_end, (writer, &error));
    /* More than stdio keeps back; then what it kept back. */
    limit_files(64);
    writer = karst_image_begin_png(png, WIDTH, HEIGHT, NULL);
    PROVOKE(KARST_FAILED, karst_image_add_bytes, (writer, rgba, HEIGHT, &error));
    karst_image_discard(writer);
    writer = karst_image_begin_png(png, 1, 1, NULL);
    assert_true(karst_image_add_bytes(writer, rgba, 1, NULL));
    PROVOKE(KARST_FAILED, karst_image_end, (writer, &error));
    limit_files(1024);
    writer = karst_image_begin_exr(exr, names, 1, NULL, WIDTH, HEIGHT, NULL);
    PROVOKE(KARST_FAILED, karst_image_add_channels, (writer, channels, 1, HEIGHT, &error));
    karst_image_discard(writer);
    limit_files(RLIM_INFINITY);
}

static void test_reading_pictures(void **state)
{
    (void)state;
    int width_px, height_px;
    const char *png = in_folder("b.png"), *exr = in_folder("b.exr");
    const char *const z[] = {"Z"}, *const other[] = {"Y"};
    const karst_image_channel channel = {"Z", values, 1};
    assert_true(karst_image_write_png(png, rgba, WIDTH, HEIGHT, NULL));
    assert_true(karst_image_write_channels(exr, &channel, 1, WIDTH, HEIGHT, NULL));
    PROVOKE(KARST_BAD_DATA, karst_image_read_png, (exr, &width_px, &height_px, &error));
    PROVOKE_MEMORY(karst_image_read_png, (png, &width_px, &height_px, &error), free);
    PROVOKE(KARST_BAD_DATA, karst_image_open_png, (exr, &width_px, &height_px, &error));
    PROVOKE_MEMORY(karst_image_open_png, (png, &width_px, &height_px, &error), karst_image_close);
    PROVOKE(KARST_BAD_DATA, karst_image_open_exr, (png, &width_px, &height_px, &error));
    PROVOKE_MEMORY(karst_image_open_exr, (exr, &width_px, &height_px, &error), karst_image_close);
    karst_image_reader *reader = karst_image_open_exr(exr, &width_px, &height_px, NULL);
    PROVOKE(KARST_USAGE, karst_image_read_rows, (reader, z, 1, HEIGHT, 1, values, &error));
    PROVOKE(KARST_BAD_DATA, karst_image_read_rows, (reader, other, 1, 0, 1, values, &error));
    PROVOKE(KARST_USAGE, karst_image_read_bytes, (reader, rgba, 1, &error));
    karst_image_close(reader);
    assert_int_equal(truncate(png, 3000), 0);
    reader = karst_image_open_png(png, &width_px, &height_px, NULL);
    PROVOKE(KARST_USAGE, karst_image_read_bytes, (reader, rgba, HEIGHT + 1, &error));
    PROVOKE(KARST_BAD_DATA, karst_image_read_bytes, (reader, rgba, HEIGHT, &error));
    karst_image_close(reader);
}

/* ---- queries, meshes, the reference, points ---- */

static void test_queries(void **state)
{
    (void)state;
    const karst_query_config config = {0}, wrong = {.footprint_m = -1};
    const karst_position at[2] = {{.voxel = {0, 0, 0}}, {.voxel = {0, 40, 0}}};
    const karst_query_ray ray = {.direction = {0, 0, 1}, .length_m = 40};
    const karst_height_map map = {.size_m = {4, 4}, .size_px = {2, 2}, .depth_m = 40};
    const double half_m[1][3] = {{1, 1, 1}};
    float density[2], gradient[2][3], rgb[2][3];
    double range[1][2], down_m[4];
    uint32_t count;
    bool inside;
    karst_query_hit hit;
    PROVOKE(KARST_USAGE, karst_query_densities, (world, &wrong, at, 2, density, &error));
    PROVOKE_MEMORY(karst_query_densities, (world, &config, at, 2, density, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_query_gradients, (world, &wrong, at, 2, gradient, NULL, &error));
    PROVOKE_MEMORY(karst_query_gradients, (world, &config, at, 2, gradient, NULL, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_query_colours, (world, &wrong, at, NULL, 2, rgb, &error));
    PROVOKE_MEMORY(karst_query_colours, (world, &config, at, NULL, 2, rgb, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_query_bounds, (world, &wrong, at, half_m, 1, range, &error));
    PROVOKE_MEMORY(karst_query_bounds, (world, &config, at, half_m, 1, range, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_query_rays, (world, &wrong, &ray, 1, &hit, &error));
    PROVOKE_MEMORY(karst_query_rays, (world, &config, &ray, 1, &hit, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_query_heights, (world, &config, at, 1, -1, 1, down_m, &count, &inside, &error));
    PROVOKE_MEMORY(karst_query_heights, (world, &config, at, 1, 40, 1, down_m, &count, &inside, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_query_height_map, (world, &wrong, &map, down_m, &error));
    PROVOKE_MEMORY(karst_query_height_map, (world, &config, &map, down_m, &error), provoke_keep);
    karst_query_near near[1];
    PROVOKE(KARST_USAGE, karst_query_nearest, (world, &config, at, 1, 0, near, &error));
    PROVOKE_MEMORY(karst_query_nearest, (world, &config, at, 1, 40, near, &error), provoke_keep);
}

static bool take_vertices(void *user, const karst_mesh_vertex *vertices, size_t num, karst_error *error)
{
    (void)user, (void)vertices, (void)num, (void)error;
    return true;
}

static bool take_triangles(void *user, const uint32_t (*indices)[3], size_t num, karst_error *error)
{
    (void)user, (void)indices, (void)num, (void)error;
    return true;
}

static bool take_chunk(void *user, const karst_mesh_chunk *chunk, karst_error *error)
{
    (void)user, (void)chunk, (void)error;
    return true;
}

static void test_meshes_and_reference(void **state)
{
    (void)state;
    const karst_mesh_config config = {.corner = {.voxel = {-24, -24, -24}},
                                      .num_cells = {12, 12, 12},
                                      .cell_m = 1,
                                      .num_threads = 1},
                            wrong = {.num_cells = {12, 12, 12}};
    const karst_mesh_sink sink = {.vertices = take_vertices, .triangles = take_triangles};
    PROVOKE(KARST_USAGE, karst_mesh_find, (world, &wrong, &sink, NULL, &error));
    PROVOKE_MEMORY(karst_mesh_find, (world, &config, &sink, NULL, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_mesh_write,
            (world, &wrong, in_folder("a.ply"), KARST_MESH_OF_SUFFIX, NULL, NULL, NULL, &error));
    PROVOKE(KARST_FAILED, karst_mesh_write,
            (world, &config, in_folder("none/a.ply"), KARST_MESH_OF_SUFFIX, NULL, NULL, NULL, &error));
    const karst_mesh_chunk_sink chunks = {.chunk = take_chunk};
    PROVOKE(KARST_USAGE, karst_mesh_find_levels, (world, &config, 9, &chunks, NULL, NULL, &error));
    PROVOKE_MEMORY(karst_mesh_find_levels, (world, &config, 2, &chunks, NULL, NULL, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_mesh_write_levels,
            (world, &config, 2, in_folder("a.ply"), NULL, NULL, NULL, NULL, &error));
    PROVOKE(KARST_FAILED, karst_mesh_write_levels,
            (world, &config, 2, in_folder("none/a.glb"), NULL, NULL, NULL, NULL, &error));
    PROVOKE(KARST_USAGE, karst_mesh_write_points, (world, &config, in_folder("a.glb"), NULL, NULL, NULL, &error));
    PROVOKE(KARST_FAILED, karst_mesh_write_points,
            (world, &config, in_folder("none/a.ply"), NULL, NULL, NULL, &error));
    const karst_voxels_grid grid = {.world = world, .name = "a"};
    const karst_voxels_config voxels = {.num_voxels = {4, 4, 4}, .voxel_m = 1, .num_threads = 1};
    PROVOKE(KARST_USAGE, karst_voxels_write, (in_folder("a.vdb"), &voxels, &grid, 1, NULL, NULL, NULL, &error));
    PROVOKE(KARST_FAILED, karst_voxels_write, (in_folder("none/a.nvdb"), &voxels, &grid, 1, NULL, NULL, NULL, &error));

    karst_reference_hit hits[4];
    karst_reference_config picture = {.world = ball, .width_px = 2, .height_px = 2, .num_threads = 1}, none = picture,
                           large = picture;
    none.world = in_folder("none.karst");
    large.width_px = 16385;
    PROVOKE(KARST_USAGE, karst_reference_trace, (&large, hits, NULL, NULL, NULL, &error));
    PROVOKE(KARST_BAD_WORLD, karst_reference_trace, (&none, hits, NULL, NULL, NULL, &error));
    PROVOKE_MEMORY(karst_reference_trace, (&picture, hits, NULL, NULL, NULL, &error), provoke_keep);
    PROVOKE(KARST_USAGE, karst_reference_picture, (&picture, 9, rgba, NULL, NULL, NULL, &error));
    PROVOKE(KARST_BAD_WORLD, karst_reference_picture, (&none, 1, rgba, NULL, NULL, NULL, &error));
    PROVOKE_MEMORY(karst_reference_picture, (&picture, 1, rgba, NULL, NULL, NULL, &error), provoke_keep);

    const karst_reference_light light = {.paths_px = 1};
    karst_reference_config cloudy = picture;
    double rgb[12];
    cloudy.world = write_text("cloud.karst",
                              "float density(vec3 p) { return -1.0; }\n"
                              "medium air(vec3 p) { medium m; m.extinction = 4.0 - length(p); return m; }\n");
    PROVOKE(KARST_USAGE, karst_reference_scatter, (&picture, &light, rgb, NULL, NULL, NULL, NULL, &error));
    PROVOKE(KARST_BAD_WORLD, karst_reference_scatter, (&none, &light, rgb, NULL, NULL, NULL, NULL, &error));
    PROVOKE_MEMORY(karst_reference_scatter, (&cloudy, &light, rgb, NULL, NULL, NULL, NULL, &error), provoke_keep);
}

static void test_points(void **state)
{
    (void)state;
    const char *text = write_text("a.xyz", "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 0 0\n2 1 0\n0 2 0\n1 2 0\n2 2 0\n");
    karst_points_import_config config = {.output = in_folder("a.karstpoints"), .num_threads = 1};
    karst_points_about about;
    PROVOKE(KARST_USAGE, karst_points_import, (&config, &about, &error));
    config.input = in_folder("none.xyz");
    PROVOKE(KARST_BAD_DATA, karst_points_import, (&config, &about, &error));
    config.input = text;
    config.output = in_folder("none/a.karstpoints");
    PROVOKE(KARST_FAILED, karst_points_import, (&config, &about, &error));
    PROVOKE(KARST_BAD_DATA, karst_points_describe, (text, &about, &error));
}

/* ---- saved worlds ---- */

static bool visit(void *user, size_t number, size_t last, const karst_edit *edit)
{
    (void)user, (void)number, (void)last, (void)edit;
    return true;
}

static void test_saved_worlds(void **state)
{
    (void)state;
    const char *path = in_folder("a.karstdb"), *other = in_folder("b.karstdb");
    const karst_saved_config good = {.world = ball}, odd = {.world = ball, .camera = "x"},
                             wrong = {.world = in_folder("wrong.karst")};
    const char *text =
        write_text("no.karstdb", "no saved world, but a text that is longer than the head of a database: "
                                 "so it is looked at, and found to be none");
    karst_edit edit;
    size_t num;
    PROVOKE(KARST_USAGE, karst_saved_create, (path, &odd, &error));
    PROVOKE(KARST_BAD_WORLD, karst_saved_create, (path, &wrong, &error));
    assert_true(karst_saved_create(path, &good, NULL));
    PROVOKE(KARST_FAILED, karst_saved_create, (path, &good, &error));
    PROVOKE(KARST_BAD_DATA, karst_saved_open, (text, false, NULL, &error));
    PROVOKE(KARST_BAD_DATA, karst_saved_load_edits, (text, -2, &num, NULL, &error));
    PROVOKE(KARST_BAD_DATA, karst_saved_recover, (text, other, NULL, NULL, &error));
    PROVOKE_MEMORY(karst_saved_open, (path, true, NULL, &error), karst_saved_close);

    karst_saved *saved = karst_saved_open(path, true, NULL, NULL);
    assert_non_null(saved);
    assert_true(karst_edit_parse("sphere,0,0,0,1", -2, &edit, NULL));
    /* One edit in force, and one that was undone. */
    num = 1;
    assert_true(karst_saved_append(saved, &edit, 1, -2, NULL) && karst_saved_append(saved, &edit, 1, -2, NULL) &&
                karst_saved_undo(saved, &num, NULL) && num == 1 && karst_saved_commit(saved, NULL));
    PROVOKE(KARST_USAGE, karst_saved_set_camera, (saved, "x", &error));
    PROVOKE(KARST_USAGE, karst_saved_set_bookmark, (saved, 9, NULL, &error));
    PROVOKE_DATABASE(KARST_BAD_DATA, SQLITE_CORRUPT, karst_saved_set_camera, (saved, "1,2,3,4,5", &error));
    PROVOKE_DATABASE(KARST_BAD_DATA, SQLITE_CORRUPT, karst_saved_set_bookmark, (saved, 1, "1,2,3,4,5", &error));
    PROVOKE_DATABASE(KARST_BAD_DATA, SQLITE_CORRUPT, karst_saved_append, (saved, &edit, 1, -2, &error));
    num = 1;
    PROVOKE_DATABASE(KARST_BAD_DATA, SQLITE_CORRUPT, karst_saved_undo, (saved, &num, &error));
    num = 1;
    PROVOKE_DATABASE(KARST_BAD_DATA, SQLITE_CORRUPT, karst_saved_redo, (saved, &num, &error));
    PROVOKE_DATABASE(KARST_BAD_DATA, SQLITE_CORRUPT, karst_saved_compact, (saved, &error));
    assert_true(karst_saved_set_camera(saved, "1,2,3,4,5", NULL));
    PROVOKE_DATABASE(KARST_BAD_DATA, SQLITE_CORRUPT, karst_saved_commit, (saved, &error));
    assert_true(karst_saved_set_camera(saved, "1,2,3,4,5", NULL));
    PROVOKE_DATABASE(KARST_FAILED, SQLITE_FULL, karst_saved_commit, (saved, &error));
    PROVOKE_DATABASE(KARST_FAILED, SQLITE_IOERR, karst_saved_visit, (saved, 1, 1, -2, visit, NULL, &error));
    PROVOKE_DATABASE(KARST_FAILED, SQLITE_IOERR, karst_saved_read_edits, (saved, -2, &num, NULL, NULL, &error));
    PROVOKE_MEMORY(karst_saved_read_edits, (saved, -2, &num, NULL, NULL, &error), free);
    PROVOKE_DATABASE(KARST_FAILED, SQLITE_IOERR, karst_saved_load_edits, (path, -2, &num, NULL, &error));
    PROVOKE_DATABASE(KARST_FAILED, SQLITE_IOERR, karst_saved_check, (saved, ignore_line, NULL, &num, &error));
    PROVOKE(KARST_FAILED, karst_saved_backup, (saved, path, &error));
    PROVOKE(KARST_FAILED, karst_saved_recover, (path, path, NULL, NULL, &error));
    /* All that failed left the file as it was. */
    karst_saved_close(saved);
    saved = karst_saved_open(path, true, NULL, NULL);
    assert_true(saved && karst_saved_is_writable(saved, NULL));
    assert_int_equal(karst_saved_num_edits(saved, NULL), 1);
    assert_true(karst_saved_check(saved, print_line, NULL, &num, NULL));
    assert_int_equal(num, 0);

    /* While this one writes, another one reads. */
    karst_saved *reading = karst_saved_open(path, false, NULL, NULL);
    assert_non_null(reading);
    edit.radius_m = -1;
    PROVOKE(KARST_USAGE, karst_saved_append, (saved, &edit, 1, -2, &error));
    edit.radius_m = 1;
    PROVOKE(KARST_FAILED, karst_saved_set_camera, (reading, "1,2,3,4,5", &error));
    PROVOKE(KARST_FAILED, karst_saved_set_bookmark, (reading, 1, "1,2,3,4,5", &error));
    PROVOKE(KARST_FAILED, karst_saved_append, (reading, &edit, 1, -2, &error));
    num = 1;
    PROVOKE(KARST_FAILED, karst_saved_undo, (reading, &num, &error));
    num = 1;
    PROVOKE(KARST_FAILED, karst_saved_redo, (reading, &num, &error));
    PROVOKE(KARST_FAILED, karst_saved_compact, (reading, &error));
    karst_saved_close(reading);
    karst_saved_close(saved);

    /* Its facts are gone, so nobody knows of which world it is. */
    sqlite3 *db;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, "DELETE FROM facts", NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(db);
    PROVOKE(KARST_USAGE, karst_saved_recover, (path, other, NULL, NULL, &error));
    assert_int_equal(access(other, F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_names_and_numbers),
                                       cmocka_unit_test(test_paths_and_edits),
                                       cmocka_unit_test(test_worlds),
                                       cmocka_unit_test(test_writing_pictures),
                                       cmocka_unit_test(test_reading_pictures),
                                       cmocka_unit_test(test_queries),
                                       cmocka_unit_test(test_meshes_and_reference),
                                       cmocka_unit_test(test_points),
                                       cmocka_unit_test(test_saved_worlds)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
