/* Eviction: launchers of evict.cl, and the passes until there is room. */
#include "cache/evict.h"

#include <stdlib.h>

#define STAGE KARST_STAGE_COLLECT

bool karst_evict_init(karst_evict *evict, karst_context *context, const karst_cache_buffers *pools, karst_lru *tiles,
                      karst_lru *bricks, const karst_mapped *mapped, karst_churn *churn, karst_slots *brick_slots,
                      karst_error *error)
{
    *evict = (karst_evict){.context = context,
                           .shape = karst_pass_shape_of(context),
                           .pools = pools,
                           .tiles = tiles,
                           .bricks = bricks,
                           .mapped = mapped,
                           .churn = churn,
                           .brick_slots = brick_slots};
    size_t num = KARST_CACHE_MAX_WORK;
    evict->evicted_tiles = karst_buffer_create(context, "work_lists", num * sizeof(karst_evicted_tile), NULL, error);
    evict->evicted_bricks = karst_buffer_create(context, "work_lists", num * sizeof(karst_evicted_brick), NULL, error);
    if (!evict->evicted_tiles || !evict->evicted_bricks)
        return false;
    evict->host_tiles = malloc(num * sizeof(*evict->host_tiles));
    evict->host_bricks = malloc(num * sizeof(*evict->host_bricks));
    if (!evict->host_tiles || !evict->host_bricks)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of evictions");
    return true;
}

bool karst_evict_take_kernels(karst_evict *evict, karst_program *program, karst_error *error)
{
    return (evict->unlink_tiles = karst_program_kernel(program, "karst_evict_tiles", error)) &&
           (evict->unlink_bricks = karst_program_kernel(program, "karst_evict_bricks", error));
}

void karst_evict_finish(karst_evict *evict)
{
    if (evict->unlink_tiles)
        clReleaseKernel(evict->unlink_tiles);
    if (evict->unlink_bricks)
        clReleaseKernel(evict->unlink_bricks);
    karst_buffer_destroy(evict->evicted_tiles);
    karst_buffer_destroy(evict->evicted_bricks);
    free(evict->host_tiles);
    free(evict->host_bricks);
    *evict = (karst_evict){0};
}

/* What a tile's unlinking touches beside itself: its bricks' owners and its parent. */
static void ask_for_tile(const karst_mapped *m, uint32_t tile)
{
    uint32_t parent = m->tile_info[tile].parent;
    for (uint32_t i = 0; i < KARST_TILE_NODES; i++)
        __builtin_prefetch(&m->brick_owner[m->nodes[tile * KARST_TILE_NODES + i].brick], 1);
    if (parent != KARST_NO_NODE) {
        __builtin_prefetch(&m->nodes[parent], 1);
        __builtin_prefetch(&m->tile_info[parent / KARST_TILE_NODES]);
    }
}

static void unlink_mapped_tiles(karst_evict *evict, uint32_t num)
{
    const karst_mapped *m = evict->mapped;
    const uint32_t *victims = evict->tiles->host_victims;
    uint64_t start_ns = karst_clock_ns();
    for (uint32_t i = 0; i < num; i++) {
        if (i + KARST_MAPPED_AHEAD < num)
            ask_for_tile(m, victims[i + KARST_MAPPED_AHEAD]);
        for (const karst_evict *e = evict->next; e; e = e->next)
            karst_evict_tile_beside(victims[i], e->mapped->nodes, m->tile_info, e->mapped->brick_owner,
                                    &e->host_tiles[i]);
        karst_evict_tile(victims[i], m->nodes, m->tile_info, m->brick_owner, &evict->host_tiles[i]);
    }
    karst_profile_add_host(evict->context, STAGE, karst_clock_ns() - start_ns);
}

static void unlink_mapped_bricks(karst_evict *evict, uint32_t num)
{
    const karst_mapped *m = evict->mapped;
    const uint32_t *victims = evict->bricks->host_victims;
    uint64_t start_ns = karst_clock_ns();
    for (uint32_t i = 0; i < num; i++) {
        if (i + KARST_MAPPED_AHEAD < num) {
            uint32_t node = m->brick_owner[victims[i + KARST_MAPPED_AHEAD]].owner;
            __builtin_prefetch(&m->nodes[node], 1);
            __builtin_prefetch(&m->tile_info[node / KARST_TILE_NODES]);
        }
        karst_evict_brick(victims[i], m->nodes, m->tile_info, m->brick_owner, &evict->host_bricks[i]);
    }
    karst_profile_add_host(evict->context, STAGE, karst_clock_ns() - start_ns);
}

static bool unlink_beside(const karst_evict *evict, const karst_lru *lru, uint32_t num, karst_error *error)
{
    return karst_beside_unlink(evict->beside, lru->victims, lru->result, num, evict->evicted_tiles, error) &&
           karst_buffer_fetch(evict->evicted_tiles, 0, evict->host_tiles, num * sizeof(*evict->host_tiles), error);
}

static bool unlink_tiles(void *user, uint32_t num, karst_error *error)
{
    karst_evict *evict = user;
    if (evict->mapped->nodes) {
        unlink_mapped_tiles(evict, num);
        return true;
    }
    const karst_cache_buffers *pools = evict->pools;
    const karst_lru *lru = evict->tiles;
    for (const karst_evict *e = evict->next; e; e = e->next)
        if (!unlink_beside(e, lru, num, error))
            return false;
    return KARST_ARGUMENTS(evict->unlink_tiles, error, KARST_BUFFER_ARG(lru->victims), KARST_BUFFER_ARG(lru->result),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info),
                           KARST_BUFFER_ARG(pools->brick_owner), KARST_BUFFER_ARG(evict->evicted_tiles),
                           KARST_BUFFER_ARG(lru->freed)) &&
           karst_launch(evict->context, evict->unlink_tiles, STAGE, num, evict->shape.item_local, error) &&
           karst_buffer_fetch(evict->evicted_tiles, 0, evict->host_tiles, num * sizeof(*evict->host_tiles), error);
}

