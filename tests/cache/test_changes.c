/* What changes under the cache's feet, on trees of a few nodes: bricks lost and found again, nodes that turn out
 * constant, roots that move, numbers that wrap; and how it is made and cleared. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/support/cache_rig.h"

#define ROOT_NODE(i) (KARST_ROOT_TILE * KARST_TILE_NODES + (i))

static karst_context *context;

static int open_context(void **state)
{
    (void)state;
    context = rig_open_context();
    return 0;
}

static int close_context(void **state)
{
    (void)state;
    karst_context_destroy(context);
    return 0;
}

static void test_a_lost_brick_comes_back_without_its_subtree_being_touched(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 64, 9, 0, 8);
    uint32_t a = rig_grow(&rig, ROOT_NODE(0)), node = a * KARST_TILE_NODES;
    uint32_t leaf = rig_grow_chain(&rig, node, 3);
    uint32_t old = rig_load(&rig, node);
    for (uint32_t i = 1; i < 8; i++)
        rig_load(&rig, ROOT_NODE(i));
    karst_node *before = malloc(rig.num_nodes * sizeof(karst_node));
    karst_tile_info *tiles_before = malloc(rig.pools->num_tiles * sizeof(karst_tile_info));
    /* It is the oldest: the next load takes it. */
    uint32_t b = rig_load(&rig, leaf);
    assert_int_equal(b, old);
    assert_int_equal(rig_state(&rig, node), KARST_STATE_LOST);
    assert_int_not_equal(rig_children(&rig, node), KARST_NONE);
    memcpy(before, rig.nodes, rig.num_nodes * sizeof(karst_node));
    memcpy(tiles_before, rig.tiles, rig.pools->num_tiles * sizeof(karst_tile_info));
    uint32_t again = rig_load(&rig, node);
    assert_int_equal(rig.work.num_reproduced, 1);
    assert_int_equal(rig.work.num_subdivides, 0);
    assert_int_equal(rig.work.num_evicted_tiles, 0);
    /* Only this node and the one whose brick it took differ. */
    before[node].link = KARST_NODE_LINK(KARST_STATE_BRICK, KARST_NODE_CHILDREN(before[node].link));
    before[node].brick = again;
    before[ROOT_NODE(1)] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, KARST_NONE), KARST_NONE};
    assert_memory_equal(before, rig.nodes, rig.num_nodes * sizeof(karst_node));
    assert_memory_equal(tiles_before, rig.tiles, rig.pools->num_tiles * sizeof(karst_tile_info));
    assert_true(rig_brick_identity(&rig, again) == rig_node_identity(&rig, node));
    free(before);
    free(tiles_before);
    rig_close(&rig);
}

static uint32_t solid_when_loaded(int level, const int64_t node[3], bool for_load)
{
    (void)node;
    return !for_load ? KARST_STATE_LOST : level == 5 ? KARST_STATE_SOLID : KARST_STATE_BRICK;
}

