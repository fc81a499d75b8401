/* Importing points: the input is read once, into a file of its own. One thread reads while others look at what was
 * read before. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/point_source.h"
#include "core/points/import_internal.h"

#define BATCH 2048u
#define MAX_SAMPLES 65536u
#define FAR_TIMES 1000.0 /* times the extent of the middle 98 % */

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

static bool take_point(points_raw *raw, const karst_file_point *from, karst_points_axes axes, bool has_normals)
{
    double normal[3] = {0}, square = 0;
    *raw = (points_raw){.rgb = {from->rgb[0], from->rgb[1], from->rgb[2]}};
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

typedef struct {
    points_import *import;
    karst_point_source *source;
    karst_points_axes axes;
    int to;
    raw_cloud *cloud;
} reading;

typedef struct {
    karst_file_point points[BATCH];
    points_raw raw[BATCH];
    size_t num, num_raw;
    double min[3], max[3];
} read_slot;

static bool take_batch(void *user, points_block *block, double *share, bool *any, karst_error *error)
{
    const reading *r = user;
    read_slot *slot = block->slot;
    if (!karst_point_source_read(r->source, slot->points, BATCH, &slot->num, error))
        return false;
    *share = karst_point_source_share(r->source);
    *any = slot->num > 0;
    return true;
}

static bool look_at_batch(void *user, points_block *block, karst_error *error)
{
    const reading *r = user;
    read_slot *slot = block->slot;
    const bool has_normals = karst_point_source_has_normals(r->source);
    (void)error;
    slot->num_raw = 0;
    for (int a = 0; a < 3; a++) {
        slot->min[a] = INFINITY;
        slot->max[a] = -INFINITY;
    }
    for (size_t i = 0; i < slot->num; i++) {
        points_raw *raw = &slot->raw[slot->num_raw];
        if (!take_point(raw, &slot->points[i], r->axes, has_normals))
            continue;
        slot->num_raw++;
        for (int a = 0; a < 3; a++) {
            slot->min[a] = fmin(slot->min[a], raw->at[a]);
            slot->max[a] = fmax(slot->max[a], raw->at[a]);
        }
    }
    return true;
}

static bool put_batch(void *user, points_block *block, karst_error *error)
{
    const reading *r = user;
    const read_slot *slot = block->slot;
    raw_cloud *cloud = r->cloud;
    r->import->head->num_read += slot->num;
    r->import->head->num_invalid += slot->num - slot->num_raw;
    for (int a = 0; a < 3; a++) {
        cloud->min[a] = fmin(cloud->min[a], slot->min[a]);
        cloud->max[a] = fmax(cloud->max[a], slot->max[a]);
    }
    if (!karst_points_write(r->import, r->to, slot->raw, slot->num_raw * sizeof *slot->raw,
                            cloud->num * sizeof *slot->raw, error))
        return false;
    for (size_t i = 0; i < slot->num_raw; i++, cloud->num++)
        sample(cloud, slot->raw[i].at);
    return true;
}

static bool read_all(points_import *import, karst_point_source *source, karst_points_axes axes, int to,
                     raw_cloud *cloud, karst_error *error)
{
    reading r = {import, source, axes, to, cloud};
    const points_turns turns = {.loop = {.what = "reading"},
                                .slot_bytes = sizeof(read_slot),
                                .take = take_batch,
                                .work = look_at_batch,
                                .put = put_batch};
    bool done = karst_points_in_turns(import, &turns, &r, error);
    import->head->num_withheld = karst_point_source_num_withheld(source);
    return done;
}

/* ---- what is far out ---- */

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
