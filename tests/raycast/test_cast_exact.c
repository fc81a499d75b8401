/* A hit depends on its ray and its cell alone: not on lanes, neighbours, anchors, segments, or what else the pools
 * hold. */
#include "tests/raycast/casting.h"

/* Ground with bumps of every size down to a voxel or two, coarser where the voxel is. */
static double bumps(const double p[3], double width, const void *user)
{
    (void)user;
    double sum = -p[1], size = 64, height = 12;
    for (int i = 0; i < 6; i++, size *= 0.5, height *= 0.5)
        if (size >= 2 * width)
            sum += height * sin(p[0] / size * 3 + i) * cos(p[2] / size * 3 - p[1] / size);
    return sum;
}

static scene built; /* down to level 0, once */

static int open_all(void **state)
{
    open_contexts(state);
    built = scene_create(contexts[0], 1500, 4500, 1, 4, bumps, NULL);
    built.lipschitz = 12;
    scene_build(&built, 0);
    return 0;
}

static int close_all(void **state)
{
    scene_destroy(&built);
    return close_contexts(state);
}

static scene make_bumps(karst_context *context, uint32_t num_segments)
{
    return scene_clone(context, num_segments, &built);
}

static const double eye[3] = {-80.7, 40.2, -70.3};

/* Whether two runs found the same, bricks and nodes by number too if asked. */
static bool same_hits(const karst_hit *a, const karst_hit *b, size_t n, bool same_slots)
{
    for (size_t i = 0; i < n; i++) {
        karst_hit x = a[i], y = b[i];
        if (!same_slots)
            x.brick = y.brick = x.node = y.node = 0;
        if (memcmp(&x, &y, sizeof(x)) != 0) {
            fprintf(stderr, "ray %zu: %a %x %x against %a %x %x\n", i, x.t, x.kind, x.place, y.t, y.kind, y.place);
            return false;
        }
    }
    return true;
}

static size_t count_kind(const karst_hit *hits, size_t n, uint32_t kind)
{
    size_t count = 0;
    for (size_t i = 0; i < n; i++)
        count += KARST_HIT_KIND(hits[i].kind) == kind;
    return count;
}

static bool same_stamps(const scene *a, const scene *b)
{
    karst_buffer *const x[] = {a->buffers.tile_stamp, a->buffers.brick_stamp,   a->buffers.brick_fallback,
                               a->buffers.want_brick, a->buffers.want_children, a->buffers.want_chunk,
                               a->buffers.want_rays};
    karst_buffer *const y[] = {b->buffers.tile_stamp, b->buffers.brick_stamp,   b->buffers.brick_fallback,
                               b->buffers.want_brick, b->buffers.want_children, b->buffers.want_chunk,
                               b->buffers.want_rays};
    bool same = true;
    for (size_t i = 0; i < sizeof(x) / sizeof(x[0]); i++) {
        uint32_t *p = read_stamps(x[i]), *q = read_stamps(y[i]);
        same = same && memcmp(p, q, x[i]->size_bytes) == 0;
        free(p);
        free(q);
    }
    return same;
}

/* Rays in all directions from around the eye, with footprints of all sizes. */
static karst_ray *scattered_rays(uint32_t n, uint64_t seed)
{
    karst_ray *rays = malloc(n * sizeof(*rays));
    for (uint32_t i = 0; i < n; i++) {
        double d[3], o[3];
        random_direction(&seed, d);
        for (int a = 0; a < 3; a++)
            o[a] = (next_random(&seed) - 0.5) * 40;
        rays[i] = make_ray(o, d, 300);
        rays[i].t_min = (float)next_random(&seed);
        rays[i].width = (float)(2 * next_random(&seed));
        rays[i].cone = i & 1 ? (float)(0.05 * next_random(&seed)) : 0;
    }
    return rays;
}

