/* The block of memory that devices read: particles in the order of a curve, a tree over them, and their shares. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "producers/particles/particle_internal.h"
#include "producers/particles/particles.clh"

#define WORDS(bytes) (((bytes) + 7) / 8)

/* ---- the order ---- */

typedef struct {
    uint64_t key;
    uint32_t index;
} sorted;

/* 21 bits, each three places from the next. */
static uint64_t spread_bits(uint64_t x)
{
    x = (x | x << 32) & 0x1f00000000ffffu;
    x = (x | x << 16) & 0x1f0000ff0000ffu;
    x = (x | x << 8) & 0x100f00f00f00f00fu;
    x = (x | x << 4) & 0x10c30c30c30c30c3u;
    return (x | x << 2) & 0x1249249249249249u;
}

/* Along Morton's curve of whole voxels: it depends on the particle alone, so two that stay keep their order. */
static uint64_t key_of(const float at[3])
{
    uint64_t key = 0;
    for (int a = 0; a < 3; a++)
        key |= spread_bits((uint64_t)((int64_t)floorf(at[a]) + (int64_t)PARTICLES_MOST_VOXELS) & 0x1fffffu) << a;
    return key;
}

static int compare_keys(const void *a, const void *b)
{
    const sorted *p = a, *q = b;
    return p->key != q->key ? (p->key > q->key) - (p->key < q->key) : (p->index > q->index) - (p->index < q->index);
}

/* ---- shares ---- */

/* Of a union, those before others are the larger ones; of the same size, the first. Each has as its share what it adds
 * to the largest extinction of those before it. So whatever size samples are too coarse for, what is left out of the
 * union at their places is the sum of the shares of what was left out. */
static bool is_before(const karst_particle *a, uint32_t i, const karst_particle *b, uint32_t k)
{
    return a->radius != b->radius ? a->radius > b->radius : i < k;
}

/* The largest extinction of those before `particle` at a place. */
static float before_at(particles_data data, uint32_t number, const float p[3])
{
    const karst_particle *all = PARTICLES_ALL(data);
    particles_box box = {.reach = 0};
    float most = 0;
    memcpy(box.min, p, sizeof box.min);
    memcpy(box.max, p, sizeof box.max);
    for (uint leaf = 0; particles_next_leaf(data, &box, &leaf); leaf++)
        for (uint i = leaf * PARTICLES_FAN; i < particles_leaf_end(data, leaf); i++) {
            if (all[i].kind != PARTICLES_UNION || all[i].extinction <= most || i == number ||
                !is_before(&all[i], i, &all[number], number))
                continue;
            const float x = p[0] - all[i].at[0], y = p[1] - all[i].at[1], z = p[2] - all[i].at[2];
            if (x * x + y * y + z * z <= all[i].radius * all[i].radius)
                most = all[i].extinction;
        }
    return most;
}

/* Places spread evenly over a cube, by multiples of the powers of a root (Roberts, "The unreasonable effectiveness of
 * quasirandom sequences", 2018); those in the ball count. */
