/* Further stores on a cache's tree, driven by hand: thousands of random steps of three stores that want, use, recycle
 * and forget, on tiles that are too few for them, with the cache's check after each; what it costs to have none; and
 * what may not be added. */
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

#define NUM_STORES 3
#define TOP_LEVEL 6
#define ROOT_NODE(i) (KARST_ROOT_TILE * KARST_TILE_NODES + (uint32_t)(i))

static karst_context *context;
static uint64_t random_state = 12345;

static uint32_t random_below(uint32_t n)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(random_state >> 33) % n;
}

/* Contents without rhyme or reason, another one for each store. */
static uint32_t mixed(int salt, int level, const int64_t node[3], bool load)
{
    uint64_t h = karst_identity((uint32_t)salt + 7u, level, node[0], node[1], node[2]) % 100;
    if (load)
        return h < 55   ? KARST_STATE_BRICK
               : h < 65 ? KARST_STATE_AIR
               : h < 75 ? KARST_STATE_SOLID
               : h < 85 ? KARST_STATE_CLEAR_AIR
               : h < 95 ? KARST_STATE_CLEAR_SOLID
                        : KARST_STATE_UNKNOWN;
    return h < 70 ? KARST_STATE_LOST : h < 85 ? KARST_STATE_AIR : KARST_STATE_SOLID;
}
static uint32_t content_0(int level, const int64_t node[3], bool load) { return mixed(0, level, node, load); }
static uint32_t content_1(int level, const int64_t node[3], bool load) { return mixed(1, level, node, load); }
static uint32_t content_2(int level, const int64_t node[3], bool load) { return mixed(2, level, node, load); }

static bool is_constant(uint32_t state) { return state == KARST_STATE_AIR || state == KARST_STATE_SOLID; }

/* A ray of a store, so to say: from the root down as far as there is something, to use or want what is there. Bricks
 * that are used go to `used`. */
static void walk(cache_rig *rig, uint32_t *used)
{
    uint32_t node = ROOT_NODE(random_below(8));
    for (;;) {
        uint32_t state = rig_state(rig, node), children = rig_children(rig, node), brick = rig->nodes[node].brick;
        if (is_constant(state))
            return;
        rig_walk(rig, node);
        if (brick && random_below(2)) {
            (random_below(4) ? rig_use_brick : rig_use_stand_in)(rig, brick);
            used[brick] = rig->serial;
        } else if (!brick && random_below(2) && node / KARST_TILE_NODES != KARST_ROOT_TILE) {
            rig_want_brick(rig, node);
        }
        if (children == KARST_NONE) {
            if (rig->tiles[node / KARST_TILE_NODES].level > 0 && random_below(2))
                rig_want_children(rig, node);
            return;
        }
        node = children * KARST_TILE_NODES + random_below(8);
    }
}

/* Every brick holds what its node is, and what was used in this cast is still there. */
static void check_bricks(cache_rig *rig, const uint32_t *used)
{
    const karst_cache_buffers *b = rig->pools;
    for (uint32_t brick = 1; brick < b->num_bricks + KARST_CACHE_ROOT_BRICKS; brick++) {
        uint32_t owner = rig->owners[brick].owner;
        if (used[brick] == rig->serial)
            assert_int_not_equal(owner, KARST_NO_NODE);
        if (owner != KARST_NO_NODE)
            assert_true(rig_brick_identity(rig, brick) == rig_node_identity(rig, owner));
    }
}

static void answer(cache_rig *rig, const karst_work *work)
{
    karst_error error = {0};
    rig->work = *work;
    rig_expect(karst_buffer_read(work->load_nodes, 0, rig->load_nodes, work->num_loads * 4, &error) &&
                   karst_buffer_read(work->load_slots, 0, rig->load_slots, work->num_loads * 4, &error),
               "read", &error);
    rig_produce(rig);
    rig_publish(rig);
}

/* What root nodes lack, and what was dropped and used. */
static void prepare(cache_rig *rig)
{
    karst_error error = {0};
    karst_work work;
    rig_read(rig);
    rig_expect(karst_store_root_work(rig->store, rig->serial ? rig->serial : 1, &work, &error), "root work", &error);
    if (work.num_loads)
        answer(rig, &work);
    do {
        rig_expect(karst_store_drop_work(rig->store, rig->serial ? rig->serial : 1, &work, &error), "drop work",
                   &error);
        if (work.num_loads)
            answer(rig, &work);
    } while (work.num_loads);
}

