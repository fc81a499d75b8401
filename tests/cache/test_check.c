/* The debug pass finds what is broken: one deliberate fault after another in pools that are sound, each found by its
 * name. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/support/cache_rig.h"

/* A rig with a tree of some levels, bricks on it, and free slots. */
static karst_context *context;
static cache_rig rig;
static uint32_t upper, lower, other; /* tiles: below root node 0, below upper's node 0, below root node 1 */
static uint32_t brick;               /* of lower's node 2 */

static uint32_t children_of(uint32_t node) { return KARST_NODE_CHILDREN(rig.nodes[node].link); }

static uint32_t all_solid(int level, const int64_t node[3], bool load)
{
    (void)level, (void)node, (void)load;
    return KARST_STATE_SOLID;
}

static int open_rig(void **state)
{
    (void)state;
    context = rig_open_context();
    rig_open(&rig, context, 12, 12, 0, 6);
    for (uint32_t i = 0; i < 40; i++) { /* more than there is room for */
        rig_cast(&rig);
        uint32_t node = 8 + i % 8;
        rig_want_brick(&rig, node);
        rig_want_children(&rig, node);
        if (i % 3 == 0 && children_of(node)) {
            rig_want_children(&rig, children_of(node) * 8);
            rig_want_brick(&rig, children_of(node) * 8 + 1);
        }
        rig_round(&rig);
    }
    for (uint32_t node = 8; node < 10; node++) {
        rig_cast(&rig);
        rig_want_children(&rig, node);
        rig_round(&rig);
    }
    upper = children_of(8);
    other = children_of(9);
    rig_cast(&rig);
    rig_want_children(&rig, upper * 8);
    rig_round(&rig);
    lower = children_of(upper * 8);
    rig_cast(&rig);
    rig_want_brick(&rig, lower * 8 + 2);
    rig_round(&rig);
    brick = rig.nodes[lower * 8 + 2].brick;
    rig_expect(upper && lower && other && brick, "a tree", NULL);
    /* Drop a subtree: its root node's brick comes free, and it is orphaned. */
    rig_place_root(&rig, (const int64_t[3]){-2, -1, -1}, 6);
    rig_place_root(&rig, (const int64_t[3]){-1, -1, -1}, 6);
    rig_expect(children_of(8) == upper && children_of(9) == KARST_NONE && rig.tiles[other].parent == KARST_NO_NODE,
               "an orphan", NULL);
    /* A tile that is recycled for nothing: its node comes out constant. */
    rig.content = all_solid;
    rig_cast(&rig);
    rig_use_brick(&rig, brick);
    rig.tile_stamp[other] = rig.serial;
    rig_want_brick(&rig, 9);
    rig_want_children(&rig, 9);
    rig_round(&rig);
    rig.content = rig_all_bricks;
    rig_expect(rig.cache->land.brick_slots.num > 1 && rig.cache->tile_slots.num == 1, "free slots", NULL);
    rig_expect(rig.tiles[lower].in_use && rig.tiles[other].in_use && rig.owners[brick].owner == lower * 8 + 2,
               "a tree still", NULL);
    return 0;
}

static int close_rig(void **state)
{
    (void)state;
    rig_close(&rig);
    karst_context_destroy(context);
    return 0;
}

/* Puts a value into a buffer, holds the check against it, and puts the old one back. */
static void spoil(karst_buffer *buffer, size_t offset_bytes, const void *value, size_t size_bytes, const char *expected)
{
    unsigned char old[64];
    karst_error error = {0};
    assert_true(karst_cache_check(rig.cache, &error));
    assert_true(karst_buffer_read(buffer, offset_bytes, old, size_bytes, NULL));
    assert_true(memcmp(old, value, size_bytes) != 0);
    assert_true(karst_buffer_write(buffer, offset_bytes, value, size_bytes, NULL));
    bool sound = karst_cache_check(rig.cache, &error);
    if (sound || error.status != KARST_FAILED || !strstr(error.message, expected))
        fail_msg("%s at %zu: expected \"%s\" in \"%s\"", buffer->name, offset_bytes, expected,
                 sound ? "(nothing found)" : error.message);
    assert_true(karst_buffer_write(buffer, offset_bytes, old, size_bytes, NULL));
    assert_true(karst_cache_check(rig.cache, NULL));
}

static void spoil_node(uint32_t node, uint32_t link, uint32_t new_brick, const char *expected)
{
    karst_node value = {link, new_brick};
    spoil(rig.pools->nodes, node * sizeof(value), &value, sizeof(value), expected);
}

#define SPOIL_TILE(tile, field, value, expected)                                           \
    do {                                                                                   \
        karst_tile_info info = rig.tiles[tile];                                            \
        info.field = value;                                                                \
        spoil(rig.pools->tile_info, (tile) * sizeof(info), &info, sizeof(info), expected); \
    } while (0)

