/* A second store on the land's tree: a body that floats where the land is proved to be air owns bricks there, in slots
 * of its own. It is seen byte for byte as if it were alone in the world, and so is the land, whatever the other one
 * makes, recycles, forgets and finds again. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cache/pools.h"
#include "producers/density/world_file.h"
#include "producers/stores.h"
#include "raycast/cast/cast.h"
#include "raycast/cast/pinhole.h"
#include "tests/support/pool.h"

#define WIDTH 96
#define HEIGHT 72
#define NUM_PIXELS (WIDTH * HEIGHT)
#define VIEW_VOXELS 2000.0
#define TOP_LEVEL 9
#define ROOM_TILES 4000u /* for both views */
#define FEW_TILES 260u
#define LAND_BRICKS 1500u
#define BODY_BRICKS 70u  /* for either view, not for both */
#define MAX_LOADS 512u
#define MAX_ROUNDS 200

static const char land_text[] = "/*{ \"name\": \"land\", \"voxel\": 1 }*/\n"
                                "float density(vec3 p) { return 12.0 * noise(p / 40.0) + 3.0 * noise(p / 9.0) - p.y; }";
/* Far above the land's highest. */
static const char body_text[] = "/*{ \"name\": \"body\", \"voxel\": 1 }*/\n"
                                "float density(vec3 p)\n"
                                "{ return 60.0 - length(p - vec3(0.0, 150.0, 0.0)) + 6.0 * noise(p / 12.0); }";
/* Everywhere, the land's highest included. */
static const char air_text[] = "/*{ \"name\": \"air\", \"voxel\": 1 }*/\n"
                               "float density(vec3 p) { return 8.0 * noise(p / 30.0) + 30.0 - abs(p.y - 20.0); }";

static const karst_camera views[] = {
    {.position = {{-20, 110, -190}, {0}}, .yaw_deg = 5, .pitch_deg = -4, .fov_deg = 60},
    {.position = {{210, 140, 20}, {0}}, .yaw_deg = 262, .pitch_deg = -8, .fov_deg = 50},
};

static karst_world_file *files[3];

/* One store as a test drives it. */
typedef struct {
    karst_store *store;
    karst_producer *producer;
    karst_caster *caster;
} content;

typedef struct {
    karst_context *context;
    karst_cache *cache;
    content contents[KARST_CACHE_MAX_STORES]; /* in the order of answering */
    karst_store_source sources[KARST_CACHE_MAX_STORES];
    size_t num;
    karst_buffer *hits;
    int64_t root_corner[3];
    uint32_t serial, frame;
    uint32_t num_evicted, num_evicted_tiles, num_reproduced; /* since they were last set to 0 */
} scene;

static void expect(bool good, const char *what, const karst_error *error) { pool_expect(good, what, error); }

static void scene_add(scene *s, karst_store *store, const karst_world_file *file)
{
    karst_error error = {0};
    const karst_cache_buffers *buffers = karst_store_get_buffers(store);
    const karst_world_build build = {.shape = KARST_SHAPE_AUTO, .finalise_options = karst_cache_brick_option(buffers)};
    content *c = &s->contents[s->num];
    c->store = store;
    c->producer = karst_world_file_producer_built(s->context, file, 7, MAX_LOADS, &build, &error);
    expect(c->producer, "producer", &error);
    c->caster = karst_caster_create_with(s->context, buffers, KARST_CAST_NO_STREAMS " " KARST_CAST_NO_SHADOWS, &error);
    expect(c->caster, "caster", &error);
    s->sources[s->num++] = (karst_store_source){store, c->producer};
}

