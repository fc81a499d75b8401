/* Answering what rays asked for: rounds of collect, produce and publish, within a frame's budget. */
#include <math.h>

#include "core/engine/engine_parts.h"

/* Rounds of a frame beyond the picture's own. Each gets at least one level further down. */
#define MAX_SCOUTS 12
/* A plan that did not fit what was wanted left so much of the budget. */
#define UNUSED_SHARE 0.25
/* Nor does it make more than budget_bricks; but there may be so many such rounds. */
#define PATIENT_ROUNDS 4u
/* Of a picture that stands; each gets further down likewise. */
#define MAX_AGAIN 16
/* That a frame leaves to the compiling of kernels without which little can be made. */
#define COMPILING_NS 150000000u
/* A scout is not worth its cast for less. */
#define LEAST_BRICKS 8u
/* The first levels of a tree have so few that they need no plan. */
#define FIRST_NODES 64u

/* Of a view that is new all is coarse as yet, and large on the picture. */
#define APART_NEW_PX (4 * KARST_SCOUT_PIXELS)

static int scout_apart_px(const karst_engine *engine)
{
    return engine->pace.new_view ? APART_NEW_PX : KARST_SCOUT_PIXELS;
}

/* What a scout is expected to take. */
static double scout_ns(const karst_engine *engine)
{
    return karst_engine_scout_rays(engine, scout_apart_px(engine)) * engine->cost.scout_rays.expected_ns;
}

/* Without a clock, and nobody looks at what comes before the settled picture. */
static bool is_settling(const karst_engine *engine) { return engine->settles && engine->budget_ns == 0; }

/* Is there room for another round, after one that did all that was asked of it, or left time by its plan? */
static bool may_go_on(const karst_engine *engine, const karst_work *work, karst_allowance *left)
{
    if (work->num_starved_bricks || work->num_starved_tiles)
        return false;
    if (left->bricks < LEAST_BRICKS || left->tiles < LEAST_BRICKS)
        return false;
    if (work->num_deferred_budget && !is_settling(engine) && !(left->ns > UNUSED_SHARE * engine->budget_ns))
        return false;
    left->over = left->over || (engine->goes_on && !engine->goes_on(engine->patience));
    if (left->over)
        return false;
    if (engine->budget_ns == 0)
        return true;
    if (!karst_cost_is_known(&engine->cost))
        return work->num_loads + work->num_subdivides <= FIRST_NODES && left->ns > 0;
    return left->ns >= karst_cost_expected_ns(&engine->cost, LEAST_BRICKS, LEAST_BRICKS) + scout_ns(engine);
}

static karst_allowance patient_allowance(const karst_engine *engine)
{
    const uint32_t num = PATIENT_ROUNDS * engine->budget_bricks;
    return (karst_allowance){.bricks = num, .tiles = num, .ns = engine->budget_ns};
}

/* Looks from a camera, at the budget's cost, and does what that asks for. */
static bool scout_round(karst_engine *engine, const karst_camera *from, bool whole, karst_allowance *left,
                        karst_work *work, karst_error *error)
{
    karst_engine_made *made = &engine->made;
    uint64_t start_ns = karst_engine_cpu_ns(engine);
    int apart_px = scout_apart_px(engine);
    if (!karst_engine_scout(engine, from, whole, apart_px, error))
        return false;
    /* On a GPU a scout is next to nothing, and waiting for it is not. */
    if (engine->budget_ns > 0 && engine->context->is_cpu) {
        if (!karst_finish(engine->context, error))
            return false;
        uint64_t took_ns = karst_engine_cpu_ns(engine) - start_ns;
        made->num_scout_rays += karst_engine_scout_rays(engine, apart_px);
        made->scout_cpu_ns += took_ns;
        left->ns -= engine->cost.fixed ? scout_ns(engine) : (double)took_ns;
    }
    if (!karst_engine_answer_round(engine, &from->position, left, work, error))
        return false;
    engine->stats.num_requests += work->num_loads + work->num_subdivides;
    return true;
}

