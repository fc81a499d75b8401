/* Bounds of the worlds that Karst ships: over random boxes, from a part of a voxel to a million, near the camera and
 * far away, they hold what the tape gives at points inside, at every footprint that they speak for; and what the search
 * of producers/steps/refine.clh concludes from a box's linear form about its parts is true. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <glob.h>
#include <math.h>

#include "karst/position.h"
#include "producers/language/language.h"
#include "producers/language/oracle/oracle.h"
#include "producers/language/tape/tape.h"
#include "producers/density/world_file.h"
#include "tests/language/random_graph.h"

/* producers/steps/refine.clh, with rules to break */
enum broken { BREAK_NOTHING, BREAK_PARTS, BREAK_CORNERS, NUM_BROKEN };
static enum broken broken;
#define WORLD_MUTANT(rule) (broken == BREAK_##rule)
#define WORLD_HAS_DATA
#define TAPE_SLOTS 256
#include "producers/language/tape/bounds.clh"

enum { NUM_BOXES = 3000, NUM_SAMPLES = 20, NUM_WAYS = 80, TOP_LEVEL = 13 };

typedef struct {
    karst_program_graph *program;
    karst_world_layout layout;
    karst_tape tape;
    uint64_t *data;
    int *slots;
    int64_t camera[3]; /* level-0 voxel */
} world;

static void world_open(world *w, const char *path)
{
    bool ok;
    karst_error error = {0};
    w->program = karst_language_compile_file(path, NULL, 0, &ok, &error);
    if (!ok)
        fail_msg("%s: %s", path, error.message);
    assert_true(karst_world_layout_init(&w->layout, &w->program->world));
    assert_true(karst_tape_build(&w->layout, &w->program->world.root[KARST_ROOT_DENSITY], 1, &w->tape, &error));
    karst_number *values = calloc(w->program->num_parameters + 1, sizeof *values);
    for (uint32_t i = 0; i < w->program->num_parameters; i++)
        values[i] = w->program->parameters[i].value;
    w->data = calloc(w->layout.num_words, sizeof *w->data);
    assert_true(
        karst_world_data_fill(&w->layout, values, w->program->header.seed, w->program->header.voxel_log2_m, w->data));
    free(values);
    w->slots = calloc((size_t)w->tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *w->slots);
    const char *const *at = w->program->header.camera_position;
    for (int axis = 0; axis < 3; axis++) {
        uint32_t fraction;
        const char *text = w->program->header.has_camera ? at[axis] : "0";
        assert_true(karst_coordinate_parse(text, w->program->header.voxel_log2_m, &w->camera[axis], &fraction, NULL));
    }
}

static void world_close(world *w)
{
    free(w->slots);
    free(w->data);
    karst_tape_finish(&w->tape);
    karst_program_graph_destroy(w->program);
}

static tape_program program_of(const world *w)
{
    return (tape_program){.code = w->tape.code,
                          .num_instructions = w->tape.num_instructions,
                          .constants = w->tape.constants,
                          .data = w->data,
                          .values = (const uint *)(w->data + w->layout.values_word),
                          .num_values = w->layout.num_values,
                          .slots = w->slots};
}

/* A box of 2^level voxels times 16, about where the camera is, or anywhere. */
static op_box random_box(const world *w)
{
    op_box box = {.level = (int)random_below(16) - 1};
    double spread = random_magnitude(1, 1e5), radius = box.level < 0 ? random_magnitude(1e-3, 10) : ldexp(8, box.level);
    double far = random_chance(4) ? 1e9 : random_chance(8) ? 1e12 : 0;
    for (int axis = 0; axis < 3; axis++) {
        box.centre.voxel[axis] = w->camera[axis] + (int64_t)((2 * random_unit() - 1) * spread + (axis == 1 ? 0 : far));
        box.radius[axis] = (float)radius;
    }
    return box;
}

