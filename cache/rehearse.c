/* Rehearsal: a round's kernels, run for nothing. */
#include "cache/pools.h"

bool karst_cache_rehearse_look(karst_cache *cache, uint32_t serial, karst_error *error)
{
    const int64_t origin[3] = {0, 0, 0};
    const karst_survey_ask ask = {.serial = serial};
    if (cache->on_host)
        return true;
    return karst_survey_begin(&cache->land.survey, &ask, error) &&
           karst_wants_begin(&cache->land.wants, serial, 0, origin, error) &&
           karst_finish(cache->context, error);
}

bool karst_cache_rehearse(karst_cache *cache, karst_error *error)
{
    const int64_t origin[3] = {0, 0, 0};
    const karst_survey_ask ask = {.serial = 1, .ages = {1, 1}};
    const karst_work work = {.load_nodes = cache->load_nodes,
                             .load_slots = cache->load_slots,
                             .load_results = cache->load_results,
                             .subdivide_nodes = cache->subdivide_nodes,
                             .subdivide_tiles = cache->subdivide_tiles,
                             .num_loads = 1,
                             .num_subdivides = 1};
    /* Node 0, for which tile 0 and brick 0 are: they are nobody's. */
    cache->granted_bricks[0] = cache->granted_tiles[0] = 0;
    cache->num_granted_bricks = cache->num_granted_tiles = 1;
    if (!karst_cache_publish(cache, &work, NULL, NULL, error))
        return false;
    if (cache->on_host)
        return true;
    return karst_wants_accept(&cache->land.wants, work.load_nodes, 1, work.subdivide_nodes, 1, 1, error) &&
           karst_wants_begin(&cache->land.wants, 1, 0, origin, error) &&
           karst_survey_begin(&cache->land.survey, &ask, error) &&
           karst_finish(cache->context, error);
}
