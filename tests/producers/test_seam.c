/* Seams (producers/steps/seam.clh): bodies that share a face are one, grooves stay, bricks that share samples agree,
 * and the bits are the same in all shapes. Drivers compile for seconds: KARST_TEST_FULL=1 looks at one more
 * shape, and at what broken rules do. */
#include "tests/producers/mended.h"

static karst_world_file *open_text(const char *density)
{
    karst_world_file *file = open_plain(density);
    karst_world_file_raise_thin(file, KARST_THIN_ALWAYS);
    file->fills_seams = true; /* as of clear matter */
    return file;
}

/* Samples are 8 m apart. Eight boxes that make one up: seams cross on samples, of which some lie between nodes. Along z
 * they are as far apart as numbers are rounded. Beside them bottoms of grooves on samples: where two planes meet, and
 * where balls touch. */
static const char text[] =
    "float d = -box(abs(p - vec3(64.0, 48.0, -40.0)) - vec3(48.0, 48.0, 48.0001), vec3(48.0));\n"
    "float planes = min(0.6 * abs(p.x + 160.0) - 0.8 * (p.y + 80.0), -box(p + vec3(160.0, 128.0, 0.0), "
    "vec3(64.0, 96.0, 200.0)));\n"
    "float balls = 48.0 - length(vec3(abs(p.x + 160.0) - 48.0, p.y - 160.0, p.z));\n"
    "return max(d, max(planes, balls));";

static double place_m(int i, int axis)
{
    const int at[3] = {i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE};
    return 8.0 * (at[axis] - SIDE / 2);
}

/* Samples of the boxes that are not on the side that one box has them on. */
static int count_other_signs(const float *grid)
{
    int num = 0;
    for (int i = 0; i < NUM_CELLS; i++) {
        const double x = place_m(i, 0) - 64, y = place_m(i, 1) - 48, z = place_m(i, 2) + 40;
        num += x > -128 && (grid[i] > 0) != (fmax(fmax(fabs(x), fabs(y)), fabs(z) - 0.00005) < 96);
    }
    return num;
}

static int count_filled_bottoms(const float *grid)
{
    int num = 0;
    for (int i = 0; i < NUM_CELLS; i++) {
        const double y = place_m(i, 1), z = place_m(i, 2);
        num += place_m(i, 0) == -160 && ((y == -80 && fabs(z) < 200) || (y == 160 && z == 0)) && grid[i] > 0;
    }
    return num;
}

static void bodies_that_share_faces_are_one_and_grooves_stay(void **state)
{
    static float grid[NUM_CELLS];
    static const device_shape others[] = {{1, KARST_SHAPE_GROUPS, false}, {16, KARST_SHAPE_ROWS, true}};
    const bool full = getenv("KARST_TEST_FULL");
    karst_scrub sum;
    (void)state;
    karst_world_file *file = open_text(text);
    float *samples = evaluate(file, rows, 3, "", &sum);
    assert_int_equal(join(samples, grid), 0);
    assert_int_equal(count_other_signs(grid), 0);
    assert_int_equal(count_filled_bottoms(grid), 0);
    for (size_t s = 0; s < (full ? 2 : 1); s++) {
        float *other = evaluate(file, others[s], 3, "", &sum);
        expect_same_samples(samples, other);
        free(other);
    }
    free(samples);
    if (full) {
        samples = evaluate(file, rows, 3, "-DSEAM_ROUNDING=0.0f -DSEAM_DENT=2.0f", &sum);
        join(samples, grid);
        print_message("where rules are broken %d samples are cut off, and %d bottoms filled\n",
                      count_other_signs(grid), count_filled_bottoms(grid));
        assert_true(count_other_signs(grid) > 100 && count_filled_bottoms(grid) > 20);
        free(samples);
    }
    karst_world_file_destroy(file);
}

static void the_host_has_the_same_bricks(void **state)
{
    karst_error error = {0};
    (void)state;
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), 0, NULL, &error);
    pool_expect(context, "context", &error);
    karst_world_file *file = open_text(text);
    expect_host_has_same(context, file);
    karst_world_file_destroy(file);
    karst_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(bodies_that_share_faces_are_one_and_grooves_stay),
                                       cmocka_unit_test(the_host_has_the_same_bricks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
