#include "producers/language/graph/deepen_given.h"
#include "producers/language/graph/uniform.h"

#include <math.h>

/* Work is bounded: nodes looked at to put another in the place of one, those of a function of one number, places at
 * which it is looked at, and such functions. */
#define MOST_REPLACED (1u << 20)
#define MOST_CONE 32
#define NUM_PLACES 256
#define MOST_FADES 512

static bool is_zero(const karst_graph *g, karst_expr e)
{
    const karst_number *n = karst_graph_constant(g, e);
    return n && karst_number_is(*n, 0);
}

static karst_expr made_anew(karst_graph *g, karst_expr e, const karst_expr arg[4])
{
    const karst_expr_node n = g->nodes[e];
    bool is_same = true;
    for (int k = 0; k < 4; k++)
        is_same &= arg[k] == n.arg[k];
    g->where = n.where;
    return is_same
               ? e
               : karst_graph_raw(g, (karst_op)n.op, (karst_scalar_type)n.type, n.extra, arg[0], arg[1], arg[2], arg[3]);
}

/* e with `to` in the place of `from`. */
static karst_expr replaced(karst_graph *g, karst_expr e, karst_expr from, karst_expr to, uint32_t *left)
{
    const uint32_t count = e > from ? e - from : 0;
    if (e == from)
        return to;
    if (!count || count > *left)
        return e;
    *left -= count;
    uint8_t *needed = karst_arena_alloc(g->arena, count + 1);
    karst_expr *anew = karst_arena_alloc(g->arena, (count + 1) * sizeof *anew);
    needed[count] = 1;
    for (uint32_t i = count; i > 0; i--)
        for (int k = 0; needed[i] && k < 4; k++)
            if (g->nodes[from + i].arg[k] >= from)
                needed[g->nodes[from + i].arg[k] - from] = 1;
    anew[0] = to;
    for (uint32_t i = 1; i <= count; i++) {
        karst_expr arg[4];
        for (int k = 0; k < 4; k++) {
            arg[k] = g->nodes[from + i].arg[k];
            arg[k] = needed[i] && arg[k] >= from ? anew[arg[k] - from] : arg[k];
        }
        anew[i] = needed[i] ? made_anew(g, from + i, arg) : from + i;
    }
    return anew[count];
}

/* ---- arms with what conditions say ---- */

typedef struct {
    karst_graph *graph;
    bool leaves; /* cuts are taken away again */
    uint32_t left;
} cutter;

static karst_expr cut(cutter *c, karst_expr arm, karst_op op, karst_expr x, karst_expr bound)
{
    karst_expr cut_off = karst_graph_raw(c->graph, op, KARST_TYPE_FLOAT, 0, x, bound, 0, 0);
    return c->leaves ? replaced(c->graph, arm, cut_off, x, &c->left) : replaced(c->graph, arm, x, cut_off, &c->left);
}

/* x, and the bound, of what is compared as a positive multiple, or a sum with a number, or a square. */
static bool peel(karst_graph *g, karst_expr *x, karst_expr *bound)
{
    const karst_expr_node n = g->nodes[*x];
    for (int k = 0; k < 2 && (n.op == KARST_OP_MULTIPLY || n.op == KARST_OP_ADD || n.op == KARST_OP_DIVIDE); k++) {
        const karst_number *by = karst_graph_constant(g, n.arg[k]);
        if (!by || (n.op == KARST_OP_DIVIDE && k == 0) || (n.op != KARST_OP_ADD && !(by->value > 0)))
            continue;
        karst_op inverse = n.op == KARST_OP_ADD        ? KARST_OP_SUBTRACT
                           : n.op == KARST_OP_MULTIPLY ? KARST_OP_DIVIDE
                                                       : KARST_OP_MULTIPLY;
        *bound = karst_expr_2(g, inverse, *bound, n.arg[k]);
        *x = n.arg[1 - k];
        return true;
    }
    const karst_number *most = karst_graph_constant(g, *bound);
    if (!most || !(most->value > 0))
        return false;
    karst_expr root = karst_expr_1(g, KARST_OP_SQRT, *x);
    if (g->nodes[root].op == KARST_OP_SQRT) /* of no sum of squares */
        return false;
    *x = root;
    *bound = karst_expr_1(g, KARST_OP_SQRT, *bound);
    return true;
}

