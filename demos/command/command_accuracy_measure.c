/* Settings drawn, and what they are off the reference. */
#include "command_accuracy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <karst/view.h>

#define SILHOUETTE_FOOTPRINTS 16.0
#define WINDOW_PX 8 /* side of the windows of the structural similarity */

/* ---- the reference ---- */

typedef struct {
    command_talk *talk;
    const char *what;
} tracing;

static bool note_share(void *user, double share)
{
    const tracing *t = user;
    command_progress(t->talk, "%s: %.0f %%", t->what, 100 * share);
    return !command_interrupted();
}

static karst_reference_config reference_config(const accuracy *a)
{
    return (karst_reference_config){.world = a->world_file,
                                    .parameters = a->parameters.values,
                                    .num_parameters = a->parameters.num_values,
                                    .has_seed = a->has_seed,
                                    .seed = (uint32_t)a->seed,
                                    .camera = a->has_camera ? &a->camera_used : NULL,
                                    .width_px = a->size_px[0],
                                    .height_px = a->size_px[1],
                                    .view_distance_m = a->view_distance_m,
                                    .footprint = KARST_FOOTPRINT_BLENDED};
}

bool accuracy_trace(accuracy *a, command_talk *talk, karst_error *error)
{
    size_t num_pixels = (size_t)a->size_px[0] * (size_t)a->size_px[1];
    size_t num_small = (size_t)a->picture_px[0] * (size_t)a->picture_px[1];
    a->expected = calloc(num_pixels, sizeof *a->expected);
    a->picture = malloc(num_small * 4);
    if (!a->expected || !a->picture)
        return karst_fail(error, KARST_FAILED, "out of memory");
    karst_reference_config config = reference_config(a);
    karst_reference_stats stats;
    tracing trace = {talk, "reference"};
    uint64_t start_ns = command_clock_ns();
    if (!karst_reference_trace(&config, a->expected, note_share, &trace, &stats, error))
        return false;
    a->reference_s = (double)(command_clock_ns() - start_ns) * 1e-9;
    a->num_unresolved = stats.num_unresolved;
    config.width_px = a->picture_px[0];
    config.height_px = a->picture_px[1];
    trace.what = "supersampled picture";
    start_ns = command_clock_ns();
    if (!karst_reference_picture(&config, ACCURACY_RAYS_PX, a->picture, note_share, &trace, &stats, error))
        return false;
    a->picture_s = (double)(command_clock_ns() - start_ns) * 1e-9;
    a->num_unresolved += stats.num_unresolved;
    command_end_progress(talk);
    return true;
}

void accuracy_free(accuracy *a)
{
    free(a->expected);
    free(a->picture);
}

/* ---- comparing ---- */

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

/* Of sorted values. */
static double percentile(const double *values, size_t count, double share)
{
    return count ? values[(size_t)(share * (double)(count - 1))] : 0;
}

/* A neighbour hits where another misses, or lies far before or behind. */
static bool is_silhouette(const accuracy *a, int x, int y)
{
    double near = INFINITY, far = 0;
    for (int v = y - 1; v <= y + 1; v++)
        for (int u = x - 1; u <= x + 1; u++) {
            if (u < 0 || v < 0 || u >= a->size_px[0] || v >= a->size_px[1])
                continue;
            double t_m = a->expected[(size_t)v * (size_t)a->size_px[0] + (size_t)u].t_m;
            near = fmin(near, t_m);
            far = fmax(far, t_m);
        }
    double footprint_m = a->expected[(size_t)y * (size_t)a->size_px[0] + (size_t)x].footprint_m;
    return isinf(far) != isinf(near) || (isfinite(far) && far - near > SILHOUETTE_FOOTPRINTS * footprint_m);
}

static double angle_deg(const double a[3], const float b[3])
{
    double cosine = 0, sine = 0;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double part = a[j] * (double)b[k] - a[k] * (double)b[j];
        cosine += a[i] * (double)b[i];
        sine += part * part;
    }
    return atan2(sqrt(sine), cosine) * 57.295779513082321;
}

