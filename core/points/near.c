/* What lies around each point: its nearest neighbours, the radius that they span, and the plane that they lie in.
 *
 * Points in Morton order have a tree without links: a leaf is 16 points that follow one another, a node is 8 leaves or
 * nodes that do. A leaf's points look for their neighbours together, in the leaf's box and a reach around it; the reach
 * is guessed by the leaf before and grows until it holds all that are nearest. Neighbours are exact, whatever the
 * guess. The plane is that of the least squares, by the eigenvector of the least eigenvalue of the covariance (H. Hoppe
 * and others: Surface Reconstruction from Unorganized Points, 1992). */
#if defined(__x86_64__)
#include <immintrin.h>
#endif
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define LEAF 16u
#define FAN 8u
#define MAX_TREE_LEVELS 12
#define BLOCK 4096u /* points that a thread takes at a time */
#define VECTOR 8u   /* candidates that are looked at together */
#define MOST_RANKED 64u /* a multiple of VECTOR */
typedef float vector __attribute__((vector_size(VECTOR * sizeof(float))));
typedef int32_t whole_place __attribute__((vector_size(16)));
typedef float float_place __attribute__((vector_size(16)));
typedef uint64_t bits_of_place __attribute__((vector_size(16)));
typedef double four_doubles __attribute__((vector_size(32)));
#define MANY_CANDIDATES 6000u /* more than that, and a leaf is looked at point by point */

typedef struct {
    int32_t min[3], max[3];
} box;

/* Points in a box, as offsets from a place. */
typedef struct {
    float *at[3], *square;
    uint32_t *index, *close;
    uint32_t num, capacity;
    int32_t origin[3];
    float likely; /* squares beyond this are hardly those of the nearest: a guess */
    const uint8_t (*orders)[VECTOR];
} candidates;

/* The nearest of them, in order; and a place for what is none of them. */
#define NOT_NEAREST (POINTS_NEAREST + 1)
typedef struct {
    float square[NOT_NEAREST + 1];
    uint32_t candidate[NOT_NEAREST + 1];
    uint32_t num;
} nearest;

typedef void (*finder)(candidates *c, const float at[3], nearest *n);

typedef struct {
    karst_point *points;
    uint32_t num, *links;
    int num_levels;
    uint32_t counts[MAX_TREE_LEVELS];
    box *nodes[MAX_TREE_LEVELS]; /* level 0: of leaves */
    float first_reach;
    finder find;
    uint8_t orders[1u << VECTOR][VECTOR]; /* see make_orders */
    bool failed; /* memory: set by any thread, never cleared */
} surroundings;

/* ---- the tree ---- */

static void grow(box *b, const box *other)
{
    for (int a = 0; a < 3; a++) {
        b->min[a] = other->min[a] < b->min[a] ? other->min[a] : b->min[a];
        b->max[a] = other->max[a] > b->max[a] ? other->max[a] : b->max[a];
    }
}

static box box_of(const karst_point *points, uint32_t begin, uint32_t end)
{
    box b = {{INT32_MAX, INT32_MAX, INT32_MAX}, {INT32_MIN, INT32_MIN, INT32_MIN}};
    for (uint32_t i = begin; i < end; i++) {
        box of_point;
        memcpy(of_point.min, points[i].at, sizeof of_point.min);
        memcpy(of_point.max, points[i].at, sizeof of_point.max);
        grow(&b, &of_point);
    }
    return b;
}

static void make_leaves(void *user, uint64_t begin, uint64_t end)
{
    surroundings *s = user;
    for (uint64_t i = begin; i < end; i++) {
        const uint32_t first = (uint32_t)i * LEAF;
        s->nodes[0][i] = box_of(s->points, first, s->num - first < LEAF ? s->num : first + LEAF);
    }
}

