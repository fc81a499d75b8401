/* Hard things to see: plates, needles, balls and gaps about as wide as a voxel and much thinner, two surfaces in one
 * cell, plateaus, densities scaled by 1e-20 and 1e20, jumps, noise far above Nyquist, what is not finite, and levels
 * that change in the middle of the picture. */
#include "tests/hard/hard.h"

static void run(const hard_case *cases, size_t num_cases)
{
    for (size_t i = 0; i < num_cases; i++)
        hard_run(&cases[i]);
}
#define RUN(cases) run(cases, sizeof(cases) / sizeof *(cases))

/* A lattice of things, `spacing` apart, which is no multiple of a voxel: each lies differently in its cells. The middle
 * ray of a picture of 9 x 9 pixels looks at the middle of one from 40 m, where a footprint is 1.1 m and voxels of 1 m
 * are asked for; `aimed` says by which axes things are apart. The ray must hit, and where the reference says.
 *
 * A ball of 2 voxels holds the nearest sample however it lies, so does a needle of 1.5 and a plate of 1; and the
 * interpolant at its middle is positive. (Rays that pass beside the middle may miss what the reference hits: that is
 * what `within` of the other cases speaks of.) */
static void never_missed(const char *name, const char *scene, const bool aimed[3])
{
    const double spacing = 16.37, distance = 40;
    karst_error error = {0};
    /* lanes, and bits of a sample */
    static const int ways[][2] = {{1, 16}, {16, 16}, {16, 8}, {16, 32}};
    enum { NUM_WAYS = sizeof ways / sizeof *ways };
    const int num_ways = getenv("KARST_TEST_FULL") ? NUM_WAYS : 2; /* each has programs of its own to be compiled */
    karst_engine *engine[NUM_WAYS] = {NULL};
    hard_case c = {.name = name, .scene = scene, .width_px = 9, .height_px = 9, .view_m = 100};
    double worst = 0;
    int num_places = 0;
    hard_write_world(&c);
    for (int n = 0; n < 24; n++) {
        /* from in front, a little above and beside */
        karst_camera camera = {.yaw_deg = 17.3 + 0.5 * n, .pitch_deg = -11.7 + 0.3 * n, .fov_deg = 14};
        double right[3], up[3], forward[3], offset_m[3];
        karst_camera_axes(&camera, right, up, forward);
        for (int i = 0; i < 3; i++)
            offset_m[i] = (aimed[i] ? spacing * (n * (i + 1) - 40) : 0.37 * n) - distance * forward[i];
        camera.position = karst_position_add_m(camera.position, offset_m, -4);
        const karst_reference_config reference = {.world = hard_path,
                                                  .camera = &camera,
                                                  .width_px = 9,
                                                  .height_px = 9,
                                                  .footprint = KARST_FOOTPRINT_BLENDED};
        if (!karst_reference_trace(&reference, hard_expected, NULL, NULL, NULL, &error))
            fail_msg("%s: %s", name, error.message);
        const karst_reference_hit *middle = &hard_expected[40];
        if (middle->kind == KARST_REFERENCE_INSIDE && middle->t_m == 0)
            continue; /* 40 m before one plate stands another */
        num_places++;
        assert_int_equal(middle->kind, KARST_REFERENCE_SURFACE);
        for (int k = 0; k < num_ways; k++) {
            bool settled;
            const karst_engine_config config = {.world = hard_path,
                                                .display = KARST_DISPLAY_NONE,
                                                .width_px = 9,
                                                .height_px = 9,
                                                .pool_bytes = (uint64_t)64 << 20,
                                                .no_shadows = true,
                                                .brick_bits = ways[k][1],
                                                .lanes = ways[k][0]};
            if (!engine[k])
                engine[k] = karst_engine_create(&config, &error);
            if (!engine[k] || !karst_engine_set_camera(engine[k], &camera, &error) ||
                !karst_engine_settle(engine[k], 400, NULL, NULL, &settled, &error) || !settled ||
                !karst_engine_read_depth(engine[k], hard_depth_m, 81, &error))
                fail_msg("%s: %s", name, error.message);
            double apart = fabs((double)hard_depth_m[40] - middle->t_m) / middle->footprint_m;
            if (!(apart <= 1.5))
                fail_msg("%s, place %d, %d lanes, %d bits: %.6g m instead of %.6g m", name, n, ways[k][0], ways[k][1],
                         (double)hard_depth_m[40], middle->t_m);
            worst = fmax(worst, apart);
        }
    }
    for (int k = 0; k < num_ways; k++)
        karst_engine_destroy(engine[k]);
    print_message("%s: hit from %d places, at most %.3f footprints off\n", name, num_places, worst);
    assert_true(num_places > 16);
    unlink(hard_path);
}

static void test_never_missed(void **state)
{
    (void)state;
    const bool all[3] = {true, true, true}, columns[3] = {true, false, true}, layers[3] = {false, false, true};
    never_missed("a ball 2 voxels wide", "return 1.0 - length(mod(p + 8.185, 16.37) - 8.185);", all);
    never_missed("a needle 1.5 voxels wide", "vec2 q = mod(p.xz + 8.185, 16.37) - 8.185; return 0.75 - length(q);",
                 columns);
    never_missed("a plate 1 voxel thin", "return 0.5 - abs(mod(p.z + 8.185, 16.37) - 8.185);", layers);
}

