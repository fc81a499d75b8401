/* Expressions: operators, choices, assignments. */
#include "producers/language/front/lower_internal.h"

#include <string.h>

/* As in C and HLSL, an int is true unless it is 0. */
static karst_value truth_of(karst_lower_state *s, karst_value v, uint32_t where)
{
    if (v.type->shape != KARST_SHAPE_SCALAR || (v.type->scalar != KARST_TYPE_INT && v.type->scalar != KARST_TYPE_UINT))
        return v;
    karst_value r = karst_value_new(s, karst_type_vector(KARST_TYPE_BOOL, 1), where);
    r.e[0] = karst_expr_2(s->graph, KARST_OP_NOT_EQUAL, v.e[0],
                          karst_graph_number(s->graph, v.type->scalar, karst_number_int(0)));
    return r;
}

karst_expr karst_lower_condition(karst_lower_state *s, const karst_ast_expr *e, const char *context)
{
    karst_value v = truth_of(s, karst_lower_expression(s, e), e->where);
    if (v.type != karst_type_vector(KARST_TYPE_BOOL, 1))
        karst_source_error(s->source, e->where,
                           e->kind == KARST_AST_ASSIGN                        ? "= assigns: write == to compare"
                           : karst_type_is_plain(v.type) && v.type->size == 1 ? "write x != 0"
                                                                              : "use all(...) or any(...)",
                           "%s is a bool, not %s", context, karst_a_type(s, v.type));
    return v.e[0];
}

/* "{}", and C's "{0}" of what has several parts. */
static bool is_all_zero(const karst_ast_expr *list, uint32_t count)
{
    const karst_ast_expr *a = list->a;
    return !a || (!a->next && count > 1 && a->kind == KARST_AST_NUMBER && a->number.value == 0);
}

/* How many elements, none of which is in braces itself, or named; 0: some is. */
static uint32_t num_plain(const karst_ast_expr *list)
{
    uint32_t listed = 0;
    for (const karst_ast_expr *a = list->a; a; a = a->next, listed++)
        if (a->kind == KARST_AST_LIST || a->kind == KARST_AST_FIELD)
            return 0;
    return listed;
}

/* C's lists of all numbers of an array in a row. */
static bool is_flat(const karst_ast_expr *list, const karst_type *type)
{
    return type->shape == KARST_SHAPE_ARRAY && type->element->num_scalars > 1 && num_plain(list) == type->num_scalars;
}

/* Which field an element is for: the next, or the one that it names. */
static uint32_t element_of(karst_lower_state *s, const karst_ast_expr *a, const karst_type *type, uint32_t next)
{
    if (a->kind != KARST_AST_FIELD)
        return next;
    uint32_t i = 0;
    while (type->shape == KARST_SHAPE_STRUCT && i < type->num_fields && type->fields[i].name != a->name)
        i++;
    if (type->shape != KARST_SHAPE_STRUCT || i == type->num_fields)
        karst_source_error(s->source, a->where, NULL, "%s has no field '%s'", karst_a_type(s, type),
                           karst_lower_name(s, a->name));
    return i;
}

static void lower_flat(karst_lower_state *s, const karst_ast_expr *list, const karst_type *type, karst_value r)
{
    const karst_type *scalar = type->element;
    while (scalar->shape != KARST_SHAPE_SCALAR && scalar->shape != KARST_SHAPE_STRUCT)
        scalar = scalar->element;
    uint32_t i = 0;
    for (const karst_ast_expr *a = list->a; a; a = a->next)
        r.e[i++] =
            karst_lower_convert(s, karst_lower_expression(s, a), scalar, "this element", a->where).e[0];
}

