/* The canonical forms: what the constructors make of what they are asked for. Each rule keeps the value in real
 * numbers; after this file nobody changes an expression again. */
#include "producers/language/graph/graph.h"
#include "producers/language/graph/uniform.h"

#include <math.h>

static const karst_expr_node *node(const karst_graph *g, karst_expr e) { return &g->nodes[e]; }
static bool is_op(const karst_graph *g, karst_expr e, karst_op op) { return g->nodes[e].op == op; }
static bool is_uniform(const karst_graph *g, karst_expr e) { return karst_graph_is_uniform(g, e); }

static bool is_constant(const karst_graph *g, karst_expr e, int64_t value)
{
    const karst_number *n = karst_graph_constant(g, e);
    return n && karst_number_is(*n, value);
}

static karst_expr raw(karst_graph *g, karst_op op, karst_scalar_type type, karst_expr a, karst_expr b, karst_expr c)
{
    return karst_graph_raw(g, op, type, 0, a, b, c, 0);
}

/* The folded constant if all arguments are constants, else KARST_NO_EXPR. */
static karst_expr fold(karst_graph *g, karst_op op, karst_scalar_type type, karst_expr a, karst_expr b, karst_expr c,
                       karst_expr d)
{
    const karst_expr e[4] = {a, b, c, d};
    karst_number arg[4], result;
    for (int i = 0; i < 4; i++) {
        const karst_number *n = karst_graph_constant(g, e[i]);
        if (e[i] && !n)
            return KARST_NO_EXPR;
        arg[i] = n ? *n : karst_number_int(0);
    }
    return karst_uniform_apply(op, type, node(g, a)->type, arg, &result) ? karst_graph_number(g, type, result)
                                                                         : KARST_NO_EXPR;
}

static void sort(karst_expr *a, karst_expr *b)
{
    if (*a > *b) {
        karst_expr t = *a;
        *a = *b;
        *b = t;
    }
}

/* x and K of K * x, K uniform and x not. */
static bool is_scaled(const karst_graph *g, karst_expr e, karst_expr *x, karst_expr *k)
{
    const karst_expr_node *n = node(g, e);
    if (n->op != KARST_OP_MULTIPLY || is_uniform(g, n->arg[0]) == is_uniform(g, n->arg[1]))
        return false;
    bool first = is_uniform(g, n->arg[0]);
    *k = n->arg[first ? 0 : 1];
    *x = n->arg[first ? 1 : 0];
    return true;
}

/* ---- float arithmetic ---- */

static karst_expr fused(karst_graph *g, karst_expr a, karst_expr b, karst_expr c)
{
    if (is_constant(g, a, 0) || is_constant(g, b, 0))
        return c;
    if (is_constant(g, c, 0))
        return karst_expr_2(g, KARST_OP_MULTIPLY, a, b);
    if (is_constant(g, a, 1))
        return karst_expr_2(g, KARST_OP_ADD, b, c);
    if (is_constant(g, b, 1))
        return karst_expr_2(g, KARST_OP_ADD, a, c);
    sort(&a, &b);
    return raw(g, KARST_OP_FMA, KARST_TYPE_FLOAT, a, b, c);
}

static karst_expr add(karst_graph *g, karst_expr a, karst_expr b)
{
    karst_expr x, k;
    sort(&a, &b);
    if (is_constant(g, a, 0))
        return b;
    if (is_constant(g, b, 0))
        return a;
    if (is_op(g, b, KARST_OP_NEGATE))
        return karst_expr_2(g, KARST_OP_SUBTRACT, a, node(g, b)->arg[0]);
    if (is_op(g, a, KARST_OP_NEGATE))
        return karst_expr_2(g, KARST_OP_SUBTRACT, b, node(g, a)->arg[0]);
    if (is_scaled(g, b, &x, &k)) /* acc + K * noise: the newer product goes into the sum */
        return fused(g, x, k, a);
    if (is_scaled(g, a, &x, &k))
        return fused(g, x, k, b);
    return raw(g, KARST_OP_ADD, KARST_TYPE_FLOAT, a, b, 0);
}

