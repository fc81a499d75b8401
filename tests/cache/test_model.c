/* The cache against a plain model of it on the host, step by step, through thousands of random steps: the same work in
 * the same order, the same victims, the same pools, on both shapes of kernels. The model keeps no lists: it sorts
 * everything by last use whenever it needs a slot. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cache/identity_shared.h"
#include "tests/support/cache_rig.h"

/* ---- the model ---- */

typedef struct {
    uint32_t class, node;
} wish;

typedef struct {
    uint32_t num_tiles, num_bricks;
    karst_node *nodes;
    karst_tile_info *tiles;
    karst_brick_owner *owners;
    uint32_t *tile_stamp, *brick_stamp, *brick_fallback;
    uint32_t *free_tiles, *free_bricks, num_free_tiles, num_free_bricks; /* the next one is the last */
    karst_churn churn;
    wish *loads, *subdivides;
    uint32_t *load_slots, *subdivide_tiles;
    uint32_t num_granted_bricks, num_granted_tiles, serial;
    karst_work work;
} model;

static void model_open(model *m, const cache_rig *rig)
{
    *m = (model){.num_tiles = rig->pools->num_tiles, .num_bricks = rig->pools->num_bricks};
    m->nodes = calloc(m->num_tiles * KARST_TILE_NODES, sizeof(*m->nodes));
    m->tiles = calloc(m->num_tiles, sizeof(*m->tiles));
    m->owners = calloc(m->num_bricks, sizeof(*m->owners));
    m->tile_stamp = calloc(m->num_tiles, sizeof(uint32_t));
    m->brick_stamp = calloc(m->num_bricks, sizeof(uint32_t));
    m->brick_fallback = calloc(m->num_bricks, sizeof(uint32_t));
    m->free_tiles = calloc(m->num_tiles, sizeof(uint32_t));
    m->free_bricks = calloc(m->num_bricks, sizeof(uint32_t));
    m->loads = calloc(m->num_tiles * KARST_TILE_NODES, sizeof(wish));
    m->subdivides = calloc(m->num_tiles * KARST_TILE_NODES, sizeof(wish));
    m->load_slots = calloc(m->num_tiles * KARST_TILE_NODES, sizeof(uint32_t));
    m->subdivide_tiles = calloc(m->num_tiles * KARST_TILE_NODES, sizeof(uint32_t));
    rig_expect(karst_churn_init(&m->churn, NULL), "churn", NULL);
    memcpy(m->tiles, rig->tiles, m->num_tiles * sizeof(*m->tiles));
    for (uint32_t brick = m->num_bricks; brick-- > 1;) {
        m->owners[brick].owner = KARST_NO_NODE;
        m->free_bricks[m->num_free_bricks++] = brick;
    }
    for (uint32_t tile = m->num_tiles; tile-- > 2;)
        m->free_tiles[m->num_free_tiles++] = tile;
}

static void model_close(model *m)
{
    void *all[] = {m->nodes,      m->tiles,       m->owners, m->tile_stamp, m->brick_stamp, m->brick_fallback,
                   m->free_tiles, m->free_bricks, m->loads,  m->subdivides, m->load_slots,  m->subdivide_tiles};
    for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++)
        free(all[i]);
    karst_churn_finish(&m->churn);
}

static uint64_t identity_of(const model *m, uint32_t node, bool as_tile)
{
    const karst_tile_info *t = &m->tiles[node / 8];
    int64_t x = t->corner[0] + (node & 1), y = t->corner[1] + (node >> 1 & 1), z = t->corner[2] + (node >> 2 & 1);
    return as_tile ? karst_identity(KARST_IDENTITY_TILE, t->level - 1, 2 * x, 2 * y, 2 * z)
                   : karst_identity(KARST_IDENTITY_BRICK, t->level, x, y, z);
}