karst_value karst_rule_initialiser(karst_lower_state *s, const karst_ast_expr *e, const karst_type *type)
{
    if (e->kind != KARST_AST_LIST)
        return karst_lower_convert(s, karst_lower_expression(s, e), type, "this variable", e->where);
    if ((type->shape == KARST_SHAPE_VECTOR || type->shape == KARST_SHAPE_MATRIX) && num_plain(e) > 1) {
        karst_ast_type of = {.base = type}; /* HLSL's { v, 1 } is vec4(v, 1) */
        karst_ast_expr made = {.kind = KARST_AST_CONSTRUCT, .where = e->where, .a = e->a, .of = &of};
        return karst_lower_construct(s, &made);
    }
    karst_lower_enter(s, e->where);
    karst_value r = karst_value_zero(s, type, e->where);
    const bool is_struct = type->shape == KARST_SHAPE_STRUCT, is_scalar = type->shape == KARST_SHAPE_SCALAR;
    const uint32_t count = is_struct ? type->num_fields : is_scalar ? 1 : type->count;
    uint32_t i = 0;
    bool is_named = false;
    if (is_all_zero(e, count)) {
        karst_lower_leave(s);
        return r;
    }
    if (is_flat(e, type)) {
        lower_flat(s, e, type, r);
        karst_lower_leave(s);
        return r;
    }
    for (const karst_ast_expr *a = e->a; a; a = a->next, i++) {
        is_named |= a->kind == KARST_AST_FIELD;
        i = element_of(s, a, type, i);
        if (i >= count)
            karst_source_error(s->source, a->where, NULL, "%s has %u elements, and the list has more",
                               karst_a_type(s, type), count);
        const karst_type *part = is_struct ? type->fields[i].type : is_scalar ? type : type->element;
        const uint32_t offset = is_struct ? type->fields[i].offset : i * part->num_scalars;
        const karst_ast_expr *value = a->kind == KARST_AST_FIELD ? a->a : a;
        memcpy(r.e + offset, karst_lower_initialiser(s, value, part).e, part->num_scalars * sizeof *r.e);
    }
    if (i < count && !is_named)
        karst_source_error(s->source, e->where, NULL, "%s has %u elements, not %u", karst_a_type(s, type), count, i);
    karst_lower_leave(s);
    return r;
}

/* ---- operators ---- */

static _Noreturn void bad_operands(karst_lower_state *s, uint32_t op, karst_value a, karst_value b, uint32_t where)
{
    const char spelt[3] = {(char)(op & 0xff), (char)(op >> 8 & 0xff), 0}, *hint = NULL;
    if (karst_type_is_plain(a.type) && karst_type_is_plain(b.type) &&
        (a.type->size == b.type->size || a.type->size == 1 || b.type->size == 1) && a.type->scalar != b.type->scalar)
        hint = karst_format(s->arena, "write %s(...) around one of them",
                            karst_type_vector(a.type->scalar, b.type->size)->name);
    else if ((spelt[0] == '<' || spelt[0] == '>') && spelt[1] != spelt[0])
        hint = "compare components, or use lessThan(a, b) and the like with all(...) or any(...)";
    karst_source_error(s->source, where, hint, "'%s' does not go between %s and %s", spelt, a.type->name, b.type->name);
}

/* Makes both operands of one scalar type; a scalar may meet a vector or matrix. */
static bool unify(karst_lower_state *s, karst_value *a, karst_value *b, uint32_t where)
{
    if (!(karst_type_is_plain(a->type) || a->type->shape == KARST_SHAPE_MATRIX) ||
        !(karst_type_is_plain(b->type) || b->type->shape == KARST_SHAPE_MATRIX))
        return false;
    if (a->type->scalar == b->type->scalar)
        return true;
    karst_value *whole = a->type->scalar == KARST_TYPE_INT ? a : b, *other = whole == a ? b : a;
    if (whole->type->scalar == KARST_TYPE_INT && other->type->scalar == KARST_TYPE_UINT) {
        *whole = karst_lower_convert(s, *whole, karst_type_vector(KARST_TYPE_UINT, whole->type->size), "this", where);
        return true;
    }
    karst_value *narrow = a->type->scalar == KARST_TYPE_FLOAT ? b : a;
    if ((narrow == b ? a : b)->type->scalar != KARST_TYPE_FLOAT || narrow->type->scalar == KARST_TYPE_BOOL)
        return false;
    *narrow = karst_lower_convert(s, *narrow, karst_type_vector(KARST_TYPE_FLOAT, narrow->type->size), "this", where);
    return true;
}

