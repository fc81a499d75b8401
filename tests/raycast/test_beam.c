/* Packets that walk in beams leave no trace: hits, pictures, depth, stamps and wishes are those of packets that walk
 * alone, in every byte, at every stage of settling. */
#include "raycast/light/shade.h"
#include "tests/raycast/traces.h"

#define WIDTH 93 /* no whole number of packets or tiles */
#define HEIGHT 61
#define NUM_PIXELS (WIDTH * HEIGHT)
#define NUM_RAYS 1003

/* Casts the rays, or without any the picture. */
static traces trace(const scene *s, karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                    const karst_ray *rays, bool any_hit)
{
    traces t;
    forget_stamps(s);
    t.hits = rays ? cast(s, caster, view, rays, NUM_RAYS, any_hit) : cast_picture(s, caster, view, pinhole);
    for (int i = 0; i < NUM_STAMPS; i++)
        t.stamps[i] = read_stamps(stamp_buffer(s, i));
    return t;
}

/* Rays of all kinds side by side: towards one sun from a slope, scattered ones, idle ones. */
static void make_rays(karst_ray *rays, int num_rays)
{
    uint64_t seed = 11;
    const double sun[3] = {0.36, 0.48, 0.8};
    for (int i = 0; i < num_rays; i++) {
        double origin[3] = {(i / 16 % 16) * 2.0 + next_random(&seed), 2 * next_random(&seed), (i % 16) * 2.0};
        double direction[3] = {sun[0], sun[1], sun[2]};
        if (i > num_rays / 2) {
            random_direction(&seed, direction);
            direction[1] = -fabs(direction[1]) * 0.3;
        }
        rays[i] = make_ray(origin, direction, next_random(&seed) < 0.1 ? -1 : 300);
        rays[i].width = i % 3 ? 0.3f : 1.7f;
        rays[i].cone = 0.01f;
    }
}

typedef struct {
    double yaw_deg, pitch_deg;
    float blend;
} look;

/* Differences between what two kinds of casters leave behind, over all rounds of settling three looks. */
static size_t compare_casters(scene *s, const char *options, const char *other_options, const double eye[3])
{
    static const look looks[] = {{30, -20, 0.25f}, {45, 1, 0.0f}, {0, -90, 0.0625f}}; /* the last: four octants */
    static karst_ray rays[NUM_RAYS];
    karst_caster *caster = open_caster(s, options), *other = open_caster(s, other_options);
    size_t differences = 0;
    uint32_t rounds = 0, num_wanted = 0;
    make_rays(rays, NUM_RAYS);
    for (size_t i = 0; i < sizeof(looks) / sizeof(looks[0]); i++) {
        const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, looks[i].yaw_deg, looks[i].pitch_deg, 400);
        karst_cast_view view = scene_view(s, eye, 1);
        view.blend = looks[i].blend;
        uint32_t served;
        do {
            view.serial = ++rounds;
            for (int kind = 0; kind < 3; kind++) {
                const karst_ray *of = kind ? rays : NULL;
                traces a = trace(s, caster, &view, &pinhole, of, kind == 2);
                traces b = trace(s, other, &view, &pinhole, of, kind == 2);
                differences += count_differences(s, &a, &b, kind ? NUM_RAYS : NUM_PIXELS);
                release(&a);
                release(&b);
            }
            served = scene_serve(s, view.serial);
            num_wanted += served;
        } while (served);
    }
    assert_true(rounds > 6);
    assert_true(num_wanted > 100);
    karst_caster_destroy(caster);
    karst_caster_destroy(other);
    return differences;
}

static const double above_ground[3] = {3.3, 21.1, -7.7};

static void test_beams_leave_no_trace(void **state)
{
    (void)state;
    static const double rod[3] = {10.2, 40.1, 3.5};
    static const double eye[3] = {0.4, 18.2, -11.9}, among_folds[3] = {2.2, 6.3, 1.4};
    scene s = open_scene(bumps, NULL);
    assert_int_equal(compare_casters(&s, "", KARST_CAST_NO_BEAM, above_ground), 0);
    scene_destroy(&s);
    s = open_scene(needle, rod);
    assert_int_equal(compare_casters(&s, "", KARST_CAST_NO_BEAM, eye), 0);
    scene_destroy(&s);
    s = open_scene(folds, NULL);
    assert_int_equal(compare_casters(&s, "", KARST_CAST_NO_BEAM, among_folds), 0);
    scene_destroy(&s);
}

/* Bounds that leave something out would be noticed. */
static void test_narrow_beams_are_noticed(void **state)
{
    (void)state;
    scene s = open_scene(bumps, NULL);
    assert_true(compare_casters(&s, "-DKARST_MUTANT_BEAM", KARST_CAST_NO_BEAM, above_ground) > 0);
    scene_destroy(&s);
}

/* Solid from x = 16 on but for a bubble; coarser voxels know nothing of that, only of a ceiling. */
static double hidden_block(const double p[3], double width, const void *user)
{
    (void)user;
    if (width > 1 || p[0] < 16)
        return p[1] - 28;
    return sqrt((p[0] - 30) * (p[0] - 30) + (p[1] - 14) * (p[1] - 14) + (p[2] - 14) * (p[2] - 14)) - 1.5;
}

/* Rays that come from a stand-in look at the first cell of the next brick, whatever their packet passes of its surface.
 */
