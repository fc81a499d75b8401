/* Models made of points as a layer: what they prove of a node holds, whichever rule is looked at; bits are the same on
 * every shape, and 10^12 m out; and strange files are refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <fcntl.h>
#include <math.h>

/* One rule of the proofs broken at a time; the last one is test_whole.c's. */
enum { NONE, COVER, LEAST, EXTENT, PARENT, NUM_MUTANTS, WHOLE };
static int mutant = NONE;
#define POINTS_MUTANT(rule) (mutant == rule)

#include "core/points/import_internal.h"
#include "producers/points/points.clh"
#include "producers/points/points.h"
#include "producers/steps/load_shared.h"
#include "tests/points/clouds.h"
#include "tests/support/files.h"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-5)
#define VOXEL_M 0x1p-5

static char folder[] = "/tmp/karst-points-XXXXXX";
static char torus[64], cloud[64], uneven[64], strange[64];

/* How far points of a level reach that are averages of `finer` ones, in the file that trees are made from. */
static bool write_extents(points_import *import, uint32_t level, const karst_point *finer, points_extent *of_finer)
{
    const karst_points_level *of = &import->head->levels[level], *from = of - 1;
    const int shift = ilogb((double)of->spacing), model = import->fds[POINTS_MODEL],
              fd = karst_points_file(import, karst_points_extents_of(level), NULL);
    karst_point *points = malloc(of->num * sizeof *points);
    points_extent *made = malloc(of->num * sizeof *made);
    const ssize_t num_bytes = (ssize_t)(of->num * sizeof *made);
    bool done = fd >= 0 && pread(model, points, of->num * sizeof *points, (off_t)of->offset) >= 0;
    for (uint64_t i = 0; i < of->num; i++) {
        made[i] = (points_extent){karst_point_reach(points[i].radius), 0};
        for (uint64_t k = 0; k < from->num; k++) {
            double square = 0;
            bool same = true; /* cell */
            for (int a = 0; a < 3; a++) {
                const double apart = (double)points[i].at[a] - finer[k].at[a];
                square += apart * apart;
                same = same && points[i].at[a] >> shift == finer[k].at[a] >> shift;
            }
            if (!same)
                continue;
            made[i].cover = (int32_t)fmin(fmax(made[i].cover, ceil(sqrt(square)) + of_finer[k].cover), 0x1p30);
            made[i].spread = (int32_t)fmin(fmax(made[i].spread, ceil(sqrt(square)) + of_finer[k].spread), 0x1p30);
        }
    }
    done = done && pwrite(fd, made, (size_t)num_bytes, 0) == num_bytes;
    free(points);
    free(made);
    return done;
}

/* The trees of a file whose points were changed. */
static bool rebuild_trees(const char *path)
{
    const karst_points_import_config config = {.output = path};
    points_import import = {.config = &config};
    karst_points_begin_work(&import, NULL);
    int fd = import.fds[POINTS_MODEL] = open(path, O_RDWR);
    bool done = pread(fd, import.head, sizeof *import.head, 0) == (ssize_t)sizeof *import.head;
    for (uint32_t level = 0; done && level < import.head->num_levels; level++) {
        if (level > 0) {
            const uint64_t num = import.head->levels[level - 1].num;
            karst_point *finer = malloc(num * sizeof *finer);
            points_extent *of_finer = malloc(num * sizeof *of_finer);
            points_level_files files;
            done = karst_points_open_level(&import, level - 1, &files, NULL) &&
                   karst_points_read_level(&files, 0, num, finer, of_finer, NULL) &&
                   write_extents(&import, level, finer, of_finer);
            free(finer);
            free(of_finer);
        }
        done = done && karst_points_add_tree(&import, level, NULL);
    }
    import.head->sum = karst_points_sum(0, import.head, offsetof(karst_points_head, sum));
    done = done && pwrite(fd, import.head, sizeof *import.head, 0) == (ssize_t)sizeof *import.head;
    karst_points_end_work(&import);
    return done;
}

/* The same points, of which some have a say farther out than the averages that they are part of, and others next to
 * none; and they face anywhere. */