/* What rays of the picture ask for, as `look` casts them, is made. */
static bool look_and_make(karst_engine *engine, bool (*look)(karst_engine *engine, karst_error *error),
                          karst_allowance *left, karst_work *work, karst_error *error)
{
    uint64_t start_ns = karst_engine_cpu_ns(engine);
    if (!look(engine, error) || !karst_finish(engine->context, error))
        return false;
    uint64_t taken_ns = karst_engine_cpu_ns(engine) - start_ns;
    engine->made.again_cpu_ns += taken_ns;
    left->ns -= (double)taken_ns;
    if (!karst_engine_answer_round(engine, &engine->camera.position, left, work, error))
        return false;
    engine->stats.num_requests += work->num_loads + work->num_subdivides;
    return true;
}

/* Who stands sees this picture until all is made that it lacks, as far as its own rays can tell: those of the camera,
 * and once they end where they should, those to the sun and those that are mirrored. *lacks: false if those asked for
 * nothing in the end. */
static bool follow_up(karst_engine *engine, karst_allowance *left, karst_work *work, bool *lacks, karst_error *error)
{
    const bool sunwards =
        (engine->shadows || engine->bounce || engine->clear || engine->paths || engine->occlusion) &&
        engine->counted[1] == 0;
    for (int i = 0; i < MAX_AGAIN && may_go_on(engine, work, left); i++) {
        if (!look_and_make(engine, sunwards ? karst_engine_look_at_shadows_again : karst_engine_look_again, left, work,
                           error))
            return false;
        if (work->num_loads + work->num_subdivides == 0) {
            *lacks = work->num_requests > 0;
            break;
        }
    }
    return true;
}

bool karst_engine_look_first(karst_engine *engine, karst_error *error)
{
    const bool holds = engine->held_sample && engine->held_sample == engine->sample;
    const bool only_centres = engine->samples > 1 && !engine->sample;
    engine->camera_lacks = !holds;
    if (engine->integrator != KARST_INTEGRATOR_FULL || !is_settling(engine) || !engine->has_content || holds ||
        only_centres || karst_ladder_is_deciding(&engine->ladder))
        return true;
    karst_allowance left = patient_allowance(engine);
    karst_work work = {0};
    bool made = false;
    for (int i = 0; i < MAX_AGAIN && (i == 0 || may_go_on(engine, &work, &left)); i++) {
        if (!look_and_make(engine, i ? karst_engine_look_again : karst_engine_look_at_all, &left, &work, error))
            return false;
        if (work.num_loads + work.num_subdivides == 0)
            break;
        made = true;
    }
    engine->camera_lacks = work.num_requests > 0;
    if (made) /* what stood in meanwhile is nothing that the picture uses */
        karst_engine_next_serial(engine);
    return true;
}

/* The picture that was drawn lacks nothing any longer, `work` being of the last look at it: the next frame follows only
 * paths that lacked something when it was drawn, if it draws the same sample; the light of others stays. But all that
 * the sample's paths need was there at once, by the rules of what fits: drawn in parts, a picture does not show what it
 * could not if it were drawn whole. */
static void hold_paths(karst_engine *engine, const karst_work *work)
{
    uint32_t num_tiles, num_bricks;
    karst_engine_usable_slots(engine, &num_tiles, &num_bricks);
    const bool fits = work->num_requests == 0 && work->num_used_bricks <= num_bricks &&
                      work->num_used_tiles <= num_tiles && !karst_engine_stores_overflow(engine) &&
                      karst_ladder_at_rest(&engine->ladder);
    const bool is_whole = engine->integrator == KARST_INTEGRATOR_FULL && !engine->draws_lacking &&
                          !karst_engine_has_path_media(engine) && !engine->starts && !engine->view;
    if (fits && is_whole && !engine->camera_lacks && engine->counted[1] == 0 && engine->counted[2] == 0)
        engine->held_sample = engine->sample;
}

