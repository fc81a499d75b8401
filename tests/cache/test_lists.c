/* The cache's lists against plain loops on the host: surveys, usage lists, requests, free slots, the
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

/* Stamps of `num` slots: never, in use at `serial`, or up to `span` casts ago. */
static void stamp_at_random(uint32_t *stamps, uint32_t num, uint32_t serial, uint32_t span, pattern in_use)
{
    for (uint32_t i = 0; i < num; i++) {
        stamps[i] = fits(in_use, i, num) ? serial : random_below(10) == 0 ? 0 : serial - random_below(span);
        stamps[i] += stamps[i] == UINT32_MAX && serial < span; /* no cast has the serial 0 */
    }
}

static uint32_t age_of(uint32_t stamp, uint32_t serial) { return stamp ? serial - stamp : UINT32_MAX; }

/* Counts and lists of one survey against a loop: by the device, or by the host with a scan. */
static void surveys_like_a_loop(cache_rig *rig, const karst_scan *scan, uint32_t serial, uint32_t span,
                                pattern in_use, bool stand_ins)
{
    karst_survey *survey = &rig->cache->land.survey;
    const uint32_t num[2] = {rig->pools->num_tiles, rig->pools->num_bricks};
    const uint32_t *stamps[2] = {rig->tile_stamp, rig->brick_stamp},
                   *fallback[2] = {rig->tile_stamp, rig->brick_fallback};
    stamp_at_random(rig->tile_stamp, num[0], serial, span, in_use);
    stamp_at_random(rig->brick_stamp, num[1], serial, span, in_use);
    stamp_at_random(rig->brick_fallback, num[1], serial, span, in_use);
    uint32_t num_active = 0, *active = calloc(survey->num_request_chunks, sizeof(uint32_t));
    for (uint32_t i = 0; i < survey->num_request_chunks; i++) {
        rig->want_chunk[i] = fits(in_use, i, survey->num_request_chunks) ? serial : serial - 1;
        if (rig->want_chunk[i] == serial)
            active[num_active++] = i;
    }
    rig_write_stamps(rig);
    /* 0 does not look, 1 finds all that is not in use. */
    const uint32_t ages[] = {0, 1, 2, span / 2 + 1, UINT32_MAX};
    karst_survey_ask ask = {.serial = serial, .stand_ins = stand_ins};
    ask.ages[0] = ages[random_below(5)];
    ask.ages[1] = stand_ins ? 1 : ages[random_below(5)];
    ask.most[0] = random_below(2) ? UINT32_MAX : random_below(60);
    ask.most[1] = random_below(2) ? UINT32_MAX : random_below(60);
    survey->lists[0].valid = survey->lists[1].valid = false;
    if (scan) {
        karst_mapped *mapped = &rig->cache->land.mapped;
        survey->scan = scan;
        assert_true(karst_mapped_begin(mapped, NULL));
        karst_survey_by_host(survey, &ask, mapped);
        karst_mapped_end(mapped);
    } else {
        assert_true(karst_survey_begin(survey, &ask, NULL) && karst_survey_end(survey, NULL));
    }
    for (uint32_t kind = 0; kind < 2; kind++) {
        const karst_survey_list *list = &survey->lists[kind];
        uint32_t used = 0, found = 0, exact = 0;
        assert_int_equal(list->valid, ask.ages[kind] != 0);
        assert_true(!list->valid || karst_survey_read_found(survey, kind, NULL));
        for (uint32_t slot = 0; slot < num[kind]; slot++) {
            uint32_t a = age_of(stamps[kind][slot], serial), b = age_of(fallback[kind][slot], serial);
            uint32_t age = a < b ? a : b;
            used += age == 0;
            if (!list->valid || !(kind == 1 && stand_ins ? a != 0 && b == 0 : age >= ask.ages[kind]))
                continue;
            bool is_exact = kind == 1 && stand_ins ? true : age == ask.ages[kind] && age != UINT32_MAX;
            if (is_exact && exact++ >= ask.most[kind])
                continue;
            assert_true(found < list->num);
            assert_int_equal(list->slots[found].slot, slot);
            assert_int_equal(list->slots[found++].age, age);
        }
        assert_int_equal(survey->host_result.num_used[kind], used);
        if (list->valid) {
            assert_int_equal(list->num, found);
            assert_int_equal(list->age, ask.ages[kind]);
            assert_int_equal(list->num_left_out, exact > ask.most[kind] ? exact - ask.most[kind] : 0);
        }
    }
    assert_int_equal(survey->host_result.num_active, num_active);
    uint32_t *listed = calloc(survey->num_request_chunks, sizeof(uint32_t));
    if (scan)
        memcpy(listed, survey->host_active, num_active * sizeof(uint32_t));
    else
        assert_true(karst_buffer_read(survey->active, 0, listed, num_active * sizeof(uint32_t), NULL));
    if (num_active)
        assert_memory_equal(listed, active, num_active * sizeof(uint32_t));
    free(active);
    free(listed);
}

