#include "producers/language/graph/uniform.h"

#include <math.h>
#include <string.h>

static karst_number truth(bool b) { return karst_number_int(b); }
static karst_number wrap(karst_scalar_type type, uint32_t bits)
{
    return karst_number_int(type == KARST_TYPE_INT ? (int32_t)bits : (int64_t)bits);
}
static karst_number of_double(double d)
{
    return isfinite(d) ? karst_number_double(d) : (karst_number){.value = isnan(d) ? (double)NAN : d};
}

static karst_number int_divide(karst_scalar_type type, int64_t a, int64_t b, bool modulo)
{
    if (!b)
        return karst_number_int(0);
    return wrap(type, (uint32_t)(modulo ? a % b : a / b)); /* 64 bits: INT_MIN / -1 wraps by itself */
}

static karst_number convert(karst_scalar_type to, karst_scalar_type from, karst_number a)
{
    if (to == KARST_TYPE_BOOL)
        return truth(from == KARST_TYPE_FLOAT ? a.value != 0 : a.numerator != 0);
    if (from == KARST_TYPE_FLOAT && to != KARST_TYPE_FLOAT) {
        if (isnan(a.value))
            return karst_number_int(0);
        int64_t low = to == KARST_TYPE_INT ? INT32_MIN : 0, high = to == KARST_TYPE_INT ? INT32_MAX : UINT32_MAX;
        if (a.value <= (double)low)
            return karst_number_int(low);
        if (a.value >= (double)high)
            return karst_number_int(high);
        return karst_number_int(a.denominator ? a.numerator / a.denominator : (int64_t)a.value);
    }
    return to == KARST_TYPE_FLOAT ? a : wrap(to, (uint32_t)a.numerator);
}

static karst_number reinterpret(karst_scalar_type to, karst_scalar_type from, karst_number a)
{
    uint32_t bits;
    float f;
    if (from == KARST_TYPE_FLOAT) {
        f = karst_number_to_float(a);
        memcpy(&bits, &f, 4);
        return wrap(to, bits);
    }
    bits = (uint32_t)a.numerator;
    memcpy(&f, &bits, 4);
    return of_double((double)f);
}

static karst_number root(karst_number a)
{
    if (a.value < 0)
        return karst_number_int(0);
    return of_double(sqrt(a.value));
}

static karst_number multiply_add(karst_number a, karst_number b, karst_number c)
{
    return karst_number_add(karst_number_multiply(a, b), c);
}