static void make_uneven(const char *from, const char *to)
{
    size_t num;
    char *bytes = read_file(from, &num);
    karst_points_head *head = (karst_points_head *)bytes;
    karst_point *points = (karst_point *)(bytes + head->levels[0].offset);
    for (uint32_t level = 0; level < head->num_levels; level++) {
        points = (karst_point *)(bytes + head->levels[level].offset);
        for (uint64_t i = 0; i < head->levels[level].num; i++) {
            points[i].radius *= level == 0 && random_below(100) == 0 ? 6 : 0.05f;
            for (int a = 0; a < 3; a++)
                points[i].normal[a] = a == (int)(i % 3) ? 32767 : 0;
        }
        head->levels[level].sum = karst_points_sum(0, points, head->levels[level].num * sizeof *points);
    }
    head->sum = karst_points_sum(0, head, offsetof(karst_points_head, sum));
    write_file(to, bytes, num);
    free(bytes);
}

/* 8,000 points of a torus that is 2.8 m wide; and 300 that lie anywhere, as levels that average them do not. */
static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    random_state = 7;
    char input[64];
    snprintf(input, sizeof input, "%s/input.ply", folder);
    snprintf(torus, sizeof torus, "%s/torus.karstpoints", folder);
    snprintf(cloud, sizeof cloud, "%s/cloud.karstpoints", folder);
    snprintf(strange, sizeof strange, "%s/strange.karstpoints", folder);
    write_cloud(input, &known_surfaces[1], 8000, 0.1);
    bool done = karst_points_import(&(karst_points_import_config){.input = input, .output = torus}, NULL, NULL);
    write_cloud(input, &known_surfaces[0], 900, 6);
    done = done && karst_points_import(&(karst_points_import_config){.input = input, .output = cloud}, NULL, NULL);
    unlink(input);
    snprintf(uneven, sizeof uneven, "%s/uneven.karstpoints", folder);
    if (done) {
        make_uneven(torus, uneven);
        done = rebuild_trees(uneven);
    }
    return done ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(torus);
    unlink(cloud);
    unlink(uneven);
    unlink(strange);
    return rmdir(folder);
}

static int64_t far_out(void)
{
    static const int64_t places[] = {0, 1000003, (int64_t)1 << 40, -((int64_t)1 << 58)};
    return places[random_below(4)];
}

static karst_model random_model(const int64_t around[3], double spread_voxels)
{
    const char *const files[] = {torus, cloud, uneven};
    karst_model model = {.path = files[random_below(3)], .scale = random_magnitude(0.05, 20)};
    for (int a = 0; a < 3; a++) {
        model.at.voxel[a] = around[a] + (int64_t)((random_unit() - 0.5) * spread_voxels);
        model.at.fraction[a] = (uint32_t)random_bits();
        model.turn_deg[a] = random_below(3) ? 360 * random_unit() : 90 * (double)random_below(4);
    }
    return model;
}

static karst_model_list load(const karst_model *models, size_t num)
{
    karst_model_list list;
    assert_ok(karst_model_list_init(&list, models, num, VOXEL_LOG2_M, UINT64_MAX, NULL, &error));
    assert_ok(karst_model_list_check(&list, &error));
    return list;
}

/* Whether any model has a value at a sample of a level: far below the world, nothing else moves it but air's least. */
static bool has_value(const karst_model_list *list, const int64_t voxel[3], int level)
{
    const float air = -POINTS_MOST_VOXELS_OF_AIR * points_voxel(level) * (float)VOXEL_M;
    float d = karst_model_list_density(list, voxel, level, -1e30f);
    return d != -1e30f && d != air;
}

static const long *list_place(const karst_model_list *list) { return POINTS_MODELS(list->data)[0].at; }

/* Where a model's point is, in voxels of the world from where the model stands; and the way that it faces. */
static void place_of(const karst_model_list *list, const karst_point *point, double at[3], double facing[3])
{
    const karst_model_record *model = POINTS_MODELS(list->data);
    double scale = ldexp(1, -model->shift) / (double)model->units_per_voxel;
    for (int a = 0; a < 3; a++) {
        at[a] = facing[a] = 0;
        for (int row = 0; row < 3; row++) {
            double turn = scale * (double)model->matrix[3 * row + a];
            at[a] += turn * point->at[row] / (double)model->units_per_voxel;
            facing[a] += turn * (double)point->normal[row] / 32767;
        }
    }
}

/* Whether a model has a value at some sample in a node, at a footprint up to its parent's: samples anywhere, on the
 * faces, and next to a place. */