static karst_expr sum_of_products(karst_lower_state *s, const karst_expr *a, uint32_t step_a, const karst_expr *b,
                                  uint32_t step_b, uint32_t n)
{
    karst_expr sum = karst_expr_2(s->graph, KARST_OP_MULTIPLY, a[0], b[0]);
    for (uint32_t i = 1; i < n; i++)
        sum = karst_expr_3(s->graph, KARST_OP_FMA, a[i * step_a], b[i * step_b], sum);
    return sum;
}

/* Matrix by matrix, matrix by column, row by matrix. */
static karst_value multiply_matrices(karst_lower_state *s, karst_value a, karst_value b, uint32_t where)
{
    const bool is_row = a.type->shape == KARST_SHAPE_VECTOR, is_column = b.type->shape == KARST_SHAPE_VECTOR;
    const uint32_t n = b.type->size, rows = is_row ? 1 : a.type->size, columns = is_column ? 1 : b.type->count;
    if (a.type->count != n)
        bad_operands(s, '*', a, b, where);
    karst_value r = karst_value_new(s,
                                    is_row      ? karst_type_vector(KARST_TYPE_FLOAT, columns)
                                    : is_column ? karst_type_vector(KARST_TYPE_FLOAT, rows)
                                                : karst_type_matrix(columns, rows),
                                    where);
    for (uint32_t j = 0; j < columns; j++)
        for (uint32_t i = 0; i < rows; i++)
            r.e[j * rows + i] = sum_of_products(s, a.e + i, rows, b.e + j * n, 1, n);
    return r;
}

static const struct {
    uint32_t op;
    karst_op of_float, of_int; /* NONE: not for this type */
} arithmetic[] = {
    {'+', KARST_OP_ADD, KARST_OP_INT_ADD},
    {'-', KARST_OP_SUBTRACT, KARST_OP_INT_SUBTRACT},
    {'*', KARST_OP_MULTIPLY, KARST_OP_INT_MULTIPLY},
    {'/', KARST_OP_DIVIDE, KARST_OP_INT_DIVIDE},
    {'%', KARST_OP_NONE, KARST_OP_INT_MODULO},
    {'&', KARST_OP_NONE, KARST_OP_BIT_AND},
    {'|', KARST_OP_NONE, KARST_OP_BIT_OR},
    {'^', KARST_OP_NONE, KARST_OP_BIT_XOR},
    {KARST_P2('<', '<'), KARST_OP_NONE, KARST_OP_SHIFT_LEFT},
    {KARST_P2('>', '>'), KARST_OP_NONE, KARST_OP_SHIFT_RIGHT},
};

static karst_op operation_for(uint32_t op, karst_scalar_type type)
{
    for (size_t i = 0; i < sizeof arithmetic / sizeof *arithmetic; i++)
        if (arithmetic[i].op == op)
            return type == KARST_TYPE_FLOAT  ? arithmetic[i].of_float
                   : type == KARST_TYPE_BOOL ? KARST_OP_NONE
                                             : arithmetic[i].of_int;
    return KARST_OP_NONE;
}

/* `a`, if it is a bool and `b` a number or several: 1 or 0 of b's kind. */
static karst_value mask_of(karst_lower_state *s, karst_value a, karst_value b, uint32_t where)
{
    if (a.type != karst_type_vector(KARST_TYPE_BOOL, 1) || !karst_type_is_number(b.type))
        return a;
    karst_value r = karst_value_new(s, karst_type_vector(b.type->scalar, 1), where);
    r.e[0] = karst_expr_convert(s->graph, b.type->scalar, a.e[0]);
    return r;
}

