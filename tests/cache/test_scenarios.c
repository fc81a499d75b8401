/* The cache's rules one by one, on trees of a few nodes: what is asked for, in which order it is served, and who makes
 * room. */
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

static void test_a_tree_grows_to_level_0_and_no_further(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 64, 64, 0, 5);
    uint32_t node = ROOT_NODE(6);
    for (int level = 4; level >= 0; level--) {
        uint32_t tile = rig_grow(&rig, node);
        assert_int_not_equal(tile, KARST_NONE);
        assert_int_equal(rig.tiles[tile].level, level);
        assert_int_equal(rig.tiles[tile].parent, node);
        assert_int_equal(rig.tiles[tile].generation, 1);
        assert_int_equal(rig.tiles[tile].in_use, 1);
        assert_int_equal(rig_state(&rig, node), node == ROOT_NODE(6) ? KARST_STATE_UNKNOWN : KARST_STATE_LOST);
        node = tile * KARST_TILE_NODES + (uint32_t)level;
    }
    /* Level 0: only a brick. */
    rig_cast(&rig);
    rig_want_children(&rig, node);
    rig_want_brick(&rig, node);
    rig_round(&rig);
    assert_int_equal(rig.work.num_requests, 1);
    assert_int_equal(rig.work.num_subdivides, 0);
    assert_int_equal(rig.num_linked, 1);
    assert_int_equal(rig_state(&rig, node), KARST_STATE_BRICK);
    assert_true(rig_brick_identity(&rig, rig.nodes[node].brick) == rig_node_identity(&rig, node));
    uint32_t num_tiles, num_bricks;
    assert_true(karst_cache_count_resident(rig.cache, &num_tiles, &num_bricks, NULL));
    assert_int_equal(num_tiles, 6);
    assert_int_equal(num_bricks, 1);
    rig_close(&rig);
}

static uint32_t air_at_even_x(int level, const int64_t node[3], bool for_load)
{
    (void)level;
    return !for_load ? (node[0] & 1 ? KARST_STATE_LOST : KARST_STATE_AIR) : KARST_STATE_BRICK;
}

static void test_wants_for_what_is_there_or_cannot_be_are_ignored(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 64, 64, 0, 5);
    rig.content = air_at_even_x;
    uint32_t tile = rig_grow(&rig, ROOT_NODE(0));
    rig_load(&rig, ROOT_NODE(0));
    rig_cast(&rig);
    rig_want_children(&rig, ROOT_NODE(0));                        /* has some */
    rig_want_brick(&rig, ROOT_NODE(0));                           /* has one */
    rig_want_children(&rig, tile * KARST_TILE_NODES);             /* air */
    rig_want_brick(&rig, tile * KARST_TILE_NODES + 2);            /* air */
    rig.want_brick[40 * KARST_TILE_NODES] = rig.serial;           /* no tile */
    rig.want_brick[KARST_ROOT_TILE * 8 - 1] = rig.serial;         /* tile 0 */
    rig.want_brick[tile * KARST_TILE_NODES + 1] = rig.serial - 1; /* not this cast's */
    rig_round(&rig);
    assert_int_equal(rig.work.num_requests, 0);
    assert_int_equal(rig.work.num_loads + rig.work.num_subdivides, 0);
    /* Without its chunk's stamp a want is not seen at all. */
    rig_cast(&rig);
    rig.want_brick[tile * KARST_TILE_NODES + 1] = rig.serial;
    rig_round(&rig);
    assert_int_equal(rig.work.num_requests, 0);
    rig_close(&rig);
}

