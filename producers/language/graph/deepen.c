#include "producers/language/graph/deepen.h"
#include "producers/language/graph/deepen_forms.h"

#include <math.h>

typedef struct {
    karst_graph *graph;
    const karst_range *ranges; /* of the nodes that were there at first */
    uint8_t *is_whole;         /* of each: a float that is always a whole number */
    uint8_t *is_affine;        /* of each: a sum of uniform multiples of the position's parts */
    karst_expr *deep;          /* of each that is wanted: what it becomes */
    karst_expr *yes, *no;      /* of each that is decided by comparisons alone: positive where it is positive (a bool:
                                * true), and where it is not; KARST_NO_EXPR: there is no such field */
} deepener;

/* Bits of what is wanted of a node. */
enum { WANT_DEEP = 1, WANT_SIDES = 2 };

static const karst_number *constant(const deepener *d, karst_expr e) { return karst_graph_constant(d->graph, e); }
static bool is_number(const deepener *d, karst_expr e, int64_t value)
{
    const karst_number *n = constant(d, e);
    return n && karst_number_is(*n, value);
}
static karst_expr number(deepener *d, double value) { return karst_graph_float(d->graph, value); }
static karst_expr one(deepener *d, karst_op op, karst_expr a) { return karst_expr_1(d->graph, op, a); }
static karst_expr two(deepener *d, karst_op op, karst_expr a, karst_expr b)
{
    return karst_expr_2(d->graph, op, a, b);
}
static karst_expr choose(deepener *d, karst_expr condition, karst_expr a, karst_expr b)
{
    return karst_expr_3(d->graph, KARST_OP_SELECT, condition, a, b);
}

static bool never_negative(const deepener *d, karst_expr e) { return d->ranges[e].lo >= 0; }
static bool is_changed(const deepener *d, karst_expr e) { return d->deep[e] != e; }

/* ---- whole numbers ---- */

static bool find_whole(const deepener *d, karst_expr e)
{
    const karst_expr_node *n = &d->graph->nodes[e];
    const uint8_t *w = d->is_whole;
    if (n->type != KARST_TYPE_FLOAT)
        return false;
    switch (n->op) {
    case KARST_OP_CONSTANT:
        return rint(d->graph->constants[n->extra].value) == d->graph->constants[n->extra].value;
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
        return true;
    case KARST_OP_CONVERT:
        return d->graph->nodes[n->arg[0]].type != KARST_TYPE_FLOAT;
    case KARST_OP_ABS:
    case KARST_OP_NEGATE:
        return w[n->arg[0]];
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_MULTIPLY:
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_MOD:
        return w[n->arg[0]] && w[n->arg[1]];
    case KARST_OP_FMA:
        return w[n->arg[0]] && w[n->arg[1]] && w[n->arg[2]];
    case KARST_OP_SELECT:
        return w[n->arg[1]] && w[n->arg[2]];
    default:
        return false;
    }
}

/* ---- what comparisons decide ---- */

static bool find_affine(const deepener *d, karst_expr e)
{
    const karst_expr_node *n = &d->graph->nodes[e];
    karst_expr a = n->arg[0], b = n->arg[1];
    bool uniform_a = a && karst_graph_is_uniform(d->graph, a), uniform_b = b && karst_graph_is_uniform(d->graph, b);
    switch (n->op) {
    case KARST_OP_POSITION:
        return true;
    case KARST_OP_NEGATE:
        return d->is_affine[a];
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        return (d->is_affine[a] && (uniform_b || d->is_affine[b])) || (uniform_a && d->is_affine[b]);
    case KARST_OP_MULTIPLY:
        return (uniform_a && d->is_affine[b]) || (uniform_b && d->is_affine[a]);
    default:
        return false;
    }
}

/* a = b on a surface at most, since one of them is affine along an axis of which the other knows nothing. */
static bool never_stay_equal(const deepener *d, karst_expr a, karst_expr b)
{
    unsigned of_a = d->graph->nodes[a].depends, of_b = d->graph->nodes[b].depends;
    const unsigned axes = KARST_DEPENDS_X | KARST_DEPENDS_Y | KARST_DEPENDS_Z;
    return (d->is_affine[a] && (of_a & ~of_b & axes)) || (d->is_affine[b] && (of_b & ~of_a & axes));
}

/* The condition behind "not c" and "c ? true : false"; turns *truth with it. */
static karst_expr bare_condition(const deepener *d, karst_expr c, bool *truth)
{
    for (;;) {
        const karst_expr_node *n = &d->graph->nodes[c];
        bool is_not = n->op == KARST_OP_NOT, is_same = false;
        if (n->op == KARST_OP_SELECT) {
            is_same = is_number(d, n->arg[1], 1) && is_number(d, n->arg[2], 0);
            is_not = is_number(d, n->arg[1], 0) && is_number(d, n->arg[2], 1);
        }
        if (!is_same && !is_not)
            return c;
        *truth ^= is_not;
        c = n->arg[0];
    }
}

