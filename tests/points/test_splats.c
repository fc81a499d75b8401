/* Models shown as discs: each leaf has the discs that touch it, and culling opens no hole; rays meet the mean of what a
 * second implementation in double finds among all discs, at every level; nothing meets what it starts on; devices have
 * the host's bits, wherever the model stands; and in pictures land and discs hide, shade and mirror one another. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

/* One rule of rays broken at a time. */
enum { NONE, SIDES, RISE, WEIGHTS, LEVELS };
static int mutant = NONE;
#define SPLATS_MUTANT(rule) (mutant == rule)

#include "core/points/points_file.h"
#include "core/points/splats.h"
#include "karst/karst.h"
#include "producers/points/splat_list.h"
#include "raycast/cast/splats.clh"
#include "raycast/cast/splats.h"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-4)
#define VOXEL_M 0x1p-4
#define SCALE 10.0
#define NUM_POINTS 20000

static char folder[] = "/tmp/karst-splats-XXXXXX";
/* A sphere, a torus, two small balls, and a sphere with noise of a quarter of its spacing. */
enum { SPHERE, TORUS, BALLS, ROUGH, NUM_MODELS };
static char model_path[NUM_MODELS][64];

/* Away from one another, so that averages of few points stick out to where no others are. */
static double balls_value(const double p[3], double gradient[3])
{
    const double one[3] = {p[0] + 0.7, p[1] + 0.7, p[2] + 0.7}, other[3] = {p[0] - 0.9, p[1] - 0.3, p[2] - 0.2};
    const bool is_one = p[0] < 0.3;
    const double *from = is_one ? one : other, radius = is_one ? 0.3 : 0.04;
    const double r = sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2]) + 1e-30;
    for (int a = 0; a < 3; a++)
        gradient[a] = -from[a] / r;
    return radius - r;
}
static const known_surface balls = {"balls", balls_value, 1.05, 4 * PI * (0.3 * 0.3 + 0.04 * 0.04), -1};

/* ---- one model ---- */

/* A model at the origin of the world, as casting has it, and its levels as the file has them. */
typedef struct {
    karst_splat_list list;
    karst_splat_source source;
    karst_points_head head;
    karst_point *levels[KARST_POINTS_MAX_LEVELS];
    long anchor[3];
    const karst_splat_model *model;
    double unit_m;
} scene;

static scene open_scene(int which, bool culls, bool is_deep, bool has_backs)
{
    scene s = {.source = {.model = {.path = model_path[which], .turn_deg = {20, 35, 0}, .scale = SCALE},
                          .culls = culls,
                          .is_deep = is_deep,
                          .has_backs = has_backs}};
    assert_ok(karst_splat_list_init(&s.list, &s.source, 1, VOXEL_LOG2_M, UINT64_MAX, NULL, &error));
    karst_error error = {0};
    const int fd = karst_points_open(model_path[which], &s.head, &error);
    assert_true(fd >= 0);
    for (uint32_t l = 0; l < s.head.num_levels; l++)
        assert_non_null(s.levels[l] = karst_points_load_level(fd, model_path[which], &s.head, l, &error));
    close(fd);
    s.model = SPLATS_MODELS(s.list.data);
    s.unit_m = s.head.unit * SCALE;
    return s;
}

static void close_scene(scene *s)
{
    for (uint32_t l = 0; l < s->head.num_levels; l++)
        free(s->levels[l]);
    karst_splat_list_finish(&s->list);
}

/* The leaf of a level (by its spacing) around a place in units; NULL: there is none. */
static const karst_splat_node *leaf_at(const scene *s, const double at[3], float spacing)
{
    const karst_splat_node *nodes = (const karst_splat_node *)(s->list.data + s->model->nodes), *node = nodes;
    double corner[3], width = ldexp(1, s->model->root_log2 + 1);
    for (int a = 0; a < 3; a++)
        corner[a] = -width / 2;
    for (int depth = 0;; depth++) {
        const unsigned children = node->octants & 0xffu;
        if ((node->octants & KARST_SPLAT_FILLED) && s->model->spacings[depth] == spacing)
            return node;
        unsigned octant = 0;
        width /= 2;
        for (int a = 0; a < 3; a++)
            if (at[a] >= corner[a] + width) {
                corner[a] += width;
                octant |= 1u << a;
            }
        if (!(children >> octant & 1u))
            return NULL;
        node = nodes + node->children + __builtin_popcount(children & ((1u << octant) - 1));
    }
}