static uint32_t class_of(const model *m, uint32_t node, const int64_t camera[3])
{
    const karst_tile_info *t = &m->tiles[node / 8];
    uint64_t gap[3];
    for (int axis = 0; axis < 3; axis++) { /* in 128 bits, the plain way */
        __int128 width = (__int128)1 << (t->level + KARST_BRICK_CELLS_LOG2);
        __int128 low = (t->corner[axis] + (int64_t)(node >> axis & 1)) * width, c = camera[axis];
        gap[axis] = (uint64_t)(c < low ? low - c : c > low + width ? c - low - width : 0);
    }
    return karst_want_class(t->level, gap[0], gap[1], gap[2]);
}

static int compare_wishes(const void *a, const void *b)
{
    const wish *x = a, *y = b;
    return x->class != y->class ? (x->class > y->class) - (x->class < y->class)
                                : (x->node > y->node) - (x->node < y->node);
}

static uint32_t age_of(const model *m, uint32_t stamp) { return stamp ? m->serial - stamp : UINT32_MAX; }

static void model_evict_tile(model *m, uint32_t tile, uint32_t frame, uint32_t *freed, uint32_t *num_freed)
{
    karst_tile_info *t = &m->tiles[tile];
    karst_churn_evicted(&m->churn,
                        karst_identity(KARST_IDENTITY_TILE, t->level, t->corner[0], t->corner[1], t->corner[2]), frame);
    for (uint32_t node = tile * 8; node < tile * 8 + 8; node++)
        if (m->nodes[node].brick) {
            karst_churn_evicted(&m->churn, identity_of(m, node, false), frame);
            m->owners[m->nodes[node].brick].owner = KARST_NO_NODE;
            freed[(*num_freed)++] = m->nodes[node].brick;
        }
    if (t->parent != KARST_NO_NODE)
        m->nodes[t->parent].link &= 0xe0000000u;
    t->in_use = 0;
}

static bool is_childless(const model *m, uint32_t tile)
{
    for (uint32_t node = tile * 8; node < tile * 8 + 8; node++)
        if (KARST_NODE_CHILDREN(m->nodes[node].link))
            return false;
    return true;
}

static void model_grant_tiles(model *m, uint32_t need, uint32_t frame)
{
    rig_aged *list = calloc(m->num_tiles, sizeof(*list));
    uint32_t *granted = m->subdivide_tiles, num = 0;
    while (num < need && m->num_free_tiles)
        granted[num++] = m->free_tiles[--m->num_free_tiles];
    while (num < need) {
        uint32_t num_listed = 0, num_freed = 0, *freed = calloc(m->num_bricks, sizeof(uint32_t));
        for (uint32_t tile = 2; tile < m->num_tiles; tile++)
            if (m->tiles[tile].in_use && m->tile_stamp[tile] != m->serial && is_childless(m, tile))
                list[num_listed++] = (rig_aged){age_of(m, m->tile_stamp[tile]), tile};
        qsort(list, num_listed, sizeof(*list), rig_compare_aged);
        uint32_t i;
        for (i = 0; i < num_listed && num < need; i++) {
            model_evict_tile(m, list[i].slot, frame, freed, &num_freed);
            granted[num++] = list[i].slot;
            m->work.num_evicted_tiles++;
        }
        m->work.num_evicted_bricks += num_freed;
        while (num_freed)
            m->free_bricks[m->num_free_bricks++] = freed[--num_freed];
        free(freed);
        if (i == 0)
            break;
    }
    m->num_granted_tiles = num;
    free(list);
}

