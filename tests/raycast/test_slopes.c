/* How steep bricks are along each axis: from samples, in double; and that no hit depends on whether it is known. */
#include "raycast/cast/slopes_shared.h"
#include "tests/raycast/casting.h"

enum { WIDTH = 190, HEIGHT = 130, NUM_PIXELS = WIDTH * HEIGHT };

/* Bumps of several sizes. Coarser levels lie higher: rays that are far from solid in one field may be in it where that
 * blends into the next. */
static double bumps(const double p[3], double width, const void *user)
{
    (void)user;
    return 9 * sin(p[0] * 0.05) * cos(p[2] * 0.04) + 1.6 * sin(p[0] * 0.31 + p[1] * 0.1) * cos(p[2] * 0.37) +
           1.5 * (width - 1) - p[1];
}

static scene built; /* made once */

static int close_all(void **state)
{
    if (built.nodes)
        scene_destroy(&built);
    return close_contexts(state);
}

/* With owners: the slots of bricks, but for those below `first_owned`. */
static scene make_scene(karst_context *context, uint32_t num_segments, uint32_t first_owned)
{
    if (!built.nodes) {
        built = scene_create(contexts[0], 1500, 5000, 1, 3, bumps, NULL);
        built.lipschitz = 3;
        scene_build(&built, 0);
    }
    scene s = scene_clone(context, num_segments, &built);
    s.buffers.brick_owner = scene_buffer(context, "owners", s.buffers.num_bricks * sizeof(karst_brick_owner));
    karst_brick_owner *all = calloc(s.buffers.num_bricks, sizeof *all);
    for (uint32_t slot = 0; slot < s.buffers.num_bricks; slot++)
        if (slot < first_owned || slot >= s.num_bricks)
            all[slot].owner = KARST_NO_NODE;
    karst_error error = {0};
    scene_check(karst_buffer_write(s.buffers.brick_owner, 0, all, s.buffers.brick_owner->size_bytes, &error), &error);
    free(all);
    return s;
}

static void drop_scene(scene *s)
{
    karst_buffer_destroy(s->buffers.brick_owner);
    scene_destroy(s);
}

static void survey(karst_caster *caster, uint32_t first, uint32_t end)
{
    karst_error error = {0};
    scene_check(karst_caster_survey_slopes(caster, first, end, &error), &error);
}

static karst_brick_info *read_infos(const scene *s)
{
    karst_error error = {0};
    karst_brick_info *infos = malloc(s->num_bricks * sizeof *infos);
    scene_check(karst_buffer_read(s->buffers.brick_info, 0, infos, s->num_bricks * sizeof *infos, &error), &error);
    return infos;
}

/* The largest difference to the next sample along an axis, or against it. */
static double largest_rise(const int16_t *q, int axis, int way)
{
    static const int next[3] = {1, KARST_BRICK_SIDE, KARST_BRICK_SIDE * KARST_BRICK_SIDE};
    double most = -1e30;
    for (int i = 0; i < KARST_BRICK_SAMPLES; i++)
        if (i / next[axis] % KARST_BRICK_SIDE < KARST_BRICK_CELLS)
            most = fmax(most, (way ? -1.0 : 1.0) * ((double)q[i + next[axis]] - q[i]));
    return most;
}

static void shares_bound_samples(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = make_scene(contexts[k], k ? 2 : 1, 10);
        karst_caster *caster = open_caster(&s, "");
        survey(caster, 0, 200);
        survey(caster, 200, s.num_bricks - 20);
        karst_brick_info *infos = read_infos(&s);
        uint32_t num_flat = 0;
        for (uint32_t slot = 1; slot < s.num_bricks; slot++) {
            const karst_brick_info *info = &infos[slot];
            /* Nothing else of the record changes. */
            assert_memory_equal(info, &s.brick_info[slot], offsetof(karst_brick_info, slopes));
            if (slot < 10 || slot >= s.num_bricks - 20) {
                assert_true(info->slopes[0] == 0 && info->slopes[1] == 0);
                continue;
            }
            assert_true(info->slopes[1] & KARST_SLOPES_KNOWN);
            const int16_t *q = s.bricks + (size_t)slot * KARST_BRICK_STRIDE;
            for (int way = 0; way < 2; way++)
                for (int axis = 0; axis < 3; axis++) {
                    double share = (double)karst_slope_of(info->slopes[way], axis) / KARST_SLOPE_ONE;
                    double rise = largest_rise(q, axis, way) * (double)info->safe_cells;
                    /* A bound, of which rounding may take a millionth; and no more than a step above. */
                    assert_true(share >= rise - 1e-6);
                    assert_true(share <= rise + 1.001 / KARST_SLOPE_ONE);
                    num_flat += rise < 0.5;
                }
        }
        assert_true(num_flat > s.num_bricks);
        free(infos);
        karst_caster_destroy(caster);
        drop_scene(&s);
    }
}

