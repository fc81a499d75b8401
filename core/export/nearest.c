/* The surface that is nearest to points: some surface along straight ways, and down the slope to where that is nearest;
 * then cubes around the point, the nearest first, until nothing can be much nearer; and down the slope again. Points
 * that lie side by side share what is known of cubes (near_tree.h), and what is found goes down the slope for many
 * points at once. */
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/export/crew.h"
#include "core/export/near_tree.h"
#include "karst/query.h"

enum { MOST_CUBES = 50000, SLIDES = 16, MOST_HALVED = 7, MOST_STEPS = 60, AT_ONCE = 256 };
/* First something is sought along so many ways, at so many lengths, each twice the last, and between two of these. */
enum { WAYS = 26, LENGTHS = 12, SHARES = 16 };
/* A cube is small if its diagonal is within what was asked for, or this share of how far it is. */
#define SMALL_SHARE (1.0 / 16)
/* What is proved may be so much less than what was found. */
#define TOLERANCE (1.0 / 16)
/* More than distances to cubes err by, in parts of the reach. */
#define DISTANCE_ERROR 0x1p-46

typedef struct {
    const karst_position *at;
    double within_m, footprint_m, reach_m;
    int voxel_log2_m, root_level;
    struct thread_tree *trees; /* one for each thread */
    atomic_int num_trees;
    const uint32_t *order; /* of the points: those that lie side by side follow one another */
    karst_query_near *found;
    atomic_bool *is_out_of_memory;
} near_task;

/* Threads are told apart by their samplers. */
struct thread_tree {
    karst_sampler *_Atomic sampler; /* NULL: of none yet */
    karst_near_tree *tree;
};
enum { MAX_THREADS = 256 };

/* A cube that is to be looked at; metres from the point. */
typedef struct {
    karst_near_cube cube;
    double low[3], size_m, nearest_m;
} open_cube;

/* What a thread searches with, for some points. */
typedef struct {
    const near_task *task;
    karst_sampler *sampler;
    karst_near_tree *tree;
    open_cube *cubes;
    uint32_t *heap; /* of them, nearest first */
    size_t num_cubes, num_open, max_cubes;
    bool is_out_of_memory;
} searcher;

/* One point's. */
typedef struct {
    karst_position from;
    bool is_solid;
    double best[3], best_m;           /* the nearest place of the other side so far */
    double proved_m, least_dropped_m; /* what was proved; of cubes that were not looked at closer */
    /* While it goes down the slope: */
    double place[3];             /* of the other side; the surface is sought on the way there */
    double low, high;            /* shares of it: there is the point's side, and the other */
    float density[2], weight[2]; /* there; and halved, where that end stands still */
    double next, before_m;
    int last_end;
    bool is_new, is_open, is_sliding; /* new: what is best was not followed yet */
} search;