static void lanes_agree_in_every_bit(void **state)
{
    (void)state;
    scene s[2] = {make_bumps(contexts[0], 1), make_bumps(contexts[1], 1)};
    karst_caster *casters[2] = {open_caster(&s[0], ""), open_caster(&s[1], "")};
    const int sizes[][2] = {{1, 1}, {7, 5}, {64, 48}, {130, 33}};
    for (size_t i = 0; i < sizeof(sizes) / sizeof(sizes[0]); i++)
        for (int turn = 0; turn < 5; turn++) {
            karst_pinhole pinhole = make_pinhole(sizes[i][0], sizes[i][1], 45 + 72 * turn, -20, 400);
            size_t n = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
            karst_hit *hits[2];
            for (int k = 0; k < 2; k++) {
                karst_cast_view view = scene_view(&s[k], eye, 1);
                view.serial = (uint32_t)(i * 5 + (size_t)turn + 1);
                hits[k] = cast_picture(&s[k], casters[k], &view, &pinhole);
            }
            assert_true(same_hits(hits[0], hits[1], n, true));
            assert_true(same_stamps(&s[0], &s[1]));
            assert_true(count_kind(hits[0], n, KARST_HIT_SURFACE) + count_kind(hits[0], n, KARST_HIT_MISS) > 0);
            free(hits[0]);
            free(hits[1]);
        }
    const uint32_t n = 3001;
    karst_ray *rays = scattered_rays(n, 3);
    karst_hit *hits[2];
    for (int k = 0; k < 2; k++) {
        karst_cast_view view = scene_view(&s[k], eye, 1);
        view.serial = 1000;
        hits[k] = cast(&s[k], casters[k], &view, rays, n, false);
    }
    assert_true(same_hits(hits[0], hits[1], n, true));
    assert_true(same_stamps(&s[0], &s[1]));
    assert_true(count_kind(hits[0], n, KARST_HIT_SURFACE) > n / 5);
    free(rays);
    for (int k = 0; k < 2; k++) {
        free(hits[k]);
        karst_caster_destroy(casters[k]);
        scene_destroy(&s[k]);
    }
}

/* The same rays in another order travel in other packets. */
static void neighbours_do_not_matter(void **state)
{
    (void)state;
    scene s = make_bumps(contexts[0], 1);
    karst_caster *caster = open_caster(&s, "");
    karst_cast_view view = scene_view(&s, eye, 1);
    enum { N = 2000 };
    karst_ray *rays = scattered_rays(N, 9), *shuffled = malloc(N * sizeof(*rays));
    uint32_t from[N];
    uint64_t random = 4;
    for (uint32_t i = 0; i < N; i++)
        from[i] = i;
    for (uint32_t i = N - 1; i > 0; i--) {
        uint32_t j = (uint32_t)(next_random(&random) * (i + 1)), swap = from[i];
        from[i] = from[j];
        from[j] = swap;
    }
    for (uint32_t i = 0; i < N; i++)
        shuffled[i] = rays[from[i]];
    karst_hit *hits = cast(&s, caster, &view, rays, N, false), *other = cast(&s, caster, &view, shuffled, N, false);
    for (uint32_t i = 0; i < N; i++)
        assert_true(same_hits(&hits[from[i]], &other[i], 1, true));
    free(rays);
    free(shuffled);
    free(hits);
    free(other);
    karst_caster_destroy(caster);
    scene_destroy(&s);
}