/* Each box holds those of the level below. */
static void make_level(surroundings *s, int level)
{
    for (uint32_t i = 0; i < s->counts[level]; i++) {
        const uint32_t begin = i * FAN, below = s->counts[level - 1];
        const uint32_t end = below - begin < FAN ? below : begin + FAN;
        s->nodes[level][i] = s->nodes[level - 1][begin];
        for (uint32_t k = begin + 1; k < end; k++)
            grow(&s->nodes[level][i], &s->nodes[level - 1][k]);
    }
}

static bool build_tree(points_import *import, surroundings *s, karst_error *error)
{
    uint32_t count = (s->num + LEAF - 1) / LEAF;
    const points_loop leaves = {"neighbours", 0, count, (uint64_t)count + s->num, BLOCK, true};
    for (s->num_levels = 0; s->num_levels < MAX_TREE_LEVELS; count = (count + FAN - 1) / FAN) {
        int level = s->num_levels++;
        s->counts[level] = count;
        s->nodes[level] = malloc(count * sizeof(box));
        if (!s->nodes[level])
            return karst_fail(error, KARST_FAILED, "out of memory for %u points", s->num);
        if (level > 0)
            make_level(s, level);
        else if (!karst_points_in_parallel(import, &leaves, make_leaves, s, error))
            return false;
        if (count == 1)
            return true;
    }
    return true;
}

/* ---- candidates ---- */

static bool make_room(candidates *c, uint32_t num)
{
    if (num <= c->capacity)
        return true;
    uint32_t capacity = c->capacity ? c->capacity : 1024; /* a multiple of VECTOR */
    while (capacity < num)
        capacity *= 2;
    void **arrays[] = {(void **)&c->at[0],  (void **)&c->at[1], (void **)&c->at[2],
                       (void **)&c->square, (void **)&c->index, (void **)&c->close};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        char *grown = realloc(*arrays[i], (size_t)capacity * sizeof(float));
        if (!grown)
            return false;
        memset(grown + (size_t)c->capacity * sizeof(float), 0, (size_t)(capacity - c->capacity) * sizeof(float));
        *arrays[i] = grown;
    }
    c->capacity = capacity;
    return true;
}

static bool meets(const box *a, const box *b)
{
    uint32_t is_apart = 0; /* without branches, which nobody could foretell */
    for (int axis = 0; axis < 3; axis++)
        is_apart |= (uint32_t)(a->min[axis] > b->max[axis]) | (uint32_t)(a->max[axis] < b->min[axis]);
    return !is_apart;
}

static bool add_leaf(const surroundings *s, const box *wanted, uint32_t leaf, candidates *c)
{
    const uint32_t begin = leaf * LEAF, end = s->num - begin < LEAF ? s->num : begin + LEAF;
    const whole_place origin = {c->origin[0], c->origin[1], c->origin[2]};
    const whole_place low = {wanted->min[0], wanted->min[1], wanted->min[2], INT32_MIN};
    const whole_place high = {wanted->max[0], wanted->max[1], wanted->max[2], INT32_MAX};
    if (!make_room(c, c->num + LEAF))
        return false;
    for (uint32_t i = begin; i < end; i++) {
        whole_place at = {0};
        memcpy(&at, s->points[i].at, sizeof s->points[i].at); /* not the radius, which another thread may write */
        const float_place offset = __builtin_convertvector(at - origin, float_place);
        const bits_of_place outside = (bits_of_place)((at < low) | (at > high));
        for (int a = 0; a < 3; a++)
            c->at[a][c->num] = offset[a];
        c->index[c->num] = i;
        c->num += (outside[0] | outside[1]) == 0; /* else the next one takes its place */
    }
    return true;
}

/* All points in a box, in their order; stops when there are more than `most`. */
static bool gather(const surroundings *s, const box *wanted, uint32_t most, candidates *c)
{
    int level = s->num_levels - 1;
    uint32_t i = 0;
    c->num = 0;
    while (c->num <= most && level >= 0 && i < s->counts[level]) {
        if (meets(&s->nodes[level][i], wanted)) {
            if (level > 0) {
                level--;
                i *= FAN;
                continue;
            }
            if (!add_leaf(s, wanted, i, c))
                return false;
        }
        i++;
        while (level + 1 < s->num_levels && (i % FAN == 0 || i == s->counts[level])) {
            i = (i + FAN - 1) / FAN;
            level++;
        }
    }
    return true;
}

