/* Collect: turns stamps into work. */
#include "cache/pools.h"

#include <string.h>

/* Slots for at most `need` tiles: free ones, then recycled ones. */
static bool grant_tiles(karst_cache *cache, const karst_collect_params *params, uint32_t need, karst_work *work,
                        karst_error *error)
{
    uint32_t num_recycled = 0, num_bricks_freed = 0;
    cache->num_granted_tiles = karst_slots_take(&cache->tile_slots, cache->granted_tiles, need);
    bool ok = karst_evict_tiles(&cache->land.evict, params->serial, params->frame, need - cache->num_granted_tiles,
                                cache->granted_tiles + cache->num_granted_tiles, &num_recycled, &num_bricks_freed,
                                error);
    cache->num_granted_tiles += num_recycled;
    work->num_evicted_tiles = num_recycled;
    work->num_evicted_bricks += num_bricks_freed;
    return ok;
}

static bool grant_bricks(karst_cache *cache, karst_store *store, const karst_collect_params *params, uint32_t need,
                         karst_work *work, karst_error *error)
{
    uint32_t num_recycled = 0;
    cache->num_granted_bricks = karst_slots_take(&store->brick_slots, cache->granted_bricks, need);
    bool ok = karst_evict_bricks(&store->evict, params->serial, params->frame, need - cache->num_granted_bricks,
                                 params->may_drop_fallback, cache->granted_bricks + cache->num_granted_bricks,
                                 &num_recycled, error);
    cache->num_granted_bricks += num_recycled;
    work->num_evicted_bricks += num_recycled;
    return ok;
}

/* Was anything evicted lately that a round of this store may make again? The land remembers tiles. */
static bool any_is_recent(const karst_cache *cache, const karst_store *store, uint32_t frame)
{
    return karst_churn_any_is_recent(&store->churn, frame) || karst_churn_any_is_recent(&cache->land.churn, frame);
}

/* Of the work that got slots, what was evicted lately. Loads' names come first in the list, then all chosen
 * subdivides'. */
static bool count_reproduced(karst_cache *cache, const karst_store *store, uint32_t num_chosen_loads, uint32_t frame,
                             karst_work *work, karst_error *error)
{
    uint32_t num = num_chosen_loads + work->num_subdivides;
    if (!any_is_recent(cache, store, frame))
        return true;
    if (!cache->has_names && !karst_finish(cache->context, error))
        return false;
    for (uint32_t i = 0; i < num; i++)
        karst_churn_expect(i < num_chosen_loads ? &store->churn : &cache->land.churn, cache->identities[i]);
    for (uint32_t i = 0; i < num; i++)
        if (i < work->num_loads || i >= num_chosen_loads)
            work->num_reproduced += karst_churn_is_recent(i < num_chosen_loads ? &store->churn : &cache->land.churn,
                                                          cache->identities[i], frame);
    return true;
}

/* The values are the cache's own lists, which stay as they are until the last read of this round. */
static bool upload(karst_buffer *buffer, const uint32_t *values, uint32_t num, karst_error *error)
{
    return karst_buffer_send(buffer, 0, values, num * sizeof(*values), error);
}

/* Nodes that are worked on are in use, whether or not a ray stamped their tile: nothing of theirs is recycled. Their
 * names come along where they may be asked for. */
static bool accept(karst_cache *cache, karst_store *store, const karst_collect_params *params, karst_error *error)
{
    karst_wants *wants = &store->wants;
    const karst_wants_choice *loads = wants->loads, *subdivides = wants->subdivides;
    if (store->mapped.nodes) {
        karst_wants_accept_mapped(wants, params->serial, cache->identities);
        return true;
    }
    return upload(cache->load_nodes, loads->nodes, loads->num, error) &&
           upload(cache->subdivide_nodes, subdivides->nodes, subdivides->num, error) &&
           karst_wants_accept(wants, cache->load_nodes, loads->num, cache->subdivide_nodes, subdivides->num,
                              params->serial, error) &&
           ((!cache->has_names && !any_is_recent(cache, store, params->frame)) ||
            karst_buffer_fetch(wants->identities, 0, cache->identities,
                              (loads->num + subdivides->num) * sizeof(uint64_t), error));
}

/* Into the device's memory, which is the host's. */
static void write_list(karst_buffer *buffer, const uint32_t *values, uint32_t num)
{
    memcpy(karst_buffer_memory(buffer), values, num * sizeof(*values));
}

/* The work to the device. A load that no producer answers stays "unknown", and its slot free. */
static bool send_work(karst_cache *cache, const karst_store *store, const karst_work *work, karst_error *error)
{
    if (store->mapped.nodes) {
        write_list(cache->load_nodes, store->wants.loads->nodes, work->num_loads);
        write_list(cache->subdivide_nodes, store->wants.subdivides->nodes, work->num_subdivides);
        write_list(cache->load_slots, cache->granted_bricks, work->num_loads);
        write_list(cache->subdivide_tiles, cache->granted_tiles, work->num_subdivides);
        _Static_assert(KARST_STATE_UNKNOWN == 0u, "filled byte by byte");
        memset(karst_buffer_memory(cache->load_results), 0, work->num_loads * sizeof(uint32_t));
        return true;
    }
    return upload(cache->load_slots, cache->granted_bricks, work->num_loads, error) &&
           upload(cache->subdivide_tiles, cache->granted_tiles, work->num_subdivides, error) &&
           karst_buffer_fill(cache->load_results, KARST_STATE_UNKNOWN, 0, work->num_loads * sizeof(uint32_t), error);
}

