/* Generated code through the front end of a device's compiler: graphs at random over every op, kind and nesting, as
 * density (points and bricks), as density with its gradient, and as colours, at 16 lanes and at 1. None may be refused.
 *
 * The driver is the compiler. A batch of graphs is one program: the names that a density program defines are renamed
 * for each graph, and nothing but an empty kernel is compiled to the end. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/device/context.h"
#include "producers/language/graph/derive.h"
#include "producers/language/emit/emit.h"
#include "producers/language/emit/emit_text.h"
#include "producers/language/graph/kinds.h"
#include "producers/language/graph/soften.h"
#include "producers/density/try_code.h"
#include "tests/language/random_graph.h"
#include "core/base/facing_shared.h"
#include "tests/language/wild_graph.h"

#define A_BATCH 50u

static const char head[] = "#include \"producers/language/emit/emit.clh\"\n";
/* What a graph's texts define. */
static const char *const names[] = {"world_axes",    "world_point",  "world_prepare", "world_plane",
                                    "world_row",     "world_sample", "world_colour",  "world_colour_prepare",
                                    "world_surface", "world_outputs"};
#define OUTPUT_NAME(id, ...) "WORLD_OUTPUT_" #id,
static const char *const macros[] = {"WORLD_FACE_IN_ROWS", "WORLD_COLOUR_TAKES_PLACES", "WORLD_NEAR_OCTAVES",
                                     "WORLD_NUM_OUTPUTS", KARST_OUTPUTS(OUTPUT_NAME)};

/* What has been met in texts that compiled. */
static struct {
    uint32_t op[KARST_NUM_OPS], wide[KARST_NUM_OPS], type[4], choices, gradients, colours, surfaces, densities;
} met;

static void expect(bool good, const karst_error *error)
{
    if (!good)
        fail_msg("%s", error->message);
}

static void count_nodes(const karst_graph *g)
{
    for (karst_expr e = 1; e < g->num_nodes; e++) {
        met.op[g->nodes[e].op]++;
        met.wide[g->nodes[e].op] += g->nodes[e].kind == KARST_KIND_WIDE;
        met.type[g->nodes[e].type]++;
    }
}

/* Its own names, and no more of the preamble than is in the batch's head. */
static void add_text(karst_text *batch, const char *text, uint32_t number, char of)
{
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        karst_text_add(batch, "#undef %s\n#define %s %s_%u%c\n", names[i], names[i], names[i], number, of);
    for (size_t i = 0; i < sizeof macros / sizeof *macros; i++)
        karst_text_add(batch, "#undef %s\n", macros[i]);
    const char *only = KARST_EMIT_ONLY_GRADIENT;
    text += strncmp(text, only, strlen(only)) ? 0 : strlen(only);
    karst_text_add(batch, "#line 1 \"graph %u, %c\"\n", number, of);
    for (size_t length; *text; text += length) {
        length = strlen(text);
        length = length > 1000 ? 1000 : length;
        karst_text_add(batch, "%.*s", (int)length, text);
    }
}

static void add_gradient(karst_text *batch, const karst_resolved_world *world, uint32_t number)
{
    karst_error error = {0};
    karst_world_layout layout;
    char *source = NULL;
    for (karst_expr e = 1; e < world->graph->num_nodes; e++) {
        const karst_expr_node *n = &world->graph->nodes[e];
        if (n->op == KARST_OP_NOISE && world->graph->noises[n->extra].derivative)
            return;
    }
    karst_gradient_world *derived = karst_derive(world, &error);
    expect(derived, &error);
    const char *fault = NULL;
    if (!karst_resolved_world_check(&derived->world, &fault))
        fail_msg("graph %u, gradient: %s", number, fault);
    assert_true(karst_world_layout_init(&layout, &derived->world));
    if (karst_emit_surface(&layout, &source, &error)) {
        add_text(batch, source, number, 'g');
        met.gradients++;
    } else {
        assert_int_equal(error.status, KARST_BAD_WORLD); /* too large */
    }
    free(source);
    karst_gradient_world_destroy(derived);
}

static void add_world(karst_text *batch, const karst_resolved_world *world, uint32_t number)
{
    karst_error error = {0};
    karst_world_layout layout;
    karst_emitted emitted;
    const char *fault = NULL;
    if (!karst_resolved_world_check(world, &fault))
        fail_msg("graph %u: %s", number, fault);
    assert_true(karst_world_layout_init(&layout, world));
    expect(karst_emit_world(&layout, &emitted, &error), &error);
    if (!emitted.is_tape) {
        add_text(batch, emitted.source, number, 'd');
        met.densities++;
    }
    if (emitted.colour_source && !emitted.is_colour_tape) {
        add_text(batch, emitted.colour_source, number, 'c');
        met.colours++;
        met.surfaces += strstr(emitted.colour_source, "world_outputs") != NULL;
        met.choices += strstr(emitted.colour_source, "if (v_any(m") != NULL;
    }
    karst_emitted_finish(&emitted);
    add_gradient(batch, world, number);
    count_nodes(world->graph);
}

/* ---- graphs ---- */

