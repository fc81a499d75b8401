/* What the viewer's tools lay: valid edits, as densely as sense has it, and land that is as the tool's name says. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "demos/view/stroke.c"
#include "producers/edits/edit_list.h"
#include "tests/noise/random.h"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-3)

/* A slope with bumps of 0.4 m, edited; its density is `steep` times metres. */
typedef struct {
    karst_edit_list list;
    double slope, bumps_m, steep;
    karst_position origin;
    uint32_t num_frozen; /* edits of the land that a stroke is on */
} land;

static double land_density(void *user, const karst_position *at)
{
    const land *l = user;
    double p[3];
    karst_position_difference_m(l->origin, *at, VOXEL_LOG2_M, p);
    const double bump_m = l->bumps_m * sin(2.1 * p[0]) * sin(1.9 * p[2]);
    return karst_edit_list_precise_density(&l->list, at, -1, l->steep * (l->slope * p[0] + bump_m - p[1]));
}

static land make_land(double slope, double bumps_m, double steep)
{
    land l = {.slope = slope, .bumps_m = bumps_m, .steep = steep};
    assert_ok(karst_edit_list_init(&l.list, VOXEL_LOG2_M, &error));
    return l;
}

static view_ground ground_of(land *l) { return (view_ground){land_density, l, VOXEL_LOG2_M}; }

static double height_at(land *l, double x_m, double z_m)
{
    const view_ground ground = ground_of(l);
    const karst_position at = karst_position_add_m(l->origin, (double[3]){x_m, l->slope * x_m, z_m}, VOXEL_LOG2_M);
    double height_m;
    assert_true(view_find_surface(&ground, &at, (double[3]){0, 1, 0}, 6, &height_m, NULL));
    return l->slope * x_m + height_m;
}

static view_spot spot_at(land *l, double x_m, double z_m, double width_m)
{
    const view_ground ground = ground_of(l);
    const karst_position at =
        karst_position_add_m(l->origin, (double[3]){x_m, height_at(l, x_m, z_m), z_m}, VOXEL_LOG2_M);
    return view_find_spot(&ground, &at, width_m, (double[3]){0, 1, 0});
}

/* One touch of a brush that is down, as the viewer does it. */
static bool touch(land *l, view_stroke *stroke, const view_brush *brush, double x_m, double z_m, double now_s)
{
    const view_ground ground = ground_of(l);
    const uint32_t num = karst_edit_list_num(&l->list);
    karst_edit edit;
    if (!stroke->num_laid)
        l->num_frozen = num;
    if (brush->tool != VIEW_TOOL_SMOOTH)
        karst_edit_list_set_num(&l->list, l->num_frozen);
    view_spot spot = spot_at(l, x_m, z_m, brush->size_m);
    const view_due due = view_stroke_due(stroke, brush, &spot, now_s, VOXEL_LOG2_M);
    if (due == VIEW_DUE_BY_TIME) {
        karst_edit_list_set_num(&l->list, l->num_frozen = num);
        spot = spot_at(l, x_m, z_m, brush->size_m);
    }
    const bool laid = due != VIEW_NOT_DUE && view_stroke_lay(stroke, brush, &spot, now_s, &ground, &edit);
    karst_edit_list_set_num(&l->list, num);
    if (laid)
        assert_ok(karst_edit_list_append(&l->list, &edit, 1, &error));
    return laid;
}

/* A stroke of 10 m along x at 5 m/s, in steps as long as a frame: how many edits that are. */
static int draw_stroke(land *l, const view_brush *brush, double frame_s)
{
    view_stroke stroke = {0};
    int num = 0;
    for (double now_s = 0; now_s <= 2; now_s += frame_s)
        num += touch(l, &stroke, brush, 5 * now_s, 0, now_s);
    return num;
}

static double roughness(land *l, double from_m, double to_m)
{
    double square = 0;
    int num = 0;
    for (double x_m = from_m; x_m <= to_m; x_m += 0.25)
        for (double z_m = -0.5; z_m <= 0.5; z_m += 0.25, num++)
            square += pow(height_at(l, x_m, z_m) - l->slope * x_m, 2);
    return sqrt(square / num);
}