/* Nodes in use that are constant in the land and hold a brick of another store, and tiles below such. */
static uint32_t count_bricks_in_constants(const cache_rig *land, const cache_rig *other)
{
    uint32_t num = 0;
    for (uint32_t node = KARST_TILE_NODES; node < land->num_nodes; node++)
        num += land->tiles[node / KARST_TILE_NODES].in_use && is_constant(rig_state(land, node)) &&
               other->nodes[node].brick != KARST_NONE && rig_children(land, node) != KARST_NONE;
    return num;
}

typedef struct {
    cache_rig rigs[NUM_STORES];
    uint32_t *used[NUM_STORES];
    uint32_t num_evicted_tiles, num_evicted_bricks, num_in_constants, num_dropped;
} run;

static void drop_somewhere(run *r)
{
    karst_error error = {0};
    karst_dropped dropped = {0};
    karst_drop_box box = {.margin_voxels = random_below(2)};
    for (int axis = 0; axis < 3; axis++) {
        box.min[axis] = (int64_t)random_below(1200) - 600;
        box.max[axis] = box.min[axis] + random_below(900);
    }
    rig_expect(karst_cache_drop(r->rigs[0].cache, &box, 1, r->rigs[0].serial, &dropped, &error), "drop", &error);
    r->num_dropped += (uint32_t)dropped.num_bricks;
    for (int i = 0; i < NUM_STORES; i++)
        memset(r->used[i], 0, r->rigs[i].pools->brick_stamp->size_bytes);
    rig_check(&r->rigs[0]);
}

/* A cast of each store with one serial, then a round of each. */
static void step(run *r)
{
    for (int i = 0; i < NUM_STORES; i++)
        prepare(&r->rigs[i]);
    for (int i = 0; i < NUM_STORES; i++) {
        cache_rig *rig = &r->rigs[i];
        rig_read(rig); /* stamps of tiles that the others walked through */
        rig_cast(rig);
        for (uint32_t rays = random_below(30); rays > 0; rays--)
            walk(rig, r->used[i]);
        rig_write_stamps(rig);
    }
    for (int i = 0; i < NUM_STORES; i++) {
        cache_rig *rig = &r->rigs[i];
        rig_read(rig);
        rig_collect(rig, random_below(12), random_below(20), false);
        r->num_evicted_tiles += rig->work.num_evicted_tiles;
        r->num_evicted_bricks += rig->work.num_evicted_bricks;
        if (random_below(8)) { /* else what was granted is given back by the next round */
            rig_produce(rig);
            rig_publish(rig);
        }
        for (int k = 0; k < NUM_STORES; k++) {
            rig_read(&r->rigs[k]);
            check_bricks(&r->rigs[k], r->used[k]);
        }
        r->num_in_constants += count_bricks_in_constants(&r->rigs[0], &r->rigs[1]);
    }
}

