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

/* Calls for blocks of the points that count, which may be changed: they are a copy. */
static bool for_points(points_import *import, const char *what,
                       bool (*use)(void *user, uint64_t first, karst_point *points, size_t num), void *user,
                       karst_error *error)
{
    const uint64_t num_all = import->now.num;
    karst_point *points = malloc(BATCH * sizeof *points);
    int from = karst_points_file(import, karst_points_in_order(import), error);
    bool done = from >= 0 && (points || karst_fail(error, KARST_FAILED, "out of memory"));
    for (uint64_t at = 0; done && at < num_all; at += BATCH) {
        size_t num = num_all - at < BATCH ? (size_t)(num_all - at) : BATCH;
        done = karst_points_go_on(import, what, (double)at / (double)num_all, error) &&
               karst_points_read(import, from, points, num * sizeof *points, at * sizeof *points, error) &&
               use(user, at, points, num);
    }
    free(points);
    return done;
}

/* ---- outliers ---- */

typedef struct {
    points_import *import;
    uint64_t *counts; /* of radii */
    float most;       /* a radius above is an outlier's */
    int to;
    uint64_t num, num_out;
    karst_error *error;
} leaving;

static bool count(void *user, uint64_t first, karst_point *points, size_t num)
{
    leaving *l = user;
    (void)first;
    for (size_t i = 0; i < num; i++)
        l->counts[karst_points_radius_bin(points[i].radius)]++;
    return true;
}

static bool keep(void *user, uint64_t first, karst_point *points, size_t num)
{
    leaving *l = user;
    size_t kept = 0;
    (void)first;
    for (size_t i = 0; i < num; i++)
        if (points[i].radius <= l->most)
            points[kept++] = points[i];
    l->num += kept;
    return karst_points_write(l->import, l->to, points, kept * sizeof *points, (l->num - kept) * sizeof *points,
                              l->error);
}

bool karst_points_leave_out(points_import *import, karst_error *error)
{
    leaving l = {.import = import, .to = -1, .error = error};
    if (import->config->keep_outliers)
        return true;
    l.counts = calloc(POINTS_RADIUS_BINS, sizeof *l.counts);
    bool done =
        l.counts ? for_points(import, "outliers", count, &l, error) : karst_fail(error, KARST_FAILED, "out of memory");
    if (done)
        l.most = (float)OUTLIER_TIMES * karst_points_median(l.counts, import->now.num);
    /* Bins tell enough to see that there is none. */
    bool any = false;
    for (uint32_t bin = karst_points_radius_bin(l.most); done && bin < POINTS_RADIUS_BINS; bin++)
        any = any || l.counts[bin];
    free(l.counts);
    if (!done || !any || !(l.most > 0))
        return done;
    l.to = karst_points_file(import, POINTS_KEPT, error);
    if (l.to < 0 || !for_points(import, "outliers", keep, &l, error))
        return false;
    if (l.num < POINTS_FEWEST)
        return karst_fail(error, KARST_BAD_DATA, "%s: fewer than %u points lie near one another", import->config->input,
                          POINTS_FEWEST);
    import->head->num_outliers = import->now.num - l.num;
    import->now.has_dropped = l.num < import->now.num;
    import->now.num = l.num;
    return true;
}

/* ---- the finest level ---- */

typedef struct {
    points_import *import;
    uint64_t counts[POINTS_RADIUS_BINS];
    uint64_t sum;
    int turns, to;
    karst_error *error;
} finishing;

static bool finish(void *user, uint64_t first, karst_point *points, size_t num)
{
    finishing *f = user;
    uint32_t turns[BATCH];
    if (!karst_points_read(f->import, f->turns, turns, num * sizeof *turns, first * sizeof *turns, f->error))
        return false;
    for (size_t i = 0; i < num; i++) {
        for (int a = 0; a < 3 && turns[i] & POINTS_TURNS_OVER; a++)
            points[i].normal[a] = (int16_t)-points[i].normal[a];
        points[i].is_found = 0;
        f->counts[karst_points_radius_bin(points[i].radius)]++;
    }
    f->sum = karst_points_sum(f->sum, points, num * sizeof *points);
    return karst_points_write(f->import, f->to, points, num * sizeof *points,
                              sizeof(karst_points_head) + first * sizeof *points, f->error);
}

bool karst_points_add_finest(points_import *import, karst_error *error)
{
    karst_points_head *head = import->head;
    finishing *f = calloc(1, sizeof *f);
    if (!f)
        return karst_fail(error, KARST_FAILED, "out of memory");
    f->import = import;
    f->error = error;
    bool done = (f->turns = karst_points_file(import, POINTS_TURNS, error)) >= 0 &&
                (f->to = karst_points_file(import, POINTS_MODEL, error)) >= 0 &&
                for_points(import, "the finest level", finish, f, error);
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
