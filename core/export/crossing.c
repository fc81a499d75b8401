#include "core/export/crossing.h"

#include <math.h>

/* Even a jump is found by then: each fourth step halves what is left. */
#define MAX_STEPS 56
#define AT_ONCE 512

/* What is known of a segment, along which t goes from 0 (solid) to 1: of its ends, the air's first. Steps are written
 * without branches on what is found, which nothing could foresee. */
typedef struct {
    double t[2], length, next_t;
    float density[2], weight[2]; /* the same, halved where that end has not moved twice in a row */
    int last_end;                /* -1: none has moved */
} bracket;
enum { AIR, SOLID };

static void place(const karst_segment *s, double t, double at[3])
{
    for (int axis = 0; axis < 3; axis++)
        at[axis] = s->from[axis] + t * (s->to[axis] - s->from[axis]);
}

static double between(double solid, double air)
{
    const double share = solid / (solid - air);
    return isfinite(share) ? share : 0.5;
}

static bool is_narrow(const bracket *b) { return (b->t[AIR] - b->t[SOLID]) * b->length <= KARST_CROSSING_WITHIN; }

static void choose_next(bracket *b, int step)
{
    const double width = b->t[AIR] - b->t[SOLID], least = 0.4 * KARST_CROSSING_WITHIN / b->length;
    double t = b->t[SOLID] + width * between((double)b->weight[SOLID], (double)b->weight[AIR]);
    /* A little farther than the surface should be from the nearer end: so the other one comes near, too. */
    const int is_nearer_solid = t - b->t[SOLID] < b->t[AIR] - t;
    t += (2 * is_nearer_solid - 1) * least;
    if (step % 4 == 3)
        t = b->t[SOLID] + width / 2;
    const double first = b->t[SOLID] + least, last = b->t[AIR] - least;
    t = t > first ? t : first;
    b->next_t = t < last ? t : last;
}

static void learn(bracket *b, float density)
{
    const int end = density > 0; /* AIR or SOLID */
    const float share[2] = {1, 0.5f};
    b->t[end] = b->next_t;
    b->density[end] = b->weight[end] = density;
    b->weight[!end] *= share[b->last_end == end];
    b->last_end = end;
}

static uint64_t find_some(karst_sampler *sampler, const karst_grid *grid, karst_segment *segments, size_t num,
                          karst_position *positions, float *densities)
{
    bracket brackets[AT_ONCE];
    uint16_t open[AT_ONCE];
    size_t num_open = 0;
    uint64_t num_samples = 0;
    for (size_t i = 0; i < num; i++) {
        const karst_segment *s = &segments[i];
        double square = 0;
        for (int axis = 0; axis < 3; axis++)
            square += (s->to[axis] - s->from[axis]) * (s->to[axis] - s->from[axis]);
        brackets[i] = (bracket){.t = {1, 0},
                                .length = sqrt(square),
                                .density = {s->to_density, s->from_density},
                                .weight = {s->to_density, s->from_density},
                                .last_end = -1};
        open[num_open] = (uint16_t)i;
        num_open += !is_narrow(&brackets[i]);
    }
    for (int step = 0; num_open && step < MAX_STEPS; step++) {
        for (size_t k = 0; k < num_open; k++) {
            double at[3];
            choose_next(&brackets[open[k]], step);
            place(&segments[open[k]], brackets[open[k]].next_t, at);
            karst_grid_place(grid, at, &positions[k]);
        }
        karst_sampler_densities(sampler, positions, num_open, grid->footprint_m, densities);
        num_samples += num_open;
        size_t left = 0;
        for (size_t k = 0; k < num_open; k++) {
            learn(&brackets[open[k]], densities[k]);
            open[left] = open[k];
            left += !is_narrow(&brackets[open[k]]);
        }
        num_open = left;
    }
    for (size_t i = 0; i < num; i++) {
        const double solid = brackets[i].t[SOLID], air = brackets[i].t[AIR];
        const double share = between((double)brackets[i].density[SOLID], (double)brackets[i].density[AIR]);
        const double t = solid + (air - solid) * share, after = t > solid ? t : solid;
        place(&segments[i], after < air ? after : air, segments[i].found);
        place(&segments[i], solid, segments[i].found_solid);
    }
    return num_samples;
}

uint64_t karst_find_crossings(karst_sampler *sampler, const karst_grid *grid, karst_segment *segments, size_t num,
                              karst_position *positions, float *densities)
{
    uint64_t num_samples = 0;
    for (size_t i = 0; i < num; i += AT_ONCE)
        num_samples += find_some(sampler, grid, segments + i, num - i < AT_ONCE ? num - i : AT_ONCE, positions + i,
                                 densities + i);
    return num_samples;
}