static affine_position random_place_in(const op_box *box)
{
    affine_position at;
    for (int axis = 0; axis < 3; axis++) {
        int64_t most = (int64_t)((double)box->radius[axis] * 0x1p32);
        int64_t offset =
            random_chance(3) ? (random_chance(2) ? most : -most) : (int64_t)((random_unit() * 2 - 1) * (double)most);
        at.voxel[axis] = box->centre.voxel[axis] + (offset >> 32);
        at.fraction[axis] = (uint32_t)offset;
    }
    return at;
}

static void check_world(const char *path)
{
    world w;
    int num_known = 0, num_decided = 0, num_told = 0;
    world_open(&w, path);
    tape_program program = program_of(&w);
    random_state = 99;
    for (int n = 0; n < NUM_BOXES; n++) {
        op_box box = random_box(&w);
        if (tape_bounds(&program, &box, NULL))
            continue;
        op_bound b = tape_load_bound(&program, w.tape.output[0]);
        num_known++;
        num_decided += b.v.lo > 0 || b.v.hi < 0;
        for (int k = 0; k < NUM_SAMPLES; k++) {
            affine_position at = random_place_in(&box);
            int level = box.level < 0 ? -1 : (int)random_below((uint32_t)box.level + 3) - 1;
            tape_values(&program, &at, NULL, level);
            float value = k_as_float((uint)tape_load(&program, w.tape.output[0]));
            if (!(value >= b.v.lo && value <= b.v.hi))
                fail_msg("%s: at %ld, %ld, %ld, level %d of a box of level %d: %.9g is not in [%.9g, %.9g]", path,
                         at.voxel[0], at.voxel[1], at.voxel[2], level, box.level, (double)value, (double)b.v.lo,
                         (double)b.v.hi);
            /* what a sample of the box's own footprint says of it */
            affine_position sample = random_place_in(&box);
            tape_values(&program, &sample, NULL, box.level);
            float there = k_as_float((uint)tape_load(&program, w.tape.output[0]));
            double apart = (double)b.d + ((double)b.r.hi - (double)b.r.lo);
            for (int axis = 0; axis < 3; axis++) {
                double delta = (double)(at.voxel[axis] - sample.voxel[axis]) +
                               ((double)at.fraction[axis] - (double)sample.fraction[axis]) * 0x1p-32;
                apart += fabs(delta) * fmax(fabs((double)b.g[axis].lo), fabs((double)b.g[axis].hi));
            }
            if (!(fabs((double)value - (double)there) <= apart))
                fail_msg("%s: at %ld, %ld, %ld, level %d of a box of level %d: %.9g and a sample of %.9g are %g apart",
                         path, at.voxel[0], at.voxel[1], at.voxel[2], level, box.level, (double)value, (double)there,
                         apart);
            num_told += apart < fabs((double)there);
        }
    }
    print_message("%s: %d of %d boxes bounded, %d with one sign; %d of %d samples tell a point's sign\n", path,
                  num_known, NUM_BOXES, num_decided, num_told, num_known * NUM_SAMPLES);
    assert_true(num_known > NUM_BOXES / 2);
    world_close(&w);
}