/* How far ahead, in frames. What is seen first is wanted, subdivided, loaded: three frames at least; and what opens
 * behind a crest is a second's work and more. */
static const int frames_ahead[] = {6, 15, 30, 60};
#define NUM_AHEAD (int)(sizeof frames_ahead / sizeof *frames_ahead)

/* What of the budget is kept for that, once so much of the picture is at the level that is set. */
#define AHEAD_SHARE 0.35
#define AHEAD_FROM 0.9
#define AHEAD_FULL 0.95

static double kept_share(const karst_stats *stats)
{
    if (stats->num_hits == 0)
        return AHEAD_SHARE;
    double share = 1 - (double)stats->num_coarser / (double)stats->num_hits;
    return AHEAD_SHARE * fmax(0, fmin(1, (share - AHEAD_FROM) / (AHEAD_FULL - AHEAD_FROM)));
}

/* The rest is for what the next frames will see, nearest first, as long as there is something to make. */
static bool look_ahead(karst_engine *engine, karst_allowance *left, karst_work *work, karst_error *error)
{
    int num_rounds = 0, num_idle = 0;
    for (int i = 0; num_idle < NUM_AHEAD && num_rounds < MAX_SCOUTS && may_go_on(engine, work, left); i++) {
        karst_camera ahead;
        if (!karst_engine_look_ahead(engine, frames_ahead[i % NUM_AHEAD], &ahead)) {
            num_idle++;
            continue;
        }
        if (!scout_round(engine, &ahead, false, left, work, error))
            return false;
        num_rounds++;
        num_idle = work->num_loads + work->num_subdivides ? 0 : num_idle + 1;
    }
    return true;
}

/* Fewer pixels are drawn than there might be, and the pools have room for what all of them need. */
static bool may_look_closer(const karst_engine *engine)
{
    const karst_stats *stats = &engine->stats;
    const karst_cache_buffers *pools = karst_cache_get_buffers(engine->cache);
    double all_px = (double)engine->room_px / ((double)engine->width_px * engine->height_px);
    return engine->budget_ns > 0 &&
           (engine->width_px != engine->whole_width_px || engine->height_px != engine->whole_height_px) &&
           all_px * (double)stats->bricks.num_used < pools->num_bricks &&
           all_px * (double)stats->tiles.num_used < pools->num_tiles;
}

/* What the picture of all pixels needs: so it is there when motion ends. */
static bool look_closer(karst_engine *engine, karst_allowance *left, karst_work *work, karst_error *error)
{
    return !may_look_closer(engine) || !may_go_on(engine, work, left) ||
           scout_round(engine, &engine->camera, true, left, work, error);
}

/* Both, by turns first, as often there is time for one look only; ahead less often while there is nothing to make. */
static bool spend_the_rest(karst_engine *engine, karst_allowance *left, karst_work *work, karst_error *error)
{
    bool ahead_first = engine->frame % (engine->ahead_is_made ? 4 : 2) == 0;
    if (!ahead_first && !look_closer(engine, left, work, error))
        return false;
    uint64_t before = engine->stats.num_produced;
    if (!look_ahead(engine, left, work, error))
        return false;
    if (ahead_first)
        engine->ahead_is_made = engine->stats.num_produced - before < LEAST_BRICKS;
    return !ahead_first || look_closer(engine, left, work, error);
}

/* Before a frame's picture: the host makes up for kernels that are not compiled yet only if frames have a budget, which
 * they could not keep while they wait. */
static bool prepare_producer(karst_engine *engine, karst_error *error)
{
    bool was_on_host = engine->on_host;
    bool waits = engine->budget_ns == 0 || engine->cost.fixed;
    if (waits && (!karst_density_producer_compile(engine->producer, KARST_UNTIL_COMPILED, error) ||
                  !karst_engine_compile_contents(engine, KARST_UNTIL_COMPILED, error)))
        return false;
    engine->on_host = karst_density_producer_is_on_host(engine->producer);
    if (was_on_host && !engine->on_host && !engine->cost.fixed) /* what things cost is another matter now */
        karst_cost_init(&engine->cost);
    return true;
}

