/* Clear matter whose index of refraction varies, in pictures: where rays leave it, against closed forms; that a core of
 * index 1 is a hollow; that nothing is lost or added; and what is no index. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/scene.h"

enum { WIDTH = 32, HEIGHT = 32, NUM = WIDTH * HEIGHT };

/* One world for all, since compiling is what takes time here; its parameters say which. As in test_clear.c: a wall
 * whose light says where it was seen; or a shell of land all around that gives off as much light everywhere. With a
 * radius beyond 2 a cube on the ground, which goes on in that by what is beyond 3. */
static const char text[] =
    "/*{ \"voxel\": 0.00390625, \"view\": 60, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 30 },\n"
    "\"params\": { \"kind\": { \"value\": 0, \"min\": 0, \"max\": 9 },\n"
    "\"shell\": { \"value\": 0, \"min\": 0, \"max\": 1 }, \"hollow\": { \"value\": 0, \"min\": 0, \"max\": 1 },\n"
    "\"radius\": { \"value\": 1, \"min\": 0, \"max\": 9 }, \"rise\": { \"value\": 0.4, \"min\": 0, \"max\": 1 },\n"
    "\"repeats\": { \"value\": 0, \"min\": 0, \"max\": 1 },\n"
    "\"root\": { \"value\": 3, \"min\": -1, \"max\": 3 } } }*/\n"
    "float density(vec3 p) { float z = mod(p.z + 8.0, 16.0) - 15.0, wall = z > 0.0 ? z : -1.0;\n"
    "    return shell > 0.5 ? length(p) - 20.0 : (repeats > 0.5 ? wall : radius > 2.0 ? max(p.z - 8.0, -1.0 - p.y) :\n"
    "        p.z - 8.0); }\n"
    "vec3 cell(vec3 p) { return repeats > 0.5 ? mod(p + 8.0, 16.0) - 8.0 : p; }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); vec3 q = cell(p);\n"
    "    m.emission = shell > 0.5 ? vec3(0.5) : 1000.0 * vec3(q.x + 30.0, q.y + 30.0, 30.0); return m; }\n"
    "float clear(vec3 p) { float r = length(cell(p));\n"
    "    return hollow > 0.5 ? min(1.0 - r, r - 0.5) : radius > 2.0 ? min(1.0 - max(abs(p.x), abs(p.z)),\n"
    "        min(1.0 - p.y, p.y + radius - 2.0)) : radius - r; }\n"
    "float index(vec3 p) { vec3 q = cell(p); float s = dot(q, q);\n"
    "    float n = kind < 0.5 ? sqrt(max(2.0 - s, 0.0)) : kind < 1.5 ? 1.2 + rise * exp(-2.0 * s) :\n"
    "        kind < 2.5 ? (s < 0.25 ? 1.0 : 1.5) : kind < 3.5 ? 1.5 : kind < 4.5 ? 1.4 + 0.02 * q.y :\n"
    "        kind < 5.5 ? (q.x < 0.1 ? 1.0 : 0.2) : (q.x < 0.1 ? 1.0 : sqrt(root - s));\n"
    "    return n; }\n";
enum { LUNEBURG, BUMP, CORE, GLASS, TILTED, LOW, NO_NUMBER };
#define WALL_Z 8.0L
#define EYE_Z (-4.0L)

typedef struct {
    int width, height;
    float *light;
    karst_stats stats;
} picture;

static karst_engine *create(const karst_engine_config *like, int width, int height)
{
    return scene_create(text, like, width, height, NULL);
}

static void settle(karst_engine *engine, picture *p, int width, int height)
{
    const size_t num = 3 * (size_t)width * (size_t)height;
    p->light = realloc(p->light, num * sizeof *p->light);
    p->width = width, p->height = height;
    scene_settle(engine, 600, p->light, num, &p->stats);
}

typedef struct {
    double kind, shell, hollow, radius, rise, repeats;
} scene;
/* Only where the index is to be no number is it a root of less than 0: bounds know nothing of one that may be. */
#define ROOT_OF(kind) ((kind) == NO_NUMBER ? -1 : 3)

