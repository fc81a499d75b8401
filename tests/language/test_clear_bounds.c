/* Bounds of clear matter, of its index of refraction and of the index's gradient: over random boxes they hold what the
 * tape gives at places inside, at every footprint that they speak for; and where an index has no jump, its values are
 * no farther apart than the bounds of its gradient allow. Shipped worlds that have them, and texts of all kinds. Rules
 * of bounds that such texts need are broken one by one. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <glob.h>

/* Rules that bounds of bodies and of their index rest on. */
#define RULES(X) X(ADD) X(MULTIPLY) X(MIN) X(MAX) X(ABS) X(LENGTH) X(SQUARE) X(DIVIDE) X(SQRT) X(SELECT) X(JUMP)
#define NAME(rule) BREAK_##rule,
#define TEXT(rule) #rule,
enum broken { BREAK_NOTHING, RULES(NAME) NUM_RULES };
static enum broken broken;
#define BOUNDS_MUTANT(rule) (broken != BREAK_NOTHING && strcmp(#rule, rule_names[broken]) == 0)
static const char *const rule_names[NUM_RULES] = {"nothing", RULES(TEXT)};

#include "producers/density/world_file.h"
#include "producers/language/graph/derive.h"
#include "producers/language/language.h"
#include "producers/language/tape/tape.h"
#include "tests/language/random_graph.h"

#include "producers/language/tape/bounds_shared.h"
#include "producers/language/tape/tape.clh"
#include "producers/language/tape/tape_bounds.clh"

enum { NUM_BOXES = 1500, NUM_PLACES = 12, MOST_ROOTS = 4 };

/* What is looked at of a world: one function, or one with its gradient. */
typedef struct {
    karst_world_layout layout;
    karst_tape tape;
    uint64_t *data;
    int *slots;
    uint32_t num_roots;
    int64_t camera[3]; /* level-0 voxel */
    double voxel_m;
} looked_at;

static void open_function(looked_at *w, const karst_program_graph *program, const karst_resolved_world *world,
                          const karst_expr *roots, uint32_t num_roots)
{
    karst_error error = {0};
    *w = (looked_at){.num_roots = num_roots, .voxel_m = ldexp(1, program->header.voxel_log2_m)};
    assert_true(karst_world_layout_init(&w->layout, world));
    if (!karst_tape_build(&w->layout, roots, num_roots, &w->tape, &error))
        fail_msg("%s", error.message);
    karst_number *values = calloc(program->num_parameters + 1, sizeof *values);
    for (uint32_t i = 0; i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    w->data = calloc(w->layout.num_words, sizeof *w->data);
    assert_true(
        karst_world_data_fill(&w->layout, values, program->header.seed, program->header.voxel_log2_m, w->data));
    free(values);
    w->slots = calloc((size_t)w->tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *w->slots);
    for (int axis = 0; axis < 3; axis++) {
        uint32_t fraction;
        const char *text = program->header.has_camera ? program->header.camera_position[axis] : "0";
        assert_true(karst_coordinate_parse(text, program->header.voxel_log2_m, &w->camera[axis], &fraction, NULL));
    }
}

static void close_function(looked_at *w)
{
    free(w->slots);
    free(w->data);
    karst_tape_finish(&w->tape);
}

static tape_program program_of(const looked_at *w)
{
    return (tape_program){.code = w->tape.code,
                          .num_instructions = w->tape.num_instructions,
                          .constants = w->tape.constants,
                          .data = w->data,
                          .values = (const uint *)(w->data + w->layout.values_word),
                          .num_values = w->layout.num_values,
                          .slots = w->slots};
}

/* A node about where the camera looks, or far away; small ones more often. */
static op_box random_box(const looked_at *w)
{
    op_box box = {.level = (int)random_below(12) - 1};
    const double metre = 1 / w->voxel_m, spread = random_magnitude(0.3, 60) * metre;
    const double far = random_chance(6) ? 1e9 * metre : 0;
    for (int axis = 0; axis < 3; axis++) {
        const double middle = random_chance(2) ? (double)w->camera[axis] : 0;
        box.centre.voxel[axis] = (int64_t)(middle + (2 * random_unit() - 1) * spread + (axis == 1 ? 0 : far));
        box.radius[axis] = (float)(box.level < 0 ? random_magnitude(1e-2, 10) : ldexp(8, box.level));
    }
    return box;
}

static affine_position random_place_in(const op_box *box)
{
    affine_position at;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t most = (int64_t)((double)box->radius[axis] * 0x1p32);
        const int64_t offset =
            random_chance(3) ? (random_chance(2) ? most : -most) : (int64_t)((random_unit() * 2 - 1) * (double)most);
        at.voxel[axis] = box->centre.voxel[axis] + (offset >> 32);
        at.fraction[axis] = (uint32_t)offset;
    }
    return at;
}

