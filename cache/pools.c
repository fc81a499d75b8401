/* The pools: memory, kernels, and starting over. */
#include "cache/pools.h"

#include <stdio.h>
#include <stdlib.h>

static karst_buffer *create_list(karst_cache *cache, karst_error *error)
{
    return karst_buffer_create(cache->context, "work_lists", KARST_CACHE_MAX_WORK * sizeof(uint32_t), NULL, error);
}

static bool create_lists(karst_cache *cache, karst_error *error)
{
    cache->granted_bricks = malloc(KARST_CACHE_MAX_WORK * sizeof(uint32_t));
    cache->granted_tiles = malloc(KARST_CACHE_MAX_WORK * sizeof(uint32_t));
    cache->identities = malloc(2 * KARST_CACHE_MAX_WORK * sizeof(uint64_t));
    if (!cache->granted_bricks || !cache->granted_tiles || !cache->identities)
        return karst_fail(error, KARST_FAILED, "out of memory for lists of work");
    return (cache->load_nodes = create_list(cache, error)) && (cache->load_slots = create_list(cache, error)) &&
           (cache->load_results = create_list(cache, error)) &&
           (cache->subdivide_nodes = create_list(cache, error)) &&
           (cache->subdivide_tiles = create_list(cache, error));
}

/* What of the tree is no store's; the rest are the land's nodes. */
static bool create_tree(karst_cache *cache, karst_cache_buffers *tree, uint32_t num_tiles, karst_error *error)
{
    karst_context *context = cache->context;
    *tree = (karst_cache_buffers){.num_tiles = num_tiles};
    return (tree->tile_info =
                karst_buffer_create(context, "tile_info", num_tiles * sizeof(karst_tile_info), NULL, error)) &&
           (tree->tile_stamp = karst_buffer_create(context, "stamps", num_tiles * sizeof(uint32_t), NULL, error)) &&
           karst_slots_init(&cache->tile_slots, KARST_ROOT_TILE + 1, num_tiles, error);
}

static bool create_land(karst_cache *cache, const karst_cache_buffers *tree, const karst_store_config *config,
                        karst_error *error)
{
    karst_store *land = &cache->land;
    return (cache->program = karst_program_build(cache->context, "cache/publish.cl", "", NULL, 0, error)) &&
           karst_store_init(land, cache, cache->context, tree, config, &cache->tiles, true, cache->program, error) &&
           karst_lru_init(&cache->tiles, cache->context, KARST_SURVEY_TILES, &land->buffers, &land->survey,
                          &land->mapped, error);
}

bool karst_cache_take_kernels(karst_cache *cache, karst_error *error)
{
    karst_context *context = cache->context;
    const karst_pass_shape shape = karst_pass_shape_of(context);
    char options[96];
    if (cache->collect_program)
        return true;
    snprintf(options, sizeof(options), "-DKARST_CHUNK=%u -DKARST_SCAN_WIDTH=%u", shape.chunk, shape.scan_width);
    karst_program *program = karst_program_build(context, "cache/collect.cl", options, NULL, 0, error);
    bool done = (cache->collect_program = program) && karst_lru_take_kernels(&cache->tiles, program, error);
    for (uint32_t i = 0; done && i < karst_cache_num_stores(cache); i++)
        done = karst_store_take_kernels(karst_cache_store(cache, i), program, error);
    return done;
}

karst_cache *karst_cache_create(karst_context *context, uint32_t num_tiles, uint32_t num_bricks,
                                size_t max_segment_bytes, karst_error *error)
{
    return karst_cache_create_of(context, num_tiles, num_bricks, max_segment_bytes, 16, error);
}

