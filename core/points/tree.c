/* The tree over a level's points: leaves of eight points that follow one another, nodes of eight leaves or nodes that
 * do. In Morton order those lie near one another, and all is one pass over files: the nodes of each level are made from
 * those of the level below, as they were written.
 *
 * What a level's points are averages of reaches beyond them: `cover` and `spread` of karst_point_node, which each level
 * widens by the finer one's. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define BATCH 4096u

/* How far what a point stands for reaches. */
typedef struct {
    int32_t cover, spread;
} extent;

/* Records of a file that are read one after another, a batch at a time. */
typedef struct {
    points_import *import;
    int fd;
    uint32_t record_bytes, in_batch, at;
    uint64_t offset, left; /* of what is not in the batch yet */
    char *batch;
    karst_error *error;
    bool failed;
} records;

static bool open_records(records *r, points_import *import, int fd, uint64_t offset, uint64_t num,
                         uint32_t record_bytes, karst_error *error)
{
    *r = (records){.import = import,
                   .fd = fd,
                   .record_bytes = record_bytes,
                   .offset = offset,
                   .left = num,
                   .batch = malloc((size_t)BATCH * record_bytes),
                   .error = error};
    return fd >= 0 && (r->batch || karst_fail(error, KARST_FAILED, "out of memory"));
}

/* The record that is next; NULL at the end, or where it cannot be read (`failed`). */
static const void *look(records *r)
{
    if (r->at == r->in_batch) {
        uint32_t num = r->left < BATCH ? (uint32_t)r->left : BATCH;
        const size_t num_bytes = (size_t)num * r->record_bytes;
        if (num == 0 || r->failed)
            return NULL;
        if (!karst_points_read(r->import, r->fd, r->batch, num_bytes, r->offset, r->error)) {
            r->failed = true;
            return NULL;
        }
        r->offset += num_bytes;
        r->left -= num;
        r->in_batch = num;
        r->at = 0;
    }
    return r->batch + (size_t)r->at * r->record_bytes;
}

/* What is made, in batches, with its sum. */
typedef struct {
    points_import *import;
    int fd;
    uint32_t record_bytes, in_batch;
    uint64_t offset, sum;
    char *batch;
    karst_error *error;
} output;

static bool open_output(output *o, points_import *import, int fd, uint64_t offset, uint32_t record_bytes,
                        karst_error *error)
{
    *o = (output){.import = import,
                  .fd = fd,
                  .record_bytes = record_bytes,
                  .offset = offset,
                  .batch = malloc((size_t)BATCH * record_bytes),
                  .error = error};
    return fd >= 0 && (o->batch || karst_fail(error, KARST_FAILED, "out of memory"));
}

static bool flush(output *o)
{
    const size_t num_bytes = (size_t)o->in_batch * o->record_bytes;
    o->sum = karst_points_sum(o->sum, o->batch, num_bytes);
    bool done = karst_points_write(o->import, o->fd, o->batch, num_bytes, o->offset, o->error);
    o->offset += num_bytes;
    o->in_batch = 0;
    return done;
}

static bool put(output *o, const void *record)
{
    memcpy(o->batch + (size_t)o->in_batch * o->record_bytes, record, o->record_bytes);
    return ++o->in_batch < BATCH || flush(o);
}

/* ---- nodes ---- */

static void grow(karst_point_node *node, const karst_point_node *by)
{
    for (int a = 0; a < 3; a++) {
        node->min[a] = by->min[a] < node->min[a] ? by->min[a] : node->min[a];
        node->max[a] = by->max[a] > node->max[a] ? by->max[a] : node->max[a];
    }
    node->reach = by->reach > node->reach ? by->reach : node->reach;
    node->cover = by->cover > node->cover ? by->cover : node->cover;
    node->spread = by->spread > node->spread ? by->spread : node->spread;
}

static karst_point_node node_of(const karst_point *point, const extent *of)
{
    karst_point_node node = {.reach = karst_point_reach(point->radius), .cover = of->cover, .spread = of->spread};
    memcpy(node.min, point->at, sizeof node.min);
    memcpy(node.max, point->at, sizeof node.max);
    return node;
}

/* ---- extents ---- */

/* Points of a cell, most of which have one side or two. */
#define MOST_SIDES 2

static bool same_cell(const karst_point *a, const karst_point *b, int shift)
{
    return a->at[0] >> shift == b->at[0] >> shift && a->at[1] >> shift == b->at[1] >> shift &&
           a->at[2] >> shift == b->at[2] >> shift;
}

static double distance(const karst_point *a, const karst_point *b)
{
    double square = 0;
    for (int i = 0; i < 3; i++)
        square += ((double)a->at[i] - b->at[i]) * ((double)a->at[i] - b->at[i]);
    return sqrt(square);
}

static void widen(extent *of, double by, const extent *finer)
{
    of->cover = (int32_t)fmin(fmax(of->cover, by + finer->cover), 0x1p30);
    of->spread = (int32_t)fmin(fmax(of->spread, by + finer->spread), 0x1p30);
}