karst_value karst_lower_arithmetic(karst_lower_state *s, uint32_t op, karst_value a, karst_value b, uint32_t where)
{
    bool shift = op == KARST_P2('<', '<') || op == KARST_P2('>', '>');
    karst_value left = a, right = b;
    if (op == '*') { /* HLSL's masks: a bool times a number is that number or 0 */
        left = mask_of(s, a, b, where);
        right = mask_of(s, b, a, where);
    }
    if (shift && karst_type_is_number(a.type) && karst_type_is_number(b.type) && b.type->scalar != KARST_TYPE_FLOAT &&
        a.type->scalar != b.type->scalar) {
        right = karst_value_new(s, karst_type_vector(a.type->scalar, b.type->size), where);
        for (uint32_t i = 0; i < b.type->size; i++)
            right.e[i] = karst_expr_convert(s->graph, a.type->scalar, b.e[i]);
        b = right;
    }
    if (!unify(s, &left, &right, where))
        bad_operands(s, op, a, b, where);
    karst_op code = operation_for(op, left.type->scalar);
    bool matrix = left.type->shape == KARST_SHAPE_MATRIX || right.type->shape == KARST_SHAPE_MATRIX;
    if (op == '%' && left.type->scalar == KARST_TYPE_FLOAT)
        karst_source_error(s->source, where, "write mod(a, b)", "'%%' is for ints only");
    if (code == KARST_OP_NONE)
        bad_operands(s, op, a, b, where);
    if (matrix && op == '*' && left.type->shape != KARST_SHAPE_SCALAR && right.type->shape != KARST_SHAPE_SCALAR)
        return multiply_matrices(s, left, right, where);
    bool la = left.type->shape == KARST_SHAPE_SCALAR, lb = right.type->shape == KARST_SHAPE_SCALAR;
    if (!la && !lb && left.type != right.type)
        bad_operands(s, op, a, b, where);
    karst_value r = karst_value_new(s, la ? right.type : left.type, where);
    for (uint32_t i = 0; i < r.type->num_scalars; i++)
        r.e[i] = karst_expr_2(s->graph, code, left.e[la ? 0 : i], right.e[lb ? 0 : i]);
    return r;
}

static karst_value one_bool(karst_lower_state *s, karst_expr e, uint32_t where)
{
    karst_value r = karst_value_new(s, karst_type_vector(KARST_TYPE_BOOL, 1), where);
    r.e[0] = e;
    return r;
}

static karst_value compare(karst_lower_state *s, uint32_t op, karst_value a, karst_value b, uint32_t where)
{
    bool equal = op == KARST_P2('=', '='), differs = op == KARST_P2('!', '=');
    karst_value left = a, right = b;
    if (karst_type_is_plain(a.type) && karst_type_is_plain(b.type) && !unify(s, &left, &right, where))
        bad_operands(s, op, a, b, where);
    if (left.type != right.type || left.type->shape == KARST_SHAPE_VOID)
        bad_operands(s, op, a, b, where);
    if (equal || differs) {
        karst_expr all = s->yes;
        for (uint32_t i = 0; i < left.type->num_scalars; i++)
            all = karst_expr_2(s->graph, KARST_OP_AND, all,
                               karst_expr_2(s->graph, KARST_OP_EQUAL, left.e[i], right.e[i]));
        return one_bool(s, equal ? all : karst_expr_1(s->graph, KARST_OP_NOT, all), where);
    }
    if (left.type->shape != KARST_SHAPE_SCALAR || left.type->scalar == KARST_TYPE_BOOL)
        bad_operands(s, op, a, b, where);
    bool swap = (op & 0xff) == '>';
    return one_bool(s,
                    karst_expr_2(s->graph, op > 0xff ? KARST_OP_LESS_EQUAL : KARST_OP_LESS,
                                 swap ? right.e[0] : left.e[0], swap ? left.e[0] : right.e[0]),
                    where);
}

/* a && b, a || b: what b changes, it changes only where it is reached. */
static karst_value short_circuit(karst_lower_state *s, uint32_t op, karst_expr a, const karst_ast_expr *right,
                                 uint32_t where)
{
    bool is_or = op == KARST_P2('|', '|');
    karst_value r = one_bool(s, a, where);
    const karst_number *known = karst_graph_constant(s->graph, a);
    if (known && known->numerator == is_or)
        return r;
    karst_branch branch = karst_branch_open(s);
    karst_expr b = karst_lower_condition(s, right, is_or ? "the right side of '||'" : "the right side of '&&'");
    karst_branch_close(s, branch);
    karst_branch_merge(s, is_or ? karst_expr_1(s->graph, KARST_OP_NOT, a) : a, branch.changes, s->num_changes);
    r.e[0] = karst_expr_2(s->graph, is_or ? KARST_OP_OR : KARST_OP_AND, a, b);
    return r;
}