static void model_grant_bricks(model *m, uint32_t need, uint32_t frame, bool may_drop)
{
    rig_aged *list = calloc(m->num_bricks, sizeof(*list));
    uint32_t *granted = m->load_slots, num = 0;
    while (num < need && m->num_free_bricks)
        granted[num++] = m->free_bricks[--m->num_free_bricks];
    for (int stand_ins = 0; stand_ins <= may_drop; stand_ins++) {
        uint32_t num_listed = 0;
        for (uint32_t brick = 1; brick < m->num_bricks; brick++)
            if (m->owners[brick].owner != KARST_NO_NODE && m->brick_stamp[brick] != m->serial &&
                (m->brick_fallback[brick] == m->serial) == stand_ins) {
                uint32_t a = age_of(m, m->brick_stamp[brick]), b = age_of(m, m->brick_fallback[brick]);
                list[num_listed++] = (rig_aged){a < b ? a : b, brick};
            }
        qsort(list, num_listed, sizeof(*list), rig_compare_aged);
        for (uint32_t i = 0; i < num_listed && num < need; i++) {
            uint32_t brick = list[i].slot, node = m->owners[brick].owner;
            karst_churn_evicted(&m->churn, identity_of(m, node, false), frame);
            uint32_t state = KARST_NODE_STATE(m->nodes[node].link);
            state = state == KARST_STATE_BRICK ? KARST_STATE_LOST : state; /* what is clear stays clear */
            m->nodes[node] = (karst_node){KARST_NODE_LINK(state, KARST_NODE_CHILDREN(m->nodes[node].link)), 0};
            m->owners[brick].owner = KARST_NO_NODE;
            granted[num++] = brick;
            m->work.num_evicted_bricks++;
        }
    }
    m->num_granted_bricks = num;
    free(list);
}

static void model_abandon(model *m)
{
    while (m->num_granted_tiles)
        m->free_tiles[m->num_free_tiles++] = m->subdivide_tiles[--m->num_granted_tiles];
    while (m->num_granted_bricks)
        m->free_bricks[m->num_free_bricks++] = m->load_slots[--m->num_granted_bricks];
}

static void model_collect(model *m, const cache_rig *rig, uint32_t max_tiles, uint32_t max_bricks, bool may_drop)
{
    model_abandon(m);
    m->work = (karst_work){0};
    m->serial = rig->serial;
    uint32_t num_loads = 0, num_subdivides = 0;
    for (uint32_t tile = 1; tile < m->num_tiles; tile++)
        m->work.num_used_tiles += m->tile_stamp[tile] == m->serial;
    for (uint32_t brick = 1; brick < m->num_bricks; brick++)
        m->work.num_used_bricks += m->brick_stamp[brick] == m->serial || m->brick_fallback[brick] == m->serial;
    for (uint32_t node = 8; node < m->num_tiles * 8; node++) {
        uint32_t state = KARST_NODE_STATE(m->nodes[node].link);
        if (!m->tiles[node / 8].in_use || state == KARST_STATE_AIR || state == KARST_STATE_SOLID ||
            rig->want_chunk[node / KARST_REQUEST_CHUNK] != m->serial)
            continue;
        wish w = {class_of(m, node, rig->camera.voxel) + rig_want_delay(rig, node), node};
        if (rig->want_brick[node] == m->serial && state != KARST_STATE_BRICK && !m->nodes[node].brick)
            m->loads[num_loads++] = w;
        if (rig->want_children[node] == m->serial && !KARST_NODE_CHILDREN(m->nodes[node].link) &&
            m->tiles[node / 8].level > 0)
            m->subdivides[num_subdivides++] = w;
    }
    qsort(m->loads, num_loads, sizeof(wish), compare_wishes);
    qsort(m->subdivides, num_subdivides, sizeof(wish), compare_wishes);
    m->work.num_requests = num_loads + num_subdivides;
    if (num_loads > max_bricks)
        num_loads = max_bricks;
    if (num_subdivides > max_tiles)
        num_subdivides = max_tiles;
    m->work.num_deferred_budget = m->work.num_requests - num_loads - num_subdivides;
    for (uint32_t i = 0; i < num_loads; i++)
        m->tile_stamp[m->loads[i].node / 8] = m->serial;
    for (uint32_t i = 0; i < num_subdivides; i++)
        m->tile_stamp[m->subdivides[i].node / 8] = m->serial;
    model_grant_tiles(m, num_subdivides, rig->frame);
    model_grant_bricks(m, num_loads, rig->frame, may_drop);
    m->work.num_loads = m->num_granted_bricks;
    m->work.num_subdivides = m->num_granted_tiles;
    m->work.num_starved_bricks = num_loads - m->work.num_loads;
    m->work.num_starved_tiles = num_subdivides - m->work.num_subdivides;
    for (uint32_t i = 0; i < m->work.num_loads; i++)
        m->work.num_reproduced += karst_churn_is_recent(&m->churn, identity_of(m, m->loads[i].node, false), rig->frame);
    for (uint32_t i = 0; i < m->work.num_subdivides; i++)
        m->work.num_reproduced +=
            karst_churn_is_recent(&m->churn, identity_of(m, m->subdivides[i].node, true), rig->frame);
}

