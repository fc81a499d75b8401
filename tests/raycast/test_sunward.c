/* What bricks are to rays towards the sun: from its definition, and by the shadows that are cast with it. */
#include "raycast/cast/sunward.h"
#include "raycast/light/shade.h"
#include "tests/raycast/casting.h"

/* Bumps of several sizes, of which those that are steep hold shadows. */
static double bumps(const double p[3], double width, const void *user)
{
    (void)width;
    (void)user;
    return 12 * sin(p[0] * 0.06) * cos(p[2] * 0.05) + 1.6 * sin(p[0] * 0.31 + p[1] * 0.1) * cos(p[2] * 0.37) - p[1];
}

static scene built; /* made once */

static int close_all(void **state)
{
    if (built.nodes)
        scene_destroy(&built);
    return close_contexts(state);
}

static scene make_scene(karst_context *context, uint32_t num_segments)
{
    if (!built.nodes) {
        built = scene_create(contexts[0], 1500, 5000, 1, 3, bumps, NULL);
        built.lipschitz = 2;
        scene_build(&built, 0);
    }
    return scene_clone(context, num_segments, &built);
}

static const float sun[4] = {0.66f, 0.2f, -0.7242f, 0};

static karst_buffer *make_owners(const scene *s, uint32_t first_free)
{
    karst_buffer *owners = scene_buffer(s->context, "owners", s->buffers.num_bricks * sizeof(karst_brick_owner));
    karst_brick_owner *all = calloc(s->buffers.num_bricks, sizeof *all);
    for (uint32_t slot = first_free; slot < s->buffers.num_bricks; slot++)
        all[slot].owner = KARST_NO_NODE;
    karst_error error = {0};
    scene_check(karst_buffer_write(owners, 0, all, owners->size_bytes, &error), &error);
    free(all);
    return owners;
}

static karst_sunward *aim(const scene *s, karst_buffer *owners)
{
    karst_error error = {0};
    karst_cache_buffers buffers = s->buffers;
    buffers.brick_owner = owners;
    karst_sunward *sunward = karst_sunward_create(s->context, &buffers, &error);
    scene_check(sunward, &error);
    scene_check(karst_sunward_aim(sunward, sun, &error), &error);
    return sunward;
}

static karst_sunward_brick *read_bricks(const karst_sunward *sunward, uint32_t num)
{
    karst_error error = {0};
    karst_sunward_brick *bricks = malloc(num * sizeof *bricks);
    scene_check(
        karst_buffer_read((karst_buffer *)karst_sunward_bricks(sunward), 0, bricks, num * sizeof *bricks, &error),
        &error);
    return bricks;
}

/* How fast q rises at most towards the sun in a cell; whether it holds both signs. */
static double rise_of_cell(const int16_t *q, bool *is_mixed)
{
    double most[3] = {-1e30, -1e30, -1e30}, v[8];
    int num_solid = 0;
    for (int i = 0; i < 8; i++) {
        v[i] = q[(i & 1) + KARST_BRICK_SIDE * (i >> 1 & 1) + KARST_BRICK_SIDE * KARST_BRICK_SIDE * (i >> 2)];
        num_solid += v[i] > 0;
    }
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++)
            if (!(i >> a & 1))
                most[a] = fmax(most[a], (v[i | 1 << a] - v[i]) * (double)sun[a]);
    *is_mixed = num_solid > 0 && num_solid < 8;
    return most[0] + most[1] + most[2];
}

#define ROUNDING 0.05

static uint32_t way_of(const karst_sunward_brick *brick, int block)
{
    return brick->ways[block / 16] >> block % 16 * 2 & 3;
}

/* From 8 points of a fine block: whether the way towards the sun, out of the brick, meets one of `open`. */
static bool meets_open(const uint32_t open[KARST_FINE_WORDS], int block)
{
    for (int i = 0; i < 8; i++) {
        double p[3];
        for (int a = 0; a < 3; a++)
            p[a] = (block >> 3 * a & 7) * 2 + (i >> a & 1 ? 1.99 : 0.01);
        for (; p[0] >= 0 && p[0] < 16 && p[1] >= 0 && p[1] < 16 && p[2] >= 0 && p[2] < 16;) {
            int at = (int)p[0] / 2 + 8 * ((int)p[1] / 2) + 64 * ((int)p[2] / 2);
            if (open[at / 32] >> at % 32 & 1)
                return true;
            for (int a = 0; a < 3; a++)
                p[a] += 0.05 * (double)sun[a];
        }
    }
    return false;
}

