/* A round from its work to what is linked; and slots that were granted and not used. */
#include "cache/pools.h"

karst_work karst_cache_empty_work(const karst_cache *cache)
{
    return (karst_work){.load_nodes = cache->load_nodes,
                        .load_slots = cache->load_slots,
                        .load_results = cache->load_results,
                        .subdivide_nodes = cache->subdivide_nodes,
                        .subdivide_tiles = cache->subdivide_tiles};
}

void karst_cache_abandon(karst_cache *cache)
{
    karst_slots_give(&cache->tile_slots, cache->granted_tiles, cache->num_granted_tiles);
    karst_store_give(cache->asking, cache->granted_bricks, cache->num_granted_bricks);
    cache->num_granted_tiles = cache->num_granted_bricks = 0;
}

void karst_cache_open_round(karst_cache *cache, karst_store *store, uint32_t serial)
{
    karst_cache_abandon(cache);
    cache->asking = store;
    cache->serial = serial;
}

/* Keeps of `granted` what was not used, in order. */
static void keep_unused(uint32_t *granted, uint32_t *num_granted, uint32_t i)
{
    granted[(*num_granted)++] = granted[i];
}

/* Tiles that one store asked for are the tree's: the others' nodes name them, too. */
static bool link_beside(karst_cache *cache, const karst_work *work, uint32_t num_subdivides, karst_error *error)
{
    for (uint32_t i = 0; i < karst_cache_num_stores(cache); i++) {
        const karst_store *store = karst_cache_store(cache, i);
        if (store != cache->asking &&
            !karst_beside_link(&store->beside, work, num_subdivides, cache->asking->publish.used, error))
            return false;
    }
    return true;
}

bool karst_cache_publish(karst_cache *cache, const karst_work *work, uint32_t *num_bricks_linked,
                         uint32_t *num_bricks_constant, karst_error *error)
{
    karst_publish *publish = &cache->asking->publish;
    uint32_t *flags = publish->host_flags, num_linked = 0, num_constant = 0;
    uint32_t num_bricks = cache->num_granted_bricks, num_tiles = cache->num_granted_tiles;
    uint32_t num_loads = work->num_loads < num_bricks ? work->num_loads : num_bricks;
    uint32_t num_subdivides = work->num_subdivides < num_tiles ? work->num_subdivides : num_tiles;
    if (!karst_publish_launch(publish, work, num_loads, num_subdivides, cache->serial, error) ||
        !link_beside(cache, work, num_subdivides, error) ||
        !karst_buffer_read(work->load_results, 0, flags, num_loads * sizeof(*flags), error))
        return false;

    cache->num_granted_bricks = 0;
    for (uint32_t i = 0; i < num_bricks; i++) {
        uint32_t result = i < num_loads ? flags[i] : KARST_STATE_UNKNOWN;
        bool linked = result == KARST_STATE_BRICK || (result & KARST_LOAD_KEPT);
        num_linked += linked;
        num_constant += result == KARST_STATE_AIR || result == KARST_STATE_SOLID;
        if (!linked)
            keep_unused(cache->granted_bricks, &cache->num_granted_bricks, i);
    }
    if (!karst_buffer_read(publish->used, 0, flags, num_subdivides * sizeof(*flags), error))
        return false;
    cache->num_granted_tiles = 0;
    for (uint32_t i = 0; i < num_tiles; i++)
        if (i >= num_subdivides || !flags[i])
            keep_unused(cache->granted_tiles, &cache->num_granted_tiles, i);
    karst_cache_abandon(cache);
    if (num_bricks_linked)
        *num_bricks_linked = num_linked;
    if (num_bricks_constant)
        *num_bricks_constant = num_constant;
    return true;
}