static void model_publish(model *m, rig_content content)
{
    uint32_t num_loads = m->num_granted_bricks, num_tiles = m->num_granted_tiles, kept = 0;
    for (uint32_t i = 0; i < num_loads; i++) {
        uint32_t node = m->loads[i].node, slot = m->load_slots[i], link = m->nodes[node].link;
        const karst_tile_info *t = &m->tiles[node / 8];
        int64_t at[3] = {t->corner[0] + (node & 1), t->corner[1] + (node >> 1 & 1), t->corner[2] + (node >> 2 & 1)};
        uint32_t result = content(t->level, at, true);
        bool clear = result == KARST_STATE_CLEAR_AIR || result == KARST_STATE_CLEAR_SOLID;
        if (result == KARST_STATE_BRICK || (clear && KARST_NODE_STATE(link) == result)) {
            m->nodes[node] = (karst_node){KARST_NODE_LINK(result, KARST_NODE_CHILDREN(link)), slot};
            m->owners[slot] = (karst_brick_owner){node, t->generation};
            m->brick_stamp[slot] = m->serial;
            continue;
        }
        m->load_slots[kept++] = slot;
        if (clear)
            m->nodes[node].link = KARST_NODE_LINK(result, KARST_NODE_CHILDREN(link));
        if (result != KARST_STATE_AIR && result != KARST_STATE_SOLID)
            continue;
        if (KARST_NODE_CHILDREN(link))
            m->tiles[KARST_NODE_CHILDREN(link)].parent = KARST_NO_NODE;
        m->nodes[node].link = KARST_NODE_LINK(result, KARST_NONE);
    }
    m->num_granted_bricks = kept;
    kept = 0;
    for (uint32_t i = 0; i < num_tiles; i++) {
        uint32_t node = m->subdivides[i].node, tile = m->subdivide_tiles[i],
                 state = KARST_NODE_STATE(m->nodes[node].link);
        karst_tile_info *t = &m->tiles[tile], *own = &m->tiles[node / 8];
        if (state == KARST_STATE_AIR || state == KARST_STATE_SOLID) {
            m->subdivide_tiles[kept++] = tile;
            continue;
        }
        m->nodes[node].link = KARST_NODE_LINK(state, tile);
        *t = (karst_tile_info){.level = own->level - 1,
                               .parent = node,
                               .parent_generation = own->generation,
                               .generation = t->generation + 1,
                               .in_use = 1};
        for (int axis = 0; axis < 3; axis++)
            t->corner[axis] = 2 * (own->corner[axis] + (int64_t)(node >> axis & 1));
        for (uint32_t j = 0; j < 8; j++) {
            int64_t at[3] = {t->corner[0] + (j & 1), t->corner[1] + (j >> 1 & 1), t->corner[2] + (j >> 2 & 1)};
            m->nodes[tile * 8 + j] =
                (karst_node){KARST_NODE_LINK(content(t->level, at, false), KARST_NONE), KARST_NONE};
        }
        m->tile_stamp[tile] = m->serial;
    }
    m->num_granted_tiles = kept;
    model_abandon(m);
}

