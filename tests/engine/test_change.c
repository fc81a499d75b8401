/* A world that changes under an engine: parameters, texts, other worlds. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include <pthread.h>

#include "karst/karst.h"

enum { WIDTH_PX = 96, HEIGHT_PX = 64, NUM_BYTES = WIDTH_PX * HEIGHT_PX * 4 };

#define BALL(colour, body)                                                                                             \
    "/*{ \"voxel\": 0.03125, \"view\": 64, \"params\": {"                                                              \
    "\"radius\": { \"value\": 2, \"min\": 0.5, \"max\": 3 }, \"red\": { \"value\": 0.5, \"min\": 0, \"max\": 1 },"     \
    "\"lumps\": { \"value\": 2, \"min\": 1, \"max\": 6 } },"                                                           \
    "\"camera\": { \"position\": [\"0\", \"0\", \"-8\"], \"yaw\": 0, \"pitch\": 0 } }*/\n"                             \
    "float density(vec3 p) { float d = radius - length(p); for (int i = 0; i < int(lumps); i++)"                       \
    " d = max(d, 0.7 - length(p - vec3(float(i), 2.5, 0.0))); return " body "; }\n"                                    \
    "vec3 colour(vec3 p, vec3 n) { return " colour "; }\n"

static char path[] = "/tmp/karst-change-XXXXXX.karst";