static void test_coarse_and_near_first_then_by_node(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 64, 64, 0, 8);
    uint32_t near = rig_grow(&rig, ROOT_NODE(7)); /* nodes of level 7, the camera at the corner of child 0 */
    uint32_t deep = rig_grow(&rig, near * KARST_TILE_NODES);
    rig.camera = (karst_position){.voxel = {10, 10, 10}};
    rig_cast(&rig);
    for (uint32_t i = 0; i < KARST_TILE_NODES; i++) {
        rig_want_brick(&rig, near * KARST_TILE_NODES + i);
        rig_want_brick(&rig, deep * KARST_TILE_NODES + i);
    }
    rig_want_brick(&rig, ROOT_NODE(0));
    rig_collect(&rig, 0, 12, false);
    assert_int_equal(rig.work.num_requests, 17);
    assert_int_equal(rig.work.num_loads, 12);
    assert_int_equal(rig.work.num_deferred_budget, 5);
    /* The camera is in `near` and `deep` node 0: there the distance is one voxel, and the coarser has the larger error.
     * Root node 0 ends 17.3 voxels away. Of the others those that share a face are at 2^level * 16 - 10, those at
     * edges 1.41 and at the corner 1.73 times that: `deep` is at twice the error for its distance, so it follows at
     * once. */
    uint32_t expected[12] = {near * 8, deep * 8, ROOT_NODE(0), 0};
    const uint32_t order[3][3] = {{1, 2, 4}, {3, 5, 6}, {7}};
    uint32_t at = 3;
    /* Projected errors are the same fraction of the level for both tiles, up to the camera's 10 voxels: within a class.
     */
    for (int i = 0; i < 3 && at < 12; i++)
        for (int t = 0; t < 2; t++)
            for (int j = 0; j < (i == 2 ? 1 : 3) && at < 12; j++)
                expected[at++] = (t ? deep : near) * 8 + order[i][j];
    assert_memory_equal(rig.load_nodes, expected, sizeof(expected));
    rig_close(&rig);
}

static void test_budget_and_starving_are_told_apart(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 5, 9, 0, 5); /* three tiles beside the root's, eight bricks */
    rig_cast(&rig);
    for (uint32_t i = 0; i < KARST_TILE_NODES; i++) {
        rig_want_children(&rig, ROOT_NODE(i));
        rig_want_brick(&rig, ROOT_NODE(i));
    }
    rig_collect(&rig, 6, 4, false);
    assert_int_equal(rig.work.num_requests, 16);
    assert_int_equal(rig.work.num_deferred_budget, 2 + 4);
    assert_int_equal(rig.work.num_starved_tiles, 3);
    assert_int_equal(rig.work.num_starved_bricks, 0);
    assert_int_equal(rig.work.num_subdivides, 3);
    assert_int_equal(rig.work.num_loads, 4);
    const uint32_t slots[] = {1, 2, 3, 4}, tiles[] = {2, 3, 4};
    assert_memory_equal(rig.load_slots, slots, sizeof(slots)); /* never handed out: ascending */
    assert_memory_equal(rig.subdivide_tiles, tiles, sizeof(tiles));
    rig_produce(&rig);
    rig_publish(&rig);
    assert_int_equal(rig.work.num_evicted_tiles + rig.work.num_evicted_bricks, 0);
    rig_close(&rig);
}

static void test_the_least_recently_used_go_first(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 16, 9, 0, 5);
    uint32_t brick[8];
    for (uint32_t i = 0; i < 8; i++)
        brick[i] = rig_load(&rig, ROOT_NODE(i));
    /* Use them in another order, one a cast. */
    const uint32_t order[8] = {3, 0, 7, 5, 1, 2, 6, 4};
    for (int i = 0; i < 8; i++) {
        rig_cast(&rig);
        rig_use_brick(&rig, brick[order[i]]);
        rig_round(&rig);
    }
    uint32_t tile = rig_grow(&rig, ROOT_NODE(0));
    for (uint32_t i = 0; i < 8; i++) {
        assert_int_equal(rig_load(&rig, tile * KARST_TILE_NODES + i), brick[order[i]]);
        assert_int_equal(rig.work.num_evicted_bricks, 1);
        assert_int_equal(rig_state(&rig, ROOT_NODE(order[i])), KARST_STATE_LOST);
        /* What stays is used on. */
        rig_cast(&rig);
        for (uint32_t j = 0; j <= i; j++)
            rig_use_brick(&rig, rig.nodes[tile * KARST_TILE_NODES + j].brick);
        rig_round(&rig);
    }
    rig_close(&rig);
}

