/* Worlds that are edited while an engine shows them: pictures are those of engines that had the edits from the start,
 * in every byte; only what an edit meets is forgotten; pools of any size come to rest; and nothing is lost. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/noise/random.h"

#define WIDTH 160
#define HEIGHT 120
#define NUM_BYTES (WIDTH * HEIGHT * 4)
#define MAX_FRAMES 200

#define assert_ok(call)                               \
    do {                                              \
        karst_error error = {0};                      \
        if (!(call))                                  \
            fail_msg("%s: %s", #call, error.message); \
    } while (0)

static karst_engine_config base_config(const char *world)
{
    return (karst_engine_config){.world = world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = WIDTH,
                                 .height_px = HEIGHT,
                                 .pool_bytes = (uint64_t)1 << 28};
}

static karst_engine *create(const karst_engine_config *config)
{
    karst_engine *engine;
    assert_ok(engine = karst_engine_create(config, &error));
    return engine;
}

static karst_stats take(karst_engine *engine, uint8_t *rgba)
{
    karst_stats stats;
    bool settled;
    assert_ok(karst_engine_settle(engine, MAX_FRAMES, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_check(engine, &error));
    assert_ok(karst_engine_read_pixels(engine, rgba, NUM_BYTES, &error));
    karst_engine_stats(engine, &stats);
    return stats;
}

/* In front of the camera of `hills`, all shapes and modes. */
static karst_edit random_edit(const karst_engine *engine, double smallest_m, double largest_m)
{
    karst_edit e = {.shape = (karst_edit_shape)random_below(5), .mode = (karst_edit_mode)random_below(4)};
    double ahead_m = random_magnitude(40, 1500), aside_m = ahead_m * (random_unit() - 0.5);
    const double from_camera_m[3] = {0.5 * ahead_m + 0.87 * aside_m, -0.2 * ahead_m - 100 * random_unit(),
                                     0.87 * ahead_m - 0.5 * aside_m};
    if (e.mode == KARST_EDIT_FLATTEN || e.shape == KARST_EDIT_PLANE)
        e.shape = (karst_edit_shape)random_below(2);
    e.at = karst_position_add_m(karst_engine_camera(engine).position, from_camera_m, karst_engine_voxel_log2_m(engine));
    for (int a = 0; a < 3; a++) {
        e.half_m[a] = random_magnitude(smallest_m, largest_m);
        e.to_m[a] = (random_unit() - 0.5) * largest_m;
    }
    e.radius_m = random_magnitude(smallest_m, largest_m);
    e.blend_m = random_below(2) ? 0 : 2;
    e.amplitude_m = e.radius_m / 4;
    e.scale_m = 4;
    e.seed = (uint32_t)random_bits();
    e.has_colour = e.mode == KARST_EDIT_PAINT || (e.mode == KARST_EDIT_ADD && random_below(2));
    for (int i = 0; i < 3; i++)
        e.colour[i] = random_unit();
    e.strength = random_below(2) ? 1 : 0.5;
    return e;
}

#define NUM_EDITS 1000

/* A thousand edits, one by one between frames, some undone and redone on the way. */
static void edits_one_by_one_are_edits_from_the_start(void **state)
{
    (void)state;
    static uint8_t one_by_one[NUM_BYTES], at_once[NUM_BYTES], plain[NUM_BYTES], undone[NUM_BYTES];
    const int num_edits = getenv("KARST_TEST_QUICK") ? NUM_EDITS / 10 : NUM_EDITS;
    karst_engine_config config = base_config("hills");
    karst_engine *engine = create(&config), *fresh = create(&config);
    karst_edit *edits = calloc((size_t)num_edits, sizeof *edits);
    size_t num;
    random_state = 7;
    take(engine, plain);
    for (int i = 0; i < num_edits; i++) {
        edits[i] = random_edit(engine, 0.05, 30);
        assert_ok(karst_engine_edit(engine, &edits[i], 1, &error));
        if (i % 100 == 50) {
            num = 7;
            assert_ok(karst_engine_undo(engine, &num, &error));
            assert_int_equal(num, 7);
            assert_ok(karst_engine_frame(engine, &error));
            num = 100; /* more than there are */
            assert_ok(karst_engine_redo(engine, &num, &error));
            assert_int_equal(num, 7);
        }
        if (i % 20 == 0)
            assert_ok(karst_engine_frame(engine, &error));
    }
    take(engine, one_by_one);
    assert_ok(karst_engine_edit(fresh, edits, (size_t)num_edits, &error));
    take(fresh, at_once);
    assert_memory_equal(one_by_one, at_once, NUM_BYTES);
    assert_memory_not_equal(one_by_one, plain, NUM_BYTES);

    num = SIZE_MAX;
    assert_ok(karst_engine_undo(engine, &num, &error));
    assert_int_equal(num, num_edits);
    size_t redoable;
    assert_int_equal(karst_engine_num_edits(engine, &redoable), 0);
    assert_int_equal(redoable, num_edits);
    take(engine, undone);
    assert_memory_equal(undone, plain, NUM_BYTES);
    free(edits);
    karst_engine_destroy(engine);
    karst_engine_destroy(fresh);
}

