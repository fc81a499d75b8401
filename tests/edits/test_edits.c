/* Edits as operations: what they prove holds, whichever rule is looked at; the index finds what a look at all of them
 * finds; values are those of a second implementation, in double; and bits are the same on every shape. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* One rule of the proofs broken at a time. */
enum { NONE, OUTSIDE, INSIDE, REACH, ROUGH, SMOOTH, NUM_MUTANTS };
static int mutant = NONE;
#define EDITS_MUTANT(rule) (mutant == rule)

#include "cache/colour.clh"
#include "producers/edits/edits.clh"
#include "producers/edits/edits.h"
#include "producers/steps/colours.h"
#include "producers/steps/load_shared.h"
#include "tests/noise/random.h"

/* With the rules that can be broken. */
#define karst_edit_list_range edit_range_by_rules
bool karst_edit_list_range(const karst_edit_list *list, const karst_position *centre, const double half_voxels[3],
                           int level, double range[2]);
#include "producers/edits/edit_range.c"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-3)
#define VOXEL_M 0.125

static int64_t far_out(void)
{
    static const int64_t places[] = {0, 1000003, (int64_t)1 << 40, -((int64_t)1 << 58)};
    return places[random_below(4)];
}

/* Around a place: all shapes and modes, from far below a voxel to many bricks. */
static karst_edit random_edit(const int64_t around[3], double spread_voxels)
{
    karst_edit e = {.shape = (karst_edit_shape)random_below(5), .mode = (karst_edit_mode)random_below(5)};
    if (e.mode == KARST_EDIT_FLATTEN)
        e.shape = (karst_edit_shape)random_below(2);
    if (e.mode == KARST_EDIT_SMOOTH)
        e.shape = KARST_EDIT_SPHERE;
    for (int a = 0; a < 3; a++) {
        e.at.voxel[a] = around[a] + (int64_t)((random_unit() - 0.5) * spread_voxels);
        e.at.fraction[a] = (uint32_t)random_bits();
        e.half_m[a] = VOXEL_M * random_magnitude(0.05, 200);
        e.to_m[a] = VOXEL_M * (random_unit() - 0.5) * random_magnitude(1, 400);
        e.normal[a] = random_unit() - 0.5;
    }
    e.radius_m = VOXEL_M * random_magnitude(0.05, 200);
    e.blend_m = random_below(2) || e.mode == KARST_EDIT_SMOOTH ? 0 : VOXEL_M * random_magnitude(0.1, 30);
    e.amplitude_m = e.radius_m * random_unit();
    e.amplitude_m = e.amplitude_m < VOXEL_M / 1024 ? 0 : e.amplitude_m;
    e.scale_m = VOXEL_M * random_magnitude(1, 100);
    e.seed = (uint32_t)random_bits();
    e.has_colour = e.mode == KARST_EDIT_PAINT || (e.mode == KARST_EDIT_ADD && random_below(2));
    for (int i = 0; i < 3; i++)
        e.colour[i] = random_unit();
    e.strength = random_below(2) ? 1 : random_magnitude(1e-3, 1);
    return e;
}

static karst_edit_list random_list(int num, const int64_t around[3], double spread_voxels)
{
    karst_edit_list list;
    karst_edit *edits = calloc((size_t)num, sizeof *edits);
    for (int i = 0; i < num; i++)
        edits[i] = random_edit(around, spread_voxels);
    assert_ok(karst_edit_list_init(&list, VOXEL_LOG2_M, &error));
    assert_ok(karst_edit_list_append(&list, edits, (size_t)num, &error));
    free(edits);
    return list;
}

static karst_position random_place(const long origin[3], int level)
{
    karst_position p;
    for (int a = 0; a < 3; a++) {
        int64_t side = (int64_t)KARST_BRICK_CELLS << level;
        p.voxel[a] = origin[a] + random_between(0, side);
        p.fraction[a] = p.voxel[a] == origin[a] + side ? 0 : (uint32_t)random_bits();
    }
    return p;
}

