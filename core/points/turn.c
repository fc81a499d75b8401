/* Turning normals outwards: from neighbour to neighbour, where they differ least first (Hoppe's spanning tree, grown by
 * Prim's rule with weights in 256 steps), and each connected part so that its top faces up. Points are only read: what
 * turns over is noted beside them.
 *
 * Who comes next depends on all who came before, so one thread alone goes from point to point. Whatever does not depend
 * on that is done by all threads, before: how normals differ; and after: how many agree. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define NUM_STEPS 256u
#define BLOCK 16384u        /* points that a thread takes at a time */
#define OFTEN 65536u        /* points between two looks at progress and memory */
#define OFTEN_ANYWHERE 256u /* the latter where points follow one another anywhere: each may map 1 MiB of pages */

#define TOP_LOG2 3 /* a part's top is so many times as high as its topmost point's support, by powers of two */

/* Normals whose cosine is less stand on either side of an edge; what is more may be noise of one face. */
#define SAME_FACE 0.5

/* How a point's normal and those of its neighbours differ, as they were found. */
typedef struct {
    uint8_t steps[POINTS_LINKS]; /* 0: they are parallel; the last one: at right angles, so that neither turns */
    int32_t height;              /* of the point */
    uint8_t apart;               /* a bit for each neighbour: they face apart */
    int8_t up;                   /* of the normal, times 127 */
    uint8_t reach_log2;          /* of its support, rounded up; units */
    uint8_t pad;
} bends;
_Static_assert(POINTS_LINKS == 8 && sizeof(bends) == 16, "four to a cache line");

typedef struct {
    int32_t height; /* of its topmost point */
    int top_log2;   /* how far its top reaches down from there */
    int64_t up;     /* of the normals there, as they were turned, each times how high it lies: their sum */
} part;

typedef struct {
    points_import *import;
    karst_error *error;
    const karst_point *points;
    uint32_t num;
    const uint32_t *links;
    int to;
    const bends *differ;
    uint32_t *turns;        /* of each point: its part's number + 1, 0: not reached; and POINTS_TURNS_OVER */
    points_stacks *waiting; /* at each step: points, and POINTS_TURNS_OVER if they would turn over; all of one part */
    uint32_t lowest;        /* no step before has anybody */
    uint32_t num_reached;
    part *parts;
    uint32_t num_parts, max_parts;
    uint64_t num_unsure, num_pairs;
} turning;

static const uint32_t *links_of(const turning *t, uint32_t point) { return t->links + (size_t)point * POINTS_LINKS; }

/* How two normals agree as they were found, times 32767^2: exact. */
static double dot(const turning *t, uint32_t a, uint32_t b)
{
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (double)t->points[a].normal[i] * t->points[b].normal[i];
    return sum;
}

/* The same, of one of them and the mirror image of the other in the plane midway between both. Where faces meet at less
 * than a right angle, their normals as such would turn one of them inside out; but at places as far from the edge on
 * either side they are mirror images, whatever the angle. */
static double dot_mirrored(const turning *t, uint32_t a, uint32_t b)
{
    double of_a = 0, of_b = 0, square = 0;
    for (int i = 0; i < 3; i++) {
        const double way = (double)t->points[b].at[i] - t->points[a].at[i];
        of_a += t->points[a].normal[i] * way;
        of_b += t->points[b].normal[i] * way;
        square += way * way;
    }
    return dot(t, a, b) - (square > 0 ? 2 * of_a * of_b / square : 0);
}

static bool in_parallel(turning *t, const char *what, karst_points_work work)
{
    const points_loop loop = {what, 0, t->num, t->num, BLOCK, true};
    return karst_points_in_parallel(t->import, &loop, work, t, t->error);
}

/* ---- how normals differ ---- */

