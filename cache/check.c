/* The debug pass: reads the pools back and holds every reference against its counterpart. Linear in the pools. */
#include "cache/pools.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

enum { SLOT_HELD, SLOT_FREE, SLOT_GRANTED };

/* A copy of all that is looked at. */
typedef struct {
    const karst_cache *cache;
    const karst_store *store; /* whose nodes, bricks and slots these are */
    karst_error *error;
    uint32_t num_tiles, num_bricks;
    karst_node *nodes;
    karst_tile_info *tiles;
    karst_brick_owner *owners;
    uint8_t *tile_slots, *brick_slots; /* SLOT_* */
} snapshot;

static bool fault(const snapshot *s, const char *format, ...) __attribute__((format(printf, 2, 3)));
static bool fault(const snapshot *s, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof(text), format, arguments);
    va_end(arguments);
    if (s->store == &s->cache->land)
        return karst_fail(s->error, KARST_FAILED, "cache check: %s", text);
    return karst_fail(s->error, KARST_FAILED, "cache check: store %s: %s", s->store->name, text);
}

static void *copy_of(karst_buffer *buffer, karst_error *error)
{
    void *copy = malloc(buffer->size_bytes);
    if (!copy)
        karst_fail(error, KARST_FAILED, "out of memory for a copy of %s", buffer->name);
    else if (karst_buffer_read(buffer, 0, copy, buffer->size_bytes, error))
        return copy;
    free(copy);
    return NULL;
}

static bool take_snapshot(snapshot *s)
{
    const karst_cache_buffers *b = &s->store->buffers;
    s->num_tiles = b->num_tiles;
    s->num_bricks = b->num_bricks + KARST_CACHE_ROOT_BRICKS;
    s->tile_slots = calloc(s->num_tiles, 1);
    s->brick_slots = calloc(s->num_bricks, 1);
    if (!s->tile_slots || !s->brick_slots)
        return karst_fail(s->error, KARST_FAILED, "out of memory for checking the cache");
    return (s->nodes = copy_of(b->nodes, s->error)) && (s->tiles = copy_of(b->tile_info, s->error)) &&
           (s->owners = copy_of(b->brick_owner, s->error));
}

static void release_snapshot(snapshot *s)
{
    void *copies[] = {s->nodes, s->tiles, s->owners, s->tile_slots, s->brick_slots};
    for (size_t i = 0; i < sizeof(copies) / sizeof(copies[0]); i++)
        free(copies[i]);
}

/* Marks a slot that holds nothing; none may be marked twice. */
static bool mark_slot(const snapshot *s, const char *what, uint8_t *marks, uint32_t slot, uint32_t first, uint32_t last,
                      bool is_free)
{
    if (slot < first || slot > last)
        return fault(s, "%s slot %u is listed as %s, but slots go from %u to %u", what, slot,
                     is_free ? "free" : "granted", first, last);
    if (marks[slot] != SLOT_HELD)
        return fault(s, "%s slot %u is listed twice as free or granted", what, slot);
    marks[slot] = is_free ? SLOT_FREE : SLOT_GRANTED;
    return true;
}

static bool mark_free(const snapshot *s, const char *what, uint8_t *marks, const karst_slots *slots)
{
    if (slots->num > slots->capacity)
        return fault(s, "%u %s slots are free, but there are only %u", slots->num, what, slots->capacity);
    uint32_t first = slots->first_slot, last = first + slots->capacity - 1;
    for (uint32_t i = 0; i < slots->num; i++)
        if (!mark_slot(s, what, marks, karst_slots_at(slots, i), first, last, true))
            return false;
    return true;
}

static bool mark_granted(const snapshot *s, const char *what, uint8_t *marks, uint32_t first, uint32_t num_slots,
                         const uint32_t *granted, uint32_t num_granted)
{
    for (uint32_t i = 0; i < num_granted; i++)
        if (!mark_slot(s, what, marks, granted[i], first, num_slots - 1, false))
            return false;
    return true;
}