static void model_place_root(model *m, const int64_t corner[3], int level)
{
    karst_node old[8];
    karst_tile_info *root = &m->tiles[1];
    model_abandon(m);
    memcpy(old, m->nodes + 8, sizeof(old));
    memset(m->nodes + 8, 0, sizeof(old));
    for (uint32_t i = 0; i < 8; i++) {
        uint32_t now = 8;
        bool kept = level == root->level;
        for (int axis = 0; axis < 3; axis++) {
            int64_t at = root->corner[axis] + (int64_t)(i >> axis & 1) - corner[axis];
            kept = kept && (at == 0 || at == 1);
            now += (uint32_t)(at & 1) << axis;
        }
        if (kept)
            m->nodes[now] = old[i];
        if (KARST_NODE_CHILDREN(old[i].link))
            m->tiles[KARST_NODE_CHILDREN(old[i].link)].parent = kept ? now : KARST_NO_NODE;
        if (old[i].brick) {
            m->owners[old[i].brick].owner = kept ? now : KARST_NO_NODE;
            if (!kept)
                m->free_bricks[m->num_free_bricks++] = old[i].brick;
        }
    }
    for (int axis = 0; axis < 3; axis++)
        root->corner[axis] = corner[axis];
    root->level = level;
}

/* ---- holding one against the other ---- */

static void assert_same_work(const model *m, const cache_rig *rig)
{
    const karst_work *a = &m->work, *b = &rig->work;
    assert_int_equal(a->num_requests, b->num_requests);
    assert_int_equal(a->num_deferred_budget, b->num_deferred_budget);
    assert_int_equal(a->num_used_tiles, b->num_used_tiles);
    assert_int_equal(a->num_used_bricks, b->num_used_bricks);
    assert_int_equal(a->num_loads, b->num_loads);
    assert_int_equal(a->num_subdivides, b->num_subdivides);
    for (uint32_t i = 0; i < a->num_loads; i++) {
        assert_int_equal(m->loads[i].node, rig->load_nodes[i]);
        assert_int_equal(m->load_slots[i], rig->load_slots[i]);
    }
    for (uint32_t i = 0; i < a->num_subdivides; i++) {
        assert_int_equal(m->subdivides[i].node, rig->subdivide_nodes[i]);
        assert_int_equal(m->subdivide_tiles[i], rig->subdivide_tiles[i]);
    }
    assert_int_equal(a->num_starved_bricks, b->num_starved_bricks);
    assert_int_equal(a->num_starved_tiles, b->num_starved_tiles);
    assert_int_equal(a->num_evicted_tiles, b->num_evicted_tiles);
    assert_int_equal(a->num_evicted_bricks, b->num_evicted_bricks);
    assert_int_equal(a->num_reproduced, b->num_reproduced);
}

static void assert_same_pools(const model *m, const cache_rig *rig)
{
    for (uint32_t tile = 1; tile < m->num_tiles; tile++) {
        const karst_tile_info *a = &m->tiles[tile], *b = &rig->tiles[tile];
        assert_int_equal(a->in_use, b->in_use);
        assert_int_equal(a->generation, b->generation);
        if (!a->in_use)
            continue;
        assert_int_equal(a->level, b->level);
        assert_int_equal(a->parent, b->parent);
        if (a->parent != KARST_NO_NODE)
            assert_int_equal(a->parent_generation, b->parent_generation);
        assert_memory_equal(a->corner, b->corner, sizeof(a->corner));
        assert_memory_equal(m->nodes + tile * 8, rig->nodes + tile * 8, 8 * sizeof(karst_node));
    }
    for (uint32_t brick = 1; brick < m->num_bricks; brick++) {
        assert_int_equal(m->owners[brick].owner, rig->owners[brick].owner);
        if (m->owners[brick].owner != KARST_NO_NODE)
            assert_int_equal(m->owners[brick].owner_generation, rig->owners[brick].owner_generation);
    }
}

/* ---- random steps ---- */

static uint64_t random_state;

static uint32_t random_below(uint32_t end)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((random_state >> 33) % end);
}

/* A world of which a third is constant, some of it only found out by loading; and a producer that leaves some loads
 * out. */
static uint32_t mixed(int level, const int64_t node[3], bool load)
{
    uint64_t h = karst_identity(9, level, node[0], node[1], node[2]);
    if (h % 8 < 1)
        return h & 64 ? KARST_STATE_AIR : KARST_STATE_SOLID;
    if (!load)
        return KARST_STATE_LOST;
    if (h % 8 < 2)
        return h & 64 ? KARST_STATE_CLEAR_AIR : h & 128 ? KARST_STATE_CLEAR_SOLID : KARST_STATE_SOLID;
    return h % 64 == 7 ? KARST_STATE_UNKNOWN : KARST_STATE_BRICK;
}