static bool is_reached(const karst_model_list *list, const long origin[3], int level, const double near[3])
{
    for (int place = 0; place < 40; place++) {
        int of_place = (int)random_between(level > 4 ? level - 4 : 0, level + 1), face = (int)random_below(6);
        int64_t voxel[3], steps = (int64_t)KARST_BRICK_CELLS << level >> of_place;
        for (int a = 0; a < 3; a++) {
            double step = floor((near[a] - (double)(origin[a] - list_place(list)[a])) / exp2(of_place) + random_unit());
            int64_t chosen = place % 4 == 0   ? random_between(0, steps)
                             : place % 4 == 1 ? (face / 2 == a ? face % 2 * steps : random_between(0, steps))
                                              : (int64_t)fmin(fmax(step, 0), (double)steps);
            voxel[a] = origin[a] + (int64_t)((uint64_t)chosen << of_place);
        }
        if (has_value(list, voxel, of_place))
            return true;
    }
    return false;
}

/* Counts nodes that are left air although a model has a value in them; one is enough of a broken rule. */
static int count_wrong_proofs(int num_lists, int *num_proofs)
{
    int num_wrong = 0;
    *num_proofs = 0;
    for (int i = 0; i < num_lists && !(mutant && num_wrong); i++) {
        const int64_t around[3] = {far_out(), far_out(), far_out()};
        const karst_model model = random_model(around, 100);
        karst_model_list list = load(&model, 1);
        const karst_model_level *finest = POINTS_LEVELS(list.data);
        const karst_point *points = (const karst_point *)((points_data)list.data + finest->points);
        const double size_voxels = 1.5 * model.scale / VOXEL_M;
        for (int box = 0; box < 150; box++) {
            /* Near a point, where the finest levels change over into coarser ones, too. */
            int level = (int)random_below(1 + (int)fmin(fmax(log2(size_voxels), 1), 12));
            double at[3], facing[3], away = random_unit() * 40 * exp2(level);
            long origin[3];
            place_of(&list, &points[random_below(finest->num_points)], at, facing);
            for (int a = 0; a < 3; a++)
                origin[a] = karst_node_origin((model.at.voxel[a] + (int64_t)(at[a] + facing[a] * away)) >>
                                                  (level + KARST_BRICK_CELLS_LOG2),
                                              level);
            if (points_node_state(list.data, KARST_STATE_AIR, origin, level) != KARST_STATE_AIR)
                continue;
            ++*num_proofs;
            num_wrong += is_reached(&list, origin, level, at);
        }
        karst_model_list_finish(&list);
    }
    return num_wrong;
}

static void proofs_hold(void **state)
{
    (void)state;
    int num_proofs, num_lists = getenv("KARST_TEST_FULL") ? 20000 : getenv("KARST_TEST_QUICK") ? 20 : 120;
    random_state = 1;
    mutant = NONE;
    assert_int_equal(count_wrong_proofs(num_lists, &num_proofs), 0);
    print_message("# %d of %d nodes are proved to be air beside models\n", num_proofs, 150 * num_lists);
    assert_true(num_proofs > 10 * num_lists);
    /* Each rule does something: without it there are wrong proofs. */
    for (mutant = NONE + 1; mutant < NUM_MUTANTS && !getenv("KARST_TEST_QUICK"); mutant++) {
        random_state = 1;
        int num_wrong = count_wrong_proofs(160, &num_proofs);
        print_message("# rule %d left out: %d wrong proofs\n", mutant, num_wrong);
        assert_true(num_wrong > 0);
    }
    mutant = NONE;
}

/* What nodes say of all that their points are averages of, against a look at each pair that shares a cell. */
static int count_short_covers(const karst_model_list *list)
{
    const karst_model_level *levels = POINTS_LEVELS(list->data);
    const karst_point *finest = (const karst_point *)((points_data)list->data + levels->points);
    int num_short = 0;
    for (uint32_t l = 1; l < POINTS_MODELS(list->data)[0].num_levels; l++) {
        const karst_point *points = (const karst_point *)((points_data)list->data + levels[l].points);
        const karst_point_node *leaves = (const karst_point_node *)((points_data)list->data + levels[l].nodes[0]);
        int shift = ilogb((double)levels[l].spacing);
        for (uint32_t i = 0; i < levels[l].num_points; i++)
            for (uint32_t k = 0; k < levels[0].num_points; k++) {
                double square = 0;
                bool shares = true;
                for (int a = 0; a < 3; a++) {
                    double d = (double)points[i].at[a] - finest[k].at[a];
                    square += d * d;
                    shares = shares && points[i].at[a] >> shift == finest[k].at[a] >> shift;
                }
                const karst_point_node *leaf = &leaves[i / KARST_POINTS_FAN];
                num_short += shares && (sqrt(square) > leaf->spread ||
                                        sqrt(square) + karst_point_reach(finest[k].radius) > leaf->cover);
            }
    }
    return num_short;
}