static void test_a_constant_result_orphans_children_which_are_recycled_in_time(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 6, 9, 0, 5);
    rig.content = solid_when_loaded;
    uint32_t a = rig_grow(&rig, ROOT_NODE(0)), b = rig_grow(&rig, a * KARST_TILE_NODES);
    uint32_t brick = rig_load(&rig, b * KARST_TILE_NODES + 4);
    assert_int_not_equal(brick, KARST_NONE);
    rig_load(&rig, ROOT_NODE(0));
    assert_int_equal(rig.num_constant, 1);
    assert_int_equal(rig.num_linked, 0);
    assert_int_equal(rig.nodes[ROOT_NODE(0)].link, KARST_NODE_LINK(KARST_STATE_SOLID, KARST_NONE));
    assert_int_equal(rig.tiles[a].in_use, 1);
    assert_int_equal(rig.tiles[a].parent, KARST_NO_NODE);
    assert_int_equal(rig.tiles[b].parent, a * KARST_TILE_NODES);
    /* A constant node wants nothing. */
    rig_cast(&rig);
    rig_want_brick(&rig, ROOT_NODE(0));
    rig_want_children(&rig, ROOT_NODE(0));
    rig_round(&rig);
    assert_int_equal(rig.work.num_requests, 0);
    /* Two free tiles, then b, then a, and no more. */
    for (uint32_t i = 1; i < 3; i++)
        assert_int_not_equal(rig_grow(&rig, ROOT_NODE(i)), KARST_NONE);
    rig_cast(&rig);
    for (uint32_t i = 1; i < 6; i++)
        rig_want_children(&rig, ROOT_NODE(i));
    for (uint32_t i = 1; i < 3; i++)
        rig_walk(&rig, rig_children(&rig, ROOT_NODE(i)) * KARST_TILE_NODES);
    rig_round(&rig);
    assert_int_equal(rig.work.num_evicted_tiles, 2);
    assert_int_equal(rig.work.num_evicted_bricks, 1);
    assert_int_equal(rig.work.num_starved_tiles, 1);
    assert_int_equal(rig_children(&rig, ROOT_NODE(3)), b);
    assert_int_equal(rig_children(&rig, ROOT_NODE(4)), a);
    rig_close(&rig);
}

static uint32_t clear_when_loaded(int level, const int64_t node[3], bool for_load)
{
    (void)level;
    (void)node;
    return for_load ? KARST_STATE_CLEAR_AIR : KARST_STATE_LOST;
}

/* A frame has many rounds for one serial: what was answered in one is not done again in the next. */
static void test_what_came_out_clear_is_answered(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 16, 16, 0, 5);
    rig.content = clear_when_loaded;
    rig_cast(&rig);
    rig_want_brick(&rig, ROOT_NODE(0));
    rig_want_children(&rig, ROOT_NODE(1));
    rig_round(&rig);
    assert_int_equal(rig_state(&rig, ROOT_NODE(0)), KARST_STATE_CLEAR_AIR);
    rig_round(&rig);
    assert_int_equal(rig.work.num_requests, 0);
    assert_int_equal(rig.nodes[ROOT_NODE(0)].brick, KARST_NONE);
    /* Whoever asks once more, now that it is known to be clear, gets its brick. */
    rig_want_brick(&rig, ROOT_NODE(0));
    rig_round(&rig);
    assert_int_equal(rig.work.num_loads, 1);
    assert_int_equal(rig_state(&rig, ROOT_NODE(0)), KARST_STATE_CLEAR_AIR);
    assert_int_not_equal(rig.nodes[ROOT_NODE(0)].brick, KARST_NONE);
    rig_close(&rig);
}

static void test_loaded_and_subdivided_at_once(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 16, 16, 0, 5);
    rig_cast(&rig);
    rig_want_brick(&rig, ROOT_NODE(0));
    rig_want_children(&rig, ROOT_NODE(0));
    rig_round(&rig);
    assert_int_equal(rig.nodes[ROOT_NODE(0)].link, KARST_NODE_LINK(KARST_STATE_BRICK, 2u));
    assert_int_equal(rig.nodes[ROOT_NODE(0)].brick, 1);
    /* Constant wins; tile and brick slot stay free and are the next. */
    rig.content = solid_when_loaded;
    rig_cast(&rig);
    rig_want_brick(&rig, ROOT_NODE(1));
    rig_want_children(&rig, ROOT_NODE(1));
    rig_round(&rig);
    assert_int_equal(rig.nodes[ROOT_NODE(1)].link, KARST_NODE_LINK(KARST_STATE_SOLID, KARST_NONE));
    assert_int_equal(rig.tiles[3].in_use, 0);
    rig.content = rig_all_bricks;
    assert_int_equal(rig_grow(&rig, ROOT_NODE(2)), 3);
    assert_int_equal(rig_load(&rig, ROOT_NODE(2)), 2);
    rig_close(&rig);
}