/* What an edit meets is forgotten, nothing else, and is there again at full detail in the third frame. */
static void an_edit_is_there_soon(void **state)
{
    (void)state;
    static uint8_t rgba[NUM_BYTES], after[NUM_BYTES], settled[NUM_BYTES];
    karst_engine_config config = base_config("hills");
    karst_engine *engine = create(&config);
    karst_edit_report small, large;
    random_state = 8;
    karst_edit edit = random_edit(engine, 1, 2);
    edit = (karst_edit){.at = edit.at, .radius_m = 3};
    assert_ok(karst_engine_edit(engine, &edit, 1, &error)); /* compiles */
    take(engine, rgba);
    karst_stats before;
    karst_engine_stats(engine, &before);
    const double far_below_m[3] = {0, -3000, 0};
    karst_edit unseen = edit;
    unseen.at = karst_position_add_m(edit.at, far_below_m, karst_engine_voxel_log2_m(engine));
    assert_ok(karst_engine_edit(engine, &unseen, 1, &error));
    small = karst_engine_edit_report(engine);
    take(engine, rgba);
    edit.radius_m = 60;
    edit.mode = KARST_EDIT_REMOVE;
    assert_ok(karst_engine_edit(engine, &edit, 1, &error));
    large = karst_engine_edit_report(engine);
    print_message("# forgotten nodes: %llu for a sphere of 3 m far below, %llu for one of 60 m in sight; %llu bricks\n",
                  (unsigned long long)small.num_nodes, (unsigned long long)large.num_nodes,
                  (unsigned long long)before.num_resident_bricks);
    assert_true(small.num_nodes > 0 && small.num_nodes < 60);
    assert_true(large.num_nodes > small.num_nodes);
    assert_true(large.num_bricks < before.num_resident_bricks);
    for (int frame = 0; frame < 3; frame++)
        assert_ok(karst_engine_frame(engine, &error));
    karst_stats third;
    karst_engine_stats(engine, &third);
    assert_int_equal(third.num_provisional, 0);
    assert_ok(karst_engine_read_pixels(engine, after, NUM_BYTES, &error));
    take(engine, settled);
    assert_memory_equal(after, settled, NUM_BYTES);
    karst_engine_destroy(engine);
}

/* Calm at the whole working set and at parts of it, once edits stop; and no hole on the way. */
static void pools_of_any_size_come_to_rest(void **state)
{
    (void)state;
    static uint8_t rgba[NUM_BYTES];
    karst_engine_config config = base_config("hills");
    karst_engine *engine = create(&config);
    karst_stats whole = take(engine, rgba);
    karst_engine_destroy(engine);
    static const int parts[] = {100, 50, 25, 10};
    for (int i = 0; i < 4; i++) {
        config.num_bricks = (uint32_t)(whole.bricks.num_used * (uint64_t)parts[i] / 100) + 16;
        config.num_tiles = 3 * config.num_bricks;
        engine = create(&config);
        random_state = 9;
        for (int k = 0; k < 30; k++) {
            karst_edit edit = random_edit(engine, 1, 40);
            karst_stats stats;
            assert_ok(karst_engine_edit(engine, &edit, 1, &error));
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            assert_int_equal(stats.num_incomplete, 0);
        }
        take(engine, rgba);
        for (int frame = 0; frame < 5; frame++) {
            karst_stats stats;
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            assert_true(stats.settled);
            assert_int_equal(stats.num_produced, 0);
        }
        karst_engine_destroy(engine);
    }
}

/* The same for ten edits a second, for ten seconds: of 30 pictures each, in the model's time, whatever a frame takes
 * here. Meanwhile there is no hole, what is seen is as fine as it was before, or nearly, and most of it is there. */