/* Who was looked at is not looked at again before it is written once more. */
static void known_bricks_are_left_alone(void **state)
{
    (void)state;
    karst_error error = {0};
    scene s = make_scene(contexts[0], 1, 1);
    karst_caster *caster = open_caster(&s, "");
    const uint32_t slot = 7;
    karst_brick_info marked = s.brick_info[slot];
    marked.slopes[1] = KARST_SLOPES_KNOWN;
    scene_check(karst_buffer_write(s.buffers.brick_info, slot * sizeof marked, &marked, sizeof marked, &error), &error);
    survey(caster, 0, UINT32_MAX);
    karst_brick_info *infos = read_infos(&s);
    assert_memory_equal(&infos[slot], &marked, sizeof marked);
    assert_true(infos[slot + 1].slopes[1] & KARST_SLOPES_KNOWN);
    free(infos);
    karst_caster_destroy(caster);
    drop_scene(&s);
}

static void cast_and_note(const scene *s, karst_caster *caster, double yaw_deg, float blend, karst_hit *hits,
                         uint32_t *stamps)
{
    static const double eye[3] = {-60.3, 26.2, -51.7};
    karst_error error = {0};
    karst_cast_view view = scene_view(s, eye, 4);
    view.blend = blend;
    const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, yaw_deg, -14, 300);
    karst_buffer *buffer = scene_buffer(s->context, "hits", NUM_PIXELS * sizeof(karst_hit));
    scene_check(karst_cast_pinhole(caster, &view, &pinhole, buffer, &error) &&
                    karst_buffer_read(buffer, 0, hits, NUM_PIXELS * sizeof(karst_hit), &error) &&
                    karst_buffer_read(s->buffers.brick_stamp, 0, stamps, s->num_bricks * sizeof(uint32_t), &error),
                &error);
    karst_buffer_destroy(buffer);
}

/* In all octants, with bricks known, unknown, and some of each. */
static void hits_are_the_same(void **state)
{
    (void)state;
    static karst_hit without[NUM_PIXELS], with[NUM_PIXELS];
    for (int k = 0; k < 4; k++) {
        scene s = make_scene(contexts[k & 1], 1, 1);
        karst_caster *caster = open_caster(&s, "");
        uint32_t *stamps = malloc(2 * s.num_bricks * sizeof *stamps);
        const float blend = k & 2 ? 0.5f : 0;
        for (int quarter = 0; quarter < 2; quarter++) {
            const double yaw_deg = 50 + 180 * quarter + 90 * (k >> 1);
            scene_upload(&s);
            cast_and_note(&s, caster, yaw_deg, blend, without, stamps);
            for (int part = 1; part <= 2; part++) {
                survey(caster, 0, s.num_bricks / 2 * (uint32_t)part + 1);
                cast_and_note(&s, caster, yaw_deg, blend, with, stamps + s.num_bricks);
                assert_memory_equal(without, with, sizeof with);
                assert_memory_equal(stamps, stamps + s.num_bricks, s.num_bricks * sizeof *stamps);
            }
        }
        free(stamps);
        karst_caster_destroy(caster);
        drop_scene(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shares_bound_samples),
        cmocka_unit_test(known_bricks_are_left_alone),
        cmocka_unit_test(hits_are_the_same),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_all);
}
