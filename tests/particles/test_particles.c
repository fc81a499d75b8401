/* Particles as a layer of the air: what they prove of a node holds, whichever rule is looked at; no brick loses any;
 * bits are the same on every shape; depth along rays is that of intervals; and strange input is refused. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

/* One rule broken at a time. */
enum { NONE, RADIUS, PARENT, SMALL, NUM_MUTANTS };
static int mutant = NONE;
#define PARTICLES_MUTANT(rule) (mutant == rule)

#include "producers/particles/particles.clh"
#include "producers/particles/particles.h"
#include "producers/steps/load_shared.h"
#include "tests/noise/random.h"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-3)
#define VOXEL_M 0x1p-3

static karst_particle_group emitter(double count)
{
    return (karst_particle_group){.emitter = {.shape = KARST_EMITTER_BALL,
                                              .size_m = {6, 4, 6},
                                              .velocity_m_s = {1, 2, 0},
                                              .spread_m_s = 0.7,
                                              .stray_m = 1,
                                              .count = count,
                                              .life_s = 4,
                                              .radius_m = {0.4, 1.1},
                                              .extinction = 0.6,
                                              .fade = 0.1,
                                              .seed = 5},
                                  .at = {.voxel = {70000, 31, -500}}};
}

static karst_particle_list list_of(const karst_particle_group *groups, size_t num, double time_s)
{
    karst_particle_list list;
    assert_ok(karst_particle_list_init(&list, groups, num, VOXEL_LOG2_M, time_s, &error));
    assert_ok(karst_particle_list_check(&list, &error));
    return list;
}

/* ---- depth along rays ---- */

typedef struct {
    double t;
    int step;
} crossing;

static int compare_crossings(const void *a, const void *b)
{
    const crossing *p = a, *q = b;
    return (p->t > q->t) - (p->t < q->t);
}

/* The counter of one extinction: plus one where a ball begins, minus one where it ends; where it is above 0 there is
 * smoke. */
static double counted_length(const karst_particle_list *list, const double from[3], const double d[3], int *most_open)
{
    crossing *all = malloc(2 * list->num * sizeof *all);
    size_t num = 0;
    double length = 0;
    int open = 0;
    for (uint32_t i = 0; i < list->num; i++) {
        const double *c = list->balls[i].at_m, r = list->balls[i].radius_m;
        double b = 0, cc = -r * r;
        for (int a = 0; a < 3; a++) {
            b += (from[a] - c[a]) * d[a];
            cc += (from[a] - c[a]) * (from[a] - c[a]);
        }
        if (b * b - cc <= 0)
            continue;
        const double begin = -b - sqrt(b * b - cc), end = -b + sqrt(b * b - cc);
        if (end <= 0)
            continue;
        all[num++] = (crossing){fmax(begin, 0), 1};
        all[num++] = (crossing){end, -1};
    }
    qsort(all, num, sizeof *all, compare_crossings);
    for (size_t i = 0; i < num; i++) {
        if (open > 0)
            length += all[i].t - all[i - 1].t;
        open += all[i].step;
        *most_open = open > *most_open ? open : *most_open;
    }
    free(all);
    return length;
}

static void random_ray(const karst_particle_list *list, double from[3], double d[3])
{
    double length = 0;
    for (int a = 0; a < 3; a++) {
        from[a] = (random_unit() - 0.5) * 30;
        d[a] = list->balls[random_below(list->num)].at_m[a] + random_unit() - from[a];
        length += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++)
        d[a] /= sqrt(length);
}

static karst_position place_of(const karst_particle_list *list, const double m[3])
{
    const karst_position origin = {.voxel = {list->origin[0], list->origin[1], list->origin[2]}};
    return karst_position_add_m(origin, m, VOXEL_LOG2_M);
}

