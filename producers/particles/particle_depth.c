/* How deep a ray is in particles: balls are met where they are. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "producers/particles/particle_internal.h"

/* A ray's way through a ball of a union. */
typedef struct {
    double begin, end, extinction;
} interval;

static int compare_begins(const void *a, const void *b)
{
    const interval *p = a, *q = b;
    return (p->begin > q->begin) - (p->begin < q->begin);
}

/* ---- a heap of intervals, the largest extinction on top ---- */

static void push(interval *heap, uint32_t *num, interval value)
{
    uint32_t i = (*num)++;
    for (; i > 0 && heap[(i - 1) / 2].extinction < value.extinction; i = (i - 1) / 2)
        heap[i] = heap[(i - 1) / 2];
    heap[i] = value;
}

static void pop(interval *heap, uint32_t *num)
{
    const interval last = heap[--*num];
    uint32_t i = 0;
    for (uint32_t child; (child = 2 * i + 1) < *num; i = child) {
        child += child + 1 < *num && heap[child + 1].extinction > heap[child].extinction;
        if (heap[child].extinction <= last.extinction)
            break;
        heap[i] = heap[child];
    }
    heap[i] = last;
}

/* The integral of the largest extinction among the intervals that hold a place, from begin to begin. */
static double depth_of_union(interval *all, uint32_t num, interval *heap)
{
    double depth = 0, t = 0;
    uint32_t next = 0, num_open = 0;
    qsort(all, num, sizeof *all, compare_begins);
    while (next < num || num_open > 0) {
        if (num_open == 0)
            t = fmax(t, all[next].begin);
        while (next < num && all[next].begin <= t)
            push(heap, &num_open, all[next++]);
        while (num_open > 0 && heap[0].end <= t)
            pop(heap, &num_open);
        if (num_open == 0)
            continue;
        const double to = next < num ? fmin(heap[0].end, all[next].begin) : heap[0].end;
        depth += heap[0].extinction * (to - t);
        t = to;
    }
    return depth;
}

/* The integral of (1 - (d/r)^2)^2 from s = a to b, where s is counted from where the ray is nearest to the centre, and
 * half the chord is h long: there 1 - (d/r)^2 = (h^2 - s^2) / r^2. */
static double soft_way(double a, double b, double half_square, double radius)
{
    const double fourth = half_square * half_square, r4 = radius * radius * radius * radius;
    const double at_a = fourth * a - 2 * half_square * a * a * a / 3 + a * a * a * a * a / 5,
                 at_b = fourth * b - 2 * half_square * b * b * b / 3 + b * b * b * b * b / 5;
    return (at_b - at_a) / r4;
}

bool karst_particle_list_depth(const karst_particle_list *list, const karst_position *from, const double direction[3],
                               double length_m, double *depth, karst_error *error)
{
    const karst_position origin = {.voxel = {list->origin[0], list->origin[1], list->origin[2]}};
    interval *all = malloc((list->num + 1) * sizeof *all), *heap = malloc((list->num + 1) * sizeof *heap);
    double start[3];
    uint32_t num = 0;
    *depth = 0;
    if (!all || !heap) {
        free(all);
        free(heap);
        return karst_fail(error, KARST_FAILED, "out of memory for %u particles", list->num);
    }
    karst_position_difference_m(origin, *from, list->voxel_log2_m, start);
    for (uint32_t i = 0; i < list->num; i++) {
        const karst_ball *ball = &list->balls[i];
        double to[3], along = 0, aside = 0;
        for (int a = 0; a < 3; a++) {
            to[a] = ball->at_m[a] - start[a];
            along += to[a] * direction[a];
        }
        for (int a = 0; a < 3; a++) {
            const double off = to[a] - along * direction[a];
            aside += off * off;
        }
        const double half_square = ball->radius_m * ball->radius_m - aside;
        if (!(half_square > 0))
            continue;
        const double half = sqrt(half_square), begin = fmax(along - half, 0), end = fmin(along + half, length_m);
        if (!(begin < end))
            continue;
        if (ball->is_sum)
            *depth += ball->extinction * soft_way(begin - along, end - along, half_square, ball->radius_m);
        else
            all[num++] = (interval){begin, end, ball->extinction};
    }
    *depth += depth_of_union(all, num, heap);
    free(all);
    free(heap);
    return true;
}
