/* Blending between levels: nothing pops, nothing slips through where levels meet, and a hit still depends on its ray
 * and its cells alone. */
#include "raycast/light/shade.h"
#include "tests/raycast/casting.h"

/* Here voxels are seen from some 30 voxels away, not from 1000: over the share that views have, that is less than two
 * cells, and hits would be judged by how a cell's cubic follows a bend. */
#define BLEND 0.125f

typedef struct {
    double steepness;
    double rise; /* levels lie higher by so much of their voxel, with those of 3 voxels at 0 */
} ground;

/* Ground with bumps of every size down to a voxel or two, of which coarser levels lack the finer ones altogether: what
 * differs most from level to level. */
static double bumps(const double p[3], double width, const void *user)
{
    const ground *g = user;
    double sum = g->rise * (width - 3) - p[1], size = 32, height = 8 * g->steepness;
    for (int i = 0; i < 5; i++, size *= 0.5, height *= 0.5)
        if (size >= 2 * width)
            sum += height * sin(p[0] / size * 3 + i) * cos(p[2] / size * 3 - p[1] / size);
    return sum;
}

static const ground gentle = {0.1, 0}, steep = {0.6, 0}, rising = {0.5, 2}, leaping = {0.5, 6}, apart = {0.1, 24};

static scene open_scene(karst_context *context, const ground *of)
{
    scene s = scene_create(context, 4000, 9000, 1, 5, bumps, of);
    s.lipschitz = 6 + of->rise; /* beyond the slope: constant nodes are so on the next level too */
    scene_classify_tile(&s, KARST_ROOT_TILE);
    for (uint32_t i = 8; i < 16; i++)
        s.nodes[i].link = KARST_NODE_LINK(KARST_STATE_UNKNOWN, 0);
    scene_upload(&s);
    return s;
}

/* ---- no pop ---- */

#define WIDTH 96
#define HEIGHT 64
#define NUM_PIXELS (WIDTH * HEIGHT)
#define NUM_STEPS 200
#define STEP_VOXELS 0.01

typedef struct {
    karst_hit hits[NUM_PIXELS];
    uint8_t rgba[4 * NUM_PIXELS]; /* in pixel order, the hits in packet order */
} frame;

/* The largest change of a pixel (in steps of 8 bits) and of a depth (in voxels of its level) from one frame to the
 * next: among pixels that went to another level, among those that were on the way there, and among all others. */
enum { OTHERS, BLENDED, CROSSING };
typedef struct {
    int pixel[3];
    double depth[3];
    int num_crossings;
} changes;

static bool is_blended(const karst_hit *hit, float cone)
{
    return hit->t * cone > ldexpf(1 - KARST_BLEND_SHARE, (int)KARST_HIT_LEVEL(hit->kind) + 1);
}

static void compare_frames(const frame *a, const frame *b, float cone, changes *c)
{
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            uint32_t i = karst_packet_order(x, y, WIDTH, HEIGHT);
            uint32_t level = KARST_HIT_LEVEL(a->hits[i].kind);
            int what = is_blended(&a->hits[i], cone) || is_blended(&b->hits[i], cone) ? BLENDED : OTHERS;
            if (level != KARST_HIT_LEVEL(b->hits[i].kind))
                what = CROSSING;
            for (int k = 0; k < 3; k++) {
                uint32_t at = 4 * (y * WIDTH + x) + (uint32_t)k;
                int d = abs(a->rgba[at] - b->rgba[at]);
                c->pixel[what] = d > c->pixel[what] ? d : c->pixel[what];
            }
            double dt = fabs((double)a->hits[i].t - b->hits[i].t) / ldexp(1, (int)level);
            c->depth[what] = dt > c->depth[what] ? dt : c->depth[what];
            c->num_crossings += what == CROSSING;
        }
}