static void unions_are_intervals(void **state)
{
    (void)state;
    karst_particle_group group = emitter(1500);
    group.emitter.fade = 0;
    karst_particle_list list = list_of(&group, 1, 17.3);
    const int num_rays = getenv("KARST_TEST_FULL") ? 100000 : 2000;
    double worst = 0, sum = 0;
    int most_open = 0;
    random_state = 3;
    for (int i = 0; i < num_rays; i++) {
        double from[3], d[3], depth, begin[3];
        random_ray(&list, from, d);
        const karst_position at = place_of(&list, from);
        karst_position_difference_m(place_of(&list, (double[]){0, 0, 0}), at, VOXEL_LOG2_M, begin);
        assert_ok(karst_particle_list_depth(&list, &at, d, 1e9, &depth, &error));
        const double counted = 0.6 * counted_length(&list, begin, d, &most_open);
        worst = fmax(worst, fabs(depth - counted) / fmax(counted, 0.01));
        sum += counted;
    }
    print_message("# %d rays, mean depth %.3f, up to %d balls at once: relative error at most %.1e\n", num_rays,
                  sum / num_rays, most_open, worst);
    assert_true(worst < 1e-9 && most_open > 20 && sum > num_rays);
    karst_particle_list_finish(&list);
}

/* 4000 balls in a row, each half in the next, and one that is thicker: all of them count, and no more than that. */
static void no_ray_has_too_many(void **state)
{
    (void)state;
    enum { NUM = 4000 };
    char path[] = "/tmp/karst-row-XXXXXX.csv";
    FILE *file = fdopen(mkstemps(path, 4), "w");
    fprintf(file, "# in a row\nx,y,z,radius,extinction\n");
    for (int i = 0; i < NUM; i++)
        fprintf(file, "%d,0,0,1,0.25\n", i);
    fprintf(file, "100,0,0,5,2\n");
    fclose(file);
    karst_particle_group groups[2] = {{.path = path}, {.path = path, .is_sum = true}};
    const karst_position at = {.voxel = {-80, 0, 0}};
    double depth, sum;
    karst_particle_list list = list_of(groups, 1, 0);
    assert_ok(karst_particle_list_depth(&list, &at, (double[]){1, 0, 0}, 1e6, &depth, &error));
    assert_true(fabs(depth - (0.25 * (NUM + 1 - 10) + 2 * 10)) < 1e-9);
    /* It may begin and end inside. */
    const karst_position inside = {.voxel = {50 * 8, 0, 0}};
    assert_ok(karst_particle_list_depth(&list, &inside, (double[]){1, 0, 0}, 47, &depth, &error));
    assert_true(fabs(depth - (0.25 * 45 + 2 * 2)) < 1e-9);
    karst_particle_list_finish(&list);
    /* Soft balls add up: 16/15 of the radius each. */
    list = list_of(groups + 1, 1, 0);
    assert_ok(karst_particle_list_depth(&list, &at, (double[]){1, 0, 0}, 1e6, &sum, &error));
    assert_true(fabs(sum - 16.0 / 15 * (0.25 * NUM + 2 * 5)) < 1e-9);
    karst_particle_list_finish(&list);
    unlink(path);
}

/* ---- samples ---- */

/* The interpolant of a level's samples at a place, as rays meet it. */
static double interpolated(const karst_particle_list *list, const double m[3], int level)
{
    double at[3], sum = 0;
    int64_t cell[3];
    for (int a = 0; a < 3; a++) {
        const double voxels = m[a] / (VOXEL_M * exp2(level)) + (double)list->origin[a] / exp2(level);
        cell[a] = (int64_t)floor(voxels);
        at[a] = voxels - floor(voxels);
    }
    for (int i = 0; i < 8; i++) {
        int64_t corner[3];
        double weight = 1;
        for (int a = 0; a < 3; a++) {
            const int up = i >> a & 1;
            corner[a] = (int64_t)((uint64_t)(cell[a] + up) << level);
            weight *= up ? at[a] : 1 - at[a];
        }
        sum += weight * (double)karst_particle_list_extinction(list, corner, level);
    }
    return sum;
}

