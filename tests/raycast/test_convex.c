/* Convex bodies cast no shadow on themselves: curved ones nowhere. Along edges of a box, where normals are blended from
 * two faces, a few pixels in ten thousand still do. */
#include "raycast/light/shade.h"
#include "tests/raycast/casting.h"

enum { SIDE = 96, NUM = SIDE * SIDE, BOX = 3 };

/* The shapes are turned, so that no axis is special. */
static void turn(const double p[3], double q[3])
{
    const double a = 0.7, b = 0.45;
    const double x = cos(a) * p[0] - sin(a) * p[2], z = sin(a) * p[0] + cos(a) * p[2];
    q[0] = x;
    q[1] = cos(b) * p[1] - sin(b) * z;
    q[2] = sin(b) * p[1] + cos(b) * z;
}

static double length3(double x, double y, double z) { return sqrt(x * x + y * y + z * z); }

static double body(const double p[3], double width, const void *user)
{
    double q[3];
    (void)width;
    turn(p, q);
    const double across = hypot(q[0], q[2]);
    switch (*(const int *)user) {
    case 0:
        return 40 - length3(q[0], q[1], q[2]);
    case 1: { /* an ellipsoid, of slope 1 at most */
        const double k = length3(q[0] / 45, q[1] / 25, q[2] / 33);
        return 25 * (1 - k);
    }
    case 2: /* a capsule */
        return 18 - length3(q[0], q[1] - fmax(-25, fmin(25, q[1])), q[2]);
    case 3: /* a box */
        return -fmax(fmax(fabs(q[0]) - 28, fabs(q[1]) - 20), fabs(q[2]) - 35);
    default: /* a cone, its tip up */
        return fmin((30 - q[1] - 1.6 * across) / hypot(1, 1.6), q[1] + 30);
    }
}

static const char *const names[] = {"sphere", "ellipsoid", "capsule", "box", "cone"};

static double run(karst_context *context, int shape, double distance, float detail, int num_suns)
{
    karst_error error = {0};
    scene s = scene_create(context, 3000, 6000, 1, 4, body, &shape);
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
    int num = 0, num_hits = 0, num_lit = 0;
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
        scene_check(karst_shade_pixels(shader, &view, &pinhole, &light, hits, rays, pixels->mem, depth, counters,
                                       &error) &&
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
                    num++;
                    worst = fmax(worst, nl);
                }
            }
    }
    print_message("%-9s at %3.0f, detail %g: %d of %d lit pixels in their own shadow, n.l up to %.3f\n", names[shape],
                  distance, (double)detail, num, num_lit, worst);
    assert_true(num_hits > 300 && num_lit > 1000);
    karst_buffer *const all[] = {hits, rays, pixels, depth, counters};
    for (int i = 0; i < 5; i++)
        karst_buffer_destroy(all[i]);
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    scene_destroy(&s);
    return num / (double)num_lit;
}

static void convex_bodies_cast_no_shadow_on_themselves(void **state)
{
    (void)state;
    for (int shape = 0; shape < 5; shape++)
        for (int i = 0; i < 3; i++) {
            const double share = run(contexts[0], shape, (const double[]){70, 100, 150}[i], (const float[]){1, 2, 4}[i],
                                     getenv("KARST_TEST_FULL") ? 200 : 20);
            assert_true(shape == BOX ? share < 1e-3 : share == 0);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(convex_bodies_cast_no_shadow_on_themselves)};
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
