/* Publish: launchers of publish.cl, and the slots that come back. */
#include "cache/publish.h"
#include "cache/pools.h"

#include <stdlib.h>

#define STAGE KARST_STAGE_COLLECT

bool karst_publish_init(karst_publish *publish, karst_context *context, karst_program *program,
                        const karst_cache_buffers *pools, karst_error *error)
{
    *publish = (karst_publish){.context = context, .shape = karst_shape_of(context), .pools = pools};
    publish->used = karst_buffer_create(context, "work_lists", KARST_CACHE_MAX_WORK * sizeof(uint32_t), NULL, error);
    if (!publish->used)
        return false;
    publish->host_flags = malloc(KARST_CACHE_MAX_WORK * sizeof(*publish->host_flags));
    if (!publish->host_flags)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of work");
    return (publish->loads = karst_program_kernel(program, "karst_publish_loads", error)) &&
           (publish->subdivides = karst_program_kernel(program, "karst_publish_subdivides", error));
}

void karst_publish_finish(karst_publish *publish)
{
    if (publish->loads)
        clReleaseKernel(publish->loads);
    if (publish->subdivides)
        clReleaseKernel(publish->subdivides);
    karst_buffer_destroy(publish->used);
    free(publish->host_flags);
    *publish = (karst_publish){0};
}

static bool launch_loads(karst_publish *publish, const karst_work *work, uint32_t num, uint32_t serial,
                         karst_error *error)
{
    const karst_cache_buffers *pools = publish->pools;
    return KARST_ARGUMENTS(publish->loads, error, KARST_BUFFER_ARG(work->load_nodes),
                           KARST_BUFFER_ARG(work->load_slots), KARST_BUFFER_ARG(work->load_results),
                           KARST_VALUE_ARG(num), KARST_VALUE_ARG(serial), KARST_BUFFER_ARG(pools->nodes),
                           KARST_BUFFER_ARG(pools->tile_info), KARST_BUFFER_ARG(pools->brick_owner),
                           KARST_BUFFER_ARG(pools->brick_stamp), KARST_BUFFER_ARG(pools->want_brick)) &&
           karst_launch(publish->context, publish->loads, STAGE, num, publish->shape.item_local, error);
}

static bool launch_subdivides(karst_publish *publish, const karst_work *work, uint32_t num, uint32_t serial,
                              karst_error *error)
{
    const karst_cache_buffers *pools = publish->pools;
    return KARST_ARGUMENTS(publish->subdivides, error, KARST_BUFFER_ARG(work->subdivide_nodes),
                           KARST_BUFFER_ARG(work->subdivide_tiles), KARST_VALUE_ARG(num), KARST_VALUE_ARG(serial),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info),
                           KARST_BUFFER_ARG(pools->tile_stamp), KARST_BUFFER_ARG(publish->used)) &&
           karst_launch(publish->context, publish->subdivides, STAGE, num, publish->shape.item_local, error);
}

/* Keeps of `granted` what was not used, in order. */
static void keep_unused(uint32_t *granted, uint32_t *num_granted, uint32_t i)
{
    granted[(*num_granted)++] = granted[i];
}

bool karst_cache_publish(karst_cache *cache, const karst_work *work, uint32_t *num_bricks_linked,
                         uint32_t *num_bricks_constant, karst_error *error)
{
    karst_publish *publish = &cache->publish;
    uint32_t *flags = publish->host_flags, num_linked = 0, num_constant = 0;
    uint32_t num_bricks = cache->num_granted_bricks, num_tiles = cache->num_granted_tiles;
    uint32_t num_loads = work->num_loads < num_bricks ? work->num_loads : num_bricks;
    uint32_t num_subdivides = work->num_subdivides < num_tiles ? work->num_subdivides : num_tiles;
    if (!launch_loads(publish, work, num_loads, cache->serial, error) ||
        !launch_subdivides(publish, work, num_subdivides, cache->serial, error) ||
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
