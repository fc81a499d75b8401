/* The paths that Karst ships: they load, keep to the ground that they follow, and never lead into it.
 *
 * KARST_WRITE_PATHS=demos/paths writes those that follow the ground of hills instead, after a change of that world. */
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

#define HILLS_VOXEL_LOG2_M (-4)
#define SKY_M 3000.0 /* above all of hills */

static karst_path *load(const char *name)
{
    char file[64];
    snprintf(file, sizeof file, "demos/paths/%s.json", name);
    karst_error error = {0};
    karst_path *path = karst_path_load(file, HILLS_VOXEL_LOG2_M, &error);
    if (!path)
        fail_msg("%s", error.message);
    return path;
}

/* ---- heights: one ray, straight down ---- */

static karst_engine *open_hills(void)
{
    karst_engine_config config = {.world = "hills",
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = 1,
                                  .height_px = 1,
                                  .no_shadows = true,
                                  .pool_bytes = (uint64_t)1 << 26};
    karst_error error = {0};
    karst_engine *hills = karst_engine_create(&config, &error);
    if (!hills)
        fail_msg("%s", error.message);
    assert_int_equal(karst_engine_voxel_log2_m(hills), HILLS_VOXEL_LOG2_M);
    return hills;
}

/* The highest ground below (or above) a place. */
static double ground_m(karst_engine *hills, karst_position place)
{
    karst_camera camera = {.position = place, .pitch_deg = -90, .fov_deg = 0.0005};
    camera.position.voxel[1] = (int64_t)ldexp(SKY_M, -HILLS_VOXEL_LOG2_M);
    camera.position.fraction[1] = 0;
    bool settled = false;
    float depth_m = 0;
    karst_error error = {0};
    if (!karst_engine_set_camera(hills, &camera, &error) ||
        !karst_engine_settle(hills, 200, NULL, NULL, &settled, &error) ||
        !karst_engine_read_depth(hills, &depth_m, 1, &error))
        fail_msg("%s", error.message);
    assert_true(settled && isfinite(depth_m));
    return SKY_M - depth_m;
}

static double coordinate_m(karst_position place, int axis)
{
    return ldexp((double)place.voxel[axis] + place.fraction[axis] * 0x1p-32, HILLS_VOXEL_LOG2_M);
}

static double height_m(karst_position place) { return coordinate_m(place, 1); }

/* ---- writing ---- */

typedef struct {
    const char *name, *description;
    double x_m, z_m, yaw_deg, speed_m_s, length_s, above_m, key_s, look_step_m, pitch_deg, sway_deg;
    double most_climb; /* metres in a metre over the ground, begun ahead of a cliff; 0: as the ground has it */
} follower;

static const follower followers[] = {
    {.name = "low-flight",
     .description =
         "30 s at 30 m/s along the track, 20 m above the highest ground within 15 m, climbing at 40 degrees at most",
     .x_m = 0,
     .z_m = 0,
     .yaw_deg = 30,
     .speed_m_s = 30,
     .length_s = 30,
     .above_m = 20,
     .key_s = 0.5,
     .look_step_m = 5,
     .pitch_deg = -6,
     .most_climb = 0.84},
    {.name = "walk",
     .description = "30 s at 1.4 m/s, eyes 1.7 m above the ground, looking about",
     .x_m = 0,
     .z_m = 0,
     .yaw_deg = 30,
     .speed_m_s = 1.4,
     .length_s = 30,
     .above_m = 1.7,
     .key_s = 0.5,
     .look_step_m = 0.175,
     .pitch_deg = -4,
     .sway_deg = 25},
};
#define NUM_FOLLOWERS (sizeof followers / sizeof *followers)

static karst_position along(const follower *f, double way_m)
{
    karst_position start = {{0}, {0}};
    double yaw = f->yaw_deg * 0.017453292519943295;
    return karst_position_add_m(start, (double[3]){f->x_m + sin(yaw) * way_m, 0, f->z_m + cos(yaw) * way_m},
                                HILLS_VOXEL_LOG2_M);
}

#define MOST_STEPS 1024

/* Heights of the track at each look_step_m of its way, from 0 on: above the highest ground as far as a keyframe's
 * neighbours, so that a smooth path between keyframes, which overshoots neither, keeps above all of it. */
static int track_heights(karst_engine *hills, const follower *f, double *height_m)
{
    static double ground[MOST_STEPS];
    double spacing_m = f->key_s * f->speed_m_s;
    int beside = (int)lround(spacing_m / f->look_step_m),
        ahead = (int)lround(100 / f->look_step_m * (f->most_climb > 0));
    int num = (int)lround(f->length_s * f->speed_m_s / f->look_step_m) + 1 + ahead, total = num + 2 * beside;
    assert_true(total <= MOST_STEPS);
    for (int i = 0; i < total; i++)
        ground[i] = ground_m(hills, along(f, (i - beside) * f->look_step_m));
    for (int i = 0; i < num; i++) {
        height_m[i] = -INFINITY;
        for (int k = 0; k <= 2 * beside; k++)
            height_m[i] = fmax(height_m[i], ground[i + k] + f->above_m);
    }
    double most_m = f->most_climb > 0 ? f->most_climb * f->look_step_m : INFINITY;
    for (int i = 1; i < num; i++)
        height_m[i] = fmax(height_m[i], height_m[i - 1] - most_m);
    for (int i = num - 2; i >= 0; i--)
        height_m[i] = fmax(height_m[i], height_m[i + 1] - most_m);
    return num;
}