static karst_expr subtract(karst_graph *g, karst_expr a, karst_expr b)
{
    karst_expr x, k;
    if (a == b)
        return karst_graph_float(g, 0);
    if (is_constant(g, b, 0))
        return a;
    if (is_constant(g, a, 0))
        return karst_expr_1(g, KARST_OP_NEGATE, b);
    if (karst_graph_constant(g, b))
        return add(g, a, karst_expr_1(g, KARST_OP_NEGATE, b));
    if (is_op(g, b, KARST_OP_NEGATE))
        return add(g, a, node(g, b)->arg[0]);
    if (is_scaled(g, b, &x, &k))
        return fused(g, x, karst_expr_1(g, KARST_OP_NEGATE, k), a);
    if (is_scaled(g, a, &x, &k) && is_uniform(g, b))
        return fused(g, x, k, karst_expr_1(g, KARST_OP_NEGATE, b));
    return raw(g, KARST_OP_SUBTRACT, KARST_TYPE_FLOAT, a, b, 0);
}

static karst_expr multiply(karst_graph *g, karst_expr a, karst_expr b)
{
    karst_expr x, k;
    sort(&a, &b);
    if (is_constant(g, a, 0) || is_constant(g, b, 0))
        return karst_graph_float(g, 0);
    if (is_constant(g, a, 1))
        return b;
    if (is_constant(g, b, 1))
        return a;
    if (is_constant(g, a, -1))
        return karst_expr_1(g, KARST_OP_NEGATE, b);
    if (is_constant(g, b, -1))
        return karst_expr_1(g, KARST_OP_NEGATE, a);
    if (is_op(g, a, KARST_OP_NEGATE) && is_op(g, b, KARST_OP_NEGATE))
        return multiply(g, node(g, a)->arg[0], node(g, b)->arg[0]);
    for (int side = 0; side < 2; side++) {
        karst_expr u = side ? b : a, v = side ? a : b;
        if (!is_uniform(g, u) || is_uniform(g, v))
            continue;
        if (is_op(g, v, KARST_OP_NEGATE))
            return multiply(g, karst_expr_1(g, KARST_OP_NEGATE, u), node(g, v)->arg[0]);
        if (is_scaled(g, v, &x, &k))
            return multiply(g, x, karst_expr_2(g, KARST_OP_MULTIPLY, u, k));
    }
    return raw(g, KARST_OP_MULTIPLY, KARST_TYPE_FLOAT, a, b, 0);
}

/* Its reciprocal is exact, so that division may become multiplication. */
static bool is_power_of_two(const karst_number *n)
{
    if (!n || !n->denominator || !n->numerator)
        return false;
    uint64_t m = n->numerator < 0 ? 0 - (uint64_t)n->numerator : (uint64_t)n->numerator;
    return !(m & (m - 1)) && !(n->denominator & (n->denominator - 1));
}

static karst_expr divide(karst_graph *g, karst_expr a, karst_expr b)
{
    const karst_number *n = karst_graph_constant(g, b);
    if (is_constant(g, b, 1))
        return a;
    if (is_constant(g, b, -1))
        return karst_expr_1(g, KARST_OP_NEGATE, a);
    if (is_power_of_two(n))
        return karst_expr_2(g, KARST_OP_MULTIPLY, a,
                            karst_graph_number(g, KARST_TYPE_FLOAT, karst_number_divide(karst_number_int(1), *n)));
    return raw(g, KARST_OP_DIVIDE, KARST_TYPE_FLOAT, a, b, 0);
}

static karst_expr negate(karst_graph *g, karst_expr a)
{
    karst_expr x, k;
    if (is_op(g, a, KARST_OP_NEGATE))
        return node(g, a)->arg[0];
    if (is_op(g, a, KARST_OP_SUBTRACT))
        return karst_expr_2(g, KARST_OP_SUBTRACT, node(g, a)->arg[1], node(g, a)->arg[0]);
    if (is_scaled(g, a, &x, &k) && karst_graph_constant(g, k))
        return multiply(g, x, karst_expr_1(g, KARST_OP_NEGATE, k));
    return raw(g, KARST_OP_NEGATE, KARST_TYPE_FLOAT, a, 0, 0);
}

static bool are_opposite(const karst_graph *g, karst_expr a, karst_expr b)
{
    return (is_op(g, a, KARST_OP_NEGATE) && node(g, a)->arg[0] == b) ||
           (is_op(g, b, KARST_OP_NEGATE) && node(g, b)->arg[0] == a) ||
           (is_op(g, a, KARST_OP_SUBTRACT) && is_op(g, b, KARST_OP_SUBTRACT) &&
            node(g, a)->arg[0] == node(g, b)->arg[1] && node(g, a)->arg[1] == node(g, b)->arg[0]);
}