/* Of the stores beside the land. */
static bool load_store_roots(karst_engine *engine, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        karst_engine_store *of = &engine->stores[i];
        karst_work work;
        if (!karst_engine_has_content(engine, i))
            continue;
        if (!karst_store_root_work(of->store, engine->serial, &work, error) ||
            !karst_engine_produce_store(engine, of, &work, error))
            return false;
        engine->stats.num_requests += work.num_loads;
        do {
            if (!karst_store_drop_work(of->store, engine->serial, &work, error) ||
                !karst_engine_produce_store(engine, of, &work, error))
                return false;
            engine->stats.num_requests += work.num_loads;
        } while (work.num_loads);
    }
    return true;
}

bool karst_engine_load_root(karst_engine *engine, karst_error *error)
{
    karst_work work;
    uint32_t num_constant;
    if (!prepare_producer(engine, error) || !karst_cache_root_work(engine->cache, engine->serial, &work, error) ||
        !karst_engine_produce(engine, NULL, &work, &num_constant, error))
        return false;
    karst_engine_count_made(engine, &work, num_constant);
    engine->stats.num_requests += work.num_loads;
    /* And what an edit made forget, so that no picture shows its surroundings as they look from far away. */
    do {
        if (!karst_cache_drop_work(engine->cache, engine->serial, &work, error) ||
            !karst_engine_produce(engine, NULL, &work, &num_constant, error))
            return false;
        karst_engine_count_made(engine, &work, num_constant);
        engine->stats.num_requests += work.num_loads;
    } while (work.num_loads);
    return load_store_roots(engine, error);
}

/* Some frames' worth of bricks, and large pages are found whole: 2 MiB at a time. */
#define BRICKS_AHEAD 1024u

bool karst_engine_answer(karst_engine *engine, karst_work *work, karst_error *error)
{
    if (engine->budget_ns > 0)
        karst_cache_commit_ahead(engine->cache, BRICKS_AHEAD);
    karst_stats *stats = &engine->stats;
    karst_allowance left = patient_allowance(engine);
    const bool waited_for = is_settling(engine) || (engine->goes_on && engine->budget_ns > 0 && !engine->motion.moved);
    if (!waited_for)
        left.bricks = left.tiles = engine->budget_bricks;
    left.ns -= karst_cost_expected_ns(&engine->cost, engine->made.num_bricks, engine->made.num_tiles);
    if (engine->on_host && !engine->has_content) /* the sooner the picture is shown; kernels make more of the time */
        left.bricks = left.tiles = 0;
    karst_camera ahead; /* who stands looks nowhere else */
    bool moves = karst_engine_look_ahead(engine, frames_ahead[0], &ahead);
    const double kept_ns = moves ? kept_share(stats) * engine->budget_ns : 0;
    left.ns -= kept_ns;
    /* Whoever waits sees the picture before its content is made. */
    if (engine->goes_on)
        engine->goes_on(engine->patience);
    /* Once the picture is drawn, whose own kernels are compiled first: PoCL compiles one at a time. Pictures in quick
     * succession would only take the time away from the compiler. */
    const uint64_t compiling_ns = engine->has_content ? COMPILING_NS : 0;
    if (!karst_density_producer_compile(engine->producer, compiling_ns, error) ||
        !karst_engine_compile_contents(engine, compiling_ns, error))
        return false;
    const bool decides = karst_ladder_is_deciding(&engine->ladder);
    if (!(decides ? karst_engine_decide(engine, &left, work, error)
                  : karst_engine_answer_round(engine, &engine->camera.position, &left, work, error)) ||
        !karst_engine_end_picture(engine, error))
        return false;
    stats->num_requests += work->num_requests;
    stats->num_deferred = work->num_deferred_budget + work->num_starved_bricks + work->num_starved_tiles;
    stats->tiles.num_used = work->num_used_tiles;
    stats->bricks.num_used = work->num_used_bricks;

    /* What has just been made may ask for more: a few rays tell, at a fraction of a picture's cost. Not in the first
     * frame of a world: its picture is there, however coarse, and nobody sees it before the frame ends. */
    karst_work more = *work;
    if (decides)
        return true;
    int most_scouts = engine->has_content ? MAX_SCOUTS : 0;
    engine->has_content = true;
    /* What looks closer below tells as well, once the picture's own is made. */
    if (may_look_closer(engine) && work->num_deferred_budget == 0)
        most_scouts = 0;
    for (int i = 0; i < most_scouts && more.num_loads + more.num_subdivides && may_go_on(engine, &more, &left); i++)
        if (!scout_round(engine, &engine->camera, false, &left, &more, error))
            return false;
    /* On a GPU a viewer's next picture is as fast as looking again. */
    bool stands = is_settling(engine) ||
                  (engine->context->is_cpu && engine->goes_on && !moves && !engine->motion.moved);
    bool lacks = work->num_requests > 0;
    if (stands && most_scouts && lacks && !follow_up(engine, &left, &more, &lacks, error))
        return false;
    if (!lacks)
        hold_paths(engine, &more);
    left.ns += kept_ns;
    return engine->budget_ns == 0 || spend_the_rest(engine, &left, &more, error);
}

