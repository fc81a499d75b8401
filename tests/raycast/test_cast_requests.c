/* Levels by footprint, and what rays leave behind: stamps, wants, stand-ins, holes. */
#include "tests/raycast/casting.h"

/* A floor, and a ray down on it from `height` that asks for `level` there (or finer). */
static const double ground[5] = {0, 1, 0, 0.5, 0};
static const double anchor[3] = {5.25, 40.5, 6.75};

static karst_ray down(int level)
{
    const double zero[3] = {0}, d[3] = {0, -1, 0};
    karst_ray ray = make_ray(zero, d, 100);
    ray.width = 1.3f * (float)(1 << level);
    return ray;
}

/* The node of `level` that the ray ends in. */
static uint32_t node_under(const scene *s, int level)
{
    const double p[3] = {anchor[0], 0.4, anchor[2]};
    uint32_t node = scene_find(s, p, level);
    assert_int_equal(s->tiles[node / 8].level, level);
    return node;
}

typedef struct {
    uint32_t brick_stamps, fallbacks, want_brick, want_children;
} left_behind;

static left_behind count_all(const scene *s, uint32_t serial)
{
    left_behind n = {count_stamps(s->buffers.brick_stamp, serial), count_stamps(s->buffers.brick_fallback, serial),
                     count_stamps(s->buffers.want_brick, serial), count_stamps(s->buffers.want_children, serial)};
    return n;
}

static uint32_t stamp_of(karst_buffer *buffer, uint32_t i)
{
    uint32_t *stamps = read_stamps(buffer), value = stamps[i];
    free(stamps);
    return value;
}

static karst_hit cast_down(scene *s, karst_caster *caster, int level, uint32_t serial)
{
    karst_cast_view view = scene_view(s, anchor, 1);
    view.serial = serial;
    karst_ray ray = down(level);
    karst_hit *hits = cast(s, caster, &view, &ray, 1, false), hit = hits[0];
    free(hits);
    return hit;
}

/* All there: used stamps along the way, no wants; at every level that is asked for. */
static void settled_leaves_use_only(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, ground);
        scene_build(&s, 0);
        karst_caster *caster = open_caster(&s, "");
        for (int level = 0; level <= 3; level++) {
            uint32_t serial = 10 + (uint32_t)level;
            karst_hit hit = cast_down(&s, caster, level, serial);
            assert_int_equal(hit.kind, KARST_HIT_SURFACE | (uint32_t)level << 8);
            assert_true(fabs(hit.t - 40) < 5e-3); /* 16-bit samples */
            uint32_t node = node_under(&s, level);
            assert_int_equal(hit.node, node);
            left_behind n = count_all(&s, serial);
            assert_int_equal(n.fallbacks + n.want_brick + n.want_children + count_stamps(s.buffers.want_chunk, serial),
                             0);
            assert_int_equal(stamp_of(s.buffers.brick_stamp, s.nodes[node].brick), serial);
            /* The tiles down to this level, and none below. */
            for (uint32_t tile = node / 8, up = 0; up <= 3 - (uint32_t)level; up++) {
                assert_int_equal(stamp_of(s.buffers.tile_stamp, tile), serial);
                tile = s.tiles[tile].parent / 8;
            }
            uint32_t *stamps = read_stamps(s.buffers.tile_stamp);
            for (uint32_t tile = 1; tile < s.num_tiles; tile++)
                assert_true(stamps[tile] != serial || s.tiles[tile].level >= level);
            free(stamps);
        }
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* A brick on the way down is wanted even where a stand-in is near. */
#define EVERY_LEVEL "-DSTAND_IN_LEVELS=1"