/* As karst_particle_list_extinction, where a rule may be broken. */
static float extinction_at(const karst_particle_list *list, const int64_t voxel[3], int level)
{
    particles_box box = {.reach = PARTICLES_REACH * particles_voxel(level)};
    vfloat p[3];
    for (int a = 0; a < 3; a++)
        p[a] = box.min[a] = box.max[a] = (float)(voxel[a] - list->origin[a]);
    return particles_extinction((particles_data)list->data, p, &box, level);
}

/* All there is of a level, by its samples: extinction times cubic metres. */
static double total_of_level(const karst_particle_list *list, int level)
{
    const int64_t reach = (int64_t)(18 / VOXEL_M) >> level;
    double sum = 0;
    for (int64_t z = -reach - 2; z <= reach + 2; z++)
        for (int64_t y = -reach - 2; y <= reach + 2; y++)
            for (int64_t x = -reach - 2; x <= reach + 2; x++) {
                const int64_t voxel[3] = {((list->origin[0] >> level) + x) * ((int64_t)1 << level),
                                          ((list->origin[1] >> level) + y) * ((int64_t)1 << level),
                                          ((list->origin[2] >> level) + z) * ((int64_t)1 << level)};
                sum += (double)extinction_at(list, voxel, level);
            }
    return sum * pow(VOXEL_M * exp2(level), 3);
}

/* By places of the balls themselves, through shares alone. */
static double total_of_balls(const karst_particle_list *list)
{
    double sum = 0;
    for (uint32_t i = 0; i < PARTICLES_HEAD(list->data)->num; i++)
        sum += (double)PARTICLES_ALL(list->data)[i].share * pow(VOXEL_M, 3);
    return sum;
}

/* Rays one after another through all of it, along x: the depth in the mean, by intervals, and by a level's samples. */
static double mean_depth(const karst_particle_list *list, int level, int across, double *rms)
{
    double sum = 0, square = 0;
    for (int k = 0; k < across; k++)
        for (int j = 0; j < across; j++) {
            double m[3] = {-22, 44 * (j + 0.37) / across - 22, 44 * (k + 0.71) / across - 22}, exact, depth = 0;
            const karst_position from = place_of(list, m);
            assert_ok(karst_particle_list_depth(list, &from, (double[]){1, 0, 0}, 44, &exact, &error));
            const int steps = (int)(44 / (VOXEL_M * exp2(level)) * 2) + 1;
            for (int i = 0; i < steps && level >= 0; i++) {
                m[0] = -22 + 44 * (i + 0.5) / steps;
                depth += interpolated(list, m, level) * 44 / steps;
            }
            sum += level < 0 ? exact : depth;
            square += (depth - exact) * (depth - exact);
        }
    *rms = sqrt(square / (across * across));
    return sum / (across * across);
}

/* Whatever the level, all of the smoke is there: of large balls, of balls smaller than voxels, of both at once. */
static void levels_have_the_same(void **state)
{
    (void)state;
    static const double radii[][2] = {{0.4, 1.1}, {0.05, 0.3}, {0.02, 1.4}};
    for (int i = 0; i < 6; i++) {
        karst_particle_group group = emitter(i % 3 == 2 ? 200 : 400);
        group.is_sum = i >= 3;
        group.emitter.radius_m[0] = radii[i % 3][0];
        group.emitter.radius_m[1] = radii[i % 3][1];
        karst_particle_list list = list_of(&group, 1, 9.1);
        const double balls = total_of_balls(&list);
        for (int level = 3; level <= 9; level++) {
            const double total = total_of_level(&list, level);
            if (fabs(total / balls - 1) > 0.03)
                fail_msg("radii %g to %g, %s: level %d has %g of it", radii[i % 3][0], radii[i % 3][1],
                         group.is_sum ? "sum" : "union", level, total / balls);
        }
        mutant = SMALL; /* without what small ones give, coarse levels lose it */
        assert_true(total_of_level(&list, 7) < 0.5 * balls);
        mutant = NONE;
        karst_particle_list_finish(&list);
    }
}

