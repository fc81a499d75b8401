#include "producers/language/graph/deepen_forms.h"
#include "producers/language/graph/deepen_given.h"

#include <math.h>

typedef struct {
    karst_graph *graph;
    const karst_range *ranges; /* of the nodes that were there at first */
    const karst_fade *fades;   /* likewise; NULL: nobody looked */
    karst_expr *anew;          /* of each: what it becomes */
    uint8_t *is_sign; /* of each: only where it is positive counts, so that what is steeper at 0 may stand in */
} rewriter;

static const karst_expr_node *node(const rewriter *r, karst_expr e) { return &r->graph->nodes[e]; }
static bool is_constant(const rewriter *r, karst_expr e) { return karst_graph_constant(r->graph, e) != NULL; }
static bool is_number(const rewriter *r, karst_expr e, int64_t value)
{
    const karst_number *n = karst_graph_constant(r->graph, e);
    return n && karst_number_is(*n, value);
}
static karst_expr two(rewriter *r, karst_op op, karst_expr a, karst_expr b) { return karst_expr_2(r->graph, op, a, b); }
static karst_expr number(rewriter *r, double value) { return karst_graph_float(r->graph, value); }

static bool never_negative(const rewriter *r, karst_expr e) { return r->ranges[e].lo >= 0; }

/* k - e or k * e, k a number, where e is a choice between numbers: that between others. Else KARST_NO_EXPR. */
static karst_expr choice_of(rewriter *r, karst_op op, karst_expr k, karst_expr e)
{
    const karst_expr_node n = *node(r, e);
    return n.op == KARST_OP_SELECT && is_constant(r, n.arg[1]) && is_constant(r, n.arg[2])
               ? karst_expr_3(r->graph, KARST_OP_SELECT, n.arg[0], two(r, op, k, n.arg[1]), two(r, op, k, n.arg[2]))
               : KARST_NO_EXPR;
}

/* k - e, k a number; of what is cut off by a number, cut off on the other side. */
static karst_expr taken_from(rewriter *r, karst_expr k, karst_expr e, int depth)
{
    const karst_expr_node n = *node(r, e);
    const karst_expr choice = choice_of(r, KARST_OP_SUBTRACT, k, e);
    if (choice)
        return choice;
    bool is_cut = (n.op == KARST_OP_MIN || n.op == KARST_OP_MAX) && depth < 8 &&
                  (is_constant(r, n.arg[0]) || is_constant(r, n.arg[1]));
    if (!is_cut)
        return two(r, KARST_OP_SUBTRACT, k, e);
    return two(r, n.op == KARST_OP_MIN ? KARST_OP_MAX : KARST_OP_MIN, taken_from(r, k, n.arg[0], depth + 1),
               taken_from(r, k, n.arg[1], depth + 1));
}

/* `value`, which is 0 where `source` is 0, and positive where that is positive: so that the source's depth shows; of
 * node e, the source alone where that will do, as values often touch 0 too gently to tell where. */
static karst_expr with_depth_of(rewriter *r, karst_expr e, karst_expr value, karst_expr source)
{
    return r->is_sign[e] ? source : two(r, KARST_OP_ADD, value, two(r, KARST_OP_MIN, source, number(r, 0)));
}

/* The t of t * t * (3 - 2 * t). */
static karst_expr faded(const rewriter *r, karst_expr e)
{
    const karst_expr_node *n = node(r, e);
    for (int k = 0; k < 2 && n->op == KARST_OP_MULTIPLY; k++) {
        const karst_expr_node *square = node(r, n->arg[k]), *line = node(r, n->arg[1 - k]);
        karst_expr t = square->arg[0];
        if (square->op == KARST_OP_MULTIPLY && square->arg[1] == t && line->op == KARST_OP_FMA &&
            is_number(r, line->arg[2], 3) &&
            ((line->arg[0] == t && is_number(r, line->arg[1], -2)) ||
             (line->arg[1] == t && is_number(r, line->arg[0], -2))))
            return t;
    }
    return KARST_NO_EXPR;
}

static bool is_share(const rewriter *r, karst_expr e)
{
    return r->ranges[e].lo >= 0 && r->ranges[e].hi <= 1;
}