static karst_value apply_binary(karst_lower_state *s, const karst_ast_expr *e, karst_value a)
{
    const karst_type *truth = karst_type_vector(KARST_TYPE_BOOL, 1);
    karst_lower_enter(s, e->where);
    karst_value r;
    switch (e->op) {
    case KARST_P2('&', '&'):
    case KARST_P2('|', '|'):
    case KARST_P2('^', '^'): {
        karst_value b = {.type = truth};
        a = truth_of(s, a, e->where);
        if (a.type == truth && e->op != KARST_P2('^', '^')) {
            r = short_circuit(s, e->op, a.e[0], e->b, e->where);
            break;
        }
        b = truth_of(s, karst_lower_expression(s, e->b), e->where);
        if (a.type != truth || b.type != truth)
            bad_operands(s, e->op, a, b, e->where);
        r = one_bool(
            s, karst_expr_3(s->graph, KARST_OP_SELECT, a.e[0], karst_expr_1(s->graph, KARST_OP_NOT, b.e[0]), b.e[0]),
            e->where);
        break;
    }
    case KARST_P2('=', '='):
    case KARST_P2('!', '='):
    case '<':
    case '>':
    case KARST_P2('<', '='):
    case KARST_P2('>', '='):
        r = compare(s, e->op, a, karst_lower_expression(s, e->b), e->where);
        break;
    default:
        r = karst_lower_arithmetic(s, e->op, a, karst_lower_expression(s, e->b), e->where);
    }
    karst_lower_leave(s);
    return r;
}

/* a + b + c + ... leans to the left, for up to a million terms: go down by a loop, come back by another. */
static karst_value lower_binary(karst_lower_state *s, const karst_ast_expr *e)
{
    size_t n = 0;
    for (const karst_ast_expr *b = e; b->kind == KARST_AST_BINARY; b = b->a)
        n++;
    const karst_ast_expr *few[16], **chain = n <= 16 ? few : karst_arena_alloc(s->arena, n * sizeof *chain);
    const karst_ast_expr *b = e;
    for (size_t i = 0; i < n; i++, b = b->a)
        chain[i] = b;
    uint32_t base = s->top;
    karst_value r = karst_lower_expression(s, b);
    while (n) {
        karst_value next = apply_binary(s, chain[--n], r);
        /* The result takes the place of what it was made of, so that the stack stays flat. */
        r = (karst_value){.type = next.type, .e = s->slots + base};
        memmove(r.e, next.e, next.type->num_scalars * sizeof *r.e);
        s->top = base + next.type->num_scalars;
    }
    return r;
}

static karst_value lower_unary(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_value a = karst_lower_expression(s, e->a);
    if (e->op == '!')
        a = truth_of(s, a, e->where);
    bool number = karst_type_is_number(a.type) || a.type->shape == KARST_SHAPE_MATRIX;
    bool is_int = number && a.type->scalar != KARST_TYPE_FLOAT;
    bool fits = e->op == '!' ? a.type == karst_type_vector(KARST_TYPE_BOOL, 1) : e->op == '~' ? is_int : number;
    if (!fits)
        karst_source_error(
            s->source, e->where,
            e->op == '!' && karst_type_is_plain(a.type) ? (a.type->size > 1 ? "write not(...)" : "write x == 0") : NULL,
            "'%c' does not go before %s", (int)e->op, karst_a_type(s, a.type));
    if (e->op == '+')
        return a;
    karst_value r = karst_value_new(s, a.type, e->where);
    for (uint32_t i = 0; i < a.type->num_scalars; i++) {
        if (e->op == '-' && is_int)
            r.e[i] = karst_expr_2(s->graph, KARST_OP_INT_SUBTRACT,
                                  karst_graph_number(s->graph, a.type->scalar, karst_number_int(0)), a.e[i]);
        else
            r.e[i] = karst_expr_1(s->graph,
                                  e->op == '-'   ? KARST_OP_NEGATE
                                  : e->op == '!' ? KARST_OP_NOT
                                                 : KARST_OP_BIT_NOT,
                                  a.e[i]);
    }
    return r;
}