/* A pinhole is only a compact way to write its rays down. */
static void pinhole_and_rays_agree(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene s = make_bumps(contexts[k], 1);
        karst_caster *caster = open_caster(&s, "");
        karst_cast_view view = scene_view(&s, eye, 1);
        enum { W = 50, H = 38 };
        karst_pinhole p = make_pinhole(W, H, 48, -15, 400);
        karst_ray *rays = calloc(W * H, sizeof(*rays));
        for (uint32_t y = 0; y < H; y++)
            for (uint32_t x = 0; x < W; x++) {
                karst_ray *ray = &rays[karst_packet_order(x, y, W, H)];
                assert_true(ray->t_max == 0); /* a permutation */
                float sx = fmaf((float)x + 0.5f, 2.0f / W, -1.0f) * p.half_width,
                      sy = fmaf((float)y + 0.5f, -2.0f / H, 1.0f) * p.half_height;
                float *d = ray->direction;
                for (int a = 0; a < 3; a++)
                    d[a] = fmaf(sx, p.right[a], fmaf(sy, p.up[a], p.forward[a]));
                float scale = 1.0f / sqrtf(fmaf(d[0], d[0], fmaf(d[1], d[1], d[2] * d[2])));
                for (int a = 0; a < 3; a++)
                    d[a] *= scale;
                ray->t_max = p.t_max;
                ray->cone = p.cone;
            }
        karst_hit *picture = cast_picture(&s, caster, &view, &p), *hits = cast(&s, caster, &view, rays, W * H, false);
        for (uint32_t y = 0; y < H; y++)
            for (uint32_t x = 0; x < W; x++)
                assert_true(same_hits(&picture[karst_packet_order(x, y, W, H)], &hits[karst_packet_order(x, y, W, H)],
                                      1, true));
        free(rays);
        free(picture);
        free(hits);
        karst_caster_destroy(caster);
        scene_destroy(&s);
    }
}

/* The same scene 10^9 and 10^15 voxels away from the origin: the same bits. */
static void anchors_are_exact(void **state)
{
    (void)state;
    const int64_t far[] = {1000000000 / 512 * 512, 1000000000000000 / 512 * 512, -(INT64_C(1) << 60)};
    karst_pinhole pinhole = make_pinhole(90, 70, 45, -20, 400);
    size_t n = 90 * 70;
    scene here = make_bumps(contexts[0], 1);
    karst_caster *caster = open_caster(&here, "");
    karst_cast_view view = scene_view(&here, eye, 1);
    karst_hit *hits = cast_picture(&here, caster, &view, &pinhole);
    assert_true(count_kind(hits, n, KARST_HIT_SURFACE) > n / 3);
    for (size_t i = 0; i < sizeof(far) / sizeof(far[0]); i++) {
        for (int a = 0; a < 3; a++)
            here.base[a] = a == 1 ? far[i] / 1024 * 512 : far[i];
        karst_cast_view far_view = scene_view(&here, eye, 1);
        assert_memory_equal(far_view.levels[0].in_node, view.levels[0].in_node, sizeof(view.levels[0].in_node));
        karst_hit *far_hits = cast_picture(&here, caster, &far_view, &pinhole);
        assert_true(same_hits(hits, far_hits, n, true));
        free(far_hits);
    }
    free(hits);
    karst_caster_destroy(caster);
    scene_destroy(&here);
}

/* Localisation by itself, against 128-bit arithmetic. */
static void localisation_is_exact(void **state)
{
    (void)state;
    uint64_t random = 21;
    for (int i = 0; i < 2000; i++) {
        karst_position p;
        int64_t root[3];
        int top = (int)(next_random(&random) * 50), shift = KARST_BRICK_CELLS_LOG2 + top;
        for (int a = 0; a < 3; a++) {
            p.voxel[a] = (int64_t)((next_random(&random) * 2 - 1) * ldexp(1, (int)(next_random(&random) * 62)));
            p.fraction[a] = (uint32_t)(next_random(&random) * 4294967296.0);
            root[a] = (p.voxel[a] >> shift) - (i & 1);
        }
        karst_cast_view view;
        karst_cast_view_init(&view, &p, root, top);
        int64_t r[3] = {view.root[0], view.root[1], view.root[2]};
        for (int level = top; level >= 0; level--)
            for (int a = 0; a < 3; a++) {
                /* lower corner of the node r = (the walk's choice) minus the anchor, twice */
                int64_t node = p.voxel[a] >> (KARST_BRICK_CELLS_LOG2 + level);
                assert_int_equal(view.levels[level].parity >> a & 1, node & 1);
                if (level == top)
                    assert_int_equal(node + r[a], root[a]);
                float in_node = view.levels[level].in_node[a];
                long double exact =
                    ((long double)(p.voxel[a] - node * (INT64_C(1) << (KARST_BRICK_CELLS_LOG2 + level))) +
                     p.fraction[a] * 0x1p-32L) /
                    ldexpl(1, level);
                assert_true(in_node >= 0 && in_node < KARST_BRICK_CELLS);
                assert_true((long double)in_node <= exact && exact - (long double)in_node <= exact * 0x1p-23L);
                __extension__ __int128 left =
                    (__int128)(node + 1) * ((__int128)1 << (KARST_BRICK_CELLS_LOG2 + level + 32));
                left -= (__int128)p.voxel[a] * ((int64_t)1 << 32) + p.fraction[a];
                long double to_end = view.levels[level].to_end[a], rest = (long double)left / ldexpl(1, level + 32);
                assert_true(to_end > 0 && to_end <= rest && rest - to_end <= rest * 0x1p-23L);
            }
    }
}

