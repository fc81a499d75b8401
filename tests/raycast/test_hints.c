/* Hints of what beams read change nothing but when memory is fetched, whatever they hold; and they are of what rays
 * read, made when they are needed and left alone where a camera stands still. */
#include "raycast/cast/hints_shared.h"
#include "raycast/light/shade.h"
#include "tests/raycast/traces.h"

#define WIDTH 157 /* no whole number of beams */
#define HEIGHT 93
#define NUM_PIXELS (WIDTH * HEIGHT)
#define BRICK_LINES ((KARST_BRICK_BYTES(16) + 63) / 64)

typedef struct {
    karst_buffer *hits, *asked, *hints; /* hints NULL: without */
    karst_beam_hints *lists;
    size_t num_lists;
} picture;

static picture open_picture(const scene *s, bool has_hints)
{
    picture p = {.hits = scene_buffer(s->context, "hits", NUM_PIXELS * sizeof(karst_hit)),
                 .asked = scene_buffer(s->context, "asked", karst_cast_asked_bytes(s->context, WIDTH, HEIGHT))};
    size_t bytes = karst_cast_hint_bytes(s->context, &s->buffers, WIDTH, HEIGHT);
    assert_true(bytes > 0 && bytes % sizeof(karst_beam_hints) == 0);
    if (has_hints) {
        p.hints = scene_buffer(s->context, "hints", bytes);
        p.lists = malloc(bytes);
        p.num_lists = bytes / sizeof(karst_beam_hints);
    }
    return p;
}

static void close_picture(picture *p)
{
    karst_buffer_destroy(p->hits);
    karst_buffer_destroy(p->asked);
    karst_buffer_destroy(p->hints);
    free(p->lists);
}

static void write_lists(const picture *p)
{
    karst_error error = {0};
    scene_check(karst_buffer_write(p->hints, 0, p->lists, p->hints->size_bytes, &error), &error);
}

static void read_lists(const picture *p)
{
    karst_error error = {0};
    scene_check(karst_buffer_read(p->hints, 0, p->lists, p->hints->size_bytes, &error), &error);
}

static traces trace(const scene *s, karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                    const picture *p)
{
    karst_error error = {0};
    traces t = {.hits = malloc(NUM_PIXELS * sizeof(karst_hit))};
    forget_stamps(s);
    scene_check(karst_buffer_fill(p->hits, 0, 0, p->hits->size_bytes, &error) &&
                    karst_cast_picture(caster, view, pinhole, p->hits, p->asked, p->hints, &error) &&
                    karst_buffer_read(p->hits, 0, t.hits, NUM_PIXELS * sizeof(karst_hit), &error),
                &error);
    for (int i = 0; i < NUM_STAMPS; i++)
        t.stamps[i] = read_stamps(stamp_buffer(s, i));
    return t;
}

/* Nonsense in all bytes; every second list says that it was just fetched, so that its beam fetches nothing itself. */
static void scramble(const picture *p, uint32_t serial, uint64_t *seed)
{
    uint8_t *bytes = (uint8_t *)p->lists;
    for (size_t i = 0; i < p->hints->size_bytes; i++)
        bytes[i] = (uint8_t)(next_random(seed) * 256);
    for (size_t i = 0; i < p->num_lists; i++) {
        p->lists[i].is_old = i % 3 == 0;
        if (i % 2)
            p->lists[i].fetched = serial;
        if (i % 4 > 1)
            p->lists[i].num = (uint32_t)(next_random(seed) * KARST_BEAM_HINTS);
    }
    write_lists(p);
}

typedef struct {
    double yaw_deg, pitch_deg;
    float blend;
} look;

enum { KEPT, FIRST, SCRAMBLED, NUM_KINDS };

