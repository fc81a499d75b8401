/* What a flight shows, held against the world itself: rays traced on the host without bricks, and the density at what
 * pixels show. */
#include "tests/flight/flight.h"

#include <math.h>
#include <stdio.h>

#include "core/engine/engine_internal.h"
#include "karst/reference.h"
#include "karst/view.h"
#include "karst/world.h"

#define VIEW_M 3e7
#define SMALL_WIDTH 32
#define SMALL_HEIGHT 24
#define SMALL_PIXELS (SMALL_WIDTH * SMALL_HEIGHT)

static bool is_full(void)
{
    const char *full = getenv("KARST_TEST_FULL");
    return full && *full && *full != '0';
}

/* The voxel of the level that a ray is shown at after t_m. */
static double voxel_at_m(double t_m, double cone, int voxel_log2_m)
{
    return fmax(exp2(floor(log2(t_m * cone))), exp2(voxel_log2_m));
}

/* Down the dive, settled: each pixel has the depth that the world has there, or one of its neighbours (at an edge a
 * voxel more or less decides), but for two voxels along the surface. */
static void test_settled_pictures_of_the_dive_are_the_world(void **state)
{
    (void)state;
    static float depth_m[SMALL_PIXELS];
    static karst_reference_hit hits[SMALL_PIXELS];
    karst_engine_config config = flight_config("hills");
    config.view_distance_m = VIEW_M;
    config.width_px = SMALL_WIDTH;
    config.height_px = SMALL_HEIGHT;
    config.no_shadows = true;
    karst_engine *engine = flight_engine(&config);
    int voxel_log2_m = karst_engine_voxel_log2_m(engine);
    karst_path *path = flight_path(engine, "demos/paths/dive.json");
    int num_pixels = 0, num_wrong = 0;
    for (double time_s = 0; time_s <= karst_path_end_s(path); time_s += is_full() ? 1 : 5) {
        karst_camera camera = karst_path_sample(path, time_s);
        bool settled = false;
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_settle(engine, 300, NULL, NULL, &settled, &error));
        assert_true(settled);
        assert_ok(karst_engine_read_depth(engine, depth_m, SMALL_PIXELS, &error));
        karst_reference_config reference = {.world = "demos/worlds/hills.karst",
                                            .camera = &camera,
                                            .width_px = SMALL_WIDTH,
                                            .height_px = SMALL_HEIGHT,
                                            .view_distance_m = VIEW_M,
                                            .footprint = KARST_FOOTPRINT_LEVELS};
        assert_ok(karst_reference_trace(&reference, hits, NULL, NULL, NULL, &error));
        double cone = 2 * tan(camera.fov_deg * 0.008726646259971648) / SMALL_HEIGHT;
        int num_here = 0;
        for (int y = 1; y < SMALL_HEIGHT - 1; y++)
            for (int x = 1; x < SMALL_WIDTH - 1; x++) {
                double least_m = INFINITY, most_m = 0;
                for (int i = 0; i < 9; i++) {
                    const karst_reference_hit *hit = &hits[(y + i / 3 - 1) * SMALL_WIDTH + x + i % 3 - 1];
                    least_m = fmin(least_m, hit->t_m);
                    most_m = fmax(most_m, hit->t_m);
                }
                double shown_m = depth_m[y * SMALL_WIDTH + x];
                double room_m = isfinite(least_m) ? 2 * voxel_at_m(least_m, cone, voxel_log2_m) : 0;
                /* Sky in the midst of ground is a hole, and never right. */
                if (isfinite(most_m) && !isfinite(shown_m))
                    fail_msg("after %g s, pixel (%d, %d): sky, where the world is %g m away", time_s, x, y, most_m);
                num_here += shown_m < least_m - room_m || shown_m > most_m + room_m;
                num_pixels++;
            }
        if (num_here > 0)
            print_message("after %g s: %d pixels are elsewhere\n", time_s, num_here);
        num_wrong += num_here;
    }
    print_message("%d of %d pixels are elsewhere than in the world\n", num_wrong, num_pixels);
    assert_true(num_wrong * 200 <= num_pixels);
    karst_path_destroy(path);
    karst_engine_destroy(engine);
}

/* The unit direction of a pixel's ray. */
static void direction_of(const karst_camera *camera, int x_px, int y_px, double direction[3])
{
    double right[3], up[3], forward[3], half_height = tan(camera->fov_deg * 0.008726646259971648);
    karst_camera_axes(camera, right, up, forward);
    double across = ((x_px + 0.5) * 2 / FLIGHT_WIDTH - 1) * half_height * FLIGHT_WIDTH / FLIGHT_HEIGHT;
    double upwards = (1 - (y_px + 0.5) * 2 / FLIGHT_HEIGHT) * half_height, sum = 0;
    for (int axis = 0; axis < 3; axis++) {
        direction[axis] = forward[axis] + across * right[axis] + upwards * up[axis];
        sum += direction[axis] * direction[axis];
    }
    for (int axis = 0; axis < 3; axis++)
        direction[axis] /= sqrt(sum);
}