static void segments_do_not_matter(void **state)
{
    (void)state;
    const double anchor[3] = {-80.7, 40.2, -70.3};
    karst_pinhole pinhole = make_pinhole(60, 50, 45, -20, 400);
    for (int k = 0; k < 2; k++) {
        karst_hit *hits[2];
        const uint32_t segments[2] = {1, 3};
        for (int i = 0; i < 2; i++) {
            scene s = make_bumps(contexts[k], segments[i]);
            assert_true(i == 0 || s.num_bricks > s.buffers.bricks_per_segment);
            karst_caster *caster = open_caster(&s, "");
            karst_cast_view view = scene_view(&s, anchor, 1);
            hits[i] = cast_picture(&s, caster, &view, &pinhole);
            karst_caster_destroy(caster);
            scene_destroy(&s);
        }
        assert_true(same_hits(hits[0], hits[1], 60 * 50, true));
        free(hits[0]);
        free(hits[1]);
    }
}

/* A tree that holds just what was asked for, and one that holds everything down to level 0. */
static void finer_data_does_not_matter(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        scene full = make_bumps(contexts[k], 1), asked = scene_create(contexts[k], 1500, 4500, 1, 4, bumps, NULL);
        asked.lipschitz = 12;
        scene_classify_tile(&asked, KARST_ROOT_TILE);
        scene_upload(&asked);
        karst_caster *casters[2] = {open_caster(&full, ""), open_caster(&asked, "")};
        karst_pinhole pinhole = make_pinhole(100, 80, 45, -20, 400);
        pinhole.cone *= 1.7f;
        karst_cast_view view = scene_view(&asked, eye, 1);
        karst_hit *narrow;
        int rounds = 0;
        for (;; view.serial++, rounds++) {
            narrow = cast_picture(&asked, casters[1], &view, &pinhole);
            if (!scene_serve(&asked, view.serial))
                break;
            free(narrow);
            assert_true(rounds < 40);
        }
        assert_true(rounds > 3);
        assert_true(asked.num_bricks < full.num_bricks / 2);
        assert_int_equal(count_kind(narrow, 8000, KARST_HIT_PROVISIONAL), 0);
        karst_hit *hits = cast_picture(&full, casters[0], &view, &pinhole);
        assert_int_equal(count_stamps(full.buffers.want_brick, view.serial), 0);
        assert_int_equal(count_stamps(full.buffers.want_children, view.serial), 0);
        assert_true(same_hits(hits, narrow, 8000, false));
        uint32_t levels = 0;
        for (int i = 0; i < 8000; i++)
            if (KARST_HIT_KIND(hits[i].kind))
                levels |= 1u << KARST_HIT_LEVEL(hits[i].kind);
        assert_true(k_popcount(levels) >= 3);
        free(hits);
        free(narrow);
        for (int i = 0; i < 2; i++)
            karst_caster_destroy(casters[i]);
        scene_destroy(&full);
        scene_destroy(&asked);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lanes_agree_in_every_bit),   cmocka_unit_test(neighbours_do_not_matter),
        cmocka_unit_test(pinhole_and_rays_agree),     cmocka_unit_test(anchors_are_exact),
        cmocka_unit_test(localisation_is_exact),      cmocka_unit_test(segments_do_not_matter),
        cmocka_unit_test(finer_data_does_not_matter),
    };
    return cmocka_run_group_tests(tests, open_all, close_all);
}