/* Kept from cast to cast, so that they are of other looks and of what was not loaded; never made before; nonsense. */
static void check_no_trace(scene s, const double eye[3])
{
    static const look looks[] = {{30, -20, 0.25f}, {45, 1, 0.0f}, {33, -18, 0.0625f}, {0, -90, 0.0625f}};
    karst_caster *caster = open_caster(&s, "");
    picture without = open_picture(&s, false), with[NUM_KINDS];
    uint64_t seed = 5;
    uint32_t serial = 0, num_made = 0;
    for (int kind = 0; kind < NUM_KINDS; kind++)
        with[kind] = open_picture(&s, true);
    for (size_t i = 0; i < sizeof(looks) / sizeof(looks[0]); i++) {
        const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, looks[i].yaw_deg, looks[i].pitch_deg, 400);
        karst_cast_view view = scene_view(&s, eye, 1);
        view.blend = looks[i].blend;
        uint32_t served;
        do {
            view.serial = ++serial;
            memset(with[FIRST].lists, 0, with[FIRST].hints->size_bytes);
            write_lists(&with[FIRST]);
            scramble(&with[SCRAMBLED], serial, &seed);
            traces expected = trace(&s, caster, &view, &pinhole, &without);
            for (int kind = 0; kind < NUM_KINDS; kind++) {
                traces t = trace(&s, caster, &view, &pinhole, &with[kind]);
                assert_int_equal(count_differences(&s, &expected, &t, NUM_PIXELS), 0);
                release(&t);
            }
            release(&expected);
            read_lists(&with[KEPT]);
            for (size_t k = 0; k < with[KEPT].num_lists; k++)
                num_made += with[KEPT].lists[k].num;
            served = scene_serve(&s, serial);
        } while (served);
    }
    assert_true(serial > 6);
    assert_true(num_made > 100);
    for (int kind = 0; kind < NUM_KINDS; kind++)
        close_picture(&with[kind]);
    close_picture(&without);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

static void test_hints_leave_no_trace(void **state)
{
    (void)state;
    static const double above_ground[3] = {3.3, 21.1, -7.7};
    check_no_trace(open_scene(bumps, NULL), above_ground);
    /* where a slot says which allocation it is in */
    check_no_trace(open_scene_in(3, bumps, NULL), above_ground);
}

/* The same of shadow rays, and the pixels that they darken. */
static void test_hints_of_shadow_rays_leave_no_trace(void **state)
{
    (void)state;
    static const double above_ground[3] = {3.3, 21.1, -7.7};
    karst_error error = {0};
    scene s = open_scene(bumps, NULL);
    karst_caster *caster = open_caster(&s, "");
    karst_shader *shader = karst_shader_create(contexts[0], true, &error);
    scene_check(shader, &error);
    karst_buffer *pixels = scene_buffer(contexts[0], "pixels", NUM_PIXELS * 4),
                 *depth = scene_buffer(contexts[0], "depth", NUM_PIXELS * 4),
                 *counters = scene_buffer(contexts[0], "counters", KARST_SHADE_COUNTERS * 4),
                 *rays = scene_buffer(contexts[0], "rays", karst_cast_shadow_bytes(WIDTH, HEIGHT));
    karst_light light = {.sun_direction = {0.77f, 0.3f, 0.563f},
                         .sun_colour = {1.6f, 1.5f, 1.4f},
                         .sky_zenith = {0.1f, 0.24f, 0.55f},
                         .sky_horizon = {0.3f, 0.35f, 0.4f},
                         .ground_flat = {0.3f, 0.3f, 0.3f},
                         .ground_steep = {0.3f, 0.3f, 0.3f},
                         .haze_distance = 3000,
                         .shadow_distance = 400};
    picture with[NUM_KINDS];
    for (int kind = 0; kind < NUM_KINDS; kind++)
        with[kind] = open_picture(&s, true);
    static uint32_t rgba[2][NUM_PIXELS];
    uint64_t seed = 6;
    uint32_t num_made = 0, serial = 0;
    for (int yaw_deg = 30; yaw_deg < 60; yaw_deg += 20) {
        const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, yaw_deg, -20, 400);
        karst_cast_view view = scene_view(&s, above_ground, 1);
        view.blend = 0.0625f;
        uint32_t served;
        do {
            view.serial = ++serial;
            memset(with[FIRST].lists, 0, with[FIRST].hints->size_bytes);
            write_lists(&with[FIRST]);
            scramble(&with[SCRAMBLED], serial, &seed);
            uint32_t *stamps[NUM_STAMPS] = {0};
            for (int kind = -1; kind < NUM_KINDS; kind++) { /* first without hints */
                forget_stamps(&s);
                scene_check(karst_cast_pinhole(caster, &view, &pinhole, with[KEPT].hits, &error) &&
                                karst_shade_pixels(shader, &view, &pinhole, &light, with[KEPT].hits, rays,
                                                   pixels->mem, depth, counters, &error) &&
                                karst_cast_picture_shadows(caster, &view, &pinhole, &light, rays, pixels->mem,
                                                           with[KEPT].asked, kind < 0 ? NULL : with[kind].hints,
                                                           &error) &&
                                karst_buffer_read(pixels, 0, rgba[kind >= 0], sizeof(rgba[0]), &error),
                            &error);
                for (int i = 0; i < NUM_STAMPS; i++) {
                    uint32_t *now = read_stamps(stamp_buffer(&s, i));
                    if (kind >= 0)
                        assert_memory_equal(now, stamps[i], stamp_buffer(&s, i)->size_bytes);
                    free(kind >= 0 ? now : NULL);
                    stamps[i] = kind >= 0 ? stamps[i] : now;
                }
                if (kind >= 0)
                    assert_memory_equal(rgba[0], rgba[1], sizeof(rgba[0]));
            }
            for (int i = 0; i < NUM_STAMPS; i++)
                free(stamps[i]);
            read_lists(&with[KEPT]);
            for (size_t k = 0; k < with[KEPT].num_lists; k++)
                num_made += with[KEPT].lists[k].num;
            served = scene_serve(&s, serial);
        } while (served);
    }
    assert_true(serial > 3);
    assert_true(num_made > 100);
    for (int kind = 0; kind < NUM_KINDS; kind++)
        close_picture(&with[kind]);
    karst_buffer_destroy(pixels);
    karst_buffer_destroy(depth);
    karst_buffer_destroy(counters);
    karst_buffer_destroy(rays);
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

