/* Hard cases: an engine's settled picture against the reference's, pixel by pixel.
 *
 * A case is a scene, a camera and how far the two may be apart. Where a limit of the engine is reached the case says
 * which, and checks what the engine then promises; none is left out silently. */
#ifndef KARST_TESTS_HARD_H
#define KARST_TESTS_HARD_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "karst/karst.h"

#define HARD_MAX_PIXELS (96 * 72)

typedef struct {
    const char *name;
    const char *scene;       /* expression of the density, with p */
    const char *header;      /* further entries of the world's header, each ended by a comma */
    const char *camera;      /* as --camera takes it */
    int width_px, height_px; /* 0: 48 x 36 */
    double view_m;           /* 0: 2000 */
    double voxel_m;          /* 0: 0.0625 */
    double detail_px;        /* 0: 1 */
    double within;           /* footprints that depths may be apart; 0: 1 */
    int num_silhouette;      /* pixels that may miss or hit by themselves at silhouettes; elsewhere none may */
    int least_hits;          /* of the reference: the case shows what it is about */
    const char *limit;       /* what cannot be had, as the documentation has it; depths and hits are not compared */
} hard_case;

typedef struct {
    int num_hits, num_apart, num_silhouette, num_elsewhere;
    double worst; /* footprints, where both hit and neighbours are near */
    karst_stats stats;
} hard_result;

static karst_reference_hit hard_expected[HARD_MAX_PIXELS];
static float hard_depth_m[HARD_MAX_PIXELS];
static char hard_path[64];

static inline void hard_write_world(const hard_case *c)
{
    snprintf(hard_path, sizeof hard_path, "/tmp/karst-hard-%d.karst", (int)getpid());
    FILE *file = fopen(hard_path, "w");
    assert_non_null(file);
    fprintf(file, "/*{ %s \"voxel\": %.17g, \"view\": %.17g }*/\nfloat density(vec3 p) { %s }\n",
            c->header ? c->header : "", c->voxel_m > 0 ? c->voxel_m : 0.0625, c->view_m > 0 ? c->view_m : 2000.0,
            c->scene);
    assert_int_equal(fclose(file), 0);
}

static inline int hard_width(const hard_case *c) { return c->width_px ? c->width_px : 48; }
static inline int hard_height(const hard_case *c) { return c->height_px ? c->height_px : 36; }

/* A pixel at an edge of the picture's depths: a neighbour hits where another misses, or lies more than 16 footprints
 * before or behind. */
static inline bool hard_is_silhouette(const hard_case *c, int x, int y)
{
    const int width = hard_width(c), height = hard_height(c);
    double near = INFINITY, far = 0;
    for (int v = y - 1; v <= y + 1; v++)
        for (int u = x - 1; u <= x + 1; u++) {
            if (u < 0 || v < 0 || u >= width || v >= height)
                continue;
            const karst_reference_hit *hit = &hard_expected[v * width + u];
            near = fmin(near, hit->t_m);
            far = fmax(far, hit->t_m);
        }
    return isinf(far) != isinf(near) || (isfinite(far) && far - near > 16 * hard_expected[y * width + x].footprint_m);
}

static inline void hard_compare(const hard_case *c, int lanes, hard_result *result)
{
    const int width = hard_width(c), height = hard_height(c);
    const double within = c->within > 0 ? c->within : 1;
    for (int i = 0; i < width * height; i++) {
        const karst_reference_hit *hit = &hard_expected[i];
        bool expected = isfinite(hit->t_m), found = isfinite(hard_depth_m[i]);
        result->num_hits += expected;
        bool apart = expected != found;
        if (expected && found) {
            double error = fabs((double)hard_depth_m[i] - hit->t_m) / fmax(hit->footprint_m, 1e-300);
            if (hit->kind == KARST_REFERENCE_INSIDE && hit->t_m == 0)
                error = hard_depth_m[i] == 0 ? 0 : error;
            apart = error > within;
            if (!apart)
                result->worst = fmax(result->worst, error);
        }
        if (!apart)
            continue;
        result->num_apart++;
        if (hard_is_silhouette(c, i % width, i / width)) {
            result->num_silhouette++;
            continue;
        }
        if (!result->num_elsewhere++)
            print_message(
                "  %s, %d lanes: pixel %d, %d: %.9g m, the reference has %.9g m (kind %d, footprint %.3g m)\n", c->name,
                lanes, i % width, i / width, (double)hard_depth_m[i], hit->t_m, (int)hit->kind, hit->footprint_m);
    }
}

