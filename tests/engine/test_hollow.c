/* Hollow is hollow: a ball of glass with a hollow core looks as one whose core has the index 1, and neither picture
 * depends on the width of vectors. At 800x600, which takes minutes: only with KARST_TEST_FULL=1. A picture of 48x48 is
 * in test_bend.c. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/scene.h"

/* A wall behind the ball gives off light that says where it was seen. */
static const char text[] =
    "/*{ \"voxel\": 0.00390625, \"view\": 60, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-4\"], \"fov\": 30 },\n"
    "\"params\": { \"hollow\": { \"value\": 0, \"min\": 0, \"max\": 1 } } }*/\n"
    "float density(vec3 p) { return p.z - 8.0; }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0);\n"
    "    m.emission = vec3(p.x + 30.0, p.y + 30.0, 30.0) / 30.0; return m; }\n"
    "float clear(vec3 p) { float r = length(p); return hollow > 0.5 ? min(1.0 - r, r - 0.5) : 1.0 - r; }\n"
    "float index(vec3 p) { return hollow < 0.5 && dot(p, p) < 0.25 ? 1.0 : 1.5; }\n";

enum { HOLLOW, CORE, NUM_BODIES };

typedef struct {
    int width_px, height_px;
    float *light[NUM_BODIES];
} pictures;

static void draw(int lanes, int width_px, int height_px, pictures *p)
{
    const karst_engine_config config = {.bounces = 12, .lanes = lanes};
    karst_engine *engine = scene_create(text, &config, width_px, height_px, NULL);
    const size_t num = 3 * (size_t)width_px * (size_t)height_px;
    p->width_px = width_px, p->height_px = height_px;
    for (int body = 0; body < NUM_BODIES; body++) {
        const karst_parameter parameter = {"hollow", body == HOLLOW};
        karst_stats stats;
        assert_ok(karst_engine_set_parameters(engine, &parameter, 1, &error));
        p->light[body] = malloc(num * sizeof(float));
        assert_non_null(p->light[body]);
        scene_settle(engine, 600, p->light[body], num, &stats);
        print_message("%d lanes, %s: %llu rays in clear matter, %llu cut off\n", lanes,
                      body == HOLLOW ? "hollow" : "a core of 1", (unsigned long long)stats.num_rays[KARST_STREAM_CLEAR],
                      (unsigned long long)stats.num_rays_cut);
        assert_true(stats.num_rays[KARST_STREAM_CLEAR] > (uint64_t)width_px);
    }
    karst_engine_destroy(engine);
}

static void forget(pictures *p)
{
    for (int body = 0; body < NUM_BODIES; body++)
        free(p->light[body]);
}

static void a_core_of_one_is_a_hollow(void **state)
{
    (void)state;
    if (!getenv("KARST_TEST_FULL"))
        skip();
    pictures wide, narrow;
    draw(0, 800, 600, &wide);
    const int num = wide.width_px * wide.height_px;
    int num_off = 0;
    double most = 0;
    for (int i = 0; i < num; i++) {
        double off = 0;
        for (int c = 0; c < 3; c++)
            off = fmax(off, fabs((double)wide.light[HOLLOW][3 * i + c] - (double)wide.light[CORE][3 * i + c]));
        num_off += off > 1.0 / 255;
        most = fmax(most, off);
    }
    print_message("%dx%d: %d of %d pixels are more than 1/255 apart, at most %.3g\n", wide.width_px, wide.height_px,
                  num_off, num, most);
    assert_true(num_off * 1000 <= num);
    draw(1, wide.width_px, wide.height_px, &narrow);
    for (int body = 0; body < NUM_BODIES; body++)
        assert_memory_equal(wide.light[body], narrow.light[body], 3 * (size_t)num * sizeof(float));
    forget(&narrow);
    forget(&wide);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_core_of_one_is_a_hollow)};
    return cmocka_run_group_tests_name("hollow is hollow", tests, NULL, NULL);
}