static bool has_line(const picture *p, uint32_t slot, uint32_t line)
{
    for (size_t i = 0; i < p->num_lists; i++)
        for (uint32_t k = 0; k < p->lists[i].num; k++)
            for (int j = 0; p->lists[i].bricks[k] == slot && j < KARST_HINT_LINES; j++)
                if (p->lists[i].lines[k][j] == line)
                    return true;
    return false;
}

/* How many samples next to hits lie in lines that no list has. */
static uint32_t count_missing(const picture *p, const karst_hit *hits, uint32_t *num_hits)
{
    uint32_t missing = 0;
    *num_hits = 0;
    for (int i = 0; i < NUM_PIXELS; i++) {
        if (KARST_HIT_KIND(hits[i].kind) != KARST_HIT_SURFACE)
            continue;
        ++*num_hits;
        uint32_t first = 0, side = KARST_BRICK_SIDE;
        for (int axis = 2; axis >= 0; axis--)
            first = first * side + KARST_HIT_CELL(hits[i].place, axis);
        const uint32_t samples[] = {first, first + 1 + side, first + side * side, first + 1 + side * side + side};
        for (int k = 0; k < 4; k++)
            missing += !has_line(p, hits[i].brick, samples[k] * sizeof(int16_t) / 64);
    }
    return missing;
}

static bool is_listed(const karst_beam_hints *list, uint32_t slot)
{
    const uint32_t bit = karst_hint_bit(slot);
    return list->filter[bit / 32] >> bit % 32 & 1;
}