/* `arm`, which counts where the condition is `truth` alone. */
static karst_expr cut_by(cutter *c, karst_expr condition, bool truth, karst_expr arm, int depth)
{
    const karst_expr_node n = c->graph->nodes[condition];
    karst_expr a = n.arg[0], b = n.arg[1];
    if (depth > 8)
        return arm;
    switch (n.op) {
    case KARST_OP_NOT:
        return cut_by(c, a, !truth, arm, depth + 1);
    case KARST_OP_AND:
    case KARST_OP_OR:
        if (truth == (n.op == KARST_OP_AND))
            arm = cut_by(c, b, truth, cut_by(c, a, truth, arm, depth + 1), depth + 1);
        return arm;
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL: {
        if (c->graph->nodes[a].type != KARST_TYPE_FLOAT)
            return arm;
        karst_expr less = truth ? a : b, more = truth ? b : a;
        bool is_below = karst_graph_constant(c->graph, more) != NULL;
        karst_expr x = is_below ? less : more, bound = is_below ? more : less;
        if (!karst_graph_constant(c->graph, bound) || karst_graph_is_uniform(c->graph, x))
            return arm;
        for (int i = 0; i < 4; i++) {
            arm = cut(c, arm, is_below ? KARST_OP_MIN : KARST_OP_MAX, x, bound);
            if (!peel(c->graph, &x, &bound))
                break;
        }
        return arm;
    }
    default:
        return arm;
    }
}

static karst_expr choose(karst_graph *g, karst_expr condition, karst_expr a, karst_expr b)
{
    return karst_expr_3(g, KARST_OP_SELECT, condition, a, b);
}

static karst_expr cut_choice(cutter *c, karst_expr condition, karst_expr a, karst_expr b)
{
    if (!karst_graph_constant(c->graph, a))
        a = cut_by(c, condition, true, a, 0);
    if (!karst_graph_constant(c->graph, b))
        b = cut_by(c, condition, false, b, 0);
    return choose(c->graph, condition, a, b);
}

/* The k of s + k, KARST_NO_EXPR if e is no such sum. */
static karst_expr addend(karst_graph *g, karst_expr e, karst_expr s)
{
    const karst_expr_node n = g->nodes[e];
    if (is_zero(g, s))
        return KARST_NO_EXPR;
    if (n.op == KARST_OP_FMA && n.arg[2] == s)
        return karst_expr_2(g, KARST_OP_MULTIPLY, n.arg[0], n.arg[1]);
    if (n.op != KARST_OP_ADD || (n.arg[0] != s && n.arg[1] != s))
        return KARST_NO_EXPR;
    return n.arg[n.arg[0] == s ? 1 : 0];
}

static karst_expr enter_choice(cutter *c, karst_expr condition, karst_expr a, karst_expr b)
{
    karst_graph *g = c->graph;
    const karst_expr none = karst_graph_float(g, 0), more = addend(g, a, b), less = more ? 0 : addend(g, b, a);
    if (more)
        return karst_expr_2(g, KARST_OP_ADD, b, cut_choice(c, condition, more, none));
    if (less)
        return karst_expr_2(g, KARST_OP_ADD, a, cut_choice(c, condition, none, less));
    return cut_choice(c, condition, a, b);
}

static karst_expr with_cuts(karst_graph *g, karst_expr density, bool leaves)
{
    cutter c = {.graph = g, .leaves = leaves, .left = MOST_REPLACED};
    karst_expr *anew = karst_arena_alloc(g->arena, (density + 1) * sizeof *anew);
    uint8_t *needed = karst_arena_alloc(g->arena, density + 1);
    needed[density] = 1;
    for (karst_expr e = density; e > 0; e--)
        for (int k = 0; needed[e] && k < 4; k++)
            needed[g->nodes[e].arg[k]] = 1;
    for (karst_expr e = 1; e <= density; e++) {
        const karst_expr_node n = g->nodes[e];
        karst_expr arg[4];
        if (!needed[e])
            continue;
        for (int k = 0; k < 4; k++)
            arg[k] = anew[n.arg[k]];
        g->where = n.where;
        if (n.op == KARST_OP_SELECT && n.type == KARST_TYPE_FLOAT)
            anew[e] = leaves ? cut_choice(&c, arg[0], arg[1], arg[2]) : enter_choice(&c, arg[0], arg[1], arg[2]);
        else
            anew[e] = made_anew(g, e, arg);
    }
    return anew[density];
}

