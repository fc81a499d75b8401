/* What the headers promise to be thread-safe, from many threads at once: for ThreadSanitizer (make check-threads), and
 * the answers are those of one thread. */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/karst.h"

enum { THREADS = 6, TURNS = 4, POINTS = 3000 };

static char folder[] = "/tmp/karst-threads-XXXXXX";
static karst_world *world;
static karst_path *flight;
static karst_position at[POINTS];
static float expected[POINTS];
static karst_camera expected_camera;
static atomic_int num_wrong;

#define must(condition)                            \
    do {                                           \
        if (!(condition)) {                        \
            atomic_fetch_add(&num_wrong, 1);       \
            fprintf(stderr, "# %s\n", #condition); \
        }                                          \
    } while (0)

static void read_world(void)
{
    static _Thread_local float density[POINTS], gradient[POINTS][3], rgb[POINTS][3];
    static _Thread_local double half_m[POINTS][3], range[POINTS][2];
    const karst_query_config config = {.num_threads = 2};
    must(karst_query_densities(world, &config, at, POINTS, density, NULL) &&
         memcmp(density, expected, sizeof density) == 0);
    must(karst_query_gradients(world, &config, at, 300, gradient, NULL, NULL));
    must(karst_query_colours(world, &config, at, NULL, 100, rgb, NULL));
    must(karst_query_bounds(world, &config, at, (const double(*)[3])half_m, 100, range, NULL));
    const karst_query_ray ray = {.from = at[0], .direction = {0, -1, 0}, .length_m = 50};
    karst_query_hit hit;
    must(karst_query_rays(world, &config, &ray, 1, &hit, NULL));
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    const karst_sample one = karst_sampler_density(sampler, &at[7], 0);
    must(memcmp(&one.device, &expected[7], sizeof(float)) == 0);
    karst_sampler_destroy(sampler);
    must(karst_world_get_metadata(world)->num_parameters > 0 && karst_world_level(world, 4) > 0);
}

static void open_things(int number)
{
    char name[128], names[4][KARST_DATA_NAME_BYTES], text[512];
    uint8_t pixels[4 * 4 * 4] = {(uint8_t)number};
    karst_error error = {0};
    const karst_world_config config = {.world = "asteroid"}, bad = {.world = "nowhere"};
    karst_world *other = karst_world_open(&config, &error);
    must(other);
    karst_world_close(other);
    must(!karst_world_open(&bad, &error) && error.status == KARST_BAD_WORLD);
    must(karst_data_list("worlds", ".karst", names, 4) == 4);
    const karst_camera camera = karst_path_sample(flight, 3.25);
    must(memcmp(&camera.position, &expected_camera.position, sizeof camera.position) == 0);
    must(karst_camera_format(&camera, -4, text, sizeof text) > 0);
    snprintf(name, sizeof name, "%s/%d.png", folder, number);
    must(karst_image_write_png(name, pixels, 4, 4, NULL));
    int width_px = 0, height_px = 0;
    uint8_t *read = karst_image_read_png(name, &width_px, &height_px, NULL);
    must(read && width_px == 4 && read[0] == (uint8_t)number);
    free(read);
    snprintf(name, sizeof name, "%s/%d.exr", folder, number);
    must(karst_image_write_exr(name, pixels, NULL, NULL, 4, 4, NULL));
    snprintf(name, sizeof name, "%s/%d.karstdb", folder, number);
    const karst_saved_config fresh = {.world = "asteroid"};
    unlink(name);
    must(karst_saved_create(name, &fresh, NULL));
    karst_saved *saved = karst_saved_open(name, true, NULL, NULL);
    karst_edit edit;
    must(saved && karst_edit_parse("sphere,1,2,3,4", -4, &edit, NULL) &&
         karst_saved_append(saved, &edit, 1, -4, NULL) && karst_saved_commit(saved, NULL));
    karst_saved_close(saved);
    size_t num = 0;
    karst_edit *edits = karst_saved_load_edits(name, -4, &num, NULL, NULL);
    must(edits && num == 1);
    free(edits);
}

static void *work(void *argument)
{
    for (int turn = 0; turn < TURNS; turn++) {
        read_world();
        open_things((int)(intptr_t)argument);
    }
    return NULL;
}

static void test_threads(void **state)
{
    (void)state;
    pthread_t threads[THREADS];
    pthread_attr_t attributes;
    char file[4096], command[64];
    const karst_world_config config = {.world = "hills"};
    const karst_query_config one = {.num_threads = 1};
    assert_non_null(mkdtemp(folder));
    world = karst_world_open(&config, NULL);
    assert_non_null(world);
    for (int i = 0; i < POINTS; i++)
        at[i] = (karst_position){{i * 7 - 9000, i % 977 - 400, i * 3}, {0, 0, 0}};
    assert_true(karst_query_densities(world, &one, at, POINTS, expected, NULL));
    assert_true(karst_data_find("paths", "low-flight", ".json", file, sizeof file, NULL));
    flight = karst_path_load(file, -4, NULL);
    assert_non_null(flight);
    expected_camera = karst_path_sample(flight, 3.25);
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, (size_t)16 << 20);
    for (int i = 0; i < THREADS; i++)
        assert_int_equal(pthread_create(&threads[i], &attributes, work, (void *)(intptr_t)i), 0);
    for (int i = 0; i < THREADS; i++)
        pthread_join(threads[i], NULL);
    pthread_attr_destroy(&attributes);
    assert_int_equal(atomic_load(&num_wrong), 0);
    karst_path_destroy(flight);
    karst_world_close(world);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    assert_int_equal(system(command), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