static bool compare(void *user, points_block *block, karst_error *error)
{
    const turning *t = user;
    bends *made = block->slot;
    (void)error;
    for (uint32_t i = (uint32_t)block->begin; i < block->end; i++) {
        const uint32_t *links = links_of(t, i);
        bends of = {.height = t->points[i].at[1], .up = (int8_t)(t->points[i].normal[1] / 258)};
        while (of.reach_log2 < 30 && 1 << of.reach_log2 < karst_point_reach(t->points[i].radius))
            of.reach_log2++;
        double sums[POINTS_LINKS], steps[POINTS_LINKS];
        for (int k = 0; k < POINTS_LINKS; k++)
            sums[k] = dot(t, i, links[k] != UINT32_MAX ? links[k] : i);
        for (int k = 0; k < POINTS_LINKS; k++)
            if (fabs(sums[k]) < SAME_FACE * (32767.0 * 32767.0) && links[k] != UINT32_MAX)
                sums[k] = dot_mirrored(t, i, links[k]);
        for (int k = 0; k < POINTS_LINKS; k++) { /* all together, as vectors */
            const double apart = 1 - fabs(sums[k] / (32767.0 * 32767.0));
            steps[k] = sqrt(apart > 0 ? apart : 0) * (NUM_STEPS - 1);
        }
        for (int k = 0; k < POINTS_LINKS; k++) {
            of.steps[k] = (uint8_t)steps[k];
            of.apart |= (uint8_t)((sums[k] < 0) << k);
        }
        *made++ = of;
    }
    return true;
}

static bool put_bends(void *user, points_block *block, karst_error *error)
{
    const turning *t = user;
    return karst_points_write(t->import, t->to, block->slot, (block->end - block->begin) * sizeof(bends),
                              block->begin * sizeof(bends), error);
}

/* Once that is noted, points are not looked at any more. */
static bool compare_all(turning *t)
{
    const points_turns turns = {.loop = {"turning normals", 0, t->num, t->num, BLOCK, true},
                                .slot_bytes = BLOCK * sizeof(bends),
                                .work = compare,
                                .put = put_bends};
    t->to = karst_points_file(t->import, POINTS_BENDS, t->error);
    if (t->to < 0 || !karst_points_in_turns(t->import, &turns, t, t->error))
        return false;
    karst_points_unmap(t->import, (void *)t->points);
    t->points = NULL;
    t->differ = karst_points_map_file(t->import, POINTS_BENDS, t->num * sizeof *t->differ, false, t->error);
    return t->differ != NULL;
}

/* Whether a point turns over that follows another one by link `k` of either. */
static bool turns_over(const bends *of, int k, bool leader_over)
{
    return of->steps[k] < NUM_STEPS - 1 && ((of->apart >> k & 1) != 0) != leader_over;
}

/* ---- from neighbour to neighbour ---- */

/* Takes a point into a part; its neighbours follow. */
static bool reach(turning *t, uint32_t point, uint32_t number, bool over)
{
    part *in = &t->parts[number];
    const bends *of = &t->differ[point];
    t->turns[point] = (number + 1) | (over ? POINTS_TURNS_OVER : 0);
    if (of->height > in->height) {
        in->height = of->height;
        in->top_log2 = of->reach_log2 + TOP_LOG2;
    }
    if (++t->num_reached % OFTEN_ANYWHERE == 0)
        karst_points_stay_small(t->import);
    if (t->num_reached % OFTEN == 0) {
        if (!karst_points_go_on(t->import, "turning normals", (double)t->num_reached / t->num, t->error))
            return false;
    }
    const uint32_t *links = links_of(t, point);
    for (int k = 0; k < POINTS_LINKS && links[k] != UINT32_MAX; k++) {
        if (t->turns[links[k]])
            continue;
        const uint32_t step = of->steps[k], next = links[k] | (turns_over(of, k, over) ? POINTS_TURNS_OVER : 0);
        t->lowest = step < t->lowest ? step : t->lowest;
        if (!karst_points_push(t->waiting, step, next, t->error))
            return false;
    }
    return true;
}