static uint32_t no_answer_for_half(int level, const int64_t node[3], bool for_load)
{
    (void)level;
    return !for_load ? KARST_STATE_LOST : node[0] == 0 ? KARST_STATE_UNKNOWN : KARST_STATE_BRICK;
}

static void test_slots_that_were_not_used_are_handed_out_next(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 16, 16, 0, 5);
    rig.content = no_answer_for_half;
    rig_cast(&rig);
    for (uint32_t i = 0; i < 8; i++)
        rig_want_brick(&rig, ROOT_NODE(i));
    rig_round(&rig);
    assert_int_equal(rig.num_linked, 4);
    assert_int_equal(rig.num_constant, 0);
    assert_int_equal(rig_state(&rig, ROOT_NODE(1)), KARST_STATE_UNKNOWN);
    rig.content = rig_all_bricks;
    rig_cast(&rig);
    for (uint32_t i = 1; i < 8; i += 2)
        rig_want_brick(&rig, ROOT_NODE(i));
    rig_round(&rig);
    const uint32_t expected[] = {2, 4, 6, 8};
    assert_memory_equal(rig.load_slots, expected, sizeof(expected));
    /* A round that is never published holds nothing back. */
    for (int i = 0; i < 40; i++) {
        rig_cast(&rig);
        for (uint32_t j = 0; j < 4; j++)
            rig_want_children(&rig, ROOT_NODE(j));
        rig_collect(&rig, 10, 10, false);
        assert_int_equal(rig.work.num_subdivides, 4);
        assert_int_equal(rig.subdivide_tiles[0], 2);
    }
    rig_close(&rig);
}

static void test_a_root_shift_keeps_what_both_windows_share(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 16, 32, 0, 6);
    uint32_t tile[8], brick[8], below[8];
    for (uint32_t i = 0; i < 8; i++) {
        tile[i] = rig_grow(&rig, ROOT_NODE(i));
        brick[i] = rig_load(&rig, ROOT_NODE(i));
        below[i] = rig_load(&rig, tile[i] * KARST_TILE_NODES + i);
    }
    /* One node on along x: the upper half becomes the lower one. */
    rig_place_root(&rig, (const int64_t[3]){0, -1, -1}, 6);
    for (uint32_t i = 0; i < 8; i++) {
        uint32_t now = ROOT_NODE(i & 6);
        if (i & 1) {
            assert_int_equal(rig.nodes[now].link, KARST_NODE_LINK(KARST_STATE_BRICK, tile[i]));
            assert_int_equal(rig.nodes[now].brick, brick[i]);
            assert_int_equal(rig.tiles[tile[i]].parent, now);
            assert_int_equal(rig.owners[brick[i]].owner, now);
        } else {
            assert_int_equal(rig.tiles[tile[i]].parent, KARST_NO_NODE);
            assert_int_equal(rig.tiles[tile[i]].in_use, 1);
            assert_int_equal(rig.owners[brick[i]].owner, KARST_NO_NODE);
            assert_int_equal(rig.nodes[ROOT_NODE(i + 1)].link, KARST_NODE_LINK(KARST_STATE_UNKNOWN, KARST_NONE));
        }
        assert_int_equal(rig.owners[below[i]].owner, tile[i] * KARST_TILE_NODES + i);
    }
    /* There and back: the same place does nothing; what left is gone. */
    rig_place_root(&rig, (const int64_t[3]){0, -1, -1}, 6);
    assert_int_equal(rig_children(&rig, ROOT_NODE(0)), tile[1]);
    rig_place_root(&rig, (const int64_t[3]){-1, -1, -1}, 6);
    assert_int_equal(rig_children(&rig, ROOT_NODE(1)), tile[1]);
    assert_int_equal(rig_children(&rig, ROOT_NODE(0)), KARST_NONE);
    /* The seven slots left, then orphans, oldest first; the four that are attached are in use. */
    rig_cast(&rig);
    for (uint32_t i = 0; i < 4; i++) {
        rig_walk(&rig, tile[2 * i + 1] * KARST_TILE_NODES);
        rig_want_children(&rig, tile[1] * KARST_TILE_NODES + i);
    }
    for (uint32_t i = 0; i < 8; i++) {
        rig_want_children(&rig, tile[3] * KARST_TILE_NODES + i);
        rig_want_children(&rig, tile[5] * KARST_TILE_NODES + i);
    }
    rig_round(&rig);
    assert_int_equal(rig.work.num_subdivides, 6 + 4);
    assert_int_equal(rig.work.num_evicted_tiles, 4);
    assert_int_equal(rig.work.num_evicted_bricks, 4);
    for (uint32_t i = 0; i < 4; i++)
        assert_int_equal(rig.subdivide_tiles[6 + i], tile[2 * i]);
    /* Another level: nothing is shared. */
    rig_place_root(&rig, (const int64_t[3]){-1, -1, -1}, 7);
    for (uint32_t i = 0; i < 8; i++)
        assert_int_equal(rig.nodes[ROOT_NODE(i)].link | rig.nodes[ROOT_NODE(i)].brick, 0);
    for (uint32_t t = 2; t < 16; t++)
        assert_true(rig.tiles[t].parent == KARST_NO_NODE || rig.tiles[t].parent / KARST_TILE_NODES > KARST_ROOT_TILE);
    rig_close(&rig);
}