static bool unlink_bricks(void *user, uint32_t num, karst_error *error)
{
    karst_evict *evict = user;
    if (evict->mapped->nodes) {
        unlink_mapped_bricks(evict, num);
        return true;
    }
    const karst_cache_buffers *pools = evict->pools;
    const karst_lru *lru = evict->bricks;
    return KARST_ARGUMENTS(evict->unlink_bricks, error, KARST_BUFFER_ARG(lru->victims), KARST_BUFFER_ARG(lru->result),
                           KARST_BUFFER_ARG(pools->nodes), KARST_BUFFER_ARG(pools->tile_info),
                           KARST_BUFFER_ARG(pools->brick_owner), KARST_BUFFER_ARG(evict->evicted_bricks)) &&
           karst_launch(evict->context, evict->unlink_bricks, STAGE, num, evict->shape.item_local, error) &&
           karst_buffer_fetch(evict->evicted_bricks, 0, evict->host_bricks, num * sizeof(*evict->host_bricks), error);
}

bool karst_evict_start(karst_evict *evict, uint32_t serial, uint32_t need_tiles, uint32_t need_bricks,
                       karst_error *error)
{
    evict->tiles->started = evict->bricks->started = false;
    if (evict->mapped->nodes)
        return true; /* there is nothing to wait for */
    if (need_tiles && !karst_lru_start(evict->tiles, serial, false, need_tiles, NULL, unlink_tiles, evict, error))
        return false;
    return need_bricks == 0 || karst_lru_start(evict->bricks, serial, false, need_bricks,
                                               need_tiles ? evict->tiles : NULL, unlink_bricks, evict, error);
}

static void note_names(const karst_evict *evict, const karst_evicted_tile *tile, uint32_t frame)
{
    for (uint32_t i = 0; i < KARST_TILE_NODES; i++)
        if (tile->bricks[i] != KARST_NONE)
            karst_churn_evicted(evict->churn, tile->brick_names[i], frame);
}

/* Bricks go back from last to first, so that they are handed out in order. Returns how many there were. */
static uint32_t give_bricks(const karst_evict *evict, uint32_t num)
{
    const karst_evicted_tile *tiles = evict->host_tiles;
    uint32_t num_freed = 0;
    for (uint32_t i = num; i-- > 0;)
        for (uint32_t j = KARST_TILE_NODES; j-- > 0;)
            if (tiles[i].bricks[j] != KARST_NONE) {
                karst_slots_give(evict->brick_slots, &tiles[i].bricks[j], 1);
                num_freed++;
            }
    return num_freed;
}

/* Tiles and what went with them, in all stores. */
static void note_tiles(const karst_evict *evict, uint32_t num, uint32_t frame, uint32_t *slots,
                       uint32_t *num_bricks_freed)
{
    const karst_evicted_tile *tiles = evict->host_tiles;
    for (uint32_t i = 0; i < num; i++)
        karst_churn_expect(evict->churn, tiles[i].name);
    for (uint32_t i = 0; i < num; i++) {
        slots[i] = tiles[i].slot;
        karst_churn_evicted(evict->churn, tiles[i].name, frame);
        for (const karst_evict *e = evict; e; e = e->next)
            note_names(e, &e->host_tiles[i], frame);
    }
    for (const karst_evict *e = evict; e; e = e->next)
        *num_bricks_freed += give_bricks(e, num);
}

bool karst_evict_tiles(karst_evict *evict, uint32_t serial, uint32_t frame, uint32_t need, uint32_t *slots,
                       uint32_t *num_evicted, uint32_t *num_bricks_freed, karst_error *error)
{
    const karst_lru_result *result = &evict->tiles->host_result;
    uint32_t num = 0;
    *num_bricks_freed = 0;
    /* What is recyclable when a pass begins goes by order of use; parents of that may be childless for the next pass.
     */
    while (num < need) {
        bool is_started = evict->tiles->started;
        if (!karst_lru_recycle(evict->tiles, serial, false, need - num, unlink_tiles, evict, error))
            return false;
        note_tiles(evict, result->num_taken, frame, slots + num, num_bricks_freed);
        num += result->num_taken;
        /* What was started for bricks did nothing if not all of these were taken then. */
        evict->bricks->arrived = is_started;
        evict->bricks->started = evict->bricks->started && evict->tiles->took_all_at_once;
        if (result->num_taken == 0 || result->num_kept == 0)
            break;
    }
    *num_evicted = num;
    return true;
}

bool karst_evict_bricks(karst_evict *evict, uint32_t serial, uint32_t frame, uint32_t need, bool may_drop_fallback,
                        uint32_t *slots, uint32_t *num_evicted, karst_error *error)
{
    const karst_lru_result *result = &evict->bricks->host_result;
    uint32_t num = 0;
    for (int stand_ins = 0; stand_ins <= may_drop_fallback && num < need; stand_ins++) {
        if (!karst_lru_recycle(evict->bricks, serial, stand_ins, need - num, unlink_bricks, evict, error))
            return false;
        for (uint32_t i = 0; i < result->num_taken; i++) {
            karst_churn_evicted(evict->churn, evict->host_bricks[i].name, frame);
            slots[num++] = evict->host_bricks[i].slot;
        }
    }
    *num_evicted = num;
    return true;
}
