/* Eviction: launchers of evict.cl, and the passes until there is room. */
#include "cache/evict.h"

#include <stdlib.h>

#define STAGE KARST_STAGE_COLLECT
#define IDENTITIES (1 + KARST_TILE_NODES) /* of a tile: its own and its nodes' */

bool karst_evict_init(karst_evict *evict, karst_context *context, karst_program *program,
                      const karst_cache_buffers *pools, karst_error *error)
{
    *evict = (karst_evict){.context = context, .shape = karst_shape_of(context), .pools = pools};
    size_t num = KARST_CACHE_MAX_WORK;
    evict->victims = karst_buffer_create(context, "work_lists", num * sizeof(uint32_t), NULL, error);
    evict->tile_bricks =
        karst_buffer_create(context, "work_lists", num * KARST_TILE_NODES * sizeof(uint32_t), NULL, error);
    evict->identities = karst_buffer_create(context, "work_lists", num * IDENTITIES * sizeof(uint64_t), NULL, error);
    if (!evict->victims || !evict->tile_bricks || !evict->identities)
        return false;
    evict->host_tile_bricks = malloc(num * KARST_TILE_NODES * sizeof(uint32_t));
    evict->host_identities = malloc(num * IDENTITIES * sizeof(uint64_t));
    if (!evict->host_tile_bricks || !evict->host_identities)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of evictions");
    return (evict->tiles = karst_program_kernel(program, "karst_evict_tiles", error)) &&
           (evict->bricks = karst_program_kernel(program, "karst_evict_bricks", error));
}

void karst_evict_finish(karst_evict *evict)
{
    if (evict->tiles)
        clReleaseKernel(evict->tiles);
    if (evict->bricks)
        clReleaseKernel(evict->bricks);
    karst_buffer_destroy(evict->victims);
    karst_buffer_destroy(evict->tile_bricks);
    karst_buffer_destroy(evict->identities);
    free(evict->host_tile_bricks);
    free(evict->host_identities);
    *evict = (karst_evict){0};
}

static bool launch_tiles(karst_evict *evict, uint32_t num, karst_error *error)
{
    const karst_cache_buffers *pools = evict->pools;
    return KARST_ARGUMENTS(evict->tiles, error, KARST_BUFFER_ARG(evict->victims), KARST_VALUE_ARG(num),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info),
                           KARST_BUFFER_ARG(pools->brick_owner), KARST_BUFFER_ARG(evict->tile_bricks),
                           KARST_BUFFER_ARG(evict->identities)) &&
           karst_launch(evict->context, evict->tiles, STAGE, num, evict->shape.item_local, error);
}

static bool launch_bricks(karst_evict *evict, uint32_t num, karst_error *error)
{
    const karst_cache_buffers *pools = evict->pools;
    return KARST_ARGUMENTS(evict->bricks, error, KARST_BUFFER_ARG(evict->victims), KARST_VALUE_ARG(num),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info),
                           KARST_BUFFER_ARG(pools->brick_owner), KARST_BUFFER_ARG(evict->identities)) &&
           karst_launch(evict->context, evict->bricks, STAGE, num, evict->shape.item_local, error);
}

/* Unlinks a pass's victims and reads which slots they are. */
static bool evict_tiles(karst_evict *evict, uint32_t num, uint32_t frame, karst_churn *churn, karst_slots *brick_slots,
                        uint32_t *slots, uint32_t *num_bricks_freed, karst_error *error)
{
    uint32_t *bricks = evict->host_tile_bricks, num_freed = 0;
    uint64_t *identities = evict->host_identities;
    if (!launch_tiles(evict, num, error) || !karst_buffer_read(evict->victims, 0, slots, num * sizeof(*slots), error) ||
        !karst_buffer_read(evict->tile_bricks, 0, bricks, num * KARST_TILE_NODES * sizeof(*bricks), error) ||
        !karst_buffer_read(evict->identities, 0, identities, num * IDENTITIES * sizeof(*identities), error))
        return false;
    for (uint32_t i = 0; i < num; i++) {
        karst_churn_evicted(churn, identities[i * IDENTITIES], frame);
        for (uint32_t j = 0; j < KARST_TILE_NODES; j++) {
            uint32_t brick = bricks[i * KARST_TILE_NODES + j];
            if (brick == KARST_NONE)
                continue;
            karst_churn_evicted(churn, identities[i * IDENTITIES + 1 + j], frame);
            bricks[num_freed++] = brick;
        }
    }
    karst_slots_give(brick_slots, bricks, num_freed);
    *num_bricks_freed += num_freed;
    return true;
}

bool karst_evict_tiles(karst_evict *evict, karst_lru *lru, uint32_t serial, uint32_t frame, uint32_t need,
                       karst_churn *churn, karst_slots *brick_slots, uint32_t *slots, uint32_t *num_evicted,
                       uint32_t *num_bricks_freed, karst_error *error)
{
    bool sorted = false;
    uint32_t num = 0;
    *num_bricks_freed = 0;
    /* What is recyclable when a pass begins goes by order of use; parents of that may be childless for the next pass.
     */
    while (num < need) {
        uint32_t taken, rest = 0;
        if (!karst_lru_take(lru, serial, false, need - num, evict->victims, 0, &taken, error))
            return false;
        if (num + taken < need && !sorted) {
            sorted = true;
            if (!karst_lru_sort(lru, serial, error) ||
                !karst_lru_take(lru, serial, false, need - num - taken, evict->victims, taken, &rest, error))
                return false;
        }
        taken += rest;
        if (taken == 0)
            break;
        if (!evict_tiles(evict, taken, frame, churn, brick_slots, slots + num, num_bricks_freed, error))
            return false;
        num += taken;
    }
    *num_evicted = num;
    return true;
}

bool karst_evict_bricks(karst_evict *evict, karst_lru *lru, uint32_t serial, uint32_t frame, uint32_t need,
                        bool may_drop_fallback, karst_churn *churn, uint32_t *slots, uint32_t *num_evicted,
                        karst_error *error)
{
    uint32_t num = 0, taken, num_ways = may_drop_fallback ? 3 : 2;
    /* In the order as it stands, then all that is not in use, then stand-ins. */
    for (uint32_t way = 0; way < num_ways && num < need; way++) {
        if ((way == 1 && !karst_lru_sort(lru, serial, error)) ||
            !karst_lru_take(lru, serial, way == 2, need - num, evict->victims, num, &taken, error))
            return false;
        num += taken;
    }
    uint64_t *identities = evict->host_identities;
    if (!launch_bricks(evict, num, error) ||
        !karst_buffer_read(evict->victims, 0, slots, num * sizeof(*slots), error) ||
        !karst_buffer_read(evict->identities, 0, identities, num * sizeof(*identities), error))
        return false;
    for (uint32_t i = 0; i < num; i++)
        karst_churn_evicted(churn, identities[i], frame);
    *num_evicted = num;
    return true;
}