/* Counts nodes that are proved constant although a place in them is not so, at some footprint up to the parent's. */
static int count_wrong_proofs(int num_lists, int *num_proofs)
{
    static const uint32_t states[] = {KARST_STATE_UNKNOWN, KARST_STATE_AIR, KARST_STATE_SOLID};
    int num_wrong = 0;
    *num_proofs = 0;
    for (int i = 0; i < num_lists; i++) {
        const int64_t around[3] = {far_out(), far_out(), far_out()};
        int level = (int)random_below(6);
        double spread = random_magnitude(1, 200) * exp2(level);
        karst_edit_list list = random_list((int)random_between(1, 6), around, spread);
        for (int box = 0; box < 4; box++) {
            uint32_t before = states[random_below(3)];
            long origin[3];
            for (int a = 0; a < 3; a++)
                origin[a] = karst_node_origin(
                    (around[a] + (int64_t)((random_unit() - 0.5) * spread)) >> (level + KARST_BRICK_CELLS_LOG2), level);
            uint32_t after = edits_node_state(list.data, before, origin, level);
            bool wrong = false;
            if (after == KARST_STATE_UNKNOWN)
                continue;
            ++*num_proofs;
            for (int place = 0; place < 64 && !wrong; place++) {
                karst_position at = random_place(origin, level);
                int of_place = (int)random_between(-1, level + 1);
                float size = (float)random_magnitude(1e-3, 1e3);
                bool solid = before == KARST_STATE_UNKNOWN ? random_below(2) : before == KARST_STATE_SOLID;
                float d = karst_edit_list_density(&list, &at, of_place, solid ? size : -size);
                wrong = (d > 0) != (after == KARST_STATE_SOLID);
            }
            num_wrong += wrong;
        }
        karst_edit_list_finish(&list);
    }
    return num_wrong;
}

static void proofs_hold(void **state)
{
    (void)state;
    int num_proofs, num_lists = getenv("KARST_TEST_FULL") ? 100000 : 10000;
    random_state = 1;
    mutant = NONE;
    assert_int_equal(count_wrong_proofs(num_lists, &num_proofs), 0);
    print_message("# %d of %d nodes are proved constant beside edits\n", num_proofs, 4 * num_lists);
    assert_true(num_proofs > num_lists / 2);
    /* Each rule does something: without it there are wrong proofs. */
    for (mutant = NONE + 1; mutant < NUM_MUTANTS; mutant++) {
        random_state = 1;
        int num_wrong = count_wrong_proofs(4000, &num_proofs);
        print_message("# rule %d left out: %d wrong proofs\n", mutant, num_wrong);
        assert_true(num_wrong > 0);
    }
    mutant = NONE;
}

/* Counts places whose density is not in the range that holds for their box, at some footprint up to the level's.
 * *share: of the boxes that edits may change, how many have one sign. */
static int count_wrong_ranges(int num_lists, double *share)
{
    int num_wrong = 0, num_changed = 0, num_decided = 0;
    for (int i = 0; i < num_lists; i++) {
        const int64_t around[3] = {far_out(), far_out(), far_out()};
        const int level = (int)random_between(-1, 5);
        const double spread = random_magnitude(1, 200);
        karst_edit_list list = random_list((int)random_between(1, 6), around, spread);
        for (int n = 0; n < 4; n++) {
            karst_position centre;
            double half_voxels[3], range[2];
            const double lowest = (random_unit() - 0.5) * 20;
            const double world[2] = {(double)(float)lowest, (double)(float)(lowest + random_magnitude(1e-3, 5))};
            for (int a = 0; a < 3; a++) {
                centre.voxel[a] = around[a] + (int64_t)((random_unit() - 0.5) * spread);
                centre.fraction[a] = (uint32_t)random_bits();
                half_voxels[a] = random_magnitude(0.1, 60);
            }
            memcpy(range, world, sizeof range);
            assert_true(karst_edit_list_range(&list, &centre, half_voxels, level, range));
            if (range[0] != world[0] || range[1] != world[1]) {
                num_changed++;
                num_decided += range[0] > 0 || range[1] <= 0;
            }
            for (int place = 0; place < 24; place++) {
                double offset_m[3];
                for (int a = 0; a < 3; a++)
                    offset_m[a] = VOXEL_M * half_voxels[a] * (random_below(4) ? 2 * random_unit() - 1 : 1);
                const karst_position at = karst_position_add_m(centre, offset_m, VOXEL_LOG2_M);
                const double d = world[0] + (world[1] - world[0]) * (random_below(3) ? random_unit() : random_below(2));
                const float edited = karst_edit_list_density(&list, &at, (int)random_between(-1, level), (float)d);
                num_wrong += !((double)edited >= range[0] && (double)edited <= range[1]);
            }
        }
        karst_edit_list_finish(&list);
    }
    *share = (double)num_decided / num_changed;
    return num_wrong;
}

