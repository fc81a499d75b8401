/* Shading: pixels, depth, counters and shadow rays; and the functions from light to bytes. */
#include "raycast/light/shade.h"
#include "raycast/light/tone.clh"
#include "tests/raycast/casting.h"

static scene built; /* made once */

static int close_all(void **state)
{
    if (built.nodes)
        scene_destroy(&built);
    return close_contexts(state);
}

static karst_light make_light(double elevation_deg)
{
    double e = elevation_deg * (3.14159265358979 / 180);
    karst_light light = {.sun_direction = {(float)(cos(e) * 0.8), (float)sin(e), (float)(cos(e) * 0.6)},
                         .sun_colour = {3.0f, 2.7f, 2.3f},
                         .sky_zenith = {0.1f, 0.24f, 0.55f},
                         .sky_horizon = {0.58f, 0.7f, 0.82f},
                         .ground_flat = {0.13f, 0.18f, 0.05f},
                         .ground_steep = {0.27f, 0.23f, 0.19f},
                         .haze_distance = 3000,
                         .shadow_distance = 400};
    return light;
}

/* A picture of a scene in all its parts, on the host. In pixel order but for hits and rays (packet order). */
typedef struct {
    size_t num_pixels;
    karst_hit *hits;
    karst_ray *rays;       /* `pixel`: the pixel's colour in shadow */
    uint8_t *sunny, *rgba; /* without and with shadows */
    float *depth;
    uint32_t counters[4];
} picture;

static void *read_all(karst_buffer *buffer)
{
    karst_error error = {0};
    void *data = malloc(buffer->size_bytes);
    scene_check(karst_buffer_read(buffer, 0, data, buffer->size_bytes, &error), &error);
    return data;
}

/* Shadow rays as rays for karst_cast_rays; idle where there are none. Malloc'ed. */
static karst_ray *shadow_rays(karst_buffer *buffer, const karst_pinhole *pinhole, const karst_light *light)
{
    size_t num = (size_t)pinhole->width_px * (size_t)pinhole->height_px;
    float *fields = read_all(buffer);
    karst_ray *rays = calloc(num, sizeof(*rays));
    for (size_t i = 0; i < num; i++) {
        float width = fields[KARST_SHADOW_WIDTH * num + i];
        if (!(width > 0))
            continue;
        for (size_t a = 0; a < 3; a++)
            rays[i].origin[a] = fields[(KARST_SHADOW_ORIGIN + a) * num + i];
        memcpy(rays[i].direction, light->sun_direction, sizeof(rays[i].direction));
        rays[i].t_max = light->shadow_distance;
        rays[i].width = width;
        rays[i].cone = fmaxf(pinhole->cone, KARST_SUN_CONE);
        rays[i].rise = fields[KARST_SHADOW_RISE * num + i];
        memcpy(&rays[i].pixel, &fields[KARST_SHADOW_DARK * num + i], sizeof(rays[i].pixel));
    }
    free(fields);
    return rays;
}

static picture take_picture(const scene *s, const karst_cast_view *view, const karst_pinhole *pinhole,
                            const karst_light *light, bool shadows)
{
    karst_error error = {0};
    picture p = {.num_pixels = (size_t)pinhole->width_px * (size_t)pinhole->height_px};
    karst_caster *caster = open_caster(s, "");
    karst_shader *shader = karst_shader_create(s->context, shadows, &error);
    scene_check(shader, &error);
    karst_buffer *hits = scene_buffer(s->context, "hits", p.num_pixels * sizeof(karst_hit));
    karst_buffer *rays =
        scene_buffer(s->context, "rays", karst_cast_shadow_bytes(pinhole->width_px, pinhole->height_px));
    karst_buffer *pixels = scene_buffer(s->context, "pixels", p.num_pixels * 4);
    karst_buffer *depth = scene_buffer(s->context, "depth", p.num_pixels * 4);
    karst_buffer *counters = scene_buffer(s->context, "counters", KARST_SHADE_COUNTERS * 4);
    scene_check(karst_cast_pinhole(caster, view, pinhole, hits, &error) &&
                    karst_shade_pixels(shader, view, pinhole, light, hits, shadows ? rays : NULL, pixels->mem, depth,
                                       counters, &error),
                &error);
    p.sunny = read_all(pixels);
    if (shadows)
        scene_check(karst_cast_shadows(caster, view, pinhole, light, rays, pixels->mem, &error), &error);
    p.hits = read_all(hits);
    p.rays = shadow_rays(rays, pinhole, light);
    p.rgba = read_all(pixels);
    p.depth = read_all(depth);
    scene_check(karst_buffer_read(counters, 0, p.counters, 16, &error), &error);
    karst_buffer *const all[] = {hits, rays, pixels, depth, counters};
    for (int i = 0; i < 5; i++)
        karst_buffer_destroy(all[i]);
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    return p;
}

