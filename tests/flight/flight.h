/* What the flight tests share. */
#ifndef KARST_TESTS_FLIGHT_H
#define KARST_TESTS_FLIGHT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/ok.h"

#define FLIGHT_WIDTH 96
#define FLIGHT_HEIGHT 72
#define FLIGHT_PIXELS (FLIGHT_WIDTH * FLIGHT_HEIGHT)

typedef struct {
    uint8_t rgba[FLIGHT_PIXELS * 4];
    float depth_m[FLIGHT_PIXELS];
    karst_stats stats;
} flight_picture;

static inline karst_engine_config flight_config(const char *world)
{
    return (karst_engine_config){.world = world,
                                 .display = KARST_DISPLAY_NONE,
                                 .width_px = FLIGHT_WIDTH,
                                 .height_px = FLIGHT_HEIGHT,
                                 .pool_bytes = (uint64_t)128 << 20};
}

static inline karst_engine *flight_engine(const karst_engine_config *config)
{
    karst_error error = {0};
    karst_engine *engine = karst_engine_create(config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static inline void flight_read(karst_engine *engine, flight_picture *picture)
{
    karst_engine_stats(engine, &picture->stats);
    assert_ok(karst_engine_read_pixels(engine, picture->rgba, sizeof picture->rgba, &error));
    assert_ok(karst_engine_read_depth(engine, picture->depth_m, FLIGHT_PIXELS, &error));
}

/* The settled picture of a camera (NULL: where it is). */
static inline void flight_settle(karst_engine *engine, const karst_camera *camera, flight_picture *picture)
{
    bool settled = false;
    if (camera)
        assert_ok(karst_engine_set_camera(engine, camera, &error));
    assert_ok(karst_engine_settle(engine, 300, NULL, NULL, &settled, &error));
    flight_read(engine, picture);
    if (!settled)
        fail_msg("not settled after frame %u: %llu requests, %llu produced, %llu deferred", picture->stats.frame,
                 (unsigned long long)picture->stats.num_requests, (unsigned long long)picture->stats.num_produced,
                 (unsigned long long)picture->stats.num_deferred);
    assert_ok(karst_engine_check(engine, &error));
}

/* The same from an engine of its own that has seen nothing else. */
static inline void flight_fresh(const karst_engine_config *config, const karst_camera *camera, flight_picture *picture)
{
    karst_engine *engine = flight_engine(config);
    flight_settle(engine, camera, picture);
    karst_engine_destroy(engine);
}

static inline void assert_same_picture(const flight_picture *a, const flight_picture *b)
{
    if (a->stats.detail_given_px != b->stats.detail_given_px)
        fail_msg("voxels of %g px in the one, %g px in the other", a->stats.detail_given_px, b->stats.detail_given_px);
    int num_pixels = 0, num_depths = 0, first = -1;
    for (int i = 0; i < FLIGHT_PIXELS; i++) {
        bool differs = memcmp(a->rgba + 4 * i, b->rgba + 4 * i, 4) != 0, deeper = a->depth_m[i] != b->depth_m[i];
        num_pixels += differs;
        num_depths += deeper;
        if ((differs || deeper) && first < 0)
            first = i;
    }
    if (first >= 0)
        fail_msg("%d pixels and %d depths differ, the first at (%d, %d): %.9g and %.9g m", num_pixels, num_depths,
                 first % FLIGHT_WIDTH, first / FLIGHT_WIDTH, (double)a->depth_m[first], (double)b->depth_m[first]);
}

static inline karst_camera flight_camera(const karst_engine *engine, const char *text)
{
    karst_camera camera = {.fov_deg = 60};
    assert_ok(karst_camera_parse(text, karst_engine_voxel_log2_m(engine), &camera, &error));
    return camera;
}

/* A path that comes with Karst; for karst_path_destroy. */
static inline karst_path *flight_path(const karst_engine *engine, const char *file)
{
    karst_error error = {0};
    karst_path *path = karst_path_load(file, karst_engine_voxel_log2_m(engine), &error);
    if (!path)
        fail_msg("%s", error.message);
    return path;
}

#endif
