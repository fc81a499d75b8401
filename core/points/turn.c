/* Turning normals outwards: from neighbour to neighbour, where they differ least first (Hoppe's spanning tree, grown by
 * Prim's rule with weights in 256 steps), and each connected part so that its topmost point faces up. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define NUM_STEPS 256u

/* Who waits at a step: points, and whom they would follow. */
typedef struct {
    uint64_t *waiting;
    size_t num, capacity;
} queue;

typedef struct {
    uint32_t topmost;
    int32_t height;
} part;

typedef struct {
    karst_point *points;
    uint32_t num;
    const uint32_t *links;
    uint32_t *part_of;
    queue queues[NUM_STEPS];
    uint32_t lowest; /* no queue before has anybody */
    part *parts;
    uint32_t num_parts, max_parts;
} turning;

static double dot(const karst_point *a, const karst_point *b)
{
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (double)a->normal[i] * b->normal[i];
    return sum / (32767.0 * 32767.0);
}

static void turn_over(karst_point *p)
{
    for (int a = 0; a < 3; a++)
        p->normal[a] = (int16_t)-p->normal[a];
}

static bool push(turning *t, uint32_t point, uint32_t leader)
{
    double apart = 1 - fabs(dot(&t->points[point], &t->points[leader]));
    uint32_t step = apart > 0 ? (uint32_t)(sqrt(fmin(apart, 1)) * (NUM_STEPS - 1)) : 0;
    queue *q = &t->queues[step];
    if (q->num == q->capacity) {
        size_t capacity = q->capacity ? 2 * q->capacity : 64;
        uint64_t *grown = realloc(q->waiting, capacity * sizeof *grown);
        if (!grown)
            return false;
        q->waiting = grown;
        q->capacity = capacity;
    }
    q->waiting[q->num++] = (uint64_t)leader << 32 | point;
    t->lowest = step < t->lowest ? step : t->lowest;
    return true;
}

/* Takes a point into a part, with its normal as it is; its neighbours follow. */
static bool reach(turning *t, uint32_t point, uint32_t number)
{
    part *of = &t->parts[number];
    t->part_of[point] = number + 1; /* 0: not reached */
    if (t->points[point].at[1] > of->height) {
        of->height = t->points[point].at[1];
        of->topmost = point;
    }
    const uint32_t *links = t->links + (size_t)point * POINTS_LINKS;
    for (int k = 0; k < POINTS_LINKS; k++)
        if (links[k] != UINT32_MAX && !t->part_of[links[k]] && !push(t, links[k], point))
            return false;
    return true;
}

static bool follow(turning *t, uint32_t point, uint32_t leader)
{
    if (dot(&t->points[point], &t->points[leader]) < 0)
        turn_over(&t->points[point]);
    return reach(t, point, t->part_of[leader] - 1);
}

/* A point that nobody's links led to: it follows its nearest neighbour that is in a part, or begins one. */
static bool begin(turning *t, uint32_t point)
{
    const uint32_t *links = t->links + (size_t)point * POINTS_LINKS;
    for (int k = 0; k < POINTS_LINKS; k++)
        if (links[k] != UINT32_MAX && t->part_of[links[k]])
            return follow(t, point, links[k]);
    if (t->num_parts == t->max_parts) {
        uint32_t most = t->max_parts ? 2 * t->max_parts : 64;
        part *grown = realloc(t->parts, most * sizeof *grown);
        if (!grown)
            return false;
        t->parts = grown;
        t->max_parts = most;
    }
    t->parts[t->num_parts++] = (part){.topmost = point, .height = INT32_MIN};
    return reach(t, point, t->num_parts - 1);
}

static bool follow_all(turning *t)
{
    while (t->lowest < NUM_STEPS) {
        queue *q = &t->queues[t->lowest];
        if (q->num == 0) {
            t->lowest++;
            continue;
        }
        uint64_t next = q->waiting[--q->num];
        if (!t->part_of[(uint32_t)next] && !follow(t, (uint32_t)next, (uint32_t)(next >> 32)))
            return false;
    }
    return true;
}

/* Parts whose topmost point faces down are inside out; and how many neighbours do not agree in the end. */
static double finish(turning *t)
{
    uint64_t num_unsure = 0, num_pairs = 0;
    for (uint32_t i = 0; i < t->num_parts; i++)
        t->parts[i].height = t->points[t->parts[i].topmost].normal[1] < 0; /* from now on: whether it turns */
    for (uint32_t i = 0; i < t->num; i++)
        if (t->parts[t->part_of[i] - 1].height)
            turn_over(&t->points[i]);
    for (uint32_t i = 0; i < t->num; i++)
        for (int k = 0; k < POINTS_LINKS; k++) {
            uint32_t other = t->links[(size_t)i * POINTS_LINKS + (size_t)k];
            if (other == UINT32_MAX)
                continue;
            num_pairs++;
            num_unsure += dot(&t->points[i], &t->points[other]) < 0;
        }
    return num_pairs ? (double)num_unsure / (double)num_pairs : 0;
}

bool karst_points_turn_together(points_import *import, karst_point *points, uint32_t num, const uint32_t *links,
                                karst_error *error)
{
    turning *t = calloc(1, sizeof *t);
    size_t part_bytes = (size_t)num * sizeof(uint32_t);
    bool done = t || karst_fail(error, KARST_FAILED, "out of memory");
    if (done) {
        *t = (turning){.points = points, .num = num, .links = links, .lowest = NUM_STEPS};
        t->part_of = karst_points_scratch_map(import, part_bytes, error);
        done = t->part_of != NULL;
    }
    for (uint32_t i = 0; done && i < num; i++) {
        if (i % 65536 == 0 && !karst_points_go_on(import, "turning normals", (double)i / num, error))
            done = false;
        else if (!t->part_of[i])
            done = (begin(t, i) && follow_all(t)) || karst_fail(error, KARST_FAILED, "out of memory for normals");
    }
    if (done) {
        import->head.share_unsure = finish(t);
        import->head.num_parts = t->num_parts;
    }
    for (uint32_t i = 0; t && i < NUM_STEPS; i++)
        free(t->queues[i].waiting);
    if (t) {
        free(t->parts);
        karst_points_unmap(t->part_of, part_bytes);
    }
    free(t);
    return done;
}

void karst_points_turn_like_given(karst_point *points, uint32_t num, const uint32_t *links)
{
    /* Those farther from any that had one follow in later rounds, and what is never reached stays as it is. */
    for (bool any = true; any;) {
        any = false;
        for (uint32_t i = 0; i < num; i++) {
            double sum = 0;
            bool knows = false;
            for (int k = 0; k < POINTS_LINKS && points[i].is_found; k++) {
                uint32_t other = links[(size_t)i * POINTS_LINKS + (size_t)k];
                if (other == UINT32_MAX || points[other].is_found)
                    continue;
                knows = true;
                sum += dot(&points[i], &points[other]);
            }
            if (!knows)
                continue;
            if (sum < 0)
                turn_over(&points[i]);
            points[i].is_found = 0;
            any = true;
        }
    }
}

void karst_points_turn_up(karst_point *points, uint32_t num)
{
    for (uint32_t i = 0; i < num; i++)
        if (points[i].normal[1] < 0)
            turn_over(&points[i]);
}
