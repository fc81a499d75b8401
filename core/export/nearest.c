/* The surface that is nearest to points: cubes around a point, the nearest first, until one is proved to be on the
 * other side or is small; then down the slope to where the surface is nearest. */
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/export/crew.h"
#include "karst/query.h"

enum { MOST_CUBES = 50000, POLISHINGS = 16, MOST_HALVED = 7, HALVINGS = 40, SCOUTS = 14, WAYS = 26 };
/* A cube is small if its diagonal is within what was asked for, or this share of how far it is. */
#define SMALL_SHARE (1.0 / 16)
/* What is proved may be so much less than what was found. */
#define TOLERANCE (1.0 / 16)

/* Metres from the point. */
typedef struct {
    double centre[3], half, nearest;
} cube;

typedef struct {
    cube *heap; /* nearest first */
    size_t num, max;
    bool is_out_of_memory;
} cubes;

typedef struct {
    const karst_position *at;
    double within_m, footprint_m, reach_m;
    int voxel_log2_m;
    karst_query_near *found;
    atomic_bool *is_out_of_memory;
} near_task;

/* One point's. */
typedef struct {
    const near_task *task;
    karst_sampler *sampler;
    karst_position from;
    bool is_solid;
    double best[3], best_m; /* the nearest place of the other side so far */
    double least_dropped_m; /* of cubes that were not looked at closer */
} search;

