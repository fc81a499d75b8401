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
static bool note_bricks(karst_engine *engine, const karst_work *work, karst_error *error)
{
    return !engine->sunward || karst_sunward_note(engine->sunward, work, error);
}

/* On CPUs tiles and bricks are waited for in turn, to tell their CPU time apart. */
bool karst_engine_produce(karst_engine *engine, const karst_work *work, uint32_t *num_constant, karst_error *error)
{
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    karst_engine_made *made = &engine->made;
    *num_constant = 0;
    if (work->num_loads + work->num_subdivides == 0)
        return true;
    if (!engine->context->is_cpu) {
        if (!karst_producer_answer(engine->producer, buffers, work, error) || !note_bricks(engine, work, error))
            return false;
    } else {
        karst_work tiles = *work, bricks = *work;
        tiles.num_loads = bricks.num_subdivides = 0;
        if (!karst_finish(engine->context, error))
            return false;
        uint64_t start_ns = karst_engine_cpu_ns(engine);
        if (!karst_producer_answer(engine->producer, buffers, &tiles, error) || !karst_finish(engine->context, error))
            return false;
        uint64_t between_ns = karst_engine_cpu_ns(engine);
        if (!karst_producer_answer(engine->producer, buffers, &bricks, error) ||
            !note_bricks(engine, &bricks, error) || !karst_finish(engine->context, error))
            return false;
        made->tile_cpu_ns += between_ns - start_ns;
        made->brick_cpu_ns += karst_engine_cpu_ns(engine) - between_ns;
    }
    made->num_bricks += work->num_loads;
    made->num_tiles += work->num_subdivides;
    if (work->num_loads)
        engine->num_surveyed = 0;
    return (!engine->views || karst_views_note(engine->views, work, engine->frame + 1, error)) &&
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

static uint64_t made_cpu_ns(const karst_engine *engine)
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

/* One round for the wants of the frame's serial. */
bool karst_engine_answer_round(karst_engine *engine, const karst_position *from, karst_allowance *left,
                               karst_work *work, karst_error *error)
{
    karst_collect_params params = {.serial = engine->serial,
                                   .frame = engine->frame,
                                   .turn = engine->turn++,
                                   .camera = *from,
                                   .max_tiles = least(left->tiles, engine->budget_bricks),
                                   .max_bricks = least(left->bricks, engine->budget_bricks),
                                   .may_drop_fallback = true};
    if (engine->budget_ns > 0) {
        double round_ns = engine->goes_on ? fmin(left->ns, PATIENT_ROUND_NS) : left->ns;
        karst_cost_limits limits =
            karst_cost_plan(&engine->cost, round_ns, least(params.max_bricks, params.max_tiles));
        if (karst_cost_is_known(&engine->cost)) {
            params.budget_ns = round_ns;
            params.load_ns = engine->cost.bricks.expected_ns;
            params.subdivide_ns = tile_price_ns(engine);
        } else {
            params.max_tiles = limits.max_tiles < left->tiles ? limits.max_tiles : left->tiles;
            params.max_bricks = limits.max_bricks < left->bricks ? limits.max_bricks : left->bricks;
        }
    }
    uint32_t num_constant;
    uint64_t before_ns = made_cpu_ns(engine);
    if (!karst_cache_collect(engine->cache, &params, work, error) ||
        !karst_engine_produce(engine, work, &num_constant, error))
        return false;
    left->bricks -= work->num_loads;
    left->tiles -= work->num_subdivides;
    /* What it took, where that is known already: plans are careful, and what they did not need is for another round. */
    left->ns -= engine->context->is_cpu && !engine->cost.fixed
                    ? (double)(made_cpu_ns(engine) - before_ns)
                    : karst_cost_expected_ns(&engine->cost, work->num_loads, work->num_subdivides);
    karst_engine_count_made(engine, work, num_constant);
    return true;
}