karst_cache *karst_cache_create_of(karst_context *context, uint32_t num_tiles, uint32_t num_bricks,
                                   size_t max_segment_bytes, int brick_bits, karst_error *error)
{
    const karst_store_config land = {.name = KARST_STORE_LAND,
                                     .num_bricks = num_bricks,
                                     .max_segment_bytes = max_segment_bytes,
                                     .brick_bits = brick_bits};
    if (num_tiles < 2 || num_bricks < 9 || num_tiles > KARST_MAX_TILES) {
        karst_fail(error, KARST_USAGE, "a cache of %u tiles and %u bricks: at least 2 and 9, and at most %u tiles",
                   num_tiles, num_bricks, KARST_MAX_TILES);
        return NULL;
    }
    karst_cache *cache = calloc(1, sizeof(*cache));
    if (!cache) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    cache->context = context;
    cache->asking = &cache->land;
    karst_cache_buffers tree = {0};
    if (create_tree(cache, &tree, num_tiles, error) && create_lists(cache, error) &&
        create_land(cache, &tree, &land, error)) {
        cache->on_host = context->is_cpu && karst_mapped_is_possible(&cache->land.buffers);
        if (cache->on_host || karst_cache_take_kernels(cache, error))
            return cache;
    }
    /* A store that was not made knows nothing of the tree. */
    cache->land.buffers.tile_info = tree.tile_info;
    cache->land.buffers.tile_stamp = tree.tile_stamp;
    karst_cache_destroy(cache);
    return NULL;
}

void karst_cache_destroy(karst_cache *cache)
{
    if (!cache)
        return;
    clFinish(cache->context->queue); /* lists that were sent but not read yet */
    karst_commit_destroy(cache->commit);
    karst_buffer *buffers[] = {cache->land.buffers.tile_info, cache->land.buffers.tile_stamp,
                               cache->load_nodes,             cache->load_slots,
                               cache->load_results,           cache->subdivide_nodes,
                               cache->subdivide_tiles};
    for (uint32_t i = 0; i < cache->num_others; i++) {
        karst_store_finish(cache->others[i]);
        free(cache->others[i]);
    }
    karst_store_finish(&cache->land);
    karst_lru_finish(&cache->tiles);
    karst_slots_finish(&cache->tile_slots);
    for (size_t i = 0; i < sizeof(buffers) / sizeof(buffers[0]); i++)
        karst_buffer_destroy(buffers[i]);
    karst_program_destroy(cache->program);
    karst_program_destroy(cache->collect_program);
    karst_program_destroy(cache->beside_program);
    free(cache->granted_bricks);
    free(cache->granted_tiles);
    free(cache->identities);
    free(cache);
}

bool karst_cache_clear(karst_cache *cache, karst_error *error)
{
    const karst_cache_buffers *tree = &cache->land.buffers;
    if (!karst_buffer_fill(tree->tile_info, 0, 0, tree->tile_info->size_bytes, error) ||
        !karst_buffer_fill(tree->tile_stamp, 0, 0, tree->tile_stamp->size_bytes, error))
        return false;
    for (uint32_t i = 0; i < karst_cache_num_stores(cache); i++)
        if (!karst_store_clear(karst_cache_store(cache, i), error))
            return false;
    karst_slots_reset(&cache->tile_slots);
    cache->num_granted_tiles = cache->num_granted_bricks = 0;
    if (!cache->has_root)
        return true;
    cache->has_root = false;
    return karst_cache_place_root(cache, cache->root_corner, cache->root_level, error);
}

void karst_cache_commit_ahead(karst_cache *cache, uint32_t num_bricks)
{
    const karst_slots *slots = &cache->land.brick_slots;
    uint32_t end = cache->num_committed, num = slots->num;
    for (uint32_t i = 0; i < (num < num_bricks ? num : num_bricks); i++) {
        uint32_t slot = karst_slots_at(slots, i);
        end = slot >= end ? slot + 1 : end;
    }
    if (end == cache->num_committed)
        return;
    if (!cache->commit)
        cache->commit = karst_commit_create(&cache->land.buffers);
    if (cache->commit)
        karst_commit_until(cache->commit, end);
    cache->num_committed = end;
}