/* A node of a tile in use: its state, its brick, its children; and that these name it in turn. */
static bool check_node(const snapshot *s, uint32_t node)
{
    uint32_t tile = node / KARST_TILE_NODES, link = s->nodes[node].link, state = KARST_NODE_STATE(link);
    uint32_t child = KARST_NODE_CHILDREN(link), brick = s->nodes[node].brick;
    const karst_tile_info *info = &s->tiles[tile];
    if (state > KARST_STATE_CLEAR_SOLID || (link & 0x10000000u))
        return fault(s, "node %u (tile %u) has link %08x, which is no state", node, tile, link);
    bool clear = state == KARST_STATE_CLEAR_AIR || state == KARST_STATE_CLEAR_SOLID;
    if (!(clear || (state == KARST_STATE_BRICK) == (brick != KARST_NONE)))
        return fault(s, "node %u (tile %u) has state %u, but brick %u", node, tile, state, brick);
    /* Another store may hold something in the children of what is constant in this one. */
    if (s->cache->num_others == 0 && (state == KARST_STATE_AIR || state == KARST_STATE_SOLID) && child != KARST_NONE)
        return fault(s, "node %u (tile %u) is constant (state %u), but has children in tile %u", node, tile, state,
                     child);
    if (brick != KARST_NONE) {
        if (brick >= s->num_bricks || s->brick_slots[brick] != SLOT_HELD)
            return fault(s, "node %u (tile %u) names brick %u, which is %s", node, tile, brick,
                         brick >= s->num_bricks ? "no slot" : "free");
        if (s->owners[brick].owner != node)
            return fault(s, "node %u (tile %u) names brick %u, which belongs to node %u", node, tile, brick,
                         s->owners[brick].owner);
        if (s->owners[brick].owner_generation != info->generation)
            return fault(s, "brick %u belongs to generation %u of tile %u, which is at %u", brick,
                         s->owners[brick].owner_generation, tile, info->generation);
    }
    if (child == KARST_NONE)
        return true;
    if (child >= s->num_tiles || s->tile_slots[child] != SLOT_HELD || !s->tiles[child].in_use)
        return fault(s, "node %u (tile %u) has children in tile %u, which is %s", node, tile, child,
                     child >= s->num_tiles ? "no slot" : "free");
    if (s->tiles[child].parent != node)
        return fault(s, "node %u (tile %u) has children in tile %u, whose parent is node %u", node, tile, child,
                     s->tiles[child].parent);
    if (s->tiles[child].parent_generation != info->generation)
        return fault(s, "tile %u hangs on generation %u of tile %u, which is at %u", child,
                     s->tiles[child].parent_generation, tile, info->generation);
    /* Levels fall by one on each link: so there is no cycle. */
    if (s->tiles[child].level != info->level - 1)
        return fault(s, "tile %u is at level %d below node %u (tile %u) at level %d", child, s->tiles[child].level,
                     node, tile, info->level);
    for (int axis = 0; axis < 3; axis++) {
        uint64_t own = (uint64_t)info->corner[axis] + (node >> axis & 1);
        if ((uint64_t)s->tiles[child].corner[axis] != 2 * own)
            return fault(s, "tile %u lies at %ld on axis %d, but its parent, node %u (tile %u), at %" PRId64, child,
                         s->tiles[child].corner[axis], axis, node, tile, (int64_t)own);
    }
    return true;
}

/* Does a slot hold something where, and only where, it should? */
static bool check_tile_slot(const snapshot *s, uint32_t tile)
{
    const karst_tile_info *info = &s->tiles[tile];
    if (tile == KARST_ROOT_TILE ? info->in_use != s->cache->has_root
                                : info->in_use != (s->tile_slots[tile] == SLOT_HELD))
        return fault(s, "tile %u has in_use %u, but its slot is %s", tile, info->in_use,
                     tile == KARST_ROOT_TILE            ? "the root's"
                     : s->tile_slots[tile] == SLOT_HELD ? "neither free nor granted"
                                                        : "free or granted");
    return true;
}

static bool check_brick_slot(const snapshot *s, uint32_t brick)
{
    uint32_t owner = s->owners[brick].owner;
    if ((owner != KARST_NO_NODE) != (s->brick_slots[brick] == SLOT_HELD))
        return fault(s, "brick %u has owner %u, but its slot is %s", brick, owner,
                     s->brick_slots[brick] == SLOT_HELD ? "neither free nor granted" : "free or granted");
    return true;
}

