/* Rays that start on a surface, or in matter, and say which side they are on: what they leave does not stop them, and
 * they find the other side. Those in matter do not look where a brick's masks say that it is solid, and hit the same.
 */
#include "tests/raycast/traces.h"

enum { NUM = 4000 };
#define RADIUS 40.0
#define FAR_X 90.0
#define FAR_RADIUS 20.0

/* Two balls. */
static double balls(const double p[3], double width, const void *user)
{
    (void)width;
    (void)user;
    const double near = RADIUS - sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    const double x = p[0] - FAR_X;
    return fmax(near, FAR_RADIUS - sqrt(x * x + p[1] * p[1] + p[2] * p[2]));
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* The share of a step from the centre of the far ball's that a ray passes it by, or where it enters it. */
static double entry_of_far_ball(const double o[3], const double d[3], double *past)
{
    const double to[3] = {FAR_X - o[0], -o[1], -o[2]}, along = dot(to, d);
    *past = along > 0 ? sqrt(fmax(0, dot(to, to) - along * along)) - FAR_RADIUS : FAR_RADIUS;
    return *past < 0 ? along - sqrt(FAR_RADIUS * FAR_RADIUS - (dot(to, to) - along * along)) : INFINITY;
}

typedef struct {
    karst_ray rays[NUM];
    double cosine[NUM], origin[NUM][3], direction[NUM][3];
} starts;

/* On the near ball, as far off its surface as `off` at most: outwards, or inwards. */
static void make_starts(starts *s, uint32_t side, double sign, double off)
{
    uint64_t random = 5;
    for (int i = 0; i < NUM; i++) {
        double n[3], d[3];
        do {
            random_direction(&random, n);
            random_direction(&random, d);
            s->cosine[i] = dot(n, d);
        } while (sign * s->cosine[i] < 0.02);
        const double from = RADIUS + off * (2 * next_random(&random) - 1);
        for (int a = 0; a < 3; a++) {
            s->origin[i][a] = n[a] * from;
            s->direction[i][a] = d[a];
        }
        s->rays[i] = make_ray(s->origin[i], d, 400);
        s->rays[i].side = side;
        s->rays[i].width = i % 3 ? 1.0f : 2.5f;
        s->rays[i].cone = i & 1 ? 0.01f : 0;
    }
}

static starts now;

/* The hits of both shapes of kernels, which are the same. */
static karst_hit *cast_both(const scene s[2], karst_caster *const casters[2])
{
    static uint32_t serial;
    const double at[3] = {0, 0, 0};
    karst_hit *hits[2];
    serial++;
    for (int k = 0; k < 2; k++) {
        karst_cast_view view = scene_view(&s[k], at, 1);
        view.serial = serial;
        hits[k] = cast(&s[k], casters[k], &view, now.rays, NUM, false);
    }
    assert_memory_equal(hits[0], hits[1], NUM * sizeof(karst_hit));
    free(hits[1]);
    return hits[0];
}

static void rays_find_the_side_that_they_expect(void **state)
{
    (void)state;
    scene s[2];
    karst_caster *casters[2];
    for (int k = 0; k < 2; k++) {
        s[k] = scene_create(contexts[k], 3000, 6000, 1, 4, balls, NULL);
        scene_build(&s[k], 0);
        scene_upload(&s[k]);
        casters[k] = open_caster(&s[k], "");
    }
    const float offs[] = {0, 1e-4f, 0.4f};
    for (int i = 0; i < 3; i++) {
        int num_self[2] = {0, 0}, num_far = 0;
        /* Outwards: nothing but the far ball. Rays that say nothing are stopped by rounding. */
        for (uint32_t side = KARST_SIDE_ANY; side <= KARST_SIDE_FRONT; side++) {
            make_starts(&now, side, 1, (double)offs[i]);
            karst_hit *hits = cast_both(s, casters);
            for (int j = 0; j < NUM; j++) {
                double past;
                const double entry = entry_of_far_ball(now.origin[j], now.direction[j], &past);
                const bool is_hit = KARST_HIT_KIND(hits[j].kind) != KARST_HIT_MISS;
                if (now.cosine[j] < 2 * (double)offs[i]) /* which is in matter for cells, and ends there */
                    continue;
                num_self[side] += is_hit && hits[j].t < 4;
                if (side == KARST_SIDE_FRONT && fabs(past) > 0.5) {
                    assert_true(is_hit == (past < 0));
                    if (is_hit && past < -2)
                        assert_true(fabs((double)hits[j].t - entry) < 0.8);
                    num_far += is_hit;
                }
            }
            free(hits);
        }
        print_message("off by %g: of %d rays outwards %d are stopped at once, %d with a side; %d meet the other ball\n",
                      (double)offs[i], NUM, num_self[KARST_SIDE_ANY], num_self[KARST_SIDE_FRONT], num_far);
        assert_int_equal(num_self[KARST_SIDE_FRONT], 0);
        assert_true(num_far > 5);
        if (offs[i] > 0.1f)
            assert_true(num_self[KARST_SIDE_ANY] > NUM / 20);

        /* Inwards: the ball's back, with its normal outwards. */
        make_starts(&now, KARST_SIDE_BACK, -1, (double)offs[i]);
        karst_hit *hits = cast_both(s, casters);
        double worst = 0;
        for (int j = 0; j < NUM; j++) {
            if (-now.cosine[j] < 2 * (double)offs[i])
                continue;
            assert_int_equal(KARST_HIT_KIND(hits[j].kind), KARST_HIT_SURFACE);
            const double from = sqrt(dot(now.origin[j], now.origin[j])), c = -now.cosine[j] * from;
            const double exit = c + sqrt(c * c + RADIUS * RADIUS - from * from);
            if (-now.cosine[j] > 0.1)
                worst = fmax(worst, fabs((double)hits[j].t - exit));
            const double d[3] = {(double)hits[j].normal[0], (double)hits[j].normal[1], (double)hits[j].normal[2]};
            assert_true(dot(d, now.direction[j]) > 0 || -now.cosine[j] < 0.1);
        }
        print_message("  backs are off by %.3f voxels at most\n", worst);
        assert_true(worst < 0.8);
        free(hits);

        /* Inwards, but looking for the front: matter stops them within a few cells. */
        make_starts(&now, KARST_SIDE_FRONT, -1, (double)offs[i]);
        hits = cast_both(s, casters);
        for (int j = 0; j < NUM; j++)
            if (-now.cosine[j] > 0.3)
                assert_true(KARST_HIT_KIND(hits[j].kind) != KARST_HIT_MISS && hits[j].t < 12);
        free(hits);
    }
    for (int k = 0; k < 2; k++) {
        karst_caster_destroy(casters[k]);
        scene_destroy(&s[k]);
    }
}

/* Rays of every side and direction among folds, whose levels change on their way. */
static void make_mixed(starts *s)
{
    uint64_t random = 23;
    for (int i = 0; i < NUM; i++) {
        double d[3];
        random_direction(&random, d);
        for (int a = 0; a < 3; a++)
            s->origin[i][a] = 40 * next_random(&random) - 20;
        s->rays[i] = make_ray(s->origin[i], d, next_random(&random) < 0.1 ? -1 : 200);
        s->rays[i].side = (uint32_t)i % 3;
        s->rays[i].width = i % 4 ? 1.0f : 2.5f;
        s->rays[i].cone = i & 1 ? 0.02f : 0.2f;
    }
}

/* Hits that differ between casters of those options, in all rounds of settling. */
static int count_other_hits(const char *options, const char *other_options)
{
    const double at[3] = {0.3, -0.2, 0.1};
    scene s = open_scene(folds, NULL);
    karst_caster *casters[2] = {open_caster(&s, options), open_caster(&s, other_options)};
    int num_other = 0, num_hits = 0;
    uint32_t served = 1, serial = 1;
    make_mixed(&now);
    for (; served; serial++) {
        karst_hit *hits[2];
        for (int k = 0; k < 2; k++) {
            karst_cast_view view = scene_view(&s, at, 1);
            view.serial = serial;
            view.blend = 0.25f;
            view.blend_below = 0.1f; /* some blend, some do not */
            hits[k] = cast(&s, casters[k], &view, now.rays, NUM, false);
        }
        for (int i = 0; i < NUM; i++) {
            num_other += memcmp(&hits[0][i], &hits[1][i], sizeof(karst_hit)) != 0;
            num_hits += KARST_HIT_KIND(hits[0][i].kind) != KARST_HIT_MISS;
        }
        free(hits[0]);
        free(hits[1]);
        served = scene_serve(&s, serial);
    }
    assert_true(num_hits > NUM && serial > 4);
    for (int k = 0; k < 2; k++)
        karst_caster_destroy(casters[k]);
    scene_destroy(&s);
    return num_other;
}

static void known_sides_change_no_hit(void **state)
{
    (void)state;
    assert_int_equal(count_other_hits("", "-DCAST_UNKNOWN_SIDES"), 0);
    /* Were all of a brick taken to be solid, it would be noticed. */
    if (getenv("KARST_TEST_FULL"))
        assert_true(count_other_hits("-DKARST_MUTANT_SIDES", "-DCAST_UNKNOWN_SIDES") > 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rays_find_the_side_that_they_expect),
                                       cmocka_unit_test(known_sides_change_no_hit)};
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