static double length_of(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* ---- cubes ---- */

static double distance_to(const double low[3], double size_m, double place[3])
{
    for (int axis = 0; axis < 3; axis++)
        place[axis] = fmin(fmax(0, low[axis]), low[axis] + size_m);
    return length_of(place);
}

static void push(searcher *r, const open_cube *item)
{
    if (r->num_cubes == r->max_cubes) {
        const size_t more = r->max_cubes ? 2 * r->max_cubes : 1024;
        open_cube *cubes = realloc(r->cubes, more * sizeof *cubes);
        r->cubes = cubes ? cubes : r->cubes;
        uint32_t *heap = cubes ? realloc(r->heap, more * sizeof *heap) : NULL;
        r->heap = heap ? heap : r->heap;
        if (!heap) {
            r->is_out_of_memory = true;
            return;
        }
        r->max_cubes = more;
    }
    size_t i = r->num_open++;
    for (; i > 0 && item->nearest_m < r->cubes[r->heap[(i - 1) / 2]].nearest_m; i = (i - 1) / 2)
        r->heap[i] = r->heap[(i - 1) / 2];
    r->heap[i] = (uint32_t)r->num_cubes;
    r->cubes[r->num_cubes++] = *item;
}

static open_cube pop(searcher *r)
{
    const uint32_t top = r->heap[0], last = r->heap[--r->num_open];
    size_t i = 0;
    for (size_t child; (child = 2 * i + 1) < r->num_open; i = child) {
        if (child + 1 < r->num_open && r->cubes[r->heap[child + 1]].nearest_m < r->cubes[r->heap[child]].nearest_m)
            child++;
        if (r->cubes[last].nearest_m <= r->cubes[r->heap[child]].nearest_m)
            break;
        r->heap[i] = r->heap[child];
    }
    r->heap[i] = last;
    return r->cubes[top];
}

/* ---- one point ---- */

static void consider(search *s, const double place[3])
{
    const double distance = length_of(place);
    if (distance >= s->best_m)
        return;
    s->best_m = distance;
    s->is_new = true;
    memcpy(s->best, place, sizeof s->best);
}

/* Samples of a small cube. */
static bool shows_other_side(searcher *r, search *s, const open_cube *c)
{
    const uint32_t solid = karst_near_tree_solid(r->tree, &c->cube);
    const uint32_t other = (s->is_solid ? ~solid : solid) & ((1u << KARST_NEAR_SAMPLES) - 1);
    for (int i = 0; i < KARST_NEAR_SAMPLES; i++) {
        const int step[3] = {i % 3, i / 3 % 3, i / 9};
        double place[3];
        for (int axis = 0; axis < 3; axis++)
            place[axis] = c->low[axis] + step[axis] * c->size_m / 2;
        if (other >> i & 1)
            consider(s, place);
    }
    return other != 0;
}

static void look(searcher *r, search *s, const open_cube *c)
{
    const near_task *task = r->task;
    double place[3];
    const bool is_small = sqrt(3) * c->size_m <= fmax(task->within_m, SMALL_SHARE * c->nearest_m);
    int side = is_small ? karst_near_tree_glance(r->tree, &c->cube) : karst_near_tree_side(r->tree, &c->cube);
    side = s->is_solid ? side : -side;
    if (side > 0)
        return;
    if (side < 0) {
        distance_to(c->low, c->size_m, place);
        consider(s, place);
        return;
    }
    if (is_small) {
        if (!shows_other_side(r, s, c) && karst_near_tree_prove(r->tree, &c->cube) != 0)
            return;
        s->least_dropped_m = fmin(s->least_dropped_m, c->nearest_m);
        return;
    }
    for (int i = 0; i < 8; i++) {
        open_cube part = {.size_m = c->size_m / 2};
        for (int axis = 0; axis < 3; axis++)
            part.low[axis] = c->low[axis] + (i >> axis & 1 ? part.size_m : 0);
        part.nearest_m = distance_to(part.low, part.size_m, place);
        if (!(part.nearest_m * (1 + TOLERANCE) < s->best_m && part.nearest_m < task->reach_m)) {
            s->least_dropped_m = fmin(s->least_dropped_m, part.nearest_m);
            continue;
        }
        if (!karst_near_tree_child(r->tree, &c->cube, i, &part.cube)) {
            r->is_out_of_memory = true;
            return;
        }
        side = karst_near_tree_glance(r->tree, &part.cube);
        if (side == 0 || (side > 0) != s->is_solid)
            push(r, &part);
    }
}

/* The cubes of the tree's size that reach around the point; what lies beyond the world's edge is no place. */
static void push_roots(searcher *r, const search *s)
{
    const near_task *task = r->task;
    const double reach_m[3] = {task->reach_m, task->reach_m, task->reach_m};
    const double back_m[3] = {-task->reach_m, -task->reach_m, -task->reach_m};
    const karst_position low = karst_position_add_m(s->from, back_m, task->voxel_log2_m);
    const karst_position high = karst_position_add_m(s->from, reach_m, task->voxel_log2_m);
    const int64_t edge = (int64_t)1 << (62 - task->root_level);
    int64_t root[3], first[3];
    for (int axis = 0; axis < 3; axis++)
        first[axis] = low.voxel[axis] >> task->root_level;
    karst_near_tree_begin(r->tree, first);
    for (root[2] = first[2]; root[2] <= high.voxel[2] >> task->root_level; root[2]++)
        for (root[1] = first[1]; root[1] <= high.voxel[1] >> task->root_level; root[1]++)
            for (root[0] = first[0]; root[0] <= high.voxel[0] >> task->root_level; root[0]++) {
                open_cube c = {.size_m = ldexp(1, task->root_level + task->voxel_log2_m)};
                double place[3];
                if (root[0] >= edge || root[1] >= edge || root[2] >= edge)
                    continue;
                if (!karst_near_tree_root(r->tree, root, &c.cube)) {
                    r->is_out_of_memory = true;
                    return;
                }
                karst_position_difference_m(s->from, c.cube.low, task->voxel_log2_m, c.low);
                c.nearest_m = distance_to(c.low, c.size_m, place);
                if (c.nearest_m < task->reach_m)
                    push(r, &c);
            }
}

/* The sides of places on the way to `way`, at shares of it that go up to 1: the first that is of the other side. */
static void scout_way(searcher *r, search *s, const double way[3])
{
    karst_position at[SHARES];
    float density[SHARES];
    double places[SHARES][3];
    for (int i = 0; i < SHARES; i++) {
        for (int axis = 0; axis < 3; axis++)
            places[i][axis] = way[axis] * (0.5 + 0.5 * (i + 1) / SHARES);
        at[i] = karst_position_add_m(s->from, places[i], r->task->voxel_log2_m);
    }
    karst_sampler_densities(r->sampler, at, SHARES, r->task->footprint_m, density);
    for (int i = SHARES - 1; i >= 0; i--)
        if ((density[i] > 0) != s->is_solid)
            consider(s, places[i]);
}

/* Along straight ways, ever farther. */
static void scout(searcher *r, search *s)
{
    for (int step = LENGTHS - 1; step >= 0 && !isfinite(s->best_m); step--) {
        const double length = ldexp(r->task->reach_m, -step);
        double places[WAYS][3];
        karst_position at[WAYS];
        float density[WAYS];
        for (int i = 0; i < WAYS; i++) {
            const int k = i < WAYS / 2 ? i : i + 1; /* all but the middle of 3 x 3 x 3 */
            const double way[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1}, scale = length / length_of(way);
            for (int axis = 0; axis < 3; axis++)
                places[i][axis] = way[axis] * scale;
            at[i] = karst_position_add_m(s->from, places[i], r->task->voxel_log2_m);
        }
        karst_sampler_densities(r->sampler, at, WAYS, r->task->footprint_m, density);
        for (int i = 0; i < WAYS; i++)
            if ((density[i] > 0) != s->is_solid)
                scout_way(r, s, places[i]);
    }
}

static void search_cubes(searcher *r, search *s)
{
    const double reach_m = r->task->reach_m;
    size_t num_looked = 0;
    r->num_cubes = r->num_open = 0;
    push_roots(r, s);
    s->proved_m = reach_m;
    while (r->num_open && !r->is_out_of_memory) {
        const double nearest_m = r->cubes[r->heap[0]].nearest_m;
        if (nearest_m * (1 + TOLERANCE) >= s->best_m || ++num_looked > MOST_CUBES) {
            s->proved_m = nearest_m;
            break;
        }
        const open_cube c = pop(r);
        look(r, s, &c);
    }
    s->proved_m = fmax(fmin(s->proved_m, s->least_dropped_m) - DISTANCE_ERROR * reach_m, 0);
}

/* ---- down the slope, many at once ---- */

typedef struct {
    const searcher *r;
    search *all;
    size_t num;
    karst_position at[2 * AT_ONCE];
    float density[2 * AT_ONCE], gradient[AT_ONCE][3];
} slope;

static karst_position position_at(const slope *p, const search *s, double share, const double place[3])
{
    const double offset_m[3] = {share * place[0], share * place[1], share * place[2]};
    return karst_position_add_m(s->from, offset_m, p->r->task->voxel_log2_m);
}

static void sample(slope *p, size_t num)
{
    karst_sampler_densities(p->r->sampler, p->at, num, p->r->task->footprint_m, p->density);
}

/* Between the ends, where the density should be 0, or in the middle each third time; not next to an end. */
static void choose_next(search *s, int step, double least)
{
    const double share = (double)s->weight[0] / ((double)s->weight[0] - (double)s->weight[1]);
    double next = step % 3 == 2 || !isfinite(share) ? (s->low + s->high) / 2 : s->low + share * (s->high - s->low);
    next += next - s->low < s->high - next ? least : -least;
    s->next = fmin(fmax(next, s->low + least), s->high - least);
}

static void learn(search *s, float density)
{
    const int end = (density > 0) != s->is_solid;
    if (end)
        s->high = s->next;
    else
        s->low = s->next;
    s->density[end] = s->weight[end] = density;
    s->weight[!end] *= s->last_end == end ? 0.5f : 1;
    s->last_end = end;
}

/* Where the ways of those that are open meet the surface: moves `high` there. They go on from `low`, if that is on the
 * point's side; those whose place turns out to be so, too, are no longer open. */
static void cross(slope *p)
{
    const double within_m = p->r->task->within_m / 16;
    size_t open[AT_ONCE], num_open = 0;
    for (size_t i = 0; i < p->num; i++)
        if (p->all[i].is_open) {
            search *s = &p->all[i];
            p->at[2 * num_open] = position_at(p, s, s->low, s->place);
            p->at[2 * num_open + 1] = position_at(p, s, 1, s->place);
            open[num_open++] = i;
        }
    sample(p, 2 * num_open);
    size_t left = 0;
    for (size_t k = 0; k < num_open; k++) {
        search *s = &p->all[open[k]];
        s->high = 1;
        s->last_end = -1;
        for (int end = 0; end < 2; end++)
            s->density[end] = s->weight[end] = p->density[2 * k + (size_t)end];
        if ((s->density[0] > 0) != s->is_solid) { /* nothing was proved so far out */
            s->low = 0;
            s->weight[0] = -s->weight[1];
        }
        s->is_open = (s->density[1] > 0) != s->is_solid;
        if (s->is_open)
            open[left++] = open[k];
    }
    num_open = left;
    for (int step = 0; num_open && step < MOST_STEPS; step++) {
        left = 0;
        for (size_t k = 0; k < num_open; k++) {
            search *s = &p->all[open[k]];
            const double length = length_of(s->place);
            if ((s->high - s->low) * length <= within_m)
                continue;
            choose_next(s, step, 0.4 * within_m / length);
            p->at[left] = position_at(p, s, s->next, s->place);
            open[left++] = open[k];
        }
        sample(p, num_open = left);
        for (size_t k = 0; k < num_open; k++)
            learn(&p->all[open[k]], p->density[k]);
    }
}

/* What was crossed may be the nearest so far. */
static void keep(slope *p)
{
    for (size_t i = 0; i < p->num; i++) {
        search *s = &p->all[i];
        double place[3];
        for (int axis = 0; axis < 3; axis++)
            place[axis] = s->high * s->place[axis];
        if (s->is_open)
            consider(s, place);
    }
}

/* The surface's normals at the best places of those that slide, or of all; 0: there is none. */
static void find_normals(slope *p, bool of_all, double (*normals)[3])
{
    size_t asked[AT_ONCE], num = 0;
    for (size_t i = 0; i < p->num; i++)
        if ((of_all || p->all[i].is_sliding) && isfinite(p->all[i].best_m)) {
            p->at[num] = position_at(p, &p->all[i], 1, p->all[i].best);
            asked[num++] = i;
        } else if (of_all) {
            memset(normals[i], 0, sizeof normals[i]);
        }
    if (!karst_sampler_gradients(p->r->sampler, p->at, num, p->r->task->footprint_m, p->gradient, p->density))
        memset(p->gradient, 0, sizeof p->gradient);
    for (size_t k = 0; k < num; k++) {
        double *normal = normals[asked[k]], square = 0;
        for (int axis = 0; axis < 3; axis++) {
            normal[axis] = -(double)p->gradient[k][axis];
            square += normal[axis] * normal[axis];
        }
        const bool is_known = square > 0 && isfinite(square);
        for (int axis = 0; axis < 3; axis++)
            normal[axis] = is_known ? normal[axis] / sqrt(square) : 0;
        p->all[asked[k]].is_sliding = is_known;
    }
}

/* From the best places along the surface, towards where the point is nearest to its tangent; less far, while what is
 * there is no longer the other side. */
static void choose_slides(slope *p, const double (*normals)[3])
{
    bool is_sought[AT_ONCE];
    for (size_t i = 0; i < p->num; i++) {
        is_sought[i] = p->all[i].is_sliding;
        p->all[i].is_open = false;
    }
    for (int halving = 0; halving < MOST_HALVED; halving++) {
        size_t sought[AT_ONCE], num = 0;
        for (size_t i = 0; i < p->num; i++) {
            search *s = &p->all[i];
            double along = 0;
            if (!is_sought[i])
                continue;
            for (int axis = 0; axis < 3; axis++)
                along += s->best[axis] * normals[i][axis];
            for (int axis = 0; axis < 3; axis++)
                s->place[axis] = s->best[axis] - ldexp(s->best[axis] - along * normals[i][axis], -halving);
            const double scale = s->best_m / length_of(s->place);
            for (int axis = 0; axis < 3; axis++)
                s->place[axis] *= scale;
            if (!isfinite(scale))
                continue;
            p->at[num] = position_at(p, s, 1, s->place);
            sought[num++] = i;
        }
        sample(p, num);
        for (size_t k = 0; k < num; k++)
            if ((p->density[k] > 0) != p->all[sought[k]].is_solid) {
                p->all[sought[k]].is_open = true;
                is_sought[sought[k]] = false;
            }
    }
}

static void begin_way(search *s) { s->low = fmin(s->proved_m / length_of(s->place), 1) * (1 - 0x1p-20); }

static void go_down(slope *p, double (*normals)[3])
{
    for (size_t i = 0; i < p->num; i++) {
        search *s = &p->all[i];
        s->is_open = s->is_sliding = s->is_new && s->best_m > 0;
        memcpy(s->place, s->best, sizeof s->place);
        if (s->is_open)
            begin_way(s);
    }
    cross(p);
    keep(p);
    for (int slide = 0; slide < SLIDES; slide++) {
        bool any = false;
        find_normals(p, false, normals);
        choose_slides(p, (const double(*)[3])normals);
        for (size_t i = 0; i < p->num; i++) {
            p->all[i].before_m = p->all[i].best_m;
            if (p->all[i].is_open)
                begin_way(&p->all[i]);
        }
        cross(p);
        keep(p);
        for (size_t i = 0; i < p->num; i++) {
            search *s = &p->all[i];
            s->is_sliding = s->is_open && s->before_m - s->best_m > p->r->task->within_m / 16;
            any = any || s->is_sliding;
        }
        if (!any)
            break;
    }
    for (size_t i = 0; i < p->num; i++)
        p->all[i].is_new = false;
}

/* ---- some points ---- */

/* At most AT_ONCE. */
static void find_few(searcher *r, slope *p, size_t first, size_t num)
{
    const near_task *task = r->task;
    double normals[AT_ONCE][3];
    p->num = num;
    for (size_t i = 0; i < num; i++)
        p->at[i] = task->at[task->order[first + i]];
    karst_sampler_densities(r->sampler, p->at, num, task->footprint_m, p->density);
    for (size_t i = 0; i < num; i++)
        p->all[i] =
            (search){.from = p->at[i], .is_solid = p->density[i] > 0, .best_m = INFINITY, .least_dropped_m = INFINITY};
    for (size_t i = 0; i < num; i++)
        scout(r, &p->all[i]);
    go_down(p, normals);
    for (size_t i = 0; i < num && !r->is_out_of_memory; i++)
        search_cubes(r, &p->all[i]);
    go_down(p, normals);
    find_normals(p, true, normals);
    for (size_t i = 0; i < num; i++) {
        const search *s = &p->all[i];
        karst_query_near *found = &task->found[task->order[first + i]];
        const bool is_within = s->best_m <= task->reach_m;
        *found = (karst_query_near){.at = position_at(p, s, 1, s->best),
                                    .distance_m = is_within ? s->best_m : INFINITY,
                                    .at_least_m = fmin(s->proved_m, s->best_m),
                                    .is_inside = s->is_solid};
        if (is_within)
            memcpy(found->normal, normals[i], sizeof found->normal);
    }
}

/* That of the thread: it stays from one part of the points to the next. NULL: out of memory. */
static karst_near_tree *tree_of(near_task *task, karst_sampler *sampler)
{
    for (int i = 0; i < MAX_THREADS && i < atomic_load(&task->num_trees); i++)
        if (atomic_load(&task->trees[i].sampler) == sampler)
            return task->trees[i].tree;
    karst_near_tree *tree = karst_near_tree_create(sampler, task->footprint_m, task->voxel_log2_m, task->root_level);
    if (tree) {
        struct thread_tree *own = &task->trees[atomic_fetch_add(&task->num_trees, 1)];
        own->tree = tree;
        atomic_store(&own->sampler, sampler);
    }
    return tree;
}

static void find_some(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    near_task *task = user;
    searcher r = {.task = task, .sampler = sampler, .tree = tree_of(task, sampler)};
    slope *p = malloc(sizeof *p);
    search *all = malloc(AT_ONCE * sizeof *all);
    r.is_out_of_memory = !r.tree || !p || !all;
    if (p)
        *p = (slope){.r = &r, .all = all};
    for (size_t i = first; i < end && !r.is_out_of_memory; i += AT_ONCE)
        find_few(&r, p, i, end - i < AT_ONCE ? end - i : AT_ONCE);
    if (r.is_out_of_memory)
        atomic_store(task->is_out_of_memory, true);
    free(r.cubes);
    free(r.heap);
    free(p);
    free(all);
}

/* ---- all points ---- */

typedef struct {
    uint64_t key;
    uint32_t point;
} place_in_order;

static int compare_places(const void *a, const void *b)
{
    const place_in_order *p = a, *q = b;
    return p->key != q->key ? (p->key < q->key ? -1 : 1) : p->point < q->point ? -1 : p->point > q->point;
}

/* Points in the order of a curve that fills space: by 21 bits of each coordinate, of the box around all. */
static uint32_t *sort_points(const karst_position *at, size_t num)
{
    place_in_order *places = malloc((num + 1) * sizeof *places);
    uint32_t *order = malloc((num + 1) * sizeof *order);
    int64_t least[3] = {INT64_MAX, INT64_MAX, INT64_MAX}, most[3] = {INT64_MIN, INT64_MIN, INT64_MIN};
    int shift = 0;
    if (!places || !order) {
        free(places);
        free(order);
        return NULL;
    }
    for (size_t i = 0; i < num; i++)
        for (int axis = 0; axis < 3; axis++) {
            least[axis] = at[i].voxel[axis] < least[axis] ? at[i].voxel[axis] : least[axis];
            most[axis] = at[i].voxel[axis] > most[axis] ? at[i].voxel[axis] : most[axis];
        }
    for (int axis = 0; axis < 3 && num; axis++)
        while (((uint64_t)most[axis] - (uint64_t)least[axis]) >> shift >= 1u << 21)
            shift++;
    for (size_t i = 0; i < num; i++) {
        places[i] = (place_in_order){.point = (uint32_t)i};
        for (int axis = 0; axis < 3; axis++) {
            const uint64_t way = ((uint64_t)at[i].voxel[axis] - (uint64_t)least[axis]) >> shift;
            for (int bit = 0; bit < 21; bit++)
                places[i].key |= (way >> bit & 1) << (3 * bit + axis);
        }
    }
    qsort(places, num, sizeof *places, compare_places);
    for (size_t i = 0; i < num; i++)
        order[i] = places[i].point;
    free(places);
    return order;
}

bool karst_query_nearest(const karst_world *world, const karst_query_config *config, const karst_position *at,
                         size_t num, double reach_m, karst_query_near *found, karst_error *error)
{
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    atomic_bool is_out_of_memory = false;
    near_task task = {.at = at,
                      .within_m = config->within_m != 0 ? config->within_m : ldexp(1, voxel_log2_m - 7),
                      .footprint_m = config->footprint_m,
                      .reach_m = reach_m,
                      .voxel_log2_m = voxel_log2_m,
                      .found = found,
                      .is_out_of_memory = &is_out_of_memory};
    if (!(config->footprint_m >= 0) || !isfinite(config->footprint_m))
        return karst_fail(error, KARST_USAGE, "a footprint of %g m: it must not be below 0", config->footprint_m);
    if (!(task.within_m >= ldexp(1, voxel_log2_m - 24)) || !isfinite(task.within_m))
        return karst_fail(error, KARST_USAGE, "surfaces within %g m: at least 2^-24 of the world's voxel of %g m",
                          task.within_m, ldexp(1, voxel_log2_m));
    if (!(reach_m > 0) || !(ldexp(reach_m, -voxel_log2_m) <= 0x1p60))
        return karst_fail(error, KARST_USAGE, "a reach of %g m: above 0, to 2^60 voxels", reach_m);
    if (num > UINT32_MAX)
        return karst_fail(error, KARST_USAGE, "%zu points: at most 2^32 at a time", num);
    while (task.root_level < 60 && ldexp(1, task.root_level + voxel_log2_m) < reach_m)
        task.root_level++;
    uint32_t *order = sort_points(at, num);
    if (!order)
        return karst_fail(error, KARST_FAILED, "out of memory");
    struct thread_tree trees[MAX_THREADS] = {{.tree = NULL}};
    task.order = order;
    task.trees = trees;
    const bool done = karst_crew_run(world, config, num, find_some, &task, error);
    for (int i = 0; i < atomic_load(&task.num_trees); i++)
        karst_near_tree_destroy(trees[i].tree);
    free(order);
    return done && (!atomic_load(&is_out_of_memory) || karst_fail(error, KARST_FAILED, "out of memory"));
}
