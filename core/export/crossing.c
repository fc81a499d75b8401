#include "core/export/crossing.h"

#include <math.h>

/* Even a jump is found by then: each fourth step halves what is left. */
#define MAX_STEPS 56
#define AT_ONCE 512

/* What is known of a segment, along which t goes from 0 (solid) to 1. */
typedef struct {
    double solid_t, air_t, length, next_t;
    float solid, air;               /* densities there */
    float solid_weight, air_weight; /* the same, halved where that end has not moved twice in a row */
    int last_side;
} bracket;

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

static bool is_narrow(const bracket *b) { return (b->air_t - b->solid_t) * b->length <= KARST_CROSSING_WITHIN; }

static void choose_next(bracket *b, int step)
{
    const double width = b->air_t - b->solid_t, least = 0.4 * KARST_CROSSING_WITHIN / b->length;
    double t = b->solid_t + width * between((double)b->solid_weight, (double)b->air_weight);
    /* A little farther than the surface should be from the nearer end: so the other one comes near, too. */
    t += t - b->solid_t < b->air_t - t ? least : -least;
    if (step % 4 == 3)
        t = b->solid_t + width / 2;
    const double most = b->air_t - least;
    t = t > b->solid_t + least ? t : b->solid_t + least;
    b->next_t = t < most ? t : most;
}

static void learn(bracket *b, float density)
{
    const int side = density > 0 ? 1 : -1;
    if (side > 0) {
        b->solid_t = b->next_t;
        b->solid = b->solid_weight = density;
        b->air_weight *= b->last_side == side ? 0.5f : 1;
    } else {
        b->air_t = b->next_t;
        b->air = b->air_weight = density;
        b->solid_weight *= b->last_side == side ? 0.5f : 1;
    }
    b->last_side = side;
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
        brackets[i] = (bracket){.air_t = 1,
                                .length = sqrt(square),
                                .solid = s->from_density,
                                .air = s->to_density,
                                .solid_weight = s->from_density,
                                .air_weight = s->to_density};
        if (!is_narrow(&brackets[i]))
            open[num_open++] = (uint16_t)i;
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
            if (!is_narrow(&brackets[open[k]]))
                open[left++] = open[k];
        }
        num_open = left;
    }
    for (size_t i = 0; i < num; i++) {
        const bracket *b = &brackets[i];
        const double t = b->solid_t + (b->air_t - b->solid_t) * between((double)b->solid, (double)b->air);
        const double after = t > b->solid_t ? t : b->solid_t;
        place(&segments[i], after < b->air_t ? after : b->air_t, segments[i].found);
        place(&segments[i], b->solid_t, segments[i].found_solid);
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