/* What rays might do below a tile. `greed` in percent: how much they look at. */
static void wander(cache_rig *rig, uint32_t tile, uint32_t greed)
{
    rig->tile_stamp[tile] = rig->serial;
    for (uint32_t node = tile * 8; node < tile * 8 + 8; node++) {
        if (random_below(100) >= greed)
            continue;
        uint32_t children = KARST_NODE_CHILDREN(rig->nodes[node].link), brick = rig->nodes[node].brick;
        if (children && random_below(8)) {
            wander(rig, children, greed);
            if (random_below(4))
                continue;
        } else if (random_below(3) == 0) {
            rig_want_children(rig, node);
        }
        if (brick && random_below(3))
            rig->brick_stamp[brick] = rig->serial;
        else if (brick)
            rig->brick_fallback[brick] = rig->serial;
        else
            rig_want_brick(rig, node);
        if (random_below(3) == 0)
            rig_end_rays(rig, node, random_below(200));
    }
    if (random_below(40) == 0)
        rig->tile_stamp[tile] = rig->serial - 1; /* a shortcut went past it */
}

static void stamp(cache_rig *rig)
{
    rig_cast(rig);
    wander(rig, KARST_ROOT_TILE, random_below(8) ? 8 + random_below(60) : 95);
    for (uint32_t i = random_below(4); i > 0; i--) { /* nonsense */
        uint32_t node = random_below(rig->num_nodes);
        (random_below(2) ? rig->want_brick : rig->want_children)[node] = rig->serial;
        rig->want_chunk[node / KARST_REQUEST_CHUNK] = rig->serial;
    }
    for (int axis = 0; axis < 3; axis++)
        rig->camera.voxel[axis] += (int64_t)random_below(2001) - 1000;
}

static void take_stamps(model *m, const cache_rig *rig)
{
    memcpy(m->tile_stamp, rig->tile_stamp, m->num_tiles * sizeof(uint32_t));
    memcpy(m->brick_stamp, rig->brick_stamp, m->num_bricks * sizeof(uint32_t));
    memcpy(m->brick_fallback, rig->brick_fallback, m->num_bricks * sizeof(uint32_t));
}

static uint64_t hash_more(uint64_t hash, const void *data, size_t size_bytes)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < size_bytes; i++)
        hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

/* Who collects: the host, where memory is its own; the device, in a CPU's shape or a GPU's. */
typedef enum { ANYONE, DEVICE, GPU } collector;

