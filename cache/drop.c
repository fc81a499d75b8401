/* Drop: nodes forget what they were where content changed. The host walks the tree from its root, into boxes alone. */
#include <stdlib.h>

#include "cache/evict_shared.h"
#include "cache/pools.h"

/* The pools' parts that are looked at, in the host's memory. */
typedef struct {
    karst_store *store;
    karst_node *nodes;
    karst_tile_info *tile_info;
    karst_brick_owner *brick_owner;
    const uint32_t *brick_stamp, *brick_fallback;
    uint32_t serial;
    karst_dropped *dropped;
    karst_error *error;
} walk;

static bool map_all(walk *w, bool maps)
{
    const karst_cache_buffers *b = &w->store->buffers;
    karst_buffer *const buffers[] = {b->nodes, b->tile_info, b->brick_owner, b->brick_stamp, b->brick_fallback};
    void **const places[] = {(void **)&w->nodes, (void **)&w->tile_info, (void **)&w->brick_owner,
                             (void **)&w->brick_stamp, (void **)&w->brick_fallback};
    bool done = true;
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        if (maps)
            done = done && (*places[i] = karst_buffer_map(buffers[i], w->error));
        else if (*places[i])
            done = karst_buffer_unmap(buffers[i], *places[i], w->error) && done;
    }
    return done;
}

/* Whether [node, node + 1] of a level meets [min, max] along an axis, with the margin. 128 bits: nothing wraps. */
static bool meets(int64_t node, int level, int64_t min, int64_t max, uint32_t margin)
{
    __int128 begin = (__int128)node * ((__int128)KARST_BRICK_CELLS << level),
             end = begin + ((__int128)KARST_BRICK_CELLS << level), more = (__int128)margin << level;
    return begin <= max + more && end >= min - more;
}

static bool node_meets(const karst_tile_info *info, uint32_t child, const karst_drop_box *box)
{
    for (int axis = 0; axis < 3; axis++)
        if (!meets(info->corner[axis] + (child >> axis & 1), info->level, box->min[axis], box->max[axis],
                   box->margin_voxels))
            return false;
    return true;
}

static void remember(karst_store *store, uint32_t node)
{
    if (store->num_dropped == store->max_dropped) {
        uint32_t most = store->max_dropped ? 2 * store->max_dropped : 256;
        uint32_t *dropped = realloc(store->dropped_nodes, most * sizeof *dropped);
        if (!dropped)
            return; /* it is asked for again, as any other */
        store->dropped_nodes = dropped;
        store->max_dropped = most;
    }
    store->dropped_nodes[store->num_dropped++] = node;
}

static void drop_node(walk *w, uint32_t node)
{
    karst_node *at = &w->nodes[node];
    uint32_t state = KARST_NODE_STATE(at->link), brick = at->brick;
    bool is_root = node / KARST_TILE_NODES == KARST_ROOT_TILE;
    if (state != KARST_STATE_UNKNOWN && (state != KARST_STATE_LOST || brick != KARST_NONE))
        w->dropped->num_nodes++;
    if (brick != KARST_NONE) {
        bool is_used = w->brick_stamp[brick] == w->serial || w->brick_fallback[brick] == w->serial;
        w->dropped->num_bricks++;
        karst_detach_brick(brick, w->nodes, w->tile_info, w->brick_owner);
        karst_store_give(w->store, &brick, 1);
        at->brick = KARST_NONE;
        if (is_used && !is_root)
            remember(w->store, node);
    }
    if (state != KARST_STATE_UNKNOWN)
        at->link = KARST_NODE_LINK(KARST_STATE_LOST, KARST_NODE_CHILDREN(at->link));
    if (is_root)
        w->store->roots_loaded = false;
}

