/* Photons meet models: those of glass and those that mirror turn light, and light lands on models, as it does where the
 * same bodies are functions. No energy is lost. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/points/bodies.h"
#include "tests/support/scene.h"

enum { SIDE = 64, NUM = SIDE * SIDE };
#define RING_X (-1.6)
#define BALL_X 1.6

/* A ring's wall from 1 to 1.4 around the y axis, 0.9 high. */
static double ring_value(const double p[3], double gradient[3])
{
    const double r = sqrt(p[0] * p[0] + p[2] * p[2]) + 1e-30, across = fabs(r - 1.2) - 0.2, up = fabs(p[1]) - 0.45;
    for (int a = 0; a < 3; a++)
        gradient[a] = 0;
    if (across > up) {
        gradient[0] = (r > 1.2 ? -1 : 1) * p[0] / r;
        gradient[2] = (r > 1.2 ? -1 : 1) * p[2] / r;
    } else {
        gradient[1] = p[1] > 0 ? -1 : 1;
    }
    return -fmax(across, up);
}
static const known_surface ring = {"ring", ring_value, 1.45, 4.8 * PI * 0.9 + 2 * 0.96 * PI, -1};

/* A sheet that faces up. */
static double floor_value(const double p[3], double gradient[3])
{
    gradient[0] = gradient[2] = 0;
    gradient[1] = -1;
    return -p[1];
}
static const known_surface ground = {"floor", floor_value, 3.6, 52, -1};

static char folder[] = "/tmp/karst-light-XXXXXX";
static char ring_path[64], ball_path[64], floor_path[64];

static const char world[] = "/*{ \"voxel\": 0.00390625, \"view\": 60, \"sun\": { \"azimuth\": 270, \"elevation\": 40, "
                            "\"colour\": [1, 1, 1] },\n"
                            "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
                            "\"camera\": { \"position\": [\"0\", \"12\", \"0\"], \"pitch\": -90, \"fov\": 30 }%s }*/\n"
                            "%s";
static const char functions[] =
    "float ring(vec3 p) { return max(abs(length(p.xz - vec2(-1.6, 0.0)) - 1.2) - 0.2, abs(p.y - 0.46) - 0.45); }\n"
    "float density(vec3 p) { return max(-p.y, -ring(p)); }\n"
    "float clear(vec3 p) { return 0.5 - length(p - vec3(1.6, 0.75, 0.0)); }\n"
    "material surface(vec3 p, vec3 n) { material m;\n"
    "    if (p.y > 0.004) { m.colour = vec3(0.0); m.mirror = 0.8; } return m; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; m.absorption = vec3(0.2, 0.0, 0.5); return m; "
    "}\n";
static const char nothing[] = "float density(vec3 p) { return -p.y - 10.0; }\n"
                              "vec3 colour(vec3 p, vec3 n) { return vec3(0.5); }\n";

typedef struct {
    float light[3 * NUM];
    karst_stats stats;
} picture;
static picture truth, seen;

#define NUM_PHOTONS 20000u

static void draw(const char *models, const char *text, int lanes, picture *p)
{
    char whole[4096];
    const karst_engine_config config = {.pool_bytes = (uint64_t)128 << 20, .caustics = NUM_PHOTONS, .lanes = lanes};
    snprintf(whole, sizeof whole, world, models, text);
    karst_engine *engine = scene_create(whole, &config, SIDE, SIDE, NULL);
    scene_settle(engine, 600, p->light, 3 * NUM, &p->stats);
    karst_engine_destroy(engine);
    const karst_stats_caustics *c = &p->stats.caustics;
    const double sum = c->deposited + c->direct + c->absorbed + c->escaped + c->cut_off;
    assert_true(c->emitted > 0 && c->deposited > 0 && c->absorbed > 0);
    assert_true(fabs(sum - c->emitted) <= 1e-9 * c->emitted);
    assert_true(c->num_landed > NUM_PHOTONS / 20);
}

/* Where the floor's light is compared: a disc around (x, 0), from the ball's shadow or within the ring. Returns the rms
 * of the peak; *ratio is that of all light. */
static double compare(double x, double radius, int channel, double *ratio)
{
    const double pixel_m = 2 * 12 * tan(15 * PI / 180) / SIDE;
    double square = 0, peak = 0, sum = 0, all = 0;
    int num = 0;
    for (int i = 0; i < NUM; i++) {
        const double at_x = (i % SIDE + 0.5 - SIDE / 2.0) * pixel_m, at_z = (SIDE / 2.0 - i / SIDE - 0.5) * pixel_m;
        if (hypot(at_x - x, at_z) > radius)
            continue;
        const double a = (double)seen.light[3 * i + channel], b = (double)truth.light[3 * i + channel];
        square += (a - b) * (a - b);
        peak = fmax(peak, b);
        sum += b;
        all += a;
        num++;
    }
    *ratio = all / sum;
    return sqrt(square / num) / peak;
}

static void photons_meet_models(void **state)
{
    (void)state;
    char models[1024];
    if (!getenv("KARST_TEST_FULL")) /* its kernels take a while to compile */
        skip();
    double ratio;
    draw("", functions, 0, &truth);
    snprintf(models, sizeof models,
             ", \"models\": [{ \"points\": \"%s\", \"at\": [-1.6, 0.46, 0],\n"
             "\"material\": { \"colour\": [0, 0, 0], \"mirror\": 0.8 } },\n"
             "{ \"points\": \"%s\", \"material\": { \"colour\": [0.5, 0.5, 0.5], \"mirror\": 0 } },\n"
             "{ \"points\": \"%s\", \"at\": [1.6, 0.75, 0], \"scale\": 0.5, \"mode\": \"clear\",\n"
             "\"material\": { \"ior\": 1.5, \"absorption\": [0.2, 0, 0.5] } }]",
             ring_path, floor_path, ball_path);
    draw(models, nothing, 0, &seen);
    const double of_ring = compare(RING_X, 0.9, 0, &ratio);
    print_message("# in the ring of points: rms %.4f of the peak, light %.4f of the ring's\n", of_ring, ratio);
    assert_true(of_ring < 0.1 && fabs(ratio - 1) < 0.1); /* its edges are rounded off */
    /* The spot lies in the sun's direction, and the ball is seen before it. */
    const double of_ball = compare(2.65, 0.45, 2, &ratio);
    print_message("# behind the ball of points: rms %.4f of the peak, light %.4f of the ball's\n", of_ball, ratio);
    assert_true(of_ball < 0.1 && fabs(ratio - 1) < 0.1);
    const karst_stats_caustics *a = &truth.stats.caustics, *b = &seen.stats.caustics;
    print_message("# absorbed: %.4f and %.4f of what was emitted\n", a->absorbed / a->emitted,
                  b->absorbed / b->emitted);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    random_state = 5;
    snprintf(ring_path, sizeof ring_path, "%s/ring.karstpoints", folder);
    snprintf(ball_path, sizeof ball_path, "%s/ball.karstpoints", folder);
    snprintf(floor_path, sizeof floor_path, "%s/floor.karstpoints", folder);
    return make_body(ring_path, &ring, 30000, NULL) && make_body(ball_path, &known_surfaces[0], 12000, NULL) &&
                   make_body(floor_path, &ground, 20000, NULL)
               ? 0
               : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(ring_path);
    unlink(ball_path);
    unlink(floor_path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(photons_meet_models)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
