#include "producers/language/graph/loosen.h"

#include <math.h>

/* 2^x is finite up to it, with room for products. */
#define MOST_EXPONENT 64

typedef struct {
    karst_graph *graph;
    uint8_t *is_number; /* of each node that was there at first: whatever the place, it is no NaN */
    karst_expr *loose;  /* of each whose sign counts: what has the same */
} loosener;

/* By its arguments; all but these ops give numbers of numbers. */
static bool find_number(const karst_graph *graph, const karst_range *ranges, const uint8_t *is_number, karst_expr e)
{
    const karst_expr_node *n = &graph->nodes[e];
    const karst_range first = ranges[n->arg[0]], second = ranges[n->arg[1]];
    for (int k = 0; k < 4; k++)
        if (n->arg[k] && !is_number[n->arg[k]])
            return false;
    switch (n->op) {
    case KARST_OP_CONSTANT:
        return isfinite(graph->constants[n->extra].value);
    case KARST_OP_BITS:
        return n->type != KARST_TYPE_FLOAT;
    case KARST_OP_DIVIDE:
        return second.lo > 0 || second.hi < 0;
    case KARST_OP_SQRT:
        return first.lo >= 0;
    case KARST_OP_LOG:
        return first.lo > 0;
    case KARST_OP_EXP2:
        return first.hi <= MOST_EXPONENT;
    default:
        return true;
    }
}

/* What min(x, c) of c > 0 cuts off, or max(x, c) of c < 0; else KARST_NO_EXPR. */
static karst_expr what_is_cut(const karst_graph *graph, karst_expr e)
{
    const karst_expr_node *n = &graph->nodes[e];
    for (int k = 0; k < 2 && (n->op == KARST_OP_MIN || n->op == KARST_OP_MAX); k++) {
        const karst_number *by = karst_graph_constant(graph, n->arg[k]);
        if (by && (n->op == KARST_OP_MIN ? by->value > 0 : by->value < 0))
            return n->arg[1 - k];
    }
    return KARST_NO_EXPR;
}

static bool is_factor(const karst_graph *graph, karst_expr e)
{
    const karst_number *n = karst_graph_constant(graph, e);
    return n && (n->value > 0 || n->value < 0);
}

/* Whether no more than the sign of argument k counts for a node's sign. */
static bool passes_sign(const karst_graph *graph, const karst_expr_node *n, int k)
{
    switch (n->op) {
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_NEGATE:
        return true;
    case KARST_OP_SELECT:
        return k > 0;
    case KARST_OP_MULTIPLY:
        return k < 2 && is_factor(graph, n->arg[1 - k]);
    case KARST_OP_DIVIDE:
        return k == 0 && is_factor(graph, n->arg[1]);
    default:
        return false;
    }
}

static karst_expr loosen(loosener *l, karst_expr e)
{
    const karst_expr_node n = l->graph->nodes[e];
    const karst_expr cut = what_is_cut(l->graph, e);
    karst_expr arg[4];
    bool is_same = true;
    if (cut && l->is_number[cut])
        return l->loose[cut];
    for (int k = 0; k < 4; k++) {
        arg[k] = n.arg[k] && passes_sign(l->graph, &n, k) ? l->loose[n.arg[k]] : n.arg[k];
        is_same = is_same && arg[k] == n.arg[k];
    }
    if (is_same)
        return e;
    l->graph->where = n.where;
    return n.op == KARST_OP_NEGATE   ? karst_expr_1(l->graph, n.op, arg[0])
           : n.op == KARST_OP_SELECT ? karst_expr_3(l->graph, n.op, arg[0], arg[1], arg[2])
                                     : karst_expr_2(l->graph, n.op, arg[0], arg[1]);
}

karst_expr karst_loosen(karst_graph *graph, const karst_kinds_settings *settings, karst_expr density)
{
    const size_t count = (size_t)density + 1;
    uint8_t *counts = karst_arena_alloc(graph->arena, count); /* of each: whether its sign does */
    bool has_cuts = false;
    counts[density] = 1;
    for (karst_expr e = density; e > 0; e--) {
        const karst_expr_node *n = &graph->nodes[e];
        has_cuts |= counts[e] && what_is_cut(graph, e);
        for (int k = 0; counts[e] && k < 4; k++)
            counts[n->arg[k]] |= passes_sign(graph, n, k);
    }
    if (!has_cuts)
        return density;
    loosener l = {.graph = graph};
    karst_range *ranges = karst_arena_alloc(graph->arena, graph->num_nodes * sizeof *ranges);
    l.is_number = karst_arena_alloc(graph->arena, count);
    l.loose = karst_arena_alloc(graph->arena, count * sizeof *l.loose);
    karst_graph_ranges(graph, settings, ranges);
    for (karst_expr e = 1; e <= density; e++) {
        l.is_number[e] = find_number(graph, ranges, l.is_number, e);
        l.loose[e] = counts[e] ? loosen(&l, e) : e;
    }
    return l.loose[density];
}