karst_expr karst_given_enter(karst_graph *graph, karst_expr density) { return with_cuts(graph, density, false); }
karst_expr karst_given_leave(karst_graph *graph, karst_expr density) { return with_cuts(graph, density, true); }

/* ---- ranges ---- */

/* An end that floats can hold is theirs, as rounding keeps order. */
static double end_of(double value, int side)
{
    return (double)(float)value == value ? value : value + side * 1e-6 * fabs(value);
}

static karst_range ends(double lo, double hi) { return (karst_range){end_of(lo, -1), end_of(hi, 1)}; }

static double times(double a, double b) { return a == 0 || b == 0 ? 0 : a * b; }

static karst_range product(karst_range a, karst_range b, bool is_square)
{
    const double p = times(a.lo, b.lo), q = times(a.lo, b.hi), r = times(a.hi, b.lo), s = times(a.hi, b.hi);
    if (is_square)
        return (karst_range){a.lo <= 0 && a.hi >= 0 ? 0 : fmin(p, s), fmax(p, s)};
    return (karst_range){fmin(fmin(p, q), fmin(r, s)), fmax(fmax(p, q), fmax(r, s))};
}

static karst_range close_range(const karst_graph *g, karst_expr e, const karst_kinds_settings *settings,
                               const karst_range *ranges)
{
    const karst_expr_node *n = &g->nodes[e];
    const karst_range a = ranges[n->arg[0]], b = ranges[n->arg[1]], c = ranges[n->arg[2]],
                      usual = karst_graph_range_of(g, e, settings, ranges);
    karst_range r = usual, p;
    switch (n->op) {
    case KARST_OP_ADD:
        r = ends(a.lo + b.lo, a.hi + b.hi);
        break;
    case KARST_OP_SUBTRACT:
        r = ends(a.lo - b.hi, a.hi - b.lo);
        break;
    case KARST_OP_MULTIPLY:
        p = product(a, b, n->arg[0] == n->arg[1]);
        r = ends(p.lo, p.hi);
        break;
    case KARST_OP_DIVIDE:
        if (b.lo > 0) {
            p = product(a, (karst_range){1 / b.hi, 1 / b.lo}, false);
            r = ends(p.lo, p.hi);
        }
        break;
    case KARST_OP_FMA:
        p = product(a, b, n->arg[0] == n->arg[1]);
        r = ends(p.lo + c.lo, p.hi + c.hi);
        break;
    default:
        break;
    }
    return r.lo >= usual.lo && r.hi <= usual.hi && r.lo <= r.hi ? r : usual; /* no numbers are not */
}

/* ---- what one number decides ---- */

/* The nodes of a function, in order, of node `of`; and those that its others take. */
typedef struct {
    karst_expr node[MOST_CONE], front[MOST_CONE], of;
    int count, num_front;
} cone;

static bool is_smooth(karst_op op)
{
    return op == KARST_OP_ADD || op == KARST_OP_SUBTRACT || op == KARST_OP_MULTIPLY || op == KARST_OP_DIVIDE ||
           op == KARST_OP_FMA || op == KARST_OP_NEGATE || op == KARST_OP_MIN || op == KARST_OP_MAX ||
           op == KARST_OP_MIX || op == KARST_OP_SQRT || op == KARST_OP_EXP2 || op == KARST_OP_LOG ||
           op == KARST_OP_SIN || op == KARST_OP_COS;
}

