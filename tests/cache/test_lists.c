/* The cache's lists against plain loops on the host: usage lists (count, scan, scatter), requests, free slots, the
 * memory of evictions. Sizes around the lengths of chunks, input that is random and input that is extreme; each on both
 * shapes of kernels. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/support/cache_rig.h"

static uint64_t random_state = 1;

static uint32_t random_below(uint32_t end)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((random_state >> 33) % end);
}

static karst_context *open_shape(bool as_gpu)
{
    karst_error error = {0};
    karst_context *context = karst_context_create("", as_gpu ? 1 : 0, NULL, &error);
    rig_expect(context, "karst_context_create", &error);
    context->is_cpu = context->is_cpu && !as_gpu;
    return context;
}

/* Lengths of lists: around words of marks, chunks of either shape, a window. */
static const uint32_t lengths[] = {1,    2,    31,   32,   33,   63,   64,   65,    2047, 2048,
                                   2049, 4095, 4096, 4097, 8191, 8192, 8193, 20001, 70000};
#define NUM_LENGTHS (sizeof(lengths) / sizeof(lengths[0]))

/* ---- usage lists ---- */

/* Which slots are what. */
typedef enum { NONE, ALL, ALTERNATING, FIRST, LAST, HALVES, RANDOM, RARE, NUM_PATTERNS } pattern;

static bool fits(pattern p, uint32_t i, uint32_t num)
{
    switch (p) {
    case NONE:
        return false;
    case ALL:
        return true;
    case ALTERNATING:
        return i & 1;
    case FIRST:
        return i == 0;
    case LAST:
        return i == num - 1;
    case HALVES:
        return i < num / 2;
    case RANDOM:
        return random_below(2);
    default:
        return random_below(100) == 0;
    }
}

static void read_order(const karst_lru *lru, uint32_t *order)
{
    rig_expect(karst_buffer_read(lru->order, 0, order, lru->num * sizeof(*order), NULL), "read", NULL);
}

static void assert_permutation(const uint32_t *order, uint32_t num)
{
    uint8_t *seen = calloc(num + 1, 1);
    for (uint32_t i = 0; i < num; i++) {
        assert_true(order[i] >= 1 && order[i] <= num && !seen[order[i]]);
        seen[order[i]] = 1;
    }
    free(seen);
}

/* Slots by (stamp, slot), the reference for a sort. */
static const uint32_t *sort_stamps;
static uint32_t sort_base;
static int compare_slots(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    uint32_t s = sort_stamps[x] ? sort_stamps[x] - sort_base : 0, t = sort_stamps[y] ? sort_stamps[y] - sort_base : 0;
    return s != t ? (s > t) - (s < t) : (x > y) - (x < y);
}

/* Stamps tiles at random within `span` casts and sorts, several times on. */
static void sorts_like_the_host(karst_cache *cache, uint32_t span, uint32_t base)
{
    karst_lru *lru = &cache->tiles;
    uint32_t num = lru->num;
    assert_true(karst_lru_reset(lru, NULL));
    uint32_t *stamps = calloc(num + 1, sizeof(uint32_t)), *order = calloc(num, sizeof(uint32_t)),
             *expected = calloc(num, sizeof(uint32_t));
    for (uint32_t i = 0; i < num; i++)
        expected[i] = i + 1;
    karst_lru_begin(lru, base + 1);
    uint32_t serial = base;
    for (int step = 0; step < 4; step++) {
        for (uint32_t slot = 1; slot <= num; slot++)
            if (fits(step == 0 ? RANDOM : step == 1 ? ALL : step == 2 ? RARE : NONE, slot, num)) {
                stamps[slot] = serial + 1 + random_below(span);
                stamps[slot] += stamps[slot] == 0;
            }
        serial += span + 1;
        assert_true(karst_buffer_write(cache->buffers.tile_stamp, 0, stamps, (num + 1) * sizeof(uint32_t), NULL));
        assert_true(karst_lru_sort(lru, serial, NULL));
        sort_stamps = stamps;
        sort_base = base;
        qsort(expected, num, sizeof(uint32_t), compare_slots);
        read_order(lru, order);
        assert_memory_equal(order, expected, num * sizeof(uint32_t));
    }
    free(stamps);
    free(order);
    free(expected);
}

