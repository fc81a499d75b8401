/* Stores beside the land in an engine: what fills them, when they are at rest, what changes forget, and that worlds
 * without any know nothing of them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/ok.h"

enum { WIDTH = 64, HEIGHT = 48 };

#define HEAD                                                                                           \
    "/*{ \"voxel\": 0.015625, \"view\": 400, \"sun\": { \"azimuth\": 60, \"elevation\": 40 },\n"       \
    "\"sky\": { \"haze\": 1e12 }, \"camera\": { \"position\": [\"0\", \"1\", \"-6\"], \"fov\": 70 },\n" \
    "\"params\": { \"land_m\": { \"value\": 1.2, \"min\": 0.1, \"max\": 3 },\n"                    \
    "\"clear_m\": { \"value\": 1, \"min\": 0.1, \"max\": 3 } } }*/\n"                                  \
    "float density(vec3 p) { return max(-p.y, land_m - length(p - vec3(0.0, 2.5, 0.0))); }\n"
#define CLEAR "float clear(vec3 p) { return clear_m - length(p - vec3(1.5, 1.0, -2.0)); }\n"
static const char with_clear[] = HEAD CLEAR;
static const char without[] = HEAD "vec3 colour(vec3 p, vec3 n) { return vec3(0.4 * clear_m); }\n";
static const char coloured[] = HEAD CLEAR "vec3 colour(vec3 p, vec3 n) { return vec3(0.7, 0.2, 0.1); }\n";
static const char other_clear[] =
    HEAD "float clear(vec3 p) { return clear_m - length(p - vec3(-1.5, 1.0, -2.0)); }\n";
static const char no_number[] =
    HEAD "float clear(vec3 p) { return clear_m - 1e30 * (p.x * p.x) * (p.x * p.x) * 1e30; }\n";

static void write_world(const char *text, char path[64])
{
    snprintf(path, 64, "/tmp/karst-stores-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
}

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    char path[64];
    karst_error error = {0};
    karst_engine_config config = like ? *like : (karst_engine_config){.pool_bytes = (uint64_t)64 << 20};
    write_world(text, path);
    config.world = path;
    config.display = KARST_DISPLAY_NONE;
    config.width_px = WIDTH;
    config.height_px = HEIGHT;
    karst_engine *engine = karst_engine_create(&config, &error);
    unlink(path);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

/* What all frames together produced of the store, and of all. */
typedef struct {
    uint64_t of_store, all;
} made;

static made settle(karst_engine *engine, karst_stats *stats)
{
    made sum = {0};
    *stats = (karst_stats){0};
    for (int frame = 0; frame < 400 && !stats->settled; frame++) {
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, stats);
        sum.of_store += stats->num_stores ? stats->stores[0].num_produced : 0;
        sum.all += stats->num_bricks_produced;
    }
    assert_true(stats->settled);
    assert_ok(karst_engine_check(engine, &error));
    return sum;
}

static uint64_t memory_of(const karst_stats *stats, const char *name)
{
    for (size_t i = 0; i < stats->num_memory; i++)
        if (!strcmp(stats->memory[i].name, name))
            return stats->memory[i].size_bytes;
    return 0;
}

/* A store is filled as the land is, is at rest when a picture is settled, and its memory has its name. */
static void a_world_with_clear_matter_has_its_store(void **state)
{
    (void)state;
    karst_stats stats;
    karst_engine *engine = create(with_clear, NULL);
    const made first = settle(engine, &stats);
    assert_int_equal(stats.num_stores, 1);
    assert_string_equal(stats.stores[0].name, "clear");
    assert_true(first.of_store > 8 && first.all > first.of_store);
    assert_true(stats.stores[0].bricks.num_used > 0);
    assert_true(stats.stores[0].num_resident_bricks >= stats.stores[0].bricks.num_used);
    assert_true(memory_of(&stats, "clear bricks") > 0 && memory_of(&stats, "clear nodes") > 0);
    assert_true(stats.stores[0].bricks.size_bytes >= memory_of(&stats, "clear bricks"));
    uint64_t all = 0;
    for (size_t i = 0; i < stats.num_memory; i++)
        all += strncmp(stats.memory[i].name, "clear ", 6) ? 0 : stats.memory[i].size_bytes;
    print_message("%d bricks of %d are clear matter; %d KiB\n", (int)first.of_store, (int)first.all, (int)(all >> 10));
    assert_int_equal(settle(engine, &stats).all, 0);
    karst_engine_destroy(engine);
    engine = create(without, NULL);
    settle(engine, &stats);
    assert_int_equal(stats.num_stores, 0);
    for (size_t i = 0; i < stats.num_memory; i++)
        assert_true(strncmp(stats.memory[i].name, "clear ", 6) != 0);
    karst_engine_destroy(engine);
}