/* A place on a disc, up to `share` of its radius from the centre. */
static void place_on(const karst_point *p, double share, double at[3])
{
    double v[3], along = 0, square = 0, length = 0;
    for (int a = 0; a < 3; a++) {
        v[a] = random_unit() - 0.5;
        along += v[a] * p->normal[a];
        square += (double)p->normal[a] * p->normal[a];
    }
    for (int a = 0; a < 3; a++) {
        v[a] -= along / square * p->normal[a];
        length += v[a] * v[a];
    }
    for (int a = 0; a < 3; a++)
        at[a] = p->at[a] + v[a] / sqrt(length) * share * (double)p->radius;
}

static void leaves_have_what_touches_them(void **state)
{
    (void)state;
    random_state = 5;
    scene s = open_scene(TORUS, false, true, false);
    int num_copies = 0;
    for (int i = 0; i < 20000; i++) {
        const uint32_t l = (uint32_t)random_below(s.head.num_levels);
        const karst_point *p = &s.levels[l][random_below(s.head.levels[l].num)];
        double at[3];
        place_on(p, random_unit(), at);
        const karst_splat_node *leaf = leaf_at(&s, at, (float)s.head.levels[l].spacing);
        assert_non_null(leaf);
        const karst_point *discs = (const karst_point *)(s.list.data + s.model->discs) + leaf->first;
        uint32_t k = 0;
        while (k < leaf->num && memcmp(discs[k].at, p->at, sizeof p->at) != 0)
            k++;
        assert_true(k < leaf->num);
        double home[3] = {p->at[0], p->at[1], p->at[2]};
        num_copies += leaf_at(&s, home, (float)s.head.levels[l].spacing) != leaf;
    }
    assert_true(num_copies > 4000);
    print_message("# %llu points, %llu discs, %llu of them copies, in %llu leaves\n",
                  (unsigned long long)s.list.counts.num_points, (unsigned long long)s.list.counts.num_discs,
                  (unsigned long long)s.list.counts.num_copies, (unsigned long long)s.list.counts.num_leaves);
    close_scene(&s);
}

/* ---- rays ---- */

/* From outside towards a place near the model; footprint: what is asked for, voxels. */
static splat_ray random_ray(double footprint)
{
    splat_ray ray = {.t_max = 3e4f, .width = (float)footprint};
    double out[3], to[3], square = 0, length = 0;
    for (int a = 0; a < 3; a++) {
        out[a] = random_unit() - 0.5;
        square += out[a] * out[a];
    }
    for (int a = 0; a < 3; a++) {
        out[a] *= 3 * SCALE / VOXEL_M / sqrt(square);
        to[a] = (random_unit() - 0.5) * 2.6 * SCALE / VOXEL_M - out[a];
        length += to[a] * to[a];
    }
    for (int a = 0; a < 3; a++) {
        ray.origin[a] = (float)out[a];
        ray.direction[a] = (float)(to[a] / sqrt(length));
    }
    return ray;
}

/* Where a ray meets a disc, in double; t in voxels. */
typedef struct {
    double t, weight, radius, normal[3], up;
} met_disc;

static int compare_met(const void *a, const void *b)
{
    const double one = ((const met_disc *)a)->t, other = ((const met_disc *)b)->t;
    return (one > other) - (one < other);
}