/* Values of all roots at a place. */
static void values_at(const looked_at *w, tape_program *program, const affine_position *at, int level,
                      float values[MOST_ROOTS])
{
    tape_values(program, at, NULL, level);
    for (uint32_t i = 0; i < w->num_roots; i++)
        values[i] = k_as_float((uint)tape_load(program, w->tape.output[i]));
}

typedef struct {
    int num_known, num_decided, num_lies, num_apart;
} findings;

/* With four roots the last three are the gradient of the first, per metre. is_smooth: it has no jump. */
static findings look_at(const looked_at *w, bool is_smooth, int num_boxes)
{
    findings f = {0};
    tape_program program = program_of(w);
    random_state = 31;
    for (int n = 0; n < num_boxes; n++) {
        const op_box box = random_box(w);
        op_bound bounds[MOST_ROOTS];
        if (tape_bounds(&program, &box, NULL))
            continue;
        for (uint32_t i = 0; i < w->num_roots; i++)
            bounds[i] = tape_load_bound(&program, w->tape.output[i]);
        f.num_known++;
        f.num_decided += bounds[0].v.lo > 0 || bounds[0].v.hi < 0;
        affine_position last = {.voxel = {0}};
        float last_values[MOST_ROOTS] = {0};
        const int one_level = box.level; /* two values are compared at the box's own footprint */
        for (int k = 0; k < NUM_PLACES; k++) {
            const affine_position at = random_place_in(&box);
            const int level = box.level < 0 ? -1 : (int)random_below((uint32_t)box.level + 2) - 1;
            float values[MOST_ROOTS];
            values_at(w, &program, &at, level, values);
            for (uint32_t i = 0; i < w->num_roots; i++)
                f.num_lies += !(values[i] >= bounds[i].v.lo && values[i] <= bounds[i].v.hi);
            /* As samples prove by slopes: what a value says of others in the box. */
            values_at(w, &program, &at, one_level, values);
            double apart = (double)bounds[0].d + ((double)bounds[0].r.hi - (double)bounds[0].r.lo), steepest = 0;
            for (int axis = 0; k && axis < 3; axis++) {
                const double delta = fabs((double)(at.voxel[axis] - last.voxel[axis]) +
                                          ((double)at.fraction[axis] - (double)last.fraction[axis]) * 0x1p-32);
                apart += delta * fmax(fabs((double)bounds[0].g[axis].lo), fabs((double)bounds[0].g[axis].hi));
                if (w->num_roots > 1)
                    steepest += delta * w->voxel_m *
                                fmax(fabs((double)bounds[1 + axis].v.lo), fabs((double)bounds[1 + axis].v.hi));
            }
            const double change = k ? fabs((double)values[0] - (double)last_values[0]) : 0;
            f.num_lies += k && !(change <= apart);
            f.num_apart += k && w->num_roots > 1 && is_smooth &&
                           !(change <= steepest * 1.0001 + 1e-5 * (1 + fabs((double)values[0])));
            last = at;
            memcpy(last_values, values, sizeof last_values);
        }
    }
    return f;
}

/* ---- the functions ---- */

static karst_program_graph *compile(const char *path, const char *text)
{
    karst_error error = {0};
    bool ok = false;
    karst_program_graph *program =
        text ? karst_language_compile(path, text, strlen(text), NULL, 0, &ok, &error)
             : karst_language_compile_file(path, NULL, 0, &ok, &error);
    if (!ok)
        fail_msg("%s: %s", path, error.message);
    return program;
}

