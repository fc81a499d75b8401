/* Particles in pictures, and groups: pictures depend on view and time alone, on every shape and in any pool; what does
 * not move stays; a sun that moves is followed in parts, and a sun that stands is rest. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/engine/engine_parts.h"
#include "karst/karst.h"
#include "karst/medium.h"
#include "raycast/media/media_internal.h"
#include "tests/support/ok.h"

enum { WIDTH = 48, HEIGHT = 32, NUM_VALUES = WIDTH * HEIGHT * 3 };

#define HEAD(particles)                                                                                  \
    "/*{ \"voxel\": 0.25, \"view\": 300, \"sun\": { \"azimuth\": 270, \"elevation\": 40 },\n"            \
    "\"sky\": { \"haze\": 1e12 }, \"camera\": { \"position\": [\"0\", \"8\", \"-30\"], \"fov\": 60 },\n" \
    "\"params\": { \"many\": { \"value\": 80, \"min\": 0, \"max\": 1e7 },\n"                             \
    "\"thick\": { \"value\": 0.5, \"min\": 0, \"max\": 9 } },\n"                                         \
    "\"particles\": " particles " }*/\n"                                                                 \
    "float density(vec3 p) { return -p.y; }\n"
#define AIR "medium air(vec3 p) { medium m; m.extinction = 0.0; m.albedo = vec3(0.9); m.g = 0.2; return m; }\n"
#define PUFFS                                                                                              \
    "[{ \"emitter\": \"ball\", \"at\": [\"-4\", \"7\", \"0\"], \"size\": [8, 6, 8], \"velocity\": [2, 0, 0],\n" \
    "\"life\": 5, \"count\": \"many\", \"radius\": [1, 2], \"extinction\": \"thick\", \"seed\": 4 }]"
static const char puffs[] = HEAD(PUFFS) AIR;

