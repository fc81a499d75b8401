/* The derived gradient: against finite differences of the double oracle for every built-in, shipped and pasted world
 * and random graphs; at ties and jumps as it says; and the same bits from tape and oracle. */
#include "tests/language/world_text.h"

#include <glob.h>

#include "producers/language/graph/derive.h"
#include "producers/language/oracle/oracle_internal.h"
#include "producers/language/tape/tape.clh"
#include "tests/language/built_ins.h"
#include "tests/language/random_graph.h"

enum { WORLD_SEED = 7 };

typedef struct {
    karst_gradient_world *world;
    karst_oracle *oracle;
    int voxel_log2_m;
    karst_number parameters[KARST_HEADER_MAX_PARAMETERS + 16];
} derived;

static derived derive_world(const karst_resolved_world *world, const karst_number *parameters, uint32_t num_parameters,
                            uint32_t seed, int voxel_log2_m)
{
    karst_error error = {0};
    const char *fault = NULL;
    derived d = {.world = karst_derive(world, &error), .voxel_log2_m = voxel_log2_m};
    if (!d.world)
        fail_msg("%s", error.message);
    if (!karst_graph_check(&d.world->graph, &fault))
        fail_msg("%s", fault);
    memcpy(d.parameters, parameters, num_parameters * sizeof *parameters);
    d.oracle = karst_oracle_create(&d.world->world, d.parameters, seed, voxel_log2_m, &error);
    assert_non_null(d.oracle);
    return d;
}

static derived derive_program(const karst_program_graph *program)
{
    karst_number values[KARST_HEADER_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < program->num_parameters; i++)
        values[i] = program->parameters[i].value;
    return derive_world(&program->world, values, program->num_parameters, program->header.seed,
                        program->header.voxel_log2_m);
}

static void derived_finish(derived *d)
{
    karst_oracle_destroy(d->oracle);
    karst_gradient_world_destroy(d->world);
}

/* ---- finite differences ---- */

/* The position moved by so many 2^-32 voxels along an axis. */
static karst_position moved_by(karst_position at, int axis, int64_t parts)
{
    int64_t sum = (int64_t)at.fraction[axis] + parts;
    at.voxel[axis] += sum >> 32;
    at.fraction[axis] = (uint32_t)sum;
    return at;
}

static double density_moved(const derived *d, const karst_position *at, int axis, int64_t parts, int level)
{
    karst_position there = moved_by(*at, axis, parts);
    return karst_oracle_precise_density(d->oracle, &there, level);
}

/* Of fourth order, with steps of 2^parts_log2 of those; per metre. */
static double difference(const derived *d, const karst_position *at, int axis, int parts_log2, int level)
{
    int64_t h = (int64_t)1 << parts_log2;
    double inner = density_moved(d, at, axis, h, level) - density_moved(d, at, axis, -h, level);
    double outer = density_moved(d, at, axis, 2 * h, level) - density_moved(d, at, axis, -2 * h, level);
    return (8 * inner - outer) / 12 / ldexp(1, parts_log2 - 32 + d->voxel_log2_m);
}

typedef struct {
    int num_compared, num_rough; /* rough: differences of several steps do not agree, so they prove nothing */
    int num_wrong, max_wrong;    /* more are a failure */
} tally;

/* `within`: allowed difference, relative to what is larger, 1 or the slope. Steps are halved until three agree; if none
 * do, there is a kink, a jump or too much detail. */
static void compare(const derived *d, const karst_position *at, int parts_log2, int level, double within,
                    const char *what, tally *t)
{
    karst_oracle_value gradient[3];
    karst_oracle_gradient(d->oracle, at, level, gradient);
    for (int axis = 0; axis < 3; axis++) {
        double a = difference(d, at, axis, parts_log2, level), b = a;
        int num_agreeing = 1;
        for (int halved = 1; halved < 8 && num_agreeing < 3; halved++) {
            a = b;
            b = difference(d, at, axis, parts_log2 - halved, level);
            num_agreeing = fabs(a - b) < 0.25 * within * fmax(fabs(b), 1) ? num_agreeing + 1 : 1;
        }
        if (num_agreeing < 3) {
            t->num_rough++;
            continue;
        }
        t->num_compared++;
        if (!(fabs(gradient[axis].precise - b) <= within * fmax(fabs(b), 1)) && ++t->num_wrong > t->max_wrong)
            fail_msg("%s: at %ld, %ld, %ld along %c it is %.12g, differences give %.12g", what, at->voxel[0],
                     at->voxel[1], at->voxel[2], "xyz"[axis], gradient[axis].precise, b);
    }
}

