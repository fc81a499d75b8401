/* Models of clear matter in pictures: beside the same bodies as functions; with any number of lanes; what they are made
 * of, and what other models are. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/points/bodies.h"
#include "tests/support/scene.h"

enum { WIDTH = 64, HEIGHT = 48, NUM = WIDTH * HEIGHT };

static char folder[] = "/tmp/karst-clear-XXXXXX";
static char torus[64], ball[64];

/* Waves of colour on a floor below a torus that stands in the air, turned by 90 and 35 degrees. The first %s is what
 * models there are, the second what is said of clear matter. */
static const char world[] =
    "/*{ \"voxel\": 0.0078125, \"view\": 200, \"sun\": { \"azimuth\": 220, \"elevation\": 50 },\n"
    "\"camera\": { \"position\": [\"0\", \"3.2\", \"-7\"], \"pitch\": -18, \"fov\": 36 }%s }*/\n"
    "float density(vec3 p) { return -p.y; }\n"
    "vec3 colour(vec3 p, vec3 n) {\n"
    "    vec2 q = sin(p.xz * 0.8); float wave = smoothstep(-1.0, 1.0, q.x * q.y);\n"
    "    return mix(vec3(0.6, 0.2, 0.1), vec3(0.1, 0.25, 0.5), wave); }\n"
    "%s";
/* The torus and a ball of radius 1, as functions. */
static const char of_torus[] =
    "float clear(vec3 p) { vec3 q = p - vec3(0.0, 1.6, 0.0); float a = radians(35.0);\n"
    "    vec3 t = vec3(cos(a) * q.x - sin(a) * q.z, q.y, sin(a) * q.x + cos(a) * q.z);\n"
    "    return 0.4 - length(vec2(length(t.xy) - 1.0, t.z)); }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; m.absorption = vec3(0.6, 0.1, 0.3);\n"
    "    return m; }\n";
static const char of_ball[] =
    "float clear(vec3 p) { return 1.0 - length(p - vec3(0.0, 1.6, 0.0)); }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; m.absorption = vec3(0.6, 0.1, 0.3);\n"
    "    return m; }\n";
static const char glass[] = "{ \"ior\": 1.5, \"absorption\": [0.6, 0.1, 0.3] }";

static uint8_t one[4 * NUM], other[4 * NUM];

static void draw(const char *models, const char *text, int lanes, uint8_t *rgba)
{
    char whole[4096];
    const karst_engine_config config = {
        .pool_bytes = (uint64_t)96 << 20, .bounces = 8, .lanes = lanes, .detail_px = 0.25};
    bool settled = false;
    snprintf(whole, sizeof whole, world, models, text);
    karst_engine *engine = scene_create(whole, &config, WIDTH, HEIGHT, NULL);
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_pixels(engine, rgba, 4 * NUM, &error));
    karst_engine_destroy(engine);
}

/* The share of pixels whose values are all within so many of 255. */
static double share_within(const uint8_t *a, const uint8_t *b, int most, int *num_changed)
{
    int num = 0;
    *num_changed = 0;
    for (int i = 0; i < NUM; i++) {
        int apart = 0;
        for (int c = 0; c < 3; c++)
            apart = abs(a[4 * i + c] - b[4 * i + c]) > apart ? abs(a[4 * i + c] - b[4 * i + c]) : apart;
        num += apart <= most;
        *num_changed += apart > 2 * most;
    }
    return (double)num / NUM;
}

static void models(char *to, size_t size, const char *path, const char *more)
{
    snprintf(to, size, ", \"models\": [{ \"points\": \"%s\", %s }]", path, more);
}

/* ---- glass ---- */

static void look(const char *function, const char *path, int lanes, double least)
{
    char header[512], more[256];
    int num_far;
    if (function)
        draw("", function, lanes, one);
    snprintf(more, sizeof more,
             "\"at\": [\"0\", \"1.6\", \"0\"], \"turn\": [90, 35, 0], \"mode\": \"clear\", \"material\": %s", glass);
    models(header, sizeof header, path, more);
    draw(header, "", lanes, other);
    const double share = share_within(one, other, 8, &num_far);
    print_message("# %.4f of the pixels are within 8 of 255 of the body's, %d are beyond 16\n", share, num_far);
    assert_true(share >= least);
}

static void glass_of_points_is_the_bodys(void **state)
{
    (void)state;
    look(of_ball, ball, 0, 0.99);
    memcpy(one, other, sizeof one);
    if (!getenv("KARST_TEST_FULL"))
        return;
    look(NULL, ball, 1, 1); /* with one lane, as with sixteen */
    assert_memory_equal(one, other, sizeof one);
    look(of_torus, torus, 0, 0.99);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    random_state = 5;
    snprintf(torus, sizeof torus, "%s/torus.karstpoints", folder);
    snprintf(ball, sizeof ball, "%s/ball.karstpoints", folder);
    return make_body(torus, &known_surfaces[1], 40000, NULL) && make_body(ball, &known_surfaces[0], 40000, NULL) ? 0
                                                                                                                 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(torus);
    unlink(ball);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(glass_of_points_is_the_bodys),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