static void write_world(const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static void say(void *user, karst_log_level level, const char *line)
{
    (void)user;
    if (level <= KARST_LOG_WARNING)
        print_message("%s\n", line);
}
static const karst_log logging = {.write = say, .max_level = KARST_LOG_WARNING};

static karst_engine *open_engine(bool refine)
{
    karst_error error = {0};
    const karst_engine_config config = {.world = path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH_PX,
                                        .height_px = HEIGHT_PX,
                                        .pool_bytes = (uint64_t)48 << 20,
                                        .refine = refine,
                                        .log = &logging};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

/* Frames until settled; returns the tiles and bricks that were made for it. */
static uint64_t settle(karst_engine *engine, uint8_t pixels[NUM_BYTES])
{
    karst_error error = {0};
    karst_stats stats = {0};
    uint64_t num_produced = 0;
    for (int frame = 0; frame < 200 && !stats.settled; frame++) {
        if (!karst_engine_frame(engine, &error))
            fail_msg("%s", error.message);
        karst_engine_stats(engine, &stats);
        num_produced += stats.num_produced;
    }
    assert_true(stats.settled);
    assert_true(karst_engine_read_pixels(engine, pixels, NUM_BYTES, &error));
    return num_produced;
}

static void set(karst_engine *engine, const char *name, double value)
{
    karst_error error = {0};
    double now;
    const karst_parameter parameter = {name, value};
    if (!karst_engine_set_parameters(engine, &parameter, 1, &error))
        fail_msg("%s", error.message);
    assert_true(karst_engine_parameter(engine, name, &now, &error));
}

/* The picture of an engine made with these parameters from the start. */
static void fresh_picture(const karst_parameter *parameters, size_t count, uint8_t pixels[NUM_BYTES])
{
    karst_error error = {0};
    const karst_engine_config config = {.world = path,
                                        .parameters = parameters,
                                        .num_parameters = count,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH_PX,
                                        .height_px = HEIGHT_PX,
                                        .pool_bytes = (uint64_t)48 << 20,
                                        .log = &logging};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine)
        fail_msg("%s", error.message);
    settle(engine, pixels);
    karst_engine_destroy(engine);
}

static void test_parameters(void **state)
{
    (void)state;
    static uint8_t first[NUM_BYTES], now[NUM_BYTES], fresh[NUM_BYTES];
    write_world(BALL("vec3(red, 0.3, 0.2)", "d"));
    karst_engine *engine = open_engine(false);
    assert_true(settle(engine, first) > 0);

    /* A colour drops nothing. */
    set(engine, "red", 0.9);
    assert_int_equal(settle(engine, now), 0);
    assert_memory_not_equal(first, now, NUM_BYTES);
    fresh_picture((karst_parameter[]){{"red", 0.9}}, 1, fresh);
    assert_memory_equal(now, fresh, NUM_BYTES);

    /* The density does; and back again is the first picture. */
    set(engine, "radius", 1.25);
    assert_true(settle(engine, now) > 0);
    fresh_picture((karst_parameter[]){{"red", 0.9}, {"radius", 1.25}}, 2, fresh);
    assert_memory_equal(now, fresh, NUM_BYTES);
    set(engine, "radius", 2);
    set(engine, "red", 0.5);
    settle(engine, now);
    assert_memory_equal(now, first, NUM_BYTES);

    /* The same value again is no change. */
    set(engine, "radius", 2);
    assert_int_equal(settle(engine, now), 0);

    /* One that decides a loop is compiled anew, with the others' values. */
    set(engine, "red", 0.1);
    set(engine, "lumps", 4);
    settle(engine, now);
    fresh_picture((karst_parameter[]){{"red", 0.1}, {"lumps", 4}}, 2, fresh);
    assert_memory_equal(now, fresh, NUM_BYTES);
    karst_engine_destroy(engine);
}

static void test_bad_parameters_change_nothing(void **state)
{
    (void)state;
    static uint8_t first[NUM_BYTES], now[NUM_BYTES];
    karst_error error = {0};
    double value;
    write_world(BALL("vec3(red, 0.3, 0.2)", "d"));
    karst_engine *engine = open_engine(false);
    settle(engine, first);
    const karst_parameter unknown[] = {{"radius", 1}, {"colour", 1}};
    assert_false(karst_engine_set_parameters(engine, unknown, 2, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_non_null(strstr(error.message, "'colour'"));
    assert_true(karst_engine_parameter(engine, "radius", &value, &error));
    assert_true(value == 2);
    assert_int_equal(settle(engine, now), 0);
    assert_memory_equal(first, now, NUM_BYTES);
    set(engine, "radius", 1e9); /* clamped */
    assert_true(karst_engine_parameter(engine, "radius", &value, &error));
    assert_true(value == 3);
    karst_engine_destroy(engine);
}

typedef struct {
    karst_engine *engine;
    karst_prepared_world *world;
    karst_error error;
    bool done;
} preparation;

static void *prepare(void *user)
{
    preparation *p = user;
    const karst_world_config config = {.world = path};
    p->world = karst_engine_prepare_world(p->engine, &config, &p->error);
    __atomic_store_n(&p->done, true, __ATOMIC_RELEASE);
    return NULL;
}

/* Prepares beside frames, which go on. */
static bool change(karst_engine *engine, bool *kept, karst_error *error)
{
    preparation p = {.engine = engine};
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, prepare, &p), 0);
    do
        assert_true(karst_engine_frame(engine, error));
    while (!__atomic_load_n(&p.done, __ATOMIC_ACQUIRE));
    assert_int_equal(pthread_join(thread, NULL), 0);
    *error = p.error;
    return p.world && karst_engine_change_world(engine, p.world, kept, error);
}

static void test_texts(void **state)
{
    (void)state;
    static uint8_t first[NUM_BYTES], now[NUM_BYTES], fresh[NUM_BYTES];
    karst_error error = {0};
    bool kept;
    write_world(BALL("vec3(red, 0.3, 0.2)", "d"));
    karst_engine *engine = open_engine(true);
    settle(engine, first);

    /* Another colour: no brick is made again. */
    write_world(BALL("vec3(0.1, red * fract(p.x), 0.6)", "d"));
    assert_true(change(engine, &kept, &error));
    assert_true(kept);
    assert_int_equal(settle(engine, now), 0);
    assert_memory_not_equal(first, now, NUM_BYTES);

    /* Another shape. */
    write_world(BALL("vec3(red, 0.3, 0.2)", "min(d, p.y)"));
    assert_true(change(engine, &kept, &error));
    assert_false(kept);
    assert_true(settle(engine, now) > 0);

    /* A mistake: the old world stays, and the message says where. */
    write_world(BALL("vec3(red, 0.3, 0.2)", "dd"));
    assert_false(change(engine, &kept, &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    assert_non_null(strstr(error.message, "dd"));
    settle(engine, fresh);
    assert_memory_equal(now, fresh, NUM_BYTES);

    /* Back to the first. */
    write_world(BALL("vec3(red, 0.3, 0.2)", "d"));
    assert_true(change(engine, &kept, &error));
    assert_false(kept);
    settle(engine, now);
    assert_memory_equal(first, now, NUM_BYTES);
    karst_engine_destroy(engine);
}

/* Another voxel: the camera stays where it is. */
static void test_voxel(void **state)
{
    (void)state;
    static uint8_t first[NUM_BYTES];
    karst_error error = {0};
    bool kept;
    write_world(BALL("vec3(red, 0.3, 0.2)", "d"));
    karst_engine *engine = open_engine(false);
    settle(engine, first);
    karst_camera before = karst_engine_camera(engine);
    write_world("/*{ \"voxel\": 0.0078125, \"view\": 64 }*/ float density(vec3 p) { return 2.0 - length(p); }");
    assert_true(change(engine, &kept, &error));
    assert_false(kept);
    assert_int_equal(karst_engine_voxel_log2_m(engine), -7);
    karst_camera after = karst_engine_camera(engine);
    for (int axis = 0; axis < 3; axis++)
        assert_true(after.position.voxel[axis] == 4 * before.position.voxel[axis]);
    assert_true(settle(engine, first) > 0);
    karst_engine_destroy(engine);
}

/* Shows the text's colours at once, if that is possible. */
static bool show_colours(karst_engine *engine)
{
    karst_error error = {0};
    bool shown;
    const karst_world_config config = {.world = path};
    if (!karst_engine_show_colours(engine, &config, &shown, &error))
        fail_msg("%s", error.message);
    return shown;
}

#define NOISY "vec3(0.5 + 0.5 * noise(4.0 * p), red, fract(3.0 * p.y)) * (n.y > 0.2 ? 1.0 : 0.3)"

/* On their tape, then compiled: the same bytes, and nothing is made again. */
static void test_colours_at_once(void **state)
{
    (void)state;
    static uint8_t taped[NUM_BYTES], compiled[NUM_BYTES], fresh[NUM_BYTES], before[NUM_BYTES];
    karst_error error = {0};
    bool kept = false;
    write_world(BALL("vec3(0.2, red, 0.1)", "d"));
    karst_engine *engine = open_engine(false);
    uint64_t num_made = settle(engine, before);
    write_world(BALL(NOISY, "d"));
    assert_false(show_colours(engine)); /* not prepared */
    if (!karst_engine_prepare_colours(engine, &error))
        fail_msg("%s", error.message);
    assert_true(show_colours(engine));
    assert_int_equal(settle(engine, taped), 0);
    fresh_picture(NULL, 0, fresh);
    assert_memory_not_equal(before, taped, NUM_BYTES);
    assert_memory_equal(taped, fresh, NUM_BYTES);
    assert_true(change(engine, &kept, &error));
    assert_true(kept);
    assert_int_equal(settle(engine, compiled), 0);
    assert_memory_equal(compiled, fresh, NUM_BYTES);

    /* A parameter of colours that run on their tape. */
    write_world(BALL("vec3(0.1, red, noise(p))", "d"));
    assert_true(show_colours(engine));
    set(engine, "red", 0.9);
    assert_int_equal(settle(engine, taped), 0);
    const karst_parameter red = {"red", 0.9};
    fresh_picture(&red, 1, fresh);
    assert_memory_equal(taped, fresh, NUM_BYTES);

    /* Another density is no matter of colours; a bad text changes nothing. */
    write_world(BALL("vec3(0.1, red, noise(p))", "d - 0.25"));
    assert_false(show_colours(engine));
    write_world("float density(vec3 p) { return; }");
    bool shown;
    const karst_world_config bad = {.world = path};
    assert_false(karst_engine_show_colours(engine, &bad, &shown, &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    assert_int_equal(settle(engine, taped), 0);
    assert_memory_equal(taped, fresh, NUM_BYTES);
    karst_engine_destroy(engine);

    /* In the middle of it all: as much is made as by an engine that had these colours from the start. */
    write_world(BALL("vec3(0.2, red, 0.1)", "d"));
    engine = open_engine(false);
    karst_stats stats;
    uint64_t num_all = 0;
    assert_true(karst_engine_prepare_colours(engine, &error));
    for (int frame = 0; frame < 4; frame++) {
        if (frame == 2) {
            write_world(BALL(NOISY, "d"));
            assert_true(show_colours(engine));
        }
        assert_true(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &stats);
        num_all += stats.num_produced;
    }
    const karst_world_config config = {.world = path};
    karst_prepared_world *world = karst_engine_prepare_world(engine, &config, &error);
    assert_true(world && karst_engine_change_world(engine, world, &kept, &error));
    assert_true(kept);
    num_all += settle(engine, taped);
    assert_int_equal(num_all, num_made);
    assert_memory_equal(taped, compiled, NUM_BYTES);
    karst_engine_destroy(engine);
}

int main(void)
{
    int file = mkstemps(path, 6);
    if (file < 0)
        return 1;
    close(file);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_colours_at_once),
        cmocka_unit_test(test_parameters),
        cmocka_unit_test(test_bad_parameters_change_nothing),
        cmocka_unit_test(test_texts),
        cmocka_unit_test(test_voxel),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    return failed;
}
