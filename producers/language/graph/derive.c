#include "producers/language/graph/derive.h"

#include <setjmp.h>
#include <stdlib.h>

#include "producers/language/graph/kinds.h"

#define ARENA_BYTES ((size_t)256 << 20)
#define MAX_NODES (1u << 18)

/* A derivative is a node, or KARST_NO_EXPR for 0. */
typedef struct {
    karst_graph *graph;
    karst_expr (*slope)[3]; /* of each node of the density, along each axis */
} derivation;

/* ---- arithmetic on derivatives ---- */

static karst_expr number(derivation *d, double value) { return karst_graph_float(d->graph, value); }
static karst_expr zero_or(derivation *d, karst_expr a) { return a ? a : number(d, 0); }

static karst_expr sum(derivation *d, karst_expr a, karst_expr b)
{
    return !a ? b : !b ? a : karst_expr_2(d->graph, KARST_OP_ADD, a, b);
}
static karst_expr difference(derivation *d, karst_expr a, karst_expr b)
{
    return !b ? a : !a ? karst_expr_1(d->graph, KARST_OP_NEGATE, b) : karst_expr_2(d->graph, KARST_OP_SUBTRACT, a, b);
}
static karst_expr product(derivation *d, karst_expr slope, karst_expr factor)
{
    return slope ? karst_expr_2(d->graph, KARST_OP_MULTIPLY, slope, factor) : slope;
}
/* slope * factor + rest */
static karst_expr product_sum(derivation *d, karst_expr slope, karst_expr factor, karst_expr rest)
{
    if (!slope || !rest)
        return slope ? product(d, slope, factor) : rest;
    return karst_expr_3(d->graph, KARST_OP_FMA, slope, factor, rest);
}
static karst_expr quotient(derivation *d, karst_expr slope, karst_expr divisor)
{
    return slope ? karst_expr_2(d->graph, KARST_OP_DIVIDE, slope, divisor) : slope;
}
static karst_expr less(derivation *d, karst_expr a, karst_expr b)
{
    return karst_expr_2(d->graph, KARST_OP_LESS, a, b);
}
static karst_expr choice(derivation *d, karst_expr condition, karst_expr a, karst_expr b)
{
    return a == b ? a : karst_expr_3(d->graph, KARST_OP_SELECT, condition, zero_or(d, a), zero_or(d, b));
}

/* ---- operations ---- */

/* 1 / length, and 1 where that is 0: all the arguments are, then. */
static karst_expr reciprocal_length(derivation *d, karst_expr length)
{
    karst_expr safe = choice(d, less(d, number(d, 0), length), length, number(d, 1));
    return karst_expr_2(d->graph, KARST_OP_DIVIDE, number(d, 1), safe);
}

static karst_expr slope_of_length(derivation *d, karst_expr e, int axis)
{
    const karst_expr_node n = d->graph->nodes[e];
    karst_expr slope = KARST_NO_EXPR, by = KARST_NO_EXPR;
    for (int k = 0; k < 4 && n.arg[k]; k++) {
        if (!d->slope[n.arg[k]][axis])
            continue;
        by = by ? by : reciprocal_length(d, e);
        slope =
            product_sum(d, d->slope[n.arg[k]][axis], karst_expr_2(d->graph, KARST_OP_MULTIPLY, n.arg[k], by), slope);
    }
    return slope;
}

/* (x dy - y dx) / r^2, divided by r twice: r^2 may be too small for a float where r is not. */
static karst_expr slope_of_atan(derivation *d, const karst_expr_node *n, int axis)
{
    karst_expr y = n->arg[0], x = n->arg[1], dy = d->slope[y][axis], dx = d->slope[x][axis];
    if (!dx && !dy)
        return KARST_NO_EXPR;
    const karst_expr both[2] = {x, y};
    karst_expr by = reciprocal_length(d, karst_expr_length(d->graph, both, 2));
    karst_expr across = product(d, dx, karst_expr_2(d->graph, KARST_OP_MULTIPLY, y, by));
    karst_expr along = product(d, dy, karst_expr_2(d->graph, KARST_OP_MULTIPLY, x, by));
    return product(d, difference(d, along, across), by);
}