/* ---- planes ---- */

/* The direction in which a symmetric matrix (xx xy xz yy yz zz) stretches least. */
static void least_direction(const double m[6], double direction[3])
{
    double mean = (m[0] + m[3] + m[5]) / 3, a = m[0] - mean, b = m[3] - mean, c = m[5] - mean;
    double p = sqrt((a * a + b * b + c * c + 2 * (m[1] * m[1] + m[2] * m[2] + m[4] * m[4])) / 6);
    double determinant = a * (b * c - m[4] * m[4]) - m[1] * (m[1] * c - m[4] * m[2]) + m[2] * (m[1] * m[4] - b * m[2]);
    double r = p > 0 ? determinant / (2 * p * p * p) : 0;
    double least = mean + 2 * p * cos(acos(fmin(fmax(r, -1), 1)) / 3 + 2.0943951023931953);
    const double rows[3][3] = {{m[0] - least, m[1], m[2]}, {m[1], m[3] - least, m[4]}, {m[2], m[4], m[5] - least}};
    double best = 0, longest[3] = {0};
    for (int i = 0; i < 3; i++) {
        const double *u = rows[i], *v = rows[(i + 1) % 3];
        const double cross[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
        double square = cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2];
        if (!(square > best))
            continue;
        best = square;
        memcpy(longest, cross, sizeof longest);
    }
    for (int k = 0; k < 3; k++)
        direction[k] = best > 0 ? longest[k] / sqrt(best) : k == 1;
}

/* Those whose squares are at most so large, in their order; returns how many. */
static uint32_t pick_close(candidates *c, float most)
{
    const float *restrict square = c->square;
    uint32_t *restrict close = c->close, num = 0;
    for (uint32_t i = 0; i < c->num; i++) { /* without a branch, which nobody could foretell */
        close[num] = i;
        num += square[i] <= most;
    }
    return num;
}

/* Of those that are close the nearest, in their order: each is put before those that are farther. */
static void insert_close(const candidates *c, uint32_t num_close, nearest *n)
{
    const float *restrict square = c->square;
    n->num = 0;
    for (uint32_t k_close = 0; k_close < num_close; k_close++) {
        const uint32_t i = c->close[k_close];
        if (n->num == POINTS_NEAREST + 1 && square[i] >= n->square[POINTS_NEAREST])
            continue;
        uint32_t k = n->num < POINTS_NEAREST + 1 ? n->num++ : POINTS_NEAREST;
        for (; k > 0 && n->square[k - 1] > square[i]; k--) {
            n->square[k] = n->square[k - 1];
            n->candidate[k] = n->candidate[k - 1];
        }
        n->square[k] = square[i];
        n->candidate[k] = i;
    }
}

static void find_nearest_plain(candidates *c, const float at[3], nearest *n)
{
    float *restrict square = c->square;
    for (uint32_t i = 0; i < c->num; i += VECTOR) { /* there is room behind the last one */
        vector d = {0}, sum = {0};
        for (int a = 0; a < 3; a++) {
            memcpy(&d, c->at[a] + i, sizeof d);
            d -= at[a];
            sum += d * d;
        }
        memcpy(square + i, &sum, sizeof sum);
    }
    uint32_t num_close = pick_close(c, c->likely);
    if (num_close < POINTS_NEAREST + 1)
        num_close = pick_close(c, INFINITY);
    insert_close(c, num_close, n);
    if (n->num == POINTS_NEAREST + 1)
        c->likely = 1.6f * n->square[POINTS_NEAREST];
}

#if defined(__x86_64__)
#define AVX2 __attribute__((target("avx2")))

/* Those that are close, with as many places behind them as a vector has. */
typedef struct {
    float square[MOST_RANKED + VECTOR];
    int32_t candidate[MOST_RANKED + VECTOR];
    uint32_t num; /* what is beyond MOST_RANKED is counted only */
} close_ones;