/* A camera looks down on gentle ground and steps forward by hundredths of a voxel. */
static changes fly(float blend)
{
    karst_error error = {0};
    scene s = open_scene(contexts[0], &gentle);
    karst_caster *caster = open_caster(&s, "");
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
                               .haze_distance = 3000,
                               .shadow_distance = 400};
    const karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, 30, -60, 450);
    static frame frames[2];
    changes c = {{0}, {0}, 0};
    uint32_t serial = 1;
    for (int step = 0; step < NUM_STEPS; step++) {
        const double way = STEP_VOXELS * step;
        const double eye[3] = {3.3 + way * pinhole.forward[0], 75.1 + way * pinhole.forward[1],
                               -7.7 + way * pinhole.forward[2]};
        karst_cast_view view = scene_view(&s, eye, 1);
        view.blend = blend;
        do {
            view.serial = serial++;
            scene_check(karst_cast_pinhole(caster, &view, &pinhole, hits, &error), &error);
        } while (scene_serve(&s, view.serial));
        frame *now = &frames[step % 2];
        scene_check(
            karst_shade_pixels(shader, &view, &pinhole, &light, hits, NULL, pixels->mem, depth, counters, &error) &&
                karst_buffer_read(hits, 0, now->hits, sizeof(now->hits), &error) &&
                karst_buffer_read(pixels, 0, now->rgba, sizeof(now->rgba), &error),
            &error);
        for (int i = 0; i < NUM_PIXELS; i++)
            assert_int_equal(KARST_HIT_KIND(now->hits[i].kind), KARST_HIT_SURFACE);
        if (step)
            compare_frames(&frames[1 - step % 2], now, pinhole.cone, &c);
    }
    karst_buffer_destroy(hits);
    karst_buffer_destroy(pixels);
    karst_buffer_destroy(depth);
    karst_buffer_destroy(counters);
    karst_shader_destroy(shader);
    karst_caster_destroy(caster);
    scene_destroy(&s);
    return c;
}

/* Tolerances: three steps of 8 bits (others change by more when they pass from cell to cell, where normals jump); a
 * hundredth of a voxel. */
static bool pops(const changes *c)
{
    print_message("%d crossings: pixels change by %d of 255 and %.4f voxels at most, where levels blend by %d and "
                  "%.4f, others by %d and %.4f\n",
                  c->num_crossings, c->pixel[CROSSING], c->depth[CROSSING], c->pixel[BLENDED], c->depth[BLENDED],
                  c->pixel[OTHERS], c->depth[OTHERS]);
    for (int what = BLENDED; what <= CROSSING; what++)
        if (c->pixel[what] > c->pixel[OTHERS] || c->depth[what] > c->depth[OTHERS] + 0.01)
            return true;
    return c->pixel[CROSSING] > 3;
}

static void test_nothing_pops(void **state)
{
    (void)state;
    changes with = fly(KARST_BLEND_SHARE), without = fly(0);
    assert_true(with.num_crossings > 20);
    assert_false(pops(&with));
    assert_true(pops(&without));
}

/* ---- the field, on the host ---- */

/* The value of the node's own samples at p (in its density's units), or +-1 if it is constant. */
static double field_at(scene *s, const double p[3], int level, double *slope)
{
    uint32_t node = scene_find(s, p, level);
    if (KARST_NODE_STATE(s->nodes[node].link) == KARST_STATE_LOST) /* rays just miss it */
        assert_true(scene_load(s, node));
    uint32_t state = KARST_NODE_STATE(s->nodes[node].link);
    *slope = 1;
    if (state == KARST_STATE_AIR || state == KARST_STATE_SOLID)
        return state == KARST_STATE_SOLID ? 100 : -100;
    int64_t n[3];
    int own, cell[3];
    double f[3];
    scene_node_place(s, node, n, &own);
    assert_int_equal(own, level);
    assert_true(s->nodes[node].brick);
    for (int a = 0; a < 3; a++) {
        double x = ldexp(p[a], -level) - (double)n[a] * KARST_BRICK_CELLS;
        cell[a] = (int)floor(x) > 15 ? 15 : (int)floor(x);
        f[a] = x - cell[a];
    }
    const int16_t *q = s->bricks + (size_t)s->nodes[node].brick * KARST_BRICK_STRIDE;
    double value = 0, least = 1e9, most = -1e9;
    for (int i = 0; i < 8; i++) {
        double w = 1, v = q[cell[0] + (i & 1) +
                            KARST_BRICK_SIDE * (cell[1] + (i >> 1 & 1) + KARST_BRICK_SIDE * (cell[2] + (i >> 2)))];
        for (int a = 0; a < 3; a++)
            w *= i >> a & 1 ? f[a] : 1 - f[a];
        value += w * v;
        least = v < least ? v : least;
        most = v > most ? v : most;
    }
    *slope = (most - least) * s->brick_info[s->nodes[node].brick].scale;
    return value * s->brick_info[s->nodes[node].brick].scale;
}