/* What an arm of a choice comes to, if it is itself a choice by the same condition: returns from functions are. */
static karst_expr arm_given(const deepener *d, karst_expr arm, karst_expr condition, bool truth)
{
    const karst_expr_node *nodes = d->graph->nodes;
    condition = bare_condition(d, condition, &truth);
    while (nodes[arm].op == KARST_OP_SELECT) {
        bool same = truth;
        if (bare_condition(d, nodes[arm].arg[0], &same) != condition)
            break;
        arm = nodes[arm].arg[same ? 1 : 2];
    }
    return arm;
}

/* An arm of a choice, a number if it comes to one. */
static bool never_positive(const deepener *d, karst_expr arm, const karst_number *value)
{
    return value ? !(value->value > 0) : d->ranges[arm].hi <= 0;
}

static karst_expr two_or_none(deepener *d, karst_op op, karst_expr a, karst_expr b)
{
    return a && b ? two(d, op, a, b) : KARST_NO_EXPR;
}

/* Whether a node says 0 < x: then x itself, made deep, is positive there. */
static bool is_above_zero(const deepener *d, karst_expr e)
{
    return d->graph->nodes[e].op == KARST_OP_LESS && is_number(d, d->graph->nodes[e].arg[0], 0);
}

static void find_sides(deepener *d, karst_expr e)
{
    const karst_expr_node n = d->graph->nodes[e];
    karst_expr a = n.arg[0], b = n.arg[1];
    switch (n.op) {
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
        if (d->graph->nodes[a].type != KARST_TYPE_FLOAT || (d->is_whole[a] && d->is_whole[b]))
            return;
        if (is_above_zero(d, e))
            d->yes[e] = d->deep[b];
        else if (n.op == KARST_OP_LESS || never_stay_equal(d, a, b))
            d->yes[e] = two(d, KARST_OP_SUBTRACT, b, a);
        if (n.op == KARST_OP_LESS_EQUAL || never_stay_equal(d, a, b))
            d->no[e] = two(d, KARST_OP_SUBTRACT, a, b);
        return;
    case KARST_OP_NOT:
        d->yes[e] = d->no[a];
        d->no[e] = d->yes[a];
        return;
    case KARST_OP_AND:
    case KARST_OP_MIN:
        d->yes[e] = two_or_none(d, KARST_OP_MIN, d->yes[a], d->yes[b]);
        d->no[e] = two_or_none(d, KARST_OP_MAX, d->no[a], d->no[b]);
        return;
    case KARST_OP_OR:
    case KARST_OP_MAX:
        d->yes[e] = two_or_none(d, KARST_OP_MAX, d->yes[a], d->yes[b]);
        d->no[e] = two_or_none(d, KARST_OP_MIN, d->no[a], d->no[b]);
        return;
    case KARST_OP_CONVERT:
        d->yes[e] = d->graph->nodes[a].type == KARST_TYPE_BOOL ? d->yes[a] : KARST_NO_EXPR;
        d->no[e] = d->graph->nodes[a].type == KARST_TYPE_BOOL ? d->no[a] : KARST_NO_EXPR;
        return;
    case KARST_OP_SELECT: {
        const karst_number *p = constant(d, arm_given(d, n.arg[1], a, true)),
                           *q = constant(d, arm_given(d, n.arg[2], a, false));
        const bool first = p && p->value > 0, second = q && q->value > 0;
        if (n.type != KARST_TYPE_FLOAT || first == second || (!first && !never_positive(d, n.arg[1], p)) ||
            (!second && !never_positive(d, n.arg[2], q)))
            return;
        d->yes[e] = first ? d->yes[a] : d->no[a];
        d->no[e] = first ? d->no[a] : d->yes[a];
        return;
    }
    default:
        return;
    }
}

/* ---- rules ---- */

/* x of "x > 0 ? x : 0", however it is written, and of "a > b ? a - b : 0". */
static bool is_clamp(const deepener *d, karst_expr condition, karst_expr arm, bool when_true)
{
    const karst_expr_node *c = &d->graph->nodes[condition], *x = &d->graph->nodes[arm];
    if (c->op != KARST_OP_LESS && c->op != KARST_OP_LESS_EQUAL)
        return false;
    karst_expr small = c->arg[when_true ? 0 : 1], large = c->arg[when_true ? 1 : 0];
    if (is_number(d, small, 0) && large == arm)
        return true;
    return x->op == KARST_OP_SUBTRACT && x->arg[0] == large && x->arg[1] == small;
}

