/* Walls and panes of glass thinner than a voxel, wherever they lie among samples and nodes: walls turn the side to the
 * eye that it sees, and what lies behind panes is seen through them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "tests/support/scene.h"

enum { SIDE = 48, NUM = SIDE * SIDE };

/* All land gives off light that says which way it faces, and what it is. */
static const char text[] =
    "/*{ \"voxel\": 0.015625, \"view\": 60, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"params\": { \"front\": { \"value\": 0, \"min\": -1, \"max\": 1 },\n"
    "\"wide\": { \"value\": 0, \"min\": 0, \"max\": 1 },\n"
    "\"glass\": { \"value\": 0, \"min\": 0, \"max\": 1 } },\n"
    "\"camera\": { \"position\": [\"0\", \"0\", \"-6\"], \"fov\": 30 } }*/\n"
    "float sheet(vec3 p) { return min(1.0 - max(abs(p.x), abs(p.y)), min(p.z - front, front + wide - p.z)); }\n"
    "float density(vec3 p) { return max(p.z - 8.0, glass > 0.5 ? -1.0 : sheet(p)); }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0);\n"
    "    m.emission = vec3(p.z < 4.0 ? 1.0 : 0.0, 0.5, 0.5 - 0.25 * n.z); return m; }\n"
    "float clear(vec3 p) { return glass > 0.5 ? sheet(p) : -1.0; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; m.absorption = vec3(0.1); return m; }\n";
static float light[3 * NUM];

/* Voxels are 0.06 m wide where the sheet is, nodes end at 0. */
static const struct {
    double front_m, wide_m;
} sheets[] = {{0, 0.02}, {-0.02, 0.02}, {0.01, 0.02}, {-0.03, 0.02}, {0.01, 0.005}, {-0.0211, 0.02}, {0, 0.005}};
enum { NUM_SHEETS = sizeof sheets / sizeof *sheets };

static bool is_on_sheet(int i)
{
    const double per_px = 6 * tan(0.2617993877991494) * 2 / SIDE;
    return fabs((i % SIDE + 0.5 - SIDE / 2) * per_px) < 0.8 && fabs((i / SIDE + 0.5 - SIDE / 2) * per_px) < 0.8;
}

static void sheets_are_what_they_are_wherever_they_lie(void **state)
{
    (void)state;
    for (int lanes = 16; lanes; lanes = lanes == 16 && getenv("KARST_TEST_FULL") ? 1 : 0) {
        const karst_engine_config like = {.exposure = KARST_EXPOSURE_GIVEN, .lanes = lanes};
        karst_engine *engine = scene_create(text, &like, SIDE, SIDE, NULL);
        for (int i = 0; i < NUM_SHEETS; i++)
            for (int glass = 0; glass < 2; glass++) {
                const karst_parameter parameters[] = {
                    {"front", sheets[i].front_m}, {"wide", sheets[i].wide_m}, {"glass", glass}};
                int num = 0, num_off = 0;
                assert_ok(karst_engine_set_parameters(engine, parameters, 3, &error));
                scene_settle(engine, 600, light, 3 * NUM, NULL);
                for (int k = 0; k < NUM; k++) {
                    if (!is_on_sheet(k))
                        continue;
                    /* a wall faces the eye; a pane leaves 0.96 of the light, and less where it is met flatly */
                    const float *l = light + 3 * (size_t)k, left = glass ? 0.95f : 1;
                    num++;
                    num_off += !(fabsf(l[0] - (glass ? 0.0f : 1.0f)) < 0.01f && fabsf(l[1] - 0.5f * left) < 0.02f &&
                                 fabsf(l[2] - 0.75f * left) < 0.02f);
                }
                print_message("%s from %g m on, %g m thin, %d lanes: %d of %d pixels are off\n",
                              glass ? "glass" : "a wall", sheets[i].front_m, sheets[i].wide_m, lanes, num_off, num);
                assert_true(num > NUM / 10);
                assert_true(num_off <= num / 50);
            }
        karst_engine_destroy(engine);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(sheets_are_what_they_are_wherever_they_lie)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
