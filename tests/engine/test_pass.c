/* Land that lets a share of the light pass (transparency): what is seen through it, what it casts for shadows, that
 * nothing is lost or added, and that pictures depend on the view alone; in direct light and in full. */
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

/* One text for all, since compiling is what takes time here; its parameters say which. The eye looks along z.
 * WALL: it gives off light that says where it was seen, behind sheets. FURNACE: a shell of land all around, as bright
 * everywhere, and bodies in it. SUNNY: a wall in the sun, which comes from behind the eye, where the sheets are.
 * MIRROR: a mirror that shows the wall and the sheets behind the eye. LAMP: as SUNNY, by a lamp. LIT: sheets in the sun
 * before a black wall. */
enum { WALL, FURNACE, SUNNY, MIRROR, LAMP, LIT };
#define HEAD                                                                                                       \
    "/*{ \"voxel\": 0.00390625, \"view\": 60, \"sun\": { \"azimuth\": 180, \"elevation\": 0 },\n"                   \
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"                                \
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 30 },\n"                                         \
    "\"lights\": [ { \"kind\": \"point\", \"position\": [\"0\", \"0\", \"-20\"], \"colour\": [900, 800, 700] } ],\n" \
    "\"params\": { \"kind\": { \"value\": 0, \"min\": 0, \"max\": 5 },\n"                                          \
    "\"sheets\": { \"value\": 0, \"min\": 0, \"max\": 4 }, \"share\": { \"value\": 0.3, \"min\": -9, \"max\": 9 },\n" \
    "\"matter\": { \"value\": 0, \"min\": 0, \"max\": 3 } } }*/\n"                                                 \
    "float density(vec3 p) {\n"                                                                                    \
    "    float d = kind > 2.5 && kind < 3.5 ? max(p.z - 2.0, -12.0 - p.z) : p.z - 8.0;\n"                          \
    "    bool ahead = kind < 1.5 || kind > 4.5;\n"                                                                 \
    "    float near = ahead ? 1.0 : -6.0, far = ahead ? 3.0 : -8.0;\n"                                             \
    "    float ball = sheets > 1.5 ? min(1.0 - length(p), length(p) - 0.5) : 1.0 - length(p);\n"                   \
    "    if (kind > 0.5 && kind < 1.5) return max(length(p) - 20.0, ball);\n"                                      \
    "    if (sheets > 0.5) d = max(d, 0.2 - abs(p.z - near));\n"                                                   \
    "    if (sheets > 1.5) d = max(d, 0.2 - abs(p.z - far));\n"                                                    \
    "    return d;\n"                                                                                              \
    "}\n"                                                                                                          \
    "material surface(vec3 p, vec3 n) {\n"                                                                         \
    "    material m;\n"                                                                                            \
    "    m.colour = vec3(0.0);\n"                                                                                  \
    "    bool is_wall = kind > 2.5 && kind < 3.5 ? p.z < -11.0 : p.z > 7.0;\n"                                     \
    "    bool is_sheet = !is_wall && !(kind > 2.5 && kind < 3.5 && p.z > 1.0);\n"                                  \
    "    if (kind > 0.5 && kind < 1.5) m.emission = vec3(0.5);\n"                                                  \
    "    else if (is_wall && (kind < 0.5 || kind < 3.5 && kind > 2.5))\n"                                          \
    "        m.emission = 1000.0 * vec3(p.x + 30.0, p.y + 30.0, 30.0);\n"                                          \
    "    else if (kind > 4.5 ? !is_wall : is_wall) m.colour = vec3(0.5);\n"                                        \
    "    if (kind > 0.5 && kind < 1.5) m.transparency = length(p) < 2.0 ? share : 0.0;\n"                          \
    "    else if (is_sheet) m.transparency = share;\n"                                                             \
    "    else if (!is_wall) m.mirror = 1.0;\n"                                                                     \
    "    return m;\n"                                                                                              \
    "}\n"
static const char plain_text[] = HEAD;
/* matter 1: all from z 0 to 3 is clear, as bright as air, and absorbs; 2: all before 3, the eye's place too. */
static const char clear_text[] = HEAD
    "float clear(vec3 p) { return matter > 1.5 ? 3.0 - p.z : matter > 0.5 ? 1.5 - abs(p.z - 1.5) : -1.0; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.0; m.absorption = vec3(0.5); return m; }\n";

typedef struct {
    float light[3 * NUM];
    karst_stats stats;
} picture;
static picture one, other, dark;

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    return scene_create(text, like, WIDTH, HEIGHT, NULL);
}

static void settle(karst_engine *engine, picture *p)
{
    scene_settle(engine, 600, p->light, 3 * NUM, &p->stats);
}