static void covers_hold(void **state)
{
    (void)state;
    const char *const files[] = {torus, cloud, uneven};
    for (int i = 0; i < 3; i++) {
        const karst_model model = {.path = files[i], .scale = 1};
        karst_model_list list = load(&model, 1);
        assert_int_equal(count_short_covers(&list), 0);
        /* What the count is worth: nodes that forget what is finer. */
        const karst_model_level *coarse = POINTS_LEVELS(list.data) + 1;
        karst_point_node *leaves = (karst_point_node *)(list.data + coarse->nodes[0]);
        for (uint32_t k = 0; k < coarse->counts[0]; k++)
            leaves[k].spread = leaves[k].spread * 3 / 4;
        assert_true(count_short_covers(&list) > 0);
        karst_model_list_finish(&list);
    }
}

static void only_air_is_touched(void **state)
{
    (void)state;
    const karst_model model = {.path = torus, .scale = 1};
    karst_model_list list = load(&model, 1);
    const long origin[3] = {-8, 40, -8}; /* above the torus */
    assert_int_equal(points_node_state(list.data, KARST_STATE_SOLID, origin, 4), KARST_STATE_SOLID);
    assert_int_equal(points_node_state(list.data, KARST_STATE_UNKNOWN, origin, 4), KARST_STATE_UNKNOWN);
    assert_int_equal(points_node_state(list.data, KARST_STATE_AIR, origin, 4), KARST_STATE_UNKNOWN);
    assert_int_equal(points_node_state(list.data, KARST_STATE_AIR, origin, 0), KARST_STATE_AIR);
    /* It adds, and takes nothing away. */
    random_state = 5;
    for (int i = 0; i < 2000; i++) {
        const int64_t voxel[3] = {random_between(-60, 60), random_between(-30, 30), random_between(-60, 60)};
        float world = (float)(random_unit() - 0.5) * 4;
        assert_true(karst_model_list_density(&list, voxel, 0, world) >= world);
    }
    karst_model_list_finish(&list);
}

/* ---- far out, and instances ---- */

static void far_copies_are_the_same(void **state)
{
    (void)state;
    random_state = 3;
    const int64_t origin[3] = {0, 0, 0}, far[3] = {(int64_t)32000000000000, -((int64_t)1 << 60), 77};
    int num_values = 0;
    for (int i = 0; i < 20; i++) {
        karst_model near = random_model(origin, 10), same = near;
        for (int a = 0; a < 3; a++)
            same.at.voxel[a] += far[a];
        karst_model_list here = load(&near, 1), there = load(&same, 1);
        for (int k = 0; k < 500; k++) {
            int level = (int)random_below(6), side = (int)(3 * near.scale / VOXEL_M) + 2;
            int64_t p[3], q[3];
            for (int a = 0; a < 3; a++) {
                p[a] = (random_between(-side, side) >> level) * ((int64_t)1 << level);
                q[a] = p[a] + far[a];
            }
            float one = karst_model_list_density(&here, p, level, -5),
                  other = karst_model_list_density(&there, q, level, -5);
            assert_memory_equal(&one, &other, sizeof one);
            num_values += one != -5;
        }
        karst_model_list_finish(&here);
        karst_model_list_finish(&there);
    }
    assert_true(num_values > 500);
}

static void instances_share_points(void **state)
{
    (void)state;
    const int64_t origin[3] = {0, 0, 0};
    karst_model models[20];
    random_state = 4;
    for (int i = 0; i < 20; i++) {
        models[i] = random_model(origin, 1000);
        models[i].path = torus;
    }
    karst_model_list one = load(models, 1), many = load(models, 20);
    /* Of the file itself, whole pages follow. */
    assert_true(many.size_bytes - one.size_bytes <= 19 * sizeof(karst_model_record) + 4096);
    karst_model_list_finish(&one);
    karst_model_list_finish(&many);
    /* Room for the coarser half alone. */
    karst_points_about about;
    assert_ok(karst_points_describe(torus, &about, &error));
    assert_ok(karst_model_list_init(&one, models, 1, VOXEL_LOG2_M, 150000, NULL, &error));
    assert_true(one.size_bytes < 150000);
    assert_true(POINTS_MODELS(one.data)[0].num_levels < about.num_levels);
    karst_model_list_finish(&one);
}