static karst_expr absolute(karst_graph *g, karst_expr a)
{
    if (is_op(g, a, KARST_OP_NEGATE))
        a = node(g, a)->arg[0];
    if (is_op(g, a, KARST_OP_ABS) || is_op(g, a, KARST_OP_LENGTH) || is_op(g, a, KARST_OP_SQRT))
        return a;
    if (is_op(g, a, KARST_OP_SUBTRACT) && node(g, a)->arg[0] > node(g, a)->arg[1])
        a = karst_expr_2(g, KARST_OP_SUBTRACT, node(g, a)->arg[1], node(g, a)->arg[0]); /* |a - b| = |b - a| */
    return raw(g, KARST_OP_ABS, KARST_TYPE_FLOAT, a, 0, 0);
}

static karst_expr extremum(karst_graph *g, karst_op op, karst_expr a, karst_expr b)
{
    if (a == b)
        return a;
    if (are_opposite(g, a, b)) {
        karst_expr x = absolute(g, is_op(g, a, KARST_OP_NEGATE) ? b : a);
        return op == KARST_OP_MAX ? x : karst_expr_1(g, KARST_OP_NEGATE, x);
    }
    return raw(g, op, KARST_TYPE_FLOAT, a, b, 0);
}

/* Gathers the squares that a sum is made of. */
static bool gather_squares(const karst_graph *g, karst_expr e, karst_expr *v, int *n, int depth)
{
    const karst_expr_node *s = node(g, e);
    if (depth > 4)
        return false;
    if (s->op == KARST_OP_ADD)
        return gather_squares(g, s->arg[0], v, n, depth + 1) && gather_squares(g, s->arg[1], v, n, depth + 1);
    bool square = (s->op == KARST_OP_MULTIPLY || s->op == KARST_OP_FMA) && s->arg[0] == s->arg[1];
    if (!square || (s->op == KARST_OP_FMA && !gather_squares(g, s->arg[2], v, n, depth + 1)) || *n == 4)
        return false;
    v[(*n)++] = s->arg[0];
    return true;
}

static karst_expr root(karst_graph *g, karst_expr a)
{
    karst_expr v[4];
    int n = 0;
    if (gather_squares(g, a, v, &n, 0))
        return karst_expr_length(g, v, n);
    return raw(g, KARST_OP_SQRT, KARST_TYPE_FLOAT, a, 0, 0);
}

karst_expr karst_expr_length(karst_graph *g, const karst_expr *v, int n)
{
    karst_expr kept[4] = {0};
    int count = 0;
    for (int i = 0; i < n; i++)
        if (!is_constant(g, v[i], 0))
            kept[count++] = v[i];
    if (count < 2)
        return count ? karst_expr_1(g, KARST_OP_ABS, kept[0]) : karst_graph_float(g, 0);
    karst_expr folded = fold(g, KARST_OP_LENGTH, KARST_TYPE_FLOAT, kept[0], kept[1], kept[2], kept[3]);
    return folded ? folded
                  : karst_graph_raw(g, KARST_OP_LENGTH, KARST_TYPE_FLOAT, 0, kept[0], kept[1], kept[2], kept[3]);
}

/* ---- choices ---- */

/* condition ? a : b as min, max or abs, where it is one. */
static karst_expr recognise_choice(karst_graph *g, karst_expr condition, karst_expr a, karst_expr b)
{
    const karst_expr_node *c = node(g, condition);
    if ((c->op != KARST_OP_LESS && c->op != KARST_OP_LESS_EQUAL) || node(g, c->arg[0])->type != KARST_TYPE_FLOAT)
        return KARST_NO_EXPR;
    karst_expr l = c->arg[0], r = c->arg[1];
    /* min(x, y) is y < x ? y : x, to the letter; with <= the tie goes the other way, which only a zero's sign could
     * tell. */
    if (l == a && r == b)
        return extremum(g, KARST_OP_MIN, c->op == KARST_OP_LESS ? b : a, c->op == KARST_OP_LESS ? a : b);
    if (l == b && r == a)
        return extremum(g, KARST_OP_MAX, c->op == KARST_OP_LESS ? b : a, c->op == KARST_OP_LESS ? a : b);
    if (are_opposite(g, a, b)) {
        if (is_constant(g, r, 0) && (l == a || l == b)) /* x < 0 ? -x : x */
            return l == b ? absolute(g, b) : karst_expr_1(g, KARST_OP_NEGATE, absolute(g, a));
        if (is_constant(g, l, 0) && (r == a || r == b)) /* 0 < x ? x : -x */
            return r == a ? absolute(g, a) : karst_expr_1(g, KARST_OP_NEGATE, absolute(g, b));
    }
    return KARST_NO_EXPR;
}