/* The arm that is taken, by the type that both have: true ? 1 : 2.0 is a float. */
static karst_value lower_known_choice(karst_lower_state *s, const karst_ast_expr *e, bool yes)
{
    karst_value value = karst_lower_expression(s, yes ? e->b : e->c);
    if (value.type->scalar == KARST_TYPE_FLOAT || value.type->num_scalars > 4)
        return value;
    karst_branch branch = karst_branch_open(s); /* for its type alone */
    const karst_type *other = karst_lower_expression(s, yes ? e->c : e->b).type;
    karst_branch_close(s, branch);
    s->num_changes = branch.changes;
    return other->scalar == KARST_TYPE_FLOAT && karst_type_conversion(value.type, other) >= 0
               ? karst_lower_convert(s, value, other, "this", e->where)
               : value;
}

static karst_value lower_choice(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_expr condition = karst_lower_condition(s, e->a, "the condition before '?'");
    const karst_number *known = karst_graph_constant(s->graph, condition);
    if (known)
        return lower_known_choice(s, e, known->numerator != 0);
    karst_branch yes = karst_branch_open(s);
    karst_value a = karst_lower_expression(s, e->b);
    karst_branch_close(s, yes);
    size_t middle = s->num_changes;
    karst_branch no = karst_branch_open(s);
    karst_value b = karst_lower_expression(s, e->c);
    karst_branch_close(s, no);
    karst_branch_merge(s, condition, yes.changes, middle);
    if (karst_type_conversion(b.type, a.type) >= 0)
        b = karst_lower_convert(s, b, a.type, "this", e->where);
    else if (karst_type_conversion(a.type, b.type) >= 0)
        a = karst_lower_convert(s, a, b.type, "this", e->where);
    else
        karst_source_error(s->source, e->where, NULL, "the choices are of two types: %s and %s", a.type->name,
                           b.type->name);
    karst_value r = karst_value_new(s, a.type, e->where);
    for (uint32_t i = 0; i < r.type->num_scalars; i++)
        r.e[i] = karst_expr_3(s->graph, KARST_OP_SELECT, condition, a.e[i], b.e[i]);
    return r;
}

static karst_value lower_assignment(karst_lower_state *s, const karst_ast_expr *e)
{
    /* As in C, the place's own index is evaluated before the value. */
    karst_place place = karst_lower_place(s, e->a, "assigned to");
    karst_value value = karst_lower_expression(s, e->b);
    if (e->op)
        value = karst_lower_arithmetic(s, e->op, karst_place_read(s, &place, e->where), value, e->where);
    value = karst_lower_convert(s, value, place.type, "this assignment", e->b->where);
    karst_place_write(s, &place, value);
    return value;
}

static karst_value lower_step(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_place place = karst_lower_place(s, e->a, "counted");
    karst_value before = karst_place_read(s, &place, e->where);
    if (!karst_type_is_number(place.type))
        karst_source_error(s->source, e->where, NULL, "'%c%c' does not go with %s", (int)e->op, (int)e->op,
                           karst_a_type(s, place.type));
    karst_value one = karst_value_new(s, karst_type_vector(place.type->scalar, 1), e->where);
    one.e[0] = karst_graph_number(s->graph, place.type->scalar, karst_number_int(1));
    karst_value after = karst_lower_arithmetic(s, e->op, before, one, e->where);
    karst_place_write(s, &place, after);
    return e->postfix ? before : after;
}

/* ---- names ---- */

static const struct {
    const char *name;
    uint8_t size, scalar;
} implicit[] = {{"iTime", 1, KARST_TYPE_FLOAT},       {"iTimeDelta", 1, KARST_TYPE_FLOAT},
                {"iGlobalTime", 1, KARST_TYPE_FLOAT}, {"iMouse", 4, KARST_TYPE_FLOAT},
                {"iResolution", 3, KARST_TYPE_FLOAT}, {"iFrame", 1, KARST_TYPE_INT},
                {"iDate", 4, KARST_TYPE_FLOAT},       {"iFrameRate", 1, KARST_TYPE_FLOAT}};