static void test_hints_are_what_rays_read(void **state)
{
    (void)state;
    static const double above_ground[3] = {3.3, 21.1, -7.7};
    scene s = open_scene(bumps, NULL);
    karst_caster *caster = open_caster(&s, "");
    picture p = open_picture(&s, true);
    karst_cast_view view = scene_view(&s, above_ground, 1);
    view.blend = 0.0625f;
    uint32_t num_hits;
    bool seen_old = false;
    karst_beam_hints *before = malloc(p.hints->size_bytes);
    for (int turned = 0; turned < 2; turned++) {
        const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, 30 + 90 * turned, -20, 400);
        traces t;
        for (bool served = true; served;) {
            view.serial++;
            t = trace(&s, caster, &view, &pinhole, &p);
            if (turned && !seen_old) { /* those of the other look are no good here */
                read_lists(&p);
                assert_true(count_missing(&p, t.hits, &num_hits) > num_hits / 2);
                seen_old = true;
            }
            release(&t);
            served = scene_serve(&s, view.serial);
        }
        /* By now they are of most bricks, though some came since lists were made; and soon they are of all. */
        for (int i = 0; i < 4; i++) {
            view.serial++;
            t = trace(&s, caster, &view, &pinhole, &p);
            read_lists(&p);
            assert_true(count_missing(&p, t.hits, &num_hits) < (i < 3 ? num_hits / 4 : num_hits / 1000));
            release(&t);
        }
        /* Of lists that are empty: one cast finds them old, the next makes them anew, and from then on they stay. */
        memset(p.lists, 0, p.hints->size_bytes);
        write_lists(&p);
        for (int i = 0; i < 5; i++) {
            view.serial++;
            t = trace(&s, caster, &view, &pinhole, &p);
            memcpy(before, p.lists, p.hints->size_bytes);
            read_lists(&p);
            if (i > 1)
                assert_int_equal(count_missing(&p, t.hits, &num_hits), 0);
            release(&t);
        }
        assert_true(num_hits > NUM_PIXELS / 2);
        for (size_t i = 0; i < p.num_lists; i++) {
            karst_beam_hints *now = &p.lists[i];
            if (i > 0) {
                assert_int_equal(now->fetched, view.serial);
                before[i].fetched = now->fetched;
            }
            before[i].num_casts = now->num_casts;
            memcpy(before[i].last, now->last, sizeof(now->last));
            assert_int_equal(now->is_old, 0);
            assert_true(now->num > 0 && now->num <= KARST_BEAM_HINTS);
            for (uint32_t k = 0; k < now->num; k++) {
                assert_in_range(now->bricks[k], 1, s.num_bricks - 1);
                assert_true(is_listed(now, now->bricks[k]));
                for (int j = 0; j < KARST_HINT_LINES; j++)
                    assert_in_range(now->lines[k][j], 0, BRICK_LINES - 1);
            }
        }
        assert_memory_equal(before, p.lists, p.hints->size_bytes);
    }
    free(before);
    close_picture(&p);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

/* One lane has no beams and makes no hints; buffers that are too small are refused. */
static void test_sizes(void **state)
{
    (void)state;
    static const double above_ground[3] = {3.3, 21.1, -7.7};
    scene s = open_scene(bumps, NULL);
    karst_cache_buffers wide = s.buffers;
    wide.brick_bits = 32;
    assert_int_equal(karst_cast_hint_bytes(contexts[1], &s.buffers, WIDTH, HEIGHT), 0);
    assert_int_equal(karst_cast_hint_bytes(contexts[0], &wide, WIDTH, HEIGHT), 0);
    assert_int_equal(karst_cast_hint_bytes(contexts[0], &s.buffers, 32, 32), sizeof(karst_beam_hints));
    karst_caster *caster = open_caster(&s, "");
    picture p = open_picture(&s, true);
    const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT + 8, 30, -20, 400);
    karst_cast_view view = scene_view(&s, above_ground, 1);
    karst_buffer *hits = scene_buffer(s.context, "hits", WIDTH * (HEIGHT + 8) * sizeof(karst_hit)),
                 *asked = scene_buffer(s.context, "asked", karst_cast_asked_bytes(s.context, WIDTH, HEIGHT + 8));
    karst_error error = {0};
    assert_false(karst_cast_picture(caster, &view, &pinhole, hits, asked, p.hints, &error));
    assert_non_null(strstr(error.message, "hints"));
    karst_buffer_destroy(hits);
    karst_buffer_destroy(asked);
    close_picture(&p);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hints_leave_no_trace),
        cmocka_unit_test(test_hints_of_shadow_rays_leave_no_trace),
        cmocka_unit_test(test_hints_are_what_rays_read),
        cmocka_unit_test(test_sizes),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
