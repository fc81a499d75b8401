/* The coarser levels of a model, bottom-up: each averages the one before, in cells twice as wide. In Morton order a
 * cell's points follow one another, so this is one pass over each level. Points of a cell that face apart are two
 * sides of something thin, and are averaged apart. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define BLOCK 8192u
#define FEW_POINTS 200u

/* Points that are averaged. */
typedef struct {
    double at[3], radius;
    double normal[3], rgb[3];
    uint32_t num;
} group;

typedef struct {
    points_import *import;
    karst_error *error;
    int fd;    /* of the model */
    int shift; /* a cell is 2^this units wide */
    group sides[2];
    int32_t cell[3];
    bool has_cell;
    karst_point made[BLOCK];
    uint32_t num_made;
    karst_points_level *level; /* what is written */
} averaging;

static void add(group *g, const karst_point *p)
{
    for (int a = 0; a < 3; a++) {
        g->at[a] += p->at[a];
        g->normal[a] += p->normal[a];
        g->rgb[a] += p->rgb[a];
    }
    g->radius += (double)p->radius;
    g->num++;
}

static karst_point average_of(const group *g, double least_radius)
{
    karst_point p = {.radius = (float)fmax(g->radius / g->num, least_radius)};
    double length = sqrt(g->normal[0] * g->normal[0] + g->normal[1] * g->normal[1] + g->normal[2] * g->normal[2]);
    for (int a = 0; a < 3; a++) {
        p.at[a] = (int32_t)rint(g->at[a] / g->num);
        p.normal[a] = (int16_t)rint(length > 0 ? g->normal[a] / length * 32767 : 0);
        p.rgb[a] = (uint8_t)(g->rgb[a] / g->num + 0.5);
    }
    return p;
}

static bool flush(averaging *v)
{
    size_t num_bytes = v->num_made * sizeof(karst_point);
    if (!karst_points_write(v->import, v->fd, v->made, num_bytes,
                            v->level->offset + v->level->num * sizeof(karst_point), v->error))
        return false;
    v->level->sum = karst_points_sum(v->level->sum, v->made, num_bytes);
    v->level->num += v->num_made;
    v->num_made = 0;
    return true;
}

static bool end_cell(averaging *v)
{
    for (int side = 0; side < 2; side++) {
        if (v->sides[side].num == 0)
            continue;
        if (v->num_made == BLOCK && !flush(v))
            return false;
        /* The support is twice the radius: three cells. */
        v->made[v->num_made++] = average_of(&v->sides[side], 1.5 * ldexp(1, v->shift));
    }
    memset(v->sides, 0, sizeof v->sides);
    return true;
}

static bool take(averaging *v, const karst_point *p)
{
    int32_t cell[3];
    for (int a = 0; a < 3; a++)
        cell[a] = p->at[a] >> v->shift;
    if ((!v->has_cell || memcmp(cell, v->cell, sizeof cell) != 0) && !end_cell(v))
        return false;
    v->has_cell = true;
    memcpy(v->cell, cell, sizeof cell);
    double agrees = 0;
    for (int a = 0; a < 3; a++)
        agrees += v->sides[0].normal[a] * p->normal[a];
    add(&v->sides[v->sides[0].num && agrees < 0], p);
    return true;
}

static bool add_level(averaging *v, const karst_points_level *from, double share)
{
    karst_point *block = malloc(BLOCK * sizeof *block);
    bool done = block || karst_fail(v->error, KARST_FAILED, "out of memory");
    v->has_cell = false;
    for (uint64_t at = 0; done && at < from->num; at += BLOCK) {
        size_t num = from->num - at < BLOCK ? (size_t)(from->num - at) : BLOCK;
        done = karst_points_go_on(v->import, "levels", share, v->error) &&
               karst_points_read(v->import, v->fd, block, num * sizeof *block, from->offset + at * sizeof *block,
                                 v->error);
        for (size_t i = 0; done && i < num; i++)
            done = take(v, &block[i]);
    }
    free(block);
    return done && end_cell(v) && flush(v);
}

bool karst_points_add_levels(points_import *import, karst_error *error)
{
    karst_points_head *head = import->head;
    averaging *v = calloc(1, sizeof *v);
    bool done = v || karst_fail(error, KARST_FAILED, "out of memory");
    int shift = 0;
    while (ldexp(1, shift) < 1.3 * (double)head->levels[0].spacing)
        shift++;
    shift += (int)head->num_levels - 1; /* some are there where an import goes on */
    if (done) {
        v->import = import;
        v->error = error;
        v->fd = karst_points_file(import, POINTS_MODEL, error);
        done = v->fd >= 0;
    }
    for (; done && shift < 27 && head->num_levels < KARST_POINTS_MAX_LEVELS; shift++) {
        const karst_points_level *from = &head->levels[head->num_levels - 1];
        if (from->num <= FEW_POINTS)
            break;
        v->shift = shift;
        v->level = &head->levels[head->num_levels];
        *v->level = (karst_points_level){.offset = karst_points_level_end(from), .spacing = (uint64_t)1 << shift};
        done = add_level(v, from, 1 - (double)from->num / (double)head->levels[0].num) &&
               karst_points_add_tree(import, head->num_levels, error);
        head->num_levels += done;
        done = done && karst_points_checkpoint(import, error);
    }
    free(v);
    return done;
}