static double length_of(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* ---- cubes ---- */

static void push(cubes *c, const cube *item)
{
    if (c->num == c->max) {
        const size_t more = c->max ? 2 * c->max : 256;
        cube *larger = realloc(c->heap, more * sizeof *larger);
        if (!larger) {
            c->is_out_of_memory = true;
            return;
        }
        c->heap = larger;
        c->max = more;
    }
    size_t i = c->num++;
    for (; i > 0 && item->nearest < c->heap[(i - 1) / 2].nearest; i = (i - 1) / 2)
        c->heap[i] = c->heap[(i - 1) / 2];
    c->heap[i] = *item;
}

static cube pop(cubes *c)
{
    const cube top = c->heap[0], last = c->heap[--c->num];
    size_t i = 0;
    for (size_t child; (child = 2 * i + 1) < c->num; i = child) {
        child += child + 1 < c->num && c->heap[child + 1].nearest < c->heap[child].nearest;
        if (last.nearest <= c->heap[child].nearest)
            break;
        c->heap[i] = c->heap[child];
    }
    c->heap[i] = last;
    return top;
}

/* Of a cube's places that which is nearest to the point. */
static void nearest_place(const double centre[3], double half, double place[3])
{
    for (int axis = 0; axis < 3; axis++)
        place[axis] = fmin(fmax(0, centre[axis] - half), centre[axis] + half);
}

static cube make_cube(const double centre[3], double half)
{
    cube c = {.centre = {centre[0], centre[1], centre[2]}, .half = half};
    double place[3];
    nearest_place(centre, half, place);
    c.nearest = length_of(place);
    return c;
}

/* ---- one point ---- */

static karst_position position_at(const search *s, const double place[3])
{
    return karst_position_add_m(s->from, place, s->task->voxel_log2_m);
}

static bool is_solid_at(search *s, const double place[3])
{
    const karst_position at = position_at(s, place);
    float density;
    karst_sampler_densities(s->sampler, &at, 1, s->task->footprint_m, &density);
    return density > 0;
}

static void polish(search *s, const double place[3]);

/* A place of the other side. */
static void consider(search *s, const double place[3])
{
    if (length_of(place) < s->best_m)
        polish(s, place);
}

static void keep(search *s, const double place[3])
{
    const double distance = length_of(place);
    if (distance >= s->best_m)
        return;
    s->best_m = distance;
    memcpy(s->best, place, sizeof s->best);
}

/* 1: proved to be of the point's side, -1: of the other, 0: neither. */
static int bound(search *s, const cube *c)
{
    const double half = c->half * (1 + 0x1p-40) + ldexp(1, s->task->voxel_log2_m - 30);
    const double half_m[3] = {half, half, half};
    const karst_position centre = position_at(s, c->centre);
    double range[2];
    if (!karst_sampler_bounds(s->sampler, &centre, half_m, s->task->footprint_m, range))
        return 0;
    const int side = range[0] > 0 ? 1 : range[1] <= 0 ? -1 : 0;
    return s->is_solid ? side : -side;
}

/* Looks at the middle, the nearest place and the corners. */
static bool shows_other_side(search *s, const cube *c)
{
    bool any = false;
    for (int i = 0; i < 10; i++) {
        double place[3];
        for (int axis = 0; axis < 3; axis++)
            place[axis] = c->centre[axis] + (i < 8 ? (i >> axis & 1 ? c->half : -c->half) : 0);
        if (i == 9)
            nearest_place(c->centre, c->half, place);
        if (is_solid_at(s, place) == s->is_solid)
            continue;
        consider(s, place);
        any = true;
    }
    return any;
}

static void look(search *s, cubes *open, const cube *c)
{
    const double small = fmax(s->task->within_m, SMALL_SHARE * c->nearest);
    double place[3];
    const int side = bound(s, c);
    if (side > 0)
        return;
    if (side < 0) {
        nearest_place(c->centre, c->half, place);
        consider(s, place);
        return;
    }
    if (2 * sqrt(3) * c->half <= small) {
        if (!shows_other_side(s, c))
            s->least_dropped_m = fmin(s->least_dropped_m, c->nearest);
        return;
    }
    if (is_solid_at(s, c->centre) != s->is_solid)
        consider(s, c->centre);
    for (int i = 0; i < 8; i++) {
        for (int axis = 0; axis < 3; axis++)
            place[axis] = c->centre[axis] + (i >> axis & 1 ? c->half / 2 : -c->half / 2);
        const cube part = make_cube(place, c->half / 2);
        if (part.nearest * (1 + TOLERANCE) < s->best_m && part.nearest < s->task->reach_m)
            push(open, &part);
        else
            s->least_dropped_m = fmin(s->least_dropped_m, part.nearest);
    }
}

/* Where the way from the point to a place of the other side meets the surface. */
static void cross(search *s, double place[3])
{
    double low = 0, high = 1, middle[3];
    for (int i = 0; i < HALVINGS && (high - low) * length_of(place) > s->task->within_m / 16; i++) {
        const double t = (low + high) / 2;
        for (int axis = 0; axis < 3; axis++)
            middle[axis] = t * place[axis];
        if (is_solid_at(s, middle) == s->is_solid)
            low = t;
        else
            high = t;
    }
    for (int axis = 0; axis < 3; axis++)
        place[axis] *= high;
}

static bool gradient_at(search *s, const double place[3], double unit[3])
{
    const karst_position at = position_at(s, place);
    karst_sample gradient[3];
    if (!karst_sampler_gradient(s->sampler, &at, s->task->footprint_m, gradient, NULL))
        return false;
    for (int axis = 0; axis < 3; axis++)
        unit[axis] = (double)gradient[axis].device;
    const double length = length_of(unit);
    for (int axis = 0; axis < 3; axis++)
        unit[axis] /= length;
    return length > 0 && isfinite(length);
}

/* From the best place along the surface, towards where the point is nearest to its tangent; false: that leads nowhere.
 */
static bool slide(search *s)
{
    double normal[3], along = 0, place[3];
    const double before = s->best_m;
    if (!gradient_at(s, s->best, normal))
        return false;
    for (int axis = 0; axis < 3; axis++)
        along += s->best[axis] * normal[axis];
    for (int halving = 0; halving < MOST_HALVED; halving++) {
        for (int axis = 0; axis < 3; axis++)
            place[axis] = s->best[axis] - ldexp(s->best[axis] - along * normal[axis], -halving);
        const double scale = before / length_of(place);
        for (int axis = 0; axis < 3; axis++)
            place[axis] *= scale;
        if (!isfinite(scale) || is_solid_at(s, place) == s->is_solid)
            continue;
        cross(s, place);
        keep(s, place);
        return before - s->best_m > s->task->within_m / 16;
    }
    return false;
}

/* From a place of the other side to the surface, and down to where it is nearest. */
static void polish(search *s, const double place[3])
{
    double next[3];
    memcpy(next, place, sizeof next);
    cross(s, next);
    keep(s, next);
    for (int i = 0; i < POLISHINGS && slide(s); i++)
        ;
}

/* Along straight ways, ever farther: so that something is known before cubes are cut. */
static void scout(search *s)
{
    for (int step = SCOUTS - 1; step >= 0; step--) {
        const double length = ldexp(s->task->reach_m, -step);
        double places[WAYS][3];
        karst_position at[WAYS];
        float densities[WAYS];
        for (int i = 0; i < WAYS; i++) {
            const int k = i < WAYS / 2 ? i : i + 1; /* all but the middle of 3 x 3 x 3 */
            const double way[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1}, scale = length / length_of(way);
            for (int axis = 0; axis < 3; axis++)
                places[i][axis] = way[axis] * scale;
            at[i] = position_at(s, places[i]);
        }
        karst_sampler_densities(s->sampler, at, WAYS, s->task->footprint_m, densities);
        for (int i = 0; i < WAYS; i++)
            if ((densities[i] > 0) != s->is_solid)
                consider(s, places[i]);
        if (isfinite(s->best_m))
            return;
    }
}

static void find_one(const near_task *task, karst_sampler *sampler, size_t index)
{
    search s = {
        .task = task, .sampler = sampler, .from = task->at[index], .best_m = INFINITY, .least_dropped_m = INFINITY};
    karst_query_near *found = &task->found[index];
    cubes open = {.num = 0};
    s.is_solid = is_solid_at(&s, (const double[3]){0, 0, 0});
    scout(&s);
    const cube all = make_cube((const double[3]){0, 0, 0}, task->reach_m);
    push(&open, &all);
    double proved_m = 0;
    size_t num_looked = 0;
    while (open.num && !open.is_out_of_memory) {
        proved_m = open.heap[0].nearest;
        if (proved_m * (1 + TOLERANCE) >= s.best_m || proved_m >= task->reach_m || ++num_looked > MOST_CUBES)
            break;
        const cube c = pop(&open);
        look(&s, &open, &c);
        proved_m = task->reach_m;
    }
    if (open.is_out_of_memory)
        atomic_store(task->is_out_of_memory, true);
    free(open.heap);
    *found = (karst_query_near){.at = position_at(&s, s.best),
                                .distance_m = s.best_m <= task->reach_m ? s.best_m : INFINITY,
                                .at_least_m = fmin(fmin(proved_m, s.least_dropped_m), s.best_m),
                                .is_inside = s.is_solid};
    double normal[3];
    for (int axis = 0; axis < 3 && isfinite(found->distance_m) && gradient_at(&s, s.best, normal); axis++)
        found->normal[axis] = -normal[axis];
}

static void find_some(void *user, karst_sampler *sampler, size_t first, size_t end)
{
    for (size_t i = first; i < end; i++)
        find_one(user, sampler, i);
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
    return karst_crew_run(world, config, num, find_some, &task, error) &&
           (!atomic_load(&is_out_of_memory) || karst_fail(error, KARST_FAILED, "out of memory"));
}