static void free_picture(picture *p)
{
    free(p->hits);
    free(p->rays);
    free(p->sunny);
    free(p->rgba);
    free(p->depth);
}

/* Ground with a ball above it. */
static double ball_over_ground(const double p[3], double width, const void *user)
{
    (void)width;
    (void)user;
    double ground = -p[1], ball_there = 12 - sqrt(p[0] * p[0] + (p[1] - 25) * (p[1] - 25) + p[2] * p[2]);
    return ground > ball_there ? ground : ball_there;
}

static const double eye[3] = {-70.3, 45.2, -60.7};
static scene make_scene(karst_context *context, uint32_t num_segments)
{
    if (!built.nodes) {
        built = scene_create(contexts[0], 1500, 5000, 1, 3, ball_over_ground, NULL);
        scene_build(&built, 0);
    }
    return scene_clone(context, num_segments, &built);
}

static void outputs_belong_to_the_hits(void **state)
{
    (void)state;
    const int sizes[][2] = {{90, 70}, {7, 5}, {1, 1}};
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 3; i++) {
            scene s = make_scene(contexts[k], 1);
            karst_cast_view view = scene_view(&s, eye, 1);
            karst_pinhole pinhole = make_pinhole(sizes[i][0], sizes[i][1], 50, -10, 300);
            karst_light light = make_light(40);
            picture p = take_picture(&s, &view, &pinhole, &light, i == 0);
            uint32_t num_hits = 0;
            uint32_t width = (uint32_t)pinhole.width_px, height = (uint32_t)pinhole.height_px;
            for (uint32_t y = 0; y < height; y++)
                for (uint32_t x = 0; x < width; x++) {
                    const karst_hit *hit = &p.hits[karst_packet_order(x, y, width, height)];
                    float depth = p.depth[y * width + x];
                    bool is_hit = KARST_HIT_KIND(hit->kind) != KARST_HIT_MISS;
                    num_hits += is_hit;
                    if (is_hit)
                        assert_true(depth == hit->t);
                    else
                        assert_true(isinf(depth));
                    assert_int_equal(p.rgba[4 * (y * width + x) + 3], 255);
                }
            assert_int_equal(p.counters[0], num_hits);
            assert_int_equal(p.counters[1] + p.counters[2] + p.counters[3], 0);
            assert_true(i != 0 || (num_hits > p.num_pixels / 3 && num_hits < p.num_pixels));
            free_picture(&p);
            scene_destroy(&s);
        }
}