/* a - b floor(a / b), and 0 where b is. */
static karst_expr slope_of_mod(derivation *d, const karst_expr_node *n, int axis)
{
    karst_expr a = n->arg[0], b = n->arg[1], da = d->slope[a][axis], db = d->slope[b][axis];
    if (!da && !db)
        return KARST_NO_EXPR;
    if (db) {
        karst_expr cell = karst_expr_1(d->graph, KARST_OP_FLOOR, karst_expr_2(d->graph, KARST_OP_DIVIDE, a, b));
        da = difference(d, da, product(d, db, cell));
    }
    return choice(d, karst_expr_2(d->graph, KARST_OP_EQUAL, b, number(d, 0)), KARST_NO_EXPR, da);
}

static karst_expr slope_of_noise(derivation *d, const karst_expr_node *n, int axis)
{
    karst_noise noise = d->graph->noises[n->extra]; /* derivative is 0: no world's text has another */
    karst_expr slope = KARST_NO_EXPR;
    for (int k = 0; k < 3; k++) {
        noise.derivative = (uint8_t)(k + 1);
        if (d->slope[n->arg[k]][axis])
            slope = product_sum(d, d->slope[n->arg[k]][axis],
                                karst_graph_noise(d->graph, noise, n->arg[0], n->arg[1], n->arg[2]), slope);
    }
    return slope;
}

/* Of sin(2 pi a) and cos(2 pi a), a being an exact place. */
static karst_expr slope_of_turns(derivation *d, const karst_expr_node *n, int axis)
{
    bool is_sine = n->op == KARST_OP_SIN_TURNS;
    karst_expr other = karst_graph_raw(d->graph, is_sine ? KARST_OP_COS_TURNS : KARST_OP_SIN_TURNS, KARST_TYPE_FLOAT, 0,
                                       n->arg[0], 0, 0, 0);
    const double turn = 6.283185307179586477;
    return product(d, product(d, d->slope[n->arg[0]][axis], number(d, is_sine ? turn : -turn)), other);
}

/* Functions of one argument whose slope is `da`; e is the node itself. */
static karst_expr slope_of_function(derivation *d, karst_expr e, const karst_expr_node *n, karst_expr da)
{
    karst_graph *g = d->graph;
    karst_expr a = n->arg[0];
    if (!da)
        return da;
    switch (n->op) {
    case KARST_OP_NEGATE:
        return karst_expr_1(g, KARST_OP_NEGATE, da);
    case KARST_OP_ABS:
        return choice(d, less(d, a, number(d, 0)), karst_expr_1(g, KARST_OP_NEGATE, da), da);
    case KARST_OP_FRACT:
        return da;
    case KARST_OP_SQRT:
        return choice(d, less(d, number(d, 0), a), quotient(d, product(d, da, number(d, 0.5)), e), KARST_NO_EXPR);
    case KARST_OP_SIN:
        return product(d, da, karst_expr_1(g, KARST_OP_COS, a));
    case KARST_OP_COS:
        return karst_expr_1(g, KARST_OP_NEGATE, product(d, da, karst_expr_1(g, KARST_OP_SIN, a)));
    case KARST_OP_EXP2:
        return choice(d, less(d, karst_expr_1(g, KARST_OP_ABS, a), number(d, 126)),
                      product(d, product(d, da, number(d, 0.69314718055994530942)), e), KARST_NO_EXPR);
    case KARST_OP_LOG:
        return choice(d, less(d, number(d, 0x1p-126), a), quotient(d, da, a), KARST_NO_EXPR);
    default:
        return KARST_NO_EXPR;
    }
}