static void random_steps(bool by_device, bool as_gpu, int num_steps)
{
    static const rig_content contents[] = {content_0, content_1, content_2};
    run r = {.num_dropped = 0};
    const bool is_cpu = context->is_cpu;
    context->is_cpu = is_cpu && !as_gpu; /* the cache cuts its passes as for a GPU */
    rig_open(&r.rigs[0], context, 40, 60, 0, TOP_LEVEL);
    if (by_device) {
        rig_expect(karst_cache_take_kernels(r.rigs[0].cache, NULL), "kernels", NULL);
        r.rigs[0].cache->on_host = false;
    }
    r.rigs[0].content = content_0;
    for (int i = 0; i < 20; i++) { /* there is a tree already when stores are added */
        prepare(&r.rigs[0]);
        rig_cast(&r.rigs[0]);
        rig_want_children(&r.rigs[0], ROOT_NODE(random_below(8)));
        rig_round(&r.rigs[0]);
    }
    rig_open_store(&r.rigs[1], &r.rigs[0], "clear", 40);
    rig_open_store(&r.rigs[2], &r.rigs[0], "air", 30);
    for (int i = 0; i < NUM_STORES; i++) {
        r.rigs[i].content = contents[i];
        r.rigs[i].serial = r.rigs[0].serial;
        r.rigs[i].frame = r.rigs[0].frame;
        r.used[i] = calloc(1, r.rigs[i].pools->brick_stamp->size_bytes);
        assert_non_null(r.used[i]);
    }
    rig_check(&r.rigs[0]);
    int64_t corner[3] = {-1, -1, -1};
    for (int i = 0; i < num_steps; i++) {
        step(&r);
        if (random_below(4) == 0)
            drop_somewhere(&r);
        if (random_below(25) == 0) {
            corner[random_below(3)] += random_below(2) ? 1 : -1;
            rig_place_root(&r.rigs[0], corner, TOP_LEVEL);
        }
        if (i == num_steps / 2) {
            rig_expect(karst_cache_clear(r.rigs[0].cache, NULL), "clear", NULL);
            rig_check(&r.rigs[0]);
        }
    }
    assert_true(r.num_evicted_tiles > 100 && r.num_evicted_bricks > 80 && r.num_dropped > 40);
    assert_true(r.num_in_constants > 100);
    for (int i = NUM_STORES; i-- > 0;) {
        free(r.used[i]);
        rig_close(&r.rigs[i]);
    }
    context->is_cpu = is_cpu;
}

static int num_steps(void) { return getenv("KARST_TEST_FULL") ? 4000 : getenv("KARST_TEST_QUICK") ? 60 : 120; }

static void test_host(void **state)
{
    (void)state;
    random_steps(false, false, num_steps());
}

static void test_device(void **state)
{
    (void)state;
    random_steps(true, false, num_steps());
}

static void test_device_as_gpu(void **state)
{
    (void)state;
    random_steps(true, true, num_steps());
}

/* A store's round recycles the tile that was least recently used by then, whatever one of the land's found before. */
static void test_order(void **state)
{
    (void)state;
    for (int by_device = 0; by_device < 2; by_device++) {
        cache_rig rig, more;
        uint32_t tiles[4];
        rig_open(&rig, context, 6, 20, 0, TOP_LEVEL);
        if (by_device) {
            rig_expect(karst_cache_take_kernels(rig.cache, NULL), "kernels", NULL);
            rig.cache->on_host = false;
        }
        rig_open_store(&more, &rig, "clear", 20);
        for (int i = 0; i < 4; i++)
            tiles[i] = rig_grow(&rig, ROOT_NODE(i));
        /* The land recycles the first and knows the order of the others. */
        assert_int_equal(rig_grow(&rig, ROOT_NODE(4)), tiles[0]);
        rig_cast(&rig);
        rig_walk(&rig, tiles[1] * KARST_TILE_NODES);
        rig_write_stamps(&rig);
        more.serial = rig.serial;
        rig_read(&more);
        assert_int_equal(rig_grow(&more, ROOT_NODE(5)), tiles[2]);
        assert_int_equal(rig_children(&more, ROOT_NODE(1)), tiles[1]);
        rig_read(&rig);
        assert_int_equal(rig_children(&rig, ROOT_NODE(2)), KARST_NONE);
        assert_int_equal(rig_children(&rig, ROOT_NODE(5)), tiles[2]);
        rig_close(&more);
        rig_close(&rig);
    }
}

static size_t total_bytes(void)
{
    karst_stats stats = {0};
    size_t sum = 0;
    karst_context_memory(context, &stats);
    for (uint32_t i = 0; i < stats.num_memory; i++)
        sum += stats.memory[i].size_bytes;
    return sum;
}

/* What a store takes of the device on a tree of so many tiles. */
static size_t bytes_of_store(uint32_t num_tiles, uint32_t num_bricks)
{
    cache_rig rig, more;
    rig_open(&rig, context, num_tiles, 60, 0, TOP_LEVEL);
    size_t before = total_bytes();
    rig_open_store(&more, &rig, "clear", num_bricks);
    size_t taken = total_bytes() - before;
    rig_close(&more);
    rig_close(&rig);
    return taken;
}