static void take(karst_engine *engine, double kind, double sheets, double share, double matter, picture *p)
{
    const karst_parameter parameters[] = {{"kind", kind}, {"sheets", sheets}, {"share", share}, {"matter", matter}};
    const karst_sun behind = {180, 0}, below = {0, -90};
    assert_ok(karst_engine_set_parameters(engine, parameters, 4, &error));
    assert_ok(karst_engine_set_sun(engine, kind == SUNNY || kind == LIT ? &behind : &below, &error));
    settle(engine, p);
}

static double mean(const picture *p) { return scene_mean(p->light, 3 * NUM); }

/* The light of `b` is so many times that of `a`, where there is some; both without what is there behind matter that
 * lets nothing pass. */
static void assert_times(const picture *a, const picture *b, double times, double within, const char *what)
{
    int num = 0;
    double most = 0;
    for (int k = 0; k < 3 * NUM; k++) {
        const double all = (double)a->light[k] - dark.light[k], rest = (double)b->light[k] - dark.light[k];
        if (!(all > 1e-3))
            continue;
        num++;
        most = fmax(most, fabs(rest / all - times));
    }
    print_message("%s: %d values, off by %.2g of 1 at most\n", what, num, most);
    assert_true(num > NUM);
    assert_true(most < within);
}

/* A sheet takes its share once, two of them twice, straight ahead, in mirrors, and of what shines on a wall. */
static void look_through_sheets(karst_engine *engine)
{
    static const struct {
        const char *name;
        int kind;
    } cases[] = {{"seen through", WALL}, {"in the sun", SUNNY}, {"in a mirror", MIRROR}, {"by a lamp", LAMP}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        take(engine, cases[i].kind, 1, 0, 0, &dark);
        take(engine, cases[i].kind, 0, 0.3, 0, &one);
        take(engine, cases[i].kind, 1, 0.3, 0, &other);
        assert_times(&one, &other, 0.3, 1e-3, cases[i].name);
        take(engine, cases[i].kind, 2, 0.6, 0, &other);
        assert_times(&one, &other, 0.36, 1e-3, cases[i].name);
    }
}

static void sheets_take_their_share_once(void **state)
{
    look_through_sheets(*state);
    if (!getenv("KARST_TEST_FULL"))
        return;
    /* A world without clear matter. */
    const karst_engine_config config = {.bounces = 12};
    karst_engine *engine = create(plain_text, &config);
    look_through_sheets(engine);
    karst_engine_destroy(engine);
}

/* What does not pass is the surface's: in the sun a sheet has that share of its light. */
static void the_rest_is_left_for_surfaces(void **state)
{
    dark = (picture){.light = {0}};
    take(*state, LIT, 1, 0, 0, &one);
    take(*state, LIT, 1, 0.6, 0, &other);
    assert_times(&one, &other, 0.4, 1e-3, "a sheet in the sun");
}

/* A share above 1 is all, one below 0 or that is no number nothing. */
static void shares_are_kept_in_range(void **state)
{
    take(*state, WALL, 1, 0, 0, &dark);
    assert_true(mean(&dark) < 1e-6);
    take(*state, WALL, 0, 0, 0, &one);
    take(*state, WALL, 1, 7, 0, &other);
    assert_times(&one, &other, 1, 1e-3, "a share of 7");
    take(*state, WALL, 1, -2, 0, &other);
    assert_times(&one, &other, 0, 1e-6, "a share of -2");
}

/* Bodies are not seen where all directions are as bright. */
static void nothing_is_lost_or_added(void **state)
{
    for (int hollow = 1; hollow <= 2; hollow++) {
        take(*state, FURNACE, hollow, 0.4, 0, &one);
        int num_off = 0;
        for (int k = 0; k < 3 * NUM; k++)
            num_off += fabsf(one.light[k] / 0.5f - 1) > 1.0f / 255;
        print_message("a %s ball: %d values are off, %d rays\n", hollow > 1 ? "hollow" : "whole", num_off,
                      (int)one.stats.num_rays[KARST_STREAM_CLEAR]);
        assert_int_equal(num_off, 0);
        assert_true(one.stats.num_rays[KARST_STREAM_CLEAR] > 100);
    }
}

static void look(karst_engine *engine, double yaw_deg)
{
    karst_camera camera = karst_engine_default_camera(engine);
    camera.yaw_deg = yaw_deg;
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
}

static void pictures_depend_on_the_view_alone(void **state)
{
    take(*state, WALL, 2, 0.6, 0, &one);
    look(*state, 25);
    settle(*state, &other);
    look(*state, 0);
    settle(*state, &other);
    assert_memory_equal(one.light, other.light, sizeof one.light);
    if (!getenv("KARST_TEST_FULL")) /* all kernels once more */
        return;
    const karst_engine_config config = {.bounces = 12, .lanes = 1};
    karst_engine *narrow = create(clear_text, &config);
    static const int kinds[] = {WALL, SUNNY, MIRROR, LAMP, LIT, FURNACE};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        for (int matter = 0; matter <= (kinds[i] == WALL ? 2 : 0); matter++) {
            take(*state, kinds[i], 2, 0.6, matter, &one);
            take(narrow, kinds[i], 2, 0.6, matter, &other);
            assert_memory_equal(one.light, other.light, sizeof one.light);
        }
    karst_engine_destroy(narrow);
}