static void missing_children_are_wanted(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, ground);
        scene_build(&s, 0);
        karst_caster *caster = open_caster(&s, EVERY_LEVEL);
        /* The node of level 2 loses its children: its brick stands in. */
        uint32_t node = node_under(&s, 2);
        s.nodes[node].link = KARST_NODE_LINK(KARST_STATE_BRICK, 0);
        scene_upload(&s);
        karst_hit hit = cast_down(&s, caster, 0, 5);
        assert_int_equal(hit.kind, KARST_HIT_PROVISIONAL | 2 << 8);
        assert_int_equal(hit.node, node);
        assert_true(fabs(hit.t - 40) < 5e-3); /* 16-bit samples */
        left_behind n = count_all(&s, 5);
        assert_int_equal(n.want_children, 1);
        assert_int_equal(n.want_brick, 0);
        assert_int_equal(stamp_of(s.buffers.want_children, node), 5);
        assert_int_equal(stamp_of(s.buffers.want_chunk, node / KARST_REQUEST_CHUNK), 5);
        assert_int_equal(stamp_of(s.buffers.brick_fallback, s.nodes[node].brick), 5);
        assert_int_not_equal(stamp_of(s.buffers.brick_stamp, s.nodes[node].brick), 5);
        /* Asked for level 2, nothing is missing. */
        hit = cast_down(&s, caster, 2, 6);
        assert_int_equal(hit.kind, KARST_HIT_SURFACE | 2 << 8);
        n = count_all(&s, 6);
        assert_int_equal(n.want_children + n.want_brick + n.fallbacks, 0);
        /* Without children and brick: both are wanted, the parent's brick stands in. */
        uint32_t parent = node_under(&s, 3);
        s.nodes[node] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, 0), 0};
        scene_upload(&s);
        hit = cast_down(&s, caster, 0, 7);
        assert_int_equal(hit.kind, KARST_HIT_PROVISIONAL | 3 << 8);
        assert_int_equal(hit.node, parent);
        n = count_all(&s, 7);
        assert_int_equal(n.want_children, 1);
        assert_int_equal(n.want_brick, 1);
        assert_int_equal(stamp_of(s.buffers.want_brick, node), 7);
        assert_int_equal(stamp_of(s.buffers.want_children, node), 7);
        assert_int_equal(stamp_of(s.buffers.brick_fallback, s.nodes[parent].brick), 7);
        karst_caster_destroy(caster);
        /* The parent's brick stands in well enough for a brick that will soon have no use not to be wanted. */
        caster = open_caster(&s, "");
        hit = cast_down(&s, caster, 0, 8);
        assert_int_equal(hit.kind, KARST_HIT_PROVISIONAL | 3 << 8);
        n = count_all(&s, 8);
        assert_int_equal(n.want_children, 1);
        assert_int_equal(n.want_brick, 0);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* On the way down a brick is wanted only where the next one above is far, and what is asked for is, too. */
static void stand_ins_are_wanted_far_from_what_is_asked_for(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 4, plate, ground);
        scene_build(&s, 0);
        karst_caster *caster = open_caster(&s, "-DSTAND_IN_LEVELS=2");
        uint32_t above = node_under(&s, 3), node = node_under(&s, 2);
        s.nodes[above] =
            (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, KARST_NODE_CHILDREN(s.nodes[above].link)), KARST_NONE};
        s.nodes[node] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, KARST_NONE), KARST_NONE};
        scene_upload(&s);
        for (int level = 0; level < 2; level++) {
            uint32_t serial = 5 + (uint32_t)level;
            karst_hit hit = cast_down(&s, caster, level, serial);
            assert_int_equal(hit.kind, KARST_HIT_PROVISIONAL | 4 << 8);
            assert_int_equal(stamp_of(s.buffers.want_children, node), serial);
            left_behind n = count_all(&s, serial);
            assert_int_equal(n.want_brick, level == 0);
        }
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