/* Loads what the root lacks; returns how many loads that took. */
static uint32_t load_root(cache_rig *rig)
{
    rig_expect(karst_cache_root_work(rig->cache, rig->serial, &rig->work, NULL), "karst_cache_root_work", NULL);
    uint32_t num = rig->work.num_loads;
    rig_expect(karst_buffer_read(rig->work.load_nodes, 0, rig->load_nodes, num * sizeof(uint32_t), NULL) &&
                   karst_buffer_read(rig->work.load_slots, 0, rig->load_slots, num * sizeof(uint32_t), NULL),
               "read", NULL);
    rig_produce(rig);
    rig_publish(rig);
    return num;
}

static uint32_t air_at_low_x(int level, const int64_t node[3], bool for_load)
{
    (void)level;
    return for_load ? (node[0] < 0 ? KARST_STATE_CLEAR_AIR : KARST_STATE_BRICK) : KARST_STATE_LOST;
}

/* However tight the pool, and whatever is recycled: the root's bricks stay as long as their nodes do. */
static void test_root_bricks_are_never_recycled(void **state)
{
    (void)state;
    enum { BRICKS = 9 };
    cache_rig rig;
    rig_open(&rig, context, 32, BRICKS, 0, 6);
    rig_cast(&rig);
    assert_int_equal(load_root(&rig), 8);
    assert_int_equal(load_root(&rig), 0);
    uint32_t brick[8];
    for (uint32_t i = 0; i < 8; i++) {
        brick[i] = rig.nodes[ROOT_NODE(i)].brick;
        assert_true(brick[i] >= BRICKS);
        assert_true(rig_brick_identity(&rig, brick[i]) == rig_node_identity(&rig, ROOT_NODE(i)));
    }
    /* All eight others are used up again and again, while rays use the root's as stand-ins or not at all. */
    for (int round = 0; round < 6; round++) {
        uint32_t tile = rig_grow(&rig, ROOT_NODE((uint32_t)round));
        rig_cast(&rig);
        rig_use_stand_in(&rig, brick[round]);
        for (uint32_t i = 0; i < 8; i++)
            rig_want_brick(&rig, tile * KARST_TILE_NODES + i);
        rig_round(&rig);
        assert_int_equal(rig.work.num_loads, 8);
        assert_int_equal(rig.work.num_evicted_bricks, round ? 8 : 0);
    }
    for (uint32_t i = 0; i < 8; i++)
        assert_int_equal(rig.nodes[ROOT_NODE(i)].brick, brick[i]);
    /* Half a shift: half of them leave, and the new nodes get their slots. What needs no brick gives its slot back. */
    rig.content = air_at_low_x;
    rig_place_root(&rig, (const int64_t[3]){-2, -1, -1}, 6);
    rig_cast(&rig);
    assert_int_equal(load_root(&rig), 4);
    for (uint32_t i = 0; i < 8; i++)
        if (i & 1)
            assert_int_equal(rig.nodes[ROOT_NODE(i)].brick, brick[i & 6]);
        else
            assert_int_equal(rig_state(&rig, ROOT_NODE(i)), KARST_STATE_CLEAR_AIR);
    assert_int_equal(rig.cache->land.root_slots.num, 4);
    /* Another level: all eight anew. So after all was forgotten. */
    rig_place_root(&rig, (const int64_t[3]){-1, -1, -1}, 7);
    rig_cast(&rig);
    assert_int_equal(load_root(&rig), 8);
    assert_true(karst_cache_clear(rig.cache, NULL));
    rig_read(&rig);
    assert_int_equal(load_root(&rig), 8);
    rig_check(&rig);
    rig_close(&rig);
}