/* ---- built-ins ---- */

/* Places at which an expression is looked at; some lie on what is negative, some on what is not. */
static void compare_at_places(const derived *d, const text_world *w, const char *what, tally *t)
{
    random_state = 5;
    for (int i = 0; i < 24; i++) {
        double x = i ? 3 * random_unit() - 1 : 0.37, y = i ? 3 * random_unit() - 1 : 0.61,
               z = i ? 3 * random_unit() - 1.5 : -0.23;
        karst_position at = position_at(w, x, y, z);
        compare(d, &at, 26, -1, 2e-6, what, t);
    }
}

static void test_built_ins(void **state)
{
    (void)state;
    for (size_t i = 0; i < NUM_BUILT_INS; i++) {
        char body[512];
        tally t = {0};
        snprintf(body, sizeof body, "return %s;", built_ins[i]);
        text_world w = world_from_body(body);
        derived d = derive_program(w.program);
        compare_at_places(&d, &w, built_ins[i], &t);
        if (t.num_compared < 36)
            fail_msg("%s: only %d of %d differences are smooth", built_ins[i], t.num_compared,
                     t.num_compared + t.num_rough);
        derived_finish(&d);
        world_finish(&w);
    }
}

/* Where a float is not enough: pairs, whose slopes are floats. */
static void test_wide(void **state)
{
    (void)state;
    const char *const texts[] = {
        "length(p) - 6371000.0 + 20.0 * noise(p / 50.0)",
        "max(length(p) - 6371000.0, 6370000.0 - length(p.xz))",
        "dot(p, p) * 1e-7 - 4058964.1",
        "mix(length(p), length(p.xz), 0.25) - 6371000.0",
        "abs(sqrt(p.x * p.x + p.y * p.y) - 6371000.0) - 3.0",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        char body[512];
        tally t = {0};
        snprintf(body, sizeof body, "return %s;", texts[i]);
        text_world w = world_from_body(body);
        derived d = derive_program(w.program);
        bool is_wide = false;
        for (karst_expr e = 1; e < d.world->graph.num_nodes; e++)
            is_wide |= d.world->graph.nodes[e].kind == KARST_KIND_WIDE;
        assert_true(is_wide);
        random_state = 11;
        for (int k = 0; k < 20; k++) {
            double a = 6.28 * random_unit(), b = 2 * random_unit() - 1, r = 6371000.0 + 30 * random_unit();
            double c = sqrt(1 - b * b);
            karst_position at = position_at(&w, r * c * cos(a), r * c * sin(a), r * b);
            karst_oracle_value gradient[3];
            compare(&d, &at, 34, -1, 1e-5, texts[i], &t);
            karst_oracle_gradient(d.oracle, &at, -1, gradient);
            for (int axis = 0; axis < 3; axis++)
                assert_near((double)gradient[axis].device, gradient[axis].precise,
                            1e-5 * fmax(1, fabs(gradient[axis].precise)), texts[i]);
        }
        if (t.num_compared < 30)
            fail_msg("%s: only %d of %d differences are smooth", texts[i], t.num_compared,
                     t.num_compared + t.num_rough);
        derived_finish(&d);
        world_finish(&w);
    }
}

/* ---- ties and jumps ---- */

static void assert_gradient(const char *expression, double x, double y, double z, double gx, double gy, double gz)
{
    char body[512];
    snprintf(body, sizeof body, "return %s;", expression);
    text_world w = world_from_body(body);
    derived d = derive_program(w.program);
    karst_position at = position_at(&w, x, y, z);
    karst_oracle_value g[3];
    const double expected[3] = {gx, gy, gz};
    karst_oracle_value density = karst_oracle_gradient(d.oracle, &at, -1, g);
    assert_true(density.precise == karst_oracle_density(w.oracle, &at, -1).precise);
    for (int axis = 0; axis < 3; axis++) {
        assert_near(g[axis].precise, expected[axis], 1e-12, expression);
        assert_near((double)g[axis].device, expected[axis], 1e-6, expression);
    }
    derived_finish(&d);
    world_finish(&w);
}