/* What is positive where 1 - e is, if e lies between 0 and 1; else KARST_NO_EXPR. */
static karst_expr rest_of(rewriter *r, karst_expr e)
{
    karst_expr t = faded(r, e), one = number(r, 1);
    if (t && is_share(r, t)) /* smoothstep() */
        return taken_from(r, one, r->anew[t], 0);
    return is_share(r, e) ? taken_from(r, one, r->anew[e], 0) : KARST_NO_EXPR;
}

/* x of x + 1 or 1 + x. */
static karst_expr above_one(const rewriter *r, karst_expr e)
{
    const karst_expr_node *n = node(r, e);
    for (int k = 0; k < 2 && n->op == KARST_OP_ADD; k++)
        if (is_number(r, n->arg[k], 1))
            return n->arg[1 - k];
    return KARST_NO_EXPR;
}

/* Whether `size` is the magnitude of x, or of -x: the graph writes both the same way. */
static bool is_size_of(rewriter *r, karst_expr size, karst_expr x)
{
    return node(r, size)->op == KARST_OP_ABS && karst_expr_1(r->graph, KARST_OP_ABS, x) == size;
}

/* |x| + x */
static karst_expr twice_what_is_positive(rewriter *r, karst_expr x)
{
    return two(r, KARST_OP_MULTIPLY, number(r, 2), two(r, KARST_OP_MAX, x, number(r, 0)));
}

static karst_expr negative(rewriter *r, karst_expr e) { return taken_from(r, number(r, 0), e, 0); }

/* k |x| + k x and k |x| - k x as the graph has them, with one product in the sum. k is a power of 2, or rounding would
 * leave something. */
static karst_expr fused_sum(rewriter *r, const karst_expr arg[3])
{
    const karst_expr_node c = *node(r, arg[2]);
    int exponent;
    for (int i = 0; i < 4 && c.op == KARST_OP_MULTIPLY; i++) {
        const karst_expr part[2] = {arg[i & 1], c.arg[i / 2]}, factor[2] = {arg[1 - (i & 1)], c.arg[1 - i / 2]};
        const karst_number *k = karst_graph_constant(r->graph, factor[0]),
                           *l = karst_graph_constant(r->graph, factor[1]);
        if (!k || !l || fabs(k->value) != fabs(l->value) || frexp(fabs(k->value), &exponent) != 0.5)
            continue;
        const int size = is_size_of(r, part[1], part[0]);
        if (!size && !is_size_of(r, part[0], part[1]))
            continue;
        const karst_expr x = k->value == l->value ? part[1 - size] : negative(r, part[1 - size]);
        return two(r, KARST_OP_MULTIPLY, factor[size], twice_what_is_positive(r, x));
    }
    return KARST_NO_EXPR;
}

static karst_expr difference(rewriter *r, karst_expr e, karst_expr a, karst_expr b)
{
    const karst_expr_node n = *node(r, e);
    if (is_size_of(r, a, b)) /* |x| - x */
        return twice_what_is_positive(r, negative(r, b));
    if (is_number(r, a, 1) && faded(r, n.arg[1]) && is_share(r, faded(r, n.arg[1])))
        return with_depth_of(r, e, two(r, KARST_OP_SUBTRACT, a, b), rest_of(r, n.arg[1]));
    if (is_constant(r, a))
        return taken_from(r, a, b, 0);
    bool both = never_negative(r, n.arg[0]) && never_negative(r, n.arg[1]) && !is_constant(r, b);
    karst_expr d = two(r, KARST_OP_SUBTRACT, a, b);
    return both ? two(r, KARST_OP_ADD, d, two(r, KARST_OP_MIN, two(r, KARST_OP_MAX, a, b), number(r, 0))) : d;
}