/* Returns a hash of all work of the run. */
static uint64_t run(int lanes, collector who, uint64_t seed, uint32_t num_tiles, uint32_t num_bricks, int num_steps,
                    uint32_t first_serial, const char *name)
{
    karst_error error = {0};
    karst_context *context = karst_context_create("", lanes, NULL, &error);
    rig_expect(context, "karst_context_create", &error);
    context->is_cpu = context->is_cpu && who != GPU; /* the cache cuts its passes as for a GPU */
    cache_rig rig;
    model m;
    rig_open(&rig, context, num_tiles, num_bricks, 0, 4);
    if (who != ANYONE) { /* the host does without these kernels */
        rig.cache->on_host = false;
        rig_expect(karst_cache_take_kernels(rig.cache, &error), "karst_cache_take_kernels", &error);
    }
    rig.content = mixed;
    rig.serial = first_serial;
    rig.frame = first_serial;
    model_open(&m, &rig);
    random_state = seed;
    uint64_t hash = 1, evicted = 0, produced = 0, reproduced = 0, starved = 0;
    for (int step = 0; step < num_steps; step++) {
        if (random_below(25) == 0) {
            int64_t corner[3] = {rig.tiles[1].corner[0], rig.tiles[1].corner[1], rig.tiles[1].corner[2]};
            corner[random_below(3)] += (int64_t)random_below(3) - 1;
            int level = random_below(10) ? rig.tiles[1].level : 3 + (int)random_below(3);
            model_place_root(&m, corner, level);
            rig_place_root(&rig, corner, level);
            assert_same_pools(&m, &rig);
        }
        for (uint32_t casts = random_below(8) ? 1 : random_below(40); casts > 0; casts--)
            stamp(&rig);
        take_stamps(&m, &rig);
        uint32_t max_tiles = random_below(4) ? 1 + random_below(12) : 8192,
                 max_bricks = random_below(4) ? random_below(12) : 8192;
        bool may_drop = random_below(2);
        model_collect(&m, &rig, max_tiles, max_bricks, may_drop);
        rig_collect(&rig, max_tiles, max_bricks, may_drop);
        assert_same_work(&m, &rig);
        assert_same_pools(&m, &rig);
        hash = hash_more(hash, rig.load_nodes, rig.work.num_loads * 4);
        hash = hash_more(hash, rig.load_slots, rig.work.num_loads * 4);
        hash = hash_more(hash, rig.subdivide_nodes, rig.work.num_subdivides * 4);
        hash = hash_more(hash, rig.subdivide_tiles, rig.work.num_subdivides * 4);
        evicted += rig.work.num_evicted_tiles + rig.work.num_evicted_bricks;
        produced += rig.work.num_loads + rig.work.num_subdivides;
        reproduced += rig.work.num_reproduced;
        starved += rig.work.num_starved_bricks + rig.work.num_starved_tiles;
        if (random_below(20) == 0)
            continue; /* the round is dropped */
        rig_produce(&rig);
        model_publish(&m, mixed);
        rig_publish(&rig);
        assert_same_pools(&m, &rig);
    }
    print_message("# %s: %d steps, %.0f produced, %.0f evicted, %.0f again, %.0f starved\n", name, num_steps,
                  (double)produced, (double)evicted, (double)reproduced, (double)starved);
    if (!getenv("KARST_TEST_QUICK")) /* a tenth of the steps hardly fills the larger pools */
        assert_true(evicted > (uint64_t)num_steps && reproduced > 0 &&
                    (starved > 0 || num_steps < 300)); /* or the steps were too tame */
    model_close(&m);
    rig_close(&rig);
    karst_context_destroy(context);
    return hash;
}

static int quick(int num_steps) { return getenv("KARST_TEST_QUICK") ? num_steps / 10 : num_steps; }

static void test_small_pools(void **state)
{
    (void)state;
    run(0, ANYONE, 1, 40, 60, quick(3000), 0, "small pools");
}

static void test_larger_pools_through_the_wrap_of_serials(void **state)
{
    (void)state;
    run(0, ANYONE, 2, 700, 500, quick(1000), UINT32_MAX - 300, "larger pools, serials that wrap");
}

static void test_few_bricks(void **state)
{
    (void)state;
    run(0, ANYONE, 3, 300, 9, quick(1000), 77, "few bricks");
}

static void test_few_tiles(void **state)
{
    (void)state;
    run(0, ANYONE, 4, 5, 300, quick(1000), 77, "few tiles");
}

static void test_every_shape_and_every_run_does_the_same(void **state)
{
    (void)state;
    int num_steps = quick(600);
    uint64_t once = run(16, ANYONE, 5, 200, 150, num_steps, 9, "the host, if it may");
    uint64_t again = run(16, ANYONE, 5, 200, 150, num_steps, 9, "again");
    uint64_t wide = run(16, DEVICE, 5, 200, 150, num_steps, 9, "16 lanes");
    uint64_t one = run(1, DEVICE, 5, 200, 150, num_steps, 9, "1 lane");
    uint64_t gpu = run(1, GPU, 5, 200, 150, num_steps, 9, "as for a GPU");
    assert_true(once == again && once == wide && once == one && once == gpu);
    run(1, GPU, 6, 700, 500, quick(400), UINT32_MAX - 300, "as for a GPU, larger");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_small_pools),
        cmocka_unit_test(test_larger_pools_through_the_wrap_of_serials),
        cmocka_unit_test(test_few_bricks),
        cmocka_unit_test(test_few_tiles),
        cmocka_unit_test(test_every_shape_and_every_run_does_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