/* Candidates whose squares are at most so large, in their order. */
AVX2 static void pick_close_avx2(const candidates *c, const float at[3], float most, close_ones *close)
{
    const __m256 x = _mm256_set1_ps(at[0]), y = _mm256_set1_ps(at[1]), z = _mm256_set1_ps(at[2]);
    const __m256 limit = _mm256_set1_ps(most);
    close->num = 0;
    for (uint32_t i = 0; i < c->num; i += VECTOR) {
        const __m256 dx = _mm256_sub_ps(_mm256_loadu_ps(c->at[0] + i), x);
        const __m256 dy = _mm256_sub_ps(_mm256_loadu_ps(c->at[1] + i), y);
        const __m256 dz = _mm256_sub_ps(_mm256_loadu_ps(c->at[2] + i), z);
        const __m256 square = _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(dx, dx), _mm256_mul_ps(dy, dy)),
                                            _mm256_mul_ps(dz, dz));
        uint32_t mask = (uint32_t)_mm256_movemask_ps(_mm256_cmp_ps(square, limit, _CMP_LE_OQ));
        if (c->num - i < VECTOR)
            mask &= (1u << (c->num - i)) - 1;
        /* Those of the mask move to the front, and all eight are stored: the others are overwritten. */
        const __m256i order = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const void *)c->orders[mask]));
        const uint32_t to = close->num < MOST_RANKED ? close->num : MOST_RANKED;
        _mm256_storeu_ps(close->square + to, _mm256_permutevar8x32_ps(square, order));
        _mm256_storeu_si256((void *)(close->candidate + to), _mm256_add_epi32(order, _mm256_set1_epi32((int32_t)i)));
        close->num += (uint32_t)__builtin_popcount(mask);
    }
}

/* Each goes where the number of those that are nearer says, again without branches. */
AVX2 static void rank_close(close_ones *close, nearest *n)
{
    int32_t ranks[MOST_RANKED];
    const uint32_t num = close->num;
    for (uint32_t k = num; k % VECTOR; k++)
        close->square[k] = INFINITY;
    for (uint32_t k = 0; k < num; k += VECTOR) {
        const __m256 some = _mm256_loadu_ps(close->square + k);
        __m256i nearer = _mm256_setzero_si256(); /* less 1 for each */
        for (uint32_t i = 0; i < num; i++)
            nearer = _mm256_add_epi32(nearer, _mm256_castps_si256(_mm256_cmp_ps(
                                                  _mm256_broadcast_ss(close->square + i), some, _CMP_LT_OQ)));
        _mm256_storeu_si256((void *)(ranks + k), _mm256_sub_epi32(_mm256_setzero_si256(), nearer));
    }
    n->num = num < POINTS_NEAREST + 1 ? num : POINTS_NEAREST + 1;
    for (uint32_t k = 0; k < NOT_NEAREST; k++)
        n->square[k] = -1; /* nobody's yet */
    for (uint32_t k = 0; k < num; k++) {
        uint32_t rank = ranks[k] < (int32_t)NOT_NEAREST ? (uint32_t)ranks[k] : NOT_NEAREST;
        while (rank < NOT_NEAREST && n->square[rank] >= 0) /* those before that are as far */
            rank++;
        n->square[rank] = close->square[k];
        n->candidate[rank] = (uint32_t)close->candidate[k];
    }
}

AVX2 static void find_nearest_avx2(candidates *c, const float at[3], nearest *n)
{
    close_ones close;
    pick_close_avx2(c, at, c->likely, &close);
    if (close.num < POINTS_NEAREST + 1)
        pick_close_avx2(c, at, 3 * c->likely, &close);
    if (close.num < POINTS_NEAREST + 1)
        pick_close_avx2(c, at, INFINITY, &close);
    if (close.num > MOST_RANKED) {
        find_nearest_plain(c, at, n);
        return;
    }
    rank_close(&close, n);
    if (n->num == POINTS_NEAREST + 1)
        c->likely = 1.6f * n->square[POINTS_NEAREST];
}
#endif