static void ranges_hold(void **state)
{
    (void)state;
    double share;
    mutant = NONE;
    random_state = 3;
    assert_int_equal(count_wrong_ranges(getenv("KARST_TEST_FULL") ? 100000 : 10000, &share), 0);
    print_message("# of boxes that edits change %.2f have one sign\n", share);
    assert_true(share > 0.3);
    static const int rules[] = {OUTSIDE, REACH, ROUGH, SMOOTH};
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++) {
        mutant = rules[i];
        random_state = 3;
        const int num_wrong = count_wrong_ranges(2000, &share);
        print_message("# rule %d of ranges left out: %d wrong\n", mutant, num_wrong);
        assert_true(num_wrong > 0);
    }
    mutant = NONE;
}

static void values_are_those_of_the_second_implementation(void **state)
{
    (void)state;
    int num_part = 0;
    random_state = 2;
    for (int i = 0; i < 3000; i++) {
        const int64_t around[3] = {far_out(), far_out(), far_out()};
        karst_edit_list list = random_list((int)random_between(1, 80), around, 100);
        for (int k = 0; k < 20; k++) {
            const long origin[3] = {around[0] - 40, around[1] - 40, around[2] - 40};
            karst_position at = random_place(origin, 2);
            int level = (int)random_between(-1, 5);
            float world = (float)((random_unit() - 0.5) * 20);
            double in_double[4], precise = karst_edit_list_precise(&list, &at, level, (double)world, in_double);
            float device = karst_edit_list_density(&list, &at, level, world);
            /* Rounded-off maxima of many hand errors on; each is 2^-20 of what it is made of. */
            const double by_index = karst_edit_list_precise_density(&list, &at, level, (double)world);
            assert_memory_equal(&by_index, &precise, sizeof precise);
            if (fabs((double)device - precise) > 1e-4 + 4e-6 * fabs(precise))
                fail_msg("list %d: %.9g, and %.9g in double, at level %d", i, (double)device, precise, level);
            float colour[4];
            karst_edit_list_colour(&list, &at, level, world, colour);
            for (int c = 0; c < 4; c++)
                if (fabs((double)colour[c] - in_double[c]) > 1e-3)
                    fail_msg("list %d: colour %d is %.9g, and %.9g in double, at level %d", i, c, (double)colour[c],
                             in_double[c], level);
            num_part += in_double[3] > 0.01 && in_double[3] < 0.99;
        }
        karst_edit_list_finish(&list);
    }
    assert_true(num_part > 1000);
}

/* The edits of a box by a look at all. */
static uint32_t collect_plainly(const karst_edit_list *list, const edits_box *box, uint32_t first, uint32_t *found)
{
    uint32_t num = 0;
    for (uint32_t i = first; i < karst_edit_list_num(list) && num < EDITS_LIST; i++)
        if (edits_meet(&karst_edit_list_records(list)[i], box))
            found[num++] = i;
    return num;
}

