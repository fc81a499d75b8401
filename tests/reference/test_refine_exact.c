/* Refined hits are nowhere farther from the truth than those of bricks: in every pixel of worlds of flat pieces and of
 * folds, where kinks lie at all distances from hits, and many hits are exact. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "karst/karst.h"
#include "karst/view.h"

enum { WIDTH = 80, HEIGHT = 60, NUM_PIXELS = WIDTH * HEIGHT };

/* In footprints: what floats along a ray and the reference's own intervals leave. */
#define WITHIN 1e-3
/* Where the first matter is thinner than samples are apart, refined hits may go on from what lies behind it. */
#define WITHIN_COARSE 0.125

static const struct {
    const char *name, *camera, *text;
} worlds[] = {
    {"menger", "\"-2\", \"14.2\", \"-6.3\"], \"yaw\": -90, \"pitch\": 0",
     "float density(vec3 p) { vec3 q = p / 27.0; float d = max(abs(q.x), max(abs(q.y), abs(q.z))) - 1.0, s = 1.0;\n"
     "  for (int m = 0; m < 3; m++) { vec3 a = mod(q * s, 2.0) - 1.0; s *= 3.0; vec3 r = abs(1.0 - 3.0 * abs(a));\n"
     "    d = max(d, (min(max(r.x, r.y), min(max(r.y, r.z), max(r.z, r.x))) - 1.0) / s); }\n"
     "  return -d * 27.0; }\n"},
    {"menger from afar", "\"-60\", \"40\", \"-50\"], \"yaw\": 50, \"pitch\": -25",
     "float density(vec3 p) { vec3 q = p / 27.0; float d = max(abs(q.x), max(abs(q.y), abs(q.z))) - 1.0, s = 1.0;\n"
     "  for (int m = 0; m < 3; m++) { vec3 a = mod(q * s, 2.0) - 1.0; s *= 3.0; vec3 r = abs(1.0 - 3.0 * abs(a));\n"
     "    d = max(d, (min(max(r.x, r.y), min(max(r.y, r.z), max(r.z, r.x))) - 1.0) / s); }\n"
     "  return -d * 27.0; }\n"},
    {"boxes", "\"0\", \"14\", \"0\"], \"yaw\": 20, \"pitch\": -25",
     "float density(vec3 p) { vec3 q = abs(mod(p, 16.0) - 8.0) - vec3(5.0, 3.0, 5.0);\n"
     "  return max(-max(q.x, max(q.y, q.z)), -0.2 - p.y); }\n"},
    {"octahedra", "\"0\", \"9\", \"0\"], \"yaw\": 33, \"pitch\": -20",
     "float density(vec3 p) { vec3 q = abs(mod(p + 8.0, 16.0) - 8.0); return 5.0 - q.x - q.y - q.z; }\n"},
    {"pyramids", "\"3\", \"20\", \"1\"], \"yaw\": 70, \"pitch\": -30",
     "float density(vec3 p) { vec2 q = abs(mod(p.xz, 20.0) - 10.0); return 10.0 - max(q.x, q.y) - p.y; }\n"},
    {"roofs", "\"0\", \"18\", \"0\"], \"yaw\": 25, \"pitch\": -22",
     "float density(vec3 p) { float a = abs(mod(p.x, 14.0) - 7.0), b = abs(mod(p.z, 22.0) - 11.0);\n"
     "  return max(min(9.0 - a, 12.0 - b) - p.y, 1.0 - p.y); }\n"},
    {"slopes", "\"0\", \"45\", \"0\"], \"yaw\": 120, \"pitch\": -25",
     "float density(vec3 p) { float h = 0.0; for (int i = 0; i < 4; i++) { float s = exp2(-float(i));\n"
     "  h += s * abs(fract((p.x * 0.8 + p.z * 0.6) / (s * 40.0)) - 0.5) * 20.0;\n"
     "  h += s * abs(fract((p.z * 0.8 - p.x * 0.6) / (s * 31.0)) - 0.5) * 20.0; } return h - p.y; }\n"},
    {"stairs", "\"0\", \"20\", \"0\"], \"yaw\": 40, \"pitch\": -30",
     "float density(vec3 p) { float u = p.x * 0.6 + p.z * 0.8, s = floor(u / 4.0) * 4.0;\n"
     "  return s * 0.25 + clamp((u - s - 3.0) * 1.0, 0.0, 1.0) - p.y * 1.0; }\n"},
    {"cross", "\"-20\", \"8\", \"-14\"], \"yaw\": 55, \"pitch\": -10",
     "float density(vec3 p) { vec3 q = abs(p); return 2.0 - min(max(q.x, q.y), min(max(q.y, q.z), max(q.z, q.x)))\n"
     "  + min(0.0, 9.0 - max(q.x, max(q.y, q.z))); }\n"},
    {"sierpinski", "\"-7\", \"8\", \"-9\"], \"yaw\": 38, \"pitch\": -28",
     "float density(vec3 p) { vec3 z = p / 8.0; float s = 1.0; for (int n = 0; n < 5; n++) {\n"
     "    if (z.x + z.y < 0.0) z.xy = -z.yx; if (z.x + z.z < 0.0) z.xz = -z.zx; if (z.y + z.z < 0.0) z.zy = -z.yz;\n"
     "    z = z * 2.0 - 1.0; s *= 2.0; }\n"
     "  return (1.0 - max(max(-z.x - z.y - z.z, z.x + z.y - z.z), max(-z.x + z.y + z.z, z.x - z.y + z.z))) / s * 4.0; "
     "}\n"},
    {"cantor", "\"-30\", \"22\", \"-34\"], \"yaw\": 42, \"pitch\": -22",
     "float density(vec3 p) { vec3 q = abs(p) / 24.0; float s = 24.0; for (int i = 0; i < 3; i++) {\n"
     "    q = abs(q * 3.0 - 2.0); s /= 3.0; } return (1.0 - max(q.x, max(q.y, q.z))) * s; }\n"},
    {"bricks", "\"0\", \"5\", \"-14\"], \"yaw\": 10, \"pitch\": -8",
     "float density(vec3 p) { float row = floor(p.y / 1.5); vec2 q = vec2(mod(p.x + row * 1.5, 3.0) - 1.5,\n"
     "    mod(p.y, 1.5) - 0.75); float b = max(abs(q.x) - 1.4, abs(q.y) - 0.65); return -p.z * -1.0 * 1.0 - max(0.0,\n"
     "    min(0.2, b * 2.0)); }\n"},
    {"columns", "\"0\", \"6\", \"0\"], \"yaw\": 31, \"pitch\": -9",
     "float density(vec3 p) { vec2 q = abs(mod(p.xz, 9.0) - 4.5); float c = 1.2 - max(q.x + 0.5 * q.y, q.y + 0.3 * "
     "q.x);\n"
     "  return max(min(c, 8.0 - p.y), -p.y); }\n"},
    {"facets", "\"0\", \"4\", \"-22\"], \"yaw\": 0, \"pitch\": -10",
     "float density(vec3 p) { float d = 1e9; for (int i = 0; i < 8; i++) { float a = float(i) * 0.785398;\n"
     "    d = min(d, 8.0 - p.x * cos(a) - p.z * sin(a) - 0.5 * abs(p.y)); } return d; }\n"},
    {"slabs", "\"0\", \"13\", \"0\"], \"yaw\": 64, \"pitch\": -35",
     "float density(vec3 p) { float a = 0.5 - abs(mod(p.x + 0.3 * p.y, 6.0) - 3.0), b = 0.5 - abs(mod(p.z, 7.0) - "
     "3.5);\n"
     "  return max(max(min(a, 4.0 - p.y), min(b, 2.0 - p.y)), -p.y); }\n"},
    {"carved", "\"-24\", \"18\", \"-24\"], \"yaw\": 45, \"pitch\": -26",
     "float density(vec3 p) { vec3 q = abs(p); float box = 10.0 - max(q.x, max(q.y, q.z));\n"
     "  vec3 r = abs(mod(p, 5.0) - 2.5); return min(box, max(r.x, max(r.y, r.z)) - 1.5); }\n"},
    {"tents of noise", "\"0\", \"16\", \"0\"], \"yaw\": 140, \"pitch\": -20",
     "float density(vec3 p) { float h = abs(fract(noise(p.xz / 19.0) * 3.0) - 0.5) * 8.0; return h - p.y + 0.0; }\n"},
    {"plane", "\"0\", \"7\", \"0\"], \"yaw\": 10, \"pitch\": -30", "float density(vec3 p) { return -p.y; }\n"},
    {"folded plane", "\"0\", \"9\", \"0\"], \"yaw\": 10, \"pitch\": -30",
     "float density(vec3 p) { return -max(p.y, p.y * 0.5 + abs(p.x) * 0.25 - 2.0); }\n"},
    {"terraced pyramids", "\"0\", \"20\", \"0\"], \"yaw\": 40, \"pitch\": -30",
     "float density(vec3 p) { vec2 q = abs(mod(p.xz + 3.0, 26.0) - 13.0); float r = 13.0 - max(q.x, q.y);\n"
     "  return floor(r / 3.0) * 2.0 + clamp(mod(r, 3.0) * 4.0 - 10.0, 0.0, 2.0) - p.y; }\n"},
    {"round terraces", "\"0\", \"14\", \"0\"], \"yaw\": 15, \"pitch\": -25",
     "float density(vec3 p) { float r = length(mod(p.xz, 40.0) - 20.0) / 4.0;\n"
     "  return 6.0 - floor(r) - clamp(fract(r) * 4.0 - 3.0, 0.0, 1.0) - p.y; }\n"},
    {"terraces of noise", "\"0\", \"16\", \"0\"], \"yaw\": 75, \"pitch\": -20",
     "float density(vec3 p) { float r = p.x / 3.0 + 2.0 * noise(p.xz / 23.0);\n"
     "  return 0.8 * (floor(r) + clamp(fract(r) * 6.0 - 5.0, 0.0, 1.0) - p.x / 3.0) - p.y; }\n"},
};