/* For each mask of a vector's lanes: those that it has, in their order; what follows is of no matter. */
static void make_orders(uint8_t orders[1u << VECTOR][VECTOR])
{
    for (uint32_t mask = 0; mask < 1u << VECTOR; mask++)
        for (uint32_t lane = 0, num = 0; lane < VECTOR; lane++)
            if (mask >> lane & 1)
                orders[mask][num++] = (uint8_t)lane;
}

/* Whichever this processor is good at; both find the same. */
static finder best_finder(const points_limits *limits)
{
#if defined(__x86_64__)
    if (!limits->has_no_vectors && __builtin_cpu_supports("avx2"))
        return find_nearest_avx2;
#endif
    (void)limits;
    return find_nearest_plain;
}

#define MOST_FITTED 20u /* a multiple of 4 */
_Static_assert(POINTS_NEAREST + 1 <= MOST_FITTED, "room for all");

static void fit_plane(const candidates *c, const nearest *n, int16_t normal[3])
{
    double at[3][MOST_FITTED] = {{0}}, mean[3] = {0}, m[6] = {0}, direction[3];
    for (int a = 0; a < 3; a++) {
        double parts[MOST_FITTED];
        for (uint32_t k = 0; k < n->num; k++)
            at[a][k] = (double)c->at[a][n->candidate[k]];
        for (uint32_t k = 0; k < MOST_FITTED; k += 4) { /* a division takes as long as those of a vector */
            four_doubles some;
            memcpy(&some, at[a] + k, sizeof some);
            some /= (double)n->num;
            memcpy(parts + k, &some, sizeof some);
        }
        for (uint32_t k = 0; k < n->num; k++)
            mean[a] += parts[k];
    }
    for (uint32_t k = 0; k < n->num; k++) {
        double d[3];
        for (int a = 0; a < 3; a++)
            d[a] = at[a][k] - mean[a];
        m[0] += d[0] * d[0];
        m[1] += d[0] * d[1];
        m[2] += d[0] * d[2];
        m[3] += d[1] * d[1];
        m[4] += d[1] * d[2];
        m[5] += d[2] * d[2];
    }
    least_direction(m, direction);
    for (int a = 0; a < 3; a++)
        normal[a] = (int16_t)rint(direction[a] * 32767);
}

/* ---- the points ---- */

static bool has_normal(const karst_point *p) { return p->normal[0] || p->normal[1] || p->normal[2]; }

/* Notes what was found of point `i`. */
static void note(surroundings *s, uint32_t i, const candidates *c, const nearest *n)
{
    karst_point *made = &s->points[i];
    uint32_t *links = s->links + (size_t)i * POINTS_LINKS;
    uint32_t last = n->num - 1 < POINTS_RADIUS_OF ? n->num - 1 : POINTS_RADIUS_OF;
    made->radius = sqrtf(n->square[last]);
    if (made->is_found || !has_normal(made)) {
        /* First the mark: an import that is cut off here finds this normal again. */
        __atomic_store_n(&made->is_found, 1, __ATOMIC_RELEASE);
        fit_plane(c, n, made->normal);
    }
    for (uint32_t k = 0; k < POINTS_LINKS; k++)
        links[k] = k + 1 < n->num ? c->index[n->candidate[k + 1]] : UINT32_MAX;
}

static int32_t clamp(double v) { return v > 0x1p30 ? 1 << 30 : v < -0x1p30 ? -(1 << 30) : (int32_t)v; }

