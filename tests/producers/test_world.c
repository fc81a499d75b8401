/* The public interface to worlds without a picture: opening, what they say of themselves, and samples. */
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/data.h"
#include "karst/edit.h"
#include "karst/world.h"

static karst_world *open_world(const char *name)
{
    karst_error error = {0};
    const karst_world_config config = {.world = name};
    karst_world *world = karst_world_open(&config, &error);
    if (!world)
        fail_msg("%s: %s", name, error.message);
    return world;
}

static karst_sampler *sampler_of(const karst_world *world)
{
    karst_error error = {0};
    karst_sampler *sampler = karst_sampler_create(world, &error);
    if (!sampler)
        fail_msg("%s", error.message);
    return sampler;
}

static karst_world *world_of(const char *text, const karst_parameter *parameters, size_t num_parameters)
{
    char path[] = "/tmp/karst_world_XXXXXX.karst";
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text) && close(fd) == 0);
    karst_error error = {0};
    const karst_world_config config = {.world = path, .parameters = parameters, .num_parameters = num_parameters};
    karst_world *world = karst_world_open(&config, &error);
    unlink(path);
    if (!world)
        fail_msg("%s", error.message);
    return world;
}

static karst_position at_metres(const karst_world *world, const char *x, const char *y, const char *z)
{
    karst_position at;
    karst_error error = {0};
    if (!karst_position_parse(x, y, z, karst_world_get_metadata(world)->voxel_log2_m, &at, &error))
        fail_msg("%s", error.message);
    return at;
}

static uint32_t random_state = 1;
static double random_unit(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state * 0x1p-32;
}

static const char header_world[] =
    "/*{ \"name\": \"Header\", \"author\": \"A\", \"description\": \"D\", \"seed\": 9, \"voxel\": 0.25,\n"
    "    \"extent\": 5000, \"lipschitz\": 3, \"view\": 700,\n"
    "    \"params\": { \"height\": { \"value\": 4, \"min\": 1, \"max\": 8, \"step\": 0.5, \"unit\": \"m\",\n"
    "                              \"label\": \"Height\" },\n"
    "                 \"rounds\": { \"value\": 2 }, \"idle\": { \"value\": 1 } },\n"
    "    \"camera\": { \"position\": [\"1\", \"2.5\", \"-3\"], \"yaw\": 10, \"pitch\": -5, \"fov\": 50 },\n"
    "    \"sun\": { \"azimuth\": 100, \"elevation\": 20 } }*/\n"
    "float density(vec3 p) {\n"
    "    float d = height - p.y + iTime;\n"
    "    for (int i = 0; i < int(rounds); i++) d += 0.5;\n"
    "    return d;\n"
    "}\n";