/* Where its pool does not hold the view the ladder asks for less, as it does for the land's, and rests. */
static void it_settles_in_pools_of_any_size(void **state)
{
    (void)state;
    karst_stats stats;
    karst_engine *engine = create(with_clear, &(karst_engine_config){.pool_bytes = (uint64_t)64 << 20});
    settle(engine, &stats);
    const uint32_t bricks = (uint32_t)stats.bricks.num_used, tiles = (uint32_t)stats.tiles.num_used;
    karst_engine_destroy(engine);
    double given_px = 0;
    static const uint32_t percents[] = {100, 50, 25, 10};
    for (int i = 0; i < 4; i++) {
        const uint32_t percent = percents[i];
        const uint32_t num_bricks = bricks * percent / 100 + 10, num_tiles = tiles * percent / 100 + 10;
        engine = create(with_clear, &(karst_engine_config){.num_bricks = num_bricks < 34 ? 34 : num_bricks,
                                                          .num_tiles = num_tiles < 48 ? 48 : num_tiles});
        settle(engine, &stats);
        print_message("%u %%: %d of %d bricks of clear matter are used, %.2f px\n", percent,
                      (int)stats.stores[0].bricks.num_used, (int)stats.stores[0].bricks.num_total,
                      stats.detail_given_px);
        assert_int_equal(stats.num_incomplete, 0);
        assert_true(stats.stores[0].bricks.num_used <= stats.stores[0].bricks.num_total);
        assert_true(stats.detail_given_px >= given_px);
        given_px = stats.detail_given_px;
        karst_engine_destroy(engine);
    }
    assert_true(given_px > 1);
}

static made change_to(karst_engine *engine, const char *text, bool *kept)
{
    char path[64];
    karst_error why = {0};
    karst_stats stats;
    write_world(text, path);
    const karst_world_config config = {.world = path};
    karst_prepared_world *world = karst_engine_prepare_world(engine, &config, &why);
    unlink(path);
    if (!world)
        fail_msg("%s", why.message);
    assert_ok(karst_engine_change_world(engine, world, kept, &error));
    return settle(engine, &stats);
}

static made set(karst_engine *engine, const char *name, double value)
{
    karst_stats stats;
    const karst_parameter parameter = {name, value};
    assert_ok(karst_engine_set_parameters(engine, &parameter, 1, &error));
    return settle(engine, &stats);
}

/* Rays that clear matter turns ask for land that was not asked for; what was there is not made again. */
static uint64_t of_land(made m) { return m.all - m.of_store; }

/* What changes is forgotten, in the store that it is of; the rest stays. */
static void changes_forget_what_changes(void **state)
{
    (void)state;
    karst_stats stats;
    bool kept;
    karst_engine *engine = create(with_clear, NULL);
    const made first = settle(engine, &stats);
    const made smaller = set(engine, "clear_m", 0.7);
    assert_true(smaller.of_store > 8);
    assert_true(of_land(smaller) < of_land(first) / 2);
    const made land = set(engine, "land_m", 1.0);
    assert_true(land.of_store > 8 && land.all > land.of_store);
    set(engine, "land_m", 1.2);
    set(engine, "clear_m", 1);
    made now = change_to(engine, coloured, &kept);
    assert_true(kept);
    assert_int_equal(now.all, 0);
    now = change_to(engine, other_clear, &kept);
    assert_true(kept && now.of_store > 8 && of_land(now) < of_land(first) / 2);
    now = change_to(engine, without, &kept);
    assert_true(kept);
    assert_int_equal(now.all, 0);
    karst_engine_stats(engine, &stats);
    assert_int_equal(stats.stores[0].num_resident_bricks, 0);
    now = change_to(engine, with_clear, &kept);
    assert_true(kept && of_land(now) < of_land(first) / 2);
    assert_true(now.of_store >= first.of_store);
    karst_engine_destroy(engine);
}

/* A world that comes with clear matter to an engine without a store for it is shown without. */
static void memory_is_fixed_when_the_engine_is_made(void **state)
{
    (void)state;
    bool kept;
    karst_stats stats;
    karst_engine *engine = create(without, NULL);
    settle(engine, &stats);
    change_to(engine, with_clear, &kept);
    karst_engine_stats(engine, &stats);
    assert_int_equal(stats.num_stores, 0);
    karst_engine_destroy(engine);
}

/* An edit forgets what its box meets in every store; the next picture has it again. */
static void edits_forget_in_every_store(void **state)
{
    (void)state;
    karst_stats stats;
    karst_engine *engine = create(with_clear, NULL);
    settle(engine, &stats);
    const karst_edit hole = {.shape = KARST_EDIT_SPHERE,
                             .mode = KARST_EDIT_REMOVE,
                             .at = {{96, 64, -128}, {0, 0, 0}},
                             .radius_m = 0.5};
    assert_ok(karst_engine_edit(engine, &hole, 1, &error));
    const made now = settle(engine, &stats);
    assert_true(now.of_store > 0);
    assert_true(stats.stores[0].bricks.num_used > 0);
    karst_engine_destroy(engine);
}

static int num_warnings;
static void count_warnings(void *user, karst_log_level level, const char *line)
{
    (void)user;
    num_warnings += level == KARST_LOG_WARNING && strstr(line, "the clear is not finite") != NULL;
}

/* What is no number is air there, too, and is said once. */
static void what_is_no_number_is_air_and_is_told(void **state)
{
    (void)state;
    karst_stats stats;
    const karst_log log = {.write = count_warnings, .max_level = KARST_LOG_WARNING};
    karst_engine *engine =
        create(no_number, &(karst_engine_config){.pool_bytes = (uint64_t)64 << 20, .log = &log});
    settle(engine, &stats);
    assert_true(stats.num_non_finite > 0);
    assert_int_equal(num_warnings, 1);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_world_with_clear_matter_has_its_store),
        cmocka_unit_test(it_settles_in_pools_of_any_size),
        cmocka_unit_test(changes_forget_what_changes),
        cmocka_unit_test(memory_is_fixed_when_the_engine_is_made),
        cmocka_unit_test(edits_forget_in_every_store),
        cmocka_unit_test(what_is_no_number_is_air_and_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