static karst_expr sum(rewriter *r, karst_expr e, karst_expr a, karst_expr b)
{
    const karst_expr_node sum = *node(r, e), *n = &sum;
    if (r->is_sign[e] && never_negative(r, n->arg[0]) && never_negative(r, n->arg[1]))
        return two(r, KARST_OP_MAX, a, b);
    for (int k = 0; k < 2; k++) {
        karst_expr x = k ? a : b;
        if (is_size_of(r, k ? b : a, x))
            return twice_what_is_positive(r, x);
        const karst_expr_node *power = node(r, k ? b : a);
        if (is_number(r, x, -1) && power->op == KARST_OP_EXP2) /* 2^x - 1 */
            return with_depth_of(r, e, two(r, KARST_OP_ADD, a, b), power->arg[0]);
    }
    return two(r, KARST_OP_ADD, a, b);
}

/* x of x^k = 2^(k log x), k > 0, which devices give 2^-126 for where x is 0. */
static karst_expr base_of_power(const rewriter *r, karst_expr exponent)
{
    const karst_expr_node *n = node(r, exponent);
    for (int k = 0; k < 2 && n->op == KARST_OP_MULTIPLY; k++) {
        const karst_number *by = karst_graph_constant(r->graph, n->arg[k]);
        const karst_expr_node *log = node(r, n->arg[1 - k]);
        if (by && by->value > 0 && log->op == KARST_OP_LOG && never_negative(r, log->arg[0]))
            return log->arg[0];
    }
    return KARST_NO_EXPR;
}

static karst_expr blend(rewriter *r, karst_expr e, const karst_expr *arg)
{
    const karst_expr_node copy = *node(r, e), *n = &copy;
    karst_expr rest = rest_of(r, n->arg[2]);
    karst_expr mix = karst_expr_3(r->graph, KARST_OP_MIX, arg[0], arg[1], arg[2]);
    if (rest && is_number(r, arg[1], 0) && never_negative(r, n->arg[0]))
        return with_depth_of(r, e, mix, two(r, KARST_OP_MULTIPLY, arg[0], rest));
    bool both = never_negative(r, n->arg[0]) && never_negative(r, n->arg[1]) && !is_constant(r, arg[0]) &&
                !is_constant(r, arg[1]);
    if (!rest || !both)
        return mix;
    return with_depth_of(r, e, mix,
                         two(r, KARST_OP_MAX, two(r, KARST_OP_MULTIPLY, arg[0], rest),
                             two(r, KARST_OP_MULTIPLY, arg[1], arg[2])));
}

/* Of what is never negative the least; of x * x * x, x. */
static karst_expr product(rewriter *r, karst_expr e, karst_expr a, karst_expr b)
{
    const karst_expr_node n = *node(r, e);
    for (int k = 0; k < 2 && r->is_sign[e]; k++) {
        const karst_expr_node *square = node(r, n.arg[k]);
        karst_expr x = n.arg[1 - k];
        if (square->op == KARST_OP_MULTIPLY && square->arg[0] == x && square->arg[1] == x)
            return r->anew[x];
    }
    bool is_scaled = is_constant(r, a) || is_constant(r, b);
    const karst_expr choice = is_constant(r, a)   ? choice_of(r, KARST_OP_MULTIPLY, a, b)
                              : is_constant(r, b) ? choice_of(r, KARST_OP_MULTIPLY, b, a)
                                                  : KARST_NO_EXPR;
    if (r->is_sign[e] && choice)
        return choice;
    if (r->is_sign[e] && !is_scaled && r->ranges[n.arg[0]].lo > 0)
        return b;
    if (r->is_sign[e] && !is_scaled && r->ranges[n.arg[1]].lo > 0)
        return a;
    if (r->is_sign[e] && !is_scaled && never_negative(r, n.arg[0]) && never_negative(r, n.arg[1]))
        return two(r, KARST_OP_MIN, a, b);
    return a == n.arg[0] && b == n.arg[1] ? e : two(r, KARST_OP_MULTIPLY, a, b);
}

/* Whether of argument k, too, no more counts than where it is positive. */
static bool passes_sign(const rewriter *r, const karst_expr_node *n, int k)
{
    bool both = n->arg[1] && never_negative(r, n->arg[0]) && never_negative(r, n->arg[1]);
    switch (n->op) {
    case KARST_OP_SELECT:
        return k > 0;
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_CEIL:
        return true;
    case KARST_OP_MULTIPLY:
        return both || r->ranges[n->arg[1 - k]].lo > 0;
    case KARST_OP_ADD:
        return both;
    case KARST_OP_DIVIDE:
        return k == 0 && r->ranges[n->arg[1]].lo > 0;
    case KARST_OP_SQRT:
    case KARST_OP_ABS:
        return never_negative(r, n->arg[0]);
    default:
        return false;
    }
}

