/* The root: where the tree begins, and bricks that it always has. */
#include "cache/pools.h"

#include <string.h>

#define MAX_LEVEL 59 /* a node's width, 2^(level + 4) voxels, is at most 2^63 */

/* Where node `i` of a window at `from` lies in one at `to`: 0 to 7, or -1. */
static int shifted_node(int i, const int64_t from[3], const int64_t to[3])
{
    int shifted = 0;
    for (int axis = 0; axis < 3; axis++) {
        uint64_t at = (uint64_t)from[axis] + (uint64_t)(i >> axis & 1) - (uint64_t)to[axis];
        if (at > 1)
            return -1;
        shifted |= (int)at << axis;
    }
    return shifted;
}

/* Tells a tile that it hangs on `node` now (KARST_NO_NODE: on nothing). */
static bool reattach_tile(karst_cache *cache, uint32_t tile, uint32_t node, karst_error *error)
{
    return tile == KARST_NONE ||
           karst_buffer_write(cache->land.buffers.tile_info,
                              tile * sizeof(karst_tile_info) + offsetof(karst_tile_info, parent), &node, sizeof(node),
                              error);
}

/* The same of a store's brick, whose slot is free then. */
static bool reattach_brick(karst_store *store, uint32_t brick, uint32_t node, karst_error *error)
{
    if (brick == KARST_NONE)
        return true;
    if (node == KARST_NO_NODE)
        karst_store_give(store, &brick, 1);
    return karst_buffer_write(store->buffers.brick_owner,
                              brick * sizeof(karst_brick_owner) + offsetof(karst_brick_owner, owner), &node,
                              sizeof(node), error);
}

/* Moves a store's root nodes: where[i] is the node that the i-th one becomes, or KARST_NO_NODE. The land's see to the
 * tree's tiles. */
static bool move_nodes(karst_cache *cache, karst_store *store, const uint32_t where[KARST_TILE_NODES],
                       karst_error *error)
{
    const karst_cache_buffers *b = &store->buffers;
    const uint32_t first_node = KARST_ROOT_TILE * KARST_TILE_NODES;
    karst_node old_nodes[KARST_TILE_NODES] = {{0}}, new_nodes[KARST_TILE_NODES] = {{0}}; /* unknown, empty */
    if (cache->has_root &&
        !karst_buffer_read(b->nodes, first_node * sizeof(karst_node), old_nodes, sizeof(old_nodes), error))
        return false;
    for (int i = 0; i < KARST_TILE_NODES; i++) {
        const karst_node old = old_nodes[i];
        if ((store == &cache->land && !reattach_tile(cache, KARST_NODE_CHILDREN(old.link), where[i], error)) ||
            !reattach_brick(store, old.brick, where[i], error))
            return false;
        if (where[i] != KARST_NO_NODE)
            new_nodes[where[i] - first_node] = old;
    }
    store->roots_loaded = false;
    /* Wants on root nodes mean those that stood there before. */
    size_t at = first_node * sizeof(uint32_t), size = KARST_TILE_NODES * sizeof(uint32_t);
    return karst_buffer_write(b->nodes, first_node * sizeof(karst_node), new_nodes, sizeof(new_nodes), error) &&
           karst_buffer_fill(b->want_brick, 0, at, size, error) &&
           karst_buffer_fill(b->want_children, 0, at, size, error);
}

bool karst_cache_place_root(karst_cache *cache, const int64_t corner[3], int level, karst_error *error)
{
    const karst_cache_buffers *b = &cache->land.buffers;
    const uint32_t first_node = KARST_ROOT_TILE * KARST_TILE_NODES;
    if (level < 0 || level > MAX_LEVEL)
        return karst_fail(error, KARST_USAGE, "a root of level %d: levels go from 0 to %d", level, MAX_LEVEL);
    int64_t half =
        (int64_t)1 << (63 - KARST_BRICK_CELLS_LOG2 - level); /* nodes of this level on one side of the origin */
    for (int axis = 0; axis < 3; axis++)
        if (corner[axis] < -half || corner[axis] > half - 2)
            return karst_fail(error, KARST_USAGE, "a root at node %lld of level %d: its voxels are beyond 64 bits",
                              (long long)corner[axis], level);
    bool same_level = cache->has_root && level == cache->root_level;
    if (same_level && memcmp(corner, cache->root_corner, sizeof(cache->root_corner)) == 0)
        return true;
    karst_cache_abandon(cache);

    karst_tile_info info = {.generation = 1};
    uint32_t where[KARST_TILE_NODES];
    if (cache->has_root &&
        !karst_buffer_read(b->tile_info, KARST_ROOT_TILE * sizeof(info), &info, sizeof(info), error))
        return false;
    for (int i = 0; i < KARST_TILE_NODES; i++) {
        int shifted = same_level ? shifted_node(i, cache->root_corner, corner) : -1;
        where[i] = shifted < 0 ? KARST_NO_NODE : first_node + (uint32_t)shifted;
    }
    for (uint32_t i = 0; i < karst_cache_num_stores(cache); i++)
        if (!move_nodes(cache, karst_cache_store(cache, i), where, error))
            return false;
    for (int axis = 0; axis < 3; axis++)
        cache->root_corner[axis] = info.corner[axis] = corner[axis];
    cache->root_level = info.level = level;
    info.parent = KARST_NO_NODE;
    info.in_use = 1;
    cache->has_root = true;
    return karst_buffer_write(b->tile_info, KARST_ROOT_TILE * sizeof(info), &info, sizeof(info), error);
}

bool karst_store_root_work(karst_store *store, uint32_t serial, karst_work *work, karst_error *error)
{
    karst_cache *cache = store->cache;
    const uint32_t first_node = KARST_ROOT_TILE * KARST_TILE_NODES;
    karst_node nodes[KARST_TILE_NODES];
    *work = karst_cache_empty_work(cache);
    if (!cache->has_root || store->roots_loaded)
        return true;
    karst_cache_open_round(cache, store, serial);
    if (!karst_buffer_read(store->buffers.nodes, first_node * sizeof(*nodes), nodes, sizeof(nodes), error))
        return false;
    for (uint32_t i = 0; i < KARST_TILE_NODES; i++) {
        uint32_t state = KARST_NODE_STATE(nodes[i].link);
        if ((state == KARST_STATE_UNKNOWN || state == KARST_STATE_LOST) &&
            karst_slots_take(&store->root_slots, &cache->granted_bricks[work->num_loads], 1))
            store->root_nodes[work->num_loads++] = first_node + i;
    }
    cache->num_granted_bricks = work->num_loads;
    store->roots_loaded = true;
    size_t size_bytes = work->num_loads * sizeof(uint32_t);
    return karst_buffer_send(cache->load_nodes, 0, store->root_nodes, size_bytes, error) &&
           karst_buffer_send(cache->load_slots, 0, cache->granted_bricks, size_bytes, error) &&
           karst_buffer_fill(cache->load_results, KARST_STATE_UNKNOWN, 0, size_bytes, error);
}

bool karst_cache_root_work(karst_cache *cache, uint32_t serial, karst_work *work, karst_error *error)
{
    return karst_store_root_work(&cache->land, serial, work, error);
}