static void records_follow_from_samples(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = make_scene(contexts[k], k ? 2 : 1);
        karst_buffer *owners = make_owners(&s, s.num_bricks);
        karst_sunward *sunward = aim(&s, owners);
        karst_sunward_brick *bricks = read_bricks(sunward, s.num_bricks);
        uint32_t num_open = 0, num_mixed = 0, num_longer = 0, num_free = 0, num_held = 0;
        for (uint32_t slot = 1; slot < s.num_bricks; slot++) {
            const int16_t *q = s.bricks + (size_t)slot * KARST_BRICK_STRIDE;
            uint32_t least[KARST_FINE_WORDS] = {0}, most[KARST_FINE_WORDS] = {0}, mixed[KARST_FINE_WORDS] = {0},
                     airy[KARST_FINE_WORDS] = {0};
            double steepest = 0;
            for (int cell = 0; cell < 4096; cell++) {
                int x = cell & 15, y = cell >> 4 & 15, z = cell >> 8, bit = x / 2 + 8 * (y / 2) + 64 * (z / 2);
                bool is_mixed;
                double rise = rise_of_cell(q + x + KARST_BRICK_SIDE * (y + KARST_BRICK_SIDE * z), &is_mixed);
                steepest = fmax(steepest, rise);
                mixed[bit / 32] |= (uint32_t)is_mixed << bit % 32;
                airy[bit / 32] |=
                    (uint32_t)(is_mixed || q[x + KARST_BRICK_SIDE * (y + KARST_BRICK_SIDE * z)] <= 0) << bit % 32;
                most[bit / 32] |= (uint32_t)(is_mixed && rise > -KARST_SUNWARD_FALL - ROUNDING) << bit % 32;
                least[bit / 32] |= (uint32_t)(is_mixed && rise > -KARST_SUNWARD_FALL + ROUNDING) << bit % 32;
            }
            uint32_t blocks[2] = {0}, opened[KARST_FINE_WORDS] = {0};
            for (int bit = 0; bit < 512; bit++) {
                int x = bit & 7, y = bit >> 3 & 7, z = bit >> 6, block = x / 2 + 4 * (y / 2) + 16 * (z / 2);
                uint32_t way = way_of(&bricks[slot], bit);
                bool is_airy = airy[bit / 32] >> bit % 32 & 1, is_open = way == KARST_SUNWARD_LOOK && is_airy;
                assert_true(is_airy || way == KARST_SUNWARD_LOOK);
                opened[bit / 32] |= (uint32_t)is_open << bit % 32;
                assert_true(is_open ? most[bit / 32] >> bit % 32 & 1 : !(least[bit / 32] >> bit % 32 & 1));
                blocks[block / 32] |= (uint32_t)is_open << block % 32;
                num_open += is_open;
                num_mixed += mixed[bit / 32] >> bit % 32 & 1;
            }
            assert_memory_equal(blocks, bricks[slot].blocks, sizeof blocks);
            for (int bit = 0; bit < 512; bit++) {
                int x = bit & 7, y = bit >> 3 & 7, z = bit >> 6, block = x / 2 + 4 * (y / 2) + 16 * (z / 2);
                uint32_t way = way_of(&bricks[slot], bit);
                assert_true(way != KARST_SUNWARD_LEAP || !(blocks[block / 32] >> block % 32 & 1));
                if (way == KARST_SUNWARD_STEP || way == KARST_SUNWARD_LEAP)
                    num_held++;
                if (way != KARST_SUNWARD_FREE)
                    continue;
                num_free++;
                assert_false(meets_open(opened, bit));
            }
            float any_way = s.brick_info[slot].safe_cells;
            assert_true(bricks[slot].safe_cells >= any_way);
            if (bricks[slot].safe_cells > any_way)
                assert_true(bricks[slot].safe_cells * steepest < 1);
            num_longer += bricks[slot].safe_cells > 2 * any_way;
        }
        /* It spares something. */
        assert_true(num_mixed > 10000 && num_open < num_mixed / 2 && num_longer > s.num_bricks / 4);
        assert_true(num_free > num_held && num_held > num_open);
        free(bricks);
        karst_sunward_destroy(sunward);
        karst_buffer_destroy(owners);
        scene_destroy(&s);
    }
}