/* by_device: as where the host cannot reach into the device's memory. */
static void scene_open(scene *s, karst_context *context, const karst_world_file *land, uint32_t num_tiles,
                       bool by_device)
{
    karst_error error = {0};
    *s = (scene){.context = context, .root_corner = {-1, -1, -1}};
    s->cache = karst_cache_create(context, num_tiles, LAND_BRICKS, 0, &error);
    expect(s->cache && karst_cache_place_root(s->cache, s->root_corner, TOP_LEVEL, &error), "cache", &error);
    if (by_device) {
        s->cache->on_host = false;
        expect(karst_cache_take_kernels(s->cache, &error), "kernels", &error);
    }
    s->hits = karst_buffer_create(context, "hits", NUM_PIXELS * sizeof(karst_hit), NULL, &error);
    expect(s->hits, "hits", &error);
    scene_add(s, karst_cache_find_store(s->cache, KARST_STORE_LAND), land);
}

static karst_store *scene_add_store(scene *s, const char *name, uint32_t num_bricks, int bits,
                                    const karst_world_file *file)
{
    karst_error error = {0};
    const karst_store_config config = {.name = name, .num_bricks = num_bricks, .brick_bits = bits};
    karst_store *store = karst_cache_add_store(s->cache, &config, &error);
    expect(store, "karst_cache_add_store", &error);
    scene_add(s, store, file);
    return store;
}

static void scene_close(scene *s)
{
    for (size_t i = 0; i < s->num; i++) {
        karst_caster_destroy(s->contents[i].caster);
        karst_producer_destroy(s->contents[i].producer);
    }
    karst_buffer_destroy(s->hits);
    karst_cache_destroy(s->cache);
}

static void answer(scene *s, const content *c, const karst_work *work)
{
    karst_error error = {0};
    expect(karst_stores_answer(s->sources, s->num, c->store, work, &error) &&
               karst_cache_publish(s->cache, work, NULL, NULL, &error),
           "answer", &error);
}

/* What there is to load before any cast. */
static void prepare(scene *s, const content *c)
{
    karst_error error = {0};
    karst_work work;
    expect(karst_store_root_work(c->store, s->serial, &work, &error), "root work", &error);
    if (work.num_loads)
        answer(s, c, &work);
    for (;;) {
        expect(karst_store_drop_work(c->store, s->serial, &work, &error), "drop work", &error);
        if (work.num_loads == 0)
            break;
        answer(s, c, &work);
    }
}

/* One cast of a store and one round for it; returns how much was wanted. */
static uint32_t draw(scene *s, size_t i, const karst_camera *camera)
{
    karst_error error = {0};
    const content *c = &s->contents[i];
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_work work;
    s->serial++;
    s->frame++;
    prepare(s, c);
    karst_cast_view_init(&view, &camera->position, s->root_corner, TOP_LEVEL);
    view.serial = s->serial;
    view.detail = view.own_detail = 1;
    view.blend = KARST_BLEND_SHARE;
    karst_pinhole_init(&pinhole, camera, WIDTH, HEIGHT, VIEW_VOXELS);
    expect(karst_cast_pinhole(c->caster, &view, &pinhole, s->hits, &error), "cast", &error);
    const karst_collect_params params = {.serial = s->serial,
                                         .frame = s->frame,
                                         .turn = s->frame,
                                         .camera = camera->position,
                                         .max_tiles = MAX_LOADS,
                                         .max_bricks = MAX_LOADS};
    expect(karst_store_collect(c->store, &params, &work, &error), "collect", &error);
    s->num_evicted += work.num_evicted_bricks;
    s->num_evicted_tiles += work.num_evicted_tiles;
    s->num_reproduced += work.num_reproduced;
    if (work.num_loads + work.num_subdivides)
        answer(s, c, &work);
    return work.num_requests;
}

static void check(scene *s)
{
    karst_error error = {0};
    expect(karst_cache_check(s->cache, &error), "check", &error);
}

/* A picture's hits, but for the numbers of slots. malloc'ed. */
static karst_hit *read_hits(const scene *s)
{
    karst_error error = {0};
    karst_hit *hits = malloc(NUM_PIXELS * sizeof *hits);
    expect(hits && karst_buffer_read(s->hits, 0, hits, NUM_PIXELS * sizeof *hits, &error), "hits", &error);
    for (size_t i = 0; i < NUM_PIXELS; i++)
        hits[i].brick = hits[i].node = 0;
    return hits;
}