/* What a ray should see at t: level and weight from t alone. */
static double blended_at(scene *s, const double anchor[3], const karst_ray *ray, double t, double *slope)
{
    double p[3], footprint = ray->width + ray->cone * t, other;
    int level = footprint < 1 ? 0 : (int)floor(log2(footprint));
    for (int a = 0; a < 3; a++)
        p[a] = anchor[a] + ray->origin[a] + (double)ray->direction[a] * t;
    double value = field_at(s, p, level, slope), weight = (ldexp(footprint, -level - 1) - 1 + BLEND) / BLEND;
    return weight <= 0 ? value : value + fmin(1, weight) * (field_at(s, p, level + 1, &other) - value);
}

/* All rays see the field's first zero: none slips through, where levels meet or elsewhere. tolerance: in voxels. In the
 * cell in which a blend begins its weight is taken to rise evenly, though it has a kink: that moves a surface by a part
 * of how much the levels differ. */
static void check_hits(const ground *of, double tolerance)
{
    enum { NUM_RAYS = 1000 };
    const double anchor[3] = {0.3, 30.2, 0.7}, fine_step = 0.02;
    uint64_t random = 5;
    scene s = open_scene(contexts[0], of);
    karst_caster *caster = open_caster(&s, "");
    static karst_ray rays[NUM_RAYS];
    for (int i = 0; i < NUM_RAYS; i++) {
        double d[3], origin[3] = {0, 0, 0};
        random_direction(&random, d);
        /* Flat, since wide rays do not blend. */
        d[1] *= 0.4;
        const double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        for (int axis = 0; axis < 3; axis++)
            d[axis] /= length;
        d[1] = -fabs(d[1]);
        rays[i] = make_ray(origin, d, 200);
        /* Most hit in the last eighth of a level, or about where one begins. */
        double hit_t = 30 / (fabs(d[1]) + 0.05), at = 0.87 + 0.15 * next_random(&random);
        rays[i].cone = (float)fmin(ldexp(at, 1 + i % 2) / hit_t, 0.06);
        rays[i].t_max = (float)fmin(200, 15.9 / rays[i].cone);
    }
    karst_cast_view view = scene_view(&s, anchor, 1);
    view.blend = BLEND;
    karst_hit *hits = NULL;
    do {
        free(hits);
        view.serial++;
        hits = cast(&s, caster, &view, rays, NUM_RAYS, false);
    } while (scene_serve(&s, view.serial));
    int num_hits = 0, num_blended = 0;
    for (int i = 0; i < NUM_RAYS; i++) {
        const karst_ray *ray = &rays[i];
        double slope, end = hits[i].t, first = -1;
        bool is_hit = KARST_HIT_KIND(hits[i].kind) == KARST_HIT_SURFACE;
        assert_true(is_hit || KARST_HIT_KIND(hits[i].kind) == KARST_HIT_MISS);
        for (double t = 0; t < end && first < 0; t += fine_step)
            if (blended_at(&s, anchor, ray, t, &slope) > tolerance * slope)
                first = t;
        if (first >= 0 && first < end - 2 * fine_step)
            fail_msg("ray %d passes the surface at %g and ends at %g", i, first, end);
        if (!is_hit)
            continue;
        double value = blended_at(&s, anchor, ray, end, &slope), footprint = ray->cone * end;
        double share = ldexp(footprint, -(int)KARST_HIT_LEVEL(hits[i].kind));
        if (fabs(value) > tolerance * slope)
            fail_msg("ray %d hits at %g where the field is %g (%g over a voxel)", i, end, value, slope);
        num_hits++;
        num_blended += share > 2 * (1 - BLEND) && share < 2;
    }
    assert_true(num_hits > NUM_RAYS / 2);
    assert_true(num_blended > NUM_RAYS / 8);
    free(hits);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

static void test_hits_are_on_the_blended_field(void **state)
{
    (void)state;
    check_hits(&steep, 0.1);
    check_hits(&rising, 0.2);
    check_hits(&leaping, 0.6);
    check_hits(&apart, 1.5); /* where blocks that have a surface in neither level have one when blended */
}

/* ---- clear nodes ---- */

/* Nodes whose samples lie on one side have no brick, unless one was wanted since. Returns how many. */
static uint32_t take_clear_bricks(scene *s, const uint8_t *kept)
{
    uint32_t count = 0;
    for (uint32_t node = 8; node < s->num_tiles * 8; node++) {
        karst_node *n = &s->nodes[node];
        if (KARST_NODE_STATE(n->link) != KARST_STATE_BRICK ||
            (s->brick_info[n->brick].blocks[0] | s->brick_info[n->brick].blocks[1]))
            continue;
        bool solid = s->bricks[(size_t)n->brick * KARST_BRICK_STRIDE] > 0;
        n->link =
            KARST_NODE_LINK(solid ? KARST_STATE_CLEAR_SOLID : KARST_STATE_CLEAR_AIR, KARST_NODE_CHILDREN(n->link));
        if (!kept[node])
            n->brick = KARST_NONE;
        count++;
    }
    return count;
}

/* With clear nodes, whose bricks come when rays ask for them, the picture is that of a pool that holds all bricks; in
 * 16 lanes and in one; in any number of segments; and with any safe steps. */
static void test_the_same_hits_with_clear_nodes_lanes_segments_and_steps(void **state)
{
    (void)state;
    const double eye[3] = {3.3, 31.1, -7.7};
    karst_pinhole pinhole = make_pinhole(WIDTH, HEIGHT, 30, -20, 400);
    scene s = open_scene(contexts[0], &rising);
    karst_caster *caster = open_caster(&s, "");
    karst_cast_view view = scene_view(&s, eye, 0.5f);
    view.blend = 0.5f;
    karst_hit *hits = NULL;
    do {
        free(hits);
        view.serial++;
        hits = cast_picture(&s, caster, &view, &pinhole);
    } while (scene_serve(&s, view.serial));

    scene other = scene_clone(contexts[1], 3, &s);
    karst_caster *one_lane = open_caster(&other, ""), *no_steps = open_caster(&s, "-DKARST_SAFE_STEP_SHARE=0.0f");
    karst_hit *others = cast_picture(&other, one_lane, &view, &pinhole);
    assert_memory_equal(hits, others, NUM_PIXELS * sizeof(*hits));
    free(others);
    others = cast_picture(&s, no_steps, &view, &pinhole);
    assert_memory_equal(hits, others, NUM_PIXELS * sizeof(*hits));
    free(others);

    karst_node *nodes = malloc(s.num_tiles * 8 * sizeof(*nodes));
    uint8_t *kept = calloc(s.num_tiles, 8);
    memcpy(nodes, s.nodes, s.num_tiles * 8 * sizeof(*nodes));
    uint32_t num_wanted, num_clear, rounds = 0, num_kept = 0;
    do {
        memcpy(s.nodes, nodes, s.num_tiles * 8 * sizeof(*nodes));
        num_clear = take_clear_bricks(&s, kept);
        scene_upload(&s);
        view.serial++;
        others = cast_picture(&s, caster, &view, &pinhole);
        uint32_t *wants = read_stamps(s.buffers.want_brick);
        num_wanted = 0;
        for (uint32_t node = 8; node < s.num_tiles * 8; node++)
            if (wants[node] == view.serial) {
                assert_false(kept[node]);
                kept[node] = 1;
                num_wanted++;
            }
        num_kept += num_wanted;
        free(wants);
        if (num_wanted)
            free(others);
    } while (num_wanted && ++rounds < 10);
    print_message("%u clear nodes, of which blending wanted %u bricks\n", num_clear, num_kept);
    assert_int_equal(num_wanted, 0);
    assert_true(num_kept > 0 && num_kept < num_clear);
    assert_memory_equal(hits, others, NUM_PIXELS * sizeof(*hits));
    free(others);
    free(nodes);
    free(kept);
    free(hits);
    karst_caster_destroy(one_lane);
    karst_caster_destroy(no_steps);
    karst_caster_destroy(caster);
    scene_destroy(&other);
    scene_destroy(&s);
}

static karst_hit *settled_hits(scene *s, karst_caster *caster, karst_cast_view *view, const karst_ray *rays,
                               uint32_t num)
{
    karst_hit *hits = NULL;
    do {
        free(hits);
        view->serial++;
        hits = cast(s, caster, view, rays, num, false);
    } while (scene_serve(s, view->serial));
    return hits;
}

/* Rays of a stream that pass a level within a brick see what they see without blending, and their hits say so; narrower
 * ones do not. The same in both shapes. */
static void test_wide_rays_do_not_blend(void **state)
{
    (void)state;
    enum { NUM = 600 };
    const double anchor[3] = {0.5, 30.5, 0.5}, zero[3] = {0, 0, 0};
    static karst_ray rays[2][NUM];
    uint64_t random = 5;
    for (int i = 0; i < NUM; i++) {
        double d[3];
        random_direction(&random, d);
        d[1] = -fabs(d[1]);
        for (int wide = 0; wide < 2; wide++) {
            rays[wide][i] = make_ray(zero, d, 300);
            rays[wide][i].cone = wide ? 0.07f : 0.055f; /* 1/16 lies between */
        }
    }
    karst_hit *first = NULL;
    for (int k = 0; k < 2; k++) {
        scene s = open_scene(contexts[k], &steep);
        karst_caster *caster = open_caster(&s, "");
        int num_unlike[2] = {0}, num_hits[2] = {0};
        for (int wide = 0; wide < 2; wide++) {
            karst_cast_view view = scene_view(&s, anchor, 1);
            karst_hit *plain = settled_hits(&s, caster, &view, rays[wide], NUM);
            view.blend = 0.5f;
            karst_hit *hits = settled_hits(&s, caster, &view, rays[wide], NUM);
            for (int i = 0; i < NUM; i++) {
                if (KARST_HIT_KIND(hits[i].kind) == KARST_HIT_SURFACE) {
                    num_hits[wide]++;
                    assert_int_equal((hits[i].kind & KARST_HIT_UNBLENDED) != 0, wide);
                }
                num_unlike[wide] += hits[i].t != plain[i].t;
            }
            free(plain);
            if (!first)
                first = hits;
            else if (!wide)
                for (int i = 0; i < NUM; i++)
                    assert_true(first[i].t == hits[i].t && first[i].kind == hits[i].kind);
            if (first != hits)
                free(hits);
        }
        print_message("%d and %d hits, %d and %d of them not as without blending\n", num_hits[0], num_hits[1],
                      num_unlike[0], num_unlike[1]);
        assert_true(num_hits[0] > NUM / 4 && num_hits[1] > NUM / 4);
        assert_int_equal(num_unlike[1], 0);
        assert_true(num_unlike[0] > NUM / 20);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
    free(first);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nothing_pops),
        cmocka_unit_test(test_hits_are_on_the_blended_field),
        cmocka_unit_test(test_the_same_hits_with_clear_nodes_lanes_segments_and_steps),
        cmocka_unit_test(test_wide_rays_do_not_blend),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
