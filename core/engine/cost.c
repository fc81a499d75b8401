#include "core/engine/cost.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A measure is made of KARST_COST_FULL_MEASURE, or of so many rounds. */
#define MOST_ROUNDS 4u
/* Before a number of tiles is known, and as its room to grow. */
#define TILES_AT_LEAST 8u
#define TILES_SHARE (1.0 / 3)
/* With so much time there are further rounds for what a round's share leaves, and what is expected of small budgets
 * says little. */
#define AMPLE_NS 50e6

void karst_cost_init(karst_cost *cost) { *cost = (karst_cost){.tiles_expected = TILES_AT_LEAST}; }

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double upper_quartile(const karst_cost_kind *kind)
{
    double sorted_ns[KARST_COST_WINDOW];
    uint32_t num = kind->num_measures < KARST_COST_WINDOW ? kind->num_measures : KARST_COST_WINDOW;
    memcpy(sorted_ns, kind->measures_ns, num * sizeof *sorted_ns);
    qsort(sorted_ns, num, sizeof *sorted_ns, compare);
    return sorted_ns[num - 1 - num / 4];
}

static void learn_kind(karst_cost_kind *kind, uint32_t num, uint64_t ns)
{
    /* Without time there was no measurement: the device may keep no clock for so short a launch. */
    if (num == 0 || ns == 0)
        return;
    kind->sum_num = num > UINT32_MAX - kind->sum_num ? UINT32_MAX : kind->sum_num + num;
    kind->sum_ns = ns > UINT64_MAX - kind->sum_ns ? UINT64_MAX : kind->sum_ns + ns;
    kind->sum_rounds++;
    if (kind->sum_num < KARST_COST_FULL_MEASURE && kind->sum_rounds < MOST_ROUNDS && kind->num_measures > 0)
        return;
    kind->measures_ns[kind->num_measures % KARST_COST_WINDOW] = (double)kind->sum_ns / kind->sum_num;
    /* The count stays in step with the ring, and above its size, when it would wrap around. */
    kind->num_measures = kind->num_measures == UINT32_MAX ? 2 * KARST_COST_WINDOW : kind->num_measures + 1;
    kind->sum_num = kind->sum_rounds = 0;
    kind->sum_ns = 0;
    kind->expected_ns = upper_quartile(kind);
}

void karst_cost_learn(karst_cost *cost, const karst_cost_round *round)
{
    if (!cost->fixed) {
        learn_kind(&cost->bricks, round->num_bricks, round->brick_ns);
        learn_kind(&cost->tiles, round->num_tiles, round->tile_ns);
        learn_kind(&cost->scout_rays, round->num_scout_rays, round->scout_ns);
    }
    uint32_t num = round->num_tiles < UINT32_MAX / 2 ? round->num_tiles : UINT32_MAX / 2;
    uint32_t wanted = num + num / 4 + TILES_AT_LEAST;
    /* Demand comes in bursts: it is forgotten slowly. */
    uint32_t kept = cost->tiles_expected - cost->tiles_expected / 4;
    cost->tiles_expected = wanted > kept ? wanted : kept;
}

double karst_cost_expected_ns(const karst_cost *cost, uint32_t num_bricks, uint32_t num_tiles)
{
    return num_bricks * cost->bricks.expected_ns + num_tiles * cost->tiles.expected_ns;
}

bool karst_cost_is_known(const karst_cost *cost) { return cost->bricks.expected_ns > 0 && cost->tiles.expected_ns > 0; }

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
    limits.max_tiles = fit(budget_ns * TILES_SHARE, cost->tiles.expected_ns, most);
    if (limits.max_tiles > cost->tiles_expected && budget_ns < AMPLE_NS)
        limits.max_tiles = cost->tiles_expected;
    limits.max_bricks = fit(budget_ns - limits.max_tiles * cost->tiles.expected_ns, cost->bricks.expected_ns, most);
    return limits;
}