static _Noreturn void graph_full(void *user, uint32_t where)
{
    (void)user;
    (void)where;
    abort();
}

/* A float for colours: what the graph has, a normal, a noise. */
static karst_expr tint(karst_graph *g, wild_source *random)
{
    switch (wild_below(random, 5)) {
    case 0:
        return karst_graph_leaf(g, KARST_OP_NORMAL, wild_below(random, KARST_FACING_FLOATS));
    case 1:
    case 2: {
        karst_expr e = wild_noise(g, random);
        karst_noise noise = g->noises[g->nodes[e].extra];
        noise.derivative = 0;
        return karst_graph_noise(g, noise, g->nodes[e].arg[0], g->nodes[e].arg[1], g->nodes[e].arg[2]);
    }
    default:
        return wild_operand(g, random, KARST_TYPE_FLOAT);
    }
}

/* Mixes and choices in one another, with noise on their sides: what colours leave out where a packet has none of it. */
static karst_expr nest(karst_graph *g, wild_source *random, uint32_t depth)
{
    if (depth == 0 || wild_below(random, 6) == 0)
        return tint(g, random);
    karst_expr a = nest(g, random, depth - 1), b = nest(g, random, depth - 1), t = tint(g, random);
    switch (wild_below(random, 6)) {
    case 0:
        return karst_graph_raw(g, KARST_OP_SELECT, KARST_TYPE_FLOAT, 0, wild_operand(g, random, KARST_TYPE_BOOL), a, b,
                               0);
    case 1: { /* a whole number that only one side needs */
        karst_expr whole = karst_graph_raw(g, KARST_OP_CONVERT, KARST_TYPE_INT, 0, a, 0, 0, 0);
        a = karst_graph_raw(g, KARST_OP_CONVERT, KARST_TYPE_FLOAT, 0, whole, 0, 0, 0);
        return karst_graph_raw(g, KARST_OP_MIX, KARST_TYPE_FLOAT, 0, a, b, t, 0);
    }
    case 2: { /* and a choice */
        karst_expr less = karst_graph_raw(g, KARST_OP_LESS, KARST_TYPE_BOOL, 0, a, b, 0, 0);
        b = karst_graph_raw(g, KARST_OP_SELECT, KARST_TYPE_FLOAT, 0, less, b, t, 0);
        return karst_graph_raw(g, KARST_OP_MIX, KARST_TYPE_FLOAT, 0, a, b, t, 0);
    }
    case 3:
        return karst_graph_raw(g, KARST_OP_MULTIPLY, KARST_TYPE_FLOAT, 0, a, b, 0, 0);
    default:
        return karst_graph_raw(g, KARST_OP_MIX, KARST_TYPE_FLOAT, 0, a, b, t, 0);
    }
}

/* One in two with colours, and of these one in two with edges as wide as a footprint. */
static void add_wild(karst_text *batch, uint32_t number)
{
    karst_arena arena;
    karst_graph graph, live;
    wild_source random = {0x9e3779b97f4a7c15u * (number + 1)};
    karst_arena_init(&arena, (size_t)64 << 20, NULL, NULL);
    karst_graph_init(&graph, &arena, 1u << 16, graph_full, NULL);
    karst_graph_init(&live, &arena, 1u << 16, graph_full, NULL);
    karst_resolved_world world = {.graph = &live};
    /* A density alone, with a colour, with all that a surface gives. */
    const uint32_t num_roots = (uint32_t[]){1, 4, KARST_NUM_ROOTS}[wild_below(&random, 3)];
    world.root[KARST_ROOT_DENSITY] = wild_graph(&graph, &random, 12 + wild_below(&random, 120));
    for (uint32_t i = 1; i < num_roots; i++)
        world.root[i] = nest(&graph, &random, 1 + wild_below(&random, 4));
    if (num_roots > 1 && wild_below(&random, 2))
        karst_soften(&graph, -4, world.root + 1, num_roots - 1);
    karst_graph_extract(&graph, &live, world.root, num_roots);
    wild_kinds(&live, &random);
    add_world(batch, &world, number);
    karst_arena_finish(&arena);
}

/* By the graph's own constructors, kinds and all. */
static void add_canonical(karst_text *batch, uint32_t number)
{
    random_graph r;
    random_state = 0x9e3779b97f4a7c15u * (number + 1);
    random_place place = random_place_make();
    random_prefers_whole = random_chance(4);
    random_graph_make(&r, &place, 5 + random_below(150), true, 4);
    if (random_chance(2))
        random_graph_widen(&r);
    karst_resolved_world world = {.graph = &r.graph, .root = {r.root[0]}};
    if (random_chance(2))
        memcpy(world.root + 1, r.root + 1, 3 * sizeof *r.root);
    add_world(batch, &world, number);
    random_graph_finish(&r);
}

/* ---- the compiler ---- */

static bool compiles(const char *text, int lanes, karst_error *error)
{
    *error = (karst_error){0};
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, error);
    expect(context, error);
    bool good = karst_try_code(context, text, "-DWORLD_HAS_DATA", error);
    karst_context_destroy(context);
    return good;
}

