/* Convex bodies that engines draw cast no shadow on themselves, whether hits are refined or not, near and far. Shadows
 * begin where matter does: a post on the ground is dark to its foot, and so is a corner. */
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

#include "karst/karst.h"
#include "tests/raycast/convex_bodies.h"

enum { WIDTH = 80, HEIGHT = 60, NUM = WIDTH * HEIGHT, APART_M = 4000 };

/* Bodies so far from one another that each is alone in its pictures, turned so that no axis is special. */
static const char bodies[] =
    "/*{ \"voxel\": 1, \"view\": 1500, \"sky\": { \"haze\": 1e9 } }*/\n"
    "float density(vec3 p) {\n"
    "    int shape = clamp(int(floor(p.x / 4000.0 + 0.5)), 0, 4);\n"
    "    p.x -= 4000.0 * float(shape);\n"
    "    vec3 r = vec3(cos(0.7) * p.x - sin(0.7) * p.z, p.y, sin(0.7) * p.x + cos(0.7) * p.z);\n"
    "    vec3 q = vec3(r.x, cos(0.45) * r.y - sin(0.45) * r.z, sin(0.45) * r.y + cos(0.45) * r.z);\n"
    "    float across = length(q.xz);\n"
    "    if (shape == 0) return 40.0 - length(q);\n"
    "    if (shape == 1) return 25.0 * (1.0 - length(q / vec3(45.0, 25.0, 33.0)));\n"
    "    if (shape == 2) return 18.0 - length(vec3(q.x, q.y - clamp(q.y, -25.0, 25.0), q.z));\n"
    "    if (shape == 3) return -max(max(abs(q.x) - 28.0, abs(q.y) - 20.0), abs(q.z) - 35.0);\n"
    "    return min((30.0 - q.y - 1.6 * across) / 1.8868, q.y + 30.0);\n"
    "}\n";

static void assert_ok(bool ok, const karst_error *error)
{
    if (!ok)
        fail_msg("%s", error->message);
}

/* A world from a text. */
static karst_engine *open_text(const char *text, bool shadows, bool refine)
{
    char path[] = "/tmp/karst-shadow-XXXXXX.karst";
    const int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    karst_error error = {0};
    const karst_engine_config config = {.world = path,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = WIDTH,
                                        .height_px = HEIGHT,
                                        .pool_bytes = (uint64_t)64 << 20,
                                        .no_shadows = !shadows,
                                        .refine = refine,
                                        .tone = KARST_TONE_OF_FILM};
    karst_engine *engine = karst_engine_create(&config, &error);
    assert_ok(engine, &error);
    unlink(path);
    return engine;
}

static void look_from(karst_engine *engine, const char *position)
{
    karst_error error = {0};
    karst_camera camera = karst_engine_default_camera(engine);
    assert_ok(karst_camera_parse(position, karst_engine_voxel_log2_m(engine), &camera, &error), &error);
    assert_ok(karst_engine_set_camera(engine, &camera, &error), &error);
}

static void settle(karst_engine *engine, const karst_sun *sun)
{
    karst_error error = {0};
    bool settled;
    assert_ok(karst_engine_set_sun(engine, sun, &error) &&
                  karst_engine_settle(engine, 400, NULL, NULL, &settled, &error),
              &error);
    assert_true(settled);
}

static void read_aov(karst_engine *engine, karst_aov aov, float *values)
{
    karst_error error = {0};
    assert_ok(karst_engine_read_aov(engine, aov, values, (size_t)NUM * (size_t)karst_aov_width(aov), &error), &error);
}

typedef struct {
    float normal[3 * NUM], position[3 * NUM], lit[3 * NUM], shadowed[3 * NUM], depth[NUM];
} picture;
static picture now;

/* Takes it by engines with and without shadows. */
static void take(karst_engine *const engines[2], const karst_sun *sun)
{
    settle(engines[0], sun);
    settle(engines[1], sun);
    read_aov(engines[0], KARST_AOV_NORMAL, now.normal);
    read_aov(engines[0], KARST_AOV_POSITION, now.position);
    read_aov(engines[0], KARST_AOV_DEPTH, now.depth);
    read_aov(engines[0], KARST_AOV_RADIANCE, now.lit);
    read_aov(engines[1], KARST_AOV_RADIANCE, now.shadowed);
}

static bool is_dark(int pixel) { return now.shadowed[3 * pixel] < 0.999f * now.lit[3 * pixel]; }

static double random_share(uint64_t *random)
{
    *random = *random * 6364136223846793005u + 1442695040888963407u;
    return (double)(*random >> 33) / (double)(1ull << 31);
}

static void random_direction(uint64_t *random, double d[3])
{
    const double azimuth = 2 * 3.14159265358979 * random_share(random);
    d[1] = 2 * random_share(random) - 1;
    d[0] = sqrt(1 - d[1] * d[1]) * sin(azimuth);
    d[2] = sqrt(1 - d[1] * d[1]) * cos(azimuth);
}

/* Turns a direction so that its angle to a normal has that cosine. */
static void graze(double d[3], const float normal[3], double cosine)
{
    double along = 0, square = 0;
    for (int a = 0; a < 3; a++)
        along += d[a] * (double)normal[a];
    for (int a = 0; a < 3; a++) {
        d[a] -= along * (double)normal[a];
        square += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++)
        d[a] = d[a] * sqrt((1 - cosine * cosine) / square) + cosine * (double)normal[a];
}

