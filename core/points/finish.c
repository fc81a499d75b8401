/* Importing points: who is left out, and the finest level of the model. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define BATCH 4096u
#define OUTLIER_TIMES 12.0 /* times the median radius */

uint32_t karst_points_radius_bin(float radius)
{
    uint32_t bits;
    memcpy(&bits, &radius, sizeof bits);
    return bits >> 16;
}

float karst_points_median(const uint64_t counts[POINTS_RADIUS_BINS], uint64_t num)
{
    uint32_t bin = 0;
    float radius;
    for (uint64_t before = 0; bin < POINTS_RADIUS_BINS && (before += counts[bin]) <= num / 2; bin++)
        ;
    const uint32_t bits = bin << 16 | 0x8000u;
    memcpy(&radius, &bits, sizeof radius);
    return radius;
}

/* What threads have for each block of points. */
typedef struct {
    karst_point points[BATCH];
    uint32_t turns[BATCH];
    size_t num; /* that are left of the block's */
} finish_slot;

typedef struct {
    points_import *import;
    int from, turns, to;
    uint64_t counts[POINTS_RADIUS_BINS]; /* of radii */
    float most;                          /* a radius above is an outlier's */
    uint64_t num, sum;                   /* of what is written */
} finishing;

static bool read_block(const finishing *f, const points_block *block, finish_slot *slot, karst_error *error)
{
    slot->num = (size_t)(block->end - block->begin);
    return karst_points_read(f->import, f->from, slot->points, slot->num * sizeof *slot->points,
                             block->begin * sizeof *slot->points, error);
}

static void count_radii(finishing *f, const finish_slot *slot)
{
    for (size_t i = 0; i < slot->num; i++)
        f->counts[karst_points_radius_bin(slot->points[i].radius)]++;
}

/* Calls for blocks of the points that count. */
static bool for_points(finishing *f, const char *what,
                       bool (*work)(void *user, points_block *block, karst_error *error),
                       bool (*put)(void *user, points_block *block, karst_error *error), karst_error *error)
{
    const uint64_t num = f->import->now.num;
    const points_turns turns = {
        .loop = {what, 0, num, num, BATCH, false}, .slot_bytes = sizeof(finish_slot), .work = work, .put = put};
    f->from = karst_points_file(f->import, karst_points_in_order(f->import), error);
    return f->from >= 0 && karst_points_in_turns(f->import, &turns, f, error);
}

/* ---- outliers ---- */

static bool read_points(void *user, points_block *block, karst_error *error)
{
    return read_block(user, block, block->slot, error);
}

static bool put_radii(void *user, points_block *block, karst_error *error)
{
    (void)error;
    count_radii(user, block->slot);
    return true;
}

static bool keep(void *user, points_block *block, karst_error *error)
{
    const finishing *f = user;
    finish_slot *slot = block->slot;
    size_t kept = 0;
    if (!read_block(f, block, slot, error))
        return false;
    for (size_t i = 0; i < slot->num; i++)
        if (slot->points[i].radius <= f->most)
            slot->points[kept++] = slot->points[i];
    slot->num = kept;
    return true;
}

static bool put_kept(void *user, points_block *block, karst_error *error)
{
    finishing *f = user;
    const finish_slot *slot = block->slot;
    f->num += slot->num;
    return karst_points_write(f->import, f->to, slot->points, slot->num * sizeof *slot->points,
                              (f->num - slot->num) * sizeof *slot->points, error);
}

static bool leave_out(points_import *import, finishing *f, karst_error *error)
{
    if (!for_points(f, "outliers", read_points, put_radii, error))
        return false;
    f->most = (float)OUTLIER_TIMES * karst_points_median(f->counts, import->now.num);
    /* Bins tell enough to see that there is none. */
    bool any = false;
    for (uint32_t bin = karst_points_radius_bin(f->most); bin < POINTS_RADIUS_BINS; bin++)
        any = any || f->counts[bin];
    if (!any || !(f->most > 0))
        return true;
    f->to = karst_points_file(import, POINTS_KEPT, error);
    if (f->to < 0 || !for_points(f, "outliers", keep, put_kept, error))
        return false;
    if (f->num < POINTS_FEWEST)
        return karst_fail(error, KARST_BAD_DATA, "%s: fewer than %u points lie near one another", import->config->input,
                          POINTS_FEWEST);
    import->head->num_outliers = import->now.num - f->num;
    import->now.has_dropped = f->num < import->now.num;
    import->now.num = f->num;
    return true;
}

bool karst_points_leave_out(points_import *import, karst_error *error)
{
    if (import->config->keep_outliers)
        return true;
    finishing *f = calloc(1, sizeof *f);
    if (!f)
        return karst_fail(error, KARST_FAILED, "out of memory");
    f->import = import;
    bool done = leave_out(import, f, error);
    free(f);
    return done;
}

/* ---- the finest level ---- */

static bool turn(void *user, points_block *block, karst_error *error)
{
    const finishing *f = user;
    finish_slot *slot = block->slot;
    if (!read_block(f, block, slot, error) ||
        !karst_points_read(f->import, f->turns, slot->turns, slot->num * sizeof *slot->turns,
                           block->begin * sizeof *slot->turns, error))
        return false;
    for (size_t i = 0; i < slot->num; i++) {
        karst_point *point = &slot->points[i];
        for (int a = 0; a < 3 && slot->turns[i] & POINTS_TURNS_OVER; a++)
            point->normal[a] = (int16_t)-point->normal[a];
        point->is_found = 0;
    }
    return true;
}

static bool put_finest(void *user, points_block *block, karst_error *error)
{
    finishing *f = user;
    const finish_slot *slot = block->slot;
    const size_t num_bytes = slot->num * sizeof *slot->points;
    count_radii(f, slot);
    f->sum = karst_points_sum(f->sum, slot->points, num_bytes);
    return karst_points_write(f->import, f->to, slot->points, num_bytes,
                              sizeof(karst_points_head) + block->begin * sizeof *slot->points, error);
}

bool karst_points_add_finest(points_import *import, karst_error *error)
{
    karst_points_head *head = import->head;
    finishing *f = calloc(1, sizeof *f);
    if (!f)
        return karst_fail(error, KARST_FAILED, "out of memory");
    f->import = import;
    bool done = (f->turns = karst_points_file(import, POINTS_TURNS, error)) >= 0 &&
                (f->to = karst_points_file(import, POINTS_MODEL, error)) >= 0 &&
                for_points(f, "the finest level", turn, put_finest, error);
    if (done) {
        const float radius = karst_points_median(f->counts, import->now.num);
        /* Nine neighbours fill a disc: its radius is 1.69 spacings. */
        head->spacing = (double)radius / 1.69 * head->unit;
        head->levels[0] = (karst_points_level){.offset = sizeof *head,
                                               .num = import->now.num,
                                               .sum = f->sum,
                                               .spacing = (uint64_t)fmax((double)radius * 2 / 3, 1)};
        head->num_levels = 1;
    }
    free(f);
    return done && karst_points_add_tree(import, 0, error);
}
