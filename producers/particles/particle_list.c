/* The particles of a scene: see producers/particles/particle_list.h. */
#include "producers/particles/particle_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "producers/particles/particle_internal.h"
#include "producers/particles/particles.clh"

/* ---- where they are ---- */

static bool check_emitter(const karst_emitter *e, karst_error *error)
{
    bool is_finite = isfinite(e->spread_m_s) && isfinite(e->stray_m) && isfinite(e->count);
    for (int a = 0; a < 3; a++)
        is_finite = is_finite && isfinite(e->size_m[a]) && e->size_m[a] >= 0 && isfinite(e->velocity_m_s[a]);
    if (!is_finite)
        return karst_fail(error, KARST_USAGE,
                          "an emitter's sizes, speeds and numbers are finite, and sizes not below 0");
    if (!(e->count >= 0))
        return karst_fail(error, KARST_USAGE, "an emitter of %g particles: it gives off 0 or more", e->count);
    if (!(e->life_s > 0 && e->life_s <= KARST_MOST_TIME_S))
        return karst_fail(error, KARST_USAGE,
                          "a life of %g s: an emitter's particles live longer than 0 s, and at most %g", e->life_s,
                          KARST_MOST_TIME_S);
    if (!(e->radius_m[0] >= 0 && e->radius_m[1] >= 0 && e->radius_m[0] <= 1e15 && e->radius_m[1] <= 1e15))
        return karst_fail(error, KARST_USAGE, "a radius from %g to %g m: it is 0 or more, and finite", e->radius_m[0],
                          e->radius_m[1]);
    if (!(e->fade >= 0 && e->fade <= 0.5))
        return karst_fail(error, KARST_USAGE, "a fade of %g: it is a share of a life, 0 to 0.5", e->fade);
    return (e->extinction >= 0 && e->extinction <= 1e15) ||
           karst_fail(error, KARST_USAGE, "an extinction of %g per metre: it is 0 or more, and finite", e->extinction);
}

static bool check_time(double time_s, karst_error *error)
{
    return (time_s >= -KARST_MOST_TIME_S && time_s <= KARST_MOST_TIME_S) ||
           karst_fail(error, KARST_USAGE, "a time of %g s: times go from -1e9 to 1e9 s", time_s);
}

static uint64_t num_of(const karst_particle_list *list, size_t group)
{
    const double count = list->groups[group].emitter.count;
    return list->groups[group].path ? list->num_rows[group] : count < 1e12 ? (uint64_t)count : (uint64_t)1e12;
}

static void put_group(karst_particle_list *list, size_t number, karst_ball *balls)
{
    const karst_particle_group *group = &list->groups[number];
    const karst_position origin = {.voxel = {list->origin[0], list->origin[1], list->origin[2]}};
    const uint32_t num = (uint32_t)num_of(list, number);
    double at_m[3];
    karst_position_difference_m(origin, group->at, list->voxel_log2_m, at_m);
    for (uint32_t i = 0; i < num; i++) {
        karst_ball *ball = &balls[i];
        if (group->path) {
            const karst_particle_row *row = &list->rows[number][i];
            *ball = (karst_ball){.radius_m = row->radius_m, .extinction = row->extinction};
            for (int a = 0; a < 3; a++)
                ball->at_m[a] = row->at_m[a] + row->velocity_m_s[a] * list->time_s;
        } else {
            karst_emitter_particle(&group->emitter, i, list->time_s, ball);
        }
        ball->is_sum = group->is_sum;
        for (int a = 0; a < 3; a++)
            ball->at_m[a] += at_m[a];
    }
}

/* All groups at the list's time, and the block. */
static bool put_all(karst_particle_list *list, karst_error *error)
{
    uint64_t num = 0;
    for (size_t g = 0; g < list->num_groups; g++)
        num += num_of(list, g);
    if (num > KARST_MAX_PARTICLES)
        return karst_fail(error, KARST_USAGE, "%llu particles: %u are the most; give fewer of them a larger radius",
                          (unsigned long long)num, KARST_MAX_PARTICLES);
    list->num = (uint32_t)num;
    list->balls = calloc(num + 1, sizeof *list->balls);
    if (!list->balls)
        return karst_fail(error, KARST_FAILED, "out of memory for %llu particles", (unsigned long long)num);
    karst_ball *next = list->balls;
    for (size_t g = 0; g < list->num_groups; g++) {
        put_group(list, g, next);
        next += num_of(list, g);
    }
    return karst_particle_block_make(list, error);
}

