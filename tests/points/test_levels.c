/* Coarser levels and trees are those that averaging cell after cell gives, in the order of points: also of cells that
 * go over the ends of blocks, or over many of them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/points/import_internal.h"
#include "tests/noise/random.h"
#include "tests/support/ok.h"

#define NUM_WIDE 20000    /* points on a plane and another one close below it, which faces the other way */
#define NUM_TOGETHER 9500 /* in one cell of the first coarser level: more than two blocks */
#define NUM (NUM_WIDE + NUM_TOGETHER + 1)

static char folder[] = "/tmp/karst-levels-XXXXXX";

/* The plane's two sides are nearer than a cell, so that cells have two sides. */
static bool write_cloud(const char *path)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return false;
    random_state = 11;
    for (int i = 0; i < NUM_WIDE; i++) {
        const double up = i % 2 ? 1 : -1;
        fprintf(file, "%.6f %.6f %.6f 0 %g 0\n", 100 * random_unit(), 0.2 * up, 100 * random_unit(), up);
    }
    for (int i = 0; i < NUM_TOGETHER; i++)
        fprintf(file, "%.6f %.6f %.6f %.3f 1 0\n", 40.2 + 0.01 * random_unit(), 0.2 + 0.01 * random_unit(),
                60.2 + 0.01 * random_unit(), random_unit());
    fprintf(file, "50 -30 50 0 1 0\n"); /* so that no cells end between the sides */
    return fclose(file) == 0;
}

typedef struct {
    karst_point *points;
    points_extent *extents;
    uint64_t num;
} level;

static void cell_of(const karst_point *p, int shift, int32_t cell[3])
{
    for (int a = 0; a < 3; a++)
        cell[a] = p->at[a] >> shift;
}

/* One side of a cell: points [begin, end), of which `is_of` says whether they are of it. */
static void average_side(const level *from, uint64_t begin, uint64_t end, const bool *is_of, int shift, level *to)
{
    double at[3] = {0}, normal[3] = {0}, rgb[3] = {0}, radius = 0, num = 0, cover, spread = 0;
    for (uint64_t i = begin; i < end; i++) {
        const karst_point *p = &from->points[i];
        if (!is_of[i])
            continue;
        for (int a = 0; a < 3; a++) {
            at[a] += p->at[a];
            normal[a] += p->normal[a];
            rgb[a] += p->rgb[a];
        }
        radius += (double)p->radius;
        num++;
    }
    if (num == 0)
        return;
    const double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    karst_point made = {.radius = (float)fmax(radius / num, 1.5 * ldexp(1, shift))};
    for (int a = 0; a < 3; a++) {
        made.at[a] = (int32_t)rint(at[a] / num);
        made.normal[a] = (int16_t)rint(length > 0 ? normal[a] / length * 32767 : 0);
        made.rgb[a] = (uint8_t)(rgb[a] / num + 0.5);
    }
    cover = karst_point_reach(made.radius);
    for (uint64_t i = begin; i < end; i++) { /* of both sides */
        double square = 0;
        for (int a = 0; a < 3; a++)
            square += ((double)from->points[i].at[a] - made.at[a]) * ((double)from->points[i].at[a] - made.at[a]);
        cover = fmax(cover, ceil(sqrt(square)) + from->extents[i].cover);
        spread = fmax(spread, ceil(sqrt(square)) + from->extents[i].spread);
    }
    to->points[to->num] = made;
    to->extents[to->num++] = (points_extent){(int32_t)cover, (int32_t)spread};
}

/* Returns how many points the largest cell has; adds to how many cells have two sides. */
static uint64_t average_all(const level *from, int shift, level *to, uint64_t *num_two_sided)
{
    bool *of[2] = {calloc(from->num, sizeof **of), calloc(from->num, sizeof **of)};
    uint64_t most = 0;
    to->num = 0;
    for (uint64_t begin = 0, end; begin < from->num; begin = end) {
        int32_t cell[3], next[3];
        double first[3] = {0};
        bool has_first = false;
        cell_of(&from->points[begin], shift, cell);
        for (end = begin; end < from->num; end++) {
            const karst_point *p = &from->points[end];
            double agrees = 0;
            cell_of(p, shift, next);
            if (memcmp(cell, next, sizeof cell) != 0)
                break;
            for (int a = 0; a < 3; a++)
                agrees += first[a] * p->normal[a];
            const int side = has_first && agrees < 0;
            for (int a = 0; a < 3 && side == 0; a++)
                first[a] += p->normal[a];
            has_first = true;
            of[side][end] = true;
        }
        most = end - begin > most ? end - begin : most;
        const uint64_t num_before = to->num;
        for (int side = 0; side < 2; side++)
            average_side(from, begin, end, of[side], shift, to);
        *num_two_sided += to->num - num_before == 2;
    }
    free(of[0]);
    free(of[1]);
    return most;
}