static void the_index_finds_all(void **state)
{
    (void)state;
    random_state = 3;
    const int64_t around[3] = {0, 0, 0};
    karst_edit_list list;
    assert_ok(karst_edit_list_init(&list, VOXEL_LOG2_M, &error));
    size_t num_found = 0;
    for (int round = 0; round < 60; round++) {
        karst_edit edits[256];
        int num = (int)random_between(1, 256);
        for (int i = 0; i < num; i++)
            edits[i] = random_edit(around, 20000);
        /* Some are undone, of which some are redone, and some overwritten. */
        if (round % 3 == 2)
            karst_edit_list_set_num(&list, karst_edit_list_num(&list) - (uint32_t)random_below(100));
        if (round % 6 == 2)
            karst_edit_list_set_num(&list, karst_edit_list_num(&list) + (uint32_t)random_below(50));
        assert_ok(karst_edit_list_append(&list, edits, (size_t)num, &error));
        assert_ok(karst_edit_list_check(&list, &error));
        for (int k = 0; k < 100; k++) {
            edits_box box = {.level = (int)random_below(8), .margin = (int)random_below(5)};
            box.shown = (int)random_below(2);
            for (int a = 0; a < 3; a++) {
                box.min[a] = random_between(-12000, 12000);
                box.max[a] = box.min[a] + random_between(0, 3000);
            }
            uint32_t first = k % 4 ? 0 : (uint32_t)random_below(karst_edit_list_num(&list));
            uint32_t by_index[EDITS_LIST], plainly[EDITS_LIST];
            uint32_t num_by_index = edits_collect(list.data, &box, first, by_index);
            assert_int_equal(num_by_index, collect_plainly(&list, &box, first, plainly));
            assert_memory_equal(by_index, plainly, num_by_index * sizeof *plainly);
            num_found += num_by_index;
        }
    }
    assert_true(num_found > 10000);
    /* What the check is worth: a node that is a voxel too small. */
    karst_edits_head *head = (karst_edits_head *)list.data;
    karst_edit_node *node = (karst_edit_node *)(list.data + head->nodes[0]);
    node->max[1]--;
    assert_false(karst_edit_list_check(&list, &(karst_error){0}));
    karst_edit_list_finish(&list);
}

/* On the host and on a device, of lists that grow edit by edit. */
static void an_edit_takes_128_bytes_at_most(void **state)
{
    (void)state;
    const int64_t around[3] = {0, 0, 0};
    karst_edit_list list;
    random_state = 4;
    assert_ok(karst_edit_list_init(&list, VOXEL_LOG2_M, &error));
    for (size_t num = 1; num <= 4000; num++) {
        const karst_edit edit = random_edit(around, 20000);
        assert_ok(karst_edit_list_append(&list, &edit, 1, &error));
        assert_true(num < 1000 || list.size_bytes <= num * 128);
    }
    karst_edit_list_finish(&list);
}

/* ---- devices ---- */

#define NUM_BRICKS 40

static karst_buffer *buffer(karst_context *context, size_t size_bytes, const void *initial)
{
    karst_error error = {0};
    karst_buffer *made = karst_buffer_create(context, "test", size_bytes, initial, &error);
    if (!made)
        fail_msg("%s", error.message);
    return made;
}

static karst_position sample_place(const karst_load *load, int sample)
{
    const int steps[3] = {sample % 17, sample / 17 % 17, sample / 289};
    karst_position at = {{0}, {0}};
    for (int a = 0; a < 3; a++)
        at.voxel[a] = load->origin[a] + ((int64_t)steps[a] << load->level);
    return at;
}

/* Colours of the same bricks: in planes, and packed into slots of more than one segment, against the host's. Densities
 * are those that there were without colours. */
