/* Importing points: one reading of the input, then all that is done with them on disk (docs/POINTS.md). */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/files/point_source.h"
#include "core/points/import_internal.h"

#define BATCH 4096u
#define MAX_SAMPLES 65536u
#define FEWEST_POINTS 16u
#define FAR_TIMES 1000.0   /* times the extent of the middle 98 % */
#define OUTLIER_TIMES 12.0 /* times the median radius */
#define RADIUS_BINS 65536u /* of floats by their upper half */

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
    double min[3], max[3]; /* of those that are not far out */
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
            import->head.num_read++;
            if (!take_point(&raw[num_raw], &points[i], axes, karst_point_source_has_normals(source))) {
                import->head.num_invalid++;
                continue;
            }
            sample(cloud, raw[num_raw].at);
            cloud->num++;
            num_raw++;
        }
        done = done &&
               karst_points_write(import, to, raw, num_raw * sizeof *raw, (cloud->num - num_raw) * sizeof *raw, error);
    }
    import->head.num_withheld = karst_point_source_num_withheld(source);
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

/* Calls for blocks of what was read that is not far out; `use` may be NULL: then only min and max are found. */
static bool for_raw(points_import *import, int from, raw_cloud *cloud, const double low[3], const double high[3],
                    bool (*use)(void *user, const raw_point *points, size_t num), void *user, karst_error *error)
{
    raw_point *raw = malloc(BATCH * sizeof *raw);
    bool done = raw || karst_fail(error, KARST_FAILED, "out of memory");
    for (uint64_t at = 0; done && at < cloud->num; at += BATCH) {
        size_t num = cloud->num - at < BATCH ? (size_t)(cloud->num - at) : BATCH, kept = 0;
        done = karst_points_go_on(import, "measuring", (double)at / (double)cloud->num, error) &&
               karst_points_read(import, from, raw, num * sizeof *raw, at * sizeof *raw, error);
        for (size_t i = 0; done && i < num; i++) {
            bool is_near = true;
            for (int a = 0; a < 3; a++)
                is_near = is_near && raw[i].at[a] >= low[a] && raw[i].at[a] <= high[a];
            import->head.num_far += !is_near && !use;
            if (!is_near)
                continue;
            for (int a = 0; a < 3; a++) {
                cloud->min[a] = fmin(cloud->min[a], raw[i].at[a]);
                cloud->max[a] = fmax(cloud->max[a], raw[i].at[a]);
            }
            raw[kept++] = raw[i];
        }
        done = done && (!use || use(user, raw, kept));
    }
    free(raw);
    return done;
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
    const karst_points_head *head = &q->import->head;
    karst_point points[BATCH];
    for (size_t i = 0; i < num; i++) {
        points[i] = (karst_point){.radius = 0};
        for (int a = 0; a < 3; a++) {
            double at = rint((raw[i].at[a] - head->centre[a]) / head->unit);
            points[i].at[a] = (int32_t)fmin(fmax(at, -KARST_POINTS_MAX_AT + 1), KARST_POINTS_MAX_AT - 1);
        }
        memcpy(points[i].normal, raw[i].normal, sizeof points[i].normal);
        memcpy(points[i].rgb, raw[i].rgb, sizeof points[i].rgb);
    }
    q->num += num;
    return karst_points_write(q->import, q->to, points, num * sizeof *points, (q->num - num) * sizeof *points,
                              q->error);
}

/* From what was read to points in whole units, in a file whose descriptor is returned; -1 on errors. */
static int make_whole(points_import *import, int from, raw_cloud *cloud, uint64_t *num, karst_error *error)
{
    karst_points_head *head = &import->head;
    double low[3], high[3], extent = 0;
    if (!find_limits(cloud, low, high)) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return -1;
    }
    for (int a = 0; a < 3; a++) {
        cloud->min[a] = INFINITY;
        cloud->max[a] = -INFINITY;
    }
    if (!for_raw(import, from, cloud, low, high, NULL, NULL, error))
        return -1;
    for (int a = 0; a < 3; a++) {
        extent = fmax(extent, cloud->max[a] - cloud->min[a]);
        head->min[a] = cloud->min[a];
        head->max[a] = cloud->max[a];
        head->centre[a] = cloud->min[a] + (cloud->max[a] - cloud->min[a]) / 2;
    }
    head->unit = exp2(extent > 0 ? ceil(log2(extent / (2.0 * KARST_POINTS_MAX_AT - 4))) : -10);
    if (!(head->unit >= 0x1p-190 && head->unit <= 0x1p190)) {
        karst_fail(error, KARST_BAD_DATA, "%s: points that lie %g apart: no model is so small or so large",
                   import->config->input, extent);
        return -1;
    }
    quantising q = {import, karst_points_scratch(import, error), 0, error};
    if (q.to < 0)
        return -1;
    if (!for_raw(import, from, cloud, low, high, quantise, &q, error)) {
        close(q.to);
        return -1;
    }
    *num = q.num;
    return q.to;
}