/* Of a frame with a budget in ms: at most some 2.5 ms of one core. */
#define SURVEY_SLOTS 2048u

bool karst_engine_survey_slopes(karst_engine *engine, karst_error *error)
{
    const uint32_t num_slots = karst_cache_get_buffers(engine->cache)->num_bricks + KARST_CACHE_ROOT_BRICKS;
    const uint32_t first = engine->num_surveyed;
    if (first >= num_slots)
        return true;
    engine->num_surveyed = engine->budget_ns > 0 && num_slots - first > SURVEY_SLOTS ? first + SURVEY_SLOTS : num_slots;
    return karst_caster_survey_slopes(engine->caster, first, engine->num_surveyed, error);
}

void karst_engine_pretend_cost(karst_engine *engine, double brick_ns, double tile_ns)
{
    engine->cost.fixed = true;
    engine->cost.bricks.expected_ns = brick_ns;
    engine->cost.tiles.expected_ns = tile_ns;
}

void karst_engine_learn_cost(karst_engine *engine)
{
    karst_stats *stats = &engine->stats;
    karst_engine_made *made = &engine->made;
    uint64_t brick_ns = stats->time_ns[KARST_STAGE_EVALUATE] + stats->time_ns[KARST_STAGE_FINALISE];
    uint64_t tile_ns = stats->time_ns[KARST_STAGE_SUBDIVIDE];
    /* Of the two clocks the lesser: the device's leaves out the compiling of kernels, the CPU's what others ran. */
    if (engine->context->is_cpu) {
        brick_ns = brick_ns < made->brick_cpu_ns ? brick_ns : made->brick_cpu_ns;
        tile_ns = tile_ns < made->tile_cpu_ns ? tile_ns : made->tile_cpu_ns;
    }
    stats->time_ns_production = brick_ns + tile_ns;
    stats->time_ns_scouts = made->scout_cpu_ns + made->again_cpu_ns;
    karst_cost_round round = {
        .num_bricks = made->num_bricks, .num_tiles = made->num_tiles, .brick_ns = brick_ns, .tile_ns = tile_ns};
    round.num_scout_rays = made->num_scout_rays;
    round.scout_ns = made->scout_cpu_ns;
    karst_cost_learn(&engine->cost, &round);
    *made = (karst_engine_made){0};
}