/* That leaves are of these points, and nodes of the nodes below. */
static void expect_tree(int fd, const karst_points_level *of, const level *made)
{
    uint32_t counts[KARST_POINTS_MAX_TREE];
    uint64_t from = karst_points_tree_offset(of), num_below = made->num;
    karst_point_node *below = malloc(made->num * sizeof *below), *nodes = malloc(made->num * sizeof *nodes);
    for (uint64_t i = 0; i < made->num; i++) {
        below[i] = (karst_point_node){.reach = karst_point_reach(made->points[i].radius),
                                      .cover = made->extents[i].cover,
                                      .spread = made->extents[i].spread};
        memcpy(below[i].min, made->points[i].at, sizeof below[i].min);
        memcpy(below[i].max, made->points[i].at, sizeof below[i].max);
    }
    const int num_levels = karst_points_tree((uint32_t)made->num, counts);
    for (int l = 0; l < num_levels; l++) {
        const size_t num_bytes = counts[l] * sizeof *nodes;
        assert_int_equal(pread(fd, nodes, num_bytes, (off_t)from), num_bytes);
        for (uint64_t i = 0; i < num_below; i++) {
            karst_point_node *into = &below[i / KARST_POINTS_FAN];
            const karst_point_node by = below[i];
            if (i % KARST_POINTS_FAN == 0) {
                *into = by;
                continue;
            }
            for (int a = 0; a < 3; a++) {
                into->min[a] = by.min[a] < into->min[a] ? by.min[a] : into->min[a];
                into->max[a] = by.max[a] > into->max[a] ? by.max[a] : into->max[a];
            }
            into->reach = by.reach > into->reach ? by.reach : into->reach;
            into->cover = by.cover > into->cover ? by.cover : into->cover;
            into->spread = by.spread > into->spread ? by.spread : into->spread;
        }
        assert_memory_equal(nodes, below, num_bytes);
        from += num_bytes;
        num_below = counts[l];
    }
    free(below);
    free(nodes);
}

static void levels_are_averages(void **state)
{
    (void)state;
    char input[80], output[80];
    snprintf(input, sizeof input, "%s/in.xyz", folder);
    snprintf(output, sizeof output, "%s/out.karstpoints", folder);
    assert_true(write_cloud(input));
    const karst_points_import_config config = {
        .input = input, .output = output, .axes = KARST_POINTS_AS_THEY_ARE, .keep_outliers = true, .num_threads = 3};
    karst_points_head head;
    assert_ok(karst_points_import(&config, NULL, &error));
    int fd = karst_points_open(output, &head, NULL);
    level finer = {0}, made = {0};
    const uint64_t num = head.levels[0].num;
    uint64_t num_two_sided = 0;
    finer = (level){calloc(num, sizeof *finer.points), calloc(num, sizeof *finer.extents), num};
    made = (level){calloc(num, sizeof *made.points), calloc(num, sizeof *made.extents), 0};
    assert_true(num == NUM && head.num_levels > 4);
    assert_int_equal(pread(fd, finer.points, num * sizeof *finer.points, (off_t)head.levels[0].offset),
                     num * sizeof *finer.points);
    for (uint64_t i = 0; i < num; i++)
        finer.extents[i].cover = karst_point_reach(finer.points[i].radius);
    expect_tree(fd, &head.levels[0], &finer);
    for (uint32_t l = 1; l < head.num_levels; l++) {
        const uint64_t most = average_all(&finer, ilogb((double)head.levels[l].spacing), &made, &num_two_sided);
        assert_true(l > 1 || most >= NUM_TOGETHER);
        karst_point *points = karst_points_load_level(fd, output, &head, l, NULL);
        assert_non_null(points);
        assert_int_equal(head.levels[l].num, made.num);
        assert_memory_equal(points, made.points, made.num * sizeof *points);
        free(points);
        expect_tree(fd, &head.levels[l], &made);
        const level swap = finer;
        finer = made;
        made = swap;
    }
    assert_true(num_two_sided > 1000);
    free(finer.points);
    free(finer.extents);
    free(made.points);
    free(made.extents);
    close(fd);
    unlink(input);
    unlink(output);
}

static int set_up(void **state)
{
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(levels_are_averages)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