static bool check_tile(const snapshot *s, uint32_t tile)
{
    const karst_tile_info *info = &s->tiles[tile];
    if (!info->in_use)
        return true;
    if (info->level < 0)
        return fault(s, "tile %u is at level %d", tile, info->level);
    if (tile == KARST_ROOT_TILE && info->parent != KARST_NO_NODE)
        return fault(s, "the root tile has a parent, node %u", info->parent);
    for (int axis = 0; tile == KARST_ROOT_TILE && axis < 3; axis++)
        if (info->corner[axis] != s->cache->root_corner[axis] || info->level != s->cache->root_level)
            return fault(s, "the root tile lies at %ld on axis %d, level %d, but was placed at %" PRId64 ", level %d",
                         info->corner[axis], axis, info->level, s->cache->root_corner[axis], s->cache->root_level);
    if (info->parent != KARST_NO_NODE) {
        uint32_t parent = info->parent / KARST_TILE_NODES;
        if (parent == 0 || parent >= s->num_tiles || !s->tiles[parent].in_use)
            return fault(s, "tile %u has parent node %u, whose tile is not in use", tile, info->parent);
        if (KARST_NODE_CHILDREN(s->nodes[info->parent].link) != tile)
            return fault(s, "tile %u has parent node %u, whose children are in tile %u", tile, info->parent,
                         KARST_NODE_CHILDREN(s->nodes[info->parent].link));
        if (info->parent_generation != s->tiles[parent].generation)
            return fault(s, "tile %u hangs on generation %u of tile %u, which is at %u", tile, info->parent_generation,
                         parent, s->tiles[parent].generation);
    }
    for (uint32_t i = 0; i < KARST_TILE_NODES; i++)
        if (!check_node(s, tile * KARST_TILE_NODES + i))
            return false;
    return true;
}

static bool check_brick(const snapshot *s, uint32_t brick)
{
    uint32_t owner = s->owners[brick].owner;
    if (owner == KARST_NO_NODE)
        return true;
    uint32_t tile = owner / KARST_TILE_NODES;
    if (tile == 0 || tile >= s->num_tiles || !s->tiles[tile].in_use)
        return fault(s, "brick %u belongs to node %u, whose tile is not in use", brick, owner);
    if (brick >= s->store->buffers.num_bricks && tile != KARST_ROOT_TILE)
        return fault(s, "brick %u, one of the root's, belongs to node %u (tile %u)", brick, owner, tile);
    if (s->nodes[owner].brick != brick)
        return fault(s, "brick %u belongs to node %u, which names brick %u", brick, owner, s->nodes[owner].brick);
    return true; /* generations: check_node */
}

static bool mark_all_slots(const snapshot *s)
{
    const karst_cache *cache = s->cache;
    const karst_store *store = s->store;
    uint32_t num_granted_bricks = cache->asking == store ? cache->num_granted_bricks : 0;
    return mark_free(s, "tile", s->tile_slots, &cache->tile_slots) &&
           mark_granted(s, "tile", s->tile_slots, KARST_ROOT_TILE + 1, s->num_tiles, cache->granted_tiles,
                        cache->num_granted_tiles) &&
           mark_free(s, "brick", s->brick_slots, &store->brick_slots) &&
           mark_free(s, "brick", s->brick_slots, &store->root_slots) &&
           mark_granted(s, "brick", s->brick_slots, 1, s->num_bricks, cache->granted_bricks, num_granted_bricks);
}

static bool check_store(const snapshot *s)
{
    if (!mark_all_slots(s))
        return false;
    for (uint32_t tile = KARST_ROOT_TILE; tile < s->num_tiles; tile++)
        if (!check_tile_slot(s, tile))
            return false;
    for (uint32_t brick = 1; brick < s->num_bricks; brick++)
        if (!check_brick_slot(s, brick))
            return false;
    for (uint32_t tile = KARST_ROOT_TILE; tile < s->num_tiles; tile++)
        if (!check_tile(s, tile))
            return false;
    for (uint32_t brick = 1; brick < s->num_bricks; brick++)
        if (!check_brick(s, brick))
            return false;
    return true;
}

bool karst_cache_check(karst_cache *cache, karst_error *error)
{
    bool ok = true;
    /* Each store's nodes against the tree, so all have the same links. */
    for (uint32_t i = 0; ok && i < karst_cache_num_stores(cache); i++) {
        snapshot s = {.cache = cache, .store = karst_cache_store(cache, i), .error = error};
        ok = take_snapshot(&s) && check_store(&s);
        release_snapshot(&s);
    }
    return ok;
}