static void gaps_are_counted(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = make_scene(contexts[k], 1);
        /* One root node loses all, another its children. */
        uint32_t lost = 0, coarse = 0;
        for (uint32_t i = 8; i < 16; i++)
            if (KARST_NODE_STATE(s.nodes[i].link) == KARST_STATE_BRICK) {
                if (!lost)
                    lost = i;
                else if (!coarse)
                    coarse = i;
            }
        assert_true(lost && coarse);
        s.nodes[lost] = (karst_node){KARST_NODE_LINK(KARST_STATE_UNKNOWN, 0), 0};
        s.nodes[coarse].link = KARST_NODE_LINK(KARST_STATE_BRICK, 0);
        scene_upload(&s);
        karst_cast_view view = scene_view(&s, eye, 1);
        karst_pinhole pinhole = make_pinhole(64, 48, 50, -25, 300);
        karst_light light = make_light(40);
        view.own_detail = view.detail;
        picture p = take_picture(&s, &view, &pinhole, &light, false);
        uint32_t provisional = 0, incomplete = 0;
        for (size_t i = 0; i < p.num_pixels; i++) {
            provisional += KARST_HIT_KIND(p.hits[i].kind) == KARST_HIT_PROVISIONAL;
            incomplete += (p.hits[i].kind & KARST_HIT_INCOMPLETE) != 0;
        }
        assert_true(provisional > 0 && incomplete > 0);
        assert_int_equal(p.counters[1], provisional);
        assert_int_equal(p.counters[2], incomplete);
        assert_int_equal(p.counters[3], provisional);
        free_picture(&p);
        /* A view that asks for less than its owner wants: what comes short of that is counted. */
        view.detail = 4 * view.own_detail;
        p = take_picture(&s, &view, &pinhole, &light, false);
        uint32_t coarser = 0;
        for (size_t i = 0; i < p.num_pixels; i++) {
            uint32_t kind = KARST_HIT_KIND(p.hits[i].kind), level = KARST_HIT_LEVEL(p.hits[i].kind);
            float wanted = p.hits[i].t * pinhole.cone * view.own_detail;
            coarser += kind == KARST_HIT_PROVISIONAL ||
                       (kind == KARST_HIT_SURFACE && level > 0 && ldexpf(1, (int)level) > wanted * 1.0001f);
        }
        assert_true(coarser > provisional);
        assert_int_equal(p.counters[3], coarser);
        free_picture(&p);
        scene_destroy(&s);
    }
}

static void lanes_and_segments_give_the_same_bytes(void **state)
{
    (void)state;
    picture p[3];
    const int context[3] = {0, 1, 0};
    const uint32_t segments[3] = {1, 1, 4};
    karst_pinhole pinhole = make_pinhole(101, 75, 50, -18, 300);
    karst_light light = make_light(35);
    for (int i = 0; i < 3; i++) {
        scene s = make_scene(contexts[context[i]], segments[i]);
        karst_cast_view view = scene_view(&s, eye, 1);
        p[i] = take_picture(&s, &view, &pinhole, &light, true);
        scene_destroy(&s);
    }
    for (int i = 1; i < 3; i++) {
        assert_memory_equal(p[0].rgba, p[i].rgba, p[0].num_pixels * 4);
        assert_memory_equal(p[0].depth, p[i].depth, p[0].num_pixels * 4);
        assert_memory_equal(p[0].rays, p[i].rays, p[0].num_pixels * sizeof(karst_ray));
        assert_memory_equal(p[0].counters, p[i].counters, sizeof(p[0].counters));
    }
    for (int i = 0; i < 3; i++)
        free_picture(&p[i]);
}

