/* One round of answering what rays asked for: collect, produce, publish. */
#include <math.h>
#include <time.h>

#include "core/engine/engine_parts.h"

/* A round takes no longer where somebody may want an end. */
#define PATIENT_ROUND_NS 100e6

uint64_t karst_engine_cpu_ns(const karst_engine *engine)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    uint64_t ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
    return ns / (uint64_t)(engine->context->compute_units > 0 ? engine->context->compute_units : 1);
}

/* Who keeps something of each brick is told. */
static bool note_bricks(karst_engine *engine, const karst_engine_store *asking, const karst_work *work,
                        karst_error *error)
{
    return asking || !engine->sunward || karst_sunward_note(engine->sunward, work, error);
}

/* Who makes it: where there are other stores, tiles are theirs, too. */
static bool answer(karst_engine *engine, const karst_engine_store *asking, const karst_work *work, karst_error *error)
{
    return karst_engine_contents(engine)
               ? karst_engine_answer_stores(engine, asking, work, error)
               : karst_producer_answer(engine->producer, karst_cache_get_buffers(engine->cache), work, error);
}

/* On CPUs tiles and bricks are waited for in turn, to tell their CPU time apart. */
bool karst_engine_produce(karst_engine *engine, const karst_engine_store *asking, const karst_work *work,
                          uint32_t *num_constant, karst_error *error)
{
    karst_engine_made *made = &engine->made;
    *num_constant = 0;
    if (work->num_loads + work->num_subdivides == 0)
        return true;
    if (!engine->context->is_cpu) {
        if (!answer(engine, asking, work, error) || !note_bricks(engine, asking, work, error))
            return false;
    } else {
        karst_work tiles = *work, bricks = *work;
        tiles.num_loads = bricks.num_subdivides = 0;
        if (!karst_finish(engine->context, error))
            return false;
        uint64_t start_ns = karst_engine_cpu_ns(engine);
        if (!answer(engine, asking, &tiles, error) || !karst_finish(engine->context, error))
            return false;
        uint64_t between_ns = karst_engine_cpu_ns(engine);
        if (!answer(engine, asking, &bricks, error) || !note_bricks(engine, asking, &bricks, error) ||
            !karst_finish(engine->context, error))
            return false;
        made->tile_cpu_ns += between_ns - start_ns;
        made->brick_cpu_ns += karst_engine_cpu_ns(engine) - between_ns;
    }
    made->num_bricks += work->num_loads;
    made->num_tiles += work->num_subdivides;
    if (work->num_loads && !asking)
        engine->num_surveyed = 0;
    return (asking || !engine->views || karst_views_note(engine->views, work, engine->frame + 1, error)) &&
           karst_cache_publish(engine->cache, work, NULL, num_constant, error);
}

/* Requests are those of the picture's own rays, and what scouts asked for and got. */
void karst_engine_count_made(karst_engine *engine, const karst_work *work, uint32_t num_constant)
{
    karst_stats *stats = &engine->stats;
    stats->num_produced += work->num_loads + work->num_subdivides;
    stats->num_evicted += work->num_evicted_tiles + work->num_evicted_bricks;
    stats->num_reproduced += work->num_reproduced;
    stats->num_tiles_produced += work->num_subdivides;
    stats->num_bricks_produced += work->num_loads;
    stats->num_bricks_constant += num_constant;
}

uint64_t karst_engine_made_cpu_ns(const karst_engine *engine)
{
    return engine->made.tile_cpu_ns + engine->made.brick_cpu_ns;
}

/* What a tile costs in this frame. Rounds of few are dearer than those of many, so that who had little to make for long
 * expects too much; what the frame's own took says so, and is believed half way. Not so of bricks, of which some worlds
 * have cheap ones and dear ones side by side. */
static double tile_price_ns(const karst_engine *engine)
{
    const karst_engine_made *made = &engine->made;
    double expected_ns = engine->cost.tiles.expected_ns;
    if (made->num_tiles < KARST_COST_FULL_MEASURE || !engine->context->is_cpu || engine->cost.fixed)
        return expected_ns;
    return fmin(expected_ns, fmax((double)made->tile_cpu_ns / made->num_tiles, expected_ns / 2));
}

static uint32_t least(uint32_t a, uint32_t b) { return a < b ? a : b; }

