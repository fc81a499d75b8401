/* Turning normals outwards: from neighbour to neighbour, where they differ least first (Hoppe's spanning tree, grown by
 * Prim's rule with weights in 256 steps), and each connected part so that its topmost point faces up. Points are only
 * read: what turns over is noted beside them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define NUM_STEPS 256u
#define OFTEN 65536u        /* points between two looks at progress and memory */
#define OFTEN_ANYWHERE 256u /* the latter where points follow one another anywhere: each may map 1 MiB of pages */

typedef struct {
    uint32_t topmost;
    int32_t height;
} part;

typedef struct {
    points_import *import;
    karst_error *error;
    const karst_point *points;
    uint32_t num;
    const uint32_t *links;
    uint32_t *turns;        /* of each point: its part's number + 1, 0: not reached; and POINTS_TURNS_OVER */
    points_stacks *waiting; /* at each step: points, and whom they would follow */
    uint32_t lowest;        /* no step before has anybody */
    uint32_t num_reached;
    part *parts;
    uint32_t num_parts, max_parts;
} turning;

/* How two normals agree as they are turned. */
static double dot(const turning *t, uint32_t a, uint32_t b)
{
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (double)t->points[a].normal[i] * t->points[b].normal[i];
    return ((t->turns[a] ^ t->turns[b]) & POINTS_TURNS_OVER ? -sum : sum) / (32767.0 * 32767.0);
}

static const uint32_t *links_of(const turning *t, uint32_t point) { return t->links + (size_t)point * POINTS_LINKS; }

static bool push(turning *t, uint32_t point, uint32_t leader)
{
    double apart = 1 - fabs(dot(t, point, leader));
    uint32_t step = apart > 0 ? (uint32_t)(sqrt(fmin(apart, 1)) * (NUM_STEPS - 1)) : 0;
    t->lowest = step < t->lowest ? step : t->lowest;
    return karst_points_push(t->waiting, step, (uint64_t)leader << 32 | point, t->error);
}

/* Takes a point into a part; its neighbours follow. */
static bool reach(turning *t, uint32_t point, uint32_t number, bool over)
{
    part *of = &t->parts[number];
    t->turns[point] = (number + 1) | (over ? POINTS_TURNS_OVER : 0);
    if (t->points[point].at[1] > of->height) {
        of->height = t->points[point].at[1];
        of->topmost = point;
    }
    if (++t->num_reached % OFTEN_ANYWHERE == 0)
        karst_points_stay_small(t->import);
    if (t->num_reached % OFTEN == 0) {
        if (!karst_points_go_on(t->import, "turning normals", (double)t->num_reached / t->num, t->error))
            return false;
    }
    const uint32_t *links = links_of(t, point);
    for (int k = 0; k < POINTS_LINKS; k++)
        if (links[k] != UINT32_MAX && !t->turns[links[k]] && !push(t, links[k], point))
            return false;
    return true;
}

static bool follow(turning *t, uint32_t point, uint32_t leader)
{
    const uint32_t of = t->turns[leader];
    return reach(t, point, (of & ~POINTS_TURNS_OVER) - 1, dot(t, point, leader) < 0);
}

/* A point that nobody's links led to: it follows its nearest neighbour that is in a part, or begins one. */
static bool begin(turning *t, uint32_t point)
{
    const uint32_t *links = links_of(t, point);
    for (int k = 0; k < POINTS_LINKS; k++)
        if (links[k] != UINT32_MAX && t->turns[links[k]])
            return follow(t, point, links[k]);
    if (t->num_parts == t->max_parts) {
        uint32_t most = t->max_parts ? 2 * t->max_parts : 64;
        part *grown = realloc(t->parts, most * sizeof *grown);
        if (!grown)
            return karst_fail(t->error, KARST_FAILED, "out of memory for normals");
        t->parts = grown;
        t->max_parts = most;
    }
    t->parts[t->num_parts++] = (part){.topmost = point, .height = INT32_MIN};
    return reach(t, point, t->num_parts - 1, false);
}