/* All that it meets of a level, the nearest first. `away`: the squared distance from a rim, in radii, is at least. */
static int meet_all(const scene *s, uint32_t level, const splat_ray *ray, met_disc *met, int most, double *clear)
{
    double from[3], to[3], per = 0;
    int num = 0;
    for (int row = 0; row < 3; row++) {
        from[row] = (double)s->anchor[row];
        to[row] = 0;
        for (int a = 0; a < 3; a++) {
            from[row] += (double)s->model->to_units[3 * row + a] * (double)ray->origin[a];
            to[row] += (double)s->model->to_units[3 * row + a] * (double)ray->direction[a];
        }
        per += to[row] * to[row];
    }
    per = 1 / sqrt(per);
    for (uint64_t i = 0; i < s->head.levels[level].num; i++) {
        const karst_point *p = &s->levels[level][i];
        double up = 0, height = 0, square = 0, length = 0, n[3];
        const bool is_known = p->normal[0] || p->normal[1] || p->normal[2];
        for (int a = 0; a < 3; a++) { /* one without a normal faces the ray */
            n[a] = is_known ? p->normal[a] / 32767.0 : -to[a] * per;
            length += n[a] * n[a];
            up += n[a] * to[a];
            height += n[a] * (p->at[a] - from[a]);
        }
        const double t = height / up, radius = (double)karst_splat_radius(p->radius);
        for (int a = 0; a < 3; a++)
            square += pow(from[a] + t * to[a] - p->at[a], 2);
        const double flat = fabs(up) * per / sqrt(length);
        if (flat > 0.5e-4)
            *clear = fmin(*clear, fabs(sqrt(square) / radius - 1) * fmin(1, flat * 50));
        if (square >= radius * radius || t < 0 || flat < 1e-4)
            continue;
        assert_true(num < most);
        const double weight = fmax(1 - sqrt(square) / radius, 1e-3);
        met[num] = (met_disc){.t = t, .weight = weight, .radius = radius * per, .up = up};
        for (int a = 0; a < 3; a++)
            met[num].normal[a] = (up < 0 ? 1 : -1) * n[a];
        num++;
    }
    qsort(met, (size_t)num, sizeof *met, compare_met);
    return num;
}

/* How far off a hit is from the mean around one of the discs that may be the reference: t in radii, and the normal. */
static double off_by(const scene *s, const met_disc *met, int num, const splat_hit *hit, double *turned)
{
    double least = 1e9;
    for (int k = 0; k < num && met[k].t <= met[0].t + met[0].radius * 1.0001; k++) {
        double sum = 0, t = 0, n[3] = {0}, world[3], square = 0, along = 0;
        const double low = fmax(met[k].t - met[k].radius, met[0].t), high = met[k].t + met[k].radius;
        for (int i = 0; i < num; i++) {
            if ((met[i].up < 0) != (met[0].up < 0) || met[i].t < low || met[i].t > high)
                continue;
            sum += met[i].weight;
            t += met[i].weight * met[i].t;
            for (int a = 0; a < 3; a++)
                n[a] += met[i].weight * met[i].normal[a];
        }
        for (int a = 0; a < 3; a++) {
            world[a] = 0;
            for (int row = 0; row < 3; row++)
                world[a] += (double)s->model->to_units[3 * row + a] * n[row];
            square += world[a] * world[a];
        }
        for (int a = 0; a < 3; a++)
            along += world[a] / sqrt(square) * (double)hit->normal[a];
        const double off = fabs(t / sum - (double)hit->t) / met[k].radius;
        if (off < least) {
            least = off;
            *turned = 1 - along;
        }
    }
    return least;
}

/* Shares of rays that do as the second implementation says, at random levels. */
static void compare_rays(const scene *s, int num_rays, int *num_hits, int *num_right, int *num_same)
{
    static met_disc met[4096];
    *num_hits = *num_right = *num_same = 0;
    for (int i = 0; i < num_rays; i++) {
        const uint32_t l = (uint32_t)random_below(s->head.num_levels);
        const splat_ray ray = random_ray((double)s->head.levels[l].spacing / (double)s->model->units_per_voxel * 1.001);
        splat_hit hit = {.t = 0};
        double clear = 1, turned = 0;
        splat_ray shortened = ray;
        const int is_hit = splats_trace(s->list.data, s->anchor, &shortened, &hit);
        const int num = meet_all(s, l, &ray, met, 4096, &clear);
        if (clear < 1e-3) { /* on a rim floats may say otherwise */
            ++*num_same;
            continue;
        }
        *num_same += is_hit == (num > 0);
        if (!is_hit || num == 0)
            continue;
        ++*num_hits;
        *num_right += off_by(s, met, num, &hit, &turned) < 2e-3 && turned < 1e-4;
    }
}

/* Of rays that pass the small ball, and ask for the finest points, those that end though they meet none of these. */
static int num_past(const scene *s)
{
    static met_disc met[4096];
    int num = 0;
    for (int i = 0; i < 1000; i++) {
        const karst_point *p;
        splat_ray ray = random_ray(0);
        splat_hit hit;
        do
            p = &s->levels[0][random_below(s->head.levels[0].num)];
        while (p->at[0] < 0); /* the small one */
        double clear = 1, to[3], length = 0;
        for (int a = 0; a < 3; a++) {
            to[a] = (random_unit() - 0.5) * 0.3 * SCALE / VOXEL_M - (double)ray.origin[a];
            for (int row = 0; row < 3; row++)
                to[a] += (double)s->model->to_units[3 * row + a] * p->at[row] /
                         ((double)s->model->units_per_voxel * (double)s->model->units_per_voxel);
            length += to[a] * to[a];
        }
        for (int a = 0; a < 3; a++)
            ray.direction[a] = (float)(to[a] / sqrt(length));
        num += meet_all(s, 0, &ray, met, 4096, &clear) == 0 && clear > 1e-3 &&
               splats_trace(s->list.data, s->anchor, &ray, &hit);
    }
    return num;
}