static void depths_are_those_of_intervals(void **state)
{
    (void)state;
    const karst_particle_group group = emitter(300);
    karst_particle_list list = list_of(&group, 1, 2);
    double rms[7], none;
    const double few = mean_depth(&list, -1, 8, &none), many = mean_depth(&list, -1, 32, &none);
    for (int level = 0; level < 7; level += 1 + (level == 0)) {
        const double exact = level ? many : few,
                     depth = mean_depth(&list, level, level ? 32 : 8, &rms[level]);
        print_message("# level %d: mean depth %.4f, by intervals %.4f; rms error of a ray %.4f\n", level, depth, exact,
                      rms[level]);
        assert_true(level == 0 || fabs(depth - exact) < 0.03 * exact); /* few rays graze edges */
    }
    assert_true(rms[0] < 0.05 && rms[0] < rms[2] && rms[2] < rms[4]);
    karst_particle_list_finish(&list);
}

/* ---- proofs ---- */

static bool is_reached(const karst_particle_list *list, const long origin[3], int level, const double near[3])
{
    for (int place = 0; place < 60; place++) {
        const int of_place = (int)random_between(level > 3 ? level - 3 : 0, level + 1);
        const int64_t steps = (int64_t)KARST_BRICK_CELLS << level >> of_place;
        int64_t voxel[3];
        for (int a = 0; a < 3; a++) {
            const double from = near[a] - (double)(origin[a] - list->origin[a]),
                         step = floor(from / exp2(of_place) + random_unit());
            const int64_t chosen =
                place % 2 ? random_between(0, steps) : (int64_t)fmin(fmax(step, 0), (double)steps);
            voxel[a] = origin[a] + (int64_t)((uint64_t)chosen << of_place);
        }
        if (karst_particle_list_extinction(list, voxel, of_place) != 0)
            return true;
    }
    return false;
}

static int count_wrong_proofs(int num_lists, int *num_proofs)
{
    int num_wrong = 0;
    *num_proofs = 0;
    for (int i = 0; i < num_lists && !(mutant && num_wrong); i++) {
        static const int64_t places[] = {0, 1000003, (int64_t)1 << 40, -((int64_t)1 << 58)};
        karst_particle_group group = emitter((double)random_between(1, 60));
        for (int a = 0; a < 3; a++)
            group.at.voxel[a] = places[random_below(4)] + random_between(-1000, 1000);
        group.is_sum = random_below(2);
        group.emitter.radius_m[0] = random_magnitude(0.001, 4);
        group.emitter.radius_m[1] = random_magnitude(0.001, 4);
        group.emitter.fade = 0;
        karst_particle_list list = list_of(&group, 1, random_unit() * 100);
        for (int box = 0; box < 150; box++) {
            const int level = (int)random_below(9);
            const karst_particle *near = &PARTICLES_ALL(list.data)[random_below(list.num)];
            double at[3], away = 0, direction[3];
            long origin[3];
            for (int a = 0; a < 3; a++)
                direction[a] = random_unit() - 0.5, away += direction[a] * direction[a];
            away = ((double)near->radius + random_unit() * 40 * exp2(level)) / sqrt(away);
            for (int a = 0; a < 3; a++) {
                at[a] = (double)near->at[a] + direction[a] * away;
                origin[a] = karst_node_origin((list.origin[a] + (int64_t)at[a]) >> (level + KARST_BRICK_CELLS_LOG2),
                                              level);
                at[a] = (double)near->at[a];
            }
            if (particles_node_state((particles_data)list.data, KARST_STATE_AIR, origin, level) != KARST_STATE_AIR)
                continue;
            ++*num_proofs;
            num_wrong += is_reached(&list, origin, level, at);
        }
        karst_particle_list_finish(&list);
    }
    return num_wrong;
}