static void test_sorting(void **state)
{
    (void)state;
    for (int as_gpu = 0; as_gpu < 2; as_gpu++) {
        karst_context *context = open_shape(as_gpu);
        for (size_t i = 0; i < NUM_LENGTHS; i++) {
            karst_cache *cache = karst_cache_create(context, lengths[i] + 1, 9, 0, NULL);
            assert_non_null(cache);
            sorts_like_the_host(cache, 1, 0);
            sorts_like_the_host(cache, 14, 5);
            sorts_like_the_host(cache, 100000, UINT32_MAX - 200000);
            for (uint32_t span = 15; span < 18 && lengths[i] < 5000; span++)
                sorts_like_the_host(cache, span, UINT32_MAX - span);
            sorts_like_the_host(cache, 0x10000000, 7);
            karst_cache_destroy(cache);
        }
        karst_context_destroy(context);
    }
}

/* Takes from a list whose slots are takable, have children, are free or are used, by patterns. */
static void takes_like_the_host(karst_cache *cache, pattern takable, pattern with_children)
{
    karst_lru *lru = &cache->tiles;
    uint32_t num = lru->num;
    assert_true(karst_lru_reset(lru, NULL));
    karst_tile_info *infos = calloc(num + 1, sizeof(*infos));
    karst_node *nodes = calloc((num + 1) * 8, sizeof(*nodes));
    uint32_t *stamps = calloc(num + 1, sizeof(uint32_t)), *order = calloc(num, sizeof(uint32_t)),
             *left = calloc(num, sizeof(uint32_t));
    uint32_t num_left = 0, *victims = calloc(KARST_CACHE_MAX_WORK, sizeof(uint32_t)), serial = 100;
    for (uint32_t slot = 1; slot <= num; slot++) {
        bool take = fits(takable, slot - 1, num) && slot != KARST_ROOT_TILE,
             parent = take && fits(with_children, slot - 1, num);
        /* The others: free, or in use by this cast, or used since the list was in order. */
        int other = (int)random_below(3);
        infos[slot].in_use = take || other;
        stamps[slot] = take ? 40 : other == 1 ? serial : 99;
        nodes[slot * 8 + random_below(8)].link = KARST_NODE_LINK(KARST_STATE_LOST, parent ? 1u : 0u);
        if (take && !parent)
            left[num_left++] = slot;
    }
    const karst_cache_buffers *b = &cache->buffers;
    assert_true(karst_buffer_write(b->tile_info, 0, infos, b->tile_info->size_bytes, NULL));
    assert_true(karst_buffer_write(b->nodes, 0, nodes, b->nodes->size_bytes, NULL));
    assert_true(karst_buffer_write(b->tile_stamp, 0, stamps, b->tile_stamp->size_bytes, NULL));
    karst_lru_begin(lru, 90); /* 40 is before that */
    uint32_t at = 0;
    for (int step = 0; at < num_left || step < 2; step++) {
        const uint32_t needs[] = {1, 0, 7, 100, 8192};
        uint32_t need = needs[step < 5 ? step : 4], taken, first = need < 100 ? random_below(50) : 0;
        assert_true(karst_lru_take(lru, serial, false, need, cache->evict.victims, first, &taken, NULL));
        assert_int_equal(taken, need < num_left - at ? need : num_left - at);
        assert_true(karst_buffer_read(cache->evict.victims, first * 4, victims, taken * 4, NULL));
        if (taken)
            assert_memory_equal(victims, left + at, taken * sizeof(uint32_t));
        at += taken;
        read_order(lru, order);
        assert_permutation(order, num);
        assert_true(lru->cursor <= num);
    }
    /* What has children stayed, in order, behind the cursor; it comes once it has none. */
    memset(nodes, 0, b->nodes->size_bytes);
    assert_true(karst_buffer_write(b->nodes, 0, nodes, b->nodes->size_bytes, NULL));
    uint32_t taken;
    assert_true(karst_lru_take(lru, serial, false, KARST_CACHE_MAX_WORK, cache->evict.victims, 0, &taken, NULL));
    assert_true(karst_buffer_read(cache->evict.victims, 0, victims, taken * 4, NULL));
    uint32_t parents = 0;
    uint32_t *now = calloc(num + 1, sizeof(uint32_t));
    assert_true(karst_buffer_read(b->tile_stamp, 0, now, (num + 1) * 4, NULL));
    for (uint32_t i = 0; i < taken; i++)
        assert_true(i == 0 || victims[i] > victims[i - 1]);
    for (uint32_t slot = 2; slot <= num; slot++)
        parents += stamps[slot] == 40;
    assert_int_equal(taken, parents - num_left < KARST_CACHE_MAX_WORK ? parents - num_left : KARST_CACHE_MAX_WORK);
    for (uint32_t i = 0; i < taken; i++)
        assert_int_equal(now[victims[i]], serial);
    free(now);
    free(infos);
    free(nodes);
    free(stamps);
    free(order);
    free(left);
    free(victims);
}