static karst_expr deepen_choice(deepener *d, karst_expr e)
{
    const karst_expr_node n = d->graph->nodes[e];
    karst_expr arm[2] = {n.arg[1], n.arg[2]}, deep[2];
    for (int i = 0; i < 2; i++) {
        karst_expr other = d->deep[arm[1 - i]];
        deep[i] = d->deep[arm[i]];
        if (!is_number(d, arm[i], 0) || is_number(d, other, 0))
            continue;
        if (is_clamp(d, n.arg[0], arm[1 - i], i == 1))
            return other;
        /* As deep as the other side is high: so the surface lies in the middle. */
        deep[i] = one(d, KARST_OP_NEGATE, one(d, KARST_OP_ABS, other));
    }
    return deep[0] == arm[0] && deep[1] == arm[1] ? e : choose(d, n.arg[0], deep[0], deep[1]);
}

static karst_expr deepen_max(deepener *d, karst_expr e)
{
    const karst_expr_node n = d->graph->nodes[e];
    for (int k = 0; k < 2; k++)
        if (is_number(d, n.arg[k], 0))
            return d->deep[n.arg[1 - k]];
    return is_changed(d, n.arg[0]) || is_changed(d, n.arg[1])
               ? two(d, KARST_OP_MAX, d->deep[n.arg[0]], d->deep[n.arg[1]])
               : e;
}

static karst_expr deepen_min(deepener *d, karst_expr e)
{
    const karst_expr_node n = d->graph->nodes[e];
    if (!is_changed(d, n.arg[0]) && !is_changed(d, n.arg[1]))
        return e;
    karst_expr deep = two(d, KARST_OP_MIN, d->deep[n.arg[0]], d->deep[n.arg[1]]);
    if (never_negative(d, e))
        return deep;
    return choose(d, two(d, KARST_OP_LESS, e, number(d, 0)), e, deep);
}

/* Of factors that are never negative where they were flat: negative where one of those is. */
static karst_expr product_of(deepener *d, karst_expr e, karst_expr a, karst_expr b)
{
    karst_expr p = d->deep[a], q = d->deep[b];
    if ((p == a && q == b) || (p != a && !never_negative(d, a)) || (q != b && !never_negative(d, b)))
        return e;
    if (p == a && d->ranges[a].lo > 0)
        return two(d, KARST_OP_MULTIPLY, a, q);
    if (q == b && d->ranges[b].lo > 0)
        return two(d, KARST_OP_MULTIPLY, p, b);
    karst_expr size_p = one(d, KARST_OP_ABS, p), size_q = one(d, KARST_OP_ABS, q);
    if (p == q)
        return two(d, KARST_OP_MULTIPLY, p, size_p);
    return two(d, KARST_OP_MIN, two(d, KARST_OP_MULTIPLY, p, size_q), two(d, KARST_OP_MULTIPLY, size_p, q));
}

/* A sum of what is never negative is 0 only where both are. */
static karst_expr sum_of(deepener *d, karst_expr e, karst_expr a, karst_expr b)
{
    karst_expr p = d->deep[a], q = d->deep[b], none = number(d, 0);
    bool adds_0 = (d->ranges[a].lo >= 0 && d->ranges[a].hi <= 0) || (d->ranges[b].lo >= 0 && d->ranges[b].hi <= 0);
    if (adds_0 && (p != a || q != b)) /* and depth */
        return two(d, KARST_OP_ADD, p, q);
    if ((p == a && q == b) || !never_negative(d, a) || !never_negative(d, b))
        return e;
    return two(d, KARST_OP_ADD, two(d, KARST_OP_MAX, p, q), two(d, KARST_OP_MAX, two(d, KARST_OP_MIN, p, q), none));
}

/* x - min(x, y) and max(x, y) - y are max(0, x - y). */
static karst_expr difference_of(deepener *d, karst_expr e, karst_expr a, karst_expr b)
{
    const karst_expr_node p = d->graph->nodes[a], q = d->graph->nodes[b];
    for (int k = 0; k < 2; k++) {
        if (q.op == KARST_OP_MIN && q.arg[k] == a)
            return two(d, KARST_OP_SUBTRACT, a, q.arg[1 - k]);
        if (p.op == KARST_OP_MAX && p.arg[k] == b)
            return two(d, KARST_OP_SUBTRACT, p.arg[1 - k], b);
    }
    return e;
}