static void compile_both(const char *text)
{
    karst_error error;
    for (int lanes = 1; lanes <= 16; lanes += 15)
        if (!compiles(text, lanes, &error))
            fail_msg("%d lanes: %s", lanes, error.message);
}

static uint32_t num_graphs(void)
{
    const char *text = getenv("FRONT_END_GRAPHS");
    return text                         ? (uint32_t)strtoul(text, NULL, 10)
           : getenv("KARST_TEST_FULL")  ? 5000
           : getenv("KARST_TEST_QUICK") ? 100
                                        : 500;
}

static void test_random_graphs(void **state)
{
    (void)state;
    for (uint32_t first = 0; first < num_graphs(); first += A_BATCH) {
        karst_text batch = {0};
        karst_text_add(&batch, "%s", head);
        for (uint32_t i = first; i < first + A_BATCH; i++)
            (i % 2 ? add_wild : add_canonical)(&batch, i);
        assert_false(batch.failed);
        compile_both(batch.bytes);
        karst_text_finish(&batch);
    }
    for (int op = 0; op < KARST_NUM_OPS; op++)
        if (!met.op[op] && op != KARST_OP_NONE && op != KARST_OP_POSITION && num_graphs() >= 500)
            fail_msg("no graph has op %s", karst_op_name((karst_op)op));
    for (int type = 0; type < 4; type++)
        assert_true(met.type[type] > 0);
    assert_true(met.wide[KARST_OP_SELECT] > 0 && met.wide[KARST_OP_MIX] > 0);
    print_message("%u densities, %u gradients, %u colours, %u of which leave something out, %u with more\n",
                  met.densities, met.gradients, met.colours, met.choices, met.surfaces);
    assert_true(met.choices > num_graphs() / 50 && met.gradients > num_graphs() / 20 &&
                met.surfaces > num_graphs() / 20);
}

/* ---- and what is refused ---- */

/* A choice between floats of which one is a bool, as lowering once made it: no back end may see it, and 16 lanes, where
 * a compiler tells both apart, would not compile. */
static void test_mixed_types(void **state)
{
    (void)state;
    for (int kind = 0; kind < 2; kind++) {
        karst_arena arena;
        karst_graph g;
        karst_error error;
        const char *fault;
        karst_world_layout layout;
        karst_emitted emitted;
        wild_source random = {7};
        karst_arena_init(&arena, (size_t)64 << 20, NULL, NULL);
        karst_graph_init(&g, &arena, 1u << 16, graph_full, NULL);
        karst_expr a = wild_affine_of(&g, &random, 0), b = wild_affine_of(&g, &random, 1);
        karst_expr less = karst_graph_raw(&g, KARST_OP_LESS, KARST_TYPE_BOOL, 0, a, b, 0, 0);
        karst_expr other = karst_graph_raw(&g, KARST_OP_ADD, KARST_TYPE_FLOAT, 0, b, a, 0, 0);
        karst_expr choice = karst_graph_raw(&g, KARST_OP_SELECT, KARST_TYPE_FLOAT, 0, less, less, other, 0);
        karst_resolved_world world = {.graph = &g, .root = {choice}};
        karst_kinds_set(&g, 1);
        g.nodes[choice].kind = g.nodes[other].kind = kind ? KARST_KIND_WIDE : KARST_KIND_FLOAT;
        assert_false(karst_resolved_world_check(&world, &fault));
        assert_true(karst_world_layout_init(&layout, &world));
        expect(karst_emit_world(&layout, &emitted, &error), &error);
        assert_false(compiles(emitted.source, 16, &error));
        assert_int_equal(error.status, KARST_FAILED);
        assert_non_null(strstr(error.message, "incompatible type"));
        karst_emitted_finish(&emitted);
        world.root[KARST_ROOT_DENSITY] = less;
        g.nodes[choice].arg[1] = other;
        assert_false(karst_resolved_world_check(&world, &fault));
        assert_non_null(strstr(fault, "no float"));
        world.root[KARST_ROOT_DENSITY] = choice;
        assert_true(karst_resolved_world_check(&world, &fault));
        karst_arena_finish(&arena);
    }
}

/* One value declared as of another type, in one graph of a batch. */
static void test_wrong_declaration(void **state)
{
    karst_text batch = {0};
    karst_error error;
    (void)state;
    karst_text_add(&batch, "%s", head);
    for (uint32_t i = 0; i < 4; i++)
        (i % 2 ? add_wild : add_canonical)(&batch, i);
    assert_false(batch.failed);
    assert_true(compiles(batch.bytes, 16, &error));
    char *declaration = strstr(batch.bytes, "const vint v");
    assert_non_null(declaration);
    memcpy(declaration, "const wide v", strlen("const wide v"));
    for (int lanes = 1; lanes <= 16; lanes += 15)
        assert_false(compiles(batch.bytes, lanes, &error));
    karst_text_finish(&batch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mixed_types),
        cmocka_unit_test(test_wrong_declaration),
        cmocka_unit_test(test_random_graphs),
    };
    return cmocka_run_group_tests_name("front end", tests, NULL, NULL);
}