static void planes_are_found(void **state)
{
    (void)state;
    land l = make_land(0.5, 0, 1);
    const view_ground ground = ground_of(&l);
    const view_spot spot = spot_at(&l, 3, 1, 0.5);
    view_spot plane;
    double steepness, way_m[3];
    assert_true(fabs(spot.normal[0] + 0.5 / sqrt(1.25)) < 1e-3 && fabs(spot.normal[1] - 1 / sqrt(1.25)) < 1e-3);
    assert_true(view_fit_plane(&ground, &spot, 2, &plane, &steepness));
    karst_position_difference_m(spot.at, plane.at, VOXEL_LOG2_M, way_m);
    assert_true(sqrt(dot(way_m, way_m)) < 0.02 && dot(plane.normal, spot.normal) > 0.9999);
    assert_true(fabs(steepness - sqrt(1.25)) < 1e-3);
    /* Too little land: a place far above it. */
    const karst_position above = karst_position_add_m(spot.at, (double[3]){0, 50, 0}, VOXEL_LOG2_M);
    assert_false(view_fit_plane(&ground, &(view_spot){.at = above, .normal = {0, 1, 0}}, 2, &plane, &steepness));
    for (int i = 0; i < 1000; i++) {
        double n[3], u[3], v[3], length = 0;
        for (int a = 0; a < 3; a++)
            n[a] = i < 3 ? a == i : random_unit() - 0.5;
        length = sqrt(dot(n, n));
        for (int a = 0; a < 3; a++)
            n[a] /= length;
        view_make_sides(n, u, v);
        assert_true(fabs(dot(n, u)) < 1e-12 && fabs(dot(n, v)) < 1e-12 && fabs(dot(u, v)) < 1e-12);
        assert_true(fabs(dot(u, u) - 1) < 1e-12 && fabs(dot(v, v) - 1) < 1e-12);
    }
    karst_edit_list_finish(&l.list);
}

static void strokes_are_as_dense_as_their_way_is_long(void **state)
{
    (void)state;
    for (int tool = VIEW_TOOL_ADD; tool < VIEW_NUM_TOOLS; tool++) {
        const view_brush brush = {.tool = (view_tool)tool, .size_m = 2, .strength = 0.5};
        const int most = tool == VIEW_TOOL_STAMP ? 4 : 10 / 0.6 + 2, least = tool == VIEW_TOOL_STAMP ? 3 : 12;
        for (int frames = 30; frames <= 240; frames *= 2) {
            land l = make_land(0.1, 0.05, 1);
            const int num = draw_stroke(&l, &brush, 1.0 / frames);
            if (num < least || num > most)
                fail_msg("%s: %d edits at %d frames a second", view_tool_names[tool], num, frames);
            karst_edit_list_finish(&l.list);
        }
    }
    /* Held still for three seconds. */
    for (int tool = VIEW_TOOL_ADD; tool < VIEW_NUM_TOOLS; tool++) {
        const view_brush brush = {.tool = (view_tool)tool, .size_m = 2, .strength = 0.1};
        const bool does_more = tool == VIEW_TOOL_ADD || tool == VIEW_TOOL_DIG || tool == VIEW_TOOL_SMOOTH;
        land l = make_land(0.1, 0.05, 1);
        view_stroke stroke = {0};
        int num = 0;
        for (int frame = 0; frame <= 180; frame++)
            num += touch(&l, &stroke, &brush, 0, 0, frame / 60.0);
        assert_true(does_more ? num >= 11 && num <= 13 : num == 1);
        karst_edit_list_finish(&l.list);
    }
}

static void strokes_have_no_gaps(void **state)
{
    (void)state;
    const double height_m = 0.5 * 2; /* strength times size */
    land added = make_land(0.1, 0, 1), dug = make_land(0.1, 0, 1);
    view_brush brush = {.tool = VIEW_TOOL_ADD, .size_m = 2, .strength = 0.5};
    view_stroke stroke = {0};
    for (double x_m = 0; x_m <= 10; x_m += 2.5) /* of which each two are more than a radius apart */
        touch(&added, &stroke, &brush, x_m, 0, 0);
    brush.tool = VIEW_TOOL_DIG;
    stroke = (view_stroke){0};
    for (double x_m = 0; x_m <= 10; x_m += 2.5)
        touch(&dug, &stroke, &brush, x_m, 0, 0);
    for (double x_m = 0; x_m <= 10; x_m += 0.125) {
        assert_true(fabs(height_at(&added, x_m, 0) - 0.1 * x_m - height_m) < 0.2 * height_m);
        assert_true(fabs(height_at(&dug, x_m, 0) - 0.1 * x_m + height_m) < 0.2 * height_m);
    }
    /* But what lies far apart is not joined. */
    land far = make_land(0, 0, 1);
    brush = (view_brush){.tool = VIEW_TOOL_ADD, .size_m = 1, .strength = 0.5};
    stroke = (view_stroke){0};
    touch(&far, &stroke, &brush, 0, 0, 0);
    touch(&far, &stroke, &brush, 5, 0, 0);
    assert_true(fabs(height_at(&far, 2.5, 0)) < 0.1);
    karst_edit_list_finish(&added.list);
    karst_edit_list_finish(&dug.list);
    karst_edit_list_finish(&far.list);
}