/* All stores by turns until they want nothing; `pictures`, of each, malloc'ed. */
static void settle(scene *s, const karst_camera *camera, karst_hit **pictures)
{
    uint32_t num_wanted = 1;
    for (int i = 0; num_wanted; i++) {
        assert_true(i < MAX_ROUNDS);
        num_wanted = 0;
        for (size_t k = 0; k < s->num; k++)
            num_wanted += draw(s, k, camera);
        check(s);
    }
    for (size_t k = 0; k < s->num; k++) {
        assert_int_equal(draw(s, k, camera), 0);
        pictures[k] = read_hits(s);
    }
}

/* The same of a world alone in a cache of its own. */
static karst_hit *picture_alone(karst_context *context, const karst_world_file *file, const karst_camera *camera)
{
    scene s;
    karst_hit *picture;
    scene_open(&s, context, file, ROOM_TILES, false);
    settle(&s, camera, &picture);
    scene_close(&s);
    return picture;
}

static void expect_same(const karst_hit *a, const karst_hit *b) { assert_memory_equal(a, b, NUM_PIXELS * sizeof *a); }

static uint32_t num_surfaces(const karst_hit *hits)
{
    uint32_t num = 0;
    for (size_t i = 0; i < NUM_PIXELS; i++)
        num += (hits[i].kind & 0xffu) == KARST_HIT_SURFACE;
    return num;
}

static void *copy_of(karst_buffer *buffer)
{
    karst_error error = {0};
    void *copy = malloc(buffer->size_bytes);
    expect(copy && karst_buffer_read(buffer, 0, copy, buffer->size_bytes, &error), "copy", &error);
    return copy;
}

/* Bricks that a store has in nodes where the land is proved to be air. */
static uint32_t bricks_in_air(const scene *s, const karst_store *store)
{
    const karst_cache_buffers *land = karst_cache_get_buffers(s->cache), *own = karst_store_get_buffers(store);
    karst_node *of_land = copy_of(land->nodes), *nodes = copy_of(own->nodes);
    karst_tile_info *tiles = copy_of(land->tile_info);
    uint32_t num = 0;
    for (uint32_t node = 0; node < land->num_tiles * KARST_TILE_NODES; node++)
        num += tiles[node / KARST_TILE_NODES].in_use && nodes[node].brick != KARST_NONE &&
               KARST_NODE_STATE(of_land[node].link) == KARST_STATE_AIR && of_land[node].brick == KARST_NONE;
    free(of_land);
    free(nodes);
    free(tiles);
    return num;
}

static uint32_t num_resident(scene *s)
{
    karst_error error = {0};
    uint32_t num_tiles, num_bricks;
    expect(karst_cache_count_resident(s->cache, &num_tiles, &num_bricks, &error), "count", &error);
    return num_bricks;
}