/* Whether the density without detail finer than `voxel_m` is zero within so many voxels of a point: it has another
 * sign, or steps down its slope come to one. */
static bool has_surface_near(karst_sampler *sampler, const karst_position *at, double voxel_m, double num_voxels,
                             int voxel_log2_m)
{
    double here = karst_sampler_precise_density(sampler, at, voxel_m);
    for (int i = 0; i < 26; i++) {
        int n = i < 13 ? i : i + 1; /* all of 27 neighbours but the middle */
        for (double share = 0.25; share <= 1; share += 0.25) {
            double to_m[3] = {(double)(n % 3 - 1), (double)(n / 3 % 3 - 1), (double)(n / 9 - 1)};
            double size = sqrt(to_m[0] * to_m[0] + to_m[1] * to_m[1] + to_m[2] * to_m[2]);
            for (int axis = 0; axis < 3; axis++)
                to_m[axis] *= share * num_voxels * voxel_m / size;
            karst_position there = karst_position_add_m(*at, to_m, voxel_log2_m);
            if ((karst_sampler_precise_density(sampler, &there, voxel_m) > 0) != (here > 0))
                return true;
        }
    }
    return false;
}

/* The same dive faster than a small budget can follow: there is never a hole, and what is shown is the surface of some
 * level, within two of its voxels. */
static void test_a_hurried_dive_shows_coarser_levels(void **state)
{
    (void)state;
    karst_error failure = {0};
    karst_world_config world_config = {.world = "demos/worlds/hills.karst"};
    karst_world *world = karst_world_open(&world_config, &failure);
    karst_sampler *sampler = world ? karst_sampler_create(world, &failure) : NULL;
    if (!sampler)
        fail_msg("%s", failure.message);
    karst_engine_config config = flight_config("hills");
    config.view_distance_m = VIEW_M;
    config.no_shadows = true;
    config.budget_ms = 1;
    karst_engine *engine = flight_engine(&config);
    /* As much for the whole dive, in however many frames. */
    int num_frames = is_full() ? 400 : 60;
    karst_engine_pretend_cost(engine, 70e3 * num_frames / 60, 15e3 * num_frames / 60);
    int voxel_log2_m = karst_engine_voxel_log2_m(engine);
    karst_path *path = flight_path(engine, "demos/paths/dive.json");
    int num_provisional = 0, num_hits = 0, num_wrong = 0;
    uint64_t sum_hits = 0, sum_coarser = 0;
    for (int frame = 0; frame < num_frames; frame++) {
        karst_stats stats;
        karst_camera camera = karst_path_sample(path, karst_path_end_s(path) * frame / (num_frames - 1));
        assert_ok(karst_engine_set_camera(engine, &camera, &error));
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        assert_int_equal(stats.num_incomplete, 0);
        sum_hits += stats.num_hits;
        sum_coarser += stats.num_coarser;
        if (camera.pitch_deg < -70)
            assert_int_equal(stats.num_hits, FLIGHT_PIXELS);
        for (int y = 4; y < FLIGHT_HEIGHT; y += 16)
            for (int x = 4; x < FLIGHT_WIDTH; x += 16) {
                karst_probe probe;
                assert_ok(karst_engine_probe(engine, x, y, &probe, &error));
                if (!probe.hit)
                    continue;
                double direction[3], voxel_m = ldexp(1, probe.level + voxel_log2_m);
                direction_of(&camera, x, y, direction);
                for (int axis = 0; axis < 3; axis++)
                    direction[axis] *= probe.depth_m;
                karst_position at = karst_position_add_m(camera.position, direction, voxel_log2_m);
                num_hits++;
                num_provisional += probe.provisional;
                /* Neighbouring levels are blended. */
                num_wrong += !has_surface_near(sampler, &at, voxel_m, 2, voxel_log2_m) &&
                             !has_surface_near(sampler, &at, 2 * voxel_m, 2, voxel_log2_m);
            }
    }
    print_message("%d of %d hits were on a coarser level than asked for, %.0f %% of all on a coarser one than set; "
                  "%d not near the surface of theirs\n",
                  num_provisional, num_hits, 100 * (double)sum_coarser / (double)sum_hits, num_wrong);
    assert_true(num_hits > 10 * num_frames && num_provisional * 4 > num_hits);
    assert_int_equal(num_wrong, 0);
    karst_path_destroy(path);
    karst_engine_destroy(engine);
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_settled_pictures_of_the_dive_are_the_world),
        cmocka_unit_test(test_a_hurried_dive_shows_coarser_levels),
    };
    return cmocka_run_group_tests_name("oracle", tests, NULL, NULL);
}
