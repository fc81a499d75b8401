/* Shadow rays that walk in beams leave no trace: dark pixels, stamps and wishes are those of packets that walk alone,
 * in every byte, at every stage of settling, wherever the sun stands. */
#include "raycast/light/shade.h"
#include "tests/raycast/traces.h"

#define WIDTH 93 /* no whole number of packets or beams */
#define HEIGHT 61
#define NUM_PIXELS (WIDTH * HEIGHT)

/* Anywhere, straight above, between two axes; and low, so that rays pass much. */
static const float suns[][3] = {{0.77f, 0.3f, 0.563f},    {0, 1, 0},
                                {0.96f, 0.28f, 0},        {0, 0.28f, 0.96f},
                                {-0.72f, 0.28f, -0.635f}, {-0.1f, 0.05f, 0.9937f}};
#define NUM_SUNS ((int)(sizeof suns / sizeof suns[0]))

static const double above_ground[3] = {3.3, 21.1, -7.7};

typedef struct {
    karst_buffer *hits, *pixels, *depth, *counters, *rays;
    karst_shader *shader;
} picture;

/* Shadows by one caster; the camera's rays are `primary`'s. Returns how many pixels they darkened. */
static uint32_t trace(const scene *s, picture *p, karst_caster *primary, karst_caster *caster,
                      const karst_cast_view *view, const karst_pinhole *pinhole, const karst_light *light,
                      uint32_t *rgba, traces *t)
{
    static uint32_t sunny[NUM_PIXELS];
    karst_error error = {0};
    scene_check(karst_cast_pinhole(primary, view, pinhole, p->hits, &error) &&
                    karst_shade_pixels(p->shader, view, pinhole, light, p->hits, p->rays, p->pixels->mem, p->depth,
                                       p->counters, &error) &&
                    karst_buffer_read(p->pixels, 0, sunny, sizeof sunny, &error),
                &error);
    forget_stamps(s);
    scene_check(karst_cast_shadows(caster, view, pinhole, light, p->rays, p->pixels->mem, &error) &&
                    karst_buffer_read(p->pixels, 0, rgba, sizeof sunny, &error),
                &error);
    t->hits = NULL;
    for (int i = 0; i < NUM_STAMPS; i++)
        t->stamps[i] = read_stamps(stamp_buffer(s, i));
    uint32_t num_dark = 0;
    for (int i = 0; i < NUM_PIXELS; i++)
        num_dark += rgba[i] != sunny[i];
    return num_dark;
}

/* Differences between what two kinds of casters leave behind, over all rounds of settling. */
static size_t compare_casters(const char *options, const char *other_options)
{
    static uint32_t rgba[2][NUM_PIXELS];
    karst_error error = {0};
    scene s = open_scene(bumps, NULL);
    karst_caster *caster = open_caster(&s, options), *other = open_caster(&s, other_options);
    picture p = {.hits = scene_buffer(contexts[0], "hits", NUM_PIXELS * sizeof(karst_hit)),
                 .pixels = scene_buffer(contexts[0], "pixels", NUM_PIXELS * 4),
                 .depth = scene_buffer(contexts[0], "depth", NUM_PIXELS * 4),
                 .counters = scene_buffer(contexts[0], "counters", KARST_SHADE_COUNTERS * 4),
                 .rays = scene_buffer(contexts[0], "rays", karst_cast_shadow_bytes(WIDTH, HEIGHT)),
                 .shader = karst_shader_create(contexts[0], true, &error)};
    scene_check(p.shader, &error);
    const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, 40, -20, 400);
    karst_cast_view view = scene_view(&s, above_ground, 1);
    view.blend = 0.0625f;
    view.serial = 0;
    size_t differences = 0;
    uint32_t num_dark, served;
    do {
        num_dark = served = 0;
        for (int i = 0; i < NUM_SUNS; i++) {
            karst_light light = {.sun_colour = {1.6f, 1.5f, 1.4f},
                                 .sky_zenith = {0.1f, 0.24f, 0.55f},
                                 .sky_horizon = {0.3f, 0.35f, 0.4f},
                                 .ground_flat = {0.3f, 0.3f, 0.3f},
                                 .ground_steep = {0.3f, 0.3f, 0.3f},
                                 .haze_distance = 3000,
                                 .shadow_distance = 200};
            memcpy(light.sun_direction, suns[i], sizeof suns[i]);
            traces a, b;
            view.serial++;
            trace(&s, &p, caster, caster, &view, &pinhole, &light, rgba[0], &a);
            num_dark += trace(&s, &p, caster, other, &view, &pinhole, &light, rgba[1], &b);
            for (int k = 0; k < NUM_PIXELS; k++)
                differences += rgba[0][k] != rgba[1][k];
            differences += count_differences(&s, &a, &b, 0);
            release(&a);
            release(&b);
            scene_check(karst_cast_pinhole(caster, &view, &pinhole, p.hits, &error), &error); /* it wants more */
            served += scene_serve(&s, view.serial);
        }
    } while (served);
    assert_true(view.serial > 3 * NUM_SUNS);
    assert_true(num_dark > 150);
    karst_buffer *const buffers[] = {p.hits, p.pixels, p.depth, p.counters, p.rays};
    for (size_t i = 0; i < sizeof buffers / sizeof buffers[0]; i++)
        karst_buffer_destroy(buffers[i]);
    karst_shader_destroy(p.shader);
    karst_caster_destroy(caster);
    karst_caster_destroy(other);
    scene_destroy(&s);
    return differences;
}

static void test_beams_to_the_sun_leave_no_trace(void **state)
{
    (void)state;
    assert_int_equal(compare_casters("", KARST_CAST_NO_BEAM), 0);
}

/* Bounds that leave something out would be noticed. */
static void test_narrow_beams_to_the_sun_are_noticed(void **state)
{
    (void)state;
    assert_true(compare_casters("-DKARST_MUTANT_ACROSS", KARST_CAST_NO_BEAM) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_beams_to_the_sun_leave_no_trace),
        cmocka_unit_test(test_narrow_beams_to_the_sun_are_noticed),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