static void test_taking(void **state)
{
    (void)state;
    for (int as_gpu = 0; as_gpu < 2; as_gpu++) {
        karst_context *context = open_shape(as_gpu);
        for (size_t i = 0; i < NUM_LENGTHS; i++) {
            karst_cache *cache = karst_cache_create(context, lengths[i] + 1, 9, 0, NULL);
            assert_non_null(cache);
            for (int takable = 0; takable < NUM_PATTERNS; takable++)
                for (int with_children = 0; with_children<NUM_PATTERNS; with_children += lengths[i]> 5000 ? 3 : 1)
                    takes_like_the_host(cache, (pattern)takable, (pattern)with_children);
            karst_cache_destroy(cache);
        }
        karst_context_destroy(context);
    }
}

/* ---- requests ---- */

static int compare_uint64(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Wants by patterns on a pool of tiles that lie anywhere. */
static void chooses_like_the_host(karst_context *context, uint32_t num_tiles, pattern bricks, pattern children,
                                  uint32_t limit)
{
    cache_rig rig;
    rig_open(&rig, context, num_tiles, 40, 0, 5);
    rig.camera.voxel[0] = 1000000;
    rig_cast(&rig);
    uint64_t *keys[2] = {calloc(rig.num_nodes, sizeof(uint64_t)), calloc(rig.num_nodes, sizeof(uint64_t))};
    uint32_t num[2] = {0}, used_tiles = 0, used_bricks = 0;
    bool asked = false;
    for (uint32_t tile = 1; tile < num_tiles; tile++) {
        rig.tiles[tile] = (karst_tile_info){.level = (int)random_below(30), .in_use = random_below(8) != 0};
        for (int axis = 0; axis < 3; axis++)
            rig.tiles[tile].corner[axis] = (long)random_below(2000) - 1000;
        rig.tile_stamp[tile] = rig.serial - random_below(2);
        used_tiles += rig.tile_stamp[tile] == rig.serial;
    }
    for (uint32_t brick = 1; brick < 40; brick++) {
        rig.brick_stamp[brick] = rig.serial - random_below(2);
        rig.brick_fallback[brick] = rig.serial - random_below(2);
        used_bricks += rig.brick_stamp[brick] == rig.serial || rig.brick_fallback[brick] == rig.serial;
    }
    for (uint32_t node = 8; node < rig.num_nodes; node++) {
        const karst_tile_info *info = &rig.tiles[node / 8];
        uint32_t node_state = random_below(7);
        rig.nodes[node] = (karst_node){
            KARST_NODE_LINK(node_state, random_below(3) == 0 && node_state != 1 && node_state != 2 ? 1u : 0u),
            node_state == KARST_STATE_BRICK};
        if (random_below(2))
            rig_end_rays(&rig, node, random_below(2) ? random_below(9) : random_below(300));
        else
            rig.want_rays[node] = random_below(2) << 16 | random_below(300); /* of the cast before, or of none */
        for (int kind = 0; kind < 2; kind++) {
            uint32_t *want = kind ? rig.want_children : rig.want_brick;
            want[node] = rig.serial - 1 + fits(kind ? children : bricks, node - 8, rig.num_nodes - 8);
            if (want[node] != rig.serial)
                continue;
            rig.want_chunk[node / KARST_REQUEST_CHUNK] = rig.serial;
            asked = true;
            bool valid = info->in_use && node_state != KARST_STATE_AIR && node_state != KARST_STATE_SOLID &&
                         (kind ? info->level > 0 && !KARST_NODE_CHILDREN(rig.nodes[node].link)
                               : node_state != KARST_STATE_BRICK);
            if (!valid)
                continue;
            keys[kind][num[kind]++] = (uint64_t)rig_want_class(&rig, node) << 32 | node;
        }
    }
    rig_write_stamps(&rig);
    assert_true(karst_buffer_write(rig.pools->tile_info, 0, rig.tiles, rig.pools->tile_info->size_bytes, NULL));
    assert_true(karst_buffer_write(rig.pools->nodes, 0, rig.nodes, rig.pools->nodes->size_bytes, NULL));
    karst_wants *wants = &rig.cache->wants;
    uint32_t counted_tiles, counted_bricks;
    bool any;
    assert_true(karst_wants_survey(wants, rig.serial, &counted_tiles, &counted_bricks, &any, NULL));
    assert_int_equal(counted_tiles, used_tiles);
    assert_int_equal(counted_bricks, used_bricks);
    assert_int_equal(any, asked);
    assert_true(karst_wants_choose(wants, rig.serial, rig.serial, rig.camera.voxel, limit, limit, NULL));
    for (int kind = 0; kind < 2; kind++) {
        const karst_wants_choice *choice = kind ? wants->subdivides : wants->loads;
        qsort(keys[kind], num[kind], sizeof(uint64_t), compare_uint64);
        uint32_t expected = num[kind] < limit ? num[kind] : limit;
        assert_int_equal(choice->num_all, num[kind]);
        assert_int_equal(choice->num, expected < KARST_CACHE_MAX_WORK ? expected : KARST_CACHE_MAX_WORK);
        for (uint32_t i = 0; i < choice->num; i++)
            assert_int_equal(choice->nodes[i], (uint32_t)keys[kind][i]);
        free(keys[kind]);
    }
    rig_close(&rig);
}

static void test_choosing(void **state)
{
    (void)state;
    static const uint32_t tiles[] = {2, 63, 64, 65, 128, 130, 1500};
    for (int as_gpu = 0; as_gpu < 2; as_gpu++) {
        karst_context *context = open_shape(as_gpu);
        for (size_t i = 0; i < sizeof(tiles) / sizeof(tiles[0]); i++)
            for (int bricks = 0; bricks < NUM_PATTERNS; bricks++)
                chooses_like_the_host(context, tiles[i], (pattern)bricks, (pattern)random_below(NUM_PATTERNS),
                                      random_below(2) ? UINT32_MAX : 20);
        chooses_like_the_host(context, 20000, ALL, ALL, UINT32_MAX); /* several pieces of the list */
        chooses_like_the_host(context, 20000, RANDOM, ALTERNATING, 3000);
        chooses_like_the_host(context, 20000, RARE, RARE, 0);
        karst_context_destroy(context);
    }
}

/* The gap in 128 bits. */
static uint64_t plain_gap(int64_t node, int64_t camera, int shift)
{
    __int128 low = (__int128)node * ((__int128)1 << shift), high = low + ((__int128)1 << shift);
    return (uint64_t)(camera < low ? low - camera : camera > high ? camera - high : 0);
}

static void test_classes(void **state)
{
    (void)state;
    const int64_t far = INT64_C(1) << 62;
    for (int i = 0; i < 200000; i++) {
        int shift = 4 + (int)random_below(60);
        int64_t camera = (int64_t)((uint64_t)random_below(1u << 31) << 32 | random_below(1u << 31)) - far;
        if (camera < -far || camera > far)
            continue;
        if (random_below(2))
            camera >>= random_below(60);
        int64_t least = -(INT64_C(1) << (63 - shift)), most = -least - 1;
        int64_t node = random_below(2)   ? (camera >> shift) + (int64_t)random_below(5) - 2
                       : random_below(2) ? least
                                         : most;
        if (node < least || node > most)
            continue;
        assert_true(karst_want_gap(node, camera, shift) == plain_gap(node, camera, shift));
    }
    /* Farther is later, coarser is earlier; a factor of 2 is 16 classes; all fit. */
    for (int level = 0; level < 60; level++) {
        uint32_t last = 0;
        for (int bit = 0; bit < 64; bit++) {
            uint32_t c = karst_want_class(level, UINT64_C(1) << bit, 0, 0);
            assert_true(c < KARST_WANT_CLASSES && c >= last);
            if (bit > 0)
                assert_int_equal(c, last + 16);
            if (level > 0)
                assert_int_equal(c + 16, karst_want_class(level - 1, UINT64_C(1) << bit, 0, 0));
            last = c;
        }
        assert_true(karst_want_class(level, UINT64_MAX / 4 * 3, UINT64_MAX / 4 * 3, UINT64_MAX / 4 * 3) <
                    KARST_WANT_CLASSES);
        assert_int_equal(karst_want_class(level, 0, 0, 0), karst_want_class(level, 1, 0, 0));
    }
    assert_true(karst_want_class(3, 3, 4, 12) == karst_want_class(3, 12, 3, 4));
    assert_true(karst_want_class(3, 30, 40, 120) == karst_want_class(3, 130, 0, 0));
}

/* ---- host lists ---- */

static void test_free_slots(void **state)
{
    (void)state;
    karst_slots slots = {0};
    assert_true(karst_slots_init(&slots, 2, 102, NULL));
    uint32_t stack[100], held[100], num_held = 0, num = 100; /* reference: the next one is the last */
    for (uint32_t i = 0; i < 100; i++)
        stack[i] = 101 - i;
    for (int step = 0; step < 5000; step++) {
        if (random_below(2)) {
            uint32_t taken[120], want = random_below(40), got = karst_slots_take(&slots, taken, want);
            assert_int_equal(got, want < num ? want : num);
            for (uint32_t i = 0; i < got; i++)
                assert_int_equal(held[num_held++] = taken[i], stack[--num]);
        } else {
            uint32_t back = num_held ? random_below(num_held + 1) : 0;
            num_held -= back;
            karst_slots_give(&slots, held + num_held, back);
            for (uint32_t i = back; i-- > 0;)
                stack[num++] = held[num_held + i];
        }
        assert_int_equal(slots.num, num);
        for (uint32_t i = 0; i < num; i++)
            assert_int_equal(karst_slots_at(&slots, i), stack[num - 1 - i]);
    }
    karst_slots_finish(&slots);
    /* A pool without any. */
    assert_true(karst_slots_init(&slots, 2, 2, NULL));
    uint32_t slot;
    assert_int_equal(karst_slots_take(&slots, &slot, 1), 0);
    karst_slots_give(&slots, &slot, 0);
    karst_slots_finish(&slots);
}

static void test_memory_of_evictions(void **state)
{
    (void)state;
    karst_churn churn;
    assert_true(karst_churn_init(&churn, NULL));
    assert_false(karst_churn_is_recent(&churn, 5, 0));
    karst_churn_evicted(&churn, 5, UINT32_MAX - 50);
    assert_true(karst_churn_is_recent(&churn, 5, UINT32_MAX - 50));
    assert_true(karst_churn_is_recent(&churn, 5, 49));
    assert_false(karst_churn_is_recent(&churn, 5, 50));
    assert_false(karst_churn_is_recent(&churn, 5 + KARST_CHURN_ENTRIES, UINT32_MAX - 50));
    karst_churn_evicted(&churn, 5 + KARST_CHURN_ENTRIES, 1); /* takes the entry over */
    assert_false(karst_churn_is_recent(&churn, 5, 1));
    assert_true(karst_churn_is_recent(&churn, 5 + KARST_CHURN_ENTRIES, 1));
    karst_churn_forget(&churn);
    assert_false(karst_churn_is_recent(&churn, 5 + KARST_CHURN_ENTRIES, 1));
    karst_churn_finish(&churn);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sorting), cmocka_unit_test(test_taking),     cmocka_unit_test(test_choosing),
        cmocka_unit_test(test_classes), cmocka_unit_test(test_free_slots), cmocka_unit_test(test_memory_of_evictions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
