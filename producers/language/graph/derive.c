#include "producers/language/graph/derive.h"

#include <setjmp.h>
#include <stdlib.h>

#include "producers/language/graph/kinds.h"

#define ARENA_BYTES ((size_t)256 << 20)
#define MAX_NODES (1u << 18)

/* Which slope where a density has a kink: of the side that `select` takes, or the limit from behind or from ahead along
 * the axis. */
typedef enum { SIDE_TAKEN, SIDE_BEHIND, SIDE_AHEAD, NUM_SIDES } slope_side;

/* A derivative is a node, or KARST_NO_EXPR for 0. Behind and ahead it is not a number where that side begins with a
 * jump; of what has no slope (whole numbers, bools, what is piecewise constant) that is all it says. */
typedef struct {
    karst_graph *graph;
    slope_side side;
    karst_expr (*slope)[3]; /* of each node of the density, along each axis, at that side */
    karst_expr (*after)[3]; /* of bools: what they are on that side; only behind and ahead */
    uint8_t *jumps;         /* whether a slope may be no number for that reason */
    uint8_t *has_tie;       /* whether any_tie knows of it */
    karst_expr any_tie;     /* KARST_NO_EXPR: there is no kink at all */
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

static karst_expr not_a_number(derivation *d)
{
    return karst_graph_number(d->graph, KARST_TYPE_FLOAT,
                              karst_number_divide(karst_number_int(0), karst_number_int(0)));
}
static karst_expr equal(derivation *d, karst_expr a, karst_expr b)
{
    return karst_expr_2(d->graph, KARST_OP_EQUAL, a, b);
}
/* Bools. */
static karst_expr both_of(derivation *d, karst_expr a, karst_expr b)
{
    return karst_expr_2(d->graph, KARST_OP_AND, a, b);
}

/* ---- sides: what lies next to a tie ---- */

/* What rounding may part of what ties in real numbers. */
#define TIE 0x1p-20

/* The magnitude that a value's rounding goes by: where a sum cancels that of its terms. KARST_NO_EXPR: its own. */
static karst_expr scale_of(derivation *d, karst_expr e)
{
    karst_graph *g = d->graph;
    const karst_expr_node n = g->nodes[e];
    karst_expr a = n.arg[0], b = n.arg[1], scale;
    switch (n.op) {
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        return karst_expr_1(g, KARST_OP_ABS, karst_graph_constant(g, a) ? a : karst_graph_constant(g, b) ? b : a);
    case KARST_OP_FMA:
        return karst_expr_1(g, KARST_OP_ABS, n.arg[2]);
    case KARST_OP_MULTIPLY:
    case KARST_OP_DIVIDE:
        if (karst_graph_is_uniform(g, a) && n.op == KARST_OP_MULTIPLY)
            a = n.arg[1], b = n.arg[0];
        scale = karst_graph_is_uniform(g, b) ? scale_of(d, a) : KARST_NO_EXPR;
        return scale ? karst_expr_2(g, (karst_op)n.op, scale, karst_expr_1(g, KARST_OP_ABS, b)) : scale;
    case KARST_OP_NEGATE:
    case KARST_OP_ABS:
        return scale_of(d, a);
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        scale = scale_of(d, a);
        return scale ? scale : scale_of(d, b);
    case KARST_OP_FRACT:
        return number(d, 1);
    case KARST_OP_MOD:
        return karst_expr_1(g, KARST_OP_ABS, b);
    default:
        return KARST_NO_EXPR;
    }
}

/* |a| <= TIE * scale */
static karst_expr at_most(derivation *d, karst_expr a, karst_expr scale)
{
    return karst_expr_2(d->graph, KARST_OP_LESS_EQUAL, karst_expr_1(d->graph, KARST_OP_ABS, a),
                        karst_expr_2(d->graph, KARST_OP_MULTIPLY, scale, number(d, TIE)));
}

/* Whether a value is 0, or what is left of one where a sum cancels. */
static karst_expr is_zero(derivation *d, karst_expr a)
{
    karst_expr scale = scale_of(d, a);
    return scale ? at_most(d, a, scale) : equal(d, a, number(d, 0));
}

static bool is_constant_zero(const derivation *d, karst_expr a)
{
    const karst_number *n = karst_graph_constant(d->graph, a);
    return n && karst_number_is(*n, 0);
}

/* Whether two values tie. */
static karst_expr are_near(derivation *d, karst_expr a, karst_expr b)
{
    if (d->graph->nodes[a].type != KARST_TYPE_FLOAT)
        return equal(d, a, b);
    if (is_constant_zero(d, a) || is_constant_zero(d, b))
        return is_zero(d, is_constant_zero(d, b) ? a : b);
    karst_expr of_a = scale_of(d, a), of_b = scale_of(d, b);
    karst_expr scale = sum(d, of_a, of_b);
    if (!scale)
        scale = karst_expr_1(d->graph, KARST_OP_ABS, a);
    return at_most(d, karst_expr_2(d->graph, KARST_OP_SUBTRACT, a, b), scale);
}

/* `condition`, which says that node e has a kink or jump here. */
static karst_expr tie(derivation *d, karst_expr e, karst_expr condition)
{
    if (!d->has_tie[e])
        d->any_tie = d->any_tie ? karst_expr_2(d->graph, KARST_OP_OR, d->any_tie, condition) : condition;
    d->has_tie[e] = 1;
    return condition;
}

/* True if what has this slope falls as one goes to the side. */
static karst_expr falls(derivation *d, karst_expr slope)
{
    return d->side == SIDE_AHEAD ? less(d, slope, number(d, 0)) : less(d, number(d, 0), slope);
}

/* `slope`, but no number where `jump`. */
static karst_expr unless(derivation *d, karst_expr e, karst_expr jump, karst_expr slope)
{
    d->jumps[e] = 1;
    return choice(d, jump, not_a_number(d), slope);
}

/* The slope of min and max. Ahead of a tie a minimum has the lesser slope, behind it the greater. */
static karst_expr slope_of_extremum(derivation *d, karst_expr e, const karst_expr_node *n, karst_expr da, karst_expr db)
{
    karst_expr a = n->arg[0], b = n->arg[1];
    bool is_min = n->op == KARST_OP_MIN;
    karst_expr taken = choice(d, is_min ? less(d, b, a) : less(d, a, b), db, da);
    if (d->side == SIDE_TAKEN || da == db)
        return taken;
    bool is_least = is_min == (d->side == SIDE_AHEAD);
    karst_expr x = zero_or(d, da), y = zero_or(d, db);
    karst_expr next = karst_expr_2(d->graph, is_least ? KARST_OP_MIN : KARST_OP_MAX, x, y);
    if (d->jumps[b]) /* which a minimum would not show */
        next = choice(d, equal(d, y, y), next, y);
    return choice(d, tie(d, e, are_near(d, a, b)), next, taken);
}

static karst_expr slope_of_abs(derivation *d, karst_expr e, karst_expr a, karst_expr da)
{
    karst_expr taken = choice(d, less(d, a, number(d, 0)), karst_expr_1(d->graph, KARST_OP_NEGATE, da), da);
    if (d->side == SIDE_TAKEN)
        return taken;
    karst_expr next = karst_expr_1(d->graph, KARST_OP_ABS, da);
    if (d->side == SIDE_BEHIND)
        next = karst_expr_1(d->graph, KARST_OP_NEGATE, next);
    return choice(d, tie(d, e, is_zero(d, a)), next, taken);
}

/* condition ? yes : no, on a side. It goes on as its condition does; where that changes, the values must agree. */
static karst_expr slope_of_choice(derivation *d, karst_expr e, karst_expr condition, karst_expr yes, karst_expr no,
                                  int axis)
{
    karst_expr after = d->after[condition][axis];
    karst_expr slope = choice(d, after, d->slope[yes][axis], d->slope[no][axis]);
    if (after != condition) {
        karst_expr same =
            karst_expr_2(d->graph, KARST_OP_OR, equal(d, after, condition), are_near(d, yes, zero_or(d, no)));
        slope = unless(d, e, karst_expr_1(d->graph, KARST_OP_NOT, same), slope);
    }
    return sum(d, slope, d->slope[condition][axis]);
}

static karst_expr slope_of_select(derivation *d, karst_expr e, const karst_expr_node *n, int axis)
{
    if (d->side != SIDE_TAKEN)
        return slope_of_choice(d, e, n->arg[0], n->arg[1], n->arg[2], axis);
    return choice(d, n->arg[0], d->slope[n->arg[1]][axis], d->slope[n->arg[2]][axis]);
}

/* The bool of which a float is 1 or 0, as step() makes it; KARST_NO_EXPR: none, or no side is asked for. */
static karst_expr bool_behind(const derivation *d, karst_expr e)
{
    const karst_expr_node *n = &d->graph->nodes[e];
    bool is_bool = n->op == KARST_OP_CONVERT && n->kind != KARST_KIND_UNIFORM &&
                   d->graph->nodes[n->arg[0]].type == KARST_TYPE_BOOL;
    return is_bool && d->side != SIDE_TAKEN ? n->arg[0] : KARST_NO_EXPR;
}

/* a * b. What is multiplied by a bool is a choice. */
static karst_expr slope_of_product(derivation *d, karst_expr e, karst_expr a, karst_expr b, int axis, karst_expr rest)
{
    karst_expr da = d->slope[a][axis], db = d->slope[b][axis];
    karst_expr condition = bool_behind(d, a) ? bool_behind(d, a) : bool_behind(d, b);
    if (condition)
        return sum(d, slope_of_choice(d, e, condition, bool_behind(d, a) ? b : a, KARST_NO_EXPR, axis), rest);
    return a == b ? product_sum(d, product(d, da, number(d, 2)), a, rest)
                  : product_sum(d, da, b, product_sum(d, db, a, rest));
}

/* Where in a cell an argument lies, 0 to 1: of floor and its kin, fract and mod, and of what makes an int of a float.
 */
static karst_expr part_of_cell(derivation *d, karst_expr e, const karst_expr_node *n)
{
    karst_graph *g = d->graph;
    karst_expr a = n->arg[0];
    switch (n->op) {
    case KARST_OP_FRACT:
        return e;
    case KARST_OP_MOD:
        return karst_expr_2(g, KARST_OP_DIVIDE, e, n->arg[1]);
    case KARST_OP_FLOOR:
        return karst_expr_2(g, KARST_OP_SUBTRACT, a, e);
    case KARST_OP_CEIL:
        return karst_expr_2(g, KARST_OP_SUBTRACT, karst_expr_2(g, KARST_OP_ADD, a, number(d, 1)), e);
    case KARST_OP_RINT:
        return karst_expr_2(g, KARST_OP_SUBTRACT, karst_expr_2(g, KARST_OP_ADD, a, number(d, 0.5)), e);
    default: /* towards 0 */
        a = karst_expr_1(g, KARST_OP_ABS, a);
        return karst_expr_2(g, KARST_OP_SUBTRACT, a, karst_expr_1(g, KARST_OP_FLOOR, a));
    }
}

/* Whether one comes from the cell's face into another cell: near its lower end by falling, near its upper by rising. */
static karst_expr leaves_cell(derivation *d, karst_expr e, const karst_expr_node *n, karst_expr da)
{
    karst_graph *g = d->graph;
    karst_expr inwards = karst_expr_2(g, KARST_OP_SUBTRACT, number(d, 0.5), part_of_cell(d, e, n));
    karst_expr is_face = less(d, number(d, 0.5 - TIE), karst_expr_1(g, KARST_OP_ABS, inwards));
    if (n->op == KARST_OP_MOD || n->op == KARST_OP_CONVERT)
        da = karst_expr_2(g, KARST_OP_MULTIPLY, da, n->arg[n->op == KARST_OP_MOD]);
    return both_of(d, tie(d, e, is_face), falls(d, karst_expr_2(g, KARST_OP_MULTIPLY, da, inwards)));
}

static bool is_stepped(const derivation *d, karst_expr e)
{
    const karst_expr_node *n = &d->graph->nodes[e];
    return n->type != KARST_TYPE_FLOAT || n->kind == KARST_KIND_STEPS;
}

/* Of what is piecewise constant: 0, and no number where that side begins with a jump. */
static karst_expr slope_of_steps(derivation *d, karst_expr e, const karst_expr_node *n, int axis)
{
    karst_expr a = n->arg[0], da = d->slope[a][axis], slope = KARST_NO_EXPR;
    bool rounds = n->op == KARST_OP_FLOOR || n->op == KARST_OP_CEIL || n->op == KARST_OP_RINT ||
                  (n->op == KARST_OP_CONVERT && n->type != KARST_TYPE_BOOL);
    if (n->op == KARST_OP_BITS || n->op == KARST_OP_NOISE)
        return slope;
    if (n->op == KARST_OP_SELECT && n->type != KARST_TYPE_BOOL)
        return slope_of_select(d, e, n, axis);
    if (n->op == KARST_OP_CONVERT && d->graph->nodes[a].type == KARST_TYPE_BOOL) {
        karst_expr after = d->after[a][axis];
        if (after != a)
            slope = unless(d, e, karst_expr_1(d->graph, KARST_OP_NOT, equal(d, after, a)), slope);
        return sum(d, slope, da);
    }
    if (rounds && da && !is_stepped(d, a))
        return unless(d, e, leaves_cell(d, e, n, da), KARST_NO_EXPR);
    for (int k = 0; k < 4 && n->arg[k]; k++) {
        karst_expr dk = d->slope[n->arg[k]][axis];
        if (!dk || (k && dk == d->slope[n->arg[k - 1]][axis]))
            continue;
        if (!is_stepped(d, n->arg[k])) { /* of a slope what it says of jumps */
            if (!d->jumps[n->arg[k]])
                continue;
            dk = choice(d, equal(d, dk, dk), KARST_NO_EXPR, dk);
        }
        slope = sum(d, slope, dk);
    }
    return slope;
}

/* What a bool is at once on that side. */
static karst_expr after_of(derivation *d, karst_expr e, int axis)
{
    const karst_expr_node n = d->graph->nodes[e];
    karst_expr a = n.arg[0], b = n.arg[1], da = d->slope[a][axis], db = d->slope[b][axis];
    switch (n.op) {
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL: {
        if (d->graph->nodes[a].type != KARST_TYPE_FLOAT || da == db || (is_stepped(d, a) && is_stepped(d, b)))
            return e;
        karst_expr x = is_stepped(d, a) ? number(d, 0) : zero_or(d, da),
                   y = is_stepped(d, b) ? number(d, 0) : zero_or(d, db);
        bool ahead = d->side == SIDE_AHEAD;
        karst_expr next = karst_expr_2(d->graph, (karst_op)n.op, ahead ? x : y, ahead ? y : x);
        return karst_expr_3(d->graph, KARST_OP_SELECT, tie(d, e, are_near(d, a, b)), next, e);
    }
    case KARST_OP_NOT:
        return karst_expr_1(d->graph, KARST_OP_NOT, d->after[a][axis]);
    case KARST_OP_AND:
    case KARST_OP_OR:
        return karst_expr_2(d->graph, (karst_op)n.op, d->after[a][axis], d->after[b][axis]);
    case KARST_OP_SELECT:
        return karst_expr_3(d->graph, KARST_OP_SELECT, d->after[a][axis], d->after[b][axis], d->after[n.arg[2]][axis]);
    default:
        return e;
    }
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
static karst_expr slope_of_mod(derivation *d, karst_expr e, const karst_expr_node *n, int axis)
{
    karst_expr a = n->arg[0], b = n->arg[1], da = d->slope[a][axis], db = d->slope[b][axis];
    if (!da && !db)
        return KARST_NO_EXPR;
    if (db) {
        karst_expr cell = karst_expr_1(d->graph, KARST_OP_FLOOR, karst_expr_2(d->graph, KARST_OP_DIVIDE, a, b));
        da = difference(d, da, product(d, db, cell));
    }
    if (d->side != SIDE_TAKEN && da)
        da = unless(d, e, leaves_cell(d, e, n, da), da);
    return choice(d, equal(d, b, number(d, 0)), KARST_NO_EXPR, da);
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
    switch ((karst_op)n->op) {
    case KARST_OP_NEGATE:
        return karst_expr_1(g, KARST_OP_NEGATE, da);
    case KARST_OP_ABS:
        return slope_of_abs(d, e, a, da);
    case KARST_OP_FRACT:
        return d->side == SIDE_TAKEN ? da : unless(d, e, leaves_cell(d, e, n, da), da);
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
    if (n.kind == KARST_KIND_UNIFORM)
        return KARST_NO_EXPR;
    if (n.type != KARST_TYPE_FLOAT || n.kind == KARST_KIND_STEPS)
        return d->side == SIDE_TAKEN ? KARST_NO_EXPR : slope_of_steps(d, e, &n, axis);
    switch ((karst_op)n.op) {
    case KARST_OP_AFFINE:
        return d->graph->affines[n.extra].coefficient[axis];
    case KARST_OP_ADD:
    case KARST_OP_SHIFTED:
        return sum(d, da, db);
    case KARST_OP_SUBTRACT:
        return difference(d, da, db);
    case KARST_OP_MULTIPLY:
        return slope_of_product(d, e, a, b, axis, KARST_NO_EXPR);
    case KARST_OP_FMA:
        return slope_of_product(d, e, a, b, axis, dc);
    case KARST_OP_DIVIDE:
        return quotient(d, difference(d, da, product(d, db, e)), b);
    case KARST_OP_MIX:
        if (bool_behind(d, c))
            return slope_of_choice(d, e, bool_behind(d, c), b, a, axis);
        return product_sum(d, dc, karst_expr_2(d->graph, KARST_OP_SUBTRACT, b, a),
                           product_sum(d, difference(d, db, da), c, da));
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        return slope_of_extremum(d, e, &n, da, db);
    case KARST_OP_SELECT:
        return slope_of_select(d, e, &n, axis);
    case KARST_OP_MOD:
        return slope_of_mod(d, e, &n, axis);
    case KARST_OP_LENGTH:
        return slope_of_length(d, e, axis);
    case KARST_OP_ATAN:
        return slope_of_atan(d, &n, axis);
    case KARST_OP_NOISE:
        return slope_of_noise(d, &n, axis);
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return slope_of_turns(d, &n, axis);
    case KARST_OP_NEGATE:
    case KARST_OP_ABS:
    case KARST_OP_FRACT:
    case KARST_OP_SQRT:
    case KARST_OP_SIN:
    case KARST_OP_COS:
    case KARST_OP_EXP2:
    case KARST_OP_LOG:
        return slope_of_function(d, e, &n, da);
    case KARST_OP_NONE: /* the same everywhere, or nearly: steps were told before */
    case KARST_OP_CONSTANT:
    case KARST_OP_PARAMETER:
    case KARST_OP_POSITION:
    case KARST_OP_NORMAL:
    case KARST_OP_FOOTPRINT:
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
    case KARST_OP_CONVERT:
    case KARST_OP_BITS:
    case KARST_OP_CELL:
    case KARST_NUM_OPS:
    KARST_OP_CASES_OF_COMPARISONS
    KARST_OP_CASES_OF_INTS
        break;
    }
    return KARST_NO_EXPR;
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

/* The slopes of all nodes at one side. */
static void derive_side(derivation *d, slope_side side, karst_expr (*slope)[3], uint32_t count)
{
    d->side = side;
    d->slope = slope;
    for (karst_expr e = 1; e < count; e++) {
        d->graph->where = d->graph->nodes[e].where;
        for (int k = 0; k < 4 && side != SIDE_TAKEN; k++)
            d->jumps[e] |= d->jumps[d->graph->nodes[e].arg[k]];
        for (int axis = 0; axis < 3; axis++) {
            slope[e][axis] = slope_of(d, e, axis);
            if (side != SIDE_TAKEN && d->graph->nodes[e].type == KARST_TYPE_BOOL)
                d->after[e][axis] = after_of(d, e, axis);
        }
    }
}

/* Of the slopes behind and ahead the one that is nearer to the slope taken: all three are the same but at ties, and
 * there that one may be neither, if it is a term's whose own kink the density does not have. */
static karst_expr settle(derivation *d, karst_expr taken, karst_expr behind, karst_expr ahead, bool may_jump)
{
    karst_graph *g = d->graph;
    if (!d->any_tie || (behind == taken && ahead == taken))
        return zero_or(d, taken);
    taken = zero_or(d, taken), behind = zero_or(d, behind), ahead = zero_or(d, ahead);
    karst_expr off_behind = karst_expr_1(g, KARST_OP_ABS, karst_expr_2(g, KARST_OP_SUBTRACT, behind, taken));
    karst_expr off_ahead = karst_expr_1(g, KARST_OP_ABS, karst_expr_2(g, KARST_OP_SUBTRACT, ahead, taken));
    karst_expr settled = choice(d, less(d, off_behind, off_ahead), behind, ahead);
    if (may_jump) {
        settled = choice(d, equal(d, settled, settled), settled, behind);
        settled = choice(d, equal(d, settled, settled), settled, taken);
    }
    return karst_expr_3(g, KARST_OP_SELECT, d->any_tie, settled, taken);
}

/* What generated code of a graph counts (data.h). */
static uint32_t num_ops(const karst_graph *graph)
{
    uint32_t count = graph->num_nodes;
    for (karst_expr e = 1; e < graph->num_nodes; e++) {
        uint8_t op = graph->nodes[e].op;
        count += op == KARST_OP_NOISE                                   ? KARST_EMIT_NOISE_OPS - 1
                 : op == KARST_OP_SIN_TURNS || op == KARST_OP_COS_TURNS ? KARST_EMIT_TURNS_OPS - 1
                                                                        : 0;
    }
    return count;
}

/* The slopes taken, or, with sides, settled; and what is kept beside them. */
static void derive(karst_gradient_world *to, const karst_resolved_world *world, karst_expr beside, bool with_sides,
                   way_out *out)
{
    karst_arena_init(&to->arena, ARENA_BYTES, arena_full, out);
    karst_graph_init(&to->graph, &to->arena, MAX_NODES, graph_full, out);
    karst_graph built;
    karst_graph_init(&built, &to->arena, MAX_NODES, graph_full, out);
    karst_expr roots[5] = {world->root[KARST_ROOT_DENSITY]}, first[2] = {roots[0], beside};
    karst_graph_extract(world->graph, &built, first, beside ? 2 : 1);
    roots[0] = first[0], roots[4] = beside ? first[1] : KARST_NO_EXPR;

    derivation d = {.graph = &built};
    uint32_t count = built.num_nodes;
    karst_expr(*sides[NUM_SIDES])[3] = {0};
    d.after = karst_arena_alloc(&to->arena, count * sizeof *d.after);
    d.jumps = karst_arena_alloc(&to->arena, count);
    d.has_tie = karst_arena_alloc(&to->arena, count);
    for (int side = SIDE_TAKEN; side < (with_sides ? NUM_SIDES : SIDE_TAKEN + 1); side++) {
        sides[side] = karst_arena_alloc(&to->arena, count * sizeof **sides);
        derive_side(&d, (slope_side)side, sides[side], count);
    }
    for (int axis = 0; axis < 3; axis++) {
        karst_expr taken = sides[SIDE_TAKEN][roots[0]][axis];
        roots[axis + 1] = with_sides ? settle(&d, taken, sides[SIDE_BEHIND][roots[0]][axis],
                                              sides[SIDE_AHEAD][roots[0]][axis], d.jumps[roots[0]])
                                     : zero_or(&d, taken);
    }
    karst_kinds_set(&built, count);

    karst_graph_extract(&built, &to->graph, roots, beside ? 5 : 4);
    to->world =
        (karst_resolved_world){.graph = &to->graph, .root = {roots[0]}, .text = roots[4], .has_gradient = true};
    for (int axis = 0; axis < 3; axis++)
        to->world.gradient[axis] = roots[axis + 1];
}

static bool derive_guarded(karst_gradient_world *to, const karst_resolved_world *world, karst_expr beside,
                           bool with_sides, way_out *out)
{
    if (setjmp(out->escape))
        return false;
    derive(to, world, beside, with_sides, out);
    to->arena.full = NULL; /* the way out ends here */
    to->graph.full = NULL;
    return true;
}

/* With sides, unless that is more than can be compiled. */
static bool derive_either(karst_gradient_world *to, const karst_resolved_world *world, way_out *out)
{
    if (derive_guarded(to, world, KARST_NO_EXPR, true, out) && num_ops(&to->graph) <= KARST_EMIT_MAX_OPS)
        return true;
    karst_arena_finish(&to->arena);
    *to = (karst_gradient_world){0};
    return derive_guarded(to, world, KARST_NO_EXPR, false, out);
}

static karst_gradient_world *derive_new(const karst_resolved_world *world, karst_expr beside, bool for_bounds,
                                        karst_error *error)
{
    karst_gradient_world *to = calloc(1, sizeof *to);
    way_out *out = malloc(sizeof *out);
    bool ready = to && out,
         done = ready && (for_bounds ? derive_guarded(to, world, beside, false, out) : derive_either(to, world, out));
    free(out);
    if (done)
        return to;
    karst_fail(error, ready ? KARST_BAD_WORLD : KARST_FAILED,
               ready ? "the density's gradient needs too much memory" : "out of memory");
    karst_gradient_world_destroy(to);
    return NULL;
}

karst_gradient_world *karst_derive(const karst_resolved_world *world, karst_error *error)
{
    return derive_new(world, KARST_NO_EXPR, false, error);
}

karst_gradient_world *karst_derive_sides(const karst_resolved_world *world, karst_expr beside, karst_error *error)
{
    return derive_new(world, beside, true, error);
}

void karst_gradient_world_destroy(karst_gradient_world *world)
{
    if (!world)
        return;
    karst_arena_finish(&world->arena);
    free(world);
}