static void test_surveys(void **state)
{
    (void)state;
    for (int as_gpu = 0; as_gpu < 2; as_gpu++) {
        karst_context *context = open_shape(as_gpu);
        for (size_t i = 0; i < NUM_LENGTHS; i++) {
            cache_rig rig;
            rig_open(&rig, context, lengths[i] + 1, lengths[NUM_LENGTHS - 1 - i] / 8 + 9, 0, 5);
            assert_true(karst_cache_take_kernels(rig.cache, NULL));
            /* By the device, then by the host in each width. */
            for (int width = -1; width < (rig.cache->on_host ? KARST_SCAN_WIDTHS : 0); width++) {
                const karst_scan *scan = width < 0 ? NULL : karst_scan_of_width(width);
                for (int in_use = 0; in_use < (width < 0 || scan ? NUM_PATTERNS : 0); in_use++) {
                    surveys_like_a_loop(&rig, scan, 1000, 10, (pattern)in_use, false);
                    surveys_like_a_loop(&rig, scan, 5, 40, (pattern)in_use, false); /* serials that wrapped */
                    surveys_like_a_loop(&rig, scan, UINT32_MAX, 0x7fffffff, (pattern)in_use, in_use & 1);
                    surveys_like_a_loop(&rig, scan, 77, 3, (pattern)in_use, true);
                }
            }
            rig_close(&rig);
        }
        karst_context_destroy(context);
    }
}

static bool unlink_nothing(void *user, uint32_t num, karst_error *error)
{
    (void)user, (void)num, (void)error;
    return true;
}

/* What a round expects changes what it costs, never what it does. */
static void expect_anything(karst_lru *lru, uint32_t span)
{
    lru->expected_age = 1 + random_below(2 * span);
    lru->expected_serial = random_below(5); /* now, or not long ago, or 2^32 casts and more */
    lru->expected_need = random_below(9000);
    lru->expected_misfits = random_below(200);
    lru->was_short = random_below(2);
    lru->gets_older = random_below(2);
}