static void test_metadata(void **state)
{
    (void)state;
    const karst_parameter given = {"height", 100};
    karst_world *world = world_of(header_world, &given, 1);
    const karst_world_metadata *m = karst_world_get_metadata(world);
    assert_string_equal(m->name, "Header");
    assert_string_equal(m->author, "A");
    assert_string_equal(m->description, "D");
    assert_int_equal(m->seed, 9);
    assert_int_equal(m->voxel_log2_m, -2);
    assert_true(m->extent_m == 5000 && m->declared_lipschitz == 3 && m->view_distance_m == 700);
    assert_true(m->sun_azimuth_deg == 100 && m->sun_elevation_deg == 20);
    assert_true(m->camera.yaw_deg == 10 && m->camera.pitch_deg == -5 && m->camera.fov_deg == 50);
    assert_int_equal(m->camera.position.voxel[1], 10);
    assert_false(m->has_colour);
    assert_int_equal(m->num_parameters, 3); /* iTime is none */
    const karst_parameter_info *p = m->parameters;
    assert_string_equal(p[0].name, "height");
    assert_string_equal(p[0].label, "Height");
    assert_string_equal(p[0].unit, "m");
    assert_true(p[0].value == 8 && p[0].min == 1 && p[0].max == 8 && p[0].step == 0.5); /* clamped */
    assert_true(p[0].is_used && !p[0].is_structural);
    assert_true(p[1].is_structural && isinf(p[1].min) && isinf(p[1].max));
    assert_false(p[2].is_used);
    karst_sampler *sampler = sampler_of(world);
    karst_position at = at_metres(world, "0", "3", "0");
    assert_true(karst_sampler_density(sampler, &at, 0).device == 6.0f);
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

typedef struct {
    char text[8192];
} lines;
static void append(void *user, const char *line)
{
    lines *all = user;
    size_t length = strlen(all->text);
    snprintf(all->text + length, sizeof all->text - length, "%s\n", line);
}

static void test_check(void **state)
{
    (void)state;
    static lines report;
    karst_world *world = world_of(header_world, NULL, 0);
    assert_true(karst_world_check(world, append, &report, NULL));
    assert_non_null(strstr(report.text, "Lipschitz"));
    assert_non_null(strstr(report.text, "rounds = 2, decides the program"));
    assert_non_null(strstr(report.text, "parameter 'idle' is not used"));
    karst_world_close(world);
}

static void append_log(void *user, karst_log_level level, const char *line)
{
    (void)level;
    append(user, line);
}

static void test_bad_worlds(void **state)
{
    (void)state;
    static lines said;
    const karst_log log = {.write = append_log, .user = &said, .max_level = KARST_LOG_WARNING};
    karst_error error = {0};
    assert_null(karst_world_open(&(karst_world_config){0}, &error));
    assert_int_equal(error.status, KARST_USAGE);
    error = (karst_error){0};
    assert_null(karst_world_open(&(karst_world_config){.world = "no_such_world"}, &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    error = (karst_error){0};
    assert_null(karst_world_open(&(karst_world_config){.world = "./no_such_file"}, &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    error = (karst_error){0};
    const karst_parameter given = {"no_such_parameter", 1};
    assert_null(
        karst_world_open(&(karst_world_config){.world = "alps", .parameters = &given, .num_parameters = 1}, &error));
    assert_int_equal(error.status, KARST_BAD_WORLD);
    char path[] = "/tmp/karst_world_XXXXXX.karst";
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, "float density(vec3 p) {\n  return q;\n}\n", 38) == 38 && close(fd) == 0);
    error = (karst_error){0};
    assert_null(karst_world_open(&(karst_world_config){.world = path, .log = &log}, &error));
    unlink(path);
    assert_int_equal(error.status, KARST_BAD_WORLD);
    assert_non_null(strstr(error.message, ":2:10: "));
    assert_non_null(strstr(said.text, "return q;\n"));
}

static void test_levels(void **state)
{
    (void)state;
    karst_world *world = world_of(header_world, NULL, 0); /* voxels of 0.25 m */
    assert_int_equal(karst_world_level(world, 0), -1);
    assert_int_equal(karst_world_level(world, -1), -1);
    assert_int_equal(karst_world_level(world, (double)NAN), -1);
    assert_int_equal(karst_world_level(world, 0.2499), -1);
    assert_int_equal(karst_world_level(world, 0.25), 0);
    assert_int_equal(karst_world_level(world, 0.49), 0);
    assert_int_equal(karst_world_level(world, 0.5), 1);
    assert_int_equal(karst_world_level(world, 1024), 12);
    assert_true(karst_world_level(world, (double)INFINITY) >= 40);
    karst_world_close(world);
}

static void test_exact_positions(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"extent\": 1e18 }*/\n"
                                  "float density(vec3 p) { return fract(p.x / 3.0) + 0.25 - p.y; }",
                                  NULL, 0);
    karst_sampler *sampler = sampler_of(world);
    karst_position at = at_metres(world, "100000000000000001.5", "0", "0"); /* 10^17 = 1 mod 3 */
    karst_sample s = karst_sampler_density(sampler, &at, 0);
    assert_true(fabs(s.precise - (2.5 / 3 + 0.25)) < 1e-9);
    assert_true(fabs((double)s.device - s.precise) < 1e-6);
    karst_sample gradient[3], density;
    assert_true(karst_sampler_gradient(sampler, &at, 0, gradient, &density));
    /* Which of two sides it is of is chosen, and what is chosen from are floats. */
    assert_true(gradient[0].precise == (double)(float)(1 / 3.0) && gradient[1].precise == -1 &&
                gradient[2].precise == 0);
    assert_true(density.device == s.device && density.precise == s.precise);
    assert_true(karst_sampler_precise_density(sampler, &at, 0) == s.precise);
    karst_sample rgb[3];
    assert_false(karst_sampler_colour(sampler, &at, (const float[3]){0, 1, 0}, 0, rgb));
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

static void test_colour(void **state)
{
    (void)state;
    karst_world *world = world_of("float density(vec3 p) { return -p.y; }\n"
                                  "vec3 colour(vec3 p, vec3 n) { return vec3(p.x, n.y, 0.5); }\n",
                                  NULL, 0);
    karst_sampler *sampler = sampler_of(world);
    karst_position at = at_metres(world, "0.25", "0", "0");
    karst_sample rgb[3];
    assert_true(karst_sampler_colour(sampler, &at, (const float[3]){0, 1, 0}, 0, rgb));
    assert_true(rgb[0].device == 0.25f && rgb[1].precise == 1 && rgb[2].device == 0.5f);
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

/* Points in and on boxes around the camera, of all sizes. */
static void check_bounds(const char *name)
{
    karst_world *world = open_world(name);
    karst_sampler *sampler = sampler_of(world);
    const karst_world_metadata *m = karst_world_get_metadata(world);
    int num_known = 0, num_points = 0;
    for (int i = 0; i < 60; i++) {
        double voxel_m = ldexp(1, m->voxel_log2_m), size = voxel_m * exp2(20 * random_unit() - 6), half[3], range[2];
        double footprint_m = i % 2 ? voxel_m * (double)(1 << i % 8) : 0, away[3], offset[3];
        for (int axis = 0; axis < 3; axis++) {
            away[axis] = (random_unit() - 0.5) * 4000 * voxel_m;
            half[axis] = i % 3 ? size : size * random_unit();
        }
        karst_position centre = karst_position_add_m(m->camera.position, away, m->voxel_log2_m);
        bool known = karst_sampler_bounds(sampler, &centre, half, footprint_m, range);
        num_known += known;
        assert_true(known == (isfinite(range[0]) && isfinite(range[1])));
        for (int k = 0; k < 20; k++) {
            for (int axis = 0; axis < 3; axis++)
                offset[axis] =
                    (random_unit() > 0.5 ? 1 : -1) * (k % 2 ? half[axis] * 0.999999 : half[axis] * random_unit());
            karst_position at = karst_position_add_m(centre, offset, m->voxel_log2_m);
            double footprint = k % 3 ? footprint_m : 0;
            karst_sample s = karst_sampler_density(sampler, &at, footprint);
            num_points += isfinite(s.device);
            if (!((double)s.device >= range[0] && (double)s.device <= range[1]))
                fail_msg("%s: %g is not in [%g, %g]", name, (double)s.device, range[0], range[1]);
        }
    }
    if (num_known < 30 || num_points < 900)
        fail_msg("%s: %d of 60 boxes are bounded", name, num_known);
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

static void test_bounds(void **state)
{
    (void)state;
    char names[64][KARST_DATA_NAME_BYTES];
    size_t num_names = karst_data_list("worlds", ".karst", names, 64);
    assert_true(num_names >= 10);
    for (size_t i = 0; i < num_names; i++)
        check_bounds(names[i]);
    karst_world *world = open_world("alps");
    karst_sampler *sampler = sampler_of(world);
    karst_position at = {{0}, {0}};
    double range[2];
    assert_false(karst_sampler_bounds(sampler, &at, (const double[3]){1, (double)INFINITY, 1}, 0, range));
    assert_true(isinf(range[0]) && isinf(range[1]));
    karst_sampler_destroy(sampler);
    karst_world_close(world);
}

/* Several threads sample one world, and all find what one does. */
enum { NUM_THREADS = 4, NUM_SAMPLES = 300 };
typedef struct {
    karst_world *world;
    float values[NUM_SAMPLES][4];
} thread_work;

static void *sample_all(void *user)
{
    thread_work *work = user;
    karst_sampler *sampler = sampler_of(work->world);
    for (int i = 0; i < NUM_SAMPLES; i++) {
        karst_position at = {{i * 7919, 300 * 16 + i, -i * 104729}, {0}};
        karst_sample gradient[3], density;
        assert_true(karst_sampler_gradient(sampler, &at, 0, gradient, &density));
        work->values[i][0] = density.device;
        for (int axis = 0; axis < 3; axis++)
            work->values[i][1 + axis] = gradient[axis].device;
        karst_sample alone = karst_sampler_density(sampler, &at, 0);
        if (alone.device != density.device)
            work->values[i][0] = (float)NAN;
    }
    karst_sampler_destroy(sampler);
    return NULL;
}

static void test_threads(void **state)
{
    (void)state;
    static thread_work work[NUM_THREADS + 1];
    pthread_t threads[NUM_THREADS];
    karst_world *world = open_world("alps");
    for (int i = 0; i <= NUM_THREADS; i++)
        work[i].world = world;
    for (int i = 0; i < NUM_THREADS; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, sample_all, &work[i]), 0);
    for (int i = 0; i < NUM_THREADS; i++)
        assert_int_equal(pthread_join(threads[i], NULL), 0);
    sample_all(&work[NUM_THREADS]);
    for (int i = 0; i < NUM_THREADS; i++)
        assert_memory_equal(work[i].values, work[NUM_THREADS].values, sizeof work[i].values);
    karst_world_close(world);
}

/* Edits that come one after another, undone and redone, are those of one call. */
static void test_edits_one_after_another(void **state)
{
    (void)state;
    enum { NUM = 150 };
    static karst_edit edits[NUM];
    karst_world *world = open_world("hills");
    karst_sampler *sampler = sampler_of(world), *at_once = sampler_of(world), *plain = sampler_of(world);
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    const karst_position centre = at_metres(world, "0", "100", "0");
    assert_int_equal(karst_sampler_keep_edits(sampler, 7), 0);
    for (int i = 0; i < NUM; i++) {
        edits[i] = (karst_edit){.mode = i % 3 ? KARST_EDIT_ADD : KARST_EDIT_SMOOTH, .strength = 0.5};
        edits[i].radius_m = 5 + 20 * random_unit();
        edits[i].at = karst_position_add_m(
            centre, (double[3]){200 * random_unit(), 100 * random_unit(), 100 * random_unit()}, voxel_log2_m);
        assert_true(karst_sampler_append_edits(sampler, &edits[i], 1, NULL));
    }
    static const size_t kept[] = {NUM, 90, 120, 1, 0, 1000};
    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++) {
        const size_t num = kept[i] < NUM ? kept[i] : NUM;
        int num_changed = 0;
        assert_int_equal(karst_sampler_keep_edits(sampler, kept[i]), num);
        assert_true(karst_sampler_set_edits(at_once, edits, num, NULL));
        for (int k = 0; k < 200; k++) {
            const karst_position at = karst_position_add_m(
                centre, (double[3]){200 * random_unit(), 100 * random_unit(), 100 * random_unit()}, voxel_log2_m);
            const karst_sample a = karst_sampler_density(sampler, &at, 0), b = karst_sampler_density(at_once, &at, 0);
            assert_memory_equal(&a.device, &b.device, sizeof a.device);
            assert_memory_equal(&a.precise, &b.precise, sizeof a.precise);
            num_changed += a.device != karst_sampler_density(plain, &at, 0).device;
        }
        assert_true(num < 90 ? num_changed < 100 : num_changed > 100);
    }
    /* What was undone is gone with the next one. */
    assert_int_equal(karst_sampler_keep_edits(sampler, 10), 10);
    assert_true(karst_sampler_append_edits(sampler, &edits[0], 1, NULL));
    assert_int_equal(karst_sampler_keep_edits(sampler, 1000), 11);
    karst_sampler_destroy(sampler);
    karst_sampler_destroy(at_once);
    karst_sampler_destroy(plain);
    karst_world_close(world);
}

/* Many points at once: the bits of one by one, near and far, at any footprint, with edits and without. */
static void test_many_points(void **state)
{
    (void)state;
    enum { NUM = 700 };
    static const char *const names[] = {"hills", "alps", "lattice", "regions", "islands"};
    /* The last one is next to where voxels take more than 32 bits. */
    static const char *const far_texts[] = {"0", "1e14", "-123456789012345.678", "536870912"};
    karst_world *worlds[sizeof names / sizeof *names + 1];
    const size_t num_shipped = sizeof names / sizeof *names;
    for (size_t i = 0; i < num_shipped; i++)
        worlds[i] = open_world(names[i]);
    /* Whose text's density is 0 in air. */
    static const char flat[] = "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return max(sin(p.x) - p.y, 0.0); }\n";
    worlds[num_shipped] = world_of(flat, NULL, 0);
    for (size_t i = 0; i <= num_shipped; i++)
        for (int round = 0; round < 8; round++) {
            static karst_position at[NUM];
            static float density[NUM], of_gradient[NUM], gradient[NUM][3];
            const int voxel_log2_m = karst_world_get_metadata(worlds[i])->voxel_log2_m;
            const double footprint_m = round % 2 ? 2.5 : 0;
            karst_sampler *sampler = sampler_of(worlds[i]);
            const karst_position centre = at_metres(worlds[i], far_texts[round % 4], "20", "-5.125");
            const karst_edit edit = {
                .shape = KARST_EDIT_SPHERE, .mode = KARST_EDIT_ADD, .at = centre, .radius_m = 30, .blend_m = 2};
            assert_true(round < 4 || karst_sampler_set_edits(sampler, &edit, 1, NULL));
            for (int k = 0; k < NUM; k++)
                at[k] = karst_position_add_m(
                    centre, (double[3]){200 * random_unit() - 100, 300 * random_unit() - 150, 90 * random_unit()},
                    voxel_log2_m);
            const size_t num = round == 7 ? 1 : NUM;
            karst_sampler_densities(sampler, at, num, footprint_m, density);
            const bool has_gradient = karst_sampler_gradients(sampler, at, num, footprint_m, gradient, of_gradient);
            assert_true(has_gradient);
            for (size_t k = 0; k < num; k++) {
                karst_sample slopes[3], value = karst_sampler_density(sampler, &at[k], footprint_m);
                assert_memory_equal(&density[k], &value.device, sizeof value.device);
                assert_true(karst_sampler_gradient(sampler, &at[k], footprint_m, slopes, &value));
                assert_memory_equal(&of_gradient[k], &value.device, sizeof value.device);
                for (int axis = 0; axis < 3; axis++)
                    assert_memory_equal(&gradient[k][axis], &slopes[axis].device, sizeof(float));
            }
            karst_sampler_destroy(sampler);
        }
    for (size_t i = 0; i <= num_shipped; i++)
        karst_world_close(worlds[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_metadata),
        cmocka_unit_test(test_check),
        cmocka_unit_test(test_bad_worlds),
        cmocka_unit_test(test_levels),
        cmocka_unit_test(test_colour),
        cmocka_unit_test(test_bounds),
        cmocka_unit_test(test_exact_positions),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_edits_one_after_another),
        cmocka_unit_test(test_many_points),
    };
    return cmocka_run_group_tests_name("world", tests, NULL, NULL);
}