static void smoothing_makes_it_even(void **state)
{
    (void)state;
    double left[3];
    static const double steep[] = {1, 0.1, 10};
    for (int i = 0; i < 3; i++) {
        land l = make_land(0.3, 0.4, steep[i]);
        const view_brush brush = {.tool = VIEW_TOOL_SMOOTH, .size_m = 2, .strength = 0.3};
        const double before = roughness(&l, 2, 8);
        draw_stroke(&l, &brush, 1.0 / 30);
        left[i] = roughness(&l, 2, 8) / before;
        print_message("# a density of %g times metres: %.2f of the roughness is left\n", steep[i], left[i]);
        assert_true(left[i] < 0.5);
        karst_edit_list_finish(&l.list);
    }
    /* Whatever the density's unit is. */
    assert_true(fabs(left[1] - left[0]) < 0.15 && fabs(left[2] - left[0]) < 0.15);
}

static void flattening_makes_a_plane(void **state)
{
    (void)state;
    for (int soft = 0; soft < 2; soft++) {
        land l = make_land(0.3, 0.4, 1);
        const view_brush brush = {.tool = VIEW_TOOL_FLATTEN, .size_m = 2, .strength = soft ? 0.5 : 1};
        const double before = roughness(&l, 2, 8);
        draw_stroke(&l, &brush, 1.0 / 30);
        /* The plane is that of the stroke's begin, of which the bumps take part. */
        double square = 0, slope = height_at(&l, 7, 0) - height_at(&l, 3, 0);
        for (double x_m = 3; x_m <= 7; x_m += 0.25)
            square += pow(height_at(&l, x_m, 0) - height_at(&l, 3, 0) - slope * (x_m - 3) / 4, 2);
        print_message("# flattened: %.3f m off a line, and %.3f m rough before\n", sqrt(square / 17), before);
        assert_true(sqrt(square / 17) < (soft ? 0.5 : 0.2) * before);
        karst_edit_list_finish(&l.list);
    }
}

static void all_that_is_laid_is_an_edit(void **state)
{
    (void)state;
    int num = 0;
    random_state = 5;
    for (int i = 0; i < 3000; i++) {
        const view_brush brush = {.tool = (view_tool)(1 + random_below(VIEW_NUM_TOOLS - 1)),
                                  .size_m = random_magnitude(0.125, 1e5),
                                  .strength = 0.05 * (double)random_between(1, 20),
                                  .paint = (int)random_below(VIEW_NUM_PAINTS),
                                  .stamp = (view_stamp)random_below(VIEW_NUM_STAMPS)};
        land l = make_land(random_unit() - 0.5, 0.1, random_magnitude(0.01, 100));
        const double out_m[3] = {random_magnitude(1, 1e15), -random_magnitude(1, 1e15), random_magnitude(1, 1e15)};
        l.origin = karst_position_add_m(l.origin, out_m, VOXEL_LOG2_M);
        view_stroke stroke = {0};
        const view_ground ground = ground_of(&l);
        for (int k = 0; k < 3; k++) {
            const double aside_m[3] = {k * brush.size_m * random_unit(), k * brush.size_m * (random_unit() - 0.5), 0};
            const karst_position at = karst_position_add_m(l.origin, aside_m, VOXEL_LOG2_M);
            const view_spot spot = view_find_spot(&ground, &at, brush.size_m, (double[3]){0, 0, -1});
            karst_edit edit;
            karst_edit_record record;
            if (!view_stroke_lay(&stroke, &brush, &spot, k, &ground, &edit))
                continue;
            num++;
            assert_ok(karst_edit_record_make(&edit, 1, VOXEL_LOG2_M, &record, &error));
            assert_ok(karst_edit_list_append(&l.list, &edit, 1, &error));
        }
        karst_edit_list_finish(&l.list);
    }
    assert_true(num > 4000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_are_found),
        cmocka_unit_test(strokes_are_as_dense_as_their_way_is_long),
        cmocka_unit_test(strokes_have_no_gaps),
        cmocka_unit_test(smoothing_makes_it_even),
        cmocka_unit_test(flattening_makes_a_plane),
        cmocka_unit_test(all_that_is_laid_is_an_edit),
    };
    return cmocka_run_group_tests_name("stroke", tests, NULL, NULL);
}