static void drop_in_tile(walk *w, uint32_t tile, const karst_drop_box *box)
{
    const karst_tile_info *info = &w->tile_info[tile];
    for (uint32_t i = 0; i < KARST_TILE_NODES; i++) {
        uint32_t node = tile * KARST_TILE_NODES + i;
        if (!node_meets(info, i, box))
            continue;
        drop_node(w, node);
        uint32_t children = KARST_NODE_CHILDREN(w->nodes[node].link);
        if (children != KARST_NONE)
            drop_in_tile(w, children, box);
    }
}

/* Coarse ones first, then in the order of nodes. */
static int compare_levels(const void *a, const void *b, void *user)
{
    const karst_tile_info *info = user;
    uint32_t p = *(const uint32_t *)a, q = *(const uint32_t *)b;
    int of_p = info[p / KARST_TILE_NODES].level, of_q = info[q / KARST_TILE_NODES].level;
    return of_p != of_q ? of_q - of_p : p < q ? -1 : p > q;
}

static bool drop_in_store(karst_store *store, const karst_drop_box *boxes, size_t num_boxes, uint32_t serial,
                          karst_dropped *dropped, karst_error *error)
{
    walk w = {.store = store, .serial = serial, .dropped = dropped, .error = error};
    bool done = map_all(&w, true);
    for (size_t i = 0; done && i < num_boxes; i++)
        drop_in_tile(&w, KARST_ROOT_TILE, &boxes[i]);
    if (done && store->num_dropped > 1)
        qsort_r(store->dropped_nodes, store->num_dropped, sizeof(uint32_t), compare_levels, w.tile_info);
    store->next_dropped = 0;
    return map_all(&w, false) && done;
}

bool karst_cache_drop(karst_cache *cache, const karst_drop_box *boxes, size_t num_boxes, uint32_t serial,
                      karst_dropped *dropped, karst_error *error)
{
    if (!cache->has_root || num_boxes == 0)
        return true;
    karst_cache_abandon(cache);
    bool done = karst_finish(cache->context, error);
    for (uint32_t i = 0; done && i < karst_cache_num_stores(cache); i++)
        done = drop_in_store(karst_cache_store(cache, i), boxes, num_boxes, serial, dropped, error);
    return done;
}

bool karst_store_drop(karst_store *store, const karst_drop_box *boxes, size_t num_boxes, uint32_t serial,
                      karst_dropped *dropped, karst_error *error)
{
    if (!store->cache->has_root || num_boxes == 0)
        return true;
    karst_cache_abandon(store->cache);
    return karst_finish(store->cache->context, error) &&
           drop_in_store(store, boxes, num_boxes, serial, dropped, error);
}

bool karst_store_drop_work(karst_store *store, uint32_t serial, karst_work *work, karst_error *error)
{
    karst_cache *cache = store->cache;
    *work = karst_cache_empty_work(cache);
    uint32_t left = store->num_dropped - store->next_dropped;
    if (left == 0) {
        store->num_dropped = store->next_dropped = 0;
        return true;
    }
    karst_cache_open_round(cache, store, serial);
    uint32_t most = left < KARST_CACHE_MAX_WORK ? left : KARST_CACHE_MAX_WORK;
    work->num_loads = karst_slots_take(&store->brick_slots, cache->granted_bricks, most);
    cache->num_granted_bricks = work->num_loads;
    const uint32_t *nodes = store->dropped_nodes + store->next_dropped;
    store->next_dropped = work->num_loads ? store->next_dropped + work->num_loads : store->num_dropped;
    size_t size_bytes = work->num_loads * sizeof(uint32_t);
    return karst_buffer_send(cache->load_nodes, 0, nodes, size_bytes, error) &&
           karst_buffer_send(cache->load_slots, 0, cache->granted_bricks, size_bytes, error) &&
           karst_buffer_fill(cache->load_results, KARST_STATE_UNKNOWN, 0, size_bytes, error);
}

bool karst_cache_drop_work(karst_cache *cache, uint32_t serial, karst_work *work, karst_error *error)
{
    return karst_store_drop_work(&cache->land, serial, work, error);
}