static void show(karst_engine *engine, const scene *of)
{
    const karst_parameter parameters[] = {{"kind", of->kind},     {"shell", of->shell},
                                          {"hollow", of->hollow}, {"radius", of->radius ? of->radius : 1},
                                          {"rise", of->rise},     {"repeats", of->repeats},
                                          {"root", ROOT_OF(of->kind)}};
    assert_ok(karst_engine_set_parameters(engine, parameters, sizeof parameters / sizeof *parameters, &error));
}

static void take(karst_engine *engine, scene of, picture *p)
{
    show(engine, &of);
    settle(engine, p, WIDTH, HEIGHT);
}

static picture one, other;

static void assert_same(const picture *a, const picture *b)
{
    assert_memory_equal(a->light, b->light, 3 * (size_t)a->width * (size_t)a->height * sizeof *a->light);
}

/* ---- where rays leave ---- */

typedef struct {
    long double x, y, z;
} vec;

/* A ray that enters Luneburg's lens at p in the direction d leaves it at d in the direction -p. */
static long double luneburgs_error(const picture *p, int *num)
{
    const long double half = tanl(15 * 3.14159265358979323846264338327950288L / 180);
    long double worst = 0;
    *num = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            vec d = {((x + 0.5L) * 2 / WIDTH - 1) * half, (1 - (y + 0.5L) * 2 / HEIGHT) * half, 1};
            const long double length = sqrtl(d.x * d.x + d.y * d.y + 1);
            d = (vec){d.x / length, d.y / length, d.z / length};
            const long double b = EYE_Z * d.z, square = b * b - EYE_Z * EYE_Z + 1;
            if (square <= 0.02L)
                continue;
            const long double t = -b - sqrtl(square);
            const vec at = {d.x * t, d.y * t, EYE_Z + d.z * t}, out = {-at.x, -at.y, -at.z};
            const long double far = (WALL_Z - d.z) / out.z;
            const vec wall = {d.x + out.x * far, d.y + out.y * far, WALL_Z};
            const float *light = p->light + 3 * (y * WIDTH + x);
            const long double weight = (long double)light[2] / 30000;
            if (out.z < 0.3L)
                continue;
            assert_true(fabsl(weight - 1) < 1e-3L);
            const vec apart = {(long double)light[0] / weight / 1000 - 30 - wall.x,
                               (long double)light[1] / weight / 1000 - 30 - wall.y, 0};
            const long double along = apart.x * out.x + apart.y * out.y;
            const long double off = sqrtl(apart.x * apart.x + apart.y * apart.y - along * along) / far;
            worst = off > worst ? off : worst;
            (*num)++;
        }
    return worst;
}

static void luneburgs_lens_shows_what_it_should(void **state)
{
    int num;
    take(*state, (scene){.kind = LUNEBURG}, &one);
    const long double worst = luneburgs_error(&one, &num);
    print_message("%d rays, off by %.2Lg rad at most, %d cut off\n", num, worst, (int)one.stats.num_rays_cut);
    assert_true(num > 500);
    assert_true(worst < 1e-4L);
    if (!getenv("KARST_TEST_FULL"))
        return;
    const karst_engine_config config = {.refine = true};
    karst_engine *fine = create(&config, WIDTH, HEIGHT);
    take(fine, (scene){.kind = LUNEBURG}, &one);
    karst_engine_destroy(fine);
    const long double refined = luneburgs_error(&one, &num);
    print_message("refined: off by %.2Lg rad at most\n", refined);
    assert_true(refined < 1e-5L);
}

/* ---- jumps ---- */

