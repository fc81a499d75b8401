/* What a cast finds: closed forms, the interpolant itself, and the hard cases. */
#include "tests/raycast/casting.h"

static scene make_scene(karst_context *context, int top_level, scene_density density, const void *user)
{
    scene s = scene_create(context, 3000, 6000, 1, top_level, density, user);
    scene_build(&s, 0);
    return s;
}

static void ball_by_closed_form(void **state)
{
    (void)state;
    const double c[4] = {11.3, -7.2, 3.9, 60.4}, eye[3] = {0, 0, 0}, anchor[3] = {-100.25, 40.5, 33.125};
    for (int k = 0; k < 2; k++) {
        scene s = make_scene(contexts[k], 3, ball, c);
        karst_caster *caster = open_caster(&s, "");
        karst_cast_view view = scene_view(&s, anchor, 1);
        enum { N = 1000 };
        karst_ray rays[N];
        uint64_t random = 1;
        for (int i = 0; i < N; i++) {
            double d[3], length = 0;
            for (int a = 0; a < 3; a++) {
                d[a] = c[a] + (next_random(&random) * 2 - 1) * 75 - anchor[a];
                length += d[a] * d[a];
            }
            for (int a = 0; a < 3; a++)
                d[a] /= sqrt(length);
            rays[i] = make_ray(eye, d, 1000);
        }
        karst_hit *hits = cast(&s, caster, &view, rays, N, false);
        int num_hits = 0;
        for (int i = 0; i < N; i++) {
            double b = 0, q = -c[3] * c[3];
            for (int a = 0; a < 3; a++) {
                b += (anchor[a] - c[a]) * rays[i].direction[a];
                q += (anchor[a] - c[a]) * (anchor[a] - c[a]);
            }
            double h = b * b - q;
            if (fabs(h) < 40)
                continue; /* grazing: the interpolant is not quite the ball */
            if (h < 0) {
                assert_int_equal(KARST_HIT_KIND(hits[i].kind), KARST_HIT_MISS);
                assert_float_equal(hits[i].t, 1000, 0);
                continue;
            }
            num_hits++;
            assert_int_equal(KARST_HIT_KIND(hits[i].kind), KARST_HIT_SURFACE);
            assert_int_equal(KARST_HIT_LEVEL(hits[i].kind), 0);
            assert_true(fabs(hits[i].t - (-b - sqrt(h))) < 0.05);
            /* Cell and position say the same place, and the brick is its node's. */
            int64_t n[3];
            int level;
            scene_node_place(&s, hits[i].node, n, &level);
            assert_int_equal(s.nodes[hits[i].node].brick, hits[i].brick);
            for (int a = 0; a < 3; a++) {
                double at = (double)n[a] * 16 + ((hits[i].place >> (10 * a) & 1023) + 0.5) / 64;
                assert_true(fabs(at - (anchor[a] + rays[i].direction[a] * (double)hits[i].t)) < 0.5 / 64 + 1e-3);
            }
        }
        assert_true(num_hits > 300);
        free(hits);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* Rays of all kinds against one scene; the count of those that disagree with the reference. */
static int disagreements(const scene *s, karst_caster *caster, int num_rays, uint64_t seed)
{
    const double anchor[3] = {3, -5, 2};
    karst_cast_view view = scene_view(s, anchor, 1);
    karst_ray *rays = malloc((size_t)num_rays * sizeof(*rays));
    for (int i = 0; i < num_rays; i++) {
        double d[3], o[3];
        random_direction(&seed, d);
        for (int a = 0; a < 3; a++)
            o[a] = (next_random(&seed) - 0.5) * 90;
        int special = (int)(next_random(&seed) * 8);
        int axis = (int)(next_random(&seed) * 3), other = (axis + 1) % 3;
        if (special == 0) /* along an axis */
            d[axis] = d[axis] < 0 ? -1 : 1, d[other] = d[(axis + 2) % 3] = next_random(&seed) < 0.5 ? 0.0 : -0.0;
        if (special == 1) /* in a plane, with a component too small to matter */
            d[axis] = next_random(&seed) < 0.5 ? 1e-41 : -3e-39;
        if (special == 2) /* along an axis, in the plane between two cells or nodes */
            d[axis] = 1, d[other] = d[(axis + 2) % 3] = 0, o[other] = floor(o[other] / 16) * 16 - anchor[other];
        if (special == 3) /* diagonally through the edges of cells */
            for (int a = 0; a < 3; a++)
                o[a] = floor(o[a]), d[a] = a == axis ? 0 : d[a] < 0 ? -0.70710678 : 0.70710678;
        if (special == 4) /* through the corners of nodes */
            for (int a = 0; a < 3; a++)
                o[a] = floor(o[a] / 16) * 16 - anchor[a], d[a] = d[a] < 0 ? -0.57735027 : 0.57735027;
        rays[i] = make_ray(o, d, 60 + 60 * next_random(&seed));
    }
    karst_hit *hits = cast(s, caster, &view, rays, (uint32_t)num_rays, false);
    int bad = 0;
    for (int i = 0; i < num_rays; i++)
        if (!hit_agrees(s, anchor, &rays[i], &hits[i])) {
            bad++;
            if (getenv("KARST_TEST_VERBOSE"))
                fprintf(stderr, "ray %d from (%a %a %a) along (%a %a %a): kind %u t %g, reference %g\n", i,
                        rays[i].origin[0], rays[i].origin[1], rays[i].origin[2], rays[i].direction[0],
                        rays[i].direction[1], rays[i].direction[2], hits[i].kind, hits[i].t,
                        reference(s, anchor, &rays[i], 1e30));
        }
    free(rays);
    free(hits);
    return bad;
}

static const double thin_plate[5] = {0.48, 0.64, 0.6, 7.3, 1};
static const double flat_plate[5] = {0, 1, 0, 4.3, 1};
static const double thin_needle[3] = {4.4, 5.7, 0.75};
static const double small_ball[4] = {6.3, 4.6, -2.4, 1};

static void every_surface_is_found(void **state)
{
    (void)state;
    const struct {
        scene_density density;
        const void *user;
        int num_rays;
    } cases[] = {{ball, (double[]){2, 1, -3, 30}, 300},
                 {plate, thin_plate, 300},
                 {plate, flat_plate, 200},
                 {needle, thin_needle, 200},
                 {ball, small_ball, 200},
                 {folds, NULL, 600}};
    for (int k = 0; k < 2; k++)
        for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
            scene s = make_scene(contexts[k], 2, cases[i].density, cases[i].user);
            karst_caster *caster = open_caster(&s, "");
            assert_int_equal(disagreements(&s, caster, cases[i].num_rays, i + 10), 0);
            karst_caster_destroy(caster);
            scene_destroy(&s);
        }
}

/* The same test must notice a safe step that is twice too long. */
static void a_mutant_is_caught(void **state)
{
    (void)state;
    scene s = make_scene(contexts[0], 2, plate, thin_plate);
    karst_caster *caster = open_caster(&s, "-DKARST_SAFE_STEP_SHARE=2.0f");
    assert_true(disagreements(&s, caster, 300, 11) > 0);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

/* Small things right in front of a fan of rays: none slips through. */
static void thin_things_are_seen(void **state)
{
    (void)state;
    const double c[4] = {0.3, 0.4, 0.1, 1}, rod[3] = {0.3, 0.1, 0.75}, sheet[5] = {0, 1, 0, 0.7, 1},
                 anchor[3] = {-40.3, 23.7, -35.2};
    const struct {
        scene_density density;
        const void *user;
        double margin; /* how far from the middle rays still must hit */
    } cases[] = {{ball, c, 0.4}, {needle, rod, 0.4}, {plate, sheet, 20}};
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 3; i++) {
            scene s = make_scene(contexts[k], 2, cases[i].density, cases[i].user);
            karst_caster *caster = open_caster(&s, "");
            karst_cast_view view = scene_view(&s, anchor, 1);
            enum { N = 800 };
            karst_ray rays[N];
            uint64_t random = 5;
            for (int r = 0; r < N; r++) {
                double d[3], length = 0, o[3] = {0, 0, 0};
                for (int a = 0; a < 3; a++) {
                    double at = (i == 0 ? c[a] : i == 1 ? (double[]){rod[0], 0, rod[1]}[a] : (double[]){0, 0.2, 0}[a]);
                    double reach = i == 1   ? (a == 1 ? 20 : cases[i].margin)
                                   : i == 2 ? (a == 1 ? 0 : cases[i].margin)
                                            : cases[i].margin;
                    d[a] = at + reach * (2 * next_random(&random) - 1) - anchor[a];
                    length += d[a] * d[a];
                }
                for (int a = 0; a < 3; a++)
                    d[a] /= sqrt(length);
                rays[r] = make_ray(o, d, 200);
            }
            karst_hit *hits = cast(&s, caster, &view, rays, N, false);
            for (int r = 0; r < N; r++)
                assert_int_equal(KARST_HIT_KIND(hits[r].kind), KARST_HIT_SURFACE);
            free(hits);
            karst_caster_destroy(caster);
            scene_destroy(&s);
        }
}

/* Rays that start in solid, on its surface, beyond it, or end before it. */
static void starts_and_ends(void **state)
{
    (void)state;
    const double ground[5] = {0, 1, 0, 0.5, 0}, anchor[3] = {0.25, 0.5, 0.75}, zero[3] = {0};
    const double down[3] = {0, -1, 0}, up[3] = {0, 1, 0}, along[3] = {1, 0, 0};
    for (int k = 0; k < 2; k++) {
        scene s = make_scene(contexts[k], 2, plate, ground);
        karst_caster *caster = open_caster(&s, "");
        karst_cast_view view = scene_view(&s, anchor, 1);
        const double below[3] = {0, -3, 0}, deep[3] = {0, -50, 0}, above[3] = {0, 10, 0};
        karst_ray rays[] = {
            make_ray(below, up, 50),    /* 0: in a solid cell of a brick, or a solid node: at once */
            make_ray(deep, up, 50),     /* 1: in a solid node */
            make_ray(above, down, 50),  /* 2: 10 voxels down */
            make_ray(above, down, 9),   /* 3: ends before */
            make_ray(above, down, 50),  /* 4: starts behind the surface */
            make_ray(zero, up, 50),     /* 5: on the surface, looking away */
            make_ray(above, along, 50), /* 6: past it */
            make_ray(above, down, 0),   /* 7: idle */
            make_ray(above, down, 10.5f),
        };
        rays[4].t_min = 12;
        const int n = sizeof(rays) / sizeof(rays[0]);
        karst_hit *hits = cast(&s, caster, &view, rays, (uint32_t)n, false);
        assert_int_not_equal(KARST_HIT_KIND(hits[0].kind), KARST_HIT_MISS);
        assert_true(hits[0].t == 0);
        assert_int_equal(KARST_HIT_KIND(hits[1].kind), KARST_HIT_SOLID);
        assert_true(hits[1].t == 0);
        assert_int_equal(KARST_HIT_KIND(hits[2].kind), KARST_HIT_SURFACE);
        assert_true(fabs(hits[2].t - 10) < 1e-3);
        assert_int_equal(KARST_HIT_KIND(hits[3].kind), KARST_HIT_MISS);
        assert_true(hits[3].t == 9);
        assert_int_not_equal(KARST_HIT_KIND(hits[4].kind), KARST_HIT_MISS);
        assert_true(hits[4].t == 12);
        assert_true(KARST_HIT_KIND(hits[5].kind) == KARST_HIT_MISS || hits[5].t < 1e-3f);
        assert_int_equal(KARST_HIT_KIND(hits[6].kind), KARST_HIT_MISS);
        assert_int_equal(KARST_HIT_KIND(hits[7].kind), KARST_HIT_MISS);
        assert_int_equal(KARST_HIT_KIND(hits[8].kind), KARST_HIT_SURFACE);
        free(hits);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* Shadow casts answer the same question. */
static void any_hit_agrees(void **state)
{
    (void)state;
    const double anchor[3] = {0.5, 0.5, 0.5};
    scene s = make_scene(contexts[0], 2, folds, NULL);
    karst_caster *caster = open_caster(&s, "");
    karst_cast_view view = scene_view(&s, anchor, 1);
    enum { N = 500 };
    karst_ray rays[N];
    uint64_t random = 77;
    for (int i = 0; i < N; i++) {
        double d[3], o[3];
        random_direction(&random, d);
        for (int a = 0; a < 3; a++)
            o[a] = (next_random(&random) - 0.5) * 80;
        rays[i] = make_ray(o, d, 3);
    }
    karst_hit *hits = cast(&s, caster, &view, rays, N, false), *any = cast(&s, caster, &view, rays, N, true);
    int found = 0;
    for (int i = 0; i < N; i++) {
        assert_int_equal(hits[i].kind, any[i].kind);
        for (int axis = 0; axis < 3; axis++)
            assert_int_equal(KARST_HIT_CELL(hits[i].place, axis), KARST_HIT_CELL(any[i].place, axis));
        assert_true(any[i].t <= hits[i].t);
        found += KARST_HIT_KIND(hits[i].kind) != KARST_HIT_MISS;
    }
    assert_in_range(found, 50, N - 50);
    /* Where only that is wanted, of as many as a word says. */
    karst_error error = {0};
    const uint32_t num = N - 7, untouched = 99;
    uint32_t marks[N];
    karst_buffer *in = karst_buffer_create(s.context, "rays", sizeof rays, rays, &error),
                 *count = karst_buffer_create(s.context, "count", sizeof num, &num, &error),
                 *out = scene_buffer(s.context, "marks", sizeof marks);
    scene_check(karst_buffer_fill(out, untouched, 0, sizeof marks, &error), &error);
    scene_check(karst_cast_stream_marks(caster, &view, in, N, count, out, &error), &error);
    scene_check(karst_buffer_read(out, 0, marks, sizeof marks, &error), &error);
    for (uint32_t i = 0; i < N; i++)
        assert_int_equal(marks[i], i < num ? KARST_HIT_KIND(hits[i].kind) != KARST_HIT_MISS : untouched);
    karst_buffer_destroy(in);
    karst_buffer_destroy(count);
    karst_buffer_destroy(out);
    free(hits);
    free(any);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ball_by_closed_form), cmocka_unit_test(every_surface_is_found),
        cmocka_unit_test(a_mutant_is_caught),  cmocka_unit_test(thin_things_are_seen),
        cmocka_unit_test(starts_and_ends),     cmocka_unit_test(any_hit_agrees),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