static void test_tiles_with_children_or_in_use_stay(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 5, 9, 0, 5);
    uint32_t a = rig_grow(&rig, ROOT_NODE(0));
    uint32_t b = rig_grow(&rig, a * KARST_TILE_NODES);
    uint32_t c = rig_grow(&rig, ROOT_NODE(1));
    /* Nothing is free. a is the oldest, but b hangs on it; b and c are in use. */
    rig_cast(&rig);
    rig.tile_stamp[b] = rig.tile_stamp[c] = rig.serial; /* past a, as a shortcut would */
    rig_want_children(&rig, ROOT_NODE(2));
    rig_round(&rig);
    assert_int_equal(rig.work.num_starved_tiles, 1);
    assert_int_equal(rig.work.num_evicted_tiles, 0);
    assert_int_equal(rig_children(&rig, ROOT_NODE(0)), a);
    /* b is not: it goes, c stays. */
    rig_cast(&rig);
    rig.tile_stamp[c] = rig.serial;
    rig_want_children(&rig, ROOT_NODE(2));
    rig_round(&rig);
    assert_int_equal(rig.work.num_evicted_tiles, 1);
    assert_int_equal(rig_children(&rig, a * KARST_TILE_NODES), KARST_NONE);
    assert_int_equal(rig_children(&rig, ROOT_NODE(2)), b);
    assert_int_equal(rig.tiles[b].generation, 2);
    /* Two at once: c, which is left, and a, childless by now. The root tile never. */
    rig_cast(&rig);
    rig.tile_stamp[b] = rig.serial;
    for (uint32_t i = 3; i < 6; i++)
        rig_want_children(&rig, ROOT_NODE(i));
    rig_round(&rig);
    assert_int_equal(rig.work.num_evicted_tiles, 2);
    assert_int_equal(rig.work.num_starved_tiles, 1);
    assert_int_equal(rig_children(&rig, ROOT_NODE(0)), KARST_NONE);
    assert_int_equal(rig_children(&rig, ROOT_NODE(1)), KARST_NONE);
    rig_close(&rig);
}

static void test_a_whole_subtree_is_recycled_in_one_round_from_its_leaves(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 7, 9, 0, 8);
    rig_grow_chain(&rig, ROOT_NODE(0), 5); /* tiles 2 to 6: all there are */
    uint32_t tile = rig_children(&rig, ROOT_NODE(0));
    rig_cast(&rig);
    rig.tile_stamp[KARST_ROOT_TILE] = rig.serial;
    for (uint32_t i = 1; i < 6; i++)
        rig_want_children(&rig, ROOT_NODE(i));
    rig_collect(&rig, 4, 0, false);
    assert_int_equal(rig.work.num_subdivides, 4);
    const uint32_t expected[] = {6, 5, 4, 3};
    assert_memory_equal(rig.subdivide_tiles, expected, sizeof(expected));
    assert_int_equal(rig_children(&rig, ROOT_NODE(0)), tile);
    rig_produce(&rig);
    rig_publish(&rig);
    rig_close(&rig);
}

static void test_work_keeps_its_own_tile(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 4, 9, 0, 8);
    uint32_t a = rig_grow(&rig, ROOT_NODE(0)), b = rig_grow(&rig, ROOT_NODE(1));
    /* A want in b, but no stamp on b itself: a must go, although b is as unused. */
    rig_cast(&rig);
    rig_cast(&rig);
    rig.want_children[b * KARST_TILE_NODES] = rig.want_chunk[0] = rig.serial;
    rig.tile_stamp[a] = rig.serial - 1;
    rig_round(&rig);
    assert_int_equal(rig.work.num_subdivides, 1);
    assert_int_equal(rig_children(&rig, b * KARST_TILE_NODES), a);
    rig_close(&rig);
}