/* Fewer bounces cut rays off, and say how many; without secondary rays all is opaque. */
static void what_is_cut_off_is_counted(void **state)
{
    take(*state, WALL, 2, 0.6, 0, &one);
    assert_int_equal(one.stats.num_rays_cut, 0);
    const karst_engine_config few = {.bounces = 1}, none = {.mirror = -1};
    karst_engine *engine = create(clear_text, &few);
    take(engine, WALL, 2, 0.6, 0, &other);
    assert_int_equal(other.stats.num_rays_cut, NUM);
    karst_engine_destroy(engine);
    if (!getenv("KARST_TEST_FULL"))
        return;
    engine = create(plain_text, &none);
    take(engine, WALL, 2, 0.6, 0, &other);
    assert_times(&one, &other, 0, 1e-6, "without secondary rays");
    karst_engine_destroy(engine);
}

/* Sheets in clear matter, with the eye outside and inside; what is inside a sheet absorbs nothing. */
static void clear_matter_goes_on_behind_sheets(void **state)
{
    karst_engine *engine = *state;
    take(engine, WALL, 0, 0.3, 0, &one);
    for (int matter = 1; matter <= 2; matter++) {
        take(engine, WALL, 0, 0.3, matter, &other);
        const picture empty = other;
        take(engine, WALL, 1, 0.3, matter, &other);
        /* The way in the sheet, longer where it is looked at askew. */
        double most = 0;
        for (int y = 0; y < HEIGHT; y++)
            for (int x = 0; x < WIDTH; x++) {
                const double half = tan(M_PI / 12), right = ((x + 0.5) * 2 / WIDTH - 1) * half,
                             up = ((y + 0.5) * 2 / HEIGHT - 1) * half, along = sqrt(1 + right * right + up * up);
                const int k = 3 * (y * WIDTH + x);
                most = fmax(most, fabs(other.light[k] / empty.light[k] - 0.3 * exp(0.5 * 0.4 * along)));
            }
        print_message("matter %d: off by %.2g at most\n", matter, most);
        assert_true(most < 2e-3);
    }
}

/* Full light finds the same, by chance; where all is white it is so for each path. */
static void full_light_agrees(void **state)
{
    (void)state;
    if (!getenv("KARST_TEST_FULL")) /* test_clear_paths.c has a furnace with such a body */
        return;
    const karst_engine_config config = {.integrator = KARST_INTEGRATOR_FULL, .samples = 64};
    karst_engine *engine = create(clear_text, &config);
    static const struct {
        const char *name;
        int kind;
        double matter, times, within;
    } cases[] = {{"seen through", WALL, 0, 0.36, 0.02},
                 {"in the sun", SUNNY, 0, 0.36, 1e-3},
                 {"in a mirror", MIRROR, 0, 0.36, 0.02},
                 {"by a lamp", LAMP, 0, 0.36, 2e-3},
                 {"a sheet in the sun", LIT, 0, 0.4, 2e-3}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const bool lit = cases[i].kind == LIT;
        take(engine, cases[i].kind, lit, lit ? 0 : 0.6, cases[i].matter, &one);
        take(engine, cases[i].kind, lit ? 1 : 2, 0.6, cases[i].matter, &other);
        print_message("%s: %.5f of the light in the mean, not %.5f\n", cases[i].name, mean(&other) / mean(&one),
                      cases[i].times);
        assert_true(fabs(mean(&other) / mean(&one) - cases[i].times) < cases[i].within);
    }
    take(engine, FURNACE, 2, 0.4, 0, &one);
    print_message("a hollow ball in a furnace: %.5f\n", mean(&one) / 0.5);
    assert_true(fabs(mean(&one) / 0.5 - 1) < 0.005);
    karst_engine_destroy(engine);
}

static int open_engine(void **state)
{
    const karst_engine_config config = {.bounces = 12};
    *state = create(clear_text, &config);
    return 0;
}

static int close_engine(void **state)
{
    karst_engine_destroy(*state);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sheets_take_their_share_once),       cmocka_unit_test(the_rest_is_left_for_surfaces),
        cmocka_unit_test(shares_are_kept_in_range),
        cmocka_unit_test(nothing_is_lost_or_added),           cmocka_unit_test(pictures_depend_on_the_view_alone),
        cmocka_unit_test(what_is_cut_off_is_counted),         cmocka_unit_test(clear_matter_goes_on_behind_sheets),
        cmocka_unit_test(full_light_agrees),
    };
    return cmocka_run_group_tests(tests, open_engine, close_engine);
}