static void rays_meet_the_mean_of_discs(void **state)
{
    (void)state;
    enum { NUM = 1200 };
    scene s = open_scene(TORUS, false, true, true);
    int hits, right, same;
    random_state = 6;
    compare_rays(&s, NUM, &hits, &right, &same);
    print_message("# %d of %d rays hit, %d where they should; hit or miss: %d\n", hits, NUM, right, same);
    assert_true(hits > 400 && same == NUM && right == hits);
    mutant = WEIGHTS;
    random_state = 6;
    compare_rays(&s, NUM, &hits, &right, &same);
    mutant = NONE;
    assert_true(right < hits / 2);
    close_scene(&s);
    s = open_scene(BALLS, false, true, true);
    random_state = 6;
    compare_rays(&s, NUM, &hits, &right, &same);
    print_message("# two balls: %d of %d rays hit, %d where they should; hit or miss: %d\n", hits, NUM, right, same);
    assert_true(hits > 20 && same == NUM && right == hits);
    assert_int_equal(num_past(&s), 0);
    mutant = LEVELS;
    const int past = num_past(&s);
    mutant = NONE;
    print_message("# with coarse discs where no fine ones are %d rays past a ball end\n", past);
    assert_true(past > 3);
    close_scene(&s);
}

/* Rays that leave a convex body, mirrored or to a light, meet nothing of it. */
static int num_stopped(const scene *s, bool mirrored, int num_rays)
{
    int num = 0;
    for (int i = 0; i < num_rays; i++) {
        splat_ray ray = random_ray(0), next = {.t_max = 3e4f};
        splat_hit hit, other;
        if (!splats_trace(s->list.data, s->anchor, &ray, &hit))
            continue;
        float along = 0, rise = 0, to[3], length = 0;
        for (int a = 0; a < 3; a++)
            along += ray.direction[a] * hit.normal[a];
        for (int a = 0; a < 3; a++) {
            to[a] = mirrored ? ray.direction[a] - 2 * along * hit.normal[a]
                             : hit.normal[a] + (float)(1.9 * (random_unit() - 0.5));
            length += to[a] * to[a];
        }
        for (int a = 0; a < 3; a++) {
            next.direction[a] = to[a] / sqrtf(length);
            next.origin[a] = ray.origin[a] + hit.t * ray.direction[a] + (mirrored ? 0 : 1.5f * hit.normal[a]);
            rise += next.direction[a] * hit.normal[a];
        }
        if (rise < 0.1f)
            continue;
        next.side = mirrored ? KARST_SIDE_FRONT : KARST_SIDE_ANY;
        next.rise = mirrored ? 0 : rise;
        num += splats_trace(s->list.data, s->anchor, &next, &other);
    }
    return num;
}

static void nothing_meets_what_it_starts_on(void **state)
{
    (void)state;
    scene s = open_scene(SPHERE, false, true, false);
    random_state = 8;
    assert_int_equal(num_stopped(&s, true, 3000), 0);
    assert_int_equal(num_stopped(&s, false, 3000), 0);
    mutant = SIDES;
    const int stopped = num_stopped(&s, true, 3000);
    mutant = NONE;
    close_scene(&s);
    s = open_scene(ROUGH, true, true, false);
    const int of_rough = num_stopped(&s, false, 3000);
    mutant = RISE;
    const int dark = num_stopped(&s, false, 3000);
    mutant = NONE;
    print_message("# without sides %d rays are stopped; of what is rough %d, without rising %d\n", stopped, of_rough,
                  dark);
    assert_true(stopped > 300 && of_rough < 10 && dark > 10 * of_rough + 50);
    close_scene(&s);
}