static void write_follower(karst_engine *hills, const follower *f, const char *folder)
{
    char file[256];
    snprintf(file, sizeof file, "%s/%s.json", folder, f->name);
    FILE *out = fopen(file, "w");
    assert_non_null(out);
    fprintf(out, "{\n  \"description\": \"%s\",\n  \"world\": \"hills\",\n  \"keyframes\": [\n", f->description);
    static double height[MOST_STEPS];
    int num_keys = (int)(f->length_s / f->key_s) + 1, num = track_heights(hills, f, height), step = 0;
    double spacing_m = f->key_s * f->speed_m_s, left_m = 0; /* flown beyond the step */
    for (int key = 0; key < num_keys; key++) {
        double length_m = 0;
        for (left_m += key ? spacing_m : 0; step + 1 < num; left_m -= length_m, step++) {
            length_m = f->most_climb > 0 ? hypot(f->look_step_m, height[step + 1] - height[step]) : f->look_step_m;
            if (left_m < length_m * (1 - 1e-9))
                break;
        }
        assert_true(step + 1 < num || left_m < 1e-6);
        double part = step + 1 < num ? left_m / length_m : 0;
        double y_m = height[step] + (part > 0 ? part * (height[step + 1] - height[step]) : 0);
        karst_position place = along(f, (step + part) * f->look_step_m);
        double sway = sin(key * f->key_s * 0.42);
        fprintf(out,
                "    {\"time\": %g, \"position\": [\"%.3f\", \"%.2f\", \"%.3f\"], \"yaw\": %.1f, \"pitch\": %g%s}%s\n",
                key * f->key_s, coordinate_m(place, 0), y_m, coordinate_m(place, 2), f->yaw_deg + sway * f->sway_deg,
                f->pitch_deg, key ? "" : ", \"fov\": 65", key + 1 < num_keys ? "," : "");
    }
    fprintf(out, "  ]\n}\n");
    assert_int_equal(fclose(out), 0);
    print_message("%s is written\n", file);
}

/* Nearly straight down, then along the slope; in steps that are even in the logarithm. */
static void write_dive(karst_engine *hills, const char *folder)
{
    static const struct {
        double time_s, distance_m, elevation_deg, azimuth_deg;
    } keys[] = {{0, 1e7, 86, 150},  {4, 1e6, 86, 165}, {8, 1e5, 85, 180}, {12, 1e4, 82, 195}, {16, 1e3, 76, 210},
                {20, 100, 66, 220}, {24, 10, 52, 230}, {28, 1, 42, 235},  {30, 0.3, 40, 237}};
    const size_t num_keys = sizeof keys / sizeof *keys;
    const double degree = 0.017453292519943295, x_m = 150, z_m = 259.75;
    karst_position target =
        karst_position_add_m((karst_position){{0}, {0}}, (double[3]){x_m, 0, z_m}, HILLS_VOXEL_LOG2_M);
    double y_m = ground_m(hills, target);
    char file[256];
    snprintf(file, sizeof file, "%s/dive.json", folder);
    FILE *out = fopen(file, "w");
    assert_non_null(out);
    fprintf(
        out,
        "{\n  \"description\": \"from 10^7 m to a pebble; with --view-distance 3e7 the ground shows from the start\",\n"
        "  \"world\": \"hills\",\n  \"interpolation\": \"zoom\",\n"
        "  \"target\": [\"%g\", \"%.3f\", \"%g\"],\n  \"keyframes\": [\n",
        x_m, y_m, z_m);
    for (size_t i = 0; i < num_keys; i++) {
        double across_m = keys[i].distance_m * cos(keys[i].elevation_deg * degree);
        fprintf(out, "    {\"time\": %g, \"position\": [\"%.3f\", \"%.3f\", \"%.3f\"]}%s\n", keys[i].time_s,
                x_m + across_m * sin(keys[i].azimuth_deg * degree),
                y_m + keys[i].distance_m * sin(keys[i].elevation_deg * degree),
                z_m + across_m * cos(keys[i].azimuth_deg * degree), i + 1 < num_keys ? "," : "");
    }
    fprintf(out, "  ]\n}\n");
    assert_int_equal(fclose(out), 0);
    print_message("%s is written\n", file);
}

/* ---- checking ---- */

/* Samples the path between two times; returns the least height above ground, and the greatest in *most_m. */
static double least_clearance_m(karst_engine *hills, const karst_path *path, double from_s, double to_s, int num,
                                double *most_m)
{
    double least_m = INFINITY;
    *most_m = -INFINITY;
    for (int i = 0; i <= num; i++) {
        karst_camera camera = karst_path_sample(path, from_s + (to_s - from_s) * i / num);
        double clearance_m = height_m(camera.position) - ground_m(hills, camera.position);
        least_m = fmin(least_m, clearance_m);
        *most_m = fmax(*most_m, clearance_m);
    }
    return least_m;
}