void karst_engine_limit_round(const karst_engine *engine, const karst_allowance *left, double share,
                              karst_collect_params *params)
{
    params->max_tiles = least((uint32_t)(share * left->tiles), engine->budget_bricks);
    params->max_bricks = least((uint32_t)(share * left->bricks), engine->budget_bricks);
    if (engine->budget_ns <= 0)
        return;
    double round_ns = share * (engine->goes_on ? fmin(left->ns, PATIENT_ROUND_NS) : left->ns);
    karst_cost_limits limits = karst_cost_plan(&engine->cost, round_ns, least(params->max_bricks, params->max_tiles));
    if (karst_cost_is_known(&engine->cost)) {
        params->budget_ns = round_ns;
        params->load_ns = engine->cost.bricks.expected_ns;
        params->subdivide_ns = tile_price_ns(engine);
    } else {
        params->max_tiles = least(limits.max_tiles, (uint32_t)(share * left->tiles));
        params->max_bricks = least(limits.max_bricks, (uint32_t)(share * left->bricks));
    }
}

/* What it took, where that is known already: plans are careful, and what they did not need is for another round. */
void karst_engine_spend(const karst_engine *engine, const karst_work *work, uint64_t before_ns, karst_allowance *left)
{
    left->bricks -= work->num_loads;
    left->tiles -= work->num_subdivides;
    left->ns -= engine->context->is_cpu && !engine->cost.fixed
                    ? (double)(karst_engine_made_cpu_ns(engine) - before_ns)
                    : karst_cost_expected_ns(&engine->cost, work->num_loads, work->num_subdivides);
}

bool karst_engine_produce_store(karst_engine *engine, karst_engine_store *of, const karst_work *work,
                                karst_error *error)
{
    uint32_t num_constant;
    if (!karst_engine_produce(engine, of, work, &num_constant, error))
        return false;
    karst_engine_count_made(engine, work, num_constant);
    of->stats.num_produced += work->num_loads;
    return true;
}

/* A frame's work is that of all stores; of what is used, each knows its own. */
static void add_work(karst_work *sum, const karst_work *work)
{
    sum->num_loads += work->num_loads;
    sum->num_subdivides += work->num_subdivides;
    sum->num_requests += work->num_requests;
    sum->num_deferred_budget += work->num_deferred_budget;
    sum->num_starved_bricks += work->num_starved_bricks;
    sum->num_starved_tiles += work->num_starved_tiles;
    sum->num_evicted_tiles += work->num_evicted_tiles;
    sum->num_evicted_bricks += work->num_evicted_bricks;
    sum->num_reproduced += work->num_reproduced;
}

static bool answer_stores(karst_engine *engine, const karst_collect_params *asked, karst_allowance *left,
                          karst_work *sum, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        karst_engine_store *of = &engine->stores[i];
        karst_collect_params params = *asked;
        karst_work work;
        if (!karst_engine_has_content(engine, i))
            continue;
        karst_engine_limit_round(engine, left, 1, &params);
        if (engine->budget_ns > 0 && left->ns <= 0) /* the land took all: what is asked for waits */
            params.max_bricks = params.max_tiles = 0;
        const uint64_t before_ns = karst_engine_made_cpu_ns(engine);
        if (!karst_store_collect(of->store, &params, &work, error) ||
            !karst_engine_produce_store(engine, of, &work, error))
            return false;
        karst_engine_spend(engine, &work, before_ns, left);
        of->num_used_bricks = work.num_used_bricks;
        of->lacks = work.num_requests > 0;
        of->stats.bricks.num_used = work.num_used_bricks;
        of->stats.num_requests += work.num_requests;
        add_work(sum, &work);
    }
    return true;
}

/* One round for the wants of the frame's serial. */
bool karst_engine_answer_round(karst_engine *engine, const karst_position *from, karst_allowance *left,
                               karst_work *work, karst_error *error)
{
    const karst_collect_params asked = {.serial = engine->serial,
                                        .frame = engine->frame,
                                        .turn = engine->turn++,
                                        .camera = *from,
                                        .may_drop_fallback = true};
    karst_collect_params params = asked;
    karst_engine_limit_round(engine, left, karst_engine_land_share(engine), &params);
    uint32_t num_constant;
    uint64_t before_ns = karst_engine_made_cpu_ns(engine);
    if (!karst_cache_collect(engine->cache, &params, work, error) ||
        !karst_engine_produce(engine, NULL, work, &num_constant, error))
        return false;
    karst_engine_spend(engine, work, before_ns, left);
    karst_engine_count_made(engine, work, num_constant);
    return answer_stores(engine, &asked, left, work, error);
}