static karst_expr choose_bool(karst_graph *g, karst_expr c, karst_expr a, karst_expr b)
{
    if (is_constant(g, a, 1))
        return karst_expr_2(g, KARST_OP_OR, c, b);
    if (is_constant(g, b, 0))
        return karst_expr_2(g, KARST_OP_AND, c, a);
    if (is_constant(g, a, 0))
        return karst_expr_2(g, KARST_OP_AND, karst_expr_1(g, KARST_OP_NOT, c), b);
    if (is_constant(g, b, 1))
        return karst_expr_2(g, KARST_OP_OR, karst_expr_1(g, KARST_OP_NOT, c), a);
    return KARST_NO_EXPR;
}

static karst_expr choose(karst_graph *g, karst_expr c, karst_expr a, karst_expr b)
{
    const karst_number *known = karst_graph_constant(g, c);
    if (known)
        return known->numerator ? a : b;
    if (is_op(g, c, KARST_OP_NOT))
        return choose(g, node(g, c)->arg[0], b, a);
    if (is_op(g, a, KARST_OP_SELECT) && node(g, a)->arg[0] == c)
        a = node(g, a)->arg[1];
    if (is_op(g, b, KARST_OP_SELECT) && node(g, b)->arg[0] == c)
        b = node(g, b)->arg[2];
    if (a == b)
        return a;
    karst_scalar_type type = node(g, a)->type;
    karst_expr simple = type == KARST_TYPE_FLOAT  ? recognise_choice(g, c, a, b)
                        : type == KARST_TYPE_BOOL ? choose_bool(g, c, a, b)
                                                  : KARST_NO_EXPR;
    return simple ? simple : raw(g, KARST_OP_SELECT, type, c, a, b);
}

static karst_expr logical(karst_graph *g, karst_op op, karst_expr a, karst_expr b)
{
    bool is_or = op == KARST_OP_OR;
    sort(&a, &b);
    for (int side = 0; side < 2; side++) {
        karst_expr x = side ? b : a, y = side ? a : b;
        if (karst_graph_constant(g, x))
            return karst_graph_constant(g, x)->numerator == is_or ? x : y;
        if (is_op(g, x, KARST_OP_NOT) && node(g, x)->arg[0] == y)
            return karst_graph_bool(g, is_or);
        if (is_op(g, x, KARST_OP_OR) || is_op(g, x, KARST_OP_AND)) {
            bool holds = node(g, x)->arg[0] == y || node(g, x)->arg[1] == y;
            if (holds)
                return node(g, x)->op == op ? x : y; /* a || (a || b), a || (a && b) */
        }
    }
    return a == b ? a : raw(g, op, KARST_TYPE_BOOL, a, b, 0);
}

static karst_expr compare(karst_graph *g, karst_op op, karst_expr a, karst_expr b)
{
    bool symmetric = op == KARST_OP_EQUAL || op == KARST_OP_NOT_EQUAL;
    if (a == b && (node(g, a)->type != KARST_TYPE_FLOAT || op == KARST_OP_LESS))
        return karst_graph_bool(g, op == KARST_OP_LESS_EQUAL || op == KARST_OP_EQUAL);
    if (symmetric)
        sort(&a, &b);
    return raw(g, op, KARST_TYPE_BOOL, a, b, 0);
}

static karst_expr invert(karst_graph *g, karst_expr a)
{
    const karst_expr_node *n = node(g, a);
    if (n->op == KARST_OP_NOT)
        return n->arg[0];
    if (n->op == KARST_OP_EQUAL)
        return compare(g, KARST_OP_NOT_EQUAL, n->arg[0], n->arg[1]);
    if (n->op == KARST_OP_NOT_EQUAL)
        return compare(g, KARST_OP_EQUAL, n->arg[0], n->arg[1]);
    return raw(g, KARST_OP_NOT, KARST_TYPE_BOOL, a, 0, 0);
}

static karst_expr integer(karst_graph *g, karst_op op, karst_expr a, karst_expr b)
{
    karst_scalar_type type = node(g, a)->type;
    if (op == KARST_OP_INT_ADD || op == KARST_OP_INT_MULTIPLY || op == KARST_OP_BIT_AND || op == KARST_OP_BIT_OR ||
        op == KARST_OP_BIT_XOR)
        sort(&a, &b);
    for (int side = 0; side < 2; side++) {
        karst_expr x = side ? b : a, y = side ? a : b;
        bool commutes = op == KARST_OP_INT_ADD || op == KARST_OP_BIT_OR || op == KARST_OP_BIT_XOR;
        if (is_constant(g, x, 0) && (commutes || (side && op == KARST_OP_INT_SUBTRACT)))
            return y;
        if (is_constant(g, x, 0) && (op == KARST_OP_INT_MULTIPLY || op == KARST_OP_BIT_AND))
            return x;
        if (is_constant(g, x, 1) && (op == KARST_OP_INT_MULTIPLY || (side && op == KARST_OP_INT_DIVIDE)))
            return y;
    }
    return raw(g, op, type, a, b, 0);
}