static void test_ties_and_jumps(void **state)
{
    (void)state;
    assert_gradient("min(p.x, p.y)", 0.5, 0.5, 0, 1, 0, 0); /* b < a ? b : a */
    assert_gradient("min(p.y, p.x)", 0.5, 0.5, 0, 0, 1, 0);
    assert_gradient("max(p.x, p.y)", 0.5, 0.5, 0, 1, 0, 0);
    assert_gradient("abs(p.x)", 0, 0, 0, 1, 0, 0); /* a < 0 ? -a : a */
    assert_gradient("abs(p.x)", -1, 0, 0, -1, 0, 0);
    assert_gradient("p.x < p.y ? 2.0 * p.x : 5.0 * p.z", 0.5, 0.5, 0.5, 0, 0, 5);
    assert_gradient("p.x <= p.y ? 2.0 * p.x : 5.0 * p.z", 0.5, 0.5, 0.5, 2, 0, 0);
    assert_gradient("step(0.5, p.x)", 0.5, 0, 0, 0, 0, 0);
    assert_gradient("floor(p.x) + round(p.y) + ceil(p.z)", 1, 0.5, 2, 0, 0, 0);
    assert_gradient("fract(p.x)", 1, 0, 0, 1, 0, 0);
    assert_gradient("mod(p.x, 2.0)", 4, 0, 0, 1, 0, 0);
    assert_gradient("length(p)", 0, 0, 0, 0, 0, 0);
    assert_gradient("length(p.xy) + p.z", 0, 0, 1, 0, 0, 1);
    assert_gradient("sqrt(p.x)", 0, 0, 0, 0, 0, 0);
    assert_gradient("sqrt(p.x)", -1, 0, 0, 0, 0, 0);
    assert_gradient("log(p.x) + exp2(200.0 * p.y)", -1, 1, 0, 0, 0, 0); /* clamped */
    assert_gradient("atan(p.y, p.x)", 0, 0, 0, 0, 0, 0);
    assert_gradient("clamp(p.x, 0.0, 1.0)", 2, 0, 0, 0, 0, 0);
    assert_gradient("p.y < 0.0 ? 1.0 / p.x : p.z", 0, 1, 0, 0, 0, 1); /* what is not taken is no matter */
    assert_gradient("3.0", 1, 2, 3, 0, 0, 0);
    assert_gradient("noise(vec3(0.5, 0.25, 0.125)) + p.y", 1, 2, 3, 0, 1, 0);
}

/* ---- whole worlds ---- */

/* Folds ask for small steps; hills, high and with a lattice of 2^-32 cells, for large ones. */
static void compare_world(const char *path, int parts_log2, tally *t)
{
    size_t length;
    char *text = read_text(path, &length);
    text_world w = world_of(text, length, path);
    derived d = derive_program(w.program);
    karst_position camera = {{0}, {0}};
    const karst_world_header *h = &w.program->header;
    if (h->has_camera)
        assert_true(karst_position_parse(h->camera_position[0], h->camera_position[1], h->camera_position[2],
                                         h->voxel_log2_m, &camera, NULL));
    random_state = 3;
    for (int i = 0; i < 60; i++) {
        karst_position at = camera;
        for (int axis = 0; axis < 3; axis++)
            at.voxel[axis] += (int64_t)random_below(400) - 200, at.fraction[axis] = random_bits();
        karst_oracle_value g[3], density;
        int level = (int)random_below(6) - 1;
        density = karst_oracle_gradient(d.oracle, &at, level, g);
        karst_oracle_value plain = karst_oracle_density(w.oracle, &at, level);
        assert_true(k_as_uint(density.device) == k_as_uint(plain.device) && density.precise == plain.precise);
        compare(&d, &at, parts_log2, level, 1e-4, path, t);
    }
    derived_finish(&d);
    world_finish(&w);
    free(text);
}