/* Recycles tiles that are takable, have children, are free or are used, by patterns, until there are no more. */
static void recycles_like_the_host(karst_cache *cache, pattern takable, pattern with_children, uint32_t span)
{
    karst_lru *lru = &cache->tiles;
    const karst_cache_buffers *b = &cache->land.buffers;
    uint32_t num = b->num_tiles, serial = 3, num_left = 0, at = 0;
    karst_tile_info *infos = calloc(num, sizeof(*infos));
    karst_node *nodes = calloc(num * 8, sizeof(*nodes));
    uint32_t *stamps = calloc(num, sizeof(uint32_t)), victims[KARST_CACHE_MAX_WORK];
    rig_aged *left = calloc(num, sizeof(*left));
    for (uint32_t slot = 1; slot < num; slot++) {
        bool take = fits(takable, slot - 1, num - 1) && slot != KARST_ROOT_TILE,
             parent = take && fits(with_children, slot - 1, num - 1);
        infos[slot].in_use = take || random_below(2); /* the others are free, or in use by this cast */
        stamps[slot] = !take && infos[slot].in_use ? serial : serial - 1 - random_below(span);
        stamps[slot] -= stamps[slot] == 0;
        nodes[slot * 8 + random_below(8)].link = KARST_NODE_LINK(KARST_STATE_LOST, parent ? 1u : 0u);
        if (take && !parent)
            left[num_left++] = (rig_aged){serial - stamps[slot], slot};
    }
    qsort(left, num_left, sizeof(*left), rig_compare_aged);
    assert_true(karst_buffer_write(b->tile_info, 0, infos, b->tile_info->size_bytes, NULL));
    assert_true(karst_buffer_write(b->nodes, 0, nodes, b->nodes->size_bytes, NULL));
    assert_true(karst_buffer_write(b->tile_stamp, 0, stamps, b->tile_stamp->size_bytes, NULL));
    for (int step = 0; at < num_left || step < 2; step++) {
        const uint32_t needs[] = {1, 7, 100, 3000, 8192};
        uint32_t need = needs[step < 5 ? step : 4], expected = need < num_left - at ? need : num_left - at;
        karst_survey_ask ask = {.serial = serial};
        expect_anything(lru, span);
        karst_lru_expect(lru, random_below(20000), &ask);
        assert_true(karst_survey_begin(lru->survey, &ask, NULL) && karst_survey_end(lru->survey, NULL));
        assert_true(karst_lru_recycle(lru, serial, false, need, unlink_nothing, NULL, NULL));
        assert_int_equal(lru->host_result.num_taken, expected);
        assert_true(karst_buffer_read(lru->victims, 0, victims, expected * sizeof(uint32_t), NULL));
        for (uint32_t i = 0; i < expected; i++) {
            assert_int_equal(victims[i], left[at++].slot);
            infos[victims[i]].in_use = 0;
        }
        assert_true(karst_buffer_write(b->tile_info, 0, infos, b->tile_info->size_bytes, NULL));
    }
    free(infos);
    free(nodes);
    free(stamps);
    free(left);
}