static void proofs_hold(void **state)
{
    (void)state;
    int num_proofs, num_lists = getenv("KARST_TEST_FULL") ? 4000 : getenv("KARST_TEST_QUICK") ? 30 : 100;
    random_state = 1;
    assert_int_equal(count_wrong_proofs(num_lists, &num_proofs), 0);
    print_message("# %d of %d nodes are proved to be clear beside particles\n", num_proofs, 150 * num_lists);
    assert_true(num_proofs > 20 * num_lists);
    for (mutant = RADIUS; mutant <= PARENT; mutant++) {
        random_state = 1;
        const int num_wrong = count_wrong_proofs(200, &num_proofs);
        print_message("# rule %d left out: %d wrong proofs\n", mutant, num_wrong);
        assert_true(num_wrong > 0);
    }
    mutant = NONE;
}

/* ---- time ---- */

/* What does not move is not dirty; what moves is, where it was and where it is. */
static void only_what_moves_is_dirty(void **state)
{
    (void)state;
    char path[] = "/tmp/karst-moves-XXXXXX.csv";
    FILE *file = fdopen(mkstemps(path, 4), "w");
    fprintf(file, "x,y,z,radius,extinction,vx,vy,vz\n0,0,0,1,1,0,0,0\n100,0,0,1,1,0,10,0\n-300,0,0,2,1,0,0,0\n");
    fclose(file);
    const karst_particle_group group = {.path = path};
    karst_particle_list list = list_of(&group, 1, 0), same = list_of(&group, 1, 0);
    karst_drop_box *boxes;
    size_t num;
    assert_ok(karst_particle_list_set_time(&list, 0, &boxes, &num, &error));
    assert_true(num == 0 && !boxes);
    assert_ok(karst_particle_list_set_time(&list, 5, &boxes, &num, &error));
    assert_true(num == 2);
    bool was = false, is = false;
    for (size_t i = 0; i < num; i++) {
        const karst_drop_box *b = &boxes[i];
        assert_true(b->min[0] > 98 * 8 && b->max[0] < 102 * 8);
        was = was || (b->min[1] <= -8 && b->max[1] >= 8);
        is = is || (b->min[1] <= 49 * 8 && b->max[1] >= 51 * 8);
    }
    assert_true(was && is);
    free(boxes);
    assert_ok(karst_particle_list_set_time(&list, 0, &boxes, &num, &error));
    free(boxes);
    assert_true(num == 2 && list.size_bytes == same.size_bytes);
    assert_memory_equal(list.data, same.data, list.size_bytes);
    karst_error why = {0};
    assert_false(karst_particle_list_set_time(&list, (double)NAN, &boxes, &num, &why));
    assert_non_null(strstr(why.message, "time"));
    assert_memory_equal(list.data, same.data, list.size_bytes);
    karst_particle_list_finish(&list);
    karst_particle_list_finish(&same);
    unlink(path);
}

static void emitters_are_functions_of_time(void **state)
{
    (void)state;
    const karst_particle_group group = emitter(100);
    karst_particle_list a = list_of(&group, 1, 12.5), b = list_of(&group, 1, -700);
    karst_drop_box *boxes;
    size_t num;
    assert_ok(karst_particle_list_set_time(&b, 12.5, &boxes, &num, &error));
    free(boxes);
    assert_true(num > 0 && num <= KARST_PARTICLES_MOST_BOXES);
    assert_memory_equal(a.data, b.data, a.size_bytes);
    /* A little later it is a little elsewhere, but for the few that are born again. */
    assert_ok(karst_particle_list_set_time(&b, 12.5 + 1e-4, &boxes, &num, &error));
    free(boxes);
    int num_jumps = 0;
    for (uint32_t i = 0; i < a.num; i++)
        num_jumps += fabs(a.balls[i].at_m[0] - b.balls[i].at_m[0]) > 0.01;
    assert_true(num_jumps <= 2);
    karst_particle_list_finish(&a);
    karst_particle_list_finish(&b);
}