/* Where rays end against the truth: rms in spacings; how many that should end do not. */
static void hits_lie_on_what_points_were_taken_from(void **state)
{
    (void)state;
    static const struct {
        bool culls, is_deep;
        double rms, most_holes;
    } ways[] = {{false, true, 0.2, 0}, {true, true, 0.3, 0.0005}, {true, false, 0.4, 0.0005}};
    uint64_t all = 0;
    for (size_t w = 0; w < sizeof ways / sizeof *ways; w++) {
        scene s = open_scene(SPHERE, ways[w].culls, ways[w].is_deep, false);
        const double spacing = SCALE * spacing_of(&known_surfaces[0], NUM_POINTS) / VOXEL_M, radius = SCALE / VOXEL_M;
        double square = 0;
        int num = 0, holes = 0;
        random_state = 9;
        for (int i = 0; i < 12000; i++) {
            splat_ray ray = random_ray(0);
            double along = 0, apart = -radius * radius, far;
            splat_hit hit;
            for (int a = 0; a < 3; a++) {
                along -= (double)ray.origin[a] * (double)ray.direction[a];
                apart += (double)ray.origin[a] * (double)ray.origin[a];
            }
            const double under = along * along - apart; /* silhouettes are left out */
            if (under < 0.02 * radius * radius)
                continue;
            num++;
            far = along - sqrt(under);
            if (splats_trace(s.list.data, s.anchor, &ray, &hit) && fabs((double)hit.t - far) < 3 * spacing)
                square += pow(((double)hit.t - far) / spacing * sqrt(under) / radius, 2);
            else
                holes++;
        }
        print_message("# %s, %s: rms %.3f spacings, %d holes in %d rays, %llu discs of %llu points\n",
                      ways[w].culls ? "culled" : "all copies", ways[w].is_deep ? "deep" : "by leaf",
                      sqrt(square / num), holes, num, (unsigned long long)s.list.counts.num_discs,
                      (unsigned long long)s.list.counts.num_points);
        assert_true(num > 3000 && sqrt(square / num) < ways[w].rms && holes <= ways[w].most_holes * num);
        if (w == 0)
            all = s.list.counts.num_discs;
        else
            assert_true(s.list.counts.num_discs < all / 2 && s.list.counts.num_culled > all / 3);
        close_scene(&s);
    }
}

/* ---- devices ---- */

#define NUM_RAYS 4000

static karst_splat_place place_of_model(const scene *s, const int64_t at[3])
{
    karst_splat_place place = {.shift = s->list.places[0].shift};
    for (int a = 0; a < 3; a++) {
        place.at[a] = at[a];
        place.offset[a] = s->list.places[0].offset[a];
    }
    for (int k = 0; k < 9; k++)
        place.matrix[k] = s->list.places[0].matrix[k];
    return place;
}

#define WIDTH 48
#define HEIGHT 36

/* What a device makes of rays, of a picture and of shadow rays, where the model stands. */
typedef struct {
    karst_hit rays[NUM_RAYS], picture[WIDTH * HEIGHT];
    uint32_t pixels[WIDTH * HEIGHT];
} device_results;

static const karst_pinhole pinhole = {.right = {1, 0, 0},
                                      .up = {0, 1, 0},
                                      .forward = {0, 0, 1},
                                      .half_width = 0.4f,
                                      .half_height = 0.3f,
                                      .t_max = 1e6f,
                                      .cone = 0.0167f,
                                      .width_px = WIDTH,
                                      .height_px = HEIGHT};

/* Each starts below the model, and goes up to the sun. */
static void fill_shadow_rays(float *fields)
{
    const size_t plane = WIDTH * HEIGHT;
    memset(fields, 0, KARST_SHADOW_FIELDS * plane * sizeof *fields);
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            float *ray = fields + karst_packet_order(x, y, WIDTH, HEIGHT);
            ray[KARST_SHADOW_ORIGIN * plane] = (float)x * 14 - 320;
            ray[(KARST_SHADOW_ORIGIN + 1) * plane] = -400;
            ray[(KARST_SHADOW_ORIGIN + 2) * plane] = (float)y * 14 + 250;
            ray[KARST_SHADOW_WIDTH * plane] = x % 7 ? 1 : 0;
            ray[KARST_SHADOW_DARK * plane] = k_as_float(0x80000000u | y << 16 | x);
            ray[KARST_SHADOW_RISE * plane] = 0.9f;
        }
}

static karst_buffer *buffer(karst_context *context, size_t size_bytes, const void *initial)
{
    karst_error error = {0};
    karst_buffer *made = karst_buffer_create(context, "test", size_bytes, initial, &error);
    if (!made)
        fail_msg("%s", error.message);
    return made;
}