static void say(const char *name, const char *what, const findings *f)
{
    print_message("%s, %s: %d boxes bounded, %d with one sign, %d lies, %d too far apart\n", name, what, f->num_known,
                  f->num_decided, f->num_lies, f->num_apart);
}

/* One of its functions as a density of its own, as it is executed. */
static karst_resolved_world world_of(const karst_resolved_world *world, int root)
{
    karst_resolved_world alone = {.graph = world->graph};
    for (int i = 0; i < KARST_NUM_ROOTS; i++)
        alone.root[i] = KARST_NO_EXPR;
    alone.root[KARST_ROOT_DENSITY] = world->root[root];
    return alone;
}

/* Sums over the functions that a program has; false: it has none. */
static bool look_at_program(const char *name, const karst_program_graph *program, bool is_smooth, int num_boxes,
                            bool says, findings *sum)
{
    const karst_resolved_world *world = &program->world;
    looked_at w;
    karst_error error = {0};
    if (world->root[KARST_ROOT_CLEAR] == KARST_NO_EXPR)
        return false;
    karst_resolved_world alone = world_of(world, KARST_ROOT_CLEAR);
    open_function(&w, program, &alone, &alone.root[KARST_ROOT_DENSITY], 1);
    findings f = look_at(&w, true, num_boxes);
    close_function(&w);
    if (says)
        say(name, "clear", &f);
    sum->num_known += f.num_known, sum->num_decided += f.num_decided, sum->num_lies += f.num_lies;
    if (world->root[KARST_ROOT_INDEX] == KARST_NO_EXPR)
        return true;
    alone = world_of(world, KARST_ROOT_INDEX);
    open_function(&w, program, &alone, &alone.root[KARST_ROOT_DENSITY], 1);
    f = look_at(&w, is_smooth, num_boxes);
    close_function(&w);
    if (says)
        say(name, "index", &f);
    sum->num_known += f.num_known, sum->num_lies += f.num_lies;
    karst_gradient_world *gradient = karst_derive(&alone, &error);
    if (!gradient)
        fail_msg("%s: %s", name, error.message);
    const karst_expr roots[MOST_ROOTS] = {gradient->world.root[KARST_ROOT_DENSITY], gradient->world.gradient[0],
                                          gradient->world.gradient[1], gradient->world.gradient[2]};
    open_function(&w, program, &gradient->world, roots, MOST_ROOTS);
    f = look_at(&w, is_smooth, num_boxes);
    close_function(&w);
    karst_gradient_world_destroy(gradient);
    if (says)
        say(name, "index and its gradient", &f);
    /* Of what jumps there is no bound of a gradient. */
    assert_true(!is_smooth || broken != BREAK_NOTHING || f.num_known > num_boxes / 2);
    sum->num_lies += f.num_lies, sum->num_apart += f.num_apart;
    /* But of each of its sides there is, wherever the jump lies. */
    gradient = karst_derive_sides(&alone, world->root[KARST_ROOT_CLEAR], &error);
    if (!gradient)
        fail_msg("%s: %s", name, error.message);
    const karst_expr sides[MOST_ROOTS] = {gradient->world.root[KARST_ROOT_DENSITY], gradient->world.gradient[0],
                                          gradient->world.gradient[1], gradient->world.gradient[2]};
    open_function(&w, program, &gradient->world, sides, MOST_ROOTS);
    f = look_at(&w, is_smooth, num_boxes);
    assert_true(gradient->world.text != KARST_NO_EXPR);
    close_function(&w);
    karst_gradient_world_destroy(gradient);
    if (says)
        say(name, "index and the gradient of its sides", &f);
    assert_true(broken != BREAK_NOTHING || f.num_known > num_boxes / 2);
    sum->num_lies += f.num_lies, sum->num_apart += f.num_apart;
    return true;
}