/* Work-items take packets from a counter, which must stand at the beginning for every picture, whatever its size. */
static void a_shader_draws_again(void **state)
{
    (void)state;
    const int sizes[][2] = {{101, 75}, {5, 3}, {101, 75}, {160, 120}, {101, 75}};
    for (int k = 0; k < 2; k++) {
        karst_error error = {0};
        scene s = make_scene(contexts[k], 1);
        karst_cast_view view = scene_view(&s, eye, 1);
        karst_light light = make_light(35);
        karst_caster *caster = open_caster(&s, "");
        karst_shader *shader = karst_shader_create(s.context, false, &error);
        scene_check(shader, &error);
        uint8_t *first = NULL;
        uint32_t first_counters[4] = {0};
        for (int i = 0; i < 5; i++) {
            karst_pinhole pinhole = make_pinhole(sizes[i][0], sizes[i][1], 50, -18, 300);
            size_t num_pixels = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
            karst_buffer *hits = scene_buffer(s.context, "hits", num_pixels * sizeof(karst_hit)),
                         *pixels = scene_buffer(s.context, "pixels", num_pixels * 4),
                         *counters = scene_buffer(s.context, "counters", KARST_SHADE_COUNTERS * 4);
            uint32_t counted[4];
            scene_check(karst_cast_pinhole(caster, &view, &pinhole, hits, &error) &&
                            karst_shade_pixels(shader, &view, &pinhole, &light, hits, NULL, pixels->mem, NULL, counters,
                                               &error) &&
                            karst_buffer_read(counters, 0, counted, 16, &error),
                        &error);
            uint8_t *rgba = read_all(pixels);
            for (size_t p = 0; p < num_pixels; p++)
                assert_int_equal(rgba[4 * p + 3], 255); /* nobody left it out */
            if (!first) {
                memcpy(first_counters, counted, sizeof counted);
                assert_true(counted[0] > num_pixels / 3);
            } else if (sizes[i][0] == sizes[0][0]) {
                assert_memory_equal(first, rgba, num_pixels * 4);
                assert_memory_equal(first_counters, counted, sizeof counted);
            }
            if (first)
                free(rgba);
            else
                first = rgba;
            karst_buffer_destroy(counters);
            karst_buffer_destroy(pixels);
            karst_buffer_destroy(hits);
        }
        free(first);
        karst_shader_destroy(shader);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

static bool is_shadowed(const picture *p, uint32_t pixel)
{
    return memcmp(p->sunny + 4 * (size_t)pixel, p->rgba + 4 * (size_t)pixel, 4) != 0;
}

/* Where a hit at distance t lies in the world. */
static void hit_place(const karst_pinhole *p, uint32_t x, uint32_t y, float t, double at[3])
{
    double sx = ((x + 0.5) * 2 / p->width_px - 1) * p->half_width, d[3], length = 0;
    double sy = (1 - (y + 0.5) * 2 / p->height_px) * p->half_height;
    for (int a = 0; a < 3; a++) {
        d[a] = p->forward[a] + sx * p->right[a] + sy * p->up[a];
        length += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++)
        at[a] = eye[a] + d[a] * t / sqrt(length);
}

/* A pixel is dark exactly if its ray, cast among others, does not get to the sun; beams or none, and stamps and wishes
 * are the same. */
static void shadows_are_what_rays_meet(void **state)
{
    (void)state;
    karst_error error = {0};
    const karst_pinhole pinhole = make_pinhole(101, 75, 50, -18, 300);
    const size_t num = 101 * 75;
    for (int k = 0; k < 3; k++) {
        scene s = make_scene(contexts[k == 1], k == 2 ? 4 : 1);
        const karst_light light = make_light(k == 2 ? 35 : 20);
        karst_cast_view view = scene_view(&s, eye, 1);
        view.blend = 0.25f;
        picture p = take_picture(&s, &view, &pinhole, &light, true);
        karst_buffer *const stamps[3] = {s.buffers.tile_stamp, s.buffers.brick_stamp, s.buffers.want_brick};
        uint32_t *before[3];
        for (int i = 0; i < 3; i++)
            before[i] = read_stamps(stamps[i]);
        karst_caster *casters[2] = {open_caster(&s, ""), open_caster(&s, KARST_CAST_NO_BEAM)};
        for (int c = 0; c < 2; c++) {
            for (int i = 0; i < 3; i++)
                scene_check(karst_buffer_fill(stamps[i], 0, 0, stamps[i]->size_bytes, &error), &error);
            free(cast_picture(&s, casters[c], &view, &pinhole));
            karst_hit *hits = cast(&s, casters[c], &view, p.rays, (uint32_t)num, true);
            size_t num_dark = 0, num_lit = 0;
            for (uint32_t y = 0; y < 75; y++)
                for (uint32_t x = 0; x < 101; x++) {
                    uint32_t i = karst_packet_order(x, y, 101, 75), pixel = y * 101 + x;
                    bool blocked = KARST_HIT_KIND(hits[i].kind) != KARST_HIT_MISS;
                    assert_memory_equal(p.rgba + 4 * pixel, blocked ? (uint8_t *)&p.rays[i].pixel : p.sunny + 4 * pixel,
                                        4);
                    num_dark += blocked;
                    num_lit += !blocked && p.rays[i].t_max > 0;
                }
            assert_true(num_dark > 100 && num_lit > 1000);
            free(hits);
            for (int i = 0; i < 3; i++) {
                uint32_t *now = read_stamps(stamps[i]);
                assert_memory_equal(before[i], now, stamps[i]->size_bytes);
                free(now);
            }
            karst_caster_destroy(casters[c]);
        }
        for (int i = 0; i < 3; i++)
            free(before[i]);
        free_picture(&p);
        scene_destroy(&s);
    }
}

/* Who goes without shadows compiles nothing for them, and is told so. */
static void without_shadows_there_is_no_kernel(void **state)
{
    (void)state;
    karst_error error = {0};
    scene s = make_scene(contexts[0], 1);
    karst_cast_view view = scene_view(&s, eye, 1);
    const karst_pinhole pinhole = make_pinhole(16, 16, 50, -18, 300);
    const karst_light light = make_light(35);
    karst_caster *caster = open_caster(&s, KARST_CAST_NO_SHADOWS " " KARST_CAST_NO_STREAMS);
    karst_shader *shader = karst_shader_create(s.context, false, &error);
    scene_check(shader, &error);
    karst_buffer *rays = scene_buffer(s.context, "rays", karst_cast_shadow_bytes(16, 16)),
                 *hits = scene_buffer(s.context, "hits", 256 * sizeof(karst_hit)),
                 *pixels = scene_buffer(s.context, "pixels", 256 * 4),
                 *depth = scene_buffer(s.context, "depth", 256 * 4),
                 *counters = scene_buffer(s.context, "counters", KARST_SHADE_COUNTERS * 4);
    assert_false(karst_cast_shadows(caster, &view, &pinhole, &light, rays, pixels->mem, &error));
    assert_non_null(strstr(error.message, "without shadows"));
    error = (karst_error){0};
    assert_false(karst_cast_rays(caster, &view, hits, 1, true, hits, &error));
    assert_non_null(strstr(error.message, "without streams"));
    error = (karst_error){0};
    scene_check(karst_cast_pinhole(caster, &view, &pinhole, hits, &error), &error);
    assert_false(karst_shade_pixels(shader, &view, &pinhole, &light, hits, rays, pixels->mem, depth, counters, &error));
    assert_non_null(strstr(error.message, "without shadows"));
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    karst_buffer *const all[] = {rays, hits, pixels, depth, counters};
    for (int i = 0; i < 5; i++)
        karst_buffer_destroy(all[i]);
    scene_destroy(&s);
}

/* The ball's shadow lies where geometry says, and nowhere else: the lit ground and the lit side of the ball are clear
 * of it. */
static void shadows_fall_where_they_should(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++)
        for (int low = 0; low < 2; low++) {
            scene s = make_scene(contexts[k], 1);
            karst_cast_view view = scene_view(&s, eye, 1);
            karst_pinhole pinhole = make_pinhole(160, 120, 50, -22, 300);
            karst_light light = make_light(low ? 12 : 50);
            picture p = take_picture(&s, &view, &pinhole, &light, true);
            const float *sun = light.sun_direction;
            int num_shadowed = 0, num_lit = 0;
            for (uint32_t y = 0; y < 120; y++)
                for (uint32_t x = 0; x < 160; x++) {
                    uint32_t i = karst_packet_order(x, y, 160, 120);
                    const karst_ray *ray = &p.rays[i];
                    if (KARST_HIT_KIND(p.hits[i].kind) == KARST_HIT_MISS) {
                        assert_true(ray->t_max <= ray->t_min);
                        continue;
                    }
                    bool has_ray = ray->t_max > ray->t_min;
                    if (has_ray)
                        assert_true(ray->width * view.detail >= (float)(1 << KARST_HIT_LEVEL(p.hits[i].kind)));
                    double at[3], to_ball = 0, along = 0, height;
                    hit_place(&pinhole, x, y, p.hits[i].t, at);
                    height = at[1];
                    for (int a = 0; a < 3; a++) {
                        double d = (a == 1 ? 25 : 0) - at[a];
                        to_ball += d * d;
                        along += d * sun[a];
                    }
                    double miss = sqrt(to_ball - along * along);
                    bool on_ground = height < 5, shadowed = is_shadowed(&p, y * 160 + x);
                    assert_true(has_ray || (!on_ground && !shadowed)); /* else it faces away */
                    if (on_ground && along > 0 && miss < 10) {
                        assert_true(shadowed);
                        num_shadowed++;
                    } else if (on_ground && (along < 0 || miss > 15)) {
                        assert_false(shadowed);
                        num_lit++;
                    } else if (!on_ground && along < -3) { /* the ball's lit side */
                        assert_true(has_ray);
                        assert_false(shadowed);
                        num_lit++;
                    }
                }
            /* Low light grazes the ground; the shadow then falls out of the picture. */
            assert_true(num_lit > 5000 && (low || num_shadowed > 200));
            free_picture(&p);
            scene_destroy(&s);
        }
}

/* Shadow rays ask for nothing finer than what the picture has. */
static void shadows_want_no_finer_levels(void **state)
{
    (void)state;
    scene s = make_scene(contexts[0], 1);
    /* Everything below level 2 is taken away, and the camera asks for level 2 at most. */
    for (uint32_t i = 8; i < s.num_tiles * 8; i++)
        if (s.tiles[i / 8].level == 2)
            s.nodes[i].link &= ~KARST_MAX_TILES;
    scene_upload(&s);
    karst_cast_view view = scene_view(&s, eye, 1);
    karst_pinhole pinhole = make_pinhole(100, 80, 50, -22, 300);
    pinhole.t_min = 40;
    view.detail = 4.1f / (pinhole.cone * pinhole.t_min);
    karst_light light = make_light(30);
    picture p = take_picture(&s, &view, &pinhole, &light, true);
    for (size_t i = 0; i < p.num_pixels; i++)
        assert_true(KARST_HIT_KIND(p.hits[i].kind) == KARST_HIT_MISS || p.hits[i].t > 40);
    assert_int_equal(count_stamps(s.buffers.want_children, view.serial), 0);
    assert_int_equal(count_stamps(s.buffers.want_brick, view.serial), 0);
    free_picture(&p);
    scene_destroy(&s);
}

/* Sun side against shadow side, day against dusk: light goes where it should. */
static void light_behaves(void **state)
{
    (void)state;
    scene s = make_scene(contexts[0], 1);
    karst_cast_view view = scene_view(&s, eye, 1);
    karst_pinhole pinhole = make_pinhole(80, 60, 50, -18, 300);
    karst_light light = make_light(40), night = light;
    memset(night.sun_colour, 0, sizeof(night.sun_colour));
    memset(night.sky_zenith, 0, sizeof(night.sky_zenith));
    memset(night.sky_horizon, 0, sizeof(night.sky_horizon));
    picture day = take_picture(&s, &view, &pinhole, &light, true),
            dark = take_picture(&s, &view, &pinhole, &night, true);
    picture flat = take_picture(&s, &view, &pinhole, &light, false);
    double sums[2][2] = {{0}};
    int counts[2] = {0};
    for (uint32_t y = 0; y < 60; y++)
        for (uint32_t x = 0; x < 80; x++) {
            uint32_t i = karst_packet_order(x, y, 80, 60);
            const uint8_t *lit = day.rgba + 4 * (y * 80 + x), *unshadowed = flat.rgba + 4 * (y * 80 + x);
            for (int c = 0; c < 3; c++)
                assert_true(dark.rgba[4 * (y * 80 + x) + (uint32_t)c] <= 1);
            if (KARST_HIT_KIND(day.hits[i].kind) == KARST_HIT_MISS) {
                assert_memory_equal(lit, unshadowed, 4);
                continue;
            }
            int shadowed = is_shadowed(&day, y * 80 + x);
            counts[shadowed]++;
            sums[shadowed][0] += lit[0] + lit[1] + lit[2];
            sums[shadowed][1] += unshadowed[0] + unshadowed[1] + unshadowed[2];
        }
    assert_true(counts[0] > 100 && counts[1] > 100);
    assert_true(sums[0][0] == sums[0][1]);      /* out of the shadow nothing changes */
    assert_true(sums[1][0] < 0.8 * sums[1][1]); /* in it, it is darker */
    assert_true(sums[1][0] / counts[1] > 40);   /* but not black: the sky lights it */
    free_picture(&day);
    free_picture(&dark);
    free_picture(&flat);
    scene_destroy(&s);
}

/* From light to 255ths, in the host's mathematics. */
static double exact_curve(double x)
{
    double film = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    return 255 * (film <= 0.0031308 ? 12.92 * film : 1.055 * pow(film, 1 / 2.4) - 0.055);
}

/* The same source as on the device, against that. */
static void tone_functions_are_close(void **state)
{
    (void)state;
    double sum = 0;
    for (int i = 0; i <= 100000; i++) {
        double y = i / 1000.0;
        assert_true(fabs((double)tone_exp2_minus((float)y) - exp2(-y)) < 2e-5);
        float dither = tone_dither(i % 1000, i / 1000);
        assert_true(fabsf(dither) < 0.5f);
        sum += dither;
    }
    assert_true(fabs(sum / 100001) < 0.003);
    /* Each 64th float up to where it is cut off, and beyond. */
    float last = 0;
    for (uint32_t bits = 0; bits <= k_as_uint(16.0f); bits += 64) {
        float x = k_as_float(bits), curve = tone_curve(x, 0);
        double exact = exact_curve((double)x);
        if (fabs(fmin((double)curve, 255) - fmin(exact, 255)) >= 0.1)
            fail_msg("of %.9g it is %.9g, not %.9g", (double)x, (double)curve, exact);
        if (curve < last - 1e-4f)
            fail_msg("at %.9g it falls, from %.9g to %.9g", (double)x, (double)last, (double)curve);
        last = curve;
    }
    for (float dither = -0.49999f; dither < 0.5f; dither += 0.33333f) {
        assert_int_equal(tone_byte(0, dither), 0);
        assert_int_equal(tone_byte(1e9f, dither), 255);
        assert_int_equal(tone_byte(INFINITY, dither), 255);
    }
}

/* Where cubics meet they are exact, and at the inner nodes: so their numbers are what they are said to be. */
static void tone_cubics_are_exact_at_their_nodes(void **state)
{
    (void)state;
    for (int exponent = TONE_LEAST_EXPONENT; exponent < TONE_LEAST_EXPONENT + 16; exponent++) {
        double end = ldexp(1, exponent - 126), start = exponent == TONE_LEAST_EXPONENT ? 0 : end / 2;
        for (int node = 0; node < 4; node++) {
            double x = (start + end) / 2 - (end - start) / 2 * cos(3.14159265358979 / 3 * node);
            float light = (float)fmin(x, (double)nextafterf((float)end, 0));
            if (light > TONE_MOST_LIGHT)
                continue;
            assert_true(fabs((double)tone_curve(light, 0) - exact_curve((double)light)) < 2e-4);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outputs_belong_to_the_hits),
        cmocka_unit_test(gaps_are_counted),
        cmocka_unit_test(lanes_and_segments_give_the_same_bytes),
        cmocka_unit_test(a_shader_draws_again),
        cmocka_unit_test(shadows_are_what_rays_meet),
        cmocka_unit_test(without_shadows_there_is_no_kernel),
        cmocka_unit_test(shadows_fall_where_they_should),
        cmocka_unit_test(shadows_want_no_finer_levels),
        cmocka_unit_test(light_behaves),
        cmocka_unit_test(tone_functions_are_close),
        cmocka_unit_test(tone_cubics_are_exact_at_their_nodes),
    };
    int failed = cmocka_run_group_tests(tests, open_contexts, close_all);
    return failed;
}