bool karst_particle_list_init(karst_particle_list *list, const karst_particle_group *groups, size_t num,
                              int voxel_log2_m, double time_s, karst_error *error)
{
    *list = (karst_particle_list){.voxel_log2_m = voxel_log2_m, .time_s = time_s, .num_groups = num};
    list->groups = calloc(num + 1, sizeof *list->groups);
    list->rows = calloc(num + 1, sizeof *list->rows);
    list->num_rows = calloc(num + 1, sizeof *list->num_rows);
    bool done = check_time(time_s, error);
    if (done && (!list->groups || !list->rows || !list->num_rows))
        done = karst_fail(error, KARST_FAILED, "out of memory");
    if (done && num > 0)
        memcpy(list->origin, groups[0].at.voxel, sizeof list->origin);
    for (size_t g = 0; done && g < num; g++) {
        list->groups[g] = groups[g];
        if (groups[g].path) {
            list->rows[g] = karst_particle_rows_load(groups[g].path, &list->num_rows[g], error);
            done = list->rows[g] != NULL;
            list->groups[g].path = "file"; /* the caller's goes */
        } else {
            done = check_emitter(&groups[g].emitter, error);
        }
    }
    if (done && put_all(list, error))
        return true;
    karst_particle_list_finish(list);
    return false;
}

void karst_particle_list_finish(karst_particle_list *list)
{
    for (size_t g = 0; list->rows && g < list->num_groups; g++)
        free(list->rows[g]);
    free(list->rows);
    free(list->num_rows);
    free(list->groups);
    free(list->balls);
    free(list->data);
    *list = (karst_particle_list){0};
}

/* ---- what changed ---- */

typedef struct {
    karst_particle particle;
    const int64_t *origin;
} changed;

static int compare_particles(const void *a, const void *b)
{
    const karst_particle *p = a, *q = b;
    for (int i = 0; i < 3; i++)
        if (p->at[i] != q->at[i])
            return p->at[i] < q->at[i] ? -1 : 1;
    return memcmp(p, q, sizeof *p);
}

static uint32_t sorted_copy(const karst_particle_list *list, karst_particle *to)
{
    particles_data data = (particles_data)list->data;
    const uint32_t num = PARTICLES_HEAD(data)->num;
    memcpy(to, PARTICLES_ALL(data), num * sizeof *to);
    qsort(to, num, sizeof *to, compare_particles);
    return num;
}

/* Those that one list has and the other has not, its shares included; how many. */
static uint32_t find_changed(const karst_particle_list *a, const karst_particle_list *b, bool all_are,
                             karst_particle *copies, changed *found)
{
    uint32_t i = 0, k = 0, count = 0;
    const uint32_t num_a = sorted_copy(a, copies);
    const karst_particle *p = copies, *q = copies + num_a;
    const uint32_t num_b = sorted_copy(b, copies + num_a);
    while (i < num_a || k < num_b) {
        const int order = i == num_a ? 1 : k == num_b ? -1 : compare_particles(&p[i], &q[k]);
        if (order == 0 && !all_are)
            i++, k++;
        else if (order <= 0)
            found[count++] = (changed){p[i++], a->origin};
        else
            found[count++] = (changed){q[k++], b->origin};
    }
    return count;
}

static void widen(karst_drop_box *box, const int64_t origin[3], const karst_particle *particle, bool is_first)
{
    for (int a = 0; a < 3; a++) {
        const double at = (double)particle->at[a], radius = (double)particle->radius;
        const int64_t min = origin[a] + (int64_t)floor(at - radius) - 1,
                      max = origin[a] + (int64_t)ceil(at + radius) + 1;
        box->min[a] = is_first || min < box->min[a] ? min : box->min[a];
        box->max[a] = is_first || max > box->max[a] ? max : box->max[a];
    }
}