static karst_expr parameter_leaf(karst_lower_state *s, const char *name, bool is_implicit)
{
    karst_lowering *io = s->io;
    uint32_t i = 0;
    while (i < io->num_parameters &&
           (io->parameters[i].is_implicit != is_implicit || strcmp(io->parameters[i].name, name)))
        i++;
    if (i == io->num_parameters) {
        if (!is_implicit || i == KARST_MAX_PARAMETERS + 16)
            return KARST_NO_EXPR;
        const bool is_set = io->time_s != 0 && !strcmp(name, KARST_TIME_PARAMETER);
        io->parameters[io->num_parameters++] =
            (karst_lower_parameter){.name = name,
                                    .value = is_set ? karst_number_shortest(io->time_s) : karst_number_int(0),
                                    .is_implicit = true};
    }
    io->parameters[i].is_used = true;
    return karst_graph_leaf(s->graph, KARST_OP_PARAMETER, i);
}

static bool lower_parameter(karst_lower_state *s, const char *name, uint32_t where, karst_value *value)
{
    karst_expr leaf = parameter_leaf(s, name, false);
    if (leaf) {
        *value = karst_value_new(s, karst_type_vector(KARST_TYPE_FLOAT, 1), where);
        value->e[0] = leaf;
        return true;
    }
    for (size_t i = 0; i < sizeof implicit / sizeof *implicit; i++) {
        if (strcmp(name, implicit[i].name))
            continue;
        *value = karst_value_new(s, karst_type_vector(implicit[i].scalar, implicit[i].size), where);
        for (int k = 0; k < implicit[i].size; k++) {
            const char *part = implicit[i].size == 1 ? name : karst_format(s->arena, "%s.%c", name, "xyzw"[k]);
            value->e[k] = karst_expr_convert(s->graph, implicit[i].scalar, parameter_leaf(s, part, true));
        }
        return true;
    }
    return false;
}

static _Noreturn void unknown_name(karst_lower_state *s, const char *name, uint32_t where)
{
    karst_nearest nearest = karst_nearest_begin(name, strlen(name));
    for (size_t i = s->frame.first_variable; i < s->num_variables; i++)
        karst_nearest_offer(&nearest, karst_lower_name(s, s->variables[i].name));
    for (uint32_t i = 0; i < s->num_globals; i++)
        karst_nearest_offer(&nearest, karst_lower_name(s, s->globals[i].ast->name));
    for (uint32_t i = 0; i < s->io->num_parameters; i++)
        karst_nearest_offer(&nearest, s->io->parameters[i].name);
    for (size_t i = 0; i < sizeof implicit / sizeof *implicit; i++)
        karst_nearest_offer(&nearest, implicit[i].name);
    const char *hint = karst_nearest_hint(&nearest, s->arena);
    for (const karst_ast_function *f = s->parser->functions; f; f = f->next)
        if (!strcmp(karst_lower_name(s, f->name), name))
            hint = karst_format(s->arena, "it is a function: write %s(...)", name);
    if (!strncmp(name, "gl_", 3))
        karst_source_error(s->source, where, "compute it from p, the place that is asked for",
                           "a world has no screen and no vertices, so there is no '%s'", name);
    if (!strncmp(name, "iChannel", 8))
        karst_source_error(s->source, where, "use noise(p) or write a function",
                           "a world has no textures, so there is no '%s'", name);
    karst_source_error(s->source, where, hint, "there is no variable '%s'", name);
}

/* A variable's own slots. */
static bool find_variable(karst_lower_state *s, const karst_ast_expr *e, karst_value *value)
{
    const karst_variable *v = karst_variable_find(s, e->name);
    karst_global *g = v ? NULL : karst_global_find(s, e->name);
    if (!v && !g)
        return false;
    if (g && !g->written && !g->ast->value && !g->warned) {
        g->warned = true;
        const char *name = karst_lower_name(s, e->name);
        const char *hint = karst_format(s->arena,
                                        "give it a value, or remove it and write \"params\": { \"%s\": 1 } "
                                        "into the header",
                                        name);
        karst_source_warn(s->source, e->where, g->type == karst_type_vector(KARST_TYPE_FLOAT, 1) ? hint : NULL,
                          "'%s' is read but not set: it is 0", name);
    }
    *value = (karst_value){.type = v ? v->type : g->type, .e = s->slots + (v ? v->slot : g->slot)};
    return true;
}