/* Worlds with matter that stands between samples, and is missed, where footprints are wider. */
static const struct {
    const char *name;
    double footprint_m;
} fine[] = {{"terraces of noise", 1.5}};

static double widest_footprint_m(const char *name)
{
    for (size_t i = 0; i < sizeof fine / sizeof *fine; i++)
        if (strcmp(fine[i].name, name) == 0)
            return fine[i].footprint_m;
    return INFINITY;
}

static char world_path[64];
static karst_reference_hit expected[NUM_PIXELS];
static float plain_m[NUM_PIXELS], refined_m[NUM_PIXELS], normals[NUM_PIXELS * 3];

static void write_world(size_t i)
{
    snprintf(world_path, sizeof world_path, "/tmp/karst-never-%d.karst", (int)getpid());
    FILE *file = fopen(world_path, "w");
    assert_non_null(file);
    fprintf(file, "/*{ \"voxel\": 0.0625, \"view\": 400, \"camera\": { \"position\": [%s } }*/\n%s", worlds[i].camera,
            worlds[i].text);
    assert_int_equal(fclose(file), 0);
}

static void draw(bool refine, float *depth_m)
{
    karst_error error = {0};
    bool settled = false;
    const karst_engine_config config = {.world = world_path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)128 << 20,
                                        .no_shadows = true,
                                        .refine = refine};
    karst_engine *engine = karst_engine_create(&config, &error);
    if (!engine || !karst_engine_settle(engine, 400, NULL, NULL, &settled, &error) || !settled ||
        !karst_engine_read_depth(engine, depth_m, NUM_PIXELS, &error) ||
        !karst_engine_read_normals(engine, normals, NUM_PIXELS * 3, &error))
        fail_msg("%s: %s", world_path, error.message);
    karst_engine_destroy(engine);
}