static double share_of_union(particles_data data, uint32_t number, uint32_t num_places)
{
    static const double steps[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    const karst_particle *particle = &PARTICLES_ALL(data)[number];
    const double radius = (double)particle->radius, start = number * 0.6180339887498949;
    double sum = 0;
    uint32_t num_in = 0;
    for (uint32_t k = 0; num_in < num_places && k < 8 * num_places; k++) {
        float p[3];
        double square = 0;
        for (int a = 0; a < 3; a++) {
            double u = start + k * steps[a];
            u = 2 * (u - floor(u)) - 1;
            square += u * u;
            p[a] = particle->at[a] + (float)(radius * u);
        }
        if (square > 1)
            continue;
        num_in++;
        sum += fmax((double)particle->extinction - (double)before_at(data, number, p), 0);
    }
    return num_in ? sum / num_in : (double)particle->extinction;
}

#define BALL_VOLUME 4.1887902047863905 /* of radius 1 */
#define SOFT_VOLUME 0.9574378107368413 /* 32 pi / 105: of (1 - d^2)^2 */
#define MOST_PLACES 48u /* an error of some per cent each, and of next to nothing together */
#define LEAST_PLACES 8u
#define PLACES_OF_ALL 30000u

static void find_shares(uint64_t *data)
{
    karst_particle *all = (karst_particle *)(data + PARTICLES_HEAD(data)->particles);
    const uint32_t num = PARTICLES_HEAD(data)->num;
    uint32_t num_places = PLACES_OF_ALL / (num ? num : 1);
    num_places = num_places < LEAST_PLACES ? LEAST_PLACES : num_places > MOST_PLACES ? MOST_PLACES : num_places;
    for (uint32_t i = 0; i < num; i++) {
        const double cube = (double)all[i].radius * (double)all[i].radius * (double)all[i].radius;
        all[i].share = all[i].kind == PARTICLES_SUM
                           ? (float)(SOFT_VOLUME * cube * (double)all[i].extinction)
                           : (float)(BALL_VOLUME * cube * share_of_union(data, i, num_places));
    }
}

/* ---- the tree ---- */

static void grow(karst_particle_node *node, const float min[3], const float max[3])
{
    for (int a = 0; a < 3; a++) {
        node->min[a] = fminf(node->min[a], min[a]);
        node->max[a] = fmaxf(node->max[a], max[a]);
    }
}

static void build_tree(uint64_t *data)
{
    karst_particles_head *head = (karst_particles_head *)data;
    const karst_particle *all = PARTICLES_ALL(data);
    for (uint32_t level = 0, below = head->num; level < head->num_levels; below = head->counts[level++]) {
        karst_particle_node *nodes = (karst_particle_node *)(data + head->nodes[level]);
        const karst_particle_node *children =
            level ? (const karst_particle_node *)(data + head->nodes[level - 1]) : NULL;
        for (uint32_t i = 0; i < head->counts[level]; i++)
            nodes[i] = (karst_particle_node){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
        for (uint32_t i = 0; i < below; i++) {
            float min[3], max[3];
            for (int a = 0; a < 3; a++) {
                min[a] = children ? children[i].min[a] : nextafterf(all[i].at[a] - all[i].radius, -INFINITY);
                max[a] = children ? children[i].max[a] : nextafterf(all[i].at[a] + all[i].radius, INFINITY);
            }
            grow(&nodes[i / PARTICLES_FAN], min, max);
        }
    }
}

/* Where everything lies; returns how many words that takes. */
static size_t lay_out(karst_particles_head *head)
{
    size_t at = WORDS(sizeof *head);
    head->particles = at;
    at += WORDS(head->num * sizeof(karst_particle));
    for (uint32_t below = head->num; below > 0 && head->num_levels < PARTICLES_MAX_TREE;) {
        const uint32_t count = (below + PARTICLES_FAN - 1) / PARTICLES_FAN;
        head->counts[head->num_levels] = count;
        head->nodes[head->num_levels++] = at;
        at += WORDS(count * sizeof(karst_particle_node));
        below = count > 1 ? count : 0;
    }
    return at;
}

/* ---- all of it ---- */

static bool place(const karst_particle_list *list, uint32_t i, karst_particle *to, karst_error *error)
{
    const karst_ball *ball = &list->balls[i];
    const double per_m = ldexp(1, -list->voxel_log2_m);
    bool is_near = ball->radius_m * per_m <= (double)PARTICLES_MOST_VOXELS;
    *to = (karst_particle){.radius = (float)(ball->radius_m * per_m),
                           .extinction = (float)ball->extinction,
                           .kind = ball->is_sum ? PARTICLES_SUM : PARTICLES_UNION};
    for (int a = 0; a < 3; a++) {
        to->at[a] = (float)(ball->at_m[a] * per_m);
        is_near = is_near && fabs(ball->at_m[a] * per_m) < (double)PARTICLES_MOST_VOXELS - 1;
    }
    return is_near || karst_fail(error, KARST_USAGE,
                                 "particle %u is %.3g m wide and lies %.3g, %.3g, %.3g m from the first group's place: "
                                 "%.3g m are the most; give the world a larger voxel",
                                 i + 1, 2 * ball->radius_m, ball->at_m[0], ball->at_m[1], ball->at_m[2],
                                 (double)PARTICLES_MOST_VOXELS / per_m);
}

bool karst_particle_block_make(karst_particle_list *list, karst_error *error)
{
    karst_particles_head head = {.num = 0};
    sorted *order = malloc((list->num + 1) * sizeof *order);
    karst_particle *placed = malloc((list->num + 1) * sizeof *placed);
    bool done = (order && placed) || karst_fail(error, KARST_FAILED, "out of memory for %u particles", list->num);
    for (uint32_t i = 0; done && i < list->num; i++) {
        done = place(list, i, &placed[i], error);
        /* What has no extinction, or less than a float tells, is not there. */
        if (done && placed[i].radius > 0 && placed[i].extinction > 0)
            order[head.num++] = (sorted){key_of(placed[i].at), i};
    }
    if (done) {
        memcpy(head.origin, list->origin, sizeof head.origin);
        qsort(order, head.num, sizeof *order, compare_keys);
        list->size_bytes = lay_out(&head) * sizeof(uint64_t);
        list->data = calloc(1, list->size_bytes);
        done = list->data || karst_fail(error, KARST_FAILED, "out of memory for %u particles", head.num);
    }
    if (done) {
        memcpy(list->data, &head, sizeof head);
        for (uint32_t i = 0; i < head.num; i++)
            memcpy((karst_particle *)(list->data + head.particles) + i, &placed[order[i].index], sizeof *placed);
        build_tree(list->data);
        find_shares(list->data);
    }
    free(order);
    free(placed);
    return done;
}
