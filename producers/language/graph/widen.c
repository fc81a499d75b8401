/* Where floats do not do: numbers beyond 2^15 voxels that are set against each other, so that their difference is what
 * matters. */
#include "producers/language/graph/kinds.h"

#include <math.h>

typedef struct {
    karst_graph *graph;
    const karst_range *ranges;
    uint8_t *wide;
    double limit; /* 2^15 voxels, in metres: a float is good to 1/512 voxel below */
    bool far;     /* the header says that the world reaches beyond it */
    double
        *gain; /* what a node's errors are multiplied by at least on their way to the density; 1 where that is little */
} widener;

static double supremum(const widener *w, karst_expr e) { return fmax(fabs(w->ranges[e].lo), fabs(w->ranges[e].hi)); }

/* Shapes in units of their own, as (1 - length(p / r)) * r, with an r of so many metres need more than floats there. */
#define MUCH_GAIN 1024.0

static double limit_of(const widener *w, karst_expr e)
{
    const karst_expr_node *n = &w->graph->nodes[e];
    bool is_from_number = false;
    for (int k = 0; k < 2; k++)
        is_from_number |=
            w->graph->nodes[n->arg[k]].kind == KARST_KIND_UNIFORM && !isfinite(supremum(w, n->arg[1 - k]));
    return w->gain[e] < MUCH_GAIN || !is_from_number ? w->limit : w->limit / w->gain[e];
}

static void hand_on(const widener *w, karst_expr e, double factor)
{
    double gain = factor;
    if (isfinite(gain) && gain > w->gain[e])
        w->gain[e] = gain;
}

/* The gain of a node's arguments. */
static void find_gain(const widener *w, karst_expr e)
{
    const karst_expr_node *n = &w->graph->nodes[e];
    const karst_range *b = &w->ranges[n->arg[1]];
    double gain = w->gain[e];
    switch (n->op) {
    case KARST_OP_FMA:
        hand_on(w, n->arg[2], gain); /* fall through */
    case KARST_OP_MULTIPLY:
        for (int k = 0; k < 2; k++)
            if (w->graph->nodes[n->arg[1 - k]].kind == KARST_KIND_UNIFORM)
                hand_on(w, n->arg[k], gain * supremum(w, n->arg[1 - k]));
        return;
    case KARST_OP_DIVIDE:
        if (w->graph->nodes[n->arg[1]].kind == KARST_KIND_UNIFORM)
            hand_on(w, n->arg[0], gain / fmax(fmin(fabs(b->lo), fabs(b->hi)), 1e-30));
        return;
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_NEGATE:
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_ABS:
    case KARST_OP_LENGTH:
        for (int k = 0; k < 4 && n->arg[k]; k++)
            hand_on(w, n->arg[k], gain);
        return;
    case KARST_OP_SELECT:
        hand_on(w, n->arg[1], gain);
        hand_on(w, n->arg[2], gain);
        return;
    default:
        return;
    }
}

/* Whether a and b may cancel: what `sign` (1: a + b, -1: a - b) makes small of two numbers above `limit`. */
static bool cancels(const widener *w, double limit, karst_range a, karst_range b, int sign)
{
    if (sign < 0)
        b = (karst_range){-b.hi, -b.lo};
    if ((a.lo >= 0 && b.lo >= 0) || (a.hi <= 0 && b.hi <= 0))
        return false;
    double sa = fmax(fabs(a.lo), fabs(a.hi)), sb = fmax(fabs(b.lo), fabs(b.hi));
    if (!(sa > limit) || !(sb > limit))
        return false;
    return isfinite(sa) || isfinite(sb) || w->far;
}

static bool has_wide_form(const karst_graph *graph, karst_expr e)
{
    const karst_expr_node *n = &graph->nodes[e];
    switch (n->op) {
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
    case KARST_OP_MULTIPLY:
    case KARST_OP_DIVIDE:
    case KARST_OP_FMA:
    case KARST_OP_NEGATE:
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_ABS:
    case KARST_OP_MIX:
    case KARST_OP_SQRT:
    case KARST_OP_LENGTH:
        return n->kind == KARST_KIND_FLOAT;
    case KARST_OP_SELECT:
        return n->kind == KARST_KIND_FLOAT && n->type == KARST_TYPE_FLOAT;
    default: /* leaves are exact anyway; the rest has no pair */
        return false;
    }
}

static void widen(widener *w, karst_expr e)
{
    if (has_wide_form(w->graph, e))
        w->wide[e] = 1;
}