static void spoil_owner(uint32_t slot, uint32_t owner, uint32_t generation, const char *expected)
{
    karst_brick_owner value = {owner, generation};
    spoil(rig.pools->brick_owner, slot * sizeof(value), &value, sizeof(value), expected);
}

static uint32_t free_brick(void) { return karst_slots_at(&rig.cache->land.brick_slots, 0); }

static uint32_t a_held_brick(uint32_t not_this)
{
    for (uint32_t slot = 1; slot < rig.pools->num_bricks; slot++)
        if (slot != not_this && rig.owners[slot].owner != KARST_NO_NODE)
            return slot;
    rig_expect(false, "another brick", NULL);
    return 0;
}

static void test_nodes(void **state)
{
    (void)state;
    uint32_t node = lower * 8 + 2, lost = lower * 8 + 3;
    spoil_node(lost, KARST_NODE_LINK(7u, 0u), 0, "is no state");
    spoil_node(node, KARST_NODE_LINK(KARST_STATE_AIR, 0u), brick, "has state 1, but brick");
    spoil_node(node, KARST_NODE_LINK(KARST_STATE_SOLID, 0u), brick, "has state 2, but brick");
    spoil_node(node, KARST_NODE_LINK(KARST_STATE_CLEAR_AIR, 0u), a_held_brick(brick), "which belongs to node");
    spoil_node(lost, KARST_NODE_LINK(KARST_STATE_LOST, 0x10000000u), 0, "is no state");
    spoil_node(lost, KARST_NODE_LINK(KARST_STATE_BRICK, 0u), 0, "has state 3, but brick 0");
    spoil_node(node, KARST_NODE_LINK(KARST_STATE_LOST, 0u), brick, "has state 4, but brick");
    spoil_node(upper * 8, KARST_NODE_LINK(KARST_STATE_AIR, lower), 0, "is constant (state 1), but has children");
    spoil_node(upper * 8, KARST_NODE_LINK(KARST_STATE_SOLID, lower), 0, "is constant (state 2), but has children");
    spoil_node(node, KARST_NODE_LINK(KARST_STATE_BRICK, 0u), 12 + KARST_CACHE_ROOT_BRICKS, "which is no slot");
    spoil_node(node, KARST_NODE_LINK(KARST_STATE_BRICK, 0u), free_brick(), "which is free");
    spoil_node(node, KARST_NODE_LINK(KARST_STATE_BRICK, 0u), a_held_brick(brick), "which belongs to node");
    spoil_node(lost, KARST_NODE_LINK(KARST_STATE_BRICK, 0u), brick, "which belongs to node"); /* two nodes, one brick */
    spoil_node(lost, KARST_NODE_LINK(KARST_STATE_LOST, 12u), 0, "which is no slot");
    spoil_node(lost, KARST_NODE_LINK(KARST_STATE_LOST, lower), 0, "whose parent is node"); /* a child of its own */
    spoil_node(lost, KARST_NODE_LINK(KARST_STATE_LOST, upper), 0, "whose parent is node"); /* a cycle */
    spoil_node(lost, KARST_NODE_LINK(KARST_STATE_LOST, other), 0, "whose parent is node"); /* an orphan that is none */
    spoil_node(upper * 8, KARST_NODE_LINK(KARST_STATE_LOST, 0u), rig.nodes[upper * 8].brick,
               "whose children are in tile 0");
}

static void test_tiles(void **state)
{
    (void)state;
    SPOIL_TILE(upper, in_use, 0, "has in_use 0, but its slot is neither free nor granted");
    SPOIL_TILE(upper, in_use, 2, "has in_use 2");
    SPOIL_TILE(lower, level, 2, "is at level 2 below");
    SPOIL_TILE(lower, level, -1, "is at level -1");
    SPOIL_TILE(lower, corner[1], rig.tiles[lower].corner[1] + 2, "on axis 1, but its parent");
    SPOIL_TILE(lower, parent, upper * 8 + 1, "whose parent is node");
    SPOIL_TILE(lower, parent, KARST_NO_NODE, "whose parent is node");
    SPOIL_TILE(lower, parent_generation, rig.tiles[upper].generation + 1, "hangs on generation");
    SPOIL_TILE(lower, generation, rig.tiles[lower].generation + 1, "belongs to generation"); /* its brick notices */
    SPOIL_TILE(upper, generation, rig.tiles[upper].generation - 1, "hangs on generation");
    SPOIL_TILE(other, parent, upper * 8 + 3, "whose children are in tile");
    SPOIL_TILE(other, parent, 3, "whose tile is not in use");
    SPOIL_TILE(other, parent, 12 * 8, "whose tile is not in use");
    SPOIL_TILE(KARST_ROOT_TILE, parent, upper * 8, "the root tile has a parent");
    SPOIL_TILE(KARST_ROOT_TILE, corner[2], 7, "the root tile lies at 7 on axis 2");
    SPOIL_TILE(KARST_ROOT_TILE, level, 7, "the root tile lies at");
    SPOIL_TILE(KARST_ROOT_TILE, in_use, 0, "the root's");
    /* A free tile that says it is in use. */
    uint32_t tile = karst_slots_at(&rig.cache->tile_slots, 0);
    SPOIL_TILE(tile, in_use, 1, "but its slot is free");
}