/* Slots that loads went to are looked at once they are noted: those whose load came to a brick, and no others. */
static void loads_are_noted(void **state)
{
    (void)state;
    karst_error error = {0};
    scene s = make_scene(contexts[0], 1);
    karst_buffer *owners = make_owners(&s, s.num_bricks), *nobody = make_owners(&s, 0);
    karst_sunward *all = aim(&s, owners), *noted = aim(&s, nobody);
    karst_sunward_brick *expected = read_bricks(all, s.num_bricks), *before = read_bricks(noted, s.num_bricks);
    const uint32_t slots[4] = {3, 9, 4, 7}, results[4] = {KARST_STATE_BRICK, KARST_STATE_CLEAR_AIR | KARST_LOAD_KEPT,
                                                          KARST_STATE_AIR, KARST_STATE_CLEAR_SOLID};
    karst_work work = {.num_loads = 4};
    work.load_slots = karst_buffer_create(s.context, "slots", sizeof slots, slots, &error);
    work.load_results = karst_buffer_create(s.context, "results", sizeof results, results, &error);
    scene_check(work.load_slots && work.load_results && karst_sunward_note(noted, &work, &error), &error);
    karst_sunward_brick *now = read_bricks(noted, s.num_bricks);
    for (uint32_t slot = 1; slot < s.num_bricks; slot++) {
        bool is_noted = slot == 3 || slot == 9;
        assert_memory_equal(now[slot].ways, (is_noted ? expected : before)[slot].ways, sizeof now[slot].ways);
        assert_true(!is_noted || now[slot].safe_cells == expected[slot].safe_cells);
    }
    free(expected);
    free(before);
    free(now);
    karst_sunward_destroy(all);
    karst_sunward_destroy(noted);
    karst_buffer *const buffers[] = {owners, nobody, work.load_slots, work.load_results};
    for (int i = 0; i < 4; i++)
        karst_buffer_destroy(buffers[i]);
    scene_destroy(&s);
}

/* Shadows are the same with it, in levels that blend too. */
static void shadows_are_the_same(void **state)
{
    (void)state;
    enum { WIDTH = 190, HEIGHT = 130, NUM = WIDTH * HEIGHT };
    static const double eye[3] = {-60.3, 26.2, -51.7};
    karst_error error = {0};
    for (int k = 0; k < 4; k++) {
        scene s = make_scene(contexts[k & 1], 1);
        karst_cast_view view = scene_view(&s, eye, k & 1 ? 1 : 0.5f);
        view.blend = k & 2 ? 0.25f : 0;
        const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, 50, -14, 300);
        karst_light light = {.sun_colour = {3, 3, 3},
                             .ground_flat = {0.2f, 0.2f, 0.2f},
                             .ground_steep = {0.2f, 0.2f, 0.2f},
                             .haze_distance = 3000,
                             .shadow_distance = 300};
        memcpy(light.sun_direction, sun, sizeof sun);
        karst_caster *caster = open_caster(&s, "");
        karst_shader *shader = karst_shader_create(s.context, true, &error);
        scene_check(shader, &error);
        karst_buffer *owners = make_owners(&s, s.num_bricks);
        karst_sunward *sunward = aim(&s, owners);
        karst_buffer *hits = scene_buffer(s.context, "hits", NUM * sizeof(karst_hit)),
                     *rays = scene_buffer(s.context, "rays", karst_cast_shadow_bytes(WIDTH, HEIGHT)),
                     *depth = scene_buffer(s.context, "depth", NUM * 4),
                     *counters = scene_buffer(s.context, "counters", KARST_SHADE_COUNTERS * 4);
        static uint32_t sunny[NUM], pixels[2][NUM];
        for (int with = 0; with < 2; with++) {
            karst_caster_set_sunward(caster, with ? sunward : NULL);
            karst_buffer *out = scene_buffer(s.context, "pixels", NUM * 4);
            scene_check(karst_cast_pinhole(caster, &view, &pinhole, hits, &error) &&
                            karst_shade_pixels(shader, &view, &pinhole, &light, hits, rays, out->mem, depth, counters,
                                               &error) &&
                            karst_buffer_read(out, 0, sunny, sizeof sunny, &error) &&
                            karst_cast_shadows(caster, &view, &pinhole, &light, rays, out->mem, &error) &&
                            karst_buffer_read(out, 0, pixels[with], sizeof pixels[with], &error),
                        &error);
            karst_buffer_destroy(out);
        }
        uint32_t num_dark = 0;
        for (int i = 0; i < NUM; i++)
            num_dark += pixels[0][i] != sunny[i];
        assert_true(num_dark > NUM / 20 && num_dark < NUM / 2);
        assert_memory_equal(pixels[0], pixels[1], sizeof pixels[0]);
        karst_buffer *const all[] = {owners, hits, rays, depth, counters};
        for (int i = 0; i < 5; i++)
            karst_buffer_destroy(all[i]);
        karst_shader_destroy(shader);
        karst_caster_destroy(caster);
        karst_sunward_destroy(sunward);
        scene_destroy(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(records_follow_from_samples),
        cmocka_unit_test(loads_are_noted),
        cmocka_unit_test(shadows_are_the_same),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_all);
}