karst_value karst_rule_whole(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_value value;
    return e->kind == KARST_AST_NAME && find_variable(s, e, &value) ? value : karst_lower_expression(s, e);
}

static karst_value lower_name(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_value value, own;
    if (find_variable(s, e, &own)) {
        value = karst_value_new(s, own.type, e->where);
        memcpy(value.e, own.e, own.type->num_scalars * sizeof *value.e);
        return value;
    }
    const char *name = karst_lower_name(s, e->name);
    if (!strcmp(name, "PI") && karst_in_prelude(s)) {
        value = karst_value_new(s, karst_type_vector(KARST_TYPE_FLOAT, 1), e->where);
        value.e[0] = karst_graph_float(s->graph, 3.14159265358979323846);
        return value;
    }
    if (!karst_in_prelude(s) && lower_parameter(s, name, e->where, &value))
        return value;
    unknown_name(s, name, e->where);
}

/* Of an array its elements, of a vector its components, of a matrix its columns. */
static karst_value lower_count(karst_lower_state *s, const karst_ast_expr *e)
{
    const karst_type *type = karst_lower_whole(s, e->a).type;
    bool has_parts = type->shape == KARST_SHAPE_ARRAY || type->shape == KARST_SHAPE_MATRIX;
    if (!has_parts && type->shape != KARST_SHAPE_VECTOR)
        karst_source_error(s->source, e->where, NULL, "%s has no length(): only arrays, vectors and matrices have",
                           karst_a_type(s, type));
    karst_value value = karst_value_new(s, karst_type_vector(KARST_TYPE_INT, 1), e->where);
    value.e[0] = karst_graph_number(s->graph, KARST_TYPE_INT,
                                    karst_number_int(has_parts ? type->count : type->num_scalars));
    return value;
}

static karst_value lower_inner(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_value value;
    switch ((karst_ast_kind)e->kind) {
    case KARST_AST_NUMBER:
        value = karst_value_new(s, karst_type_vector(e->scalar, 1), e->where);
        value.e[0] = karst_graph_number(s->graph, e->scalar, e->number);
        return value;
    case KARST_AST_NAME:
        return lower_name(s, e);
    case KARST_AST_UNARY:
        return lower_unary(s, e);
    case KARST_AST_STEP:
        return lower_step(s, e);
    case KARST_AST_BINARY:
        return lower_binary(s, e);
    case KARST_AST_ASSIGN:
        return lower_assignment(s, e);
    case KARST_AST_CHOOSE:
        return lower_choice(s, e);
    case KARST_AST_CALL:
        return karst_lower_call(s, e);
    case KARST_AST_CONSTRUCT:
        return karst_lower_construct(s, e);
    case KARST_AST_MEMBER:
        return karst_lower_member(s, e);
    case KARST_AST_INDEX:
        return karst_lower_index(s, e);
    case KARST_AST_COUNT:
        return lower_count(s, e);
    case KARST_AST_COMMA:
        break;
    case KARST_AST_LIST:
    case KARST_AST_FIELD:
        karst_source_error(s->source, e->where, "write a constructor, such as vec3(1, 2, 3)",
                           "a list in braces can only begin a variable");
    }
    /* a, b, c: leans to the left */
    size_t n = 0;
    for (const karst_ast_expr *c = e; c->kind == KARST_AST_COMMA; c = c->a)
        n++;
    const karst_ast_expr **chain = karst_arena_alloc(s->arena, (n + 1) * sizeof *chain), *c = e;
    for (size_t i = n; i > 0; i--, c = c->a)
        chain[i] = c->b;
    chain[0] = c;
    for (size_t i = 0; i < n; i++) {
        uint32_t top = s->top;
        karst_lower_expression(s, chain[i]);
        s->top = top;
    }
    return karst_lower_expression(s, chain[n]);
}

karst_value karst_rule_expression(karst_lower_state *s, const karst_ast_expr *e)
{
    karst_lower_enter(s, e->where);
    karst_value value = lower_inner(s, e);
    karst_lower_leave(s);
    return value;
}