static void compare_worlds(const char *pattern, int parts_log2)
{
    glob_t found;
    assert_int_equal(glob(pattern, 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++) {
        tally t = {.max_wrong = 3}; /* folds may lie closer than any step */
        compare_world(found.gl_pathv[i], parts_log2, &t);
        if (t.num_compared < 45)
            fail_msg("%s: only %d of %d differences are smooth", found.gl_pathv[i], t.num_compared,
                     t.num_compared + t.num_rough);
    }
    globfree(&found);
}

static void test_worlds(void **state)
{
    (void)state;
    compare_worlds("demos/worlds/*.karst", 32);
    compare_worlds("tests/language/pasted/*.karst", 24);
}

/* ---- random graphs ---- */

static float tape_value(const karst_world_layout *layout, const karst_tape *tape, const uint64_t *data, int *slots,
                        const karst_position *p, int level, uint32_t output)
{
    tape_program program = {.code = tape->code,
                            .num_instructions = tape->num_instructions,
                            .constants = tape->constants,
                            .data = data,
                            .values = (const uint *)(data + layout->values_word),
                            .num_values = layout->num_values,
                            .slots = slots};
    affine_position at;
    for (int axis = 0; axis < 3; axis++) {
        at.voxel[axis] = p->voxel[axis];
        at.fraction[axis] = p->fraction[axis];
    }
    tape_values(&program, &at, NULL, level);
    return k_as_float((uint)tape_load(&program, tape->output[output]));
}

static bool same_float(float a, float b) { return k_as_uint(a) == k_as_uint(b) || (isnan(a) && isnan(b)); }

static void check_random_graph(uint64_t seed, tally *t)
{
    random_state = seed * 0x9e3779b97f4a7c15ULL + 4711;
    random_bits();
    random_place place = random_place_make();
    random_graph graph;
    random_graph_make(&graph, &place, 10 + random_below(40), true, 1);
    for (uint32_t i = 0; i < graph.graph.num_noises; i++)
        graph.graph.noises[i].derivative = 0;
    if (seed % 4 == 0)
        random_graph_widen(&graph);
    karst_resolved_world world = {.graph = &graph.graph, .root = {graph.root[0]}};
    derived d = derive_world(&world, graph.parameters, GRAPH_PARAMETERS, WORLD_SEED, place.voxel_log2_m);

    karst_world_layout layout;
    karst_tape tape;
    karst_error error = {0};
    const karst_expr roots[4] = {d.world->world.root[KARST_ROOT_DENSITY], d.world->world.gradient[0],
                                 d.world->world.gradient[1], d.world->world.gradient[2]};
    assert_true(karst_world_layout_init(&layout, &d.world->world));
    uint64_t *data = calloc(layout.num_words, sizeof *data);
    assert_true(karst_world_data_fill(&layout, graph.parameters, WORLD_SEED, place.voxel_log2_m, data));
    assert_true(karst_tape_build(&layout, roots, 4, &tape, &error));
    int *slots = calloc((size_t)tape.num_slots * TAPE_VALUE_ELEMENTS, sizeof *slots);
    char name[64];
    snprintf(name, sizeof name, "graph %lu", (unsigned long)seed);
    for (int i = 0; i < 4; i++) {
        karst_position at;
        for (int axis = 0; axis < 3; axis++) {
            at.voxel[axis] = place.voxel[axis];
            at.fraction[axis] = place.fraction[axis] + random_bits() % 0x10000000u;
        }
        int level = (int)random_below(5) - 1;
        karst_oracle_value values[4];
        values[0] = karst_oracle_gradient(d.oracle, &at, level, values + 1);
        for (uint32_t output = 0; output < 4; output++) {
            float got = tape_value(&layout, &tape, data, slots, &at, level, output);
            if (!same_float(got, values[output].device))
                fail_msg("%s: output %u of the tape is %a, the oracle's is %a", name, output, (double)got,
                         (double)values[output].device);
        }
        if (labs(at.voxel[0]) < 100000 && labs(at.voxel[1]) < 100000) /* doubles of what is far are too coarse */
            compare(&d, &at, 22, level, 1e-4, name, t);
    }
    free(slots);
    free(data);
    karst_tape_finish(&tape);
    derived_finish(&d);
    random_graph_finish(&graph);
}

static void test_random_graphs(void **state)
{
    (void)state;
    /* Some lie too high or repeat too often for differences of doubles; and which side is taken is the device's float
     * to say, where a double next to a tie may lie on the other. */
    tally t = {.max_wrong = 500};
    for (uint64_t seed = 1; seed <= 3000; seed++)
        check_random_graph(seed, &t);
    print_message("%d slopes compared, %d differ, %d rough\n", t.num_compared, t.num_wrong, t.num_rough);
    assert_true(t.num_compared > 15000);
    assert_true(t.num_compared > 4 * t.num_rough);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_built_ins), cmocka_unit_test(test_wide),          cmocka_unit_test(test_ties_and_jumps),
        cmocka_unit_test(test_worlds),    cmocka_unit_test(test_random_graphs),
    };
    return cmocka_run_group_tests_name("derive", tests, NULL, NULL);
}
