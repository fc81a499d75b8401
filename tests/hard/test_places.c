/* Hard places to stand and hard ways to look: positions from 1 m to 10^15 m, axes, edges and corners of nodes, grazing
 * rays, wide and narrow views, tiny pictures, many levels. */
#include "tests/hard/hard.h"

#define PLANE "return -p.y;"
/* A ground that is nowhere flat, so that a wrong place shows. */
#define WAVES "return 3.0 * sin(p.x / 40.0) * cos(p.z / 50.0) - p.y;"

static void run(const hard_case *cases, size_t num_cases)
{
    for (size_t i = 0; i < num_cases; i++)
        hard_run(&cases[i]);
}
#define RUN(cases) run(cases, sizeof(cases) / sizeof *(cases))

static void test_positions(void **state)
{
    (void)state;
    hard_case c = {.scene = WAVES, .least_hits = 700, .num_silhouette = 8, .view_m = 400};
    char name[64], camera[128];
    for (int power = 0; power <= 15; power += 3) {
        snprintf(name, sizeof name, "waves at 1e%d m", power);
        snprintf(camera, sizeof camera, "1e%d,12,-1e%d,20,-20", power, power);
        c.name = name;
        c.camera = camera;
        hard_run(&c);
    }
}

static void test_ways_to_look(void **state)
{
    (void)state;
    const hard_case cases[] = {
        /* Rays along axes: the middle of an odd picture looks exactly along one; two components are 0. */
        {.name = "down an axis",
         .scene = WAVES,
         .camera = "0,40,0,0,-90",
         .width_px = 33,
         .height_px = 33,
         .least_hits = 1000},
        {.name = "up an axis",
         .scene = "return p.y - 60.0;",
         .camera = "0,0,0,0,90",
         .width_px = 33,
         .height_px = 33,
         .least_hits = 1000},
        {.name = "along x",
         .scene = "return p.x - 50.0;",
         .camera = "0,0,0,90,0",
         .width_px = 33,
         .height_px = 33,
         .least_hits = 1000},
        {.name = "along -z",
         .scene = "return -50.0 - p.z;",
         .camera = "0,0,0,180,0",
         .width_px = 33,
         .height_px = 33,
         .least_hits = 1000},
        /* From corners of nodes of every level, through edges and corners of all that follow. */
        {.name = "through corners",
         .scene = "return p.x + p.y + p.z - 90.0;",
         .camera = "0,0,0,45,35.26438968275465",
         .width_px = 33,
         .height_px = 33,
         .least_hits = 1000},
        {.name = "through edges",
         .scene = "return p.x + p.z - 70.0;",
         .camera = "16,0,16,45,0",
         .width_px = 33,
         .height_px = 33,
         .least_hits = 1000},
        {.name = "on a face of nodes",
         .scene = WAVES,
         .camera = "1024,64,0.5,0,-30",
         .least_hits = 700,
         .view_m = 400,
         .num_silhouette = 8},
        {.name = "on an edge of nodes",
         .scene = WAVES,
         .camera = "-1024,64,1024,77,-30",
         .least_hits = 700,
         .view_m = 400,
         .num_silhouette = 8},
        /* Yaw of 1e-36 degrees: x components are denormal floats. */
        {.name = "denormal directions",
         .scene = "return p.z - 50.0;",
         .camera = "0,0,0,1e-36,0",
         .width_px = 33,
         .height_px = 33,
         .least_hits = 1000},
    };
    RUN(cases);
}

static void test_where_to_stand(void **state)
{
    (void)state;
    const hard_case cases[] = {
        {.name = "inside solid", .scene = WAVES, .camera = "0,-100,0,0,0", .least_hits = 48 * 36},
        {.name = "under a surface, looking up", .scene = WAVES, .camera = "0,-6,0,0,60", .least_hits = 48 * 36},
        /* The surface itself counts as air. */
        {.name = "touching the surface", .scene = PLANE, .camera = "5,0,5,0,30", .within = 1},
        {.name = "a hair above the surface",
         .scene = PLANE,
         .camera = "5,0.000001,5,0,-45",
         .least_hits = 1700,
         .limit = "a camera nearer to a surface than a few 1e-4 voxel may count as inside it or outside: samples are "
                  "rounded to 16 bits"},
        {.name = "a voxel above the surface",
         .scene = WAVES,
         .camera = "0,0.0625,0,0,-50",
         .least_hits = 1000,
         .num_silhouette = 12},
        {.name = "at the root window's corner",
         .scene = WAVES,
         .camera = "2047.99,12,-2048,225,-20",
         .view_m = 400,
         .least_hits = 700,
         .num_silhouette = 8},
    };
    RUN(cases);
}

static void test_grazing(void **state)
{
    (void)state;
    const hard_case cases[] = {
        /* Rows of pixels 1e-4 to 1e-6 radians below the horizon of a plane. */
        {.name = "grazing, 1e-4",
         .scene = PLANE,
         .camera = "0,0.1,0,0,-0.01,0.01",
         .view_m = 20000,
         .least_hits = 800,
         .num_silhouette = 48},
        {.name = "grazing, 1e-6",
         .scene = PLANE,
         .camera = "0,0.01,0,0,-0.0001,0.0001",
         .view_m = 20000,
         .limit = "float directions are good to 6e-8: 1e-6 radians have two digits, depths there two as well"},
    };
    RUN(cases);
}

static void test_views(void **state)
{
    (void)state;
    const hard_case cases[] = {
        {.name = "one pixel", .scene = WAVES, .camera = "0,12,0,0,-30", .width_px = 1, .height_px = 1, .least_hits = 1},
        {.name = "7 x 5 pixels",
         .scene = WAVES,
         .camera = "0,12,0,0,-30",
         .width_px = 7,
         .height_px = 5,
         .least_hits = 30},
        {.name = "one row", .scene = WAVES, .camera = "0,12,0,0,-30", .width_px = 61, .height_px = 1, .least_hits = 61},
        {.name = "fov 179", .scene = WAVES, .camera = "0,12,0,30,-40,179", .least_hits = 800, .num_silhouette = 24},
        {.name = "fov 1", .scene = WAVES, .camera = "0,12,0,30,-10,1", .least_hits = 1000, .num_silhouette = 24},
        {.name = "fov 0.0001",
         .scene = WAVES,
         .camera = "0,12,0,30,-10,0.0001",
         .least_hits = 1000,
         .limit = "float directions are 6e-8 apart, pixels of a view of 1e-4 degrees 5e-8: neighbours share rays"},
    };
    RUN(cases);
}

static void test_many_levels(void **state)
{
    (void)state;
    /* A plane seen to the end of the int64 world: voxels from 2^-20 m up. Each row of pixels sees it at another level.
     */
    const hard_case cases[] = {
        {.name = "levels, 1 m to 1e9 m",
         .scene = PLANE,
         .camera = "0,2,0,0,-30",
         .view_m = 1e9,
         .voxel_m = 0.0009765625,
         .least_hits = 1200,
         .num_silhouette = 96},
        {.name = "levels, as many as int64 allows",
         .scene = PLANE,
         .camera = "0,0.001,0,0,-30",
         .view_m = 6.8e10,
         .voxel_m = 9.5367431640625e-7,
         .least_hits = 1200,
         .num_silhouette = 96},
    };
    RUN(cases);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_positions), cmocka_unit_test(test_ways_to_look), cmocka_unit_test(test_where_to_stand),
        cmocka_unit_test(test_grazing),   cmocka_unit_test(test_views),        cmocka_unit_test(test_many_levels),
    };
    return cmocka_run_group_tests_name("hard places", tests, NULL, NULL);
}
