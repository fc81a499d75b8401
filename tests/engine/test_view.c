/* What viewers ask of an engine: fewer pixels, what lies under one, normals, and pictures of the engine at work. */
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/engine/engine_internal.h"
#include "karst/karst.h"
#include "tests/support/ok.h"

#define WIDTH 160
#define HEIGHT 120
#define NUM_PIXELS (WIDTH * HEIGHT)

static karst_engine *engine;
static uint8_t picture[NUM_PIXELS * 4], painted[NUM_PIXELS * 4];
static float depth_m[NUM_PIXELS], normals[NUM_PIXELS * 3];

static void settle(void)
{
    bool settled;
    assert_ok(karst_engine_settle(engine, 300, NULL, NULL, &settled, &error));
    assert_true(settled);
}

static int open_engine(void **state)
{
    (void)state;
    karst_engine_config config = {.world = "asteroid",
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = WIDTH,
                                  .height_px = HEIGHT,
                                  .detail_px = 2,
                                  .pool_bytes = (uint64_t)128 << 20};
    char path[4096];
    if (karst_data_find("worlds", "asteroid", ".karst", path, sizeof path, NULL))
        config.world = path;
    karst_error refused = {0};
    engine = karst_engine_create(&config, &refused);
    if (!engine)
        fail_msg("%s", refused.message);
    settle();
    assert_ok(karst_engine_read_pixels(engine, picture, sizeof picture, &error));
    return 0;
}

static int close_engine(void **state)
{
    (void)state;
    karst_engine_destroy(engine);
    return 0;
}

static void test_probe_and_depth_agree(void **state)
{
    (void)state;
    int num_hits = 0;
    karst_error refused = {0};
    assert_ok(karst_engine_read_depth(engine, depth_m, NUM_PIXELS, &error));
    for (int y = 0; y < HEIGHT; y += 7)
        for (int x = 0; x < WIDTH; x += 5) {
            karst_probe probe;
            assert_ok(karst_engine_probe(engine, x, y, &probe, &error));
            assert_true(probe.hit == isfinite(depth_m[y * WIDTH + x]));
            assert_false(probe.provisional);
            if (probe.hit)
                assert_true(fabs(probe.depth_m / depth_m[y * WIDTH + x] - 1) < 1e-6);
            num_hits += probe.hit;
        }
    assert_true(num_hits > 50);
    karst_probe probe;
    assert_false(karst_engine_probe(engine, WIDTH, 0, &probe, &refused));
    assert_int_equal(refused.status, KARST_USAGE);
}

static void test_normals_are_unit_vectors_towards_the_eye(void **state)
{
    (void)state;
    assert_ok(karst_engine_read_normals(engine, normals, NUM_PIXELS * 3, &error));
    assert_false(karst_engine_read_normals(engine, normals, NUM_PIXELS, NULL));
    double right[3], up[3], forward[3];
    karst_camera camera = karst_engine_camera(engine);
    karst_camera_axes(&camera, right, up, forward);
    int num_hits = 0, num_away = 0;
    for (int i = 0; i < NUM_PIXELS; i++) {
        const float *n = normals + 3 * i;
        double length = sqrt((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2]);
        if (!isfinite(depth_m[i])) {
            assert_true(length == 0);
            continue;
        }
        assert_true(fabs(length - 1) < 1e-3);
        num_hits++;
        num_away +=
            n[0] * forward[0] + n[1] * forward[1] + n[2] * forward[2] > 0.5; /* past what the view's edge allows */
    }
    assert_true(num_hits > 1000);
    assert_true(num_away < num_hits / 50);
}

static int count_different(const uint8_t *a, const uint8_t *b)
{
    int num = 0;
    for (int i = 0; i < NUM_PIXELS; i++)
        num += memcmp(a + 4 * i, b + 4 * i, 4) != 0;
    return num;
}

static void draw(karst_view view)
{
    assert_ok(karst_engine_set_view(engine, view, &error));
    assert_ok(karst_engine_frame(engine, &error));
    assert_ok(karst_engine_read_pixels(engine, painted, sizeof painted, &error));
}