/* The settled picture of one engine. */
static inline void hard_draw(const hard_case *c, int lanes, const karst_camera *camera, karst_stats *stats)
{
    karst_error error = {0};
    bool settled = false;
    const karst_engine_config config = {.world = hard_path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = hard_width(c),
                                        .height_px = hard_height(c),
                                        .pool_bytes = (uint64_t)96 << 20,
                                        .detail_px = c->detail_px,
                                        .no_shadows = true,
                                        .lanes = lanes};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_set_camera(engine, camera, &error) ||
        !karst_engine_settle(engine, 400, NULL, NULL, &settled, &error) ||
        !karst_engine_read_depth(engine, hard_depth_m, (size_t)(config.width_px * config.height_px), &error) ||
        !karst_engine_check(engine, &error))
        fail_msg("%s, %d lanes: %s", c->name, lanes, error.message);
    karst_engine_stats(engine, stats);
    karst_engine_destroy(engine);
    if (!settled)
        fail_msg("%s, %d lanes: not settled", c->name, lanes);
    if (stats->detail_given_px > stats->detail_asked_px * 1.001)
        fail_msg("%s, %d lanes: given %g pixels a voxel instead of %g", c->name, lanes, stats->detail_given_px,
                 stats->detail_asked_px);
}

/* Runs a case at 1 and 16 lanes. */
static inline void hard_run(const hard_case *c)
{
    karst_error error = {0};
    assert_true(hard_width(c) * hard_height(c) <= HARD_MAX_PIXELS);
    hard_write_world(c);
    int voxel_log2_m = (int)rint(log2(c->voxel_m > 0 ? c->voxel_m : 0.0625));
    karst_camera camera = {.fov_deg = 60};
    if (!karst_camera_parse(c->camera, voxel_log2_m, &camera, &error))
        fail_msg("%s: %s", c->name, error.message);
    const karst_reference_config reference = {.world = hard_path,
                                              .camera = &camera,
                                              .width_px = hard_width(c),
                                              .height_px = hard_height(c),
                                              .detail_px = c->detail_px,
                                              .footprint = KARST_FOOTPRINT_BLENDED,
                                              .max_intervals = 20000};
    karst_reference_stats stats = {0};
    if (!karst_reference_trace(&reference, hard_expected, NULL, NULL, &stats, &error))
        fail_msg("%s: %s", c->name, error.message);
    float first_m[HARD_MAX_PIXELS];
    /* One lane takes a program of its own, which drivers compile for seconds: every second case, or all in full. A
     * sanitizer looks at the host, which is the same with 1 and with 16. */
    static int num_runs;
    const bool both = num_runs++ % 2 == 0 || getenv("KARST_TEST_FULL");
    const int first_lanes = both && !getenv("KARST_TEST_QUICK") ? 1 : 16;
    for (int lanes = first_lanes; lanes <= 16; lanes += 15) {
        hard_result result = {0};
        hard_draw(c, lanes, &camera, &result.stats);
        if (c->limit) {
            print_message("%s, %d lanes: LIMIT: %s\n", c->name, lanes, c->limit);
        } else {
            if (stats.num_unresolved)
                fail_msg("%s: the reference gave up %lu rays", c->name, (unsigned long)stats.num_unresolved);
            hard_compare(c, lanes, &result);
            print_message("%s, %d lanes: %d hits, worst %.3g footprints; apart: %d at silhouettes, %d elsewhere\n",
                          c->name, lanes, result.num_hits, result.worst, result.num_silhouette, result.num_elsewhere);
            if (result.num_hits < c->least_hits || result.num_elsewhere || result.num_silhouette > c->num_silhouette)
                fail_msg("%s, %d lanes: %d hits (at least %d), apart: %d at silhouettes (at most %d), %d elsewhere",
                         c->name, lanes, result.num_hits, c->least_hits, result.num_silhouette, c->num_silhouette,
                         result.num_elsewhere);
        }
        size_t bytes = (size_t)(hard_width(c) * hard_height(c)) * sizeof *first_m;
        if (lanes == first_lanes)
            memcpy(first_m, hard_depth_m, bytes);
        else if (memcmp(first_m, hard_depth_m, bytes) != 0)
            fail_msg("%s: 1 and 16 lanes differ", c->name);
    }
    unlink(hard_path);
}

#endif