#define PICTURES_A_SECOND 30
#define EDITS_A_SECOND 10
#define SECONDS 10
static void edits_that_keep_coming_leave_it_calm(void **state)
{
    (void)state;
    static uint8_t rgba[NUM_BYTES];
    karst_engine_config config = base_config("hills");
    karst_engine *engine = create(&config);
    const int num_frames = PICTURES_A_SECOND * SECONDS / (getenv("KARST_TEST_QUICK") ? 5 : 1);
    karst_stats whole = take(engine, rgba);
    karst_engine_destroy(engine);
    static const int parts[] = {100, 50, 25, 10};
    for (int i = 0; i < 4; i++) {
        config.num_bricks = (uint32_t)(whole.bricks.num_used * (uint64_t)parts[i] / 100) + 16;
        config.num_tiles = 3 * config.num_bricks;
        engine = create(&config);
        const karst_stats before = take(engine, rgba);
        karst_stats stats;
        double coarsest_px = 0;
        uint64_t num_hits = 0, num_provisional = 0;
        random_state = 11;
        for (int frame = 0; frame < num_frames; frame++) {
            if (frame % (PICTURES_A_SECOND / EDITS_A_SECOND) == 0) {
                karst_edit edit = random_edit(engine, 0.3, 5);
                assert_ok(karst_engine_edit(engine, &edit, 1, &error));
            }
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            assert_int_equal(stats.num_incomplete, 0);
            coarsest_px = fmax(coarsest_px, stats.detail_given_px);
            num_hits += stats.num_hits;
            num_provisional += stats.num_provisional;
        }
        int num_more = 0;
        while (!stats.settled && num_more < 20) {
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            num_more++;
        }
        print_message("# %d %% of the pool: %.2f px before, %.2f at most, %.2f afterwards, at rest after %d frames; "
                      "of the hits %.2f %% on stand-ins\n",
                      parts[i], before.detail_given_px, coarsest_px, stats.detail_given_px, num_more,
                      100 * (double)num_provisional / (double)num_hits);
        assert_true(coarsest_px <= 1.5 * before.detail_given_px);
        assert_true(num_provisional < num_hits / 50);
        for (int frame = 0; frame < 5; frame++) {
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            assert_true(stats.settled);
            assert_int_equal(stats.num_produced, 0);
        }
        karst_engine_destroy(engine);
    }
}

/* Pictures at 10^15 m are those at 0 of a world without features, edits and all. */
static void far_out_as_at_the_origin(void **state)
{
    (void)state;
    static uint8_t rgba[2][NUM_BYTES];
    char path[] = "/tmp/karst-flat-XXXXXX.karst";
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0);
    FILE *file = fdopen(fd, "w");
    fputs("/*{ \"voxel\": 0.125, \"camera\": { \"position\": [\"0\", \"12\", \"0\"], \"yaw\": 0, \"pitch\": -20 } }*/\n"
          "float density(vec3 p) { return -p.y; }\n",
          file);
    fclose(file);
    karst_engine_config config = base_config(path);
    for (int place = 0; place < 2; place++) {
        karst_engine *engine = create(&config);
        karst_camera camera = karst_engine_camera(engine);
        const double base_m[3] = {place ? 0x1p50 : 0, 0, place ? -0x1p50 : 0};
        camera.position = karst_position_add_m(camera.position, base_m, -3);
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        random_state = 10;
        for (int i = 0; i < 30; i++) {
            karst_edit edit = random_edit(engine, 0.02, 5);
            const double down_m[3] = {0, 30, 0};
            edit.at = karst_position_add_m(edit.at, down_m, -3);
            if (edit.shape == KARST_EDIT_NOISE) /* whose lattice is the world's */
                edit.shape = KARST_EDIT_SPHERE;
            assert_ok(karst_engine_edit(engine, &edit, 1, &error));
        }
        take(engine, rgba[place]);
        karst_engine_destroy(engine);
    }
    remove(path);
    assert_memory_equal(rgba[0], rgba[1], NUM_BYTES);
}

static void refined_hits_and_edits_do_not_go_together(void **state)
{
    (void)state;
    karst_engine_config config = base_config("hills");
    config.refine = true;
    karst_engine *engine = create(&config);
    const karst_edit edit = {.radius_m = 1};
    karst_error why = {0};
    assert_false(karst_engine_edit(engine, &edit, 1, &why));
    assert_int_equal(why.status, KARST_USAGE);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edits_one_by_one_are_edits_from_the_start),
        cmocka_unit_test(an_edit_is_there_soon),
        cmocka_unit_test(pools_of_any_size_come_to_rest),
        cmocka_unit_test(edits_that_keep_coming_leave_it_calm),
        cmocka_unit_test(far_out_as_at_the_origin),
        cmocka_unit_test(refined_hits_and_edits_do_not_go_together),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