/* Along the track, or over the ground. */
static double speed_m_s(const karst_path *path, double time_s, bool along_track)
{
    double d[3];
    karst_position_difference_m(karst_path_sample(path, time_s - 0.01).position,
                                karst_path_sample(path, time_s + 0.01).position, HILLS_VOXEL_LOG2_M, d);
    return sqrt(d[0] * d[0] + d[2] * d[2] + (along_track ? d[1] * d[1] : 0)) / 0.02;
}

static void test_followers_keep_to_the_ground(void **state)
{
    karst_engine *hills = *state;
    for (size_t i = 0; i < NUM_FOLLOWERS; i++) {
        const follower *f = &followers[i];
        karst_path *path = load(f->name);
        assert_true(karst_path_start_s(path) == 0 && karst_path_end_s(path) == f->length_s);
        double most_m, least_m = least_clearance_m(hills, path, 0, f->length_s, 97, &most_m);
        print_message("%s: %.2f to %.2f m above the ground\n", f->name, least_m, most_m);
        /* Looked for at steps: a step's worth of ground may lie between. */
        assert_true(least_m > 0.8 * f->above_m);
        for (double time_s = 0.5; time_s < f->length_s; time_s += 0.37)
            assert_true(fabs(speed_m_s(path, time_s, f->most_climb > 0) - f->speed_m_s) < 0.2 * f->speed_m_s);
        karst_path_destroy(path);
    }
}

static void test_dive_goes_from_space_to_a_pebble(void **state)
{
    karst_engine *hills = *state;
    karst_path *path = load("dive");
    double end_s = karst_path_end_s(path), most_m;
    karst_position last = karst_path_sample(path, end_s).position;
    assert_true(height_m(karst_path_sample(path, 0).position) > 9e6);
    /* The last seconds, where there is ground to run into. */
    double least_m = least_clearance_m(hills, path, 0.55 * end_s, end_s, 60, &most_m);
    double end_m = height_m(last) - ground_m(hills, last);
    print_message("dive: from %.0f m above the ground to %.2f m, never below %.2f m\n", most_m, end_m, least_m);
    assert_true(end_m < 1 && least_m > 0.05);
    karst_path_destroy(path);
}

static void test_orbit_keeps_its_distance(void **state)
{
    (void)state;
    karst_path *path = load("orbit");
    karst_position centre = {{0}, {0}};
    double first_m = 0;
    for (int i = 0; i <= 100; i++) {
        double d[3];
        karst_position_difference_m(centre, karst_path_sample(path, karst_path_end_s(path) * i / 100).position,
                                    HILLS_VOXEL_LOG2_M, d);
        double distance_m = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        if (i == 0)
            first_m = distance_m;
        assert_true(fabs(distance_m - first_m) < 0.01 * first_m);
    }
    karst_camera first = karst_path_sample(path, 0), last = karst_path_sample(path, karst_path_end_s(path));
    assert_memory_equal(&first.position, &last.position, sizeof first.position);
    karst_path_destroy(path);
}

static void test_jump_jumps_far(void **state)
{
    karst_engine *hills = *state;
    karst_path *path = load("jump");
    int num_jumps = 0;
    for (double time_s = 1.0 / 30; time_s <= karst_path_end_s(path); time_s += 1.0 / 30) {
        double d[3];
        karst_position_difference_m(karst_path_sample(path, time_s - 1.0 / 30).position,
                                    karst_path_sample(path, time_s).position, HILLS_VOXEL_LOG2_M, d);
        num_jumps += fabs(d[0]) + fabs(d[2]) > 1e4;
    }
    assert_true(num_jumps >= 3);
    double most_m, least_m = least_clearance_m(hills, path, 0, karst_path_end_s(path), 40, &most_m);
    print_message("jump: %d jumps, %.0f to %.0f m above the ground\n", num_jumps, least_m, most_m);
    assert_true(least_m > 20 && most_m < 1500);
    karst_path_destroy(path);
}

static int open_world(void **state)
{
    *state = open_hills();
    return 0;
}

static int close_world(void **state)
{
    karst_engine_destroy(*state);
    return 0;
}

int main(void)
{
    const char *folder = getenv("KARST_WRITE_PATHS");
    if (folder) {
        karst_engine *hills = open_hills();
        for (size_t i = 0; i < NUM_FOLLOWERS; i++)
            write_follower(hills, &followers[i], folder);
        write_dive(hills, folder);
        karst_engine_destroy(hills);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_followers_keep_to_the_ground),
        cmocka_unit_test(test_dive_goes_from_space_to_a_pebble),
        cmocka_unit_test(test_orbit_keeps_its_distance),
        cmocka_unit_test(test_jump_jumps_far),
    };
    return cmocka_run_group_tests_name("paths", tests, open_world, close_world);
}