/* A ball of glass with a hollow core, and one whose core has the index 1: test_hollow.c has more of it. */
static void a_core_of_one_is_a_hollow(void **state)
{
    const int width = 48, height = 48;
    int num_off = 0;
    assert_ok(karst_engine_set_size(*state, width, height, &error));
    show(*state, &(scene){.kind = GLASS, .hollow = 1});
    settle(*state, &one, width, height);
    show(*state, &(scene){.kind = CORE});
    settle(*state, &other, width, height);
    assert_ok(karst_engine_set_size(*state, WIDTH, HEIGHT, &error));
    for (int k = 0; k < width * height; k++) {
        /* as shares of the wall's light */
        float off = 0;
        for (int c = 0; c < 3; c++)
            off = fmaxf(off, fabsf(one.light[3 * k + c] - other.light[3 * k + c]) / 30000);
        num_off += off > 1.0f / 255;
    }
    print_message("%dx%d: %d pixels differ, cut off %d and %d\n", width, height, num_off, (int)one.stats.num_rays_cut,
                  (int)other.stats.num_rays_cut);
    assert_int_equal(num_off, 0);
}

/* ---- energy ---- */

static void nothing_is_lost_or_added(void **state)
{
    static const scene furnaces[] = {
        {.kind = BUMP, .shell = 1, .rise = 0.4},
        {.kind = CORE, .shell = 1},
        {.kind = TILTED, .shell = 1, .radius = 6}, /* the eye is in it */
    };
    for (size_t i = 0; i < sizeof furnaces / sizeof *furnaces; i++) {
        int num_off = 0;
        take(*state, furnaces[i], &one);
        for (int k = 0; k < 3 * NUM; k++)
            num_off += fabsf(one.light[k] / 0.5f - 1) > 1.0f / 255;
        print_message("furnace %zu: %d values are off, %d rays, %d cut off\n", i, num_off,
                      (int)one.stats.num_rays[KARST_STREAM_CLEAR], (int)one.stats.num_rays_cut);
        assert_true(one.stats.num_rays[KARST_STREAM_CLEAR] > 200);
        assert_int_equal(num_off, 0);
    }
}

/* An eye in a field of index, at pools of any size: a shell that is as bright everywhere shows every hole. */
static void an_eye_in_a_field_sees_no_holes_in_pools_of_any_size(void **state)
{
    const scene inside = {.kind = TILTED, .shell = 1, .radius = 6};
    take(*state, inside, &one);
    const uint32_t land = (uint32_t)one.stats.bricks.num_used, clear = (uint32_t)one.stats.stores[0].bricks.num_used,
                   all = land > 2 * clear ? land : 2 * clear;
    static const uint32_t percents[] = {100, 50, 25, 10};
    for (int i = 0; i < 4; i++) {
        const karst_engine_config small = {.bounces = 64,
                                           .num_bricks = 34 + all * percents[i] / 100,
                                           .num_tiles = 48 + (uint32_t)one.stats.tiles.num_used * percents[i] / 100};
        karst_engine *engine = create(&small, WIDTH, HEIGHT);
        take(engine, inside, &other);
        karst_engine_destroy(engine);
        int num_off = 0;
        for (int k = 0; k < 3 * NUM; k++)
            num_off += fabsf(other.light[k] / 0.5f - 1) > 1.0f / 255;
        print_message("%u %%: %d values are off, %.2f px\n", percents[i], num_off, other.stats.detail_given_px);
        assert_int_equal(num_off, 0);
    }
}

/* ---- the same everywhere ---- */

static void look_from(karst_engine *engine, const char *x, double yaw)
{
    karst_camera camera = karst_engine_default_camera(engine);
    const int voxel_log2_m = karst_engine_voxel_log2_m(engine);
    assert_ok(karst_position_parse(x, "0", "-4", voxel_log2_m, &camera.position, &error));
    camera.yaw_deg = yaw;
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
}

static void pictures_depend_on_the_view_alone(void **state)
{
    const scene many = {.kind = BUMP, .rise = 0.4, .repeats = 1};
    take(*state, many, &one);
    assert_true(one.stats.num_rays[KARST_STREAM_CLEAR] > 200);
    look_from(*state, "1000000000000", 60);
    settle(*state, &other, WIDTH, HEIGHT);
    look_from(*state, "1000000000000", 0);
    settle(*state, &other, WIDTH, HEIGHT);
    assert_same(&one, &other);
    look_from(*state, "0", 0);
    settle(*state, &other, WIDTH, HEIGHT);
    assert_same(&one, &other);
    if (!getenv("KARST_TEST_FULL")) /* all kernels once more */
        return;
    const karst_engine_config config = {.bounces = 64, .lanes = 1};
    karst_engine *narrow = create(&config, WIDTH, HEIGHT);
    take(narrow, many, &other);
    karst_engine_destroy(narrow);
    assert_same(&one, &other);
}