static void test_every_view_is_another_picture(void **state)
{
    (void)state;
    static uint8_t before[sizeof painted];
    for (int view = KARST_VIEW_LEVEL; view < KARST_NUM_VIEWS; view++) {
        if (view == KARST_VIEW_ALBEDO || view == KARST_VIEW_OCCLUSION) { /* see test_looks */
            karst_error refused = {0};
            assert_false(karst_engine_set_view(engine, (karst_view)view, &refused));
            assert_int_equal(refused.status, KARST_USAGE);
            continue;
        }
        karst_view parsed;
        assert_ok(karst_view_parse(karst_view_name((karst_view)view), &parsed, &error));
        assert_int_equal(parsed, view);
        draw((karst_view)view);
        assert_true(count_different(picture, painted) > 100);
        /* Settled, nothing was produced and nothing stands in: those two are the same grey. */
        if (view != KARST_VIEW_PROVISIONAL)
            assert_true(count_different(before, painted) > 100);
        else
            assert_int_equal(count_different(before, painted), 0);
        memcpy(before, painted, sizeof painted);
    }
    draw(KARST_VIEW_PICTURE);
    assert_int_equal(count_different(picture, painted), 0);
    assert_false(karst_engine_set_view(engine, KARST_NUM_VIEWS, NULL));
    assert_false(karst_view_parse("levels", &(karst_view){0}, NULL));
}

/* Counts pixels in which a colour outweighs the others. */
static int count_hued(int channel)
{
    int num = 0;
    for (int i = 0; i < NUM_PIXELS; i++) {
        const uint8_t *p = painted + 4 * i;
        num += p[channel] > 1.4 * p[(channel + 1) % 3] && p[channel] > 1.4 * p[(channel + 2) % 3];
    }
    return num;
}

static void test_what_is_new_is_shown_when_it_is_new(void **state)
{
    (void)state;
    karst_stats stats;
    draw(KARST_VIEW_PRODUCED);
    assert_int_equal(count_hued(1), 0);
    /* Nearer: finer bricks are wanted, made, and seen one frame later. */
    karst_camera camera = karst_engine_camera(engine), home = camera;
    double right[3], up[3], forward[3], way_m[3];
    karst_camera_axes(&camera, right, up, forward);
    for (int axis = 0; axis < 3; axis++)
        way_m[axis] = forward[axis] * 0.5 * depth_m[NUM_PIXELS / 2 + WIDTH / 2];
    camera.position = karst_position_add_m(camera.position, way_m, karst_engine_voxel_log2_m(engine));
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    int num_new = 0, num_frames = 0;
    do {
        draw(KARST_VIEW_PRODUCED);
        num_new += count_hued(1);
        karst_engine_stats(engine, &stats);
    } while (!stats.settled && ++num_frames < 300);
    assert_true(num_new > 500);
    draw(KARST_VIEW_PRODUCED);
    assert_int_equal(count_hued(1), 0);
    assert_ok(karst_engine_set_camera(engine, &home, &error));
    assert_ok(karst_engine_set_view(engine, KARST_VIEW_PICTURE, &error));
    settle();
}

static void test_fewer_pixels_and_back(void **state)
{
    (void)state;
    karst_error refused = {0};
    assert_ok(karst_engine_set_drawn_size(engine, WIDTH / 2, HEIGHT / 2, &error));
    assert_ok(karst_engine_frame(engine, &error));
    karst_stats stats;
    karst_engine_stats(engine, &stats);
    assert_int_equal(stats.num_pixels, NUM_PIXELS / 4);
    assert_false(karst_engine_read_pixels(engine, painted, sizeof painted, NULL));
    assert_ok(karst_engine_read_pixels(engine, painted, sizeof painted / 4, &error));
    assert_false(karst_engine_set_drawn_size(engine, WIDTH, HEIGHT + 1, &refused));
    assert_int_equal(refused.status, KARST_USAGE);
    assert_ok(karst_engine_set_drawn_size(engine, WIDTH, HEIGHT, &error));
    settle();
    assert_ok(karst_engine_read_pixels(engine, painted, sizeof painted, &error));
    assert_int_equal(count_different(picture, painted), 0);
}