static size_t num_worse(size_t i)
{
    karst_error error = {0};
    write_world(i);
    const karst_reference_config config = {
        .world = world_path, .width_px = WIDTH, .height_px = HEIGHT, .footprint = KARST_FOOTPRINT_BLENDED};
    if (!karst_reference_trace(&config, expected, NULL, NULL, NULL, &error))
        fail_msg("%s: %s", worlds[i].name, error.message);
    draw(false, plain_m);
    draw(true, refined_m);
    size_t hits = 0, worse = 0, better = 0;
    double most = 0;
    const double widest_m = widest_footprint_m(worlds[i].name);
    for (int k = 0; k < NUM_PIXELS; k++) {
        if (expected[k].kind != KARST_REFERENCE_SURFACE || isinf(plain_m[k]))
            continue;
        double plain = fabs((double)plain_m[k] - expected[k].t_m) / expected[k].footprint_m;
        double refined = fabs((double)refined_m[k] - expected[k].t_m) / expected[k].footprint_m;
        if (plain >= 1)
            continue; /* samples missed what the ray meets: another surface */
        hits++;
        worse += refined > plain + (expected[k].footprint_m > widest_m ? WITHIN_COARSE : WITHIN);
        better += refined < plain - WITHIN;
        most = fmax(most, refined - plain);
    }
    print_message("%-18s %zu hits: %zu better by refining, %zu worse, at most by %.3g footprints\n", worlds[i].name,
                  hits, better, worse, most);
    assert_true(hits > NUM_PIXELS / 16);
    unlink(world_path);
    return worse;
}

/* REFINE_ONLY: those whose name holds this. All, if in full; else some, since each compiles its kernels. */
static void test_never_worse(void **state)
{
    static const char *const some[] = {"menger", "stairs", "round terraces", "terraces of noise", "sierpinski"};
    const size_t num_some = getenv("KARST_TEST_QUICK") ? 1 : sizeof some / sizeof *some;
    const char *only = getenv("REFINE_ONLY");
    size_t worse = 0;
    (void)state;
    for (size_t i = 0; i < sizeof worlds / sizeof *worlds; i++) {
        bool is_wanted = getenv("KARST_TEST_FULL") && !only;
        for (size_t k = 0; k < num_some && !only; k++)
            is_wanted |= !strcmp(worlds[i].name, some[k]);
        if (is_wanted || (only && strstr(worlds[i].name, only)))
            worse += num_worse(i);
    }
    assert_int_equal(worse, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_never_worse)};
    return cmocka_run_group_tests_name("refined hits are no worse", tests, NULL, NULL);
}