/* From e, or from where it was left, down to the next node through which all of it goes, and which has ends. */
static bool find_cone(const karst_graph *g, const karst_range *ranges, cone *c)
{
    while (c->num_front > 0) {
        int last = 0;
        for (int i = 1; i < c->num_front; i++)
            last = c->front[i] > c->front[last] ? i : last;
        const karst_expr x = c->front[last];
        const karst_range r = ranges[x];
        if (c->num_front == 1 && c->count > 0 && x != c->of && isfinite(r.lo) && isfinite(r.hi) && r.lo < r.hi) {
            c->of = x;
            return true;
        }
        const karst_expr_node *n = &g->nodes[x];
        if (!is_smooth((karst_op)n->op) || c->count == MOST_CONE)
            return false;
        c->front[last] = c->front[--c->num_front];
        c->node[c->count++] = x;
        for (int k = 0; k < 4 && n->arg[k]; k++) {
            bool is_there = karst_graph_constant(g, n->arg[k]) != NULL;
            for (int i = 0; i < c->num_front; i++)
                is_there |= c->front[i] == n->arg[k];
            if (!is_there && c->num_front == MOST_CONE)
                return false;
            if (!is_there)
                c->front[c->num_front++] = n->arg[k];
        }
    }
    return false;
}

static double value_at(const karst_graph *g, const cone *c, double t)
{
    double values[MOST_CONE];
    for (int i = c->count - 1; i >= 0; i--) { /* the first is the last that is needed */
        const karst_expr_node *n = &g->nodes[c->node[i]];
        karst_number arg[4], result;
        for (int k = 0; k < 4; k++) {
            const karst_number *known = n->arg[k] ? karst_graph_constant(g, n->arg[k]) : NULL;
            double x = n->arg[k] == c->of ? t : known ? known->value : 0;
            for (int j = i + 1; j < c->count && n->arg[k] != c->of; j++)
                x = c->node[j] == n->arg[k] ? values[j] : x;
            arg[k] = karst_number_double(x);
        }
        if (!karst_uniform_apply((karst_op)n->op, KARST_TYPE_FLOAT, KARST_TYPE_FLOAT, arg, &result))
            return (double)NAN;
        values[i] = result.value;
    }
    return values[0];
}

/* Whether it grows (1) or falls (-1) all the way; 0: neither. */
static int way_of(const karst_graph *g, const cone *c, karst_range along, double end[2])
{
    double before = end[0] = value_at(g, c, along.lo);
    int way = 0;
    for (int i = 1; i <= NUM_PLACES; i++) {
        const double t = i == NUM_PLACES ? along.hi : along.lo + (along.hi - along.lo) * i / NUM_PLACES;
        const double here = end[1] = value_at(g, c, t);
        const int now = here > before ? 1 : here < before ? -1 : 0;
        if (!now || (way && now != way))
            return 0;
        way = now;
        before = here;
    }
    return way;
}

/* Whether it is 0 at an end, or next to it where a cut keeps it from getting there. */
static bool ends_at_0(const karst_graph *g, karst_expr of, double end, double other)
{
    bool is_cut = g->nodes[of].op == KARST_OP_MIN || g->nodes[of].op == KARST_OP_MAX;
    return end == 0 || (is_cut && fabs(end) < 1e-6 * fabs(other));
}

void karst_given_ranges(const karst_graph *graph, const karst_kinds_settings *settings, karst_range *ranges,
                        karst_fade *fades)
{
    uint32_t left = MOST_FADES;
    ranges[0] = (karst_range){0, 0};
    for (karst_expr e = 1; e < graph->num_nodes; e++) {
        cone c = {.front = {e}, .num_front = 1};
        ranges[e] = close_range(graph, e, settings, ranges);
        fades[e] = (karst_fade){.of = KARST_NO_EXPR};
        if (!(ranges[e].lo <= 0) || karst_graph_is_uniform(graph, e) || !is_smooth((karst_op)graph->nodes[e].op))
            continue;
        /* the farther down, the simpler */
        for (int way = 1; way && left && find_cone(graph, ranges, &c); left--) {
            const karst_range along = ranges[c.of];
            double end[2];
            way = way_of(graph, &c, along, end);
            bool rises = way > 0 && ends_at_0(graph, c.of, end[0], end[1]),
                 falls = way < 0 && ends_at_0(graph, c.of, end[1], end[0]);
            if (rises || falls)
                fades[e] = (karst_fade){c.of, along.lo, along.hi, rises};
            const double lo = rises || falls ? 0 : fmin(end[0], end[1]);
            if (way)
                ranges[e] = (karst_range){fmax(ranges[e].lo, lo), fmin(ranges[e].hi, fmax(end[0], end[1]))};
        }
    }
}