/* No kernels without further stores; with one, what was said that it takes, under its name; and all goes with it. */
static void test_cost(void **state)
{
    (void)state;
    enum { NUM_TILES = 4096, NUM_BRICKS = 3000 };
    const size_t before = total_bytes(), small = bytes_of_store(NUM_TILES, NUM_BRICKS);
    const size_t a_tile = (bytes_of_store(2 * NUM_TILES, NUM_BRICKS) - small) / NUM_TILES;
    const size_t a_brick = (bytes_of_store(NUM_TILES, 2 * NUM_BRICKS) - small) / NUM_BRICKS;
    assert_in_range(a_tile, KARST_STORE_TILE_BYTES - 16, KARST_STORE_TILE_BYTES);
    assert_in_range(a_brick, KARST_CACHE_BRICK_BYTES - 16, KARST_CACHE_BRICK_BYTES);
    assert_in_range(small - a_tile * NUM_TILES - a_brick * NUM_BRICKS, 0, KARST_STORE_FIXED_BYTES);
    assert_int_equal(total_bytes(), before);

    cache_rig rig, more;
    rig_open(&rig, context, NUM_TILES, NUM_BRICKS, 0, TOP_LEVEL);
    assert_null(rig.cache->beside_program);
    assert_null(rig.cache->land.beside.link);
    rig_open_store(&more, &rig, "clear", NUM_BRICKS);
    assert_non_null(rig.cache->beside_program);
    karst_stats stats = {0};
    bool has_bricks = false, has_nodes = false;
    karst_context_memory(context, &stats);
    for (uint32_t i = 0; i < stats.num_memory; i++) {
        has_bricks = has_bricks || strcmp(stats.memory[i].name, "clear bricks") == 0;
        has_nodes = has_nodes || strcmp(stats.memory[i].name, "clear nodes") == 0;
    }
    assert_true(has_bricks && has_nodes);
    rig_close(&more);
    rig_close(&rig);
    assert_int_equal(total_bytes(), before);
}

static void expect_refused(karst_cache *cache, const karst_store_config *config, const char *text)
{
    karst_error error = {0};
    assert_null(karst_cache_add_store(cache, config, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_non_null(strstr(error.message, text));
}

static void test_refused(void **state)
{
    (void)state;
    cache_rig rig;
    rig_open(&rig, context, 40, 60, 0, TOP_LEVEL);
    static const struct {
        karst_store_config config;
        const char *text;
    } cases[] = {
        {{.name = NULL, .num_bricks = 20}, "1 to 15 of a to z"},
        {{.name = "", .num_bricks = 20}, "1 to 15 of a to z"},
        {{.name = "Clear", .num_bricks = 20}, "1 to 15 of a to z"},
        {{.name = "a name", .num_bricks = 20}, "1 to 15 of a to z"},
        {{.name = "sixteen_letters_", .num_bricks = 20}, "1 to 15 of a to z"},
        {{.name = "land", .num_bricks = 20}, "there is a store land"},
        {{.name = "clear", .num_bricks = 8}, "at least 9"},
        {{.name = "clear", .num_bricks = UINT32_MAX}, "at most"},
        {{.name = "clear", .num_bricks = 20, .brick_bits = 12}, "8, 16 or 32"},
        {{.name = "clear", .num_bricks = 20, .max_segment_bytes = 100}, "use larger ones"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        expect_refused(rig.cache, &cases[i].config, cases[i].text);
        rig_check(&rig);
    }
    static const char *const names[] = {"clear", "air", "fluence_2"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        const karst_store_config config = {.name = names[i], .num_bricks = 20, .brick_bits = i ? 8 : 0};
        karst_store *store = karst_cache_add_store(rig.cache, &config, NULL);
        assert_non_null(store);
        assert_ptr_equal(karst_cache_find_store(rig.cache, names[i]), store);
        assert_string_equal(karst_store_name(store), names[i]);
        assert_int_equal(karst_store_count_resident(store), 0);
    }
    expect_refused(rig.cache, &(karst_store_config){.name = "one_more", .num_bricks = 20}, "at most 4 stores");
    assert_null(karst_cache_find_store(rig.cache, "one_more"));
    rig_grow(&rig, ROOT_NODE(0));
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_host), cmocka_unit_test(test_device),
                                       cmocka_unit_test(test_device_as_gpu), cmocka_unit_test(test_order),
                                       cmocka_unit_test(test_cost),
                                       cmocka_unit_test(test_refused)};
    context = rig_open_context();
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    karst_context_destroy(context);
    return failed;
}
