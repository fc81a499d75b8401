/* The coarser levels of a model, bottom-up: each averages the one before, in cells twice as wide. In Morton order a
 * cell's points follow one another, so this is one pass over each level. Points of a cell that face apart are two
 * sides of something thin, and are averaged apart. What a level's points are averages of reaches beyond them: `cover`
 * and `spread` of karst_point_node, which each level widens by the finer one's.
 *
 * Threads take blocks of points. Cells that lie wholly in a block are averaged there; a cell that goes over the end of
 * one, or over many blocks, is read again once its end is known, in the order of blocks. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define BLOCK 4096u
#define FEW_POINTS 200u

/* ---- cells ---- */

/* Points that are averaged. */
typedef struct {
    double at[3], radius;
    double normal[3], rgb[3];
    uint32_t num;
} group;

/* A cell, while it is made. */
typedef struct {
    group sides[2];
    karst_point points[2];
    points_extent extents[2];
    uint32_t num; /* of sides */
} cell;

static bool same_cell(const karst_point *a, const karst_point *b, int shift)
{
    return ((a->at[0] ^ b->at[0]) >> shift | (a->at[1] ^ b->at[1]) >> shift | (a->at[2] ^ b->at[2]) >> shift) == 0;
}

static void add(group *g, const karst_point *p)
{
    for (int a = 0; a < 3; a++) {
        g->at[a] += p->at[a];
        g->normal[a] += p->normal[a];
        g->rgb[a] += p->rgb[a];
    }
    g->radius += (double)p->radius;
    g->num++;
}

static void add_to_cell(cell *c, const karst_point *p)
{
    double agrees = 0;
    for (int a = 0; a < 3; a++)
        agrees += c->sides[0].normal[a] * p->normal[a];
    add(&c->sides[c->sides[0].num && agrees < 0], p);
}

static karst_point average_of(const group *g, double least_radius)
{
    karst_point p = {.radius = (float)fmax(g->radius / g->num, least_radius)};
    double length = sqrt(g->normal[0] * g->normal[0] + g->normal[1] * g->normal[1] + g->normal[2] * g->normal[2]);
    for (int a = 0; a < 3; a++) {
        p.at[a] = (int32_t)rint(g->at[a] / g->num);
        p.normal[a] = (int16_t)rint(length > 0 ? g->normal[a] / length * 32767 : 0);
        p.rgb[a] = (uint8_t)(g->rgb[a] / g->num + 0.5);
    }
    return p;
}

/* Once all points are in it. */
static void average_cell(cell *c, int shift)
{
    for (int side = 0; side < 2; side++) {
        if (c->sides[side].num == 0)
            continue;
        /* The support is twice the radius: three cells. */
        c->points[c->num] = average_of(&c->sides[side], 1.5 * ldexp(1, shift));
        c->extents[c->num] = (points_extent){karst_point_reach(c->points[c->num].radius), 0};
        c->num++;
    }
}

static double distance(const karst_point *a, const karst_point *b)
{
    double square = 0;
    for (int i = 0; i < 3; i++)
        square += ((double)a->at[i] - b->at[i]) * ((double)a->at[i] - b->at[i]);
    return sqrt(square);
}

static int32_t wider(int32_t than, double reach)
{
    return reach > than ? (int32_t)(reach < 0x1p30 ? reach : 0x1p30) : than;
}

/* Of averages, by each of the cell's points. */
static void widen_cell(cell *c, const karst_point *p, const points_extent *of)
{
    for (uint32_t i = 0; i < c->num; i++) {
        const double by = ceil(distance(p, &c->points[i]));
        c->extents[i].cover = wider(c->extents[i].cover, by + of->cover);
        c->extents[i].spread = wider(c->extents[i].spread, by + of->spread);
    }
}

/* ---- a level ---- */

typedef struct {
    points_import *import;
    points_level_files from;
    karst_points_level *level; /* what is written; num is how many are */
    int extents;
    int shift; /* a cell is 2^this units wide */
    double share;
    uint64_t next;       /* the point that the next block begins with */
    bool has_cell;       /* one that has begun and may go on: */
    uint64_t cell_first; /* its points begin here, */
    karst_point in_cell; /* and this is one */
    karst_point made[BLOCK]; /* that are not written yet */
    points_extent made_extents[BLOCK];
    uint32_t num_made;
} averaging;

typedef struct {
    karst_point points[BLOCK], made[BLOCK];
    points_extent extents[BLOCK], made_extents[BLOCK];
    uint32_t num_made; /* by whole cells */
    size_t num_first;  /* points of the first cell, which may have begun before */
    size_t last;       /* where the last cell begins, which may go on; 0: the first one is the last */
} level_slot;

static bool take_block(void *user, points_block *block, double *share, bool *any, karst_error *error)
{
    averaging *v = user;
    const uint64_t num = v->from.level->num;
    (void)error;
    block->begin = v->next;
    block->end = num - v->next < BLOCK ? num : v->next + BLOCK;
    v->next = block->end;
    *share = v->share;
    *any = block->end > block->begin;
    return true;
}

/* Averages the points of a cell that is whole. */
static void make_cell(const averaging *v, level_slot *slot, size_t begin, size_t end)
{
    cell c;
    memset(&c, 0, sizeof c);
    for (size_t i = begin; i < end; i++)
        add_to_cell(&c, &slot->points[i]);
    average_cell(&c, v->shift);
    for (size_t i = begin; i < end; i++)
        widen_cell(&c, &slot->points[i], &slot->extents[i]);
    for (uint32_t i = 0; i < c.num; i++) {
        slot->made[slot->num_made] = c.points[i];
        slot->made_extents[slot->num_made++] = c.extents[i];
    }
}