/* ---- devices ---- */

#define NUM_BRICKS 24

static karst_buffer *buffer(karst_context *context, size_t size_bytes, const void *initial)
{
    karst_error error = {0};
    karst_buffer *made = karst_buffer_create(context, "test", size_bytes, initial, &error);
    if (!made)
        fail_msg("%s", error.message);
    return made;
}

/* Bricks near models on a device, in a shape, against the host's densities. */
static void compare_bits(int lanes, karst_shape shape)
{
    karst_context *context;
    karst_layer *layer;
    assert_ok(context = karst_context_create(NULL, lanes, NULL, &error));
    random_state = 4;
    const int64_t around[3] = {((int64_t)1 << 50) + 12345, -977, 1000003};
    karst_model models[6];
    for (int i = 0; i < 6; i++)
        models[i] = random_model(around, 200);
    assert_ok(layer = karst_points_layer_create(context, shape, models, 6, VOXEL_LOG2_M, NULL, &error));
    assert_ok(layer->ops->check(layer, &error));
    const karst_model_list *list = karst_points_layer_list(layer);

    karst_load loads[NUM_BRICKS];
    const uint32_t stride = KARST_BRICK_PADDED;
    float *world = malloc(sizeof(float) * NUM_BRICKS * stride), *made = malloc(sizeof(float) * NUM_BRICKS * stride);
    for (int b = 0; b < NUM_BRICKS; b++) {
        int level = b % 8;
        loads[b] = (karst_load){.level = level, .state = KARST_STATE_UNKNOWN, .doubt = 1};
        for (int a = 0; a < 3; a++)
            loads[b].origin[a] = karst_node_origin(
                (models[b % 6].at.voxel[a] + random_between(-30, 30)) >> (level + KARST_BRICK_CELLS_LOG2), level);
    }
    loads[NUM_BRICKS - 1].origin[0] += (long)1 << 40; /* far from all */
    for (uint32_t i = 0; i < NUM_BRICKS * stride; i++)
        world[i] = (float)((random_unit() - 0.5) * 20);
    karst_buffer *of_loads = buffer(context, sizeof loads, loads),
                 *staging = buffer(context, sizeof(float) * NUM_BRICKS * stride, world);
    /* Colours of a layer before are in every second brick. */
    float *planes = malloc(sizeof(float) * NUM_BRICKS * 4 * stride),
          *painted = malloc(sizeof(float) * NUM_BRICKS * 4 * stride);
    uint32_t coloured[NUM_BRICKS];
    for (uint32_t i = 0; i < NUM_BRICKS * 4 * stride; i++)
        planes[i] = (float)random_unit();
    for (uint32_t b = 0; b < NUM_BRICKS; b++)
        coloured[b] = b % 2;
    const karst_layer_colours colours = {buffer(context, sizeof(float) * NUM_BRICKS * 4 * stride, planes),
                                         buffer(context, sizeof coloured, coloured)};
    assert_ok(layer->ops->evaluate(layer, of_loads, NUM_BRICKS, staging, stride, NULL, &error));
    assert_ok(karst_buffer_read(staging, 0, made, sizeof(float) * NUM_BRICKS * stride, &error));
    assert_ok(karst_buffer_write(staging, 0, world, sizeof(float) * NUM_BRICKS * stride, &error));
    assert_ok(layer->ops->evaluate(layer, of_loads, NUM_BRICKS, staging, stride, &colours, &error));
    assert_ok(karst_buffer_read(colours.planes, 0, painted, sizeof(float) * NUM_BRICKS * 4 * stride, &error));
    assert_ok(karst_buffer_read(colours.coloured, 0, coloured, sizeof coloured, &error));
    float *without = malloc(sizeof(float) * NUM_BRICKS * stride);
    memcpy(without, made, sizeof(float) * NUM_BRICKS * stride);
    assert_ok(layer->ops->bound_loads(layer, of_loads, NUM_BRICKS, &error));
    assert_ok(karst_buffer_read(staging, 0, made, sizeof(float) * NUM_BRICKS * stride, &error));
    karst_load after[NUM_BRICKS];
    assert_ok(karst_buffer_read(of_loads, 0, after, sizeof after, &error));
    int num_changed = 0, num_doubtful = 0, num_painted = 0;
    assert_memory_equal(without, made, sizeof(float) * NUM_BRICKS * stride); /* whether there are colours or not */
    for (int b = 0; b < NUM_BRICKS; b++) {
        for (int i = 0; i < (int)stride; i++) {
            float expected = world[b * (int)stride + i];
            if (i < KARST_BRICK_SAMPLES) {
                int steps[3] = {i % 17, i / 17 % 17, i / 289};
                int64_t at[3];
                for (int a = 0; a < 3; a++)
                    at[a] = loads[b].origin[a] + ((int64_t)steps[a] << loads[b].level);
                float colour[4];
                for (int part = 0; part < 4; part++)
                    colour[part] = b % 2 ? planes[((uint32_t)b * 4 + (uint32_t)part) * stride + (uint32_t)i] : 0;
                expected = karst_model_list_coloured_density(list, at, loads[b].level, expected, colour);
                for (int part = 0; part < 4 && coloured[b]; part++) {
                    float is = painted[((uint32_t)b * 4 + (uint32_t)part) * stride + (uint32_t)i];
                    if (memcmp(&is, &colour[part], 4) != 0)
                        fail_msg("%d lanes: colour %d of sample %d of brick %d: %a, the host has %a", lanes, part, i, b,
                                 (double)is, (double)colour[part]);
                    num_painted += part == 3 && colour[3] > 0.5f && b % 2 == 0;
                }
            }
            num_changed += expected != world[b * (int)stride + i];
            if (memcmp(&expected, &made[b * (int)stride + i], 4) != 0)
                fail_msg("%d lanes: sample %d of brick %d: %a, the host has %a", lanes, i, b,
                         (double)made[b * (int)stride + i], (double)expected);
        }
        bool reached = points_reach_node(list->data, loads[b].origin, loads[b].level, 1);
        assert_true(reached ? isinf(after[b].doubt) : after[b].doubt == 1);
        num_doubtful += reached;
    }
    print_message("# %d lanes: %d samples changed, %d painted, %d of %d bricks in doubt\n", lanes, num_changed,
                  num_painted, num_doubtful, NUM_BRICKS);
    assert_true(num_painted > 1000);
    karst_buffer_destroy(colours.planes);
    karst_buffer_destroy(colours.coloured);
    free(planes);
    free(painted);
    free(without);
    assert_true(num_changed > 10000 && num_doubtful > NUM_BRICKS / 2 && num_doubtful < NUM_BRICKS);
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

/* ---- files that are mapped ---- */

/* What lies in a file's own pages has the values of what was read, also once those were let go. */
static void mapped_files_are_the_same(void **state)
{
    (void)state;
    const int64_t origin[3] = {0, 0, 0};
    random_state = 11;
    for (int i = 0; i < 10; i++) {
        const karst_model models[2] = {random_model(origin, 10), random_model(origin, 10)};
        karst_model_list read = load(models, 2), mapped;
        assert_ok(karst_model_list_init_reading(&mapped, models, 2, VOXEL_LOG2_M, UINT64_MAX, 0, NULL, &error));
        assert_int_equal(mapped.num_maps, 1 + (strcmp(models[0].path, models[1].path) != 0));
        assert_int_equal(read.num_maps, 0);
        assert_ok(karst_model_list_check(&mapped, &error));
        for (int k = 0; k < 500; k++) {
            const int level = (int)random_below(6);
            const int64_t voxel[3] = {random_between(-60, 60) * (1 << level), random_between(-30, 30) * (1 << level),
                                      random_between(-60, 60) * (1 << level)};
            float one = karst_model_list_density(&read, voxel, level, -5),
                  other = karst_model_list_density(&mapped, voxel, level, -5);
            assert_memory_equal(&one, &other, sizeof one);
            if (k % 100 == 0)
                karst_model_list_let_go(&mapped);
        }
        karst_model_list_finish(&read);
        karst_model_list_finish(&mapped);
    }
}

/* ---- strange files ---- */

/* The file is refused, or what is made of it is sound. */
static void try_strange(bool must_fail, uint64_t most_read_bytes)
{
    const karst_model model = {.path = strange, .scale = 1};
    karst_model_list list;
    karst_error why = {0};
    if (!karst_model_list_init_reading(&list, &model, 1, VOXEL_LOG2_M, UINT64_MAX, most_read_bytes, NULL, &why)) {
        assert_true(why.status == KARST_BAD_DATA || why.status == KARST_USAGE);
        assert_non_null(strstr(why.message, "strange.karstpoints"));
        return;
    }
    assert_false(must_fail);
    assert_ok(karst_model_list_check(&list, &error));
    for (int64_t x = -100; x < 100; x++)
        karst_model_list_density(&list, (int64_t[]){x, 0, 3}, 0, -1);
    karst_model_list_finish(&list);
}

static void strange_files_are_refused(void **state)
{
    (void)state;
    size_t num;
    char *bytes = read_file(cloud, &num), *changed = malloc(num);
    random_state = 6;
    /* Any byte that is other than it was, and any end. */
    for (int i = 0; i < 100; i++) {
        memcpy(changed, bytes, num);
        changed[random_below(i % 2 ? (int64_t)num : 1536)] ^= (char)random_between(1, 255);
        write_file(strange, changed, num);
        try_strange(true, i % 3 ? UINT64_MAX : 0);
        write_file(strange, bytes, (size_t)random_below((int64_t)num));
        try_strange(true, i % 3 ? UINT64_MAX : 0);
    }
    /* Heads and points that lie, with sums that are right. */
    for (int i = 0; i < 100; i++) {
        memcpy(changed, bytes, num);
        karst_points_head *head = (karst_points_head *)changed;
        uint32_t level = (uint32_t)random_below(head->num_levels);
        karst_points_level *of = &head->levels[level];
        karst_point *points = (karst_point *)(changed + of->offset);
        karst_point *point = &points[random_below((int64_t)of->num)];
        bool must_fail = true;
        switch (i % 10) {
        case 0:
            of->num = (uint64_t)random_bits();
            break;
        case 1:
            of->offset = (uint64_t)random_bits();
            break;
        case 2:
            head->num_levels = (uint32_t)random_between(25, 1000);
            break;
        case 3:
            head->unit = i % 20 == 3 ? NAN : -1;
            break;
        case 4:
            of->spacing = 0;
            break;
        case 5:
            point->at[random_below(3)] = INT32_MIN;
            break;
        case 6:
            point->radius = i % 20 == 6 ? NAN : INFINITY;
            break;
        case 7:
            head->centre[1] = NAN;
            break;
        case 8:
            point->at[0] ^= (int32_t)random_below(1 << 20);
            must_fail = false;
            break;
        default:
            point->radius = (float)random_below(1 << 26);
            must_fail = false;
        }
        if (i % 10 >= 5 && i % 10 != 7)
            of->sum = karst_points_sum(0, points, of->num * sizeof *points);
        head->sum = karst_points_sum(0, head, offsetof(karst_points_head, sum));
        write_file(strange, changed, num);
        try_strange(must_fail, i % 3 ? UINT64_MAX : 0);
    }
    free(bytes);
    free(changed);
}

static void models_must_fit_the_world(void **state)
{
    (void)state;
    const struct {
        const char *what;
        double scale;
    } bad[] = {{"wide", 1e7}, {"wide", 1e29}, {"wide", 1e-3}, {"wide", 1e-30}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        const karst_model model = {.path = torus, .scale = bad[i].scale};
        karst_model_list list;
        karst_error why = {0};
        assert_false(karst_model_list_init(&list, &model, 1, VOXEL_LOG2_M, UINT64_MAX, NULL, &why));
        assert_int_equal(why.status, KARST_USAGE);
        assert_non_null(strstr(why.message, bad[i].what));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(proofs_hold),
        cmocka_unit_test(covers_hold),
        cmocka_unit_test(only_air_is_touched),
        cmocka_unit_test(far_copies_are_the_same),
        cmocka_unit_test(instances_share_points),
        cmocka_unit_test(bits_are_the_same_everywhere),
        cmocka_unit_test(mapped_files_are_the_same),
        cmocka_unit_test(strange_files_are_refused),
        cmocka_unit_test(models_must_fit_the_world),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
