/* The stores of a cache: the land, and those that are added. */
#include "cache/pools.h"

#include <stdlib.h>
#include <string.h>

/* Nothing is known of the nodes, but which tiles there are. */
static bool enter_tree(const karst_cache *cache, const karst_store *store, karst_error *error)
{
    const karst_cache_buffers *land = &cache->land.buffers;
    karst_node *nodes = malloc(land->nodes->size_bytes);
    karst_tile_info *info = malloc(land->tile_info->size_bytes);
    bool done = nodes && info;
    if (!done)
        karst_fail(error, KARST_FAILED, "out of memory for the nodes of store %s", store->name);
    done = done && karst_buffer_read(land->nodes, 0, nodes, land->nodes->size_bytes, error) &&
           karst_buffer_read(land->tile_info, 0, info, land->tile_info->size_bytes, error);
    for (uint32_t tile = 0; done && tile < land->num_tiles; tile++)
        for (uint32_t node = tile * KARST_TILE_NODES; node < (tile + 1) * KARST_TILE_NODES; node++) {
            uint32_t state = info[tile].in_use && tile != KARST_ROOT_TILE ? KARST_STATE_LOST : KARST_STATE_UNKNOWN;
            nodes[node] = (karst_node){KARST_NODE_LINK(state, KARST_NODE_CHILDREN(nodes[node].link)), KARST_NONE};
        }
    done = done && karst_buffer_write(store->buffers.nodes, 0, nodes, land->nodes->size_bytes, error);
    free(nodes);
    free(info);
    return done;
}

/* Kernels that know of further stores. They serve a cache without any as well. */
static bool take_kernels(karst_cache *cache, karst_error *error)
{
    karst_store *land = &cache->land;
    if (cache->beside_program)
        return true;
    karst_program *publish = karst_program_build(cache->context, "cache/publish.cl", "-DKARST_STORES", NULL, 0, error);
    karst_program *beside = publish ? karst_program_build(cache->context, "cache/beside.cl", "", NULL, 0, error) : NULL;
    if (!beside || !karst_publish_take_kernels(&land->publish, publish, error) ||
        !karst_beside_init(&land->beside, cache->context, beside, &land->buffers, error)) {
        /* The land's rounds go on with the kernels that there were. */
        karst_beside_finish(&land->beside);
        karst_publish_take_kernels(&land->publish, cache->program, NULL);
        karst_program_destroy(publish);
        karst_program_destroy(beside);
        return false;
    }
    karst_program_destroy(cache->program);
    cache->program = publish;
    cache->beside_program = beside;
    return true;
}

/* The device collects from now on, if it did not, where the host cannot reach into this store's buffers. */
static bool choose_collector(karst_cache *cache, karst_store *store, karst_error *error)
{
    if (cache->on_host && karst_mapped_is_possible(&store->buffers))
        return true;
    if (!karst_cache_take_kernels(cache, error) || !karst_store_take_kernels(store, cache->collect_program, error))
        return false;
    cache->on_host = false;
    return true;
}

karst_store *karst_cache_add_store(karst_cache *cache, const karst_store_config *config, karst_error *error)
{
    if (cache->num_others == KARST_CACHE_MAX_STORES - 1) {
        karst_fail(error, KARST_USAGE, "a cache has at most %u stores", KARST_CACHE_MAX_STORES);
        return NULL;
    }
    if (config->name && karst_cache_find_store(cache, config->name)) {
        karst_fail(error, KARST_USAGE, "a cache has one store of a name, and there is a store %s", config->name);
        return NULL;
    }
    karst_store *store = calloc(1, sizeof(*store));
    if (!store) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    karst_cache_abandon(cache);
    if (!take_kernels(cache, error) ||
        !karst_store_init(store, cache, cache->context, &cache->land.buffers, config, &cache->tiles, false,
                          cache->program, error) ||
        !karst_beside_init(&store->beside, cache->context, cache->beside_program, &store->buffers, error) ||
        !choose_collector(cache, store, error) || !enter_tree(cache, store, error)) {
        karst_finish(cache->context, NULL);
        karst_store_finish(store);
        free(store);
        return NULL;
    }
    store->evict.beside = &store->beside;
    store->evict.next = cache->land.evict.next;
    cache->land.evict.next = &store->evict;
    cache->others[cache->num_others++] = store;
    return store;
}

bool karst_store_forget(karst_store *store, karst_error *error)
{
    karst_cache *cache = store->cache;
    if (store == &cache->land)
        return karst_fail(error, KARST_USAGE, "the land is forgotten with all that there is (karst_cache_clear)");
    karst_cache_abandon(cache);
    store->roots_loaded = false;
    return karst_store_clear(store, error) && enter_tree(cache, store, error);
}

karst_store *karst_cache_find_store(karst_cache *cache, const char *name)
{
    for (uint32_t i = 0; i < karst_cache_num_stores(cache); i++)
        if (strcmp(karst_cache_store(cache, i)->name, name) == 0)
            return karst_cache_store(cache, i);
    return NULL;
}

const karst_cache_buffers *karst_cache_get_buffers(const karst_cache *cache) { return &cache->land.buffers; }
const karst_cache_buffers *karst_store_get_buffers(const karst_store *store) { return &store->buffers; }
const char *karst_store_name(const karst_store *store) { return store->name; }

uint32_t karst_store_count_resident(const karst_store *store)
{
    uint32_t num_granted = store->cache->asking == store ? store->cache->num_granted_bricks : 0;
    return store->brick_slots.capacity - store->brick_slots.num - num_granted;
}

bool karst_cache_count_resident(karst_cache *cache, uint32_t *num_tiles, uint32_t *num_bricks, karst_error *error)
{
    (void)error;
    *num_tiles = cache->tile_slots.capacity - cache->tile_slots.num - cache->num_granted_tiles + cache->has_root;
    *num_bricks = karst_store_count_resident(&cache->land);
    return true;
}