/* ---- devices ---- */

#define NUM_BRICKS 24

static void compare_bits(int lanes, karst_shape shape)
{
    karst_context *context;
    karst_layer *layer;
    karst_particle_group groups[3] = {emitter(300), emitter(100), emitter(200)};
    groups[1].is_sum = true;
    groups[2].emitter.radius_m[0] = 0.01;
    groups[2].emitter.seed = 9;
    assert_ok(context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error));
    assert_ok(layer = karst_particles_layer_create(context, shape, groups, 3, VOXEL_LOG2_M, 4, &error));
    assert_ok(layer->ops->check(layer, &error));
    const karst_particle_list *list = karst_particles_layer_list(layer);
    karst_load loads[NUM_BRICKS], after[NUM_BRICKS];
    const uint32_t stride = KARST_BRICK_PADDED, num = NUM_BRICKS * stride;
    float *world = malloc(sizeof(float) * num), *made = malloc(sizeof(float) * num);
    random_state = 4;
    for (int b = 0; b < NUM_BRICKS; b++) {
        const int level = b % 8;
        const double *m = list->balls[random_below(list->num)].at_m;
        loads[b] = (karst_load){.level = level, .state = b % 2 ? KARST_STATE_UNKNOWN : KARST_STATE_AIR, .doubt = 1};
        for (int a = 0; a < 3; a++)
            loads[b].origin[a] = karst_node_origin(
                (list->origin[a] + (int64_t)(m[a] / VOXEL_M)) >> (level + KARST_BRICK_CELLS_LOG2), level);
    }
    loads[NUM_BRICKS - 2].origin[0] += (long)1 << 40; /* far from all */
    for (uint32_t i = 0; i < num; i++)
        world[i] = (float)random_unit();
    karst_buffer *of_loads = karst_buffer_create(context, "test", sizeof loads, loads, NULL),
                 *staging = karst_buffer_create(context, "test", sizeof(float) * num, world, NULL);
    assert_true(of_loads && staging);
    assert_ok(layer->ops->bound_loads(layer, of_loads, NUM_BRICKS, &error));
    assert_ok(layer->ops->evaluate(layer, of_loads, NUM_BRICKS, staging, stride, NULL, &error));
    assert_ok(karst_buffer_read(staging, 0, made, sizeof(float) * num, &error));
    assert_ok(karst_buffer_read(of_loads, 0, after, sizeof after, &error));
    int num_changed = 0;
    for (int b = 0; b < NUM_BRICKS; b++) {
        assert_int_equal(after[b].state, b == NUM_BRICKS - 2 ? KARST_STATE_AIR : KARST_STATE_UNKNOWN);
        for (int i = 0; i < (int)stride; i++) {
            float expected = world[b * (int)stride + i];
            const int steps[3] = {i % 17, i / 17 % 17, i / 289};
            int64_t at[3];
            for (int a = 0; a < 3; a++)
                at[a] = loads[b].origin[a] + ((int64_t)steps[a] << loads[b].level);
            if (i < KARST_BRICK_SAMPLES && b != NUM_BRICKS - 2)
                expected += karst_particle_list_extinction(list, at, loads[b].level);
            num_changed += expected != world[b * (int)stride + i];
            if (memcmp(&expected, &made[b * (int)stride + i], 4) != 0)
                fail_msg("%d lanes: sample %d of brick %d: %a, the host has %a", lanes, i, b,
                         (double)made[b * (int)stride + i], (double)expected);
        }
    }
    print_message("# %d lanes: %d samples changed\n", lanes, num_changed);
    assert_true(num_changed > 10000);
    karst_buffer_destroy(of_loads);
    karst_buffer_destroy(staging);
    layer->ops->destroy(layer);
    karst_context_destroy(context);
    free(world);
    free(made);
}

static void bits_are_the_same_everywhere(void **state)
{
    (void)state;
    compare_bits(16, KARST_SHAPE_ROWS);
    compare_bits(1, KARST_SHAPE_ROWS);
    compare_bits(1, KARST_SHAPE_GROUPS);
}