static bool average_block(void *user, points_block *block, karst_error *error)
{
    const averaging *v = user;
    level_slot *slot = block->slot;
    const size_t num = (size_t)(block->end - block->begin);
    if (!karst_points_read_level(&v->from, block->begin, num, slot->points, slot->extents, error))
        return false;
    slot->num_made = 0;
    slot->num_first = slot->last = 0;
    for (size_t begin = 0, end = 1; end <= num; end++) {
        if (end < num && same_cell(&slot->points[begin], &slot->points[end], v->shift))
            continue;
        if (begin == 0)
            slot->num_first = end;
        else if (end < num)
            make_cell(v, slot, begin, end);
        if (end == num)
            slot->last = begin;
        begin = end;
    }
    return true;
}

static bool flush(averaging *v, karst_error *error)
{
    const size_t num_bytes = v->num_made * sizeof *v->made;
    if (!karst_points_write(v->import, v->from.model, v->made, num_bytes,
                            v->level->offset + v->level->num * sizeof *v->made, error) ||
        !karst_points_write(v->import, v->extents, v->made_extents, v->num_made * sizeof *v->made_extents,
                            v->level->num * sizeof *v->made_extents, error))
        return false;
    v->level->sum = karst_points_sum(v->level->sum, v->made, num_bytes);
    v->level->num += v->num_made;
    v->num_made = 0;
    return true;
}

static bool put_made(averaging *v, const karst_point *points, const points_extent *extents, uint32_t num,
                     karst_error *error)
{
    for (uint32_t done = 0; done < num;) {
        if (v->num_made == BLOCK && !flush(v, error))
            return false;
        const uint32_t room = BLOCK - v->num_made, some = num - done < room ? num - done : room;
        memcpy(v->made + v->num_made, points + done, some * sizeof *points);
        memcpy(v->made_extents + v->num_made, extents + done, some * sizeof *extents);
        v->num_made += some;
        done += some;
    }
    return true;
}

/* The cell that has begun ends before a point. Its points are read again: nothing bounds how many those are. */

static bool end_cell(averaging *v, uint64_t end, karst_error *error)
{
    enum { SOME = 512 };
    karst_point points[SOME];
    points_extent extents[SOME];
    cell c;
    memset(&c, 0, sizeof c);
    for (int pass = 0; pass < 2 && v->has_cell; pass++) {
        for (uint64_t at = v->cell_first; at < end; at += SOME) {
            const size_t num = end - at < SOME ? (size_t)(end - at) : SOME;
            if (!karst_points_read_level(&v->from, at, num, points, extents, error))
                return false;
            for (size_t i = 0; i < num; i++)
                if (pass == 0)
                    add_to_cell(&c, &points[i]);
                else
                    widen_cell(&c, &points[i], &extents[i]);
        }
        if (pass == 0)
            average_cell(&c, v->shift);
    }
    v->has_cell = false;
    return put_made(v, c.points, c.extents, c.num, error);
}

static void begin_cell(averaging *v, uint64_t first, const karst_point *point)
{
    v->has_cell = true;
    v->cell_first = first;
    v->in_cell = *point;
}

static bool put_block(void *user, points_block *block, karst_error *error)
{
    averaging *v = user;
    const level_slot *slot = block->slot;
    if (!v->has_cell || !same_cell(&v->in_cell, &slot->points[0], v->shift)) {
        if (!end_cell(v, block->begin, error))
            return false;
        begin_cell(v, block->begin, &slot->points[0]);
    }
    if (slot->last == 0)
        return true;
    if (!end_cell(v, block->begin + slot->num_first, error) ||
        !put_made(v, slot->made, slot->made_extents, slot->num_made, error))
        return false;
    begin_cell(v, block->begin + slot->last, &slot->points[slot->last]);
    return true;
}

static bool add_level(averaging *v, uint32_t level, karst_error *error)
{
    const points_turns turns = {.loop = {.what = "levels"},
                                .slot_bytes = sizeof(level_slot),
                                .take = take_block,
                                .work = average_block,
                                .put = put_block};
    v->next = 0;
    v->has_cell = false;
    v->extents = karst_points_file(v->import, karst_points_extents_of(level), error);
    return v->extents >= 0 && karst_points_open_level(v->import, level - 1, &v->from, error) &&
           karst_points_in_turns(v->import, &turns, v, error) && end_cell(v, v->from.level->num, error) &&
           flush(v, error);
}

bool karst_points_add_levels(points_import *import, karst_error *error)
{
    karst_points_head *head = import->head;
    averaging *v = calloc(1, sizeof *v);
    bool done = v || karst_fail(error, KARST_FAILED, "out of memory");
    int shift = 0;
    while (ldexp(1, shift) < 1.3 * (double)head->levels[0].spacing)
        shift++;
    shift += (int)head->num_levels - 1; /* some are there where an import goes on */
    if (done)
        v->import = import;
    for (; done && shift < 27 && head->num_levels < KARST_POINTS_MAX_LEVELS; shift++) {
        const karst_points_level *from = &head->levels[head->num_levels - 1];
        if (from->num <= FEW_POINTS)
            break;
        v->shift = shift;
        v->share = 1 - (double)from->num / (double)head->levels[0].num;
        v->level = &head->levels[head->num_levels];
        *v->level = (karst_points_level){.offset = karst_points_level_end(from), .spacing = (uint64_t)1 << shift};
        done = add_level(v, head->num_levels, error) && karst_points_add_tree(import, head->num_levels, error);
        head->num_levels += done;
        done = done && karst_points_checkpoint(import, error);
    }
    free(v);
    return done;
}