static void test_bricks(void **state)
{
    (void)state;
    spoil_owner(brick, KARST_NO_NODE, rig.owners[brick].owner_generation, "but its slot is neither free nor granted");
    spoil_owner(brick, lower * 8 + 3, rig.owners[brick].owner_generation, "which belongs to node");
    spoil_owner(brick, lower * 8 + 2, rig.owners[brick].owner_generation + 1, "belongs to generation");
    spoil_owner(free_brick(), lower * 8 + 3, 1, "but its slot is free");
    /* A held slot whose node does not know of it, in a tile in use and in one that is not. */
    uint32_t slot = free_brick(), taken;
    karst_slots_take(&rig.cache->land.brick_slots, &taken, 1);
    assert_int_equal(taken, slot);
    karst_brick_owner owner = {lower * 8 + 3, rig.tiles[lower].generation}, nobody = {KARST_NO_NODE, 0};
    karst_error error = {0};
    assert_false(karst_cache_check(rig.cache, &error)); /* leaked: neither free nor held */
    assert_non_null(strstr(error.message, "neither free nor granted"));
    assert_true(karst_buffer_write(rig.pools->brick_owner, slot * sizeof(owner), &owner, sizeof(owner), NULL));
    error = (karst_error){0};
    assert_false(karst_cache_check(rig.cache, &error));
    assert_non_null(strstr(error.message, "which names brick 0"));
    owner.owner = 3;
    assert_true(karst_buffer_write(rig.pools->brick_owner, slot * sizeof(owner), &owner, sizeof(owner), NULL));
    error = (karst_error){0};
    assert_false(karst_cache_check(rig.cache, &error));
    assert_non_null(strstr(error.message, "whose tile is not in use"));
    assert_true(karst_buffer_write(rig.pools->brick_owner, slot * sizeof(nobody), &nobody, sizeof(nobody), NULL));
    karst_slots_give(&rig.cache->land.brick_slots, &slot, 1);
    assert_true(karst_cache_check(rig.cache, NULL));
}

static void spoil_uint32(uint32_t *place, uint32_t value, const char *expected)
{
    karst_error error = {0};
    uint32_t old = *place;
    assert_int_not_equal(old, value);
    *place = value;
    assert_false(karst_cache_check(rig.cache, &error));
    if (!strstr(error.message, expected))
        fail_msg("expected \"%s\" in \"%s\"", expected, error.message);
    *place = old;
    assert_true(karst_cache_check(rig.cache, NULL));
}

static void test_free_slots(void **state)
{
    (void)state;
    karst_slots *slots = &rig.cache->land.brick_slots;
    uint32_t *first = &slots->ring[slots->first], second = karst_slots_at(slots, 1);
    spoil_uint32(first, second, "is listed twice");
    spoil_uint32(first, brick, "but its slot is"); /* one is free and held, the other neither */
    spoil_uint32(first, 0, "is listed as free, but slots go from 1 to 11");
    spoil_uint32(first, 12, "is listed as free, but slots go from 1 to 11");
    spoil_uint32(&slots->num, slots->num - 1, "neither free nor granted");
    spoil_uint32(&slots->num, 1000, "but there are only");
    slots = &rig.cache->tile_slots;
    spoil_uint32(&slots->ring[slots->first], KARST_ROOT_TILE, "is listed as free, but slots go from 2 to 11");
    spoil_uint32(&slots->ring[slots->first], upper, "but its slot is");
}

static void test_an_open_round_is_sound_and_is_looked_at(void **state)
{
    (void)state;
    rig_cast(&rig);
    rig_want_brick(&rig, lower * 8 + 5);
    rig_want_children(&rig, 11);
    rig_collect(&rig, 10, 10, false); /* checks */
    assert_int_equal(rig.work.num_loads + rig.work.num_subdivides, 2);
    uint32_t slot = rig.load_slots[0], tile = rig.subdivide_tiles[0];
    spoil_owner(slot, lower * 8 + 5, rig.tiles[lower].generation, "free or granted");
    spoil_node(lower * 8 + 5, KARST_NODE_LINK(KARST_STATE_BRICK, 0u), slot, "which is free");
    spoil_node(11, KARST_NODE_LINK(KARST_STATE_LOST, tile), 0, "which is free");
    spoil_uint32(&rig.cache->granted_bricks[0], brick, "neither free nor granted");
    rig_produce(&rig);
    rig_publish(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nodes),
        cmocka_unit_test(test_tiles),
        cmocka_unit_test(test_bricks),
        cmocka_unit_test(test_free_slots),
        cmocka_unit_test(test_an_open_round_is_sound_and_is_looked_at),
    };
    return cmocka_run_group_tests(tests, open_rig, close_rig);
}