/* Products and roots hand on relative errors, so all of their arguments count; sums only those that are large
 * themselves. */
static void widen_arguments(widener *w, const karst_expr_node *n)
{
    bool relative =
        n->op == KARST_OP_MULTIPLY || n->op == KARST_OP_DIVIDE || n->op == KARST_OP_SQRT || n->op == KARST_OP_LENGTH;
    for (int k = 0; k < 4; k++) {
        bool factor = relative || (n->op == KARST_OP_FMA && k < 2);
        if (n->arg[k] && w->graph->nodes[n->arg[k]].type == KARST_TYPE_FLOAT &&
            (factor || supremum(w, n->arg[k]) > w->limit))
            widen(w, n->arg[k]);
    }
}

/* Both operands of what subtracts or compares large numbers. */
static void examine(widener *w, karst_expr e)
{
    const karst_expr_node *n = &w->graph->nodes[e];
    const karst_range *r = w->ranges;
    karst_range a = r[n->arg[0]], b = r[n->arg[1]];
    if (n->kind == KARST_KIND_UNIFORM || n->kind == KARST_KIND_STEPS)
        return;
    switch (n->op) {
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        if (cancels(w, limit_of(w, e), a, b, n->op == KARST_OP_ADD ? 1 : -1))
            widen(w, e);
        break;
    case KARST_OP_FMA: {
        double p[4] = {a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi};
        karst_range product = {fmin(fmin(p[0], p[1]), fmin(p[2], p[3])), fmax(fmax(p[0], p[1]), fmax(p[2], p[3]))};
        if (n->arg[0] == n->arg[1])
            product.lo = 0;
        if (isnan(p[0]) || isnan(p[1]) || isnan(p[2]) || isnan(p[3]))
            product = (karst_range){-(double)INFINITY, (double)INFINITY};
        if (cancels(w, w->limit, product, r[n->arg[2]], 1))
            widen(w, e);
        break;
    }
    default:
        break;
    }
}

static void examine_comparison(widener *w, const karst_expr_node *n)
{
    if (n->op < KARST_OP_LESS || n->op > KARST_OP_NOT_EQUAL || w->graph->nodes[n->arg[0]].type != KARST_TYPE_FLOAT)
        return;
    if (cancels(w, w->limit, w->ranges[n->arg[0]], w->ranges[n->arg[1]], -1)) {
        widen(w, n->arg[0]);
        widen(w, n->arg[1]);
    }
}

/* Places that wander off: arguments of periodic functions that are no affine forms and have no bound. */
static void examine_places(widener *w, const karst_expr_node *n)
{
    int count = n->op == KARST_OP_NOISE ? 3
                : n->op == KARST_OP_FRACT || n->op == KARST_OP_MOD || n->op == KARST_OP_FLOOR ||
                        n->op == KARST_OP_SIN || n->op == KARST_OP_COS || n->op == KARST_OP_SIN_TURNS ||
                        n->op == KARST_OP_COS_TURNS
                    ? 1
                    : 0;
    for (int k = 0; k < count; k++) {
        karst_expr a = n->arg[k];
        if (w->graph->nodes[a].op == KARST_OP_SHIFTED)
            a = w->graph->nodes[a].arg[1];
        if (!isfinite(supremum(w, a)))
            widen(w, a);
    }
}

void karst_kinds_widen(karst_graph *resolved, const karst_kinds_settings *settings, const karst_range *ranges,
                       karst_expr density)
{
    widener w = {.graph = resolved, .ranges = ranges};
    w.limit = ldexp(1.0, 15 + settings->voxel_log2_m + settings->exact_above_log2);
    w.far = settings->extent_m > w.limit;
    w.wide = karst_arena_alloc(resolved->arena, resolved->num_nodes);
    w.gain = karst_arena_alloc(resolved->arena, resolved->num_nodes * sizeof *w.gain);
    w.gain[density] = 1;
    for (uint32_t e = density; e > 0; e--)
        if (w.gain[e] > 0)
            find_gain(&w, e);
    for (uint32_t e = resolved->num_nodes - 1; e > 0; e--) {
        const karst_expr_node *n = &resolved->nodes[e];
        examine(&w, e);
        examine_comparison(&w, n);
        examine_places(&w, n);
        if (w.wide[e])
            widen_arguments(&w, n);
    }
    for (uint32_t e = 1; e < resolved->num_nodes; e++)
        if (w.wide[e])
            resolved->nodes[e].kind = KARST_KIND_WIDE;
}