static void test_rays_from_a_stand_in_look(void **state)
{
    (void)state;
    const double eye[3] = {2, 8, 8}, before[3] = {8, 8, 8};
    scene s = scene_create(contexts[0], 200, 1200, 1, 1, hidden_block, NULL);
    s.lipschitz = 1000; /* nothing is proven constant */
    scene_build(&s, 0);
    s.nodes[scene_find(&s, before, 0)] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, 0), 0};
    scene_upload(&s);
    karst_caster *caster = open_caster(&s, ""), *alone = open_caster(&s, KARST_CAST_NO_BEAM);
    const karst_pinhole pinhole = {.right = {0, 0, 1},
                                   .up = {0, 1, 0},
                                   .forward = {1, 0, 0},
                                   .half_width = 0.4f,
                                   .half_height = 0.3f,
                                   .t_max = 100,
                                   .cone = 0.004f,
                                   .width_px = WIDTH,
                                   .height_px = HEIGHT};
    karst_cast_view view = scene_view(&s, eye, 1);
    view.serial = 1;
    traces a = trace(&s, caster, &view, &pinhole, NULL, false), b = trace(&s, alone, &view, &pinhole, NULL, false);
    for (int i = 0; i < NUM_PIXELS; i++)
        assert_true(KARST_HIT_KIND(a.hits[i].kind) == KARST_HIT_SURFACE && a.hits[i].t >= 13.99f && a.hits[i].t < 17);
    assert_int_equal(count_differences(&s, &a, &b, NUM_PIXELS), 0);
    release(&a);
    release(&b);
    karst_caster_destroy(caster);
    karst_caster_destroy(alone);
    scene_destroy(&s);
}

/* So would looks a cell ahead of where a ray has ended. */
static void test_looks_too_far_ahead_are_noticed(void **state)
{
    (void)state;
    scene s = open_scene(bumps, NULL);
    assert_true(compare_casters(&s, "-DKARST_MUTANT_AHEAD", "", above_ground) > 0);
    scene_destroy(&s);
}

/* Rays that walk one by one leave the same too; and pictures are made of hits alone. */
static void test_one_lane_leaves_the_same(void **state)
{
    (void)state;
    karst_error error = {0};
    scene s = open_scene(bumps, NULL);
    karst_caster *caster = open_caster(&s, ""), *alone = open_caster(&s, KARST_CAST_NO_BEAM);
    karst_shader *shader = karst_shader_create(contexts[0], false, &error);
    scene_check(shader, &error);
    karst_buffer *hits = scene_buffer(contexts[0], "hits", NUM_PIXELS * sizeof(karst_hit)),
                 *pixels = scene_buffer(contexts[0], "pixels", NUM_PIXELS * 4),
                 *depth = scene_buffer(contexts[0], "depth", NUM_PIXELS * 4),
                 *counters = scene_buffer(contexts[0], "counters", KARST_SHADE_COUNTERS * 4);
    const karst_light light = {.sun_direction = {0.36f, 0.48f, 0.8f},
                               .sun_colour = {1.6f, 1.5f, 1.4f},
                               .sky_zenith = {0.1f, 0.24f, 0.55f},
                               .sky_horizon = {0.3f, 0.35f, 0.4f},
                               .ground_flat = {0.3f, 0.3f, 0.3f},
                               .ground_steep = {0.3f, 0.3f, 0.3f},
                               .haze_distance = 3000};
    const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, 30, -20, 400);
    karst_cast_view view = scene_view(&s, above_ground, 1);
    view.blend = 0.25f;
    static uint32_t rgba[2][NUM_PIXELS];
    static float far[2][NUM_PIXELS];
    for (view.serial = 1;; view.serial++) {
        karst_caster *const casters[2] = {caster, alone};
        for (int i = 0; i < 2; i++)
            scene_check(karst_cast_pinhole(casters[i], &view, &pinhole, hits, &error) &&
                            karst_shade_pixels(shader, &view, &pinhole, &light, hits, NULL, pixels->mem, depth,
                                               counters, &error) &&
                            karst_buffer_read(pixels, 0, rgba[i], sizeof(rgba[i]), &error) &&
                            karst_buffer_read(depth, 0, far[i], sizeof(far[i]), &error),
                        &error);
        assert_memory_equal(rgba[0], rgba[1], sizeof(rgba[0]));
        assert_memory_equal(far[0], far[1], sizeof(far[0]));
        uint32_t served = scene_serve(&s, view.serial);
        if (view.serial == 3 || !served) {
            scene other = scene_clone(contexts[1], 1, &s);
            karst_caster *one_lane = open_caster(&other, "");
            traces a = trace(&s, caster, &view, &pinhole, NULL, false);
            traces b = trace(&other, one_lane, &view, &pinhole, NULL, false);
            assert_int_equal(count_differences(&s, &a, &b, NUM_PIXELS), 0);
            release(&a);
            release(&b);
            karst_caster_destroy(one_lane);
            scene_destroy(&other);
        }
        if (!served)
            break;
    }
    karst_buffer_destroy(hits);
    karst_buffer_destroy(pixels);
    karst_buffer_destroy(depth);
    karst_buffer_destroy(counters);
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    karst_caster_destroy(alone);
    scene_destroy(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_beams_leave_no_trace),
        cmocka_unit_test(test_narrow_beams_are_noticed),
        cmocka_unit_test(test_rays_from_a_stand_in_look),
        cmocka_unit_test(test_looks_too_far_ahead_are_noticed),
        cmocka_unit_test(test_one_lane_leaves_the_same),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