static void missing_bricks_are_wanted(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, ground);
        scene_build(&s, 0);
        karst_caster *caster = open_caster(&s, "");
        /* A brick lost, its children there: only who asks for its level misses it. */
        uint32_t node = node_under(&s, 1), above = node_under(&s, 2);
        s.nodes[node] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, KARST_NODE_CHILDREN(s.nodes[node].link)), 0};
        scene_upload(&s);
        karst_hit hit = cast_down(&s, caster, 0, 5);
        assert_int_equal(hit.kind, KARST_HIT_SURFACE);
        left_behind n = count_all(&s, 5);
        assert_int_equal(n.want_children + n.want_brick + n.fallbacks, 0);
        hit = cast_down(&s, caster, 1, 6);
        assert_int_equal(hit.kind, KARST_HIT_PROVISIONAL | 2 << 8);
        assert_int_equal(hit.node, above);
        assert_true(fabs(hit.t - 40) < 5e-3); /* 16-bit samples */
        n = count_all(&s, 6);
        assert_int_equal(n.want_children, 0);
        assert_int_equal(n.want_brick, 1);
        assert_int_equal(stamp_of(s.buffers.want_brick, node), 6);
        assert_int_equal(stamp_of(s.buffers.brick_fallback, s.nodes[above].brick), 6);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* An empty root: everything is wanted, nothing is there to march, and the picture says so. */
static void unknown_is_incomplete(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, ground);
        scene_upload(&s);
        karst_caster *caster = open_caster(&s, EVERY_LEVEL);
        karst_hit hit = cast_down(&s, caster, 0, 5);
        assert_int_equal(hit.kind, KARST_HIT_MISS | KARST_HIT_INCOMPLETE);
        assert_true(hit.t == 100);
        left_behind n = count_all(&s, 5);
        assert_int_equal(n.want_children, 2); /* the column passes two of the eight */
        assert_int_equal(n.want_brick, 2);
        assert_int_equal(n.fallbacks + n.brick_stamps, 0);
        hit = cast_down(&s, caster, 3, 6);
        assert_int_equal(hit.kind, KARST_HIT_MISS | KARST_HIT_INCOMPLETE);
        n = count_all(&s, 6);
        assert_int_equal(n.want_children, 0);
        assert_int_equal(n.want_brick, 2);
        /* Serving what is wanted fills in what the ray sees, a level at a time. */
        uint32_t serial = 7;
        do {
            hit = cast_down(&s, caster, 0, ++serial);
            assert_true(serial < 30);
        } while (scene_serve(&s, serial));
        assert_int_equal(hit.kind, KARST_HIT_SURFACE);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* What lies behind the surface is neither walked nor wanted; nor is what an idle ray would see. */
static void hidden_things_are_not_wanted(void **state)
{
    (void)state;
    const double shell[4] = {0, 0, 0, 50}, outside[3] = {0.5, 70, 0.5};
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, ball, shell);
        scene_build(&s, 0);
        const double behind[3] = {0.5, -49.9, 0.5};
        uint32_t node = scene_find(&s, behind, 1);
        assert_int_equal(s.tiles[node / 8].level, 1);
        s.nodes[node] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, 0), 0};
        scene_upload(&s);
        karst_caster *caster = open_caster(&s, EVERY_LEVEL);
        karst_cast_view view = scene_view(&s, outside, 1);
        const double zero[3] = {0}, d[3] = {0, -1, 0};
        karst_ray rays[2] = {make_ray(zero, d, 300), make_ray(zero, d, 0)};
        karst_hit *hits = cast(&s, caster, &view, rays, 2, false);
        assert_int_equal(hits[0].kind, KARST_HIT_SURFACE);
        assert_int_equal(hits[1].kind, KARST_HIT_MISS);
        left_behind n = count_all(&s, view.serial);
        assert_int_equal(n.want_children + n.want_brick, 0);
        /* From the other side it is. */
        rays[0].origin[1] = -140;
        rays[0].direction[1] = 1;
        free(hits);
        view.serial = 2;
        hits = cast(&s, caster, &view, rays, 2, false);
        n = count_all(&s, 2);
        assert_int_equal(n.want_children, 1);
        assert_int_equal(n.want_brick, 1);
        free(hits);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* The level of every hit follows from its t: where footprint * detail reaches 2^level, and nowhere else. */