static void test_thin(void **state)
{
    (void)state;
    const hard_case cases[] = {
        {.name = "a plate 1 voxel thin",
         .scene = "return 0.5 - abs(p.z - 40.3);",
         .camera = "0,0,0,0,0",
         .least_hits = 1728},
        {.name = "a plate 0.1 voxels thin",
         .scene = "return 0.05 - abs(p.z - 40.3);",
         .camera = "0,0,0,0,0",
         .least_hits = 1728},
        {.name = "a plate 0.01 voxels thin",
         .scene = "return 0.005 - abs(p.z - 40.3);",
         .camera = "0,0,0,0,0",
         .least_hits = 1728},
        {.name = "a plate 0.1 m thin, from nearby",
         .scene = "return 0.05 - abs(p.z - 3.3);",
         .camera = "0,0,0,0,0",
         .view_m = 3.6,
         .least_hits = 500,
         .num_silhouette = 32}, /* shown two voxels thick, it is nearer, and a rim more of it lies within the view */
        {.name = "a gap of two voxels",
         .scene = "return abs(p.x - 0.3) - 2.0 - max(40.0 - p.z, 0.0) * 1e3;",
         .camera = "0,0,20,0,0",
         .view_m = 60,
         .least_hits = 1000,
         .num_silhouette = 200},
        {.name = "two surfaces in one cell",
         .scene = "return min(p.z - 40.2, max(p.z - 40.2, 40.7 - p.z + 0.01 * p.x));",
         .camera = "0,0,0,0,0",
         .least_hits = 1000,
         .num_silhouette = 300},
        {.name = "a needle 1.5 voxels wide",
         .scene = "return 0.75 - length(p.xz - vec2(0.7, 40.0));",
         .camera = "0,0,0,0,0",
         .least_hits = 30,
         .num_silhouette = 100},
    };
    RUN(cases);
}

static void test_values(void **state)
{
    (void)state;
    const hard_case cases[] = {
        {.name = "scaled by 1e20",
         .scene = "return 1e20 * (3.0 * sin(p.x / 40.0) * cos(p.z / 50.0) - p.y);",
         .camera = "0,12,0,20,-20",
         .view_m = 400,
         .least_hits = 700,
         .num_silhouette = 8},
        {.name = "scaled by 1e-20",
         .scene = "return 1e-20 * (3.0 * sin(p.x / 40.0) * cos(p.z / 50.0) - p.y);",
         .camera = "0,12,0,20,-20",
         .view_m = 400,
         .least_hits = 700,
         .num_silhouette = 8},
        /* Zero gradient, and zero itself, on all of the surface: zero is air. */
        {.name = "plateau of zeros",
         .scene = "return max(-p.y - 1.0, 0.0) - max(p.y, 0.0);",
         .camera = "0,12,0,20,-30",
         .view_m = 300,
         .within = 12,
         .least_hits = 700,
         .num_silhouette = 120},
        {.name = "cube of a distance",
         .scene = "float d = 0.1 * p.y; return -d * d * d;",
         .camera = "0,12,0,20,-30",
         .view_m = 300,
         .least_hits = 700,
         .num_silhouette = 8},
    };
    RUN(cases);
}

static void test_jumps(void **state)
{
    (void)state;
    const hard_case cases[] = {
        /* A jump between two samples is put somewhere between them. */
        {.name = "a step",
         .scene = "return p.y < 0.3 ? 1.0 : -1.0;",
         .camera = "0,12,0,20,-30",
         .view_m = 200,
         .within = 12,
         .least_hits = 700,
         .num_silhouette = 100},
        {.name = "terraces",
         .scene = "return 4.0 * floor(p.x / 16.0) - p.y;",
         .camera = "8,40,0,0,-40",
         .view_m = 150,
         .within = 4,
         .least_hits = 900,
         .num_silhouette = 250},
        {.name = "noise far above Nyquist",
         .scene = "return noise(p * 64.0) - p.y;",
         .camera = "0,12,0,20,-30",
         .view_m = 300,
         .least_hits = 700,
         .num_silhouette = 20},
        {.name = "NaN in parts",
         .scene = "return (p.x > 20.0 ? sqrt(-1.0) / 0.0 * 0.0 : 0.0) - p.y;",
         .camera = "0,12,0,0,-30",
         .view_m = 200,
         .limit = "where a density is not finite there is air, and a warning counts it; edges of it are as wide as a "
                  "voxel"},
        {.name = "infinity in parts",
         .scene = "return 1.0 / max(p.y, 0.0) - 1.0 / 0.5;",
         .camera = "0,12,0,20,-30",
         .view_m = 200,
         .limit = "samples that are infinite count as air"},
        {.name = "a level that ends in the middle",
         .scene = "return noise(p / 3.0) - p.y;",
         .camera = "0,12,0,20,-30",
         .view_m = 400,
         .within = 3,
         .least_hits = 700,
         .num_silhouette = 60},
    };
    RUN(cases);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_never_missed),
        cmocka_unit_test(test_thin),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_jumps),
    };
    return cmocka_run_group_tests_name("hard shapes", tests, NULL, NULL);
}