/* ---- what lies around points ---- */

static uint32_t bin_of(float radius)
{
    uint32_t bits;
    memcpy(&bits, &radius, sizeof bits);
    return bits >> 16;
}

static float median_radius(const karst_point *points, uint32_t num)
{
    uint32_t *counts = calloc(RADIUS_BINS, sizeof *counts), bin = 0, bits;
    float radius = 0;
    for (uint32_t i = 0; counts && i < num; i++)
        counts[bin_of(points[i].radius)]++;
    for (uint64_t before = 0; counts && bin < RADIUS_BINS && (before += counts[bin]) <= num / 2; bin++)
        ;
    bits = bin << 16 | 0x8000u;
    memcpy(&radius, &bits, sizeof radius);
    free(counts);
    return radius;
}

/* Leaves out points that are far from all others; returns how many stay. */
static uint32_t drop_outliers(points_import *import, karst_point *points, uint32_t num)
{
    float most = (float)OUTLIER_TIMES * median_radius(points, num);
    uint32_t kept = 0;
    if (import->config->keep_outliers || !(most > 0))
        return num;
    for (uint32_t i = 0; i < num; i++)
        if (points[i].radius <= most)
            points[kept++] = points[i];
    import->head.num_outliers = num - kept;
    return kept;
}

static bool look_around(points_import *import, karst_point *points, uint32_t *num, karst_error *error)
{
    const karst_points_import_config *config = import->config;
    const bool has_normals = import->head.flags & KARST_POINTS_HAS_GIVEN_NORMALS;
    size_t links_bytes = (size_t)*num * POINTS_LINKS * sizeof(uint32_t);
    uint32_t *links = karst_points_scratch_map(import, links_bytes, error);
    bool done = links && karst_points_look_around(import, points, *num, links, error);
    if (done) {
        uint32_t kept = drop_outliers(import, points, *num);
        if (kept < FEWEST_POINTS)
            done = karst_fail(error, KARST_BAD_DATA, "%s: fewer than %u points lie near one another", config->input,
                              FEWEST_POINTS);
        if (done && kept < *num) { /* neighbours have other numbers now, and some have other neighbours */
            for (uint32_t i = 0; !has_normals && i < kept; i++)
                memset(points[i].normal, 0, sizeof points[i].normal);
            done = karst_points_look_around(import, points, kept, links, error);
        }
        *num = kept;
    }
    if (done && has_normals)
        karst_points_turn_like_given(points, *num, links);
    if (done && !has_normals && config->turn == KARST_POINTS_TURN_UP)
        karst_points_turn_up(points, *num);
    else if (done && !has_normals)
        done = karst_points_turn_together(import, points, *num, links, error);
    for (uint32_t i = 0; done && i < *num; i++)
        points[i].is_found = 0;
    karst_points_unmap(links, links_bytes);
    return done;
}

/* Radii, normals and the sum of the finest level, which lies in the output. */
static bool finish_points(points_import *import, uint64_t num_sorted, karst_error *error)
{
    karst_points_head *head = &import->head;
    uint32_t num = (uint32_t)num_sorted;
    size_t num_bytes = sizeof *head + num_sorted * sizeof(karst_point);
    char *map = karst_points_map(import->fd, num_bytes, error);
    karst_point *points = (karst_point *)(map + sizeof *head);
    bool done = map && look_around(import, points, &num, error);
    if (done) {
        float radius = median_radius(points, num);
        /* Nine neighbours fill a disc: its radius is 1.69 spacings. */
        head->spacing = (double)radius / 1.69 * head->unit;
        head->levels[0] = (karst_points_level){.offset = sizeof *head,
                                               .num = num,
                                               .sum = karst_points_sum(0, points, num * sizeof *points),
                                               .spacing = (uint64_t)fmax((double)radius * 2 / 3, 1)};
        head->num_levels = 1;
    }
    karst_points_unmap(map, num_bytes);
    return done;
}

