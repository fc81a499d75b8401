/* What a loop's bound may be at most, where it is a choice of numbers (int n = p.x > 0.0 ? 6 : 3) or lies between two
 * by its form (int n = 2 + int(mod(floor(p.x), 3.0))). */
#include "producers/language/front/lower_internal.h"

#include <math.h>

enum { MOST_VISITS = 256 }; /* shared choices are met once for each way to them */

typedef struct {
    double low, high;
} range;

static const range anything = {-INFINITY, INFINITY};

static range range_of(const karst_graph *graph, karst_expr e, uint32_t *visits)
{
    const karst_number *n = karst_graph_constant(graph, e);
    const karst_expr_node *node = &graph->nodes[e];
    if (n)
        return (range){n->value, n->value};
    if (++*visits > MOST_VISITS)
        return anything;
    if (node->op == KARST_OP_MIN || node->op == KARST_OP_MAX || node->op == KARST_OP_SELECT) {
        bool is_choice = node->op == KARST_OP_SELECT;
        karst_expr left = node->arg[is_choice ? 1 : 0], right = node->arg[is_choice ? 2 : 1];
        const karst_expr_node *test = is_choice ? &graph->nodes[node->arg[0]] : NULL;
        range a = range_of(graph, left, visits), b = range_of(graph, right, visits);
        /* a < b ? a : b, as ints have it */
        bool is_min = node->op == KARST_OP_MIN, is_max = node->op == KARST_OP_MAX;
        if (test && test->op == KARST_OP_LESS) {
            is_min = test->arg[0] == left && test->arg[1] == right;
            is_max = test->arg[0] == right && test->arg[1] == left;
        }
        if (is_min)
            return (range){fmin(a.low, b.low), fmin(a.high, b.high)};
        if (is_max)
            return (range){fmax(a.low, b.low), fmax(a.high, b.high)};
        return (range){fmin(a.low, b.low), fmax(a.high, b.high)};
    }
    const karst_number *by = node->arg[1] ? karst_graph_constant(graph, node->arg[1]) : NULL;
    range a;
    switch (node->op) {
    case KARST_OP_FRACT:
        return (range){0, 1};
    case KARST_OP_MOD:
        return by && by->value > 0 ? (range){0, by->value} : anything;
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
    case KARST_OP_CONVERT: /* beyond ints all goes to their ends, which bound no loop */
        a = range_of(graph, node->arg[0], visits);
        return (range){floor(a.low), ceil(a.high)};
    case KARST_OP_BIT_AND:
        return by && node->type == KARST_TYPE_INT && by->value >= 0 ? (range){0, by->value} : anything;
    case KARST_OP_ADD:
    case KARST_OP_INT_ADD: { /* far from where ints wrap */
        a = range_of(graph, node->arg[0], visits);
        const range b = range_of(graph, node->arg[1], visits), sum = {a.low + b.low, a.high + b.high};
        return sum.low > -0x1p30 && sum.high < 0x1p30 ? sum : anything;
    }
    default:
        return anything;
    }
}

static bool always_holds(const karst_graph *graph, karst_expr e, uint32_t *visits);

static bool never_holds(const karst_graph *graph, karst_expr e, uint32_t *visits)
{
    const karst_expr_node *node = &graph->nodes[e];
    const karst_number *n = karst_graph_constant(graph, e);
    if (n || ++*visits > MOST_VISITS)
        return n && n->numerator == 0;
    if (node->op == KARST_OP_AND)
        return never_holds(graph, node->arg[0], visits) || never_holds(graph, node->arg[1], visits);
    if (node->op == KARST_OP_OR)
        return never_holds(graph, node->arg[0], visits) && never_holds(graph, node->arg[1], visits);
    if (node->op == KARST_OP_SELECT)
        return never_holds(graph, node->arg[1], visits) && never_holds(graph, node->arg[2], visits);
    if (node->op == KARST_OP_NOT)
        return always_holds(graph, node->arg[0], visits);
    if (node->op != KARST_OP_LESS && node->op != KARST_OP_LESS_EQUAL)
        return false;
    range a = range_of(graph, node->arg[0], visits), b = range_of(graph, node->arg[1], visits);
    return node->op == KARST_OP_LESS ? a.low >= b.high : a.low > b.high;
}

static bool always_holds(const karst_graph *graph, karst_expr e, uint32_t *visits)
{
    const karst_expr_node *node = &graph->nodes[e];
    const karst_number *n = karst_graph_constant(graph, e);
    if (n || ++*visits > MOST_VISITS)
        return n && n->numerator != 0;
    if (node->op == KARST_OP_NOT)
        return never_holds(graph, node->arg[0], visits);
    if (node->op != KARST_OP_LESS && node->op != KARST_OP_LESS_EQUAL)
        return false;
    range a = range_of(graph, node->arg[0], visits), b = range_of(graph, node->arg[1], visits);
    return node->op == KARST_OP_LESS ? a.high < b.low : a.high <= b.low;
}

bool karst_lower_never_holds(const karst_lower_state *s, karst_expr condition)
{
    uint32_t visits = 0;
    return never_holds(s->graph, condition, &visits);
}

bool karst_lower_has_bound(const karst_lower_state *s, karst_expr condition)
{
    const karst_expr_node *node = &s->graph->nodes[condition];
    uint32_t visits = 0;
    if (node->op == KARST_OP_NOT)
        node = &s->graph->nodes[node->arg[0]];
    if (node->op != KARST_OP_LESS && node->op != KARST_OP_LESS_EQUAL)
        return false;
    for (int i = 0; i < 2; i++) /* one side counts, the other is a choice of numbers */
        if (karst_graph_constant(s->graph, node->arg[i])) {
            range other = range_of(s->graph, node->arg[1 - i], &visits);
            return isfinite(other.low) || isfinite(other.high);
        }
    return false;
}