/* What verdicts look at around a node: 2 * PARTICLES_REACH, and what rounding adds. */
#define MARGIN_VOXELS 4

bool karst_particle_list_differ(const karst_particle_list *a, const karst_particle_list *b, karst_drop_box **boxes,
                                size_t *num, karst_error *error)
{
    const uint32_t most = PARTICLES_HEAD(a->data)->num + PARTICLES_HEAD(b->data)->num;
    const bool is_moved = memcmp(a->origin, b->origin, sizeof a->origin) != 0;
    karst_particle *copies = malloc((most + 1) * sizeof *copies);
    changed *all = malloc((most + 1) * sizeof *all);
    uint32_t count = 0;
    *boxes = calloc(KARST_PARTICLES_MOST_BOXES, sizeof **boxes);
    *num = 0;
    const bool done =
        (copies && all && *boxes) || karst_fail(error, KARST_FAILED, "out of memory for %u particles", most);
    if (done)
        count = find_changed(a, b, is_moved, copies, all);
    /* Neighbours in the order of x share a box. */
    const uint32_t each = (count + KARST_PARTICLES_MOST_BOXES - 1) / KARST_PARTICLES_MOST_BOXES;
    for (uint32_t n = 0; n < count; n++) {
        karst_drop_box *box = &(*boxes)[n / each];
        box->margin_voxels = MARGIN_VOXELS;
        widen(box, all[n].origin, &all[n].particle, n % each == 0);
        *num = n / each + 1;
    }
    free(copies);
    free(all);
    if (*num == 0) {
        free(*boxes);
        *boxes = NULL;
    }
    return done;
}

bool karst_particle_list_set_time(karst_particle_list *list, double time_s, karst_drop_box **boxes, size_t *num_boxes,
                                  karst_error *error)
{
    karst_particle_list moved = *list;
    *boxes = NULL;
    *num_boxes = 0;
    if (!check_time(time_s, error))
        return false;
    moved.time_s = time_s;
    moved.balls = NULL;
    moved.data = NULL;
    const bool done = put_all(&moved, error) && karst_particle_list_differ(list, &moved, boxes, num_boxes, error);
    free(done ? list->balls : moved.balls);
    free(done ? list->data : moved.data);
    if (done)
        *list = moved;
    return done;
}

/* ---- looking ---- */

float karst_particle_list_extinction(const karst_particle_list *list, const int64_t voxel[3], int level)
{
    particles_data data = (particles_data)list->data;
    particles_box box = {.reach = PARTICLES_REACH * particles_voxel(level)};
    vfloat p[3];
    for (int a = 0; a < 3; a++)
        p[a] = box.min[a] = box.max[a] = (float)(int64_t)((uint64_t)voxel[a] - (uint64_t)list->origin[a]);
    return particles_extinction(data, p, &box, level);
}

bool karst_particle_list_check(const karst_particle_list *list, karst_error *error)
{
    particles_data data = (particles_data)list->data;
    const karst_particles_head *head = PARTICLES_HEAD(data);
    const karst_particle *all = PARTICLES_ALL(data);
    for (uint32_t i = 0; i < head->num; i++) {
        if (!(all[i].share >= 0 && all[i].share < INFINITY))
            return karst_fail(error, KARST_FAILED, "particle %u has a share of %g", i, (double)all[i].share);
        for (uint32_t level = 0, at = i / PARTICLES_FAN; level < head->num_levels; level++, at /= PARTICLES_FAN) {
            const karst_particle_node *node = (const karst_particle_node *)(data + head->nodes[level]) + at;
            bool holds = at < head->counts[level];
            for (int a = 0; a < 3; a++)
                holds = holds && node->min[a] <= all[i].at[a] - all[i].radius &&
                        node->max[a] >= all[i].at[a] + all[i].radius;
            if (!holds)
                return karst_fail(error, KARST_FAILED, "node %u of tree level %u does not hold particle %u", at, level,
                                  i);
        }
    }
    return head->num == 0 || head->counts[head->num_levels - 1] == 1 ||
           karst_fail(error, KARST_FAILED, "the tree of %u particles has no root", head->num);
}