static void compare_colours(karst_context *context, karst_shape shape, karst_layer *layer, karst_buffer *of_loads,
                            const karst_load *loads, const float *world, const float *made)
{
    enum { PER_SEGMENT = 7, STRIDE = KARST_BRICK_PADDED };
    const karst_edit_list *list = karst_edits_list(layer);
    const karst_cache_buffers bricks = {.num_bricks = NUM_BRICKS + 1, .bricks_per_segment = PER_SEGMENT};
    uint32_t slots[NUM_BRICKS], results[NUM_BRICKS], coloured[NUM_BRICKS + 1 + KARST_CACHE_ROOT_BRICKS];
    float *again = malloc(sizeof(float) * NUM_BRICKS * STRIDE);
    uint32_t *words = malloc(PER_SEGMENT * KARST_COLOUR_BRICK_BYTES);
    for (int b = 0; b < NUM_BRICKS; b++) {
        slots[b] = (uint32_t)(b * 7 % NUM_BRICKS) + 1; /* 40 and 7 have no common factor */
        results[b] = b % 5 == 3 ? KARST_STATE_AIR
                     : b % 5 == 4 ? KARST_STATE_CLEAR_AIR | KARST_LOAD_KEPT
                                  : KARST_STATE_BRICK;
    }
    karst_work work = {.load_slots = buffer(context, sizeof slots, slots),
                       .load_results = buffer(context, sizeof results, results)};
    karst_buffer *staging = buffer(context, sizeof(float) * NUM_BRICKS * STRIDE, world);
    karst_colours *colours;
    karst_colour_step *step;
    const karst_layer_colours *chunk;
    assert_ok(karst_edits_allow_colours(layer, &error));
    assert_ok(colours = karst_colours_create(context, &bricks, &error));
    assert_ok(step = karst_colour_step_create(context, shape, colours, NUM_BRICKS, &error));
    assert_ok(karst_buffer_write(of_loads, 0, loads, NUM_BRICKS * sizeof *loads, &error));
    for (int turn = 0; turn < 2; turn++) { /* what an earlier chunk left does no harm */
        assert_ok(karst_buffer_write(staging, 0, world, sizeof(float) * NUM_BRICKS * STRIDE, &error));
        assert_ok(chunk = karst_colour_step_begin(step, NUM_BRICKS, &error));
        assert_ok(layer->ops->evaluate(layer, of_loads, NUM_BRICKS, staging, STRIDE, chunk, &error));
    }
    assert_ok(karst_colour_step_end(step, &work, 0, NUM_BRICKS, &error));
    assert_ok(karst_buffer_read(staging, 0, again, sizeof(float) * NUM_BRICKS * STRIDE, &error));
    assert_memory_equal(again, made, sizeof(float) * NUM_BRICKS * STRIDE);
    assert_ok(karst_buffer_read(colours->coloured, 0, coloured, sizeof coloured, &error));
    int num_coloured = 0, num_covered = 0;
    for (int b = 0; b < NUM_BRICKS; b++) {
        bool has_colours = b % 5 != 3 && edits_touch(list->data, loads[b].origin, loads[b].level, EDITS_OF_COLOUR);
        assert_int_equal(coloured[slots[b]], has_colours);
        if (!has_colours)
            continue;
        num_coloured++;
        assert_ok(karst_buffer_read(colours->samples[slots[b] / PER_SEGMENT],
                                    slots[b] % PER_SEGMENT * KARST_COLOUR_BRICK_BYTES, words, KARST_COLOUR_BRICK_BYTES,
                                    &error));
        for (int i = 0; i < KARST_BRICK_SAMPLES; i++) {
            karst_position at = sample_place(&loads[b], i);
            float own[4];
            karst_edit_list_colour(list, &at, loads[b].level, world[b * STRIDE + i], own);
            uint32_t expected = (uint32_t)colour_pack(own[0], own[1], own[2], own[3]);
            num_covered += expected != 0;
            if (words[i] != expected)
                fail_msg("colour %d of brick %d: %08x, the host has %08x", i, b, words[i], expected);
        }
    }
    assert_true(num_coloured > NUM_BRICKS / 4 && num_covered > 5000);
    karst_colour_step_destroy(step);
    karst_colours_destroy(colours);
    karst_buffer_destroy(work.load_slots);
    karst_buffer_destroy(work.load_results);
    karst_buffer_destroy(staging);
    free(again);
    free(words);
}