static karst_expr slope_of(derivation *d, karst_expr e, int axis)
{
    const karst_expr_node n = d->graph->nodes[e]; /* a copy: the graph grows */
    karst_expr a = n.arg[0], b = n.arg[1], c = n.arg[2];
    karst_expr da = d->slope[a][axis], db = d->slope[b][axis], dc = d->slope[c][axis];
    if (n.type != KARST_TYPE_FLOAT || n.kind == KARST_KIND_UNIFORM || n.kind == KARST_KIND_STEPS)
        return KARST_NO_EXPR;
    switch (n.op) {
    case KARST_OP_AFFINE:
        return d->graph->affines[n.extra].coefficient[axis];
    case KARST_OP_ADD:
    case KARST_OP_SHIFTED:
        return sum(d, da, db);
    case KARST_OP_SUBTRACT:
        return difference(d, da, db);
    case KARST_OP_MULTIPLY:
        return a == b ? product(d, product(d, da, number(d, 2)), a) : product_sum(d, da, b, product(d, db, a));
    case KARST_OP_FMA:
        return a == b ? product_sum(d, product(d, da, number(d, 2)), a, dc)
                      : product_sum(d, da, b, product_sum(d, db, a, dc));
    case KARST_OP_DIVIDE:
        return quotient(d, difference(d, da, product(d, db, e)), b);
    case KARST_OP_MIX:
        return product_sum(d, dc, karst_expr_2(d->graph, KARST_OP_SUBTRACT, b, a),
                           product_sum(d, difference(d, db, da), c, da));
    case KARST_OP_MIN:
        return choice(d, less(d, b, a), db, da);
    case KARST_OP_MAX:
        return choice(d, less(d, a, b), db, da);
    case KARST_OP_SELECT:
        return choice(d, a, db, dc);
    case KARST_OP_MOD:
        return slope_of_mod(d, &n, axis);
    case KARST_OP_LENGTH:
        return slope_of_length(d, e, axis);
    case KARST_OP_ATAN:
        return slope_of_atan(d, &n, axis);
    case KARST_OP_NOISE:
        return slope_of_noise(d, &n, axis);
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return slope_of_turns(d, &n, axis);
    default:
        return slope_of_function(d, e, &n, da);
    }
}

/* ---- the whole ---- */

typedef struct {
    jmp_buf escape;
} way_out;

static void graph_full(void *user, uint32_t where)
{
    (void)where;
    longjmp(((way_out *)user)->escape, 1);
}
static void arena_full(void *user) { longjmp(((way_out *)user)->escape, 1); }

static void derive(karst_gradient_world *to, const karst_resolved_world *world, way_out *out)
{
    karst_arena_init(&to->arena, ARENA_BYTES, arena_full, out);
    karst_graph_init(&to->graph, &to->arena, MAX_NODES, graph_full, out);
    karst_graph built;
    karst_graph_init(&built, &to->arena, MAX_NODES, graph_full, out);
    karst_expr roots[4] = {world->density};
    karst_graph_extract(world->graph, &built, roots, 1);

    derivation d = {.graph = &built};
    uint32_t count = built.num_nodes;
    d.slope = karst_arena_alloc(&to->arena, count * sizeof *d.slope);
    for (karst_expr e = 1; e < count; e++) {
        built.where = built.nodes[e].where;
        for (int axis = 0; axis < 3; axis++)
            d.slope[e][axis] = slope_of(&d, e, axis);
    }
    for (int axis = 0; axis < 3; axis++)
        roots[axis + 1] = zero_or(&d, d.slope[roots[0]][axis]);
    karst_kinds_set(&built, count);

    karst_graph_extract(&built, &to->graph, roots, 4);
    to->world = (karst_resolved_world){.graph = &to->graph, .density = roots[0], .has_gradient = true};
    for (int axis = 0; axis < 3; axis++)
        to->world.gradient[axis] = roots[axis + 1];
}

static bool derive_guarded(karst_gradient_world *to, const karst_resolved_world *world, way_out *out)
{
    if (setjmp(out->escape))
        return false;
    derive(to, world, out);
    to->arena.full = NULL; /* the way out ends here */
    to->graph.full = NULL;
    return true;
}

karst_gradient_world *karst_derive(const karst_resolved_world *world, karst_error *error)
{
    karst_gradient_world *to = calloc(1, sizeof *to);
    way_out *out = malloc(sizeof *out);
    bool ready = to && out, done = ready && derive_guarded(to, world, out);
    free(out);
    if (done)
        return to;
    karst_fail(error, ready ? KARST_BAD_WORLD : KARST_FAILED,
               ready ? "the density's gradient needs too much memory" : "out of memory");
    karst_gradient_world_destroy(to);
    return NULL;
}

void karst_gradient_world_destroy(karst_gradient_world *world)
{
    if (!world)
        return;
    karst_arena_finish(&world->arena);
    free(world);
}
