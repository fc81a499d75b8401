/* Full light through clear matter: nothing is lost or added, lamps are found through it as brightly as without, and
 * what a slab of glass lets through is what its closed form says. */
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

typedef struct {
    float light[3 * NUM];
    karst_stats stats;
} picture;
static picture one, other;

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    karst_engine_config config = *like;
    config.integrator = KARST_INTEGRATOR_FULL;
    return scene_create(text, &config, WIDTH, HEIGHT, NULL);
}

static void settle(karst_engine *engine, picture *p)
{
    scene_settle(engine, 2000, p->light, 3 * NUM, &p->stats);
}

static double mean_of(const float light[3 * NUM]) { return scene_mean(light, 3 * NUM); }

/* ---- energy ---- */

/* In a shell that gives off as much light everywhere: a ball, a hollow one, a cube that is turned, a ring, all around
 * the eye; a ball of which the half mirrors, in glass; one that lets 0.4 of the light pass besides; a slab, a prism. */
static const char furnace[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"colour\": [0, 0, 0] },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"body\": { \"value\": 0, \"min\": 0, \"max\": 8 } },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 40 } }*/\n"
    "float density(vec3 p) { return max(length(p) - 20.0, body > 4.5 && body < 6.5 ? 0.6 - length(p) : -1.0); }\n"
    "material surface(vec3 p, vec3 n) { material m; float far = length(p) > 10.0 ? 1.0 : 0.0;\n"
    "    m.colour = vec3(1.0 - far); m.emission = vec3(0.5 * far); m.mirror = far > 0.5 ? 0.0 : 0.5;\n"
    "    m.transparency = body > 5.5 && far < 0.5 ? 0.4 : 0.0; return m; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }\n"
    "float clear(vec3 p) {\n"
    "    vec3 q = abs(vec3(0.8 * p.x + 0.6 * p.z, p.y, 0.8 * p.z - 0.6 * p.x));\n"
    "    float d = 1.0 - length(p);\n"
    "    if (body > 0.5) d = min(1.0 - length(p), length(p) - 0.5);\n"
    "    if (body > 1.5) d = 0.7 - max(q.x, max(q.y, q.z));\n"
    "    if (body > 2.5) d = 0.35 - length(vec2(length(p.xy) - 0.9, p.z));\n"
    "    if (body > 3.5) d = 6.0 - length(p);\n"
    "    if (body > 4.5) d = 1.0 - length(p);\n"
    "    if (body > 6.5) d = min(0.3 - abs(0.8 * p.z - 0.6 * p.y), 0.9 - max(abs(p.x), abs(0.8 * p.y + 0.6 * p.z)));\n"
    "    if (body > 7.5) d = min(0.9 - abs(p.y), 0.5 - max(p.z, 0.866 * abs(p.x) - 0.5 * p.z));\n"
    "    return d;\n"
    "}\n";
enum { NUM_FURNACES = 7, NUM_ALL_FURNACES = 9 };

/* The same of bodies whose index varies: a ball with a core of 1, R. Luneburg's lens, J. Maxwell's fish-eye, a rod. */
static const char graded_furnace[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"colour\": [0, 0, 0] },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"body\": { \"value\": 0, \"min\": 0, \"max\": 3 } },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 40 } }*/\n"
    "float density(vec3 p) { return length(p) - 20.0; }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); m.emission = vec3(0.5); return m; }\n"
    "float clear(vec3 p) { return body < 2.5 ? 1.0 - length(p) : min(0.6 - length(p.xy), 1.0 - abs(p.z)); }\n"
    "float index(vec3 p) {\n"
    "    float r2 = dot(p, p);\n"
    "    float n = r2 < 0.25 ? 1.0 : 1.5;\n"
    "    if (body > 0.5) n = sqrt(max(2.0 - r2, 1.0));\n"
    "    if (body > 1.5) n = 2.0 / (1.0 + r2);\n"
    "    if (body > 2.5) n = 1.6 * sqrt(max(1.0 - 0.81 * dot(p.xy, p.xy), 0.1));\n"
    "    return n;\n"
    "}\n";
enum { NUM_GRADED_FURNACES = 4 };

static void look_into_furnaces(const char *text, int num)
{
    const karst_engine_config config = {.bounces = KARST_ENGINE_MAX_BOUNCES};
    karst_engine *engine = create(text, &config);
    for (int i = 0; i < num; i++) {
        const karst_parameter body = {"body", i};
        int num_off = 0;
        float worst = 0;
        assert_ok(karst_engine_set_parameters(engine, &body, 1, &error));
        settle(engine, &one);
        for (int k = 0; k < 3 * NUM; k++) {
            const float off = fabsf(one.light[k] / 0.5f - 1);
            num_off += off > 1.0f / 255;
            worst = fmaxf(worst, off);
        }
        print_message("furnace %d: %d values are off, at worst by %.2g, %d rays, %d cut off\n", i, num_off,
                      (double)worst, (int)one.stats.num_rays[KARST_STREAM_CLEAR], (int)one.stats.num_rays_cut);
        assert_true(one.stats.num_rays[KARST_STREAM_CLEAR] > 200);
        assert_int_equal(num_off, 0);
    }
    karst_engine_destroy(engine);
}

static void nothing_is_lost_or_added(void **state)
{
    (void)state;
    look_into_furnaces(furnace, getenv("KARST_TEST_FULL") ? NUM_ALL_FURNACES : NUM_FURNACES);
    if (getenv("KARST_TEST_FULL")) /* all kernels once more */
        look_into_furnaces(graded_furnace, NUM_GRADED_FURNACES);
}

/* ---- lamps ---- */

/* Ground below a slab, seen from between them: no ray to a lamp passes it, so all light of lamps is found by paths that
 * meet them. */
#define GROUND(lights)                                                                                               \
    "/*{ \"voxel\": 0.03125, \"view\": 200, \"sun\": { \"colour\": [0, 0, 0] }, \"lights\": [" lights "],\n"         \
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"                                  \
    "\"params\": { \"slab\": { \"value\": 1, \"min\": 0, \"max\": 1 },\n"                                         \
    "\"ior\": { \"value\": 1, \"min\": 1, \"max\": 2 },\n" \
    "\"lost\": { \"value\": 0, \"min\": 0, \"max\": 9 } },\n"                                                        \
    "\"camera\": { \"position\": [\"0\", \"1\", \"0\"], \"pitch\": -90, \"fov\": 60 } }*/\n"                         \
    "float density(vec3 p) { return -p.y; }\nvec3 colour(vec3 p, vec3 n) { return vec3(0.25); }\n"                   \
    "float clear(vec3 p) { return slab > 0.5 ? 0.25 - abs(p.y - 2.25) : -1.0; }\n"                                   \
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = ior; m.absorption = vec3(lost); return m; }\n"

static void show(karst_engine *engine, double slab, double index, double absorption, picture *p)
{
    const karst_parameter parameters[] = {{"slab", slab}, {"ior", index}, {"lost", absorption}};
    assert_ok(karst_engine_set_parameters(engine, parameters, 3, &error));
    settle(engine, p);
}

/* A slab of index 1 is not seen: what paths find of lamps through it is what rays to them find without it. */
static void lamps_are_as_bright_through_what_is_not_seen(void **state)
{
    (void)state;
    if (!getenv("KARST_TEST_FULL")) /* three worlds to compile */
        return;
    static const struct {
        const char *name, *text;
        double tolerance;
    } lamps[] = {
        {"sun", GROUND("{ \"kind\": \"sun\", \"elevation\": 60, \"size\": 40, \"colour\": [1, 1, 1] }"), 0.02},
        {"point", GROUND("{ \"position\": [0.5, 5, 0], \"radius\": 1, \"colour\": [20, 20, 20] }"), 0.02},
        {"spot", GROUND("{ \"kind\": \"spot\", \"position\": [0, 6, 0], \"radius\": 0.5, \"angle\": 40, \"soft\": 0.5, "
                        "\"colour\": [30, 30, 30] }"), 0.04},
    };
    const karst_engine_config config = {.samples = 256};
    for (size_t i = 0; i < sizeof lamps / sizeof *lamps; i++) {
        karst_engine *engine = create(lamps[i].text, &config);
        show(engine, 0, 1, 0, &one);
        show(engine, 1, 1, 0, &other);
        karst_engine_destroy(engine);
        const double without = mean_of(one.light), with = mean_of(other.light);
        print_message("%s: %.5f without a slab, %.5f through one\n", lamps[i].name, without, with);
        assert_true(without > 0.01 && fabs(with / without - 1) < lamps[i].tolerance);
    }
}

/* ---- what a slab lets through ---- */

/* Of unpolarised light in a direction, a slab of thickness h with absorption a reflects and lets through so much, with
 * all that goes back and forth in it. */
static void slab_of(double cosine, double n, double h_m, double a, double *reflects, double *passes)
{
    const double far = sqrt(1 - (1 - cosine * cosine) / (n * n));
    const double rs = (cosine - n * far) / (cosine + n * far), rp = (n * cosine - far) / (n * cosine + far);
    const double r = (rs * rs + rp * rp) / 2, left = exp(-a * h_m / far);
    /* By chance for each surface, as paths are: polarisation is not followed. */
    *passes = (1 - r) * (1 - r) * left / (1 - r * r * left * left);
    *reflects = r + r * left * *passes;
}

/* A sun that fills a cone around the zenith, through glass; what the ground scatters comes back from it in part. */
static void a_slab_lets_through_what_it_should(void **state)
{
    (void)state;
    const double index = 1.5, h_m = 0.5, albedo = 0.25, tangent = tan(M_PI / 6);
    karst_engine_config config = {.samples = getenv("KARST_TEST_FULL") ? 512 : 64};
    karst_engine *engine =
        create(GROUND("{ \"kind\": \"sun\", \"elevation\": 90, \"size\": 60, \"colour\": [1, 1, 1] }"), &config);
    for (int i = 0; i < 2; i++) {
        const double a = i ? 0.8 : 0;
        enum { STEPS = 20000 };
        double comes = 0, back = 0;
        for (int k = 0; k < STEPS; k++) {
            /* Evenly in the squared sine, which is how light falls on the ground; of a sun, evenly on its disc. */
            const double square = (k + 0.5) / STEPS, cosine = sqrt(1 - square);
            double reflects, passes;
            slab_of(cosine, index, h_m, a, &reflects, &passes);
            back += reflects / STEPS;
            if (sqrt(square) / cosine < tangent)
                comes += passes / (tangent * tangent * cosine * cosine * cosine) / STEPS;
        }
        const double truth = albedo * comes / (1 - albedo * back);
        show(engine, 1, index, a, &one);
        print_message("absorption %g: %.5f of %.5f\n", a, mean_of(one.light), truth);
        assert_true(fabs(mean_of(one.light) / truth - 1) < 0.02);
    }
    karst_engine_destroy(engine);
}

/* ---- the same everywhere ---- */

static const char scene[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"elevation\": 50, \"azimuth\": 200 },\n"
    "\"lights\": [{ \"position\": [0, 3, -1], \"colour\": [9, 4, 1], \"radius\": 0.5 }],\n"
    "\"camera\": { \"position\": [\"0\", \"1.2\", \"-5\"], \"pitch\": -5, \"fov\": 50 } }*/\n"
    "float density(vec3 p) { return max(0.3 * sin(p.x) * sin(p.z) - p.y, 0.4 - length(p - vec3(1.2, 1.2, 0.5))); }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.7, 0.6, 0.5); m.mirror = p.y > 0.6 ? 0.4 : 0.0;\n"
    "    m.gloss = 0.3; return m; }\n"
    "float clear(vec3 p) { return max(0.25 - p.y + 0.04 * sin(3.0 * p.x), 0.8 - length(p - vec3(-0.9, 1.0, 0.0))); }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.absorption = vec3(0.6, 0.2, 0.1); return m; }\n";

static void pictures_depend_on_view_and_samples_alone(void **state)
{
    (void)state;
    karst_engine_config config = {.samples = 3};
    karst_engine *engine = create(scene, &config);
    settle(engine, &one);
    /* Frame by frame, each of which draws all anew. */
    karst_engine *by_frames = create(scene, &config);
    karst_stats stats;
    do {
        assert_ok(karst_engine_frame(by_frames, &error));
        karst_engine_stats(by_frames, &stats);
    } while (!stats.settled);
    assert_ok(karst_engine_read_radiance(by_frames, other.light, sizeof other.light / sizeof *other.light, &error));
    assert_memory_equal(one.light, other.light, sizeof one.light);
    karst_engine_destroy(by_frames);
    /* After another view, in water. */
    const karst_camera there = karst_engine_default_camera(engine);
    karst_camera away = there;
    const int voxel_log2_m = karst_engine_voxel_log2_m(engine);
    assert_ok(karst_position_parse("0.4", "0.2", "-2", voxel_log2_m, &away.position, &error));
    away.yaw_deg += 30;
    assert_ok(karst_engine_set_camera(engine, &away, &error));
    settle(engine, &other);
    assert_memory_not_equal(one.light, other.light, sizeof one.light);
    assert_ok(karst_engine_set_camera(engine, &there, &error));
    settle(engine, &other);
    assert_memory_equal(one.light, other.light, sizeof one.light);
    assert_ok(karst_engine_check(engine, &error));
    karst_engine_destroy(engine);
    if (!getenv("KARST_TEST_FULL")) /* all kernels once more */
        return;
    config.lanes = 1;
    engine = create(scene, &config);
    settle(engine, &other);
    karst_engine_destroy(engine);
    assert_memory_equal(one.light, other.light, sizeof one.light);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_lost_or_added),
        cmocka_unit_test(lamps_are_as_bright_through_what_is_not_seen),
        cmocka_unit_test(a_slab_lets_through_what_it_should),
        cmocka_unit_test(pictures_depend_on_view_and_samples_alone),
    };
    return cmocka_run_group_tests_name("full light through clear matter", tests, NULL, NULL);
}
