/* Where the pools lie. */
#include "cache/mapped.h"

bool karst_mapped_is_possible(const karst_cache_buffers *pools)
{
    const karst_buffer *const all[] = {pools->nodes,         pools->tile_info,      pools->brick_owner,
                                       pools->tile_stamp,    pools->brick_stamp,    pools->brick_fallback,
                                       pools->want_brick,    pools->want_children,  pools->want_chunk,
                                       pools->want_rays};
    bool is_possible = true;
    for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++)
        is_possible = is_possible && karst_buffer_memory(all[i]) != NULL;
    return is_possible;
}

bool karst_mapped_begin(karst_mapped *mapped, karst_error *error)
{
    const karst_cache_buffers *pools = mapped->pools;
    if (!karst_finish(pools->nodes->context, error))
        return false;
    *mapped = (karst_mapped){.pools = pools,
                             .nodes = karst_buffer_memory(pools->nodes),
                             .tile_info = karst_buffer_memory(pools->tile_info),
                             .brick_owner = karst_buffer_memory(pools->brick_owner),
                             .tile_stamp = karst_buffer_memory(pools->tile_stamp),
                             .brick_stamp = karst_buffer_memory(pools->brick_stamp),
                             .brick_fallback = karst_buffer_memory(pools->brick_fallback),
                             .want_brick = karst_buffer_memory(pools->want_brick),
                             .want_children = karst_buffer_memory(pools->want_children),
                             .want_chunk = karst_buffer_memory(pools->want_chunk),
                             .want_rays = karst_buffer_memory(pools->want_rays)};
    return true;
}

void karst_mapped_end(karst_mapped *mapped) { *mapped = (karst_mapped){.pools = mapped->pools}; }