/* All stores', since tiles that are recycled take bricks of all with them. */
static bool begin_mapped(karst_cache *cache, karst_error *error)
{
    for (uint32_t i = 0; i < karst_cache_num_stores(cache); i++)
        if (!karst_mapped_begin(&karst_cache_store(cache, i)->mapped, error))
            return false;
    return true;
}

static void end_mapped(karst_cache *cache)
{
    for (uint32_t i = 0; i < karst_cache_num_stores(cache); i++)
        karst_mapped_end(&karst_cache_store(cache, i)->mapped);
}

/* Looks at all stamps and chooses the best of what is wanted. */
static bool survey_and_choose(karst_cache *cache, karst_store *store, const karst_collect_params *params,
                              const karst_survey_ask *ask, karst_error *error)
{
    karst_survey *survey = &store->survey;
    karst_wants *wants = &store->wants;
    if (cache->on_host) {
        if (!begin_mapped(cache, error))
            return false;
        karst_survey_by_host(survey, ask, &store->mapped);
        karst_wants_choose_by_host(wants, params->serial, params->turn, params->camera.voxel, params->max_bricks,
                                   params->max_tiles);
        return true;
    }
    return karst_survey_begin(survey, ask, error) &&
           karst_wants_begin(wants, params->serial, params->turn, params->camera.voxel, error) &&
           karst_survey_end(survey, error) &&
           karst_wants_choose(wants, params->max_bricks, params->max_tiles, error);
}

/* What a survey is to find, by what the last rounds needed. Tiles are the land's to look for: in another store's round
 * they are looked for only once some must be recycled. */
static karst_survey_ask expect(karst_cache *cache, karst_store *store, uint32_t serial)
{
    karst_survey_ask ask = {.serial = serial};
    if (store == &cache->land)
        karst_lru_expect(&cache->tiles, cache->tile_slots.num, &ask);
    else
        karst_lru_forget(&cache->tiles);
    karst_lru_expect(&store->bricks, store->brick_slots.num, &ask);
    return ask;
}

/* What is expected to be recycled is started together where that is the land's: it saves a wait. */
static bool start_eviction(karst_cache *cache, karst_store *store, uint32_t serial, uint32_t need_tiles,
                           uint32_t need_bricks, karst_error *error)
{
    bool is_land = store == &cache->land;
    return karst_evict_start(&store->evict, serial, is_land ? need_tiles : 0, is_land ? need_bricks : 0, error);
}

static bool collect(karst_cache *cache, karst_store *store, const karst_collect_params *params, karst_work *work,
                    karst_error *error)
{
    const karst_survey *survey = &store->survey;
    karst_wants *wants = &store->wants;
    const karst_survey_ask ask = expect(cache, store, params->serial);
    if (!survey_and_choose(cache, store, params, &ask, error))
        return false;
    work->num_used_tiles = survey->host_result.num_used[KARST_SURVEY_TILES];
    work->num_used_bricks = survey->host_result.num_used[KARST_SURVEY_BRICKS];
    if (params->budget_ns > 0)
        karst_wants_fit(wants, params->load_ns, params->subdivide_ns, params->budget_ns);
    const karst_wants_choice *loads = wants->loads, *subdivides = wants->subdivides;
    if (store == &cache->land)
        cache->tiles.expected_need = subdivides->num;
    store->bricks.expected_need = loads->num;
    work->num_requests = loads->num_all + subdivides->num_all;
    work->num_deferred_budget = work->num_requests - loads->num - subdivides->num;
    if (loads->num + subdivides->num == 0)
        return true;
    uint32_t num_free_tiles = cache->tile_slots.num, num_free_bricks = store->brick_slots.num;
    uint32_t need_tiles = subdivides->num - (subdivides->num < num_free_tiles ? subdivides->num : num_free_tiles);
    uint32_t need_bricks = loads->num - (loads->num < num_free_bricks ? loads->num : num_free_bricks);
    cache->has_names = need_tiles || need_bricks || cache->on_host; /* there will be a wait, or the host makes them */

    /* Tiles go first, since their bricks become free. */
    if (!accept(cache, store, params, error) ||
        !start_eviction(cache, store, params->serial, need_tiles, need_bricks, error) ||
        !grant_tiles(cache, params, subdivides->num, work, error) ||
        !grant_bricks(cache, store, params, loads->num, work, error))
        return false;

    work->num_loads = cache->num_granted_bricks;
    work->num_subdivides = cache->num_granted_tiles;
    work->num_starved_bricks = loads->num - work->num_loads;
    work->num_starved_tiles = subdivides->num - work->num_subdivides;
    return count_reproduced(cache, store, loads->num, params->frame, work, error) &&
           send_work(cache, store, work, error);
}

bool karst_store_collect(karst_store *store, const karst_collect_params *params, karst_work *work, karst_error *error)
{
    karst_cache *cache = store->cache;
    *work = karst_cache_empty_work(cache);
    if (params->serial == 0)
        return karst_fail(error, KARST_USAGE, "a cast's serial is never 0");
    karst_cache_open_round(cache, store, params->serial);
    bool ok = collect(cache, store, params, work, error);
    end_mapped(cache);
    return ok;
}

bool karst_cache_collect(karst_cache *cache, const karst_collect_params *params, karst_work *work, karst_error *error)
{
    return karst_store_collect(&cache->land, params, work, error);
}