static void test_recycling(void **state)
{
    (void)state;
    for (int as_gpu = 0; as_gpu < 2; as_gpu++) {
        karst_context *context = open_shape(as_gpu);
        for (size_t i = 0; i < NUM_LENGTHS; i++) {
            karst_cache *cache = karst_cache_create(context, lengths[i] + 1, 9, 0, NULL);
            assert_non_null(cache);
            assert_true(karst_cache_take_kernels(cache, NULL));
            for (int takable = 0; takable < NUM_PATTERNS; takable++)
                for (int with_children = 0; with_children<NUM_PATTERNS; with_children += lengths[i]> 5000 ? 3 : 1)
                    recycles_like_the_host(cache, (pattern)takable, (pattern)with_children,
                                           takable & 1         ? 5
                                           : with_children & 1 ? 5000
                                                               : 0x7ffffff0);
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

/* Is the device's memory the host's? */
static bool hosts_memory(karst_context *context)
{
    karst_cache *cache = karst_cache_create(context, 2, 9, 0, NULL);
    bool is_so = cache && cache->on_host;
    if (cache)
        assert_int_equal(!cache->collect_program, is_so); /* no kernels that nobody launches */
    karst_cache_destroy(cache);
    return is_so;
}

/* Wants by patterns on a pool of tiles that lie anywhere. */
static void chooses_like_a_loop(karst_context *context, bool by_host, uint32_t num_tiles, pattern bricks,
                                pattern children, uint32_t limit)
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
    karst_wants *wants = &rig.cache->land.wants;
    karst_survey *survey = &rig.cache->land.survey;
    karst_survey_ask ask = {.serial = rig.serial};
    if (by_host) {
        assert_true(karst_mapped_begin(&rig.cache->land.mapped, NULL));
        karst_survey_by_host(survey, &ask, &rig.cache->land.mapped);
        karst_wants_choose_by_host(wants, rig.serial, rig.serial, rig.camera.voxel, limit, limit);
        karst_mapped_end(&rig.cache->land.mapped);
    } else {
        assert_true(karst_cache_take_kernels(rig.cache, NULL));
        assert_true(karst_survey_begin(survey, &ask, NULL));
        assert_true(karst_wants_begin(wants, rig.serial, rig.serial, rig.camera.voxel, NULL));
        assert_true(karst_survey_end(survey, NULL));
        assert_true(karst_wants_choose(wants, limit, limit, NULL));
    }
    assert_int_equal(survey->host_result.num_used[0], used_tiles);
    assert_int_equal(survey->host_result.num_used[1], used_bricks);
    assert_int_equal(survey->host_result.num_active != 0, asked);
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
    for (int how = 0; how < 3; how++) {
        karst_context *context = open_shape(how == 1);
        bool by_host = how == 2;
        if (by_host && !hosts_memory(context)) {
            karst_context_destroy(context);
            continue;
        }
        for (size_t i = 0; i < sizeof(tiles) / sizeof(tiles[0]); i++)
            for (int bricks = 0; bricks < NUM_PATTERNS; bricks++)
                chooses_like_a_loop(context, by_host, tiles[i], (pattern)bricks, (pattern)random_below(NUM_PATTERNS),
                                    random_below(2) ? UINT32_MAX : 20);
        /* Several pieces of the list. */
        chooses_like_a_loop(context, by_host, 20000, ALL, ALL, UINT32_MAX);
        chooses_like_a_loop(context, by_host, 20000, RANDOM, ALTERNATING, 3000);
        chooses_like_a_loop(context, by_host, 20000, RARE, RARE, 0);
        karst_context_destroy(context);
    }
}

/* Both kinds in one queue: as much as fits, nothing that stands behind what was left out, of each at least one. */
static void test_what_fits_a_budget(void **state)
{
    (void)state;
    static karst_wants_choice loads, subdivides;
    karst_wants wants = {.loads = &loads, .subdivides = &subdivides};
    for (int turn = 0; turn < 2000; turn++) {
        for (uint32_t i = 0; i < 40; i++) {
            loads.classes[i] = (uint16_t)((i ? loads.classes[i - 1] : 0u) + random_below(3));
            subdivides.classes[i] = (uint16_t)((i ? subdivides.classes[i - 1] : 0u) + random_below(4));
        }
        const uint32_t num_loads = random_below(40), num_subdivides = random_below(40);
        const double load_ns = 1 + random_below(50), subdivide_ns = 1 + random_below(50),
                     budget_ns = random_below(2000);
        loads.num = num_loads, subdivides.num = num_subdivides;
        karst_wants_fit(&wants, load_ns, subdivide_ns, budget_ns);
        const uint32_t l = loads.num, s = subdivides.num;
        const double sum_ns = l * load_ns + s * subdivide_ns;
        assert_true(l <= num_loads && s <= num_subdivides);
        assert_true((l > 0) == (num_loads > 0) && (s > 0) == (num_subdivides > 0));
        assert_true(sum_ns <= budget_ns || (l <= 1 && s <= 1));
        /* What comes next would not have fitted; but for the first ones, none stands behind what was left out. */
        bool load_next = l < num_loads && (s == num_subdivides || loads.classes[l] < subdivides.classes[s]);
        if (l < num_loads || s < num_subdivides)
            assert_true(sum_ns + (load_next ? load_ns : subdivide_ns) > budget_ns);
        if (l < num_loads && s > 1)
            assert_true(subdivides.classes[s - 1] <= loads.classes[l]);
        if (s < num_subdivides && l > 1)
            assert_true(loads.classes[l - 1] < subdivides.classes[s]);
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
        cmocka_unit_test(test_surveys), cmocka_unit_test(test_recycling),  cmocka_unit_test(test_choosing),
        cmocka_unit_test(test_what_fits_a_budget),
        cmocka_unit_test(test_classes), cmocka_unit_test(test_free_slots), cmocka_unit_test(test_memory_of_evictions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