static void bounds_of_shipped_worlds_hold(void **state)
{
    (void)state;
    glob_t found;
    int num = 0;
    assert_int_equal(glob("demos/worlds/*.karst", 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++) {
        karst_program_graph *program = compile(found.gl_pathv[i], NULL);
        findings f = {0};
        if (look_at_program(found.gl_pathv[i], program, false, NUM_BOXES, true, &f)) {
            assert_int_equal(f.num_lies, 0);
            assert_true(f.num_known > NUM_BOXES / 2);
            num++;
        }
        karst_program_graph_destroy(program);
    }
    globfree(&found);
    assert_true(num >= 5);
}

#define HEAD "/*{ \"voxel\": 0.015625, \"camera\": { \"position\": [\"0\", \"0\", \"-4\"] } }*/\n" \
    "float density(vec3 p) { return -9.0 - p.y; }\n"
static const struct {
    const char *name;
    bool is_smooth; /* the index */
    const char *text;
} texts[] = {
    {"a lens", true, HEAD "float clear(vec3 p) { return 1.0 - length(p); }\n"
                          "float index(vec3 p) { return sqrt(max(2.0 - dot(p, p), 1.0)); }\n"},
    {"a fish-eye", true, HEAD "float clear(vec3 p) { return min(2.0 - length(p), length(p) - 0.3); }\n"
                              "float index(vec3 p) { return 3.0 / (1.0 + dot(p, p)); }\n"},
    {"waves", true, HEAD "float clear(vec3 p) { return 0.3 * sin(p.x) * sin(0.7 * p.z) - p.y; }\n"
                         "float index(vec3 p) { return 1.3 + 0.02 * sin(2.0 * p.x + p.y) + 0.01 * abs(p.z); }\n"},
    {"noise", true, HEAD "float clear(vec3 p) { return fbm(p / 8.0, 4) - 0.1 * p.y; }\n"
                         "float index(vec3 p) { return 1.4 + 0.1 * noise(p / 3.0); }\n"},
    {"a core that jumps", false, HEAD "float clear(vec3 p) { return 1.5 - max(abs(p.x), max(abs(p.y), abs(p.z))); }\n"
                                      "float index(vec3 p) { return dot(p, p) < 0.25 ? 1.0 : 1.5; }\n"},
    {"layers", false, HEAD "float clear(vec3 p) { return p.y < 0.0 ? 1.0 : 0.5 - p.y; }\n"
                           "float index(vec3 p) { return 1.2 + 0.1 * floor(2.0 * p.y) * step(0.0, p.x); }\n"},
    {"a corner and steps", true,
     HEAD "float clear(vec3 p) { return min(0.3 * p.x, max(2.0 * p.y, 1.0 - floor(3.0 * p.z))); }\n"
          "float index(vec3 p) { return 1.3 + 0.1 * min(0.3 * p.x, max(2.0 * p.y, p.z)); }\n"},
    {"balls again and again", true, HEAD "float clear(vec3 p) { return 0.8 - length(mod(p, 2.0) - 1.0); }\n"
                                         "float index(vec3 p) { return 1.33; }\n"}};
enum { NUM_TEXTS = sizeof texts / sizeof *texts };

static findings look_at_texts(int num_boxes, bool says)
{
    findings sum = {0};
    for (int i = 0; i < NUM_TEXTS; i++) {
        karst_program_graph *program = compile(texts[i].name, texts[i].text);
        assert_true(look_at_program(texts[i].name, program, texts[i].is_smooth, num_boxes, says, &sum));
        karst_program_graph_destroy(program);
    }
    return sum;
}

static void bounds_of_texts_hold(void **state)
{
    (void)state;
    const findings f = look_at_texts(NUM_BOXES, true);
    assert_int_equal(f.num_lies, 0);
    assert_int_equal(f.num_apart, 0);
    assert_true(f.num_decided > NUM_BOXES);
}

static void every_rule_is_needed(void **state)
{
    (void)state;
    int num_missed = 0;
    for (broken = BREAK_NOTHING + 1; broken < NUM_RULES; broken++) {
        const findings f = look_at_texts(NUM_BOXES / 5, false);
        print_message("without the rule %s: %d lies, %d too far apart\n", rule_names[broken], f.num_lies, f.num_apart);
        num_missed += f.num_lies + f.num_apart == 0;
    }
    broken = BREAK_NOTHING;
    assert_int_equal(num_missed, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounds_of_shipped_worlds_hold),
        cmocka_unit_test(bounds_of_texts_hold),
        cmocka_unit_test(every_rule_is_needed),
    };
    return cmocka_run_group_tests_name("bounds of clear matter", tests, NULL, NULL);
}
