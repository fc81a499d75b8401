/* Importing points: the input is read once, into a file of its own, and then becomes points in whole units. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/point_source.h"
#include "core/points/import_internal.h"

#define BATCH 4096u
#define MAX_SAMPLES 65536u
#define FAR_TIMES 1000.0 /* times the extent of the middle 98 % */

/* A point as it was read, in Karst's axes. */
typedef struct {
    double at[3];
    int16_t normal[3];
    uint8_t rgb[3], pad[7];
} raw_point;

typedef struct {
    uint64_t num;
    double (*samples)[3]; /* some of them, to tell from where on a point is far out */
    uint32_t num_samples;
    uint64_t random;
    double min[3], max[3];
} raw_cloud;

/* ---- reading ---- */

static karst_points_axes axes_of(karst_points_axes wanted, karst_point_format format)
{
    if (wanted != KARST_POINTS_AXES_OF_FORMAT)
        return wanted;
    return format == KARST_POINTS_PLY || format == KARST_POINTS_OBJ ? KARST_POINTS_Y_UP : KARST_POINTS_Z_UP;
}

static void turn_axes(karst_points_axes axes, double v[3])
{
    double z = v[2];
    if (axes == KARST_POINTS_Y_UP)
        v[2] = -z;
    if (axes == KARST_POINTS_Z_UP) {
        v[2] = v[1];
        v[1] = z;
    }
}

/* One sample for each of the first, then each point with the same chance (J. Vitter's algorithm R). */
static void sample(raw_cloud *cloud, const double at[3])
{
    uint64_t place = cloud->num_samples;
    if (cloud->num_samples < MAX_SAMPLES) {
        cloud->num_samples++;
    } else {
        cloud->random = cloud->random * 6364136223846793005u + 1442695040888963407u;
        place = (cloud->random >> 33) % (cloud->num + 1);
    }
    if (place < MAX_SAMPLES)
        memcpy(cloud->samples[place], at, sizeof cloud->samples[place]);
}

static bool take_point(raw_point *raw, const karst_file_point *from, karst_points_axes axes, bool has_normals)
{
    double normal[3] = {0}, square = 0;
    *raw = (raw_point){.rgb = {from->rgb[0], from->rgb[1], from->rgb[2]}};
    for (int a = 0; a < 3; a++) {
        raw->at[a] = from->at[a];
        normal[a] = has_normals ? (double)from->normal[a] : 0;
        square += normal[a] * normal[a];
        if (!isfinite(raw->at[a]) || fabs(raw->at[a]) > 1e30)
            return false;
    }
    turn_axes(axes, raw->at);
    turn_axes(axes, normal);
    for (int a = 0; a < 3 && square > 0 && isfinite(square); a++)
        raw->normal[a] = (int16_t)rint(normal[a] / sqrt(square) * 32767);
    return true;
}

static bool read_all(points_import *import, karst_point_source *source, karst_points_axes axes, int to,
                     raw_cloud *cloud, karst_error *error)
{
    karst_file_point *points = malloc(BATCH * sizeof *points);
    raw_point *raw = malloc(BATCH * sizeof *raw);
    bool done = (points && raw) || karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t num = 1; done && num;) {
        size_t num_raw = 0;
        done = karst_points_go_on(import, "reading", karst_point_source_share(source), error) &&
               karst_point_source_read(source, points, BATCH, &num, error);
        for (size_t i = 0; done && i < num; i++) {
            import->head->num_read++;
            if (!take_point(&raw[num_raw], &points[i], axes, karst_point_source_has_normals(source))) {
                import->head->num_invalid++;
                continue;
            }
            sample(cloud, raw[num_raw].at);
            for (int a = 0; a < 3; a++) {
                cloud->min[a] = fmin(cloud->min[a], raw[num_raw].at[a]);
                cloud->max[a] = fmax(cloud->max[a], raw[num_raw].at[a]);
            }
            cloud->num++;
            num_raw++;
        }
        done = done &&
               karst_points_write(import, to, raw, num_raw * sizeof *raw, (cloud->num - num_raw) * sizeof *raw, error);
    }
    import->head->num_withheld = karst_point_source_num_withheld(source);
    free(points);
    free(raw);
    return done;
}