/* Bricks near edits on a device, in a shape, against the host's densities. */
static void compare_bits(int lanes, karst_shape shape)
{
    karst_context *context;
    karst_layer *layer;
    assert_ok(context = karst_context_create(NULL, lanes, NULL, &error));
    assert_ok(layer = karst_edits_create(context, shape, VOXEL_LOG2_M, &error));
    random_state = 4;
    const int64_t around[3] = {((int64_t)1 << 50) + 12345, -977, 1000003};
    karst_edit edits[150];
    for (int i = 0; i < 150; i++)
        edits[i] = random_edit(around, 300);
    assert_ok(karst_edits_append(layer, edits, 150, &error));
    const karst_edit_list *list = karst_edits_list(layer);

    karst_load loads[NUM_BRICKS];
    const uint32_t stride = KARST_BRICK_PADDED;
    float *world = malloc(sizeof(float) * NUM_BRICKS * stride), *made = malloc(sizeof(float) * NUM_BRICKS * stride);
    for (int b = 0; b < NUM_BRICKS; b++) {
        int level = b % 8;
        loads[b] = (karst_load){.level = level, .state = KARST_STATE_UNKNOWN, .doubt = 1};
        for (int a = 0; a < 3; a++)
            loads[b].origin[a] = karst_node_origin(
                (around[a] + random_between(-150, 150)) >> (level + KARST_BRICK_CELLS_LOG2), level);
    }
    for (uint32_t i = 0; i < NUM_BRICKS * stride; i++)
        world[i] = (float)((random_unit() - 0.5) * 20);
    karst_buffer *of_loads = buffer(context, sizeof loads, loads),
                 *staging = buffer(context, sizeof(float) * NUM_BRICKS * stride, world);
    assert_ok(layer->ops->evaluate(layer, of_loads, NUM_BRICKS, staging, stride, NULL, &error));
    assert_ok(layer->ops->bound_loads(layer, of_loads, NUM_BRICKS, &error));
    assert_ok(karst_buffer_read(staging, 0, made, sizeof(float) * NUM_BRICKS * stride, &error));
    karst_load after[NUM_BRICKS];
    assert_ok(karst_buffer_read(of_loads, 0, after, sizeof after, &error));
    int num_changed = 0;
    for (int b = 0; b < NUM_BRICKS; b++) {
        for (int i = 0; i < (int)stride; i++) {
            float expected = world[b * (int)stride + i];
            if (i < KARST_BRICK_SAMPLES) {
                karst_position at = sample_place(&loads[b], i);
                expected = karst_edit_list_density(list, &at, loads[b].level, expected);
            }
            num_changed += expected != world[b * (int)stride + i];
            if (memcmp(&expected, &made[b * (int)stride + i], 4) != 0)
                fail_msg("%d lanes: sample %d of brick %d: %a, the host has %a", lanes, i, b,
                         (double)made[b * (int)stride + i], (double)expected);
        }
        assert_int_equal(after[b].state,
                         edits_node_state(list->data, KARST_STATE_UNKNOWN, loads[b].origin, loads[b].level));
        assert_true(edits_touch(list->data, loads[b].origin, loads[b].level, EDITS_OF_LAND) ? isinf(after[b].doubt)
                                                                             : after[b].doubt == 1);
    }
    assert_true(num_changed > 10000);
    compare_colours(context, shape, layer, of_loads, loads, world, made);
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

static void bad_edits_change_nothing(void **state)
{
    (void)state;
    const karst_edit good = {.radius_m = 2};
    const struct {
        const char *what;
        karst_edit edit;
    } bad[] = {
        {"radius", {.radius_m = 0}},
        {"radius", {.radius_m = NAN}},
        {"radius", {.radius_m = INFINITY}},
        {"radius", {.radius_m = -1}},
        {"blend", {.radius_m = 1, .blend_m = NAN}},
        {"sides", {.shape = KARST_EDIT_BOX, .half_m = {1, 0, 1}}},
        {"normal", {.shape = KARST_EDIT_PLANE, .normal = {NAN, 1, 0}}},
        {"other end", {.shape = KARST_EDIT_CAPSULE, .radius_m = 1, .to_m = {INFINITY, 0, 0}}},
        {"2^61", {.radius_m = 1, .at = {{(int64_t)3 << 60, 0, 0}, {0}}}},
        {"amplitude", {.shape = KARST_EDIT_NOISE, .radius_m = 1, .amplitude_m = 2, .scale_m = 1}},
        {"scale", {.shape = KARST_EDIT_NOISE, .radius_m = 1, .amplitude_m = 1, .scale_m = 0}},
        {"shape or mode", {.shape = (karst_edit_shape)77, .radius_m = 1}},
        {"flatten", {.shape = KARST_EDIT_PLANE, .mode = KARST_EDIT_FLATTEN}},
        {"smooth takes", {.shape = KARST_EDIT_BOX, .mode = KARST_EDIT_SMOOTH, .half_m = {1, 1, 1}, .strength = 1}},
        {"no blend", {.mode = KARST_EDIT_SMOOTH, .radius_m = 1, .strength = 1, .blend_m = 1}},
        {"strength", {.mode = KARST_EDIT_SMOOTH, .radius_m = 1}},
        {"strength", {.mode = KARST_EDIT_SMOOTH, .radius_m = 1, .strength = 1.5}},
        {"strength", {.mode = KARST_EDIT_SMOOTH, .radius_m = 1, .strength = NAN}},
        {"normal", {.mode = KARST_EDIT_SMOOTH, .radius_m = 1, .strength = 1, .normal = {0, INFINITY, 0}}},
        {"only what", {.mode = KARST_EDIT_SMOOTH, .radius_m = 1, .strength = 1, .has_colour = true}},
        {"paint takes a colour", {.radius_m = 1, .mode = KARST_EDIT_PAINT, .strength = 1}},
        {"the colour", {.radius_m = 1, .has_colour = true, .colour = {0, 1.5, 0}, .strength = 1}},
        {"the colour", {.radius_m = 1, .has_colour = true, .colour = {0, 0, NAN}, .strength = 1}},
        {"strength", {.radius_m = 1, .has_colour = true}},
        {"strength", {.radius_m = 1, .has_colour = true, .strength = INFINITY}},
        {"only what", {.radius_m = 1, .mode = KARST_EDIT_REMOVE, .has_colour = true, .strength = 1}},
    };
    karst_edit_list list;
    assert_ok(karst_edit_list_init(&list, VOXEL_LOG2_M, &error));
    assert_ok(karst_edit_list_append(&list, &good, 1, &error));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        const karst_edit both[] = {good, bad[i].edit};
        karst_error why = {0};
        assert_false(karst_edit_list_append(&list, both, 2, &why));
        assert_int_equal(why.status, KARST_USAGE);
        assert_non_null(strstr(why.message, "edit 2: "));
        assert_non_null(strstr(why.message, bad[i].what));
        assert_int_equal(karst_edit_list_num(&list), 1);
    }
    assert_false(karst_edit_list_append(&list, &good, (size_t)KARST_MAX_EDITS, &(karst_error){0}));
    karst_edit_list_finish(&list);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(proofs_hold),
        cmocka_unit_test(ranges_hold),
        cmocka_unit_test(values_are_those_of_the_second_implementation),
        cmocka_unit_test(the_index_finds_all),
        cmocka_unit_test(an_edit_takes_128_bytes_at_most),
        cmocka_unit_test(bits_are_the_same_everywhere),
        cmocka_unit_test(bad_edits_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