bool karst_uniform_apply(karst_op op, karst_scalar_type type, karst_scalar_type argument_type,
                         const karst_number arg[4], karst_number *result)
{
    karst_number a = arg[0], b = arg[1], c = arg[2], r;
    uint32_t ia = (uint32_t)a.numerator, ib = (uint32_t)b.numerator;
    int order;
    switch (op) {
    case KARST_OP_ADD:
        r = karst_number_add(a, b);
        break;
    case KARST_OP_SUBTRACT:
        r = karst_number_subtract(a, b);
        break;
    case KARST_OP_MULTIPLY:
        r = karst_number_multiply(a, b);
        break;
    case KARST_OP_DIVIDE:
        r = karst_number_divide(a, b);
        break;
    case KARST_OP_FMA:
        r = multiply_add(a, b, c);
        break;
    case KARST_OP_NEGATE:
        r = karst_number_negate(a);
        break;
    case KARST_OP_MIN:
        r = karst_number_compare(b, a) == -1 ? b : a;
        break;
    case KARST_OP_MAX:
        r = karst_number_compare(b, a) == 1 ? b : a;
        break;
    case KARST_OP_ABS:
        r = a.value < 0 ? karst_number_negate(a) : a;
        break;
    case KARST_OP_FLOOR:
        r = karst_number_floor(a);
        break;
    case KARST_OP_CEIL:
        r = karst_number_negate(karst_number_floor(karst_number_negate(a)));
        break;
    case KARST_OP_RINT:
        r = karst_number_rint(a);
        break;
    case KARST_OP_FRACT:
        r = karst_number_subtract(a, karst_number_floor(a));
        break;
    case KARST_OP_MOD:
        r = b.value == 0
                ? karst_number_int(0)
                : karst_number_subtract(a, karst_number_multiply(b, karst_number_floor(karst_number_divide(a, b))));
        break;
    case KARST_OP_MIX:
        r = multiply_add(c, b, karst_number_subtract(a, karst_number_multiply(c, a)));
        break;
    case KARST_OP_SQRT:
        r = root(a);
        break;
    case KARST_OP_LENGTH: {
        karst_number sum = karst_number_multiply(a, a);
        for (int i = 1; i < 4; i++)
            sum = karst_number_add(sum, karst_number_multiply(arg[i], arg[i]));
        r = root(sum);
        break;
    }
    case KARST_OP_SIN:
        r = of_double(karst_double_sin(a.value));
        break;
    case KARST_OP_COS:
        r = of_double(karst_double_cos(a.value));
        break;
    case KARST_OP_EXP2:
        r = of_double(karst_double_exp2(a.value));
        break;
    case KARST_OP_LOG:
        r = of_double(karst_double_log(a.value));
        break;
    case KARST_OP_ATAN:
        r = of_double(karst_double_atan(a.value, b.value));
        break;
    case KARST_OP_LESS:
        r = truth(karst_number_compare(a, b) == -1);
        break;
    case KARST_OP_LESS_EQUAL:
        order = karst_number_compare(a, b);
        r = truth(order == -1 || order == 0);
        break;
    case KARST_OP_EQUAL:
        r = truth(karst_number_compare(a, b) == 0);
        break;
    case KARST_OP_NOT_EQUAL:
        r = truth(karst_number_compare(a, b) != 0);
        break;
    case KARST_OP_NOT:
        r = truth(!a.numerator);
        break;
    case KARST_OP_AND:
        r = truth(a.numerator && b.numerator);
        break;
    case KARST_OP_OR:
        r = truth(a.numerator || b.numerator);
        break;
    case KARST_OP_SELECT:
        r = a.numerator ? b : c;
        break;
    case KARST_OP_INT_ADD:
        r = wrap(type, ia + ib);
        break;
    case KARST_OP_INT_SUBTRACT:
        r = wrap(type, ia - ib);
        break;
    case KARST_OP_INT_MULTIPLY:
        r = wrap(type, ia * ib);
        break;
    case KARST_OP_INT_DIVIDE:
        r = int_divide(type, a.numerator, b.numerator, false);
        break;
    case KARST_OP_INT_MODULO:
        r = int_divide(type, a.numerator, b.numerator, true);
        break;
    case KARST_OP_BIT_AND:
        r = wrap(type, ia & ib);
        break;
    case KARST_OP_BIT_OR:
        r = wrap(type, ia | ib);
        break;
    case KARST_OP_BIT_XOR:
        r = wrap(type, ia ^ ib);
        break;
    case KARST_OP_BIT_NOT:
        r = wrap(type, ~ia);
        break;
    case KARST_OP_SHIFT_LEFT:
        r = wrap(type, ia << (ib & 31));
        break;
    case KARST_OP_SHIFT_RIGHT:
        r = wrap(type, type == KARST_TYPE_INT ? (uint32_t)((int32_t)ia >> (ib & 31)) : ia >> (ib & 31));
        break;
    case KARST_OP_CONVERT:
        r = convert(type, argument_type, a);
        break;
    case KARST_OP_BITS:
        r = reinterpret(type, argument_type, a);
        break;
    default:
        return false;
    }
    *result = r;
    return true;
}

static bool evaluate_node(const karst_graph *graph, const karst_expr_node *n, const karst_number *parameters,
                          const karst_number *values, const uint8_t *known, karst_number *value)
{
    if (n->op == KARST_OP_CONSTANT) {
        *value = graph->constants[n->extra];
        return true;
    }
    if (n->op == KARST_OP_PARAMETER) {
        *value = parameters[n->extra];
        return true;
    }
    karst_number arg[4] = {{0}};
    for (int k = 0; k < 4; k++) {
        if (n->arg[k] && !known[n->arg[k]])
            return false;
        arg[k] = n->arg[k] ? values[n->arg[k]] : karst_number_int(0);
    }
    return karst_uniform_apply(n->op, n->type, graph->nodes[n->arg[0]].type, arg, value);
}

void karst_uniform_evaluate(const karst_graph *graph, const karst_number *parameters, karst_number *values,
                            uint8_t *known)
{
    known[0] = 0;
    for (uint32_t i = 1; i < graph->num_nodes; i++)
        known[i] = karst_graph_is_uniform(graph, i) &&
                   evaluate_node(graph, &graph->nodes[i], parameters, values, known, &values[i]);
}

static bool value_of(const karst_graph *graph, karst_expr e, const karst_number *parameters, bool *reads,
                     unsigned depth, unsigned *steps, karst_number *value)
{
    const karst_expr_node *n = &graph->nodes[e];
    if (depth > 1000 || ++*steps > 100000 || !karst_graph_is_uniform(graph, e))
        return false;
    if (n->op == KARST_OP_CONSTANT) {
        *value = graph->constants[n->extra];
        return true;
    }
    if (n->op == KARST_OP_PARAMETER) {
        reads[n->extra] = true;
        *value = parameters[n->extra];
        return true;
    }
    karst_number arg[4];
    for (int k = 0; k < 4; k++) {
        arg[k] = karst_number_int(0);
        if (n->arg[k] && !value_of(graph, n->arg[k], parameters, reads, depth + 1, steps, &arg[k]))
            return false;
    }
    return karst_uniform_apply(n->op, n->type, graph->nodes[n->arg[0]].type, arg, value);
}

bool karst_uniform_value(const karst_graph *graph, karst_expr e, const karst_number *parameters, bool *reads,
                         karst_number *value)
{
    unsigned steps = 0;
    return value_of(graph, e, parameters, reads, 0, &steps, value);
}