/* ---- all of it ---- */

static bool finish_file(points_import *import, karst_error *error)
{
    karst_points_head *head = &import->head;
    const karst_points_level *last = &head->levels[head->num_levels - 1];
    memcpy(head->magic, KARST_POINTS_MAGIC, sizeof head->magic);
    head->version = KARST_POINTS_VERSION;
    head->record_bytes = sizeof(karst_point);
    head->sum = karst_points_sum(0, head, offsetof(karst_points_head, sum));
    if (!karst_points_write(import, import->fd, head, sizeof *head, 0, error))
        return false;
    if (ftruncate(import->fd, (off_t)(last->offset + last->num * sizeof(karst_point))) != 0 ||
        fchmod(import->fd, 0644) != 0 || fsync(import->fd) != 0 ||
        rename(import->temporary, import->config->output) != 0)
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s", import->config->output, strerror(errno));
    free(import->temporary);
    import->temporary = NULL;
    return true;
}

static bool open_output(points_import *import, karst_error *error)
{
    if (asprintf(&import->temporary, "%s.XXXXXX", import->config->output) < 0) {
        import->temporary = NULL;
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    import->fd = mkostemp(import->temporary, O_CLOEXEC);
    if (import->fd >= 0)
        return true;
    free(import->temporary);
    import->temporary = NULL;
    return karst_fail(error, KARST_FAILED, "cannot write beside %s: %s", import->config->output, strerror(errno));
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

/* Reads the input into a file in whole units, whose descriptor is returned; -1 on errors. */
static int read_input(points_import *import, uint64_t *num, karst_error *error)
{
    raw_cloud cloud = {.samples = malloc(MAX_SAMPLES * sizeof *cloud.samples)};
    karst_points_axes axes;
    int raw = -1, whole = -1;
    karst_point_source *source = open_input(import->config, &axes, error);
    if (!cloud.samples)
        karst_fail(error, KARST_FAILED, "out of memory");
    else if (source && (raw = karst_points_scratch(import, error)) >= 0 &&
             read_all(import, source, axes, raw, &cloud, error)) {
        import->head.flags = (karst_point_source_has_colours(source) ? KARST_POINTS_HAS_COLOURS : 0) |
                             (karst_point_source_has_normals(source) ? KARST_POINTS_HAS_GIVEN_NORMALS : 0);
        if (cloud.num < FEWEST_POINTS)
            karst_fail(error, KARST_BAD_DATA, "%s: %llu points, of which %llu have places: %u are the fewest",
                       import->config->input, (unsigned long long)import->head.num_read, (unsigned long long)cloud.num,
                       FEWEST_POINTS);
        else
            whole = make_whole(import, raw, &cloud, num, error);
    }
    if (raw >= 0)
        close(raw);
    karst_point_source_close(source);
    free(cloud.samples);
    return whole;
}

static bool run(points_import *import, karst_error *error)
{
    uint64_t num = 0;
    int whole = read_input(import, &num, error);
    if (whole < 0)
        return false;
    if (!open_output(import, error)) {
        close(whole);
        return false;
    }
    if (!karst_points_sort(import, whole, &num, import->fd, sizeof import->head, error))
        return false;
    if (num < FEWEST_POINTS)
        return karst_fail(error, KARST_BAD_DATA, "%s: only %llu points lie apart from one another: %u are the fewest",
                          import->config->input, (unsigned long long)num, FEWEST_POINTS);
    return finish_points(import, num, error) && karst_points_add_levels(import, error) && finish_file(import, error);
}

bool karst_points_import(const karst_points_import_config *config, karst_points_about *about, karst_error *error)
{
    points_import import = {.config = config, .fd = -1};
    if (!config->input || !config->output)
        return karst_fail(error, KARST_USAGE, "which file of points, and where to?");
    if (!karst_points_is_name(config->output))
        return karst_fail(error, KARST_USAGE, "%s: the name of imported points ends in .karstpoints", config->output);
    bool done = run(&import, error);
    if (import.fd >= 0)
        close(import.fd);
    if (import.temporary) {
        unlink(import.temporary);
        free(import.temporary);
    }
    if (done && about)
        karst_points_tell(&import.head, about);
    return done;
}