static bool compare_geometry(const accuracy *a, const float *depth_m, const float *normals, accuracy_result *r,
                             karst_error *error)
{
    size_t num_pixels = (size_t)a->size_px[0] * (size_t)a->size_px[1], num_normals = 0, num_depths = 0;
    double *depths = calloc(num_pixels, sizeof *depths), *angles = calloc(num_pixels, sizeof *angles);
    if (!depths || !angles) {
        free(depths);
        free(angles);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    for (size_t i = 0; i < num_pixels; i++) {
        const karst_reference_hit *hit = &a->expected[i];
        bool expected = isfinite(hit->t_m), found = isfinite(depth_m[i]);
        if (hit->kind == KARST_REFERENCE_UNRESOLVED)
            continue;
        if (expected && found) {
            depths[num_depths++] = fabs((double)depth_m[i] - hit->t_m) / hit->footprint_m;
            if (hit->kind == KARST_REFERENCE_SURFACE)
                angles[num_normals++] = angle_deg(hit->normal, normals + 3 * i);
            continue;
        }
        r->num_missed += expected;
        r->num_false += found;
        if (expected != found && !is_silhouette(a, (int)(i % (size_t)a->size_px[0]), (int)(i / (size_t)a->size_px[0])))
            r->num_elsewhere++;
    }
    qsort(depths, num_depths, sizeof *depths, by_value);
    qsort(angles, num_normals, sizeof *angles, by_value);
    r->num_compared = num_depths;
    r->depth_median = percentile(depths, num_depths, 0.5);
    r->depth_p99 = percentile(depths, num_depths, 0.99);
    r->depth_max = percentile(depths, num_depths, 1);
    r->normal_median_deg = percentile(angles, num_normals, 0.5);
    r->normal_p99_deg = percentile(angles, num_normals, 0.99);
    free(depths);
    free(angles);
    return true;
}

static double luma(const uint8_t *rgba) { return 0.2126 * rgba[0] + 0.7152 * rgba[1] + 0.0722 * rgba[2]; }

/* Mean structural similarity of luma over all windows (Wang et al. 2004, with flat windows). */
static double similarity(const uint8_t *a, const uint8_t *b, int width_px, int height_px)
{
    const double c1 = 0.01 * 255 * 0.01 * 255, c2 = 0.03 * 255 * 0.03 * 255, n = WINDOW_PX * WINDOW_PX;
    double sum = 0;
    int count = 0;
    for (int y = 0; y + WINDOW_PX <= height_px; y++)
        for (int x = 0; x + WINDOW_PX <= width_px; x++, count++) {
            double mean_a = 0, mean_b = 0, aa = 0, bb = 0, ab = 0;
            for (int k = 0; k < WINDOW_PX * WINDOW_PX; k++) {
                size_t at = 4 * ((size_t)(y + k / WINDOW_PX) * (size_t)width_px + (size_t)(x + k % WINDOW_PX));
                double u = luma(a + at), v = luma(b + at);
                mean_a += u / n;
                mean_b += v / n;
                aa += u * u / n;
                bb += v * v / n;
                ab += u * v / n;
            }
            double variance_a = aa - mean_a * mean_a, variance_b = bb - mean_b * mean_b;
            sum += (2 * mean_a * mean_b + c1) * (2 * (ab - mean_a * mean_b) + c2) /
                   ((mean_a * mean_a + mean_b * mean_b + c1) * (variance_a + variance_b + c2));
        }
    return count ? sum / count : 1;
}

void accuracy_compare(const uint8_t *rgba, const uint8_t *truth, const int size_px[2], double *rmse, double *psnr_db,
                      double *ssim)
{
    const size_t num_pixels = (size_t)size_px[0] * (size_t)size_px[1];
    double sum = 0;
    for (size_t i = 0; i < num_pixels * 4; i++)
        if (i % 4 != 3) {
            double difference = (double)rgba[i] - (double)truth[i];
            sum += difference * difference;
        }
    *rmse = sqrt(sum / (3 * (double)num_pixels));
    *psnr_db = 20 * log10(255 / fmax(*rmse, 1e-3));
    *ssim = similarity(rgba, truth, size_px[0], size_px[1]);
}

/* ---- drawing ---- */

static bool keep_on(void *user, const karst_stats *stats)
{
    (void)user;
    (void)stats;
    return !command_interrupted();
}

static bool settle(karst_engine *engine, karst_error *error)
{
    bool settled;
    if (!karst_engine_settle(engine, 2000, keep_on, NULL, &settled, error))
        return false;
    if (command_interrupted())
        return karst_fail(error, KARST_FAILED, "interrupted");
    return settled || karst_fail(error, KARST_FAILED, "the picture did not settle in 2000 frames");
}

/* Settled frames, and the least of their times: other programs only ever lengthen one. */
static bool time_frames(const accuracy *a, karst_engine *engine, accuracy_result *r, karst_error *error)
{
    enum { CAST, REFINE, SHADE, FRAME, NUM_TIMES };
    double times_ms[NUM_TIMES][100];
    karst_stats stats;
    for (uint64_t n = 0; n < a->num_frames; n++) {
        if (!karst_engine_frame(engine, error))
            return false;
        karst_engine_stats(engine, &stats);
        times_ms[CAST][n] = (double)stats.time_ns[KARST_STAGE_CAST] * 1e-6;
        times_ms[REFINE][n] = (double)stats.time_ns[KARST_STAGE_REFINE] * 1e-6;
        times_ms[SHADE][n] = (double)stats.time_ns[KARST_STAGE_SHADE] * 1e-6;
        times_ms[FRAME][n] = (double)stats.time_ns_frame * 1e-6;
    }
    for (int k = 0; k < NUM_TIMES; k++)
        qsort(times_ms[k], (size_t)a->num_frames, sizeof **times_ms, by_value);
    r->cast_ms = times_ms[CAST][0];
    r->refine_ms = times_ms[REFINE][0];
    r->shade_ms = times_ms[SHADE][0];
    r->frame_ms = times_ms[FRAME][0];
    r->num_bricks = stats.bricks.num_used;
    r->brick_mib = stats.bricks.num_total ? (double)stats.bricks.size_bytes / (double)stats.bricks.num_total *
                                                (double)r->num_bricks / 1048576
                                          : 0;
    r->given_px = stats.detail_given_px;
    return true;
}

static bool measure_engine(accuracy *a, karst_engine *engine, accuracy_result *r, karst_error *error)
{
    size_t num_pixels = (size_t)a->size_px[0] * (size_t)a->size_px[1];
    size_t small_bytes = (size_t)a->picture_px[0] * (size_t)a->picture_px[1] * 4;
    float *depth_m = malloc(num_pixels * sizeof *depth_m), *normals = malloc(num_pixels * 3 * sizeof *normals);
    uint8_t *rgba = malloc(small_bytes);
    karst_stats stats;
    bool done = depth_m && normals && rgba
                    ? settle(engine, error) && time_frames(a, engine, r, error) &&
                          karst_engine_read_depth(engine, depth_m, num_pixels, error) &&
                          karst_engine_read_normals(engine, normals, num_pixels * 3, error) &&
                          compare_geometry(a, depth_m, normals, r, error) &&
                          karst_engine_set_size(engine, a->picture_px[0], a->picture_px[1], error) &&
                          settle(engine, error) && karst_engine_read_pixels(engine, rgba, small_bytes, error)
                    : karst_fail(error, KARST_FAILED, "out of memory");
    if (done) {
        accuracy_compare(rgba, a->picture, a->picture_px, &r->rmse, &r->psnr_db, &r->ssim);
        karst_engine_stats(engine, &stats);
        snprintf(a->device_name, sizeof a->device_name, "%s", stats.device);
        karst_camera camera = karst_engine_camera(engine);
        karst_camera_format(&camera, karst_engine_voxel_log2_m(engine), a->camera_text, sizeof a->camera_text);
    }
    free(depth_m);
    free(normals);
    free(rgba);
    return done;
}

bool accuracy_measure(accuracy *a, size_t i, command_talk *talk, karst_error *error)
{
    const accuracy_setting *setting = &a->settings[i];
    const karst_log log = command_log(talk);
    command_progress(talk, "%s, %.2f pixels a voxel (%zu of %zu)", setting->family, setting->detail_px, i + 1,
                     a->num_settings);
    const karst_engine_config config = {.world = a->world_file,
                                        .parameters = a->parameters.values,
                                        .num_parameters = a->parameters.num_values,
                                        .device = a->device,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = a->size_px[0],
                                        .height_px = a->size_px[1],
                                        .detail_px = setting->detail_px,
                                        .view_distance_m = a->view_distance_m,
                                        .has_seed = a->has_seed,
                                        .seed = (uint32_t)a->seed,
                                        .no_shadows = true,
                                        .brick_bits = setting->brick_bits,
                                        .safe_steps = setting->safe_steps,
                                        .no_blend = setting->no_blend,
                                        .no_beam = setting->no_beam,
                                        .refine = setting->refine,
                                        .lanes = (int)a->lanes,
                                        .log = &log};
    karst_engine *engine = karst_engine_create(&config, error);
    bool done = engine && (!a->has_camera || karst_engine_set_camera(engine, &a->camera_used, error)) &&
                measure_engine(a, engine, &a->results[i], error);
    karst_engine_destroy(engine);
    return done;
}
