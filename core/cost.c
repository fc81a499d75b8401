#include "core/cost.h"

#include <math.h>

/* A round's measure moves the estimate by these shares, if the round was of FULL_ROUND or more. */
#define SHARE_UP 0.7
#define SHARE_DOWN 0.1
#define FULL_ROUND 16.0
/* Before a number of tiles is known, and as its room to grow. */
#define TILES_AT_LEAST 8u
#define TILES_SHARE (1.0 / 3)

void karst_cost_init(karst_cost *cost) { *cost = (karst_cost){.tiles_expected = TILES_AT_LEAST}; }

static void follow(double *estimate_ns, uint64_t total_ns, uint32_t num)
{
    /* Without time there was no measurement: the device may keep no clock for so short a launch. */
    if (num == 0 || total_ns == 0)
        return;
    double one_ns = (double)total_ns / num;
    if (*estimate_ns == 0) {
        *estimate_ns = one_ns;
        return;
    }
    double share = (one_ns > *estimate_ns ? SHARE_UP : SHARE_DOWN) * fmin(1, num / FULL_ROUND);
    *estimate_ns += share * (one_ns - *estimate_ns);
}

void karst_cost_learn(karst_cost *cost, const karst_cost_round *round)
{
    follow(&cost->brick_ns, round->brick_ns, round->num_bricks);
    follow(&cost->tile_ns, round->tile_ns, round->num_tiles);
    uint32_t wanted = round->num_tiles > UINT32_MAX / 2 ? UINT32_MAX : 2 * round->num_tiles;
    /* Demand comes in bursts: it is forgotten slowly. */
    uint32_t kept = cost->tiles_expected - cost->tiles_expected / 8;
    cost->tiles_expected = wanted > kept ? wanted : kept;
    if (cost->tiles_expected < TILES_AT_LEAST)
        cost->tiles_expected = TILES_AT_LEAST;
}

/* How many at one_ns each go into time_ns, from 1 to most. */
static uint32_t fit(double time_ns, double one_ns, uint32_t most)
{
    if (one_ns == 0)
        return most < KARST_COST_FIRST ? most : KARST_COST_FIRST;
    double num = floor(time_ns / one_ns);
    return num < 1 ? 1 : num < most ? (uint32_t)num : most;
}

karst_cost_limits karst_cost_plan(const karst_cost *cost, double budget_ns, uint32_t most)
{
    karst_cost_limits limits;
    limits.max_tiles = fit(budget_ns * TILES_SHARE, cost->tile_ns, most);
    if (limits.max_tiles > cost->tiles_expected)
        limits.max_tiles = cost->tiles_expected;
    limits.max_bricks = fit(budget_ns - limits.max_tiles * cost->tile_ns, cost->brick_ns, most);
    return limits;
}