static void level_follows_footprint(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, (double[]){0.05, 0.9987492, 0, 0.5, 0});
        scene_build(&s, 0);
        karst_caster *caster = open_caster(&s, "");
        enum { N = 2000 };
        karst_ray *rays = malloc(N * sizeof(*rays));
        const double high[3] = {0, 15, 0};
        for (int pass = 0; pass < 3; pass++) {
            karst_cast_view view = scene_view(&s, high, pass == 0 ? 1 : pass == 1 ? 0.7f : 2.3f);
            uint64_t random = 8;
            uint32_t seen = 0;
            for (int i = 0; i < N; i++) {
                double o[3] = {0}, d[3] = {next_random(&random) * 2 - 1, -0.15 - 0.1 * next_random(&random),
                                           next_random(&random) * 2 - 1};
                double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
                for (int a = 0; a < 3; a++)
                    d[a] /= length;
                rays[i] = make_ray(o, d, 300);
                rays[i].cone = 0.03f + 0.1f * (float)next_random(&random);
                rays[i].width = pass ? (float)next_random(&random) : 0;
            }
            karst_hit *hits = cast(&s, caster, &view, rays, N, false);
            for (int i = 0; i < N; i++) {
                if (KARST_HIT_KIND(hits[i].kind) == KARST_HIT_MISS)
                    continue;
                assert_int_equal(KARST_HIT_KIND(hits[i].kind), KARST_HIT_SURFACE);
                double footprint = (rays[i].width + (double)rays[i].cone * hits[i].t) * view.detail;
                double level = footprint < 1 ? 0 : floor(log2(footprint)), fraction = footprint / exp2(level);
                if (level > 3)
                    level = 3;
                if (fraction < 1 + 1e-5 || fraction > 2 - 1e-5)
                    continue; /* on the switch itself */
                assert_int_equal(KARST_HIT_LEVEL(hits[i].kind), (int)level);
                seen |= 1u << KARST_HIT_LEVEL(hits[i].kind);
                /* a plane is the same plane at all levels: no crack, no step */
                double p[3];
                for (int a = 0; a < 3; a++)
                    p[a] = high[a] + (double)rays[i].direction[a] * hits[i].t;
                assert_true(fabs(0.05 * p[0] + 0.9987492 * p[1] - 0.5) < 0.01 * exp2(level));
            }
            assert_true(k_popcount(seen) >= 3);
            free(hits);
        }
        free(rays);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* Nothing is descended to below finest_level, and nothing is wanted there. */