static void test_shipped_worlds(void **state)
{
    (void)state;
    glob_t found;
    assert_int_equal(glob("demos/worlds/*.karst", 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++)
        check_world(found.gl_pathv[i]);
    globfree(&found);
}

/* What floats lack of the oracle's doubles is no more than what the bounds of the very point compute as their error. */
static void check_error(const char *path)
{
    enum { NUM_POINTS = 2000 };
    world w;
    karst_error error = {0};
    double log_sum = 0, nearest = 0;
    int num_inexact = 0, num_full = 0;
    world_open(&w, path);
    karst_number *values = calloc(w.program->num_parameters + 1, sizeof *values);
    for (uint32_t i = 0; i < w.program->num_parameters; i++)
        values[i] = w.program->parameters[i].value;
    karst_oracle *oracle =
        karst_oracle_create(&w.program->world, values, w.program->header.seed, w.program->header.voxel_log2_m, &error);
    assert_non_null(oracle);
    tape_program program = program_of(&w);
    random_state = 7;
    for (int n = 0; n < NUM_POINTS; n++) {
        op_box box = random_box(&w);
        karst_position at;
        if (n % 4) /* else the error is also that of another footprint, and much larger */
            box.level = -1;
        for (int axis = 0; axis < 3; axis++) {
            box.radius[axis] = 0;
            box.centre.fraction[axis] = n % 2 ? random_bits() : 0;
            at.voxel[axis] = box.centre.voxel[axis];
            at.fraction[axis] = box.centre.fraction[axis];
        }
        num_full += box.level < 0;
        if (tape_bounds(&program, &box, NULL))
            fail_msg("%s: the bounds of a point are not known", path);
        double allowed = (double)tape_load_bound(&program, w.tape.output[0]).d;
        karst_oracle_value value = karst_oracle_density(oracle, &at, box.level);
        double off = fabs((double)value.device - value.precise);
        if (!(off <= allowed))
            fail_msg("%s: at %ld, %ld, %ld, level %d: %.12g as float, %.12g as double, are more than %g apart", path,
                     at.voxel[0], at.voxel[1], at.voxel[2], box.level, (double)value.device, value.precise, allowed);
        if (off > 0 && box.level < 0) {
            num_inexact++;
            log_sum += log2(allowed / off);
            nearest = fmax(nearest, off / allowed);
        }
    }
    print_message(
        "%s: %d of %d points inexact at full detail, by 2^-%.1f of what is allowed (geometric mean), %.3f at most\n",
        path, num_inexact, num_full, num_inexact ? log_sum / num_inexact : 0, nearest);
    assert_true(num_inexact > 500); /* or floats had nothing to be wrong about */
    karst_oracle_destroy(oracle);
    free(values);
    world_close(&w);
}

static void test_floats_are_as_good_as_their_error_says(void **state)
{
    (void)state;
    glob_t found;
    assert_int_equal(glob("demos/worlds/*.karst", 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++)
        check_error(found.gl_pathv[i]);
    globfree(&found);
}

/* ---- what is concluded from linear forms ---- */

typedef struct {
    karst_world_file *file;
    void *data;
    tape_program program;
    int slots[TAPE_SLOTS * TAPE_BOUND_ELEMENTS];
    uint output;
} searched_world;

static float density_at(const searched_world *w, const affine_position *at, int level)
{
    tape_values(&w->program, at, NULL, level);
    return k_as_float((uint)tape_load(&w->program, w->output));
}

/* A point of a node whose lower corner is `corner` and which is `side` voxels wide; `x`, `y`, `z`: where in it, in
 * sixteenths of the side. */
static affine_position place_in(const long corner[3], long side, int x, int y, int z)
{
    const long step = side / 16;
    return (affine_position){.voxel = {corner[0] + x * step, corner[1] + y * step, corner[2] + z * step}};
}

/* False if something that a form says of a node is not so. `is_open`: its bounds alone do not decide it. Counts
 * parts told, and nodes that are given up at once. */
static bool form_holds(const searched_world *w, const long corner[3], int level, bool *is_open, int told[2])
{
    const long side = 16l << level;
    world_box box;
    world_bound bound;
    world_box_part(corner[0], corner[1], corner[2], level, 0, 0, WORLD_REFINE_DEPTH, &box);
    world_box_bounds(w->data, &box, &bound);
    *is_open = world_undecided(bound.lo, bound.hi);
    if (!*is_open)
        return true;
    world_parts parts = world_parts_of(&box, &bound);
    int footprint = (int)random_below((uint32_t)level + 3) - 1;
    bool seen[2] = {false, false};
    for (int i = 0; i < 8; i++) {
        int octant = i ^ parts.flip, low[3] = {8 * (octant & 1), 8 * (octant >> 1 & 1), 8 * (octant >> 2)};
        for (int k = 0; k < 3; k++) { /* its middle, the node's corner, anything */
            affine_position at = k == 0   ? place_in(corner, side, low[0] + 4, low[1] + 4, low[2] + 4)
                                 : k == 1 ? place_in(corner, side, 2 * low[0], 2 * low[1], 2 * low[2])
                                          : place_in(corner, side, low[0] + (int)random_below(9),
                                                     low[1] + (int)random_below(9), low[2] + (int)random_below(9));
            float d = density_at(w, &at, footprint);
            seen[d > 0] = true;
            if (!(parts.open >> i & 1) && !(d >= parts.hull.lo && d <= parts.hull.hi))
                return false;
        }
        told[0] += !(parts.open >> i & 1);
    }
    if (parts.signs != (WORLD_IS_SOLID | WORLD_IS_AIR))
        return true;
    told[1]++;
    return seen[0] && seen[1];
}

/* How many nodes of a world have a form that says what is not so. */
static int count_lies(const char *path, int told[2])
{
    static searched_world w;
    karst_error error = {0};
    w.file = karst_world_file_open(path, NULL, 0, NULL, &error);
    w.data = w.file ? karst_world_file_data(w.file, w.file->info.seed, &error) : NULL;
    if (!w.data)
        fail_msg("%s: %s", path, error.message);
    assert_true(w.file->tape.num_slots <= TAPE_SLOTS);
    const karst_data_header *data_header = w.data;
    w.program = (tape_program){.code = w.file->tape.code,
                               .num_instructions = w.file->tape.num_instructions,
                               .constants = w.file->tape.constants,
                               .data = w.data,
                               .values = (const uint *)((const ulong *)w.data + data_header->values),
                               .num_values = w.file->layout.num_values,
                               .slots = w.slots};
    w.output = w.file->tape.output[0];
    const karst_world_header *header = &w.file->program->header;
    random_state = 5;
    int lies = 0;
    for (int n = 0; n < NUM_WAYS; n++) { /* down from about the camera, by children that are not decided */
        int64_t node[3];
        uint32_t fraction;
        for (int axis = 0; axis < 3; axis++) {
            const char *at = header->has_camera ? header->camera_position[axis] : "0";
            assert_true(karst_coordinate_parse(at, header->voxel_log2_m, &node[axis], &fraction, NULL));
            node[axis] >>= TOP_LEVEL + 4;
        }
        for (int level = TOP_LEVEL - 1, tries = 0; level >= 0 && tries < 16; tries++) {
            long child[3], corner[3];
            for (int axis = 0; axis < 3; axis++) {
                child[axis] = 2 * node[axis] + (long)random_below(2);
                corner[axis] = child[axis] * (16l << level);
            }
            bool is_open;
            lies += !form_holds(&w, corner, level, &is_open, told);
            if (is_open) {
                memcpy(node, child, sizeof node);
                level--;
                tries = 0;
            }
        }
    }
    free(w.data);
    karst_world_file_destroy(w.file);
    return lies;
}

static void test_linear_forms_tell_the_truth(void **state)
{
    (void)state;
    glob_t found;
    assert_int_equal(glob("demos/worlds/*.karst", 0, NULL, &found), 0);
    int all_told[2] = {0, 0};
    for (size_t i = 0; i < found.gl_pathc; i++) {
        int told[2] = {0, 0}, lies = count_lies(found.gl_pathv[i], told);
        print_message("%s: %d parts told, %d nodes given up at once\n", found.gl_pathv[i], told[0], told[1]);
        if (lies)
            fail_msg("%s: the forms of %d nodes say what is not so", found.gl_pathv[i], lies);
        all_told[0] += told[0];
        all_told[1] += told[1];
    }
    assert_true(all_told[0] > 1000 && all_told[1] > 50);
    for (broken = BREAK_NOTHING + 1; broken < NUM_BROKEN; broken++) {
        int told[2] = {0, 0}, lies = 0;
        for (size_t i = 0; i < found.gl_pathc && lies == 0; i++)
            lies = count_lies(found.gl_pathv[i], told);
        if (lies == 0)
            fail_msg("rule %d can be broken, and nobody notices", (int)broken);
    }
    broken = BREAK_NOTHING;
    globfree(&found);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shipped_worlds),
        cmocka_unit_test(test_floats_are_as_good_as_their_error_says),
        cmocka_unit_test(test_linear_forms_tell_the_truth),
    };
    return cmocka_run_group_tests_name("bounds of worlds", tests, NULL, NULL);
}
