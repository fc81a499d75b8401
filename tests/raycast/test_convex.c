/* Convex bodies cast no shadow on themselves: curved ones nowhere. Along sharp edges the normals of what interpolates
 * samples are mixed from both faces, and a few pixels in ten thousand are lit by them whose own face is turned away
 * from the sun: these are dark, as they should be. */
#include "raycast/light/shade.h"
#include "tests/raycast/casting.h"
#include "tests/raycast/convex_bodies.h"

enum { SIDE = 96, NUM = SIDE * SIDE };

/* Where the ray through the middle of a pixel is at t. */
static void pixel_point(const karst_pinhole *h, const double eye[3], uint32_t x, uint32_t y, double t, double p[3])
{
    const double across = ((x + 0.5) * 2 / h->width_px - 1) * (double)h->half_width,
                 up = (1 - (y + 0.5) * 2 / h->height_px) * (double)h->half_height;
    const double scale = t / length3(across, up, 1);
    for (int a = 0; a < 3; a++)
        p[a] = eye[a] + scale * (across * (double)h->right[a] + up * (double)h->up[a] + (double)h->forward[a]);
}

/* Of the lit pixels those that are wrongly dark. *turned_away: dark ones whose own face is not lit. */
static int run(karst_context *context, int shape, double distance, float detail, int num_suns, double *turned_away)
{
    karst_error error = {0};
    scene s = scene_create(context, 3000, 6000, 1, 4, convex_body, &shape);
    scene_build(&s, 0);
    scene_upload(&s);
    karst_caster *caster = open_caster(&s, "");
    karst_shader *shader = karst_shader_create(s.context, KARST_SHADE_SHADOWS, &error);
    const double eye[3] = {-0.6 * distance, 0.35 * distance, -0.72 * distance};
    karst_cast_view view = scene_view(&s, eye, detail);
    karst_pinhole pinhole = make_pinhole(SIDE, SIDE, 39.8, -20.5, 400);
    karst_buffer *hits = scene_buffer(s.context, "hits", NUM * sizeof(karst_hit));
    karst_buffer *rays = scene_buffer(s.context, "rays", karst_cast_shadow_bytes(SIDE, SIDE));
    karst_buffer *pixels = scene_buffer(s.context, "pixels", NUM * 4);
    karst_buffer *depth = scene_buffer(s.context, "depth", NUM * 4);
    karst_buffer *counters = scene_buffer(s.context, "counters", KARST_SHADE_COUNTERS * 4);
    static karst_hit hit[NUM];
    static uint32_t sunny[NUM], dark[NUM];
    uint64_t random = 99;
    int num = 0, num_hits = 0, num_lit = 0, num_turned = 0;
    double worst = 0;
    scene_check(karst_cast_pinhole(caster, &view, &pinhole, hits, &error) &&
                    karst_buffer_read(hits, 0, hit, sizeof hit, &error),
                &error);
    for (int sun = 0; sun < num_suns; sun++) {
        double d[3];
        random_direction(&random, d);
        karst_light light = {.sun_direction = {(float)d[0], (float)d[1], (float)d[2]},
                             .sun_colour = {3, 3, 3},
                             .ground_flat = {0.5f, 0.5f, 0.5f},
                             .ground_steep = {0.5f, 0.5f, 0.5f},
                             .haze_distance = 1e9f,
                             .shadow_distance = 400};
        scene_check(
            karst_shade_pixels(shader, &view, &pinhole, &light, hits, rays, pixels->mem, depth, counters, &error) &&
                karst_buffer_read(pixels, 0, sunny, sizeof sunny, &error) &&
                karst_cast_shadows(caster, &view, &pinhole, &light, rays, pixels->mem, &error) &&
                karst_buffer_read(pixels, 0, dark, sizeof dark, &error),
            &error);
        num_hits = 0;
        for (uint32_t y = 0; y < SIDE; y++)
            for (uint32_t x = 0; x < SIDE; x++) {
                const karst_hit *h = &hit[karst_packet_order(x, y, SIDE, SIDE)];
                if (KARST_HIT_KIND(h->kind) == KARST_HIT_MISS)
                    continue;
                num_hits++;
                const double nl =
                    (double)h->normal[0] * d[0] + (double)h->normal[1] * d[1] + (double)h->normal[2] * d[2];
                num_lit += nl > 0.02;
                if (nl > 0.02 && dark[y * SIDE + x] != sunny[y * SIDE + x]) {
                    double p[3];
                    pixel_point(&pinhole, eye, x, y, (double)h->t, p);
                    const bool turned = is_turned_away(p, d, shape);
                    num += !turned;
                    num_turned += turned;
                    worst = fmax(worst, turned ? 0 : nl);
                }
            }
    }
    print_message("%-9s at %3.0f, detail %g: %d of %d lit pixels in their own shadow, n.l up to %.3f; %d turned away\n",
                  convex_names[shape], distance, (double)detail, num, num_lit, worst, num_turned);
    assert_true(num_hits > 300 && num_lit > 1000);
    karst_buffer *const all[] = {hits, rays, pixels, depth, counters};
    for (int i = 0; i < 5; i++)
        karst_buffer_destroy(all[i]);
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    scene_destroy(&s);
    *turned_away = num_turned / (double)num_lit;
    return num;
}

static void convex_bodies_cast_no_shadow_on_themselves(void **state)
{
    (void)state;
    for (int shape = 0; shape < NUM_CONVEX; shape++)
        for (int i = 0; i < 3; i++) {
            double turned_away;
            const int num = run(contexts[0], shape, (const double[]){70, 100, 150}[i], (const float[]){1, 2, 4}[i],
                                getenv("KARST_TEST_FULL") ? 200 : 20, &turned_away);
            assert_int_equal(num, 0);
            assert_true(turned_away < 1e-3);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(convex_bodies_cast_no_shadow_on_themselves)};
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
