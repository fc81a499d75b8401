/* Importing points: what was read becomes points in whole units. The unit is known once all places are; then points are
 * made whole whenever they are read again, which takes less than a file of them would. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "core/points/import_internal.h"

#define BATCH 4096u

static bool is_near(const points_progress *now, const double at[3])
{
    bool near = true;
    for (int a = 0; a < 3; a++)
        near = near && at[a] >= now->low[a] && at[a] <= now->high[a];
    return near;
}

/* ---- measuring ---- */

typedef struct {
    points_raw raw[BATCH];
    double min[3], max[3];
    uint64_t num_far;
} measure_slot;

typedef struct {
    points_import *import;
    int from;
} measuring;

static bool measure(void *user, points_block *block, karst_error *error)
{
    const measuring *m = user;
    measure_slot *slot = block->slot;
    const size_t num = (size_t)(block->end - block->begin);
    if (!karst_points_read(m->import, m->from, slot->raw, num * sizeof *slot->raw, block->begin * sizeof *slot->raw,
                           error))
        return false;
    slot->num_far = 0;
    for (int a = 0; a < 3; a++) {
        slot->min[a] = INFINITY;
        slot->max[a] = -INFINITY;
    }
    for (size_t i = 0; i < num; i++) {
        if (!is_near(&m->import->now, slot->raw[i].at)) {
            slot->num_far++;
            continue;
        }
        for (int a = 0; a < 3; a++) {
            slot->min[a] = fmin(slot->min[a], slot->raw[i].at[a]);
            slot->max[a] = fmax(slot->max[a], slot->raw[i].at[a]);
        }
    }
    return true;
}

static bool put_measure(void *user, points_block *block, karst_error *error)
{
    const measuring *m = user;
    const measure_slot *slot = block->slot;
    points_progress *now = &m->import->now;
    (void)error;
    m->import->head->num_far += slot->num_far;
    for (int a = 0; a < 3; a++) {
        now->min[a] = fmin(now->min[a], slot->min[a]);
        now->max[a] = fmax(now->max[a], slot->max[a]);
    }
    return true;
}

/* The extent of what is not far out. */
static bool measure_near(points_import *import, karst_error *error)
{
    points_progress *now = &import->now;
    const uint64_t num = karst_points_num_raw(import);
    measuring m = {import, karst_points_file(import, POINTS_RAW, error)};
    const points_turns turns = {.loop = {"measuring", 0, num, num, BATCH, false},
                                .slot_bytes = sizeof(measure_slot),
                                .work = measure,
                                .put = put_measure};
    for (int a = 0; a < 3; a++) {
        now->min[a] = INFINITY;
        now->max[a] = -INFINITY;
    }
    return m.from >= 0 && karst_points_in_turns(import, &turns, &m, error);
}

uint64_t karst_points_num_raw(const points_import *import)
{
    return import->head->num_read - import->head->num_invalid;
}

bool karst_points_measure(points_import *import, karst_error *error)
{
    points_progress *now = &import->now;
    karst_points_head *head = import->head;
    double extent = 0;
    bool is_all = is_near(now, now->min) && is_near(now, now->max);
    if (!is_all && !measure_near(import, error))
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
    now->num = karst_points_num_raw(import) - head->num_far;
    return now->num <= UINT32_MAX / 2 ||
           karst_fail(error, KARST_USAGE, "%llu points: %u are the most, cut them into several models",
                      (unsigned long long)now->num, UINT32_MAX / 2);
}

/* ---- whole units ---- */

size_t karst_points_read_whole(const points_import *import, int from, uint64_t first, size_t num, points_raw *raw,
                               karst_point *points, karst_error *error)
{
    const karst_points_head *head = import->head;
    const double inverse = 1 / head->unit; /* a power of two */
    size_t kept = 0;
    if (!karst_points_read(import, from, raw, num * sizeof *raw, first * sizeof *raw, error))
        return SIZE_MAX;
    for (size_t i = 0; i < num; i++) {
        if (!is_near(&import->now, raw[i].at))
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
    return kept;
}