static void test_budget_has_its_range(void **state)
{
    (void)state;
    karst_error refused = {0};
    assert_ok(karst_engine_set_budget_ms(engine, 3, &error));
    assert_false(karst_engine_set_budget_ms(engine, -1, &refused));
    assert_int_equal(refused.status, KARST_USAGE);
    assert_false(karst_engine_set_budget_ms(engine, NAN, NULL));
    assert_ok(karst_engine_set_budget_ms(engine, 0, &error));
    assert_ok(karst_engine_show(engine, &error)); /* without a window, nothing */
}

typedef struct {
    unsigned num_asked, most;
} patience;

static bool waits(void *user)
{
    patience *p = user;
    return ++p->num_asked <= p->most;
}

/* Zooms in, and says how much the first frame of the new view made. */
static uint64_t make_of_new_view(double fov_deg, patience *p)
{
    karst_camera camera = karst_engine_default_camera(engine);
    camera.fov_deg = fov_deg;
    karst_stats stats;
    karst_engine_set_patience(engine, p ? waits : NULL, p);
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    return stats.num_produced;
}

/* Who asks for an end gets it after a round; the picture in the end is the same. */
static void test_impatience_ends_a_frame(void **state)
{
    (void)state;
    patience none = {.most = 0}, much = {.most = 1000};
    uint64_t hurried = make_of_new_view(20, &none), patient = make_of_new_view(5, &much);
    assert_true(hurried > 0);
    assert_int_equal(none.num_asked, 2); /* before the first round, which is made in any case, and behind it */
    assert_true(much.num_asked > 1);
    assert_true(patient > hurried);
    karst_engine_find_memory(engine, (uint64_t)1 << 40); /* all there is */
    karst_camera camera = karst_engine_default_camera(engine);
    karst_engine_set_patience(engine, NULL, NULL);
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
    settle();
    assert_ok(karst_engine_read_pixels(engine, painted, sizeof painted, &error));
    assert_memory_equal(painted, picture, sizeof picture);
}

/* A view that stands, with time enough: what its picture lacks is all made before it is drawn once more, though scouts
 * see one pixel of 49 only. */
static void test_a_second_picture_is_whole(void **state)
{
    (void)state;
    patience much = {.most = UINT_MAX};
    karst_stats stats;
    karst_camera camera = karst_engine_default_camera(engine);
    assert_ok(karst_engine_set_budget_ms(engine, 60000, &error));
    karst_engine_pretend_cost(engine, 1000, 1000); /* or a slow machine might not come to an end */
    karst_engine_set_patience(engine, waits, &much);
    uint64_t num_provisional = 0;
    for (int look = 0; look < 4; look++) {
        camera.yaw_deg += 7;
        camera.fov_deg = 3 + look;
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_frame(engine, &error));
        for (int frame = 0; frame < 3; frame++) { /* who stands, stands for more than one */
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            num_provisional += frame ? stats.num_provisional : 0;
        }
    }
    assert_int_equal(num_provisional, 0);
    karst_engine_set_patience(engine, NULL, NULL);
    assert_ok(karst_engine_set_budget_ms(engine, 0, &error));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_probe_and_depth_agree),
        cmocka_unit_test(test_normals_are_unit_vectors_towards_the_eye),
        cmocka_unit_test(test_every_view_is_another_picture),
        cmocka_unit_test(test_what_is_new_is_shown_when_it_is_new),
        cmocka_unit_test(test_fewer_pixels_and_back),
        cmocka_unit_test(test_budget_has_its_range),
        cmocka_unit_test(test_impatience_ends_a_frame),
        cmocka_unit_test(test_a_second_picture_is_whole),
    };
    return cmocka_run_group_tests(tests, open_engine, close_engine);
}