static bool follow_all(turning *t)
{
    while (t->lowest < NUM_STEPS) {
        uint64_t next;
        bool has;
        if (!karst_points_pop(t->waiting, t->lowest, &next, &has, t->error))
            return false;
        if (!has)
            t->lowest++;
        else if (!t->turns[(uint32_t)next] && !follow(t, (uint32_t)next, (uint32_t)(next >> 32)))
            return false;
    }
    return true;
}

/* Parts whose topmost point faces down are inside out; and how many neighbours do not agree in the end. */
static bool finish(turning *t, double *share)
{
    uint64_t num_unsure = 0, num_pairs = 0;
    for (uint32_t i = 0; i < t->num_parts; i++) {
        const uint32_t top = t->parts[i].topmost;
        const int16_t up = t->points[top].normal[1];
        t->parts[i].height = (t->turns[top] & POINTS_TURNS_OVER ? -up : up) < 0; /* from now on: whether it turns */
    }
    for (uint32_t i = 0; i < t->num; i++) { /* who agrees with whom does not depend on that: they are of one part */
        for (int k = 0; k < POINTS_LINKS; k++) {
            const uint32_t other = links_of(t, i)[k];
            if (other == UINT32_MAX)
                continue;
            num_pairs++;
            num_unsure += dot(t, i, other) < 0;
        }
        if (i % OFTEN == 0) {
            karst_points_stay_small(t->import);
            if (!karst_points_go_on(t->import, "looking at normals", (double)i / t->num, t->error))
                return false;
        }
    }
    for (uint32_t i = 0; i < t->num; i++) {
        if (t->parts[(t->turns[i] & ~POINTS_TURNS_OVER) - 1].height)
            t->turns[i] ^= POINTS_TURNS_OVER;
        if (i % OFTEN == 0)
            karst_points_stay_small(t->import);
    }
    *share = num_pairs ? (double)num_unsure / (double)num_pairs : 0;
    return true;
}

static bool turn_together(turning *t)
{
    t->waiting = karst_points_stacks_create(t->import, NUM_STEPS, t->error);
    bool done = t->waiting != NULL;
    for (uint32_t i = 0; done && i < t->num; i++)
        if (!t->turns[i])
            done = begin(t, i) && follow_all(t);
    done = done && finish(t, &t->import->head->share_unsure);
    t->import->head->num_parts = t->num_parts;
    karst_points_stacks_destroy(t->waiting);
    free(t->parts);
    return done;
}

/* Whether the file has a point's normal, or it has been turned as those around. */
#define KNOWN 1u

/* The few that had none: as those of their neighbours that had one. */
static bool turn_like_given(turning *t)
{
    for (uint32_t i = 0; i < t->num; i++)
        t->turns[i] = t->points[i].is_found ? 0 : KNOWN;
    /* Those farther from any that had one follow in later rounds, and what is never reached stays as it is. */
    for (bool any = true; any;) {
        any = false;
        for (uint32_t i = 0; i < t->num; i++) {
            double sum = 0;
            bool knows = false;
            for (int k = 0; k < POINTS_LINKS && !t->turns[i]; k++) {
                const uint32_t other = links_of(t, i)[k];
                if (other == UINT32_MAX || !t->turns[other])
                    continue;
                knows = true;
                sum += dot(t, i, other);
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

static bool turn_up(turning *t)
{
    for (uint32_t i = 0; i < t->num; i++) {
        t->turns[i] = t->points[i].normal[1] < 0 ? POINTS_TURNS_OVER : 0;
        if (i % OFTEN == 0)
            karst_points_stay_small(t->import);
    }
    return true;
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
        done = turn_up(&t);
    else if (done)
        done = turn_together(&t);
    karst_points_unmap(import, t.turns);
    karst_points_unmap(import, (void *)t.links);
    karst_points_unmap(import, (void *)t.points);
    return done;
}