static karst_expr deepen_node(deepener *d, karst_expr e)
{
    const karst_expr_node n = d->graph->nodes[e];
    karst_expr a = n.arg[0], b = n.arg[1], made = e;
    switch (n.op) {
    case KARST_OP_SELECT:
        made = deepen_choice(d, e);
        break;
    case KARST_OP_MAX:
        made = deepen_max(d, e);
        break;
    case KARST_OP_MIN:
        made = deepen_min(d, e);
        break;
    case KARST_OP_MULTIPLY:
        made = product_of(d, e, a, b);
        break;
    case KARST_OP_MIX: /* of nothing and something */
        if (is_number(d, a, 0))
            made = product_of(d, e, b, n.arg[2]);
        break;
    case KARST_OP_ADD:
        made = sum_of(d, e, a, b);
        break;
    case KARST_OP_SUBTRACT:
        made = difference_of(d, e, a, b);
        break;
    case KARST_OP_DIVIDE:
        if (is_changed(d, a) && d->ranges[b].lo > 0)
            made = two(d, KARST_OP_DIVIDE, d->deep[a], b);
        break;
    case KARST_OP_SQRT:
        if (is_changed(d, a) && never_negative(d, a))
            made = two(d, KARST_OP_ADD, one(d, KARST_OP_SQRT, d->deep[a]),
                       two(d, KARST_OP_MIN, d->deep[a], number(d, 0)));
        break;
    case KARST_OP_ABS:
        if (is_changed(d, a) && never_negative(d, a))
            made = d->deep[a];
        break;
    case KARST_OP_CONVERT:
        if (n.type == KARST_TYPE_FLOAT && d->graph->nodes[a].type == KARST_TYPE_BOOL)
            return choose(d, a, number(d, 1), number(d, -1));
        break;
    default:
        break;
    }
    /* Of whole numbers none lies between 0 and 1. */
    bool may_be_0 = d->ranges[e].lo <= 0 && d->ranges[e].hi >= 0;
    if (made == e && d->is_whole[e] && n.op != KARST_OP_CONSTANT && may_be_0)
        return choose(d, two(d, KARST_OP_EQUAL, e, number(d, 0)), number(d, -1), e);
    return made;
}

/* Whether what becomes of a node depends on what becomes of its argument number k. */
static bool looks_into(const karst_expr_node *n, int k)
{
    switch (n->op) {
    case KARST_OP_SELECT:
        return k > 0;
    case KARST_OP_MAX:
    case KARST_OP_MIN:
    case KARST_OP_MULTIPLY:
    case KARST_OP_MIX:
    case KARST_OP_ADD:
        return true;
    case KARST_OP_DIVIDE:
    case KARST_OP_SQRT:
    case KARST_OP_ABS:
        return k == 0;
    default:
        return false;
    }
}

/* Whether the sides of a node depend on those of its argument number k. */
static bool has_sides_of(const karst_expr_node *n, int k)
{
    switch (n->op) {
    case KARST_OP_NOT:
    case KARST_OP_CONVERT:
    case KARST_OP_SELECT:
        return k == 0;
    case KARST_OP_AND:
    case KARST_OP_OR:
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        return k < 2;
    default:
        return false;
    }
}

karst_expr karst_deepen(karst_graph *graph, const karst_kinds_settings *settings, karst_expr density)
{
    const karst_expr text = density;
    density = karst_deepen_forms(graph, settings, text);
    uint32_t count = graph->num_nodes;
    karst_range *ranges = karst_arena_alloc(graph->arena, count * sizeof *ranges);
    deepener d = {.graph = graph, .ranges = ranges};
    d.is_whole = karst_arena_alloc(graph->arena, count);
    d.is_affine = karst_arena_alloc(graph->arena, count);
    d.deep = karst_arena_alloc(graph->arena, count * sizeof *d.deep);
    d.yes = karst_arena_alloc(graph->arena, count * sizeof *d.yes);
    d.no = karst_arena_alloc(graph->arena, count * sizeof *d.no);
    uint8_t *wanted = karst_arena_alloc(graph->arena, count);
    karst_graph_ranges(graph, settings, ranges);
    wanted[density] = WANT_DEEP | WANT_SIDES;
    for (karst_expr e = density; e > 0; e--)
        for (int k = 0; wanted[e] && k < 4; k++) {
            if ((wanted[e] & WANT_SIDES) && k == 1 && is_above_zero(&d, e))
                wanted[graph->nodes[e].arg[k]] |= WANT_DEEP;
            if ((wanted[e] & WANT_DEEP) && looks_into(&graph->nodes[e], k))
                wanted[graph->nodes[e].arg[k]] |= WANT_DEEP;
            if ((wanted[e] & WANT_SIDES) && has_sides_of(&graph->nodes[e], k))
                wanted[graph->nodes[e].arg[k]] |= WANT_SIDES;
        }
    for (karst_expr e = 1; e <= density; e++) {
        d.is_whole[e] = find_whole(&d, e);
        d.is_affine[e] = find_affine(&d, e);
        graph->where = graph->nodes[e].where;
        if (wanted[e] & WANT_SIDES)
            find_sides(&d, e);
        if (wanted[e] & WANT_DEEP)
            d.deep[e] = deepen_node(&d, e);
    }
    karst_expr deep = d.yes[density] ? d.yes[density] : d.deep[density];
    return deep == density ? text : deep;
}