#define HALF_TURN 3.14159

/* The fade of a node of which no more counts than where it is positive. Multiples are as good as what they are of. */
static const karst_fade *fade_of(const rewriter *r, karst_expr e)
{
    const karst_expr_node *n = node(r, e);
    bool is_multiple = (n->op == KARST_OP_MULTIPLY || n->op == KARST_OP_DIVIDE) &&
                       (is_constant(r, n->arg[0]) || is_constant(r, n->arg[1]));
    return r->fades && r->is_sign[e] && r->fades[e].of && !is_multiple ? &r->fades[e] : NULL;
}

/* The end at which a fade is 0: the very number at which its node is cut off, if that is it. */
static karst_expr end_of(rewriter *r, const karst_fade *fade)
{
    const karst_expr_node n = *node(r, fade->of);
    const double end = fade->rises ? fade->lo : fade->hi;
    for (int k = 0; k < 2 && (n.op == KARST_OP_MIN || n.op == KARST_OP_MAX); k++) {
        const karst_number *bound = karst_graph_constant(r->graph, n.arg[k]);
        if (bound && bound->value == end)
            return n.arg[k];
    }
    return number(r, end);
}

static karst_expr rewrite(rewriter *r, karst_expr e)
{
    const karst_expr_node n = *node(r, e);
    const karst_fade *fade = fade_of(r, e);
    karst_expr arg[4], x;
    bool is_same = true;
    if (fade && fade->rises)
        return fade->lo == 0 ? r->anew[fade->of] : two(r, KARST_OP_SUBTRACT, r->anew[fade->of], end_of(r, fade));
    if (fade)
        return taken_from(r, end_of(r, fade), r->anew[fade->of], 0);
    for (int k = 0; k < 4; k++) {
        arg[k] = n.arg[k] ? r->anew[n.arg[k]] : KARST_NO_EXPR;
        is_same = is_same && arg[k] == n.arg[k];
    }
    switch (n.op) {
    case KARST_OP_NEGATE:
        return taken_from(r, number(r, 0), arg[0], 0);
    case KARST_OP_SUBTRACT:
        return difference(r, e, arg[0], arg[1]);
    case KARST_OP_ADD:
        return sum(r, e, arg[0], arg[1]);
    case KARST_OP_MIX:
        return blend(r, e, arg);
    case KARST_OP_LOG: /* of 1 + x */
        x = above_one(r, arg[0]);
        return x && above_one(r, n.arg[0]) && never_negative(r, above_one(r, n.arg[0]))
                   ? with_depth_of(r, e, e, x)
                   : e;
    case KARST_OP_LENGTH:
        x = arg[0];
        for (int k = 0; k < 4 && n.arg[k]; k++) {
            if (!never_negative(r, n.arg[k]) || is_constant(r, arg[k]))
                return e;
            x = k ? two(r, KARST_OP_MAX, x, arg[k]) : x;
        }
        return with_depth_of(r, e, e, x);
    case KARST_OP_ATAN: /* and sines that come to no half turn: 0 where what they are of is, else positive */
        if (never_negative(r, n.arg[0]) && r->ranges[n.arg[1]].lo > 0)
            return with_depth_of(r, e, is_same ? e : two(r, n.op, arg[0], arg[1]), arg[0]);
        return is_same ? e : two(r, n.op, arg[0], arg[1]);
    case KARST_OP_SIN:
        if (never_negative(r, n.arg[0]) && r->ranges[n.arg[0]].hi < HALF_TURN)
            return with_depth_of(r, e, is_same ? e : karst_expr_1(r->graph, n.op, arg[0]), arg[0]);
        return is_same ? e : karst_expr_1(r->graph, n.op, arg[0]);
    case KARST_OP_MULTIPLY:
        return product(r, e, arg[0], arg[1]);
    case KARST_OP_MIN:
    case KARST_OP_MAX:
    case KARST_OP_DIVIDE:
        return is_same ? e : two(r, n.op, arg[0], arg[1]);
    case KARST_OP_EXP2:
        x = base_of_power(r, n.arg[0]);
        if (x)
            return with_depth_of(r, e, e, r->anew[x]);
        return is_same ? e : karst_expr_1(r->graph, n.op, arg[0]);
    case KARST_OP_SQRT:
    case KARST_OP_ABS:
        if (r->is_sign[e] && never_negative(r, n.arg[0]))
            return arg[0];
        return is_same ? e : karst_expr_1(r->graph, n.op, arg[0]);
    case KARST_OP_FMA:
        x = fused_sum(r, arg);
        if (x)
            return x;
        return is_same ? e : karst_expr_3(r->graph, n.op, arg[0], arg[1], arg[2]);
    case KARST_OP_CEIL:
        return r->is_sign[e] ? arg[0] : is_same ? e : karst_expr_1(r->graph, n.op, arg[0]);
    case KARST_OP_SELECT:
        return is_same ? e : karst_expr_3(r->graph, n.op, arg[0], arg[1], arg[2]);
    default:
        return e;
    }
}

