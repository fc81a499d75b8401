/* A room of points whose walls mirror: its corners show what those of the same room as a function do. Rays that are
 * mirrored beside a corner start within the crusts of two or three walls, and must meet the right one, far or near.
 * Walls lie on samples. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/points/bodies.h"
#include "tests/support/scene.h"

enum { WIDTH = 64, HEIGHT = 48, NUM = WIDTH * HEIGHT };
#define BALL_RADIUS 0.35

/* A room of sides of 2 around the origin, and a ball in it. */
static double ball_room_value(const double p[3], double gradient[3])
{
    const double q[3] = {p[0] - 0.45, p[1] + 0.65, p[2] - 0.5};
    const double r = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]) + 1e-30;
    int axis = 0;
    for (int a = 1; a < 3; a++)
        axis = fabs(p[a]) > fabs(p[axis]) ? a : axis;
    const bool is_ball = BALL_RADIUS - r > fabs(p[axis]) - 1;
    for (int a = 0; a < 3; a++)
        gradient[a] = is_ball ? -q[a] / r : a == axis ? (p[a] > 0 ? 1 : -1) : 0;
    return is_ball ? BALL_RADIUS - r : fabs(p[axis]) - 1;
}
static const known_surface room = {"room", ball_room_value, 1.02, 24 + 4 * PI *BALL_RADIUS *BALL_RADIUS, -1};

static char folder[] = "/tmp/karst-room-XXXXXX";
static char path[64];

/* What shines has no edges, so that pixels say how right ways are, not where an edge is cut. */
static const char world[] =
    "/*{ \"voxel\": 0.00390625, \"view\": 20, \"sun\": { \"azimuth\": 0, \"elevation\": -90 },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"-0.6\", \"0.3\", \"-0.8\"], \"yaw\": 30, \"pitch\": -12, \"fov\": 75 }%s }*/\n"
    "float density(vec3 p) { %s }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); m.mirror = 0.7;\n"
    "    m.emission = vec3(0.2) + 0.15 * sin(3.0 * p.zxy + vec3(0.0, 1.0, 2.0)); return m; }\n";
static const char as_function[] =
    "return max(max(max(abs(p.x), abs(p.y)), abs(p.z)) - 1.0,"
    "    0.35 - length(p - vec3(0.45, -0.65, 0.5)));";

static uint8_t truth[4 * NUM], seen[4 * NUM];
static float place[3 * NUM];

static void draw(const char *models, const char *density, uint8_t *rgba)
{
    char text[2048];
    bool settled = false;
    /* Voxels of a quarter of a pixel: bricks of points round an edge off by some voxels. */
    const karst_engine_config config = {.pool_bytes = (uint64_t)192 << 20, .detail_px = 0.25};
    snprintf(text, sizeof text, world, models, density);
    karst_engine *engine = scene_create(text, &config, WIDTH, HEIGHT, NULL);
    assert_ok(karst_engine_settle(engine, 400, NULL, NULL, &settled, &error));
    assert_true(settled);
    assert_ok(karst_engine_read_pixels(engine, rgba, 4 * NUM, &error));
    if (rgba == truth)
        assert_ok(karst_engine_read_aov(engine, KARST_AOV_POSITION, place, 3 * NUM, &error));
    karst_engine_destroy(engine);
}

/* Of pixels that show a wall so near to another one, the share whose values are all within 2 of 255. */
static double share_right(double least_m, double most_m, int *num)
{
    int num_right = 0;
    *num = 0;
    for (int i = 0; i < NUM; i++) {
        double away[3];
        for (int a = 0; a < 3; a++)
            away[a] = 1 - fabs((double)place[3 * i + a]);
        /* The second nearest wall: the nearest is the one that is seen. */
        const double low = fmin(away[0], fmin(away[1], away[2])), high = fmax(away[0], fmax(away[1], away[2]));
        const double second = away[0] + away[1] + away[2] - low - high;
        if (low > 0.02 || second < least_m || second > most_m)
            continue;
        ++*num;
        int apart = 0;
        for (int c = 0; c < 3; c++)
            apart = abs(truth[4 * i + c] - seen[4 * i + c]) > apart ? abs(truth[4 * i + c] - seen[4 * i + c]) : apart;
        num_right += apart <= 2;
    }
    return (double)num_right / *num;
}

/* Pixels that look out of the room, where all is dark. */
static int count_black(void)
{
    int num = 0;
    for (int i = 0; i < NUM; i++)
        num += seen[4 * i] + seen[4 * i + 1] + seen[4 * i + 2] < 30;
    return num;
}

static void corners_are_those_of_the_room(void **state)
{
    (void)state;
    if (!getenv("KARST_TEST_FULL")) /* test_whole.c looks for holes behind edges, without a device */
        skip();
    char models[256];
    int num_beside, num_all;
    draw("", as_function, truth);
    snprintf(models, sizeof models,
             ", \"models\": [{ \"points\": \"%s\", \"at\": [\"0\", \"0\", \"0\"] }]", path);
    draw(models, "return -1.0;", seen);
    const double beside = share_right(0.02, 0.25, &num_beside), all = share_right(0, 2, &num_all);
    print_message("# %.4f of %d pixels beside corners are within 2 of 255, %.4f of all %d of walls; %d see no wall\n",
                  beside, num_beside, all, num_all, count_black());
    assert_true(num_beside > NUM / 8 && num_all > NUM / 2);
    assert_true(beside >= 0.99 && all >= 0.995 && count_black() == 0);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    random_state = 5;
    snprintf(path, sizeof path, "%s/room.karstpoints", folder);
    return make_body(path, &room, 200000, NULL) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(corners_are_those_of_the_room)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