/* ---- what is far out, and whole units ---- */

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Where a place is so far from nearly all others that it can only be a mistake. */
static bool find_limits(const raw_cloud *cloud, double low[3], double high[3])
{
    double *values = malloc((cloud->num_samples + 1) * sizeof *values), extent = 0;
    if (!values)
        return false;
    for (int a = 0; a < 3; a++) {
        for (uint32_t i = 0; i < cloud->num_samples; i++)
            values[i] = cloud->samples[i][a];
        qsort(values, cloud->num_samples, sizeof *values, by_size);
        low[a] = values[cloud->num_samples / 100];
        high[a] = values[cloud->num_samples - 1 - cloud->num_samples / 100];
        extent = fmax(extent, high[a] - low[a]);
    }
    free(values);
    for (int a = 0; a < 3; a++) {
        low[a] -= extent > 0 ? FAR_TIMES * extent : INFINITY;
        high[a] += extent > 0 ? FAR_TIMES * extent : INFINITY;
    }
    return true;
}

static karst_point_source *open_input(const karst_points_import_config *config, karst_points_axes *axes,
                                      karst_error *error)
{
    karst_point_format format;
    if (!karst_point_format_of(config->input, &format, error))
        return NULL;
    *axes = axes_of(config->axes, format);
    FILE *file = fopen(config->input, "rbe");
    if (!file) {
        karst_fail(error, KARST_BAD_DATA, "%s: cannot open: %s", config->input, strerror(errno));
        return NULL;
    }
    return karst_point_source_open(file, config->input, format, error);
}

bool karst_points_read_input(points_import *import, karst_error *error)
{
    points_progress *now = &import->now;
    raw_cloud cloud = {.samples = malloc(MAX_SAMPLES * sizeof *cloud.samples)};
    karst_points_axes axes;
    bool done = false;
    for (int a = 0; a < 3; a++) {
        cloud.min[a] = INFINITY;
        cloud.max[a] = -INFINITY;
    }
    karst_point_source *source = open_input(import->config, &axes, error);
    int raw = source ? karst_points_file(import, POINTS_RAW, error) : -1;
    if (!cloud.samples)
        karst_fail(error, KARST_FAILED, "out of memory");
    else if (raw >= 0 && read_all(import, source, axes, raw, &cloud, error)) {
        import->head->flags = (karst_point_source_has_colours(source) ? KARST_POINTS_HAS_COLOURS : 0) |
                              (karst_point_source_has_normals(source) ? KARST_POINTS_HAS_GIVEN_NORMALS : 0);
        if (cloud.num < POINTS_FEWEST)
            karst_fail(error, KARST_BAD_DATA, "%s: %llu points, of which %llu have places: %u are the fewest",
                       import->config->input, (unsigned long long)import->head->num_read, (unsigned long long)cloud.num,
                       POINTS_FEWEST);
        else
            done = find_limits(&cloud, now->low, now->high) || karst_fail(error, KARST_FAILED, "out of memory");
    }
    now->num = cloud.num;
    memcpy(now->min, cloud.min, sizeof now->min);
    memcpy(now->max, cloud.max, sizeof now->max);
    karst_point_source_close(source);
    free(cloud.samples);
    return done;
}

/* ---- whole units ---- */

/* Calls for blocks of what was read. */
static bool for_raw(points_import *import, const char *what, bool (*use)(void *user, const raw_point *raw, size_t num),
                    void *user, karst_error *error)
{
    const uint64_t num_all = import->now.num;
    raw_point *raw = malloc(BATCH * sizeof *raw);
    int from = karst_points_file(import, POINTS_RAW, error);
    bool done = from >= 0 && (raw || karst_fail(error, KARST_FAILED, "out of memory"));
    for (uint64_t at = 0; done && at < num_all; at += BATCH) {
        size_t num = num_all - at < BATCH ? (size_t)(num_all - at) : BATCH;
        done = karst_points_go_on(import, what, (double)at / (double)num_all, error) &&
               karst_points_read(import, from, raw, num * sizeof *raw, at * sizeof *raw, error) && use(user, raw, num);
    }
    free(raw);
    return done;
}