static void need(rewriter *r, uint8_t *needed, karst_expr e, bool is_sign)
{
    r->is_sign[e] = is_sign && (r->is_sign[e] || !needed[e]);
    needed[e] = 1;
}

static karst_expr rewrite_all(rewriter *r, karst_expr density)
{
    r->anew = karst_arena_alloc(r->graph->arena, (density + 1) * sizeof *r->anew);
    r->is_sign = karst_arena_alloc(r->graph->arena, density + 1);
    uint8_t *needed = karst_arena_alloc(r->graph->arena, density + 1);
    needed[density] = r->is_sign[density] = 1;
    for (karst_expr e = density; e > 0; e--) {
        const karst_expr_node n = *node(r, e);
        const karst_fade *fade = needed[e] ? fade_of(r, e) : NULL;
        if (fade)
            need(r, needed, fade->of, fade->rises && fade->lo == 0);
        for (int k = 0; needed[e] && !fade && k < 4 && n.arg[k]; k++)
            need(r, needed, n.arg[k], r->is_sign[e] && passes_sign(r, &n, k));
    }
    for (karst_expr e = 1; e <= density; e++) {
        r->graph->where = r->graph->nodes[e].where;
        r->anew[e] = needed[e] && r->graph->nodes[e].type == KARST_TYPE_FLOAT ? rewrite(r, e) : e;
    }
    return r->anew[density];
}

/* Whether sums of what choices let in may be flat air: where nothing else says how low the density goes. */
static bool may_be_given(const karst_graph *graph, const karst_range *ranges, karst_expr density)
{
    if (isfinite(ranges[density].lo))
        return ranges[density].lo <= 0;
    for (karst_expr e = 1; e <= density; e++)
        if (graph->nodes[e].op == KARST_OP_SELECT && graph->nodes[e].type == KARST_TYPE_FLOAT)
            return true;
    return false;
}

karst_expr karst_deepen_forms(karst_graph *graph, const karst_kinds_settings *settings, karst_expr density)
{
    karst_range *ranges = karst_arena_alloc(graph->arena, graph->num_nodes * sizeof *ranges);
    karst_graph_ranges(graph, settings, ranges);
    if (may_be_given(graph, ranges, density)) {
        const karst_expr given = karst_given_enter(graph, density);
        karst_range *closer = karst_arena_alloc(graph->arena, graph->num_nodes * sizeof *closer);
        karst_fade *fades = karst_arena_alloc(graph->arena, graph->num_nodes * sizeof *fades);
        karst_given_ranges(graph, settings, closer, fades);
        if (closer[given].lo >= 0) { /* no air but where it is 0 */
            rewriter r = {.graph = graph, .ranges = closer, .fades = fades};
            return karst_given_leave(graph, rewrite_all(&r, given));
        }
    }
    rewriter r = {.graph = graph, .ranges = ranges};
    return rewrite_all(&r, density);
}