static void test_bricks_of_a_recycled_tile_are_free(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 3, 9, 0, 5);
    uint32_t a = rig_grow(&rig, ROOT_NODE(0));
    uint32_t b0 = rig_load(&rig, a * KARST_TILE_NODES + 3), b1 = rig_load(&rig, a * KARST_TILE_NODES + 6);
    rig_cast(&rig);
    rig_want_children(&rig, ROOT_NODE(1));
    rig_want_brick(&rig, ROOT_NODE(2));
    rig_collect(&rig, 10, 10, false);
    assert_int_equal(rig.work.num_evicted_tiles, 1);
    assert_int_equal(rig.work.num_evicted_bricks, 2);
    assert_int_equal(rig.load_slots[0], b0); /* the first to be handed out again */
    assert_int_equal(rig.owners[b1].owner, KARST_NO_NODE);
    rig_produce(&rig);
    rig_publish(&rig);
    uint32_t num_tiles, num_bricks;
    assert_true(karst_cache_count_resident(rig.cache, &num_tiles, &num_bricks, NULL));
    assert_int_equal(num_tiles, 2);
    assert_int_equal(num_bricks, 1);
    rig_close(&rig);
}

static void test_stand_ins_go_last_and_only_if_allowed(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 16, 9, 0, 5);
    uint32_t brick[8], tile = rig_grow(&rig, ROOT_NODE(0));
    for (uint32_t i = 0; i < 8; i++)
        brick[i] = rig_load(&rig, ROOT_NODE(i));
    for (int may_drop = 0; may_drop < 2; may_drop++) {
        /* One brick is stale, two are stand-ins, the rest is seen. */
        rig_cast(&rig);
        for (uint32_t i = 0; i < 8; i++)
            if (i == 5 || i == 2)
                rig_use_stand_in(&rig, brick[i]);
            else if (i != 6)
                rig_use_brick(&rig, brick[i]);
        for (uint32_t i = 0; i < 4; i++)
            rig_want_brick(&rig, tile * KARST_TILE_NODES + i);
        rig_collect(&rig, 10, 10, may_drop);
        assert_int_equal(rig.work.num_used_bricks, 7);
        const uint32_t expected[] = {brick[6], brick[2], brick[5]};
        assert_int_equal(rig.work.num_loads, may_drop ? 3 : 1);
        assert_int_equal(rig.work.num_starved_bricks, may_drop ? 1 : 3);
        assert_memory_equal(rig.load_slots, expected, rig.work.num_loads * sizeof(uint32_t));
        if (may_drop)
            break;
        /* Undo: the round is dropped, and brick 6 loaded anew. */
        rig_cast(&rig);
        rig_want_brick(&rig, ROOT_NODE(6));
        rig_round(&rig);
        assert_int_equal(rig.nodes[ROOT_NODE(6)].brick, brick[6]);
    }
    rig_produce(&rig);
    rig_publish(&rig);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_tree_grows_to_level_0_and_no_further),
        cmocka_unit_test(test_wants_for_what_is_there_or_cannot_be_are_ignored),
        cmocka_unit_test(test_coarse_and_near_first_then_by_node),
        cmocka_unit_test(test_budget_and_starving_are_told_apart),
        cmocka_unit_test(test_the_least_recently_used_go_first),
        cmocka_unit_test(test_tiles_with_children_or_in_use_stay),
        cmocka_unit_test(test_a_whole_subtree_is_recycled_in_one_round_from_its_leaves),
        cmocka_unit_test(test_work_keeps_its_own_tile),
        cmocka_unit_test(test_bricks_of_a_recycled_tile_are_free),
        cmocka_unit_test(test_stand_ins_go_last_and_only_if_allowed),
    };
    return cmocka_run_group_tests(tests, open_context, close_context);
}