static void cast_on_device(const scene *s, int lanes, const int64_t at[3], const karst_ray *rays, device_results *out)
{
    static float fields[KARST_SHADOW_FIELDS * WIDTH * HEIGHT];
    karst_context *context;
    karst_splats *splats;
    const int64_t root[3] = {0, 0, 0};
    karst_position anchor = {.fraction = {0}};
    karst_cast_view view, back_view;
    for (int a = 0; a < 3; a++)
        anchor.voxel[a] = at[a];
    karst_cast_view_init(&view, &anchor, root, 20);
    anchor.voxel[2] -= 500;
    karst_cast_view_init(&back_view, &anchor, root, 20);
    assert_ok(context = karst_context_create(NULL, lanes, NULL, &error));
    const karst_splat_place place = place_of_model(s, at);
    assert_ok(splats = karst_splats_create(context, s->list.data, s->list.size_bytes, &place, 1, &error));
    memset(out, 0, sizeof *out);
    fill_shadow_rays(fields);
    karst_buffer *of_rays = buffer(context, NUM_RAYS * sizeof *rays, rays),
                 *hits = buffer(context, sizeof out->rays, out->rays),
                 *picture = buffer(context, sizeof out->picture, out->picture),
                 *shadow_rays = buffer(context, sizeof fields, fields),
                 *pixels = buffer(context, sizeof out->pixels, out->pixels);
    const karst_shadow_sun sun = {.direction = {0.1f, 0.995f, 0},
                                  .t_max = 1e6f,
                                  .cone = 0.01f,
                                  .width_px = WIDTH,
                                  .height_px = HEIGHT,
                                  .across = {0.005f, 0, 0},
                                  .along = {0, 0, 0.005f},
                                  .sample = 3};
    assert_ok(karst_splats_rays(splats, &view, of_rays, NUM_RAYS, NULL, KARST_CAST_HITS, hits, &error));
    assert_ok(karst_splats_pinhole(splats, &back_view, &pinhole, picture, &error));
    assert_ok(karst_splats_shadows(splats, &back_view, &sun, shadow_rays, pixels->mem, &error));
    assert_ok(karst_buffer_read(hits, 0, out->rays, sizeof out->rays, &error));
    assert_ok(karst_buffer_read(picture, 0, out->picture, sizeof out->picture, &error));
    assert_ok(karst_buffer_read(pixels, 0, out->pixels, sizeof out->pixels, &error));
    karst_splats_destroy(splats);
    karst_buffer_destroy(of_rays);
    karst_buffer_destroy(hits);
    karst_buffer_destroy(picture);
    karst_buffer_destroy(shadow_rays);
    karst_buffer_destroy(pixels);
    karst_context_destroy(context);
}

static void devices_have_the_bits_of_the_host(void **state)
{
    (void)state;
    static karst_ray rays[NUM_RAYS];
    static device_results near, far, alone;
    static const int64_t here[3] = {0, 0, 0}, there[3] = {(int64_t)16000000000000, -((int64_t)1 << 60), 77};
    scene s = open_scene(TORUS, true, true, false);
    int num_hits = 0;
    random_state = 11;
    for (int i = 0; i < NUM_RAYS; i++) {
        const splat_ray ray = random_ray(random_magnitude(0.01, 100));
        rays[i] = (karst_ray){.t_max = ray.t_max, .width = ray.width, .cone = 1e-3f, .side = (uint)(i % 3)};
        memcpy(rays[i].origin, ray.origin, sizeof ray.origin);
        memcpy(rays[i].direction, ray.direction, sizeof ray.direction);
        rays[i].rise = i % 5 ? 0 : 0.5f;
    }
    cast_on_device(&s, 16, here, rays, &near);
    cast_on_device(&s, 1, here, rays, &alone);
    cast_on_device(&s, 16, there, rays, &far);
    assert_memory_equal(&near, &far, sizeof near);
    assert_memory_equal(&near, &alone, sizeof near);
    int num_seen = 0, num_dark = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        num_seen += KARST_HIT_KIND(near.picture[i].kind) == KARST_HIT_SPLAT;
        num_dark += near.pixels[i] != 0;
        assert_true(near.pixels[i] == 0 ||
                    near.pixels[i] == (0x80000000u | (unsigned)(i / WIDTH) << 16 | (unsigned)(i % WIDTH)));
    }
    print_message("# %d pixels see the model, %d are dark\n", num_seen, num_dark);
    assert_true(num_seen > 200 && num_seen < WIDTH * HEIGHT - 200 && num_dark > 100 && num_dark < 1400);
    for (int i = 0; i < NUM_RAYS; i++) {
        splat_hit hit;
        splat_ray ray = {.t_max = rays[i].t_max, .width = rays[i].width, .cone = rays[i].cone, .side = rays[i].side,
                         .rise = rays[i].rise};
        memcpy(ray.origin, rays[i].origin, sizeof ray.origin);
        memcpy(ray.direction, rays[i].direction, sizeof ray.direction);
        const int is_hit = splats_trace(s.list.data, s.anchor, &ray, &hit);
        assert_int_equal(is_hit, KARST_HIT_KIND(near.rays[i].kind) == KARST_HIT_SPLAT);
        if (!is_hit)
            continue;
        num_hits++;
        assert_memory_equal(&hit.t, &near.rays[i].t, sizeof hit.t);
        assert_memory_equal(hit.normal, near.rays[i].normal, sizeof hit.normal);
        assert_int_equal(KARST_HIT_LEVEL(near.rays[i].kind), hit.level);
    }
    assert_true(num_hits > 800);
    close_scene(&s);
}

