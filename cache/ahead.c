/* Recycling ahead: a reserve of free slots for the rounds to come, made where no work waits for it. */
#include "cache/ahead.h"
#include "cache/pools.h"

uint32_t karst_ahead_need(const karst_slots *slots, uint32_t num_chosen, uint32_t least, uint32_t num_used)
{
    uint32_t most = slots->capacity / KARST_AHEAD_SHARE, taken = num_used + slots->num;
    uint32_t unused = slots->capacity - (taken < slots->capacity ? taken : slots->capacity);
    uint32_t low = num_chosen + num_chosen / 8, full = 4 * num_chosen;
    most = most < KARST_CACHE_MAX_WORK ? most : KARST_CACHE_MAX_WORK;
    full = full < most ? full : most;
    if (num_chosen < least || slots->num >= low || slots->num >= full)
        return 0;
    return full - slots->num < unused / 2 ? full - slots->num : unused / 2;
}

static bool recycle(karst_cache *cache, uint32_t need_tiles, uint32_t need_bricks, uint32_t *num_evicted,
                    karst_error *error)
{
    karst_evict *evict = &cache->evict;
    uint32_t *slots = cache->granted_tiles, num = 0, num_freed = 0; /* no round is open */
    karst_survey_ask ask = {.serial = cache->serial};
    karst_lru_expect(&cache->tiles, need_tiles, 0, &ask);
    karst_lru_expect(&cache->bricks, need_bricks, 0, &ask);
    if (!karst_survey_begin(&cache->survey, &ask, error) ||
        (cache->may_map && !karst_mapped_begin(&cache->mapped, error)) || !karst_survey_end(&cache->survey, error) ||
        !karst_evict_start(evict, cache->serial, need_tiles, need_bricks, error) ||
        !karst_evict_tiles(evict, cache->serial, cache->frame, need_tiles, &cache->churn, &cache->brick_slots, slots,
                           &num, &num_freed, error))
        return false;
    karst_slots_give(&cache->tile_slots, slots, num);
    *num_evicted = num + num_freed;
    need_bricks -= num_freed < need_bricks ? num_freed : need_bricks;
    slots = cache->granted_bricks;
    if (!karst_evict_bricks(evict, cache->serial, cache->frame, need_bricks, false, &cache->churn, slots, &num, error))
        return false;
    karst_slots_give(&cache->brick_slots, slots, num);
    *num_evicted += num;
    return true;
}

bool karst_cache_recycle_ahead(karst_cache *cache, uint32_t *num_evicted, karst_error *error)
{
    karst_cache_abandon(cache);
    uint32_t need_tiles =
        karst_ahead_need(&cache->tile_slots, cache->most_chosen_tiles, cache->least_ahead, cache->num_in_use_tiles);
    uint32_t need_bricks =
        karst_ahead_need(&cache->brick_slots, cache->most_chosen_bricks, cache->least_ahead, cache->num_in_use_bricks);
    *num_evicted = cache->most_chosen_tiles = cache->most_chosen_bricks = 0;
    if (need_tiles == 0 && need_bricks == 0)
        return true;
    bool ok = recycle(cache, need_tiles, need_bricks, num_evicted, error);
    return karst_mapped_end(&cache->mapped, ok ? error : NULL) && ok;
}