/* ---- bad input ---- */

static void refuse(const karst_particle_group *group, karst_status status, const char *word)
{
    karst_particle_list list;
    karst_error why = {0};
    assert_false(karst_particle_list_init(&list, group, 1, VOXEL_LOG2_M, 0, &why));
    if (why.status != status || !strstr(why.message, word))
        fail_msg("status %d, '%s' does not say '%s'", why.status, why.message, word);
}

static void refuse_text(const char *suffix, const char *text, const char *word)
{
    char path[64];
    snprintf(path, sizeof path, "/tmp/karst-bad-XXXXXX.%s", suffix);
    FILE *file = fdopen(mkstemps(path, (int)strlen(suffix) + 1), "w");
    fputs(text, file);
    fclose(file);
    const karst_particle_group group = {.path = path};
    refuse(&group, KARST_BAD_DATA, word);
    unlink(path);
}

static void bad_input_is_refused(void **state)
{
    (void)state;
    karst_particle_group group = emitter(10);
    group.emitter.extinction = -1;
    refuse(&group, KARST_USAGE, "extinction");
    group.emitter.extinction = (double)NAN;
    refuse(&group, KARST_USAGE, "extinction");
    group = emitter(10);
    group.emitter.life_s = 0;
    refuse(&group, KARST_USAGE, "life");
    group = emitter(1e7);
    refuse(&group, KARST_USAGE, "10000000 particles: 1000000 are the most");
    group = emitter(-1);
    refuse(&group, KARST_USAGE, "-1 particles");
    group = emitter(10);
    group.emitter.radius_m[1] = INFINITY;
    refuse(&group, KARST_USAGE, "radius");
    group = emitter(10);
    group.emitter.velocity_m_s[1] = 1e7;
    refuse(&group, KARST_USAGE, "larger voxel");
    group = (karst_particle_group){.path = "/nowhere/at-all.csv"};
    refuse(&group, KARST_BAD_DATA, "/nowhere/at-all.csv");
    group.path = "/nowhere/at-all.obj";
    refuse(&group, KARST_BAD_DATA, ".csv and .ply");
#define HEAD "x,y,z,radius,extinction\n"
    refuse_text("csv", "", "without a particle");
    refuse_text("csv", "x,y,z,radius\n1,2,3,4\n", "no column is called \"extinction\"");
    refuse_text("csv", HEAD, "no particles");
    refuse_text("csv", HEAD "1,2,3,1,1\n1,2,3,one,1\n", "csv:3");
    refuse_text("csv", HEAD "1,2,3,1\n", "csv:2");
    refuse_text("csv", HEAD "1,2,3,1,-0.5\n", "extinction");
    refuse_text("csv", HEAD "1,2,3,1,nan\n", "csv:2");
    refuse_text("csv", HEAD "1,2,3,0,1\n", "radius");
    refuse_text("csv", HEAD "1,2,inf,1,1\n", "particle 1");
    refuse_text("ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                       "end_header\n1 2 3\n", "radius");
    refuse_text("ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                       "property float radius\nproperty float extinction\nend_header\n1 2 3 1 -4\n", "extinction");
    karst_particle_group none = emitter(0);
    karst_particle_list list = list_of(&none, 1, 0);
    assert_true(list.num == 0 && karst_particle_list_extinction(&list, list.origin, 3) == 0);
    karst_particle_list_finish(&list);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unions_are_intervals),         cmocka_unit_test(no_ray_has_too_many),
        cmocka_unit_test(levels_have_the_same),         cmocka_unit_test(depths_are_those_of_intervals),
        cmocka_unit_test(proofs_hold),                  cmocka_unit_test(only_what_moves_is_dirty),
        cmocka_unit_test(emitters_are_functions_of_time), cmocka_unit_test(bits_are_the_same_everywhere),
        cmocka_unit_test(bad_input_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