static char *write_world(const char *text)
{
    static char path[64];
    snprintf(path, sizeof path, "/tmp/karst-smoke-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    return path;
}

static karst_engine *try_create(const char *text, const karst_engine_config *like, karst_error *error)
{
    karst_engine_config config = like ? *like : (karst_engine_config){0};
    config.world = write_world(text);
    config.pool_bytes = config.pool_bytes ? config.pool_bytes : (uint64_t)96 << 20;
    config.display = KARST_DISPLAY_NONE;
    config.width_px = WIDTH;
    config.height_px = HEIGHT;
    config.tone = KARST_TONE_OF_FILM;
    karst_engine *engine = karst_engine_create(&config, error);
    unlink(config.world);
    return engine;
}

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    karst_error error = {0};
    karst_engine *engine = try_create(text, like, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static void settle(karst_engine *engine, float *light)
{
    bool settled;
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_check(engine, &error));
    assert_ok(karst_engine_read_radiance(engine, light, NUM_VALUES, &error));
}

/* ---- time ---- */

static void pictures_depend_on_view_and_time_alone(void **state)
{
    (void)state;
    static float first[NUM_VALUES], later[NUM_VALUES], other[NUM_VALUES];
    const karst_engine_config one_lane = {.lanes = 1}, other_pool = {.pool_bytes = (uint64_t)48 << 20};
    const karst_engine_config *const configs[] = {&one_lane, &other_pool};
    karst_engine *engine = create(puffs, NULL);
    settle(engine, first);
    assert_ok(karst_engine_set_time(engine, 3.25, &error));
    assert_true(karst_engine_time(engine) == 3.25);
    settle(engine, later);
    assert_memory_not_equal(later, first, sizeof first);
    assert_ok(karst_engine_set_time(engine, 0, &error));
    settle(engine, other);
    assert_memory_equal(other, first, sizeof first);
    /* Parameters move them, too, and back. */
    for (int i = 0; i < 2; i++) {
        const karst_parameter fewer = {"many", i ? 80 : 20};
        assert_ok(karst_engine_set_parameters(engine, &fewer, 1, &error));
        settle(engine, other);
        assert_int_equal(memcmp(other, first, sizeof first) == 0, i);
    }
    /* What is refused leaves all as it was. */
    const karst_parameter too_many = {"many", 1e7};
    karst_error why = {0};
    assert_false(karst_engine_set_parameters(engine, &too_many, 1, &why));
    assert_non_null(strstr(why.message, "10000000 particles"));
    assert_false(karst_engine_set_time(engine, (double)NAN, &why));
    assert_int_equal(why.status, KARST_USAGE);
    assert_false(karst_engine_set_time(engine, 2e9, &why));
    settle(engine, other);
    assert_memory_equal(other, first, sizeof first);
    karst_engine_destroy(engine);
    for (int i = 0; i < (getenv("KARST_TEST_FULL") ? 2 : 1); i++) {
        engine = create(puffs, configs[i]);
        assert_ok(karst_engine_set_time(engine, 3.25, &error));
        settle(engine, other);
        assert_memory_equal(other, later, sizeof later);
        karst_engine_destroy(engine);
    }
}

static karst_brick_owner *owners_of(const karst_engine *engine, uint32_t *num)
{
    const karst_cache_buffers *air = karst_store_get_buffers(engine->stores[KARST_CONTENT_AIR].store);
    *num = air->num_bricks + KARST_CACHE_ROOT_BRICKS;
    karst_brick_owner *owners = malloc(*num * sizeof *owners);
    assert_ok(karst_buffer_read(air->brick_owner, 0, owners, *num * sizeof *owners, &error));
    return owners;
}

/* How many bricks there are, and how many of them were there before. */
static uint32_t count_kept(const karst_brick_owner *before, const karst_brick_owner *after, uint32_t num,
                           uint32_t *num_all)
{
    uint32_t num_kept = 0;
    *num_all = 0;
    for (uint32_t i = 0; i < num; i++) {
        *num_all += after[i].owner != KARST_NO_NODE;
        num_kept += after[i].owner != KARST_NO_NODE && !memcmp(&before[i], &after[i], sizeof *after);
    }
    return num_kept;
}

/* A cloud that stands, and one ball that moves far beside it: bricks of the cloud stay, but for coarse ones of both. */
static void what_stands_stays(void **state)
{
    (void)state;
    char csv[] = "/tmp/karst-stand-XXXXXX.csv", text[2048];
    FILE *file = fdopen(mkstemps(csv, 4), "w");
    fprintf(file, "x,y,z,radius,extinction,vx,vy,vz\n");
    for (int i = 0; i < 120; i++)
        fprintf(file, "%d,%d,%d,1.6,0.1,0,0,0\n", i % 5 * 2 - 12, i / 5 % 4 * 2 + 3, i / 20 * 2);
    fprintf(file, "40,8,0,0.7,1,0.5,0,0\n");
    fclose(file);
    snprintf(text, sizeof text, HEAD("[{ \"file\": \"%s\" }]") AIR, csv);
    const karst_engine_config fine = {.detail_px = 0.25};
    karst_engine *engine = create(text, &fine);
    bool settled;
    uint32_t num, num_all, num_kept[2];
    unlink(csv);
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    for (int i = 0; i < 2; i++) { /* what is the same is not made at all */
        karst_brick_owner *before = owners_of(engine, &num);
        assert_ok(karst_engine_set_time(engine, 1, &error));
        assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
        karst_brick_owner *after = owners_of(engine, &num);
        num_kept[i] = count_kept(before, after, num, &num_all);
        free(before);
        free(after);
    }
    print_message("# of %u bricks of air, one ball's move leaves %u, and none %u\n", num_all, num_kept[0], num_kept[1]);
    assert_true(num_kept[0] > num_all / 2 && num_kept[0] < num_all && num_kept[1] == num_all);
    karst_engine_destroy(engine);
}

/* ---- groups ---- */

typedef struct {
    uint32_t num;
    uint32_t *grids;
    karst_sun_depth *states;
} snapshot;

static snapshot take(const karst_engine *engine)
{
    const karst_media *media = engine->media;
    snapshot s = {.num = media->air.num_bricks + KARST_CACHE_ROOT_BRICKS};
    s.grids = malloc((size_t)s.num * KARST_SUN_DEPTH_PLACES * 4);
    s.states = malloc(s.num * sizeof *s.states);
    assert_ok(karst_buffer_read(media->grids, 0, s.grids, (size_t)s.num * KARST_SUN_DEPTH_PLACES * 4, &error));
    assert_ok(karst_buffer_read(media->states, 0, s.states, s.num * sizeof *s.states, &error));
    return s;
}

static void drop(snapshot *s)
{
    free(s->grids);
    free(s->states);
}

static bool same_brick(const karst_sun_depth *a, const karst_sun_depth *b)
{
    return a->sun && b->sun && a->owner == b->owner && a->owner_generation == b->owner_generation;
}

/* How far one is from another, relative to the depths, over bricks that both have and that the other made last. */
static double apart(const snapshot *one, const snapshot *other, uint32_t sun)
{
    double sum = 0, all = 0;
    for (uint32_t i = 0; i < one->num; i++)
        for (uint32_t k = 0; k < KARST_SUN_DEPTH_PLACES; k++) {
            float a, b;
            if (!same_brick(&one->states[i], &other->states[i]) || other->states[i].sun != sun)
                break;
            memcpy(&a, &one->grids[(size_t)i * KARST_SUN_DEPTH_PLACES + k], 4);
            memcpy(&b, &other->grids[(size_t)i * KARST_SUN_DEPTH_PLACES + k], 4);
            sum += ((double)a - (double)b) * ((double)a - (double)b);
            all += (double)b * (double)b;
        }
    return sqrt(sum / all);
}

static void turn(karst_engine *engine, double azimuth_deg)
{
    const karst_sun sun = {azimuth_deg, 40};
    assert_ok(karst_engine_set_sun(engine, &sun, &error));
    assert_ok(karst_engine_frame(engine, &error));
}

static uint32_t num_made_since(const snapshot *before, const snapshot *after, uint32_t *num_all)
{
    uint32_t num = 0;
    *num_all = 0;
    for (uint32_t i = 0; i < after->num; i++) {
        *num_all += after->states[i].sun != 0;
        num += same_brick(&before->states[i], &after->states[i]) && before->states[i].sun != after->states[i].sun;
    }
    return num;
}

static void groups_follow_the_sun(void **state)
{
    (void)state;
    enum { GROUPS = 8 };
    static float light[NUM_VALUES], whole[NUM_VALUES];
    karst_engine *engine = create(puffs, NULL);
    karst_error why = {0};
    assert_false(karst_engine_set_media_groups(engine, 0, &why));
    assert_false(karst_engine_set_media_groups(engine, 5000, &why));
    assert_ok(karst_engine_set_media_groups(engine, GROUPS, &error));
    settle(engine, light);
    for (int i = 1; i <= 8; i++) {
        uint32_t num_all;
        snapshot before = take(engine);
        turn(engine, 270 + i);
        snapshot after = take(engine);
        const uint32_t num = num_made_since(&before, &after, &num_all);
        assert_true(num > 0 && num <= (num_all + GROUPS - 1) / GROUPS);
        drop(&before);
        drop(&after);
    }
    snapshot in_groups = take(engine);
    settle(engine, whole); /* makes all, for the same sun */
    snapshot full = take(engine);
    const uint32_t sun = engine->media->sun_number;
    const double rms = apart(&in_groups, &full, sun);
    print_message("# 8 degrees in 8 frames, 1/8 a frame: %.4f rms of the full update\n", rms);
    assert_true(rms > 0 && rms < 0.05);
    drop(&in_groups);
    drop(&full);
    karst_engine_destroy(engine);

    /* A sun that stands: the rest is made, a part a frame, and then there is rest, with the same picture. */
    engine = create(puffs, NULL);
    assert_ok(karst_engine_set_media_groups(engine, GROUPS, &error));
    settle(engine, light);
    turn(engine, 278);
    karst_stats stats = {0};
    int num_frames = 0;
    for (; !stats.settled && num_frames < 100; num_frames++) {
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
    }
    print_message("# at rest %d frames after the sun\n", num_frames);
    assert_true(stats.settled && num_frames >= 3 && num_frames < 40);
    assert_ok(karst_engine_read_radiance(engine, light, NUM_VALUES, &error));
    assert_memory_equal(light, whole, sizeof whole);
    snapshot before = take(engine);
    assert_ok(karst_engine_frame(engine, &error));
    karst_engine_stats(engine, &stats);
    snapshot after = take(engine);
    assert_true(stats.settled && stats.num_produced == 0);
    assert_memory_equal(before.states, after.states, before.num * sizeof *before.states);
    drop(&before);
    drop(&after);
    karst_engine_destroy(engine);
}

/* Whatever room there is, a view that stands rests. */
static void calm_in_any_pool(void **state)
{
    (void)state;
    static const uint64_t pools_kib[] = {2560, 6400, 12800, 25600}; /* 10, 25, 50, 100 % */
    static float light[NUM_VALUES];
    for (int i = 0; i < (getenv("KARST_TEST_FULL") ? 4 : 1); i++) {
        const karst_engine_config config = {.pool_bytes = pools_kib[i] << 10, .detail_px = 0.25};
        karst_engine *engine = create(puffs, &config);
        karst_stats stats;
        assert_ok(karst_engine_set_media_groups(engine, 4, &error));
        settle(engine, light);
        turn(engine, 300);
        settle(engine, light);
        for (int k = 0; k < 3; k++) {
            assert_ok(karst_engine_frame(engine, &error));
            karst_engine_stats(engine, &stats);
            assert_true(stats.settled && stats.num_produced == 0 && stats.num_evicted == 0);
        }
        print_message("# %llu KiB: voxels of %.2f px\n", (unsigned long long)pools_kib[i], stats.detail_given_px);
        karst_engine_destroy(engine);
    }
}

/* ---- rays, and what is refused ---- */

static void rays_meet_balls(void **state)
{
    (void)state;
    char csv[] = "/tmp/karst-balls-XXXXXX.csv", text[2048];
    FILE *file = fdopen(mkstemps(csv, 4), "w");
    fprintf(file, "x,y,z,radius,extinction,vx,vy,vz\n0,10,0,2,0.3,1,0,0\n3,10,0,2,0.3,1,0,0\n");
    fclose(file);
    snprintf(text, sizeof text, HEAD("[{ \"file\": \"%s\" }]") AIR, csv);
    const karst_world_config config = {.world = write_world(text)};
    karst_world *world;
    assert_ok(world = karst_world_open(&config, &error));
    karst_medium_ray ray = {.direction = {1, 0, 0}, .device = getenv("KARST_DEVICE"), .time_s = 5};
    karst_medium_depth depth;
    ray.from.voxel[0] = -40;
    ray.from.voxel[1] = 40;
    assert_ok(karst_world_medium_depth(world, &ray, &depth, &error));
    print_message("# two balls: %.7f by bricks, %.7f by intervals\n", depth.optical_depth,
                  depth.oracle_optical_depth);
    assert_true(fabs(depth.oracle_optical_depth - 0.3 * 7) < 1e-5 * 2.1);
    assert_true(fabs(depth.optical_depth - 0.3 * 7) < 0.02 * 2.1);
    ray.from.voxel[0] = 40; /* past the first, in the second: it is at 8 now */
    assert_ok(karst_world_medium_depth(world, &ray, &depth, &error));
    assert_true(fabs(depth.oracle_optical_depth - 0.3 * 0) < 1e-5);
    ray.time_s = (double)NAN;
    karst_error why = {0};
    assert_false(karst_world_medium_depth(world, &ray, &depth, &why));
    assert_non_null(strstr(why.message, "time"));
    karst_world_close(world);
    unlink(config.world);
    unlink(csv);
}

static void bad_worlds_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
        bool is_text_good;
    } bad[] = {
        {HEAD("[{ \"emitter\": \"ball\" }]"), "medium air", false},
        {HEAD("[{ \"emitter\": \"cone\" }]") AIR, "no shape \"cone\"", false},
        {HEAD("[{ \"emitter\": \"ball\", \"life\": 0 }]") AIR, "\"life\" is a number from", false},
        {HEAD("[{ \"emitter\": \"ball\", \"extinction\": -1 }]") AIR, "\"extinction\" is a number from 0", false},
        {HEAD("[{ \"emitter\": \"ball\", \"extinction\": 1e400 }]") AIR, "header is not JSON", false},
        {HEAD("[{ \"emitter\": \"ball\", \"count\": \"lots\" }]") AIR, "parameter \"lots\", which there is not", false},
        {HEAD("[{ \"emitter\": \"ball\", \"radius\": [1, 2, 3] }]") AIR, "\"radius\" is a number, or two", false},
        {HEAD("[{ \"emitter\": \"ball\", \"file\": \"a.csv\" }]") AIR, "either a \"file\" or an \"emitter\"", false},
        {HEAD("[{ \"emitter\": \"ball\", \"combine\": \"max\" }]") AIR, "\"combine\" cannot be \"max\"", false},
        {HEAD("{}") AIR, "\"particles\" is a list", false},
        {HEAD("[{ \"file\": \"no-such-file.csv\" }]") AIR, "no-such-file.csv", true},
        {HEAD("[{ \"emitter\": \"ball\", \"count\": 1e7 }]") AIR, "10000000 particles: 1000000 are the most", true},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        karst_error why = {0};
        const karst_world_config config = {.world = write_world(bad[i].text)};
        karst_world *world = karst_world_open(&config, &why); /* says what the text tells; engines read files, too */
        unlink(config.world);
        assert_true((world != NULL) == bad[i].is_text_good);
        karst_world_close(world);
        if (world)
            assert_null(try_create(bad[i].text, NULL, &why));
        if (!strstr(why.message, bad[i].says))
            fail_msg("'%s' does not say '%s'", why.message, bad[i].says);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_depend_on_view_and_time_alone), cmocka_unit_test(what_stands_stays),
        cmocka_unit_test(groups_follow_the_sun),                  cmocka_unit_test(calm_in_any_pool),
        cmocka_unit_test(rays_meet_balls),                        cmocka_unit_test(bad_worlds_are_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
