/* The cost model of production: how many tiles and bricks fit into a time, from what the last ones took on this device
 * in this world. Plain data, no device and no clock of its own. */
#ifndef KARST_CORE_COST_H
#define KARST_CORE_COST_H

#include <stdbool.h>
#include <stdint.h>

#define KARST_COST_WINDOW 8
#define KARST_COST_FULL_MEASURE 16u /* so many tell what one costs */

/* What one of a kind costs: of the last measures the one that a quarter exceed. A device that is disturbed now and then
 * does not shake it, one that has become slower, or a dearer part of the world, tells after three. */
typedef struct {
    double measures_ns[KARST_COST_WINDOW]; /* a ring */
    uint32_t num_measures;                 /* so far */
    double expected_ns;                    /* 0: nothing measured yet */
    /* The measure in the making: small rounds are put together, or launching them would count for much. */
    uint64_t sum_ns;
    uint32_t sum_num, sum_rounds;
} karst_cost_kind;

typedef struct {
    karst_cost_kind bricks, tiles, scout_rays;
    bool fixed;              /* nothing is learned any more (tests) */
    uint32_t tiles_expected; /* how many the next round may want, for sharing the time between both */
} karst_cost;

/* What one round made, and the device time it took; and the scouts' rays that asked for some of it. */
typedef struct {
    uint32_t num_bricks, num_tiles;
    uint64_t brick_ns, tile_ns; /* of all of them */
    uint32_t num_scout_rays;
    uint64_t scout_ns;
} karst_cost_round;

/* How much a round may make. */
typedef struct {
    uint32_t max_bricks, max_tiles;
} karst_cost_limits;

void karst_cost_init(karst_cost *cost);
void karst_cost_learn(karst_cost *cost, const karst_cost_round *round);
/* The most that is expected to fit into budget_ns, each from 1 (or nothing would ever settle) to `most`. Tiles get what
 * the last rounds wanted of them, with room to grow, up to a third of the time (all of that third where time is ample);
 * bricks the rest. Before anything was
 * measured: FIRST of each. */
#define KARST_COST_FIRST 16u
/* What so many are expected to take; 0 for a kind that was never measured. */
double karst_cost_expected_ns(const karst_cost *cost, uint32_t num_bricks, uint32_t num_tiles);
/* Bricks and tiles were measured. */
bool karst_cost_is_known(const karst_cost *cost);
karst_cost_limits karst_cost_plan(const karst_cost *cost, double budget_ns, uint32_t most);

#endif