static bool is_near(const points_progress *now, const double at[3])
{
    bool near = true;
    for (int a = 0; a < 3; a++)
        near = near && at[a] >= now->low[a] && at[a] <= now->high[a];
    return near;
}

/* The extent of what is not far out. */
static bool measure(void *user, const raw_point *raw, size_t num)
{
    points_import *import = user;
    points_progress *now = &import->now;
    for (size_t i = 0; i < num; i++) {
        if (!is_near(now, raw[i].at)) {
            import->head->num_far++;
            continue;
        }
        for (int a = 0; a < 3; a++) {
            now->min[a] = fmin(now->min[a], raw[i].at[a]);
            now->max[a] = fmax(now->max[a], raw[i].at[a]);
        }
    }
    return true;
}

typedef struct {
    points_import *import;
    int to;
    uint64_t num;
    karst_error *error;
} quantising;

static bool quantise(void *user, const raw_point *raw, size_t num)
{
    quantising *q = user;
    const karst_points_head *head = q->import->head;
    const double inverse = 1 / head->unit; /* a power of two */
    karst_point points[BATCH];
    size_t kept = 0;
    for (size_t i = 0; i < num; i++) {
        if (!is_near(&q->import->now, raw[i].at))
            continue;
        karst_point *point = &points[kept++];
        *point = (karst_point){.radius = 0};
        for (int a = 0; a < 3; a++) {
            double at = rint((raw[i].at[a] - head->centre[a]) * inverse);
            point->at[a] = (int32_t)fmin(fmax(at, -KARST_POINTS_MAX_AT + 1), KARST_POINTS_MAX_AT - 1);
        }
        memcpy(point->normal, raw[i].normal, sizeof point->normal);
        memcpy(point->rgb, raw[i].rgb, sizeof point->rgb);
    }
    q->num += kept;
    return karst_points_write(q->import, q->to, points, kept * sizeof *points, (q->num - kept) * sizeof *points,
                              q->error);
}

bool karst_points_make_whole(points_import *import, karst_error *error)
{
    points_progress *now = &import->now;
    karst_points_head *head = import->head;
    double extent = 0;
    bool is_all = is_near(now, now->min) && is_near(now, now->max);
    for (int a = 0; a < 3 && !is_all; a++) {
        now->min[a] = INFINITY;
        now->max[a] = -INFINITY;
    }
    if (!is_all && !for_raw(import, "measuring", measure, import, error))
        return false;
    for (int a = 0; a < 3; a++) {
        extent = fmax(extent, now->max[a] - now->min[a]);
        head->min[a] = now->min[a];
        head->max[a] = now->max[a];
        head->centre[a] = now->min[a] + (now->max[a] - now->min[a]) / 2;
    }
    head->unit = exp2(extent > 0 ? ceil(log2(extent / (2.0 * KARST_POINTS_MAX_AT - 4))) : -10);
    if (!(head->unit >= 0x1p-190 && head->unit <= 0x1p190))
        return karst_fail(error, KARST_BAD_DATA, "%s: points that lie %g apart: no model is so small or so large",
                          import->config->input, extent);
    quantising q = {import, karst_points_file(import, POINTS_WHOLE, error), 0, error};
    if (q.to < 0 || !for_raw(import, "into whole units", quantise, &q, error))
        return false;
    now->num = q.num;
    return q.num <= UINT32_MAX / 2 ||
           karst_fail(error, KARST_USAGE, "%llu points: %u are the most, cut them into several models",
                      (unsigned long long)q.num, UINT32_MAX / 2);
}