static void finest_level_is_kept(void **state)
{
    (void)state;
    scene s = scene_create(contexts[0], 1500, 4000, 1, 3, plate, ground);
    scene_build(&s, 1);
    karst_caster *caster = open_caster(&s, "");
    karst_cast_view view = scene_view(&s, anchor, 1);
    karst_ray ray = down(0);
    view.finest_level = 1;
    karst_hit *hits = cast(&s, caster, &view, &ray, 1, false);
    assert_int_equal(hits[0].kind, KARST_HIT_SURFACE | 1 << 8);
    left_behind n = count_all(&s, view.serial);
    assert_int_equal(n.want_children + n.want_brick + n.fallbacks, 0);
    free(hits);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

/* Of a picture's rays those that end on a stand-in are counted at the node that they ended in, for as many as each
 * stands for; those that pass are not, nor are other streams', nor those of casts before. */
static void rays_that_end_on_stand_ins_are_counted(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, ground);
        scene_build(&s, 0);
        karst_caster *caster = open_caster(&s, EVERY_LEVEL);
        /* One lacks its children and another its brick, too; the one above it, in the air, may not be counted. */
        uint32_t bare = node_under(&s, 2), lost = scene_find(&s, (const double[3]){anchor[0] - 16, 0.4, anchor[2]}, 0);
        const uint32_t above = scene_find(&s, (const double[3]){anchor[0] - 16, 17, anchor[2]}, 0);
        s.nodes[bare].link = KARST_NODE_LINK(KARST_STATE_BRICK, 0);
        s.nodes[lost] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, 0), 0};
        s.nodes[above] = (karst_node){KARST_NODE_LINK(KARST_STATE_LOST, 0), 0};
        scene_upload(&s);
        karst_hit hit = cast_down(&s, caster, 0, 3);
        assert_int_equal(KARST_HIT_KIND(hit.kind), KARST_HIT_PROVISIONAL);
        assert_int_equal(stamp_of(s.buffers.want_rays, bare), 0);
        const karst_pinhole pinhole = make_pinhole(70, 60, 30, -85, 200);
        for (uint32_t serial = 4; serial < 7; serial++) {
            karst_cast_view view = scene_view(&s, anchor, 1);
            view.serial = serial;
            view.stands_for = serial == 6 ? 49 : 1;
            karst_hit *hits = cast_picture(&s, caster, &view, &pinhole);
            uint32_t num_bare = 0, num_lost = 0;
            for (int i = 0; i < 70 * 60; i++)
                if (KARST_HIT_KIND(hits[i].kind) == KARST_HIT_PROVISIONAL) {
                    num_bare += hits[i].node == bare;
                    num_lost += hits[i].node != bare;
                }
            assert_true(num_bare > 100 && num_lost > 20);
            uint32_t *words = read_stamps(s.buffers.want_rays);
            for (uint32_t node = 8; node < s.num_tiles * 8; node++) {
                uint32_t num = (node == bare ? num_bare : node == lost ? num_lost : 0) * view.stands_for;
                assert_int_equal(karst_rays_counted(words[node], serial), num < 0xffff ? num : 0xffff);
            }
            assert_int_equal(stamp_of(s.buffers.want_brick, above), serial);
            free(words);
            free(hits);
        }
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
    /* More than a word counts are that many, whoever comes last; half a word of the serial is told. */
    assert_int_equal(karst_rays_counted(karst_rays_add(karst_rays_add(7u << 16 | 0xfff0, 9, 7), 9, 7), 7), 0xffff);
    assert_int_equal(karst_rays_counted(karst_rays_add(karst_rays_add(6u << 16 | 5, 9, 0x10007), 2, 0x10007), 7), 11);
    assert_int_equal(karst_rays_counted(6u << 16 | 5, 7), 0);
}

enum { NUM_LISTS = 7 };

static void read_lists(const scene *s, uint32_t *lists[NUM_LISTS])
{
    const karst_cache_buffers *b = &s->buffers;
    karst_buffer *const all[NUM_LISTS] = {b->tile_stamp,    b->brick_stamp, b->brick_fallback, b->want_brick,
                                          b->want_children, b->want_chunk,  b->want_rays};
    for (int i = 0; i < NUM_LISTS; i++)
        lists[i] = read_stamps(all[i]);
}

/* While a view is made, from nothing to all that it asks for. */
static void who_wants_no_hits_leaves_the_same(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        karst_error error = {0};
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, ground);
        scene_serve(&s, 1);
        karst_caster *caster = open_caster(&s, "");
        karst_pinhole pinhole = make_pinhole(48, 32, 30, -50, 400);
        karst_cast_view view = scene_view(&s, anchor, 1);
        view.blend = 0.25f;
        view.stands_for = 1;
        uint32_t num_wanted = 0, served;
        do {
            view.serial++;
            uint32_t *with[NUM_LISTS], *without[NUM_LISTS];
            scene_upload(&s);
            free(cast_picture(&s, caster, &view, &pinhole));
            read_lists(&s, with);
            scene_upload(&s);
            scene_check(karst_cast_pinhole(caster, &view, &pinhole, NULL, &error), &error);
            read_lists(&s, without);
            const karst_cache_buffers *b = &s.buffers;
            const size_t bytes[NUM_LISTS] = {b->tile_stamp->size_bytes,    b->brick_stamp->size_bytes,
                                             b->brick_fallback->size_bytes, b->want_brick->size_bytes,
                                             b->want_children->size_bytes, b->want_chunk->size_bytes,
                                             b->want_rays->size_bytes};
            for (int i = 0; i < NUM_LISTS; i++) {
                assert_memory_equal(with[i], without[i], bytes[i]);
                free(with[i]);
                free(without[i]);
            }
            served = scene_serve(&s, view.serial);
            num_wanted += served;
        } while (served);
        assert_true(num_wanted > 20);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* Looks again until nothing is wanted, asking each time for what all rays would. Returns how much was wanted. */