/* ---- entry points ---- */

karst_expr karst_expr_1(karst_graph *g, karst_op op, karst_expr a)
{
    karst_scalar_type type = op == KARST_OP_BIT_NOT ? node(g, a)->type
                             : op == KARST_OP_NOT   ? KARST_TYPE_BOOL
                                                    : KARST_TYPE_FLOAT;
    karst_expr folded = fold(g, op, type, a, 0, 0, 0);
    if (folded)
        return folded;
    switch (op) {
    case KARST_OP_NEGATE:
        return negate(g, a);
    case KARST_OP_ABS:
        return absolute(g, a);
    case KARST_OP_SQRT:
        return root(g, a);
    case KARST_OP_NOT:
        return invert(g, a);
    case KARST_OP_FLOOR:
    case KARST_OP_CEIL:
    case KARST_OP_RINT:
        if (is_op(g, a, KARST_OP_FLOOR) || is_op(g, a, KARST_OP_CEIL) || is_op(g, a, KARST_OP_RINT))
            return a;
        break;
    default:
        break;
    }
    return raw(g, op, type, a, 0, 0);
}

karst_expr karst_expr_2(karst_graph *g, karst_op op, karst_expr a, karst_expr b)
{
    bool is_int = op >= KARST_OP_INT_ADD && op <= KARST_OP_SHIFT_RIGHT,
         is_bool = op >= KARST_OP_LESS && op <= KARST_OP_OR;
    karst_scalar_type type = is_int ? node(g, a)->type : is_bool ? KARST_TYPE_BOOL : KARST_TYPE_FLOAT;
    karst_expr folded = fold(g, op, type, a, b, 0, 0);
    if (folded)
        return folded;
    if (is_int)
        return integer(g, op, a, b);
    switch (op) {
    case KARST_OP_ADD:
        return add(g, a, b);
    case KARST_OP_SUBTRACT:
        return subtract(g, a, b);
    case KARST_OP_MULTIPLY:
        return multiply(g, a, b);
    case KARST_OP_DIVIDE:
        return divide(g, a, b);
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        return extremum(g, op, a, b);
    case KARST_OP_AND:
    case KARST_OP_OR:
        return logical(g, op, a, b);
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL:
        return compare(g, op, a, b);
    case KARST_OP_MOD:
        if (is_constant(g, b, 1)) /* the same, but for the last bit below 1 */
            return karst_expr_1(g, KARST_OP_FRACT, a);
        if (is_constant(g, b, 0))
            return karst_graph_float(g, 0);
        break;
    default:
        break;
    }
    return raw(g, op, type, a, b, 0);
}

karst_expr karst_expr_3(karst_graph *g, karst_op op, karst_expr a, karst_expr b, karst_expr c)
{
    karst_expr folded = fold(g, op, node(g, op == KARST_OP_SELECT ? b : a)->type, a, b, c, 0);
    if (folded)
        return folded;
    if (op == KARST_OP_SELECT)
        return choose(g, a, b, c);
    if (op == KARST_OP_FMA)
        return fused(g, a, b, c);
    if (op == KARST_OP_MIX && (is_constant(g, c, 0) || a == b))
        return a;
    if (op == KARST_OP_MIX && is_constant(g, c, 1))
        return b;
    return raw(g, op, KARST_TYPE_FLOAT, a, b, c);
}

karst_expr karst_expr_convert(karst_graph *g, karst_scalar_type type, karst_expr a)
{
    karst_scalar_type from = node(g, a)->type;
    if (from == type)
        return a;
    karst_expr folded = fold(g, KARST_OP_CONVERT, type, a, 0, 0, 0);
    if (folded)
        return folded;
    if (type == KARST_TYPE_BOOL)
        return karst_expr_2(g, KARST_OP_NOT_EQUAL, a, karst_graph_number(g, from, karst_number_int(0)));
    return raw(g, KARST_OP_CONVERT, type, a, 0, 0);
}

karst_expr karst_expr_bits(karst_graph *g, karst_scalar_type type, karst_expr a)
{
    if (node(g, a)->type == type)
        return a;
    karst_expr folded = fold(g, KARST_OP_BITS, type, a, 0, 0, 0);
    return folded ? folded : raw(g, KARST_OP_BITS, type, a, 0, 0);
}