static void test_roots_beyond_64_bits_are_refused(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 16, 16, 0, 59); /* (-1, -1, -1): all that int64 voxels reach */
    karst_error error = {0};
    assert_false(karst_cache_place_root(rig.cache, (const int64_t[3]){0, 0, 0}, 59, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_false(karst_cache_place_root(rig.cache, (const int64_t[3]){0, -2, 0}, 59, NULL));
    assert_false(karst_cache_place_root(rig.cache, (const int64_t[3]){0, 0, 0}, 60, NULL));
    assert_false(karst_cache_place_root(rig.cache, (const int64_t[3]){0, 0, 0}, -1, NULL));
    assert_true(
        karst_cache_place_root(rig.cache, (const int64_t[3]){INT64_C(1) << 58, 0, -(INT64_C(1) << 59)}, 0, NULL));
    assert_false(karst_cache_place_root(rig.cache, (const int64_t[3]){0, (INT64_C(1) << 59) - 1, 0}, 0, NULL));
    assert_true(karst_cache_place_root(rig.cache, (const int64_t[3]){0, (INT64_C(1) << 59) - 2, 0}, 0, NULL));
    rig_check(&rig);
    rig_close(&rig);
}

static void test_serials_and_generations_wrap(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 4, 9, 0, 5);
    rig.serial = UINT32_MAX - 4;
    /* Free tiles were handed out almost 2^32 times. */
    for (uint32_t tile = 2; tile < 4; tile++) {
        uint32_t generation = UINT32_MAX - 1;
        assert_true(karst_buffer_write(rig.pools->tile_info,
                                       tile * sizeof(karst_tile_info) + offsetof(karst_tile_info, generation),
                                       &generation, sizeof(generation), NULL));
    }
    rig_read(&rig);
    /* Root nodes take turns with two tiles: each round recycles the one that was not used last. */
    uint32_t last = rig_grow(&rig, ROOT_NODE(0));
    for (uint32_t i = 1; i < 20; i++) {
        uint32_t tile = rig_grow(&rig, ROOT_NODE(i % 8));
        assert_int_equal(tile, i % 2 ? 3 : 2);
        assert_int_not_equal(tile, last);
        assert_int_equal(rig.tiles[tile].generation, (uint32_t)(UINT32_MAX + i / 2));
        rig_load(&rig, tile * KARST_TILE_NODES);
        last = tile;
    }
    assert_true(rig.serial > 0 && rig.serial < 40);
    rig_close(&rig);
}