static uint32_t look_until_settled(scene *s, karst_caster *caster, const karst_cast_view *view,
                                   const karst_pinhole *pinhole, karst_buffer *asked)
{
    karst_error error = {0};
    uint32_t num_wanted = 0, served;
    while ((served = scene_serve(s, view->serial)) > 0) {
        num_wanted += served;
        uint32_t *all[NUM_LISTS], *again[NUM_LISTS];
        scene_upload(s);
        scene_check(karst_cast_pinhole(caster, view, pinhole, NULL, &error), &error);
        read_lists(s, all);
        scene_upload(s);
        scene_check(karst_cast_again(caster, view, pinhole, asked, &error), &error);
        read_lists(s, again);
        assert_memory_equal(all[3], again[3], s->buffers.want_brick->size_bytes);
        assert_memory_equal(all[4], again[4], s->buffers.want_children->size_bytes);
        for (int i = 0; i < NUM_LISTS; i++) {
            free(all[i]);
            free(again[i]);
        }
    }
    return num_wanted;
}

/* Within one beam: of its packets those that may ask for something, and no others, are looked at again. What levels
 * need and then what blending needs besides; and both at once. */
static void looking_again_asks_for_all_that_is_missing(void **state)
{
    (void)state;
    for (int run = 0; run < 4; run++) {
        const int k = run % 2, at_once = run / 2;
        karst_error error = {0};
        scene s = scene_create(contexts[k], 1500, 4000, 1, 3, plate, ground);
        scene_serve(&s, 1);
        karst_caster *caster = open_caster(&s, "");
        const int side_px = 32;
        const karst_pinhole pinhole = make_pinhole(side_px, side_px, 30, -50, 400);
        karst_cast_view view = scene_view(&s, anchor, 1);
        view.stands_for = 1;
        const size_t hit_bytes = (size_t)side_px * (size_t)side_px * sizeof(karst_hit);
        karst_buffer *hits = karst_buffer_create(contexts[k], "hits", hit_bytes, NULL, &error);
        karst_buffer *asked = karst_buffer_create(contexts[k], "asked",
                                                  karst_cast_asked_bytes(contexts[k], side_px, side_px), NULL, &error);
        assert_true(hits && asked);
        uint32_t num_wanted[2] = {0, 0};
        for (int blends = at_once; blends < 2; blends++) {
            view.serial = 5 + (uint32_t)blends;
            view.blend = blends ? 0.25f : 0;
            scene_upload(&s);
            scene_check(karst_cast_picture(caster, &view, &pinhole, hits, asked, NULL, &error), &error);
            if (blends && !at_once) { /* nothing was made meanwhile: it asks for the same */
                const left_behind first = count_all(&s, view.serial);
                scene_upload(&s);
                scene_check(karst_cast_again(caster, &view, &pinhole, asked, &error), &error);
                const left_behind again = count_all(&s, view.serial);
                assert_true(first.want_brick > 0);
                assert_int_equal(again.want_brick, first.want_brick);
                assert_true(again.brick_stamps < first.brick_stamps);
            }
            num_wanted[blends] = look_until_settled(&s, caster, &view, &pinhole, asked);
        }
        assert_true(num_wanted[at_once] > 20);
        assert_true(num_wanted[1] > 0);
        karst_buffer_destroy(asked);
        karst_buffer_destroy(hits);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

enum { LACKING_WIDTH = 16, LACKING_HEIGHT = 12, LACKING_RAYS = LACKING_WIDTH * LACKING_HEIGHT };

/* Each ray alone, a few of many: how many want something, and of them those whose pixel has no word. */
static void count_unnoted(const scene *s, karst_caster *caster, karst_cast_view *view, const karst_ray *rays,
                          const uint32_t *words, uint32_t *num_wanting, uint32_t *num_unnoted)
{
    for (uint32_t i = 0; i < LACKING_RAYS; i += 5) {
        view->serial++;
        free(cast(s, caster, view, rays + i, 1, false));
        const left_behind n = count_all(s, view->serial);
        const uint32_t place = karst_packet_order(KARST_RAY_X(rays[i].pixel), KARST_RAY_Y(rays[i].pixel),
                                                  LACKING_WIDTH, LACKING_HEIGHT);
        *num_wanting += n.want_brick + n.want_children > 0;
        *num_unnoted += n.want_brick + n.want_children > 0 && !words[place];
    }
}

/* From nothing to all that rays every way down ask for. Returns how many wanted something that was not noted. */
static uint32_t note_until_settled(karst_context *context, const char *options)
{
    karst_error error = {0};
    scene s = scene_create(context, 1500, 4000, 1, 3, plate, ground);
    scene_serve(&s, 1);
    karst_caster *caster = open_caster(&s, options);
    karst_cast_view view = scene_view(&s, anchor, 1);
    karst_ray rays[LACKING_RAYS];
    for (uint32_t i = 0; i < LACKING_RAYS; i++) {
        const double zero[3] = {0}, angle = 2.4 * i, down = 0.15 + 0.85 * i / LACKING_RAYS,
                     d[3] = {sqrt(1 - down * down) * cos(angle), -down, sqrt(1 - down * down) * sin(angle)};
        rays[i] = make_ray(zero, d, 100);
        rays[i].width = 1.3f * (float)(1 + i % 7);
        /* the two highest bits are whatever the maker likes */
        rays[i].pixel = (i / LACKING_WIDTH) << 16 | i % LACKING_WIDTH | (i % 4) << 30;
    }
    uint32_t zeros[LACKING_RAYS] = {0}, words[LACKING_RAYS], num_wanting = 0, num_unnoted = 0, served;
    karst_buffer *lacking = karst_buffer_create(context, "lacking", sizeof zeros, zeros, &error);
    scene_check(lacking != NULL, &error);
    do {
        scene_upload(&s);
        scene_check(karst_buffer_write(lacking, 0, zeros, sizeof zeros, &error), &error);
        karst_caster_note_lacking(caster, lacking, LACKING_WIDTH, LACKING_HEIGHT);
        const uint32_t serial = ++view.serial;
        free(cast(&s, caster, &view, rays, LACKING_RAYS, false));
        karst_caster_note_lacking(caster, NULL, 0, 0);
        scene_check(karst_buffer_read(lacking, 0, words, sizeof words, &error), &error);
        const left_behind all = count_all(&s, serial);
        served = scene_serve(&s, serial);
        assert_int_equal(served > 0, all.want_brick + all.want_children > 0);
        if (!served)
            assert_memory_equal(words, zeros, sizeof words);
        /* what was served is not uploaded yet */
        count_unnoted(&s, caster, &view, rays, words, &num_wanting, &num_unnoted);
    } while (served);
    assert_true(num_wanting > 20);
    karst_buffer_destroy(lacking);
    karst_caster_destroy(caster);
    scene_destroy(&s);
    return num_unnoted;
}

static void streams_note_whose_rays_lack_something(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        assert_int_equal(note_until_settled(contexts[k], ""), 0);
        assert_true(note_until_settled(contexts[k], "-DKARST_MUTANT_LACKING") > 20);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(settled_leaves_use_only),      cmocka_unit_test(missing_children_are_wanted),
        cmocka_unit_test(missing_bricks_are_wanted),    cmocka_unit_test(unknown_is_incomplete),
        cmocka_unit_test(hidden_things_are_not_wanted), cmocka_unit_test(level_follows_footprint),
        cmocka_unit_test(stand_ins_are_wanted_far_from_what_is_asked_for),
        cmocka_unit_test(who_wants_no_hits_leaves_the_same),
        cmocka_unit_test(looking_again_asks_for_all_that_is_missing),
        cmocka_unit_test(streams_note_whose_rays_lack_something),
        cmocka_unit_test(finest_level_is_kept),         cmocka_unit_test(rays_that_end_on_stand_ins_are_counted),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