/* ---- strange files ---- */

/* Radii beyond all measure: the tree stays small, or the file is refused. */
static void strange_radii_are_bounded(void **state)
{
    (void)state;
    scene s = open_scene(TORUS, true, true, false);
    karst_splat_level levels[KARST_POINTS_MAX_LEVELS];
    karst_splat_tree tree;
    karst_error why = {0};
    for (uint32_t l = 0; l < s.head.num_levels; l++) {
        for (uint64_t i = 0; i < s.head.levels[l].num; i++)
            s.levels[l][i].radius = (float)KARST_POINTS_MAX_AT;
        levels[l] = (karst_splat_level){s.levels[l], (uint32_t)s.head.levels[l].num,
                                        (double)s.head.levels[l].spacing};
    }
    assert_ok(karst_splat_tree_build(levels, s.head.num_levels, false, 4 << 20, &tree, &error));
    assert_true(tree.num_left_out > 0 && tree.num_discs < 1 << 20);
    karst_splat_tree_finish(&tree);
    assert_false(karst_splat_tree_build(levels, s.head.num_levels, false, 1000, &tree, &why));
    assert_int_equal(why.status, KARST_USAGE);
    /* As many at one place as no import leaves. */
    why = (karst_error){0};
    for (uint64_t i = 0; i < s.head.levels[0].num; i++)
        memset(s.levels[0][i].at, 0, sizeof s.levels[0][i].at);
    assert_false(karst_splat_tree_build(levels, 1, false, UINT64_MAX, &tree, &why));
    assert_int_equal(why.status, KARST_BAD_DATA);
    close_scene(&s);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    static const struct {
        const known_surface *of;
        size_t num;
        double noise;
    } clouds[NUM_MODELS] = {{&known_surfaces[0], NUM_POINTS, 0},
                            {&known_surfaces[1], NUM_POINTS, 0},
                            {&balls, 6000, 0},
                            {&known_surfaces[0], 6000, 0.25}};
    char input[64];
    snprintf(input, sizeof input, "%s/input.ply", folder);
    random_state = 3;
    bool done = true;
    for (int i = 0; i < NUM_MODELS; i++) {
        snprintf(model_path[i], sizeof model_path[i], "%s/%d.karstpoints", folder, i);
        write_cloud(input, clouds[i].of, clouds[i].num, clouds[i].noise);
        const karst_points_import_config config = {
            .input = input, .output = model_path[i], .axes = KARST_POINTS_AS_THEY_ARE};
        done = done && karst_points_import(&config, NULL, NULL);
    }
    unlink(input);
    return done ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    for (int i = 0; i < NUM_MODELS; i++)
        unlink(model_path[i]);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(leaves_have_what_touches_them),
        cmocka_unit_test(rays_meet_the_mean_of_discs),
        cmocka_unit_test(nothing_meets_what_it_starts_on),
        cmocka_unit_test(hits_lie_on_what_points_were_taken_from),
        cmocka_unit_test(devices_have_the_bits_of_the_host),
        cmocka_unit_test(strange_radii_are_bounded),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