/* As in test_clear.c. */
static void what_touches_is_seen_through_clear_matter(void **state)
{
    int num_off = 0;
    take(*state, (scene){.kind = TILTED, .radius = 3}, &one);
    take(*state, (scene){.kind = TILTED, .radius = 3.25}, &other);
    for (int k = 0; k < 3 * NUM; k++)
        num_off += fabsf(one.light[k] - other.light[k]) > 0.02f * other.light[k];
    print_message("on the ground: %d values are not as those of a cube that goes on in it\n", num_off);
    assert_true(num_off <= 3 * NUM / 100); /* its edges */
}

/* A parameter of the index moves what is seen. */
static void parameters_reach_the_index(void **state)
{
    int num = 0;
    take(*state, (scene){.kind = BUMP, .rise = 0.1}, &one);
    take(*state, (scene){.kind = BUMP, .rise = 0.5}, &other);
    for (int k = 0; k < NUM; k++)
        num += fabsf(one.light[3 * k] - other.light[3 * k]) > 10;
    assert_true(num > 150);
    take(*state, (scene){.kind = BUMP, .rise = 0.1}, &other);
    assert_same(&one, &other);
}

/* ---- what is no index ---- */

static int num_warnings;
static char warning[512];

static void hear(void *user, karst_log_level level, const char *message)
{
    (void)user;
    if (level == KARST_LOG_WARNING && strstr(message, "index of refraction")) {
        num_warnings++;
        snprintf(warning, sizeof warning, "%s", message);
    }
}

static void what_is_no_index_is_taken_as_one(void **state)
{
    const int column = WIDTH * 17 / 24;
    const long double half = tanl(15 * 3.14159265358979323846264338327950288L / 180);
    const long double x_wall = ((column + 0.5L) * 2 / WIDTH - 1) * half * (WALL_Z - EYE_Z);
    assert_int_equal(num_warnings, 0); /* of all that was shown before */
    for (int kind = LOW; kind <= NO_NUMBER; kind++) {
        take(*state, (scene){.kind = kind}, &one);
        /* The wall is seen straight. */
        for (int k = 0; k < NUM; k++)
            assert_true(fabsf(one.light[3 * k + 2] / 30000 - 1) < 1e-3f);
        const float *light = one.light + 3 * (HEIGHT / 2 * WIDTH + column);
        assert_true(fabsl((long double)light[0] / 1000 - 30 - x_wall) < 2e-3L);
    }
    print_message("%s\n", warning);
    assert_int_equal(num_warnings, 1);
    const char *place = strstr(warning, "first at ");
    double x = 0, y = 0, z = 0;
    assert_true(place && sscanf(place, "first at %lf,%lf,%lf", &x, &y, &z) == 3);
    assert_true(x > 0.09 && x * x + y * y + z * z < 1.01);
}

static int open_engine(void **state)
{
    static const karst_log log = {.write = hear, .max_level = KARST_LOG_WARNING};
    const karst_engine_config config = {.bounces = 64, .log = &log};
    *state = create(&config, WIDTH, HEIGHT);
    return 0;
}

static int close_engine(void **state)
{
    karst_engine_destroy(*state);
    free(one.light);
    free(other.light);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(luneburgs_lens_shows_what_it_should), cmocka_unit_test(a_core_of_one_is_a_hollow),
        cmocka_unit_test(nothing_is_lost_or_added),            cmocka_unit_test(pictures_depend_on_the_view_alone),
        cmocka_unit_test(an_eye_in_a_field_sees_no_holes_in_pools_of_any_size),
        cmocka_unit_test(what_touches_is_seen_through_clear_matter),
        cmocka_unit_test(parameters_reach_the_index),          cmocka_unit_test(what_is_no_index_is_taken_as_one),
    };
    return cmocka_run_group_tests_name("an index that varies", tests, open_engine, close_engine);
}