/* Points [begin, end), which lie near one another. *reach: a guess, and a better one for what comes next. */
static bool look_around(surroundings *s, uint32_t begin, uint32_t end, float *reach, candidates *c)
{
    const box own = box_of(s->points, begin, end);
    uint32_t wanted = s->num < POINTS_NEAREST + 1 ? s->num : POINTS_NEAREST + 1;
    for (int a = 0; a < 3; a++)
        c->origin[a] = own.min[a] / 2 + own.max[a] / 2;
    for (float guess = *reach;; guess *= 1.6f) {
        box around = own;
        for (int a = 0; a < 3; a++) {
            around.min[a] = clamp(floor((double)own.min[a] - (double)guess));
            around.max[a] = clamp(ceil((double)own.max[a] + (double)guess));
        }
        if (!gather(s, &around, end - begin > 1 ? MANY_CANDIDATES : s->num, c))
            return false;
        if (c->num > MANY_CANDIDATES && end - begin > 1) {
            for (uint32_t i = begin; i < end; i++) {
                *reach = guess / 4;
                if (!look_around(s, i, i + 1, reach, c))
                    return false;
            }
            return true;
        }
        bool is_all = guess > 0x1p31f, is_enough = true;
        float farthest = 0;
        nearest n[LEAF];
        for (uint32_t i = begin; i < end && is_enough; i++) {
            float at[3];
            for (int a = 0; a < 3; a++)
                at[a] = (float)(s->points[i].at[a] - c->origin[a]);
            nearest *of = &n[i - begin];
            s->find(c, at, of);
            is_enough = is_all || (of->num >= wanted && of->square[wanted - 1] <= guess * guess);
            farthest = of->num && of->square[of->num - 1] > farthest ? of->square[of->num - 1] : farthest;
        }
        if (!is_enough)
            continue;
        for (uint32_t i = begin; i < end; i++)
            note(s, i, c, &n[i - begin]);
        *reach = sqrtf(farthest) * 1.1f + 1;
        return true;
    }
}

static void look_at_block(void *user, uint64_t begin, uint64_t end)
{
    surroundings *s = user;
    candidates c = {.orders = (const uint8_t (*)[VECTOR])s->orders};
    float reach = s->first_reach;
    bool done = true;
    for (uint64_t at = begin; done && at < end; at += LEAF)
        done = look_around(s, (uint32_t)at, (uint32_t)(end - at < LEAF ? end : at + LEAF), &reach, &c);
    if (!done)
        __atomic_store_n(&s->failed, true, __ATOMIC_RELAXED);
    for (int a = 0; a < 3; a++)
        free(c.at[a]);
    free(c.square);
    free(c.index);
    free(c.close);
}

/* Part by part, so that what is done is noted. */
static bool look_at_all(points_import *import, surroundings *s, karst_error *error)
{
    const uint64_t most = import->limits.most_between;
    bool done = true;
    for (uint64_t at = import->now.done; done && at < s->num; at += most) {
        const points_loop loop = {"neighbours", at, s->num - at < most ? s->num : at + most, s->num, BLOCK, false};
        done = karst_points_in_parallel(import, &loop, look_at_block, s, error) &&
               (!s->failed || karst_fail(error, KARST_FAILED, "out of memory for neighbours"));
        karst_points_stay_small(import);
        import->now.done = loop.end;
        done = done && karst_points_checkpoint(import, error);
    }
    return done;
}

bool karst_points_look_around(points_import *import, karst_error *error)
{
    const uint32_t num = (uint32_t)import->now.num;
    const bool anew = import->now.done == 0;
    surroundings s = {.num = num, .find = best_finder(&import->limits)};
    make_orders(s.orders);
    s.points = karst_points_map_file(import, karst_points_in_order(import), num * sizeof *s.points, false, error);
    s.links =
        s.points ? karst_points_map_file(import, POINTS_NEAR, (size_t)num * POINTS_LINKS * sizeof *s.links, anew, error)
                 : NULL;
    bool done = s.links && build_tree(import, &s, error);
    if (done) {
        const box *all = &s.nodes[s.num_levels - 1][0];
        double side = 0;
        for (int a = 0; a < 3; a++)
            side = fmax(side, (double)all->max[a] - all->min[a]);
        s.first_reach = (float)(4 * side / sqrt(num)) + 1;
        done = look_at_all(import, &s, error);
    }
    for (int i = 0; i < s.num_levels; i++)
        free(s.nodes[i]);
    karst_points_unmap(import, s.links);
    karst_points_unmap(import, s.points);
    return done;
}