static void both_are_seen_as_if_alone(karst_context *context, bool by_device)
{
    karst_hit *land_alone[2], *body_alone[2], *seen[2];
    scene s;
    for (int v = 0; v < 2; v++) {
        land_alone[v] = picture_alone(context, files[0], &views[v]);
        body_alone[v] = picture_alone(context, files[1], &views[v]);
        assert_true(num_surfaces(land_alone[v]) > NUM_PIXELS / 5 && num_surfaces(body_alone[v]) > NUM_PIXELS / 10);
    }
    scene_open(&s, context, files[0], ROOM_TILES, by_device);
    /* The first view fits, with nothing to spare; not both. */
    karst_hit *only_land;
    settle(&s, &views[0], &only_land);
    expect_same(only_land, land_alone[0]);
    free(only_land);
    const uint32_t land_before = num_resident(&s);
    karst_store *body = scene_add_store(&s, "clear", BODY_BRICKS, 16, files[1]);
    for (int turn = 0; turn < 3; turn++) {
        const int v = turn & 1;
        s.num_evicted = s.num_reproduced = 0;
        settle(&s, &views[v], seen);
        expect_same(seen[0], land_alone[v]);
        expect_same(seen[1], body_alone[v]);
        free(seen[0]);
        free(seen[1]);
        if (turn == 0)
            assert_int_equal(num_resident(&s), land_before); /* what the body made took none of the land's slots */
        assert_true(bricks_in_air(&s, body) > 20);
        assert_true(karst_store_count_resident(body) < BODY_BRICKS);
        /* Of the body's: the land's pool holds both views. What it lost on the way to the second is found again. */
        assert_true(turn == 0 || s.num_evicted > 0);
        assert_true(turn < 2 || s.num_reproduced > 0);
    }

    /* A box within the body drops what both know there, and nothing of it is lost. */
    const karst_drop_box boxes[] = {{{-80, 100, -80}, {80, 160, 80}, 1}, {{-40, -20, -120}, {40, 20, -60}, 1}};
    karst_error error = {0};
    karst_dropped dropped = {0};
    uint32_t before = karst_store_count_resident(body), land_bricks = num_resident(&s);
    expect(karst_cache_drop(s.cache, boxes, 2, s.serial, &dropped, &error), "drop", &error);
    check(&s);
    uint32_t of_body = before - karst_store_count_resident(body), of_land = land_bricks - num_resident(&s);
    assert_true(of_body > 20 && of_land > 20);
    assert_in_range(dropped.num_bricks, of_body + of_land, of_body + of_land + 16); /* and root bricks */
    assert_true(bricks_in_air(&s, body) < before);
    settle(&s, &views[0], seen);
    expect_same(seen[0], land_alone[0]);
    expect_same(seen[1], body_alone[0]);
    for (int v = 0; v < 2; v++) {
        free(seen[v]);
        free(land_alone[v]);
        free(body_alone[v]);
    }
    scene_close(&s);
}

static karst_context *context;

static void test_host_collects(void **state)
{
    (void)state;
    both_are_seen_as_if_alone(context, false);
}

static void test_device_collects(void **state)
{
    (void)state;
    both_are_seen_as_if_alone(context, true);
}

/* Three stores that all hold something in the same nodes, on a tree that has no tiles for both views: tiles that are
 * recycled take the bricks of all with them. */
static void test_short_of_tiles(void **state)
{
    (void)state;
    karst_hit *alone[2][3], *seen[3];
    for (int v = 0; v < 2; v++)
        for (int i = 0; i < 3; i++)
            alone[v][i] = picture_alone(context, files[i], &views[v]);
    assert_true(num_surfaces(alone[0][2]) > NUM_PIXELS / 10);
    for (int by_device = 0; by_device < 2; by_device++) {
        scene s;
        scene_open(&s, context, files[0], FEW_TILES, by_device);
        scene_add_store(&s, "clear", 300, 16, files[1]);
        scene_add_store(&s, "air", 2000, 16, files[2]);
        for (int turn = 0; turn < 4; turn++) {
            s.num_evicted = s.num_evicted_tiles = 0;
            settle(&s, &views[turn & 1], seen);
            for (int i = 0; i < 3; i++) {
                expect_same(seen[i], alone[turn & 1][i]);
                free(seen[i]);
            }
            assert_int_equal(s.num_evicted_tiles > 0, turn > 0);
        }
        scene_close(&s);
    }
    for (int i = 0; i < 6; i++)
        free(alone[i / 3][i % 3]);
}

int main(void)
{
    static const char *const texts[] = {land_text, body_text, air_text};
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_host_collects), cmocka_unit_test(test_device_collects),
                                       cmocka_unit_test(test_short_of_tiles)};
    karst_error error = {0};
    context = karst_context_create(getenv("KARST_DEVICE"), 0, NULL, &error);
    expect(context, "context", &error);
    for (int i = 0; i < 3; i++) {
        files[i] = karst_world_file_compile("test", texts[i], strlen(texts[i]), NULL, 0, NULL, &error);
        expect(files[i], "world", &error);
    }
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    for (int i = 0; i < 3; i++)
        karst_world_file_destroy(files[i]);
    karst_context_destroy(context);
    return failed;
}