/* The points of `coarse` that lie in one cell, with what those of `fine` in it make of their extents. */
static bool take_cell(records *coarse, records *fine, records *fine_extents, int shift, karst_point sides[MOST_SIDES],
                      extent extents[MOST_SIDES], int *num)
{
    const karst_point *next;
    *num = 0;
    while (*num < MOST_SIDES && (next = look(coarse)) && (*num == 0 || same_cell(next, sides, shift))) {
        sides[*num] = *next;
        extents[(*num)++] = (extent){karst_point_reach(next->radius), 0};
        coarse->at++;
    }
    while (*num && fine && (next = look(fine)) && same_cell(next, sides, shift)) {
        const extent *of = look(fine_extents);
        if (!of)
            return false;
        for (int i = 0; i < *num; i++)
            widen(&extents[i], ceil(distance(next, &sides[i])), of);
        fine->at++;
        fine_extents->at++;
    }
    return !coarse->failed && (!fine || !fine->failed);
}

typedef struct {
    records points, fine, fine_extents;
    output nodes, extents;
    bool has_fine;
    int shift;
} building;

static bool build_leaves(building *b)
{
    karst_point_node leaf = {{0}, {0}, 0, 0, 0, 0};
    uint32_t in_leaf = 0;
    for (;;) {
        karst_point sides[MOST_SIDES];
        extent extents[MOST_SIDES];
        int num;
        if (!take_cell(&b->points, b->has_fine ? &b->fine : NULL, &b->fine_extents, b->shift, sides, extents, &num))
            return false;
        for (int i = 0; i < num; i++) {
            karst_point_node by = node_of(&sides[i], &extents[i]);
            if (in_leaf)
                grow(&leaf, &by);
            else
                leaf = by;
            if (!put(&b->extents, &extents[i]) || (++in_leaf == KARST_POINTS_FAN && !put(&b->nodes, &leaf)))
                return false;
            in_leaf %= KARST_POINTS_FAN;
        }
        if (num == 0)
            break;
    }
    return (in_leaf == 0 || put(&b->nodes, &leaf)) && flush(&b->nodes) && flush(&b->extents);
}

/* One level of nodes, from those that were written before. */
static bool build_level(points_import *import, output *nodes, uint64_t from, uint32_t num, karst_error *error)
{
    records below = {.fd = -1};
    bool done = open_records(&below, import, nodes->fd, from, num, sizeof(karst_point_node), error);
    const karst_point_node *next;
    karst_point_node node = {{0}, {0}, 0, 0, 0, 0};
    for (uint32_t i = 0; done && (next = look(&below)); i++, below.at++) {
        if (i % KARST_POINTS_FAN)
            grow(&node, next);
        else
            node = *next;
        if (i % KARST_POINTS_FAN == KARST_POINTS_FAN - 1 || i + 1 == num)
            done = put(nodes, &node);
    }
    done = done && !below.failed && flush(nodes);
    free(below.batch);
    return done;
}

bool karst_points_add_tree(points_import *import, uint32_t level, karst_error *error)
{
    karst_points_head *head = import->head;
    const karst_points_level *of = &head->levels[level];
    const points_work_file own = level % 2 ? POINTS_COVERS_ODD : POINTS_COVERS,
                           finer = level % 2 ? POINTS_COVERS : POINTS_COVERS_ODD;
    uint64_t from = karst_points_tree_offset(of);
    uint32_t counts[KARST_POINTS_MAX_TREE];
    int fd = karst_points_file(import, POINTS_MODEL, error), num_levels = karst_points_tree((uint32_t)of->num, counts);
    building b = {.has_fine = level > 0, .shift = level ? ilogb((double)of->spacing) : 0};
    /* Points end at any 4 bytes: what is between is zero. */
    const uint64_t points_end = of->offset + of->num * sizeof(karst_point);
    bool done =
        fd >= 0 && karst_points_write(import, fd, "\0\0\0\0\0\0\0", (size_t)(from - points_end), points_end, error);
    done = done && open_records(&b.points, import, fd, of->offset, of->num, sizeof(karst_point), error) &&
           open_output(&b.nodes, import, fd, from, sizeof(karst_point_node), error) &&
           open_output(&b.extents, import, karst_points_file(import, own, error), 0, sizeof(extent), error);
    if (done && level > 0)
        done = open_records(&b.fine, import, fd, of[-1].offset, of[-1].num, sizeof(karst_point), error) &&
               open_records(&b.fine_extents, import, karst_points_file(import, finer, error), 0, of[-1].num,
                            sizeof(extent), error);
    done = done && build_leaves(&b);
    for (int i = 1; done && i < num_levels; i++) {
        done =
            karst_points_go_on(import, "trees", 0, error) && build_level(import, &b.nodes, from, counts[i - 1], error);
        from += counts[i - 1] * sizeof(karst_point_node);
    }
    head->tree_sums[level] = b.nodes.sum;
    char *const batches[] = {b.points.batch, b.fine.batch, b.fine_extents.batch, b.nodes.batch, b.extents.batch};
    for (size_t i = 0; i < sizeof batches / sizeof *batches; i++)
        free(batches[i]);
    return done;
}