/* Numbers of pixels: what the sun shines on by their normals; of that what is dark; and what is dark as it should be,
 * since its own face is turned away: at sharp edges the normals of what interpolates samples are mixed from both. */
typedef struct {
    int lit, dark, turned;
} seen;

static seen shine(karst_engine *const engines[2], int shape, double distance_m, int num_suns, uint64_t *random)
{
    seen all = {0, 0, 0};
    char position[128];
    snprintf(position, sizeof position, "%g,%g,%g,39.8,-20.5,60", shape * APART_M - 0.6 * distance_m, 0.35 * distance_m,
             -0.72 * distance_m);
    look_from(engines[0], position);
    look_from(engines[1], position);
    int grazed = 0; /* a pixel of the body, over which every second sun grazes */
    for (int i = 0; i < num_suns; i++) {
        double d[3];
        random_direction(random, d);
        if (i & 1)
            graze(d, now.normal + 3 * grazed, 0.025 + 0.05 * random_share(random));
        const karst_sun sun = {atan2(d[0], d[2]) * (180 / 3.14159265358979), asin(d[1]) * (180 / 3.14159265358979)};
        take(engines, &sun);
        do
            grazed = (int)(NUM * random_share(random));
        while (isinf(now.depth[grazed]));
        for (int p = 0; p < NUM; p++) {
            const float *n = now.normal + 3 * p;
            if (isinf(now.depth[p]) || (double)n[0] * d[0] + (double)n[1] * d[1] + (double)n[2] * d[2] <= 0.02)
                continue;
            const double at[3] = {(double)now.position[3 * p] - shape * APART_M, (double)now.position[3 * p + 1],
                                  (double)now.position[3 * p + 2]};
            const bool turned = is_turned_away(at, d, shape);
            all.lit++;
            all.dark += is_dark(p) && !turned;
            all.turned += is_dark(p) && turned;
        }
    }
    return all;
}

static void convex_bodies_cast_no_shadow_on_themselves(void **state)
{
    (void)state;
    const int num_suns = getenv("KARST_TEST_FULL") ? 200 : getenv("KARST_TEST_QUICK") ? 2 : 8;
    for (int refine = 0; refine < 2; refine++) {
        karst_engine *const engines[2] = {open_text(bodies, false, refine), open_text(bodies, true, refine)};
        uint64_t random = 7;
        for (int shape = 0; shape < NUM_CONVEX; shape++) {
            int num_turned = 0, num_lit = 0;
            for (int i = 0; i < 3; i++) {
                const double distance_m = (const double[]){75, 200, 500}[i];
                const seen all = shine(engines, shape, distance_m, num_suns, &random);
                print_message("%s%s at %g m: %d of %d lit pixels in their own shadow, %d turned away\n",
                              refine ? "refined " : "", convex_names[shape], distance_m, all.dark, all.lit, all.turned);
                assert_true(all.lit > 5 * num_suns);
                assert_int_equal(all.dark, 0);
                num_turned += all.turned;
                num_lit += all.lit;
            }
            assert_true(num_turned * 50 <= num_lit);
        }
        karst_engine_destroy(engines[0]);
        karst_engine_destroy(engines[1]);
    }
}

/* A post and a wall on flat ground, under a sun so low that rays take twenty voxels to rise by one. */
static const char post[] = "/*{ \"voxel\": 0.25, \"view\": 400, \"sky\": { \"haze\": 1e9 } }*/\n"
                           "float density(vec3 p) {\n"
                           "    float thin = 0.3 - max(abs(p.x - 8.0), abs(p.z));\n"
                           "    float wall = min(4.0 - p.y, 2.0 - abs(p.x + 8.0));\n"
                           "    return max(-p.y, max(min(thin, 6.0 - p.y), min(wall, 6.0 - abs(p.z))));\n"
                           "}\n";

/* Ground that lies in the shadow of what stands on it is dark to where that stands. */
static void shadows_begin_at_the_foot(void **state)
{
    (void)state;
    karst_engine *const engines[2] = {open_text(post, false, false), open_text(post, true, false)};
    const karst_sun sun = {90, 3}; /* in the east: shadows lie towards -x */
    look_from(engines[0], "0,30,0,0,-90,60");
    look_from(engines[1], "0,30,0,0,-90,60");
    take(engines, &sun);
    int num_dark = 0, num_gaps = 0, num_lit = 0;
    for (int p = 0; p < NUM; p++) {
        const double x = (double)now.position[3 * p], y = (double)now.position[3 * p + 1],
                     z = (double)now.position[3 * p + 2];
        if (isinf(now.depth[p]) || fabs(y) > 0.05)
            continue;
        /* within the shadows, by half a voxel and more */
        const bool behind_post = x > -5.5 && x < 7.5 && fabs(z) < 0.15, behind_wall = x < -10.2 && fabs(z) < 5.7;
        const bool free = fabs(z) > 6.5;
        num_dark += (behind_post || behind_wall) && is_dark(p);
        num_gaps += (behind_post || behind_wall) && !is_dark(p);
        num_lit += free && !is_dark(p);
        assert_false(free && is_dark(p));
    }
    print_message("%d dark pixels, %d gaps, %d lit\n", num_dark, num_gaps, num_lit);
    assert_true(num_dark > 100 && num_gaps == 0 && num_lit > 500);
    karst_engine_destroy(engines[0]);
    karst_engine_destroy(engines[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(convex_bodies_cast_no_shadow_on_themselves),
        cmocka_unit_test(shadows_begin_at_the_foot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