static void test_tiny_segments(void **state)
{
    (void)state;
    size_t four = 4 * KARST_BRICK_STRIDE * sizeof(int16_t);
    karst_error error = {0};
    assert_null(karst_cache_create(context, 16, 25, four + 100, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_non_null(strstr(error.message, "segments"));
    assert_null(karst_cache_create(context, 16, 9, 100, NULL));
    cache_rig rig;
    rig_open(&rig, context, 16, 22, four + 100, 5); /* and eight for the root */
    assert_int_equal(rig.pools->num_segments, 8);
    assert_int_equal(rig.pools->bricks_per_segment, 4);
    for (uint32_t i = 0; i < 8; i++)
        for (uint32_t j = 0; j < i; j++)
            assert_ptr_not_equal(rig.pools->bricks[i], rig.pools->bricks[j]);
    uint32_t a = rig_grow(&rig, ROOT_NODE(0)), b = rig_grow(&rig, ROOT_NODE(1));
    rig_cast(&rig);
    for (uint32_t i = 0; i < 8; i++) {
        rig_want_brick(&rig, ROOT_NODE(i));
        rig_want_brick(&rig, a * KARST_TILE_NODES + i);
        rig_want_brick(&rig, b * KARST_TILE_NODES + i);
    }
    rig_round(&rig);
    assert_int_equal(rig.num_linked, 21);
    assert_int_equal(rig.work.num_starved_bricks, 3);
    for (uint32_t brick = 1; brick < 22; brick++)
        assert_true(rig_brick_identity(&rig, brick) == rig_node_identity(&rig, rig.owners[brick].owner));
    rig_close(&rig);
    /* Fewer than eight: the rest repeat the first. */
    rig_open(&rig, context, 16, 9, 9 * KARST_BRICK_STRIDE * sizeof(int16_t), 5);
    assert_int_equal(rig.pools->num_segments, 2);
    for (uint32_t i = 2; i < KARST_MAX_BRICK_SEGMENTS; i++)
        assert_ptr_equal(rig.pools->bricks[i], rig.pools->bricks[0]);
    rig_close(&rig);
}

static void test_churn_is_counted_for_100_frames(void **state)
{
    (void)state;
    const uint32_t pauses[] = {1, 99, 100, 101};
    for (int i = 0; i < 4; i++) {
        cache_rig rig;
        rig_open(&rig, context, 3, 9, 0, 5);
        rig.frame = UINT32_MAX - 20;
        uint32_t a = rig_grow(&rig, ROOT_NODE(0));
        rig_load(&rig, a * KARST_TILE_NODES);
        rig_load(&rig, ROOT_NODE(7));
        assert_int_equal(rig_grow(&rig, ROOT_NODE(1)), a); /* evicts the tile and its brick */
        assert_int_equal(rig.work.num_evicted_tiles, 1);
        assert_int_equal(rig.work.num_evicted_bricks, 1);
        assert_int_equal(rig.work.num_reproduced, 0);
        rig.frame += pauses[i] - 1;
        bool recent = pauses[i] <= 100;
        assert_int_equal(rig_grow(&rig, ROOT_NODE(0)), a);
        assert_int_equal(rig.work.num_reproduced, recent);
        rig.frame--; /* in the same frame */
        rig_load(&rig, a * KARST_TILE_NODES);
        assert_int_equal(rig.work.num_reproduced, recent);
        rig.frame--;
        rig_load(&rig, a * KARST_TILE_NODES + 1);
        assert_int_equal(rig.work.num_reproduced, 0);
        rig_close(&rig);
    }
}

static void test_clear_forgets_everything(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 8, 9, 0, 7);
    rig_grow_chain(&rig, ROOT_NODE(0), 4);
    for (uint32_t i = 0; i < 8; i++)
        rig_load(&rig, ROOT_NODE(i));
    rig_cast(&rig);
    rig_want_children(&rig, ROOT_NODE(3));
    rig_collect(&rig, 10, 10, false); /* and an open round */
    assert_true(karst_cache_clear(rig.cache, NULL));
    rig_check(&rig);
    rig_read(&rig);
    uint32_t num_tiles, num_bricks;
    assert_true(karst_cache_count_resident(rig.cache, &num_tiles, &num_bricks, NULL));
    assert_int_equal(num_tiles, 1);
    assert_int_equal(num_bricks, 0);
    assert_int_equal(rig.tiles[KARST_ROOT_TILE].level, 7);
    rig.serial -= 3; /* a serial from before means nothing now */
    rig_cast(&rig);
    rig_want_children(&rig, ROOT_NODE(3));
    rig_want_brick(&rig, ROOT_NODE(3));
    rig_round(&rig);
    assert_int_equal(rig.work.num_reproduced, 0);
    assert_int_equal(rig.work.num_requests, 2);
    assert_int_equal(rig.nodes[ROOT_NODE(3)].link, KARST_NODE_LINK(KARST_STATE_BRICK, 2u));
    rig_close(&rig);
}

static void test_bad_arguments_are_refused(void **state)
{
    (void)state;
    const uint32_t bad[][2] = {{1, 9}, {0, 100}, {2, 8}, {KARST_MAX_TILES + 1u, 9}};
    for (int i = 0; i < 4; i++) {
        karst_error error = {0};
        assert_null(karst_cache_create(context, bad[i][0], bad[i][1], 0, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    cache_rig rig;
    rig_open(&rig, context, 2, 9, 0, 5);
    karst_collect_params params = {.serial = 0};
    karst_error error = {0};
    assert_false(karst_cache_collect(rig.cache, &params, &rig.work, &error));
    assert_int_equal(error.status, KARST_USAGE);
    /* The smallest pool of all: a root tile and bricks for it. */
    rig_cast(&rig);
    for (uint32_t i = 0; i < 8; i++) {
        rig_want_brick(&rig, ROOT_NODE(i));
        rig_want_children(&rig, ROOT_NODE(i));
    }
    rig_round(&rig);
    assert_int_equal(rig.num_linked, 8);
    assert_int_equal(rig.work.num_starved_tiles, 8);
    rig_close(&rig);
    karst_cache_destroy(NULL);
}

static void test_memory_is_named_and_as_announced(void **state)
{
    (void)state;
    static const uint32_t sizes[3][2] = {{2, 9}, {20002, 9}, {2, 2009}};
    uint64_t total[3] = {0};
    for (int i = 0; i < 3; i++) {
        karst_cache *cache = karst_cache_create(context, sizes[i][0], sizes[i][1], 0, NULL);
        assert_non_null(cache);
        karst_stats stats = {0};
        karst_context_memory(context, &stats);
        static const char *const names[] = {"nodes",  "tile_info", "bricks",      "brick_info", "brick_owner",
                                            "stamps", "wants",     "usage_lists", "requests",   "work_lists"};
        assert_int_equal(stats.num_memory, sizeof(names) / sizeof(names[0]));
        for (size_t j = 0; j < stats.num_memory; j++) {
            size_t k = 0;
            while (k < stats.num_memory && strcmp(names[k], stats.memory[j].name))
                k++;
            assert_int_not_equal(k, stats.num_memory);
            total[i] += stats.memory[j].size_bytes;
        }
        karst_cache_destroy(cache);
    }
    print_message("# bytes: fixed %.0f, a tile %.2f, a brick %.2f\n", (double)total[0],
                  (double)(total[1] - total[0]) / 20000, (double)(total[2] - total[0]) / 2000);
    assert_true(total[1] - total[0] <= 20000u * KARST_CACHE_TILE_BYTES);
    /* Devices of many groups count each group's stamps: less than a byte a brick. */
    const uint32_t more = context->is_cpu ? 0 : 1;
    assert_true(total[2] - total[0] <= 2000u * (KARST_CACHE_BRICK_BYTES + more));
}

static void test_the_same_stamps_with_many_wants_in_pieces(void **state)
{
    (void)state;
    /* More wants than one piece of the list holds. */
    cache_rig rig;
    rig_open(&rig, context, 20000, 16, 0, 12);
    rig.skip_check = true;
    uint32_t first = KARST_ROOT_TILE, end = 2;
    rig_cast(&rig);
    for (uint32_t i = 0; i < 8; i++)
        rig_want_children(&rig, ROOT_NODE(i));
    rig_round(&rig);
    while (end < 17000) { /* whole generations, 8 times as many each */
        uint32_t next = 0;
        first = end;
        for (uint32_t tile = 2; tile < rig.pools->num_tiles; tile++)
            next += rig.tiles[tile].in_use;
        end = next + 2;
        for (int round = 0; round < 4; round++) {
            rig_cast(&rig);
            uint32_t asked = 0;
            for (uint32_t tile = 2; tile < end && asked < 16000; tile++)
                for (uint32_t i = 0; i < 8 && asked < 16000; i++)
                    if (rig_children(&rig, tile * 8 + i) == KARST_NONE) {
                        rig_want_children(&rig, tile * 8 + i);
                        asked++;
                    }
            rig_collect(&rig, KARST_CACHE_MAX_WORK, 0, false);
            rig_produce(&rig);
            rig_publish(&rig);
        }
    }
    (void)first;
    rig_cast(&rig);
    rig.camera.voxel[0] = 12345;
    uint32_t num = 0;
    for (uint32_t tile = KARST_ROOT_TILE; tile < rig.pools->num_tiles; tile++)
        for (uint32_t i = 0; rig.tiles[tile].in_use && i < 8; i++, num++)
            rig_want_brick(&rig, tile * 8 + i);
    assert_true(num > 2 * KARST_WANTS_LIST);
    rig_collect(&rig, 0, 15, false);
    assert_int_equal(rig.work.num_requests, num);
    assert_int_equal(rig.work.num_loads, 15);
    assert_int_equal(rig.work.num_deferred_budget, num - 15);
    /* The 15 best, found the slow way. */
    uint64_t best[15];
    for (int k = 0; k < 15; k++)
        best[k] = UINT64_MAX;
    for (uint32_t node = 8; node < rig.num_nodes; node++) {
        if (!rig.tiles[node / 8].in_use)
            continue;
        uint64_t key = (uint64_t)rig_want_class(&rig, node) << 32 | node;
        for (int k = 0; k < 15; k++)
            if (key < best[k]) {
                uint64_t other = best[k];
                best[k] = key;
                key = other;
            }
    }
    for (int k = 0; k < 15; k++)
        assert_int_equal(rig.load_nodes[k], (uint32_t)best[k]);
    rig_check(&rig);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_lost_brick_comes_back_without_its_subtree_being_touched),
        cmocka_unit_test(test_a_constant_result_orphans_children_which_are_recycled_in_time),
        cmocka_unit_test(test_what_came_out_clear_is_answered),
        cmocka_unit_test(test_loaded_and_subdivided_at_once),
        cmocka_unit_test(test_slots_that_were_not_used_are_handed_out_next),
        cmocka_unit_test(test_a_root_shift_keeps_what_both_windows_share),
        cmocka_unit_test(test_roots_beyond_64_bits_are_refused),
        cmocka_unit_test(test_serials_and_generations_wrap),
        cmocka_unit_test(test_root_bricks_are_never_recycled),
        cmocka_unit_test(test_tiny_segments),
        cmocka_unit_test(test_churn_is_counted_for_100_frames),
        cmocka_unit_test(test_clear_forgets_everything),
        cmocka_unit_test(test_bad_arguments_are_refused),
        cmocka_unit_test(test_memory_is_named_and_as_announced),
        cmocka_unit_test(test_the_same_stamps_with_many_wants_in_pieces),
    };
    return cmocka_run_group_tests(tests, open_context, close_context);
}