/* A point that nobody's links led to: it follows its nearest neighbour that is in a part, or begins one. *number: of
 * the part. */
static bool begin(turning *t, uint32_t point, uint32_t *number)
{
    const uint32_t *links = links_of(t, point);
    for (int k = 0; k < POINTS_LINKS && links[k] != UINT32_MAX; k++) {
        const uint32_t leader = t->turns[links[k]];
        if (!leader)
            continue;
        *number = (leader & ~POINTS_TURNS_OVER) - 1;
        return reach(t, point, *number, turns_over(&t->differ[point], k, (leader & POINTS_TURNS_OVER) != 0));
    }
    if (t->num_parts == t->max_parts) {
        uint32_t most = t->max_parts ? 2 * t->max_parts : 64;
        part *grown = realloc(t->parts, most * sizeof *grown);
        if (!grown)
            return karst_fail(t->error, KARST_FAILED, "out of memory for normals");
        t->parts = grown;
        t->max_parts = most;
    }
    *number = t->num_parts++;
    t->parts[*number] = (part){.height = INT32_MIN};
    return reach(t, point, *number, false);
}

static bool follow_all(turning *t, uint32_t number)
{
    while (t->lowest < NUM_STEPS) {
        uint32_t next;
        bool has;
        if (!karst_points_pop(t->waiting, t->lowest, &next, &has, t->error))
            return false;
        const uint32_t point = next & ~POINTS_TURNS_OVER;
        if (!has)
            t->lowest++;
        else if (!t->turns[point] && !reach(t, point, number, (next & POINTS_TURNS_OVER) != 0))
            return false;
    }
    return true;
}

/* ---- what came of it ---- */

/* Counts neighbours that do not agree in the end, and sums up how tops of parts face. The former does not depend on
 * which parts turn: they are of one. */
static void count_unsure(void *user, uint64_t begin, uint64_t end)
{
    turning *t = user;
    uint64_t num_unsure = 0, num_pairs = 0;
    for (uint32_t i = (uint32_t)begin; i < end; i++) {
        const uint32_t *links = links_of(t, i);
        const bool is_over = (t->turns[i] & POINTS_TURNS_OVER) != 0;
        part *in = &t->parts[(t->turns[i] & ~POINTS_TURNS_OVER) - 1];
        const int64_t high = t->differ[i].height - ((int64_t)in->height - ((int64_t)1 << in->top_log2));
        const int64_t up = t->differ[i].up * (high >> (in->top_log2 > 8 ? in->top_log2 - 8 : 0));
        if (high > 0)
            __atomic_fetch_add(&in->up, is_over ? -up : up, __ATOMIC_RELAXED);
        for (int k = 0; k < POINTS_LINKS && links[k] != UINT32_MAX; k++) {
            num_pairs++;
            num_unsure += turns_over(&t->differ[i], k, ((t->turns[i] ^ t->turns[links[k]]) & POINTS_TURNS_OVER) != 0);
        }
    }
    __atomic_fetch_add(&t->num_unsure, num_unsure, __ATOMIC_RELAXED);
    __atomic_fetch_add(&t->num_pairs, num_pairs, __ATOMIC_RELAXED);
}

static void turn_parts(void *user, uint64_t begin, uint64_t end)
{
    const turning *t = user;
    for (uint32_t i = (uint32_t)begin; i < end; i++)
        if (t->parts[(t->turns[i] & ~POINTS_TURNS_OVER) - 1].up < 0)
            t->turns[i] ^= POINTS_TURNS_OVER;
}

/* Parts whose tops face down are inside out. The topmost point alone would not tell: where it lies on a ridge or a tip
 * its normal is level, and noise says whether it faces up. Around a closed body what faces up, times how high it lies,
 * is more than what faces down, whatever its shape (divergence theorem). */
static bool finish(turning *t)
{
    bool any = false;
    if (!in_parallel(t, "looking at normals", count_unsure))
        return false;
    for (uint32_t i = 0; i < t->num_parts; i++)
        any = any || t->parts[i].up < 0;
    t->import->head->share_unsure = t->num_pairs ? (double)t->num_unsure / (double)t->num_pairs : 0;
    return !any || in_parallel(t, "looking at normals", turn_parts);
}

static bool turn_together(turning *t)
{
    bool done = compare_all(t);
    t->waiting = done ? karst_points_stacks_create(t->import, NUM_STEPS, t->error) : NULL;
    done = t->waiting != NULL;
    for (uint32_t i = 0, number = 0; done && i < t->num; i++)
        if (!t->turns[i])
            done = begin(t, i, &number) && follow_all(t, number);
    done = done && finish(t);
    t->import->head->num_parts = t->num_parts;
    karst_points_stacks_destroy(t->waiting);
    karst_points_unmap(t->import, (void *)t->differ);
    free(t->parts);
    return done;
}

/* ---- other ways ---- */

/* Whether the file has a point's normal, or it has been turned as those around. */
#define KNOWN 1u

static void note_given(void *user, uint64_t begin, uint64_t end)
{
    const turning *t = user;
    for (uint32_t i = (uint32_t)begin; i < end; i++)
        t->turns[i] = t->points[i].is_found ? 0 : KNOWN;
}

/* The few that had none: as those of their neighbours that had one. */
static bool turn_like_given(turning *t)
{
    bool any = in_parallel(t, "turning normals", note_given);
    if (!any)
        return false;
    /* Those farther from any that had one follow in later rounds, and what is never reached stays as it is. */
    while (any) {
        any = false;
        for (uint32_t i = 0; i < t->num; i++) {
            double sum = 0;
            bool knows = false;
            for (int k = 0; k < POINTS_LINKS && !t->turns[i]; k++) {
                const uint32_t other = links_of(t, i)[k];
                if (other == UINT32_MAX || !t->turns[other])
                    continue;
                knows = true;
                const double agrees = dot(t, i, other) / (32767.0 * 32767.0);
                sum += t->turns[other] & POINTS_TURNS_OVER ? -agrees : agrees;
            }
            if (knows)
                t->turns[i] = KNOWN | (sum < 0 ? POINTS_TURNS_OVER : 0);
            any = any || knows;
            if (i % OFTEN == 0) {
                karst_points_stay_small(t->import);
                if (!karst_points_go_on(t->import, "turning normals", (double)i / t->num, t->error))
                    return false;
            }
        }
    }
    return true;
}

static void note_up(void *user, uint64_t begin, uint64_t end)
{
    const turning *t = user;
    for (uint32_t i = (uint32_t)begin; i < end; i++)
        t->turns[i] = t->points[i].normal[1] < 0 ? POINTS_TURNS_OVER : 0;
}

bool karst_points_turn_normals(points_import *import, karst_error *error)
{
    const uint32_t num = (uint32_t)import->now.num;
    const bool has_normals = import->head->flags & KARST_POINTS_HAS_GIVEN_NORMALS;
    turning t = {.import = import, .error = error, .num = num, .lowest = NUM_STEPS};
    t.points = karst_points_map_file(import, karst_points_in_order(import), num * sizeof *t.points, false, error);
    t.links = t.points ? karst_points_map_file(import, POINTS_NEAR, (size_t)num * POINTS_LINKS * sizeof *t.links, false,
                                               error)
                       : NULL;
    t.turns = t.links ? karst_points_map_file(import, POINTS_TURNS, num * sizeof *t.turns, true, error) : NULL;
    bool done = t.turns != NULL;
    if (done && has_normals)
        done = turn_like_given(&t);
    else if (done && import->config->turn == KARST_POINTS_TURN_UP)
        done = in_parallel(&t, "turning normals", note_up);
    else if (done)
        done = turn_together(&t);
    karst_points_unmap(import, t.turns);
    karst_points_unmap(import, (void *)t.links);
    karst_points_unmap(import, (void *)t.points);
    return done;
}
